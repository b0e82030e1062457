/// Forward steps of scenes that come apart and of heaps that CHOLMOD factors: against each other, against the parts
/// alone, and for their bits. What tells that the parts are right: the sum of two scenes steps as each does, and dense
/// and sparse factors lead to one answer.
#include "hessian.h"
#include "scene.h"
#include "sparse.h"

static double *zeros(int n) {
  double *x = calloc((size_t)n, sizeof *x);
  return x ? x : (abort(), NULL);
}

// n boxes in layers over a floor, pressed into each other by a millimetre, about x
static char *lattice(char *to, int n, double x) {
  const int side = (int)ceil(cbrt(n));
  for (int i = 0; i < n; i++)
    to += sprintf(to, "<body pos='%g %g %g'><freejoint/><geom type='box' size='.1 .1 .1'/></body>",
                  x + 0.199 * (i % side), 0.199 * (i / side % side), 0.099 + 0.199 * (i / (side * side)));
  return to;
}

static const char head[] = "<mujoco><option timestep='0.002'/><worldbody><geom type='plane' size='50 50 1'/>";
static char text[1 << 18];

typedef struct scene {
  cav_model *model;
  cav_state *state;
  double *v, *u, *next;
} scene;

// piles of boxes five metres apart, each of so many
static scene open_piles(const int *count, int piles) {
  char *to = text + sprintf(text, "%s", head);
  for (int k = 0; k < piles; k++) to = lattice(to, count[k], 5.0 * k);
  sprintf(to, "</worldbody></mujoco>");
  scene s = {.model = scene_load(text)};
  if (!CHECK(s.model != NULL)) exit(check_result());
  s.state = cav_state_new(s.model);
  s.v = zeros(s.model->nv), s.u = zeros(s.model->nv), s.next = zeros(s.model->nv);
  for (int i = 0; i < s.model->nv; i++) s.v[i] = 0.3 * sin(7.0 * i) * cos(0.3 * i), s.u[i] = 3.0 * sin(1.3 * i);
  return s;
}

static void close_scene(scene *s) {
  free(s->v), free(s->u), free(s->next);
  cav_state_free(s->state), cav_model_free(s->model);
}

static double worst(const double *a, const double *b, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i] - b[i]));
  return most;
}

// makes the state send islands to CHOLMOD from so much work on
static void set_sparse(scene *s, double from) {
  cav_hessian_free(s->state->work->hessian);
  s->state->work->hessian = cav_hessian_new(from);
}

static void step(scene *s, cav_status expected) {
  CHECK(cav_forward(s->model, s->state, s->model->q0, s->v, s->u, s->next) == expected);
}

// piles step together as they step alone, the largest by CHOLMOD; those in the air take no impulse
static void test_apart(void) {
  static const int count[] = {8, 1, 27};
  scene all = open_piles(count, 3);
  step(&all, CAV_OK);
  CHECK(!cav_sparse_available() || cav_hessian_sparse_islands(all.state->work->hessian) == 1);
  for (int k = 0, first = 0; k < 3; first += 6 * count[k++]) {
    const int alone[] = {k == 0 ? 8 : 0, k == 1 ? 1 : 0, k == 2 ? 27 : 0};
    scene one = open_piles(alone, 3);
    memcpy(one.v, all.v + first, (size_t)one.model->nv * sizeof(double));
    memcpy(one.u, all.u + first, (size_t)one.model->nv * sizeof(double));
    step(&one, CAV_OK);
    // seen 3e-14 of speeds of 0.5
    CHECK_NEAR(worst(one.next, all.next + first, one.model->nv), 0, 1e-12);
    close_scene(&one);
  }
  close_scene(&all);
}

// dense and sparse factors: one answer; the sparse way is taken where it should be
static void test_ways(void) {
  static const int count[] = {8, 64};
  scene s = open_piles(count, 2);
  double *dense = zeros(s.model->nv);
  for (int soft = 0; soft < 3; soft++) {
    s.state->options.softness = soft == 0 ? s.model->options.softness : soft == 1 ? 1e-6 : 1e-9;
    s.state->options.stabilisation = soft == 0 ? s.model->options.stabilisation : CAV_STABILISATION_DISCRETE;
    set_sparse(&s, INFINITY);
    const cav_status status = cav_forward(s.model, s.state, s.model->q0, s.v, s.u, s.next);
    CHECK(cav_hessian_sparse_islands(s.state->work->hessian) == 0);
    memcpy(dense, s.next, (size_t)s.model->nv * sizeof *dense);
    const double from[] = {0, CAV_SPARSE_FROM};
    for (int k = 0; k < 2; k++) {
      set_sparse(&s, from[k]);
      step(&s, status);
      CHECK(!cav_sparse_available() || cav_hessian_sparse_islands(s.state->work->hessian) == 2 - k);
      printf("softness %d, CHOLMOD from %.0e: apart from dense %.1e\n", soft, from[k],
             worst(dense, s.next, s.model->nv));
      // rounding of J v_next by 1e-16 is an impulse larger by 1/softness, that a box without other contacts would
      // follow; seen 2e-16, 3e-8, and 0 where CHOLMOD finds no factor and the dense way stands in
      const double bound[] = {1e-12, 1e-13 / 1e-6, 1e-13 / 1e-9};
      CHECK_NEAR(worst(dense, s.next, s.model->nv), 0, bound[soft]);
    }
  }
  free(dense);
  close_scene(&s);
}

// boxes three millimetres apart that the discrete law sees ahead: some are about to meet, the rest stay out of the factors;
// many meet at up to 6 m/s and slide, which Newton comes to from softer contacts (100 iterations did not do without); and
// the answer is the dense one
static void test_ahead(void) {
  static const int count[] = {125};
  scene s = open_piles(count, 1);
  double *dense = zeros(s.model->nv), *q = zeros(s.model->nq);
  memcpy(q, s.model->q0, (size_t)s.model->nq * sizeof *q);
  for (int i = 0; i < s.model->nq; i++) q[i] *= i % 7 < 3 ? 1.02 : 1;
  size_t bytes[3] = {0};
  static const double speed[] = {0, 1, 3};
  for (int apart = 0; apart < 3; apart++) {
    const double *at = apart ? q : s.model->q0;
    s.state->options.stabilisation = apart ? CAV_STABILISATION_DISCRETE : s.model->options.stabilisation;
    // at rest where they are pressed, fast along straight lines where they are apart
    for (int i = 0; i < s.model->nv; i++) s.v[i] = i % 6 < 3 ? speed[apart] * sin(7.0 * i) * cos(0.3 * i) : 0;
    set_sparse(&s, INFINITY);
    CHECK(cav_forward(s.model, s.state, at, s.v, s.u, dense) == CAV_OK);
    set_sparse(&s, 0);
    cav_forward_report report = {0};
    CHECK(cav_forward_newton(s.model, s.state, at, s.v, s.u, 60, 1e-13, s.next, &report) == CAV_OK);
    bytes[apart] = cav_hessian_bytes(s.state->work->hessian);
    int pushed = 0;
    for (int i = 0; i < s.state->ncontact; i++) pushed += s.state->contact[i].impulse[0] > 0;
    printf("%s, %g m/s: %d iterations, %d contacts, %d push, %zu bytes of factors, from dense %.1e\n",
           apart ? "apart" : "pressed", speed[apart], report.iterations, s.state->ncontact, pushed, bytes[apart],
           worst(dense, s.next, s.model->nv));
    CHECK(pushed > 100 && (!apart || pushed < s.state->ncontact / 2));
    // rounding over the softness of the model, as above; seen 1e-13
    CHECK_NEAR(worst(dense, s.next, s.model->nv), 0, 1e-11);
  }
  CHECK(!cav_sparse_available() || bytes[1] < bytes[0] / 2); // seen 0.14; with all of them 1.0
  free(dense), free(q);
  close_scene(&s);
}

// the bits do not depend on what the state did before: same pattern, another, or none
static void test_bits(void) {
  static const int count[] = {64, 64};
  scene s = open_piles(count, 2);
  double *first = zeros(s.model->nv), *q = zeros(s.model->nq);
  set_sparse(&s, 0);
  step(&s, CAV_OK);
  memcpy(first, s.next, (size_t)s.model->nv * sizeof *first);
  for (int k = 0; k < 4; k++) {
    memcpy(q, s.model->q0, (size_t)s.model->nq * sizeof *q);
    // one box above the rest, then a whole pile
    for (int i = 0; i < (k == 1 ? 1 : k == 2 ? 64 : 0); i++) q[7 * i + 2] += 5;
    if (k == 3) set_sparse(&s, 0);
    if (k > 0) CHECK(cav_forward(s.model, s.state, q, s.v, s.u, s.next) == CAV_OK);
    step(&s, CAV_OK);
    CHECK(!memcmp(first, s.next, (size_t)s.model->nv * sizeof *first));
  }
  free(first), free(q);
  close_scene(&s);
}

// factors of a matrix known in closed form: tridiagonal 2, -1, whose inverse is min(i,j) (n+1-max(i,j))/(n+1)
static void test_factors(void) {
  enum { N = 50 };
  int start[N + 1], row[2 * N], n = 0;
  double value[2 * N], x[N] = {0};
  if (!cav_sparse_available()) return;
  for (int j = 0; j < N; j++) {
    start[j] = n;
    row[n] = j, value[n++] = 2;
    if (j + 1 < N) row[n] = j + 1, value[n++] = -1;
  }
  start[N] = n;
  cav_sparse *sparse = cav_sparse_new(0);
  CHECK(cav_sparse_analyse(sparse, N, start, row) == CAV_OK);
  CHECK(cav_sparse_factor(sparse, value) == CAV_OK);
  CHECK(cav_sparse_entries(sparse) >= n);
  x[19] = 1;
  CHECK(cav_sparse_solve(sparse, x, x) == CAV_OK);
  for (int i = 0; i < N; i++) CHECK_NEAR(x[i], (i < 19 ? (i + 1) * (N - 19) : 20 * (N - i)) / (N + 1.0), 1e-13);
  value[0] = -2;
  CHECK(cav_sparse_factor(sparse, value) == CAV_NOT_CONVERGED);
  value[0] = 2;
  CHECK(cav_sparse_factor(sparse, value) == CAV_OK);
  cav_sparse_free(sparse);
}

int main(void) {
  test_factors();
  test_apart();
  test_ways();
  test_ahead();
  test_bits();
  return check_result();
}
