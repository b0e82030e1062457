/// What several commands do: read a model or a problem, warn, tell an error and the exit status that goes with it.
#include "command.h"
#include "cavort/result.h"
#include "periodicity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "provenance.h"
#include "records.h"
#include "result.h"

void cav_command_first_element(const char *path, char name[32]) {
  static char text[65536];
  FILE *file = fopen(path, "r");
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[n] = 0;
  name[0] = 0;
  for (const char *at = strchr(text, '<'); at; at = strchr(at, '<')) {
    const char *end = !strncmp(at, "<!--", 4) ? strstr(at, "-->") : at[1] == '?' ? strstr(at, "?>") : NULL;
    if (end) {
      at = end;
      continue;
    }
    size_t length = strcspn(at + 1, " \t\r\n/>");
    snprintf(name, 32, "%.*s", length < 31 ? (int)length : 31, at + 1);
    return;
  }
}

cav_status cav_command_load(const cav_command_line *line, cav_command_scene *scene, cav_error *error) {
  char root[32];
  *scene = (cav_command_scene){0};
  cav_command_first_element(line->operand, root);
  if (!strcmp(root, "problem")) {
    if (line->floating)
      return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: is a problem file; write floating=\"true\" into it",
                           line->operand);
    scene->problem = cav_problem_load(line->operand, line->model, error);
    if (scene->problem) scene->model = scene->problem->model;
    return scene->problem ? CAV_OK : error->status;
  }
  if (line->model)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: is not a problem file; --model has no meaning here",
                         line->operand);
  cav_load_options options = cav_load_options_default();
  options.floating = line->floating;
  scene->model = cav_model_load_with(line->operand, &options, error);
  return scene->model ? CAV_OK : error->status;
}

void cav_command_free(cav_command_scene *scene) {
  if (scene->problem)
    cav_problem_free(scene->problem);
  else
    cav_model_free((cav_model *)scene->model);
  *scene = (cav_command_scene){0};
}

void cav_command_warn_efforts(const cav_model *model, FILE *out) {
  int n = 0, first = -1;
  char words[CAV_WORDS];
  for (int i = 0; i < model->nu; i++) {
    double range[2];
    cav_actuator_effort_range(model, i, range);
    // a muscle's curves, and a servo's controls, are limits too
    const cav_actuator *a = &model->actuator[i];
    if ((isfinite(range[0]) && isfinite(range[1])) || a->gain == CAV_GAIN_MUSCLE || a->ctrllimited) continue;
    if (!n++) first = i;
  }
  if (!n) return;
  fprintf(out, "cavort: WARNING: %s (",
          n == model->nu ? "no actuator has a limit of effort" : "some actuators have no limit of effort");
  fprintf(
      out,
      "%d of %d, the first is number %d, '%.100s'): a plan may take any force of %s; give a forcerange, the joint an "
      "actuatorfrcrange, or a motor a ctrlrange\n",
      n, model->nu, first, cav_actuator_words(model, first, words), n == 1 ? "it" : "them");
}

void cav_command_tell_asymmetry(const cav_problem *problem, FILE *out) {
  double length = 0, force = 0;
  cav_periodicity *periodicity =
      problem->cycle.on && problem->cycle.mirror != CAV_MIRROR_NONE ? cav_periodicity_new(problem, NULL) : NULL;
  if (periodicity) cav_periodicity_asymmetry(periodicity, &length, &force);
  cav_periodicity_free(periodicity);
  if (length > 0)
    fprintf(out,
            "cavort: the model is its own mirror image but for %.2g mm and %.2g %% of its largest force: the mirrored "
            "half stride is off by as much, and feedback makes it up\n",
            1e3 * length, 1e2 * force);
}

void cav_command_version(void) { cav_provenance_print_build(stdout); }

char *cav_command_folder(const cav_command_line *line, const char *name, const char *suffix) {
  if (line->output) return strdup(line->output);
  const char *file = line->stated ? line->stated : line->operand, *slash = strrchr(file, '/');
  const int named = name && *name;
  if (!named) name = slash ? slash + 1 : file;
  const char *dot = named ? NULL : strrchr(name, '.');
  const size_t length = dot && dot > name ? (size_t)(dot - name) : strlen(name);
  char *folder = malloc(length + strlen(suffix) + 1);
  if (!folder) return NULL;
  sprintf(folder, "%.*s%s", (int)length, name, suffix);
  // a name is no path
  for (char *c = folder; *c; c++)
    if (*c == '/') *c = '-';
  return folder;
}

static struct { char path[4096], as[4096]; } told;

void cav_command_tell_as(const char *path, const char *as) {
  snprintf(told.path, sizeof told.path, "%s", path);
  snprintf(told.as, sizeof told.as, "%s", as);
}

int cav_command_fail(const cav_error *error) {
  const size_t n = strlen(told.path);
  if (n && !strncmp(error->text, told.path, n))
    fprintf(stderr, "cavort: %s%s, as --set has it\n", told.as, error->text + n);
  else
    fprintf(stderr, "cavort: %s\n", error->text[0] ? error->text : cav_status_name(error->status));
  switch (error->status) {
    case CAV_BAD_INPUT:
    case CAV_NOT_FINITE:
    case CAV_NOT_SUPPORTED:
      return CAV_EXIT_BAD_INPUT;
    case CAV_INTERRUPTED:
      return CAV_EXIT_INTERRUPTED;
    case CAV_NOT_CONVERGED:
      return CAV_EXIT_NOT_CERTIFIED;
    default:
      return CAV_EXIT_INTERNAL;
  }
}

void cav_command_write_errors(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                              const cav_options *contact, int nrow, const cav_binding *row) {
  cav_error error = {0};
  cav_standard_errors *errors = NULL;
  cav_status status = cav_standard_errors_find(problem, trajectory, contact, nrow, row, &errors, &error);
  if (!status) status = cav_result_write_errors(folder, problem->model, trajectory, errors, &error);
  if (status) fprintf(stderr, "cavort: no stderr.csv: %s\n", error.text);
  cav_standard_errors_free(errors);
}

cav_status cav_command_tell_records(const char *folder, int print, const cav_problem *problem,
                                    const cav_trajectory *trajectory, const cav_options *contact, cav_error *error) {
  cav_records *records = cav_records_measure(problem, trajectory, contact, error);
  if (!records) return error->status;
  char *path = folder && records->nrecord > 0 ? cav_result_path(folder, "records.csv") : NULL;
  cav_status status = CAV_OK;
  if (folder && records->nrecord > 0)
    status = path ? cav_records_write(path, records, error)
                  : cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", folder);
  if (!status && print) cav_records_print(stdout, records);
  free(path);
  cav_records_free(records);
  return status;
}

double cav_command_clock(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
