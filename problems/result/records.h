/// How far a motion is from the records that its problem holds it to, channel by channel.
#ifndef CAVORT_RECORDS_H
#define CAVORT_RECORDS_H

#include <stdio.h>

#include "cavort/solve.h"

/// Residuals of every record of a problem, term by term.
typedef struct cav_records {
  const cav_problem *problem;      // borrowed
  int nrecord;                     // terms with a record
  cav_channel_residual **residual; // [problem->nterm] each [nchannel]; NULL: the term has no record
} cav_records;

/// Measures a motion under the law contact; NULL on failure with the reason in error. Freed with cav_records_free.
cav_records *cav_records_measure(const cav_problem *problem, const cav_trajectory *trajectory,
                                 const cav_options *contact, cav_error *error);
void cav_records_free(cav_records *records);

/// Root mean square of the distances of all markers, m; NaN: no marker is seen.
double cav_records_markers(const cav_records *records);

/// Writes records.csv: of each channel its record, name and kind, what is compared and its unit, the knots that see it,
/// rms, noise (sd) and largest distance in that unit, and the time of that, s; empty where no knot sees it.
cav_status cav_records_write(const char *path, const cav_records *records, cav_error *error);

/// A line for each record and kind of channel in it.
void cav_records_print(FILE *out, const cav_records *records);

#endif
