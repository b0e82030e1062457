/// Forces on roots that nothing in the model gives, where the problem penalises them instead of asking for none: which
/// dofs they act on, how large they are, what they cost. A dof is penalised where it is of a joint between the world and a
/// root link and actuators leave all of a force along it.
#include <math.h>
#include <string.h>

#include "verification.h"

void cav_residual_find(cav_verification *verification, double *unit, double *residual) {
  const cav_model *model = verification->model;
  const cav_residual *allowed = &verification->problem->residual;
  for (int d = 0; d < model->nv; d++) {
    double deviation = cav_verification_is_line(model, d) ? allowed->force : allowed->torque;
    verification->deviation[d] = 0;
    if (model->link[model->dof[d].link].parent != 0 || !(deviation > 0)) continue;
    memset(unit, 0, sizeof(double) * (size_t)model->nv);
    unit[d] = 1;
    cav_actuation(model, verification->bare, unit, residual, NULL);
    if (residual[d] > 1 - 1e-9) verification->deviation[d] = deviation;
  }
}

void cav_residual_add(const cav_verification *verification, int t, const double *residual, cav_residual_sum *sum) {
  const cav_model *model = verification->model;
  double force = 0, torque = 0;
  char name[32];
  for (int l = 1; l < model->nlink; l++) {
    const cav_link *link = model->link + l;
    double square[2] = {0};
    if (link->parent != 0) continue;
    for (int d = link->dof; d < link->dof + link->ndof; d++) {
      double deviation = verification->deviation[d], x = residual[d];
      if (deviation == 0) continue;
      square[!cav_verification_is_line(model, d)] += x * x;
      sum->cost += 0.5 * verification->h * x * x / (deviation * deviation);
    }
    double f = sqrt(square[0]), m = sqrt(square[1]);
    cav_metric_note(&sum->worst, fmax(f, m / verification->arm) / verification->weight, t, "%.4g N and %.4g N m on %s",
                    f, m, cav_verification_link_name(model, l, name));
    force = fmax(force, f), torque = fmax(torque, m);
  }
  sum->knots++;
  sum->force += force * force, sum->torque += torque * torque;
  sum->force_max = fmax(sum->force_max, force), sum->torque_max = fmax(sum->torque_max, torque);
}

void cav_residual_tell(const cav_verification *verification, const cav_residual_sum *sum, cav_verdict *verdict) {
  const cav_residual *allowed = &verification->problem->residual;
  int penalised = allowed->force > 0 || allowed->torque > 0;
  double n = sum->knots;
  verdict->residual_force_rms_n = penalised ? sqrt(sum->force / n) : NAN;
  verdict->residual_force_max_n = penalised ? sum->force_max : NAN;
  verdict->residual_torque_rms_n_m = penalised ? sqrt(sum->torque / n) : NAN;
  verdict->residual_torque_max_n_m = penalised ? sum->torque_max : NAN;
  verdict->residual_fraction_max = penalised ? sum->worst.value : NAN;
  verdict->residual_within = penalised ? allowed->within : NAN;
}
