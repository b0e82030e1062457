/// The slip over the step that contacts see (CAV_NEXT_SLIP_EXACT), against ways known in closed form: a stick that turns
/// about the point it stands on, two bodies that turn as one, a ball that rolls, a block that slides. The velocity at the
/// beginning of the step must err there, so that the check could fail. Then steps: the foot of a leg that stretches stays,
/// and forward and inverse undo each other on a humanoid that lands.
#include "step.h"
#include "step_bench.h"

static void choose(cav_next_slip next_slip, double timestep, double smoothing) {
  choose_linear(timestep, 1e-4, smoothing);
  state->options.next_slip = next_slip;
}

// the slip over the step in world axes that a contact says it sees
static void slip_of(const cav_contact *c, double slip[3]) {
  for (int i = 0; i < 3; i++) slip[i] = c->velocity_next[1] * c->frame[3 + i] + c->velocity_next[2] * c->frame[6 + i];
}

// and the one that its friction tells of, of a contact that sticks
static void slip_felt(const cav_contact *c, double slip[3]) {
  double felt[3] = {0};
  for (int k = 1; k < 3; k++) felt[k] = (1 - c->damping[k]) * c->velocity[k] - c->regulariser[k] * c->impulse[k];
  for (int i = 0; i < 3; i++) slip[i] = felt[1] * c->frame[3 + i] + felt[2] * c->frame[6 + i];
}

// a stick of 0.3 m stands on its end on the floor, leans by an angle and turns about that end by another within the step
static void test_stick(void) {
  if (!open_model(
          scene_load("<mujoco><worldbody><geom type='plane' size='5 5 1' friction='1'/><body pos='0 0 .3'>"
                     "<freejoint/><geom type='box' size='.01 .01 .01' mass='1'/>"
                     "<geom type='sphere' size='1e-12' pos='0 0 -.3' mass='1e-9'/></body></worldbody></mujoco>")))
    return;
  double error[2][3];
  for (int law = 0; law < 2; law++) {
    for (int k = 0; k < 3; k++) {
      const double h = 0.02 / (1 << k), lean = 0.5, turn = 10 * h, r = 0.3;
      choose(law ? CAV_NEXT_SLIP_EXACT : CAV_NEXT_SLIP_LINEAR, h, 0);
      q[0] = r * sin(lean), q[2] = r * cos(lean), q[3] = cos(lean / 2), q[4] = 0, q[5] = sin(lean / 2), q[6] = 0;
      next[0] = r * (sin(lean + turn) - sin(lean)) / h, next[2] = r * (cos(lean + turn) - cos(lean)) / h;
      // pressed on the floor, so that it sticks
      v[2] = -20, next[2] -= 1e-3, next[4] = turn / h;
      CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
      CHECK(state->ncontact == 1 && state->contact[0].impulse[0] > 1);
      double seen[3], felt[3];
      slip_of(&state->contact[0], seen);
      slip_felt(&state->contact[0], felt);
      const double way = r * (sin(lean + turn) - sin(lean) - turn * cos(lean)) / h;
      CHECK_NEAR(seen[0], law ? 0 : way, 1e-11);
      CHECK_NEAR(felt[0], law ? 0 : way, 1e-10);
      error[law][k] = fabs(seen[0]);
    }
  }
  printf("stick: at the beginning of the step %.3g, %.3g, %.3g m/s at 20, 10, 5 ms, over the step at most %.1g\n",
         error[0][0], error[0][1], error[0][2], fmax(error[1][0], fmax(error[1][1], error[1][2])));
  CHECK(error[0][0] > 0.1);
  CHECK_NEAR(error[0][1] / error[0][2], 2, 0.1);
  close_model();
}

// two balls that touch and turn about a point 0.4 m away as one do not slide on each other
static void test_pair(void) {
  if (!open_model(scene_load("<mujoco><option gravity='0 0 0'/><worldbody><body><freejoint/><geom size='.1'/></body>"
                             "<body pos='.2 0 0'><freejoint/><geom size='.1'/></body></worldbody></mujoco>")))
    return;
  for (int law = 0; law < 2; law++) {
    const double h = 0.02, turn = 0.4;
    choose(law ? CAV_NEXT_SLIP_EXACT : CAV_NEXT_SLIP_LINEAR, h, 0);
    for (int k = 0; k < 2; k++) {
      const double x = 0.2 * k, y = 0.4;
      double *to = next + 6 * k;
      to[0] = (x * cos(turn) - y * sin(turn) - x) / h, to[1] = (x * sin(turn) + y * cos(turn) - y) / h,
      to[5] = turn / h;
    }
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    CHECK(state->ncontact == 1);
    double seen[3];
    slip_of(&state->contact[0], seen);
    const double size = hypot(seen[0], hypot(seen[1], seen[2]));
    // each end of the line between the centres turns too far by turn minus sine
    CHECK_NEAR(size, law ? 0 : 0.2 * (turn - sin(turn)) / h, 1e-12);
  }
  close_model();
}

// a ball that rolls: the point has come R (1 - cos) off the floor and R (angle - sin) back, of third order; one that slides
// without turning: its speed
static void test_ball(void) {
  if (!open_model(scene_load("<mujoco><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .1'><freejoint/>"
                             "<geom type='sphere' size='.1' mass='2'/></body></worldbody></mujoco>")))
    return;
  const double h = 0.01, speed = 2;
  choose(CAV_NEXT_SLIP_EXACT, h, 0);
  for (int rolls = 0; rolls < 2; rolls++) {
    next[0] = speed, next[4] = rolls ? speed / 0.1 : 0;
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    double seen[3];
    slip_of(&state->contact[0], seen);
    const double turn = next[4] * h;
    CHECK_NEAR(seen[0], speed - 0.1 * sin(turn) / h, 1e-13);
  }
  close_model();
}

// a leg of two links under a weight that its knee stretches, hip and foot apart sideways: how far the foot slides
static void test_leg(void) {
  if (!open_model(scene_load(
          "<mujoco><worldbody><geom type='plane' size='5 5 1' friction='2'/><body pos='0 0 .6'><joint type='slide' "
          "axis='1 0 0'/>"
          "<joint type='slide' axis='0 0 1'/><geom type='sphere' size='.1' mass='40' contype='0' conaffinity='0'/>"
          "<body><joint type='hinge' axis='0 1 0'/><geom type='capsule' size='.03' fromto='0 0 0 0 0 -.45' mass='4' "
          "contype='0' "
          "conaffinity='0'/><body pos='0 0 -.45'><joint type='hinge' axis='0 1 0'/><geom type='capsule' size='.03' "
          "fromto='0 0 0 0 0 -.42' mass='2'/></body></body></body></worldbody></mujoco>")))
    return;
  double worst[2] = {0};
  int steps[2] = {0};
  for (int law = 0; law < 2; law++) {
    const double h = 0.0125;
    choose(law ? CAV_NEXT_SLIP_EXACT : CAV_NEXT_SLIP_LINEAR, h, 0);
    state->options.next_gap = CAV_NEXT_GAP_EXACT;
    cav_configuration_reset(model, q);
    memset(v, 0, sizeof v);
    q[2] = -0.9, q[3] = 1.7;
    q[1] = 0.45 * cos(q[2]) + 0.42 * cos(q[2] + q[3]) + 0.03 - 0.6;
    for (int t = 0; t < 40; t++) {
      memset(u, 0, sizeof u);
      u[3] = -350 * sin(q[3] / 2);
      CHECK(cav_forward(model, state, q, v, u, next) == CAV_OK);
      CHECK(cav_inverse(model, state, q, v, next, other) == CAV_OK);
      const cav_contact *c = NULL;
      for (int i = 0; i < state->ncontact; i++)
        if (!c || state->contact[i].dist < c->dist) c = &state->contact[i];
      if (!c || !(c->impulse[0] > 0.5)) break;
      // the foot's centre, less what its ball rolls
      const double before = q[0] - 0.45 * sin(q[2]) - 0.42 * sin(q[2] + q[3]), angle = h * (next[2] + next[3]);
      for (int i = 0; i < 4; i++) q[i] += h * next[i];
      const double after = q[0] - 0.45 * sin(q[2]) - 0.42 * sin(q[2] + q[3]);
      worst[law] = fmax(worst[law], fabs(after - before - 0.03 * angle) / h);
      memcpy(v, next, sizeof v);
      steps[law]++;
    }
  }
  printf("leg: foot slides up to %.2g m/s over %d steps, %.2g over %d\n", worst[0], steps[0], worst[1], steps[1]);
  CHECK(steps[0] >= 10 && steps[1] >= 10 && worst[0] > 0.02 && worst[1] < 2e-3);
  close_model();
}

// forward(inverse) and inverse(forward) along the falls of a humanoid whose joints are driven, at steps of 25 ms
static void test_round_trip(void) {
  enum { STEPS = 40, FALLS = 6 };
  if (!open_model(cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", NULL))) return;
  int without = 0, others = 0, pushed = 0;
  double back = 0, forth = 0, beyond = 0;
  for (int k = 0; k < FALLS * STEPS; k++) {
    choose(CAV_NEXT_SLIP_EXACT, 0.025, 5e-4);
    state->options.softness = 0.005;
    state->options.next_gap = k / STEPS % 2 ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR;
    state->options.order = (cav_order)(k / STEPS % 3);
    if (k % STEPS == 0) {
      cav_configuration_reset(model, q);
      scene_normals(v, model->nv, 0.3);
    }
    for (int i = 6; i < model->nv; i++) u[i] = 20 * scene_normal();
    const cav_status status = cav_forward(model, state, q, v, u, next);
    CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED);
    without += status != CAV_OK;
    CHECK(cav_inverse(model, state, q, v, next, other) == CAV_OK);
    if (status == CAV_OK) back = fmax(back, scene_error(other, u, model->nv));
    for (int i = 0; i < state->ncontact; i++) {
      const cav_contact *c = &state->contact[i];
      if (!(c->impulse[0] > 1e-2)) continue;
      double at[6];
      pushed++;
      cav_contact_velocity(state, c, state->velocity_next, at);
      beyond = fmax(beyond, hypot(c->velocity_next[1] - at[1], c->velocity_next[2] - at[2]));
    }
    if (cav_forward(model, state, q, v, other, found) != CAV_OK) {
      without++;
    } else {
      // another solution is one all the same
      const double error = scene_error(found, next, model->nv);
      others += error > 1e-6;
      forth = fmax(forth, error > 1e-6 ? 0 : error);
    }
    memcpy(v, next, sizeof v);
    cav_integrate(model, q, v, state->options.timestep, q);
  }
  printf(
      "humanoid: %d contacts push, slips up to %.2g m/s beyond J v', inverse(forward) %.1e, forward(inverse) %.1e; of "
      "%d "
      "without solution %d, another %d\n",
      pushed, beyond, back, forth, 2 * FALLS * STEPS, without, others);
  CHECK(back <= 1e-10 && forth <= 1e-9 && pushed > FALLS * STEPS && beyond > 0.3);
  CHECK(without <= 12 && others <= 6);
  close_model();
}

int main(void) {
  test_stick();
  test_pair();
  test_ball();
  test_leg();
  test_round_trip();
  return check_result();
}
