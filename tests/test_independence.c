/// The verifier shares nothing with what it verifies: each part of the optimiser that it could have used is broken here
/// (calls are redirected by the linker), the optimiser goes along with the error, and the certificate is refused for
/// that reason. Then its own map of a cycle against the optimiser's, on every kind of joint.
#include "cavort/cavort.h"
#include "cycle_image.h"
#include "motion.h"
#include "periodicity.h"
#include "scene.h"

static int far, stronger, willing; // what is broken: the stride, the ranges of actuators, the control of servos

void __real_cav_periodicity_configuration(const cav_periodicity *p, int way, const double *q, double *out);
void __wrap_cav_periodicity_configuration(const cav_periodicity *p, int way, const double *q, double *out);
void __real_cav_actuator_effort_range(const cav_model *model, int actuator, double range[2]);
void __wrap_cav_actuator_effort_range(const cav_model *model, int actuator, double range[2]);
int __real_cav_actuator_input(const cav_model *model, int actuator, double length, double velocity, double force,
                              double *input);
int __wrap_cav_actuator_input(const cav_model *model, int actuator, double length, double velocity, double force,
                              double *input);
double __real_cav_actuator_force(const cav_model *model, int actuator, double length, double velocity, double input);
double __wrap_cav_actuator_force(const cav_model *model, int actuator, double length, double velocity, double input);

void __wrap_cav_periodicity_configuration(const cav_periodicity *p, int way, const double *q, double *out) {
  __real_cav_periodicity_configuration(p, way, q, out);
  if (far) out[0] += way * 0.05;
}

void __wrap_cav_actuator_effort_range(const cav_model *model, int actuator, double range[2]) {
  __real_cav_actuator_effort_range(model, actuator, range);
  for (int k = 0; k < 2 && stronger; k++) range[k] *= 4;
}

int __wrap_cav_actuator_input(const cav_model *model, int actuator, double length, double velocity, double force,
                              double *input) {
  return __real_cav_actuator_input(model, actuator, length, velocity, willing ? force / 4 : force, input);
}

double __wrap_cav_actuator_force(const cav_model *model, int actuator, double length, double velocity, double input) {
  return (willing ? 4 : 1) * __real_cav_actuator_force(model, actuator, length, velocity, input);
}

/// A torso that stays upright on a leg of two links with a round foot, in the x-z plane.
static const char hopper[] =
    "<mujoco model='hopper'><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body name='torso' pos='0 0 1'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 "
    "1'/><joint name='pitch' axis='0 1 0'/><geom type='box' size='.2 .1 .1' mass='6'/>"
    "<body name='thigh'><joint name='hip' axis='0 1 0' limited='true' range='-90 60' armature='.01'/>"
    "<geom type='capsule' size='.04' fromto='0 0 0 0 0 -.3' mass='1' contype='0' conaffinity='0'/>"
    "<body name='shin' pos='0 0 -.3'><joint name='knee' axis='0 1 0' limited='true' range='5 150' armature='.01'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.3' mass='.5' contype='0' conaffinity='0'/>"
    "<geom name='foot' type='sphere' size='.05' pos='0 0 -.3' mass='.2'/></body></body></body></worldbody>"
    "<actuator><motor joint='hip' gear='150' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='knee' gear='150' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

// solved and verified: the verdict says that the cycle does not close, and only where something is broken
static void check_hop(cav_problem *p, int broken) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_error error = {0};
  cav_verdict verdict = {0};
  far = broken;
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  if (!CHECK(status == CAV_OK && s)) fprintf(stderr, "    %s\n", error.text);
  if (status == CAV_OK &&
      CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, &error) == CAV_OK)) {
    printf("hop, broken %d: certified %d, periodicity error %.3g: %s\n", broken, verdict.certified,
           verdict.periodicity_error, verdict.reason);
    // that the whole hop is certified is test_cycle.c's
    CHECK(!strstr(verdict.reason, "cycle") == !broken);
    if (broken) {
      // it is the stride that is wrong by
      CHECK_NEAR(verdict.periodicity_error, 0.05, 1e-9);
    } else {
      CHECK(verdict.periodicity_error < 1e-12);
    }
  }
  far = 0;
  cav_solution_free(s);
}

static void test_stride(void) {
  cav_model *m = scene_load(hopper);
  if (!CHECK(m != NULL)) return;
  cav_problem p = cav_problem_default(m);
  cav_term term[16];
  double q[5] = {0, -0.2, 0, -0.7, 1.4}, v[5] = {0};
  p.nterm = cav_problem_default_terms(term, 14);
  p.term = term;
  p.q_start = p.q_goal = q;
  p.v_start = v;
  p.duration = 0.5, p.timestep = 0.025;
  p.order = CAV_ORDER_MOMENTUM;
  p.cycle = (cav_cycle){.on = 1, .translation = {0.3, 0, 0}};
  check_hop(&p, 0);
  check_hop(&p, 1);
  cav_model_free(m);
}

// held at an angle that asks for twice what there is, by a motor or by a servo: 4.905 N m sin 1 behind a gear of 2
static void check_held(const char *actuator, double angle, double expected, const char *says) {
  char text[900];
  snprintf(text, sizeof text,
           "<mujoco><compiler angle='radian'/><option timestep='0.02'/><worldbody><body name='rod'><joint name='pivot' "
           "axis='0 1 0'/><geom type='sphere' pos='0 0 -0.5' size='0.05' mass='1'/></body></worldbody><actuator>%s"
           "</actuator></mujoco>",
           actuator);
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  cav_trajectory *motion = cav_trajectory_new(m, 26, 0.02);
  double v = 0;
  for (int t = 0; t < 26; t++) motion->q[t] = angle;
  cav_problem p = {.name = "held", .model = m, .duration = 0.5, .timestep = 0.02, .q_start = &angle, .v_start = &v};
  p.close_at_rest = 1;
  p.effort_limit = 1;
  cav_options law = m->options;
  law.order = CAV_ORDER_MIDPOINT;
  law.stabilisation = CAV_STABILISATION_DISCRETE;
  law.softness = 0.01;
  for (int broken = 0; broken < 2; broken++) {
    cav_verdict verdict = {0};
    cav_error error = {0};
    stronger = willing = broken;
    double range[2];
    cav_actuator_effort_range(m, 0, range);
    CHECK(!isfinite(range[1]) || range[1] == (broken ? 4 : 1));
    CHECK(cav_verify(&p, motion, &law, NULL, NULL, &verdict, &error) == CAV_OK);
    stronger = willing = 0;
    CHECK(!verdict.certified && strstr(verdict.reason, says));
    CHECK_NEAR(verdict.limit_violation_max, expected, 1e-12);
    printf("%s, broken %d: %s\n", says, broken, verdict.reason);
  }
  cav_trajectory_free(motion);
  cav_model_free(m);
}

static void test_actuators(void) {
  const double lever = 9.81 * 0.5;
  check_held("<motor name='pusher' joint='pivot' gear='2' ctrllimited='true' ctrlrange='-1 1'/>", 1,
             lever * sin(1) / 2 - 1, "actuator pusher");
  check_held("<position name='puller' joint='pivot' kp='4' gear='2' ctrllimited='true' ctrlrange='-1 1'/>", 0.5,
             2 * 0.5 + lever * sin(0.5) / 8 - 1, "servo puller");
}

/// A free trunk, arms of ball joints, legs whose hinges are not parallel: every kind of joint but slides of roots.
static const char *const sided =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body name='trunk' pos='0 0 .5'><freejoint name='root'/><geom type='sphere' size='.1' mass='3' pos='.02 0 0'/>"
    "<body name='left leg' pos='.1 .1 -.05'><joint name='left hip' axis='.2 1 .1'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 .02 -.2' mass='.5'/></body>"
    "<body name='right leg' pos='.1 -.1 -.05'><joint name='right hip' axis='.2 -1 .1'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 -.02 -.2' mass='.5'/></body>"
    "<body name='arm_l' pos='-.1 .1 .1' euler='20 30 0'><joint name='shoulder_l' type='ball'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/></body>"
    "<body name='arm_r' pos='-.1 -.1 .1' euler='-20 30 0'><joint name='shoulder_r' type='ball'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/></body></body></worldbody></mujoco>";

// two rods that swap angles, seen by their mirror: in the period that is given the left one only sinks and the right
// one only rises, which takes more. A left motor that could not raise its rod shows one period on, and nowhere else
static void check_second_period(double left, int expected) {
  enum { LAST = 25 };
  char text[1400];
  static const char *const rod =
      "<body pos='0 %d 0'><joint name='%s' axis='0 1 0' damping='2'/><geom type='sphere' pos='0 0 -0.5' size='0.05' "
      "mass='1'/></body>";
  char one[300], two[300];
  snprintf(one, sizeof one, rod, 1, "left");
  snprintf(two, sizeof two, rod, -1, "right");
  snprintf(text, sizeof text,
           "<mujoco><compiler angle='radian'/><option timestep='0.02'/><worldbody>%s%s</worldbody><actuator><motor "
           "name='weak' joint='left' gear='2' ctrllimited='true' ctrlrange='-%g %g'/><motor joint='right' gear='2' "
           "ctrllimited='true' ctrlrange='-3 3'/></actuator></mujoco>",
           one, two, left, left);
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  cav_trajectory *motion = cav_trajectory_new(m, LAST + 1, 0.02);
  for (int t = 0; t <= LAST; t++) {
    motion->q[2 * t] = 0.25 + 0.15 * cos(M_PI * t / LAST);
    motion->q[2 * t + 1] = 0.25 - 0.15 * cos(M_PI * t / LAST);
  }
  double gain_q[4 * LAST] = {0}, gain_v[4 * LAST] = {0}, v[2] = {0};
  for (int t = 0; t < LAST; t++) gain_q[4 * t] = gain_q[4 * t + 3] = -40, gain_v[4 * t] = gain_v[4 * t + 3] = -4;
  cav_problem p = {.name = "swap", .model = m, .duration = 0.5, .timestep = 0.02, .q_start = motion->q, .v_start = v};
  p.cycle = (cav_cycle){.on = 1, .mirror = CAV_MIRROR_Y};
  p.effort_limit = 1;
  cav_options law = m->options;
  law.order = CAV_ORDER_MIDPOINT;
  law.stabilisation = CAV_STABILISATION_DISCRETE;
  law.softness = 0.01;
  cav_verdict verdict = {0};
  cav_error error = {0};
  if (!CHECK(cav_verify(&p, motion, &law, gain_q, gain_v, &verdict, &error) == CAV_OK))
    fprintf(stderr, "    %s\n", error.text);
  printf("swap, left motor %g: certified %d, %s\n", left, verdict.certified, verdict.reason);
  CHECK(verdict.certified == expected && verdict.periodicity_error < 1e-12);
  if (!expected) CHECK(strstr(verdict.reason, "weak") && strstr(verdict.reason, "one period on"));
  cav_trajectory_free(motion);
  cav_model_free(m);
}

// the verifier's map is the optimiser's, its links go where their poses say, and it sees one that does not
static void check_map(const char *scene, cav_cycle cycle) {
  cav_model *m = scene_load(scene);
  if (!CHECK(m != NULL)) return;
  cav_problem p = cav_problem_default(m);
  cav_error error = {0};
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv);
  memcpy(q, m->q0, sizeof(double) * (size_t)m->nq);
  p.q_start = p.q_goal = q;
  p.cycle = cycle;
  p.cycle.on = 1;
  cav_periodicity *theirs = cav_periodicity_new(&p, &error);
  cav_cycle_image *mine = cav_cycle_image_new(&p, &error);
  cav_state *state = cav_state_new(m), *moved = cav_state_new(m);
  double *a = scene_vector(m->nq), *b = scene_vector(m->nq), *x = scene_vector(m->nv), *y = scene_vector(m->nv);
  double worst = 0;
  if (!CHECK(theirs && mine)) fprintf(stderr, "    %s\n", error.text);
  for (int k = 0; k < 50 && theirs && mine; k++) {
    scene_posture(m, q, v, 0.8);
    cav_periodicity_configuration(theirs, 1, q, a);
    cav_cycle_image_configuration(mine, q, b);
    cav_difference(m, a, b, 1, x);
    worst = fmax(worst, scene_norm(x, m->nv));
    for (int way = -1; way <= 1; way += 2) {
      cav_periodicity_tangent(theirs, way, v, x);
      cav_cycle_image_tangent(mine, way, v, y);
      worst = fmax(worst, scene_error(x, y, m->nv));
    }
    CHECK(cav_position(m, state, q) == CAV_OK && cav_position(m, moved, b) == CAV_OK);
    for (int l = 1; l < m->nlink; l++)
      worst = fmax(worst, cav_cycle_image_error(mine, l, state->link, state->com, moved));
    // a joint a milliradian off shows
    memset(x, 0, sizeof(double) * (size_t)m->nv);
    x[m->nv - 1] = 1e-3;
    cav_integrate(m, b, x, 1, a);
    CHECK(cav_position(m, moved, a) == CAV_OK);
    double seen = 0;
    for (int l = 1; l < m->nlink; l++)
      seen = fmax(seen, cav_cycle_image_error(mine, l, state->link, state->com, moved));
    CHECK_NEAR(seen, 1e-3, 1e-9);
  }
  printf("map of the cycle, two ways: %.1e\n", worst);
  CHECK(worst < 1e-12);
  cav_periodicity_free(theirs);
  cav_cycle_image_free(mine);
  cav_state_free(state), cav_state_free(moved);
  free(q), free(v), free(a), free(b), free(x), free(y);
  cav_model_free(m);
}

int main(void) {
  check_map(sided, (cav_cycle){.translation = {1, 2, 0}});
  check_map(sided, (cav_cycle){.translation = {1, 2, 0}, .rotation = 0.7});
  check_map(sided, (cav_cycle){.translation = {1, 0, 0}, .mirror = CAV_MIRROR_Y});
  check_map(hopper, (cav_cycle){.translation = {1, 0, 0}, .mirror = CAV_MIRROR_Y});
  test_actuators();
  check_second_period(3, 1);
  check_second_period(1.1, 0);
  test_stride();
  return check_result();
}
