/// What the commands tell of what was tried for the motion of a result folder.
#include <stdio.h>
#include <string.h>

#include "command.h"
#include "summary.h"

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
