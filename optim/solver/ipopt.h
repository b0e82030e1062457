/// Ipopt on a transcription. Private to optim/.
#ifndef CAVORT_IPOPT_H
#define CAVORT_IPOPT_H

#include "continuation.h"

/// Whether Ipopt's library can be loaded: CAV_NOT_SUPPORTED with which one is not found.
cav_status cav_ipopt_load(cav_error *error);

/// Solves from run->at with hard equalities and bounds and leaves the result there. CAV_NOT_CONVERGED if Ipopt stops
/// above its tolerances, with its own words in error; CAV_NOT_SUPPORTED as cav_ipopt_load.
cav_status cav_ipopt(cav_solve_run *run, cav_error *error);

#endif
