/// Sequential quadratic programming on a transcription. Private to optim/.
#ifndef CAVORT_SQP_H
#define CAVORT_SQP_H

#include "continuation.h"

/// From run->at, at the transcription's law, to a stationary point at which every row holds. CAV_NOT_CONVERGED with
/// run->at as it was if the rows do not come in. *left: iterations, of which it takes its own. *stuck: whether it ended since
/// steps hardly gain though much may be left; NULL: that is no end.
cav_status cav_sqp(cav_solve_run *run, int *left, int *stuck);

/// Some iterations of it at a softer law, at a fraction of the way; rows need not come in.
cav_status cav_sqp_on_the_way(cav_solve_run *run, double fraction, int *left);

/// How optimal run->at is, into run->optimality: the decrease that the programme of its linearisation predicts, with
/// the Lagrangian's curvature, over the cost. Leaves the multipliers in the rows. cav_sqp has done so where the rows
/// came in.
cav_status cav_sqp_measure(cav_solve_run *run);

#endif
