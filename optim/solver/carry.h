/// Both hands to what has to be pushed or carried by what can walk. Private to optim/solver.
#ifndef CAVORT_CARRY_H
#define CAVORT_CARRY_H

#include "cavort/solve.h"

enum { CAV_CARRY_TERMS = 6, CAV_CARRY_POSES = 4 };

/// Terms that bring the hands to two places of a body that is free or hangs on one joint, keep a free one from tumbling, where it
/// is until then and where it is asked for once they leave it; and how the body that has the hands comes and goes along.
typedef struct cav_carry {
  int found; ///< number of terms; 0: nothing that no actuator moves is asked for elsewhere, it moves at the start, or there
             ///< are no two hands on a free base that can touch it
  int lifts;   ///< 1: it is asked for higher than it is, or over a solid; 0: it is pushed along
  double over; ///< m, how high over the start it goes along clear of solids in its straight way; 0: none are
  cav_term term[CAV_CARRY_TERMS]; ///< they borrow what follows
  double place[2][3];             ///< m, of the right and the left hand in the frame of the body
  double upright[3];              ///< z axis of the body at the start
  double height[3];               ///< m, third: of the root at the start
  double still[3], there[3];      ///< m, where it is at the start and where it is asked for last
  int root, thing;                ///< free joint of what has the hands, and the joint of what they move
  int hung;                       ///< 1: that joint is a hinge or a slide
  double angle;                   ///< rad or m, of a joint that is not free, where it is asked for last
  double come[2], go[2]; ///< m, along the ground, how the root goes to where the hands reach it, and on from there
  double from, to;       ///< s, when the hands are there
} cav_carry;

/// away: part of its thickness that a hand keeps from the body, 1: it touches, less: it presses. CAV_NO_MEMORY, or what the
/// dynamics says of start and goal. The result must stay where it is.
cav_status cav_carry_find(const cav_problem *problem, double away, cav_carry *carry);

/// The postures that the guess passes, and how many: q is room for CAV_CARRY_POSES nq numbers.
int cav_carry_poses(const cav_problem *problem, const cav_carry *carry, double *q,
                    cav_guess_pose pose[CAV_CARRY_POSES]);

#endif
