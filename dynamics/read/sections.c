/// What an MJCF file says after its bodies: contact, equality, tendon, actuator, sensor, keyframe. Names are resolved
/// when the model is compiled.
#include "math3.h"
#include "mjcf.h"

// --- contact, equality, tendon, actuator, sensor, keyframe ---

static void read_contact(cav_mjcf_reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, "exclude")) {
      cav_spec_exclude *e = CAV_SPEC_PUSH(spec, &spec->exclude);
      if (!e) return;
      *e = (cav_spec_exclude){c, cav_xml_text(c, "body1", ""), cav_xml_text(c, "body2", "")};
    }
    if (cav_xml_is(c, "pair")) {
      cav_spec_pair *p = CAV_SPEC_PUSH(spec, &spec->pair);
      if (!p) return;
      *p = cav_mjcf_class_of(r, c, NULL)->pair;
      cav_mjcf_pair_values(spec, c, p);
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
  while (!cav_xml_is(node, names[type][0])) type++;
  e->type = (cav_equality_type)type;
  for (int k = 0; k < 2; k++) e->object[k] = cav_xml_text(node, names[type][1 + k], NULL);
  e->sites = type <= CAV_EQUALITY_WELD && (cav_xml_get(node, "site1") || cav_xml_get(node, "site2"));
  for (int k = 0; k < 2 && e->sites; k++) e->object[k] = cav_xml_text(node, k ? "site2" : "site1", NULL);
  if (cav_xml_accepts(node, "anchor")) cav_xml_reals(node, "anchor", e->anchor, 3);
  if (cav_xml_accepts(node, "relpose")) cav_xml_reals(node, "relpose", e->relpose, 7);
  if (cav_xml_accepts(node, "polycoef")) cav_xml_reals(node, "polycoef", e->polycoef, 5);
}

static void read_equality(cav_mjcf_reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (!strncmp(c->rule->name, "flex", 4)) {
      cav_spec_lack(spec, c, NULL, "flexible bodies are not supported; remove them");
      continue;
    }
    cav_spec_equality e = cav_mjcf_class_of(r, c, NULL)->equality;
    cav_mjcf_equality_values(spec, c, &e);
    if (!e.active || !spec->option.equality || !spec->option.constraint) {
      cav_spec_leave(spec, c, NULL, "left out: the constraint is switched off");
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
    p->type = cav_xml_is(i, "site")   ? CAV_TENDON_PATH_SITE
              : cav_xml_is(i, "geom") ? CAV_TENDON_PATH_SPHERE
                                      : CAV_TENDON_PATH_PULLEY;
    p->name = cav_xml_text(i, cav_xml_is(i, "site") ? "site" : "geom", "");
    p->sidesite = cav_xml_text(i, "sidesite", NULL);
    p->divisor = cav_xml_real(i, "divisor", 1);
    t->npath++;
  }
}

// inertia of a tendon: armature J'J, constant along a fixed one. Of one joint it is that joint's; of several it couples
// them across the tree, which inertias here have no place for
static void move_armature(cav_spec *spec, const cav_spec_tendon *t) {
  if (t->armature < 0) cav_spec_fail(spec, t->node, "armature", "expected a number >= 0, got %g", t->armature);
  if (t->armature == 0) return;
  if (t->npart != 1) {
    cav_spec_lack(spec, t->node, "armature",
                  "inertia of a tendon is supported along a fixed one of one joint; give its joints armature instead");
    return;
  }
  const cav_spec_part *part = &spec->part.at[t->part];
  int i = cav_name_find(spec->joint.at, spec->joint.n, sizeof *spec->joint.at, part->joint);
  // a joint that is not there is told where the tendon is compiled
  if (i >= 0) spec->joint.at[i].armature += part->coef * part->coef * t->armature;
}

static void read_tendon(cav_mjcf_reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    cav_spec_tendon t = cav_mjcf_class_of(r, c, NULL)->tendon;
    cav_mjcf_tendon_values(spec, c, &t);
    t.name = cav_xml_text(c, "name", "");
    t.node = c;
    t.part = spec->part.n;
    t.path = spec->path.n;
    t.spatial = cav_xml_is(c, "spatial");
    if (t.spatial) read_path(spec, c, &t);
    for (const cav_xml_node *i = c->child; i && !t.spatial; i = i->next) {
      cav_spec_part *p = CAV_SPEC_PUSH(spec, &spec->part);
      if (!p) return;
      *p = (cav_spec_part){i, cav_xml_text(i, "joint", ""), cav_xml_real(i, "coef", 0)};
      t.npart++;
    }
    move_armature(spec, &t);
    cav_spec_tendon *place_of = CAV_SPEC_PUSH(spec, &spec->tendon);
    if (place_of) *place_of = t;
  }
}

// what is not read as an actuator; 1: one that is
static int is_actuator(cav_spec *spec, const cav_xml_node *node) {
  if (cav_xml_is(node, "adhesion") || (cav_xml_accepts(node, "body") && cav_xml_get(node, "body")))
    cav_spec_leave(spec, node, NULL, "left out: adhesion is not supported; this is the model with that control at 0");
  else if (cav_xml_is(node, "plugin"))
    cav_spec_lack(spec, node, NULL, "actuators that are plugins are not supported; write a general one instead");
  else if (!cav_xml_accepts(node, "ctrlrange"))
    cav_spec_lack(spec, node, NULL, "actuators of this kind are not supported; write a general one instead");
  else
    return 1;
  return 0;
}

static void read_actuators(cav_mjcf_reader *r, const cav_xml_node *node) {
  cav_spec *spec = r->spec;
  for (const cav_xml_node *c = node->child; c && spec->status == CAV_OK; c = c->next) {
    if (!is_actuator(spec, c)) continue;
    cav_spec_actuator a = cav_mjcf_class_of(r, c, NULL)->actuator;
    cav_actuator_read(spec, c, &a);
    if (a.group >= 0 && a.group < 31 && spec->option.disabled_groups >> a.group & 1) {
      cav_spec_leave(spec, c, NULL, "left out: the actuators of its group are switched off");
      continue;
    }
    cav_spec_actuator *slot = CAV_SPEC_PUSH(spec, &spec->actuator);
    if (!slot) return;
    *slot = a;
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

static void read_sensor(cav_mjcf_reader *r, const cav_xml_node *node, cav_sensor_type type) {
  static const struct {
    const char *attribute;
    cav_object_type kind;
  } objects[] = {[CAV_TARGET_BODY] = {"body", CAV_OBJECT_BODY},
                 [CAV_TARGET_SITE] = {"site", CAV_OBJECT_SITE},
                 [CAV_TARGET_SURFACE] = {"site", CAV_OBJECT_SITE},
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
      cav_spec_leave(spec, node, NULL, "left out: cameras have no frame here");
      return;
    }
  } else if (target != CAV_TARGET_NONE) {
    s.object_type = objects[target].kind;
    s.object = cav_xml_text(node, objects[target].attribute, NULL);
    if (!s.object) {
      cav_spec_leave(spec, node, NULL, "left out: cameras have no frame here");
      return;
    }
  }
  cav_spec_sensor *slot = CAV_SPEC_PUSH(spec, &spec->sensor);
  if (slot) *slot = s;
}

// whether a geom of that name stands in the file below a node
static int has_geom(const cav_xml_node *node, const char *name) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, "geom") && !strcmp(cav_xml_text(c, "name", ""), name)) return 1;
    if (has_geom(c, name)) return 1;
  }
  return 0;
}

// a sensor of a geom or an actuator that has been left out
static int is_of_missing(const cav_spec *spec, const cav_xml_node *node) {
  const cav_xml_value *type = cav_xml_accepts(node, "objtype") ? cav_xml_get(node, "objtype") : NULL;
  if (type && !strcmp(type->text, "geom")) {
    const char *name = cav_xml_text(node, "objname", "");
    if (cav_name_find(spec->geom.at, spec->geom.n, sizeof *spec->geom.at, name) >= 0) return 0;
    return has_geom(cav_xml_root(spec->xml), name);
  }
  if (!cav_xml_accepts(node, "actuator")) return 0;
  const cav_xml_node *root = cav_xml_root(spec->xml);
  const char *name = cav_xml_text(node, "actuator", "");
  if (cav_name_find(spec->actuator.at, spec->actuator.n, sizeof *spec->actuator.at, name) >= 0) return 0;
  for (const cav_xml_node *s = root->child; s; s = s->next) {
    for (const cav_xml_node *c = cav_xml_is(s, "actuator") ? s->child : NULL; c; c = c->next) {
      if (c->rule->flags & CAV_XML_ANYTHING) return 1;
      if (!strcmp(cav_xml_text(c, "name", ""), name)) return 1;
    }
  }
  return 0;
}

static void read_sensors(cav_mjcf_reader *r, const cav_xml_node *node) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    int type = 0;
    while (type < CAV_SENSOR_TYPES && !cav_xml_is(c, cav_sensor_rule_of((cav_sensor_type)type)->name)) type++;
    if (type < CAV_SENSOR_TYPES && !is_of_missing(r->spec, c))
      read_sensor(r, c, (cav_sensor_type)type);
    else
      cav_spec_leave(r->spec, c, NULL, "left out: a sensor of this kind, or of something left out, is not read");
  }
}

static void read_keys(cav_mjcf_reader *r, const cav_xml_node *node) {
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

static void read_deformables(cav_mjcf_reader *r, const cav_xml_node *node) {
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, "flex")) cav_spec_lack(r->spec, c, NULL, "flexible bodies are not supported; remove them");
  }
}

void cav_mjcf_read_sections(cav_mjcf_reader *r, const cav_xml_node *root) {
  read_sections(r, root, "contact", read_contact);
  read_sections(r, root, "equality", read_equality);
  read_sections(r, root, "tendon", read_tendon);
  read_sections(r, root, "actuator", read_actuators);
  read_sections(r, root, "sensor", read_sensors);
  read_sections(r, root, "keyframe", read_keys);
  read_sections(r, root, "deformable", read_deformables);
  cav_actuators_settle(r->spec);
}
