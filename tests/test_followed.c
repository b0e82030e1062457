/// Closed loops that were run for the choice of gains and are not run again: the verdict of a solution is that of its
/// motion and gains alone, to the bit, in fewer forward steps; and where gains, motion or law are another by one bit, all
/// loops are run.
#include "cavort/cavort.h"
#include "scene.h"

static const char hopper[] =
    "<mujoco><worldbody><geom type='plane' size='2 2 .1'/><body name='trunk' pos='0 0 .5'><joint name='z' type='slide' "
    "axis='0 0 1'/><geom type='sphere' size='.1' mass='2'/><body name='foot' pos='0 0 -.3'><joint name='leg' "
    "type='slide' "
    "axis='0 0 1' limited='true' range='-.2 .2'/><geom type='sphere' size='.05' mass='.3'/></body></body></worldbody>"
    "<actuator><motor joint='leg' gear='60' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

static const char problem_text[] =
    "<problem model='m.xml'><horizon duration='0.4' timestep='0.02'/><start qpos='-.15 0'/><goal qpos='-.15 0'/>"
    "<cost><effort weight='1'/><posture dofs='all' at='end' weight='300'/></cost></problem>";

static int steps;

cav_status __real_cav_forward_newton_from(const cav_model *model, cav_state *state, const double *q, const double *v,
                                          const double *u, const double *guess, int iterations, double tolerance,
                                          double *v_next, cav_forward_report *report);
cav_status __wrap_cav_forward_newton_from(const cav_model *model, cav_state *state, const double *q, const double *v,
                                          const double *u, const double *guess, int iterations, double tolerance,
                                          double *v_next, cav_forward_report *report);
cav_status __wrap_cav_forward_newton_from(const cav_model *model, cav_state *state, const double *q, const double *v,
                                          const double *u, const double *guess, int iterations, double tolerance,
                                          double *v_next, cav_forward_report *report) {
  steps++;
  return __real_cav_forward_newton_from(model, state, q, v, u, guess, iterations, tolerance, v_next, report);
}

/// Verifies both ways; whether loops were taken as known.
static int check_same(const cav_problem *p, const cav_solution *s) {
  cav_verdict alone = {0}, known = {0};
  cav_error error = {0};
  steps = 0;
  CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &alone, &error) == CAV_OK);
  const int all = steps;
  steps = 0;
  CHECK(cav_verify_solution(p, s, &known, &error) == CAV_OK);
  CHECK(!memcmp(&alone, &known, sizeof alone));
  CHECK(steps == all || steps < 2 * all / 3);
  printf("certified %d: %d forward steps, %d for the solution\n", alone.certified, all, steps);
  return steps < all;
}

int main(void) {
  char folder[] = "/tmp/cavort-followed-XXXXXX", path[300];
  if (!mkdtemp(folder)) return 1;
  scene_write(folder, "m.xml", hopper);
  scene_write(folder, "p.xml", problem_text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  cav_error error = {0};
  cav_problem *p = cav_problem_load(path, NULL, &error);
  cav_solution *s = NULL;
  if (!CHECK(p && cav_solve(p, NULL, NULL, &s, &error) == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  if (s && CHECK(s->gain_q && s->followed)) {
    CHECK(check_same(p, s));
    double *number[] = {&s->gain_q[1], &s->gain_v[3], &s->trajectory->q[7], &p->v_start[0], &s->contact.softness};
    for (size_t i = 0; i < sizeof number / sizeof *number; i++) {
      const double kept = *number[i];
      *number[i] = nextafter(kept, 1);
      CHECK(!check_same(p, s));
      *number[i] = kept;
    }
    CHECK(check_same(p, s));
  }
  cav_verdict verdict = {0};
  CHECK(p && cav_verify_solution(p, NULL, &verdict, &error) == CAV_BAD_INPUT);
  cav_solution_free(s);
  cav_problem_free(p);
  return check_result();
}
