/// Cholesky factor of a band with a dense border: A = L L' the band, Y = L^-1 B' for the border's rows B, and what is left of
/// its corner C, S = C - Y'Y, as a dense matrix.
#include "band.h"

#include "dense.h"

cav_status cav_band_factor_part(cav_band *band, int ready) {
  int below = band->width - 1;
  if (band->done >= 0)
    band->done = cav_dense_factor_part(band->core, below, band->step, band->done, ready, band->A, below);
  return band->done >= 0 ? CAV_OK : CAV_NOT_CONVERGED;
}

cav_status cav_band_factor(cav_band *band) {
  int core = band->core, border = band->border, below = band->width - 1, step = band->step;
  if (cav_band_factor_part(band, core) != CAV_OK) return CAV_NOT_CONVERGED;
  if (border == 0) return CAV_OK;
  cav_dense_solve_lower_blocks(core, below, step, band->A, below, border, band->Y, core);
  cav_dense_product_transposed(CAV_TRIANGLE_LOWER, border, border, core, -1, band->Y, core, band->Y, core, band->S,
                               border);
  return cav_dense_factor(border, border - 1, band->S, border) ? CAV_OK : CAV_NOT_CONVERGED;
}

void cav_band_solve(const cav_band *band, double *x) {
  int core = band->core, border = band->border, below = band->width - 1, step = band->step;
  // down the band, across the border, up the band
  cav_dense_solve_lower_blocks(core, below, step, band->A, below, 1, x, core);
  if (border > 0) {
    cav_dense_product_transposed(CAV_TRIANGLE_BOTH, border, 1, core, -1, band->Y, core, x, core, x + core, border);
    cav_dense_solve_lower(border, border - 1, band->S, border, 1, x + core, border);
    cav_dense_solve_upper(border, border - 1, band->S, border, 1, x + core, border);
    cav_dense_product(core, 1, border, -1, band->Y, core, x + core, border, x, core);
  }
  cav_dense_solve_upper_blocks(core, below, step, band->A, below, 1, x, core);
}
