/// The direction in which two convex bodies are furthest apart or least inside each other, exact: one search, one
/// polish.
/// The only user of libccd.
///
/// Search. Bodies without a curve: gjk.c alone, which ends at a feature, to rounding; so too an ellipsoid or a cylinder
/// against a mesh of more than a few corners, polished at the few corners about that direction. Other curved ones:
/// libccd's portal refinement on both cores grown by half the reach gives a direction of separation. Where they are
/// apart the polish proves its answer from there, and all is done. It is no search for the least way out of an overlap,
/// and that it finds none is true to its tolerance only: these go through gjk.c's polytope, as does everything in a
/// build without libccd. tests/results/convex.md has the measurements.
/// Polish. The gap along n, gap(n) = min_b n.b - max_a n.a, is a lower bound of the signed distance, which is its
/// largest value. Its gradient is b - a of the support points; it is smooth as long as the same features of both bodies
/// meet: corner, edge, face, ellipsoid, rim, side, cap. So every pair of features about the direction is solved by
/// itself: n square to the directions in which the features are straight, Newton in what is left (two angles, one,
/// none). The largest gap wins; of equal ones the one whose points lie across from each other. Points on both bodies
/// that far apart along n are a proof: of the least distance where the bodies are apart, else of a least way out among
/// its neighbours.
#include "gjk.h"
#include "math3.h"
#include "pairs.h"

#ifdef CAVORT_HAVE_CCD
#include <ccd/ccd.h>
#endif

enum { NEAR_MAX = 12, FLAT_MAX = 8, FEATURES_MAX = NEAR_MAX + NEAR_MAX * (NEAR_MAX - 1) / 2 + FLAT_MAX };
// fractions of the size within which corners may meet: the few nearest ones first, which mostly are enough; sine below
// which a direction is square to another; 1 - cosine below which two are one
static const double FEW = 1e-6, MEETS = 1e-2, SQUARE = 1e-9, PARALLEL = 1e-14;
// fractions of the size: gaps that are equal; points that lie across from each other, or nearly
static const double LEAST_GAIN = 1e-13, ACROSS = 1e-12, NEARLY_ACROSS = 1e-9;
// fraction of the size by which the polish improves on a search that has not ended; to which faces of meshes are flat (hull.c)
static const double LOOSE = 1e-6, EVEN = 1e-6;

/// What of a body may meet the other: a corner, an edge or a face, or of a curved body what its support follows.
typedef struct feature {
  int corners, face; ///< 1: corner, 2: edge, 3: that face; 0: curved
  int straight;      ///< 1: along a direction, 2: flat
  double x[2][3];    ///< corners
  double axis[3];    ///< the direction, or the normal out of what is flat
  double rim;        ///< height of a cylinder's rim over its centre, along its axis
} feature;

/// A direction, points of both bodies that meet along it, and by how far they miss each other across it: 0 if it is
/// solved.
typedef struct candidate {
  cav_separation separation;
  double miss;
} candidate;

typedef struct search {
  const cav_shape *a, *b; ///< a is curved
  const cav_core *core;   ///< of b
  double size, meets;
  double above; ///< what the distance is at most, by points that a search has found
  candidate best;
} search;

// --- features about a direction ---

static void add_cylinder(const cav_shape *s, const double n[3], feature *f, int *count) {
  double axis[3];
  column3(axis, s->rotation, 2);
  double along = dot3(axis, n), sign = along < 0 ? -1 : 1;
  for (int straight = 0; straight < 3; straight++) {
    if ((straight == 1 && fabs(along) > 0.5) || (straight == 2 && fabs(along) < 0.5)) continue;
    f[*count] = (feature){.straight = straight, .rim = sign * s->size[1]};
    scale3(f[(*count)++].axis, sign, axis);
  }
}

// corners of a mesh furthest along n, highest first: each time the highest neighbour of those found, as what is higher
// than a plane is connected on a convex body
static int near_vertices(const cav_shape *s, const double n[3], double band, int near[NEAR_MAX]) {
  const cav_mesh *m = s->mesh;
  double local[3];
  rotate_back(local, s->rotation, n);
  near[0] = cav_mesh_summit(m, local);
  double top = dot3(local, m->vertex + 3 * near[0]);
  int count = 1;
  while (count < NEAR_MAX) {
    double most = top - band;
    int best = -1;
    for (int i = 0; i < count; i++) {
      for (int k = m->neighbour_start[near[i]]; k < m->neighbour_start[near[i] + 1]; k++) {
        int known = 0, v = m->neighbour[k];
        double h = dot3(local, m->vertex + 3 * v);
        for (int j = 0; j < count && h > most; j++) known |= near[j] == v;
        if (h > most && !known) most = h, best = v;
      }
    }
    if (best < 0) break;
    near[count++] = best;
  }
  return count;
}

// corners furthest along n, to within a band; their number
static int near_corners(const cav_shape *s, const double n[3], double band, int near[NEAR_MAX]) {
  double height[8], x[3], top = -INFINITY;
  int count = 0, all = cav_shape_corners(s);
  if (s->type == CAV_GEOM_MESH) return near_vertices(s, n, band, near);
  for (int v = 0; v < all; v++) {
    cav_shape_corner(s, v, x);
    height[v] = dot3(n, x);
    top = fmax(top, height[v]);
  }
  for (int v = 0; v < all; v++) {
    if (height[v] > top - band) near[count++] = v;
  }
  return count;
}

// faces that look along n, to a cosine: of a mesh those that meet at corners near n; their number
static int near_faces(const cav_shape *s, const double n[3], double cosine, const int *near, int corners,
                      int face[FLAT_MAX]) {
  const cav_mesh *m = s->type == CAV_GEOM_MESH && s->mesh->meeting ? s->mesh : NULL;
  int count = 0;
  for (int i = 0; i < (m ? corners : 1); i++) {
    int first = m ? m->meeting_start[near[i]] : 0, end = m ? m->meeting_start[near[i] + 1] : cav_shape_faces(s);
    for (int k = first; k < end && count < FLAT_MAX; k++) {
      int f = m ? m->meeting[k] : k, known = 0;
      double normal[3];
      for (int j = 0; j < count; j++) known |= face[j] == f;
      if (known) continue;
      cav_shape_normal(s, f, normal);
      if (dot3(normal, n) >= cosine) face[count++] = f;
    }
  }
  return count;
}

static void add_polyhedron(const cav_shape *s, const double n[3], double meets, double size, feature *f, int *count) {
  int near[NEAR_MAX], face[FLAT_MAX], corners = near_corners(s, n, meets * size, near);
  int flat = near_faces(s, n, 1 - meets, near, corners, face);
  for (int i = 0; i < flat; i++) {
    f[*count] = (feature){.corners = 3, .face = face[i], .straight = 2};
    cav_shape_normal(s, face[i], f[(*count)++].axis);
  }
  for (int i = 0; i < corners; i++) {
    feature corner = {.corners = 1};
    cav_shape_corner(s, near[i], corner.x[0]);
    f[(*count)++] = corner;
    for (int j = 0; j < i; j++) {
      feature *edge = &f[*count];
      if (!cav_shape_neighbours(s, near[i], near[j])) continue;
      *edge = (feature){.corners = 2, .straight = 1};
      copy3(edge->x[0], corner.x[0]);
      cav_shape_corner(s, near[j], edge->x[1]);
      sub3(edge->axis, edge->x[1], edge->x[0]);
      if (normalise3(edge->axis) > 0 && fabs(dot3(edge->axis, n)) < 0.5) ++*count;
    }
  }
}

static int features_along(const cav_shape *s, const double n[3], double meets, double size, feature f[FEATURES_MAX]) {
  int count = 0;
  if (s->type == CAV_GEOM_CYLINDER)
    add_cylinder(s, n, f, &count);
  else if (s->type == CAV_GEOM_ELLIPSOID)
    f[count++] = (feature){.corners = 0};
  else
    add_polyhedron(s, n, meets, size, f, &count);
  return count;
}

// --- direction of a pair of features ---

void cav_shape_bend(const cav_shape *s, const double n[3], double t[2][3], double H[2][2]) {
  double m[3], u[2][3], w[3], x[3];
  rotate_back(m, s->rotation, n);
  for (int i = 0; i < 2; i++) rotate_back(u[i], s->rotation, t[i]);
  if (s->type == CAV_GEOM_ELLIPSOID) {
    for (int k = 0; k < 3; k++) x[k] = s->size[k] * m[k];
    double length = norm3(x);
    for (int k = 0; k < 3; k++) x[k] *= s->size[k] / length;
    for (int i = 0; i < 2; i++) {
      for (int j = 0; j < 2; j++) {
        for (int k = 0; k < 3; k++) H[i][j] += u[i][k] * s->size[k] * s->size[k] * u[j][k] / length;
        H[i][j] -= dot3(x, u[i]) * dot3(x, u[j]) / length;
      }
    }
    return;
  }
  double length = sqrt(m[0] * m[0] + m[1] * m[1]);
  set3(w, length > 0 ? -m[1] / length : 0, length > 0 ? m[0] / length : 1, 0);
  for (int i = 0; i < 2; i++) {
    for (int j = 0; j < 2; j++) H[i][j] += s->size[0] / fmax(length, 1e-300) * dot3(w, u[i]) * dot3(w, u[j]);
  }
}

// point of a feature furthest along n; H += t_i' (derivative of that point by n) t_j
static void follow(const cav_shape *s, const feature *f, const double n[3], double t[2][3], double x[3],
                   double H[2][2]) {
  double m[3], local[3], axis[3];
  if (f->corners) {
    copy3(x, f->x[0]);
    return;
  }
  cav_shape_bend(s, n, t, H);
  rotate_back(m, s->rotation, n);
  if (s->type == CAV_GEOM_ELLIPSOID) {
    for (int k = 0; k < 3; k++) local[k] = s->size[k] * m[k];
    double length = norm3(local);
    for (int k = 0; k < 3; k++) local[k] *= s->size[k] / length;
    transform(x, s->pos, s->rotation, local);
    return;
  }
  double length = sqrt(m[0] * m[0] + m[1] * m[1]);
  double c = length > 0 ? m[0] / length : 1, d = length > 0 ? m[1] / length : 0;
  // of a rim the end known, whichever way n turns
  column3(axis, s->rotation, 2);
  set3(local, s->size[0] * c, s->size[0] * d, dot3(axis, f->axis) < 0 ? -s->size[1] : s->size[1]);
  transform(x, s->pos, s->rotation, local);
}

static void tangents(const double n[3], const double *square, double t[2][3]) {
  int least = fabs(n[0]) < fabs(n[1]) ? 0 : 1;
  if (fabs(n[2]) < fabs(n[least])) least = 2;
  const double e[3] = {least == 0, least == 1, least == 2};
  cross3(t[0], n, square ? square : e);
  normalise3(t[0]);
  cross3(t[1], n, t[0]);
}

// gap between two features along n, its gradient r and Hessian H on the sphere, in two directions square to n
static double gap_of(const search *g, const feature *fa, const feature *fb, const double n[3], double t[2][3],
                     double r[2], double H[2][2]) {
  double x[3], y[3], d[3], back[3], bend[2][2] = {{0}};
  scale3(back, -1, n);
  follow(g->a, fa, n, t, x, bend);
  follow(g->b, fb, back, t, y, bend);
  sub3(d, y, x);
  double gap = dot3(d, n);
  for (int i = 0; i < 2; i++) {
    r[i] = dot3(d, t[i]);
    for (int j = 0; j < 2; j++) H[i][j] = -bend[i][j] - (i == j ? gap : 0);
  }
  return gap;
}

// Newton's step uphill, with a Hessian that is not negative definite shifted until it is; one: along the first only
static void step_uphill(int one, const double r[2], double H[2][2], double s[2]) {
  double mean = one ? H[0][0] : (H[0][0] + H[1][1]) / 2;
  double spread = one ? 0 : sqrt(0.25 * (H[0][0] - H[1][1]) * (H[0][0] - H[1][1]) + H[0][1] * H[0][1]);
  double top = mean + spread, scale = fabs(mean) + spread;
  double shift = top < -1e-12 * scale ? 0 : top + 0.1 * scale + 1e-300;
  double a = H[0][0] - shift, b = one ? 0 : H[0][1], c = H[1][1] - shift, det = a * c - b * b;
  s[0] = one ? -r[0] / a : (b * r[1] - c * r[0]) / det;
  s[1] = one ? 0 : (b * r[0] - a * r[1]) / det;
}

// from n uphill over directions square to an axis (NULL: all) as long as the gap of two features grows
static void climb(const search *g, const feature *fa, const feature *fb, const double *square, double n[3]) {
  enum { STEPS_MAX = 30, HALVINGS_MAX = 10 };
  double t[2][3], r[2], H[2][2];
  tangents(n, square, t);
  double gap = gap_of(g, fa, fb, n, t, r, H);
  for (int k = 0; k < STEPS_MAX; k++) {
    double s[2], m[3], derivative = square ? fabs(r[0]) : sqrt(r[0] * r[0] + r[1] * r[1]), next = 0;
    if (derivative < 1e-15 * g->size) return;
    step_uphill(square != NULL, r, H, s);
    double turn = sqrt(s[0] * s[0] + s[1] * s[1]), fraction = turn > 0.3 ? 0.3 / turn : 1;
    if (!isfinite(turn) || turn < 1e-16) return;
    int halving = 0;
    for (; halving < HALVINGS_MAX; halving++, fraction /= 2) {
      axpy3(m, n, fraction * s[0], t[0]);
      axpy3(m, m, fraction * s[1], t[1]);
      normalise3(m);
      tangents(m, square, t);
      next = gap_of(g, fa, fb, m, t, r, H);
      // near the top rounding hides that it grows: the derivative falls instead
      double left = square ? fabs(r[0]) : sqrt(r[0] * r[0] + r[1] * r[1]);
      if (next > gap + LEAST_GAIN * g->size || (next > gap - LEAST_GAIN * g->size && left < 0.9 * derivative)) break;
      tangents(n, square, t);
    }
    if (halving == HALVINGS_MAX) return;
    copy3(n, m);
    gap = next;
  }
}

// the direction about a start in which two features meet; 0 if there is none
static int solve(const search *g, const feature *fa, const feature *fb, const double start[3], double n[3]) {
  const double *square = fa->straight == 1 ? fa->axis : fb->straight == 1 ? fb->axis : NULL;
  // of two flat ones a direction has only one unless they are parallel: else a corner or an edge of the other meets it
  if (fa->straight == 2 && fb->straight == 2 && dot3(fa->axis, fb->axis) > PARALLEL - 1) return 0;
  if (fa->straight == 2 || fb->straight == 2) {
    scale3(n, fa->straight == 2 ? 1 : -1, fa->straight == 2 ? fa->axis : fb->axis);
    return 1;
  }
  if (fa->straight && fb->straight) {
    cross3(n, fa->axis, fb->axis);
    if (dot3(n, start) < 0) scale3(n, -1, n);
    if (normalise3(n) > SQUARE) return 1;
  }
  copy3(n, start);
  if (square) axpy3(n, n, -dot3(n, square), square);
  if (normalise3(n) < 0.5) return 0;
  climb(g, fa, fb, square, n);
  return 1;
}

// --- points of a direction ---

// point nearest to y of all those of a curved body furthest along n: one, a straight line of a side, or a cap
static void nearest_on_curved(const cav_shape *s, const double n[3], const double y[3], double x[3]) {
  double axis[3], out[3], d[3];
  cav_shape_support(s, n, x);
  if (s->type != CAV_GEOM_CYLINDER) return;
  column3(axis, s->rotation, 2);
  double along = dot3(n, axis), half = s->size[1];
  axpy3(out, n, -along, axis);
  double across = normalise3(out);
  sub3(d, y, s->pos);
  if (fabs(along) <= SQUARE) {
    double t = dot3(d, axis);
    axpy3(x, s->pos, s->size[0], out);
    axpy3(x, x, t < -half ? -half : t > half ? half : t, axis);
  } else if (across <= SQUARE) {
    axpy3(d, d, -dot3(d, axis), axis);
    double radius = norm3(d);
    axpy3(x, s->pos, along < 0 ? -half : half, axis);
    axpy3(x, x, radius > s->size[0] ? s->size[0] / radius : 1, d);
  }
}

static void nearest_on_segment(const double p[3], const double q[3], const double x[3], double y[3]) {
  double e[3], d[3];
  sub3(e, q, p);
  sub3(d, x, p);
  double length2 = dot3(e, e), t = length2 > 0 ? dot3(d, e) / length2 : 0;
  axpy3(y, p, t < 0 ? 0 : t > 1 ? 1 : t, e);
}

// point of a face square to n that is nearest to x as seen along n
static void nearest_on_face(const cav_outline *o, const double n[3], const double x[3], double y[3]) {
  double flat[3], d[3], least = INFINITY, turn[2] = {0, 0};
  sub3(d, o->x[0], x);
  axpy3(flat, x, dot3(d, n), n);
  for (int k = 0; k < o->n; k++) {
    double on[3], e[3], c[3];
    const double *from = o->x[k], *to = o->x[(k + 1) % o->n];
    nearest_on_segment(from, to, flat, on);
    sub3(d, on, flat);
    sub3(e, to, from);
    cross3(c, e, d);
    // on which sides of the edges it lies
    turn[dot3(c, n) < 0] = 1;
    if (!(dot3(d, d) < least)) continue;
    least = dot3(d, d);
    copy3(y, on);
  }
  if (turn[0] + turn[1] < 2) copy3(y, flat);
}

// point of a body's feature, furthest along n, that is nearest to x
static void nearest_on(const cav_shape *s, const feature *f, const double n[3], const double x[3], double y[3]) {
  cav_outline o = {.n = 0};
  double d[3];
  switch (f->corners) {
    case 0:
      nearest_on_curved(s, n, x, y);
      return;
    case 1:
      copy3(y, f->x[0]);
      return;
    case 2:
      // as seen along n
      sub3(d, f->x[0], x);
      axpy3(d, x, dot3(d, n), n);
      nearest_on_segment(f->x[0], f->x[1], d, y);
      return;
    default:
      cav_outline_push(s, f->face, &o);
      nearest_on_face(&o, n, x, y);
  }
}

// where two straight features cross as seen along n: on the line of a through x; x itself if they are parallel
static void cross_lines(const feature *fa, const feature *fb, const double y[3], double x[3]) {
  double c[3], d[3], e[3];
  cross3(c, fa->axis, fb->axis);
  sub3(d, y, x);
  cross3(e, d, fb->axis);
  double sine2 = dot3(c, c);
  if (sine2 > SQUARE * SQUARE) axpy3(x, x, dot3(e, c) / sine2, fa->axis);
}

// what of both bodies meets, for derivatives: of a polyhedron points that span its feature
static void note_features(const search *g, const feature *fa, const feature *fb, const double n[3],
                          cav_separation *out) {
  double t[2][3];
  out->straight = fa->straight;
  out->corners = cav_shape_is_curved(g->b) ? 0 : fb->corners;
  for (int k = 0; k < out->corners && k < 2; k++) copy3(out->corner_b[k], fb->x[k]);
  if (out->corners < 3) return;
  tangents(n, NULL, t);
  copy3(out->corner_b[0], out->y);
  for (int k = 0; k < 2; k++) axpy3(out->corner_b[k + 1], out->y, g->size, t[k]);
}

// keeps a direction of two features if its gap is larger than the best; among equal ones the points say which is
// solved, as near its top a gap does not depend on the direction
static void keep(search *g, const feature *fa, const feature *fb, const double n[3]) {
  enum { STEPS_MAX = 300 };
  candidate c;
  double back[3], x[3], y[3], far[3], d[3];
  scale3(back, -1, n);
  cav_shape_support(g->a, n, x);
  cav_core_support(g->core, back, far);
  sub3(d, far, x);
  c.separation.gap = dot3(d, n);
  if (c.separation.gap < g->best.separation.gap - LEAST_GAIN * g->size) return;
  if (fa->straight == 1 && fb->straight == 1) cross_lines(fa, fb, fb->corners ? fb->x[0] : far, x);
  // from the middle of a cap one step tells where it meets anything
  if (fa->straight == 2) copy3(x, g->a->pos);
  if (fb->straight == 2 && !fb->corners) nearest_on(g->a, fa, n, g->b->pos, x);
  nearest_on(g->b, fb, back, x, y);
  for (int k = 0; k < STEPS_MAX; k++) {
    double last[3];
    copy3(last, y);
    nearest_on(g->a, fa, n, y, x);
    nearest_on(g->b, fb, back, x, y);
    sub3(last, last, y);
    if (dot3(last, last) == 0) break;
  }
  sub3(d, y, x);
  axpy3(d, d, -c.separation.gap, n);
  c.miss = norm3(d);
  if (c.separation.gap < g->best.separation.gap + LEAST_GAIN * g->size && c.miss >= g->best.miss) return;
  copy3(c.separation.n, n);
  copy3(c.separation.x, x);
  copy3(c.separation.y, y);
  note_features(g, fa, fb, n, &c.separation);
  g->best = c;
}

// bodies that are apart: whatever else there is, their distance lies between the gap and what the points that meet are
// apart, gap + miss^2/(2 gap)
static int is_proven_apart(const search *g) {
  double gap = g->best.separation.gap, miss = g->best.miss;
  // the face of a mesh is even to its tolerance only, to which its distance has to be known from above, too
  if (gap > 0 && g->best.separation.corners > 2 && miss < EVEN * g->size && gap > g->above - EVEN * g->size) return 1;
  return gap > 0 && miss < NEARLY_ACROSS * g->size && miss * miss < 2 * gap * LEAST_GAIN * g->size;
}

// all pairs of features about a direction, again about the best of them until that is proven, or its gap falls short of
// least; 1 if it is proven
static int polish(search *g, const double start[3], double least) {
  enum { ROUNDS_MAX = 4 };
  feature fa[FEATURES_MAX], fb[FEATURES_MAX];
  double n[3], back[3], about[3];
  copy3(about, start);
  g->best = (candidate){.separation = {.gap = -INFINITY}, .miss = INFINITY};
  for (int round = 0; round < ROUNDS_MAX; round++) {
    scale3(back, -1, about);
    int na = features_along(g->a, about, g->meets, g->size, fa), nb = features_along(g->b, back, g->meets, g->size, fb);
    for (int i = 0; i < na; i++) {
      // faces are the last of a list: where one meets, the corners and edges about it are its own
      for (int j = nb - 1; j >= 0; j--) {
        if (solve(g, &fa[i], &fb[j], about, n)) keep(g, &fa[i], &fb[j], n);
        if (is_proven_apart(g)) return 1;
      }
    }
    if (g->best.separation.gap < least) return 0;
    if (g->best.miss < ACROSS * g->size) return 1;
    copy3(about, g->best.separation.n);
  }
  return 0;
}

// the polytope ends short of the least way out where a body is in the middle of a large round one: then the axes of
// both are tried too, either way
static void polish_elsewhere(search *g) {
  const cav_shape *shapes[2] = {g->a, g->b};
  for (int k = 0; k < 12; k++) {
    candidate best = g->best;
    double n[3];
    column3(n, shapes[k & 1]->rotation, k / 4);
    if (k & 2) scale3(n, -1, n);
    polish(g, n, -INFINITY);
    if (g->best.separation.gap < best.separation.gap + LEAST_GAIN * g->size) g->best = best;
  }
}

// --- libccd ---

#ifdef CAVORT_HAVE_CCD

enum { SUPPORTS_MAX = 400, PORTALS_MAX = 100 };

/// What libccd sees: a core grown by a ball, in a world about one of them where sizes are near 1, as it compares with
/// numbers.
typedef struct grown {
  const cav_core *core;
  const double *origin;
  double by, scale;
  int *calls; ///< supports asked for, of both
} grown;

static void ccd_support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out) {
  const grown *g = object;
  double d[3] = {direction->v[0], direction->v[1], direction->v[2]};
  normalise3(d);
  // libccd bounds only part of its loops: past the limit the cores are made to look apart, which ends all of them
  if (++*g->calls > SUPPORTS_MAX) {
    scale3(out->v, -1e9, d);
    return;
  }
  cav_core_support(g->core, d, out->v);
  sub3(out->v, out->v, g->origin);
  axpy3(out->v, out->v, g->by, d);
  scale3(out->v, 1 / g->scale, out->v);
}

static void ccd_centre(const void *object, ccd_vec3_t *centre) {
  const grown *g = object;
  sub3(centre->v, g->core->shape->pos, g->origin);
  scale3(centre->v, 1 / g->scale, centre->v);
}

// a direction from a to b along which the cores grown to meet at most apart overlap little; 0 if it has none: that they
// are apart is true to its tolerance only
static int ask_libccd(const cav_core *a, const cav_core *b, double size, double most, double n[3]) {
  int calls = 0;
  grown ga = {a, a->shape->pos, most / 2, size, &calls}, gb = {b, a->shape->pos, most / 2, size, &calls};
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = ccd.support2 = ccd_support;
  ccd.center1 = ccd.center2 = ccd_centre;
  ccd.max_iterations = PORTALS_MAX;
  ccd.mpr_tolerance = 1e-3;
  ccd_real_t depth;
  ccd_vec3_t direction, position;
  if (ccdMPRPenetration(&ga, &gb, &ccd, &depth, &direction, &position) || calls > SUPPORTS_MAX) return 0;
  double length = norm3(direction.v);
  if (!(length > 1e-10) || !isfinite(length)) return 0;
  scale3(n, 1 / length, direction.v);
  return 1;
}
#endif

int cav_separation_solve(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_separation *out) {
  int swap = !cav_shape_is_curved(a) && cav_shape_is_curved(b);
  search g = {.a = swap ? b : a, .b = swap ? a : b, .size = fmax(cav_shape_size(a), cav_shape_size(b))};
  cav_core ca = cav_core_of(g.a), cb = cav_core_of(g.b);
  g.core = &cb;
  g.meets = MEETS;
  g.above = INFINITY;
  double most = margin + ca.radius + cb.radius;
  if (!cav_shape_is_curved(g.a) && !hint) return cav_separation_find(&ca, &cb, g.size, most, out);
  // of many corners those near a rough direction are too many to try: first the exact one, then the few about it
  int many = cav_shape_corners(g.b) > NEAR_MAX, proven = 0, again = hint && !swap;
  if (again) {
    int found = cav_separation_again(&ca, &cb, g.size, most, hint, out);
    if (!found || hint->na || !cav_shape_is_curved(g.a)) return found;
  }
#ifdef CAVORT_HAVE_CCD
  double n[3];
  proven = !many && ask_libccd(&ca, &cb, g.size, most, n) && polish(&g, n, 0);
#endif
  if (!proven) {
    if (!again && !cav_separation_find(&ca, &cb, g.size, most, out)) return 0;
    if (many && out->gap > 0) {
      g.meets = FEW;
      g.above = out->gap;
      proven = polish(&g, out->n, 0);
      g.meets = MEETS;
    }
  }
  if (!proven) {
    polish(&g, out->n, -INFINITY);
    if (g.best.separation.gap < 0 && g.best.separation.gap > out->gap + LOOSE * g.size) polish_elsewhere(&g);
    // what the search found stays where the polish does not improve on it
    if (g.best.separation.gap < out->gap - 1e-9 * g.size) {
      g.best.separation = *out;
      g.best.separation.corners = 0;
    }
  }
  *out = g.best.separation;
  if (swap) {
    out->corners = 0;
    scale3(out->n, -1, out->n);
    copy3(out->x, g.best.separation.y);
    copy3(out->y, g.best.separation.x);
  }
  return out->gap < most;
}
