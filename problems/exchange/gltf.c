/// A motion as binary glTF 2.0 (Khronos, ISO/IEC 12113): a node a link, in the tree that joints make, with the shapes of
/// its geoms as children, and one animation that moves and turns the links against their parents. glTF is y up: all
/// hangs from a node that is turned.
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "certificate.h"
#include "exchange.h"
#include "file.h"
#include "math3.h"
#include "shape.h"

enum { FLOATS = 5126, UNSIGNED = 5125, VERTICES = 34962, INDICES = 34963 };

// a file on its way: lists of its JSON, and the bytes that they look into
typedef struct gltf {
  FILE *view, *accessor, *mesh, *node, *channel, *sampler; ///< open_memstream of text[]
  char *text[6];
  size_t length[6];
  unsigned char *byte;
  size_t nbyte, room;
  int nview, nmesh, nsampler, failed;
} gltf;

static int open_lists(gltf *g) {
  FILE **list[] = {&g->view, &g->accessor, &g->mesh, &g->node, &g->channel, &g->sampler};
  for (int i = 0; i < 6; i++)
    if (!(*list[i] = open_memstream(&g->text[i], &g->length[i]))) return 0;
  return 1;
}

static void close_lists(gltf *g) {
  FILE *list[] = {g->view, g->accessor, g->mesh, g->node, g->channel, g->sampler};
  for (int i = 0; i < 6; i++)
    if (list[i] && fclose(list[i]) != 0) g->failed = 1;
}

static void free_lists(gltf *g) {
  for (int i = 0; i < 6; i++) free(g->text[i]);
  free(g->byte);
}

static const char *comma(int n) { return n ? ",\n" : ""; }

// an array of n elements of width numbers; the index of its accessor. target: of the view, 0: none; bounds 1: told
static int add_array(gltf *g, const void *data, int n, int width, int type, int target, int bounds) {
  static const char *const kind[] = {"", "SCALAR", "", "VEC3", "VEC4"};
  size_t bytes = (size_t)n * (size_t)width * 4, at = g->nbyte;
  if (at + bytes > g->room) {
    size_t room = 2 * (at + bytes);
    unsigned char *more = realloc(g->byte, room);
    if (!more) return g->failed = 1, 0;
    g->byte = more;
    g->room = room;
  }
  memcpy(g->byte + at, data, bytes);
  g->nbyte += bytes;
  fprintf(g->view, "%s{\"buffer\":0,\"byteOffset\":%zu,\"byteLength\":%zu", comma(g->nview), at, bytes);
  if (target) fprintf(g->view, ",\"target\":%d", target);
  fputc('}', g->view);
  fprintf(g->accessor, "%s{\"bufferView\":%d,\"componentType\":%d,\"count\":%d,\"type\":\"%s\"", comma(g->nview),
          g->nview, type, n, kind[width]);
  for (int end = 0; end < 2 && bounds; end++) {
    fprintf(g->accessor, ",\"%s\":[", end ? "max" : "min");
    for (int k = 0; k < width; k++) {
      float best = ((const float *)data)[k];
      for (int i = 1; i < n; i++) {
        float x = ((const float *)data)[i * width + k];
        if (end ? x > best : x < best) best = x;
      }
      fprintf(g->accessor, "%s%.9g", k ? "," : "", (double)best);
    }
    fputc(']', g->accessor);
  }
  fputc('}', g->accessor);
  return g->nview++;
}

static void write_vector(FILE *out, const char *name, const double *x, int n) {
  fprintf(out, ",\"%s\":[", name);
  for (int k = 0; k < n; k++) fprintf(out, "%s%.9g", k ? "," : "", x[k]);
  fputc(']', out);
}

// (x, y, z, w), as glTF has quaternions
static void write_pose(FILE *out, const double pos[3], const double quat[4]) {
  const double xyzw[4] = {quat[1], quat[2], quat[3], quat[0]};
  write_vector(out, "translation", pos, 3);
  write_vector(out, "rotation", xyzw, 4);
}

// half of a plane's square: all that moves is above it
static double reach(const cav_recording *r, const cav_pose *pose) {
  double most = 0;
  for (int i = 0; i < r->n * r->model->nlink; i++) most = fmax(most, hypot(pose[i].pos[0], pose[i].pos[1]));
  return ceil(most) + 2;
}

// meshes of geoms, one material each; mesh[i]: its index, -1: there is nothing to see
static void add_shapes(gltf *g, const cav_recording *r, double plane, int *mesh, FILE *material) {
  const cav_model *m = r->model;
  for (int i = 0; i < m->ngeom; i++) {
    cav_shape s;
    cav_shape_of(&s, m, i, plane);
    g->failed |= s.failed;
    mesh[i] = -1;
    if (s.nindex && !s.failed && m->geom[i].rgba[3] > 0) {
      int at = add_array(g, s.vertex, s.nvertex, 3, FLOATS, VERTICES, 1);
      add_array(g, s.normal, s.nvertex, 3, FLOATS, VERTICES, 0);
      add_array(g, s.index, s.nindex, 1, UNSIGNED, INDICES, 0);
      fprintf(g->mesh,
              "%s{\"primitives\":[{\"attributes\":{\"POSITION\":%d,\"NORMAL\":%d},\"indices\":%d,\"material\":%d}]}",
              comma(g->nmesh), at, at + 1, at + 2, g->nmesh);
      const float *c = m->geom[i].rgba;
      fprintf(material,
              "%s{\"pbrMetallicRoughness\":{\"baseColorFactor\":[%.4g,%.4g,%.4g,%.4g],\"metallicFactor\":0,"
              "\"roughnessFactor\":0.7}%s}",
              comma(g->nmesh), fmin(1, fmax(0, (double)c[0])), fmin(1, fmax(0, (double)c[1])),
              fmin(1, fmax(0, (double)c[2])), fmin(1, (double)c[3]), c[3] < 1 ? ",\"alphaMode\":\"BLEND\"" : "");
      mesh[i] = g->nmesh++;
    }
    cav_shape_free(&s);
  }
}

// pose of a link against its parent
static void local_pose(const cav_model *m, const cav_pose *row, int link, double pos[3], double quat[4]) {
  const cav_pose *own = &row[link], *parent = &row[m->link[link].parent];
  double back[4], d[3];
  sub3(d, own->pos, parent->pos);
  rotate_back(pos, parent->rotation, d);
  quat_conjugate(back, parent->quat);
  quat_mul(quat, back, own->quat);
  quat_normalise(quat);
}

// node 0 turns z up into y up, 1 + i is link i, then come geoms
static void add_nodes(gltf *g, const cav_recording *r, const cav_pose *pose, const int *mesh) {
  const cav_model *m = r->model;
  char label[96];
  fputs("{\"name\":\"z up\",\"rotation\":[-0.707106781,0,0,0.707106781],\"children\":[1]}", g->node);
  for (int i = 0; i < m->nlink; i++) {
    double pos[3], quat[4];
    fputs(",\n{\"name\":", g->node);
    cav_certificate_json_text(g->node, cav_recording_body_name(m, m->link[i].body, label));
    if (i) local_pose(m, pose, i, pos, quat), write_pose(g->node, pos, quat);
    int n = 0, number = 1 + m->nlink;
    for (int k = 1; k < m->nlink; k++)
      if (m->link[k].parent == i) fprintf(g->node, "%s%d", n++ ? "," : ",\"children\":[", 1 + k);
    for (int k = 0; k < m->ngeom; k++) {
      if (mesh[k] >= 0 && m->geom[k].link == i) fprintf(g->node, "%s%d", n++ ? "," : ",\"children\":[", number);
      number += mesh[k] >= 0;
    }
    fputs(n ? "]}" : "}", g->node);
  }
  for (int k = 0; k < m->ngeom; k++) {
    char geom[CAV_GEOM_LABEL];
    if (mesh[k] < 0) continue;
    fputs(",\n{\"name\":", g->node);
    cav_certificate_json_text(g->node, cav_geom_label(m, k, geom));
    write_pose(g->node, m->geom[k].pos, m->geom[k].quat);
    fprintf(g->node, ",\"mesh\":%d}", mesh[k]);
  }
}

static void add_channel(gltf *g, int node, const char *path, const float *x, int n, int width, int time) {
  int output = add_array(g, x, n, width, FLOATS, 0, 0);
  fprintf(g->sampler, "%s{\"input\":%d,\"output\":%d,\"interpolation\":\"LINEAR\"}", comma(g->nsampler), time, output);
  fprintf(g->channel, "%s{\"sampler\":%d,\"target\":{\"node\":%d,\"path\":\"%s\"}}", comma(g->nsampler), g->nsampler,
          node, path);
  g->nsampler++;
}

// every link turns; those whose place at their parent changes are moved too
static void add_motion(gltf *g, const cav_recording *r, const cav_pose *pose) {
  const cav_model *m = r->model;
  float *x = malloc((size_t)r->n * 4 * sizeof *x), *y = malloc((size_t)r->n * 3 * sizeof *y);
  if (!x || !y) {
    g->failed = 1;
  } else {
    for (int i = 0; i < r->n; i++) x[i] = (float)(i * r->timestep);
    int time = add_array(g, x, r->n, 1, FLOATS, 0, 1);
    for (int k = 1; k < m->nlink; k++) {
      double before[4] = {1, 0, 0, 0}, first[3], moved = 0;
      for (int i = 0; i < r->n; i++) {
        double pos[3], quat[4];
        local_pose(m, pose + (size_t)i * (size_t)m->nlink, k, pos, quat);
        // of q and -q the one next to the sample before: linear between them is the short way
        double sign = before[0] * quat[0] + dot3(before + 1, quat + 1) < 0 ? -1 : 1;
        for (int c = 0; c < 4; c++) before[c] = sign * quat[c];
        for (int c = 0; c < 4; c++) x[4 * i + c] = (float)before[(c + 1) % 4];
        for (int c = 0; c < 3; c++) y[3 * i + c] = (float)pos[c];
        if (i == 0) copy3(first, pos);
        sub3(pos, pos, first);
        moved = fmax(moved, norm3(pos));
      }
      add_channel(g, 1 + k, "rotation", x, r->n, 4, time);
      if (moved > 1e-9) add_channel(g, 1 + k, "translation", y, r->n, 3, time);
    }
  }
  free(x);
  free(y);
}

static void put(FILE *out, size_t value) {
  for (int k = 0; k < 4; k++) fputc((int)(value >> 8 * k & 255), out);
}

// the whole of the text; NULL without memory
static char *join(gltf *g, const cav_recording *r, const char *material, size_t *length) {
  char *text = NULL;
  FILE *out = open_memstream(&text, length);
  if (!out) return NULL;
  fputs("{\"asset\":{\"version\":\"2.0\",\"generator\":\"cavort ", out);
  fprintf(out, "%s\"},\n\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\n\"nodes\":[%s]", cav_version(), g->text[3]);
  if (g->nmesh) fprintf(out, ",\n\"meshes\":[%s],\n\"materials\":[%s]", g->text[2], material);
  if (g->nsampler) {
    fputs(",\n\"animations\":[{\"name\":", out);
    cav_certificate_json_text(out, *r->problem->name ? r->problem->name : "motion");
    fprintf(out, ",\"channels\":[%s],\n\"samplers\":[%s]}]", g->text[4], g->text[5]);
  }
  if (g->nview)
    fprintf(out, ",\n\"accessors\":[%s],\n\"bufferViews\":[%s],\n\"buffers\":[{\"byteLength\":%zu}]", g->text[1],
            g->text[0], g->nbyte);
  fputs("}", out);
  for (long n = ftell(out); n % 4; n++) fputc(' ', out);
  if (fclose(out) == 0) return text;
  free(text);
  return NULL;
}

static cav_status write_file(const char *path, const cav_recording *r, const cav_pose *pose, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  gltf g = {0};
  size_t length = 0, nmaterial = 0;
  char *text = NULL, *colours = NULL;
  FILE *material = open_memstream(&colours, &nmaterial);
  int *mesh = malloc(((size_t)r->model->ngeom + 1) * sizeof *mesh);
  int good = open_lists(&g) && material && mesh;
  if (good) {
    add_shapes(&g, r, reach(r, pose), mesh, material);
    add_nodes(&g, r, pose, mesh);
    add_motion(&g, r, pose);
  }
  close_lists(&g);
  if (material) good = fclose(material) == 0 && good;
  if (good && !g.failed) text = join(&g, r, colours, &length);
  if (text) {
    put(file.stream, 0x46546c67), put(file.stream, 2), put(file.stream, 12 + 8 + length + (g.nview ? 8 + g.nbyte : 0));
    put(file.stream, length), put(file.stream, 0x4e4f534a), fwrite(text, 1, length, file.stream);
    if (g.nview) put(file.stream, g.nbyte), put(file.stream, 0x004e4942), fwrite(g.byte, 1, g.nbyte, file.stream);
    status = cav_file_end(&file, error);
  } else {
    cav_file_abandon(&file);
    status = cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory to write the file", path);
  }
  free(text), free(colours), free(mesh);
  free_lists(&g);
  return status;
}

cav_status cav_exchange_write_glb(const cav_recording *r, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error) {
  cav_pose *pose = cav_recording_poses(r, error);
  if (!pose) return error->status;
  cav_status status = write_file(path, r, pose, error);
  snprintf(
      note, CAV_EXCHANGE_NOTE,
      "poses and shapes alone: velocities, controls and contacts are in --to npz; meshes are the hulls that touch");
  free(pose);
  return status;
}
