/// A table of measurements: columns of text, then of numbers, each with what it means. One sheet becomes a CSV file and a
/// table of a page.
#ifndef CAVORT_SHEET_H
#define CAVORT_SHEET_H

#include <math.h>

#include "html.h"

enum { CAV_SHEET_TEXTS = 3, CAV_SHEET_LABEL = 64 };

/// A number that a row has no meaning for: an empty cell, which is no failure.
#define CAV_SHEET_NONE (-HUGE_VAL)

typedef struct cav_sheet_column {
  const char *name; ///< in the file's first line
  const char *text; ///< what it is, with its unit
} cav_sheet_column;

typedef struct cav_sheet_row {
  char label[CAV_SHEET_TEXTS][CAV_SHEET_LABEL];
  int marked; ///< of the Pareto set
} cav_sheet_row;

typedef struct cav_sheet {
  const char *name; ///< file without ".csv"
  int ntext, nnumber;
  const cav_sheet_column *column; ///< [ntext+nnumber]
  int nrow, room;
  cav_sheet_row *row; ///< [nrow]
  double *value;      ///< [nrow*nnumber] not finite but CAV_SHEET_NONE: failed
  int lost;           ///< rows for which there was no memory
} cav_sheet;

void cav_sheet_free(cav_sheet *sheet);

/// A new row of these texts (NULL: ""), numbers CAV_SHEET_NONE; they are filled before the next one is added. NULL if
/// memory runs out.
double *cav_sheet_add(cav_sheet *sheet, const char *a, const char *b, const char *c);

/// Number of a row's column; column counts the numbers alone.
static inline double cav_sheet_get(const cav_sheet *sheet, int row, int column) {
  return sheet->value[row * sheet->nnumber + column];
}

/// Writes NAME.csv into a folder, numbers with 9 digits, "failed" where they are not finite, nothing where there is
/// none. Fails as cav_file_begin and cav_file_end do.
cav_status cav_sheet_write(const cav_sheet *sheet, const char *folder, cav_error *error);

/// A table of those of its columns (of all, in any order, -1 ends them) and rows that keep (NULL: all) says.
void cav_sheet_show(const cav_sheet *sheet, cav_html *page, const char *caption, const int *column,
                    const char *const *heading, int (*keep)(const cav_sheet *sheet, int row));

/// A link to its file and what its columns are.
void cav_sheet_link(const cav_sheet *sheet, cav_html *page, const char *text);

#endif
