/// Result folders played in MuJoCo at 1 ms and 2 ms, beside what the certificate says of the same motion. Usage:
/// bench_replay FACTOR FOLDER...: a row of a table for each, with gains times the factor.
#include "check.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else
#include <libgen.h>

#include "replay.h"
#include "result.h"

// one row
static void report(replay *s, const char *folder) {
  cav_verdict v = {0};
  cav_error error = {0};
  const cav_problem *problem = s->problem;
  CHECK(cav_verify(problem, s->plan, &problem->contact, s->gain_q, s->gain_v, &v, &error) == CAV_OK);
  char *path = strdup(folder), *name = basename(path);
  const char *motion = strncmp(name, "r-", 2) ? name : name + 2;
  printf("| %s | %s | %s | %.2f | %.2f | %.0f | %.2f | %.0f |", motion, v.certified ? "yes" : "no",
         v.achieved ? "yes" : "no", v.duration * v.periods, v.closed_loop_seconds, 1e3 * v.closed_loop_end_error_m,
         v.model_contacts_seconds, 1e3 * v.model_contacts_end_error_m);
  for (int ms = 1; ms <= 2; ms++) {
    replay_end p = replay_play(s, 1e-3 * ms, 1);
    printf(" %.2f | %.0f | %.0f |", p.seconds, 1e3 * p.body, 1e3 * p.root);
  }
  printf(" %.1f |\n", v.push_survived_n_s);
  free(path);
}

static void run(const char *folder, double factor) {
  cav_error error = {0};
  cav_result *result = cav_result_read(folder, NULL, &error);
  CHECK(result != NULL);
  if (!result) fprintf(stderr, "    %s\n", error.text);
  if (!result) return;
  const cav_model *model = result->problem->model;
  size_t gains = (size_t)(result->trajectory->nknot - 1) * (size_t)(model->nv * model->nv);
  for (size_t k = 0; k < gains && result->gain_q; k++) result->gain_q[k] *= factor, result->gain_v[k] *= factor;
  replay s = {.problem = result->problem, .plan = result->trajectory};
  s.gain_q = result->gain_q, s.gain_v = result->gain_v;
  char *path = cav_result_path(folder, "problem.xml");
  if (!result->gain_q) fprintf(stderr, "    %s: has no gains\n", folder);
  if (CHECK(result->gain_q) && replay_open(&s, path)) report(&s, folder);
  replay_close(&s);
  free(path);
  cav_result_free(result);
}

int main(int argc, char **argv) {
  for (int i = 2; i < argc; i++) {
    run(argv[i], strtod(argv[1], NULL));
    fflush(stdout);
  }
  return check_failed > 0;
}
#endif
