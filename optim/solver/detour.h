/// Ways round solids of what hangs on the world. Private to optim/solver.
#ifndef CAVORT_DETOUR_H
#define CAVORT_DETOUR_H

#include "cavort/solve.h"

/// Half sines over the straight way from start to goal, of driven hinges and slides of trees that cannot rise, by which no
/// knot is in anything: into the strategy's swings, none where there are none or none were found.
cav_status cav_detour_find(const cav_problem *problem, cav_strategy *strategy);

/// Whether no knot of the straight way is in anything, by more than what start and goal are in it.
cav_status cav_detour_straight(const cav_problem *problem, int *is_free);

/// apart [npair] := so far, m, or for pairs that are nearer at start or goal as far as there, and a millimetre less.
cav_status cav_detour_apart(const cav_problem *problem, cav_state *state, double distance, double *apart);

/// Whether a joint is one of those: an actuator of its own moves it, and nothing couples it.
int cav_detour_moves(const cav_model *model, int joint);

#endif
