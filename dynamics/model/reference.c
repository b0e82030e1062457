/// Inverse weights at the reference configuration q0: the `reference` diagonal of A (METHOD.md, 4). Per dof the
/// diagonal of M^-1, averaged over a ball's three and over the two threes of a free joint; per body the mean
/// translational and rotational diagonal of J M^-1 J' at its centre of mass; per tendon J M^-1 J'; per pair the sum
/// over its two bodies. Also what equality constraints take from q0, the rest lengths of spatial tendons' springs, and
/// per actuator the acceleration of a unit force. M is the inertia with armature and without implicit damping.
#include <stdlib.h>

#include "compile.h"
#include "math3.h"
#include "step.h"

// x' M^-1 x for a row x given in w->scratch[0..nv)
static double inverse_norm(const cav_model *model, const cav_workspace *w) {
  double *x = w->scratch, *y = w->scratch + model->nv, sum = 0;
  memcpy(y, x, (size_t)model->nv * sizeof *y);
  cav_ldl_solve(model, w, w->L, y);
  for (int i = 0; i < model->nv; i++) { sum += x[i] * y[i]; }
  return sum;
}

static void clear_row(const cav_model *model, const cav_workspace *w) {
  memset(w->scratch, 0, (size_t)model->nv * sizeof *w->scratch);
}

// mean of weight over n dofs
static void average(cav_dof *dof, int n) {
  double sum = 0;
  for (int k = 0; k < n; k++) { sum += dof[k].inverse_weight; }
  for (int k = 0; k < n; k++) { dof[k].inverse_weight = sum / n; }
}

static void weigh_dofs(const cav_model *model, const cav_workspace *w) {
  cav_dof *dof = (cav_dof *)model->dof;
  for (int i = 0; i < model->nv; i++) {
    clear_row(model, w);
    w->scratch[i] = 1;
    dof[i].inverse_weight = inverse_norm(model, w);
  }
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    if (joint->type == CAV_JOINT_FREE) {
      average(dof + joint->dof, 3);
      average(dof + joint->dof + 3, 3);
    } else if (joint->type == CAV_JOINT_BALL) {
      average(dof + joint->dof, 3);
    }
  }
}

// row of the velocity of point (kind 0) or of the angular velocity (kind 1) of a link along a world axis
static void body_row(const cav_model *model, cav_state *state, int link, const double point[3], int kind, int axis) {
  const cav_workspace *w = state->work;
  clear_row(model, w);
  const cav_link *l = &model->link[link];
  int last = l->dof + l->ndof - 1;
  for (int i = last; i >= 0; i = w->parent[i]) {
    const double *S = state->axis + 6 * i;
    double velocity[3];
    velocity_at(velocity, S, state->reference + 3 * link, point);
    w->scratch[i] = kind ? S[axis] : velocity[axis];
  }
}

static void weigh_body(const cav_model *model, cav_state *state, cav_body *body) {
  double point[3], R[9];
  body->inverse_weight[0] = body->inverse_weight[1] = 0;
  if (body->link == 0) { return; }
  const cav_pose *link = &state->link[body->link];
  if (model->fused) {
    copy3(point, model->link[body->link].com);
  } else {
    quat_rotate(point, body->quat, body->com);
    add3(point, point, body->pos);
  }
  quat_matrix(R, link->quat);
  transform(point, link->pos, R, point);
  for (int kind = 0; kind < 2; kind++) {
    for (int axis = 0; axis < 3; axis++) {
      body_row(model, state, body->link, point, kind, axis);
      body->inverse_weight[kind] += inverse_norm(model, state->work) / 3;
    }
  }
}

static void weigh_tendon(const cav_model *model, cav_state *state, cav_tendon *tendon) {
  const cav_workspace *w = state->work;
  clear_row(model, w);
  for (int e = tendon->dof; e < tendon->dof + tendon->ndof; e++)
    w->scratch[model->tendon_dof[e]] = state->tendon_arm[e];
  tendon->inverse_weight = inverse_norm(model, w);
}

// |M^-1 moments| of an actuator
static void weigh_actuator(const cav_model *model, cav_state *state, int i) {
  const cav_workspace *w = state->work;
  double *x = w->scratch, sum = 0;
  cav_actuator_length(model, state, i, x);
  cav_ldl_solve(model, w, w->L, x);
  for (int k = 0; k < model->nv; k++) { sum += x[k] * x[k]; }
  ((cav_actuator *)&model->actuator[i])->acceleration = sqrt(sum);
}

static void weigh_all(const cav_model *model, cav_state *state) {
  weigh_dofs(model, state->work);
  for (int i = 0; i < model->nbody; i++) { weigh_body(model, state, (cav_body *)&model->body[i]); }
  for (int i = 0; i < model->ntendon; i++) { weigh_tendon(model, state, (cav_tendon *)&model->tendon[i]); }
  for (int i = 0; i < model->nactuator; i++) { weigh_actuator(model, state, i); }
  for (int i = 0; i < model->npair; i++) {
    cav_pair *pair = (cav_pair *)&model->pair[i];
    const cav_body *a = &model->body[model->geom[pair->geom1].body], *b = &model->body[model->geom[pair->geom2].body];
    pair->weight[0] = a->inverse_weight[0] + b->inverse_weight[0];
    pair->weight[1] = a->inverse_weight[1] + b->inverse_weight[1];
  }
  for (int i = 0; i < model->nequality; i++) cav_equality_settle(model, state, (cav_equality *)&model->equality[i]);
}

// springs of spatial tendons rest at the length they have where the springs of the joints rest, unless the file says
static void measure_springs(const cav_model *model, cav_state *state) {
  double *q = state->work->q;
  memcpy(q, model->q0, (size_t)model->nq * sizeof *q);
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    if (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE) { q[joint->q] = joint->springref; }
  }
  cav_kinematics(model, state, q);
  for (int i = 0; i < model->ntendon; i++) {
    cav_tendon *tendon = (cav_tendon *)&model->tendon[i];
    if (isnan(tendon->springlength[0])) tendon->springlength[0] = tendon->springlength[1] = state->tendon_length[i];
  }
}

cav_status cav_reference_weights(cav_model *model) {
  cav_state *state = cav_state_new(model);
  if (!state) { return CAV_NO_MEMORY; }
  cav_workspace *w = state->work;
  if (w->nstring > 0) { measure_springs(model, state); }
  cav_kinematics(model, state, model->q0);
  cav_composite_inertia(model, state, w->M);
  for (int i = 0; i < model->nv; i++) { w->M[w->row[i]] += w->armature[i]; }
  cav_status status = CAV_OK;
  if (cav_ldl_factor(model, w, w->M, w->L)) {
    weigh_all(model, state);
  } else {
    status = CAV_BAD_INPUT;
  }
  cav_state_free(state);
  return status;
}
