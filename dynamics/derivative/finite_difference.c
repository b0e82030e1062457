/// Staged finite differences of whatever a state holds after the inverse, one-sided or centred: the reference method
/// (METHOD.md, 7). A column of v_next or v repeats no position work; a column of q is one evaluation of all, in the
/// tangent q (+) step e_j. Steps are relative to max(1, |coordinate|), rotations absolute. One-sided columns are first
/// order in the step, centred ones second order where the law is smooth.
#include <assert.h>
#include <stdlib.h>

#include "derivative.h"
#include "math3.h"

/// Everything one pass of columns needs.
typedef struct difference {
  const cav_model *model;
  cav_state *state;
  cav_derivative method;
  const double *q, *v, *v_next;
  cav_readout readout;
  void *context;
  int n;
  double *base, *plus, *minus;      ///< [n]
  double *q_moved, *velocity_moved; ///< [nq], [nv]
} difference;

/// Relative steps of positions and velocities.
static const double POSITION_STEP[] = {[CAV_DERIVATIVE_FORWARD] = 1e-7, [CAV_DERIVATIVE_CENTRED] = 1e-5};
static const double VELOCITY_STEP[] = {[CAV_DERIVATIVE_FORWARD] = 1e-6, [CAV_DERIVATIVE_CENTRED] = 1e-4};

// room for the readings and moved coordinates; kept by the state
static double *room(cav_state *state, size_t count) {
  cav_workspace *w = state->work;
  if (count > w->readout_room) {
    double *larger = realloc(w->readout, count * sizeof *larger);
    if (!larger) { return NULL; }
    w->readout = larger;
    w->readout_room = count;
  }
  return w->readout;
}

// evaluates with one coordinate of q moved
static cav_status read_q(difference *d, int j, double step, double *value) {
  memcpy(d->q_moved, d->q, (size_t)d->model->nq * sizeof *d->q);
  cav_configuration_perturb(d->model, j, step, d->q_moved);
  cav_status status = cav_inverse_from(d->model, d->state, CAV_STAGE_NONE, d->q_moved, d->v, d->v_next, d->state->u);
  if (status == CAV_OK) { d->readout(d->model, d->state, d->context, value); }
  return status;
}

// with one coordinate of v (stage: positions stay) or v_next (stage: positions and v stay) moved
static cav_status read_velocity(difference *d, cav_stage unchanged, int j, double step, double *value) {
  int next = unchanged == CAV_STAGE_VELOCITY;
  memcpy(d->velocity_moved, next ? d->v_next : d->v, (size_t)d->model->nv * sizeof *d->v);
  d->velocity_moved[j] += step;
  cav_status status = cav_inverse_from(d->model, d->state, unchanged, d->q, next ? d->v : d->velocity_moved,
                                       next ? d->velocity_moved : d->v_next, d->state->u);
  if (status == CAV_OK) { d->readout(d->model, d->state, d->context, value); }
  return status;
}

static cav_status read_moved(difference *d, cav_stage unchanged, int j, double step, double *value) {
  return unchanged == CAV_STAGE_NONE ? read_q(d, j, step, value) : read_velocity(d, unchanged, j, step, value);
}

// step of a coordinate, such that x + step - x is exactly the step
static double step_of(const difference *d, cav_stage unchanged, int j, double relative) {
  double x = 0;
  if (unchanged == CAV_STAGE_NONE) {
    const cav_joint *joint = &d->model->joint[d->model->dof[j].joint];
    int k = j - joint->dof;
    if (joint->type == CAV_JOINT_SLIDE || joint->type == CAV_JOINT_HINGE || (joint->type == CAV_JOINT_FREE && k < 3)) {
      x = d->q[joint->q + k];
    }
  } else {
    x = unchanged == CAV_STAGE_VELOCITY ? d->v_next[j] : d->v[j];
  }
  double moved = x + relative * fmax(1, fabs(x));
  return moved - x;
}

// all columns of one of the three derivatives
static cav_status columns(difference *d, cav_stage unchanged, double relative, double *out) {
  int nv = d->model->nv, centred = d->method == CAV_DERIVATIVE_CENTRED;
  for (int j = 0; j < nv && out; j++) {
    double step = step_of(d, unchanged, j, relative);
    const double *from = centred ? d->minus : d->base;
    cav_status status = read_moved(d, unchanged, j, step, d->plus);
    if (status == CAV_OK && centred) { status = read_moved(d, unchanged, j, -step, d->minus); }
    if (status != CAV_OK) { return status; }
    double inverse = 1 / (centred ? 2 * step : step);
    for (int i = 0; i < d->n; i++) { out[i * nv + j] = (d->plus[i] - from[i]) * inverse; }
  }
  return CAV_OK;
}

// brings the state back to the point: only the stages that a pass has disturbed
static cav_status restore(difference *d, cav_stage unchanged) {
  return cav_inverse_from(d->model, d->state, unchanged, d->q, d->v, d->v_next, d->state->u);
}

cav_status cav_readout_differentiate(const cav_model *model, cav_state *state, cav_derivative method, double step,
                                     const double *q, const double *v, const double *v_next, cav_readout readout,
                                     void *context, int n, double *value, double *d_dq, double *d_dv,
                                     double *d_dv_next) {
  int by_difference = method == CAV_DERIVATIVE_FORWARD || method == CAV_DERIVATIVE_CENTRED;
  if (n < 0 || !(step >= 0) || !by_difference) { return CAV_BAD_INPUT; }
  double *scratch = room(state, 3 * (size_t)n + (size_t)model->nq + (size_t)model->nv);
  if (!scratch) { return CAV_NO_MEMORY; }
  difference d = {.model = model,
                  .state = state,
                  .method = method,
                  .q = q,
                  .v = v,
                  .v_next = v_next,
                  .readout = readout,
                  .context = context,
                  .n = n};
  d.base = scratch;
  d.plus = d.base + n;
  d.minus = d.plus + n;
  d.q_moved = d.minus + n;
  d.velocity_moved = d.q_moved + model->nq;
  assert(d.velocity_moved + model->nv <= scratch + state->work->readout_room);

  // the point itself: a failure here leaves every output untouched
  cav_status status = restore(&d, CAV_STAGE_NONE);
  if (status != CAV_OK) { return status; }
  readout(model, state, context, d.base);
  if (value && n > 0) { memcpy(value, d.base, (size_t)n * sizeof *value); }

  // cheapest stage first, so that positions are computed once
  double relative = step > 0 ? step : VELOCITY_STEP[method];
  status = columns(&d, CAV_STAGE_VELOCITY, relative, d_dv_next);
  if (status == CAV_OK) { status = columns(&d, CAV_STAGE_POSITION, relative, d_dv); }
  if (status == CAV_OK) { status = columns(&d, CAV_STAGE_NONE, step > 0 ? step : POSITION_STEP[method], d_dq); }
  // back to the point, also when a moved evaluation failed
  if (d_dq || d_dv || d_dv_next) {
    cav_status back = restore(&d, d_dq ? CAV_STAGE_NONE : d_dv ? CAV_STAGE_POSITION : CAV_STAGE_VELOCITY);
    status = status == CAV_OK ? back : status;
  }
  return status;
}

static void read_force(const cav_model *model, cav_state *state, void *context, double *value) {
  (void)context;
  memcpy(value, state->u, (size_t)model->nv * sizeof *value);
}

cav_status cav_inverse_jacobian_by(const cav_model *model, cav_state *state, cav_derivative method, const double *q,
                                   const double *v, const double *v_next, double *du_dq, double *du_dv,
                                   double *du_dv_next) {
  if (method == CAV_DERIVATIVE_ANALYTIC) {
    cav_status status = cav_inverse(model, state, q, v, v_next, state->u);
    return status != CAV_OK ? status : cav_derivatives(model, state, du_dq, du_dv, du_dv_next);
  }
  return cav_readout_differentiate(model, state, method, 0, q, v, v_next, read_force, NULL, model->nv, NULL, du_dq,
                                   du_dv, du_dv_next);
}

cav_status cav_inverse_jacobian(const cav_model *model, cav_state *state, const double *q, const double *v,
                                const double *v_next, double *du_dq, double *du_dv, double *du_dv_next) {
  return cav_inverse_jacobian_by(model, state, CAV_DERIVATIVE_FORWARD, q, v, v_next, du_dq, du_dv, du_dv_next);
}
