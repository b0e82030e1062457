/// Numbers at random, the same on every machine. Private to problems/.
#ifndef CAVORT_RANDOM_H
#define CAVORT_RANDOM_H

#include <stdint.h>

/// One of numbers -1 .. 1 (splitmix64), and one of the normal distribution. The seed is the caller's, and moves on.
double cav_random_uniform(uint64_t *seed);
double cav_random_normal(uint64_t *seed);

#endif
