/// Points that limbs of any body have, for marker sets that serve several bodies. Private to optim/mocap.
#ifndef CAVORT_LANDMARK_H
#define CAVORT_LANDMARK_H

#include "cavort/model.h"
#include "role.h"

typedef enum cav_landmark {
  CAV_LANDMARK_FIRST,  ///< centre of the joints at the beginning of the limb: hip, shoulder
  CAV_LANDMARK_MIDDLE, ///< the joint that parts the limb: knee, elbow
  CAV_LANDMARK_LAST, ///< centre of the joints behind it, or where its last body begins, on the segment before: ankle, wrist
  CAV_LANDMARK_HEEL, ///< lowest, back end of the last body
  CAV_LANDMARK_TOE,  ///< lowest, front end of the last body
  CAV_LANDMARK_TYPES
} cav_landmark;

/// The body that a landmark of a role's limb is on and its place there, m, in the model's own configuration, at which the
/// state is left. 0: the role has no limb, or its limb no such point.
int cav_landmark_find(const cav_model *model, cav_state *state, const cav_roles *roles, cav_role role,
                      cav_landmark landmark, int *body, double place[3]);

#endif
