/// Meshes and height fields of a model: asked for while the file is read, loaded only where a geom uses them.
///
/// A mesh collides as its convex hull and weighs as its triangles: it is scaled, moved by its reference pose, and
/// expressed about its centre of mass and principal axes, to which its geoms are moved, as MuJoCo does. One without
/// volume keeps the middle of its surface and must not be asked to weigh by density. A simple shape that names a mesh
/// is fitted to it: to the box of its inertia, or to its bounding box. A height field without a file is level; with
/// one (see elevation.c) its heights are stretched to 0 to 1. Not done: MuJoCo's MSH format, built-in meshes.

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "algebra.h"
#include "direction.h"
#include "elevation.h"
#include "math3.h"
#include "spec.h"

// --- files ---

// path of an asset: relative to the asset folder, that to the model's file; of its path only the name counts with strip
static const char *asset_path(cav_spec *spec, const cav_xml_node *node, const char *file) {
  const cav_spec_compiler *compiler = cav_compiler_of(spec, node);
  const char *model = node->part ? spec->parts.at[node->part - 1].path : cav_xml_path(spec->xml);
  const char *slash = strrchr(model, '/'), *folder = compiler->mesh_folder;
  if (compiler->strip && strrchr(file, '/')) file = strrchr(file, '/') + 1;
  int base = slash && *folder != '/' && *file != '/' ? (int)(slash - model) + 1 : 0;
  if (*file == '/') folder = "";
  size_t length = strlen(folder), room = strlen(model) + length + strlen(file) + 3;
  char *path = cav_spec_keep_text(spec, room);
  if (path)
    snprintf(path, room, "%.*s%s%s%s", base, model, folder, length && folder[length - 1] != '/' ? "/" : "", file);
  return path;
}

// a file's name without folder and ending, behind the prefix of the part
static const char *name_of(cav_spec *spec, const cav_xml_node *node, const char *file) {
  const char *slash = strrchr(file, '/'), *start = slash ? slash + 1 : file, *dot = strrchr(start, '.');
  size_t length = dot ? (size_t)(dot - start) : strlen(start);
  const char *prefix = node->part ? spec->parts.at[node->part - 1].prefix : "";
  char *name = cav_spec_keep_text(spec, strlen(prefix) + length + 1);
  if (name) memcpy(name, prefix, strlen(prefix));
  if (name) memcpy(name + strlen(prefix), start, length);
  return name ? name : "";
}

// --- asking ---

void cav_read_mesh(cav_spec *spec, const cav_xml_node *node, const double scale[3], cav_mesh_inertia inertia,
                   int hull_vertices) {
  cav_spec_mesh *m = CAV_SPEC_PUSH(spec, &spec->mesh);
  if (!m) return;
  *m = (cav_spec_mesh){.node = node, .refquat = {1, 0, 0, 0}, .index = -1};
  const char *file = cav_xml_text(node, "file", NULL);
  m->vertex = cav_xml_get(node, "vertex");
  m->face = cav_xml_get(node, "face");
  m->name = cav_xml_text(node, "name", "");
  if (!*m->name && file) m->name = name_of(spec, node, file);
  m->inertia = (cav_mesh_inertia)cav_xml_word(node, "inertia", (int)inertia);
  m->hull_vertices = cav_xml_int(node, "maxhullvert", hull_vertices);
  if (m->hull_vertices < 4 && m->hull_vertices != -1)
    cav_spec_fail(spec, node, "maxhullvert", "expected -1 (all) or at least 4, got %d", m->hull_vertices);
  if (cav_xml_get(node, "builtin")) {
    m->builtin = 1;
    return;
  }
  if (!file == !m->vertex)
    cav_spec_fail(spec, node, NULL, "expected one of file and vertex; say where the mesh comes from");
  m->path = file ? asset_path(spec, node, file) : NULL;
  copy3(m->scale, scale);
  cav_xml_reals(node, "scale", m->scale, 3);
  cav_xml_reals(node, "refpos", m->refpos, 3);
  cav_xml_reals(node, "refquat", m->refquat, 4);
  quat_normalise(m->refquat);
  if (m->scale[0] * m->scale[1] * m->scale[2] == 0)
    cav_spec_fail(spec, node, "scale", "expected numbers other than 0, got %g %g %g", m->scale[0], m->scale[1],
                  m->scale[2]);
}

int cav_add_mesh(cav_spec *spec, const cav_xml_node *node, const char *path, const double scale[3]) {
  for (int i = 0; i < spec->mesh.n; i++) {
    const cav_spec_mesh *m = &spec->mesh.at[i];
    if (m->path && !strcmp(m->path, path) && !memcmp(m->scale, scale, sizeof m->scale)) return i;
  }
  cav_spec_mesh *m = CAV_SPEC_PUSH(spec, &spec->mesh);
  if (!m) return 0;
  *m = (cav_spec_mesh){.name = "", .node = node, .path = path, .refquat = {1, 0, 0, 0}, .index = -1};
  copy3(m->scale, scale);
  if (scale[0] * scale[1] * scale[2] == 0)
    cav_spec_fail(spec, node, "scale", "expected numbers other than 0, got %g %g %g", scale[0], scale[1], scale[2]);
  return spec->mesh.n - 1;
}

void cav_read_hfield(cav_spec *spec, const cav_xml_node *node) {
  cav_spec_hfield *h = CAV_SPEC_PUSH(spec, &spec->hfield);
  if (!h) return;
  const char *file = cav_xml_text(node, "file", NULL);
  *h = (cav_spec_hfield){.node = node, .index = -1};
  h->name = cav_xml_text(node, "name", "");
  if (!*h->name && file) h->name = name_of(spec, node, file);
  h->path = file ? asset_path(spec, node, file) : NULL;
  h->elevation = cav_xml_get(node, "elevation");
  h->nrow = cav_xml_int(node, "nrow", 0);
  h->ncol = cav_xml_int(node, "ncol", 0);
  cav_xml_reals(node, "size", h->size, 4);
  for (int k = 0; k < 4; k++) {
    if (!(h->size[k] > 0))
      cav_spec_fail(spec, node, "size", "expected four numbers > 0 (half lengths, height, depth of the base), got %g",
                    h->size[k]);
  }
  if (!file && (h->nrow < 2 || h->ncol < 2))
    cav_spec_fail(spec, node, NULL, "expected nrow and ncol of at least 2, or a file; got %d and %d", h->nrow, h->ncol);
  // features of contacts number the prisms under the grid, 128 a cell
  _Static_assert(64 + 128 * (long long)(CAV_SPEC_GRID - 1) * (CAV_SPEC_GRID - 1) <= INT_MAX, "features are int");
  if (h->nrow > CAV_SPEC_GRID || h->ncol > CAV_SPEC_GRID)
    cav_spec_fail(spec, node, NULL, "%d by %d points; at most %d along each side are read", h->nrow, h->ncol,
                  CAV_SPEC_GRID);
}

// --- meshes ---

// triangles that the file of the model itself gives, or those of the hull where it gives points alone
static void read_own_mesh(cav_spec *spec, const cav_spec_mesh *m, cav_triangles *t) {
  int n = m->vertex->count / 3, faces = m->face ? m->face->count / 3 : 0;
  if (m->vertex->count % 3 || n < 1 || (m->face && m->face->count % 3)) {
    cav_spec_fail(spec, m->node, NULL, "vertex and face: expected numbers three by three");
    return;
  }
  t->vertex = malloc(sizeof *t->vertex * 3 * (size_t)n);
  t->triangle = malloc(sizeof *t->triangle * (3 * (size_t)faces + 1));
  if (!t->vertex || !t->triangle) {
    cav_spec_no_memory(spec);
    return;
  }
  t->nvertex = n;
  t->ntriangle = faces;
  memcpy(t->vertex, m->vertex->number, sizeof *t->vertex * 3 * (size_t)n);
  for (int i = 0; i < 3 * faces; i++) {
    t->triangle[i] = (int)m->face->number[i];
    if (t->triangle[i] < 0 || t->triangle[i] >= n)
      cav_spec_fail(spec, m->node, "face", "%d is no vertex: %d are given", t->triangle[i], n);
  }
}

// fans of the hull's polygons
static int triangles_of_hull(const cav_hull *h, cav_triangles *t) {
  int count = h->ncorner - 2 * h->nface;
  int *v = realloc(t->triangle, sizeof *v * (3 * (size_t)count + 1));
  double *x = realloc(t->vertex, sizeof *x * (3 * (size_t)h->nvertex + 1));
  if (v) t->triangle = v;
  if (x) t->vertex = x;
  if (!v || !x) return 0;
  memcpy(x, h->vertex, sizeof *x * 3 * (size_t)h->nvertex);
  t->nvertex = h->nvertex;
  t->ntriangle = 0;
  for (int f = 0; f < h->nface; f++) {
    for (int k = h->face[f] + 2; k < h->face[f + 1]; k++, v += 3) {
      v[0] = h->corner[h->face[f]];
      v[1] = h->corner[k - 1];
      v[2] = h->corner[k];
      t->ntriangle++;
    }
  }
  return 1;
}

// moved by the reference pose, then scaled
static void transform_mesh(const cav_spec_mesh *m, cav_triangles *t) {
  double back[4];
  quat_conjugate(back, m->refquat);
  for (int i = 0; i < t->nvertex; i++) {
    double *x = t->vertex + 3 * i;
    sub3(x, x, m->refpos);
    quat_rotate(x, back, x);
    for (int k = 0; k < 3; k++) x[k] *= m->scale[k];
  }
}

// bulk, principal axes, and all vertices into them
static void weigh_mesh(cav_spec *spec, cav_spec_mesh *m, cav_triangles *t) {
  int exact = cav_compiler_of(spec, m->node)->exact_mesh && m->inertia == CAV_MESH_LEGACY;
  cav_bulk bulk = cav_mesh_bulk(t, exact ? CAV_MESH_EXACT : m->inertia);
  double size = 0, back[4];
  for (int i = 0; i < 3 * t->nvertex; i++) size = fmax(size, fabs(t->vertex[i]));
  m->volume = bulk.volume > 1e-15 * size * size * size ? bulk.volume : 0;
  copy3(m->pos, bulk.centre);
  m->quat[0] = 1;
  if (m->volume > 0) cav_principal_axes(bulk.inertia, m->quat, m->moment);
  quat_conjugate(back, m->quat);
  set3(m->low, INFINITY, INFINITY, INFINITY);
  set3(m->high, -INFINITY, -INFINITY, -INFINITY);
  for (int i = 0; i < t->nvertex; i++) {
    double *x = t->vertex + 3 * i;
    sub3(x, x, m->pos);
    quat_rotate(x, back, x);
    for (int k = 0; k < 3; k++) m->half[k] = fmax(m->half[k], fabs(x[k]));
    for (int k = 0; k < 3; k++) m->low[k] = fmin(m->low[k], x[k]), m->high[k] = fmax(m->high[k], x[k]);
    m->bound = fmax(m->bound, norm3(x));
  }
  if (!isfinite(m->volume) || !isfinite(m->bound) || !all_finite(m->moment, 3))
    cav_spec_fail(spec, m->node, NULL, "numbers are too large: what follows from them is not finite");
}

static void build_hull(cav_spec *spec, cav_spec_mesh *m, const cav_triangles *t) {
  cav_status status = cav_hull_build(t->vertex, t->nvertex, m->hull_vertices, &m->hull);
  if (status == CAV_NO_MEMORY)
    cav_spec_no_memory(spec);
  else if (status == CAV_NOT_SUPPORTED)
    cav_spec_fail(
        spec, m->node, NULL,
        "the convex hull of a mesh needs Qhull, which this build is without; use boxes, capsules, ellipsoids or "
        "cylinders, or build with libqhull-dev and -Dmeshes=enabled");
  else if (status != CAV_OK)
    cav_spec_fail(spec, m->node, NULL, "Qhull finds no convex hull of its %d points", t->nvertex);
}

// the triangles become those of the hull
static void take_hull(cav_spec *spec, cav_spec_mesh *m, cav_triangles *t) {
  build_hull(spec, m, t);
  if (spec->status == CAV_OK && !triangles_of_hull(&m->hull, t)) cav_spec_no_memory(spec);
  cav_hull_clear(&m->hull);
}

static void load_mesh(cav_spec *spec, cav_spec_mesh *m) {
  cav_triangles t = {0};
  char reason[200] = "";
  m->loaded = 1;
  if (m->builtin) {
    cav_spec_fail(spec, m->node, "builtin", "built-in meshes are not supported; give a file or vertices");
    return;
  }
  if (m->path) {
    cav_status status = cav_mesh_read(m->path, &t, reason, sizeof reason);
    if (status == CAV_NO_MEMORY)
      cav_spec_no_memory(spec);
    else if (status != CAV_OK)
      cav_spec_fail(spec, m->node, NULL, "%.300s: %s", m->path, reason);
  } else {
    read_own_mesh(spec, m, &t);
  }
  if (spec->status == CAV_OK) transform_mesh(m, &t);
  // points alone: their hull is the solid
  if (spec->status == CAV_OK && (!t.ntriangle || m->inertia == CAV_MESH_CONVEX)) take_hull(spec, m, &t);
  if (spec->status == CAV_OK) weigh_mesh(spec, m, &t);
  if (spec->status == CAV_OK && m->index >= 0) build_hull(spec, m, &t);
  if (spec->status == CAV_OK && spec->load.visual)
    m->surface = t;
  else
    cav_triangles_clear(&t);
}

// --- height fields ---

// rows, columns and heights of a file
static void read_heights(cav_spec *spec, cav_spec_hfield *h) {
  cav_elevation e;
  char reason[200] = "";
  cav_status status = cav_elevation_read(h->path, CAV_SPEC_GRID, &e, reason, sizeof reason);
  if (status == CAV_NO_MEMORY)
    cav_spec_no_memory(spec);
  else if (status != CAV_OK)
    cav_spec_fail(spec, h->node, "file", "%.300s: %s", h->path, reason);
  h->height = e.height;
  h->nrow = e.nrow;
  h->ncol = e.ncol;
}

// heights that the file of the model itself gives; its first row lies at the far end of y
static void read_elevation(cav_spec *spec, cav_spec_hfield *h) {
  int n = h->nrow * h->ncol;
  if (h->elevation->count != n) {
    cav_spec_fail(spec, h->node, "elevation", "expected %d numbers, one for each point, got %d", n,
                  h->elevation->count);
    return;
  }
  for (int r = 0; r < h->nrow; r++)
    memcpy(h->height + r * h->ncol, h->elevation->number + (h->nrow - 1 - r) * h->ncol,
           sizeof *h->height * (size_t)h->ncol);
}

static void load_hfield(cav_spec *spec, cav_spec_hfield *h) {
  if (h->path) read_heights(spec, h);
  size_t n = (size_t)h->nrow * (size_t)h->ncol;
  if (!h->path) h->height = calloc(n, sizeof *h->height);
  if (!h->path && !h->height) cav_spec_no_memory(spec);
  if (h->height && !h->path && h->elevation) read_elevation(spec, h);
  if (spec->status != CAV_OK) return;
  // heights from 0 to 1 over the range of the file, times the height asked for
  double low = INFINITY, high = -INFINITY;
  for (size_t i = 0; i < n; i++) {
    low = fmin(low, h->height[i]);
    high = fmax(high, h->height[i]);
  }
  for (size_t i = 0; i < n; i++) h->height[i] = high > low ? (h->height[i] - low) / (high - low) * h->size[2] : 0;
}

// --- geoms ---

// the geom at the mesh's own frame, with its mass
static void place_on_mesh(cav_spec *spec, cav_spec_geom *g, const cav_spec_mesh *m) {
  double turned[3];
  quat_rotate(turned, g->quat, m->pos);
  add3(g->pos, g->pos, turned);
  quat_mul(g->quat, g->quat, m->quat);
  copy3(g->size, m->half);
  double mass = g->has_mass ? g->mass : g->density * m->volume;
  g->inertia.mass = mass;
  if (m->volume > 0) scale3(g->inertia.moment, mass / m->volume, m->moment);
  if (m->volume == 0 && g->weighs)
    cav_spec_fail(
        spec, g->node, "mesh",
        "the mesh has no volume: it cannot weigh by itself; give the body an inertial element, and the geom a "
        "mass of 0");
}

// half lengths of the box that a shape is fitted to, and its middle, in the mesh's frame
static void box_of_mesh(cav_spec *spec, const cav_spec_geom *g, const cav_spec_mesh *m, double half[3], double at[3]) {
  zero3(at);
  if (spec->compiler.fit_box) {
    sub3(half, m->high, m->low);
    scale3(half, 0.5, half);
    add3(at, m->high, m->low);
    scale3(at, 0.5, at);
    return;
  }
  if (m->volume == 0)
    cav_spec_fail(spec, g->node, "mesh", "the mesh has no volume: no shape has its inertia; give the geom a size");
  double sum = m->moment[0] + m->moment[1] + m->moment[2];
  for (int k = 0; k < 3 && m->volume > 0; k++) half[k] = sqrt(fmax(0, 1.5 * (sum - 2 * m->moment[k]) / m->volume));
}

// MJCF's rules: round shapes take the mean (of the box of the inertia) or the larger (of the bounding box) half length
static void fit_to_mesh(cav_spec *spec, cav_spec_geom *g, const cav_spec_mesh *m) {
  double half[3] = {0, 0, 0}, at[3], turned[3];
  int box = spec->compiler.fit_box;
  box_of_mesh(spec, g, m, half, at);
  double across = box ? fmax(half[0], half[1]) : (half[0] + half[1]) / 2, along = half[2];
  switch (g->type) {
    case CAV_GEOM_SPHERE:
      across = box ? fmax(across, along) : (half[0] + half[1] + half[2]) / 3;
      set3(g->size, across, 0, 0);
      break;
    case CAV_GEOM_CAPSULE:
      set3(g->size, across, along - (box ? across : across / 2), 0);
      break;
    case CAV_GEOM_CYLINDER:
      set3(g->size, across, along, 0);
      break;
    case CAV_GEOM_ELLIPSOID:
    case CAV_GEOM_BOX:
      copy3(g->size, half);
      break;
    default:
      cav_spec_fail(spec, g->node, "mesh", "a plane or height field is not fitted to a mesh; name another type");
  }
  scale3(g->size, g->fitscale, g->size);
  quat_rotate(at, m->quat, at);
  add3(at, at, m->pos);
  quat_rotate(turned, g->quat, at);
  add3(g->pos, g->pos, turned);
  quat_mul(g->quat, g->quat, m->quat);
}

// meshes that collide, in the order of their geoms
static int number_meshes(cav_spec *spec) {
  int n = 0;
  for (int i = 0; i < spec->geom.n; i++) {
    const cav_spec_geom *g = &spec->geom.at[i];
    if (g->type == CAV_GEOM_MESH && spec->mesh.at[g->asset].index < 0) spec->mesh.at[g->asset].index = n++;
  }
  return n;
}

void cav_spec_assets(cav_spec *spec) {
  int fields = 0;
  number_meshes(spec);
  for (int i = 0; i < spec->geom.n && spec->status == CAV_OK; i++) {
    cav_spec_geom *g = &spec->geom.at[i];
    cav_spec_mesh *m = g->mesh || g->type == CAV_GEOM_MESH ? &spec->mesh.at[g->asset] : NULL;
    if (m && !m->loaded) load_mesh(spec, m);
    if (spec->status != CAV_OK) return;
    if (g->type == CAV_GEOM_MESH) {
      place_on_mesh(spec, g, m);
      g->bound = m->bound;
      g->asset = m->index;
    } else if (m) {
      fit_to_mesh(spec, g, m);
    } else if (g->type == CAV_GEOM_HFIELD) {
      cav_spec_hfield *h = &spec->hfield.at[g->asset];
      if (h->index < 0) {
        h->index = fields++;
        load_hfield(spec, h);
      }
      copy3(g->size, h->size);
      g->bound = hypot(hypot(h->size[0], h->size[1]), fmax(h->size[2], h->size[3]));
      g->asset = h->index;
    }
  }
}

// --- into the model ---

// position in a block; base NULL: only measures
typedef struct carver {
  char *base;
  size_t used;
} carver;

static void *put(carver *c, const void *from, size_t size) {
  size_t at = (c->used + 15) & ~(size_t)15;
  c->used = at + size;
  if (!c->base) return NULL;
  if (size) memcpy(c->base + at, from, size);
  return c->base + at;
}

static void put_mesh(carver *c, const cav_spec_mesh *m, cav_mesh *out) {
  const cav_hull *h = &m->hull;
  cav_mesh mesh = {.nvertex = h->nvertex, .nface = h->nface};
  mesh.name = put(c, m->name, strlen(m->name) + 1);
  mesh.vertex = put(c, h->vertex, sizeof *h->vertex * 3 * (size_t)h->nvertex);
  mesh.plane = put(c, h->plane, sizeof *h->plane * 4 * (size_t)h->nface);
  mesh.face = put(c, h->face, sizeof *h->face * ((size_t)h->nface + 1));
  mesh.corner = put(c, h->corner, sizeof *h->corner * (size_t)h->ncorner);
  mesh.neighbour_start = put(c, h->neighbour_start, sizeof *h->neighbour_start * ((size_t)h->nvertex + 1));
  mesh.neighbour = put(c, h->neighbour, sizeof *h->neighbour * (size_t)h->nneighbour);
  mesh.meeting_start = put(c, h->meeting_start, sizeof *h->meeting_start * ((size_t)h->nvertex + 1));
  mesh.meeting = put(c, h->meeting, sizeof *h->meeting * (size_t)h->nmeeting);
  mesh.summit = put(c, h->summit, sizeof *h->summit * CAV_DIRECTION_CELLS);
  const cav_triangles *t = &m->surface;
  mesh.npoint = t->nvertex;
  mesh.ntriangle = t->ntriangle;
  mesh.point = put(c, t->vertex, sizeof *t->vertex * 3 * (size_t)t->nvertex);
  mesh.triangle = put(c, t->triangle, sizeof *t->triangle * 3 * (size_t)t->ntriangle);
  if (out) *out = mesh;
}

static void put_hfield(carver *c, const cav_spec_hfield *h, cav_hfield *out) {
  cav_hfield field = {.nrow = h->nrow, .ncol = h->ncol, .size = {h->size[0], h->size[1]}};
  field.top = h->size[2];
  field.base = h->size[3];
  field.name = put(c, h->name, strlen(h->name) + 1);
  field.height = put(c, h->height, sizeof *h->height * (size_t)h->nrow * (size_t)h->ncol);
  if (out) *out = field;
}

size_t cav_put_assets(const cav_spec *spec, void *base, cav_model *model) {
  carver c = {base, 0};
  int meshes = 0, fields = 0;
  for (int i = 0; i < spec->mesh.n; i++) meshes += spec->mesh.at[i].index >= 0;
  for (int i = 0; i < spec->hfield.n; i++) fields += spec->hfield.at[i].index >= 0;
  c.used = sizeof(cav_mesh) * (size_t)meshes + sizeof(cav_hfield) * (size_t)fields;
  cav_mesh *mesh = base;
  cav_hfield *field = base ? (cav_hfield *)(mesh + meshes) : NULL;
  for (int i = 0; i < spec->mesh.n; i++) {
    const cav_spec_mesh *m = &spec->mesh.at[i];
    if (m->index >= 0) put_mesh(&c, m, base ? &mesh[m->index] : NULL);
  }
  for (int i = 0; i < spec->hfield.n; i++) {
    const cav_spec_hfield *h = &spec->hfield.at[i];
    if (h->index >= 0) put_hfield(&c, h, base ? &field[h->index] : NULL);
  }
  model->nmesh = meshes;
  model->nhfield = fields;
  model->mesh = meshes ? mesh : NULL;
  model->hfield = fields ? field : NULL;
  return c.used;
}

void cav_clear_assets(cav_spec *spec) {
  for (int i = 0; i < spec->mesh.n; i++) {
    cav_hull_clear(&spec->mesh.at[i].hull);
    cav_triangles_clear(&spec->mesh.at[i].surface);
  }
  for (int i = 0; i < spec->hfield.n; i++) free(spec->hfield.at[i].height);
  free(spec->mesh.at);
  free(spec->hfield.at);
}
