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
#include "solvers.h"
#include "sqp.h"

cav_solve_options cav_solve_options_default(void) {
  return (cav_solve_options){.solver = CAV_SOLVER_GAUSS_NEWTON,
                             .derivative = CAV_DERIVATIVE_ANALYTIC,
                             .threads = 1,
                             .diagnose = 1,
                             .tolerance = 2e-7};
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
  free(solution->gain_q), free(solution->gain_v), free(solution->progress), free(solution->stage);
  free(solution->row);
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
  if (!p->model || !p->q_start || !p->v_start || !p->q_goal)
    return fail(error, CAV_BAD_INPUT, "the problem lacks a model, a start or a goal");
  if (p->duration_most != 0 && !(p->duration_least > 0 && p->duration_most >= p->duration_least &&
                                 p->duration >= p->duration_least && p->duration <= p->duration_most))
    return fail(error, CAV_BAD_INPUT,
                "a free duration needs duration between duration_least, above 0, and duration_most");
  if (!(p->duration_weight >= 0)) return fail(error, CAV_BAD_INPUT, "duration_weight must not be negative");
  if (p->cycle.on && !(p->duration >= 2.5 * p->timestep))
    return fail(error, CAV_BAD_INPUT, "a cycle needs at least three steps");
  if (!(p->timestep > 0) || !(p->duration >= 2 * p->timestep))
    return fail(error, CAV_BAD_INPUT, "the horizon needs a positive timestep and at least two steps");
  if (!(p->effort_limit > 0) || p->effort_limit > 1)
    return fail(error, CAV_BAD_INPUT, "effort_limit must be in (0, 1]");
  if (o->threads < 1) return fail(error, CAV_BAD_INPUT, "threads must be at least 1");
  if (!(o->tolerance > 0)) return fail(error, CAV_BAD_INPUT, "tolerance must be positive");
  if (p->schedule.stages < 1) return fail(error, CAV_BAD_INPUT, "the schedule needs at least one stage");
  int nfield;
  const cav_field *field = cav_stage_fields(&nfield);
  cav_status status = cav_fields_check(field, nfield, &p->schedule.first, "first stage of the schedule", error);
  if (!status) status = cav_fields_check(field, nfield, &p->schedule.last, "last stage of the schedule", error);
  if (status) return status;
  int nknot = (int)lround(p->duration / p->timestep) + 1;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    if (term->quantity >= CAV_QUANTITY_TYPES) return fail(error, CAV_BAD_INPUT, "a term is of no quantity");
    if (term->use != CAV_USE_COST && !cav_quantity_rule_of(term->quantity)->hard)
      return fail(error, CAV_BAD_INPUT, "a constraint must be over a sensor, a posture, a velocity or an acceleration");
    if (!(term->scale > 0) || !(term->weight >= 0))
      return fail(error, CAV_BAD_INPUT, "a term needs a positive scale and a weight that is not negative");
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
  if (cav_solver_rule_of(o->solver)->missing)
    return fail(error, CAV_NOT_SUPPORTED, cav_solver_rule_of(o->solver)->missing);
  return CAV_OK;
}

/// Constraint rows that hold something back.
static cav_status find_rows(cav_solve_run *run) {
  double allowed[CAV_BINDING_KINDS];
  cav_run_allowed(run, allowed);
  if (!cav_run_met(run)) cav_transcription_estimate_multipliers(run->tr, NULL);
  return cav_transcription_rows(run->tr, allowed, &run->solution->row, &run->solution->nrow);
}

/// What the solution says of its last iterate, and its gains.
static cav_status conclude(cav_solve_run *run, cav_error *error) {
  if (!cav_transcription_keep_rows(run->tr)) return CAV_NO_MEMORY;
  cav_status status = cav_transcription_linearise(run->tr, run->at);
  if (status != CAV_OK) return status;
  if (cav_run_met(run) && !run->measured) status = cav_sqp_measure(run);
  if (status != CAV_OK) return status;
  run->solution->optimality = run->measured ? run->optimality : NAN;
  run->solution->cost = cav_transcription_cost(run->tr);
  run->solution->unactuated = cav_transcription_unactuated(run->tr, NULL);
  run->solution->contact = run->tr->options;
  status = find_rows(run);
  if (status != CAV_OK) return status;
  // a motion whose rows do not hold misses its certificate whatever follows it
  int sets = cav_run_met(run) ? 0 : 1;
  return cav_choose_gains(run->problem, run->tr, run->at, sets, run->solution, error);
}

static cav_status solve(cav_solve_run *run, cav_error *error) {
  const cav_solve_options *o = run->options;
  cav_status status = cav_solver_run(run, error);
  if (status != CAV_NOT_CONVERGED || !o->diagnose || cav_run_met(run)) return status;
  cav_status rest = cav_minimise_infeasibility(run);
  if (rest != CAV_OK) return rest;
  // not the motion that was stopped at, but one that can be
  return cav_run_met(run) && o->solver != CAV_SOLVER_IPOPT ? cav_recover_feasible(run) : status;
}

/// A given start, brought to where unknowns can be: its step within the bounds, its ends those of a cycle.
static cav_status take_start(cav_solve_run *run) {
  double *x = calloc((size_t)cav_transcription_unknowns(run->tr), sizeof *x);
  if (!x) return CAV_NO_MEMORY;
  cav_transcription_move(run->tr, run->at, x, run->spare);
  cav_trajectory *moved = run->spare;
  run->spare = run->at;
  run->at = moved;
  free(x);
  return CAV_OK;
}

/// All of a problem, which was checked.
static cav_status solve_whole(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                              cav_solution **solution, cav_error *error) {
  cav_solve_run run = {.problem = problem, .options = options, .start = cav_clock()};
  *solution = NULL;
  cav_status status = CAV_OK, end = CAV_OK;
  cav_error refusal = {0};
  run.tr = cav_transcription_new(problem, run.options->threads, &refusal);
  if (!run.tr) {
    if (error) *error = refusal;
    return refusal.status;
  }
  run.tr->derivative = run.options->derivative;
  if (run.tr->derivative == CAV_DERIVATIVE_CENTRED) run.tr->difference = CAV_DERIVATIVE_CENTRED;
  run.normal = cav_normal_new(run.tr);
  run.at = start ? cav_trajectory_copy(start) : cav_trajectory_new(problem->model, run.tr->nknot, problem->timestep);
  run.spare = cav_trajectory_new(problem->model, run.tr->nknot, problem->timestep);
  run.solution = calloc(1, sizeof *run.solution);
  run.region = (cav_region){.report = cav_run_report, .context = &run};
  status = run.normal && run.at && run.spare && run.solution ? CAV_OK : CAV_NO_MEMORY;

  if (status == CAV_OK) {
    memcpy(run.at->q, problem->q_start, (size_t)problem->model->nq * sizeof(double));
    memcpy(run.at->v, problem->v_start, (size_t)problem->model->nv * sizeof(double));
    status = start ? take_start(&run) : cav_guess_take(&run);
    if (status == CAV_OK) status = solve(&run, error);
    // the reason of the solve goes before what verification of the gains says
    cav_error inner = {0};
    end = conclude(&run, &inner);
    if (run.failed != CAV_OK) status = run.failed;
    if (end != CAV_OK && status == CAV_OK && error) *error = inner;
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
  cav_trajectory_free(run.at);
  cav_trajectory_free(run.spare);
  cav_solution_free(run.solution);
  cav_normal_free(run.normal);
  cav_transcription_free(run.tr);
  return status;
}

/// A problem without its idle trees, and these beside it. *alone 0: they are not, and nothing was solved.
static cav_status solve_part(const cav_idle *idle, const cav_solve_options *options, const cav_trajectory *start,
                             cav_solution **solution, int *alone, cav_error *error) {
  cav_trajectory *part = start ? cav_idle_reduce(idle, start) : NULL;
  if (start && !part) return CAV_NO_MEMORY;
  cav_status status = solve_whole(&idle->problem, options, part, solution, error);
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
  cav_solve_options defaults = cav_solve_options_default();
  if (!options) options = &defaults;
  *solution = NULL;
  cav_status status = check(problem, options, start, error);
  if (status != CAV_OK) return status;
  cav_idle idle;
  int alone = 0;
  status = cav_idle_find(problem, &idle);
  if (status == CAV_OK && idle.ntree > 0) status = solve_part(&idle, options, start, solution, &alone, error);
  if (status == CAV_NO_MEMORY && !*solution) fail(error, status, "not enough memory for this problem");
  if (status != CAV_NO_MEMORY && !alone && !*solution && error) *error = (cav_error){0};
  if (status != CAV_NO_MEMORY && !alone && !*solution) status = solve_whole(problem, options, start, solution, error);
  cav_idle_clear(&idle);
  return status;
}
