/// To where a hand is asked for beyond a solid, by what hangs on the world. Private to optim/solver.
#ifndef CAVORT_REACH_H
#define CAVORT_REACH_H

#include "cavort/solve.h"

/// Where the file has no goal, terms of the end say where driven hinges and slides of trees that cannot rise have to go, and the
/// straight way there runs into something: into the strategy where they are at the end of a guess that is clear of all, and how
/// it is bowed. nreach is 0 where nothing is in the way or nothing was found. CAV_NO_MEMORY, or what the dynamics says.
cav_status cav_reach_find(const cav_problem *problem, cav_strategy *strategy);

#endif
