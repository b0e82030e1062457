/// Capsule against ellipsoid, cylinder and box: a segment swept by a sphere. The signed distance to a convex solid is
/// convex along the segment, so its lowest point is where the derivative, the surface normal's component along the
/// segment, changes sign: bracketed false position (Illinois) with bisection. Where the derivative jumps (the segment
/// cuts an edge from the inside) the element of the subgradient square to the segment is the normal of the edge
/// contact. A capsule that lies along a face, a side or an edge has a second point, at the other end of the part above
/// that feature; it exists by its own gap, so no test of parallelism decides. A segment that cuts the solid has no such
/// lowest point: polytope.c finds the least translation that parts the two. On a box there are always two points, which
/// move with the pose and never come or go: the lowest, and one that lies at the other end of the part above the
/// feature where the capsule lies flat and draws near to the lowest the more it tilts. The part widens with the tilt of
/// the normal, so that a foot may leave a face over its edge without a jump of force; an optimiser that looks ahead of
/// contact needs that.
#include "pairs.h"

// fraction of the capsule's size below which the segment and the solid touch: no height over the surface tells a
// direction
static const double TOUCHES = 1e-9;

/// The segment in the solid's axes.
typedef struct segment {
  cav_geom_type type;
  cav_surface *surface;
  const double *size;
  double centre[3], half[3]; // point t: centre + t half, t in [-1, 1]
} segment;

static void point_at(const segment *g, double t, double x[3]) { axpy3(x, g->centre, t, g->half); }

// height above the solid at t, its normal, and the derivative of the height
static double height_at(const segment *g, double t, double n[3], double *derivative) {
  double x[3];
  point_at(g, t, x);
  double height = g->surface(g->size, x, n);
  *derivative = dot3(n, g->half);
  return height;
}

/// Lowest point of a segment over the solid.
typedef struct lowest {
  double t, height;
  double normal[3];
} lowest;

// bracket [tl, tr] of the sign change, derivatives sl < 0 < sr: shrinks to the last bit or to a zero derivative
static void find_lowest(const segment *g, lowest *best) {
  enum { STEPS_MAX = 200 };
  double nl[3], nr[3], sl, sr, tl = -1, tr = 1, hl, hr;
  double scale = 1e-13 * norm3(g->half);
  hl = height_at(g, tl, nl, &sl);
  hr = height_at(g, tr, nr, &sr);
  if (sl >= -scale || sr <= scale) {
    // lowest at an end; flat: the lower end
    int right = sl >= -scale ? sr <= scale && hr < hl : 1;
    best->t = right ? tr : tl;
    best->height = right ? hr : hl;
    copy3(best->normal, right ? nr : nl);
    return;
  }
  double wl = sl, wr = sr; // weights of false position, halved at an end that stays
  int side = 0;
  for (int k = 0; k < STEPS_MAX && tr - tl > 1e-15; k++) {
    double t = k % 3 == 2 ? (tl + tr) / 2 : (tl * wr - tr * wl) / (wr - wl), s, n[3];
    if (!(t > tl && t < tr)) t = (tl + tr) / 2;
    if (!(t > tl && t < tr)) break;
    double h = height_at(g, t, n, &s);
    if (fabs(s) <= scale) {
      best->t = t;
      best->height = h;
      copy3(best->normal, n);
      return;
    }
    if (s < 0) {
      tl = t, hl = h, sl = wl = s;
      copy3(nl, n);
      if (side == -1) wr /= 2;
      side = -1;
    } else {
      tr = t, hr = h, sr = wr = s;
      copy3(nr, n);
      if (side == 1) wl /= 2;
      side = 1;
    }
  }
  // the derivative jumps: the mean of both normals that is square to the segment
  double fraction = -sl / (sr - sl);
  best->t = (tl + tr) / 2;
  best->height = (1 - fraction) * hl + fraction * hr;
  for (int i = 0; i < 3; i++) { best->normal[i] = (1 - fraction) * nl[i] + fraction * nr[i]; }
  double length = norm3(best->normal);
  if (length < 1e-3) {
    // through the middle of the solid: faces pull opposite ways, leave by one of them
    copy3(best->normal, nl);
    return;
  }
  scale3(best->normal, 1 / length, best->normal);
  if (best->height < 0) best->height /= length;
}

// cuts [low, high] to where |c + t h| <= s
static void clip_slab(double c, double h, double s, double *low, double *high) {
  if (h == 0) {
    if (fabs(c) > s) *high = *low;
    return;
  }
  double t0 = (-s - c) / h, t1 = (s - c) / h;
  *low = fmax(*low, fmin(t0, t1));
  *high = fmin(*high, fmax(t0, t1));
}

// cuts [low, high] to where the segment is inside the cylinder's side
static void clip_disk(const segment *g, double *low, double *high) {
  const double *c = g->centre, *h = g->half;
  double a = h[0] * h[0] + h[1] * h[1], b = h[0] * c[0] + h[1] * c[1];
  double e = c[0] * c[0] + c[1] * c[1] - g->size[0] * g->size[0];
  if (a == 0) {
    if (e > 0) *high = *low;
    return;
  }
  double disc = b * b - a * e;
  if (disc <= 0) {
    *high = *low;
    return;
  }
  *low = fmax(*low, (-b - sqrt(disc)) / a);
  *high = fmin(*high, (-b + sqrt(disc)) / a);
}

// part of the segment above a cylinder's side or cap whose normal is n
static void clip_cylinder(const segment *g, const double n[3], double *low, double *high) {
  *low = -1;
  *high = 1;
  if (fabs(n[2]) < 0.5) {
    clip_slab(g->centre[2], g->half[2], g->size[1], low, high);
  } else {
    clip_disk(g, low, high);
  }
}

// height at t above the feature of normal n: outside the true distance, inside that through the same face or side
static double height_along(const segment *g, double t, const double n[3], double normal[3]) {
  double x[3], derivative;
  double height = height_at(g, t, normal, &derivative);
  if (height > 0) return height;
  point_at(g, t, x);
  if (g->type == CAV_GEOM_BOX) {
    int face = 0;
    for (int i = 1; i < 3; i++) {
      if (fabs(n[i]) > fabs(n[face])) face = i;
    }
    zero3(normal);
    normal[face] = n[face] < 0 ? -1 : 1;
    return normal[face] * x[face] - g->size[face];
  }
  if (fabs(n[2]) >= 0.5) {
    set3(normal, 0, 0, n[2] < 0 ? -1 : 1);
    return normal[2] * x[2] - g->size[1];
  }
  double rho = sqrt(x[0] * x[0] + x[1] * x[1]);
  if (rho > 0) set3(normal, x[0] / rho, x[1] / rho, 0);
  return rho - g->size[0];
}

// world contact of the ball at t with the surface at height along normal (solid's axes)
static int touch_at(const cav_shape *a, const cav_shape *b, const segment *g, double t, double height,
                    const double normal[3], double margin, int feature, cav_touch *touch) {
  double radius = a->size[0], x[3], n[3];
  if (height - radius >= margin) return 0;
  point_at(g, t, x);
  axpy3(x, x, -(height + radius) / 2, normal);
  transform(touch->pos, b->pos, b->rotation, x);
  rotate(n, b->rotation, normal);
  scale3(touch->normal, -1, n);
  zero3(touch->tangent);
  touch->dist = height - radius;
  touch->feature = feature;
  return 1;
}

// part of the segment above the face, edge or corner of a box around its lowest point: between the faces across the
// normal, which recede as the normal turns to them
static void clip_box(const segment *g, const lowest *best, double *low, double *high) {
  double room = norm3(g->half) + fmax(best->height, 0);
  *low = -1;
  *high = 1;
  for (int i = 0; i < 3; i++) {
    double n = fabs(best->normal[i]);
    if (n < 0.5) clip_slab(g->centre[i], g->half[i], g->size[i] + n * room / (1 - 2 * n), low, high);
  }
  *low = fmin(*low, best->t);
  *high = fmax(*high, best->t);
}

// sine from which on a capsule is too steep for a second point
static const double FLAT = 0.5;

// how far the second point goes from the lowest towards an end of the part: all the way where the segment lies flat,
// nowhere where it rises steeper than FLAT
static double draw(const segment *g, const lowest *best, double end) {
  double length = fabs(end - best->t) * norm3(g->half), normal[3];
  if (length == 0) return 0;
  double s = (height_along(g, end, best->normal, normal) - best->height) / (length * FLAT),
         fraction = fmax(1 - s * s, 0);
  return fraction * fraction * (end - best->t);
}

// both points on a box and the ends of the part above it; 1 where anywhere along it is as low: it rests on both ends
static int rest_on_box(const segment *g, double radius, const lowest *best, double end[2], lowest *first,
                       lowest *second) {
  double normal[3], flat = 1e-12 * (norm3(g->half) + radius);
  int level = 0;
  *first = *best;
  clip_box(g, best, &end[0], &end[1]);
  second->t = best->t + draw(g, best, end[0]) + draw(g, best, end[1]);
  for (int k = 0; k < 2 && !level; k++) {
    double height = height_along(g, end[k], best->normal, normal);
    if (end[k] == best->t || height - best->height > flat) continue;
    *first = (lowest){.t = end[k], .height = height};
    copy3(first->normal, normal);
    second->t = end[k] + draw(g, first, end[!k]);
    level = 1;
  }
  second->height = first->height;
  copy3(second->normal, first->normal);
  if (second->t != first->t) second->height = height_along(g, second->t, first->normal, second->normal);
  return level;
}

static int collide_box(const cav_shape *a, const cav_shape *b, const segment *g, const lowest *best, double margin,
                       cav_touch *touch) {
  lowest first, second;
  double end[2];
  rest_on_box(g, a->size[0], best, end, &first, &second);
  int late = first.t > second.t;
  int count = touch_at(a, b, g, first.t, first.height, first.normal, margin, late, touch);
  return count + touch_at(a, b, g, second.t, second.height, second.normal, margin, !late, touch + count);
}

// the axis of a capsule in the axes of a solid, a point for a sphere
static segment segment_of(const cav_shape *a, const cav_shape *b) {
  segment g = {.type = b->type, .size = b->size};
  g.surface = b->type == CAV_GEOM_BOX        ? cav_surface_box
              : b->type == CAV_GEOM_CYLINDER ? cav_surface_cylinder
                                             : cav_surface_ellipsoid;
  double d[3], axis[3];
  sub3(d, a->pos, b->pos);
  rotate_back(g.centre, b->rotation, d);
  if (a->type != CAV_GEOM_CAPSULE) return g;
  column3(axis, a->rotation, 2);
  scale3(axis, a->size[1], axis);
  rotate_back(g.half, b->rotation, axis);
  return g;
}

int cav_collide_segment(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  segment g = segment_of(a, b);
  lowest first;
  find_lowest(&g, &first);
  if (first.height - a->size[0] >= margin) return 0;
  if (first.height < TOUCHES * (a->size[0] + a->size[1])) return cav_collide_convex(a, b, margin, touch);
  if (b->type == CAV_GEOM_ELLIPSOID) {
    return touch_at(a, b, &g, first.t, first.height, first.normal, margin, 0, touch);
  }
  if (b->type == CAV_GEOM_BOX) return collide_box(a, b, &g, &first, margin, touch);

  // two points where a part of the segment runs above one feature; a flat one rests on both its ends
  double low, high, normal[3], flat = 1e-12 * (norm3(g.half) + a->size[0]);
  clip_cylinder(&g, first.normal, &low, &high);
  if (high <= low) { return touch_at(a, b, &g, first.t, first.height, first.normal, margin, first.t > 0, touch); }
  double ends[2] = {low, high};
  for (int k = 0; k < 2; k++) {
    double height = height_along(&g, ends[k], first.normal, normal);
    if (height - first.height > flat) continue;
    first.t = ends[k];
    first.height = height;
    copy3(first.normal, normal);
    break;
  }
  int far = first.t - low < high - first.t;
  int count = touch_at(a, b, &g, first.t, first.height, first.normal, margin, !far, touch);
  double height = height_along(&g, ends[far], first.normal, normal);
  count += touch_at(a, b, &g, ends[far], height, normal, margin, far, touch + count);
  return count;
}

// --- rates by unit twists of a box ---

/// Of a segment by each of six twists of the box about a point, in the box's axes.
typedef struct drift {
  double centre[6][3], half[6][3];
} drift;

/// Of a point over the box by each twist: of its place along the segment, the height there and the normal.
typedef struct derivatives {
  double t[6], height[6], normal[6][3];
} derivatives;

static drift drift_of(const cav_shape *a, const cav_shape *b, const segment *g, const double point[3]) {
  drift m;
  double arm[3], half[3];
  sub3(arm, a->pos, point);
  rotate(half, b->rotation, g->half);
  for (int k = 0; k < 6; k++) {
    const double e[3] = {k % 3 == 0, k % 3 == 1, k % 3 == 2};
    double shift[3], turn[3] = {0};
    if (k < 3) {
      cross3(shift, arm, e);
      cross3(turn, half, e);
    } else {
      scale3(shift, -1, e);
    }
    rotate_back(m.centre[k], b->rotation, shift);
    rotate_back(m.half[k], b->rotation, turn);
  }
  return m;
}

// which coordinates a point above the box at t is beyond; their number, 0 below its surface
static int beyond(const segment *g, const lowest *p, int out[3]) {
  double x[3];
  int n = 0;
  point_at(g, p->t, x);
  for (int i = 0; i < 3; i++) n += out[i] = p->height > 0 && fabs(x[i]) > g->size[i];
  return n;
}

// of the height and the normal, from those of the place. Over a face the normal stays; over an edge and a corner it turns
static void differentiate_height(const segment *g, const drift *m, const lowest *p, derivatives *s) {
  int out[3];
  const int round = beyond(g, p, out) > 1;
  for (int k = 0; k < 6; k++) {
    double x[3];
    axpy3(x, m->centre[k], s->t[k], g->half);
    axpy3(x, x, p->t, m->half[k]);
    s->height[k] = dot3(p->normal, x);
    for (int i = 0; i < 3; i++)
      s->normal[k][i] = round && out[i] ? (x[i] - p->normal[i] * s->height[k]) / p->height : 0;
  }
}

// of the lowest place: none at an end; else where the normal over an edge or a corner stays square to the segment. 0: it jumps
static int differentiate_place(const segment *g, const drift *m, const lowest *p, double t[6]) {
  static const double least = 1e-9;
  int out[3];
  for (int k = 0; k < 6; k++) t[k] = 0;
  if (fabs(p->t) == 1) return 1;
  const double along = dot3(p->normal, g->half), size = dot3(g->half, g->half);
  if (beyond(g, p, out) < 2 || !(fabs(along) <= 1e-12 * sqrt(size))) return 0;
  // the second derivative of the height along the segment, times the height
  double turned[3];
  for (int i = 0; i < 3; i++) turned[i] = out[i] ? g->half[i] - p->normal[i] * along : 0;
  const double bend = dot3(g->half, turned);
  if (!(bend > least * size)) return 0;
  for (int k = 0; k < 6; k++) {
    double x[3];
    axpy3(x, m->centre[k], p->t, m->half[k]);
    t[k] = -(dot3(turned, x) + p->height * dot3(p->normal, m->half[k])) / bend;
  }
  return 1;
}

// of an end of the part above the box (clip_box)
static void differentiate_end(const segment *g, const drift *m, const lowest *best, const derivatives *s, double end,
                              double out[6]) {
  const double room = norm3(g->half) + fmax(best->height, 0);
  for (int k = 0; k < 6; k++) out[k] = end == best->t ? s->t[k] : 0;
  if (end == best->t || fabs(end) == 1) return;
  for (int i = 0; i < 3; i++) {
    const double n = fabs(best->normal[i]), part = 1 / (1 - 2 * n), sign = best->normal[i] < 0 ? -1 : 1;
    const double size = g->size[i] + n * room / (1 - 2 * n), c = g->centre[i], h = g->half[i];
    if (!(n < 0.5) || h == 0) continue;
    const int side = (size - c) / h == end ? 1 : (-size - c) / h == end ? -1 : 0;
    for (int k = 0; k < 6 && side; k++) {
      const double wider =
          part * part * room * sign * s->normal[k][i] + (best->height > 0 ? n * part * s->height[k] : 0);
      out[k] = (side * wider - m->centre[k][i] - end * m->half[k][i]) / h;
    }
    if (side) return;
  }
}

// adds those of draw to an end, whose own are by
static void differentiate_draw(const segment *g, const drift *m, const lowest *best, const derivatives *s, double end,
                               const double by[6], double t[6]) {
  lowest far = {.t = end};
  derivatives there;
  const double way = end - best->t, size = norm3(g->half), length = fabs(way) * size;
  if (length == 0) return;
  far.height = height_along(g, end, best->normal, far.normal);
  const double steep = (far.height - best->height) / (length * FLAT), fraction = fmax(1 - steep * steep, 0);
  if (fraction == 0) return;
  for (int k = 0; k < 6; k++) there.t[k] = by[k];
  differentiate_height(g, m, &far, &there);
  for (int k = 0; k < 6; k++) {
    const double longer = (way < 0 ? -1 : 1) * (by[k] - s->t[k]) * size;
    const double steeper = ((there.height[k] - s->height[k]) / FLAT - steep * longer) / length;
    t[k] += fraction * (fraction * (by[k] - s->t[k]) - 4 * steep * steeper * way);
  }
}

// of a contact, world, from those of its point on the box
static void put_rates(const cav_shape *a, const cav_shape *b, const segment *g, const drift *m, const lowest *p,
                      const derivatives *s, const double point[3], const cav_touch *touch, cav_touch rate[6]) {
  const double reach = (p->height + a->size[0]) / 2;
  double arm[3];
  sub3(arm, touch->pos, point);
  for (int k = 0; k < 6; k++) {
    const double e[3] = {k % 3 == 0, k % 3 == 1, k % 3 == 2};
    double x[3], n[3], with[3];
    axpy3(x, m->centre[k], s->t[k], g->half);
    axpy3(x, x, p->t, m->half[k]);
    axpy3(x, x, -s->height[k] / 2, p->normal);
    axpy3(x, x, -reach, s->normal[k]);
    rotate(x, b->rotation, x);
    rotate(n, b->rotation, s->normal[k]);
    // and what moves with the box
    if (k < 3)
      cross3(with, e, arm);
    else
      copy3(with, e);
    add3(rate[k].pos, x, with);
    zero3(with);
    if (k < 3) cross3(with, e, touch->normal);
    sub3(rate[k].normal, with, n);
    zero3(rate[k].tangent);
    rate[k].dist = s->height[k];
    rate[k].feature = touch->feature;
  }
}

int cav_segment_rates(const cav_shape *a, const cav_shape *b, double margin, const double point[3], cav_touch *touch,
                      cav_touch (*rate)[6]) {
  const segment g = segment_of(a, b);
  const drift m = drift_of(a, b, &g, point);
  lowest first = {.t = 0}, second;
  derivatives s = {.t = {0}}, last = {.t = {0}};
  if (a->type == CAV_GEOM_SPHERE) {
    first.height = g.surface(g.size, g.centre, first.normal);
    if (!touch_at(a, b, &g, 0, first.height, first.normal, margin, 0, touch)) return 0;
    differentiate_height(&g, &m, &first, &s);
    put_rates(a, b, &g, &m, &first, &s, point, touch, rate[0]);
    return 1;
  }
  find_lowest(&g, &first);
  if (first.height - a->size[0] >= margin) return 0;
  if (first.height < TOUCHES * (a->size[0] + a->size[1])) return -1;
  const lowest best = first;
  double end[2], by[2][6];
  if (rest_on_box(&g, a->size[0], &best, end, &first, &second) || !differentiate_place(&g, &m, &best, s.t)) return -1;
  differentiate_height(&g, &m, &best, &s);
  for (int k = 0; k < 6; k++) last.t[k] = s.t[k];
  for (int k = 0; k < 2; k++) {
    differentiate_end(&g, &m, &best, &s, end[k], by[k]);
    differentiate_draw(&g, &m, &best, &s, end[k], by[k], last.t);
  }
  differentiate_height(&g, &m, &second, &last);
  const int late = first.t > second.t;
  int count = touch_at(a, b, &g, first.t, first.height, first.normal, margin, late, touch);
  if (count) put_rates(a, b, &g, &m, &first, &s, point, touch, rate[0]);
  if (!touch_at(a, b, &g, second.t, second.height, second.normal, margin, !late, touch + count)) return count;
  put_rates(a, b, &g, &m, &second, &last, point, touch + count, rate[count]);
  return count + 1;
}
