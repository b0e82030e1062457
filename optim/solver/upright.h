/// Terms that keep upright what no actuator moves and what is to stand at the goal as it did at the start. Private to
/// optim/solver.
#ifndef CAVORT_UPRIGHT_H
#define CAVORT_UPRIGHT_H

#include "cavort/problem.h"

/// Writes these terms, which borrow the problem's start; term: room for one of each joint, NULL: they are counted alone.
/// Returns their number: of each free body that no actuator moves, which terms or the goal want elsewhere, turned at the
/// goal as at the start, that has a side to stand on, and whose turn no term tells on the way.
int cav_upright_terms(const cav_problem *problem, cav_term *term);

/// Whether terms bring something to one of these bodies already, by places in its frame: what pushes it has not to be found.
int cav_upright_held(const cav_problem *problem);

/// One of these terms as it would stand in the problem's file, after a comma.
void cav_upright_describe(const cav_problem *problem, const cav_term *term, char *text, size_t size);

#endif
