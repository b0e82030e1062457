/// Measures of motions that are known: a box at a depth, sliding, held in the air, falling, braked within and beyond its
/// friction; a lever that its motor cannot hold; links folded into each other.
#include <string.h>

#include "cavort/cavort.h"
#include "check.h"

enum { KNOTS = 20 };
static const double h = 0.02, g = 9.81;

static const char box_text[] =
    "<mujoco><option timestep='0.02'/><worldbody><geom name='floor' type='plane' size='0 0 1' friction='0.8'/>"
    "<body pos='0 0 0.1'><freejoint/><geom type='box' size='0.1 0.1 0.1' mass='2' condim='3' friction='0.8'/></body>"
    "</worldbody></mujoco>";
static const char lever_text[] =
    "<mujoco><option timestep='0.02'/><worldbody><body><joint name='j' type='hinge' axis='0 1 0'/>"
    "<geom type='sphere' size='0.05' pos='0.5 0 0' mass='1' contype='0' conaffinity='0'/></body></worldbody>"
    "<actuator><motor joint='j' ctrllimited='true' ctrlrange='-3 3'/></actuator></mujoco>";
static const char chain_text[] =
    "<mujoco><option timestep='0.02' gravity='0 0 0'/><worldbody><body><freejoint/><geom type='sphere' size='0.05' "
    "mass='1'/>"
    "<body pos='0.2 0 0'><joint type='hinge' axis='0 1 0'/><geom type='sphere' size='0.05' mass='1'/>"
    "<body pos='0.2 0 0'><joint type='hinge' axis='0 1 0'/><geom type='sphere' size='0.05' "
    "mass='1'/></body></body></body>"
    "</worldbody></mujoco>";

static cav_model *parse(const char *text) {
  cav_error error = {0};
  cav_model *model = cav_model_parse(text, NULL, NULL, &error);
  if (!CHECK(model != NULL)) printf("%s\n", error.text);
  return model;
}

static cav_quality measure(const cav_model *model, const cav_trajectory *motion) {
  cav_quality quality = {0};
  cav_error error = {0};
  CHECK(!cav_quality_measure(model, motion, NULL, &quality, &error));
  return quality;
}

// a box along x = x0 + x1 t + x2 t^2 + x3 t^3, and z likewise
static cav_quality box(const cav_model *model, const double x[4], const double z[4]) {
  cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
  for (int t = 0; t < KNOTS; t++) {
    double s = t * h, *q = motion->q + t * model->nq;
    q[0] = x[0] + s * (x[1] + s * (x[2] + s * x[3]));
    q[2] = z[0] + s * (z[1] + s * (z[2] + s * z[3]));
  }
  cav_quality quality = measure(model, motion);
  cav_trajectory_free(motion);
  return quality;
}

static void test_box(void) {
  static const double still[4] = {0};
  cav_model *model = parse(box_text);
  cav_quality q = box(model, still, (const double[4]){0.1});
  CHECK_NEAR(q.penetration, 0, 1e-9);
  CHECK_NEAR(q.skating, 0, 1e-9);
  CHECK_NEAR(q.floating, 0, 1e-9);
  CHECK_NEAR(q.residual_worst, 0, 1e-4);
  CHECK_NEAR(q.jerk, 0, 1e-6);
  CHECK_NEAR(q.landing, 1, 1e-9);
  CHECK(isnan(q.flailing) && isnan(q.asymmetry));
  // 12 mm deep; 8 mm are below the bar
  q = box(model, still, (const double[4]){0.088});
  CHECK_NEAR(q.penetration, 12, 1e-9);
  CHECK_NEAR(q.penetration_fraction, 100, 0);
  q = box(model, still, (const double[4]){0.092});
  CHECK_NEAR(q.penetration, 8, 1e-9);
  CHECK_NEAR(q.penetration_fraction, 0, 0);
  // 3 cm/s, within what counts as contact and above it
  q = box(model, (const double[4]){0, 0.03, 0, 0}, (const double[4]){0.104});
  CHECK_NEAR(q.skating, 3, 1e-9);
  CHECK_NEAR(q.skating_fraction, 100, 0);
  q = box(model, (const double[4]){0, 0.009, 0, 0}, (const double[4]){0.1});
  CHECK_NEAR(q.skating, 0.9, 1e-9);
  CHECK_NEAR(q.skating_fraction, 0, 0);
  q = box(model, (const double[4]){0, 0.03, 0, 0}, (const double[4]){0.106});
  CHECK_NEAR(q.skating, 0, 0);
  // held in the air by nothing
  q = box(model, still, (const double[4]){0.13});
  CHECK_NEAR(q.floating, 30, 1e-9);
  CHECK_NEAR(q.floating_fraction, 100, 0);
  CHECK_NEAR(q.residual, 100, 1e-9);
  CHECK_NEAR(q.residual_worst, 100, 1e-9);
  // falling is not floating
  q = box(model, (const double[4]){0, 1, 0, 0}, (const double[4]){1.1, 1, -g / 2, 0});
  CHECK_NEAR(q.floating, 0, 0);
  CHECK_NEAR(q.residual_worst, 0, 1e-6);
  CHECK_NEAR(q.landing, 0, 1e-9);
  // pushed up by half as much as it weighs beyond that
  q = box(model, still, (const double[4]){0.1, 0, g / 4, 0});
  CHECK_NEAR(q.landing, 1.5, 1e-9);
  q = box(model, (const double[4]){0, 0, 0, 7.0 / 6}, (const double[4]){0.1});
  CHECK_NEAR(q.jerk, 7, 1e-6);
  cav_model_free(model);
}

// a ball that moves at a speed and turns at another about y
static cav_quality ball(const cav_model *model, double speed, double turn) {
  cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
  for (int t = 0; t < KNOTS; t++) {
    double *q = motion->q + t * model->nq, angle = turn * t * h;
    q[0] = speed * t * h, q[2] = 0.1;
    q[3] = cos(angle / 2), q[5] = sin(angle / 2);
  }
  cav_quality quality = measure(model, motion);
  cav_trajectory_free(motion);
  return quality;
}

// what rolls does not slide, at 0.6 rad a step or 1.2 a frame; what slides does so at its speed, what spins on its place at
// that of its surface
static void test_rolling(void) {
  cav_model *model = parse(
      "<mujoco><option timestep='0.02'/><worldbody><geom type='plane' size='0 0 1'/><body pos='0 0 0.1'>"
      "<freejoint/><geom type='sphere' size='0.1' mass='2'/></body></worldbody></mujoco>");
  cav_quality q = ball(model, 3, 30);
  CHECK_NEAR(q.skating, 0, 1e-9);
  CHECK_NEAR(q.skating_step, 0, 1e-9);
  CHECK_NEAR(q.skating_fraction, 0, 0);
  q = ball(model, 3, 0);
  CHECK_NEAR(q.skating, 300, 1e-9);
  CHECK_NEAR(q.skating_step, 300, 1e-9);
  CHECK_NEAR(q.skating_fraction, 100, 0);
  q = ball(model, 0, 10);
  CHECK_NEAR(q.skating, 100, 1e-9);
  q = ball(model, 1, 11);
  CHECK_NEAR(q.skating, 10, 1e-9);
  CHECK_NEAR(q.skating_step_fraction, 100, 0);
  cav_model_free(model);
}

// a box that turns up about its lower edge, 5 rad/s, while that moves at a speed: its far corners, off the floor but within
// 5 mm of it for a while, slide back faster than that
static void test_edge(void) {
  cav_model *model = parse(box_text);
  for (int k = 0; k < 2; k++) {
    cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
    for (int t = 0; t < KNOTS; t++) {
      double angle = 0.005 + 5 * h * t / 4, *q = motion->q + t * model->nq;
      q[0] = 0.1 + 0.1 * (sin(angle) - cos(angle)) + 0.02 * k * t * h, q[2] = 0.1 * (cos(angle) + sin(angle));
      q[3] = cos(angle / 2), q[5] = sin(angle / 2);
    }
    cav_quality q = measure(model, motion);
    CHECK_NEAR(q.skating, 2 * k, 1e-9);
    CHECK_NEAR(q.skating_step, 2 * k, 1e-9);
    CHECK_NEAR(q.skating_fraction, 100 * k, 0);
    cav_trajectory_free(motion);
  }
  cav_model_free(model);
}

// a box that goes 2.5 mm to and fro, a step each way and a step of rest between, slides by that over frames of two steps
static void test_frame(void) {
  cav_model *model = parse(box_text);
  cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
  for (int t = 0; t < KNOTS; t++)
    motion->q[t * model->nq] = 0.0025 * (t % 4 == 1 || t % 4 == 2), motion->q[t * model->nq + 2] = 0.1;
  cav_quality q = measure(model, motion);
  CHECK_NEAR(q.skating_step, 12.5, 1e-9);
  CHECK_NEAR(q.skating, 6.25, 1e-9);
  CHECK_NEAR(q.skating_step_fraction, 100.0 * 10 / 19, 1e-9);
  CHECK_NEAR(q.skating_fraction, 100, 1e-9);
  cav_trajectory_free(motion);
  cav_model_free(model);
}

// what friction cannot brake is the distance of the force from its cone: (a/g - mu)/sqrt(1 + mu^2)
static void test_friction(void) {
  cav_model *model = parse(box_text);
  cav_quality q = box(model, (const double[4]){0, 5, -0.5 * g / 2, 0}, (const double[4]){0.1});
  CHECK_NEAR(q.residual_worst, 0, 0.05);
  q = box(model, (const double[4]){0, 5, -1.6 * g / 2, 0}, (const double[4]){0.1});
  CHECK_NEAR(q.residual, 100 * (1.6 - 0.8) / sqrt(1 + 0.64), 0.5);
  cav_model_free(model);
}

// a mass of 1 kg half a metre out, held level: 4.905 N m of 3
static void test_effort(void) {
  cav_model *model = parse(lever_text);
  cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
  cav_quality q = measure(model, motion);
  CHECK_NEAR(q.torque_excess, 100 * (g / 2 - 3) / 3, 1e-6);
  CHECK_NEAR(q.torque_excess_fraction, 100, 1e-9);
  CHECK_NEAR(q.effort, 100 * g / 2 / 3, 1e-6);
  CHECK_NEAR(q.residual_worst, 0, 1e-9);
  // hanging, there is nothing to hold
  for (int t = 0; t < KNOTS; t++) motion->q[t] = M_PI / 2;
  q = measure(model, motion);
  CHECK_NEAR(q.torque_excess, 0, 1e-9);
  cav_trajectory_free(motion);
  cav_model_free(model);
}

// one arm, then both, raised forwards at 2 rad/s: hands are 0.5901 m from the shoulders' axes
static void test_arms(void) {
  cav_error error = {0};
  cav_model *model = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error);
  if (!CHECK(model != NULL)) return;
  cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
  for (int arms = 1; arms <= 2; arms++) {
    for (int t = 0; t < KNOTS; t++) {
      double *q = motion->q + t * model->nq;
      memcpy(q, model->q0, (size_t)model->nq * sizeof *q);
      for (int j = 0, moved = 0; j < model->njoint; j++)
        if (!strncmp(model->joint[j].name, "shoulder2", 9) && moved++ < arms) q[model->joint[j].q] = 2 * t * h;
    }
    cav_quality q = measure(model, motion);
    CHECK_NEAR(q.flailing, 2 * 0.5901 * sin(h) / h * sqrt(arms / 2.), 1e-9);
    CHECK_NEAR(q.asymmetry, arms == 1 ? 100 : 0, 1e-9);
  }
  cav_trajectory_free(motion);
  cav_model_free(model);
}

// the third ball folded back onto the first: 60 mm apart, 40 deep
static void test_folded(void) {
  cav_model *model = parse(chain_text);
  cav_trajectory *motion = cav_trajectory_new(model, KNOTS, h);
  for (int t = 0; t < KNOTS; t++) motion->q[t * model->nq + 7] = M_PI - 2 * asin(0.03 / 0.2);
  cav_quality q = measure(model, motion);
  CHECK_NEAR(q.self_penetration, 40, 1e-6);
  CHECK_NEAR(q.penetration, 0, 0);
  cav_trajectory_free(motion);
  cav_model_free(model);
}

static void test_refusals(void) {
  cav_model *model = parse(lever_text);
  cav_trajectory *motion = cav_trajectory_new(model, 3, h);
  cav_quality quality;
  cav_error error = {0};
  CHECK(cav_quality_measure(model, motion, NULL, &quality, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "four knots"));
  cav_trajectory_free(motion);
  motion = cav_trajectory_new(model, 5, h);
  motion->q[2] = NAN;
  CHECK(cav_quality_measure(model, motion, NULL, &quality, &error) == CAV_NOT_FINITE);
  cav_trajectory_free(motion);
  cav_model_free(model);
  int n;
  const cav_quality_rule *rule = cav_quality_rules(&n);
  CHECK(n * sizeof(double) == sizeof(cav_quality) && !strcmp(rule->name, "penetration") && rule->offset == 0);
}

int main(void) {
  test_box();
  test_rolling();
  test_edge();
  test_frame();
  test_friction();
  test_effort();
  test_arms();
  test_folded();
  test_refusals();
  return check_result();
}
