/// A model of nothing but slides that do not weigh on each other: how far each comes in a time, at most.
///
/// Its inertia is constant and diagonal, so each slide is a mass under a constant force and one between limits. The farthest
/// place with at most a speed at the end is that of full force one way and then the other (bang-bang): of a mass m from rest to
/// rest F T²/4m, F T²/2m where it may still move. A step more than the time is counted, which is what implicit steps gain. A
/// point, or a centre of mass, comes as far along an axis of the world as all slides that move it take it together.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"
#include "problem_file.h"

static const double slack = 1e-5; // of ways and speeds, relative and in their unit

/// Whether two things can touch: more than one link, the world with them, has geoms that collide.
static int can_touch(const cav_model *m) {
  int link = -1;
  for (int i = 0; i < m->ngeom; i++) {
    const cav_geom *geom = &m->geom[i];
    if (!geom->contype && !geom->conaffinity) continue;
    if (link >= 0 && geom->link != link) return 1;
    link = geom->link;
  }
  return m->npair > 0;
}

/// Whether slides, constant forces and actuators are all there is.
static int is_covered(const cav_model *m) {
  if (m->ntendon > 0 || m->nequality > 0 || m->density > 0 || m->viscosity > 0 || !m->options.passive) return 0;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (joint->type != CAV_JOINT_SLIDE || joint->limited || joint->stiffness != 0) return 0;
    if (m->dof[joint->dof].damping > 0 || m->dof[joint->dof].frictionloss > 0) return 0;
  }
  return m->njoint > 0 && !can_touch(m);
}

/// Masses and what holds them at rest, [2nv]; *known 0: they weigh on each other.
static cav_status find_masses(cav_examination *e, double *mass, int *known) {
  const cav_model *m = e->model;
  const size_t n = (size_t)m->nv;
  double *M = malloc(n * n * sizeof *M + 1), *zero = calloc(n + 1, sizeof *zero);
  cav_status status = M && zero ? cav_inverse(m, e->scratch, e->problem->q_start, zero, zero, mass + n) : CAV_NO_MEMORY;
  if (!status) status = cav_inertia(m, e->scratch, e->problem->q_start, M);
  *known = !status;
  for (size_t i = 0; i < n && !status; i++) {
    mass[i] = M[i * n + i];
    for (size_t k = 0; k < n; k++) *known &= k == i || fabs(M[i * n + k]) <= 1e-12 * mass[i];
  }
  free(M), free(zero);
  return status;
}

/// Farthest way in a time from a speed to at most another, accelerations from -brake to push; infinite where that speed is
/// not reached.
static double farthest(double push, double brake, double speed, double last, double time) {
  double turn = time;
  if (speed + push * time > last) turn = (last - speed + brake * time) / (push + brake);
  if (!(turn >= 0)) return INFINITY;
  double fast = speed + push * turn, rest = time - turn;
  return speed * turn + push * turn * turn / 2 + fast * rest - brake * rest * rest / 2;
}

/// Speeds at which a slide may be a step after a knot, to both sides: rest where the motion closes, rates that are required.
static void speeds_at(const cav_examination *e, int knot, int dof, double most[2]) {
  const cav_problem *p = e->problem;
  most[0] = most[1] = knot == e->nknot - 1 && p->close_at_rest ? 0 : INFINITY;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    int first, last;
    if (term->quantity != CAV_QUANTITY_VELOCITY || term->use != CAV_USE_EQUAL || term->nwaypoint) continue;
    cav_requirement_window(e, term, &first, &last);
    if (knot < first || knot > last || !cav_problem_selects(e->model, term, dof)) continue;
    const double rate = term->target ? term->target[dof] : 0;
    most[1] = fmin(most[1], rate + slack), most[0] = fmin(most[0], slack - rate);
  }
}

static void tell(cav_examination *e, const cav_requirement *r, double way, double can, double time) {
  char what[160];
  cav_requirement_words(e, r, what, sizeof what);
  cav_impossible(e, CAV_CONDITION_ENERGY, r, "More time, or a stronger actuator.",
                 "%s, %.3g m from the start, but at full effort it comes %.3g m far in %.3g s at most", what, way, can,
                 time);
  cav_impossible_fraction(e, can / way);
}

/// What is known of the model.
typedef struct slides {
  double *mass, *hold, *force; ///< [nv] kg; what holds them at rest, largest effort, N
  double *weight;              ///< [nv] of what is required, by each slide
} slides;

/// How far a slide comes from its start by a knot at most, to one side (way 1: along its axis).
static double can_come(const cav_examination *e, const slides *s, int knot, int d, int way) {
  const double h = e->problem->timestep * e->longest, time = cav_requirement_time(e, knot);
  const double speed = e->problem->v_start[d];
  // greatest accelerations to either side, and speeds
  const double gain[2] = {(s->force[d] + s->hold[d]) / s->mass[d], (s->force[d] - s->hold[d]) / s->mass[d]};
  double most[2];
  speeds_at(e, knot, d, most);
  // sums over steps are off an integral by a half of what speeds at its ends make of one
  const double ends = fabs(speed) + (isfinite(most[way]) ? fabs(most[way]) : 0);
  return farthest(gain[way], gain[!way], (way ? 1 : -1) * speed, most[way], time + h) + h * ends;
}

/// Adds by how much the slides above a link move it along a world axis.
static void add_slides(const cav_examination *e, int link, int axis, double part, double *weight) {
  const cav_model *m = e->model;
  for (; link > 0; link = m->link[link].parent)
    for (int j = m->link[link].joint; j < m->link[link].joint + m->link[link].njoint; j++)
      weight[m->joint[j].dof] += part * e->start->axis[6 * (size_t)m->joint[j].dof + 3 + (size_t)axis];
}

/// Where a coordinate of what is required is at the start, and by how much each slide moves it.
static double weigh_slides(const cav_examination *e, const cav_requirement *r, int axis, double *weight) {
  const cav_model *m = e->model;
  memset(weight, 0, (size_t)m->nv * sizeof *weight);
  if (r->kind == CAV_REQUIRE_COORDINATE) {
    weight[m->joint[r->object].dof] = 1;
    return e->problem->q_start[m->joint[r->object].q];
  }
  if (r->kind == CAV_REQUIRE_POINT) {
    double at[3];
    transform(at, e->start->link[r->object].pos, e->start->link[r->object].rotation, r->point);
    add_slides(e, r->object, axis, 1, weight);
    return at[axis];
  }
  double sum = 0, mass = 0, centre[3], at[3];
  for (int i = r->object; i < m->nbody; i++) {
    const cav_body *b = &m->body[i];
    if (!(b->mass > 0) || !cav_body_within(m, i, r->object)) continue;
    cav_body_centre(b, centre);
    transform(at, e->start->link[b->link].pos, e->start->link[b->link].rotation, centre);
    add_slides(e, b->link, axis, b->mass, weight);
    sum += b->mass * at[axis], mass += b->mass;
  }
  for (int d = 0; d < m->nv && mass > 0; d++) weight[d] /= mass;
  return mass > 0 ? sum / mass : 0;
}

static void examine(cav_examination *e, const cav_requirement *r, const slides *s) {
  const double time = cav_requirement_time(e, r->knot);
  for (int axis = 0; axis < (r->kind == CAV_REQUIRE_COORDINATE ? 1 : 3); axis++) {
    const double start = weigh_slides(e, r, axis, s->weight);
    for (int way = 0; way < 2; way++) {
      const double wanted = way ? r->low[axis] - start : start - r->high[axis];
      double can = 0;
      if (!(wanted > 0)) continue;
      for (int d = 0; d < e->model->nv; d++)
        if (fabs(s->weight[d]) > 1e-12)
          can += fabs(s->weight[d]) * can_come(e, s, r->knot, d, s->weight[d] > 0 ? way : !way);
      // what no slide moves is told as such (direction.c)
      if (can == 0 || !(wanted > can + slack * (1 + fabs(can)))) continue;
      tell(e, r, wanted, can, time);
      return;
    }
  }
}

cav_status cav_examine_slides(cav_examination *e) {
  const cav_model *m = e->model;
  int known = 0, bounded = 0, before = e->nfound;
  if (!cav_start_is_given(e->problem) || e->n == 0 || !is_covered(m)) return CAV_OK;
  double *mass = malloc(4 * (size_t)m->nv * sizeof *mass);
  if (!mass) return CAV_NO_MEMORY;
  const slides s = {mass, mass + m->nv, mass + 2 * m->nv, mass + 3 * m->nv};
  cav_options options = e->scratch->options;
  cav_status status = find_masses(e, mass, &known);
  e->scratch->options = options;
  if (!status) status = cav_effort_of_dofs(e, s.force, &bounded);
  for (int i = 0; i < e->n && known && bounded && !status && e->nfound == before; i++) {
    const cav_requirement *r = &e->requirement[i];
    if (r->knot > 0 && (r->kind != CAV_REQUIRE_POINT || r->object > 0)) examine(e, r, &s);
  }
  free(mass);
  return status;
}
