/// Limits of actuators for verification, from the model's numbers alone: force = gain * input + bias, in [N] or [N m]
/// of one unit of effort. The input is the control, or the integrated activation of an actuator that has one; what an
/// effort takes of it is (force - bias) / gain, against the limits of the input; the force itself against those of the
/// force. An actuator without bias gives what its limits of input and force let through, whatever its length and
/// velocity are. A motion keeps to the fraction of the limits that it is planned with (effort_limit). Muscles, moments
/// that vary, and limited controls behind gains that vary are refused by name.
#include <math.h>
#include <stdio.h>

#include "objects.h"
#include "verification.h"

// part of the limits that is planned with, of actuators that are so many times as strong
static double planned_part(const cav_problem *p) {
  return p->strength > 0 ? p->strength * p->effort_limit : p->effort_limit;
}

// limits of the input; 0 where there are none
static int input_range(const cav_actuator *a, double range[2]) {
  int integrated = a->activation == CAV_ACTIVATION_INTEGRATOR;
  const double *limit = integrated ? a->actrange : a->ctrlrange;
  if (!(integrated ? a->actlimited : a->ctrllimited)) return 0;
  range[0] = limit[0];
  range[1] = limit[1];
  return 1;
}

// range becomes what is also within x and y
static void narrow(double range[2], double x, double y) {
  range[0] = fmax(range[0], fmin(x, y));
  range[1] = fmin(range[1], fmax(x, y));
}

void cav_verification_actuator_range(const cav_model *model, int actuator, double range[2], double *scale) {
  const cav_actuator *a = model->actuator + actuator;
  double input[2], most = 0;
  range[0] = -INFINITY;
  range[1] = INFINITY;
  if (a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_NONE && input_range(a, input))
    narrow(range, a->gain_parameter[0] / a->unit * input[0], a->gain_parameter[0] / a->unit * input[1]);
  if (a->forcelimited) narrow(range, a->forcerange[0], a->forcerange[1]);
  for (int k = 0; k < 2; k++) {
    if (isfinite(range[k])) most = fmax(most, fabs(range[k]));
  }
  *scale = most > 0 ? most : 1;
}

cav_status cav_verification_actuators(const cav_model *model, cav_error *error) {
  for (int i = 0; i < model->nu; i++) {
    const cav_actuator *a = model->actuator + i;
    double range[2];
    int varies = a->gain != CAV_GAIN_FIXED || a->bias == CAV_BIAS_MUSCLE;
    const char *why = !a->constant                      ? "its moments depend on the configuration"
                      : a->gain == CAV_GAIN_MUSCLE      ? "what a muscle can give depends on its length and velocity"
                      : varies && input_range(a, range) ? "its control is limited, and what it gives varies otherwise "
                                                          "than a servo's"
                                                        : NULL;
    if (!why) continue;
    if (error) {
      *error = (cav_error){.status = CAV_NOT_SUPPORTED};
      snprintf(error->text, sizeof error->text, "the limits of actuator '%.60s' (%d) cannot be verified: %s", a->name,
               i, why);
    }
    return CAV_NOT_SUPPORTED;
  }
  return CAV_OK;
}

// the part of a servo's control that is planned with: margins at both ends, of an angle as of any other; the whole where its
// force has limits, which keep them
static void plan_input(const cav_verification *verification, const cav_actuator *a, double range[2]) {
  if (a->forcelimited) return;
  double middle = (range[0] + range[1]) / 2;
  for (int k = 0; k < 2; k++) range[k] = middle + (range[k] - middle) * planned_part(verification->problem);
}

// the input of a servo that an effort takes at the state and a velocity
static double servo_input(const cav_verification *verification, int actuator, double effort, const double *v,
                          double *moment) {
  const cav_actuator *a = verification->model->actuator + actuator;
  double length = cav_actuator_length(verification->model, verification->state, actuator, moment), velocity = 0;
  for (int d = 0; d < verification->model->nv; d++) velocity += moment[d] * v[d];
  const double *p = a->bias_parameter;
  return (a->unit * effort - p[0] - p[1] * length - p[2] * velocity) / a->gain_parameter[0];
}

void cav_verification_effort(const cav_verification *verification, int t, int actuator, double effort, const double *v,
                             double *moment, const char *suffix, cav_metric *metric) {
  const cav_model *model = verification->model;
  const cav_actuator *a = model->actuator + actuator;
  char words[CAV_WORDS];
  double range[2], scale;
  cav_verification_actuator_range(model, actuator, range, &scale);
  const double planned = planned_part(verification->problem);
  range[0] *= planned, range[1] *= planned;
  cav_metric_note(metric, fmax(range[0] - effort, effort - range[1]) / scale, t, "%s%.60s at %.4g of %.4g .. %.4g%s",
                  *a->name ? "actuator " : "", cav_actuator_words(model, actuator, words), effort, range[0], range[1],
                  suffix);
  if (a->bias == CAV_BIAS_NONE || !input_range(a, range)) return;
  double input = servo_input(verification, actuator, effort, v, moment), most = fmax(fabs(range[0]), fabs(range[1]));
  plan_input(verification, a, range);
  cav_metric_note(metric, fmax(range[0] - input, input - range[1]) / (most > 0 ? most : 1), t,
                  "servo %.60s, control at %.4g of %.4g .. %.4g%s", cav_actuator_words(model, actuator, words), input,
                  range[0], range[1], suffix);
}

double cav_verification_effort_scale(const cav_model *model, int actuator) {
  const cav_actuator *a = model->actuator + actuator;
  double range[2], scale;
  cav_verification_actuator_range(model, actuator, range, &scale);
  if (a->bias == CAV_BIAS_NONE || a->forcelimited || !input_range(a, range)) return scale;
  double most = fmax(fabs(range[0]), fabs(range[1]));
  return most > 0 ? fabs(a->gain_parameter[0]) * most / a->unit : 1;
}

int cav_verification_effort_rows(const cav_model *model, int actuator) {
  const cav_actuator *a = model->actuator + actuator;
  double range[2];
  return 1 + (a->bias != CAV_BIAS_NONE && a->forcelimited && input_range(a, range));
}

double cav_verification_effort_row(const cav_verification *verification, int actuator, int component, double effort,
                                   const double *v, double *moment, double range[2]) {
  const cav_actuator *a = verification->model->actuator + actuator;
  double scale, value = effort, part = planned_part(verification->problem);
  cav_verification_actuator_range(verification->model, actuator, range, &scale);
  if (a->bias != CAV_BIAS_NONE && (component > 0 || !a->forcelimited) && input_range(a, range)) {
    value = servo_input(verification, actuator, effort, v, moment);
    double most = fmax(fabs(range[0]), fabs(range[1]));
    scale = most > 0 ? most : 1;
    plan_input(verification, a, range);
    part = 1;
  }
  for (int k = 0; k < 2; k++) range[k] *= part / scale;
  return value / scale;
}
