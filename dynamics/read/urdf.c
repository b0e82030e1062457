/// Reads a URDF tree into a spec: links become bodies, joints move the body of their child link.
///
/// Source: the URDF specification of ROS, and where it is silent, what MuJoCo makes of such files: the root link stands
/// in the world unless a floating joint carries it (or the caller asks for a free base); links without an inertial
/// element weigh what their collision shapes weigh at 1000 kg/m^3; limits hold where lower < upper. What is read beyond
/// collision: visual geometry only on request, since it can neither touch nor weigh. Links joined by fixed joints move
/// as one and keep their names; their reference weights are those of the whole, as if they were merged, unless the
/// file's <mujoco><compiler fusestatic="false"/></mujoco> says otherwise. A joint with an effort limit gets a motor of
/// that range; one that mimics another is tied to it by a joint equality and has no motor of its own. A joint on which
/// nothing weighs, that of a camera's frame or of a wheel that is only drawn, is held. Moments of inertia that no solid
/// has are mended where rounding explains them, and let pass where not, as by other readers of URDF; both are told. What
/// the file asks for and is left aside is a warning, once with a count: safety controllers, elements that no table knows,
/// and velocity limits, which are kept for certificates to tell. Not done: soft limits, transmissions, xacro.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <strings.h>
#include <unistd.h>

#include "math3.h"
#include "spec.h"

// --- grammar ---

#define TEXT(name, needed) \
  { name, CAV_XML_TEXT, 1, 0, NULL, needed, NULL }
#define NUMBERS(name, n, needed) \
  { name, CAV_XML_REAL, n, n, NULL, needed, NULL }
#define SKIP(name) \
  { name, CAV_XML_SKIP, 0, 0, NULL, 0, NULL }
#define END \
  { NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL }
#define ELEMENT(id, name, least, most, ...)                              \
  static const cav_xml_attribute id##_attributes[] = {__VA_ARGS__, END}; \
  static const cav_xml_element id = {name, least, most, id##_attributes, NULL, CAV_XML_OPEN, NULL}
#define PARENT(id, name, least, most, children, ...)                     \
  static const cav_xml_attribute id##_attributes[] = {__VA_ARGS__, END}; \
  static const cav_xml_element id = {name, least, most, id##_attributes, children, CAV_XML_OPEN, NULL}
#define UNREAD(id, name) static const cav_xml_element id = {name, 0, 0, NULL, NULL, CAV_XML_ANYTHING, NULL}

static const char *const joint_types[] = {"revolute", "continuous", "prismatic", "fixed",
                                          "floating", "planar",     "spherical", NULL};
enum { REVOLUTE, CONTINUOUS, PRISMATIC, FIXED, FLOATING, PLANAR, SPHERICAL };

// what robot programs write and no dynamics here needs
UNREAD(gazebo, "gazebo");
UNREAD(transmission, "transmission");
UNREAD(verbose, "verbose");
UNREAD(calibration, "calibration");

ELEMENT(origin, "origin", 0, 1, NUMBERS("xyz", 3, 0), NUMBERS("rpy", 3, 0));
ELEMENT(mass, "mass", 1, 1, NUMBERS("value", 1, 1));
ELEMENT(inertia, "inertia", 1, 1, NUMBERS("ixx", 1, 1), NUMBERS("ixy", 1, 0), NUMBERS("ixz", 1, 0),
        NUMBERS("iyy", 1, 1), NUMBERS("iyz", 1, 0), NUMBERS("izz", 1, 1));
static const cav_xml_element *const inertial_children[] = {&origin, &mass, &inertia, NULL};
PARENT(inertial, "inertial", 0, 1, inertial_children, SKIP("name"));

ELEMENT(color, "color", 0, 1, NUMBERS("rgba", 4, 1));
UNREAD(texture, "texture");
static const cav_xml_element *const material_children[] = {&color, &texture, NULL};
PARENT(material, "material", 0, 0, material_children, {"name", CAV_XML_TEXT, 0, 0, NULL, 0, NULL});

ELEMENT(box, "box", 0, 1, NUMBERS("size", 3, 1));
ELEMENT(sphere, "sphere", 0, 1, NUMBERS("radius", 1, 1));
ELEMENT(cylinder, "cylinder", 0, 1, NUMBERS("radius", 1, 1), NUMBERS("length", 1, 1));
ELEMENT(capsule, "capsule", 0, 1, NUMBERS("radius", 1, 1), NUMBERS("length", 1, 1));
ELEMENT(mesh, "mesh", 0, 1, {"filename", CAV_XML_TEXT, 0, 0, NULL, 1, NULL},
        {"scale", CAV_XML_REAL, 1, 3, NULL, 0, NULL});
static const cav_xml_element *const geometry_children[] = {&box, &sphere, &cylinder, &capsule, &mesh, NULL};
PARENT(geometry, "geometry", 1, 1, geometry_children, SKIP("name"));
static const cav_xml_element *const shape_children[] = {&origin, &geometry, &material, &verbose, NULL};
PARENT(visual, "visual", 0, 0, shape_children, {"name", CAV_XML_TEXT, 0, 0, NULL, 0, NULL});
PARENT(collision, "collision", 0, 0, shape_children, {"name", CAV_XML_TEXT, 0, 0, NULL, 0, NULL}, SKIP("group"));
static const cav_xml_element *const link_children[] = {&inertial, &visual, &collision, NULL};
PARENT(robot_link, "link", 0, 0, link_children, TEXT("name", 1), SKIP("type"));

ELEMENT(parent, "parent", 1, 1, TEXT("link", 1));
ELEMENT(child, "child", 1, 1, TEXT("link", 1));
ELEMENT(axis, "axis", 0, 1, NUMBERS("xyz", 3, 1));
// as texts: they may be infinite
ELEMENT(limit, "limit", 0, 1, TEXT("lower", 0), TEXT("upper", 0), TEXT("effort", 0), TEXT("velocity", 0));
ELEMENT(dynamics, "dynamics", 0, 1, NUMBERS("damping", 1, 0), NUMBERS("friction", 1, 0));
ELEMENT(mimic, "mimic", 0, 1, TEXT("joint", 1), NUMBERS("multiplier", 1, 0), NUMBERS("offset", 1, 0));
ELEMENT(safety, "safety_controller", 0, 1, SKIP("soft_lower_limit"), SKIP("soft_upper_limit"), SKIP("k_position"),
        SKIP("k_velocity"));
static const cav_xml_element *const joint_children[] = {&origin,   &parent, &child,  &axis,        &limit,
                                                        &dynamics, &mimic,  &safety, &calibration, NULL};
PARENT(joint, "joint", 0, 0, joint_children, TEXT("name", 1), {"type", CAV_XML_WORD, 0, 0, joint_types, 1, NULL});

static const cav_xml_element *const robot_children[] = {&robot_link,         &joint, &material, &gazebo, &transmission,
                                                        &cav_mjcf_extension, NULL};
static const cav_xml_attribute robot_attributes[] = {TEXT("name", 0), SKIP("version"), END};
const cav_xml_element cav_urdf_root = {"robot", 0, 0, robot_attributes, robot_children, CAV_XML_OPEN | CAV_XML_PROSE,
                                       NULL};

// --- the tree of links ---

// a link and the joint that carries it
typedef struct part {
  const char *name;
  const cav_xml_node *node, *joint; // joint NULL: the root
  int first, last, next;            // children in the order of their joints; -1: none
  int held;                         // the joint is held, since nothing on it weighs
} part;

typedef struct reader {
  cav_spec *spec;
  CAV_SPEC_LIST(part) parts; // by name
  int velocities;            // joints with a velocity limit
} reader;

enum { DEPTH_MAX = 1000 }; // links one after another

static int compare_parts(const void *a, const void *b) {
  const part *x = a, *y = b;
  int order = strcmp(x->name, y->name);
  return order ? order : (x->node->line > y->node->line) - (x->node->line < y->node->line);
}

static int find_part(const reader *r, const char *name) {
  int low = 0, high = r->parts.n - 1;
  while (low <= high) {
    int middle = (low + high) / 2, order = strcmp(name, r->parts.at[middle].name);
    if (!order) return middle;
    if (order < 0)
      high = middle - 1;
    else
      low = middle + 1;
  }
  return -1;
}

// all links by name; two of one name are a fault
static void collect_links(reader *r, const cav_xml_node *root) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = cav_xml_child(root, &robot_link); c; c = cav_xml_next(c)) {
    part *p = CAV_SPEC_PUSH(spec, &r->parts);
    if (!p) return;
    *p = (part){.name = cav_xml_text(c, "name", ""), .node = c, .first = -1, .last = -1, .next = -1};
  }
  if (!r->parts.n) {
    cav_spec_fail(spec, root, NULL, "no link: the model is empty; add links");
    return;
  }
  qsort(r->parts.at, (size_t)r->parts.n, sizeof *r->parts.at, compare_parts);
  for (int i = 1; i < r->parts.n; i++) {
    const part *p = &r->parts.at[i];
    if (!strcmp(p->name, p[-1].name))
      cav_spec_fail(spec, p->node, "name", "'%.60s' is taken already at line %d; choose another", p->name,
                    p[-1].node->line);
  }
}

// the link that an element inside a joint names; -1 after a failure
static int named_link(reader *r, const cav_xml_node *in_joint, const cav_xml_element *rule) {
  const cav_xml_node *node = cav_xml_child(in_joint, rule);
  const char *name = cav_xml_text(node, "link", "");
  int i = find_part(r, name);
  if (i < 0) cav_spec_unknown(r->spec, node, "link", "link", name, r->parts.at, r->parts.n, sizeof(part));
  return i;
}

static void collect_joints(reader *r, const cav_xml_node *root) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = cav_xml_child(root, &joint); c && spec->status == CAV_OK; c = cav_xml_next(c)) {
    int up = named_link(r, c, &parent), down = named_link(r, c, &child);
    if (up < 0 || down < 0) return;
    part *p = &r->parts.at[up], *q = &r->parts.at[down];
    if (q->joint) {
      cav_spec_fail(spec, c, NULL,
                    "carries link '%.60s', which the joint at line %d carries already; loops of links "
                    "cannot be read",
                    q->name, q->joint->line);
      return;
    }
    q->joint = c;
    if (p->last < 0)
      p->first = down;
    else
      r->parts.at[p->last].next = down;
    p->last = down;
  }
}

// the one link that no joint carries
static int find_root(reader *r, const cav_xml_node *root) {
  int found = -1;
  for (int i = 0; i < r->parts.n; i++) {
    const part *p = &r->parts.at[i];
    if (p->joint) continue;
    if (found >= 0) {
      cav_spec_fail(r->spec, p->node, NULL, "no joint carries '%.60s' nor '%.60s'; one link alone may be the root",
                    p->name, r->parts.at[found].name);
      return -1;
    }
    found = i;
  }
  if (found < 0) cav_spec_fail(r->spec, root, NULL, "every link is carried by a joint: they form a circle; open it");
  return found;
}

// --- poses and inertia ---

// angles about the fixed axes x, y, z, in this order
static void quat_of_rpy(const double rpy[3], double quat[4]) {
  double q[4] = {1, 0, 0, 0};
  for (int i = 0; i < 3; i++) {
    double turn[4] = {cos(rpy[i] / 2), 0, 0, 0};
    turn[1 + i] = sin(rpy[i] / 2);
    quat_mul(q, turn, q);
  }
  memcpy(quat, q, sizeof q);
}

static void read_origin(const cav_xml_node *node, double pos[3], double quat[4]) {
  const cav_xml_node *o = cav_xml_child(node, &origin);
  double rpy[3] = {0, 0, 0};
  zero3(pos);
  if (o) cav_xml_reals(o, "xyz", pos, 3);
  if (o) cav_xml_reals(o, "rpy", rpy, 3);
  quat_of_rpy(rpy, quat);
}

static void read_inertial(reader *r, const cav_xml_node *node, cav_spec_body *b) {
  const cav_xml_node *m = cav_xml_child(node, &mass), *i = cav_xml_child(node, &inertia);
  double quat[4], R[9];
  const double S[6] = {cav_xml_real(i, "ixx", 0), cav_xml_real(i, "iyy", 0), cav_xml_real(i, "izz", 0),
                       cav_xml_real(i, "ixy", 0), cav_xml_real(i, "ixz", 0), cav_xml_real(i, "iyz", 0)};
  b->has_inertial = b->has_full = 1;
  read_origin(node, b->inertia.com, quat);
  quat_matrix(R, quat);
  symmetric_rotate(b->full, R, S);
  b->inertia.mass = cav_xml_real(m, "value", 0);
  if (b->inertia.mass < 0) cav_spec_fail(r->spec, m, "value", "expected a mass >= 0, got %g", b->inertia.mass);
}

// --- shapes ---

// path of a mesh: of a package, sought in the folders above the file; or relative to the file, or its name alone there
static const char *find_file(cav_spec *spec, const char *name) {
  const char *file = cav_xml_path(spec->xml), *slash = strrchr(file, '/'), *rest = name, *last = strrchr(name, '/');
  int folder = slash ? (int)(slash - file) + 1 : 0, package = !strncmp(name, "package://", 10);
  if (package) rest = name + 10;
  // without a package's name the path starts at one of the folders above
  while (package && *rest == '/') rest++;
  if (!strncmp(name, "file://", 7)) rest = name + 7;
  if (!*rest) return NULL;
  // the folder that a package was cloned into may have another name
  const char *inside = package && strchr(rest, '/') ? strchr(rest, '/') + 1 : rest;
  size_t room = strlen(file) + strlen(name) + strlen(spec->compiler.mesh_folder) + 4;
  char *path = cav_spec_keep_text(spec, room);
  if (!path) return NULL;
  if (*rest == '/') {
    snprintf(path, room, "%s", rest);
    return access(path, F_OK) ? NULL : path;
  }
  for (int end = folder;; end--) {
    while (end > 0 && file[end - 1] != '/') end--;
    snprintf(path, room, "%.*s%s", end, file, rest);
    if (!access(path, F_OK)) return path;
    snprintf(path, room, "%.*s%s", end, file, inside);
    if (!access(path, F_OK)) return path;
    if (end == 0 || rest == name) break;
  }
  if (!spec->compiler.strip) return NULL;
  const char *mesh_folder = spec->compiler.mesh_folder;
  snprintf(path, room, "%.*s%s%s%s", *mesh_folder == '/' ? 0 : folder, file, mesh_folder, *mesh_folder ? "/" : "",
           last ? last + 1 : name);
  return access(path, F_OK) ? NULL : path;
}

// whether a file is of a kind that mesh.c reads
static int is_readable(const char *path) {
  const char *dot = strrchr(path, '.');
#ifdef CAVORT_LOADS_ASSIMP
  if (dot && !strcasecmp(dot, ".dae")) return 1;
#endif
  return dot && (!strcasecmp(dot, ".stl") || !strcasecmp(dot, ".obj"));
}

// whether a shape of collision gives a link mass: it has a volume here
static int has_volume(cav_spec *spec, const cav_xml_node *node) {
  const cav_xml_node *shape = cav_xml_child(node, &geometry)->child;
  while (shape && (shape->rule->flags & CAV_XML_STRANGE)) shape = shape->next;
  if (!shape || shape->rule != &mesh) return shape != NULL;
  const char *path = find_file(spec, cav_xml_text(shape, "filename", ""));
  return path && is_readable(path);
}

// whether something on a link weighs: its inertial element, or without one its shapes. Joints that carry nothing of the
// kind, frames of cameras, wheels that were only drawn, skids that only touch, are marked as held
static int mark_held(reader *r, int index, int depth) {
  part *p = &r->parts.at[index];
  const cav_xml_node *i = cav_xml_child(p->node, &inertial);
  int weighs = depth > DEPTH_MAX || (i && cav_xml_real(cav_xml_child(i, &mass), "value", 0) != 0);
  for (const cav_xml_node *c = i ? NULL : cav_xml_child(p->node, &collision); c && !weighs; c = cav_xml_next(c))
    weighs = has_volume(r->spec, c);
  for (int k = p->first; k >= 0 && depth <= DEPTH_MAX; k = r->parts.at[k].next)
    weighs = mark_held(r, k, depth + 1) || weighs;
  int type = p->joint ? cav_xml_word(p->joint, "type", FIXED) : FIXED;
  p->held = !weighs && type != FIXED && type != FLOATING;
  if (p->held)
    cav_spec_leave(r->spec, p->joint, NULL,
                   "nothing on it weighs: the joint is held; give its link an inertial element");
  return weighs;
}

// a mesh that is absent, or of a format that is not read, cannot be touched; said, not fatal, for robots travel without
// their meshes
static int read_mesh(cav_spec *spec, const cav_xml_node *node, const double scale[3], int seen_only, cav_spec_geom *g) {
  const char *name = cav_xml_text(node, "filename", ""), *path = find_file(spec, name);
  if (spec->status != CAV_OK) return 0;
  if (!path || !is_readable(path)) {
    static const char *const text[2][2] = {{"the file is not found: the shape is left out, nothing touches it",
                                            "the file is not found: the shape is left out, nothing shows it"},
                                           {"of a format that this build does not read: the shape is left out, nothing "
                                            "touches it; convert it to .stl or .obj",
                                            "of a format that this build does not read: the shape is left out, nothing "
                                            "shows it; convert it to .stl or .obj"}};
    cav_spec_leave(spec, node, "filename", text[path != NULL][seen_only]);
    return 0;
  }
  g->type = CAV_GEOM_MESH;
  g->asset = cav_add_mesh(spec, node, path, scale);
  g->weighs = cav_geom_weighs(spec, g);
  return 1;
}

// one of the shapes into a geom; 0 where it is left out
static int read_shape(reader *r, const cav_xml_node *node, int seen_only, cav_spec_geom *g) {
  cav_spec *spec = r->spec;
  const cav_xml_node *shape = node->child;
  while (shape && (shape->rule->flags & CAV_XML_STRANGE)) shape = shape->next;
  if (!shape) {
    cav_spec_leave(spec, node, NULL, "left out: no shape inside; give a box, sphere, cylinder, capsule or mesh");
    return 0;
  }
  if (shape->rule == &box) {
    g->type = CAV_GEOM_BOX;
    cav_xml_reals(shape, "size", g->size, 3);
    scale3(g->size, 0.5, g->size);
  } else if (shape->rule == &mesh) {
    double scale[3] = {1, 1, 1};
    int given = cav_xml_reals(shape, "scale", scale, 3);
    if (given == 1) scale[1] = scale[2] = scale[0];
    if (given == 2) cav_spec_fail(spec, shape, "scale", "expected 1 or 3 numbers, got 2");
    return read_mesh(spec, shape, scale, seen_only, g);
  } else {
    g->type = shape->rule == &sphere     ? CAV_GEOM_SPHERE
              : shape->rule == &cylinder ? CAV_GEOM_CYLINDER
                                         : CAV_GEOM_CAPSULE;
    g->size[0] = cav_xml_real(shape, "radius", 0);
    g->size[1] = cav_xml_real(shape, "length", 0) / 2;
  }
  return 1;
}

// colour of a shape: its own, or that of the material of the robot with the same name
static void read_colour(const cav_xml_node *root, const cav_xml_node *shape, double rgba[4]) {
  const double plain[4] = {0.5, 0.5, 0.5, 1};
  memcpy(rgba, plain, sizeof plain);
  const cav_xml_node *m = cav_xml_child(shape, &material), *c = m ? cav_xml_child(m, &color) : NULL;
  const char *name = m ? cav_xml_text(m, "name", "") : "";
  for (const cav_xml_node *i = cav_xml_child(root, &material); i && m && !c; i = cav_xml_next(i)) {
    if (*name && !strcmp(name, cav_xml_text(i, "name", ""))) c = cav_xml_child(i, &color);
  }
  if (c) cav_xml_reals(c, "rgba", rgba, 4);
}

// a shape that touches, or one that is only seen
static void read_geom(reader *r, const cav_xml_node *node, int body) {
  cav_spec *spec = r->spec;
  int seen_only = node->rule == &visual;
  cav_spec_geom g;
  cav_mjcf_default_geom(&g);
  g.name = cav_xml_text(node, "name", "");
  g.node = node;
  g.body = body;
  g.number = ++spec->body.at[body].geoms;
  read_origin(node, g.pos, g.quat);
  read_colour(cav_xml_root(spec->xml), node, g.rgba);
  if (seen_only) {
    g.contype = g.conaffinity = 0;
    g.group = 1;
    g.has_mass = 1;
  }
  if (!read_shape(r, cav_xml_child(node, &geometry), seen_only, &g) || spec->status != CAV_OK) return;
  cav_spec_geom *at = CAV_SPEC_PUSH(spec, &spec->geom);
  if (!at) return;
  *at = g;
  spec->body.at[body].ngeom++;
}

// --- joints ---

static cav_spec_joint *push_joint(reader *r, const cav_xml_node *node, const char *name, int body) {
  cav_spec *spec = r->spec;
  cav_spec_joint *j = CAV_SPEC_PUSH(spec, &spec->joint);
  if (!j) return NULL;
  cav_mjcf_default_joint(j);
  j->name = name;
  j->node = node;
  j->body = body;
  spec->body.at[body].njoint++;
  return j;
}

// name with an ending, as long as the spec lives
static const char *ending(reader *r, const char *name, const char *end) {
  char *text = cav_spec_keep_text(r->spec, strlen(name) + strlen(end) + 1);
  if (!text) return "";
  strcpy(text, name);
  strcat(text, end);
  return text;
}

// two slides across the normal and a hinge about it, named as MuJoCo does
static void read_planar(reader *r, const cav_xml_node *node, const char *name, const double normal[3], int body) {
  static const char *const ends[] = {"_TX", "_TY", "_RZ"};
  double z[3], x[3], y[3], toward[3] = {0, 0, 0};
  copy3(z, normal);
  normalise3(z);
  int least = fabs(z[0]) <= fabs(z[1]) ? 0 : 1;
  if (fabs(z[2]) < fabs(z[least])) least = 2;
  toward[least] = 1;
  axpy3(x, toward, -z[least], z);
  normalise3(x);
  cross3(y, z, x);
  const double *axes[] = {x, y, z};
  for (int k = 0; k < 3; k++) {
    cav_spec_joint *j = push_joint(r, node, ending(r, name, ends[k]), body);
    if (!j) return;
    j->type = k < 2 ? CAV_JOINT_SLIDE : CAV_JOINT_HINGE;
    copy3(j->axis, axes[k]);
  }
}

// a number of a limit, which may be infinite; 0 where there is none
static double limit_of(cav_spec *spec, const cav_xml_node *node, const char *name) {
  const char *text = node ? cav_xml_text(node, name, "0") : "0";
  char *end;
  double value = strtod(text, &end);
  while (*end == ' ' || *end == '\t' || *end == '\n' || *end == '\r') end++;
  if (end == text || *end || isnan(value))
    cav_spec_fail(spec, node, name, "expected a number, or inf for none, got '%.40s'", text);
  return value;
}

// a motor as strong as the limit says
static void push_motor(cav_spec *spec, const cav_xml_node *node, const char *name, double effort) {
  if (!(effort > 0)) return;
  cav_spec_actuator *a = CAV_SPEC_PUSH(spec, &spec->actuator);
  if (!a) return;
  *a = (cav_spec_actuator){.name = name,
                           .node = node,
                           .target_kind = "joint",
                           .target = name,
                           .ctrllimited = isinf(effort) ? CAV_LIMITED_NO : CAV_LIMITED_YES,
                           .forcelimited = CAV_LIMITED_NO,
                           .ctrlrange = {isinf(effort) ? 0 : -effort, isinf(effort) ? 0 : effort},
                           .gear = {1},
                           .gainprm = {1}};
}

// the joint of that name; NULL: there is none
static const cav_xml_node *named_joint(const cav_xml_node *robot, const char *name) {
  const cav_xml_node *c = cav_xml_child(robot, &joint);
  while (c && strcmp(cav_xml_text(c, "name", ""), name)) c = cav_xml_next(c);
  return c;
}

// whether a joint follows another one of the file
static int follows(const cav_xml_node *node) {
  const cav_xml_node *m = cav_xml_child(node, &mimic);
  return m && named_joint(node->parent, cav_xml_text(m, "joint", "")) != NULL;
}

// limits, damping and friction of a hinge or slide; an effort limit becomes a motor
static void read_motion(reader *r, const cav_xml_node *node, int type, cav_spec_joint *j) {
  cav_spec *spec = r->spec;
  const cav_xml_node *l = cav_xml_child(node, &limit), *d = cav_xml_child(node, &dynamics);
  j->limited = CAV_LIMITED_NO;
  if (d) j->damping = cav_xml_real(d, "damping", 0);
  if (d) j->frictionloss = cav_xml_real(d, "friction", 0);
  double effort = limit_of(spec, l, "effort"), speed = limit_of(spec, l, "velocity");
  if (!(effort > 0) && !follows(node))
    cav_spec_leave(spec, node, NULL, "no effort limit above 0: the joint has no actuator; give <limit effort> for one");
  if (!l || spec->status != CAV_OK) return;
  double low = limit_of(spec, l, "lower"), high = limit_of(spec, l, "upper");
  int bounded = !isinf(low) && !isinf(high);
  j->range[0] = bounded ? low : 0;
  j->range[1] = bounded ? high : 0;
  if (type != CONTINUOUS && bounded && low < high) j->limited = CAV_LIMITED_YES;
  if (type != CONTINUOUS && low > high) cav_spec_leave(spec, l, "upper", "below the lower limit: no limit holds");
  if (type != CONTINUOUS && isinf(low) != isinf(high))
    cav_spec_leave(spec, l, NULL, "a limit on one side alone is left aside; give both");
  j->speed = isinf(speed) ? 0 : fmax(speed, 0);
  r->velocities += j->speed > 0;
  if (!follows(node)) push_motor(spec, node, j->name, effort);
}

static int motion_of(const part *p) { return p->held ? FIXED : cav_xml_word(p->joint, "type", FIXED); }

// a joint that follows another: q = multiplier q_other + offset, as a joint equality with MJCF's softness. Where
// robots are reduced joints become fixed and their <mimic> stays: a joint that is fixed or held follows nothing, and who
// follows it is held at its offset
static void read_mimic(reader *r, const cav_xml_node *node, const char *name) {
  cav_spec *spec = r->spec;
  const cav_xml_node *other = named_joint(node->parent->parent, cav_xml_text(node, "joint", ""));
  if (!other) {
    cav_spec_warn(spec, node, "joint", "no joint is named '%.60s': follows nothing", cav_xml_text(node, "joint", ""));
    return;
  }
  int held = motion_of(&r->parts.at[named_link(r, other, &child)]) == FIXED;
  cav_spec_joint soft;
  cav_mjcf_default_joint(&soft);
  cav_spec_equality *e = CAV_SPEC_PUSH(spec, &spec->equality);
  if (!e) return;
  *e = (cav_spec_equality){
      .name = "", .node = node, .type = CAV_EQUALITY_JOINT, .active = 1, .torquescale = 1, .softness = soft.limit};
  e->object[0] = name;
  e->object[1] = held ? NULL : cav_xml_text(node, "joint", "");
  e->polycoef[0] = cav_xml_real(node, "offset", 0);
  e->polycoef[1] = held ? 0 : cav_xml_real(node, "multiplier", 1);
}

static void read_joint(reader *r, const part *p, int body) {
  const cav_xml_node *node = p->joint;
  int type = motion_of(p);
  const char *name = cav_xml_text(node, "name", "");
  const cav_xml_node *a = cav_xml_child(node, &axis), *m = cav_xml_child(node, &mimic);
  double direction[3] = {1, 0, 0};
  if (a) cav_xml_reals(a, "xyz", direction, 3);
  if (m && type != FIXED) read_mimic(r, m, name);
  const cav_xml_node *s = cav_xml_child(node, &safety);
  if (s) cav_spec_leave(r->spec, s, NULL, "left aside: soft limits of a controller are not part of the dynamics");
  if (type == FIXED) return;
  if (!(norm3(direction) > 1e-14))
    cav_spec_fail(r->spec, a, "xyz", "expected a direction, got %g %g %g", direction[0], direction[1], direction[2]);
  if (type == PLANAR) {
    read_planar(r, node, name, direction, body);
    return;
  }
  cav_spec_joint *j = push_joint(r, node, name, body);
  if (!j) return;
  j->type = type == FLOATING    ? CAV_JOINT_FREE
            : type == SPHERICAL ? CAV_JOINT_BALL
            : type == PRISMATIC ? CAV_JOINT_SLIDE
                                : CAV_JOINT_HINGE;
  copy3(j->axis, direction);
  if (type == FLOATING || type == SPHERICAL)
    j->limited = CAV_LIMITED_NO;
  else
    read_motion(r, node, type, j);
}

// --- bodies, depth first ---

// pose of a body's frame in the world, for what is fixed to it
static void world_pose(const cav_spec *spec, int body, double pos[3], double quat[4]) {
  for (int i = body; i > 0; i = spec->body.at[i].parent) {
    const cav_spec_body *b = &spec->body.at[i];
    quat_rotate(pos, b->quat, pos);
    add3(pos, pos, b->pos);
    quat_mul(quat, b->quat, quat);
  }
}

static int moves(const cav_spec *spec, int body) {
  for (; body > 0; body = spec->body.at[body].parent) {
    if (spec->body.at[body].njoint) return 1;
  }
  return 0;
}

// body of a link; a floating joint on what stands in the world hangs from the world itself
static int push_body(reader *r, const part *p, int up) {
  cav_spec *spec = r->spec;
  cav_spec_body *b = CAV_SPEC_PUSH(spec, &spec->body);
  if (!b) return -1;
  *b = (cav_spec_body){.name = p->name, .node = p->node, .parent = up, .quat = {1, 0, 0, 0}};
  b->joint = spec->joint.n;
  b->geom = spec->geom.n;
  int body = spec->body.n - 1, floats = p->joint && cav_xml_word(p->joint, "type", FIXED) == FLOATING;
  if (p->joint) read_origin(p->joint, b->pos, b->quat);
  if (floats && !moves(spec, up)) {
    world_pose(spec, up, b->pos, b->quat);
    b->parent = 0;
  }
  if (p->joint) {
    read_joint(r, p, body);
  } else if (spec->load.floating) {
    cav_spec_joint *j = push_joint(r, p->node, "root", body);
    if (j) j->type = CAV_JOINT_FREE, j->limited = CAV_LIMITED_NO;
  }
  return body;
}

static void read_link(reader *r, int index, int up, int depth) {
  cav_spec *spec = r->spec;
  const part *p = &r->parts.at[index];
  if (depth > DEPTH_MAX) {
    cav_spec_fail(spec, p->node, NULL, "more than %d links one after another", DEPTH_MAX);
    return;
  }
  // a root of the name world is the world
  int body = !p->joint && !strcmp(p->name, "world") ? 0 : push_body(r, p, up);
  if (body < 0 || spec->status != CAV_OK) return;
  const cav_xml_node *i = cav_xml_child(p->node, &inertial);
  if (i && body) read_inertial(r, i, &spec->body.at[body]);
  for (const cav_xml_node *c = p->node->child; c && spec->status == CAV_OK; c = c->next) {
    if (c->rule == &collision || (c->rule == &visual && spec->load.visual)) read_geom(r, c, body);
  }
  if (!i && spec->body.at[body].ngeom && moves(spec, body))
    cav_spec_leave(spec, p->node, NULL,
                   "no inertial element: weighs what its collision shapes weigh at 1000 kg/m^3; give it one");
  for (int k = p->first; k >= 0 && spec->status == CAV_OK; k = r->parts.at[k].next) read_link(r, k, body, depth + 1);
}

// --- what is left aside ---

// why something of a name is left aside
static const char *keep_name(cav_spec *spec, const char *what, const char *name) {
  size_t room = strlen(what) + strlen(name) + 40;
  char *text = cav_spec_keep_text(spec, room);
  if (text) snprintf(text, room, "left aside: %s '%s' not known", what, name);
  return text ? text : "";
}

// elements and attributes that no table knows
static void warn_strangers(cav_spec *spec, const cav_xml_node *node) {
  for (int i = 0; i < node->nvalue; i++) {
    if (node->value[i].rule->min == CAV_XML_STRANGE)
      cav_spec_leave(spec, node, node->value[i].rule->name, keep_name(spec, "attribute", node->value[i].rule->name));
  }
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (c->rule->flags & CAV_XML_STRANGE)
      cav_spec_leave(spec, c, NULL, keep_name(spec, "element inside", node->rule->name));
    else
      warn_strangers(spec, c);
  }
}

static int compare_names(const void *a, const void *b) {
  const cav_spec_geom *x = *(cav_spec_geom *const *)a, *y = *(cav_spec_geom *const *)b;
  int order = strcmp(x->name, y->name);
  return order ? order : (x > y) - (x < y);
}

// shapes need no names of their own in a URDF: of several with one name the first keeps it
static void settle_names(cav_spec *spec) {
  cav_spec_geom **sorted = malloc(sizeof *sorted * (size_t)(spec->geom.n + 1));
  if (!sorted) {
    cav_spec_no_memory(spec);
    return;
  }
  for (int i = 0; i < spec->geom.n; i++) sorted[i] = &spec->geom.at[i];
  qsort(sorted, (size_t)spec->geom.n, sizeof *sorted, compare_names);
  for (int i = 1, first = 0; i < spec->geom.n; i++) {
    if (strcmp(sorted[i]->name, sorted[first]->name) || !*sorted[i]->name)
      first = i;
    else
      sorted[i]->name = "";
  }
  free(sorted);
}

// more links than are compiled, found before anything is quadratic in them
static int is_small(cav_spec *spec, const cav_xml_node *root) {
  int links = 0;
  for (const cav_xml_node *c = cav_xml_child(root, &robot_link); c; c = cav_xml_next(c)) links++;
  if (links > CAV_SPEC_OBJECTS)
    cav_spec_fail(spec, root, NULL, "%d links; at most %d are read", links, CAV_SPEC_OBJECTS);
  return spec->status == CAV_OK;
}

void cav_urdf_read(cav_spec *spec, const cav_xml *xml) {
  const cav_xml_node *root = cav_xml_root(xml);
  reader r = {.spec = spec};
  spec->name = cav_xml_text(root, "name", "");
  cav_mjcf_first_options(spec);
  spec->compiler.degree = 0;
  spec->compiler.fuse = 1;
  spec->compiler.strip = 1;
  spec->compiler.repair = 1;
  memcpy(spec->compiler.euler, "XYZ", 3);
  for (const cav_xml_node *c = cav_xml_child(root, &cav_mjcf_extension); c; c = cav_xml_next(c))
    cav_mjcf_read_options(spec, c);
  cav_spec_body *world = CAV_SPEC_PUSH(spec, &spec->body);
  if (world)
    *world = (cav_spec_body){
        .name = "world", .node = root, .parent = -1, .quat = {1, 0, 0, 0}, .inertia.quat = {1, 0, 0, 0}};
  cav_scene_objects(spec);
  if (is_small(spec, root)) collect_links(&r, root);
  if (spec->status == CAV_OK) collect_joints(&r, root);
  int first = spec->status == CAV_OK ? find_root(&r, root) : -1;
  if (first >= 0) mark_held(&r, first, 0);
  if (first >= 0) read_link(&r, first, 0, 0);
  if (first >= 0 && spec->status == CAV_OK && spec->body.n - (strcmp(r.parts.at[first].name, "world") != 0) < r.parts.n)
    cav_spec_fail(spec, root, NULL, "some links carry each other in a circle, apart from the root; connect them to it");
  if (spec->status == CAV_OK) settle_names(spec);
  if (spec->status == CAV_OK) cav_srdf_read(spec);
  cav_scene_bodies(spec);
  if (r.velocities && spec->status == CAV_OK)
    cav_spec_warn(spec, root, NULL, "told in certificates, but not obeyed: the velocity limits of %d joints",
                  r.velocities);
  if (spec->status == CAV_OK) warn_strangers(spec, root);
  cav_spec_warn_of_prose(spec);
  cav_spec_settle_notes(spec);
  free(r.parts.at);
}
