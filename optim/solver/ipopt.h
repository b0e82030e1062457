/// Ipopt on a transcription. Private to optim/.
#ifndef CAVORT_IPOPT_H
#define CAVORT_IPOPT_H

#include "continuation.h"

/// Solves from run->at with hard equalities and bounds and leaves the result there. CAV_NOT_CONVERGED if Ipopt stops
/// above its tolerances, with its own words in error.
cav_status cav_ipopt(cav_solve_run *run, cav_error *error);

#endif
