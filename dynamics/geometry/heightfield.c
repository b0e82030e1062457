/// Contacts of a height field with sphere, capsule, ellipsoid, cylinder, box and mesh.
///
/// Where the surface is one plane as far as the shape may touch it, the contacts are those of that plane. Elsewhere the field
/// is a solid made of prisms, two a cell, from its surface down to its base. Prisms under the bounding box of the other
/// shape, and as far beside it as it is large or a cell is, are tested one by one. Apart: polytope.c's contact with the
/// prism, kept only where its normal supports the surface about the point: walls between prisms, and edges that lie in a
/// plane or a valley, push nothing sideways. Overlapping: the points of the shape over the triangle, each with its height
/// over the triangle's plane; the way out is up. Points found by several prisms are one; of more than 8 the deepest is
/// kept, then those furthest apart. A shape that sinks through the base is pushed up by its whole depth until it is below
/// it altogether. Not done: what goes through the surface from below, or sideways through an outer wall deeper than its
/// core, is pushed up.
#include <assert.h>

#include "gjk.h"
#include "math3.h"
#include "pairs.h"

enum { FOUND_MAX = 128, OVER = 16 }; // OVER: features of a prism from this on are of points over it, where it overlaps
// fractions of the size: points that are one; how far a neighbour may stick out of a supporting plane; cosine of one
// normal
static const double ALIKE = 1e-7, STICKS_OUT = 1e-9, SAME_NORMAL = 1 - 1e-9;
// fraction of the size within which a surface is one plane; of the margin, within which a cell is not beside a shape
static const double LEVEL = 1e-12, BESIDE = 1e-4;

typedef struct field {
  const cav_shape *shape;
  const cav_hfield *h;
  double dx, dy, size;
  double depth; ///< of the prisms: the base, or deeper where the other shape reaches through it
} field;

static void grid_point(const field *g, int r, int c, double x[3]) {
  const cav_hfield *h = g->h;
  set3(x, -h->size[0] + c * g->dx, -h->size[1] + r * g->dy, h->height[r * h->ncol + c]);
}

// corners of one of the two triangles of a cell, counterclockwise from above; cells are cut from (r, c) to (r+1, c+1)
static void triangle_of(const field *g, int r, int c, int upper, double x[3][3]) {
  grid_point(g, r, c, x[0]);
  grid_point(g, upper ? r + 1 : r, c + 1, x[1]);
  if (upper) {
    grid_point(g, r + 1, c, x[2]);
  } else {
    grid_point(g, r + 1, c + 1, x[2]);
  }
}

static void plane_through(const double a[3], const double b[3], const double c[3], double plane[4]) {
  double u[3], w[3];
  sub3(u, b, a);
  sub3(w, c, a);
  cross3(plane, u, w);
  normalise3(plane);
  plane[3] = dot3(plane, a);
}

static void make_prism(const field *g, double top[3][3], cav_prism *p) {
  static const int face[6] = {0, 3, 6, 10, 14, 18};
  static const int corner[18] = {0, 1, 2, 5, 4, 3, 0, 3, 4, 1, 1, 4, 5, 2, 2, 5, 3, 0};
  static const int start[7] = {0, 3, 6, 9, 12, 15, 18};
  static const int neighbour[18] = {1, 2, 3, 0, 2, 4, 0, 1, 5, 4, 5, 0, 3, 5, 1, 3, 4, 2};
  for (int k = 0; k < 3; k++) {
    copy3(p->vertex + 3 * k, top[k]);
    set3(p->vertex + 9 + 3 * k, top[k][0], top[k][1], -g->depth);
  }
  for (int f = 0; f < 5; f++) {
    const int *v = corner + face[f];
    double level[3];
    // a side may have no height where its corner is at the base: a point above stands in for it
    copy3(level, p->vertex + 3 * v[1]);
    if (f >= 2) level[2] -= g->size;
    plane_through(p->vertex + 3 * v[0], level, p->vertex + 3 * v[f < 2 ? 2 : 3], p->plane + 4 * f);
  }
  p->mesh = (cav_mesh){.name = "",
                       .nvertex = 6,
                       .nface = 5,
                       .vertex = p->vertex,
                       .plane = p->plane,
                       .face = face,
                       .corner = corner,
                       .neighbour_start = start,
                       .neighbour = neighbour};
  p->shape = (cav_shape){.type = CAV_GEOM_MESH, .size = g->shape->size, .mesh = &p->mesh};
  copy3(p->shape.pos, g->shape->pos);
  memcpy(p->shape.rotation, g->shape->rotation, sizeof p->shape.rotation);
}

static field field_of(const cav_shape *shape) {
  const cav_hfield *h = shape->hfield;
  field g = {shape, h, 2 * h->size[0] / (h->ncol - 1), 2 * h->size[1] / (h->nrow - 1), 0, h->base};
  g.size = g.dx + g.dy + h->base + h->top;
  return g;
}

int cav_hfield_prism(const cav_shape *shape, int feature, cav_prism *p) {
  const int index = (feature - CAV_LEVEL_FEATURES) / CAV_PRISM_FEATURES, columns = shape->hfield->ncol - 1;
  const int own = (feature - CAV_LEVEL_FEATURES) % CAV_PRISM_FEATURES;
  if (feature < CAV_LEVEL_FEATURES || own >= OVER) return -1;
  field g = field_of(shape);
  double top[3][3];
  triangle_of(&g, index / 2 / columns, index / 2 % columns, index % 2, top);
  make_prism(&g, top, p);
  return own;
}

// 1 if p is over a triangle, by a fraction of the cell
static int is_over(double x[3][3], const double p[3], double slack) {
  for (int k = 0; k < 3; k++) {
    const double *a = x[k], *b = x[(k + 1) % 3];
    if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) < -slack) return 0;
  }
  return 1;
}

static int clamp_int(double x, int low, int high) { return x < low ? low : x > high ? high : (int)x; }

// 1 if no triangle about a surface point sticks out of the plane through it with normal up (all in the field's axes)
static int is_supporting(const field *g, const double p[3], const double up[3]) {
  int r0 = clamp_int(floor((p[1] + g->h->size[1]) / g->dy), 0, g->h->nrow - 2);
  int c0 = clamp_int(floor((p[0] + g->h->size[0]) / g->dx), 0, g->h->ncol - 2);
  for (int r = r0 > 0 ? r0 - 1 : 0; r <= r0 + 1 && r < g->h->nrow - 1; r++) {
    for (int c = c0 > 0 ? c0 - 1 : 0; c <= c0 + 1 && c < g->h->ncol - 1; c++) {
      for (int half = 0; half < 2; half++) {
        double x[3][3], d[3];
        triangle_of(g, r, c, half, x);
        if (!is_over(x, p, 1e-7 * g->dx * g->dy)) continue;
        for (int k = 0; k < 3; k++) {
          sub3(d, x[k], p);
          if (dot3(d, up) > STICKS_OUT * g->size) return 0;
        }
      }
    }
  }
  return 1;
}

// 1 if the surface is one plane over some cells and those about them, none of which is outside the field
static int is_level(const field *g, int r0, int r1, int c0, int c1) {
  const cav_hfield *h = g->h;
  if (r0 < 1 || c0 < 1 || r1 + 2 >= h->nrow || c1 + 2 >= h->ncol) return 0;
  const double *row = h->height + (r0 - 1) * h->ncol + c0 - 1, first = row[0], along = row[1] - first,
               up = row[h->ncol] - first;
  for (int i = 0; i <= r1 - r0 + 3; i++, row += h->ncol)
    for (int k = 0; k <= c1 - c0 + 3; k++)
      if (fabs(row[k] - first - i * up - k * along) > LEVEL * g->size) return 0;
  return 1;
}

// contacts with the plane that the surface is about a cell
static int collide_level(const field *g, int r, int c, const cav_shape *a, double margin, cav_touch *touch) {
  static const double size[3] = {0, 0, 0};
  cav_shape level = {.type = CAV_GEOM_PLANE, .size = size};
  double x[3][3], plane[4], axes[3][3];
  triangle_of(g, r, c, 0, x);
  plane_through(x[0], x[1], x[2], plane);
  transform(level.pos, g->shape->pos, g->shape->rotation, x[0]);
  sub3(axes[0], x[1], x[0]);
  normalise3(axes[0]);
  cross3(axes[1], plane, axes[0]);
  copy3(axes[2], plane);
  for (int k = 0; k < 3; k++) {
    double world[3];
    rotate(world, g->shape->rotation, axes[k]);
    for (int i = 0; i < 3; i++) level.rotation[3 * i + k] = world[i];
  }
  const int count = cav_collide_shapes(&level, a, margin, touch);
  for (int k = 0; k < count; k++) scale3(touch[k].normal, -1, touch[k].normal);
  return count;
}

/// Contacts found so far.
typedef struct collection {
  cav_touch at[FOUND_MAX];
  int n;
  double alike;
} collection;

static void collect(collection *all, const cav_touch *t) {
  for (int i = 0; i < all->n; i++) {
    double d[3];
    sub3(d, all->at[i].pos, t->pos);
    if (norm3(d) > all->alike) continue;
    if (t->dist < all->at[i].dist) all->at[i] = *t;
    return;
  }
  if (all->n == FOUND_MAX) all->n = cav_thin_out(all->at, all->n, FOUND_MAX / 2);
  assert(all->n < FOUND_MAX);
  all->at[all->n++] = *t;
}

// contacts apart from the prism that the surface as a whole would give; 1 if the shape's core overlaps the prism
static int collect_apart(const field *g, const cav_shape *a, const cav_shape *solid, const double plane[4],
                         double margin, int feature, collection *all) {
  cav_touch touch[CAV_TOUCH_MAX];
  double radius = cav_core_of(a).radius;
  int count = cav_collide_convex(a, solid, margin, touch);
  for (int k = 0; k < count; k++) {
    if (touch[k].dist + radius <= 0) return 1;
  }
  for (int k = 0; k < count; k++) {
    double y[3], d[3], p[3], up[3];
    axpy3(y, touch[k].pos, touch[k].dist / 2, touch[k].normal);
    sub3(d, y, g->shape->pos);
    rotate_back(p, g->shape->rotation, d);
    rotate_back(up, g->shape->rotation, touch[k].normal);
    scale3(up, -1, up);
    if (dot3(up, plane) < SAME_NORMAL && !is_supporting(g, p, up)) continue;
    touch[k].feature += feature;
    collect(all, &touch[k]);
  }
  return 0;
}

// the shape's points over a triangle that it overlaps, by their height over its plane
static void collect_over(const field *g, const cav_shape *a, double x[3][3], const double plane[4], double margin,
                         int feature, collection *all) {
  double corner[3][3], normal[3], point[CAV_LYING_MAX][3];
  for (int k = 0; k < 3; k++) transform(corner[k], g->shape->pos, g->shape->rotation, x[k]);
  rotate(normal, g->shape->rotation, plane);
  int count = cav_points_over(a, corner, normal, point);
  for (int k = 0; k < count; k++) {
    double d[3];
    sub3(d, point[k], corner[0]);
    double height = dot3(d, normal);
    if (!(height < margin)) continue;
    cav_touch t = {.dist = height, .feature = feature + OVER + k};
    axpy3(t.pos, point[k], -height / 2, normal);
    scale3(t.normal, -1, normal);
    collect(all, &t);
  }
}

// range of cells along an axis that reaches from low to high; 0 if none does
static int cells_between(double low, double high, double half, double step, int cells, int *first, int *last) {
  if (!(high >= -half) || !(low <= half)) return 0;
  *first = clamp_int(floor((low + half) / step), 0, cells - 1);
  *last = clamp_int(floor((high + half) / step), 0, cells - 1);
  return 1;
}

// the steepest of the triangles of a cell and of those about it, m a m; infinite at the border of the field
static double steepest(const field *g, int r, int c) {
  const cav_hfield *h = g->h;
  if (r < 1 || c < 1 || r + 2 >= h->nrow || c + 2 >= h->ncol) return INFINITY;
  double most = 0;
  for (int i = r - 1; i <= r + 1; i++)
    for (int k = c - 1; k <= c + 1; k++) {
      const double *x = h->height + i * h->ncol + k, *y = x + h->ncol;
      const double lower[] = {(x[1] - x[0]) / g->dx, (y[1] - x[1]) / g->dy};
      const double upper[] = {(y[1] - y[0]) / g->dx, (y[0] - x[0]) / g->dy};
      most = fmax(most, fmax(lower[0] * lower[0] + lower[1] * lower[1], upper[0] * upper[0] + upper[1] * upper[1]));
    }
  return sqrt(most);
}

// Whether a cell is so far beside a shape that no normal from it to the shape supports the surface there: all of them lean more
// than the surface does. low, high: box about the shape in the field's axes
static int is_beside(const field *g, int r, int c, const double low[3], const double high[3], double margin) {
  const double *x = g->h->height + r * g->h->ncol + c, *y = x + g->h->ncol;
  const double left = -g->h->size[0] + c * g->dx, near = -g->h->size[1] + r * g->dy;
  const double apart =
      hypot(fmax(0, fmax(low[0] - left - g->dx, left - high[0])), fmax(0, fmax(low[1] - near - g->dy, near - high[1])));
  if (!(apart > BESIDE * margin)) return 0;
  const double rise = fmax(0, high[2] - fmin(fmin(x[0], x[1]), fmin(y[0], y[1])));
  return apart - BESIDE * margin > rise * steepest(g, r, c);
}

int cav_collide_hfield(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  const cav_hfield *h = b->hfield;
  field g = field_of(b);
  double low[3], high[3];
  for (int k = 0; k < 6; k++) {
    double d[3], x[3], local[3];
    column3(d, b->rotation, k / 2);
    if (k & 1) scale3(d, -1, d);
    cav_shape_support(a, d, x);
    sub3(x, x, b->pos);
    rotate_back(local, b->rotation, x);
    (k & 1 ? low : high)[k / 2] = local[k / 2];
  }
  // sideways no further than the shape is large, or a cell: far soft contacts are of what is below
  const double large = fmax(fmax(high[0] - low[0], high[1] - low[1]), fmax(g.dx, g.dy)), aside = fmin(margin, large);
  int r0, r1, c0, c1;
  if (low[2] - margin > h->top || high[2] + margin < -h->base) return 0;
  if (!cells_between(low[0] - aside, high[0] + aside, h->size[0], g.dx, h->ncol - 1, &c0, &c1)) return 0;
  if (!cells_between(low[1] - aside, high[1] + aside, h->size[1], g.dy, h->nrow - 1, &r0, &r1)) return 0;
  if (is_level(&g, r0, r1, c0, c1)) return collide_level(&g, r0, c0, a, margin, touch);
  collection all;
  g.depth = fmax(h->base, margin - low[2]);
  all.n = 0;
  all.alike = ALIKE * (g.dx + g.dy);
  for (int r = r0; r <= r1; r++) {
    for (int c = c0; c <= c1; c++) {
      if (is_beside(&g, r, c, low, high, margin)) continue;
      for (int half = 0; half < 2; half++) {
        cav_prism p;
        double top[3][3];
        triangle_of(&g, r, c, half, top);
        if (fmax(top[0][2], fmax(top[1][2], top[2][2])) < low[2] - margin) continue;
        make_prism(&g, top, &p);
        int feature = CAV_LEVEL_FEATURES + CAV_PRISM_FEATURES * (2 * (r * (h->ncol - 1) + c) + half);
        if (collect_apart(&g, a, &p.shape, p.plane, margin, feature, &all))
          collect_over(&g, a, top, p.plane, margin, feature, &all);
      }
    }
  }
  int count = cav_thin_out(all.at, all.n, CAV_TOUCH_MAX);
  for (int k = 0; k < count; k++) touch[k] = all.at[k];
  return count;
}

// --- rays ---

// smallest t >= 0 at which a ray from above meets a triangle; best if it does not
static double meet_triangle(double x[3][3], const double p[3], const double d[3], double best) {
  double plane[4], y[3];
  plane_through(x[0], x[1], x[2], plane);
  double rate = dot3(plane, d);
  if (!(rate < 0)) return best;
  double t = (plane[3] - dot3(plane, p)) / rate;
  if (!(t >= 0 && t < best)) return best;
  axpy3(y, p, t, d);
  return is_over(x, y, 0) ? t : best;
}

// part of a ray whose coordinate is between two bounds, into from and to
static void clip_ray(double p, double d, double low, double high, double *from, double *to) {
  if (d == 0) {
    if (p < low || p > high) *to = -INFINITY;
    return;
  }
  double t0 = (low - p) / d, t1 = (high - p) / d;
  *from = fmax(*from, fmin(t0, t1));
  *to = fmin(*to, fmax(t0, t1));
}

double cav_ray_hfield(const cav_hfield *h, const double p[3], const double d[3]) {
  field g = {NULL, h, 2 * h->size[0] / (h->ncol - 1), 2 * h->size[1] / (h->nrow - 1), 0, 0};
  double from = 0, to = INFINITY, best = INFINITY, slack = 1e-9 * (h->top + h->base);
  clip_ray(p[0], d[0], -h->size[0], h->size[0], &from, &to);
  clip_ray(p[1], d[1], -h->size[1], h->size[1], &from, &to);
  clip_ray(p[2], d[2], -slack, h->top + slack, &from, &to);
  if (!(from <= to) || isinf(to)) return -1;
  int c0, c1, r0, r1;
  double x0 = p[0] + from * d[0], x1 = p[0] + to * d[0];
  if (!cells_between(fmin(x0, x1) - 1e-9 * g.dx, fmax(x0, x1) + 1e-9 * g.dx, h->size[0], g.dx, h->ncol - 1, &c0, &c1))
    return -1;
  // the cells under the ray, a column at a time
  for (int c = c0; c <= c1; c++) {
    double start = from, end = to, left = -h->size[0] + (c - 1e-9) * g.dx;
    clip_ray(p[0], d[0], left, left + (1 + 2e-9) * g.dx, &start, &end);
    double y0 = p[1] + start * d[1], y1 = p[1] + end * d[1];
    if (!(start <= end)) continue;
    if (!cells_between(fmin(y0, y1) - 1e-9 * g.dy, fmax(y0, y1) + 1e-9 * g.dy, h->size[1], g.dy, h->nrow - 1, &r0, &r1))
      continue;
    for (int r = r0; r <= r1; r++) {
      for (int half = 0; half < 2; half++) {
        double x[3][3];
        triangle_of(&g, r, c, half, x);
        best = meet_triangle(x, p, d, best);
      }
    }
  }
  return isfinite(best) ? best : -1;
}
