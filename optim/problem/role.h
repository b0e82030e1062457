/// Parts of a body that any humanoid, quadruped or arm has, whatever its file calls them. Private to optim/ and the tool.
#ifndef CAVORT_ROLE_H
#define CAVORT_ROLE_H

#include "cavort/dynamics.h"

#define CAV_ROLES(X)                      \
  X(PELVIS, "pelvis")                     \
  X(TORSO, "torso")                       \
  X(HEAD, "head")                         \
  X(RIGHT_FOOT, "right foot")             \
  X(LEFT_FOOT, "left foot")               \
  X(FRONT_RIGHT_FOOT, "front right foot") \
  X(FRONT_LEFT_FOOT, "front left foot")   \
  X(BACK_RIGHT_FOOT, "back right foot")   \
  X(BACK_LEFT_FOOT, "back left foot")     \
  X(RIGHT_HAND, "right hand")             \
  X(LEFT_HAND, "left hand")               \
  X(HAND, "hand")

typedef enum cav_role {
#define CAV_ROLE_ENUM(id, name) CAV_ROLE_##id,
  CAV_ROLES(CAV_ROLE_ENUM)
#undef CAV_ROLE_ENUM
      CAV_ROLE_TYPES
} cav_role;

typedef enum cav_build {
  CAV_BUILD_NONE,
  CAV_BUILD_BIPED,
  CAV_BUILD_QUADRUPED,
  CAV_BUILD_ARMS,
  CAV_BUILD_TYPES
} cav_build;

/// How the largest tree stands in the world: by a free joint, by two slides and more, or else.
typedef enum cav_base { CAV_BASE_FIXED, CAV_BASE_PLANAR, CAV_BASE_FREE } cav_base;

/// What was found of a model.
typedef struct cav_roles {
  cav_build build;
  cav_base base;
  int body[CAV_ROLE_TYPES]; ///< -1: it has none
  int geom[CAV_ROLE_TYPES]; ///< what is meant where the body is more than that: a shank that ends in a ball; -1 else
  int limb[CAV_ROLE_TYPES]; ///< of feet and hands: the first body of the limb; -1 else
  double left[2];           ///< unit, horizontal, world, in the model's own configuration; forward is to its right
  char why[160];            ///< where nothing was found: why
} cav_roles;

/// "right foot" of CAV_ROLE_RIGHT_FOOT.
const char *cav_role_name(cav_role role);

/// "biped" and so on; of none "nothing known".
const char *cav_build_name(cav_build build);

/// Finds the roles; the state is left at the model's own configuration. Status as of cav_position.
cav_status cav_roles_find(const cav_model *model, cav_state *state, cav_roles *roles);

/// The role of that name; CAV_ROLE_TYPES: none.
cav_role cav_role_named(const char *name);

/// Names of the roles that were found, by commas, as far as size goes; "" if there are none.
void cav_roles_list(const cav_roles *roles, char *out, int size);

#endif
