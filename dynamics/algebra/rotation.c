/// Rotation vectors: the one between two orientations, and the Jacobians of the exponential. Series near zero, where
/// the closed forms lose digits: each is used where its error is below 1e-13.
#include "rotation.h"

#include "math3.h"

void cav_rotation_between(const double a[4], const double b[4], double phi[3]) {
  double back[4], between[4];
  quat_conjugate(back, a);
  quat_mul(between, back, b);
  quat_log(phi, between);
}

void cav_rotation_jacobian(const double phi[3], double J[9]) {
  double a2 = dot3(phi, phi), a = sqrt(a2);
  int small = a < 1e-2;
  // (1 - cos a)/a^2 by the half angle, without a difference
  double half = sin(0.5 * a) / a, b = small ? 0.5 - a2 / 24 + a2 * a2 / 720 : 2 * half * half;
  double c = small ? 1.0 / 6 - a2 / 120 + a2 * a2 / 5040 : (a - sin(a)) / (a2 * a);
  double skew[9] = {0, -phi[2], phi[1], phi[2], 0, -phi[0], -phi[1], phi[0], 0};
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      J[3 * i + j] = (i == j) - b * skew[3 * i + j] + c * (phi[i] * phi[j] - (i == j) * a2);
    }
  }
}

void cav_rotation_jacobian_inverse(const double phi[3], double J[9]) {
  double a2 = dot3(phi, phi), a = sqrt(a2);
  double c = a < 1e-3 ? 1.0 / 12 + a2 / 720 : 1 / a2 - 0.5 / (a * tan(0.5 * a));
  double skew[9] = {0, -phi[2], phi[1], phi[2], 0, -phi[0], -phi[1], phi[0], 0};
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      J[3 * i + j] = (i == j) + 0.5 * skew[3 * i + j] + c * (phi[i] * phi[j] - (i == j) * a2);
    }
  }
}
