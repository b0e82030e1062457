/// Models that differ a little from their file, for studies of robustness: masses of links scaled, sliding friction
/// replaced, and all that was derived from them at load derived anew. Inertia scales with mass: the shape stays.
/// Armature, damping, limits and torsional and rolling friction stay as they are.
#include <math.h>

#include "compile.h"
#include "step.h"

static void scale_mass(cav_model *model, const double *scale) {
  cav_link *link = (cav_link *)model->link;
  cav_body *body = (cav_body *)model->body;
  model->mass = 0;
  for (int i = 1; i < model->nlink; i++) {
    link[i].mass *= scale[i];
    for (int k = 0; k < 6; k++) link[i].inertia[k] *= scale[i];
    model->mass += link[i].mass;
  }
  for (int i = 1; i < model->nbody; i++) {
    if (body[i].link == 0) continue;
    body[i].mass *= scale[body[i].link];
    for (int k = 0; k < 3; k++) body[i].inertia[k] *= scale[body[i].link];
  }
}

static void set_friction(cav_model *model, double friction) {
  cav_geom *geom = (cav_geom *)model->geom;
  cav_pair *pair = (cav_pair *)model->pair;
  for (int i = 0; i < model->ngeom; i++) geom[i].friction[0] = friction;
  for (int i = 0; i < model->npair; i++) pair[i].friction[0] = pair[i].friction[1] = friction;
}

cav_status cav_model_perturb(cav_model *model, const double *mass_scale, double friction) {
  for (int i = 1; mass_scale && i < model->nlink; i++)
    if (!(mass_scale[i] > 0) || !isfinite(mass_scale[i])) return CAV_BAD_INPUT;
  if (!(friction >= 0) || !isfinite(friction)) return CAV_BAD_INPUT;
  if (mass_scale) scale_mass(model, mass_scale);
  if (friction > 0) set_friction(model, friction);
  return cav_reference_weights(model);
}
