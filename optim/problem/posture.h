/// Postures of any humanoid or quadruped by name: kneeling, sitting, lying. Private to optim/ and the tool.
#ifndef CAVORT_POSTURE_H
#define CAVORT_POSTURE_H

#include "cavort/problem.h"
#include "role.h"

/// Names of the postures, NULL after the last; "stand" (stand.h) is none of them.
extern const char *const cav_posture_names[];

/// What a posture of that list is, in words.
const char *cav_posture_meaning(const char *name);

/// q [nq] of a posture of that list: the model's own facing, what touches the ground at height 0, joints within their
/// ranges. CAV_BAD_INPUT: there is none, and why in why [200]. Uses the state.
cav_status cav_posture_named(const cav_model *model, cav_state *state, const char *name, double *q, char *why);

#endif
