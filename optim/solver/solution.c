/// From a problem to a solution: guess, continuation, multipliers, optionally Ipopt, then gains. What each of them does
/// is in its own file; this one only puts them in order.
#include "cavort/solve.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "idle.h"
#include "lqr.h"
#include "problem_check.h"
#include "solvers.h"
#include "sqp.h"
#include "windows.h"

cav_solve_options cav_solve_options_default(void) {
  return (cav_solve_options){.solver = CAV_SOLVER_GAUSS_NEWTON,
                             .derivative = CAV_DERIVATIVE_ANALYTIC,
                             .threads = 1,
                             .diagnose = 1,
                             .gains = 1,
                             .tolerance = 2e-7,
                             .optimality = 8e-4};
}

int cav_solution_log(cav_solution *solution, const cav_progress *line) {
  // room doubles: a power of two is full
  int n = solution->nprogress;
  if ((n & (n - 1)) == 0) {
    cav_progress *p = realloc(solution->progress, 2 * ((size_t)n + 1) * sizeof *p);
    if (!p) return 0;
    solution->progress = p;
  }
  solution->progress[solution->nprogress++] = *line;
  return 1;
}

int cav_solution_note(cav_solution *solution, const cav_stage_record *stage) {
  int n = solution->nstage;
  if ((n & (n - 1)) == 0) {
    cav_stage_record *s = realloc(solution->stage, 2 * ((size_t)n + 1) * sizeof *s);
    if (!s) return 0;
    solution->stage = s;
  }
  solution->stage[solution->nstage++] = *stage;
  return 1;
}

void cav_solution_free(cav_solution *solution) {
  if (!solution) return;
  cav_trajectory_free(solution->trajectory);
  cav_gains_free(solution);
  free(solution->progress), free(solution->stage);
  free(solution->row), free(solution->multiplier);
  free(solution);
}

static cav_status fail(cav_error *error, cav_status status, const char *text) {
  if (error) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "%s", text);
  }
  return status;
}

/// What a caller can get wrong in structs filled by hand.
static cav_status check(const cav_problem *p, const cav_solve_options *o, const cav_trajectory *start,
                        cav_error *error) {
  cav_status status = cav_problem_check(p, o->moving_targets, error);
  if (status) return status;
  if (o->threads < 1) return fail(error, CAV_BAD_INPUT, "threads must be at least 1");
  if (!(o->tolerance > 0)) return fail(error, CAV_BAD_INPUT, "tolerance must be positive");
  if (!(o->optimality >= 0)) return fail(error, CAV_BAD_INPUT, "optimality must not be negative");
  if (o->first_stage < 0 || o->max_iterations < 0 || !(o->max_seconds >= 0) || o->nmultiplier < 0 ||
      (o->nmultiplier > 0 && !o->multiplier))
    return fail(error, CAV_BAD_INPUT,
                "first_stage, max_iterations, max_seconds and nmultiplier must not be negative, and multipliers there");
  int nknot = (int)lround(p->duration / p->timestep) + 1;
  for (int i = 0; i < p->nterm; i++) {
    if (cav_user_term_check(&p->term[i], error) != CAV_OK) return CAV_BAD_INPUT;
  }
  for (int k = 0; k < 2; k++) {
    const cav_ipopt_option *option = k ? o->ipopt : p->ipopt;
    for (int i = 0; i < (k ? o->nipopt : p->nipopt); i++)
      if (cav_ipopt_option_check(&option[i], error) != CAV_OK) return CAV_BAD_INPUT;
  }
  if (start && (start->nq != p->model->nq || start->nv != p->model->nv || start->nknot != nknot))
    return fail(error, CAV_BAD_INPUT,
                "the start trajectory does not fit the problem: resample it to its step and duration");
  if (start && p->duration_most == 0 && fabs(start->timestep - p->timestep) > 1e-9 * p->timestep)
    return fail(error, CAV_BAD_INPUT,
                "the step of the start trajectory is not the problem's: resample it, it does not fit");
  if (o->solver >= CAV_SOLVER_TYPES) return fail(error, CAV_BAD_INPUT, "there is no such solver");
  return cav_solver_load(o->solver, error);
}

/// Constraint rows that hold something back.
static cav_status find_rows(cav_solve_run *run) {
  double allowed[CAV_BINDING_KINDS];
  cav_run_allowed(run, allowed);
  if (!cav_run_met(run)) cav_transcription_estimate_multipliers(run->tr, NULL);
  return cav_transcription_rows(run->tr, allowed, &run->solution->row, &run->solution->nrow);
}

/// Times its tolerance from which on what a motion misses is not met by polish (METHOD.md, 7).
static const double beyond_polish = 1.5;

/// Times its tolerance from which on a target that is missed by little, so that a bit more of its weight is the cure, is not met
/// by polish either.
static const double beyond_target = 1.01;

/// How many times its tolerance the worst of what a certificate asks without feedback is, 0 where that is not known; *missed: the
/// same of targets, 0 where all are met.
static cav_status find_excess(const cav_solve_run *run, double *excess, double *missed) {
  cav_verdict v = {0};
  cav_error ignored = {0};
  const cav_options law = run->tr->options;
  const cav_status status = cav_verify_knots(run->problem, run->at, &law, &v, &ignored);
  const double over[] = {v.slip_mean_m_s / CAV_TOLERANCE_SLIP, v.hover_fraction / CAV_TOLERANCE_HOVER,
                         v.momentum_defect_rms / CAV_TOLERANCE_MOMENTUM,
                         v.penetration_max_m / CAV_TOLERANCE_PENETRATION,
                         v.penetration_between_m / CAV_TOLERANCE_PENETRATION};
  *excess = 0;
  for (size_t i = 0; i < sizeof over / sizeof *over && status == CAV_OK; i++) *excess = fmax(*excess, over[i]);
  if (missed) *missed = status == CAV_OK ? v.missed_most : 0;
  // what cannot be verified is told of at the end
  return status == CAV_NO_MEMORY ? status : CAV_OK;
}

/// Whether motions that no certificate is in sight of are left. What leads to another solve is not to be certified; what begins
/// at the end may be far from its optimum, its rows held.
static int leaves(const cav_solve_run *run) {
  return run->options->leave_refused && run->options->gains &&
         run->options->first_stage <= run->problem->schedule.stages;
}

cav_status cav_run_screen(cav_solve_run *run) {
  double excess = 0, missed = 0;
  const cav_status status = leaves(run) ? find_excess(run, &excess, &missed) : CAV_OK;
  run->refused |= excess > beyond_polish || (missed > beyond_target && missed < CAV_MISSED_LITTLE);
  return status;
}

/// Sets of gains that are tried of a motion that ends soon, and of one that is stuck.
enum { LAST_SETS = 8, STUCK_SETS = 16 };

cav_status cav_run_screen_feedback(cav_solve_run *run) {
  cav_error ignored = {0};
  if (!leaves(run) || !cav_run_certifiable(run) || !cav_run_within_limits(run)) return CAV_OK;
  int follows = 0;
  double excess = 0, missed = 0;
  run->phase = "feedback";
  run->stage = run->stages = 1;
  run->solution->contact = run->tr->options;
  run->solution->cost = cav_transcription_cost(run->tr);
  cav_status status = cav_choose_gains(run->problem, run->tr, run->at, STUCK_SETS, cav_run_feedback, run, run->solution,
                                       &follows, &ignored);
  if (status == CAV_OK && follows) status = find_excess(run, &excess, &missed);
  // its gains say where it is lost, or follow it beside what it was to reach; those of a motion that goes on are found at its end
  run->refused = status == CAV_OK && run->solution->gain_q && !(follows && missed == 0);
  if (!run->refused) cav_gains_free(run->solution);
  return status == CAV_NO_MEMORY || status == CAV_INTERRUPTED ? status : CAV_OK;
}

/// Gains, of what may be certified with them.
static cav_status find_gains(cav_solve_run *run, int interrupted, cav_error *error) {
  if (!run->options->gains || run->refused || !cav_run_certifiable(run) || !cav_run_within_limits(run)) return CAV_OK;
  double excess = 0;
  cav_status status = leaves(run) ? find_excess(run, &excess, NULL) : CAV_OK;
  if (status != CAV_OK) return status;
  run->phase = "feedback";
  run->stage = run->stages = 1;
  // a motion whose rows do not quite hold, or that is refused whatever they do, is not worth more than one set
  int sets = interrupted ? LAST_SETS : cav_run_weighed_met(run) && excess <= 1 ? 0 : 1;
  return cav_choose_gains(run->problem, run->tr, run->at, sets, cav_run_feedback, run, run->solution, NULL, error);
}

/// What the solution says of its last iterate, and its gains unless it was interrupted and ends at once.
static cav_status conclude(cav_solve_run *run, int interrupted, cav_error *error) {
  if (!cav_transcription_keep_rows(run->tr)) return CAV_NO_MEMORY;
  cav_status status = cav_transcription_linearise(run->tr, run->at);
  if (status != CAV_OK) return status;
  if (cav_run_met(run) && !run->measured && !interrupted) status = cav_sqp_measure(run);
  if (status != CAV_OK) return status;
  run->solution->optimality = run->measured ? run->optimality : NAN;
  run->solution->cost = cav_transcription_cost(run->tr);
  run->solution->unactuated = cav_transcription_unactuated(run->tr, NULL);
  run->solution->holds = cav_run_certifiable(run) && cav_run_within_limits(run);
  run->solution->contact = run->tr->options;
  status = find_rows(run);
  if (status != CAV_OK) return status;
  run->solution->multiplier = cav_run_multipliers(run, 1, &run->solution->nmultiplier);
  if (!run->solution->multiplier) return CAV_NO_MEMORY;
  return interrupted && !run->ending ? CAV_OK : find_gains(run, interrupted, error);
}

cav_status cav_run_solve(cav_solve_run *run, cav_error *error) {
  const cav_solve_options *o = run->options;
  cav_place place = run->resume ? run->resume->place : CAV_PLACE_CONTINUATION;
  int kinematics = run->problem->schedule.kinematics && !run->resume && cav_run_from_guess(run);
  cav_status status = kinematics ? cav_kinematics_run(run) : CAV_OK;
  if (status != CAV_OK) return status;
  status = place < CAV_PLACE_DIAGNOSIS ? cav_solver_run(run, error) : CAV_NOT_CONVERGED;
  if (place <= CAV_PLACE_DIAGNOSIS) {
    // of rows that hold as a certificate asks nothing contradicts anything
    const int hold = place < CAV_PLACE_DIAGNOSIS && cav_run_weighed_met(run);
    if (status != CAV_NOT_CONVERGED || !o->diagnose || hold) return status;
    if (!cav_run_reaches(run, CAV_PLACE_DIAGNOSIS, &status)) return status;
    cav_status rest = cav_minimise_infeasibility(run);
    if (rest != CAV_OK) return rest;
    // not the motion that was stopped at, but one that can be
    if (!cav_run_met(run) || o->solver == CAV_SOLVER_IPOPT) return status;
  }
  return cav_run_reaches(run, CAV_PLACE_RECOVERY, &status) ? cav_recover_feasible(run) : status;
}

cav_status cav_run_refused(const cav_solve_run *run, cav_status status, cav_error *error) {
  const cav_error *own = run->refusal.status != CAV_OK || !run->tr ? &run->refusal : &run->tr->failure;
  if (own->status != CAV_BAD_INPUT && !(own->status == CAV_NOT_FINITE && status == CAV_NOT_FINITE)) return status;
  if (error) *error = *own;
  return own->status;
}

/// The iterate that stands is told of, whoever asked for the end; where that is soon, it is asked for the end at once alone.
static void end_anyhow(cav_solve_run *run) {
  run->ending = run->soon && !run->at_once && run->tr->failure.status == CAV_OK;
  if (!run->ending) run->tr->stop = NULL;
  if (run->tr->failure.status == CAV_BAD_INPUT) run->refusal = run->tr->failure;
  run->tr->failure = (cav_error){0};
}

/// The solve and what it is worth: gains are chosen, or the run ends before them.
static cav_status solve_and_conclude(cav_solve_run *run, cav_status *end, cav_error *error) {
  int solved = run->resume && run->resume->place == CAV_PLACE_FEEDBACK;
  cav_status status = solved ? run->resume->status : cav_run_solve(run, error);
  if (run->failed != CAV_OK) status = run->failed;
  run->checkpoint.status = status;
  run->deadline = INFINITY;
  if (status == CAV_OK || status == CAV_NOT_CONVERGED) cav_run_reaches(run, CAV_PLACE_FEEDBACK, &status);
  if (run->tr->failure.status == CAV_BAD_INPUT) status = CAV_INTERRUPTED;
  if (status == CAV_INTERRUPTED) end_anyhow(run);
  // the reason of the solve goes before what verification of the gains says
  cav_error inner = {0};
  *end = conclude(run, status == CAV_INTERRUPTED, &inner);
  // asked for the end soon, then at once; who refuses a motion refuses it again
  for (int i = 0; i < 2 && *end == CAV_INTERRUPTED; i++) {
    status = CAV_INTERRUPTED;
    end_anyhow(run);
    const int gains = run->solution->gain_q != NULL;
    *end = !run->solution->multiplier ? conclude(run, 1, &inner)
           : run->ending && !gains    ? find_gains(run, 1, &inner)
                                      : CAV_OK;
  }
  if (*end != CAV_OK && status == CAV_OK && error) *error = inner;
  return status;
}

/// A given start, brought to where unknowns can be: its step within the bounds, its ends those of a cycle.
static cav_status take_start(cav_solve_run *run) {
  double *x = calloc((size_t)cav_transcription_unknowns(run->tr), sizeof *x);
  if (!x) return CAV_NO_MEMORY;
  cav_transcription_move(run->tr, run->at, x, run->spare);
  cav_run_exchange(&run->at, &run->spare);
  free(x);
  return CAV_OK;
}

cav_status cav_run_open(cav_solve_run *run, const cav_problem *problem, const cav_solve_options *options,
                        const cav_trajectory *start, cav_error *error) {
  *run = (cav_solve_run){.problem = problem, .options = options, .start = cav_clock(), .noted = cav_clock()};
  run->deadline = options->max_seconds > 0 ? run->start + options->max_seconds : INFINITY;
  cav_status status = check(problem, options, start, error);
  if (status != CAV_OK) return status;
  cav_error refusal = {0};
  run->tr = cav_transcription_new(problem, options->threads, &refusal);
  if (!run->tr) {
    if (error) *error = refusal;
    return refusal.status;
  }
  run->tr->derivative = options->derivative;
  run->tr->stop = cav_run_stop;
  run->tr->stop_context = run;
  if (run->tr->derivative == CAV_DERIVATIVE_CENTRED) run->tr->difference = CAV_DERIVATIVE_CENTRED;
  run->normal = cav_normal_new(run->tr);
  run->at = start ? cav_trajectory_copy(start) : cav_trajectory_new(problem->model, run->tr->nknot, problem->timestep);
  run->spare = cav_trajectory_new(problem->model, run->tr->nknot, problem->timestep);
  run->solution = calloc(1, sizeof *run->solution);
  run->region = (cav_region){.report = cav_run_report, .context = run};
  if (!run->normal || !run->at || !run->spare || !run->solution)
    return fail(error, CAV_NO_MEMORY, "not enough memory for this problem");
  if (!start || !problem->free_start) {
    memcpy(run->at->q, problem->q_start, (size_t)problem->model->nq * sizeof(double));
    memcpy(run->at->v, problem->v_start, (size_t)problem->model->nv * sizeof(double));
  }
  status = start ? take_start(run) : cav_guess_take(run);
  run->begin_with = start ? CAV_BEGIN_GIVEN : CAV_BEGIN_GUESS;
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory for this problem");
  return status == CAV_OK ? cav_run_resume(run, error) : status;
}

void cav_run_close(cav_solve_run *run) {
  cav_trajectory_free(run->at);
  cav_trajectory_free(run->spare);
  cav_trajectory_free(run->stood);
  cav_solution_free(run->solution);
  cav_normal_free(run->normal);
  cav_transcription_free(run->tr);
}

/// All of a problem, from a start or its guess.
static cav_status solve_whole(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                              const cav_solution *before, cav_solution **solution, cav_error *error) {
  cav_solve_run run;
  *solution = NULL;
  cav_status end = CAV_OK, status = cav_run_open(&run, problem, options, start, error);
  if (status == CAV_OK) {
    if (before) run.solution->iterations = before->iterations, run.start -= before->seconds;
    run.begin = run.solution->iterations;
    status = solve_and_conclude(&run, &end, error);
    run.solution->seconds = cav_clock() - run.start;
    run.solution->seconds_dynamics = run.tr->seconds_dynamics;
    run.solution->seconds_assembly = run.tr->seconds_assembly;
    run.solution->seconds_linear = run.region.seconds_linear;
    run.solution->trajectory = run.at;
    run.at = NULL;
    *solution = run.solution;
    run.solution = NULL;
  }
  if (status == CAV_OK || end == CAV_NO_MEMORY) status = end;
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory for this problem");
  if (status == CAV_NOT_FINITE)
    fail(error, status, "a number that is not finite came up; the last finite iterate is kept");
  status = cav_run_refused(&run, status, error);
  cav_run_close(&run);
  return status;
}

/// All of a problem; what no actuator moves begins with its simulation, and goes straight to the last phase.
static cav_status solve_all(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                            const cav_solution *before, cav_solution **solution, cav_error *error) {
  cav_trajectory *given = NULL;
  cav_solve_options straight = *options;
  const cav_checkpoint *resume = options->resume;
  cav_status status = start || resume ? CAV_OK : cav_guess_given(problem, &given);
  // one that is gone on from ends with the same bits
  const int again = resume && resume->begin == CAV_BEGIN_GIVEN && resume->place > CAV_PLACE_CONTINUATION && !start;
  if (given || (again && cav_problem_is_given(problem))) straight.first_stage = problem->schedule.stages + 1;
  if (status == CAV_OK) status = solve_whole(problem, &straight, given ? given : start, before, solution, error);
  cav_trajectory_free(given);
  return status;
}

/// A problem without its idle trees, and these beside it. *alone 0: they are not, and nothing was solved.
static cav_status solve_part(const cav_idle *idle, const cav_solve_options *options, const cav_trajectory *start,
                             const cav_solution *before, cav_solution **solution, int *alone, cav_error *error) {
  cav_trajectory *part = start ? cav_idle_reduce(idle, start) : NULL;
  if (start && !part) return CAV_NO_MEMORY;
  cav_status status = solve_whole(&idle->problem, options, part, before, solution, error);
  cav_trajectory_free(part);
  *alone = 1;
  if (!*solution) return status;
  cav_status expanded = cav_idle_expand(idle, options->tolerance, *solution, alone);
  // one that was stopped is not begun anew
  if (status == CAV_INTERRUPTED && (*solution)->trajectory->nv == idle->whole->model->nv) *alone = 1;
  if (expanded == CAV_OK && *alone) return status;
  cav_solution_free(*solution);
  *solution = NULL;
  return expanded == CAV_OK ? status : expanded;
}

cav_status cav_solve(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                     cav_solution **solution, cav_error *error) {
  return cav_solve_after(problem, options, start, NULL, solution, error);
}

cav_status cav_solve_after(const cav_problem *problem, const cav_solve_options *given, const cav_trajectory *start,
                           const cav_solution *before, cav_solution **solution, cav_error *error) {
  cav_solve_options options = given ? *given : cav_solve_options_default();
  *solution = NULL;
  cav_status status = check(problem, &options, start, error);
  if (status != CAV_OK) return status;
  if (cav_windows_apply(problem)) return cav_windows_solve(problem, &options, start, solution, error);
  cav_idle idle;
  int alone = 0;
  // a checkpoint of all trees is one of a solve that found them not to be alone
  int whole = options.resume && options.resume->trajectory->nv == problem->model->nv;
  status = cav_idle_find(problem, &idle);
  int part = status == CAV_OK && idle.ntree > 0 && !whole;
  if (part) status = solve_part(&idle, &options, start, before, solution, &alone, error);
  if (part) options.resume = NULL;
  if (status == CAV_NO_MEMORY && !*solution) fail(error, status, "not enough memory for this problem");
  if (status != CAV_NO_MEMORY && !alone && !*solution && error) *error = (cav_error){0};
  if (status != CAV_NO_MEMORY && !alone && !*solution)
    status = solve_all(problem, &options, start, before, solution, error);
  cav_idle_clear(&idle);
  return status;
}
