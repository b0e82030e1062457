/// Actuators: moments against differences of lengths, the projection of u and the inputs that give it; lengths,
/// moments, forces and parameters against MuJoCo's, on a scene with every kind and on arm26 and slider_crank.
#include "scene.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

enum { STATES = 1000 };

static cav_model *load(const char *path) {
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  CHECK(m != NULL);
  if (!m) fprintf(stderr, "    %s\n", error.text);
  return m;
}

// u made of known inputs: nothing is left over, and the efforts found give the same u
static void test_projection(const cav_model *m) {
  int nv = m->nv, nu = m->nu;
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(nv), *u = scene_vector(nv), *rest = scene_vector(nv);
  double *moment = scene_vector(nv), *effort = scene_vector(nu), *again = scene_vector(nv), worst = 0;
  for (int k = 0; k < 100; k++) {
    scene_posture(m, q, v, 0.5);
    CHECK(cav_position(m, state, q) == CAV_OK);
    memset(u, 0, (size_t)nv * sizeof *u);
    for (int i = 0; i < nu; i++) {
      cav_actuator_length(m, state, i, moment);
      double force = m->actuator[i].unit * scene_normal();
      for (int j = 0; j < nv; j++) u[j] += force * moment[j];
    }
    cav_actuation(m, state, u, rest, effort);
    memset(again, 0, (size_t)nv * sizeof *again);
    for (int i = 0; i < nu; i++) {
      cav_actuator_length(m, state, i, moment);
      for (int j = 0; j < nv; j++) again[j] += m->actuator[i].unit * effort[i] * moment[j];
    }
    worst = fmax(worst, fmax(scene_norm(rest, nv) / scene_norm(u, nv), scene_error(again, u, nv)));
  }
  // bound: rounding through T'T, whose condition is up to 1e4 here; seen 4e-12
  printf("projection: %.1e\n", worst);
  CHECK(worst < 1e-9);
  cav_state_free(state);
  free(q), free(v), free(u), free(rest), free(moment), free(effort), free(again);
}

// inputs of forces that inputs gave; a motor's effort is its control
static void test_inputs(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *moment = scene_vector(m->nv);
  double *effort = scene_vector(m->nu), *input = scene_vector(m->nu);
  for (int k = 0; k < 100; k++) {
    scene_posture(m, q, v, 0.3);
    scene_normals(v, m->nv, 0.2);
    CHECK(cav_position(m, state, q) == CAV_OK);
    for (int i = 0; i < m->nu; i++) {
      double velocity = 0, length = cav_actuator_length(m, state, i, moment), given = 0.5 + 0.5 * scene_uniform();
      for (int j = 0; j < m->nv; j++) velocity += moment[j] * v[j];
      double force = cav_actuator_force(m, i, length, velocity, given), found;
      effort[i] = force / m->actuator[i].unit;
      CHECK(cav_actuator_input(m, i, length, velocity, force, &found) == 1);
      CHECK_NEAR(cav_actuator_force(m, i, length, velocity, found), force, 1e-9 * (1 + fabs(force)));
    }
    CHECK(cav_actuation_inputs(m, state, v, effort, input) == 0);
    effort[0] = 2.5;
    CHECK(cav_actuation_inputs(m, state, v, effort, input) == 1);
    CHECK(input[0] == 2);
  }
  int strong = cav_object_find(m, CAV_OBJECT_ACTUATOR, "strong");
  double found, range[2];
  CHECK(cav_actuator_input(m, strong, 0, 0, 10, &found) == 0 && found == 0);
  cav_actuator_effort_range(m, 0, range);
  CHECK(range[0] == -2 && range[1] == 2);
  cav_actuator_effort_range(m, cav_object_find(m, CAV_OBJECT_ACTUATOR, "servo"), range);
  CHECK(range[0] == -30 && range[1] == 30);
  cav_state_free(state);
  free(q), free(v), free(moment), free(effort), free(input);
}

#ifdef CAVORT_HAVE_MUJOCO
// a site that pulls against another one: MuJoCo 2.2.2 composes their turns in the wrong order and so has another
// length, and moves dofs that carry both, though the length does not depend on them
static int joined(const cav_actuator *a) { return a->transmission == CAV_TRANSMISSION_SITE && a->reference >= 0; }

// parameters as the file means them
static void compare_parameters(const cav_model *m, const mjModel *p) {
  for (int i = 0; i < m->nu; i++) {
    const cav_actuator *a = &m->actuator[i];
    CHECK((int)a->activation == p->actuator_dyntype[i]);
    CHECK((int)a->gain == p->actuator_gaintype[i]);
    CHECK((int)a->bias == p->actuator_biastype[i]);
    for (int k = 0; k < 9; k++) CHECK_NEAR(a->gain_parameter[k], p->actuator_gainprm[i * mjNGAIN + k], 1e-15);
    for (int k = 0; k < 9; k++) CHECK_NEAR(a->bias_parameter[k], p->actuator_biasprm[i * mjNBIAS + k], 1e-15);
    for (int k = 0; k < 3; k++) CHECK_NEAR(a->activation_parameter[k], p->actuator_dynprm[i * mjNDYN + k], 1e-15);
    CHECK(a->ctrllimited == p->actuator_ctrllimited[i] && a->forcelimited == p->actuator_forcelimited[i]);
    CHECK(a->actlimited == p->actuator_actlimited[i]);
    if (!joined(a)) CHECK_NEAR(a->acceleration, p->actuator_acc0[i], 1e-10 * p->actuator_acc0[i]);
  }
}

// MuJoCo pulls muscles to their ends in a simulation, against soft limits and to a tolerance of 5 %
static void compare_strokes(const cav_model *m, mjModel *p) {
  double worst = 0;
  for (int i = 0; i < m->nu; i++) {
    const cav_actuator *a = &m->actuator[i];
    double *theirs = p->actuator_lengthrange + 2 * i, span = a->lengthrange[1] - a->lengthrange[0];
    if (a->gain != CAV_GAIN_MUSCLE) continue;
    for (int k = 0; k < 2; k++) {
      worst = fmax(worst, fabs(a->lengthrange[k] - theirs[k]) / span);
      // forces are compared on the same range
      theirs[k] = a->lengthrange[k];
    }
  }
  printf("  length range of muscles: %.1e of theirs\n", worst);
  // bound: limits of MuJoCo's simulation are soft; seen 3 %
  CHECK(worst < 0.06);
}

// joints over their ranges: below the least length of a muscle MuJoCo 2.2.2 has it push, many times as hard as it pulls
static void draw(const cav_model *m, double *q, double *scratch) {
  scene_posture(m, q, scratch, 0.5);
  for (int i = 0; i < m->njoint; i++) {
    const cav_joint *j = &m->joint[i];
    double middle = 0.5 * (j->range[0] + j->range[1]);
    if (j->limited && j->type != CAV_JOINT_BALL) q[j->q] = middle + 0.5 * (j->range[1] - j->range[0]) * scene_uniform();
  }
}

static void compare_state(const cav_model *m, cav_state *state, const mjModel *p, mjData *d, double worst[4]) {
  double *moment = scene_vector(m->nv);
  mj_forward(p, d);
  CHECK(cav_position(m, state, d->qpos) == CAV_OK);
  int activation = 0;
  for (int i = 0; i < m->nu; i++) {
    double length = cav_actuator_length(m, state, i, moment), scale = 1e-300, off = 0, velocity = 0;
    for (int j = 0; j < m->nv; j++) {
      scale = fmax(scale, fabs(moment[j]));
      if (joined(&m->actuator[i]) && moment[j] == 0) continue;
      off = fmax(off, fabs(moment[j] - d->actuator_moment[i * m->nv + j]));
      velocity += moment[j] * d->qvel[j];
    }
    if (joined(&m->actuator[i])) length = d->actuator_length[i], velocity = d->actuator_velocity[i];
    double input = m->actuator[i].activation == CAV_ACTIVATION_NONE ? d->ctrl[i] : d->act[activation++];
    double force = cav_actuator_force(m, i, length, velocity, input);
    worst[3] = fmax(worst[3], fabs(d->actuator_force[i]));
    double errors[3] = {fabs(length - d->actuator_length[i]), off / scale,
                        fabs(force - d->actuator_force[i]) / (1 + fabs(force))};
    for (int k = 0; k < 3; k++) {
      if (errors[k] > 1e-9 && worst[k] <= 1e-9) {
        printf("  %s: length %.12g %.12g, moments differ by %.1e, force %.12g %.12g\n", m->actuator[i].name, length,
               d->actuator_length[i], off, force, d->actuator_force[i]);
      }
      worst[k] = fmax(worst[k], errors[k]);
    }
  }
  free(moment);
}

static void test_peer(const cav_model *m, const char *path, const char *name) {
  char text[1000];
  mjModel *p = mj_loadXML(path, NULL, text, sizeof text);
  CHECK(p != NULL);
  if (!p) return;
  printf("%s\n", name);
  mjData *d = mj_makeData(p);
  cav_state *state = cav_state_new(m);
  double *scratch = scene_vector(m->nv), worst[4] = {0};
  compare_parameters(m, p);
  compare_strokes(m, p);
  for (int k = 0; k < STATES; k++) {
    mj_resetData(p, d);
    draw(m, d->qpos, scratch);
    scene_normals(d->qvel, m->nv, 1);
    for (int i = 0; i < p->nu; i++) d->ctrl[i] = 1.5 * scene_normal();
    // MuJoCo limits an activation as it integrates it
    for (int i = 0, at = 0; i < p->nu; i++) {
      if (m->actuator[i].activation != CAV_ACTIVATION_NONE) d->act[at++] = 0.25 + 0.25 * scene_uniform();
    }
    compare_state(m, state, p, d, worst);
  }
  // bound: rounding; seen 1e-14, 3e-14, 2e-13
  printf("  %d states: lengths %.1e, moments %.1e, forces %.1e, the largest %.3g\n", STATES, worst[0], worst[1],
         worst[2], worst[3]);
  for (int k = 0; k < 3; k++) CHECK(worst[k] < 1e-10);
  // the control: there are forces to compare
  CHECK(worst[3] > 0);
  cav_state_free(state);
  free(scratch);
  mj_deleteData(d);
  mj_deleteModel(p);
}
#endif

int main(void) {
  char path[4200];
  snprintf(path, sizeof path, "%s/tests/drives.xml", CAVORT_SOURCE_ROOT);
  cav_model *m = load(path);
  if (m) {
    test_projection(m);
    test_inputs(m);
#ifdef CAVORT_HAVE_MUJOCO
    test_peer(m, path, "drives");
#endif
  }
  cav_model_free(m);
#ifdef CAVORT_HAVE_MUJOCO
  const char *folder = check_shared_models(), *const shared[] = {"mujoco/arm26.xml", "mujoco/slider_crank.xml",
                                                                 "dm_control/fish.xml", "dm_control/quadruped.xml",
                                                                 "dm_control/manipulator.xml"};
  for (int i = 0; folder && i < 5; i++) {
    snprintf(path, sizeof path, "%s/%s", folder, shared[i]);
    m = load(path);
    if (m) test_peer(m, path, shared[i]);
    cav_model_free(m);
    folder = check_shared_models();
  }
#endif
  return check_result();
}
