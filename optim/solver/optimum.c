/// The end of a solve: from the last stage of the continuation to an optimum at its law, by way of the augmented Lagrangian
/// and restoration where rows do not come in, and by way of softer laws where steps are stuck.
#include <math.h>

#include "continuation.h"
#include "sqp.h"

/// Iterations of the last phase in all.
enum { ITERATIONS = 250 };

/// Fractions of the way that a motion which is stuck goes back to, one after the other.
static const double softer[] = {0.6, 0.8};
enum { SOFTENINGS = sizeof softer / sizeof *softer };

/// Rows farther off than that after the last stage are lost.
static const double rows_lost = 0.02;

/// Through the law at a fraction of the way, to its optimum nearly, and all stages after it; to that of the first of these
/// laws at which rows are no farther off than that.
static cav_status soften(cav_solve_run *run, double law, double off, int *left) {
  int stages = run->problem->schedule.stages, first = 0, polished = 0;
  cav_status status = CAV_OK;
  cav_outcome outcome;
  while (first < stages - 1 && first < law * (stages - 1) - 1e-9) first++;
  run->phase = "softened";
  run->stages = stages;
  run->region.radius = 0;
  for (int i = first; i < stages && status == CAV_OK; i++) {
    double fraction = (double)i / (stages - 1);
    int begin = run->solution->iterations;
    run->stage = i + 1;
    status = cav_stage_run(run, fraction, &outcome);
    if (!cav_run_note(run, fraction, begin, outcome)) status = CAV_NO_MEMORY;
    if (status == CAV_OK && outcome == CAV_OUTCOME_STALLED) run->region.radius = 0;
    if (status != CAV_OK || polished || cav_run_rows_off(run) > off) continue;
    polished = 1;
    status = cav_sqp_on_the_way(run, fraction, left);
  }
  cav_stage_set(run->problem, 1, run->tr);
  return status;
}

/// The last phase again by way of a softer law. Where that ends dearer or not at all, back to where it was, still stuck; where
/// it is stopped, too: rows hold there.
static cav_status try_softer(cav_solve_run *run, double law, int *left, int *stuck) {
  double cost = cav_transcription_cost(run->tr);
  cav_trajectory *before = cav_trajectory_copy(run->at);
  if (!before) return CAV_NO_MEMORY;
  cav_status status = soften(run, law, INFINITY, left);
  if (status == CAV_OK) status = cav_sqp(run, left, stuck);
  if (status != CAV_OK || cav_transcription_cost(run->tr) >= cost) {
    cav_run_exchange(&run->at, &before);
    run->measured = 0;
    *stuck = 1;
    if (status == CAV_OK || status == CAV_NOT_CONVERGED) status = cav_transcription_values(run->tr, run->at);
  }
  cav_trajectory_free(before);
  return status;
}

/// Where the last stages have lost rows that were in, from there by way of softer laws, the first whose stages keep them; where
/// none does, from the end of these stages after all.
static cav_status go_round(cav_solve_run *run, int *left) {
  cav_trajectory *stood = run->stood, *end = run->at;
  // once, whatever becomes of it
  run->stood = NULL;
  cav_status status = stood ? cav_transcription_values(run->tr, end) : CAV_OK;
  int found = !stood || status != CAV_OK || cav_run_rows_off(run) <= rows_lost;
  for (int i = 0; i < SOFTENINGS && !found; i++) {
    int rest = *left;
    if (run->at != end) cav_trajectory_free(run->at);
    run->at = cav_trajectory_copy(stood);
    status = run->at ? soften(run, softer[i], rows_lost, &rest) : CAV_NO_MEMORY;
    if (status == CAV_OK) status = cav_transcription_values(run->tr, run->at);
    found = status != CAV_OK || cav_run_rows_off(run) <= rows_lost;
    if (found) *left = rest;
  }
  cav_trajectory_free(stood);
  if (found && run->at) {
    if (run->at != end) cav_trajectory_free(end);
    return status;
  }
  if (run->at) cav_trajectory_free(run->at);
  run->at = end;
  return status == CAV_OK ? cav_transcription_values(run->tr, end) : status;
}

/// The last phase, and where its steps are stuck once more by way of softer laws, unless it is all that there is. What is
/// still stuck then goes on as it can, and where softer laws gained nothing their iterations do not count.
static cav_status descend(cav_solve_run *run) {
  int left = ITERATIONS, stuck = 0, stages = run->problem->schedule.stages,
      alone = stages < 2 || run->options->first_stage > stages;
  cav_status status = alone ? CAV_OK : go_round(run, &left);
  if (status == CAV_OK) status = cav_sqp(run, &left, alone ? NULL : &stuck);
  if (status == CAV_OK && stuck && !run->refused) status = cav_run_screen(run);
  if (status == CAV_OK && stuck && !run->refused) status = cav_run_screen_feedback(run);
  if (run->refused) return status;
  int rest = left;
  double cost = cav_transcription_cost(run->tr);
  for (int i = 0; i < SOFTENINGS && status == CAV_OK && stuck && left > 0; i++)
    status = try_softer(run, softer[i], &left, &stuck);
  if (status != CAV_OK || !stuck) return status;
  if (!(cav_transcription_cost(run->tr) < cost)) left = rest;
  if (left > 0) status = cav_sqp(run, &left, NULL);
  // rows held where it began, and it is there again
  return status == CAV_NOT_CONVERGED ? CAV_OK : status;
}

/// The last phase, and where rows do not come in by it the augmented Lagrangian, restoration and that phase again.
static cav_status bring_in(cav_solve_run *run) {
  // of a checkpoint the law is what it was
  if (!run->resume || run->resume->place == CAV_PLACE_CONTINUATION) cav_stage_set(run->problem, 1, run->tr);
  cav_status status = CAV_NOT_CONVERGED;
  if (cav_run_reaches(run, CAV_PLACE_SQP, &status)) status = descend(run);
  if (status != CAV_NOT_CONVERGED) return status;
  // the augmented Lagrangian brings rows in from further away
  status = cav_augmented_lagrangian(run);
  if (status == CAV_OK && cav_run_reaches(run, CAV_PLACE_RESTORATION, &status)) status = cav_restore(run);
  if (status == CAV_OK && cav_run_reaches(run, CAV_PLACE_SQP_AGAIN, &status))
    status = descend(run);
  else
    return status;
  return status == CAV_NOT_CONVERGED ? CAV_OK : status;
}

/// Whether there is a body that no actuator moves.
static int moves_things(const cav_model *model) {
  for (int i = 0; i < model->nv; i++)
    if (!model->link[model->dof[i].link].driven) return 1;
  return 0;
}

cav_status cav_to_optimum(cav_solve_run *run) {
  cav_status status = bring_in(run);
  if (status == CAV_NOT_CONVERGED && moves_things(run->tr->model)) {
    // rows of what is pushed cannot all hold within small boxes: penalties that grow there leave no step
    run->checks_raises = 1;
    status = descend(run);
    run->checks_raises = 0;
  }
  return status == CAV_OK && !run->refused ? cav_restore_limits(run) : status;
}
