/// Groups of dofs along which second derivatives are found at once. Private to optim/.
#ifndef CAVORT_DOF_GROUPS_H
#define CAVORT_DOF_GROUPS_H

#include "transcription.h"

/// Which dofs meet in a second derivative of what a knot's readings are pulled by, and groups of those that do not, whose
/// columns of a Hessian are found as one sum.
typedef struct cav_dof_groups {
  int nv, ngroup;
  char *joined; ///< [nv*nv] whether two dofs meet
  int *group;   ///< [nv] that a dof is in
  int *count;   ///< [nv*nv] dofs of a group that meet dof r: count[r*nv + group]
} cav_dof_groups;

/// 0 if memory runs out; cleared by cav_dof_groups_clear in either case.
int cav_dof_groups_make(cav_dof_groups *groups, int nv);
void cav_dof_groups_clear(cav_dof_groups *groups);

/// Groups at the state of a knot, whose readings are pulled by pull [nv + readings]. Every entry of the Hessian that is not zero
/// can be read off the sums, at (r, c) or at (c, r): cav_dof_groups_alone.
void cav_dof_groups_find(cav_dof_groups *groups, const cav_transcription *transcription, const cav_state *state, int t,
                         const double *pull);

/// Whether the sum of c's group has entry (r, c) by itself in row r.
static inline int cav_dof_groups_alone(const cav_dof_groups *groups, int r, int c) {
  return groups->joined[r * groups->nv + c] && groups->count[r * groups->nv + groups->group[c]] == 1;
}

#endif
