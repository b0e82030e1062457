/// Arcs that a problem asks for. Private to optim/.
#ifndef CAVORT_LEAP_H
#define CAVORT_LEAP_H

#include "cavort/solve.h"

/// The ballistic arc of a guess straight from start to goal that comes as high as the heights that terms ask for at one time:
/// height, 0 where none lies above the straight way or nothing can rise, and when it begins and ends.
cav_status cav_leap_find(const cav_problem *problem, double *height, double *from, double *to);

#endif
