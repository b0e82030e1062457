/// Gains put together of those of several regulators. None of them need hold a motion from its start to its end, where one
/// holds its landing and another what follows. So they are rolled out piece by piece (Bertsekas): all closed loops of a
/// certificate are taken on by each regulator a while beyond a piece, and the one by which they stray least has the piece.
#include "rollout.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// s: a piece, and how far beyond its beginning the loops are looked at.
static const double piece = 0.3, ahead = 0.6;

enum { LANES = CAV_LOOP_PUSHED };

/// The loops, what is kept of them, [LANES][numbers] each, and the order that they are tried in: the one that strayed most first.
typedef struct rollout {
  const cav_verification *verification;
  cav_lane *lane[LANES];
  size_t numbers;
  double *begin, *end, *best; ///< where the piece begins; where it ends, by the regulator at hand and by the best one
  double *first;              ///< [sets] how far the first lane strays by each
  int order[LANES];
} rollout;

static double *of(const rollout *r, double *kept, int lane) { return kept + (size_t)lane * r->numbers; }

static cav_status begin(rollout *r, int sets) {
  r->numbers = cav_before_numbers(r->verification);
  r->begin = malloc((3 * LANES * r->numbers + (size_t)sets) * sizeof(double));
  if (!r->begin) return CAV_NO_MEMORY;
  r->end = r->begin + LANES * r->numbers;
  r->best = r->end + LANES * r->numbers;
  r->first = r->best + LANES * r->numbers;
  for (int k = 0; k < LANES; k++) {
    r->order[k] = k;
    r->lane[k] = cav_closed_loop_lane(r->verification, k);
    if (!r->lane[k]) return CAV_NO_MEMORY;
  }
  return CAV_OK;
}

static void end(rollout *r) {
  for (int k = 0; k < LANES; k++) cav_lane_free(r->lane[k]);
  free(r->begin);
}

/// How far a lane strays by a regulator from knot[0] to knot[2]; where it stands at knot[1], the end of the piece, is kept.
static cav_status take_on(rollout *r, int lane, const double *gain_q, const double *gain_v, const int knot[3],
                          double *strayed) {
  double *state = cav_lane_state(r->lane[lane]);
  memcpy(state, of(r, r->begin, lane), r->numbers * sizeof *state);
  cav_status status = cav_lane_run(r->verification, r->lane[lane], gain_q, gain_v, knot[0], knot[1], strayed);
  memcpy(of(r, r->end, lane), state, r->numbers * sizeof *state);
  if (status != CAV_OK || knot[2] == knot[1]) return status;
  if (*strayed < 1) return cav_lane_run(r->verification, r->lane[lane], gain_q, gain_v, knot[1], knot[2], strayed);
  *strayed += (knot[2] - knot[1]) * r->verification->h;
  return CAV_OK;
}

/// How far the loops stray by a regulator in the worst of them, if that is less than bound; *worst: the lane that does.
static cav_status stray(rollout *r, const double *gain_q, const double *gain_v, const int knot[3], double bound,
                        double *strayed, int *worst) {
  *strayed = 0;
  for (int i = 0; i < LANES && *strayed < bound; i++) {
    double now;
    const cav_status status = take_on(r, r->order[i], gain_q, gain_v, knot, &now);
    if (status != CAV_OK) return status;
    if (now >= *strayed) *strayed = now, *worst = r->order[i];
  }
  return CAV_OK;
}

/// That lane is the first from now on.
static void put_first(rollout *r, int lane) {
  int at = 0;
  while (r->order[at] != lane) at++;
  for (; at > 0; at--) r->order[at] = r->order[at - 1];
  r->order[0] = lane;
}

/// The regulator by which the loops stray least, *least, to r->best where these stand at the end of the piece; *chosen: which it
/// is. Those by which the first lane strays least are tried first, so that most others are known to be worse by it alone.
static cav_status choose(rollout *r, const cav_transcription *tr, int sets, const double *const *set, size_t n,
                         const int knot[3], int *chosen, double *least) {
  int worst = 0, first = r->order[0];
  cav_status status = CAV_OK;
  *least = INFINITY;
  for (int k = 0; k < sets && status == CAV_OK; k++)
    status = cav_transcription_stopped(tr) ? CAV_INTERRUPTED
                                           : take_on(r, r->order[0], set[k], set[k] + n, knot, &r->first[k]);
  for (int i = 0; i < sets && status == CAV_OK; i++) {
    int k = 0;
    for (int j = 1; j < sets; j++)
      if (r->first[j] < r->first[k]) k = j;
    if (r->first[k] >= *least) break;
    r->first[k] = INFINITY;
    double strayed;
    status =
        cav_transcription_stopped(tr) ? CAV_INTERRUPTED : stray(r, set[k], set[k] + n, knot, *least, &strayed, &worst);
    if (status != CAV_OK || strayed >= *least) continue;
    *least = strayed, *chosen = k, first = worst;
    memcpy(r->best, r->end, LANES * r->numbers * sizeof(double));
  }
  put_first(r, first);
  return status;
}

cav_status cav_rollout(const cav_transcription *tr, const cav_verification *verification, int sets,
                       const double *const *set, double *gain) {
  rollout r = {.verification = verification};
  const double h = verification->h;
  const size_t block = (size_t)tr->nv * (size_t)tr->nv, n = (size_t)verification->last * block;
  const int last = verification->last, length = (int)fmax(1, round(piece / h)),
            look = (int)fmax(length, round(ahead / h));
  int chosen = 0;
  cav_status status = begin(&r, sets);
  for (int k = 0; k < LANES && status == CAV_OK; k++)
    memcpy(of(&r, r.best, k), cav_lane_state(r.lane[k]), r.numbers * sizeof(double));
  for (int t = 0; t < last && status == CAV_OK;) {
    int knot[3] = {t, t + length < last ? t + length : last, t + look < last ? t + look : last};
    double strayed;
    memcpy(r.begin, r.best, LANES * r.numbers * sizeof(double));
    status = choose(&r, tr, sets, set, n, knot, &chosen, &strayed);
    // lost before the piece ends: what follows does not matter
    if (strayed >= 1 + (knot[2] - knot[1]) * h) knot[1] = last;
    const size_t at = (size_t)t * block, some = (size_t)(knot[1] - t) * block;
    memcpy(gain + at, set[chosen] + at, some * sizeof *gain);
    memcpy(gain + n + at, set[chosen] + n + at, some * sizeof *gain);
    t = knot[1];
  }
  end(&r);
  return status;
}
