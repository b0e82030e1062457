/// Feet and the floor: where a marker of a foot stands still, near the lowest that it comes, the foot's lowest point is on
/// the floor; where all of its markers do, two or more, its sole is, four corners of it; elsewhere it is not below. The
/// floor is the plane z = 0 of the clip.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "extent.h"
#include "fit.h"
#include "math3.h"
#include "role.h"

static const double still = 0.25;      // m/s
static const double low = 0.06;        // m above the lowest place of a marker in the clip
static const double bend = 1e-6;       // of a direction, for the point of a geom that is farthest along it
static const double tilt = 0.1;        // of a floor along x and y that a corner of a sole would touch first
static const double same = 0.03;       // of a body's height: parts of one foot are as low within it
static const double clear_most = 0.02; // m
enum { FLAT = 2 };

// how far a geom reaches along a direction of any length, times that
static double reach_along(const cav_model *m, int geom, const cav_pose *pose, const double n[3]) {
  double unit[3], length = norm3(n);
  scale3(unit, 1 / length, n);
  return length * cav_geom_reach(m, geom, pose, unit);
}

// where the floor is touched by the part of a body's geoms that is farthest along a direction n, not of unit length, at the
// state's position; zero: it has none. By the reach of its farthest geom, whose derivative by n is a point of that
static int farthest_point(const cav_fit *fit, int body, const double n[3], double point[3]) {
  const cav_model *m = fit->model;
  double most = -INFINITY;
  cav_pose pose;
  int farthest = -1;
  for (int g = m->body[body].geom; g < m->body[body].geom + m->body[body].ngeom; g++) {
    cav_object_pose(m, fit->state, CAV_OBJECT_GEOM, g, &pose);
    double reach = dot3(pose.pos, n) + reach_along(m, g, &pose, n);
    if (reach > most) most = reach, farthest = g;
  }
  if (farthest < 0) return 0;
  cav_object_pose(m, fit->state, CAV_OBJECT_GEOM, farthest, &pose);
  for (int k = 0; k < 3; k++) {
    double reach[2];
    for (int side = 0; side < 2; side++) {
      double bent[3];
      copy3(bent, n);
      bent[k] += side ? bend : -bend;
      reach[side] = reach_along(m, farthest, &pose, bent);
    }
    point[k] = pose.pos[k] + (reach[1] - reach[0]) / (2 * bend);
  }
  // a ball at the end of a capsule or alone touches the floor straight below its middle
  const cav_geom *geom = &m->geom[farthest];
  if (geom->type == CAV_GEOM_SPHERE || geom->type == CAV_GEOM_CAPSULE) {
    axpy3(point, point, -geom->size[0] / norm3(n), n);
    point[2] -= geom->size[0];
  }
  return 1;
}

int cav_fit_lowest(const cav_fit *fit, int body, double point[3]) {
  return farthest_point(fit, body, (const double[3]){0, 0, -1}, point);
}

double cav_fit_speed(const cav_fit *fit, int frame, int i) {
  int a = frame > 0 ? frame - 1 : frame, b = frame < fit->nframe - 1 ? frame + 1 : frame;
  const double *from = cav_fit_seen(fit, a, i), *to = cav_fit_seen(fit, b, i);
  double way[3];
  if (!from || !to || a == b) return INFINITY;
  sub3(way, to, from);
  return norm3(way) / ((b - a) * fit->step);
}

double cav_fit_bottom(const cav_fit *fit, int i) {
  double least = INFINITY;
  for (int t = 0; t < fit->nframe; t++) {
    const double *seen = cav_fit_seen(fit, t, i);
    if (seen) least = fmin(least, seen[2]);
  }
  return least;
}

int cav_fit_stands(const cav_fit *fit, int frame, int i, double least, double times) {
  const double *seen = cav_fit_seen(fit, frame, i);
  return seen && cav_fit_speed(fit, frame, i) < times * still && seen[2] < least + low;
}

static int is_planted(const cav_fit *fit, int frame, int i) {
  return fit->planted && fit->planted[(size_t)frame * (size_t)fit->n + (size_t)i];
}

// how far a foot keeps from the floor: not at all while one of its markers stands or is nearly still, clear_most where
// all are fast
static double clear_of(const cav_fit *fit, int frame, int foot) {
  double least = INFINITY;
  for (int i = 0; i < fit->n; i++)
    if (fit->set->marker[fit->marker[i]].body == fit->foot[foot])
      least = is_planted(fit, frame, i) ? 0 : fmin(least, cav_fit_speed(fit, frame, i));
  return isfinite(least) ? clear_most * fmin(fmax(least / still - 2, 0) / 2, 1) : 0;
}

// how a foot stands at a frame, by its markers
static int stand_of(const cav_fit *fit, int frame, int foot, const double *least) {
  int seen = 0, standing = 0;
  for (int i = 0; i < fit->n; i++) {
    if (fit->set->marker[fit->marker[i]].body != fit->foot[foot]) continue;
    seen++;
    standing += is_planted(fit, frame, i) || cav_fit_stands(fit, frame, i, least[i], 1);
  }
  return standing > 1 && standing == seen ? FLAT : standing > 0;
}

// height of the lowest point of a body's shapes at the state's position; infinite: it has none
static double height_of(const cav_fit *fit, int body) {
  double point[3];
  return cav_fit_lowest(fit, body, point) ? point[2] : INFINITY;
}

// a foot and, where it is the toes of one, what else of it is as low in the posture of the file
static void add_foot(cav_fit *fit, int body, double tall) {
  double toes = height_of(fit, body);
  for (int b = body; b > 0 && fit->nfoot < CAV_FIT_FEET; b = fit->model->body[b].parent) {
    if (b != body && !(fabs(height_of(fit, b) - toes) < same * tall)) return;
    fit->foot[fit->nfoot++] = b;
  }
}

// feet of a model, in the posture of the file
static cav_status find_feet(cav_fit *fit) {
  static const cav_role feet[] = {CAV_ROLE_RIGHT_FOOT,      CAV_ROLE_LEFT_FOOT,       CAV_ROLE_FRONT_RIGHT_FOOT,
                                  CAV_ROLE_FRONT_LEFT_FOOT, CAV_ROLE_BACK_RIGHT_FOOT, CAV_ROLE_BACK_LEFT_FOOT};
  const cav_model *m = fit->model;
  cav_roles roles;
  cav_status status = cav_roles_find(m, fit->state, &roles);
  if (!status) status = cav_position(m, fit->state, m->q0);
  double least = INFINITY, most = -INFINITY;
  for (int b = 1; b < m->nbody && !status; b++) {
    if (!m->body[b].link || !m->body[b].ngeom) continue;
    least = fmin(least, height_of(fit, b)), most = fmax(most, height_of(fit, b));
  }
  for (size_t k = 0; k < sizeof feet / sizeof *feet && !status; k++)
    if (roles.body[feet[k]] >= 0) add_foot(fit, roles.body[feet[k]], most - least);
  return status;
}

cav_status cav_fit_feet(cav_fit *fit) {
  if (fit->point) return CAV_OK;
  cav_status status = find_feet(fit);
  if (status) return status;
  int most = 0;
  for (int f = 0; f < fit->nfoot; f++)
    if (fit->model->body[fit->foot[f]].ngeom > most) most = fit->model->body[fit->foot[f]].ngeom;
  fit->point = malloc(3 * ((size_t)most * CAV_FIT_POINTS + CAV_FIT_CORNERS) * sizeof *fit->point);
  return fit->point ? CAV_OK : CAV_NO_MEMORY;
}

// Corners of soles as the posture of the file has them. Another body's foot may not come flat on the floor, and which of its
// points a tilted floor would touch first then jumps
static cav_status find_corners(cav_fit *fit) {
  cav_status status = cav_position(fit->model, fit->state, fit->model->q0);
  for (int f = 0; f < fit->nfoot && !status; f++) {
    cav_pose pose;
    cav_object_pose(fit->model, fit->state, CAV_OBJECT_XBODY, fit->foot[f], &pose);
    for (int k = 0; k < CAV_FIT_CORNERS; k++) {
      const double down[3] = {k & 1 ? tilt : -tilt, k & 2 ? tilt : -tilt, -1};
      double point[3];
      if (!farthest_point(fit, fit->foot[f], down, point)) continue;
      sub3(point, point, pose.pos);
      rotate_back(fit->corner[f][fit->ncorner[f]++], pose.rotation, point);
    }
  }
  return status;
}

cav_status cav_fit_floor(cav_fit *fit) {
  cav_status status = cav_fit_feet(fit);
  if (status) return status;
  fit->stands = calloc((size_t)fit->nframe * CAV_FIT_FEET, 1);
  double *least = malloc((size_t)fit->n * sizeof *least);
  for (int i = 0; i < fit->n && least; i++) least[i] = cav_fit_bottom(fit, i);
  for (int t = 0; t < fit->nframe && fit->stands && least; t++)
    for (int f = 0; f < fit->nfoot; f++) fit->stands[t * CAV_FIT_FEET + f] = (char)stand_of(fit, t, f, least);
  status = fit->stands && least ? CAV_OK : CAV_NO_MEMORY;
  free(least);
  // of another body a foot that swings low would be put onto the floor, and skate
  if (status || !fit->planted) return status;
  status = find_corners(fit);
  if (status) return status;
  fit->clear = malloc((size_t)fit->nframe * CAV_FIT_FEET * sizeof *fit->clear);
  for (int t = 0; t < fit->nframe && fit->clear; t++)
    for (int f = 0; f < fit->nfoot; f++) fit->clear[t * CAV_FIT_FEET + f] = clear_of(fit, t, f);
  return fit->clear ? CAV_OK : CAV_NO_MEMORY;
}

// points of a geom that may be its lowest: ends of a capsule, corners of a box; 0: it has none that is known
static int candidates(const cav_geom *geom, const cav_pose *pose, double point[CAV_FIT_POINTS][3]) {
  const double *s = geom->size;
  int ends = geom->type == CAV_GEOM_CAPSULE, box = geom->type == CAV_GEOM_BOX || geom->type == CAV_GEOM_MESH,
      n = ends  ? 2
          : box ? 8
                : geom->type == CAV_GEOM_SPHERE;
  for (int k = 0; k < n; k++) {
    const double corner[3] = {(k & 2 ? 1 : -1) * s[0], (k & 4 ? 1 : -1) * s[1], (k & 1 ? 1 : -1) * s[box ? 2 : 1]},
                 end[3] = {0, 0, ends ? corner[2] : 0};
    transform(point[k], pose->pos, pose->rotation, box ? corner : end);
    if (!box) point[k][2] -= s[0];
  }
  return n;
}

// whether a marker of a foot is held where it stands, as high as it is on the sole: a lowest point that was pulled down, too,
// jumps from one end of a foot that turns on its ball to the other
static int is_held(const cav_fit *fit, int frame, int foot) {
  int held = 0;
  for (int i = 0; i < fit->n; i++)
    held |= fit->set->marker[fit->marker[i]].body == fit->foot[foot] && is_planted(fit, frame, i);
  return held;
}

int cav_fit_floor_rows(const cav_fit *fit, int frame, int f) {
  int stands = fit->stands[frame * CAV_FIT_FEET + f], rows = 0;
  double clear = cav_fit_clear(fit, frame, f);
  for (int k = 0; k < fit->ncorner[f] && stands == FLAT; k++) {
    cav_pose pose;
    cav_object_pose(fit->model, fit->state, CAV_OBJECT_XBODY, fit->foot[f], &pose);
    transform(fit->point + 3 * rows++, pose.pos, pose.rotation, fit->corner[f][k]);
  }
  for (int k = 0; k < CAV_FIT_CORNERS && stands == FLAT && !fit->ncorner[f]; k++) {
    const double down[3] = {k & 1 ? tilt : -tilt, k & 2 ? tilt : -tilt, -1};
    rows += farthest_point(fit, fit->foot[f], down, fit->point + 3 * rows);
  }
  if (stands == FLAT) return rows;
  const cav_body *body = &fit->model->body[fit->foot[f]];
  double point[CAV_FIT_POINTS][3];
  for (int g = body->geom; g < body->geom + body->ngeom; g++) {
    cav_pose pose;
    cav_object_pose(fit->model, fit->state, CAV_OBJECT_GEOM, g, &pose);
    int n = candidates(&fit->model->geom[g], &pose, point);
    for (int k = 0; k < n; k++)
      if (point[k][2] < clear) copy3(fit->point + 3 * rows++, point[k]);
  }
  if (rows == 0 && cav_fit_lowest(fit, fit->foot[f], point[0]) &&
      (point[0][2] < clear || (stands && !is_held(fit, frame, f))))
    copy3(fit->point + 3 * rows++, point[0]);
  return rows;
}
