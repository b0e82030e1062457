/// Rates that a certificate tells and does not require: the largest mechanical power of an actuator, force times the mean
/// of the velocities that reach and leave the knot, whose sum over steps is its work; the fastest joint, and the fastest
/// against the limit that its file states. Free joints are left out.
#include <math.h>

#include "verification.h"

static void add_power(const cav_verification *verification, int t, double *moment, cav_rates *rates) {
  const cav_model *model = verification->model;
  const double *v = verification->v + t * model->nv, *next = v + model->nv;
  for (int a = 0; a < model->nu; a++) {
    double rate = 0;
    cav_actuator_length(model, verification->state, a, moment);
    for (int d = 0; d < model->nv; d++) rate += moment[d] * (v[d] + next[d]) / 2;
    rates->power = fmax(rates->power, fabs(verification->control[t * model->nu + a] * model->actuator[a].unit * rate));
  }
}

void cav_rates_add(const cav_verification *verification, int t, double *moment, cav_rates *rates) {
  const cav_model *model = verification->model;
  if (t < verification->rows) add_power(verification, t, moment, rates);
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    const double *v = verification->v + t * model->nv + joint->dof;
    if (joint->type == CAV_JOINT_FREE) continue;
    double speed = joint->type == CAV_JOINT_BALL ? sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) : fabs(*v);
    double *most = joint->type == CAV_JOINT_SLIDE ? &rates->slide_speed : &rates->speed;
    *most = fmax(*most, speed);
    if (joint->speed > 0) rates->over_limit = fmax(rates->over_limit, speed / joint->speed);
  }
}
