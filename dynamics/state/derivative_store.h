/// What the analytic derivatives of a state keep: how each dof's motion drifts, sums over subtrees, and the derivatives
/// of each contact. Made by the first call of cav_derivatives on a state, released with it. Private to dynamics/.
#ifndef CAVORT_DERIVATIVE_STORE_H
#define CAVORT_DERIVATIVE_STORE_H

#include <stddef.h>

/// Derivatives of one contact by unit twists (angular, linear) of link1 [0] and of link2 [1] at the contact's position,
/// while all links keep their own velocities but for what turns with them.
typedef struct cav_contact_jacobian {
  int idle; ///< the law is flat here: nothing is filled but this
  double dist[2][6];
  double pos[2][3][6];      ///< [axis of the world][twist] of the position
  double velocity[2][6][6]; ///< [row][twist] of velocity_next
  double impulse[2][6][6];  ///< [row][twist] of the impulse
  double wrench[2][6][6];   ///< [twist][6] of the wrench on link2 about the position
  double hessian[6][6];     ///< -df/dv_next
  double way[2][2][6];      ///< [row][twist] of h times what tangential rows see, links held after the step (next_slip)
  double by_velocity[6][6]; ///< frame' hessian frame, 6 x 6 in world axes about the position
  double by_before[6][6]; ///< the same of the velocity before the step, where rows take that unlike each other (stops)
} cav_contact_jacobian;

/// Components of a dof on a path: those of its axis, then of the vectors of the store in their order.
enum {
  CAV_OF_AXIS = 0,
  CAV_OF_DRIFT = 6,
  CAV_OF_NOW = 12,
  CAV_OF_NEXT = 18,
  CAV_OF_SECOND = 24,
  CAV_OF_RATE = 30,
  CAV_DOF_COMPONENTS = 36,
  CAV_PATH_ROWS = 31 ///< rows over a path that are kept at a time
};

/// Dofs from a root on, each of which moves the next, with their components: component c of the i-th at at[c * stride + i].
/// There is one for each dof that moves no other, which all that move it have for theirs.
typedef struct cav_dof_path {
  int stride; ///< a multiple of four
  int *dof;   ///< [stride] of the present one, -1: none yet
  double *at; ///< [CAV_DOF_COMPONENTS*stride]
  int n;      ///< number of paths
  int *of;    ///< [nv] that of a dof
  int *dofs;  ///< [n*stride] of all
  double *all;
} cav_dof_path;

typedef struct cav_derivative_store {
  // dofs: rates of their axes, [nv*6]
  double *drift;      ///< (motion before the joint at the velocity of the bias) x axis
  double *drift_now;  ///< the same at v
  double *drift_next; ///< the same at v_next
  double *second;     ///< (acceleration before) x axis + (motion before) x drift
  double *rate;       ///< drift + (motion after) x axis
  // the same where v alone accelerates, for connects and welds; none without
  double *bias_second; ///< (what v makes of the acceleration before) x axis + (motion before at v) x drift_now
  double *bias_rate;   ///< drift_now + (motion after at v) x axis
  // links: sums over subtrees
  double *gyration;  ///< [nlink*12] moment by angular velocity, 3 x 3, and linear momentum
  int *touched;      ///< [nlink] contacts push in the subtree
  double *by_motion; ///< [nlink*36] of contact wrenches by the motion of the link, those carried along left out
  double *by_now;    ///< [nlink*36] of contact wrenches by v
  double *by_next;   ///< [nlink*36] and by -v_next
  int *dof;          ///< [nv] of one contact
  double *across;    ///< [12*nv] axes of the dofs of two links about a contact
  cav_dof_path path;
  double *entry; ///< [CAV_PATH_ROWS*path.stride] of a row and a column of the three results, or of a contact
  int *depth;    ///< [nv] dofs that move a dof, itself left out
  double *spare; ///< [nv*nv] for outputs that are not asked for
  size_t bytes;  ///< of all but contact
  int room;
  cav_contact_jacobian *contact; ///< [room]
} cav_derivative_store;

/// Releases it; NULL is fine. storage.c.
void cav_derivative_store_free(cav_derivative_store *store);

/// Bytes that it holds; NULL: none.
size_t cav_derivative_store_bytes(const cav_derivative_store *store);

#endif
