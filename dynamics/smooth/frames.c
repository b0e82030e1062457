/// Where objects are: links that carry bodies, geoms and sites, and the world poses of their frames from a state's last
/// positions. Bodies welded into one link keep frames of their own here.
#include "math3.h"
#include "smooth.h"

void cav_frame_pose(const cav_state *state, int link, const double pos[3], const double quat[4], cav_pose *pose) {
  const cav_pose *l = &state->link[link];
  transform(pose->pos, l->pos, l->rotation, pos);
  quat_mul(pose->quat, l->quat, quat);
  quat_matrix(pose->rotation, pose->quat);
}

void cav_mass_pose(const cav_state *state, const cav_body *body, cav_pose *pose) {
  double pos[3], quat[4];
  quat_rotate(pos, body->quat, body->com);
  add3(pos, pos, body->pos);
  quat_mul(quat, body->quat, body->iquat);
  cav_frame_pose(state, body->link, pos, quat, pose);
}

int cav_object_link(const cav_model *model, cav_object_type type, int object) {
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
      cav_mass_pose(state, &model->body[object], pose);
      break;
    case CAV_OBJECT_XBODY: {
      const cav_body *body = &model->body[object];
      cav_frame_pose(state, body->link, body->pos, body->quat, pose);
      break;
    }
    case CAV_OBJECT_GEOM: {
      const cav_geom *geom = &model->geom[object];
      cav_frame_pose(state, geom->link, geom->pos, geom->quat, pose);
      break;
    }
    case CAV_OBJECT_SITE: {
      const cav_site *site = &model->site[object];
      cav_frame_pose(state, site->link, site->pos, site->quat, pose);
      break;
    }
    default:
      *pose = state->link[0];
  }
}
