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
/// move with the tree of that number; and npair pairs, first < 0: one that is never left out. NULL if memory runs out. The
/// lists are copied. fixed.c.
cav_fixed *cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree, int npair,
                         const cav_sweep_pair *pair);
void cav_fixed_free(cav_fixed *fixed);
size_t cav_fixed_bytes(const cav_fixed *fixed);

/// Whether leaving out pays at all.
int cav_fixed_pays(const cav_fixed *fixed);

/// Runs of pairs, ascending, in which all are that may be nearer than margin (m). centre [nball][3]: those that stand are
/// not read. Returns the number of these pairs; *run [*nrun] is valid until the next call. fixed.c.
int cav_fixed_find(cav_fixed *fixed, const double (*centre)[3], double margin, const cav_run **run, int *nrun);

#endif
