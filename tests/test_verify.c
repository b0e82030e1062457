// Verification against motions made by hand (sample.h) whose faults are known: each fault has a sound motion beside it that
// must pass, and is found with the size it was given. Bounds that stand for something else than rounding say so beside them.
#include "sample.h"
#include "verification.h"

static const char *const resting = HEAD
    "<geom name='floor' type='plane' size='5 5 1'/><body name='ball' pos='0 0 0.1'><freejoint name='root'/>"
    "<geom name='skin' type='sphere' size='0.1' mass='2'/></body></worldbody></mujoco>";

// the same on ground whose contacts in the file give way like a fall
static const char *const yielding = HEAD
    "<geom name='floor' type='plane' size='5 5 1' solref='10 1' solimp='0.01 0.01 0.001'/><body name='ball' pos='0 0 "
    "0.1'><freejoint "
    "name='root'/>"
    "<geom name='skin' type='sphere' size='0.1' mass='2' solref='10 1' solimp='0.01 0.01 "
    "0.001'/></body></worldbody></mujoco>";

// stands at q = 0
static const char *const inverted = HEAD
    "<body name='rod'><joint name='pivot' type='hinge' axis='0 1 0'/>"
    "<geom type='sphere' pos='0 0 0.5' size='0.05' mass='1'/></body></worldbody>"
    "<actuator><motor name='drive' joint='pivot' gear='2'/></actuator></mujoco>";

// dragged over the floor
static const char *const sledge = HEAD
    "<geom name='floor' type='plane' size='5 5 1'/><body name='sledge' pos='0 0 0.1'><joint name='x' type='slide'"
    " axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/><geom name='runner' type='sphere' size='0.1' "
    "mass='2'/></body>"
    "</worldbody><actuator><motor joint='x'/><motor joint='z'/></actuator></mujoco>";

static void test_flight(void) {
  sample s = sample_new(flying, 25, 0.02, CAV_ORDER_MIDPOINT);
  fly(&s);
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(s.verdict.certified);
  CHECK_TEXT(s.verdict.reason, "");
  // second differences of metres over h^2 = 4e-4: rounding 1e-15/4e-4/9.81
  CHECK_NEAR(s.verdict.unactuated_force_max, 0, 1e-11);
  CHECK_NEAR(s.verdict.momentum_defect_rms, 0, 1e-11);
  CHECK_NEAR(s.verdict.replay_same_step_max_error, 0, 1e-11);
  CHECK_NEAR(s.verdict.replay_step_max_error, 0, 1e-12);
  CHECK_NEAR(s.verdict.replay_same_step_seconds, 0.5, 1e-12);
  CHECK_NEAR(s.verdict.closed_loop_seconds, 0.5, 1e-12);
  CHECK_NEAR(s.verdict.duration, 0.5, 1e-12);
  // one knot a millimetre high: second differences -2 and 1 at its neighbours, over h^2 and g
  double push = 1e-3 / (0.02 * 0.02) / 9.81;
  knot(&s, 10)[2] += 1e-3;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(!s.verdict.certified);
  CHECK_NEAR(s.verdict.unactuated_force_max, 2 * push, 1e-11);
  CHECK(s.verdict.unactuated_force_knot == 10);
  CHECK_NEAR(s.verdict.momentum_defect_rms, push * sqrt(6.0 / (25 * 6)), 1e-11);
  CHECK(strstr(s.verdict.reason, "knot 10") && strstr(s.verdict.reason, "ball") && strstr(s.verdict.reason, "root"));
  sample_free(&s);
}

// a ball and a weight on one free link hang in the air, each carried by what the file compensates of gravity; a tenth less of
// either is a force of a tenth of its weight that nothing gives, and for the balance of momentum, too
#define BUOYED(BALL, WEIGHT)                                                                                  \
  HEAD "<body name='ball' pos='0 0 1' gravcomp='" BALL                                                        \
       "'><freejoint name='root'/><geom type='sphere' size='0.1' mass='2'/><body name='weight' pos='.3 0 0' " \
       "gravcomp='" WEIGHT "'><geom type='sphere' size='0.05' mass='1'/></body></body></worldbody></mujoco>"
static void test_buoyancy(void) {
  static const char *const model[] = {BUOYED("1", "1"), BUOYED(".9", "1"), BUOYED("1", ".9")};
  for (int i = 0; i < 3; i++) {
    sample s = sample_new(model[i], 25, 0.02, CAV_ORDER_MIDPOINT);
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    // 0.1 of 2 or 1 of 3 kg, one of six components, and the moment about the common centre 0.1 m and 0.2 m away in arms of 0.3 m
    double part = 0.1 * (i ? 3. - i : 0) / 3, arm = i == 1 ? 0.1 / 0.3 : 0.2 / 0.3;
    CHECK_NEAR(s.verdict.momentum_defect_rms, part * sqrt((1 + arm * arm) / 6), 1e-10);
    CHECK((s.verdict.unactuated_force_max < 1e-10) == (i == 0));
    sample_free(&s);
  }
}

// sunk to where the contact carries the weight
static void sink(sample *s, double depth) {
  cav_state *state = cav_state_new(s->model);
  double none[6] = {0}, u[6], low = 1e-6, high = 1e6;
  s->problem.close_at_rest = 1;
  s->law.time_constant = 0.1;
  s->q[2] = 0.1 - depth;
  // softness at which the force is the weight, by bisection of its logarithm
  for (int k = 0; k < 200; k++) {
    s->law.softness = sqrt(low * high);
    state->options = s->law;
    state->options.timestep = 0.02;
    CHECK(cav_inverse(s->model, state, s->q, none, none, u) == CAV_OK);
    *(u[2] < 0 ? &low : &high) = s->law.softness;
  }
  for (int t = 0; t <= 25; t++) memcpy(knot(s, t), s->q, sizeof(double) * 7);
  cav_state_free(state);
}

// everything in order but the depth
static void test_penetration(void) {
  const double depth[2] = {0.002, 0.02};
  for (int i = 0; i < 2; i++) {
    sample s = sample_new(resting, 25, 0.02, CAV_ORDER_MIDPOINT);
    sink(&s, depth[i]);
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK_NEAR(s.verdict.unactuated_force_max, 0, 1e-11);
    CHECK_NEAR(s.verdict.momentum_defect_rms, 0, 1e-11);
    CHECK_NEAR(s.verdict.penetration_max_m, depth[i], 1e-12);
    CHECK_NEAR(s.verdict.slip_mean_m_s, 0, 1e-15);
    CHECK(s.verdict.certified == (i == 0));
    if (i) CHECK(strstr(s.verdict.reason, "penetration") && strstr(s.verdict.reason, "skin in floor"));
    sample_free(&s);
  }
}

// everything in order but the contacts of the model's file, which let the ball fall nearly freely: half a metre takes
// sqrt(2 0.5 / 9.81) = 0.32 s
static void test_own_contacts(void) {
  sample s = sample_new(yielding, 25, 0.02, CAV_ORDER_MIDPOINT);
  sink(&s, 0.002);
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.closed_loop_seconds, 0.5, 1e-12);
  CHECK_NEAR(s.verdict.model_contacts_seconds, sqrt(1 / 9.81), 0.02);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "contacts of the model's file"));
  sample_free(&s);
}

// a fall by steps of h is g t h/2 deeper than one without steps: the loops at finer steps end behind the plan, that under
// the claimed law at a tenth of its step, the model's farthest at the finest of its own
static void test_loop_steps(void) {
  sample s = sample_new(
      "<mujoco><worldbody><body><joint name='z' type='slide' axis='0 0 1'/>"
      "<geom size='0.1'/></body></worldbody></mujoco>",
      25, 0.03, CAV_ORDER_EULER);
  for (int t = 0; t <= 25; t++) knot(&s, t)[0] = -9.81 * 0.03 * 0.03 * t * (t + 1) / 2;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.closed_loop_end_error_m, 9.81 * 0.75 * (0.03 - 0.003) / 2, 1e-9);
  // or at 2 ms from one of four starts, off by up to 0.01 m/s and 0.001 m of an even sequence
  double farthest = 9.81 * 0.75 * (0.03 - 0.001) / 2;
  for (int start = 1; start <= 4; start++) {
    double v = 2 * fmod(0.5 + start * 0.7548776662466927, 1) - 1;
    double z = 2 * fmod(0.5 + start * 0.7548776662466927 + 0.6180339887498949, 1) - 1;
    farthest = fmax(farthest, 9.81 * 0.75 * (0.03 - 0.002) / 2 + 0.75 * 0.01 * v + 0.001 * z);
  }
  CHECK_NEAR(s.verdict.model_contacts_end_error_m, farthest, 1e-9);
  sample_free(&s);
}

// a pole on its tip stands for two seconds because it starts upright to the last bit: what a simulator begins or rounds
// otherwise falls, so this is no certificate. With gains that hold it it is one
static void test_balance(void) {
  for (int held = 0; held < 2; held++) {
    sample s = sample_new(inverted, 100, 0.02, CAV_ORDER_EULER);
    double *gain_q = calloc(100, sizeof *gain_q), *gain_v = calloc(100, sizeof *gain_v);
    for (int t = 0; t < 100 && held; t++) gain_q[t] = -30, gain_v[t] = -5;
    CHECK(verify(&s, gain_q, gain_v) == CAV_OK);
    CHECK(s.verdict.certified == held && s.verdict.closed_loop_seconds > 1.999);
    CHECK(held || strstr(s.verdict.reason, "from a start"));
    CHECK(held == !isnan(s.verdict.push_survived_n_s));
    free(gain_q), free(gain_v);
    sample_free(&s);
  }
}

// what a motion of a mass of 2 kg with these joints survives, s times its weight
static void pushed(const char *joints, int last, double h, double survives) {
  char xml[400];
  snprintf(
      xml, sizeof xml,
      "<mujoco><option gravity='0 0 0'/><worldbody><body>%s<geom size='0.1' mass='2'/></body></worldbody></mujoco>",
      joints);
  sample s = sample_new(xml, last, h, CAV_ORDER_EULER);
  CHECK(verify(&s, NULL, NULL) == CAV_OK && s.verdict.certified);
  CHECK_NEAR(s.verdict.push_survived_n_s, survives * 2 * 9.81, 1e-12);
  sample_free(&s);
}

// pushed after one of three parts of the motion and not brought back: half a metre is lost
static void test_push(void) {
  static const char line[] = "<joint name='x' type='slide' axis='1 0 0'/>";
  // 0.47 m after two seconds; the least push 0.49 and 0.53 m after 16.7 and 18 s
  pushed(line, 150, 0.02, 0.024);
  pushed(line, 250, 0.1, 0.003);
  pushed(line, 270, 0.1, 0);
  // a spring brings it back along x, and nothing along y
  pushed(
      "<joint name='x' type='slide' axis='1 0 0' stiffness='200' damping='20'/>"
      "<joint name='y' type='slide' axis='0 1 0'/>",
      150, 0.02, 0.024);
}

// a mass of no way back, whose start is off by up to 1 mm and 10 mm/s, evenly: it ends off by that after a time, and half a
// metre is lost
static cav_starts_report drifts(double h) {
  enum { LAST = 200, STARTS = 40 };
  sample s = sample_new(
      "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>"
      "<geom size='0.1' mass='2'/></body></worldbody></mujoco>",
      LAST, h, CAV_ORDER_EULER);
  cav_error error = {0};
  cav_starts_report report;
  CHECK(cav_verify_starts(&s.problem, s.motion, &s.law, NULL, NULL, 0, &report, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "one start or more") != NULL);
  CHECK(cav_verify_starts(&s.problem, s.motion, &s.law, NULL, NULL, STARTS, &report, &error) == CAV_OK);
  CHECK(report.starts == STARTS);
  sample_free(&s);
  return report;
}

static void test_starts(void) {
  const cav_starts_report held = drifts(0.1), lost = drifts(0.5);
  // 20 s, 0.2 m; in 100 s every other one is off by more than 0.5 m, the first after 50 s
  CHECK(held.followed == held.starts && isnan(held.soonest_lost));
  CHECK(held.end_error_m > 0.18 && held.end_error_m <= 0.201);
  CHECK(lost.followed > 15 && lost.followed < 25 && lost.end_error_m > 0.4 && lost.end_error_m <= 0.5);
  CHECK(lost.soonest_lost > 49 && lost.soonest_lost < 55);
  for (int feedback = 0; feedback < 2; feedback++) {
    sample s = sample_new(inverted, 100, 0.02, CAV_ORDER_EULER);
    double gain_q[100], gain_v[100];
    cav_error error = {0};
    cav_starts_report report;
    for (int t = 0; t < 100; t++) gain_q[t] = -30 * feedback, gain_v[t] = -5 * feedback;
    CHECK(cav_verify_starts(&s.problem, s.motion, &s.law, gain_q, gain_v, 12, &report, &error) == CAV_OK);
    CHECK(feedback ? report.followed == 12 && report.end_error_m < 1e-3 : report.followed < 6);
    sample_free(&s);
  }
}

// what is measured at the knots alone is what a verification measures there, to the bit; nothing is certified by it
static void test_knots_alone(void) {
  sample s = sample_new(resting, 50, 0.02, CAV_ORDER_EULER);
  for (int t = 2; t <= 50; t++) s.motion->q[7 * t] += 0.01 * t, s.motion->q[7 * t + 2] += 0.01 * sin(0.3 * t);
  cav_trajectory_velocities(s.model, s.motion);
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  const cav_verdict whole = s.verdict;
  cav_error error = {0};
  CHECK(cav_verify_knots(&s.problem, s.motion, &s.law, &s.verdict, &error) == CAV_OK);
  CHECK(whole.momentum_defect_rms > 0 && s.verdict.momentum_defect_rms == whole.momentum_defect_rms);
  CHECK(whole.unactuated_force_max > 0 && s.verdict.unactuated_force_max == whole.unactuated_force_max);
  CHECK(s.verdict.cost == whole.cost && s.verdict.duration == whole.duration);
  CHECK(s.verdict.slip_mean_m_s == whole.slip_mean_m_s && s.verdict.penetration_max_m == whole.penetration_max_m);
  CHECK(whole.closed_loop_seconds > 0 && s.verdict.closed_loop_seconds == 0 && !s.verdict.certified);
  CHECK_TEXT(s.verdict.reason, "not verified");
  CHECK(cav_verify_knots(NULL, s.motion, &s.law, &s.verdict, &error) == CAV_BAD_INPUT);
  sample_free(&s);
}

// pushed loops go on from where the loop without a push stood, to the same bits, and from wherever they are told to
static void test_before(void) {
  int last = 100;
  double h = 0.02, *gain = calloc((size_t)(2 * last), sizeof *gain), x[3];
  sample s = sample_new(inverted, last, h, CAV_ORDER_MIDPOINT);
  for (int t = 0; t <= last; t++) knot(&s, t)[0] = 0.3 * (1 - cos(2 * 3.14159265358979 * t * h));
  for (int t = 0; t < last; t++) gain[t] = -12, gain[last + t] = -6;
  cav_trajectory_velocities(s.model, s.motion);
  cav_verification verification;
  struct cav_follow own, alone, after;
  cav_before before = {.x = x};
  CHECK(cav_closed_loops_begin(&verification, &s.problem, s.motion, &s.law, NULL) == CAV_OK);
  CHECK(cav_before_numbers(&verification) == 3);
  CHECK(cav_closed_loop(&verification, CAV_LOOP_OWN, gain, gain + last, &before, &own) == CAV_OK && before.known);
  for (int loop = CAV_LOOP_PUSHED; loop <= CAV_LOOP_PUSHED_BACK; loop++) {
    CHECK(cav_closed_loop(&verification, loop, gain, gain + last, NULL, &alone) == CAV_OK);
    CHECK(cav_closed_loop(&verification, loop, gain, gain + last, &before, &after) == CAV_OK);
    CHECK(!*alone.lost && alone.error == after.error && alone.seconds == after.seconds);
  }
  x[0] += 2;
  CHECK(cav_closed_loop(&verification, CAV_LOOP_PUSHED, gain, gain + last, &before, &after) == CAV_OK);
  CHECK(*after.lost);
  cav_verification_end(&verification);
  free(gain);
  sample_free(&s);
}

// a toe that flies along x at 4 m/s and an arm that turns at 20 rad/s, and a bar of 6 cm in the way of either, which
// both pass between two knots 12 cm and 0.6 rad apart, by motors that stand against any contact force; or a bar that
// stands 1 cm beside the way
#define TOE                                                                                                 \
  "<body name='foot'><joint name='x' type='slide' axis='1 0 0'/><geom name='toe' type='sphere' size='0.02'" \
  " mass='1'/></body>"
#define ARM                                                                                         \
  "<body name='limb'><joint name='turn' type='hinge' axis='0 0 1'/><geom name='arm' type='capsule'" \
  " fromto='0 0 0 0.5 0 0' size='0.01' mass='1'/></body>"
#define BAR(place) "<geom name='bar' type='box' size='0.03 0.1 0.1' pos='" place "'/>"
#define POST(place) "<geom name='bar' type='box' size='0.03 0.03 0.1' pos='" place "'/>"
#define DRIVEN(joint) "</worldbody><actuator><motor joint='" joint "'/></actuator></mujoco>"

static void test_passage(void) {
  static const struct {
    const char *text;
    double start, speed, depth;
  } way[] = {{HEAD TOE BAR("0.0611 0 0") DRIVEN("x"), -0.6, 4, 0.05},
             {HEAD TOE BAR("0.0611 0 0.13") DRIVEN("x"), -0.6, 4, 0},
             {HEAD ARM POST("0.45 0 0") DRIVEN("turn"), -3.3, 20, 0.04},
             {HEAD ARM POST("0.55 0 0") DRIVEN("turn"), -3.3, 20, 0}};
  for (size_t i = 0; i < sizeof way / sizeof *way; i++) {
    sample s = sample_new(way[i].text, 10, 0.03, CAV_ORDER_MIDPOINT);
    s.q[0] = way[i].start;
    s.v[0] = way[i].speed;
    for (int t = 0; t <= 10; t++) *knot(&s, t) = way[i].start + 0.03 * t * way[i].speed;
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK(s.verdict.penetration_max_m == 0);
    // looks are at most 2.5 mm apart, so the deepest is missed by no more than half of that
    CHECK(s.verdict.penetration_between_m <= way[i].depth + 1e-9);
    CHECK(s.verdict.penetration_between_m >= way[i].depth - 1.25e-3);
    if (way[i].depth > 0) {
      CHECK(!s.verdict.certified && strstr(s.verdict.reason, "penetration between knots") &&
            strstr(s.verdict.reason, "at knot 5:"));
      CHECK(strstr(s.verdict.reason, "bar in") || strstr(s.verdict.reason, "in bar"));
    }
    sample_free(&s);
  }
}

// held up by the smoothed law at a height: what it bears there it bears on air from 3 mm on. softness by bisection as
// above
static void hold_up(sample *s, double height) {
  cav_state *state = cav_state_new(s->model);
  double none[12] = {0}, u[12], low = 1e-6, high = 1e6;
  s->problem.close_at_rest = 1;
  s->law.smoothing = s->law.smoothing_self = 0.001;
  s->law.time_constant = 0;
  for (int t = 0; t <= 25; t++) knot(s, t)[2] = 0.1 + height;
  s->q[2] = 0.1 + height;
  for (int k = 0; k < 200; k++) {
    s->law.softness = sqrt(low * high);
    state->options = s->law;
    state->options.timestep = 0.02;
    CHECK(cav_inverse(s->model, state, s->q, none, none, u) == CAV_OK);
    *(u[2] < 0 ? &low : &high) = s->law.softness;
  }
  cav_state_free(state);
}

// load on air: all of a body's that hovers, none of one that hovers lower or arrives, half of one that comes down in
// between
static void test_hover(void) {
  const double height[2] = {0.0025, 0.0035};
  for (int i = 0; i < 2; i++) {
    sample s = sample_new(resting, 25, 0.02, CAV_ORDER_MIDPOINT);
    hold_up(&s, height[i]);
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK_NEAR(s.verdict.unactuated_force_max, 0, 1e-11);
    CHECK_NEAR(s.verdict.hover_fraction, i, 1e-15);
    CHECK(s.verdict.certified == (i == 0));
    if (i) CHECK(strstr(s.verdict.reason, "gaps that stay open") && strstr(s.verdict.reason, "3.5 mm apart"));
    sample_free(&s);
  }
  // far above: what is felt of the floor there is nothing
  sample far = sample_new(resting, 25, 0.02, CAV_ORDER_MIDPOINT);
  hold_up(&far, 0);
  for (int t = 0; t <= 25; t++) knot(&far, t)[2] = 0.15;
  far.q[2] = 0.15;
  CHECK(verify(&far, NULL, NULL) == CAV_OK);
  CHECK(far.verdict.hover_fraction < 1e-9);
  sample_free(&far);
  // from 20 mm in two steps to the floor: the law stops it a step before it is there
  sample s = sample_new(resting, 25, 0.02, CAV_ORDER_MIDPOINT);
  hold_up(&s, 0);
  knot(&s, 0)[2] = 0.12, knot(&s, 1)[2] = 0.11;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(s.verdict.hover_fraction < 1e-3);
  // its own count from the knots: half the time at 4 mm, half on the floor
  hold_up(&s, 0);
  for (int t = 0; t < 13; t++) knot(&s, t)[2] = 0.104;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  cav_state *state = cav_state_new(s.model);
  double open = 0, all = 0, v[12] = {0}, u[6];
  state->options = s.law;
  state->options.timestep = 0.02;
  for (int t = 0; t <= 25; t++) {
    v[2] = t == 13 ? -0.2 : 0, v[8] = t == 12 ? -0.2 : 0;
    CHECK(cav_inverse(s.model, state, knot(&s, t), v, v + 6, u) == CAV_OK);
    all += state->contact[0].impulse[0];
    open += t < 12 ? state->contact[0].impulse[0] : 0;
  }
  CHECK_NEAR(s.verdict.hover_fraction, open / all, 1e-12);
  CHECK(s.verdict.hover_fraction > 1e-3 && s.verdict.hover_self == 0);
  cav_state_free(state);
  sample_free(&s);
}

// what may act across open gaps: a light body on three balls is held up higher by the same law than the one ball of a
// heavy one beside it, on air, and bears just less than 3 % of all force there, or just more
static void test_hover_bar(void) {
  const double share[2] = {0.0295, 0.0305};
  for (int i = 0; i < 2; i++) {
    const double mass = 2.0 / 3 * share[i] / (1 - share[i]);
    char text[1000];
    snprintf(text, sizeof text,
             HEAD
             "<geom name='floor' type='plane' size='5 5 1'/><body name='ball' pos='0 0 0.1'><freejoint/>"
             "<geom type='sphere' size='0.1' mass='2'/></body><body name='light' pos='1 0 0.1'><freejoint/>"
             "<geom type='sphere' size='0.1' pos='0.2 0 0' mass='%.17g'/>"
             "<geom type='sphere' size='0.1' pos='-0.1 0.17320508075688773 0' mass='%.17g'/>"
             "<geom type='sphere' size='0.1' pos='-0.1 -0.17320508075688773 0' mass='%.17g'/></body>"
             "</worldbody></mujoco>",
             mass, mass, mass);
    sample s = sample_new(text, 25, 0.02, CAV_ORDER_MIDPOINT);
    hold_up(&s, 0.0025);
    // where the law holds the other one up
    cav_state *state = cav_state_new(s.model);
    double none[12] = {0}, u[12], low = 0.1, high = 0.15;
    state->options = s.law;
    for (int k = 0; k < 200; k++) {
      s.q[9] = 0.5 * (low + high);
      CHECK(cav_inverse(s.model, state, s.q, none, none, u) == CAV_OK);
      *(u[8] < 0 ? &low : &high) = s.q[9];
    }
    cav_state_free(state);
    for (int t = 0; t <= 25; t++) knot(&s, t)[9] = s.q[9];
    CHECK(s.q[9] > 0.103);
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK_NEAR(s.verdict.hover_fraction, share[i], 1e-6);
    CHECK(s.verdict.certified == (i == 0));
    if (i) CHECK(strstr(s.verdict.reason, "gaps that stay open"));
    sample_free(&s);
  }
}

static void test_slip(void) {
  const double speed[2] = {0, 0.3};
  for (int i = 0; i < 2; i++) {
    sample s = sample_new(sledge, 20, 0.02, CAV_ORDER_MIDPOINT);
    s.q[1] = -1e-3;
    s.v[0] = speed[i];
    for (int t = 0; t <= 20; t++) {
      knot(&s, t)[0] = speed[i] * t * 0.02;
      knot(&s, t)[1] = -1e-3;
    }
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK_NEAR(s.verdict.slip_mean_m_s, speed[i], 1e-12);
    CHECK_NEAR(s.verdict.slip_step_mean_m_s, speed[i], 1e-12);
    CHECK_NEAR(s.verdict.penetration_max_m, 1e-3, 1e-12);
    // what slides most is named, and when
    if (i) CHECK(strstr(s.verdict.reason, "slip, m/s, 0.3 (at most 0.01) at knot "));
    CHECK(s.verdict.slip_self == 0);
    if (i) CHECK(strstr(s.verdict.reason, "N between the world and ") && strstr(s.verdict.reason, "slides at 0.3 m/s"));
    sample_free(&s);
  }
}

// a ball that rolls: its contact has no velocity, and over a step that turns it by a its point goes r (a - sin a)
static void test_slip_over_step(void) {
  static const char *const model = HEAD
      "<geom name='floor' type='plane' size='5 5 1'/><body><joint name='x' type='slide' axis='1 0 0'/><joint name='z' "
      "type='slide' axis='0 0 1'/><joint name='roll' "
      "axis='0 1 0'/><geom name='skin' type='sphere' size='.1' mass='1'/></body></worldbody><actuator><motor "
      "joint='x'/><motor joint='z'/><motor joint='roll'/></actuator></mujoco>";
  const double h = 0.02, rate = 10, depth = 1e-3, radius = 0.1 - depth / 2, turn = rate * h;
  sample s = sample_new(model, 20, h, CAV_ORDER_MIDPOINT);
  s.q[1] = 0.1 - depth;
  s.v[0] = rate * radius, s.v[2] = rate;
  for (int t = 0; t <= 20; t++)
    knot(&s, t)[0] = radius * turn * t, knot(&s, t)[1] = 0.1 - depth, knot(&s, t)[2] = turn * t;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.slip_mean_m_s, 0, 1e-12);
  CHECK_NEAR(s.verdict.slip_step_mean_m_s, radius * (turn - sin(turn)) / h, 1e-12);
  sample_free(&s);
}

// a block that slides on the link that carries it, two links up: all slip is within the tree
static void test_slip_within(void) {
  static const char *const model = HEAD
      "<body name='table'><joint name='across' type='slide' axis='0 1 0'/><geom name='top' type='box' size='1 1 .1' "
      "mass='2'/>"
      "<body name='arm' pos='0 0 .5'><joint name='up' type='slide' axis='0 0 1'/><geom size='.05' mass='1' contype='0' "
      "conaffinity='0'/><body name='block' pos='0 0 -.3'><joint name='x' type='slide' axis='1 0 0'/><geom name='foot' "
      "type='sphere' size='.1' mass='1'/></body></body></body></worldbody><actuator><motor joint='across'/><motor "
      "joint='up'/><motor joint='x'/></actuator></mujoco>";
  sample s = sample_new(model, 20, 0.02, CAV_ORDER_MIDPOINT);
  s.q[1] = -1e-3;
  s.v[2] = 0.3;
  for (int t = 0; t <= 20; t++) knot(&s, t)[1] = -1e-3, knot(&s, t)[2] = 0.3 * t * 0.02;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.slip_mean_m_s, 0.3, 1e-12);
  CHECK(s.verdict.slip_self == 1);
  sample_free(&s);
}

// numbers of five hard terms
typedef struct asked {
  double place[3], quat[4], way[9], times[3];
} asked;

// at the end, at an instant between knots 12 and 13 but nearer to 13, along a line, speeds, posture
static void ask(const sample *s, asked *to, const double *middle, cav_term term[5]) {
  int ball = cav_object_find(s->model, CAV_OBJECT_BODY, "ball");
  cav_sensor pos = {.name = "", .type = CAV_SENSOR_FRAMEPOS, .object_type = CAV_OBJECT_XBODY, .object = ball, .dim = 3};
  cav_sensor axes = {
      .name = "", .type = CAV_SENSOR_FRAMEQUAT, .object_type = CAV_OBJECT_XBODY, .object = ball, .dim = 4};
  const cav_term all[5] = {
      {.name = "end",
       .use = CAV_USE_EQUAL,
       .sensor = pos,
       .component = -1,
       .from = 0.5,
       .to = -1,
       .scale = 0.5,
       .target = to->place},
      {.name = "turn",
       .use = CAV_USE_EQUAL,
       .sensor = axes,
       .component = -1,
       .from = 0.255,
       .to = 0.255,
       .scale = 1,
       .target = to->quat},
      {.name = "line",
       .use = CAV_USE_EQUAL,
       .sensor = pos,
       .component = 1,
       .from = 0,
       .to = -1,
       .scale = 1,
       .target = to->way,
       .nwaypoint = 3,
       .waypoint_time = to->times},
      {.name = "speed",
       .quantity = CAV_QUANTITY_VELOCITY,
       .use = CAV_USE_RANGE,
       .dofs = CAV_DOFS_ROOT_ANGULAR,
       .from = 0.1,
       .to = 0.4,
       .scale = 1,
       .lower = -1,
       .upper = 2},
      {.name = "still",
       .quantity = CAV_QUANTITY_CONFIGURATION,
       .use = CAV_USE_RANGE,
       .dofs = CAV_DOFS_ROOT_LINEAR,
       .from = 0.2,
       .to = 0.3,
       .scale = 1,
       .target = middle,
       .lower = -0.2,
       .upper = 0.2},
  };
  memcpy(term, all, sizeof all);
}

// hard terms, each met and each missed by a known amount
static void test_terms(void) {
  sample s = sample_new(flying, 25, 0.02, CAV_ORDER_MIDPOINT);
  fly(&s);
  int last = 25;
  const double *end = knot(&s, last), *middle = knot(&s, 13);
  asked to = {{end[0], end[1], end[2]},
              {-middle[3], -middle[4], -middle[5], -middle[6]},
              {0, 0, 0, 0, -0.1, 0, 0, -0.2, 0},
              {0, 0.5, 1}};
  cav_term term[5];
  ask(&s, &to, middle, term);
  s.problem.term = term;
  s.problem.nterm = 5;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.constraint_violation_max, 0, 1e-12);
  CHECK(s.verdict.certified);
  // each missed
  to.place[0] += 0.01;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.constraint_violation_max, 0.02, 1e-11);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "end") && strstr(s.verdict.reason, "knot 25"));
  to.place[0] -= 0.01;
  memcpy(to.quat, knot(&s, 12) + 3, sizeof to.quat);
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  // one step of a spin whose largest component is 2 rad/s
  CHECK_NEAR(s.verdict.constraint_violation_max, 2 * 0.02, 1e-11);
  CHECK(strstr(s.verdict.reason, "turn") && strstr(s.verdict.reason, "knot 13"));
  memcpy(to.quat, knot(&s, 13) + 3, sizeof to.quat);
  to.way[4] -= 0.03;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.constraint_violation_max, 0.03, 1e-11);
  CHECK(strstr(s.verdict.reason, "line") && strstr(s.verdict.reason, "knot 25"));
  to.way[4] += 0.03;
  term[3].upper = 1.5;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.constraint_violation_max, 0.5, 1e-11);
  term[3].upper = 2;
  term[4].upper = 0.01;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "still"));
  // as costs they are no concern of a certificate
  for (int i = 0; i < 5; i++) term[i].use = CAV_USE_COST;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(s.verdict.certified);
  sample_free(&s);
}

// swaying on its head: only feedback keeps a finer simulation with it
static void test_closed_loop(void) {
  int last = 200;
  double h = 0.02, *gain = calloc((size_t)(2 * last), sizeof *gain);
  sample s = sample_new(inverted, last, h, CAV_ORDER_MIDPOINT);
  for (int t = 0; t <= last; t++) knot(&s, t)[0] = 0.3 * (1 - cos(2 * 3.14159265358979 * t * h));
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "closed loop") && strstr(s.verdict.reason, "rod"));
  CHECK(s.verdict.closed_loop_seconds < 3);
  CHECK(s.verdict.feedback_effort_max == 0); // the drive has no limit
  printf("inverted pendulum without gains: %.3g s\n", s.verdict.closed_loop_seconds);
  // the inverse is exact at the step of the knots: errors there grow from rounding alone
  CHECK_NEAR(s.verdict.replay_step_max_error, 0, 1e-12);
  for (int t = 0; t < last; t++) gain[t] = -12, gain[last + t] = -6;
  CHECK(verify(&s, gain, gain + last) == CAV_OK);
  CHECK(s.verdict.certified);
  CHECK_NEAR(s.verdict.closed_loop_seconds, 4, 1e-12);
  printf("inverted pendulum with gains: end error %.3g m\n", s.verdict.closed_loop_end_error_m);
  // 2.2 mm seen; 10.8 mm without gain_v
  CHECK_NEAR(s.verdict.closed_loop_end_error_m, 0, 4e-3);
  // stiffness alone carries it too, damping alone would only delay the fall
  for (int t = 0; t < last; t++) gain[t] = -40, gain[last + t] = 0;
  CHECK(verify(&s, gain, NULL) == CAV_OK);
  CHECK_NEAR(s.verdict.closed_loop_seconds, 4, 1e-12);
  // gains of the wrong sign
  for (int t = 0; t < 2 * last; t++) gain[t] = -gain[t];
  CHECK(verify(&s, gain, gain + last) == CAV_OK);
  CHECK(!s.verdict.certified);
  free(gain);
  sample_free(&s);
}

// a wheel that feedback throws so fast that no number holds where it goes: lost, with its time. And a motion that stirs
// the wheel so fast at a knot that Newton's steps from there leave all numbers: no certificate, and no error either
static void test_thrown(void) {
  static const char *const wheel = HEAD
      "<body name='ball' pos='0 0 1'><freejoint name='root'/><geom type='sphere' size='0.1' mass='2' contype='0' "
      "conaffinity='0'/><body name='wheel'><joint name='axle' axis='0.6 0 0.8'/><geom type='sphere' size='0.05' "
      "pos='0.1 0 0' contype='0' conaffinity='0'/></body></body></worldbody>"
      "<actuator><motor joint='axle'/></actuator></mujoco>";
  int last = 10;
  double *gain = calloc((size_t)last * 49, sizeof *gain);
  for (double size = 1e4; size < 1e300; size *= 1e48) {
    sample s = sample_new(wheel, last, 0.02, CAV_ORDER_MIDPOINT);
    for (int t = 0; t <= last; t++) knot(&s, t)[2] = 1 - 9.81 * 0.02 * 0.02 * t * (t + 1) / 2;
    for (int t = 0; t < last; t++) gain[t * 49 + 6 * 7 + 2] = gain[t * 49 + 6 * 7 + 6] = size;
    CHECK(verify(&s, gain, gain) == CAV_OK);
    CHECK(!s.verdict.certified && strstr(s.verdict.reason, "closed loop"));
    CHECK(s.verdict.closed_loop_seconds < 0.2 && s.verdict.model_contacts_seconds < 0.2);
    knot(&s, 5)[7] = 1e52;
    CHECK(verify(&s, NULL, NULL) == CAV_OK);
    CHECK(!s.verdict.certified && isinf(s.verdict.replay_step_max_error));
    sample_free(&s);
  }
  free(gain);
}

static void test_refusals(void) {
  sample s = sample_new(flying, 25, 0.02, CAV_ORDER_MIDPOINT);
  cav_error error = {0};
  fly(&s);
  // the claimed law drops gravity: the model has it
  s.law.gravity = 0;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "gravity"));
  s.law.gravity = 1;
  // elsewhere than the start
  s.q[0] += 0.01;
  CHECK(verify(&s, NULL, NULL) == CAV_OK);
  CHECK(!s.verdict.certified && strstr(s.verdict.reason, "start"));
  CHECK_NEAR(s.verdict.constraint_violation_max, 0.01, 1e-12);
  s.q[0] -= 0.01;
  // another number of knots, another step
  s.problem.duration = 1;
  CHECK(cav_verify(&s.problem, s.motion, &s.law, NULL, NULL, &s.verdict, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "knots") && !s.verdict.certified);
  s.problem.duration = 0.5;
  s.motion->timestep = 0.021;
  CHECK(cav_verify(&s.problem, s.motion, &s.law, NULL, NULL, &s.verdict, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "step") != NULL);
  s.motion->timestep = 0.02;
  // a law at another step than the knots': its softness would be another
  s.law.timestep = 0.01;
  CHECK(cav_verify(&s.problem, s.motion, &s.law, NULL, NULL, &s.verdict, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "law") != NULL && strstr(error.text, "0.01 s") != NULL);
  s.law.timestep = 0.02;
  // no number
  knot(&s, 5)[1] = NAN;
  CHECK(cav_verify(&s.problem, s.motion, &s.law, NULL, NULL, &s.verdict, &error) == CAV_NOT_FINITE);
  CHECK(!s.verdict.certified);
  // nothing at all
  CHECK(cav_verify(NULL, s.motion, &s.law, NULL, NULL, &s.verdict, &error) == CAV_BAD_INPUT);
  CHECK(cav_verify(&s.problem, NULL, &s.law, NULL, NULL, &s.verdict, NULL) == CAV_BAD_INPUT);
  CHECK(cav_verify(&s.problem, s.motion, &s.law, NULL, NULL, NULL, &error) == CAV_BAD_INPUT);
  sample_free(&s);
}

int main(void) {
  test_flight();
  test_buoyancy();
  test_penetration();
  test_own_contacts();
  test_loop_steps();
  test_balance();
  test_push();
  test_starts();
  test_knots_alone();
  test_before();
  test_passage();
  test_hover();
  test_hover_bar();
  test_slip();
  test_slip_over_step();
  test_slip_within();
  test_terms();
  test_closed_loop();
  test_thrown();
  test_refusals();
  return check_result();
}
