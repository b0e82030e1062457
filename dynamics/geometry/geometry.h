/// Shapes and where they touch: shapes in, points out, no state. Private to dynamics/.
#ifndef CAVORT_GEOMETRY_H
#define CAVORT_GEOMETRY_H

#include "cavort/model.h"

/// Contact point found by the narrow phase: world position midway between the surfaces, unit normal from the first to
/// the second geom, signed gap. feature tells the points of one manifold apart and is stable between nearby poses.
typedef struct cav_touch {
  double pos[3];
  double normal[3];
  double tangent[3]; ///< a direction to align the second contact axis with; zero: any
  double dist;
  int feature;
} cav_touch;

enum {
  CAV_TOUCH_MAX = 8,       ///< most points one pair can give
  CAV_LEVEL_FEATURES = 64, ///< of a height field: features below this are of the plane that it is there
  CAV_PRISM_FEATURES = 64  ///< after them, so many of each of its prisms
};

/// A geom in the world.
typedef struct cav_shape {
  cav_geom_type type;
  const double *size;
  const cav_mesh *mesh;     ///< of a mesh
  const cav_hfield *hfield; ///< of a height field
  double pos[3];
  double rotation[9]; ///< row-major, world = rotation * local + pos
} cav_shape;

/// Kind, size and asset of a geom; its place is left to the caller.
static inline cav_shape cav_shape_of(const cav_model *model, const cav_geom *geom) {
  cav_shape shape = {.type = geom->type, .size = geom->size};
  if (geom->type == CAV_GEOM_MESH) shape.mesh = &model->mesh[geom->asset];
  if (geom->type == CAV_GEOM_HFIELD) shape.hfield = &model->hfield[geom->asset];
  return shape;
}

/// Whether it is an ellipsoid or a cylinder, which no corners describe.
static inline int cav_shape_is_curved(const cav_shape *shape) {
  return shape->type == CAV_GEOM_ELLIPSOID || shape->type == CAV_GEOM_CYLINDER;
}

/// All contact points of two shapes with dist < margin; a->type <= b->type, in the order of their features. Returns
/// their number, at most CAV_TOUCH_MAX. pairs.c: table over types; exact routines where they exist, polytope.c for the
/// rest.
int cav_collide_shapes(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// Whether the capsules about two solids are a margin apart or farther: then cav_collide_shapes has no point. Of a capsule, an
/// ellipsoid, a cylinder or a box against one of the last three; 0 for others, whose search takes no longer. pairs.c.
int cav_shapes_apart(const cav_shape *a, const cav_shape *b, double margin);

/// Where the last search of a pair ended, of polyhedra or of a curved body and one of these: the corners of both that met, up
/// to three of each, none: 0; or a direction along which they were further apart than was asked for, in the axes of a. It
/// saves the next search and changes no answer.
typedef struct cav_hint {
  int na, nb, a[3], b[3];
  int apart;
  double direction[3];
} cav_hint;

/// Whether searches of two types, in order, are noted: of a mesh, and of an ellipsoid or a cylinder against a box.
static inline int cav_types_keep_hint(cav_geom_type a, cav_geom_type b) {
  return (b == CAV_GEOM_MESH && a != CAV_GEOM_PLANE) ||
         (b == CAV_GEOM_BOX && (a == CAV_GEOM_ELLIPSOID || a == CAV_GEOM_CYLINDER));
}

/// The same from where the last search of these two ended; of types that keep none nothing is noted.
int cav_collide_again(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_touch *touch);

/// A contact point over a face of one of two bodies: a corner of the other body, or a point of one of its sides over a
/// side of the face, or of its face over a corner of the face.
typedef struct cav_face_point {
  int feature, on_b;
  double normal[3];        ///< out of the face
  double place[3];         ///< of the other body, without its round edge
  double side[3], over[3]; ///< its side's direction and normal of the plane over the face's side; or 0 0 0
  double face[3];          ///< normal of its face, where the point is over a corner; or 0 0 0
  double roll[3],
      turning[3]; ///< of a cylinder: the place moves by roll (turning . rotation) beside as the cylinder does
} cav_face_point;

enum { CAV_FACE_POINTS = 64 };

/// How one moves, seen from the body that has the face, with a twist of the other one about a point that is arm before its place.
void cav_face_point_move(const cav_face_point *p, const double twist[6], const double arm[3], double move[3]);

/// Points over a face as cav_collide_convex makes them, before they are thinned out. 0: there is no face, or a cylinder
/// stands upright on it. hint: where the last search of the two ended, NULL: none is kept. polytope.c.
int cav_face_points(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint,
                    cav_face_point point[CAV_FACE_POINTS]);

/// A prism of a height field as a mesh: its three upper corners counterclockwise, the same below them at its base.
typedef struct cav_prism {
  double vertex[18], plane[20];
  cav_mesh mesh;
  cav_shape shape;
} cav_prism;

/// The prism that a contact of a height field is with, which must stay where it is, and the contact's feature as one of that
/// mesh; -1: it is with no prism, or with one that it overlaps. heightfield.c.
int cav_hfield_prism(const cav_shape *field, int feature, cav_prism *prism);

/// Contact points of one pair as it is and displaced, for differences. pair is -1 at the start.
typedef struct cav_pair_manifolds {
  int pair, displaced;
  int closed; ///< 1: rates are in closed form, and of the points only those as the pair is are there
  int faces;  ///< points over a face of one of the two, -1: not looked for
  cav_face_point face[CAV_FACE_POINTS];
  cav_shape a, b;
  cav_hint *hint;      ///< where the last search of the two ended, NULL: none is kept
  double margin, size; ///< m: reach; size of the smaller shape, of which steps are a fraction
  double point[3];     ///< of the twists
  int count[13];       ///< after -, + each of six unit twists, then as it is
  cav_touch touch[13][CAV_TOUCH_MAX];
  cav_touch rate[2][6]; ///< in closed form
} cav_pair_manifolds;

/// Takes up a pair whose shapes a and b the caller fills in. touch_rates.c.
void cav_manifolds_start(cav_pair_manifolds *m, int pair, double size, double margin, cav_hint *hint);

/// The point with that feature, and its rates by unit twists (angular, linear) of the second shape about a world point.
/// 0 where the point is not there, or comes and goes within a step. touch_rates.c.
int cav_touch_rates(cav_pair_manifolds *m, const double point[3], int feature, cav_touch *here, cav_touch rate[6]);

/// Distance along a ray, unit direction, to the surface of a shape; -1 if it misses. A ray that starts inside meets the
/// surface where it leaves; a plane is met from above only, within its size where that is not 0. ray.c.
double cav_ray(const cav_shape *shape, const double point[3], const double direction[3]);

/// Vertex of a mesh furthest along a direction [3] in its axes: of few the furthest of all; else from a vertex known for
/// directions about this one uphill from neighbour to neighbour, which on a convex body ends at the top. surface.c.
int cav_mesh_summit(const cav_mesh *mesh, const double direction[3]);

#endif
