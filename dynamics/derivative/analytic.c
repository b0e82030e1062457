/// Derivatives of the inverse in closed form: du/dq, du/dv, du/dv_next at the state's last evaluation (METHOD.md, 7).
/// With the pair of dofs (k, j) of which m is the deeper one, every term of the smooth part is S_k . (sum over the
/// subtree of m) of something linear in dof j: as in Carpentier and Mansard (RSS 2018) and Singh, Russell and Wensing
/// (2022), but derived and written for spatial vectors at one point of the tree:
///
///   du_k/da_j = S_k . I S_j                          I  composite inertia
///   du_k/dv_j = S_k . (I (D + D*) + B S_j)           D  = V_before x S_j,  D* = V_after x S_j
///   du_k/dq_j = S_k . (I E + B D [+ S_j x F])        E  = A_before x S_j + V_before x D,  F wrench of the subtree
///
/// [..] only where j does not move k. B is the change of a body's wrench by a twist of its motion, (V x I V with one V
/// replaced, both ways) - I (V x .): about the centre of mass it depends on the angular part alone, the moment by
/// -2 [w](tr(J)/2 - J), the force by -2 m [v]; so twelve numbers a subtree do.
///
/// Contacts with the world are three more matrices of 6 x 6 at their link, summed over subtrees like inertia: the cost
/// of a contact does not depend on the depth of the tree. Contacts between two moving links add the two blocks across.
/// Limits, friction losses, springs and dampers act on few dofs and are added entry by entry.
///
/// For the order momentum the rows of root links are those of half_step.c instead.
///
/// Not offered: models with parts listed by cav_derivatives_missing; nothing is approximated in their place.
#include <assert.h>
#include <stdlib.h>

#include "derivative.h"
#include "half_step.h"
#include "math3.h"
#include "rotation.h"

enum { BLOCK = 36, ALIGN = 8 };

/// One call: the state and where its results go.
typedef struct task {
  const cav_model *model;
  cav_state *state;
  cav_derivative_store *s;
  int nv, mean, momentum; ///< bias and passive forces at the mean velocity; rows of roots from momenta
  double inverse_h;
  double *dq, *dv, *dn; ///< [nv*nv]
} task;

// ---------------------------------------------------------------- memory

static cav_derivative_store *derivatives_new(const cav_model *model) {
  cav_derivative_store *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  size_t nv = (size_t)model->nv, n = (size_t)model->nlink;
  size_t doubles = 5 * 6 * nv + (12 + 3 * BLOCK) * n + 12 * nv + nv * nv;
  s->drift = calloc(doubles + ALIGN, sizeof(double));
  s->touched = calloc(n + 1, sizeof(int));
  if (!s->drift || !s->touched) {
    cav_derivative_store_free(s);
    return NULL;
  }
  s->drift_now = s->drift + 6 * nv;
  s->drift_next = s->drift_now + 6 * nv;
  s->second = s->drift_next + 6 * nv;
  s->rate = s->second + 6 * nv;
  s->gyration = s->rate + 6 * nv;
  s->by_motion = s->gyration + 12 * n;
  s->by_now = s->by_motion + BLOCK * n;
  s->by_next = s->by_now + BLOCK * n;
  s->across = s->by_next + BLOCK * n;
  s->spare = s->across + 12 * nv;
  assert(s->spare + nv * nv == s->drift + doubles);
  s->bytes = sizeof *s + (doubles + ALIGN) * sizeof(double) + (n + 1) * sizeof(int);
  return s;
}

static cav_derivative_store *store_ready(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  if (!w->derivatives) w->derivatives = derivatives_new(model);
  cav_derivative_store *s = w->derivatives;
  if (s && state->ncontact > s->room) {
    cav_contact_jacobian *larger = realloc(s->contact, (size_t)w->contact_room * sizeof *larger);
    if (!larger) return NULL;
    s->contact = larger;
    s->room = w->contact_room;
  }
  return s;
}

// ---------------------------------------------------------------- down the tree

// r = V x S
static void motion_cross(double r[6], const double V[6], const double S[6]) {
  double out[6] = {0};
  motion_cross_add(out, V, S);
  copy6(r, out);
}

// rates of the axes of one group of dofs, which share the motion before them
static void group_drifts(const task *t, int first, int end, const double V[6], const double W[6], const double A[6]) {
  cav_derivative_store *s = t->s;
  for (int k = first; k < end; k++) {
    const double *S = t->state->axis + 6 * k;
    double *D = s->drift + 6 * k, *now = s->drift_now + 6 * k, *next = s->drift_next + 6 * k;
    motion_cross(D, V, S);
    motion_cross(next, W, S);
    // the bias is taken at v, or at the mean of v and v_next
    if (t->mean) {
      scale6(now, 2, D);
      axpy6(now, now, -1, next);
    } else {
      copy6(now, D);
    }
    motion_cross(s->second + 6 * k, A, S);
    motion_cross_add(s->second + 6 * k, V, D);
  }
}

static void drifts(const task *t) {
  const cav_workspace *w = t->state->work;
  const double *axis = t->state->axis;
  for (int i = 1; i < t->model->nlink; i++) {
    const cav_link *link = &t->model->link[i];
    double V[6], W[6], A[6];
    copy6(V, t->state->velocity + 6 * link->parent);
    copy6(W, t->state->velocity_next + 6 * link->parent);
    copy6(A, w->acceleration + 6 * link->parent);
    int end = link->dof + link->ndof;
    for (int first = link->dof, last; first < end; first = last) {
      for (last = first + 1; last < end && !w->group[last]; last++) continue;
      group_drifts(t, first, last, V, W, A);
      double before[6];
      copy6(before, V);
      for (int k = first; k < last; k++) {
        double v = t->mean ? 0.5 * (w->v[k] + w->v_next[k]) : w->v[k], motion[6];
        scale6(motion, v, axis + 6 * k);
        accumulate6(V, motion);
        axpy6(W, W, w->v_next[k], axis + 6 * k);
        axpy6(A, A, (w->v_next[k] - w->v[k]) * t->inverse_h, axis + 6 * k);
        motion_cross_add(A, before, motion);
      }
      for (int k = first; k < last; k++) {
        double *rate = t->s->rate + 6 * k;
        motion_cross(rate, V, axis + 6 * k);
        accumulate6(rate, t->s->drift + 6 * k);
      }
    }
  }
}

// ---------------------------------------------------------------- up the tree

// moment of a link about its reference by its angular velocity, B's angular block, and its momentum
static void gyration(const task *t, int i, double *out) {
  const double *V = t->state->velocity + 6 * i, *J = t->state->inertia + 6 * i;
  double d[3], *momentum = out + 9, trace = J[0] + J[1] + J[2];
  sub3(d, t->state->com + 3 * i, t->state->reference + 3 * i);
  velocity_at(momentum, V, t->state->reference + 3 * i, t->state->com + 3 * i);
  scale3(momentum, t->model->link[i].mass, momentum);
  double E[9] = {0.5 * trace - J[0], -J[3], -J[4], -J[3], 0.5 * trace - J[1], -J[5], -J[4], -J[5], 0.5 * trace - J[2]};
  for (int k = 0; k < 3; k++) {
    // column k: -2 (w x E_k + d x (p x e_k))
    double column[3], e[3] = {k == 0, k == 1, k == 2}, turned[3], N[3];
    column3(column, E, k);
    cross3(N, V, column);
    cross3(turned, momentum, e);
    cross_add3(N, d, turned);
    for (int r = 0; r < 3; r++) out[3 * r + k] = -2 * N[r];
  }
}

static void gyrations(const task *t) {
  double *all = t->s->gyration;
  for (int i = 1; i < t->model->nlink; i++) gyration(t, i, all + 12 * i);
  for (int i = t->model->nlink - 1; i > 0; i--) {
    int parent = t->model->link[i].parent;
    for (int k = 0; parent > 0 && k < 12; k++) all[12 * parent + k] += all[12 * i + k];
  }
}

// F += B S
static void gyration_mul_add(double F[6], const double *gyration, const double S[6]) {
  double moment[3], force[3];
  rotate(moment, gyration, S);
  cross3(force, gyration + 9, S);
  add3(F, F, moment);
  axpy3(F + 3, F + 3, -2, force);
}

// angular part of B' S; the linear one is zero
static void gyration_transposed(double r[3], const double *gyration, const double S[6]) {
  double linear[3];
  cross3(linear, S + 3, gyration + 9);
  rotate_back(r, gyration, S);
  axpy3(r, r, -2, linear);
}

// ---------------------------------------------------------------- contacts

// X with X b = b about the reference carried to a point d away: adds scale X' M X, M about the point
static void shift_add(double *sum, const double *M, const double d[3], double scale) {
  double right[6][6], skew[3][3] = {{0, d[2], -d[1]}, {-d[2], 0, d[0]}, {d[1], -d[0], 0}};
  // linear at the point = linear + angular x d
  for (int r = 0; r < 6; r++) {
    for (int c = 0; c < 6; c++) {
      right[r][c] = M[6 * r + c];
      for (int k = 0; c < 3 && k < 3; k++) right[r][c] += M[6 * r + 3 + k] * skew[k][c];
    }
  }
  for (int c = 0; c < 6; c++) {
    for (int r = 0; r < 6; r++) {
      double x = right[r][c];
      for (int k = 0; r < 3 && k < 3; k++) x += right[3 + k][c] * skew[k][r];
      sum[6 * r + c] += scale * x;
    }
  }
}

// matrices of one contact at one of its links: own wrench by own motion, less what is carried along with the link
static void contact_at_link(const task *t, const cav_contact *c, const cav_contact_jacobian *derivative, int side) {
  int link = side ? c->link2 : c->link1;
  double d[3], whole[6] = {0}, own[36], sign = side ? 1 : -1;
  sub3(d, c->pos, t->state->reference + 3 * link);
  for (int i = 0; i < c->dim; i++) {
    double *part = i < 3 ? whole + 3 : whole;
    axpy3(part, part, c->impulse[i], c->frame + 3 * (i % 3));
  }
  for (int k = 0; k < 6; k++) {
    double twist[6] = {0}, carried[6];
    twist[k] = 1;
    cross3(carried, twist, whole);
    cross_add3(carried, twist + 3, whole + 3);
    cross3(carried + 3, twist, whole + 3);
    for (int r = 0; r < 6; r++) own[6 * r + k] = sign * (derivative->wrench[side][k][r] - carried[r]);
  }
  t->s->touched[link] = 1;
  shift_add(t->s->by_motion + BLOCK * link, own, d, 1);
  shift_add(t->s->by_now + BLOCK * link, &derivative->by_velocity[0][0], d, 1 - c->damping[0]);
  shift_add(t->s->by_next + BLOCK * link, &derivative->by_velocity[0][0], d, 1);
}

static cav_status contacts(const task *t) {
  cav_derivative_store *s = t->s;
  size_t n = (size_t)t->model->nlink;
  memset(s->touched, 0, n * sizeof *s->touched);
  if (t->state->ncontact == 0) return CAV_OK;
  memset(s->by_motion, 0, 3 * BLOCK * n * sizeof *s->by_motion);
  for (int i = 0; i < t->state->ncontact; i++) {
    const cav_contact *c = &t->state->contact[i];
    cav_status status = cav_contact_differentiate(t->model, t->state, c, 0, &s->contact[i]);
    if (status != CAV_OK) return status;
    if (s->contact[i].idle) continue;
    if (c->link1 > 0) contact_at_link(t, c, &s->contact[i], 0);
    if (c->link2 > 0) contact_at_link(t, c, &s->contact[i], 1);
  }
  for (int i = t->model->nlink - 1; i > 0; i--) {
    int parent = t->model->link[i].parent;
    if (parent <= 0 || !s->touched[i]) continue;
    s->touched[parent] = 1;
    for (int k = 0; k < BLOCK; k++) {
      s->by_motion[BLOCK * parent + k] += s->by_motion[BLOCK * i + k];
      s->by_now[BLOCK * parent + k] += s->by_now[BLOCK * i + k];
      s->by_next[BLOCK * parent + k] += s->by_next[BLOCK * i + k];
    }
  }
  return CAV_OK;
}

// last dof that moves a link, -1 for the world
static int last_dof(const cav_model *model, int link) {
  while (link > 0 && model->link[link].ndof == 0) link = model->link[link].parent;
  return link > 0 ? model->link[link].dof + model->link[link].ndof - 1 : -1;
}

// a dof's axis and the drifts of it about a contact
typedef struct column {
  double axis[6], now[6], next[6];
} column;

static void column_at(const task *t, const cav_contact *c, int dof, column *out) {
  const double *reference = t->state->reference + 3 * t->model->dof[dof].link;
  motion_at(out->axis, t->state->axis + 6 * dof, reference, c->pos);
  motion_at(out->now, t->s->drift_now + 6 * dof, reference, c->pos);
  motion_at(out->next, t->s->drift_next + 6 * dof, reference, c->pos);
}

static double dot_n(const double *a, const double *b, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// r = M x
static void multiply6(double r[6], const double *M, const double x[6]) {
  for (int i = 0; i < 6; i++) r[i] = dot6(M + 6 * i, x);
}

// r = M' x
static void multiply6_transposed(double r[6], const double *M, const double x[6]) {
  scale6(r, x[0], M);
  for (int i = 1; i < 6; i++) axpy6(r, r, x[i], M + 6 * i);
}

// blocks of a contact between two moving links: wrench on the one by the motion of the other
static void contact_across(const task *t, const cav_contact *c, const cav_contact_jacobian *derivative) {
  int nv = t->nv, link[2] = {c->link1, c->link2};
  const double *K = &derivative->by_velocity[0][0], keep = 1 - c->damping[0];
  double *axes[2] = {t->s->across, t->s->across + 6 * nv};
  for (int side = 0; side < 2; side++) {
    double *S = axes[side];
    for (int k = last_dof(t->model, link[side]); k >= 0; k = t->model->dof[k].parent, S += 6) {
      motion_at(S, t->state->axis + 6 * k, t->state->reference + 3 * t->model->dof[k].link, c->pos);
    }
  }
  for (int side = 0; side < 2; side++) {
    // columns of this side, rows of the other; the wrench on link2 is that of the law
    double sign = side ? 1 : -1, on = (side ? 1 : -1) * t->inverse_h;
    for (int j = last_dof(t->model, link[side]); j >= 0; j = t->model->dof[j].parent) {
      column col;
      double dq[6], now[6], next[6], drift[6];
      column_at(t, c, j, &col);
      multiply6_transposed(dq, &derivative->wrench[side][0][0], col.axis);
      for (int i = 0; i < 6; i++) drift[i] = sign * (keep * col.now[i] - col.next[i]);
      multiply6(now, K, drift);
      accumulate6(dq, now);
      multiply6(next, K, col.axis);
      scale6(next, sign, next);
      const double *S = axes[!side];
      for (int k = last_dof(t->model, link[!side]); k >= 0; k = t->model->dof[k].parent, S += 6) {
        double push = dot6(S, next) * on;
        t->dq[k * nv + j] += on * dot6(S, dq);
        t->dv[k * nv + j] += keep * push;
        t->dn[k * nv + j] -= push;
      }
    }
  }
}

// ---------------------------------------------------------------- pairs of dofs

/// What the deeper dof of a pair brings: as a column for the rows above it, as a row for the columns above it.
typedef struct deep {
  double a[6], w[6], q[6], carried[6]; ///< columns: by acceleration, velocity, position; the wrench carried along
  double push[6];                      ///< the part of contacts in q
  double gyration[3];                  ///< rows beside a: angular
  double motion[6];                    ///< rows: contacts by motion
  double now[6], next[6];              ///< columns: contacts by v and v_next
  double row_now[6], row_next[6];      ///< rows: the same
  int touched;
} deep;

// a change of contact wrenches by position: scale M x
static void add_push(deep *d, const double *M, const double x[6], double scale) {
  double part[6];
  multiply6(part, M, x);
  axpy6(d->q, d->q, scale, part);
  axpy6(d->push, d->push, scale, part);
}

// rows of the contacts: the convex law's matrices are symmetric
static void fill_rows(const task *t, deep *d, const double *now, const double *next, const double *S, double scale) {
  copy6(d->row_now, d->now);
  copy6(d->row_next, d->next);
  if (t->state->options.sliding == CAV_SLIDING_CONVEX) return;
  multiply6_transposed(d->row_now, now, S);
  multiply6_transposed(d->row_next, next, S);
  scale6(d->row_now, scale, d->row_now);
  scale6(d->row_next, -scale, d->row_next);
}

static void deepen(const task *t, int j, deep *d) {
  const cav_derivative_store *s = t->s;
  int i = t->model->dof[j].link;
  const double *S = t->state->axis + 6 * j, *I = t->state->work->composite + 10 * i, *G = s->gyration + 12 * i;
  const double *F = t->state->force + 6 * i;
  inertia_mul(d->a, I, S);
  inertia_mul(d->w, I, s->rate + 6 * j);
  gyration_mul_add(d->w, G, S);
  inertia_mul(d->q, I, s->second + 6 * j);
  gyration_mul_add(d->q, G, s->drift + 6 * j);
  gyration_transposed(d->gyration, G, S);
  cross3(d->carried, S, F);
  cross_add3(d->carried, S + 3, F + 3);
  cross3(d->carried + 3, S, F + 3);
  d->touched = s->touched[i];
  if (!d->touched) return;
  const double *P = s->by_motion + BLOCK * i, *now = s->by_now + BLOCK * i, *next = s->by_next + BLOCK * i;
  double scale = -t->inverse_h;
  multiply6(d->now, now, S);
  multiply6(d->next, next, S);
  scale6(d->now, scale, d->now);
  scale6(d->next, -scale, d->next);
  fill_rows(t, d, now, next, S, scale);
  multiply6_transposed(d->motion, P, S);
  scale6(d->motion, scale, d->motion);
  add_push(d, P, S, scale);
  add_push(d, now, s->drift_now + 6 * j, scale);
  add_push(d, next, s->drift_next + 6 * j, -scale);
}

// adds what the smooth part gives an entry: by acceleration and by the velocity of the bias
static void add_entry(const task *t, int at, double q, double w, double a) {
  double half = t->mean ? 0.5 : 0;
  t->dq[at] += q;
  t->dv[at] += (t->mean ? 0.5 : 1) * w - a * t->inverse_h;
  t->dn[at] += half * w + a * t->inverse_h;
}

static void pairs_of(const task *t, int j) {
  const cav_derivative_store *s = t->s;
  const cav_workspace *w = t->state->work;
  // of the rows of root links momentum brings all but the contacts
  int nv = t->nv, own = 1, given = t->momentum && cav_moves_root(t->model, j);
  deep d = {0};
  deepen(t, j, &d);
  for (int k = j; k >= 0; k = w->parent[k]) {
    const double *S = t->state->axis + 6 * k;
    double a = dot6(d.a, S);
    // row j: column k moves j
    int at = j * nv + k;
    if (!given) {
      double q = dot6(d.a, s->second + 6 * k) + dot3(d.gyration, s->drift + 6 * k);
      add_entry(t, at, q, dot6(d.a, s->rate + 6 * k) + dot3(d.gyration, S), a);
    }
    if (d.touched) {
      t->dq[at] += dot6(d.motion, S) + dot6(d.row_now, s->drift_now + 6 * k) + dot6(d.row_next, s->drift_next + 6 * k);
      t->dv[at] += dot6(d.row_now, S);
      t->dn[at] += dot6(d.row_next, S);
    }
    // row k: j moves k only within its group
    if (k != j) {
      at = k * nv + j;
      if (t->momentum && cav_moves_root(t->model, k)) {
        t->dq[at] += dot6(d.push, S);
      } else {
        add_entry(t, at, dot6(d.q, S) + (own ? 0 : dot6(d.carried, S)), dot6(d.w, S), a);
      }
      if (d.touched) {
        t->dv[at] += dot6(d.now, S);
        t->dn[at] += dot6(d.next, S);
      }
    }
    if (w->group[k]) own = 0;
  }
}

// gravity compensation: a force at a body's centre of mass that keeps its direction, where subtrees carry it along
// turning
static void add_buoyancy(const task *t) {
  const cav_workspace *w = t->state->work;
  if (!t->state->options.passive || !t->state->options.gravity) return;
  for (int i = 0; i < w->nbuoy; i++) {
    const cav_body *body = &t->model->body[w->buoy[i]];
    const double *reference = t->state->reference + 3 * body->link;
    cav_pose pose;
    double force[3];
    cav_mass_pose(t->state, body, &pose);
    scale3(force, body->buoyancy * body->mass, t->model->gravity);
    for (int j = last_dof(t->model, body->link); j >= 0; j = w->parent[j]) {
      double back[3], S[6];
      cross3(back, force, t->state->axis + 6 * j);
      for (int k = last_dof(t->model, body->link); k >= 0; k = w->parent[k]) {
        motion_at(S, t->state->axis + 6 * k, reference, pose.pos);
        t->dq[k * t->nv + j] += dot3(S + 3, back);
      }
    }
  }
}

// ---------------------------------------------------------------- joints, tendons, rows

static void add_diagonals(const task *t) {
  const cav_workspace *w = t->state->work;
  for (int i = 0; i < t->nv; i++) {
    int at = i * (t->nv + 1);
    add_entry(t, at, 0, 0, w->armature[i]);
    if (!t->state->options.passive) continue;
    t->dv[at] += t->mean ? 0.5 * w->damping[i] : 0;
    t->dn[at] += (t->mean ? 0.5 : 1) * w->damping[i];
  }
}

// du/dq of the spring of three rotations
static void add_turning_spring(const task *t, int dof, double stiffness, const double *q, const double *rest) {
  double from[4], between[4], w[3], J[9];
  quat_conjugate(from, rest);
  quat_normalise(from);
  quat_mul(between, from, q);
  quat_log(w, between);
  cav_rotation_jacobian_inverse(w, J);
  for (int i = 0; i < 9; i++) t->dq[(dof + i / 3) * t->nv + dof + i % 3] += stiffness * J[i];
}

static void add_springs(const task *t) {
  const cav_workspace *w = t->state->work;
  if (!t->state->options.passive) return;
  for (int i = 0; i < w->nspring; i++) {
    const cav_joint *joint = &t->model->joint[w->spring[i]];
    const double *rest = t->model->q0 + joint->q, *q = w->q + joint->q;
    int linear = joint->type == CAV_JOINT_BALL ? 0 : joint->type == CAV_JOINT_FREE ? 3 : 1, dof = joint->dof;
    for (int k = 0; k < linear; k++) t->dq[(dof + k) * (t->nv + 1)] += joint->stiffness;
    if (joint->type == CAV_JOINT_FREE) add_turning_spring(t, dof + 3, joint->stiffness, q + 3, rest + 3);
    if (joint->type == CAV_JOINT_BALL) add_turning_spring(t, dof, joint->stiffness, q, rest);
  }
}

/// A scalar force along fixed coefficients of dofs: u += coef force, force = by_q dq + by_v dv + by_n dv_next.
static void add_scalar(const task *t, int n, const int *dof, const double *coef, double by_q, double by_v,
                       double by_n) {
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++) {
      int at = dof[i] * t->nv + dof[j];
      double product = coef[i] * coef[j];
      t->dq[at] += product * by_q;
      t->dv[at] += product * by_v;
      t->dn[at] += product * by_n;
    }
  }
}

// the same along a tendon of constant arms
static void add_along_tendon(const task *t, int index, double by_q, double by_v, double by_n) {
  const cav_tendon *tendon = &t->model->tendon[index];
  add_scalar(t, tendon->ndof, t->model->tendon_dof + tendon->dof, t->state->tendon_arm + tendon->dof, by_q, by_v, by_n);
}

static void add_tendon_forces(const task *t) {
  const cav_workspace *w = t->state->work;
  if (!t->state->options.passive) return;
  for (int i = 0; i < w->ntendon_spring; i++) {
    const cav_tendon *tendon = &t->model->tendon[w->tendon_spring[i]];
    double half = 0.5 * tendon->damping;
    add_along_tendon(t, w->tendon_spring[i], tendon->stiffness, t->mean ? half : tendon->damping, t->mean ? half : 0);
  }
}

/// Derivatives of a scalar row's impulse.
typedef struct row_derivative {
  double by_dist, by_velocity, hessian;
} row_derivative;

static row_derivative differentiate_row(const task *t, const cav_row *row, const cav_softness *softness) {
  int friction = row->type == CAV_ROW_FRICTION_DOF || row->type == CAV_ROW_FRICTION_TENDON;
  double z = (1 - row->damping) * row->velocity - row->velocity_next, f, H, regulariser, stiffness;
  if (friction) {
    cav_law_bilateral(row->regulariser, row->sigma, row->bound, z / row->regulariser, &f, &H, NULL);
    return (row_derivative){0, (1 - row->damping) * H, H};
  }
  double gap = row->dist - row->margin;
  z -= row->stiffness * gap;
  cav_law_unilateral(row->regulariser, row->sigma, z / row->regulariser, &f, &H, NULL);
  cav_law_rates(t->state, softness, gap, &regulariser, &stiffness);
  double by_dist = -H * row->stiffness * (1 + stiffness * gap) - regulariser * f + stiffness * (f - H * z);
  return (row_derivative){by_dist, (1 - row->damping) * H, H};
}

// angle limit of a ball joint: its axis turns with the joint
static void add_ball_limit(const task *t, const cav_row *row, const cav_joint *joint, const row_derivative *s) {
  const cav_workspace *w = t->state->work;
  double turn[3], J[9], scale = -t->inverse_h;
  quat_log(turn, w->q + joint->q);
  double angle = norm3(turn);
  cav_rotation_jacobian_inverse(turn, J);
  for (int j = 0; j < 3; j++) {
    // axis = -turn/angle, and turn changes by a column of J
    double turned[3], axis[3], along;
    column3(turned, J, j);
    along = dot3(row->axis, turned);
    axpy3(axis, turned, -along, row->axis);
    scale3(axis, angle > 0 ? -1 / angle : 0, axis);
    double now = dot3(axis, w->v + joint->dof), next = dot3(axis, w->v_next + joint->dof);
    double force = s->by_dist * row->axis[j] + s->by_velocity * now - s->hessian * next;
    for (int i = 0; i < 3; i++) {
      int at = (joint->dof + i) * t->nv + joint->dof + j;
      t->dq[at] += scale * (row->axis[i] * force + axis[i] * row->impulse);
      t->dv[at] += scale * row->axis[i] * row->axis[j] * s->by_velocity;
      t->dn[at] -= scale * row->axis[i] * row->axis[j] * s->hessian;
    }
  }
}

static cav_status add_rows(const task *t) {
  double scale = -t->inverse_h, one = 1;
  for (int i = 0; i < t->state->nrow; i++) {
    const cav_row *row = &t->state->row[i];
    row_derivative s;
    switch (row->type) {
      case CAV_ROW_FRICTION_DOF:
        s = differentiate_row(t, row, NULL);
        add_scalar(t, 1, &row->object, &one, 0, scale * s.by_velocity, -scale * s.hessian);
        break;
      case CAV_ROW_FRICTION_TENDON:
        s = differentiate_row(t, row, NULL);
        add_along_tendon(t, row->object, 0, scale * s.by_velocity, -scale * s.hessian);
        break;
      case CAV_ROW_LIMIT_JOINT: {
        const cav_joint *joint = &t->model->joint[row->object];
        s = differentiate_row(t, row, &joint->limit);
        if (joint->type == CAV_JOINT_BALL) {
          add_ball_limit(t, row, joint, &s);
        } else {
          // both ends alike: the sign of the gradient cancels
          add_scalar(t, 1, &joint->dof, &one, scale * s.by_dist, scale * s.by_velocity, -scale * s.hessian);
        }
        break;
      }
      case CAV_ROW_LIMIT_TENDON:
        s = differentiate_row(t, row, &t->model->tendon[row->object].limit);
        add_along_tendon(t, row->object, scale * s.by_dist, scale * s.by_velocity, -scale * s.hessian);
        break;
      default:
        return CAV_NOT_SUPPORTED;
    }
  }
  return CAV_OK;
}

// ---------------------------------------------------------------- calls

// whatever adds to u and is not differentiated above is named here
const char *cav_derivatives_missing(const cav_model *model) {
  for (int i = 0; i < model->nequality; i++) {
    const cav_equality *e = &model->equality[i];
    if (e->type == CAV_EQUALITY_DISTANCE) return "equality constraints on distances";
    for (int k = 0; k < 2 && e->type == CAV_EQUALITY_TENDON && e->object[k] >= 0; k++) {
      if (model->tendon[e->object[k]].npath > 0) return "equality constraints on spatial tendons";
    }
  }
  if (model->density > 0 || model->viscosity > 0) return "forces of a medium";
  for (int i = 0; i < model->njoint; i++) {
    if (model->joint[i].twist_limited || model->joint[i].swing_limited) return "twist and swing limits of ball joints";
  }
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *tendon = &model->tendon[i];
    int acts = tendon->limited || tendon->stiffness != 0 || tendon->damping != 0 || tendon->frictionloss > 0;
    if (tendon->npath > 0 && acts) return "limits, springs or friction of spatial tendons";
  }
  return NULL;
}

cav_status cav_derivatives(const cav_model *model, cav_state *state, double *du_dq, double *du_dv, double *du_dv_next) {
  if (!cav_state_evaluated(state)) return CAV_BAD_INPUT;
  if (cav_derivatives_missing(model)) return CAV_NOT_SUPPORTED;
  // laws that hang on all rows together
  if (state->options.regulariser == CAV_REGULARISER_EXACT || state->options.coupled) return CAV_NOT_SUPPORTED;
  cav_derivative_store *s = store_ready(model, state);
  if (!s) return CAV_NO_MEMORY;
  int nv = model->nv;
  task t = {.model = model,
            .state = state,
            .s = s,
            .nv = nv,
            .mean = cav_takes_mean(state),
            .momentum = state->options.order == CAV_ORDER_MOMENTUM,
            .inverse_h = 1 / state->options.timestep};
  state->work->derived = 0;
  drifts(&t);
  cav_status status = contacts(&t);
  if (status != CAV_OK) return status;
  state->work->derived = 1;
  if (!du_dq && !du_dv && !du_dv_next) return CAV_OK;

  // composites, then pairs of dofs one of which moves the other
  t.dq = du_dq ? du_dq : s->spare;
  t.dv = du_dv ? du_dv : s->spare;
  t.dn = du_dv_next ? du_dv_next : s->spare;
  double *out[3] = {t.dq, t.dv, t.dn};
  for (int k = 0; k < 3; k++) memset(out[k], 0, (size_t)nv * (size_t)nv * sizeof(double));
  cav_composites(model, state);
  gyrations(&t);
  if (t.momentum) cav_half_steps_derivatives(model, state);
  for (int j = 0; j < nv; j++) {
    pairs_of(&t, j);
    if (t.momentum) cav_half_steps_column(model, state, j, t.dq, t.dv, t.dn);
  }
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    if (c->link1 > 0 && c->link2 > 0 && !s->contact[i].idle) contact_across(&t, c, &s->contact[i]);
  }

  // what acts on dofs
  add_diagonals(&t);
  add_springs(&t);
  add_buoyancy(&t);
  add_tendon_forces(&t);
  if (state->nequality > 0) cav_equality_derivatives(model, state, t.dq, t.dv, t.dn);
  return add_rows(&t);
}

// rows of a contact's derivatives in one dof
static void contact_column(const task *t, const cav_contact *c, const cav_contact_jacobian *derivative, int side, int j,
                           cav_contact_derivative *out) {
  int nv = t->nv;
  double sign = side ? 1 : -1, keep = 1 - c->damping[0], x[6], now[6], next[6];
  column col;
  column_at(t, c, j, &col);
  for (int i = 0; i < c->dim; i++) {
    const double *e = c->frame + 3 * (i % 3);
    int at = i < 3 ? 3 : 0;
    x[i] = sign * dot3(e, col.axis + at);
    now[i] = sign * dot3(e, col.now + at);
    next[i] = sign * dot3(e, col.next + at);
  }
  if (out->dist_dq) out->dist_dq[j] += dot6(derivative->dist[side], col.axis);
  for (int i = 0; i < c->dim; i++) {
    int at = i * nv + j;
    const double *H = derivative->hessian[i];
    double by_drift = keep * dot_n(H, now, c->dim) - dot_n(H, next, c->dim), by_axis = dot_n(H, x, c->dim);
    if (out->velocity_dq) out->velocity_dq[at] += dot6(derivative->velocity[side][i], col.axis) + next[i];
    if (out->velocity_dv_next) out->velocity_dv_next[at] += x[i];
    if (out->impulse_dq) out->impulse_dq[at] += dot6(derivative->impulse[side][i], col.axis) + by_drift;
    if (out->impulse_dv) out->impulse_dv[at] += keep * by_axis;
    if (out->impulse_dv_next) out->impulse_dv_next[at] -= by_axis;
  }
}

cav_status cav_contact_derivatives(const cav_model *model, cav_state *state, int contact, cav_contact_derivative *out) {
  cav_derivative_store *s = state->work->derivatives;
  if (!cav_state_evaluated(state) || !state->work->derived || contact < 0 || contact >= state->ncontact)
    return CAV_BAD_INPUT;
  const cav_contact *c = &state->contact[contact];
  if (s->contact[contact].idle) {
    cav_status status = cav_contact_differentiate(model, state, c, 1, &s->contact[contact]);
    if (status != CAV_OK) return status;
  }
  size_t row = (size_t)model->nv * sizeof(double), rows = (size_t)c->dim * row;
  if (out->dist_dq) memset(out->dist_dq, 0, row);
  double *all[] = {out->velocity_dq, out->velocity_dv_next, out->impulse_dq, out->impulse_dv, out->impulse_dv_next};
  for (int k = 0; k < 5; k++) {
    if (all[k]) memset(all[k], 0, rows);
  }
  task t = {.model = model, .state = state, .s = s, .nv = model->nv};
  for (int side = 0; side < 2; side++) {
    for (int j = last_dof(model, side ? c->link2 : c->link1); j >= 0; j = model->dof[j].parent) {
      contact_column(&t, c, &s->contact[contact], side, j, out);
    }
  }
  return CAV_OK;
}
