/// Numbers under named columns, as a CSV file. Private: not installed.
#ifndef CAVORT_TABLE_H
#define CAVORT_TABLE_H

#include <stdio.h>

#include "cavort/status.h"

typedef struct cav_table {
  char *path;
  int nrow, ncol;
  char **name;   ///< [ncol]
  double *value; ///< [nrow*ncol], all finite, unless gaps
  int gaps;      ///< 1: fields may be empty
  int *line;     ///< [nrow] where each row stands in the file
} cav_table;

/// Reads a file of one line of names and lines of as many numbers, all finite; blank lines are passed over. NULL on
/// failure with the reason in error (may be NULL): CAV_BAD_INPUT or CAV_NO_MEMORY.
cav_table *cav_table_read(const char *path, cav_error *error);

/// The same of a table in which fields may be empty or NaN: NaN.
cav_table *cav_table_read_gaps(const char *path, cav_error *error);

/// Frees a table; NULL is fine.
void cav_table_free(cav_table *table);

/// Writes a field, in quotes where commas, quotes or line ends ask for them.
void cav_table_write_text(FILE *stream, const char *text);

/// Writes a number such that reading it gives the same bits, nothing for one that is not finite.
void cav_table_write_number(FILE *stream, double value);

#endif
