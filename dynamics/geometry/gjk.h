/// How far apart or how deep in each other two convex bodies are. Private to dynamics/.
#ifndef CAVORT_GJK_H
#define CAVORT_GJK_H

#include "geometry.h"

/// A shape without its round edge: the centre of a sphere, the segment of a capsule, any other shape as it is.
typedef struct cav_core {
  const cav_shape *shape;
  double radius;
} cav_core;

/// Direction of least overlap or of separation, unit, from a to b; points of both that meet along it; signed distance
/// of the cores along n. Of polyhedra also the corners that meet: the points of a and of b whose differences span the
/// part of b - a that is nearest, 1 to 3, each as often as it has a part in it; 0 if not known. Of a curved a and a
/// polyhedron b points that span what of b meets, and straight: 0 if what of a meets is round or a rim, 1 along its axis,
/// 2 flat.
typedef struct cav_separation {
  double n[3], x[3], y[3], gap;
  int corners, straight;
  double corner_a[3][3], corner_b[3][3];
} cav_separation;

/// Corners of a face, an edge or a rim in the world, in order. Each lies on two lines, from the corner before and to the
/// next one: side k of the whole outline, or CAV_OUTLINE_CUT + k where the plane over side k of a face has cut it.
enum { CAV_OUTLINE_MAX = 64, CAV_OUTLINE_CUT = 1 << 16 };
typedef struct cav_outline {
  int n;
  double x[CAV_OUTLINE_MAX][3];
  int line[CAV_OUTLINE_MAX][2];
} cav_outline;

/// Corners and faces of a mesh, a box, and the core of a capsule or a sphere, in the world. polytope.c.
int cav_shape_corners(const cav_shape *shape);
void cav_shape_corner(const cav_shape *shape, int corner, double x[3]);
int cav_shape_neighbours(const cav_shape *shape, int corner, int other);
int cav_shape_faces(const cav_shape *shape);
void cav_shape_normal(const cav_shape *shape, int face, double n[3]);
void cav_outline_push(const cav_shape *shape, int face, cav_outline *outline);

/// A length that a shape is no larger than. polytope.c.
double cav_shape_size(const cav_shape *shape);

cav_core cav_core_of(const cav_shape *shape);
void cav_core_support(const cav_core *core, const double direction[3], double point[3]);

/// Of an ellipsoid or a cylinder the point furthest along n moves with n: adds t_i' (its derivative by n) t_j to H.
/// convex.c.
void cav_shape_bend(const cav_shape *shape, const double n[3], double t[2][3], double H[2][2]);

/// Finds it to rounding for polyhedra, with an ellipsoid or a cylinder to about 1e-5; 0 if the cores are further
/// apart than most (out is unchanged). gjk.c.
int cav_separation_find(const cav_core *a, const cav_core *b, double size, double most, cav_separation *out);

/// The same from where the last search ended, and notes where this one does. Where a corner, an edge or a face is proven
/// to be nearest the answer is the one of cav_nearest_prove to the bit, elsewhere that of the search from nothing.
int cav_separation_again(const cav_core *a, const cav_core *b, double size, double most, cav_hint *hint,
                         cav_separation *out);

/// The separation of two polyhedra if the corners of the hint are what is nearest, and they are apart; else 0. nearest.c.
int cav_nearest_prove(const cav_core *a, const cav_core *b, double size, const cav_hint *hint, cav_separation *out);

/// The same, exact for all; 0 if the shapes are further apart than margin. hint: where the last search ended, NULL: from
/// nothing. convex.c.
int cav_separation_solve(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_separation *out);

#endif
