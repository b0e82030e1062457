/// Accelerations of a recorded motion: differences of velocities without what is above a cutoff. A Butterworth filter of
/// second order, forth and back, hence of fourth order and without lag; its corner is moved so that both passes together
/// halve the power at the cutoff (D. A. Winter, "Biomechanics and Motor Control of Human Movement").
#include <math.h>
#include <stdlib.h>

#include "cavort/trajectory.h"

// one pass, begun at rest at the first number
static void pass(double *x, int n, double K, int back) {
  double a0 = 1 + sqrt(2) * K + K * K, b = K * K / a0, a1 = 2 * (K * K - 1) / a0, a2 = (1 - sqrt(2) * K + K * K) / a0;
  double u1 = x[back ? n - 1 : 0], u2 = u1, y1 = u1, y2 = u1;
  for (int i = 0; i < n; i++) {
    double *at = x + (back ? n - 1 - i : i), u = *at;
    double y = b * (u + 2 * u1 + u2) - a1 * y1 - a2 * y2;
    u2 = u1, u1 = u, y2 = y1, y1 = y, *at = y;
  }
}

// one velocity at all knots, with its image through either end before and after: so a steady acceleration stays what it is
static void extend(const cav_trajectory *t, int dof, int pad, double *x) {
  int n = t->nknot, nv = t->nv;
  const double *v = t->v + dof;
  for (int i = -pad; i < n + pad; i++) {
    int from = i < 0 ? -i : i >= n ? 2 * (n - 1) - i : i, end = i < 0 ? 0 : n - 1;
    double at = v[(size_t)from * (size_t)nv];
    x[i + pad] = from == i ? at : 2 * v[(size_t)end * (size_t)nv] - at;
  }
}

cav_status cav_trajectory_accelerations(const cav_trajectory *trajectory, double cutoff, double *acceleration) {
  static const double two_passes = 0.8022; // (sqrt(2) - 1)^(1/4), of the corner of each
  static const double forgotten = 6;       // periods of the cutoff, after which a pass knows nothing of its begin
  double corner = cutoff / two_passes * trajectory->timestep;
  int nv = trajectory->nv, n = trajectory->nknot;
  if (!(corner > 0) || !(corner < 0.5)) return CAV_BAD_INPUT;
  int pad = (int)fmin(forgotten / (cutoff * trajectory->timestep), n - 1);
  double *x = malloc((size_t)(n + 2 * pad) * sizeof *x);
  if (!x) return CAV_NO_MEMORY;
  for (int d = 0; d < nv; d++) {
    extend(trajectory, d, pad, x);
    for (int back = 0; back < 2; back++) pass(x, n + 2 * pad, tan(M_PI * corner), back);
    for (int t = 0; t < n; t++) {
      const double *at = x + pad + (t < n - 1 ? t : n - 2);
      acceleration[(size_t)t * (size_t)nv + (size_t)d] = (at[1] - at[0]) / trajectory->timestep;
    }
  }
  free(x);
  return CAV_OK;
}
