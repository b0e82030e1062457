/// What holds at one value of one parameter, and why what does not. Private to stress/.
#ifndef CAVORT_PROBE_H
#define CAVORT_PROBE_H

#include "bench.h"

/// How much is measured at one value.
typedef struct cav_stress_effort {
  int samples, steps, differences;
} cav_stress_effort;

/// What was seen at a value, for the reason that is told.
typedef struct cav_stress_trace {
  cav_stress_measure worst; ///< what is furthest from well
  cav_status status;        ///< of the first evaluation that failed otherwise than by not converging
  const char *call;         ///< which that was; NULL: none did
  int silent;               ///< a call came back as good with a number that is not finite
  int dof;                  ///< where the round trip misses most, -1: nowhere
  double rounding_of_u;     ///< what of the miss rounding of the forces explains
  int another;              ///< it misses v' for another v' that the same forces lead to
  int block;                ///< of the derivative that misses most: q, v, v'
  int step;                 ///< of the passive run, at which energy was highest
  int unsolved, solves;     ///< forward steps
  int none;                 ///< of those unsolved, that do not exist
  double rotation;          ///< rad, largest of one dof in one step of the passive run
  double rounding;          ///< m, of the furthest coordinate
} cav_stress_trace;

/// Measures the pushed scene. CAV_NO_MEMORY or CAV_OK: what fails otherwise is what is measured. probe.c.
cav_status cav_stress_measure_point(cav_bench *bench, const cav_stress_effort *effort, cav_stress_point *point,
                                    cav_stress_trace *trace);

/// Sets the level of a point of a sweep and, where it is not safe, in words what is not well and what that comes from. here: the
/// point of the scene's own value, NULL: that is this one. why.c.
void cav_stress_rate(const cav_bench *bench, cav_stress_sweep sweep, const cav_stress_point *here,
                     const cav_stress_trace *trace, cav_stress_point *point);

#endif
