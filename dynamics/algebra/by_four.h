/// Makes what a file includes after this take four numbers where it would take one: spatial.h and what is written over its
/// CAV_REAL. Vectors go to and from functions that are all inlined.
#ifndef CAVORT_BY_FOUR_H
#define CAVORT_BY_FOUR_H

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

#endif
