/// The solver that is made once: the same motion as cav_solve, a changed weight by few iterations, iterations alone to
/// the same optimum, shifts that keep motion and multipliers where they were in time, and what is refused.
#include "cavort/cavort.h"
#include "scene.h"

/// A box on a slope of its own making: two sliders and a hinge, with limits that are active and a floor.
static const char model_text[] =
    "<mujoco model='arm'><worldbody><geom type='plane' size='5 5 1'/>"
    "<body pos='0 0 1'><joint name='shoulder' axis='0 1 0' damping='.2'/><geom type='capsule' size='.04' fromto='0 0 0 "
    "0 0 -.4' "
    "mass='2'/><body pos='0 0 -.4'><joint name='elbow' axis='0 1 0' damping='.1' limited='true' range='-100 20'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.4' mass='1'/></body></body></worldbody><actuator>"
    "<motor joint='shoulder' gear='30' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='elbow' gear='8' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
static const char problem_text[] =
    "<problem name='reach' model='model.xml'><horizon duration='1' timestep='.025'/><start/>"
    "<goal><joint name='shoulder' pos='-1.2'/><joint name='elbow' pos='-.6'/></goal>"
    "<cost><posture dofs='all' at='end' weight='900'/><effort weight='1'/></cost></problem>";

static cav_problem *load(const char *folder) {
  char path[300];
  cav_error error = {0};
  scene_write(folder, "model.xml", model_text);
  scene_write(folder, "problem.xml", problem_text);
  snprintf(path, sizeof path, "%.250s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  return p;
}

static cav_solve_options options_of(int first_stage) {
  cav_solve_options options = cav_solve_options_default();
  options.gains = 0;
  options.first_stage = first_stage;
  return options;
}

static double difference(const cav_trajectory *a, const cav_trajectory *b) {
  double most = 0;
  for (int i = 0; i < a->nknot * a->nq; i++) most = fmax(most, fabs(a->q[i] - b->q[i]));
  return most;
}

// the first solve is cav_solve's to the bit; a changed weight is followed
static void test_solves(cav_problem *p) {
  cav_error error = {0};
  cav_progress last;
  cav_solve_options options = options_of(0);
  cav_solution *cold = NULL, *changed = NULL;
  CHECK(cav_solve(p, &options, NULL, &cold, &error) == CAV_OK);
  cav_optimiser *o = cav_optimiser_new(p, &options, NULL, &error);
  if (!CHECK(o && cold)) return;
  CHECK(cav_optimiser_solve(o, 1, &last, &error) == CAV_OK);
  CHECK(difference(cav_optimiser_trajectory(o), cold->trajectory) == 0);
  int n, before = last.iteration;
  const double *multiplier = cav_optimiser_multipliers(o, &n);
  if (CHECK(n == cold->nmultiplier)) CHECK(!memcmp(multiplier, cold->multiplier, (size_t)n * sizeof(double)));

  p->term[0].weight *= 1.2;
  CHECK(cav_solve(p, &options, NULL, &changed, &error) == CAV_OK);
  CHECK(cav_optimiser_solve(o, p->schedule.stages + 1, &last, &error) == CAV_OK);
  if (CHECK(changed != NULL)) {
    printf("a changed weight: %d iterations, cold %d\n", last.iteration - before, changed->iterations);
    CHECK(10 * (last.iteration - before) <= changed->iterations);
    CHECK_NEAR(last.cost, changed->cost, 1e-4 * changed->cost);
    CHECK(difference(cold->trajectory, changed->trajectory) > 1e-4);
    CHECK(difference(cav_optimiser_trajectory(o), changed->trajectory) <
          0.1 * difference(cold->trajectory, changed->trajectory));
  }
  cav_verdict verdict;
  const cav_trajectory *at = cav_optimiser_trajectory(o);
  CHECK(cav_verify(cav_optimiser_problem(o), at, cav_optimiser_contact(o), NULL, NULL, &verdict, &error) == CAV_OK);
  CHECK(cav_verdict_feasible(&verdict));

  // iterations alone come to the same optimum
  p->term[0].weight /= 1.2;
  for (int i = 0; i < 40; i++) CHECK(cav_optimiser_iterate(o, 1, &last) == CAV_OK);
  CHECK_NEAR(last.cost, cold->cost, 1e-3 * cold->cost);
  CHECK(last.violation < 1e-4);
  CHECK(difference(cav_optimiser_trajectory(o), cold->trajectory) <
        0.1 * difference(changed->trajectory, cold->trajectory));
  cav_optimiser_free(o);
  cav_solution_free(cold);
  cav_solution_free(changed);
}

static void test_shifts(const cav_problem *p) {
  enum { KNOTS = 3 };
  cav_error error = {0};
  cav_progress last;
  cav_solve_options options = options_of(0);
  cav_optimiser *o = cav_optimiser_new(p, &options, NULL, &error);
  if (!CHECK(o != NULL)) return;
  CHECK(cav_optimiser_solve(o, 1, NULL, &error) == CAV_OK);
  const cav_trajectory *at = cav_optimiser_trajectory(o);
  cav_trajectory *before = cav_trajectory_copy(at);
  CHECK(cav_optimiser_shift(o, KNOTS, NULL, NULL) == CAV_OK);
  int nq = at->nq, nv = at->nv, rest = at->nknot - KNOTS;
  CHECK(!memcmp(at->q, before->q + KNOTS * nq, (size_t)(rest * nq) * sizeof(double)));
  CHECK_NEAR_ALL(at->v, before->v + KNOTS * nv, rest * nv, 1e-12);
  for (int t = rest; t < at->nknot; t++)
    CHECK(!memcmp(at->q + t * nq, at->q + (rest - 1) * nq, (size_t)nq * sizeof(double)));
  CHECK(!memcmp(cav_optimiser_problem(o)->q_start, at->q, (size_t)nq * sizeof(double)));
  CHECK(!memcmp(cav_optimiser_problem(o)->v_start, at->v, (size_t)nv * sizeof(double)));
  // the given problem keeps its start
  CHECK(p->q_start != cav_optimiser_problem(o)->q_start);
  // from somewhere else, and solved there
  double q[2] = {at->q[0] + 0.01, at->q[1]}, v[2] = {at->v[0], at->v[1] - 0.1};
  CHECK(cav_optimiser_shift(o, 0, q, v) == CAV_OK);
  CHECK(at->q[0] == q[0] && at->v[1] == v[1]);
  CHECK(cav_optimiser_solve(o, p->schedule.stages + 1, &last, &error) == CAV_OK);
  at = cav_optimiser_trajectory(o);
  CHECK(at->q[0] == q[0] && at->v[1] == v[1]);
  CHECK(last.unactuated < 1e-6 && last.violation < 1e-6);
  cav_verdict verdict;
  CHECK(cav_verify(cav_optimiser_problem(o), at, cav_optimiser_contact(o), NULL, NULL, &verdict, &error) == CAV_OK);
  CHECK(cav_verdict_feasible(&verdict));
  v[0] = NAN;
  CHECK(cav_optimiser_shift(o, 1, q, v) == CAV_BAD_INPUT);
  CHECK(cav_optimiser_shift(o, -1, NULL, NULL) == CAV_BAD_INPUT);
  CHECK(cav_optimiser_shift(o, at->nknot - 1, NULL, NULL) == CAV_BAD_INPUT);
  CHECK(cav_optimiser_iterate(o, 0, NULL) == CAV_BAD_INPUT);
  cav_trajectory_free(before);
  cav_optimiser_free(o);
  options.threads = 0;
  CHECK(!cav_optimiser_new(p, &options, NULL, &error) && error.status == CAV_BAD_INPUT);
}

static int asked;
static int ask(void *context) {
  (void)context;
  return asked;
}

// one call that is stopped does not stop the next
static void test_stopped(const cav_problem *p) {
  static const int how[] = {CAV_STOP_NOW, CAV_STOP_SOON};
  cav_solve_options options = cav_solve_options_default();
  cav_error error;
  options.stop = ask;
  cav_optimiser *o = cav_optimiser_new(p, &options, NULL, &error);
  if (!CHECK(o != NULL)) return;
  for (int k = 0; k < 2; k++) {
    cav_progress last;
    asked = how[k];
    CHECK(cav_optimiser_solve(o, 0, NULL, &error) == CAV_INTERRUPTED);
    CHECK(cav_optimiser_iterate(o, 2, NULL) == CAV_INTERRUPTED);
    asked = 0;
    CHECK(cav_optimiser_solve(o, 0, &last, &error) == CAV_OK && last.unactuated < 1e-6);
    CHECK(cav_optimiser_iterate(o, 2, NULL) == CAV_OK);
  }
  cav_optimiser_free(o);
}

int main(void) {
  char folder[] = "/tmp/cavort-optimiser-XXXXXX", command[300];
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  cav_problem *p = load(folder);
  if (p) {
    test_solves(p);
    test_shifts(p);
    test_stopped(p);
    cav_problem_free(p);
  }
  snprintf(command, sizeof command, "rm -rf %s", folder);
  CHECK(system(command) == 0);
  return check_result();
}
