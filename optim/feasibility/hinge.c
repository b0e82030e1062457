/// A model that is one hinge: the least time from one state to others, exact.
///
/// What can be reached in a time is a set of the plane (q, q') whose boundary consists of ends of extremals (Pontryagin):
/// the torque is at its largest or least by the sign of the second adjoint, p1' = p2 g'(q)/I, p2' = -p1 + d/I p2, g the
/// torque that holds the hinge. The adjoint has a direction at the start and no size, so extremals are a curve of states
/// that moves with time, and the time at which it first meets the states wanted is the least. A thousand extremals stand
/// for it, all moved at once by Runge and Kutta's method of order 4; between neighbours, and between two times, it is
/// straight. Pumping swing by swing is one of these motions where the torque is too weak to go there directly.
#include "hinge.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "feasibility.h"

enum { EXTREMALS = 1024, FEW = 128, ANGLES = 90, BISECTIONS = 12, LAST_BISECTIONS = 3 };
static const double step = 0.03;      // of the time in which full torque and gravity together turn it by half a radian
static const double free_gap = 0.005; // m: nearer than this something may touch
static const double most_efforts = 100;

/// Whether anything is within reach of a contact at some angle.
static cav_status find_contact(const cav_model *m, cav_state *scratch, int *touches) {
  *touches = 0;
  scratch->options = m->options;
  scratch->options.smoothing = scratch->options.smoothing_self = free_gap;
  cav_status status = CAV_OK;
  for (int i = 0; i < ANGLES && !status && !*touches; i++) {
    double q = 2 * M_PI * i / ANGLES;
    status = cav_position(m, scratch, &q);
    for (int k = 0; k < scratch->ncontact && !status; k++) *touches |= scratch->contact[k].dist < free_gap;
  }
  return status;
}

/// Whether what acts on the one dof is covered.
static int is_covered(const cav_model *m) {
  const cav_joint *joint = m->njoint == 1 ? &m->joint[0] : NULL;
  if (!joint || joint->type != CAV_JOINT_HINGE || joint->limited || joint->stiffness != 0) return 0;
  if (m->ntendon > 0 || m->nequality > 0 || m->nu == 0 || m->density > 0 || m->viscosity > 0) return 0;
  if (m->dof[joint->dof].frictionloss > 0 || !m->options.passive) return 0;
  for (int i = 0; i < m->nbody; i++)
    if (m->body[i].buoyancy != 0) return 0;
  for (int i = 0; i < m->nu; i++) {
    double effort[2];
    cav_actuator_effort_range(m, i, effort);
    if (!isfinite(effort[0]) || !isfinite(effort[1]) || !m->actuator[i].constant) return 0;
  }
  return 1;
}

cav_status cav_hinge_of(const cav_model *m, cav_state *scratch, cav_hinge *hinge, int *known) {
  int touches = 0;
  *known = 0;
  *hinge = (cav_hinge){0};
  if (!is_covered(m)) return CAV_OK;
  cav_status status = find_contact(m, scratch, &touches);
  if (status || touches) return status;
  scratch->options.constraint = scratch->options.contact = 0;
  double zero = 0, q = 0, moment, effort[2];
  for (int i = 0; i < 2 && !status; i++) {
    q = i * M_PI / 2;
    status = cav_inverse(m, scratch, &q, &zero, &zero, &hinge->gravity[i]);
  }
  if (!status) status = cav_inertia(m, scratch, &q, &hinge->inertia);
  if (status || !(hinge->inertia > 0)) return status;
  hinge->damping = m->dof[0].damping;
  for (int i = 0; i < m->nu; i++) {
    cav_actuator_length(m, scratch, i, &moment);
    cav_actuator_effort_range(m, i, effort);
    double a = effort[0] * moment * m->actuator[i].unit, b = effort[1] * moment * m->actuator[i].unit;
    hinge->torque[0] += fmin(a, b), hinge->torque[1] += fmax(a, b);
  }
  *known = 1;
  return CAV_OK;
}

double cav_hinge_margin(const cav_hinge *hinge, cav_order order, double timestep) {
  double rate = sqrt(hypot(hinge->gravity[0], hinge->gravity[1]) / hinge->inertia) * timestep;
  return 1 + (order == CAV_ORDER_EULER ? rate : rate * rate);
}

// ---------------------------------------------------------------- extremals

static void rate_of(const cav_hinge *hinge, double torque, const double x[4], double rate[4]) {
  double c = cos(x[0]), s = sin(x[0]);
  rate[0] = x[1];
  rate[1] = (torque - hinge->damping * x[1] - hinge->gravity[0] * c - hinge->gravity[1] * s) / hinge->inertia;
  rate[2] = x[3] * (hinge->gravity[1] * c - hinge->gravity[0] * s) / hinge->inertia;
  rate[3] = -x[2] + hinge->damping / hinge->inertia * x[3];
}

void cav_hinge_step(const cav_hinge *hinge, double efforts, double time, double x[4]) {
  double k[4][4], y[4], torque = efforts * hinge->torque[x[3] > 0];
  for (int i = 0; i < 4; i++) {
    double part = i == 0 ? 0 : i == 3 ? time : time / 2;
    for (int d = 0; d < 4; d++) y[d] = x[d] + (i > 0 ? part * k[i - 1][d] : 0);
    rate_of(hinge, torque, y, k[i]);
  }
  for (int d = 0; d < 4; d++) x[d] += time / 6 * (k[0][d] + 2 * k[1][d] + 2 * k[2][d] + k[3][d]);
  // no size
  double size = hypot(x[2], x[3]);
  x[2] /= size, x[3] /= size;
}

// ---------------------------------------------------------------- where the curve meets a box

typedef struct box {
  double low[2], high[2];
} box;

static int edge_meets(const box *b, const double from[2], const double to[2]) {
  double first = 0, last = 1;
  for (int d = 0; d < 2; d++) {
    double way = to[d] - from[d], a = b->low[d] - from[d], c = b->high[d] - from[d];
    if (way == 0) {
      if (a > 0 || c < 0) return 0;
      continue;
    }
    first = fmax(first, fmin(a / way, c / way));
    last = fmin(last, fmax(a / way, c / way));
  }
  return first <= last;
}

/// Whether the origin lies in a triangle.
static int holds_origin(const double a[2], const double b[2], const double c[2]) {
  double u = a[0] * b[1] - a[1] * b[0], v = b[0] * c[1] - b[1] * c[0], w = c[0] * a[1] - c[1] * a[0];
  return (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
}

/// Whether the cell that two neighbours pass over in a step meets the box: before [2], after [2] of each.
static int cell_meets(const box *b, const double *a0, const double *a1, const double *b0, const double *b1) {
  if (edge_meets(b, a0, a1) || edge_meets(b, a1, b1)) return 1;
  const double *corner[4] = {a0, a1, b1, b0};
  double off[4][2], middle[2];
  for (int d = 0; d < 2; d++)
    middle[d] = isfinite(b->low[d]) && isfinite(b->high[d]) ? (b->low[d] + b->high[d]) / 2 : 0;
  for (int i = 0; i < 4; i++)
    for (int d = 0; d < 2; d++) off[i][d] = corner[i][d] - middle[d];
  return holds_origin(off[0], off[1], off[2]) || holds_origin(off[0], off[2], off[3]);
}

/// Fastest that gravity and the actuators can turn it, rad/s².
static double acceleration(const cav_hinge *hinge) {
  double torque = fmax(fabs(hinge->torque[0]), fabs(hinge->torque[1]));
  return (torque + hypot(hinge->gravity[0], hinge->gravity[1])) / hinge->inertia;
}

/// By so many extremals.
static double least_time(const cav_hinge *hinge, double efforts, const double start[2], const double low[2],
                         const double high[2], double most, int extremals) {
  double part = step / sqrt(acceleration(hinge));
  double now[EXTREMALS][4], before[EXTREMALS][4];
  box b = {{low[0], low[1]}, {high[0], high[1]}};
  if (edge_meets(&b, start, start)) return 0;
  for (int i = 0; i < extremals; i++) {
    double angle = 2 * M_PI * i / extremals;
    now[i][0] = start[0], now[i][1] = start[1], now[i][2] = cos(angle), now[i][3] = sin(angle);
  }
  for (double time = 0; time <= most; time += part) {
    memcpy(before, now, (size_t)extremals * sizeof *now);
    for (int i = 0; i < extremals; i++) cav_hinge_step(hinge, efforts, part, now[i]);
    for (int i = 0; i < extremals; i++) {
      int next = (i + 1) % extremals;
      if (cell_meets(&b, before[i], now[i], before[next], now[next])) return time;
    }
  }
  return INFINITY;
}

double cav_hinge_time(const cav_hinge *hinge, double efforts, const double start[2], const double low[2],
                      const double high[2], double most) {
  return least_time(hinge, efforts, start, low, high, most, EXTREMALS);
}

/// Bisects what lies between efforts that do not suffice and those that do.
static void bisect(const cav_hinge *hinge, const double start[2], const double low[2], const double high[2],
                   double time, int extremals, int times, double *less, double *more) {
  for (int i = 0; i < times; i++) {
    double middle = (*less + *more) / 2;
    *(isinf(least_time(hinge, middle, start, low, high, time, extremals)) ? less : more) = middle;
  }
}

double cav_hinge_efforts(const cav_hinge *hinge, const double start[2], const double low[2], const double high[2],
                         double time) {
  double less = 1, more = 2;
  while (more < most_efforts && isinf(cav_hinge_time(hinge, more, start, low, high, time))) less = more, more *= 2;
  if (more >= most_efforts) return INFINITY;
  // a few extremals find the place, where all of them look whether it is right
  double a = less, b = more;
  bisect(hinge, start, low, high, time, FEW, BISECTIONS, &a, &b);
  double room = 4 * (b - a);
  a = fmax(a - room, less), b = fmin(b + room, more);
  int right = (a == less || isinf(cav_hinge_time(hinge, a, start, low, high, time))) &&
              (b == more || !isinf(cav_hinge_time(hinge, b, start, low, high, time)));
  if (right) less = a, more = b;
  bisect(hinge, start, low, high, time, EXTREMALS, right ? LAST_BISECTIONS : BISECTIONS, &less, &more);
  return more;
}

// ---------------------------------------------------------------- what is required of it

/// Speed up to which a motion can be at a knot: that which the step after the last one can take away.
static double speed_at(const cav_examination *e, const cav_hinge *hinge, int knot) {
  if (knot < e->nknot - 1 || !e->problem->close_at_rest) return INFINITY;
  return e->problem->timestep * e->longest * acceleration(hinge);
}

static void examine_time(cav_examination *e, const cav_hinge *hinge, const cav_requirement *r) {
  static const double longer = 8;
  double h = e->problem->timestep * e->longest, time = cav_requirement_time(e, r->knot) + h;
  double start[2] = {e->problem->q_start[0], e->problem->v_start[0]}, speed = speed_at(e, hinge, r->knot);
  double low[2] = {r->low[0], -speed}, high[2] = {r->high[0], speed};
  double margin = cav_hinge_margin(hinge, e->problem->order, h);
  if (!isinf(cav_hinge_time(hinge, margin, start, low, high, time))) return;
  char what[160], least[80], more[80] = "";
  double needs = cav_hinge_time(hinge, 1, start, low, high, longer * time);
  double efforts = cav_hinge_efforts(hinge, start, low, high, time);
  if (isfinite(needs))
    snprintf(least, sizeof least, "it takes at least %.3g s at full effort", needs);
  else
    snprintf(least, sizeof least, "%.3g s at full effort would not do either", longer * time);
  if (isfinite(efforts)) snprintf(more, sizeof more, ", or %.3g times the effort", efforts);
  cav_requirement_words(e, r, what, sizeof what);
  cav_impossible(e, CAV_CONDITION_ENERGY, r, "More time, or a stronger actuator.",
                 "%s, too much for the actuators in the time: %s%s (exact for one hinge)", what, least, more);
}

cav_status cav_examine_hinge(cav_examination *e) {
  cav_hinge hinge;
  int known = 0, last = -1, before = e->nfound;
  if (!cav_start_is_given(e->problem) || e->n == 0) return CAV_OK;
  cav_options options = e->scratch->options;
  cav_status status = cav_hinge_of(e->model, e->scratch, &hinge, &known);
  e->scratch->options = options;
  // of a window the first knot is the one that is hardest to come to in time
  for (int i = 0; i < e->n && known && !status && e->nfound == before; i++) {
    const cav_requirement *r = &e->requirement[i];
    int same = last >= 0 && e->requirement[last].term == r->term && r->knot < e->nknot - 1;
    if (r->kind != CAV_REQUIRE_COORDINATE || r->knot == 0 || same) continue;
    examine_time(e, &hinge, r);
    last = i;
  }
  return status;
}
