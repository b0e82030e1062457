/// Vectors, rotations and spatial vectors of three dimensions, inline. Private to dynamics/.
/// Matrices are row-major; quaternions (w, x, y, z); spatial vectors (angular, linear); symmetric matrices
/// xx yy zz xy xz yz. Outputs may be inputs everywhere.
#ifndef CAVORT_MATH3_H
#define CAVORT_MATH3_H

#include <math.h>
#include <string.h>

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

static inline void set3(double r[3], double x, double y, double z) {
  r[0] = x;
  r[1] = y;
  r[2] = z;
}

static inline void zero3(double r[3]) { set3(r, 0, 0, 0); }

static inline void copy3(double r[3], const double a[3]) { set3(r, a[0], a[1], a[2]); }

static inline void add3(double r[3], const double a[3], const double b[3]) {
  set3(r, a[0] + b[0], a[1] + b[1], a[2] + b[2]);
}

static inline void sub3(double r[3], const double a[3], const double b[3]) {
  set3(r, a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

static inline void scale3(double r[3], double s, const double a[3]) { set3(r, s * a[0], s * a[1], s * a[2]); }

/// r = a + s b
static inline void axpy3(double r[3], const double a[3], double s, const double b[3]) {
  set3(r, a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]);
}

static inline double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross3(double r[3], const double a[3], const double b[3]) {
  set3(r, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

/// r += a x b
static inline void cross_add3(double r[3], const double a[3], const double b[3]) {
  set3(r, r[0] + a[1] * b[2] - a[2] * b[1], r[1] + a[2] * b[0] - a[0] * b[2], r[2] + a[0] * b[1] - a[1] * b[0]);
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

/// r = R v
static inline void rotate(double r[3], const double R[9], const double v[3]) {
  set3(r, dot3(R, v), dot3(R + 3, v), dot3(R + 6, v));
}

/// r = R' v
static inline void rotate_back(double r[3], const double R[9], const double v[3]) {
  set3(r, R[0] * v[0] + R[3] * v[1] + R[6] * v[2], R[1] * v[0] + R[4] * v[1] + R[7] * v[2],
       R[2] * v[0] + R[5] * v[1] + R[8] * v[2]);
}

/// r = pos + R v
static inline void transform(double r[3], const double pos[3], const double R[9], const double v[3]) {
  set3(r, pos[0] + dot3(R, v), pos[1] + dot3(R + 3, v), pos[2] + dot3(R + 6, v));
}

/// C = A B
static inline void matmul3(double C[9], const double A[9], const double B[9]) {
  double T[9];
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) { T[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j]; }
  }
  memcpy(C, T, sizeof T);
}

/// Column k of a matrix.
static inline void column3(double r[3], const double R[9], int k) { set3(r, R[k], R[3 + k], R[6 + k]); }

/// r = S v, S symmetric
static inline void symmetric_mul(double r[3], const double S[6], const double v[3]) {
  set3(r, S[0] * v[0] + S[3] * v[1] + S[4] * v[2], S[3] * v[0] + S[1] * v[1] + S[5] * v[2],
       S[4] * v[0] + S[5] * v[1] + S[2] * v[2]);
}

/// W = R S R', both symmetric
static inline void symmetric_rotate(double W[6], const double R[9], const double S[6]) {
  double T[9];
  for (int i = 0; i < 3; i++) { symmetric_mul(T + 3 * i, S, R + 3 * i); }
  double xx = dot3(T, R), yy = dot3(T + 3, R + 3), zz = dot3(T + 6, R + 6);
  double xy = dot3(T, R + 3), xz = dot3(T, R + 6), yz = dot3(T + 3, R + 6);
  set3(W, xx, yy, zz);
  set3(W + 3, xy, xz, yz);
}

/// r = a b: rotation b, then a
static inline void quat_mul(double r[4], const double a[4], const double b[4]) {
  double w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  double x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  double y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  double z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
  r[0] = w;
  set3(r + 1, x, y, z);
}

static inline void quat_conjugate(double r[4], const double a[4]) {
  r[0] = a[0];
  set3(r + 1, -a[1], -a[2], -a[3]);
}

/// r = R(q) v
static inline void quat_rotate(double r[3], const double q[4], const double v[3]) {
  double t[3];
  cross3(t, q + 1, v);
  scale3(t, 2, t);
  double x[3];
  cross3(x, q + 1, t);
  set3(r, v[0] + q[0] * t[0] + x[0], v[1] + q[0] * t[1] + x[1], v[2] + q[0] * t[2] + x[2]);
}

/// Rotation matrix of a unit quaternion.
static inline void quat_matrix(double R[9], const double q[4]) {
  double x2 = q[1] + q[1], y2 = q[2] + q[2], z2 = q[3] + q[3];
  double xx = q[1] * x2, yy = q[2] * y2, zz = q[3] * z2;
  double xy = q[1] * y2, xz = q[1] * z2, yz = q[2] * z2;
  double wx = q[0] * x2, wy = q[0] * y2, wz = q[0] * z2;
  set3(R, 1 - yy - zz, xy - wz, xz + wy);
  set3(R + 3, xy + wz, 1 - xx - zz, yz - wx);
  set3(R + 6, xz - wy, yz + wx, 1 - xx - yy);
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

// no loops over the six: compilers keep what is written out in registers

static inline void copy6(double r[6], const double a[6]) {
  copy3(r, a);
  copy3(r + 3, a + 3);
}

/// r = s a, spatial
static inline void scale6(double r[6], double s, const double a[6]) {
  scale3(r, s, a);
  scale3(r + 3, s, a + 3);
}

/// r = a + s b, spatial
static inline void axpy6(double r[6], const double a[6], double s, const double b[6]) {
  axpy3(r, a, s, b);
  axpy3(r + 3, a + 3, s, b + 3);
}

/// r += a, spatial
static inline void accumulate6(double r[6], const double a[6]) {
  add3(r, r, a);
  add3(r + 3, r + 3, a + 3);
}

static inline double dot6(const double a[6], const double b[6]) { return dot3(a, b) + dot3(a + 3, b + 3); }

/// r += V x S: rate of change of a motion vector S carried along by V
static inline void motion_cross_add(double r[6], const double V[6], const double S[6]) {
  cross_add3(r, V, S);
  cross_add3(r + 3, V, S + 3);
  cross_add3(r + 3, V + 3, S);
}

/// Velocity at a point of a body whose spatial velocity at reference is V.
static inline void velocity_at(double r[3], const double V[6], const double reference[3], const double point[3]) {
  double d[3];
  sub3(d, point, reference);
  copy3(r, V + 3);
  cross_add3(r, V, d);
}

/// Wrench at reference += force at a point.
static inline void push_at(double F[6], const double reference[3], const double point[3], const double force[3]) {
  double d[3];
  sub3(d, point, reference);
  cross_add3(F, d, force);
  add3(F + 3, F + 3, force);
}

/// Wrench that gives a body unit acceleration along S; c: mass, first moment, inertia at the reference. For S = (a, l):
/// (I a + c x l, m l + a x c).
static inline void inertia_mul(double F[6], const double c[10], const double S[6]) {
  symmetric_mul(F, c + 4, S);
  cross_add3(F, c + 1, S + 3);
  scale3(F + 3, c[0], S + 3);
  cross_add3(F + 3, S, c + 1);
}

#endif
