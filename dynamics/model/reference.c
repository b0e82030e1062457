/// Inverse weights at the reference configuration q0: the `reference` diagonal of A (METHOD.md, 4). Per dof the
/// diagonal of M^-1, averaged over a ball's three and over the two threes of a free joint; per body the mean
/// translational and rotational diagonal of J M^-1 J' at its centre of mass; per tendon J M^-1 J'; per pair the sum
/// over its two bodies. Also what equality constraints take from q0, the rest lengths of spatial tendons' springs, and
/// per actuator the acceleration of a unit force. M is the inertia with armature and without implicit damping.
#include <stdlib.h>

#include "compile.h"
#include "math3.h"
#include "step.h"

enum { TOGETHER = 8 };

// rows x that are solved together: M^-1 x at the dofs that any of them moves and those before these towards the root
typedef struct rows {
  double (*x)[TOGETHER], (*solved)[TOGETHER]; // [nv]
  char *reached;                              // [nv]
} rows;

static void clear_rows(const cav_model *model, rows *r) {
  memset(r->x, 0, (size_t)model->nv * sizeof *r->x);
  memset(r->reached, 0, (size_t)model->nv);
}

static void set_entry(const cav_workspace *w, rows *r, int row, int dof, double value) {
  r->x[dof][row] = value;
  for (int i = dof; i >= 0 && !r->reached[i]; i = w->parent[i]) r->reached[i] = 1;
}

// as cav_ldl_solve, term by term: what it adds beside these terms are zeros
static void solve_rows(const cav_model *model, const cav_workspace *w, rows *r) {
  double(*y)[TOGETHER] = r->solved;
  memcpy(y, r->x, (size_t)model->nv * sizeof *y);
  for (int k = model->nv - 1; k >= 0; k--) {
    if (!r->reached[k]) continue;
    const double *L = w->L + w->row[k];
    for (int i = w->parent[k], a = 1; i >= 0; i = w->parent[i], a++) {
      for (int c = 0; c < TOGETHER; c++) y[i][c] -= L[a] * y[k][c];
    }
  }
  for (int k = 0; k < model->nv; k++) {
    if (!r->reached[k]) continue;
    const double *L = w->L + w->row[k];
    double sum[TOGETHER];
    for (int c = 0; c < TOGETHER; c++) sum[c] = y[k][c] / L[0];
    for (int i = w->parent[k], a = 1; i >= 0; i = w->parent[i], a++) {
      for (int c = 0; c < TOGETHER; c++) sum[c] -= L[a] * y[i][c];
    }
    memcpy(y[k], sum, sizeof sum);
  }
}

// x' M^-1 x of each row
static void inverse_norms(const cav_model *model, const cav_workspace *w, rows *r, double norm[TOGETHER]) {
  solve_rows(model, w, r);
  for (int c = 0; c < TOGETHER; c++) norm[c] = 0;
  for (int i = 0; i < model->nv; i++) {
    if (!r->reached[i]) continue;
    for (int c = 0; c < TOGETHER; c++) norm[c] += r->x[i][c] * r->solved[i][c];
  }
}

static int at_most(int n) { return n < TOGETHER ? n : TOGETHER; }

// mean of weight over n dofs
static void average(cav_dof *dof, int n) {
  double sum = 0;
  for (int k = 0; k < n; k++) { sum += dof[k].inverse_weight; }
  for (int k = 0; k < n; k++) { dof[k].inverse_weight = sum / n; }
}

static void weigh_dofs(const cav_model *model, const cav_workspace *w, rows *r) {
  cav_dof *dof = (cav_dof *)model->dof;
  for (int i = 0; i < model->nv; i += TOGETHER) {
    double norm[TOGETHER];
    int n = at_most(model->nv - i);
    clear_rows(model, r);
    for (int c = 0; c < n; c++) set_entry(w, r, c, i + c, 1);
    inverse_norms(model, w, r, norm);
    for (int c = 0; c < n; c++) dof[i + c].inverse_weight = norm[c];
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

// rows of the velocity of a point of a link along the world's axes, and of the link's angular velocity about them
static void body_rows(const cav_model *model, cav_state *state, rows *r, int link, const double point[3]) {
  const cav_workspace *w = state->work;
  clear_rows(model, r);
  const cav_link *l = &model->link[link];
  for (int i = l->dof + l->ndof - 1; i >= 0; i = w->parent[i]) {
    const double *S = state->axis + 6 * i;
    double velocity[3];
    velocity_at(velocity, S, state->reference + 3 * link, point);
    for (int axis = 0; axis < 3; axis++) {
      set_entry(w, r, axis, i, velocity[axis]);
      set_entry(w, r, 3 + axis, i, S[axis]);
    }
  }
}

static void weigh_body(const cav_model *model, cav_state *state, rows *r, cav_body *body) {
  double point[3], R[9], norm[TOGETHER];
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
  body_rows(model, state, r, body->link, point);
  inverse_norms(model, state->work, r, norm);
  for (int c = 0; c < 6; c++) { body->inverse_weight[c / 3] += norm[c] / 3; }
}

static void weigh_tendons(const cav_model *model, const cav_state *state, rows *r) {
  cav_tendon *tendon = (cav_tendon *)model->tendon;
  for (int i = 0; i < model->ntendon; i += TOGETHER) {
    double norm[TOGETHER];
    int n = at_most(model->ntendon - i);
    clear_rows(model, r);
    for (int c = 0; c < n; c++) {
      const cav_tendon *t = tendon + i + c;
      for (int e = t->dof; e < t->dof + t->ndof; e++)
        set_entry(state->work, r, c, model->tendon_dof[e], state->tendon_arm[e]);
    }
    inverse_norms(model, state->work, r, norm);
    for (int c = 0; c < n; c++) tendon[i + c].inverse_weight = norm[c];
  }
}

// |M^-1 moments| of the actuators
static void weigh_actuators(const cav_model *model, cav_state *state, rows *r) {
  cav_actuator *actuator = (cav_actuator *)model->actuator;
  double *moment = state->work->scratch;
  for (int i = 0; i < model->nactuator; i += TOGETHER) {
    int n = at_most(model->nactuator - i);
    clear_rows(model, r);
    // a force on one dof moves all
    memset(r->reached, 1, (size_t)model->nv);
    for (int c = 0; c < n; c++) {
      cav_actuator_length(model, state, i + c, moment);
      for (int k = 0; k < model->nv; k++) { r->x[k][c] = moment[k]; }
    }
    solve_rows(model, state->work, r);
    for (int c = 0; c < n; c++) {
      double sum = 0;
      for (int k = 0; k < model->nv; k++) { sum += r->solved[k][c] * r->solved[k][c]; }
      actuator[i + c].acceleration = sqrt(sum);
    }
  }
}

static void weigh_all(const cav_model *model, cav_state *state, rows *r) {
  weigh_dofs(model, state->work, r);
  for (int i = 0; i < model->nbody; i++) { weigh_body(model, state, r, (cav_body *)&model->body[i]); }
  weigh_tendons(model, state, r);
  weigh_actuators(model, state, r);
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
  size_t n = (size_t)model->nv + 1;
  rows r = {malloc(n * sizeof *r.x), malloc(n * sizeof *r.solved), malloc(n)};
  cav_status status = r.x && r.solved && r.reached ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK && !cav_ldl_factor(model, w, w->M, w->L)) { status = CAV_BAD_INPUT; }
  if (status == CAV_OK) { weigh_all(model, state, &r); }
  free(r.x), free(r.solved), free(r.reached);
  cav_state_free(state);
  return status;
}
