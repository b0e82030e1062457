/// What the tests of dynamics share: a scene of our own with every kind of joint, models from text, random states.
#ifndef CAVORT_TESTS_SCENE_H
#define CAVORT_TESTS_SCENE_H

#include <stdint.h>
#include <unistd.h>

#include "cavort/dynamics.h"
#include "cavort/problem.h"
#include "check.h"

/// Free, ball, slide and hinge joints, several on one body, welded children, two trees, springs, damping, armature,
/// friction loss, limits, a fixed tendon with all of it. Nothing touches.
static const char scene_joints[] =
    "<mujoco><option timestep='0.004'/><compiler angle='degree'/><worldbody>"
    "<body name='a' pos='0 0 1' quat='1 .2 .3 .4'><freejoint/>"
    "<geom type='box' size='.1 .2 .3' pos='.1 .05 0' euler='10 20 30' contype='0' conaffinity='0'/>"
    "<body name='b' pos='.3 0 .1'>"
    "<joint name='ball' type='ball' pos='.1 0 .05' limited='true' range='0 40' stiffness='3' damping='.3' "
    "armature='.1' "
    "frictionloss='.2'/>"
    "<geom type='capsule' size='.05' fromto='0 0 0 .2 .3 .1' contype='0' conaffinity='0'/>"
    "<body name='c' pos='.2 0 0' euler='30 10 0'>"
    "<joint name='s' type='slide' axis='1 1 0' pos='.1 0 0' ref='.2' stiffness='10' springref='-.1' limited='true' "
    "range='-.3 .5' frictionloss='1'/>"
    "<joint name='h' type='hinge' axis='0 1 1' pos='.05 .1 0' ref='20' range='-10 40' limited='true' damping='1' "
    "stiffness='2' springref='10' margin='.1'/>"
    "<joint name='g' type='hinge' axis='1 1 1' armature='.2'/>"
    "<geom type='cylinder' size='.1 .2' contype='0' conaffinity='0'/>"
    "<body name='d' pos='0 .1 .2' euler='0 0 30'>"
    "<geom type='sphere' size='.1' pos='.1 .1 0' contype='0' conaffinity='0'/><site name='tip' pos='.1 .2 .3'/>"
    "<body name='e' pos='0 .1 .2' euler='0 0 30'><joint type='ball' limited='true' range='0 170' stiffness='1'/>"
    "<geom type='box' size='.1 .02 .03' contype='0' conaffinity='0'/></body></body></body></body></body>"
    "<body name='f' pos='2 0 0' euler='40 0 0'><joint name='t' type='slide' axis='1 0 0'/>"
    "<joint name='k' axis='0 1 0' pos='0 0 .4' stiffness='4'/>"
    "<geom type='box' size='.1 .2 .3' pos='0 0 .5' contype='0' conaffinity='0'/></body>"
    "<body name='i' pos='2 2 0'><joint type='free' stiffness='5' damping='.4'/>"
    "<geom type='ellipsoid' size='.1 .2 .3' pos='0 .1 .5' contype='0' conaffinity='0'/></body>"
    "</worldbody><tendon><fixed name='string' limited='true' range='-.2 .3' stiffness='7' damping='.6' "
    "frictionloss='.5' "
    "springlength='.1' margin='.05'><joint joint='s' coef='.7'/><joint joint='h' coef='-.3'/>"
    "<joint joint='k' coef='.2'/></fixed></tendon>"
    "<actuator><motor name='ms' joint='s' gear='2'/><motor name='mh' joint='h' gear='-3'/>"
    "<motor name='mt' tendon='string' gear='5'/><motor name='ms2' joint='s' gear='4'/></actuator></mujoco>";

/// Writes a text as folder/name; a failed check where that cannot be.
static inline void scene_write(const char *folder, const char *name, const char *text) {
  char path[400];
  snprintf(path, sizeof path, "%.250s/%.140s", folder, name);
  FILE *file = fopen(path, "w");
  CHECK(file != NULL);
  if (!file) return;
  fputs(text, file);
  fclose(file);
}

/// The problem of a text, as folder/problem.xml; NULL with what is wrong with it.
static inline cav_problem *scene_problem(const char *folder, const char *text, cav_error *error) {
  char path[400];
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%.250s/problem.xml", folder);
  return cav_problem_load(path, NULL, error);
}

/// Removes a folder of a model and a problem.
static inline void scene_remove(const char *folder) {
  static const char *const file[] = {"model.xml", "problem.xml"};
  for (int i = 0; i < 2; i++) {
    char path[4096];
    snprintf(path, sizeof path, "%.4000s/%s", folder, file[i]);
    unlink(path);
  }
  CHECK(rmdir(folder) == 0);
}

/// The model of an MJCF text, through a temporary file; NULL with a message if it does not load.
static inline cav_model *scene_load(const char *text) {
  char path[] = "/tmp/cavort-test-XXXXXX";
  int file = mkstemp(path);
  if (file < 0) return NULL;
  size_t length = strlen(text);
  int written = write(file, text, length) == (ssize_t)length;
  close(file);
  cav_error error = {0};
  cav_model *model = written ? cav_model_load(path, &error) : NULL;
  unlink(path);
  if (!model) fprintf(stderr, "model does not load: %s\n", error.text);
  return model;
}

static uint64_t scene_seed = 0x9E3779B97F4A7C15u;

/// Uniform on (-1, 1), the same sequence on every machine.
static inline double scene_uniform(void) {
  scene_seed ^= scene_seed << 13;
  scene_seed ^= scene_seed >> 7;
  scene_seed ^= scene_seed << 17;
  return 2.0 * (double)(scene_seed >> 11) / 9007199254740992.0 - 1.0;
}

static inline double scene_between(double low, double high) { return low + (high - low) * (scene_uniform() + 1) / 2; }

/// About normal, variance one.
static inline double scene_normal(void) {
  double sum = 0;
  for (int i = 0; i < 12; i++) sum += scene_uniform();
  return sum / 2;
}

static inline void scene_normals(double *x, int n, double scale) {
  for (int i = 0; i < n; i++) x[i] = scale * scene_normal();
}

/// q0 moved by a random tangent of that size.
static inline void scene_posture(const cav_model *model, double *q, double *scratch, double scale) {
  scene_normals(scratch, model->nv, scale);
  cav_integrate(model, model->q0, scratch, 1, q);
}

static inline double *scene_vector(int n) { return calloc((size_t)n + 1, sizeof(double)); }

static inline double scene_norm(const double *x, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * x[i];
  return sqrt(sum);
}

/// |a - b| / (|b| + tiny)
static inline double scene_error(const double *a, const double *b, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sqrt(sum) / (scene_norm(b, n) + 1e-300);
}

#endif
