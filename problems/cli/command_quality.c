/// cavort quality: how good motions are, whatever made them, side by side. And the table of that, which cavort ik writes too.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "command.h"
#include "csv.h"
#include "file.h"
#include "periodicity.h"
#include "result.h"

void cav_command_print_quality(FILE *out, int n, char *const *name, const cav_quality *quality, int csv) {
  int count;
  const cav_quality_rule *rule = cav_quality_rules(&count);
  fprintf(out, csv ? "measure,unit,bar" : "%-22s %-6s %6s", "measure", "unit", "bar");
  for (int i = 0; i < n; i++) {
    const char *slash = strrchr(name[i], '/');
    if (csv)
      fputc(',', out), cav_table_write_text(out, name[i]);
    else
      fprintf(out, " %14.14s", slash && slash[1] ? slash + 1 : name[i]);
  }
  fputc('\n', out);
  for (int k = 0; k < count; k++) {
    if (csv) {
      fprintf(out, "%s,%s,", rule[k].name, rule[k].unit);
      cav_table_write_number(out, rule[k].bar);
    } else {
      fprintf(out, "%-22s %-6s ", rule[k].name, rule[k].unit);
      if (isfinite(rule[k].bar))
        fprintf(out, "%6g", rule[k].bar);
      else
        fprintf(out, "%6s", "");
    }
    for (int i = 0; i < n; i++) {
      double value = *(const double *)((const char *)&quality[i] + rule[k].offset);
      if (csv)
        fputc(',', out), cav_table_write_number(out, value);
      else if (isnan(value))
        fprintf(out, " %14s", "-");
      else
        fprintf(out, " %14.4g", value);
    }
    fputc('\n', out);
  }
}

// of a cycle two strides, since half of one says nothing of left and right
static cav_status measure_result(const cav_result *result, cav_quality *quality, cav_error *error) {
  const cav_problem *problem = result->problem;
  cav_periodicity *periodicity = problem->cycle.on ? cav_periodicity_new(problem, error) : NULL;
  if (problem->cycle.on && !periodicity) return error->status;
  int periods = problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  cav_trajectory *strides = periodicity ? cav_periodicity_unroll(periodicity, result->trajectory, periods) : NULL;
  cav_status status = periodicity && !strides
                          ? cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory")
                          : cav_quality_measure(problem->model, strides ? strides : result->trajectory,
                                                &problem->contact, quality, error);
  cav_periodicity_free(periodicity);
  cav_trajectory_free(strides);
  return status;
}

// a motion without a law of its own, of a model
static cav_status measure_file(const cav_model *model, const char *file, cav_quality *quality, cav_error *error) {
  cav_trajectory *motion = cav_trajectory_read(file, model, error);
  cav_status status = motion ? cav_quality_measure(model, motion, NULL, quality, error) : error->status;
  cav_trajectory_free(motion);
  return status;
}

// a folder's motion with its problem's model and law, a fit's with its repair.xml's model; a file's with --model
static cav_status measure(const cav_command_line *line, const char *path, cav_quality *quality, cav_error *error) {
  struct stat info;
  if (stat(path, &info)) return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: no such folder or file", path);
  int folder = S_ISDIR(info.st_mode);
  char *problem = cav_result_path(path, "problem.xml"), *file = cav_result_path(path, "trajectory.csv"),
       *repair = cav_result_path(path, "repair.xml");
  cav_status status = problem && file && repair ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status && folder && !access(problem, F_OK)) {
    cav_result *result = cav_result_read(path, line->model, error);
    status = result ? measure_result(result, quality, error) : error->status;
    cav_result_free(result);
  } else if (!status && !line->model && folder && !access(repair, F_OK)) {
    cav_problem *fit = cav_problem_load(repair, NULL, error);
    status = fit ? measure_file(fit->model, file, quality, error) : error->status;
    cav_problem_free(fit);
  } else if (!status && !line->model) {
    status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: says no model; give --model FILE", path);
  } else if (!status) {
    cav_model *model = cav_model_load(line->model, error);
    status = model ? measure_file(model, folder ? file : path, quality, error) : error->status;
    cav_model_free(model);
  }
  free(problem), free(file), free(repair);
  return status;
}

int cav_command_quality(const cav_command_line *line) {
  cav_error error = {0};
  cav_quality *quality = calloc((size_t)line->noperand, sizeof *quality);
  cav_status status = quality ? CAV_OK : cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory");
  for (int i = 0; i < line->noperand && !status; i++) status = measure(line, line->operands[i], &quality[i], &error);
  if (!status) cav_command_print_quality(stdout, line->noperand, line->operands, quality, line->csv);
  free(quality);
  return status ? cav_command_fail(&error) : 0;
}
