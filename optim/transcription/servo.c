/// Servos in plans: what an actuator gives is planned as effort, a force; the control behind it is that force less the
/// servo's bias, over its gain. Where control is limited, the limits move with length and velocity, and the row of its
/// effort becomes one of control, linear in u, q and v. Offered for fixed gains with affine bias on scalar joints and
/// fixed tendons; what else moves its limits, or its moments, is refused by name.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "transcription.h"

int cav_servo_set(const cav_model *model, int actuator, cav_servo *servo, double *per_effort, double range[2]) {
  const cav_actuator *a = &model->actuator[actuator];
  const cav_tendon *tendon = a->transmission == CAV_TRANSMISSION_TENDON ? &model->tendon[a->target] : NULL;
  int n = tendon ? tendon->npart : 1;
  servo->dof = malloc((size_t)(n + 1) * sizeof(int));
  servo->of_q = malloc((size_t)(2 * n + 1) * sizeof(double));
  if (!servo->dof || !servo->of_q) return 0;
  servo->of_v = servo->of_q + n;
  servo->n = n;
  double gain = a->gain_parameter[0], limit = fmax(fabs(a->ctrlrange[0]), fabs(a->ctrlrange[1])), scale = 1 / limit;
  for (int k = 0; k < n; k++) {
    const cav_tendon_part *part = tendon ? &model->tendon_part[tendon->part + k] : NULL;
    double moment = a->gear[0] * (part ? part->coef : 1);
    servo->dof[k] = model->joint[part ? part->joint : a->target].dof;
    servo->of_q[k] = scale * a->bias_parameter[1] * moment / gain;
    servo->of_v[k] = scale * a->bias_parameter[2] * moment / gain;
  }
  servo->constant = scale * a->bias_parameter[0] / gain;
  *per_effort = 1 / gain;
  range[0] = a->ctrlrange[0];
  range[1] = a->ctrlrange[1];
  return 1;
}

void cav_servo_free(cav_servo *servo) { free(servo->dof), free(servo->of_q); }

double cav_servo_value(const cav_model *model, const cav_servo *servo, const double *q, const double *v) {
  double value = servo->constant;
  for (int k = 0; k < servo->n; k++) {
    int d = servo->dof[k];
    value += servo->of_q[k] * q[model->joint[model->dof[d].joint].q] + servo->of_v[k] * v[d];
  }
  return value;
}
