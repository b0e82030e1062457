/// Masses and inertias: of geoms from their shape and density, of bodies from their geoms or from the file.
///
/// Solid bodies of uniform density; a body's geoms add up by the parallel axis theorem, overlaps counting twice, as
/// MJCF has it. Principal axes by Jacobi's rotations. Then MJCF's compiler options boundmass, boundinertia,
/// balanceinertia and settotalmass, in this order. Meshes are weighed in asset.c.

#include "algebra.h"
#include "compile.h"
#include "math3.h"
#include "spec.h"

// --- geoms ---

// values of size each type needs, positive
static int size_count(int type) {
  static const int count[CAV_GEOM_TYPES] = {[CAV_GEOM_SPHERE] = 1,
                                            [CAV_GEOM_CAPSULE] = 2,
                                            [CAV_GEOM_ELLIPSOID] = 3,
                                            [CAV_GEOM_CYLINDER] = 2,
                                            [CAV_GEOM_BOX] = 3};
  return count[type];
}

// area; of an ellipsoid by Thomsen's formula, within 1.1 %
static double area(int type, const double *s) {
  const double p = 1.6075, ab = s[0] * s[1], bc = s[1] * s[2], ca = s[2] * s[0];
  switch (type) {
    case CAV_GEOM_SPHERE:
      return 4 * M_PI * s[0] * s[0];
    case CAV_GEOM_CAPSULE:
      return 4 * M_PI * s[0] * (s[0] + s[1]);
    case CAV_GEOM_ELLIPSOID:
      return 4 * M_PI * pow((pow(ab, p) + pow(bc, p) + pow(ca, p)) / 3, 1 / p);
    case CAV_GEOM_CYLINDER:
      return 2 * M_PI * s[0] * (s[0] + 2 * s[1]);
    case CAV_GEOM_BOX:
      return 8 * (ab + bc + ca);
    default:
      return 0;
  }
}

static double volume(int type, const double *s) {
  switch (type) {
    case CAV_GEOM_SPHERE:
      return 4 * M_PI / 3 * s[0] * s[0] * s[0];
    case CAV_GEOM_CAPSULE:
      return M_PI * s[0] * s[0] * (2 * s[1] + 4 * s[0] / 3);
    case CAV_GEOM_ELLIPSOID:
      return 4 * M_PI / 3 * s[0] * s[1] * s[2];
    case CAV_GEOM_CYLINDER:
      return 2 * M_PI * s[0] * s[0] * s[1];
    case CAV_GEOM_BOX:
      return 8 * s[0] * s[1] * s[2];
    default:
      return 0;
  }
}

// moments of a box or an ellipsoid: factor of m (b^2 + c^2)
static void moments_of_axes(double m, const double *s, double fraction, double moment[3]) {
  set3(moment, m * fraction * (s[1] * s[1] + s[2] * s[2]), m * fraction * (s[0] * s[0] + s[2] * s[2]),
       m * fraction * (s[0] * s[0] + s[1] * s[1]));
}

// a cylinder and two half spheres, whose centres of mass lie 3/8 r outside the ends
static void moments_of_capsule(double m, double r, double half, double moment[3]) {
  double h = 2 * half, caps = m * (4 * r / 3) / (h + 4 * r / 3), tube = m - caps;
  double along = tube * r * r / 2 + caps * 2 * r * r / 5;
  double across = tube * (3 * r * r + h * h) / 12 + caps * (2 * r * r / 5 + h * h / 4 + 3 * h * r / 8);
  set3(moment, across, across, along);
}

static void moments(int type, double m, const double *s, double moment[3]) {
  double sphere = 2 * m * s[0] * s[0] / 5, tube = m * (3 * s[0] * s[0] + 4 * s[1] * s[1]) / 12;
  switch (type) {
    case CAV_GEOM_SPHERE:
      set3(moment, sphere, sphere, sphere);
      break;
    case CAV_GEOM_CAPSULE:
      moments_of_capsule(m, s[0], s[1], moment);
      break;
    case CAV_GEOM_ELLIPSOID:
      moments_of_axes(m, s, 0.2, moment);
      break;
    case CAV_GEOM_CYLINDER:
      set3(moment, tube, tube, m * s[0] * s[0] / 2);
      break;
    case CAV_GEOM_BOX:
      moments_of_axes(m, s, 1.0 / 3, moment);
      break;
    default:
      zero3(moment);
  }
}

// a layer of even thickness on a box or an ellipsoid: what the solid's moments gain as all axes grow alike
static void moments_of_layer(double m, const double *s, double parts, double moment[3]) {
  double areas = s[0] * s[1] + s[1] * s[2] + s[2] * s[0], all = 2 * s[0] * s[1] * s[2];
  for (int k = 0; k < 3; k++) {
    double b = s[(k + 1) % 3], c = s[(k + 2) % 3];
    moment[k] = m * (areas * (b * b + c * c) + all * (b + c)) / (parts * areas);
  }
}

// moments of a surface of that mass
static void shell_moments(int type, double m, const double *s, double moment[3]) {
  double r = s[0], h = s[1], tube, ends;
  switch (type) {
    case CAV_GEOM_SPHERE:
      set3(moment, 2 * m * r * r / 3, 2 * m * r * r / 3, 2 * m * r * r / 3);
      break;
    case CAV_GEOM_CAPSULE:
      tube = m * h / (r + h), ends = m - tube;
      moment[0] = moment[1] = tube * (r * r / 2 + h * h / 3) + ends * (2 * r * r / 3 + h * h + h * r);
      moment[2] = tube * r * r + ends * 2 * r * r / 3;
      break;
    case CAV_GEOM_CYLINDER:
      tube = m * 2 * h / (r + 2 * h), ends = m - tube;
      moment[0] = moment[1] = tube * (r * r / 2 + h * h / 3) + ends * (r * r / 4 + h * h);
      moment[2] = tube * r * r + ends * r * r / 2;
      break;
    case CAV_GEOM_ELLIPSOID:
      moments_of_layer(m, s, 5, moment);
      break;
    case CAV_GEOM_BOX:
      moments_of_layer(m, s, 3, moment);
      break;
    default:
      zero3(moment);
  }
}

static void weigh_geom(cav_spec *spec, cav_spec_geom *g) {
  static const char *const names[CAV_GEOM_TYPES] = {"plane",    "sphere", "capsule", "ellipsoid",
                                                    "cylinder", "box",    "mesh",    "height field"};
  static const char *const ordinal[] = {"first", "second", "third"};
  for (int i = 0; i < size_count(g->type); i++) {
    if (!(g->size[i] > 0))
      cav_spec_fail(spec, g->node, "size", "expected %d number%s > 0 for a %s, but the %s is %s", size_count(g->type),
                    size_count(g->type) == 1 ? "" : "s", names[g->type], ordinal[i],
                    g->size[i] == 0 ? "missing or 0" : "negative");
  }
  if (g->has_mass && g->mass < 0) cav_spec_fail(spec, g->node, "mass", "expected a mass >= 0, got %g", g->mass);
  if (!g->has_mass && g->density < 0)
    cav_spec_fail(spec, g->node, "density", "expected a density >= 0, got %g", g->density);
  if (spec->status != CAV_OK) return;
  int solid = g->type != CAV_GEOM_PLANE && g->type != CAV_GEOM_HFIELD;
  double mass = !solid ? 0 : g->has_mass ? g->mass : g->density * (g->shell ? area : volume)(g->type, g->size);
  // a mesh has been weighed by asset.c
  if (g->type == CAV_GEOM_MESH) mass = g->inertia.mass;
  g->inertia.mass = mass;
  copy3(g->inertia.com, g->pos);
  memcpy(g->inertia.quat, g->quat, sizeof g->quat);
  if (g->type != CAV_GEOM_MESH) (g->shell ? shell_moments : moments)(g->type, mass, g->size, g->inertia.moment);
  if (g->type == CAV_GEOM_MESH && g->shell)
    cav_spec_fail(spec, g->node, "shellinertia", "for a mesh write inertia=\"shell\" in its asset");
  if (!isfinite(mass) || !isfinite(norm3(g->inertia.moment)))
    cav_spec_fail(spec, g->node, NULL, "mass or inertia is not finite; make size, mass or density smaller");
}

// --- bodies ---

// takes part in a body's inertia
static int counts(const cav_spec *spec, const cav_spec_geom *g) {
  return g->group >= spec->compiler.group_range[0] && g->group <= spec->compiler.group_range[1];
}

// adds moments about the body's axes of one geom about a point: R I R' + m (d^2 - d d')
static void add_moment(const cav_spec_inertia *part, const double point[3], double sum[6]) {
  double R[9], S[6] = {part->moment[0], part->moment[1], part->moment[2], 0, 0, 0}, W[6], d[3];
  quat_matrix(R, part->quat);
  symmetric_rotate(W, R, S);
  sub3(d, part->com, point);
  double m = part->mass, d2 = dot3(d, d);
  for (int i = 0; i < 3; i++) sum[i] += W[i] + m * (d2 - d[i] * d[i]);
  sum[3] += W[3] - m * d[0] * d[1];
  sum[4] += W[4] - m * d[0] * d[2];
  sum[5] += W[5] - m * d[1] * d[2];
}

static void weigh_by_geoms(cav_spec *spec, cav_spec_body *b) {
  cav_spec_inertia sum = {.quat = {1, 0, 0, 0}};
  int count = 0, only = 0;
  for (int i = b->geom; i < b->geom + b->ngeom; i++) {
    const cav_spec_geom *g = &spec->geom.at[i];
    if (!counts(spec, g)) continue;
    count++;
    only = i;
    sum.mass += g->inertia.mass;
    axpy3(sum.com, sum.com, g->inertia.mass, g->inertia.com);
  }
  if (count == 1) sum = spec->geom.at[only].inertia;
  if (count > 1 && sum.mass > 0) {
    double S[6] = {0};
    scale3(sum.com, 1 / sum.mass, sum.com);
    for (int i = b->geom; i < b->geom + b->ngeom; i++) {
      if (counts(spec, &spec->geom.at[i])) add_moment(&spec->geom.at[i].inertia, sum.com, S);
    }
    cav_principal_axes(S, sum.quat, sum.moment);
  }
  b->inertia = sum;
}

// moments that miss what a solid has by rounding: those below 0 are set to 0, and a largest one above the sum of the
// others moves to the nearest that is not. What misses it by more is told and stays. What is left of a point mass's
// zeros when a program moved its axes is zero
static void repair_inertia(cav_spec *spec, cav_spec_body *b) {
  static const double rounding = 0.01; // of the largest moment
  static const double nothing = 1e-15; // m^2, of a mass: a radius of 3e-8 m
  double *I = b->inertia.moment;
  for (int k = 0; k < 3; k++) I[k] = fabs(I[k]) <= nothing * b->inertia.mass ? 0 : I[k];
  double most = fmax(I[0], fmax(I[1], I[2])), least = fmin(I[0], fmin(I[1], I[2]));
  if (least < 0 && least >= -rounding * most) {
    for (int k = 0; k < 3; k++) I[k] = fmax(I[k], 0);
    cav_spec_leave(spec, b->node, NULL, "a moment of inertia is below 0 by rounding: set to 0");
  }
  double excess = 2 * most - (I[0] + I[1] + I[2]);
  if (!(excess > 1e-12 * most)) return;
  if (excess > rounding * most) {
    cav_spec_leave(spec, b->node, NULL,
                   "one moment of inertia is above the sum of the others, which no solid has; taken as it stands");
    return;
  }
  for (int k = 0; k < 3; k++) I[k] += I[k] == most ? -excess / 3 : excess / 3;
  cav_spec_leave(spec, b->node, NULL, "one moment of inertia is above the sum of the others by rounding: mended");
}

// bounds, signs and the triangle inequality of moments
static void check_inertia(cav_spec *spec, cav_spec_body *b) {
  const cav_spec_compiler *c = &spec->compiler;
  double *I = b->inertia.moment;
  if (c->repair) repair_inertia(spec, b);
  if (!isfinite(I[0] + I[1] + I[2]) || fmin(I[0], fmin(I[1], I[2])) < 0)
    cav_spec_fail(spec, b->node, NULL,
                  "principal moments of inertia %g %g %g: expected numbers >= 0; correct the inertia", I[0], I[1],
                  I[2]);
  b->inertia.mass = fmax(b->inertia.mass, c->bound_mass);
  for (int i = 0; i < 3; i++) I[i] = fmax(I[i], c->bound_inertia);
  double most = fmax(I[0], fmax(I[1], I[2])), sum = I[0] + I[1] + I[2];
  // rounding of a flat body's sum is no fault
  if (2 * most <= sum * (1 + 1e-12) || (c->repair && !c->balance)) return;
  if (c->balance)
    set3(I, sum / 3, sum / 3, sum / 3);
  else
    cav_spec_fail(spec, b->node, NULL,
                  "moments of inertia %g %g %g: no body has one above the sum of the others; correct them or set the "
                  "compiler's balanceinertia",
                  I[0], I[1], I[2]);
}

void cav_spec_masses(cav_spec *spec) {
  const cav_spec_compiler *c = &spec->compiler;
  for (int i = 0; i < spec->geom.n && spec->status == CAV_OK; i++) weigh_geom(spec, &spec->geom.at[i]);
  double total = 0;
  for (int i = 1; i < spec->body.n && spec->status == CAV_OK; i++) {
    cav_spec_body *b = &spec->body.at[i];
    if (!b->has_inertial) b->inertia.quat[0] = 1;
    if (b->has_full) cav_principal_axes(b->full, b->inertia.quat, b->inertia.moment);
    int own = i < spec->own_bodies;
    if ((own && c->from_geoms == 1) || ((!own || c->from_geoms == 2) && !b->has_inertial)) weigh_by_geoms(spec, b);
    check_inertia(spec, b);
    if (own) total += b->inertia.mass;
  }
  cav_spec_settle_notes(spec);
  // all of the model that is not the world scaled to the total asked for
  if (!(c->total_mass > 0) || !(total > 0)) return;
  for (int i = 1; i < spec->own_bodies; i++) {
    cav_spec_inertia *n = &spec->body.at[i].inertia;
    n->mass *= c->total_mass / total;
    scale3(n->moment, c->total_mass / total, n->moment);
  }
}
