/// Which actuators a plan can use: those whose efforts are linear forms of u with limits that are constant, or that
/// move with q and v as a servo's do. And how many knots: a machine that gives memory before it has it ends the program
/// where there is none left, so what a plan needs is counted first.
#include "plannable.h"

#include <math.h>
#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

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

double cav_joint_stop(const cav_joint *joint) {
  if (joint->driven) return 0;
  return joint->type == CAV_JOINT_SLIDE ? CAV_TOLERANCE_STOP_WAY : CAV_TOLERANCE_STOP_ANGLE;
}

// bytes that this process may have, INFINITY: unknown
static double memory_most(void) {
  double most = INFINITY;
  const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGESIZE);
  if (pages > 0 && size > 0) most = (double)pages * (double)size;
  static const int limits[] = {RLIMIT_AS, RLIMIT_DATA};
  for (int i = 0; i < 2; i++) {
    struct rlimit limit;
    if (getrlimit(limits[i], &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) most = fmin(most, (double)limit.rlim_cur);
  }
  return most;
}

double cav_planned_part(const cav_problem *problem) {
  return problem->strength > 0 ? problem->strength * problem->effort_limit : problem->effort_limit;
}

double cav_knots_bytes(double knots, int dofs) {
  // of a knot: the inverse's derivatives, 3, and what is gathered from them, 9 blocks; the band of the normal equations
  // and its factors, 3 each
  return knots * (3 + 9 + 2 * 3) * (double)dofs * dofs * sizeof(double);
}

cav_status cav_knots_plannable(double knots, int dofs, cav_error *error) {
  const double least = cav_knots_bytes(knots, dofs);
  const double most = memory_most();
  if (least <= most) return CAV_OK;
  if (error) {
    *error = (cav_error){.status = CAV_BAD_INPUT};
    snprintf(
        error->text, sizeof error->text,
        "a plan of %.0f knots of %d dofs takes %.4g GB at least, expected at most the %.4g GB of this machine; take "
        "longer steps or a shorter duration, or plan it in parts",
        knots, dofs, least / 1e9, most / 1e9);
  }
  return CAV_BAD_INPUT;
}
