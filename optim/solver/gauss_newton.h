/// Trust-region solver of a transcription. Private to optim/.
#ifndef CAVORT_GAUSS_NEWTON_H
#define CAVORT_GAUSS_NEWTON_H

#include "normal_equations.h"

/// What one run of the trust region may do and has done.
typedef struct cav_region {
  double radius;    ///< kept from run to run; 0: first Cauchy step
  int iterations;   ///< at most
  double tolerance; ///< two relative decreases in a row below it end the run
  int single;       ///< 1: one step is tried an iteration, and a worse one costs it
  int done;         ///< iterations made, over all runs
  int stalled; ///< the last run ended at a jump: the step that helped was a millionth of the one wanted, or none did
  int settled; ///< the last run ended by its tolerance
  double seconds_linear;
  int (*report)(void *context, double step, double radius); ///< after each iteration; nonzero stops
  void *context;
} cav_region;

/// Minimises the transcription's merit from *at by Gauss-Newton steps (dogleg in the norm of sqrt(diag H)). *at and
/// *spare are exchanged as steps are taken; on return the transcription holds the values at *at. CAV_INTERRUPTED if
/// report asked; CAV_NOT_FINITE if *at itself cannot be evaluated.
cav_status cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *transcription,
                               cav_trajectory **at, cav_trajectory **spare);

#endif
