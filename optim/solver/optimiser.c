/// A solver that keeps its memory: transcription, normal equations, motion and multipliers stay from call to call. Its
/// iterations are Gauss-Newton's on the augmented Lagrangian (gauss_newton.c), whose multipliers are updated once a
/// call; a solve goes all the way (solvers.c).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "optimiser.h"

struct cav_optimiser {
  cav_problem problem; ///< the given one, but for the start
  cav_solve_options options;
  cav_solve_run run;
  double *q, *v; ///< [nq], [nv] start
  int rows;
  double *multiplier; ///< [rows]
};

/// Copies the problem's start; 0 if memory runs out.
static int keep_start(cav_optimiser *o) {
  size_t nq = (size_t)o->problem.model->nq, nv = (size_t)o->problem.model->nv;
  o->q = malloc((nq + nv) * sizeof(double));
  if (!o->q) return 0;
  o->v = o->q + nq;
  memcpy(o->q, o->problem.q_start, nq * sizeof(double));
  memcpy(o->v, o->problem.v_start, nv * sizeof(double));
  o->problem.q_start = o->q;
  o->problem.v_start = o->v;
  return 1;
}

cav_optimiser *cav_optimiser_new(const cav_problem *problem, const cav_solve_options *options,
                                 const cav_trajectory *start, cav_error *error) {
  cav_optimiser *o = calloc(1, sizeof *o);
  cav_status status = o ? CAV_OK : CAV_NO_MEMORY;
  if (o) {
    o->problem = *problem;
    o->options = options ? *options : cav_solve_options_default();
    o->options.keeper = NULL;
    o->options.resume = NULL;
    // what lacks a start is refused below
    if (problem->model && problem->q_start && problem->v_start && !keep_start(o)) status = CAV_NO_MEMORY;
  }
  if (status == CAV_OK && (status = cav_run_open(&o->run, &o->problem, &o->options, start, error)) == CAV_OK) {
    o->run.quiet = 1;
    cav_stage_set(&o->problem, 1, o->run.tr);
    o->multiplier = cav_run_multipliers(&o->run, 0, &o->rows);
    if (o->multiplier) return o;
    status = CAV_NO_MEMORY;
  }
  if (status == CAV_NO_MEMORY && error) *error = (cav_error){status, 0, "not enough memory for this problem"};
  cav_optimiser_free(o);
  return NULL;
}

void cav_optimiser_free(cav_optimiser *o) {
  if (!o) return;
  cav_run_close(&o->run);
  free(o->q), free(o->multiplier);
  free(o);
}

/// Counts and clock of a call.
static void begin(cav_optimiser *o) {
  cav_solve_run *run = &o->run;
  run->start = run->noted = cav_clock();
  run->deadline = o->options.max_seconds > 0 ? run->start + o->options.max_seconds : INFINITY;
  run->begin = run->solution->iterations;
  run->soon = run->at_once = run->ending = 0;
  run->failed = CAV_OK;
  run->refusal = run->tr->failure = (cav_error){0};
}

/// Values at the motion, whoever asks for the end.
static cav_status evaluate(cav_solve_run *run) {
  int (*stop)(void *) = run->tr->stop;
  run->tr->stop = NULL;
  cav_status status = cav_transcription_values(run->tr, run->at);
  run->tr->stop = stop;
  return status;
}

cav_status cav_optimiser_solve(cav_optimiser *o, int first_stage, cav_progress *last, cav_error *error) {
  cav_solve_run *run = &o->run;
  o->options.first_stage = first_stage;
  begin(o);
  run->measured = 0;
  run->region.radius = 0;
  // stages know no multipliers, programmes start with them
  cav_transcription *tr = run->tr;
  for (int t = 0; t < tr->nknot && first_stage <= o->problem.schedule.stages; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].multiplier = 0;
  cav_status status = cav_run_solve(run, error);
  if (run->failed != CAV_OK) status = run->failed;
  run->begin_with = CAV_BEGIN_GIVEN;
  for (int t = 0; t < tr->nknot && run->measured; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++)
      tr->knot[t].slot[i].multiplier = tr->knot[t].slot[i].final_multiplier;
  cav_stage_set(&o->problem, 1, tr);
  cav_status end = evaluate(run);
  run->region.radius = 0;
  if (last) *last = run->last;
  return cav_run_refused(run, status == CAV_OK ? end : status, error);
}

cav_status cav_optimiser_iterate(cav_optimiser *o, int iterations, cav_progress *last) {
  cav_solve_run *run = &o->run;
  if (iterations < 1) return CAV_BAD_INPUT;
  begin(o);
  run->phase = "multipliers";
  run->begin_with = CAV_BEGIN_GIVEN;
  run->stage = run->stages = 1;
  run->region.iterations = run->region.single = 1;
  run->region.tolerance = 0;
  // near an optimum whole steps are tried first
  if (run->region.radius == 0) run->region.radius = INFINITY;
  cav_status status = CAV_OK;
  for (int i = 0; i < iterations && status == CAV_OK; i++) {
    status = cav_region_minimise(&run->region, run->normal, run->tr, &run->at, &run->spare);
    if (run->region.settled) break;
  }
  run->region.single = 0;
  if (status == CAV_OK && !o->options.fixed_multipliers) cav_transcription_multipliers(run->tr);
  if (last) *last = run->last;
  return cav_run_refused(run, status, NULL);
}

static int all_finite(const double *x, int n) {
  for (int i = 0; x && i < n; i++)
    if (!isfinite(x[i])) return 0;
  return 1;
}

/// Adds part of the multipliers of another knot's rows to a knot's, if these are as many.
static void add_rows(cav_slot *slot, int n, const cav_slot *other, int m, double part) {
  for (int i = 0; i < n && n == m; i++) slot[i].multiplier += part * other[i].multiplier;
}

/// Adds part of the multipliers of another knot to those of a knot whose rows are alike.
static void add_multipliers(cav_knot *knot, const cav_knot *other, double part) {
  const cav_slot_layout *at = &knot->layout, *of = &other->layout;
  const int start[] = {at->unactuated, at->effort, at->joint, at->tendon, at->term, at->count};
  const int there[] = {of->unactuated, of->effort, of->joint, of->tendon, of->term, of->count};
  for (int k = 0; k < 5; k++)
    add_rows(knot->slot + start[k], start[k + 1] - start[k], other->slot + there[k], there[k + 1] - there[k], part);
}

static void shift_multipliers(cav_transcription *tr, int knots, double part) {
  for (int t = 0; t < tr->nknot; t++) {
    cav_knot *knot = &tr->knot[t];
    // a knot is its own source if nothing moves
    if (knots > 0 || part > 0) {
      const double own = knots == 0 ? 1 - part : 0;
      for (int i = 0; i < knot->layout.count; i++) knot->slot[i].multiplier *= own;
    }
    if (knots > 0 && t + knots < tr->nknot) add_multipliers(knot, &tr->knot[t + knots], 1 - part);
    if (part > 0 && t + knots + 1 < tr->nknot) add_multipliers(knot, &tr->knot[t + knots + 1], part);
  }
}

cav_status cav_optimiser_shift(cav_optimiser *o, double knots, const double *q, const double *v) {
  cav_trajectory *at = o->run.at;
  const cav_model *m = o->problem.model;
  size_t nq = (size_t)m->nq, nv = (size_t)m->nv, last = (size_t)at->nknot - 1;
  if (o->problem.cycle.on) return CAV_NOT_SUPPORTED;
  if (!(knots >= 0 && knots <= at->nknot - 2) || !all_finite(q, m->nq) || !all_finite(v, m->nv)) return CAV_BAD_INPUT;
  const size_t k = (size_t)knots;
  const double part = knots - (double)k;
  const double *before = at->v + k * nv, *after = before + nv;
  for (size_t d = 0; d < nv; d++) o->v[d] = v ? v[d] : part > 0 ? (1 - part) * before[d] + part * after[d] : before[d];
  memmove(at->q, at->q + k * nq, (last + 1 - k) * nq * sizeof(double));
  for (size_t t = last + 1 - k; t <= last; t++) memcpy(at->q + t * nq, at->q + (last - k) * nq, nq * sizeof(double));
  if (part > 0) {
    cav_trajectory_velocities(m, at);
    for (size_t t = 0; t < last; t++)
      cav_integrate(m, at->q + t * nq, at->v + (t + 1) * nv, part * at->timestep, at->q + t * nq);
  }
  if (q) memcpy(at->q, q, nq * sizeof(double));
  memcpy(o->q, at->q, nq * sizeof(double));
  memcpy(at->v, o->v, nv * sizeof(double));
  cav_trajectory_velocities(m, at);
  shift_multipliers(o->run.tr, (int)k, part);
  o->run.begin_with = CAV_BEGIN_GIVEN;
  if (o->options.moving_targets) cav_transcription_elapse(o->run.tr, knots * at->timestep);
  return CAV_OK;
}

cav_solve_run *cav_optimiser_run(cav_optimiser *o) { return &o->run; }
const cav_trajectory *cav_optimiser_trajectory(const cav_optimiser *o) { return o->run.at; }
const cav_problem *cav_optimiser_problem(const cav_optimiser *o) { return &o->problem; }
const cav_options *cav_optimiser_contact(const cav_optimiser *o) { return &o->run.tr->options; }

const double *cav_optimiser_multipliers(cav_optimiser *o, int *n) {
  const cav_transcription *tr = o->run.tr;
  *n = o->rows;
  for (int t = 0, k = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) o->multiplier[k++] = tr->knot[t].slot[i].multiplier;
  return o->multiplier;
}
