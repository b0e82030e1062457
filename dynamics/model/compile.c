/// Compiles a spec into the immutable model: one block of memory, carved once.
///
/// Phases: masses; names and references; which bodies move as one (links) and their coordinates; sizes; carving (the same
/// walk twice, first to measure, then to place); filling; pairs; reference weights. Bodies without joints are fused into
/// the link they stand on: mass, centre and inertia add up, and geoms, sites and body frames are re-expressed in its frame.
/// Every check that needs the whole model is here, with the line of the element at fault.

#include <assert.h>
#include <stdint.h>
#include <stdlib.h>

#include "compile.h"
#include "math3.h"
#include "objects.h"
#include "spec.h"
#include "step.h"

// the model under construction; its arrays are writable here only
typedef struct builder {
  cav_spec *spec;
  cav_model *model;
#define ARRAY(type, name, count) type *name;
  CAV_MODEL_ARRAYS(ARRAY)
#undef ARRAY
  void *assets; // meshes and height fields, written by asset.c
  double *keys; // q and v of all keyframes
  char **warning;
  char *text, *text_end;
  int *weld;       // [nbody] the body at the top of the group that moves with a body
  int *link_of;    // [nbody]
  cav_pair *pairs; // list of filter.c
} builder;

// what a file names, and what to call too many of them: sizes, names and limits of the model follow
#define NAMED_OBJECTS(X)              \
  X(body, "bodies")                   \
  X(joint, "joints")                  \
  X(geom, "geoms")                    \
  X(site, "sites")                    \
  X(tendon, "tendons")                \
  X(equality, "equality constraints") \
  X(actuator, "actuators")            \
  X(sensor, "sensors")                \
  X(key, "keyframes")

static const int joint_q[] = {[CAV_JOINT_FREE] = 7, [CAV_JOINT_BALL] = 4, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
static const int joint_v[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};

static int is_scalar(cav_joint_type type) { return type == CAV_JOINT_HINGE || type == CAV_JOINT_SLIDE; }

static int running(const builder *b) { return b->spec->status == CAV_OK; }

// --- names ---

// first object, count and size of a list, for searching by name
#define TABLE(list) (list).at, (list).n, sizeof *(list).at

// what all named objects of a spec start with
typedef struct named {
  const char *name;
  const cav_xml_node *node;
} named;

static int compare_named(const void *a, const void *b) {
  const named *x = a, *y = b;
  int order = strcmp(x->name, y->name);
  if (order) return order;
  return (x->node->line > y->node->line) - (x->node->line < y->node->line);
}

static void check_unique(cav_spec *spec, const void *first, int n, size_t stride) {
  named *sorted = malloc((size_t)(n + 1) * sizeof *sorted);
  if (!sorted) {
    cav_spec_no_memory(spec);
    return;
  }
  for (int i = 0; i < n; i++) memcpy(&sorted[i], (const char *)first + (size_t)i * stride, sizeof *sorted);
  qsort(sorted, (size_t)n, sizeof *sorted, compare_named);
  for (int i = 1; i < n; i++) {
    if (!*sorted[i].name || strcmp(sorted[i].name, sorted[i - 1].name)) continue;
    cav_spec_fail(spec, sorted[i].node, "name", "'%.60s' is taken already at %.200s:%d; choose another", sorted[i].name,
                  sorted[i - 1].node->file, sorted[i - 1].node->line);
  }
  free(sorted);
}

static void check_names(cav_spec *spec) {
#define UNIQUE(list, ...) check_unique(spec, TABLE(spec->list));
  NAMED_OBJECTS(UNIQUE)
#undef UNIQUE
  check_unique(spec, TABLE(spec->mesh));
  check_unique(spec, TABLE(spec->hfield));
}

// --- limits ---

// whether a range holds, by what is said of it; an inverted one cannot
static int limits(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *range_name,
                  cav_limited limited, const double range[2]) {
  int given = range[0] != 0 || range[1] != 0, holds = limited == CAV_LIMITED_YES;
  if (limited == CAV_LIMITED_AUTO && given) {
    if (spec->compiler.autolimits == 0)
      cav_spec_fail(spec, node, attribute, "is missing where %s is given; write true or false, or set autolimits",
                    range_name);
    holds = 1;
  }
  if (holds && !(range[0] < range[1]))
    cav_spec_fail(spec, node, range_name, "expected lower < upper, got %g %g", range[0], range[1]);
  return holds;
}

// --- links ---

// the one link a body is part of, and the joints that may be on a body
static void check_body_joints(cav_spec *spec, int index) {
  const cav_spec_body *body = &spec->body.at[index];
  int dofs = 0;
  for (int i = body->joint; i < body->joint + body->njoint; i++) {
    const cav_spec_joint *j = &spec->joint.at[i];
    dofs += joint_v[j->type];
    if (j->type != CAV_JOINT_FREE) continue;
    if (body->parent != 0)
      cav_spec_fail(spec, j->node, NULL,
                    "a free joint is for bodies right in the world; '%.60s' is inside another body", body->name);
    if (body->njoint > 1) cav_spec_fail(spec, j->node, NULL, "a free joint stands alone; remove the other joints");
  }
  if (dofs > 6) cav_spec_fail(spec, body->node, NULL, "%d degrees of freedom on one body; at most 6 move it", dofs);
}

static void find_links(builder *b) {
  cav_spec *spec = b->spec;
  cav_model *m = b->model;
  b->weld[0] = b->link_of[0] = 0;
  m->nlink = 1;
  for (int i = 1; i < spec->body.n; i++) {
    const cav_spec_body *body = &spec->body.at[i];
    check_body_joints(spec, i);
    b->weld[i] = body->njoint ? i : b->weld[body->parent];
    b->link_of[i] = body->njoint ? m->nlink++ : b->link_of[body->parent];
  }
  m->nq = m->nv = 0;
  for (int i = 0; i < spec->joint.n; i++) {
    m->nq += joint_q[spec->joint.at[i].type];
    m->nv += joint_v[spec->joint.at[i].type];
  }
  if (m->nv > CAV_SPEC_DOFS)
    cav_spec_fail(spec, spec->body.at[0].node, NULL, "%d degrees of freedom; at most %d are read", m->nv,
                  CAV_SPEC_DOFS);
  if (m->nv == 0) cav_spec_fail(spec, spec->body.at[0].node, NULL, "nothing moves: no body has a joint; add one");
}

// --- one block ---

// position in a block; base NULL: only measures
typedef struct carver {
  char *base;
  size_t used;
} carver;

static void *take(carver *c, int n, size_t size) {
  size_t at = (c->used + 15) & ~(size_t)15;
  assert(n >= 0 && size <= SIZE_MAX / 4 / ((size_t)n + 1));
  c->used = at + (size_t)n * size;
  return c->base ? c->base + at : NULL;
}

static size_t text_bytes(const cav_spec *spec) {
  size_t bytes = strlen(spec->name) + 1;
#define ADD(list, ...) \
  for (int i = 0; i < spec->list.n; i++) bytes += strlen(spec->list.at[i].name) + 1;
  NAMED_OBJECTS(ADD)
#undef ADD
  for (int i = 0; i < spec->warning.n; i++) bytes += strlen(spec->warning.at[i]) + 1;
  return bytes;
}

static void carve_model(builder *b, carver *c) {
  const cav_model *m = b->model;
  size_t text = text_bytes(b->spec);
  cav_model *at = take(c, 1, sizeof *at);
  if (at) *at = *m;
  b->model = at ? at : b->model;
#define TAKE(type, name, count) b->name = take(c, m->count, sizeof *b->name);
  CAV_MODEL_ARRAYS(TAKE)
#undef TAKE
  b->assets = take(c, 1, cav_put_assets(b->spec, NULL, b->model));
  b->keys = take(c, m->nkey, (size_t)(m->nq + m->nv) * sizeof *b->keys);
  b->warning = take(c, m->nwarning, sizeof *b->warning);
  b->text = take(c, 1, text);
  b->text_end = b->text ? b->text + text : NULL;
}

static void publish_arrays(builder *b) {
  cav_model *m = b->model;
  cav_put_assets(b->spec, b->assets, m);
#define PUBLISH(type, name, count) m->name = b->name;
  CAV_MODEL_ARRAYS(PUBLISH)
#undef PUBLISH
  m->warning = (const char *const *)b->warning;
}

static char *put_text(builder *b, const char *text) {
  size_t length = strlen(text) + 1;
  char *at = b->text;
  b->text += length;
  memcpy(at, text, length);
  return at;
}

// --- bodies, links, joints ---

// frame of a body in its link: its own link's frame where it has joints, else composed with its parent's
static void place_body(const cav_spec *spec, cav_body *body, int i) {
  const cav_spec_body *s = &spec->body.at[i];
  cav_body *x = &body[i];
  set3(x->pos, 0, 0, 0);
  const double none[4] = {1, 0, 0, 0};
  memcpy(x->quat, none, sizeof none);
  if (i == 0 || s->njoint) return;
  const cav_body *up = &body[s->parent];
  quat_rotate(x->pos, up->quat, s->pos);
  add3(x->pos, x->pos, up->pos);
  quat_mul(x->quat, up->quat, s->quat);
  quat_normalise(x->quat);
}

static void fill_bodies(builder *b) {
  const cav_spec *spec = b->spec;
  for (int i = 0; i < spec->body.n; i++) {
    const cav_spec_body *s = &spec->body.at[i];
    cav_body *x = &b->body[i];
    *x = (cav_body){.name = put_text(b, s->name),
                    .parent = s->parent,
                    .link = b->link_of[i],
                    .geom = s->geom,
                    .ngeom = s->ngeom,
                    .mass = s->inertia.mass,
                    .buoyancy = s->gravcomp};
    copy3(x->com, s->inertia.com);
    copy3(x->inertia, s->inertia.moment);
    memcpy(x->iquat, s->inertia.quat, sizeof x->iquat);
    place_body(spec, b->body, i);
  }
}

// pose in a body's frame into its link's
static void to_link(const cav_body *body, const double pos[3], const double quat[4], double link_pos[3],
                    double link_quat[4]) {
  quat_rotate(link_pos, body->quat, pos);
  add3(link_pos, link_pos, body->pos);
  quat_mul(link_quat, body->quat, quat);
  quat_normalise(link_quat);
}

static void fill_link_frames(builder *b) {
  const cav_spec *spec = b->spec;
  b->link[0] = (cav_link){.parent = -1, .quat = {1, 0, 0, 0}};
  for (int i = 1; i < spec->body.n; i++) {
    const cav_spec_body *s = &spec->body.at[i];
    if (!s->njoint) continue;
    int index = b->link_of[i], parent = b->link_of[s->parent];
    cav_link *l = &b->link[index];
    *l = (cav_link){.body = i, .parent = parent, .joint = s->joint, .njoint = s->njoint};
    l->root = parent ? b->link[parent].root : index;
    to_link(&b->body[s->parent], s->pos, s->quat, l->pos, l->quat);
  }
}

// mass, centre and inertia of all bodies of each link: first the sums, then moments about the common centre
static void fill_link_inertias(builder *b) {
  const cav_model *m = b->model;
  for (int i = 0; i < m->nbody; i++) {
    const cav_body *x = &b->body[i];
    cav_link *l = &b->link[x->link];
    double com[3];
    quat_rotate(com, x->quat, x->com);
    add3(com, com, x->pos);
    l->mass += x->mass;
    axpy3(l->com, l->com, x->mass, com);
  }
  for (int i = 0; i < m->nlink; i++) {
    if (b->link[i].mass > 0) scale3(b->link[i].com, 1 / b->link[i].mass, b->link[i].com);
  }
  for (int i = 0; i < m->nbody; i++) {
    const cav_body *x = &b->body[i];
    cav_link *l = &b->link[x->link];
    double pos[3], quat[4], R[9], W[6], S[6] = {x->inertia[0], x->inertia[1], x->inertia[2], 0, 0, 0};
    to_link(x, x->com, x->iquat, pos, quat);
    quat_matrix(R, quat);
    symmetric_rotate(W, R, S);
    sub3(pos, pos, l->com);
    for (int k = 0; k < 3; k++) l->inertia[k] += W[k] + x->mass * (dot3(pos, pos) - pos[k] * pos[k]);
    l->inertia[3] += W[3] - x->mass * pos[0] * pos[1];
    l->inertia[4] += W[4] - x->mass * pos[0] * pos[2];
    l->inertia[5] += W[5] - x->mass * pos[1] * pos[2];
  }
}

static void check_finite(cav_spec *spec, const cav_xml_node *node, const double *x, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += fabs(x[i]);
  if (!isfinite(sum)) cav_spec_fail(spec, node, NULL, "numbers are too large: what follows from them is not finite");
}

// what moves has weight, and what turns has inertia
static void check_link_inertias(builder *b) {
  for (int i = 0; i < b->model->nlink; i++) {
    const cav_link *l = &b->link[i];
    const cav_xml_node *node = b->spec->body.at[l->body].node;
    check_finite(b->spec, node, l->com, 3);
    check_finite(b->spec, node, l->inertia, 6);
    if (i == 0) continue;
    if (!(l->mass > 1e-15))
      cav_spec_fail(b->spec, node, NULL, "moves but has no mass; give it a geom with mass, or an inertial element");
    if (!(l->inertia[0] + l->inertia[1] + l->inertia[2] > 3e-15))
      cav_spec_fail(b->spec, node, NULL, "moves but has no inertia; give its geoms a size or it an inertial element");
    b->model->mass += l->mass;
  }
}

static int joint_limits(cav_spec *spec, const cav_spec_joint *s) {
  if (s->type == CAV_JOINT_FREE) return 0;
  int holds = limits(spec, s->node, "limited", "range", s->limited, s->range);
  if (holds && s->type == CAV_JOINT_BALL && s->range[0] != 0)
    cav_spec_fail(spec, s->node, "range", "a ball joint's range starts at 0, got %g", s->range[0]);
  return holds && spec->option.limit;
}

// the cylinder of a ball joint, an attribute of our own: within what a rotation vector can be
static void fill_cylinder(builder *b, const cav_spec_joint *s, cav_joint *j) {
  cav_spec *spec = b->spec;
  if (!s->has_twist && !s->has_swing) return;
  const char *attribute = s->has_twist ? "twistrange" : "swingrange";
  // a class may say it of all its joints
  if (s->type != CAV_JOINT_BALL) {
    if (cav_xml_get(s->node, attribute)) cav_spec_fail(spec, s->node, attribute, "only for ball joints; give range");
    return;
  }
  if (s->has_twist && !(s->twist[0] < s->twist[1] && s->twist[0] >= -M_PI && s->twist[1] <= M_PI))
    cav_spec_fail(spec, s->node, "twistrange", "expected lower < upper within half a turn either way");
  if (s->has_swing && !(s->swing > 0 && s->swing <= M_PI))
    cav_spec_fail(spec, s->node, "swingrange", "expected an angle > 0 up to half a turn");
  j->twist_limited = s->has_twist && spec->option.limit;
  j->swing_limited = s->has_swing && spec->option.limit;
  memcpy(j->twist, s->twist, sizeof j->twist);
  j->swing = s->swing;
}

static void fill_joint(builder *b, int i, int q, int dof) {
  cav_spec *spec = b->spec;
  const cav_spec_joint *s = &spec->joint.at[i];
  cav_joint *j = &b->joint[i];
  *j = (cav_joint){.name = put_text(b, s->name),
                   .type = s->type,
                   .body = s->body,
                   .link = b->link_of[s->body],
                   .q = q,
                   .dof = dof,
                   .margin = s->margin,
                   .limit = s->limit,
                   .stiffness = s->stiffness};
  j->limited = joint_limits(spec, s);
  memcpy(j->range, s->range, sizeof j->range);
  set3(j->axis, 0, 0, 1);
  if (s->type != CAV_JOINT_FREE) copy3(j->pos, s->pos);
  fill_cylinder(b, s, j);
  if (is_scalar(s->type) || j->twist_limited || j->swing_limited) {
    copy3(j->axis, s->axis);
    if (!(normalise3(j->axis) > 1e-14))
      cav_spec_fail(spec, s->node, "axis", "expected a direction, got %g %g %g", s->axis[0], s->axis[1], s->axis[2]);
  }
  if (is_scalar(s->type)) {
    j->ref = s->ref;
    j->springref = s->springref;
  }
  if (s->springdamper[0] > 0 || s->springdamper[1] > 0)
    cav_spec_fail(spec, s->node, "springdamper", "not supported; write stiffness and damping instead");
  cav_check_not_negative(spec, s->node, "stiffness", s->stiffness);
  cav_check_not_negative(spec, s->node, "damping", s->damping);
  cav_check_not_negative(spec, s->node, "armature", s->armature);
  cav_check_not_negative(spec, s->node, "frictionloss", s->frictionloss);
  cav_check_softness(spec, s->node, "limit", &s->limit);
  cav_check_softness(spec, s->node, "friction", &s->friction);
}

// coordinates of the file's posture: the body's place, no rotation, or ref
static void fill_q0(builder *b, const cav_joint *j) {
  const cav_spec_body *s = &b->spec->body.at[j->body];
  double *q = b->q0 + j->q;
  if (j->type == CAV_JOINT_FREE) {
    copy3(q, s->pos);
    memcpy(q + 3, s->quat, sizeof s->quat);
  } else if (j->type == CAV_JOINT_BALL) {
    q[0] = 1;
  } else {
    q[0] = j->ref;
  }
}

static void fill_joints(builder *b) {
  cav_spec *spec = b->spec;
  int q = 0, dof = 0;
  for (int i = 0; i < spec->joint.n; i++) {
    const cav_spec_joint *s = &spec->joint.at[i];
    int link = b->link_of[s->body];
    cav_link *l = &b->link[link];
    fill_joint(b, i, q, dof);
    fill_q0(b, &b->joint[i]);
    if (i == l->joint) {
      const cav_link *up = &b->link[l->parent];
      l->dof = dof;
      // dofs of the world end the chain; links come in order, so the parent's are known
      b->dof[dof].parent = up->ndof ? up->dof + up->ndof - 1 : -1;
    } else {
      b->dof[dof].parent = dof - 1;
    }
    for (int k = 0; k < joint_v[s->type]; k++, dof++) {
      int parent = k ? dof - 1 : b->dof[dof].parent;
      b->dof[dof] = (cav_dof){.link = link,
                              .joint = i,
                              .parent = parent,
                              .damping = s->damping,
                              .armature = s->armature,
                              .friction = s->friction};
      b->dof[dof].frictionloss = spec->option.frictionloss ? s->frictionloss : 0;
      l->ndof++;
    }
    q += joint_q[s->type];
  }
}

// --- geoms and sites ---

static double bounding_radius(const cav_geom *g) {
  const double *s = g->size;
  switch (g->type) {
    case CAV_GEOM_SPHERE:
      return s[0];
    case CAV_GEOM_CAPSULE:
      return s[0] + s[1];
    case CAV_GEOM_ELLIPSOID:
      return fmax(s[0], fmax(s[1], s[2]));
    case CAV_GEOM_CYLINDER:
      return hypot(s[0], s[1]);
    case CAV_GEOM_BOX:
      return norm3(s);
    default:
      return INFINITY;
  }
}

static void check_geom(builder *b, const cav_spec_geom *s) {
  cav_spec *spec = b->spec;
  cav_check_condim(spec, s->node, s->condim);
  for (int i = 0; i < 3; i++) cav_check_not_negative(spec, s->node, "friction", s->friction[i]);
  cav_check_not_negative(spec, s->node, "solmix", s->solmix);
  cav_check_softness(spec, s->node, "", &s->softness);
  if (s->type == CAV_GEOM_PLANE && b->link_of[s->body] != 0)
    cav_spec_fail(spec, s->node, "type", "a plane cannot move; put it into the world or use a box");
  if (s->fluid && s->type >= CAV_GEOM_MESH)
    cav_spec_fail(spec, s->node, "fluidshape",
                  "a mesh has no ellipsoid here; give the body a geom of another type for it");
}

static void fill_geoms(builder *b) {
  cav_spec *spec = b->spec;
  for (int i = 0; i < spec->geom.n; i++) {
    const cav_spec_geom *s = &spec->geom.at[i];
    cav_geom *g = &b->geom[i];
    check_geom(b, s);
    *g = (cav_geom){.name = put_text(b, s->name),
                    .type = (cav_geom_type)s->type,
                    .body = s->body,
                    .link = b->link_of[s->body],
                    .contype = s->contype,
                    .conaffinity = s->conaffinity,
                    .condim = s->condim,
                    .priority = s->priority,
                    .margin = s->margin,
                    .gap = s->gap,
                    .solmix = s->solmix,
                    .softness = s->softness,
                    .fluid = s->fluid,
                    .group = s->group};
    to_link(&b->body[s->body], s->pos, s->quat, g->pos, g->quat);
    quat_matrix(g->rotation, g->quat);
    copy3(g->size, s->size);
    g->asset = s->type >= CAV_GEOM_MESH ? s->asset : 0;
    copy3(g->friction, s->friction);
    memcpy(g->fluidcoef, s->fluidcoef, sizeof g->fluidcoef);
    g->bound = s->type >= CAV_GEOM_MESH ? s->bound : bounding_radius(g);
    for (int k = 0; k < 4; k++) g->rgba[k] = (float)s->rgba[k];
  }
}

static void fill_sites(builder *b) {
  for (int i = 0; i < b->spec->site.n; i++) {
    const cav_spec_site *s = &b->spec->site.at[i];
    cav_site *x = &b->site[i];
    *x = (cav_site){.name = put_text(b, s->name), .body = s->body, .link = b->link_of[s->body]};
    x->type = (cav_geom_type)s->type;
    copy3(x->size, s->size);
    for (int k = 0; k < 3; k++) cav_check_not_negative(b->spec, s->node, "size", s->size[k]);
    to_link(&b->body[s->body], s->pos, s->quat, x->pos, x->quat);
  }
}

// --- tendons, actuators, sensors, keyframes ---

// index of a named object; 0 after a failure, which is noted
static int resolve(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *kind, const char *name,
                   const void *first, int n, size_t stride) {
  int i = cav_name_find(first, n, stride, name);
  if (i < 0) cav_spec_unknown(spec, node, attribute, kind, name, first, n, stride);
  return i < 0 ? 0 : i;
}

static int find_scalar_joint(builder *b, const cav_xml_node *node, const char *name, const char *use) {
  cav_spec *spec = b->spec;
  int i = resolve(spec, node, "joint", "joint", name, TABLE(spec->joint));
  if (i < spec->joint.n && !is_scalar(spec->joint.at[i].type))
    cav_spec_fail(spec, node, "joint", "'%.60s' is a free or ball joint; %s needs a hinge or a slide", name, use);
  return i;
}

// dofs of all tendons, in order; out NULL: only counts
static int list_tendon_dofs(builder *b, int *out) {
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
      int size = mark[k] ? joint_v[b->joint[k].type] : 0;
      for (int d = 0; d < size; d++) *out++ = b->joint[k].dof + d;
    }
    n += dofs;
  }
  free(mark);
  assert(!out || out == b->tendon_dof + n);
  return n;
}

// length of a spatial tendon's spring; NAN where the file gives none, until reference.c measures it
static void fill_path(builder *b, const cav_spec_tendon *s, cav_tendon *t) {
  int rests = s->has_springlength && s->springlength >= 0;
  t->springlength = rests ? s->springlength : NAN;
  for (int k = s->path; k < s->path + s->npath; k++) {
    const cav_spec_tendon_path *p = &b->spec->path.at[k];
    b->tendon_path[k] = (cav_tendon_path_point){p->type, p->object, p->side, p->divisor};
  }
}

static void fill_tendons(builder *b) {
  cav_spec *spec = b->spec;
  for (int i = 0; i < spec->tendon.n && running(b); i++) {
    const cav_spec_tendon *s = &spec->tendon.at[i];
    cav_tendon *t = &b->tendon[i];
    *t = (cav_tendon){.name = put_text(b, s->name),
                      .part = s->part,
                      .npart = s->npart,
                      .path = s->path,
                      .npath = s->npath,
                      .margin = s->margin,
                      .limit = s->limit,
                      .stiffness = s->stiffness,
                      .damping = s->damping,
                      .friction = s->friction};
    t->limited = limits(spec, s->node, "limited", "range", s->limited, s->range) && spec->option.limit;
    memcpy(t->range, s->range, sizeof t->range);
    t->frictionloss = spec->option.frictionloss ? s->frictionloss : 0;
    // a spring rests where its joints' springs do, unless the file gives its length; MJCF writes -1 for not given
    int rests = s->has_springlength && s->springlength >= 0;
    if (rests) t->springlength = s->springlength;
    for (int k = s->part; k < s->part + s->npart; k++) {
      const cav_spec_part *p = &spec->part.at[k];
      int joint = find_scalar_joint(b, p->node, p->joint, "a fixed tendon");
      b->tendon_part[k] = (cav_tendon_part){joint, p->coef};
      if (!rests && running(b)) t->springlength += p->coef * b->joint[joint].springref;
    }
    if (s->spatial) fill_path(b, s, t);
    cav_check_not_negative(spec, s->node, "stiffness", s->stiffness);
    cav_check_not_negative(spec, s->node, "damping", s->damping);
    cav_check_not_negative(spec, s->node, "frictionloss", s->frictionloss);
    cav_check_softness(spec, s->node, "limit", &s->limit);
    cav_check_softness(spec, s->node, "friction", &s->friction);
  }
  if (running(b)) list_tendon_dofs(b, b->tendon_dof);
}

// --- equality constraints ---

// index of the first or second object; -1 where there is none, which for bodies is the world
static int find_tied(builder *b, const cav_spec_equality *s, int side) {
  static const char *const attribute[][2] = {[CAV_EQUALITY_CONNECT] = {"body1", "body2"},
                                             [CAV_EQUALITY_WELD] = {"body1", "body2"},
                                             [CAV_EQUALITY_JOINT] = {"joint1", "joint2"},
                                             [CAV_EQUALITY_TENDON] = {"tendon1", "tendon2"},
                                             [CAV_EQUALITY_DISTANCE] = {"geom1", "geom2"}};
  cav_spec *spec = b->spec;
  const char *at = attribute[s->type][side], *name = s->object[side];
  int body = s->type == CAV_EQUALITY_CONNECT || s->type == CAV_EQUALITY_WELD;
  if (!name) return body ? 0 : -1;
  if (body) return resolve(spec, s->node, at, "body", name, TABLE(spec->body));
  if (s->type == CAV_EQUALITY_TENDON) return resolve(spec, s->node, at, "tendon", name, TABLE(spec->tendon));
  if (s->type == CAV_EQUALITY_DISTANCE) return resolve(spec, s->node, at, "geom", name, TABLE(spec->geom));
  int joint = resolve(spec, s->node, at, "joint", name, TABLE(spec->joint));
  if (running(b) && !is_scalar(spec->joint.at[joint].type))
    cav_spec_fail(spec, s->node, at, "'%.60s' is a free or ball joint; this constraint needs a hinge or a slide", name);
  return joint;
}

// what both objects must be for the constraint to say anything
static void check_tied(builder *b, const cav_spec_equality *s, const cav_equality *e) {
  cav_spec *spec = b->spec;
  int coupled = s->type == CAV_EQUALITY_JOINT || s->type == CAV_EQUALITY_TENDON;
  if (s->type == CAV_EQUALITY_DISTANCE && running(b)) {
    int g1 = b->geom[e->object[0]].type, g2 = b->geom[e->object[1]].type, plane = g1 == g2 && g1 == CAV_GEOM_PLANE;
    plane |= g1 == CAV_GEOM_HFIELD || g2 == CAV_GEOM_HFIELD;
    if (plane) cav_spec_fail(spec, s->node, NULL, "the distance between geoms of these two types is not computed");
  }
  if (coupled ? e->object[0] == e->object[1] : e->link[0] == e->link[1])
    cav_spec_fail(spec, s->node, NULL,
                  coupled ? "constrains one to itself; name two" : "the two move as one; remove it");
  cav_check_softness(spec, s->node, "", &s->softness);
  cav_check_not_negative(spec, s->node, "torquescale", s->torquescale);
}

static void fill_equalities(builder *b) {
  static const int dim[] = {[CAV_EQUALITY_CONNECT] = 3,
                            [CAV_EQUALITY_WELD] = 6,
                            [CAV_EQUALITY_JOINT] = 1,
                            [CAV_EQUALITY_TENDON] = 1,
                            [CAV_EQUALITY_DISTANCE] = 1};
  const double none[4] = {1, 0, 0, 0};
  for (int i = 0; i < b->spec->equality.n && running(b); i++) {
    const cav_spec_equality *s = &b->spec->equality.at[i];
    cav_equality *e = &b->equality[i];
    *e = (cav_equality){.name = put_text(b, s->name),
                        .type = s->type,
                        .dim = dim[s->type],
                        .torquescale = s->torquescale,
                        .distance = s->distance,
                        .softness = s->softness};
    memcpy(e->coef, s->polycoef, sizeof e->coef);
    for (int k = 0; k < 2; k++) e->object[k] = find_tied(b, s, k);
    if (!running(b)) return;
    int bodies = s->type == CAV_EQUALITY_CONNECT || s->type == CAV_EQUALITY_WELD;
    for (int k = 0; k < 2 && (bodies || s->type == CAV_EQUALITY_DISTANCE); k++)
      e->link[k] = b->link_of[bodies ? e->object[k] : b->geom[e->object[k]].body];
    check_tied(b, s, e);
    if (!bodies) continue;
    // a connect has its anchor in the first body, a weld in the second; the rest of both follows at q0
    const cav_body *first = &b->body[e->object[0]], *second = &b->body[e->object[1]];
    double quat[4];
    memcpy(quat, s->relpose + 3, sizeof quat);
    if (s->type == CAV_EQUALITY_CONNECT) {
      to_link(first, s->anchor, none, e->pos[0], e->quat[0]);
    } else {
      to_link(second, s->anchor, none, e->pos[1], e->quat[1]);
      int given = quat[0] != 0 || quat[1] != 0 || quat[2] != 0 || quat[3] != 0;
      if (given) {
        quat_normalise(quat);
        to_link(first, s->relpose, quat, e->pos[0], e->quat[0]);
      }
    }
  }
}

static void fill_actuators(builder *b) {
  cav_spec *spec = b->spec;
  for (int i = 0; i < spec->actuator.n && running(b); i++) {
    const cav_spec_actuator *s = &spec->actuator.at[i];
    cav_actuator *a = &b->actuator[i];
    *a = (cav_actuator){.name = put_text(b, s->name)};
    cav_actuator_compile(spec, s, a);
    a->ctrllimited =
        limits(spec, s->node, "ctrllimited", "ctrlrange", s->ctrllimited, s->ctrlrange) && spec->option.clamp;
    a->forcelimited = limits(spec, s->node, "forcelimited", "forcerange", s->forcelimited, s->forcerange);
    a->actlimited = limits(spec, s->node, "actlimited", "actrange", s->actlimited, s->actrange);
    memcpy(a->ctrlrange, s->ctrlrange, sizeof a->ctrlrange);
    memcpy(a->actrange, s->actrange, sizeof a->actrange);
  }
}

// index of what a sensor looks at, or refers to
static int find_object(builder *b, const cav_spec_sensor *s, const char *attribute, cav_object_type type,
                       const char *name) {
  cav_spec *spec = b->spec;
  switch (type) {
#define FIND(object, list, attributes, text) \
  case CAV_OBJECT_##object:                  \
    return resolve(spec, s->node, attribute, text, name, TABLE(spec->list));
    CAV_OBJECTS(FIND)
#undef FIND
    case CAV_OBJECT_TYPES:
      break;
  }
  return -1;
}

// a joint or tendon of the kind that a sensor needs
static void check_sensor(builder *b, const cav_spec_sensor *s, int object) {
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

static void fill_sensors(builder *b) {
  cav_model *m = b->model;
  m->nsensordata = 0;
  for (int i = 0; i < m->nsensor && running(b); i++) {
    const cav_spec_sensor *s = &b->spec->sensor.at[i];
    const cav_sensor_rule *rule = cav_sensor_rule_of(s->type);
    cav_sensor *x = &b->sensor[i];
    *x = (cav_sensor){.name = put_text(b, s->name),
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
    if (running(b)) check_sensor(b, s, x->object);
    x->referred = s->reference != NULL;
    if (!x->referred) continue;
    x->reference_type = s->reference_type;
    x->reference = find_object(b, s, "refname", s->reference_type, s->reference);
  }
}

// the list of filter.c, and which pairs are not two parts of one body
static void fill_pairs(builder *b) {
  const cav_model *m = b->model;
  for (int i = 0; i < m->npair; i++) {
    b->pair[i] = b->pairs[i];
    int one = b->geom[b->pair[i].geom1].link, other = b->geom[b->pair[i].geom2].link;
    b->pair[i].external = one == 0 || other == 0 || b->link[one].root != b->link[other].root;
  }
}

// keyframes are of the model's own coordinates; those of a scene come after them and stay where they stand
static void fill_keys(builder *b) {
  cav_spec *spec = b->spec;
  const cav_model *m = b->model;
  double *at = b->keys;
  int nq = m->nq, nv = m->nv;
  for (int k = m->njoint - 1; k >= 0 && spec->joint.at[k].body >= spec->own_bodies; k--)
    nq = b->joint[k].q, nv = b->joint[k].dof;
  for (int i = 0; i < m->nkey; i++) {
    const cav_spec_key *s = &spec->key.at[i];
    if (s->nq && s->nq != nq)
      cav_spec_fail(spec, s->node, "qpos", "expected %d numbers, one per coordinate, got %d", nq, s->nq);
    if (s->nv && s->nv != nv)
      cav_spec_fail(spec, s->node, "qvel", "expected %d numbers, one per degree of freedom, got %d", nv, s->nv);
    if (!running(b)) return;
    double *q = at, *v = at + m->nq;
    at += m->nq + m->nv;
    memcpy(q, b->q0, (size_t)m->nq * sizeof *q);
    if (s->nq) memcpy(q, s->q, (size_t)nq * sizeof *q);
    if (s->nv) memcpy(v, s->v, (size_t)nv * sizeof *v);
    for (int k = 0; k < m->njoint; k++) {
      const cav_joint *j = &b->joint[k];
      if (j->type == CAV_JOINT_FREE) quat_normalise(q + j->q + 3);
      if (j->type == CAV_JOINT_BALL) quat_normalise(q + j->q);
    }
    b->key[i] = (cav_key){put_text(b, s->name), s->time, q, v};
  }
}

// --- the whole ---

static void set_options(builder *b) {
  const cav_spec_option *o = &b->spec->option;
  cav_model *m = b->model;
  m->timestep = o->timestep;
  m->fused = b->spec->compiler.fuse;
  copy3(m->gravity, o->gravity);
  m->density = o->density;
  m->viscosity = o->viscosity;
  copy3(m->wind, o->wind);
  copy3(m->magnetic, o->magnetic);
  m->options = (cav_options){.timestep = o->timestep,
                             .order = CAV_ORDER_EULER,
                             .stabilisation = CAV_STABILISATION_SOLREF,
                             .regulariser = CAV_REGULARISER_REFERENCE,
                             .softness = 1e-3,
                             .impratio = o->impratio,
                             .self_stiffness = 1,
                             .refsafe = o->refsafe,
                             .contact = o->contact,
                             .constraint = o->constraint,
                             .gravity = o->weight,
                             .passive = o->passive};
}

static void count(builder *b) {
  const cav_spec *spec = b->spec;
  cav_model *m = b->model;
#define COUNT(list, ...) m->n##list = spec->list.n;
  NAMED_OBJECTS(COUNT)
#undef COUNT
  m->nu = m->nactuator;
  m->ntendon_part = spec->part.n;
  m->ntendon_path = spec->path.n;
  const struct {
    int n;
    const char *what;
  } counts[] = {
#define AT_MOST(list, what) {spec->list.n, what},
      NAMED_OBJECTS(AT_MOST)
#undef AT_MOST
          {spec->part.n, "tendon parts"},
      {spec->path.n, "elements of tendon paths"},
      {spec->pair.n, "pairs"},
      {spec->exclude.n, "excludes"}};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
    if (counts[i].n > CAV_SPEC_OBJECTS)
      cav_spec_fail(b->spec, spec->body.at[0].node, NULL, "%d %s; at most %d are read", counts[i].n, counts[i].what,
                    CAV_SPEC_OBJECTS);
  }
}

static void fill(builder *b) {
  b->model->name = put_text(b, b->spec->name);
  fill_bodies(b);
  fill_link_frames(b);
  fill_link_inertias(b);
  check_link_inertias(b);
  fill_joints(b);
  fill_geoms(b);
  fill_sites(b);
  fill_tendons(b);
  if (running(b)) fill_equalities(b);
  if (running(b)) fill_actuators(b);
  if (running(b)) fill_sensors(b);
  if (running(b)) fill_keys(b);
  set_options(b);
  fill_pairs(b);
  for (int i = 0; i < b->model->nwarning; i++) b->warning[i] = put_text(b, b->spec->warning.at[i]);
}

// numbers that are finite in the file may not be so together
static void check_results(builder *b) {
  cav_spec *spec = b->spec;
  const cav_model *m = b->model;
  for (int i = 0; i < m->nbody; i++) check_finite(spec, spec->body.at[i].node, m->body[i].inverse_weight, 2);
  for (int i = 0; i < m->nv; i++)
    check_finite(spec, spec->joint.at[m->dof[i].joint].node, &m->dof[i].inverse_weight, 1);
  for (int i = 0; i < m->ntendon; i++) {
    check_finite(spec, spec->tendon.at[i].node, &m->tendon[i].inverse_weight, 1);
    check_finite(spec, spec->tendon.at[i].node, &m->tendon[i].springlength, 1);
  }
}

// a time constant that the refsafe guard raises to two time steps
static int is_guarded(const builder *b, const double solref[2]) {
  return solref[0] > 0 && solref[0] < 2 * b->spec->option.timestep;
}

// the refsafe guard acts visibly: one warning for each kind of constraint, naming the first
static void warn_guarded(builder *b) {
  cav_spec *spec = b->spec;
  const double least = 2 * spec->option.timestep;
  const cav_spec_joint *joint = NULL;
  const cav_spec_tendon *tendon = NULL;
  const cav_spec_equality *eq = NULL;
  const cav_pair *pair = NULL;
  if (!spec->option.refsafe || !spec->option.constraint) return;
  for (int i = spec->joint.n - 1; i >= 0; i--) {
    const cav_spec_joint *s = &spec->joint.at[i];
    int rubs = s->frictionloss > 0 && spec->option.frictionloss && is_guarded(b, s->friction.solref);
    int turns = s->type == CAV_JOINT_BALL && spec->option.limit && (s->has_twist || s->has_swing);
    if (rubs || (is_guarded(b, s->limit.solref) && (turns || joint_limits(spec, s)))) joint = s;
  }
  for (int i = spec->tendon.n - 1; i >= 0; i--) {
    const cav_spec_tendon *s = &spec->tendon.at[i];
    int rubs = s->frictionloss > 0 && spec->option.frictionloss && is_guarded(b, s->friction.solref);
    if (rubs || (is_guarded(b, s->limit.solref) && spec->option.limit &&
                 limits(spec, s->node, "limited", "range", s->limited, s->range)))
      tendon = s;
  }
  for (int i = spec->equality.n - 1; i >= 0; i--) {
    if (is_guarded(b, spec->equality.at[i].softness.solref)) eq = &spec->equality.at[i];
  }
  for (int i = b->model->npair - 1; i >= 0; i--) {
    if (is_guarded(b, b->pairs[i].softness.solref)) pair = &b->pairs[i];
  }
  static const char text[] =
      "solref asks for less than two time steps (%s%.60s): raised to %g s here and elsewhere; take a smaller timestep, "
      "or set the flag refsafe to disable";
  if (joint) cav_spec_warn(spec, joint->node, NULL, text, "joint ", joint->name, least);
  if (tendon) cav_spec_warn(spec, tendon->node, NULL, text, "tendon ", tendon->name, least);
  if (eq) cav_spec_warn(spec, eq->node, NULL, text, "equality constraint ", eq->name, least);
  if (pair)
    cav_spec_warn(spec, spec->geom.at[pair->geom2].node, NULL, text, "contacts of ", spec->geom.at[pair->geom2].name,
                  least);
}

// lengths between which muscles work
static void find_strokes(builder *b) {
  int i = cav_length_range_fill(b->model);
  if (i == b->model->nactuator && i > 0) cav_spec_no_memory(b->spec);
  if (i >= 0 && i < b->model->nactuator)
    cav_spec_fail(b->spec, b->spec->actuator.at[i].node, "lengthrange",
                  "is missing, and the joints let this muscle become as long or as short as it likes; give it");
}

static cav_model *build(builder *b) {
  cav_spec *spec = b->spec;
  count(b);
  if (running(b)) check_names(spec);
  if (running(b)) find_links(b);
  if (running(b)) cav_spec_tendon_paths(spec);
  if (running(b)) b->model->ntendon_dof = list_tendon_dofs(b, NULL);
  if (running(b)) b->pairs = cav_filter_pairs(spec, b->weld, b->link_of, &b->model->npair);
  if (running(b)) warn_guarded(b);
  if (!running(b)) return NULL;
  b->model->nwarning = spec->warning.n;
  carver c = {NULL, 0};
  carve_model(b, &c);
  b->model->bytes = c.used;
  c = (carver){calloc(1, c.used), 0};
  if (!c.base) {
    cav_spec_no_memory(spec);
    return NULL;
  }
  carve_model(b, &c);
  assert(c.used == b->model->bytes);
  fill(b);
  publish_arrays(b);
  assert(!running(b) || b->text == b->text_end);
  if (running(b)) {
    cav_status status = cav_reference_weights(b->model);
    if (status == CAV_NO_MEMORY)
      cav_spec_no_memory(spec);
    else if (status != CAV_OK)
      cav_spec_fail(spec, spec->body.at[0].node, NULL,
                    "the inertia matrix is singular in the posture of the file; check masses, axes and armature");
    else
      check_results(b);
    if (running(b)) find_strokes(b);
  }
  if (running(b)) return b->model;
  free(b->model);
  return NULL;
}

cav_model *cav_compile(cav_spec *spec) {
  cav_model measured = {0};
  builder b = {.spec = spec, .model = &measured};
  cav_model *model = NULL;
  if (spec->status == CAV_OK) cav_spec_assets(spec);
  if (spec->status == CAV_OK) cav_spec_masses(spec);
  b.weld = calloc((size_t)spec->body.n + 1, sizeof *b.weld);
  b.link_of = calloc((size_t)spec->body.n + 1, sizeof *b.link_of);
  if (!b.weld || !b.link_of)
    cav_spec_no_memory(spec);
  else if (spec->status == CAV_OK)
    model = build(&b);
  free(b.weld);
  free(b.link_of);
  free(b.pairs);
  return model;
}
