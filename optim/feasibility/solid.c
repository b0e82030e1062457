/// Solids that a motion would have to be inside of: postures that are given, and points that are asked to be within
/// something that stands in the world.
///
/// A point that lies a depth d inside one convex solid, of a geom that holds a ball of radius r about that point: to
/// part the two it takes d + r at least, whatever the orientation. Planes, spheres, capsules, boxes, cylinders,
/// ellipsoids (from below) and meshes; of height fields nothing is said.
#include <math.h>
#include <string.h>

#include "cavort/solve.h"
#include "feasibility.h"
#include "math3.h"
#include "objects.h"

static const double slack = 1e-3; // m

/// Radius of a ball about a point that the geom holds, in the geom's axes; negative outside, no less than the distance.
static double ball_within(const cav_model *m, const cav_geom *g, const double x[3]) {
  const double *s = g->size;
  double r = INFINITY;
  switch (g->type) {
    case CAV_GEOM_PLANE:
      return -x[2];
    case CAV_GEOM_SPHERE:
      return s[0] - norm3(x);
    case CAV_GEOM_CAPSULE: {
      double end[3] = {x[0], x[1], x[2] - fmin(fmax(x[2], -s[1]), s[1])};
      return s[0] - norm3(end);
    }
    case CAV_GEOM_ELLIPSOID: {
      double scaled[3] = {x[0] / s[0], x[1] / s[1], x[2] / s[2]};
      return (1 - norm3(scaled)) * fmin(s[0], fmin(s[1], s[2]));
    }
    case CAV_GEOM_CYLINDER:
      return fmin(s[0] - hypot(x[0], x[1]), s[1] - fabs(x[2]));
    case CAV_GEOM_BOX:
      return fmin(s[0] - fabs(x[0]), fmin(s[1] - fabs(x[1]), s[2] - fabs(x[2])));
    case CAV_GEOM_MESH: {
      const cav_mesh *mesh = &m->mesh[g->asset];
      for (int i = 0; i < mesh->nface; i++) r = fmin(r, mesh->plane[4 * i + 3] - dot3(mesh->plane + 4 * i, x));
      return mesh->nface ? r : -INFINITY;
    }
    case CAV_GEOM_HFIELD:
    case CAV_GEOM_TYPES:
      break;
  }
  return -INFINITY;
}

static double ball_in_geom(const cav_model *m, const cav_geom *g, const double pos[3], const double R[9],
                           const double point[3]) {
  double x[3];
  sub3(x, point, pos);
  rotate_back(x, R, x);
  return ball_within(m, g, x);
}

/// Least depth over a box of points in a solid of the world: at a corner, as depth is concave. -INFINITY where the box
/// is open along what the solid looks at.
static double box_depth(const cav_examination *e, int geom, const cav_requirement *r) {
  const cav_geom *g = &e->model->geom[geom];
  cav_pose pose;
  double least = INFINITY;
  cav_object_pose(e->model, e->start, CAV_OBJECT_GEOM, geom, &pose);
  for (int corner = 0; corner < 8; corner++) {
    double x[3];
    for (int k = 0; k < 3; k++) {
      x[k] = corner >> k & 1 ? r->high[k] : r->low[k];
      // a plane does not see what runs along it
      if (isinf(x[k]) && g->type == CAV_GEOM_PLANE && fabs(pose.rotation[3 * k + 2]) < 1e-12) x[k] = 0;
      if (isinf(x[k])) return -INFINITY;
    }
    least = fmin(least, ball_in_geom(e->model, g, pose.pos, pose.rotation, x));
  }
  return least;
}

static void examine_point(cav_examination *e, const cav_requirement *r) {
  const cav_model *m = e->model;
  char what[160], one[CAV_WORDS], other[CAV_WORDS];
  for (int p = 0; p < m->npair; p++) {
    int a = m->pair[p].geom1, b = m->pair[p].geom2, body = m->geom[a].link == r->object ? a : b, wall = a + b - body;
    if (m->geom[body].link != r->object || m->geom[wall].link != 0) continue;
    double depth = box_depth(e, wall, r),
           radius = ball_in_geom(m, &m->geom[body], m->geom[body].pos, m->geom[body].rotation, r->point);
    int exact = m->geom[wall].type == CAV_GEOM_PLANE || m->geom[wall].type == CAV_GEOM_SPHERE;
    if (radius < 0 || (depth < 0 && !exact) || !(depth + radius > CAV_TOLERANCE_PENETRATION + slack)) continue;
    cav_requirement_words(e, r, what, sizeof what);
    cav_impossible(e, CAV_CONDITION_SOLID, r, "Move the target out of the solid.",
                   "%s, but there geom '%.100s' would be %.3g mm inside '%.100s'", what, cav_geom_words(m, body, one),
                   1e3 * (depth + radius), cav_geom_words(m, wall, other));
    return;
  }
}

/// The deepest contact of the state's posture, where it is deeper than a certificate allows.
static void examine_posture(cav_examination *e, const cav_state *state, const char *which) {
  const cav_model *m = e->model;
  const cav_contact *deepest = NULL;
  char one[CAV_WORDS], other[CAV_WORDS];
  for (int i = 0; i < state->ncontact; i++)
    if (!deepest || state->contact[i].dist < deepest->dist) deepest = &state->contact[i];
  if (!deepest || -deepest->dist <= CAV_TOLERANCE_PENETRATION) return;
  const cav_pair *pair = &m->pair[deepest->pair];
  // what stands is named last
  int stands = m->geom[pair->geom2].link == 0 ? pair->geom2 : pair->geom1;
  int moves = stands == pair->geom1 ? pair->geom2 : pair->geom1;
  // height='floor' lifts onto planes, and onto a solid that the body's centre is over
  const cav_link *root = &m->link[m->link[m->geom[moves].link].root];
  int floats = root->njoint && m->joint[root->joint].type == CAV_JOINT_FREE, fixed = m->geom[stands].link == 0;
  const char *cure = "Change the posture, or move the solid; cavort inspect shows its depths.";
  if (fixed && m->geom[stands].type == CAV_GEOM_PLANE)
    cure = "Change the posture; height='floor' lifts it onto a floor, cavort inspect shows its depths.";
  else if (fixed && floats)
    cure =
        "Change the posture: to stand on that, height='floor' with its centre over it, or <root pos='X Y Z'/> with Z "
        "above it.";
  cav_impossible(e, CAV_CONDITION_SOLID, NULL, cure,
                 "%s: geom '%.100s' is %.3g mm inside '%.100s', and a certificate allows %g", which,
                 cav_geom_words(m, moves, one), -1e3 * deepest->dist, cav_geom_words(m, stands, other),
                 1e3 * CAV_TOLERANCE_PENETRATION);
}

cav_status cav_examine_solids(cav_examination *e) {
  if (cav_start_is_given(e->problem)) examine_posture(e, e->start, "the start");
  for (int i = 0; i < e->n && e->nfound < e->most; i++) {
    int before = e->nfound;
    if (e->requirement[i].kind == CAV_REQUIRE_POINT && e->requirement[i].object > 0)
      examine_point(e, &e->requirement[i]);
    if (e->nfound > before) break;
  }
  return CAV_OK;
}
