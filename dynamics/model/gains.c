/// Gains that a file gives by the inertia they work against, at q0, as MuJoCo does. A joint's spring and damper by time
/// constant t and damping ratio z: with the inertia m = 1 / (its mean reference weight), k = m / (t z)^2 and b = 2 m / t.
/// A servo's velocity gain by damping ratio: 2 z sqrt(kp m), where m sums the diagonal of M over the squared moments of
/// its transmission.
#include <stdlib.h>

#include "compile.h"
#include "math3.h"
#include "step.h"

static void settle_springs(const cav_spec *spec, cav_model *model) {
  for (int i = 0; i < model->njoint; i++) {
    const double *given = spec->joint.at[i].springdamper;
    cav_joint *joint = (cav_joint *)&model->joint[i];
    if (!(given[0] > 0 && given[1] > 0)) continue;
    int n = joint->type == CAV_JOINT_FREE ? 6 : joint->type == CAV_JOINT_BALL ? 3 : 1;
    double weight = 0;
    for (int k = 0; k < n; k++) weight += model->dof[joint->dof + k].inverse_weight / n;
    double mass = 1 / fmax(1e-15, weight);
    joint->stiffness = spec->option.spring ? mass / (given[0] * given[0] * given[1] * given[1]) : 0;
    for (int k = 0; k < n; k++)
      ((cav_dof *)&model->dof[joint->dof + k])->damping = spec->option.damper ? 2 * mass / given[0] : 0;
  }
}

// a velocity term above 0 stands for a ratio where the servo pulls towards its control
static int has_ratio(const cav_actuator *a) {
  return a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_AFFINE && a->gain_parameter[0] != 0 &&
         a->gain_parameter[0] == -a->bias_parameter[1] && a->bias_parameter[2] > 0;
}

// M's diagonal over squared moments [nv]
static double mass_along(const cav_model *model, const cav_state *state, const double *moment) {
  const cav_workspace *w = state->work;
  double sum = 0;
  for (int i = 0; i < model->nv; i++) {
    if (fabs(moment[i]) > 1e-15) sum += w->M[w->row[i]] / (moment[i] * moment[i]);
  }
  return sum;
}

int cav_settle_gains(const cav_spec *spec, cav_model *model) {
  settle_springs(spec, model);
  int ratios = 0;
  for (int i = 0; i < model->nactuator; i++) ratios += has_ratio(&model->actuator[i]);
  if (!ratios) return 1;
  cav_state *state = cav_state_new(model);
  double *moment = malloc(((size_t)model->nv + 1) * sizeof *moment);
  if (state && moment) {
    cav_workspace *w = state->work;
    cav_kinematics(model, state, model->q0);
    cav_composite_inertia(model, state, w->M);
    for (int i = 0; i < model->nv; i++) w->M[w->row[i]] += w->armature[i];
    for (int i = 0; i < model->nactuator; i++) {
      cav_actuator *a = (cav_actuator *)&model->actuator[i];
      if (!has_ratio(a)) continue;
      cav_actuator_length(model, state, i, moment);
      double mass = mass_along(model, state, moment);
      a->bias_parameter[2] *= -2 * sqrt(fmax(0, a->gain_parameter[0] * mass));
    }
  }
  int done = state && moment;
  cav_state_free(state);
  free(moment);
  return done;
}
