/// Continuation from soft contacts active at a distance and a penalised helper force to the problem as stated, then an
/// augmented Lagrangian that makes its constraints hold (METHOD.md, 5). The schedule is data: problem->schedule.
#include "continuation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Weights of rows while they are only penalised, at the first stage; they end a hundred times higher. Rows are scaled,
/// so these serve all models. Ranges are expensive from the start: a motion that leans on a limit, whose force is free,
/// would have to be found anew where the limit takes it away, and rows of ranges are all but linear, so a high penalty
/// costs nothing.
static const cav_penalties penalised = {.effort = 100, .range = 1e4, .term = 100};
enum { PENALTY_RISE = 100 };

/// Weight of depth in the world where solids grow, 1/(m^2 s); and where a record has a start that is free, at the end.
static const double depth_weight = 1e5, free_depth_weight = 1e7;

/// Penalty of the unactuated force of the first stage, where kinematics come first.
static const double kinematic = 1e-6;

/// Augmented Lagrangian: rounds, iterations a round, tolerance of a round, and the unactuated force from which
/// restoration is safe.
enum { ROUNDS = 6, ROUND_ITERATIONS = 15 };
static const double round_tolerance = 1e-5, near = 1e-3;

/// Unactuated force, fraction of the weight, at which a stage that stalls is the last.
static const double hopeless = 2;

/// Continuation: how often a stage that stalls is taken back; rows that are no farther off where it stalls let it stand.
enum { RETRIES = 3 };
static const double stands = 0.03;

/// Rows of a stage that are in, but for so much.
static const double rows_in = 2e-3;

/// Restoration: iterations of each of its two attempts.
enum { RESTORATIONS = 30 };

/// Diagnosis: iterations towards the least violation, and the relative decrease that ends them.
enum { REST_ITERATIONS = 300 };
static const double rest_tolerance = 1e-8;

static double between(double from, double to, double s) {
  return from > 0 && to > 0 ? from * pow(to / from, s) : (1 - s) * from + s * to;
}

// fraction of the way from which on friction knows at the last knot that nothing moves after it: what it holds there is
// found by then, and what is still on its way is not held against what it has to leave anyway
static const double STOPS_FROM = 0.5;

// part of the cost on forces of what is to be avoided in the world, at first: soft contacts press from afar, where nothing
// touches
static const double avoided = 0.3;

// times that costs on the turning of roots weigh at first, and on the way to the last stage, where a trunk is to be kept still
static const double calm_first = 40, calm_last = 4;

void cav_stage_set(const cav_problem *problem, double x, cav_transcription *tr) {
  cav_stage_law(problem, x, tr->options.timestep, &tr->options);
  tr->options.stops = x >= STOPS_FROM && problem->close_at_rest && !problem->cycle.on;
  tr->penalty = penalised;
  tr->penalty.effort = between(penalised.effort, PENALTY_RISE * penalised.effort, x);
  tr->penalty.range = between(penalised.range, PENALTY_RISE * penalised.range, x);
  tr->penalty.unactuated = cav_schedule_at(&problem->schedule, x).penalty;
  tr->lightened = problem->schedule.light_avoided ? 1 - between(avoided, 1, x) : 0;
  tr->calmed = problem->schedule.calm && x < 1 ? between(calm_first, calm_last, x) - 1 : 0;
  tr->depth_weight = problem->schedule.solids == CAV_SOLIDS_GROW ? depth_weight : 0;
  // nothing has pushed a body out of the floor before its first knot
  if (problem->free_start && cav_problem_has_record(problem))
    tr->depth_weight = between(depth_weight, free_depth_weight, x);
  tr->penalty.term = between(penalised.term, PENALTY_RISE * penalised.term, fmin(2 * x, 1));
}

/// How much of a solve is behind its parts where they begin and end, as a rule; and iterations in which half of a part
/// is done, where it has no stages.
static const double part[CAV_PLACE_TYPES][2] = {
    [CAV_PLACE_CONTINUATION] = {0, 0.65},  [CAV_PLACE_SQP] = {0.65, 0.85},      [CAV_PLACE_MULTIPLIERS] = {0.7, 0.75},
    [CAV_PLACE_RESTORATION] = {0.75, 0.8}, [CAV_PLACE_SQP_AGAIN] = {0.8, 0.85}, [CAV_PLACE_IPOPT] = {0.6, 0.85},
    [CAV_PLACE_DIAGNOSIS] = {0.85, 0.9},   [CAV_PLACE_RECOVERY] = {0.87, 0.92}, [CAV_PLACE_FEEDBACK] = {0.92, 0.97}};
static const double half = 10;

static double done(const cav_solve_run *run) {
  const double *p = part[run->checkpoint.place];
  double n = run->solution->iterations - run->checkpoint.iterations, within = n / (n + half);
  if (run->checkpoint.place == CAV_PLACE_CONTINUATION) within = (run->stage - 1 + within) / run->stages;
  return p[0] + within * (p[1] - p[0]);
}

int cav_run_stop(void *context) {
  cav_solve_run *run = context;
  const cav_solve_options *o = run->options;
  const int refused = run->tr && run->tr->failure.status == CAV_BAD_INPUT;
  const int asked = o->stop ? o->stop(o->stop_context) : 0;
  run->soon |= asked == CAV_STOP_SOON || cav_clock() >= run->deadline;
  run->at_once |= asked != 0 && asked != CAV_STOP_SOON;
  return refused || run->at_once || (run->soon && !run->ending);
}

/// Whether the observer asks for the end.
static int observed(cav_solve_run *run, const cav_progress *line) {
  const cav_solve_options *o = run->options;
  const int asked = o->observer && o->observer(o->observer_context, line);
  run->at_once |= asked;
  return asked;
}

int cav_run_report(void *context, double step, double radius) {
  cav_solve_run *run = context;
  cav_solution *solution = run->solution;
  cav_progress line = {.phase = run->phase, .stage = run->stage, .stages = run->stages, .step = step, .radius = radius};
  line.iteration = ++solution->iterations;
  line.cost = cav_transcription_cost(run->tr);
  line.unactuated = cav_transcription_unactuated(run->tr, &line.knot);
  line.violation = cav_transcription_violation(run->tr);
  line.seconds = cav_clock() - run->start;
  line.fraction = fmax(run->last.fraction, done(run));
  run->last = line;
  if (!run->quiet && !cav_solution_log(solution, &line)) {
    run->failed = CAV_NO_MEMORY;
    return 1;
  }
  if (observed(run, &line)) return 1;
  int most = run->options->max_iterations;
  return (most > 0 && solution->iterations - run->begin >= most) || cav_run_stop(run);
}

int cav_run_feedback(void *context, int trial, int trials) {
  cav_solve_run *run = context;
  cav_progress line = {.phase = run->phase, .stage = trial, .stages = trials, .iteration = run->solution->iterations};
  line.cost = run->solution->cost;
  line.unactuated = cav_transcription_unactuated(run->tr, &line.knot);
  line.violation = cav_transcription_violation(run->tr);
  line.seconds = cav_clock() - run->start;
  const double *p = part[CAV_PLACE_FEEDBACK];
  // of a motion that is stuck gains are asked on the way
  line.fraction =
      run->checkpoint.place == CAV_PLACE_FEEDBACK ? p[0] + (p[1] - p[0]) * (trial - 1) / trials : run->last.fraction;
  return observed(run, &line) || cav_run_stop(run);
}

int cav_run_note(cav_solve_run *run, double fraction, int begin, cav_outcome outcome) {
  cav_stage_record line = {.phase = run->phase, .stage = run->stage, .stages = run->stages, .fraction = fraction};
  line.iterations = run->solution->iterations - begin;
  line.cost = cav_transcription_cost(run->tr);
  line.unactuated = cav_transcription_unactuated(run->tr, NULL);
  line.violation = cav_transcription_violation(run->tr);
  line.outcome = outcome;
  line.seconds = cav_clock() - run->noted;
  run->noted += line.seconds;
  if (!run->quiet && !cav_solution_note(run->solution, &line)) run->failed = CAV_NO_MEMORY;
  return run->failed == CAV_OK;
}

/// How a run of the trust region ended.
static cav_outcome outcome_of(const cav_solve_run *run, cav_status status) {
  if (status != CAV_OK) return CAV_OUTCOME_STOPPED;
  return run->region.stalled ? CAV_OUTCOME_STALLED : run->region.settled ? CAV_OUTCOME_SETTLED : CAV_OUTCOME_LIMIT;
}

/// Copies a trajectory over another one's place; 0 if memory runs out.
static int keep(cav_trajectory **kept, const cav_trajectory *at) {
  cav_trajectory_free(*kept);
  *kept = cav_trajectory_copy(at);
  return *kept != NULL;
}

/// Whether the motion cannot be saved: from half way on, where the penalty of the unactuated force has reached its end,
/// the present stage stands still at such forces. Of 29 motions none that was found had more than 0.6 there.
static int is_hopeless(const cav_solve_run *run, double fraction, cav_outcome outcome) {
  return outcome == CAV_OUTCOME_STALLED && fraction >= 0.5 && fraction < 1 &&
         cav_transcription_unactuated(run->tr, NULL) > hopeless;
}

double cav_run_rows_off(const cav_solve_run *run) {
  return fmax(cav_transcription_unactuated(run->tr, NULL), cav_transcription_violation(run->tr));
}

/// Whether a stage that stalls has done what it is for: its rows are nearly in, and the next law moves the jump that holds it.
static int stage_stands(const cav_solve_run *run) { return cav_run_rows_off(run) < stands; }

cav_status cav_stage_run(cav_solve_run *run, double fraction, cav_outcome *outcome) {
  cav_stage_options stage = cav_schedule_at(&run->problem->schedule, fraction);
  cav_stage_set(run->problem, fraction, run->tr);
  run->region.iterations = stage.iterations;
  run->region.tolerance = stage.tolerance;
  cav_status status = cav_region_minimise(&run->region, run->normal, run->tr, &run->at, &run->spare);
  *outcome = outcome_of(run, status);
  return status;
}

int cav_run_from_guess(const cav_solve_run *run) {
  return run->begin_with == CAV_BEGIN_GUESS && run->options->first_stage <= 1;
}

cav_status cav_kinematics_run(cav_solve_run *run) {
  run->begin_with = CAV_BEGIN_KINEMATICS;
  cav_stage_options stage = cav_schedule_at(&run->problem->schedule, 0);
  int begin = run->solution->iterations;
  run->phase = "kinematics";
  // begun again: what was done is no part of it
  cav_trajectory_free(run->stood);
  run->stood = NULL;
  run->last.fraction = 0;
  run->stage = 1;
  run->stages = run->problem->schedule.stages;
  cav_stage_set(run->problem, 0, run->tr);
  run->tr->penalty.unactuated *= kinematic;
  run->region.iterations = stage.iterations;
  run->region.tolerance = stage.tolerance;
  cav_status status = cav_region_minimise(&run->region, run->normal, run->tr, &run->at, &run->spare);
  run->region.radius = 0;
  return cav_run_note(run, 0, begin, outcome_of(run, status)) ? status : CAV_NO_MEMORY;
}

/// Where continuation begins: the first stage, the one that the options name, or that of a checkpoint.
static void first_stage(cav_solve_run *run, double *fraction, double *settled, int *retries) {
  int stages = run->problem->schedule.stages, first = run->options->first_stage;
  run->stage = first > 1 ? first : 1;
  *retries = 0;
  *fraction = stages > 1 ? (double)(run->stage - 1) / (stages - 1) : 1;
  // the first one is not taken back
  *settled = run->stage > 1 ? *fraction : 0;
  if (!run->resume) return;
  run->stage = run->resume->stage;
  *fraction = run->resume->fraction;
  *settled = run->resume->settled;
  *retries = run->resume->retries;
}

cav_status cav_continuation_run(cav_solve_run *run) {
  int stages = run->problem->schedule.stages, retries = 0, begin;
  double fraction, settled; // of this stage, and of the one before it
  cav_trajectory *before = NULL;
  cav_status status = CAV_OK;
  if (run->options->first_stage > stages || (run->resume && run->resume->place > CAV_PLACE_CONTINUATION)) return status;
  run->phase = "continuation";
  run->stages = stages;
  first_stage(run, &fraction, &settled, &retries);
  while (status == CAV_OK) {
    cav_outcome outcome = CAV_OUTCOME_STOPPED;
    run->checkpoint.fraction = fraction;
    run->checkpoint.settled = settled;
    run->checkpoint.retries = retries;
    if (!cav_run_reaches(run, CAV_PLACE_CONTINUATION, &status)) break;
    begin = run->solution->iterations;
    status = keep(&before, run->at) ? cav_stage_run(run, fraction, &outcome) : CAV_NO_MEMORY;
    if (!before) break;
    int again =
        outcome == CAV_OUTCOME_STALLED && retries < RETRIES && fraction > settled && fraction < 1 && !stage_stands(run);
    if (again) outcome = CAV_OUTCOME_AGAIN;
    if (!cav_run_note(run, fraction, begin, outcome)) status = CAV_NO_MEMORY;
    const int stands_here = status == CAV_OK && !again && fraction >= 0.5 && cav_run_rows_off(run) < rows_in;
    if (stands_here && !keep(&run->stood, run->at)) status = CAV_NO_MEMORY;
    if (outcome == CAV_OUTCOME_AGAIN || outcome == CAV_OUTCOME_STALLED) run->region.radius = 0;
    if (status != CAV_OK || (!again && run->stage == stages && fraction >= 1)) break;
    if (!again && is_hopeless(run, fraction, outcome)) {
      cav_stage_set(run->problem, 1, run->tr);
      status = cav_transcription_values(run->tr, run->at);
      if (status == CAV_OK) status = CAV_NOT_CONVERGED;
      break;
    }
    if (again) {
      cav_run_exchange(&run->at, &before);
      retries++;
      fraction = 0.5 * (settled + fraction);
      continue;
    }
    // on to the stage that was due, or to the next
    double due = stages > 1 ? (double)(run->stage - 1) / (stages - 1) : 1;
    settled = fraction;
    if (fraction < due) {
      fraction = due;
      continue;
    }
    retries = 0;
    fraction = (double)run->stage++ / (stages - 1);
  }
  cav_trajectory_free(before);
  return status;
}

/// Largest violation of each kind of row, and how much of it is allowed: what is planned with headroom may use half of
/// that.
typedef struct violation {
  double unactuated, effort, range, term;
  double weighed; ///< unactuated, of light bodies too as a fraction of the whole weight: what a certificate tells
} violation;

static violation measure(const cav_transcription *tr) {
  violation m = {0};
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    for (int i = 0; i < knot->layout.count; i++) {
      double e = cav_slot_excess(&knot->slot[i]);
      double *worst = i < knot->layout.effort  ? &m.unactuated
                      : i < knot->layout.joint ? &m.effort
                      : i < knot->layout.term  ? &m.range
                                               : &m.term;
      *worst = fmax(*worst, e);
      if (i < knot->layout.effort) m.weighed = fmax(m.weighed, e * tr->fraction[i - knot->layout.unactuated]);
    }
  }
  return m;
}

static violation allowed(const cav_solve_run *run) {
  double tolerance = run->options->tolerance;
  return (violation){tolerance, fmax(0.5 * (1 - run->problem->effort_limit), tolerance),
                     fmax(0.5 * run->problem->limit_margin, tolerance), tolerance, tolerance};
}

static int holds(const violation *m, const violation *most) {
  return m->unactuated <= most->unactuated && m->effort <= most->effort && m->range <= most->range &&
         m->term <= most->term;
}

void cav_run_allowed(const cav_solve_run *run, double allowance[CAV_BINDING_KINDS]) {
  violation most = allowed(run);
  allowance[CAV_BINDING_UNACTUATED] = most.unactuated;
  allowance[CAV_BINDING_EFFORT] = most.effort;
  allowance[CAV_BINDING_JOINT] = allowance[CAV_BINDING_TENDON] = most.range;
  allowance[CAV_BINDING_TERM] = most.term;
  allowance[CAV_BINDING_PENETRATION] = CAV_TOLERANCE_PENETRATION;
}

int cav_run_certifiable(const cav_solve_run *run) {
  violation most = allowed(run), is = measure(run->tr);
  is.unactuated = is.weighed;
  most.unactuated = fmax(most.unactuated, CAV_TOLERANCE_UNACTUATED);
  most.term = fmax(most.term, CAV_TOLERANCE_CONSTRAINT);
  // a limit may be passed by its headroom, and a little
  most.effort = fmax(most.effort, 1 - run->problem->effort_limit + CAV_TOLERANCE_LIMIT);
  most.range = fmax(most.range, run->problem->limit_margin + CAV_TOLERANCE_LIMIT);
  return holds(&is, &most);
}

int cav_run_within_limits(const cav_solve_run *run) {
  const violation is = measure(run->tr);
  return fmax(is.effort, is.range) <= CAV_TOLERANCE_LIMIT;
}

int cav_run_met(const cav_solve_run *run) {
  violation most = allowed(run), is = measure(run->tr);
  return holds(&is, &most);
}

int cav_run_weighed_met(const cav_solve_run *run) {
  violation most = allowed(run), is = measure(run->tr);
  is.unactuated = is.weighed;
  return holds(&is, &most);
}

int cav_run_exact(const cav_solve_run *run) {
  const violation is = measure(run->tr);
  return cav_run_met(run) && fmax(is.effort, is.range) <= 0.5 * CAV_TOLERANCE_LIMIT;
}

cav_status cav_augmented_lagrangian(cav_solve_run *run) {
  violation most = allowed(run);
  most.unactuated = fmax(most.unactuated, near);
  most.term = fmax(most.term, near);
  run->phase = "multipliers";
  run->stages = ROUNDS;
  cav_status status = cav_transcription_values(run->tr, run->at);
  int first = run->resume && run->resume->place == CAV_PLACE_MULTIPLIERS ? run->resume->stage - 1 : 0;
  for (int round = first; round < ROUNDS && status == CAV_OK; round++) {
    int begin = run->solution->iterations;
    run->stage = round + 1;
    if (!cav_run_reaches(run, CAV_PLACE_MULTIPLIERS, &status)) break;
    cav_transcription_multipliers(run->tr);
    run->region.iterations = ROUND_ITERATIONS;
    run->region.tolerance = round_tolerance;
    status = cav_region_minimise(&run->region, run->normal, run->tr, &run->at, &run->spare);
    violation is = measure(run->tr);
    if (!cav_run_note(run, 1, begin, outcome_of(run, status))) status = CAV_NO_MEMORY;
    if (round > 0 && holds(&is, &most)) break;
  }
  return status;
}

/// Restoration until no row is further off than that, with rows of efforts and ranges let go by a fraction of it.
static cav_status restore(cav_solve_run *run, violation most, double fraction) {
  violation is = {0};
  cav_transcription *tr = run->tr;
  int begin = run->solution->iterations;
  cav_region region = run->region;
  region.radius = INFINITY;
  region.iterations = 1;
  region.tolerance = 0;
  cav_trajectory *entry = cav_trajectory_copy(run->at);
  if (!entry) return CAV_NO_MEMORY;
  tr->constraints_only = 1;
  tr->slack_effort = fraction * most.effort;
  tr->slack_range = fraction * most.range;
  cav_status status = CAV_OK;
  for (int i = 0; i < RESTORATIONS && status == CAV_OK; i++) {
    status = cav_region_minimise(&region, run->normal, tr, &run->at, &run->spare);
    is = measure(tr);
    if (holds(&is, &most)) break;
  }
  tr->constraints_only = 0;
  tr->slack_effort = tr->slack_range = 0;
  run->region.done = region.done;
  run->region.seconds_linear = region.seconds_linear;
  cav_outcome outcome = status != CAV_OK    ? CAV_OUTCOME_STOPPED
                        : holds(&is, &most) ? CAV_OUTCOME_SETTLED
                                            : CAV_OUTCOME_STALLED;
  if (!cav_run_note(run, 1, begin, outcome)) status = CAV_NO_MEMORY;
  // what cannot be brought in stays as it was: steps that chase the impossible lead far away
  if (status == CAV_OK && !holds(&is, &most)) {
    cav_run_exchange(&run->at, &entry);
    status = cav_transcription_values(tr, run->at);
    if (status == CAV_OK) status = CAV_NOT_CONVERGED;
  }
  cav_trajectory_free(entry);
  return status;
}

cav_status cav_restore(cav_solve_run *run) {
  run->phase = "restoration";
  run->stages = 2;
  run->stage = 1;
  cav_trajectory *before = cav_trajectory_copy(run->at);
  if (!before) return CAV_NO_MEMORY;
  cav_status status = restore(run, allowed(run), 0.9);
  if (status != CAV_NOT_CONVERGED) {
    cav_trajectory_free(before);
    return status;
  }
  // rows that do not come in: again from where it started, with nothing let go
  run->stage = 2;
  cav_trajectory_free(run->at);
  run->at = before;
  return restore(run, allowed(run), 0);
}

cav_status cav_restore_limits(cav_solve_run *run) {
  violation most = allowed(run);
  most.effort = most.range = 0.5 * CAV_TOLERANCE_LIMIT;
  if (!cav_run_met(run) || cav_run_within_limits(run)) return CAV_OK;
  run->phase = "restoration";
  run->stage = run->stages = 1;
  const cav_status status = restore(run, most, 0);
  return status == CAV_NOT_CONVERGED ? CAV_OK : status;
}

static cav_status rest_from_here(cav_solve_run *run, double radius) {
  int begin = run->solution->iterations;
  run->region.radius = radius;
  cav_status status = cav_region_minimise(&run->region, run->normal, run->tr, &run->at, &run->spare);
  return cav_run_note(run, 1, begin, outcome_of(run, status)) ? status : CAV_NO_MEMORY;
}

/// Whether every row nearly holds.
static int is_near(const cav_solve_run *run) {
  violation is = measure(run->tr), most = {near, near, near, near, near};
  return holds(&is, &most);
}

cav_status cav_minimise_infeasibility(cav_solve_run *run) {
  run->phase = "diagnosis";
  run->stages = 2;
  run->stage = 1;
  run->region.iterations = REST_ITERATIONS;
  run->region.tolerance = rest_tolerance;
  run->tr->constraints_only = 1;
  cav_status status = rest_from_here(run, INFINITY);
  cav_trajectory *first = status == CAV_OK ? cav_trajectory_copy(run->at) : NULL;
  if (status == CAV_OK && !first) status = CAV_NO_MEMORY;
  if (status == CAV_OK && !is_near(run)) {
    // what stalled on the way may lie far from where the guess leads; what is nearly there does not
    double merit = cav_transcription_merit(run->tr);
    run->stage = 2;
    status = cav_guess_take(run);
    if (status == CAV_OK) status = rest_from_here(run, 0);
    if (status != CAV_OK || !(cav_transcription_merit(run->tr) < merit)) {
      cav_run_exchange(&run->at, &first);
      if (status == CAV_OK) status = cav_transcription_values(run->tr, run->at);
    }
  }
  cav_trajectory_free(first);
  run->tr->constraints_only = 0;
  return status;
}

cav_status cav_recover_feasible(cav_solve_run *run) {
  cav_trajectory *feasible = cav_trajectory_copy(run->at);
  if (!feasible) return CAV_NO_MEMORY;
  cav_outcome outcome;
  int begin = run->solution->iterations;
  for (int t = 0; t < run->tr->nknot; t++)
    for (int i = 0; i < run->tr->knot[t].layout.count; i++) run->tr->knot[t].slot[i].multiplier = 0;
  run->phase = "recovery";
  run->stage = run->stages = 1;
  run->region.radius = 0;
  run->nested = 1;
  cav_status status = cav_stage_run(run, 1, &outcome);
  if (!cav_run_note(run, 1, begin, outcome)) status = CAV_NO_MEMORY;
  if (status == CAV_OK) status = cav_to_optimum(run);
  run->nested = 0;
  if (status == CAV_NOT_CONVERGED) {
    // a motion that is possible is worth more than a cheaper one that is not
    cav_run_exchange(&run->at, &feasible);
    status = cav_transcription_values(run->tr, run->at);
  }
  cav_trajectory_free(feasible);
  return status;
}
