/// Pseudo-inverse of a dense symmetric positive semidefinite matrix by Jacobi's eigenvalue rotations: for the small
/// matrices of transmissions and equality constraints, whose rows may repeat each other. Cubic with a large factor, but
/// eigenvalues that are small against their own rows keep their digits. Does not pivot or scale.
#include <math.h>
#include <string.h>

#include "algebra.h"

enum { SWEEPS = 30 };

// one Jacobi rotation in the plane (p, q) of A, accumulated in the columns of E
static void rotate(double *A, double *E, int n, int p, int q) {
  double apq = A[p * n + q];
  if (apq == 0) return;
  double theta = 0.5 * (A[q * n + q] - A[p * n + p]) / apq;
  double t = (theta < 0 ? -1 : 1) / (fabs(theta) + hypot(theta, 1)), c = 1 / hypot(t, 1), s = t * c;
  for (int k = 0; k < n; k++) {
    double a = A[k * n + p], b = A[k * n + q];
    A[k * n + p] = c * a - s * b;
    A[k * n + q] = s * a + c * b;
  }
  for (int k = 0; k < n; k++) {
    double a = A[p * n + k], b = A[q * n + k];
    A[p * n + k] = c * a - s * b;
    A[q * n + k] = s * a + c * b;
    a = E[k * n + p], b = E[k * n + q];
    E[k * n + p] = c * a - s * b;
    E[k * n + q] = s * a + c * b;
  }
}

void cav_pseudo_inverse(int n, double rank, double *G, double *A, double *E) {
  memcpy(A, G, (size_t)n * (size_t)n * sizeof *A);
  memset(E, 0, (size_t)n * (size_t)n * sizeof *E);
  for (int i = 0; i < n; i++) E[i * n + i] = 1;
  double largest = 0;
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    double off = 0;
    largest = 0;
    for (int p = 0; p < n; p++) {
      largest = fmax(largest, fabs(A[p * n + p]));
      for (int q = p + 1; q < n; q++) {
        off = fmax(off, fabs(A[p * n + q]));
        rotate(A, E, n, p, q);
      }
    }
    if (off <= 1e-17 * largest) break;
  }
  memset(G, 0, (size_t)n * (size_t)n * sizeof *G);
  for (int k = 0; k < n; k++) {
    double value = A[k * n + k];
    for (int i = 0; i < n && value > rank * largest; i++) {
      for (int j = 0; j < n; j++) G[i * n + j] += E[i * n + k] * E[j * n + k] / value;
    }
  }
}
