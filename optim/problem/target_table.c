/// Targets of a term from a CSV file: a column 'time' and one column for each number of the target, by their names or
/// in their order. Rows become waypoints. Complaints name the problem file with its line and the table with its own.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "file.h"
#include "problem_file.h"

static const double near_knot = 1e-6; // of a step

// column of that name, -1: none
static int column_of(const cav_table *table, const char *name) {
  for (int i = 0; i < table->ncol; i++)
    if (!strcmp(table->name[i], name)) return i;
  return -1;
}

// the columns that 'columns' names, separated by |
static cav_status named_columns(const cav_problem_reader *reader, const cav_xml_node *node, const cav_table *table,
                                int count, int *column) {
  char *copy = strdup(cav_xml_text(node, "columns", "")), *rest = copy, *name;
  int n = 0;
  cav_status status = copy ? CAV_OK : cav_problem_no_memory(reader);
  while (!status && (name = strsep(&rest, "|"))) {
    name += strspn(name, " ");
    for (size_t k = strlen(name); k && name[k - 1] == ' '; k--) name[k - 1] = 0;
    int found = column_of(table, name);
    if (found < 0) {
      const char *near = cav_xml_nearest(name, table->name, table->ncol, sizeof *table->name);
      status = cav_xml_fail(reader->error, node, "columns", "%s has no column '%.80s'%s%.80s%s", table->path, name,
                            near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
    } else if (n < count) {
      column[n] = found;
    }
    n++;
  }
  if (!status && n != count)
    status = cav_xml_fail(reader->error, node, "columns",
                          "expected %d columns, one for each number of the target, got %d", count, n);
  free(copy);
  return status;
}

// all columns but time, in their order
static cav_status ordered_columns(const cav_problem_reader *reader, const cav_xml_node *node, const cav_table *table,
                                  int time, int count, int *column) {
  if (table->ncol - 1 != count)
    return cav_xml_fail(
        reader->error, node, "file",
        "%s:1: expected time and %d columns, one for each number of the target, got %d; name those to take "
        "in 'columns'",
        table->path, count, table->ncol - 1);
  for (int i = 0, n = 0; i < table->ncol; i++)
    if (i != time) column[n++] = i;
  return CAV_OK;
}

// whether a time is one of the motion
static int is_within(const cav_problem_reader *reader, double t) {
  return t >= -near_knot * reader->problem->timestep && t <= reader->problem->duration * (1 + near_knot);
}

// times increase and, where the table is not said to be longer than the motion, lie within the horizon; *first and *n
// rows are the motion's
static cav_status check_times(const cav_problem_reader *reader, const cav_xml_node *node, const cav_table *table,
                              int time, int *first, int *n) {
  double before = -INFINITY, offset = cav_xml_real(node, "offset", 0);
  int cut = cav_xml_get(node, "offset") != NULL;
  *first = *n = 0;
  for (int i = 0; i < table->nrow; i++) {
    double t = table->value[(size_t)i * (size_t)table->ncol + (size_t)time];
    if (!cut && !is_within(reader, t))
      return cav_xml_fail(
          reader->error, node, "file",
          "%s:%d: expected a time within the horizon, 0 .. %g s, got %g; of a longer table say 'offset'", table->path,
          table->line[i], reader->problem->duration, t);
    if (t <= before)
      return cav_xml_fail(reader->error, node, "file", "%s:%d: expected a time after the one before, %g s, got %g",
                          table->path, table->line[i], before, t);
    before = t;
    if (!is_within(reader, t - offset)) continue;
    if (!*n) *first = i;
    ++*n;
  }
  if (*n > 0) return CAV_OK;
  return cav_xml_fail(reader->error, node, "file", "%s: expected at least one row of targets%s", table->path,
                      cut ? " within the motion" : "");
}

static cav_status target_columns(const cav_problem_reader *reader, const cav_xml_node *node, const cav_table *table,
                                 int *column, cav_problem_targets *targets) {
  int time = column_of(table, "time"), count = targets->count, first, n;
  if (time < 0) return cav_xml_fail(reader->error, node, "file", "%s:1: expected a column 'time', s", table->path);
  cav_status status = cav_xml_get(node, "columns") ? named_columns(reader, node, table, count, column)
                                                   : ordered_columns(reader, node, table, time, count, column);
  if (!status) status = check_times(reader, node, table, time, &first, &n);
  if (status) return status;
  targets->n = n;
  targets->time = cav_problem_alloc(reader->owner, sizeof(double) * (size_t)n * (size_t)(count + 1));
  if (!targets->time) return cav_problem_no_memory(reader);
  targets->value = targets->time + n;
  for (int i = 0; i < n; i++) {
    const double *row = table->value + (size_t)(first + i) * (size_t)table->ncol;
    targets->time[i] = fmax(row[time] - cav_xml_real(node, "offset", 0), 0);
    for (int k = 0; k < count; k++) targets->value[(size_t)i * (size_t)count + (size_t)k] = row[column[k]];
  }
  return CAV_OK;
}

cav_status cav_problem_table(const cav_problem_reader *reader, const cav_xml_node *node, cav_problem_targets *targets) {
  char *path = cav_file_beside(reader->path, cav_xml_text(node, "file", ""));
  int *column = calloc((size_t)targets->count + 1, sizeof *column);
  cav_status status = path && column ? CAV_OK : cav_problem_no_memory(reader);
  cav_error inner = {0};
  cav_table *table = status ? NULL : cav_table_read(path, &inner);
  if (!status && !table) status = cav_xml_fail_as(reader->error, inner.status, node, "file", "%s", inner.text);
  if (!status) status = target_columns(reader, node, table, column, targets);
  cav_table_free(table);
  free(column);
  free(path);
  return status;
}
