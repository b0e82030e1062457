/// Degenerate sets of points, and what a hull of points must be: measured without the code that builds it. Of each
/// kind the sets differ in number of points, scale, place and turn.
#ifndef CAVORT_TESTS_HULL_SETS_H
#define CAVORT_TESTS_HULL_SETS_H

#include "hull.h"
#include "math3.h"
#include "scene.h"

enum { HULL_KINDS = 20, HULL_POINTS_MAX = 1000 };

static const char *const hull_kinds[HULL_KINDS] = {"one to five points",
                                                   "one point, repeated",
                                                   "a line",
                                                   "a line off by 1e-12",
                                                   "a plane",
                                                   "off a plane 1e-6",
                                                   "off a plane 1e-8",
                                                   "1e-10",
                                                   "1e-12",
                                                   "1e-14",
                                                   "1e-16",
                                                   "duplicates",
                                                   "a sphere",
                                                   "rings of a sphere",
                                                   "a grid",
                                                   "faces of a box",
                                                   "the same in single",
                                                   "ring prisms",
                                                   "needles",
                                                   "far from the origin"};

static inline double hull_uniform(double low, double high) { return low + (high - low) * (scene_uniform() + 1) / 2; }

// one point of a kind about the origin, sizes near 1; i of n
static inline void hull_point(int kind, int i, int n, double x[3]) {
  set3(x, scene_uniform(), scene_uniform(), scene_uniform());
  int side = (int)cbrt(n), ring = 8 + n % 8;
  switch (kind) {
    case 1:
      set3(x, 0.3, 0.2, 0.1);
      return;
    case 2:
    case 3:
      set3(x, x[0], kind == 3 ? 1e-12 * x[1] : 0, kind == 3 ? 1e-12 * x[2] : 0);
      return;
    case 4:
      // anywhere, or on the lines of a grid
      x[2] = 0;
      if (n % 2) x[0] = round(2 * x[0]) / 2, x[1] = round(4 * x[1]) / 4;
      return;
    case 5:
    case 6:
    case 7:
    case 8:
    case 9:
    case 10:
      x[2] *= pow(10, -6 - 2 * (kind - 5));
      return;
    case 11:
      for (int k = 0; k < 3; k++) x[k] = i % 7 >> k & 1 ? 1 : x[k] > 0.9 ? 0.5 : 0;
      return;
    case 12:
      normalise3(x);
      return;
    case 13: {
      double z = M_PI * (i / ring) / fmax(n / ring, 1), turn = 2 * M_PI * (i % ring) / ring;
      set3(x, sin(z) * cos(turn), sin(z) * sin(turn), cos(z));
      return;
    }
    case 14:
      set3(x, i % side, i / side % side, i / side / side % side);
      scale3(x, 1.0 / side, x);
      return;
    case 15:
    case 16:
      x[i % 3] = x[i % 3] < 0 ? -1 : 1;
      return;
    case 17: {
      double turn = 2 * M_PI * (i / 2) / fmax(n / 2, 1);
      set3(x, cos(turn), sin(turn), i % 2);
      return;
    }
    case 18:
      x[1] *= 1e-3, x[2] *= n % 2 ? 1e-3 : 1e-7;
      return;
    default:
      return;
  }
}

/// Fills points with a set of a kind; their number.
static inline int hull_set(int kind, double *point) {
  int n = kind == 0 ? 1 + (int)hull_uniform(0, 4.99) : 4 + (int)exp(hull_uniform(0, log(HULL_POINTS_MAX - 5)));
  double scale = pow(10, hull_uniform(-9, 9)), q[4], R[9], shift[3];
  int turned = scene_uniform() < 0;
  for (int k = 0; k < 4; k++) q[k] = scene_uniform();
  for (int k = 0; k < 3; k++) shift[k] = (kind == 19 ? 1e6 : 1) * scene_uniform() * (scene_uniform() < 0);
  quat_normalise(q);
  quat_matrix(R, q);
  for (int i = 0; i < n; i++) {
    double x[3];
    hull_point(kind, i, n, x);
    if (turned) rotate(x, R, x);
    for (int k = 0; k < 3; k++)
      point[3 * i + k] = kind == 16 ? (float)(scale * (x[k] + shift[k])) : scale * (x[k] + shift[k]);
  }
  return n;
}

/// What is wrong with a hull, lengths as fractions of the size of the set.
typedef struct hull_faults {
  double outside; ///< how far points reach beyond the vertices, over directions and face normals
  double above;   ///< how far points are above planes of faces
  int inverted;   ///< faces whose corners are clockwise from outside
  int open;       ///< edges that are not of exactly two faces, one each way
  int euler;      ///< V - E + F - 2 where there are faces
  int lost;       ///< directions in which walking from neighbour to neighbour does not end at the top
} hull_faults;

static inline double hull_top(const double *x, int n, const double d[3]) {
  double top = -INFINITY;
  for (int i = 0; i < n; i++) top = fmax(top, dot3(x + 3 * i, d));
  return top;
}

// where walking uphill along neighbours ends
static inline double hull_walk(const cav_hull *h, const double d[3], int start) {
  int at = start;
  for (int last = -1; last != at;) {
    last = at;
    for (int k = h->neighbour_start[last]; k < h->neighbour_start[last + 1]; k++) {
      if (dot3(h->vertex + 3 * h->neighbour[k], d) > dot3(h->vertex + 3 * at, d)) at = h->neighbour[k];
    }
  }
  return dot3(h->vertex + 3 * at, d);
}

static inline void hull_check_direction(const double *point, int n, const cav_hull *h, const double d[3], double size,
                                        hull_faults *f) {
  double most = hull_top(point, n, d), top = hull_top(h->vertex, h->nvertex, d);
  f->outside = fmax(f->outside, (most - top) / size);
  f->lost += top - hull_walk(h, d, 0) > 1e-9 * size;
}

static inline void hull_check_faces(const double *point, int n, const cav_hull *h, double size, hull_faults *f) {
  // way[v * nvertex + w]: faces that pass from v to w
  unsigned char *way = calloc((size_t)h->nvertex * (size_t)h->nvertex + 1, 1);
  int edges = 0, vertices = 0;
  for (int i = 0; way && i < h->nface; i++) {
    const int *c = h->corner + h->face[i];
    int corners = h->face[i + 1] - h->face[i];
    double area[3] = {0, 0, 0}, u[3], w[3], e[3];
    for (int k = 0; k < corners; k++) {
      int v = c[k], next = c[(k + 1) % corners];
      way[v * h->nvertex + next]++;
      sub3(u, h->vertex + 3 * v, h->vertex + 3 * c[0]);
      sub3(w, h->vertex + 3 * next, h->vertex + 3 * c[0]);
      cross3(e, u, w);
      add3(area, area, e);
    }
    const double *plane = h->plane + 4 * i;
    f->inverted += dot3(area, plane) <= 0;
    f->above = fmax(f->above, (hull_top(point, n, plane) - plane[3]) / size);
  }
  for (int v = 0; way && v < h->nvertex; v++) {
    int used = 0;
    for (int w = 0; w < h->nvertex; w++) {
      int to = way[v * h->nvertex + w], fro = way[w * h->nvertex + v];
      f->open += to != fro || to > 1;
      used |= to || fro;
      edges += v < w && (to || fro);
    }
    // vertices that a face swallows, being in its plane to 1e-6, stay for support points
    vertices += used;
  }
  free(way);
  if (h->nface) f->euler = abs(vertices - edges + h->nface - 2);
}

/// Judges a hull of n points.
static inline hull_faults hull_judge(const double *point, int n, const cav_hull *h) {
  hull_faults f = {0};
  double size = 1e-300, d[3];
  for (int k = 0; k < 3; k++) {
    double axis[3] = {k == 0, k == 1, k == 2}, back[3];
    scale3(back, -1, axis);
    size = fmax(size, hull_top(point, n, axis) + hull_top(point, n, back));
  }
  for (int k = 0; k < 36; k++) {
    // along the axes first
    if (k < 6)
      set3(d, (k % 3 == 0) * (k < 3 ? 1 : -1), (k % 3 == 1) * (k < 3 ? 1 : -1), (k % 3 == 2) * (k < 3 ? 1 : -1));
    else
      set3(d, scene_uniform(), scene_uniform(), scene_uniform());
    normalise3(d);
    hull_check_direction(point, n, h, d, size, &f);
  }
  for (int i = 0; i < h->nface; i++) hull_check_direction(point, n, h, h->plane + 4 * i, size, &f);
  hull_check_faces(point, n, h, size, &f);
  return f;
}

#endif
