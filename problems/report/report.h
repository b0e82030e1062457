/// The report of a scene: error against run time, measured on this machine, as a page and tables.
#ifndef CAVORT_REPORT_H
#define CAVORT_REPORT_H

#include "measure.h"

typedef struct cav_report_request {
  const cav_model *model;
  const cav_problem *problem; ///< whose model it is; NULL: a model alone
  const char *name;           ///< of the scene
  const char *folder;         ///< made where it is missing
  int quick;                  ///< 1: in about ten seconds, 0: in minutes
  cav_measure_tell tell;
  void *context;
  const cav_provenance *provenance;
} cav_report_request;

/// Measures, and writes report.html, forward.csv, step.csv, derivative.csv, law.csv, and for a problem plan.csv and
/// plan_trace.csv into the folder. CAV_BAD_INPUT: nothing moves, or the folder cannot be written; CAV_INTERRUPTED: tell
/// said so, and nothing is written; CAV_NO_MEMORY.
cav_status cav_report_write(const cav_report_request *request, cav_error *error);

#endif
