/// Strategies solved by processes: a child solves and certifies, reports through a pipe and waits; told to, it saves
/// what it has, and where the pipe closes it ends. So a solution stays in the process that found it. Which one is kept
/// depends on the reports alone: whatever comes after one that succeeds (certified, and what was asked is achieved) is
/// cancelled, what comes before it is waited for.
#include "race.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "csv.h"
#include "exit_status.h"
#include "file.h"
#include "rank.h"
#include "store.h"

// how much more than the cheapest one a motion may cost that is repaired
static const double dearer = 2;

// how often one motion is mended from where it is
enum { REPAIRS_OF_ONE = 2 };

// part of the duration from which on a knot is near the end
static const double near_end = 0.75;

cav_status cav_race_open(cav_race *race, int most, cav_error *error) {
  cav_strategy strategy[CAV_STRATEGIES];
  int n = 0;
  cav_status status = cav_strategy_list(race->problem, strategy, &n);
  race->n = 0;
  if (status) cav_strategies_clear(strategy, n);
  if (status) return cav_file_fail(error, status, 0, "strategies cannot be listed: %s", cav_status_name(status));
  race->begin = 0;
  race->begin = cav_race_seconds(race);
  // a motion that is given has no guess
  if (race->start)
    strategy[0].stated = 1, strategy[0].guess = race->problem->guess, strategy[0].schedule = race->problem->schedule;
  for (int i = 0; i < n; i++)
    // of those that are solved at once none waits for another
    if (race->n >= most || (most < CAV_STRATEGIES && strategy[i].use == CAV_STRATEGY_NEAR))
      cav_strategy_clear(&strategy[i]);
    else
      race->entry[race->n++] =
          (cav_race_entry){.strategy = strategy[i], .from = -1, .mends = -1, .cure = -1, .answer = -1, .order = -1};
  return CAV_OK;
}

// a solve that stopped early counts like any other
static int counts(cav_status status) {
  return status == CAV_OK || status == CAV_NOT_CONVERGED || status == CAV_INTERRUPTED || status == CAV_NOT_FINITE;
}

double cav_race_seconds(const cav_race *race) {
  struct timespec own;
  struct rusage ended;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &own);
  getrusage(RUSAGE_CHILDREN, &ended);
  double seconds = (double)own.tv_sec + 1e-9 * (double)own.tv_nsec +
                   (double)(ended.ru_utime.tv_sec + ended.ru_stime.tv_sec) +
                   1e-6 * (double)(ended.ru_utime.tv_usec + ended.ru_stime.tv_usec);
  // what has reported and waits for an order
  for (int i = 0; i < race->n; i++)
    if (race->entry[i].state == CAV_RACE_DONE && race->entry[i].child > 0) seconds += race->entry[i].report.seconds;
  return seconds - race->begin;
}

static int is_over(const cav_race *race) {
  return *race->interrupted || (race->most_seconds > 0 && cav_race_seconds(race) >= race->most_seconds);
}

// by a signal, because the time is over, or because the process that this one works for is no more
static int asks_for_the_end(void *context) {
  const cav_race *race = context;
  if (*race->interrupted == CAV_STOP_NOW || (race->parent && getppid() != race->parent)) return CAV_STOP_NOW;
  return is_over(race) ? CAV_STOP_SOON : 0;
}

// where checkpoints of a strategy go
typedef struct shelf {
  const cav_race *race;
  const cav_problem *problem;
  char *path;
  int strategy, n, failed;
} shelf;

static int keep(void *context, const cav_checkpoint *checkpoint) {
  shelf *s = context;
  cav_checkpoint marked = *checkpoint;
  cav_error error = {0};
  snprintf(marked.key, sizeof marked.key, "%s", s->race->key);
  if (s->race->snapshot && s->strategy == 0) s->race->snapshot(s->race->context, s->problem, checkpoint, s->n++ == 0);
  // a solve that cannot be kept is still worth its end
  if (!s->failed && cav_checkpoint_write(s->path, &marked, &error)) {
    s->failed = 1;
    fprintf(stderr, "cavort: no checkpoints: %s\n", error.text);
  }
  return 0;
}

int cav_race_fits(const cav_problem *problem, const cav_checkpoint *c) {
  cav_equations equations;
  cav_error ignored = {0};
  int knots = (int)lround(problem->duration / problem->timestep) + 1;
  return c->place > CAV_PLACE_CONTINUATION && c->trajectory->nknot == knots &&
         c->trajectory->nv == problem->model->nv && c->order == problem->order &&
         (problem->duration_most > 0 || fabs(c->trajectory->timestep - problem->timestep) < 1e-9 * problem->timestep) &&
         !cav_problem_equations(problem, &equations, &ignored) && equations.constraints == c->nmultiplier;
}

// what is nearly there goes on to the changed problem's optimum from where it is: where limits alone were missed, and
// more of them is given, it obeys all. Else, or where no such motion is on file, NULL
static cav_checkpoint *find_motion(const cav_race *race, int i, const cav_problem *taken) {
  int from = race->entry[i].from;
  if (from < 0 || !race->folder || race->options.solver != CAV_SOLVER_GAUSS_NEWTON) return NULL;
  cav_error ignored = {0};
  char *path = cav_store_checkpoint(race->folder, race->entry[from].strategy.name);
  cav_checkpoint *c = path ? cav_checkpoint_read(path, race->problem->model, &ignored) : NULL;
  free(path);
  if (c && cav_race_fits(taken, c)) return c;
  cav_checkpoint_free(c);
  return NULL;
}

// the motion that entry i goes on from; NULL: none is on file, or not of all dofs
static cav_trajectory *motion_before(const cav_race *race, int i) {
  const cav_race_entry *of = &race->entry[race->entry[i].from];
  if (of->solution) return cav_trajectory_copy(of->solution->trajectory);
  cav_error ignored = {0};
  char *path = race->folder ? cav_store_checkpoint(race->folder, of->strategy.name) : NULL;
  cav_checkpoint *c = path ? cav_checkpoint_read(path, race->problem->model, &ignored) : NULL;
  int whole = c && c->trajectory->nv == race->problem->model->nv && c->place > CAV_PLACE_CONTINUATION;
  cav_trajectory *motion = whole ? cav_trajectory_copy(c->trajectory) : NULL;
  cav_checkpoint_free(c);
  free(path);
  return motion;
}

// where a solve with stages begins: the first one from what was given, one that goes on from where it does, at its own
// step; NULL: from its guess, or no memory
static cav_trajectory *beginning(const cav_race *race, int i, const cav_problem *taken, cav_status *status) {
  *status = CAV_OK;
  int goes_on = race->entry[i].goes_on;
  if (!goes_on && (i > 0 || !race->start)) return NULL;
  cav_trajectory *from = goes_on ? motion_before(race, i) : cav_trajectory_copy(race->start);
  if (!from && !goes_on) *status = CAV_NO_MEMORY;
  // a duration that is free is the motion's own
  long n = from && goes_on ? lround(taken->duration / taken->timestep) : 0;
  if (!from || n == 0 || n == from->nknot - 1) return from;
  double step = from->timestep * (from->nknot - 1) / (double)n;
  cav_trajectory *start = cav_trajectory_resample(race->problem->model, from, step);
  if (!start) *status = CAV_NO_MEMORY;
  cav_trajectory_free(from);
  return start;
}

// solves, from a checkpoint if there is one; it stays there
static cav_status solve(const cav_race *race, int i, const cav_solve_options *given, const cav_problem *taken,
                        cav_solution **solution, cav_error *error) {
  const cav_strategy *strategy = &race->entry[i].strategy;
  cav_solve_options options = *given;
  shelf s = {.race = race, .problem = taken, .strategy = i};
  options.stop = asks_for_the_end;
  options.stop_context = (void *)race;
  // another one is tried after it
  options.leave_refused = race->n > 1;
  if (race->folder) s.path = cav_store_checkpoint(race->folder, strategy->name);
  if (race->folder && !s.path) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (s.path) options.keeper = keep, options.keeper_context = &s;
  cav_checkpoint *before = NULL;
  cav_status status = CAV_OK;
  if (s.path && race->resume && access(s.path, F_OK) == 0) {
    before = cav_checkpoint_read(s.path, race->problem->model, error);
    if (!before) status = error->status;
  }
  options.resume = before;
  cav_checkpoint *motion = before || race->entry[i].goes_on ? NULL : find_motion(race, i, taken);
  if (motion) {
    options.first_stage = taken->schedule.stages + 1;
    options.nmultiplier = motion->nmultiplier;
    options.multiplier = motion->final_multiplier;
  }
  cav_trajectory *start = status || motion ? NULL : beginning(race, i, taken, &status);
  if (!status)
    status =
        cav_strategy_solve(race->problem, strategy, &options, motion ? motion->trajectory : start, solution, error);
  cav_trajectory_free(start);
  cav_checkpoint_free(before);
  cav_checkpoint_free(motion);
  free(s.path);
  return status;
}

// where a solve was stopped, in words
static void say_where(const cav_solution *solution, char *text, size_t room) {
  const cav_stage_record *last = solution->nstage ? &solution->stage[solution->nstage - 1] : NULL;
  if (!last)
    snprintf(text, room, "stopped before its first stage");
  else if (last->outcome != CAV_OUTCOME_STOPPED)
    snprintf(text, room, "stopped after %s %d of %d", last->phase, last->stage, last->stages);
  else if (!strcmp(last->phase, "continuation"))
    snprintf(text, room, "stopped at stage %d of %d", last->stage, last->stages);
  else
    snprintf(text, room, "stopped in phase %s, %d of %d", last->phase, last->stage, last->stages);
}

// what is known of a motion that was not verified, since somebody waits
static void leave_unverified(const cav_solution *solution, cav_verdict *v) {
  *v = (cav_verdict){.unactuated_force_max = solution->unactuated, .unactuated_force_knot = -1};
  double *const unknown[] = {&v->momentum_defect_rms,
                             &v->residual_force_rms_n,
                             &v->residual_force_max_n,
                             &v->residual_torque_rms_n_m,
                             &v->residual_torque_max_n_m,
                             &v->residual_fraction_max,
                             &v->residual_within,
                             &v->limit_violation_max,
                             &v->constraint_violation_max,
                             &v->penetration_max_m,
                             &v->slip_mean_m_s,
                             &v->hover_fraction,
                             &v->replay_step_max_error,
                             &v->replay_same_step_max_error,
                             &v->replay_same_step_seconds,
                             &v->closed_loop_seconds,
                             &v->closed_loop_end_error_m,
                             &v->model_contacts_seconds,
                             &v->periodicity_error,
                             &v->mirrored_force_max,
                             &v->push_survived_n_s,
                             &v->model_contacts_end_error_m,
                             &v->end_speed_m_s,
                             &v->end_rate_rad_s};
  for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++) *unknown[i] = NAN;
  const cav_trajectory *at = solution->trajectory;
  v->duration = (at->nknot - 1) * at->timestep;
  v->cost = solution->cost;
  v->optimality = solution->optimality;
  v->solve_seconds = solution->seconds;
  v->iterations = solution->iterations;
  say_where(solution, v->reason, sizeof v->reason);
}

static void tell_verification(const cav_solve_options *options, const cav_solution *solution) {
  cav_progress line = {.phase = "verification", .stage = 1, .stages = 1, .fraction = 0.97, .knot = -1};
  line.iteration = solution->iterations;
  line.cost = solution->cost;
  line.unactuated = solution->unactuated;
  line.seconds = solution->seconds;
  if (options->observer) options->observer(options->observer_context, &line);
}

cav_status cav_race_verify(const cav_problem *problem, const cav_solution *solution, cav_race_report *report,
                           cav_error *error) {
  cav_status status = cav_verify_solution(problem, solution, &report->verdict, error);
  if (status == CAV_OK)
    status = cav_verify_optimality(problem, solution->trajectory, &solution->contact, solution->nrow, solution->row,
                                   &report->verdict, error);
  report->verdict.solve_seconds = solution->seconds;
  report->verdict.iterations = solution->iterations;
  report->cost = solution->cost;
  report->solution = status == CAV_OK;
  return status;
}

// solves and certifies, in whichever process
static cav_solution *run(const cav_race *race, int i, const cav_solve_options *options, cav_problem *taken,
                         cav_race_report *report) {
  cav_solution *solution = NULL;
  cav_error error = {0}, verification = {0};
  *report = (cav_race_report){0};
  snprintf(report->changed, sizeof report->changed, "%s", race->entry[i].strategy.changed);
  cav_strategy_apply(race->problem, &race->entry[i].strategy, taken);
  cav_status status = solve(race, i, options, taken, &solution, &error);
  if (solution && status == CAV_INTERRUPTED) {
    leave_unverified(solution, &report->verdict);
    report->cost = solution->cost;
    report->solution = 1;
  }
  // what has gains was given the time for them, and for what they are worth
  const int in_time = solution && status == CAV_INTERRUPTED && solution->gain_q;
  if (in_time) say_where(solution, report->where, sizeof report->where);
  if (solution && counts(status) && (status != CAV_INTERRUPTED || in_time)) {
    tell_verification(options, solution);
    cav_status verified = cav_race_verify(taken, solution, report, &verification);
    if (verified != CAV_OK || in_time) status = verified, error = verification;
  }
  report->status = (int)status;
  snprintf(report->text, sizeof report->text, "%.399s", error.text);
  if (report->solution) return solution;
  cav_solution_free(solution);
  return NULL;
}

static const char *outcome(const cav_race_entry *e) {
  switch (e->state) {
    case CAV_RACE_WAITING:
      return "not tried";
    case CAV_RACE_RUNNING:
      return "running";
    case CAV_RACE_CANCELLED:
      return "cancelled";
    case CAV_RACE_LOST:
      return "lost";
    case CAV_RACE_DONE:
      break;
  }
  if (!e->report.solution) return "failed";
  if (e->report.status == CAV_INTERRUPTED) return "stopped";
  if (!e->report.verdict.certified) return "not certified";
  return e->report.verdict.achieved ? "certified" : "not achieved";
}

static void tell(const cav_race *race, const cav_race_entry *e) {
  if (!race->tell) return;
  fprintf(stderr, "strategy %-8s %s", e->strategy.name, outcome(e));
  if (e->state == CAV_RACE_DONE && e->report.solution)
    fprintf(stderr, ", cost %.4g, %d iterations, %.1f s", e->report.cost, e->report.verdict.iterations,
            e->report.verdict.solve_seconds);
  // the first clause of what is missed
  const cav_verdict *v = &e->report.verdict;
  int misses = e->state == CAV_RACE_DONE && e->report.solution && !cav_race_success(&e->report);
  const char *colon = strstr(v->reason, ": "), *stop = strstr(v->reason, ". ");
  size_t first = strlen(v->reason);
  if (colon) first = (size_t)(colon - v->reason);
  if (stop && (size_t)(stop - v->reason) < first) first = (size_t)(stop - v->reason);
  if (misses && first) fprintf(stderr, ": %.*s", (int)first, v->reason);
  const char *when = strstr(v->missed, ") at ");
  if (misses && !first)
    fprintf(stderr, ": misses %d of %d targets, most %.*s", v->nmissed, v->ntarget,
            (int)(when ? (size_t)(when + 1 - v->missed) : strlen(v->missed)), v->missed);
  fputc('\n', stderr);
}

cav_status cav_race_first(cav_race *race, cav_error *error) {
  cav_problem taken;
  cav_race_entry *e = &race->entry[0];
  e->solution = run(race, 0, &race->options, &taken, &e->report);
  e->state = CAV_RACE_DONE;
  if (e->report.solution) return CAV_OK;
  cav_status status = e->report.status ? (cav_status)e->report.status : CAV_INTERNAL;
  return cav_file_fail(error, status, 0, "%s", e->report.text[0] ? e->report.text : cav_status_name(status));
}

// what a child is told: to save what it has; it knows of no interruption that came after it had ended
enum { SAVE = 1, SAVE_STOPPED };

// all of a report, or 0
static int whole(int end, void *data, size_t size, int writes) {
  for (char *at = data; size > 0;) {
    ssize_t n = writes ? write(end, at, size) : read(end, at, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return 0;
    at += n;
    size -= (size_t)n;
  }
  return 1;
}

// in the child: never returns. spent: seconds of the race before it
static void work(cav_race *race, int i, double spent) {
  cav_problem taken;
  // its clock is a new one
  race->begin += cav_race_seconds(race) - spent;
  cav_race_report report;
  char order = 0;
  cav_race_entry *e = &race->entry[i];
  for (int k = 0; k < race->n; k++) {
    if (k == i) continue;
    if (race->entry[k].answer >= 0) close(race->entry[k].answer);
    if (race->entry[k].order >= 0) close(race->entry[k].order);
  }
  signal(SIGPIPE, SIG_IGN);
  cav_solve_options options = race->options;
  options.threads = 1;
  options.observer = NULL;
  cav_solution *solution = run(race, i, &options, &taken, &report);
  report.seconds = cav_race_seconds(race) - spent;
  int done = 0;
  if (whole(e->answer, &report, sizeof report, 1) && whole(e->order, &order, 1, 0) && solution)
    report.stopped = order == SAVE_STOPPED, done = race->save(race->context, &taken, solution, &report);
  fflush(NULL);
  _exit(done);
}

// forks one that waits; 0 if there is no process
static int start(cav_race *race, int i) {
  int answer[2], order[2];
  cav_race_entry *e = &race->entry[i];
  if (pipe(answer) != 0) return 0;
  if (pipe(order) != 0) {
    close(answer[0]), close(answer[1]);
    return 0;
  }
  fflush(NULL);
  double spent = cav_race_seconds(race);
  pid_t parent = getpid(), child = fork();
  if (child == 0) {
    race->parent = parent;
    close(answer[0]), close(order[1]);
    e->answer = answer[1], e->order = order[0];
    work(race, i, spent);
  }
  close(answer[1]), close(order[0]);
  e->answer = answer[0], e->order = order[1];
  e->child = child;
  if (child > 0) e->state = CAV_RACE_RUNNING;
  if (child < 0) close(e->answer), close(e->order), e->answer = e->order = -1;
  return child > 0;
}

// ends a child's process; its pipes close
static void end(cav_race_entry *e) {
  if (e->child <= 0) return;
  kill(e->child, SIGKILL);
  while (waitpid(e->child, NULL, 0) < 0 && errno == EINTR) continue;
  close(e->answer), close(e->order);
  e->child = 0;
  e->answer = e->order = -1;
}

int cav_race_would_do(const cav_race_entry *entry) {
  const cav_verdict *v = &entry->report.verdict;
  if (entry->strategy.use != CAV_STRATEGY_DIAGNOSIS || entry->state != CAV_RACE_DONE || !entry->report.solution)
    return 0;
  // what is all but certified is within that strength
  return cav_race_success(&entry->report) || (entry->strategy.strength > 0 && v->achieved && cav_rank_rough(v));
}

int cav_race_success(const cav_race_report *report) { return report->verdict.certified && report->verdict.achieved; }

// what comes after a strategy that succeeds cannot be kept any more
static void cancel_after(cav_race *race, int certified) {
  for (int k = certified + 1; k < race->n; k++) {
    cav_race_entry *e = &race->entry[k];
    if (e->state != CAV_RACE_WAITING && e->state != CAV_RACE_RUNNING) continue;
    int running = e->state == CAV_RACE_RUNNING;
    end(e);
    e->state = running ? CAV_RACE_CANCELLED : CAV_RACE_WAITING;
    if (running) tell(race, e);
  }
}

static int first_success(const cav_race *race) {
  for (int i = 0; i < race->n; i++)
    if (race->entry[i].state == CAV_RACE_DONE && race->entry[i].strategy.use != CAV_STRATEGY_DIAGNOSIS &&
        cav_race_success(&race->entry[i].report))
      return i;
  return race->n;
}

// whether the balance of momentum is what a motion misses first
static int misses_momentum(const cav_race_report *report) {
  const cav_verdict *v = &report->verdict;
  return report->solution && report->status != CAV_INTERRUPTED && cav_verdict_feasible(v) &&
         v->penetration_max_m <= CAV_TOLERANCE_PENETRATION && v->penetration_between_m <= CAV_TOLERANCE_PENETRATION &&
         v->slip_mean_m_s <= CAV_TOLERANCE_SLIP && v->hover_fraction <= CAV_TOLERANCE_HOVER &&
         v->momentum_defect_rms > CAV_TOLERANCE_MOMENTUM;
}

// the best of the first n entries; last: to keep, so that a problem is changed for something. -1: none
static int best_of(const cav_race *race, int n, int cheapest, int last) {
  int best = -1;
  for (int i = 0; i < n; i++) {
    const cav_race_entry *e = &race->entry[i];
    if (e->state != CAV_RACE_DONE || !e->report.solution || e->strategy.use == CAV_STRATEGY_DIAGNOSIS) continue;
    const cav_race_entry *kept = best < 0 ? NULL : &race->entry[best];
    if (last && kept && *e->strategy.changed && !*kept->strategy.changed && !cav_rank_worth(&e->report, &kept->report))
      continue;
    if (!kept || cav_rank_better(&e->report, &kept->report, cheapest)) best = i;
  }
  return best;
}

// the motion to repair by entry i, of those before it, which have all ended: the best of those that cost little more than
// the cheapest that nearly keeps forces, limits and constraints, since what was asked is in the cost: one that stands still
// is not mended by what would certify it. -1: none
static int find_broken(const cav_race *race, int i, const char *passed) {
  int best = -1;
  double least = INFINITY;
  for (int pass = 0; pass < 2; pass++) {
    for (int k = 0; k < i; k++) {
      const cav_race_entry *e = &race->entry[k];
      if (e->state != CAV_RACE_DONE || !e->report.solution || e->strategy.use == CAV_STRATEGY_DIAGNOSIS) continue;
      const cav_verdict *v = &e->report.verdict;
      if (!cav_rank_keeps(v)) continue;
      least = pass == 0 ? fmin(least, e->report.cost) : least;
      if (pass == 0 || e->report.cost > dearer * least || passed[k]) continue;
      if (best < 0 || cav_rank_nearer(&e->report, &race->entry[best].report)) best = k;
    }
  }
  if (best >= 0 || isfinite(least)) return best;
  best = best_of(race, i, 0, 0);
  return best >= 0 && !passed[best] ? best : -1;
}

// repairs before entry i that went on from a motion
static int repairs_of(const cav_race *race, int i, int of) {
  int n = 0;
  for (int k = 0; k < i; k++) n += race->entry[k].state == CAV_RACE_DONE && race->entry[k].from == of;
  return n;
}

// whether a motion leaves where it was what a hand has to be brought to: that is moved by no weights
static int left_alone(const cav_race *race, const cav_race_report *report) {
  int hand = 0;
  for (int k = 1; k < race->n; k++) hand |= race->entry[k].strategy.hand;
  return hand && cav_rank_far(report);
}

// the nearest of those before entry i that are near, and were not mended as often as may be. -1: none
static int find_near(const cav_race *race, int i, const char *passed) {
  int best = -1;
  for (int k = 0; k < i; k++) {
    const cav_race_entry *e = &race->entry[k];
    if (e->state != CAV_RACE_DONE || !cav_rank_near(&e->report, race->problem->effort_limit) || passed[k]) continue;
    if (e->strategy.use == CAV_STRATEGY_DIAGNOSIS || repairs_of(race, i, k) >= REPAIRS_OF_ONE) continue;
    if (left_alone(race, &e->report)) continue;
    if (best < 0 || cav_rank_nearer(&e->report, &race->entry[best].report)) best = k;
  }
  return best;
}

// whether two strategies are the same: of one guess with the same changes
static int is_same(const cav_strategy *a, const cav_strategy *b) {
  return a->left == b->left && a->stated == b->stated && a->guess == b->guess && a->nswing == b->nswing &&
         a->nreach == b->nreach && a->met == b->met && a->flies == b->flies && a->height == b->height &&
         a->bow[0] == b->bow[0] && a->bow[1] == b->bow[1] && !strcmp(a->changed, b->changed);
}

// the strategy that repairs a motion by a cure that was not tried, nor led to this motion without making it better; to be
// cleared where there is one
static int find_cure(const cav_race *race, int i, const cav_race_entry *from, cav_strategy *repaired, int *cure) {
  int found = 1;
  const cav_verdict *before = from->mends >= 0 ? &race->entry[from->mends].report.verdict : NULL;
  const int idle = before && !cav_rank_helped(&from->report.verdict, before) ? from->cure : -1;
  for (int k = 0; found; k++) {
    if (k == idle) continue;
    if (cav_strategy_repair(race->problem, &from->strategy, &from->report.verdict, k, repaired, &found) || !found)
      return 0;
    int known = 0;
    for (int j = 0; j < i; j++) known |= is_same(repaired, &race->entry[j].strategy);
    *cure = k;
    if (!known) break;
    cav_strategy_clear(repaired);
  }
  repaired->name = race->entry[i].strategy.name;
  return 1;
}

// the repair that entry i is for: of the best motion that has a cure left. *of, *cure: its entry, and which one
static int find_repair(const cav_race *race, int i, cav_strategy *repaired, int *of, int *cure) {
  char passed[CAV_STRATEGIES] = {0};
  while (1) {
    *of = race->entry[i].strategy.use == CAV_STRATEGY_NEAR ? find_near(race, i, passed) : find_broken(race, i, passed);
    if (*of < 0) return 0;
    if (find_cure(race, i, &race->entry[*of], repaired, cure)) return 1;
    passed[*of] = 1;
  }
}

// whether forces are missing most near the end, where all is to come to rest
static int misses_rest(const cav_race *race) {
  const cav_race_report *r = &race->entry[0].report;
  int last = (int)lround(race->problem->duration / race->problem->timestep);
  return r->solution && r->status != CAV_INTERRUPTED && !cav_verdict_feasible(&r->verdict) &&
         r->verdict.unactuated_force_max > CAV_TOLERANCE_UNACTUATED &&
         r->verdict.unactuated_force_knot >= near_end * last;
}

// whether a strategy is of no use: costs that are light at first serve where forces or limits do not come in
static int is_idle(const cav_race *race, int i) {
  const cav_race_report *first = &race->entry[0].report;
  const cav_strategy *s = &race->entry[i].strategy;
  const int eased = s->schedule.light_avoided && !race->problem->schedule.light_avoided;
  if (eased && first->solution && cav_verdict_feasible(&first->verdict)) return 1;
  // from where a hand has to be brought the same guess by another schedule leads nowhere else
  return i > 0 && s->stated && !s->hand && !s->samples && left_alone(race, first);
}

// whether a strategy that waits may start: those for a case only after all before them
static int may_start(const cav_race *race, int i) {
  cav_strategy_use use = race->entry[i].strategy.use;
  int momentum = 0, success = 0;
  if (use == CAV_STRATEGY_TRY) return !is_idle(race, i);
  for (int k = 0; k < i; k++) {
    const cav_race_entry *e = &race->entry[k];
    const int waits = e->state == CAV_RACE_WAITING && may_start(race, k);
    if (waits || e->state == CAV_RACE_RUNNING) return 0;
    momentum |= e->state == CAV_RACE_DONE && misses_momentum(&e->report);
    success |= e->state == CAV_RACE_DONE && cav_race_success(&e->report);
  }
  if (race->entry[i].strategy.open && !misses_rest(race)) return 0;
  cav_strategy repaired;
  int of, cure;
  const int near = use == CAV_STRATEGY_NEAR, mends = use == CAV_STRATEGY_REPAIR || near;
  int repairs = mends && !success && find_repair(race, i, &repaired, &of, &cure);
  if (repairs) cav_strategy_clear(&repaired);
  if (repairs && near && cav_rank_spent(race, i) && !cav_rank_close(&race->entry[of].report)) return 0;
  return use == CAV_STRATEGY_MOMENTUM ? momentum : mends ? repairs : !success;
}

// takes up what a repair does, once it is known
static void settle(cav_race *race, int i) {
  cav_race_entry *e = &race->entry[i];
  cav_strategy repaired;
  int of, cure;
  const int mends = e->strategy.use == CAV_STRATEGY_REPAIR || e->strategy.use == CAV_STRATEGY_NEAR;
  const int near = e->strategy.use == CAV_STRATEGY_NEAR;
  if (!mends || *e->strategy.changed || !find_repair(race, i, &repaired, &of, &cure)) return;
  // what a repair led to is not sought anew by the next one, unless it is to begin elsewhere
  const int anew = repaired.schedule.kinematics && !race->entry[of].strategy.schedule.kinematics;
  const int goes_on = !anew && (near || *race->entry[of].strategy.changed);
  if (goes_on) e->from = of;
  e->mends = of, e->cure = cure;
  e->strategy = repaired;
  // what is all but certified is not sought anew; what is so but for a target goes straight to its optimum
  const cav_verdict *v = &race->entry[of].report.verdict;
  e->goes_on = goes_on && cav_rank_rough(v) && !cav_rank_beside(v);
  if (race->tell) fprintf(stderr, "strategy %-8s with %s\n", e->strategy.name, e->strategy.changed);
}

// waits for reports; interruption is passed on once
static void listen_to(cav_race *race, int *passed_on) {
  struct pollfd wait[CAV_STRATEGIES];
  int of[CAV_STRATEGIES], n = 0;
  for (int i = 0; i < race->n; i++)
    if (race->entry[i].state == CAV_RACE_RUNNING)
      of[n] = i, wait[n++] = (struct pollfd){race->entry[i].answer, POLLIN, 0};
  int ready = poll(wait, (nfds_t)n, 200);
  const int asked = *race->interrupted;
  if (asked && *passed_on != asked) {
    for (int k = 0; k < n; k++) kill(race->entry[of[k]].child, asked == CAV_STOP_SOON ? SIGALRM : SIGINT);
    *passed_on = asked;
  }
  for (int k = 0; k < n && ready > 0; k++) {
    cav_race_entry *e = &race->entry[of[k]];
    if (!wait[k].revents) continue;
    if (whole(e->answer, &e->report, sizeof e->report, 0)) {
      e->state = CAV_RACE_DONE;
    } else {
      end(e);
      e->report = (cav_race_report){0};
      e->state = CAV_RACE_LOST;
    }
    tell(race, e);
  }
}

cav_status cav_race_finish(cav_race *race, int cheapest, cav_error *error) {
  int passed_on = 0;
  while (1) {
    int most = cheapest ? race->n : first_success(race), running = 0;
    if (!cheapest) cancel_after(race, most);
    for (int i = 0; i < most; i++) running += race->entry[i].state == CAV_RACE_RUNNING;
    for (int i = 0; i < most && running < race->processes && !is_over(race); i++) {
      if (race->entry[i].state != CAV_RACE_WAITING || !may_start(race, i)) continue;
      settle(race, i);
      if (!start(race, i)) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no process for another strategy");
      running++;
    }
    if (running == 0) return CAV_OK;
    listen_to(race, &passed_on);
  }
}

int cav_race_best(const cav_race *race, int cheapest) { return best_of(race, race->n, cheapest, 1); }

int cav_race_save(cav_race *race, int best) {
  cav_race_entry *e = &race->entry[best];
  cav_problem taken;
  cav_strategy_apply(race->problem, &e->strategy, &taken);
  e->report.stopped = *race->interrupted != 0;
  if (e->solution) return race->save(race->context, &taken, e->solution, &e->report);
  int how = 0;
  char order = e->report.stopped ? SAVE_STOPPED : SAVE;
  fflush(NULL);
  if (!whole(e->order, &order, 1, 1)) return CAV_EXIT_INTERNAL;
  while (waitpid(e->child, &how, 0) < 0 && errno == EINTR) continue;
  close(e->answer), close(e->order);
  e->child = 0;
  e->answer = e->order = -1;
  return WIFEXITED(how) ? WEXITSTATUS(how) : CAV_EXIT_INTERNAL;
}

void cav_race_close(cav_race *race) {
  for (int i = 0; i < race->n; i++) {
    end(&race->entry[i]);
    cav_solution_free(race->entry[i].solution);
    race->entry[i].solution = NULL;
    cav_strategy_clear(&race->entry[i].strategy);
  }
}

static void write_quoted(FILE *out, const char *text) {
  fputs(",\"", out);
  for (const char *c = text; *c; c++) fputc(*c == '"' ? '\'' : *c, out);
  fputc('"', out);
}

cav_status cav_race_write(const cav_race *race, int kept, const char *path, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("strategy,kept,outcome,cost,iterations,seconds,unactuated,closed_loop_seconds,changed,reason\n", file.stream);
  for (int i = 0; i < race->n; i++) {
    const cav_race_entry *e = &race->entry[i];
    const cav_verdict *v = &e->report.verdict;
    int known = e->state == CAV_RACE_DONE && e->report.solution;
    const double value[] = {e->report.cost, v->iterations, v->solve_seconds, v->unactuated_force_max,
                            v->closed_loop_seconds};
    fprintf(file.stream, "%s,%d,%s", e->strategy.name, i == kept, outcome(e));
    for (int k = 0; k < 5; k++) {
      fputc(',', file.stream);
      if (known) cav_table_write_number(file.stream, value[k]);
    }
    write_quoted(file.stream, e->strategy.changed);
    char missed[sizeof v->missed + 16] = "";
    if (known && *v->missed) snprintf(missed, sizeof missed, "misses %s", v->missed);
    const int would_do = cav_race_would_do(e);
    if (would_do) {
      if (e->strategy.open)
        snprintf(missed, sizeof missed, "an open end would do");
      else if (e->strategy.strength > 0)
        snprintf(missed, sizeof missed, "%.3g times the strength would do", e->strategy.strength);
      else
        snprintf(missed, sizeof missed, "%.4g s would do", v->duration);
    }
    write_quoted(file.stream, !known ? e->report.text : *v->reason && !would_do ? v->reason : missed);
    fputc('\n', file.stream);
  }
  return cav_file_end(&file, error);
}
