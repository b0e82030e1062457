/// Which way joints move, in words: the velocity of the end of the limb below a joint at a unit rate, split along axes that turn
/// with the root. The end is the last body of the chain, by its centre of mass, or where that is near the joint by its far end,
/// which tells toe from heel; where the chain branches, the centre of mass of all from there on.
#include "sense.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "math3.h"

// an end that moves by less than this fraction of the limb's length at a unit rate is turned, not moved (a limb within 14 degrees
// of the axis); components beyond this fraction of the largest are told; points as far out as this fraction of the farthest are
// the far end, which stands for a body whose centre is nearer than this fraction of that
static const double still = 0.25, told = 0.5, far = 0.9, near = 0.5;

static double distance(const double *a, const double *b) {
  double d[3];
  sub3(d, a, b);
  return norm3(d);
}

// whether roles say which way a tree looks
static int has_sides(const cav_model *m, const cav_roles *roles, int root) {
  static const cav_role paired[] = {CAV_ROLE_RIGHT_FOOT, CAV_ROLE_FRONT_RIGHT_FOOT, CAV_ROLE_RIGHT_HAND};
  for (int i = 0; i < 3; i++) {
    const int body = roles->body[paired[i]];
    if (body > 0 && m->link[m->body[body].link].root == root) return 1;
  }
  return 0;
}

// forwards, left and up in the world for who is the root: rows
static void axes_of(const cav_model *m, const cav_state *state, const cav_roles *roles, int root, double axes[3][3]) {
  const int sides = has_sides(m, roles, root);
  const double left[3] = {sides ? roles->left[0] : 0, sides ? roles->left[1] : 1, 0};
  const double own[3][3] = {{left[1], -left[0], 0}, {left[0], left[1], 0}, {0, 0, 1}};
  const cav_joint *first = m->link[root].njoint ? &m->joint[m->link[root].joint] : NULL;
  memcpy(axes, own, sizeof own);
  if (!first || first->type != CAV_JOINT_FREE) return;
  double quat[4], file[9];
  memcpy(quat, m->q0 + first->q + 3, sizeof quat);
  quat_normalise(quat);
  quat_matrix(file, quat);
  for (int k = 0; k < 3; k++) {
    rotate_back(axes[k], file, own[k]);
    rotate(axes[k], state->link[root].rotation, axes[k]);
  }
}

// the only child of a link, -1: none, -2: several
static int child_of(const cav_model *m, int link) {
  int child = -1;
  for (int i = link + 1; i < m->nlink; i++)
    if (m->link[i].parent == link) child = child == -1 ? i : -2;
  return child;
}

// the one body of a link that no other of it hangs on and that has a shape or mass; that of its joints where there are several
static int last_body(const cav_model *m, int link) {
  int last = -1, leaves = 0;
  for (int i = 1; i < m->nbody; i++) {
    int holds = m->body[i].link != link || (m->body[i].ngeom == 0 && !(m->body[i].mass > 0));
    for (int k = i + 1; k < m->nbody && !holds; k++)
      holds = m->body[k].parent == i && m->body[k].link == link && (m->body[k].ngeom > 0 || m->body[k].mass > 0);
    if (!holds) last = i, leaves++;
  }
  return leaves == 1 ? last : m->link[link].body;
}

// centre of mass of a link and all below it; how far the farthest of these links is from a point
static double centre_of(const cav_model *m, const cav_state *state, int link, const double *from, double *out) {
  double mass = 0, sum[3] = {0}, most = 0;
  for (int i = link; i < m->nlink; i++) {
    int above = i;
    while (above > link) above = m->link[above].parent;
    if (above != link) continue;
    mass += m->link[i].mass;
    most = fmax(most, distance(state->com + 3 * i, from));
    axpy3(sum, sum, m->link[i].mass, state->com + 3 * i);
  }
  for (int k = 0; k < 3; k++) out[k] = mass > 0 ? sum[k] / mass : state->link[link].pos[k];
  return most;
}

// half the edges of a geom's box; 0: it has no end
static int box_of(const cav_geom *geom, double half[3]) {
  const double *s = geom->size;
  switch (geom->type) {
    case CAV_GEOM_SPHERE:
      half[0] = half[1] = half[2] = s[0];
      return 1;
    case CAV_GEOM_CAPSULE:
    case CAV_GEOM_CYLINDER:
      half[0] = half[1] = s[0];
      half[2] = s[1] + (geom->type == CAV_GEOM_CAPSULE ? s[0] : 0);
      return 1;
    case CAV_GEOM_ELLIPSOID:
    case CAV_GEOM_BOX:
    case CAV_GEOM_MESH:
      memcpy(half, s, 3 * sizeof *half);
      return 1;
    case CAV_GEOM_PLANE:
    case CAV_GEOM_HFIELD:
    case CAV_GEOM_TYPES:
      break;
  }
  return 0;
}

// mean of the corners of a body's boxes that are farthest from a point, and how far they are; 0: it has no shape
static double far_end(const cav_model *m, const cav_state *state, int body, const double *from, double *end) {
  double most = 0, sum[3] = {0};
  int n = 0;
  for (int pass = 0; pass < 2; pass++) {
    for (int g = m->body[body].geom; g < m->body[body].geom + m->body[body].ngeom; g++) {
      cav_pose at;
      double half[3];
      if (!box_of(&m->geom[g], half)) continue;
      cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &at);
      for (int corner = 0; corner < 8; corner++) {
        double local[3], point[3];
        for (int k = 0; k < 3; k++) local[k] = corner >> k & 1 ? half[k] : -half[k];
        transform(point, at.pos, at.rotation, local);
        const double away = distance(point, from);
        if (!pass) most = fmax(most, away);
        if (!pass || away < far * most) continue;
        add3(sum, sum, point);
        n++;
      }
    }
  }
  for (int k = 0; k < 3 && n; k++) end[k] = sum[k] / n;
  return most;
}

// the end of the limb below a joint in the world, its body, and how long the limb is
static int end_of(const cav_model *m, const cav_state *state, int joint, double *end, double *length) {
  const cav_joint *it = &m->joint[joint];
  double anchor[3];
  int link = it->link, child;
  while ((child = child_of(m, link)) >= 0) link = child;
  const int body = child == -1 ? last_body(m, link) : m->link[link].body;
  transform(anchor, state->link[it->link].pos, state->link[it->link].rotation, it->pos);
  if (child == -2) {
    *length = centre_of(m, state, link, anchor, end);
    return body;
  }
  cav_pose at;
  double tip[3];
  cav_object_pose(m, state, CAV_OBJECT_BODY, body, &at);
  memcpy(end, at.pos, sizeof at.pos);
  *length = distance(end, anchor);
  const double reach = far_end(m, state, body, anchor, tip);
  if (*length < near * reach) *length = reach, memcpy(end, tip, sizeof tip);
  return body;
}

// "forwards, up" of a velocity
static void name_way(const double *v, char *out, size_t room) {
  static const char *const words[3][2] = {{"forwards", "backwards"}, {"left", "right"}, {"up", "down"}};
  int first = 0, second = -1;
  for (int k = 1; k < 3; k++)
    if (fabs(v[k]) > fabs(v[first])) first = k;
  for (int k = 0; k < 3; k++)
    if (k != first && fabs(v[k]) > told * fabs(v[first]) && (second < 0 || fabs(v[k]) > fabs(v[second]))) second = k;
  snprintf(out, room, "%s%s%s", words[first][v[first] < 0], second < 0 ? "" : ", ",
           second < 0 ? "" : words[second][v[second] < 0]);
}

// "turns NAME to the left", about the axis nearest to that of the rotation
static void name_turn(const double *w, const char *name, char *out, size_t room) {
  static const char *const words[3][3] = {{"rolls", "to the right", "to the left"},
                                          {"tips", "forwards", "backwards"},
                                          {"turns", "to the left", "to the right"}};
  int axis = 2;
  for (int k = 0; k < 2; k++)
    if (fabs(w[k]) > fabs(w[axis])) axis = k;
  snprintf(out, room, "%s %.60s %s", words[axis][0], name, words[axis][1 + (w[axis] < 0)]);
}

void cav_sense_of(const cav_model *m, const cav_state *state, const cav_roles *roles, int joint, char text[CAV_SENSE]) {
  const cav_joint *it = &m->joint[joint];
  *text = 0;
  if (it->type != CAV_JOINT_HINGE && it->type != CAV_JOINT_SLIDE) return;
  double axes[3][3], end[3], arm[3], moved[3], length, velocity[3], rate[3];
  const int body = end_of(m, state, joint, end, &length);
  const double *spatial = state->axis + 6 * it->dof, *reference = state->reference + 3 * it->link;
  axes_of(m, state, roles, m->link[it->link].root, axes);
  sub3(arm, end, reference);
  copy3(moved, spatial + 3);
  cross_add3(moved, spatial, arm);
  for (int k = 0; k < 3; k++) velocity[k] = dot3(axes[k], moved), rate[k] = dot3(axes[k], spatial);
  const char *name = *m->body[body].name ? m->body[body].name : "its end";
  if (it->type == CAV_JOINT_HINGE && !(norm3(velocity) > still * length)) {
    name_turn(rate, name, text, CAV_SENSE);
  } else {
    const int used = snprintf(text, CAV_SENSE, "%.60s ", name);
    name_way(velocity, text + used, CAV_SENSE - (size_t)used);
  }
}
