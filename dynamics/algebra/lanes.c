/// How many numbers a vector of this processor has: a file of its own, so that tests can put another number in its place.
#include "dense.h"

int cav_dense_lanes(void) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) return 8;
  if (__builtin_cpu_supports("avx2")) return 4;
#endif
  return 2;
}
