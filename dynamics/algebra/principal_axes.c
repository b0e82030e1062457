/// Principal axes and moments of a symmetric 3 x 3 matrix by Jacobi's rotations, and the rotation that two axes give.
#include <math.h>
#include <string.h>

#include "algebra.h"
#include "math3.h"

void cav_quat_of_axes(const double along_x[3], const double near_y[3], double quat[4]) {
  double x[3], y[3], z[3];
  copy3(x, along_x);
  normalise3(x);
  axpy3(y, near_y, -dot3(x, near_y), x);
  normalise3(y);
  cross3(z, x, y);
  const double R[9] = {x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]};
  // the largest of the four squared entries divides best
  double t[4] = {1 + R[0] + R[4] + R[8], 1 + R[0] - R[4] - R[8], 1 - R[0] + R[4] - R[8], 1 - R[0] - R[4] + R[8]};
  int k = 0;
  for (int i = 1; i < 4; i++) k = t[i] > t[k] ? i : k;
  double a = R[7] - R[5], b = R[2] - R[6], c = R[3] - R[1], d = R[1] + R[3], e = R[2] + R[6], f = R[5] + R[7];
  const double rows[4][4] = {{t[0], a, b, c}, {a, t[1], d, e}, {b, d, t[2], f}, {c, e, f, t[3]}};
  memcpy(quat, rows[k], sizeof rows[k]);
  quat_normalise(quat);
}

void cav_principal_axes(const double S[6], double quat[4], double moment[3]) {
  double A[9] = {S[0], S[3], S[4], S[3], S[1], S[5], S[4], S[5], S[2]}, V[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  // rotate the largest off-diagonal entry away until none matters
  for (int sweep = 0; sweep < 60; sweep++) {
    int p = 0, q = 1;
    if (fabs(A[2]) > fabs(A[1])) q = 2;
    if (fabs(A[5]) > fabs(A[3 * p + q])) p = 1, q = 2;
    double off = A[3 * p + q];
    if (fabs(off) <= 1e-17 * (fabs(A[0]) + fabs(A[4]) + fabs(A[8]))) break;
    double theta = (A[4 * q] - A[4 * p]) / (2 * off);
    double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1)), c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 3; k++) {
      double a = A[3 * k + p], b = A[3 * k + q];
      A[3 * k + p] = c * a - s * b;
      A[3 * k + q] = s * a + c * b;
    }
    for (int k = 0; k < 3; k++) {
      double a = A[3 * p + k], b = A[3 * q + k], u = V[3 * k + p], w = V[3 * k + q];
      A[3 * p + k] = c * a - s * b;
      A[3 * q + k] = s * a + c * b;
      V[3 * k + p] = c * u - s * w;
      V[3 * k + q] = s * u + c * w;
    }
  }
  // largest moment first
  int order[3] = {0, 1, 2};
  for (int i = 0; i < 2; i++) {
    for (int j = 0; j < 2 - i; j++) {
      if (A[4 * order[j]] >= A[4 * order[j + 1]]) continue;
      int swap = order[j];
      order[j] = order[j + 1];
      order[j + 1] = swap;
    }
  }
  double x[3], y[3];
  column3(x, V, order[0]);
  column3(y, V, order[1]);
  for (int i = 0; i < 3; i++) moment[i] = A[4 * order[i]];
  cav_quat_of_axes(x, y, quat);
}
