/// Guesses lifted out of solids. Private to optim/solver.
#ifndef CAVORT_CLEAR_H
#define CAVORT_CLEAR_H

#include "cavort/problem.h"

/// Raises the roots that can rise.
void cav_lift(const cav_model *m, double height, double *q);

/// The first free joint; -1: there is none.
int cav_first_free(const cav_model *model);

/// Height of the lowest point of a tree's geoms that may touch, by its root link, or of all that moves (0), at the state's last
/// position, m; infinite: there is none.
double cav_lowest_point(const cav_model *model, const cav_state *state, int root);

/// Whether a contact is with a solid of the world, of which grounds are none.
int cav_is_with_solid(const cav_model *model, const cav_contact *contact);

/// Lifts the knots of a guess out of the world, but the first, or takes them below what hangs in the way, where that is shorter.
cav_status cav_clear(const cav_model *model, cav_trajectory *guess);

/// Raises and lowers the first tree that can rise onto what is below it, at each knot but the first and the last: so high
/// above it as these are. Smoothed over a quarter of a second; nothing where these are in the air.
cav_status cav_ground(const cav_model *model, cav_trajectory *guess);

/// Whether the problem starts or ends within a centimetre of a solid of the world.
cav_status cav_stands_on_solid(const cav_problem *problem, int *stands);

/// Whether the problem's guess runs into a solid of the world, by a centimetre or more.
cav_status cav_guess_collides(const cav_problem *problem, int *collides);

/// Whether the problem's guess goes through the ground: deeper than half of what its links are apart at the start.
cav_status cav_guess_sinks(const cav_problem *problem, int *sinks);

#endif
