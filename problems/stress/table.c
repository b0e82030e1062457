/// What a stress run found, as two tables: every point of every sweep, and the range of each parameter.
#include <math.h>
#include <stdio.h>

#include "csv.h"
#include "file.h"
#include "stress.h"

static void put(FILE *out, double value) {
  fputc(',', out);
  // numbers are shown, not read back: few digits
  if (isinf(value))
    fputs("failed", out);
  else if (!isnan(value))
    fprintf(out, "%.4g", value);
}

static void write_point(FILE *out, cav_stress_sweep sweep, const cav_stress_result *r, int i) {
  const cav_stress_point *p = &r->point[i];
  fputs(cav_stress_sweep_rules[sweep].name, out);
  put(out, p->value);
  fprintf(out, ",%d,%s", i == r->own_point, cav_stress_level_names[p->level]);
  for (int k = 0; k < CAV_STRESS_MEASURE_TYPES; k++) put(out, p->measure[k]);
  fprintf(out, ",%d,%d,", p->iterations, p->contacts);
  cav_table_write_text(out, p->why);
  fputc('\n', out);
}

cav_status cav_stress_write_points(const char *path, const cav_stress_report *report, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("parameter,value,own,level", file.stream);
  for (int k = 0; k < CAV_STRESS_MEASURE_TYPES; k++) fprintf(file.stream, ",%s", cav_stress_measure_rules[k].name);
  fputs(",iterations,contacts,why\n", file.stream);
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++)
    for (int k = 0; k < report->sweep[i].npoint; k++) write_point(file.stream, i, &report->sweep[i], k);
  return cav_file_end(&file, error);
}

static void write_range(FILE *out, cav_stress_sweep sweep, const cav_stress_result *r) {
  const cav_stress_sweep_rule *rule = &cav_stress_sweep_rules[sweep];
  fprintf(out, "%s,", rule->name);
  cav_table_write_text(out, rule->unit);
  if (r->absent) {
    fputs(",,,,,,", out);
    cav_table_write_text(out, r->absent);
    fputs(",\n", out);
    return;
  }
  put(out, r->own);
  for (int side = 0; side < 2; side++) put(out, r->edge[side].safe);
  for (int side = 0; side < 2; side++) put(out, r->edge[side].broken < 0 ? NAN : r->point[r->edge[side].broken].value);
  for (int side = 0; side < 2; side++) {
    fputc(',', out);
    cav_table_write_text(out, r->edge[side].worse < 0 ? "" : r->point[r->edge[side].worse].why);
  }
  fputc('\n', out);
}

cav_status cav_stress_write_ranges(const char *path, const cav_stress_report *report, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("parameter,unit,own,safe from,safe to,breaks below,breaks above,why below,why above\n", file.stream);
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) write_range(file.stream, i, &report->sweep[i]);
  return cav_file_end(&file, error);
}
