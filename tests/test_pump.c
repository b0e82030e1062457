/// optim/solver/pump.c: swing-ups are offered where they are needed and nowhere else; the guess obeys the dynamics with
/// efforts within their limits; times keep their proportion under a change of units, and are not below what energy
/// allows; four kinds of chain are swung up by a solve from the guess, certified.
#include <unistd.h>

#include "check.h"
#include "continuation.h"
#include "scene.h"

static char folder[] = "/tmp/cavort-pump-XXXXXX";

#define ROD(NAME, AXIS, LENGTH, MASS, INSIDE)                                                         \
  "<joint name='" NAME "' axis='" AXIS "' damping='.05'/><geom type='capsule' size='.05' mass='" MASS \
  "' fromto='0 0 0 0 0 " LENGTH "' contype='0' conaffinity='0'/>" INSIDE
#define BODY(POS, INSIDE) "<body pos='" POS "'>" INSIDE "</body>"
#define MOTOR(JOINT, LIMIT) "<motor joint='" JOINT "' gear='" LIMIT "' ctrllimited='true' ctrlrange='-1 1'/>"
#define MODEL(WORLD, MOTORS) "<mujoco><worldbody>" WORLD "</worldbody><actuator>" MOTORS "</actuator></mujoco>"
#define CHAIN(MOTORS) \
  MODEL(BODY("0 0 2", ROD("swing", "0 1 0", "1", "1", BODY("0 0 1", ROD("elbow", "0 1 0", "1", "1", "")))), MOTORS)
#define CART(RANGE, FORCE)                                                                               \
  MODEL(BODY("0 0 1", "<joint name='slide' type='slide' axis='1 0 0' limited='true' range='" RANGE       \
                      "'/><geom type='box' size='.1 .1 .1' mass='1' contype='0' conaffinity='0'/>" BODY( \
                          "0 0 0", ROD("swing", "0 1 0", "1", ".3", ""))),                               \
        MOTOR("slide", FORCE))
#define PENDULUM(TORQUE, OPTION)                                                                     \
  "<mujoco>" OPTION                                                                                  \
  "<worldbody><body name='rod' pos='0 0 2'><joint name='swing' axis='0 1 0'/><inertial pos='0 0 1' " \
  "mass='1' diaginertia='.01 .01 .01'/></body></worldbody><actuator>" MOTOR("swing", TORQUE) "</actuator></mujoco>"

/// A problem of so long from hanging to upright; NULL with a failed check.
static cav_problem *problem_of(const char *model, double duration, double step, const char *more) {
  char path[160], text[1000];
  cav_error error = {0};
  scene_write(folder, "model.xml", model);
  snprintf(
      text, sizeof text,
      "<problem name='up' model='model.xml'><horizon duration='%.17g' timestep='%.17g'/><start><joint name='swing' "
      "degrees='180'/></start><goal><joint name='swing' degrees='0'/></goal>%s<cost><posture dofs='all' at='end' "
      "weight='900'/></cost></problem>",
      duration, step, more);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  return p;
}

static int is_offered(const cav_problem *p, cav_strategy *taken) {
  cav_strategy strategy[CAV_STRATEGIES];
  int n = 0, found = 0;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  for (int i = 0; i < n; i++)
    if (!strcmp(strategy[i].name, "pump")) *taken = strategy[i], found = 1;
  return found;
}

// where the model needs it: not where actuators are strong, nothing rises, the goal cannot stand, something touches, or a
// spring holds energy of its own
static void test_offered(void) {
  static const struct {
    const char *name, *model, *more;
    int offered;
  } cases[] = {
      {"weak pendulum", PENDULUM("3", ""), "", 1},
      {"strong pendulum", PENDULUM("13", ""), "", 0},
      {"acrobot", CHAIN(MOTOR("elbow", "2")), "", 1},
      {"cart", CART("-1 1", "9"), "", 1},
      {"goal to the side", PENDULUM("3", ""), "", 0},
      {"no gravity", PENDULUM("3", "<option gravity='0 0 0'/>"), "", 0},
      {"no actuator", MODEL(BODY("0 0 2", ROD("swing", "0 1 0", "1", "1", "")), ""), "", 0},
      {"spring",
       MODEL(
           BODY("0 0 2", "<joint name='swing' axis='0 1 0' stiffness='1'/><geom type='sphere' size='.1' pos='0 0 1'/>"),
           MOTOR("swing", "3")),
       "", 0},
      {"nothing can touch",
       "<mujoco><option><flag constraint='disable'/></option><worldbody><geom type='plane' size='1 1 1' pos='0 0 "
       "1'/><body pos='0 0 2'><joint name='swing' axis='0 1 0'/><geom type='capsule' size='.05' fromto='0 0 0 0 0 1' "
       "mass='1'/></body></worldbody><actuator>" MOTOR("swing", "3") "</actuator></mujoco>",
       "", 1},
      {"something touches",
       MODEL("<geom type='box' size='.2 .2 .2' pos='0 0 .795'/>" BODY(
                 "0 0 2", "<joint name='swing' axis='0 1 0'/><geom type='sphere' size='.1' pos='0 0 .9'/>"),
             MOTOR("swing", "3")),
       "", 0}};
  cav_strategy taken;
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    cav_problem *p = problem_of(cases[i].model, 2, 0.05, "");
    if (!p) continue;
    if (!strcmp(cases[i].name, "goal to the side")) p->q_goal[0] = 1.5;
    int offered = is_offered(p, &taken);
    CHECK(offered == cases[i].offered);
    if (offered != cases[i].offered) fprintf(stderr, "    %s\n", cases[i].name);
    cav_problem_free(p);
  }
}

// forces at the knots by inverse dynamics: none without an actuator, none beyond the planned limit; it waits, ends near
static void test_guess(const char *model, double duration, int actuated, double limit) {
  cav_problem *p = problem_of(model, duration, 0.025, "<guess type='pump'/>");
  if (!p) return;
  cav_trajectory *at = cav_problem_guess(p, NULL);
  cav_state *state = cav_state_new(p->model);
  if (!CHECK(at && state)) return;
  state->options.timestep = p->timestep;
  state->options.order = p->order;
  int nv = p->model->nv;
  double u[4], missing = 0, most = 0, start[4], off[4], far = 0;
  for (int t = 0; t + 1 < at->nknot; t++) {
    CHECK(cav_inverse(p->model, state, at->q + t * at->nq, at->v + t * nv, at->v + (t + 1) * nv, u) == CAV_OK);
    for (int d = 0; d < nv; d++) {
      if (d != actuated) missing = fmax(missing, fabs(u[d]));
      if (d == actuated) most = fmax(most, fabs(u[d]));
    }
  }
  cav_difference(p->model, p->q_start, at->q, 1, start);
  cav_difference(p->model, p->q_goal, at->q + (size_t)(at->nknot - 1) * at->nq, 1, off);
  for (int d = 0; d < nv; d++) CHECK(start[d] == 0), far = fmax(far, fabs(off[d]));
  printf("guess: %.1e N m without an actuator, %.3f of the limit, ends %.2f from the goal\n", missing, most / limit,
         far);
  // 1e-12 relative of a forward step, differences of q over h
  CHECK(missing < 1e-7);
  CHECK(most < 0.8 * limit + 1e-7 && most > 0.79 * limit);
  CHECK(far < 0.8);
  cav_state_free(state);
  cav_trajectory_free(at);
  cav_problem_free(p);
}

// four times the gravity and torque in half the step: the same motion twice as fast. A frictionless pendulum needs
// energy 2 m g l from torque u over at least 2 m g l/u rad of way; at the speed of the full energy, the least time
static void test_times(void) {
  cav_pumping slow, fast, given;
  cav_problem *p = problem_of(PENDULUM("3", ""), 2, 0.02, ""),
              *q = problem_of(PENDULUM("12", "<option gravity='0 0 -39.24'/>"), 1, 0.01, ""),
              *r = problem_of(PENDULUM("3", ""), 8, 0.02, "");
  if (!p || !q || !r) return;
  CHECK(cav_problem_pumping(p, &slow) == CAV_OK && cav_problem_pumping(q, &fast) == CAV_OK);
  CHECK(cav_problem_pumping(r, &given) == CAV_OK);
  CHECK(slow.needed && fast.needed && given.needed);
  double way = 2 * 9.81 / (0.8 * 3), least = way / sqrt(2 * 2 * 9.81 / 1.01);
  printf("pumping takes %.3f s, four times as strong %.3f s, at least %.3f s; %.3g and %.3g times the effort\n",
         slow.seconds, fast.seconds, least, slow.efforts, fast.efforts);
  CHECK_NEAR(fast.seconds, slow.seconds / 2, 0.02 * slow.seconds);
  CHECK(slow.seconds > least && slow.seconds < 4 * least);
  CHECK(slow.efforts > 1 && fast.efforts == slow.efforts && given.efforts == 1);
  cav_problem_free(p), cav_problem_free(q), cav_problem_free(r);
}

// from the guess to a certificate
static void test_solved(const char *name, const char *model, double duration, const char *more) {
  cav_problem *p = problem_of(model, duration, 0.025, more), taken;
  cav_strategy pump;
  cav_solution *s = NULL;
  cav_verdict v = {0};
  cav_error error = {0};
  if (!p) return;
  if (CHECK(is_offered(p, &pump))) {
    cav_strategy_apply(p, &pump, &taken);
    CHECK(cav_strategy_solve(p, &pump, NULL, NULL, &s, &error) == CAV_OK);
    if (s) CHECK(!cav_verify(&taken, s->trajectory, &s->contact, s->gain_q, s->gain_v, &v, &error));
    printf("%s: %d iterations, cost %.4g, %s%s%s\n", name, s ? s->iterations : 0, v.cost,
           v.certified ? "certified" : v.reason, v.achieved ? "" : ", misses ", v.missed);
    CHECK(v.certified && v.achieved);
  }
  cav_solution_free(s);
  cav_problem_free(p);
}

// what is exact from both sides: at full effort a motion of a fifteenth of a second more than the least time is found, and
// one of as much less proven impossible
static void test_least_time(void) {
  static const double limits = 0.05, step = 0.025;
  cav_impossibility found;
  cav_pumping pumping;
  cav_error error = {0};
  int n = 0;
  cav_problem *p = problem_of(PENDULUM("3", ""), 5, step, "<limits effort='1'/>");
  if (!p) return;
  CHECK(cav_problem_pumping(p, &pumping) == CAV_OK && pumping.exact);
  cav_problem_free(p);
  double least = pumping.seconds, less = step * floor((least - limits) / step - 1);
  printf("at full effort in %.3f s at least\n", least);
  p = problem_of(PENDULUM("3", ""), less, step, "<limits effort='1'/>");
  if (!p) return;
  CHECK(cav_problem_impossible(p, &found, 1, &n, &error) == CAV_OK && n == 1);
  if (n) CHECK(strstr(found.what, "exact for one hinge") != NULL), printf("%.3f s: %s\n", less, found.what);
  cav_problem_free(p);
  test_solved("pendulum in its least time", PENDULUM("3", ""), step * ceil((least + limits) / step),
              "<limits effort='1'/>");
}

// as written and read again, and what contradicts it
static void test_file(void) {
  char path[160];
  cav_error error = {0};
  cav_problem *p = problem_of(PENDULUM("3", ""), 2, 0.05, "<guess type='pump'/>");
  if (!p) return;
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  CHECK(p->guess == CAV_GUESS_PUMP && cav_problem_write(path, p, NULL, &error) == CAV_OK);
  cav_problem *again = cav_problem_load(path, NULL, &error);
  CHECK(again && again->guess == CAV_GUESS_PUMP);
  cav_problem_free(p), cav_problem_free(again);
  scene_write(
      folder, "problem.xml",
      "<problem model='model.xml'>\n<horizon duration='1'/>\n<start/>\n<guess type='pump'>\n<waypoint time='.5'/>"
      "</guess></problem>");
  CHECK(!cav_problem_load(path, NULL, &error));
  CHECK(error.line == 5 && strstr(error.text, "contradicts type='pump'"));
}

int main(void) {
  if (!mkdtemp(folder)) return EXIT_FAILURE;
  test_offered();
  test_file();
  test_guess(PENDULUM("3", ""), 8, 0, 3);
  test_guess(CHAIN(MOTOR("elbow", "2")), 8, 1, 2);
  test_times();
  test_least_time();
  test_solved("pendulum", PENDULUM("3", ""), 5, "");
  test_solved("acrobot", CHAIN(MOTOR("elbow", "2")), 8, "");
  test_solved("pendubot", CHAIN(MOTOR("swing", "6")), 6, "");
  test_solved("cart", CART("-1 1", "9"), 5, "");
  scene_remove(folder);
  return check_result();
}
