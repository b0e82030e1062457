/// Shortest and longest transmission of muscles whose file does not say: what their curves are scaled by. MuJoCo pulls
/// the model to both ends in a simulation; here the length itself is minimised and maximised over the ranges of the
/// joints, by projected steps along its gradient from q0, to the nearest end each way. Contacts and other constraints
/// are left out.
#include <stdlib.h>

#include "compile.h"
#include "math3.h"
#include "step.h"

enum { STEPS = 5000 };
static const double FARTHEST = 1e3; ///< a coordinate that goes this far has no end

/// One search.
typedef struct search {
  const cav_model *model;
  cav_state *state;
  int actuator;
  double sign;             // 1: longest, -1: shortest
  double *q, *trial;       // [nq]
  double *derivative, *go; // [nv] gradient of sign times length, and the step
} search;

static double length_at(search *s, const double *q) {
  cav_kinematics(s->model, s->state, q);
  double length = cav_actuator_length(s->model, s->state, s->actuator, s->derivative);
  for (int i = 0; i < s->model->nv; i++) { s->derivative[i] *= s->sign; }
  return s->sign * length;
}

// back into the range of every joint
static void clip(const cav_model *model, double *q) {
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    double *x = q + joint->q;
    if (!joint->limited) { continue; }
    if (joint->type == CAV_JOINT_BALL) {
      double w[3];
      quat_log(w, x);
      double angle = norm3(w);
      if (angle > joint->range[1]) { scale3(w, joint->range[1] / angle, w); }
      quat_exp(x, w);
    } else if (joint->type != CAV_JOINT_FREE) {
      x[0] = fmin(fmax(x[0], joint->range[0]), joint->range[1]);
    }
  }
}

static int ran_away(const cav_model *model, const double *q) {
  double most = 0;
  for (int i = 0; i < model->nq; i++) { most = fmax(most, fabs(q[i])); }
  return !(most < FARTHEST);
}

// length at the end in one direction; returns 0 if there is none
static int find_end(search *s, double *end) {
  const cav_model *model = s->model;
  size_t bytes = (size_t)model->nq * sizeof(double);
  memcpy(s->q, model->q0, bytes);
  clip(model, s->q);
  double length = length_at(s, s->q), step = 1;
  for (int k = 0; k < STEPS; k++) {
    memcpy(s->go, s->derivative, (size_t)model->nv * sizeof(double));
    double gained = 0;
    // longer steps while they pay, shorter ones until one does
    for (; step > 1e-14; step *= 0.5) {
      cav_integrate(model, s->q, s->go, step, s->trial);
      clip(model, s->trial);
      if (ran_away(model, s->trial)) { return 0; }
      gained = length_at(s, s->trial) - length;
      if (gained > 0) { break; }
    }
    if (step <= 1e-14) { break; }
    memcpy(s->q, s->trial, bytes);
    length += gained;
    step *= 2;
    if (gained <= 1e-13 * (1 + fabs(length))) { break; }
  }
  *end = s->sign * length;
  return 1;
}

int cav_length_range_fill(cav_model *model) {
  int bad = -1;
  size_t nq = (size_t)model->nq, nv = (size_t)model->nv;
  search s = {.model = model, .state = cav_state_new(model), .q = malloc((2 * nq + 2 * nv) * sizeof(double))};
  if (!s.state || !s.q) { bad = model->nactuator; }
  s.trial = s.q ? s.q + nq : NULL;
  s.derivative = s.q ? s.trial + nq : NULL;
  s.go = s.q ? s.derivative + nv : NULL;
  for (int i = 0; i < model->nactuator && bad < 0; i++) {
    cav_actuator *a = (cav_actuator *)&model->actuator[i];
    int muscle = a->gain == CAV_GAIN_MUSCLE || a->bias == CAV_BIAS_MUSCLE;
    if (!muscle || a->lengthrange[0] < a->lengthrange[1]) { continue; }
    s.actuator = i;
    for (int k = 0; k < 2 && bad < 0; k++) {
      s.sign = k ? 1 : -1;
      if (!find_end(&s, &a->lengthrange[k])) { bad = i; }
    }
    if (bad < 0 && !(a->lengthrange[0] < a->lengthrange[1])) { bad = i; }
  }
  cav_state_free(s.state);
  free(s.q);
  return bad;
}
