/// optim/solver/sampling.c: guesses by sampling are offered to small models alone; what is found obeys the dynamics of the last
/// stage with efforts within those planned with, moves a puck that no actuator moves to where it is asked for, is the same for
/// any number of threads, and ends when it is asked to; a solve from it has its rows in and costs no more.
#include <unistd.h>

#include "check.h"
#include "continuation.h"
#include "sampling.h"
#include "scene.h"

static char folder[] = "/tmp/cavort-sampling-XXXXXX";

/// A bat on a hinge, and a puck on a rail in front of it, which only the bat can move.
static const char bat[] =
    "<mujoco><option timestep='.005'/><worldbody><body name='bat' pos='0 0 .5'><joint name='swing' axis='0 1 0' "
    "range='-90 90' limited='true' damping='.05'/><geom type='capsule' size='.02' fromto='0 0 0 0 0 -.4' "
    "mass='.5'/></body>"
    "<body name='puck' pos='.2 0 .15'><joint name='rail' type='slide' axis='1 0 0' frictionloss='.4'/><geom "
    "type='sphere' "
    "size='.04' "
    "mass='.2'/></body></worldbody><actuator><motor joint='swing' gear='6' ctrllimited='true' ctrlrange='-1 "
    "1'/></actuator>"
    "</mujoco>";

static const char wish[] =
    "<problem name='bat' model='model.xml'><horizon duration='%s' timestep='.025'%s/><start/><cost><sensor "
    "name='there' "
    "type='jointpos' joint='rail' target='.2' at='end' weight='2000'/></cost></problem>";

/// A problem of so long; NULL with a failed check.
static cav_problem *problem_of(const char *model, const char *duration, const char *more) {
  char path[160], text[1000];
  cav_error error = {0};
  scene_write(folder, "model.xml", model);
  snprintf(text, sizeof text, wish, duration, more);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  return p;
}

static cav_trajectory *room(const cav_problem *p) {
  return cav_trajectory_new(p->model, (int)lround(p->duration / p->timestep) + 1, p->timestep);
}

/// Whether it is among the strategies; *taken is it then, which has no terms of its own.
static int is_offered(const cav_problem *p, cav_strategy *taken) {
  cav_strategy strategy[CAV_STRATEGIES];
  int n = 0, found = 0;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  for (int i = 0; i < n; i++)
    if (!strcmp(strategy[i].name, "sample")) *taken = strategy[i], found = 1;
  cav_strategies_clear(strategy, n);
  return found;
}

// not to what has more dofs than sampling finds anything for, nor where nothing drives
static void test_offered(void) {
  char many[3000] = "<mujoco><worldbody>";
  cav_strategy taken;
  for (int i = 0; i < 10; i++)
    snprintf(many + strlen(many), sizeof many - strlen(many),
             "<body pos='%d 0 0'><joint name='%s' type='slide' axis='1 0 0'/><geom size='.1'/></body>", i,
             i ? (char[]){(char)('a' + i), 0} : "rail");
  snprintf(many + strlen(many), sizeof many - strlen(many),
           "</worldbody><actuator><motor joint='rail' ctrllimited='true' ctrlrange='-9 9'/></actuator></mujoco>");
  char still[sizeof bat];
  memcpy(still, bat, sizeof bat);
  char *const actuator = strstr(still, "<actuator>");
  if (!CHECK(actuator != NULL)) return;
  memcpy(actuator, "</mujoco>", sizeof "</mujoco>");
  const char *const model[] = {bat, many, still};
  for (int i = 0; i < 3; i++) {
    cav_problem *p = problem_of(model[i], "1", "");
    if (p) CHECK(is_offered(p, &taken) == (i == 0) && cav_sample_serves(p) == (i == 0));
    cav_problem_free(p);
  }
}

/// Forces at the knots of a motion: none but the motor's, within what is planned with.
static void check_forces(const cav_problem *p, const cav_trajectory *at) {
  cav_state *state = cav_state_new(p->model);
  double u[2], most = 0, nowhere = 0;
  if (!CHECK(state != NULL)) return;
  state->options = cav_last_law(p);
  for (int t = 0; t + 1 < at->nknot; t++) {
    CHECK(cav_inverse(p->model, state, at->q + 2 * t, at->v + 2 * t, at->v + 2 * (t + 1), u) == CAV_OK);
    most = fmax(most, fabs(u[0]));
    nowhere = fmax(nowhere, fabs(u[1]));
  }
  CHECK(most <= 0.8 * 6 * (1 + 1e-6) && most > 0.1);
  CHECK(nowhere < 1e-5);
  cav_state_free(state);
}

static cav_status fill(const cav_problem *p, const cav_solve_options *options, int number, cav_trajectory *at,
                       double *score) {
  cav_error error = {0};
  return cav_sample_fill(p, options, number, at, score, &error);
}

/// A solve by the strategy, which begins with a motion of that score.
static void test_solve(const cav_problem *p, double score) {
  const cav_solve_options options = cav_solve_options_default();
  cav_strategy offered;
  cav_solution *solution = NULL;
  if (!CHECK(is_offered(p, &offered) && offered.samples == 1)) return;
  CHECK(cav_strategy_solve(p, &offered, &options, NULL, &solution, NULL) == CAV_OK);
  if (CHECK(solution != NULL)) {
    const cav_trajectory *end = solution->trajectory;
    CHECK(solution->unactuated < 1e-6 && solution->cost <= score);
    CHECK_NEAR(end->q[2 * (end->nknot - 1) + 1], 0.2, 0.02);
  }
  cav_solution_free(solution);
}

static void test_motion(void) {
  cav_problem *p = problem_of(bat, "0.6", " close='open'");
  cav_trajectory *one = p ? room(p) : NULL, *two = p ? room(p) : NULL, *other = p ? room(p) : NULL;
  cav_solve_options options = cav_solve_options_default();
  double score[3] = {0};
  if (!CHECK(one && two && other)) return;
  const size_t bytes = (size_t)one->nknot * 2 * sizeof *one->q;
  options.threads = 1;
  CHECK(fill(p, &options, 1, one, &score[0]) == CAV_OK);
  check_forces(p, one);
  // from nothing, which costs half of 2000 times 0.2 m squared
  CHECK(score[0] < 0.1 * 40 && fabs(one->q[2 * (one->nknot - 1) + 1] - 0.2) < 0.05);
  test_solve(p, score[0]);
  options.threads = 2;
  CHECK(fill(p, &options, 1, two, &score[1]) == CAV_OK);
  CHECK(!memcmp(one->q, two->q, bytes) && !memcmp(one->v, two->v, bytes) && score[0] == score[1]);
  CHECK(fill(p, &options, 2, other, &score[2]) == CAV_OK);
  CHECK(memcmp(one->q, other->q, bytes) != 0);
  cav_trajectory_free(one);
  cav_trajectory_free(two);
  cav_trajectory_free(other);
  cav_problem_free(p);
}

static int asked;
static int stop(void *context) {
  const int *after = context;
  return asked++ >= *after;
}

// at once there is no motion; later there is one
static void test_end(void) {
  cav_problem *p = problem_of(bat, "0.6", " close='open'");
  cav_trajectory *at = p ? room(p) : NULL;
  cav_solve_options options = cav_solve_options_default();
  double score;
  if (!CHECK(at != NULL)) return;
  const int after[] = {0, 100};
  options.threads = 1;
  options.stop = stop;
  for (int i = 0; i < 2; i++) {
    asked = 0;
    options.stop_context = (void *)&after[i];
    CHECK(fill(p, &options, 1, at, &score) == (i == 0 ? CAV_INTERRUPTED : CAV_OK));
    CHECK(asked <= after[i] + 60 && isfinite(score) == (i == 1));
  }
  options.stop = NULL;
  options.max_seconds = 1e-3;
  CHECK(fill(p, &options, 1, at, &score) == CAV_INTERRUPTED);
  cav_trajectory_free(at);
  cav_problem_free(p);
}

int main(void) {
  if (!mkdtemp(folder)) return EXIT_FAILURE;
  test_offered();
  test_motion();
  test_end();
  scene_remove(folder);
  return check_result();
}
