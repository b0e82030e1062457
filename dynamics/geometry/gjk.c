/// Distance of convex bodies by their support points (Gilbert, Johnson and Keerthi 1988), overlap by an expanding
/// polytope (van den Bergen 2001).
///
/// Both look at W, the differences y - x of points of b and a. GJK walks the point of W nearest to the origin by
/// simplices of support points. If the origin is inside, a polytope of support points grows from inside W until its
/// face nearest to the origin is a face of W. For polyhedra both end at a feature, to rounding; for curved bodies to
/// 1e-9 of the size in distance, and their callers polish. All loops are bounded; bodies that touch so closely that
/// neither has a direction, or whose W is flat, get the best of a few directions: any direction gives a lower bound of
/// the gap.
#include "gjk.h"

#include "math3.h"
#include "pairs.h"

enum { STEPS_MAX = 100, VERTEX_MAX = 160, SHEET_MAX = 2 * VERTEX_MAX };
static const double CLOSE = 1e-14, CURVED_CLOSE = 1e-9, INSIDE = 1e-9, SEES = 1e-13, SLACK = 1e-9, ROUGH = 1e-5;

/// A point of W and what it is made of.
typedef struct vertex {
  double w[3], x[3], y[3];
  int a, b; ///< corners, of curved bodies 0
} vertex;

/// Up to four points and the weights of the point nearest to the origin.
typedef struct simplex {
  vertex p[4];
  double weight[4];
  int n;
} simplex;

typedef struct bodies {
  const cav_core *a, *b;
  double size, close;
  double slack; ///< how much further apart than asked for a direction must show the bodies to end a search
} bodies;

cav_core cav_core_of(const cav_shape *shape) {
  int round = shape->type == CAV_GEOM_SPHERE || shape->type == CAV_GEOM_CAPSULE;
  return (cav_core){shape, round ? shape->size[0] : 0};
}

// the same and its corner, of curved bodies 0; a corner near it is where a mesh is climbed from, -1: not known
static int support_corner(const cav_core *core, const double direction[3], int near, double point[3]) {
  const cav_shape *s = core->shape;
  double local[3];
  int corner = 0;
  switch (s->type) {
    case CAV_GEOM_MESH:
      rotate_back(local, s->rotation, direction);
      corner = cav_mesh_summit_from(s->mesh, local, near);
      transform(point, s->pos, s->rotation, s->mesh->vertex + 3 * corner);
      return corner;
    case CAV_GEOM_CAPSULE:
      column3(local, s->rotation, 2);
      corner = !(dot3(local, direction) < 0);
      axpy3(point, s->pos, corner ? s->size[1] : -s->size[1], local);
      return corner;
    case CAV_GEOM_SPHERE:
      copy3(point, s->pos);
      return 0;
    case CAV_GEOM_BOX:
      rotate_back(local, s->rotation, direction);
      for (int k = 0; k < 3; k++) {
        corner |= !(local[k] < 0) << k;
        local[k] = local[k] < 0 ? -s->size[k] : s->size[k];
      }
      transform(point, s->pos, s->rotation, local);
      return corner;
    default:
      cav_shape_support(s, direction, point);
      return 0;
  }
}

void cav_core_support(const cav_core *core, const double direction[3], double point[3]) {
  support_corner(core, direction, -1, point);
}

// point of W furthest along a direction, near another
static vertex support_near(const bodies *g, const double d[3], int near_a, int near_b) {
  vertex p;
  double back[3];
  scale3(back, -1, d);
  p.b = support_corner(g->b, d, near_b, p.y);
  p.a = support_corner(g->a, back, near_a, p.x);
  sub3(p.w, p.y, p.x);
  return p;
}

static vertex support(const bodies *g, const double d[3]) { return support_near(g, d, -1, -1); }

// --- nearest point of a simplex ---

/// A simplex about its last point: products of the edges to the others, and of these with the way to the origin.
typedef struct products {
  double G[3][3], r[3];
} products;

// weights of the point nearest to the origin of the affine hull of the last point and m others; 0 if one is not positive
// or they are dependent
static inline int weights_of(const products *all, const int *other, const int m, double weight[4]) {
  double G[3][3], r[3];
  for (int i = 0; i < m; i++) {
    r[i] = all->r[other[i]];
    for (int j = 0; j < m; j++) G[i][j] = all->G[other[i]][other[j]];
  }
  // elimination without pivots: G is positive definite, or the points are dependent
  for (int i = 0; i < m; i++) {
    if (!(G[i][i] > 1e-28 * all->G[other[i]][other[i]]) || !(G[i][i] > 0)) return 0;
    for (int k = i + 1; k < m; k++) {
      double f = G[k][i] / G[i][i];
      for (int j = i; j < m; j++) G[k][j] -= f * G[i][j];
      r[k] -= f * r[i];
    }
  }
  weight[m] = 1;
  for (int i = m - 1; i >= 0; i--) {
    for (int j = i + 1; j < m; j++) r[i] -= G[i][j] * r[j];
    r[i] /= G[i][i];
    weight[i] = r[i];
    weight[m] -= r[i];
    if (!(r[i] > 0)) return 0;
  }
  return weight[m] > 0;
}

// reduces a simplex to the part with its last point that holds the point nearest to the origin, and finds that. Of a
// search that has got nearer by its last point all parts that matter have it
static void reduce(simplex *s, double nearest[3]) {
  const int others = s->n - 1;
  const double *last = s->p[others].w;
  double best = INFINITY, e[3][3];
  products all;
  for (int i = 0; i < others; i++) {
    sub3(e[i], s->p[i].w, last);
    all.r[i] = -dot3(e[i], last);
    for (int j = 0; j <= i; j++) all.G[i][j] = all.G[j][i] = dot3(e[i], e[j]);
  }
  int kept[4], n = 0;
  double keep[4];
  // all of them first: where each has a part nothing is nearer
  for (int k = 0; k < 1 << others && n < s->n; k++) {
    const int set = k ? k - 1 : (1 << others) - 1;
    int other[3], m = 0;
    double weight[4], w[3];
    for (int i = 0; i < others; i++) {
      if (set >> i & 1) other[m++] = i;
    }
    // each number of points by itself, so that its loops are written out
    int ok = m == 3   ? weights_of(&all, other, 3, weight)
             : m == 2 ? weights_of(&all, other, 2, weight)
             : m == 1 ? weights_of(&all, other, 1, weight)
                      : weights_of(&all, other, 0, weight);
    if (!ok) continue;
    copy3(w, last);
    for (int i = 0; i < m; i++) axpy3(w, w, weight[i], e[other[i]]);
    double length2 = m == 3 ? 0 : dot3(w, w);
    if (!(length2 < best)) continue;
    best = length2;
    copy3(nearest, w);
    if (m == 3) zero3(nearest);
    n = m + 1;
    for (int i = 0; i < n; i++) {
      kept[i] = i < m ? other[i] : others;
      keep[i] = weight[i];
    }
  }
  // in the order of the points, so that each moves to an earlier place
  for (int i = 0; i < n; i++) {
    s->p[i] = s->p[kept[i]];
    s->weight[i] = keep[i];
  }
  s->n = n;
}

// the points in use only
static void copy_simplex(simplex *to, const simplex *from) {
  to->n = from->n;
  for (int i = 0; i < from->n; i++) {
    to->p[i] = from->p[i];
    to->weight[i] = from->weight[i];
  }
}

static void points_of(const simplex *s, cav_separation *out) {
  zero3(out->x);
  zero3(out->y);
  for (int i = 0; i < s->n; i++) {
    axpy3(out->x, out->x, s->weight[i], s->p[i].x);
    axpy3(out->y, out->y, s->weight[i], s->p[i].y);
  }
  out->corners = s->n < 4 ? s->n : 0;
  for (int i = 0; i < out->corners; i++) {
    copy3(out->corner_a[i], s->p[i].x);
    copy3(out->corner_b[i], s->p[i].y);
  }
}

// the direction of the point nearest to the origin: of three points the normal of their plane, which is sharper near 0
static void direction_of(const simplex *s, const double v[3], double n[3]) {
  copy3(n, v);
  if (s->n == 3) {
    double u[3], w[3], c[3];
    sub3(u, s->p[1].w, s->p[0].w);
    sub3(w, s->p[2].w, s->p[0].w);
    cross3(c, u, w);
    double area = norm3(c);
    if (area > 1e-9 * norm3(u) * norm3(w)) {
      copy3(n, c);
      if (dot3(c, v) < 0) scale3(n, -1, n);
    }
  }
  normalise3(n);
}

typedef enum outcome { FAR, SEPARATE, OVERLAP } outcome;

// the point of W of two corners
static vertex corners_of(const bodies *g, int a, int b) {
  vertex p = {.a = a, .b = b};
  cav_shape_corner(g->a->shape, a, p.x);
  cav_shape_corner(g->b->shape, b, p.y);
  sub3(p.w, p.y, p.x);
  return p;
}

// where a walk begins: at what met last, or else at what is furthest along a direction
static void begin(const bodies *g, const cav_hint *from, simplex *s, double v[3]) {
  double d[3];
  int corners =
      from && !from->apart && !cav_shape_is_curved(g->a->shape) ? (from->na > from->nb ? from->na : from->nb) : 0;
  s->n = 1;
  s->weight[0] = 1;
  if (corners) {
    s->p[0] = corners_of(g, from->a[0], from->b[0]);
  } else if (from) {
    rotate(d, g->a->shape->rotation, from->direction);
    s->p[0] = support_near(g, d, from->a[0], from->b[0]);
  } else {
    sub3(v, g->b->shape->pos, g->a->shape->pos);
    if (!(dot3(v, v) > 0)) set3(v, 1, 0, 0);
    scale3(d, -1, v);
    s->p[0] = support(g, d);
  }
  copy3(v, s->p[0].w);
  for (int i = 1; i < corners; i++) {
    simplex next = *s;
    double w[3];
    next.p[next.n++] =
        corners_of(g, from->a[i < from->na ? i : from->na - 1], from->b[i < from->nb ? i : from->nb - 1]);
    reduce(&next, w);
    if (!(dot3(w, w) < dot3(v, v))) continue;
    *s = next;
    copy3(v, w);
  }
}

// from where the last search ended, NULL: from the line between the centres. Of bodies that are further apart than most d
// is a direction that shows it
static outcome walk(const bodies *g, double most, const cav_hint *from, simplex *s, double d[3], cav_separation *out) {
  double v[3];
  begin(g, from, s, v);
  for (int step = 0; step < STEPS_MAX; step++) {
    double length = norm3(v);
    if (length < INSIDE * g->size) return OVERLAP;
    scale3(d, -1 / length, v);
    vertex p = support_near(g, d, s->p[s->n - 1].a, s->p[s->n - 1].b);
    // the plane through p square to v bounds the distance from below
    double bound = -dot3(d, p.w);
    if (bound > most + g->slack) return FAR;
    if (length - bound < g->close * g->size) break;
    int known = 0;
    for (int i = 0; i < s->n; i++) known |= !memcmp(s->p[i].w, p.w, sizeof p.w);
    if (known) break;
    simplex next;
    copy_simplex(&next, s);
    double w[3];
    next.p[next.n++] = p;
    reduce(&next, w);
    if (next.n == 4) {
      *s = next;
      return OVERLAP;
    }
    // no progress: as near as rounding lets it
    if (!(norm3(w) < length)) break;
    copy_simplex(s, &next);
    copy3(v, w);
  }
  if (norm3(v) < INSIDE * g->size) return OVERLAP;
  direction_of(s, v, out->n);
  points_of(s, out);
  return SEPARATE;
}

// --- polytope ---

typedef struct sheet {
  int v[3];
  double n[3], d;
} sheet;

typedef struct polytope {
  vertex p[VERTEX_MAX];
  sheet face[SHEET_MAX];
  int np, nface;
} polytope;

// a face, counterclockwise from outside, whose normal is turned away from the middle of the polytope; 0 if it has no
// area
static int add_face(polytope *t, int i, int j, int k, const double middle[3]) {
  double u[3], w[3], m[3];
  if (t->nface == SHEET_MAX) return 0;
  sheet *f = &t->face[t->nface];
  sub3(u, t->p[j].w, t->p[i].w);
  sub3(w, t->p[k].w, t->p[i].w);
  cross3(f->n, u, w);
  double area = norm3(f->n);
  if (!(area > 1e-14 * norm3(u) * norm3(w)) || !(area > 0)) return 0;
  scale3(f->n, 1 / area, f->n);
  f->v[0] = i;
  f->v[1] = j;
  f->v[2] = k;
  sub3(m, t->p[i].w, middle);
  // only rounding of a sliver says otherwise: its corners keep the order of its neighbours
  if (dot3(m, f->n) < 0) scale3(f->n, -1, f->n);
  f->d = dot3(f->n, t->p[i].w);
  t->nface++;
  return 1;
}

// how much a point adds to the extent of the first n: length, area, volume
static double extent(const polytope *t, const vertex *p, int n) {
  double u[3], w[3], e[3], c[3];
  sub3(u, p->w, t->p[0].w);
  if (n == 1) return norm3(u);
  sub3(w, t->p[1].w, t->p[0].w);
  cross3(c, w, u);
  if (n == 2) return norm3(c) / fmax(norm3(w), 1e-300);
  sub3(e, t->p[2].w, t->p[0].w);
  cross3(c, w, e);
  return fabs(dot3(c, u)) / fmax(norm3(c), 1e-300);
}

// four points of W with volume, the ones of GJK first; 0 if W is flat
static int first_points(const bodies *g, const simplex *s, polytope *t) {
  for (t->np = 0; t->np < s->n && t->np < 4; t->np++) {
    t->p[t->np] = s->p[t->np];
    if (t->np && !(extent(t, &s->p[t->np], t->np) > 1e-10 * g->size)) break;
  }
  while (t->np < 4) {
    double most = 1e-10 * g->size;
    vertex best = t->p[0];
    // all directions of a cube's faces, edges and corners
    for (int i = 0; i < 27; i++) {
      double d[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
      if (i == 13) continue;
      normalise3(d);
      vertex p = support(g, d);
      double far = extent(t, &p, t->np);
      if (far > most) most = far, best = p;
    }
    if (!(most > 1e-10 * g->size)) return 0;
    t->p[t->np++] = best;
  }
  return 1;
}

// the face on the other side of an edge; -1 if there is none
static int face_beyond(const polytope *t, const int edge[2]) {
  for (int f = 0; f < t->nface; f++) {
    for (int k = 0; k < 3; k++) {
      if (t->face[f].v[k] == edge[1] && t->face[f].v[(k + 1) % 3] == edge[0]) return f;
    }
  }
  return -1;
}

// replaces the faces that see a new point by a fan from their outline; 0 if that fails. They are taken in from the one
// that sees it best, neighbour by neighbour: where rounding decides what sees, the outline stays one loop
static int include(polytope *t, int nearest, const vertex *p, const double middle[3], double slack) {
  int edge[3 * SHEET_MAX][2], edges = 0, outline = 0;
  if (t->np == VERTEX_MAX) return 0;
  t->p[t->np] = *p;
  // edges up to outline are of faces that stay
  for (int from = nearest; from >= 0;) {
    const sheet seen = t->face[from];
    t->face[from] = t->face[--t->nface];
    for (int k = 0; k < 3; k++) {
      const int a = seen.v[k], b = seen.v[(k + 1) % 3];
      int twin = outline;
      while (twin < edges && !(edge[twin][0] == b && edge[twin][1] == a)) twin++;
      if (twin < edges) {
        edges--;
        edge[twin][0] = edge[edges][0];
        edge[twin][1] = edge[edges][1];
      } else {
        edge[edges][0] = a;
        edge[edges++][1] = b;
      }
    }
    for (from = -1; outline < edges && from < 0;) {
      int f = face_beyond(t, edge[outline]);
      if (f >= 0 && dot3(t->face[f].n, p->w) - t->face[f].d > slack)
        from = f;
      else
        outline++;
    }
  }
  for (int i = 0; i < edges; i++) {
    if (!add_face(t, edge[i][0], edge[i][1], t->np, middle)) return 0;
  }
  t->np++;
  return edges > 0;
}

// the point nearest to the origin of the faces in one plane with a face, as points of both bodies: such faces are
// equal, and the origin lies over one of them
static void points_of_faces(const polytope *t, const sheet *best, double slack, cav_separation *out) {
  double least = INFINITY;
  for (int f = 0; f < t->nface; f++) {
    if (t->face[f].d > best->d + slack || dot3(t->face[f].n, best->n) < 1 - 1e-9) continue;
    // each of its corners last
    for (int turn = 0; turn < 3; turn++) {
      simplex s = {.n = 3};
      double v[3];
      for (int k = 0; k < 3; k++) s.p[k] = t->p[t->face[f].v[(turn + k) % 3]];
      reduce(&s, v);
      if (!(dot3(v, v) < least)) continue;
      least = dot3(v, v);
      points_of(&s, out);
    }
  }
}

static int expand(const bodies *g, const simplex *s, cav_separation *out) {
  polytope t;
  t.nface = 0;
  if (!first_points(g, s, &t)) return 0;
  double middle[3] = {0, 0, 0};
  for (int k = 0; k < 4; k++) axpy3(middle, middle, 0.25, t.p[k].w);
  double u[3], v[3], w[3], c[3];
  sub3(u, t.p[1].w, t.p[0].w);
  sub3(v, t.p[2].w, t.p[0].w);
  sub3(w, t.p[3].w, t.p[0].w);
  cross3(c, u, v);
  if (dot3(c, w) > 0) {
    vertex swap = t.p[1];
    t.p[1] = t.p[2];
    t.p[2] = swap;
  }
  static const int corners[4][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  for (int k = 0; k < 4; k++) {
    if (!add_face(&t, corners[k][0], corners[k][1], corners[k][2], middle)) return 0;
  }
  sheet best = t.face[0];
  for (;;) {
    int nearest = 0;
    for (int f = 1; f < t.nface; f++) {
      if (t.face[f].d < t.face[nearest].d) nearest = f;
    }
    best = t.face[nearest];
    vertex p = support(g, best.n);
    double beyond = dot3(best.n, p.w) - best.d;
    if (beyond < g->close * g->size || t.np == VERTEX_MAX) break;
    // by rounding there may be no further: the faces found so far
    if (!include(&t, nearest, &p, middle, SEES * g->size)) break;
  }
  scale3(out->n, -1, best.n);
  copy3(out->x, t.p[best.v[0]].x);
  copy3(out->y, t.p[best.v[0]].y);
  out->corners = 0;
  points_of_faces(&t, &best, 1e-11 * g->size, out);
  return 1;
}

// true gap of the cores along a direction
static double gap_along(const bodies *g, const double n[3]) {
  double back[3];
  scale3(back, -1, n);
  vertex p = support(g, back);
  return dot3(n, p.w);
}

// normals of the faces of a flat or thin body, for what nothing else solves
static void try_planes(const bodies *g, cav_separation *out) {
  const cav_core *cores[2] = {g->a, g->b};
  out->gap = -INFINITY;
  out->corners = 0;
  for (int side = 0; side < 2; side++) {
    const cav_shape *s = cores[side]->shape;
    int faces = s->type == CAV_GEOM_MESH ? s->mesh->nface : 0;
    for (int f = -1; f < faces; f++) {
      double n[3], back[3];
      if (f < 0)
        sub3(n, g->b->shape->pos, g->a->shape->pos);
      else
        rotate(n, s->rotation, s->mesh->plane + 4 * f);
      if (f >= 0 && side) scale3(n, -1, n);
      normalise3(n);
      double gap = gap_along(g, n);
      if (!(gap > out->gap)) continue;
      out->gap = gap;
      copy3(out->n, n);
      scale3(back, -1, n);
      vertex p = support(g, back);
      copy3(out->x, p.x);
      copy3(out->y, p.y);
    }
  }
}

// what a walk that did not end far apart found, or of an overlap the polytope
static int conclude(const bodies *g, double most, outcome end, const simplex *s, cav_separation *found,
                    cav_separation *out) {
  if (end == OVERLAP && !expand(g, s, found)) try_planes(g, found);
  found->gap = gap_along(g, found->n);
  if (found->gap > most) return 0;
  *out = *found;
  return 1;
}

int cav_separation_find(const cav_core *a, const cav_core *b, double size, double most, cav_separation *out) {
  bodies g = {a, b, size, cav_shape_is_curved(a->shape) || cav_shape_is_curved(b->shape) ? CURVED_CLOSE : CLOSE, 0};
  simplex s;
  cav_separation found;
  double d[3];
  outcome end = walk(&g, most, NULL, &s, d, &found);
  return end != FAR && conclude(&g, most, end, &s, &found, out);
}

// --- from where the last search ended ---

static void add_corner(int corner, int *count, int list[3]) {
  int at = 0;
  while (at < *count && list[at] < corner) at++;
  if (at < *count && list[at] == corner) return;
  for (int i = *count; i > at; i--) list[i] = list[i - 1];
  list[at] = corner;
  ++*count;
}

// the corners of a simplex, in order, and the direction that they meet along
static void note_corners(const bodies *g, const simplex *s, const double n[3], cav_hint *hint) {
  double back[3];
  scale3(back, -1, n);
  rotate_back(hint->direction, g->a->shape->rotation, back);
  hint->na = hint->nb = 0;
  for (int i = 0; i < s->n && s->n <= 3; i++) {
    add_corner(s->p[i].a, &hint->na, hint->a);
    add_corner(s->p[i].b, &hint->nb, hint->b);
  }
}

static void note_direction(const bodies *g, const simplex *s, const double d[3], cav_hint *hint) {
  hint->na = hint->nb = 1;
  hint->a[0] = s->p[0].a;
  hint->b[0] = s->p[0].b;
  hint->apart = 1;
  rotate_back(hint->direction, g->a->shape->rotation, d);
}

// whether the bodies are still further apart along a direction of the hint
static int still_apart(const bodies *g, double most, const cav_hint *hint) {
  double d[3];
  rotate(d, g->a->shape->rotation, hint->direction);
  vertex p = support_near(g, d, hint->a[0], hint->b[0]);
  return -dot3(d, p.w) > (most + g->slack) * norm3(d);
}

// whether a walk ended with an answer that does not depend on where it began: further apart than most, or proven
static int is_settled(const bodies *g, outcome end, const simplex *s, const double d[3], const cav_separation *found,
                      cav_hint *hint, cav_separation *proven) {
  hint->na = hint->apart = 0;
  if (end == FAR) note_direction(g, s, d, hint);
  if (end == SEPARATE) note_corners(g, s, found->n, hint);
  if (end != SEPARATE) return end == FAR;
  if (cav_nearest_prove(g->a, g->b, g->size, hint, proven)) return 1;
  hint->na = 0;
  return 0;
}

int cav_separation_again(const cav_core *a, const cav_core *b, double size, double most, cav_hint *hint,
                         cav_separation *out) {
  const int curved = cav_shape_is_curved(a->shape);
  bodies g = {a, b, size, curved ? ROUGH : CLOSE, SLACK * size};
  simplex s;
  cav_separation found;
  double d[3];
  if (hint->apart && still_apart(&g, most, hint)) return 0;
  if (!hint->apart && cav_nearest_prove(a, b, size, hint, out)) return out->gap <= most;
  if (hint->na || curved) {
    const cav_hint from = *hint;
    outcome end = walk(&g, most, hint->na ? &from : NULL, &s, d, &found);
    if (is_settled(&g, end, &s, d, &found, hint, out)) return end == SEPARATE && out->gap <= most;
  }
  // what that did not settle must not depend on it
  g.close = curved ? CURVED_CLOSE : CLOSE;
  outcome end = walk(&g, most, NULL, &s, d, &found);
  if (is_settled(&g, end, &s, d, &found, hint, out)) return end == SEPARATE && out->gap <= most;
  return conclude(&g, most, end, &s, &found, out);
}
