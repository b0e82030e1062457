/// Writes motions as one self-contained page: the template viewer/page.html with three.js and a block of JSON in its
/// places. Poses of the links at every knot come from the dynamics library; the page interpolates between them. Numbers
/// carry six digits (positions) or five, enough for the eye; the exact motion is in trajectory.csv. The page's own
/// scripts are in viewer/. Nothing here reads results from disk or computes forces: the caller hands them over.
#include "view.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "utf8.h"
#include "viewer_page.h"

// --- JSON ---

// a string of JSON that is safe inside a script element too: '<', '>' and '&' never appear as themselves
static void write_string(FILE *out, const char *text) {
  putc('"', out);
  for (const unsigned char *s = (const unsigned char *)(text ? text : ""); *s;) {
    int n = cav_utf8_length(s);
    if (n == 0) {
      fputs("\\ufffd", out);
      s++;
    } else if (n == 1 && (*s < 0x20 || *s == 0x7F || strchr("\"\\<>&", *s))) {
      fprintf(out, "\\u%04x", *s++);
    } else {
      fwrite(s, 1, (size_t)n, out);
      s += n;
    }
  }
  putc('"', out);
}

// a number of so many digits; what is not finite is null
static void write_number(FILE *out, double x, int digits) {
  if (isfinite(x)) {
    fprintf(out, "%.*g", digits, x == 0 ? 0.0 : x);
  } else {
    fputs("null", out);
  }
}

static void write_numbers(FILE *out, const double *x, int n, int digits) {
  putc('[', out);
  for (int i = 0; i < n; i++) {
    if (i > 0) putc(',', out);
    write_number(out, x[i], digits);
  }
  putc(']', out);
}

// --- parts of the motion ---

// meshes of more corners are drawn by those of a grid of cells along their largest side, the coarser the more meshes there
// are: what is finer no page shows, and a robot's sixty meshes would make it tens of megabytes
enum { CORNERS_SHOWN = 200, GRID_MOST = 20, GRID_LEAST = 8, CORNERS_IN_ALL = 45000 };

// a surface to draw
typedef struct surface {
  int npoint, ntriangle;
  const double *point;
  const int *triangle; ///< NULL: that of the hull's polygons
  const cav_mesh *mesh;
} surface;

static surface surface_of(const cav_mesh *m) {
  if (m->ntriangle) return (surface){m->npoint, m->ntriangle, m->point, m->triangle, m};
  return (surface){m->nvertex, 0, m->vertex, NULL, m};
}

// the corner that stands for each, of those in one cell the first; the identity where there are few. first: room for a cell
// each
static void thin_corners(const surface *s, int grid, int *first, int *stand_in) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, side = 0;
  for (int k = 0; k < 3; k++) {
    double high = -INFINITY;
    for (int v = 0; v < s->npoint; v++) {
      low[k] = fmin(low[k], s->point[3 * v + k]);
      high = fmax(high, s->point[3 * v + k]);
    }
    side = fmax(side, high - low[k]);
  }
  for (int i = 0; i < (grid + 1) * (grid + 1) * (grid + 1); i++) first[i] = -1;
  for (int v = 0; v < s->npoint; v++) {
    stand_in[v] = v;
    if (s->npoint <= CORNERS_SHOWN || !(side > 0)) continue;
    int cell = 0;
    for (int k = 0; k < 3; k++) cell = cell * (grid + 1) + (int)(grid * (s->point[3 * v + k] - low[k]) / side);
    if (first[cell] < 0) first[cell] = v;
    stand_in[v] = first[cell];
  }
}

static void write_triangle(FILE *out, const int *stand_in, const int *number, int a, int b, int c, const char **comma) {
  a = stand_in[a], b = stand_in[b], c = stand_in[c];
  if (a == b || b == c || c == a) return;
  fprintf(out, "%s%d,%d,%d", *comma, number[a], number[b], number[c]);
  *comma = ",";
}

// a mesh as corners and triangles: its surface, or else its hull
static void write_mesh(FILE *out, const cav_mesh *m, int grid) {
  static const int cells = (GRID_MOST + 1) * (GRID_MOST + 1) * (GRID_MOST + 1);
  surface s = surface_of(m);
  int *stand_in = malloc((2 * (size_t)s.npoint + (size_t)cells) * sizeof *stand_in), n = 0;
  if (!stand_in) {
    fputs(",\"corners\":[],\"triangles\":[]", out);
    return;
  }
  int *number = stand_in + s.npoint;
  thin_corners(&s, grid, number + s.npoint, stand_in);
  fputs(",\"corners\":[", out);
  for (int v = 0; v < s.npoint; v++) {
    if (stand_in[v] != v) continue;
    number[v] = n;
    for (int k = 0; k < 3; k++) {
      if (n > 0 || k > 0) putc(',', out);
      write_number(out, s.point[3 * v + k], 4);
    }
    n++;
  }
  fputs("],\"triangles\":[", out);
  const char *comma = "";
  for (int i = 0; i < s.ntriangle; i++) {
    const int *v = s.triangle + 3 * i;
    write_triangle(out, stand_in, number, v[0], v[1], v[2], &comma);
  }
  for (int f = 0; f < m->nface && !s.ntriangle; f++) {
    for (int k = m->face[f] + 2; k < m->face[f + 1]; k++)
      write_triangle(out, stand_in, number, m->corner[m->face[f]], m->corner[k - 1], m->corner[k], &comma);
  }
  putc(']', out);
  free(stand_in);
}

// at most so many cells of a height field along each side: a page is looked at, not measured
enum { CELLS_SHOWN = 64 };

static void write_hfield(FILE *out, const cav_hfield *h) {
  int rows = h->nrow - 1 < CELLS_SHOWN ? h->nrow - 1 : CELLS_SHOWN;
  int columns = h->ncol - 1 < CELLS_SHOWN ? h->ncol - 1 : CELLS_SHOWN;
  fputs(",\"corners\":[", out);
  for (int i = 0; i < (rows + 1) * (columns + 1); i++) {
    int r = i / (columns + 1) * (h->nrow - 1) / rows, c = i % (columns + 1) * (h->ncol - 1) / columns;
    double x[3] = {h->size[0] * (2.0 * c / (h->ncol - 1) - 1), h->size[1] * (2.0 * r / (h->nrow - 1) - 1),
                   h->height[r * h->ncol + c]};
    for (int k = 0; k < 3; k++) {
      if (i > 0 || k > 0) putc(',', out);
      write_number(out, x[k], 5);
    }
  }
  fputs("],\"triangles\":[", out);
  for (int i = 0; i < rows * columns; i++) {
    int at = i / columns * (columns + 1) + i % columns, up = at + columns + 1;
    fprintf(out, "%s%d,%d,%d,%d,%d,%d", i > 0 ? "," : "", at, at + 1, up + 1, at, up + 1, up);
  }
  putc(']', out);
}

static void write_geom(FILE *out, const cav_model *model, const cav_geom *geom, int link, int hidden, int grid) {
  static const char *const kind[CAV_GEOM_TYPES] = {"plane",    "sphere", "capsule", "ellipsoid",
                                                   "cylinder", "box",    "mesh",    "hfield"};
  const double rgba[4] = {(double)geom->rgba[0], (double)geom->rgba[1], (double)geom->rgba[2], (double)geom->rgba[3]};
  fputs("{\"name\":", out);
  write_string(out, geom->name);
  fputs(",\"body\":", out);
  write_string(out, model->body[geom->body].name);
  fprintf(out, ",\"type\":\"%s\",\"link\":%d,\"group\":%d,\"hidden\":%d,\"size\":", kind[geom->type], link, geom->group,
          hidden);
  write_numbers(out, geom->size, 3, 6);
  fputs(",\"pos\":", out);
  write_numbers(out, geom->pos, 3, 6);
  fputs(",\"quat\":", out);
  write_numbers(out, geom->quat, 4, 6);
  fputs(",\"rgba\":", out);
  write_numbers(out, rgba, 4, 4);
  // what is not drawn is there for its place and size alone
  if (geom->type == CAV_GEOM_MESH && !hidden) write_mesh(out, &model->mesh[geom->asset], grid);
  if (geom->type == CAV_GEOM_HFIELD) write_hfield(out, &model->hfield[geom->asset]);
  putc('}', out);
}

// whether a geom is there to be seen alone
static int only_seen(const cav_geom *geom) {
  return geom->type == CAV_GEOM_MESH && !geom->contype && !geom->conaffinity;
}

static int has_seen(const cav_model *drawn, int body) {
  if (body >= drawn->nbody) return 0;
  const cav_geom *geom = drawn->geom + drawn->body[body].geom;
  for (int i = 0; i < drawn->body[body].ngeom; i++)
    if (only_seen(&geom[i])) return 1;
  return 0;
}

static double corners_of(const cav_model *model, const cav_geom *geom) {
  if (geom->type != CAV_GEOM_MESH) return 0;
  return fmin(surface_of(&model->mesh[geom->asset]).npoint, 3 * GRID_MOST * GRID_MOST);
}

// cells along the largest side of a mesh: corners of a surface grow with their square
static int grid_of(const cav_model *model, const cav_model *drawn) {
  double corners = 1;
  for (int i = 0; i < model->ngeom; i++) corners += corners_of(model, &model->geom[i]);
  for (int i = 0; drawn && i < drawn->ngeom; i++)
    if (only_seen(&drawn->geom[i])) corners += corners_of(drawn, &drawn->geom[i]);
  return (int)fmin(GRID_MOST, fmax(GRID_LEAST, GRID_MOST * sqrt(CORNERS_IN_ALL / corners)));
}

// the model's geoms, in the order of their numbers; those of a body that has meshes to be seen are not drawn, the meshes
// follow all of them
static void write_geoms(FILE *out, const cav_model *model, const cav_model *drawn) {
  int grid = grid_of(model, drawn);
  fputs("\"geoms\":[", out);
  for (int i = 0; i < model->ngeom; i++) {
    const cav_geom *geom = &model->geom[i];
    fputs(i > 0 ? ",\n" : "\n", out);
    write_geom(out, model, geom, geom->link, drawn && geom->type != CAV_GEOM_PLANE && has_seen(drawn, geom->body),
               grid);
  }
  for (int i = 0; drawn && i < drawn->ngeom; i++) {
    const cav_geom *geom = &drawn->geom[i];
    if (!only_seen(geom)) continue;
    fputs(model->ngeom ? ",\n" : "\n", out);
    write_geom(out, drawn, geom, model->body[geom->body].link, 0, grid);
  }
  fputs("\n]", out);
}

// of every link mass and centre of mass, for the camera and the path of the centre of mass; the link before it, and where
// the joint that turns it is (null: none does)
static void write_links(FILE *out, const cav_model *model) {
  fputs("\"links\":[", out);
  for (int i = 0; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    fprintf(out, "%s{\"name\":", i > 0 ? "," : "");
    write_string(out, model->body[link->body].name);
    fputs(",\"mass\":", out);
    write_number(out, i > 0 ? link->mass : 0, 6);
    fputs(",\"com\":", out);
    write_numbers(out, link->com, 3, 6);
    fprintf(out, ",\"parent\":%d,\"joint\":", link->parent);
    int turns = 0;
    while (turns < link->njoint && model->joint[link->joint + turns].type != CAV_JOINT_HINGE &&
           model->joint[link->joint + turns].type != CAV_JOINT_BALL)
      turns++;
    if (turns < link->njoint)
      write_numbers(out, model->joint[link->joint + turns].pos, 3, 6);
    else
      fputs("null", out);
    putc('}', out);
  }
  putc(']', out);
}

// a row: position and quaternion of each link but the world
static cav_status write_pose(FILE *out, const cav_model *model, cav_state *state, const double *q) {
  cav_status status = cav_position(model, state, q);
  if (status) return status;
  putc('[', out);
  for (int i = 1; i < model->nlink; i++) {
    if (i > 1) putc(',', out);
    for (int k = 0; k < 3; k++) {
      write_number(out, state->link[i].pos[k], 6);
      putc(',', out);
    }
    for (int k = 0; k < 4; k++) {
      if (k > 0) putc(',', out);
      write_number(out, state->link[i].quat[k], 5);
    }
  }
  putc(']', out);
  return CAV_OK;
}

// one row per knot, and that of the goal
static cav_status write_poses(FILE *out, const cav_model *model, const cav_view_input *input, cav_error *error) {
  cav_state *state = cav_state_new(model);
  if (!state) return cav_file_fail(error, CAV_NO_MEMORY, 0, "view: out of memory");
  // contacts are the caller's; here only poses count
  state->options.contact = 0;
  cav_status status = CAV_OK;
  fputs("\"poses\":[", out);
  for (int t = 0; t < input->nknot && status == CAV_OK; t++) {
    fputs(t > 0 ? ",\n" : "\n", out);
    status = write_pose(out, model, state, input->q + (size_t)t * (size_t)model->nq);
    if (status)
      cav_file_fail(error, status, 0, "view: the configuration at knot %d has no poses (%s)", t,
                    cav_status_name(status));
  }
  fputs("\n],\n\"goal\":", out);
  if (!status && input->goal) {
    status = write_pose(out, model, state, input->goal);
    if (status) cav_file_fail(error, status, 0, "view: the goal has no poses (%s)", cav_status_name(status));
  } else {
    fputs("null", out);
  }
  cav_state_free(state);
  return status;
}

// one row per knot: of each contact position, force, normal, friction and both links, one after the other
static void write_forces(FILE *out, const cav_view_input *input) {
  if (!input->nforce) {
    fputs("\"forces\":null", out);
    return;
  }
  const cav_view_force *force = input->force;
  fputs("\"forces\":[", out);
  for (int t = 0; t < input->nknot; t++) {
    fprintf(out, "%s[", t > 0 ? ",\n" : "\n");
    for (int i = 0; i < input->nforce[t]; i++, force++) {
      const double number[10] = {force->pos[0],    force->pos[1],   force->pos[2],    force->force[0],
                                 force->force[1],  force->force[2], force->normal[0], force->normal[1],
                                 force->normal[2], force->friction};
      for (int k = 0; k < 10; k++) {
        if (i > 0 || k > 0) putc(',', out);
        write_number(out, number[k], k < 3 ? 5 : 4);
      }
      fprintf(out, ",%d,%d", force->link1, force->link2);
    }
    putc(']', out);
  }
  fputs("\n]", out);
}

static void write_targets(FILE *out, const cav_view_input *input) {
  fputs("\"targets\":[", out);
  for (int i = 0; i < input->ntarget; i++) {
    const cav_view_target *target = &input->target[i];
    fprintf(out, "%s{\"name\":", i > 0 ? ",\n" : "\n");
    write_string(out, target->name);
    fprintf(out, ",\"from\":%d,\"to\":%d,\"pos\":", target->from, target->to);
    write_numbers(out, target->pos, 3, 5);
    fputs(",\"got\":", out);
    write_numbers(out, target->got, 3, 5);
    putc('}', out);
  }
  fputs("\n]", out);
}

static void write_series(FILE *out, const cav_view_input *input) {
  fputs("\"series\":[", out);
  for (int i = 0; i < input->nseries; i++) {
    const cav_view_series *series = &input->series[i];
    fprintf(out, "%s{\"group\":", i > 0 ? ",\n" : "\n");
    write_string(out, series->group);
    fputs(",\"name\":", out);
    write_string(out, series->name);
    fputs(",\"unit\":", out);
    write_string(out, series->unit);
    fputs(",\"lower\":", out);
    write_number(out, series->lower, 5);
    fputs(",\"upper\":", out);
    write_number(out, series->upper, 5);
    fprintf(out, ",\"share\":%d,\"value\":", series->share);
    write_numbers(out, series->value, input->nknot, 5);
    fputs(",\"wanted\":", out);
    if (series->wanted)
      write_numbers(out, series->wanted, input->nknot, 5);
    else
      fputs("null", out);
    putc('}', out);
  }
  fputs("\n]", out);
}

static void write_verdict(FILE *out, const cav_view_input *input) {
  fputs("\"verdict\":[", out);
  for (int i = 0; i < input->nline; i++) {
    fprintf(out, "%s{\"label\":", i > 0 ? ",\n" : "\n");
    write_string(out, input->line[i].label);
    fputs(",\"value\":", out);
    write_string(out, input->line[i].value);
    fprintf(out, ",\"passed\":%d}", input->line[i].passed);
  }
  fputs("\n]", out);
}

static cav_status write_motion(FILE *out, const cav_view_input *input, cav_error *error) {
  const cav_model *model = input->model;
  const double *g = model->gravity;
  fputs("{\"title\":", out);
  write_string(out, input->title);
  fputs(",\"label\":", out);
  write_string(out, input->label);
  fputs(",\"model\":", out);
  write_string(out, model->name);
  fprintf(out, ",\"nknot\":%d,\"timestep\":", input->nknot);
  write_number(out, input->timestep, 12);
  fputs(",\"weight\":", out);
  write_number(out, model->mass * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]), 6);
  fputs(",\n", out);
  write_geoms(out, model, input->drawn);
  fputs(",\n", out);
  write_links(out, model);
  fputs(",\n", out);
  cav_status status = write_poses(out, model, input, error);
  if (status != CAV_OK) return status;
  fputs(",\n", out);
  write_forces(out, input);
  fputs(",\n", out);
  write_targets(out, input);
  fputs(",\n", out);
  write_series(out, input);
  fputs(",\n", out);
  write_verdict(out, input);
  putc('}', out);
  return CAV_OK;
}

static cav_status write_data(FILE *out, int n, const cav_view_input *input, cav_error *error) {
  cav_status status = CAV_OK;
  for (int i = 0; i < n && !status; i++) {
    fputs(i ? ",\n" : "[", out);
    status = write_motion(out, &input[i], error);
  }
  fputs("]\n", out);
  return status;
}

// --- the page ---

// whole file as text; NULL with the reason in error
static char *read_text(const char *path, cav_error *error) {
  FILE *file = fopen(path, "rb");
  if (!file) {
    cav_file_fail(
        error, CAV_BAD_INPUT, 0,
        "view: cannot read three.js at %s (%s). Install libjs-three, or set CAVORT_THREE_JS to a three.min.js of your "
        "own",
        path, strerror(errno));
    return NULL;
  }
  size_t size = 0, room = (size_t)1 << 20;
  char *text = malloc(room);
  while (text) {
    size += fread(text + size, 1, room - size - 1, file);
    if (size < room - 1) break;
    room *= 2;
    char *more = realloc(text, room);
    if (!more) free(text);
    text = more;
  }
  int broken = ferror(file);
  fclose(file);
  if (!text) {
    cav_file_fail(error, CAV_NO_MEMORY, 0, "view: out of memory");
    return NULL;
  }
  text[size] = 0;
  if (broken || strlen(text) != size || size == 0) {
    cav_file_fail(error, CAV_BAD_INPUT, 0,
                  "view: %s is not the text of three.js; set CAVORT_THREE_JS to a three.min.js", path);
    free(text);
    return NULL;
  }
  return text;
}

// where an element of script would end inside text, any case; NULL: nowhere
static const char *script_end(const char *text) {
  static const char end[] = "/script";
  for (const char *s = strchr(text, '<'); s; s = strchr(s + 1, '<')) {
    size_t i = 0;
    while (end[i] && (s[1 + i] | (end[i] == '/' ? 0 : 0x20)) == end[i]) i++;
    if (!end[i]) return s;
  }
  return NULL;
}

// the script of three.js, checked to be fit for a script element
static char *read_three(cav_error *error) {
  const char *path = getenv("CAVORT_THREE_JS");
  if (!path || !*path) path = CAVORT_THREE_JS;
  char *text = read_text(path, error);
  if (text && (script_end(text) || strstr(text, "<!--"))) {
    cav_file_fail(error, CAV_BAD_INPUT, 0,
                  "view: %s cannot stand inside a page (it holds </script or <!--); use another build of three.js",
                  path);
    free(text);
    return NULL;
  }
  return text;
}

// the template with both places filled
static cav_status write_page(FILE *out, const char *three, int n, const cav_view_input *input, cav_error *error) {
  static const char place_three[] = "/*CAVORT_THREE*/", place_data[] = "{\"CAVORT_DATA\":0}";
  const char *page = (const char *)viewer_page;
  const char *at_three = strstr(page, place_three), *at_data = strstr(page, place_data);
  if (!at_three || !at_data || at_data > at_three)
    return cav_file_fail(error, CAV_INTERNAL, 0, "view: the template has lost its places");
  fwrite(page, 1, (size_t)(at_data - page), out);
  cav_status status = write_data(out, n, input, error);
  if (status != CAV_OK) return status;
  at_data += sizeof place_data - 1;
  fwrite(at_data, 1, (size_t)(at_three - at_data), out);
  fputs(three, out);
  fputs(at_three + sizeof place_three - 1, out);
  return CAV_OK;
}

static cav_status check_input(const cav_view_input *input, cav_error *error) {
  int nq = input->model->nq;
  if (input->nknot < 1 || !input->q) return cav_file_fail(error, CAV_BAD_INPUT, 0, "view: there is no knot to show");
  if (!(isfinite(input->timestep) && input->timestep > 0))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "view: the time step is %g s; it has to be positive",
                         input->timestep);
  for (int t = 0; t < input->nknot; t++) {
    for (int i = 0; i < nq; i++) {
      if (!isfinite(input->q[(size_t)t * (size_t)nq + (size_t)i]))
        return cav_file_fail(error, CAV_NOT_FINITE, 0, "view: q[%d] at knot %d is not a finite number", i, t);
    }
  }
  return CAV_OK;
}

cav_status cav_view_write(const char *path, int n, const cav_view_input *input, cav_error *error) {
  cav_error unasked;
  if (!error) error = &unasked;
  assert(n == 1 || n == 2);
  cav_status status = CAV_OK;
  for (int i = 0; i < n && !status; i++) status = check_input(&input[i], error);
  if (status != CAV_OK) return status;
  char *three = read_three(error);
  if (!three) return error->status;

  cav_file file;
  status = cav_file_begin(&file, path, error);
  if (status == CAV_OK) {
    status = write_page(file.stream, three, n, input, error);
    if (status == CAV_OK) {
      status = cav_file_end(&file, error);
    } else {
      cav_file_abandon(&file);
    }
  }
  free(three);
  return status;
}
