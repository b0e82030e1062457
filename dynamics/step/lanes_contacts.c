/// Contacts of four states side by side: a point of one feature of one pair in all states that have it, from where
/// it is to the wrenches on its two links, which are the same links everywhere. Axes, R (27), velocities, the exact
/// law of rows with and without friction and wrenches by vectors, with the operations and the order of one state
/// (collide.c, limits.c, inverse.c, contact_law.c); what else a law may be, state by state by those themselves.
/// States without the point keep their forces.
#include <math.h>

// first of what is written over its numbers: what is below takes four where it would take one
#include "by_four.h"

#include "lanes_law.h"
#include "spatial.h"
#include "step.h"

typedef cav_four_masks masks;

/// What does not change from pair to pair.
typedef struct scene {
  const cav_model *model;
  cav_state *const *state;
  const cav_four *reference, *now, *next; ///< of links; spatial velocities
  cav_four *force;
  int vectors; ///< whether the law goes by them
  double scale, inverse_impratio;
} scene;

/// A point in the states of set bits.
typedef struct point {
  const cav_pair_law *law;
  int bits, feature, dim;
  cav_four dist, pos[3], frame[9], arm[2][3];
  cav_four now[CAV_IMPULSE_DIM], next[CAV_IMPULSE_DIM], impulse[CAV_IMPULSE_DIM];
} point;

// tangents of a normal: along a direction, or where that is none along the world's y or z
CAV_INLINE void find_tangents(const cav_four along[3], cav_four frame[9]) {
  cav_four *n = frame, *s = frame + 3;
  axpy3(s, along, -dot3(n, along), n);
  const masks none = dot3(s, s) < 1e-12;
  if (any(none)) {
    const masks y = sizes(n[1]) < 0.5;
    cav_four other[3] = {CAV_ALL(0), choose(y, CAV_ALL(1), CAV_ALL(0)), choose(y, CAV_ALL(0), CAV_ALL(1))};
    axpy3(other, other, -dot3(n, other), n);
    for (int k = 0; k < 3; k++) s[k] = choose(none, other[k], s[k]);
  }
  const cav_four length = roots(dot3(s, s));
  const masks some = length > 0;
  const cav_four inverse = 1 / choose(some, length, CAV_ALL(1));
  for (int k = 0; k < 3; k++) s[k] = choose(some, inverse * s[k], CAV_ALL(k == 0));
  cross3(frame + 6, n, s);
}

// in the axes, from where the point is on both links
CAV_INLINE void find_velocity(const point *c, int dim, const cav_four *velocity, cav_four *out) {
  cav_four linear[3], angular[3], at[3];
  zero3(linear);
  zero3(angular);
  for (int k = 0; k < 2; k++) {
    const int link = c->law->link[k];
    const cav_four *V = velocity + 6 * link, sign = CAV_ALL(k ? 1 : -1);
    if (link == 0) continue;
    copy3(at, V + 3);
    cross_add3(at, V, c->arm[k]);
    axpy3(linear, linear, sign, at);
    if (dim > 3) axpy3(angular, angular, sign, V);
  }
  for (int k = 0; k < dim; k++) out[k] = dot3(c->frame + 3 * (k % 3), k < 3 ? linear : angular);
}

// where a point is, and how it moves
CAV_INLINE void open_rows(const scene *s, const cav_touch_four *touch, int dim, point *c) {
  c->bits = touch->bits;
  c->feature = touch->feature;
  c->dist = touch->dist;
  copy3(c->pos, touch->pos);
  copy3(c->frame, touch->normal);
  if (dim > 1) find_tangents(touch->tangent, c->frame);
  for (int k = 0; k < 2; k++)
    if (c->law->link[k]) sub3(c->arm[k], c->pos, s->reference + 3 * c->law->link[k]);
  find_velocity(c, dim, s->now, c->now);
  find_velocity(c, dim, s->next, c->next);
}

// impulses by the exact law; 0: some state's is not of ordinary size
CAV_INLINE int find_impulses(const scene *s, int dim, point *c) {
  const cav_pair_law *law = c->law;
  const double damping = law->row.damping, margin = law->pair->margin, *friction = law->friction;
  cav_four R[3], stiffness, g[3];
  law_at(&law->row, c->dist - margin, &R[0], &stiffness);
  const cav_four tangential = larger_four(CAV_ALL(R_MIN), R[0] * s->inverse_impratio);
  cav_four size = CAV_ALL(0);
  for (int k = 0; k < dim; k++) {
    if (k > 0) R[k] = tangential * law->ratio[k] * law->ratio[k];
    cav_four target = (1 - damping) * c->now[k];
    if (k == 0) target = target - stiffness * (c->dist - margin);
    g[k] = (target - c->next[k]) / R[k];
    size = larger_four(size, sizes(g[k]));
  }
  // what would overflow or vanish is a single one's
  const masks ordinary = ((size <= 1e100) & (size >= 1e-100)) | (size == 0);
  if (held_bits(~ordinary) & c->bits) return 0;
  if (dim == 1) {
    c->impulse[0] = choose(g[0] <= 0, CAV_ALL(0), g[0]);
    return 1;
  }

  const cav_four rho = R[1] * friction[0] * friction[0], tangent = roots(rho / R[0]);
  if (held_bits(~(tangent > 0)) & c->bits) return 0;
  const cav_four side[2] = {g[1] / friction[0], g[2] / friction[1]};
  const cav_four root = roots(R[0]), length = roots(rho) * roots(side[0] * side[0] + side[1] * side[1]);
  const cav_four normal = root * g[0], top = normal + length * tangent, cos2 = 1 / (1 + tangent * tangent);
  const masks inside = normal * tangent >= length, off = top <= 0, on = ~(inside | off);
  const cav_four on_surface = cos2 * top, pushed = choose(off, CAV_ALL(0), on_surface);
  const cav_four slide = tangent * on_surface / choose(on, length, CAV_ALL(1));
  const cav_four ratio = choose(inside, CAV_ALL(1), choose(off, CAV_ALL(0), slide));
  c->impulse[0] = choose(inside, g[0], pushed / root);
  for (int k = 1; k < 3; k++) c->impulse[k] = ratio * g[k];
  return 1;
}

// impulses of each state alone
CAV_BY_FOUR static void find_singly(const scene *s, point *c) {
  const cav_pair *pair = c->law->pair;
  const int dim = pair->dim;
  for (int k = 0; k < dim; k++) c->impulse[k] = CAV_ALL(0);
  for (int lane = 0; lane < CAV_LANES; lane++) {
    if (!(c->bits >> lane & 1)) continue;
    cav_contact one = {.pair = (int)(pair - s->model->pair), .feature = c->feature, .dim = dim, .margin = pair->margin};
    memcpy(one.friction, pair->friction, sizeof one.friction);
    one.link1 = c->law->link[0], one.link2 = c->law->link[1];
    one.dist = c->dist[lane];
    for (int k = 0; k < 3; k++) one.pos[k] = c->pos[k][lane];
    for (int k = 0; k < (dim > 1 ? 9 : 3); k++) one.frame[k] = c->frame[k][lane];
    for (int k = 0; k < dim; k++) one.velocity[k] = c->now[k][lane], one.velocity_next[k] = c->next[k][lane];
    cav_contact_soften(s->state[lane], &one);
    cav_contact_impulse(s->state[lane], &one, NULL, NULL);
    for (int k = 0; k < dim; k++) c->impulse[k][lane] = one.impulse[k];
  }
}

// the force and moment of the impulses on both links
CAV_INLINE void push_rows(const scene *s, const point *c, int dim) {
  const masks bit = {1, 2, 4, 8}, here = (bit & (masks){c->bits, c->bits, c->bits, c->bits}) != 0;
  cav_four force[3], moment[3], F[6];
  zero3(moment);
  scale3(force, s->scale * c->impulse[0], c->frame);
  for (int k = 1; k < dim; k++) {
    cav_four *sum = k < 3 ? force : moment;
    axpy3(sum, sum, s->scale * c->impulse[k], c->frame + 3 * (k % 3));
  }
  for (int k = 1; k >= 0; k--) {
    const int link = c->law->link[k];
    if (link == 0) continue;
    if (k == 0) scale3(force, CAV_ALL(-1), force), scale3(moment, CAV_ALL(-1), moment);
    cav_four *to = s->force + 6 * link;
    copy6(F, to);
    cross_add3(F, c->arm[k], force);
    add3(F + 3, F + 3, force);
    if (dim > 3) add3(F, F, moment);
    for (int i = 0; i < 6; i++) to[i] = choose(here, F[i], to[i]);
  }
}

// the usual numbers of rows apart, so that what is done to them needs no loops

CAV_BY_FOUR static void open_point(const scene *s, const cav_touch_four *touch, const cav_pair_law *law, point *c) {
  c->law = law;
  c->dim = law->pair->dim;
  if (c->dim == 3)
    open_rows(s, touch, 3, c);
  else if (c->dim == 1)
    open_rows(s, touch, 1, c);
  else
    open_rows(s, touch, c->dim, c);
}

CAV_BY_FOUR static void press_points(const scene *s, point *c, int n) {
  for (int i = 0; i < n; i++, c++) {
    const int found = s->vectors && (c->dim == 3 ? find_impulses(s, 3, c) : c->dim == 1 ? find_impulses(s, 1, c) : 0);
    if (!found) find_singly(s, c);
  }
}

CAV_BY_FOUR static void push_points(const scene *s, const point *c, int n) {
  for (int i = 0; i < n; i++, c++) {
    if (c->dim == 3)
      push_rows(s, c, 3);
    else if (c->dim == 1)
      push_rows(s, c, 1);
    else
      push_rows(s, c, c->dim);
  }
}

static void find_law(const scene *s, int p, cav_pair_law *law) {
  const cav_state *state = s->state[0];
  const cav_pair *pair = &s->model->pair[p];
  law->pair = pair;
  law->link[0] = s->model->geom[pair->geom1].link;
  law->link[1] = s->model->geom[pair->geom2].link;
  if (!s->vectors) return;
  law->row = row_law_of(state, &pair->softness,
                        contact_weight(state, pair) / (pair->external ? 1 : state->options.self_stiffness));
  for (int k = 1; k < pair->dim; k++) {
    law->friction[k - 1] = larger(pair->friction[k - 1], FRICTION_MIN);
    law->ratio[k] = law->friction[k - 1] == law->friction[0] ? 1 : law->friction[0] / law->friction[k - 1];
  }
}

void cav_lanes_contacts(const cav_model *model, cav_lanes *l, cav_state *const state[CAV_LANES]) {
  enum { TOGETHER = 8 };
  const cav_options *o = &state[0]->options;
  scene s = {.model = model, .state = state, .reference = l->reference, .next = l->velocity_next, .force = l->force};
  if (!l->nnear) return;
  s.now = cav_takes_mean(state[0]) ? cav_lanes_velocities(model, l) : l->velocity;
  s.vectors = !(o->smoothing > 0) && o->sliding == CAV_SLIDING_CONVEX;
  s.scale = -1 / o->timestep;
  s.inverse_impratio = 1 / larger(R_MIN, o->impratio);
  // some at a time, so that the processor works at several, but still in their order
  point waiting[TOGETHER];
  int n = 0;
  for (int k = 0; k < l->nnear; k++) {
    cav_touch_four touch[CAV_LANES * CAV_TOUCH_MAX];
    const int count = cav_lanes_touches(l, state, k, touch), p = l->near[k] / CAV_LANE_BITS;
    if (count && !l->law[p].pair) find_law(&s, p, &l->law[p]);
    for (int i = 0; i < count; i++) {
      open_point(&s, touch + i, &l->law[p], waiting + n++);
      if (n < TOGETHER) continue;
      press_points(&s, waiting, n);
      push_points(&s, waiting, n);
      n = 0;
    }
  }
  press_points(&s, waiting, n);
  push_points(&s, waiting, n);
}
