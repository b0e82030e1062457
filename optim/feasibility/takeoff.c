/// How high a jump can be: energy of a flight against what one push-off gives.
///
/// A tree that nothing but level planes can hold up is at least H above any support at a knot. It left the ground u
/// before with a vertical speed of at least H/u + g u/2 (u no longer than its flight up), and the lowest point of its
/// centre of mass before that had none. From there up it has what joints do over their ranges, each once, at the
/// largest effort: sum tau_i (range of i), what springs hold, the kinetic energy of the start, and that of a run-up:
/// friction mu gives a horizontal speed of mu (g t + fall) at most, and as much again may be in a roll.
///
/// This is a bound of a push-off, and takes it that what a joint gives beyond one range on the way, to and fro within
/// one push, does not come to bear: a quarter more of the work is left for that. Of trees all of whose joints are
/// driven and have a range, without springs between bodies, media and equality constraints.
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "feasibility.h"
#include "math3.h"

static const double more = 1.25; // of the work
enum { FLIGHTS = 400 };

/// What is known of a tree that can jump.
typedef struct jumper {
  int root;           ///< link
  double mass, work;  ///< kg; J, of one push-off
  double kinetic;     ///< of the start, J
  double friction;    ///< largest of its contacts
  double speed, fall; ///< of its centre of mass at the start, horizontal and downwards, m/s
  double support;     ///< highest that its centre of mass can be at a take-off, m
} jumper;

static int is_driven(const cav_model *m, int j, const double *force) {
  const cav_joint *joint = &m->joint[j];
  return (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE) && joint->limited && force[joint->dof] > 0;
}

/// A root that floats: no actuator acts on its joints, and one of them is free or slides upwards without end.
static int is_floating(const cav_examination *e, int root, const double *force) {
  const cav_model *m = e->model;
  const cav_link *link = &m->link[root];
  int up = 0, turned = 0;
  for (int j = link->joint; j < link->joint + link->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (joint->type == CAV_JOINT_BALL || joint->limited || joint->stiffness != 0 || force[joint->dof] > 0) return 0;
    int vertical = joint->type == CAV_JOINT_SLIDE && fabs(e->start->axis[6 * (size_t)joint->dof + 5]) > 1 - 1e-9;
    up |= (vertical && !turned) || joint->type == CAV_JOINT_FREE;
    turned |= joint->type == CAV_JOINT_HINGE;
  }
  return up && link->parent == 0;
}

/// Work of all driven joints over their ranges, and energy that springs in them can hold; -1: a joint is not driven.
static double push_off(const cav_model *m, int root, const double *force) {
  double work = 0, springs = 0;
  for (int i = root + 1; i < m->nlink; i++) {
    if (m->link[i].root != root) continue;
    for (int j = m->link[i].joint; j < m->link[i].joint + m->link[i].njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      if (!is_driven(m, j, force)) return -1;
      double far = fmax(fabs(joint->range[0] - joint->springref), fabs(joint->range[1] - joint->springref));
      work += force[joint->dof] * (joint->range[1] - joint->range[0]);
      springs += fmax(joint->stiffness, 0) * far * far / 2;
    }
  }
  return more * work + springs;
}

/// Whether a tree can come forward: of one that only rises, friction gives nothing.
static int can_run(const cav_examination *e, int root) {
  const cav_link *link = &e->model->link[root];
  for (int j = link->joint; j < link->joint + link->njoint; j++) {
    const double *axis = e->start->axis + 6 * (size_t)e->model->joint[j].dof + 3;
    if (e->model->joint[j].type == CAV_JOINT_FREE || hypot(axis[0], axis[1]) > 1e-9) return 1;
  }
  return 0;
}

int cav_ground_survey(const cav_examination *e, int root, double *support, double *friction) {
  const cav_model *m = e->model;
  double slides = 0, highest = -INFINITY;
  for (int p = 0; p < m->npair; p++) {
    int floor = m->pair[p].geom1, other = m->pair[p].geom2;
    int ra = m->link[m->geom[floor].link].root, rb = m->link[m->geom[other].link].root;
    if (ra == rb || (ra != root && rb != root)) continue;
    cav_pose pose;
    if (m->geom[floor].type != CAV_GEOM_PLANE || m->geom[floor].link != 0) return 0;
    cav_object_pose(m, e->start, CAV_OBJECT_GEOM, floor, &pose);
    if (pose.rotation[8] < 1 - 1e-9) return 0;
    const cav_geom *g = &m->geom[other];
    double reach = g->bound + m->pair[p].margin + cav_distance_to_centre(m, 0, g->link, g->pos);
    highest = fmax(highest, pose.pos[2] + reach);
    if (m->pair[p].dim >= 3 && can_run(e, root))
      slides = fmax(slides, fmax(m->pair[p].friction[0], m->pair[p].friction[1]));
  }
  *support = highest;
  if (friction) *friction = slides;
  return highest < INFINITY;
}

int cav_weight_is_all(const cav_model *m) {
  if (m->gravity[0] != 0 || m->gravity[1] != 0 || !(m->gravity[2] < 0)) return 0;
  if (m->density > 0 || m->viscosity > 0 || m->nequality > 0) return 0;
  for (int i = 0; i < m->nbody; i++)
    if (m->body[i].buoyancy != 0) return 0;
  for (int i = 0; i < m->ntendon; i++)
    if (m->tendon[i].stiffness != 0) return 0;
  return 1;
}

/// Most energy of a flight that ends at a time and lasts u, J.
static double most_energy(const cav_model *m, const jumper *s, double time, double u) {
  double ran = s->speed + s->friction * (-m->gravity[2] * (time - u) + s->fall);
  return s->work + s->kinetic + s->mass * ran * ran;
}

/// Whether a height above the support can be had at a time; needs and has: of the flight that comes nearest.
static int is_in_reach(const cav_model *m, const jumper *s, double height, double time, double *needs, double *has) {
  double g = -m->gravity[2], short_by = INFINITY;
  for (int i = 1; i <= FLIGHTS; i++) {
    // what a flight between two of these needs is no less than at its end
    double u = time * i / FLIGHTS, before = time * (i - 1) / FLIGHTS, best = fmin(u, sqrt(2 * height / g));
    double v = height / best + g * best / 2, most = most_energy(m, s, time, before), least = s->mass * v * v / 2;
    if (least <= most) return 1;
    if (least - most < short_by) short_by = least - most, *needs = least, *has = most;
  }
  return 0;
}

static cav_status survey(cav_examination *e, const double *force, jumper *s) {
  const cav_model *m = e->model;
  double centre[3], velocity[3], *M = malloc((size_t)m->nv * (size_t)m->nv * sizeof *M);
  const double *v = e->problem->v_start;
  cav_status status = M ? cav_inertia(m, e->scratch, e->problem->q_start, M) : CAV_NO_MEMORY;
  s->kinetic = s->mass = 0;
  s->work = push_off(m, s->root, force);
  for (int i = 0; i < m->nlink; i++) s->mass += m->link[i].root == s->root && i ? m->link[i].mass : 0;
  for (int i = 0; i < m->nv && !status; i++)
    for (int j = 0; j < m->nv; j++)
      s->kinetic += m->link[m->dof[i].link].root == s->root ? 0.5 * v[i] * M[i * m->nv + j] * v[j] : 0;
  free(M);
  if (!status) status = cav_centre_of_tree(e, s->root, centre, velocity);
  s->speed = hypot(velocity[0], velocity[1]);
  s->fall = fmax(-velocity[2], 0);
  s->support = fmax(s->support, centre[2]);
  return status;
}

/// Greatest height above the support that can be had at a time, from below one that cannot.
static double greatest(const cav_model *m, const jumper *s, double time, double beyond) {
  double low = 0, high = beyond, needs, has;
  while (high - low > 1e-3 * beyond) {
    double middle = (low + high) / 2;
    if (is_in_reach(m, s, middle, time, &needs, &has))
      low = middle;
    else
      high = middle;
  }
  return high;
}

static cav_status examine_one(cav_examination *e, const double *force, const cav_requirement *r) {
  const cav_model *m = e->model;
  int link = r->kind == CAV_REQUIRE_CENTRE ? m->body[r->object].link : r->object;
  jumper s = {.root = m->link[link].root};
  double below = 0, t = cav_requirement_time(e, r->knot) + e->problem->timestep * fmax(e->longest, 1);
  if (link == 0 || isinf(r->low[2]) || !is_floating(e, s.root, force) ||
      !cav_ground_survey(e, s.root, &s.support, &s.friction))
    return CAV_OK;
  // of a whole tree alone the centre is the one that flies
  if (r->kind == CAV_REQUIRE_CENTRE && m->link[s.root].body != r->object) return CAV_OK;
  if (r->kind == CAV_REQUIRE_POINT) below = cav_distance_to_centre(m, 0, r->object, r->point);
  cav_status status = survey(e, force, &s);
  double height = r->low[2] - below - s.support, needs = 0, has = 0;
  if (status || s.work < 0 || !(height > 1e-3) || is_in_reach(m, &s, height, t, &needs, &has)) return status;
  double high = greatest(m, &s, t, height);
  char what[160];
  cav_requirement_words(e, r, what, sizeof what);
  cav_impossible(e, CAV_CONDITION_ENERGY, r, "A lower target, stronger actuators, or something to climb on.",
                 "%s, too high to jump: it takes %.3g J from the ground, and one push-off of all joints at full effort "
                 "over their whole ranges gives at most %.3g J, for z %.3g",
                 what, needs, has, high + s.support + below);
  cav_impossible_fraction(e, high / height);
  return CAV_OK;
}

cav_status cav_examine_takeoff(cav_examination *e) {
  const cav_model *m = e->model;
  if (!cav_start_is_given(e->problem) || !cav_weight_is_all(m)) return CAV_OK;
  int bounded = 0, before = e->nfound;
  double *force = malloc((size_t)(m->nv + 1) * sizeof *force);
  cav_status status = force ? cav_effort_of_dofs(e, force, &bounded) : CAV_NO_MEMORY;
  for (int i = 0; i < e->n && !status && bounded && e->nfound == before; i++)
    if (e->requirement[i].kind != CAV_REQUIRE_COORDINATE) status = examine_one(e, force, &e->requirement[i]);
  free(force);
  return status;
}

cav_status cav_takeoff_heights(cav_examination *e, int root, int n, const double *time, double *highest) {
  const cav_model *m = e->model;
  int bounded = 0, known = cav_weight_is_all(m);
  jumper s = {.root = root};
  double *force = malloc((size_t)(m->nv + 1) * sizeof *force);
  cav_status status = force ? cav_effort_of_dofs(e, force, &bounded) : CAV_NO_MEMORY;
  known =
      known && bounded && !status && is_floating(e, root, force) && cav_ground_survey(e, root, &s.support, &s.friction);
  if (known) status = survey(e, force, &s);
  for (int i = 0; i < n; i++) {
    highest[i] = INFINITY;
    if (!known || status || s.work < 0) continue;
    double t = time[i] + e->problem->timestep * fmax(e->longest, 1);
    double beyond = most_energy(m, &s, t, 0) / (s.mass * -m->gravity[2]) + 1e-3;
    highest[i] = s.support + greatest(m, &s, t, beyond);
  }
  free(force);
  return status;
}
