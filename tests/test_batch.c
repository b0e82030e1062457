/// Batches of points against the single calls, bit by bit, at one to five threads: a humanoid that stands, falls and lies,
/// and a scene with every kind of joint. A row that fails is told, and takes no other with it.
#include "scene.h"

enum { ROWS = 203, THREADS = 5 };

typedef struct points {
  cav_model *model;
  cav_state *state;
  double *q, *v, *next, *u, *found, *alone;
  double *d_found, *d_alone;
  cav_status status[ROWS];
} points;

static double *row(double *x, int i, int n) { return x + (size_t)i * (size_t)n; }

// random states, from in the floor to above it
static points draw(cav_model *model) {
  points p = {.model = model};
  if (!CHECK(model != NULL)) exit(check_result());
  int nq = model->nq, nv = model->nv;
  p.state = cav_state_new(model);
  p.q = scene_vector(ROWS * nq);
  p.v = scene_vector(ROWS * nv), p.next = scene_vector(ROWS * nv), p.u = scene_vector(ROWS * nv);
  p.found = scene_vector(ROWS * nv), p.alone = scene_vector(ROWS * nv);
  p.d_found = scene_vector(3 * ROWS * nv * nv), p.d_alone = scene_vector(3 * nv * nv);
  for (int i = 0; i < ROWS; i++) {
    scene_posture(model, row(p.q, i, nq), p.alone, 0.3);
    row(p.q, i, nq)[2] -= 0.002 * i;
    scene_normals(row(p.v, i, nv), nv, 0.3);
    for (int j = 0; j < nv; j++) row(p.next, i, nv)[j] = row(p.v, i, nv)[j] + 0.02 * scene_normal();
  }
  return p;
}

static void release(points *p) {
  free(p->q), free(p->v), free(p->next), free(p->u), free(p->found), free(p->alone), free(p->d_found), free(p->d_alone);
  cav_state_free(p->state);
  cav_model_free(p->model);
}

static int same(const double *a, const double *b, int n) { return !memcmp(a, b, (size_t)n * sizeof *a); }

// forces of all rows; the single state goes through them backwards, so what it did before differs
static int test_inverse(points *p) {
  int nq = p->model->nq, nv = p->model->nv, touching = 0;
  for (int i = ROWS - 1; i >= 0; i--) {
    CHECK(!cav_inverse(p->model, p->state, row(p->q, i, nq), row(p->v, i, nv), row(p->next, i, nv), row(p->u, i, nv)));
    touching += p->state->ncontact > 0;
  }
  for (int threads = 1; threads <= THREADS; threads++) {
    memset(p->found, 0, (size_t)(ROWS * nv) * sizeof *p->found);
    CHECK(!cav_inverse_batch(p->model, NULL, threads, ROWS, p->q, p->v, p->next, p->found, p->status));
    CHECK(same(p->found, p->u, ROWS * nv));
  }
  return touching;
}

static void test_forward(points *p) {
  int nq = p->model->nq, nv = p->model->nv;
  for (int threads = 1; threads <= THREADS; threads += 2) {
    cav_status all =
        cav_forward_batch(p->model, NULL, threads, ROWS, p->q, p->v, p->u, p->found, threads > 1 ? p->status : NULL);
    cav_status first = CAV_OK;
    for (int i = ROWS - 1; i >= 0; i--) {
      cav_status status =
          cav_forward(p->model, p->state, row(p->q, i, nq), row(p->v, i, nv), row(p->u, i, nv), p->alone);
      if (status) first = status;
      if (threads > 1) CHECK(p->status[i] == status);
      CHECK(same(row(p->found, i, nv), p->alone, nv));
    }
    CHECK(all == first);
  }
}

static void test_jacobian(points *p, cav_derivative method) {
  int nq = p->model->nq, nv = p->model->nv, n = nv * nv;
  double *dq = p->d_found, *dv = dq + ROWS * n, *dn = dv + ROWS * n, *alone = p->d_alone;
  CHECK(!cav_inverse_jacobian_batch(p->model, NULL, method, 3, ROWS, p->q, p->v, p->next, dq, dv, dn, NULL));
  int rows = 0;
  for (int i = 0; i < ROWS; i++) {
    CHECK(!cav_inverse_jacobian_by(p->model, p->state, method, row(p->q, i, nq), row(p->v, i, nv), row(p->next, i, nv),
                                   alone, alone + n, alone + 2 * n));
    rows += same(row(dq, i, n), alone, n) && same(row(dv, i, n), alone + n, n) && same(row(dn, i, n), alone + 2 * n, n);
  }
  CHECK(rows == ROWS);
  // one of the three alone
  memset(dq, 0, (size_t)(3 * ROWS * n) * sizeof *dq);
  CHECK(!cav_inverse_jacobian_batch(p->model, NULL, method, 1, ROWS, p->q, p->v, p->next, NULL, dv, NULL, NULL));
  CHECK(same(row(dv, ROWS - 1, n), alone + n, n) && dq[0] == 0 && dn[0] == 0);
}

// rows that fail are told, and stay as they were
static void test_failures(points *p) {
  int nq = p->model->nq, nv = p->model->nv;
  double kept[2] = {row(p->q, 40, nq)[0], row(p->q, 150, nq)[0]};
  row(p->q, 150, nq)[0] = NAN, row(p->q, 40, nq)[0] = INFINITY;
  for (int i = 0; i < ROWS * nv; i++) p->found[i] = -7;
  CHECK(cav_inverse_batch(p->model, NULL, 2, ROWS, p->q, p->v, p->next, p->found, p->status) == CAV_NOT_FINITE);
  for (int i = 0; i < ROWS; i++) {
    int bad = i == 40 || i == 150;
    CHECK(p->status[i] == (bad ? CAV_NOT_FINITE : CAV_OK));
    CHECK(bad ? row(p->found, i, nv)[0] == -7 : same(row(p->found, i, nv), row(p->u, i, nv), nv));
  }
  row(p->q, 40, nq)[0] = kept[0], row(p->q, 150, nq)[0] = kept[1];

  // options of their own, refused where they are none
  cav_options options = p->model->options;
  options.gravity = 0;
  CHECK(!cav_inverse_batch(p->model, &options, 2, ROWS, p->q, p->v, p->next, p->found, NULL));
  CHECK(!same(p->found, p->u, ROWS * nv));
  options.timestep = -1;
  CHECK(cav_inverse_batch(p->model, &options, 2, ROWS, p->q, p->v, p->next, p->found, NULL) == CAV_BAD_INPUT);
  CHECK(cav_inverse_batch(p->model, NULL, 0, ROWS, p->q, p->v, p->next, p->found, NULL) == CAV_BAD_INPUT);
  CHECK(cav_inverse_batch(p->model, NULL, 1, -1, p->q, p->v, p->next, p->found, NULL) == CAV_BAD_INPUT);
  CHECK(cav_inverse_batch(p->model, NULL, 4, 0, p->q, p->v, p->next, p->found, NULL) == CAV_OK);
}

int main(void) {
  cav_error error = {0};
  points p = draw(cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error));
  int touching = test_inverse(&p);
  CHECK(touching > ROWS / 3);
  test_forward(&p);
  test_jacobian(&p, CAV_DERIVATIVE_ANALYTIC);
  test_failures(&p);
  release(&p);
  p = draw(scene_load(scene_joints));
  test_inverse(&p);
  test_jacobian(&p, CAV_DERIVATIVE_FORWARD);
  release(&p);
  printf("%d of %d postures touch\n", touching, ROWS);
  return check_result();
}
