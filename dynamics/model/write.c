/// A model as MJCF: bodies, joints, geoms, sites, masses and keyframes as the model has them, everything else (options,
/// classes of actuators, contacts, tendons, equality constraints, actuators, sensors) as its own file says it. For models
/// that were changed after loading (resize.c). Not written: what is only seen (cameras, lights, materials), and what
/// stands for copies (replicate, attach), which is refused, as are meshes and height fields.
#include <stdlib.h>
#include <string.h>

#include "cavort/model.h"
#include "math3.h"
#include "spec.h"

typedef struct writer {
  const cav_model *model;
  cav_draft *draft;
  int *element; ///< [nbody] of the draft
} writer;

static int same(const double *a, const double *b, int n) { return !memcmp(a, b, (size_t)n * sizeof *a); }

// numbers that are not what MJCF takes where nothing is said
static void put(const writer *w, int element, const char *name, const double *value, const double *usual, int n) {
  if (!usual || !same(value, usual, n)) cav_draft_numbers(w->draft, element, name, value, n);
}

static void put_one(const writer *w, int element, const char *name, double value, double usual) {
  put(w, element, name, &value, &usual, 1);
}

static void put_name(const writer *w, int element, const char *name) {
  if (*name) cav_draft_text(w->draft, element, "name", name);
}

static void put_softness(const writer *w, int element, const char *solref, const char *solimp,
                         const cav_softness *softness) {
  static const cav_softness usual = {{0.02, 1}, {0.9, 0.95, 0.001, 0.5, 2}};
  put(w, element, solref, softness->solref, usual.solref, 2);
  put(w, element, solimp, softness->solimp, usual.solimp, 5);
}

static void put_pose(const writer *w, int element, const double pos[3], const double quat[4]) {
  static const double none[4] = {0}, straight[4] = {1, 0, 0, 0};
  put(w, element, "pos", pos, none, 3);
  put(w, element, "quat", quat, straight, 4);
}

// a pose of a link's frame in the frame of one of its bodies
static void put_pose_on(const writer *w, int element, int body, const double pos[3], const double quat[4]) {
  const cav_body *x = &w->model->body[body];
  double back[4], way[3], turn[4];
  quat_conjugate(back, x->quat);
  sub3(way, pos, x->pos);
  quat_rotate(way, back, way);
  quat_mul(turn, back, quat);
  put_pose(w, element, way, turn);
}

static void write_body(const writer *w, int b) {
  static const double none[3] = {0};
  const cav_model *m = w->model;
  const cav_body *x = &m->body[b];
  const cav_link *link = &m->link[x->link];
  int moves = x->link > 0 && link->body == b, parent = m->body[b].parent;
  int at = w->element[b] = cav_draft_add(w->draft, w->element[parent], "body");
  put_name(w, at, x->name);
  put_pose_on(w, at, parent, moves ? link->pos : x->pos, moves ? link->quat : x->quat);
  put_one(w, at, "gravcomp", x->buoyancy, 0);
  if (!x->link || !(x->mass > 0)) return;
  int inertial = cav_draft_add(w->draft, at, "inertial");
  put(w, inertial, "pos", x->com, NULL, 3);
  put_pose(w, inertial, none, x->iquat);
  put(w, inertial, "mass", &x->mass, NULL, 1);
  put(w, inertial, "diaginertia", x->inertia, NULL, 3);
}

static void write_joint(const writer *w, const cav_joint *j) {
  static const char *const types[] = {"free", "ball", "slide", "hinge"};
  static const double none[3] = {0};
  const cav_dof *dof = &w->model->dof[j->dof];
  int at = cav_draft_add(w->draft, w->element[j->body], "joint");
  put_name(w, at, j->name);
  cav_draft_text(w->draft, at, "type", types[j->type]);
  put(w, at, "pos", j->pos, none, 3);
  if (j->type == CAV_JOINT_SLIDE || j->type == CAV_JOINT_HINGE) put(w, at, "axis", j->axis, NULL, 3);
  cav_draft_text(w->draft, at, "limited", j->limited ? "true" : "false");
  if (j->limited) put(w, at, "range", j->range, NULL, 2);
  if (j->effort_limited) {
    cav_draft_text(w->draft, at, "actuatorfrclimited", "true");
    put(w, at, "actuatorfrcrange", j->effort_range, NULL, 2);
  }
  put_one(w, at, "margin", j->margin, 0);
  put_one(w, at, "ref", j->ref, 0);
  put_one(w, at, "springref", j->springref, 0);
  put_one(w, at, "stiffness", j->stiffness, 0);
  put_one(w, at, "damping", dof->damping, 0);
  put_one(w, at, "armature", dof->armature, 0);
  put_one(w, at, "frictionloss", dof->frictionloss, 0);
  put_softness(w, at, "solreflimit", "solimplimit", &j->limit);
  put_softness(w, at, "solreffriction", "solimpfriction", &dof->friction);
  if (j->twist_limited) {
    put(w, at, "axis", j->axis, NULL, 3);
    put(w, at, "twistrange", j->twist, NULL, 2);
  }
  if (j->swing_limited) put(w, at, "swingrange", &j->swing, NULL, 1);
}

static const char *const shapes[] = {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box"};

static void write_geom(const writer *w, const cav_geom *g) {
  static const double friction[3] = {1, 0.005, 0.0001}, grey[4] = {0.5, 0.5, 0.5, 1};
  double rgba[4];
  for (int k = 0; k < 4; k++) rgba[k] = (double)g->rgba[k];
  int at = cav_draft_add(w->draft, w->element[g->body], "geom");
  put_name(w, at, g->name);
  cav_draft_text(w->draft, at, "type", shapes[g->type]);
  put_pose_on(w, at, g->body, g->pos, g->quat);
  put(w, at, "size", g->size, NULL, 3);
  put(w, at, "friction", g->friction, friction, 3);
  put_softness(w, at, "solref", "solimp", &g->softness);
  put_one(w, at, "contype", g->contype, 1);
  put_one(w, at, "conaffinity", g->conaffinity, 1);
  put_one(w, at, "condim", g->condim, 3);
  put_one(w, at, "priority", g->priority, 0);
  put_one(w, at, "solmix", g->solmix, 1);
  put_one(w, at, "margin", g->margin, 0);
  put_one(w, at, "group", g->group, 0);
  put(w, at, "rgba", rgba, grey, 4);
  if (!g->fluid) return;
  cav_draft_text(w->draft, at, "fluidshape", "ellipsoid");
  put(w, at, "fluidcoef", g->fluidcoef, NULL, 5);
}

static void write_site(const writer *w, const cav_site *s) {
  int at = cav_draft_add(w->draft, w->element[s->body], "site");
  put_name(w, at, s->name);
  cav_draft_text(w->draft, at, "type", shapes[s->type]);
  put_pose_on(w, at, s->body, s->pos, s->quat);
  put(w, at, "size", s->size, NULL, 3);
}

// what is said of materials, which are not written, and what joints already have of their actuators
static int is_left_out(const cav_xml_node *node, const char *name, int actuators) {
  if (!strcmp(name, "material")) return 1;
  int adds = !strcmp(name, "armature") || !strcmp(name, "damping");
  return adds && actuators && !cav_xml_is(node, "tendon") && !cav_xml_is(node, "fixed") && !cav_xml_is(node, "spatial");
}

// an element and all that it holds, as the file has it; classes of what is written in full are not needed
static int copy_node(const writer *w, const cav_xml_node *node, int parent, int actuators) {
  static const char *const full[] = {"geom", "joint", "site", "mesh", "material", "camera", "light"};
  if (node->parent && cav_xml_is(node->parent, "default")) {
    for (size_t i = 0; i < sizeof full / sizeof *full; i++)
      if (cav_xml_is(node, full[i])) return -1;
  }
  int at = cav_draft_add(w->draft, parent, node->rule->name);
  for (int i = 0; i < node->nvalue; i++) {
    const char *name = node->value[i].rule->name;
    if (!is_left_out(node, name, actuators)) cav_draft_text(w->draft, at, name, node->value[i].text);
  }
  for (const cav_xml_node *c = node->child; c; c = c->next) copy_node(w, c, at, actuators);
  return at;
}

// actuators, with the gears that the model has
static void copy_actuators(const writer *w, const cav_xml_node *section, int *count) {
  int parent = cav_draft_add(w->draft, CAV_DRAFT_ROOT, "actuator");
  for (const cav_xml_node *c = section->child; c; c = c->next) {
    int at = copy_node(w, c, parent, 1);
    if (*count < w->model->nactuator) put(w, at, "gear", w->model->actuator[*count].gear, NULL, 6);
    ++*count;
  }
}

static void copy_sections(const writer *w, const cav_xml_node *root) {
  static const char *const sections[] = {"option", "default", "contact", "tendon", "equality", "sensor"};
  int count = 0;
  for (const cav_xml_node *c = root->child; c; c = c->next) {
    for (size_t i = 0; i < sizeof sections / sizeof *sections; i++)
      if (cav_xml_is(c, sections[i])) copy_node(w, c, CAV_DRAFT_ROOT, cav_xml_is(c, "default"));
    if (cav_xml_is(c, "actuator")) copy_actuators(w, c, &count);
    const cav_xml_value *limits = cav_xml_is(c, "compiler") ? cav_xml_get(c, "autolimits") : NULL;
    if (limits)
      cav_draft_text(w->draft, cav_draft_add(w->draft, CAV_DRAFT_ROOT, "compiler"), "autolimits", limits->text);
  }
}

static void write_keys(const writer *w, const cav_xml_node *root) {
  const cav_model *m = w->model;
  int section = m->nkey ? cav_draft_add(w->draft, CAV_DRAFT_ROOT, "keyframe") : -1, k = 0;
  for (const cav_xml_node *c = root->child; c; c = c->next) {
    for (const cav_xml_node *key = cav_xml_is(c, "keyframe") ? c->child : NULL; key && k < m->nkey;
         key = key->next, k++) {
      int at = cav_draft_add(w->draft, section, "key");
      put_name(w, at, m->key[k].name);
      put_one(w, at, "time", m->key[k].time, 0);
      put(w, at, "qpos", m->key[k].q, NULL, m->nq);
      if (cav_xml_get(key, "qvel")) put(w, at, "qvel", m->key[k].v, NULL, m->nv);
      if (cav_xml_get(key, "act")) cav_draft_text(w->draft, at, "act", cav_xml_get(key, "act")->text);
      if (cav_xml_get(key, "ctrl")) cav_draft_text(w->draft, at, "ctrl", cav_xml_get(key, "ctrl")->text);
    }
  }
}

static void write_model(const writer *w, const cav_xml_node *root) {
  const cav_model *m = w->model;
  copy_sections(w, root);
  w->element[0] = CAV_DRAFT_WORLD;
  for (int b = 1; b < m->nbody; b++) write_body(w, b);
  for (int j = 0; j < m->njoint; j++) write_joint(w, &m->joint[j]);
  for (int g = 0; g < m->ngeom; g++) write_geom(w, &m->geom[g]);
  for (int s = 0; s < m->nsite; s++) write_site(w, &m->site[s]);
  write_keys(w, root);
}

// what has no bodies of its own in the file, or shapes of other files
static cav_status check(const cav_model *m, const cav_xml_node *node, cav_error *error) {
  static const char *const copies[] = {"replicate", "attach", "composite", "flexcomp"};
  if (!node->parent && node->rule != &cav_mjcf_root)
    return cav_xml_fail_as(error, CAV_NOT_SUPPORTED, node, NULL,
                           "expected an MJCF file: a model of another is not written");
  for (int g = 0; g < m->ngeom && !node->parent; g++)
    if (m->geom[g].type >= CAV_GEOM_MESH)
      return cav_xml_fail_as(error, CAV_NOT_SUPPORTED, node, NULL,
                             "models with meshes or height fields are not written");
  for (size_t i = 0; i < sizeof copies / sizeof *copies; i++)
    if (cav_xml_is(node, copies[i]))
      return cav_xml_fail_as(error, CAV_NOT_SUPPORTED, node, NULL, "is not written; write the bodies out");
  for (const cav_xml_node *c = node->child; c; c = c->next) {
    cav_status status = check(m, c, error);
    if (status) return status;
  }
  return CAV_OK;
}

char *cav_model_mjcf(const cav_model *model, const char *path, cav_error *error) {
  static const cav_xml_element *const roots[] = {&cav_mjcf_root, &cav_urdf_root, NULL};
  cav_xml *xml = cav_xml_read(path, roots, NULL, error);
  if (!xml) return NULL;
  writer w = {.model = model};
  char *text = NULL;
  if (check(model, cav_xml_root(xml), error) == CAV_OK) {
    w.draft = cav_draft_new(*model->name ? model->name : NULL);
    w.element = malloc((size_t)model->nbody * sizeof *w.element);
    if (w.draft && w.element) write_model(&w, cav_xml_root(xml));
    const char *made = w.draft && w.element ? cav_draft_mjcf(w.draft) : NULL;
    if (made) text = strdup(made);
    if (!text && error) *error = (cav_error){.status = CAV_NO_MEMORY, .text = "no memory to write a model"};
  }
  cav_draft_free(w.draft);
  free(w.element);
  cav_xml_free(xml);
  return text;
}
