/// Poses of objects and readings of sensors from a state's last evaluation. Velocities are those at v_next, in world
/// axes. Bodies welded into one link keep their own frames and masses here, so a subtree is a subtree of the file.
#include "math3.h"
#include "workspace.h"

// pose of a frame fixed in a link
static void pose_in_link(const cav_state *state, int link, const double pos[3], const double quat[4], cav_pose *pose) {
  const cav_pose *l = &state->link[link];
  transform(pose->pos, l->pos, l->rotation, pos);
  quat_mul(pose->quat, l->quat, quat);
  quat_matrix(pose->rotation, pose->quat);
}

// principal frame of a body at its centre of mass
static void mass_pose(const cav_state *state, const cav_body *body, cav_pose *pose) {
  double pos[3], quat[4];
  quat_rotate(pos, body->quat, body->com);
  add3(pos, pos, body->pos);
  quat_mul(quat, body->quat, body->iquat);
  pose_in_link(state, body->link, pos, quat, pose);
}

// link that carries an object; the world's where the kind has no frame
static int link_of(const cav_model *model, cav_object_type type, int object) {
  switch (type) {
    case CAV_OBJECT_BODY:
    case CAV_OBJECT_XBODY:
      return model->body[object].link;
    case CAV_OBJECT_GEOM:
      return model->geom[object].link;
    case CAV_OBJECT_SITE:
      return model->site[object].link;
    default:
      return 0;
  }
}

void cav_object_pose(const cav_model *model, const cav_state *state, cav_object_type type, int object, cav_pose *pose) {
  switch (type) {
    case CAV_OBJECT_BODY:
      mass_pose(state, &model->body[object], pose);
      break;
    case CAV_OBJECT_XBODY: {
      const cav_body *body = &model->body[object];
      pose_in_link(state, body->link, body->pos, body->quat, pose);
      break;
    }
    case CAV_OBJECT_GEOM: {
      const cav_geom *geom = &model->geom[object];
      pose_in_link(state, geom->link, geom->pos, geom->quat, pose);
      break;
    }
    case CAV_OBJECT_SITE: {
      const cav_site *site = &model->site[object];
      pose_in_link(state, site->link, site->pos, site->quat, pose);
      break;
    }
    default:
      *pose = state->link[0];
  }
}

/// Sums over the bodies of a subtree.
typedef struct subtree {
  double mass, com[3], velocity[3], momentum[3];
} subtree;

static int descends(const cav_model *model, int body, int from) {
  while (body > from) { body = model->body[body].parent; }
  return body == from;
}

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

static subtree measure(const cav_model *model, const cav_state *state, int root) {
  subtree s = {0};
  double origin[3] = {0, 0, 0};
  for (int pass = 0; pass < 2; pass++) {
    for (int i = root; i < model->nbody; i++) {
      const cav_body *body = &model->body[i];
      if (i == 0 || !descends(model, i, root)) { continue; }
      cav_pose pose;
      double speed[3], spin[3], arm[3];
      mass_pose(state, body, &pose);
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

static void sense_frame(const cav_model *model, const cav_state *state, const cav_sensor *sensor, double *out) {
  cav_pose pose;
  int link = link_of(model, sensor->object_type, sensor->object);
  const double *V = state->velocity_next + 6 * link;
  cav_object_pose(model, state, sensor->object_type, sensor->object, &pose);
  switch (sensor->type) {
    case CAV_SENSOR_FRAMEPOS:
      copy3(out, pose.pos);
      break;
    case CAV_SENSOR_FRAMEQUAT:
      memcpy(out, pose.quat, sizeof pose.quat);
      break;
    case CAV_SENSOR_FRAMELINVEL:
      velocity_at(out, V, state->reference + 3 * link, pose.pos);
      break;
    case CAV_SENSOR_FRAMEANGVEL:
      copy3(out, V);
      break;
    default:
      column3(out, pose.rotation, sensor->type - CAV_SENSOR_FRAMEXAXIS);
  }
}

void cav_sense(const cav_model *model, const cav_state *state, const cav_sensor *sensor, double *out) {
  const cav_workspace *w = state->work;
  switch (sensor->type) {
    case CAV_SENSOR_JOINTPOS:
      out[0] = w->q[model->joint[sensor->object].q];
      break;
    case CAV_SENSOR_JOINTVEL:
      out[0] = w->v_next[model->joint[sensor->object].dof];
      break;
    case CAV_SENSOR_SUBTREECOM:
      copy3(out, measure(model, state, sensor->object).com);
      break;
    case CAV_SENSOR_SUBTREELINVEL:
      copy3(out, measure(model, state, sensor->object).velocity);
      break;
    case CAV_SENSOR_SUBTREEANGMOM:
      copy3(out, measure(model, state, sensor->object).momentum);
      break;
    default:
      sense_frame(model, state, sensor, out);
  }
}
