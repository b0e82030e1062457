/// Vectors, rotations and spatial vectors of three dimensions without branches, over numbers CAV_REAL: double, or as a file
/// defines it before it includes this, several at once (vectors.h), which then see the same operations in the same order.
/// Matrices are row-major; quaternions (w, x, y, z); spatial vectors (angular, linear); symmetric matrices
/// xx yy zz xy xz yz. Outputs may be inputs everywhere.
#ifndef CAVORT_SPATIAL_H
#define CAVORT_SPATIAL_H

#include <string.h>

#ifndef CAV_REAL
#define CAV_REAL double
#define CAV_INLINE static inline __attribute__((always_inline))
#define CAV_ALL(x) (x) ///< a double as such a number
#endif

/// n doubles as such numbers.
CAV_INLINE void take_numbers(CAV_REAL *r, const double *a, int n) {
  for (int i = 0; i < n; i++) r[i] = CAV_ALL(a[i]);
}

CAV_INLINE void set3(CAV_REAL r[3], CAV_REAL x, CAV_REAL y, CAV_REAL z) {
  r[0] = x;
  r[1] = y;
  r[2] = z;
}

CAV_INLINE void zero3(CAV_REAL r[3]) { set3(r, CAV_ALL(0), CAV_ALL(0), CAV_ALL(0)); }

CAV_INLINE void copy3(CAV_REAL r[3], const CAV_REAL a[3]) { set3(r, a[0], a[1], a[2]); }

CAV_INLINE void add3(CAV_REAL r[3], const CAV_REAL a[3], const CAV_REAL b[3]) {
  set3(r, a[0] + b[0], a[1] + b[1], a[2] + b[2]);
}

CAV_INLINE void sub3(CAV_REAL r[3], const CAV_REAL a[3], const CAV_REAL b[3]) {
  set3(r, a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

CAV_INLINE void scale3(CAV_REAL r[3], CAV_REAL s, const CAV_REAL a[3]) { set3(r, s * a[0], s * a[1], s * a[2]); }

/// r = a + s b
CAV_INLINE void axpy3(CAV_REAL r[3], const CAV_REAL a[3], CAV_REAL s, const CAV_REAL b[3]) {
  set3(r, a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]);
}

CAV_INLINE CAV_REAL dot3(const CAV_REAL a[3], const CAV_REAL b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

CAV_INLINE void cross3(CAV_REAL r[3], const CAV_REAL a[3], const CAV_REAL b[3]) {
  set3(r, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

/// r += a x b
CAV_INLINE void cross_add3(CAV_REAL r[3], const CAV_REAL a[3], const CAV_REAL b[3]) {
  set3(r, r[0] + a[1] * b[2] - a[2] * b[1], r[1] + a[2] * b[0] - a[0] * b[2], r[2] + a[0] * b[1] - a[1] * b[0]);
}

/// r = R v
CAV_INLINE void rotate(CAV_REAL r[3], const CAV_REAL R[9], const CAV_REAL v[3]) {
  set3(r, dot3(R, v), dot3(R + 3, v), dot3(R + 6, v));
}

/// r = R' v
CAV_INLINE void rotate_back(CAV_REAL r[3], const CAV_REAL R[9], const CAV_REAL v[3]) {
  set3(r, R[0] * v[0] + R[3] * v[1] + R[6] * v[2], R[1] * v[0] + R[4] * v[1] + R[7] * v[2],
       R[2] * v[0] + R[5] * v[1] + R[8] * v[2]);
}

/// r = pos + R v
CAV_INLINE void transform(CAV_REAL r[3], const CAV_REAL pos[3], const CAV_REAL R[9], const CAV_REAL v[3]) {
  set3(r, pos[0] + dot3(R, v), pos[1] + dot3(R + 3, v), pos[2] + dot3(R + 6, v));
}

/// C = A B
CAV_INLINE void matmul3(CAV_REAL C[9], const CAV_REAL A[9], const CAV_REAL B[9]) {
  CAV_REAL T[9];
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) { T[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j]; }
  }
  memcpy(C, T, sizeof T);
}

/// Column k of a matrix.
CAV_INLINE void column3(CAV_REAL r[3], const CAV_REAL R[9], int k) { set3(r, R[k], R[3 + k], R[6 + k]); }

/// r = S v, S symmetric
CAV_INLINE void symmetric_mul(CAV_REAL r[3], const CAV_REAL S[6], const CAV_REAL v[3]) {
  set3(r, S[0] * v[0] + S[3] * v[1] + S[4] * v[2], S[3] * v[0] + S[1] * v[1] + S[5] * v[2],
       S[4] * v[0] + S[5] * v[1] + S[2] * v[2]);
}

/// W = R S R', both symmetric
CAV_INLINE void symmetric_rotate(CAV_REAL W[6], const CAV_REAL R[9], const CAV_REAL S[6]) {
  CAV_REAL T[9];
  for (int i = 0; i < 3; i++) { symmetric_mul(T + 3 * i, S, R + 3 * i); }
  CAV_REAL xx = dot3(T, R), yy = dot3(T + 3, R + 3), zz = dot3(T + 6, R + 6);
  CAV_REAL xy = dot3(T, R + 3), xz = dot3(T, R + 6), yz = dot3(T + 3, R + 6);
  set3(W, xx, yy, zz);
  set3(W + 3, xy, xz, yz);
}

/// r = a b: rotation b, then a
CAV_INLINE void quat_mul(CAV_REAL r[4], const CAV_REAL a[4], const CAV_REAL b[4]) {
  CAV_REAL w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  CAV_REAL x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  CAV_REAL y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  CAV_REAL z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
  r[0] = w;
  set3(r + 1, x, y, z);
}

/// r = R(q) v
CAV_INLINE void quat_rotate(CAV_REAL r[3], const CAV_REAL q[4], const CAV_REAL v[3]) {
  CAV_REAL t[3];
  cross3(t, q + 1, v);
  scale3(t, CAV_ALL(2), t);
  CAV_REAL x[3];
  cross3(x, q + 1, t);
  set3(r, v[0] + q[0] * t[0] + x[0], v[1] + q[0] * t[1] + x[1], v[2] + q[0] * t[2] + x[2]);
}

/// Rotation matrix of a unit quaternion.
CAV_INLINE void quat_matrix(CAV_REAL R[9], const CAV_REAL q[4]) {
  CAV_REAL x2 = q[1] + q[1], y2 = q[2] + q[2], z2 = q[3] + q[3];
  CAV_REAL xx = q[1] * x2, yy = q[2] * y2, zz = q[3] * z2;
  CAV_REAL xy = q[1] * y2, xz = q[1] * z2, yz = q[2] * z2;
  CAV_REAL wx = q[0] * x2, wy = q[0] * y2, wz = q[0] * z2;
  set3(R, 1 - yy - zz, xy - wz, xz + wy);
  set3(R + 3, xy + wz, 1 - xx - zz, yz - wx);
  set3(R + 6, xz - wy, yz + wx, 1 - xx - yy);
}

// no loops over the six: compilers keep what is written out in registers

CAV_INLINE void copy6(CAV_REAL r[6], const CAV_REAL a[6]) {
  copy3(r, a);
  copy3(r + 3, a + 3);
}

/// r = s a, spatial
CAV_INLINE void scale6(CAV_REAL r[6], CAV_REAL s, const CAV_REAL a[6]) {
  scale3(r, s, a);
  scale3(r + 3, s, a + 3);
}

/// r = a + s b, spatial
CAV_INLINE void axpy6(CAV_REAL r[6], const CAV_REAL a[6], CAV_REAL s, const CAV_REAL b[6]) {
  axpy3(r, a, s, b);
  axpy3(r + 3, a + 3, s, b + 3);
}

/// r += a, spatial
CAV_INLINE void accumulate6(CAV_REAL r[6], const CAV_REAL a[6]) {
  add3(r, r, a);
  add3(r + 3, r + 3, a + 3);
}

CAV_INLINE CAV_REAL dot6(const CAV_REAL a[6], const CAV_REAL b[6]) { return dot3(a, b) + dot3(a + 3, b + 3); }

/// r += V x S: rate of change of a motion vector S carried along by V
CAV_INLINE void motion_cross_add(CAV_REAL r[6], const CAV_REAL V[6], const CAV_REAL S[6]) {
  cross_add3(r, V, S);
  cross_add3(r + 3, V, S + 3);
  cross_add3(r + 3, V + 3, S);
}

/// Velocity at a point of a body whose spatial velocity at reference is V.
CAV_INLINE void velocity_at(CAV_REAL r[3], const CAV_REAL V[6], const CAV_REAL reference[3], const CAV_REAL point[3]) {
  CAV_REAL d[3];
  sub3(d, point, reference);
  copy3(r, V + 3);
  cross_add3(r, V, d);
}

/// Wrench at reference += force at a point.
CAV_INLINE void push_at(CAV_REAL F[6], const CAV_REAL reference[3], const CAV_REAL point[3], const CAV_REAL force[3]) {
  CAV_REAL d[3];
  sub3(d, point, reference);
  cross_add3(F, d, force);
  add3(F + 3, F + 3, force);
}

/// Wrench that gives a body unit acceleration along S; c: mass, first moment, inertia at the reference. For S = (a, l):
/// (I a + c x l, m l + a x c).
CAV_INLINE void inertia_mul(CAV_REAL F[6], const CAV_REAL c[10], const CAV_REAL S[6]) {
  symmetric_mul(F, c + 4, S);
  cross_add3(F, c + 1, S + 3);
  scale3(F + 3, c[0], S + 3);
  cross_add3(F + 3, S, c + 1);
}

#endif
