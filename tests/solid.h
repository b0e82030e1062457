/// Random solids: every convex kind of shape with room for what it points to, for tests of contacts.
#ifndef CAVORT_TESTS_SOLID_H
#define CAVORT_TESTS_SOLID_H

#include "hull.h"
#include "pairs.h"
#include "scene.h"

static const char *const solid_names[] = {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"};

/// A shape with room for what it points to.
typedef struct solid {
  double size[3];
  cav_hull hull;
  cav_mesh mesh;
  cav_shape shape;
} solid;

static inline void solid_place(cav_shape *s) {
  double q[4];
  for (int i = 0; i < 4; i++) q[i] = scene_uniform();
  for (int i = 0; i < 3; i++) s->pos[i] = scene_uniform();
  quat_normalise(q);
  quat_matrix(s->rotation, q);
}

static inline void solid_mesh(solid *s, const double *point, int n) {
  CHECK(cav_hull_build(point, n, 0, &s->hull) == CAV_OK);
  s->mesh = cav_hull_mesh(&s->hull);
  s->shape.type = CAV_GEOM_MESH;
  s->shape.mesh = &s->mesh;
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < 3; k++) s->size[k] = fmax(s->size[k], fabs(point[3 * i + k]));
  }
}

static inline void solid_box_corners(const double half[3], double *point) {
  for (int i = 0; i < 8; i++) {
    for (int k = 0; k < 3; k++) point[3 * i + k] = i >> k & 1 ? half[k] : -half[k];
  }
}

// kind of mesh: few points, many points, a box
static inline void solid_random(int type, int kind, solid *s) {
  double point[3 * 100];
  *s = (solid){.shape.type = (cav_geom_type)type};
  s->shape.size = s->size;
  for (int i = 0; i < 3; i++) s->size[i] = scene_between(0.05, 0.3);
  if (type == CAV_GEOM_MESH) {
    double half[3];
    copy3(half, s->size);
    int n = kind == 0 ? 4 + (int)scene_between(0, 8) : kind == 1 ? 100 : 8;
    for (int i = 0; i < n; i++) {
      double x[3] = {scene_uniform(), scene_uniform(), scene_uniform()};
      normalise3(x);
      for (int k = 0; k < 3; k++) point[3 * i + k] = half[k] * x[k];
    }
    if (kind == 2) solid_box_corners(half, point);
    solid_mesh(s, point, n);
  }
  solid_place(&s->shape);
}

static inline void solid_clear(solid *s) { cav_hull_clear(&s->hull); }

#endif
