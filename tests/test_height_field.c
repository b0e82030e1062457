/// Height fields: a level one is a plane; points on hills are those of the surface as a whole; a sphere's nearest point on
/// them by brute force. Files are in test_elevation.c, a model with one in test_mesh.c.
#include "proof.h"
#include "solid.h"

static const double MARGIN = 0.05;

static cav_shape level_field(const cav_hfield *h) {
  return (cav_shape){.type = CAV_GEOM_HFIELD, .size = h->size, .hfield = h, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

// a level field is a plane for whatever is above it: depth, normal, and no push sideways from walls between prisms. rough: by
// less than anything sees, so that it is made of prisms
static void test_level(double rough) {
  enum { SIDE = 21 };
  static double height[SIDE * SIDE];
  for (int i = 0; i < SIDE * SIDE; i++) height[i] = rough * scene_uniform();
  cav_hfield h = {.name = "", .nrow = SIDE, .ncol = SIDE, .size = {2, 2}, .top = 1, .base = 1, .height = height};
  cav_shape ground = level_field(&h), plane = ground;
  plane.type = CAV_GEOM_PLANE;
  for (int type = 1; type <= CAV_GEOM_MESH; type++) {
    double most = 0, tilt = 0;
    int missed = 0;
    for (int k = 0; k < 500; k++) {
      solid a;
      cav_touch touch[CAV_TOUCH_MAX], flat[CAV_TOUCH_MAX];
      solid_random(type, 0, &a);
      set3(a.shape.pos, scene_between(-1, 1), scene_between(-1, 1), 0);
      double down[3] = {0, 0, -1}, x[3];
      cav_shape_support(&a.shape, down, x);
      a.shape.pos[2] -= x[2] + scene_between(-0.03, 0.03);
      int n = cav_collide_shapes(&a.shape, &ground, MARGIN, touch);
      int m = cav_collide_shapes(&plane, &a.shape, MARGIN, flat);
      missed += !n || !m;
      if (n && m) most = fmax(most, fabs(touch[proof_nearest(touch, n)].dist - flat[proof_nearest(flat, m)].dist));
      for (int i = 0; i < n; i++) tilt = fmax(tilt, 1 + touch[i].normal[2]);
      solid_clear(&a);
    }
    printf("%-10s on a level field%s: depth differs from a plane's by %.1e, normal by %.1e\n", solid_names[type],
           rough > 0 ? " of prisms" : "", most, tilt);
    CHECK(missed == 0);
    // points of a cylinder next to upright on a plane are off by up to 0.7 % of its radius; seen: 9.9e-4 at 0.14 m
    CHECK_NEAR(most, 0, rough > 0 && type == CAV_GEOM_CYLINDER ? 1e-3 : 1e-12 + 2 * rough); // seen: 4e-16
    // of prisms what leans less than SAME_NORMAL is kept beside an edge
    CHECK_NEAR(tilt, 0, rough > 0 ? 1.1e-9 : 1e-10);
  }
  // a box flat on it: its four corners are among the points
  static const double half[3] = {0.25, 0.33, 0.1};
  cav_shape box = {
      .type = CAV_GEOM_BOX, .size = half, .pos = {0.11, 0.07, 0.099}, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  for (int above = 0; above < 2; above++) {
    cav_touch touch[CAV_TOUCH_MAX];
    box.pos[2] = above ? 0.101 : 0.099;
    int n = cav_collide_shapes(&box, &ground, MARGIN, touch), corners = 0;
    for (int k = 0; k < n; k++) {
      CHECK_NEAR(touch[k].dist, above ? 1e-3 : -1e-3, 1e-14 + 2 * rough);
      corners += fabs(fabs(touch[k].pos[0] - box.pos[0]) - half[0]) < 1e-6 &&
                 fabs(fabs(touch[k].pos[1] - box.pos[1]) - half[1]) < 1e-6;
    }
    CHECK(n == (rough > 0 ? 8 : 4) && corners == 4);
  }
}

// whether a point of a field's surface, in its axes, and a normal out of it are those of the surface as a whole: no triangle
// about the point sticks out of the plane through it
static int supports(const cav_hfield *h, const double p[3], const double up[3]) {
  const double dx = 2 * h->size[0] / (h->ncol - 1), dy = 2 * h->size[1] / (h->nrow - 1);
  for (int r = 0; r < h->nrow - 1; r++)
    for (int c = 0; c < h->ncol - 1; c++)
      for (int half = 0; half < 2; half++) {
        const int at[3][2] = {{r, c}, {half ? r + 1 : r, c + 1}, {r + 1, c + !half}};
        double x[3][3], least = INFINITY, most = -INFINITY;
        for (int k = 0; k < 3; k++)
          set3(x[k], -h->size[0] + at[k][1] * dx, -h->size[1] + at[k][0] * dy,
               h->height[at[k][0] * h->ncol + at[k][1]]);
        for (int k = 0; k < 3; k++) {
          const double *a = x[k], *b = x[(k + 1) % 3];
          double d[3];
          least = fmin(least, (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]));
          sub3(d, a, p);
          most = fmax(most, dot3(d, up));
        }
        if (least > -1e-7 * dx * dy && most > 1e-7) return 0;
      }
  return 1;
}

// points on hills are those with all prisms that the surface as a whole has: none far beside a shape is missed
static void test_all_prisms(int type, double tall, double margin) {
  enum { SIDE = 10 };
  static double height[SIDE * SIDE];
  for (int i = 0; i < SIDE * SIDE; i++) height[i] = tall * (scene_uniform() + 1);
  cav_hfield h = {
      .name = "", .nrow = SIDE, .ncol = SIDE, .size = {1, 1}, .top = 2 * tall, .base = 0.1, .height = height};
  cav_shape ground = level_field(&h);
  int compared = 0, points = 0, missed = 0;
  for (int k = 0; k < 120; k++) {
    solid a;
    cav_touch touch[CAV_TOUCH_MAX];
    solid_random(type, 0, &a);
    for (int i = 0; i < 3 && type < CAV_GEOM_MESH; i++)
      a.size[i] *= tall < 0.05 ? 0.1 : 0.4; // what is small meets tips beside it
    set3(a.shape.pos, scene_between(-0.6, 0.6), scene_between(-0.6, 0.6), scene_between(1.5 * tall, 1.5 * tall + 0.2));
    const int n = cav_collide_shapes(&a.shape, &ground, margin, touch);
    int apart = n < CAV_TOUCH_MAX, seen = 0, absent = 0; // what overlaps a prism has points by their height over it
    for (int i = 0; i < n; i++) apart &= touch[i].dist > 0;
    for (int f = 0; f < 2 * (SIDE - 1) * (SIDE - 1) && apart; f++) {
      cav_prism prism;
      cav_touch with[CAV_TOUCH_MAX];
      CHECK(cav_hfield_prism(&ground, CAV_LEVEL_FEATURES + CAV_PRISM_FEATURES * f, &prism) == 0);
      const int m = cav_collide_shapes(&a.shape, &prism.shape, margin, with);
      for (int i = 0; i < m; i++) {
        double y[3], up[3], nearest = INFINITY;
        axpy3(y, with[i].pos, with[i].dist / 2, with[i].normal);
        scale3(up, -1, with[i].normal);
        apart &= with[i].dist > 0;
        if (!supports(&h, y, up)) continue;
        for (int j = 0; j < n; j++) {
          double d[3];
          sub3(d, touch[j].pos, with[i].pos);
          nearest = fmin(nearest, norm3(d));
        }
        seen++;
        absent += nearest > 1e-6;
      }
    }
    if (apart) compared += n > 0, points += seen, missed += absent;
    solid_clear(&a);
  }
  printf("%-10s over hills of %.2f m: %d poses, %d points with all prisms, %d missed\n", solid_names[type], 2 * tall,
         compared, points, missed);
  CHECK(compared > 20 && points > 20 && missed == 0);
}

// over hills a sphere's nearest point is found by brute force over all triangles
static void test_hills(void) {
  enum { SIDE = 15 };
  static double height[SIDE * SIDE];
  for (int i = 0; i < SIDE * SIDE; i++) height[i] = 0.3 * (scene_uniform() + 1);
  cav_hfield h = {.name = "", .nrow = SIDE, .ncol = SIDE, .size = {1, 1}, .top = 0.6, .base = 0.1, .height = height};
  cav_shape ground = level_field(&h);
  double most = 0, step = 2.0 / (SIDE - 1);
  int compared = 0;
  for (int k = 0; k < 2000; k++) {
    double radius[3] = {scene_between(0.02, 0.1)};
    cav_shape ball = {.type = CAV_GEOM_SPHERE, .size = radius, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    set3(ball.pos, scene_between(-0.9, 0.9), scene_between(-0.9, 0.9), scene_between(0, 0.8));
    double best = INFINITY, up = 0;
    for (int r = 0; r < SIDE - 1; r++) {
      for (int c = 0; c < SIDE - 1; c++) {
        for (int half = 0; half < 2; half++) {
          // the thin prism of a triangle as a mesh of three points
          int at[3] = {r * SIDE + c, half ? (r + 1) * SIDE + c + 1 : r * SIDE + c + 1, (r + 1) * SIDE + c + !half};
          double x[9];
          for (int i = 0; i < 3; i++)
            set3(x + 3 * i, -1 + at[i] % SIDE * step, -1 + at[i] / SIDE * step, height[at[i]]);
          solid thin = {.shape.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
          solid_mesh(&thin, x, 3);
          thin.shape.size = thin.size;
          cav_touch t[CAV_TOUCH_MAX];
          int n = cav_collide_shapes(&ball, &thin.shape, 1, t);
          if (n && t[proof_nearest(t, n)].dist < best) {
            best = t[proof_nearest(t, n)].dist;
            up = t[proof_nearest(t, n)].normal[2];
          }
          solid_clear(&thin);
        }
      }
    }
    // a centre below the surface has another way out
    if (!(best < 0.02 && best > -radius[0] && up < 0)) continue;
    double p[3] = {ball.pos[0], ball.pos[1], ball.pos[2]}, down[3] = {0, 0, -1};
    if (cav_ray(&ground, p, down) < 0) continue;
    cav_touch touch[CAV_TOUCH_MAX];
    int n = cav_collide_shapes(&ball, &ground, 0.02, touch);
    CHECK(n > 0);
    if (n) most = fmax(most, fabs(touch[proof_nearest(touch, n)].dist - best));
    compared++;
  }
  printf("spheres over hills: %d compared with all triangles, distance differs by %.1e\n", compared, most);
  CHECK(compared > 100);
  CHECK_NEAR(most, 0, 1e-12); // seen: 2e-16
}

int main(void) {
#ifndef CAVORT_HAVE_QHULL
  puts("SKIPPED: meshes need Qhull, which this build is without");
  return CHECK_SKIPPED;
#endif
  test_level(0);
  test_level(1e-11);
  test_hills();
  for (int type = 1; type <= CAV_GEOM_MESH; type++)
    test_all_prisms(type, 0.1, MARGIN), test_all_prisms(type, 0.01, 0.15);
  return check_result();
}
