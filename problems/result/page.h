/// The page of a result: which charts it draws and what it says.
#ifndef CAVORT_PAGE_H
#define CAVORT_PAGE_H

#include "cavort/solve.h"
#include "forces.h"

/// Writes view.html: the motion, contact forces, charts of forces, heights, efforts and joints with their limits, and
/// the verdict (NULL: none). Errors as cav_view_write's.
cav_status cav_page_write(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                          const cav_forces *forces, const cav_verdict *verdict, cav_error *error);

#endif
