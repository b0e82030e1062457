/// What estimation on line sees of an optimiser. Private to optim/.
#ifndef CAVORT_OPTIMISER_H
#define CAVORT_OPTIMISER_H

#include "continuation.h"

/// Its transcription and motion, until it is freed.
cav_solve_run *cav_optimiser_run(cav_optimiser *optimiser);

#endif
