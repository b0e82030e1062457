/// Our humanoid with things beside it that a motion has no use for, as files.
#ifndef CAVORT_TESTS_CROWD_H
#define CAVORT_TESTS_CROWD_H

#include "cavort/problem.h"
#include "scene.h"

/// Writes the model into a temporary file, whose name it puts into path ("...XXXXXX"): so many free balls that lie ten
/// metres away, and so many boxes that stand in a ring there. Its postures, which have no balls, go. 0 on failure.
static inline int crowd_write(int balls, int boxes, char *path) {
  static char text[1 << 18];
  FILE *file = fopen(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", "r");
  const size_t size = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[size] = 0;
  char *end = strstr(text, "</worldbody>"), *total = strstr(text, "settotalmass=");
  // of the whole model, which the humanoid would share with the balls: its own density instead
  for (int quotes = 0; total && quotes < 2; total++) {
    quotes += *total == '"';
    *total = ' ';
  }
  const int out = mkstemp(path);
  file = out >= 0 ? fdopen(out, "w") : NULL;
  if (!CHECK(end && file)) return 0;
  fprintf(file, "%.*s", (int)(end - text), text);
  for (int i = 0; i < balls; i++)
    fprintf(file, "<body name='ball%d' pos='%g %g .0999'><freejoint/><geom type='sphere' size='.1'/></body>", i,
            10.0 + i % 15, i / 15 * 1.0);
  for (int i = 0; i < boxes; i++) {
    double angle = 6.283185307179586 * i / boxes;
    fprintf(file, "<geom type='box' size='.2 .2 .2' pos='%.3f %.3f .2'/>", 10 * cos(angle), 10 * sin(angle));
  }
  const char *keys = strstr(end, "<keyframe>"), *after = keys ? strstr(keys, "</keyframe>") : NULL;
  fprintf(file, "%.*s%s", (int)((after ? keys : end) - end), end, after ? after + strlen("</keyframe>") : end);
  return fclose(file) == 0;
}

/// A problem on such a model; NULL with a message on failure.
static inline cav_problem *crowd_problem(const char *path, int balls, int boxes) {
  char model[] = "/tmp/cavort-crowd-XXXXXX";
  if (!crowd_write(balls, boxes, model)) return NULL;
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(path, model, &error);
  unlink(model);
  if (!CHECK(problem != NULL)) fprintf(stderr, "%s\n", error.text);
  return problem;
}

#endif
