/// Model files for tests of what holds of many: those of this repository, and those that no one here wrote.
#ifndef CAVORT_TESTS_SHIPPED_H
#define CAVORT_TESTS_SHIPPED_H

#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"

enum { SHIPPED_PATH = 5000 };

/// Path of a model of problems/models, or of the shared ones; whether it can be read.
static inline int shipped_path(const char *name, int shared, char path[SHIPPED_PATH]) {
  const char *folder = shared ? check_shared_models() : CAVORT_SOURCE_ROOT "/problems/models";
  if (!folder) return 0;
  snprintf(path, SHIPPED_PATH, "%s/%s", folder, name);
  return access(path, R_OK) == 0;
}

/// A model of a file, floating: its base is free; a failed check where it does not load, NULL then, and without a word for robots
/// with meshes in a build that is without their hulls.
static inline cav_model *shipped_load(const char *path, int floating) {
  cav_error error = {0};
  cav_load_options options = cav_load_options_default();
  options.floating = floating;
  cav_model *m = cav_model_load_with(path, &options, &error);
#ifndef CAVORT_HAVE_QHULL
  if (!m && strstr(error.text, "needs Qhull")) return NULL;
#endif
  if (!CHECK(m != NULL)) fprintf(stderr, "    %s\n", error.text);
  return m;
}

#endif
