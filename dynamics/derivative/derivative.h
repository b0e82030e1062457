/// What the analytic derivatives of a state keep: how each dof's motion drifts, sums over subtrees, and the derivatives of each
/// contact. Made by the first call of cav_derivatives on a state. Private to dynamics/.
#ifndef CAVORT_SLOPE_H
#define CAVORT_SLOPE_H

#include "workspace.h"

/// Derivatives of one contact by unit twists (angular, linear) of link1 [0] and of link2 [1] at the contact's position,
/// while all links keep their own velocities but for what turns with them.
typedef struct cav_contact_jacobian {
  int idle; ///< the law is flat here: nothing is filled but this
  double dist[2][6];
  double velocity[2][6][6]; ///< [row][twist] of velocity_next
  double impulse[2][6][6];  ///< [row][twist] of the impulse
  double wrench[2][6][6];   ///< [twist][6] of the wrench on link2 about the position
  double hessian[6][6];     ///< -df/dv_next
  double by_velocity[6][6]; ///< frame' hessian frame, 6 x 6 in world axes about the position
} cav_contact_jacobian;

typedef struct cav_derivative_store {
  // dofs: rates of their axes, [nv*6]
  double *drift;      ///< (motion before the joint at the velocity of the bias) x axis
  double *drift_now;  ///< the same at v
  double *drift_next; ///< the same at v_next
  double *second;     ///< (acceleration before) x axis + (motion before) x drift
  double *rate;       ///< drift + (motion after) x axis
  // links: sums over subtrees
  double *gyration;  ///< [nlink*12] moment by angular velocity, 3 x 3, and linear momentum
  int *touched;      ///< [nlink] contacts push in the subtree
  double *by_motion; ///< [nlink*36] of contact wrenches by the motion of the link, those carried along left out
  double *by_now;    ///< [nlink*36] of contact wrenches by v
  double *by_next;   ///< [nlink*36] and by -v_next
  double *across;    ///< [12*nv] axes of the dofs of two links about a contact
  double *spare;     ///< [nv*nv] for outputs that are not asked for
  int room;
  cav_contact_jacobian *contact; ///< [room]
} cav_derivative_store;

void cav_derivative_store_free(cav_derivative_store *derivatives);

/// Derivatives of a contact at the state's last evaluation. CAV_NOT_SUPPORTED if the points of its pair come and go within the
/// step of a difference, so that there is no derivative to take. Where the impulse and its derivative are below 1e-13 of what a
/// contact that pushes has, it is idle and its geometry left alone, unless whole is asked for. contact.c.
cav_status cav_contact_differentiate(const cav_model *model, const cav_state *state, const cav_contact *contact,
                                     int whole, cav_contact_jacobian *derivative);

/// Adds what equality constraints between joints, tendons or links give du/dq, du/dv and du/dv_next [nv*nv], beyond what
/// is carried along with the wrenches of subtrees. Not for distances. equality.c.
void cav_equality_derivatives(const cav_model *model, const cav_state *state, double *dq, double *dv, double *dn);

/// Rates by the distance to the constraint (dist - margin) of ln R and of ln hK of a row or contact's normal.
/// limits.c.
void cav_law_rates(const cav_state *state, const cav_softness *softness, double gap, double *regulariser,
                   double *stiffness);

/// Twist or drift of a dof about a point: r = (S angular, velocity at the point).
static inline void motion_at(double r[6], const double S[6], const double reference[3], const double point[3]) {
  double d[3], linear[3];
  d[0] = point[0] - reference[0], d[1] = point[1] - reference[1], d[2] = point[2] - reference[2];
  linear[0] = S[3] + S[1] * d[2] - S[2] * d[1];
  linear[1] = S[4] + S[2] * d[0] - S[0] * d[2];
  linear[2] = S[5] + S[0] * d[1] - S[1] * d[0];
  r[0] = S[0], r[1] = S[1], r[2] = S[2];
  r[3] = linear[0], r[4] = linear[1], r[5] = linear[2];
}

#endif
