/// What of two polyhedra is nearest, proven from a hint: a corner and a corner, an edge or a face, or two edges.
///
/// The direction between two such parts is known in closed form. Points of both that lie inside their parts, one behind
/// the other along that direction, with every neighbour of a part's corners lower than these by a margin, are the nearest of
/// the bodies: on a convex body what is higher than all about it is the highest. So the answer depends on the poses
/// alone, to the bit, whoever guessed. Where a face of a mesh or a box has more corners in one plane than a guess, three of
/// them all say where it is, always the same. Parts that only just meet and bodies that overlap are not proven here; gjk.c
/// searches for these.
#include "gjk.h"
#include "math3.h"
#include "pairs.h"

#include <stdint.h>
#include <string.h>

enum { LEVEL_MAX = 128, SEEN_MAX = 1 << 14 }; // corners of a face, of a mesh: of more nothing is proven
// fractions of the size: how far neighbours must be lower, how far apart the bodies; of a part: how far inside its ends points
// lie; sines of what is not parallel
static const double LOWER = 1e-12, APART = 1e-6, INSIDE = 1e-9, SQUARE = 1e-3;
// sine below which a cylinder lies flush on a face or stands on it; fraction of the size to which the points of a round
// part lie one behind the other; largest turn of a step, rad
static const double FLUSH = 1e-6, EXACT = 1e-14, TURN = 0.3;

// whether all neighbours of some corners of a core are lower than these along a direction, by a margin
static int is_top(const cav_core *core, const double n[3], const int *corner, int count, double margin) {
  const cav_shape *s = core->shape;
  double local[3];
  rotate_back(local, s->rotation, n);
  if (s->type == CAV_GEOM_MESH) {
    const cav_mesh *m = s->mesh;
    double most = dot3(m->vertex + 3 * corner[0], local) - margin;
    for (int i = 0; i < count; i++) {
      for (int k = m->neighbour_start[corner[i]]; k < m->neighbour_start[corner[i] + 1]; k++) {
        int v = m->neighbour[k];
        if (dot3(m->vertex + 3 * v, local) < most) continue;
        if (v != corner[0] && (count < 2 || v != corner[1]) && (count < 3 || v != corner[2])) return 0;
      }
    }
    return 1;
  }
  if (s->type == CAV_GEOM_SPHERE) return 1;
  int dimensions = s->type == CAV_GEOM_BOX ? 3 : 1;
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < dimensions; k++) {
      int v = corner[i] ^ 1 << k, known = 0;
      double side = corner[i] >> k & 1 ? 1 : -1;
      double height = dimensions == 3 ? side * s->size[k] * local[k] : side * s->size[1] * local[2];
      for (int j = 0; j < count; j++) known |= corner[j] == v;
      if (!known && 2 * height < margin) return 0;
    }
  }
  return 1;
}

static int is_inside(double t) { return t > INSIDE && t < 1 - INSIDE; }

// a corner p and the edge q of another body, or its corner
static int from_corner(const double p[3], double q[3][3], int corners, double on[3], double n[3]) {
  double e[3], d[3];
  copy3(on, q[0]);
  if (corners == 2) {
    sub3(e, q[1], q[0]);
    sub3(d, p, q[0]);
    double t = dot3(d, e) / dot3(e, e);
    if (!is_inside(t)) return 0;
    axpy3(on, q[0], t, e);
  }
  sub3(n, on, p);
  return 1;
}

// a corner p and the triangle q of another body; within: only what lies over the triangle itself
static int from_triangle(const double p[3], double q[3][3], int within, double on[3], double n[3]) {
  double e[2][3], d[3], c[3];
  for (int k = 0; k < 2; k++) sub3(e[k], q[k + 1], q[0]);
  sub3(d, p, q[0]);
  cross3(n, e[0], e[1]);
  double area2 = dot3(n, n);
  if (!(area2 > SQUARE * SQUARE * dot3(e[0], e[0]) * dot3(e[1], e[1]))) return 0;
  cross3(c, d, e[1]);
  double s = dot3(c, n) / area2;
  cross3(c, e[0], d);
  double t = dot3(c, n) / area2;
  if (within && (!is_inside(s) || !is_inside(t) || !is_inside(s + t))) return 0;
  double height = dot3(d, n);
  axpy3(on, p, -height / area2, n);
  if (height > 0) scale3(n, -1, n);
  return 1;
}

// two edges
static int from_edges(double p[3][3], double q[3][3], double x[3], double y[3], double n[3]) {
  double e[3], f[3], d[3], c[3];
  sub3(e, p[1], p[0]);
  sub3(f, q[1], q[0]);
  sub3(d, q[0], p[0]);
  cross3(n, e, f);
  double area2 = dot3(n, n);
  if (!(area2 > SQUARE * SQUARE * dot3(e, e) * dot3(f, f))) return 0;
  cross3(c, d, f);
  double s = dot3(c, n) / area2;
  cross3(c, d, e);
  double t = dot3(c, n) / area2;
  if (!is_inside(s) || !is_inside(t)) return 0;
  axpy3(x, p[0], s, e);
  axpy3(y, q[0], t, f);
  if (dot3(d, n) < 0) scale3(n, -1, n);
  return 1;
}

// a curved body and a corner q
static int curved_corner(const cav_shape *a, const double q[3], double x[3], double n[3], int *straight) {
  double d[3], local[3], normal[3];
  sub3(d, q, a->pos);
  rotate_back(local, a->rotation, d);
  double dist = a->type == CAV_GEOM_CYLINDER ? cav_surface_cylinder(a->size, local, normal)
                                             : cav_surface_ellipsoid(a->size, local, normal);
  if (!(dist > 0)) return 0;
  if (a->type == CAV_GEOM_CYLINDER) *straight = normal[2] == 0 ? 1 : fabs(normal[2]) == 1 ? 2 : 0;
  rotate(n, a->rotation, normal);
  axpy3(x, q, -dist, n);
  return 1;
}

// whether a cylinder lies flush on a plane square to n, or stands on it
static int is_flush(const cav_shape *a, const double n[3]) {
  double local[3];
  rotate_back(local, a->rotation, n);
  return a->type == CAV_GEOM_CYLINDER && (fabs(local[2]) < FLUSH || fabs(local[2]) > 1 - FLUSH);
}

// a curved body, not flat on it, and a triangle q
static int curved_triangle(const cav_shape *a, double q[3][3], double x[3], double y[3], double n[3]) {
  double e[2][3], d[3], on[3];
  for (int k = 0; k < 2; k++) sub3(e[k], q[k + 1], q[0]);
  cross3(n, e[0], e[1]);
  sub3(d, q[0], a->pos);
  if (dot3(n, d) < 0) scale3(n, -1, n);
  if (!(normalise3(n) > 0) || is_flush(a, n)) return 0;
  cav_shape_support(a, n, x);
  // the triangle as seen from x: its normal is n or -n
  if (!from_triangle(x, q, 1, y, on)) return 0;
  sub3(d, y, x);
  return dot3(d, n) > 0;
}

// the axis of a box that its side with three corners is square to, and three corners of that side, always the same; -1: they are
// of no side
static int side_of(const int corner[3], int best[3]) {
  // corners of a side differ along two axes
  const int differ = (corner[0] ^ corner[1]) | (corner[0] ^ corner[2]);
  const int axis = !(differ & 1) ? 0 : !(differ & 2) ? 1 : 2, side = corner[0] & 1 << axis;
  if (differ == 7) return -1;
  best[0] = side;
  best[1] = side | 1 << (axis + 1) % 3;
  best[2] = side | 1 << (axis + 2) % 3;
  return axis;
}

// a curved body, not flat on it, over the side of a box that is square to an axis and has a corner
static int curved_side(const cav_shape *a, const cav_shape *box, int axis, int corner, double x[3], double y[3],
                       double n[3]) {
  double d[3], local[3];
  const double side = corner & 1 << axis ? 1 : -1;
  column3(n, box->rotation, axis);
  scale3(n, -side, n);
  if (is_flush(a, n)) return 0;
  cav_shape_support(a, n, x);
  sub3(d, x, box->pos);
  rotate_back(local, box->rotation, d);
  for (int k = 0; k < 3; k++)
    if (k != axis && !(fabs(local[k]) < (1 - INSIDE) * box->size[k])) return 0;
  axpy3(y, x, side * local[axis] - box->size[axis], n);
  return 1;
}

// the side of a cylinder and an edge q
static int side_edge(const cav_shape *a, double q[3][3], double x[3], double y[3], double n[3]) {
  double axis[3], ends[2][3], e[3];
  column3(axis, a->rotation, 2);
  double line[3][3];
  for (int k = 0; k < 2; k++) axpy3(line[k], a->pos, k ? a->size[1] : -a->size[1], axis);
  if (!from_edges(line, q, ends[0], y, n) || !(normalise3(n) > 0)) return 0;
  axpy3(x, ends[0], a->size[0], n);
  sub3(e, y, x);
  return dot3(e, n) > 0;
}

// a rim or an ellipsoid and an edge q: Newton for the turn of n about the edge at which the gap is largest
static int round_edge(const cav_shape *a, double q[3][3], double size, double x[3], double y[3], double n[3]) {
  enum { STEPS_MAX = 20 };
  double e[3], d[3], t[2][3];
  int straight = 0;
  sub3(e, q[1], q[0]);
  double length = normalise3(e);
  sub3(d, a->pos, q[0]);
  double along = dot3(d, e);
  axpy3(y, q[0], along < 0 ? 0 : along > length ? length : along, e);
  if (!(length > 0) || !curved_corner(a, y, x, n, &straight)) return 0;
  for (int k = 0; k < STEPS_MAX; k++) {
    double H[2][2] = {{0}};
    axpy3(n, n, -dot3(n, e), e);
    if (!(normalise3(n) > 0)) return 0;
    copy3(t[0], e);
    cross3(t[1], e, n);
    cav_shape_support(a, n, x);
    sub3(d, q[0], x);
    double rate = dot3(d, t[1]), gap = dot3(d, n);
    if (fabs(rate) < EXACT * size) {
      along = -dot3(d, e);
      axpy3(y, q[0], along, e);
      return is_inside(along / length);
    }
    cav_shape_bend(a, n, t, H);
    double turn = rate / (gap + H[1][1]);
    if (!(gap > 0) || !isfinite(turn)) return 0;
    axpy3(n, n, fmax(-TURN, fmin(TURN, turn)), t[1]);
  }
  return 0;
}

// the direction in which a curved body and corners of a polyhedron meet
static int from_curved(const cav_shape *a, double q[3][3], int corners, double size, double x[3], double y[3],
                       double n[3], int *straight) {
  *straight = 0;
  if (corners == 1) return curved_corner(a, q[0], x, n, straight);
  if (corners == 3) return curved_triangle(a, q, x, y, n);
  if (a->type == CAV_GEOM_CYLINDER && side_edge(a, q, x, y, n)) {
    *straight = 1;
    return 1;
  }
  return round_edge(a, q, size, x, y, n);
}

// the direction in which corners of two polyhedra meet
static int from_corners(double p[3][3], int na, double q[3][3], int nb, double x[3], double y[3], double n[3]) {
  int ok = na == 2 && nb == 2 ? from_edges(p, q, x, y, n)
           : nb == 3          ? from_triangle(p[0], q, 1, y, n)
           : na == 3          ? from_triangle(q[0], p, 1, x, n)
           : na == 2          ? from_corner(q[0], p, na, x, n)
                              : from_corner(p[0], q, nb, y, n);
  // from a corner of b to what a has the direction came the other way
  if (na > nb) scale3(n, -1, n);
  return ok;
}

// the corners of a mesh that are level with three along a direction in its axes and joined to them, in order; 0: one is
// higher, or they are too many
static int level_with(const cav_mesh *m, const double local[3], const int corner[3], double margin, int *level) {
  uint64_t seen[SEEN_MAX / 64];
  double height = dot3(m->vertex + 3 * corner[0], local);
  int n = 0, words = (m->nvertex + 63) / 64;
  if (m->nvertex > SEEN_MAX) return 0;
  memset(seen, 0, (size_t)words * sizeof *seen);
  for (; n < 3; n++) {
    level[n] = corner[n];
    seen[corner[n] / 64] |= UINT64_C(1) << corner[n] % 64;
  }
  for (int i = 0; i < n; i++) {
    for (int k = m->neighbour_start[level[i]]; k < m->neighbour_start[level[i] + 1]; k++) {
      int v = m->neighbour[k];
      double h = dot3(m->vertex + 3 * v, local);
      if (h < height - margin || seen[v / 64] >> v % 64 & 1) continue;
      if (h > height + margin || n == LEVEL_MAX) return 0;
      seen[v / 64] |= UINT64_C(1) << v % 64;
      level[n++] = v;
    }
  }
  n = 0;
  for (int w = 0; w < words; w++) {
    for (uint64_t left = seen[w]; left; left &= left - 1) level[n++] = 64 * w + __builtin_ctzll(left);
  }
  return n;
}

// three corners of a mesh that say best where the plane of some lies: the first, the one furthest from it, the one
// furthest from their line
static void span_of(const cav_mesh *m, const int *level, int n, int best[3]) {
  const double *first = m->vertex + 3 * level[0];
  double e[3], d[3], c[3], most[2] = {-1, -1};
  best[0] = level[0];
  for (int i = 1; i < n; i++) {
    sub3(d, m->vertex + 3 * level[i], first);
    const double far = dot3(d, d);
    if (far > most[0]) most[0] = far, best[1] = level[i];
  }
  sub3(e, m->vertex + 3 * best[1], first);
  for (int i = 1; i < n; i++) {
    sub3(d, m->vertex + 3 * level[i], first);
    cross3(c, e, d);
    const double far = dot3(c, c);
    if (far > most[1]) most[1] = far, best[2] = level[i];
  }
}

// a corner p of one body and three corners of a mesh or a box, the highest along a direction, but for more in their plane: on
// that plane
static int on_level(const double p[3], const cav_shape *s, const double towards[3], const int corner[3], double margin,
                    double on[3], double n[3]) {
  double local[3], q[3][3];
  int level[LEVEL_MAX], best[3];
  rotate_back(local, s->rotation, towards);
  if (s->type == CAV_GEOM_BOX) {
    const int axis = side_of(corner, best);
    if (axis < 0 || !(2 * s->size[axis] * (best[0] ? local[axis] : -local[axis]) >= margin)) return 0;
  } else {
    int count = s->type == CAV_GEOM_MESH ? level_with(s->mesh, local, corner, margin, level) : 0;
    if (!count) return 0;
    span_of(s->mesh, level, count, best);
  }
  for (int k = 0; k < 3; k++) cav_shape_corner(s, best[k], q[k]);
  return from_triangle(p, q, 0, on, n) && normalise3(n) > 0;
}

int cav_nearest_prove(const cav_core *a, const cav_core *b, double size, const cav_hint *hint, cav_separation *out) {
  double p[3][3], q[3][3], n[3], x[3], y[3], d[3], back[3];
  const int na = hint->na, nb = hint->nb, curved = cav_shape_is_curved(a->shape);
  int straight = 0, side[3], axis = -1;
  if (na < 1 || nb < 1 || (na > 1 && nb > 1 && na + nb > 4)) return 0;
  for (int i = 0; i < na && !curved; i++) cav_shape_corner(a->shape, hint->a[i], p[i]);
  if (curved && nb == 3 && b->shape->type == CAV_GEOM_BOX && (axis = side_of(hint->b, side)) < 0) return 0;
  for (int i = 0; i < nb; i++) cav_shape_corner(b->shape, axis < 0 ? hint->b[i] : side[i], q[i]);
  if (!curved) copy3(x, p[0]);
  copy3(y, q[0]);
  if (!(axis >= 0 ? curved_side(a->shape, b->shape, axis, side[0], x, y, n)
        : curved  ? from_curved(a->shape, q, nb, size, x, y, n, &straight)
                  : from_corners(p, na, q, nb, x, y, n)))
    return 0;
  if (!(normalise3(n) > 0)) return 0;
  sub3(d, y, x);
  double gap = dot3(d, n);
  scale3(back, -1, n);
  if (!(gap > APART * size)) return 0;
  int top_a = curved || is_top(a, n, hint->a, na, LOWER * size);
  int top_b = axis >= 0 || is_top(b, back, hint->b, nb, LOWER * size);
  if (!top_b && (!top_a || curved || nb < 3 || !on_level(x, b->shape, back, hint->b, LOWER * size, y, n))) return 0;
  if (!top_a) {
    if (na < 3 || !on_level(y, a->shape, n, hint->a, LOWER * size, x, n)) return 0;
    scale3(n, -1, n);
  }
  sub3(d, y, x);
  gap = dot3(d, n);
  copy3(out->n, n);
  copy3(out->x, x);
  copy3(out->y, y);
  out->gap = gap;
  out->straight = straight;
  out->corners = na > nb ? na : nb;
  for (int i = 0; i < out->corners; i++) {
    if (!curved) copy3(out->corner_a[i], p[i < na ? i : na - 1]);
    copy3(out->corner_b[i], q[i < nb ? i : nb - 1]);
  }
  return 1;
}
