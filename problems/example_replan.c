#include <cavort/cavort.h>
#include <stdio.h>
#include <stdlib.h>

// a plan that is followed: solved once, then step by step shortened from where the body has come to, one iteration a step.
// Usage: example_replan PROBLEM [STEPS]; the problem names its model and is no cycle
int main(int argc, char **argv) {
  cav_error error = {0};
  cav_progress at = {0};
  cav_problem *problem = cav_problem_load(argc > 1 ? argv[1] : "problems/motions/kick/problem.xml", NULL, &error);
  if (!problem) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;
  int steps = argc > 2 ? atoi(argv[2]) : 5;
  cav_solve_options options = cav_solve_options_default();
  cav_optimiser *optimiser = cav_optimiser_new(problem, &options, NULL, &error);
  if (!optimiser) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;

  cav_status status = cav_optimiser_solve(optimiser, 1, &at, &error);
  printf("solved: %s, cost %.4g, %d iterations, %.2f s\n", cav_status_name(status), at.cost, at.iteration, at.seconds);

  // a weight is changed in place: from the old optimum to the new one
  int before = at.iteration;
  problem->term[0].weight *= 1.1;
  status = cav_optimiser_solve(optimiser, problem->schedule.stages + 1, &at, &error);
  printf("a weight changed: %s, %d iterations more\n", cav_status_name(status), at.iteration - before);

  // a controller: here the body does as planned, so q and v are NULL
  for (int i = 0; i < steps && !status; i++) {
    status = cav_optimiser_shift(optimiser, 1, NULL, NULL);
    if (!status) status = cav_optimiser_iterate(optimiser, 1, &at);
    const cav_trajectory *plan = cav_optimiser_trajectory(optimiser);
    printf("step %d: cost %.4g, unactuated %.1e of the weight, first force %.4g, %.1f ms\n", i + 1, at.cost,
           at.unactuated, plan->u[plan->nv - 1], 1e3 * at.seconds);
  }
  cav_optimiser_free(optimiser);
  cav_problem_free(problem);
  return status;
}
