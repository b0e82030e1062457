/// Constraint rows as a table of numbers: one line a row, by knot. Open bounds are written as numbers beyond 1e300,
/// since a table holds finite numbers only.
#include "constraint_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "file.h"

enum { COLUMNS = 11 };
static const char *const column[COLUMNS] = {"knot",  "time",  "kind",    "object",     "component", "value",
                                            "lower", "upper", "allowed", "multiplier", "pull"};
static const double open_end = 1e308;

static double bounded(double x) { return fmin(fmax(x, -open_end), open_end); }
static double opened(double x) { return fabs(x) >= open_end ? copysign(INFINITY, x) : x; }

cav_status cav_rows_write(const char *path, double timestep, int nrow, const cav_binding *row, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  for (int c = 0; c < COLUMNS; c++) fprintf(file.stream, "%s%s", c ? "," : "", column[c]);
  fputc('\n', file.stream);
  for (int i = 0; i < nrow; i++) {
    const cav_binding *r = &row[i];
    const double value[] = {r->value, bounded(r->lower), bounded(r->upper), r->allowed, r->multiplier, r->pull};
    fprintf(file.stream, "%d,", r->knot);
    cav_table_write_number(file.stream, r->knot * timestep);
    fprintf(file.stream, ",%d,%d,%d", (int)r->kind, r->object, r->component);
    for (int c = 0; c < 6; c++) fputc(',', file.stream), cav_table_write_number(file.stream, value[c]);
    fputc('\n', file.stream);
  }
  return cav_file_end(&file, error);
}

cav_status cav_rows_read(const char *path, int *nrow, cav_binding **row, cav_error *error) {
  *nrow = 0;
  *row = NULL;
  cav_table *table = cav_table_read(path, error);
  if (!table) return error ? error->status : CAV_BAD_INPUT;
  cav_status status = CAV_OK;
  int alike = table->ncol == COLUMNS;
  for (int c = 0; alike && c < COLUMNS; c++) alike = !strcmp(table->name[c], column[c]);
  if (!alike)
    status = cav_file_fail(error, CAV_BAD_INPUT, 1,
                           "%s:1: expected the columns knot, time, kind, ... pull; solve again", path);
  if (!status && !(*row = calloc((size_t)table->nrow + 1, sizeof **row)))
    status = cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
  for (int i = 0; i < table->nrow && !status; i++) {
    const double *x = table->value + (size_t)i * COLUMNS;
    static const int whole[] = {0, 2, 3, 4};
    for (int k = 0; k < 4 && !status; k++) {
      if (x[whole[k]] >= 0 && x[whole[k]] <= 1e9 && x[whole[k]] == floor(x[whole[k]])) continue;
      status =
          cav_file_fail(error, CAV_BAD_INPUT, table->line[i], "%s:%d: expected a whole number in column '%s', got %g",
                        path, table->line[i], column[whole[k]], x[whole[k]]);
    }
    if (status) break;
    if (x[2] >= CAV_BINDING_PENETRATION)
      status = cav_file_fail(error, CAV_BAD_INPUT, table->line[i], "%s:%d: expected a kind below %d, got %g", path,
                             table->line[i], CAV_BINDING_PENETRATION, x[2]);
    (*row)[i] = (cav_binding){.knot = (int)x[0],
                              .kind = (cav_binding_kind)x[2],
                              .object = (int)x[3],
                              .component = (int)x[4],
                              .value = x[5],
                              .lower = opened(x[6]),
                              .upper = opened(x[7]),
                              .allowed = x[8],
                              .multiplier = x[9],
                              .pull = x[10]};
  }
  if (!status) *nrow = table->nrow;
  if (status) free(*row), *row = NULL;
  cav_table_free(table);
  return status;
}
