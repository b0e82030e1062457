/// Options of an evaluation, by their table: whether they are right, and what a change of them leaves as it was.
/// Private to dynamics/.
#ifndef CAVORT_OPTIONS_H
#define CAVORT_OPTIONS_H

#include "cavort/dynamics.h"

/// Whether every option is one that cav_options_check lets pass.
int cav_options_valid(const cav_options *options);

/// Whether what an evaluation computes up to and with a stage is the same under both.
int cav_options_same(const cav_options *a, const cav_options *b, cav_stage stage);

#endif
