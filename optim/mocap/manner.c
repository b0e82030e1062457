/// Landing force, flailing arms, and what left and right do differently, from configurations alone.
#include "manner.h"

#include <math.h>

#include "math3.h"
#include "periodicity.h"
#include "role.h"

// m (a - g) against gravity, over m |g|
static double landing(const cav_model *model, const cav_trajectory *motion, const double *com) {
  const double *g = model->gravity;
  double pull = norm3(g), h2 = motion->timestep * motion->timestep, most = -INFINITY;
  if (!(pull > 0)) return NAN;
  for (int t = 1; t + 1 < motion->nknot; t++) {
    const double *c = com + 3 * t;
    double up = 0;
    for (int k = 0; k < 3; k++) up -= ((c[k + 3] - 2 * c[k] + c[k - 3]) / h2 - g[k]) * g[k] / (pull * pull);
    most = fmax(most, up);
  }
  return most;
}

// where a body's centre of mass is, seen from the trunk
static void place(const cav_model *model, const cav_state *state, int trunk, int body, double out[3]) {
  cav_pose from, at;
  double way[3];
  cav_object_pose(model, state, CAV_OBJECT_XBODY, trunk, &from);
  cav_object_pose(model, state, CAV_OBJECT_BODY, body, &at);
  sub3(way, at.pos, from.pos);
  rotate_back(out, from.rotation, way);
}

static cav_status flailing(const cav_model *model, const cav_trajectory *motion, cav_state *state, double *speed) {
  cav_roles roles;
  double before[2][3], now[3], sum = 0;
  cav_status status = cav_roles_find(model, state, &roles);
  *speed = NAN;
  if (status) return status;
  int trunk = roles.body[CAV_ROLE_TORSO], hand[2] = {roles.body[CAV_ROLE_RIGHT_HAND], roles.body[CAV_ROLE_LEFT_HAND]};
  if (trunk < 0 || hand[0] < 0 || hand[1] < 0) return CAV_OK;
  for (int t = 0; t < motion->nknot && !status; t++) {
    status = cav_position(model, state, motion->q + (size_t)t * (size_t)motion->nq);
    for (int i = 0; i < 2 && !status; i++) {
      double way[3];
      place(model, state, trunk, hand[i], now);
      if (t > 0) sub3(way, now, before[i]), sum += dot3(way, way);
      copy3(before[i], now);
    }
  }
  *speed = sqrt(sum / (2 * (motion->nknot - 1))) / motion->timestep;
  return status;
}

static double range_of(const cav_trajectory *motion, int q) {
  double low = INFINITY, high = -INFINITY;
  for (int t = 0; t < motion->nknot; t++) {
    low = fmin(low, motion->q[(size_t)t * (size_t)motion->nq + (size_t)q]);
    high = fmax(high, motion->q[(size_t)t * (size_t)motion->nq + (size_t)q]);
  }
  return high - low;
}

static double asymmetry(const cav_model *model, const cav_trajectory *motion) {
  double apart = 0, sum = 0;
  int pairs = 0;
  for (int j = 0; j < model->njoint; j++) {
    int other = cav_joint_other_side(model, j);
    cav_joint_type type = model->joint[j].type;
    if (other <= j || (type != CAV_JOINT_HINGE && type != CAV_JOINT_SLIDE) || model->joint[other].type != type)
      continue;
    double a = range_of(motion, model->joint[j].q), b = range_of(motion, model->joint[other].q);
    apart += fabs(a - b), sum += a + b, pairs++;
  }
  return !pairs ? NAN : sum > 0 ? 100 * apart / sum : 0;
}

cav_status cav_manner_measure(const cav_model *model, const cav_trajectory *motion, const double *com, cav_state *state,
                              cav_quality *quality) {
  quality->landing = landing(model, motion, com);
  quality->asymmetry = asymmetry(model, motion);
  return flailing(model, motion, state, &quality->flailing);
}
