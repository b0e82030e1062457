/// Result folders. Every file is replaced atomically and alone: a folder that was interrupted holds whole files.
///
/// gains.csv: one row for each knot that has a step after it and each dof i, in that order: knot, time, dof, then the
/// rows of both matrices, q_0 .. q_{nv-1}, v_0 .. v_{nv-1}: u_i changes by sum_j q_j dq_j + v_j dv_j, with dq the
/// tangent difference of the configuration from the knot's and dv that of the velocity.
#include "cavort/result.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "constraint_table.h"
#include "csv.h"
#include "file.h"
#include "forces.h"
#include "result_file.h"
#include "verdict_file.h"

char *cav_result_path(const char *folder, const char *name) {
  size_t n = strlen(folder);
  char *path = malloc(n + strlen(name) + 2);
  if (path) sprintf(path, "%s%s%s", folder, n && folder[n - 1] == '/' ? "" : "/", name);
  return path;
}

static cav_status no_memory(cav_error *error) {
  return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the result");
}

cav_status cav_result_folder(const char *folder, cav_error *error) {
  char *path = strdup(folder);
  if (!path) return no_memory(error);
  cav_status status = CAV_OK;
  for (char *end = path; *end && !status;) {
    end += strspn(end, "/");
    end += strcspn(end, "/");
    char kept = *end;
    *end = 0;
    struct stat about;
    if (mkdir(path, 0777) != 0 && !(errno == EEXIST && stat(path, &about) == 0 && S_ISDIR(about.st_mode))) {
      status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: the folder cannot be made: %s", path, strerror(errno));
    }
    *end = kept;
  }
  free(path);
  return status;
}

static cav_status write_gains(const char *path, const cav_model *model, const cav_solution *solution,
                              cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  int nv = model->nv;
  fputs("knot,time,dof", file.stream);
  for (int j = 0; j < nv; j++) fprintf(file.stream, ",q_%d", j);
  for (int j = 0; j < nv; j++) fprintf(file.stream, ",v_%d", j);
  fputc('\n', file.stream);
  for (int t = 0; t + 1 < solution->trajectory->nknot; t++) {
    for (int i = 0; i < nv; i++) {
      size_t row = ((size_t)t * (size_t)nv + (size_t)i) * (size_t)nv;
      fprintf(file.stream, "%d,", t);
      cav_table_write_number(file.stream, t * solution->trajectory->timestep);
      fprintf(file.stream, ",%d", i);
      for (int j = 0; j < nv; j++)
        fputc(',', file.stream), cav_table_write_number(file.stream, solution->gain_q[row + (size_t)j]);
      for (int j = 0; j < nv; j++)
        fputc(',', file.stream), cav_table_write_number(file.stream, solution->gain_v[row + (size_t)j]);
      fputc('\n', file.stream);
    }
  }
  return cav_file_end(&file, error);
}

static cav_status write_log(const char *path, const cav_solution *solution, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("iteration,phase,stage,cost,unactuated,violation,step,radius,knot,seconds\n", file.stream);
  for (int i = 0; i < solution->nprogress; i++) {
    const cav_progress *p = &solution->progress[i];
    const double value[5] = {p->cost, p->unactuated, p->violation, p->step, p->radius};
    fprintf(file.stream, "%d,%s,%d", p->iteration, p->phase, p->stage);
    for (int k = 0; k < 5; k++) fputc(',', file.stream), cav_table_write_number(file.stream, value[k]);
    fprintf(file.stream, ",%d,", p->knot);
    cav_table_write_number(file.stream, p->seconds);
    fputc('\n', file.stream);
  }
  return cav_file_end(&file, error);
}

// path of a file as seen from a folder, both absolute, the folder ending in a slash: through the folders that they
// share; absolute if that is the root alone, unless a relative path is wanted there, too
static char *seen_from(const char *folder, const char *file, int relative) {
  size_t shared = 0, up = 0;
  for (size_t i = 0; folder[i] && folder[i] == file[i]; i++) {
    if (file[i] == '/') shared = i + 1;
  }
  for (const char *c = folder + shared; *c; c++) up += *c == '/';
  char *path = malloc(3 * up + strlen(file) + 1);
  if (!path) return NULL;
  *path = 0;
  for (size_t i = 0; i < up && (shared > 1 || relative); i++) strcat(path, "../");
  return strcat(path, file + (shared > 1 || relative ? shared : 0));
}

char *cav_result_seen_from(const char *folder, const char *path_of_file, int relative, cav_error *error) {
  char *resolved = realpath(folder, NULL), *file = realpath(path_of_file, NULL);
  char *from = resolved && file ? cav_result_path(resolved, "") : NULL, *path = NULL;
  if (!resolved || !file) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be found: %s", resolved ? path_of_file : folder,
                  strerror(errno));
  } else if (!from || !(path = seen_from(from, file, relative))) {
    no_memory(error);
  }
  free(resolved);
  free(file);
  free(from);
  return path;
}

char *cav_result_folder_of(const char *path) {
  const char *slash = strrchr(path, '/');
  return slash ? strndup(path, slash > path ? (size_t)(slash - path) : 1) : strdup(".");
}

cav_status cav_result_write_problem(const char *folder, const cav_problem *problem, const cav_options *contact,
                                    cav_error *error) {
  cav_error inner = {0};
  if (!problem->model_path)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "%s: not written: the model has no file, since it was made in code; write it into one "
                         "(cav_draft_mjcf) and set the problem's model_path",
                         folder);
  char *path = cav_result_path(folder, "problem.xml"),
       *model = cav_result_seen_from(folder, problem->model_path, 0, &inner);
  if (!model || !path) {
    cav_status status = model ? CAV_NO_MEMORY : inner.status;
    if (error) *error = inner;
    if (model) no_memory(error);
    free(path), free(model);
    return status;
  }
  cav_problem copy = *problem;
  copy.solved = 1;
  copy.contact = *contact;
  cav_status status = cav_problem_write(path, &copy, model, error);
  free(path), free(model);
  return status;
}

static cav_status write_stages(const char *path, const cav_solution *solution, cav_error *error) {
  static const char *const outcome[] = {[CAV_OUTCOME_SETTLED] = "settled",
                                        [CAV_OUTCOME_LIMIT] = "limit",
                                        [CAV_OUTCOME_STALLED] = "stalled",
                                        [CAV_OUTCOME_AGAIN] = "again",
                                        [CAV_OUTCOME_STOPPED] = "stopped"};
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("phase,stage,fraction,iterations,cost,unactuated,violation,outcome,seconds\n", file.stream);
  for (int i = 0; i < solution->nstage; i++) {
    const cav_stage_record *s = &solution->stage[i];
    const double value[3] = {s->cost, s->unactuated, s->violation};
    fprintf(file.stream, "%s,%d,%.6g,%d", s->phase, s->stage, s->fraction, s->iterations);
    for (int k = 0; k < 3; k++) fputc(',', file.stream), cav_table_write_number(file.stream, value[k]);
    fprintf(file.stream, ",%s,%.3g\n", outcome[s->outcome], s->seconds);
  }
  return cav_file_end(&file, error);
}

cav_status cav_result_write_motion(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                                   cav_error *error) {
  if (problem->close_at_rest || problem->cycle.on) return cav_trajectory_write(path, problem->model, trajectory, error);
  const int nv = trajectory->nv;
  cav_trajectory *open = cav_trajectory_copy(trajectory);
  if (!open) return no_memory(error);
  for (int d = 0; d < nv; d++) open->u[(size_t)(open->nknot - 1) * (size_t)nv + (size_t)d] = NAN;
  cav_status status = cav_trajectory_write(path, problem->model, open, error);
  cav_trajectory_free(open);
  return status;
}

cav_status cav_result_write(const char *folder, const cav_problem *problem, const cav_solution *solution,
                            cav_error *error) {
  char *trajectory = cav_result_path(folder, "trajectory.csv"), *gains = cav_result_path(folder, "gains.csv");
  char *log = cav_result_path(folder, "log.csv");
  char *rows = cav_result_path(folder, "rows.csv"), *stages = cav_result_path(folder, "stages.csv");
  cav_status status =
      trajectory && gains && log && rows && stages ? cav_result_folder(folder, error) : no_memory(error);
  // what cannot be written as a problem is no result
  if (!status) status = cav_result_write_problem(folder, problem, &solution->contact, error);
  if (!status) status = cav_result_write_motion(trajectory, problem, solution->trajectory, error);
  if (!status) status = write_log(log, solution, error);
  if (!status) status = write_stages(stages, solution, error);
  if (!status) status = cav_rows_write(rows, solution->trajectory->timestep, solution->nrow, solution->row, error);
  if (!status && solution->gain_q) status = write_gains(gains, problem->model, solution, error);
  free(trajectory);
  free(gains);
  free(log);
  free(rows);
  free(stages);
  return status;
}

cav_status cav_result_write_verdict(const char *folder, const cav_problem *problem, const cav_verdict *verdict,
                                    const cav_term_report *report, const char *provenance, cav_error *error) {
  char *path = cav_result_path(folder, "verdict.json"), *terms = cav_result_path(folder, "terms.csv");
  cav_file file;
  cav_status status = path && terms ? cav_result_folder(folder, error) : no_memory(error);
  if (!status && report) status = cav_file_begin(&file, terms, error);
  if (!status && report) {
    cav_certificate_terms(file.stream, problem, report);
    status = cav_file_end(&file, error);
  }
  if (!status) status = cav_file_begin(&file, path, error);
  if (!status) {
    cav_certificate_json(file.stream, problem, verdict, report, NULL, provenance);
    status = cav_file_end(&file, error);
  }
  free(path);
  free(terms);
  return status;
}

cav_status cav_result_write_forces(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                   const cav_options *contact, cav_error *error) {
  int at_rest = problem->close_at_rest && !problem->cycle.on;
  cav_forces *forces = cav_forces_new(problem->model, trajectory, contact, at_rest, error);
  if (!forces) return error ? error->status : CAV_NOT_FINITE;
  char *table = cav_result_path(folder, "forces.csv"), *controls = cav_result_path(folder, "controls.csv");
  char *residual = cav_result_path(folder, "residual.csv");
  cav_status status = table && controls && residual ? cav_result_folder(folder, error) : no_memory(error);
  if (!status) status = cav_controls_write(controls, problem->model, trajectory, forces, error);
  if (!status) status = cav_forces_write(table, problem->model, trajectory, forces, error);
  int penalised = problem->residual.force > 0 || problem->residual.torque > 0;
  if (!status && penalised) status = cav_residual_write(residual, problem, trajectory, forces, error);
  free(residual);
  free(table);
  free(controls);
  cav_forces_free(forces);
  return status;
}

// gains.csv into the two matrices
static cav_status read_gains(const char *path, cav_result *result, cav_error *error) {
  // what is not certified has none
  if (access(path, F_OK) != 0) return CAV_OK;
  cav_table *table = cav_table_read(path, error);
  if (!table) return error->status;
  int nv = result->problem->model->nv, rows = (result->trajectory->nknot - 1) * nv;
  size_t n = (size_t)rows * (size_t)nv;
  cav_status status = CAV_OK;
  if (table->nrow != rows || table->ncol != 3 + 2 * nv || strcmp(table->name[0], "knot") ||
      strcmp(table->name[2], "dof")) {
    status = cav_file_fail(error, CAV_BAD_INPUT, 1,
                           "%s:1: expected %d rows of %d columns, starting with knot, time, dof; got %d of %d", path,
                           rows, 3 + 2 * nv, table->nrow, table->ncol);
  }
  result->gain_q = status ? NULL : malloc((n + 1) * sizeof(double));
  result->gain_v = status ? NULL : malloc((n + 1) * sizeof(double));
  if (!status && (!result->gain_q || !result->gain_v)) status = no_memory(error);
  for (int i = 0; i < rows && !status; i++) {
    const double *row = table->value + (size_t)i * (size_t)table->ncol;
    if (row[0] != i / nv || row[2] != i % nv) {
      status = cav_file_fail(error, CAV_BAD_INPUT, table->line[i], "%s:%d: expected knot %d, dof %d, got %g, %g", path,
                             table->line[i], i / nv, i % nv, row[0], row[2]);
    }
    size_t at = (size_t)i * (size_t)nv;
    memcpy(result->gain_q + at, row + 3, (size_t)nv * sizeof(double));
    memcpy(result->gain_v + at, row + 3 + nv, (size_t)nv * sizeof(double));
  }
  cav_table_free(table);
  return status;
}

// number of a field of verdict.json, NaN if it is not there
static double recorded(const char *text, const char *name) {
  char field[64];
  snprintf(field, sizeof field, "\"%s\":", name);
  const char *at = text ? strstr(text, field) : NULL;
  char *end = NULL;
  double value = at ? cav_file_number(at + strlen(field), &end) : 0;
  return end && end != at + strlen(field) ? value : NAN;
}

// what only the solver knew; a folder without a verdict has none of it
static void read_record(const char *path, cav_result *result) {
  char text[8192];
  FILE *file = fopen(path, "r");
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[n] = 0;
  result->solve_seconds = recorded(text, "solve_seconds");
  double iterations = recorded(text, "iterations");
  result->iterations = iterations >= 0 && iterations < INT_MAX ? (int)iterations : 0;
}

cav_result *cav_result_read(const char *folder, const char *model_path, cav_error *given) {
  cav_error inner = {0}, *error = given ? given : &inner;
  cav_result *result = calloc(1, sizeof *result);
  char *problem = cav_result_path(folder, "problem.xml"), *trajectory = cav_result_path(folder, "trajectory.csv");
  char *gains = cav_result_path(folder, "gains.csv"), *verdict = cav_result_path(folder, "verdict.json");
  char *rows = cav_result_path(folder, "rows.csv");
  cav_status status = result && problem && trajectory && gains && verdict && rows ? CAV_OK : no_memory(error);
  if (!status && !(result->problem = cav_problem_load(problem, model_path, error))) status = error->status;
  if (!status && !result->problem->solved) {
    status = cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "%s: no <contact>: the folder holds a problem, not a result; solve it first", problem);
  }
  if (!status && !(result->trajectory = cav_trajectory_read(trajectory, result->problem->model, error)))
    status = error->status;
  if (!status) status = read_gains(gains, result, error);
  if (!status) status = cav_rows_read(rows, &result->nrow, &result->row, error);
  if (!status) read_record(verdict, result);
  free(problem);
  free(trajectory);
  free(gains);
  free(verdict);
  free(rows);
  if (!status) return result;
  cav_result_free(result);
  return NULL;
}

void cav_result_free(cav_result *result) {
  if (!result) return;
  free(result->gain_q);
  free(result->gain_v);
  free(result->row);
  cav_trajectory_free(result->trajectory);
  cav_problem_free(result->problem);
  free(result);
}
