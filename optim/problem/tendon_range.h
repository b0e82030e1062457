/// Ranges of tendons, for postures that have to be within them.
#ifndef CAVORT_TENDON_RANGE_H
#define CAVORT_TENDON_RANGE_H

#include "cavort/dynamics.h"

enum { CAV_TENDON_LABEL = 200 };

/// By how much a length is outside its tendon's range, m or rad: negative below it, 0 within.
double cav_tendon_outside(const cav_tendon *tendon, double length);

/// What ranges="clip" does after joints: tendons whose lengths are outside their ranges are brought in, by small motions of what
/// they hang on, joints within theirs. q [nq] is as it was where that is not found. Uses the state. CAV_NO_MEMORY.
cav_status cav_tendons_clip(const cav_model *model, cav_state *state, double *q);

/// A tendon as errors name it: by its name, or its number and what it goes from and to.
void cav_tendon_label(const cav_model *model, int tendon, char label[CAV_TENDON_LABEL]);

#endif
