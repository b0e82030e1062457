/// Sequential quadratic programming on a transcription. Private to optim/.
#ifndef CAVORT_SQP_H
#define CAVORT_SQP_H

#include "continuation.h"

/// From run->at, at the transcription's law, to a stationary point at which every row holds. CAV_NOT_CONVERGED with
/// run->at as it was if the rows do not come in.
cav_status cav_sqp(cav_solve_run *run);

/// The same at the last stage's law, by way of the augmented Lagrangian and restoration where it does not bring the
/// rows in by itself.
cav_status cav_to_optimum(cav_solve_run *run);

/// How optimal run->at is, into run->optimality: the decrease that the programme of its linearisation predicts, with
/// the Lagrangian's curvature, over the cost. Leaves the multipliers in the rows. cav_sqp has done so where the rows
/// came in.
cav_status cav_sqp_measure(cav_solve_run *run);

#endif
