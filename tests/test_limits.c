/// A motion whose efforts use what solving lets go of limits is brought to where a certificate asks for them: one at its limits,
/// which then are a little lower. One that cannot be stays as it was.
#include "continuation.h"
#include "lqr.h"
#include "motion.h"
#include "transcription.h"

/// A run at the end of its schedule, from a motion.
static int open_run(cav_solve_run *run, const cav_problem *problem, const cav_solve_options *options,
                    const cav_trajectory *from) {
  cav_error error = {0};
  if (!CHECK(cav_run_open(run, problem, options, from, &error) == CAV_OK)) return 0;
  cav_stage_set(problem, 1, run->tr);
  return CHECK(cav_transcription_values(run->tr, run->at) == CAV_OK);
}

static double apart(const cav_trajectory *a, const cav_trajectory *b) {
  double most = 0;
  for (int i = 0; i < a->nknot * a->nq; i++) most = fmax(most, fabs(a->q[i] - b->q[i]));
  return most;
}

int main(void) {
  cav_problem *problem = motion_load(&(motion_case){"hop", NULL});
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_error error = {0};
  options.gains = 0;
  if (!CHECK(problem && cav_solve(problem, &options, NULL, &s, &error) == CAV_OK)) return check_result();
  const double part[] = {1e-5, 1e-4, 0.3};
  for (int i = 0; i < 3; i++) {
    cav_problem lower = *problem;
    cav_solve_run run;
    lower.effort_limit *= 1 - part[i];
    if (!open_run(&run, &lower, &options, s->trajectory)) return check_result();
    const int met = cav_run_met(&run);
    CHECK(!cav_run_within_limits(&run));
    CHECK(cav_restore_limits(&run) == CAV_OK);
    printf("limits lower by %g: rows are %s, then limits are %s, %.1e m or rad away\n", part[i],
           met ? "met" : "not met", cav_run_within_limits(&run) ? "kept" : "exceeded", apart(run.at, s->trajectory));
    CHECK(met == (part[i] < 0.1) && cav_run_within_limits(&run) == met);
    CHECK(!met || cav_run_met(&run));
    CHECK(met ? apart(run.at, s->trajectory) < 100 * part[i] : apart(run.at, s->trajectory) == 0);
    cav_run_close(&run);
  }
  cav_solution_free(s);
  cav_problem_free(problem);
  return check_result();
}
