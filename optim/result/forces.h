/// Tables of the contact forces and controls of a motion. Private to optim/ and the tool.
#ifndef CAVORT_FORCES_H
#define CAVORT_FORCES_H

#include "cavort/result.h"

/// Writes forces.csv: knot, time, geoms by name (or "geom 2 of BODY"), position, force on the second geom, gap. Replaces
/// atomically.
cav_status cav_forces_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                            const cav_forces *forces, cav_error *error);

/// Writes controls.csv: time, then of every actuator its control (ctrl_NAME; of one that has an activation that, act_NAME)
/// and its force before the gear (force_NAME), at the knots that have forces. Replaces atomically.
cav_status cav_controls_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error);

/// Writes residual.csv: time, then the force on every dof of a root that the problem penalises (residual_JOINT, residual_JOINT_i
/// as in trajectory.csv; N, N m), at the knots that have forces. Replaces atomically.
cav_status cav_residual_write(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error);

#endif
