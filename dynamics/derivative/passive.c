/// Passive forces in the derivatives, added entry by entry: armature, dampers and springs of joints, gravity
/// compensation, springs and dampers of tendons of constant arms. Limits and friction losses are row.c's.
#include "analytic.h"
#include "rotation.h"

static void add_diagonals(const cav_derivative_task *t) {
  const cav_workspace *w = t->state->work;
  for (int i = 0; i < t->nv; i++) {
    int at = i * (t->nv + 1);
    add_entry(t, at, 0, 0, w->armature[i]);
    if (!t->state->options.passive) continue;
    t->dv[at] += t->mean ? 0.5 * w->damping[i] : 0;
    t->dn[at] += (t->mean ? 0.5 : 1) * w->damping[i];
  }
}

// du/dq of the spring of three rotations
static void add_turning_spring(const cav_derivative_task *t, int dof, double stiffness, const double *q,
                               const double *rest) {
  double from[4], between[4], w[3], J[9];
  quat_conjugate(from, rest);
  quat_normalise(from);
  quat_mul(between, from, q);
  quat_log(w, between);
  cav_rotation_jacobian_inverse(w, J);
  for (int i = 0; i < 9; i++) t->dq[(dof + i / 3) * t->nv + dof + i % 3] += stiffness * J[i];
}

// by the velocities that implicit springs see; all dofs of a joint alike
static void add_springs_ahead(const cav_derivative_task *t) {
  const cav_workspace *w = t->state->work;
  const cav_springs_ahead ahead = cav_look_along_springs(t->state);
  for (int i = 0; i < w->nspring; i++) {
    const cav_joint *joint = &t->model->joint[w->spring[i]];
    if (!(joint->stiffness > 0)) continue;
    for (int k = joint->dof; k < t->nv && t->model->dof[k].joint == w->spring[i]; k++) {
      t->dv[k * (t->nv + 1)] -= ahead.now * joint->stiffness;
      t->dn[k * (t->nv + 1)] += ahead.next * joint->stiffness;
    }
  }
}

static void add_springs(const cav_derivative_task *t) {
  const cav_workspace *w = t->state->work;
  if (!t->state->options.passive) return;
  if (t->state->options.spring == CAV_SPRING_IMPLICIT) add_springs_ahead(t);
  for (int i = 0; i < w->nspring; i++) {
    const cav_joint *joint = &t->model->joint[w->spring[i]];
    const double *rest = t->model->q0 + joint->q, *q = w->q + joint->q;
    int linear = joint->type == CAV_JOINT_BALL ? 0 : joint->type == CAV_JOINT_FREE ? 3 : 1, dof = joint->dof;
    for (int k = 0; k < linear; k++) t->dq[(dof + k) * (t->nv + 1)] += joint->stiffness;
    if (joint->type == CAV_JOINT_FREE) add_turning_spring(t, dof + 3, joint->stiffness, q + 3, rest + 3);
    if (joint->type == CAV_JOINT_BALL) add_turning_spring(t, dof, joint->stiffness, q, rest);
  }
}

// first dof of the group that a dof is in
static int group_of(const cav_workspace *w, int dof) {
  while (!w->group[dof]) dof--;
  return dof;
}

// gravity compensation: a force at a body's centre of mass that keeps its direction, where subtrees carry it along
// turning
static void add_buoyancy(const cav_derivative_task *t) {
  const cav_workspace *w = t->state->work;
  if (!t->state->options.passive || !t->state->options.gravity) return;
  for (int i = 0; i < w->nbuoy; i++) {
    const cav_body *body = &t->model->body[w->buoy[i]];
    const double *reference = t->state->reference + 3 * body->link;
    cav_pose pose;
    double force[3];
    cav_mass_pose(t->state, body, &pose);
    scale3(force, body->buoyancy * body->mass, t->model->gravity);
    for (int j = cav_last_dof(t->model, body->link); j >= 0; j = w->parent[j]) {
      double back[3], S[6];
      cross3(back, force, t->state->axis + 6 * j);
      for (int k = cav_last_dof(t->model, body->link); k >= 0; k = w->parent[k]) {
        motion_at(S, t->state->axis + 6 * k, reference, pose.pos);
        t->dq[k * t->nv + j] += dot3(S + 3, back);
      }
    }
  }
}

// less the part of it that actuators give: of their dofs S_k . force, by whatever moves the point or turns the axis
static void leave_to_actuators(const cav_derivative_task *t) {
  const cav_workspace *w = t->state->work;
  if (!t->state->options.passive || !t->state->options.gravity) return;
  for (int i = 0; i < w->nbuoy; i++) {
    int link = t->model->body[w->buoy[i]].link, last = cav_last_dof(t->model, link);
    const double *reference = t->state->reference + 3 * link;
    double point[3], force[3], S[2][6], rate[3];
    cav_buoyancy(t->model, t->state, w->buoy[i], point, force);
    for (int k = last; k >= 0; k = w->parent[k]) {
      if (!t->model->joint[t->model->dof[k].joint].lifts) continue;
      motion_at(S[0], t->state->axis + 6 * k, reference, point);
      for (int j = last; j >= 0; j = w->parent[j]) {
        motion_at(S[1], t->state->axis + 6 * j, reference, point);
        // axes of one group turn with each other, those further out with none within
        int turns = j <= k || group_of(w, j) == group_of(w, k);
        cross3(rate, S[turns], S[!turns] + 3);
        t->dq[k * t->nv + j] -= dot3(rate, force);
      }
    }
  }
}

static void add_tendon_forces(const cav_derivative_task *t) {
  const cav_workspace *w = t->state->work;
  const cav_springs_ahead ahead = cav_look_along_springs(t->state);
  if (!t->state->options.passive) return;
  for (int i = 0; i < w->ntendon_spring; i++) {
    const cav_tendon *tendon = &t->model->tendon[w->tendon_spring[i]];
    double half = 0.5 * tendon->damping;
    int slack = cav_tendon_stretch(tendon, cav_tendon_spring_length(t->state, w->tendon_spring[i])) == 0;
    double stiffness = slack ? 0 : tendon->stiffness, implicit = stiffness > 0 ? stiffness : 0;
    add_along_tendon(t, w->tendon_spring[i], stiffness, (t->mean ? half : tendon->damping) - ahead.now * implicit,
                     (t->mean ? half : 0) + ahead.next * implicit);
  }
}

void cav_derivative_passive(const cav_derivative_task *t) {
  add_diagonals(t);
  add_springs(t);
  add_buoyancy(t);
  leave_to_actuators(t);
  add_tendon_forces(t);
}
