/// Configurations as a manifold: q (+) h v and its inverse. Quaternions advance by the exponential in body axes; the
/// rotation vector of a difference is the shortest, so its length is at most pi.
#include "math3.h"
#include "rotation.h"
#include "smooth.h"

void cav_configuration_reset(const cav_model *model, double *q) {
  if (model->nq > 0) { memcpy(q, model->q0, (size_t)model->nq * sizeof *q); }
}

// index into q of a joint's quaternion, -1 if it has none
static int quaternion_of(const cav_joint *joint) {
  switch (joint->type) {
    case CAV_JOINT_FREE:
      return joint->q + 3;
    case CAV_JOINT_BALL:
      return joint->q;
    default:
      return -1;
  }
}

void cav_configuration_normalise(const cav_model *model, double *q) {
  for (int i = 0; i < model->njoint; i++) {
    int k = quaternion_of(&model->joint[i]);
    if (k >= 0) { quat_normalise(q + k); }
  }
}

// q_next = q exp(h w)
static void quat_advance(const double *q, const double *w, double h, double *q_next) {
  double angle[3], step[4];
  scale3(angle, h, w);
  quat_exp(step, angle);
  quat_mul(q_next, q, step);
  quat_normalise(q_next);
}

void cav_integrate(const cav_model *model, const double *q, const double *v, double h, double *q_next) {
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    const double *a = q + joint->q, *s = v + joint->dof;
    double *b = q_next + joint->q;
    switch (joint->type) {
      case CAV_JOINT_FREE:
        axpy3(b, a, h, s);
        quat_advance(a + 3, s + 3, h, b + 3);
        break;
      case CAV_JOINT_BALL:
        quat_advance(a, s, h, b);
        break;
      default:
        b[0] = a[0] + h * s[0];
    }
  }
}

void cav_configuration_perturb(const cav_model *model, int dof, double step, double *q) {
  const cav_joint *joint = &model->joint[model->dof[dof].joint];
  int k = dof - joint->dof, turning = quaternion_of(joint);
  if (joint->type == CAV_JOINT_FREE && k < 3) { turning = -1; }
  if (turning < 0) {
    q[joint->q + k] += step;
    return;
  }
  double w[3] = {0, 0, 0};
  w[joint->type == CAV_JOINT_FREE ? k - 3 : k] = 1;
  quat_advance(q + turning, w, step, q + turning);
}

// w = log(a^-1 b) / h
static void quat_rate(const double *a, const double *b, double h, double *w) {
  double from[4], to[4], between[4];
  quat_conjugate(from, a);
  memcpy(to, b, sizeof to);
  quat_normalise(from);
  quat_normalise(to);
  quat_mul(between, from, to);
  quat_log(w, between);
  scale3(w, 1 / h, w);
}

void cav_difference(const cav_model *model, const double *q0, const double *q1, double h, double *v) {
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    const double *a = q0 + joint->q, *b = q1 + joint->q;
    double *s = v + joint->dof;
    switch (joint->type) {
      case CAV_JOINT_FREE:
        sub3(s, b, a);
        scale3(s, 1 / h, s);
        quat_rate(a + 3, b + 3, h, s + 3);
        break;
      case CAV_JOINT_BALL:
        quat_rate(a, b, h, s);
        break;
      default:
        s[0] = (b[0] - a[0]) / h;
    }
  }
}

// whether dof k starts three rotations about axes of the turned body
static int starts_turn(const cav_model *model, int k) {
  const cav_joint *joint = &model->joint[model->dof[k].joint];
  return (joint->type == CAV_JOINT_BALL && k == joint->dof) || (joint->type == CAV_JOINT_FREE && k == joint->dof + 3);
}

// r = sum of three axes times a column of a 3 x 3 matrix
static void mix(double r[6], const double *axes, const double T[9], int column) {
  scale6(r, T[column], axes);
  axpy6(r, r, T[3 + column], axes + 6);
  axpy6(r, r, T[6 + column], axes + 12);
}

void cav_displaced_twists(const cav_model *model, double distance, const double *v, const double *axis, double *by_q,
                          double *by_v) {
  for (int k = 0; k < model->nv; k++) {
    if (!starts_turn(model, k)) {
      copy6(by_q + 6 * k, axis + 6 * k);
      scale6(by_v + 6 * k, distance, axis + 6 * k);
      continue;
    }
    // the rotation on the way turns the first into the axes there, the right Jacobian of it the second
    double back[3], on[3], quat[4], carried[9], jacobian[9];
    scale3(back, -distance, v + k);
    scale3(on, distance, v + k);
    quat_exp(quat, back);
    quat_matrix(carried, quat);
    cav_rotation_jacobian(on, jacobian);
    for (int i = 0; i < 3; i++) {
      mix(by_q + 6 * (k + i), axis + 6 * k, carried, i);
      mix(by_v + 6 * (k + i), axis + 6 * k, jacobian, i);
      scale6(by_v + 6 * (k + i), distance, by_v + 6 * (k + i));
    }
    k += 2;
  }
}
