/// Spatial tendons: arms against differences of lengths, forward against inverse, both against MuJoCo's lengths, arms
/// and mj_inverse where it is there, on a scene with every kind of path. Wrapping against shapes known by hand, and
/// paths that do not hold together refused.
#include "scene.h"
#include "wrap.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

enum { STATES = 1000 };

static void scene_path(char *path, size_t size) { snprintf(path, size, "%s/tests/strings.xml", CAVORT_SOURCE_ROOT); }

static cav_model *load(void) {
  char path[4200];
  cav_error error = {0};
  scene_path(path, sizeof path);
  cav_model *m = cav_model_load(path, &error);
  CHECK(m != NULL);
  if (!m) fprintf(stderr, "    %s\n", error.text);
  return m;
}

// quarter turns around unit circles, known by hand
static void test_shapes(void) {
  double touch[2][3], a[3] = {2, 0, 0}, b[3] = {0, 2, 0}, above[3] = {0, 2, 3}, far[3] = {3, 3, 0};
  // at distance 2 the tangent turns acos(1/2) from the radius: 90 degrees are less than both
  CHECK(cav_wrap_sphere(1, a, b, NULL, touch) == -1);
  double c[3] = {-2, 0.1, 0};
  double arc = cav_wrap_sphere(1, a, c, NULL, touch);
  double between = M_PI - atan2(0.1, 2), expected = between - acos(0.5) - acos(1 / hypot(2, 0.1));
  CHECK_NEAR(arc, expected, 1e-14);
  CHECK(touch[0][1] > 0 && touch[1][1] > 0);
  // a side chooses the long way
  double under[3] = {0, -5, 0};
  arc = cav_wrap_sphere(1, a, c, under, touch);
  CHECK_NEAR(arc, 2 * M_PI - between - acos(0.5) - acos(1 / hypot(2, 0.1)), 1e-14);
  CHECK(touch[0][1] < 0 && touch[1][1] < 0);
  // inside: by symmetry the corner is on the bisector
  double middle[3] = {0.1, 0.1, 0};
  CHECK(cav_wrap_sphere(1, a, b, middle, touch) == 0);
  CHECK_NEAR(touch[0][0], sqrt(0.5), 1e-14);
  CHECK_NEAR(touch[0][1], sqrt(0.5), 1e-14);
  // a line that comes through needs no corner, a point inside no wrapping
  CHECK(cav_wrap_sphere(1, a, c, middle, touch) == -1);
  CHECK(cav_wrap_sphere(1, middle, far, NULL, touch) == -1);
  // the cylinder's corner on the bisector is half way up
  CHECK(cav_wrap_cylinder(1, a, above, middle, touch) == 0);
  CHECK_NEAR(touch[0][2], 1.5, 1e-14);
  // degenerate input gives no wrapping or a sane one, and no NaN
  double centre[3] = {0, 0, 0}, opposite[3] = {-2, 0, 0};
  CHECK(cav_wrap_sphere(1, centre, a, NULL, touch) == -1);
  CHECK(cav_wrap_sphere(0, a, c, NULL, touch) == -1);
  CHECK(cav_wrap_sphere(1, a, a, NULL, touch) == -1);
  CHECK(cav_wrap_cylinder(1, a, a, middle, touch) == 0);
  CHECK_NEAR(cav_wrap_sphere(1, a, opposite, NULL, touch), M_PI / 3, 1e-14);
}

// arms of all tendons against centred differences of lengths; largest error
static double arm_error(const cav_model *m, cav_state *state, cav_state *moved, const double *q, double *q_moved) {
  double worst = 0, *v = scene_vector(m->nv), *ahead = scene_vector(m->ntendon), step = 1e-5;
  for (int j = 0; j < m->nv; j++) {
    v[j] = 1;
    cav_integrate(m, q, v, step, q_moved);
    CHECK(cav_position(m, moved, q_moved) == CAV_OK);
    memcpy(ahead, moved->tendon_length, (size_t)m->ntendon * sizeof *ahead);
    cav_integrate(m, q, v, -step, q_moved);
    CHECK(cav_position(m, moved, q_moved) == CAV_OK);
    for (int i = 0; i < m->ntendon; i++) {
      const cav_tendon *t = &m->tendon[i];
      double arm = 0, derivative = (ahead[i] - moved->tendon_length[i]) / (2 * step);
      for (int e = t->dof; e < t->dof + t->ndof; e++) {
        if (m->tendon_dof[e] == j) arm = state->tendon_arm[e];
      }
      // where wrapping begins between the two the derivative is that of neither side: such pairs are far apart or
      // nothing
      if (fabs(derivative - arm) < 1e-3) worst = fmax(worst, fabs(derivative - arm));
      CHECK(fabs(derivative - arm) < 0.5);
    }
    v[j] = 0;
  }
  free(v), free(ahead);
  return worst;
}

static void test_arms(const cav_model *m) {
  cav_state *state = cav_state_new(m), *moved = cav_state_new(m);
  double *q = scene_vector(m->nq), *q_moved = scene_vector(m->nq), *scratch = scene_vector(m->nv), worst = 0;
  for (int k = 0; k < 50; k++) {
    scene_posture(m, q, scratch, 0.5);
    CHECK(cav_position(m, state, q) == CAV_OK);
    worst = fmax(worst, arm_error(m, state, moved, q, q_moved));
  }
  // bound: step^2 times third derivatives of a few over distances of 0.1; seen 1.0e-7
  printf("arms against differences: %.1e\n", worst);
  CHECK(worst < 1e-6);
  cav_state_free(state), cav_state_free(moved);
  free(q), free(q_moved), free(scratch);
}

static void test_forward(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv);
  double *found = scene_vector(m->nv), worst = 0;
  int rows = 0;
  for (int k = 0; k < 100; k++) {
    state->options.order = (cav_order)(k % 3);
    state->options.smoothing = state->options.smoothing_self = k % 4 < 2 ? 0 : 0.01;
    scene_posture(m, q, v, 0.5);
    scene_normals(v, m->nv, 1);
    scene_normals(next, m->nv, 1);
    CHECK(cav_inverse(m, state, q, v, next, u) == CAV_OK);
    rows += state->nrow;
    CHECK(cav_forward(m, state, q, v, u, found) == CAV_OK);
    worst = fmax(worst, scene_error(found, next, m->nv));
    // the steps that sweeps solve at once
    if (k % 12 == 0) {
      CHECK(cav_forward_gpgs(m, state, q, v, u, 1000, 1e-14, found, NULL) == CAV_OK);
      worst = fmax(worst, scene_error(found, next, m->nv));
    }
  }
  // bound: tolerance 1e-9 of the forward step; seen 2e-11
  printf("forward against inverse: %.1e, %d rows\n", worst, rows);
  CHECK(worst < 1e-8 && rows > 200);
  cav_state_free(state);
  free(q), free(v), free(next), free(u), free(found);
}

#ifdef CAVORT_HAVE_MUJOCO
// MuJoCo stops its search for the corner of a string that comes through at 1e-7; ours agrees with differences. The side
// of the ring is inside in the plane of some strings
static int cornered(const cav_tendon *t) { return !strncmp(t->name, "through", 7) || !strcmp(t->name, "beside_ring"); }

// largest difference of lengths and arms
static double compare_strings(const cav_model *m, const cav_state *state, const mjModel *p, const mjData *d) {
  double worst = 0;
  for (int i = 0; i < m->ntendon; i++) {
    const cav_tendon *t = &m->tendon[i];
    double scale = cornered(t) ? 1e-5 : 1, *row = scene_vector(m->nv);
    for (int e = t->dof; e < t->dof + t->ndof; e++) row[m->tendon_dof[e]] = state->tendon_arm[e];
    double error = fabs(state->tendon_length[i] - d->ten_length[i]);
    for (int j = 0; j < m->nv; j++) error = fmax(error, fabs(row[j] - d->ten_J[i * p->nv + j]));
    if (scale * error > 1e-10 && worst <= 1e-10) {
      printf("    tendon %s: length %.12g, MuJoCo %.12g, error %.2e\n", t->name, state->tendon_length[i],
             d->ten_length[i], error);
    }
    CHECK_NEAR(state->tendon_length[i], d->ten_length[i], 1e-12);
    worst = fmax(worst, scale * error);
    free(row);
  }
  return worst;
}

static void test_peer(const cav_model *m) {
  char path[4200], text[1000];
  scene_path(path, sizeof path);
  mjModel *p = mj_loadXML(path, NULL, text, sizeof text);
  CHECK(p != NULL);
  if (!p) return;
  p->opt.cone = mjCONE_ELLIPTIC;
  p->opt.jacobian = mjJAC_DENSE;
  mjData *d = mj_makeData(p);
  cav_state *state = cav_state_new(m);
  double *scratch = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv), worst = 0;
  int same = 0, far = 0;
  for (int i = 0; i < m->ntendon; i++) {
    // bound: rounding, of weights through the inverse of M; seen 2e-13
    CHECK_NEAR(m->tendon[i].springlength[0], p->tendon_lengthspring[i], 1e-12);
    CHECK_NEAR(m->tendon[i].springlength[1], p->tendon_lengthspring[i], 1e-12);
    double slack = cornered(&m->tendon[i]) ? 1e-6 : 1e-10;
    CHECK_NEAR(m->tendon[i].inverse_weight, p->tendon_invweight0[i], slack * p->tendon_invweight0[i]);
  }
  for (int k = 0; k < STATES; k++) {
    mj_resetData(p, d);
    scene_posture(m, d->qpos, scratch, 0.8);
    scene_normals(d->qvel, m->nv, 1);
    scene_normals(d->qacc, m->nv, 10);
    mj_inverse(p, d);
    for (int i = 0; i < m->nv; i++) next[i] = d->qvel[i] + p->opt.timestep * d->qacc[i];
    CHECK(cav_inverse(m, state, d->qpos, d->qvel, next, u) == CAV_OK);
    double strings = compare_strings(m, state, p, d), force = scene_error(u, d->qfrc_inverse, m->nv);
    far += strings > 1e-10;
    same += force < 1e-9;
    if (strings <= 1e-10) worst = fmax(worst, force);
  }
  printf("against MuJoCo: %d of %d states within 1e-9, %d with another string, else at most %.1e\n", same, STATES, far,
         worst);
  // bound: rounding; seen 1e-12
  CHECK(same >= STATES * 99 / 100);
  CHECK(worst < 1e-9);
  cav_state_free(state);
  free(scratch), free(next), free(u);
  mj_deleteData(d);
  mj_deleteModel(p);
}
#endif

int main(void) {
  test_shapes();
  cav_model *m = load();
  if (m) {
    test_arms(m);
    test_forward(m);
#ifdef CAVORT_HAVE_MUJOCO
    test_peer(m);
#endif
  }
  cav_model_free(m);
  return check_result();
}
