/// What the first stage of a solve begins with: the guess, or where that meets its targets by inverse kinematics over
/// all knots. Truth from outside: a body that has to pass a point at half time and costs nothing but its acceleration
/// goes along the clamped cubic spline, y = d (3 s^2 - 2 s^3) with s = 2 t / T up to there, whatever force that takes.
/// And a gripper whose guess leaves the box to itself: hopeless from there, and not from where the fingers are at its
/// sides.
#include <math.h>
#include <string.h>

#include "cavort/cavort.h"
#include "problem_folder.h"

#define DURATION "1"
static const double duration = 1, aside = 0.5;

static const char ball[] =
    "<mujoco model='ball'><worldbody><body name='ball' pos='0 0 3'><freejoint name='ball'/>"
    "<geom type='sphere' size='.1' mass='2'/></body></worldbody></mujoco>";
static const char pass[] =
    "<problem name='pass' model='ball.xml'><horizon duration='" DURATION
    "' timestep='%s'/><start/>"
    "<goal><root joint='ball' pos='0 0 3'/></goal><cost>"
    "<effort weight='0'/><velocity weight='0'/><posture weight='0'/><gap weight='0'/><slip weight='0'/>"
    "<impact weight='0'/><self_penetration weight='0'/><velocity name='root turning' dofs='root_angular' weight='0'/>"
    "<acceleration name='root acceleration' dofs='root_linear' weight='0'/>"
    "<acceleration name='acceleration' dofs='all' weight='1'/>"
    "<sensor name='pass' type='framepos' body='ball' target='0 .5 3' at='.5' weight='1e7'/>"
    "<posture name='back' dofs='all' at='end' weight='1e7'/><velocity name='rest' dofs='all' at='end' weight='1e7'/>"
    "</cost><schedule %s/></problem>";

/// Ends a solve before the phase with this name.
static int before(void *phase, const cav_progress *line) { return !strcmp(line->phase, phase); }

/// A problem file's solve up to a phase; NULL where it says something else than that it was stopped.
static cav_solution *solve_up_to(const char *file, const char *phase, cav_problem **problem) {
  cav_error error = {0};
  cav_solution *s = NULL;
  *problem = cav_problem_load(file, NULL, &error);
  if (!CHECK(*problem != NULL)) return fprintf(stderr, "    %s\n", error.text), NULL;
  cav_solve_options options = cav_solve_options_default();
  options.observer = before;
  options.observer_context = (void *)phase;
  CHECK(cav_solve(*problem, &options, NULL, &s, &error) == CAV_INTERRUPTED);
  return s;
}

/// How far a body that passes a point is from the spline at most, m.
static double off_spline(const cav_trajectory *at) {
  double most = 0;
  for (int t = 0; t < at->nknot; t++) {
    double s = 2 * t * at->timestep / duration;
    if (s > 1) s = 2 - s;
    most = fmax(most, fabs(at->q[t * at->nq + 1] - aside * s * s * (3 - 2 * s)));
  }
  return most;
}

/// How far the ball is from the spline by kinematics, with a step.
static double by_kinematics(const char *timestep) {
  char text[2000];
  double off = NAN;
  cav_problem *problem;
  snprintf(text, sizeof text, pass, timestep, "kinematics='true'");
  write_in("problem.xml", text);
  cav_solution *s = solve_up_to(path, "continuation", &problem);
  if (CHECK(s != NULL && s->nstage > 0)) {
    off = off_spline(s->trajectory);
    printf("by kinematics at %s s: %d iterations, %.2g m off the spline\n", timestep, s->stage[0].iterations, off);
    CHECK(!strcmp(s->stage[0].phase, "kinematics") && s->stage[0].outcome == CAV_OUTCOME_SETTLED);
  }
  cav_solution_free(s);
  cav_problem_free(problem);
  return off;
}

static void test_spline(void) {
  char text[2000];
  cav_problem *problem;
  write_in("ball.xml", ball);
  // velocities are differences over a step
  double coarse = by_kinematics(".02"), fine = by_kinematics(".01");
  CHECK(fine < 0.02 * aside && coarse > 1.8 * fine && coarse < 2.2 * fine);
  // as stated it is simulated, since no actuator moves it: there is no such phase, and nothing takes the ball aside
  snprintf(text, sizeof text, pass, ".01", "");
  write_in("problem.xml", text);
  cav_solution *s = solve_up_to(path, "sqp", &problem);
  if (CHECK(s != NULL && (s->nstage == 0 || !strcmp(s->stage[0].phase, "sqp"))))
    CHECK(off_spline(s->trajectory) > 0.1 * aside);
  cav_solution_free(s);
  cav_problem_free(problem);
}

/// Stages of a phase after which another begins, and the unactuated force that the last one of them left.
static int count(const cav_solution *s, int from, const char *phase, double *unactuated) {
  int n = 0;
  for (; from + n < s->nstage && !strcmp(s->stage[from + n].phase, phase); n++)
    *unactuated = s->stage[from + n].unactuated;
  return n;
}

static void test_hopeless(void) {
  cav_problem *problem;
  cav_solution *s = solve_up_to(CAVORT_SOURCE_ROOT "/tests/grip/pick.xml", "sqp", &problem);
  if (CHECK(s != NULL)) {
    double guessed = NAN, reached = NAN, targets = NAN;
    int first = count(s, 0, "continuation", &guessed), again = count(s, first, "kinematics", &targets);
    int rest = count(s, first + again, "continuation", &reached);
    printf("picked up: unactuated force %.2g of the weight from the guess, %.2g by kinematics\n", guessed, reached);
    CHECK(first > 0 && again == 1 && rest > 0);
    CHECK(guessed > 2 && reached < 0.05);
    CHECK(first + again + rest <= s->nstage && s->stage[first + again + rest - 1].fraction == 1);
  }
  cav_solution_free(s);
  // a file that says so begins there
  cav_solve_options options = cav_solve_options_default();
  options.observer = before, options.observer_context = "sqp";
  cav_error error = {0};
  problem->schedule.kinematics = 1;
  s = NULL;
  CHECK(cav_solve(problem, &options, NULL, &s, &error) == CAV_INTERRUPTED);
  if (CHECK(s != NULL && s->nstage > 1)) {
    CHECK(!strcmp(s->stage[0].phase, "kinematics") && !strcmp(s->stage[1].phase, "continuation"));
    CHECK(s->stage[s->nstage - 1].unactuated < 0.05);
  }
  cav_solution_free(s);
  cav_problem_free(problem);
}

/// Keeps the last checkpoint of each beginning, as files.
static int keep(void *count, const cav_checkpoint *c) {
  char file[160];
  cav_error error = {0};
  if (c->place != CAV_PLACE_CONTINUATION) return 0;
  snprintf(file, sizeof file, "%s/begin-%d.csv", folder, (int)c->begin);
  CHECK(cav_checkpoint_write(file, c, &error) == CAV_OK);
  ((int *)count)[c->begin]++;
  return 0;
}

// stopped in either pass of the stages, the solve goes on to the same bits
static void test_resumed(void) {
  cav_error error = {0};
  int kept[CAV_BEGIN_KINEMATICS + 1] = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/grip/pick.xml", NULL, &error);
  if (!CHECK(problem != NULL)) return;
  cav_solve_options options = cav_solve_options_default();
  options.observer = before, options.observer_context = "sqp";
  options.keeper = keep, options.keeper_context = kept;
  cav_solution *whole = NULL;
  CHECK(cav_solve(problem, &options, NULL, &whole, &error) == CAV_INTERRUPTED);
  CHECK(kept[CAV_BEGIN_GIVEN] == 0 && kept[CAV_BEGIN_GUESS] > 0 && kept[CAV_BEGIN_KINEMATICS] > 0);
  options.keeper = NULL;
  for (int k = CAV_BEGIN_GUESS; k <= CAV_BEGIN_KINEMATICS && whole; k++) {
    char file[160];
    cav_solution *rest = NULL;
    snprintf(file, sizeof file, "%s/begin-%d.csv", folder, k);
    cav_checkpoint *from = cav_checkpoint_read(file, problem->model, &error);
    options.resume = from;
    CHECK(from && from->begin == (cav_begin)k);
    CHECK(cav_solve(problem, &options, NULL, &rest, &error) == CAV_INTERRUPTED);
    if (CHECK(rest != NULL)) {
      const cav_trajectory *a = whole->trajectory, *b = rest->trajectory;
      CHECK(rest->iterations == whole->iterations && a->nknot == b->nknot);
      CHECK(!memcmp(a->q, b->q, (size_t)a->nknot * (size_t)a->nq * sizeof(double)));
    }
    cav_solution_free(rest);
    cav_checkpoint_free(from);
  }
  cav_solution_free(whole);
  cav_problem_free(problem);
}

int main(void) {
  begin_folder();
  test_spline();
  test_hopeless();
  if (check_every(2) == 1) test_resumed();
  return check_result();
}
