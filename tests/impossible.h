/// Problems that are proven impossible, and their twins that are not: a folder for their files, proofs with their time, and
/// what shows that a twin has a solution.
#ifndef CAVORT_TESTS_IMPOSSIBLE_H
#define CAVORT_TESTS_IMPOSSIBLE_H

#include <time.h>

#include "cavort/cavort.h"
#include "scene.h"

#define CONSTRAINT(...) "<constraint>" __VA_ARGS__ "</constraint>"

static char folder[] = "/tmp/cavort-feasibility-XXXXXX";

static inline double processor_seconds(void) { return (double)clock() / CLOCKS_PER_SEC; }

// proofs against a problem; prints the first where there should be none
static inline int proofs(const char *name, const cav_problem *p, cav_impossibility *found, int most, int wanted) {
  int n = -1;
  cav_error error = {0};
  double from = processor_seconds();
  CHECK(cav_problem_impossible(p, found, most, &n, &error) == CAV_OK);
  double seconds = processor_seconds() - from;
  // seen up to 0.4, of a pendulum to be pumped, and 2.2 with sanitizers beside other work
  const double most_seconds = 2 * check_every(5);
  CHECK(seconds < most_seconds);
  if (seconds >= most_seconds || (n > 0) != wanted)
    fprintf(stderr, "    %s: %d proofs in %.3f s: %s\n", name, n, seconds, n > 0 ? found[0].what : "");
  return n;
}

// the twin has a solution: the solver finds it, and verification certifies and finds achieved what is asked
static inline void check_possible(const char *name, const cav_problem *p) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_verdict verdict = {0};
  cav_error error = {0};
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  if (s) CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, &error) == CAV_OK);
  int possible = status == CAV_OK && verdict.certified && verdict.achieved;
  CHECK(possible);
  if (!possible) fprintf(stderr, "    %s: status %d, %s %s\n", name, status, verdict.reason, verdict.missed);
  cav_solution_free(s);
}

#endif
