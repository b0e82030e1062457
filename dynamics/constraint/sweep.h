/// Which of very many pairs of balls may be near each other. Private to dynamics/.
#ifndef CAVORT_SWEEP_H
#define CAVORT_SWEEP_H

#include <stddef.h>

typedef struct cav_sweep cav_sweep;

/// Two balls by their indices; first < 0: a pair that is always found, of a plane say.
typedef struct cav_sweep_pair {
  int first, second;
} cav_sweep_pair;

/// Prepares for nball balls of radius [nball] (m) and npair pairs; NULL if memory runs out. The lists are copied.
/// sweep.c.
cav_sweep *cav_sweep_new(int nball, const double *radius, int npair, const cav_sweep_pair *pair);
void cav_sweep_free(cav_sweep *sweep);
size_t cav_sweep_bytes(const cav_sweep *sweep);

/// Pairs whose balls are nearer than margin (m), in ascending order. centre [nball][3] is in the world. Returns how
/// many; *found is valid until the next call. sweep.c.
int cav_sweep_find(cav_sweep *sweep, const double (*centre)[3], double margin, const int **found);

#endif
