/// Newton-Euler: spatial velocities and accelerations down the tree, forces up it. Gravity enters as the acceleration
/// of the base. All vectors are at the tree's reference point (kinematics.c), so A and V only add from link to link:
/// A_child = A_parent + S a + V x S v with V the velocity before the joint. Forces balance about each link's centre of
/// mass. A free joint is two groups of dofs, translation and rotation: the axes of a group turn with what is before it.
#include "math3.h"
#include "tree.h"
#include "vectors.h"

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

CAV_VECTOR_BODY void move_all_body(const cav_model *model, const cav_workspace *w, double gravity,
                                   const tree_motion *m) {
  move_tree(model, w, gravity, m);
}
CAV_BY_VECTORS(move_all, (const cav_model *model, const cav_workspace *w, double gravity, const tree_motion *m),
               (model, w, gravity, m))

void cav_newton_euler(const cav_model *model, cav_state *state, const double *v, const double *v_next,
                      const double *a) {
  const cav_workspace *w = state->work;
  const tree_motion m = {state->com, state->inertia,  state->reference,     state->axis,     v,           v_next,
                         a,          state->velocity, state->velocity_next, w->acceleration, state->force};
  move_all(model, w, state->options.gravity ? -1 : 0, &m);
}

void cav_inertial_forces(const cav_model *model, const cav_state *state, double *force) {
  for (int i = 1; i < model->nlink; i++) {
    link_force(force + 6 * i, model->link[i].mass, state->inertia + 6 * i, state->com + 3 * i, state->reference + 3 * i,
               state->velocity + 6 * i, state->work->acceleration + 6 * i);
  }
}

void cav_force_project(const cav_model *model, cav_state *state, double *u) {
  project_tree(model, state->axis, state->force, u);
}
