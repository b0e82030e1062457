/// Reads the SRDF file beside a URDF file, as planners write it: pairs of links that are not to collide, and postures of
/// the robot, which become keyframes. It is sought by the name of the URDF file, then by that of the robot, in the same
/// folder and in the folder srdf beside that. Postures of one name that speak of several groups are one. A first joint
/// with seven numbers is the pose of a floating root: position and quaternion (x, y, z, w). Groups, end effectors and
/// virtual joints are passed over.
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "math3.h"
#include "spec.h"

static const cav_xml_attribute pair_attributes[] = {{"link1", CAV_XML_TEXT, 1, 0, NULL, 1, NULL},
                                                    {"link2", CAV_XML_TEXT, 1, 0, NULL, 1, NULL},
                                                    {"reason", CAV_XML_SKIP, 0, 0, NULL, 0, NULL},
                                                    {NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL}};
static const cav_xml_attribute value_attributes[] = {{"name", CAV_XML_TEXT, 1, 0, NULL, 1, NULL},
                                                     {"value", CAV_XML_REAL, 0, 0, NULL, 1, NULL},
                                                     {NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL}};
static const cav_xml_attribute state_attributes[] = {{"name", CAV_XML_TEXT, 1, 0, NULL, 1, NULL},
                                                     {"group", CAV_XML_SKIP, 0, 0, NULL, 0, NULL},
                                                     {NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL}};
static const cav_xml_attribute robot_attributes[] = {{"name", CAV_XML_TEXT, 0, 0, NULL, 0, NULL},
                                                     {NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL}};
static const cav_xml_element pair = {"disable_collisions", 0, 0, pair_attributes, NULL, CAV_XML_OPEN, NULL};
static const cav_xml_element value = {"joint", 0, 0, value_attributes, NULL, CAV_XML_OPEN, NULL};
static const cav_xml_element *const state_children[] = {&value, NULL};
static const cav_xml_element state = {"group_state", 0, 0, state_attributes, state_children, CAV_XML_OPEN, NULL};
static const cav_xml_element *const robot_children[] = {&pair, &state, NULL};
static const cav_xml_element robot = {"robot", 0, 0, robot_attributes, robot_children, CAV_XML_OPEN | CAV_XML_PROSE,
                                      NULL};

// path of the file by one name, length characters long, in one folder; NULL if there is none
static const char *try_path(cav_spec *spec, int folder, const char *between, const char *name, int length) {
  size_t room = (size_t)folder + strlen(between) + (size_t)length + sizeof ".srdf";
  char *path = cav_spec_keep_text(spec, room);
  if (!path) return NULL;
  snprintf(path, room, "%.*s%s%.*s.srdf", folder, cav_xml_path(spec->xml), between, length, name);
  return access(path, R_OK) ? NULL : path;
}

static const char *find_file(cav_spec *spec) {
  const char *file = cav_xml_path(spec->xml), *slash = strrchr(file, '/'), *stem = slash ? slash + 1 : file;
  const char *dot = strrchr(stem, '.');
  int folder = (int)(stem - file);
  const char *const names[] = {stem, spec->name};
  const int lengths[] = {dot ? (int)(dot - stem) : (int)strlen(stem), (int)strlen(spec->name)};
  for (int i = 0; i < 2; i++) {
    const char *found = lengths[i] ? try_path(spec, folder, "", names[i], lengths[i]) : NULL;
    if (!found && lengths[i]) found = try_path(spec, folder, "../srdf/", names[i], lengths[i]);
    if (found || spec->status != CAV_OK) return found;
  }
  return NULL;
}

// 1 if both links are bodies that are read
static int read_pair(cav_spec *spec, const cav_xml_node *node) {
  const char *one = cav_xml_text(node, "link1", ""), *other = cav_xml_text(node, "link2", "");
  if (cav_name_find(spec->body.at, spec->body.n, sizeof *spec->body.at, one) < 0) return 0;
  if (cav_name_find(spec->body.at, spec->body.n, sizeof *spec->body.at, other) < 0) return 0;
  cav_spec_exclude *e = CAV_SPEC_PUSH(spec, &spec->exclude);
  if (e) *e = (cav_spec_exclude){node, one, other};
  return 1;
}

// first coordinate of a joint in q; of joint.n: their number
static int coordinate(const cav_spec *spec, int joint) {
  static const int size[] = {[CAV_JOINT_FREE] = 7, [CAV_JOINT_BALL] = 4, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  int at = 0;
  for (int i = 0; i < joint; i++) at += size[spec->joint.at[i].type];
  return at;
}

// the file's posture, before a state says anything
static double *new_posture(cav_spec *spec, int nq) {
  double *q = (double *)(void *)cav_spec_keep_text(spec, sizeof(double) * ((size_t)nq + 1));
  for (int i = 0; q && i < spec->joint.n; i++) {
    const cav_spec_body *b = &spec->body.at[spec->joint.at[i].body];
    if (spec->joint.at[i].type != CAV_JOINT_FREE) continue;
    copy3(q + coordinate(spec, i), b->pos);
    memcpy(q + coordinate(spec, i) + 3, b->quat, sizeof b->quat);
  }
  return q;
}

static void read_state(cav_spec *spec, const cav_xml_node *node) {
  const char *name = cav_xml_text(node, "name", "");
  int nq = coordinate(spec, spec->joint.n), k = cav_name_find(spec->key.at, spec->key.n, sizeof *spec->key.at, name);
  if (k < 0) {
    double *q = new_posture(spec, nq);
    cav_spec_key *key = q ? CAV_SPEC_PUSH(spec, &spec->key) : NULL;
    if (!key) return;
    *key = (cav_spec_key){.name = name, .node = node, .nq = nq, .q = q};
    k = spec->key.n - 1;
  }
  double *q = (double *)spec->key.at[k].q;
  for (const cav_xml_node *c = cav_xml_child(node, &value); c; c = cav_xml_next(c)) {
    int i = cav_name_find(spec->joint.at, spec->joint.n, sizeof *spec->joint.at, cav_xml_text(c, "name", ""));
    const cav_xml_value *given = cav_xml_get(c, "value");
    int floats = spec->joint.n > 0 && spec->joint.at[0].type == CAV_JOINT_FREE;
    if (i < 0 && floats && given->count == 7) {
      const double *x = given->number, quat[4] = {x[6], x[3], x[4], x[5]};
      copy3(q, x);
      memcpy(q + 3, quat, sizeof quat);
    } else if (i >= 0 && given->count == 1 && spec->joint.at[i].type >= CAV_JOINT_SLIDE) {
      q[coordinate(spec, i)] = given->number[0];
    }
  }
}

void cav_srdf_read(cav_spec *spec) {
  static const cav_xml_element *const roots[] = {&robot, NULL};
  const char *path = find_file(spec);
  if (!path || spec->status != CAV_OK) return;
  cav_error error = {0};
  cav_xml *xml = cav_xml_read(path, roots, NULL, &error);
  const cav_xml_node *urdf = cav_xml_root(spec->xml);
  if (!xml) {
    if (error.status == CAV_NO_MEMORY)
      cav_spec_no_memory(spec);
    else
      cav_spec_warn(spec, urdf, NULL, "the SRDF file beside it is left aside: %.400s", error.text);
    return;
  }
  cav_xml **slot = CAV_SPEC_PUSH(spec, &spec->others);
  if (!slot) {
    cav_xml_free(xml);
    return;
  }
  *slot = xml;
  const cav_xml_node *root = cav_xml_root(xml);
  int pairs = 0;
  for (const cav_xml_node *c = cav_xml_child(root, &pair); c && spec->status == CAV_OK; c = cav_xml_next(c))
    pairs += read_pair(spec, c);
  for (const cav_xml_node *c = cav_xml_child(root, &state); c && spec->status == CAV_OK; c = cav_xml_next(c))
    read_state(spec, c);
  cav_spec_warn(spec, root, NULL, "read beside the URDF file: %d pairs of links that do not touch, %d keyframes", pairs,
                spec->key.n);
}
