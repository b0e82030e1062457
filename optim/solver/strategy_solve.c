/// A solve by a strategy: what it lays over the problem, and where it begins: with hands led, what is moved lying until met, a
/// sampled motion, a posture that terms ask for, or the end of another order.
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "carry.h"
#include "continuation.h"
#include "gait.h"
#include "hand.h"
#include "sampling.h"

/// How much longer than stated a diagnosis may last.
enum { LONGER = 2 };

/// What the duration of a diagnosis costs, 1/s², so that it is not far from the shortest.
static const double haste = 100;

/// Where a sampled motion goes on, of the schedule's way, where it does not straight to the optimum.
static const double late = 0.9;

/// Where a motion solved under another order goes on: fraction of the schedule's way, and stages from there (METHOD.md,
/// 7).
static const double resumed_fraction = 0.4;
enum { RESUMED_STAGES = 10 };

_Static_assert((int)CAV_HAND_TERMS <= (int)CAV_CARRY_TERMS, "the room for terms that lead");

void cav_strategy_apply(const cav_problem *problem, const cav_strategy *strategy, cav_problem *taken) {
  *taken = *problem;
  taken->guess = strategy->guess;
  taken->schedule = strategy->schedule;
  taken->order = strategy->order;
  if (strategy->timestep > 0) taken->timestep = strategy->timestep;
  if (strategy->effort_limit > 0) taken->effort_limit = strategy->effort_limit;
  if (strategy->strength > 0) taken->strength = strategy->strength;
  if (strategy->term) taken->term = strategy->term, taken->nterm = strategy->nterm;
  if (strategy->open) {
    taken->close_at_rest = 0;
  } else if (strategy->use == CAV_STRATEGY_DIAGNOSIS && strategy->strength == 0) {
    taken->duration_least = problem->duration;
    taken->duration_most = LONGER * problem->duration;
    taken->duration_weight = haste;
  }
  if (strategy->left) taken->guess_pose = problem->guess_left;
  if (strategy->stated) return;
  taken->guess_height = strategy->height;
  taken->guess_ground = strategy->ground;
  if (strategy->height > 0) taken->guess_from = strategy->from, taken->guess_to = strategy->to;
  memcpy(taken->guess_bow, strategy->bow, sizeof taken->guess_bow);
  const int bowed = strategy->bow[0] != 0 || strategy->bow[1] != 0;
  if (bowed) taken->guess_from = 0, taken->guess_to = problem->duration;
  memset(taken->guess_rotation, 0, sizeof taken->guess_rotation);
  taken->nguess_pose = 0;
  taken->nswing = strategy->nswing;
  taken->swing = (cav_swing *)strategy->swing;
  if (strategy->flies) taken->nguess_pose = 2, taken->guess_pose = (cav_guess_pose *)strategy->pose;
}

/// The schedule from where contacts are half hard.
static cav_schedule resumed(const cav_schedule *schedule) {
  cav_schedule rest = *schedule;
  rest.first = cav_schedule_at(schedule, resumed_fraction);
  rest.stages = RESUMED_STAGES;
  return rest;
}

/// Fraction of the cost that a step may still save where both hands have led, since terms that are no part of the problem are in
/// it, and at the end of another order, from where a solve begins by softer laws.
static const double leads_to = 0.05;

/// What leads a guess: terms that are no part of the problem, and what the guess passes.
typedef struct leading {
  cav_hand hand;
  cav_carry carry;
  cav_guess_pose pose[CAV_CARRY_POSES];
  cav_strategy gait;
  cav_term *term;
  double *q;
} leading;

static void add_terms(const cav_problem *problem, const cav_term *more, int n, leading *l, cav_problem *led) {
  assert(n <= CAV_CARRY_TERMS);
  memcpy(l->term, problem->term, (size_t)problem->nterm * sizeof *l->term);
  memcpy(l->term + problem->nterm, more, (size_t)n * sizeof *more);
  led->term = l->term, led->nterm = problem->nterm + n;
}

/// By both hands: the base goes along, by a gait where it goes far. A guess of the problem's own passes what it states.
static cav_status lead_both(const cav_problem *problem, double away, leading *l, cav_problem *led) {
  cav_status status = cav_carry_find(problem, away, &l->carry);
  if (status) return status;
  add_terms(problem, l->carry.term, l->carry.found, l, led);
  if (!l->carry.lifts || l->carry.over > 0) led->schedule.kinematics = 1;
  led->schedule.optimality = leads_to;
  if (cav_guess_is_decorated(problem) || !l->carry.found) return CAV_OK;
  const int poses = cav_carry_poses(problem, &l->carry, l->q, l->pose);
  cav_problem moved = *problem;
  int turns;
  moved.q_goal = l->q + (size_t)(poses - 1) * (size_t)problem->model->nq;
  status = cav_gait_find(&moved, &l->gait, &turns);
  led->guess = CAV_GUESS_INTERPOLATE;
  led->guess_pose = l->pose, led->nguess_pose = poses;
  if (!turns) led->swing = l->gait.swing, led->nswing = l->gait.nswing;
  return status;
}

static cav_status lead_one(const cav_problem *problem, double away, leading *l, cav_problem *led) {
  cav_status status = cav_hand_find(problem, away, &l->hand);
  if (status) return status;
  add_terms(problem, l->hand.term, l->hand.found, l, led);
  led->schedule = cav_hand_schedule(&problem->schedule);
  return CAV_OK;
}

/// To where hands lead a guess.
static cav_status lead(const cav_problem *problem, int hands, double away, const cav_solve_options *options,
                       const cav_solution *before, cav_solution **solution, cav_error *error) {
  cav_problem led = *problem;
  cav_solve_options first = *options;
  leading l = {.term = calloc((size_t)problem->nterm + CAV_CARRY_TERMS, sizeof *l.term)};
  l.q = malloc(CAV_CARRY_POSES * (size_t)problem->model->nq * sizeof *l.q);
  cav_status status = !l.term || !l.q ? CAV_NO_MEMORY
                      : hands == 2    ? lead_both(problem, away, &l, &led)
                                      : lead_one(problem, away, &l, &led);
  *solution = NULL;
  if (!status) {
    first.diagnose = first.gains = 0;
    status = cav_solve_after(&led, &first, NULL, before, solution, error);
  }
  free(l.term);
  free(l.q);
  return status;
}

/// Unactuated force, fraction of the weight, beyond which a motion that pushes is given up.
static const double far_off = 5e-3;

/// Whether a motion that a solve did not bring to its tolerance has what a certificate asks of rows, and gains: those of what
/// comes to rest come in slowly.
static int is_settled(const cav_solution *solution) { return solution->holds && solution->gain_q; }

/// By a hand first, that touches what it pushes or leans on it, and from there to the end of a solve; where rows do not come
/// in, by the last stage before it. The first way whose rows do. A checkpoint of it is not gone on from: it begins anew, and
/// ends with the same bits.
static cav_status solve_pushed(const cav_problem *taken, int hands, const cav_solve_options *options,
                               cav_solution **solution, cav_error *error) {
  static const double away[] = {1, 0.7};
  enum { WAYS = sizeof away / sizeof *away, ENDS = 2 };
  cav_problem last = *taken;
  cav_solve_options rest = options ? *options : cav_solve_options_default();
  cav_solution *before = NULL;
  cav_status status = CAV_NOT_CONVERGED;
  last.schedule = cav_hand_schedule(&taken->schedule);
  last.schedule.kinematics = 0;
  rest.resume = NULL;
  rest.diagnose = 0; // what is least violated stands still
  for (int i = 0; i < WAYS && status == CAV_NOT_CONVERGED; i++) {
    rest.first_stage = 0;
    status = lead(taken, hands, away[i], &rest, before, solution, error);
    cav_trajectory *start = *solution ? cav_trajectory_copy((*solution)->trajectory) : NULL;
    if (*solution && !start) status = CAV_NO_MEMORY;
    // one that was stopped, or has no motion, ends here
    int ends = start && (status == CAV_OK || status == CAV_NOT_CONVERGED);
    for (int k = 0; k < ENDS && ends; k++) {
      cav_solution_free(before);
      before = *solution;
      rest.first_stage = last.schedule.stages + 1 - k;
      status = cav_solve_after(&last, &rest, start, before, solution, error);
      if (status == CAV_NOT_CONVERGED && *solution && is_settled(*solution)) status = CAV_OK;
      ends = status == CAV_NOT_CONVERGED && *solution;
    }
    cav_solution_free(before);
    before = *solution;
    cav_trajectory_free(start);
    // what is far off is not pushed by leaning on it
    if (status == CAV_NOT_CONVERGED && before && before->unactuated > far_off) break;
  }
  *solution = before;
  return status;
}

/// From a motion that pushes, which softer contacts would lose.
static cav_status mend_pushed(cav_problem *taken, const cav_solve_options *options, const cav_trajectory *start,
                              cav_solution **solution, cav_error *error) {
  cav_solve_options rest = options ? *options : cav_solve_options_default();
  taken->schedule = cav_hand_schedule(&taken->schedule);
  taken->schedule.kinematics = 0;
  rest.first_stage = taken->schedule.stages;
  rest.diagnose = 0;
  return cav_solve(taken, &rest, start, solution, error);
}

/// From a guess that goes to where the strategy has joints at the end. A checkpoint of it is not gone on from either.
static cav_status solve_reached(const cav_problem *taken, const cav_strategy *strategy,
                                const cav_solve_options *options, cav_solution **solution, cav_error *error) {
  const cav_model *m = taken->model;
  cav_problem moved = *taken;
  cav_solve_options begun = options ? *options : cav_solve_options_default();
  begun.resume = NULL;
  double *q = malloc((size_t)m->nq * sizeof *q);
  cav_trajectory *at = cav_trajectory_new(m, (int)lround(taken->duration / taken->timestep) + 1, taken->timestep);
  cav_status status = q && at ? CAV_OK : CAV_NO_MEMORY;
  if (!status) {
    memcpy(q, taken->q_start, (size_t)m->nq * sizeof *q);
    for (int k = 0; k < strategy->nreach; k++) q[m->joint[strategy->reach[k].joint].q] = strategy->reach[k].to;
    moved.q_goal = q;
    status = cav_guess_fill(&moved, q, at);
  }
  *solution = NULL;
  if (!status) status = cav_solve(taken, &begun, at, solution, error);
  cav_trajectory_free(at);
  free(q);
  return status;
}

/// From the best of simulated motions, which obeys the last stage's law: straight to the optimum, and where that loses it, so
/// that its rows do not come in or costs are higher than they were, by the last stages. The cheaper of motions whose rows
/// come in.
static cav_status solve_sampled(const cav_problem *taken, int number, const cav_solve_options *options,
                                cav_solution **solution, cav_error *error) {
  const int from[] = {taken->schedule.stages + 1, (int)(late * taken->schedule.stages)};
  enum { WAYS = sizeof from / sizeof *from };
  cav_solve_options rest = options ? *options : cav_solve_options_default();
  cav_trajectory *at =
      cav_trajectory_new(taken->model, (int)lround(taken->duration / taken->timestep) + 1, taken->timestep);
  double score;
  cav_status kept = CAV_NOT_CONVERGED,
             status = at ? cav_sample_fill(taken, &rest, number, at, &score, error) : CAV_NO_MEMORY;
  int lost = !status;
  *solution = NULL;
  rest.resume = NULL;
  rest.diagnose = 0; // what is least violated stands still
  rest.leave_refused = 0;
  for (int i = 0; i < WAYS && lost; i++) {
    cav_solution *found = NULL;
    rest.first_stage = from[i];
    status = cav_solve_after(taken, &rest, at, *solution, &found, error);
    lost = status == CAV_NOT_CONVERGED || (!status && found->cost > score);
    const int worse = kept == CAV_OK && lost && (status || found->cost >= (*solution)->cost);
    if (worse || !found) {
      cav_solution_free(found);
    } else {
      cav_solution_free(*solution);
      *solution = found, kept = status;
    }
  }
  cav_trajectory_free(at);
  return *solution && (!status || status == CAV_NOT_CONVERGED) ? kept : status;
}

/// From a guess in which what is moved stays as it is at the start until it is met.
static cav_status solve_met(const cav_problem *taken, const cav_strategy *strategy, const cav_solve_options *options,
                            cav_solution **solution, cav_error *error) {
  const cav_model *m = taken->model;
  const cav_joint *joint = &m->joint[strategy->moved];
  const int size = joint->type == CAV_JOINT_FREE ? 7 : joint->type == CAV_JOINT_BALL ? 4 : 1;
  cav_problem met = *taken;
  cav_trajectory *at = cav_trajectory_new(m, (int)lround(taken->duration / taken->timestep) + 1, taken->timestep);
  cav_status status = at ? cav_guess_fill(taken, taken->q_goal, at) : CAV_NO_MEMORY;
  cav_guess_pose pose = {strategy->met, NULL};
  *solution = NULL;
  if (!status) {
    double *q = at->q + (size_t)lround(strategy->met / taken->timestep) * (size_t)m->nq;
    memcpy(q + joint->q, taken->q_start + joint->q, (size_t)size * sizeof *q);
    pose.q = q;
    met.guess_pose = &pose, met.nguess_pose = 1;
    status = cav_solve(&met, options, NULL, solution, error);
  }
  cav_trajectory_free(at);
  return status;
}

cav_status cav_strategy_solve(const cav_problem *problem, const cav_strategy *strategy,
                              const cav_solve_options *options, const cav_trajectory *start, cav_solution **solution,
                              cav_error *error) {
  cav_problem taken;
  cav_strategy_apply(problem, strategy, &taken);
  if (strategy->hand && !start) return solve_pushed(&taken, strategy->hand, options, solution, error);
  if (strategy->samples && !start) return solve_sampled(&taken, strategy->samples, options, solution, error);
  if (strategy->met > 0 && !start) return solve_met(&taken, strategy, options, solution, error);
  if (strategy->nreach && !start) return solve_reached(&taken, strategy, options, solution, error);
  const cav_checkpoint *resume = options ? options->resume : NULL;
  int second = resume && resume->order == strategy->order;
  if (!strategy->first_midpoint || start || second) {
    int staged = !options || options->first_stage <= taken.schedule.stages;
    int mended = start && strategy->use == CAV_STRATEGY_REPAIR && staged;
    if (mended && strategy->hand) return mend_pushed(&taken, options, start, solution, error);
    if (mended || (strategy->first_midpoint && second)) taken.schedule = resumed(&taken.schedule);
    return cav_solve(&taken, options, start, solution, error);
  }
  cav_solve_options first = options ? *options : cav_solve_options_default(), rest = first;
  cav_solution *before = NULL;
  first.diagnose = first.gains = 0;
  rest.resume = NULL;
  const double optimality = taken.schedule.optimality;
  taken.order = CAV_ORDER_MIDPOINT;
  taken.schedule.optimality = leads_to;
  cav_status status = cav_solve(&taken, &first, NULL, &before, error);
  taken.schedule.optimality = optimality;
  // one that was stopped, or has no motion, ends here
  if (!before || (status != CAV_OK && status != CAV_NOT_CONVERGED)) {
    *solution = before;
    return status;
  }
  taken.order = strategy->order;
  taken.schedule = resumed(&taken.schedule);
  status = cav_solve_after(&taken, &rest, before->trajectory, before, solution, error);
  cav_solution_free(before);
  return status;
}
