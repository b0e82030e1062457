/// Derivatives of the forces of equality constraints, in closed form. The law is linear, f = R^-1 (v* - J v_next), with
/// R and K by the length of the error x: df = (dz - z dR/R)/R, z = v* - J v_next.
///
/// Between joints or tendons of constant arms a row sees two scalars; its gradient changes with the derivative of the
/// polynomial. Between links a row sees one point and one frame on each. When a dof moves one of the links, the point
/// moves along and the link keeps the velocity it had before the joint; the rotation rows change with the frames. With
/// D, E of analytic.c for accelerations that v alone makes and W = V + v S behind the joint, about a point of the link
/// that has velocity u, acceleration a, angular ones w, b, all at v (m is the moment part of a twist, f its linear one)
///
///   da/dq_j = S_m x a + E_f + 2 D_m x u        db/dq_j = S_m x b + E_m + D_m x w
///   da/dv_j = (D + W x S)_f + 2 S_m x u        db/dv_j = (D + W x S)_m + S_m x w
///
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

// df by the changes of error, velocity, J'v (NULL: none) and velocity_next
static void impulse_rate(const task *t, const cav_equality_rows *eq, const double *error, const double *now,
                         const double *bias, const double *next, double *out) {
  double square = 0, along = 0, regulariser, stiffness;
  for (int i = 0; i < eq->dim; i++) {
    square += eq->error[i] * eq->error[i];
    along += eq->error[i] * error[i];
  }
  double length = sqrt(square), stretch = length > 0 ? along / length : 0;
  law_rates(t, eq, length, &regulariser, &stiffness);
  for (int i = 0; i < eq->dim; i++) {
    double target = (1 - eq->damping) * now[i] - eq->stiffness * (error[i] + stiffness * stretch * eq->error[i]);
    if (bias) target -= t->state->options.timestep * bias[i];
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
      impulse_rate(t, eq, &error, &now, NULL, &next, &by_q);
      impulse_rate(t, eq, &none, &error, NULL, &none, &by_v);
      impulse_rate(t, eq, &none, &none, NULL, &error, &by_n);
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
  double now[2][6], next[2][6];   ///< velocities of the links about their points
  double point[2][6], bias[2][6]; ///< motion of the points at v: angular and own velocities, accelerations
  double quat[2][4];              ///< frames of a weld, the second conjugated
  double force[3], moment[3];     ///< on the first link
} link_equality;

// world force and moment of an impulse under a matrix of the rotation rows
static void add_push(const link_equality *l, const double *turn, const double *impulse, double moment[3]) {
  double part[3];
  if (l->equality->dim < 6) return;
  rotate_back(part, turn, impulse + 3);
  add3(moment, moment, part);
}

// velocity of a link at v
static void velocity_now(const cav_state *state, int link, double V[6]) {
  copy6(V, state->velocity + 6 * link);
  if (!cav_takes_mean(state)) return;
  scale6(V, 2, V);
  axpy6(V, V, -1, state->velocity_next + 6 * link);
}

static void open_equality(const task *t, const cav_equality_rows *eq, link_equality *l) {
  l->equality = eq;
  l->e = &t->model->equality[eq->equality];
  for (int k = 0; k < 2; k++) {
    int link = l->e->link[k];
    const double *W = t->state->velocity_next + 6 * link, *reference = t->state->reference + 3 * link;
    double V[6];
    velocity_now(t->state, link, V);
    motion_at(l->now[k], V, reference, eq->point[k]);
    cav_point_motion(V, t->state->work->bias + 6 * link, reference, eq->point[k], l->point[k], l->bias[k]);
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
    for (int k = cav_last_dof(t->model, l->e->link[a]); k >= 0; k = t->model->dof[k].parent) {
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

// what the rotation rows make of relative accelerations b and velocities w of the frames: b + (w w1 - w2 w)/2
static void weld_sum(const double b[3], const double w[3], const double sum[3], double y[4]) {
  y[0] = -0.5 * dot3(w, w);
  cross3(y + 1, w, sum);
  scale3(y + 1, 0.5, y + 1);
  add3(y + 1, y + 1, b);
}

// rate of the rotation part of J'v by changes of one link's angular velocity and acceleration, and of its frame by a
// turn (NULL: none)
static void weld_bias_rate(const link_equality *l, int side, const double spin[3], const double twist[3],
                           const double *turn, double out[3]) {
  double sign = side ? -1 : 1, w[3], sum[3], b[3], part[3], y[4], scale = l->e->torquescale;
  sub3(w, l->point[0], l->point[1]);
  add3(sum, l->point[0], l->point[1]);
  // by the motion: (dw x sum + w x dspin)/2 and -w . dw
  y[0] = -sign * dot3(w, spin);
  cross3(y + 1, spin, sum);
  scale3(y + 1, 0.5 * sign, y + 1);
  cross3(part, w, spin);
  axpy3(y + 1, y + 1, 0.5, part);
  axpy3(y + 1, y + 1, sign, twist);
  cav_weld_turn(scale, l->quat[1], y, l->quat[0], out);
  if (!turn) return;
  double half[4] = {0, 0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]};
  sub3(b, l->bias[0], l->bias[1]);
  weld_sum(b, w, sum, y);
  if (side == 0) {
    quat_mul(y, y, half);
  } else {
    quat_mul(y, half, y);
    for (int i = 0; i < 4; i++) y[i] = -y[i];
  }
  cav_weld_turn(scale, l->quat[1], y, l->quat[0], part);
  add3(out, out, part);
}

// rates of J'v by q and by v of a dof that moves link side; S and D (at v) about its point
static void bias_rates(const task *t, const link_equality *l, int side, int j, const double S[6], const double D[6],
                       double by_q[6], double by_v[6]) {
  const double *reference = t->state->reference + 3 * t->model->dof[j].link, *u = l->point[side] + 3;
  const double *w = l->point[side], *a = l->bias[side] + 3, *b = l->bias[side];
  const cav_derivative_store *s = t->state->work->derivatives;
  double E[6], rate[6], part[3], twist[2][3], sign = side ? -1 : 1;
  motion_at(E, s->bias_second + 6 * j, reference, l->equality->point[side]);
  motion_at(rate, s->bias_rate + 6 * j, reference, l->equality->point[side]);
  cross3(part, D, u);
  axpy3(by_q, E + 3, 2, part);
  cross_add3(by_q, S, a);
  scale3(by_q, sign, by_q);
  cross3(part, S, u);
  axpy3(by_v, rate + 3, 2, part);
  scale3(by_v, sign, by_v);
  if (l->equality->dim < 6) return;
  double spin[3];
  copy3(twist[0], E);
  cross_add3(twist[0], S, b);
  cross_add3(twist[0], D, w);
  cross3(spin, S, w);
  add3(spin, spin, D);
  weld_bias_rate(l, side, spin, twist[0], S, by_q + 3);
  copy3(twist[1], rate);
  cross_add3(twist[1], S, w);
  weld_bias_rate(l, side, S, twist[1], NULL, by_v + 3);
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

  // error, velocities and J'v of the rows, then impulses
  double error[6] = {0}, now[6] = {0}, next[6] = {0}, none[6] = {0}, bias[2][6], f[3][6];
  scale3(error, sign, S + 3);
  if (eq->dim == 6) {
    rotate(error + 3, eq->rotation, S);
    scale3(error + 3, sign, error + 3);
  }
  velocity_rate(l, side, S, now_drift, l->now, turned, now);
  velocity_rate(l, side, S, next_drift, l->next, turned, next);
  bias_rates(t, l, side, j, S, now_drift, bias[0], bias[1]);
  impulse_rate(t, eq, error, now, bias[0], next, f[0]);
  impulse_rate(t, eq, none, error, bias[1], none, f[1]);
  impulse_rate(t, eq, none, none, NULL, error, f[2]);

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

// axes of all dofs where v alone accelerates
static void bias_drifts(const task *t) {
  const cav_workspace *w = t->state->work;
  cav_derivative_store *s = w->derivatives;
  for (int i = 1; i < t->model->nlink; i++) {
    const cav_link *link = &t->model->link[i];
    double V[6], A[6];
    velocity_now(t->state, link->parent, V);
    copy6(A, w->bias + 6 * link->parent);
    for (int first = link->dof, end = first + link->ndof, last; first < end; first = last) {
      double before[6];
      copy6(before, V);
      for (last = first; last < end && (last == first || !w->group[last]); last++) {
        double *E = s->bias_second + 6 * last;
        memset(E, 0, 6 * sizeof *E);
        motion_cross_add(E, A, t->state->axis + 6 * last);
        motion_cross_add(E, before, s->drift_now + 6 * last);
      }
      for (int k = first; k < last; k++) {
        double motion[6];
        scale6(motion, w->v[k], t->state->axis + 6 * k);
        accumulate6(V, motion);
        motion_cross_add(A, before, motion);
      }
      for (int k = first; k < last; k++) {
        copy6(s->bias_rate + 6 * k, s->drift_now + 6 * k);
        motion_cross_add(s->bias_rate + 6 * k, V, t->state->axis + 6 * k);
      }
    }
  }
}

void cav_equality_derivatives(const cav_model *model, const cav_state *state, double *dq, double *dv, double *dn) {
  task t = {model, state, model->nv, dq, dv, dn};
  if (state->work->bias) bias_drifts(&t);
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
      for (int j = cav_last_dof(model, e->link[side]); j >= 0; j = model->dof[j].parent) link_column(&t, &l, side, j);
    }
  }
}
