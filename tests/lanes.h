/// Vectors shorter than this processor's, for tests that are linked with -Wl,--wrap=cav_dense_lanes.
#ifndef CAVORT_TESTS_LANES_H
#define CAVORT_TESTS_LANES_H

#include "dense.h"

static int lanes_most = 8; ///< numbers in a vector: 8, 4 or 2

int __real_cav_dense_lanes(void);
int __wrap_cav_dense_lanes(void);
int __wrap_cav_dense_lanes(void) {
  int lanes = __real_cav_dense_lanes();
  return lanes < lanes_most ? lanes : lanes_most;
}

#endif
