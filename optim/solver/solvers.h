/// The solvers that CAV_SOLVERS declares. Private to optim/.
#ifndef CAVORT_SOLVERS_H
#define CAVORT_SOLVERS_H

#include "continuation.h"

/// One function a solver, named by its word: from run->at to a trajectory whose rows hold, left in run->at; run->tr has
/// the values there. It evaluates values, linearises, and exchanges rows, bounds and multipliers through
/// transcription.h. CAV_NOT_CONVERGED: rows do not come in; where it is not the own solver, with its reason in error.
#define CAV_SOLVER_RUN(solver, word, ...) cav_status cav_solver_##word(cav_solve_run *run, cav_error *error);
CAV_SOLVERS(CAV_SOLVER_RUN)
#undef CAV_SOLVER_RUN

/// Loads the library that a solver needs. CAV_NOT_SUPPORTED with what this build lacks, or this machine.
cav_status cav_solver_load(cav_solver solver, cav_error *error);

/// The one that the options ask for.
cav_status cav_solver_run(cav_solve_run *run, cav_error *error);

#endif
