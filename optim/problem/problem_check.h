/// Whether a problem filled by hand can be planned. Private to optim/.
#ifndef CAVORT_PROBLEM_CHECK_H
#define CAVORT_PROBLEM_CHECK_H

#include "cavort/problem.h"

/// What a reader of files refuses line by line, of structs: CAV_BAD_INPUT, or CAV_NOT_FINITE for an entry of an array, with
/// the member or the term at fault in error. Quantities of one's own: cav_user_term_check. moving 1: the start moves on
/// along waypoints of targets, so they may lie beyond the horizon.
cav_status cav_problem_check(const cav_problem *problem, int moving, cav_error *error);

#endif
