/// Regularisers by the true diagonal of A, and coupled rows: against dense algebra done here, against both forward
/// solvers, and that stages may be reused. Each has a control.
#include "impulse.h"
#include "scene.h"
#include "step.h"

/// Every kind of row at once: contacts of 1, 3, 4 and 6 rows, limits of hinge, slide, ball and tendon, friction losses,
/// ties.
static const char every_row[] =
    "<mujoco><compiler angle='degree'/><option timestep='.004'/><worldbody><geom type='plane' size='1 1 1'/>"
    "<body name='a' pos='0 0 .28'><freejoint/><geom type='box' size='.1 .2 .3' friction='.7 .02 .01' condim='6'/>"
    "<body name='b' pos='.3 0 -.2'><joint name='j' type='ball' range='0 20' limited='true' damping='.2'/>"
    "<geom size='.09' condim='4'/></body>"
    "<body name='c' pos='0 .4 0'><joint name='k' axis='1 0 0' range='-5 5' limited='true' frictionloss='.3'/>"
    "<geom type='capsule' size='.05' fromto='0 0 0 0 .1 -.25'/>"
    "<body pos='0 .2 -.2'><joint name='s' type='slide' axis='0 0 1' range='-.01 .01' limited='true' armature='.1'/>"
    "<geom size='.06' condim='1'/></body></body></body>"
    "<body name='d' pos='1 0 .19'><freejoint/><geom size='.2'/></body></worldbody>"
    "<tendon><fixed name='t' limited='true' range='-.02 .02' frictionloss='.2'><joint joint='k' coef='.3'/>"
    "<joint joint='s' coef='1'/></fixed></tendon>"
    "<equality><connect body1='c' body2='d' anchor='.5 0 0'/><joint joint1='s' joint2='k'/></equality></mujoco>";

typedef struct bench {
  cav_model *model;
  cav_state *state;
  double *q, *v, *v_next, *u, *out;
} bench;

static void random_state(bench *b, double noise) {
  scene_posture(b->model, b->q, b->v, 0.05);
  scene_normals(b->v, b->model->nv, 0.3);
  for (int i = 0; i < b->model->nv; i++) b->v_next[i] = b->v[i] + noise * scene_normal();
}

// x := A^-1 x by Cholesky, A [n*n] overwritten
static void solve_dense(int n, double *A, double *x) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      double sum = A[i * n + j];
      for (int k = 0; k < j; k++) sum -= A[i * n + k] * A[j * n + k];
      A[i * n + j] = i == j ? sqrt(sum) : sum / A[j * n + j];
    }
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < i; k++) x[i] -= A[i * n + k] * x[k];
    x[i] /= A[i * n + i];
  }
  for (int i = n - 1; i >= 0; i--) {
    for (int k = i + 1; k < n; k++) x[i] -= A[k * n + i] * x[k];
    x[i] /= A[i * n + i];
  }
}

/// Jacobian rows, dense.
typedef struct dense {
  int n, nblock;
  cav_block block[200];
  double J[200 * 64];
} dense;

static void read_jacobian(const bench *b, dense *d) {
  int *dof = calloc(200 * 64, sizeof *dof);
  double *J = scene_vector(200 * 64);
  d->nblock = b->state->ncontact + b->state->nrow + b->state->nequality;
  d->n = cav_jacobian(b->model, b->state, d->block, dof, J);
  for (int i = 0; i < d->nblock; i++)
    for (int k = 0; k < d->block[i].dim; k++)
      cav_block_spread(&d->block[i], k, b->model->nv, d->J + (d->block[i].first + k) * b->model->nv);
  free(dof), free(J);
}

static double regulariser(const cav_state *s, const cav_block *block, int k) {
  if (block->contact >= 0) return s->contact[block->contact].regulariser[k];
  return block->equality >= 0 ? s->equality[block->equality].regulariser[k] : s->row[block->row].regulariser;
}

// j' M^-1 j, or with M_hat
static double diagonal(const bench *b, const dense *d, const double *j, int hat) {
  int nv = b->model->nv;
  double *M = scene_vector(nv * nv), *x = scene_vector(nv), *q = scene_vector(b->model->nq), sum = 0;
  cav_state *other = cav_state_new(b->model);
  other->options = b->state->options;
  memcpy(q, b->q, (size_t)b->model->nq * sizeof *q);
  CHECK(cav_inertia(b->model, other, q, M) == CAV_OK);
  for (int i = 0; i < d->nblock && hat; i++) {
    const cav_block *block = &d->block[i];
    for (int k = 0; k < block->dim && block->equality >= 0; k++) {
      const double *row = d->J + (block->first + k) * nv;
      for (int r = 0; r < nv; r++)
        for (int c = 0; c < nv; c++) M[r * nv + c] += row[r] * row[c] / regulariser(b->state, block, k);
    }
  }
  memcpy(x, j, (size_t)nv * sizeof *x);
  solve_dense(nv, M, x);
  for (int i = 0; i < nv; i++) sum += j[i] * x[i];
  free(M), free(x), free(q);
  cav_state_free(other);
  return sum;
}

// R = epsilon times the diagonal of J M_hat^-1 J' (J_E M^-1 J_E' for ties), dense algebra
static void test_diagonal(bench *b) {
  static dense d;
  double worst = 0, control = 0;
  for (int trial = 0; trial < 10; trial++) {
    random_state(b, 0.1);
    b->state->options.regulariser = CAV_REGULARISER_EXACT;
    CHECK(cav_position(b->model, b->state, b->q) == CAV_OK);
    read_jacobian(b, &d);
    for (int i = 0; i < d.nblock; i++) {
      const cav_block *block = &d.block[i];
      for (int k = 0; k < (block->equality >= 0 ? block->dim : 1); k++) {
        double A = diagonal(b, &d, d.J + (block->first + k) * b->model->nv, block->equality < 0);
        double R = regulariser(b->state, block, k) / b->state->options.softness;
        worst = fmax(worst, fabs(R / A - 1));
      }
      // (22): R mu^2 the same for all friction rows
      if (block->contact < 0) continue;
      const cav_contact *c = &b->state->contact[block->contact];
      for (int k = 2; k < c->dim; k++) {
        double first = c->regulariser[1] * c->friction[0] * c->friction[0];
        CHECK_NEAR(c->regulariser[k] * c->friction[k - 1] * c->friction[k - 1] / first, 1, 1e-13);
      }
    }
    // control: the reference is another
    b->state->options.regulariser = CAV_REGULARISER_REFERENCE;
    CHECK(cav_position(b->model, b->state, b->q) == CAV_OK);
    for (int i = 0; i < d.nblock; i++) {
      double A = diagonal(b, &d, d.J + d.block[i].first * b->model->nv, d.block[i].equality < 0);
      control = fmax(control, fabs(regulariser(b->state, &d.block[i], 0) / b->state->options.softness / A - 1));
    }
  }
  printf("R against epsilon diag(A), dense: %.1e (by reference weights %.1e), %d rows\n", worst, control, d.n);
  // bound: two factorisations of M_hat, whose condition is 1/epsilon times that of M; seen 5e-15
  CHECK(worst < 1e-8);
  CHECK(control > 0.1);
}

// v_next of the inverse's u by both solvers
static void test_round_trip(bench *b, const char *name, double noise) {
  double newton = 0, gpgs = 0, mismatch = 0;
  int rows = 0;
  for (int trial = 0; trial < 20; trial++) {
    random_state(b, noise);
    CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
    int n = cav_jacobian_rows(b->state);
    rows = n > rows ? n : rows;
    CHECK(cav_forward_newton(b->model, b->state, b->q, b->v, b->u, 100, 1e-13, b->out, NULL) == CAV_OK);
    newton = fmax(newton, scene_error(b->out, b->v_next, b->model->nv));
    cav_forward_report report = {0};
    CHECK(cav_forward_gpgs(b->model, b->state, b->q, b->v, b->u, 100000, 1e-14, b->out, &report) == CAV_OK);
    gpgs = fmax(gpgs, scene_error(b->out, b->v_next, b->model->nv));
    mismatch = fmax(mismatch, report.mismatch);
  }
  printf("%-28s %d rows: newton %.1e, gauss-seidel %.1e, mismatch %.1e N s\n", name, rows, newton, gpgs, mismatch);
  // bound: tolerances through the lightest link; seen 3e-12 and 5e-10
  CHECK(newton < 1e-7);
  CHECK(gpgs < 1e-7);
}

// reused stages give what a fresh evaluation gives, to the bit
static void test_stages(bench *b) {
  cav_state *fresh = cav_state_new(b->model);
  fresh->options = b->state->options;
  random_state(b, 0.1);
  CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u) == CAV_OK);
  for (int i = 0; i < b->model->nv; i++) b->v_next[i] += 0.01;
  CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_VELOCITY, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(cav_inverse(b->model, fresh, b->q, b->v, b->v_next, b->out) == CAV_OK);
  CHECK_NEAR_ALL(b->u, b->out, b->model->nv, 0);
  for (int i = 0; i < b->model->nv; i++) b->v[i] -= 0.02;
  CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_POSITION, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(cav_inverse(b->model, fresh, b->q, b->v, b->v_next, b->out) == CAV_OK);
  CHECK_NEAR_ALL(b->u, b->out, b->model->nv, 0);
  // an option that positions depend on makes all new
  b->state->options.coupled = !b->state->options.coupled;
  fresh->options.coupled = b->state->options.coupled;
  CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_VELOCITY, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(scene_error(b->u, b->out, b->model->nv) > 1e-6);
  CHECK(cav_inverse(b->model, fresh, b->q, b->v, b->v_next, b->out) == CAV_OK);
  CHECK_NEAR_ALL(b->u, b->out, b->model->nv, 0);
  cav_state_free(fresh);
}

int main(void) {
  bench b = {.model = scene_load(every_row)};
  b.state = b.model ? cav_state_new(b.model) : NULL;
  if (!CHECK(b.state != NULL)) return check_result();
  double **const all[] = {&b.q, &b.v, &b.v_next, &b.u, &b.out};
  for (int i = 0; i < 5; i++) *all[i] = scene_vector(b.model->nq);
  cav_options *o = &b.state->options;
  o->stabilisation = CAV_STABILISATION_DISCRETE;
  o->softness = 0.01;
  test_diagonal(&b);
  static const struct {
    const char *name;
    cav_stabilisation stabilisation;
    cav_regulariser regulariser;
    int coupled;
  } cases[] = {{"solref, exact", CAV_STABILISATION_SOLREF, CAV_REGULARISER_EXACT, 0},
               {"discrete, exact", CAV_STABILISATION_DISCRETE, CAV_REGULARISER_EXACT, 0},
               {"solref, reference, coupled", CAV_STABILISATION_SOLREF, CAV_REGULARISER_REFERENCE, 1},
               {"discrete, exact, coupled", CAV_STABILISATION_DISCRETE, CAV_REGULARISER_EXACT, 1}};
  for (int i = 0; i < 4; i++) {
    o->stabilisation = cases[i].stabilisation;
    o->regulariser = cases[i].regulariser;
    o->coupled = cases[i].coupled;
    test_round_trip(&b, cases[i].name, 0.05);
    test_stages(&b);
    o->coupled = cases[i].coupled;
  }
  cav_state_free(b.state);
  cav_model_free(b.model);
  for (int i = 0; i < 5; i++) free(*all[i]);
  return check_result();
}
