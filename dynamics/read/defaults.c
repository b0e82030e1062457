/// What an MJCF file says before its bodies: compiler, options, classes of defaults, assets. A class is complete: what
/// its parents say is copied in. Defaults are those of the MJCF reference of MuJoCo 2.2.2.
#include "math3.h"
#include "mjcf.h"

// --- compiler and option ---

void cav_mjcf_read_compiler(cav_mjcf_reader *r, const cav_xml_node *node) {
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
    if (cav_xml_is(i, "lengthrange"))
      cav_spec_warn(r->spec, i, NULL, "left aside: lengths of muscles are found over the ranges of the joints");
  }
  c->fuse = cav_xml_bool(node, "fusestatic", c->fuse);
  c->exact_mesh = cav_xml_bool(node, "exactmeshinertia", c->exact_mesh);
  c->strip = cav_xml_bool(node, "strippath", c->strip);
  read_text(node, "assetdir", &c->mesh_folder);
  read_text(node, "meshdir", &c->mesh_folder);
  if (!cav_xml_bool(node, "discardvisual", 1)) r->spec->load.visual = 1;
  c->fit_box = cav_xml_bool(node, "fitaabb", c->fit_box);
  c->align_free = cav_xml_bool(node, "alignfree", c->align_free);
}

static void read_flags(cav_mjcf_reader *r, const cav_xml_node *node) {
  cav_spec_option *o = &r->spec->option;
  const struct {
    const char *name;
    int *flag;
  } flags[] = {{"constraint", &o->constraint}, {"equality", &o->equality}, {"frictionloss", &o->frictionloss},
               {"limit", &o->limit},           {"contact", &o->contact},   {"spring", &o->spring},
               {"damper", &o->damper},         {"gravity", &o->weight},    {"clampctrl", &o->clamp},
               {"refsafe", &o->refsafe},       {"override", &o->override}, {"filterparent", &o->filter_parent}};
  for (size_t i = 0; i < sizeof flags / sizeof *flags; i++)
    *flags[i].flag = cav_xml_word(node, flags[i].name, *flags[i].flag);
  // one flag for both, until MuJoCo 3.3
  if (!cav_xml_word(node, "passive", 1)) o->spring = o->damper = 0;
  if (!cav_xml_word(node, "actuation", 1))
    cav_spec_warn(r->spec, node, "actuation", "left aside: actuators stay available");
  if (!cav_xml_word(node, "eulerdamp", 1))
    cav_spec_warn(r->spec, node, "eulerdamp", "left aside: damping of joints is implicit in the order euler");
  if (cav_xml_word(node, "ipc", 0))
    cav_spec_lack(r->spec, node, "ipc", "contacts by barriers are not supported; remove the flag");
}

// solimp may be out of its bounds, as in shipped robots: it is mixed as it stands, and cut where it acts
static void read_softness(cav_spec *spec, const cav_xml_node *node, const char *solref, const char *solimp,
                          cav_softness *out) {
  const double *d = out->solimp;
  cav_xml_reals(node, solref, out->solref, 2);
  if (cav_xml_reals(node, solimp, out->solimp, 5) &&
      (d[0] < 0 || d[0] > 1 || d[1] < 0 || d[1] > 1 || d[2] < 0 || d[3] < 0 || d[3] > 1 || d[4] < 1))
    cav_spec_leave(spec, node, solimp,
                   "cut where it acts: impedances and midpoint to 0.0001..0.9999, the power to >= 1");
}

void cav_mjcf_read_option(cav_mjcf_reader *r, const cav_xml_node *node) {
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
  read_real(node, "o_margin", &o->o_margin);
  read_softness(spec, node, "o_solref", "o_solimp", &o->o_softness);
  cav_xml_reals(node, "o_friction", o->o_friction, 5);
  const cav_xml_value *groups = cav_xml_get(node, "actuatorgroupdisable");
  for (int i = 0; groups && i < groups->count; i++) {
    if (groups->number[i] < 0 || groups->number[i] > 30)
      cav_spec_fail(spec, node, "actuatorgroupdisable", "expected groups from 0 to 30, got %g", groups->number[i]);
    else
      o->disabled_groups |= 1u << (int)groups->number[i];
  }
  // what only MuJoCo's own step or solver does
  if (cav_xml_word(node, "integrator", 0))
    cav_spec_warn(spec, node, "integrator", "left aside: steps are semi-implicit (velocity first)");
  if (cav_xml_word(node, "cone", 0)) cav_spec_warn(spec, node, "cone", "left aside: friction cones are elliptic");
  if (cav_xml_int(node, "noslip_iterations", 0) > 0)
    cav_spec_warn(spec, node, "noslip_iterations", "left aside: friction is as soft as impratio says");
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, "flag")) read_flags(r, c);
  }
}

// --- defaults and materials ---

// a constant, where MuJoCo 3.14 lets stiffness and damping be polynomials
static void read_constant(cav_spec *spec, const cav_xml_node *node, const char *name, double *out) {
  double number[3] = {*out, 0, 0};
  cav_xml_reals(node, name, number, 3);
  *out = number[0];
  if (number[1] != 0 || number[2] != 0)
    cav_spec_lack(spec, node, name, "stiffness and damping that vary are not supported; give one number");
}

void cav_mjcf_joint_values(cav_spec *spec, const cav_xml_node *node, cav_spec_joint *j) {
  j->type = (cav_joint_type)cav_xml_word(node, "type", (int)j->type);
  cav_xml_reals(node, "pos", j->pos, 3);
  cav_xml_reals(node, "axis", j->axis, 3);
  cav_xml_reals(node, "springdamper", j->springdamper, 2);
  cav_xml_reals(node, "range", j->range, 2);
  read_limited(node, "limited", &j->limited);
  if (cav_xml_reals(node, "twistrange", j->twist, 2)) j->has_twist = 1;
  if (cav_xml_get(node, "swingrange")) j->has_swing = 1;
  read_real(node, "swingrange", &j->swing);
  read_softness(spec, node, "solreflimit", "solimplimit", &j->limit);
  read_softness(spec, node, "solreffriction", "solimpfriction", &j->friction);
  read_constant(spec, node, "stiffness", &j->stiffness);
  read_real(node, "margin", &j->margin);
  read_real(node, "ref", &j->ref);
  read_real(node, "springref", &j->springref);
  read_real(node, "armature", &j->armature);
  read_constant(spec, node, "damping", &j->damping);
  read_real(node, "frictionloss", &j->frictionloss);
  read_limited(node, "actuatorfrclimited", &j->effort);
  cav_xml_reals(node, "actuatorfrcrange", j->effort_range, 2);
  j->gravcomp = cav_xml_bool(node, "actuatorgravcomp", j->gravcomp);
}

void cav_mjcf_geom_values(cav_spec *spec, const cav_xml_node *node, cav_spec_geom *g) {
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
  read_real(node, "solmix", &g->solmix);
  read_real(node, "density", &g->density);
  read_softness(spec, node, "solref", "solimp", &g->softness);
  g->fluid = cav_xml_word(node, "fluidshape", g->fluid);
  cav_xml_reals(node, "fluidcoef", g->fluidcoef, 5);
  if (cav_xml_get(node, "mass")) g->has_mass = 1;
  read_real(node, "mass", &g->mass);
  cav_xml_reals(node, "rgba", g->rgba, 4);
  read_text(node, "material", &g->material);
  read_text(node, "mesh", &g->mesh);
  read_text(node, "hfield", &g->hfield);
  g->shell = cav_xml_bool(node, "shellinertia", g->shell);
  read_real(node, "fitscale", &g->fitscale);
  double speed[6] = {0};
  cav_xml_reals(node, "surfacevel", speed, 6);
  for (int k = 0; k < 6; k++) {
    if (speed[k] != 0) cav_spec_lack(spec, node, "surfacevel", "surfaces that move like a belt are not supported");
  }
  if (cav_xml_real(node, "adhesion", 0) != 0)
    cav_spec_lack(spec, node, "adhesion", "geoms that stick are not supported; give them friction instead");
}

void cav_mjcf_site_values(cav_spec *spec, const cav_xml_node *node, cav_spec_site *s) {
  cav_xml_reals(node, "pos", s->pos, 3);
  cav_read_orientation(spec, node, s->quat);
  if (cav_xml_reals(node, "fromto", s->fromto, 6)) s->has_fromto = 1;
  s->type = cav_xml_word(node, "type", s->type);
  cav_xml_reals(node, "size", s->size, 3);
}

void cav_mjcf_pair_values(cav_spec *spec, const cav_xml_node *node, cav_spec_pair *p) {
  if (cav_xml_get(node, "solreffriction"))
    cav_spec_leave(spec, node, "solreffriction", "left aside: friction is as soft as solref and impratio say");
  if (cav_xml_real(node, "adhesion", 0) != 0)
    cav_spec_lack(spec, node, "adhesion", "geoms that stick are not supported; give them friction instead");
  read_int(node, "condim", &p->condim);
  cav_xml_reals(node, "friction", p->friction, 5);
  read_softness(spec, node, "solref", "solimp", &p->softness);
  read_real(node, "margin", &p->margin);
}

void cav_mjcf_equality_values(cav_spec *spec, const cav_xml_node *node, cav_spec_equality *e) {
  e->active = cav_xml_bool(node, "active", e->active);
  read_softness(spec, node, "solref", "solimp", &e->softness);
}

void cav_mjcf_tendon_values(cav_spec *spec, const cav_xml_node *node, cav_spec_tendon *t) {
  read_real(node, "armature", &t->armature);
  read_limited(node, "actuatorfrclimited", &t->effort);
  cav_xml_reals(node, "actuatorfrcrange", t->effort_range, 2);
  read_limited(node, "limited", &t->limited);
  cav_xml_reals(node, "range", t->range, 2);
  read_softness(spec, node, "solreflimit", "solimplimit", &t->limit);
  read_softness(spec, node, "solreffriction", "solimpfriction", &t->friction);
  read_real(node, "margin", &t->margin);
  read_constant(spec, node, "stiffness", &t->stiffness);
  read_constant(spec, node, "damping", &t->damping);
  read_real(node, "frictionloss", &t->frictionloss);
  if (cav_xml_get(node, "springlength")) t->has_springlength = 1;
  if (cav_xml_reals(node, "springlength", t->springlength, 2) == 1) t->springlength[1] = t->springlength[0];
}

static const cav_softness soft = {{0.02, 1}, {0.9, 0.95, 0.001, 0.5, 2}};

// the defaults of MJCF itself
cav_mjcf_class cav_mjcf_first_class(void) {
  cav_mjcf_class d = {.name = "main", .hull_vertices = -1};
  d.joint = (cav_spec_joint){
      .type = CAV_JOINT_HINGE, .axis = {0, 0, 1}, .limited = CAV_LIMITED_AUTO, .effort = CAV_LIMITED_AUTO};
  d.joint.limit = d.joint.friction = soft;
  d.geom = (cav_spec_geom){.type = CAV_GEOM_SPHERE,
                           .quat = {1, 0, 0, 0},
                           .contype = 1,
                           .conaffinity = 1,
                           .condim = 3,
                           .friction = {1, 0.005, 0.0001},
                           .solmix = 1,
                           .density = 1000,
                           .fitscale = 1,
                           .softness = soft,
                           .fluidcoef = {0.5, 0.25, 1.5, 1, 1},
                           .rgba = {0.5, 0.5, 0.5, 1}};
  d.site = (cav_spec_site){.quat = {1, 0, 0, 0}, .type = CAV_GEOM_SPHERE, .size = {0.005, 0.005, 0.005}};
  d.pair = (cav_spec_pair){.condim = 3, .friction = {1, 1, 0.005, 0.0001, 0.0001}, .softness = soft};
  d.tendon =
      (cav_spec_tendon){.limited = CAV_LIMITED_AUTO, .effort = CAV_LIMITED_AUTO, .limit = soft, .friction = soft};
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

static int find_class(const cav_mjcf_reader *r, const char *name) {
  if (!name) return 0;
  return cav_name_find(r->classes.at, r->classes.n, sizeof(cav_mjcf_class), name);
}

static void read_default_values(cav_mjcf_reader *r, const cav_xml_node *node, cav_mjcf_class *d) {
  cav_spec *spec = r->spec;
  const char *name = node->rule->name;
  if (!strcmp(name, "joint"))
    cav_mjcf_joint_values(spec, node, &d->joint);
  else if (!strcmp(name, "geom"))
    cav_mjcf_geom_values(spec, node, &d->geom);
  else if (!strcmp(name, "site"))
    cav_mjcf_site_values(spec, node, &d->site);
  else if (!strcmp(name, "pair"))
    cav_mjcf_pair_values(spec, node, &d->pair);
  else if (!strcmp(name, "equality"))
    cav_mjcf_equality_values(spec, node, &d->equality);
  else if (!strcmp(name, "tendon"))
    cav_mjcf_tendon_values(spec, node, &d->tendon);
  else if (!strcmp(name, "mesh")) {
    cav_xml_reals(node, "scale", d->scale, 3);
    d->inertia = (cav_mesh_inertia)cav_xml_word(node, "inertia", (int)d->inertia);
    d->hull_vertices = cav_xml_int(node, "maxhullvert", d->hull_vertices);
  } else if (!strcmp(name, "material"))
    cav_xml_reals(node, "rgba", d->rgba, 4);
  else if (cav_xml_accepts(node, "ctrlrange"))
    cav_actuator_read_values(node, &d->actuator);
}

// own values of a class first, then its subclasses, which start from them
static void read_class(cav_mjcf_reader *r, const cav_xml_node *node, int class) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (!cav_xml_is(c, "default")) read_default_values(r, c, &r->classes.at[class]);
  }
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (!cav_xml_is(c, "default") || r->spec->status != CAV_OK) continue;
    const char *name = cav_xml_text(c, "class", NULL);
    if (!name) {
      cav_spec_fail(r->spec, c, "class", "is missing; a class inside another needs a name");
      return;
    }
    if (find_class(r, name) >= 0) {
      cav_spec_fail(r->spec, c, "class", "'%.60s' is taken already; choose another name", name);
      return;
    }
    cav_mjcf_class *more = CAV_SPEC_PUSH(r->spec, &r->classes);
    if (!more) return;
    *more = r->classes.at[class];
    more->name = name;
    read_class(r, c, r->classes.n - 1);
  }
}

void cav_mjcf_start_parts(cav_mjcf_reader *r) {
  cav_spec *spec = r->spec;
  for (int i = 0; i < spec->parts.n; i++) {
    cav_spec_part_of_file *p = &spec->parts.at[i];
    char *name = cav_spec_keep_text(spec, strlen(p->prefix) + sizeof "main");
    cav_mjcf_class *class = CAV_SPEC_PUSH(spec, &r->classes);
    if (!name || !class) return;
    *class = cav_mjcf_first_class();
    strcpy(name, p->prefix);
    strcat(name, "main");
    class->name = name;
    p->class = r->classes.n - 1;
  }
}

void cav_mjcf_read_defaults(cav_mjcf_reader *r, const cav_xml_node *node) {
  int class = node->part ? r->spec->parts.at[node->part - 1].class : 0;
  const char *name = cav_xml_text(node, "class", NULL), **first = &r->classes.at[class].name;
  // the outermost class may have any name, but there is only one
  if (!class && name && strcmp(*first, "main") && strcmp(*first, name))
    cav_spec_fail(r->spec, node, "class", "the outermost class is '%.60s' already; put this one inside it", *first);
  if (name) *first = name;
  read_class(r, node, class);
}

// the class an object takes: its own, that of its bodies, or the outermost
const cav_mjcf_class *cav_mjcf_class_of(cav_mjcf_reader *r, const cav_xml_node *node, const char *childclass) {
  const char *name = cav_xml_text(node, "class", childclass);
  int i = name || !node->part ? find_class(r, name) : r->spec->parts.at[node->part - 1].class;
  if (i >= 0) return &r->classes.at[i];
  const char *near = cav_xml_nearest(name, r->classes.at, r->classes.n, sizeof(cav_mjcf_class));
  cav_spec_fail(r->spec, node, "class", "no default class '%.60s'%s%.60s%s", name, near ? "; did you mean '" : "",
                near ? near : "; define it", near ? "'?" : "");
  return &r->classes.at[0];
}

void cav_mjcf_check_childclass(cav_mjcf_reader *r, const cav_xml_node *node) {
  const char *name = cav_xml_text(node, "childclass", NULL);
  if (name && find_class(r, name) < 0)
    cav_spec_fail(r->spec, node, "childclass", "no default class '%.60s'; define it or correct the name", name);
}

void cav_mjcf_read_assets(cav_mjcf_reader *r, const cav_xml_node *node) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, "mesh")) {
      const cav_mjcf_class *class = cav_mjcf_class_of(r, c, NULL);
      cav_read_mesh(r->spec, c, class->scale, class->inertia, class->hull_vertices);
    }
    if (cav_xml_is(c, "hfield")) cav_read_hfield(r->spec, c);
    if (!cav_xml_is(c, "material")) continue;
    cav_mjcf_material *m = CAV_SPEC_PUSH(r->spec, &r->materials);
    if (!m) return;
    m->name = cav_xml_text(c, "name", "");
    memcpy(m->rgba, cav_mjcf_class_of(r, c, NULL)->rgba, sizeof m->rgba);
    cav_xml_reals(c, "rgba", m->rgba, 4);
  }
}
