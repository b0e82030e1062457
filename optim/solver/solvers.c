/// The table of solvers, and the order in which the methods of each come. A solver is a line of CAV_SOLVERS and a
/// function named by its word in a file of its own; those that put together the methods of continuation.c and ipopt.c
/// are here.
#include "solvers.h"

#include <assert.h>

#include "file.h"
#include "ipopt.h"
#include "sqp.h"

#define NAME_NONE ""
#define MISSING_NONE NULL
#define RUN_NONE(run) run
#define LOAD_NONE NULL
#define NAME_IPOPT "Ipopt"
#ifdef CAVORT_LOADS_IPOPT
#define MISSING_IPOPT NULL
#define RUN_IPOPT(run) run
#define LOAD_IPOPT cav_ipopt_load
#else
#define MISSING_IPOPT "this build has no Ipopt: use --solver gn, or install coinor-libipopt-dev and build again"
#define RUN_IPOPT(run) NULL
#define LOAD_IPOPT NULL
#endif

#define RULE(solver, word, library, text) [CAV_SOLVER_##solver] = {#word, NAME_##library, MISSING_##library, text},
static const cav_solver_rule rules[CAV_SOLVER_TYPES] = {CAV_SOLVERS(RULE)};

const cav_solver_rule *cav_solver_rule_of(cav_solver solver) {
  assert(solver < CAV_SOLVER_TYPES);
  return &rules[solver];
}

cav_status cav_solver_load(cav_solver solver, cav_error *error) {
#define LOAD(solver, word, library, text) [CAV_SOLVER_##solver] = LOAD_##library,
  static cav_status (*const loads[CAV_SOLVER_TYPES])(cav_error *) = {CAV_SOLVERS(LOAD)};
  const char *missing = cav_solver_rule_of(solver)->missing;
  if (missing) return cav_file_fail(error, CAV_NOT_SUPPORTED, 0, "%s", missing);
  return loads[solver] ? loads[solver](error) : CAV_OK;
}

cav_status cav_solver_run(cav_solve_run *run, cav_error *error) {
#define RUN(solver, word, library, text) [CAV_SOLVER_##solver] = RUN_##library(cav_solver_##word),
  static cav_status (*const runs[CAV_SOLVER_TYPES])(cav_solve_run *, cav_error *) = {CAV_SOLVERS(RUN)};
  assert(!rules[run->options->solver].missing);
  return runs[run->options->solver](run, error);
}

cav_status cav_solver_gn(cav_solve_run *run, cav_error *error) {
  (void)error;
  cav_status status = cav_continuation_run(run);
  // where it was hopeless from the guess, from where that meets its targets
  if (status == CAV_NOT_CONVERGED && cav_run_from_guess(run)) {
    status = cav_guess_take(run);
    if (status == CAV_OK) status = cav_kinematics_run(run);
    if (status == CAV_OK) status = cav_continuation_run(run);
  }
  return status == CAV_OK ? cav_to_optimum(run) : status;
}

#ifdef CAVORT_LOADS_IPOPT
/// Multipliers for Ipopt to start from: the rows' final ones.
static cav_status warm_start(cav_solve_run *run) {
  run->warm = 1;
  return run->measured ? CAV_OK : cav_sqp_measure(run);
}

static cav_status ipopt_from_here(cav_solve_run *run, cav_error *error) {
  cav_status status = cav_ipopt(run, error);
  if (status != CAV_OK && status != CAV_NOT_CONVERGED) return status;
  run->measured = 0;
  cav_status values = cav_transcription_values(run->tr, run->at);
  if (values != CAV_OK) return values;
  if (cav_run_met(run)) return status;
  // what Ipopt left is worth bringing in, though it stays unfinished
  cav_status restored = cav_restore(run);
  if (status == CAV_OK || restored != CAV_NOT_CONVERGED) status = restored == CAV_OK ? status : restored;
  return status;
}

cav_status cav_solver_ipopt(cav_solve_run *run, cav_error *error) {
  cav_status status = CAV_OK;
  cav_stage_set(run->problem, 1, run->tr);
  return cav_run_reaches(run, CAV_PLACE_IPOPT, &status) ? ipopt_from_here(run, error) : status;
}

/// Ipopt from a motion whose rows hold: what is dearer at its end, or holds less, is not taken.
static cav_status improve(cav_solve_run *run, cav_error *error) {
  cav_trajectory *kept = cav_trajectory_copy(run->at);
  if (!kept) return CAV_NO_MEMORY;
  double cost = cav_transcription_cost(run->tr);
  cav_error mine = {0};
  cav_status status = ipopt_from_here(run, &mine);
  int ended = status == CAV_OK || status == CAV_NOT_CONVERGED;
  // a restoration leaves the values of its own rows, without costs
  cav_status values = ended ? cav_transcription_values(run->tr, run->at) : CAV_OK;
  if (values != CAV_OK) status = values;
  if (ended && values == CAV_OK && !(cav_run_exact(run) && cav_transcription_cost(run->tr) <= cost)) {
    cav_trajectory *dearer = run->at;
    run->at = kept, kept = dearer;
    run->measured = 0;
    status = cav_transcription_values(run->tr, run->at);
  } else if (error) {
    *error = mine;
  }
  cav_trajectory_free(kept);
  return status;
}

cav_status cav_solver_both(cav_solve_run *run, cav_error *error) {
  cav_status status = cav_solver_gn(run, error);
  if (status == CAV_OK && !cav_run_reaches(run, CAV_PLACE_IPOPT, &status)) return status;
  if (status == CAV_OK) status = warm_start(run);
  if (status == CAV_OK) status = cav_transcription_values(run->tr, run->at);
  if (status == CAV_OK && cav_run_met(run)) return improve(run, error);
  return status == CAV_OK || status == CAV_NOT_CONVERGED ? ipopt_from_here(run, error) : status;
}
#endif
