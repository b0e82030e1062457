/// What a model has on its bodies and joints by their names: tendons, equality constraints, actuators, sensors,
/// keyframes. Each reference is looked up here, and what it needs of its object checked, with the line of the element
/// at fault.
#include <assert.h>
#include <stdlib.h>

#include "builder.h"
#include "math3.h"
#include "step.h"

// --- tendons, actuators, sensors, keyframes ---

// index of a named object; 0 after a failure, which is noted
static int resolve(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *kind, const char *name,
                   const void *first, int n, size_t stride) {
  int i = cav_name_find(first, n, stride, name);
  if (i < 0) cav_spec_unknown(spec, node, attribute, kind, name, first, n, stride);
  return i < 0 ? 0 : i;
}

static int find_scalar_joint(cav_builder *b, const cav_xml_node *node, const char *name, const char *use) {
  cav_spec *spec = b->spec;
  int i = resolve(spec, node, "joint", "joint", name, CAV_BUILDER_TABLE(spec->joint));
  if (i < spec->joint.n && !cav_builder_is_scalar(spec->joint.at[i].type))
    cav_spec_fail(spec, node, "joint", "'%.60s' is a free or ball joint; %s needs a hinge or a slide", name, use);
  return i;
}

// dofs of all tendons, in order; out NULL: only counts
int cav_builder_tendon_dofs(cav_builder *b, int *out) {
  cav_spec *spec = b->spec;
  char *mark = malloc((size_t)spec->joint.n + 1);
  int n = 0;
  if (!mark) cav_spec_no_memory(spec);
  for (int i = 0; i < spec->tendon.n && mark; i++) {
    int dofs = cav_spec_tendon_joints(spec, i, mark);
    if (out) {
      b->tendon[i].dof = n;
      b->tendon[i].ndof = dofs;
    }
    for (int k = 0; k < spec->joint.n && out; k++) {
      int size = mark[k] ? cav_builder_dofs(b->joint[k].type) : 0;
      for (int d = 0; d < size; d++) *out++ = b->joint[k].dof + d;
    }
    n += dofs;
  }
  free(mark);
  assert(!out || out == b->tendon_dof + n);
  return n;
}

// a spring rests where its joints' springs do, unless the file gives its length; MJCF writes -1 for not given
static int rests(const cav_spec_tendon *s) { return s->has_springlength && s->springlength[0] >= 0; }

static void check_tendon(cav_spec *spec, const cav_spec_tendon *s) {
  if (rests(s) && s->springlength[0] > s->springlength[1])
    cav_spec_fail(spec, s->node, "springlength", "expected lower <= upper, got %g %g", s->springlength[0],
                  s->springlength[1]);
  cav_check_not_negative(spec, s->node, "stiffness", s->stiffness);
  cav_check_not_negative(spec, s->node, "damping", s->damping);
  cav_check_not_negative(spec, s->node, "frictionloss", s->frictionloss);
  cav_check_softness(spec, s->node, "limit", &s->limit);
  cav_check_softness(spec, s->node, "friction", &s->friction);
}

// length of a spatial tendon's spring; NAN where the file gives none, until reference.c measures it
static void fill_path(cav_builder *b, const cav_spec_tendon *s, cav_tendon *t) {
  if (!rests(s)) t->springlength[0] = t->springlength[1] = NAN;
  for (int k = s->path; k < s->path + s->npath; k++) {
    const cav_spec_tendon_path *p = &b->spec->path.at[k];
    b->tendon_path[k] = (cav_tendon_path_point){p->type, p->object, p->side, p->divisor};
  }
}

static void fill_tendons(cav_builder *b) {
  cav_spec *spec = b->spec;
  for (int i = 0; i < spec->tendon.n && cav_builder_running(b); i++) {
    const cav_spec_tendon *s = &spec->tendon.at[i];
    cav_tendon *t = &b->tendon[i];
    *t = (cav_tendon){.name = cav_builder_text(b, s->name),
                      .part = s->part,
                      .npart = s->npart,
                      .path = s->path,
                      .npath = s->npath,
                      .margin = s->margin,
                      .limit = s->limit,
                      .stiffness = s->stiffness,
                      .damping = s->damping,
                      .friction = s->friction};
    t->limited = cav_builder_limits(spec, s->node, "limited", "range", s->limited, s->range) && spec->option.limit;
    memcpy(t->range, s->range, sizeof t->range);
    t->frictionloss = spec->option.frictionloss ? s->frictionloss : 0;
    if (!spec->option.spring) t->stiffness = 0;
    if (!spec->option.damper) t->damping = 0;
    if (rests(s)) memcpy(t->springlength, s->springlength, sizeof t->springlength);
    for (int k = s->part; k < s->part + s->npart; k++) {
      const cav_spec_part *p = &spec->part.at[k];
      int joint = find_scalar_joint(b, p->node, p->joint, "a fixed tendon");
      b->tendon_part[k] = (cav_tendon_part){joint, p->coef};
      if (!rests(s) && cav_builder_running(b)) t->springlength[0] += p->coef * b->joint[joint].springref;
    }
    if (!rests(s)) t->springlength[1] = t->springlength[0];
    if (s->spatial) fill_path(b, s, t);
    check_tendon(spec, s);
  }
  if (cav_builder_running(b)) cav_builder_tendon_dofs(b, b->tendon_dof);
}

// --- equality constraints ---

// index of the first or second object; -1 where there is none, which for bodies is the world
static int find_tied(cav_builder *b, const cav_spec_equality *s, int side) {
  static const char *const attribute[][2] = {[CAV_EQUALITY_CONNECT] = {"body1", "body2"},
                                             [CAV_EQUALITY_WELD] = {"body1", "body2"},
                                             [CAV_EQUALITY_JOINT] = {"joint1", "joint2"},
                                             [CAV_EQUALITY_TENDON] = {"tendon1", "tendon2"},
                                             [CAV_EQUALITY_DISTANCE] = {"geom1", "geom2"}};
  cav_spec *spec = b->spec;
  const char *at = attribute[s->type][side], *name = s->object[side];
  if (s->sites) {
    at = side ? "site2" : "site1";
    if (!name) cav_spec_fail(spec, s->node, at, "is missing; name both sites, or bodies instead");
    return name ? resolve(spec, s->node, at, "site", name, CAV_BUILDER_TABLE(spec->site)) : 0;
  }
  int body = s->type == CAV_EQUALITY_CONNECT || s->type == CAV_EQUALITY_WELD;
  if (!name) return body ? 0 : -1;
  if (body) return resolve(spec, s->node, at, "body", name, CAV_BUILDER_TABLE(spec->body));
  if (s->type == CAV_EQUALITY_TENDON)
    return resolve(spec, s->node, at, "tendon", name, CAV_BUILDER_TABLE(spec->tendon));
  if (s->type == CAV_EQUALITY_DISTANCE) return resolve(spec, s->node, at, "geom", name, CAV_BUILDER_TABLE(spec->geom));
  int joint = resolve(spec, s->node, at, "joint", name, CAV_BUILDER_TABLE(spec->joint));
  if (cav_builder_running(b) && !cav_builder_is_scalar(spec->joint.at[joint].type))
    cav_spec_fail(spec, s->node, at, "'%.60s' is a free or ball joint; this constraint needs a hinge or a slide", name);
  return joint;
}

// what both objects must be for the constraint to say anything
static void check_tied(cav_builder *b, const cav_spec_equality *s, const cav_equality *e) {
  cav_spec *spec = b->spec;
  int coupled = s->type == CAV_EQUALITY_JOINT || s->type == CAV_EQUALITY_TENDON;
  if (s->type == CAV_EQUALITY_DISTANCE && cav_builder_running(b)) {
    int g1 = b->geom[e->object[0]].type, g2 = b->geom[e->object[1]].type, plane = g1 == g2 && g1 == CAV_GEOM_PLANE;
    plane |= g1 == CAV_GEOM_HFIELD || g2 == CAV_GEOM_HFIELD;
    if (plane) cav_spec_fail(spec, s->node, NULL, "the distance between geoms of these two types is not computed");
  }
  if (coupled && e->object[0] == e->object[1]) cav_spec_fail(spec, s->node, NULL, "constrains one to itself; name two");
  cav_check_softness(spec, s->node, "", &s->softness);
  cav_check_not_negative(spec, s->node, "torquescale", s->torquescale);
}

// frames of two sites that are to be one; the objects become their bodies
static void place_at_sites(const cav_builder *b, cav_equality *e) {
  e->placed = 1;
  for (int k = 0; k < 2; k++) {
    const cav_site *site = &b->site[e->object[k]];
    copy3(e->pos[k], site->pos);
    memcpy(e->quat[k], site->quat, sizeof e->quat[k]);
    e->object[k] = site->body;
  }
}

static void fill_equalities(cav_builder *b) {
  static const int dim[] = {[CAV_EQUALITY_CONNECT] = 3,
                            [CAV_EQUALITY_WELD] = 6,
                            [CAV_EQUALITY_JOINT] = 1,
                            [CAV_EQUALITY_TENDON] = 1,
                            [CAV_EQUALITY_DISTANCE] = 1};
  const double none[4] = {1, 0, 0, 0};
  int n = 0;
  for (int i = 0; i < b->spec->equality.n && cav_builder_running(b); i++) {
    const cav_spec_equality *s = &b->spec->equality.at[i];
    cav_equality *e = &b->equality[n];
    *e = (cav_equality){.name = cav_builder_text(b, s->name),
                        .type = s->type,
                        .dim = dim[s->type],
                        .torquescale = s->torquescale,
                        .distance = s->distance,
                        .softness = s->softness};
    memcpy(e->coef, s->polycoef, sizeof e->coef);
    for (int k = 0; k < 2; k++) e->object[k] = find_tied(b, s, k);
    if (!cav_builder_running(b)) return;
    int bodies = s->type == CAV_EQUALITY_CONNECT || s->type == CAV_EQUALITY_WELD;
    if (s->sites) place_at_sites(b, e);
    for (int k = 0; k < 2 && (bodies || s->type == CAV_EQUALITY_DISTANCE); k++)
      e->link[k] = b->link_of[bodies ? e->object[k] : b->geom[e->object[k]].body];
    check_tied(b, s, e);
    if ((bodies || s->type == CAV_EQUALITY_DISTANCE) && e->link[0] == e->link[1]) {
      cav_spec_leave(b->spec, s->node, NULL, "left out: the two move as one");
      continue;
    }
    n++;
    if (!bodies || s->sites) continue;
    if (!s->object[0]) cav_spec_fail(b->spec, s->node, "body1", "is missing; name a body, or two sites");
    if (s->type == CAV_EQUALITY_CONNECT && !cav_xml_get(s->node, "anchor"))
      cav_spec_fail(b->spec, s->node, "anchor", "is missing; give the point that the two bodies have in common");
    // a connect has its anchor in the first body, a weld in the second; the rest of both follows at q0
    const cav_body *first = &b->body[e->object[0]], *second = &b->body[e->object[1]];
    double quat[4];
    memcpy(quat, s->relpose + 3, sizeof quat);
    if (s->type == CAV_EQUALITY_CONNECT) {
      cav_builder_to_link(first, s->anchor, none, e->pos[0], e->quat[0]);
    } else {
      cav_builder_to_link(second, s->anchor, none, e->pos[1], e->quat[1]);
      int given = quat[0] != 0 || quat[1] != 0 || quat[2] != 0 || quat[3] != 0;
      if (given) {
        quat_normalise(quat);
        cav_builder_to_link(first, s->relpose, quat, e->pos[0], e->quat[0]);
      }
    }
  }
  b->model->nequality = n;
}

static void fill_actuators(cav_builder *b) {
  cav_spec *spec = b->spec;
  for (int i = 0; i < spec->actuator.n && cav_builder_running(b); i++) {
    const cav_spec_actuator *s = &spec->actuator.at[i];
    cav_actuator *a = &b->actuator[i];
    *a = (cav_actuator){.name = cav_builder_text(b, s->name)};
    cav_actuator_compile(spec, s, a);
    a->ctrllimited = cav_builder_limits(spec, s->node, "ctrllimited", "ctrlrange", s->ctrllimited, s->ctrlrange) &&
                     spec->option.clamp;
    a->forcelimited = cav_builder_limits(spec, s->node, "forcelimited", "forcerange", s->forcelimited, s->forcerange);
    a->actlimited = cav_builder_limits(spec, s->node, "actlimited", "actrange", s->actlimited, s->actrange);
    memcpy(a->ctrlrange, s->ctrlrange, sizeof a->ctrlrange);
    memcpy(a->actrange, s->actrange, sizeof a->actrange);
  }
}

// index of what a sensor looks at, or refers to
static int find_object(cav_builder *b, const cav_spec_sensor *s, const char *attribute, cav_object_type type,
                       const char *name) {
  cav_spec *spec = b->spec;
  switch (type) {
#define FIND(object, list, attributes, text) \
  case CAV_OBJECT_##object:                  \
    return resolve(spec, s->node, attribute, text, name, CAV_BUILDER_TABLE(spec->list));
    CAV_OBJECTS(FIND)
#undef FIND
    case CAV_OBJECT_TYPES:
      break;
  }
  return -1;
}

// a joint or tendon of the kind that a sensor needs
static void check_sensor(cav_builder *b, const cav_spec_sensor *s, int object) {
  cav_spec *spec = b->spec;
  const char *name = s->object;
  switch (cav_sensor_rule_of(s->type)->target) {
    case CAV_TARGET_SCALAR_JOINT:
      find_scalar_joint(b, s->node, name, "this sensor");
      break;
    case CAV_TARGET_BALL_JOINT:
      if (spec->joint.at[object].type != CAV_JOINT_BALL)
        cav_spec_fail(spec, s->node, "joint", "'%.60s' is no ball joint, which this sensor needs", name);
      break;
    case CAV_TARGET_LIMITED_JOINT:
      if (spec->option.limit && !b->joint[object].limited)
        cav_spec_fail(spec, s->node, "joint", "'%.60s' has no limit to measure; give it a range", name);
      break;
    case CAV_TARGET_LIMITED_TENDON:
      if (spec->option.limit && !b->tendon[object].limited)
        cav_spec_fail(spec, s->node, "tendon", "'%.60s' has no limit to measure; give it a range", name);
      break;
    default:
      break;
  }
}

static void fill_sensors(cav_builder *b) {
  cav_model *m = b->model;
  m->nsensordata = 0;
  for (int i = 0; i < m->nsensor && cav_builder_running(b); i++) {
    const cav_spec_sensor *s = &b->spec->sensor.at[i];
    const cav_sensor_rule *rule = cav_sensor_rule_of(s->type);
    cav_sensor *x = &b->sensor[i];
    *x = (cav_sensor){.name = cav_builder_text(b, s->name),
                      .type = s->type,
                      .object_type = s->object_type,
                      .dim = rule->dim,
                      .adr = m->nsensordata,
                      .cutoff = s->cutoff};
    m->nsensordata += rule->dim;
    if (rule->target == CAV_TARGET_NONE) continue;
    int framed = rule->target == CAV_TARGET_FRAME;
    const char *attribute = framed ? "objname" : cav_object_kind_of(s->object_type)->attribute;
    x->object = find_object(b, s, attribute, s->object_type, s->object);
    if (cav_builder_running(b)) check_sensor(b, s, x->object);
    x->referred = s->reference != NULL;
    if (!x->referred) continue;
    x->reference_type = s->reference_type;
    x->reference = find_object(b, s, "refname", s->reference_type, s->reference);
  }
}

// as many numbers as there are, or fewer: the rest is 0, as in MuJoCo, which for a posture is seldom meant
static void check_key(cav_spec *spec, const cav_spec_key *s, const char *name, const char *what, int n, int given) {
  if (given > n) cav_spec_fail(spec, s->node, name, "expected %d numbers, one per %s, got %d", n, what, given);
  if (given && given < n)
    cav_spec_warn(spec, s->node, name, "%d numbers, but there are %d, one per %s: the rest is taken for 0", given, n,
                  what);
}

// keyframes are of the model's own coordinates; those of a scene come after them and stay where they stand
static void fill_keys(cav_builder *b) {
  cav_spec *spec = b->spec;
  const cav_model *m = b->model;
  double *at = b->keys;
  int nq = m->nq, nv = m->nv;
  for (int k = m->njoint - 1; k >= 0 && spec->joint.at[k].body >= spec->own_bodies; k--)
    nq = b->joint[k].q, nv = b->joint[k].dof;
  for (int i = 0; i < m->nkey; i++) {
    const cav_spec_key *s = &spec->key.at[i];
    check_key(spec, s, "qpos", "coordinate", nq, s->nq);
    check_key(spec, s, "qvel", "degree of freedom", nv, s->nv);
    if (!cav_builder_running(b)) return;
    double *q = at, *v = at + m->nq;
    at += m->nq + m->nv;
    memcpy(q, b->q0, (size_t)m->nq * sizeof *q);
    for (int k = 0; s->nq && k < nq; k++) q[k] = k < s->nq ? s->q[k] : 0;
    for (int k = 0; k < s->nv; k++) v[k] = s->v[k];
    for (int k = 0; k < m->njoint; k++) {
      const cav_joint *j = &b->joint[k];
      if (j->type == CAV_JOINT_FREE) quat_normalise(q + j->q + 3);
      if (j->type == CAV_JOINT_BALL) quat_normalise(q + j->q);
    }
    b->key[i] = (cav_key){cav_builder_text(b, s->name), s->time, q, v};
  }
}

void cav_builder_attachments(cav_builder *b) {
  fill_tendons(b);
  if (cav_builder_running(b)) fill_equalities(b);
  if (cav_builder_running(b)) fill_actuators(b);
  if (cav_builder_running(b)) fill_sensors(b);
  if (cav_builder_running(b)) fill_keys(b);
}
