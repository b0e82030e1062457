/// Result folders played in MuJoCo. Usage: bench_replay FACTOR FOLDER...: a row of a table for each, at 1 ms and 2 ms,
/// beside what the certificate says of the same motion, with gains times the factor; bench_replay apart FOLDER...: at
/// steps and from starts that no gains were chosen by; bench_replay anew FOLDER...: the same with gains that are chosen
/// anew.
#include "check.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else
#include <libgen.h>

#include "lqr.h"
#include "replay.h"
#include "result.h"

enum { STARTS = 8 };
static const double off = 0.003; // m or rad; velocities m/s or rad/s ten times that

// a row of a motion at steps of 0.5 and 4 ms, and at 1 ms from starts that are a little off
static void report_apart(replay *s, const char *motion) {
  const double duration = s->problem->duration * s->periods;
  int follow = 0;
  replay_end worst = {0};
  printf("| %s | %.2f |", motion, duration);
  for (int fourfold = 0; fourfold < 2; fourfold++) {
    replay_end p = replay_play(s, fourfold ? 0.004 : 0.0005, 1, 0);
    printf(" %.2f | %.0f |", p.seconds, 1e3 * p.body);
  }
  scene_seed = 1;
  for (int i = 0; i < STARTS; i++) {
    replay_end p = replay_play(s, 0.001, 1, off);
    const int whole = p.seconds >= duration * (1 - 1e-9);
    follow += whole;
    if (whole) worst.body = fmax(worst.body, p.body);
  }
  printf(" %d of %d | %.0f |\n", follow, STARTS, 1e3 * worst.body);
}

// one row
static void report(replay *s, const char *motion) {
  cav_verdict v = {0};
  cav_error error = {0};
  const cav_problem *problem = s->problem;
  CHECK(cav_verify(problem, s->plan, &problem->contact, s->gain_q, s->gain_v, &v, &error) == CAV_OK);
  printf("| %s | %s | %s | %.2f | %.2f | %.0f | %.2f | %.0f |", motion, v.certified ? "yes" : "no",
         v.achieved ? "yes" : "no", v.duration * v.periods, v.closed_loop_seconds, 1e3 * v.closed_loop_end_error_m,
         v.model_contacts_seconds, 1e3 * v.model_contacts_end_error_m);
  for (int ms = 1; ms <= 2; ms++) {
    replay_end p = replay_play(s, 1e-3 * ms, 1, 0);
    printf(" %.2f | %.0f | %.0f |", p.seconds, 1e3 * p.body, 1e3 * p.root);
  }
  printf(" %.1f |\n", v.push_survived_n_s);
}

static int go_on(void *context, int set, int most) {
  (void)context, (void)set, (void)most;
  return 0;
}

// gains of a result by the rule as it is now
static void choose(cav_result *result) {
  cav_error error = {0};
  cav_transcription *tr = cav_transcription_new(result->problem, 1, &error);
  cav_solution solution = {.contact = result->problem->contact};
  if (!CHECK(tr != NULL)) return;
  tr->options = result->problem->contact;
  CHECK(cav_choose_gains(result->problem, tr, result->trajectory, 0, go_on, NULL, &solution, NULL, &error) == CAV_OK);
  free(result->gain_q), free(result->gain_v);
  result->gain_q = solution.gain_q, result->gain_v = solution.gain_v;
  solution.gain_q = solution.gain_v = NULL;
  cav_gains_free(&solution);
  cav_transcription_free(tr);
}

static void run(const char *folder, int apart, int anew, double factor) {
  cav_error error = {0};
  cav_result *result = cav_result_read(folder, NULL, &error);
  CHECK(result != NULL);
  if (!result) fprintf(stderr, "    %s\n", error.text);
  if (!result) return;
  if (anew) choose(result);
  const cav_model *model = result->problem->model;
  size_t gains = (size_t)(result->trajectory->nknot - 1) * (size_t)(model->nv * model->nv);
  for (size_t k = 0; k < gains && result->gain_q; k++) result->gain_q[k] *= factor, result->gain_v[k] *= factor;
  replay s = {.problem = result->problem, .plan = result->trajectory};
  s.gain_q = result->gain_q, s.gain_v = result->gain_v;
  char *path = cav_result_path(folder, "problem.xml"), *copy = strdup(folder), *name = basename(copy);
  const char *motion = strncmp(name, "r-", 2) ? name : name + 2;
  if (!result->gain_q) fprintf(stderr, "    %s: has no gains\n", folder);
  if (CHECK(result->gain_q) && replay_open(&s, path)) (apart ? report_apart : report)(&s, motion);
  replay_close(&s);
  free(path);
  free(copy);
  cav_result_free(result);
}

int main(int argc, char **argv) {
  char *end = NULL;
  if (argc > 1) strtod(argv[1], &end);
  if (argc < 3 || (*end && strcmp(argv[1], "anew") && strcmp(argv[1], "apart"))) {
    fprintf(stderr, "usage: bench_replay FACTOR|apart|anew FOLDER...: a factor of the gains, 1 as they are\n");
    return 2;
  }
  for (int i = 2; i < argc; i++) {
    const int anew = !strcmp(argv[1], "anew"), apart = anew || !strcmp(argv[1], "apart");
    run(argv[i], apart, anew, apart ? 1 : strtod(argv[1], NULL));
    fflush(stdout);
  }
  return check_failed > 0;
}
#endif
