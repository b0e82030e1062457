/// Two geoms in four poses each, one for each of four states. Private to dynamics/.
#ifndef CAVORT_TOUCH_FOUR_H
#define CAVORT_TOUCH_FOUR_H

#include "geometry.h"
#include "vectors.h"

/// A geom in four poses: its centres [3], and the rotations [9] of its link, NULL of what stands in the world.
typedef struct cav_geom_four {
  const cav_geom *geom;
  const cav_four *pos, *rotation;
} cav_geom_four;

/// A point of one feature (geometry.h) in those of four poses whose bits are set, from the first on.
typedef struct cav_touch_four {
  cav_four pos[3], normal[3], tangent[3], dist;
  int feature, bits;
} cav_touch_four;

/// Whether pairs of two types are known to cav_touches_four.
int cav_touches_by_four(cav_geom_type a, cav_geom_type b);

/// Points of a pair in the poses whose bits are set, in the order of their features and with the bits of
/// cav_collide_shapes. Returns their number, at most CAV_TOUCH_MAX, or -1: in some pose a rare case has to be taken
/// by itself. Where vectors have four numbers (cav_dense_lanes).
int cav_touches_four(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                     cav_touch_four touch[CAV_TOUCH_MAX]);

#endif
