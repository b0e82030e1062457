/// Forces of dofs and tendons that do not pass through links: armature, damping, springs. Springs of free and ball
/// joints act along the rotation vector from q0, in body axes; implicit ones see it change by the angular velocity
/// itself, of which its rate is the symmetric part but for the second order in the rotation from rest. Damping of
/// joints and tendons is linear in one velocity, which the order of the step chooses. Also gravity compensation, a
/// force at the centre of mass of a body. Fluids: fluid.c.
#include "math3.h"
#include "tree.h"

// u += k log(rest^-1 q)
static void turning_spring(double stiffness, const double *q, const double *rest, double *u) {
  double from[4], between[4], w[3];
  quat_conjugate(from, rest);
  quat_normalise(from);
  quat_mul(between, from, q);
  quat_log(w, between);
  axpy3(u, u, stiffness, w);
}

static void joint_spring(const cav_model *model, const cav_joint *joint, const double *q, double *u) {
  const double *rest = model->q0 + joint->q, *at = q + joint->q;
  double *to = u + joint->dof, stretch[3];
  switch (joint->type) {
    case CAV_JOINT_FREE:
      sub3(stretch, at, rest);
      axpy3(to, to, joint->stiffness, stretch);
      turning_spring(joint->stiffness, at + 3, rest + 3, to + 3);
      break;
    case CAV_JOINT_BALL:
      turning_spring(joint->stiffness, at, rest, to);
      break;
    default:
      to[0] += joint->stiffness * (at[0] - joint->springref);
  }
}

void cav_buoyancy(const cav_model *model, const cav_state *state, int body, double point[3], double force[3]) {
  const cav_body *b = &model->body[body];
  const cav_pose *link = &state->link[b->link];
  quat_rotate(point, b->quat, b->com);
  add3(point, point, b->pos);
  transform(point, link->pos, link->rotation, point);
  // the force is against gravity; what is left to the inverse is less by it
  scale3(force, b->buoyancy * b->mass, model->gravity);
}

void cav_add_buoyancy(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  if (!state->options.passive || !state->options.gravity) { return; }
  for (int i = 0; i < w->nbuoy; i++) {
    int link = model->body[w->buoy[i]].link;
    double point[3], force[3];
    cav_buoyancy(model, state, w->buoy[i], point, force);
    push_at(state->force + 6 * link, state->reference + 3 * link, point, force);
  }
}

// where actuators give the compensation it is left to the inverse
static void leave_to_actuators(const cav_model *model, const cav_state *state, double *u) {
  const cav_workspace *w = state->work;
  if (!state->options.passive || !state->options.gravity) { return; }
  for (int i = 0; i < w->nbuoy; i++) {
    int link = model->body[w->buoy[i]].link;
    double point[3], force[3], linear[3];
    cav_buoyancy(model, state, w->buoy[i], point, force);
    for (int k = cav_last_dof(model, link); k >= 0; k = w->parent[k]) {
      if (!model->joint[model->dof[k].joint].lifts) continue;
      velocity_at(linear, state->axis + 6 * k, state->reference + 3 * link, point);
      u[k] -= dot3(linear, force);
    }
  }
}

// what springs of joints see of the velocities, where they are implicit
static void look_along_springs(const cav_model *model, const cav_state *state, double *u) {
  const cav_workspace *w = state->work;
  const cav_springs_ahead ahead = cav_look_along_springs(state);
  for (int i = 0; i < w->nspring; i++) {
    const cav_joint *joint = &model->joint[w->spring[i]];
    if (!(joint->stiffness > 0)) continue;
    for (int k = joint->dof; k < model->nv && model->dof[k].joint == w->spring[i]; k++)
      u[k] += joint->stiffness * ahead.next * w->v_next[k] - joint->stiffness * ahead.now * w->v[k];
  }
}

void cav_add_resistance(const cav_model *model, const cav_state *state, const double *v, const double *a, double *u) {
  resist(state->work, model->nv, state->options.passive, v, a, u);
}

void cav_add_spring_forces(const cav_model *model, const cav_state *state, double *u) {
  const cav_workspace *w = state->work;
  if (!state->options.passive) { return; }
  for (int i = 0; i < w->nspring; i++) { joint_spring(model, &model->joint[w->spring[i]], w->q, u); }
  if (state->options.spring == CAV_SPRING_IMPLICIT) { look_along_springs(model, state, u); }
  if (w->nbuoy > 0) { leave_to_actuators(model, state, u); }
}

double cav_tendon_spring_length(const cav_state *state, int k) {
  const cav_springs_ahead ahead = cav_look_along_springs(state);
  double length = state->tendon_length[k];
  if (ahead.next == 0 || !(state->model->tendon[k].stiffness > 0)) { return length; }
  length += ahead.next * cav_tendon_velocity(state, k, state->work->v_next);
  return ahead.now == 0 ? length : length - ahead.now * cav_tendon_velocity(state, k, state->work->v);
}

void cav_add_tendon_forces(const cav_model *model, const cav_state *state, const double *v, double *u) {
  const cav_workspace *w = state->work;
  if (!state->options.passive) { return; }
  for (int i = 0; i < w->ntendon_spring; i++) {
    int k = w->tendon_spring[i];
    const cav_tendon *tendon = &model->tendon[k];
    double stretch = cav_tendon_stretch(tendon, cav_tendon_spring_length(state, k));
    double force = tendon->stiffness * stretch + tendon->damping * cav_tendon_velocity(state, k, v);
    cav_tendon_pull(state, k, force, u);
  }
}
