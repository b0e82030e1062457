/// The narrow phase of two geoms in four poses each, with the operations and the order of a single pair (pairs.c):
/// spheres and capsules against each other, and these and boxes over a plane that stands. What is chosen by a
/// number is done both ways where some pose wants each. Poses that are not asked for may hold anything: their
/// numbers are thrown away.
#include <math.h>

// first of what is written over its numbers: what is below takes four where it would take one
#include "by_four.h"

#include "capsules_four.h"
#include "spatial.h"
#include "touch_four.h"

typedef cav_four_masks masks;

// the poses of set bits
CAV_INLINE masks masks_of(int bits) {
  const masks bit = {1, 2, 4, 8}, all = {bits, bits, bits, bits};
  return (all & bit) != 0;
}

CAV_INLINE cav_four clamp(cav_four x, double most) {
  return choose(x < -most, CAV_ALL(-most), choose(x > most, CAV_ALL(most), x));
}

// column k of the rotation of a geom
CAV_INLINE void axis_of(const cav_geom_four *g, int k, cav_four axis[3]) {
  const double *own = g->geom->rotation;
  const cav_four *R = g->rotation;
  for (int i = 0; i < 3; i++) {
    axis[i] = CAV_ALL(own[3 * i + k]);
    if (R) axis[i] = R[3 * i] * own[k] + R[3 * i + 1] * own[3 + k] + R[3 * i + 2] * own[6 + k];
  }
}

// one point at a height above a plane, of x on the surface
CAV_INLINE void touch_plane(const cav_four x[3], const cav_four n[3], cav_four height, cav_touch_four *touch) {
  axpy3(touch->pos, x, -height / 2, n);
  copy3(touch->normal, n);
  touch->dist = height;
}

CAV_INLINE cav_four plane_height(const cav_geom_four *plane, const cav_four x[3], const cav_four n[3]) {
  cav_four d[3];
  sub3(d, x, plane->pos);
  return dot3(d, n);
}

// plane against balls about c
CAV_INLINE int plane_ball(const cav_geom_four *a, const cav_four n[3], const cav_four c[3], double radius,
                          double margin, int bits, int feature, const cav_four tangent[3], cav_touch_four *touch) {
  const cav_four height = plane_height(a, c, n) - radius;
  touch->bits = held_bits(~(height >= margin)) & bits;
  if (!touch->bits) return 0;
  cav_four x[3];
  axpy3(x, c, CAV_ALL(-radius), n);
  touch_plane(x, n, height, touch);
  copy3(touch->tangent, tangent);
  touch->feature = feature;
  return 1;
}

CAV_BY_FOUR static int plane_sphere(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                                    cav_touch_four *touch) {
  cav_four n[3], none[3];
  axis_of(a, 2, n);
  zero3(none);
  return plane_ball(a, n, b->pos, b->geom->size[0], margin, bits, 0, none, touch);
}

CAV_BY_FOUR static int plane_capsule(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                                     cav_touch_four *touch) {
  cav_four n[3], axis[3], end[3];
  axis_of(a, 2, n);
  axis_of(b, 2, axis);
  const double radius = b->geom->size[0], half = b->geom->size[1];
  int count = 0;
  for (int side = 0; side < 2; side++) {
    axpy3(end, b->pos, CAV_ALL(side ? -half : half), axis);
    count += plane_ball(a, n, end, radius, margin, bits, side, axis, touch + count);
  }
  return count;
}

CAV_BY_FOUR static int plane_box(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                                 cav_touch_four *touch) {
  cav_four n[3], R[9], column[3], up[3], x[3];
  const double *size = b->geom->size;
  axis_of(a, 2, n);
  for (int k = 0; k < 3; k++) {
    axis_of(b, k, column);
    for (int i = 0; i < 3; i++) R[3 * i + k] = column[i];
  }
  const cav_four centre = plane_height(a, b->pos, n);
  rotate_back(up, R, n);
  cav_four found = CAV_ALL(0);
  int count = 0;
  for (int corner = 0; corner < 8; corner++) {
    cav_four local[3];
    for (int i = 0; i < 3; i++) local[i] = CAV_ALL(corner >> i & 1 ? size[i] : -size[i]);
    const cav_four offset = dot3(up, local), height = centre + offset;
    const masks here = ~((offset > 0) | (height >= margin)) & (found < 4);
    cav_touch_four *t = touch + count;
    t->bits = held_bits(here) & bits;
    if (!t->bits) continue;
    found = choose(here, found + 1, found);
    transform(x, b->pos, R, local);
    touch_plane(x, n, height, t);
    zero3(t->tangent);
    t->feature = corner;
    count++;
  }
  return count;
}

// balls about p and q; -1: some have one centre
CAV_INLINE int touch_spheres(const cav_four p[3], double rp, const cav_four q[3], double rq, double margin, int bits,
                             cav_touch_four *touch) {
  cav_four n[3];
  sub3(n, q, p);
  const cav_four length2 = dot3(n, n);
  const double reach = margin + rp + rq;
  touch->bits = reach <= 0 ? 0 : held_bits(~(length2 >= reach * reach)) & bits;
  if (!touch->bits) return 0;
  cav_four length = roots(length2);
  const masks apart = length > 0;
  if (held_bits(~apart) & touch->bits) return -1;
  length = choose(apart, length, CAV_ALL(1));
  scale3(touch->normal, 1 / length, n);
  touch->dist = length - rp - rq;
  axpy3(touch->pos, p, rp + touch->dist / 2, touch->normal);
  zero3(touch->tangent);
  touch->feature = 0;
  return 1;
}

CAV_BY_FOUR static int sphere_sphere(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                                     cav_touch_four *touch) {
  return touch_spheres(a->pos, a->geom->size[0], b->pos, b->geom->size[0], margin, bits, touch);
}

CAV_BY_FOUR static int sphere_capsule(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                                      cav_touch_four *touch) {
  cav_four axis[3], d[3], x[3];
  axis_of(b, 2, axis);
  sub3(d, a->pos, b->pos);
  axpy3(x, b->pos, clamp(dot3(d, axis), b->geom->size[1]), axis);
  return touch_spheres(a->pos, a->geom->size[0], x, b->geom->size[0], margin, bits, touch);
}

CAV_BY_FOUR static int capsule_capsule(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                                       cav_touch_four *touch) {
  const double ra = a->geom->size[0], rb = b->geom->size[0], lu = a->geom->size[1], lw = b->geom->size[1];
  cav_four u[3], w[3], d[3], cross[3], turned[3], x[3], y[3], n[3];
  axis_of(a, 2, u);
  axis_of(b, 2, w);
  sub3(d, b->pos, a->pos);
  const cav_four uw = dot3(u, w), ud = dot3(u, d), wd = dot3(w, d);
  cross3(cross, u, w);
  cav_four sine2 = dot3(cross, cross);
  const masks skew = sine2 > CAV_PARALLEL * CAV_PARALLEL;
  if (held_bits(~skew) & bits) return -1;
  sine2 = choose(skew, sine2, CAV_ALL(1));
  cross3(turned, d, w);
  const cav_four s = dot3(turned, cross) / sine2, t = s * uw - wd;
  const masks across = (sizes(s) < lu) & (sizes(t) < lw);
  const int inner = held_bits(across) & bits, outer = bits & ~inner;

  // some end is nearest
  touch->bits = 0;
  if (outer) {
    const cav_four at = clamp(clamp(s, lu) * uw - wd, lw), from = clamp(ud + at * uw, lu);
    axpy3(x, a->pos, from, u);
    axpy3(y, b->pos, at, w);
    if (touch_spheres(x, ra, y, rb, margin, outer, touch) < 0) return -1;
  }
  if (!inner) return touch->bits != 0;

  // along the common perpendicular
  const cav_four length = choose(skew, roots(dot3(cross, cross)), CAV_ALL(1));
  const masks back = dot3(d, cross) < -CAV_CROSSING * length * (lu + lw);
  scale3(n, choose(back, CAV_ALL(-1), CAV_ALL(1)) / length, cross);
  const cav_four gap = dot3(d, n), dist = choose(gap > 0, gap, CAV_ALL(0)) - ra - rb;
  const int there = held_bits(~(dist >= margin)) & inner;
  if (!there) return touch->bits != 0;
  axpy3(x, a->pos, s, u);
  axpy3(x, x, ra + dist / 2, n);
  const masks ends = masks_of(touch->bits);
  for (int k = 0; k < 3; k++) {
    touch->pos[k] = choose(ends, touch->pos[k], x[k]);
    touch->normal[k] = choose(ends, touch->normal[k], n[k]);
  }
  touch->dist = choose(ends, touch->dist, dist);
  zero3(touch->tangent);
  touch->feature = 0;
  touch->bits |= there;
  return 1;
}

typedef int routine(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits, cav_touch_four *touch);

// upper triangle over types
static routine *routine_of(cav_geom_type a, cav_geom_type b) {
  static routine *const table[CAV_GEOM_TYPES][CAV_GEOM_TYPES] = {
      [CAV_GEOM_PLANE] =
          {[CAV_GEOM_SPHERE] = plane_sphere, [CAV_GEOM_CAPSULE] = plane_capsule, [CAV_GEOM_BOX] = plane_box},
      [CAV_GEOM_SPHERE] = {[CAV_GEOM_SPHERE] = sphere_sphere, [CAV_GEOM_CAPSULE] = sphere_capsule},
      [CAV_GEOM_CAPSULE] = {[CAV_GEOM_CAPSULE] = capsule_capsule}};
  return table[a][b];
}

int cav_touches_by_four(cav_geom_type a, cav_geom_type b) { return routine_of(a, b) != NULL; }

int cav_touches_four(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                     cav_touch_four touch[CAV_TOUCH_MAX]) {
  return routine_of(a->geom->type, b->geom->type)(a, b, margin, bits, touch);
}
