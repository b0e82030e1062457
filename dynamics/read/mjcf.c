/// Reads an MJCF tree into a spec: defaults and classes applied, angles in radians, poses relative to bodies.
///
/// Source: the MJCF reference of MuJoCo 2.2.2, whose semantics and defaults hold, with extensions of later versions that
/// no 2.2.2 file can contain: the frame element, gravcomp, and limits that hold where only a range is given.
/// What would change the dynamics and is not offered is an error (meshes that collide or weigh, adhesion, composite
/// bodies); what only changes how MuJoCo itself steps is a warning (integrator, cone, noslip). Names are resolved in compile.c.

#include <stdlib.h>

#include "math3.h"
#include "spec.h"

// one class of defaults, complete: what its parents say is copied in
typedef struct defaults {
  const char *name;
  cav_spec_joint joint;
  cav_spec_geom geom;
  cav_spec_site site;
  cav_spec_pair pair;
  cav_spec_tendon tendon;
  cav_spec_equality equality;
  cav_spec_actuator actuator;
  double rgba[4];  // of a material
  double scale[3]; // of a mesh
} defaults;

typedef struct material {
  const char *name;
  double rgba[4];
} material;

typedef struct reader {
  cav_spec *spec;
  CAV_SPEC_LIST(defaults) classes;
  CAV_SPEC_LIST(material) materials;
} reader;

// pose of a frame element in its body, and the class its content takes
typedef struct place {
  int body;
  double pos[3], quat[4];
  const char *childclass;
} place;

// --- small readers: an attribute that is absent leaves the default ---

static int is(const cav_xml_node *node, const char *name) { return !strcmp(node->rule->name, name); }

static void read_real(const cav_xml_node *node, const char *name, double *out) {
  *out = cav_xml_real(node, name, *out);
}

static void read_int(const cav_xml_node *node, const char *name, int *out) { *out = cav_xml_int(node, name, *out); }

static void read_text(const cav_xml_node *node, const char *name, const char **out) {
  *out = cav_xml_text(node, name, *out);
}

static void read_limited(const cav_xml_node *node, const char *name, cav_limited *out) {
  *out = (cav_limited)cav_xml_word(node, name, (int)*out);
}

static void read_softness(const cav_xml_node *node, const char *solref, const char *solimp, cav_softness *out) {
  cav_xml_reals(node, solref, out->solref, 2);
  cav_xml_reals(node, solimp, out->solimp, 5);
}

// what stands in a frame element into the body's coordinates
static void move_to(const place *at, double pos[3], double quat[4]) {
  double turned[3];
  quat_rotate(turned, at->quat, pos);
  add3(pos, at->pos, turned);
  if (quat) quat_mul(quat, at->quat, quat);
}

// --- compiler and option ---

static void read_compiler(reader *r, const cav_xml_node *node) {
  cav_spec_compiler *c = &r->spec->compiler;
  c->degree = cav_xml_word(node, "angle", c->degree);
  c->autolimits = cav_xml_bool(node, "autolimits", c->autolimits);
  c->balance = cav_xml_bool(node, "balanceinertia", c->balance);
  c->from_geoms = cav_xml_word(node, "inertiafromgeom", c->from_geoms);
  read_real(node, "boundmass", &c->bound_mass);
  read_real(node, "boundinertia", &c->bound_inertia);
  read_real(node, "settotalmass", &c->total_mass);
  double range[2];
  if (cav_xml_reals(node, "inertiagrouprange", range, 2)) {
    c->group_range[0] = (int)range[0];
    c->group_range[1] = (int)range[1];
  }
  const char *sequence = cav_xml_text(node, "eulerseq", c->euler);
  if (strlen(sequence) != 3 || strspn(sequence, "xyzXYZ") != 3)
    cav_spec_fail(r->spec, node, "eulerseq", "expected three of xyzXYZ, got '%.20s'", sequence);
  else
    memcpy(c->euler, sequence, 3);
  if (c->bound_mass < 0) cav_spec_fail(r->spec, node, "boundmass", "expected a mass >= 0, got %g", c->bound_mass);
  if (c->bound_inertia < 0)
    cav_spec_fail(r->spec, node, "boundinertia", "expected an inertia >= 0, got %g", c->bound_inertia);
  if (cav_xml_word(node, "coordinate", 0) == 1)
    cav_spec_fail(r->spec, node, "coordinate", "global coordinates are not supported; write local ones");
  for (const cav_xml_node *i = node->child; i; i = i->next) {
    if (is(i, "lengthrange"))
      cav_spec_warn(r->spec, i, NULL, "left aside: lengths of muscles are found over the ranges of the joints");
  }
  c->fuse = cav_xml_bool(node, "fusestatic", c->fuse);
  c->exact_mesh = cav_xml_bool(node, "exactmeshinertia", c->exact_mesh);
  c->strip = cav_xml_bool(node, "strippath", c->strip);
  read_text(node, "assetdir", &c->mesh_folder);
  read_text(node, "meshdir", &c->mesh_folder);
  if (!cav_xml_bool(node, "discardvisual", 1)) r->spec->load.visual = 1;
}

static void read_flags(reader *r, const cav_xml_node *node) {
  cav_spec_option *o = &r->spec->option;
  const struct {
    const char *name;
    int *flag;
  } flags[] = {{"constraint", &o->constraint}, {"equality", &o->equality}, {"frictionloss", &o->frictionloss},
               {"limit", &o->limit},           {"contact", &o->contact},   {"passive", &o->passive},
               {"gravity", &o->weight},        {"clampctrl", &o->clamp},   {"filterparent", &o->filter_parent},
               {"refsafe", &o->refsafe}};
  for (size_t i = 0; i < sizeof flags / sizeof *flags; i++)
    *flags[i].flag = cav_xml_word(node, flags[i].name, *flags[i].flag);
  if (cav_xml_word(node, "override", 0))
    cav_spec_fail(r->spec, node, "override", "contact override is not supported; write the values into the geoms");
  if (!cav_xml_word(node, "actuation", 1))
    cav_spec_warn(r->spec, node, "actuation", "left aside: actuators stay available");
  if (cav_xml_word(node, "multiccd", 0))
    cav_spec_warn(r->spec, node, "multiccd", "left aside: contact points of a pair are found by its own routine");
}

static void read_option(reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  cav_spec_option *o = &spec->option;
  read_real(node, "timestep", &o->timestep);
  read_real(node, "impratio", &o->impratio);
  cav_xml_reals(node, "gravity", o->gravity, 3);
  cav_xml_reals(node, "magnetic", o->magnetic, 3);
  o->collision = (cav_collision)cav_xml_word(node, "collision", (int)o->collision);
  if (!(o->timestep > 0)) cav_spec_fail(spec, node, "timestep", "expected a time step > 0, got %g", o->timestep);
  if (!(o->impratio > 0)) cav_spec_fail(spec, node, "impratio", "expected a ratio > 0, got %g", o->impratio);
  read_real(node, "density", &o->density);
  read_real(node, "viscosity", &o->viscosity);
  cav_xml_reals(node, "wind", o->wind, 3);
  cav_check_not_negative(spec, node, "density", o->density);
  cav_check_not_negative(spec, node, "viscosity", o->viscosity);
  // what only MuJoCo's own step or solver does
  if (cav_xml_word(node, "integrator", 0))
    cav_spec_warn(spec, node, "integrator", "left aside: steps are semi-implicit (velocity first)");
  if (cav_xml_word(node, "cone", 0)) cav_spec_warn(spec, node, "cone", "left aside: friction cones are elliptic");
  if (cav_xml_int(node, "noslip_iterations", 0) > 0)
    cav_spec_warn(spec, node, "noslip_iterations", "left aside: friction is as soft as impratio says");
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (is(c, "flag")) read_flags(r, c);
  }
}

// --- defaults and materials ---

static void read_joint_values(cav_spec *spec, const cav_xml_node *node, cav_spec_joint *j) {
  j->type = (cav_joint_type)cav_xml_word(node, "type", (int)j->type);
  cav_xml_reals(node, "pos", j->pos, 3);
  cav_xml_reals(node, "axis", j->axis, 3);
  cav_xml_reals(node, "springdamper", j->springdamper, 2);
  cav_xml_reals(node, "range", j->range, 2);
  read_limited(node, "limited", &j->limited);
  if (cav_xml_reals(node, "twistrange", j->twist, 2)) j->has_twist = 1;
  if (cav_xml_get(node, "swingrange")) j->has_swing = 1;
  read_real(node, "swingrange", &j->swing);
  read_softness(node, "solreflimit", "solimplimit", &j->limit);
  read_softness(node, "solreffriction", "solimpfriction", &j->friction);
  read_real(node, "stiffness", &j->stiffness);
  read_real(node, "margin", &j->margin);
  read_real(node, "ref", &j->ref);
  read_real(node, "springref", &j->springref);
  read_real(node, "armature", &j->armature);
  read_real(node, "damping", &j->damping);
  read_real(node, "frictionloss", &j->frictionloss);
  (void)spec;
}

static void read_geom_values(cav_spec *spec, const cav_xml_node *node, cav_spec_geom *g) {
  g->type = cav_xml_word(node, "type", g->type);
  cav_xml_reals(node, "pos", g->pos, 3);
  cav_read_orientation(spec, node, g->quat);
  if (cav_xml_reals(node, "fromto", g->fromto, 6)) g->has_fromto = 1;
  cav_xml_reals(node, "size", g->size, 3);
  read_int(node, "contype", &g->contype);
  read_int(node, "conaffinity", &g->conaffinity);
  read_int(node, "condim", &g->condim);
  read_int(node, "priority", &g->priority);
  read_int(node, "group", &g->group);
  cav_xml_reals(node, "friction", g->friction, 3);
  read_real(node, "margin", &g->margin);
  read_real(node, "gap", &g->gap);
  read_real(node, "solmix", &g->solmix);
  read_real(node, "density", &g->density);
  read_softness(node, "solref", "solimp", &g->softness);
  g->fluid = cav_xml_word(node, "fluidshape", g->fluid);
  cav_xml_reals(node, "fluidcoef", g->fluidcoef, 5);
  if (cav_xml_get(node, "mass")) g->has_mass = 1;
  read_real(node, "mass", &g->mass);
  cav_xml_reals(node, "rgba", g->rgba, 4);
  read_text(node, "material", &g->material);
  read_text(node, "mesh", &g->mesh);
  read_text(node, "hfield", &g->hfield);
  if (cav_xml_bool(node, "shellinertia", 0))
    cav_spec_fail(spec, node, "shellinertia", "inertia of a shell is not supported; give the body an inertial element");
}

static void read_site_values(cav_spec *spec, const cav_xml_node *node, cav_spec_site *s) {
  cav_xml_reals(node, "pos", s->pos, 3);
  cav_read_orientation(spec, node, s->quat);
  if (cav_xml_reals(node, "fromto", s->fromto, 6)) s->has_fromto = 1;
  s->type = cav_xml_word(node, "type", s->type);
  cav_xml_reals(node, "size", s->size, 3);
}

static void read_pair_values(cav_spec *spec, const cav_xml_node *node, cav_spec_pair *p) {
  (void)spec;
  read_int(node, "condim", &p->condim);
  cav_xml_reals(node, "friction", p->friction, 5);
  read_softness(node, "solref", "solimp", &p->softness);
  read_real(node, "margin", &p->margin);
  read_real(node, "gap", &p->gap);
}

static void read_equality_values(cav_spec *spec, const cav_xml_node *node, cav_spec_equality *e) {
  (void)spec;
  e->active = cav_xml_bool(node, "active", e->active);
  read_softness(node, "solref", "solimp", &e->softness);
}

static void read_tendon_values(cav_spec *spec, const cav_xml_node *node, cav_spec_tendon *t) {
  (void)spec;
  read_limited(node, "limited", &t->limited);
  cav_xml_reals(node, "range", t->range, 2);
  read_softness(node, "solreflimit", "solimplimit", &t->limit);
  read_softness(node, "solreffriction", "solimpfriction", &t->friction);
  read_real(node, "margin", &t->margin);
  read_real(node, "stiffness", &t->stiffness);
  read_real(node, "damping", &t->damping);
  read_real(node, "frictionloss", &t->frictionloss);
  if (cav_xml_get(node, "springlength")) t->has_springlength = 1;
  read_real(node, "springlength", &t->springlength);
}

static const cav_softness soft = {{0.02, 1}, {0.9, 0.95, 0.001, 0.5, 2}};

// the defaults of MJCF itself
static defaults first_defaults(void) {
  defaults d = {.name = "main"};
  d.joint = (cav_spec_joint){
      .type = CAV_JOINT_HINGE, .axis = {0, 0, 1}, .limited = CAV_LIMITED_AUTO, .limit = soft, .friction = soft};
  d.geom = (cav_spec_geom){.type = CAV_GEOM_SPHERE,
                           .quat = {1, 0, 0, 0},
                           .contype = 1,
                           .conaffinity = 1,
                           .condim = 3,
                           .friction = {1, 0.005, 0.0001},
                           .solmix = 1,
                           .density = 1000,
                           .softness = soft,
                           .fluidcoef = {0.5, 0.25, 1.5, 1, 1},
                           .rgba = {0.5, 0.5, 0.5, 1}};
  d.site = (cav_spec_site){.quat = {1, 0, 0, 0}, .type = CAV_GEOM_SPHERE, .size = {0.005, 0.005, 0.005}};
  d.pair = (cav_spec_pair){.condim = 3, .friction = {1, 1, 0.005, 0.0001, 0.0001}, .softness = soft};
  d.tendon = (cav_spec_tendon){.limited = CAV_LIMITED_AUTO, .limit = soft, .friction = soft};
  d.equality = (cav_spec_equality){.active = 1, .softness = soft};
  d.actuator = (cav_spec_actuator){.ctrllimited = CAV_LIMITED_AUTO,
                                   .forcelimited = CAV_LIMITED_AUTO,
                                   .actlimited = CAV_LIMITED_AUTO,
                                   .gear = {1},
                                   .dynprm = {1},
                                   .gainprm = {1}};
  for (int i = 0; i < 4; i++) d.rgba[i] = 1;
  set3(d.scale, 1, 1, 1);
  return d;
}

static int find_class(const reader *r, const char *name) {
  if (!name) return 0;
  return cav_name_find(r->classes.at, r->classes.n, sizeof(defaults), name);
}

static void read_default_values(reader *r, const cav_xml_node *node, defaults *d) {
  cav_spec *spec = r->spec;
  const char *name = node->rule->name;
  if (!strcmp(name, "joint"))
    read_joint_values(spec, node, &d->joint);
  else if (!strcmp(name, "geom"))
    read_geom_values(spec, node, &d->geom);
  else if (!strcmp(name, "site"))
    read_site_values(spec, node, &d->site);
  else if (!strcmp(name, "pair"))
    read_pair_values(spec, node, &d->pair);
  else if (!strcmp(name, "equality"))
    read_equality_values(spec, node, &d->equality);
  else if (!strcmp(name, "tendon"))
    read_tendon_values(spec, node, &d->tendon);
  else if (!strcmp(name, "mesh"))
    cav_xml_reals(node, "scale", d->scale, 3);
  else if (!strcmp(name, "material"))
    cav_xml_reals(node, "rgba", d->rgba, 4);
  else if (cav_xml_accepts(node, "ctrlrange"))
    cav_actuator_read_values(node, &d->actuator);
}

// own values of a class first, then its subclasses, which start from them
static void read_class(reader *r, const cav_xml_node *node, int class) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (!is(c, "default")) read_default_values(r, c, &r->classes.at[class]);
  }
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (!is(c, "default") || r->spec->status != CAV_OK) continue;
    const char *name = cav_xml_text(c, "class", NULL);
    if (!name) {
      cav_spec_fail(r->spec, c, "class", "is missing; a class inside another needs a name");
      return;
    }
    if (find_class(r, name) >= 0) {
      cav_spec_fail(r->spec, c, "class", "'%.60s' is taken already; choose another name", name);
      return;
    }
    defaults *more = CAV_SPEC_PUSH(r->spec, &r->classes);
    if (!more) return;
    *more = r->classes.at[class];
    more->name = name;
    read_class(r, c, r->classes.n - 1);
  }
}

static void read_defaults(reader *r, const cav_xml_node *node) {
  const char *name = cav_xml_text(node, "class", NULL), **first = &r->classes.at[0].name;
  // the outermost class may have any name, but there is only one
  if (name && strcmp(*first, "main") && strcmp(*first, name))
    cav_spec_fail(r->spec, node, "class", "the outermost class is '%.60s' already; put this one inside it", *first);
  if (name) *first = name;
  read_class(r, node, 0);
}

// the class an object takes: its own, that of its bodies, or the outermost
static const defaults *class_of(reader *r, const cav_xml_node *node, const char *childclass) {
  const char *name = cav_xml_text(node, "class", childclass);
  int i = find_class(r, name);
  if (i >= 0) return &r->classes.at[i];
  const char *near = cav_xml_nearest(name, r->classes.at, r->classes.n, sizeof(defaults));
  cav_spec_fail(r->spec, node, "class", "no default class '%.60s'%s%.60s%s", name, near ? "; did you mean '" : "",
                near ? near : "; define it", near ? "'?" : "");
  return &r->classes.at[0];
}

static void check_childclass(reader *r, const cav_xml_node *node) {
  const char *name = cav_xml_text(node, "childclass", NULL);
  if (name && find_class(r, name) < 0)
    cav_spec_fail(r->spec, node, "childclass", "no default class '%.60s'; define it or correct the name", name);
}

static void read_assets(reader *r, const cav_xml_node *node) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (is(c, "mesh")) cav_read_mesh(r->spec, c, class_of(r, c, NULL)->scale);
    if (is(c, "hfield")) cav_read_hfield(r->spec, c);
    if (!is(c, "material")) continue;
    material *m = CAV_SPEC_PUSH(r->spec, &r->materials);
    if (!m) return;
    m->name = cav_xml_text(c, "name", "");
    memcpy(m->rgba, class_of(r, c, NULL)->rgba, sizeof m->rgba);
    cav_xml_reals(c, "rgba", m->rgba, 4);
  }
}

// --- bodies and what they hold ---

static double angle_unit(const cav_spec *spec, cav_joint_type type) {
  return spec->compiler.degree && (type == CAV_JOINT_HINGE || type == CAV_JOINT_BALL) ? M_PI / 180 : 1;
}

static void read_joint(reader *r, const cav_xml_node *node, const place *at) {
  cav_spec *spec = r->spec;
  cav_spec_joint *j = CAV_SPEC_PUSH(spec, &spec->joint);
  if (!j) return;
  if (is(node, "freejoint")) {
    // free of all defaults, by definition
    *j = first_defaults().joint;
    j->type = CAV_JOINT_FREE;
    j->limited = CAV_LIMITED_NO;
  } else {
    *j = class_of(r, node, at->childclass)->joint;
    read_joint_values(spec, node, j);
  }
  j->name = cav_xml_text(node, "name", "");
  j->node = node;
  j->body = at->body;
  move_to(at, j->pos, NULL);
  quat_rotate(j->axis, at->quat, j->axis);
  double unit = angle_unit(spec, j->type);
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
static void read_colour(reader *r, cav_spec_geom *g) {
  if (!g->material) return;
  int i = cav_name_find(r->materials.at, r->materials.n, sizeof(material), g->material);
  if (i < 0) {
    cav_spec_fail(r->spec, g->node, "material", "no material '%.60s'; define it or correct the name", g->material);
    return;
  }
  const double plain[4] = {0.5, 0.5, 0.5, 1};
  if (!memcmp(g->rgba, plain, sizeof plain)) memcpy(g->rgba, r->materials.at[i].rgba, sizeof g->rgba);
}

// the mesh or height field that a geom names; 0 where it is left out because it is only seen
static int find_asset(reader *r, cav_spec_geom *g) {
  cav_spec *spec = r->spec;
  int is_mesh = g->type == CAV_GEOM_MESH, is_field = g->type == CAV_GEOM_HFIELD;
  const char *kind = is_mesh ? "mesh" : "hfield", *name = is_mesh ? g->mesh : g->hfield;
  if (g->mesh && !is_mesh)
    cav_spec_fail(spec, g->node, "mesh", "fitting a shape to a mesh is not supported; write type=\"mesh\" or the size");
  if (g->hfield && !is_field)
    cav_spec_fail(spec, g->node, "hfield", "is for geoms of type hfield; write type=\"hfield\"");
  if (!is_mesh && !is_field) return 1;
  if (!name) {
    cav_spec_fail(spec, g->node, kind, "is missing; name the asset");
    return 0;
  }
  g->asset = is_mesh ? cav_name_find(spec->mesh.at, spec->mesh.n, sizeof *spec->mesh.at, name)
                     : cav_name_find(spec->hfield.at, spec->hfield.n, sizeof *spec->hfield.at, name);
  if (g->asset < 0 && is_mesh)
    cav_spec_unknown(spec, g->node, kind, kind, name, spec->mesh.at, spec->mesh.n, sizeof *spec->mesh.at);
  if (g->asset < 0 && is_field)
    cav_spec_unknown(spec, g->node, kind, kind, name, spec->hfield.at, spec->hfield.n, sizeof *spec->hfield.at);
  g->weighs = cav_geom_weighs(spec, g);
  if (g->contype || g->conaffinity || g->weighs || spec->load.visual) return g->asset >= 0;
  cav_spec_warn(spec, g->node, NULL, "left out: it can neither touch nor weigh, and is only seen");
  return 0;
}

static void read_geom(reader *r, const cav_xml_node *node, const place *at) {
  cav_spec *spec = r->spec;
  cav_spec_geom *g = CAV_SPEC_PUSH(spec, &spec->geom);
  if (!g) return;
  *g = class_of(r, node, at->childclass)->geom;
  read_geom_values(spec, node, g);
  g->name = cav_xml_text(node, "name", "");
  g->node = node;
  g->body = at->body;
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

static void read_site(reader *r, const cav_xml_node *node, const place *at) {
  cav_spec_site *s = CAV_SPEC_PUSH(r->spec, &r->spec->site);
  if (!s) return;
  *s = class_of(r, node, at->childclass)->site;
  read_site_values(r->spec, node, s);
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

static void read_inertial(reader *r, const cav_xml_node *node, int body) {
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
}

// frame element: its pose in the body, on top of the frames around it
static place inner_place(reader *r, const cav_xml_node *node, const place *outer) {
  place at = {.body = outer->body, .quat = {1, 0, 0, 0}};
  cav_xml_reals(node, "pos", at.pos, 3);
  cav_read_orientation(r->spec, node, at.quat);
  move_to(outer, at.pos, at.quat);
  check_childclass(r, node);
  at.childclass = cav_xml_text(node, "childclass", outer->childclass);
  return at;
}

// all that moves with a body, frames included
static void read_objects(reader *r, const cav_xml_node *node, const place *at) {
  for (const cav_xml_node *c = node->child; c && r->spec->status == CAV_OK; c = c->next) {
    if (is(c, "joint") || is(c, "freejoint")) read_joint(r, c, at);
    if (is(c, "geom")) read_geom(r, c, at);
    if (is(c, "site")) read_site(r, c, at);
    if (is(c, "composite")) cav_spec_fail(r->spec, c, NULL, "composite bodies are not supported; write the bodies out");
    if (is(c, "frame")) {
      place inner = inner_place(r, c, at);
      read_objects(r, c, &inner);
    }
  }
}

// the bodies inside a body, each with all that is in it before the next
static void read_bodies(reader *r, const cav_xml_node *node, const place *at) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c && spec->status == CAV_OK; c = c->next) {
    if (is(c, "frame")) {
      place inner = inner_place(r, c, at);
      read_bodies(r, c, &inner);
    }
    if (!is(c, "body")) continue;
    cav_spec_body *b = CAV_SPEC_PUSH(spec, &spec->body);
    if (!b) return;
    *b = (cav_spec_body){.name = cav_xml_text(c, "name", ""), .node = c, .parent = at->body, .quat = {1, 0, 0, 0}};
    b->joint = spec->joint.n;
    b->geom = spec->geom.n;
    cav_xml_reals(c, "pos", b->pos, 3);
    cav_read_orientation(spec, c, b->quat);
    move_to(at, b->pos, b->quat);
    check_childclass(r, c);
    read_real(c, "gravcomp", &b->gravcomp);
    if (cav_xml_bool(c, "mocap", 0)) cav_spec_warn(spec, c, "mocap", "left aside: the body stays where it is");
    place in = {spec->body.n - 1, {0, 0, 0}, {1, 0, 0, 0}, cav_xml_text(c, "childclass", at->childclass)};
    for (const cav_xml_node *i = c->child; i; i = i->next) {
      if (is(i, "inertial")) read_inertial(r, i, in.body);
    }
    read_objects(r, c, &in);
    read_bodies(r, c, &in);
  }
}

// the world's own objects come before those of all bodies, in however many sections they are
static void read_world(reader *r, const cav_xml_node *root) {
  cav_spec *spec = r->spec;
  for (int pass = 0; pass < 2; pass++) {
    for (const cav_xml_node *c = root->child; c && spec->status == CAV_OK; c = c->next) {
      if (!is(c, "worldbody")) continue;
      if (!spec->body.n) {
        cav_spec_body *b = CAV_SPEC_PUSH(spec, &spec->body);
        if (!b) return;
        *b = (cav_spec_body){
            .name = "world", .node = c, .parent = -1, .quat = {1, 0, 0, 0}, .inertia.quat = {1, 0, 0, 0}};
      }
      check_childclass(r, c);
      place at = {0, {0, 0, 0}, {1, 0, 0, 0}, cav_xml_text(c, "childclass", NULL)};
      if (pass == 0)
        read_objects(r, c, &at);
      else
        read_bodies(r, c, &at);
    }
    if (pass == 0 && spec->body.n) cav_scene_objects(spec);
  }
  cav_scene_bodies(spec);
}

// --- the scene ---

// reads the scene by MJCF's own defaults, whatever the model's file says
static void read_scene(cav_spec *spec, void (*read)(reader *, const cav_xml_node *, const place *)) {
  if (!spec->scene || spec->status != CAV_OK) return;
  reader r = {.spec = spec};
  cav_spec_compiler compiler = spec->compiler;
  spec->compiler.degree = 1;
  memcpy(spec->compiler.euler, "xyz", 3);
  defaults *first = CAV_SPEC_PUSH(spec, &r.classes);
  if (first) {
    *first = first_defaults();
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

// --- contact, equality, tendon, actuator, sensor, keyframe ---

static void read_contact(reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (is(c, "exclude")) {
      cav_spec_exclude *e = CAV_SPEC_PUSH(spec, &spec->exclude);
      if (!e) return;
      *e = (cav_spec_exclude){c, cav_xml_text(c, "body1", ""), cav_xml_text(c, "body2", "")};
    }
    if (is(c, "pair")) {
      cav_spec_pair *p = CAV_SPEC_PUSH(spec, &spec->pair);
      if (!p) return;
      *p = class_of(r, c, NULL)->pair;
      read_pair_values(spec, c, p);
      p->node = c;
      p->geom1 = cav_xml_text(c, "geom1", "");
      p->geom2 = cav_xml_text(c, "geom2", "");
    }
  }
}

// names of the two objects, and what each type says of them
static void read_equality_objects(const cav_xml_node *node, cav_spec_equality *e) {
  static const char *const names[][3] = {[CAV_EQUALITY_CONNECT] = {"connect", "body1", "body2"},
                                         [CAV_EQUALITY_WELD] = {"weld", "body1", "body2"},
                                         [CAV_EQUALITY_JOINT] = {"joint", "joint1", "joint2"},
                                         [CAV_EQUALITY_TENDON] = {"tendon", "tendon1", "tendon2"},
                                         [CAV_EQUALITY_DISTANCE] = {"distance", "geom1", "geom2"}};
  int type = 0;
  while (!is(node, names[type][0])) type++;
  e->type = (cav_equality_type)type;
  for (int k = 0; k < 2; k++) e->object[k] = cav_xml_text(node, names[type][1 + k], NULL);
  if (cav_xml_accepts(node, "anchor")) cav_xml_reals(node, "anchor", e->anchor, 3);
  if (cav_xml_accepts(node, "relpose")) cav_xml_reals(node, "relpose", e->relpose, 7);
  if (cav_xml_accepts(node, "polycoef")) cav_xml_reals(node, "polycoef", e->polycoef, 5);
}

static void read_equality(reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    cav_spec_equality e = class_of(r, c, NULL)->equality;
    read_equality_values(spec, c, &e);
    if (!e.active || !spec->option.equality || !spec->option.constraint) {
      cav_spec_warn(spec, c, NULL, "left out: the constraint is switched off");
      continue;
    }
    e.name = cav_xml_text(c, "name", "");
    e.node = c;
    e.polycoef[1] = 1;
    read_equality_objects(c, &e);
    e.torquescale = cav_xml_accepts(c, "torquescale") ? cav_xml_real(c, "torquescale", 1) : 1;
    e.distance = cav_xml_accepts(c, "distance") ? cav_xml_real(c, "distance", 0) : 0;
    cav_spec_equality *place_of = CAV_SPEC_PUSH(spec, &spec->equality);
    if (!place_of) return;
    *place_of = e;
  }
}

// sites, geoms and pulleys that a string passes
static void read_path(cav_spec *spec, const cav_xml_node *node, cav_spec_tendon *t) {
  for (const cav_xml_node *i = node->child; i; i = i->next) {
    cav_spec_tendon_path *p = CAV_SPEC_PUSH(spec, &spec->path);
    if (!p) return;
    p->node = i;
    p->type = is(i, "site") ? CAV_TENDON_PATH_SITE : is(i, "geom") ? CAV_TENDON_PATH_SPHERE : CAV_TENDON_PATH_PULLEY;
    p->name = cav_xml_text(i, is(i, "site") ? "site" : "geom", "");
    p->sidesite = cav_xml_text(i, "sidesite", NULL);
    p->divisor = cav_xml_real(i, "divisor", 1);
    t->npath++;
  }
}

static void read_tendon(reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    cav_spec_tendon t = class_of(r, c, NULL)->tendon;
    read_tendon_values(spec, c, &t);
    t.name = cav_xml_text(c, "name", "");
    t.node = c;
    t.part = spec->part.n;
    t.path = spec->path.n;
    t.spatial = is(c, "spatial");
    if (t.spatial) read_path(spec, c, &t);
    for (const cav_xml_node *i = c->child; i && !t.spatial; i = i->next) {
      cav_spec_part *p = CAV_SPEC_PUSH(spec, &spec->part);
      if (!p) return;
      *p = (cav_spec_part){i, cav_xml_text(i, "joint", ""), cav_xml_real(i, "coef", 0)};
      t.npart++;
    }
    cav_spec_tendon *place_of = CAV_SPEC_PUSH(spec, &spec->tendon);
    if (place_of) *place_of = t;
  }
}

static void read_actuators(reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c && spec->status == CAV_OK; c = c->next) {
    cav_spec_actuator *a = CAV_SPEC_PUSH(spec, &spec->actuator);
    if (!a) return;
    *a = class_of(r, c, NULL)->actuator;
    cav_actuator_read(spec, c, a);
  }
}

// what a frame sensor looks at or refers to; 0: a camera, which has no frame here
static int read_frame(const cav_xml_node *node, const char *type, const char *name, cav_object_type *kind,
                      const char **object) {
  static const cav_object_type kinds[] = {CAV_OBJECT_BODY, CAV_OBJECT_XBODY, CAV_OBJECT_GEOM, CAV_OBJECT_SITE};
  int i = cav_xml_word(node, type, 0);
  if (i > 3) return 0;
  *kind = kinds[i];
  *object = cav_xml_text(node, name, NULL);
  return 1;
}

static void read_sensor(reader *r, const cav_xml_node *node, cav_sensor_type type) {
  static const struct {
    const char *attribute;
    cav_object_type kind;
  } objects[] = {[CAV_TARGET_BODY] = {"body", CAV_OBJECT_BODY},
                 [CAV_TARGET_SITE] = {"site", CAV_OBJECT_SITE},
                 [CAV_TARGET_SCALAR_JOINT] = {"joint", CAV_OBJECT_JOINT},
                 [CAV_TARGET_BALL_JOINT] = {"joint", CAV_OBJECT_JOINT},
                 [CAV_TARGET_LIMITED_JOINT] = {"joint", CAV_OBJECT_JOINT},
                 [CAV_TARGET_TENDON] = {"tendon", CAV_OBJECT_TENDON},
                 [CAV_TARGET_LIMITED_TENDON] = {"tendon", CAV_OBJECT_TENDON},
                 [CAV_TARGET_ACTUATOR] = {"actuator", CAV_OBJECT_ACTUATOR}};
  cav_spec *spec = r->spec;
  cav_sensor_target target = cav_sensor_rule_of(type)->target;
  cav_spec_sensor s = {.name = cav_xml_text(node, "name", ""), .node = node, .type = type};
  s.cutoff = cav_xml_real(node, "cutoff", 0);
  cav_check_not_negative(spec, node, "cutoff", s.cutoff);
  if (target == CAV_TARGET_FRAME) {
    int known = read_frame(node, "objtype", "objname", &s.object_type, &s.object);
    if (known && cav_xml_accepts(node, "refname") && cav_xml_get(node, "refname"))
      known = read_frame(node, "reftype", "refname", &s.reference_type, &s.reference);
    if (!known) {
      cav_spec_warn(spec, node, NULL, "left out: cameras have no frame here");
      return;
    }
  } else if (target != CAV_TARGET_NONE) {
    s.object_type = objects[target].kind;
    s.object = cav_xml_text(node, objects[target].attribute, "");
  }
  cav_spec_sensor *slot = CAV_SPEC_PUSH(spec, &spec->sensor);
  if (slot) *slot = s;
}

static void read_sensors(reader *r, const cav_xml_node *node) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    int type = 0;
    while (type < CAV_SENSOR_TYPES && !is(c, cav_sensor_rule_of((cav_sensor_type)type)->name)) type++;
    if (type < CAV_SENSOR_TYPES)
      read_sensor(r, c, (cav_sensor_type)type);
    else
      cav_spec_warn(r->spec, c, NULL, "left out: what it reads is not in the file");
  }
}

static void read_keys(reader *r, const cav_xml_node *node) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    cav_spec_key *k = CAV_SPEC_PUSH(r->spec, &r->spec->key);
    if (!k) return;
    const cav_xml_value *q = cav_xml_get(c, "qpos"), *v = cav_xml_get(c, "qvel");
    *k = (cav_spec_key){cav_xml_text(c, "name", ""),
                        c,
                        cav_xml_real(c, "time", 0),
                        q ? q->count : 0,
                        v ? v->count : 0,
                        q ? q->number : NULL,
                        v ? v->number : NULL};
  }
}

// --- the file ---

static void read_sections(reader *r, const cav_xml_node *root, const char *name,
                          void (*read)(reader *, const cav_xml_node *)) {
  for (const cav_xml_node *c = root->child; c && r->spec->status == CAV_OK; c = c->next) {
    if (is(c, name)) read(r, c);
  }
}

void cav_mjcf_default_joint(cav_spec_joint *joint) { *joint = first_defaults().joint; }

void cav_mjcf_default_geom(cav_spec_geom *geom) { *geom = first_defaults().geom; }

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
                                   .passive = 1,
                                   .weight = 1,
                                   .clamp = 1,
                                   .filter_parent = 1,
                                   .refsafe = 1};
}

void cav_mjcf_read_options(cav_spec *spec, const cav_xml_node *node) {
  reader r = {.spec = spec};
  read_sections(&r, node, "compiler", read_compiler);
  read_sections(&r, node, "option", read_option);
}

void cav_mjcf_read(cav_spec *spec, const cav_xml *xml) {
  const cav_xml_node *root = cav_xml_root(xml);
  reader r = {.spec = spec};
  spec->name = cav_xml_text(root, "model", "");
  cav_mjcf_first_options(spec);
  defaults *main_class = CAV_SPEC_PUSH(spec, &r.classes);
  if (main_class) *main_class = first_defaults();

  // each section needs those before it, wherever they stand in the file
  cav_mjcf_read_options(spec, root);
  read_sections(&r, root, "default", read_defaults);
  read_sections(&r, root, "asset", read_assets);
  read_world(&r, root);
  read_sections(&r, root, "contact", read_contact);
  read_sections(&r, root, "equality", read_equality);
  read_sections(&r, root, "tendon", read_tendon);
  read_sections(&r, root, "actuator", read_actuators);
  read_sections(&r, root, "sensor", read_sensors);
  read_sections(&r, root, "keyframe", read_keys);
  if (!spec->body.n) cav_spec_fail(spec, root, NULL, "no worldbody: the model is empty; add bodies");
  free(r.classes.at);
  free(r.materials.at);
}
