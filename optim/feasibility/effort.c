/// What actuators can give at most.
///
/// A motion is certified at the fraction of the limits that it is planned with. What the problem states below the usual
/// one stays (solver/repair.c), so that fraction counts; else repairs may raise it, and full limits do.
#include <math.h>
#include <stdlib.h>

#include "cavort/solve.h"
#include "feasibility.h"

double cav_effort_part(const cav_examination *e) {
  double usual = cav_problem_default(e->model).effort_limit, stated = e->problem->effort_limit;
  return stated < usual ? stated * (1 + CAV_TOLERANCE_LIMIT) : 1;
}

cav_status cav_effort_of_dofs(cav_examination *e, double *force, int *bounded) {
  const cav_model *m = e->model;
  double *moment = malloc((size_t)(m->nv + 1) * sizeof *moment);
  if (!moment) return CAV_NO_MEMORY;
  *bounded = 1;
  for (int d = 0; d < m->nv; d++) force[d] = 0;
  for (int i = 0; i < m->nu; i++) {
    double range[2];
    cav_actuator_effort_range(m, i, range);
    double most = cav_effort_part(e) * fmax(fabs(range[0]), fabs(range[1])) * fabs(m->actuator[i].unit);
    *bounded &= m->actuator[i].constant && isfinite(most);
    cav_actuator_length(m, e->start, i, moment);
    for (int d = 0; d < m->nv; d++)
      if (moment[d] != 0) force[d] += most * fabs(moment[d]);
  }
  free(moment);
  return CAV_OK;
}
