/// Feet and the floor: where a marker of a foot stands still, near the lowest that it comes, the foot's lowest point is on
/// the floor; elsewhere it is not below. The floor is the plane z = 0 of the clip.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit.h"
#include "math3.h"
#include "role.h"

static const double still = 0.25; // m/s
static const double low = 0.06;   // m above the lowest place of a marker in the clip
static const double bend = 1e-6;  // of a direction, for the point of a geom that is farthest along it

// lowest point of a body's geoms at the state's position; zero: it has none
static int lowest_point(const cav_fit *fit, int body, double point[3]) {
  const cav_model *m = fit->model;
  double least = INFINITY, centre[3] = {0};
  cav_pose pose;
  int lowest = -1;
  for (int g = m->body[body].geom; g < m->body[body].geom + m->body[body].ngeom; g++) {
    cav_object_pose(m, fit->state, CAV_OBJECT_GEOM, g, &pose);
    double height = pose.pos[2] - cav_geom_reach(&m->geom[g], &pose, (const double[3]){0, 0, 1});
    if (height < least) least = height, lowest = g, copy3(centre, pose.pos);
  }
  if (lowest < 0) return 0;
  cav_object_pose(m, fit->state, CAV_OBJECT_GEOM, lowest, &pose);
  for (int k = 0; k < 2; k++) {
    double reach[2];
    for (int side = 0; side < 2; side++) {
      double n[3] = {0, 0, 1};
      n[k] = side ? bend : -bend;
      reach[side] = cav_geom_reach(&m->geom[lowest], &pose, n);
    }
    point[k] = centre[k] - (reach[1] - reach[0]) / (2 * bend);
  }
  point[2] = least;
  return 1;
}

// m/s of a marker of the fit at a frame; infinite where it is not seen on both sides
static double speed(const cav_fit *fit, int frame, int i) {
  int a = frame > 0 ? frame - 1 : frame, b = frame < fit->nframe - 1 ? frame + 1 : frame;
  const double *from = cav_fit_seen(fit, a, i), *to = cav_fit_seen(fit, b, i);
  double way[3];
  if (!from || !to || a == b) return INFINITY;
  sub3(way, to, from);
  return norm3(way) / ((b - a) * fit->step);
}

// lowest that a marker comes
static double bottom(const cav_fit *fit, int i) {
  double least = INFINITY;
  for (int t = 0; t < fit->nframe; t++) {
    const double *seen = cav_fit_seen(fit, t, i);
    if (seen) least = fmin(least, seen[2]);
  }
  return least;
}

cav_status cav_fit_floor(cav_fit *fit) {
  static const cav_role feet[] = {CAV_ROLE_RIGHT_FOOT,      CAV_ROLE_LEFT_FOOT,       CAV_ROLE_FRONT_RIGHT_FOOT,
                                  CAV_ROLE_FRONT_LEFT_FOOT, CAV_ROLE_BACK_RIGHT_FOOT, CAV_ROLE_BACK_LEFT_FOOT};
  cav_roles roles;
  cav_status status = cav_roles_find(fit->model, fit->state, &roles);
  if (status) return status;
  for (size_t k = 0; k < sizeof feet / sizeof *feet; k++)
    if (roles.body[feet[k]] >= 0) fit->foot[fit->nfoot++] = roles.body[feet[k]];
  fit->stands = calloc((size_t)fit->nframe * CAV_FIT_FEET, 1);
  if (!fit->stands) return CAV_NO_MEMORY;
  for (int f = 0; f < fit->nfoot; f++)
    for (int i = 0; i < fit->n; i++) {
      if (fit->set->marker[fit->marker[i]].body != fit->foot[f]) continue;
      double least = bottom(fit, i);
      for (int t = 0; t < fit->nframe; t++)
        if (speed(fit, t, i) < still && cav_fit_seen(fit, t, i) && cav_fit_seen(fit, t, i)[2] < least + low)
          fit->stands[t * CAV_FIT_FEET + f] = 1;
    }
  return CAV_OK;
}

int cav_fit_floor_row(const cav_fit *fit, int frame, int f, double point[3]) {
  return lowest_point(fit, fit->foot[f], point) && (point[2] < 0 || fit->stands[frame * CAV_FIT_FEET + f]);
}
