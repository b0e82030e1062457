/// Capsules that are the same but for their place, four at once. Private to dynamics/.
#ifndef CAVORT_CAPSULES_FOUR_H
#define CAVORT_CAPSULES_FOUR_H

#include "geometry.h"

/// Capsules are parallel below this angle, rad: well above steps of differentiation.
#define CAV_PARALLEL 1e-5
/// Fraction of their length within which axes count as crossing, so that rounding does not choose the side.
#define CAV_CROSSING 1e-13

/// Capsule a against four of that radius and half length, centres and axes by component: 0 or 1 point each, the bits of
/// cav_collide_shapes; 0 where they have to be taken one by one. Where vectors have four numbers (cav_dense_lanes).
int cav_capsules_four(const cav_shape *a, double radius, double half, const double place[3][4], const double axis[3][4],
                      double margin, int count[4], cav_touch *const touch[4]);

#endif
