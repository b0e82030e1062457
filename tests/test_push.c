/// What no actuator moves and is wanted elsewhere along the ground (solver/hand.c): where a ball has to be brought to push a
/// block, against its closed form, and problems stated in a minute each, tests/pushing, whose stated guess ends at a
/// motion that stands still, certified by the strategy that brings it there first: seven of a body that has to be pushed, two
/// of a touch sensor that is to feel a force, which it has no derivative for until something touches. Where both hands of a
/// humanoid come to a crate, a carton and a door (solver/carry.c), and the carton lifted.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "carry.h"
#include "cavort/cavort.h"
#include "hand.h"
#include "strategy.h"

static cav_problem *load(const char *name) {
  char path[300];
  cav_error error = {0};
  snprintf(path, sizeof path, CAVORT_SOURCE_ROOT "/tests/pushing/%s.xml", name);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "%s\n", error.text);
  return p;
}

/// A block of 0.1 x 0.1 x 0.04 m, a ball of 2 cm: through the middle of the block, against the way, 5 mm over the ground.
static void test_place(void) {
  const struct {
    const char *name;
    double out, way[2]; ///< m from the middle to the face along the way, and its unit direction
  } problem[] = {{"ahead", 0.05, {1, 0}},
                 {"across", 0.05 / 0.8, {0.8, 0.6}},
                 {"behind", 0.05 * sqrt(5) / 2, {-0.1 / sqrt(0.05), 0.2 / sqrt(0.05)}},
                 {"slid", 0.05, {0.8, 0.6}}};
  for (int i = 0; i < 4; i++) {
    cav_problem *p = load(problem[i].name);
    if (!p) continue;
    for (int leans = 0; leans < 2; leans++) {
      const double away = leans ? 0.7 : 1, far = problem[i].out + away * 0.02;
      cav_hand hand;
      CHECK(cav_hand_find(p, away, &hand) == CAV_OK && hand.found);
      CHECK(hand.term[0].sensor.object_type == CAV_OBJECT_GEOM &&
            !strcmp(p->model->geom[hand.term[0].sensor.object].name, "tip"));
      for (int k = 0; k < 2; k++) CHECK_NEAR(hand.place[k], -far * problem[i].way[k], 1e-12);
      CHECK_NEAR(hand.place[2], 0.005, 1e-12);
      CHECK_NEAR(hand.term[0].from, 0.3 * p->duration, 1e-12);
    }
    cav_problem_free(p);
  }
}

/// The same place where its components are asked for one by one.
static void test_components(void) {
  cav_problem *p = load("across");
  if (!p) return;
  cav_hand whole, hand;
  cav_term term[40];
  int n = p->nterm, at = 0;
  CHECK(n < 39 && cav_hand_find(p, 1, &whole) == CAV_OK && whole.found);
  memcpy(term, p->term, (size_t)n * sizeof *term);
  while (at < n - 1 && term[at].quantity != CAV_QUANTITY_SENSOR) at++;
  term[n] = term[at];
  term[at].component = 1, term[n].component = 0;
  cav_problem split = *p;
  split.term = term, split.nterm = n + 1;
  CHECK(cav_hand_find(&split, 1, &hand) == CAV_OK && hand.found);
  for (int k = 0; k < 3; k++) CHECK_NEAR(hand.place[k], whole.place[k], 1e-15);
  // up alone is no push
  term[at].component = term[n].component = 2;
  CHECK(cav_hand_find(&split, 1, &hand) == CAV_OK && !hand.found);
  cav_problem_free(p);
}

static void test_pushed(const char *name, const char *by, double most) {
  cav_problem *p = load(name);
  if (!p) return;
  cav_strategy strategy[CAV_STRATEGIES];
  cav_solution *s = NULL;
  cav_verdict v = {0};
  cav_error error = {0};
  int n;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  const cav_strategy *push = strategy_find(strategy, n, by);
  // a hand leads it, also where it is what a file without a guess is begun with; one with a guess is begun by that
  CHECK(push && push->hand > 0);
  if (push == &strategy[0]) {
    cav_strategy other[CAV_STRATEGIES];
    int m;
    cav_problem held = *p;
    held.guess = CAV_GUESS_HOLD;
    const char *led = push->hand == 2 ? "carry" : "push";
    CHECK(cav_strategy_list(&held, other, &m) == CAV_OK && !other[0].hand && strategy_find(other, m, led));
    cav_strategies_clear(other, m);
    // what leads no hand is tried later
    CHECK(!strategy_find(strategy, n, led) && strategy_find(strategy, n, "line"));
  }
  if (push) CHECK(cav_strategy_solve(p, push, NULL, NULL, &s, &error) == CAV_OK);
  // its terms are no part of the problem: the cost is that of the file's own
  if (s) CHECK(!cav_verify_solution(p, s, &v, &error));
  printf("%s: cost %.4f, %d iterations, %s%s\n", name, v.cost, s ? s->iterations : 0,
         v.certified ? "certified" : "not certified: ", v.reason);
  CHECK(v.certified && v.achieved && v.cost < most);
  cav_strategies_clear(strategy, n);
  cav_solution_free(s);
  cav_problem_free(p);
}

/// The tip of an arm to the near face of a wall, which a sensor of the wall or of the tip is to feel: a box's face at y = -0.15,
/// below a ball of 18 mm, in its sensor's window; where a term says where the tip is, there.
static void test_touched(void) {
  for (int k = 0; k < 2; k++) {
    cav_problem *p = load(k ? "feel" : "press");
    if (!p) continue;
    cav_hand hand;
    CHECK(cav_hand_find(p, 1, &hand) == CAV_OK && hand.found == 1 && hand.touches);
    CHECK(!strcmp(p->model->geom[hand.term[0].sensor.object].name, "tip"));
    CHECK_NEAR(hand.place[0], -0.45 + 0.3 * cos(70 * M_PI / 180) + 0.25 * cos(-70 * M_PI / 180), 1e-9);
    CHECK_NEAR(hand.place[1], -0.15 + 0.018, 1e-12);
    CHECK(hand.term[0].from == 0.8 && hand.term[0].to == 1.2);
    cav_problem_free(p);
  }
}

/// Both hands of a humanoid: at the back of a crate, a quarter of a metre deep with a friction of 0.8 on the floor, at nine
/// tenths of the height from which it would tip, the right one to the right of the way; of a carton 28 cm wide at the middle
/// of its sides. They lean on it by 0.3 of their thickness.
static void test_both(void) {
  for (int i = 0; i < 2; i++) {
    cav_problem *p = load(i ? "carton" : "crate");
    if (!p) continue;
    cav_carry c, leans;
    CHECK(cav_carry_find(p, 1, &c) == CAV_OK && c.found && c.lifts == i && c.over == 0);
    CHECK(cav_carry_find(p, 0.7, &leans) == CAV_OK && leans.found == c.found);
    const int out = i; // the axis along which they press
    for (int k = 0; k < 2; k++) {
      const cav_geom *geom = &p->model->geom[c.term[k].sensor.object];
      const double side = i && k ? 1 : -1, face = i ? 0.14 : 0.25;
      CHECK(strstr(p->model->body[geom->body].name, k ? "left" : "right") != NULL);
      const double thick = side * c.place[k][out] - face;
      CHECK(thick > 0 && thick <= geom->bound);
      CHECK_NEAR(side * leans.place[k][out] - face, 0.7 * thick, 1e-9);
      CHECK_NEAR(c.place[k][2], i ? 0 : 0.001 + 0.9 * 0.25 / 0.8 - 0.451, 1e-9);
      if (i) CHECK_NEAR(c.place[k][0], 0, 1e-9);
      if (!i) CHECK((k ? 1 : -1) * c.place[k][1] > 0.1 && fabs(c.place[k][1]) <= 0.3);
      CHECK(c.term[k].from > 0 && c.term[k].from < c.term[k].to && c.term[k].to == p->duration);
    }
    // the body follows the crate by what arms do not reach; the carton stays in reach
    CHECK(i ? c.go[0] == 0 : c.go[0] > 0.1 && c.go[0] <= 0.3);
    CHECK_NEAR(c.go[1], 0, 1e-12);
    // towards the body, it would be pulled
    double target[3] = {0.45, 0, 0.451};
    cav_term term[40];
    CHECK(p->nterm <= 40);
    memcpy(term, p->term, (size_t)p->nterm * sizeof *term);
    for (int k = 0; k < p->nterm; k++)
      if (!strcmp(term[k].name, "crate on")) term[k].target = target;
    cav_problem pulled = *p;
    pulled.term = term;
    if (!i) CHECK(cav_carry_find(&pulled, 1, &c) == CAV_OK && !c.found);
    cav_problem_free(p);
  }
}

/// A door of 0.9 m on a hinge that is 0.5 m to the left: it goes to where its joint is asked for, and both hands to its face, as
/// high as they hang, its own thickness and theirs from its middle; one hand alone has no term that keeps it from tumbling.
static void test_door(void) {
  cav_problem *p = load("../unseen/door-hinged");
  if (!p) return;
  const int door = cav_object_find(p->model, CAV_OBJECT_JOINT, "door"), at = p->model->joint[door].q;
  cav_carry c;
  CHECK(cav_carry_find(p, 1, &c) == CAV_OK && c.found == 4 && !c.lifts && c.thing == door);
  CHECK_NEAR(c.angle, 0.785, 1e-12);
  for (int k = 0; k < 2; k++) {
    const double thick = -c.place[k][0] - 0.02;
    CHECK(thick > 0 && thick <= p->model->geom[c.term[k].sensor.object].bound);
    CHECK_NEAR(c.place[k][1], -0.45 + (k ? 1 : -1) * fabs(c.place[1][1] - c.place[0][1]) / 2, 0.05);
  }
  const double turned[2] = {0.45 * sin(0.785), 0.45 * (1 - cos(0.785))};
  for (int k = 0; k < 2; k++) CHECK_NEAR(c.there[k] - c.still[k], turned[k], 1e-12);
  CHECK_NEAR(c.still[0], 0.55, 1e-12);
  CHECK_NEAR(c.still[1], 0.05, 1e-12);
  double *q = malloc(CAV_CARRY_POSES * (size_t)p->model->nq * sizeof *q);
  cav_guess_pose pose[CAV_CARRY_POSES];
  if (q) {
    CHECK(cav_carry_poses(p, &c, q, pose) == 2);
    CHECK(pose[0].q[at] == p->q_start[at] && pose[1].q[at] == c.angle);
  }
  free(q);
  cav_hand hand;
  CHECK(cav_hand_find(p, 1, &hand) == CAV_OK && hand.hung && hand.found == 3);
  // the hand that the touch sensor is to feel
  CHECK_TEXT(p->model->geom[hand.term[0].sensor.object].name, "hand_right");
  CHECK(hand.term[1].sensor.object_type == CAV_OBJECT_BODY && hand.term[1].to == hand.term[0].from);
  // its joints are wanted elsewhere at the end: it leaves the door where that is to be then
  CHECK_NEAR(hand.term[0].to, 0.7 * 3, 1e-12);
  CHECK(hand.term[2].from == hand.term[0].to && hand.term[2].to == 3);
  for (int k = 0; k < 3; k++) CHECK_NEAR(hand.there[k], c.there[k], 1e-12);
  // the same door asked for by the place of its middle, not by its joint, is pushed as any other thing
  cav_term term[40];
  double place[3] = {c.there[0], c.there[1], c.there[2]};
  CHECK(p->nterm <= 40);
  memcpy(term, p->term, (size_t)p->nterm * sizeof *term);
  for (int k = 0; k < p->nterm; k++)
    if (term[k].sensor.type == CAV_SENSOR_JOINTPOS) {
      term[k].sensor = (cav_sensor){.name = "", .type = CAV_SENSOR_FRAMEPOS, .dim = 3, .object_type = CAV_OBJECT_BODY};
      term[k].sensor.object = cav_object_find(p->model, CAV_OBJECT_BODY, "door");
      term[k].component = -1, term[k].target = place;
    }
  cav_problem placed = *p;
  placed.term = term;
  CHECK(cav_hand_find(&placed, 1, &hand) == CAV_OK && hand.found == 4 && !hand.hung);
  cav_problem_free(p);
}

/// How deep the links that stand are in a table, with the root aside by a way along x, m.
static double depth_in_table(const cav_problem *p, double aside) {
  const cav_model *m = p->model;
  const int table = cav_object_find(m, CAV_OBJECT_GEOM, "table");
  cav_state *state = cav_state_new(m);
  double *q = malloc((size_t)m->nq * sizeof *q), deepest = 0;
  if (CHECK(state && q && table >= 0)) {
    memcpy(q, p->q_start, (size_t)m->nq * sizeof *q);
    q[0] += aside;
    CHECK(cav_position(m, state, q) == CAV_OK);
    for (int i = 0; i < state->ncontact; i++) {
      const cav_pair *pair = &m->pair[state->contact[i].pair];
      const int other = pair->geom1 == table ? pair->geom2 : pair->geom2 == table ? pair->geom1 : -1;
      const char *body = other < 0 ? "box" : m->body[m->geom[other].body].name;
      if (strcmp(body, "box") && !strstr(body, "arm") && !strstr(body, "hand"))
        deepest = fmax(deepest, -state->contact[i].dist);
    }
  }
  cav_state_free(state);
  free(q);
  return deepest;
}

/// A box on the floor that is to stand on a table: hands lead it over the table's edge though its straight way runs into the
/// table and the humanoid turns, for which others are begun by a gait; the root stoops for it, and is kept at its height for one
/// on a table.
static void test_from_floor(void) {
  for (int high = 0; high < 2; high++) {
    cav_problem *p = load(high ? "../unseen/box-to-shelf" : "../../problems/examples/box-to-table");
    if (!p) continue;
    cav_strategy strategy[CAV_STRATEGIES];
    cav_carry c;
    int n;
    CHECK(cav_carry_find(p, 1, &c) == CAV_OK && c.lifts && c.over > 0 && c.found == 4 + high);
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && strategy[0].hand == 2);
    CHECK(high || strategy_find(strategy, n, "step"));
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
}

/// A ball to which a term brings a foot lies until then, and no hand is led to it; where the foot is asked for elsewhere one is.
static void test_met(void) {
  for (int away = 0; away < 2; away++) {
    cav_problem *p = load("../../problems/examples/kick");
    if (!p) continue;
    cav_strategy strategy[CAV_STRATEGIES];
    double target[3] = {0.05, -0.085, 0.1};
    for (int i = 0; i < p->nterm && away; i++)
      if (!strcmp(p->term[i].name, "foot at the ball")) p->term[i].target = target;
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    CHECK(strategy[0].met == (away ? 0 : 0.8) && strategy[0].hand == (away ? 2 : 0));
    const int ball = cav_object_find(p->model, CAV_OBJECT_BODY, "ball");
    CHECK(away || p->model->joint[strategy[0].moved].body == ball);
    CHECK(!away == (strategy_find(strategy, n, "push") != NULL));
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
}

/// A box far across a table: arms of 0.57 m do not reach it, and the body comes as near as the table lets it, in eighths of the
/// way. It is lifted straight up.
static void test_edge(void) {
  cav_problem *p = load("table");
  cav_carry c;
  if (!p) return;
  CHECK(cav_carry_find(p, 1, &c) == CAV_OK && c.found && c.lifts && c.over == 0);
  const int hand = c.term[0].sensor.object;
  cav_pose at, arm;
  cav_state *state = cav_state_new(p->model);
  if (CHECK(state && cav_position(p->model, state, p->q_start) == CAV_OK)) {
    cav_object_pose(p->model, state, CAV_OBJECT_GEOM, hand, &at);
    cav_object_pose(p->model, state, CAV_OBJECT_XBODY, cav_object_find(p->model, CAV_OBJECT_BODY, "upper_arm_right"),
                    &arm);
    // arms hang, nearly straight
    const double far = hypot(hypot(at.pos[0] - arm.pos[0], at.pos[1] - arm.pos[1]), at.pos[2] - arm.pos[2]);
    const double whole = 0.95 - p->q_start[0] - 0.9 * far;
    CHECK(whole > 0.3 && c.come[0] > 0 && c.come[0] < whole);
    CHECK_NEAR(c.come[1], 0, 1e-12);
    CHECK(depth_in_table(p, c.come[0]) <= 1e-3 && depth_in_table(p, c.come[0] + whole / 8) > 1e-3);
  }
  cav_state_free(state);
  cav_problem_free(p);
}

/// A box of 24 cm whose way along a table runs into a divider 6 cm high: it is led up by as much, less the centimetre that it may
/// graze, in steps of 2 cm; along; and down.
static void test_over(void) {
  cav_problem *p = load("../unseen/shift-box");
  cav_carry c;
  if (!p) return;
  CHECK(cav_carry_find(p, 1, &c) == CAV_OK && c.found && c.lifts && c.thing >= 0);
  CHECK_NEAR(c.over, 0.06, 1e-12);
  const int nq = p->model->nq, box = p->model->joint[c.thing].q;
  double *q = malloc(CAV_CARRY_POSES * (size_t)nq * sizeof *q);
  cav_guess_pose pose[CAV_CARRY_POSES];
  if (CHECK(q && cav_carry_poses(p, &c, q, pose) == 4)) {
    static const double y[] = {-0.22, -0.22, 0.22, 0.22}, z[] = {1.02, 1.08, 1.08, 1.02};
    for (int i = 0; i < 4; i++) {
      CHECK_NEAR(pose[i].q[box], 0.52, 1e-12);
      CHECK_NEAR(pose[i].q[box + 1], y[i], 1e-12);
      CHECK_NEAR(pose[i].q[box + 2], z[i], 1e-12);
      if (i) CHECK(pose[i].time > pose[i - 1].time && pose[i].time <= p->duration);
    }
  }
  free(q);
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && strategy[0].hand == 2);
  cav_strategies_clear(strategy, n);
  cav_problem_free(p);
}

/// A file that says nothing of hands is begun with both; one whose terms bring them there as it states.
static void test_begun(void) {
  for (int told = 0; told < 2; told++) {
    cav_error error = {0};
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    const char *file = told ? "/tests/unseen/carton-lift.xml" : "/tests/pushing/carton.xml";
    char path[300];
    snprintf(path, sizeof path, "%s%s", CAVORT_SOURCE_ROOT, file);
    cav_problem *p = cav_problem_load(path, NULL, &error);
    if (!CHECK(p != NULL)) continue;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    CHECK(strategy[0].hand == (told ? 0 : 2) && !strcmp(strategy[0].name, "stated"));
    const cav_strategy *carry = strategy_find(strategy, n, "carry");
    CHECK(told ? carry && carry->hand == 2 : !carry && strategy_find(strategy, n, "line"));
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
}

/// Nothing to push: a hopper alone.
static void test_none(void) {
  cav_error error = {0};
  cav_hand hand;
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/hop/problem.xml", NULL, &error);
  if (CHECK(p != NULL)) CHECK(cav_hand_find(p, 1, &hand) == CAV_OK && !hand.found);
  cav_carry carry;
  if (p) CHECK(cav_carry_find(p, 1, &carry) == CAV_OK && !carry.found);
  cav_problem_free(p);
  // one hand on a base that stands: no second one
  p = load("ahead");
  if (p) CHECK(cav_carry_find(p, 1, &carry) == CAV_OK && !carry.found);
  cav_problem_free(p);
}

int main(void) {
  test_place();
  test_components();
  test_touched();
  test_both();
  test_door();
  test_edge();
  test_from_floor();
  test_met();
  test_over();
  test_begun();
  test_none();
  static const struct {
    const char *name;
    double most; ///< cost
  } problem[] = {{"ahead", 0.12}, {"across", 0.12},  {"behind", 0.12}, {"turned", 0.12},
                 {"slid", 0.12},  {"straight", 0.3}, {"aside", 0.3}};
  for (size_t i = 0; i < sizeof problem / sizeof *problem; i++) test_pushed(problem[i].name, "stated", problem[i].most);
  test_pushed("press", "touch", 0.2), test_pushed("feel", "touch", 0.2), test_pushed("bear", "touch", 0.2);
  // a file without a guess is begun so
  test_pushed("carton", "stated", 1);
  return check_result();
}
