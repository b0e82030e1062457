/// Reads an MJCF tree into a spec: defaults and classes applied (defaults.c), angles in radians, poses relative to
/// bodies.
///
/// Source: the MJCF reference of MuJoCo 3.14, and that of 2.2.2 for what has gone since. What would change the dynamics
/// and is not offered is an error that names all of it in one run (flexible bodies, plugins that act, composite
/// bodies); what only changes how MuJoCo itself steps or senses is a warning (integrator, cone, noslip). Names are
/// resolved in compile.c.

#include <stdlib.h>

#include "expand.h"
#include "math3.h"
#include "mjcf.h"

// pose of a frame element in its body, and the class its content takes
typedef struct place {
  int body, part;
  double pos[3], quat[4];
  const char *childclass;
} place;

// what stands in a frame element into the body's coordinates
static void move_to(const place *at, double pos[3], double quat[4]) {
  double turned[3];
  quat_rotate(turned, at->quat, pos);
  add3(pos, at->pos, turned);
  if (quat) quat_mul(quat, at->quat, quat);
}

// --- bodies and what they hold ---

static double angle_unit(const cav_spec *spec, const cav_xml_node *node, cav_joint_type type) {
  return cav_compiler_of(spec, node)->degree && (type == CAV_JOINT_HINGE || type == CAV_JOINT_BALL) ? M_PI / 180 : 1;
}

static void read_joint(cav_mjcf_reader *r, const cav_xml_node *node, const place *at) {
  cav_spec *spec = r->spec;
  cav_spec_joint *j = CAV_SPEC_PUSH(spec, &spec->joint);
  if (!j) return;
  if (cav_xml_is(node, "freejoint")) {
    // free of all defaults, by definition
    *j = cav_mjcf_first_class().joint;
    j->type = CAV_JOINT_FREE;
    j->limited = CAV_LIMITED_NO;
    int align = cav_xml_word(node, "align", CAV_LIMITED_AUTO);
    if (align == CAV_LIMITED_YES || (align == CAV_LIMITED_AUTO && cav_compiler_of(spec, node)->align_free))
      cav_spec_leave(spec, node, "align", "left aside: positions are those of the body's frame, not of its inertia");
  } else {
    *j = cav_mjcf_class_of(r, node, at->childclass)->joint;
    cav_mjcf_joint_values(spec, node, j);
  }
  j->name = cav_xml_text(node, "name", "");
  j->node = node;
  j->body = at->body;
  move_to(at, j->pos, NULL);
  quat_rotate(j->axis, at->quat, j->axis);
  double unit = angle_unit(spec, node, j->type);
  j->range[0] *= unit;
  j->range[1] *= unit;
  j->ref *= unit;
  j->springref *= unit;
  j->twist[0] *= unit;
  j->twist[1] *= unit;
  j->swing *= unit;
  spec->body.at[at->body].njoint++;
}

// colour: of the geom if it is not the default one, else of its material
static void read_colour(cav_mjcf_reader *r, cav_spec_geom *g) {
  if (!g->material || !*g->material) return;
  int i = cav_name_find(r->materials.at, r->materials.n, sizeof(cav_mjcf_material), g->material);
  if (i < 0) {
    cav_spec_fail(r->spec, g->node, "material", "no material '%.60s'; define it or correct the name", g->material);
    return;
  }
  const double plain[4] = {0.5, 0.5, 0.5, 1};
  if (!memcmp(g->rgba, plain, sizeof plain)) memcpy(g->rgba, r->materials.at[i].rgba, sizeof g->rgba);
}

// whether a pair, a distance, a sensor or a tendon names that geom
static int is_referred(const cav_xml_node *node, const char *name) {
  static const char *const attributes[] = {"geom", "geom1", "geom2", "objname", "refname"};
  for (int i = 0; i < node->nvalue; i++) {
    if (strcmp(node->value[i].text, name)) continue;
    for (size_t k = 0; k < sizeof attributes / sizeof *attributes; k++)
      if (!strcmp(node->value[i].rule->name, attributes[k])) return 1;
  }
  for (const cav_xml_node *c = node->child; c; c = c->next)
    if (is_referred(c, name)) return 1;
  return 0;
}

// the mesh or height field that a geom names; 0 where it is left out because it is only seen
static int find_asset(cav_mjcf_reader *r, cav_spec_geom *g) {
  cav_spec *spec = r->spec;
  int is_mesh = g->type == CAV_GEOM_MESH, is_field = g->type == CAV_GEOM_HFIELD;
  const char *kind = is_field ? "hfield" : "mesh", *name = is_field ? g->hfield : g->mesh;
  int fitted = g->mesh && !is_mesh && !is_field;
  if (g->hfield && !is_field)
    cav_spec_fail(spec, g->node, "hfield", "is for geoms of type hfield; write type=\"hfield\"");
  if (!is_mesh && !is_field && !fitted) return 1;
  if (!name) {
    cav_spec_fail(spec, g->node, kind, "is missing; name the asset");
    return 0;
  }
  g->asset = !is_field ? cav_name_find(spec->mesh.at, spec->mesh.n, sizeof *spec->mesh.at, name)
                       : cav_name_find(spec->hfield.at, spec->hfield.n, sizeof *spec->hfield.at, name);
  if (g->asset < 0 && !is_field)
    cav_spec_unknown(spec, g->node, kind, kind, name, spec->mesh.at, spec->mesh.n, sizeof *spec->mesh.at);
  if (g->asset < 0 && is_field)
    cav_spec_unknown(spec, g->node, kind, kind, name, spec->hfield.at, spec->hfield.n, sizeof *spec->hfield.at);
  g->weighs = cav_geom_weighs(spec, g);
  if (g->contype || g->conaffinity || g->weighs || spec->load.visual) return g->asset >= 0;
  if (*g->name && is_referred(cav_xml_root(spec->xml), g->name)) return g->asset >= 0;
  cav_spec_leave(spec, g->node, NULL, "left out: it can neither touch nor weigh, and is only seen");
  return 0;
}

// a shape that a plugin gives has none of its own
static void check_plugin(cav_spec *spec, const cav_xml_node *node, const char *text) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, "plugin")) cav_spec_lack(spec, c, NULL, text);
  }
}

static void read_geom(cav_mjcf_reader *r, const cav_xml_node *node, const place *at) {
  cav_spec *spec = r->spec;
  check_plugin(spec, node, "geoms whose shape a plugin gives are not supported; use a mesh");
  cav_spec_geom *g = CAV_SPEC_PUSH(spec, &spec->geom);
  if (!g) return;
  *g = cav_mjcf_class_of(r, node, at->childclass)->geom;
  cav_mjcf_geom_values(spec, node, g);
  g->name = cav_xml_text(node, "name", "");
  g->node = node;
  g->body = at->body;
  g->number = node->number ? node->number : ++spec->body.at[at->body].geoms;
  if (!find_asset(r, g)) {
    spec->geom.n--;
    return;
  }
  if (g->has_fromto) {
    int thick = g->type == CAV_GEOM_BOX || g->type == CAV_GEOM_ELLIPSOID;
    if (!thick && g->type != CAV_GEOM_CAPSULE && g->type != CAV_GEOM_CYLINDER)
      cav_spec_fail(spec, node, "fromto", "only for capsule, cylinder, box and ellipsoid; give pos and size");
    double half = cav_pose_of_fromto(g->fromto, g->pos, g->quat);
    if (thick) g->size[1] = g->size[0];
    g->size[thick ? 2 : 1] = half;
    if (half < 1e-14) cav_spec_fail(spec, node, "fromto", "the two points are the same; set them apart");
  }
  move_to(at, g->pos, g->quat);
  read_colour(r, g);
  spec->body.at[at->body].ngeom++;
}

static void read_site(cav_mjcf_reader *r, const cav_xml_node *node, const place *at) {
  cav_spec_site *s = CAV_SPEC_PUSH(r->spec, &r->spec->site);
  if (!s) return;
  *s = cav_mjcf_class_of(r, node, at->childclass)->site;
  cav_mjcf_site_values(r->spec, node, s);
  s->name = cav_xml_text(node, "name", "");
  s->node = node;
  s->body = at->body;
  if (s->type < CAV_GEOM_SPHERE || s->type > CAV_GEOM_BOX)
    cav_spec_fail(r->spec, node, "type", "expected sphere, capsule, ellipsoid, cylinder or box");
  if (s->has_fromto) {
    int thick = s->type == CAV_GEOM_BOX || s->type == CAV_GEOM_ELLIPSOID;
    if (thick) s->size[1] = s->size[0];
    s->size[thick ? 2 : 1] = cav_pose_of_fromto(s->fromto, s->pos, s->quat);
  }
  move_to(at, s->pos, s->quat);
}

// frame: the pose of the frame elements around it, NULL without
static void read_inertial(cav_mjcf_reader *r, const cav_xml_node *node, int body, const place *frame) {
  cav_spec *spec = r->spec;
  cav_spec_body *b = &spec->body.at[body];
  b->has_inertial = 1;
  b->inertia.quat[0] = 1;
  cav_xml_reals(node, "pos", b->inertia.com, 3);
  cav_read_orientation(spec, node, b->inertia.quat);
  read_real(node, "mass", &b->inertia.mass);
  if (b->inertia.mass < 0) cav_spec_fail(spec, node, "mass", "expected a mass >= 0, got %g", b->inertia.mass);
  cav_xml_reals(node, "diaginertia", b->inertia.moment, 3);
  b->has_full = cav_xml_reals(node, "fullinertia", b->full, 6) == 6;
  if (b->has_full && cav_xml_get(node, "diaginertia"))
    cav_spec_fail(spec, node, "fullinertia", "diaginertia gives the inertia already; remove one of them");
  static const char *const ways[] = {"quat", "axisangle", "xyaxes", "zaxis", "euler"};
  for (int i = 0; i < 5 && b->has_full; i++) {
    if (cav_xml_get(node, ways[i]))
      cav_spec_fail(spec, node, ways[i], "fullinertia gives the orientation already; remove one of them");
  }
  if (!frame) return;
  move_to(frame, b->inertia.com, b->has_full ? NULL : b->inertia.quat);
  if (!b->has_full) return;
  double R[9];
  quat_matrix(R, frame->quat);
  symmetric_rotate(b->full, R, b->full);
}

// frame element: its pose in the body, on top of the frames around it
static place inner_place(cav_mjcf_reader *r, const cav_xml_node *node, const place *outer) {
  place at = {.body = outer->body, .part = node->part, .quat = {1, 0, 0, 0}};
  // classes do not reach into a file that is attached
  const char *class = node->part == outer->part ? outer->childclass : NULL;
  cav_xml_reals(node, "pos", at.pos, 3);
  cav_read_orientation(r->spec, node, at.quat);
  move_to(outer, at.pos, at.quat);
  cav_mjcf_check_childclass(r, node);
  at.childclass = cav_xml_text(node, "childclass", class);
  return at;
}

// all that moves with a body, frames included
static void read_objects(cav_mjcf_reader *r, const cav_xml_node *node, const place *at) {
  for (const cav_xml_node *c = node->child; c && r->spec->status == CAV_OK; c = c->next) {
    if (cav_xml_is(c, "joint") || cav_xml_is(c, "freejoint")) read_joint(r, c, at);
    if (cav_xml_is(c, "geom")) read_geom(r, c, at);
    if (cav_xml_is(c, "site")) read_site(r, c, at);
    if (cav_xml_is(c, "composite"))
      cav_spec_lack(r->spec, c, NULL, "composite bodies are not supported; write the bodies out");
    if (cav_xml_is(c, "flexcomp")) cav_spec_lack(r->spec, c, NULL, "flexible bodies are not supported; remove them");
    if (cav_xml_is(c, "plugin")) cav_spec_lack(r->spec, c, NULL, "plugins that act on bodies are not supported");
    if (cav_xml_is(c, "frame")) {
      place inner = inner_place(r, c, at);
      for (const cav_xml_node *i = c->child; i && at->body > 0; i = i->next) {
        if (cav_xml_is(i, "inertial")) read_inertial(r, i, at->body, &inner);
      }
      read_objects(r, c, &inner);
    }
  }
}

// the bodies inside a body, each with all that is in it before the next
static void read_bodies(cav_mjcf_reader *r, const cav_xml_node *node, const place *at) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c && spec->status == CAV_OK; c = c->next) {
    if (cav_xml_is(c, "frame")) {
      place inner = inner_place(r, c, at);
      read_bodies(r, c, &inner);
    }
    if (!cav_xml_is(c, "body")) continue;
    cav_spec_body *b = CAV_SPEC_PUSH(spec, &spec->body);
    if (!b) return;
    *b = (cav_spec_body){.name = cav_xml_text(c, "name", ""), .node = c, .parent = at->body, .quat = {1, 0, 0, 0}};
    b->joint = spec->joint.n;
    b->geom = spec->geom.n;
    cav_xml_reals(c, "pos", b->pos, 3);
    cav_read_orientation(spec, c, b->quat);
    move_to(at, b->pos, b->quat);
    cav_mjcf_check_childclass(r, c);
    read_real(c, "gravcomp", &b->gravcomp);
    if (cav_xml_bool(c, "mocap", 0)) cav_spec_leave(spec, c, "mocap", "left aside: the body stays where it is");
    place in = {.body = spec->body.n - 1, .part = c->part, .quat = {1, 0, 0, 0}};
    in.childclass = cav_xml_text(c, "childclass", at->childclass);
    for (const cav_xml_node *i = c->child; i; i = i->next) {
      if (cav_xml_is(i, "inertial")) read_inertial(r, i, in.body, NULL);
    }
    read_objects(r, c, &in);
    read_bodies(r, c, &in);
  }
}

// a file of materials, say, that others include
static void start_empty_world(cav_spec *spec, const cav_xml_node *root) {
  cav_spec_body *b = CAV_SPEC_PUSH(spec, &spec->body);
  if (!b) return;
  *b = (cav_spec_body){.name = "world", .node = root, .parent = -1, .quat = {1, 0, 0, 0}, .inertia.quat = {1, 0, 0, 0}};
  cav_spec_warn(spec, root, NULL, "no worldbody: the model is empty");
}

// the world's own objects come before those of all bodies, in however many sections they are
static void read_world(cav_mjcf_reader *r, const cav_xml_node *root) {
  cav_spec *spec = r->spec;
  for (int pass = 0; pass < 2; pass++) {
    for (const cav_xml_node *c = root->child; c && spec->status == CAV_OK; c = c->next) {
      if (!cav_xml_is(c, "worldbody")) continue;
      if (!spec->body.n) {
        cav_spec_body *b = CAV_SPEC_PUSH(spec, &spec->body);
        if (!b) return;
        *b = (cav_spec_body){
            .name = "world", .node = c, .parent = -1, .quat = {1, 0, 0, 0}, .inertia.quat = {1, 0, 0, 0}};
      }
      cav_mjcf_check_childclass(r, c);
      place at = {.quat = {1, 0, 0, 0}, .childclass = cav_xml_text(c, "childclass", NULL)};
      if (pass == 0)
        read_objects(r, c, &at);
      else
        read_bodies(r, c, &at);
    }
    if (pass == 0 && !spec->body.n) start_empty_world(spec, root);
    if (pass == 0) cav_scene_objects(spec);
  }
  cav_scene_bodies(spec);
}

// --- the scene ---

// reads the scene by MJCF's own defaults, whatever the model's file says
static void read_scene(cav_spec *spec, void (*read)(cav_mjcf_reader *, const cav_xml_node *, const place *)) {
  if (!spec->scene || spec->status != CAV_OK) return;
  cav_mjcf_reader r = {.spec = spec};
  cav_spec_compiler compiler = spec->compiler;
  spec->compiler.degree = 1;
  memcpy(spec->compiler.euler, "xyz", 3);
  cav_mjcf_class *first = CAV_SPEC_PUSH(spec, &r.classes);
  if (first) {
    *first = cav_mjcf_first_class();
    read(&r, spec->scene, &(place){.quat = {1, 0, 0, 0}});
  }
  spec->compiler = compiler;
  free(r.classes.at);
}

void cav_scene_objects(cav_spec *spec) { read_scene(spec, read_objects); }

void cav_scene_bodies(cav_spec *spec) {
  spec->own_bodies = spec->body.n;
  read_scene(spec, read_bodies);
}

// --- the file ---

void cav_mjcf_default_joint(cav_spec_joint *joint) { *joint = cav_mjcf_first_class().joint; }

void cav_mjcf_default_geom(cav_spec_geom *geom) { *geom = cav_mjcf_first_class().geom; }

void cav_mjcf_first_options(cav_spec *spec) {
  spec->compiler = (cav_spec_compiler){.degree = 1,
                                       .autolimits = 2,
                                       .from_geoms = 2,
                                       .group_range = {0, 5},
                                       .total_mass = -1,
                                       .euler = "xyz",
                                       .mesh_folder = ""};
  spec->option = (cav_spec_option){.timestep = 0.002,
                                   .gravity = {0, 0, -9.81},
                                   .magnetic = {0, -0.5, 0},
                                   .impratio = 1,
                                   .constraint = 1,
                                   .equality = 1,
                                   .frictionloss = 1,
                                   .limit = 1,
                                   .contact = 1,
                                   .spring = 1,
                                   .damper = 1,
                                   .o_friction = {1, 1, 0.005, 0.0001, 0.0001},
                                   .o_softness = {{0.02, 1}, {0.9, 0.95, 0.001, 0.5, 2}},
                                   .weight = 1,
                                   .clamp = 1,
                                   .filter_parent = 1,
                                   .refsafe = 1};
}

void cav_mjcf_read_options(cav_spec *spec, const cav_xml_node *node) {
  cav_mjcf_reader r = {.spec = spec};
  read_sections(&r, node, "compiler", cav_mjcf_read_compiler);
  read_sections(&r, node, "option", cav_mjcf_read_option);
}

void cav_mjcf_read(cav_spec *spec, cav_xml *xml) {
  const cav_xml_node *root = cav_xml_root(xml);
  cav_mjcf_reader r = {.spec = spec};
  spec->name = cav_xml_text(root, "model", "");
  cav_mjcf_first_options(spec);
  cav_mjcf_class *main_class = CAV_SPEC_PUSH(spec, &r.classes);
  if (main_class) *main_class = cav_mjcf_first_class();

  // each section needs those before it, wherever they stand in the file
  cav_mjcf_read_options(spec, root);
  cav_expand(spec, xml);
  cav_mjcf_start_parts(&r);
  read_sections(&r, root, "default", cav_mjcf_read_defaults);
  read_sections(&r, root, "asset", cav_mjcf_read_assets);
  read_world(&r, root);
  cav_mjcf_read_sections(&r, root);
  cav_spec_warn_of_prose(spec);
  cav_spec_settle_notes(spec);
  free(r.classes.at);
  free(r.materials.at);
}
