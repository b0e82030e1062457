/// Contacts of convex polyhedra: a mesh, or a prism of a height field, with sphere, capsule, ellipsoid, cylinder, box, mesh;
/// and of a capsule whose segment is inside an ellipsoid, cylinder or box.
///
/// gjk.c gives the direction in which the two bodies are furthest apart or least inside each other: to rounding for
/// polyhedra; with an ellipsoid or a cylinder to about 1e-5, then made exact by the feature of the polyhedron that meets it:
/// a corner (nearest way out in closed form, or the one about the direction by Newton), an edge (derivative of the gap about it, by
/// bisection), a face, or the curved body's own cap or straight line. Every one of these is a lower bound of the gap, so the
/// largest wins; of equal ones that whose points lie across from each other.
/// Where the direction is the normal of a face, the points of the other body over that face touch too, each with its own
/// height: the opposite face cut to the prism above it, both ends of a segment, four points of a rim. At most 8: the
/// deepest, then those furthest from the ones taken. Else one point, at the middle of what meets.
/// Round edges (spheres, capsules) are the core grown by a radius, margins likewise: no case of their own.
/// Not done: choosing between two ways out of an overlap by history; equal ones may jump.
#include "gjk.h"
#include "math3.h"
#include "pairs.h"

enum { CORNERS_MAX = 64, NEAR_MAX = 12 };
// cosine beyond which the direction is a face's normal (1.4e-5 rad); fraction of the size within which corners meet
static const double ON_NORMAL = 1 - 1e-10, MEETS = 1e-2;
// cosine below which a direction is square to an axis; fraction of the size within which gaps are equal
static const double SQUARE = 1e-9, LEAST_GAIN = 1e-13;

/// Corners of a face, an edge or a rim in the world, in order.
typedef struct outline {
  int n;
  double x[CORNERS_MAX][3];
} outline;

typedef struct contact_pair {
  const cav_shape *a, *b;
  cav_core core_a, core_b;
  double size, margin;
  cav_separation separation;
} contact_pair;

static double size_of(const cav_shape *s) {
  if (s->type == CAV_GEOM_SPHERE) return s->size[0];
  if (s->type == CAV_GEOM_CAPSULE || s->type == CAV_GEOM_CYLINDER) return s->size[0] + s->size[1];
  return s->size[0] + s->size[1] + s->size[2];
}

// --- curved bodies against a corner, an edge or a face ---

static cav_surface *surface_of(const cav_shape *s) {
  return s->type == CAV_GEOM_CYLINDER ? cav_surface_cylinder : cav_surface_ellipsoid;
}

// signed distance of a world point to a curved body and its outward normal in the world
static double height_over(const cav_shape *s, const double y[3], double n[3]) {
  double d[3], local[3], normal[3];
  sub3(d, y, s->pos);
  rotate_back(local, s->rotation, d);
  double height = surface_of(s)(s->size, local, normal);
  rotate(n, s->rotation, normal);
  return height;
}

// point nearest to y of all those of the curved body furthest along n: one, a straight line of a side, or a cap
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

// point of a corner, an edge or a face square to n that is nearest to x as seen along n
static void nearest_on_outline(const outline *o, const double n[3], const double x[3], double y[3]) {
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
  if (o->n > 2 && turn[0] + turn[1] < 2) copy3(y, flat);
}

/// A direction, points of both bodies that meet along it, and by how far they miss each other across it: 0 if it is solved.
typedef struct candidate {
  cav_separation separation;
  double miss;
} candidate;

// tries a direction along which b is furthest at a corner, an edge or a face; y: a point of that to start from. The largest
// gap wins; among equal ones the points say which is solved, as near its top a gap does not depend on the direction
static void keep(const contact_pair *g, const double n[3], const outline *o, const double start[3], candidate *best) {
  enum { STEPS_MAX = 20 };
  candidate c;
  double back[3], x[3], y[3], far[3], d[3];
  scale3(back, -1, n);
  cav_shape_support(g->a, n, x);
  cav_shape_support(g->b, back, far);
  sub3(d, far, x);
  c.separation.gap = dot3(d, n);
  if (c.separation.gap < best->separation.gap - LEAST_GAIN * g->size) return;
  copy3(y, start);
  for (int k = 0; k < STEPS_MAX; k++) {
    double last[3];
    copy3(last, y);
    nearest_on_curved(g->a, n, y, x);
    nearest_on_outline(o, n, x, y);
    sub3(last, last, y);
    if (dot3(last, last) == 0) break;
  }
  sub3(d, y, x);
  axpy3(d, d, -c.separation.gap, n);
  c.miss = norm3(d);
  if (c.separation.gap < best->separation.gap + LEAST_GAIN * g->size && c.miss >= best->miss) return;
  copy3(c.separation.n, n);
  copy3(c.separation.x, x);
  copy3(c.separation.y, y);
  *best = c;
}

// direction near a given one in which a point leaves an ellipsoid, though another way out may be nearer: Newton on the gap
// over the sphere of directions, in the ellipsoid's axes; 0 if it does not end
static int leave_ellipsoid(const cav_shape *s, const double y[3], const double start[3], double n[3]) {
  enum { STEPS_MAX = 20 };
  double d[3], p[3], m[3];
  sub3(d, y, s->pos);
  rotate_back(p, s->rotation, d);
  rotate_back(m, s->rotation, start);
  for (int k = 0; k < STEPS_MAX; k++) {
    double x[3], square[3], t[2][3], r[2], H[2][2], reach = 0;
    for (int i = 0; i < 3; i++) square[i] = s->size[i] * s->size[i], reach += square[i] * m[i] * m[i];
    reach = sqrt(reach);
    for (int i = 0; i < 3; i++) x[i] = square[i] * m[i] / reach;
    sub3(d, p, x);
    double gap = dot3(m, p) - reach;
    // two axes square to m; gradient and second derivatives of the gap along them
    int least = fabs(m[0]) < fabs(m[1]) ? 0 : 1;
    if (fabs(m[2]) < fabs(m[least])) least = 2;
    const double e[3] = {least == 0, least == 1, least == 2};
    cross3(t[0], m, e);
    normalise3(t[0]);
    cross3(t[1], m, t[0]);
    for (int i = 0; i < 2; i++) {
      r[i] = dot3(d, t[i]);
      for (int j = 0; j < 2; j++) {
        double stretch = 0;
        for (int c = 0; c < 3; c++) stretch += t[i][c] * square[c] * t[j][c];
        H[i][j] = (dot3(x, t[i]) * dot3(x, t[j]) - stretch) / reach - (i == j ? gap : 0);
      }
    }
    double det = H[0][0] * H[1][1] - H[0][1] * H[0][1];
    if (!(H[0][0] < 0) || !(det > 0)) return 0;
    double a = (H[0][1] * r[1] - H[1][1] * r[0]) / det, b = (H[0][1] * r[0] - H[0][0] * r[1]) / det;
    axpy3(m, m, a, t[0]);
    axpy3(m, m, b, t[1]);
    normalise3(m);
    if (!(a * a + b * b < 1)) return 0;
    if (a * a + b * b < 1e-30) break;
  }
  rotate(n, s->rotation, m);
  return 1;
}

// the ways out of the curved body at a corner: the nearest, and the one about the direction known, through the side of a
// cylinder even where its cap is nearer
static void try_corner(const contact_pair *g, const outline *corner, candidate *best) {
  double n[3], axis[3];
  height_over(g->a, corner->x[0], n);
  keep(g, n, corner, corner->x[0], best);
  if (g->a->type == CAV_GEOM_CYLINDER) {
    column3(axis, g->a->rotation, 2);
    sub3(n, corner->x[0], g->a->pos);
    axpy3(n, n, -dot3(n, axis), axis);
    if (normalise3(n) > 0) keep(g, n, corner, corner->x[0], best);
  } else if (leave_ellipsoid(g->a, corner->x[0], g->separation.n, n)) {
    keep(g, n, corner, corner->x[0], best);
  }
}

// derivative of the gap along directions square to an edge, at an angle from u towards w
static double derivative_at(const contact_pair *g, const double p[3], const double u[3], const double w[3],
                            double angle, double n[3]) {
  double across[3], x[3], d[3];
  scale3(n, cos(angle), u);
  axpy3(n, n, sin(angle), w);
  scale3(across, -sin(angle), u);
  axpy3(across, across, cos(angle), w);
  cav_shape_support(g->a, n, x);
  sub3(d, p, x);
  return dot3(d, across);
}

// directions square to an edge: from the one known uphill to where the derivative of the gap changes sign, then by bisection
static void try_edge(const contact_pair *g, const outline *edge, candidate *best) {
  enum { STEPS_MAX = 60 };
  static const double FIRST = 1e-4, FURTHEST = 0.4;
  double e[3], u[3], w[3], n[3];
  sub3(e, edge->x[1], edge->x[0]);
  normalise3(e);
  axpy3(u, g->separation.n, -dot3(g->separation.n, e), e);
  if (normalise3(u) < 0.5) return;
  cross3(w, e, u);
  if (derivative_at(g, edge->x[0], u, w, 0, n) < 0) scale3(w, -1, w);
  double low = 0, high = FIRST;
  while (high < FURTHEST && derivative_at(g, edge->x[0], u, w, high, n) > 0) low = high, high *= 4;
  for (int k = 0; k < STEPS_MAX; k++) {
    double angle = (low + high) / 2;
    if (derivative_at(g, edge->x[0], u, w, angle, n) > 0)
      low = angle;
    else
      high = angle;
  }
  keep(g, n, edge, edge->x[0], best);
}

// a straight line of a cylinder across an edge: their common normal
static void try_crossing(const contact_pair *g, const outline *edge, candidate *best) {
  double axis[3], e[3], c[3], d[3], x[3], y[3];
  if (g->a->type != CAV_GEOM_CYLINDER) return;
  column3(axis, g->a->rotation, 2);
  sub3(e, edge->x[1], edge->x[0]);
  cross3(c, axis, e);
  double sine2 = dot3(c, c);
  if (!(sine2 > 1e-16 * dot3(e, e))) return;
  // parameter along the edge of its point nearest to the axis
  sub3(d, edge->x[0], g->a->pos);
  cross3(x, d, axis);
  axpy3(y, edge->x[0], dot3(x, c) / sine2, e);
  normalise3(c);
  if (dot3(c, g->separation.n) < 0) scale3(c, -1, c);
  keep(g, c, edge, y, best);
}

// the cap of a cylinder on the side of the direction, on a corner, an edge or a face
static void try_cap(const contact_pair *g, const outline *o, candidate *best) {
  double n[3], y[3];
  if (g->a->type != CAV_GEOM_CYLINDER) return;
  column3(n, g->a->rotation, 2);
  if (dot3(n, g->separation.n) < 0) scale3(n, -1, n);
  // from what is nearest to the axis, which is over the cap if anything is
  nearest_on_outline(o, n, g->a->pos, y);
  keep(g, n, o, y, best);
}

static void corner_at(const cav_shape *s, int v, double x[3]) {
  transform(x, s->pos, s->rotation, s->mesh->vertex + 3 * v);
}

// corners of b that meet the other body along n, to a fraction of the size: the lowest ones; their number
static int near_corners(const contact_pair *g, int near[NEAR_MAX]) {
  const cav_mesh *m = g->b->mesh;
  double n[3], height[NEAR_MAX], lowest = INFINITY;
  int count = 0;
  rotate_back(n, g->b->rotation, g->separation.n);
  for (int v = 0; v < m->nvertex; v++) lowest = fmin(lowest, dot3(n, m->vertex + 3 * v));
  for (int v = 0; v < m->nvertex; v++) {
    double h = dot3(n, m->vertex + 3 * v);
    if (!(h < lowest + MEETS * g->size) || (count == NEAR_MAX && h >= height[NEAR_MAX - 1])) continue;
    // sorted by height; the highest falls off the end
    int k = count < NEAR_MAX ? count++ : NEAR_MAX - 1;
    for (; k > 0 && height[k - 1] > h; k--) {
      height[k] = height[k - 1];
      near[k] = near[k - 1];
    }
    height[k] = h;
    near[k] = v;
  }
  return count;
}

static int are_neighbours(const cav_mesh *m, int v, int w) {
  for (int k = m->neighbour_start[v]; k < m->neighbour_start[v + 1]; k++) {
    if (m->neighbour[k] == w) return 1;
  }
  return 0;
}

static void push_corner(outline *o, const double x[3]) {
  if (o->n < CORNERS_MAX) copy3(o->x[o->n++], x);
}

// corners of a face of a mesh; of very many every second, third, ...
static void push_face(const cav_shape *s, int face, outline *o) {
  const cav_mesh *m = s->mesh;
  int first = m->face[face], corners = m->face[face + 1] - first, step = (corners + CORNERS_MAX - 1) / CORNERS_MAX;
  for (int k = 0; k < corners; k += step) {
    double x[3];
    corner_at(s, m->corner[first + k], x);
    push_corner(o, x);
  }
}

// the best of all features about the direction
static candidate best_feature(const contact_pair *g) {
  const cav_mesh *m = g->b->mesh;
  int near[NEAR_MAX], count = near_corners(g, near);
  candidate best = {.separation = {.gap = -INFINITY}, .miss = INFINITY};
  double n[3];
  for (int i = 0; i < count; i++) {
    outline corner = {.n = 1}, edge = {.n = 2};
    corner_at(g->b, near[i], corner.x[0]);
    try_corner(g, &corner, &best);
    try_cap(g, &corner, &best);
    copy3(edge.x[0], corner.x[0]);
    for (int j = 0; j < i; j++) {
      if (!are_neighbours(m, near[i], near[j])) continue;
      corner_at(g->b, near[j], edge.x[1]);
      try_edge(g, &edge, &best);
      try_crossing(g, &edge, &best);
      try_cap(g, &edge, &best);
    }
  }
  for (int f = 0; f < m->nface; f++) {
    outline face = {.n = 0};
    rotate(n, g->b->rotation, m->plane + 4 * f);
    scale3(n, -1, n);
    if (dot3(n, g->separation.n) < 1 - MEETS) continue;
    push_face(g->b, f, &face);
    keep(g, n, &face, face.x[0], &best);
    try_cap(g, &face, &best);
  }
  return best;
}

static void polish(contact_pair *g) {
  enum { ROUNDS_MAX = 4 };
  for (int round = 0; round < ROUNDS_MAX; round++) {
    candidate best = best_feature(g);
    double turned = dot3(best.separation.n, g->separation.n), gain = best.separation.gap - g->separation.gap;
    // equal to rounding: the feature's is exact
    if (!(gain > -1e-9 * g->size)) return;
    g->separation = best.separation;
    if (turned > ON_NORMAL) return;
  }
}

// --- faces ---

// of the faces of a mesh at its furthest corner along a direction the one that looks most along it; the corner alone if
// there is none
static void lowest_face(const cav_shape *s, const double n[3], outline *o) {
  const cav_mesh *m = s->mesh;
  double local[3], top = -INFINITY, most = -1;
  int face = -1, best = 0;
  rotate_back(local, s->rotation, n);
  for (int v = 0; v < m->nvertex; v++) {
    double h = dot3(local, m->vertex + 3 * v);
    if (h > top) top = h, best = v;
  }
  for (int f = 0; f < m->nface; f++) {
    double c = dot3(m->plane + 4 * f, local);
    if (c <= most) continue;
    for (int k = m->face[f]; k < m->face[f + 1]; k++) {
      if (m->corner[k] == best) most = c, face = f;
    }
  }
  o->n = 0;
  if (face >= 0) {
    push_face(s, face, o);
    return;
  }
  corner_at(s, best, o->x[0]);
  o->n = 1;
}

// the face of a body that looks most along n: outline, normal out of it; returns the cosine, -1 where there is none.
// A cylinder's cap has a normal but no outline
static double face_along(const cav_shape *s, const double n[3], outline *o, double normal[3]) {
  double most = -1, c;
  o->n = 0;
  if (s->type == CAV_GEOM_BOX) {
    int face = 0;
    for (int k = 0; k < 6; k++) {
      double axis[3];
      column3(axis, s->rotation, k / 2);
      c = (k & 1 ? -1 : 1) * dot3(axis, n);
      if (c > most) most = c, face = k;
    }
    int k0 = face / 2, k1 = (k0 + 1) % 3, k2 = (k0 + 2) % 3;
    double sign = face & 1 ? -1 : 1, axis[3];
    column3(axis, s->rotation, k0);
    scale3(normal, sign, axis);
    for (int i = 0; i < 4; i++) {
      double local[3], x[3];
      local[k0] = sign * s->size[k0];
      local[k1] = sign * (i == 0 || i == 3 ? -1 : 1) * s->size[k1];
      local[k2] = (i < 2 ? -1 : 1) * s->size[k2];
      transform(x, s->pos, s->rotation, local);
      push_corner(o, x);
    }
  } else if (s->type == CAV_GEOM_MESH) {
    const cav_mesh *m = s->mesh;
    int face = -1;
    double local[3];
    rotate_back(local, s->rotation, n);
    for (int f = 0; f < m->nface; f++) {
      c = dot3(m->plane + 4 * f, local);
      if (c > most) most = c, face = f;
    }
    if (face < 0) return -1;
    rotate(normal, s->rotation, m->plane + 4 * face);
    push_face(s, face, o);
  } else if (s->type == CAV_GEOM_CYLINDER) {
    column3(normal, s->rotation, 2);
    most = fabs(dot3(normal, n));
    if (dot3(normal, n) < 0) scale3(normal, -1, normal);
  }
  return most;
}

// what of a body could lie on a face whose normal is m: a face, a segment, four points of a rim, or nothing
static void lying_on(const cav_shape *s, const double m[3], outline *o) {
  double back[3], normal[3], u[3], x[3];
  scale3(back, -1, m);
  o->n = 0;
  if (s->type == CAV_GEOM_MESH) {
    lowest_face(s, back, o);
    return;
  }
  if (s->type == CAV_GEOM_BOX) {
    face_along(s, back, o, normal);
    return;
  }
  if (s->type != CAV_GEOM_CAPSULE && s->type != CAV_GEOM_CYLINDER) return;
  column3(u, s->rotation, 2);
  double along = dot3(u, back), radius = s->size[0], half = s->size[1], out[3];
  // the direction across the axis that is lowest
  axpy3(out, back, -along, u);
  double derivative = normalise3(out);
  if (derivative < 1e-9) column3(out, s->rotation, 0);
  if (s->type == CAV_GEOM_CYLINDER && fabs(along) > 0.9) {
    double w[3], cap[3];
    cross3(w, u, out);
    axpy3(cap, s->pos, along < 0 ? -half : half, u);
    for (int k = 0; k < 4; k++) {
      axpy3(x, cap, k & 1 ? 0 : (k ? -radius : radius), out);
      axpy3(x, x, k & 1 ? (k > 1 ? -radius : radius) : 0, w);
      push_corner(o, x);
    }
    return;
  }
  for (int end = 0; end < 2; end++) {
    axpy3(x, s->pos, end ? half : -half, u);
    // a capsule's round edge is lowest straight below its core, a cylinder's on its side
    if (s->type == CAV_GEOM_CAPSULE)
      axpy3(x, x, radius, back);
    else
      axpy3(x, x, radius, out);
    push_corner(o, x);
  }
}

// cuts away where direction . x > bound
static void cut(outline *o, const double direction[3], double bound) {
  outline kept = {.n = 0};
  int closed = o->n > 2;
  for (int k = 0; k < o->n; k++) {
    const double *x = o->x[k], *y = o->x[(k + 1) % o->n];
    double hx = dot3(direction, x) - bound, hy = dot3(direction, y) - bound;
    if (hx <= 0) push_corner(&kept, x);
    if ((hx <= 0) == (hy <= 0) || (!closed && k == o->n - 1)) continue;
    double d[3], p[3];
    sub3(d, y, x);
    axpy3(p, x, hx / (hx - hy), d);
    push_corner(&kept, p);
  }
  *o = kept;
}

// cuts to the prism over a face, or to the disk of a cylinder's cap by dropping what is outside
static void cut_to_face(outline *o, const outline *face, const double normal[3], const cav_shape *ground) {
  for (int k = 0; k < face->n && o->n; k++) {
    double e[3], out[3];
    sub3(e, face->x[(k + 1) % face->n], face->x[k]);
    cross3(out, e, normal);
    double length = normalise3(out);
    if (length > 0) cut(o, out, dot3(out, face->x[k]) + 1e-12 * length);
  }
  if (face->n) return;
  int kept = 0;
  for (int k = 0; k < o->n; k++) {
    double d[3];
    sub3(d, o->x[k], ground->pos);
    double along = dot3(d, normal), radius2 = dot3(d, d) - along * along;
    if (radius2 <= ground->size[0] * ground->size[0]) copy3(o->x[kept++], o->x[k]);
  }
  o->n = kept;
}

// the deepest; of several as deep the one furthest from the middle of all, thus a corner
static int first_kept(const cav_touch *touch, int n) {
  double middle[3] = {0, 0, 0}, d[3], spread = 0, deepest = INFINITY, far = -1;
  int best = 0;
  for (int i = 0; i < n; i++) {
    axpy3(middle, middle, 1.0 / n, touch[i].pos);
    deepest = fmin(deepest, touch[i].dist);
  }
  for (int pass = 0; pass < 2; pass++) {
    for (int i = 0; i < n; i++) {
      sub3(d, touch[i].pos, middle);
      double length = norm3(d);
      if (pass == 0) spread = fmax(spread, length);
      if (pass == 1 && touch[i].dist <= deepest + 1e-6 * spread && length > far) far = length, best = i;
    }
  }
  return best;
}

// how much a contact adds to those taken: distance from the first; from the line of two; from that line on the side where
// the third is not; then from the nearest
static double worth(const cav_touch *touch, int taken, const cav_touch *t) {
  double e[3], d[3], third[3], least = INFINITY;
  sub3(e, touch[taken > 1].pos, touch[0].pos);
  sub3(d, t->pos, touch[0].pos);
  if (taken == 2 || taken == 3) {
    double e2 = dot3(e, e);
    if (e2 > 0) axpy3(d, d, -dot3(d, e) / e2, e);
    if (taken == 2) return norm3(d);
    sub3(third, touch[2].pos, touch[0].pos);
    return -dot3(d, third);
  }
  for (int j = 0; j < taken; j++) {
    sub3(d, t->pos, touch[j].pos);
    least = fmin(least, dot3(d, d));
  }
  return least;
}

int cav_thin_out(cav_touch *touch, int n, int most) {
  if (n <= most) return n;
  for (int taken = 0; taken < most; taken++) {
    int best = taken ? taken : first_kept(touch, n);
    double far = -INFINITY;
    for (int i = taken; i < n && taken; i++) {
      double score = worth(touch, taken, &touch[i]);
      if (score > far) far = score, best = i;
    }
    cav_touch swap = touch[taken];
    touch[taken] = touch[best];
    touch[best] = swap;
  }
  return most;
}

// points over a face that the direction stands square on; 0 if none
static int touch_face(const contact_pair *g, cav_touch *touch) {
  outline face_a, face_b, lying;
  double normal_a[3], normal_b[3], back[3];
  scale3(back, -1, g->separation.n);
  double ca = face_along(g->a, g->separation.n, &face_a, normal_a), cb = face_along(g->b, back, &face_b, normal_b);
  int on_b = cb >= ca - 1e-9;
  if (fmax(ca, cb) < ON_NORMAL) return 0;
  const cav_shape *ground = on_b ? g->b : g->a, *other = on_b ? g->a : g->b;
  const double *m = on_b ? normal_b : normal_a;
  const outline *face = on_b ? &face_b : &face_a;
  double x[3];
  cav_shape_support(ground, m, x);
  double top = dot3(m, x);
  lying_on(other, m, &lying);
  cut_to_face(&lying, face, m, ground);
  cav_touch found[CORNERS_MAX];
  int count = 0;
  for (int k = 0; k < lying.n; k++) {
    double height = dot3(m, lying.x[k]) - top;
    if (!(height < g->margin)) continue;
    cav_touch *t = &found[count++];
    axpy3(t->pos, lying.x[k], -height / 2, m);
    scale3(t->normal, on_b ? -1 : 1, m);
    zero3(t->tangent);
    t->dist = height;
    t->feature = 1 + k;
  }
  count = cav_thin_out(found, count, CAV_TOUCH_MAX);
  for (int k = 0; k < count; k++) touch[k] = found[k];
  return count;
}

static int touch_single(const contact_pair *g, double dist, cav_touch *touch) {
  double x[3], y[3];
  axpy3(x, g->separation.x, g->core_a.radius, g->separation.n);
  axpy3(y, g->separation.y, -g->core_b.radius, g->separation.n);
  add3(touch->pos, x, y);
  scale3(touch->pos, 0.5, touch->pos);
  copy3(touch->normal, g->separation.n);
  zero3(touch->tangent);
  touch->dist = dist;
  touch->feature = 0;
  return 1;
}

static int is_curved(const cav_shape *s) { return s->type == CAV_GEOM_ELLIPSOID || s->type == CAV_GEOM_CYLINDER; }

// the same for the segment of a capsule a inside a curved body b: as a polyhedron of one edge
static void polish_segment(contact_pair *g) {
  static const int start[3] = {0, 1, 2}, neighbour[2] = {1, 0}, none[1] = {0};
  const double vertex[6] = {0, 0, -g->a->size[1], 0, 0, g->a->size[1]};
  const cav_mesh edge = {
      .name = "", .nvertex = 2, .vertex = vertex, .face = none, .neighbour_start = start, .neighbour = neighbour};
  cav_shape segment = *g->a;
  segment.type = CAV_GEOM_MESH;
  segment.mesh = &edge;
  contact_pair h = {.a = g->b, .b = &segment, .size = g->size, .margin = g->margin};
  h.separation = (cav_separation){.gap = g->separation.gap};
  scale3(h.separation.n, -1, g->separation.n);
  copy3(h.separation.x, g->separation.y);
  copy3(h.separation.y, g->separation.x);
  polish(&h);
  g->separation.gap = h.separation.gap;
  scale3(g->separation.n, -1, h.separation.n);
  copy3(g->separation.x, h.separation.y);
  copy3(g->separation.y, h.separation.x);
}

static int meet(contact_pair *g, cav_touch *touch) {
  if (is_curved(g->a)) polish(g);
  if (g->a->type == CAV_GEOM_CAPSULE && is_curved(g->b)) polish_segment(g);
  double dist = g->separation.gap - g->core_a.radius - g->core_b.radius;
  if (!(dist < g->margin)) return 0;
  int count = touch_face(g, touch);
  double lowest = INFINITY;
  for (int k = 0; k < count; k++) lowest = fmin(lowest, touch[k].dist);
  // a face whose points all stand higher than what was found is not what meets: a rim, a derivative
  if (count && lowest < dist + 1e-6 * g->size) return count;
  cav_touch last;
  touch_single(g, dist, &last);
  if (count == CAV_TOUCH_MAX) count--;
  touch[count] = last;
  return count + 1;
}

int cav_points_over(const cav_shape *s, double corner[3][3], const double normal[3], double point[][3]) {
  outline face = {.n = 3}, lying;
  double back[3];
  for (int k = 0; k < 3; k++) copy3(face.x[k], corner[k]);
  lying_on(s, normal, &lying);
  if (!lying.n) {
    // a sphere or an ellipsoid: its lowest point
    scale3(back, -1, normal);
    cav_shape_support(s, back, lying.x[0]);
    lying.n = 1;
  }
  cut_to_face(&lying, &face, normal, NULL);
  int count = lying.n < CAV_LYING_MAX ? lying.n : CAV_LYING_MAX;
  for (int k = 0; k < count; k++) copy3(point[k], lying.x[k]);
  return count;
}

int cav_collide_polytope(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  contact_pair g = {.a = a, .b = b, .core_a = cav_core_of(a), .core_b = cav_core_of(b), .margin = margin};
  g.size = fmax(size_of(a), size_of(b));
  double most = margin + g.core_a.radius + g.core_b.radius;
  if (!cav_separation_find(&g.core_a, &g.core_b, g.size, most, &g.separation)) return 0;
  return meet(&g, touch);
}

int cav_collide_plane_mesh(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  enum { FOUND_MAX = 128 };
  const cav_mesh *m = b->mesh;
  cav_touch found[FOUND_MAX];
  double n[3], local[3], d[3];
  int count = 0;
  column3(n, a->rotation, 2);
  rotate_back(local, b->rotation, n);
  sub3(d, b->pos, a->pos);
  double base = dot3(d, n);
  for (int v = 0; v < m->nvertex; v++) {
    double height = base + dot3(local, m->vertex + 3 * v), x[3];
    if (!(height < margin)) continue;
    cav_touch t = {.dist = height, .feature = v};
    corner_at(b, v, x);
    axpy3(t.pos, x, -height / 2, n);
    copy3(t.normal, n);
    if (count == FOUND_MAX) count = cav_thin_out(found, count, FOUND_MAX / 2);
    found[count++] = t;
  }
  count = cav_thin_out(found, count, CAV_TOUCH_MAX);
  for (int k = 0; k < count; k++) touch[k] = found[k];
  return count;
}
