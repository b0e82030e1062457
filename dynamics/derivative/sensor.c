/// Derivatives of sensor readings by q and v_next, in closed form at the state's last evaluation. What is fixed in a
/// link moves with the axes of the dofs below it: a point by S at the point, a direction by the angular part. The
/// velocity of a link changes by (drift of the axis) - V x S when a dof moves, the drift being (motion before the
/// joint) x S, which cav_derivatives has left in the state. A pose in a moving frame changes by the twist of the object
/// less that of the frame, both at the object. Readings do not depend on v. Not offered: forces, accelerations, ranges,
/// limits, actuators, velocities in another frame, readings that are cut off.
#include "derivative.h"
#include "math3.h"

/// One call. Outputs may be NULL.
typedef struct task {
  const cav_model *model;
  const cav_state *state;
  const double *drift; ///< [nv*6] at v_next
  int nv;
  double *dq, *dn;
} task;

static void put(double *out, int nv, int row, int column, double value) {
  if (out) out[row * nv + column] = value;
}

static void put3(double *out, int nv, int column, const double x[3]) {
  for (int i = 0; i < 3; i++) put(out, nv, i, column, x[i]);
}

// change of the velocity of a link by a dof, about a point fixed in space; S, drift and V about that point
static void velocity_rate(double r[6], const double S[6], const double drift[6], const double V[6]) {
  double carried[6] = {0};
  motion_cross_add(carried, V, S);
  axpy6(r, drift, -1, carried);
}

// column of a vector x read in axes that turn: rate of x by q with what turns taken off, and by v_next
static void put_turned(const task *t, const cav_pose *pose, const double turn[3], const double x[3],
                       const double rate[3], const double by_next[3], int j) {
  double r[3];
  cross3(r, x, turn);
  add3(r, r, rate);
  rotate_back(r, pose->rotation, r);
  put3(t->dq, t->nv, j, r);
  rotate_back(r, pose->rotation, by_next);
  put3(t->dn, t->nv, j, r);
}

// adds to a column of a pose what a dof gives that moves the object (sign 1) or the frame it is read in (-1)
static void add_pose(const task *t, const cav_sensor *sensor, const cav_pose *pose, const cav_pose *from, double sign,
                     int j) {
  double S[6], x[4] = {0}, turn[4] = {0};
  motion_at(S, t->state->axis + 6 * j, t->state->reference + 3 * t->model->dof[j].link, pose->pos);
  if (sensor->type == CAV_SENSOR_FRAMEPOS) {
    rotate_back(x, from->rotation, S + 3);
  } else if (sensor->type == CAV_SENSOR_FRAMEQUAT) {
    double back[4], quat[4];
    scale3(turn + 1, 0.5, S);
    quat_mul(quat, turn, pose->quat);
    quat_conjugate(back, from->quat);
    quat_mul(x, back, quat);
  } else {
    double axis[3];
    column3(axis, pose->rotation, sensor->type - CAV_SENSOR_FRAMEXAXIS);
    cross3(axis, S, axis);
    rotate_back(x, from->rotation, axis);
  }
  for (int i = 0; i < sensor->dim; i++) {
    if (t->dq) t->dq[i * t->nv + j] += sign * x[i];
  }
}

// a pose read in another frame: dofs that move both drop out
static void referred_pose(const task *t, const cav_sensor *sensor) {
  cav_pose pose, from;
  int link = cav_object_link(t->model, sensor->object_type, sensor->object);
  int base = cav_object_link(t->model, sensor->reference_type, sensor->reference);
  cav_object_pose(t->model, t->state, sensor->object_type, sensor->object, &pose);
  cav_object_pose(t->model, t->state, sensor->reference_type, sensor->reference, &from);
  for (int j = cav_last_dof(t->model, link); j >= 0; j = t->model->dof[j].parent)
    add_pose(t, sensor, &pose, &from, 1, j);
  for (int j = cav_last_dof(t->model, base); j >= 0; j = t->model->dof[j].parent)
    add_pose(t, sensor, &pose, &from, -1, j);
}

// one column of the derivatives of a frame's reading
static void frame_column(const task *t, const cav_sensor *sensor, const cav_pose *pose, const double V[6], int j) {
  const double *reference = t->state->reference + 3 * t->model->dof[j].link;
  double S[6], drift[6], rate[6], axis[3], x[3], turn[4] = {0}, quat[4];
  motion_at(S, t->state->axis + 6 * j, reference, pose->pos);
  motion_at(drift, t->drift + 6 * j, reference, pose->pos);
  switch (sensor->type) {
    case CAV_SENSOR_FRAMEPOS:
      put3(t->dq, t->nv, j, S + 3);
      break;
    case CAV_SENSOR_FRAMEQUAT:
      scale3(turn + 1, 0.5, S);
      quat_mul(quat, turn, pose->quat);
      for (int i = 0; i < 4; i++) put(t->dq, t->nv, i, j, quat[i]);
      break;
    case CAV_SENSOR_FRAMELINVEL:
      velocity_rate(rate, S, drift, V);
      cross_add3(rate + 3, V, S + 3);
      put3(t->dq, t->nv, j, rate + 3);
      put3(t->dn, t->nv, j, S + 3);
      break;
    case CAV_SENSOR_FRAMEANGVEL:
      velocity_rate(rate, S, drift, V);
      put3(t->dq, t->nv, j, rate);
      put3(t->dn, t->nv, j, S);
      break;
    case CAV_SENSOR_VELOCIMETER:
      velocity_rate(rate, S, drift, V);
      cross_add3(rate + 3, V, S + 3);
      put_turned(t, pose, S, V + 3, rate + 3, S + 3, j);
      break;
    case CAV_SENSOR_GYRO:
      velocity_rate(rate, S, drift, V);
      put_turned(t, pose, S, V, rate, S, j);
      break;
    default:
      column3(axis, pose->rotation, sensor->type - CAV_SENSOR_FRAMEXAXIS);
      cross3(x, S, axis);
      put3(t->dq, t->nv, j, x);
  }
}

static void frame(const task *t, const cav_sensor *sensor, cav_object_type type) {
  int link = cav_object_link(t->model, type, sensor->object);
  cav_pose pose;
  double V[6];
  cav_object_pose(t->model, t->state, type, sensor->object, &pose);
  motion_at(V, t->state->velocity_next + 6 * link, t->state->reference + 3 * link, pose.pos);
  for (int j = cav_last_dof(t->model, link); j >= 0; j = t->model->dof[j].parent) frame_column(t, sensor, &pose, V, j);
}

/// A body of a subtree.
typedef struct part {
  const cav_body *body;
  cav_pose pose; ///< principal axes at its centre of mass
  double V[6];   ///< about its centre of mass
} part;

static int subtree_part(const task *t, int index, int root, part *p) {
  if (index == 0 || !cav_descends(t->model, index, root)) return 0;
  p->body = &t->model->body[index];
  int link = p->body->link;
  cav_object_pose(t->model, t->state, CAV_OBJECT_BODY, index, &p->pose);
  motion_at(p->V, t->state->velocity_next + 6 * link, t->state->reference + 3 * link, p->pose.pos);
  return 1;
}

// r = I w of a body
static void spin(const part *p, const double w[3], double r[3]) {
  rotate_back(r, p->pose.rotation, w);
  for (int i = 0; i < 3; i++) r[i] *= p->body->inertia[i];
  rotate(r, p->pose.rotation, r);
}

/// Sums of a subtree: mass, centre of mass and its velocity.
typedef struct whole {
  double mass, com[3], velocity[3];
} whole;

static whole weigh(const task *t, int root) {
  whole s = {0};
  part p;
  for (int i = root; i < t->model->nbody; i++) {
    if (!subtree_part(t, i, root, &p)) continue;
    s.mass += p.body->mass;
    axpy3(s.com, s.com, p.body->mass, p.pose.pos);
    axpy3(s.velocity, s.velocity, p.body->mass, p.V + 3);
  }
  double inverse = s.mass > 0 ? 1 / s.mass : 0;
  scale3(s.com, inverse, s.com);
  scale3(s.velocity, inverse, s.velocity);
  return s;
}

// adds what one body gives a column of the sum over the subtree
static void body_column(const task *t, const cav_sensor *sensor, const part *p, const whole *s, int j) {
  const double *reference = t->state->reference + 3 * t->model->dof[j].link;
  double S[6], drift[6], rate[6], q[3] = {0}, n[3] = {0}, mass = p->body->mass,
                                  fraction = s->mass > 0 ? mass / s->mass : 0;
  motion_at(S, t->state->axis + 6 * j, reference, p->pose.pos);
  motion_at(drift, t->drift + 6 * j, reference, p->pose.pos);
  velocity_rate(rate, S, drift, p->V);
  cross_add3(rate + 3, p->V, S + 3);
  if (sensor->type == CAV_SENSOR_SUBTREECOM) {
    scale3(q, fraction, S + 3);
  } else if (sensor->type == CAV_SENSOR_SUBTREELINVEL) {
    scale3(q, fraction, rate + 3);
    scale3(n, fraction, S + 3);
  } else {
    // about the common centre, whose own displacement and velocity drop out of the sum
    double own[3], turned[3], arm[3], speed[3], push[3];
    spin(p, p->V, own);
    spin(p, drift, turned);
    cross3(q, S, own);
    add3(q, q, turned);
    sub3(arm, p->pose.pos, s->com);
    sub3(speed, p->V + 3, s->velocity);
    scale3(speed, mass, speed);
    cross_add3(q, S + 3, speed);
    scale3(push, mass, rate + 3);
    cross_add3(q, arm, push);
    spin(p, S, n);
    scale3(push, mass, S + 3);
    cross_add3(n, arm, push);
  }
  for (int i = 0; i < 3; i++) {
    if (t->dq) t->dq[i * t->nv + j] += q[i];
    if (t->dn) t->dn[i * t->nv + j] += n[i];
  }
}

static void subtree(const task *t, const cav_sensor *sensor) {
  whole s = weigh(t, sensor->object);
  part p;
  for (int i = sensor->object; i < t->model->nbody; i++) {
    if (!subtree_part(t, i, sensor->object, &p)) continue;
    for (int j = cav_last_dof(t->model, p.body->link); j >= 0; j = t->model->dof[j].parent) {
      body_column(t, sensor, &p, &s, j);
    }
  }
}

// the arms of a tendon are the derivative of its length
static void tendon(const task *t, int index, double *out) {
  const cav_tendon *string = &t->model->tendon[index];
  for (int k = string->dof; k < string->dof + string->ndof; k++) {
    put(out, t->nv, 0, t->model->tendon_dof[k], t->state->tendon_arm[k]);
  }
}

// no default: the compiler names a type that is declared and neither here nor there
static int offered(const cav_model *model, const cav_sensor *sensor) {
  if (sensor->cutoff > 0) return 0;
  if (sensor->referred) return sensor->type >= CAV_SENSOR_FRAMEPOS && sensor->type <= CAV_SENSOR_FRAMEZAXIS;
  switch (sensor->type) {
    case CAV_SENSOR_TENDONVEL:
      return model->tendon[sensor->object].npath == 0;
    case CAV_SENSOR_JOINTPOS:
    case CAV_SENSOR_JOINTVEL:
    case CAV_SENSOR_FRAMEPOS:
    case CAV_SENSOR_FRAMEQUAT:
    case CAV_SENSOR_FRAMEXAXIS:
    case CAV_SENSOR_FRAMEYAXIS:
    case CAV_SENSOR_FRAMEZAXIS:
    case CAV_SENSOR_FRAMELINVEL:
    case CAV_SENSOR_FRAMEANGVEL:
    case CAV_SENSOR_SUBTREECOM:
    case CAV_SENSOR_SUBTREELINVEL:
    case CAV_SENSOR_SUBTREEANGMOM:
    case CAV_SENSOR_VELOCIMETER:
    case CAV_SENSOR_GYRO:
    case CAV_SENSOR_TENDONPOS:
    case CAV_SENSOR_BALLANGVEL:
    case CAV_SENSOR_CLOCK:
      return 1;
    case CAV_SENSOR_TOUCH:
    case CAV_SENSOR_ACCELEROMETER:
    case CAV_SENSOR_FORCE:
    case CAV_SENSOR_TORQUE:
    case CAV_SENSOR_MAGNETOMETER:
    case CAV_SENSOR_RANGEFINDER:
    case CAV_SENSOR_ACTUATORPOS:
    case CAV_SENSOR_ACTUATORVEL:
    case CAV_SENSOR_ACTUATORFRC:
    case CAV_SENSOR_JOINTACTUATORFRC:
    case CAV_SENSOR_BALLQUAT:
    case CAV_SENSOR_JOINTLIMITPOS:
    case CAV_SENSOR_JOINTLIMITVEL:
    case CAV_SENSOR_JOINTLIMITFRC:
    case CAV_SENSOR_TENDONLIMITPOS:
    case CAV_SENSOR_TENDONLIMITVEL:
    case CAV_SENSOR_TENDONLIMITFRC:
    case CAV_SENSOR_FRAMELINACC:
    case CAV_SENSOR_FRAMEANGACC:
    case CAV_SENSOR_TYPES:
      break;
  }
  return 0;
}

cav_status cav_sensor_derivatives(const cav_model *model, cav_state *state, const cav_sensor *sensor, double *d_dq,
                                  double *d_dv_next) {
  if (!offered(model, sensor)) return CAV_NOT_SUPPORTED;
  const cav_workspace *w = state->work;
  if (!cav_state_evaluated(state) || !w->derived) return CAV_BAD_INPUT;
  if (!d_dq && !d_dv_next) return CAV_OK;
  task t = {model, state, w->derivatives->drift_next, model->nv, d_dq, d_dv_next};
  size_t n = (size_t)sensor->dim * (size_t)model->nv * sizeof(double);
  if (d_dq) memset(d_dq, 0, n);
  if (d_dv_next) memset(d_dv_next, 0, n);
  switch (sensor->type) {
    case CAV_SENSOR_CLOCK:
      break;
    case CAV_SENSOR_JOINTPOS:
      put(d_dq, t.nv, 0, model->joint[sensor->object].dof, 1);
      break;
    case CAV_SENSOR_JOINTVEL:
      put(d_dv_next, t.nv, 0, model->joint[sensor->object].dof, 1);
      break;
    case CAV_SENSOR_BALLANGVEL:
      for (int i = 0; i < 3; i++) put(d_dv_next, t.nv, i, model->joint[sensor->object].dof + i, 1);
      break;
    case CAV_SENSOR_TENDONPOS:
      tendon(&t, sensor->object, d_dq);
      break;
    case CAV_SENSOR_TENDONVEL:
      tendon(&t, sensor->object, d_dv_next);
      break;
    case CAV_SENSOR_SUBTREECOM:
    case CAV_SENSOR_SUBTREELINVEL:
    case CAV_SENSOR_SUBTREEANGMOM:
      subtree(&t, sensor);
      break;
    case CAV_SENSOR_VELOCIMETER:
    case CAV_SENSOR_GYRO:
      frame(&t, sensor, CAV_OBJECT_SITE);
      break;
    default:
      if (sensor->referred) {
        referred_pose(&t, sensor);
      } else {
        frame(&t, sensor, sensor->object_type);
      }
  }
  return CAV_OK;
}
