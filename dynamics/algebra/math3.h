/// Vectors, rotations and spatial vectors of doubles, inline: spatial.h and what has branches. Private to dynamics/.
#ifndef CAVORT_MATH3_H
#define CAVORT_MATH3_H

#include <math.h>
#include <string.h>

#include "spatial.h"

/// Whether n numbers are all finite: a sum of zeros unless one is not.
static inline int all_finite(const double *x, int n) {
  double a = 0, b = 0;
  int i = 0;
  for (; i + 1 < n; i += 2) {
    a += 0 * x[i];
    b += 0 * x[i + 1];
  }
  if (i < n) { a += 0 * x[i]; }
  return a + b == 0;
}

static inline double norm3(const double a[3]) { return sqrt(dot3(a, a)); }

/// Scales to unit length and returns the length; a zero vector becomes (1, 0, 0) and returns 0.
static inline double normalise3(double a[3]) {
  double n = norm3(a);
  if (n > 0) {
    scale3(a, 1 / n, a);
  } else {
    set3(a, 1, 0, 0);
  }
  return n;
}

static inline void quat_conjugate(double r[4], const double a[4]) {
  r[0] = a[0];
  set3(r + 1, -a[1], -a[2], -a[3]);
}

/// Unit length, any scale of input; zero or non-finite quaternions become the identity.
static inline void quat_normalise(double q[4]) {
  double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!(n > 1e-200 && n < 1e200)) {
    // extreme scales: divide by the largest entry first
    double m = fmax(fmax(fabs(q[0]), fabs(q[1])), fmax(fabs(q[2]), fabs(q[3])));
    if (!(m > 0 && m < INFINITY)) {
      q[0] = 1;
      zero3(q + 1);
      return;
    }
    for (int i = 0; i < 4; i++) { q[i] /= m; }
    n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  }
  double s = 1 / sqrt(n);
  for (int i = 0; i < 4; i++) { q[i] *= s; }
}

/// Quaternion of the rotation vector w (rad).
static inline void quat_exp(double q[4], const double w[3]) {
  double t2 = dot3(w, w);
  double s;
  if (t2 < 1e-8) {
    // cos(t/2) and sin(t/2)/t by their series: error below t^6/46080
    q[0] = 1 - t2 / 8 * (1 - t2 / 48);
    s = 0.5 - t2 / 48 * (1 - t2 / 80);
  } else {
    double t = sqrt(t2);
    q[0] = cos(t / 2);
    s = sin(t / 2) / t;
  }
  scale3(q + 1, s, w);
}

/// Rotation vector of a unit quaternion, shortest: length in [0, pi].
static inline void quat_log(double w[3], const double q[4]) {
  double n = norm3(q + 1);
  double sign = q[0] < 0 ? -1 : 1;
  double c = sign * q[0];
  double s;
  if (n < 1e-4 * c) {
    // angle / sin(angle/2) by the series of atan: error below 1e-16
    s = 2 / c * (1 - n * n / (3 * c * c));
  } else {
    s = n > 0 ? 2 * atan2(n, c) / n : 0;
  }
  scale3(w, sign * s, q + 1);
}

#endif
