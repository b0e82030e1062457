/// A result folder as a place that a solve writes into. A lock of the system's (fcntl) holds as long as the process
/// lives, however it ends, and is not inherited by processes that it starts. Every file appears whole (file.c); verdict.json
/// is the last one and speaks of all others, so a folder without it is one of a solve under way or cut off.
#include "store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "file.h"
#include "result.h"

/// Files of a result; after: those that are about a finished motion alone.
static const struct {
  const char *name;
  int after;
} files[] = {{"verdict.json", 1},   {"gains.csv", 1},  {"forces.csv", 1},  {"controls.csv", 1}, {"residual.csv", 1},
             {"stderr.csv", 1},     {"terms.csv", 1},  {"records.csv", 1}, {"view.html", 1},    {"strategies.csv", 1},
             {"parameters.csv", 1}, {"model.xml", 1},  {"rows.csv", 0},    {"log.csv", 0},      {"stages.csv", 0},
             {"trajectory.csv", 0}, {"problem.xml", 0}};
enum { NFILE = sizeof files / sizeof *files, MOST_ASIDE = 100000 };

static int ends_with(const char *name, const char *end) {
  size_t n = strlen(name), m = strlen(end);
  return n >= m && !strcmp(name + n - m, end);
}

// what a solve that was killed left half written
static int is_temporary(const char *name) {
  if (!ends_with(name, ".tmp")) return 0;
  for (int i = 0; i < NFILE; i++)
    if (!strncmp(name, files[i].name, strlen(files[i].name))) return 1;
  return !strncmp(name, "checkpoint", 10);
}

static int is_checkpoint(const char *name) { return !strncmp(name, "checkpoint", 10) && ends_with(name, ".csv"); }

// a file of a result, as its number; NFILE: one of a solve under way; -1: something else
static int kind_of(const char *name) {
  for (int i = 0; i < NFILE; i++)
    if (!strcmp(name, files[i].name)) return i;
  return is_checkpoint(name) || is_temporary(name) ? NFILE : -1;
}

// counts files of a result, and names something else that is there
static int look(const char *folder, char *other, size_t room) {
  int n = 0;
  DIR *all = opendir(folder);
  *other = 0;
  for (const struct dirent *e; all && (e = readdir(all));) {
    if (!strcmp(e->d_name, ".") || !strcmp(e->d_name, "..") || !strcmp(e->d_name, ".lock")) continue;
    if (kind_of(e->d_name) >= 0)
      n += !is_temporary(e->d_name);
    else
      snprintf(other, room, "%.100s", e->d_name);
  }
  if (all) closedir(all);
  return n;
}

// takes the lock; -1 with the reason in error
static int lock(const char *folder, cav_error *error) {
  char *path = cav_result_path(folder, ".lock");
  int descriptor = path ? open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666) : -1;
  struct flock whole = {.l_type = F_WRLCK, .l_whence = SEEK_SET}, other = whole;
  if (!path) {
    cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", folder);
  } else if (descriptor < 0) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be written: %s", path, strerror(errno));
  } else if (fcntl(descriptor, F_SETLK, &whole) != 0) {
    fcntl(descriptor, F_GETLK, &other);
    cav_file_fail(error, CAV_BAD_INPUT, 0,
                  "%s: another solve writes into it (process %ld); choose another folder with -o", folder,
                  (long)other.l_pid);
    close(descriptor);
    descriptor = -1;
  }
  free(path);
  return descriptor;
}

// the whole folder under the next free name with a number
static cav_status move_aside(cav_store *store, cav_error *error) {
  size_t n = strlen(store->folder), room = n + 16;
  store->aside = malloc(room);
  if (!store->aside) return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", store->folder);
  while (n > 1 && store->folder[n - 1] == '/') n--;
  for (int i = 1; i < MOST_ASIDE; i++) {
    snprintf(store->aside, room, "%.*s.%d", (int)n, store->folder, i);
    if (access(store->aside, F_OK) == 0) continue;
    if (rename(store->folder, store->aside) == 0) return CAV_OK;
    if (errno != ENOTEMPTY && errno != EEXIST) break;
  }
  return cav_file_fail(error, CAV_BAD_INPUT, 0,
                       "%s: holds an earlier result and cannot be moved aside (%s); choose another folder with -o",
                       store->folder, strerror(errno));
}

// removes what a finished motion alone has, the verdict first
static void clear_finished(const char *folder) {
  for (int i = 0; i < NFILE; i++) {
    char *path = files[i].after ? cav_result_path(folder, files[i].name) : NULL;
    if (path) unlink(path);
    free(path);
  }
}

// removes what a test says yes to
static void clear(const char *folder, int (*is_meant)(const char *name)) {
  DIR *all = opendir(folder);
  for (const struct dirent *e; all && (e = readdir(all));) {
    char *path = is_meant(e->d_name) ? cav_result_path(folder, e->d_name) : NULL;
    if (path) unlink(path);
    free(path);
  }
  if (all) closedir(all);
}

// removes what processes that were killed left half written
static void clear_temporary(const char *folder) { clear(folder, is_temporary); }

cav_status cav_store_open(cav_store *store, const char *folder, int keep, cav_error *error) {
  char other[128];
  *store = (cav_store){.folder = folder, .lock = {-1, -1}};
  cav_status status = cav_result_folder(folder, error);
  if (status) return status;
  if ((store->lock[0] = lock(folder, error)) < 0) return error->status;
  int n = look(folder, other, sizeof other);
  clear_temporary(folder);
  if (keep) clear_finished(folder);
  if (keep || n == 0) return CAV_OK;
  if (*other) {
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "%s: holds an earlier result and other files (%s), which would be moved aside with it; choose "
                         "another folder with -o",
                         folder, other);
  }
  if ((status = move_aside(store, error))) return status;
  if ((status = cav_result_folder(folder, error))) return status;
  store->lock[1] = store->lock[0];
  return (store->lock[0] = lock(folder, error)) < 0 ? error->status : CAV_OK;
}

void cav_store_close(cav_store *store) {
  if (store->lock[0] >= 0) clear_temporary(store->folder);
  for (int i = 0; i < 2; i++)
    if (store->lock[i] >= 0) close(store->lock[i]);
  free(store->aside);
  *store = (cav_store){.lock = {-1, -1}};
}

char *cav_store_checkpoint(const char *folder, const char *strategy) {
  char name[80];
  if (!strcmp(strategy, "stated"))
    snprintf(name, sizeof name, "checkpoint.csv");
  else
    snprintf(name, sizeof name, "checkpoint-%.40s.csv", strategy);
  return cav_result_path(folder, name);
}

void cav_store_remove(const char *folder) {
  clear_temporary(folder);
  clear(folder, is_checkpoint);
  rmdir(folder);
}
