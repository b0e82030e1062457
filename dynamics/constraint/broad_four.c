/// The broad phase of four states at once (broad.h), of scenes whose planes are fixed to the world; and where each
/// of these states looks for its contacts alone the poses of all geoms that its narrow phase then looks at. Beside
/// it joints near an end of their range.

// first of all: what is below takes four numbers where it would take one
#include "four_turn.h"

#include "broad.h"
#include "four_states.h"

void cav_limits_prepare(struct cav_geom_cache *cache, const double activation[2]) {
  if (cache->activation[0] == activation[0] && cache->activation[1] == activation[1]) return;
  for (int k = 0; k < 2; k++) cache->activation[k] = activation[k];
  for (int p = 0; p < cache->ncandidate; p++) {
    const candidate *c = cache->candidate + p;
    cache->limit[p] = limit_between(c, c->margin + activation[c->external]);
  }
}

CAV_BY_FOUR int cav_near_run(const struct cav_geom_cache *cache, int begin, int end, int *found) {
  int n = 0;
  for (int p = begin, taken; p < end; p += taken) {
    const candidate *c = cache->candidate + p;
    taken = c->four && p + CAV_LANES <= end ? CAV_LANES : 1;
    // one alone four times; beyond the last centre there is room for one more
    const int step = taken > 1;
    cav_four first[4], second[4], normal[3] = {{0}};
    const double *from[CAV_LANES], *to[CAV_LANES];
    for (int i = 0; i < CAV_LANES; i++)
      from[i] = cache->centre[c[i * step].first], to[i] = cache->centre[c[i * step].second];
    turn_in(from, first);
    turn_in(to, second);
    const double *R = cache->slot[c->first].shape.rotation;
    for (int k = 0; k < 3 && c->plane; k++) normal[k] = CAV_ALL(R[3 * k + 2]);
    const cav_four limit = taken > 1 ? *(const cav_four *)(cache->limit + p) : CAV_ALL(cache->limit[p]);
    int bits = held_bits(separation(c, first, second, normal) < limit);
    if (taken == 1) bits &= 1;
    for (; bits; bits &= bits - 1) found[n++] = p + __builtin_ctz((unsigned)bits);
  }
  return n;
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
    const int near = held_bits(separation(c, l->centre + 3 * c->first, l->centre + 3 * c->second, normal) <
                               CAV_ALL(cache->limit[p]));
    l->near[n] = CAV_LANE_BITS * p + near;
    n += near != 0;
  }
  l->nnear = n;
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

void cav_lanes_near(const cav_model *model, cav_lanes *l, cav_state *state, const double activation[2]) {
  struct cav_geom_cache *cache = state->work->geom;
  cav_limits_prepare(cache, activation);
  for (int k = 0; k < 2; k++) l->activation[k] = activation[k];
  find(model, cache, l);
}

void cav_lanes_place_near(const cav_lanes *l, cav_state *const state[CAV_LANES]) {
  const struct cav_geom_cache *cache = state[0]->work->geom;
  double *centre[CAV_LANES];
  for (int lane = 0; lane < CAV_LANES; lane++) centre[lane] = state[lane]->work->geom->centre[0];
  cav_lanes_scatter(centre, l->centre, 3 * cache->nslot);
  for (int k = 0; k < l->nnear; k++) {
    const candidate *c = cache->candidate + l->near[k] / CAV_LANE_BITS;
    if (!cache->slot[c->first].turned) cav_lanes_pose(l, state, c->first);
    if (!cache->slot[c->second].turned) cav_lanes_pose(l, state, c->second);
  }
}
