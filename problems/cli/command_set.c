/// Settings of a command line (--set): the problem with them as a file of its own.
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "batch.h"
#include "command.h"
#include "file.h"

cav_status cav_command_write_set(const cav_command_line *line, const char *path, cav_error *error) {
  char root[32];
  if (cav_batch_sweeps(line->nset, line->set))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "--set: expected one value; cavort solve takes several");
  cav_batch one = {0};
  char *problem[] = {(char *)line->operand};
  cav_status status = cav_batch_open(&one, 1, problem, line->nset, line->set, error);
  cav_command_first_element(line->operand, root);
  if (!status && strcmp(root, "problem"))
    status =
        cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: is not a problem file; --set has no meaning here", line->operand);
  if (!status) status = cav_setting_write(line->operand, line->nset, one.item->setting, path, error);
  cav_batch_close(&one);
  return status;
}

int cav_command_set(const cav_command_line *line, int (*run)(const cav_command_line *line)) {
  const char *folder = getenv("TMPDIR");
  cav_error error = {0};
  cav_command_line set = *line;
  char path[4096];
  snprintf(path, sizeof path, "%.4000s/cavort-set-XXXXXX", folder && *folder ? folder : "/tmp");
  const int made = mkstemp(path);
  if (made < 0) {
    cav_file_fail(&error, CAV_BAD_INPUT, 0, "%s: cannot be written, for --set; TMPDIR names another folder", path);
    return cav_command_fail(&error);
  }
  close(made);
  cav_status status = cav_command_write_set(line, path, &error);
  set.operand = path;
  set.stated = line->operand;
  set.nset = 0;
  cav_command_tell_as(path, line->operand);
  const int done = status ? cav_command_fail(&error) : run(&set);
  unlink(path);
  return done;
}
