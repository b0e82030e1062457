/// Directions in cells: the sides of a cube about the origin, each cut into squares. What is known of the middle of a
/// cell is a start near the answer for every direction in it.
#ifndef CAVORT_DIRECTION_H
#define CAVORT_DIRECTION_H

#include <math.h>

enum { CAV_DIRECTION_SIDE = 16, CAV_DIRECTION_CELLS = 6 * CAV_DIRECTION_SIDE * CAV_DIRECTION_SIDE };

/// Cell of a direction [3], of any length; of zero or what is not a number some cell.
static inline int direction_cell(const double d[3]) {
  int axis = fabs(d[1]) > fabs(d[0]) ? 1 : 0;
  if (fabs(d[2]) > fabs(d[axis])) axis = 2;
  double across[2] = {d[(axis + 1) % 3], d[(axis + 2) % 3]}, half = CAV_DIRECTION_SIDE / 2,
         scale = half / fabs(d[axis]);
  int cell = 2 * axis + (d[axis] < 0);
  for (int k = 0; k < 2; k++) {
    double place = half + across[k] * scale;
    int at = place > 0 && place < CAV_DIRECTION_SIDE ? (int)place : place > 0 ? CAV_DIRECTION_SIDE - 1 : 0;
    cell = cell * CAV_DIRECTION_SIDE + at;
  }
  return cell;
}

/// The direction in the middle of a cell, not of unit length.
static inline void direction_of_cell(int cell, double d[3]) {
  int v = cell % CAV_DIRECTION_SIDE, u = cell / CAV_DIRECTION_SIDE % CAV_DIRECTION_SIDE;
  int side = cell / (CAV_DIRECTION_SIDE * CAV_DIRECTION_SIDE), axis = side / 2;
  d[axis] = side % 2 ? -1 : 1;
  d[(axis + 1) % 3] = (2 * u + 1) / (double)CAV_DIRECTION_SIDE - 1;
  d[(axis + 2) % 3] = (2 * v + 1) / (double)CAV_DIRECTION_SIDE - 1;
}

#endif
