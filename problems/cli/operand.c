/// What a command is given where it wants something else: a model, a problem file or the folder of a result, told apart
/// before anything is read, with the command that was meant.
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "command.h"
#include "file.h"

typedef enum kind { UNKNOWN, MODEL, PROBLEM, FOLDER } kind;

static int exists_in(const char *folder, const char *name) {
  char path[4200];
  int n = snprintf(path, sizeof path, "%s/%s", folder, name);
  return n < (int)sizeof path && access(path, F_OK) == 0;
}

static kind kind_of(const char *path) {
  struct stat info;
  char root[32];
  if (stat(path, &info)) return UNKNOWN;
  if (S_ISDIR(info.st_mode)) return FOLDER;
  cav_command_first_element(path, root);
  if (!strcmp(root, "problem")) return PROBLEM;
  return !strcmp(root, "mujoco") || !strcmp(root, "robot") ? MODEL : UNKNOWN;
}

/// A folder's file of a problem is that of its result.
static int folder_of(const char *path, char folder[4096]) {
  const char *slash = strrchr(path, '/');
  snprintf(folder, 4096, "%.*s", slash ? (int)(slash - path) : 1, slash ? path : ".");
  return exists_in(folder, "verdict.json") && exists_in(folder, "trajectory.csv");
}

/// One that wants the folder of a result.
static cav_status refuse_file(const char *command, const char *path, kind given, cav_error *error) {
  char folder[4096];
  if (given == PROBLEM && folder_of(path, folder))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: is the problem file of a result; say its folder: cavort %s %s",
                         path, command, folder);
  if (given == PROBLEM)
    return cav_file_fail(
        error, CAV_BAD_INPUT, 0,
        "%s: is a problem file; %s is about a motion that was solved: cavort solve %s -o DIR, then cavort "
        "%s DIR",
        path, command, path, command);
  return cav_file_fail(error, CAV_BAD_INPUT, 0,
                       "%s: is a model; %s is about the folder of a solved motion, which begins with a problem file: "
                       "<problem model=\"%s\"> (cavort help terms)",
                       path, command, path);
}

cav_status cav_command_expect(const char *command, const char *wanted, const char *path, cav_error *error) {
  int folder = strstr(wanted, "DIR") != NULL, problem = strstr(wanted, "PROBLEM") != NULL;
  kind given = kind_of(path);
  if (given == UNKNOWN && folder && access(path, F_OK) != 0)
    return cav_file_fail(
        error, CAV_BAD_INPUT, 0, "%s: there is no such %s", path,
        problem ? "folder or file"
                : "folder; cavort solve PROBLEM writes NAME.result, NAME the problem's own, or DIR after -o, but "
                  "none of a problem that is proven impossible: cavort inspect PROBLEM tells the proof");
  if (given == FOLDER && !folder && exists_in(path, "problem.xml"))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: is a folder; its problem file: cavort %s %s/problem.xml", path,
                         command, path);
  if (given == FOLDER && folder && !exists_in(path, "problem.xml"))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: holds no result: cavort solve PROBLEM -o %s writes one", path,
                         path);
  if (given == PROBLEM && !problem && folder) return refuse_file(command, path, given, error);
  if (given != MODEL || strstr(wanted, "MODEL")) return CAV_OK;
  if (folder && !problem) return refuse_file(command, path, given, error);
  return cav_file_fail(
      error, CAV_BAD_INPUT, 0,
      "%s: is a model; %s wants a problem file that names it, <problem model=\"%s\">, and says what to reach; "
      "an existing one takes another model by: cavort %s PROBLEM --model %s",
      path, command, path, command, path);
}
