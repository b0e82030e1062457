/// The narrow phase of a pair in four states: by vectors where its geoms are known there (touch_four.c), else one
/// state after the other, whose points are then put side by side by their features.
#include <stddef.h>

// first of what is written over its numbers: what is below takes four numbers where it would take one
#include "four_turn.h"

#include "broad.h"
#include "four_states.h"

CAV_BY_FOUR void cav_lanes_pose(const cav_lanes *l, cav_state *const state[CAV_LANES], int i) {
  const struct cav_geom_cache *cache = state[0]->work->geom;
  const cav_geom *geom = cache->slot[i].geom;
  cav_four pose[12], own[9];
  _Static_assert(offsetof(cav_shape, rotation) == offsetof(cav_shape, pos) + 3 * sizeof(double), "twelve in a row");
  take_numbers(own, geom->rotation, 9);
  copy3(pose, l->centre + 3 * i);
  matmul3(pose + 3, l->link[geom->link].rotation, own);
  double *to[CAV_LANES];
  for (int lane = 0; lane < CAV_LANES; lane++) {
    slot *s = state[lane]->work->geom->slot + i;
    to[lane] = s->shape.pos;
    s->turned = 1;
  }
  for (int k = 0; k < 12; k += 4) turn_out(pose + k, (double *const[]){to[0] + k, to[1] + k, to[2] + k, to[3] + k});
}

// points of the states of set bits, each state by itself
static int touch_singly(const cav_lanes *l, cav_state *const state[CAV_LANES], const candidate *c, double margin,
                        int bits, cav_touch_four *touch) {
  cav_touch one[CAV_LANES][CAV_TOUCH_MAX];
  int count[CAV_LANES] = {0}, next[CAV_LANES] = {0}, n = 0;
  const int of[2] = {c->first, c->second};
  for (int k = 0; k < 2; k++) {
    if (!state[0]->work->geom->slot[of[k]].fixed) cav_lanes_pose(l, state, of[k]);
  }
  for (int lane = 0; lane < CAV_LANES; lane++) {
    const slot *s = state[lane]->work->geom->slot;
    if (bits >> lane & 1) count[lane] = cav_collide_shapes(&s[of[0]].shape, &s[of[1]].shape, margin, one[lane]);
  }
  for (;; n++) {
    // the least feature that some state still has, in all that have it
    const cav_touch *first = NULL;
    for (int lane = 0; lane < CAV_LANES; lane++) {
      const cav_touch *t = &one[lane][next[lane]];
      if (next[lane] < count[lane] && (!first || t->feature < first->feature)) first = t;
    }
    if (!first) return n;
    cav_touch_four *to = touch + n;
    to->feature = first->feature;
    to->bits = 0;
    for (int lane = 0; lane < CAV_LANES; lane++) {
      const int here = next[lane] < count[lane] && one[lane][next[lane]].feature == to->feature;
      const cav_touch *t = here ? &one[lane][next[lane]++] : first;
      to->bits |= here << lane;
      to->dist[lane] = t->dist;
      for (int i = 0; i < 3; i++)
        to->pos[i][lane] = t->pos[i], to->normal[i][lane] = t->normal[i], to->tangent[i][lane] = t->tangent[i];
    }
  }
}

int cav_lanes_touches(const cav_lanes *l, cav_state *const state[CAV_LANES], int k, cav_touch_four *touch) {
  const struct cav_geom_cache *cache = state[0]->work->geom;
  const candidate *c = cache->candidate + l->near[k] / CAV_LANE_BITS;
  const int bits = l->near[k] % CAV_LANE_BITS, of[2] = {c->first, c->second};
  const double margin = c->margin + l->activation[c->external];
  cav_geom_four geom[2];
  for (int i = 0; i < 2; i++) {
    const slot *s = cache->slot + of[i];
    geom[i] = (cav_geom_four){s->geom, l->centre + 3 * of[i], s->fixed ? NULL : l->link[s->geom->link].rotation};
  }
  if (cav_touches_by_four(geom[0].geom->type, geom[1].geom->type)) {
    const int count = cav_touches_four(&geom[0], &geom[1], margin, bits, touch);
    if (count >= 0) return count;
  }
  return touch_singly(l, state, c, margin, bits, touch);
}
