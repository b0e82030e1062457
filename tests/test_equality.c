/// Equality constraints. Errors against their rates and their Jacobian rows; the inverse against both forward solvers,
/// in open and closed chains; u against MuJoCo's mj_inverse. Each check has a control that must differ.
#include "impulse.h"
#include "scene.h"
#include "step.h"

#ifdef CAVORT_HAVE_MUJOCO
#include "peer.h"
#endif

static const char model_file[] = CAVORT_SOURCE_ROOT "/tests/equality.xml";

/// Distances of every kind of pair that has a routine here, closed loops, contacts beside them.
static const char scene_tied[] =
    "<mujoco><compiler angle='degree'/><option timestep='.005'/><worldbody><geom name='floor' type='plane' size='1 1 "
    "1'/>"
    "<body name='a' pos='0 0 .4'><freejoint/><geom name='ball' size='.1'/>"
    "<body name='b' pos='.3 0 0'><joint name='j' axis='0 1 0' range='-20 60' limited='true'/>"
    "<geom name='rod' type='capsule' size='.04' fromto='0 0 0 .3 0 .1'/>"
    "<body name='c' pos='.3 0 .1'><joint name='k' axis='0 1 .2' frictionloss='.1'/>"
    "<geom name='egg' type='ellipsoid' size='.1 .05 .04' pos='.1 0 0'/></body></body></body>"
    "<body name='d' pos='0 .5 .6'><freejoint/><geom name='brick' type='box' size='.1 .08 .06'/></body>"
    "<body name='e' pos='.5 .5 .3'><freejoint/><geom name='pipe' type='capsule' size='.05 .1'/></body></worldbody>"
    "<equality><distance name='r1' geom1='ball' geom2='rod' distance='.4'/>"
    "<distance geom1='brick' geom2='floor' distance='.1'/><distance geom1='pipe' geom2='brick' distance='.2'/>"
    "<distance geom1='rod' geom2='pipe' distance='.3'/><distance geom1='floor' geom2='ball' distance='.05'/>"
    "<connect body1='c' body2='d' anchor='.2 0 0'/><weld body1='d' body2='e'/></equality></mujoco>";

typedef struct bench {
  cav_model *model;
  cav_state *state;
  double *q, *moved, *v, *v_next, *u, *out;
} bench;

static int bench_fill(bench *b) {
  b->state = b->model ? cav_state_new(b->model) : NULL;
  if (!CHECK(b->state != NULL)) return 0;
  int n = b->model->nq;
  double **const all[] = {&b->q, &b->moved, &b->v, &b->v_next, &b->u, &b->out};
  for (int i = 0; i < 6; i++) *all[i] = scene_vector(n);
  return 1;
}

static int bench_open(bench *b, const char *path) {
  cav_error error = {0};
  *b = (bench){.model = cav_model_load(path, &error)};
  if (!b->model) fprintf(stderr, "    %s\n", error.text);
  return bench_fill(b);
}

static int bench_open_text(bench *b, const char *text) {
  *b = (bench){.model = scene_load(text)};
  return bench_fill(b);
}

static void bench_close(bench *b) {
  cav_state_free(b->state);
  cav_model_free(b->model);
  double *const all[] = {b->q, b->moved, b->v, b->v_next, b->u, b->out};
  for (int i = 0; i < 6; i++) free(all[i]);
}

static void random_state(bench *b, double spread) {
  scene_posture(b->model, b->q, b->v, spread);
  scene_normals(b->v, b->model->nv, 1);
  for (int i = 0; i < b->model->nv; i++) b->v_next[i] = b->v[i] + b->state->options.timestep * 20 * scene_normal();
}

// all errors of a state, up to 6 per tie
static int read_errors(const cav_state *s, double *out) {
  int n = 0;
  for (int i = 0; i < s->nequality; i++)
    for (int k = 0; k < s->equality[i].dim; k++) out[n++] = s->equality[i].error[k];
  return n;
}

// the rate of each error, by central differences along v, is the velocity of its row
static void test_rates(bench *b, const char *name) {
  double plus[200], minus[200], h = 1e-6, worst = 0, off = 0;
  for (int trial = 0; trial < 50; trial++) {
    random_state(b, 0.3);
    CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
    cav_equality_rows kept[64];
    int n = b->state->nequality;
    memcpy(kept, b->state->equality, (size_t)n * sizeof *kept);
    cav_integrate(b->model, b->q, b->v, h, b->moved);
    CHECK(cav_position(b->model, b->state, b->moved) == CAV_OK);
    read_errors(b->state, plus);
    cav_integrate(b->model, b->q, b->v, -h, b->moved);
    CHECK(cav_position(b->model, b->state, b->moved) == CAV_OK);
    read_errors(b->state, minus);
    for (int i = 0, row = 0; i < n; i++)
      for (int k = 0; k < kept[i].dim; k++, row++) {
        double rate = (plus[row] - minus[row]) / (2 * h), wrong = fabs(rate - kept[i].velocity[k]);
        // the nearest corner of a box may change: none does here
        worst = fmax(worst, wrong / (1 + fabs(rate)));
        off = fmax(off, fabs(rate - kept[i].velocity_next[k]));
      }
  }
  // bound: rounding of errors over the step, and the third derivative; seen 3e-10
  CHECK(worst < 1e-6);
  // control: the velocity of another state is not that rate
  CHECK(off > 1e-2);
  printf("%-10s rate of the error against the row's velocity: %.1e\n", name, worst);
}

// the rate of each row's velocity, by central differences along v, is J'v of connects and welds
static void test_biases(bench *b, const char *name) {
  double h = 1e-5, worst = 0, most = 0;
  for (int trial = 0; trial < 50; trial++) {
    cav_equality_rows at[3][64];
    random_state(b, 0.3);
    for (int i = 0; i < 3; i++) {
      cav_integrate(b->model, b->q, b->v, (i - 1) * h, b->moved);
      CHECK(cav_inverse(b->model, b->state, b->moved, b->v, b->v_next, b->u) == CAV_OK);
      memcpy(at[i], b->state->equality, (size_t)b->state->nequality * sizeof **at);
    }
    for (int i = 0; i < b->state->nequality; i++) {
      cav_equality_type type = b->model->equality[i].type;
      for (int k = 0; k < at[1][i].dim; k++) {
        double rate = (at[2][i].velocity[k] - at[0][i].velocity[k]) / (2 * h), bias = at[1][i].bias[k];
        if (type != CAV_EQUALITY_CONNECT && type != CAV_EQUALITY_WELD) {
          CHECK(bias == 0);
          continue;
        }
        worst = fmax(worst, fabs(rate - bias) / (1 + fabs(rate)));
        most = fmax(most, fabs(bias));
      }
    }
  }
  // bound: third derivatives, rounding over the step; seen 2e-9
  CHECK(worst < 1e-7 && most > 1);
  printf("%-10s rate of the row's velocity against J'v: %.1e (to %.1f)\n", name, worst, most);
}

// rows of the Jacobian times v are the velocities, and J' f is what the inverse adds to u
static void test_jacobian(bench *b, const char *name) {
  int nv = b->model->nv;
  cav_block *block = calloc(100, sizeof *block);
  int *dof = calloc(100 * (size_t)nv, sizeof *dof);
  double *J = scene_vector(300 * nv), *smooth = scene_vector(nv), worst = 0, transposed = 0, size = 0;
  for (int trial = 0; trial < 50; trial++) {
    random_state(b, 0.3);
    CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
    int first = b->state->ncontact + b->state->nrow, n = first + b->state->nequality;
    if (!CHECK(n <= 100)) break;
    cav_jacobian(b->model, b->state, block, dof, J);
    cav_smooth_inverse(b->model, b->state, b->v, b->v_next, smooth);
    for (int i = 0; i < n; i++) {
      double h = b->state->options.timestep;
      for (int k = 0; k < block[i].dim; k++) {
        double sum = 0, f = 0;
        if (block[i].equality >= 0) f = b->state->equality[block[i].equality].impulse[k];
        if (block[i].row >= 0) f = b->state->row[block[i].row].impulse;
        if (block[i].contact >= 0) f = b->state->contact[block[i].contact].impulse[k];
        for (int d = 0; d < block[i].ndof; d++) {
          double entry = block[i].J[k * block[i].ndof + d];
          sum += entry * b->v[block[i].dof[d]];
          smooth[block[i].dof[d]] -= entry * f / h;
        }
        if (block[i].equality >= 0) worst = fmax(worst, fabs(sum - b->state->equality[block[i].equality].velocity[k]));
      }
    }
    transposed = fmax(transposed, scene_error(smooth, b->u, nv));
    size = fmax(size, scene_norm(b->u, nv));
  }
  // bounds: rounding of sums of ten terms about 1, and of u; seen 2e-15 and 2e-15
  CHECK(worst < 1e-13);
  CHECK(transposed < 1e-13);
  printf("%-10s J v against velocities %.1e, J' f against the inverse %.1e (u to %.1e)\n", name, worst, transposed,
         size);
  free(block), free(dof), free(J), free(smooth);
}

// v_next of the inverse's u by both solvers
static void test_round_trip(bench *b, const char *name, int gauss_seidel) {
  double newton = 0, gpgs = 0, mismatch = 0;
  int iterations = 0, sweeps = 0, mean = b->state->options.order != CAV_ORDER_EULER;
  for (int trial = 0; trial < 30; trial++) {
    random_state(b, 0.2);
    for (int i = 0; mean && i < b->model->nv; i++) b->v_next[i] = b->v[i] + 0.1 * (b->v_next[i] - b->v[i]);
    CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
    cav_forward_report report = {0};
    CHECK(cav_forward_newton(b->model, b->state, b->q, b->v, b->u, 100, 1e-13, b->out, &report) == CAV_OK);
    newton = fmax(newton, scene_error(b->out, b->v_next, b->model->nv));
    iterations = report.iterations > iterations ? report.iterations : iterations;
    if (!gauss_seidel) continue;
    cav_status status = cav_forward_gpgs(b->model, b->state, b->q, b->v, b->u, 20000, 1e-14, b->out, &report);
    CHECK(status == CAV_OK);
    gpgs = fmax(gpgs, scene_error(b->out, b->v_next, b->model->nv));
    mismatch = fmax(mismatch, report.mismatch);
    sweeps = report.iterations > sweeps ? report.iterations : sweeps;
  }
  printf("%-10s forward of the inverse: newton %.1e in %d, gauss-seidel %.1e in %d, mismatch %.1e\n", name, newton,
         iterations, gpgs, sweeps, mismatch);
  // bound: tolerance of the solvers on u, whose entries go to 1e6 where velocities at random violate stiff ties,
  // through the lightest link; seen 3e-9 and 7e-9
  CHECK(newton < 1e-7);
  CHECK(gpgs < 1e-7);
}

static void test_scene(bench *b, const char *name) {
  test_rates(b, name);
  test_biases(b, name);
  test_jacobian(b, name);
  test_round_trip(b, name, 1);
  b->state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  b->state->options.softness = 1e-3;
  test_round_trip(b, name, 1);
  for (int order = CAV_ORDER_MIDPOINT; order <= CAV_ORDER_MOMENTUM; order++) {
    b->state->options.order = (cav_order)order;
    test_round_trip(b, name, 0);
  }
  b->state->options = b->model->options;
  b->state->options.timestep = b->model->timestep;
}

// without constraints the ties are gone, and u is the smooth one
static void test_switch(bench *b) {
  random_state(b, 0.3);
  b->state->options.constraint = 0;
  CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(b->state->nequality == 0);
  cav_smooth_inverse(b->model, b->state, b->v, b->v_next, b->out);
  CHECK_NEAR_ALL(b->u, b->out, b->model->nv, 0);
  b->state->options.constraint = 1;
  CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(b->state->nequality == b->model->nequality && scene_error(b->u, b->out, b->model->nv) > 1e-3);
}

// a time constant below two steps is raised, which is said, and does what the raised one does
static void test_guard(void) {
  static const char text[] =
      "<mujoco><option timestep='.01'/><worldbody><body><joint name='x' type='slide'/><geom "
      "size='.1'/></body></worldbody>"
      "<equality><joint name='hold' joint1='x' solref='%s 1'/></equality></mujoco>";
  char short_text[1000], raised[1000];
  snprintf(short_text, sizeof short_text, text, ".001");
  snprintf(raised, sizeof raised, text, ".02");
  bench a, b;
  if (bench_open_text(&a, short_text) && bench_open_text(&b, raised)) {
    CHECK(a.model->nwarning == 1 && strstr(a.model->warning[0], "equality constraint hold"));
    CHECK(b.model->nwarning == 0);
    random_state(&a, 0.1);
    CHECK(cav_inverse(a.model, a.state, a.q, a.v, a.v_next, a.u) == CAV_OK);
    CHECK(cav_inverse(b.model, b.state, a.q, a.v, a.v_next, b.u) == CAV_OK);
    CHECK_NEAR_ALL(a.u, b.u, 1, 0);
    a.state->options.refsafe = 0;
    CHECK(cav_inverse(a.model, a.state, a.q, a.v, a.v_next, a.u) == CAV_OK);
    CHECK(fabs(a.u[0] - b.u[0]) > 1e-3 * fabs(b.u[0]));
  }
  bench_close(&a);
  bench_close(&b);
}

#ifdef CAVORT_HAVE_MUJOCO
enum { STATES = 1000 };

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static void test_peer(bench *b) {
  char text[1000];
  static double error[STATES];
  mjModel *m = mj_loadXML(model_file, NULL, text, sizeof text);
  if (!CHECK(m != NULL)) return;
  m->opt.cone = mjCONE_ELLIPTIC;
  mjData *d = mj_makeData(m);
  double *expected = scene_vector(m->nv);
  CHECK(m->nv == b->model->nv);
  for (int trial = 0; trial < STATES; trial++) {
    random_state(b, trial % 2 ? 0.3 : 2);
    memcpy(d->qpos, b->q, (size_t)m->nq * sizeof *b->q);
    memcpy(d->qvel, b->v, (size_t)m->nv * sizeof *b->v);
    for (int i = 0; i < m->nv; i++) d->qacc[i] = (b->v_next[i] - b->v[i]) / m->opt.timestep;
    mj_inverse(m, d);
    peer_hold(m, d);
    for (int i = 0; i < m->nv; i++) expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * m->opt.timestep * d->qacc[i];
    CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
    error[trial] = scene_error(b->u, expected, m->nv);
  }
  qsort(error, STATES, sizeof *error, ascending);
  printf("mujoco     relative error of u over %d states with %d rows: median %.1e, most %.1e\n", STATES, d->nefc,
         error[STATES / 2], error[STATES - 1]);
  // bound: differences for J'v; seen 1e-12
  CHECK(error[STATES - 1] < 1e-9);
  // control: without ties u is another
  b->state->options.constraint = 0;
  CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(scene_error(b->u, expected, m->nv) > 1e-2);
  b->state->options.constraint = 1;
  free(expected);
  mj_deleteData(d);
  mj_deleteModel(m);
}
#else
static void test_peer(bench *b) {
  (void)b;
  printf("skipped: built without MuJoCo\n");
}
#endif

int main(void) {
  bench b;
  if (bench_open(&b, model_file)) {
    CHECK(b.model->nequality == 13 && b.model->nwarning == 1);
    CHECK(cav_object_find(b.model, CAV_OBJECT_EQUALITY, "w3") == 6 &&
          cav_object_find(b.model, CAV_OBJECT_EQUALITY, "off") < 0);
    test_peer(&b);
    test_scene(&b, "all kinds");
    test_switch(&b);
  }
  bench_close(&b);
  test_guard();
  if (bench_open_text(&b, scene_tied)) test_scene(&b, "distances");
  bench_close(&b);
  return check_result();
}
