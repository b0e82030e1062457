/// Rates of contact points by the six directions of a twist of the second shape against the first, for all points of a
/// pair at once: of capsules and spheres on boxes in closed form (segment.c); of others by differences, one-sided where a
/// point is gone on one side.
#include "capsules_four.h"
#include "pairs.h"
#include "vectors.h"

// steps: rad, and fraction of the size of the smaller shape
static const double ROTATION_STEP = 1e-5, SHIFT_STEP = 1e-5;

// moves a shape by a fraction of a unit twist about a point
static void twist_shape(const cav_shape *from, const double point[3], int k, double step, cav_shape *to) {
  *to = *from;
  if (k >= 3) {
    to->pos[k - 3] += step;
    return;
  }
  double w[3] = {0, 0, 0}, quat[4], R[9], arm[3];
  w[k] = step;
  quat_exp(quat, w);
  quat_matrix(R, quat);
  matmul3(to->rotation, R, from->rotation);
  sub3(arm, from->pos, point);
  rotate(arm, R, arm);
  add3(to->pos, point, arm);
}

// the point of a manifold with that feature, NULL if it is not there
static const cav_touch *find(const cav_touch *touch, int count, int feature) {
  for (int i = 0; i < count; i++) {
    if (touch[i].feature == feature) return &touch[i];
  }
  return NULL;
}

void cav_manifolds_start(cav_pair_manifolds *m, int pair, double size, double margin, cav_hint *hint) {
  m->pair = pair;
  m->displaced = m->closed = 0;
  m->faces = -1;
  m->size = size;
  m->margin = margin;
  m->hint = hint;
}

// step k of the twelve: the one before a unit twist, then the one after it
static double step_of(int k, double shift) {
  const double step = k / 2 < 3 ? ROTATION_STEP : shift;
  return k % 2 ? step : -step;
}

// those twelve of two capsules, four at once; 0 where they have to be taken one by one
static int displace_capsules(cav_pair_manifolds *m, const double point[3], double shift, double margin) {
  double place[3][3][4], axis[3][3][4], arm[3], along[3];
  column3(along, m->b.rotation, 2);
  sub3(arm, m->b.pos, point);
  for (int k = 0; k < 12; k++) {
    double x[3], z[3], w[3] = {0, 0, 0}, quat[4], R[9];
    copy3(x, m->b.pos);
    copy3(z, along);
    if (k / 2 < 3) {
      w[k / 2] = step_of(k, shift);
      quat_exp(quat, w);
      quat_matrix(R, quat);
      rotate(z, R, along);
      rotate(x, R, arm);
      add3(x, point, x);
    } else {
      x[k / 2 - 3] += step_of(k, shift);
    }
    for (int i = 0; i < 3; i++) place[k / 4][i][k % 4] = x[i], axis[k / 4][i][k % 4] = z[i];
  }
  for (int g = 0; g < 3; g++) {
    cav_touch *const touch[4] = {m->touch[4 * g], m->touch[4 * g + 1], m->touch[4 * g + 2], m->touch[4 * g + 3]};
    if (!cav_capsules_four(&m->a, m->b.size[0], m->b.size[1], (const double(*)[4])place[g], (const double(*)[4])axis[g],
                           margin, m->count + 4 * g, touch))
      return 0;
  }
  return 1;
}

// the narrow phase of a pair as it is and after small twists of the second shape about a point, both ways
static void displace(cav_pair_manifolds *m, const double point[3]) {
  const double shift = SHIFT_STEP * m->size, margin = m->margin + 4 * shift;
  copy3(m->point, point);
  if (m->b.type == CAV_GEOM_BOX && m->a.type <= CAV_GEOM_CAPSULE && m->a.type != CAV_GEOM_PLANE) {
    m->count[12] = cav_segment_rates(&m->a, &m->b, margin, point, m->touch[12], m->rate);
    m->displaced = m->closed = m->count[12] >= 0;
    if (m->closed) return;
  }
  // every routine keeps to CAV_TOUCH_MAX: collide.c asserts it for the same shapes
  m->count[12] = cav_collide_shapes(&m->a, &m->b, margin, m->touch[12]);
  m->displaced = 1;
  if (m->a.type == CAV_GEOM_CAPSULE && m->b.type == CAV_GEOM_CAPSULE && cav_dense_lanes() >= 4 &&
      displace_capsules(m, point, shift, margin))
    return;
  for (int k = 0; k < 12; k++) {
    cav_shape moved;
    twist_shape(&m->b, point, k / 2, step_of(k, shift), &moved);
    m->count[k] = cav_collide_shapes(&m->a, &moved, margin, m->touch[k]);
  }
}

// differences of two points over a step
static void divide(const cav_touch *low, const cav_touch *high, double inverse, cav_touch *rate) {
  rate->feature = high->feature;
  rate->dist = (high->dist - low->dist) * inverse;
  for (int i = 0; i < 3; i++) {
    rate->pos[i] = (high->pos[i] - low->pos[i]) * inverse;
    rate->normal[i] = (high->normal[i] - low->normal[i]) * inverse;
    rate->tangent[i] = (high->tangent[i] - low->tangent[i]) * inverse;
  }
}

// adds rates by a shift
static void add_shift(cav_touch *rate, const double shift[3], const cav_touch by[3]) {
  rate->dist += shift[0] * by[0].dist + shift[1] * by[1].dist + shift[2] * by[2].dist;
  for (int i = 0; i < 3; i++) {
    axpy3(rate->pos, rate->pos, shift[i], by[i].pos);
    axpy3(rate->normal, rate->normal, shift[i], by[i].normal);
    axpy3(rate->tangent, rate->tangent, shift[i], by[i].tangent);
  }
}

int cav_touch_rates(cav_pair_manifolds *m, const double point[3], int feature, cav_touch *here, cav_touch rate[6]) {
  if (!m->displaced) displace(m, point);
  const cav_touch *found = find(m->touch[12], m->count[12], feature);
  if (!found) return 0;
  *here = *found;
  if (m->closed) memcpy(rate, m->rate[found - m->touch[12]], 6 * sizeof *rate);
  for (int k = 0; k < 6 && !m->closed; k++) {
    const double step = k < 3 ? ROTATION_STEP : SHIFT_STEP * m->size;
    const cav_touch *at[2];
    for (int side = 0; side < 2; side++) at[side] = find(m->touch[2 * k + side], m->count[2 * k + side], feature);
    if (!at[0] && !at[1]) return 0;
    divide(at[0] ? at[0] : here, at[1] ? at[1] : here, 1 / (at[0] && at[1] ? 2 * step : step), &rate[k]);
  }
  // a turn about the point is one about that of the manifolds and a shift
  double arm[3];
  sub3(arm, m->point, point);
  for (int k = 0; k < 3; k++) {
    double shift[3], turn[3] = {k == 0, k == 1, k == 2};
    cross3(shift, turn, arm);
    add_shift(&rate[k], shift, rate + 3);
  }
  return 1;
}
