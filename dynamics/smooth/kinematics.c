/// Poses of links, their centres of mass and world inertias, motion subspaces of dofs, tendon lengths: all that depends
/// on q alone except contacts and limits. One pass down the tree. Joints of a link act in the order of the file, each
/// about an axis and anchor in the link frame as the joints before it have left it (MJCF's convention).
///
/// Spatial vectors are taken in world axes at the position of the tree's root link, one point for the whole tree: going
/// from link to link they are only added, never transformed.
#include "half_step.h"
#include "math3.h"
#include "smooth.h"

// sines and cosines of n angles: Cody-Waite reduction to a quarter turn and Taylor sums to x^17, absolute error below
// 3e-16. Without branches, so that the compiler takes several at once; good to |angle| < 1e5, checked by the caller
static void sines(const double *angle, double *sine, double *cosine, int n) {
  // pi/2 in three parts, the first two with 20 zero bits at their end
  static const double high = 0x1.921fb544p+0, middle = 0x1.0b4611a6p-34, low = 0x1.3198a2e037073p-69;
  static const double to_integer = 6755399441055744.0, quarters = 0.63661977236758134308;
  for (int i = 0; i < n; i++) {
    double k = (angle[i] * quarters + to_integer) - to_integer;
    double x = ((angle[i] - k * high) - k * middle) - k * low, x2 = x * x;
    double s = 1.0 / 355687428096000.0, c = 1.0 / 20922789888000.0;
    s = s * x2 - 1.0 / 1307674368000.0;
    s = s * x2 + 1.0 / 6227020800.0;
    s = s * x2 - 1.0 / 39916800.0;
    s = s * x2 + 1.0 / 362880.0;
    s = s * x2 - 1.0 / 5040.0;
    s = s * x2 + 1.0 / 120.0;
    s = s * x2 - 1.0 / 6.0;
    s = x + x * x2 * s;
    c = c * x2 - 1.0 / 87178291200.0;
    c = c * x2 + 1.0 / 479001600.0;
    c = c * x2 - 1.0 / 3628800.0;
    c = c * x2 + 1.0 / 40320.0;
    c = c * x2 - 1.0 / 720.0;
    c = c * x2 + 1.0 / 24.0;
    c = 1 - (0.5 * x2 - x2 * x2 * c);
    // quadrant: odd ones swap, the signs follow
    int quadrant = (int)k, odd = quadrant & 1;
    double a = odd ? c : s, b = odd ? s : c;
    sine[i] = quadrant & 2 ? -a : a;
    cosine[i] = (quadrant + 1) & 2 ? -b : b;
  }
}

// half angles of all hinges of q, by joint order of the work list
static void half_turns(cav_workspace *w, const double *q) {
  double largest = 0;
  for (int i = 0; i < w->nhinge; i++) {
    w->half[i] = 0.5 * (q[w->hinge[i]] - w->hinge_ref[i]);
    largest = fmax(largest, fabs(w->half[i]));
  }
  if (largest < 1e5) {
    sines(w->half, w->sine, w->cosine, w->nhinge);
    return;
  }
  for (int i = 0; i < w->nhinge; i++) {
    w->sine[i] = sin(w->half[i]);
    w->cosine[i] = cos(w->half[i]);
  }
}

// q := q (c, s axis): joint rotation about a unit axis of the link frame
static void turn_about(double q[4], const double axis[3], double c, double s) {
  double turn[4] = {c, s * axis[0], s * axis[1], s * axis[2]};
  quat_mul(q, q, turn);
}

// the same about coordinate axis k; the axis in the world is a column of the rotation matrix. i, j follow k
static inline void turn_aligned(double q[4], int k, int i, int j, double sign, double c, double s, double axis[3]) {
  double w = q[0], x = q[1 + k], y = q[1 + i], z = q[1 + j], twice = 2 * sign;
  s *= sign;
  axis[k] = sign - twice * (y * y + z * z);
  axis[i] = twice * (x * y + w * z);
  axis[j] = twice * (x * z - w * y);
  q[0] = w * c - x * s;
  q[1 + k] = x * c + w * s;
  q[1 + i] = y * c + z * s;
  q[1 + j] = z * c - y * s;
}

// after a rotation of the link frame by a joint: keeps the anchor where it was
static void keep_anchor(cav_pose *pose, const double anchor[3], const double local[3]) {
  double arm[3];
  quat_rotate(arm, pose->quat, local);
  sub3(pose->pos, anchor, arm);
}

// hinge: S = (a, anchor); the anchor becomes a moment arm once the reference point is known
static void hinge(const cav_workspace *w, int index, const cav_joint *joint, cav_pose *pose, double *axis) {
  double *anchor = axis + 3, c = w->cosine[w->hinge_of[index]], s = w->sine[w->hinge_of[index]];
  copy3(anchor, pose->pos);
  if (!w->centred[index]) {
    double arm[3];
    quat_rotate(arm, pose->quat, joint->pos);
    add3(anchor, anchor, arm);
  }
  switch (w->aligned[index]) {
    case 0:
      turn_aligned(pose->quat, 0, 1, 2, joint->axis[0], c, s, axis);
      break;
    case 1:
      turn_aligned(pose->quat, 1, 2, 0, joint->axis[1], c, s, axis);
      break;
    case 2:
      turn_aligned(pose->quat, 2, 0, 1, joint->axis[2], c, s, axis);
      break;
    default:
      quat_rotate(axis, pose->quat, joint->axis);
      turn_about(pose->quat, joint->axis, c, s);
  }
  if (!w->centred[index]) keep_anchor(pose, anchor, joint->pos);
}

// slide: S = (0, a)
static void slide(const cav_joint *joint, double displacement, cav_pose *pose, double *axis) {
  zero3(axis);
  quat_rotate(axis + 3, pose->quat, joint->axis);
  axpy3(pose->pos, pose->pos, displacement, axis + 3);
}

// three rotations about the axes of the turned frame, through one anchor
static void turning_axes(const double quat[4], const double anchor[3], double *axis) {
  double R[9];
  quat_matrix(R, quat);
  for (int k = 0; k < 3; k++) {
    column3(axis + 6 * k, R, k);
    copy3(axis + 6 * k + 3, anchor);
  }
}

// ball: S = (body axes, anchor)
static void ball(const cav_joint *joint, const double *q, cav_pose *pose, double *axis) {
  double anchor[3];
  quat_rotate(anchor, pose->quat, joint->pos);
  add3(anchor, anchor, pose->pos);
  quat_mul(pose->quat, pose->quat, q);
  keep_anchor(pose, anchor, joint->pos);
  turning_axes(pose->quat, anchor, axis);
}

// free: world translations, then rotations about body axes
static void free_joint(const double *q, cav_pose *pose, double *axis) {
  copy3(pose->pos, q);
  memcpy(pose->quat, q + 3, 4 * sizeof(double));
  memset(axis, 0, 18 * sizeof(double));
  for (int k = 0; k < 3; k++) { axis[6 * k + 3 + k] = 1; }
  turning_axes(pose->quat, pose->pos, axis + 18);
}

// applies one joint to a link's pose and writes its motion subspace, with anchors in place of moments
static void joint_act(const cav_model *model, const cav_workspace *w, int index, const double *q, cav_pose *pose,
                      double *axis) {
  const cav_joint *joint = &model->joint[index];
  switch (joint->type) {
    case CAV_JOINT_HINGE:
      hinge(w, index, joint, pose, axis + 6 * joint->dof);
      break;
    case CAV_JOINT_SLIDE:
      slide(joint, q[joint->q] - joint->ref, pose, axis + 6 * joint->dof);
      break;
    case CAV_JOINT_BALL:
      ball(joint, q + joint->q, pose, axis + 6 * joint->dof);
      break;
    case CAV_JOINT_FREE:
      free_joint(q + joint->q, pose, axis + 6 * joint->dof);
      break;
  }
}

// rotations: linear part = (anchor - reference) x axis. Translations, whose angular part is zero, stay
static void refer(double *axis, const double reference[3]) {
  if (axis[0] == 0 && axis[1] == 0 && axis[2] == 0) { return; }
  double arm[3];
  sub3(arm, axis + 3, reference);
  cross3(axis + 3, arm, axis);
}

static void place_link(const cav_model *model, const cav_workspace *w, const cav_posture *at, int i) {
  const cav_link *link = &model->link[i];
  const cav_pose *parent = &at->link[link->parent];
  cav_pose local, *pose = &local;

  // frame at rest in the parent, then the joints in order
  transform(pose->pos, parent->pos, parent->rotation, link->pos);
  if (w->straight[i]) {
    memcpy(pose->quat, parent->quat, sizeof pose->quat);
  } else {
    quat_mul(pose->quat, parent->quat, link->quat);
  }
  for (int k = 0; k < link->njoint; k++) joint_act(model, w, link->joint + k, at->q, pose, at->axis);
  quat_matrix(pose->rotation, pose->quat);

  // reference point of the tree, mass geometry, subspace at the reference
  double *reference = at->reference + 3 * i;
  if (!at->referred) copy3(reference, link->root == i ? pose->pos : at->reference + 3 * link->root);
  transform(at->com + 3 * i, pose->pos, pose->rotation, link->com);
  symmetric_rotate(at->inertia + 6 * i, pose->rotation, link->inertia);
  for (int k = 0; k < link->ndof; k++) refer(at->axis + 6 * (link->dof + k), reference);
  at->link[i] = local;
}

void cav_posture_place(const cav_model *model, cav_workspace *w, const cav_posture *at) {
  for (int i = 0; i < w->nquaternion; i++) quat_normalise(at->q + w->quaternion[i]);
  half_turns(w, at->q);
  for (int i = 1; i < model->nlink; i++) place_link(model, w, at, i);
}

void cav_kinematics(const cav_model *model, cav_state *state, const double *q) {
  // unit quaternions, whatever came in
  double *unit = state->work->q;
  if (unit != q && model->nq > 0) { memcpy(unit, q, (size_t)model->nq * sizeof *q); }
  const cav_posture at = {unit, state->link, state->com, state->inertia, state->reference, state->axis, 0};
  cav_posture_place(model, state->work, &at);
  if (state->work->half_steps) { state->work->half_steps->fresh = 0; }
  if (model->ntendon > 0) { cav_tendon_lengths(model, state); }
}

int cav_last_dof(const cav_model *model, int link) {
  while (link > 0 && model->link[link].ndof == 0) link = model->link[link].parent;
  return link > 0 ? model->link[link].dof + model->link[link].ndof - 1 : -1;
}
