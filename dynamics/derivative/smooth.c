/// The smooth part of the derivatives: rates of axes down the tree, sums over subtrees up it, and the products of pairs
/// of dofs (the formulas are in analytic.c). Where contacts push in the subtree of a pair, their sums (contact_sum.c)
/// enter the same products. Not here: what acts on single dofs (passive.c, row.c).
#include "analytic.h"
#include "half_step.h"

// ---------------------------------------------------------------- down the tree

// r = V x S
static void motion_cross(double r[6], const double V[6], const double S[6]) {
  double out[6] = {0};
  motion_cross_add(out, V, S);
  copy6(r, out);
}

// rates of the axes of one group of dofs, which share the motion before them
static void group_drifts(const cav_derivative_task *t, int first, int end, const double V[6], const double W[6],
                         const double A[6]) {
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

void cav_derivative_drifts(const cav_derivative_task *t) {
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
static void fill_rows(const cav_derivative_task *t, deep *d, const double *now, const double *next, const double *S,
                      double scale) {
  copy6(d->row_now, d->now);
  copy6(d->row_next, d->next);
  if (t->state->options.sliding == CAV_SLIDING_CONVEX) return;
  multiply6_transposed(d->row_now, now, S);
  multiply6_transposed(d->row_next, next, S);
  scale6(d->row_now, scale, d->row_now);
  scale6(d->row_next, -scale, d->row_next);
}

static void deepen(const cav_derivative_task *t, int j, deep *d) {
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

void cav_derivative_pairs(const cav_derivative_task *t, int j) {
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
