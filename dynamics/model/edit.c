/// Models pushed away from their file for measurements of where their numbers break. A model is one block of memory
/// that begins with it (compile.c), so a copy of the block is enough to come back to it. Not scaled by cav_model_scale:
/// media, gains of actuators, cutoffs of sensors.
#include "edit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "compile.h"
#include "math3.h"

void *cav_model_keep(const cav_model *model) {
  void *kept = malloc(model->bytes);
  if (kept) memcpy(kept, model, model->bytes);
  return kept;
}

void cav_model_return(cav_model *model, const void *kept) { memcpy(model, kept, model->bytes); }

// the arrays of a model, to be written
#define WRITE(type, name) ((type *)model->name)

static void stretch(double *x, int n, double factor) {
  for (int i = 0; i < n; i++) x[i] *= factor;
}

// the width of an impedance is a length of what it holds
static void stretch_softness(cav_softness *softness, double factor) { softness->solimp[2] *= factor; }

static int slides(const cav_joint *joint) { return joint->type == CAV_JOINT_SLIDE; }

static void scale_bodies(cav_model *model, double s) {
  cav_body *body = WRITE(cav_body, body);
  cav_link *link = WRITE(cav_link, link);
  const double cube = s * s * s, fifth = cube * s * s;
  for (int i = 0; i < model->nbody; i++) {
    stretch(body[i].pos, 3, s);
    stretch(body[i].com, 3, s);
    body[i].mass *= cube;
    stretch(body[i].inertia, 3, fifth);
  }
  for (int i = 0; i < model->nlink; i++) {
    stretch(link[i].pos, 3, s);
    stretch(link[i].com, 3, s);
    link[i].mass *= cube;
    stretch(link[i].inertia, 6, fifth);
  }
  model->mass *= cube;
}

static void scale_joints(cav_model *model, double s) {
  cav_joint *joint = WRITE(cav_joint, joint);
  cav_dof *dof = WRITE(cav_dof, dof);
  double *q0 = WRITE(double, q0);
  const double cube = s * s * s, fourth = cube * s, fifth = fourth * s;
  for (int i = 0; i < model->njoint; i++) {
    cav_joint *j = &joint[i];
    stretch(j->pos, 3, s);
    if (j->type == CAV_JOINT_FREE) stretch(q0 + j->q, 3, s);
    j->stiffness *= slides(j) ? cube : fifth;
    stretch(j->effort_range, 2, slides(j) ? fourth : fifth);
    if (!slides(j)) continue;
    double *lengths[] = {&j->ref, &j->range[0], &j->range[1], &j->margin, &j->springref, &q0[j->q]};
    for (size_t k = 0; k < sizeof lengths / sizeof *lengths; k++) *lengths[k] *= s;
    stretch_softness(&j->limit, s);
  }
  for (int i = 0; i < model->nv; i++) {
    const int along =
        slides(&joint[dof[i].joint]) || (joint[dof[i].joint].type == CAV_JOINT_FREE && i < joint[dof[i].joint].dof + 3);
    dof[i].damping *= along ? cube : fifth;
    dof[i].armature *= along ? cube : fifth;
    dof[i].frictionloss *= along ? fourth : fifth;
  }
}

static void scale_shapes(cav_model *model, double s) {
  cav_geom *geom = WRITE(cav_geom, geom);
  cav_site *site = WRITE(cav_site, site);
  cav_pair *pair = WRITE(cav_pair, pair);
  for (int i = 0; i < model->ngeom; i++) {
    stretch(geom[i].pos, 3, s);
    stretch(geom[i].size, 3, s);
    stretch(geom[i].friction + 1, 2, s);
    geom[i].bound *= s, geom[i].margin *= s;
    stretch_softness(&geom[i].softness, s);
  }
  for (int i = 0; i < model->nsite; i++) {
    stretch(site[i].pos, 3, s);
    stretch(site[i].size, 3, s);
  }
  for (int i = 0; i < model->npair; i++) {
    stretch(pair[i].friction + 2, 3, s);
    pair[i].margin *= s;
    stretch_softness(&pair[i].softness, s);
  }
  for (int i = 0; i < model->nmesh; i++) {
    const cav_mesh *mesh = &model->mesh[i];
    stretch((double *)mesh->vertex, 3 * mesh->nvertex, s);
    for (int k = 0; k < mesh->nface; k++) ((double *)mesh->plane)[4 * k + 3] *= s;
  }
  for (int i = 0; i < model->nhfield; i++) {
    cav_hfield *field = (cav_hfield *)&model->hfield[i];
    stretch(field->size, 2, s);
    field->top *= s, field->base *= s;
    stretch((double *)field->height, field->nrow * field->ncol, s);
  }
}

static void scale_attachments(cav_model *model, double s) {
  cav_tendon *tendon = WRITE(cav_tendon, tendon);
  cav_equality *equality = WRITE(cav_equality, equality);
  cav_actuator *actuator = WRITE(cav_actuator, actuator);
  const double cube = s * s * s;
  for (int i = 0; i < model->ntendon; i++) {
    cav_tendon *t = &tendon[i];
    // the length of a fixed tendon over hinges is an angle
    if (!t->npath) {
      t->stiffness *= cube * s * s, t->damping *= cube * s * s, t->frictionloss *= cube * s * s;
      continue;
    }
    stretch(t->range, 2, s);
    stretch(t->springlength, 2, s);
    t->margin *= s, t->stiffness *= cube, t->damping *= cube, t->frictionloss *= cube * s;
    stretch_softness(&t->limit, s);
  }
  for (int i = 0; i < model->nequality; i++) {
    cav_equality *e = &equality[i];
    stretch(&e->pos[0][0], 6, s);
    e->torquescale *= s, e->distance *= s;
    if (e->type != CAV_EQUALITY_JOINT && e->type != CAV_EQUALITY_TENDON) stretch_softness(&e->softness, s);
  }
  for (int i = 0; i < model->nactuator; i++) actuator[i].cranklength *= s;
}

cav_status cav_model_scale(cav_model *model, double factor) {
  if (!(factor > 0) || !isfinite(factor)) return CAV_BAD_INPUT;
  scale_bodies(model, factor);
  scale_joints(model, factor);
  scale_shapes(model, factor);
  scale_attachments(model, factor);
  return cav_reference_weights(model);
}

void cav_model_move(cav_model *model, const double by[3]) {
  cav_link *link = WRITE(cav_link, link);
  cav_joint *joint = WRITE(cav_joint, joint);
  cav_body *body = WRITE(cav_body, body);
  cav_geom *geom = WRITE(cav_geom, geom);
  cav_site *site = WRITE(cav_site, site);
  for (int i = 1; i < model->nlink; i++)
    if (link[i].parent == 0) add3(link[i].pos, link[i].pos, by);
  for (int i = 0; i < model->njoint; i++)
    if (joint[i].type == CAV_JOINT_FREE) add3(WRITE(double, q0) + joint[i].q, WRITE(double, q0) + joint[i].q, by);
  for (int i = 1; i < model->nbody; i++)
    if (body[i].link == 0) add3(body[i].pos, body[i].pos, by);
  for (int i = 0; i < model->ngeom; i++)
    if (geom[i].link == 0) add3(geom[i].pos, geom[i].pos, by);
  for (int i = 0; i < model->nsite; i++)
    if (site[i].link == 0) add3(site[i].pos, site[i].pos, by);
  for (int i = 0; i < model->nequality; i++)
    for (int k = 0; k < 2; k++) {
      cav_equality *e = &WRITE(cav_equality, equality)[i];
      const int placed = e->type == CAV_EQUALITY_CONNECT || e->type == CAV_EQUALITY_WELD;
      if (placed && e->link[k] == 0) add3(e->pos[k], e->pos[k], by);
    }
}

// largest of a joint's inverse weights, 1/kg or 1/(kg m^2)
static double joint_weight(const cav_model *model, const cav_joint *joint) {
  const int n = joint->type == CAV_JOINT_FREE ? 6 : joint->type == CAV_JOINT_BALL ? 3 : 1;
  double most = 0;
  for (int k = 0; k < n; k++) most = fmax(most, model->dof[joint->dof + k].inverse_weight);
  return most;
}

static void take_larger(double *most, const char **name, double rate, const char *of) {
  if (!(rate > *most)) return;
  *most = rate;
  if (name) *name = of;
}

double cav_model_stiffest(const cav_model *model, double time, const char **name) {
  double most = 0;
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    const double weight = joint_weight(model, joint), damped = time * model->dof[joint->dof].damping;
    take_larger(&most, name, joint->stiffness * weight / (1 + damped * weight), joint->name);
  }
  for (int i = 0; i < model->ntendon; i++)
    take_larger(&most, name, model->tendon[i].stiffness * model->tendon[i].inverse_weight, model->tendon[i].name);
  return most;
}

double cav_model_most_damped(const cav_model *model, const char **name) {
  double most = 0;
  for (int i = 0; i < model->nv; i++)
    take_larger(&most, name, model->dof[i].damping * model->dof[i].inverse_weight,
                model->joint[model->dof[i].joint].name);
  for (int i = 0; i < model->ntendon; i++)
    take_larger(&most, name, model->tendon[i].damping * model->tendon[i].inverse_weight, model->tendon[i].name);
  return most;
}

// what a spring or damper can be added to
static int takes_more(const cav_model *model, const cav_joint *joint) {
  return joint->type != CAV_JOINT_FREE && joint_weight(model, joint) > 0;
}

void cav_model_scale_friction(cav_model *model, double factor) {
  cav_geom *geom = WRITE(cav_geom, geom);
  cav_pair *pair = WRITE(cav_pair, pair);
  for (int i = 0; i < model->ngeom; i++) geom[i].friction[0] *= factor;
  for (int i = 0; i < model->npair; i++) pair[i].friction[0] *= factor, pair[i].friction[1] *= factor;
}

int cav_model_set_stiffest(cav_model *model, double rate) {
  cav_joint *joint = WRITE(cav_joint, joint);
  cav_tendon *tendon = WRITE(cav_tendon, tendon);
  const double most = cav_model_stiffest(model, 0, NULL);
  int n = most > 0;
  model->options.passive = 1;
  for (int i = 0; i < model->njoint; i++) {
    if (most > 0) joint[i].stiffness *= rate / most;
    if (most > 0 || !takes_more(model, &joint[i])) continue;
    joint[i].stiffness = rate / joint_weight(model, &joint[i]);
    if (joint[i].type != CAV_JOINT_BALL) joint[i].springref = model->q0[joint[i].q];
    n++;
  }
  for (int i = 0; i < model->ntendon && most > 0; i++) tendon[i].stiffness *= rate / most;
  return n > 0;
}

int cav_model_set_most_damped(cav_model *model, double rate) {
  cav_dof *dof = WRITE(cav_dof, dof);
  cav_tendon *tendon = WRITE(cav_tendon, tendon);
  const double most = cav_model_most_damped(model, NULL);
  int n = most > 0;
  model->options.passive = 1;
  for (int i = 0; i < model->nv; i++) {
    if (most > 0) dof[i].damping *= rate / most;
    if (most > 0 || !takes_more(model, &model->joint[dof[i].joint])) continue;
    dof[i].damping = rate / dof[i].inverse_weight;
    n++;
  }
  for (int i = 0; i < model->ntendon && most > 0; i++) tendon[i].damping *= rate / most;
  return n > 0;
}

static void set_solref(cav_softness *softness, double time_constant) {
  softness->solref[0] = time_constant;
  softness->solref[1] = 1;
}

void cav_model_set_solref(cav_model *model, double time_constant) {
  for (int i = 0; i < model->njoint; i++) set_solref(&WRITE(cav_joint, joint)[i].limit, time_constant);
  for (int i = 0; i < model->nv; i++) set_solref(&WRITE(cav_dof, dof)[i].friction, time_constant);
  for (int i = 0; i < model->npair; i++) set_solref(&WRITE(cav_pair, pair)[i].softness, time_constant);
  for (int i = 0; i < model->ntendon; i++) {
    set_solref(&WRITE(cav_tendon, tendon)[i].limit, time_constant);
    set_solref(&WRITE(cav_tendon, tendon)[i].friction, time_constant);
  }
  for (int i = 0; i < model->nequality; i++) set_solref(&WRITE(cav_equality, equality)[i].softness, time_constant);
}
