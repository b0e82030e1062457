/// Postures of a problem file: <start>, <goal>, <pose>.
///
/// A posture is a base (a keyframe of the model, a <pose> of the file, numbers, a knot of a trajectory, or else the
/// model's own configuration) on which root and joint values are laid, which ranges="clip" brings into their ranges and
/// height="floor" down to the floor (floor.c). So one file can set up models that share joint names, or list alternatives.
/// Balance, contact between limbs and orientation to the floor are the file's business.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "math3.h"
#include "objects.h"
#include "posture.h"
#include "problem_file.h"
#include "stand.h"
#include "tendon_range.h"

enum { DEEPEST = 16 }; // poses that name each other

// brings joints into their ranges; those that this moves are noted, or stay as at the start
static void clip(const cav_problem_reader *reader, double *q) {
  const cav_model *m = reader->model;
  for (int j = 0; j < m->njoint && reader->moved; j++) {
    const cav_joint *joint = &m->joint[j];
    double *x = &q[joint->q];
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    if (!reader->leave)
      reader->moved[j] |= scalar && joint->limited && (*x < joint->range[0] || *x > joint->range[1]);
    else if (reader->moved[j])
      *x = reader->problem->q_start[joint->q];
  }
  cav_configuration_clip(m, q);
}

static cav_status read_pose(const cav_problem_reader *reader, const cav_xml_node *node, int depth, double *q);

// <pose> of that name
static const cav_xml_node *pose_named(const cav_problem_reader *reader, const char *name) {
  const cav_xml_node *pose = cav_problem_child(reader->root, "pose");
  while (pose && strcmp(cav_xml_text(pose, "name", ""), name)) pose = cav_xml_next(pose);
  return pose;
}

// name nearest to word among the model's keyframes, the file's poses, and the posture that is found
static const char *nearest_key(const cav_problem_reader *reader, const char *word) {
  const cav_model *m = reader->model;
  const char *near = m->nkey ? cav_xml_nearest(word, &m->key->name, m->nkey, sizeof *m->key) : NULL;
  for (const cav_xml_node *pose = cav_problem_child(reader->root, "pose"); pose && !near; pose = cav_xml_next(pose)) {
    const char *name = cav_xml_text(pose, "name", "");
    near = cav_xml_nearest(word, &name, 1, sizeof name);
  }
  for (int i = 0; cav_posture_names[i] && !near; i++)
    near = cav_xml_nearest(word, &cav_posture_names[i], 1, sizeof *cav_posture_names);
  const char *const found = "stand"; // of any model that has feet
  return near ? near : cav_xml_nearest(word, &found, 1, sizeof found);
}

enum { NAMES = 240 };

// names of the file's poses and the model's keyframes, as many as there is room for
static void list_keys(const cav_problem_reader *reader, const char *own, char text[NAMES]) {
  const cav_model *m = reader->model;
  size_t used = 0;
  *text = 0;
  const cav_xml_node *pose = cav_problem_child(reader->root, "pose");
  for (int k = 0; used + 70 < NAMES && (pose || k < m->nkey);) {
    const char *name = pose ? cav_xml_text(pose, "name", "") : m->key[k].name;
    if (pose)
      pose = cav_xml_next(pose);
    else
      k++;
    if (name && *name && strcmp(name, own))
      used += (size_t)snprintf(text + used, NAMES - used, "%s'%.60s'", used ? ", " : "; there is ", name);
  }
}

// which posture that is found the last name of a list, separated by |, means; NULL: none
static const char *names_found(const char *list) {
  const char *last = strrchr(list, '|');
  last = last ? last + 1 : list;
  last += strspn(last, " ");
  size_t n = strcspn(last, " ");
  if (n == 5 && !strncmp(last, "stand", n)) return "stand";
  for (int i = 0; cav_posture_names[i]; i++)
    if (strlen(cav_posture_names[i]) == n && !strncmp(last, cav_posture_names[i], n)) return cav_posture_names[i];
  return NULL;
}

// a posture of any model that has what it takes
static cav_status find_posture(const cav_problem_reader *reader, const cav_xml_node *node, const char *name,
                               double *q) {
  cav_stand stand;
  char why[200], *reason = why;
  cav_status status;
  if (strcmp(name, "stand")) {
    status = cav_posture_named(reader->model, reader->state, name, q, why);
  } else {
    status = cav_stand_find(reader->model, reader->state, q, &stand);
    reason = stand.why;
  }
  if (status == CAV_BAD_INPUT)
    return cav_xml_fail(reader->error, node, "key",
                        "neither the model '%s' nor this file has a keyframe or pose '%s', and %s; without 'key' a "
                        "posture is that of the model's file, with <joint name= degrees=> inside for single joints",
                        reader->model->name, name, reason);
  if (status)
    cav_xml_fail_as(reader->error, status, node, "key", "the posture '%s' cannot be evaluated: %s", name,
                    cav_status_name(status));
  return status;
}

// the first of the names, separated by |, that is a keyframe of the model or else a <pose>
static cav_status read_key(const cav_problem_reader *reader, const cav_xml_node *node, int depth, double *q) {
  const cav_model *m = reader->model;
  const char *list = cav_xml_text(node, "key", "");
  char *copy = strdup(list), *rest = copy, *name;
  if (!copy) return cav_problem_no_memory(reader);
  while ((name = strsep(&rest, "|"))) {
    name += strspn(name, " ");
    for (size_t n = strlen(name); n && name[n - 1] == ' '; n--) name[n - 1] = 0;
    int key = *name ? cav_object_find(m, CAV_OBJECT_KEY, name) : -1;
    const cav_xml_node *pose = *name ? pose_named(reader, name) : NULL;
    if (key < 0 && (!pose || pose == node)) continue;
    free(copy);
    if (key < 0) return read_pose(reader, pose, depth + 1, q);
    memcpy(q, m->key[key].q, (size_t)m->nq * sizeof(double));
    return CAV_OK;
  }
  // of any model that has feet, by whatever names
  const char *found = names_found(list);
  if (found) {
    free(copy);
    return find_posture(reader, node, found, q);
  }
  copy[strcspn(copy, " ")] = 0;
  const char *near = nearest_key(reader, copy);
  char known[NAMES] = "";
  if (!near) list_keys(reader, cav_xml_text(node, "name", ""), known);
  cav_xml_fail(reader->error, node, "key",
               "neither the model '%s' nor this file has a keyframe or pose of that name, got '%.200s'%s%s%s%s%s",
               m->name, list, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "", known,
               near ? "" : "; 'stand', 'kneel', 'sit' and more are found: cavort help postures");
  free(copy);
  return CAV_BAD_INPUT;
}

cav_status cav_problem_key(const cav_problem_reader *reader, const cav_xml_node *node, double *q) {
  return read_key(reader, node, 0, q);
}

static int unit(double *w) {
  double length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]);
  if (!(length > 1e-9)) return 0;
  for (int i = 0; i < 4; i++) w[i] /= length;
  return 1;
}

static cav_status read_numbers(const cav_problem_reader *reader, const cav_xml_node *node, double *q) {
  const cav_model *m = reader->model;
  const cav_xml_value *given = cav_xml_get(node, "qpos");
  if (given->count != m->nq) {
    return cav_xml_fail(reader->error, node, "qpos", "expected %d numbers for the model '%s', got %d", m->nq, m->name,
                        given->count);
  }
  cav_xml_reals(node, "qpos", q, m->nq);
  // numbers written with all digits stay as they are, others are brought to unit length
  for (int j = 0; j < m->njoint; j++) {
    if (m->joint[j].type != CAV_JOINT_FREE && m->joint[j].type != CAV_JOINT_BALL) continue;
    double *w = q + m->joint[j].q + (m->joint[j].type == CAV_JOINT_FREE ? 3 : 0), kept[4];
    memcpy(kept, w, sizeof kept);
    if (!unit(w))
      return cav_xml_fail(reader->error, node, "qpos", "the quaternion of joint '%s' is zero", m->joint[j].name);
    if (fabs(kept[0] * w[0] + kept[1] * w[1] + kept[2] * w[2] + kept[3] * w[3] - 1) < 1e-14)
      memcpy(w, kept, sizeof kept);
  }
  return CAV_OK;
}

// first or last knot of a trajectory: its configuration, or where q is NULL its velocity
static cav_status read_knot(const cav_problem_reader *reader, const cav_xml_node *node, double *q, double *v) {
  char *path = cav_file_beside(reader->path, cav_xml_text(node, "file", ""));
  if (!path) return cav_problem_no_memory(reader);
  cav_error inner = {0};
  cav_trajectory *trajectory = cav_trajectory_read(path, reader->model, &inner);
  free(path);
  if (!trajectory) return cav_xml_fail_as(reader->error, inner.status, node, "file", "%s", inner.text);
  int knot = cav_xml_word(node, "knot", 1) ? trajectory->nknot - 1 : 0;
  if (q) memcpy(q, trajectory->q + knot * trajectory->nq, (size_t)trajectory->nq * sizeof(double));
  if (v) memcpy(v, trajectory->v + knot * trajectory->nv, (size_t)trajectory->nv * sizeof(double));
  cav_trajectory_free(trajectory);
  return CAV_OK;
}

static cav_status read_base(const cav_problem_reader *reader, const cav_xml_node *node, int depth, double *q) {
  const char *source[] = {"key", "qpos", "file"};
  const char *first = NULL;
  for (int i = 0; i < 3; i++) {
    if (!cav_xml_get(node, source[i])) continue;
    if (first)
      return cav_xml_fail(reader->error, node, source[i], "contradicts attribute '%s'; give one of the two", first);
    first = source[i];
  }
  if (cav_xml_get(node, "knot") && !cav_xml_get(node, "file")) {
    return cav_xml_fail(reader->error, node, "knot", "says which knot of attribute 'file', which is missing");
  }
  cav_configuration_reset(reader->model, q);
  if (!first) return CAV_OK;
  if (first == source[0]) return read_key(reader, node, depth, q);
  return first == source[1] ? read_numbers(reader, node, q) : read_knot(reader, node, q, NULL);
}

cav_status cav_problem_pose_velocity(const cav_problem_reader *reader, const cav_xml_node *node, double *v) {
  if (!cav_xml_get(node, "file"))
    return cav_xml_fail(reader->error, node, "velocity", "is that of a knot of attribute 'file', which is missing");
  return read_knot(reader, node, NULL, v);
}

// the free joint that a <root> names, or the first; -1 and an error if it is none
static int root_joint(const cav_problem_reader *reader, const cav_xml_node *node) {
  const cav_model *m = reader->model;
  if (cav_xml_get(node, "joint")) {
    int j = cav_problem_find(reader, node, "joint", CAV_OBJECT_JOINT);
    if (j < 0 || m->joint[j].type == CAV_JOINT_FREE) return j;
    cav_xml_fail(reader->error, node, "joint", "joint '%s' is not free; use <joint>", m->joint[j].name);
    return -1;
  }
  for (int j = 0; j < m->njoint; j++) {
    if (m->joint[j].type == CAV_JOINT_FREE) return j;
  }
  cav_xml_fail(reader->error, node, NULL, "the model '%s' has no free joint; use <joint> instead", m->name);
  return -1;
}

// q turned about its own axis, or about the world's, degrees
static void turn(double q[4], int axis, double degrees, int world) {
  const double half = degrees * M_PI / 360;
  double rotation[4] = {cos(half), 0, 0, 0};
  rotation[1 + axis] = sin(half);
  quat_mul(q, world ? rotation : q, world ? q : rotation);
}

// position and orientation of a free joint
static cav_status lay_root(const cav_problem_reader *reader, const cav_xml_node *node, double *q) {
  const cav_model *m = reader->model;
  int j = root_joint(reader, node);
  if (j < 0) return CAV_BAD_INPUT;
  if (cav_xml_get(node, "quat") && cav_xml_get(node, "euler")) {
    return cav_xml_fail(reader->error, node, "euler", "contradicts attribute 'quat'; give one of the two");
  }
  double *at = q + m->joint[j].q, euler[3];
  cav_xml_reals(node, "pos", at, 3);
  if (cav_xml_reals(node, "quat", at + 3, 4) && !unit(at + 3)) {
    return cav_xml_fail(reader->error, node, "quat", "expected a quaternion that is not zero");
  }
  if (cav_xml_reals(node, "euler", euler, 3)) {
    // about x, then the new y, then the new z
    memcpy(at + 3, (double[]){1, 0, 0, 0}, 4 * sizeof(double));
    for (int i = 0; i < 3; i++) turn(at + 3, i, euler[i], 0);
  }
  if (cav_xml_get(node, "turn")) turn(at + 3, 2, cav_xml_real(node, "turn", 0), 1);
  return CAV_OK;
}

// velocity of a free joint; its last three numbers are about its body's own axes
static cav_status move_root(const cav_problem_reader *reader, const cav_xml_node *node, const double *q, double *v) {
  int j = root_joint(reader, node);
  if (j < 0) return CAV_BAD_INPUT;
  const cav_joint *joint = &reader->model->joint[j];
  double turn[3], back[4];
  cav_xml_reals(node, "linvel", v + joint->dof, 3);
  if (!cav_xml_reals(node, "angvel", turn, 3)) return CAV_OK;
  quat_conjugate(back, q + joint->q + 3);
  quat_rotate(v + joint->dof + 3, back, turn);
  return CAV_OK;
}

static cav_status move_joint(const cav_problem_reader *reader, const cav_xml_node *node, double *v) {
  if (!cav_xml_get(node, "vel")) return CAV_OK;
  int j = cav_problem_find(reader, node, "name", CAV_OBJECT_JOINT);
  if (j < 0) return CAV_BAD_INPUT;
  const cav_joint *joint = &reader->model->joint[j];
  if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE)
    return cav_xml_fail(reader->error, node, "vel", "joint '%s' has more than one velocity; %s", joint->name,
                        joint->type == CAV_JOINT_FREE ? "use <root linvel='' angvel=''>" : "use 'qvel' of <start>");
  v[joint->dof] = cav_xml_real(node, "vel", 0);
  return CAV_OK;
}

cav_status cav_problem_pose_moves(const cav_problem_reader *reader, const cav_xml_node *node, const double *q,
                                  double *v) {
  cav_status status = CAV_OK;
  const cav_xml_node *root = cav_problem_child(node, "root"), *joint = cav_problem_child(node, "joint");
  for (; root && !status; root = cav_xml_next(root)) status = move_root(reader, root, q, v);
  for (; joint && !status; joint = cav_xml_next(joint)) status = move_joint(reader, joint, v);
  return status;
}

static cav_status lay_joint(const cav_problem_reader *reader, const cav_xml_node *node, double *q) {
  int j = cav_problem_find(reader, node, "name", CAV_OBJECT_JOINT);
  if (j < 0) return CAV_BAD_INPUT;
  const cav_joint *joint = &reader->model->joint[j];
  int given = !!cav_xml_get(node, "pos") + !!cav_xml_get(node, "degrees") + !!cav_xml_get(node, "quat");
  if (!given && cav_xml_get(node, "vel")) return CAV_OK;
  if (given != 1)
    return cav_xml_fail(reader->error, node, NULL, "expected one of the attributes pos, degrees, quat, got %d", given);
  const char *wanted = joint->type == CAV_JOINT_BALL ? "quat" : "pos";
  if (joint->type == CAV_JOINT_FREE)
    return cav_xml_fail(reader->error, node, "name", "joint '%s' is free; use <root>", joint->name);
  if (joint->type == CAV_JOINT_SLIDE && cav_xml_get(node, "degrees")) {
    return cav_xml_fail(reader->error, node, "degrees", "joint '%s' slides; give its metres in 'pos'", joint->name);
  }
  if ((joint->type == CAV_JOINT_BALL) != !!cav_xml_get(node, "quat")) {
    return cav_xml_fail(reader->error, node, wanted, "is what joint '%s' needs", joint->name);
  }
  if (cav_xml_reals(node, "quat", q + joint->q, 4) && !unit(q + joint->q)) {
    return cav_xml_fail(reader->error, node, "quat", "expected a quaternion that is not zero");
  }
  if (cav_xml_get(node, "pos")) q[joint->q] = cav_xml_real(node, "pos", 0);
  if (cav_xml_get(node, "degrees")) q[joint->q] = cav_xml_real(node, "degrees", 0) * M_PI / 180;
  return CAV_OK;
}

// adds to a list of texts
static void add_text(char *text, size_t room, const char *format, ...) {
  size_t used = strlen(text);
  va_list args;
  if (used && used + 3 < room) used += (size_t)sprintf(text + used, ", ");
  va_start(args, format);
  vsnprintf(text + used, room - used, format, args);
  va_end(args);
}

// what a posture of that element raised out of a solid that it began inside
static cav_status note_raised(const cav_problem_reader *reader, const cav_xml_node *node, const cav_joint *joint,
                              double way, double *before) {
  static const double told = 0.002; // m
  const cav_model *m = reader->model;
  char label[CAV_WORDS];
  double up;
  int solid;
  if (!(way > told) || cav_xml_get(node, "rise")) return CAV_OK;
  cav_status status = cav_tree_buried(m, reader->state, joint->link, before, &solid, &up);
  if (!status && solid >= 0 && fabs(up - way) < told)
    add_text(reader->owner->lowered, sizeof reader->owner->lowered,
             "<%s> raises '%.60s' by %.3g m onto '%.100s', inside which it begins", node->rule->name,
             m->body[m->link[joint->link].body].name, way, cav_geom_words(m, solid, label));
  return status;
}

// bodies without joints that a posture of that element brought down by more than they are put down: a ball that was meant to fly,
// or a box that begins inside a table, which is not stopped by it. before is as it was in the end
static cav_status note_lowered(const cav_problem_reader *reader, const cav_xml_node *node, double *before,
                               const double *q) {
  static const double put_down = 0.05; // m
  const cav_model *m = reader->model;
  cav_problem_owner *owner = reader->owner;
  cav_status status = CAV_OK;
  for (int j = 0; j < m->njoint && !status; j++) {
    const cav_joint *joint = &m->joint[j];
    if (joint->type != CAV_JOINT_FREE) continue;
    double way = before[joint->q + 2] - q[joint->q + 2], up;
    int links = 0, solid;
    status = note_raised(reader, node, joint, -way, before);
    if (status) break;
    for (int i = 1; i < m->nlink; i++) links += m->link[i].root == joint->link;
    if (links != 1 || !(way > put_down)) continue;
    const char *name = m->body[m->link[joint->link].body].name;
    status = cav_tree_buried(m, reader->state, joint->link, before, &solid, &up);
    if (status) break;
    if (solid < 0) {
      add_text(owner->lowered, sizeof owner->lowered, "<%s> lowers '%.60s' by %.3g m", node->rule->name, name, way);
      continue;
    }
    char label[CAV_WORDS], raise[60] = "";
    // to the next millimetre; what lies a rounding deep in it is stopped by it
    if (up > 0) snprintf(raise, sizeof raise, ": %.3f m higher it is on that", ceil(1e3 * up - 1e-3) / 1e3);
    add_text(owner->buried, sizeof owner->buried,
             "<%s> lowers '%.60s' by %.3g m, not stopped by '%.100s', inside which it begins%s", node->rule->name, name,
             way, cav_geom_words(m, solid, label), raise);
  }
  return status;
}

const char *cav_problem_lowered(const cav_problem *problem) {
  return ((const cav_problem_owner *)(const void *)problem)->lowered;
}

const char *cav_problem_buried(const cav_problem *problem) {
  return ((const cav_problem_owner *)(const void *)problem)->buried;
}

// down to the floor, without the trees whose <root> stays as it is stated
static cav_status drop(const cav_problem_reader *reader, const cav_xml_node *node, double *q) {
  const cav_model *m = reader->model;
  cav_error inner = {0};
  double rise = cav_xml_real(node, "rise", 0), *before = calloc((size_t)m->nq + 1, sizeof *before);
  if (!before) return cav_problem_no_memory(reader);
  memcpy(before, q, (size_t)m->nq * sizeof *q);
  cav_status status = cav_configuration_to_floor(m, reader->state, cav_xml_get(node, "rise") ? &rise : NULL, q, &inner);
  if (status) cav_xml_fail_as(reader->error, status, node, "height", "%s", inner.text);
  const cav_xml_node *root = cav_problem_child(node, "root");
  for (; root && !status; root = cav_xml_next(root)) {
    int j = cav_xml_word(root, "height", 1) ? -1 : root_joint(reader, root);
    if (j >= 0) memcpy(q + m->joint[j].q, before + m->joint[j].q, 3 * sizeof *q);
  }
  if (!status && (status = note_lowered(reader, node, before, q)))
    cav_xml_fail_as(reader->error, status, node, "height", "the posture cannot be evaluated: %s",
                    cav_status_name(status));
  free(before);
  return status;
}

static cav_status read_pose(const cav_problem_reader *reader, const cav_xml_node *node, int depth, double *q) {
  if (depth > DEEPEST) return cav_xml_fail(reader->error, node, "key", "poses name each other in a circle");
  cav_status status = read_base(reader, node, depth, q);
  const cav_xml_node *root = cav_problem_child(node, "root");
  for (; root && !status; root = cav_xml_next(root)) status = lay_root(reader, root, q);
  const cav_xml_node *joint = cav_problem_child(node, "joint");
  for (; joint && !status; joint = cav_xml_next(joint)) status = lay_joint(reader, joint, q);
  if (!status && cav_xml_word(node, "ranges", 0)) {
    clip(reader, q);
    // postures of a guess may be outside: what is checked is brought in
    if (!reader->moved && cav_tendons_clip(reader->model, reader->state, q)) status = cav_problem_no_memory(reader);
  }
  if (!status && cav_xml_word(node, "height", 0)) status = drop(reader, node, q);
  if (!status && cav_xml_get(node, "rise") && !cav_xml_word(node, "height", 0))
    status = cav_xml_fail(reader->error, node, "rise", "is counted from the floor; add height='floor'");
  return status;
}

cav_status cav_problem_pose(const cav_problem_reader *reader, const cav_xml_node *node, double *q) {
  return read_pose(reader, node, 0, q);
}

static int in_degrees(const cav_problem_reader *reader, const cav_xml_node *node, int joint, int depth) {
  int stated = 0, degrees = 0;
  const cav_xml_node *child = cav_problem_child(node, "joint");
  for (; child; child = cav_xml_next(child)) {
    if (cav_problem_find(reader, child, "name", CAV_OBJECT_JOINT) != joint) continue;
    stated = 1;
    degrees = cav_xml_get(child, "degrees") != NULL;
  }
  const cav_xml_node *pose = pose_named(reader, cav_xml_text(node, "key", ""));
  return stated || !pose || depth >= DEEPEST ? degrees : in_degrees(reader, pose, joint, depth + 1);
}

int cav_problem_in_degrees(const cav_problem_reader *reader, const cav_xml_node *node, int joint) {
  return in_degrees(reader, node, joint, 0);
}
