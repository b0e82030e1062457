/// Surfaces of geoms as triangles.
#ifndef CAVORT_SHAPE_H
#define CAVORT_SHAPE_H

#include "cavort/dynamics.h"

/// Triangles with a normal at every vertex, in the geom's frame. Grows; freed with cav_shape_free.
typedef struct cav_shape {
  int nvertex, nindex, room_vertex, room_index, failed; ///< failed: memory ran out
  float *vertex, *normal;                               ///< [nvertex*3]
  unsigned *index;                                      ///< [nindex], three a triangle, counterclockwise from outside
} cav_shape;

/// The surface of a geom; of a plane a square of that half length.
void cav_shape_of(cav_shape *shape, const cav_model *model, int geom, double plane);
void cav_shape_free(cav_shape *shape);

#endif
