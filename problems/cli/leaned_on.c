/// What of the world a motion leans on where neither its first nor its last knot does: a wall that can be stood on is stood
/// on, and who asked for a way over it is told. And whether a motion whose guess flies does not: who asked for a height alone
/// may get one that rears up to it. And whether a body that is asked up at a time is up on its toes, what links of one body
/// lean on each other, whether anything holds at the end what is to be at rest then, which parts besides those that it begins
/// and ends on bear on the ground, whether what is asked down to the ground stays above it, and what moves a thing if no hand
/// does.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/result.h"
#include "command.h"
#include "role.h"
#include "thing.h"

// part of the weight from which on a solid counts as leaned on, and most solids that are named
static const double leaning = 0.05;
enum { NAMED = 3 };

static double size_of(const cav_contact_force *f) {
  return sqrt(f->force[0] * f->force[0] + f->force[1] * f->force[1] + f->force[2] * f->force[2]);
}

static const char *or_else(const char *name, const char *otherwise) { return name && *name ? name : otherwise; }

/// Name of a geom, of its body where it has none.
static const char *name_of(const cav_model *m, int geom, const char *otherwise) {
  return or_else(m->geom[geom].name,
                 or_else(m->geom[geom].body > 0 ? m->body[m->geom[geom].body].name : NULL, otherwise));
}

/// Whether a term asks for a force on a geom.
static int is_to_bear(const cav_problem *problem, int geom) {
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    if (term->quantity == CAV_QUANTITY_SENSOR && term->sensor.type == CAV_SENSOR_TOUCH &&
        cav_touch_sees(problem->model, &term->sensor, geom))
      return 1;
  }
  return 0;
}

/// The solid of the world that pushes there: no ground; -1: none.
static int solid_of(const cav_model *m, const cav_contact_force *f, int *part) {
  for (int k = 0; k < 2; k++) {
    int geom = k ? f->geom2 : f->geom1;
    cav_geom_type type = m->geom[geom].type;
    if (m->geom[geom].link > 0 || type == CAV_GEOM_PLANE || type == CAV_GEOM_HFIELD) continue;
    *part = k ? f->geom1 : f->geom2;
    return geom;
  }
  return -1;
}

// part of the weight below which the world does not bear what flies
static const double flying = 0.01;

/// Whether at some knot with forces the world bears none of the trees that actuators move.
static int is_in_the_air(const cav_model *m, const cav_forces *forces, double weight) {
  int flies = 0, i = 0;
  for (int t = 0; t < forces->nknot - 1 && !flies; t++) {
    double borne = 0;
    for (; i < forces->nforce && forces->force[i].knot <= t; i++) {
      const cav_contact_force *f = &forces->force[i];
      const int one = m->geom[f->geom1].link, other = m->geom[f->geom2].link;
      if ((one > 0 && other > 0) || f->knot < t || !m->link[one > 0 ? one : other].driven) continue;
      borne += size_of(f);
    }
    flies = borne < flying * weight;
  }
  return flies;
}

/// Height of a term's object at a knot of the motion.
static double height_at(const cav_model *m, cav_state *state, const cav_term *term, const cav_trajectory *motion,
                        int t) {
  cav_pose pose = {.pos = {0, 0, NAN}};
  if (cav_position(m, state, motion->q + (size_t)t * (size_t)m->nq) == CAV_OK)
    cav_object_pose(m, state, term->sensor.object_type, term->sensor.object, &pose);
  return pose.pos[2];
}

/// Whether a term is of a height of something in the world.
static int is_height(const cav_term *term) {
  return term->quantity == CAV_QUANTITY_SENSOR && term->sensor.type == CAV_SENSOR_FRAMEPOS && !term->sensor.referred &&
         (term->component < 0 || term->component == 2);
}

// m from which on something is higher than at the start
static const double raised = 0.02;

/// What the ground still bears of a link at a knot, N.
static double borne_of(const cav_model *m, const cav_forces *forces, int knot, int link) {
  double borne = 0;
  int part;
  for (int i = 0; i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    const int one = m->geom[f->geom1].link, other = m->geom[f->geom2].link;
    if (f->knot == knot && (one == link || other == link) && (one == 0 || other == 0) && solid_of(m, f, &part) < 0)
      borne += size_of(f);
  }
  return borne;
}

/// A term's window, as attributes.
static void write_window(const cav_term *term, char *out, size_t size) {
  const double from = fmax(term->from, 0);
  if (term->to < 0)
    snprintf(out, size, "from=\"%.4g\"", from);
  else if (term->to <= from)
    snprintf(out, size, "at=\"%.4g\"", from);
  else
    snprintf(out, size, "from=\"%.4g\" to=\"%.4g\"", from, term->to);
}

/// The least height that a term asks for at its begin; minus infinity where it asks for none.
static double least_height(const cav_term *term) {
  if (!is_height(term) || (!term->target && term->use != CAV_USE_RANGE)) return -INFINITY;
  return (term->target ? term->target[2] : 0) + (term->use == CAV_USE_RANGE ? term->lower : 0);
}

/// The knot of a term's window at which the ground bears most of a link that is higher than before; *most: how much, N.
static int find_borne(const cav_model *m, cav_state *state, const cav_term *term, const cav_trajectory *motion,
                      const cav_forces *forces, int link, double before, double *most) {
  const double to = term->to < 0 ? (motion->nknot - 1) * motion->timestep : term->to;
  int found = -1;
  *most = 0;
  for (int t = (int)lround(term->from / motion->timestep); t <= (int)lround(to / motion->timestep); t++) {
    const double borne = t < motion->nknot ? borne_of(m, forces, t, link) : 0;
    if (borne > *most && height_at(m, state, term, motion, t) > before + raised) *most = borne, found = t;
  }
  return found;
}

/// Bodies that are asked to be higher than at the start, later on, and are, on what of them still stands on the ground.
static void tell_toes(FILE *out, const cav_problem *problem, const cav_trajectory *motion, const cav_forces *forces,
                      double weight) {
  const cav_model *m = problem->model;
  cav_state *state = cav_state_new(m);
  for (int i = 0, n = 0; state && i < problem->nterm && n < NAMED; i++) {
    const cav_term *term = &problem->term[i];
    const double wanted = least_height(term);
    if (!isfinite(wanted) || !(term->from > 0)) continue;
    const int link = cav_object_link(m, term->sensor.object_type, term->sensor.object);
    if (link <= 0) continue;
    const double before = height_at(m, state, term, motion, 0);
    double borne;
    const int t = wanted > before + raised ? find_borne(m, state, term, motion, forces, link, before, &borne) : -1;
    if (t < 0 || borne < leaning * weight) continue;
    n++;
    fprintf(
        out,
        "  note: '%s' is met on the ground: at %.3g s it bears %.3g N of that body; off the ground is higher than it "
        "reaches on its toes, or ",
        or_else(term->name, "a height"), t * motion->timestep, borne);
    const char *body = m->body[m->link[link].body].name;
    char window[80];
    write_window(term, window, sizeof window);
    if (body && *body)
      fprintf(out, "<constraint><sensor type=\"touch\" body=\"%s\" upper=\"0\" %s/></constraint>\n", body, window);
    else
      fputs("a height of the centre of mass that nothing reaches on the ground\n", out);
  }
  cav_state_free(state);
}

// part of the weight from which on links of one tree lean on each other
static const double self_leaning = 0.25;

/// Two links of one tree that lean on each other hardest, where that is no resting posture's: arms folded at the start are
/// asked for.
static void tell_self(FILE *out, const cav_problem *problem, const cav_forces *forces, const cav_trajectory *motion,
                      double weight) {
  const cav_model *m = problem->model;
  const cav_contact_force *most = NULL;
  double size = self_leaning * weight;
  for (int i = 0; i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    const int one = m->geom[f->geom1].link, other = m->geom[f->geom2].link;
    if (one == 0 || other == 0 || m->link[one].root != m->link[other].root || size_of(f) <= size) continue;
    if (f->knot == 0 || f->knot >= forces->nknot - 2) return;
    most = f, size = size_of(f);
  }
  if (!most) return;
  const char *a = or_else(m->body[m->geom[most->geom1].body].name, "a body"),
             *b = or_else(m->body[m->geom[most->geom2].body].name, "a body");
  double costs = 0;
  for (int i = 0; i < problem->nterm; i++)
    if (problem->term[i].quantity == CAV_QUANTITY_SELF_FORCE) costs = fmax(costs, problem->term[i].weight);
  fprintf(
      out,
      "  note: it leans on itself: '%s' on '%s' with up to %.3g N, at %.3g s; <self_force weight=\"%g\"/> makes that "
      "cost %s\n",
      a, b, size, most->knot * motion->timestep, costs > 0 ? 10 * costs : 1, costs > 0 ? "more" : "something");
}

// part of the weight from which on the ground is hit by what is asked to come there, and below which nothing bears on it
static const double hit = 0.5, borne_by_nothing = 0.01;

/// Whether a term asks for a place of a link.
static int is_asked(const cav_problem *problem, int link) {
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    if (term->quantity == CAV_QUANTITY_SENSOR && term->sensor.type == CAV_SENSOR_FRAMEPOS &&
        cav_object_link(problem->model, term->sensor.object_type, term->sensor.object) == link)
      return 1;
  }
  return 0;
}

/// The geom of a driven tree that the ground pushes there; -1: none.
static int on_ground(const cav_model *m, const cav_contact_force *f) {
  const int one = m->geom[f->geom1].link, other = m->geom[f->geom2].link, part = one > 0 ? f->geom1 : f->geom2;
  int unused;
  return (one > 0) != (other > 0) && m->link[one + other].driven && solid_of(m, f, &unused) < 0 ? part : -1;
}

/// Marks the geoms of feet: they are meant to stand, whether they do at the start or not.
static void mark_feet(const cav_model *m, char *stands) {
  cav_state *state = cav_state_new(m);
  cav_roles roles;
  if (state && !cav_roles_find(m, state, &roles))
    for (int r = CAV_ROLE_RIGHT_FOOT; r <= CAV_ROLE_BACK_LEFT_FOOT; r++)
      for (int g = 0; g < m->ngeom && roles.body[r] > 0; g++)
        stands[g] |= roles.geom[r] < 0 ? m->geom[g].body == roles.body[r] : g == roles.geom[r];
  cav_state_free(state);
}

/// Parts that bear on the ground on the way and neither at the start nor at the end: shins, a hand that hits the floor. Of a
/// period, which has no ends of its own, nothing is told.
static void tell_ground(FILE *out, const cav_problem *problem, const cav_trajectory *motion, const cav_forces *forces,
                        double weight) {
  const cav_model *m = problem->model;
  const cav_contact_force **most = calloc((size_t)m->ngeom + 1, sizeof *most);
  char *stands = calloc((size_t)m->ngeom + 1, 1);
  if (stands) mark_feet(m, stands);
  for (int i = 0; most && stands && !problem->cycle.on && i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    const int geom = on_ground(m, f);
    if (geom < 0) continue;
    const int ends = f->knot == 0 || f->knot >= forces->nknot - 2;
    if (ends && size_of(f) > borne_by_nothing * weight) stands[geom] = 1;
    if (!most[geom] || size_of(f) > size_of(most[geom])) most[geom] = f;
  }
  int n = 0;
  for (int g = 0; most && stands && g < m->ngeom; g++) {
    if (!most[g] || stands[g]) continue;
    int whole = 0; // both sides of a sole are alike, a shin and the ball that it ends in are not
    for (int k = 0; k < m->ngeom; k++)
      whole |= stands[k] && m->geom[k].body == m->geom[g].body && m->geom[k].type == m->geom[g].type;
    const double least = is_asked(problem, m->geom[g].link) ? hit : leaning;
    // of a body's geoms without names the one that bears most stands for all
    for (int k = 0; k < m->ngeom && !*or_else(m->geom[g].name, ""); k++)
      whole |= k != g && most[k] && m->geom[k].body == m->geom[g].body && !*or_else(m->geom[k].name, "") &&
               (size_of(most[k]) > size_of(most[g]) || (size_of(most[k]) == size_of(most[g]) && k < g));
    if (whole || size_of(most[g]) < least * weight || n++ >= NAMED) continue;
    const char *body = or_else(m->body[m->geom[g].body].name, "a body"), *name = m->geom[g].name;
    const int named = name && *name && strcmp(name, body);
    fprintf(out, "%s'%.60s'%s%.60s (up to %.3g N at %.3g s)", n == 1 ? "  note: on its way the ground bears " : ", ",
            body, named ? ", geom " : "", named ? name : "", size_of(most[g]), most[g]->knot * motion->timestep);
  }
  if (n > 0) fprintf(out, "; the weight is %.3g N\n", weight);
  free(most);
  free(stands);
}

// m: from which on what is asked down to the ground is above it, and up to which it was meant to be there
static const double off_ground = 1e-3, meant = 0.03;

/// How far above the ground a link is at a knot, infinite where that is far.
static double gap_of(const cav_model *m, cav_state *state, int link, const double *q) {
  double gap = INFINITY;
  state->options.smoothing = meant;
  if (cav_position(m, state, q)) return gap;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const cav_pair *pair = &m->pair[c->pair];
    const cav_geom_type type = m->geom[m->geom[pair->geom1].link == 0 ? pair->geom1 : pair->geom2].type;
    const int ground = type == CAV_GEOM_PLANE || type == CAV_GEOM_HFIELD;
    if (ground && c->link1 + c->link2 == link && (c->link1 == 0 || c->link2 == 0)) gap = fmin(gap, c->dist);
  }
  return gap;
}

/// What has a link bear a tenth of the weight: a touch sensor of its body over the time of a term, if that has a name.
static void tell_bearing(FILE *out, const cav_model *m, const cav_term *term, int link, double weight) {
  const char *body = or_else(m->body[m->link[link].body].name, "");
  const double force = fmax(1, round(0.1 * weight));
  char window[80];
  write_window(term, window, sizeof window);
  if (!*body)
    fputs("where it is to rest there a target lower by more than that, and a smaller within, press it down\n", out);
  else
    fprintf(out,
            "<sensor type=\"touch\" body=\"%s\" target=\"%g\" within=\"%g\" scale=\"%g\" %s weight=\"30\"/> beside it "
            "has it bear %g N\n",
            body, force, ceil(0.25 * force), force, window, force);
}

/// Bodies that are asked down to the ground at a time, come near it and do not touch it.
static void tell_hovering(FILE *out, const cav_problem *problem, const cav_trajectory *motion, const cav_forces *forces,
                          double weight) {
  const cav_model *m = problem->model;
  cav_state *state = cav_state_new(m);
  for (int i = 0, n = 0; state && i < problem->nterm && n < NAMED; i++) {
    const cav_term *term = &problem->term[i];
    if (!is_height(term) || !term->target) continue;
    const double to = term->to < 0 ? problem->duration : term->to, time = (fmax(term->from, 0) + to) / 2;
    const int t = (int)lround(time / motion->timestep),
              link = cav_object_link(m, term->sensor.object_type, term->sensor.object);
    if (t >= motion->nknot - 1 || link <= 0) continue;
    int bears = 0; // before or after, too, as a hand that pushes off
    for (int k = 0; k < forces->nforce && !bears; k++) {
      const int part = on_ground(m, &forces->force[k]);
      bears = part >= 0 && m->geom[part].link == link && size_of(&forces->force[k]) > borne_by_nothing * weight;
    }
    const double gap = gap_of(m, state, link, motion->q + (size_t)t * (size_t)m->nq);
    const double before = gap_of(m, state, link, motion->q);
    if (bears || !(gap > off_ground && gap < meant && before > 2 * meant)) continue;
    n++;
    fprintf(out, "  note: '%s' stays %.2g mm above the ground at %.3g s, which bears nothing of it; ",
            or_else(term->name, "a place"), 1e3 * gap, t * motion->timestep);
    tell_bearing(out, m, term, link, weight);
  }
  cav_state_free(state);
}

// times its weight from which on what one link of a tree takes of the world is told: runners take two to three on a foot
static const double hard = 3;

/// What each link takes of the world at its worst, N, and when.
typedef struct blow {
  double now[3], most;
  int knot;
} blow;

static void end_knot(blow *of, int n, int knot) {
  for (int l = 0; l < n; l++) {
    const double size = hypot(hypot(of[l].now[0], of[l].now[1]), of[l].now[2]);
    if (size > of[l].most) of[l].most = size, of[l].knot = knot;
    memset(of[l].now, 0, sizeof of[l].now);
  }
}

static int has_force_cost(const cav_problem *problem, int link) {
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    const int all = term->body == 0, own = !all && problem->model->body[term->body].link == link;
    if (term->quantity == CAV_QUANTITY_FORCE && term->weight > 0 && (all || own)) return 1;
  }
  return 0;
}

/// Whether nothing holds a tree up but what it stands on: it floats, or slides up and down by no actuator.
static int falls(const cav_model *m, int root) {
  const cav_link *link = &m->link[root];
  int slides = 0;
  for (int j = link->joint; j < link->joint + link->njoint; j++)
    slides |= m->joint[j].type == CAV_JOINT_SLIDE && !m->joint[j].driven && fabs(m->joint[j].axis[2]) > 0.9;
  return cav_command_floats(m, root) || (link->parent == 0 && slides);
}

/// Links that take many weights of their tree at once, as one foot that lands stiff, unless their forces cost.
static void tell_blows(FILE *out, const cav_problem *problem, const cav_forces *forces, double timestep) {
  const cav_model *m = problem->model;
  blow *of = calloc((size_t)m->nlink, sizeof *of);
  for (int i = 0; of && i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    const int one = m->geom[f->geom1].link, other = m->geom[f->geom2].link;
    if (i > 0 && f->knot != f[-1].knot) end_knot(of, m->nlink, f[-1].knot);
    for (int k = 0; k < 3 && (one == 0 || other == 0); k++)
      of[one].now[k] -= f->force[k], of[other].now[k] += f->force[k];
  }
  if (of && forces->nforce) end_knot(of, m->nlink, forces->force[forces->nforce - 1].knot);
  for (int root = 1; of && root < m->nlink; root++) {
    if (m->link[root].root != root || !m->link[root].driven || !falls(m, root)) continue;
    const double mass = cav_command_tree_mass(m, root);
    const double weight = mass * hypot(hypot(m->gravity[0], m->gravity[1]), m->gravity[2]);
    int worst = root;
    for (int l = root; l < m->nlink; l++)
      if (m->link[l].root == root && of[l].most > of[worst].most) worst = l;
    if (!(weight > 0) || of[worst].most < hard * weight || has_force_cost(problem, worst)) continue;
    const char *name = or_else(m->body[m->link[worst].body].name, "a body");
    fprintf(out,
            "  note: '%.60s' takes %.3g N at %.3g s, %.2g times the weight; <force body=\"%.60s\" weight=\"1\"/> "
            "softens that\n",
            name, of[worst].most, of[worst].knot * timestep, of[worst].most / weight, name);
  }
  free(of);
}

// N from which on a force on what has to move counts
static const double touched = 1;

// m/s that the last step may take away at an end at rest without that being told
static const double braking = 0.1;

/// A tree that floats and that nothing holds at the end, where all is to be at rest: at the top of a hop it is, for a moment;
/// or that forces stop in the last step alone, which a tolerance of the velocity lets them do.
static void tell_ending(FILE *out, const cav_problem *problem, const cav_forces *forces, double timestep) {
  const cav_model *m = problem->model;
  if (!problem->close_at_rest || problem->cycle.on || m->nequality || m->density > 0 || m->viscosity > 0 ||
      !(m->gravity[2] < 0))
    return;
  for (int root = 1; root < m->nlink; root++) {
    if (!cav_command_floats(m, root)) continue;
    const double mass = cav_command_tree_mass(m, root);
    double borne[3] = {0};
    for (int i = 0; i < forces->nforce; i++) {
      const cav_contact_force *f = &forces->force[i];
      const int one = m->link[m->geom[f->geom1].link].root, other = m->link[m->geom[f->geom2].link].root;
      if (f->knot != forces->nknot - 1 || one == other) continue;
      // what is held between hands holds nothing
      for (int k = 0; k < 3; k++) borne[k] += ((other == root) - (one == root)) * f->force[k];
    }
    const double weight = mass * -m->gravity[2], left = hypot(hypot(borne[0], borne[1]), borne[2] - weight);
    const double stopped = left / mass * timestep;
    const char *name = or_else(m->body[m->link[root].body].name, "a body");
    char held[160] = "";
    for (int j = 0; j < m->njoint && !m->link[root].driven && !*held; j++)
      if (m->joint[j].link == root && m->joint[j].name && *m->joint[j].name)
        snprintf(held, sizeof held, " (<velocity joint=\"%.60s\" at=\"end\" weight=\"1000\" within=\"0.1\"/>)",
                 m->joint[j].name);
    if (borne[2] <= leaning * weight)
      fprintf(
          out,
          "  note: nothing holds '%.60s' at the end: it is at rest for a moment, as at the top of a hop, and falls. "
          "A posture held over the last tenth of the time (from=), or a smaller within of the final velocity%s, makes "
          "it stand\n",
          name, held);
    else if (stopped > braking)
      fprintf(out,
              "  note: '%.60s' moves at %.2g m/s until the last step, which stops it: that it stands is not seen. A "
              "posture "
              "held over the last tenth of the time (from=), or a smaller within of the final velocity, has it stand\n",
              name, stopped);
  }
}

/// What has to move and who has hands moves by something else, as a trolley by the belly; that a term brings there is meant.
static void tell_handless(FILE *out, const cav_problem *problem, const cav_forces *forces, double timestep) {
  const cav_model *m = problem->model;
  cav_state *state = cav_state_new(m);
  cav_thing thing = {.link = 0};
  cav_roles roles = {0};
  cav_status status = state ? cav_thing_find(problem, 1, state, &thing) : CAV_NO_MEMORY;
  if (!status) status = cav_roles_find(m, state, &roles);
  cav_state_free(state);
  const int right = roles.body[CAV_ROLE_RIGHT_HAND], left = roles.body[CAV_ROLE_LEFT_HAND];
  if (status || !thing.link || thing.met > 0 || right <= 0 || left <= 0) return;
  const cav_contact_force *most = NULL;
  int hands = 0, mover = 0;
  for (int i = 0; i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    const int swapped = m->geom[f->geom2].link == thing.link, other = swapped ? f->geom1 : f->geom2;
    if (!swapped && m->geom[f->geom1].link != thing.link) continue;
    const int body = m->geom[other].body, link = m->geom[other].link;
    if (link <= 0 || !m->link[link].driven || size_of(f) < touched) continue;
    hands |= body == right || body == left;
    if (!is_asked(problem, link) && (!most || size_of(f) > size_of(most))) most = f, mover = body;
  }
  if (hands || !most) return;
  const char *name = or_else(m->body[m->link[thing.link].body].name, "what has to move");
  fprintf(out,
          "  note: '%.60s' moves '%.60s', with up to %.3g N at %.3g s, and no hand touches it; a framepos of \"right "
          "hand\" and one "
          "of \"left hand\" in its frame (reftype, refname), over the time of the way, have hands move it\n",
          or_else(m->body[mover].name, "a body"), name, size_of(most), most->knot * timestep);
}

void cav_command_tell_leaning(FILE *out, const cav_problem *problem, const cav_trajectory *motion,
                              const cav_options *contact) {
  const cav_model *m = problem->model;
  cav_error ignored = {0};
  double weight = m->mass * sqrt(pow(m->gravity[0], 2) + pow(m->gravity[1], 2) + pow(m->gravity[2], 2));
  cav_forces *forces = cav_forces_new(m, motion, contact, problem->close_at_rest, &ignored);
  const cav_contact_force **most = calloc((size_t)m->ngeom + 1, sizeof *most); // of each solid
  int *with = calloc(2 * (size_t)m->ngeom + 1, sizeof *with), *ends = with ? with + m->ngeom : NULL;
  for (int i = 0; forces && most && with && i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    int part, solid = solid_of(m, f, &part);
    if (solid < 0) continue;
    ends[solid] |= f->knot == 0 || f->knot >= forces->nknot - 2;
    if (!most[solid] || size_of(f) > size_of(most[solid])) most[solid] = f, with[solid] = part;
  }
  int n = 0;
  for (int g = 0; most && with && g < m->ngeom; g++) {
    if (!most[g] || ends[g] || size_of(most[g]) < leaning * weight) continue;
    if (is_to_bear(problem, g) || is_to_bear(problem, with[g]) || n++ >= NAMED) continue;
    fprintf(out, "%s'%s' (%s, up to %.3g N at %.3g s)", n == 1 ? "  note: on its way it leans on " : ", ",
            name_of(m, g, "a solid of the world"), or_else(m->body[m->geom[with[g]].body].name, "a body"),
            size_of(most[g]), most[g]->knot * motion->timestep);
  }
  if (n > 0) fprintf(out, "; where it must not be touched: guide.md, Obstacles\n");
  if (forces) tell_ending(out, problem, forces, motion->timestep), tell_self(out, problem, forces, motion, weight);
  if (forces && problem->guess_height > 0 && !is_in_the_air(m, forces, weight))
    fprintf(
        out,
        "  note: the guess flies (apex), the motion does not: it touches the world at every knot; heights of feet at "
        "a time make it leave the ground\n");
  if (forces) tell_toes(out, problem, motion, forces, weight), tell_ground(out, problem, motion, forces, weight);
  if (forces) tell_hovering(out, problem, motion, forces, weight), tell_blows(out, problem, forces, motion->timestep);
  if (forces) tell_handless(out, problem, forces, motion->timestep);
  cav_forces_free(forces);
  free(most), free(with);
}
