/// A motion under examination: whether it fits its problem and all of it is numbers, its velocities from the knots, and
/// what is kept of it; worst values and names. What is measured of it: verify.c.
#include "verification.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double usual_gravity = 9.81; // m/s^2, unit of forces where the model has none

cav_status cav_verification_fail(cav_error *error, cav_status status, const char *format, ...) {
  if (!error) return status;
  va_list list;
  va_start(list, format);
  error->status = status;
  error->line = 0;
  vsnprintf(error->text, sizeof error->text, format, list);
  va_end(list);
  return status;
}

void cav_metric_note(cav_metric *metric, double value, int knot, const char *format, ...) {
  if (value <= metric->value || isnan(metric->value)) return;
  va_list list;
  va_start(list, format);
  metric->value = value;
  metric->knot = knot;
  vsnprintf(metric->where, sizeof metric->where, format, list);
  va_end(list);
}

const char *cav_verification_link_name(const cav_model *model, int link, char buffer[32]) {
  int body = model->link[link].body;
  if (link == 0) return "the world";
  if (*model->body[body].name) return model->body[body].name;
  snprintf(buffer, 32, "body %d", body);
  return buffer;
}

int cav_verification_is_line(const cav_model *model, int dof) {
  const cav_joint *joint = model->joint + model->dof[dof].joint;
  return joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && dof - joint->dof < 3);
}

// 1 if all n values are finite
static int all_finite(const double *x, size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (!isfinite(x[i])) return 0;
  }
  return 1;
}

// the motion fits the problem, and all of it is numbers
static cav_status admit(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                        const double *gain_q, const double *gain_v, cav_error *error) {
  if (!problem || !problem->model || !trajectory || !contact) {
    return cav_verification_fail(error, CAV_BAD_INPUT,
                                 "verification needs a problem with a model, a trajectory and a contact law");
  }
  const cav_model *model = problem->model;
  if (trajectory->nq != model->nq || trajectory->nv != model->nv) {
    return cav_verification_fail(error, CAV_BAD_INPUT,
                                 "the trajectory has %d positions and %d velocities, the model %d and %d: "
                                 "verify it with the model it was solved for",
                                 trajectory->nq, trajectory->nv, model->nq, model->nv);
  }
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    const cav_user_quantity *user = term->user;
    if (term->quantity != CAV_QUANTITY_USER) continue;
    if (!user || !user->name || !user->value || user->dim < 1 || user->dim > CAV_USER_DIM_MAX ||
        term->component >= user->dim)
      return cav_verification_fail(error, CAV_BAD_INPUT, "term %d is of a quantity of one's own that is not filled", i);
  }
  if (!problem->q_start || !problem->v_start) {
    return cav_verification_fail(error, CAV_BAD_INPUT, "the problem has no start: set q_start and v_start");
  }
  if (problem->duration_most == 0 && !(fabs(trajectory->timestep - problem->timestep) <= 1e-9 * problem->timestep)) {
    return cav_verification_fail(error, CAV_BAD_INPUT, "the trajectory's step is %.9g s, the problem's %.9g s",
                                 trajectory->timestep, problem->timestep);
  }
  if (!(problem->timestep > 0) || !(trajectory->timestep > 0))
    return cav_verification_fail(error, CAV_BAD_INPUT,
                                 "the steps of the problem and of the trajectory must be positive");
  if (!(fabs(contact->timestep - trajectory->timestep) <= 1e-9 * trajectory->timestep))
    return cav_verification_fail(error, CAV_BAD_INPUT,
                                 "the claimed law is at a step of %.9g s, the trajectory's is %.9g s",
                                 contact->timestep, trajectory->timestep);
  long knots = lround(problem->duration / problem->timestep) + 1;
  if (trajectory->nknot < 2 || trajectory->nknot != knots) {
    return cav_verification_fail(error, CAV_BAD_INPUT, "the trajectory has %d knots, the problem asks for %ld",
                                 trajectory->nknot, knots);
  }
  size_t n = (size_t)trajectory->nknot, gains = (n - 1) * (size_t)model->nv * (size_t)model->nv;
  int finite = all_finite(trajectory->q, n * (size_t)model->nq) &&
               (!problem->free_start || all_finite(trajectory->v, (size_t)model->nv)) &&
               all_finite(problem->q_start, (size_t)model->nq) && all_finite(problem->v_start, (size_t)model->nv) &&
               (!gain_q || all_finite(gain_q, gains)) && (!gain_v || all_finite(gain_v, gains));
  return finite ? CAV_OK
                : cav_verification_fail(error, CAV_NOT_FINITE,
                                        "the trajectory, the start or the gains hold numbers that are not finite");
}

void cav_verification_end(cav_verification *verification) {
  cav_cycle_image_free(verification->image);
  cav_state_free(verification->state);
  cav_state_free(verification->bare);
  cav_edges_free(verification->edges);
  free(verification->failure);
  free(verification->deviation);
  free(verification->v);
  free(verification->u);
  free(verification->control);
}

// velocities from the knots and that of the start; one more closes the motion
static void knot_velocities(cav_verification *verification) {
  const cav_model *model = verification->model;
  int nq = model->nq, nv = model->nv;
  for (int t = 1; t <= verification->last; t++) {
    cav_difference(model, verification->q + (t - 1) * nq, verification->q + t * nq, verification->h,
                   verification->v + t * nv);
  }
  double *close = verification->v + (verification->last + 1) * nv;
  memset(close, 0, sizeof(double) * nv);
  if (verification->image) {
    cav_cycle_image_tangent(verification->image, -1, close - nv, verification->v);
    cav_cycle_image_tangent(verification->image, 1, verification->v + nv, close);
  } else if (!verification->problem->close_at_rest) {
    memcpy(close, close - nv, sizeof(double) * nv);
  }
}

cav_options cav_verification_law(const cav_verification *verification, int t) {
  cav_options law = verification->law;
  law.stops = law.stops && t == verification->last && verification->rows > verification->last;
  return law;
}

static cav_status verification_start(cav_verification *verification, const cav_problem *problem,
                                     const cav_trajectory *trajectory, const cav_options *contact, cav_error *error) {
  const cav_model *model = problem->model;
  size_t n = (size_t)trajectory->nknot, nv = (size_t)model->nv;
  *verification = (cav_verification){.problem = problem,
                                     .model = model,
                                     .law = *contact,
                                     .last = trajectory->nknot - 1,
                                     .h = trajectory->timestep,
                                     .arm = CAV_MOMENT_ARM,
                                     .q = trajectory->q};
  verification->periods = 1;
  if (problem->cycle.on) {
    verification->image = cav_cycle_image_new(problem, error);
    if (!verification->image) return error->status;
    verification->periods = problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  }
  verification->rows = verification->last + (problem->close_at_rest && !problem->cycle.on ? 1 : 0);
  verification->law.timestep = verification->h;
  // weight, or a like force where there is no gravity
  const double *g = model->gravity;
  double pull = contact->gravity ? sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) : 0;
  verification->weight = (pull > 0 ? pull : usual_gravity) * (model->mass > 0 ? model->mass : 1);
  verification->state = cav_state_new(model);
  verification->bare = cav_state_new(model);
  verification->v = malloc(sizeof(double) * (n + 1) * (nv + 1));
  verification->u = calloc(n * (nv + 1), sizeof(double));
  verification->control = calloc(n * ((size_t)model->nu + 1), sizeof(double));
  verification->failure = calloc(1, sizeof *verification->failure);
  verification->deviation = calloc(nv + 1, sizeof(double));
  verification->edges = cav_edges_new(model);
  if (!verification->failure || !verification->deviation || !verification->edges) return CAV_NO_MEMORY;
  if (!verification->state || !verification->bare || !verification->v || !verification->u || !verification->control)
    return CAV_NO_MEMORY;
  verification->state->options = cav_verification_law(verification, 0);
  verification->bare->options.contact = verification->bare->options.constraint = 0;
  cav_residual_find(verification, verification->v, verification->u);
  memcpy(verification->v, problem->free_start ? trajectory->v : problem->v_start, sizeof(double) * nv);
  knot_velocities(verification);
  return CAV_OK;
}

cav_status cav_verification_begin(cav_verification *verification, const cav_problem *problem,
                                  const cav_trajectory *trajectory, const cav_options *contact, const double *gain_q,
                                  const double *gain_v, cav_error *error) {
  *verification = (cav_verification){0};
  cav_status status = admit(problem, trajectory, contact, gain_q, gain_v, error);
  if (status != CAV_OK) return status;
  if (error) *error = (cav_error){0};
  cav_error refusal = {0};
  status = verification_start(verification, problem, trajectory, contact, &refusal);
  if (refusal.status != CAV_OK && error) *error = refusal;
  return status;
}
