/// Parts of the narrow phase that pairs.c is made of. Private to dynamics/.
#ifndef CAVORT_PAIRS_H
#define CAVORT_PAIRS_H

#include "geometry.h"
#include "math3.h"

/// Signed distance of point p [3] to the surface of a solid centred at the origin, negative inside, and the unit
/// outward normal [3] at the nearest surface point p - distance * normal. All in the solid's axes. Convex in p.
/// surface.c.
typedef double cav_surface(const double *size, const double p[3], double normal[3]);

cav_surface cav_surface_box, cav_surface_cylinder, cav_surface_ellipsoid;

/// Point [3] of a shape furthest along a world direction [3], in the world; the radius of spheres and capsules counts.
/// surface.c.
void cav_shape_support(const cav_shape *shape, const double direction[3], double point[3]);

/// As cav_mesh_summit, from a vertex near it if that is higher than the one known; -1: no such vertex.
int cav_mesh_summit_from(const cav_mesh *mesh, const double direction[3], int near);

/// Segment swept by a sphere (the capsule a) against a solid b with a surface: up to 2 points. segment.c.
int cav_collide_segment(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// The same of a capsule or a sphere against a box, and their rates by unit twists (angular, linear) of the box about a world
/// point [3]: rate[2][6]. -1: the points jump, or the segment cuts the box. segment.c.
int cav_segment_rates(const cav_shape *a, const cav_shape *b, double margin, const double point[3], cav_touch *touch,
                      cav_touch (*rate)[6]);

/// A mesh against a plane: its lowest vertex, and those that would be lowest if it leant to four sides. polytope.c.
int cav_collide_plane_mesh(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// Convex pairs without a routine of their own: ellipsoid, cylinder, box (not two) and mesh; sphere or capsule against
/// mesh; a capsule whose segment cuts an ellipsoid, cylinder or box: up to 8 points. polytope.c.
int cav_collide_convex(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);
/// The same of two whose searches are noted: first by the boxes about both, then from where their last one ended.
int cav_collide_hinted(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_touch *touch);

/// Keeps the deepest of n contacts and those furthest from the ones kept, most at most; returns how many. polytope.c.
int cav_thin_out(cav_touch *touch, int n, int most);

/// Lowest points of a shape over a triangle with that normal, world. polytope.c.
enum { CAV_LYING_MAX = 32 };
int cav_points_over(const cav_shape *shape, double corner[3][3], const double normal[3], double point[][3]);

/// A height field against all but planes and height fields: up to 8 points. heightfield.c.
int cav_collide_hfield(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// Distance along a ray in its axes to the surface of a height field from above; -1 if it misses. heightfield.c.
double cav_ray_hfield(const cav_hfield *field, const double point[3], const double direction[3]);

/// Box against box: up to 8 points. boxes.c.
int cav_collide_boxes(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// Writes one contact point between spheres about p and q (radii may be 0): normal from p to q, or fallback where the
/// centres coincide. Returns 1 if the gap is below margin, else 0 with touch unchanged.
static inline int touch_spheres(const double p[3], double rp, const double q[3], double rq, const double fallback[3],
                                double margin, int feature, cav_touch *touch) {
  double n[3];
  sub3(n, q, p);
  double length2 = dot3(n, n), reach = margin + rp + rq;
  if (reach <= 0 || length2 >= reach * reach) return 0;
  double length = sqrt(length2);
  if (length > 0) {
    scale3(n, 1 / length, n);
  } else {
    copy3(n, fallback);
  }
  double dist = length - rp - rq;
  axpy3(touch->pos, p, rp + dist / 2, n);
  copy3(touch->normal, n);
  zero3(touch->tangent);
  touch->dist = dist;
  touch->feature = feature;
  return 1;
}

#endif
