/// Trees on one joint of the world that a window wants within a box of postures: whether its actuators bear the weight.
///
/// Momentum along the joint's axis changes by gravity and by what acts on that joint alone, whatever goes on inside of the
/// tree. Weighted over the window by a triangle phi of height 1, the mean of that force is the mean of gravity's but for
/// the momentum's part, -integral phi' L: phi' is constant but for three jumps that sum to 8/T, so of a momentum
/// d/dt(m x) with |x - x_0| <= w at most 16 m w/T² is left of the mean. A hinge's L = sum m a.(r x r') + a.I omega has more
/// to it: with r = r_0 + rho it is d/dt of r_0 x rho, and rho_t x rho_{t+1}/h besides, at most twice the product of its
/// two widths. So the postures need not be at rest, only within their tolerances.
///
/// Nothing is said where the tree could touch something else, its joint is near an end of its range, or something bears
/// that is not counted (equality constraints, tendons, media).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "algebra.h"
#include "cavort/solve.h"
#include "feasibility.h"
#include "math3.h"
#include "quantity.h"

static const double near_contact = 0.02, near_limit = 0.05; // m, and m or rad: what may bear
static const double spare = 1.02;                           // of what bears

/// A tree within a box of postures.
typedef struct held {
  int root, joint, dof; ///< its first link, and the one joint of it
  int first, last;      ///< knots
  double *q, *width;    ///< [nq] middle, [nv] half widths and room for as many
  double time, step;    ///< shortest that the window and a step can be, s
} held;

/// Change of a link's centre by dof d, at the middle of the box.
static void change_of(const cav_state *state, int link, int d, double out[3]) {
  double arm[3];
  sub3(arm, state->com + 3 * (size_t)link, state->reference + 3 * (size_t)link);
  cross3(out, state->axis + 6 * (size_t)d, arm);
  add3(out, out, state->axis + 6 * (size_t)d + 3);
}

/// Second order of a centre's way within the box.
static double curvature_of(const cav_model *m, const held *h, int link) {
  double sum = 0, anchor[6];
  for (int a = link; a > 0; a = m->link[a].parent) {
    for (int i = m->link[a].dof; i < m->link[a].dof + m->link[a].ndof; i++) {
      const cav_joint *joint = &m->joint[m->dof[i].joint];
      cav_distance_range lever = {0, 1};
      if (joint->type == CAV_JOINT_HINGE)
        cav_distance_between(m, link, m->link[link].com, a, joint->pos, anchor, &lever);
      if (a == link && joint->type == CAV_JOINT_HINGE) {
        double arm[3];
        sub3(arm, m->link[link].com, joint->pos);
        lever.largest = norm3(arm);
      }
      // with itself, and with all above it twice
      for (int b = a; b > 0; b = m->link[b].parent)
        for (int k = m->link[b].dof; k < m->link[b].dof + m->link[b].ndof; k++)
          if (k <= i) sum += (k == i ? 0.5 : 1) * lever.largest * h->width[i] * h->width[k];
    }
  }
  return sum;
}

/// Rotational part of a hinge's momentum: a.I omega, of a link that only turns about the axis constant but for its rate.
static double turning(const cav_model *m, const cav_state *state, const held *h, int link, const double axis[3]) {
  double jumps = 8 / h->time, moment[3], quat[4], a[3], Ia[3], sum = 0, turned = 0, rates = 0;
  cav_principal_axes(m->link[link].inertia, quat, moment);
  const double *R = state->link[link].rotation;
  rotate_back(a, R, axis);
  symmetric_mul(Ia, m->link[link].inertia, a);
  rotate(Ia, R, Ia);
  for (int l = link; l > 0; l = m->link[l].parent) {
    for (int d = m->link[l].dof; d < m->link[l].dof + m->link[l].ndof; d++) {
      const double *w = state->axis + 6 * (size_t)d;
      if (norm3(w) == 0) continue;
      double off[3];
      cross3(off, w, axis);
      if (norm3(off) > 1e-9) turned = INFINITY;
      sum += jumps * fabs(dot3(Ia, w)) * h->width[d];
      rates += 2 * h->width[d] / h->step;
    }
  }
  // axes of another direction: its inertia about the axis is what it may be
  if (turned > 0) sum = 2 * fmax(fmax(moment[0], moment[1]), moment[2]) * rates;
  return sum;
}

/// Widths of a link's centre: along [3] and, at right angles to it and to the axis, across; *total: of all directions,
/// without the second order.
static void widths_of(const cav_model *m, const cav_state *state, const held *h, int link, const double axis[3],
                      double along[3], double width[2], double *total) {
  double best = 0, v[3], side[3];
  zero3(along);
  width[0] = width[1] = *total = 0;
  for (int pass = 0; pass < 2; pass++) {
    cross3(side, axis, along);
    for (int k = link; k > 0; k = m->link[k].parent) {
      for (int d = m->link[k].dof; d < m->link[k].dof + m->link[k].ndof; d++) {
        double w = h->width[d];
        change_of(state, link, d, v);
        if (pass == 0) *total += norm3(v) * w;
        axpy3(v, v, -dot3(v, axis), axis);
        if (pass == 0 && norm3(v) * w > best) best = norm3(v) * w, scale3(along, 1 / norm3(v), v);
        if (pass) width[0] += fabs(dot3(v, along)) * w, width[1] += fabs(dot3(v, side)) * w;
      }
    }
  }
}

/// What a link's momentum can leave, times half the window: about a hinge's axis through a pivot, or along a slide's.
static double left_by(const cav_model *m, const cav_state *state, const held *h, int link, const double pivot[3],
                      double wide) {
  const double *spin = state->axis + 6 * (size_t)h->dof, *line = spin + 3;
  double r[3], along[3], side[3], width[2], total, jumps = 8 / h->time, mass = m->link[link].mass, sum = 0;
  if (m->joint[h->joint].type == CAV_JOINT_SLIDE) {
    for (int k = link; k > 0; k = m->link[k].parent) {
      for (int d = m->link[k].dof; d < m->link[k].dof + m->link[k].ndof; d++) {
        change_of(state, link, d, r);
        sum += fabs(dot3(r, line)) * h->width[d];
      }
    }
    return mass * jumps * (sum + wide);
  }
  widths_of(m, state, h, link, spin, along, width, &total);
  sub3(r, state->com + 3 * (size_t)link, pivot);
  cross3(side, spin, along);
  // a.(r_0 x rho) = rho.(a x r_0), its two components apart
  double one = width[0] + wide, other = width[1] + wide;
  sum = jumps * (fabs(dot3(r, side)) * one + fabs(dot3(r, along)) * other) + 4 * one * other / h->step;
  return mass * sum + turning(m, state, h, link, spin);
}

/// The least mean force, that way, that has to bear the tree over the window.
static double least_need(const cav_model *m, const cav_state *state, const held *h, double sign, double *change) {
  const double *spin = state->axis + 6 * (size_t)h->dof, *line = spin + 3;
  int hinge = m->joint[h->joint].type == CAV_JOINT_HINGE;
  // what turns with the joint's motor has momentum, too
  double pivot[3], pull[3], r[3], need = 0, bend = 0, inner = 8 / h->time * m->dof[h->dof].armature * h->width[h->dof];
  transform(pivot, state->link[h->root].pos, state->link[h->root].rotation, m->joint[h->joint].pos);
  // the moment of gravity is m r.(g x a), its force m g.a
  cross3(pull, m->gravity, spin);
  for (int d = 0; d < m->nv; d++) change[d] = 0;
  for (int l = h->root; l < m->nlink; l++) {
    if (m->link[l].root != h->root) continue;
    double mass = m->link[l].mass, wide = curvature_of(m, h, l);
    sub3(r, state->com + 3 * (size_t)l, pivot);
    need -= sign * mass * (hinge ? dot3(r, pull) : dot3(m->gravity, line));
    bend += hinge ? mass * wide * norm3(m->gravity) : 0;
    inner += left_by(m, state, h, l, pivot, wide);
    for (int k = l; k > 0 && hinge; k = m->link[k].parent) {
      for (int d = m->link[k].dof; d < m->link[k].dof + m->link[k].ndof; d++) {
        change_of(state, l, d, r);
        change[d] += mass * dot3(r, pull);
      }
    }
  }
  for (int d = 0; d < m->nv; d++) need -= fabs(change[d]) * h->width[d];
  return need - bend - 2 * inner / h->time;
}

/// The largest force of actuators, springs, losses and damping on the joint that way, as a mean.
static double most_borne(cav_examination *e, const held *h, double sign) {
  const cav_model *m = e->model;
  const cav_joint *joint = &m->joint[h->joint];
  double sum = m->dof[h->dof].frictionloss, q = h->q[joint->q], w = h->width[h->dof];
  double *moment = e->start->u; // free between evaluations
  for (int i = 0; i < m->nu; i++) {
    double range[2];
    cav_actuator_effort_range(m, i, range);
    if (!m->actuator[i].constant) return INFINITY;
    cav_actuator_length(m, e->start, i, moment);
    double a = cav_effort_part(e) * moment[h->dof] * m->actuator[i].unit * sign;
    if (a != 0) sum += fmax(a * range[0], a * range[1]);
  }
  sum += joint->stiffness * (sign * (joint->springref - q) + w);
  return sum + m->dof[h->dof].damping * w * 4 / h->time;
}

/// Whether the tree can touch something outside of it from anywhere in the box, or its joint a limit.
static cav_status is_touching(cav_examination *e, const held *h, int *touching) {
  const cav_model *m = e->model;
  const cav_joint *joint = &m->joint[h->joint];
  double near = near_limit + joint->margin + h->width[h->dof], q = h->q[joint->q], wide = 0;
  *touching = joint->limited && (q - near < joint->range[0] || q + near > joint->range[1]);
  // a box's farthest corner moves more than its centre: twice the widths of all joints times the largest distance
  for (int p = 0; p < m->npair; p++)
    for (int k = 0; k < 2; k++) {
      const cav_geom *g = &m->geom[k ? m->pair[p].geom2 : m->pair[p].geom1];
      if (m->link[g->link].root != h->root || g->link == 0) continue;
      double sum = 0, anchor[6];
      for (int l = g->link; l > 0; l = m->link[l].parent)
        for (int j = m->link[l].joint; j < m->link[l].joint + m->link[l].njoint; j++) {
          cav_distance_range far = {0, norm3(g->pos) + norm3(m->joint[j].pos)};
          int slide = m->joint[j].type == CAV_JOINT_SLIDE;
          if (l != g->link) cav_distance_between(m, g->link, g->pos, l, m->joint[j].pos, anchor, &far);
          sum += h->width[m->joint[j].dof] * (slide ? 1 : far.largest + g->bound);
        }
      wide = fmax(wide, sum);
    }
  if (*touching || !(wide < 1)) {
    *touching = 1;
    return CAV_OK;
  }
  e->scratch->options.constraint = e->scratch->options.contact = 1;
  e->scratch->options.smoothing = near_contact + wide;
  cav_status status = cav_position(m, e->scratch, h->q);
  for (int i = 0; i < e->scratch->ncontact && !status; i++) {
    const cav_contact *c = &e->scratch->contact[i];
    int a = m->link[c->link1].root, b = m->link[c->link2].root;
    *touching |= a != b && (a == h->root || b == h->root) && c->dist < near_contact + wide;
  }
  e->scratch->options.smoothing = 0;
  return status;
}

static void tell(cav_examination *e, const held *h, int term, double need, double most) {
  const cav_model *m = e->model;
  const cav_term *held_by = &e->problem->term[term];
  const cav_joint *joint = &m->joint[h->joint];
  const cav_requirement at = {.term = term, .knot = h->first};
  char name[48], part[60] = "";
  double step = e->problem->timestep;
  const char *unit = joint->type == CAV_JOINT_HINGE ? "N m" : "N";
  if (cav_effort_part(e) < 1) snprintf(part, sizeof part, " at %.3g of their limits", e->problem->effort_limit);
  cav_impossible(e, CAV_CONDITION_STRENGTH, &at,
                 "A stronger actuator, more <limits effort>, a lighter load, or a posture that needs less.",
                 "%s'%.48s' cannot be held from %.4g to %.4g s: joint '%.48s' needs at least %.4g %s against gravity, "
                 "actuators%s give it %.4g",
                 held_by->quantity == CAV_QUANTITY_CONFIGURATION ? "posture " : "", held_by->name, h->first * step,
                 h->last * step, cav_name_or(joint->name, "joint", h->joint, name), need, unit, part, most);
}

/// The box of a tree over a window, from what is required at all its knots; 0: a joint is not bounded at one.
static int read_box(const cav_examination *e, held *h) {
  const cav_model *m = e->model;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (m->link[joint->link].root != h->root) continue;
    if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) return 0;
    double low = INFINITY, high = -INFINITY;
    int known = h->first - 1;
    for (int i = 0; i < e->n; i++) {
      const cav_requirement *r = &e->requirement[i];
      if (r->kind != CAV_REQUIRE_COORDINATE || r->object != j || r->knot < h->first || r->knot > h->last) continue;
      if (r->knot > known + 1) break;
      known = r->knot;
      low = fmin(low, r->low[0]), high = fmax(high, r->high[0]);
    }
    if (known < h->last) {
      const double stop = cav_joint_stop(joint);
      low = joint->limited ? joint->range[0] - stop : -INFINITY;
      high = joint->limited ? joint->range[1] + stop : INFINITY;
    }
    if (!isfinite(low) || !isfinite(high)) return 0;
    h->q[joint->q] = (low + high) / 2;
    h->width[joint->dof] = (high - low) / 2 + CAV_TOLERANCE_LIMIT;
  }
  return 1;
}

static cav_status examine_window(cav_examination *e, held *h, int term) {
  const cav_model *m = e->model;
  const cav_link *link = &m->link[h->root];
  int touching = 0;
  if (link->parent != 0 || link->njoint != 1 || link->ndof != 1) return CAV_OK;
  h->joint = link->joint, h->dof = link->dof;
  if (!read_box(e, h)) return CAV_OK;
  cav_status status = is_touching(e, h, &touching);
  for (int way = -1; way <= 1 && !status && !touching; way += 2) {
    double need = least_need(m, e->scratch, h, way, h->width + m->nv), most = spare * most_borne(e, h, way);
    if (!(need > most)) continue;
    tell(e, h, term, need, most / spare);
    break;
  }
  return status;
}

static int is_covered(const cav_model *m) {
  if (m->density > 0 || m->viscosity > 0 || m->nequality > 0) return 0;
  for (int i = 0; i < m->nbody; i++)
    if (m->body[i].buoyancy != 0) return 0;
  for (int i = 0; i < m->ntendon; i++)
    if (m->tendon[i].stiffness != 0 || m->tendon[i].limited || m->tendon[i].frictionloss > 0) return 0;
  return 1;
}

cav_status cav_examine_holds(cav_examination *e) {
  const cav_model *m = e->model;
  const cav_problem *p = e->problem;
  int before = e->nfound;
  if (!cav_start_is_given(p) || !is_covered(m)) return CAV_OK;
  double *q = malloc(sizeof(double) * (size_t)(m->nq + 2 * m->nv)),
         least = p->duration_most > 0 ? p->duration_least : 0;
  cav_status status = q ? CAV_OK : CAV_NO_MEMORY;
  for (int i = 0; i < p->nterm && !status; i++) {
    held h = {.q = q, .width = q + m->nq, .step = p->timestep * (least > 0 ? fmin(least / p->duration, 1) : 1)};
    const cav_term *term = &p->term[i];
    cav_requirement_window(e, term, &h.first, &h.last);
    h.time = (h.last - h.first) * h.step;
    if (h.last < h.first + 4 || isinf(cav_term_tolerance(e->problem, term, 1))) continue;
    for (h.root = 1; h.root < m->nlink && !status && e->nfound == before; h.root++) {
      if (m->link[h.root].root != h.root) continue;
      for (int k = 0; k < m->nq; k++) q[k] = p->q_start[k];
      for (int d = 0; d < m->nv; d++) h.width[d] = 0;
      status = examine_window(e, &h, i);
    }
  }
  free(q);
  return status;
}
