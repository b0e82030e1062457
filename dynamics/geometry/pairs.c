/// Contact points of two shapes, by a table over their types.
/// Conventions (MuJoCo's): a point lies midway between the two surfaces along the normal, the normal points from the
/// first to the second shape, the gap is negative in penetration, and a point exists while its gap is below the margin.
/// Distances are exact (two boxes: see there). Normals and points are smooth in the poses but for what
/// the geometry itself makes jump:
///  - coincident centres: a fixed direction is taken; crossing axes of capsules: the normal changes side;
///  - capsules closer to parallel than CAV_PARALLEL rad have two points where their sides overlap, others one;
///  - a plane sees the 4 lowest corners of a box.
/// Of a cylinder a plane sees one line along its side and a regular triangle on its lower cap with one corner at the lowest
/// point; within 3 degrees of upright, where that triangle turns at no tilt at all, four points that move with the cylinder.
/// Solids without a routine of their own go to polytope.c.
#include "pairs.h"
#include "capsules_four.h"

// one point of shape b at signed height above a plane: x is its surface point, n the plane's normal
static void touch_plane(const double x[3], const double n[3], double height, int feature, cav_touch *touch) {
  axpy3(touch->pos, x, -height / 2, n);
  copy3(touch->normal, n);
  zero3(touch->tangent);
  touch->dist = height;
  touch->feature = feature;
}

// normal of a plane and height of a point above it
static double plane_height(const cav_shape *plane, const double x[3], double n[3]) {
  double d[3];
  column3(n, plane->rotation, 2);
  sub3(d, x, plane->pos);
  return dot3(d, n);
}

// plane against a ball about c
static int plane_ball(const cav_shape *a, const double c[3], double radius, double margin, int feature,
                      cav_touch *touch) {
  double n[3], x[3];
  double height = plane_height(a, c, n) - radius;
  if (height >= margin) return 0;
  axpy3(x, c, -radius, n);
  touch_plane(x, n, height, feature, touch);
  return 1;
}

static int plane_sphere(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  return plane_ball(a, b->pos, b->size[0], margin, 0, touch);
}

// a ball at each end; the second contact axis follows the capsule
static int plane_capsule(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  double axis[3], end[3];
  column3(axis, b->rotation, 2);
  int count = 0;
  for (int side = 0; side < 2; side++) {
    axpy3(end, b->pos, side ? -b->size[1] : b->size[1], axis);
    if (!plane_ball(a, end, b->size[0], margin, side, touch + count)) continue;
    copy3(touch[count].tangent, axis);
    count++;
  }
  return count;
}

static int plane_ellipsoid(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  double n[3], down[3], x[3];
  column3(n, a->rotation, 2);
  scale3(down, -1, n);
  cav_shape_support(b, down, x);
  double height = plane_height(a, x, n);
  if (height >= margin) return 0;
  touch_plane(x, n, height, 0, touch);
  return 1;
}

// sine of the tilt below which a cylinder stands on its cap
static const double STANDS = 0.05;

// points of the cylinder in its own axes: both ends of the lowest line of its side, then two more corners of a regular
// triangle on the lower cap. Below the tilt STANDS their directions turn at will; there these points slide to the axis,
// where they share what stands with four at the rim that do not turn and come out of the cap
static int plane_cylinder(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  double n[3], down[3], x[3];
  double radius = b->size[0], half = b->size[1];
  column3(n, a->rotation, 2);
  rotate_back(down, b->rotation, n);
  scale3(down, -1, down);
  double rho = sqrt(down[0] * down[0] + down[1] * down[1]), tilt = rho / STANDS, square = tilt * tilt;
  int lower = down[2] < 0, stands = tilt < 1;
  // of the direction: 1 over its length, near the axis a multiple that joins it with two derivatives
  double by = stands ? radius / STANDS * (15 - square * (10 - 3 * square)) / 8 : radius / rho;
  double c = by * down[0], s = by * down[1];
  double z = lower ? -half : half, turn = sqrt(0.75);
  // feature: 0 and 1 the ends of the line, 2 and 3 the triangle of the upper end in its own axes, 4 and 5 of the lower, 6 to
  // 9 what does not turn of the upper and 10 to 13 of the lower
  double local[8][3] = {
      {c, s, z}, {c, s, -z}, {-c / 2 - turn * s, -s / 2 + turn * c, z}, {-c / 2 + turn * s, -s / 2 - turn * c, z}};
  int feature[8] = {lower, !lower, 2 + 2 * lower, 3 + 2 * lower};
  if (stands) {
    double in = radius * square * square / (1 - square), inside = lower ? in : -in;
    for (int k = 0; k < 4; k++) {
      set3(local[4 + k], k == 0 ? radius : k == 1 ? -radius : 0, k == 2 ? radius : k == 3 ? -radius : 0, z + inside);
      feature[4 + k] = 6 + 4 * lower + k;
    }
  }
  int count = 0;
  for (int k = 0; k < (stands ? 8 : 4); k++) {
    transform(x, b->pos, b->rotation, local[k]);
    double height = plane_height(a, x, n);
    if (height < margin) touch_plane(x, n, height, feature[k], touch + count++);
  }
  return count;
}

// corners below the centre: half of them, as each has its opposite
static int plane_box(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  double n[3], up[3], x[3];
  double centre = plane_height(a, b->pos, n);
  rotate_back(up, b->rotation, n);
  int count = 0;
  for (int corner = 0; corner < 8 && count < 4; corner++) {
    double local[3];
    for (int i = 0; i < 3; i++) { local[i] = corner >> i & 1 ? b->size[i] : -b->size[i]; }
    double offset = dot3(up, local);
    if (offset > 0 || centre + offset >= margin) continue;
    transform(x, b->pos, b->rotation, local);
    touch_plane(x, n, centre + offset, corner, touch + count++);
  }
  return count;
}

static int sphere_sphere(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  static const double up[3] = {0, 0, 1};
  return touch_spheres(a->pos, a->size[0], b->pos, b->size[0], up, margin, 0, touch);
}

static double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static int sphere_capsule(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  double axis[3], side[3], d[3], x[3];
  column3(axis, b->rotation, 2);
  column3(side, b->rotation, 0);
  sub3(d, a->pos, b->pos);
  axpy3(x, b->pos, clamp(dot3(d, axis), -b->size[1], b->size[1]), axis);
  return touch_spheres(a->pos, a->size[0], x, b->size[0], side, margin, 0, touch);
}

// sphere against a solid with a surface
static int sphere_solid(const cav_shape *a, const cav_shape *b, cav_surface *surface, double margin, cav_touch *touch) {
  double d[3], local[3], n[3];
  sub3(d, a->pos, b->pos);
  rotate_back(local, b->rotation, d);
  double height = surface(b->size, local, n), dist = height - a->size[0];
  if (dist >= margin) return 0;
  rotate(n, b->rotation, n);
  axpy3(touch->pos, a->pos, -(height + a->size[0]) / 2, n);
  scale3(touch->normal, -1, n);
  zero3(touch->tangent);
  touch->dist = dist;
  touch->feature = 0;
  return 1;
}

static int sphere_ellipsoid(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  return sphere_solid(a, b, cav_surface_ellipsoid, margin, touch);
}

static int sphere_cylinder(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  return sphere_solid(a, b, cav_surface_cylinder, margin, touch);
}

static int sphere_box(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  return sphere_solid(a, b, cav_surface_box, margin, touch);
}

/// Two segments p + s u, q + t w with |s| <= lu, |t| <= lw; d = q - p.
typedef struct segments {
  double u[3], w[3], d[3]; // u, w unit
  double lu, lw;
  double uw, ud, wd; // products
} segments;

// s nearest to the point t of the other segment, and t nearest to s
static double nearest_s(const segments *g, double t) { return clamp(g->ud + t * g->uw, -g->lu, g->lu); }
static double nearest_t(const segments *g, double s) { return clamp(s * g->uw - g->wd, -g->lw, g->lw); }

// touch of the balls at s and t
static int touch_at(const cav_shape *a, const cav_shape *b, const segments *g, double s, double t, double margin,
                    int feature, cav_touch *touch) {
  double x[3], y[3], side[3];
  axpy3(x, a->pos, s, g->u);
  axpy3(y, b->pos, t, g->w);
  column3(side, a->rotation, 0);
  return touch_spheres(x, a->size[0], y, b->size[0], side, margin, feature, touch);
}

// touch of balls inside both segments: the normal is the common perpendicular. So it stays defined where the axes
// cross, as they do all the time in planar models; there it is u x w itself
static int touch_across(const cav_shape *a, const cav_shape *b, const segments *g, const double cross[3], double s,
                        double margin, cav_touch *touch) {
  double n[3], apart = dot3(g->d, cross), length = norm3(cross);
  scale3(n, (apart < -CAV_CROSSING * length * (g->lu + g->lw) ? -1 : 1) / length, cross);
  apart = fmax(dot3(g->d, n), 0);
  double dist = apart - a->size[0] - b->size[0];
  if (dist >= margin) return 0;
  axpy3(touch->pos, a->pos, s, g->u);
  axpy3(touch->pos, touch->pos, a->size[0] + dist / 2, n);
  copy3(touch->normal, n);
  zero3(touch->tangent);
  touch->dist = dist;
  touch->feature = 0;
  return 1;
}

static int capsule_capsule(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  segments g = {.lu = a->size[1], .lw = b->size[1]};
  double cross[3];
  column3(g.u, a->rotation, 2);
  column3(g.w, b->rotation, 2);
  sub3(g.d, b->pos, a->pos);
  g.uw = dot3(g.u, g.w);
  g.ud = dot3(g.u, g.d);
  g.wd = dot3(g.w, g.d);
  cross3(cross, g.u, g.w);
  double sine2 = dot3(cross, cross);
  if (sine2 > CAV_PARALLEL * CAV_PARALLEL) {
    // nearest points of the lines, then clamped: the square distance is convex, two clamped updates reach its minimum
    double turned[3];
    cross3(turned, g.d, g.w);
    double s = dot3(turned, cross) / sine2, t = s * g.uw - g.wd;
    if (fabs(s) < g.lu && fabs(t) < g.lw) return touch_across(a, b, &g, cross, s, margin, touch);
    t = nearest_t(&g, clamp(s, -g.lu, g.lu));
    s = nearest_s(&g, t);
    return touch_at(a, b, &g, s, t, margin, 0, touch);
  }
  // parallel: both ends of the overlap along a, or the two ends that face each other
  double reach = fabs(g.uw) * g.lw, low = fmax(-g.lu, g.ud - reach), high = fmin(g.lu, g.ud + reach);
  if (high <= low) {
    double s = clamp(low, -g.lu, g.lu);
    return touch_at(a, b, &g, s, nearest_t(&g, s), margin, 0, touch);
  }
  int count = touch_at(a, b, &g, low, nearest_t(&g, low), margin, 1, touch);
  count += touch_at(a, b, &g, high, nearest_t(&g, high), margin, 2, touch + count);
  return count;
}

/// A capsule that holds a shape: half of its segment, along one of the shape's axes, and the radius about it.
typedef struct hull {
  double half, radius, along[3];
} hull;

// those of a sphere, capsule, ellipsoid, cylinder or box
static hull hull_of(const cav_shape *s) {
  const double *size = s->size;
  hull h = {.radius = size[0]};
  int axis = 2, solid = s->type == CAV_GEOM_BOX || s->type == CAV_GEOM_ELLIPSOID;
  for (int i = 0; i < 2 && solid; i++)
    if (size[i] > size[axis]) axis = i;
  const double b = size[(axis + 1) % 3], c = size[(axis + 2) % 3];
  if (s->type == CAV_GEOM_CAPSULE || s->type == CAV_GEOM_CYLINDER) h.half = size[1];
  if (s->type == CAV_GEOM_BOX) h.half = size[axis], h.radius = sqrt(b * b + c * c);
  // about the rounder end of an ellipsoid fits a ball of its second axis
  if (s->type == CAV_GEOM_ELLIPSOID) h.radius = b > c ? b : c, h.half = size[axis] - h.radius;
  column3(h.along, s->rotation, axis);
  return h;
}

int cav_shapes_apart(const cav_shape *a, const cav_shape *b, double margin) {
  if (a->type < CAV_GEOM_CAPSULE || b->type < CAV_GEOM_ELLIPSOID || b->type > CAV_GEOM_BOX) return 0;
  const hull ha = hull_of(a), hb = hull_of(b);
  segments g = {.lu = ha.half, .lw = hb.half};
  copy3(g.u, ha.along);
  copy3(g.w, hb.along);
  sub3(g.d, b->pos, a->pos);
  g.uw = dot3(g.u, g.w);
  g.ud = dot3(g.u, g.d);
  g.wd = dot3(g.w, g.d);
  const double reach = ha.radius + hb.radius + margin, size = ha.half + ha.radius + hb.half + hb.radius;
  const double sine2 = 1 - g.uw * g.uw;
  // three updates, one coordinate at the minimum for the other, end at the nearest points; of nearly parallel ones any near to it
  double s = sine2 > 1e-12 ? clamp((g.ud - g.uw * g.wd) / sine2, -g.lu, g.lu) : 0, t = nearest_t(&g, s), apart[3];
  s = nearest_s(&g, t);
  copy3(apart, g.d);
  axpy3(apart, apart, -s, g.u);
  axpy3(apart, apart, t, g.w);
  return reach > 0 && norm3(apart) > reach + 1e-6 * size;
}

// few and mostly in order
static void sort(cav_touch *touch, int count) {
  for (int i = 1; i < count; i++) {
    for (int k = i; k > 0 && touch[k].feature < touch[k - 1].feature; k--) {
      cav_touch later = touch[k - 1];
      touch[k - 1] = touch[k];
      touch[k] = later;
    }
  }
}

// the last two columns of every row: pairs that keep a hint are taken up below
#define MESH NULL, cav_collide_hfield

typedef int routine(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

int cav_collide_shapes(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  cav_hint none = {.na = 0};
  return cav_collide_again(a, b, margin, &none, touch);
}

int cav_collide_again(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_touch *touch) {
  // upper triangle over types; planes do not meet planes
  static routine *const table[CAV_GEOM_TYPES][CAV_GEOM_TYPES] = {
      {NULL, plane_sphere, plane_capsule, plane_ellipsoid, plane_cylinder, plane_box, cav_collide_plane_mesh, NULL},
      {NULL, sphere_sphere, sphere_capsule, sphere_ellipsoid, sphere_cylinder, sphere_box, MESH},
      {NULL, NULL, capsule_capsule, cav_collide_segment, cav_collide_segment, cav_collide_segment, MESH},
      {NULL, NULL, NULL, cav_collide_convex, cav_collide_convex, NULL, MESH},
      {NULL, NULL, NULL, NULL, cav_collide_convex, NULL, MESH},
      {NULL, NULL, NULL, NULL, NULL, cav_collide_boxes, MESH},
      {NULL, NULL, NULL, NULL, NULL, NULL, MESH},
      {NULL}};
  routine *collide = table[a->type][b->type];
  const int hinted = cav_types_keep_hint(a->type, b->type);
  int count = hinted ? cav_collide_hinted(a, b, margin, hint, touch) : collide ? collide(a, b, margin, touch) : 0;
  sort(touch, count);
  return count;
}
