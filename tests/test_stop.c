/// A body without an actuator that has to stand at the end has more rows than unknowns: a hand pushes a box and the
/// floor stops it. Rows that are met to the last digits must not hold the last phase (solver/programme.c): where they did
/// it ended at a cost of 0.0444, of which 4 % were still to be saved.
#include "cavort/cavort.h"
#include "check.h"

int main(void) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/sliding/stop.xml", NULL, &error);
  if (!CHECK(problem != NULL)) return check_result();
  cav_solution *s = NULL;
  cav_verdict v = {0};
  CHECK(cav_solve(problem, NULL, NULL, &s, &error) == CAV_OK);
  if (CHECK(s != NULL)) {
    CHECK(!cav_verify_solution(problem, s, &v, &error));
    CHECK(!cav_verify_optimality(problem, s->trajectory, &s->contact, s->nrow, s->row, &v, &error));
  }
  printf("pushed and stopped: cost %.5f, %.1e of it left, %s%s\n", v.cost, v.optimality,
         v.certified ? "certified" : "not certified: ", v.reason);
  CHECK(v.certified && v.achieved);
  CHECK(v.cost < 0.0395 && v.optimality < 1e-3);
  cav_solution_free(s);
  cav_problem_free(problem);
  return check_result();
}
