/// What was tried for the motion of a result folder: strategies.csv, line by line.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "result.h"
#include "summary.h"

cav_tried cav_tried_open(const char *folder) {
  char *path = cav_result_path(folder, "strategies.csv");
  cav_tried t = {.in = path ? fopen(path, "r") : NULL};
  free(path);
  return t;
}

int cav_tried_next(cav_tried *t) {
  while (t->in && getline(&t->line, &t->room, t->in) > 0) {
    // strategy,kept,outcome, numbers, and the two quoted texts that end a line: three commas, then four quotation marks
    char *mark[7], *c = t->line;
    int n = 0;
    while (n < 7 && (c = strchr(c, n < 3 ? ',' : '"'))) mark[n++] = c++;
    if (n < 7) continue;
    char **comma = mark, **quote = mark + 3;
    for (int k = 0; k < 3; k++) *comma[k] = 0;
    *quote[1] = *quote[3] = 0;
    t->kept = !strcmp(comma[0] + 1, "1");
    t->outcome = comma[1] + 1;
    t->changed = quote[0] + 1, t->reason = quote[2] + 1;
    return 1;
  }
  return 0;
}

void cav_tried_close(cav_tried *t) {
  if (t->in) fclose(t->in);
  free(t->line);
  *t = (cav_tried){0};
}

void cav_command_tell_tried(FILE *out, const char *folder) {
  int n;
  double seconds = cav_summary_tried(folder, &n);
  if (n > 1)
    fprintf(out, "%d strategies were tried, in %.1f s one after the other; this is the one that was kept\n", n,
            seconds);
}

int cav_command_tell_stopped(FILE *out, const char *folder) {
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
