/// From a problem to a solution: guess, continuation, multipliers, optionally Ipopt, then gains. What each of them does is in
/// its own file; this one only puts them in order.
#include "cavort/solve.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "feedback.h"
#include "ipopt.h"

/// Price of straying from the motion in the gains: recipe.md, 5 (1e-3 was too weak, 10 too stiff).
static const double tracking = 1;

cav_solve_options cav_solve_options_default(void) {
  return (cav_solve_options){.solver = CAV_SOLVER_GAUSS_NEWTON, .threads = 1, .tolerance = 2e-7, .ipopt_iterations = 200};
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

void cav_solution_free(cav_solution *solution) {
  if (!solution) return;
  cav_trajectory_free(solution->trajectory);
  free(solution->gain_q), free(solution->gain_v), free(solution->progress);
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
static cav_status check(const cav_problem *p, const cav_solve_options *o, const cav_trajectory *start, cav_error *error) {
  if (!p->model || !p->q_start || !p->v_start || !p->q_goal) return fail(error, CAV_BAD_INPUT, "the problem lacks a model, a start or a goal");
  if (!(p->timestep > 0) || !(p->duration >= 2 * p->timestep)) return fail(error, CAV_BAD_INPUT, "the horizon needs a positive timestep and at least two steps");
  if (!(p->effort_limit > 0) || p->effort_limit > 1) return fail(error, CAV_BAD_INPUT, "effort_limit must be in (0, 1]");
  if (p->schedule.stages < 1) return fail(error, CAV_BAD_INPUT, "the schedule needs at least one stage");
  int nknot = (int)lround(p->duration / p->timestep) + 1;
  if (start && (start->nq != p->model->nq || start->nv != p->model->nv || start->nknot != nknot))
    return fail(error, CAV_BAD_INPUT, "the start trajectory does not fit the problem: resample it to its step and duration");
#ifndef CAVORT_HAVE_IPOPT
  if (o->solver != CAV_SOLVER_GAUSS_NEWTON)
    return fail(error, CAV_NOT_SUPPORTED, "this build has no Ipopt: use --solver gn, or install coinor-libipopt-dev and build again");
#else
  (void)o;
#endif
  return CAV_OK;
}

/// Optimality and gains at the last iterate. Optimality is the largest cosine between the residual and a column of its Jacobian.
static cav_status conclude(cav_solve_run *run) {
  cav_transcription *tr = run->tr;
  cav_solution *solution = run->solution;
  size_t square = (size_t)tr->nv * tr->nv, blocks = (size_t)tr->nknot - 1;
  solution->gain_q = calloc(blocks * square, sizeof(double));
  solution->gain_v = calloc(blocks * square, sizeof(double));
  if (!solution->gain_q || !solution->gain_v) return CAV_NO_MEMORY;
  cav_status status = cav_transcription_linearise(tr, run->at);
  if (status != CAV_OK) return status;
  cav_normal_gather(run->normal, tr);
  solution->contact = tr->options;
  const double *gradient = cav_normal_gradient(run->normal), *diagonal = cav_normal_diagonal(run->normal);
  double size = sqrt(2 * cav_transcription_merit(tr));
  for (size_t i = 0; i < blocks * tr->nv; i++) {
    if (diagonal[i] > 0 && size > 0)
      solution->optimality = fmax(solution->optimality, fabs(gradient[i]) / (sqrt(diagonal[i]) * size));
  }
  solution->cost = cav_transcription_cost(tr);
  solution->unactuated = cav_transcription_unactuated(tr, NULL);
  if (getenv("GS")) { cav_penalties p=tr->penalty; cav_stage_set(run->problem, atoi(getenv("GS")), run->problem->schedule.stages, tr); if(getenv("GP")) tr->penalty=p; if(getenv("GE")) tr->penalty.effort=0;
    for(int t=0;t<tr->nknot;t++) for(int i=0;i<tr->knot[t].layout.count;i++) tr->knot[t].slot[i].multiplier=0;
   status = cav_transcription_linearise(tr, run->at); cav_normal_gather(run->normal, tr);}
  if (getenv("PD")) { double pd=atof(getenv("PD")), dd=getenv("PV")?atof(getenv("PV")):pd*.1; cav_status st=cav_feedback(tr, run->normal, getenv("GT")?atof(getenv("GT")):tracking, solution->gain_q, solution->gain_v);
    for(size_t t=0;t<blocks;t++) for(int a=0;a<tr->model->nu;a++){ int d=tr->effort[a].dof[0]; double lim=1/fabs(tr->effort[a].coef[0]); size_t k=t*square+(size_t)d*tr->nv+(size_t)d; solution->gain_q[k]-=pd*lim; solution->gain_v[k]-=dd*lim; } return st; }
  return cav_feedback(tr, run->normal, getenv("GT")?atof(getenv("GT")):tracking, solution->gain_q, solution->gain_v);
}

static cav_status solve(cav_solve_run *run, cav_error *error) {
  cav_status status = CAV_OK;
  const cav_solve_options *o = run->options;
  if (o->solver == CAV_SOLVER_IPOPT) {
    cav_stage_set(run->problem, 1, 1, run->tr);
  } else {
    status = cav_continue(run);
    if (status == CAV_OK) status = cav_multiply(run);
    if (status == CAV_OK) status = cav_restore(run);
  }
#ifdef CAVORT_HAVE_IPOPT
  if (o->solver != CAV_SOLVER_GAUSS_NEWTON && (status == CAV_OK || status == CAV_NOT_CONVERGED)) status = cav_ipopt(run, error);
#else
  (void)error;
#endif
  return status;
}

cav_status cav_solve(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                     cav_solution **solution, cav_error *error) {
  cav_solve_options defaults = cav_solve_options_default();
  cav_solve_run run = {.problem = problem, .options = options ? options : &defaults, .start = cav_clock()};
  *solution = NULL;
  cav_status status = check(problem, run.options, start, error), end = CAV_OK;
  if (status != CAV_OK) return status;

  run.tr = cav_transcription_new(problem, run.options->threads, error);
  if (!run.tr) return CAV_NO_MEMORY;
  run.normal = cav_normal_new(run.tr->nknot - 1, run.tr->nv);
  run.at = start ? cav_trajectory_copy(start) : cav_trajectory_new(problem->model, run.tr->nknot, problem->timestep);
  run.spare = cav_trajectory_new(problem->model, run.tr->nknot, problem->timestep);
  run.solution = calloc(1, sizeof *run.solution);
  run.region = (cav_region){.report = cav_run_report, .context = &run};
  status = run.normal && run.at && run.spare && run.solution ? CAV_OK : CAV_NO_MEMORY;

  if (status == CAV_OK) {
    memcpy(run.at->q, problem->q_start, (size_t)problem->model->nq * sizeof(double));
    memcpy(run.at->v, problem->v_start, (size_t)problem->model->nv * sizeof(double));
    if (start) {
      cav_trajectory_velocities(problem->model, run.at);
    } else {
      cav_guess_fill(problem, run.at);
    }
    status = solve(&run, error);
    end = conclude(&run);
    run.solution->seconds = cav_clock() - run.start;
    run.solution->seconds_dynamics = run.tr->seconds_dynamics;
    run.solution->seconds_assembly = run.tr->seconds_assembly;
    run.solution->seconds_linear = run.region.seconds_linear;
    run.solution->trajectory = run.at;
    run.at = NULL;
    *solution = run.solution;
    run.solution = NULL;
  }
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory for this problem");
  if (status == CAV_NOT_FINITE) fail(error, status, "a number that is not finite came up; the last finite iterate is kept");
  cav_trajectory_free(run.at);
  cav_trajectory_free(run.spare);
  cav_solution_free(run.solution);
  cav_normal_free(run.normal);
  cav_transcription_free(run.tr);
  return status == CAV_OK ? end : status;
}
