/// Error against time of the ways to du/dq, du/dv and du/dv_next: one-sided and centred staged differences, analytic,
/// and MuJoCo's staged one-sided differences on the same states of the same model, by number of constraint rows. Errors
/// are those of du/dq, which both libraries define alike, relative to its norm, against a sixth-order difference;
/// states at which two steps of that disagree, at a kink, are left out. A time is the shortest of several runs; shown
/// are medians over states. Usage: bench_derivative [MODEL]; default mujoco/humanoid.xml among the shared models.
#include "bench.h"
#include "step.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else

enum { BINS = 8, WIDTH = 10, PER_BIN = 20, DRAWS = 20000, RUNS = 5, METHODS = 4 };
static const char *const names[METHODS] = {"one-sided", "centred", "analytic", "MuJoCo"};

/// Time and error of each method at one state.
typedef struct sample {
  double time[METHODS], error[METHODS];
  double contacts;
} sample;

static mjModel *m;
static mjData *d;
static cav_model *model;
static cav_state *state;
static double *q, *v, *a, *v_next, *u;

// keeps the state in d; whether both libraries see it alike
static int keep(double *expected) {
  mju_copy(q, d->qpos, m->nq);
  mju_copy(v, d->qvel, m->nv);
  mju_copy(a, d->qacc, m->nv);
  for (int i = 0; i < m->nv; i++) {
    double h = m->opt.timestep;
    v_next[i] = v[i] + h * a[i];
    expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * h * a[i];
  }
  return cav_inverse(model, state, q, v, v_next, u) == CAV_OK && scene_error(u, expected, m->nv) < 1e-9;
}

// MuJoCo's staged one-sided differences: one full inverse a column of q, skips for the columns of v and a
static void their_jacobian(double *dq, double *dv, double *da, double *base, double *moved, double *move) {
  const double step = 1e-6;
  int nv = m->nv;
  mju_copy(d->qpos, q, m->nq);
  mju_copy(d->qvel, v, nv);
  mju_copy(d->qacc, a, nv);
  mj_inverse(m, d);
  mju_copy(base, d->qfrc_inverse, nv);
  for (int which = 0; which < 3; which++) {
    double *out = which == 0 ? da : which == 1 ? dv : dq;
    for (int j = 0; j < nv; j++) {
      if (which == 0) {
        d->qacc[j] += step;
        mj_inverseSkip(m, d, mjSTAGE_VEL, 1);
        d->qacc[j] = a[j];
      } else if (which == 1) {
        d->qvel[j] += step;
        mj_inverseSkip(m, d, mjSTAGE_POS, 1);
        d->qvel[j] = v[j];
      } else {
        mju_copy(moved, q, m->nq);
        move[j] = 1;
        mj_integratePos(m, moved, move, step);
        move[j] = 0;
        mju_copy(d->qpos, moved, m->nq);
        mj_inverse(m, d);
      }
      for (int i = 0; i < nv; i++) out[i * nv + j] = (d->qfrc_inverse[i] - base[i]) / step;
    }
  }
}

// du/dq by a difference of sixth order
static void reference(double step, double *out, double *moved, double *value) {
  static const double weight[] = {-1.0 / 60, 3.0 / 20, -3.0 / 4, 3.0 / 4, -3.0 / 20, 1.0 / 60};
  static const int at[] = {-3, -2, -1, 1, 2, 3};
  int nv = m->nv;
  memset(out, 0, (size_t)(nv * nv) * sizeof *out);
  for (int j = 0; j < nv; j++) {
    for (int k = 0; k < 6; k++) {
      memcpy(moved, q, (size_t)m->nq * sizeof *moved);
      cav_configuration_perturb(model, j, at[k] * step, moved);
      cav_inverse(model, state, moved, v, v_next, value);
      for (int i = 0; i < nv; i++) out[i * nv + j] += weight[k] * value[i] / step;
    }
  }
}

// all methods at the kept state; 0 at a kink
static int measure(sample *s, double *x[6], double *moved, double *move) {
  int nv = m->nv;
  s->contacts = state->ncontact;
  reference(2e-5, x[3], moved, x[5]);
  reference(1e-5, x[4], moved, x[5]);
  if (!(scene_error(x[3], x[4], nv * nv) < 1e-8)) return 0;
  for (int k = 0; k < METHODS; k++) {
    s->time[k] = INFINITY;
    for (int r = 0; r < RUNS; r++) {
      double t = bench_seconds();
      if (k < 3) {
        cav_status status = cav_inverse_jacobian_by(model, state, (cav_derivative)k, q, v, v_next, x[0], x[1], x[2]);
        if (status != CAV_OK) return 0;
      } else {
        their_jacobian(x[0], x[1], x[2], x[5], moved, move);
      }
      s->time[k] = fmin(s->time[k], (bench_seconds() - t) * 1e6);
    }
    s->error[k] = scene_error(x[0], x[4], nv * nv);
  }
  return 1;
}

// median of one number of n samples, by its offset
static double median(const sample *s, int n, size_t offset) {
  double x[PER_BIN];
  for (int i = 0; i < n; i++) x[i] = *(const double *)((const char *)&s[i] + offset);
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[n / 2];
}

static void report(sample bin[BINS][PER_BIN], const int *count) {
  printf("%-9s %6s %8s", "rows", "states", "contacts");
  for (int k = 0; k < METHODS; k++) printf("  %17s", names[k]);
  printf("  %s\n", "analytic/MuJoCo");
  for (int b = 0; b < BINS; b++) {
    const sample *s = bin[b];
    int n = count[b];
    if (n == 0) continue;
    printf("%3d - %-3d %6d %8.0f", b == 0 ? 0 : (b - 1) * WIDTH + 1, b * WIDTH, n,
           median(s, n, offsetof(sample, contacts)));
    double time[METHODS];
    for (int k = 0; k < METHODS; k++) {
      time[k] = median(s, n, offsetof(sample, time) + (size_t)k * sizeof(double));
      printf("  %7.1f us %7.1e", time[k], median(s, n, offsetof(sample, error) + (size_t)k * sizeof(double)));
    }
    printf("  %.3f\n", time[2] / time[3]);
  }
}

static int load(const char *path) {
  char text[1000];
  cav_error error = {0};
  m = mj_loadXML(path, NULL, text, sizeof text);
  model = cav_model_load(path, &error);
  if (!m || !model) {
    fprintf(stderr, "%s\n", m ? error.text : text);
    return 0;
  }
  m->opt.cone = mjCONE_ELLIPTIC;
  d = mj_makeData(m);
  state = cav_state_new(model);
  q = scene_vector(m->nq), v = scene_vector(m->nv), a = scene_vector(m->nv), v_next = scene_vector(m->nv);
  u = scene_vector(m->nv);
  return d && state;
}

int main(int argc, char **argv) {
  static sample bin[BINS][PER_BIN];
  int count[BINS] = {0}, kinks = 0;
  char path[4200];
  const char *folder = check_shared_models();
  if (argc < 2 && !folder) {
    printf("skipped: name a model or set CAVORT_SHARED_MODELS\n");
    return CHECK_SKIPPED;
  }
  snprintf(path, sizeof path, "%s%s", argc > 1 ? argv[1] : folder, argc > 1 ? "" : "/mujoco/humanoid.xml");
  if (!load(path)) return EXIT_FAILURE;
  int nv = m->nv;
  double *x[6], *moved = scene_vector(m->nq), *move = scene_vector(nv), *expected = scene_vector(nv);
  for (int k = 0; k < 6; k++) x[k] = scene_vector(nv * nv);
  for (int k = 0; k < DRAWS; k++) {
    bench_draw(m, d);
    mj_inverse(m, d);
    int b = (d->nefc + WIDTH - 1) / WIDTH;
    if (b >= BINS || count[b] == PER_BIN || !keep(expected)) continue;
    int smooth = measure(&bin[b][count[b]], x, moved, move);
    count[b] += smooth;
    kinks += !smooth;
  }
  printf("%s: nv %d; median time of all three Jacobians and error of du/dq; %d states at kinks left out\n", path, nv,
         kinks);
  report(bin, count);
  mj_deleteData(d);
  mj_deleteModel(m);
  cav_state_free(state);
  cav_model_free(model);
  for (int k = 0; k < 6; k++) free(x[k]);
  free(moved), free(move), free(expected), free(q), free(v), free(a), free(v_next), free(u);
  return EXIT_SUCCESS;
}
#endif
