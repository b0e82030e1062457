/// Second derivatives of the Lagrangian beyond Gauss-Newton's. Private to optim/.
#ifndef CAVORT_LAGRANGIAN_H
#define CAVORT_LAGRANGIAN_H

#include "transcription.h"

/// Adds the curvature of factor times the costs and of the rows, whose multipliers are the slots' final_multiplier, to
/// the knots' Hessians. The transcription holds the linearisation at the trajectory and keeps it. Knots where the
/// dynamics has no analytic derivatives (cav_derivatives_missing) get none, nor do those that chosen [nknot] is 0 of; NULL: all
/// are.
cav_status cav_lagrangian_curvature(cav_transcription *transcription, const cav_trajectory *at, double factor,
                                    const char *chosen);

#endif
