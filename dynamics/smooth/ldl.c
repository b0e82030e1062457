/// Sparse factorisation M = L' D L of an inertia matrix along the tree and its solves, without fill (Featherstone 2008,
/// section 6.5). Row i of the storage holds dof i, its parent, the parent's parent and so on: lower triangle, from the
/// diagonal towards the root. D replaces the diagonal, L the rest. Needs positive definite M: it does not pivot.
#include "math3.h"
#include "smooth.h"

int cav_ldl_factor(const cav_model *model, const cav_workspace *w, const double *M, double *L) {
  const int *row = w->row, *parent = w->parent;
  if (model->nv > 0) { memcpy(L, M, (size_t)row[model->nv] * sizeof *L); }
  for (int k = model->nv - 1; k >= 0; k--) {
    double *Lk = L + row[k];
    if (!(Lk[0] > 0)) { return 0; }
    // row i of the remaining matrix -= L_ki (row k from i on), for every ancestor i of k
    int n = row[k + 1] - row[k];
    double inverse = 1 / Lk[0];
    for (int i = parent[k], a = 1; i >= 0; i = parent[i], a++) {
      double ratio = Lk[a] * inverse;
      double *Li = L + row[i];
      for (int b = a; b < n; b++) { Li[b - a] -= ratio * Lk[b]; }
      Lk[a] = ratio;
    }
  }
  return 1;
}

void cav_ldl_solve(const cav_model *model, const cav_workspace *w, const double *L, double *x) {
  const int *row = w->row, *parent = w->parent;

  // x := L'^-1 x, leaves to root
  for (int k = model->nv - 1; k >= 0; k--) {
    const double *Lk = L + row[k];
    for (int i = parent[k], a = 1; i >= 0; i = parent[i], a++) { x[i] -= Lk[a] * x[k]; }
  }
  // x := D^-1 x, then L^-1, root to leaves
  for (int k = 0; k < model->nv; k++) {
    const double *Lk = L + row[k];
    double sum = x[k] / Lk[0];
    for (int i = parent[k], a = 1; i >= 0; i = parent[i], a++) { sum -= Lk[a] * x[i]; }
    x[k] = sum;
  }
}
