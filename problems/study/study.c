/// One run of a study: the problem with a start, masses and friction that differ a little from its file, by a generator
/// that depends on the number of the start alone, so that every method meets the same ones.
#include "study.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "edit.h"
#include "file.h"
#include "race.h"
#include "random.h"
#include "result_file.h"
#include "store.h"

const char *const cav_study_method_names[CAV_STUDY_METHODS] = {"own", "strategies", "ipopt", "limited", "both"};

static const double joint_noise = 0.03, mass_noise = 0.05, friction_noise = 0.25;

static double processor_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/// Lowest gap [nlink] between the tree of each root link and the world, seen from afar through the activation distance of
/// the smoothed law; infinite if nothing is near.
static cav_status lowest_gaps(const cav_model *m, cav_state *state, const double *q, double *gap) {
  state->options.smoothing = state->options.smoothing_self = 1;
  cav_status status = cav_position(m, state, q);
  for (int i = 0; i < m->nlink; i++) gap[i] = INFINITY;
  for (int i = 0; i < state->ncontact && !status; i++) {
    const cav_contact *c = &state->contact[i];
    if (c->link1 > 0 && c->link2 > 0) continue;
    double *of = &gap[m->link[c->link1 > 0 ? c->link1 : c->link2].root];
    *of = fmin(*of, c->dist);
  }
  return status;
}

/// Moves a root link that can along the vertical.
static void lift(const cav_model *m, int root, double *q, double height) {
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (joint->link != root) continue;
    if (joint->type == CAV_JOINT_FREE) q[joint->q + 2] += height;
    if (joint->type == CAV_JOINT_SLIDE && fabs(joint->axis[2]) > 0.9) q[joint->q] += height / joint->axis[2];
  }
}

static int is_root(const cav_model *m, const cav_joint *joint) {
  return m->link[joint->link].parent == 0 && (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_SLIDE);
}

/// Joints a little elsewhere, within their ranges; the root of each tree so that its lowest point is where it was.
static cav_status perturb_posture(const cav_model *m, double *q, uint64_t *seed) {
  cav_state *state = cav_state_new(m);
  double *before = malloc(2 * (size_t)m->nlink * sizeof *before), *after = before ? before + m->nlink : NULL;
  cav_status status = state && before ? lowest_gaps(m, state, q, before) : CAV_NO_MEMORY;
  for (int j = 0; j < m->njoint && !status; j++) {
    const cav_joint *joint = &m->joint[j];
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    double shift = cav_random_uniform(seed);
    if (!scalar || is_root(m, joint)) continue;
    double width = joint->limited ? fmin(1, joint->range[1] - joint->range[0]) : 1, *x = q + joint->q;
    *x += joint_noise * width * shift;
    if (joint->limited) *x = fmin(fmax(*x, joint->range[0]), joint->range[1]);
  }
  if (!status) status = lowest_gaps(m, state, q, after);
  for (int i = 1; i < m->nlink && !status; i++)
    if (isfinite(before[i]) && isfinite(after[i])) lift(m, i, q, before[i] - after[i]);
  cav_state_free(state);
  free(before);
  return status;
}

cav_status cav_study_perturb(cav_problem *p, int start) {
  // the model is the problem's own, and no state of it lives
  cav_model *m = (cav_model *)p->model;
  uint64_t seed = 1000003u * (uint64_t)(start + 1);
  double *scale = malloc((size_t)m->nlink * sizeof *scale);
  if (!scale) return CAV_NO_MEMORY;
  for (int i = 0; i < m->nlink; i++) scale[i] = 1 + mass_noise * cav_random_uniform(&seed);
  // a cycle that mirrors needs a model that is its own image: all masses by one factor
  for (int i = 1; i < m->nlink && p->cycle.mirror != CAV_MIRROR_NONE; i++) scale[i] = scale[0];
  // of what each geom has: at one friction for all a box that the file lets slide tips where it is pushed
  cav_model_scale_friction(m, 1 + friction_noise * cav_random_uniform(&seed));
  cav_status status = cav_model_perturb(m, scale, 0);
  free(scale);
  return status ? status : perturb_posture(m, p->q_start, &seed);
}

// when a run that is one solve began and how long it may take
typedef struct clock_of_run {
  double begin, most;
} clock_of_run;

static int observe(void *context, const cav_progress *progress) {
  const clock_of_run *c = context;
  (void)progress;
  return processor_seconds() - c->begin > c->most;
}

static cav_solve_options options_of(cav_study_method method, clock_of_run *clock) {
  static const cav_ipopt_option limited[] = {{"hessian_approximation", "limited-memory"}};
  cav_solve_options o = cav_solve_options_default();
  o.solver = method == CAV_STUDY_OWN    ? CAV_SOLVER_GAUSS_NEWTON
             : method == CAV_STUDY_BOTH ? CAV_SOLVER_BOTH
                                        : CAV_SOLVER_IPOPT;
  if (method == CAV_STUDY_LIMITED) o.ipopt = limited, o.nipopt = 1;
  o.diagnose = 0;
  o.observer = observe;
  o.observer_context = clock;
  return o;
}

static void take(cav_study_run *run, const char *strategy, double cost, const cav_verdict *verdict) {
  run->known = 1;
  run->certified = verdict->certified;
  run->achieved = verdict->achieved;
  run->cost = cost;
  run->unactuated = verdict->unactuated_force_max;
  run->end_error = verdict->closed_loop_end_error_m;
  snprintf(run->strategy, sizeof run->strategy, "%s", strategy);
}

// why a motion is not certified, or not what was asked
static void say_why(const cav_verdict *v, const char *after, char reason[480]) {
  *reason = 0;
  if (!v->certified)
    snprintf(reason, 480, "%.430s%s", v->reason, after);
  else if (!v->achieved)
    snprintf(reason, 480, "certified, and misses %.400s%s", v->missed, after);
}

// by the problem's own strategy; one that was stopped is checked like any other
static cav_status solve_stated(const cav_problem *problem, cav_study_run *run, clock_of_run *clock, char reason[480],
                               cav_error *error) {
  cav_strategy strategy[CAV_STRATEGIES];
  cav_solve_options options = options_of(run->method, clock);
  cav_solution *solution = NULL;
  cav_verdict verdict;
  int n = 0;
  cav_status status = cav_strategy_list(problem, strategy, &n);
  cav_strategies_clear(strategy + 1, n > 0 ? n - 1 : 0); // the first one has the problem's terms
  if (status) return cav_file_fail(error, status, 0, "strategies cannot be listed: %s", cav_status_name(status));
  status = cav_strategy_solve(problem, &strategy[0], &options, NULL, &solution, error);
  if (solution) status = cav_verify_solution(problem, solution, &verdict, error);
  if (solution && !status) {
    take(run, strategy[0].name, solution->cost, &verdict);
    run->iterations = solution->iterations;
    say_why(&verdict, "", reason);
  }
  cav_solution_free(solution);
  return status;
}

// as cavort solve does, one process at a time; the time that is left is the race's
static cav_status solve_race(const cav_problem *problem, const cav_study_task *task, cav_study_run *run,
                             const clock_of_run *clock, char reason[480], cav_error *error) {
  static volatile sig_atomic_t never;
  cav_race race = {.problem = problem,
                   .options = cav_solve_options_default(),
                   .folder = task->folder,
                   .key = "",
                   .interrupted = &never,
                   .processes = 1};
  double before = processor_seconds() - clock->begin;
  // nothing is left once the time is over, and no time is no limit
  race.most_seconds = fmax(clock->most - before, 1e-9);
  if (task->folder) cav_store_remove(task->folder);
  cav_status status = task->folder ? cav_result_folder(task->folder, error) : CAV_OK;
  if (!status) status = cav_race_open(&race, CAV_STRATEGIES, error);
  if (!status) status = cav_race_first(&race, error);
  if (!status && !cav_race_success(&race.entry[0].report)) status = cav_race_finish(&race, 0, error);
  int best = status ? -1 : cav_race_best(&race, 0);
  for (int i = 0; i < race.n; i++)
    if (race.entry[i].report.solution) run->iterations += race.entry[i].report.verdict.iterations;
  if (best >= 0) {
    const cav_race_report *report = &race.entry[best].report;
    int over = !cav_race_success(report) && cav_race_seconds(&race) >= race.most_seconds;
    take(run, race.entry[best].strategy.name, report->cost, &report->verdict);
    say_why(&report->verdict, over ? "; then its time was over" : "", reason);
    if (task->tried) status = cav_race_write(&race, best, task->tried, error);
  }
  run->seconds = before + cav_race_seconds(&race);
  cav_race_close(&race);
  if (task->folder) cav_store_remove(task->folder);
  return status;
}

cav_status cav_study_solve(const cav_study_task *task, cav_study_run *run, char reason[480], cav_error *error) {
  clock_of_run clock = {processor_seconds(), task->seconds};
  cav_problem *problem = cav_problem_load(task->problem, task->model, error);
  if (!problem) return error->status;
  cav_status status = cav_study_perturb(problem, run->start);
  if (status)
    cav_file_fail(error, status, 0, "%s: cannot be perturbed: %s", task->problem, cav_status_name(status));
  else if (run->method == CAV_STUDY_STRATEGIES)
    status = solve_race(problem, task, run, &clock, reason, error);
  else
    status = solve_stated(problem, run, &clock, reason, error);
  if (run->method != CAV_STUDY_STRATEGIES || !run->known) run->seconds = processor_seconds() - clock.begin;
  cav_problem_free(problem);
  return status;
}
