/// A contact carries its own proof. With normal n and distance d, the points pos -+ n d/2 lie on the two surfaces, and
/// the supporting planes there are d apart: then no translation shorter than |d| along n parts (or joins) the two. That
/// no other direction does with less is asked of a dense set of directions and of climbs from the best of them.
#ifndef CAVORT_TESTS_PROOF_H
#define CAVORT_TESTS_PROOF_H

#include "check.h"
#include "pairs.h"

/// Signed distance of a world point to the surface of a shape; of a mesh from inside, from outside that to the planes
/// of its faces, a lower bound; NAN of a height field.
static inline double proof_height(const cav_shape *s, const double p[3]) {
  double d[3], x[3], n[3], most = -INFINITY;
  sub3(d, p, s->pos);
  rotate_back(x, s->rotation, d);
  switch (s->type) {
    case CAV_GEOM_PLANE:
      return x[2];
    case CAV_GEOM_SPHERE:
      return norm3(x) - s->size[0];
    case CAV_GEOM_CAPSULE:
      x[2] -= fmax(-s->size[1], fmin(s->size[1], x[2]));
      return norm3(x) - s->size[0];
    case CAV_GEOM_ELLIPSOID:
      return cav_surface_ellipsoid(s->size, x, n);
    case CAV_GEOM_CYLINDER:
      return cav_surface_cylinder(s->size, x, n);
    case CAV_GEOM_BOX:
      return cav_surface_box(s->size, x, n);
    case CAV_GEOM_MESH:
      for (int f = 0; f < s->mesh->nface; f++)
        most = fmax(most, dot3(s->mesh->plane + 4 * f, x) - s->mesh->plane[4 * f + 3]);
      return most;
    case CAV_GEOM_HFIELD:
    case CAV_GEOM_TYPES:
      break;
  }
  return NAN;
}

/// Gap between the supporting planes of two convex shapes along n, from a to b: a lower bound of their signed distance,
/// which is the largest of these over all n.
static inline double proof_gap(const cav_shape *a, const cav_shape *b, const double n[3]) {
  double x[3], y[3], back[3], d[3];
  scale3(back, -1, n);
  cav_shape_support(b, back, y);
  if (a->type == CAV_GEOM_PLANE) {
    copy3(x, a->pos);
  } else {
    cav_shape_support(a, n, x);
  }
  sub3(d, y, x);
  return dot3(d, n);
}

/// Signed distance of a shape to a plane.
static inline double proof_height_of(const cav_shape *s, const cav_shape *plane) {
  double n[3];
  column3(n, plane->rotation, 2);
  return proof_gap(plane, s, n);
}

/// Index of the nearest or deepest of some contacts.
static inline int proof_nearest(const cav_touch *touch, int count) {
  int best = 0;
  for (int k = 1; k < count; k++) {
    if (touch[k].dist < touch[best].dist) best = k;
  }
  return best;
}

/// How far a contact is from its proof: points off the surfaces, planes not d apart, both m.
typedef struct proof {
  double surface, gap;
} proof;

static inline proof proof_of(const cav_shape *a, const cav_shape *b, const cav_touch *t) {
  double x[3], y[3];
  axpy3(x, t->pos, -t->dist / 2, t->normal);
  axpy3(y, t->pos, t->dist / 2, t->normal);
  return (proof){fmax(fabs(proof_height(a, x)), fabs(proof_height(b, y))), fabs(proof_gap(a, b, t->normal) - t->dist)};
}

// climbs from a direction by steps to eight sides, halved where none gains
static inline double proof_climb(const cav_shape *a, const cav_shape *b, const double start[3]) {
  double n[3], best = proof_gap(a, b, start);
  copy3(n, start);
  for (double step = 0.02; step > 1e-8;) {
    double u[3], w[3], e[3] = {fabs(n[0]) < 0.5, fabs(n[0]) >= 0.5, 0};
    cross3(u, n, e);
    normalise3(u);
    cross3(w, n, u);
    int gained = 0;
    for (int k = 0; k < 8 && !gained; k++) {
      double m[3], angle = k * 0.7853981633974483;
      axpy3(m, n, step * cos(angle), u);
      axpy3(m, m, step * sin(angle), w);
      normalise3(m);
      double gap = proof_gap(a, b, m);
      gained = gap > best;
      if (gained) best = gap, copy3(n, m);
    }
    if (!gained) step /= 2;
  }
  return best;
}

/// Largest gap found over a spiral of directions about the sphere and climbs from the best of them.
static inline double proof_distance(const cav_shape *a, const cav_shape *b) {
  enum { DIRECTIONS = 1000, CLIMBS = 6 };
  double start[CLIMBS][3] = {{0}}, gap[CLIMBS], best = -INFINITY;
  for (int k = 0; k < CLIMBS; k++) gap[k] = -INFINITY;
  for (int i = 0; i < DIRECTIONS; i++) {
    double z = 1 - (2 * i + 1.0) / DIRECTIONS, r = sqrt(1 - z * z), turn = 2.399963229728653 * i;
    double n[3] = {r * cos(turn), r * sin(turn), z}, here = proof_gap(a, b, n);
    int k = CLIMBS;
    // those of one hill count once
    for (int j = 0; j < CLIMBS && k == CLIMBS; j++) {
      if (isfinite(gap[j]) && dot3(start[j], n) > 0.95) k = j;
    }
    for (int j = 0, worst = 0; j < CLIMBS && k == CLIMBS; j++) {
      if (gap[j] < gap[worst]) worst = j;
      if (j == CLIMBS - 1) k = worst;
    }
    if (here > gap[k]) gap[k] = here, copy3(start[k], n);
  }
  for (int k = 0; k < CLIMBS; k++) best = fmax(best, proof_climb(a, b, start[k]));
  return best;
}

#endif
