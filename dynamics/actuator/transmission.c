/// How actuators move the model: length of each one's transmission and its moments, what a unit force of it adds to u.
/// Joint: gear times the coordinate, or along the three or six dofs of a ball or free joint. Tendon: gear times its
/// length. Site: a wrench in the site's axes, or in those of a reference site whose branch takes the reaction.
/// Slider-crank: a rod of fixed length from the crank's site to a slider on the z axis of the other; where the rod is
/// too short to reach the axis, the slider is at the foot of the perpendicular. MJCF's definitions; a reference site's
/// turning is not part of the moments there, and so not here. Only dofs that move one end relative to the other are
/// listed.
#include "actuator.h"
#include "math3.h"

/// A force on one link and its reaction on another, in world axes.
typedef struct pull {
  int link[2];
  double point[2][3], force[3], torque[2][3];
} pull;

// what the ends of a site or crank transmission are fixed in; the world where there is no second one
static void ends(const cav_model *model, const cav_actuator *a, int link[2]) {
  link[0] = model->site[a->target].link;
  link[1] = a->reference >= 0 ? model->site[a->reference].link : 0;
}

// dofs between two links and their nearest common ancestor; returns their number
static int dofs_between(const cav_model *model, const int link[2], int *dof) {
  int i = cav_last_dof(model, link[0]), j = cav_last_dof(model, link[1]), n = 0;
  while (i != j) {
    int later = i > j ? i : j;
    if (dof) { dof[n] = later; }
    n++;
    if (i > j) {
      i = model->dof[i].parent;
    } else {
      j = model->dof[j].parent;
    }
  }
  return n;
}

int cav_transmission_dofs(const cav_model *model, int actuator, int *dof) {
  const cav_actuator *a = &model->actuator[actuator];
  int link[2], n = 1, first = 0;
  switch (a->transmission) {
    case CAV_TRANSMISSION_SITE:
    case CAV_TRANSMISSION_CRANK:
      ends(model, a, link);
      return dofs_between(model, link, dof);
    case CAV_TRANSMISSION_TENDON:
      n = model->tendon[a->target].ndof;
      for (int k = 0; dof && k < n; k++) { dof[k] = model->tendon_dof[model->tendon[a->target].dof + k]; }
      return n;
    default:
      if (model->joint[a->target].type == CAV_JOINT_FREE) { n = 6; }
      if (model->joint[a->target].type == CAV_JOINT_BALL) { n = 3; }
      first = model->joint[a->target].dof;
      for (int k = 0; dof && k < n; k++) { dof[k] = first + k; }
      return n;
  }
}

// power of the pull at unit velocity of one dof, on the first link or as reaction on the second
static double power(const cav_state *state, const pull *p, int end, int dof) {
  const double *axis = state->axis + 6 * dof;
  double velocity[3];
  velocity_at(velocity, axis, state->reference + 3 * state->model->dof[dof].link, p->point[end]);
  return dot3(p->force, velocity) + dot3(p->torque[end], axis);
}

// moments along the dofs of dofs_between, in its order
static void project(const cav_state *state, const pull *p, double *moment) {
  const cav_model *model = state->model;
  int i = cav_last_dof(model, p->link[0]), j = cav_last_dof(model, p->link[1]), n = 0;
  while (i != j) {
    if (i > j) {
      moment[n++] = power(state, p, 0, i);
      i = model->dof[i].parent;
    } else {
      moment[n++] = -power(state, p, 1, j);
      j = model->dof[j].parent;
    }
  }
}

// rotation vector of a ball joint dotted with the gear, or 0 for a free joint; moments with the gear in the joint's
// axes or in its parent's
static double along_turning(const cav_state *state, const cav_actuator *a, const cav_joint *joint, double *moment) {
  int free = joint->type == CAV_JOINT_FREE;
  const double *quat = state->work->q + joint->q + 3 * free, *gear = a->gear + 3 * free;
  double *turning = moment + 3 * free, w[3], back[4];
  copy3(turning, gear);
  if (a->transmission == CAV_TRANSMISSION_JOINT_IN_PARENT) {
    quat_conjugate(back, quat);
    quat_rotate(turning, back, gear);
  }
  if (free) {
    copy3(moment, a->gear);
    return 0;
  }
  quat_log(w, quat);
  return dot3(turning, w);
}

static double along_joint(const cav_state *state, const cav_actuator *a, double *moment) {
  const cav_joint *joint = &state->model->joint[a->target];
  if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL) { return along_turning(state, a, joint, moment); }
  moment[0] = a->gear[0];
  return a->gear[0] * state->work->q[joint->q];
}

static double along_tendon(const cav_state *state, const cav_actuator *a, double *moment) {
  const cav_tendon *tendon = &state->model->tendon[a->target];
  for (int k = 0; k < tendon->ndof; k++) { moment[k] = a->gear[0] * state->tendon_arm[tendon->dof + k]; }
  return a->gear[0] * state->tendon_length[a->target];
}

// wrench at a site; with a reference, the length is that of the pose between the two along the gear
static double at_site(const cav_state *state, const cav_actuator *a, double *moment) {
  const cav_model *model = state->model;
  cav_pose site, from = {.rotation = {0}};
  pull p = {.force = {0}};
  double length = 0;
  ends(model, a, p.link);
  cav_object_pose(model, state, CAV_OBJECT_SITE, a->target, &site);
  copy3(p.point[0], site.pos);
  if (a->reference >= 0) {
    double apart[3], back[4], between[4];
    cav_object_pose(model, state, CAV_OBJECT_SITE, a->reference, &from);
    copy3(p.point[1], from.pos);
    sub3(apart, site.pos, from.pos);
    rotate_back(apart, from.rotation, apart);
    length = dot3(a->gear, apart);
    quat_conjugate(back, from.quat);
    quat_mul(between, back, site.quat);
    quat_log(apart, between);
    length += dot3(a->gear + 3, apart);
  }
  const double *axes = a->reference >= 0 ? from.rotation : site.rotation;
  rotate(p.force, axes, a->gear);
  rotate(p.torque[0], axes, a->gear + 3);
  copy3(p.torque[1], p.torque[0]);
  project(state, &p, moment);
  return length;
}

// place of the slider along its axis: length = a.d - sqrt((a.d)^2 + rod^2 - d.d), d from slider site to crank
static double at_crank(const cav_state *state, const cav_actuator *a, int n, double *moment) {
  const cav_model *model = state->model;
  cav_pose crank, slider;
  pull p = {.force = {0}};
  double axis[3], apart[3], turned[3];
  ends(model, a, p.link);
  cav_object_pose(model, state, CAV_OBJECT_SITE, a->target, &crank);
  cav_object_pose(model, state, CAV_OBJECT_SITE, a->reference, &slider);
  copy3(p.point[0], crank.pos);
  copy3(p.point[1], slider.pos);
  column3(axis, slider.rotation, 2);
  sub3(apart, crank.pos, slider.pos);
  double along = dot3(apart, axis), square = along * along + a->cranklength * a->cranklength - dot3(apart, apart);
  double root = square > 0 ? sqrt(square) : 0, lean = square > 0 ? 1 - along / root : 1;
  // gradient along d, and along the axis, which turns with the slider's link
  scale3(p.force, lean, axis);
  if (square > 0) { axpy3(p.force, p.force, 1 / root, apart); }
  scale3(turned, -lean, apart);
  cross3(p.torque[1], axis, turned);
  project(state, &p, moment);
  for (int k = 0; k < n; k++) { moment[k] *= a->gear[0]; }
  return a->gear[0] * (along - root);
}

double cav_transmission_length(const cav_state *state, int actuator, double *moment) {
  const cav_actuator *a = &state->model->actuator[actuator];
  switch (a->transmission) {
    case CAV_TRANSMISSION_TENDON:
      return along_tendon(state, a, moment);
    case CAV_TRANSMISSION_SITE:
      return at_site(state, a, moment);
    case CAV_TRANSMISSION_CRANK:
      return at_crank(state, a, cav_transmission_dofs(state->model, actuator, NULL), moment);
    default:
      return along_joint(state, a, moment);
  }
}

double cav_actuator_length(const cav_model *model, cav_state *state, int actuator, double *moment) {
  cav_workspace *w = state->work;
  int start = w->gear_start[actuator];
  double length = cav_transmission_length(state, actuator, w->gear + start);
  if (moment) {
    memset(moment, 0, (size_t)model->nv * sizeof *moment);
    for (int e = start; e < w->gear_start[actuator + 1]; e++) { moment[w->gear_dof[e]] = w->gear[e]; }
  }
  return length;
}

double cav_actuator_velocity(cav_state *state, int actuator, const double *v) {
  cav_workspace *w = state->work;
  int start = w->gear_start[actuator];
  double sum = 0;
  cav_transmission_length(state, actuator, w->gear + start);
  for (int e = start; e < w->gear_start[actuator + 1]; e++) { sum += w->gear[e] * v[w->gear_dof[e]]; }
  return sum;
}
