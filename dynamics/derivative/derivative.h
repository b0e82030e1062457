/// Derivatives of contacts and equality constraints, shared by the analytic derivatives. Private to dynamics/.
#ifndef CAVORT_SLOPE_H
#define CAVORT_SLOPE_H

#include "derivative_store.h"
#include "geometry.h"
#include "jacobian.h"
#include "sensor.h"
#include "step.h"

/// Derivatives of a contact at the state's last evaluation. Where the impulse and its derivative are below 1e-13 of what
/// a contact that pushes has, it is idle and its geometry left alone, unless whole is asked for. manifolds is kept from
/// one contact to the next, so that those of one pair share its narrow phases. contact.c.
void cav_contact_differentiate(const cav_model *model, cav_state *state, const cav_contact *contact, int whole,
                               cav_pair_manifolds *manifolds, cav_contact_jacobian *derivative);

/// Adds what equality constraints between joints, tendons or links give du/dq, du/dv and du/dv_next [nv*nv], beyond
/// what is carried along with the wrenches of subtrees. Not for distances. equality.c.
void cav_equality_derivatives(const cav_model *model, const cav_state *state, double *dq, double *dv, double *dn);

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
