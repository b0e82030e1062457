/// A body without an actuator that has to stand at the end has more rows than unknowns: a hand pushes a box and the
/// floor stops it. Rows that are met to the last digits must not hold the last phase (solver/programme.c): where they did
/// it ended at a cost of 0.0444, of which 4 % were still to be saved.
/// And what friction holds stands at the end, where nothing moves after the last knot: friction is found from slip, so
/// where it is let see that alone it holds nothing there, and a box held against a wall has to come up at g h, 0.196 m/s.
#include <math.h>

#include "cavort/cavort.h"
#include "check.h"

/// What the wall and the hand give the box along the vertical at the last knot is its weight, and what stops its creep.
static void test_held(void) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/sliding/held.xml", NULL, &error);
  if (!CHECK(problem != NULL)) return;
  cav_solution *s = NULL;
  cav_verdict v = {0};
  CHECK(cav_solve(problem, NULL, NULL, &s, &error) == CAV_OK);
  if (CHECK(s != NULL) && CHECK(!cav_verify_solution(problem, s, &v, &error))) {
    const cav_model *m = problem->model;
    const int last = s->trajectory->nknot - 1, box = 1; // its vertical slide
    const double mass = 2, up = s->trajectory->v[last * m->nv + box], h = s->trajectory->timestep;
    cav_forces *forces = cav_forces_new(m, s->trajectory, &s->contact, 1, &error);
    double borne = 0;
    for (int i = 0; forces && i < forces->nforce; i++)
      if (forces->force[i].knot == last) borne += forces->force[i].force[2];
    printf("held against a wall: %s, it creeps by %.2g mm/s, friction bears %.4g of %.4g N\n",
           v.certified ? "certified" : v.reason, -1e3 * up, borne, -mass * m->gravity[2]);
    CHECK(v.certified && v.achieved && s->contact.stops);
    // seen: 3.4 mm/s down
    CHECK(up < 0 && up > -0.01 && fabs(borne + mass * (m->gravity[2] + up / h)) < 1e-6);
    // the law without that has another last knot
    cav_options other = s->contact;
    other.stops = 0;
    CHECK(!cav_verify(problem, s->trajectory, &other, s->gain_q, s->gain_v, &v, &error));
    CHECK(!v.certified && v.unactuated_force_knot == last);
    cav_forces_free(forces);
  }
  cav_solution_free(s);
  cav_problem_free(problem);
}

/// What friction alone holds, with no actuator to help, is off by the inertia of its creep alone: 2.1 % of the weight, where
/// friction that lets go at the last knot left 25 %.
static void test_ramp(void) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/sliding/ramp.xml", NULL, &error);
  if (!CHECK(problem != NULL)) return;
  cav_solution *s = NULL;
  cav_verdict v = {0};
  cav_solve(problem, NULL, NULL, &s, &error);
  if (CHECK(s != NULL) && CHECK(!cav_verify_solution(problem, s, &v, &error))) {
    printf("on a ramp: %.3g of the weight off, at knot %d\n", v.unactuated_force_max, v.unactuated_force_knot);
    CHECK(v.unactuated_force_max < 0.03);
  }
  cav_solution_free(s);
  cav_problem_free(problem);
}

int main(void) {
  test_held();
  test_ramp();
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/sliding/stop.xml", NULL, &error);
  if (!CHECK(problem != NULL)) return check_result();
  // to where little may be left, which is not far from the end of what goes on to the last digit
  for (int last = 0; last < 2; last++) {
    cav_solve_options options = cav_solve_options_default();
    cav_solution *s = NULL;
    cav_verdict v = {0};
    if (last) options.optimality = 0;
    const double left = last ? 1e-6 : 1e-4;
    CHECK(cav_solve(problem, &options, NULL, &s, &error) == CAV_OK);
    if (CHECK(s != NULL)) {
      CHECK(!cav_verify_solution(problem, s, &v, &error));
      CHECK(!cav_verify_optimality(problem, s->trajectory, &s->contact, s->nrow, s->row, &v, &error));
    }
    printf("pushed and stopped: cost %.5f, %.1e of it left, %s%s\n", v.cost, v.optimality,
           v.certified ? "certified" : "not certified: ", v.reason);
    CHECK(v.certified && v.achieved);
    CHECK(v.cost < 0.0377 && v.optimality < left);
    cav_solution_free(s);
  }
  cav_problem_free(problem);
  return check_result();
}
