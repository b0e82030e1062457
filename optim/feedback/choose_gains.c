/// Which feedback goes with a motion. Gains are those of a regulator (lqr.c), but what straying costs, and how hard the
/// contacts are that it counts on, are not in the problem. So a few of each are tried in the closed loops of
/// verification. Kept is what follows longest under the claimed contacts, then longest and nearest under the model's
/// own.
#include <stdlib.h>
#include <string.h>

#include "lqr.h"
#include "schedule.h"
#include "verification.h"

/// Trials in order: penalties on straying, and the fraction of the schedule whose contact law is taken.
static const struct trial {
  cav_feedback_penalty penalty;
  double fraction;
} trial[] = {{{36, 3}, 1},    {{36, 3}, 0.95}, {{12, 3}, 1},  {{100, 3}, 0.95},
             {{12, 3}, 0.85}, {{36, 5}, 0.8},  {{12, 3}, 0.7}};

/// End error that ends the search, m.
static const double near_enough = 0.03;

/// What a set of gains does.
typedef struct outcome {
  struct cav_follow claimed, own;
} outcome;

static int better(const outcome *a, const outcome *b) {
  if (a->claimed.seconds != b->claimed.seconds) return a->claimed.seconds > b->claimed.seconds;
  if (a->own.seconds != b->own.seconds) return a->own.seconds > b->own.seconds;
  return a->claimed.error + a->own.error < b->claimed.error + b->own.error;
}

static int done(const outcome *o) {
  return !*o->claimed.lost && !*o->own.lost && o->claimed.error <= near_enough && o->own.error <= near_enough;
}

cav_status cav_choose_gains(const cav_problem *problem, const cav_transcription *tr, const cav_trajectory *at, int sets,
                            int (*report)(void *context, int set, int most), void *context, cav_solution *solution,
                            cav_error *error) {
  size_t n = ((size_t)tr->nknot - 1) * (size_t)tr->nv * (size_t)tr->nv;
  double *gain = malloc(2 * n * sizeof *gain);
  solution->gain_q = calloc(n, sizeof(double));
  solution->gain_v = calloc(n, sizeof(double));
  cav_status status = gain && solution->gain_q && solution->gain_v ? CAV_OK : CAV_NO_MEMORY;
  outcome best = {0};
  int all = (int)(sizeof trial / sizeof *trial), trials = sets > 0 && sets < all ? sets : all, first = 1;
  for (int i = 0; i < trials && status == CAV_OK && (first || !done(&best)); i++) {
    outcome now;
    if (report(context, i + 1, trials)) {
      status = CAV_INTERRUPTED;
      break;
    }
    cav_options law = tr->options;
    cav_stage_law(problem, trial[i].fraction, tr->options.timestep, &law);
    status = cav_feedback(tr, at, &law, &trial[i].penalty, gain, gain + n);
    // a regulator that does not exist is no reason to give up the motion
    if (status == CAV_NOT_CONVERGED || status == CAV_NOT_FINITE) status = CAV_OK;
    if (status == CAV_OK)
      status = cav_closed_loops(problem, at, &solution->contact, gain, gain + n, &now.claimed, &now.own, error);
    if (status != CAV_OK || !(first || better(&now, &best))) continue;
    memcpy(solution->gain_q, gain, n * sizeof *gain);
    memcpy(solution->gain_v, gain + n, n * sizeof *gain);
    best = now;
    first = 0;
  }
  free(gain);
  // zeros are no gains
  if (first) free(solution->gain_q), free(solution->gain_v), solution->gain_q = solution->gain_v = NULL;
  return status;
}
