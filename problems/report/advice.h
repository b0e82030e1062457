/// What to use on a scene, derived from what was measured of it.
#ifndef CAVORT_ADVICE_H
#define CAVORT_ADVICE_H

#include "measure.h"

/// Cheapest order and step that keep the ends of the motions that are known within a fraction of the size.
typedef struct cav_advice_step {
  double fraction; ///< of the size
  int row;         ///< of the sheet of steps, of the motion that decides; -1: none that was measured
  double error;    ///< the larger of both motions'
} cav_advice_step;

enum { CAV_ADVICE_STEPS = 5, CAV_ADVICE_TARGET = 1 };

typedef struct cav_advice {
  double size; ///< largest way of a coordinate in either motion, m or rad: what errors are held against
  int motion;  ///< 0 without, 1 with contacts: the motion whose time counts; -1: none is known
  int both;    ///< 1: errors of both count
  cav_advice_step step[CAV_ADVICE_STEPS]; ///< from coarse to fine; CAV_ADVICE_TARGET is the one that is recommended
  double bound; ///< error of a velocity, m/s or rad/s, that solvers may leave: a tenth of what the step does
  int forward;  ///< row of the forward solver to use, -1: none stays within it
  int cheapest; ///< that of the cheapest within it
  int sweeps;   ///< cheapest Gauss-Seidel within it, -1: none
  int plan;     ///< row of the fastest feasible solve within 10 % of the least cost, own step and order, -1: none
  int nearest;  ///< that of the least violation, where none is feasible
} cav_advice;

/// Reads the sheets; plan may be NULL.
void cav_advice_take(const cav_measure_forward *forward, const cav_measure_step *step, const cav_measure_plan *plan,
                     cav_advice *advice);

#endif
