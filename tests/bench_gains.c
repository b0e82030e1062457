/// What gains and certificates of solved motions cost. Usage: bench_gains FOLDER...: of each result folder the sets that are
/// tried and seconds of the processor for the choice and for the verification, each over a second of the motion, then what
/// the certificate says of the closed loops.
#include <libgen.h>
#include <time.h>

#include "check.h"
#include "lqr.h"
#include "result.h"

static double seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int note_set(void *context, int set, int most) {
  (void)most;
  *(int *)context = set;
  return 0;
}

static void run(const char *folder) {
  cav_error error = {0};
  cav_result *result = cav_result_read(folder, NULL, &error);
  if (!CHECK(result != NULL)) fprintf(stderr, "    %s\n", error.text);
  if (!result) return;
  cav_problem *problem = result->problem;
  cav_transcription *tr = cav_transcription_new(problem, 1, &error);
  cav_solution solution = {.trajectory = result->trajectory, .contact = problem->contact};
  cav_verdict v = {0};
  int sets = 0;
  if (!CHECK(tr != NULL)) fprintf(stderr, "    %s\n", error.text);
  if (tr) {
    tr->options = problem->contact;
    const double begin = seconds();
    CHECK(cav_choose_gains(problem, tr, result->trajectory, 0, note_set, &sets, &solution, NULL, &error) == CAV_OK);
    const double chosen = seconds();
    CHECK(cav_verify_solution(problem, &solution, &v, &error) == CAV_OK);
    const double end = seconds();
    char *copy = strdup(folder);
    printf("%-16s %4d %8.3f %8.3f %9.3f %10s %9.1f %9.1f %8.2f %8.2f\n", basename(copy), sets,
           (chosen - begin) / v.duration, (end - chosen) / v.duration, (end - begin) / v.duration,
           v.certified ? "yes" : "no", 1e3 * v.closed_loop_end_error_m, 1e3 * v.model_contacts_end_error_m,
           v.push_survived_n_s, v.feedback_effort_max);
    fflush(stdout);
    free(copy);
  }
  cav_gains_free(&solution);
  cav_transcription_free(tr);
  cav_result_free(result);
}

int main(int argc, char **argv) {
  printf("%-16s %4s %8s %8s %9s %10s %9s %9s %8s %8s\n", "motion", "sets", "gains", "verified", "both, s/s",
         "certified", "loop, mm", "own, mm", "push", "asked");
  for (int i = 1; i < argc; i++) run(argv[i]);
  return check_result();
}
