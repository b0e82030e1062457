/// The folder of a solved motion: what the tool writes into it beside the library's files (cavort/result.h).
#ifndef CAVORT_RESULT_H
#define CAVORT_RESULT_H

#include "result_file.h"

/// Writes what can be read as a result before there is one: trajectory.csv, and if it is the first time problem.xml
/// with the law at the end of the schedule, and rows.csv without rows.
cav_status cav_result_write_unfinished(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                       int first, cav_error *error);

/// Writes forces.csv and view.html from the motion; verdict may be NULL.
cav_status cav_result_write_page(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                 const cav_options *contact, const cav_verdict *verdict, cav_error *error);

/// Writes one page of two motions, their labels, verdicts and qualities (cavort/mocap.h) beside each other. verdict[i]
/// NULL: a fit, which has no forces.
cav_status cav_result_compare(const char *page, const char *const label[2], const cav_result *const result[2],
                              const cav_verdict *const verdict[2], cav_error *error);

#endif
