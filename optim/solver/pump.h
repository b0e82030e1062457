/// Motions that swing up by pumping energy. Private to optim/.
#ifndef CAVORT_PUMP_H
#define CAVORT_PUMP_H

#include "cavort/solve.h"

/// Configurations of a simulated motion that comes as near to the goal as pumping does within the problem's duration;
/// what it leaves of the time it waits at the start. at has the problem's knots and step.
cav_status cav_pump_fill(const cav_problem *problem, cav_trajectory *at);

/// Whether a model hangs in the start, stands in the goal, which is higher, free of contacts in both, and its actuators
/// cannot hold it between the two.
cav_status cav_pump_needed(const cav_problem *problem, int *needed);

#endif
