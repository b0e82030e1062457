/// Hessian M + J' H J of the convex potential of an island in v_next, and its factors.
#ifndef CAVORT_HESSIAN_H
#define CAVORT_HESSIAN_H

#include "island.h"

enum { CAV_SPARSE_FROM = 500000 }; ///< where both ways take the same time on heaps of boxes, capsules and robots
enum { CAV_CURVATURE = 36 };       ///< doubles of the curvature -df/dy of one block

/// Kept by a state from step to step for its memory and its patterns; opaque. hessian.c.
typedef struct cav_hessian cav_hessian;
/// Islands go to CHOLMOD from sparse_from operations of the dense way on; usual is CAV_SPARSE_FROM.
cav_hessian *cav_hessian_new(double sparse_from);
void cav_hessian_free(cav_hessian *hessian);
size_t cav_hessian_bytes(const cav_hessian *hessian);

/// Islands of the last step that went to CHOLMOD.
int cav_hessian_sparse_islands(const cav_hessian *hessian);

/// A new step begins: patterns of the last one may be met again.
void cav_hessian_restart(cav_hessian *hessian);

/// Turns to an island: part is the problem with the blocks of the island alone. CAV_NO_MEMORY.
cav_status cav_hessian_begin(cav_hessian *hessian, const cav_impulse *part, int ndof, const int *dof, const int *local);

/// Sums and factors M + J' H J with the curvatures of the blocks, [nblock*CAV_CURVATURE]. CAV_NO_MEMORY.
cav_status cav_hessian_factor(cav_hessian *hessian, const double *curvature);

/// x := (M + J' H J)^-1 x for the island's dofs, x [nv].
cav_status cav_hessian_solve(cav_hessian *hessian, double *x);

#endif
