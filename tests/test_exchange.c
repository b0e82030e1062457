/// Keyframes that cavort export writes, read by MuJoCo beside the model's own file: bodies stand where ours do, qvel is what
/// moves one keyframe to the next, ctrl is that of the motion in the model's order. The other formats are read back by
/// test_exchange.sh.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "check.h"
#include "exchange.h"
#include "schedule.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>

static char folder[] = "/tmp/cavort-exchange-XXXXXX";

// bodies that both have, by name: where MuJoCo and where we place them; how many
static int compare_bodies(const cav_model *m, const cav_state *state, const mjModel *peer, const mjData *data) {
  int compared = 0;
  for (int b = 1; b < peer->nbody; b++) {
    const char *name = peer->names + peer->name_bodyadr[b];
    int own = *name ? cav_object_find(m, CAV_OBJECT_BODY, name) : -1;
    if (own < 0) continue;
    cav_pose pose;
    cav_object_pose(m, state, CAV_OBJECT_XBODY, own, &pose);
    // rounding of a chain of rotations: 1e-12 seen
    CHECK_NEAR_ALL(pose.pos, data->xpos + 3 * b, 3, 1e-9);
    CHECK_NEAR_ALL(pose.rotation, data->xmat + 9 * b, 9, 1e-9);
    compared++;
  }
  return compared;
}

// the keyframe of a sample
static void compare_sample(const cav_recording *r, cav_state *state, const mjModel *peer, mjData *data, int i) {
  char name[40];
  snprintf(name, sizeof name, "motion %d", i);
  int key = mj_name2id(peer, mjOBJ_KEY, name);
  if (!CHECK(key >= 0)) return;
  mj_resetDataKeyframe(peer, data, key);
  mj_kinematics(peer, data);
  CHECK_NEAR(data->time, i * r->timestep, 1e-12);
  CHECK(!cav_position(r->model, state, r->motion->q + (size_t)i * (size_t)r->model->nq));
  CHECK(compare_bodies(r->model, state, peer, data) > 0);
  for (int a = 0; a < peer->nu; a++) {
    const char *actuator = peer->names + peer->name_actuatoradr[a];
    int own = *actuator ? cav_object_find(r->model, CAV_OBJECT_ACTUATOR, actuator) : a;
    if (CHECK(own >= 0)) CHECK_NEAR(data->ctrl[a], r->forces->input[r->knot[i] * r->model->nu + own], 0);
  }
  // the velocity of a keyframe is the way from the one before
  if (i == 0) return;
  mjtNum *before = malloc(sizeof *before * (size_t)peer->nq), *way = malloc(sizeof *way * (size_t)peer->nv);
  mju_copy(before, peer->key_qpos + (key - 1) * peer->nq, peer->nq);
  mj_differentiatePos(peer, way, r->timestep, before, data->qpos);
  CHECK_NEAR_ALL(data->qvel, way, peer->nv, 1e-6);
  free(before);
  free(way);
}

// the guess of a problem, recorded as if it was solved
static void compare(const char *path, double rate) {
  cav_error error = {0};
  char file[4200], text[1000] = "", note[CAV_EXCHANGE_NOTE];
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  p->contact = p->model->options;
  p->contact.timestep = p->timestep;
  p->contact.order = p->order;
  cav_stage_law(p, 1, p->timestep, &p->contact);
  cav_result result = {.problem = p, .trajectory = cav_problem_guess(p, &error)};
  cav_recording r;
  snprintf(file, sizeof file, "%s/keyframes.xml", folder);
  if (CHECK(result.trajectory && !cav_recording_open(&r, &result, rate, &error))) {
    double duration = result.trajectory->timestep * (result.trajectory->nknot - 1) * (p->cycle.mirror ? 2 : 1);
    CHECK(r.n == (int)lround(duration / r.timestep) + 1);
    CHECK(!cav_exchange_write_keyframes(&r, file, note, &error));
    if (error.text[0]) fprintf(stderr, "    %s: %s\n", path, error.text);
    mjModel *peer = mj_loadXML(file, NULL, text, sizeof text);
    if (!CHECK(peer != NULL)) fprintf(stderr, "    %s: %s\n", path, text);
    mjData *data = peer ? mj_makeData(peer) : NULL;
    cav_state *state = cav_state_new(p->model);
    for (int i = 0; i < r.n && data; i += i + 8 < r.n ? 7 : 1) compare_sample(&r, state, peer, data, i);
    cav_state_free(state);
    if (data) mj_deleteData(data), mj_deleteModel(peer);
    cav_recording_close(&r);
  }
  unlink(file);
  cav_trajectory_free(result.trajectory);
  cav_problem_free(p);
}

int main(void) {
  static const char *const paths[] = {
      "problems/motions/squat-jump/problem.xml",   "problems/motions/walk-cycle/problem.xml",
      "problems/motions/robot-squat/problem.xml",  "problems/motions/lift/problem.xml",
      "problems/motions/cheetah-jump/problem.xml", "tests/exchange.xml"};
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
    char path[4200];
    snprintf(path, sizeof path, "%s/%s", CAVORT_SOURCE_ROOT, paths[i]);
    compare(path, 0);
    compare(path, 60);
  }
  rmdir(folder);
  return check_result();
}
#else
int main(void) {
  printf("skipped: MuJoCo is not installed\n");
  return CHECK_SKIPPED;
}
#endif
