/// Actuators and ranges of motions made by hand (sample.h): what they have to give, in closed form, within their limits and
/// a little beyond.
#include "sample.h"

// hangs at q = 0
static const char *const pendulum = HEAD
    "<body name='rod'><joint name='pivot' type='hinge' axis='0 1 0' damping='0.1'/>"
    "<geom type='sphere' pos='0 0 -0.5' size='0.05' mass='1'/></body></worldbody>"
    "<actuator><motor name='drive' joint='pivot' gear='2' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

// the same, pulled to where a servo is told: kp 4 behind a gear of 2, so 16 N m per rad, and 8 per rad of control
static const char *const servo = HEAD
    "<body name='rod'><joint name='pivot' type='hinge' axis='0 1 0' damping='0.1'/>"
    "<geom type='sphere' pos='0 0 -0.5' size='0.05' mass='1'/></body></worldbody>"
    "<actuator><position name='puller' joint='pivot' kp='4' gear='2' ctrllimited='true' ctrlrange='-1 1'/></actuator>"
    "</mujoco>";

static const char *const ranged = HEAD
    "<body name='rod'><joint name='pivot' type='hinge' axis='0 1 0' damping='0.1' limited='true' range='-0.5 0.5'/>"
    "<geom type='sphere' pos='0 0 -0.5' size='0.05' mass='1'/></body></worldbody>"
    "<actuator><motor joint='pivot'/></actuator></mujoco>";

// two rods pulled down by one cord each and a ball joint pulled by a motor about y
static const char *const cords = HEAD
    "<body name='one'><joint name='a' type='hinge' axis='0 1 0' damping='0.1'/><geom type='sphere' pos='0 0 -0.5' "
    "size='0.05'"
    " mass='1'/></body><body name='two' pos='2 0 0'><joint name='b' type='hinge' axis='0 1 0' damping='0.1'/>"
    "<geom type='sphere' pos='0 0 -0.5' size='0.05' mass='1'/></body><body name='three' pos='4 0 0'><joint name='c' "
    "type='ball'"
    " limited='true' range='0 0.6' damping='0.1'/><geom type='sphere' pos='0 0 -0.5' size='0.05' "
    "mass='1'/></body></worldbody>"
    "<tendon><fixed name='sum' limited='true' range='-1 0.9'><joint joint='a' coef='2'/><joint joint='b' "
    "coef='1'/></fixed>"
    "<fixed name='second'><joint joint='b' coef='0.5'/></fixed></tendon><actuator><motor name='pull' tendon='sum' "
    "gear='3'"
    " forcelimited='true' forcerange='-0.4 0.4'/><motor name='hold' tendon='second'/>"
    "<motor name='x' joint='c' gear='1 0 0'/><motor name='y' joint='c' gear='0 2 0'/><motor name='z' joint='c' gear='0 "
    "0 1'/>"
    "</actuator></mujoco>";

// held still at an angle: torque m g l sin(angle), control half of it
static void test_effort(void) {
  sample s = sample_new(pendulum, 25, 0.02, CAV_ORDER_MIDPOINT);
  s.problem.close_at_rest = 1;
  const double angle[2] = {0.3, 1}, lever = 9.81 * 0.5;
  for (int i = 0; i < 2; i++) {
    s.q[0] = angle[i];
    for (int t = 0; t <= 25; t++) knot(&s, t)[0] = angle[i];
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK(s.verdict.certified == (i == 0));
    CHECK_NEAR(s.verdict.limit_violation_max, i ? lever * sin(1) / 2 - 1 : 0, 1e-12);
    CHECK_NEAR(s.verdict.momentum_defect_rms, 0, 1e-15);
    CHECK_NEAR(s.verdict.feedback_effort_max, lever * sin(angle[i]) / 2, 1e-9);
    if (i) CHECK(strstr(s.verdict.reason, "limit") && strstr(s.verdict.reason, "drive"));
  }
  // what is clipped lets it fall, and feedback asks for more the farther it is
  double gain[25];
  for (int t = 0; t < 25; t++) gain[t] = -1000;
  CHECK(verify(&s, gain, NULL) == CAV_OK);
  CHECK(s.verdict.feedback_effort_max > 5 * lever);
  sample_free(&s);
}

// limits are those planned with: held at 0.72 of the control, and 2 angle + m g l sin(angle) / 8 = 0.78 of a servo's
static void test_planned(void) {
  static const char *const model[2] = {pendulum, servo};
  const double share[2] = {9.81 * 0.5 * sin(0.3) / 2, 0.6 + 9.81 * 0.5 * sin(0.3) / 8};
  for (int i = 0; i < 4; i++) {
    sample s = sample_new(model[i / 2], 25, 0.02, CAV_ORDER_MIDPOINT);
    s.problem.close_at_rest = 1;
    s.problem.effort_limit = share[i / 2] + (i % 2 ? -0.01 : 0.01);
    s.q[0] = 0.3;
    for (int t = 0; t <= 25; t++) knot(&s, t)[0] = 0.3;
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK(s.verdict.certified == (i % 2 == 0));
    CHECK_NEAR(s.verdict.limit_violation_max, i % 2 ? 0.01 : 0, 1e-12);
    sample_free(&s);
  }
}

// a wheel of 2 kg m^2 spun up at 3 rad/s^2 by a motor behind a gear of 4: its power is the moment times the mean speed
static void test_rates(void) {
  static const char wheel[] =
      "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='axle' axis='0 0 1'/>"
      "<inertial pos='0 0 0' mass='1' diaginertia='2 2 2'/></body></worldbody><actuator><motor joint='axle' "
      "gear='4'/></actuator></mujoco>";
  sample s = sample_new(wheel, 20, 0.05, CAV_ORDER_MIDPOINT);
  for (int t = 0; t <= 20; t++) knot(&s, t)[0] = 3 * 0.05 * 0.05 * t * (t + 1) / 2;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.power_max_w, 2 * 3 * 3 * 0.05 * 19.5, 1e-9);
  CHECK_NEAR(s.verdict.joint_speed_max_rad_s, 3, 1e-12);
  CHECK(isnan(s.verdict.joint_speed_over_limit));
  ((cav_joint *)s.model->joint)->speed = 4;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.joint_speed_over_limit, 0.75, 1e-12);
  sample_free(&s);
}

// the control of a servo that holds is where it is and what its pull takes: 2 angle + m g l sin(angle) / 8
static void test_servo(void) {
  sample s = sample_new(servo, 25, 0.02, CAV_ORDER_MIDPOINT);
  s.problem.close_at_rest = 1;
  const double angle[2] = {0.3, 0.5}, lever = 9.81 * 0.5;
  for (int i = 0; i < 2; i++) {
    s.q[0] = angle[i];
    for (int t = 0; t <= 25; t++) knot(&s, t)[0] = angle[i];
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    double control = 2 * angle[i] + lever * sin(angle[i]) / 8;
    CHECK((control > 1) == (i == 1));
    CHECK(s.verdict.certified == (i == 0));
    CHECK_NEAR(s.verdict.limit_violation_max, i ? control - 1 : 0, 1e-12);
    if (i == 0) CHECK_NEAR(s.verdict.closed_loop_end_error_m, 0, 1e-6);
    if (i) CHECK(strstr(s.verdict.reason, "limit") && strstr(s.verdict.reason, "servo puller"));
  }
  sample_free(&s);
}

// held still inside the range, and a milliradian beyond
static void test_range(void) {
  sample s = sample_new(ranged, 25, 0.02, CAV_ORDER_MIDPOINT);
  const double angle[2] = {0.49, 0.501};
  for (int i = 0; i < 2; i++) {
    s.q[0] = angle[i];
    for (int t = 0; t <= 25; t++) knot(&s, t)[0] = angle[i];
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK(s.verdict.certified == (i == 0));
    CHECK_NEAR(s.verdict.limit_violation_max, i ? 1e-3 : 0, 1e-12);
    if (i) CHECK(strstr(s.verdict.reason, "range of pivot") != NULL);
  }
  sample_free(&s);
}

// tendons that pull and end, a joint that turns every way: still at angles a, b, c; the cord of both gives 6 times
// its control
static void hold_cords(sample *s, double a, double b, double c) {
  for (int t = 0; t < s->motion->nknot; t++) {
    double *q = knot(s, t);
    q[0] = a;
    q[1] = b;
    q[2] = cos(c / 2);
    q[3] = q[5] = 0;
    q[4] = sin(c / 2);
  }
  memcpy(s->q, s->motion->q, sizeof(double) * 6);
  CHECK(verify(s, NULL, NULL) == CAV_OK);
}

static void test_cords(void) {
  sample s = sample_new(cords, 25, 0.02, CAV_ORDER_MIDPOINT);
  const double lever = 9.81 * 0.5;
  // a motion that only the right transmission keeps: on a half-length rod errors of the drive show as falling
  hold_cords(&s, 0.4, 0, 0.3);
  CHECK(s.verdict.certified);
  CHECK_NEAR(s.verdict.closed_loop_end_error_m, 0, 1e-6);
  // force limit of the cord
  hold_cords(&s, 0.44, 0, 0.3);
  double pull = lever * sin(0.44) / 6;
  CHECK(pull < 0.4 && s.verdict.certified);
  hold_cords(&s, -0.6, 1.1, 0.3);
  CHECK_NEAR(s.verdict.limit_violation_max, lever * sin(0.6) / 6 / 0.4 - 1, 1e-11);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "pull"));
  hold_cords(&s, 0.6, -0.5, 0.3);
  CHECK_NEAR(s.verdict.limit_violation_max, lever * sin(0.6) / 6 / 0.4 - 1, 1e-11);
  // length of the cord beyond its end, by a law under which the end does not push
  s.law.constraint = 0;
  hold_cords(&s, 0.4, 0.11, 0.3);
  CHECK_NEAR(s.verdict.limit_violation_max, 0.01, 1e-12);
  CHECK(strstr(s.verdict.reason, "constraints") != NULL);
  s.law.constraint = 1;
  // angle of the ball joint
  hold_cords(&s, 0.4, 0, 0.605);
  CHECK_NEAR(s.verdict.limit_violation_max, 0.005, 1e-12);
  CHECK(strstr(s.verdict.reason, "range of c") != NULL);
  sample_free(&s);
}

int main(void) {
  test_effort();
  test_planned();
  test_rates();
  test_servo();
  test_range();
  test_cords();
  return check_result();
}
