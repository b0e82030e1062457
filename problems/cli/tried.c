/// What the commands tell of what was tried for the motion of a result folder.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "command.h"
#include "result_file.h"
#include "summary.h"

void cav_command_tell_tried(FILE *out, const char *folder) {
  int n;
  double seconds = cav_summary_tried(folder, &n);
  if (n > 1)
    fprintf(out, "%d strategies were tried, in %.1f s one after the other; this is the one that was kept\n", n,
            seconds);
}

void cav_command_tell_would_do(FILE *out, const char *before, const cav_problem *p, cav_would_do what, double value) {
  switch (what) {
    case CAV_WOULD_DO_DURATION:
      fprintf(
          out,
          "%snot in %.4g s, but in %.4g s, certified and achieved, times of windows in proportion; if it may last so "
          "long: <horizon duration=\"%.4g\" range=\"%.4g %.4g\"/>\n",
          before, p->duration, value, p->duration, p->duration, 2 * p->duration);
      break;
    case CAV_WOULD_DO_STRENGTH:
      fprintf(
          out,
          "%snot with these actuators, up to %.3g of their limits, but a motion is found where they are %.3g times as "
          "strong: the model is too weak for this, or nearly so; %sless that is asked for, more time, or stronger "
          "ones\n",
          before, p->effort_limit, value, p->effort_limit < 1 ? "<limits effort=\"1\"/>, " : "");
      break;
    case CAV_WOULD_DO_OPEN_END:
      fprintf(out,
              "%snot with an end at rest, but certified and achieved where the end may still move: <horizon "
              "close=\"open\"/>\n",
              before);
      break;
  }
}

void cav_command_tell_diagnoses(FILE *out, const char *folder, const cav_problem *p) {
  cav_tried t = cav_tried_open(folder);
  while (cav_tried_next(&t)) {
    double value = 0;
    int seconds = 0, times = 0; // where the words end, if they are there
    if (t.kept) continue;
    if (!strcmp(t.reason, "an open end would do")) cav_command_tell_would_do(out, "", p, CAV_WOULD_DO_OPEN_END, 0);
    if (sscanf(t.reason, "%lf s would do%n", &value, &seconds) == 1 && seconds)
      cav_command_tell_would_do(out, "", p, CAV_WOULD_DO_DURATION, value);
    if (sscanf(t.reason, "%lf times the strength would do%n", &value, &times) == 1 && times)
      cav_command_tell_would_do(out, "", p, CAV_WOULD_DO_STRENGTH, value);
  }
  cav_tried_close(&t);
}

/// Whether a folder has a file.
static int has(const char *folder, const char *name) {
  char *path = cav_result_path(folder, name);
  struct stat about;
  const int is = path && !stat(path, &about);
  free(path);
  return is;
}

int cav_command_tell_stopped(FILE *out, const char *folder) {
  if (has(folder, "checkpoint.csv") && !has(folder, "strategies.csv")) {
    if (out)
      fprintf(out,
              "the solve of this folder has not come to an end: it runs, or was killed (the same command with --resume "
              "goes on). What follows is of the last iterate that it wrote, not of what the problem allows\n");
    return 1;
  }
  cav_tried t = cav_tried_open(folder);
  int stopped = 0, other = 0, success = 0;
  while (!stopped && cav_tried_next(&t)) {
    stopped = t.kept && !strcmp(t.outcome, "stopped");
    success |= t.kept && !strcmp(t.outcome, "certified");
    other |= !strcmp(t.outcome, "stopped");
  }
  const char *how = stopped ? t.reason : other && !success ? "stopped while other strategies were tried" : NULL;
  if (how && out)
    fprintf(out,
            "the solve of this folder was %s: what follows is of where it stood then, not of what the problem allows; "
            "its command with --resume goes on\n",
            how);
  cav_tried_close(&t);
  return how != NULL;
}
