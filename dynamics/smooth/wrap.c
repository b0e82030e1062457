/// The shortest way of a string around a sphere or a cylinder, or through the inside of one, from point to point:
/// straight lines that touch the surface, and the geodesic between. All in the frame of the geom, a cylinder is along z
/// and has no end. A sphere is a circle in the plane of both points and its centre, a cylinder is one in the projection
/// along its axis, where the string unrolls to a line of constant derivative.
///
/// Outside, a string that clears the surface is straight, unless a side is given and it passes on the other one.
/// Inside, it must come through the circle: where the straight line misses it, it bends at the one point of the circle
/// where it meets the radius under equal angles. Whether a side is inside is checked in the plane of the string, as
/// MuJoCo does. An end inside the geom: no wrapping. The geom's own motion along the string is of no account: at the
/// shortest way it changes nothing, so the two touching points serve as fixed ones (tendon.c).
#include "wrap.h"

#include "math3.h"

static double dot2(const double a[2], const double b[2]) { return a[0] * b[0] + a[1] * b[1]; }

static double cross2(const double a[2], const double b[2]) { return a[0] * b[1] - a[1] * b[0]; }

static double distance2(const double a[2], const double b[2]) { return hypot(a[0] - b[0], a[1] - b[1]); }

// point of the segment from a to b that is nearest to the origin
static void nearest_to_centre(const double a[2], const double b[2], double out[2]) {
  double along[2] = {b[0] - a[0], b[1] - a[1]}, square = dot2(along, along);
  double t = square > 0 ? fmin(1, fmax(0, -dot2(along, a) / square)) : 0;
  out[0] = a[0] + t * along[0];
  out[1] = a[1] + t * along[1];
}

// where the tangent from a touches the circle: turn 1 counter-clockwise of a, -1 clockwise
static void touch_point(const double a[2], double radius, double turn, double out[2]) {
  double square = dot2(a, a), near = radius * radius / square;
  double across = turn * radius * sqrt(fmax(0, square - radius * radius)) / square;
  out[0] = near * a[0] - across * a[1];
  out[1] = near * a[1] + across * a[0];
}

// whether segments a-b and c-d cross
static int segments_cross(const double a[2], const double b[2], const double c[2], const double d[2]) {
  double ab[2] = {b[0] - a[0], b[1] - a[1]}, cd[2] = {d[0] - c[0], d[1] - c[1]}, ac[2] = {c[0] - a[0], c[1] - a[1]};
  double det = cross2(ab, cd);
  if (det == 0) { return 0; }
  double s = cross2(ac, cd) / det, t = cross2(ac, ab) / det;
  return s >= 0 && s <= 1 && t >= 0 && t <= 1;
}

// angle from a to b, turning the way of turn, 0 .. 2 pi
static double angle_between(const double a[2], const double b[2], double turn) {
  double angle = atan2(turn * cross2(a, b), dot2(a, b));
  return angle < 0 ? angle + 2 * M_PI : angle;
}

// around the outside; touch receives both touching points. Returns the length of the arc, -1 if the string is straight
static double around(const double a[2], const double b[2], double radius, const double *side, double touch[2][2]) {
  double near[2], best = -INFINITY, arc = -1;
  nearest_to_centre(a, b, near);
  if (dot2(near, near) > radius * radius && (!side || dot2(side, near) >= 0)) { return -1; }
  for (int turn = -1; turn <= 1; turn += 2) {
    double p[2], q[2];
    touch_point(a, radius, turn, p);
    touch_point(b, radius, -turn, q);
    if (segments_cross(a, p, b, q)) { continue; }
    // the way on the given side, otherwise the shorter one
    double sum[2] = {p[0] + q[0], p[1] + q[1]}, norm = hypot(sum[0], sum[1]);
    double merit = side ? (norm > 0 ? dot2(sum, side) / norm : 0) : -distance2(p, q);
    if (merit <= best) { continue; }
    best = merit;
    arc = radius * angle_between(p, q, turn);
    memcpy(touch[0], p, sizeof p);
    memcpy(touch[1], q, sizeof q);
  }
  return arc;
}

// angle of sine z at the corner, from the law of sines on both sides: asin(Az) + asin(Bz) - 2 asin(z) + angle = 0 falls
// in z on (0, 1) and is positive at 0. Newton within a bracket
static double corner_sine(double A, double B, double angle) {
  double low = 0, high = 1, z = 0.5;
  for (int k = 0; k < 100; k++) {
    double error = asin(A * z) + asin(B * z) - 2 * asin(z) + angle;
    double derivative = A / sqrt(1 - A * A * z * z) + B / sqrt(1 - B * B * z * z) - 2 / sqrt(1 - z * z);
    if (error > 0) {
      low = z;
    } else {
      high = z;
    }
    double next = z - error / derivative;
    if (!(next > low && next < high)) { next = 0.5 * (low + high); }
    if (fabs(next - z) <= 1e-16) { return next; }
    z = next;
  }
  return z;
}

// through the inside: one corner on the circle. Returns 0, or -1 if the straight line comes through
static double through(const double a[2], const double b[2], double radius, double touch[2][2]) {
  double near[2];
  nearest_to_centre(a, b, near);
  if (dot2(near, near) <= radius * radius) { return -1; }
  double from_a = hypot(a[0], a[1]), from_b = hypot(b[0], b[1]), A = radius / from_a, B = radius / from_b;
  double angle = acos(fmin(1, fmax(-1, dot2(a, b) / (from_a * from_b))));
  if (A >= 1 || B >= 1) { return -1; }
  // both in line with the centre: the corner is between, on that line
  double turned = 0;
  if (angle > 0) {
    double z = corner_sine(A, B, angle);
    turned = asin(z) - asin(A * z);
  }
  double turn = cross2(a, b) < 0 ? -1 : 1, c = cos(turned), s = turn * sin(turned);
  touch[0][0] = A * (c * a[0] - s * a[1]);
  touch[0][1] = A * (s * a[0] + c * a[1]);
  memcpy(touch[1], touch[0], sizeof touch[0]);
  return 0;
}

static double in_plane(const double a[2], const double b[2], double radius, const double *side, int inside,
                       double touch[2][2]) {
  double square = radius * radius;
  if (!(radius > 0) || dot2(a, a) < square || dot2(b, b) < square) { return -1; }
  return inside ? through(a, b, radius, touch) : around(a, b, radius, side, touch);
}

// unit vector square to x, in the plane of x and towards if that says one
static void square_to(const double x[3], const double *towards, double out[3]) {
  double guess[3] = {0, 0, 0};
  if (towards) { copy3(guess, towards); }
  for (int k = 0; k < 4; k++) {
    axpy3(out, guess, -dot3(guess, x), x);
    if (normalise3(out) > 1e-10 * (1 + norm3(guess))) { return; }
    set3(guess, k == 0, k == 1, k == 2);
  }
}

double cav_wrap_sphere(double radius, const double a[3], const double b[3], const double *side, double touch[2][3]) {
  double x[3], y[3], flat[2][2];
  copy3(x, a);
  if (!(normalise3(x) > 0)) { return -1; }
  axpy3(y, b, -dot3(b, x), x);
  if (!(normalise3(y) > 1e-10 * norm3(b))) { square_to(x, side, y); }
  double p[2] = {dot3(a, x), dot3(a, y)}, q[2] = {dot3(b, x), dot3(b, y)}, s[2] = {0, 0};
  if (side) { s[0] = dot3(side, x), s[1] = dot3(side, y); }
  int inside = side && dot2(s, s) < radius * radius;
  double arc = in_plane(p, q, radius, side ? s : NULL, inside, flat);
  for (int k = 0; k < 2 && arc >= 0; k++) {
    scale3(touch[k], flat[k][0], x);
    axpy3(touch[k], touch[k], flat[k][1], y);
  }
  return arc;
}

double cav_wrap_cylinder(double radius, const double a[3], const double b[3], const double *side, double touch[2][3]) {
  double flat[2][2];
  int inside = side && dot2(side, side) < radius * radius;
  double arc = in_plane(a, b, radius, side, inside, flat);
  if (arc < 0) { return -1; }
  // the height grows evenly along the unrolled string
  double before = distance2(a, flat[0]), after = distance2(b, flat[1]), whole = before + arc + after;
  double derivative = whole > 0 ? (b[2] - a[2]) / whole : 0;
  set3(touch[0], flat[0][0], flat[0][1], a[2] + derivative * before);
  set3(touch[1], flat[1][0], flat[1][1], a[2] + derivative * (before + arc));
  return hypot(arc, derivative * arc);
}
