/// What tests of strategies and guesses share: a problem from its text, a strategy by its name.
#ifndef CAVORT_TESTS_STRATEGY_H
#define CAVORT_TESTS_STRATEGY_H

#include "cavort/solve.h"
#include "scene.h"

/// NULL: none of that name.
static inline const cav_strategy *strategy_find(const cav_strategy *strategy, int n, const char *name) {
  for (int i = 0; i < n; i++)
    if (!strcmp(strategy[i].name, name)) return &strategy[i];
  return NULL;
}

/// The problem of a text that names its model by a whole path; NULL after a failed check.
static inline cav_problem *strategy_problem(const char *text) {
  char folder[] = "/tmp/cavort_problem_XXXXXX", path[100];
  if (!CHECK(mkdtemp(folder) != NULL)) return NULL;
  cav_error error = {0};
  scene_write(folder, "p.xml", text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  unlink(path), rmdir(folder);
  return p;
}

#endif
