/// optim/solver/guess.c: the held start, the way from start to goal, postures on the way, turns, arcs and swings, each
/// at its knots; and what a problem file may not ask of a guess.
#include <unistd.h>

#include "check.h"
#include "clear.h"
#include "continuation.h"
#include "scene.h"

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
  unlink(path);
  unlink(model_path);
  rmdir(folder);
  return check_result();
}
