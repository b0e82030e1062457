/// optim/solver/guess.c: the held start, the way from start to goal, postures on the way, turns, arcs and swings, each
/// at its knots; what a problem file may not ask of a guess; and guesses that go round, under or over what is in the way.
#include <unistd.h>

#include "check.h"
#include "clear.h"
#include "continuation.h"
#include "strategy.h"

static char folder[] = "/tmp/cavort-guess-XXXXXX";
static char path[128], model_path[128], motion_path[128];

static const char model[] =
    "<mujoco model='m'><worldbody><geom type='plane' size='1 1 1'/><body name='a' pos='0 0 1'><freejoint/>"
    "<geom type='sphere' size='.1'/><body name='b' pos='0 0 .3'><joint name='knee' axis='0 1 0' limited='true' "
    "range='-90 10'/><geom type='sphere' size='.1'/></body></body></worldbody></mujoco>";

#define HEAD                                                                                   \
  "<problem model='m.xml'>\n<horizon duration='1' timestep='.1'/>\n<start><root pos='0 0 2'/>" \
  "</start>\n<goal><root pos='1 0 2' euler='0 0 90'/></goal>\n"
#define TAIL "\n</problem>\n"
#define POSES                                                                                           \
  "<pose name='bent'><root pos='0 3 5' euler='0 60 0'/><joint name='knee' pos='-1'/></pose>\n<guess>\n" \
  "<waypoint time='.2' key='bent' height='floor'/>\n<waypoint time='.6' key='bent'/></guess>"

/// The guess of a problem as trajectory; NULL and a failed check where there is none.
static cav_trajectory *guess(const char *text, cav_problem **problem) {
  cav_error error = {0};
  scene_write(folder, "p.xml", text);
  *problem = cav_problem_load(path, NULL, &error);
  CHECK(*problem != NULL);
  if (!*problem) {
    fprintf(stderr, "    %s\n", error.text);
    return NULL;
  }
  cav_trajectory *at = cav_trajectory_new((*problem)->model, 11, .1);
  CHECK(at != NULL);
  if (at) cav_guess_fill(*problem, (*problem)->q_goal, at);
  return at;
}

/// Root position and angle of the knee at a knot; differences of a few roundings, 1e-16 seen.
static void check_knot(const cav_trajectory *at, int knot, const double root[3], double knee) {
  CHECK_NEAR_ALL(at->q + knot * at->nq, root, 3, 1e-14);
  CHECK_NEAR(at->q[knot * at->nq + 7], knee, 1e-14);
}

/// Orientation at a knot, as angle about an axis, rad; 2e-16 seen.
static void check_turned(const cav_trajectory *at, int knot, int axis, double angle) {
  double w[4] = {cos(angle / 2), 0, 0, 0}, sign = 1;
  w[1 + axis] = sin(angle / 2);
  const double *q = at->q + knot * at->nq + 3;
  for (int i = 0; i < 4; i++) sign = fabs(w[i]) > 0.5 && w[i] * q[i] < 0 ? -1 : sign;
  for (int i = 0; i < 4; i++) CHECK_NEAR(sign * q[i], w[i], 1e-14);
}

/// A ball that goes along a ramp of 10 degrees, 15 cm above it but at its ends: put onto it, and left where it is.
static void check_ground(void) {
  static const char text[] =
      "<problem model='m.xml'>\n<scene><geom name='ramp' type='box' pos='.0173648 0 -.0984808' euler='0 -10 0' size='2 "
      "1 .1'/>"
      "</scene><horizon duration='1' timestep='.1'/>\n<start><root pos='0 0 .1015427'/></start>\n"
      "<goal><root pos='1 0 .2778697'/></goal>\n<guess ground='%s'><waypoint time='.1'><root pos='.1 0 "
      ".2691754'/></waypoint>"
      "<waypoint time='.9'><root pos='.9 0 .410237'/></waypoint></guess>" TAIL;
  for (int ground = 0; ground < 2; ground++) {
    cav_problem *p;
    char of[1000];
    snprintf(of, sizeof of, text, ground ? "true" : "false");
    cav_trajectory *at = guess(of, &p);
    for (int t = 0; at && t <= 10; t++) {
      const double *q = at->q + t * at->nq, over = q[2] - (q[0] * tan(M_PI / 18) + .1 / cos(M_PI / 18));
      const int end = t == 0 || t == 10, near = t <= 2 || t >= 8;
      CHECK_NEAR(q[0], .1 * t, 1e-12);
      if (end || !near || !ground) CHECK_NEAR(over, end || ground ? 0 : .15, 1e-6);
    }
    if (p) CHECK(p->guess_ground == ground);
    cav_trajectory_free(at);
    cav_problem_free(p);
  }
}

static void check_ways(void) {
  cav_problem *p;
  cav_trajectory *at = guess(HEAD TAIL, &p);
  // cubic from rest to rest
  if (at) {
    check_knot(at, 0, (double[]){0, 0, 2}, 0);
    check_knot(at, 3, (double[]){.3 * .3 * 2.4, 0, 2}, 0);
    check_knot(at, 10, (double[]){1, 0, 2}, 0);
    check_turned(at, 5, 2, M_PI / 4);
  }
  cav_trajectory_free(at);
  cav_problem_free(p);

  at = guess(HEAD "<guess type='hold' apex='1' rotation='0 360 0' from='.2' to='.8'/>" TAIL, &p);
  // the start, with an arc and one turn between two times
  if (at) {
    check_knot(at, 2, (double[]){0, 0, 2}, 0);
    check_knot(at, 5, (double[]){0, 0, 3}, 0);
    check_knot(at, 8, (double[]){0, 0, 2}, 0);
    check_turned(at, 5, 1, M_PI);
    check_turned(at, 9, 1, 2 * M_PI);
  }
  cav_trajectory_free(at);
  cav_problem_free(p);

  at = guess(HEAD "<guess type='hold'><swing joint='knee' amplitude='1' frequency='.5' phase='180'/></guess>" TAIL, &p);
  // full height at half time; the range holds on the other side
  if (at) check_knot(at, 5, (double[]){0, 0, 2}, -1);
  cav_trajectory_free(at);
  cav_problem_free(p);
}

static void check_postures(void) {
  cav_problem *p;
  cav_trajectory *at = guess(HEAD POSES TAIL, &p);
  // the postures at their times, lines between; the first lies on the floor
  if (at) {
    CHECK(p->nguess_pose == 2 && p->guess_pose[0].time == .2 && p->guess_pose[1].time == .6);
    double low = p->guess_pose[0].q[2];
    CHECK_NEAR(low, .1, 1e-14);
    check_knot(at, 0, (double[]){0, 0, 2}, 0);
    check_knot(at, 1, (double[]){0, 1.5, (2 + low) / 2}, -.5);
    check_knot(at, 2, (double[]){0, 3, low}, -1);
    check_knot(at, 3, (double[]){0, 3, low + (5 - low) / 4}, -1);
    check_knot(at, 6, (double[]){0, 3, 5}, -1);
    check_knot(at, 8, (double[]){.5, 1.5, 3.5}, -.5);
    check_knot(at, 10, (double[]){1, 0, 2}, 0);
    check_turned(at, 1, 1, M_PI / 6);
    check_turned(at, 4, 1, M_PI / 3);
    check_turned(at, 10, 2, M_PI / 2);
  }
  cav_trajectory_free(at);
  if (!p) return;

  // as a result folder has it
  cav_error error = {0};
  CHECK(cav_problem_write(path, p, NULL, &error) == CAV_OK);
  cav_problem *again = cav_problem_load(path, NULL, &error);
  CHECK(again && again->nguess_pose == 2);
  for (int i = 0; i < 2 && again; i++) {
    CHECK(again->guess_pose[i].time == p->guess_pose[i].time);
    CHECK_NEAR_ALL(again->guess_pose[i].q, p->guess_pose[i].q, 8, 0);
  }
  cav_problem_free(again);
  cav_problem_free(p);
}

/// A file that must fail at that line with that text.
static void refuse(const char *text, int line, const char *part) {
  cav_error error = {0};
  scene_write(folder, "p.xml", text);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  CHECK(!p && error.line == line && strstr(error.text, part));
  if (p || error.line != line || !strstr(error.text, part)) fprintf(stderr, "    %d: %s\n", error.line, error.text);
  cav_problem_free(p);
}

/// How deep a configuration is in the world.
static double depth_of(const cav_model *m, const double *q) {
  cav_state *state = cav_state_new(m);
  double depth = 0;
  CHECK(state && cav_position(m, state, q) == CAV_OK);
  for (int i = 0; state && i < state->ncontact; i++) depth = fmax(depth, -state->contact[i].dist);
  cav_state_free(state);
  return depth;
}

// through a wall of a scene, and lifted over it: clear at every knot, up and down without haste, and the same far away
static void check_solids(void) {
  cav_problem *p;
  double before[21], deepest = 0;
  for (int grow = 0; grow < 2; grow++) {
    char text[512];
    snprintf(text, sizeof text,
             "<problem model='m.xml'><scene><geom type='box' size='.1 1 .4' pos='1 0 1'/></scene>"
             "<horizon duration='2' timestep='.1'/><start><root pos='0 0 1'/></start><goal><root pos='2 0 1'/></goal>"
             "<schedule solids='%s'/></problem>",
             grow ? "grow" : "hard");
    scene_write(folder, "p.xml", text);
    p = cav_problem_load(path, NULL, NULL);
    cav_trajectory *at = p ? cav_problem_guess(p, NULL) : NULL;
    int collides = 0;
    CHECK(at && at->nknot == 21);
    // the strategy of that name is for the guess that runs into it
    CHECK(p && cav_guess_collides(p, &collides) == CAV_OK && collides);
    for (int t = 0; at && t < 21; t++) {
      const double *q = at->q + t * at->nq;
      double depth = depth_of(p->model, q);
      if (!grow) before[t] = q[2], deepest = fmax(deepest, depth);
      if (!grow) continue;
      CHECK(depth < 1.1e-3 && q[2] >= before[t] && q[2] < 2);
      if (t < 2 || t > 18) CHECK_NEAR(q[2], before[t], 1e-14);
      if (t > 0) CHECK(fabs(q[2] - q[2 - at->nq]) < 0.3);
    }
    cav_trajectory_free(at);
    cav_problem_free(p);
  }
  CHECK(deepest > 0.1);
}

// a motion on file, from a time of it on: between its knots, and up to the goal after its end
static void check_file(void) {
  cav_problem *p;
  cav_error error = {0};
  cav_trajectory *at = guess(HEAD TAIL, &p), *motion = at && p ? cav_trajectory_new(p->model, 4, .2) : NULL;
  for (int t = 0; motion && t < 4; t++)
    motion->q[t * 8] = t * t, motion->q[t * 8 + 2] = 3, motion->q[t * 8 + 7] = -.1 * t;
  if (motion) cav_trajectory_velocities(p->model, motion);
  CHECK(motion && !cav_trajectory_write(motion_path, p->model, motion, &error));
  cav_trajectory_free(motion);
  cav_trajectory_free(at);
  cav_problem_free(p);
  at = guess(HEAD "<guess file='motion.csv' offset='.1'/>" TAIL, &p);
  if (at) {
    CHECK(p->nguess_pose == 3);
    check_knot(at, 1, (double[]){1, 0, 3}, -.1);
    check_knot(at, 2, (double[]){2.5, 0, 3}, -.15);
    check_knot(at, 5, (double[]){9, 0, 3}, -.3);
    check_knot(at, 10, (double[]){1, 0, 2}, 0);
  }
  cav_trajectory_free(at);
  cav_problem_free(p);
  // a free start begins where the motion is then, and without a goal the guess ends where it is: between knots, and as a
  // result folder has it; velocities in the file are those of its knots, backwards
  at = guess(
      "<problem model='m.xml'><horizon duration='.4' timestep='.1'/><start free='true'/>"
      "<guess file='motion.csv' offset='.1'/></problem>",
      &p);
  if (at) {
    CHECK(p->nguess_pose == 3 && p->guess_pose[2].time == .4);
    check_knot(at, 0, (double[]){.5, 0, 3}, -.05);
    check_knot(at, 1, (double[]){1, 0, 3}, -.1);
    CHECK_NEAR(p->v_start[0], 5, 1e-12);
    cav_trajectory *end = cav_problem_guess(p, &error);
    CHECK(end && fabs(end->q[4 * 8] - 6.5) < 1e-12 && fabs(end->v[0] - 5) < 1e-12);
    CHECK(cav_problem_write(path, p, NULL, &error) == CAV_OK);
    cav_problem *again = cav_problem_load(path, NULL, &error);
    CHECK(again && again->nguess_pose == 3 && again->guess_pose[2].time == .4);
    cav_problem_free(again);
    cav_trajectory_free(end);
  }
  cav_trajectory_free(at);
  cav_problem_free(p);
  refuse(HEAD "<guess offset='1'/>" TAIL, 5, "attribute 'file', which is missing");
  refuse(HEAD "<guess type='hold' file='motion.csv'/>" TAIL, 5, "contradicts attribute 'type'");
  refuse(HEAD "<guess file='motion.csv' offset='.7'/>" TAIL, 5, "it lasts 0.6 s, got 0.7");
  refuse(HEAD "<guess file='none.csv'/>" TAIL, 5, "none.csv");
  unlink(motion_path);
}

static void check_broken(void) {
  refuse(HEAD "<guess>\n<waypoint key='bent'/></guess>" TAIL, 6, "'time': is missing");
  refuse(HEAD "<guess>\n<waypoint time='.5' key='bent'/></guess>" TAIL, 6, "has a keyframe or pose");
  refuse(HEAD "<guess>\n<waypoint time='0'/></guess>" TAIL, 6, "after the posture before");
  refuse(HEAD "<guess>\n<waypoint time='1.1'/></guess>" TAIL, 6, "at the end, 1 s, at the latest");
  refuse(HEAD "<guess>\n<waypoint time='.5'/>\n<waypoint time='.5'/></guess>" TAIL, 7, "after the posture before");
  refuse(HEAD "<guess type='hold'>\n<waypoint time='.5'/></guess>" TAIL, 6, "contradicts type='hold'");
}

// the problem of an arm from one side of something to the other
static cav_problem *arm_past(const char *scene, const char *asked) {
  static const char pattern[] =
      "<problem name='past' model='" CAVORT_SOURCE_ROOT
      "/problems/models/arm.xml'><scene>%s</scene><horizon duration='2.5' "
      "timestep='0.02'/><start><joint name='joint1' degrees='-70'/><joint name='joint2' degrees='60'/><joint "
      "name='joint4' degrees='40'/></start>"
      "<goal><joint name='joint1' degrees='70'/><joint name='joint2' degrees='60'/><joint name='joint4' "
      "degrees='40'/></goal>%s<cost><posture "
      "dofs='all' at='end' weight='900'/><velocity dofs='all' at='end' weight='100'/></cost></problem>";
  char text[1500];
  snprintf(text, sizeof text, pattern, scene, asked);
  return strategy_problem(text);
}

// an arm whose straight way runs into a wall or between posts is begun round them, clear of all, where its file has no guess;
// what it does then is certified
static void check_detour(void) {
  static const char *const scene[] = {"<geom name='wall' type='box' pos='.45 0 .25' size='.2 .02 .25'/>",
                                      "<geom name='one' type='cylinder' pos='.4 .15 .35' size='.03 .35'/><geom "
                                      "name='two' type='cylinder' pos='.4 -.15 .35' "
                                      "size='.03 .35'/>",
                                      ""};
  for (int k = 0; k < 3; k++) {
    cav_problem *p = arm_past(scene[k], ""),
                *stated = arm_past(scene[k],
                                   "<guess><waypoint time='1'><joint name='joint2' degrees='20'/></waypoint></guess>");
    if (!p || !stated) return;
    cav_strategy strategy[CAV_STRATEGIES];
    cav_error error = {0};
    int n;
    CHECK(cav_strategy_list(stated, strategy, &n) == CAV_OK && strategy[0].stated && !strategy[0].nswing);
    cav_strategies_clear(strategy, n);
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && (strategy[0].nswing == 7) == (k < 2));
    // nearer to the goal's posture, by the same guess
    const cav_strategy *posture = strategy_find(strategy, n, "posture");
    if (CHECK(posture && posture->nterm == p->nterm && posture->nswing == strategy[0].nswing)) {
      int heavier = 0;
      for (int i = 0; i < p->nterm; i++) heavier += posture->term[i].weight == 10 * p->term[i].weight;
      CHECK(heavier == 1);
      CHECK_TEXT(posture->changed, "<posture weight=\"1\"/>");
    }
    if (k < 2) {
      cav_problem taken;
      cav_strategy_apply(p, &strategy[0], &taken);
      cav_trajectory *way = cav_trajectory_new(p->model, 126, p->timestep);
      cav_state *state = cav_state_new(p->model);
      CHECK(cav_guess_fill(&taken, p->q_goal, way) == CAV_OK);
      for (int t = 0; t < way->nknot; t++) {
        CHECK(cav_position(p->model, state, way->q + t * way->nq) == CAV_OK);
        for (int i = 0; i < state->ncontact; i++) {
          const cav_pair *pair = &p->model->pair[state->contact[i].pair];
          // arm and scene
          if (p->model->geom[pair->geom1].link != p->model->geom[pair->geom2].link) CHECK(state->contact[i].dist > 0);
        }
      }
      cav_state_free(state);
      cav_trajectory_free(way);
      cav_solution *solution = NULL;
      CHECK(cav_strategy_solve(p, &strategy[0], NULL, NULL, &solution, &error) == CAV_OK);
      cav_verdict v;
      if (CHECK(solution && solution->gain_q))
        CHECK(cav_verify_solution(&taken, solution, &v, &error) == CAV_OK && v.certified && v.achieved);
      cav_solution_free(solution);
    }
    cav_strategies_clear(strategy, n);
    cav_problem_free(p), cav_problem_free(stated);
  }
}

// a humanoid that goes 1.4 m straight on past something
static cav_problem *walk_past(const char *scene) {
  static const char pattern[] = "<problem name='past' model='" CAVORT_SOURCE_ROOT
                                "/problems/models/humanoid.xml'><scene>%s</scene><horizon duration='3.5'/>"
                                "<start key='stand' height='floor'/><goal key='stand' height='floor'><root pos='1.4 0 "
                                "1.4'/></goal><cost><posture dofs='all' at='end' weight='900'/></cost></problem>";
  char text[1500];
  snprintf(text, sizeof text, pattern, scene);
  return strategy_problem(text);
}

// what stands in the way on the ground and is as high as the body is gone round, by the nearer side and no further than is
// needed, limbs swinging; what is low, hangs or is too wide is not
static void check_bypass(void) {
  static const struct {
    const char *scene;
    int round; // 1: to the right, -y
  } c[] = {{"<geom name='post' type='cylinder' size='.08 .8' pos='.7 .05 .8'/>", 1},
           {"<geom name='post' type='cylinder' size='.08 .2' pos='.7 .05 .2'/>", 0},
           {"<geom name='post' type='cylinder' size='.08 .4' pos='.7 .05 1.2'/>", 0},
           {"<geom name='wall' type='box' size='.05 3 .8' pos='.7 .05 .8'/>", 0},
           {"<geom name='post' type='cylinder' size='.08 .8' pos='.7 1.5 .8'/>", 0}};
  for (size_t k = 0; k < sizeof c / sizeof *c; k++) {
    cav_problem *p = walk_past(c[k].scene);
    if (!p) return;
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    CHECK((strategy[0].bow[1] < 0) == c[k].round && fabs(strategy[0].bow[0]) < 1e-12);
    if (c[k].round) {
      CHECK(!strategy[0].stated && strategy[0].nswing == 4 && strategy[0].schedule.solids == CAV_SOLIDS_HARD);
      // the way of the root by itself: half a sine over the whole duration
      cav_problem taken;
      cav_strategy_apply(p, &strategy[0], &taken);
      cav_error error = {0};
      cav_trajectory *way = cav_problem_guess(&taken, &error);
      cav_state *state = cav_state_new(p->model);
      if (CHECK(way && state)) {
        const double *middle = way->q + (size_t)(way->nknot / 2) * (size_t)way->nq;
        CHECK_NEAR(middle[0], 0.7, 1e-9);
        CHECK_NEAR(middle[1], strategy[0].bow[1], 1e-9);
        // 8 cm of the post, and no more than shoulders need: 0.35 m
        CHECK(hypot(middle[0] - 0.7, middle[1] - 0.05) > 0.08 + 0.2 && strategy[0].bow[1] > -0.5);
        for (int t = 0; t < way->nknot; t++) {
          CHECK(cav_position(p->model, state, way->q + (size_t)t * (size_t)way->nq) == CAV_OK);
          for (int i = 0; i < state->ncontact; i++) {
            const cav_contact *at = &state->contact[i];
            const int geom = p->model->pair[at->pair].geom1;
            if (at->link1 == 0 && p->model->geom[geom].type != CAV_GEOM_PLANE) CHECK(at->dist > 0.02);
          }
        }
      }
      cav_trajectory_free(way);
      cav_state_free(state);
    }
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
}

// what an arm's hand is asked for at the end, beyond a scene, and nothing else
static cav_problem *hand_at(const char *scene, const char *more) {
  static const char pattern[] =
      "<problem name='at' model='" CAVORT_SOURCE_ROOT
      "/problems/models/arm.xml'><scene>%s</scene><horizon duration='2.5' timestep='0.02'/>"
      "<start><joint name='joint1' degrees='-50'/><joint name='joint2' degrees='60'/><joint name='joint4' "
      "degrees='40'/>"
      "<joint name='joint6' degrees='50'/></start><cost>"
      "<sensor name='there' type='framepos' body='hand' target='.42 .25 .15' at='end' weight='3000'/>"
      "<velocity dofs='all' at='end' weight='100'/>%s</cost></problem>";
  char text[1500];
  snprintf(text, sizeof text, pattern, scene, more);
  return strategy_problem(text);
}

// on hands and knees under a beam, a little in it: a guess that is lifted out of solids stays below; under one on the ground,
// which is a step, it is lifted over
static void check_under(void) {
  static const char pattern[] =
      "<problem name='under' model='" CAVORT_SOURCE_ROOT
      "/problems/models/humanoid.xml'><scene><geom name='beam' type='box' size='.08 1 %g' pos='.8 0 %g'/></scene>"
      "<horizon duration='4'/><start key='all-fours' height='floor'/><goal key='all-fours' height='floor'><root "
      "pos='1.5 0 "
      ".5'/></goal><cost><posture dofs='all' at='end' weight='900'/></cost><schedule solids='grow'/></problem>";
  for (int k = 0; k < 2; k++) {
    char text[1500];
    cav_error error = {0};
    const double bottom = k ? 0 : 0.7, top = 0.8;
    snprintf(text, sizeof text, pattern, (top - bottom) / 2, (top + bottom) / 2);
    cav_problem *p = strategy_problem(text);
    cav_trajectory *way = p ? cav_problem_guess(p, &error) : NULL;
    if (CHECK(way != NULL)) {
      double most = 0;
      for (int t = 0; t < way->nknot; t++) most = fmax(most, way->q[(size_t)t * (size_t)way->nq + 2]);
      CHECK(k ? most > p->q_start[2] + 0.5 : most < p->q_start[2] + 0.05);
    }
    cav_trajectory_free(way);
    cav_problem_free(p);
  }
}

// standing before a beam at the height of the chest the guess ducks: deep enough, and back up
static void check_duck(void) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/unseen/duck.xml", NULL, &error);
  if (!CHECK(p != NULL)) return;
  p->schedule.solids = CAV_SOLIDS_GROW;
  cav_trajectory *way = cav_problem_guess(p, &error);
  cav_state *state = cav_state_new(p->model);
  if (CHECK(way != NULL)) {
    double least = INFINITY, most = 0, in = 0;
    for (int t = 0; t < way->nknot; t++) {
      const double *q = way->q + (size_t)t * (size_t)way->nq;
      least = fmin(least, q[2]), most = fmax(most, q[2]);
      CHECK(cav_position(p->model, state, q) == CAV_OK);
      for (int i = 0; i < state->ncontact; i++) {
        const cav_contact *c = &state->contact[i];
        const int beam = p->model->geom[p->model->pair[c->pair].geom1].type == CAV_GEOM_CAPSULE;
        if (beam && (c->link1 == 0 || c->link2 == 0)) in = fmax(in, -c->dist);
      }
    }
    CHECK(least < p->q_start[2] - 0.3 && most < p->q_start[2] + 0.01 && in < 0.002);
    CHECK_NEAR(way->q[(size_t)(way->nknot - 1) * (size_t)way->nq + 2], p->q_start[2], 0.01);
  }
  cav_state_free(state);
  cav_trajectory_free(way);
  cav_problem_free(p);
}

// a gantry crane whose load would go through a container hoists it over that, by more than a radian's worth of a slide
static void check_hoist(void) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/unseen/crane-over-wall.xml", NULL, &error), taken;
  if (!CHECK(p != NULL)) return;
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && strategy[0].nswing == 2);
  cav_strategy_apply(p, &strategy[0], &taken);
  cav_trajectory *way = cav_problem_guess(&taken, &error);
  cav_state *state = cav_state_new(p->model);
  double high = INFINITY, deep = 0;
  for (int t = 0; way && t < way->nknot; t++) {
    const double *q = way->q + (size_t)t * (size_t)way->nq;
    high = fmin(high, q[2]);
    CHECK(cav_position(p->model, state, q) == CAV_OK);
    for (int i = 0; i < state->ncontact; i++) deep = fmax(deep, -state->contact[i].dist);
  }
  CHECK(way && p->q_start[2] - high > 1 && deep < 1e-6);
  cav_solution *solution = NULL;
  cav_verdict v;
  CHECK(cav_strategy_solve(p, &strategy[0], NULL, NULL, &solution, &error) == CAV_OK);
  if (CHECK(solution && solution->gain_q))
    CHECK(cav_verify_solution(&taken, solution, &v, &error) == CAV_OK && v.certified && v.achieved);
  cav_solution_free(solution);
  cav_state_free(state);
  cav_trajectory_free(way);
  cav_strategies_clear(strategy, n);
  cav_problem_free(p);
}

// a thing whose straight way goes through the edge of a shelf is lifted over that, and who stands before it is not
static void check_thing_over(void) {
  static const char text[] =
      "<problem name='shelf' model='" CAVORT_SOURCE_ROOT
      "/problems/models/humanoid.xml'><scene><geom name='shelf' type='box' pos='1.62 0 1.185' size='.15 .4 .015'/>"
      "<body name='parcel' pos='1.34 0 .85'><freejoint name='parcel'/><geom type='box' size='.1 .15 .1' "
      "mass='4'/></body>"
      "</scene><horizon duration='3'/><start key='stand' height='floor'><root joint='parcel' "
      "height='keep'/></start><goal key='stand' height='floor'>"
      "<root joint='parcel' pos='1.56 0 1.3' height='keep'/></goal><schedule solids='grow'/><cost><posture dofs='all' "
      "at='end' "
      "weight='900'/></cost></problem>";
  cav_error error = {0};
  cav_problem *p = strategy_problem(text);
  cav_trajectory *way = p ? cav_problem_guess(p, &error) : NULL;
  cav_state *state = p ? cav_state_new(p->model) : NULL;
  if (CHECK(way && state)) {
    const int parcel = way->nq - 7;
    double deep = 0, moved = 0;
    for (int t = 0; t < way->nknot; t++) {
      const double *q = way->q + (size_t)t * (size_t)way->nq;
      moved = fmax(moved, fabs(q[2] - p->q_start[2]));
      CHECK(cav_position(p->model, state, q) == CAV_OK);
      for (int i = 0; i < state->ncontact; i++) {
        const cav_contact *c = &state->contact[i];
        if (c->link1 == 0 && c->link2 == p->model->nlink - 1) deep = fmax(deep, -c->dist);
      }
    }
    CHECK(moved < 1e-9 && deep < 0.002 && p->q_goal[parcel] > 1.5);
  }
  cav_state_free(state);
  cav_trajectory_free(way);
  cav_problem_free(p);
}

// a file without a goal whose hand is wanted behind a wall is begun by a posture that has it there, round the wall, clear of
// all; nothing of that where the straight way there is free, or the start's posture is asked for at the end too
static void check_reach(void) {
  static const char wall[] = "<geom name='wall' type='box' pos='.45 0 .25' size='.2 .02 .25'/>";
  static const struct {
    const char *scene, *more;
    int reaches;
  } c[] = {{wall, "", 1},
           {"", "", 0},
           {wall, "<posture dofs='joints' at='end' weight='10'/>", 0},
           {wall, "<posture dofs='joints' at='end' weight='10' within='any'/>", 1}};
  for (size_t k = 0; k < sizeof c / sizeof *c; k++) {
    cav_problem *p = hand_at(c[k].scene, c[k].more);
    if (!p) return;
    cav_strategy strategy[CAV_STRATEGIES];
    cav_error error = {0};
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && (strategy[0].nreach == 7) == c[k].reaches);
    CHECK(!strategy_find(strategy, n, "hold") == !c[k].reaches);
    if (k == 0 && strategy[0].nreach) {
      // where the hand is there, by the model alone
      double q[16];
      cav_pose at;
      cav_state *state = cav_state_new(p->model);
      memcpy(q, p->q_start, (size_t)p->model->nq * sizeof *q);
      for (int i = 0; i < strategy[0].nreach; i++) {
        const cav_joint *joint = &p->model->joint[strategy[0].reach[i].joint];
        q[joint->q] = strategy[0].reach[i].to;
        CHECK(!joint->limited || (q[joint->q] > joint->range[0] && q[joint->q] < joint->range[1]));
      }
      CHECK(cav_position(p->model, state, q) == CAV_OK);
      const cav_term *there = &p->term[0];
      for (int i = 0; i < p->nterm && strcmp(there->name, "there"); i++) there = &p->term[i];
      cav_object_pose(p->model, state, there->sensor.object_type, there->sensor.object, &at);
      CHECK(hypot(hypot(at.pos[0] - 0.42, at.pos[1] - 0.25), at.pos[2] - 0.15) < 0.03);
      for (int i = 0; i < state->ncontact; i++) CHECK(state->contact[i].dist > 0);
      cav_state_free(state);
      cav_solution *solution = NULL;
      cav_verdict v;
      CHECK(cav_strategy_solve(p, &strategy[0], NULL, NULL, &solution, &error) == CAV_OK);
      if (CHECK(solution && solution->gain_q))
        CHECK(cav_verify_solution(p, solution, &v, &error) == CAV_OK && v.certified && v.achieved);
      cav_solution_free(solution);
    }
    cav_strategies_clear(strategy, n);
    cav_problem_free(p);
  }
}

// a finger that no actuator moves, and that the model has at the end of its range, is no hindrance
static void check_reach_with_finger(void) {
  static const char arm[] =
      "<mujoco><worldbody><body pos='0 0 .3'><joint name='a' axis='0 0 1'/><geom type='capsule' fromto='0 0 0 .3 0 0' "
      "size='.03'/>"
      "<body pos='.3 0 0'><joint name='b' axis='0 0 1'/><geom type='capsule' fromto='.06 0 0 .3 0 0' size='.03'/>"
      "<body pos='.3 0 0'><joint name='c' axis='0 1 0'/><geom type='capsule' fromto='.06 0 0 .2 0 0' size='.02'/>"
      "<site name='tip' pos='.22 0 0'/>"
      "<body pos='.2 .03 0'><joint name='finger' type='slide' axis='0 1 0' range='0 .05' limited='true'/>"
      "<geom size='.005' mass='.01' contype='0' conaffinity='0'/></body></body></body></body></worldbody>"
      "<actuator><motor joint='a' ctrllimited='true' ctrlrange='-20 20'/><motor joint='b' ctrllimited='true' "
      "ctrlrange='-20 20'/>"
      "<motor joint='c' ctrllimited='true' ctrlrange='-20 20'/></actuator></mujoco>";
  static const char problem[] =
      "<problem name='finger' model='m.xml'><scene><geom name='post' type='cylinder' pos='.5 0 .3' size='.04 "
      ".3'/></scene>"
      "<horizon duration='2' timestep='0.02'/><start><joint name='a' degrees='-60'/></start><cost>"
      "<sensor name='there' type='framepos' site='tip' target='.5 .4 .3' at='end' within='.1' weight='3000'/>"
      "<velocity dofs='all' at='end' weight='100'/></cost></problem>";
  scene_write(folder, "m.xml", arm);
  scene_write(folder, "p.xml", problem);
  cav_error error = {0};
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (CHECK(p != NULL)) {
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK && strategy[0].nreach == 3);
    for (int k = 0; k < strategy[0].nreach; k++)
      CHECK(strcmp(p->model->joint[strategy[0].reach[k].joint].name, "finger"));
    cav_strategies_clear(strategy, n);
  }
  cav_problem_free(p);
}

int main(void) {
  CHECK(mkdtemp(folder) != NULL);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  snprintf(model_path, sizeof model_path, "%s/m.xml", folder);
  snprintf(motion_path, sizeof motion_path, "%s/motion.csv", folder);
  scene_write(folder, "m.xml", model);
  check_ways();
  check_ground();
  check_postures();
  check_broken();
  check_file();
  check_solids();
  check_detour();
  check_hoist();
  check_thing_over();
  check_bypass();
  check_under();
  check_duck();
  check_reach();
  check_reach_with_finger();
  unlink(path);
  unlink(model_path);
  rmdir(folder);
  return check_result();
}
