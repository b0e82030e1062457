/// A symmetric positive definite band with a dense border, and its Cholesky factor. Private to optim/.
#ifndef CAVORT_BAND_H
#define CAVORT_BAND_H

#include "cavort/model.h"

/// The matrix before it is factored, its factor afterwards; arrays are the caller's. By columns.
typedef struct cav_band {
  int core, border; ///< rows in the band, and after it
  int width;        ///< entries kept of a column of the band, itself and those below
  int step;         ///< columns of a block, which end in one row: that where the block's first column ends
  int done;         ///< columns of the band that are factored; -1: a pivot was not positive
  double *A;        ///< [core*width] lower triangle: A[j*width + i - j] is entry (i, j)
  double *Y;        ///< [core*border] rows of the border: Y[i*core + j] is entry (core + i, j)
  double *S;        ///< [border*border] lower triangle
} cav_band;

/// Factors as much of the band as only needs its first `ready` columns.
cav_status cav_band_factor_part(cav_band *band, int ready);

/// Factors what is left; CAV_NOT_CONVERGED if the matrix is not positive definite.
cav_status cav_band_factor(cav_band *band);

/// x := inverse times x [core+border].
void cav_band_solve(const cav_band *band, double *x);

#endif
