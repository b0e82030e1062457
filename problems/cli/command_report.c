/// cavort report: error against run time of a scene, measured here, as a page and tables. Exit status 0 if they are
/// written. Whatever ends it before leaves no half of a page.
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "command.h"
#include "file.h"
#include "provenance.h"
#include "report.h"

static volatile sig_atomic_t interrupted;

static void interrupt(int signal_number) {
  (void)signal_number;
  interrupted = 1;
}

// the line of progress, s since the beginning
typedef struct ticker {
  int quiet, terminal;
  double begin, last;
  const char *what;
} ticker;

static int tell(void *context, const char *what, double fraction) {
  ticker *tick = context;
  double now = cav_command_clock(CLOCK_MONOTONIC);
  int news = !tick->what || strcmp(what, tick->what);
  if (tick->quiet || (!news && now - tick->last < (tick->terminal ? 0.1 : 2))) return interrupted;
  tick->what = what;
  tick->last = now;
  fprintf(stderr, "%s%-24s %3.0f %%  %6.1f s%s", tick->terminal ? "\r" : "", what, 100 * fraction, now - tick->begin,
          tick->terminal ? "\033[K" : "\n");
  fflush(stderr);
  return interrupted;
}

// "humanoid" of "models/humanoid.xml", "get-up-back" of "get-up-back/problem.xml", or what the problem is called
static char *name_of(const cav_command_line *line, const cav_command_scene *scene) {
  if (scene->problem && *scene->problem->name) return strdup(scene->problem->name);
  const char *slash = strrchr(line->operand, '/'), *name = slash ? slash + 1 : line->operand;
  const char *dot = strrchr(name, '.');
  return strndup(name, dot && dot > name ? (size_t)(dot - name) : strlen(name));
}

int cav_command_report(const cav_command_line *line) {
  cav_error error = {0};
  cav_command_scene scene;
  if (cav_command_load(line, &scene, &error)) return cav_command_fail(&error);
  ticker tick = {.quiet = line->quiet, .terminal = isatty(2), .begin = cav_command_clock(CLOCK_MONOTONIC)};
  char *name = name_of(line, &scene), *folder = name ? cav_command_folder(line, name, ".report") : NULL;
  cav_provenance provenance;
  cav_provenance_take(&provenance, line->arguments, scene.problem ? line->operand : NULL,
                      scene.problem ? scene.problem->model_path : line->operand);
  const cav_report_request request = {.model = scene.model,
                                      .problem = scene.problem,
                                      .name = name,
                                      .folder = folder,
                                      .quick = line->quick,
                                      .tell = tell,
                                      .context = &tick,
                                      .provenance = &provenance};
  signal(SIGINT, interrupt);
  signal(SIGTERM, interrupt);
  cav_status status =
      folder ? cav_report_write(&request, &error) : cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory");
  if (tick.what && tick.terminal) fputc('\n', stderr);
  if (!status && !line->quiet) printf("%s/report.html\n", folder);
  free(name);
  free(folder);
  cav_command_free(&scene);
  return status ? cav_command_fail(&error) : 0;
}
