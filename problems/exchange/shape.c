/// Round shapes are profiles turned about z, hulls and boxes polygons with the normals of their faces.
#include "shape.h"

#include <math.h>
#include <stdlib.h>

enum { AROUND = 24, ALONG = 12 }; // segments of a full and of a half turn

static const double pi = 3.14159265358979323846;

// room for more; 0 if memory runs out
static int reserve(cav_shape *s, int vertices, int indices) {
  if (s->nvertex + vertices > s->room_vertex) {
    int room = 2 * (s->nvertex + vertices);
    float *v = realloc(s->vertex, (size_t)room * 3 * sizeof *v);
    if (v) s->vertex = v;
    float *n = realloc(s->normal, (size_t)room * 3 * sizeof *n);
    if (n) s->normal = n;
    if (!v || !n) return !(s->failed = 1);
    s->room_vertex = room;
  }
  if (s->nindex + indices > s->room_index) {
    int room = 2 * (s->nindex + indices);
    unsigned *x = realloc(s->index, (size_t)room * sizeof *x);
    if (!x) return !(s->failed = 1);
    s->index = x;
    s->room_index = room;
  }
  return !s->failed;
}

static unsigned add_vertex(cav_shape *s, double x, double y, double z, double nx, double ny, double nz) {
  double length = sqrt(nx * nx + ny * ny + nz * nz);
  const double v[3] = {x, y, z}, n[3] = {nx, ny, nz};
  for (int k = 0; k < 3; k++) {
    s->vertex[3 * s->nvertex + k] = (float)v[k];
    s->normal[3 * s->nvertex + k] = length > 0 ? (float)(n[k] / length) : (float)(k == 2);
  }
  return (unsigned)s->nvertex++;
}

// left out where two corners coincide
static void add_triangle(cav_shape *s, unsigned a, unsigned b, unsigned c) {
  const float *p = s->vertex + 3 * a, *q = s->vertex + 3 * b, *r = s->vertex + 3 * c;
  double u[3], v[3];
  for (int k = 0; k < 3; k++) u[k] = (double)q[k] - (double)p[k], v[k] = (double)r[k] - (double)p[k];
  double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
  if (!(x * x + y * y + z * z > 0)) return;
  s->index[s->nindex++] = a, s->index[s->nindex++] = b, s->index[s->nindex++] = c;
}

// a point of a profile: distance from z, height, and the normal's parts
typedef struct rim {
  double r, z, nr, nz;
} rim;

// turns a profile, from the bottom up, about z
static void revolve(cav_shape *s, const rim *profile, int n) {
  if (!reserve(s, n * (AROUND + 1), 6 * n * AROUND)) return;
  unsigned first = (unsigned)s->nvertex;
  for (int i = 0; i < n; i++) {
    for (int k = 0; k <= AROUND; k++) {
      double a = 2 * pi * (k % AROUND) / AROUND, c = cos(a), d = sin(a);
      const rim *p = &profile[i];
      add_vertex(s, p->r * c, p->r * d, p->z, p->nr * c, p->nr * d, p->nz);
    }
  }
  for (int i = 0; i + 1 < n; i++) {
    for (int k = 0; k < AROUND; k++) {
      unsigned a = first + (unsigned)(i * (AROUND + 1) + k), b = a + AROUND + 1;
      add_triangle(s, a, a + 1, b + 1);
      add_triangle(s, a, b + 1, b);
    }
  }
}

// a ball drawn out along z, in units of its radius
static void add_capsule(cav_shape *s, double radius, double half) {
  rim p[2 * ALONG];
  for (int i = 0; i < 2 * ALONG; i++) {
    // the lower and the upper part have a rim each at the equator
    int upper = i >= ALONG;
    double a = pi * ((double)(i - upper) / (2 * ALONG - 2) - 0.5);
    double c = i == 0 || i == 2 * ALONG - 1 ? 0 : cos(a);
    p[i] = (rim){radius * c, radius * sin(a) + (upper ? half : -half), c, sin(a)};
  }
  revolve(s, p, 2 * ALONG);
}

static void add_cylinder(cav_shape *s, double r, double h) {
  const rim bottom[2] = {{0, -h, 0, -1}, {r, -h, 0, -1}}, side[2] = {{r, -h, 1, 0}, {r, h, 1, 0}},
            top[2] = {{r, h, 0, 1}, {0, h, 0, 1}};
  revolve(s, bottom, 2);
  revolve(s, side, 2);
  revolve(s, top, 2);
}

static void add_ellipsoid(cav_shape *s, const double size[3]) {
  int first = s->nvertex;
  add_capsule(s, 1, 0);
  for (int i = first; i < s->nvertex; i++) {
    float *v = s->vertex + 3 * i, *n = s->normal + 3 * i;
    double m[3], length = 0;
    for (int k = 0; k < 3; k++) {
      m[k] = (double)n[k] / size[k], length += m[k] * m[k];
      v[k] = (float)((double)v[k] * size[k]);
    }
    for (int k = 0; k < 3; k++) n[k] = (float)(m[k] / sqrt(length));
  }
}

// a square of four corners and its normal
static void add_quad(cav_shape *s, const double corner[4][3], const double n[3]) {
  if (!reserve(s, 4, 6)) return;
  unsigned v[4];
  for (int i = 0; i < 4; i++) v[i] = add_vertex(s, corner[i][0], corner[i][1], corner[i][2], n[0], n[1], n[2]);
  add_triangle(s, v[0], v[1], v[2]);
  add_triangle(s, v[0], v[2], v[3]);
}

static void add_box(cav_shape *s, const double h[3]) {
  for (int face = 0; face < 6; face++) {
    int k = face % 3, a = (k + 1) % 3, b = (k + 2) % 3;
    double sign = face < 3 ? 1 : -1, corner[4][3], n[3] = {0};
    n[k] = sign;
    for (int i = 0; i < 4; i++) {
      corner[i][k] = sign * h[k];
      corner[i][a] = (i == 1 || i == 2 ? 1 : -1) * h[a] * sign;
      corner[i][b] = (i >= 2 ? 1 : -1) * h[b];
    }
    add_quad(s, (const double(*)[3])corner, n);
  }
}

static void add_hull(cav_shape *s, const cav_mesh *m) {
  for (int f = 0; f < m->nface; f++) {
    int n = m->face[f + 1] - m->face[f];
    const double *plane = m->plane + 4 * f;
    if (!reserve(s, n, 3 * n)) return;
    unsigned first = (unsigned)s->nvertex;
    for (int k = 0; k < n; k++) {
      const double *v = m->vertex + 3 * m->corner[m->face[f] + k];
      add_vertex(s, v[0], v[1], v[2], plane[0], plane[1], plane[2]);
    }
    for (int k = 2; k < n; k++) add_triangle(s, first, first + (unsigned)k - 1, first + (unsigned)k);
  }
}

// the upper side, facets with the normal of their side
static void add_field(cav_shape *s, const cav_hfield *h) {
  for (int r = 0; r + 1 < h->nrow; r++) {
    for (int c = 0; c + 1 < h->ncol; c++) {
      double corner[4][3], n[3];
      for (int i = 0; i < 4; i++) {
        int row = r + (i >= 2), column = c + (i == 1 || i == 2);
        corner[i][0] = h->size[0] * (2.0 * column / (h->ncol - 1) - 1);
        corner[i][1] = h->size[1] * (2.0 * row / (h->nrow - 1) - 1);
        corner[i][2] = h->height[row * h->ncol + column];
      }
      double dx = 2 * h->size[0] / (h->ncol - 1), dy = 2 * h->size[1] / (h->nrow - 1);
      n[0] = -(corner[1][2] + corner[2][2] - corner[0][2] - corner[3][2]) / (2 * dx);
      n[1] = -(corner[2][2] + corner[3][2] - corner[0][2] - corner[1][2]) / (2 * dy);
      n[2] = 1;
      add_quad(s, (const double(*)[3])corner, n);
    }
  }
}

void cav_shape_of(cav_shape *s, const cav_model *model, int geom, double plane) {
  const cav_geom *g = &model->geom[geom];
  const double up[3] = {0, 0, 1},
               corner[4][3] = {{-plane, -plane, 0}, {plane, -plane, 0}, {plane, plane, 0}, {-plane, plane, 0}};
  *s = (cav_shape){0};
  switch (g->type) {
    case CAV_GEOM_PLANE:
      add_quad(s, corner, up);
      break;
    case CAV_GEOM_SPHERE:
      add_capsule(s, g->size[0], 0);
      break;
    case CAV_GEOM_CAPSULE:
      add_capsule(s, g->size[0], g->size[1]);
      break;
    case CAV_GEOM_ELLIPSOID:
      add_ellipsoid(s, g->size);
      break;
    case CAV_GEOM_CYLINDER:
      add_cylinder(s, g->size[0], g->size[1]);
      break;
    case CAV_GEOM_BOX:
      add_box(s, g->size);
      break;
    case CAV_GEOM_MESH:
      add_hull(s, &model->mesh[g->asset]);
      break;
    case CAV_GEOM_HFIELD:
      add_field(s, &model->hfield[g->asset]);
      break;
    case CAV_GEOM_TYPES:
      break;
  }
}

void cav_shape_free(cav_shape *s) {
  free(s->vertex);
  free(s->normal);
  free(s->index);
  *s = (cav_shape){0};
}
