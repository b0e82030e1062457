/// How far apart or how deep in each other two convex bodies are. Private to dynamics/.
#ifndef CAVORT_GJK_H
#define CAVORT_GJK_H

#include "geometry.h"

/// A shape without its round edge: the centre of a sphere, the segment of a capsule, any other shape as it is.
typedef struct cav_core {
  const cav_shape *shape;
  double radius;
} cav_core;

/// Direction of least overlap or of separation, unit, from a to b; points of both that meet along it; signed distance of
/// the cores along n. exact: the direction solves the problem to rounding, as for polyhedra; else to about 1e-5.
typedef struct cav_separation {
  double n[3], x[3], y[3], gap;
} cav_separation;

cav_core cav_core_of(const cav_shape *shape);
void cav_core_support(const cav_core *core, const double direction[3], double point[3]);

/// Finds it; 0 if the cores are further apart than most (out is unchanged). gjk.c.
int cav_separation_find(const cav_core *a, const cav_core *b, double size, double most, cav_separation *out);

#endif
