/// Joints that no actuator works on rest in their stops as feet rest on the floor: a lid by hand, to the torque that the law
/// gives there, and the finger of a gripper, whose coupler a spring holds in its stop, solved. Stops of joints with
/// actuators are ranges. Links of a closed linkage touch as those of one tree do.
#include "sample.h"

#define LID(ACTUATOR)                                                                              \
  "<mujoco><compiler angle='radian'/><option timestep='0.02'/><worldbody><body name='lid'>"        \
  "<joint name='lid' type='hinge' axis='0 1 0' limited='true' range='-1.5 0.2'/>"                  \
  "<geom type='sphere' pos='0.5 0 0' size='0.05' mass='1'/></body></worldbody><actuator>" ACTUATOR \
  "</actuator></mujoco>"

static const double end = 0.2;

/// What an actuator would have to give for the lid to rest at an angle, N m.
static double missing(const sample *s, double angle) {
  double v = 0, u = 0;
  cav_state *state = cav_state_new(s->model);
  state->options = s->law;
  CHECK(!cav_inverse(s->model, state, &angle, &v, &v, &u));
  cav_state_free(state);
  return u;
}

static void rest_at(sample *s, double angle) {
  s->q[0] = angle;
  for (int t = 0; t < s->motion->nknot; t++) s->motion->q[t] = angle;
  CHECK(verify(s, NULL, NULL) == CAV_OK);
}

// the discrete law with a time constant of 0 pushes what lies d deep at rest by (1 + softness) d / h over a regulariser of the
// softness over the inertia: that is the torque m g r cos(angle) over a step
static void test_lid(void) {
  sample s = sample_new(LID(""), 25, 0.02, CAV_ORDER_EULER);
  s.problem.close_at_rest = 1;
  double low = end, high = end + 0.05;
  for (int i = 0; i < 60; i++) {
    const double middle = (low + high) / 2;
    if (missing(&s, middle) < 0)
      low = middle;
    else
      high = middle;
  }
  const double depth = low - end, inertia = 0.25 + 0.4 * 0.05 * 0.05, torque = 9.81 * 0.5 * cos(low), h = 0.02;
  const double softness = s.law.softness, closed = torque * h * h * softness / (1 + softness) / inertia;
  printf("rests %.3g rad deep, by the closed form %.3g\n", depth, closed);
  CHECK_NEAR(depth, closed, 1e-6 * closed);
  rest_at(&s, low);
  CHECK(s.verdict.certified && s.verdict.limit_violation_max == 0);
  CHECK_NEAR(s.verdict.stop_fraction_max, depth / CAV_TOLERANCE_STOP_ANGLE, 1e-9);
  // at the very end of its range nothing bears it
  rest_at(&s, end);
  CHECK(!s.verdict.certified && s.verdict.stop_fraction_max == 0 && strstr(s.verdict.reason, "unactuated"));
  rest_at(&s, end + CAV_TOLERANCE_STOP_ANGLE + 0.01);
  CHECK_NEAR(s.verdict.limit_violation_max, 0.01, 1e-12);
  CHECK(!s.verdict.certified);
  sample_free(&s);
  // with a motor the range is a range
  s = sample_new(LID("<motor joint='lid'/>"), 25, 0.02, CAV_ORDER_EULER);
  s.problem.close_at_rest = 1;
  rest_at(&s, end + 1e-3);
  CHECK_NEAR(s.verdict.limit_violation_max, 1e-3, 1e-12);
  CHECK(isnan(s.verdict.stop_fraction_max) && strstr(s.verdict.reason, "range of lid"));
  sample_free(&s);
}

static const cav_pair *pair_of(const cav_model *m, const char *one, const char *other) {
  for (int i = 0; i < m->npair; i++) {
    const char *a = m->body[m->geom[m->pair[i].geom1].body].name, *b = m->body[m->geom[m->pair[i].geom2].body].name;
    if ((!strcmp(a, one) && !strcmp(b, other)) || (!strcmp(a, other) && !strcmp(b, one))) return &m->pair[i];
  }
  return NULL;
}

static void test_linkage(void) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/grip/close.xml", NULL, &error);
  if (!CHECK(problem != NULL)) return;
  const cav_model *m = problem->model;
  static const struct {
    const char *one, *other;
    int external;
  } touch[] = {{"driver", "sprung", 0},
               {"driver", "follower", 0},
               {"palm", "follower", 0},
               {"ball", "follower", 1},
               {"ball", "palm", 1}};
  for (size_t i = 0; i < sizeof touch / sizeof *touch; i++) {
    const cav_pair *pair = pair_of(m, touch[i].one, touch[i].other);
    if (CHECK(pair != NULL)) CHECK(pair->external == touch[i].external);
  }
  static const char *const driven[] = {"driver"};
  for (int j = 0; j < m->njoint; j++) CHECK(m->joint[j].driven == !strcmp(m->joint[j].name, driven[0]));

  cav_solution *s = NULL;
  cav_verdict v = {0};
  CHECK(cav_solve(problem, NULL, NULL, &s, &error) == CAV_OK);
  if (CHECK(s != NULL)) CHECK(!cav_verify_solution(problem, s, &v, &error));
  printf("closed: %s%s, %.2g of the stop\n", v.certified ? "certified" : "not certified: ", v.reason,
         v.stop_fraction_max);
  CHECK(v.certified && v.achieved && v.stop_fraction_max > 0.01 && v.stop_fraction_max < 1);
  cav_solution_free(s);
  cav_problem_free(problem);
}

// a tree on a body of the world: its box is part of the same mechanism, its ground is ground
static void test_ground(void) {
  cav_model *m =
      model_of(HEAD
               "<body name='site'><geom type='plane' size='5 5 1'/><geom type='box' pos='2 0 1' size='1 1 1'/>"
               "<body name='mast'><joint type='slide' axis='0 0 1'/><body name='foot'>"
               "<joint type='slide' axis='1 0 0'/><geom size='.1'/></body><geom size='.1' pos='0 0 1'/></body>"
               "</body></worldbody></mujoco>");
  if (!CHECK(m != NULL)) return;
  int seen[2] = {0};
  for (int i = 0; i < m->npair; i++) {
    const int plane = m->geom[m->pair[i].geom1].type == CAV_GEOM_PLANE;
    CHECK(m->pair[i].external == plane);
    seen[plane]++;
  }
  CHECK(seen[0] > 0 && seen[1] > 0);
  cav_model_free(m);
}

int main(void) {
  test_ground();
  test_lid();
  test_linkage();
  return check_result();
}
