/// rows.csv of a result folder: the constraint rows that had a say at the end of a solve.
#ifndef CAVORT_ROWS_H
#define CAVORT_ROWS_H

#include "cavort/solve.h"

/// Replaces the file atomically.
cav_status cav_rows_write(const char *path, double timestep, int nrow, const cav_binding *row, cav_error *error);

/// Reads rows into fresh memory; CAV_BAD_INPUT with file and line, CAV_NO_MEMORY. What their numbers stand for is
/// checked by cav_explain.
cav_status cav_rows_read(const char *path, int *nrow, cav_binding **row, cav_error *error);

#endif
