/// cavort stress: sweeps the parameters of a scene and writes what was found into a folder: stress.html, ranges.csv and
/// points.csv. Prints the ranges. The exit status says whether all holds at the scene's own values.
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "command.h"
#include "file.h"
#include "provenance.h"
#include "result.h"
#include "stress.h"

static volatile sig_atomic_t interrupted;

static void interrupt(int signal_number) {
  interrupted = 1;
  // a second one ends the program
  signal(signal_number, SIG_DFL);
}

typedef struct ticker {
  int quiet, terminal, shown; // percent
} ticker;

static int observe(void *context, double fraction) {
  ticker *tick = context;
  const int percent = (int)(100 * fraction), step = tick->terminal ? 1 : 10;
  if (!tick->quiet && percent >= tick->shown + step) {
    tick->shown = percent - percent % step;
    fprintf(stderr, "%sstress: %2d %%%s", tick->terminal ? "\r" : "", tick->shown, tick->terminal ? "" : "\n");
  }
  return interrupted;
}

// where a side of the scene's own value is broken
static void print_broken(const cav_stress_result *r, int side) {
  const int at = r->edge[side].broken;
  if (at < 0)
    printf(" %12s", "-");
  else if (at == r->own_point)
    printf(" %12s", "here");
  else
    printf(" %12.3g", r->point[at].value);
}

// the first point of a side that is not safe, and the first that is broken, with why
static void print_edges(const cav_stress_result *r, int side) {
  const cav_stress_edge *edge = &r->edge[side];
  const int both[2] = {edge->worse, edge->broken != edge->worse ? edge->broken : -1};
  for (int k = 0; k < 2; k++) {
    // what is wrong at the scene's own value is one thing, not two
    if (both[k] < 0 || (both[k] == r->own_point && side)) continue;
    const cav_stress_point *p = &r->point[both[k]];
    printf("  %s %s %s%.3g: %s\n",
           both[k] == r->own_point ? "here"
           : side                  ? "above"
                                   : "below",
           cav_stress_level_names[p->level], both[k] == r->own_point ? "at " : "from ", p->value, p->why);
  }
}

// one parameter
static void print_range(cav_stress_sweep sweep, const cav_stress_result *r) {
  const cav_stress_sweep_rule *rule = &cav_stress_sweep_rules[sweep];
  printf("%-12s %-17s ", rule->name, rule->unit);
  if (r->absent) {
    printf("not swept: %s\n", r->absent);
    return;
  }
  printf("%9.3g ", r->own);
  if (isnan(r->edge[0].safe) || isnan(r->edge[1].safe))
    printf("%20s", "not safe here");
  else
    printf("%9.3g..%-9.3g", r->edge[0].safe, r->edge[1].safe);
  for (int side = 0; side < 2; side++) print_broken(r, side);
  printf("\n");
  if (r->other_law) printf("  of the stabilisation that this scene does not use\n");
  for (int side = 0; side < 2; side++) print_edges(r, side);
}

static int holds(const cav_stress_report *report) {
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) {
    const cav_stress_result *r = &report->sweep[i];
    if (!r->absent && !r->other_law && r->point[r->own_point].level != CAV_STRESS_SAFE) return 0;
  }
  return 1;
}

static void print_report(const cav_stress_report *report) {
  printf("%-12s %-17s %9s %20s %12s %12s\n", "parameter", "unit", "scene's", "safe from..to", "broken below",
         "broken above");
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) print_range(i, &report->sweep[i]);
}

static cav_status write_all(const char *folder, const cav_stress_report *report, const cav_provenance *provenance,
                            cav_error *error) {
  char *page = cav_result_path(folder, "stress.html"), *ranges = cav_result_path(folder, "ranges.csv"),
       *points = cav_result_path(folder, "points.csv");
  cav_status status = page && ranges && points ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) status = cav_stress_write_points(points, report, error);
  if (!status) status = cav_stress_write_ranges(ranges, report, error);
  if (!status) status = cav_stress_write_page(page, report, provenance, error);
  free(page);
  free(ranges);
  free(points);
  return status;
}

static cav_status run(const cav_command_line *line, const char *folder, const cav_stress_scene *scene, int *well,
                      cav_error *error) {
  ticker tick = {line->quiet, isatty(STDERR_FILENO), -10};
  const cav_stress_options options = {
      .quick = line->quick, .threads = line->threads, .observer = observe, .context = &tick};
  cav_stress_report report;
  cav_provenance provenance;
  cav_provenance_take(&provenance, line->arguments, scene->problem ? line->operand : "",
                      scene->problem ? "" : line->operand);
  cav_status status = cav_stress_run(scene, &options, &report, error);
  if (tick.terminal && tick.shown > 0) fprintf(stderr, "\r\033[K");
  if (!status) status = cav_result_folder(folder, error);
  if (!status) status = write_all(folder, &report, &provenance, error);
  if (!status) {
    *well = holds(&report);
    if (!line->quiet) print_report(&report);
    if (!line->quiet) printf("page: %s/stress.html\n", folder);
  }
  cav_stress_report_clear(&report);
  return status;
}

int cav_command_stress(const cav_command_line *line) {
  cav_error error = {0};
  // once to see what it is; each thread has its own
  cav_command_scene loaded;
  if (cav_command_load(line, &loaded, &error)) return cav_command_fail(&error);
  const cav_stress_scene scene = {line->operand, line->model, loaded.problem != NULL, line->floating};
  cav_command_free(&loaded);
  char *folder = cav_command_folder(line, NULL, ".stress");
  if (!folder) return cav_command_fail(&(cav_error){.status = CAV_NO_MEMORY});
  signal(SIGINT, interrupt);
  signal(SIGTERM, interrupt);
  signal(SIGHUP, interrupt);
  int well = 0;
  cav_status status = run(line, folder, &scene, &well, &error);
  free(folder);
  if (status) return cav_command_fail(&error);
  return well ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}
