/// A posture that stands, of any model that has feet. Private to optim/ and the tool.
#ifndef CAVORT_STAND_H
#define CAVORT_STAND_H

#include "cavort/problem.h"
#include "role.h"

/// What was found, and how well it stands.
typedef struct cav_stand {
  const char *key; ///< keyframe that it is; NULL: it was found
  double tilt;     ///< of the soles, rad
  double uneven;   ///< heights of the feet, m
  double aside;    ///< horizontal distance of the centre of mass from the middle of the feet, m
  char why[200];   ///< where nothing was found: why
} cav_stand;

/// q [nq] of a posture that stands: the keyframe "stand" or "home", or else the one nearest the model's own in which
/// the feet are as flat as there and level, the centre of mass is above their middle, and legs that were straight are bent.
/// CAV_BAD_INPUT: there is none, why in stand->why. Uses the state.
cav_status cav_stand_find(const cav_model *model, cav_state *state, double *q, cav_stand *stand);

/// Whether a tree that is free or slides upright is inside a solid of the world that is no plane, at q [nq]: its geom, -1: none;
/// and how far up it is inside none, m, 0: not within 20 m. q is as it was in the end. Status as of cav_position. floor.c.
cav_status cav_tree_buried(const cav_model *model, cav_state *state, int root, double *q, int *solid, double *up);

/// Of a problem that cav_problem_load gave: which single free bodies height="floor" brought down by more than 5 cm, in which
/// element, in words; "": none. pose.c.
const char *cav_problem_lowered(const cav_problem *problem);

/// The same of those that it did not stop at a solid, because they begin inside it: in what, and how far to raise them.
const char *cav_problem_buried(const cav_problem *problem);

#endif
