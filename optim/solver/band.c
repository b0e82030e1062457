/// Cholesky factor of a band with a dense border, by LAPACK: A = L L' the band, Y = L^-1 B' for the border's rows B,
/// and what is left of its corner C, S = C - Y'Y, as a dense matrix.
#include "band.h"

#include "lapack.h"

cav_status cav_band_factor(cav_band *band) {
  int core = band->core, border = band->border, below = band->width - 1, info = 0;
  double one = 1, minus = -1;
  dpbtrf_("L", &core, &below, band->A, &band->width, &info);
  if (info != 0) return CAV_NOT_CONVERGED;
  if (border == 0) return CAV_OK;
  dtbtrs_("L", "N", "N", &core, &below, &border, band->A, &band->width, band->Y, &core, &info);
  if (info != 0) return CAV_NOT_CONVERGED;
  dsyrk_("L", "T", &border, &core, &minus, band->Y, &core, &one, band->S, &border);
  dpotrf_("L", &border, band->S, &border, &info);
  return info == 0 ? CAV_OK : CAV_NOT_CONVERGED;
}

void cav_band_solve(const cav_band *band, double *x) {
  int core = band->core, border = band->border, below = band->width - 1, once = 1, info = 0;
  double one = 1, minus = -1;
  // down the band, across the border, up the band
  dtbtrs_("L", "N", "N", &core, &below, &once, band->A, &band->width, x, &core, &info);
  if (border > 0) {
    dgemv_("T", &core, &border, &minus, band->Y, &core, x, &once, &one, x + core, &once);
    dpotrs_("L", &border, &once, band->S, &border, x + core, &border, &info);
    dgemv_("N", &core, &border, &minus, band->Y, &core, x + core, &once, &one, x, &once);
  }
  dtbtrs_("L", "T", "N", &core, &below, &once, band->A, &band->width, x, &core, &info);
}
