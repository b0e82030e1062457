/// Strategies: which are offered to which problem, that a gait is found with the right signs, that taking one changes
/// guess and schedule alone; and stages of the continuation that stall: taken back, reached half way, noted. Stalls are
/// made by the linker, which puts a region that claims one in the place of the true one.
#include <unistd.h>

#include "biped.h"
#include "clear.h"
#include "continuation.h"
#include "strategy.h"

cav_status __real_cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *tr,
                                      cav_trajectory **at, cav_trajectory **spare);
cav_status __wrap_cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *tr,
                                      cav_trajectory **at, cav_trajectory **spare);

// runs of the region from first to last stall, counted from 1; whether rows are off where they stall
static int runs, first_stall, last_stall, rows_are_off;

cav_status __wrap_cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *tr,
                                      cav_trajectory **at, cav_trajectory **spare) {
  cav_status status = __real_cav_region_minimise(region, normal, tr, at, spare);
  runs++;
  if (runs >= first_stall && runs <= last_stall) {
    region->stalled = 1, region->settled = 0;
    region->radius = 1e-12;
    if (rows_are_off) tr->knot[1].slot[0].value = tr->knot[1].slot[0].upper + 0.1;
  }
  return status;
}

// the offered strategies' names, with blanks
static int offers(const cav_problem *p, const char *names) {
  cav_strategy strategy[CAV_STRATEGIES];
  char text[500] = "";
  int n;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  for (int i = 0; i < n; i++) strcat(strcat(text, i ? " " : ""), strategy[i].name);
  cav_strategies_clear(strategy, n);
  if (!strcmp(text, names)) return 1;
  fprintf(stderr, "    '%s', expected '%s'\n", text, names);
  return 0;
}

// from the back onto the belly the straight way is a somersault through the ground: begun with the start held, the straight
// way is tried later; where the file states a guess it is that
static void test_through_ground(void) {
  cav_error error;
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/turn-over/problem.xml", NULL, &error);
  if (!CHECK(p != NULL)) return;
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  CHECK(p->guess == CAV_GUESS_INTERPOLATE && strategy[0].guess == CAV_GUESS_HOLD && !strategy[0].stated);
  CHECK(offers(p,
               "stated near-1 near-2 near-3 near-4 calm near-5 near-6 fine near-7 near-8 soft line slow momentum "
               "near-9 near-10 near-11 near-12 repair-1 repair-2 repair-3 repair-4 open longer stronger"));
  p->guess_height = 0.3, p->guess_from = 1, p->guess_to = 2;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && strategy[0].stated);
  cav_problem_free(p);
}

// a box that is to be carried is kept as it stands by a strategy of its own, unless a term tells its turn on the way, or the
// goal has it turned; a ball, which has no side to stand on, is not
static void test_upright(void) {
  static const char *const motion[] = {"push-box", "throw"};
  for (int k = 0; k < 2; k++) {
    char path[300];
    cav_error error;
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    snprintf(path, sizeof path, CAVORT_SOURCE_ROOT "/problems/motions/%s/problem.xml", motion[k]);
    cav_problem *p = cav_problem_load(path, NULL, &error);
    if (!CHECK(p != NULL)) return;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && !strategy_find(strategy, n, "upright"));
    cav_strategies_clear(strategy, n);
    for (int i = 0; i < p->nterm; i++)
      if (!strcmp(p->term[i].name, "upright")) ((cav_term *)p->term)[i].weight = 0;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    const cav_strategy *upright = strategy_find(strategy, n, "upright");
    CHECK((upright != NULL) == (k == 0));
    if (upright) {
      CHECK(upright == &strategy[1] && upright->stated);
      CHECK_TEXT(upright->changed, "<sensor type=\"framequat\" xbody=\"box\" weight=\"100\"/>");
      // its terms are laid over the problem's: from the same guess the first steps are others
      cav_solve_options few = cav_solve_options_default();
      cav_solution *one = NULL, *two = NULL;
      few.max_iterations = 3, few.gains = few.diagnose = 0;
      cav_strategy_solve(p, &strategy[0], &few, NULL, &one, &error);
      cav_strategy_solve(p, upright, &few, NULL, &two, &error);
      if (CHECK(one && two)) CHECK(isfinite(two->cost) && one->cost != two->cost);
      cav_solution_free(one), cav_solution_free(two);
      // and is what the motion is certified by, and its folder holds
      cav_problem taken;
      cav_strategy_apply(p, upright, &taken);
      CHECK(taken.nterm == p->nterm + 1 && !strcmp(taken.term[p->nterm].name, "upright"));
      // turned over about x by the goal
      cav_strategies_clear(strategy, n);
      double *q = p->q_goal + p->model->joint[p->model->njoint - 1].q;
      q[3] = q[4] = sqrt(0.5);
      CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && !strategy_find(strategy, n, "upright"));
    }
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
}

// both legs swing in turn, the right way round whichever way the axes point
static void test_gait(const char *text, double axis, double travel) {
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  double q[20], goal[20], v[20] = {0};
  cav_configuration_reset(m, q);
  memcpy(goal, q, sizeof goal);
  goal[0] += travel;
  cav_problem p = cav_problem_default(m), taken;
  p.q_start = q, p.v_start = v, p.q_goal = goal;
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK);
  const cav_strategy *gait = strategy_find(strategy, n, "swing");
  if (CHECK(gait && gait->nswing == 4)) {
    int hip = cav_object_find(m, CAV_OBJECT_JOINT, "hip_left"),
        knee = cav_object_find(m, CAV_OBJECT_JOINT, "knee_left");
    cav_strategy_apply(&p, gait, &taken);
    CHECK(taken.nswing == 4 && taken.swing == gait->swing && taken.q_goal == goal && taken.duration == p.duration);
    CHECK(gait->swing[0].joint == hip && gait->swing[2].joint == knee);
    CHECK(gait->swing[1].joint == cav_object_find(m, CAV_OBJECT_JOINT, "hip_right"));
    // turning about +y takes a hanging leg backwards; the knee bends to where its range is, while the leg comes
    // forwards
    CHECK(gait->swing[0].amplitude * axis * travel < 0 && gait->swing[1].amplitude == gait->swing[0].amplitude);
    CHECK_NEAR(gait->swing[1].phase - gait->swing[0].phase, M_PI, 1e-15);
    CHECK(gait->swing[2].amplitude > 0 && fabs(gait->swing[2].phase - M_PI / 2) < 1e-15);
  }
  // no gait where it stands, nor where the guess swings already; a guess that is held is not held twice, and where the goal is
  // the start the way between is the start held
  goal[0] = q[0];
  for (int back = 0; back < 2; back++) {
    goal[m->nq - 1] = q[m->nq - 1] + (back ? 0 : 0.01);
    static const char *const way[3][2] = {{"hold ", ""}, {"line ", ""}, {"line hold ", "hold "}};
    for (int k = 0; k < 3; k++) {
      char list[400];
      p.guess = k == 1 ? CAV_GUESS_HOLD : CAV_GUESS_INTERPOLATE;
      p.guess_height = k == 2 ? 0.3 : 0;
      snprintf(list, sizeof list,
               "stated near-1 near-2 near-3 near-4 fine near-5 near-6 soft %sslow momentum near-7 near-8 "
               "near-9 near-10 repair-1 repair-2 repair-3 repair-4 open longer stronger",
               way[k][back]);
      CHECK(offers(&p, list));
    }
  }
  goal[0] += travel;
  p.nswing = 1;
  p.swing = &(cav_swing){.joint = 1, .amplitude = 0.1, .frequency = 1};
  CHECK(offers(&p,
               "stated near-1 near-2 near-3 near-4 fine near-5 near-6 soft line hold slow momentum near-7 "
               "near-8 near-9 near-10 repair-1 repair-2 repair-3 repair-4 open longer stronger"));
  // taking one leaves the problem as it was
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK);
  cav_strategy_apply(&p, &strategy[0], &taken);
  CHECK(taken.nswing == 1 && taken.guess_height == 0.3 && taken.schedule.stages == p.schedule.stages);
  cav_strategy_apply(&p, strategy_find(strategy, n, "slow"), &taken);
  CHECK(taken.nswing == 1 && taken.schedule.stages == 2 * p.schedule.stages);
  cav_strategy_apply(&p, strategy_find(strategy, n, "fine"), &taken);
  CHECK(taken.nswing == 1 && taken.timestep == p.timestep / 2 &&
        !strcmp(strategy_find(strategy, n, "fine")->changed, "timestep=\"0.0125\""));
  // what mends it is what mends any other: nothing is changed in it yet
  CHECK(!*(strategy_find(strategy, n, "fine") + 1)->changed && (strategy_find(strategy, n, "fine") + 1)->timestep == 0);
  cav_strategy_apply(&p, strategy_find(strategy, n, "longer"), &taken);
  CHECK(taken.nswing == 1 && taken.duration_least == p.duration && taken.duration_most == 2 * p.duration);
  CHECK(strategy_find(strategy, n, "longer")->use == CAV_STRATEGY_DIAGNOSIS && p.duration_most == 0);
  cav_strategy_apply(&p, strategy_find(strategy, n, "stronger"), &taken);
  CHECK(taken.strength == 2 && taken.effort_limit == p.effort_limit && taken.duration_most == 0 && p.strength == 0);
  CHECK(strategy_find(strategy, n, "stronger")->use == CAV_STRATEGY_DIAGNOSIS);
  cav_strategy_apply(&p, strategy_find(strategy, n, "momentum"), &taken);
  CHECK(taken.order == CAV_ORDER_MOMENTUM && taken.duration_most == 0 && p.order == CAV_ORDER_MIDPOINT);
  cav_strategy_apply(&p, strategy_find(strategy, n, "hold"), &taken);
  CHECK(taken.nswing == 0 && taken.guess_height == 0 && taken.guess == CAV_GUESS_HOLD && p.guess_height == 0.3);
  cav_model_free(m);
}

// a sine over a joint of the quadruped
static const cav_swing *swing_of(const cav_model *m, const cav_strategy *gait, const char *joint) {
  int j = cav_object_find(m, CAV_OBJECT_JOINT, joint);
  for (int i = 0; i < gait->nswing; i++)
    if (gait->swing[i].joint == j) return &gait->swing[i];
  return NULL;
}

// four legs trot, those across together; for a turn on the spot they bend and do not swing, wherever they stand and face
static void test_four_legs(void) {
  cav_error error;
  cav_model *m = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/quadruped.xml", &error);
  if (!CHECK(m != NULL)) return;
  cav_state *state = cav_state_new(m);
  double q[40], goal[40], v[40] = {0};
  cav_configuration_reset(m, q);
  for (int j = 0; j < m->njoint; j++) {
    if (strstr(m->joint[j].name, "knee")) q[m->joint[j].q] = -1.2;
    if (strstr(m->joint[j].name, "hip")) q[m->joint[j].q] = 0.6;
  }
  q[0] = 3, q[1] = -5;
  CHECK(state && !cav_configuration_to_floor(m, state, NULL, q, NULL));
  // facing 0, 100 and 200 degrees
  for (int k = 0; k < 6; k++) {
    const int turns = k % 2;
    const double facing = k / 2 * M_PI / 1.8;
    q[3] = cos(facing / 2), q[6] = sin(facing / 2);
    memcpy(goal, q, sizeof goal);
    if (turns) goal[3] = cos(facing / 2 + M_PI / 4), goal[6] = sin(facing / 2 + M_PI / 4);
    goal[0] += turns ? 0 : cos(facing), goal[1] += turns ? 0 : sin(facing);
    cav_problem p = cav_problem_default(m);
    p.q_start = q, p.v_start = v, p.q_goal = goal;
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK);
    // feet that turn where they stand are nobody's: the straight way comes later
    const cav_strategy *gait = strategy_find(strategy, n, turns ? "stated" : "swing");
    if (!CHECK(gait && gait->nswing == (turns ? 4 : 8) && gait->ground)) continue;
    CHECK(gait->stated == 0 && !strategy_find(strategy, n, "line") == !turns);
    CHECK(gait < strategy_find(strategy, n, "soft") && gait->schedule.solids == CAV_SOLIDS_HARD);
    const char *const joint = turns ? "knee_%s_%s" : "hip_%s_%s", *const end[2] = {"front", "back"},
                      *const side[2] = {"left", "right"};
    double phase[2][2] = {{0}};
    for (int a = 0; a < 4; a++) {
      char name[40];
      snprintf(name, sizeof name, joint, end[a / 2], side[a % 2]);
      const cav_swing *s = swing_of(m, gait, name);
      if (CHECK(s != NULL)) phase[a / 2][a % 2] = s->phase;
      CHECK(!turns || (s && s->amplitude < 0));
    }
    // the way it faces, not the way the world's axes point
    const cav_swing *hip = swing_of(m, gait, "hip_front_left");
    if (!turns && CHECK(hip != NULL)) CHECK(hip->amplitude < 0);
    CHECK_NEAR(cos(phase[0][0] - phase[1][1]), 1, 1e-12);
    CHECK_NEAR(cos(phase[0][1] - phase[1][0]), 1, 1e-12);
    CHECK_NEAR(cos(phase[0][0] - phase[0][1]), -1, 1e-12);
  }
  cav_state_free(state);
  cav_model_free(m);
}

// under the order of momentum one strategy goes by the midpoint order, and ends under the order that was asked for
static void check_order(cav_problem *p) {
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  p->order = CAV_ORDER_MOMENTUM;
  CHECK(offers(p,
               "stated near-1 near-2 near-3 near-4 midpoint posture sample near-5 near-6 fine near-7 near-8 "
               "soft hold slow resample near-9 near-10 near-11 near-12 near-13 near-14 repair-1 repair-2 "
               "repair-3 repair-4 open longer stronger"));
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  cav_solution *straight = NULL, *round = NULL;
  runs = first_stall = last_stall = 0;
  CHECK(cav_strategy_solve(p, &strategy[0], NULL, NULL, &straight, NULL) == CAV_OK);
  int before = runs;
  CHECK(cav_strategy_solve(p, strategy_find(strategy, n, "midpoint"), NULL, NULL, &round, NULL) == CAV_OK);
  if (CHECK(straight && round)) {
    // both solves count, and the second one starts late in the schedule
    CHECK(straight->contact.order == CAV_ORDER_MOMENTUM && round->contact.order == CAV_ORDER_MOMENTUM);
    CHECK(runs - before > before && round->iterations > round->nprogress);
    CHECK(round->nstage > 10 && round->stage[0].stages == 10);
    // one convex motion: the same minimum
    printf("costs differ by %.1g\n", fabs(round->cost / straight->cost - 1));
    CHECK_NEAR(round->cost, straight->cost, 1e-6 * straight->cost);
  }
  cav_strategies_clear(strategy, n);
  cav_solution_free(straight);
  cav_solution_free(round);
  p->order = CAV_ORDER_MIDPOINT;
}

// a ball on a slide that is lifted; stages that stall with rows that are off are reached half way, at most three times
static void test_stalls(void) {
  cav_model *m = scene_load(
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .1'>"
      "<joint name='lift' type='slide' axis='0 0 1'/><geom type='sphere' size='.1' mass='1'/>"
      "</body></worldbody><actuator><motor joint='lift' gear='50' ctrllimited='true' "
      "ctrlrange='-1 1'/></actuator></mujoco>");
  if (!CHECK(m != NULL)) return;
  double q = 0, goal = 0.2, v = 0;
  cav_term terms[20];
  cav_problem p = cav_problem_default(m);
  p.q_start = &q, p.v_start = &v, p.q_goal = &goal;
  p.duration = 0.5;
  p.term = terms, p.nterm = cav_problem_default_terms(terms, 20);
  p.schedule.stages = 5;
  // what the third stage becomes: how many times it is taken back, and the fractions of the way that follow
  static const struct {
    int stalls, off, again;
    double fraction[8];
  } cases[] = {{0, 0, 0, {0.5, 0.75, 1}},
               {1, 0, 0, {0.5, 0.75, 1}},
               {1, 1, 1, {0.5, 0.375, 0.5, 0.75, 1}},
               {2, 1, 2, {0.5, 0.375, 0.3125, 0.5, 0.75, 1}},
               {4, 1, 3, {0.5, 0.375, 0.3125, 0.28125, 0.5, 0.75, 1}}};
  for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
    cav_solution *s = NULL;
    runs = 0, first_stall = 3, last_stall = 2 + cases[c].stalls, rows_are_off = cases[c].off;
    CHECK(cav_solve(&p, NULL, NULL, &s, NULL) == CAV_OK && s && s->unactuated < 1e-6);
    int again = 0, iterations = 0;
    for (int i = 0; s && i < s->nstage; i++) {
      again += s->stage[i].outcome == CAV_OUTCOME_AGAIN;
      iterations += s->stage[i].iterations;
      double fraction = i >= 2 && i < 10 ? cases[c].fraction[i - 2] : 0;
      if (fraction > 0)
        CHECK(!strcmp(s->stage[i].phase, "continuation") && fabs(s->stage[i].fraction - fraction) < 1e-12);
    }
    CHECK(s && again == cases[c].again && iterations == s->iterations);
    cav_solution_free(s);
  }
  check_order(&p);
  cav_model_free(m);
}

// a height that is asked for above the way from start to goal: an arc about that time, ballistic
static void test_leap(void) {
  cav_model *m = scene_load(BIPED("1"));
  if (!CHECK(m != NULL)) return;
  double q[20], v[20] = {0}, target[3] = {0, 0, 0};
  cav_configuration_reset(m, q);
  cav_state *state = cav_state_new(m);
  cav_term term = {.name = "apex", .from = 1, .to = 1, .weight = 900, .scale = 1, .component = 2, .target = target};
  term.sensor =
      (cav_sensor){.name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = 1, .dim = 3};
  cav_problem p = cav_problem_default(m), taken;
  p.q_start = p.q_goal = q, p.v_start = v, p.term = &term, p.nterm = 1, p.duration = 2;
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(state && cav_position(m, state, q) == CAV_OK);
  cav_sensor_read(m, state, &term.sensor, target);
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK && !strategy_find(strategy, n, "leap"));
  target[2] += 0.3;
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK);
  const cav_strategy *leap = strategy_find(strategy, n, "leap");
  if (CHECK(leap != NULL)) {
    cav_strategy_apply(&p, leap, &taken);
    CHECK_NEAR(taken.guess_height, 0.3, 1e-12);
    CHECK_NEAR(taken.guess_to - taken.guess_from, 2 * sqrt(2 * 0.3 / 9.81), 1e-12);
    CHECK_NEAR(taken.guess_to + taken.guess_from, 2, 1e-12);
  }
  cav_state_free(state);
  cav_model_free(m);
}

// clear of the wall, all of the way within the arc, about that time
static void check_flight(const cav_problem *p, const cav_strategy *flight, double least, double middle) {
  cav_problem taken;
  int collides = 1;
  if (!CHECK(flight && flight->flies)) return;
  cav_strategy_apply(p, flight, &taken);
  CHECK(taken.nguess_pose == 2 && taken.guess_pose[0].q == p->q_start && taken.guess_pose[1].q == p->q_goal);
  CHECK(taken.guess_pose[0].time == taken.guess_from && taken.guess_pose[1].time == taken.guess_to);
  CHECK(taken.guess_height > least && taken.schedule.solids == CAV_SOLIDS_HARD);
  CHECK_NEAR((taken.guess_from + taken.guess_to) / 2, middle, 1e-12);
  CHECK(cav_guess_collides(&taken, &collides) == CAV_OK && !collides);
}

// a wall in the way: over it with wide steps, then as stated, both with solids that grow, and what they miss is mended first;
// where the file has no guess the first is the one over it
static void test_solids(void) {
  static const char head[] = "<mujoco><compiler angle='degree'/>",
                    wall[] = "<geom type='box' pos='.5 0 .2' size='.1 1 .2'/>";
  const char *biped = BIPED("1"), *world = strstr(biped, "<body");
  char text[4000];
  CHECK(!strncmp(biped, head, sizeof head - 1));
  snprintf(text, sizeof text, "%.*s%s%s", (int)(world - biped), biped, wall, world);
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  double q[20], goal[20], v[20] = {0};
  cav_configuration_reset(m, q);
  memcpy(goal, q, sizeof goal);
  goal[0] += 1;
  cav_problem p = cav_problem_default(m), taken;
  p.q_start = q, p.v_start = v, p.q_goal = goal;
  CHECK(offers(&p,
               "stated near-1 near-2 near-3 near-4 solids near-5 near-6 flight near-7 near-8 fine near-9 "
               "near-10 repair-1 repair-2 repair-3 repair-4 soft hold slow momentum near-11 near-12 near-13 "
               "near-14 open longer stronger"));
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK && !strategy[0].stated);
  for (int i = 0; i < n; i++)
    CHECK(strategy[i].use == CAV_STRATEGY_NEAR || strategy[i].flies || strategy[i].schedule.solids == CAV_SOLIDS_GROW);
  check_flight(&p, strategy_find(strategy, n, "flight"), 0.3, p.duration / 2);
  cav_strategy_apply(&p, &strategy[0], &taken);
  CHECK(taken.nswing == 4 && taken.swing[0].amplitude * taken.swing[0].amplitude > 0.1);
  p.guess_rotation[2] = 0.1;
  CHECK(offers(&p,
               "stated near-1 near-2 near-3 near-4 step near-5 near-6 solids near-7 near-8 fine near-9 near-10 "
               "repair-1 repair-2 repair-3 repair-4 soft line hold slow momentum near-11 near-12 near-13 "
               "near-14 open longer stronger"));
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK && strategy[0].schedule.solids == CAV_SOLIDS_HARD);
  cav_strategy_apply(&p, strategy_find(strategy, n, "step"), &taken);
  CHECK(taken.nswing == 4 && taken.schedule.solids == CAV_SOLIDS_GROW);
  p.guess_rotation[2] = 0;
  // an arc that is stated says that it flies, at its time, as high as it takes
  p.guess_height = 0.1, p.guess_from = 0.5, p.guess_to = 0.9;
  CHECK(cav_strategy_list(&p, strategy, &n) == CAV_OK && !strcmp(strategy[5].name, "flight"));
  check_flight(&p, &strategy[5], 0.3, 0.7);
  // a file that states the flight that would be found has no other
  cav_strategy_apply(&p, &strategy[5], &taken);
  cav_strategy others[CAV_STRATEGIES];
  int rest;
  CHECK(cav_strategy_list(&taken, others, &rest) == CAV_OK && !strategy_find(others, rest, "flight") &&
        strategy_find(others, rest, "fine"));
  cav_strategies_clear(others, rest);
  p.guess_height = 0;
  // where it stops before the wall nothing is in the way
  goal[0] -= 0.8;
  CHECK(offers(&p,
               "stated near-1 near-2 near-3 near-4 fine near-5 near-6 soft hold slow momentum near-7 near-8 "
               "near-9 near-10 repair-1 repair-2 repair-3 repair-4 open longer stronger"));
  cav_model_free(m);
}

// waypoints of another body: joints that it would have beyond its ranges are left as at the start, in all of them, and the
// rest stays as asked; on a body that has the room there is no such guess
static void test_left(void) {
  static const char *const range[] = {"-30 50", "-30 95"};
  char folder[] = "/tmp/cavort-strategies-XXXXXX", path[100], model[100], text[1000];
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  snprintf(path, sizeof path, "%s/p.xml", folder);
  snprintf(model, sizeof model, "%s/m.xml", folder);
  scene_write(
      folder, "p.xml",
      "<problem model='m.xml'><horizon duration='1' timestep='.05'/><start><joint name='a' degrees='10'/></start>"
      "<guess><waypoint time='.3' ranges='clip'><joint name='a' degrees='40'/><joint name='b' degrees='60'/></waypoint>"
      "<waypoint time='.6' ranges='clip'><joint name='a' degrees='90'/></waypoint></guess></problem>");
  for (int roomy = 0; roomy < 2; roomy++) {
    snprintf(text, sizeof text,
             "<mujoco><compiler angle='degree'/><worldbody><body pos='0 0 1'>"
             "<joint name='a' axis='0 1 0' limited='true' range='%s'/>"
             "<geom type='capsule' size='.05' fromto='0 0 0 0 0 -.4'/><body pos='0 0 -.4'>"
             "<joint name='b' axis='0 1 0' limited='true' range='0 120'/>"
             "<geom type='capsule' size='.05' fromto='0 0 0 0 0 -.4'/></body></body></worldbody>"
             "<actuator><motor joint='a'/></actuator></mujoco>",
             range[roomy]);
    scene_write(folder, "m.xml", text);
    cav_error error = {0};
    cav_problem *p = cav_problem_load(path, NULL, &error), taken;
    if (!CHECK(p != NULL && p->nguess_pose == 2)) fprintf(stderr, "    %s\n", error.text);
    if (!p) continue;
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && (strategy_find(strategy, n, "clipped") == NULL) == roomy);
    CHECK((p->guess_left == NULL) == roomy && strategy->left == !roomy);
    CHECK(roomy || (!strcmp(strategy[5].name, "clipped") && !strategy[5].left));
    if (!roomy) {
      cav_strategy_apply(p, strategy, &taken);
      CHECK(taken.nguess_pose == 2 && taken.guess_pose[0].time == 0.3 && taken.guess_pose[1].time == 0.6);
      for (int i = 0; i < 2; i++) CHECK_NEAR(taken.guess_pose[i].q[0], 10 * M_PI / 180, 1e-15);
      CHECK_NEAR(taken.guess_pose[0].q[1], 60 * M_PI / 180, 1e-15);
      CHECK_NEAR(p->guess_pose[1].q[0], 50 * M_PI / 180, 1e-15);
    }
    cav_problem_free(p);
  }
  unlink(path), unlink(model), rmdir(folder);
}

// a cycle is mended and repaired like other motions
static void test_cycle(void) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/quadruped-trot/problem.xml", NULL, &error);
  if (!CHECK(p != NULL)) return;
  CHECK(p->cycle.on);
  CHECK(offers(p,
               "stated near-1 near-2 near-3 near-4 calm near-5 near-6 soft slow momentum near-7 near-8 near-9 near-10 "
               "repair-1 repair-2 repair-3 repair-4 stronger"));
  cav_strategy stated = {.name = "stated", .stated = 1, .order = p->order, .schedule = p->schedule}, mended;
  const cav_verdict slides = {.slip_mean_m_s = 0.0105, .closed_loop_seconds = p->duration};
  int found = 0;
  CHECK(cav_strategy_repair(p, &stated, &slides, 0, &mended, &found) == CAV_OK);
  if (CHECK(found)) CHECK(mended.schedule.last.smoothing < p->schedule.last.smoothing);
  if (found) cav_strategy_clear(&mended);
  cav_problem_free(p);
}

// aside a humanoid, whose front is not as its back, goes with legs that bend in turn and do not swing
static void test_aside(void) {
  cav_problem *p =
      strategy_problem("<problem name='aside' model='" CAVORT_SOURCE_ROOT
                       "/problems/models/humanoid.xml'><horizon duration='2'/><start key='stand' height='floor'/>"
                       "<goal key='stand' height='floor'><root pos='0 0.9 1.34'/></goal></problem>");
  if (!p) return;
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  const cav_strategy *gait = strategy_find(strategy, n, "swing");
  if (CHECK(gait && gait->nswing == 2)) {
    const int right = cav_object_find(p->model, CAV_OBJECT_JOINT, "knee_right"),
              left = cav_object_find(p->model, CAV_OBJECT_JOINT, "knee_left");
    const cav_swing *s = gait->swing;
    CHECK((s[0].joint == right && s[1].joint == left) || (s[0].joint == left && s[1].joint == right));
    // both bend as knees do, half a period apart
    CHECK(s[0].amplitude < 0 && s[1].amplitude < 0 && fabs(fabs(s[1].phase - s[0].phase) - M_PI) < 1e-12);
  }
  cav_strategies_clear(strategy, n);
  cav_problem_free(p);
}

// a ball rolls on a beam that is tipped under it: nothing is brought to the side of what is borne, and no usual cost holds its
// spin; one that is let fall on the beam is led as before
static void test_borne(void) {
  static const char model[] =
      "<mujoco><worldbody><body pos='0 0 1'><joint name='beam' axis='0 1 0' range='-30 30' limited='true' "
      "damping='.05'/><geom type='box' size='.8 .05 .01' mass='1'/></body><body pos='0 0 %g'>"
      "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
      "<joint name='spin' axis='0 1 0'/><geom size='.05' mass='.2'/></body></worldbody>"
      "<actuator><motor joint='beam' ctrllimited='true' ctrlrange='-10 10'/></actuator></mujoco>";
  static const char problem[] =
      "<problem name='ball' model='m.xml'><horizon duration='2' timestep='0.02'/><start><joint name='x' "
      "pos='-.4'/></start>"
      "<goal><joint name='x' pos='-.3'/></goal><cost>"
      "<sensor name='there' type='jointpos' joint='x' target='-.3' at='end' weight='2000' within='.02'/>"
      "<velocity dofs='all' at='end' weight='100' within='.1'/></cost></problem>";
  char folder[] = "/tmp/cavort_ball_XXXXXX", path[100], text[1000];
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  scene_write(folder, "p.xml", problem);
  for (int falls = 0; falls < 2; falls++) {
    snprintf(text, sizeof text, model, falls ? 1.2 : 1.06);
    scene_write(folder, "m.xml", text);
    snprintf(path, sizeof path, "%s/p.xml", folder);
    cav_error error = {0};
    cav_problem *p = cav_problem_load(path, NULL, &error);
    if (!CHECK(p != NULL)) break;
    cav_strategy strategy[CAV_STRATEGIES];
    cav_solution *solution = NULL;
    cav_verdict v;
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && strategy[0].hand == falls);
    if (!falls && CHECK(cav_strategy_solve(p, &strategy[0], NULL, NULL, &solution, &error) == CAV_OK)) {
      const cav_trajectory *at = solution->trajectory;
      const double *end = at->q + (size_t)(at->nknot - 1) * (size_t)at->nq;
      CHECK(cav_verify_solution(p, solution, &v, &error) == CAV_OK && v.certified && v.achieved);
      // it rolls: spin is the way over the radius but for what beam and ball slip, and a tilt of a twentieth does that
      CHECK(fabs(0.05 * end[3] - (end[1] + 0.4)) < 0.01 && solution->cost < 0.1);
    }
    cav_solution_free(solution);
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
  unlink(path);
  snprintf(path, sizeof path, "%s/m.xml", folder);
  unlink(path);
  rmdir(folder);
}

/// The cost on forces of a bar is three tenths of itself at first and whole in the end, that of all contacts whole throughout.
static void test_lightened(void) {
  for (int bar = 0; bar < 2; bar++) {
    char text[1000];
    snprintf(
        text, sizeof text,
        "<problem name='bar' model='" CAVORT_SOURCE_ROOT
        "/problems/models/humanoid.xml'><scene><body name='bar'><geom name='bar' type='box' pos='.1 0 .01' size='.1 1 "
        ".01'/></body></scene><horizon duration='.2' timestep='.02'/><start key='stand' height='floor' rise='.015'/>"
        "<cost><force %s weight='100'/></cost></problem>",
        bar ? "body='bar'" : "");
    cav_problem *p = strategy_problem(text);
    cav_error error = {0};
    cav_trajectory *at = p ? cav_problem_guess(p, &error) : NULL;
    if (!CHECK(at != NULL)) return;
    cav_strategy strategy[CAV_STRATEGIES];
    int n, last = 0;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    const cav_strategy *avoid = strategy_find(strategy, n, "avoid");
    CHECK((avoid != NULL) == bar && !p->schedule.light_avoided);
    if (avoid) CHECK(avoid->schedule.light_avoided && !strcmp(avoid->changed, "light_avoided=\"true\""));
    cav_strategies_clear(strategy, n);
    for (int i = 0; i < p->nterm; i++)
      if (p->term[i].quantity == CAV_QUANTITY_FORCE) last = i;
    CHECK(p->term[last].weight == 100 && (p->term[last].body > 0) == bar);
    const int all = p->nterm;
    p->term += last, p->nterm = 1;
    p->schedule.light_avoided = 1;
    cav_transcription *tr = cav_transcription_new(p, 1, &error);
    double cost[2];
    for (int k = 0; k < 2 && CHECK(tr != NULL); k++) {
      cav_stage_set(p, 0, tr);
      CHECK_NEAR(tr->lightened, 0.7, 1e-12);
      if (k) tr->lightened = 0;
      CHECK(cav_transcription_values(tr, at) == CAV_OK);
      cost[k] = cav_transcription_cost(tr);
    }
    CHECK(cost[1] > 0);
    CHECK_NEAR(cost[0] / cost[1], bar ? 0.3 : 1, 1e-12);
    cav_stage_set(p, 1, tr);
    CHECK(tr->lightened == 0);
    cav_transcription_free(tr);
    p->term -= last, p->nterm = all;
    cav_trajectory_free(at);
    cav_problem_free(p);
  }
}

/// Costs on the turning of the root over the motion weigh 40 times at first, four times just before the last stage and once in
/// that; one at the end, or on other dofs, always once.
static void test_calmed(void) {
  static const char *const terms[] = {"<velocity dofs='root_angular' weight='2'/>",
                                      "<velocity dofs='root_angular' at='.1' weight='2'/>",
                                      "<velocity dofs='all' weight='2'/>"};
  for (int i = 0; i < 3; i++) {
    char text[1000];
    snprintf(text, sizeof text,
             "<problem name='turn' model='" CAVORT_SOURCE_ROOT
             "/problems/models/humanoid.xml'><horizon duration='.2' timestep='.02'/><start key='stand' height='floor'/>"
             "<goal key='stand' height='floor'><root euler='0 0 30'/></goal><cost>%s</cost>"
             "<schedule calm='true'/></problem>",
             terms[i]);
    cav_problem *p = strategy_problem(text);
    cav_error error = {0};
    cav_trajectory *at = p ? cav_problem_guess(p, &error) : NULL;
    if (!CHECK(at != NULL && p->schedule.calm)) return;
    int one = 0;
    for (int k = 0; k < p->nterm; k++)
      if (p->term[k].weight == 2) one = k;
    const int all = p->nterm;
    p->term += one, p->nterm = 1;
    cav_transcription *tr = cav_transcription_new(p, 1, &error);
    static const double way[] = {0, 1 - 1e-12, 1}, times[] = {40, 4, 1};
    double cost[3] = {0};
    for (int k = 0; k < 3 && CHECK(tr != NULL); k++) {
      cav_stage_set(p, way[k], tr);
      CHECK(cav_transcription_values(tr, at) == CAV_OK);
      cost[k] = cav_transcription_cost(tr);
    }
    CHECK(i == 1 || cost[2] > 0);
    for (int k = 0; k < 3; k++) CHECK_NEAR(cost[k], (i ? 1 : times[k]) * cost[2], 1e-9 * cost[2]);
    cav_transcription_free(tr);
    p->term -= one, p->nterm = all;
    cav_trajectory_free(at);
    cav_problem_free(p);
  }
}

int main(void) {
  test_lightened();
  test_calmed();
  test_through_ground();
  test_upright();
  test_cycle();
  test_left();
  test_gait(BIPED("1"), 1, 2);
  test_gait(BIPED("1"), 1, -2);
  test_gait(BIPED("-1"), -1, 2);
  test_four_legs();
  test_stalls();
  test_leap();
  test_solids();
  test_aside();
  test_borne();
  return check_result();
}
