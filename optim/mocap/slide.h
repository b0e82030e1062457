/// How far contacts of a motion slide, knot by knot. Private to optim/mocap.
#ifndef CAVORT_SLIDE_H
#define CAVORT_SLIDE_H

#include "cavort/dynamics.h"

typedef struct cav_slide cav_slide;

/// For a motion of at most nknot knots; NULL without memory.
cav_slide *cav_slide_new(const cav_model *model, int nknot);
void cav_slide_free(cav_slide *slide);

/// The next knot, at the contacts of a state there. CAV_NO_MEMORY; CAV_BAD_INPUT beyond the last knot.
cav_status cav_slide_add(cav_slide *slide, const cav_state *state);

/// Whether any contact with what is external to its tree lasts from a knot through so many steps, all of them added, and the
/// longest slide of those that do, m.
int cav_slide_over(const cav_slide *slide, int from, int steps, double *longest);

#endif
