/// Numbers at random: splitmix64 (Steele, Lea and Flood 2014), normal ones by Box and Muller.
#include "random.h"

#include <math.h>

double cav_random_uniform(uint64_t *seed) {
  uint64_t z = *seed += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  z ^= z >> 31;
  return 2 * (double)(z >> 11) / 9007199254740992.0 - 1;
}

double cav_random_normal(uint64_t *seed) {
  double a = 0.5 * (1 + cav_random_uniform(seed)), b = cav_random_uniform(seed);
  return sqrt(-2 * log(a + 1e-300)) * cos(M_PI * b);
}
