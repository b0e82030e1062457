/// Box against box. The separating axis (3 + 3 face normals, 9 products of edges) of largest gap says how they meet:
/// face: the opposite face of the other box is cut to the prism above it (Sutherland and Hodgman), up to 8 points, each
/// with its own height; edges: one point. Apart, the gap along an axis is only a bound of the distance; unless a corner
/// above the face proves it exact, the nearest corner or crossing edges are looked for and taken if nearer. What jumps:
/// the choice of face or edges where two axes are equal. A face is kept until it loses by PREFER of the smallest half
/// length, the first box's until the second's wins by as much: flat boxes keep their points under tiny rotations.
#include "pairs.h"

static const double PREFER = 1e-4;
// edges closer to parallel than this (square of the sine) are left to the face normals
static const double EDGES_PARALLEL = 1e-8;

enum {
  FACE_A = 64,          // features: + 64 * face + the two lines that cross, face 2 * axis + side
  FACE_B = 64 + 6 * 64, //
  CORNER_OF_B = 16,     // + corner
  CORNER_OF_A = 24      // below: 3 * edge direction of a + that of b
};

/// Both boxes in the axes of a.
typedef struct boxes {
  const double *a, *b; ///< half lengths
  double t[3];         ///< centre of b
  double axis[3][3];   ///< axis[j]: axis j of b
  double slack;        ///< PREFER times the smallest half length
} boxes;

/// A separating axis, unit, from a to b, and the gap along it.
typedef struct separation {
  double gap, normal[3];
  int first, second; ///< face axis of a or of b (the other is -1), or both directions of edges
} separation;

static double extent_a(const boxes *g, const double n[3]) {
  return g->a[0] * fabs(n[0]) + g->a[1] * fabs(n[1]) + g->a[2] * fabs(n[2]);
}

static double extent_b(const boxes *g, const double n[3]) {
  double sum = 0;
  for (int j = 0; j < 3; j++) { sum += g->b[j] * fabs(dot3(n, g->axis[j])); }
  return sum;
}

// keeps the axis n if its gap beats the best by more than advantage
static void try_axis(const boxes *g, const double n[3], int first, int second, double advantage, separation *best) {
  double shift = dot3(n, g->t), gap = fabs(shift) - extent_a(g, n) - extent_b(g, n);
  if (gap <= best->gap + advantage) return;
  best->gap = gap;
  best->first = first;
  best->second = second;
  scale3(best->normal, shift < 0 ? -1 : 1, n);
}

// axis of largest gap; first of all those of faces of a, then of b, then of edges, each needing an advantage
static separation separate(const boxes *g) {
  separation best = {.gap = -INFINITY}, other = {.gap = -INFINITY};
  for (int i = 0; i < 3; i++) {
    double n[3] = {i == 0, i == 1, i == 2};
    try_axis(g, n, i, -1, 0, &best);
    try_axis(g, g->axis[i], -1, i, 0, &other);
  }
  if (other.gap > best.gap + g->slack) best = other;
  other.gap = -INFINITY;
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      double n[3], e[3] = {i == 0, i == 1, i == 2};
      cross3(n, e, g->axis[j]);
      if (dot3(n, n) < EDGES_PARALLEL) continue;
      normalise3(n);
      try_axis(g, n, i, j, 0, &other);
    }
  }
  return other.gap > best.gap + g->slack ? other : best;
}

// one contact in the axes of a; x on a, y on b
static int touch_between(const double x[3], const double y[3], const double n[3], double dist, double margin,
                         int feature, cav_touch *touch) {
  if (dist >= margin) return 0;
  add3(touch->pos, x, y);
  scale3(touch->pos, 0.5, touch->pos);
  copy3(touch->normal, n);
  zero3(touch->tangent);
  touch->dist = dist;
  touch->feature = feature;
  return 1;
}

// corner of a box, bits of index: sides
static void corner_of(const double centre[3], const double axis[3][3], const double *half, int index, double x[3]) {
  copy3(x, centre);
  for (int i = 0; i < 3; i++) { axpy3(x, x, index >> i & 1 ? half[i] : -half[i], axis[i]); }
}

static const double ORIGIN[3], UNIT[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

// parameters of the nearest points of the lines p + s u and q + t w, u and w unit and not parallel
static void nearest_of_lines(const double p[3], const double u[3], const double q[3], const double w[3], double *s,
                             double *t) {
  double c[3], d[3], x[3];
  cross3(c, u, w);
  sub3(d, q, p);
  double sine2 = dot3(c, c);
  cross3(x, d, w);
  *s = dot3(x, c) / sine2;
  cross3(x, d, u);
  *t = dot3(x, c) / sine2;
}

static double clamp(double x, double bound) { return x < -bound ? -bound : x > bound ? bound : x; }

// edges that support the axis: one point
static int touch_edges(const boxes *g, const separation *best, double margin, cav_touch *touch) {
  int i = best->first, j = best->second;
  double x[3] = {0, 0, 0}, y[3], s, t;
  copy3(y, g->t);
  // middles of both edges
  for (int k = 0; k < 3; k++) {
    if (k != i) x[k] = best->normal[k] < 0 ? -g->a[k] : g->a[k];
    if (k != j) axpy3(y, y, dot3(best->normal, g->axis[k]) < 0 ? g->b[k] : -g->b[k], g->axis[k]);
  }
  nearest_of_lines(x, UNIT[i], y, g->axis[j], &s, &t);
  axpy3(x, x, clamp(s, g->a[i]), UNIT[i]);
  axpy3(y, y, clamp(t, g->b[j]), g->axis[j]);
  return touch_between(x, y, best->normal, best->gap, margin, 3 * i + j, touch);
}

// keeps a contact from x on a to y on b if it is nearer than the one held; two corners are found from both sides, and
// the first stays whatever rounding says
static void keep_nearer(const boxes *g, const double x[3], const double y[3], int feature, cav_touch *touch) {
  double n[3];
  sub3(n, y, x);
  double dist = norm3(n);
  if (dist == 0) return;
  scale3(n, 1 / dist, n);
  touch_between(x, y, n, dist, touch->dist - 1e-8 * g->slack, feature, touch);
}

// crossing edges of directions i of a and j of b, all 16 of them
static void nearest_edges(const boxes *g, int i, int j, cav_touch *touch) {
  double c[3];
  cross3(c, UNIT[i], g->axis[j]);
  if (dot3(c, c) < EDGES_PARALLEL) return;
  int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
  for (int sides = 0; sides < 16; sides++) {
    double x[3] = {0, 0, 0}, y[3], s, t;
    x[i1] = sides & 1 ? g->a[i1] : -g->a[i1];
    x[i2] = sides & 2 ? g->a[i2] : -g->a[i2];
    axpy3(y, g->t, sides & 4 ? g->b[j1] : -g->b[j1], g->axis[j1]);
    axpy3(y, y, sides & 8 ? g->b[j2] : -g->b[j2], g->axis[j2]);
    nearest_of_lines(x, UNIT[i], y, g->axis[j], &s, &t);
    if (fabs(s) > g->a[i] || fabs(t) > g->b[j]) continue;
    axpy3(x, x, s, UNIT[i]);
    axpy3(y, y, t, g->axis[j]);
    keep_nearer(g, x, y, 3 * i + j, touch);
  }
}

// nearest points of boxes known to be apart: a corner over the other box, or crossing edges
static void nearest_features(const boxes *g, cav_touch *touch) {
  touch->dist = INFINITY;
  for (int corner = 0; corner < 8; corner++) {
    double x[3], y[3], n[3], d[3];
    corner_of(g->t, g->axis, g->b, corner, y);
    double height = cav_surface_box(g->a, y, n);
    axpy3(x, y, -height, n);
    keep_nearer(g, x, y, CORNER_OF_B + corner, touch);

    corner_of(ORIGIN, UNIT, g->a, corner, x);
    sub3(d, x, g->t);
    double local[3] = {dot3(d, g->axis[0]), dot3(d, g->axis[1]), dot3(d, g->axis[2])};
    height = cav_surface_box(g->b, local, n);
    copy3(y, x);
    for (int k = 0; k < 3; k++) { axpy3(y, y, -height * n[k], g->axis[k]); }
    keep_nearer(g, x, y, CORNER_OF_A + corner, touch);
  }
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) { nearest_edges(g, i, j, touch); }
  }
}

enum { POLYGON_MAX = 8 };

/// Convex polygon; line[k] tells the line from corner k to the next: 0 to 3 edges of the face, 4 to 7 sides of the
/// prism.
typedef struct polygon {
  int count;
  double x[POLYGON_MAX][3];
  int line[POLYGON_MAX];
} polygon;

// cuts away where direction . x > bound; the cut is tagged line. A quadrilateral cut by 4 planes keeps at most 8
// corners
static void cut(polygon *p, const double direction[3], double bound, int line) {
  polygon out = {.count = 0};
  for (int k = 0; k < p->count; k++) {
    const double *x = p->x[k], *y = p->x[(k + 1) % p->count];
    double hx = dot3(direction, x) - bound, hy = dot3(direction, y) - bound;
    if (hx <= 0 && out.count < POLYGON_MAX) {
      copy3(out.x[out.count], x);
      out.line[out.count++] = p->line[k];
    }
    if ((hx <= 0) != (hy <= 0) && out.count < POLYGON_MAX) {
      double d[3];
      sub3(d, y, x);
      axpy3(out.x[out.count], x, hx / (hx - hy), d);
      out.line[out.count++] = hx <= 0 ? line : p->line[k];
    }
  }
  *p = out;
}

/// One box whose face is stood upon and the other, whose face stands.
typedef struct ground {
  const double *half, *other_half;
  double centre[3], other_centre[3];
  double axis[3][3], other_axis[3][3];
  double normal[3]; ///< out of the face
  int face;         ///< axis of the face
  int feature;      ///< first feature of its points
} ground;

// the face of the other box turned most against the normal
static polygon opposite_face(const ground *g) {
  int face = 0;
  double most = -1;
  for (int k = 0; k < 3; k++) {
    double c = fabs(dot3(g->normal, g->other_axis[k]));
    if (c > most + PREFER) most = c, face = k;
  }
  int k1 = (face + 1) % 3, k2 = (face + 2) % 3;
  double middle[3], up = dot3(g->normal, g->other_axis[face]);
  axpy3(middle, g->other_centre, up > 0 ? -g->other_half[face] : g->other_half[face], g->other_axis[face]);
  polygon p = {.count = 4};
  for (int k = 0; k < 4; k++) {
    axpy3(p.x[k], middle, k == 0 || k == 3 ? g->other_half[k1] : -g->other_half[k1], g->other_axis[k1]);
    axpy3(p.x[k], p.x[k], k < 2 ? g->other_half[k2] : -g->other_half[k2], g->other_axis[k2]);
    p.line[k] = k;
  }
  return p;
}

// points above the face; sign: of the normal from a to b. lowest_corner: 1 if the lowest is a corner of the other box
static int touch_face(const ground *g, double sign, double margin, cav_touch *touch, int *lowest_corner) {
  polygon p = opposite_face(g);
  int k1 = (g->face + 1) % 3, k2 = (g->face + 2) % 3;
  const int sides[4] = {k1, k1, k2, k2};
  for (int k = 0; k < 4 && p.count; k++) {
    double direction[3];
    scale3(direction, k & 1 ? -1 : 1, g->axis[sides[k]]);
    cut(&p, direction, g->half[sides[k]] + dot3(direction, g->centre), 4 + k);
  }
  int count = 0;
  double lowest = INFINITY, top = g->half[g->face] + dot3(g->normal, g->centre);
  for (int k = 0; k < p.count; k++) {
    double x[3], n[3], height = dot3(g->normal, p.x[k]) - top;
    axpy3(x, p.x[k], -height, g->normal);
    scale3(n, sign, g->normal);
    int before = p.line[(k + p.count - 1) % p.count], after = p.line[k];
    int feature = g->feature + (before < after ? 8 * before + after : 8 * after + before);
    if (height < lowest) lowest = height, *lowest_corner = before < 4 && after < 4;
    count += touch_between(x, p.x[k], n, height, margin, feature, touch + count);
  }
  return count;
}

// points above the face of a or of b that the axis names
static int touch_faces(const boxes *g, const separation *best, double margin, cav_touch *touch, int *lowest_corner) {
  int on_a = best->second < 0;
  ground s = {.half = on_a ? g->a : g->b, .other_half = on_a ? g->b : g->a, .face = on_a ? best->first : best->second};
  memcpy(s.axis, on_a ? UNIT : g->axis, sizeof s.axis);
  memcpy(s.other_axis, on_a ? g->axis : UNIT, sizeof s.other_axis);
  copy3(on_a ? s.other_centre : s.centre, g->t);
  scale3(s.normal, on_a ? 1 : -1, best->normal);
  int upper = dot3(s.normal, s.axis[s.face]) > 0;
  s.feature = (on_a ? FACE_A : FACE_B) + 64 * (2 * s.face + upper);
  return touch_face(&s, on_a ? 1 : -1, margin, touch, lowest_corner);
}

// one point at the corner of b furthest into a
static int touch_deepest(const boxes *g, const separation *best, double margin, cav_touch *touch) {
  double x[3], y[3];
  copy3(y, g->t);
  for (int k = 0; k < 3; k++) { axpy3(y, y, dot3(best->normal, g->axis[k]) > 0 ? -g->b[k] : g->b[k], g->axis[k]); }
  axpy3(x, y, -best->gap, best->normal);
  return touch_between(x, y, best->normal, best->gap, margin, CORNER_OF_B, touch);
}

static int touch_boxes(const boxes *g, double margin, cav_touch *touch) {
  separation best = separate(g);
  if (best.gap >= margin) return 0;
  int exact = 0, count;
  if (best.first >= 0 && best.second >= 0) {
    count = touch_edges(g, &best, margin, touch);
  } else {
    count = touch_faces(g, &best, margin, touch, &exact);
  }
  if (exact || (best.gap <= 0 && count)) return count;
  if (best.gap <= 0) return touch_deepest(g, &best, margin, touch);
  // apart, or nothing above the face: the distance itself; the manifold stays if it is as near
  cav_touch nearest;
  nearest_features(g, &nearest);
  double least = INFINITY;
  for (int k = 0; k < count; k++) { least = fmin(least, touch[k].dist); }
  int edges = best.first >= 0 && best.second >= 0;
  if (count && !edges && least <= nearest.dist + g->slack) return count;
  if (!(nearest.dist < margin)) return 0;
  touch[0] = nearest;
  return 1;
}

int cav_collide_boxes(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  boxes g = {.a = a->size, .b = b->size};
  double d[3];
  sub3(d, b->pos, a->pos);
  rotate_back(g.t, a->rotation, d);
  g.slack = INFINITY;
  for (int j = 0; j < 3; j++) {
    column3(d, b->rotation, j);
    rotate_back(g.axis[j], a->rotation, d);
    g.slack = fmin(g.slack, PREFER * fmin(a->size[j], b->size[j]));
  }
  int count = touch_boxes(&g, margin, touch);
  for (int k = 0; k < count; k++) {
    transform(touch[k].pos, a->pos, a->rotation, touch[k].pos);
    rotate(touch[k].normal, a->rotation, touch[k].normal);
  }
  return count;
}
