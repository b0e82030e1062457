/// Convex hull of points in space: the only user of Qhull (reentrant, libqhull_r).
///
/// Sets that are flat to 1e-9 of their size are no task for Qhull: their hull in the plane, seen from both sides, a
/// segment or a point. The others go to it about the origin at size 1, triangulated. Afterwards triangles in one
/// plane to within 1e-6 of the size become one polygon, since files write coordinates in single precision; the
/// vertices and their neighbours stay those of the triangles, thus support points are exact. tests/results/hull.md
/// has the measurements against the quickhull that was here.
#include "hull.h"

#include <stdio.h>
#include <stdlib.h>

#include "direction.h"
#include "math3.h"

#ifdef CAVORT_HAVE_QHULL
#include <libqhull_r/qhull_ra.h>
#endif

static const double ON_FACE = 1e-12, FLAT = 1e-9, ALIKE = 1e-6;

typedef struct triangle {
  int v[3], next[3]; ///< next[i]: across the edge from v[i] to v[i+1]
  double plane[4];
  int alive, mark; ///< alive: 1 until it is part of a polygon, then 2
  int polygon;     ///< that one
} triangle;

typedef struct builder {
  const double *point;
  int n;
  double size, low[3];
  triangle *face;
  int nface, mark;
} builder;

static const double *at(const builder *b, int i) { return b->point + 3 * i; }

static double height(const triangle *t, const double x[3]) { return dot3(t->plane, x) - t->plane[3]; }

// a face through three points; 0 if they are in a line
static int set_face(const builder *b, triangle *t, int i, int j, int k) {
  double u[3], w[3], n[3];
  sub3(u, at(b, j), at(b, i));
  sub3(w, at(b, k), at(b, i));
  cross3(n, u, w);
  double area = norm3(n), longest = fmax(norm3(u), norm3(w));
  *t = (triangle){.v = {i, j, k}, .next = {-1, -1, -1}, .alive = 1};
  if (!(area > 1e-14 * longest * longest) || !(longest > 0)) return 0;
  scale3(t->plane, 1 / area, n);
  t->plane[3] = dot3(t->plane, at(b, i));
  return 1;
}

// --- extent ---

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
  for (int k = 0; k < 3; k++) b->low[k] = at(b, low[k])[k];
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
  return 4;
}

// --- Qhull ---

#ifdef CAVORT_HAVE_QHULL

// corners counterclockwise from outside and the triangles beyond their edges; the plane in the coordinates of the
// points
static void read_facet(const builder *b, qhT *qh, facetT *facet, triangle *t) {
  // Qhull's neighbour k is opposite to its vertex k, and its order is clockwise where it says so
  int order[3] = {0, facet->toporient ? 2 : 1, facet->toporient ? 1 : 2};
  *t = (triangle){.alive = 1};
  for (int k = 0; k < 3; k++) {
    t->v[k] = qh_pointid(qh, SETelemt_(facet->vertices, order[k], vertexT)->point);
    t->next[k] = SETelemt_(facet->neighbors, order[(k + 2) % 3], facetT)->visitid;
  }
  copy3(t->plane, facet->normal);
  t->plane[3] = -INFINITY;
  for (int k = 0; k < 3; k++) t->plane[3] = fmax(t->plane[3], dot3(t->plane, at(b, t->v[k])));
}

static cav_status read_facets(builder *b, qhT *qh) {
  facetT *facet;
  b->face = malloc(sizeof *b->face * (size_t)(qh->num_facets + 1));
  if (!b->face) return CAV_NO_MEMORY;
  int count = 0;
  FORALLfacets {
    if (!facet->simplicial) return CAV_INTERNAL;
    facet->visitid = (unsigned)count++;
  }
  FORALLfacets read_facet(b, qh, facet, &b->face[b->nface++]);
  return CAV_OK;
}

// triangles of the hull of points that are not flat; Qhull begins with four of them and adds the outermost one
static cav_status triangulate(builder *b, int most) {
  char command[40] = "qhull Qt", *said = NULL;
  if (most >= 4) snprintf(command, sizeof command, "qhull Qt TA%d", most - 4);
  size_t length;
  double *moved = malloc(sizeof *moved * 3 * (size_t)b->n);
  // Qhull wants a file for what it has to say: one that nobody reads
  FILE *silent = open_memstream(&said, &length);
  cav_status status = CAV_NO_MEMORY;
  if (moved && silent) {
    qhT qh;
    int blocks, left;
    for (int i = 0; i < b->n; i++) {
      for (int k = 0; k < 3; k++) moved[3 * i + k] = (at(b, i)[k] - b->low[k]) / b->size - 0.5;
    }
    qh_zero(&qh, silent);
    int failed = qh_new_qhull(&qh, 3, b->n, moved, False, command, silent, silent);
    status = !failed ? read_facets(b, &qh) : failed == qh_ERRmem ? CAV_NO_MEMORY : CAV_BAD_INPUT;
    qh_freeqhull(&qh, !qh_ALL);
    qh_memfreeshort(&qh, &left, &blocks);
  }
  if (silent) fclose(silent);
  free(said);
  free(moved);
  return status;
}
#else

static cav_status triangulate(builder *b, int most) {
  (void)b, (void)most;
  return CAV_NOT_SUPPORTED;
}
#endif

// --- result ---

static int allocate(cav_hull *h, int vertices, int faces, int corners, int neighbours) {
  h->vertex = calloc((size_t)vertices * 3 + 1, sizeof *h->vertex);
  h->plane = calloc((size_t)faces * 4 + 1, sizeof *h->plane);
  h->face = calloc((size_t)faces + 1, sizeof *h->face);
  h->corner = calloc((size_t)corners + 1, sizeof *h->corner);
  h->neighbour_start = calloc((size_t)vertices + 1, sizeof *h->neighbour_start);
  h->neighbour = calloc((size_t)neighbours + 1, sizeof *h->neighbour);
  h->meeting_start = calloc((size_t)vertices + 1, sizeof *h->meeting_start);
  h->meeting = calloc((size_t)corners + 1, sizeof *h->meeting);
  h->summit = calloc(CAV_DIRECTION_CELLS, sizeof *h->summit);
  return h->vertex && h->plane && h->face && h->corner && h->neighbour_start && h->neighbour && h->meeting_start &&
         h->meeting && h->summit;
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

// numbers the vertices in use from one triangle on, neighbour by neighbour: those next to each other are so in memory too;
// queue has room for all triangles
static int number_vertices(builder *b, int *index, int *queue) {
  int n = 0, head = 0, tail = 0;
  for (int i = 0; i < b->n; i++) index[i] = -1;
  b->mark++;
  for (int first = 0; first < b->nface; first++) {
    if (!b->face[first].alive || b->face[first].mark == b->mark) continue;
    b->face[first].mark = b->mark;
    queue[tail++] = first;
    while (head < tail) {
      const triangle *t = &b->face[queue[head++]];
      for (int k = 0; k < 3; k++) {
        triangle *next = &b->face[t->next[k]];
        if (index[t->v[k]] < 0) index[t->v[k]] = n++;
        if (!next->alive || next->mark == b->mark) continue;
        next->mark = b->mark;
        queue[tail++] = t->next[k];
      }
    }
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

// the polygons that meet at each vertex: those of its triangles, so that a vertex inside a polygon has that one
static void write_meeting(const builder *b, const int *index, cav_hull *h) {
  int *fill = h->meeting_start;
  for (int f = 0; f < b->nface; f++) {
    for (int k = 0; k < 3 && b->face[f].alive; k++) fill[index[b->face[f].v[k]] + 1]++;
  }
  for (int v = 0; v < h->nvertex; v++) fill[v + 1] += fill[v];
  h->nmeeting = fill[h->nvertex];
  for (int f = 0; f < b->nface; f++) {
    for (int k = 0; k < 3 && b->face[f].alive; k++) h->meeting[fill[index[b->face[f].v[k]]]++] = b->face[f].polygon;
  }
  // each start has moved to its end
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
    for (int k = 0; k < n; k++) {
      b->face[region[k]].alive = 2;
      b->face[region[k]].polygon = h->nface;
    }
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
    h->nvertex = number_vertices(b, index, region);
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
      write_meeting(b, index, h);
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

static double planar_orientation(const planar *p, const planar *q, const planar *r) {
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
      while (count >= base + 2 && planar_orientation(&loop[count - 2], &loop[count - 1], p) <= slack) count--;
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
    h->ncorner = h->nneighbour = h->nmeeting = 2 * n;
    if (allocate(h, n, 2, 2 * n, 2 * n)) {
      for (int i = 0; i < n; i++) {
        copy3(h->vertex + 3 * i, at(b, loop[i].point));
        h->corner[i] = i;
        h->corner[n + i] = n - 1 - i;
        h->neighbour[2 * i] = (i + 1) % n;
        h->neighbour[2 * i + 1] = (i + n - 1) % n;
        h->neighbour_start[i + 1] = 2 * i + 2;
        h->meeting[2 * i + 1] = 1;
        h->meeting_start[i + 1] = 2 * i + 2;
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

// the furthest vertex along the middle of each cell of directions, by looking at all: made once, and no walk is needed
static void index_summits(cav_hull *h) {
  for (int cell = 0; cell < CAV_DIRECTION_CELLS; cell++) {
    double d[3], top = -INFINITY;
    direction_of_cell(cell, d);
    for (int v = 0; v < h->nvertex; v++) {
      double height = dot3(d, h->vertex + 3 * v);
      if (height > top) top = height, h->summit[cell] = v;
    }
  }
}

cav_status cav_hull_build(const double *point, int n, int most, cav_hull *hull) {
  builder b = {.point = point, .n = n};
  int v[4];
  *hull = (cav_hull){.nvertex = 0};
  int count = n > 0 ? extremes(&b, v) : 0;
  cav_status status;
  if (count == 4) {
    status = isfinite(b.size) ? triangulate(&b, most) : CAV_BAD_INPUT;
    if (status == CAV_OK) status = finish(&b, hull);
  } else if (count == 3) {
    status = finish_polygon(&b, v, hull);
  } else {
    status = finish_line(&b, v, count, hull);
  }
  free(b.face);
  if (status != CAV_OK) {
    cav_hull_clear(hull);
    return status;
  }
  index_summits(hull);
  return CAV_OK;
}

void cav_hull_clear(cav_hull *hull) {
  free(hull->vertex);
  free(hull->plane);
  free(hull->face);
  free(hull->corner);
  free(hull->neighbour_start);
  free(hull->neighbour);
  free(hull->meeting_start);
  free(hull->meeting);
  free(hull->summit);
  *hull = (cav_hull){.nvertex = 0};
}
