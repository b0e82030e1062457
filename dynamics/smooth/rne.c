/// Newton-Euler: spatial velocities and accelerations down the tree, forces up it. Gravity enters as the acceleration
/// of the base. All vectors are at the tree's reference point (kinematics.c), so A and V only add from link to link:
/// A_child = A_parent + S a + V x S v with V the velocity before the joint. Forces balance about each link's centre of
/// mass. A free joint is two groups of dofs, translation and rotation: the axes of a group turn with what is before it.
#include "math3.h"
#include "smooth.h"

void cav_link_velocities(const cav_model *model, const cav_state *state, const double *v, double *velocity) {
  for (int i = 1; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    double V[6];
    copy6(V, velocity + 6 * link->parent);
    for (int k = link->dof; k < link->dof + link->ndof; k++) { axpy6(V, V, v[k], state->axis + 6 * k); }
    copy6(velocity + 6 * i, V);
  }
}

void cav_link_biases(const cav_model *model, const cav_state *state, const double *v, const double *velocity,
                     double *bias) {
  memset(bias, 0, 6 * sizeof *bias);
  for (int i = 1; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    double V[6], A[6], before[6];
    copy6(V, velocity + 6 * link->parent);
    copy6(A, bias + 6 * link->parent);
    copy6(before, V);
    for (int k = link->dof; k < link->dof + link->ndof; k++) {
      double motion[6];
      if (state->work->group[k]) copy6(before, V);
      scale6(motion, v[k], state->axis + 6 * k);
      accumulate6(V, motion);
      motion_cross_add(A, before, motion);
    }
    copy6(bias + 6 * i, A);
  }
}

// wrench at the reference that moves a link's mass with velocity V and acceleration A
static inline void link_force(double F[6], double mass, const double *inertia, const double *com,
                              const double *reference, const double *V, const double *A) {
  double d[3], v[3], a[3], momentum[3];
  sub3(d, com, reference);

  // force: mass times acceleration of the centre of mass
  copy3(v, V + 3);
  cross_add3(v, V, d);
  copy3(a, A + 3);
  cross_add3(a, A, d);
  cross_add3(a, V, v);
  scale3(F + 3, mass, a);

  // moment: rate of the angular momentum about the centre of mass, then about the reference
  symmetric_mul(F, inertia, A);
  symmetric_mul(momentum, inertia, V);
  cross_add3(F, V, momentum);
  cross_add3(F, d, F + 3);
}

void cav_newton_euler(const cav_model *model, cav_state *state, const double *v, const double *v_next,
                      const double *a) {
  const cav_workspace *w = state->work;
  double *base = w->acceleration;
  zero3(base);
  scale3(base + 3, state->options.gravity ? -1 : 0, model->gravity);
  for (int i = 1; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    double V[6], W[6], A[6], before[6];
    copy6(V, state->velocity + 6 * link->parent);
    copy6(W, state->velocity_next + 6 * link->parent);
    copy6(A, w->acceleration + 6 * link->parent);
    copy6(before, V);

    // along the joints of the link
    for (int k = link->dof; k < link->dof + link->ndof; k++) {
      const double *S = state->axis + 6 * k;
      double motion[6];
      if (w->group[k]) copy6(before, V);
      scale6(motion, v[k], S);
      accumulate6(V, motion);
      axpy6(W, W, v_next[k], S);
      axpy6(A, A, a[k], S);
      motion_cross_add(A, before, motion);
    }
    copy6(state->velocity + 6 * i, V);
    copy6(state->velocity_next + 6 * i, W);
    copy6(w->acceleration + 6 * i, A);
    link_force(state->force + 6 * i, link->mass, state->inertia + 6 * i, state->com + 3 * i, state->reference + 3 * i,
               V, A);
  }
}

void cav_inertial_forces(const cav_model *model, const cav_state *state, double *force) {
  for (int i = 1; i < model->nlink; i++) {
    link_force(force + 6 * i, model->link[i].mass, state->inertia + 6 * i, state->com + 3 * i, state->reference + 3 * i,
               state->velocity + 6 * i, state->work->acceleration + 6 * i);
  }
}

void cav_force_project(const cav_model *model, cav_state *state, double *u) {
  memset(state->force, 0, 6 * sizeof(double));
  for (int i = model->nlink - 1; i > 0; i--) {
    const cav_link *link = &model->link[i];
    const double *F = state->force + 6 * i;
    for (int k = link->dof; k < link->dof + link->ndof; k++) { u[k] = dot6(state->axis + 6 * k, F); }
    if (link->parent > 0) { accumulate6(state->force + 6 * link->parent, F); }
  }
}
