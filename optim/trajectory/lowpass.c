/// Accelerations of a recorded motion: differences of velocities without what is above a cutoff. A Butterworth filter of
/// second order, forth and back, hence of fourth order and without lag; its corner is moved so that both passes together
/// halve the power at the cutoff (D. A. Winter, "Biomechanics and Motor Control of Human Movement").
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/trajectory.h"

// one pass over every n-th number, begun at rest at the first of them
static void pass(double *x, int count, int n, double K, int back) {
  double a0 = 1 + sqrt(2) * K + K * K, b = K * K / a0, a1 = 2 * (K * K - 1) / a0, a2 = (1 - sqrt(2) * K + K * K) / a0;
  double u1 = x[back ? (size_t)(count - 1) * (size_t)n : 0], u2 = u1, y1 = u1, y2 = u1;
  for (int i = 0; i < count; i++) {
    double *at = x + (size_t)(back ? count - 1 - i : i) * (size_t)n, u = *at;
    double y = b * (u + 2 * u1 + u2) - a1 * y1 - a2 * y2;
    u2 = u1, u1 = u, y2 = y1, y1 = y, *at = y;
  }
}

cav_status cav_trajectory_accelerations(const cav_trajectory *trajectory, double cutoff, double *acceleration) {
  static const double two_passes = 0.8022; // (sqrt(2) - 1)^(1/4), of the corner of each
  double corner = cutoff / two_passes * trajectory->timestep;
  int nv = trajectory->nv, n = trajectory->nknot;
  if (!(corner > 0) || !(corner < 0.5)) return CAV_BAD_INPUT;
  double *v = malloc((size_t)n * (size_t)nv * sizeof *v + 1);
  if (!v) return CAV_NO_MEMORY;
  memcpy(v, trajectory->v, (size_t)n * (size_t)nv * sizeof *v);
  for (int d = 0; d < nv; d++)
    for (int back = 0; back < 2; back++) pass(v + d, n, nv, tan(M_PI * corner), back);
  for (int t = 0; t < n; t++) {
    const double *at = v + (size_t)(t < n - 1 ? t : n - 2) * (size_t)nv;
    for (int d = 0; d < nv; d++) acceleration[t * nv + d] = (at[nv + d] - at[d]) / trajectory->timestep;
  }
  free(v);
  return CAV_OK;
}
