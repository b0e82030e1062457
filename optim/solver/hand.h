/// What pushes a body that no actuator moves, or touches what a touch sensor is to feel, and from where. Private to optim/solver.
#ifndef CAVORT_HAND_H
#define CAVORT_HAND_H

#include "cavort/solve.h"

enum { CAV_HAND_TERMS = 4 };

/// Terms that bring a geom of a driven tree to the side of a body that it is to be pushed from, keep a free body from tumbling
/// towards it, and where it is until then, and where it is to be from when on what pushes it is wanted elsewhere; or one that
/// brings what is to be touched and what touches it together.
typedef struct cav_hand {
  int found; ///< number of terms; 0: nothing that no actuator moves is asked for elsewhere along the ground, no force is
             ///< asked of a touch sensor, or nothing reaches it
  int touches;                   ///< 1: it is for a touch sensor
  int hung;                      ///< 1: the body turns on a hinge or slides in the world
  cav_term term[CAV_HAND_TERMS]; ///< they borrow what follows
  double place[3];               ///< m, of the geom in the frame of the body
  double upright[3];             ///< z axis of the body at the start
  double still[3], there[3];     ///< m, where it is at the start, and where it is asked for last
} cav_hand;

/// away: part of its thickness that the hand keeps from the body, 1: it touches, less: it leans on it. CAV_NO_MEMORY, or what
/// the dynamics says of start and goal. The hand must stay where it is.
cav_status cav_hand_find(const cav_problem *problem, double away, cav_hand *hand);

/// The schedule that what is pushed takes: the guess by inverse kinematics, then the last stages at the full weight of the
/// unactuated force.
cav_schedule cav_hand_schedule(const cav_schedule *schedule);

#endif
