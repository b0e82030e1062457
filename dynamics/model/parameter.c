/// Single numbers of a compiled model: masses, centres of mass, inertia, friction, springs, dampers, armature and places of
/// sites, read and replaced, with what the model derives from them. Bodies of one link weigh together, as the compiler has
/// it (bodies.c).
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "compile.h"
#include "math3.h"
#include "objects.h"

#define RULE(kind, name, of, components, unit, text) \
  [CAV_PARAMETER_##kind] = {name, CAV_OBJECT_##of, components, unit, text},
static const cav_parameter_rule rules[CAV_PARAMETER_KINDS] = {CAV_PARAMETERS(RULE)};

const cav_parameter_rule *cav_parameter_rule_of(cav_parameter_kind kind) {
  assert(kind < CAV_PARAMETER_KINDS);
  return &rules[kind];
}

const char *cav_parameter_label(const cav_model *m, const cav_parameter *p, char label[CAV_PARAMETER_LABEL]) {
  static const char *const axis[] = {" x", " y", " z"};
  char of[CAV_GEOM_LABEL], number[64];
  const cav_parameter_rule *rule = cav_parameter_rule_of(p->kind);
  if (p->name && *p->name) {
    snprintf(label, CAV_PARAMETER_LABEL, "%s", p->name);
    return label;
  }
  const char *name =
      rule->of == CAV_OBJECT_GEOM ? cav_geom_label(m, p->object, of) : cav_object_name(m, rule->of, p->object);
  snprintf(number, sizeof number, "%s %d", cav_object_kind_of(rule->of)->text, p->object);
  snprintf(label, CAV_PARAMETER_LABEL, "%s%s of %.120s", rule->name, rule->components > 1 ? axis[p->component] : "",
           *name ? name : number);
  return label;
}

static int width_of(const cav_joint *joint) {
  return joint->type == CAV_JOINT_FREE ? 6 : joint->type == CAV_JOINT_BALL ? 3 : 1;
}

// a pair of geoms that may touch, of which one is this; -1: there is none
static int pair_of(const cav_model *m, int geom) {
  for (int i = 0; i < m->npair; i++)
    if (m->pair[i].geom1 == geom || m->pair[i].geom2 == geom) return i;
  return -1;
}

// whether a parameter stands for something in the model
static int exists(const cav_model *m, const cav_parameter *p) {
  if (p->kind >= CAV_PARAMETER_KINDS || p->component < 0 || p->component >= rules[p->kind].components) return 0;
  switch (p->kind) {
    case CAV_PARAMETER_MASS:
    case CAV_PARAMETER_COM:
    case CAV_PARAMETER_INERTIA:
      return p->object > 0 && p->object < m->nbody && m->body[p->object].link > 0 && m->body[p->object].mass > 0;
    case CAV_PARAMETER_FRICTION:
      return p->object >= 0 && p->object < m->ngeom && pair_of(m, p->object) >= 0;
    case CAV_PARAMETER_STIFFNESS:
    case CAV_PARAMETER_DAMPING:
    case CAV_PARAMETER_ARMATURE:
      return p->object >= 0 && p->object < m->njoint;
    case CAV_PARAMETER_PLACE:
      return p->object >= 0 && p->object < m->nsite && m->site[p->object].link > 0;
    case CAV_PARAMETER_KINDS:
      return 0;
  }
  return 0;
}

// place of a site in its body's frame
static void place_of(const cav_model *m, const cav_site *site, double place[3]) {
  const cav_body *body = &m->body[site->body];
  const double back[4] = {body->quat[0], -body->quat[1], -body->quat[2], -body->quat[3]};
  double off[3];
  sub3(off, site->pos, body->pos);
  quat_rotate(place, back, off);
}

static double largest(const double x[3]) { return fmax(x[0], fmax(x[1], x[2])); }

double cav_model_parameter(const cav_model *m, const cav_parameter *p) {
  double place[3];
  if (!exists(m, p)) return NAN;
  switch (p->kind) {
    case CAV_PARAMETER_MASS:
      return m->body[p->object].mass;
    case CAV_PARAMETER_COM:
      return m->body[p->object].com[p->component];
    case CAV_PARAMETER_INERTIA:
      return largest(m->body[p->object].inertia);
    case CAV_PARAMETER_FRICTION:
      return m->pair[pair_of(m, p->object)].friction[0];
    case CAV_PARAMETER_STIFFNESS:
      return m->joint[p->object].stiffness;
    case CAV_PARAMETER_DAMPING:
      return m->dof[m->joint[p->object].dof].damping;
    case CAV_PARAMETER_ARMATURE:
      return m->dof[m->joint[p->object].dof].armature;
    case CAV_PARAMETER_PLACE:
      place_of(m, &m->site[p->object], place);
      return place[p->component];
    case CAV_PARAMETER_KINDS:
      break;
  }
  return NAN;
}

// mass, centre and inertia of a link from those of its bodies
static void weigh_link(cav_model *m, int l) {
  cav_link *link = (cav_link *)m->link + l;
  link->mass = 0;
  zero3(link->com);
  memset(link->inertia, 0, sizeof link->inertia);
  for (int pass = 0; pass < 2; pass++) {
    for (int b = 0; b < m->nbody; b++) {
      const cav_body *x = &m->body[b];
      double pos[3], quat[4], R[9], W[6], S[6] = {x->inertia[0], x->inertia[1], x->inertia[2], 0, 0, 0};
      if (x->link != l) continue;
      quat_rotate(pos, x->quat, x->com);
      add3(pos, pos, x->pos);
      if (pass == 0) {
        link->mass += x->mass;
        axpy3(link->com, link->com, x->mass, pos);
        continue;
      }
      quat_mul(quat, x->quat, x->iquat);
      quat_matrix(R, quat);
      symmetric_rotate(W, R, S);
      sub3(pos, pos, link->com);
      for (int k = 0; k < 3; k++) link->inertia[k] += W[k] + x->mass * (dot3(pos, pos) - pos[k] * pos[k]);
      link->inertia[3] += W[3] - x->mass * pos[0] * pos[1];
      link->inertia[4] += W[4] - x->mass * pos[0] * pos[2];
      link->inertia[5] += W[5] - x->mass * pos[1] * pos[2];
    }
    if (pass == 0) scale3(link->com, 1 / link->mass, link->com);
  }
  m->mass = 0;
  for (int i = 1; i < m->nlink; i++) m->mass += m->link[i].mass;
}

static void set_body(cav_model *m, const cav_parameter *p, double value) {
  cav_body *body = (cav_body *)m->body + p->object;
  if (p->kind == CAV_PARAMETER_COM) {
    body->com[p->component] = value;
  } else {
    double scale = value / cav_model_parameter(m, p);
    if (p->kind == CAV_PARAMETER_MASS) body->mass = value;
    for (int k = 0; k < 3; k++) body->inertia[k] *= scale;
  }
  weigh_link(m, body->link);
}

static void set_place(cav_model *m, const cav_parameter *p, double value) {
  cav_site *site = (cav_site *)m->site + p->object;
  const cav_body *body = &m->body[site->body];
  double place[3];
  place_of(m, site, place);
  place[p->component] = value;
  quat_rotate(site->pos, body->quat, place);
  add3(site->pos, site->pos, body->pos);
}

static void set_friction(cav_model *m, int geom, double value) {
  cav_pair *pair = (cav_pair *)m->pair;
  ((cav_geom *)m->geom)[geom].friction[0] = value;
  for (int i = 0; i < m->npair; i++)
    if (pair[i].geom1 == geom || pair[i].geom2 == geom) pair[i].friction[0] = pair[i].friction[1] = value;
}

cav_status cav_model_set_parameter(cav_model *m, const cav_parameter *p, double value) {
  int positive = p->kind == CAV_PARAMETER_MASS || p->kind == CAV_PARAMETER_INERTIA;
  if (!exists(m, p) || !isfinite(value) || (positive && !(value > 0))) return CAV_BAD_INPUT;
  if (rules[p->kind].components == 1 && value < 0) return CAV_BAD_INPUT;
  if (p->kind == CAV_PARAMETER_INERTIA && !(cav_model_parameter(m, p) > 0)) return CAV_BAD_INPUT;
  switch (p->kind) {
    case CAV_PARAMETER_MASS:
    case CAV_PARAMETER_COM:
    case CAV_PARAMETER_INERTIA:
      set_body(m, p, value);
      break;
    case CAV_PARAMETER_FRICTION:
      set_friction(m, p->object, value);
      break;
    case CAV_PARAMETER_STIFFNESS:
      ((cav_joint *)m->joint)[p->object].stiffness = value;
      break;
    case CAV_PARAMETER_DAMPING:
      for (int k = 0; k < width_of(&m->joint[p->object]); k++)
        ((cav_dof *)m->dof)[m->joint[p->object].dof + k].damping = value;
      break;
    case CAV_PARAMETER_ARMATURE:
      for (int k = 0; k < width_of(&m->joint[p->object]); k++)
        ((cav_dof *)m->dof)[m->joint[p->object].dof + k].armature = value;
      break;
    case CAV_PARAMETER_PLACE:
      set_place(m, p, value);
      break;
    case CAV_PARAMETER_KINDS:
      return CAV_BAD_INPUT;
  }
  return cav_reference_weights(m);
}

cav_status cav_model_set_parameters(cav_model *m, int n, const cav_parameter *p, const double *value) {
  cav_status status = CAV_OK;
  for (cav_parameter_kind kind = 0; kind < CAV_PARAMETER_KINDS; kind++)
    for (int i = 0; i < n && !status; i++)
      // what the model has stays to the bit
      if (p[i].kind == kind && cav_model_parameter(m, &p[i]) != value[i])
        status = cav_model_set_parameter(m, &p[i], value[i]);
  return status;
}
