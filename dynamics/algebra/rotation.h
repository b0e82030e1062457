/// Rotations by vectors, SO(3): what the layer above uses too. Quaternions are in math3.h.
#ifndef CAVORT_ROTATION_H
#define CAVORT_ROTATION_H

/// Rotation vector phi that takes unit quaternion a to b, in a's axes: log(a^-1 b), length in [0, pi].
void cav_rotation_between(const double a[4], const double b[4], double phi[3]);

/// Right Jacobian: angular velocity in body axes = J phi' of the rotation vector phi,
/// 1 - (1 - cos a)/a^2 [phi] + (a - sin a)/a^3 [phi]^2 with a = |phi|, row-major. Its transpose is the left one's.
void cav_rotation_jacobian(const double phi[3], double J[9]);

/// Its inverse, phi' = J omega: 1 + [phi]/2 + (1/a^2 - 1/(2 a tan(a/2))) [phi]^2. For angles below 2 pi.
void cav_rotation_jacobian_inverse(const double phi[3], double J[9]);

#endif
