/// Configurations as a manifold: integrate and difference undo each other for every joint, near and at half a turn, for
/// tiny and zero moves; a quaternion and its negative are one configuration; normalising survives any scale.
#include "scene.h"

// rotates every quaternion's sign: the same configuration
static void flip(const cav_model *model, double *q) {
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    int first = joint->type == CAV_JOINT_FREE ? 3 : 0;
    if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL)
      for (int k = 0; k < 4; k++) q[joint->q + first + k] *= -1;
  }
}

// scales the rotation parts of a tangent to a given angle
static void set_angles(const cav_model *model, double *v, double angle) {
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    if (joint->type != CAV_JOINT_FREE && joint->type != CAV_JOINT_BALL) continue;
    double *w = v + joint->dof + (joint->type == CAV_JOINT_FREE ? 3 : 0);
    double n = scene_norm(w, 3);
    for (int k = 0; k < 3; k++) w[k] *= angle / n;
  }
}

static void round_trips(const cav_model *model, double angle, double bound) {
  double *q = scene_vector(model->nq), *q1 = scene_vector(model->nq), *q2 = scene_vector(model->nq);
  double *v = scene_vector(model->nv), *back = scene_vector(model->nv);
  const double h = 0.01;
  for (int k = 0; k < 200; k++) {
    scene_posture(model, q, v, 1);
    scene_normals(v, model->nv, 1);
    set_angles(model, v, angle / h);
    cav_integrate(model, q, v, h, q1);
    cav_difference(model, q, q1, h, back);
    CHECK_NEAR_ALL(back, v, model->nv, bound);

    // the same with the other sign of the quaternions
    flip(model, q1);
    cav_difference(model, q, q1, h, back);
    CHECK_NEAR_ALL(back, v, model->nv, bound);

    // and the other way round: from q by the difference to q1
    cav_integrate(model, q, back, h, q2);
    cav_difference(model, q1, q2, 1, back);
    CHECK(scene_norm(back, model->nv) <= 1e-13);
  }
  free(q), free(q1), free(q2), free(v), free(back);
}

// half a turn has two logarithms: either is right, its length must be pi
static void half_turn(const cav_model *model) {
  double *q = scene_vector(model->nq), *q1 = scene_vector(model->nq), *v = scene_vector(model->nv);
  cav_configuration_reset(model, q);
  scene_normals(v, model->nv, 1);
  set_angles(model, v, M_PI);
  cav_integrate(model, q, v, 1, q1);
  cav_difference(model, q, q1, 1, v);
  // bound: rounding of one arctangent; seen 0
  CHECK_NEAR(scene_norm(v + 3, 3), M_PI, 1e-14);
  free(q), free(q1), free(v);
}

static void small_moves(const cav_model *model) {
  double *q = scene_vector(model->nq), *q1 = scene_vector(model->nq), *v = scene_vector(model->nv);
  double *back = scene_vector(model->nv);
  static const double sizes[] = {0, 1e-300, 1e-160, 1e-20, 1e-12, 1e-9, 1e-5, 0.9e-4, 1.1e-4, 3e-4};
  for (unsigned k = 0; k < sizeof sizes / sizeof *sizes; k++) {
    // from zero, so that positions do not round the move away
    memset(q, 0, (size_t)model->nq * sizeof *q);
    cav_configuration_normalise(model, q);
    scene_normals(v, model->nv, 1);
    for (int i = 0; i < model->nv; i++) v[i] *= sizes[k];
    cav_integrate(model, q, v, 1, q1);
    cav_difference(model, q, q1, 1, back);
    // bound relative to the move, both sides of the switch to series; seen 4e-16
    for (int i = 0; i < model->nv; i++) CHECK_NEAR(back[i], v[i], 1e-14 * sizes[k]);
  }
  free(q), free(q1), free(v), free(back);
}

static void normalising(const cav_model *model) {
  static const double scales[] = {0, 1e-320, 1e-200, 1e-120, 1, 1e120, 1e300};
  double *q = scene_vector(model->nq), *v = scene_vector(model->nv);
  for (unsigned k = 0; k < sizeof scales / sizeof *scales; k++) {
    scene_posture(model, q, v, 1);
    double unit[4];
    memcpy(unit, q + 3, sizeof unit);
    for (int i = 0; i < 4; i++) q[3 + i] *= scales[k];
    cav_configuration_normalise(model, q);
    // bound: three roundings; denormal input keeps two digits
    CHECK_NEAR(scene_norm(q + 3, 4), 1, 1e-15);
    if (scales[k] > 1e-300) CHECK_NEAR_ALL(q + 3, unit, 4, 1e-15);
    if (scales[k] == 0) CHECK(q[3] == 1 && q[4] == 0);
  }
  free(q), free(v);
}

// q_next may be q; the integral of a constant velocity is one move; order of joints as in the file
static void in_place(const cav_model *model) {
  double *q = scene_vector(model->nq), *q1 = scene_vector(model->nq), *v = scene_vector(model->nv);
  scene_posture(model, q, v, 1);
  scene_normals(v, model->nv, 1);
  cav_integrate(model, q, v, 0.3, q1);
  cav_integrate(model, q, v, 0.1, q);
  cav_integrate(model, q, v, 0.2, q);
  // bound: a few roundings of numbers about 1; seen 2e-16
  CHECK_NEAR_ALL(q, q1, model->nq, 1e-14);
  // control: a different velocity does not arrive there
  v[4] += 1e-6;
  cav_integrate(model, q, v, 0, q);
  cav_integrate(model, q1, v, 0.3, q1);
  CHECK(scene_error(q, q1, model->nq) > 1e-9);
  free(q), free(q1), free(v);
}

int main(void) {
  cav_model *model = scene_load(scene_joints);
  CHECK(model != NULL);
  if (!model) return check_result();
  // bound: rounding of positions about 3 m divided by h = 0.01; seen 1e-13
  round_trips(model, 1, 1e-12);
  round_trips(model, 3, 1e-12);
  // bound: next to half a turn the axis is still well defined; seen 1e-13
  round_trips(model, M_PI - 1e-6, 1e-12);
  half_turn(model);
  small_moves(model);
  normalising(model);
  in_place(model);
  cav_model_free(model);
  return check_result();
}
