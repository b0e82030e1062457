/// What a problem asks for beyond what bodies do: a body that floats brought farther in a time than pushing off the ground
/// brings anything, and a thing to be slid that is far heavier than what has to slide it. No proofs, since no law forbids
/// either: how hard a leg pushes, and for how short, is not bounded by its effort alone.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "cavort/problem.h"
#include "command.h"
#include "quantity.h"

// times gravity that pushing off the ground accelerates what floats by on the mean: sprinters and cats do half of that
static const double pushed = 2;

// times what feet hold on the ground that hands push for long; way along the ground from which a thing slides, m
static const double held = 1.5, slides = 0.05;

// a contact so near bears, m
static const double bears = 0.01;

static const char *name_of(const cav_model *m, int link) {
  const char *name = m->body[m->link[link].body].name;
  return name && *name ? name : "a body";
}

/// The link whose place in the world a term wants at a time; -1: it wants none.
static int placed(const cav_problem *p, const cav_term *term) {
  const int wanted =
      term->use == CAV_USE_COST && term->weight > 0 && term->target && term->nwaypoint == 0 && isfinite(term->within);
  return wanted ? cav_term_placed(p->model, term) : -1;
}

/// How far a link has to go for a term from where it starts, along the ground, in all, and up, m.
static void way_of(const cav_problem *p, const cav_term *term, cav_state *state, double way[3]) {
  double at[CAV_SENSOR_DIM_MAX];
  way[0] = way[1] = way[2] = 0;
  cav_sensor_read(p->model, state, &term->sensor, at);
  for (int k = 0; k < 3; k++) {
    if (term->component >= 0 && term->component != k) continue;
    const double d = fmax(fabs(term->target[k] - at[k]) - term->within, 0);
    if (k < 2) way[0] += d * d;
    way[1] += d * d;
    if (k == 2 && term->target[k] > at[k]) way[2] = d;
  }
  for (int k = 0; k < 2; k++) way[k] = sqrt(way[k]);
}

static int starts_at_rest(const cav_problem *p, int root) {
  const cav_model *m = p->model;
  for (int d = 0; d < m->nv; d++)
    if (m->link[m->dof[d].link].root == root && p->v_start[d] != 0) return 0;
  return 1;
}

static int tell_haste(FILE *out, const cav_problem *p, const cav_term *term, int link, double way) {
  const cav_model *m = p->model;
  const double g = hypot(hypot(m->gravity[0], m->gravity[1]), m->gravity[2]);
  const double time = term->to < 0 ? p->duration : fmin(term->to, p->duration), mean = 2 * way / (time * time);
  if (m->link[link].root != link || !cav_command_is_loose(m, link) || !starts_at_rest(p, link)) return 0;
  if (!(g > 0 && time > 0 && mean > pushed * g)) return 0;
  fprintf(out,
          "note: '%.60s' has to bring '%.60s' %.3g m on in %.3g s from rest, by %.2g g on the mean; legs push what "
          "floats by "
          "1 g, for a moment by 2 or 3: later (at=), or nearer\n",
          term->name && *term->name ? term->name : "a term", name_of(m, link), way, time, mean / g);
  return 1;
}

/// The largest friction of a tree with the world at a posture where it is borne; 0: nothing bears it.
static double friction_of(const cav_model *m, const cav_state *state, int root) {
  double most = 0;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const int link = c->link1 == 0 ? c->link2 : c->link2 == 0 ? c->link1 : 0;
    if (link > 0 && m->link[link].root == root && c->dist < bears) most = fmax(most, m->pair[c->pair].friction[0]);
  }
  return most;
}

/// way: along the ground, rise: up.
static int tell_weight(FILE *out, const cav_problem *p, const cav_state *state, int link, double way, double rise) {
  const cav_model *m = p->model;
  const double g = hypot(hypot(m->gravity[0], m->gravity[1]), m->gravity[2]);
  const int thing = m->link[link].root;
  const double rubs = friction_of(m, state, thing), takes = rubs * cav_command_tree_mass(m, thing) * g;
  if (m->link[thing].driven || !cav_command_floats(m, thing) || fmax(way, rise) < slides || !(takes > 0)) return 0;
  double holds = 0, mass = 0;
  int feet = 0;
  for (int root = 1; root < m->nlink; root++) {
    if (m->link[root].root != root || !m->link[root].driven) continue;
    // what hangs on the world holds as much as its actuators do
    if (!cav_command_floats(m, root)) return 0;
    holds += friction_of(m, state, root) * cav_command_tree_mass(m, root) * g, mass += cav_command_tree_mass(m, root),
        feet = root;
  }
  if (rise > way) {
    const double weighs = cav_command_tree_mass(m, thing) * g;
    if (!(mass > 0) || weighs < mass * g) return 0;
    fprintf(out,
            "note: to lift '%.60s' (%.3g kg) takes %.3g N; '%.60s' and all that hangs on it, which has to hold it, is "
            "%.3g kg: "
            "a lighter thing, or one that slides\n",
            name_of(m, thing), cav_command_tree_mass(m, thing), weighs, name_of(m, feet), mass);
    return 1;
  }
  if (!(holds > 0) || takes < held * holds) return 0;
  fprintf(
      out,
      "note: to slide '%.60s' (%.3g kg, friction %.2g) takes %.3g N; '%.60s' (%.3g kg) is held by its feet with %.3g N "
      "where it stands: a lighter thing, or one with less friction\n",
      name_of(m, thing), cav_command_tree_mass(m, thing), rubs, takes, name_of(m, feet), mass, holds);
  return 1;
}

int cav_command_tell_demands(FILE *out, const cav_problem *p) {
  int n = 0;
  cav_state *state = p->free_start || p->cycle.on ? NULL : cav_state_new(p->model);
  if (state) state->options.smoothing = bears;
  const int placeable = state && cav_position(p->model, state, p->q_start) == CAV_OK;
  for (int i = 0; i < p->nterm && placeable; i++) {
    const int link = placed(p, &p->term[i]);
    double way[3];
    if (link <= 0) continue;
    way_of(p, &p->term[i], state, way);
    n += tell_haste(out, p, &p->term[i], link, way[1]) + tell_weight(out, p, state, link, way[0], way[2]);
  }
  cav_state_free(state);
  return n;
}
