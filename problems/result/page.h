/// The page of a result: which charts it draws and what it says.
#ifndef CAVORT_PAGE_H
#define CAVORT_PAGE_H

#include "cavort/mocap.h"
#include "cavort/solve.h"
#include "forces.h"

/// A motion on a page.
typedef struct cav_page_motion {
  const char *label; ///< tells it from the other one
  const cav_problem *problem;
  const cav_trajectory *trajectory;
  const cav_forces *forces;
  int periods; ///< that the trajectory has: more than 1 of a cycle; what was asked is marked in the first
  const cav_verdict *verdict; ///< NULL: none
  const cav_quality *quality; ///< NULL: not told
} cav_page_motion;

enum { CAV_PAGE_UNDRAWN = 500 };

/// The problem's model once more with what is only seen of it, for cav_view_input; its bodies are the model's first ones, the
/// problem's scene comes after them. NULL: there is none, and where there may be more to see why. Freed with
/// cav_model_free.
cav_model *cav_page_drawn(const cav_problem *problem, char undrawn[CAV_PAGE_UNDRAWN]);

/// Writes the page of n motions, 1 or 2: the motions, contact forces, targets, charts of forces, heights, efforts and joints
/// with their limits, and the verdicts. Errors as cav_view_write's.
cav_status cav_page_write(const char *path, int n, const cav_page_motion *motion, cav_error *error);

#endif
