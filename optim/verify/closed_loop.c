/// The closed loops of a motion under its gains: those that a certificate asks for, the same and two small pushes for the
/// choice of gains, the largest push that a certified motion survives, and starts that none of these has. One loop: replay.c.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

// s: impulse of the smallest push over the weight, which changes the velocity of a body that stands by 0.03 m/s; when it
// comes, a fraction of the motion; rungs of pushes, each twice the one before
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

size_t cav_before_numbers(const cav_verification *verification) {
  return (size_t)verification->model->nq + 2 * (size_t)verification->model->nv;
}

/// Whether the motion survives the push of a rung, each twice the one before, one of four ways.
static cav_status push_way(const cav_verification *verification, const double *gain_q, const double *gain_v, int way,
                           int rung, cav_disturbance *push, int *survives) {
  static const double to[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  struct cav_follow follow = {0};
  const double size = ldexp(small_push * verification->weight, rung);
  push->impulse[0] = size * to[way][0], push->impulse[1] = size * to[way][1];
  const cav_status status = cav_replay_own(verification, 0, gain_q, gain_v, push, &follow);
  *survives = status == CAV_OK && !*follow.lost;
  return status;
}

cav_status cav_closed_loops_push(const cav_verification *verification, const double *gain_q, const double *gain_v,
                                 double *survived) {
  cav_before before = {.x = malloc(cav_before_numbers(verification) * sizeof *before.x)};
  cav_disturbance push = {.link = pushed_link(verification), .fraction = pushed_at, .before = &before};
  cav_status status = before.x ? CAV_OK : CAV_NO_MEMORY;
  int top = 0, survives = push.link > 0;
  *survived = survives ? 0 : NAN;
  // up one way from the second rung on, which most motions survive, then down the others
  for (int rung = 1; rung < PUSHES && survives && status == CAV_OK; rung++) {
    status = push_way(verification, gain_q, gain_v, 0, rung, &push, &survives);
    if (survives) top = rung;
  }
  for (int way = top > 0; way < 4 && top >= 0 && push.link > 0 && status == CAV_OK; way++) {
    for (survives = 0; top >= 0 && !survives && status == CAV_OK; top -= !survives)
      status = push_way(verification, gain_q, gain_v, way, top, &push, &survives);
  }
  if (status == CAV_OK && push.link > 0 && top >= 0) *survived = ldexp(small_push * verification->weight, top);
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

cav_lane *cav_closed_loop_lane(const cav_verification *verification, int loop) {
  if (loop == CAV_LOOP_CLAIMED) return cav_lane_claimed(verification);
  return cav_lane_own(verification, loop == CAV_LOOP_FINE, loop < CAV_LOOP_START ? 0 : loop - CAV_LOOP_START + 1);
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

cav_status cav_verify_starts(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                             const double *gain_q, const double *gain_v, int starts, cav_starts_report *report,
                             cav_error *error) {
  *report = (cav_starts_report){.soonest_lost = NAN, .end_error_m = NAN};
  if (starts < 1) return cav_verification_fail(error, CAV_BAD_INPUT, "expected one start or more, got %d", starts);
  cav_verification verification;
  cav_status status = cav_closed_loops_begin(&verification, problem, trajectory, contact, error);
  for (int i = 0; i < starts && status == CAV_OK; i++) {
    const cav_disturbance off = {.start = CAV_STARTS + 1 + i};
    struct cav_follow follow;
    status = cav_replay_own(&verification, 0, gain_q, gain_v, &off, &follow);
    if (status != CAV_OK) break;
    report->starts++;
    report->followed += !*follow.lost;
    if (*follow.lost)
      report->soonest_lost = fmin(report->soonest_lost, follow.seconds);
    else
      report->end_error_m = fmax(report->end_error_m, follow.error);
  }
  cav_verification_end(&verification);
  return status;
}
