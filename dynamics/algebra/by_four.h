/// Makes what a file includes after this take four numbers where it would take one: spatial.h and what is written over its
/// CAV_REAL; and what its numbers are compared and chosen by. Vectors go to and from functions that are all inlined.
#ifndef CAVORT_BY_FOUR_H
#define CAVORT_BY_FOUR_H

#include <math.h>

#include "vectors.h"

/// Of functions that only run where a vector has four numbers (cav_dense_lanes).
#if defined(__x86_64__)
#define CAV_BY_FOUR __attribute__((target("avx2")))
#else
#define CAV_BY_FOUR
#endif

#define CAV_REAL cav_four
#define CAV_INLINE CAV_BY_FOUR CAV_VECTOR_BODY
#define CAV_ALL(x) cav_four_of(x)

CAV_INLINE cav_four cav_four_of(double x) { return (cav_four){x, x, x, x}; }

/// Of a comparison of four numbers.
typedef long long cav_four_masks __attribute__((vector_size(sizeof(cav_four))));

/// A bit for each of four that holds, from the first on.
CAV_INLINE int held_bits(cav_four_masks m) {
#if defined(__x86_64__)
  return __builtin_ia32_movmskpd256((__attribute__((vector_size(sizeof(cav_four)))) double)m);
#else
  return (int)((m[0] & 1) | (m[1] & 2) | (m[2] & 4) | (m[3] & 8));
#endif
}

CAV_INLINE int any(cav_four_masks m) { return held_bits(m) != 0; }

CAV_INLINE cav_four choose(cav_four_masks which, cav_four yes, cav_four no) {
  return (cav_four)((which & (cav_four_masks)yes) | (~which & (cav_four_masks)no));
}

CAV_INLINE cav_four roots(cav_four x) {
  cav_four r;
  for (int i = 0; i < 4; i++) r[i] = sqrt(x[i]);
  return r;
}

CAV_INLINE cav_four sizes(cav_four x) { return choose(x < 0, -x, x); }

#endif
