/// The inertia matrix M(q) by the composite rigid body method (Featherstone 2008, section 6.2), tree-sparse as ldl.c
/// stores it, or dense. Only the forward step, reference weights and callers who ask need it: the inverse does not.
/// A composite is ten numbers at the tree's reference point: mass, first moment, inertia.
#include "math3.h"
#include "smooth.h"

void cav_composites_at(const cav_model *model, const cav_posture *at, double *all) {
  // each link's own mass, first moment and inertia at the reference, then sums towards the root
  for (int i = 1; i < model->nlink; i++) {
    double *c = all + 10 * i, d[3], m = model->link[i].mass;
    sub3(d, at->com + 3 * i, at->reference + 3 * i);
    c[0] = m;
    scale3(c + 1, m, d);
    const double *I = at->inertia + 6 * i;
    c[4] = I[0] + m * (d[1] * d[1] + d[2] * d[2]);
    c[5] = I[1] + m * (d[0] * d[0] + d[2] * d[2]);
    c[6] = I[2] + m * (d[0] * d[0] + d[1] * d[1]);
    c[7] = I[3] - m * d[0] * d[1];
    c[8] = I[4] - m * d[0] * d[2];
    c[9] = I[5] - m * d[1] * d[2];
  }
  for (int i = model->nlink - 1; i > 0; i--) {
    int parent = model->link[i].parent;
    if (parent > 0) {
      for (int k = 0; k < 10; k++) { all[10 * parent + k] += all[10 * i + k]; }
    }
  }
}

void cav_composites(const cav_model *model, cav_state *state) {
  const cav_posture at = {.com = state->com, .inertia = state->inertia, .reference = state->reference};
  cav_composites_at(model, &at, state->work->composite);
}

double cav_added_inertia(const cav_model *model, const cav_state *state, int dof) {
  const cav_dof *d = &model->dof[dof];
  double h = state->options.timestep, inertia = d->armature, stiffness = model->joint[d->joint].stiffness;
  if (!state->options.passive) { return inertia; }
  if (state->options.order == CAV_ORDER_EULER) { inertia += h * d->damping; }
  if (stiffness > 0) { inertia += h * cav_look_along_springs(state).next * stiffness; }
  return inertia;
}

void cav_composite_inertia(const cav_model *model, cav_state *state, double *M) {
  const cav_workspace *w = state->work;
  cav_composites(model, state);
  for (int i = 0; i < model->nv; i++) {
    double F[6], *Mi = M + w->row[i];
    inertia_mul(F, w->composite + 10 * model->dof[i].link, state->axis + 6 * i);
    for (int j = i, k = 0; j >= 0; j = w->parent[j], k++) { Mi[k] = dot6(F, state->axis + 6 * j); }
  }
}

void cav_step_inertia(const cav_model *model, cav_state *state, double *M) {
  const cav_workspace *w = state->work;
  const int half = cav_takes_mean(state) && state->options.passive;
  cav_composite_inertia(model, state, M);
  for (int i = 0; i < model->nv; i++) {
    M[w->row[i]] += cav_added_inertia(model, state, i);
    if (half) { M[w->row[i]] += 0.5 * state->options.timestep * model->dof[i].damping; }
  }
}

cav_status cav_inertia(const cav_model *model, cav_state *state, const double *q, double *M) {
  if (!all_finite(q, model->nq)) { return CAV_NOT_FINITE; }
  cav_workspace *w = state->work;
  w->valid = CAV_STAGE_NONE;
  cav_kinematics(model, state, q);
  cav_composite_inertia(model, state, w->M);
  int nv = model->nv;
  memset(M, 0, (size_t)nv * (size_t)nv * sizeof *M);
  for (int i = 0; i < nv; i++) {
    const double *Mi = w->M + w->row[i];
    for (int j = i, k = 0; j >= 0; j = w->parent[j], k++) { M[i * nv + j] = M[j * nv + i] = Mi[k]; }
    M[i * nv + i] += cav_added_inertia(model, state, i);
  }
  return CAV_OK;
}
