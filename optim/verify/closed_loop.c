/// The closed loops of a motion under its gains: those that a certificate asks for, the same and two small pushes for the
/// choice of gains, and the largest push that a certified motion survives. One loop: replay.c.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

// s: impulse of the smallest push over the weight, which changes the velocity of a body that stands by 0.03 m/s; when it
// comes, a fraction of the motion; the number of pushes tried, each twice the one before
static const double small_push = 0.003, pushed_at = 1.0 / 3;
enum { PUSHES = 5 };

// the root link of the heaviest tree, 0 if there is none
static int pushed_link(const cav_verification *verification) {
  const cav_model *model = verification->model;
  int found = 0;
  double most = 0;
  for (int root = 1; root < model->nlink; root++) {
    if (model->link[root].root != root) continue;
    double mass = 0;
    for (int l = root; l < model->nlink; l++) mass += model->link[l].root == root ? model->link[l].mass : 0;
    if (mass > most) most = mass, found = root;
  }
  return found;
}

// the way that ends farthest off comes first: of the next push, twice as large, it is most likely to be lost
static void put_worst_first(int order[4], const double error[4]) {
  for (int i = 1; i < 4; i++)
    for (int k = i; k > 0 && error[order[k]] > error[order[k - 1]]; k--) {
      const int held = order[k];
      order[k] = order[k - 1], order[k - 1] = held;
    }
}

size_t cav_before_numbers(const cav_verification *verification) {
  return (size_t)verification->model->nq + 2 * (size_t)verification->model->nv;
}

/// Pushes of one size all four ways, worst way first, until one is lost; order is that of the next size.
static cav_status push_all_ways(const cav_verification *verification, const double *gain_q, const double *gain_v,
                                double size, cav_disturbance *push, int order[4], int *survived) {
  static const double way[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  struct cav_follow follow = {0};
  double error[4];
  cav_status status = CAV_OK;
  for (int i = 0; i < 4 && status == CAV_OK && !*follow.lost; i++) {
    const int k = order[i];
    push->impulse[0] = size * way[k][0], push->impulse[1] = size * way[k][1];
    status = cav_replay_own(verification, 0, gain_q, gain_v, push, &follow);
    error[k] = follow.error;
  }
  *survived = status == CAV_OK && !*follow.lost;
  if (*survived) put_worst_first(order, error);
  return status;
}

cav_status cav_closed_loops_push(const cav_verification *verification, const double *gain_q, const double *gain_v,
                                 double *survived) {
  cav_before before = {.x = malloc(cav_before_numbers(verification) * sizeof *before.x)};
  cav_disturbance push = {.link = pushed_link(verification), .fraction = pushed_at, .before = &before};
  cav_status status = before.x ? CAV_OK : CAV_NO_MEMORY;
  int order[4] = {0, 1, 2, 3}, stands = push.link > 0;
  *survived = stands ? 0 : NAN;
  // most motions survive the second: the first is tried where it is lost
  for (int rung = 1; rung < PUSHES && stands && status == CAV_OK; rung++) {
    const double size = ldexp(small_push * verification->weight, rung);
    status = push_all_ways(verification, gain_q, gain_v, size, &push, order, &stands);
    if (stands) *survived = size;
  }
  if (*survived == 0 && status == CAV_OK) {
    const double size = small_push * verification->weight;
    status = push_all_ways(verification, gain_q, gain_v, size, &push, order, &stands);
    if (stands) *survived = size;
  }
  free(before.x);
  return status;
}

cav_status cav_closed_loops_begin(cav_verification *verification, const cav_problem *problem,
                                  const cav_trajectory *trajectory, const cav_options *contact, cav_error *error) {
  cav_status status = cav_verification_begin(verification, problem, trajectory, contact, NULL, NULL, error);
  int nv = status == CAV_OK ? verification->model->nv : 0;
  for (int t = 0; t < verification->rows && status == CAV_OK; t++) {
    const double *v = verification->v + t * nv;
    verification->state->options = cav_verification_law(verification, t);
    status = cav_inverse(verification->model, verification->state, verification->q + t * verification->model->nq, v,
                         v + nv, verification->u + t * nv);
  }
  return status;
}

cav_status cav_closed_loop(const cav_verification *verification, int loop, const double *gain_q, const double *gain_v,
                           cav_before *before, struct cav_follow *follow) {
  cav_disturbance disturbance = {.fraction = pushed_at};
  if (loop == CAV_LOOP_CLAIMED) return cav_replay_closed(verification, &verification->law, gain_q, gain_v, follow);
  if (loop == CAV_LOOP_FINE) return cav_replay_own(verification, 1, gain_q, gain_v, NULL, follow);
  if (loop == CAV_LOOP_OWN) {
    disturbance.before = before;
  } else if (loop < CAV_LOOP_PUSHED) {
    disturbance.start = loop - CAV_LOOP_START + 1;
  } else {
    // along a diagonal, so that planar motions feel it too
    double along = (loop == CAV_LOOP_PUSHED ? 1 : -1) * small_push * verification->weight * sqrt(0.5);
    disturbance.link = pushed_link(verification);
    disturbance.impulse[0] = disturbance.impulse[1] = along;
    disturbance.before = before;
  }
  return cav_replay_own(verification, 0, gain_q, gain_v, &disturbance, follow);
}

cav_status cav_closed_loops_own(const cav_verification *verification, const struct cav_follow *known,
                                const double *gain_q, const double *gain_v, struct cav_follow *follow) {
  *follow = (struct cav_follow){0};
  for (int loop = CAV_LOOP_OWN; loop < CAV_LOOP_PUSHED && !*follow->lost; loop++) {
    if (loop == CAV_LOOP_CLAIMED) continue;
    struct cav_follow now;
    cav_status status = CAV_OK;
    if (known)
      now = known[loop];
    else
      status = cav_closed_loop(verification, loop, gain_q, gain_v, NULL, &now);
    if (status != CAV_OK) return status;
    double asked = fmax(now.asked, follow->asked);
    if (loop == CAV_LOOP_OWN || *now.lost || now.error > follow->error) *follow = now;
    follow->asked = asked;
    const size_t said = strlen(follow->lost);
    if (*now.lost && loop >= CAV_LOOP_START)
      snprintf(follow->lost + said, sizeof follow->lost - said, ", from a start that is %g rad and rad/s off",
               CAV_START_VELOCITY);
  }
  return CAV_OK;
}

cav_status cav_closed_loops_certify(const cav_verification *verification, const cav_followed *followed,
                                    const double *gain_q, const double *gain_v, cav_replay *replay) {
  const struct cav_follow *known = cav_followed_find(followed, verification, gain_q, gain_v);
  cav_status status = CAV_OK;
  if (known)
    replay->closed = known[CAV_LOOP_CLAIMED];
  else
    status = cav_closed_loop(verification, CAV_LOOP_CLAIMED, gain_q, gain_v, NULL, &replay->closed);
  if (status != CAV_OK) return status;
  return cav_closed_loops_own(verification, known, gain_q, gain_v, &replay->own);
}
