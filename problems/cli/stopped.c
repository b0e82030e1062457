/// Whether the motion of a result folder is where a solve was stopped, by strategies.csv: verify and explain say so, since what
/// it misses then says nothing of the problem.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "result.h"

int cav_command_tell_stopped(FILE *out, const char *folder) {
  char *path = cav_result_path(folder, "strategies.csv"), *line = NULL;
  FILE *in = path ? fopen(path, "r") : NULL;
  size_t room = 0;
  int stopped = 0;
  while (in && !stopped && getline(&line, &room, in) > 0) {
    const char *rest = strchr(line, ','), *quote = strrchr(line, '"');
    stopped = rest && quote && !strncmp(rest, ",1,stopped,", strlen(",1,stopped,"));
    if (!stopped) continue;
    const char *reason = quote;
    while (reason > rest && reason[-1] != '"') reason--;
    if (out)
      fprintf(
          out,
          "the solve of this folder was %.*s: what follows is of where it stood then, not of what the problem allows; "
          "its command with --resume goes on\n",
          (int)(quote - reason), reason);
  }
  if (in) fclose(in);
  free(path), free(line);
  return stopped;
}
