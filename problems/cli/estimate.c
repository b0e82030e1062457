/// cavort solve of a problem with <parameter>: numbers of the model and the motion are found together (cav_estimate_solve), the
/// motion is certified under the model with these numbers, which problem.xml of the folder gives it. parameters.csv tells them,
/// model.xml is that model where MJCF can say it.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cavort/estimate.h"
#include "command.h"
#include "csv.h"
#include "file.h"
#include "race.h"
#include "result_file.h"

/// A combination that the records know by less than half of a unit, 1/deviation^2.
static const double unseen = 4;

static double start_of(const cav_problem *p, int i) { return cav_model_parameter(p->model, &p->parameter[i]); }

enum { ROOM = 32 };

// of those of hinges and slides the one that it is
static const char *unit_of(const cav_problem *p, int i, char text[ROOM]) {
  const cav_parameter *x = &p->parameter[i];
  const char *unit = cav_parameter_rule_of(x->kind)->unit, *other = strstr(unit, " or ");
  if (!other) return unit;
  int slides = p->model->joint[x->object].type == CAV_JOINT_SLIDE;
  snprintf(text, ROOM, "%.*s", slides ? ROOM - 1 : (int)(other - unit), slides ? other + 4 : unit);
  return text;
}

static cav_status write_table(const char *folder, const cav_problem *p, const cav_estimate *e, cav_error *error) {
  static const char *const bound[] = {"lower", "", "upper"};
  char label[CAV_PARAMETER_LABEL], unit[ROOM], *path = cav_result_path(folder, "parameters.csv");
  cav_file file;
  cav_status status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) {
    fputs("name,unit,start,value,standard_error,standard_error_of_records,pull_of_other_costs,at_bound,identifiable\n",
          file.stream);
    for (int i = 0; i < p->nparameter; i++) {
      const double number[] = {start_of(p, i), e->value[i], e->error[i], e->alone[i], e->pull[i]};
      cav_table_write_text(file.stream, cav_parameter_label(p->model, &p->parameter[i], label));
      fputc(',', file.stream);
      cav_table_write_text(file.stream, unit_of(p, i, unit));
      for (int k = 0; k < 5; k++) fputc(',', file.stream), cav_table_write_number(file.stream, number[k]);
      fprintf(file.stream, ",%s,%s\n", bound[e->bound[i] + 1], e->told[i] ? "yes" : "no");
    }
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}

// ---------------------------------------------------------------- the model with these numbers

// whether a file says the numbers that were found: friction is mixed there with that of what is touched
static int says(const char *path, const cav_problem *p, const cav_estimate *e, char *why, size_t room) {
  cav_error error = {0};
  char label[CAV_PARAMETER_LABEL];
  cav_model *m = cav_model_load(path, &error);
  if (!m) {
    snprintf(why, room, "%.200s", error.text);
    return 0;
  }
  int same = m->nq == e->model->nq && m->nv == e->model->nv && m->ngeom == e->model->ngeom;
  if (!same) snprintf(why, room, "it has other joints or geoms when it is read");
  for (int i = 0; i < p->nparameter && same; i++) {
    double x = cav_model_parameter(m, &p->parameter[i]);
    same = fabs(x - e->value[i]) <= 1e-9 * fabs(e->value[i]);
    if (!same)
      snprintf(why, room, "%s is mixed with what the other geom says there",
               cav_parameter_label(p->model, &p->parameter[i], label));
  }
  cav_model_free(m);
  return same;
}

// 0: model.xml is there; else why not
static int write_model(const char *folder, const cav_problem *p, const cav_estimate *e, char *why, size_t room) {
  cav_error error = {0};
  char *path = cav_result_path(folder, "model.xml"),
       *text = path ? cav_model_mjcf(e->model, p->model_path, &error) : NULL;
  cav_file file;
  int done = text && !cav_file_begin(&file, path, &error);
  if (done) fputs(text, file.stream), done = !cav_file_end(&file, &error);
  if (!done)
    snprintf(why, room, "%.200s", error.text[0] ? error.text : "no memory");
  else if (!says(path, p, e, why, room))
    unlink(path), done = 0;
  free(text), free(path);
  return !done;
}

// ---------------------------------------------------------------- in words

static void print_unseen(const cav_problem *p, const cav_estimate *e) {
  int n = p->nparameter;
  char label[CAV_PARAMETER_LABEL];
  for (int k = 0; k < n; k++) {
    double most = 0;
    const double *axis = e->combination + k * n;
    if (e->seen[k] >= unseen) continue;
    for (int i = 0; i < n; i++) most = fmax(most, fabs(axis[i]));
    int several = 0;
    for (int i = 0; i < n; i++) several += fabs(axis[i]) >= 0.1 * most;
    fputs(several > 1 ? "the records do not tell apart:" : "the records do not tell:", stdout);
    for (int i = 0, m = 0; i < n; i++)
      if (fabs(axis[i]) >= 0.1 * most)
        printf("%s %s", m++ ? "," : "", cav_parameter_label(p->model, &p->parameter[i], label));
    fputc('\n', stdout);
  }
}

static void print_table(const cav_problem *p, const cav_estimate *e) {
  static const char *const bound[] = {", at its lower bound", "", ", at its upper bound"};
  char label[CAV_PARAMETER_LABEL], unit[ROOM];
  printf("%-28s %-12s %11s %11s %11s  %s\n", "parameter", "unit", "start", "value", "+-", "identifiable");
  for (int i = 0; i < p->nparameter; i++)
    printf("%-28s %-12s %11.5g %11.5g %11.2g  %s%s\n", cav_parameter_label(p->model, &p->parameter[i], label),
           unit_of(p, i, unit), start_of(p, i), e->value[i], e->error[i],
           e->told[i] ? "yes" : "no: its value is that of priors or of other costs", bound[e->bound[i] + 1]);
  print_unseen(p, e);
  for (int i = 0; i < p->nparameter; i++)
    if (fabs(e->pull[i]) > e->error[i])
      printf("%s %s %.2g off where records have it, %.1f standard errors%s\n",
             e->bound[i] ? "its bound holds" : "other costs than records hold",
             cav_parameter_label(p->model, &p->parameter[i], label), e->pull[i], fabs(e->pull[i]) / e->error[i],
             e->bound[i] ? "" : ": lower their weights");
}

static cav_status tell(const cav_command_line *line, const char *folder, const cav_problem *p, const cav_estimate *e,
                       cav_error *error) {
  char why[300];
  cav_status status = write_table(folder, p, e, error);
  int missing = status ? 1 : write_model(folder, p, e, why, sizeof why);
  if (status || line->quiet || line->json) return status;
  print_table(p, e);
  if (missing)
    printf("no model.xml: %s; the folder's problem.xml has the values\n", why);
  else
    printf("model.xml: the model with these values\n");
  return CAV_OK;
}

int cav_command_estimate(const cav_command_line *line, const cav_race *race) {
  const cav_problem *p = race->problem;
  cav_error error = {0};
  cav_estimate *e = NULL;
  cav_race_report report = {0};
  cav_problem found = *p;
  cav_status status = cav_estimate_solve(p, &race->options, NULL, &e, &error);
  report.status = (int)status;
  snprintf(report.text, sizeof report.text, "%.399s", error.text);
  if (!e) return cav_command_fail(&error);
  found.model = e->model;
  status = cav_race_verify(&found, e->solution, &report, &error);
  int done = status ? cav_command_fail(&error) : race->save(race->context, &found, e->solution, &report);
  if (!status) status = tell(line, race->folder, p, e, &error);
  if (status) done = cav_command_fail(&error);
  cav_estimate_free(e);
  return done;
}
