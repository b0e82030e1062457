/// Second derivatives of the Lagrangian beyond Gauss-Newton's. Private to optim/.
#ifndef CAVORT_CURVATURE_H
#define CAVORT_CURVATURE_H

#include "transcription.h"

/// What the Hessian of costs plus multipliers times rows has over the costs' Gauss-Newton Hessian, by knots.
typedef struct cav_curvature cav_curvature;

/// NULL if memory runs out.
cav_curvature *cav_curvature_new(const cav_transcription *transcription);
void cav_curvature_free(cav_curvature *curvature);

/// By differences of the Lagrangian's gradient at a trajectory, a linearisation for each of the unknowns that a knot
/// sees; rows must be kept. multiplier: by knot and slot, positive at upper bounds. spare is overwritten, and the
/// transcription ends at at, linearised under no penalties.
cav_status cav_curvature_find(cav_curvature *curvature, cav_transcription *transcription, cav_trajectory *at,
                              cav_trajectory *spare, const double *multiplier);

/// Adds fraction of it to the Hessians of the knots.
void cav_curvature_add(const cav_curvature *curvature, cav_transcription *transcription, double fraction);

#endif
