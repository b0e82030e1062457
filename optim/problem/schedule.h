/// Stages of a schedule. Private to optim/.
#ifndef CAVORT_SCHEDULE_H
#define CAVORT_SCHEDULE_H

#include "cavort/problem.h"

/// Contact law at a fraction of the schedule, 0 .. 1, for a step in s; the rest of law stays.
void cav_stage_law(const cav_problem *problem, double fraction, double step, cav_options *law);

/// The stage at a fraction of the way from first to last.
cav_stage_options cav_schedule_at(const cav_schedule *schedule, double fraction);

/// Part of the usual smoothing between links of one mechanism that goes for a model, by the reach of its largest tree: links of
/// a gripper's linkage stand closer to each other than a person's. 1 where no trees are joined to one, and of NULL.
double cav_schedule_part(const cav_model *model);

/// Whether a term compares the motion with a record.
int cav_problem_has_record(const cav_problem *problem);

/// Whether its motion follows from its start alone: no actuator moves the model, and no residual force or free start is there.
int cav_problem_is_given(const cav_problem *problem);

#endif
