/// Pairs of ellipsoid, cylinder and box without a routine of their own. The only user of libccd.
///
/// 1. libccd (Minkowski portal refinement on both shapes grown by half the margin) finds a direction of separation,
///    unless the line of centres or a face already proves them apart. Where they overlap, other starts are added.
/// 2. The direction is polished, because portals end at a loose tolerance and derivatives are taken by differences. The
///    gap along n, gap(n) = min_b n.b - max_a n.a, has the gradient b - a of its support points; its largest value is
///    the signed distance. Along which n it is smooth depends on how the shapes meet, so each way is solved by itself
///    and the largest gap wins: a face or a cap (n fixed), two straight lines (n square to both), a line and a rim or
///    a corner (n square to the line: one angle), rims, corners and ellipsoids (two angles). Every value is a lower
///    bound of the distance, thus the winner is right as soon as one of them is.
/// One point per pair, at the middle of what touches; a cylinder or box that stands on a cap or a face has in addition
/// the points that a plane there would give it, as far as they are above that face, so that it is kept from tilting.
/// Apart, the distance is exact but where the direction is left short of its solution, 1 of 250,000 random poses: the
/// gap is then smaller than the distance. Overlapping shapes can leave each other in several ways; the best of a few
/// starts is taken, not always the least of all: with overlaps to 4 cm of shapes of 5 to 30 cm, turning both together
/// changed the answer in 3 of 1,000 poses of two cylinders, 0.6 of 1,000 of cylinder and box, 2 of 100,000 of the rest.
/// Slow, 10 to 60 microseconds a pair: models that care use capsules, spheres and planes.
#include "pairs.h"

int cav_collide_supported(cav_geom_type a, cav_geom_type b) {
#ifdef CAVORT_HAVE_CCD
  return a < CAV_GEOM_TYPES && b < CAV_GEOM_TYPES;
#else
  // ellipsoid, cylinder and box among themselves, but for two boxes
  if (a >= CAV_GEOM_MESH || b >= CAV_GEOM_MESH) return a < CAV_GEOM_TYPES && b < CAV_GEOM_TYPES;
  int solid_a = a >= CAV_GEOM_ELLIPSOID, solid_b = b >= CAV_GEOM_ELLIPSOID;
  return a < CAV_GEOM_TYPES && b < CAV_GEOM_TYPES && (!solid_a || !solid_b || (a == CAV_GEOM_BOX && b == CAV_GEOM_BOX));
#endif
}

#ifdef CAVORT_HAVE_CCD

#include <ccd/ccd.h>

// sine to a straight line's normals up to which directions square to the line are tried
static const double NEAR_SQUARE = 0.5;
// cosine below which a normal is square to an axis
static const double SQUARE = 1e-9;
// cosine beyond which a shape stands on a face; fraction of the size within which two points are one
static const double NEAR_FACE = 0.9, ALIKE = 1e-6;
// step at which a climb ends, rad
static const double CLIMB = 1e-4;
// fractions of the size: gaps that are equal; residual of a direction that is solved; loss that shows none was
static const double ROUNDING = 1e-13, SOLVED = 1e-14, CERTAIN = 1e-10, LOOSE = 1e-10;

enum { SUPPORTS_MAX = 400, PORTALS_MAX = 100 };

/// What libccd sees: a shape grown by a ball.
typedef struct grown {
  const cav_shape *shape;
  double by;
  int *calls; ///< supports asked for, of both shapes
} grown;

static void ccd_support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out) {
  const grown *g = object;
  double d[3] = {direction->v[0], direction->v[1], direction->v[2]};
  normalise3(d);
  // libccd bounds only part of its loops: past the limit the shapes are made to look apart, which ends all of them
  if (++*g->calls > SUPPORTS_MAX) {
    axpy3(out->v, g->shape->pos, -1e9, d);
    return;
  }
  cav_shape_support(g->shape, d, out->v);
  axpy3(out->v, out->v, g->by, d);
}

static void ccd_centre(const void *object, ccd_vec3_t *centre) {
  const grown *g = object;
  copy3(centre->v, g->shape->pos);
}

// a direction from a to b along which the grown shapes overlap little; the line of centres if libccd sees no overlap
static void find_direction(const cav_shape *a, const cav_shape *b, double margin, double n[3]) {
  int calls = 0;
  grown ga = {a, margin / 2, &calls}, gb = {b, margin / 2, &calls};
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = ccd_support;
  ccd.support2 = ccd_support;
  ccd.center1 = ccd_centre;
  ccd.center2 = ccd_centre;
  ccd.max_iterations = PORTALS_MAX;
  ccd.mpr_tolerance = 1e-3;
  ccd_real_t depth;
  ccd_vec3_t direction, position;
  sub3(n, b->pos, a->pos);
  normalise3(n);
  if (ccdMPRPenetration(&ga, &gb, &ccd, &depth, &direction, &position)) return;
  double length = norm3(direction.v);
  if (length > 1e-10 && isfinite(length)) scale3(n, 1 / length, direction.v);
}

/// A direction, the gap along it and the difference b - a of the support points.
typedef struct probe {
  double n[3], gap, d[3];
  int raw; ///< where a climb ended, not solved
} probe;

/// Two shapes and the best direction so far.
typedef struct search {
  const cav_shape *a, *b;
  double size; ///< scale of lengths
  probe best;
} search;

static probe probe_at(const search *g, const double n[3]) {
  probe p = {.raw = 0};
  double back[3], x[3], y[3];
  copy3(p.n, n);
  normalise3(p.n);
  scale3(back, -1, p.n);
  cav_shape_support(g->a, p.n, x);
  cav_shape_support(g->b, back, y);
  sub3(p.d, y, x);
  p.gap = dot3(p.d, p.n);
  return p;
}

// keeps the direction of larger gap; equal up to rounding: the one held, which meets in a simpler way, unless it is raw
static void keep(search *g, const probe *p) {
  if (p->gap > g->best.gap + (g->best.raw ? -LOOSE : ROUNDING) * g->size) g->best = *p;
}

// both directions of a line that may be a normal
static void try_both(search *g, const double n[3]) {
  if (dot3(n, n) < 1e-8) return;
  for (int side = 0; side < 2; side++) {
    double m[3];
    scale3(m, side ? -1 : 1, n);
    probe p = probe_at(g, m);
    keep(g, &p);
  }
}

// axes along which a shape is straight, and that are normals of its faces: 3 of a box, 1 of a cylinder
static int straight_axes(const cav_shape *s, double axis[3][3]) {
  if (s->type == CAV_GEOM_BOX) {
    for (int k = 0; k < 3; k++) { column3(axis[k], s->rotation, k); }
    return 3;
  }
  if (s->type != CAV_GEOM_CYLINDER) return 0;
  column3(axis[0], s->rotation, 2);
  return 1;
}

// n fixed: faces, caps, and normals of two straight lines
static void try_fixed(search *g, double axis[6][3], int na, int nb) {
  for (int k = 0; k < na + nb; k++) { try_both(g, axis[k]); }
  for (int i = 0; i < na; i++) {
    for (int j = na; j < na + nb; j++) {
      double n[3];
      cross3(n, axis[i], axis[j]);
      try_both(g, n);
    }
  }
}

// from a direction, climbs the gap by steps along its gradient on the sphere, halved where they fail
static probe climb(const search *g, const double start[3]) {
  enum { STEPS_MAX = 60 };
  probe best = probe_at(g, start);
  double step = 1 / g->size;
  for (int k = 0; k < STEPS_MAX && step * g->size > CLIMB; k++) {
    double n[3], w[3];
    axpy3(w, best.d, -best.gap, best.n);
    axpy3(n, best.n, step, w);
    probe p = probe_at(g, n);
    if (p.gap > best.gap) {
      best = p;
    } else {
      step /= 2;
    }
  }
  return best;
}

// from the best direction a first step along off, halved until the gap grows, then on uphill
static probe leave(const search *g, const double off[3]) {
  enum { STEPS_MAX = 24 };
  double step = 0.3 / norm3(off), n[3];
  for (int k = 0; k < STEPS_MAX; k++, step /= 2) {
    axpy3(n, g->best.n, step, off);
    probe p = probe_at(g, n);
    if (p.gap > g->best.gap) return climb(g, n);
  }
  return g->best;
}

/// Directions square to a straight line: cos(angle) u + sin(angle) w.
typedef struct circle {
  double u[3], w[3];
} circle;

// derivative of the gap along the circle
static double derivative_at(const search *g, const circle *c, double angle, probe *p) {
  double n[3], across[3];
  scale3(n, cos(angle), c->u);
  axpy3(n, n, sin(angle), c->w);
  scale3(across, -sin(angle), c->u);
  axpy3(across, across, cos(angle), c->w);
  *p = probe_at(g, n);
  return dot3(p->d, across);
}

// one angle: n square to the straight line e; the derivative of the gap falls through zero at its largest value.
// Bracketed from the start, then false position (Illinois) with bisection
static void try_circle(search *g, const double start[3], const double e[3]) {
  enum { STEPS_MAX = 200 };
  circle c;
  axpy3(c.u, start, -dot3(start, e), e);
  if (dot3(start, e) * dot3(start, e) > NEAR_SQUARE * NEAR_SQUARE) return;
  normalise3(c.u);
  cross3(c.w, e, c.u);
  probe p;
  double low = 0, derivative_low = derivative_at(g, &c, 0, &p), high = 0, derivative_high = derivative_low;
  double turn = derivative_low > 0 ? 1 : -1;
  for (double angle = 0.01; angle < 1.5 && (derivative_high > 0) == (derivative_low > 0); angle *= 2) {
    low = high;
    derivative_low = derivative_high;
    high = turn * angle;
    derivative_high = derivative_at(g, &c, high, &p);
  }
  if ((derivative_low > 0) == (derivative_high > 0)) {
    p.raw = 1;
    keep(g, &p);
    return;
  }
  int side = 0;
  double weight_low = derivative_low, weight_high = derivative_high;
  for (int k = 0; k < STEPS_MAX && fabs(high - low) > 1e-16; k++) {
    double at = (low * weight_high - high * weight_low) / (weight_high - weight_low), middle = (low + high) / 2;
    if (k % 3 == 2 || !(at > fmin(low, high) && at < fmax(low, high))) at = middle;
    if (at == low || at == high) break;
    double derivative = derivative_at(g, &c, at, &p);
    if (fabs(derivative) < SOLVED * g->size) break;
    if ((derivative > 0) == (derivative_low > 0)) {
      low = at;
      weight_low = derivative;
      if (side == -1) weight_high /= 2;
      side = -1;
    } else {
      high = at;
      weight_high = derivative;
      if (side == 1) weight_low /= 2;
      side = 1;
    }
  }
  keep(g, &p);
}

// two directions square to n
static void tangents(const double n[3], double u[3], double w[3]) {
  int least = fabs(n[0]) < fabs(n[1]) ? 0 : 1;
  if (fabs(n[2]) < fabs(n[least])) least = 2;
  double e[3] = {least == 0, least == 1, least == 2};
  cross3(u, n, e);
  normalise3(u);
  cross3(w, n, u);
}

// tangential part of b - a in the basis u, w of a nearby direction
static void tangential(const probe *p, const double u[3], const double w[3], double r[2]) {
  r[0] = dot3(p->d, u) - p->gap * dot3(p->n, u);
  r[1] = dot3(p->d, w) - p->gap * dot3(p->n, w);
}

// Newton step (x, y) uphill for gradient r and Hessian (a, b; b, e): along each eigenvector by the curvature's
// magnitude
static void uphill(const double r[2], double a, double b, double e, double *x, double *y) {
  double angle = 0.5 * atan2(2 * b, a - e), c = cos(angle), s = sin(angle);
  double first = a * c * c + 2 * b * c * s + e * s * s, second = a + e - first;
  double floor = 1e-9 * (fabs(first) + fabs(second)) + 1e-300;
  double along = (c * r[0] + s * r[1]) / fmax(fabs(first), floor);
  double across = (c * r[1] - s * r[0]) / fmax(fabs(second), floor);
  *x = c * along - s * across;
  *y = s * along + c * across;
}

// two angles, where the support points move smoothly with n: Newton on the gap, whose gradient is the tangential part
// of b - a; second derivatives by differences. Where the best direction is of another kind it ends without a solution
static void try_smooth(search *g, const double start[3]) {
  enum { STEPS_MAX = 40, HALVINGS_MAX = 12 };
  const double tilt = 1e-7, turn_max = 0.3;
  probe p = probe_at(g, start);
  double residual = INFINITY;
  for (int k = 0; k < STEPS_MAX; k++) {
    double u[3], w[3], n[3], r[2], ru[2], rw[2], x, y;
    tangents(p.n, u, w);
    tangential(&p, u, w, r);
    residual = sqrt(r[0] * r[0] + r[1] * r[1]);
    if (residual < SOLVED * g->size) break;
    axpy3(n, p.n, tilt, u);
    probe pu = probe_at(g, n);
    tangential(&pu, u, w, ru);
    axpy3(n, p.n, tilt, w);
    probe pw = probe_at(g, n);
    tangential(&pw, u, w, rw);
    uphill(r, (ru[0] - r[0]) / tilt, (ru[1] - r[1] + rw[0] - r[0]) / (2 * tilt), (rw[1] - r[1]) / tilt, &x, &y);
    double turn = sqrt(x * x + y * y), shrink = turn > turn_max ? turn_max / turn : 1;
    if (!isfinite(turn)) break;
    // halved until the gap grows, or near the end, where rounding hides that, until the gradient shrinks
    int halving = 0;
    for (; halving < HALVINGS_MAX; halving++, shrink /= 2) {
      axpy3(n, p.n, shrink * x, u);
      axpy3(n, n, shrink * y, w);
      probe next = probe_at(g, n);
      tangential(&next, u, w, r);
      int shorter = sqrt(r[0] * r[0] + r[1] * r[1]) < 0.9 * residual;
      if (next.gap <= p.gap && !(shorter && next.gap > p.gap - ROUNDING * g->size)) continue;
      if (next.gap < p.gap + ROUNDING * g->size && !shorter) continue;
      p = next;
      break;
    }
    if (halving == HALVINGS_MAX) break;
  }
  if (residual < LOOSE * g->size) keep(g, &p);
}

/// The points of a shape furthest along a direction: a point, a segment, a rectangle or a disk.
typedef struct patch {
  double centre[3], axis[2][3], half[2];
  int count; ///< axes
  int disk;  ///< 1: a disk of radius half[0] about both axes
} patch;

static patch patch_of(const cav_shape *s, const double n[3]) {
  patch p = {.count = 0};
  double d[3], local[3], x[3];
  rotate_back(d, s->rotation, n);
  cav_shape_support(s, n, x);
  sub3(x, x, s->pos);
  rotate_back(local, s->rotation, x);
  if (s->type == CAV_GEOM_BOX) {
    for (int k = 0; k < 3 && p.count < 2; k++) {
      if (fabs(d[k]) > SQUARE) continue;
      local[k] = 0;
      column3(p.axis[p.count], s->rotation, k);
      p.half[p.count++] = s->size[k];
    }
  } else if (s->type == CAV_GEOM_CYLINDER && fabs(d[2]) <= SQUARE) {
    local[2] = 0;
    column3(p.axis[0], s->rotation, 2);
    p.half[0] = s->size[1];
    p.count = 1;
  } else if (s->type == CAV_GEOM_CYLINDER && d[0] * d[0] + d[1] * d[1] <= SQUARE * SQUARE) {
    local[0] = local[1] = 0;
    column3(p.axis[0], s->rotation, 0);
    column3(p.axis[1], s->rotation, 1);
    p.half[0] = p.half[1] = s->size[0];
    p.count = 2;
    p.disk = 1;
  }
  transform(p.centre, s->pos, s->rotation, local);
  return p;
}

// point of a patch nearest to x
static void nearest_of_patch(const patch *p, const double x[3], double y[3]) {
  double d[3], c[2] = {0, 0};
  sub3(d, x, p->centre);
  for (int k = 0; k < p->count; k++) {
    c[k] = dot3(d, p->axis[k]);
    if (!p->disk) c[k] = fmax(-p->half[k], fmin(p->half[k], c[k]));
  }
  double rho = sqrt(c[0] * c[0] + c[1] * c[1]);
  if (p->disk && rho > p->half[0]) c[0] *= p->half[0] / rho, c[1] *= p->half[0] / rho;
  copy3(y, p->centre);
  for (int k = 0; k < p->count; k++) { axpy3(y, y, c[k], p->axis[k]); }
}

// where two segments cross as seen along n; the middle of x's segment if they are parallel
static void crossing(const patch *p, const patch *q, double x[3]) {
  double c[3], d[3], e[3];
  cross3(c, p->axis[0], q->axis[0]);
  sub3(d, q->centre, p->centre);
  cross3(e, d, q->axis[0]);
  double sine2 = dot3(c, c);
  copy3(x, p->centre);
  if (sine2 > SQUARE * SQUARE) axpy3(x, x, dot3(e, c) / sine2, p->axis[0]);
}

// a point of the patch of a and one of the patch of b, as near to each other as patches of one normal come: from the
// middle of the smaller one, projected to and fro
static void meet(const patch *p, const patch *q, double x[3], double y[3]) {
  enum { STEPS_MAX = 20 };
  double sp = p->count * (p->half[0] + p->half[1]), sq = q->count * (q->half[0] + q->half[1]);
  copy3(x, sp <= sq ? p->centre : q->centre);
  if (p->count == 1 && q->count == 1) crossing(p, q, x);
  nearest_of_patch(p, x, x);
  for (int k = 0; k < STEPS_MAX; k++) {
    double last[3];
    copy3(last, x);
    nearest_of_patch(q, x, y);
    nearest_of_patch(p, y, x);
    sub3(last, x, last);
    if (norm3(last) == 0) break;
  }
}

// contact points for the best direction, and how far they are from lying across from each other: 0 at the solution,
// elsewhere the direction in which the gap grows fastest, also where it has a kink
static double witness(const search *g, double x[3], double y[3], double off[3]) {
  double back[3];
  scale3(back, -1, g->best.n);
  patch p = patch_of(g->a, g->best.n), q = patch_of(g->b, back);
  meet(&p, &q, x, y);
  sub3(off, y, x);
  axpy3(off, off, -dot3(off, g->best.n), g->best.n);
  return norm3(off);
}

// the cap or face of a shape that faces along n (out of it), as a plane; 0 if none does closely
static int face_towards(const cav_shape *s, const double n[3], cav_shape *plane) {
  double axis[3][3];
  int count = straight_axes(s, axis), face = -1;
  double most = NEAR_FACE;
  for (int k = 0; k < count; k++) {
    double c = fabs(dot3(n, axis[k]));
    if (c > most) most = c, face = k;
  }
  if (face < 0) return 0;
  int third = s->type == CAV_GEOM_BOX ? face : 2;
  double sign = dot3(n, axis[face]) < 0 ? -1 : 1, half = s->type == CAV_GEOM_BOX ? s->size[face] : s->size[1], z[3];
  *plane = (cav_shape){.type = CAV_GEOM_PLANE, .size = s->size};
  scale3(z, sign, axis[face]);
  axpy3(plane->pos, s->pos, half, z);
  // columns: two axes of the face, the third out of it
  for (int i = 0; i < 3; i++) {
    plane->rotation[3 * i] = s->rotation[3 * i + (third + 1) % 3];
    plane->rotation[3 * i + 1] = s->rotation[3 * i + (third + 2) % 3];
    plane->rotation[3 * i + 2] = z[i];
  }
  return 1;
}

// 1 if a point is above the face of the ground that the plane stands for
static int is_above(const cav_shape *ground, const cav_shape *plane, const double x[3]) {
  double d[3], local[3];
  sub3(d, x, ground->pos);
  rotate_back(local, ground->rotation, d);
  if (ground->type == CAV_GEOM_CYLINDER) {
    return local[0] * local[0] + local[1] * local[1] <= ground->size[0] * ground->size[0];
  }
  for (int k = 0; k < 3; k++) {
    double axis[3], z[3];
    column3(axis, ground->rotation, k);
    column3(z, plane->rotation, 2);
    if (fabs(dot3(axis, z)) < 0.5 && fabs(local[k]) > ground->size[k]) return 0;
  }
  return 1;
}

// width of the face that a shape may stand on
static double width(const cav_shape *s) { return s->type == CAV_GEOM_CYLINDER ? s->size[0] : s->size[0] + s->size[1]; }

// adds the points of the narrower shape standing on the wider one to the one found. That one goes where they have its
// place, or where three of them hold the shape without it
static int stand(const search *g, double margin, cav_touch *touch) {
  int b_stands = width(g->b) <= width(g->a);
  const cav_shape *ground = b_stands ? g->a : g->b, *other = b_stands ? g->b : g->a;
  double n[3], gap[3];
  cav_shape plane, turned;
  cav_touch found[CAV_TOUCH_MAX];
  scale3(n, b_stands ? 1 : -1, g->best.n);
  if (other->type == CAV_GEOM_ELLIPSOID || !face_towards(ground, n, &plane)) return 1;
  scale3(n, -1, n);
  if (!face_towards(other, n, &turned)) return 1;
  int points = cav_collide_shapes(&plane, other, margin, found), count = 0, alike = 0, as_deep = 0;
  for (int k = 0; k < points; k++) {
    if (!is_above(ground, &plane, found[k].pos)) continue;
    // deeper than the true depth: the way out is not through this face
    if (found[k].dist < touch->dist - ALIKE * g->size) return 1;
    sub3(gap, found[k].pos, touch->pos);
    alike |= norm3(gap) < ALIKE * g->size;
    as_deep |= found[k].dist < touch->dist + ALIKE * g->size;
    touch[1 + count] = found[k];
    touch[1 + count].feature = 1 + found[k].feature;
    if (!b_stands) scale3(touch[1 + count].normal, -1, found[k].normal);
    count++;
  }
  if (!alike && !(as_deep && count >= 3)) return 1 + count;
  memmove(touch, touch + 1, sizeof *touch * (size_t)count);
  return count;
}

enum { STARTS = 4 };

// all ways to meet that need iteration, about one direction
static void polish(search *g, const probe *start, double axis[6][3], int count) {
  for (int k = 0; k < count; k++) { try_circle(g, start->n, axis[k]); }
  try_smooth(g, start->n);
}

// from one direction on, until the points prove the best one; leaves them in x and y
static void solve(search *g, const double start[3], double axis[6][3], int count, double x[3], double y[3]) {
  enum { ROUNDS_MAX = 6 };
  double off[3];
  probe near = climb(g, start);
  if (g->best.gap > near.gap) near = climb(g, g->best.n);
  for (int round = 0; round < ROUNDS_MAX; round++) {
    polish(g, &near, axis, count);
    // nothing solved to the end: the best direction seen
    near.raw = 1;
    if (near.gap > g->best.gap + LOOSE * g->size) g->best = near;
    if (witness(g, x, y, off) < CERTAIN * g->size) break;
    near = leave(g, off);
  }
}

// puts a direction among the best STARTS that are further than a few degrees apart
static void rank(const search *g, const double n[3], probe best[STARTS], int *count) {
  if (dot3(n, n) < 1e-8) return;
  probe p = probe_at(g, n);
  for (int k = 0; k < *count; k++) {
    if (dot3(best[k].n, p.n) < 0.98) continue;
    if (p.gap > best[k].gap) best[k] = p;
    return;
  }
  if (*count < STARTS) {
    best[(*count)++] = p;
    return;
  }
  int worst = 0;
  for (int k = 1; k < STARTS; k++) {
    if (best[k].gap < best[worst].gap) worst = k;
  }
  if (p.gap > best[worst].gap) best[worst] = p;
}

// overlapping shapes may leave each other in several ways, each least among its neighbours. Starts are taken from a
// scatter that turns with the shapes: their axes, the line of centres, and what lies half way between any two of these
static void try_elsewhere(search *g, const double centres[3], double axis[6][3], int count) {
  double v[7][3], n[3];
  const cav_shape *shapes[2] = {g->a, g->b};
  probe best[STARTS];
  int vectors = 0, starts = 0;
  for (int k = 0; k < 2; k++) {
    for (int i = shapes[k]->type == CAV_GEOM_CYLINDER ? 2 : 0; i < 3; i++)
      column3(v[vectors++], shapes[k]->rotation, i);
  }
  copy3(v[vectors], centres);
  normalise3(v[vectors++]);
  for (int i = 0; i < vectors; i++) {
    for (int signs = 0; signs < 2; signs++) {
      scale3(n, signs ? -1 : 1, v[i]);
      rank(g, n, best, &starts);
    }
    for (int j = 0; j < i; j++) {
      for (int signs = 0; signs < 4; signs++) {
        scale3(n, signs & 1 ? -1 : 1, v[i]);
        axpy3(n, n, signs & 2 ? -1 : 1, v[j]);
        rank(g, n, best, &starts);
      }
    }
  }
  for (int k = 0; k < starts; k++) {
    probe p = climb(g, best[k].n);
    polish(g, &p, axis, count);
  }
}

// largest half length or radius
static double longest(const cav_shape *s) {
  double length = fmax(s->size[0], s->size[1]);
  return s->type == CAV_GEOM_CYLINDER ? length : fmax(length, s->size[2]);
}

int cav_collide_convex(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  search g = {.a = a, .b = b};
  double start[3], between[3], axis[6][3], x[3], y[3];
  g.size = fmax(longest(a), longest(b));
  g.best.gap = -INFINITY;

  // the simple ways to meet; any gap is a lower bound of the distance
  int na = straight_axes(a, axis), nb = straight_axes(b, axis + na);
  sub3(between, b->pos, a->pos);
  probe centres = probe_at(&g, between);
  try_fixed(&g, axis, na, nb);
  if (fmax(centres.gap, g.best.gap) >= margin) return 0;

  // the others, about the direction of libccd or a better one
  find_direction(a, b, margin, start);
  if (!(centres.gap > 0 || g.best.gap > 0)) try_elsewhere(&g, between, axis, na + nb);
  solve(&g, start, axis, na + nb, x, y);
  if (!(g.best.gap < margin)) return 0;

  add3(touch->pos, x, y);
  scale3(touch->pos, 0.5, touch->pos);
  copy3(touch->normal, g.best.n);
  zero3(touch->tangent);
  touch->dist = g.best.gap;
  touch->feature = 0;
  return stand(&g, margin, touch);
}
#else

int cav_collide_convex(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  // models with such pairs are refused when they are loaded: cav_collide_supported
  (void)a, (void)b, (void)margin, (void)touch;
  return 0;
}
#endif
