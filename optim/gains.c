/// Which feedback goes with a motion. Gains follow from the final Hessian (feedback.c), but two things are not in the problem:
/// the price of straying from the motion, and how hard contacts are to be taken: gains of very stiff contacts demand what a
/// foot a millimetre too high cannot give. So a few of each are tried in the closed loops of verification, at a tenth of the
/// step. Kept is what follows longest under the claimed contacts, then longest and nearest under the model's own.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "feedback.h"

/// Prices of straying, and the shares of the schedule whose contact law is taken.
static const double tracking[] = {10, 100, 1};
static const double hardness[] = {1, 0.6};

/// End error that ends the search, m.
static const double near_enough = 0.03;

/// What has been found so far.
typedef struct search {
  cav_solve_run *run;
  size_t n;     ///< numbers of one set of gains
  double *gain; ///< [2n] candidate
  cav_verdict best;
} search;

static int better(const cav_verdict *a, const cav_verdict *b) {
  if (a->closed_loop_seconds != b->closed_loop_seconds) return a->closed_loop_seconds > b->closed_loop_seconds;
  if (a->own_contacts_seconds != b->own_contacts_seconds) return a->own_contacts_seconds > b->own_contacts_seconds;
  return a->own_contacts_end_error_m < b->own_contacts_end_error_m;
}

static int done(const search *s) {
  return s->best.duration > 0 && s->best.closed_loop_seconds >= s->best.duration &&
         s->best.own_contacts_seconds >= s->best.duration && s->best.own_contacts_end_error_m <= near_enough;
}

static cav_status try_tracking(search *s, double price, cav_error *error) {
  cav_solution *solution = s->run->solution;
  cav_verdict verdict;
  double *q = s->gain, *v = s->gain + s->n;
  if (cav_feedback(s->run->tr, s->run->normal, price, q, v) != CAV_OK) return CAV_OK;
  cav_status status = cav_verify(s->run->problem, s->run->at, &solution->contact, q, v, &verdict, error);
  if (status != CAV_OK || (s->best.closed_loop_seconds > 0 && !better(&verdict, &s->best))) return status;
  memcpy(solution->gain_q, q, s->n * sizeof *q);
  memcpy(solution->gain_v, v, s->n * sizeof *v);
  s->best = verdict;
  return CAV_OK;
}

/// Normal equations of the motion under the contact law at a share of the schedule, without multipliers.
static cav_status relinearise(cav_solve_run *run, double share) {
  cav_transcription *tr = run->tr;
  int last = run->problem->schedule.stages - 1;
  cav_stage_set(run->problem, (int)lround(share * last), last + 1, tr);
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].multiplier = 0;
  cav_status status = cav_transcription_linearise(tr, run->at);
  if (status == CAV_OK) cav_normal_gather(run->normal, tr);
  return status;
}

cav_status cav_choose_gains(cav_solve_run *run, cav_error *error) {
  cav_transcription *tr = run->tr;
  search s = {.run = run, .n = ((size_t)tr->nknot - 1) * (size_t)tr->nv * (size_t)tr->nv};
  s.gain = malloc(2 * s.n * sizeof *s.gain);
  run->solution->gain_q = calloc(s.n, sizeof(double));
  run->solution->gain_v = calloc(s.n, sizeof(double));
  cav_status status = s.gain && run->solution->gain_q && run->solution->gain_v ? CAV_OK : CAV_NO_MEMORY;
  int laws = (int)(sizeof hardness / sizeof *hardness), prices = (int)(sizeof tracking / sizeof *tracking);
  for (int i = 0; i < laws && status == CAV_OK && !done(&s); i++) {
    status = relinearise(run, hardness[i]);
    for (int k = 0; k < prices && status == CAV_OK && !done(&s); k++) status = try_tracking(&s, tracking[k], error);
  }
  free(s.gain);
  return status;
}
