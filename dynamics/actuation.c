/// Which forces actuators can give: the orthogonal projection of u on the range of the transmission T [nv*nu], whose
/// column k is actuator k's gear along its joint or tendon, and the least-norm controls that reach it. T does not depend
/// on q for joints and fixed tendons; T'T is inverted once per state, by division where columns share no dof, otherwise
/// as a pseudo-inverse by Jacobi rotations. Control and force limits are not applied.
#include <stdlib.h>

#include "math3.h"
#include "workspace.h"

static const double RANK_TOLERANCE = 1e-12;

int cav_transmission_entries(const cav_model *model, int actuator) {
  const cav_actuator *a = &model->actuator[actuator];
  if (a->transmission == CAV_TRANSMISSION_TENDON) { return model->tendon[a->target].npart; }
  switch (model->joint[a->target].type) {
    case CAV_JOINT_FREE:
      return 6;
    case CAV_JOINT_BALL:
      return 3;
    default:
      return 1;
  }
}

// entry k of an actuator's column
static void transmission_entry(const cav_model *model, const cav_actuator *a, int k, int *dof, double *gear) {
  if (a->transmission == CAV_TRANSMISSION_TENDON) {
    const cav_tendon_part *part = &model->tendon_part[model->tendon[a->target].part + k];
    *dof = model->joint[part->joint].dof;
    *gear = a->gear[0] * part->coef;
  } else {
    *dof = model->joint[a->target].dof + k;
    *gear = a->gear[k];
  }
}

// T'T, dense; returns whether it is diagonal
static int gram(const cav_model *model, const cav_workspace *w, double *G, double *column) {
  int nu = model->nactuator, diagonal = 1;
  memset(G, 0, (size_t)nu * (size_t)nu * sizeof *G);
  memset(column, 0, (size_t)model->nv * sizeof *column);
  for (int i = 0; i < nu; i++) {
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { column[w->gear_dof[e]] += w->gear[e]; }
    for (int j = 0; j < nu; j++) {
      for (int e = w->gear_start[j]; e < w->gear_start[j + 1]; e++) {
        G[i * nu + j] += w->gear[e] * column[w->gear_dof[e]];
      }
      diagonal = diagonal && (i == j || G[i * nu + j] == 0);
    }
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { column[w->gear_dof[e]] = 0; }
  }
  return diagonal;
}

cav_status cav_actuation_compile(const cav_model *model, cav_workspace *w) {
  int nu = model->nactuator, entries = 0;
  for (int i = 0; i < nu; i++) {
    w->gear_start[i] = entries;
    for (int k = 0; k < cav_transmission_entries(model, i); k++, entries++) {
      transmission_entry(model, &model->actuator[i], k, &w->gear_dof[entries], &w->gear[entries]);
    }
  }
  w->gear_start[nu] = entries;
  if (nu == 0) { return CAV_OK; }

  // diagonal: keep the inverses; otherwise the whole pseudo-inverse
  double *G = malloc(3 * (size_t)nu * (size_t)nu * sizeof *G);
  if (!G) { return CAV_NO_MEMORY; }
  w->gram_diagonal = gram(model, w, G, w->scratch);
  if (!w->gram_diagonal) {
    cav_pseudo_inverse(nu, RANK_TOLERANCE, G, G + nu * nu, G + 2 * nu * nu);
    w->gram = G;
    return CAV_OK;
  }
  for (int i = 0; i < nu; i++) {
    double g = G[i * nu + i];
    w->gram_inverse[i] = g > 0 ? 1 / g : 0;
  }
  free(G);
  return CAV_OK;
}

// y = T' u
static void into_controls(const cav_model *model, const cav_workspace *w, const double *u, double *y) {
  for (int i = 0; i < model->nactuator; i++) {
    y[i] = 0;
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { y[i] += w->gear[e] * u[w->gear_dof[e]]; }
  }
}

// y := (T'T)^+ y
static void solve_gram(const cav_model *model, const cav_workspace *w, double *y, double *old) {
  int nu = model->nactuator;
  if (w->gram_diagonal) {
    for (int i = 0; i < nu; i++) { y[i] *= w->gram_inverse[i]; }
    return;
  }
  memcpy(old, y, (size_t)nu * sizeof *old);
  for (int i = 0; i < nu; i++) {
    y[i] = 0;
    for (int j = 0; j < nu; j++) { y[i] += w->gram[i * nu + j] * old[j]; }
  }
}

void cav_actuation(const cav_model *model, cav_state *state, const double *u, double *residual, double *control) {
  const cav_workspace *w = state->work;
  int nu = model->nactuator;
  double *y = w->control;
  into_controls(model, w, u, y);
  solve_gram(model, w, y, y + nu);
  if (residual) {
    if (residual != u && model->nv > 0) { memcpy(residual, u, (size_t)model->nv * sizeof *u); }
    for (int i = 0; i < nu; i++) {
      for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { residual[w->gear_dof[e]] -= w->gear[e] * y[i]; }
    }
  }
  if (control && nu > 0) { memcpy(control, y, (size_t)nu * sizeof *y); }
}

double cav_actuator_length(const cav_model *model, const cav_state *state, int actuator) {
  const cav_actuator *a = &model->actuator[actuator];
  if (a->transmission == CAV_TRANSMISSION_TENDON) { return a->gear[0] * state->tendon_length[a->target]; }
  const cav_joint *joint = &model->joint[a->target];
  const double *q = state->work->q + joint->q;
  double turn[3];
  switch (joint->type) {
    case CAV_JOINT_FREE:
      return 0;
    case CAV_JOINT_BALL:
      quat_log(turn, q);
      return dot3(a->gear, turn);
    default:
      return a->gear[0] * q[0];
  }
}

double cav_actuator_velocity(const cav_model *model, const cav_state *state, int actuator, const double *v) {
  const cav_workspace *w = state->work;
  double sum = 0;
  (void)model;
  for (int e = w->gear_start[actuator]; e < w->gear_start[actuator + 1]; e++) { sum += w->gear[e] * v[w->gear_dof[e]]; }
  return sum;
}

double cav_actuator_force(const cav_model *model, const cav_state *state, int actuator) {
  const cav_workspace *w = state->work;
  into_controls(model, w, state->u, w->control);
  solve_gram(model, w, w->control, w->control + model->nactuator);
  return w->control[actuator];
}
