/// Guesses by sampled forward simulations. Private to optim/solver.
#ifndef CAVORT_SAMPLING_H
#define CAVORT_SAMPLING_H

#include "cavort/solve.h"

/// Whether a model has few enough actuators and dofs for sampling to find something, and the problem a start that is given.
int cav_sample_serves(const cav_problem *problem);

/// Configurations of the best of many simulated motions, scored by the problem's costs and constraints, and their
/// velocities, into at, which has the problem's knots and step; what it scores. Another number draws others. Of the options
/// threads, which change nothing of the result, observer, stop and max_seconds serve: an end that these ask for ends the
/// search with what it has, CAV_INTERRUPTED: nothing yet. CAV_NOT_CONVERGED: none could be simulated to its end.
/// CAV_BAD_INPUT with the reason in error: what cav_transcription_new, or a quantity of one's own, refuses. CAV_NO_MEMORY.
cav_status cav_sample_fill(const cav_problem *problem, const cav_solve_options *options, int number, cav_trajectory *at,
                           double *score, cav_error *error);

#endif
