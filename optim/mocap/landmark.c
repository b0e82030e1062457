/// Joints of a limb by where they are along it: the one that is farthest from both ends parts it, those before and those
/// behind it have a centre each, the point nearest to their axes.
#include "landmark.h"

#include <math.h>

#include "extent.h"
#include "math3.h"

enum { JOINTS = 40 };
static const double same = 1e-6;  // m: two joints at one place
static const double loose = 1e-3; // of a distance from an axis, that from where the limb begins or ends

typedef struct limb {
  const cav_model *model;
  const cav_state *state;
  int body;                    // its last
  int n, joint[JOINTS];        // hinges and balls, outwards
  double anchor[JOINTS][3];    // world
  double end[3];               // origin of the last body
  int parting, before, behind; // index of the joint that parts it, joints before those of its place, first behind
} limb;

static void list_joints(limb *l, int first) {
  const cav_model *m = l->model;
  int chain[JOINTS], n = 0;
  for (int b = l->body; b > 0 && n < JOINTS; b = m->body[b].parent) {
    chain[n++] = b;
    if (b == first) break;
  }
  for (int c = n - 1; c >= 0; c--) {
    const cav_link *link = &m->link[m->body[chain[c]].link];
    for (int j = link->joint; link->body == chain[c] && j < link->joint + link->njoint && l->n < JOINTS; j++) {
      const cav_joint *joint = &m->joint[j];
      if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_BALL) continue;
      const cav_pose *pose = &l->state->link[joint->link];
      transform(l->anchor[l->n], pose->pos, pose->rotation, joint->pos);
      l->joint[l->n++] = j;
    }
  }
}

static double apart(const double a[3], const double b[3]) {
  double d[3];
  sub3(d, a, b);
  return norm3(d);
}

// 0: no joint is between the ends
static int part(limb *l) {
  double most = same;
  l->parting = -1;
  for (int k = 0; k < l->n; k++) {
    double off = fmin(apart(l->anchor[k], l->anchor[0]), apart(l->anchor[k], l->end));
    if (off > most - same) most = fmax(off, most), l->parting = k;
  }
  if (l->parting < 0) return 0;
  l->before = l->parting, l->behind = l->parting + 1;
  while (l->before > 0 && apart(l->anchor[l->before - 1], l->anchor[l->parting]) < 1e3 * same) l->before--;
  return l->before > 0;
}

// the point nearest to the axes of joints a .. b-1, and a little to start
static void centre(const limb *l, int a, int b, const double start[3], double out[3]) {
  double A[9] = {loose, 0, 0, 0, loose, 0, 0, 0, loose}, r[3], inverse[9], rows[3][3];
  scale3(r, loose, start);
  for (int k = a; k < b; k++) {
    const cav_joint *joint = &l->model->joint[l->joint[k]];
    int hinge = joint->type == CAV_JOINT_HINGE;
    const double *w = l->state->axis + 6 * joint->dof;
    for (int i = 0; i < 9; i++) {
      double P = (i % 4 == 0) - (hinge ? w[i / 3] * w[i % 3] : 0);
      A[i] += P;
      r[i / 3] += P * l->anchor[k][i % 3];
    }
  }
  // symmetric: columns of the inverse are products of its rows over the determinant
  for (int i = 0; i < 3; i++) set3(rows[i], A[3 * i], A[3 * i + 1], A[3 * i + 2]);
  for (int i = 0; i < 3; i++) cross3(inverse + 3 * i, rows[(i + 1) % 3], rows[(i + 2) % 3]);
  double determinant = dot3(rows[0], inverse);
  zero3(out);
  for (int i = 0; i < 3; i++) axpy3(out, out, r[i] / determinant, inverse + 3 * i);
}

// farthest point of the last body's geoms along a direction, as a coordinate along it
static double extent(const limb *l, const double n[3]) {
  const cav_body *body = &l->model->body[l->body];
  double most = -INFINITY;
  for (int g = body->geom; g < body->geom + body->ngeom; g++) {
    cav_pose at;
    cav_object_pose(l->model, l->state, CAV_OBJECT_GEOM, g, &at);
    most = fmax(most, dot3(n, at.pos) + cav_geom_reach(l->model, g, &at, n));
  }
  return most;
}

static int sole(const limb *l, const double left[2], int front, double out[3]) {
  const double side[3] = {left[0], left[1], 0}, other[3] = {-left[0], -left[1], 0}, down[3] = {0, 0, -1};
  const double ahead[3] = {front ? left[1] : -left[1], front ? -left[0] : left[0], 0};
  if (l->model->body[l->body].ngeom == 0) return 0;
  double along = extent(l, ahead), across = (extent(l, side) - extent(l, other)) / 2;
  for (int k = 0; k < 3; k++) out[k] = along * ahead[k] + across * side[k] - extent(l, down) * (k == 2);
  return 1;
}

int cav_landmark_find(const cav_model *m, cav_state *state, const cav_roles *roles, cav_role role,
                      cav_landmark landmark, int *body, double place[3]) {
  limb l = {.model = m, .state = state, .body = roles->body[role]};
  cav_pose at;
  double world[3];
  if (l.body < 0 || roles->limb[role] < 0 || cav_position(m, state, m->q0)) return 0;
  cav_object_pose(m, state, CAV_OBJECT_XBODY, l.body, &at);
  copy3(l.end, at.pos);
  list_joints(&l, roles->limb[role]);
  *body = l.body;
  if (landmark == CAV_LANDMARK_HEEL || landmark == CAV_LANDMARK_TOE) {
    if (!sole(&l, roles->left, landmark == CAV_LANDMARK_TOE, world)) return 0;
  } else {
    if (!part(&l)) return 0;
    int middle = m->joint[l.joint[l.parting]].body;
    copy3(world, l.anchor[l.parting]);
    if (landmark == CAV_LANDMARK_FIRST) centre(&l, 0, l.before, l.anchor[0], world), *body = m->body[middle].parent;
    if (landmark == CAV_LANDMARK_MIDDLE) *body = middle;
    if (landmark == CAV_LANDMARK_LAST) {
      centre(&l, l.behind, l.n, l.end, world);
      // of the segment that ends there, so that it does not turn with the joints about it
      *body = l.behind < l.n ? m->body[m->joint[l.joint[l.behind]].body].parent : middle;
    }
  }
  cav_object_pose(m, state, CAV_OBJECT_XBODY, *body, &at);
  sub3(world, world, at.pos);
  rotate_back(place, at.rotation, world);
  return 1;
}
