/// What the commands say of a start that nothing holds up, and of a goal that no motion can come to: one inside a solid,
/// or one that disagrees with what else is asked for at the end. A start inside a solid is a proof that nothing can be
/// solved (cav_problem_impossible); of a goal it depends on what is asked, since a goal also is no more than the end of a
/// guess.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "cavort/problem.h"
#include "cavort/solve.h"
#include "command.h"
#include "math3.h"
#include "problem_file.h"
#include "rotation.h"

// clear of everything by more than this it falls rather than settles
static const double clear = 0.02; // m

// a centre of mass so far beside its support falls; vertical part of a normal on which one stands, and directions looked at
static const double unbalanced = 0.05, level = 0.7; // m
enum { DIRECTIONS = 72 };

/// The posture evaluated, with contacts that are so far apart. NULL: it cannot be.
static cav_state *posture_of(const cav_problem *p, const double *q, double apart) {
  cav_state *state = cav_state_new(p->model);
  if (!state) return NULL;
  state->options.smoothing = state->options.smoothing_self = apart;
  if (!cav_position(p->model, state, q)) return state;
  cav_state_free(state);
  return NULL;
}

/// The term that asks for the goal's posture at the end, by more than the usual weight of the way there; NULL: none does.
static const cav_term *asks_for_goal(const cav_problem *p) {
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *t = &p->term[i];
    const double to = t->to < 0 ? p->duration : t->to;
    if (t->quantity != CAV_QUANTITY_CONFIGURATION || t->target || t->nwaypoint || to < p->duration - p->timestep / 2)
      continue;
    if (t->use != CAV_USE_COST || (t->weight > 0 && t->from >= to - 1e-9 && isfinite(t->within))) return t;
  }
  return NULL;
}

/// Of a posture that is deeper in something than a certificate allows: the goal, or a start that is only where the guess begins
/// (of one that is given it is a proof).
static int tell_depth(FILE *out, const cav_problem *p, int start) {
  const cav_model *m = p->model;
  cav_state *state = posture_of(p, start ? p->q_start : p->q_goal, 0);
  const cav_contact *deepest = state ? cav_command_deepest(state) : NULL;
  const int deep = deepest && -deepest->dist > CAV_TOLERANCE_PENETRATION;
  if (deep) {
    char moves[CAV_WORDS], stands[CAV_WORDS];
    const int still = cav_command_pair(m, deepest->pair, moves, stands);
    const cav_term *asked = start ? NULL : asks_for_goal(p);
    fprintf(out, "note: the %s has geom '%.100s' %.3g mm inside '%.100s', and a certificate allows %g: ",
            start ? "start" : "goal", moves, -1e3 * deepest->dist, stands, 1e3 * CAV_TOLERANCE_PENETRATION);
    if (asked)
      fprintf(out, "'%.60s' asks for it at the end and may not be met. ", asked->name ? asked->name : "posture");
    else
      fprintf(out,
              start ? "the guess begins there, no motion does. " : "no motion ends there, it only leads the guess. ");
    fprintf(out, "%s\n",
            m->geom[still].link != 0 ? "Change the posture"
            : m->geom[still].type == CAV_GEOM_PLANE
                ? "Change the posture; height='floor' without rise puts it on a floor"
                : "Change the posture, or move the solid");
  }
  cav_state_free(state);
  return deep;
}

/// How far a posture is from what a term on a place, an angle or an orientation asks for at the end, beyond what it allows.
typedef struct disagreement {
  double wanted, has, within;
  char unit[16], what[24]; ///< what: "z ", "turned by "
} disagreement;

/// Whether a term has to be met at the end, by one value that is read of a posture.
static int is_read_at_end(const cav_problem *p, const cav_term *t) {
  const double to = t->to < 0 ? p->duration : t->to;
  if (t->quantity != CAV_QUANTITY_SENSOR || !t->target || t->nwaypoint || t->use == CAV_USE_RANGE) return 0;
  if (cav_sensor_rule_of(t->sensor.type)->stage != CAV_READS_POSITION || t->sensor.cutoff > 0) return 0;
  if (t->use == CAV_USE_COST && !(t->weight > 0)) return 0;
  return to >= p->duration - p->timestep / 2 && t->from <= p->duration;
}

/// Whether a posture that the state is at misses such a term, and by what.
static int misses(const cav_problem *p, cav_state *state, const cav_term *t, disagreement *d) {
  const cav_sensor *s = &t->sensor;
  cav_tolerance tolerance;
  double at[CAV_SENSOR_DIM_MAX], turn[3], most = 0;
  if (!is_read_at_end(p, t) || !cav_term_tolerances(p, t, 1, &tolerance, NULL)) return 0;
  d->within = tolerance.within;
  memcpy(d->unit, tolerance.unit, sizeof d->unit);
  cav_sensor_read(p->model, state, s, at);
  if (s->dim == 4) {
    cav_rotation_between(t->target, at, turn);
    d->wanted = 0, d->has = t->component < 0 ? norm3(turn) : fabs(turn[t->component]);
    snprintf(d->what, sizeof d->what, "turned by ");
    return d->has > d->within;
  }
  for (int k = 0; k < s->dim; k++) {
    const double off = fabs(at[k] - t->target[k]);
    if ((t->component >= 0 && t->component != k) || !(off > d->within) || !(off > most)) continue;
    most = off, d->wanted = t->target[k], d->has = at[k];
    snprintf(d->what, sizeof d->what, "%s", s->dim == 1 ? "" : (const char *[]){"x ", "y ", "z "}[k]);
  }
  return most > 0;
}

/// A goal, and a term that wants another reading of it at the end: one that is asked for, by which the two cannot both be met,
/// or one that only leads the guess.
static int tell_disagreement(FILE *out, const cav_problem *p, const cav_term *asked) {
  cav_state *state = posture_of(p, p->q_goal, 0);
  int n = 0;
  for (int i = 0; state && i < p->nterm; i++) {
    const cav_term *t = &p->term[i];
    disagreement d;
    // of coordinates it is a proof
    if ((asked && t->sensor.type == CAV_SENSOR_JOINTPOS) || !misses(p, state, t, &d)) continue;
    const char *gap = *d.unit ? " " : "";
    fprintf(
        out,
        "note: the goal disagrees with '%.60s', which wants %s%.3g%s%s (within %.3g) at the end: the goal's posture",
        *t->name ? t->name : "sensor", d.what, d.wanted, gap, d.unit, d.within);
    if (asked)
      fprintf(out,
              ", which '%.60s' asks for, has %.3g there. Change one of them, or end the one before the other begins "
              "(to=)\n",
              asked->name && *asked->name ? asked->name : "posture", d.has);
    else
      fprintf(out, " has %.3g. It only leads the guess, since no term asks for it: a <goal> that has it leads there\n",
              d.has);
    n++;
  }
  cav_state_free(state);
  return n;
}

int cav_command_tell_goal(FILE *out, const cav_problem *p) {
  if (p->cycle.on || asks_for_goal(p) || !cav_problem_has_goal(p)) return 0;
  return tell_disagreement(out, p, NULL);
}

double cav_command_tree_mass(const cav_model *m, int root) {
  double mass = 0;
  for (int l = root; l < m->nlink; l++)
    if (m->link[l].root == root) mass += m->link[l].mass;
  return mass;
}

int cav_command_floats(const cav_model *m, int root) {
  const cav_link *link = &m->link[root];
  if (link->parent != 0 || !link->njoint || m->joint[link->joint].type != CAV_JOINT_FREE) return 0;
  for (int b = 1; b < m->nbody; b++)
    if (m->link[m->body[b].link].root == root && m->body[b].buoyancy != 0) return 0;
  return 1;
}

int cav_command_is_loose(const cav_model *m, int root) { return m->link[root].driven && cav_command_floats(m, root); }

/// Whether a contact is near and with something else than the tree's own links.
static int bears(const cav_model *m, const cav_contact *c, int root) {
  const int a = m->link[c->link1].root, b = m->link[c->link2].root;
  return a != b && (a == root || b == root) && c->dist <= clear;
}

static int touches(const cav_model *m, const cav_state *state, int root) {
  for (int i = 0; i < state->ncontact; i++)
    if (bears(m, &state->contact[i], root)) return 1;
  return 0;
}

/// How far the centre of mass of a tree is beside what it stands on, seen from above: over all directions the most that it is
/// farther than every contact. -1 where it does not stand on the world alone, on surfaces that face up.
static double beside_support(const cav_model *m, const cav_state *state, int root, double support[2]) {
  double centre[2] = {0}, mass = 0, most = 0;
  int n = 0;
  for (int i = 1; i < m->nlink; i++) {
    if (m->link[i].root != root) continue;
    mass += m->link[i].mass;
    for (int k = 0; k < 2; k++) centre[k] += m->link[i].mass * state->com[3 * (size_t)i + (size_t)k];
  }
  for (int i = 0; i < state->ncontact; i++) {
    if (!bears(m, &state->contact[i], root)) continue;
    const int a = m->link[state->contact[i].link1].root, b = m->link[state->contact[i].link2].root;
    if (a + b != root || fabs(state->contact[i].frame[2]) < level) return -1;
    n++;
  }
  if (!n || !(mass > 0)) return -1;
  for (int d = 0; d < DIRECTIONS; d++) {
    const double way[2] = {cos(2 * M_PI * d / DIRECTIONS), sin(2 * M_PI * d / DIRECTIONS)};
    double beyond = INFINITY;
    for (int i = 0; i < state->ncontact; i++) {
      const cav_contact *c = &state->contact[i];
      const double past = way[0] * (centre[0] / mass - c->pos[0]) + way[1] * (centre[1] / mass - c->pos[1]);
      if (bears(m, c, root)) beyond = fmin(beyond, past);
    }
    if (beyond > most) most = beyond, support[0] = -way[0], support[1] = -way[1];
  }
  return most;
}

/// Whether the start is at rest under gravity alone, in no medium and held by no equality constraint: what nothing holds falls.
static int rests(const cav_problem *p) {
  const cav_model *m = p->model;
  for (int d = 0; d < m->nv; d++)
    if (p->v_start[d] != 0) return 0;
  return m->gravity[2] < 0 && !m->nequality && !(m->density > 0) && !(m->viscosity > 0);
}

/// Of a start at rest on its feet whose centre of mass is not over them.
static int tell_lean(FILE *out, const cav_problem *p) {
  const cav_model *m = p->model;
  int n = 0;
  if (!rests(p) || m->gravity[0] != 0 || m->gravity[1] != 0) return 0;
  cav_state *state = posture_of(p, p->q_start, clear);
  for (int i = 1; state && i < m->nlink; i++) {
    double way[2];
    const double off = cav_command_is_loose(m, i) ? beside_support(m, state, i, way) : -1;
    if (off < unbalanced) continue;
    const char *name = m->body[m->link[i].body].name;
    fprintf(
        out,
        "note: at the start the centre of mass of '%.60s' and all that hangs on it is %.2g m beside what it stands on, "
        "which is towards "
        "(%.1f %.1f): it falls over unless it steps at once. Lean the posture over its support, or put more of it "
        "on the ground\n",
        *name ? name : "body", off, round(10 * way[0]) / 10 + 0.0, round(10 * way[1]) / 10 + 0.0);
    n++;
  }
  cav_state_free(state);
  return n;
}

static int tell_fall(FILE *out, const cav_problem *p) {
  const cav_model *m = p->model;
  int n = 0;
  if (!rests(p)) return 0;
  double *q = calloc((size_t)m->nq + 1, sizeof *q);
  cav_state *state = q ? posture_of(p, p->q_start, clear) : NULL, *low = state ? cav_state_new(m) : NULL;
  if (low) memcpy(q, p->q_start, (size_t)m->nq * sizeof *q);
  const int lowered = low && !cav_configuration_to_floor(m, low, NULL, q, NULL);
  for (int i = 1; low && i < m->nlink; i++) {
    if (!cav_command_floats(m, i) || touches(m, state, i)) continue;
    const int z = m->joint[m->link[i].joint].q + 2;
    const double height = lowered ? p->q_start[z] - q[z] : 0;
    const char *name = m->body[m->link[i].body].name;
    if (lowered && height <= clear) continue;
    fprintf(out, "note: at the start '%.60s' touches nothing and is at rest", *name ? name : "body");
    if (lowered) fprintf(out, ", %.3g m above what is below it: it falls", height);
    fprintf(out, lowered
                     ? ". To stand, <start height='floor'>; of a flight, linvel= of its <root> says how fast it goes\n"
                     : ": it falls\n");
    n++;
  }
  cav_state_free(low);
  cav_state_free(state);
  free(q);
  return n;
}

/// Whether actuators and contacts bear a posture at rest; tells what does not. What nothing moves may fall from the start on.
static int tell_weakness(FILE *out, const cav_problem *p, const char *name, const double *q, double from) {
  const cav_term held = {.name = name,
                         .quantity = CAV_QUANTITY_CONFIGURATION,
                         .use = CAV_USE_EQUAL,
                         .dofs = CAV_DOFS_ALL,
                         .from = from,
                         .to = from + 2 * p->timestep,
                         .scale = 1,
                         .target = q};
  // the balance alone: a problem that asks for nothing else and starts there
  cav_problem alone = *p;
  cav_impossibility found[3];
  cav_error ignored = {0};
  int n = 0;
  alone.q_start = (double *)q;
  alone.term = (cav_term *)&held;
  alone.nterm = 1;
  if (cav_problem_impossible(&alone, found, 3, &n, &ignored) != CAV_OK) return 0;
  for (int i = 0; i < n; i++) {
    if (found[i].condition != CAV_CONDITION_STRENGTH) continue;
    const cav_joint *joint = found[i].joint < 0 ? NULL : &p->model->joint[found[i].joint];
    if (joint && from == 0 && !p->model->link[joint->link].driven)
      fprintf(out,
              "note: at the start nothing holds '%.60s', which no actuator moves: it begins to move along its joint "
              "'%.48s', as is right of what is let go\n",
              p->model->body[joint->body].name, joint->name);
    else
      fprintf(out, "note: at rest, %s\n", found[i].what);
    return 1;
  }
  return 0;
}

/// Whether the goal's posture is asked for over a while, or at the end of a motion that is at rest then.
static int goal_is_held(const cav_problem *p) {
  if (p->close_at_rest && asks_for_goal(p)) return 1;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *t = &p->term[i];
    const double to = t->to < 0 ? p->duration : t->to;
    if (t->quantity == CAV_QUANTITY_CONFIGURATION && !t->target && !t->nwaypoint && t->dofs == CAV_DOFS_ALL &&
        isfinite(t->within) && t->from > 0 && to > t->from + 2 * p->timestep &&
        (t->use != CAV_USE_COST || t->weight > 0))
      return 1;
  }
  return 0;
}

static int is_impossible(const cav_problem *p) {
  cav_impossibility found;
  cav_error ignored = {0};
  int n = 0;
  return cav_problem_impossible(p, &found, 1, &n, &ignored) == CAV_OK && n > 0;
}

int cav_command_tell_postures(FILE *out, const cav_problem *p) {
  int n = 0;
  if (p->cycle.on) return tell_depth(out, p, 1);
  if (!p->free_start) n += tell_fall(out, p) + tell_lean(out, p);
  // a goal that is the start's was examined as that where the start is given
  const int same = !memcmp(p->q_goal, p->q_start, sizeof *p->q_goal * (size_t)p->model->nq);
  if (p->free_start || !same) n += tell_depth(out, p, 0);
  if (p->free_start && !same) n += tell_depth(out, p, 1);
  const cav_term *asked = asks_for_goal(p);
  if (asked && asked->dofs == CAV_DOFS_ALL) n += tell_disagreement(out, p, asked);
  // what falls is told, and so is what is proven impossible
  if (n > 0 || p->duration < 3 * p->timestep || is_impossible(p)) return n;
  if (!p->free_start && rests(p)) n += tell_weakness(out, p, "start", p->q_start, 0);
  if (!(!p->free_start && same && n) && goal_is_held(p))
    n += tell_weakness(out, p, "goal", p->q_goal, p->duration - 2 * p->timestep);
  return n;
}
