/// The smooth part of the derivatives: rates of axes down the tree, sums over subtrees up it, and the products of pairs
/// of dofs (the formulas are in analytic.c). Where contacts push in the subtree of a pair, their sums (contact_sum.c)
/// enter the same products. Not here: what acts on single dofs (passive.c, row.c).
#include "analytic.h"
#include "half_step.h"
#include "vectors.h"

// ---------------------------------------------------------------- down the tree

// r = V x S
CAV_VECTOR_BODY void motion_cross(double r[6], const double V[6], const double S[6]) {
  double out[6] = {0};
  motion_cross_add(out, V, S);
  copy6(r, out);
}

// rates of the axes of one group of dofs, which share the motion before them
CAV_VECTOR_BODY void group_drifts(const cav_derivative_task *t, int first, int end, const double V[6],
                                  const double W[6], const double A[6]) {
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

CAV_VECTOR_BODY void find_drifts_body(const cav_derivative_task *t) {
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
CAV_BY_VECTORS(find_drifts, (const cav_derivative_task *t), (t))

void cav_derivative_drifts(const cav_derivative_task *t) {
  find_drifts(t);
  memset(t->s->path.dofs, -1, (size_t)t->s->path.n * (size_t)t->s->path.stride * sizeof *t->s->path.dofs);
}

// ---------------------------------------------------------------- up the tree

// moment of a link about its reference by its angular velocity, B's angular block, and its momentum
static void gyration(const cav_derivative_task *t, int i, double *out) {
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

void cav_derivative_gyrations(const cav_derivative_task *t) {
  double *all = t->s->gyration;
  for (int i = 1; i < t->model->nlink; i++) gyration(t, i, all + 12 * i);
  for (int i = t->model->nlink - 1; i > 0; i--) {
    int parent = t->model->link[i].parent;
    for (int k = 0; parent > 0 && k < 12; k++) all[12 * parent + k] += all[12 * i + k];
  }
}

// F += B S
CAV_VECTOR_BODY void gyration_mul_add(double F[6], const double *gyration, const double S[6]) {
  double moment[3], force[3];
  rotate(moment, gyration, S);
  cross3(force, gyration + 9, S);
  add3(F, F, moment);
  axpy3(F + 3, F + 3, -2, force);
}

// angular part of B' S; the linear one is zero
CAV_VECTOR_BODY void gyration_transposed(double r[3], const double *gyration, const double S[6]) {
  double linear[3];
  cross3(linear, S + 3, gyration + 9);
  rotate_back(r, gyration, S);
  axpy3(r, r, -2, linear);
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
CAV_VECTOR_BODY void add_push(deep *d, const double *M, const double x[6], double scale) {
  double part[6];
  multiply6(part, M, x);
  axpy6(d->q, d->q, scale, part);
  axpy6(d->push, d->push, scale, part);
}

// rows of the contacts: the convex law's matrices are symmetric, unless rows take the velocity before the step unlike each other
CAV_VECTOR_BODY void fill_rows(const cav_derivative_task *t, deep *d, const double *now, const double *next,
                               const double *S, double scale) {
  copy6(d->row_now, d->now);
  copy6(d->row_next, d->next);
  if (t->state->options.sliding == CAV_SLIDING_CONVEX && !t->state->options.stops) return;
  multiply6_transposed(d->row_now, now, S);
  multiply6_transposed(d->row_next, next, S);
  scale6(d->row_now, scale, d->row_now);
  scale6(d->row_next, -scale, d->row_next);
}

CAV_VECTOR_BODY void deepen_body(const cav_derivative_task *t, int j, deep *d) {
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
  const double *P = s->by_motion + CAV_TWIST_BLOCK * i, *now = s->by_now + CAV_TWIST_BLOCK * i,
               *next = s->by_next + CAV_TWIST_BLOCK * i;
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
CAV_BY_VECTORS(deepen, (const cav_derivative_task *t, int j, deep *d), (t, j, d))

// puts a dof on the path
static void put(const cav_derivative_task *t, int place, int dof) {
  const cav_derivative_store *s = t->s;
  const double *from[] = {t->state->axis, s->drift, s->drift_now, s->drift_next, s->second, s->rate};
  double *at = s->path.at + place;
  s->path.dof[place] = dof;
  for (int k = 0; k < CAV_DOF_COMPONENTS / 6; k++) {
    for (int i = 0; i < 6; i++, at += s->path.stride) *at = from[k][6 * dof + i];
  }
}

int cav_derivative_path(const cav_derivative_task *t, int dof) {
  cav_dof_path *path = &t->s->path;
  const size_t which = (size_t)path->of[dof] * (size_t)path->stride;
  path->dof = path->dofs + which;
  path->at = path->all + which * CAV_DOF_COMPONENTS;
  int length = t->s->depth[dof] + 1;
  // where a dof is there, so are those that move it
  for (int place = length - 1; dof >= 0 && path->dof[place] != dof; place--, dof = t->state->work->parent[dof])
    put(t, place, dof);
  return length;
}

// component i of four dofs of a path from the k-th on, and dots of a vector with their components from i on
#define AT(i) (*(const cav_four *)(at + (size_t)(i)*n + k))
#define DOT3(x, i) ((x)[0] * AT(i) + (x)[1] * AT((i) + 1) + (x)[2] * AT((i) + 2))
#define DOT6(x, i) (DOT3(x, i) + DOT3((x) + 3, (i) + 3))

/// Entries of the dofs of a path with a deeper one, [path.stride] each: the row of that in the three results, and the
/// column.
typedef struct entries {
  double *row_q, *row_v, *row_n, *column_q, *column_v, *column_n;
} entries;

// what is smooth; dofs before place own, where the deeper one's group begins, carry its wrench
CAV_VECTOR_BODY void smooth_pairs_body(const cav_derivative_task *t, const deep *deeper, const entries *to, int own,
                                       int count) {
  const double inverse_h = t->inverse_h, part = t->mean ? 0.5 : 1, half = t->mean ? 0.5 : 0, *at = t->s->path.at;
  const size_t n = (size_t)t->s->path.stride;
  const deep d = *deeper;
  const entries out = *to;
  for (int k = 0; k < count; k += 4) {
    cav_four a = DOT6(d.a, CAV_OF_AXIS), w = DOT6(d.a, CAV_OF_RATE) + DOT3(d.gyration, CAV_OF_AXIS);
    cav_four by = DOT6(d.w, CAV_OF_AXIS);
    *(cav_four *)(out.row_q + k) = DOT6(d.a, CAV_OF_SECOND) + DOT3(d.gyration, CAV_OF_DRIFT);
    *(cav_four *)(out.row_v + k) = part * w - a * inverse_h;
    *(cav_four *)(out.row_n + k) = half * w + a * inverse_h;
    cav_four column = DOT6(d.q, CAV_OF_AXIS);
    if (k < own) {
      const cav_four carried = DOT6(d.carried, CAV_OF_AXIS), all = column + carried;
      for (int i = 0; i < 4 && k + 4 > own; i++) column[i] = k + i < own ? all[i] : column[i];
      if (k + 4 <= own) column = all;
    }
    *(cav_four *)(out.column_q + k) = column;
    *(cav_four *)(out.column_v + k) = part * by - a * inverse_h;
    *(cav_four *)(out.column_n + k) = half * by + a * inverse_h;
  }
}
CAV_BY_VECTORS(smooth_pairs, (const cav_derivative_task *t, const deep *d, const entries *out, int own, int count),
               (t, d, out, own, count))

// what contacts give
CAV_VECTOR_BODY void contact_pairs_body(const cav_derivative_task *t, const deep *deeper, const entries *to,
                                        int count) {
  const double *at = t->s->path.at;
  const size_t n = (size_t)t->s->path.stride;
  const deep d = *deeper;
  const entries out = *to;
  for (int k = 0; k < count; k += 4) {
    *(cav_four *)(out.row_q + k) +=
        DOT6(d.motion, CAV_OF_AXIS) + DOT6(d.row_now, CAV_OF_NOW) + DOT6(d.row_next, CAV_OF_NEXT);
    *(cav_four *)(out.row_v + k) += DOT6(d.row_now, CAV_OF_AXIS);
    *(cav_four *)(out.row_n + k) += DOT6(d.row_next, CAV_OF_AXIS);
    *(cav_four *)(out.column_v + k) += DOT6(d.now, CAV_OF_AXIS);
    *(cav_four *)(out.column_n + k) += DOT6(d.next, CAV_OF_AXIS);
  }
}
CAV_BY_VECTORS(contact_pairs, (const cav_derivative_task *t, const deep *d, const entries *out, int count),
               (t, d, out, count))

// rows of root links, to which momentum brings all but the contacts: what is smooth is taken out, of the deeper dof's row
// where that is one of theirs
static void leave_roots(const cav_derivative_task *t, const deep *d, const entries *out, int length, int own) {
  for (int k = 0; k < length && own; k++) out->row_q[k] = out->row_v[k] = out->row_n[k] = 0;
  for (int k = 0; k < length && cav_moves_root(t->model, t->s->path.dof[k]); k++) {
    out->column_q[k] = dot6(d->push, t->state->axis + 6 * t->s->path.dof[k]);
    out->column_v[k] = out->column_n[k] = 0;
  }
}

void cav_derivative_pairs(const cav_derivative_task *t, int j) {
  const cav_derivative_store *s = t->s;
  const int *group = t->state->work->group;
  int nv = t->nv, n = s->path.stride, length = cav_derivative_path(t, j), count = (length + 3) / 4 * 4,
      own = length - 1;
  double *e = s->entry;
  const entries out = {e, e + n, e + 2 * n, e + 3 * n, e + 4 * n, e + 5 * n};
  deep d = {0};
  deepen(t, j, &d);
  while (!group[s->path.dof[own]]) own--;
  smooth_pairs(t, &d, &out, own, count);
  if (t->momentum) leave_roots(t, &d, &out, length, cav_moves_root(t->model, j));
  if (d.touched) contact_pairs(t, &d, &out, count);
  for (int k = 0; k < length; k++) {
    int dof = s->path.dof[k], row = j * nv + dof, column = dof * nv + j;
    t->dq[row] += out.row_q[k];
    t->dv[row] += out.row_v[k];
    t->dn[row] += out.row_n[k];
    // j moves those of its own group only
    if (dof == j) continue;
    t->dq[column] += out.column_q[k];
    t->dv[column] += out.column_v[k];
    t->dn[column] += out.column_n[k];
  }
}
