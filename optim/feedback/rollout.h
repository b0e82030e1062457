/// Gains put together of those of several regulators. Private to optim/feedback.
#ifndef CAVORT_ROLLOUT_H
#define CAVORT_ROLLOUT_H

#include "transcription.h"
#include "verification.h"

/// Gains of a motion that is no cycle, [2*n] each, n = last*nv*nv, gain_q before gain_v: of every piece those of the set by
/// which the closed loop before the pushes that strays most does least so, a while beyond it. CAV_NO_MEMORY, CAV_INTERRUPTED,
/// or what a simulation says.
cav_status cav_rollout(const cav_transcription *transcription, const cav_verification *verification, int sets,
                       const double *const *set, double *gain);

#endif
