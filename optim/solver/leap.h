/// Arcs that a problem asks for. Private to optim/.
#ifndef CAVORT_LEAP_H
#define CAVORT_LEAP_H

#include "cavort/solve.h"

/// The ballistic arc of a guess straight from start to goal that comes as high as the heights that terms ask for at
/// one time: height, 0 where none lies above the straight way or nothing can rise, and when it begins and ends.
cav_status cav_leap_find(const cav_problem *problem, double *height, double *from, double *to);

/// A flight: start held, all of the way to the goal by one arc, goal held. The stated arc, or one half way through
/// the horizon, ballistic; as high as it takes to keep out of the solids of the world. height is 0 where the goal is
/// hardly elsewhere, nothing can rise, or no arc of a metre more leads over all.
cav_status cav_flight_find(const cav_problem *problem, double *height, double *from, double *to);

/// The problem with the guess of a flight: pose is room for its two postures.
void cav_flight_apply(double height, double from, double to, cav_guess_pose pose[2], cav_problem *taken);

#endif
