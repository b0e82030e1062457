/// Hessian M + J' H J of an island and its factors by elimination of one dof after another, from the leaves.
#ifndef CAVORT_ELIMINATION_H
#define CAVORT_ELIMINATION_H

#include <stdlib.h>

#include "impulse.h"

/// Room for count items; what was there is lost. 0 if memory runs out. For hessian.c too, as the next.
static inline int make_room(void *array, size_t *room, size_t count, size_t size) {
  void **items = array;
  if (count <= *room) return 1;
  free(*items);
  *room = count + count / 2;
  *items = malloc(*room * size);
  if (!*items) *room = 0;
  return *items != NULL;
}

/// Whether a block pulls nowhere: all n numbers of its curvature are 0.
static inline int is_zero(const double *H, int n) {
  for (int i = 0; i < n; i++)
    if (H[i] != 0.0) return 0;
  return 1;
}

/// Kept by a state from step to step for its memory; opaque. elimination.c.
typedef struct cav_elimination cav_elimination;
cav_elimination *cav_elimination_new(void);
void cav_elimination_free(cav_elimination *elimination);
size_t cav_elimination_bytes(const cav_elimination *elimination);

/// Turns to an island as cav_hessian_begin does: part with its blocks, of which block b sees the dofs of clique [nblock], counted
/// from 0 in runs of blocks. CAV_NO_MEMORY.
cav_status cav_elimination_begin(cav_elimination *elimination, const cav_impulse *part, int ndof, const int *dof,
                                 const int *local, const int *clique);

/// Sums M + J' H J with the curvatures of the blocks, [nblock*stride], and eliminates. No pivot falls below that of M itself, so
/// rounding in a very stiff constraint cannot make the matrix indefinite.
void cav_elimination_factor(cav_elimination *elimination, const double *curvature, int stride);

/// x := (M + J' H J)^-1 x for the island's dofs, x [nv].
void cav_elimination_solve(cav_elimination *elimination, double *x);

#endif
