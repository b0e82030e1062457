/// What makes a motion look natural, beside its jerk and its efforts. Private to optim/mocap.
#ifndef CAVORT_MANNER_H
#define CAVORT_MANNER_H

#include "cavort/mocap.h"

/// Writes landing, flailing and asymmetry of a motion with velocities and the centres of mass [nknot*3] of all that moves; NaN
/// where there is no gravity, no hand, no pair of joints. Leaves the state anywhere. CAV_NO_MEMORY, CAV_NOT_FINITE.
cav_status cav_manner_measure(const cav_model *model, const cav_trajectory *motion, const double *com, cav_state *state,
                              cav_quality *quality);

#endif
