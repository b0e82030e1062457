/// Some trees of a compiled model as a model of its own: every array without what belongs to the others, indices
/// renumbered in their order. Nothing is computed anew but the mass, summed as the compiler sums it, since what a model
/// derives from its posture depends on each tree alone. What refers to links of both sides goes with the rest: the
/// caller keeps together what a tendon or an equality constraint joins.
#include "part.h"

#include <stdlib.h>
#include <string.h>

typedef struct carver {
  char *base;
  size_t used;
} carver;

static void *carve(carver *c, int n, size_t size) {
  size_t at = (c->used + 15) & ~(size_t)15;
  c->used = at + (size_t)n * size;
  return c->base ? c->base + at : NULL;
}

/// Room for a part that has all; called twice, first to measure. Keys last.
static double *carve_part(const cav_model *m, carver *c, cav_part *part) {
  part->model = carve(c, 1, sizeof *part->model);
#define TAKE(type, name, count) type *name = carve(c, m->count, sizeof *name);
  CAV_MODEL_ARRAYS(TAKE)
#undef TAKE
#define TAKE(name, count) part->name = carve(c, m->count, sizeof(int));
  CAV_PART_KINDS(TAKE)
#undef TAKE
  double *keys = carve(c, m->nkey, (size_t)(m->nq + m->nv) * sizeof *keys);
  if (!c->base) return NULL;
  *part->model = *m;
#define SET(type, name, count) part->model->name = name;
  CAV_MODEL_ARRAYS(SET)
#undef SET
  return keys;
}

// the part's arrays, which are its own until it is handed out
#define OWN(type, part, name) ((type *)(part)->model->name)

static int mapped(const int *map, int i) { return i < 0 ? i : map[i]; }

/// Numbers what is kept of a kind of n: those whose link is kept, by a getter of the link.
#define NUMBER(part, m, name, count, link_of)                                                       \
  do {                                                                                              \
    int nth = 0;                                                                                    \
    for (int i = 0; i < (m)->count; i++) (part)->name[i] = (part)->link[link_of] >= 0 ? nth++ : -1; \
    (part)->model->count = nth;                                                                     \
  } while (0)

static int joint_width(cav_joint_type type, int of_q) {
  return type == CAV_JOINT_FREE ? 6 + of_q : type == CAV_JOINT_BALL ? 3 + of_q : 1;
}

static void number_moving(const cav_model *m, const char *keep, cav_part *p) {
  int next = 0;
  for (int l = 0; l < m->nlink; l++) p->link[l] = l == 0 || keep[m->link[l].root] ? next++ : -1;
  p->model->nlink = next;
  NUMBER(p, m, body, nbody, m->body[i].link);
  NUMBER(p, m, joint, njoint, m->joint[i].link);
  NUMBER(p, m, dof, nv, m->dof[i].link);
  NUMBER(p, m, geom, ngeom, m->geom[i].link);
  NUMBER(p, m, site, nsite, m->site[i].link);
  next = 0;
  for (int j = 0; j < m->njoint; j++)
    for (int k = 0; k < joint_width(m->joint[j].type, 1); k++) p->q[m->joint[j].q + k] = p->joint[j] >= 0 ? next++ : -1;
  p->model->nq = next;
}

static int has_tendon(const cav_model *m, const cav_part *p, int t) {
  const cav_tendon *tendon = &m->tendon[t];
  for (int i = tendon->part; i < tendon->part + tendon->npart; i++)
    if (p->joint[m->tendon_part[i].joint] < 0) return 0;
  for (int i = tendon->path; i < tendon->path + tendon->npath; i++) {
    const cav_tendon_path_point *point = &m->tendon_path[i];
    if (point->type == CAV_TENDON_PATH_PULLEY) continue;
    if ((point->type == CAV_TENDON_PATH_SITE ? p->site : p->geom)[point->object] < 0) return 0;
    if (point->type != CAV_TENDON_PATH_SITE && point->side >= 0 && p->site[point->side] < 0) return 0;
  }
  return 1;
}

static const int *equality_map(const cav_part *p, cav_equality_type type) {
  switch (type) {
    case CAV_EQUALITY_CONNECT:
    case CAV_EQUALITY_WELD:
      return p->body;
    case CAV_EQUALITY_JOINT:
      return p->joint;
    case CAV_EQUALITY_TENDON:
      return p->tendon;
    case CAV_EQUALITY_DISTANCE:
      return p->geom;
  }
  return NULL;
}

static const int *target_map(const cav_part *p, cav_transmission transmission) {
  switch (transmission) {
    case CAV_TRANSMISSION_JOINT:
    case CAV_TRANSMISSION_JOINT_IN_PARENT:
      return p->joint;
    case CAV_TRANSMISSION_TENDON:
      return p->tendon;
    case CAV_TRANSMISSION_SITE:
    case CAV_TRANSMISSION_CRANK:
      return p->site;
  }
  return NULL;
}

int cav_part_object(const cav_part *p, cav_object_type type, int object) {
  switch (type) {
    case CAV_OBJECT_BODY:
    case CAV_OBJECT_XBODY:
      return p->body[object];
    case CAV_OBJECT_JOINT:
      return p->joint[object];
    case CAV_OBJECT_GEOM:
      return p->geom[object];
    case CAV_OBJECT_SITE:
      return p->site[object];
    case CAV_OBJECT_TENDON:
      return p->tendon[object];
    case CAV_OBJECT_ACTUATOR:
      return p->actuator[object];
    case CAV_OBJECT_KEY:
      return object;
    case CAV_OBJECT_SENSOR:
      return p->sensor[object];
    case CAV_OBJECT_EQUALITY:
      return p->equality[object];
    case CAV_OBJECT_TYPES:
      break;
  }
  return -1;
}

/// Kind of what a sensor looks at; CAV_OBJECT_TYPES: nothing.
static cav_object_type looks_at(const cav_sensor *sensor) {
  switch (cav_sensor_rule_of(sensor->type)->target) {
    case CAV_TARGET_NONE:
      return CAV_OBJECT_TYPES;
    case CAV_TARGET_FRAME:
    case CAV_TARGET_SURFACE:
      return sensor->object_type;
    case CAV_TARGET_BODY:
      return CAV_OBJECT_BODY;
    case CAV_TARGET_SITE:
      return CAV_OBJECT_SITE;
    case CAV_TARGET_SCALAR_JOINT:
    case CAV_TARGET_BALL_JOINT:
    case CAV_TARGET_LIMITED_JOINT:
      return CAV_OBJECT_JOINT;
    case CAV_TARGET_TENDON:
    case CAV_TARGET_LIMITED_TENDON:
      return CAV_OBJECT_TENDON;
    case CAV_TARGET_ACTUATOR:
      return CAV_OBJECT_ACTUATOR;
  }
  return CAV_OBJECT_TYPES;
}

/// Whether what a sensor looks at is there.
static int has_sensor(const cav_part *p, const cav_sensor *sensor) {
  cav_object_type type = looks_at(sensor);
  if (type != CAV_OBJECT_TYPES && cav_part_object(p, type, sensor->object) < 0) return 0;
  return !sensor->referred || cav_part_object(p, sensor->reference_type, sensor->reference) >= 0;
}

static void number_attached(const cav_model *m, cav_part *p) {
  cav_model *out = p->model;
  out->npair = out->ntendon = out->nequality = out->nactuator = out->nsensor = 0;
  for (int i = 0; i < m->npair; i++)
    p->pair[i] = p->geom[m->pair[i].geom1] >= 0 && p->geom[m->pair[i].geom2] >= 0 ? out->npair++ : -1;
  for (int i = 0; i < m->ntendon; i++) p->tendon[i] = has_tendon(m, p, i) ? out->ntendon++ : -1;
  for (int i = 0; i < m->nequality; i++) {
    const cav_equality *e = &m->equality[i];
    const int *map = equality_map(p, e->type);
    int in = map[e->object[0]] >= 0 && (e->object[1] < 0 || map[e->object[1]] >= 0);
    p->equality[i] = in ? out->nequality++ : -1;
  }
  for (int i = 0; i < m->nactuator; i++) {
    const cav_actuator *a = &m->actuator[i];
    int in = target_map(p, a->transmission)[a->target] >= 0 && (a->reference < 0 || p->site[a->reference] >= 0);
    p->actuator[i] = in ? out->nactuator++ : -1;
  }
  for (int i = 0; i < m->nsensor; i++) p->sensor[i] = has_sensor(p, &m->sensor[i]) ? out->nsensor++ : -1;
  out->nu = out->nactuator;
}

// ---------------------------------------------------------------- arrays

static void fill_bodies(const cav_model *m, const cav_part *p) {
  int geom = 0;
  for (int i = 0; i < m->nbody; i++) {
    if (p->body[i] < 0) continue;
    cav_body *b = OWN(cav_body, p, body) + p->body[i];
    *b = m->body[i];
    b->parent = mapped(p->body, b->parent);
    b->link = p->link[b->link];
    b->geom = geom;
    geom += b->ngeom;
  }
  p->model->mass = 0;
  for (int i = 0, dof = 0, joint = 0; i < m->nlink; i++) {
    if (p->link[i] < 0) continue;
    cav_link *l = OWN(cav_link, p, link) + p->link[i];
    *l = m->link[i];
    l->body = p->body[l->body];
    l->parent = mapped(p->link, l->parent);
    l->root = p->link[l->root];
    l->joint = joint, l->dof = dof;
    joint += l->njoint, dof += l->ndof;
    if (i > 0) p->model->mass += l->mass;
  }
}

static void fill_coordinates(const cav_model *m, const cav_part *p) {
  for (int i = 0; i < m->njoint; i++) {
    if (p->joint[i] < 0) continue;
    cav_joint *j = OWN(cav_joint, p, joint) + p->joint[i];
    *j = m->joint[i];
    j->body = p->body[j->body], j->link = p->link[j->link];
    j->q = p->q[j->q], j->dof = p->dof[j->dof];
  }
  for (int i = 0; i < m->nv; i++) {
    if (p->dof[i] < 0) continue;
    cav_dof *d = OWN(cav_dof, p, dof) + p->dof[i];
    *d = m->dof[i];
    d->link = p->link[d->link], d->joint = p->joint[d->joint], d->parent = mapped(p->dof, d->parent);
  }
  cav_part_gather(m->nq, p->q, m->q0, OWN(double, p, q0));
}

static void fill_geometry(const cav_model *m, const cav_part *p) {
  for (int i = 0; i < m->ngeom; i++) {
    if (p->geom[i] < 0) continue;
    cav_geom *g = OWN(cav_geom, p, geom) + p->geom[i];
    *g = m->geom[i];
    g->body = p->body[g->body], g->link = p->link[g->link];
  }
  for (int i = 0; i < m->nsite; i++) {
    if (p->site[i] < 0) continue;
    cav_site *s = OWN(cav_site, p, site) + p->site[i];
    *s = m->site[i];
    s->body = p->body[s->body], s->link = p->link[s->link];
  }
  for (int i = 0; i < m->npair; i++) {
    if (p->pair[i] < 0) continue;
    cav_pair *pair = OWN(cav_pair, p, pair) + p->pair[i];
    *pair = m->pair[i];
    pair->geom1 = p->geom[pair->geom1], pair->geom2 = p->geom[pair->geom2];
  }
}

static void fill_tendons(const cav_model *m, const cav_part *p) {
  cav_model *out = p->model;
  out->ntendon_part = out->ntendon_path = out->ntendon_dof = 0;
  for (int i = 0; i < m->ntendon; i++) {
    if (p->tendon[i] < 0) continue;
    const cav_tendon *from = &m->tendon[i];
    cav_tendon *to = OWN(cav_tendon, p, tendon) + p->tendon[i];
    *to = *from;
    to->part = out->ntendon_part, to->path = out->ntendon_path, to->dof = out->ntendon_dof;
    for (int k = 0; k < from->npart; k++) {
      cav_tendon_part *part = OWN(cav_tendon_part, p, tendon_part) + out->ntendon_part++;
      *part = m->tendon_part[from->part + k];
      part->joint = p->joint[part->joint];
    }
    for (int k = 0; k < from->npath; k++) {
      cav_tendon_path_point *point = OWN(cav_tendon_path_point, p, tendon_path) + out->ntendon_path++;
      *point = m->tendon_path[from->path + k];
      if (point->type == CAV_TENDON_PATH_SITE) point->object = p->site[point->object];
      if (point->type != CAV_TENDON_PATH_SITE && point->type != CAV_TENDON_PATH_PULLEY) {
        point->object = p->geom[point->object];
        point->side = mapped(p->site, point->side);
      }
    }
    for (int k = 0; k < from->ndof; k++)
      OWN(int, p, tendon_dof)[out->ntendon_dof++] = p->dof[m->tendon_dof[from->dof + k]];
  }
}

static void fill_attached(const cav_model *m, const cav_part *p) {
  for (int i = 0; i < m->nequality; i++) {
    if (p->equality[i] < 0) continue;
    cav_equality *e = OWN(cav_equality, p, equality) + p->equality[i];
    const int *map = equality_map(p, m->equality[i].type);
    int links = map == p->body || map == p->geom;
    *e = m->equality[i];
    for (int k = 0; k < 2; k++) {
      e->object[k] = mapped(map, e->object[k]);
      if (links) e->link[k] = p->link[e->link[k]];
    }
  }
  for (int i = 0; i < m->nactuator; i++) {
    if (p->actuator[i] < 0) continue;
    cav_actuator *a = OWN(cav_actuator, p, actuator) + p->actuator[i];
    *a = m->actuator[i];
    a->target = target_map(p, a->transmission)[a->target];
    a->reference = mapped(p->site, a->reference);
  }
  p->model->nsensordata = 0;
  for (int i = 0; i < m->nsensor; i++) {
    if (p->sensor[i] < 0) continue;
    cav_sensor *s = OWN(cav_sensor, p, sensor) + p->sensor[i];
    *s = m->sensor[i];
    s->adr = p->model->nsensordata;
    p->model->nsensordata += s->dim;
    cav_part_sensor(p, s);
  }
}

void cav_part_sensor(const cav_part *p, cav_sensor *sensor) {
  cav_object_type type = looks_at(sensor);
  if (type != CAV_OBJECT_TYPES) sensor->object = cav_part_object(p, type, sensor->object);
  if (sensor->referred) sensor->reference = cav_part_object(p, sensor->reference_type, sensor->reference);
}

static void fill_keys(const cav_model *m, const cav_part *p, double *room) {
  for (int i = 0; i < m->nkey; i++) {
    cav_key *key = OWN(cav_key, p, key) + i;
    double *q = room + (size_t)i * (size_t)(m->nq + m->nv), *v = q + m->nq;
    *key = m->key[i];
    cav_part_gather(m->nq, p->q, m->key[i].q, q);
    cav_part_gather(m->nv, p->dof, m->key[i].v, v);
    key->q = q, key->v = v;
  }
}

cav_status cav_part_take(const cav_model *whole, const char *keep, cav_part *part) {
  carver c = {NULL, 0};
  carve_part(whole, &c, part);
  size_t bytes = c.used;
  c = (carver){calloc(1, bytes), 0};
  *part = (cav_part){0};
  if (!c.base) return CAV_NO_MEMORY;
  double *keys = carve_part(whole, &c, part);
  part->model->bytes = bytes;
  part->model->nwarning = 0;
  number_moving(whole, keep, part);
  number_attached(whole, part);
  fill_bodies(whole, part);
  fill_coordinates(whole, part);
  fill_geometry(whole, part);
  fill_tendons(whole, part);
  fill_attached(whole, part);
  fill_keys(whole, part, keys);
  return CAV_OK;
}

void cav_part_clear(cav_part *part) {
  free(part->model);
  *part = (cav_part){0};
}

void cav_part_gather(int n, const int *map, const double *whole, double *part) {
  for (int i = 0; i < n; i++)
    if (map[i] >= 0) part[map[i]] = whole[i];
}

void cav_part_scatter(int n, const int *map, const double *part, double *whole) {
  for (int i = 0; i < n; i++)
    if (map[i] >= 0) whole[i] = part[map[i]];
}
