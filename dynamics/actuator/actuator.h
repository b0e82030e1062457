/// Transmissions and forces of actuators. Private to dynamics/.
#ifndef CAVORT_ACTUATOR_H
#define CAVORT_ACTUATOR_H

#include "smooth.h"

/// Rate of length of an actuator's transmission at v [nv], at the state's position. transmission.c.
double cav_actuator_velocity(cav_state *state, int actuator, const double *v);

/// Force of an actuator, before gear, among the least-norm ones that give the state's u. actuation.c.
double cav_actuator_part(cav_state *state, int actuator);

/// What these forces of all actuators do along one dof. actuation.c.
double cav_actuators_at(cav_state *state, int dof);

/// Dofs that an actuator moves, dof NULL: only their number. Its length and moments along them, at the state's
/// position. transmission.c.
int cav_transmission_dofs(const cav_model *model, int actuator, int *dof);
double cav_transmission_length(const cav_state *state, int actuator, double *moment);

/// Fills the transmission of a workspace. actuation.c.
cav_status cav_actuation_compile(const cav_model *model, cav_state *state);

#endif
