/// How near what passes over the world is to it. A foot that swings costs nothing wherever it does not touch, so an optimum
/// carries it as low as the tail of the contact law lets it, some millimetres at several metres a second, where whatever goes
/// a little otherwise trips (optim/METHOD.md, 4).
#include "clearance.h"

#include <math.h>

// m/s: contacts are sought as far as this leads in a step, and farther where the law is smoothed
static const double SOUGHT_SPEED = 5;
// of the height: what is deeper counts no more, so that what stands does not stand at the kink
static const double deepest = -0.1;

double cav_clearance_height(double timestep) { return fmin(CAV_CLEARANCE, SOUGHT_SPEED * timestep); }

// whether actuators move a link's tree, and none of them carries its root
static int floats(const cav_model *model, int link) {
  const cav_link *root = model->link + model->link[link].root;
  if (link == 0 || !model->link[link].driven) return 0;
  for (int j = root->joint; j < root->joint + root->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    if (!joint->driven && (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_SLIDE)) return 1;
  }
  return 0;
}

// planes of the world and height fields
static int is_ground(const cav_geom *geom) {
  return geom->link == 0 && (geom->type == CAV_GEOM_PLANE || geom->type == CAV_GEOM_HFIELD);
}

int cav_pair_clears(const cav_model *model, const cav_pair *pair) {
  const cav_geom *one = model->geom + pair->geom1, *two = model->geom + pair->geom2;
  return (is_ground(one) && floats(model, two->link)) || (is_ground(two) && floats(model, one->link));
}

double cav_clearance_nearness(double height, double gap, double *derivative) {
  const double x = fmin(fmax(gap / height, deepest), 1), left = 1 - x;
  if (derivative) *derivative = x > deepest ? -2 * left / height : 0;
  return left * left;
}
