/// Which feedback goes with a motion. Gains are those of a regulator (lqr.c), but what straying costs, and how hard the
/// contacts are that it counts on, are not in the problem. So sets of these are tried in closed loops: those of
/// verification, some of which start a little off, and two with a small push: gains that fit one course of the
/// simulation may lose the next. A few that serve different motions come first, then points that fill the range of all.
/// Where none of the first does, they are put together (rollout.c).
/// The first that follows in all loops and ends near enough is taken; that it withstands the pushes is asked of the
/// first few alone, and what is near enough grows with the number of sets. Kept is what follows in most loops, in their
/// order, then what ends nearest in the worst of them. A trial begins with the loop that decided about the best so far,
/// and ends with the first one that is lost or shows that it is no better.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lqr.h"
#include "rollout.h"
#include "schedule.h"
#include "verification.h"

/// Contact laws of a regulator; sets of which a push is asked; sets before balance and room are among what varies.
enum { LAWS = 2, FEW = 3, PLAIN = 40 };

/// Sets that are tried at most: in all; where none so far follows from the motion's own start, PLAIN where the motion is lost
/// early and UNHELD else.
enum { TRIALS = 120, UNHELD = 64 };

/// Where none of so many sets does, these are put together (rollout.c).
enum { ROLLED = 12 };

/// What a regulator is made of: penalties on straying, and the fractions of the schedule whose contact laws it reckons
/// with.
typedef struct set {
  cav_feedback_penalty penalty;
  int laws;
  double fraction[LAWS];
} set;

static const set seed[] = {{{.tracking = 36, .rate = 1.5}, 1, {0.85}},   {{.tracking = 30, .rate = 3}, 1, {0.93}},
                           {{.tracking = 70, .rate = 2.5}, 1, {0.85}},   {{.tracking = 0.1, .rate = 1.5}, 1, {1}},
                           {{.tracking = 1.5, .rate = 1.5}, 1, {0.85}},  {{.tracking = 30, .rate = 2.5}, 1, {0.77}},
                           {{.tracking = 300, .rate = 10}, 1, {0.85}},   {{.tracking = 24, .rate = 1.9}, 1, {0.88}},
                           {{.tracking = 4, .rate = 3}, 2, {0.85, 0.6}}, {{.tracking = 30, .rate = 2}, 1, {1}},
                           {{.tracking = 12, .rate = 3}, 1, {1}}};
static const set balanced[] = {{{.tracking = 0.1, .rate = 1.5, .room = 1}, 1, {1}},
                               {{.tracking = 1.2, .rate = 1, .balance = 40}, 1, {0.77}},
                               {{.tracking = 1.5, .rate = 1.5, .balance = 10}, 1, {0.85}},
                               {{.tracking = 30, .rate = 3, .balance = 3}, 1, {0.93}}};
enum { SEEDS = sizeof seed / sizeof *seed, BALANCED = sizeof balanced / sizeof *balanced };

/// End error that ends the search, m: at first a tenth of the distance at which a loop is lost, 3 cm more with each
/// set that was tried.
static double near_enough(int trials) { return 0.05 + 0.03 * (trials - 1); }

/// Part of what a loop lasts: what the best set follows for less is lost early.
static const double lost_early = 0.85;

/// Loops that have to be followed: at first the pushed ones too.
static int enough(int trials) { return trials <= FEW ? CAV_LOOPS : CAV_LOOP_PUSHED; }

/// Part of the end error that counts where the loop is disturbed: that is to be survived rather than undone.
static const double disturbed_part = 0.25;

/// What a set does: loops that follow, how long the next one does, the worst end error; the loop that decided, the lost
/// one or that of the worst end.
typedef struct outcome {
  int follows;
  double seconds, error;
  int decided;
} outcome;

static int better(const outcome *a, const outcome *b) {
  if (a->follows != b->follows) return a->follows > b->follows;
  return a->follows < CAV_LOOPS ? a->seconds > b->seconds : a->error < b->error;
}

/// The search: where it is, and the best so far in the solution.
typedef struct search {
  const cav_problem *problem;
  const cav_transcription *tr;
  cav_verification verification;
  const cav_trajectory *at;
  cav_solution *solution;
  double *gain;                        ///< [2*n]
  struct cav_follow follow[CAV_LOOPS]; ///< loops of a set, and of the best
  struct cav_follow best_follow[CAV_LOOPS];
  size_t n;
  cav_before before; ///< where loops of the set in hand are pushed
  set best;
  outcome reached;
  int found;            ///< 1: there is a best
  double *kept[ROLLED]; ///< [2*n] gains of the first sets, if they may be put together
} search;

/// The regulator of a set, into gain.
static cav_status regulate(const search *s, const set *one) {
  cav_options law[LAWS];
  for (int i = 0; i < one->laws; i++) {
    law[i] = cav_knot_law(s->tr, 0);
    cav_stage_law(s->problem, one->fraction[i], s->tr->options.timestep, &law[i]);
  }
  cav_status status = cav_feedback(s->tr, s->at, law, one->laws, &one->penalty, s->gain, s->gain + s->n);
  // a regulator that does not exist is no reason to give up the motion
  return status == CAV_NOT_CONVERGED || status == CAV_NOT_FINITE ? CAV_OK : status;
}

/// Adds a loop to what a set does.
static void note(outcome *now, int loop, const struct cav_follow *follow) {
  const double error = follow->error * (loop < CAV_LOOP_START ? 1 : disturbed_part);
  if (*follow->lost) {
    now->follows = now->decided = loop;
    now->seconds = follow->seconds;
  } else if (error > now->error) {
    now->error = error;
    if (now->follows == CAV_LOOPS) now->decided = loop;
  }
}

/// Runs the loops of the gains at hand and keeps these if they are better; *better_so: whether they are. Loops in their order
/// but for the one that decided about the best, which is first; what is known so far is the most that the gains can do.
static cav_status check_loops(search *s, int *better_so) {
  outcome now = {.follows = CAV_LOOPS};
  const int first = s->reached.decided;
  cav_status status = CAV_OK;
  s->before.known = 0;
  *better_so = 0;
  for (int k = 0; k < CAV_LOOPS && status == CAV_OK; k++) {
    const int loop = k == 0 ? first : k <= first ? k - 1 : k;
    if (k > 0 && loop >= now.follows) break;
    status = cav_closed_loop(&s->verification, loop, s->gain, s->gain + s->n, &s->before, &s->follow[loop]);
    if (status != CAV_OK) break;
    note(&now, loop, &s->follow[loop]);
    if (s->found && !better(&now, &s->reached)) return CAV_OK;
  }
  if (status != CAV_OK) return status;
  memcpy(s->solution->gain_q, s->gain, s->n * sizeof *s->gain);
  memcpy(s->solution->gain_v, s->gain + s->n, s->n * sizeof *s->gain);
  memcpy(s->best_follow, s->follow, sizeof s->follow);
  s->reached = now;
  s->found = *better_so = 1;
  return CAV_OK;
}

/// Tries a set; of these the best is what others are near.
static cav_status try(search *s, const set *one) {
  int better_so = 0;
  cav_status status = regulate(s, one);
  if (status == CAV_OK) status = check_loops(s, &better_so);
  if (better_so) s->best = *one;
  return status;
}

/// Keeps the gains at hand, those of the last of so many sets; what all of these make together is tried.
static cav_status roll(search *s, int sets) {
  if (sets > ROLLED) return CAV_OK;
  double *kept = malloc(2 * s->n * sizeof *kept);
  s->kept[sets - 1] = kept;
  if (!kept) return CAV_NO_MEMORY;
  memcpy(kept, s->gain, 2 * s->n * sizeof *kept);
  if (sets < ROLLED) return CAV_OK;
  int better_so;
  cav_status status = cav_rollout(s->tr, &s->verification, sets, (const double *const *)s->kept, s->gain);
  return status == CAV_OK ? check_loops(s, &better_so) : status;
}

/// x in [0, 1] between two ends, around a middle within a part of the way, or anywhere.
static double spread(double x, double from, double to, double middle, int near) {
  double part = near ? 0.3 : 1, start = near ? middle - 0.5 * part * (to - from) : from;
  return fmin(fmax(start + part * x * (to - from), from), to);
}

/// Ranges of penalties and laws before balance and room are among what varies, and then, narrower, as what lies outside of
/// these held hardly any of 31 motions whose gains are hard to find (METHOD.md, 8).
static const struct range {
  double tracking[2], rate[2], law[2];
} wide = {{1, 100}, {1, 6}, {0.6, 1}}, narrow = {{1, 100}, {0.8, 4}, {0.72, 1}};

/// Part of the later sets whose straying is that of the links alone; the most that balance counts beside it in others.
static const double plain = 0.4, most_balance = 20;

/// Powers of the root of x^5 = x + 1, and of x^7 = x + 1.
static const double of_four[] = {0.8566748838545029, 0.7338918566271259, 0.6287067210378087, 0.5385972572236101},
                    of_six[] = {0.8986537126286993, 0.8075784952213448, 0.7257334129697598,
                                0.6521830259439715, 0.5860866975779693, 0.5266889867007357};

/// The set of a trial: the seeds, then points that fill the range of all (Roberts's additive recurrence), every other
/// one near the best; first without balance and room, then with them.
static set sample(const search *s, int trial) {
  const int late = trial >= PLAIN, begun = late ? PLAIN + BALANCED : SEEDS, near = trial % 2;
  if (trial < begun) return late ? balanced[trial - PLAIN] : seed[trial];
  const double *step = late ? of_six : of_four;
  const set *best = &s->best;
  double x[6] = {0};
  for (int k = 0; k < (late ? 6 : 4); k++) x[k] = fmod(0.5 + (trial - begun + 1) * step[k], 1);
  set to = {.laws = near ? best->laws : x[3] < 0.5 ? 1 : 2};
  const struct range *r = late ? &narrow : &wide;
  to.penalty.tracking = exp(spread(x[0], log(r->tracking[0]), log(r->tracking[1]), log(best->penalty.tracking), near));
  to.penalty.rate = exp(spread(x[1], log(r->rate[0]), log(r->rate[1]), log(best->penalty.rate), near));
  to.fraction[0] = spread(x[2], r->law[0], r->law[1], best->fraction[0], near);
  to.fraction[1] = spread(x[3], 0.3, 0.9, best->fraction[1], near);
  if (!late) return to;
  to.penalty.room = near ? best->penalty.room : x[4] < 0.5;
  to.penalty.balance = x[5] < plain ? 0 : exp(log(most_balance) * (x[5] - plain) / (1 - plain));
  if (near) to.penalty.balance = best->penalty.balance;
  return to;
}

/// Whether the best is good enough, or the motion is lost.
static int done(const search *s, int trials) {
  const cav_verification *v = &s->verification;
  if (s->found && s->reached.follows == CAV_LOOP_OWN) {
    const int early = s->reached.seconds < lost_early * v->periods * v->last * v->h;
    if (trials >= (early ? PLAIN : UNHELD)) return 1;
  }
  return s->found && s->reached.follows >= enough(trials) && s->reached.error <= near_enough(trials);
}

cav_status cav_choose_gains(const cav_problem *problem, const cav_transcription *tr, const cav_trajectory *at, int sets,
                            int (*report)(void *context, int set, int most), void *context, cav_solution *solution,
                            int *follows, cav_error *error) {
  search s = {.problem = problem, .tr = tr, .at = at, .solution = solution};
  s.n = ((size_t)tr->nknot - 1) * (size_t)tr->nv * (size_t)tr->nv;
  s.gain = malloc(2 * s.n * sizeof *s.gain);
  solution->gain_q = calloc(s.n, sizeof(double));
  solution->gain_v = calloc(s.n, sizeof(double));
  cav_status status = s.gain && solution->gain_q && solution->gain_v ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) status = cav_closed_loops_begin(&s.verification, problem, at, &solution->contact, error);
  if (status == CAV_OK && !(s.before.x = malloc(cav_before_numbers(&s.verification) * sizeof *s.before.x)))
    status = CAV_NO_MEMORY;
  int trials = sets > 0 && sets < TRIALS ? sets : TRIALS;
  // a motion that does not go on from a knot as planned is refused whatever follows it; one that is not at its end yet may still
  cav_replay steps = {0};
  if (status == CAV_OK && !follows) status = cav_replay_steps(&s.verification, &steps);
  if (steps.step_error > CAV_TOLERANCE_STEP) trials = 1;
  for (int i = 0; i < trials && status == CAV_OK; i++) {
    const set one = sample(&s, i);
    status = report(context, i + 1, trials) ? CAV_INTERRUPTED : try(&s, &one);
    // pieces of a cycle are those of its next period, too
    const int rolls = trials >= ROLLED && !problem->cycle.on;
    if (status == CAV_OK && rolls && !done(&s, i + 1)) status = roll(&s, i + 1);
    if (done(&s, i + 1)) break;
  }
  for (int i = 0; i < ROLLED; i++) free(s.kept[i]);
  if (follows) *follows = s.found && s.reached.follows >= CAV_LOOP_START;
  if (s.found && s.reached.follows >= CAV_LOOP_PUSHED && !problem->cycle.on) {
    solution->followed = cav_followed_new(&s.verification, solution->gain_q, solution->gain_v, s.best_follow);
    if (!solution->followed && status == CAV_OK) status = CAV_NO_MEMORY;
  }
  cav_verification_end(&s.verification);
  free(s.gain), free(s.before.x);
  // zeros are no gains
  if (!s.found) cav_gains_free(solution);
  return status;
}

void cav_gains_free(cav_solution *solution) {
  free(solution->gain_q), free(solution->gain_v);
  cav_followed_free(solution->followed);
  solution->gain_q = solution->gain_v = NULL;
  solution->followed = NULL;
}
