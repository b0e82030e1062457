/// The limbs that carry the body swinging in turn. Private to optim/solver.
#ifndef CAVORT_GAIT_H
#define CAVORT_GAIT_H

#include "cavort/solve.h"

/// Adds the swings of a gait from start to goal to a strategy: none where the model has none or hardly goes or turns; *turns: it
/// is one on the spot. CAV_NO_MEMORY, or what the dynamics says of the posture.
cav_status cav_gait_find(const cav_problem *problem, cav_strategy *strategy, int *turns);

#endif
