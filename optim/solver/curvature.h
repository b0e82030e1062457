/// Second derivatives of the Lagrangian beyond Gauss-Newton's. Private to optim/.
#ifndef CAVORT_CURVATURE_H
#define CAVORT_CURVATURE_H

#include "transcription.h"

/// What the Hessian of costs plus multipliers times rows has over the costs' Gauss-Newton Hessian, by knots.
typedef struct cav_curvature cav_curvature;

/// NULL if memory runs out.
cav_curvature *cav_curvature_new(const cav_transcription *transcription);
void cav_curvature_free(cav_curvature *curvature);

/// At a trajectory, where the transcription ends, linearised; rows must be kept. multiplier: by knot and slot, positive
/// at upper bounds; becomes the slots' final_multiplier. spare is overwritten. chosen [nknot]: the knots whose own is
/// found, others keep theirs; NULL: all.
cav_status cav_curvature_find(cav_curvature *curvature, cav_transcription *transcription, cav_trajectory *at,
                              cav_trajectory *spare, const double *multiplier, const char *chosen);

/// Adds fraction of it to the Hessians of the knots.
void cav_curvature_add(const cav_curvature *curvature, cav_transcription *transcription, double fraction);

#endif
