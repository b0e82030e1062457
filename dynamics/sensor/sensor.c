/// Poses of objects and readings of sensors from a state's last evaluation. Velocities are those at v_next,
/// accelerations and forces those of the step. Bodies welded into one link keep their own frames and masses here, so a
/// subtree is a subtree of the file. Readings carry no noise. Nothing is computed for sensors that are not asked for.
#include "sensor.h"
#include "math3.h"

/// Sums over the bodies of a subtree.
typedef struct subtree {
  double mass, com[3], velocity[3], momentum[3];
} subtree;

// velocity of the centre of mass of a body and, if asked, its angular momentum about it
static void body_motion(const cav_state *state, const cav_body *body, const cav_pose *pose, double speed[3],
                        double spin[3]) {
  const double *V = state->velocity_next + 6 * body->link;
  velocity_at(speed, V, state->reference + 3 * body->link, pose->pos);
  double w[3];
  rotate_back(w, pose->rotation, V);
  set3(w, body->inertia[0] * w[0], body->inertia[1] * w[1], body->inertia[2] * w[2]);
  rotate(spin, pose->rotation, w);
}

static subtree subtree_motion(const cav_model *model, const cav_state *state, int root) {
  subtree s = {0};
  double origin[3] = {0, 0, 0};
  for (int pass = 0; pass < 2; pass++) {
    for (int i = root; i < model->nbody; i++) {
      const cav_body *body = &model->body[i];
      if (i == 0 || !cav_descends(model, i, root)) { continue; }
      cav_pose pose;
      double speed[3], spin[3], arm[3];
      cav_mass_pose(state, body, &pose);
      body_motion(state, body, &pose, speed, spin);
      if (pass == 0) {
        s.mass += body->mass;
        axpy3(s.com, s.com, body->mass, pose.pos);
        axpy3(s.velocity, s.velocity, body->mass, speed);
        continue;
      }
      // about the common centre
      sub3(arm, pose.pos, s.com);
      sub3(speed, speed, s.velocity);
      scale3(speed, body->mass, speed);
      add3(s.momentum, s.momentum, spin);
      cross_add3(s.momentum, arm, speed);
    }
    if (pass == 0) {
      double inverse = s.mass > 0 ? 1 / s.mass : 0;
      scale3(s.com, inverse, s.mass > 0 ? s.com : origin);
      scale3(s.velocity, inverse, s.velocity);
    }
  }
  return s;
}

// velocity of an object's frame at v_next: origin and turning, world axes
static void frame_velocity(const cav_model *model, const cav_state *state, cav_object_type type, int object,
                           const double point[3], double linear[3], double angular[3]) {
  int link = cav_object_link(model, type, object);
  const double *V = state->velocity_next + 6 * link;
  velocity_at(linear, V, state->reference + 3 * link, point);
  copy3(angular, V);
}

// pose in a reference frame
static void refer_pose(const cav_pose *from, cav_pose *pose) {
  double back[4], R[9], transposed[9];
  sub3(pose->pos, pose->pos, from->pos);
  rotate_back(pose->pos, from->rotation, pose->pos);
  quat_conjugate(back, from->quat);
  quat_mul(pose->quat, back, pose->quat);
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) { transposed[3 * i + j] = from->rotation[3 * j + i]; }
  }
  matmul3(R, transposed, pose->rotation);
  memcpy(pose->rotation, R, sizeof R);
}

// what an observer who moves with the reference frame sees
static void refer_velocity(const cav_model *model, const cav_state *state, const cav_sensor *sensor,
                           const cav_pose *from, const double point[3], double linear[3], double angular[3]) {
  double speed[3], turn[3];
  frame_velocity(model, state, sensor->reference_type, sensor->reference, point, speed, turn);
  sub3(linear, linear, speed);
  sub3(angular, angular, turn);
  rotate_back(linear, from->rotation, linear);
  rotate_back(angular, from->rotation, angular);
}

static void sense_frame(const cav_model *model, const cav_state *state, const cav_sensor *sensor, double *out) {
  cav_pose pose, from;
  double linear[3], angular[3];
  int link = cav_object_link(model, sensor->object_type, sensor->object);
  cav_object_pose(model, state, sensor->object_type, sensor->object, &pose);
  if (sensor->referred) { cav_object_pose(model, state, sensor->reference_type, sensor->reference, &from); }
  switch (sensor->type) {
    case CAV_SENSOR_FRAMELINACC:
      cav_point_acceleration(state, link, pose.pos, out);
      return;
    case CAV_SENSOR_FRAMEANGACC:
      copy3(out, state->work->acceleration + 6 * link);
      return;
    case CAV_SENSOR_FRAMELINVEL:
    case CAV_SENSOR_FRAMEANGVEL:
      frame_velocity(model, state, sensor->object_type, sensor->object, pose.pos, linear, angular);
      if (sensor->referred) { refer_velocity(model, state, sensor, &from, pose.pos, linear, angular); }
      copy3(out, sensor->type == CAV_SENSOR_FRAMELINVEL ? linear : angular);
      return;
    default:
      break;
  }
  if (sensor->referred) { refer_pose(&from, &pose); }
  if (sensor->type == CAV_SENSOR_FRAMEPOS) {
    copy3(out, pose.pos);
  } else if (sensor->type == CAV_SENSOR_FRAMEQUAT) {
    memcpy(out, pose.quat, sizeof pose.quat);
  } else {
    column3(out, pose.rotation, sensor->type - CAV_SENSOR_FRAMEXAXIS);
  }
}

static void sense_subtree(const cav_model *model, const cav_state *state, const cav_sensor *sensor, double *out) {
  subtree s = subtree_motion(model, state, sensor->object);
  copy3(out, sensor->type == CAV_SENSOR_SUBTREECOM      ? s.com
             : sensor->type == CAV_SENSOR_SUBTREELINVEL ? s.velocity
                                                        : s.momentum);
}

// along z of a frame to the nearest geom of another body that can be seen at all; -1 if there is none
static double measure_range(const cav_model *model, const cav_state *state, int body, const cav_pose *from) {
  double nearest = -1, direction[3];
  column3(direction, from->rotation, 2);
  for (int i = 0; i < model->ngeom; i++) {
    const cav_geom *geom = &model->geom[i];
    if (geom->body == body || geom->rgba[3] == 0) { continue; }
    cav_pose pose;
    cav_frame_pose(state, geom->link, geom->pos, geom->quat, &pose);
    cav_shape shape = cav_shape_of(model, geom);
    copy3(shape.pos, pose.pos);
    memcpy(shape.rotation, pose.rotation, sizeof shape.rotation);
    double t = cav_ray(&shape, from->pos, direction);
    if (t >= 0 && (nearest < 0 || t < nearest)) { nearest = t; }
  }
  return nearest;
}

static void sense_site(const cav_model *model, const cav_state *state, const cav_sensor *sensor, double *out) {
  const cav_site *site = &model->site[sensor->object];
  cav_pose pose;
  double world[3] = {0, 0, 0}, wrench[6], angular[3];
  cav_frame_pose(state, site->link, site->pos, site->quat, &pose);
  switch (sensor->type) {
    case CAV_SENSOR_RANGEFINDER:
      out[0] = measure_range(model, state, site->body, &pose);
      return;
    case CAV_SENSOR_ACCELEROMETER:
      cav_point_acceleration(state, site->link, pose.pos, world);
      break;
    case CAV_SENSOR_VELOCIMETER:
      frame_velocity(model, state, CAV_OBJECT_SITE, sensor->object, pose.pos, world, angular);
      break;
    case CAV_SENSOR_GYRO:
      copy3(world, state->velocity_next + 6 * site->link);
      break;
    case CAV_SENSOR_MAGNETOMETER:
      copy3(world, model->magnetic);
      break;
    default:
      cav_body_wrench(model, state, site->body, pose.pos, wrench);
      copy3(world, sensor->type == CAV_SENSOR_FORCE ? wrench + 3 : wrench);
  }
  rotate_back(out, pose.rotation, world);
}

static double sense_actuator(const cav_model *model, cav_state *state, const cav_sensor *sensor) {
  switch (sensor->type) {
    case CAV_SENSOR_ACTUATORPOS:
      return cav_actuator_length(model, state, sensor->object, NULL);
    case CAV_SENSOR_ACTUATORVEL:
      return cav_actuator_velocity(state, sensor->object, state->work->v_next);
    default:
      return cav_actuator_part(state, sensor->object);
  }
}

// the row of the limit that is nearest, of a joint or a tendon: NULL where none acts
static const cav_row *limit_row(const cav_state *state, cav_row_type type, int object) {
  const cav_row *nearest = NULL;
  for (int i = 0; i < state->nrow; i++) {
    const cav_row *row = &state->row[i];
    if (row->type == type && row->object == object && (!nearest || row->dist < nearest->dist)) { nearest = row; }
  }
  return nearest;
}

static double sense_limit(const cav_model *model, const cav_state *state, const cav_sensor *sensor) {
  int tendon = sensor->object_type == CAV_OBJECT_TENDON;
  const cav_row *row = limit_row(state, tendon ? CAV_ROW_LIMIT_TENDON : CAV_ROW_LIMIT_JOINT, sensor->object);
  if (!row) { return 0; }
  switch (sensor->type) {
    case CAV_SENSOR_JOINTLIMITPOS:
    case CAV_SENSOR_TENDONLIMITPOS:
      // of the model's own, not where a smoothed stop is set back to
      return row->dist - (tendon ? model->tendon[row->object].margin : model->joint[row->object].margin);
    case CAV_SENSOR_JOINTLIMITVEL:
    case CAV_SENSOR_TENDONLIMITVEL:
      return row->velocity_next;
    default:
      return row->impulse / state->options.timestep;
  }
}

static void sense_joint(const cav_model *model, const cav_state *state, const cav_sensor *sensor, double *out) {
  const cav_joint *joint = &model->joint[sensor->object];
  const cav_workspace *w = state->work;
  switch (sensor->type) {
    case CAV_SENSOR_JOINTPOS:
      out[0] = w->q[joint->q];
      break;
    case CAV_SENSOR_JOINTVEL:
      out[0] = w->v_next[joint->dof];
      break;
    case CAV_SENSOR_BALLQUAT:
      memcpy(out, w->q + joint->q, 4 * sizeof *out);
      break;
    default:
      copy3(out, w->v_next + joint->dof);
  }
}

// no default: the compiler names a type that is declared and not read
static void sense(const cav_model *model, cav_state *state, const cav_sensor *sensor, double *out) {
  switch (sensor->type) {
    case CAV_SENSOR_CLOCK:
      out[0] = state->time;
      break;
    case CAV_SENSOR_JOINTPOS:
    case CAV_SENSOR_JOINTVEL:
    case CAV_SENSOR_BALLQUAT:
    case CAV_SENSOR_BALLANGVEL:
      sense_joint(model, state, sensor, out);
      break;
    case CAV_SENSOR_FRAMEPOS:
    case CAV_SENSOR_FRAMEQUAT:
    case CAV_SENSOR_FRAMEXAXIS:
    case CAV_SENSOR_FRAMEYAXIS:
    case CAV_SENSOR_FRAMEZAXIS:
    case CAV_SENSOR_FRAMELINVEL:
    case CAV_SENSOR_FRAMEANGVEL:
    case CAV_SENSOR_FRAMELINACC:
    case CAV_SENSOR_FRAMEANGACC:
      sense_frame(model, state, sensor, out);
      break;
    case CAV_SENSOR_SUBTREECOM:
    case CAV_SENSOR_SUBTREELINVEL:
    case CAV_SENSOR_SUBTREEANGMOM:
      sense_subtree(model, state, sensor, out);
      break;
    case CAV_SENSOR_TOUCH:
      out[0] = cav_touch_force(model, state, sensor);
      break;
    case CAV_SENSOR_ACCELEROMETER:
    case CAV_SENSOR_VELOCIMETER:
    case CAV_SENSOR_GYRO:
    case CAV_SENSOR_FORCE:
    case CAV_SENSOR_TORQUE:
    case CAV_SENSOR_MAGNETOMETER:
    case CAV_SENSOR_RANGEFINDER:
      sense_site(model, state, sensor, out);
      break;
    case CAV_SENSOR_TENDONPOS:
      out[0] = state->tendon_length[sensor->object];
      break;
    case CAV_SENSOR_TENDONVEL:
      out[0] = cav_tendon_velocity(state, sensor->object, state->work->v_next);
      break;
    case CAV_SENSOR_ACTUATORPOS:
    case CAV_SENSOR_ACTUATORVEL:
    case CAV_SENSOR_ACTUATORFRC:
      out[0] = sense_actuator(model, state, sensor);
      break;
    case CAV_SENSOR_JOINTACTUATORFRC:
      out[0] = cav_actuators_at(state, model->joint[sensor->object].dof);
      break;
    case CAV_SENSOR_JOINTLIMITPOS:
    case CAV_SENSOR_JOINTLIMITVEL:
    case CAV_SENSOR_JOINTLIMITFRC:
    case CAV_SENSOR_TENDONLIMITPOS:
    case CAV_SENSOR_TENDONLIMITVEL:
    case CAV_SENSOR_TENDONLIMITFRC:
      out[0] = sense_limit(model, state, sensor);
      break;
    case CAV_SENSOR_TYPES:
      break;
  }
}

// axes, quaternions and distances of which -1 means none are not cut from below
static void cut(const cav_sensor *sensor, double *out) {
  int axis = sensor->type >= CAV_SENSOR_FRAMEXAXIS && sensor->type <= CAV_SENSOR_FRAMEZAXIS;
  if (axis || sensor->dim == 4) { return; }
  int positive = sensor->type == CAV_SENSOR_TOUCH || sensor->type == CAV_SENSOR_RANGEFINDER;
  for (int k = 0; k < sensor->dim; k++) {
    out[k] = fmin(out[k], sensor->cutoff);
    if (!positive) { out[k] = fmax(out[k], -sensor->cutoff); }
  }
}

void cav_sensor_read(const cav_model *model, cav_state *state, const cav_sensor *sensor, double *out) {
  sense(model, state, sensor, out);
  if (sensor->cutoff > 0) { cut(sensor, out); }
}
