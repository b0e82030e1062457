/// Derivatives of the forces of equality constraints, in closed form. The law is linear, f = R^-1 (v* - J v_next), with
/// R and K by the length of the error x: df = (dz - z dR/R)/R, z = v* - J v_next.
///
/// Between joints or tendons of constant arms a row sees two scalars; its gradient changes with the derivative of the
/// polynomial. Between links a row sees one point and one frame on each. When a dof moves one of the links, the point
/// moves along and the link keeps the velocity it had before the joint; the rotation rows change with the frames.
/// Wrenches that turn with their link are in the sums over subtrees already (smooth.c) and are taken off here.
#include "derivative.h"
#include "math3.h"

/// One call.
typedef struct task {
  const cav_model *model;
  const cav_state *state;
  int nv;
  double *dq, *dv, *dn;
} task;

// rates of ln R and ln hK by the length of the error
static void law_rates(const task *t, const cav_equality_rows *eq, double length, double *regulariser,
                      double *stiffness) {
  cav_law_rates(t->state, &t->model->equality[eq->equality].softness, -length, eq->regulariser[0], regulariser,
                stiffness);
  *regulariser = -*regulariser;
  *stiffness = -*stiffness;
}

// df by the changes of error, velocity and velocity_next
static void impulse_rate(const task *t, const cav_equality_rows *eq, const double *error, const double *now,
                         const double *next, double *out) {
  double square = 0, along = 0, regulariser, stiffness;
  for (int i = 0; i < eq->dim; i++) {
    square += eq->error[i] * eq->error[i];
    along += eq->error[i] * error[i];
  }
  double length = sqrt(square), stretch = length > 0 ? along / length : 0;
  law_rates(t, eq, length, &regulariser, &stiffness);
  for (int i = 0; i < eq->dim; i++) {
    double target = (1 - eq->damping) * now[i] - eq->stiffness * (error[i] + stiffness * stretch * eq->error[i]);
    out[i] = (target - next[i]) / eq->regulariser[i] - regulariser * stretch * eq->impulse[i];
  }
}

// ---------------------------------------------------------------- between joints or tendons

// dofs of one side and what they do to its value; returns their number
static int side_dofs(const task *t, const cav_equality *e, int side, const int **dof, const double **arm) {
  static const double one = 1;
  int object = e->object[side];
  if (object < 0) return 0;
  if (e->type == CAV_EQUALITY_JOINT) {
    *dof = &t->model->joint[object].dof;
    *arm = &one;
    return 1;
  }
  const cav_tendon *tendon = &t->model->tendon[object];
  *dof = t->model->tendon_dof + tendon->dof;
  *arm = t->state->tendon_arm + tendon->dof;
  return tendon->ndof;
}

// second derivative of the polynomial
static double curvature(const task *t, const cav_equality *e) {
  int object = e->object[1];
  if (object < 0) return 0;
  double x =
      e->type == CAV_EQUALITY_JOINT ? t->state->work->q[t->model->joint[object].q] : t->state->tendon_length[object];
  double s = x - e->reference[1], sum = 0, power = 1;
  for (int k = 2; k < 5; k++, power *= s) sum += k * (k - 1) * e->coef[k] * power;
  return sum;
}

static void couple(const task *t, const cav_equality_rows *eq) {
  const cav_equality *e = &t->model->equality[eq->equality];
  const cav_workspace *w = t->state->work;
  double inverse_h = 1 / t->state->options.timestep, bend = curvature(t, e), speed[2] = {0, 0};
  const int *dof[2];
  const double *arm[2];
  int n[2];
  for (int side = 0; side < 2; side++) n[side] = side_dofs(t, e, side, &dof[side], &arm[side]);
  for (int k = 0; k < n[1]; k++) {
    speed[0] += arm[1][k] * w->v[dof[1][k]];
    speed[1] += arm[1][k] * w->v_next[dof[1][k]];
  }
  for (int b = 0; b < 2; b++) {
    double gradient = b ? -eq->derivative : 1, none = 0;
    for (int j = 0; j < n[b]; j++) {
      // a tendon's value moves by its arm
      double error = gradient * arm[b][j], now = b ? -bend * arm[b][j] * speed[0] : 0;
      double next = b ? -bend * arm[b][j] * speed[1] : 0, by_q, by_v, by_n;
      impulse_rate(t, eq, &error, &now, &next, &by_q);
      impulse_rate(t, eq, &none, &error, &none, &by_v);
      impulse_rate(t, eq, &none, &none, &error, &by_n);
      for (int a = 0; a < 2; a++) {
        double derivative = a ? -eq->derivative : 1, turned = a && b ? -bend * arm[b][j] * eq->impulse[0] : 0;
        for (int k = 0; k < n[a]; k++) {
          int at = dof[a][k] * t->nv + dof[b][j];
          t->dq[at] -= inverse_h * arm[a][k] * (derivative * by_q + turned);
          t->dv[at] -= inverse_h * arm[a][k] * derivative * by_v;
          t->dn[at] -= inverse_h * arm[a][k] * derivative * by_n;
        }
      }
    }
  }
}

// ---------------------------------------------------------------- between links

/// One equality constraint between links at the state's evaluation.
typedef struct link_equality {
  const cav_equality_rows *equality;
  const cav_equality *e;
  double now[2][6], next[2][6]; ///< velocities of the links about their points
  double quat[2][4];            ///< frames of a weld, the second conjugated
  double force[3], moment[3];   ///< on the first link
} link_equality;

static int last_dof(const cav_model *model, int link) {
  while (link > 0 && model->link[link].ndof == 0) link = model->link[link].parent;
  return link > 0 ? model->link[link].dof + model->link[link].ndof - 1 : -1;
}

// world force and moment of an impulse under a matrix of the rotation rows
static void add_push(const link_equality *l, const double *turn, const double *impulse, double moment[3]) {
  double part[3];
  if (l->equality->dim < 6) return;
  rotate_back(part, turn, impulse + 3);
  add3(moment, moment, part);
}

static void open_equality(const task *t, const cav_equality_rows *eq, link_equality *l) {
  l->equality = eq;
  l->e = &t->model->equality[eq->equality];
  for (int k = 0; k < 2; k++) {
    int link = l->e->link[k];
    const double *W = t->state->velocity_next + 6 * link, *reference = t->state->reference + 3 * link;
    double V[6];
    copy6(V, t->state->velocity + 6 * link);
    if (cav_takes_mean(t->state)) {
      scale6(V, 2, V);
      axpy6(V, V, -1, W);
    }
    motion_at(l->now[k], V, reference, eq->point[k]);
    motion_at(l->next[k], W, reference, eq->point[k]);
    quat_mul(l->quat[k], t->state->link[link].quat, l->e->quat[k]);
  }
  quat_conjugate(l->quat[1], l->quat[1]);
  copy3(l->force, eq->impulse);
  zero3(l->moment);
  add_push(l, eq->rotation, eq->impulse, l->moment);
}

// change of the matrix of the rotation rows when one frame turns: s/2 Im(conj(q2) w q1) with w or conj(q2) turned
static void turn_rate(const link_equality *l, int side, const double axis[3], double out[9]) {
  double half[4] = {0, 0.5 * axis[0], 0.5 * axis[1], 0.5 * axis[2]};
  for (int k = 0; k < 3; k++) {
    double spin[4] = {0, k == 0, k == 1, k == 2}, product[4];
    if (side == 0) {
      quat_mul(product, spin, half);
    } else {
      for (int i = 0; i < 4; i++) product[i] = -half[i];
      quat_mul(product, product, spin);
    }
    quat_mul(product, product, l->quat[0]);
    quat_mul(product, l->quat[1], product);
    for (int i = 0; i < 3; i++) out[3 * i + k] = 0.5 * l->e->torquescale * product[1 + i];
  }
}

// adds -sign/h S_k . (moment, force) to one column of a derivative, for the dofs of both links
static void push_rows(const task *t, const link_equality *l, int j, const double wrench[2][6], double *out) {
  double inverse_h = 1 / t->state->options.timestep;
  for (int a = 0; a < 2; a++) {
    double scale = a ? inverse_h : -inverse_h;
    for (int k = last_dof(t->model, l->e->link[a]); k >= 0; k = t->model->dof[k].parent) {
      double S[6];
      motion_at(S, t->state->axis + 6 * k, t->state->reference + 3 * t->model->dof[k].link, l->equality->point[a]);
      out[k * t->nv + j] += scale * dot6(S, wrench[a]);
    }
  }
}

// rate of the rows' velocity as a dof moves link side: the point moves along, the velocity before the joint stays
static void velocity_rate(const link_equality *l, int side, const double S[6], const double drift[6],
                          const double own[2][6], const double turned[9], double *out) {
  double sign = side ? -1 : 1, angular[3], spin[3], part[3];
  cross3(out, S, own[side] + 3);
  add3(out, out, drift + 3);
  scale3(out, sign, out);
  if (l->equality->dim < 6) return;
  cross3(angular, S, own[side]);
  add3(angular, angular, drift);
  scale3(angular, sign, angular);
  rotate(out + 3, l->equality->rotation, angular);
  sub3(spin, own[0], own[1]);
  rotate(part, turned, spin);
  add3(out + 3, out + 3, part);
}

static void link_column(const task *t, const link_equality *l, int side, int j) {
  const cav_equality_rows *eq = l->equality;
  const double *reference = t->state->reference + 3 * t->model->dof[j].link;
  const cav_derivative_store *s = t->state->work->derivatives;
  double S[6], now_drift[6], next_drift[6], turned[9] = {0}, sign = side ? -1 : 1;
  motion_at(S, t->state->axis + 6 * j, reference, eq->point[side]);
  motion_at(now_drift, s->drift_now + 6 * j, reference, eq->point[side]);
  motion_at(next_drift, s->drift_next + 6 * j, reference, eq->point[side]);
  if (eq->dim == 6) turn_rate(l, side, S, turned);

  // error and velocities of the rows, then impulses
  double error[6] = {0}, now[6] = {0}, next[6] = {0}, none[6] = {0}, f[3][6];
  scale3(error, sign, S + 3);
  if (eq->dim == 6) {
    rotate(error + 3, eq->rotation, S);
    scale3(error + 3, sign, error + 3);
  }
  velocity_rate(l, side, S, now_drift, l->now, turned, now);
  velocity_rate(l, side, S, next_drift, l->next, turned, next);
  impulse_rate(t, eq, error, now, next, f[0]);
  impulse_rate(t, eq, none, error, none, f[1]);
  impulse_rate(t, eq, none, none, error, f[2]);

  // wrenches about the points; what turns with the moved link is in the subtrees' sums
  double *out[3] = {t->dq, t->dv, t->dn};
  for (int which = 0; which < 3; which++) {
    double wrench[2][6] = {{0}};
    add_push(l, eq->rotation, f[which], wrench[0]);
    if (which == 0) add_push(l, turned, eq->impulse, wrench[0]);
    copy3(wrench[0] + 3, f[which]);
    copy6(wrench[1], wrench[0]);
    if (which == 0) {
      cross_add3(wrench[side], l->moment, S);
      cross_add3(wrench[side] + 3, l->force, S);
    }
    push_rows(t, l, j, (const double(*)[6])wrench, out[which]);
  }
}

void cav_equality_derivatives(const cav_model *model, const cav_state *state, double *dq, double *dv, double *dn) {
  task t = {model, state, model->nv, dq, dv, dn};
  for (int i = 0; i < state->nequality; i++) {
    const cav_equality_rows *eq = &state->equality[i];
    const cav_equality *e = &model->equality[eq->equality];
    if (e->type == CAV_EQUALITY_JOINT || e->type == CAV_EQUALITY_TENDON) {
      couple(&t, eq);
      continue;
    }
    link_equality l;
    open_equality(&t, eq, &l);
    for (int side = 0; side < 2; side++) {
      for (int j = last_dof(model, e->link[side]); j >= 0; j = model->dof[j].parent) link_column(&t, &l, side, j);
    }
  }
}
