/// What can be planned: which actuators, and how many knots. Private to optim/.
#ifndef CAVORT_PLANNABLE_H
#define CAVORT_PLANNABLE_H

#include "cavort/problem.h"

/// Whether efforts of all actuators are linear forms of u with constant limits, which plans and verification of them
/// assume: moments constant in q, and limits that move with q and v at most as those of cav_servo_bounds. plannable.c.
/// CAV_NOT_SUPPORTED with the actuator and why not.
cav_status cav_actuators_plannable(const cav_model *model, cav_error *error);

/// Whether the limits of a servo's control bound its effort by rows in u, q and v, beside those of its force if it has
/// any: fixed gain, affine bias, on a scalar joint or a fixed tendon. plannable.c.
int cav_servo_bounds(const cav_model *model, int actuator);

/// Part of the actuators' limits that is planned with, times their strength. plannable.c.
double cav_planned_part(const cav_problem *problem);

/// What derivatives and normal equations of so many knots of so many dofs take at least, bytes. plannable.c.
double cav_knots_bytes(double knots, int dofs);

/// Whether a plan of so many knots of so many dofs fits into the memory of the machine, and into what the process may
/// take of it, before any is taken: CAV_BAD_INPUT with what it needs at least and what to do. plannable.c.
cav_status cav_knots_plannable(double knots, int dofs, cav_error *error);

#endif
