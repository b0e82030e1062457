/// cavort study: motions from perturbed starts by several methods, each run in a process of its own (linear solvers of
/// Ipopt are not safe in threads, and a run that crashes takes nothing with it). What is done stands in DIR/runs and is
/// not done again, so a study that was stopped goes on where it was. Exit status 0 if all runs are certified, 1 if not.
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command.h"
#include "csv.h"
#include "file.h"
#include "pool.h"
#include "result.h"
#include "study.h"

static const char all_motions[] = "problems/motions";

typedef struct study {
  const cav_command_line *line;
  const char *folder;
  int nmotion, nrun, done;
  char **motion, **path; ///< [nmotion]
  cav_study_run *run;    ///< [nrun]
} study;

// ---------------------------------------------------------------- motions and methods

static int add_motion(study *s, const char *path, const char *name, size_t length) {
  char **motion = realloc(s->motion, ((size_t)s->nmotion + 1) * sizeof *motion);
  if (motion) s->motion = motion;
  char **file = realloc(s->path, ((size_t)s->nmotion + 1) * sizeof *file);
  if (file) s->path = file;
  if (!motion || !file) return 0;
  s->motion[s->nmotion] = strndup(name, length);
  s->path[s->nmotion] = strdup(path);
  s->nmotion++;
  return s->motion[s->nmotion - 1] && s->path[s->nmotion - 1];
}

// a file MOTION/problem.xml is called by its folder, another one by its own name
static int add_file(study *s, const char *path) {
  const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
  size_t length = strcspn(name, ".");
  if (!strcmp(name, "problem.xml") && slash) {
    const char *start = slash;
    while (start > path && start[-1] != '/') start--;
    if (slash > start) name = start, length = (size_t)(slash - start);
  }
  return add_motion(s, path, name, length);
}

static int by_name(const struct dirent **a, const struct dirent **b) { return strcmp((*a)->d_name, (*b)->d_name); }

// every folder of problems/motions that names its own model
static cav_status add_all(study *s, cav_error *error) {
  struct dirent **entry;
  int n = scandir(all_motions, &entry, NULL, by_name), ok = 1;
  if (n < 0)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: is not here: name the motions, or run where that folder is",
                         all_motions);
  for (int i = 0; i < n; i++) {
    char path[600];
    cav_error none = {0};
    snprintf(path, sizeof path, "%s/%.400s/problem.xml", all_motions, entry[i]->d_name);
    if (entry[i]->d_name[0] != '.' && access(path, R_OK) == 0) {
      // those written for models of others have none
      cav_problem *problem = cav_problem_load(path, s->line->model, &none);
      if (problem)
        ok = ok && add_file(s, path);
      else if (!s->line->quiet)
        fprintf(stderr, "cavort: left out: %s\n", none.text);
      cav_problem_free(problem);
    }
    free(entry[i]);
  }
  free(entry);
  return ok ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the study");
}

// a method of earlier versions and what it is called now
static const char *const former_method[2] = {"routes", "strategies"};

// the methods of the list, one bit each; 0 and an error for a word that is none
static int methods_of(const char *list, cav_error *error) {
  int methods = 0;
  for (const char *word = list; *word; word += strcspn(word, ","), word += *word == ',') {
    size_t n = strcspn(word, ",");
    int known = 0;
    for (int k = 0; k < CAV_STUDY_METHODS; k++) {
      const char *name = cav_study_method_names[k];
      if (strlen(name) == n && !strncmp(name, word, n)) known = 1 << k;
    }
    if (!known && n == strlen(former_method[0]) && !strncmp(word, former_method[0], n)) {
      cav_file_fail(error, CAV_BAD_INPUT, 0, "--methods: '%s' is called '%s' now", former_method[0], former_method[1]);
      return 0;
    }
    if (!known) {
      cav_file_fail(error, CAV_BAD_INPUT, 0, "--methods: expected own, strategies, ipopt, limited or both, got '%.*s'",
                    (int)n, word);
      return 0;
    }
    methods |= known;
  }
  if (!methods) cav_file_fail(error, CAV_BAD_INPUT, 0, "--methods: expected a list such as own,both");
  return methods;
}

static cav_status plan(study *s, cav_error *error) {
  int methods = methods_of(s->line->methods ? s->line->methods : "own", error);
  if (!methods) return CAV_BAD_INPUT;
  cav_status status = CAV_OK;
  for (int i = 0; i < s->line->noperand && !status; i++) {
    cav_problem *problem = cav_problem_load(s->line->operands[i], s->line->model, error);
    if (!problem) return error->status;
    cav_problem_free(problem);
    if (!add_file(s, s->line->operands[i])) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the study");
  }
  if (s->line->noperand == 0) status = add_all(s, error);
  if (status) return status;
  if (s->nmotion == 0) return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: holds no motion", all_motions);
  s->run = calloc((size_t)s->nmotion * CAV_STUDY_METHODS * CAV_STUDY_STARTS, sizeof *s->run);
  if (!s->run) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the study");
  for (int m = 0; m < s->nmotion; m++)
    for (int k = 0; k < CAV_STUDY_METHODS; k++)
      for (int start = 0; start < CAV_STUDY_STARTS && methods & 1 << k; start++)
        s->run[s->nrun++] = (cav_study_run){.motion = m, .method = (cav_study_method)k, .start = start};
  return CAV_OK;
}

// ---------------------------------------------------------------- records of runs

static const char record_head[] = "strategy,certified,achieved,seconds,iterations,cost,unactuated,end_error\n";

static char *record_path(const study *s, const cav_study_run *run, const char *ending) {
  char name[300];
  snprintf(name, sizeof name, "runs/%.200s.%s.%d.%s", s->motion[run->motion], cav_study_method_names[run->method],
           run->start, ending);
  return cav_result_path(s->folder, name);
}

static cav_status write_record(const study *s, const cav_study_run *run, const char *reason, cav_error *error) {
  cav_file file;
  char *path = record_path(s, run, "csv"), *why = record_path(s, run, "txt");
  cav_status status = path && why ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status && *reason && !(status = cav_file_begin(&file, why, error))) {
    fprintf(file.stream, "%s\n", reason);
    status = cav_file_end(&file, error);
  }
  if (!status && !(status = cav_file_begin(&file, path, error))) {
    fprintf(file.stream, "%s%s,%d,%d,%.6f,%d", record_head, run->strategy, run->certified, run->achieved, run->seconds,
            run->iterations);
    const double value[3] = {run->cost, run->unactuated, run->end_error};
    for (int k = 0; k < 3; k++) {
      fputc(',', file.stream);
      cav_table_write_number(file.stream, isfinite(value[k]) ? value[k] : -1);
    }
    fputc('\n', file.stream);
    status = cav_file_end(&file, error);
  }
  free(path);
  free(why);
  return status;
}

// one of an earlier version has other columns, and the run is done again
static void read_record(const study *s, cav_study_run *run) {
  char *path = record_path(s, run, "csv"), head[sizeof record_head], line[400];
  FILE *file = path ? fopen(path, "r") : NULL;
  cav_study_run r = *run;
  if (file && fgets(head, sizeof head, file) && !strcmp(head, record_head) && fgets(line, sizeof line, file)) {
    char *value = line + strcspn(line, ",");
    snprintf(r.strategy, sizeof r.strategy, "%.*s", (int)(value - line), line);
    r.known = sscanf(value, ",%d,%d,%lf,%d,%lf,%lf,%lf", &r.certified, &r.achieved, &r.seconds, &r.iterations, &r.cost,
                     &r.unactuated, &r.end_error) == 7;
    if (r.known) *run = r;
  }
  if (file) fclose(file);
  free(path);
}

// ---------------------------------------------------------------- processes

// in the process of a run
static int work(void *context, int k) {
  study *s = context;
  cav_study_run run = s->run[k];
  char reason[480] = "";
  cav_error error = {0};
  char *folder = record_path(s, &run, "checkpoints"), *tried = record_path(s, &run, "tried.csv");
  const double seconds = s->line->seconds > 0 ? s->line->seconds : CAV_STUDY_SECONDS;
  const cav_study_task task = {s->path[run.motion], s->line->model, folder, tried, seconds};
  cav_status status = folder && tried ? cav_study_solve(&task, &run, reason, &error) : CAV_NO_MEMORY;
  free(folder), free(tried);
  // a run that could not even be checked is a run that failed
  if (status) {
    run.end_error = -1;
    snprintf(reason, sizeof reason, "%.399s", error.text[0] ? error.text : cav_status_name(status));
  }
  return write_record(s, &run, reason, &error) ? 1 : 0;
}

static void tell(const study *s, const cav_study_run *run, int done, int all) {
  if (s->line->quiet) return;
  fprintf(stderr, "%3d of %d  %-20s %-8s start %d  ", done, all, s->motion[run->motion],
          cav_study_method_names[run->method], run->start);
  if (run->known)
    fprintf(stderr, "%s  %6.1f s  %5d iterations  %s\n",
            !run->certified ? "not certified"
            : run->achieved ? "certified    "
                            : "not achieved ",
            run->seconds, run->iterations, run->strategy);
  else
    fprintf(stderr, "no result\n");
}

static int wanted(void *context, int k) { return !((const study *)context)->run[k].known; }

static void ended(void *context, int k, int status) {
  study *s = context;
  (void)status;
  read_record(s, &s->run[k]);
  tell(s, &s->run[k], ++s->done, s->nrun);
}

// runs all that have no record, at most so many at a time
static cav_status run_all(study *s, cav_error *error) {
  for (int i = 0; i < s->nrun; i++) {
    read_record(s, &s->run[i]);
    s->done += s->run[i].known;
  }
  if (s->done && !s->line->quiet) fprintf(stderr, "%d of %d runs are there already\n", s->done, s->nrun);
  const cav_pool pool = {
      .n = s->nrun, .processes = s->line->threads, .wanted = wanted, .work = work, .ended = ended, .context = s};
  return cav_pool_run(&pool, error);
}

// the table as it stands in study.txt
static void print_table(const char *folder, int drawn) {
  char *path = cav_result_path(folder, "study.txt"), text[4096];
  FILE *file = path ? fopen(path, "r") : NULL;
  size_t n;
  while (file && (n = fread(text, 1, sizeof text, file)) > 0) fwrite(text, 1, n, stdout);
  if (file) fclose(file);
  free(path);
  printf("study: %s%s\n", folder, drawn ? ", drawn in profile.svg" : "; not drawn: gnuplot is not there");
}

int cav_command_study(const cav_command_line *line) {
  cav_error error = {0};
  study s = {.line = line, .folder = line->output ? line->output : "study"};
  char *runs = cav_result_path(s.folder, "runs");
  int drawn = 0, missed = 0;
  cav_status status = runs ? plan(&s, &error) : cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory for the study");
  if (!status) status = cav_result_folder(runs, &error);
  if (!status) status = run_all(&s, &error);
  if (!status)
    status = cav_profile_write(s.folder, s.nmotion, (const char *const *)s.motion, s.nrun, s.run, &drawn, &error);
  if (!status && !line->quiet) print_table(s.folder, drawn);
  for (int i = 0; i < s.nrun; i++) missed += !s.run[i].known || !s.run[i].certified;
  for (int i = 0; i < s.nmotion; i++) free(s.motion[i]), free(s.path[i]);
  free(s.motion), free(s.path), free(s.run), free(runs);
  if (status) return cav_command_fail(&error);
  return missed ? CAV_EXIT_NOT_CERTIFIED : CAV_EXIT_CERTIFIED;
}
