/// Nearest surface points of box, cylinder and ellipsoid, and support points of all solids.
/// Box and cylinder: closed form, by clamping. Ellipsoid: the nearest point x of y obeys y = x + t x/a^2; t is the
/// largest root of sum (a_i y_i/(t + a_i^2))^2 = 1, convex and decreasing right of its poles, so that Newton started
/// left of the root rises to it without a safeguard. Where a point has several nearest ones (an axis, the focal
/// ellipse), one is picked, always the same: the normal jumps there, the distance does not.
#include "direction.h"
#include "pairs.h"

// +1 or -1, never 0
static double sign_of(double x) { return x < 0 ? -1 : 1; }

double cav_surface_box(const double *size, const double p[3], double normal[3]) {
  double out[3], length2 = 0;
  int deepest = 0;
  for (int i = 0; i < 3; i++) {
    double q = fabs(p[i]) - size[i];
    if (q > fabs(p[deepest]) - size[deepest]) deepest = i;
    out[i] = q > 0 ? sign_of(p[i]) * q : 0;
    length2 += out[i] * out[i];
  }
  // outside: away from the clamped point
  if (length2 > 0) {
    double length = sqrt(length2);
    scale3(normal, 1 / length, out);
    return length;
  }
  // inside: through the nearest face
  zero3(normal);
  normal[deepest] = sign_of(p[deepest]);
  return fabs(p[deepest]) - size[deepest];
}

double cav_surface_cylinder(const double *size, const double p[3], double normal[3]) {
  double rho = sqrt(p[0] * p[0] + p[1] * p[1]);
  double radial[2] = {rho > 0 ? p[0] / rho : 1, rho > 0 ? p[1] / rho : 0};
  double qr = rho - size[0], qz = fabs(p[2]) - size[1];
  double nr, nz, dist;
  if (qr > 0 && qz > 0) {
    dist = sqrt(qr * qr + qz * qz);
    nr = qr / dist;
    nz = qz / dist;
  } else {
    int side = qr > qz;
    nr = side;
    nz = !side;
    dist = side ? qr : qz;
  }
  set3(normal, nr * radial[0], nr * radial[1], nz * sign_of(p[2]));
  return dist;
}

// largest root s = t + a_min^2 of the secular equation; gap_i = a_i^2 - a_min^2, w_i = a_i |y_i|; 0: root at the pole
static double ellipsoid_root(const double gap[3], const double w[3]) {
  double s = 0;
  for (int i = 0; i < 3; i++) { s = fmax(s, w[i] - gap[i]); }
  // at the start each term is at most 1 and one of them is 1: Newton needs a handful of steps
  enum { STEPS_MAX = 60 };
  for (int k = 0; k < STEPS_MAX; k++) {
    double f = -1, derivative = 0;
    for (int i = 0; i < 3; i++) {
      if (w[i] <= 0) continue;
      double e = s + gap[i], r = w[i] / e;
      f += r * r;
      derivative -= 2 * r * r / e;
    }
    if (!(f > 0)) break;
    double next = s - f / derivative;
    if (!(next > s * (1 + 1e-15))) break;
    s = next;
  }
  return s;
}

double cav_surface_ellipsoid(const double *size, const double p[3], double normal[3]) {
  int least = 0;
  for (int i = 1; i < 3; i++) {
    if (size[i] < size[least]) least = i;
  }
  double a2 = size[least] * size[least], gap[3], w[3];
  for (int i = 0; i < 3; i++) {
    gap[i] = (size[i] - size[least]) * (size[i] + size[least]);
    w[i] = size[i] * fabs(p[i]);
  }
  double s = ellipsoid_root(gap, w);

  // x_i/a_i^2 = y_i/(t + a_i^2); at the pole the shortest axis takes what is left of the unit sphere
  double g[3], left = 1;
  for (int i = 0; i < 3; i++) {
    double e = s + gap[i];
    g[i] = e > 0 ? p[i] / e : 0;
    if (i != least) left -= g[i] * g[i] * size[i] * size[i];
  }
  if (s <= a2 * 1e-12) g[least] = sign_of(p[least]) * sqrt(fmax(left, 0)) / size[least];
  double length = norm3(g);
  scale3(normal, 1 / length, g);
  return (s - a2) * length;
}

// support points about the origin in the shape's axes
static void support_local(cav_geom_type type, const double *size, const double d[3], double x[3]) {
  double rho, length;
  switch (type) {
    case CAV_GEOM_SPHERE:
    case CAV_GEOM_CAPSULE:
      length = norm3(d);
      scale3(x, length > 0 ? size[0] / length : 0, d);
      if (type == CAV_GEOM_CAPSULE) x[2] += sign_of(d[2]) * size[1];
      return;
    case CAV_GEOM_ELLIPSOID:
      set3(x, size[0] * d[0], size[1] * d[1], size[2] * d[2]);
      length = norm3(x);
      for (int i = 0; i < 3; i++) { x[i] = length > 0 ? size[i] * x[i] / length : 0; }
      return;
    case CAV_GEOM_CYLINDER:
      rho = sqrt(d[0] * d[0] + d[1] * d[1]);
      set3(x, rho > 0 ? size[0] * d[0] / rho : 0, rho > 0 ? size[0] * d[1] / rho : 0, sign_of(d[2]) * size[1]);
      return;
    case CAV_GEOM_BOX:
      set3(x, sign_of(d[0]) * size[0], sign_of(d[1]) * size[1], sign_of(d[2]) * size[2]);
      return;
    case CAV_GEOM_PLANE:
    case CAV_GEOM_MESH:
    case CAV_GEOM_HFIELD:
    case CAV_GEOM_TYPES:
      break;
  }
  zero3(x);
}

int cav_mesh_summit(const cav_mesh *m, const double d[3]) { return cav_mesh_summit_from(m, d, -1); }

int cav_mesh_summit_from(const cav_mesh *m, const double d[3], int near) {
  enum { FEW = 32 };
  int best = m->summit && m->nvertex > FEW ? m->summit[direction_cell(d)] : 0;
  double most = dot3(m->vertex + 3 * best, d);
  if (near >= 0 && m->nvertex > FEW) {
    double h = dot3(m->vertex + 3 * near, d);
    if (h > most) most = h, best = near;
  }
  for (int v = 1; v < m->nvertex && m->nvertex <= FEW; v++) {
    double h = dot3(m->vertex + 3 * v, d);
    if (h > most) most = h, best = v;
  }
  for (int last = -1; last != best && m->nvertex > FEW;) {
    last = best;
    for (int k = m->neighbour_start[last]; k < m->neighbour_start[last + 1]; k++) {
      // by masks, as which one is higher no processor foresees
      int v = m->neighbour[k];
      double h = dot3(m->vertex + 3 * v, d);
      best ^= (best ^ v) & -(h > most);
      most = h > most ? h : most;
    }
  }
  return best;
}

void cav_shape_support(const cav_shape *shape, const double direction[3], double point[3]) {
  double d[3], x[3];
  rotate_back(d, shape->rotation, direction);
  if (shape->type == CAV_GEOM_MESH) {
    copy3(x, shape->mesh->vertex + 3 * cav_mesh_summit(shape->mesh, d));
  } else {
    support_local(shape->type, shape->size, d, x);
  }
  transform(point, shape->pos, shape->rotation, x);
}
