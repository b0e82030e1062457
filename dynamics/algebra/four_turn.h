/// Four numbers of each of four arrays side by side, and back; after by_four.h.
#ifndef CAVORT_FOUR_TURN_H
#define CAVORT_FOUR_TURN_H

#include "by_four.h"

/// Four rows of four turned into columns.
CAV_INLINE void turn_square(const cav_four from[4], cav_four to[4]) {
  cav_four low = CAV_SHUFFLED(from[0], from[1], 0, 4, 2, 6), high = CAV_SHUFFLED(from[0], from[1], 1, 5, 3, 7);
  cav_four low_after = CAV_SHUFFLED(from[2], from[3], 0, 4, 2, 6),
           high_after = CAV_SHUFFLED(from[2], from[3], 1, 5, 3, 7);
  to[0] = CAV_SHUFFLED(low, low_after, 0, 1, 4, 5);
  to[1] = CAV_SHUFFLED(high, high_after, 0, 1, 4, 5);
  to[2] = CAV_SHUFFLED(low, low_after, 2, 3, 6, 7);
  to[3] = CAV_SHUFFLED(high, high_after, 2, 3, 6, 7);
}

CAV_INLINE void turn_in(const double *const from[4], cav_four to[4]) {
  const cav_four rows[4] = {*(const cav_four *)from[0], *(const cav_four *)from[1], *(const cav_four *)from[2],
                            *(const cav_four *)from[3]};
  turn_square(rows, to);
}

CAV_INLINE void turn_out(const cav_four from[4], double *const to[4]) {
  cav_four columns[4];
  turn_square(from, columns);
  for (int k = 0; k < 4; k++) *(cav_four *)to[k] = columns[k];
}

#endif
