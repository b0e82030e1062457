/// Long motions by windows of time. Private to optim/solver.
#ifndef CAVORT_WINDOWS_H
#define CAVORT_WINDOWS_H

#include "cavort/solve.h"

/// Whether a problem is solved by windows: it states a window shorter than itself.
int cav_windows_apply(const cav_problem *problem);

/// cav_solve of such a problem. What is kept of a window obeys all that the problem asks; costs are near their optimum as
/// far as windows look ahead. CAV_BAD_INPUT: first_stage, multipliers or a checkpoint to go on from.
cav_status cav_windows_solve(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                             cav_solution **solution, cav_error *error);

#endif
