/// Small dense algebra that is not worth a library: what the rooms above share.
#ifndef CAVORT_ALGEBRA_H
#define CAVORT_ALGEBRA_H

/// G [n*n] := pseudo-inverse of the symmetric positive semidefinite G by Jacobi rotations; eigenvalues up to rank times
/// the largest count as 0. A, E [n*n] are scratch. symmetric.c.
void cav_pseudo_inverse(int n, double rank, double *G, double *A, double *E);

/// Eigenvectors (as a rotation, columns) and values, largest first, of a symmetric matrix xx yy zz xy xz yz.
/// principal_axes.c.
void cav_principal_axes(const double S[6], double quat[4], double moment[3]);

/// Quaternion of the rotation with columns x and y made orthonormal, x kept; and z their cross product.
/// principal_axes.c.
void cav_quat_of_axes(const double x[3], const double y[3], double quat[4]);

#endif
