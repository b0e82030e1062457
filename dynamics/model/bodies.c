/// Bodies, links, joints, geoms and sites of a model. Bodies without joints are fused into the link they stand on:
/// mass, centre and inertia add up, and geoms, sites and body frames are re-expressed in its frame. Ranges: whether
/// they hold.
#include <stdlib.h>

#include "builder.h"
#include "math3.h"

static const int joint_q[] = {[CAV_JOINT_FREE] = 7, [CAV_JOINT_BALL] = 4, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};

// --- limits ---

// whether a range holds, by what is said of it; an inverted one cannot
int cav_builder_limits(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *range_name,
                       cav_limited limited, const double range[2]) {
  int given = range[0] != 0 || range[1] != 0, holds = limited == CAV_LIMITED_YES;
  if (limited == CAV_LIMITED_AUTO && given) {
    if (cav_compiler_of(spec, node)->autolimits == 0)
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
    dofs += cav_builder_dofs(j->type);
    if (j->type != CAV_JOINT_FREE) continue;
    if (body->parent != 0)
      cav_spec_fail(spec, j->node, NULL,
                    "a free joint is for bodies right in the world; '%.60s' is inside another body", body->name);
    if (body->njoint > 1) cav_spec_fail(spec, j->node, NULL, "a free joint stands alone; remove the other joints");
  }
  if (dofs > 6) cav_spec_fail(spec, body->node, NULL, "%d degrees of freedom on one body; at most 6 move it", dofs);
}

void cav_builder_links(cav_builder *b) {
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
    m->nv += cav_builder_dofs(spec->joint.at[i].type);
  }
  if (m->nv > CAV_SPEC_DOFS)
    cav_spec_fail(spec, spec->body.at[0].node, NULL, "%d degrees of freedom; at most %d are read", m->nv,
                  CAV_SPEC_DOFS);
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

// fraction of a body's weight that is taken off; where all joints that carry it give that by their actuators, nothing
static double buoyancy(cav_builder *b, int body) {
  const cav_spec *spec = b->spec;
  const cav_spec_body *s = &spec->body.at[body];
  int passive = 0, first = 0;
  for (int i = body; i > 0 && s->gravcomp != 0; i = spec->body.at[i].parent) {
    const cav_spec_body *up = &spec->body.at[i];
    for (int k = up->joint; k < up->joint + up->njoint; k++) passive |= !spec->joint.at[k].gravcomp;
    const cav_spec_joint *j = &spec->joint.at[up->joint];
    if (up->njoint > 0) first = j->gravcomp && j->type == CAV_JOINT_FREE;
  }
  if (passive && first)
    cav_spec_fail(b->spec, s->node, "gravcomp",
                  "the free joint that carries this body has actuatorgravcomp and a later one has not, which is not "
                  "supported; give it to all or to none");
  return passive ? s->gravcomp : 0;
}

static void fill_bodies(cav_builder *b) {
  const cav_spec *spec = b->spec;
  for (int i = 0; i < spec->body.n; i++) {
    const cav_spec_body *s = &spec->body.at[i];
    cav_body *x = &b->body[i];
    *x = (cav_body){.name = cav_builder_text(b, s->name),
                    .parent = s->parent,
                    .link = b->link_of[i],
                    .geom = s->geom,
                    .ngeom = s->ngeom,
                    .mass = s->inertia.mass,
                    .buoyancy = buoyancy(b, i)};
    copy3(x->com, s->inertia.com);
    copy3(x->inertia, s->inertia.moment);
    memcpy(x->iquat, s->inertia.quat, sizeof x->iquat);
    place_body(spec, b->body, i);
  }
}

// pose in a body's frame into its link's
void cav_builder_to_link(const cav_body *body, const double pos[3], const double quat[4], double link_pos[3],
                         double link_quat[4]) {
  quat_rotate(link_pos, body->quat, pos);
  add3(link_pos, link_pos, body->pos);
  quat_mul(link_quat, body->quat, quat);
  quat_normalise(link_quat);
}

static void fill_link_frames(cav_builder *b) {
  const cav_spec *spec = b->spec;
  b->link[0] = (cav_link){.parent = -1, .quat = {1, 0, 0, 0}};
  for (int i = 1; i < spec->body.n; i++) {
    const cav_spec_body *s = &spec->body.at[i];
    if (!s->njoint) continue;
    int index = b->link_of[i], parent = b->link_of[s->parent];
    cav_link *l = &b->link[index];
    *l = (cav_link){.body = i, .parent = parent, .joint = s->joint, .njoint = s->njoint};
    l->root = parent ? b->link[parent].root : index;
    cav_builder_to_link(&b->body[s->parent], s->pos, s->quat, l->pos, l->quat);
  }
}

// mass, centre and inertia of all bodies of each link: first the sums, then moments about the common centre
static void fill_link_inertias(cav_builder *b) {
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
    cav_builder_to_link(x, x->com, x->iquat, pos, quat);
    quat_matrix(R, quat);
    symmetric_rotate(W, R, S);
    sub3(pos, pos, l->com);
    for (int k = 0; k < 3; k++) l->inertia[k] += W[k] + x->mass * (dot3(pos, pos) - pos[k] * pos[k]);
    l->inertia[3] += W[3] - x->mass * pos[0] * pos[1];
    l->inertia[4] += W[4] - x->mass * pos[0] * pos[2];
    l->inertia[5] += W[5] - x->mass * pos[1] * pos[2];
  }
}

// what moves has weight, and what turns has inertia, of its own or by what it carries
static void check_link_inertias(cav_builder *b) {
  double *carried = calloc(2 * (size_t)b->model->nlink, sizeof *carried);
  if (!carried) {
    cav_spec_no_memory(b->spec);
    return;
  }
  for (int i = b->model->nlink - 1; i > 0; i--) {
    const cav_link *l = &b->link[i];
    carried[2 * i] += l->mass;
    carried[2 * i + 1] += l->inertia[0] + l->inertia[1] + l->inertia[2];
    for (int k = 0; k < 2; k++) carried[2 * l->parent + k] += carried[2 * i + k];
  }
  for (int i = 0; i < b->model->nlink; i++) {
    const cav_link *l = &b->link[i];
    const cav_xml_node *node = b->spec->body.at[l->body].node;
    cav_builder_finite(b->spec, node, l->com, 3);
    cav_builder_finite(b->spec, node, l->inertia, 6);
    if (i == 0) continue;
    if (!(carried[2 * i] > 1e-15))
      cav_spec_fail(b->spec, node, NULL, "moves but has no mass; give it a geom with mass, or an inertial element");
    if (!(carried[2 * i + 1] > 3e-15))
      cav_spec_fail(b->spec, node, NULL, "moves but has no inertia; give its geoms a size or it an inertial element");
    b->model->mass += l->mass;
  }
  free(carried);
}

int cav_builder_joint_limits(cav_spec *spec, const cav_spec_joint *s) {
  if (s->type == CAV_JOINT_FREE) return 0;
  int holds = cav_builder_limits(spec, s->node, "limited", "range", s->limited, s->range);
  if (holds && s->type == CAV_JOINT_BALL && s->range[0] != 0)
    cav_spec_fail(spec, s->node, "range", "a ball joint's range starts at 0, got %g", s->range[0]);
  return holds && spec->option.limit;
}

// the cylinder of a ball joint, an attribute of our own: within what a rotation vector can be
static void fill_cylinder(cav_builder *b, const cav_spec_joint *s, cav_joint *j) {
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

static void fill_joint(cav_builder *b, int i, int q, int dof) {
  cav_spec *spec = b->spec;
  const cav_spec_joint *s = &spec->joint.at[i];
  cav_joint *j = &b->joint[i];
  *j = (cav_joint){.name = cav_builder_text(b, s->name),
                   .type = s->type,
                   .body = s->body,
                   .link = b->link_of[s->body],
                   .q = q,
                   .dof = dof,
                   .margin = s->margin,
                   .limit = s->limit,
                   .lifts = s->gravcomp,
                   .stiffness = spec->option.spring ? s->stiffness : 0};
  int given = s->effort_range[0] != 0 || s->effort_range[1] != 0;
  j->effort_limited =
      cav_builder_is_scalar(s->type) && (s->effort == CAV_LIMITED_YES || (s->effort == CAV_LIMITED_AUTO && given));
  memcpy(j->effort_range, s->effort_range, sizeof j->effort_range);
  j->limited = cav_builder_joint_limits(spec, s);
  memcpy(j->range, s->range, sizeof j->range);
  set3(j->axis, 0, 0, 1);
  if (s->type != CAV_JOINT_FREE) copy3(j->pos, s->pos);
  fill_cylinder(b, s, j);
  if (cav_builder_is_scalar(s->type) || j->twist_limited || j->swing_limited) {
    copy3(j->axis, s->axis);
    if (!(normalise3(j->axis) > 1e-14))
      cav_spec_fail(spec, s->node, "axis", "expected a direction, got %g %g %g", s->axis[0], s->axis[1], s->axis[2]);
  }
  if (cav_builder_is_scalar(s->type)) {
    j->ref = s->ref;
    j->springref = s->springref;
    j->speed = s->speed;
  }
  cav_check_not_negative(spec, s->node, "stiffness", s->stiffness);
  cav_check_not_negative(spec, s->node, "damping", s->damping);
  cav_check_not_negative(spec, s->node, "armature", s->armature);
  cav_check_not_negative(spec, s->node, "frictionloss", s->frictionloss);
  cav_check_softness(spec, s->node, "limit", &s->limit);
  cav_check_softness(spec, s->node, "friction", &s->friction);
}

// coordinates of the file's posture: the body's place, no rotation, or ref
static void fill_q0(cav_builder *b, const cav_joint *j) {
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

static void fill_joints(cav_builder *b) {
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
    for (int k = 0; k < cav_builder_dofs(s->type); k++, dof++) {
      int parent = k ? dof - 1 : b->dof[dof].parent;
      b->dof[dof] = (cav_dof){.link = link,
                              .joint = i,
                              .parent = parent,
                              .damping = spec->option.damper ? s->damping : 0,
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

static void check_geom(cav_builder *b, const cav_spec_geom *s) {
  cav_spec *spec = b->spec;
  cav_check_condim(spec, s->node, s->condim);
  for (int i = 0; i < 3; i++) cav_check_not_negative(spec, s->node, "friction", s->friction[i]);
  cav_check_not_negative(spec, s->node, "solmix", s->solmix);
  cav_check_softness(spec, s->node, "", &s->softness);
  if (s->type == CAV_GEOM_PLANE && b->link_of[s->body] != 0)
    cav_spec_fail(spec, s->node, "type", "a plane cannot move; put it into the world or use a box");
  if (s->fluid && s->type >= CAV_GEOM_MESH && (spec->option.density > 0 || spec->option.viscosity > 0))
    cav_spec_fail(spec, s->node, "fluidshape",
                  "a mesh has no ellipsoid here; give the body a geom of another type for it");
}

static void fill_geoms(cav_builder *b) {
  cav_spec *spec = b->spec;
  for (int i = 0; i < spec->geom.n; i++) {
    const cav_spec_geom *s = &spec->geom.at[i];
    cav_geom *g = &b->geom[i];
    check_geom(b, s);
    *g = (cav_geom){.name = cav_builder_text(b, s->name),
                    .type = (cav_geom_type)s->type,
                    .body = s->body,
                    .link = b->link_of[s->body],
                    .number = s->number,
                    .contype = s->contype,
                    .conaffinity = s->conaffinity,
                    .condim = s->condim,
                    .priority = s->priority,
                    .margin = s->margin,
                    .solmix = s->solmix,
                    .softness = s->softness,
                    .fluid = s->fluid,
                    .group = s->group};
    cav_builder_to_link(&b->body[s->body], s->pos, s->quat, g->pos, g->quat);
    quat_matrix(g->rotation, g->quat);
    copy3(g->size, s->size);
    g->asset = s->type >= CAV_GEOM_MESH ? s->asset : 0;
    copy3(g->friction, s->friction);
    memcpy(g->fluidcoef, s->fluidcoef, sizeof g->fluidcoef);
    g->bound = s->type >= CAV_GEOM_MESH ? s->bound : bounding_radius(g);
    for (int k = 0; k < 4; k++) g->rgba[k] = (float)s->rgba[k];
  }
}

static void fill_sites(cav_builder *b) {
  for (int i = 0; i < b->spec->site.n; i++) {
    const cav_spec_site *s = &b->spec->site.at[i];
    cav_site *x = &b->site[i];
    *x = (cav_site){.name = cav_builder_text(b, s->name), .body = s->body, .link = b->link_of[s->body]};
    x->type = (cav_geom_type)s->type;
    copy3(x->size, s->size);
    for (int k = 0; k < 3; k++) cav_check_not_negative(b->spec, s->node, "size", s->size[k]);
    cav_builder_to_link(&b->body[s->body], s->pos, s->quat, x->pos, x->quat);
  }
}

void cav_builder_bodies(cav_builder *b) {
  fill_bodies(b);
  fill_link_frames(b);
  fill_link_inertias(b);
  check_link_inertias(b);
  fill_joints(b);
  fill_geoms(b);
  fill_sites(b);
}
