/// Models of another size: every link scaled by a factor of its own, as a subject's segments are. What is fixed to a
/// link (joints, geoms, sites, centres of mass) goes away from the anchor of its first joint by that factor; that
/// anchor is a point of the parent, and goes with the parent's. The mass of all goes with its volume; that of a link stays
/// the same fraction of it, as tables of segments have it, since a longer segment is seldom thicker. What is not of a size
/// stays: ranges, springs, dampers, armature, contact
/// parameters. Strength is another matter.
#include <math.h>
#include <stdio.h>

#include "compile.h"
#include "edit.h"
#include "math3.h"

static void stretch(double *x, int n, double factor) {
  for (int i = 0; i < n; i++) x[i] *= factor;
}

cav_status cav_model_resizable(const cav_model *m, cav_error *error) {
  const char *why = NULL;
  for (int g = 0; g < m->ngeom; g++)
    if (m->geom[g].link && m->geom[g].type >= CAV_GEOM_MESH) why = "a mesh that moves";
  for (int t = 0; t < m->ntendon; t++)
    if (m->tendon[t].npath) why = "a tendon along a path, whose length at rest is not known then";
  for (int e = 0; e < m->nequality; e++)
    if (m->equality[e].type != CAV_EQUALITY_JOINT) why = "an equality constraint of bodies, tendons or geoms";
  if (!why) return CAV_OK;
  if (error) {
    error->status = CAV_NOT_SUPPORTED;
    snprintf(error->text, sizeof error->text,
             "sizes of segments: the model has %s, which is not scaled; fit it as it is, or scale its file", why);
  }
  return CAV_NOT_SUPPORTED;
}

// the first joint's anchor stays where the parent, scaled, has it
static void place_link(const cav_model *m, cav_link *link, double parent, double own) {
  double anchor[3] = {0};
  if (m->joint[link->joint].type == CAV_JOINT_FREE) return;
  quat_rotate(anchor, link->quat, m->joint[link->joint].pos);
  for (int k = 0; k < 3; k++) link->pos[k] = parent * (link->pos[k] + anchor[k]) - own * anchor[k];
}

// by how much the mass of all grows
static double growth(const cav_model *m, const double *factor) {
  double mass = 0;
  for (int i = 1; i < m->nlink; i++) mass += m->link[i].mass * pow(factor[i], 3);
  return mass / m->mass;
}

static void resize_links(cav_model *model, const double *factor, double heavier) {
  cav_link *link = (cav_link *)model->link;
  cav_joint *joint = (cav_joint *)model->joint;
  for (int i = 1; i < model->nlink; i++) {
    double s = factor[i];
    place_link(model, &link[i], factor[link[i].parent], s);
    stretch(link[i].com, 3, s);
    link[i].mass *= heavier;
    stretch(link[i].inertia, 6, heavier * s * s);
  }
  model->mass *= heavier;
  for (int j = 0; j < model->njoint; j++) stretch(joint[j].pos, 3, factor[joint[j].link]);
}

static void resize_objects(cav_model *model, const double *factor, double heavier) {
  cav_body *body = (cav_body *)model->body;
  cav_geom *geom = (cav_geom *)model->geom;
  cav_site *site = (cav_site *)model->site;
  for (int i = 1; i < model->nbody; i++) {
    double s = factor[body[i].link];
    stretch(body[i].pos, 3, s);
    if (!body[i].link) continue;
    stretch(body[i].com, 3, s);
    body[i].mass *= heavier;
    stretch(body[i].inertia, 3, heavier * s * s);
  }
  for (int i = 0; i < model->ngeom; i++) {
    double s = factor[geom[i].link];
    stretch(geom[i].pos, 3, s);
    if (!geom[i].link) continue;
    stretch(geom[i].size, 3, s);
    geom[i].bound *= s;
  }
  for (int i = 0; i < model->nsite; i++) {
    stretch(site[i].pos, 3, factor[site[i].link]);
    stretch(site[i].size, 3, factor[site[i].link]);
  }
}

void cav_model_strengthen(cav_model *model, double factor) {
  cav_actuator *actuator = (cav_actuator *)model->actuator;
  cav_joint *joint = (cav_joint *)model->joint;
  for (int i = 0; i < model->nactuator; i++) {
    int motor = actuator[i].gain == CAV_GAIN_FIXED && actuator[i].bias == CAV_BIAS_NONE;
    if (motor) stretch(actuator[i].gear, 6, factor);
  }
  for (int j = 0; j < model->njoint; j++) stretch(joint[j].effort_range, 2, factor);
}

cav_status cav_model_resize(cav_model *model, const double *factor) {
  if (factor[0] != 1) return CAV_BAD_INPUT;
  for (int i = 1; i < model->nlink; i++)
    if (!(factor[i] > 0) || !isfinite(factor[i])) return CAV_BAD_INPUT;
  double heavier = growth(model, factor);
  resize_links(model, factor, heavier);
  resize_objects(model, factor, heavier);
  return cav_reference_weights(model);
}
