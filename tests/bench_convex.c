/// Contacts of all convex pairs without a routine of their own, in poses that are hard: whether the contact is proven
/// (proof.h), whether any direction is shorter, how smooth its gap is, median time; and what libccd alone finds.
/// Directions to compare with come from our search, libccd, and climbs by distances of bodies moved apart, from a
/// spiral of starts. Usage: bench_convex [POSES a pair and kind]
#include <time.h>

#include "gjk.h"
#include "hull.h"
#include "proof.h"
#include "scene.h"
#include "solid.h"

#ifdef CAVORT_HAVE_CCD
#include <ccd/ccd.h>
#endif

enum { NEAR, TOUCHING, SHALLOW, DEEP, NEEDLE, RATIO, PARALLEL, KINDS, POSES_MAX = 10000 };
static const char *const kinds[KINDS] = {"near", "touching", "shallow", "deep", "needle", "ratio", "parallel"};
static const char *const names[] = {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"};

static double spread(double low, double high) { return exp(scene_between(log(low), log(high))); }

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

// --- poses ---

// few points, many, a box, a wedge, a prism
static void make_mesh(solid *s) {
  double point[300];
  int form = (int)scene_between(0, 4.999), n = form == 0   ? 4 + (int)scene_between(0, 8)
                                               : form == 1 ? 100
                                               : form == 2 ? 8
                                                           : 12;
  if (form == 3) n = 6;
  for (int i = 0; i < n; i++) {
    double x[3] = {scene_uniform(), scene_uniform(), scene_uniform()};
    normalise3(x);
    for (int k = 0; k < 3 && form == 2; k++) x[k] = i >> k & 1 ? 1 : -1;
    if (form == 3) set3(x, i % 3 == 0 ? -1 : 1, i % 3 == 2 ? 1 : -1, i < 3 ? -1 : 1 + 0.3 * x[0]);
    if (form == 4) set3(x, cos(i % 6 * M_PI / 3), sin(i % 6 * M_PI / 3), i < 6 ? -1 : 1);
    for (int k = 0; k < 3; k++) point[3 * i + k] = s->size[k] * x[k];
  }
  if (cav_hull_build(point, n, 0, &s->hull) != CAV_OK) exit(EXIT_FAILURE);
  s->mesh = cav_hull_mesh(&s->hull);
  s->shape.mesh = &s->mesh;
}

static void random_solid(solid *s, int type, int kind, double scale) {
  static const double half = 0.7071067811865476;
  static const double turns[6][4] = {{1, 0, 0, 0},       {half, half, 0, 0},  {half, 0, half, 0},
                                     {half, 0, 0, half}, {half, -half, 0, 0}, {half, 0, -half, 0}};
  double q[4];
  *s = (solid){.shape.type = (cav_geom_type)type};
  s->shape.size = s->size;
  for (int k = 0; k < 3; k++) s->size[k] = scale * scene_between(0.05, 0.3);
  if (kind == NEEDLE) {
    int thin = (int)scene_between(0, 2.999);
    s->size[thin] = scale * spread(3e-4, 0.015);
    if (scene_between(0, 1) < 0.5) s->size[(thin + 1) % 3] = scale * spread(3e-4, 0.015);
  }
  if (type == CAV_GEOM_MESH) make_mesh(s);
  for (int k = 0; k < 4; k++) q[k] = scene_uniform();
  if (kind == PARALLEL) memcpy(q, turns[(int)scene_between(0, 5.999)], sizeof q);
  quat_normalise(q);
  quat_matrix(s->shape.rotation, q);
  for (int k = 0; k < 3; k++) s->shape.pos[k] = scene_uniform();
}

static double extreme(const solid *s, int largest) {
  int used = s->shape.type == CAV_GEOM_SPHERE                                          ? 1
             : s->shape.type == CAV_GEOM_CAPSULE || s->shape.type == CAV_GEOM_CYLINDER ? 2
                                                                                       : 3;
  double x = s->size[0];
  for (int k = 1; k < used; k++) x = largest ? fmax(x, s->size[k]) : fmin(x, s->size[k]);
  return x;
}

static void place(const solid *a, solid *b, int kind) {
  double n[3] = {scene_uniform(), scene_uniform(), scene_uniform()}, x[3], y[3], back[3], d[3];
  double small = fmin(extreme(a, 0), extreme(b, 0)), gap = small * scene_between(-0.1, 0.1);
  if (kind == DEEP || ((kind == NEEDLE || kind == RATIO) && scene_between(0, 1) < 0.3)) {
    double r = kind == DEEP ? 0.3 * fmin(extreme(a, 1), extreme(b, 1)) : small;
    for (int k = 0; k < 3; k++) b->shape.pos[k] = a->shape.pos[k] + r * scene_uniform();
    return;
  }
  if (kind == PARALLEL) {
    int axis = (int)scene_between(0, 2.999);
    set3(n, axis == 0, axis == 1, axis == 2);
  }
  normalise3(n);
  if (kind == NEAR) gap = scene_between(-0.04, 0.04);
  if (kind == TOUCHING || (kind == PARALLEL && scene_between(0, 1) < 0.3)) gap = 0;
  scale3(back, -1, n);
  cav_shape_support(&a->shape, n, x);
  cav_shape_support(&b->shape, back, y);
  sub3(d, x, y);
  if (kind == PARALLEL) {
    // one above the other, shifted sideways
    double over[3];
    sub3(over, a->shape.pos, b->shape.pos);
    axpy3(over, over, dot3(d, n) - dot3(over, n), n);
    for (int k = 0; k < 3; k++) over[k] += n[k] > 0.5 ? 0 : small * scene_uniform();
    copy3(d, over);
  }
  axpy3(d, d, gap, n);
  add3(b->shape.pos, b->shape.pos, d);
}

// --- directions to compare with ---

// from a direction to a least way out among its neighbours: the nearest points of the bodies moved apart along it
// tell the next direction, whose gap is not smaller
static double climb(const solid *a, const solid *b, const double start[3], double size, double small) {
  cav_shape moved = b->shape;
  cav_core ca = cav_core_of(&a->shape), cb = cav_core_of(&moved);
  double n[3], best = proof_gap(&a->shape, &b->shape, start);
  copy3(n, start);
  for (int k = 0; k < 60; k++) {
    cav_separation s;
    axpy3(moved.pos, b->shape.pos, best > 1e-3 * size ? 0 : 0.01 * small - best, n);
    if (!cav_separation_find(&ca, &cb, size, 1e300, &s)) break;
    double gap = proof_gap(&a->shape, &b->shape, s.n);
    if (!(gap > best + 1e-13 * size)) return fmax(gap, best);
    best = gap;
    copy3(n, s.n);
  }
  return best;
}

static double best_of_spiral(const solid *a, const solid *b, double size, double small) {
  enum { DIRECTIONS = 24 };
  double best = -INFINITY;
  for (int i = 0; i < DIRECTIONS; i++) {
    double z = 1 - (2 * i + 1.0) / DIRECTIONS, r = sqrt(1 - z * z), turn = 2.399963229728653 * i;
    double n[3] = {r * cos(turn), r * sin(turn), z};
    best = fmax(best, climb(a, b, n, size, small));
  }
  return best;
}

#ifdef CAVORT_HAVE_CCD
typedef struct grown {
  const cav_shape *shape;
  double by;
  int *calls;
} grown;

static void grown_support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out) {
  const grown *g = object;
  double d[3] = {direction->v[0], direction->v[1], direction->v[2]};
  normalise3(d);
  if (++*g->calls > 1000) {
    axpy3(out->v, g->shape->pos, -1e9, d);
    return;
  }
  cav_shape_support(g->shape, d, out->v);
  axpy3(out->v, out->v, g->by, d);
}

static void grown_centre(const void *object, ccd_vec3_t *centre) {
  copy3(centre->v, ((const grown *)object)->shape->pos);
}
#endif

// libccd's direction by portals or by its polytope, shapes grown to meet at margin; 0 if it has none
static int ask_libccd(const solid *a, const solid *b, double margin, double small, int polytope, double n[3]) {
#ifdef CAVORT_HAVE_CCD
  int calls = 0;
  grown ga = {&a->shape, margin / 2, &calls}, gb = {&b->shape, margin / 2, &calls};
  ccd_t ccd;
  ccd_real_t depth;
  ccd_vec3_t direction, position;
  CCD_INIT(&ccd);
  ccd.support1 = ccd.support2 = grown_support;
  ccd.center1 = ccd.center2 = grown_centre;
  ccd.max_iterations = polytope ? 200 : 100;
  ccd.mpr_tolerance = 1e-6 * small;
  ccd.epa_tolerance = 1e-6 * small;
  int apart = polytope ? ccdGJKPenetration(&ga, &gb, &ccd, &depth, &direction, &position)
                       : ccdMPRPenetration(&ga, &gb, &ccd, &depth, &direction, &position);
  if (apart || !(norm3(direction.v) > 1e-10)) return 0;
  copy3(n, direction.v);
  return normalise3(n) > 0 && isfinite(norm3(n));
#else
  (void)a, (void)b, (void)margin, (void)small, (void)polytope, (void)n;
  return 0;
#endif
}

// --- measures ---

/// Of the poses of one pair and kind.
typedef struct tally {
  int poses, contacts, none, unproven, longer, rough;
  int none_of[2], longer_of[2]; ///< libccd's portals, its polytope
  double time[POSES_MAX];
} tally;

// 1 if the gap does not change as its normal says when b moves a little
static int is_rough(const solid *a, const solid *b, double margin, const cav_touch *t, double small) {
  double v[3] = {scene_uniform(), scene_uniform(), scene_uniform()}, dist[2], step = 1e-6 * small;
  for (int side = 0; side < 2; side++) {
    cav_shape moved = b->shape;
    cav_touch touch[CAV_TOUCH_MAX];
    axpy3(moved.pos, moved.pos, side ? step : -step, v);
    int n = cav_collide_shapes(&a->shape, &moved, margin, touch);
    dist[side] = n ? touch[proof_nearest(touch, n)].dist : NAN;
  }
  return !(fabs((dist[1] - dist[0]) / (2 * step) - dot3(v, t->normal)) < 1e-4);
}

static void measure(int ta, int tb, int kind, tally *t) {
  solid a, b;
  cav_touch touch[CAV_TOUCH_MAX];
  random_solid(&a, ta, kind, 1);
  random_solid(&b, tb, kind, kind == RATIO ? spread(1e-3, 1e3) : 1);
  place(&a, &b, kind);
  double size = fmax(extreme(&a, 1), extreme(&b, 1)), small = fmin(extreme(&a, 1), extreme(&b, 1));
  double margin = 0.1 * small, start = now(), n[3];
  int count = cav_collide_shapes(&a.shape, &b.shape, margin, touch);
  t->time[t->poses++] = now() - start;
  double truth = best_of_spiral(&a, &b, size, small), found[2];
  for (int k = 0; k < 2; k++) {
    found[k] = ask_libccd(&a, &b, margin, small, k, n) ? proof_gap(&a.shape, &b.shape, n) : NAN;
    truth = fmax(truth, isnan(found[k]) ? -INFINITY : found[k]);
  }
  if (count) {
    const cav_touch *first = touch + proof_nearest(touch, count);
    truth = fmax(truth, proof_gap(&a.shape, &b.shape, first->normal));
    proof is = proof_of(&a.shape, &b.shape, first);
    t->contacts++;
    t->unproven += !(is.surface < 1e-10 * size && is.gap < 1e-10 * size);
    t->longer += truth - first->dist > 1e-8 * size;
    t->rough += is_rough(&a, &b, margin, first, small);
  }
  t->none += !count && truth < margin - 1e-9 * size;
  for (int k = 0; k < 2 && truth < margin - 1e-9 * size; k++) {
    t->none_of[k] += isnan(found[k]);
    t->longer_of[k] += truth - found[k] > 1e-3 * small;
  }
  cav_hull_clear(&a.hull);
  cav_hull_clear(&b.hull);
}

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static void add(tally *sum, const tally *t) {
  sum->poses += t->poses, sum->contacts += t->contacts, sum->none += t->none, sum->unproven += t->unproven;
  sum->longer += t->longer, sum->rough += t->rough;
  for (int k = 0; k < 2; k++) sum->none_of[k] += t->none_of[k], sum->longer_of[k] += t->longer_of[k];
}

int main(int argc, char **argv) {
  int poses = argc > 1 ? atoi(argv[1]) : 30;
  static tally t, sum;
  if (poses < 1 || poses > POSES_MAX) return EXIT_FAILURE;
  printf(
      "| kind | pair | poses | contacts | none | unproven | longer | rough | us | portals: none | longer | polytope: "
      "none | longer |\n");
  printf("|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (int kind = 0; kind < KINDS; kind++) {
    for (int ta = 1; ta <= CAV_GEOM_MESH; ta++) {
      for (int tb = ta; tb <= CAV_GEOM_MESH; tb++) {
        if (tb < CAV_GEOM_MESH && (ta < CAV_GEOM_ELLIPSOID || ta == CAV_GEOM_BOX)) continue;
        memset(&t, 0, sizeof t);
        for (int k = 0; k < poses; k++) measure(ta, tb, kind, &t);
        qsort(t.time, (size_t)poses, sizeof *t.time, by_value);
        printf("| %s | %s, %s | %d | %d | %d | %d | %d | %d | %.1f | %d | %d | %d | %d |\n", kinds[kind], names[ta],
               names[tb], poses, t.contacts, t.none, t.unproven, t.longer, t.rough, t.time[poses / 2], t.none_of[0],
               t.longer_of[0], t.none_of[1], t.longer_of[1]);
        fflush(stdout);
        add(&sum, &t);
      }
    }
  }
  printf("| all | | %d | %d | %d | %d | %d | %d | | %d | %d | %d | %d |\n", sum.poses, sum.contacts, sum.none,
         sum.unproven, sum.longer, sum.rough, sum.none_of[0], sum.longer_of[0], sum.none_of[1], sum.longer_of[1]);
  return EXIT_SUCCESS;
}
