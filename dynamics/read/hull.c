/// Convex hull of points in space by quickhull (Barber, Dobkin and Huhdanpaa 1996).
///
/// Starts from a tetrahedron of extreme points; each point outside is kept with one face that sees it; the furthest point of
/// a face is added by replacing all faces that it sees with a fan from their horizon. Points within 1e-12 of the size of a
/// face count as on it. A point whose horizon is no simple circle, by rounding, is left out: it is that near. Afterwards
/// triangles in one plane to within 1e-6 of the size become one polygon, since files write coordinates in single
/// precision; the vertices and their neighbours stay those of the triangles, thus support points are exact. Flat sets:
/// their hull in the plane, seen from both sides.
#include "hull.h"

#include <stdlib.h>

#include "math3.h"

static const double ON_FACE = 1e-12, FLAT = 1e-9, ALIKE = 1e-6;

typedef struct triangle {
  int v[3], next[3]; ///< next[i]: across the edge from v[i] to v[i+1]
  double plane[4];
  int outside; ///< first point that it sees, -1
  int alive, mark;
} triangle;

typedef struct builder {
  const double *point;
  int n;
  double size;
  triangle *face;
  int nface, room;
  int *next;  ///< [n] list of points outside
  int *stack; ///< faces to visit
  int stack_room;
  int *horizon; ///< pairs: face beyond, its edge
  int nhorizon, horizon_room;
  int *from; ///< [n] new face that starts at a vertex of the horizon, -1
  int mark;
  int failed;
} builder;

static const double *at(const builder *b, int i) { return b->point + 3 * i; }

static double height(const triangle *t, const double x[3]) { return dot3(t->plane, x) - t->plane[3]; }

static int grow(void **list, int *room, int need, size_t size) {
  if (need <= *room) return 1;
  int more = 2 * need + 64;
  void *moved = realloc(*list, (size_t)more * size);
  if (!moved) return 0;
  *list = moved;
  *room = more;
  return 1;
}

// a face through three points; 0 if they are in a line
static int set_face(const builder *b, triangle *t, int i, int j, int k) {
  double u[3], w[3], n[3];
  sub3(u, at(b, j), at(b, i));
  sub3(w, at(b, k), at(b, i));
  cross3(n, u, w);
  double area = norm3(n), longest = fmax(norm3(u), norm3(w));
  *t = (triangle){.v = {i, j, k}, .next = {-1, -1, -1}, .outside = -1, .alive = 1};
  if (!(area > 1e-14 * longest * longest) || !(longest > 0)) return 0;
  scale3(t->plane, 1 / area, n);
  t->plane[3] = dot3(t->plane, at(b, i));
  return 1;
}

static int new_face(builder *b) {
  if (!grow((void **)&b->face, &b->room, b->nface + 1, sizeof *b->face)) {
    b->failed = 1;
    return -1;
  }
  return b->nface++;
}

// --- first tetrahedron ---

// point furthest along a measure; -1 if none exceeds least
static int furthest_line(const builder *b, int i, int j, double *most) {
  double u[3], d[3], c[3];
  int best = -1;
  sub3(u, at(b, j), at(b, i));
  normalise3(u);
  *most = 0;
  for (int k = 0; k < b->n; k++) {
    sub3(d, at(b, k), at(b, i));
    cross3(c, u, d);
    double far = norm3(c);
    if (far > *most) *most = far, best = k;
  }
  return best;
}

static int furthest_plane(const builder *b, const triangle *t, double *most) {
  int best = -1;
  *most = 0;
  for (int k = 0; k < b->n; k++) {
    double far = fabs(height(t, at(b, k)));
    if (far > *most) *most = far, best = k;
  }
  return best;
}

// extremes: two ends of the longest axis, then the furthest from their line, then from their plane; returns how many
static int extremes(builder *b, int found[4]) {
  int low[3] = {0, 0, 0}, high[3] = {0, 0, 0}, axis = 0;
  for (int i = 0; i < b->n; i++) {
    for (int k = 0; k < 3; k++) {
      if (at(b, i)[k] < at(b, low[k])[k]) low[k] = i;
      if (at(b, i)[k] > at(b, high[k])[k]) high[k] = i;
    }
  }
  double largest = 0;
  for (int k = 0; k < 3; k++) {
    double length = at(b, high[k])[k] - at(b, low[k])[k];
    if (length > at(b, high[axis])[axis] - at(b, low[axis])[axis]) axis = k;
    for (int s = 0; s < 2; s++) largest = fmax(largest, fabs(at(b, s ? high[k] : low[k])[k]));
  }
  found[0] = low[axis];
  found[1] = high[axis];
  b->size = at(b, found[1])[axis] - at(b, found[0])[axis];
  // all points in one, as far as their distance from the origin lets one tell
  if (!(b->size > 1e-13 * largest)) return 1;
  double far;
  int third = furthest_line(b, found[0], found[1], &far);
  if (third < 0 || !(far > FLAT * b->size)) return 2;
  found[2] = third;
  triangle t;
  if (!set_face(b, &t, found[0], found[1], found[2])) return 2;
  int fourth = furthest_plane(b, &t, &far);
  if (fourth < 0 || !(far > FLAT * b->size)) return 3;
  found[3] = fourth;
  if (height(&t, at(b, fourth)) > 0) {
    int swap = found[0];
    found[0] = found[1];
    found[1] = swap;
  }
  return 4;
}

// --- growing ---

// gives a point to the face among those from first on that it is furthest above; drops it if it is above none
static void assign(builder *b, int p, int first) {
  int best = -1;
  double most = ON_FACE * b->size;
  for (int f = first; f < b->nface; f++) {
    double h = b->face[f].alive ? height(&b->face[f], at(b, p)) : 0;
    if (h > most) most = h, best = f;
  }
  if (best < 0) return;
  b->next[p] = b->face[best].outside;
  b->face[best].outside = p;
}

static void link_faces(builder *b, int f, int edge, int g) {
  triangle *t = &b->face[f], *u = &b->face[g];
  int from = t->v[edge], to = t->v[(edge + 1) % 3];
  t->next[edge] = g;
  for (int k = 0; k < 3; k++) {
    if (u->v[k] == to && u->v[(k + 1) % 3] == from) u->next[k] = f;
  }
}

static int start(builder *b, const int v[4]) {
  static const int corners[4][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  for (int f = 0; f < 4; f++) {
    int i = new_face(b);
    if (i < 0 || !set_face(b, &b->face[i], v[corners[f][0]], v[corners[f][1]], v[corners[f][2]])) return 0;
  }
  for (int f = 0; f < 4; f++) {
    for (int g = 0; g < 4; g++) {
      for (int k = 0; k < 3; k++) {
        for (int l = 0; l < 3; l++) {
          if (b->face[f].v[k] == b->face[g].v[(l + 1) % 3] && b->face[f].v[(k + 1) % 3] == b->face[g].v[l])
            b->face[f].next[k] = g;
        }
      }
    }
  }
  for (int p = 0; p < b->n; p++) {
    if (p != v[0] && p != v[1] && p != v[2] && p != v[3]) assign(b, p, 0);
  }
  return 1;
}

// marks the faces that see a point, from one of them on, and lists the edges beyond which none does; 0 without memory
static int find_horizon(builder *b, int f, const double x[3]) {
  int count = 1;
  b->mark++;
  b->nhorizon = 0;
  if (!grow((void **)&b->stack, &b->stack_room, 1, sizeof *b->stack)) return 0;
  b->stack[0] = f;
  b->face[f].mark = b->mark;
  for (int i = 0; i < count; i++) {
    const triangle *t = &b->face[b->stack[i]];
    for (int k = 0; k < 3; k++) {
      triangle *u = &b->face[t->next[k]];
      if (u->mark == b->mark) continue;
      if (height(u, x) > ON_FACE * b->size) {
        if (!grow((void **)&b->stack, &b->stack_room, count + 1, sizeof *b->stack)) return 0;
        u->mark = b->mark;
        b->stack[count++] = t->next[k];
      } else {
        if (!grow((void **)&b->horizon, &b->horizon_room, 2 * b->nhorizon + 2, sizeof *b->horizon)) return 0;
        b->horizon[2 * b->nhorizon] = b->stack[i];
        b->horizon[2 * b->nhorizon++ + 1] = k;
      }
    }
  }
  // what was a neighbour when it was listed may have been found to see the point later
  int kept = 0;
  for (int i = 0; i < b->nhorizon; i++) {
    const triangle *t = &b->face[b->horizon[2 * i]];
    if (b->face[t->next[b->horizon[2 * i + 1]]].mark == b->mark) continue;
    b->horizon[2 * kept] = b->horizon[2 * i];
    b->horizon[2 * kept++ + 1] = b->horizon[2 * i + 1];
  }
  b->nhorizon = kept;
  return count;
}

// a fan from a point to the horizon; 0 if that is no simple circle or a triangle of it has no area: nothing is changed
static int add_fan(builder *b, int p) {
  int first = b->nface, good = 1;
  for (int i = 0; i < b->nhorizon && good; i++) {
    int f = new_face(b);
    if (f < 0) return 0;
    const triangle *t = &b->face[b->horizon[2 * i]];
    int k = b->horizon[2 * i + 1], from = t->v[k], to = t->v[(k + 1) % 3];
    good = set_face(b, &b->face[f], from, to, p) && b->from[from] < 0;
    if (b->from[from] < 0) b->from[from] = f;
  }
  for (int f = first; f < b->nface && good; f++) good = b->from[b->face[f].v[1]] >= 0;
  // one circle, not several
  int steps = 0;
  for (int f = first; good && steps <= b->nhorizon; steps++) {
    f = b->from[b->face[f].v[1]];
    if (f == first) break;
  }
  good = good && steps + 1 == b->nhorizon;
  for (int f = first; f < b->nface && good; f++) {
    triangle *t = &b->face[f];
    const int *h = b->horizon + 2 * (f - first);
    t->next[1] = b->from[t->v[1]];
    b->face[t->next[1]].next[2] = f;
    link_faces(b, f, 0, b->face[h[0]].next[h[1]]);
  }
  for (int f = first; f < b->nface; f++) b->from[b->face[f].v[0]] = -1;
  if (!good) b->nface = first;
  return good;
}

// the furthest point above a face joins the hull
static void extend(builder *b, int f) {
  int p = -1, before = -1;
  double most = -INFINITY;
  for (int i = b->face[f].outside, last = -1; i >= 0; last = i, i = b->next[i]) {
    double h = height(&b->face[f], at(b, i));
    if (h > most) most = h, p = i, before = last;
  }
  if (before < 0)
    b->face[f].outside = b->next[p];
  else
    b->next[before] = b->next[p];
  int seen = find_horizon(b, f, at(b, p)), first = b->nface;
  if (!seen) b->failed = 1;
  if (b->failed || !add_fan(b, p)) return;
  for (int i = 0; i < seen; i++) {
    triangle *t = &b->face[b->stack[i]];
    t->alive = 0;
    for (int q = t->outside, after; q >= 0; q = after) {
      after = b->next[q];
      assign(b, q, first);
    }
    t->outside = -1;
  }
}

static void grow_hull(builder *b) {
  for (int f = 0; f < b->nface && !b->failed; f++) {
    while (b->face[f].alive && b->face[f].outside >= 0 && !b->failed) extend(b, f);
  }
}

// --- result ---

static int allocate(cav_hull *h, int vertices, int faces, int corners, int neighbours) {
  h->vertex = calloc((size_t)vertices * 3 + 1, sizeof *h->vertex);
  h->plane = calloc((size_t)faces * 4 + 1, sizeof *h->plane);
  h->face = calloc((size_t)faces + 1, sizeof *h->face);
  h->corner = calloc((size_t)corners + 1, sizeof *h->corner);
  h->neighbour_start = calloc((size_t)vertices + 1, sizeof *h->neighbour_start);
  h->neighbour = calloc((size_t)neighbours + 1, sizeof *h->neighbour);
  return h->vertex && h->plane && h->face && h->corner && h->neighbour_start && h->neighbour;
}

// the boundary of a region of triangles marked with mark, as one loop into corners; 0 if it is none
static int trace(const builder *b, const int *region, int count, int mark, int *after, int *corner, int room) {
  int edges = 0, begin = -1, n = 0;
  for (int i = 0; i < count; i++) {
    const triangle *t = &b->face[region[i]];
    for (int k = 0; k < 3; k++) {
      if (b->face[t->next[k]].mark == mark) continue;
      edges++;
      if (after[t->v[k]] >= 0) begin = -2;
      after[t->v[k]] = t->v[(k + 1) % 3];
      if (begin == -1) begin = t->v[k];
    }
  }
  if (begin >= 0) {
    for (int v = begin; n < room && n < edges; v = after[v]) {
      corner[n++] = v;
      if (after[v] == begin) break;
    }
  }
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < 3; k++) after[b->face[region[i]].v[k]] = -1;
  }
  return n == edges && n >= 3 ? n : 0;
}

// triangles about one that are in its plane
static int flood(builder *b, int f, int *region) {
  int count = 1;
  b->mark++;
  region[0] = f;
  b->face[f].mark = b->mark;
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      int g = b->face[region[i]].next[k], flat = 1;
      if (b->face[g].mark == b->mark || b->face[g].alive != 1) continue;
      for (int c = 0; c < 3; c++) flat &= fabs(height(&b->face[f], at(b, b->face[g].v[c]))) < ALIKE * b->size;
      // a thin wedge is no plane
      if (!flat || dot3(b->face[f].plane, b->face[g].plane) < 0.99) continue;
      b->face[g].mark = b->mark;
      region[count++] = g;
    }
  }
  return count;
}

static double area_of(const builder *b, const triangle *t) {
  double u[3], w[3], n[3];
  sub3(u, at(b, t->v[1]), at(b, t->v[0]));
  sub3(w, at(b, t->v[2]), at(b, t->v[0]));
  cross3(n, u, w);
  return norm3(n);
}

typedef struct ranked {
  double area;
  int face;
} ranked;

static int by_area(const void *a, const void *b) {
  const ranked *x = a, *y = b;
  if (x->area != y->area) return x->area > y->area ? -1 : 1;
  return x->face - y->face;
}

// numbers the vertices in use in the order of the points
static int number_vertices(const builder *b, int *index) {
  int n = 0;
  for (int i = 0; i < b->n; i++) index[i] = -1;
  for (int f = 0; f < b->nface; f++) {
    for (int k = 0; k < 3 && b->face[f].alive; k++) index[b->face[f].v[k]] = 0;
  }
  for (int i = 0; i < b->n; i++) {
    if (index[i] >= 0) index[i] = n++;
  }
  return n;
}

static void write_neighbours(const builder *b, const int *index, cav_hull *h) {
  int *fill = h->neighbour_start;
  for (int pass = 0; pass < 2; pass++) {
    for (int f = 0; f < b->nface; f++) {
      for (int k = 0; k < 3 && b->face[f].alive; k++) {
        int v = index[b->face[f].v[k]];
        if (pass) h->neighbour[fill[v]] = index[b->face[f].v[(k + 1) % 3]];
        fill[v]++;
      }
    }
    // counts to starts; after the second pass each start has moved to its end
    for (int v = 0, sum = 0; v < h->nvertex && !pass; v++) {
      int count = fill[v];
      fill[v] = sum;
      sum += count;
    }
  }
  for (int v = h->nvertex; v > 0; v--) fill[v] = fill[v - 1];
  fill[0] = 0;
}

// polygons from the largest triangles on
static int write_faces(builder *b, const ranked *order, int count, const int *index, int *region, int *after,
                       cav_hull *h) {
  for (int i = 0; i < count; i++) {
    int f = order[i].face, *corner = h->corner + h->ncorner;
    if (b->face[f].alive != 1) continue;
    int n = flood(b, f, region), corners = trace(b, region, n, b->mark, after, corner, 3 * count - h->ncorner);
    if (!corners) {
      n = 1;
      for (corners = 0; corners < 3; corners++) corner[corners] = b->face[f].v[corners];
    }
    for (int k = 0; k < n; k++) b->face[region[k]].alive = 2;
    double *plane = h->plane + 4 * h->nface;
    memcpy(plane, b->face[f].plane, 4 * sizeof *plane);
    for (int k = 0; k < corners; k++) plane[3] = fmax(plane[3], dot3(plane, at(b, corner[k])));
    for (int k = 0; k < corners; k++) corner[k] = index[corner[k]];
    h->face[h->nface++] = h->ncorner;
    h->ncorner += corners;
  }
  h->face[h->nface] = h->ncorner;
  return 1;
}

static cav_status finish(builder *b, cav_hull *h) {
  int count = 0;
  for (int f = 0; f < b->nface; f++) count += b->face[f].alive;
  int *index = malloc(sizeof *index * ((size_t)b->n + 1)), *after = malloc(sizeof *after * ((size_t)b->n + 1));
  int *region = malloc(sizeof *region * ((size_t)count + 1));
  ranked *order = malloc(sizeof *order * ((size_t)count + 1));
  cav_status status = CAV_NO_MEMORY;
  if (index && after && region && order) {
    h->nvertex = number_vertices(b, index);
    h->nneighbour = 3 * count;
    if (allocate(h, h->nvertex, count, 3 * count, 3 * count)) {
      for (int i = 0; i < b->n; i++) {
        after[i] = -1;
        if (index[i] >= 0) copy3(h->vertex + 3 * index[i], at(b, i));
      }
      count = 0;
      for (int f = 0; f < b->nface; f++) {
        if (b->face[f].alive) order[count++] = (ranked){area_of(b, &b->face[f]), f};
      }
      qsort(order, (size_t)count, sizeof *order, by_area);
      write_neighbours(b, index, h);
      write_faces(b, order, count, index, region, after, h);
      status = CAV_OK;
    }
  }
  free(index);
  free(after);
  free(region);
  free(order);
  return status;
}

// --- flat sets ---

typedef struct planar {
  double x, y;
  int point;
} planar;

static int by_place(const void *a, const void *b) {
  const planar *p = a, *q = b;
  if (p->x != q->x) return p->x < q->x ? -1 : 1;
  if (p->y != q->y) return p->y < q->y ? -1 : 1;
  return p->point - q->point;
}

static double turn(const planar *p, const planar *q, const planar *r) {
  return (q->x - p->x) * (r->y - p->y) - (q->y - p->y) * (r->x - p->x);
}

// hull in the plane by Andrew's monotone chain; loop needs 2 n + 1 entries
static int chain(planar *sorted, int n, double slack, planar *loop) {
  int count = 0;
  qsort(sorted, (size_t)n, sizeof *sorted, by_place);
  for (int pass = 0; pass < 2; pass++) {
    int base = count;
    for (int i = 0; i < n; i++) {
      const planar *p = &sorted[pass ? n - 1 - i : i];
      while (count >= base + 2 && turn(&loop[count - 2], &loop[count - 1], p) <= slack) count--;
      loop[count++] = *p;
    }
    count--;
  }
  return count;
}

static cav_status finish_polygon(const builder *b, const int v[3], cav_hull *h) {
  triangle t;
  double x[3], y[3];
  planar *sorted = malloc(sizeof *sorted * (size_t)b->n), *loop = malloc(sizeof *loop * (2 * (size_t)b->n + 2));
  cav_status status = CAV_NO_MEMORY;
  set_face(b, &t, v[0], v[1], v[2]);
  sub3(x, at(b, v[1]), at(b, v[0]));
  normalise3(x);
  cross3(y, t.plane, x);
  for (int i = 0; i < b->n && sorted; i++) sorted[i] = (planar){dot3(x, at(b, i)), dot3(y, at(b, i)), i};
  if (sorted && loop) {
    int n = chain(sorted, b->n, ON_FACE * b->size * b->size, loop);
    h->nvertex = n;
    h->nface = 2;
    h->ncorner = h->nneighbour = 2 * n;
    if (allocate(h, n, 2, 2 * n, 2 * n)) {
      for (int i = 0; i < n; i++) {
        copy3(h->vertex + 3 * i, at(b, loop[i].point));
        h->corner[i] = i;
        h->corner[n + i] = n - 1 - i;
        h->neighbour[2 * i] = (i + 1) % n;
        h->neighbour[2 * i + 1] = (i + n - 1) % n;
        h->neighbour_start[i + 1] = 2 * i + 2;
      }
      h->face[1] = n;
      h->face[2] = 2 * n;
      memcpy(h->plane, t.plane, sizeof t.plane);
      scale3(h->plane + 4, -1, t.plane);
      h->plane[7] = -t.plane[3];
      status = CAV_OK;
    }
  }
  free(sorted);
  free(loop);
  return status;
}

static cav_status finish_line(const builder *b, const int *v, int n, cav_hull *h) {
  h->nvertex = n;
  h->nneighbour = n == 2 ? 2 : 0;
  if (!allocate(h, n, 0, 0, h->nneighbour)) return CAV_NO_MEMORY;
  for (int i = 0; i < n; i++) {
    copy3(h->vertex + 3 * i, at(b, v[i]));
    if (n == 2) h->neighbour[i] = 1 - i;
    if (n == 2) h->neighbour_start[i + 1] = i + 1;
  }
  return CAV_OK;
}

cav_status cav_hull_build(const double *point, int n, cav_hull *hull) {
  builder b = {.point = point, .n = n};
  int v[4];
  *hull = (cav_hull){.nvertex = 0};
  cav_status status = CAV_NO_MEMORY;
  int count = n > 0 ? extremes(&b, v) : 0;
  b.next = malloc(sizeof *b.next * ((size_t)n + 1));
  b.from = malloc(sizeof *b.from * ((size_t)n + 1));
  if (b.next && b.from) {
    for (int i = 0; i < n; i++) b.from[i] = -1;
    if (count == 4 && start(&b, v)) {
      grow_hull(&b);
      if (!b.failed) status = finish(&b, hull);
    } else if (count >= 3 && !b.failed) {
      status = finish_polygon(&b, v, hull);
    } else if (!b.failed) {
      status = finish_line(&b, v, count, hull);
    }
  }
  free(b.next);
  free(b.from);
  free(b.face);
  free(b.stack);
  free(b.horizon);
  if (status != CAV_OK) cav_hull_clear(hull);
  return status;
}

void cav_hull_clear(cav_hull *hull) {
  free(hull->vertex);
  free(hull->plane);
  free(hull->face);
  free(hull->corner);
  free(hull->neighbour_start);
  free(hull->neighbour);
  *hull = (cav_hull){.nvertex = 0};
}
