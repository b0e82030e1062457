/// What the files share that differentiate the inverse in closed form: one call, and small sums. Private to
/// dynamics/derivative.
#ifndef CAVORT_ANALYTIC_H
#define CAVORT_ANALYTIC_H

#include "derivative.h"
#include "math3.h"

enum { CAV_TWIST_BLOCK = 36 }; ///< numbers of a matrix over twists, 6 x 6

/// One call: the state and where its results go.
typedef struct cav_derivative_task {
  const cav_model *model;
  cav_state *state;
  cav_derivative_store *s;
  int nv, mean, momentum; ///< bias and passive forces at the mean velocity; rows of roots from momenta
  double inverse_h;
  double *dq, *dv, *dn; ///< [nv*nv]
} cav_derivative_task;

// last dof that moves both of two links, -1 if there is none
static inline int common_dof(const cav_model *model, const int link[2]) {
  int a = cav_last_dof(model, link[0]), b = cav_last_dof(model, link[1]);
  while (a != b) {
    if (a > b)
      a = model->dof[a].parent;
    else
      b = model->dof[b].parent;
  }
  return a;
}

// r = M x
static inline void multiply6(double r[6], const double *M, const double x[6]) {
  for (int i = 0; i < 6; i++) r[i] = dot6(M + 6 * i, x);
}

// r = M' x
static inline void multiply6_transposed(double r[6], const double *M, const double x[6]) {
  scale6(r, x[0], M);
  for (int i = 1; i < 6; i++) axpy6(r, r, x[i], M + 6 * i);
}

// adds what the smooth part gives an entry: by acceleration and by the velocity of the bias
static inline void add_entry(const cav_derivative_task *t, int at, double q, double w, double a) {
  double half = t->mean ? 0.5 : 0;
  t->dq[at] += q;
  t->dv[at] += (t->mean ? 0.5 : 1) * w - a * t->inverse_h;
  t->dn[at] += half * w + a * t->inverse_h;
}

/// A scalar force along fixed coefficients of dofs: u += coef force, force = by_q dq + by_v dv + by_n dv_next.
static inline void add_scalar(const cav_derivative_task *t, int n, const int *dof, const double *coef, double by_q,
                              double by_v, double by_n) {
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
static inline void add_along_tendon(const cav_derivative_task *t, int index, double by_q, double by_v, double by_n) {
  const cav_tendon *tendon = &t->model->tendon[index];
  add_scalar(t, tendon->ndof, t->model->tendon_dof + tendon->dof, t->state->tendon_arm + tendon->dof, by_q, by_v, by_n);
}

/// Rates of the axes of dofs, down the tree, and sums of what a body's wrench changes by its twist, up the tree.
/// smooth.c.
void cav_derivative_drifts(const cav_derivative_task *t);
void cav_derivative_gyrations(const cav_derivative_task *t);

/// Makes the path that ends with a dof, of what cav_derivative_drifts has left; what is there of it stays.
/// Returns its length. smooth.c.
int cav_derivative_path(const cav_derivative_task *t, int dof);

/// Adds the smooth part, and what contacts summed over subtrees give, for all pairs of dof j and one that moves it.
/// smooth.c.
void cav_derivative_pairs(const cav_derivative_task *t, int j);

/// Differentiates the contacts and sums them over subtrees. contact_sum.c.
void cav_derivative_contacts(const cav_derivative_task *t);

/// Adds the blocks across of contacts between two moving links. contact_sum.c.
void cav_derivative_across(const cav_derivative_task *t);

/// Adds what the rows of contacts see after the step; the same for the derivatives of one contact. next_knot.c.
void cav_derivative_next_contacts(const cav_derivative_task *t);
void cav_contact_next_derivatives(const cav_derivative_task *t, int contact, cav_contact_derivative *out);

/// Adds armature, dampers, springs, buoyancy and those of tendons. passive.c.
void cav_derivative_passive(const cav_derivative_task *t);

/// Adds limits and friction losses; CAV_NOT_SUPPORTED for rows of another kind. row.c.
cav_status cav_derivative_rows(const cav_derivative_task *t);

#endif
