/// Second derivatives of the Lagrangian that Gauss-Newton leaves out, knot by knot. What is nonlinear at a knot are its
/// readings y(q, v, v'): forces, contacts, sensors. With the pull p = dL/dy held, the curvature is the derivative of
/// the adjoint product (dy/dz)' p by z = (q, v, v'), taken by differences of analytic derivatives, made symmetric and
/// chained to the three neighbouring knots. Rows that are linear in the unknowns (rates, accelerations, postures,
/// ranges) have none but for the curvature of rotations, whose sum over all rows vanishes where the Lagrangian is
/// stationary, and which is left out.
#include "lagrangian.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "knot.h"

/// Differences: of configurations, rad or m; of velocities that times the step.
static const double shift = 1e-6;

typedef struct curve {
  cav_transcription *tr;
  const cav_trajectory *at;
  double factor;      ///< of the costs
  cav_status *status; ///< [nknot]
  double *room;       ///< [members * room_of]
} curve;

static size_t room_of(const cav_transcription *tr) {
  size_t nv = (size_t)tr->nv;
  return 18 * nv * nv + 9 * nv + (size_t)tr->model->nq;
}

/// Derivative of a cost of weight times norm of a reading by the reading.
static double derivative_of(const cav_term *term, double weight, double reading, double unit) {
  double x = reading / unit;
  return weight * (term->norm == CAV_NORM_ABSOLUTE ? x / sqrt(1 + x * x) : x) / unit;
}

static void pull_force(const cav_force_row *form, double derivative, double *pull) {
  for (int k = 0; k < form->n; k++) pull[form->dof[k]] += derivative * form->coef[k];
}

static double force_of(const cav_force_row *form, const double *u) {
  double value = 0;
  for (int k = 0; k < form->n; k++) value += form->coef[k] * u[form->dof[k]];
  return value;
}

/// What costs of a knot pull its readings by.
static void pull_costs(const cav_transcription *tr, const int *key, int t, double factor, double *pull) {
  const cav_knot *knot = &tr->knot[t];
  int sensor = CAV_CONTACT_READINGS * knot->ncontact;
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    double weight = factor * term->weight * cav_term_weight(tr, term, t);
    if (cav_term_weight(tr, term, t) == 0) continue;
    int dim = cav_term_dim(term);
    for (int k = 0; k < dim && term->use == CAV_USE_COST; k++)
      pull[tr->nv + sensor + k] += derivative_of(term, weight, knot->y[sensor + k], 1);
    for (int k = 0; k < tr->model->nu && term->quantity == CAV_QUANTITY_EFFORT && knot->has_force; k++)
      pull_force(&tr->effort[k], derivative_of(term, weight, force_of(&tr->effort[k], knot->u), term->scale), pull);
    for (int k = 0; k < knot->ncontact && term->use == CAV_USE_COST; k++) {
      int first, n = cav_knot_contact(tr, key, term, t, k, &first), at = CAV_CONTACT_READINGS * k + first;
      for (int r = at; r < at + n; r++) pull[tr->nv + r] += derivative_of(term, weight, knot->y[r], term->scale);
    }
    sensor += dim;
  }
}

/// What multipliers of a knot's rows pull its readings by.
static void pull_rows(const cav_transcription *tr, int t, double *pull) {
  const cav_knot *knot = &tr->knot[t];
  const cav_slot_layout *at = &knot->layout;
  int i = at->term, sensor = CAV_CONTACT_READINGS * knot->ncontact;
  for (int k = 0; k < at->effort; k++) pull_force(&tr->unactuated[k], knot->slot[k].final_multiplier, pull);
  for (int k = at->effort; k < at->joint; k++)
    pull_force(&tr->effort[k - at->effort], knot->slot[k].final_multiplier, pull);
  for (int j = 0; j < tr->problem->nterm; j++) {
    const cav_term *term = &tr->problem->term[j];
    if (cav_term_weight(tr, term, t) == 0) continue;
    int dim = cav_term_dim(term);
    if (term->use != CAV_USE_COST) {
      for (int d = 0; term->quantity != CAV_QUANTITY_SENSOR && d < tr->nv; d++) i += cav_dof_selected(tr, term, d);
      for (int k = 0; k < dim; k++) pull[tr->nv + sensor + k] += knot->slot[i++].final_multiplier;
    }
    sensor += dim;
  }
}

/// The adjoint product at z moved by a distance along coordinate j.
static cav_status adjoint_beside(const curve *c, cav_scratch *s, int t, int j, double distance, const double *pull,
                                 double *moved, double *g) {
  const cav_transcription *tr = c->tr;
  int nv = tr->nv, kind = j / nv;
  double *q = moved + 3 * nv, *step = moved, *v = moved + nv, *v_next = moved + 2 * nv;
  memset(step, 0, (size_t)nv * sizeof *step);
  memcpy(v, cav_velocity_at(tr, c->at, t), (size_t)nv * sizeof *v);
  memcpy(v_next, cav_velocity_after(tr, c->at, t), (size_t)nv * sizeof *v);
  (kind == 0 ? step : kind == 1 ? v : v_next)[j % nv] += distance;
  const double *here = c->at->q + (size_t)t * c->at->nq;
  if (kind == 0) cav_integrate(tr->model, here, step, 1, q);
  cav_status status = cav_inverse(tr->model, s->state, kind == 0 ? q : here, v, v_next, s->value);
  return status == CAV_OK ? cav_readings_adjoint(tr, s, t, pull, g) : status;
}

/// Whether coordinate kind (q_t, v_t, v_{t+1}) of a knot moves with an unknown.
static int kind_moves(const cav_transcription *tr, int t, int kind) {
  int closed = t == tr->nknot - 1 && !tr->periodicity;
  return kind == 2 ? !closed || !tr->problem->close_at_rest : tr->periodicity || t > 0;
}

static cav_status curve_knot(const curve *c, cav_scratch *s, int t, double *room) {
  cav_transcription *tr = c->tr;
  cav_knot *knot = &tr->knot[t];
  size_t nv = (size_t)tr->nv, width = 3 * nv;
  double *K = room, *half = K + width * width, *base = half + width * width, *moved = base + width;
  const double *q = c->at->q + (size_t)t * c->at->nq;
  s->state->options = tr->options;
  cav_status status =
      cav_inverse(tr->model, s->state, q, cav_velocity_at(tr, c->at, t), cav_velocity_after(tr, c->at, t), knot->u);
  if (status != CAV_OK) return status;
  if (!cav_readings_list(tr, s, t)) return CAV_NO_MEMORY;
  double *pull = calloc(nv + (size_t)knot->nread, sizeof *pull);
  if (!pull) return CAV_NO_MEMORY;
  pull_costs(tr, s->key, t, c->factor, pull);
  pull_rows(tr, t, pull);
  status = cav_readings_adjoint(tr, s, t, pull, base);
  memset(K, 0, width * width * sizeof *K);
  for (int j = 0; j < 3 * tr->nv && status == CAV_OK; j++) {
    if (!kind_moves(tr, t, j / tr->nv)) continue;
    double distance = j < tr->nv ? shift : shift / tr->options.timestep;
    status = adjoint_beside(c, s, t, j, distance, pull, moved, K + (size_t)j * width);
    // contact points of a pair may come and go on one side
    if (status == CAV_NOT_SUPPORTED) {
      distance = -distance;
      status = adjoint_beside(c, s, t, j, distance, pull, moved, K + (size_t)j * width);
    }
    for (size_t i = 0; i < width; i++) K[(size_t)j * width + i] = (K[(size_t)j * width + i] - base[i]) / distance;
  }
  free(pull);
  if (status == CAV_NOT_SUPPORTED) return CAV_OK;
  if (status != CAV_OK) return status;
  // symmetric, then T' K T
  for (size_t i = 0; i < width; i++)
    for (size_t j = 0; j < i; j++) K[i * width + j] = K[j * width + i] = 0.5 * (K[i * width + j] + K[j * width + i]);
  cav_transcription_chain(tr, t, (int)width, K, half);
  for (size_t i = 0; i < width; i++)
    for (size_t j = 0; j < width; j++) K[i * width + j] = half[j * width + i];
  cav_transcription_chain(tr, t, (int)width, K, half);
  if (tr->periodicity && (t < 2 || t == tr->nknot - 1)) {
    cav_transcription_wrap(tr, s, t, (int)width, half);
    for (size_t i = 0; i < width; i++)
      for (size_t j = 0; j < width; j++) K[i * width + j] = half[j * width + i];
    cav_transcription_wrap(tr, s, t, (int)width, K);
    memcpy(half, K, width * width * sizeof *K);
  }
  for (size_t i = 0; i < width; i++)
    for (size_t j = 0; j <= i; j++) knot->hessian[i * width + j] += half[i * width + j];
  return CAV_OK;
}

static void curve_item(void *context, int t, int member) {
  const curve *c = context;
  c->status[t] = curve_knot(c, &c->tr->scratch[member], t, c->room + (size_t)member * room_of(c->tr));
}

cav_status cav_lagrangian_curvature(cav_transcription *tr, const cav_trajectory *at, double factor) {
  int members = cav_parallel_size(tr->pool);
  curve c = {tr, at, factor, calloc((size_t)tr->nknot, sizeof(cav_status)), NULL};
  c.room = malloc((size_t)members * room_of(tr) * sizeof(double));
  cav_status status = c.status && c.room ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) cav_parallel_for(tr->pool, tr->nknot, curve_item, &c);
  for (int t = 0; t < tr->nknot && status == CAV_OK; t++) status = c.status[t];
  free(c.status), free(c.room);
  return status;
}
