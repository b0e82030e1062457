/// Parameters of a model estimated with a motion. A known simulation at a millisecond, under the contacts of the model's file,
/// recorded with noise: the masses of two links and the friction of a sled are found within 2 %, from guesses a third off;
/// simulated by the steps that the estimate takes, within what their standard errors say, at the cost that noise has. Of two
/// bodies on one link the sum is found and the difference told to be unseen. Each number of a model set as if its file had it.
#include "cavort/cavort.h"
#include "scene.h"
#include "schedule.h"
#include "storage.h"

// ---------------------------------------------------------------- a sled with an arm

#define SLED(UPPER, LOWER, FRICTION)                                                                                   \
  "<mujoco model='sled'><option timestep='.001'/><worldbody><geom name='floor' type='plane' size='9 9 1' "             \
  "friction='" FRICTION                                                                                                \
  "'/><body name='sled' pos='0 0 .1'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 " \
  "0 "                                                                                                                 \
  "1'/><geom name='runner' type='box' size='.4 .2 .1' mass='6' friction='.05'/>"                                       \
  "<body name='upper' pos='0 0 .2'><joint name='shoulder' axis='0 1 0' damping='.1'/><geom type='capsule' size='.04' " \
  "fromto='0 0 0 0 0 .4' mass='" UPPER                                                                                 \
  "' contype='0' conaffinity='0'/><body name='lower' pos='0 0 .4'><joint name='elbow' axis='0 1 0' damping='.1'/>"     \
  "<geom type='capsule' size='.03' fromto='0 0 0 .3 0 0' mass='" LOWER                                                 \
  "' contype='0' conaffinity='0'/></body></body>"                                                                      \
  "</body></worldbody><actuator><motor name='push' joint='x'/><motor name='lift' joint='shoulder'/>"                   \
  "<motor name='bend' joint='elbow'/></actuator></mujoco>"

enum { STEPS = 100, EVERY = 10, DOFS = 4, MOTORS = 3 };
static const double step = 0.01;

/// What was recorded: positions and efforts at the knots, with noise of these deviations.
typedef struct record {
  double time[STEPS + 1], q[(STEPS + 1) * DOFS], effort[MOTORS][STEPS + 1];
} record;
static const double of_position = 5e-4, of_effort = 0.05;

static double normal(void) {
  double x[2] = {0};
  scene_normals(x, 1, 1);
  return x[0];
}

/// Simulated under controls that shake all joints, the sled sliding to and fro; own 1: by the steps of the estimate.
static void simulate(record *r, int own) {
  cav_model *m = scene_load(SLED("2.5", "1.4", ".45"));
  cav_problem p = cav_problem_default(m);
  cav_state *state = cav_state_new(m);
  double q[DOFS], v[DOFS] = {0.8, 0, 0, 0}, next[DOFS], u[DOFS], h = own ? step : 0.001;
  int every = own ? 1 : EVERY;
  memcpy(q, m->q0, sizeof q);
  state->options.order = own ? p.order : CAV_ORDER_EULER;
  if (own) cav_stage_law(&p, 1, step, &state->options);
  state->options.timestep = h;
  for (int i = 0; i <= STEPS * every; i++) {
    double t = i * h;
    int k = i / every, knot = i % every == 0;
    u[0] = 70 * sin(5 * t + 1), u[1] = 0;
    u[2] = 8 * sin(6 * t) - 20 * q[2], u[3] = 2 * cos(7 * t) - 6 * q[3];
    // velocities belong to steps, so a force at a knot is that of the moment
    if (knot) r->time[k] = t;
    for (int d = 0; d < DOFS && knot; d++) r->q[k * DOFS + d] = q[d] + of_position * normal();
    for (int a = 0; a < MOTORS && knot; a++) r->effort[a][k] = u[a == 0 ? 0 : a + 1] + of_effort * normal();
    if (i == STEPS * every) break;
    CHECK(cav_forward(m, state, q, v, u, next) == CAV_OK);
    cav_integrate(m, q, next, h, q);
    memcpy(v, next, sizeof v);
  }
  cav_state_free(state);
  cav_model_free(m);
}

static void follow(bench *b, const record *r) {
  b->problem = cav_problem_default(b->model);
  b->problem.duration = STEPS * step;
  b->problem.timestep = step;
  b->problem.close_at_rest = 0;
  b->problem.free_start = 1;
  memcpy(b->q_start, r->q, DOFS * sizeof(double));
  b->problem.q_start = b->problem.q_goal = b->q_start, b->problem.v_start = b->v_start, b->problem.term = b->term;
  cav_term *term = add(b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 1 / (of_position * of_position * step)));
  term->target = r->q, term->nwaypoint = STEPS + 1, term->waypoint_time = r->time;
  for (int a = 0; a < MOTORS; a++) {
    term = add(b, cav_term_cost(CAV_QUANTITY_SENSOR, 1 / (of_effort * of_effort * step)));
    term->sensor = (cav_sensor){
        .name = "", .type = CAV_SENSOR_ACTUATORFRC, .object_type = CAV_OBJECT_ACTUATOR, .object = a, .dim = 1};
    term->target = r->effort[a], term->nwaypoint = STEPS + 1, term->waypoint_time = r->time;
  }
}

static void test_sled(int own) {
  static record r;
  const double truth[3] = {2.5, 1.4, 0.45};
  bench b = {.model = scene_load(SLED("3.3", "1", ".3"))};
  cav_error error = {0};
  cav_estimate *e = NULL;
  if (!CHECK(b.model != NULL)) return;
  simulate(&r, own);
  follow(&b, &r);
  const cav_parameter parameter[3] = {
      {.kind = CAV_PARAMETER_MASS, .object = cav_object_find(b.model, CAV_OBJECT_BODY, "upper")},
      {.kind = CAV_PARAMETER_MASS, .object = cav_object_find(b.model, CAV_OBJECT_BODY, "lower")},
      {.kind = CAV_PARAMETER_FRICTION, .object = cav_object_find(b.model, CAV_OBJECT_GEOM, "runner")}};
  b.problem.nparameter = 3, b.problem.parameter = parameter;
  cav_status status = cav_estimate_solve(&b.problem, NULL, NULL, &e, &error);
  if (!CHECK(status == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  for (int k = 0; e && k < 3; k++) {
    printf("sled: %.4f +- %.4f, is %.4f (%.2f %%)\n", e->value[k], e->error[k], truth[k],
           100 * (e->value[k] / truth[k] - 1));
    CHECK(fabs(e->value[k] / truth[k] - 1) < 0.02);
    CHECK(cav_model_parameter(e->model, &parameter[k]) == e->value[k]);
    if (own) CHECK(fabs(e->value[k] - truth[k]) < 4 * e->error[k]);
  }
  // half a square for each number seen beyond those found: 704 of positions and efforts, less 308 of the motion and 3;
  // its deviation is 14
  if (e)
    printf("cost %.0f, %d steps, seen %.3g %.3g %.3g\n", e->solution->cost, e->iterations, e->seen[0], e->seen[1],
           e->seen[2]);
  if (e && own) CHECK_NEAR(e->solution->cost, 0.5 * (704 - 311), 4 * 14);
  cav_estimate_free(e);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- what is not seen

/// Two bodies on one slide, pushed by a known force: only their sum moves it.
static void test_unseen(void) {
  static const char text[] =
      "<mujoco model='pair'><option gravity='0 0 0'/><worldbody><body name='one'><joint name='x' type='slide' axis='1 "
      "0 "
      "0'/><geom size='.1' mass='2'/><body name='two' pos='0 0 .3'><geom size='.1' mass='1'/></body></body></worldbody>"
      "<actuator><motor name='push' joint='x'/></actuator></mujoco>";
  enum { N = 20 };
  const double push = 5, sum = 3.6;
  static double q[N + 1], time[N + 1];
  double v = 0.3;
  bench b = {.model = scene_load(text)};
  cav_error error = {0};
  cav_estimate *e = NULL;
  if (!CHECK(b.model != NULL)) return;
  for (int t = 0; t <= N; t++) {
    time[t] = t * step;
    if (t > 0) v += step * push / sum, q[t] = q[t - 1] + step * v;
  }
  b.problem = cav_problem_default(b.model);
  b.problem.duration = N * step, b.problem.timestep = step;
  b.problem.close_at_rest = 0, b.problem.free_start = 1;
  b.problem.q_start = b.problem.q_goal = b.q_start, b.problem.v_start = b.v_start, b.problem.term = b.term;
  cav_term *term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 1e12));
  term->target = q, term->nwaypoint = N + 1, term->waypoint_time = time;
  term = add(&b, cav_term_cost(CAV_QUANTITY_SENSOR, 1e8));
  term->sensor = (cav_sensor){.name = "", .type = CAV_SENSOR_ACTUATORFRC, .object_type = CAV_OBJECT_ACTUATOR, .dim = 1};
  term->target = &push;
  cav_parameter parameter[2] = {
      {.kind = CAV_PARAMETER_MASS, .object = cav_object_find(b.model, CAV_OBJECT_BODY, "one"), .prior = {2, 0.5}},
      {.kind = CAV_PARAMETER_MASS, .object = cav_object_find(b.model, CAV_OBJECT_BODY, "two"), .prior = {1, 0.5}}};
  b.problem.nparameter = 2, b.problem.parameter = parameter;
  if (!CHECK(cav_estimate_solve(&b.problem, NULL, NULL, &e, &error) == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  if (e) {
    printf("pair: %.6f + %.6f, seen %.3g and %.3g\n", e->value[0], e->value[1], e->seen[0], e->seen[1]);
    CHECK_NEAR(e->value[0] + e->value[1], sum, 1e-3);
    CHECK_NEAR(e->value[0] - e->value[1], 1, 1e-5);
    CHECK(e->seen[0] > 1e3 && e->seen[1] < 1e-4);
    CHECK_NEAR(fabs(e->combination[2] - e->combination[3]), sqrt(2), 1e-4);
    // of the difference the prior's deviation is left, of the sum next to nothing
    double C[3] = {e->covariance[0], e->covariance[1], e->covariance[3]};
    CHECK_NEAR(sqrt(C[0] + C[2] - 2 * C[1]), 0.5 * sqrt(2), 1e-4);
    CHECK(C[0] + C[2] + 2 * C[1] < 1e-3);
  }
  cav_estimate_free(e);
  // without a prior no number is given, and both are named
  parameter[0].prior[1] = parameter[1].prior[1] = 0;
  CHECK(cav_estimate_solve(&b.problem, NULL, NULL, &e, &error) == CAV_BAD_INPUT && !e);
  CHECK(strstr(error.text, "mass of one, mass of two") && strstr(error.text, "apart"));
  // nor is one that only other costs decide: of a force that was not recorded
  b.problem.nparameter = 1, b.problem.nterm = 1;
  add(&b, cav_term_cost(CAV_QUANTITY_EFFORT, 1));
  CHECK(cav_estimate_solve(&b.problem, NULL, NULL, &e, &error) == CAV_BAD_INPUT && !e);
  CHECK(strstr(error.text, "does not tell mass of one"));
  // nor is there a record in a wish
  b.term[0].weight = 0;
  CHECK(cav_estimate_solve(&b.problem, NULL, NULL, &e, &error) == CAV_BAD_INPUT && strstr(error.text, "<track"));
  b.term[0].weight = 1e12;
  parameter[0].object = 0;
  CHECK(cav_estimate_solve(&b.problem, NULL, NULL, &e, &error) == CAV_BAD_INPUT && !e);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- single numbers

#define BOTTLE(MASS, COM, INERTIA, CAP, FRICTION, SPRING)                                                             \
  "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1' friction='.2'/><body name='bottle' pos='0 0 .19' " \
  "euler='10 20 30'><freejoint/><inertial mass='" MASS "' pos='" COM "' diaginertia='" INERTIA                        \
  "'/><geom name='side' type='sphere' size='.2' friction='" FRICTION                                                  \
  "'/><body name='cap' pos='0 .1 .1' "                                                                                \
  "euler='40 0 0'><inertial mass='" CAP                                                                               \
  "' pos='0 0 .1' diaginertia='.01 .02 .03'/><geom type='sphere' size='.05'/>"                                        \
  "</body><body name='lid' pos='0 0 .3'><joint name='hinge' axis='1 0 0' " SPRING                                     \
  "/><geom size='.05' mass='.3' contype='0' conaffinity='0'/></body></body></worldbody></mujoco>"
#define SPRING "stiffness='2' damping='.3'"

/// A number set, against a file that has it: forces of the inverse dynamics at random, in contact.
static void test_number(const char *text, cav_parameter_kind kind, cav_object_type type, const char *name,
                        int component, double value) {
  cav_model *m = scene_load(BOTTLE("1.5", ".01 .02 .03", ".03 .02 .04", ".2", ".6", SPRING)), *file = scene_load(text);
  if (!CHECK(m && file)) return;
  const cav_parameter p = {.kind = kind, .object = cav_object_find(m, type, name), .component = component};
  CHECK(fabs(cav_model_parameter(m, &p) - value) > 1e-3);
  CHECK(cav_model_set_parameter(m, &p, value) == CAV_OK);
  CHECK_NEAR(cav_model_parameter(m, &p), value, 1e-15);
  CHECK(cav_model_set_parameter(m, &p, NAN) == CAV_BAD_INPUT);
  if (kind != CAV_PARAMETER_COM) CHECK(cav_model_set_parameter(m, &p, -1) == CAV_BAD_INPUT);
  double *v = scene_vector(3 * m->nv), *u = v + m->nv, *other = u + m->nv, worst = 0, most = 0;
  cav_state *a = cav_state_new(m), *b = cav_state_new(file);
  for (int i = 0; i < m->nv; i++) v[i] = scene_uniform();
  CHECK(cav_inverse(m, a, m->q0, v, v, u) == CAV_OK && cav_inverse(file, b, file->q0, v, v, other) == CAV_OK);
  for (int i = 0; i < m->nv; i++) worst = fmax(worst, fabs(u[i] - other[i])), most = fmax(most, fabs(u[i]));
  CHECK(a->ncontact > 0 && worst <= 1e-12 * most);
  CHECK_NEAR(m->mass, file->mass, 1e-15);
  free(v);
  cav_state_free(a), cav_state_free(b);
  cav_model_free(m), cav_model_free(file);
}

static void test_numbers(void) {
  test_number(BOTTLE("1.8", ".01 .02 .03", ".036 .024 .048", ".2", ".6", SPRING), CAV_PARAMETER_MASS, CAV_OBJECT_BODY,
              "bottle", 0, 1.8);
  test_number(BOTTLE("1.5", ".01 .08 .03", ".03 .02 .04", ".2", ".6", SPRING), CAV_PARAMETER_COM, CAV_OBJECT_BODY,
              "bottle", 1, 0.08);
  test_number(BOTTLE("1.5", ".01 .02 .03", ".045 .03 .06", ".2", ".6", SPRING), CAV_PARAMETER_INERTIA, CAV_OBJECT_BODY,
              "bottle", 0, 0.06);
  test_number(BOTTLE("1.5", ".01 .02 .03", ".03 .02 .04", ".2", ".9", SPRING), CAV_PARAMETER_FRICTION, CAV_OBJECT_GEOM,
              "side", 0, 0.9);
  test_number(BOTTLE("1.5", ".01 .02 .03", ".03 .02 .04", ".2", ".6", "stiffness='5' damping='.3'"),
              CAV_PARAMETER_STIFFNESS, CAV_OBJECT_JOINT, "hinge", 0, 5);
  test_number(BOTTLE("1.5", ".01 .02 .03", ".03 .02 .04", ".2", ".6", "stiffness='2' damping='.7'"),
              CAV_PARAMETER_DAMPING, CAV_OBJECT_JOINT, "hinge", 0, 0.7);
}

int main(void) {
  test_numbers();
  test_unseen();
  test_sled(1);
  test_sled(0);
  return check_result();
}
