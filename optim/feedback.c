/// Linear feedback of the remaining problem: block elimination of the Gauss-Newton Hessian from the last knot backwards gives
/// dq_{t+1} = A dq_t + B dq_{t-1}; with the derivatives of u_t that becomes du_t = gain_q dq_t + gain_v dv_t, where dq_{t-1} is
/// dq_t - h dv_t carried through the step's rotation (optimisation.md, 3).
#include "feedback.h"

#include <stdlib.h>
#include <string.h>

/// LAPACK: solves A X = B for symmetric positive definite A.
extern void dposv_(const char *uplo, const int *n, const int *nrhs, double *A, const int *lda, double *B,
                   const int *ldb, int *info);

/// C (rows x n) += scale * A (rows x n) B (n x n), row-major.
static void multiply_add(int rows, int n, double scale, const double *A, const double *B, double *C) {
  for (int i = 0; i < rows; i++)
    for (int k = 0; k < n; k++) {
      double a = scale * A[i * n + k];
      if (a == 0) continue;
      for (int j = 0; j < n; j++) C[i * n + j] += a * B[k * n + j];
    }
}

static void transpose(int n, const double *A, double *B) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) B[j * n + i] = A[i * n + j];
}

/// Elimination of unknown block b: dx_b = A dx_{b-1} + B dx_{b-2}, and what that leaves on the two blocks before it.
typedef struct policy {
  int n;
  double *A, *B;              ///< [blocks*n*n]
  double *near, *far, *cross; ///< what later blocks add to H(b,b), H(b-1,b-1) and H(b,b-1), [n*n]
  double *D, *E, *F, *work;
} policy;

/// Columns of the solution of D X = [E F] as A = -X_E, B = -X_F.
static int eliminate(policy *p, double *A, double *B) {
  int n = p->n, columns = 2 * n, info = 0;
  // column-major right-hand side: column j of E is E[:, j]
  for (int j = 0; j < n; j++)
    for (int i = 0; i < n; i++) {
      p->work[j * n + i] = p->E[i * n + j];
      p->work[(n + j) * n + i] = p->F[i * n + j];
    }
  dposv_("L", &n, &columns, p->D, &n, p->work, &n, &info);
  if (info) return 0;
  for (int j = 0; j < n; j++)
    for (int i = 0; i < n; i++) {
      A[i * n + j] = -p->work[j * n + i];
      B[i * n + j] = -p->work[(n + j) * n + i];
    }
  return 1;
}

static void symmetrise(int n, double *A) {
  for (int i = 0; i < n; i++)
    for (int j = i + 1; j < n; j++) A[i * n + j] = A[j * n + i];
}

/// Fills A and B of every unknown block, last to first.
static int sweep(policy *p, const cav_normal *normal, int blocks, double tracking) {
  int n = p->n;
  size_t square = (size_t)n * n;
  memset(p->near, 0, 3 * square * sizeof(double));
  for (int b = blocks - 1; b >= 0; b--) {
    double *A = p->A + (size_t)b * square, *B = p->B + (size_t)b * square;
    cav_normal_block(normal, b, b, p->D);
    symmetrise(n, p->D);
    memset(p->E, 0, 2 * square * sizeof(double));
    if (b > 0) cav_normal_block(normal, b, b - 1, p->E);
    if (b > 1) cav_normal_block(normal, b, b - 2, p->F);
    for (size_t i = 0; i < square; i++) p->D[i] += p->near[i], p->E[i] += p->cross[i];
    for (int i = 0; i < n; i++) p->D[i * n + i] += tracking;
    if (!eliminate(p, A, B)) return 0;

    // Schur complement on blocks b-1 and b-2: H(b-1,b-1) += E'A, H(b-1,b-2) += E'B, H(b-2,b-2) += F'B
    double *next = p->work;
    transpose(n, p->E, next);
    for (size_t i = 0; i < square; i++) p->near[i] = p->far[i], p->cross[i] = 0;
    multiply_add(n, n, 1, next, A, p->near);
    multiply_add(n, n, 1, next, B, p->cross);
    transpose(n, p->F, next);
    memset(p->far, 0, square * sizeof(double));
    multiply_add(n, n, 1, next, B, p->far);
  }
  return 1;
}

/// out (n x n) := block c of du at knot t.
static void force_block(const cav_transcription *tr, int t, int c, double *out) {
  for (int i = 0; i < tr->nv; i++)
    memcpy(out + (size_t)i * tr->nv, tr->knot[t].du + ((size_t)i * 3 + c) * tr->nv, (size_t)tr->nv * sizeof(double));
}

/// out := P T with T the tangent map of the step that ends at t: dq_{t-1} = T (dq_t - h dv_t) to first order.
static void carry_back(const cav_transcription *tr, int t, const double *P, double *to_q, double *to_v) {
  int nv = tr->nv;
  for (int i = 0; i < nv; i++) {
    for (int d = 0; d < nv; d++) {
      if (tr->turn_of[d] >= 0) continue;
      to_q[i * nv + d] += P[i * nv + d];
      to_v[i * nv + d] -= tr->h * P[i * nv + d];
    }
    for (int k = 0; k < tr->nturn; k++) {
      // v_t = (Jr^-1 dq_t - Jl^-1 dq_{t-1})/h, so dq_{t-1} = Jl (Jr^-1 dq_t - h dv_t)
      const double *right = tr->knot[t].turn + CAV_TURN * k, *row = P + i * nv + tr->turn_dof[k];
      double phi[3], left[9], x[3], y[3];
      for (int c = 0; c < 3; c++) phi[c] = -right[18 + c];
      cav_turn(phi, left);
      for (int c = 0; c < 3; c++) x[c] = row[0] * left[c] + row[1] * left[3 + c] + row[2] * left[6 + c];
      for (int c = 0; c < 3; c++) y[c] = x[0] * right[c] + x[1] * right[3 + c] + x[2] * right[6 + c];
      for (int c = 0; c < 3; c++) {
        to_q[i * nv + tr->turn_dof[k] + c] += y[c];
        to_v[i * nv + tr->turn_dof[k] + c] -= tr->h * x[c];
      }
    }
  }
}

cav_status cav_feedback(const cav_transcription *tr, const cav_normal *normal, double tracking, double *gain_q,
                        double *gain_v) {
  int nv = tr->nv, blocks = tr->nknot - 1;
  size_t square = (size_t)nv * nv;
  policy p = {.n = nv};
  double *memory = calloc((2 * (size_t)blocks + 12) * square, sizeof(double));
  if (!memory) return CAV_NO_MEMORY;
  double *m = memory;
  p.A = m, m += (size_t)blocks * square;
  p.B = m, m += (size_t)blocks * square;
  p.near = m, p.far = m + square, p.cross = m + 2 * square, m += 3 * square;
  p.D = m, p.E = m + square, p.F = m + 2 * square, m += 3 * square;
  p.work = m, m += 2 * square;
  double *here = m, *before = m + square, *block = m + 2 * square;
  cav_status status = sweep(&p, normal, blocks, tracking) ? CAV_OK : CAV_NOT_CONVERGED;

  // knots 0 and 1 look back on given ones, whose columns do not exist: they take the gains of the first complete knot
  int first = blocks > 2 ? 2 : blocks - 1;
  for (int t = first; status == CAV_OK && t < blocks; t++) {
    double *Kq = gain_q + (size_t)t * square, *Kv = gain_v + (size_t)t * square;
    // u depends on q_{t-1}, q_t and, through the policy of block t (knot t+1), on both again
    force_block(tr, t, 1, here);
    force_block(tr, t, 0, before);
    force_block(tr, t, 2, block);
    multiply_add(nv, nv, 1, block, p.A + (size_t)t * square, here);
    multiply_add(nv, nv, 1, block, p.B + (size_t)t * square, before);
    memcpy(Kq, here, square * sizeof(double));
    memset(Kv, 0, square * sizeof(double));
    if (t > 1) carry_back(tr, t, before, Kq, Kv);
  }
  for (int t = 0; t < first; t++) {
    memcpy(gain_q + (size_t)t * square, gain_q + (size_t)first * square, square * sizeof(double));
    memcpy(gain_v + (size_t)t * square, gain_v + (size_t)first * square, square * sizeof(double));
  }
  free(memory);
  return status;
}
