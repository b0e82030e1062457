/// Meshes: hulls, files, masses; contacts that carry their own proof (proof.h); the same contacts as primitives where
/// both exist; derivatives by displacement; degenerate meshes; damaged files; models with meshes and height fields; MuJoCo.
#include "mesh.h"
#include "proof.h"
#include "solid.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

static void bring_near(const solid *a, solid *b) {
  double n[3] = {scene_uniform(), scene_uniform(), scene_uniform()}, x[3], y[3], back[3], d[3];
  normalise3(n);
  if (a->shape.type == CAV_GEOM_PLANE) {
    column3(n, a->shape.rotation, 2);
    copy3(x, a->shape.pos);
  } else {
    cav_shape_support(&a->shape, n, x);
  }
  scale3(back, -1, n);
  cav_shape_support(&b->shape, back, y);
  sub3(d, x, y);
  axpy3(d, d, scene_between(-0.04, 0.04), n);
  add3(b->shape.pos, b->shape.pos, d);
}

enum { POSES = CHECK_CASES(2000) };
static const double MARGIN = 0.05;

static void test_certificates(int type, int kind) {
  int contacts = 0, points = 0, apart = 0, loose = 0;
  double surface = 0, gap = 0, unit = 0;
  for (int k = 0; k < POSES; k++) {
    solid a, b;
    cav_touch touch[CAV_TOUCH_MAX];
    solid_random(type, kind, &a);
    solid_random(CAV_GEOM_MESH, kind, &b);
    bring_near(&a, &b);
    int n = cav_collide_shapes(&a.shape, &b.shape, MARGIN, touch);
    CHECK(n >= 0 && n <= CAV_TOUCH_MAX);
    if (n > 0) {
      const cav_touch *t = touch + proof_nearest(touch, n);
      proof is = proof_of(&a.shape, &b.shape, t);
      contacts++;
      points += n;
      apart += t->dist > 0;
      unit = fmax(unit, fabs(norm3(t->normal) - 1));
      loose += !(is.surface <= 1e-12 && is.gap <= 1e-12);
      surface = fmax(surface, is.surface);
      gap = fmax(gap, is.gap);
      for (int i = 0; i < n; i++) {
        CHECK(touch[i].dist < MARGIN);
        for (int j = 0; j < i; j++) CHECK(touch[i].feature != touch[j].feature);
      }
    }
    solid_clear(&a);
    solid_clear(&b);
  }
  printf("%-10s mesh %d %5d in contact, %5d apart, %6d points: surface %.1e gap %.1e unit %.1e, %d unproven\n",
         solid_names[type], kind, contacts, apart, points, surface, gap, unit, loose);
  CHECK(contacts == POSES);
  CHECK(apart > POSES / 3 && apart < POSES * 2 / 3);
  // seen: surfaces to 2e-15, gaps to 2e-15; with more poses 0 of 20,000 beyond 1e-9
  CHECK(loose == 0);
  CHECK_NEAR(unit, 0, 1e-14);
}

// a mesh with the corners of a box meets what the box meets
static void test_box_as_mesh(void) {
  for (int type = 0; type < CAV_GEOM_BOX; type++) {
    double most = 0, turned = 0;
    int counts = 0;
    for (int k = 0; k < POSES; k++) {
      solid a, b, c;
      cav_touch as_mesh[CAV_TOUCH_MAX], as_box[CAV_TOUCH_MAX];
      solid_random(type, 0, &a);
      solid_random(CAV_GEOM_MESH, 2, &b);
      c = b;
      c.shape.type = CAV_GEOM_BOX;
      bring_near(&a, &b);
      copy3(c.shape.pos, b.shape.pos);
      b.shape.size = b.size;
      c.shape.size = c.size;
      int n = cav_collide_shapes(&a.shape, &b.shape, MARGIN, as_mesh);
      int m = cav_collide_shapes(&a.shape, &c.shape, MARGIN, as_box);
      counts += n == m;
      if (n && m) {
        const cav_touch *t = as_mesh + proof_nearest(as_mesh, n), *u = as_box + proof_nearest(as_box, m);
        // the larger gap is the better answer in an overlap
        double excess = u->dist - t->dist;
        most = fmax(most, t->dist > 0 ? fabs(excess) : excess);
        if (fabs(excess) < 1e-12) turned = fmax(turned, 1 - dot3(t->normal, u->normal));
      }
      solid_clear(&b);
    }
    printf("%-10s box as mesh: %4d of %d with as many points, gap shorter by %.1e, normal off by %.1e\n",
           solid_names[type], counts, POSES, most, turned);
    CHECK(most < 1e-8); // seen: 4e-9 with ellipsoids, 1e-15 with the rest
  }
}

// gap of the nearest point under small displacements: its rate is the normal's fraction of the motion
static void test_derivatives(void) {
  const double step = 1e-7;
  for (int type = 1; type <= CAV_GEOM_MESH; type++) {
    int outliers = 0, all = 0;
    for (int k = 0; k < 300; k++) {
      solid a, b;
      cav_touch touch[CAV_TOUCH_MAX];
      solid_random(type, 0, &a);
      solid_random(CAV_GEOM_MESH, 0, &b);
      bring_near(&a, &b);
      int n = cav_collide_shapes(&a.shape, &b.shape, MARGIN, touch);
      if (n) {
        const cav_touch *t = touch + proof_nearest(touch, n);
        double turn[3] = {scene_uniform(), scene_uniform(), scene_uniform()}, dist[2], y[3], v[3];
        for (int s = 0; s < 2; s++) {
          cav_shape c = b.shape;
          double q[4], R[9], w[3];
          cav_touch moved[CAV_TOUCH_MAX];
          scale3(w, s ? step : -step, turn);
          quat_exp(q, w);
          quat_matrix(R, q);
          matmul3(c.rotation, R, c.rotation);
          rotate(c.pos, R, c.pos);
          int m = cav_collide_shapes(&a.shape, &c, MARGIN, moved);
          dist[s] = m ? moved[proof_nearest(moved, m)].dist : NAN;
        }
        axpy3(y, t->pos, t->dist / 2, t->normal);
        cross3(v, turn, y);
        all++;
        outliers += !(fabs((dist[1] - dist[0]) / (2 * step) - dot3(v, t->normal)) < 1e-5);
      }
      solid_clear(&a);
      solid_clear(&b);
    }
    printf("%-10s mesh: derivative of the gap, %d of %d beyond 1e-5\n", solid_names[type], outliers, all);
    // a step may cross an edge: seen 0 to 2
    CHECK(outliers <= 4);
  }
}

// flat, thin, single-pointed and coincident meshes: something sane or nothing
static void test_degenerate(void) {
  static const double flat[4 * 3] = {-0.1, -0.1, 0, 0.1, -0.1, 0, 0.1, 0.1, 0, -0.1, 0.1, 0};
  static const double line[2 * 3] = {-0.1, 0, 0, 0.1, 0, 0}, one[3] = {0, 0, 0};
  static const double *const points[] = {flat, line, one};
  static const int counts[] = {4, 2, 1};
  for (int kind = 0; kind < 3; kind++) {
    for (int type = 0; type <= CAV_GEOM_MESH; type++) {
      for (int pose = 0; pose < 200; pose++) {
        solid a, b = {.shape.type = CAV_GEOM_MESH};
        cav_touch touch[CAV_TOUCH_MAX];
        solid_random(type, 2, &a);
        solid_mesh(&b, points[kind], counts[kind]);
        b.shape.size = b.size;
        solid_place(&b.shape);
        // aligned and in each other's centre, aligned, or any way
        if (pose < 50) memcpy(b.shape.rotation, a.shape.rotation, sizeof a.shape.rotation);
        for (int k = 0; k < 3; k++) b.shape.pos[k] = a.shape.pos[k] + (pose < 10 ? 0 : scene_between(-0.2, 0.2));
        int n = cav_collide_shapes(&a.shape, &b.shape, MARGIN, touch);
        CHECK(n >= 0 && n <= CAV_TOUCH_MAX);
        if (pose < 10) CHECK(n > 0);
        for (int k = 0; k < n; k++) {
          CHECK_NEAR(norm3(touch[k].normal), 1, 1e-12);
          CHECK(isfinite(norm3(touch[k].pos)) && touch[k].dist < MARGIN && touch[k].dist > -2);
        }
        solid_clear(&a);
        solid_clear(&b);
      }
    }
  }
}

// over a face of many corners in one plane, or bent by a thousandth of a millionth of its size, the nearest is proven
// from a hint, with the same bits whichever three of its corners the hint has
static void test_wide_face(void) {
  enum { SIDES = 12 };
  for (int bent = 0; bent < 2; bent++) {
    double point[2 * SIDES * 3], radius = 0.02;
    for (int k = 0; k < 2 * SIDES; k++) {
      double turn = 2 * M_PI * (k % SIDES) / SIDES;
      set3(point + 3 * k, 0.1 * cos(turn), 0.1 * sin(turn), k < SIDES ? -0.05 : 0.05 - (bent && k % 2 ? 1e-9 : 0));
    }
    solid a = {.size = {radius}, .shape = {.type = CAV_GEOM_SPHERE, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    solid b = {.shape = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    solid_mesh(&b, point, 2 * SIDES);
    a.shape.size = a.size, b.shape.size = b.size;
    cav_hint hint = {.na = 0};
    int proven = 0;
    for (int k = 0; k < 200; k++) {
      // now and then far enough for other corners to be the nearest three
      set3(a.shape.pos, scene_between(-0.06, 0.06), scene_between(-0.06, 0.06), 0.08);
      cav_touch touch[CAV_TOUCH_MAX], anew[CAV_TOUCH_MAX];
      int n = cav_collide_again(&a.shape, &b.shape, MARGIN, &hint, touch);
      proven += hint.na == 1 && hint.nb == 3;
      CHECK(n == 1 && cav_collide_shapes(&a.shape, &b.shape, MARGIN, anew) == 1);
      CHECK(touch->dist == anew->dist && !memcmp(touch->pos, anew->pos, sizeof anew->pos));
      CHECK_NEAR(touch->dist, 0.01, bent ? 2e-9 : 1e-16);
    }
    printf("over a face of %d corners%s: %d of 200 proven\n", SIDES, bent ? ", bent" : "", proven);
    CHECK(proven == 200);
    solid_clear(&b);
  }
}

static int same_touches(const cav_touch *a, const cav_touch *b, int n) {
  int same = 1;
  for (int i = 0; i < n; i++)
    same &= a[i].feature == b[i].feature && !memcmp(&a[i], &b[i], offsetof(cav_touch, feature));
  return same;
}

// a cylinder or an ellipsoid near a side of a box: from whichever three of its corners the hint has, and after any move, the bits
// are those of a search from nothing
static void test_curved_over_box(void) {
  int over = 0, found = 0;
  for (int k = 0; k < POSES; k++) {
    solid a, b;
    solid_random(k % 2 ? CAV_GEOM_CYLINDER : CAV_GEOM_ELLIPSOID, 0, &a);
    solid_random(CAV_GEOM_BOX, 0, &b);
    cav_hint hint = {.na = 0};
    for (int move = 0; move < 8; move++) {
      cav_touch anew[CAV_TOUCH_MAX], again[CAV_TOUCH_MAX];
      double n[3], low[3], d[3];
      column3(n, b.shape.rotation, k % 3);
      for (int i = 0; i < 3; i++) d[i] = -n[i];
      cav_shape_support(&a.shape, d, low);
      axpy3(d, b.shape.pos, b.size[k % 3] + scene_between(-0.02, MARGIN), n);
      sub3(d, d, low);
      for (int i = 0; i < 3; i++)
        a.shape.pos[i] += d[i] + (move % 4 ? scene_between(-0.02, 0.02) : scene_between(-0.3, 0.3));
      const int count = cav_collide_shapes(&a.shape, &b.shape, MARGIN, anew);
      CHECK(cav_collide_again(&a.shape, &b.shape, MARGIN, &hint, again) == count);
      CHECK(same_touches(anew, again, count));
      found += count > 0;
      if (hint.apart || hint.nb != 3) continue;
      const int differ = (hint.b[0] ^ hint.b[1]) | (hint.b[0] ^ hint.b[2]), fixed = hint.b[0] & ~differ;
      const int k1 = differ & -differ, corner[4] = {fixed, fixed | k1, fixed | (differ - k1), fixed | differ};
      for (int left = 0; left < 4; left++) {
        for (int i = 0, at = 0; i < 4; i++)
          if (i != left) hint.b[at++] = corner[i];
        CHECK(cav_collide_again(&a.shape, &b.shape, MARGIN, &hint, again) == count);
        CHECK(same_touches(anew, again, count));
        over += hint.nb == 3;
      }
    }
    solid_clear(&a), solid_clear(&b);
  }
  printf("curved bodies near boxes: %d of %d meet, proven over a side %d times\n", found, 8 * POSES, over);
  CHECK(over > POSES && found > 4 * POSES);
}

// over a side of a box a corner of a mesh is proven to be nearest from whichever three of the side's corners the hint has, by the
// height above that side
static void test_side_of_box(void) {
  int proven = 0;
  for (int k = 0; k < POSES; k++) {
    solid a, b;
    solid_random(CAV_GEOM_BOX, 0, &a);
    solid_random(CAV_GEOM_MESH, 0, &b);
    // its lowest corner over a side, turned anyhow
    double n[3], x[3], back[3], over[3], along[3];
    column3(n, a.shape.rotation, k % 3);
    if (k % 2) scale3(n, -1, n);
    scale3(back, -1, n);
    cav_shape_support(&b.shape, back, x);
    axpy3(over, a.shape.pos, a.size[k % 3] + scene_between(0.001, 0.02), n);
    for (int way = 1; way < 3; way++) {
      column3(along, a.shape.rotation, (k + way) % 3);
      axpy3(over, over, scene_between(-0.9, 0.9) * a.size[(k + way) % 3], along);
    }
    sub3(over, over, x);
    add3(b.shape.pos, b.shape.pos, over);
    cav_touch first[CAV_TOUCH_MAX], again[CAV_TOUCH_MAX];
    cav_hint hint = {.na = 0};
    const int found = cav_collide_again(&a.shape, &b.shape, MARGIN, &hint, first);
    // but where two corners are as low
    CHECK(found);
    if (hint.na != 3 || hint.nb != 1) {
      solid_clear(&a), solid_clear(&b);
      continue;
    }
    // its four corners in four ways
    const int differ = (hint.a[0] ^ hint.a[1]) | (hint.a[0] ^ hint.a[2]), fixed = hint.a[0] & ~differ;
    const int k1 = differ & -differ, corner[4] = {fixed, fixed | k1, fixed | (differ - k1), fixed | differ};
    for (int left = 0; left < 4; left++) {
      cav_hint other = hint;
      for (int i = 0, at = 0; i < 4; i++)
        if (i != left) other.a[at++] = corner[i];
      const int n_again = cav_collide_again(&a.shape, &b.shape, MARGIN, &other, again);
      CHECK(n_again == found && !memcmp(first, again, (size_t)found * sizeof *first));
      proven += other.na == 3;
    }
    cav_touch anew[CAV_TOUCH_MAX];
    CHECK(cav_collide_shapes(&a.shape, &b.shape, MARGIN, anew) == found);
    CHECK_NEAR(first->dist, anew->dist, 1e-14);
    solid_clear(&a), solid_clear(&b);
  }
  printf("over a side of a box: %d of %d proven from other corners of it\n", proven, 4 * POSES);
  CHECK(proven > 0.99 * 4 * POSES);
}

// --- files ---

static void put_float(unsigned char *p, double x) {
  float f = (float)x;
  memcpy(p, &f, 4);
}

// triangles of a box, outward, as STL in binary
static size_t box_stl(const double half[3], unsigned char *out) {
  static const int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  double corner[24];
  solid_box_corners(half, corner);
  memset(out, 0, 84 + 12 * 50);
  out[80] = 12;
  for (int i = 0; i < 12; i++) {
    const int *q = quads[i / 2];
    int v[3] = {q[0], q[i % 2 ? 2 : 1], q[i % 2 ? 3 : 2]};
    for (int k = 0; k < 9; k++) put_float(out + 84 + 50 * i + 12 + 4 * k, corner[3 * v[k / 3] + k % 3]);
  }
  return 84 + 12 * 50;
}

static const char text_stl[] =
    "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
static const char obj[] =
    "# box\no b\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
    "vn 0 0 1\nf 4 3 2 1\nf 5/1 6/2 7/3 8/4\nf 1//1 2//1 6//1 5//1\nf -7 -6 -2 -3\nf 3 4 8 7\nf 4 1 5 8\n";

static void test_files(void) {
  static const double half[3] = {0.5, 0.25, 1};
  unsigned char stl[1000];
  char reason[200] = "";
  cav_triangles t;
  size_t size = box_stl(half, stl);
  CHECK(cav_mesh_read_stl((char *)stl, size, &t, reason, sizeof reason) == CAV_OK);
  CHECK(t.ntriangle == 12);
  for (int exact = 0; exact < 2; exact++) {
    cav_bulk b = cav_mesh_bulk(&t, exact);
    CHECK_NEAR(b.volume, 1, 1e-15);
    CHECK_NEAR(norm3(b.centre), 0, 1e-15);
    CHECK_NEAR(b.inertia[0], (0.25 * 0.25 + 1) / 3, 1e-15);
    CHECK_NEAR(b.inertia[1], (0.5 * 0.5 + 1) / 3, 1e-15);
    CHECK_NEAR(b.inertia[3], 0, 1e-15);
  }
  cav_triangles_clear(&t);
  CHECK(cav_mesh_read_stl(text_stl, sizeof text_stl - 1, &t, reason, sizeof reason) == CAV_OK && t.ntriangle == 1);
  cav_triangles_clear(&t);
  CHECK(cav_mesh_read_obj(obj, sizeof obj - 1, &t, reason, sizeof reason) == CAV_OK && t.ntriangle == 12);
  cav_bulk b = cav_mesh_bulk(&t, 0);
  CHECK_NEAR(b.volume, 8, 1e-14);
  cav_triangles_clear(&t);
  static const struct {
    const char *text, *says;
    int is_obj;
  } faults[] = {{"v 0 0\nf 1 1 1", "line 1: expected a number", 1},
                {"v 0 0 0\nf 1 2 3", "line 2: '2' is no vertex", 1},
                {"v 0 0 nan\n", "line 1: expected a finite number, got 'nan'", 1},
                {"v 0 0 0\nf 1 1", "line 2: a face needs three", 1},
                {"v 0 0 0\n", "no triangle inside", 1},
                {"", "no triangle inside", 1},
                {"solid\nvertex 0 0 0\nendloop", "line 3: a facet needs three", 0},
                {"solid\nvertex 0 0 0\n", "the last facet is not closed", 0},
                {"solid\n", "no triangle inside", 0},
                {"what", "are no STL", 0}};
  for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
    cav_status status = (faults[i].is_obj ? cav_mesh_read_obj : cav_mesh_read_stl)(
        faults[i].text, strlen(faults[i].text), &t, reason, sizeof reason);
    CHECK(status == CAV_BAD_INPUT && t.vertex == NULL);
    if (!CHECK(strstr(reason, faults[i].says) != NULL)) fprintf(stderr, "    %zu: %s\n", i, reason);
  }
}

// bytes changed, lost or added: triangles or a reason, and a hull of whatever is read
static void test_damage(void) {
  char bytes[1200], reason[200];
  int read = 0;
  for (int k = 0; k < 6000; k++) {
    size_t size = k % 3 == 0   ? box_stl((const double[3]){1, 1, 1}, (unsigned char *)bytes)
                  : k % 3 == 1 ? sizeof text_stl - 1
                               : sizeof obj - 1;
    if (k % 3) memcpy(bytes, k % 3 == 1 ? text_stl : obj, size);
    for (int edits = 0; edits < 1 + k % 5; edits++) {
      size_t at = (size_t)scene_between(0, (double)size - 20);
      if (k % 7 == 0) {
        memmove(bytes + at, bytes + at + 9, size - at - 9);
        size -= 9;
      } else {
        bytes[at] = (char)(int)scene_between(-128, 128);
      }
    }
    cav_triangles t;
    cav_status status = (k % 3 == 2 ? cav_mesh_read_obj : cav_mesh_read_stl)(bytes, size, &t, reason, sizeof reason);
    if (status == CAV_OK) {
      cav_hull h;
      read++;
      cav_mesh_bulk(&t, 0);
      CHECK(cav_hull_build(t.vertex, t.nvertex, 0, &h) == CAV_OK);
      cav_hull_clear(&h);
    }
    cav_triangles_clear(&t);
  }
  printf("damaged meshes: %d of 6000 still read\n", read);
}

// --- models ---

static void write_file(const char *path, const void *bytes, size_t size) {
  FILE *file = fopen(path, "wb");
  if (!CHECK(file != NULL)) return;
  CHECK(fwrite(bytes, 1, size, file) == size);
  fclose(file);
}

/// A folder with a model and its meshes.
typedef struct folder {
  char path[64], model[100], stl[100], obj[100], field[100];
} folder;

static const char scene[] =
    "<mujoco><compiler meshdir='.'/><option timestep='.002' cone='elliptic'/><asset>"
    "<mesh name='brick' file='brick.stl' scale='1 -2 .5'/><mesh file='crate.obj' refpos='.1 .2 .3' refquat='1 .1 .2 "
    ".3'/>"
    "<mesh name='wedge' vertex='0 0 0 1 0 0 0 1 0 0 0 1 1 0 1' /><mesh name='never' file='absent.stl'/>"
    "<hfield name='hills' file='hills.bin' size='4 3 .5 .2'/><hfield name='level' nrow='5' ncol='6' size='1 1 1 .1'/>"
    "</asset><worldbody><geom type='plane' size='5 5 1' pos='0 0 -1'/>"
    "<geom name='hills' type='hfield' hfield='hills' pos='.1 .2 .3'/>"
    "<geom name='level' type='hfield' hfield='level' pos='9 9 9'/>"
    "<geom type='mesh' mesh='never' contype='0' conaffinity='0'/>"
    "<body name='a' pos='0 0 2'><freejoint/><geom name='brick' type='mesh' mesh='brick' pos='.1 0 0' euler='10 20 "
    "30'/></body>"
    "<body name='b' pos='3 0 2'><freejoint/><geom name='crate' type='mesh' mesh='crate' density='100'/></body>"
    "<body name='c' pos='0 3 2'><freejoint/><geom name='wedge' type='mesh' mesh='wedge' mass='2'/></body>"
    "<body name='d' pos='0 -3 2'><freejoint/><geom type='mesh' mesh='never' contype='0' conaffinity='0' group='2' "
    "mass='0'/>"
    "<geom type='sphere' size='.2'/></body></worldbody></mujoco>";

// MuJoCo reads past its lists where indices of texture and normals have nothing behind them
static const char plain_obj[] =
    "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
    "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

#ifdef CAVORT_HAVE_ASSIMP
// a tetrahedron in centimetres, moved by a node; y is up in the file, which turns nothing
static void test_collada(void) {
  static const char text[] =
      "<?xml version='1.0'?><COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'>"
      "<asset><unit name='cm' meter='0.01'/><up_axis>Y_UP</up_axis></asset><library_geometries><geometry id='g'><mesh>"
      "<source id='p'><float_array id='a' count='12'>0 0 0 100 0 0 0 200 0 0 0 300</float_array><technique_common>"
      "<accessor source='#a' count='4' stride='3'><param name='X' type='float'/><param name='Y' type='float'/>"
      "<param name='Z' type='float'/></accessor></technique_common></source><vertices id='v'>"
      "<input semantic='POSITION' source='#p'/></vertices><triangles count='4'>"
      "<input semantic='VERTEX' source='#v' offset='0'/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry>"
      "</library_geometries><library_visual_scenes><visual_scene id='s'><node id='n'><translate>10 20 30</translate>"
      "<instance_geometry url='#g'/></node></visual_scene></library_visual_scenes><scene>"
      "<instance_visual_scene url='#s'/></scene></COLLADA>";
  char path[] = "/tmp/cavort-collada-XXXXXX.dae", reason[400] = "";
  int file = mkstemps(path, 4);
  cav_triangles m;
  if (!CHECK(file >= 0 && write(file, text, sizeof text - 1) == (ssize_t)sizeof text - 1)) return;
  close(file);
  if (CHECK(cav_mesh_read(path, &m, reason, sizeof reason) == CAV_OK)) {
    cav_bulk bulk = cav_mesh_bulk(&m, CAV_MESH_EXACT);
    CHECK(m.ntriangle == 4);
    CHECK_NEAR(bulk.volume, 1, 1e-6);
    CHECK_NEAR_ALL(bulk.centre, ((double[3]){0.1 + 0.25, 0.2 + 0.5, 0.3 + 0.75}), 3, 1e-6);
  } else {
    fprintf(stderr, "    %s\n", reason);
  }
  cav_triangles_clear(&m);
  write_file(path, "<COLLADA>", 9);
  CHECK(cav_mesh_read(path, &m, reason, sizeof reason) == CAV_BAD_INPUT && strstr(reason, "assimp reads"));
  unlink(path);
  CHECK(cav_mesh_read(path, &m, reason, sizeof reason) == CAV_BAD_INPUT && strstr(reason, "expected a file"));
}
#endif

static void make_folder(folder *f, double hills[12]) {
  strcpy(f->path, "/tmp/cavort-mesh-XXXXXX");
  CHECK(mkdtemp(f->path) != NULL);
  snprintf(f->model, sizeof f->model, "%s/model.xml", f->path);
  snprintf(f->stl, sizeof f->stl, "%s/brick.stl", f->path);
  snprintf(f->obj, sizeof f->obj, "%s/crate.obj", f->path);
  snprintf(f->field, sizeof f->field, "%s/hills.bin", f->path);
  unsigned char stl[1000], field[8 + 4 * 12] = {3, 0, 0, 0, 4, 0, 0, 0};
  write_file(f->stl, stl, box_stl((const double[3]){0.5, 0.25, 1}, stl));
  write_file(f->obj, plain_obj, sizeof plain_obj - 1);
  for (int i = 0; i < 12; i++) {
    hills[i] = i == 5 ? 1 : i == 0 ? 0 : (i * 7 % 16) / 16.0;
    put_float(field + 8 + 4 * i, 3 * hills[i] - 1);
  }
  write_file(f->field, field, sizeof field);
  write_file(f->model, scene, sizeof scene - 1);
}

static void drop_folder(const folder *f) {
  unlink(f->model), unlink(f->stl), unlink(f->obj), unlink(f->field);
  rmdir(f->path);
}

static void test_model(void) {
  folder f;
  double hills[12];
  make_folder(&f, hills);
  cav_error error = {0};
  cav_model *m = cav_model_load(f.model, &error);
  if (!CHECK(m != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    drop_folder(&f);
    return;
  }
  // what is only seen is not read, though its file is absent; said once for all
  CHECK(m->nmesh == 3 && m->nhfield == 2 && m->nwarning == 1);
  int brick = cav_object_find(m, CAV_OBJECT_GEOM, "brick"), a = cav_object_find(m, CAV_OBJECT_BODY, "a");
  CHECK(m->mesh[m->geom[brick].asset].nvertex == 8 && m->mesh[m->geom[brick].asset].nface == 6);
  CHECK_NEAR(m->body[a].mass, 1000 * 1 * 1 * 2 * .5, 1e-9);
  const cav_hfield *h = &m->hfield[m->geom[cav_object_find(m, CAV_OBJECT_GEOM, "hills")].asset];
  for (int i = 0; i < 12; i++) CHECK_NEAR(h->height[i], .5 * hills[i], 1e-7);
  // falls, meets, and forward is the inverse's inverse
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *u = scene_vector(m->nv), *next = scene_vector(m->nv),
         *again = scene_vector(m->nv);
  int touching = 0;
  double worst = 0;
  for (int k = 0; k < 200; k++) {
    memcpy(q, m->q0, sizeof *q * (size_t)m->nq);
    for (int i = 0; i < 4; i++) {
      set3(q + 7 * i, scene_uniform(), scene_uniform(), scene_between(0.3, 1.5));
      for (int j = 3; j < 7; j++) q[7 * i + j] = scene_uniform();
    }
    cav_configuration_normalise(m, q);
    scene_normals(v, m->nv, 0.3);
    scene_normals(u, m->nv, 30);
    CHECK(cav_forward(m, state, q, v, u, next) == CAV_OK);
    CHECK(cav_inverse(m, state, q, v, next, again) == CAV_OK);
    touching += state->ncontact > 0;
    worst = fmax(worst, scene_error(again, u, m->nv));
  }
  printf("meshes and hills: inverse of forward differs by %.1e, %d of 200 touching\n", worst, touching);
  CHECK(touching > 150);
  CHECK_NEAR(worst, 0, 1e-7); // seen: 6e-10
  cav_model_free(m);
  m = cav_model_load_with(f.model, &(cav_load_options){.visual = 1}, &error);
  CHECK(m == NULL && strstr(error.text, "absent.stl: cannot be opened") != NULL);
  cav_model_free(m);
  cav_state_free(state);
  free(q), free(v), free(u), free(next), free(again);
  drop_folder(&f);
}

#ifdef CAVORT_HAVE_MUJOCO
// masses, frames and rays of the same file; MuJoCo holds vertices in single precision
static void test_peer(void) {
  folder f;
  double hills[12], most = 0, rays = 0;
  char text[1000] = "", without[sizeof scene];
  make_folder(&f, hills);
  // MuJoCo reads every mesh: the absent one goes
  strcpy(without, scene);
  for (char *at; (at = strstr(without, "<mesh name='never'"));)
    memmove(at, strchr(at, '>') + 1, strlen(strchr(at, '>')));
  for (char *at; (at = strstr(without, "<geom type='mesh' mesh='never'"));)
    memmove(at, strchr(at, '>') + 1, strlen(strchr(at, '>')));
  write_file(f.model, without, strlen(without));
  cav_error error = {0};
  cav_model *m = cav_model_load(f.model, &error);
  mjModel *p = mj_loadXML(f.model, NULL, text, sizeof text);
  drop_folder(&f);
  if (!CHECK(m && p)) {
    fprintf(stderr, "    %s %s\n", error.text, text);
    return;
  }
  mjData *d = mj_makeData(p);
  cav_state *state = cav_state_new(m);
  mj_forward(p, d);
  cav_position(m, state, m->q0);
  for (int i = 1; i < m->nbody; i++) {
    const cav_body *b = &m->body[i];
    const double *J = p->body_inertia + 3 * i;
    double trace = b->inertia[0] + b->inertia[1] + b->inertia[2];
    most = fmax(most, fabs(b->mass / p->body_mass[i] - 1));
    most = fmax(most, fabs(trace / (J[0] + J[1] + J[2]) - 1));
    most = fmax(most,
                fabs(fmax(b->inertia[0], fmax(b->inertia[1], b->inertia[2])) - fmax(J[0], fmax(J[1], J[2]))) / trace);
    for (int k = 0; k < 3; k++) most = fmax(most, fabs(b->com[k] - p->body_ipos[3 * i + k]));
  }
  for (int i = 0; i < m->ngeom; i++) {
    cav_pose pose;
    cav_object_pose(m, state, CAV_OBJECT_GEOM, i, &pose);
    for (int k = 0; k < 3; k++) most = fmax(most, fabs(pose.pos[k] - d->geom_xpos[3 * i + k]));
  }
  // straight down and aslant onto the hills
  int field = cav_object_find(m, CAV_OBJECT_GEOM, "hills"), met = 0;
  cav_shape ground = cav_shape_of(m, &m->geom[field]);
  copy3(ground.pos, m->geom[field].pos);
  memcpy(ground.rotation, m->geom[field].rotation, sizeof ground.rotation);
  for (int k = 0; k < 500; k++) {
    double from[3] = {scene_between(-3, 3), scene_between(-2, 2), 2}, to[3] = {0, 0, -1};
    if (k % 2) set3(to, scene_between(-.3, .3), scene_between(-.3, .3), -1);
    normalise3(to);
    double ours = cav_ray(&ground, from, to), theirs = mj_rayHfield(p, d, field, from, to);
    if (ours < 0 || theirs < 0) continue;
    met++;
    rays = fmax(rays, fabs(ours - theirs));
  }
  printf("against MuJoCo: masses and frames %.1e, rays onto hills %.1e (%d met)\n", most, rays, met);
  CHECK_NEAR(most, 0, 1e-6); // single precision of its vertices
  CHECK_NEAR(rays, 0, 1e-6);
  CHECK(met > 300);
  mj_deleteData(d);
  mj_deleteModel(p);
  cav_state_free(state);
  cav_model_free(m);
}
#endif

int main(void) {
#ifndef CAVORT_HAVE_QHULL
  puts("SKIPPED: meshes need Qhull, which this build is without");
  return CHECK_SKIPPED;
#endif
  for (int kind = 0; kind < 3; kind++) {
    for (int type = 0; type <= CAV_GEOM_MESH; type++) test_certificates(type, kind);
  }
  test_box_as_mesh();
  test_derivatives();
  test_degenerate();
  test_wide_face();
  test_side_of_box();
  test_curved_over_box();
#ifdef CAVORT_HAVE_ASSIMP
  test_collada();
#endif
  test_files();
  test_damage();
  test_model();
#ifdef CAVORT_HAVE_MUJOCO
  test_peer();
#else
  printf("built without MuJoCo: not compared\n");
#endif
  return check_result();
}
