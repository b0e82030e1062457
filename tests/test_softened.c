/// Where the last phase is stuck it goes on by way of softer laws: a walk's cycle stands still 3e-3 above the optimum that
/// all iterations find, and comes to it. Where no end is asked for it is not tried, and a motion that is not stuck has none.
/// Where softer laws gain nothing, as with a box that is shoved, slow steps go on to the optimum.
#include "motion.h"

/// Cost at the end of the first run of the last phase, stages of softer laws.
typedef struct course {
  double first, last;
  int softened;
} course;

static course solve(const char *name, cav_problem *problem, double optimality) {
  course c = {.first = NAN, .last = NAN};
  if (!problem) return c;
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_error error = {0};
  options.gains = 0;
  options.optimality = optimality;
  problem->schedule.optimality = 0;
  CHECK(cav_solve(problem, &options, NULL, &s, &error) == CAV_OK);
  cav_verdict verdict = {0};
  if (s) {
    c.last = s->cost;
    for (int i = 0; i < s->nstage; i++) {
      const cav_stage_record *stage = &s->stage[i];
      c.softened += !strcmp(stage->phase, "softened");
      if (!strcmp(stage->phase, "sqp") && isnan(c.first)) c.first = stage->cost;
    }
    CHECK(cav_verify_solution(problem, s, &verdict, &error) == CAV_OK);
    CHECK(cav_verdict_feasible(&verdict));
  }
  printf("%s, to %g: cost %.6f at first, %.6f at the end, %d stages of softer laws\n", name, optimality, c.first,
         c.last, c.softened);
  cav_solution_free(s);
  cav_problem_free(problem);
  return c;
}

static course solve_motion(const char *motion, double optimality) {
  return solve(motion, motion_load(&(motion_case){motion, NULL}), optimality);
}

static course solve_shove(double optimality) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/sliding/shove.xml", NULL, &error);
  CHECK(problem != NULL);
  return solve("shove", problem, optimality);
}

int main(void) {
  course whole = solve_motion("walk-cycle", 0), stuck = solve_motion("walk-cycle", 1e-4),
         quick = solve_motion("hop", 1e-4);
  CHECK(whole.softened == 0 && quick.softened == 0);
  CHECK(stuck.softened > 0);
  CHECK(stuck.first > 1.001 * whole.last);
  CHECK(stuck.last < stuck.first && stuck.last < 1.0005 * whole.last);
  course all = solve_shove(0), slow = solve_shove(5e-4);
  CHECK(slow.softened > 0 && slow.first > 1.1 * all.last && slow.last < 1.001 * all.last);
  return check_result();
}
