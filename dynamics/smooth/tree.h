/// The passes over the tree that every evaluation makes, over numbers CAV_REAL (spatial.h): poses down it, velocities and
/// accelerations down it, forces up it. kinematics.c and rne.c take them one state at a time, four_states.c four at once, with
/// the same operations in the same order. Nothing here branches on a number of a state.
#ifndef CAVORT_TREE_H
#define CAVORT_TREE_H

#include "smooth.h"
#include "spatial.h"

/// A cav_pose of such numbers.
#ifndef CAV_POSE
#define CAV_POSE cav_pose
#endif

/// Where poses are read from and written to; arrays as in cav_state.
typedef struct tree_poses {
  const CAV_REAL *q, *sine, *cosine; ///< [nq], of half the turns of hinges [nhinge]
  CAV_POSE *link;
  CAV_REAL *com, *inertia, *reference, *axis;
  int referred; ///< 1: reference is given and stays
} tree_poses;

/// What moves along them; arrays as in cav_state.
typedef struct tree_motion {
  const CAV_REAL *com, *inertia, *reference, *axis;
  const CAV_REAL *v, *v_next, *a; ///< [nv]
  CAV_REAL *velocity, *velocity_next, *acceleration, *force;
} tree_motion;

/// Sines and cosines of n angles: Cody-Waite reduction to a quarter turn and Taylor sums to x^17, absolute error below
/// 3e-16. Without branches, so that the compiler takes several at once; good to |angle| < SINES_MOST, checked by the caller.
#define SINES_MOST 1e5
CAV_INLINE void sines(const double *restrict angle, double *restrict sine, double *restrict cosine, int n) {
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

// q := q (c, s axis): joint rotation about a unit axis of the link frame
CAV_INLINE void turn_about(CAV_REAL q[4], const CAV_REAL axis[3], CAV_REAL c, CAV_REAL s) {
  CAV_REAL turn[4] = {c, s * axis[0], s * axis[1], s * axis[2]};
  quat_mul(q, q, turn);
}

// the same about coordinate axis k; the axis in the world is a column of the rotation matrix. i, j follow k
CAV_INLINE void turn_aligned(CAV_REAL q[4], int k, int i, int j, double sign, CAV_REAL c, CAV_REAL s,
                             CAV_REAL axis[3]) {
  CAV_REAL w = q[0], x = q[1 + k], y = q[1 + i], z = q[1 + j];
  double twice = 2 * sign;
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
CAV_INLINE void keep_anchor(CAV_POSE *pose, const CAV_REAL anchor[3], const CAV_REAL local[3]) {
  CAV_REAL arm[3];
  quat_rotate(arm, pose->quat, local);
  sub3(pose->pos, anchor, arm);
}

// hinge: S = (a, anchor); the anchor becomes a moment arm once the reference point is known
CAV_INLINE void hinge(const cav_workspace *w, int index, const cav_joint *joint, const tree_poses *at, CAV_POSE *pose,
                      CAV_REAL *axis) {
  const CAV_REAL c = at->cosine[w->hinge_of[index]], s = at->sine[w->hinge_of[index]];
  CAV_REAL *anchor = axis + 3, local[3], arm[3];
  take_numbers(local, joint->pos, 3);
  copy3(anchor, pose->pos);
  if (!w->centred[index]) {
    quat_rotate(arm, pose->quat, local);
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
    default: {
      CAV_REAL about[3];
      take_numbers(about, joint->axis, 3);
      quat_rotate(axis, pose->quat, about);
      turn_about(pose->quat, about, c, s);
    }
  }
  if (!w->centred[index]) keep_anchor(pose, anchor, local);
}

// slide: S = (0, a)
CAV_INLINE void slide(const cav_joint *joint, CAV_REAL displacement, CAV_POSE *pose, CAV_REAL *axis) {
  CAV_REAL along[3];
  take_numbers(along, joint->axis, 3);
  zero3(axis);
  quat_rotate(axis + 3, pose->quat, along);
  axpy3(pose->pos, pose->pos, displacement, axis + 3);
}

// three rotations about the axes of the turned frame, through one anchor
CAV_INLINE void turning_axes(const CAV_REAL quat[4], const CAV_REAL anchor[3], CAV_REAL *axis) {
  CAV_REAL R[9];
  quat_matrix(R, quat);
  for (int k = 0; k < 3; k++) {
    column3(axis + 6 * k, R, k);
    copy3(axis + 6 * k + 3, anchor);
  }
}

// ball: S = (body axes, anchor)
CAV_INLINE void ball(const cav_joint *joint, const CAV_REAL *q, CAV_POSE *pose, CAV_REAL *axis) {
  CAV_REAL anchor[3], local[3];
  take_numbers(local, joint->pos, 3);
  quat_rotate(anchor, pose->quat, local);
  add3(anchor, anchor, pose->pos);
  quat_mul(pose->quat, pose->quat, q);
  keep_anchor(pose, anchor, local);
  turning_axes(pose->quat, anchor, axis);
}

// free: world translations, then rotations about body axes
CAV_INLINE void free_joint(const CAV_REAL *q, CAV_POSE *pose, CAV_REAL *axis) {
  copy3(pose->pos, q);
  memcpy(pose->quat, q + 3, 4 * sizeof *q);
  memset(axis, 0, 18 * sizeof *axis);
  for (int k = 0; k < 3; k++) axis[6 * k + 3 + k] = CAV_ALL(1);
  turning_axes(pose->quat, pose->pos, axis + 18);
}

// applies one joint to a link's pose and writes its motion subspace, with anchors in place of moments
CAV_INLINE void joint_act(const cav_model *model, const cav_workspace *w, int index, const tree_poses *at,
                          CAV_POSE *pose) {
  const cav_joint *joint = &model->joint[index];
  CAV_REAL *axis = at->axis + 6 * joint->dof;
  switch (joint->type) {
    case CAV_JOINT_HINGE:
      hinge(w, index, joint, at, pose, axis);
      break;
    case CAV_JOINT_SLIDE:
      slide(joint, at->q[joint->q] - joint->ref, pose, axis);
      break;
    case CAV_JOINT_BALL:
      ball(joint, at->q + joint->q, pose, axis);
      break;
    case CAV_JOINT_FREE:
      free_joint(at->q + joint->q, pose, axis);
      break;
  }
}

// rotations: linear part = (anchor - reference) x axis. Translations stay
CAV_INLINE void refer(CAV_REAL *axis, const CAV_REAL reference[3]) {
  CAV_REAL arm[3];
  sub3(arm, axis + 3, reference);
  cross3(axis + 3, arm, axis);
}

CAV_INLINE void place_link(const cav_model *model, const cav_workspace *w, const tree_poses *at, int i) {
  const cav_link *link = &model->link[i];
  const CAV_POSE *parent = &at->link[link->parent];
  CAV_POSE local, *pose = &local;
  CAV_REAL fixed[6];

  // frame at rest in the parent, then the joints in order
  take_numbers(fixed, link->pos, 3);
  transform(pose->pos, parent->pos, parent->rotation, fixed);
  if (w->straight[i]) {
    memcpy(pose->quat, parent->quat, sizeof pose->quat);
  } else {
    take_numbers(fixed, link->quat, 4);
    quat_mul(pose->quat, parent->quat, fixed);
  }
  for (int k = 0; k < link->njoint; k++) joint_act(model, w, link->joint + k, at, pose);
  quat_matrix(pose->rotation, pose->quat);

  // reference point of the tree, mass geometry, subspace at the reference
  CAV_REAL *reference = at->reference + 3 * i;
  if (!at->referred) copy3(reference, link->root == i ? pose->pos : at->reference + 3 * link->root);
  take_numbers(fixed, link->com, 3);
  transform(at->com + 3 * i, pose->pos, pose->rotation, fixed);
  take_numbers(fixed, link->inertia, 6);
  symmetric_rotate(at->inertia + 6 * i, pose->rotation, fixed);
  for (int k = link->dof; k < link->dof + link->ndof; k++) {
    if (w->turns[k]) refer(at->axis + 6 * k, reference);
  }
  at->link[i] = local;
}

// acceleration of a step, and the velocity at which bias and passive forces are taken
CAV_INLINE void find_motion(int nv, int mean, double inverse_h, const CAV_REAL *v, const CAV_REAL *v_next,
                            CAV_REAL *bias, CAV_REAL *a) {
  for (int i = 0; i < nv; i++) {
    a[i] = (v_next[i] - v[i]) * inverse_h;
    bias[i] = v[i];
    if (mean) bias[i] = 0.5 * (v[i] + v_next[i]);
  }
}

// wrench at the reference that moves a link's mass with velocity V and acceleration A
CAV_INLINE void link_force(CAV_REAL F[6], double mass, const CAV_REAL *inertia, const CAV_REAL *com,
                           const CAV_REAL *reference, const CAV_REAL *V, const CAV_REAL *A) {
  CAV_REAL d[3], v[3], a[3], momentum[3];
  sub3(d, com, reference);

  // force: mass times acceleration of the centre of mass
  copy3(v, V + 3);
  cross_add3(v, V, d);
  copy3(a, A + 3);
  cross_add3(a, A, d);
  cross_add3(a, V, v);
  scale3(F + 3, CAV_ALL(mass), a);

  // moment: rate of the angular momentum about the centre of mass, then about the reference
  symmetric_mul(F, inertia, A);
  symmetric_mul(momentum, inertia, V);
  cross_add3(F, V, momentum);
  cross_add3(F, d, F + 3);
}

CAV_INLINE void move_link(const cav_model *model, const cav_workspace *w, const tree_motion *m, int i) {
  const cav_link *link = &model->link[i];
  CAV_REAL V[6], W[6], A[6], before[6];
  copy6(V, m->velocity + 6 * link->parent);
  copy6(W, m->velocity_next + 6 * link->parent);
  copy6(A, m->acceleration + 6 * link->parent);
  copy6(before, V);

  // along the joints of the link
  for (int k = link->dof; k < link->dof + link->ndof; k++) {
    const CAV_REAL *S = m->axis + 6 * k;
    CAV_REAL motion[6];
    if (w->group[k]) copy6(before, V);
    scale6(motion, m->v[k], S);
    accumulate6(V, motion);
    axpy6(W, W, m->v_next[k], S);
    axpy6(A, A, m->a[k], S);
    motion_cross_add(A, before, motion);
  }
  copy6(m->velocity + 6 * i, V);
  copy6(m->velocity_next + 6 * i, W);
  copy6(m->acceleration + 6 * i, A);
  link_force(m->force + 6 * i, link->mass, m->inertia + 6 * i, m->com + 3 * i, m->reference + 3 * i, V, A);
}

// velocities, accelerations and inertial forces of all links; the base accelerates against gravity
CAV_INLINE void move_tree(const cav_model *model, const cav_workspace *w, double gravity, const tree_motion *m) {
  CAV_REAL *base = m->acceleration;
  zero3(base);
  for (int k = 0; k < 3; k++) base[3 + k] = CAV_ALL(gravity * model->gravity[k]);
  for (int i = 1; i < model->nlink; i++) move_link(model, w, m, i);
}

// forces of links become those of subtrees; u [nv] their components along each dof
CAV_INLINE void project_tree(const cav_model *model, const CAV_REAL *axis, CAV_REAL *force, CAV_REAL *u) {
  memset(force, 0, 6 * sizeof *force);
  for (int i = model->nlink - 1; i > 0; i--) {
    const cav_link *link = &model->link[i];
    const CAV_REAL *F = force + 6 * i;
    for (int k = link->dof; k < link->dof + link->ndof; k++) u[k] = dot6(axis + 6 * k, F);
    if (link->parent > 0) accumulate6(force + 6 * link->parent, F);
  }
}

// u += armature a + damping v of joints
CAV_INLINE void resist(const cav_workspace *w, int nv, int passive, const CAV_REAL *v, const CAV_REAL *a, CAV_REAL *u) {
  for (int i = 0; i < nv; i++) u[i] += w->armature[i] * a[i];
  if (!passive || !w->damped) return;
  for (int i = 0; i < nv; i++) u[i] += w->damping[i] * v[i];
}

#endif
