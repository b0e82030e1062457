/// The ways MJCF writes an orientation, into unit quaternions: quat, axisangle, xyaxes, zaxis, euler, and fromto for
/// poses.
///
/// Angles are in the unit, euler sequences of the axes, that the file's compiler element sets.

#include "algebra.h"
#include "math3.h"
#include "spec.h"

// rotation given as a sequence of three angles about the axes named by the compiler option eulerseq
static void read_euler(const cav_spec_compiler *compiler, const double *angle, double quat[4]) {
  double q[4] = {1, 0, 0, 0};
  for (int i = 0; i < 3; i++) {
    char axis = compiler->euler[i];
    int fixed = axis < 'a', k = axis - (fixed ? 'X' : 'x');
    double half = angle[i] * (compiler->degree ? M_PI / 180 : 1) / 2, turn[4] = {cos(half), 0, 0, 0};
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
      double half = a[3] * (cav_compiler_of(spec, node)->degree ? M_PI / 180 : 1) / 2;
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
      read_euler(cav_compiler_of(spec, node), a, quat);
    }
    if (bad) cav_spec_fail(spec, node, ways[i], "expected a direction, got one of no length or two that are parallel");
  }
}

// pose from fromto: the z axis runs from the second point to the first, the frame stands midway; returns half the
// length
double cav_pose_of_fromto(const double *fromto, double pos[3], double quat[4]) {
  double d[3];
  sub3(d, fromto, fromto + 3);
  quat_of_z(d, quat);
  add3(pos, fromto, fromto + 3);
  scale3(pos, 0.5, pos);
  return norm3(d) / 2;
}
