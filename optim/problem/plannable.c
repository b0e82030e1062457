/// Which actuators a plan can use: those whose efforts are linear forms of u with limits that are constant, or that
/// move with q and v as a servo's do.
#include "plannable.h"

#include <stdio.h>

#include "cavort/problem.h"

static int is_scalar(const cav_model *model, int joint) {
  return model->joint[joint].type == CAV_JOINT_HINGE || model->joint[joint].type == CAV_JOINT_SLIDE;
}

int cav_servo_bounds(const cav_model *model, int actuator) {
  const cav_actuator *a = &model->actuator[actuator];
  int servo = a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_AFFINE && a->activation != CAV_ACTIVATION_INTEGRATOR;
  int straight = a->transmission == CAV_TRANSMISSION_TENDON || is_scalar(model, a->target);
  return servo && a->ctrllimited && a->constant && straight;
}

const char *cav_actuator_unplannable(const cav_model *model, int actuator) {
  const cav_actuator *a = &model->actuator[actuator];
  int motor = a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_NONE;
  if (!a->constant) return "its moments depend on the configuration";
  if (a->gain == CAV_GAIN_MUSCLE) return "what a muscle can give depends on its length and velocity";
  if (!motor && a->ctrllimited && !cav_servo_bounds(model, actuator))
    return "the limits of its control move with its length and velocity in a way that is not planned with";
  return NULL;
}

cav_status cav_actuators_plannable(const cav_model *model, cav_error *error) {
  for (int i = 0; i < model->nu; i++) {
    const cav_actuator *a = &model->actuator[i];
    const char *why = cav_actuator_unplannable(model, i);
    if (!why) continue;
    if (error) {
      *error = (cav_error){.status = CAV_NOT_SUPPORTED};
      snprintf(error->text, sizeof error->text,
               "actuator '%.60s' (%d) cannot be planned with: %s; use motors along joints or fixed tendons instead",
               a->name, i, why);
    }
    return CAV_NOT_SUPPORTED;
  }
  return CAV_OK;
}
