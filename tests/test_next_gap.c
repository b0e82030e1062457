/// The gap after the step that contacts see (CAV_NEXT_GAP_EXACT), against gaps known in closed form: the end of a rod,
/// the corners of a box that tumbles, a ball that rolls. The linear gap must err there by h^2, so that the check could
/// fail. Balls that would be through each other push as hard as under the linear gap. Then steps: a rod comes down on the floor,
/// and forward and inverse undo each other on a humanoid that lands.
#include "constraint.h"
#include "step_bench.h"

static void choose(cav_next_gap next_gap, double timestep, double smoothing) {
  choose_linear(timestep, 0.005, smoothing);
  state->options.next_gap = next_gap;
}

// the gap after the step that a contact's impulse tells of, where it pushes
static double gap_seen(const cav_contact *c) {
  const double target = (1 - c->damping[0]) * c->velocity[0] - c->stiffness * (c->dist - c->margin);
  return c->dist + state->options.timestep * (target - c->regulariser[0] * c->impulse[0]);
}

// a rod of 0.15 m turns about a pivot 0.1 m above the floor: its end is at 0.1 - 0.15 sin(angle)
static const char rod[] =
    "<mujoco><option timestep='.025'/><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .1'>"
    "<joint type='hinge' axis='0 1 0' damping='0'/><geom type='capsule' fromto='0 0 0 .15 0 0' size='.01' mass='1'/>"
    "</body></worldbody></mujoco>";

static double rod_gap(double angle) { return 0.1 - 0.15 * sin(angle) - 0.01; }

static void test_rod(void) {
  if (!open_model(scene_load(rod))) return;
  double error[2][3] = {{0}}, load[2] = {0};
  for (int law = 0; law < 2; law++) {
    for (int k = 0; k < 3; k++) {
      const double h = 0.02 / (1 << k);
      choose(law ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR, h, 0);
      q[0] = asin(0.088 / 0.15), v[0] = 0.3, next[0] = 15;
      CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
      // the other end is at the pivot
      const cav_contact *c =
          &state->contact[state->contact[0].dist < state->contact[state->ncontact - 1].dist ? 0 : state->ncontact - 1];
      CHECK_NEAR(c->dist, rod_gap(q[0]), 1e-14);
      CHECK(c->impulse[0] > 0);
      error[law][k] = fabs(gap_seen(c) - rod_gap(q[0] + h * next[0]));
      CHECK(!law || error[law][k] <= 1e-14);
    }
    // an end that turns up: the linear gap has it deeper in the floor than it comes
    choose(law ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR, 0.025, 0);
    q[0] = asin(0.088 / 0.15), v[0] = 0, next[0] = 20;
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    for (int i = 0; i < state->ncontact; i++) load[law] = fmax(load[law], state->contact[i].impulse[0]);
  }
  printf("rod: the linear gap is %.2g, %.2g, %.2g mm off at 20, 10, 5 ms, the other %.1g m\n", 1e3 * error[0][0],
         1e3 * error[0][1], 1e3 * error[0][2], fmax(error[1][0], fmax(error[1][1], error[1][2])));
  CHECK(error[0][0] > 3e-3);
  CHECK_NEAR(error[0][1] / error[0][2], 4, 0.5);
  CHECK(load[0] > 0 && load[1] > 0 && load[1] < 0.9 * load[0]);
  close_model();
}

// corners of a box that turns about y by a known angle while it falls
static void test_box(void) {
  if (!open_model(scene_load("<mujoco><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .2'><freejoint/>"
                             "<geom type='box' size='.1 .05 .02' mass='2'/></body></worldbody></mujoco>")))
    return;
  const double h = 0.02, tilt = 0.4, speed = -9, fall = -2, size[3] = {0.1, 0.05, 0.02};
  int pushed = 0;
  choose(CAV_NEXT_GAP_EXACT, h, 0);
  q[2] = 0.07;
  q[3] = cos(tilt / 2), q[5] = sin(tilt / 2);
  v[2] = next[2] = fall;
  v[4] = next[4] = speed;
  CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    if (!(c->impulse[0] > 0)) continue;
    const double x = c->feature & 1 ? size[0] : -size[0], z = c->feature & 4 ? size[2] : -size[2];
    const double angle = tilt + h * speed;
    CHECK_NEAR(gap_seen(c), q[2] + h * fall - x * sin(angle) + z * cos(angle), 1e-14);
    CHECK(fabs(gap_seen(c) - c->dist - h * c->velocity_next[0]) > 5e-4);
    pushed++;
  }
  CHECK(pushed >= 2);
  close_model();
}

// a ball that rolls keeps its distance, whatever turns
static void test_roll(void) {
  if (!open_model(scene_load("<mujoco><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .1'><freejoint/>"
                             "<geom type='sphere' size='.1' mass='2'/></body></worldbody></mujoco>")))
    return;
  choose(CAV_NEXT_GAP_EXACT, 0.02, 0);
  q[2] = 0.0999;
  v[0] = next[0] = 3, v[4] = next[4] = 30;
  CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
  CHECK(state->ncontact == 1 && state->contact[0].impulse[0] > 0);
  CHECK_NEAR(gap_seen(&state->contact[0]), -1e-4, 1e-15);
  close_model();
}

// two balls: one that would be through the other after the step is held off as along its line, wherever it is hit; one
// that passes by is let pass
static void test_balls(void) {
  if (!open_model(scene_load(
          "<mujoco><option gravity='0 0 0'/><worldbody><body><joint type='slide' axis='1 0 0'/>"
          "<geom type='sphere' size='.05' mass='1'/></body><body pos='.11 0 0'><joint type='slide' axis='1 0 0'/>"
          "<joint type='slide' axis='0 1 0'/><geom type='sphere' size='.05' mass='1'/></body></worldbody></mujoco>")))
    return;
  double load[2], by[2];
  for (int law = 0; law < 2; law++) {
    choose(law ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR, 0.025, 0);
    next[0] = 10, next[1] = next[2] = 0;
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    load[law] = state->ncontact == 1 ? state->contact[0].impulse[0] : 0;
    next[0] = 0, next[1] = -1, next[2] = 4;
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    by[law] = state->contact[0].impulse[0];
  }
  // after it their centres are 0.14 m apart, the other way round
  CHECK(load[0] > 1 && load[1] == load[0]);
  CHECK(by[0] > 1 && by[1] == 0);
  // the force does not jump anywhere on the way through
  double before = 0, jump = 0, most = 0;
  for (int k = 0; k <= 4000; k++) {
    next[0] = 10.0 * k / 4000, next[1] = 0, next[2] = 0.5;
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    const double f = state->contact[0].impulse[0];
    jump = k ? fmax(jump, fabs(f - before)) : 0;
    most = fmax(most, f);
    before = f;
  }
  CHECK(jump <= 3e-3 * most);
  // one that is 3 mm off before the step and after it, and 5 to 50 mm deep on the way, is held off
  for (int k = 0; k <= 45; k++) {
    const double aside = 0.05 + 0.001 * k, ahead = sqrt(0.103 * 0.103 - aside * aside);
    q[1] = ahead - 0.11, q[2] = aside;
    next[0] = next[2] = 0, next[1] = -2 * ahead / 0.025;
    CHECK(cav_inverse(model, state, q, v, next, u) == CAV_OK);
    CHECK_NEAR(state->contact[0].dist, 0.003, 1e-15);
    CHECK(state->contact[0].impulse[0] > 1);
  }
  close_model();
}

// a rod that falls on the floor ends the step on it, whatever it turned by; by the linear gap it does not
static void test_fall(void) {
  if (!open_model(scene_load(rod))) return;
  double off[2] = {0};
  for (int law = 0; law < 2; law++) {
    for (int k = 0; k < 20; k++) {
      choose(law ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR, 0.025, 0);
      q[0] = 0.3 + 0.01 * k, v[0] = 15, u[0] = 2;
      CHECK(cav_forward(model, state, q, v, u, next) == CAV_OK);
      off[law] = fmax(off[law], fabs(rod_gap(q[0] + 0.025 * next[0])));
    }
  }
  printf("rod on the floor: %.2g mm off by the linear gap, %.2g mm\n", 1e3 * off[0], 1e3 * off[1]);
  // softness 0.005: a two hundredth of what it would go through the floor
  CHECK(off[0] > 3e-3 && off[1] < 1e-3);
  close_model();
}

// forward(inverse) and inverse(forward) along the falls of a humanoid whose joints are driven, at steps of 25 ms
static void test_round_trip(void) {
  enum { STEPS = 40, FALLS = 6 };
  if (!open_model(cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", NULL))) return;
  int without = 0, others = 0, pushed = 0;
  double back = 0, forth = 0, beyond = 0;
  for (int k = 0; k < FALLS * STEPS; k++) {
    choose(CAV_NEXT_GAP_EXACT, 0.025, 5e-4);
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
      if (!(state->contact[i].impulse[0] > 1e-2)) continue;
      pushed++;
      beyond = fmax(beyond, fabs(cav_contact_excess(state, &state->contact[i])) * state->options.timestep);
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
      "humanoid: %d contacts push, gaps up to %.0f mm beyond the linear ones; inverse(forward) %.1e, "
      "forward(inverse) %.1e; of %d without solution %d, another %d\n",
      pushed, 1e3 * beyond, back, forth, 2 * FALLS * STEPS, without, others);
  CHECK(back <= 1e-10 && forth <= 1e-9 && pushed > FALLS * STEPS && beyond > 3e-3);
  // seen 6 and 2
  CHECK(without <= 12 && others <= 6);
  close_model();
}

int main(void) {
  test_rod();
  test_box();
  test_roll();
  test_balls();
  test_fall();
  test_round_trip();
  return check_result();
}
