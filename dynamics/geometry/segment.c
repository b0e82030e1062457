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

// how far the second point goes from the lowest towards an end of the part: all the way where the segment lies flat,
// nowhere where it rises steeper than FLAT
static double draw(const segment *g, const lowest *best, double end) {
  static const double FLAT = 0.5; // sine
  double length = fabs(end - best->t) * norm3(g->half), normal[3];
  if (length == 0) return 0;
  double s = (height_along(g, end, best->normal, normal) - best->height) / (length * FLAT),
         fraction = fmax(1 - s * s, 0);
  return fraction * fraction * (end - best->t);
}

static int collide_box(const cav_shape *a, const cav_shape *b, const segment *g, const lowest *best, double margin,
                       cav_touch *touch) {
  lowest first = *best, second;
  double end[2], normal[3], flat = 1e-12 * (norm3(g->half) + a->size[0]);
  clip_box(g, best, &end[0], &end[1]);
  second.t = best->t + draw(g, best, end[0]) + draw(g, best, end[1]);
  for (int k = 0; k < 2; k++) {
    // anywhere along it is as low: it rests on both ends
    double height = height_along(g, end[k], best->normal, normal);
    if (end[k] == best->t || height - best->height > flat) continue;
    first = (lowest){.t = end[k], .height = height};
    copy3(first.normal, normal);
    second.t = end[k] + draw(g, &first, end[!k]);
    break;
  }
  second.height = first.height;
  copy3(second.normal, first.normal);
  if (second.t != first.t) second.height = height_along(g, second.t, first.normal, second.normal);
  int late = first.t > second.t;
  int count = touch_at(a, b, g, first.t, first.height, first.normal, margin, late, touch);
  return count + touch_at(a, b, g, second.t, second.height, second.normal, margin, !late, touch + count);
}

int cav_collide_segment(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  segment g = {.type = b->type, .size = b->size};
  g.surface = b->type == CAV_GEOM_BOX        ? cav_surface_box
              : b->type == CAV_GEOM_CYLINDER ? cav_surface_cylinder
                                             : cav_surface_ellipsoid;
  double d[3], axis[3];
  sub3(d, a->pos, b->pos);
  rotate_back(g.centre, b->rotation, d);
  column3(axis, a->rotation, 2);
  scale3(axis, a->size[1], axis);
  rotate_back(g.half, b->rotation, axis);

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
