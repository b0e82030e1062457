/// Ways on the ground round what stands on it. Private to optim/solver.
#ifndef CAVORT_BYPASS_H
#define CAVORT_BYPASS_H

#include "cavort/solve.h"

/// The least half sine, across the straight way of the first free joint from start to goal, by which no knot is near a solid of
/// the world: into the strategy's bow, 0 where none was found, or none is wanted, as the straight way runs into nothing that
/// stands on the ground and is as high as the body.
cav_status cav_bypass_find(const cav_problem *problem, cav_strategy *strategy);

#endif
