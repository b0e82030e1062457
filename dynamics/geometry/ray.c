/// Where a ray meets a shape: for rangefinders and the zones of touch sensors. Convex solids are met on an interval of
/// the ray, found in closed form in the shape's own axes: an ellipsoid by one quadratic, a box and a cylinder as
/// intersections of slabs and a tube, a capsule as the union of a cylinder and two balls.
#include "geometry.h"
#include "math3.h"
#include "pairs.h"

/// Part of a ray, from <= to; from > to: none.
typedef struct interval {
  double from, to;
} interval;

static const interval nothing = {INFINITY, -INFINITY}, everything = {-INFINITY, INFINITY};

static interval both(interval a, interval b) { return (interval){fmax(a.from, b.from), fmin(a.to, b.to)}; }

// hull of two parts of one convex whole
static interval either(interval a, interval b) { return (interval){fmin(a.from, b.from), fmax(a.to, b.to)}; }

// where a t^2 + 2 b t + c <= 0
static interval below(double a, double b, double c) {
  double d = b * b - a * c;
  if (a <= 0) { return c <= 0 ? everything : nothing; }
  if (d < 0) { return nothing; }
  // the larger root in magnitude without cancellation, the other from the product
  double q = b > 0 ? -b - sqrt(d) : -b + sqrt(d);
  if (q == 0) { return (interval){0, 0}; }
  return b > 0 ? (interval){q / a, c / q} : (interval){c / q, q / a};
}

// where |p + t d| <= half
static interval slab(double p, double d, double half) {
  if (d == 0) { return fabs(p) <= half ? everything : nothing; }
  double s = -p / d, w = fabs(half / d);
  return (interval){s - w, s + w};
}

static interval ball(const double p[3], const double d[3], double radius, double z) {
  double at[3] = {p[0], p[1], p[2] - z};
  return below(dot3(d, d), dot3(at, d), dot3(at, at) - radius * radius);
}

static interval tube(const double p[3], const double d[3], double radius) {
  return below(d[0] * d[0] + d[1] * d[1], p[0] * d[0] + p[1] * d[1], p[0] * p[0] + p[1] * p[1] - radius * radius);
}

static interval ellipsoid(const double p[3], const double d[3], const double size[3]) {
  double q[3], e[3];
  for (int k = 0; k < 3; k++) {
    if (!(size[k] > 0)) { return nothing; }
    q[k] = p[k] / size[k];
    e[k] = d[k] / size[k];
  }
  return ball(q, e, 1, 0);
}

// inside all faces of a hull; a flat one has no inside
static interval polyhedron(const cav_mesh *m, const double p[3], const double d[3]) {
  interval solid = m->nface ? everything : nothing;
  for (int f = 0; f < m->nface; f++) {
    const double *plane = m->plane + 4 * f;
    double height = dot3(plane, p) - plane[3], rate = dot3(plane, d);
    if (rate == 0 && height > 0) { return nothing; }
    if (rate == 0) { continue; }
    double t = -height / rate;
    solid = both(solid, rate > 0 ? (interval){-INFINITY, t} : (interval){t, INFINITY});
  }
  return solid;
}

static double meet_plane(const double p[3], const double d[3], const double size[3]) {
  if (d[2] >= 0 || p[2] < 0) { return -1; }
  double t = -p[2] / d[2];
  for (int k = 0; k < 2; k++) {
    if (size[k] > 0 && fabs(p[k] + t * d[k]) > size[k]) { return -1; }
  }
  return t;
}

double cav_ray(const cav_shape *shape, const double point[3], const double direction[3]) {
  double p[3], d[3];
  const double *size = shape->size;
  sub3(p, point, shape->pos);
  rotate_back(p, shape->rotation, p);
  rotate_back(d, shape->rotation, direction);
  interval solid = nothing;
  switch (shape->type) {
    case CAV_GEOM_PLANE:
      return meet_plane(p, d, size);
    case CAV_GEOM_SPHERE:
      solid = ball(p, d, size[0], 0);
      break;
    case CAV_GEOM_CAPSULE:
      solid = both(tube(p, d, size[0]), slab(p[2], d[2], size[1]));
      if (solid.from > solid.to) { solid = nothing; }
      solid = either(solid, either(ball(p, d, size[0], size[1]), ball(p, d, size[0], -size[1])));
      break;
    case CAV_GEOM_ELLIPSOID:
      solid = ellipsoid(p, d, size);
      break;
    case CAV_GEOM_CYLINDER:
      solid = both(tube(p, d, size[0]), slab(p[2], d[2], size[1]));
      break;
    case CAV_GEOM_BOX:
      solid = everything;
      for (int k = 0; k < 3; k++) solid = both(solid, slab(p[k], d[k], size[k]));
      break;
    case CAV_GEOM_MESH:
      solid = polyhedron(shape->mesh, p, d);
      break;
    case CAV_GEOM_HFIELD:
      return cav_ray_hfield(shape->hfield, p, d);
    case CAV_GEOM_TYPES:
      break;
  }
  if (!(solid.from <= solid.to) || solid.to < 0) { return -1; }
  return solid.from >= 0 ? solid.from : solid.to;
}
