/// Islands of one state: groups of trees that no constraint joins with the rest, whose steps are problems of their own.
#ifndef CAVORT_ISLAND_H
#define CAVORT_ISLAND_H

#include "impulse.h"

/// All islands. Trees are whole, so rows of the tree-sparse inertia stay within one.
typedef struct cav_islands {
  int n;
  int *first_dof, *first_block; ///< [n+1] of each island among dof and among the blocks of the problem
  int *dof;                     ///< [nv] by island, ascending within it
  int *local;                   ///< [nv] place of a dof among those of its island
} cav_islands;

/// Doubles of room that cav_islands_find needs, for each dof and for each block.
enum { CAV_ISLAND_PER_DOF = 4, CAV_ISLAND_PER_BLOCK = (sizeof(cav_block) + sizeof(double) - 1) / sizeof(double) };

/// Finds the islands and sorts the problem's blocks by them, rows staying where they are; blocks of one island keep
/// their order. The islands lie in room. island.c.
void cav_islands_find(cav_impulse *problem, double *room, cav_islands *islands);

/// r := M x and x := M^-1 x for the dofs of one island alone.
void cav_island_inertia(const cav_impulse *problem, int ndof, const int *dof, const double *x, double *r);
void cav_island_fall(const cav_impulse *problem, int ndof, const int *dof, double *x);

#endif
