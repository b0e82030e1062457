/// Reads meshes, STL (binary and text) and OBJ, as plain triangles, and integrates their volume.
///
/// STL: colours and normals are not read. OBJ: positions and faces only; polygons are cut into fans, negative indices
/// count from the end; normals, texture, groups, materials, curves and lines are passed over. Every count is checked
/// against the size of the file before memory is taken, every index against the vertices, every number must be finite.
/// Not done: other formats, several solids kept apart.
#include "mesh.h"

#include <locale.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <strings.h>
#include <sys/stat.h>

#include "math3.h"

enum { FILE_LIMIT = 128 << 20, VERTEX_LIMIT = 3000000, POLYGON_LIMIT = 1000 };

/// Text being read.
typedef struct text {
  const char *at, *end;
  int line;
  char *reason;
  size_t room;
  cav_status status;
  int vertex_room, triangle_room;
} text;

__attribute__((format(printf, 3, 4))) static void fail(text *t, cav_status status, const char *format, ...) {
  if (t->status != CAV_OK) return;
  t->status = status;
  int used = t->line > 0 ? snprintf(t->reason, t->room, "line %d: ", t->line) : 0;
  va_list args;
  va_start(args, format);
  if (used >= 0 && (size_t)used < t->room) vsnprintf(t->reason + used, t->room - (size_t)used, format, args);
  va_end(args);
}

// --- growing lists ---

static int list_grow(text *t, void **list, int *room, int n, size_t size) {
  if (n < *room) return 1;
  int more = 2 * *room + 256;
  void *moved = realloc(*list, (size_t)more * size);
  if (!moved) {
    fail(t, CAV_NO_MEMORY, "no memory for the mesh");
    return 0;
  }
  *list = moved;
  *room = more;
  return 1;
}

static void push_vertex(text *t, cav_triangles *m, const double x[3]) {
  if (m->nvertex >= VERTEX_LIMIT) fail(t, CAV_BAD_INPUT, "more than %d vertices; make the mesh coarser", VERTEX_LIMIT);
  if (t->status != CAV_OK || !list_grow(t, (void **)&m->vertex, &t->vertex_room, m->nvertex, 3 * sizeof(double)))
    return;
  copy3(m->vertex + 3 * m->nvertex++, x);
}

static void push_triangle(text *t, cav_triangles *m, int a, int b, int c) {
  if (m->ntriangle >= VERTEX_LIMIT) fail(t, CAV_BAD_INPUT, "more than %d triangles; make it coarser", VERTEX_LIMIT);
  if (t->status != CAV_OK || !list_grow(t, (void **)&m->triangle, &t->triangle_room, m->ntriangle, 3 * sizeof(int)))
    return;
  int *v = m->triangle + 3 * m->ntriangle++;
  v[0] = a;
  v[1] = b;
  v[2] = c;
}

// --- words of a text ---

static int is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// next word of the line; 0 at its end
static int next_word(text *t, const char **word, int *length) {
  while (t->at < t->end && is_blank(*t->at)) t->at++;
  *word = t->at;
  while (t->at < t->end && !is_blank(*t->at) && *t->at != '\n') t->at++;
  *length = (int)(t->at - *word);
  return *length > 0;
}

static int next_line(text *t) {
  while (t->at < t->end && *t->at != '\n') t->at++;
  if (t->at == t->end) return 0;
  t->at++;
  t->line++;
  return t->at < t->end;
}

static int is_word(const char *word, int length, const char *other) {
  return (int)strlen(other) == length && !strncasecmp(word, other, (size_t)length);
}

static double read_number(text *t) {
  const char *word;
  char copy[64], *end;
  int length;
  if (!next_word(t, &word, &length) || length >= (int)sizeof copy) {
    fail(t, CAV_BAD_INPUT, "expected a number; three are needed");
    return 0;
  }
  memcpy(copy, word, (size_t)length);
  copy[length] = 0;
  double number = strtod(copy, &end);
  if (*end || !isfinite(number)) fail(t, CAV_BAD_INPUT, "expected a finite number, got '%.30s'", copy);
  return number;
}

static void read_vertex(text *t, cav_triangles *m) {
  double x[3];
  for (int k = 0; k < 3; k++) x[k] = read_number(t);
  push_vertex(t, m, x);
}

// --- STL ---

static double float_at(const char *p) {
  float value;
  unsigned bits = (unsigned char)p[0] | (unsigned)(unsigned char)p[1] << 8 | (unsigned)(unsigned char)p[2] << 16 |
                  (unsigned)(unsigned char)p[3] << 24;
  memcpy(&value, &bits, sizeof value);
  return (double)value;
}

static void read_binary_stl(text *t, size_t count, cav_triangles *m) {
  for (size_t i = 0; i < count && t->status == CAV_OK; i++) {
    const char *facet = t->at + 84 + 50 * i + 12;
    for (int k = 0; k < 3; k++) {
      const double x[3] = {float_at(facet + 12 * k), float_at(facet + 12 * k + 4), float_at(facet + 12 * k + 8)};
      if (!all_finite(x, 3)) fail(t, CAV_BAD_INPUT, "triangle %zu has a coordinate that is not finite", i + 1);
      push_vertex(t, m, x);
    }
    push_triangle(t, m, m->nvertex - 3, m->nvertex - 2, m->nvertex - 1);
  }
}

// "vertex x y z" three by three; all other words are passed over
static void read_text_stl(text *t, cav_triangles *m) {
  t->line = 1;
  do {
    const char *word;
    int length;
    if (!next_word(t, &word, &length)) continue;
    if (is_word(word, length, "vertex")) read_vertex(t, m);
    if (is_word(word, length, "endloop")) {
      if (m->nvertex % 3 || m->nvertex != 3 * (m->ntriangle + 1))
        fail(t, CAV_BAD_INPUT, "a facet needs three vertices");
      push_triangle(t, m, m->nvertex - 3, m->nvertex - 2, m->nvertex - 1);
    }
  } while (t->status == CAV_OK && next_line(t));
  if (m->nvertex != 3 * m->ntriangle) fail(t, CAV_BAD_INPUT, "the last facet is not closed");
}

static cav_status finish(text *t, cav_triangles *m) {
  if (t->status == CAV_OK && !m->ntriangle) {
    t->line = 0;
    fail(t, CAV_BAD_INPUT, "no triangle inside");
  }
  if (t->status != CAV_OK) cav_triangles_clear(m);
  return t->status;
}

cav_status cav_mesh_read_stl(const char *bytes, size_t size, cav_triangles *m, char *reason, size_t room) {
  text t = {.at = bytes, .end = bytes + size, .reason = reason, .room = room};
  *m = (cav_triangles){0};
  size_t count = 0;
  for (int k = 0; k < 4 && size >= 84; k++) count |= (size_t)(unsigned char)bytes[80 + k] << 8 * k;
  // the count of a binary file says its size; a text starts with the word solid
  if (size >= 84 && count <= (size - 84) / 50 && size == 84 + 50 * count)
    read_binary_stl(&t, count, m);
  else if (size > 5 && !strncasecmp(bytes, "solid", 5))
    read_text_stl(&t, m);
  else
    fail(&t, CAV_BAD_INPUT, "%zu bytes are no STL: neither a text that starts with solid nor 84 + 50 n bytes", size);
  return finish(&t, m);
}

// --- OBJ ---

// "7", "7/1", "7//3": the first number; negative ones count from the end
static int read_index(text *t, const cav_triangles *m, const char *word, int length) {
  char copy[32];
  int used = length < 31 ? length : 31;
  memcpy(copy, word, (size_t)used);
  copy[used] = 0;
  long i = strtol(copy, NULL, 10);
  if (i < 0) i += m->nvertex + 1;
  if (i < 1 || i > m->nvertex) {
    fail(t, CAV_BAD_INPUT, "'%s' is no vertex: %d are given so far", copy, m->nvertex);
    return 0;
  }
  return (int)i - 1;
}

static void read_polygon(text *t, cav_triangles *m) {
  const char *word;
  int length, first = 0, last = 0, n = 0;
  for (; next_word(t, &word, &length) && t->status == CAV_OK && *word != '#'; n++) {
    int i = read_index(t, m, word, length);
    if (n == 0) first = i;
    if (n >= 2) push_triangle(t, m, first, last, i);
    last = i;
    if (n >= POLYGON_LIMIT) fail(t, CAV_BAD_INPUT, "a polygon of more than %d corners", POLYGON_LIMIT);
  }
  if (n < 3) fail(t, CAV_BAD_INPUT, "a face needs three vertices or more");
}

cav_status cav_mesh_read_obj(const char *bytes, size_t size, cav_triangles *m, char *reason, size_t room) {
  text t = {.at = bytes, .end = bytes + size, .line = 1, .reason = reason, .room = room};
  *m = (cav_triangles){0};
  if (size) {
    do {
      const char *word;
      int length;
      if (!next_word(&t, &word, &length)) continue;
      if (is_word(word, length, "v")) read_vertex(&t, m);
      if (is_word(word, length, "f")) read_polygon(&t, m);
    } while (t.status == CAV_OK && next_line(&t));
  }
  return finish(&t, m);
}

// --- files ---

static char *load(text *t, const char *path, size_t *size) {
  struct stat info;
  FILE *file = stat(path, &info) || !S_ISREG(info.st_mode) ? NULL : fopen(path, "rb");
  if (!file) {
    fail(t, CAV_BAD_INPUT, "cannot be opened; check the path");
    return NULL;
  }
  char *bytes = NULL;
  if (info.st_size > FILE_LIMIT)
    fail(t, CAV_BAD_INPUT, "%lld bytes are more than is read (%d MB)", (long long)info.st_size, FILE_LIMIT >> 20);
  else if (!(bytes = malloc((size_t)info.st_size + 1)))
    fail(t, CAV_NO_MEMORY, "no memory for %lld bytes", (long long)info.st_size);
  else
    *size = fread(bytes, 1, (size_t)info.st_size, file);
  fclose(file);
  return bytes;
}

cav_status cav_mesh_read(const char *path, cav_triangles *m, char *reason, size_t room) {
  text t = {.reason = reason, .room = room};
  *m = (cav_triangles){0};
  const char *dot = strrchr(path, '.');
  int stl = dot && !strcasecmp(dot, ".stl"), obj = dot && !strcasecmp(dot, ".obj");
  if (dot && !strcasecmp(dot, ".dae")) return cav_mesh_read_dae(path, m, reason, room);
  if (!stl && !obj) {
    fail(&t, CAV_BAD_INPUT, "expected a file that ends in .stl, .obj or .dae; convert it");
    return t.status;
  }
  size_t size = 0;
  char *bytes = load(&t, path, &size);
  locale_t plain = bytes ? newlocale(LC_NUMERIC_MASK, "C", (locale_t)0) : (locale_t)0;
  if (bytes && !plain) fail(&t, CAV_NO_MEMORY, "no memory for the mesh");
  if (plain) {
    // numbers are read with a point whatever the program's language is
    locale_t users = uselocale(plain);
    t.status = (stl ? cav_mesh_read_stl : cav_mesh_read_obj)(bytes, size, m, reason, room);
    uselocale(users);
    freelocale(plain);
  }
  free(bytes);
  return t.status;
}

void cav_triangles_clear(cav_triangles *m) {
  free(m->vertex);
  free(m->triangle);
  *m = (cav_triangles){0};
}

// --- volume ---

// middle of the surface: centroids of the triangles weighed by area
static void middle_of(const cav_triangles *m, double middle[3]) {
  double area = 0;
  zero3(middle);
  for (int i = 0; i < m->ntriangle; i++) {
    const int *v = m->triangle + 3 * i;
    const double *a = m->vertex + 3 * v[0], *b = m->vertex + 3 * v[1], *c = m->vertex + 3 * v[2];
    double u[3], w[3], n[3], sum[3];
    sub3(u, b, a);
    sub3(w, c, a);
    cross3(n, u, w);
    add3(sum, a, b);
    add3(sum, sum, c);
    axpy3(middle, middle, norm3(n) / 3, sum);
    area += norm3(n);
  }
  if (area > 0)
    scale3(middle, 1 / area, middle);
  else
    copy3(middle, m->vertex);
}

static double area_of(double x[3][3]) {
  double u[3], w[3], n[3];
  sub3(u, x[1], x[0]);
  sub3(w, x[2], x[0]);
  cross3(n, u, w);
  return norm3(n) / 2;
}

// size, first and second moments about an apex: xx yy zz xy xz yz
typedef struct sums {
  double size, first[3], second[6];
} sums;

// of pyramids from the apex to each triangle, or of the triangles themselves
static sums sum_up(const cav_triangles *m, cav_mesh_inertia what, const double apex[3]) {
  static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
  int shell = what == CAV_MESH_SHELL;
  sums s = {0};
  for (int i = 0; i < m->ntriangle; i++) {
    double x[3][3], c[3], sum[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
      sub3(x[k], m->vertex + 3 * m->triangle[3 * i + k], apex);
      add3(sum, sum, x[k]);
    }
    cross3(c, x[1], x[2]);
    double v = dot3(x[0], c) / 6;
    if (what == CAV_MESH_LEGACY) v = fabs(v);
    if (shell) v = area_of(x);
    s.size += v;
    axpy3(s.first, s.first, v / (shell ? 3 : 4), sum);
    for (int k = 0; k < 6; k++) {
      double squares = sum[row[k]] * sum[column[k]];
      for (int j = 0; j < 3; j++) squares += x[j][row[k]] * x[j][column[k]];
      s.second[k] += v / (shell ? 12 : 20) * squares;
    }
  }
  return s;
}

cav_bulk cav_mesh_bulk(const cav_triangles *m, cav_mesh_inertia what) {
  cav_bulk bulk = {0};
  double middle[3], d[3] = {0, 0, 0};
  middle_of(m, middle);
  sums s = sum_up(m, what, middle);
  // triangles that are clockwise from outside enclose a negative volume
  double sign = s.size < 0 ? -1 : 1;
  if (s.size != 0) scale3(d, 1 / s.size, s.first);
  add3(bulk.centre, middle, d);
  // where no pyramid is negative their sizes depend on the apex: MuJoCo takes those from the centre
  if (what == CAV_MESH_LEGACY) s = sum_up(m, what, bulk.centre), zero3(d);
  bulk.volume = sign * s.size;
  double *S = s.second;
  for (int k = 0; k < 3; k++) S[k] = sign * (S[k] - s.size * d[k] * d[k]);
  S[3] = sign * (S[3] - s.size * d[0] * d[1]);
  S[4] = sign * (S[4] - s.size * d[0] * d[2]);
  S[5] = sign * (S[5] - s.size * d[1] * d[2]);
  const double inertia[6] = {S[1] + S[2], S[0] + S[2], S[0] + S[1], -S[3], -S[4], -S[5]};
  memcpy(bulk.inertia, inertia, sizeof inertia);
  return bulk;
}
