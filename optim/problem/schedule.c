/// The schedule as data: the stage, and the contact law of it, at any fraction of the way from the first to the last.
#include "schedule.h"

#include <math.h>

static double between(double from, double to, double s) {
  return from > 0 && to > 0 ? from * pow(to / from, s) : (1 - s) * from + s * to;
}

cav_stage_options cav_schedule_at(const cav_schedule *schedule, double x) {
  const cav_stage_options *a = &schedule->first, *b = &schedule->last;
  cav_stage_options stage = x < 1 ? *a : *b;
  stage.softness = between(a->softness, b->softness, x);
  stage.time_constant = between(a->time_constant, b->time_constant, x);
  stage.smoothing = between(a->smoothing, b->smoothing, x);
  stage.smoothing_self = between(a->smoothing_self, b->smoothing_self, x);
  stage.self_stiffness = between(a->self_stiffness, b->self_stiffness, x);
  stage.penalty = between(a->penalty, b->penalty, fmin(2 * x, 1));
  return stage;
}

void cav_stage_law(const cav_problem *problem, double x, double step, cav_options *law) {
  cav_stage_options stage = cav_schedule_at(&problem->schedule, x);
  law->stabilisation = CAV_STABILISATION_DISCRETE;
  law->softness = stage.softness;
  law->time_constant = stage.time_constant * step;
  law->smoothing = stage.smoothing;
  law->smoothing_self = stage.smoothing_self;
  law->self_stiffness = stage.self_stiffness;
}
