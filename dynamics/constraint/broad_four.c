/// The broad phase of four states at once (broad.h), of scenes whose planes are fixed to the world; and the poses of all geoms
/// that some narrow phase then looks at. Beside it joints near an end of their range.

// first of all: what is below takes four numbers where it would take one
#include "four_turn.h"

#include <stddef.h>

#include "broad.h"
#include "four_states.h"

// what the broad phase compares with, which few calls change
static void find_limits(const cav_model *model, const struct cav_geom_cache *cache, cav_lanes *l,
                        const double activation[2]) {
  if (l->activation[0] == activation[0] && l->activation[1] == activation[1]) return;
  for (int k = 0; k < 2; k++) l->activation[k] = activation[k];
  for (int p = 0; p < model->npair; p++) {
    const candidate *c = cache->candidate + p;
    l->limit[p] = limit_between(c, c->margin + activation[c->external]);
  }
}

CAV_BY_FOUR static void find(const cav_model *model, const struct cav_geom_cache *cache, cav_lanes *l) {
  for (int i = 0; i < cache->nslot; i++) {
    const slot *s = cache->slot + i;
    const cav_lane_pose *link = l->link + s->geom->link;
    if (s->fixed)
      take_numbers(l->centre + 3 * i, cache->centre[i], 3);
    else
      find_centre(s->geom, link->pos, link->rotation, l->centre + 3 * i);
  }
  int n = 0;
  for (int p = 0; p < model->npair; p++) {
    const candidate *c = cache->candidate + p;
    cav_four normal[3] = {{0}};
    const double *R = cache->slot[c->first].shape.rotation;
    for (int k = 0; k < 3 && c->plane; k++) normal[k] = CAV_ALL(R[3 * k + 2]);
    const int near =
        held_bits(separation(c, l->centre + 3 * c->first, l->centre + 3 * c->second, normal) < CAV_ALL(l->limit[p]));
    l->near[n] = CAV_LANE_BITS * p + near;
    n += near != 0;
  }
  l->nnear = n;
}

// pose of a geom in four states, from its centre there
CAV_BY_FOUR static void pose_slot(const cav_lanes *l, struct cav_geom_cache *const cache[CAV_LANES], int i) {
  const cav_geom *geom = cache[0]->slot[i].geom;
  cav_four pose[12], own[9];
  _Static_assert(offsetof(cav_shape, rotation) == offsetof(cav_shape, pos) + 3 * sizeof(double), "twelve in a row");
  take_numbers(own, geom->rotation, 9);
  copy3(pose, l->centre + 3 * i);
  matmul3(pose + 3, l->link[geom->link].rotation, own);
  double *to[CAV_LANES];
  for (int lane = 0; lane < CAV_LANES; lane++) {
    to[lane] = cache[lane]->slot[i].shape.pos;
    cache[lane]->slot[i].turned = 1;
  }
  for (int k = 0; k < 12; k += 4) turn_out(pose + k, (double *const[]){to[0] + k, to[1] + k, to[2] + k, to[3] + k});
}

CAV_BY_FOUR void cav_lanes_limits(const cav_model *model, cav_lanes *l, const cav_state *state) {
  const cav_workspace *w = state->work;
  const double beyond = cav_limit_activation(state, 0);
  int n = 0;
  for (int i = 0; i < w->nlimit; i++) {
    const cav_joint *joint = &model->joint[w->limit[i]];
    const cav_four at = l->q[joint->q], activation = CAV_ALL(joint->margin + beyond);
    const cav_four_masks low = at - joint->range[0] < activation, high = joint->range[1] - at < activation;
    const int near = joint->type == CAV_JOINT_BALL ? CAV_LANE_BITS - 1 : held_bits(low | high);
    l->bounded[n] = CAV_LANE_BITS * i + near;
    n += near != 0;
  }
  l->nbounded = n;
}

void cav_lanes_near(const cav_model *model, cav_lanes *l, cav_state *const state[CAV_LANES],
                    const double activation[2]) {
  struct cav_geom_cache *cache[CAV_LANES];
  for (int lane = 0; lane < CAV_LANES; lane++) cache[lane] = state[lane]->work->geom;
  find_limits(model, cache[0], l, activation);
  find(model, cache[0], l);
  double *centre[CAV_LANES];
  for (int lane = 0; lane < CAV_LANES; lane++) centre[lane] = cache[lane]->centre[0];
  cav_lanes_scatter(centre, l->centre, 3 * cache[0]->nslot);
  for (int k = 0; k < l->nnear; k++) {
    const candidate *c = cache[0]->candidate + l->near[k] / CAV_LANE_BITS;
    if (!cache[0]->slot[c->first].turned) pose_slot(l, cache, c->first);
    if (!cache[0]->slot[c->second].turned) pose_slot(l, cache, c->second);
  }
}
