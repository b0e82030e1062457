/// Solved motions played in MuJoCo, with the contacts of the model's own file: forces of the motion and gains through
/// MuJoCo's actuators and their limits, without the lag of filtered actuators, which plans leave out too. For builds
/// with MuJoCo.
#ifndef CAVORT_TESTS_REPLAY_H
#define CAVORT_TESTS_REPLAY_H

#include <mujoco/mujoco.h>
#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"
#include "cycle_image.h"
#include "scene.h"

/// A motion being played.
typedef struct replay {
  const cav_problem *problem;
  const cav_trajectory *plan;
  const double *gain_q, *gain_v;
  const cav_model *model;
  cav_cycle_image *image; ///< of a cycle
  int periods, last;      ///< last: steps of one period, of the knots
  cav_trajectory *all;    ///< all periods
  cav_trajectory *motion; ///< these at the step of the simulation
  cav_state *state;
  mjModel *theirs;
  mjData *data;
  int *q_at, *v_at, *u_at; ///< [nq], [nv], [nu] where MuJoCo keeps them
  double *q, *v;           ///< [nq], [nv] MuJoCo's state
  double *work;            ///< [5*nv + nq + nu + 7*nlink]
} replay;

/// What a replay shows.
typedef struct replay_end {
  double seconds, body, root; ///< s followed; m: the farthest body and the farthest root link at its end
} replay_end;

// the periods of a motion in a row
static inline cav_trajectory *replay_unroll(const replay *s) {
  const cav_trajectory *one = s->plan;
  size_t nq = (size_t)one->nq, nv = (size_t)one->nv, last = (size_t)s->last;
  cav_trajectory *all = cav_trajectory_new(s->model, s->periods * s->last + 1, one->timestep);
  memcpy(all->v, one->v, nv * sizeof(double));
  for (size_t t = 0; t < (size_t)all->nknot; t++) {
    double *q = all->q + t * nq, *u = all->u + t * nv;
    if (t < last || !s->image) {
      memcpy(q, one->q + t * nq, nq * sizeof(double));
      memcpy(u, one->u + t * nv, nv * sizeof(double));
    } else {
      cav_cycle_image_configuration(s->image, q - last * nq, q);
      cav_cycle_image_tangent(s->image, 1, u - last * nv, u);
    }
  }
  cav_trajectory_velocities(s->model, all);
  return all;
}

// x [nv] moved by a number of periods
static inline void replay_move(const replay *s, int periods, double *x, double *scratch) {
  for (int k = 0; k < abs(periods); k++) {
    cav_cycle_image_tangent(s->image, periods > 0 ? 1 : -1, x, scratch);
    memcpy(x, scratch, sizeof(double) * s->model->nv);
  }
}

// MuJoCo's state
static inline void replay_take(const replay *s) {
  for (int k = 0; k < s->model->nq; k++) s->q[k] = s->data->qpos[s->q_at[k]];
  for (int d = 0; d < s->model->nv; d++) s->v[d] = s->data->qvel[s->v_at[d]];
}

// where MuJoCo keeps what the model has, by name where the problem removed something from the file, whose other geoms
// then touch nothing; 0 where that cannot be told
static inline int replay_match(replay *s) {
  static const int positions[] = {7, 4, 1, 1}, velocities[] = {6, 3, 1, 1};
  const cav_model *model = s->model;
  mjModel *theirs = s->theirs;
  const int whole = theirs->nq == model->nq && theirs->nv == model->nv && theirs->nu == model->nu;
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    const int at = whole ? j : mj_name2id(theirs, mjOBJ_JOINT, joint->name), type = at < 0 ? 0 : theirs->jnt_type[at];
    if (at < 0) return 0;
    for (int k = 0; k < positions[type]; k++) s->q_at[joint->q + k] = theirs->jnt_qposadr[at] + k;
    for (int k = 0; k < velocities[type]; k++) s->v_at[joint->dof + k] = theirs->jnt_dofadr[at] + k;
  }
  for (int a = 0; a < model->nu; a++) {
    s->u_at[a] = whole ? a : mj_name2id(theirs, mjOBJ_ACTUATOR, model->actuator[a].name);
    if (s->u_at[a] < 0) return 0;
  }
  for (int g = 0; g < theirs->ngeom; g++) {
    const char *name = mj_id2name(theirs, mjOBJ_GEOM, g);
    int there = !name;
    for (int k = 0; k < model->ngeom && !there; k++) there = !strcmp(model->geom[k].name, name);
    if (!there) theirs->geom_contype[g] = theirs->geom_conaffinity[g] = 0;
  }
  return 1;
}

// forces of the motion and feedback at step i, from MuJoCo's state, as inputs of its actuators
static inline void replay_control(const replay *s, int i) {
  const cav_model *model = s->model;
  const int nv = model->nv;
  int t = (int)(i * s->motion->timestep / s->plan->timestep + 1e-9), period = t / s->last;
  const size_t gain = (size_t)(t % s->last) * nv * nv;
  double *dq = s->work, *dv = dq + nv, *u = dv + nv, *scratch = u + nv, *effort = scratch + nv;
  const double *v = s->v;
  replay_take(s);
  cav_difference(model, s->motion->q + i * model->nq, s->q, 1, dq);
  for (int d = 0; d < nv; d++) dv[d] = v[d] - s->motion->v[i * nv + d];
  replay_move(s, -period, dq, scratch);
  replay_move(s, -period, dv, scratch);
  for (int a = 0; a < nv; a++) {
    u[a] = 0;
    for (int b = 0; b < nv; b++)
      u[a] += s->gain_q[gain + (size_t)(a * nv + b)] * dq[b] + s->gain_v[gain + (size_t)(a * nv + b)] * dv[b];
  }
  replay_move(s, period, u, scratch);
  for (int d = 0; d < nv; d++) u[d] += s->motion->u[i * nv + d];
  CHECK(cav_position(model, s->state, s->q) == CAV_OK);
  cav_actuation(model, s->state, u, NULL, effort);
  for (int a = 0; a < model->nu; a++) {
    double length = cav_actuator_length(model, s->state, a, scratch), velocity = 0, input;
    for (int d = 0; d < nv; d++) velocity += scratch[d] * v[d];
    cav_actuator_input(model, a, length, velocity, model->actuator[a].unit * effort[a], &input);
    s->data->ctrl[s->u_at[a]] = input;
    // activations come last in its order
    const int state = s->u_at[a] - (s->theirs->nu - s->theirs->na);
    if (state >= 0) s->data->act[state] = input;
  }
}

// a ball that no actuator moves: which way round it lies means nothing
static inline int replay_is_ball(const cav_model *m, int link) {
  int round = !m->link[link].driven;
  for (int g = 0; g < m->ngeom; g++)
    if (m->geom[g].link == link) round &= m->geom[g].type == CAV_GEOM_SPHERE;
  return round;
}

// distances from the motion at step i; 0 once it is lost, by the certificate's measures
static inline int replay_follows(const replay *s, int i, replay_end *p) {
  const cav_model *model = s->model;
  double *place = s->work, turn = 0;
  CHECK(cav_position(model, s->state, s->motion->q + i * model->nq) == CAV_OK);
  for (int l = 1; l < model->nlink; l++) {
    memcpy(place + 7 * l, s->state->com + 3 * l, 3 * sizeof *place);
    memcpy(place + 7 * l + 3, s->state->link[l].quat, 4 * sizeof *place);
  }
  replay_take(s);
  CHECK(cav_position(model, s->state, s->q) == CAV_OK);
  p->body = p->root = 0;
  for (int l = 1; l < model->nlink; l++) {
    const double *a = place + 7 * l, *b = s->state->com + 3 * l, *r = s->state->link[l].quat;
    const double distance = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
    p->body = fmax(p->body, distance);
    if (model->link[l].root != l) continue;
    p->root = fmax(p->root, distance);
    if (replay_is_ball(model, l)) continue;
    turn = fmax(turn, 2 * acos(fmin(fabs(a[3] * r[0] + a[4] * r[1] + a[5] * r[2] + a[6] * r[3]), 1)));
  }
  return p->body <= 0.5 && turn <= 1;
}

/// The motion in MuJoCo at a step, s; forces 0: without those of the motion and without gains. off: slides and hinges
/// start off the plan by up to so many m or rad, velocities by up to ten times that, as scene_uniform says.
static inline replay_end replay_play(replay *s, double step, int forces, double off) {
  replay_end p = {0};
  s->motion = cav_trajectory_resample(s->model, s->all, step);
  s->theirs->opt.timestep = s->motion->timestep;
  mj_resetData(s->theirs, s->data);
  for (int k = 0; k < s->model->nq; k++) s->data->qpos[s->q_at[k]] = s->motion->q[k];
  for (int d = 0; d < s->model->nv; d++) s->data->qvel[s->v_at[d]] = s->motion->v[d];
  for (int d = 0; d < s->model->nv && off > 0; d++) s->data->qvel[s->v_at[d]] += 10 * off * scene_uniform();
  for (int j = 0; j < s->model->njoint && off > 0; j++)
    if (s->model->joint[j].type >= CAV_JOINT_SLIDE)
      s->data->qpos[s->q_at[s->model->joint[j].q]] += off * scene_uniform();
  for (int i = 0; i + 1 < s->motion->nknot; i++) {
    if (forces) replay_control(s, i);
    mj_step(s->theirs, s->data);
    if (!replay_follows(s, i + 1, &p)) break;
    p.seconds = (i + 1) * s->motion->timestep;
  }
  cav_trajectory_free(s->motion);
  return p;
}

// A copy of a model's file without its keys, which are too short once bodies are added; 0 where it has none.
static inline int replay_drop_keys(const char *model_path, char *copy) {
  static char text[1 << 16];
  FILE *stream = fopen(model_path, "r");
  text[stream ? fread(text, 1, sizeof text - 1, stream) : 0] = 0;
  if (stream) fclose(stream);
  char *from = strstr(text, "<keyframe>"), *to = from ? strstr(from, "</keyframe>") : NULL;
  if (!to) return 0;
  const int descriptor = mkstemps(copy, 4);
  dprintf(descriptor, "%.*s%s", (int)(from - text), text, to + strlen("</keyframe>"));
  close(descriptor);
  return 1;
}

// Eulerian angles of a scene, which are degrees, in the radians that the model's file says for all that is read with it. Other
// angles are not met in scenes.
static inline void replay_turn(const char *model_path, char *scene, size_t room) {
  static char text[1 << 16];
  FILE *stream = fopen(model_path, "r");
  text[stream ? fread(text, 1, sizeof text - 1, stream) : 0] = 0;
  if (stream) fclose(stream);
  CHECK(!strstr(scene, "axisangle="));
  if (!strstr(text, "angle=\"radian\"")) return;
  for (char *at = scene; (at = strstr(at, "euler=\"")) != NULL; at++) {
    char *first = at + strlen("euler=\""), *end = first, turned[100], rest[1 << 12];
    double angle[3];
    for (int k = 0; k < 3; k++) angle[k] = strtod(end, &end) * M_PI / 180;
    snprintf(rest, sizeof rest, "%s", end);
    CHECK(*end == '"' && strlen(end) < sizeof rest);
    snprintf(turned, sizeof turned, "%.17g %.17g %.17g", angle[0], angle[1], angle[2]);
    CHECK((size_t)(first - scene) + strlen(turned) + strlen(rest) < room);
    snprintf(first, room - (size_t)(first - scene), "%s%s", turned, rest);
  }
}

// mass and inertia of a body times a factor
static inline void replay_scale(mjModel *theirs, int body, double factor) {
  theirs->body_mass[body] *= factor;
  for (int k = 0; k < 3; k++) theirs->body_inertia[3 * body + k] *= factor;
}

// Masses as the model's file and the scene say: a model that says its total mass (settotalmass) says it of itself alone, while
// MuJoCo scales what an including file adds, too. Bodies of the model get those that MuJoCo gives it alone, bodies of the scene
// those that the problem has.
static inline int replay_weigh(mjModel *theirs, const cav_problem *problem) {
  const cav_model *ours = problem->model;
  mjModel *alone = mj_loadXML(problem->model_path, NULL, NULL, 0);
  if (!CHECK(alone)) return 0;
  for (int b = 1; b < theirs->nbody; b++) {
    const char *name = mj_id2name(theirs, mjOBJ_BODY, b);
    // without a name: of the model, which comes first
    const int same = name ? mj_name2id(alone, mjOBJ_BODY, name) : b < alone->nbody ? b : -1;
    const int there = same < 0 && name ? cav_object_find(ours, CAV_OBJECT_BODY, name) : -1;
    const double mass = same >= 0 ? alone->body_mass[same] : there >= 0 ? ours->body[there].mass : NAN;
    if (!CHECK(isfinite(mass))) return 0;
    if (theirs->body_mass[b] > 0) replay_scale(theirs, b, mass / theirs->body_mass[b]);
  }
  mj_deleteModel(alone);
  mjData *data = mj_makeData(theirs);
  mj_setConst(theirs, data);
  mj_deleteData(data);
  return 1;
}

// MuJoCo's model of the problem's file, with what the problem's scene puts into the world; path: the problem's file
static inline mjModel *replay_load(const char *path, const cav_problem *of) {
  const char *model_path = of->model_path;
  static char problem[1 << 16], added[1 << 16];
  char file[] = "/tmp/cavort-replay-XXXXXX.xml", text[1000] = "";
  FILE *stream = fopen(path, "r");
  problem[stream ? fread(problem, 1, sizeof problem - 1, stream) : 0] = 0;
  if (stream) fclose(stream);
  char *from = strstr(problem, "<scene>"), *to = strstr(problem, "</scene>");
  *added = 0;
  if (to) *to = 0;
  for (char *line = from ? strtok(from + strlen("<scene>"), "\n") : NULL; line; line = strtok(NULL, "\n"))
    if (!strstr(line, "<remove")) strcat(added, line);
  replay_turn(model_path, added, sizeof added);
  const int adds = strchr(added, '<') != NULL, descriptor = adds ? mkstemps(file, 4) : -1;
  char bare[] = "/tmp/cavort-replay-XXXXXX.xml";
  const int keyless = adds ? replay_drop_keys(model_path, bare) : 0;
  if (adds) {
    char *full = keyless ? strdup(bare) : realpath(model_path, NULL);
    dprintf(descriptor, "<mujoco><include file=\"..%s\"/><worldbody>%s</worldbody></mujoco>", full, added);
    close(descriptor);
    free(full);
  }
  mjModel *model = mj_loadXML(adds ? file : model_path, NULL, text, sizeof text);
  if (!model) fprintf(stderr, "    %s\n", text);
  if (model && adds) replay_weigh(model, of);
  if (adds) unlink(file);
  if (keyless) unlink(bare);
  return model;
}

/// Makes a motion ready to be played, problem, plan and gains of s given; path: the problem's file. 0 with a failed check
/// where that cannot be.
static inline int replay_open(replay *s, const char *path) {
  const cav_model *model = s->model = s->problem->model;
  cav_error error = {0};
  s->last = s->plan->nknot - 1;
  s->periods = 1;
  if (s->problem->cycle.on) {
    s->image = cav_cycle_image_new(s->problem, &error);
    s->periods = s->problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  }
  s->theirs = replay_load(path, s->problem);
  s->state = cav_state_new(model);
  s->work = malloc(sizeof(double) * (size_t)(6 * model->nv + 2 * model->nq + model->nu + 7 * model->nlink));
  s->v = s->work + 5 * model->nv + model->nq + model->nu + 7 * model->nlink;
  s->q = s->v + model->nv;
  s->q_at = malloc(sizeof(int) * (size_t)(model->nq + model->nv + model->nu + 1));
  s->v_at = s->q_at + model->nq;
  s->u_at = s->v_at + model->nv;
  s->all = replay_unroll(s);
  if (!CHECK(s->theirs && replay_match(s))) return 0;
  s->data = mj_makeData(s->theirs);
  double ours = 0, mass = 0;
  for (int l = 1; l < model->nlink; l++) ours += model->link[l].mass;
  for (int b = 1; b < s->theirs->nbody; b++) mass += s->theirs->body_weldid[b] ? s->theirs->body_mass[b] : 0;
  const int whole = s->theirs->nv == model->nv;
  return CHECK(!whole || fabs(mass - ours) < 1e-6 * ours);
}

static inline void replay_close(replay *s) {
  if (s->data) mj_deleteData(s->data);
  if (s->theirs) mj_deleteModel(s->theirs);
  free(s->work);
  free(s->q_at);
  cav_state_free(s->state);
  cav_trajectory_free(s->all);
  cav_cycle_image_free(s->image);
}

#endif
