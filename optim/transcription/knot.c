/// Rows of one knot: costs and constraints, from readings, forces and velocities to residuals, gradient and
/// Gauss-Newton Hessian. Rows with few columns are added at once, dense ones gathered for one product
/// (transcription.c); forces along single dofs are gathered by dof, as they share the derivatives of u. A constraint
/// row enters by an augmented Lagrangian. Where the step is free, every row's derivative by its logarithm is the
/// difference of two passes that begin the same rows.
#include "knot.h"
#include "quantity.h"
#include "rotation.h"
#include "vectors.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- rows

/// What is done for each of many rows, and hardly longer than a call.
#define AT_ONCE static inline __attribute__((always_inline))

/// Row i where the step is free: its derivative by the step's logarithm is the difference of two passes that begin the same
/// rows; weights count with it, as integrals are sums over steps.
static void trace_row(cav_sum *a, int i, double weight, double r) {
  assert(i < a->s->trace_room);
  a->root = sqrt(weight);
  if (a->shifted) {
    a->s->trace[a->shifted - 1][i] = a->root * r;
    return;
  }
  a->derivative = weight > 0 ? (a->s->trace[1][i] - a->s->trace[0][i]) / (2 * CAV_STEP_FRACTION) : 0;
  a->knot->step_square += a->derivative * a->derivative;
  a->knot->step_derivative += a->derivative * a->root * r;
}

/// Starts a row of weight/2 r^2.
AT_ONCE void begin_row(cav_sum *a, double weight, double r) {
  const int i = a->row++;
  assert(!a->counted || i < a->knot->nrow);
  a->bend = 0;
  if (a->tr->free_step && (a->jacobian || a->shifted)) trace_row(a, i, weight, r);
}

/// Curvature of the present row's norm by its dual, where it has one; else that of the square that stands for it.
static double curvature_of(cav_sum *a, const cav_term *term, double x, double square) {
  if (a->knot->nabsolute == 0 || !a->jacobian || cav_knot_takes_contacts(term)) return square;
  assert(a->nabsolute < a->knot->nabsolute);
  cav_absolute *row = &a->knot->absolute[a->nabsolute++];
  row->x = x;
  return cav_absolute_curvature(row);
}

/// Turns an absolute norm into a square: with x = r/unit and y^2/2 the norm of x, the residual is y and its row dy/dx times that
/// of x, which goes into weight and residual. Returns what the norm bends by beyond that.
static double square_norm(cav_sum *a, const cav_term *term, double unit, double *weight, double *r) {
  double x = *r / unit, root = sqrt(1 + x * x);
  // y = x sqrt(2/(1 + root)), which is exact for small x; dy/dx = x/(root y)
  double part = sqrt(2 / (1 + root)), derivative = 1 / (root * part), square = derivative * derivative;
  double bend = *weight * (curvature_of(a, term, x, square) - square);
  *weight *= square;
  *r = unit * x * part / derivative;
  return bend;
}

/// Starts the row of a cost, by its norm.
AT_ONCE void begin_cost(cav_sum *a, const cav_term *term, double unit, double *weight, double *r) {
  const double bend = term->norm == CAV_NORM_ABSOLUTE ? square_norm(a, term, unit, weight, r) : 0;
  begin_row(a, *weight, *r);
  a->bend = bend;
}

/// Adds weight times the square of a row with n entries to the Hessian, of which the lower triangle is read.
static void add_square(cav_sum *a, double weight, int n, const int *column, const double *entry) {
  const size_t width = 3 * (size_t)a->tr->nv;
  double *H = a->knot->present;
  for (int i = 0; i < n; i++) {
    const int at = column[i];
    const double by = weight * entry[i];
    double *row = H + (size_t)at * width;
    for (int j = 0; j < n; j++)
      if (column[j] <= at) row[column[j]] += by * entry[j];
  }
}

/// The same of a full row.
static void add_full_square(cav_sum *a, double weight, const double *row) {
  const int width = 3 * a->tr->nv;
  double *to = a->knot->present;
  for (int i = 0; i < width; i++, to += width) {
    const double by = weight * row[i];
    for (int j = 0; j <= i; j++) to[j] += by * row[j];
  }
}

/// Derivatives of a row with n entries.
static void lay_sparse(cav_sum *a, double weight, double r, int n, const int *column, const double *entry) {
  for (int i = 0; i < n && a->tr->free_step; i++) a->knot->step_row[column[i]] += a->derivative * a->root * entry[i];
  for (int i = 0; i < n; i++) a->knot->gradient[column[i]] += weight * r * entry[i];
  add_square(a, weight + a->bend, n, column, entry);
}

/// Adds weight/2 (r + row dx)^2 for a row with n entries, begun.
AT_ONCE void add_sparse(cav_sum *a, double weight, double r, int n, const int *column, const double *entry) {
  a->knot->merit += 0.5 * weight * r * r;
  if (a->jacobian) lay_sparse(a, weight, r, n, column, entry);
}

/// Space for one more dense row [3nv] with its residual.
static double *new_dense(cav_sum *a, double rest) {
  cav_knot *knot = a->knot;
  assert(knot->ndense < knot->dense_most && knot->dense_most <= (a->passing ? a->s->dense_room : knot->dense_room));
  a->rest[knot->ndense] = rest;
  return a->dense + (size_t)knot->ndense++ * 3 * (size_t)a->tr->nv;
}

// out := a row
CAV_VECTOR_BODY void scale_row_body(int n, double a, const double *row, double *restrict out) {
  for (int k = 0; k < n; k++) out[k] = a * row[k];
}
CAV_BY_VECTORS(scale_row, (int n, double a, const double *row, double *out), (n, a, row, out))

/// Derivatives of a full row.
static void lay_dense(cav_sum *a, double weight, double r, const double *row) {
  int width = 3 * a->tr->nv;
  double root = sqrt(weight), *out = new_dense(a, root * r);
  scale_row(width, root, row, out);
  for (int k = 0; k < width && a->tr->free_step; k++) a->knot->step_row[k] += a->derivative * out[k];
  if (a->bend != 0) add_full_square(a, a->bend, row);
}

/// Adds weight/2 (r + row dx)^2 for a full row, begun.
AT_ONCE void add_dense(cav_sum *a, double weight, double r, const double *row) {
  a->knot->merit += 0.5 * weight * r * r;
  if (a->jacobian && weight != 0) lay_dense(a, weight, r, row);
}

/// Derivative over the knots of u and the readings after it, one of them, scaled.
AT_ONCE void chain_row(const cav_sum *a, int which, double scale, double *out) {
  const cav_scratch *s = a->s;
  const size_t at = (size_t)which * (size_t)a->tr->nv;
  cav_links_chain(a->tr, &a->links, 1, scale, s->dq + at, s->dv + at, s->dn + at, out);
}

/// Derivative over the knots of u and the readings after it, one of them, in this thread's room until the next one.
static const double *chained_row(const cav_sum *a, int which) {
  chain_row(a, which, 1, a->s->reading);
  return a->s->reading;
}

static const double *reading_row(const cav_sum *a, int reading) { return chained_row(a, a->tr->nv + reading); }

static const double *force_row(const cav_sum *a, int dof) {
  return a->passing ? chained_row(a, dof) : a->knot->du + (size_t)dof * 3 * (size_t)a->tr->nv;
}

/// Derivatives of the row of a reading, which is chained where it is to stand, unless it is read beside that.
static void lay_reading(cav_sum *a, double weight, double r, int reading) {
  if (a->bend != 0) {
    lay_dense(a, weight, r, reading_row(a, reading));
    return;
  }
  const int width = 3 * a->tr->nv;
  double root = sqrt(weight), *out = new_dense(a, root * r);
  chain_row(a, a->tr->nv + reading, root, out);
  for (int k = 0; k < width && a->tr->free_step; k++) a->knot->step_row[k] += a->derivative * out[k];
}

/// Adds weight/2 (r + row dx)^2 for the row of a reading, begun.
AT_ONCE void add_reading(cav_sum *a, double weight, double r, int reading) {
  a->knot->merit += 0.5 * weight * r * r;
  if (a->jacobian && weight != 0) lay_reading(a, weight, r, reading);
}

/// Adds a linear form of u to a row [3nv].
static void put_force(const cav_sum *a, const cav_force_row *form, double *row) {
  int width = 3 * a->tr->nv;
  for (int k = 0; k < form->n; k++) {
    const double *du = force_row(a, form->dof[k]);
    for (int c = 0; c < width; c++) row[c] += form->coef[k] * du[c];
  }
}

/// Adds weight/2 r^2 with r a linear form of u, begun: along one dof it joins that dof's row, otherwise it is a row of
/// its own.
static void add_force(cav_sum *a, double weight, double r, const cav_force_row *form) {
  const cav_transcription *tr = a->tr;
  if (!cav_knot_stands_alone(form)) {
    a->knot->merit += 0.5 * weight * r * r;
    a->s->force_weight[form->dof[0]] += (weight + a->bend) * form->coef[0] * form->coef[0];
    a->s->force_derivative[form->dof[0]] += weight * r * form->coef[0];
    if (a->jacobian && tr->free_step) a->s->force_step[form->dof[0]] += a->derivative * a->root * form->coef[0];
    return;
  }
  int width = 3 * tr->nv;
  memset(a->s->row, 0, (size_t)width * sizeof(double));
  if (a->jacobian) put_force(a, form, a->s->row);
  add_dense(a, weight, r, a->s->row);
}

/// Sets and begins a constraint row; the residual of its augmented Lagrangian, 0 with *active 0 where it does not push.
static double slot_residual(cav_sum *a, int i, double value, double lower, double upper, double rho, int *active) {
  cav_slot *slot = &a->knot->slot[i];
  assert(i < a->knot->layout.count);
  slot->value = value;
  slot->lower = lower;
  slot->upper = upper;
  const cav_slot_layout *at = &a->knot->layout;
  double shifted = value, slack = 0;
  if (a->tr->constraints_only) {
    if (i >= at->effort && i < at->joint) slack = a->tr->slack_effort;
    if (i >= at->joint && i < at->term) slack = a->tr->slack_range;
  } else if (rho > 0 && slot->multiplier != 0) {
    shifted += slot->multiplier / rho;
  }
  // written out, as calls take longer than what they do
  const double least = lower - slack, most = upper + slack, inside = shifted < least ? least : shifted;
  double e = shifted - (inside > most ? most : inside);
  *active = e != 0 || lower == upper;
  begin_row(a, *active ? rho : 0, e);
  assert(!a->tr->free_step || !a->counted || i < a->s->slot_room);
  if (a->shifted) a->s->slot[a->shifted - 1][i] = value;
  if (a->jacobian && a->tr->free_step)
    a->knot->slot_step[i] = (a->s->slot[1][i] - a->s->slot[0][i]) / (2 * CAV_STEP_FRACTION);
  return e;
}

/// Derivative of constraint row i, kept where the transcription is asked to (for solvers that want the rows
/// themselves).
static double *kept_row(cav_sum *a, int i) {
  if (!a->jacobian || !a->tr->keep_rows) return NULL;
  double *row = a->knot->slot_row + (size_t)i * 3 * a->tr->nv;
  memset(row, 0, 3 * (size_t)a->tr->nv * sizeof(double));
  return row;
}

static void keep_sparse(cav_sum *a, int i, int n, const int *column, const double *entry) {
  double *row = kept_row(a, i);
  for (int k = 0; row && k < n; k++) row[column[k]] += entry[k];
}

static double *keep_force(cav_sum *a, int i, const cav_force_row *form) {
  double *row = kept_row(a, i);
  if (row) put_force(a, form, row);
  return row;
}

static void keep_reading(cav_sum *a, int i, int reading) {
  double *row = kept_row(a, i);
  if (row) memcpy(row, reading_row(a, reading), 3 * (size_t)a->tr->nv * sizeof(double));
}

/// Entries of the derivative of v_t [dof d] over the columns; base is the column block of q_t, q_{t-1} stands before
/// it.
static int velocity_entries(const cav_transcription *tr, int step, int d, int base, int has_previous, double scale,
                            int *column, double *entry) {
  int n = 0, nv = tr->nv, k = tr->rotation_of[d];
  double s = scale / tr->options.timestep;
  if (k < 0) {
    column[n] = base + d, entry[n++] = s;
    if (has_previous) column[n] = base - nv + d, entry[n++] = -s;
    return n;
  }
  const double *J = tr->knot[step].rotation + CAV_ROTATION_SIZE * k;
  int first = tr->rotation_dof[k], row = d - first;
  for (int c = 0; c < 3; c++) {
    column[n] = base + first + c, entry[n++] = s * J[3 * row + c];
    if (has_previous) column[n] = base - nv + first + c, entry[n++] = -s * J[9 + 3 * row + c];
  }
  return n;
}

static void add_velocity(cav_sum *a, const cav_term *term, double weight, const double *v) {
  const cav_transcription *tr = a->tr;
  int column[6];
  double entry[6], *goal = a->s->tangent;
  if (!cav_knot_moves(tr, a->t)) return;
  cav_term_target(term, a->knot->time, tr->nv, goal);
  const char *selected = cav_term_dofs(tr, term);
  for (int d = 0; d < tr->nv; d++) {
    if (!selected[d]) continue;
    int n = 0;
    if (a->jacobian)
      n = velocity_entries(tr, a->t, d, tr->nv, cav_knot_moves(tr, a->t - 1), 1 / term->scale, column, entry);
    double r = (v[d] - goal[d]) / term->scale, w = weight;
    begin_cost(a, term, 1, &w, &r);
    add_sparse(a, w, r, n, column, entry);
  }
}

/// Entries of the derivative of scale times the acceleration of dof d at a knot that has one.
static int acceleration_entries(const cav_sum *a, int d, double scale, int *column, double *entry) {
  const cav_transcription *tr = a->tr;
  int n = 0, t = a->t, here = cav_knot_moves(tr, t);
  scale /= tr->options.timestep;
  if (here) n = velocity_entries(tr, t, d, tr->nv, cav_knot_moves(tr, t - 1), -scale, column, entry);
  if (t + 1 < tr->nknot) n += velocity_entries(tr, t + 1, d, 2 * tr->nv, here, scale, column + n, entry + n);
  return n;
}

static void add_acceleration(cav_sum *a, const cav_term *term, double weight, const double *v, const double *v_next) {
  const cav_transcription *tr = a->tr;
  int column[12];
  double entry[12], *goal = a->s->tangent;
  if (!a->knot->has_force) return;
  cav_term_target(term, a->knot->time, tr->nv, goal);
  const char *selected = cav_term_dofs(tr, term);
  for (int d = 0; d < tr->nv; d++) {
    if (!selected[d]) continue;
    int n = a->jacobian ? acceleration_entries(a, d, 1 / term->scale, column, entry) : 0;
    double r = ((v_next[d] - v[d]) / tr->options.timestep - goal[d]) / term->scale, w = weight;
    begin_cost(a, term, 1, &w, &r);
    add_sparse(a, w, r, n, column, entry);
  }
}

/// Tangent difference of q_t to a term's posture and, per dof, the entries of its derivative.
static void posture_difference(const cav_sum *a, const cav_term *term, const double *q, double *difference) {
  const cav_model *m = a->tr->model;
  const double *target = term->target ? term->target : a->tr->problem->q_goal;
  int n = term->target ? term->nwaypoint : 0, i = 0;
  if (n > 1) {
    // between waypoints along the geodesic
    while (i < n - 2 && a->knot->time > term->waypoint_time[i + 1]) i++;
    double span = term->waypoint_time[i + 1] - term->waypoint_time[i];
    double fraction = fmin(fmax((a->knot->time - term->waypoint_time[i]) / span, 0), 1);
    cav_difference(m, target + i * m->nq, target + (i + 1) * m->nq, 1, difference);
    cav_integrate(m, target + i * m->nq, difference, fraction, a->s->posture);
    target = a->s->posture;
  }
  cav_difference(m, target, q, 1, difference);
}

static int posture_entries(const cav_transcription *tr, const double *difference, int d, double scale, int *column,
                           double *entry) {
  int k = tr->rotation_of[d];
  if (k < 0) {
    column[0] = tr->nv + d, entry[0] = scale;
    return 1;
  }
  double J[9];
  cav_rotation_jacobian_inverse(difference + tr->rotation_dof[k], J);
  for (int c = 0; c < 3; c++) {
    column[c] = tr->nv + tr->rotation_dof[k] + c;
    entry[c] = scale * J[3 * (d - tr->rotation_dof[k]) + c];
  }
  return 3;
}

static void add_posture(cav_sum *a, const cav_term *term, double weight, const double *q) {
  const cav_transcription *tr = a->tr;
  int column[3];
  double entry[3];
  if (!cav_knot_moves(tr, a->t)) return;
  posture_difference(a, term, q, a->s->tangent);
  const char *selected = cav_term_dofs(tr, term);
  for (int d = 0; d < tr->nv; d++) {
    if (!selected[d]) continue;
    int n = a->jacobian ? posture_entries(tr, a->s->tangent, d, 1 / term->scale, column, entry) : 0;
    double r = a->s->tangent[d] / term->scale, w = weight;
    begin_cost(a, term, 1, &w, &r);
    add_sparse(a, w, r, n, column, entry);
  }
}

static void add_effort(cav_sum *a, const cav_term *term, double weight) {
  const cav_transcription *tr = a->tr;
  if (!a->knot->has_force) return;
  weight /= term->scale * term->scale;
  for (int k = 0; k < tr->model->nu; k++) {
    double r = cav_force_value(&tr->effort[k], a->knot->u), w = weight;
    begin_cost(a, term, term->scale, &w, &r);
    add_force(a, w, r, &tr->effort[k]);
  }
}

/// Entries of the derivative of scale times the mean velocity of dof d over a step that leaves a knot.
static int mean_velocity_entries(const cav_sum *a, int d, double scale, int *column, double *entry) {
  const cav_transcription *tr = a->tr;
  int n = 0, t = a->t, here = cav_knot_moves(tr, t);
  if (here) n = velocity_entries(tr, t, d, tr->nv, cav_knot_moves(tr, t - 1), 0.5 * scale, column, entry);
  if (t + 1 < tr->nknot) n += velocity_entries(tr, t + 1, d, 2 * tr->nv, here, 0.5 * scale, column + n, entry + n);
  return n;
}

/// Power of actuator k over the weight, its derivative into row [3nv]. With the mean velocity its sum over steps is the
/// work of the forces: that of u over (v + v_next)/2 is what kinetic energy gains in a step. Moments do not depend on
/// q.
static double power_row(cav_sum *a, int k, const double *v, const double *v_next, double *row) {
  const cav_transcription *tr = a->tr;
  double *moment = a->s->tangent, unit = tr->effort_unit[k] / tr->weight, velocity = 0, entry[12];
  double force = unit * cav_force_value(&tr->effort[k], a->knot->u);
  int column[12];
  cav_actuator_length(tr->model, a->s->state, k, moment);
  for (int d = 0; d < tr->nv; d++) velocity += moment[d] * 0.5 * (v[d] + v_next[d]);
  if (!a->jacobian) return force * velocity;
  memset(row, 0, 3 * (size_t)tr->nv * sizeof(double));
  put_force(a, &tr->effort[k], row);
  for (int c = 0; c < 3 * tr->nv; c++) row[c] *= unit * velocity;
  for (int d = 0; d < tr->nv; d++) {
    int n = moment[d] != 0 ? mean_velocity_entries(a, d, force * moment[d], column, entry) : 0;
    for (int i = 0; i < n; i++) row[column[i]] += entry[i];
  }
  return force * velocity;
}

static void add_power(cav_sum *a, const cav_term *term, double weight, const double *v, const double *v_next) {
  if (!a->knot->has_force) return;
  weight /= term->scale * term->scale;
  for (int k = 0; k < a->tr->model->nu; k++) {
    double r = power_row(a, k, v, v_next, a->s->row), w = weight;
    begin_cost(a, term, term->scale, &w, &r);
    add_dense(a, w, r, a->s->row);
  }
}

static void add_contact(cav_sum *a, const cav_term *term, double weight) {
  weight /= term->scale * term->scale;
  for (int k = 0; k < a->knot->ncontact; k++) {
    int first, n = cav_knot_contact(a->tr, a->s->key, term, a->t, k, &first);
    for (int i = first; i < first + n; i++) {
      int row = CAV_CONTACT_READINGS * k + i;
      double r = a->knot->y[row], w = weight;
      if (term->quantity == CAV_QUANTITY_GAP && r < 0) r = w = 0; // it is deep: add_depths
      begin_cost(a, term, term->scale, &w, &r);
      add_reading(a, w, r, row);
    }
  }
}

/// What depth in the world costs on the way.
static void add_depths(cav_sum *a) {
  double weight = a->tr->depth_weight * a->tr->options.timestep;
  for (int k = 0; k < a->knot->ncontact && weight > 0; k++) {
    int row = CAV_CONTACT_READINGS * k;
    if (a->knot->moving[k] & (CAV_WITHIN_TREE | CAV_IDLE)) continue;
    double r = fmin(a->knot->y[row], 0), w = r < 0 ? weight : 0;
    begin_row(a, w, r);
    add_reading(a, w, r, row);
  }
}

/// One cost, whose readings, if it has any, are the knot's from reading on.
static void add_cost(cav_sum *a, const cav_term *term, double weight, int reading, const double *q, const double *v,
                     const double *v_next) {
  switch (term->quantity) {
    case CAV_QUANTITY_SENSOR:
    case CAV_QUANTITY_TRACK:
    case CAV_QUANTITY_USER:
      for (int k = 0; k < cav_term_dim(term); k++) {
        double r = a->knot->y[reading + k], w = weight;
        begin_cost(a, term, 1, &w, &r);
        add_reading(a, w, r, reading + k);
      }
      break;
    case CAV_QUANTITY_CONFIGURATION:
      add_posture(a, term, weight, q);
      break;
    case CAV_QUANTITY_VELOCITY:
      add_velocity(a, term, weight, v);
      break;
    case CAV_QUANTITY_ACCELERATION:
      add_acceleration(a, term, weight, v, v_next);
      break;
    case CAV_QUANTITY_EFFORT:
      add_effort(a, term, weight);
      break;
    case CAV_QUANTITY_POWER:
      add_power(a, term, weight, v, v_next);
      break;
    case CAV_QUANTITY_GAP:
    case CAV_QUANTITY_SLIP:
    case CAV_QUANTITY_IMPACT:
    case CAV_QUANTITY_SELF_PENETRATION:
    case CAV_QUANTITY_FORCE:
    case CAV_QUANTITY_EDGE_FORCE:
    case CAV_QUANTITY_CLEARANCE:
    case CAV_QUANTITY_SELF_FORCE:
      add_contact(a, term, weight);
      break;
    case CAV_QUANTITY_TYPES:
      break;
  }
}

/// Cost terms. reading counts through the readings of sensors, which stand in the order of the terms.
static void add_costs(cav_sum *a, const double *q, const double *v, const double *v_next) {
  const cav_transcription *tr = a->tr;
  int reading = CAV_CONTACT_READINGS * a->knot->ncontact;
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    double weight = cav_term_weight(tr, term, a->t);
    if (weight == 0) continue;
    if (term->use == CAV_USE_COST) add_cost(a, term, weight * term->weight, reading, q, v, v_next);
    reading += cav_term_dim(term);
  }
  assert(reading == a->knot->nread);
  for (int k = 0; k < tr->npenalised && a->knot->has_force; k++) {
    double weight = tr->options.timestep, r = cav_force_value(&tr->penalised[k], a->knot->u);
    begin_row(a, weight, r);
    add_force(a, weight, r, &tr->penalised[k]);
  }
  add_depths(a);
  // the duration's own penalty
  if (!cav_knot_has_duration(tr, a->t)) return;
  double duration = (tr->nknot - 1) * tr->options.timestep;
  begin_row(a, tr->problem->duration_weight, duration);
  add_sparse(a, tr->problem->duration_weight, duration, 0, NULL, NULL);
}

/// Angle of a ball joint from its reference and, in axis, the gradient of it.
static double ball_angle(const cav_joint *joint, const double *q, double axis[3]) {
  const double *quat = q + joint->q;
  double identity[4] = {1, 0, 0, 0};
  cav_rotation_between(identity, quat, axis);
  double angle = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
  for (int k = 0; k < 3; k++) axis[k] = angle > 0 ? axis[k] / angle : 0;
  return angle;
}

static void add_ranges(cav_sum *a, const double *q, double rho) {
  const cav_transcription *tr = a->tr;
  const cav_model *m = tr->model;
  const double margin = tr->problem->limit_margin;
  int i = a->knot->layout.joint, active;
  if (a->t < tr->first) return;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (!joint->limited) continue;
    int ball = joint->type == CAV_JOINT_BALL, n = ball ? 3 : 1, column[3];
    const double keep = margin - cav_joint_stop(joint);
    double axis[3] = {1, 0, 0}, value = ball ? ball_angle(joint, q, axis) : q[joint->q];
    for (int k = 0; k < 3; k++) column[k] = tr->nv + joint->dof + k;
    keep_sparse(a, i, n, column, axis);
    double range[2] = {joint->range[0], joint->range[1]};
    if (tr->periodicity) cav_periodicity_range(tr->periodicity, j, range);
    double lower = ball ? -INFINITY : range[0] + keep;
    double e = slot_residual(a, i++, value, lower, range[1] - keep, rho, &active);
    if (active) add_sparse(a, rho, e, n, column, axis);
  }
  assert(i == a->knot->layout.tendon);
  for (int k = 0; k < m->ntendon; k++) {
    const cav_tendon *tendon = &m->tendon[k];
    if (!tendon->limited) continue;
    assert(tendon->ndof <= tr->nv);
    double value = a->s->state->tendon_length[k];
    for (int c = 0; c < tendon->ndof; c++) {
      a->s->column[c] = tr->nv + m->tendon_dof[tendon->dof + c];
      a->s->row[c] = a->s->state->tendon_arm[tendon->dof + c];
    }
    keep_sparse(a, i, tendon->ndof, a->s->column, a->s->row);
    double e = slot_residual(a, i++, value, tendon->range[0] + margin, tendon->range[1] - margin, rho, &active);
    if (active) add_sparse(a, rho, e, tendon->ndof, a->s->column, a->s->row);
  }
  assert(i == a->knot->layout.term);
}

/// Entries of a servo's own part of row i over q_t and v_t, into row [3nv].
static void put_servo(const cav_sum *a, const cav_servo *servo, double *row) {
  int column[6];
  double entry[6];
  for (int k = 0; cav_knot_moves(a->tr, a->t) && k < servo->n; k++) {
    int before = cav_knot_moves(a->tr, a->t - 1);
    int n = velocity_entries(a->tr, a->t, servo->dof[k], a->tr->nv, before, servo->of_v[k], column, entry);
    for (int c = 0; c < n; c++) row[column[c]] -= entry[c];
    row[a->tr->nv + servo->dof[k]] -= servo->of_q[k];
  }
}

/// Adds weight/2 r^2 for the row of a servo.
static void add_servo(cav_sum *a, double weight, double r, const cav_force_row *form, const cav_servo *servo) {
  memset(a->s->row, 0, 3 * (size_t)a->tr->nv * sizeof(double));
  if (a->jacobian) {
    put_force(a, form, a->s->row);
    put_servo(a, servo, a->s->row);
  }
  add_dense(a, weight, r, a->s->row);
}

static void add_force_slots(cav_sum *a, const double *q, const double *v) {
  const cav_transcription *tr = a->tr;
  int i = a->knot->layout.unactuated, active;
  if (!a->knot->has_force) return;
  double rho = tr->options.timestep * tr->penalty.unactuated;
  for (int k = 0; k < tr->nresidual; k++) {
    keep_force(a, i, &tr->unactuated[k]);
    double e = slot_residual(a, i++, cav_force_value(&tr->unactuated[k], a->knot->u), 0, 0, rho, &active);
    add_force(a, rho, e, &tr->unactuated[k]);
  }
  assert(i == a->knot->layout.effort);
  rho = tr->options.timestep * tr->penalty.effort;
  for (int k = 0; k < tr->nlimit; k++) {
    const double *range = tr->effort_range[k];
    const cav_servo *servo = &tr->servo[k];
    double value = cav_force_value(&tr->effort[k], a->knot->u);
    double *row = keep_force(a, i, &tr->effort[k]);
    if (servo->n > 0) value -= cav_servo_value(tr->model, servo, q, v);
    if (servo->n > 0 && row) put_servo(a, servo, row);
    double e = slot_residual(a, i++, value, range[0], range[1], rho, &active);
    if (active && servo->n > 0) add_servo(a, rho, e, &tr->effort[k], servo);
    if (active && servo->n == 0) add_force(a, rho, e, &tr->effort[k]);
  }
  assert(i == a->knot->layout.joint);
}

/// Rows of a hard term over postures, velocities or accelerations, one a selected dof; returns the next row.
static int add_hard_dofs(cav_sum *a, const cav_term *term, int i, double lower, double upper, const double *q,
                         const double *v, const double *v_next) {
  const cav_transcription *tr = a->tr;
  int posture = term->quantity == CAV_QUANTITY_CONFIGURATION, rate = term->quantity == CAV_QUANTITY_ACCELERATION;
  int here = cav_knot_moves(tr, a->t), before = cav_knot_moves(tr, a->t - 1), column[12], active;
  double rho = tr->penalty.term, entry[12];
  if (posture) {
    posture_difference(a, term, q, a->s->tangent);
  } else {
    cav_term_target(term, a->knot->time, tr->nv, a->s->tangent);
  }
  for (int d = 0; d < tr->nv; d++) {
    if (!cav_dof_selected(tr, term, d)) continue;
    int n = 0;
    double measured = rate ? (v_next[d] - v[d]) / tr->options.timestep : v[d];
    double value = (posture ? a->s->tangent[d] : measured - a->s->tangent[d]) / term->scale;
    if (here && posture) n = posture_entries(tr, a->s->tangent, d, 1 / term->scale, column, entry);
    if (rate) n = acceleration_entries(a, d, 1 / term->scale, column, entry);
    if (here && !posture && !rate) n = velocity_entries(tr, a->t, d, tr->nv, before, 1 / term->scale, column, entry);
    keep_sparse(a, i, n, column, entry);
    double e = slot_residual(a, i++, value, lower, upper, rho, &active);
    if (active) add_sparse(a, rho, e, n, column, entry);
  }
  return i;
}

static void add_hard_terms(cav_sum *a, const double *q, const double *v, const double *v_next) {
  const cav_transcription *tr = a->tr;
  double rho = tr->penalty.term;
  int i = a->knot->layout.term, reading = CAV_CONTACT_READINGS * a->knot->ncontact, active;
  for (int k = 0; k < tr->problem->nterm; k++) {
    const cav_term *term = &tr->problem->term[k];
    if (cav_term_weight(tr, term, a->t) == 0) continue;
    int dim = cav_term_dim(term), range = term->use == CAV_USE_RANGE;
    double lower = range ? term->lower / term->scale : 0, upper = range ? term->upper / term->scale : 0;
    if (term->use == CAV_USE_COST) {
      reading += dim;
      continue;
    }
    if (!cav_term_is_reading(term)) i = add_hard_dofs(a, term, i, lower, upper, q, v, v_next);
    for (int c = 0; c < dim; c++, reading++) {
      keep_reading(a, i, reading);
      double e = slot_residual(a, i++, a->knot->y[reading], lower, upper, rho, &active);
      if (active) add_reading(a, rho, e, reading);
    }
  }
  assert(i == a->knot->layout.count && reading == a->knot->nread);
}

/// Curvature of accelerations for steps, not for the merit: rows alone say nothing of knots that they do not reach, a knot more
/// with each step.
static void add_smoothness(cav_sum *a) {
  const cav_transcription *tr = a->tr;
  int column[12];
  double entry[12];
  if (!a->knot->has_force) return;
  for (int d = 0; d < tr->nv; d++) {
    int n = acceleration_entries(a, d, 1, column, entry);
    add_square(a, tr->options.timestep * tr->smoothness, n, column, entry);
  }
}

// gradient += sum of rest times rows, four rows at a time in their order
CAV_VECTOR_BODY void add_gradient_body(int width, int n, const double *rest, const double *row,
                                       double *restrict gradient) {
  int i = 0;
  for (; i + 4 <= n; i += 4, row += 4 * (size_t)width) {
    const double *b = row + width, *c = b + width, *d = c + width;
    for (int k = 0; k < width; k++)
      gradient[k] = gradient[k] + rest[i] * row[k] + rest[i + 1] * b[k] + rest[i + 2] * c[k] + rest[i + 3] * d[k];
  }
  for (; i < n; i++, row += width)
    for (int k = 0; k < width; k++) gradient[k] += rest[i] * row[k];
}
CAV_BY_VECTORS(add_gradient, (int width, int n, const double *rest, const double *row, double *gradient),
               (width, n, rest, row, gradient))

/// Lays the rows along single dofs beside the dense ones.
static void lay_force_rows(cav_sum *a) {
  const cav_transcription *tr = a->tr;
  int width = 3 * tr->nv;
  for (int d = 0; d < tr->nv; d++) {
    double weight = a->s->force_weight[d];
    if (weight == 0) continue;
    double root = sqrt(weight), *out = new_dense(a, a->s->force_derivative[d] / root);
    if (a->passing && !tr->free_step) {
      chain_row(a, d, root, out);
      continue;
    }
    const double *du = force_row(a, d);
    scale_row(width, root, du, out);
    for (int k = 0; k < width && tr->free_step; k++) a->knot->step_row[k] += a->s->force_step[d] * du[k];
  }
  add_gradient(width, a->knot->ndense, a->rest, a->dense, a->knot->gradient);
}

void cav_knot_sum(cav_sum *a, const double *q, const double *v, const double *v_next) {
  const cav_transcription *tr = a->tr;
  cav_knot *knot = a->knot;
  int nv = tr->nv;
  knot->merit = 0;
  knot->ndense = 0;
  a->row = a->nabsolute = 0;
  memset(a->s->force_weight, 0, (size_t)nv * sizeof(double));
  memset(a->s->force_derivative, 0, (size_t)nv * sizeof(double));
  memset(a->s->force_step, 0, (size_t)nv * sizeof(double));
  if (a->jacobian) {
    // its lower triangle alone is read
    for (size_t i = 0, width = 3 * (size_t)nv; i < width; i++)
      memset(knot->present + i * width, 0, (i + 1) * sizeof(double));
    memset(knot->gradient, 0, 3 * (size_t)nv * sizeof(double));
    memset(knot->step_row, 0, 3 * (size_t)nv * sizeof(double));
    knot->step_square = knot->step_derivative = 0;
  }
  if (!tr->constraints_only) add_costs(a, q, v, v_next);
  knot->cost = knot->merit;
  add_force_slots(a, q, v);
  add_ranges(a, q, tr->options.timestep * tr->penalty.range);
  add_hard_terms(a, q, v, v_next);
  // every pass begins the same rows, or the derivatives by the step would pair residuals of different ones
  assert(!a->counted || a->row == knot->nrow);
  knot->nrow = a->row;
  if (a->jacobian) lay_force_rows(a);
  if (a->jacobian && tr->smoothness > 0) add_smoothness(a);
}
