/// Pairs of a ball that moves and one that stands in the world, left out many at a time. Private to dynamics/.
#ifndef CAVORT_FIXED_H
#define CAVORT_FIXED_H

#include "sweep.h"

typedef struct cav_fixed cav_fixed;

/// Pairs first .. end-1.
typedef struct cav_run {
  int first, end;
} cav_run;

/// Of nball balls with radius (m) and centre, of which those with tree -1 stand where they are for good and the others
/// move with the tree of that number, never farther from its root than reach (m, INFINITY where nothing holds them); and
/// npair pairs, first < 0: one that is never left out. NULL if memory runs out. The lists are copied. fixed.c.
cav_fixed *cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree,
                         const double *reach, int npair, const cav_sweep_pair *pair);
void cav_fixed_free(cav_fixed *fixed);
size_t cav_fixed_bytes(const cav_fixed *fixed);

/// Whether leaving out pays at all.
int cav_fixed_pays(const cav_fixed *fixed);

/// The pairs that are never left out, ascending, and how many.
const int *cav_fixed_always(const cav_fixed *fixed, int *count);

/// Runs of pairs, ascending, in which all are that may be nearer than margin (m). Where these are the pairs that are never
/// left out and no other, it is one run of them as they follow behind all pairs, from npair on. centre [nball][3]: those that
/// stand are not read; root: of each tree. Returns the number of these pairs; *run [*nrun] is valid until the next call. fixed.c.
int cav_fixed_find(cav_fixed *fixed, const double (*centre)[3], const double (*root)[3], double margin,
                   const cav_run **run, int *nrun);

#endif
