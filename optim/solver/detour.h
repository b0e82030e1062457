/// Ways round solids of what hangs on the world. Private to optim/solver.
#ifndef CAVORT_DETOUR_H
#define CAVORT_DETOUR_H

#include "cavort/solve.h"

/// Half sines over the straight way from start to goal, of driven hinges and slides of trees that cannot rise, by which no
/// knot is in anything: into the strategy's swings, none where there are none or none were found.
cav_status cav_detour_find(const cav_problem *problem, cav_strategy *strategy);

#endif
