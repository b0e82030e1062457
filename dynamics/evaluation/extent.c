/// How far shapes extend: to the plane that they touch, and along a ray out of them. Exact for every type but height fields and
/// planes, which have no end.
#include "extent.h"

#include <math.h>

#include "geometry.h"
#include "math3.h"

static double mesh_reach(const cav_mesh *mesh, double x, double y, double z) {
  const double *v = mesh->vertex + 3 * cav_mesh_summit(mesh, (const double[3]){x, y, z});
  return v[0] * x + v[1] * y + v[2] * z;
}

double cav_geom_reach(const cav_model *m, int g, const cav_pose *pose, const double n[3]) {
  const cav_geom *geom = &m->geom[g];
  const double *r = pose->rotation, *s = geom->size;
  double x = n[0] * r[0] + n[1] * r[3] + n[2] * r[6];
  double y = n[0] * r[1] + n[1] * r[4] + n[2] * r[7];
  double z = n[0] * r[2] + n[1] * r[5] + n[2] * r[8];
  switch (geom->type) {
    case CAV_GEOM_SPHERE:
      return s[0];
    case CAV_GEOM_CAPSULE:
      return s[0] + s[1] * fabs(z);
    case CAV_GEOM_ELLIPSOID:
      return sqrt(s[0] * s[0] * x * x + s[1] * s[1] * y * y + s[2] * s[2] * z * z);
    case CAV_GEOM_CYLINDER:
      return s[0] * sqrt(x * x + y * y) + s[1] * fabs(z);
    case CAV_GEOM_BOX:
      return s[0] * fabs(x) + s[1] * fabs(y) + s[2] * fabs(z);
    case CAV_GEOM_MESH:
      return mesh_reach(&m->mesh[geom->asset], x, y, z);
    case CAV_GEOM_PLANE:
    case CAV_GEOM_HFIELD:
    case CAV_GEOM_TYPES:
      break;
  }
  return 0;
}

double cav_geom_bottom(const cav_model *m, int geom, const cav_pose *pose) {
  return pose->pos[2] - cav_geom_reach(m, geom, pose, (const double[3]){0, 0, -1});
}

static double mesh_exit(const cav_mesh *mesh, const double n[3]) {
  double least = INFINITY;
  for (int i = 0; i < mesh->nface; i++) {
    const double *plane = mesh->plane + 4 * (size_t)i, along = dot3(plane, n);
    if (along > 0) least = fmin(least, plane[3] / along);
  }
  return least;
}

double cav_geom_exit(const cav_model *m, int g, const cav_pose *pose, const double n[3]) {
  const cav_geom *geom = &m->geom[g];
  double d[3], least = INFINITY;
  const double *s = geom->size;
  rotate_back(d, pose->rotation, n);
  const double across = hypot(d[0], d[1]);
  switch (geom->type) {
    case CAV_GEOM_SPHERE:
      return s[0];
    case CAV_GEOM_ELLIPSOID:
      return 1 / sqrt(pow(d[0] / s[0], 2) + pow(d[1] / s[1], 2) + pow(d[2] / s[2], 2));
    case CAV_GEOM_CAPSULE:
    case CAV_GEOM_CYLINDER:
      if (across > 0) least = s[0] / across;
      return fabs(d[2]) > 0 ? fmin(least, (s[1] + (geom->type == CAV_GEOM_CAPSULE ? s[0] : 0)) / fabs(d[2])) : least;
    case CAV_GEOM_MESH:
      return mesh_exit(&m->mesh[geom->asset], d);
    case CAV_GEOM_BOX:
      for (int k = 0; k < 3; k++)
        if (d[k] != 0) least = fmin(least, s[k] / fabs(d[k]));
      return least;
    default:
      return 0;
  }
}
