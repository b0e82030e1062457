/// The ways MJCF writes an orientation, into unit quaternions: quat, axisangle, xyaxes, zaxis, euler, and fromto for poses.
///
/// Angles are in the unit, euler sequences of the axes, that the file's compiler element sets.

#include "math3.h"
#include "spec.h"

// rotation given as a sequence of three angles about the axes named by the compiler option eulerseq
static void read_euler(const cav_spec *spec, const double *angle, double quat[4]) {
  double q[4] = {1, 0, 0, 0};
  for (int i = 0; i < 3; i++) {
    char axis = spec->compiler.euler[i];
    int fixed = axis < 'a', k = axis - (fixed ? 'X' : 'x');
    double half = angle[i] * (spec->compiler.degree ? M_PI / 180 : 1) / 2, turn[4] = {cos(half), 0, 0, 0};
    turn[1 + k] = sin(half);
    // lower case turns about the axes that move along, upper case about fixed ones
    if (fixed)
      quat_mul(q, turn, q);
    else
      quat_mul(q, q, turn);
  }
  memcpy(quat, q, sizeof q);
}

// smallest rotation that takes z to a direction; opposite to z: half a turn about x
static void quat_of_z(const double direction[3], double quat[4]) {
  double z[3] = {0, 0, 1}, axis[3], d[3];
  copy3(d, direction);
  normalise3(d);
  cross3(axis, z, d);
  double sine = normalise3(axis), half;
  if (sine < 1e-10) set3(axis, 1, 0, 0);
  half = atan2(sine, d[2]) / 2;
  quat[0] = cos(half);
  scale3(quat + 1, sin(half), axis);
}

// rotation with the columns x, y made orthonormal, x kept
void cav_quat_of_axes(const double along_x[3], const double near_y[3], double quat[4]) {
  double x[3], y[3], z[3];
  copy3(x, along_x);
  normalise3(x);
  axpy3(y, near_y, -dot3(x, near_y), x);
  normalise3(y);
  cross3(z, x, y);
  const double R[9] = {x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]};
  // the largest of the four squared entries divides best
  double t[4] = {1 + R[0] + R[4] + R[8], 1 + R[0] - R[4] - R[8], 1 - R[0] + R[4] - R[8], 1 - R[0] - R[4] + R[8]};
  int k = 0;
  for (int i = 1; i < 4; i++) k = t[i] > t[k] ? i : k;
  double a = R[7] - R[5], b = R[2] - R[6], c = R[3] - R[1], d = R[1] + R[3], e = R[2] + R[6], f = R[5] + R[7];
  const double rows[4][4] = {{t[0], a, b, c}, {a, t[1], d, e}, {b, d, t[2], f}, {c, e, f, t[3]}};
  memcpy(quat, rows[k], sizeof rows[k]);
  quat_normalise(quat);
}

// any of the five ways to write an orientation; at most one
void cav_read_orientation(cav_spec *spec, const cav_xml_node *node, double quat[4]) {
  static const char *const ways[] = {"quat", "axisangle", "xyaxes", "zaxis", "euler"};
  double a[6];
  const char *found = NULL;
  for (int i = 0; i < 5; i++) {
    if (!cav_xml_reals(node, ways[i], a, 6)) continue;
    if (found) cav_spec_fail(spec, node, ways[i], "%s gives the orientation already; remove one of them", found);
    found = ways[i];
    int bad = 0;
    if (i == 0) {
      memcpy(quat, a, 4 * sizeof *a);
      bad = !(a[0] * a[0] + dot3(a + 1, a + 1) > 0);
      quat_normalise(quat);
    } else if (i == 1) {
      double half = a[3] * (spec->compiler.degree ? M_PI / 180 : 1) / 2;
      bad = normalise3(a) < 1e-14;
      quat[0] = cos(half);
      scale3(quat + 1, sin(half), a);
    } else if (i == 2) {
      double z[3];
      cross3(z, a, a + 3);
      bad = !(norm3(z) > 1e-10 * norm3(a) * norm3(a + 3));
      cav_quat_of_axes(a, a + 3, quat);
    } else if (i == 3) {
      bad = norm3(a) < 1e-14;
      quat_of_z(a, quat);
    } else {
      read_euler(spec, a, quat);
    }
    if (bad) cav_spec_fail(spec, node, ways[i], "expected a direction, got one of no length or two that are parallel");
  }
}

// pose from fromto: the z axis runs from the second point to the first, the frame stands midway; returns half the length
double cav_pose_of_fromto(const double *fromto, double pos[3], double quat[4]) {
  double d[3];
  sub3(d, fromto, fromto + 3);
  quat_of_z(d, quat);
  add3(pos, fromto, fromto + 3);
  scale3(pos, 0.5, pos);
  return norm3(d) / 2;
}
