/// Time of the inverse against MuJoCo's mj_inverse: the same states of the same model in one run, the two by turns, by
/// number of constraint rows. A time is the shortest of several short runs of one state; shown are the median over
/// states and the middle half. Then by the same bins batches of 1000 states, of the drawn ones and of knots of paths that
/// begin there: means over a batch. Prints the work done beside the time, and the fraction of the stages of ours.
/// Usage: bench_inverse [MODEL]; default mujoco/humanoid.xml among the shared models.
#include "bench.h"
#include "step.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else

enum { BINS = 8, WIDTH = 10, PER_BIN = 40, DRAWS = 40000, RUNS = 15, CALLS = 10 };

/// One state and its times in microseconds.
typedef struct sample {
  double *q, *v, *a, *v_next;
  int rows, contacts;
  double ours, theirs, from_position;
} sample;

static mjModel *m;
static mjData *d;
static cav_model *model;
static cav_state *state;
static double *u;

static double *kept(const double *x, int n) {
  double *copy = scene_vector(n);
  memcpy(copy, x, (size_t)n * sizeof *copy);
  return copy;
}

// whether both libraries see the state in d alike: what is timed must be the same work
static int alike(double *v_next, double *expected) {
  for (int i = 0; i < m->nv; i++) {
    double h = m->opt.timestep;
    v_next[i] = d->qvel[i] + h * d->qacc[i];
    expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * h * d->qacc[i];
  }
  cav_status status = cav_inverse(model, state, d->qpos, d->qvel, v_next, u);
  return status == CAV_OK && scene_error(u, expected, m->nv) < 1e-9;
}

// the state in d, with its work
static sample keep(void) {
  sample s = {.q = kept(d->qpos, m->nq), .v = kept(d->qvel, m->nv), .a = kept(d->qacc, m->nv)};
  s.v_next = scene_vector(m->nv);
  for (int i = 0; i < m->nv; i++) s.v_next[i] = s.v[i] + m->opt.timestep * s.a[i];
  s.rows = d->nefc;
  s.contacts = d->ncon;
  s.ours = s.theirs = s.from_position = INFINITY;
  return s;
}

// one short run of each, by turns
static void run(sample *s) {
  mju_copy(d->qpos, s->q, m->nq);
  mju_copy(d->qvel, s->v, m->nv);
  mju_copy(d->qacc, s->a, m->nv);
  double t = bench_seconds();
  for (int k = 0; k < CALLS; k++) mj_inverse(m, d);
  s->theirs = fmin(s->theirs, (bench_seconds() - t) * 1e6 / CALLS);
  t = bench_seconds();
  for (int k = 0; k < CALLS; k++) cav_inverse(model, state, s->q, s->v, s->v_next, u);
  s->ours = fmin(s->ours, (bench_seconds() - t) * 1e6 / CALLS);
  t = bench_seconds();
  for (int k = 0; k < CALLS; k++) cav_inverse_from(model, state, CAV_STAGE_POSITION, s->q, s->v, s->v_next, u);
  s->from_position = fmin(s->from_position, (bench_seconds() - t) * 1e6 / CALLS);
}

// quantile of something of n samples
static double quantile(const sample *s, int n, double fraction, double (*of)(const sample *)) {
  double x[PER_BIN];
  for (int i = 0; i < n; i++) x[i] = of(&s[i]);
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[(int)(fraction * (n - 1) + 0.5)];
}

static double ours(const sample *s) { return s->ours; }
static double theirs(const sample *s) { return s->theirs; }
static double from_position(const sample *s) { return s->from_position; }
static double ratio(const sample *s) { return s->ours / s->theirs; }
static double contacts(const sample *s) { return s->contacts; }

static void report(sample bin[BINS][PER_BIN], const int *count) {
  printf("%-9s %6s %8s %10s %10s %13s %7s %s\n", "rows", "states", "contacts", "mj_inverse", "cav_inverse",
         "from position", "ratio", "middle half");
  for (int b = 0; b < BINS; b++) {
    const sample *s = bin[b];
    int n = count[b];
    if (n == 0) continue;
    printf("%3d - %-3d %6d %8.0f %7.2f us %8.2f us %10.2f us %7.3f %.3f - %.3f\n", b == 0 ? 0 : (b - 1) * WIDTH + 1,
           b * WIDTH, n, quantile(s, n, 0.5, contacts), quantile(s, n, 0.5, theirs), quantile(s, n, 0.5, ours),
           quantile(s, n, 0.5, from_position), quantile(s, n, 0.5, ratio), quantile(s, n, 0.25, ratio),
           quantile(s, n, 0.75, ratio));
  }
}

enum { PATH = 25, ROWS = PATH * PER_BIN, CHUNK = 10 };

/// Rows of a batch, one after the other; of MuJoCo's accelerations.
typedef struct rows {
  double *q, *v, *v_next, *a, *u;
} rows;

static rows new_rows(void) {
  return (rows){scene_vector(ROWS * m->nq), scene_vector(ROWS * m->nv), scene_vector(ROWS * m->nv),
                scene_vector(ROWS * m->nv), scene_vector(ROWS * m->nv)};
}

static void free_rows(rows *r) { free(r->q), free(r->v), free(r->v_next), free(r->a), free(r->u); }

// the states of a bin in turn, or from each of them a path of knots on which accelerations fade away
static void fill_rows(const sample *bin, int n, int paths, rows *r) {
  const double h = model->timestep;
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv;
  for (size_t i = 0; i < ROWS; i++) {
    const sample *s = bin + (paths ? (int)i / PATH : (int)i) % n;
    double *q = r->q + i * nq, *v = r->v + i * nv, *a = r->a + i * nv;
    if (paths && i % PATH) {
      cav_integrate(model, q - nq, v - nv, h, q);
      for (size_t k = 0; k < nv; k++) v[k] = 0.98 * v[k - nv] + h * a[k - nv], a[k] = 0.9 * a[k - nv];
    } else {
      memcpy(q, s->q, nq * sizeof *q), memcpy(v, s->v, nv * sizeof *v), memcpy(a, s->a, nv * sizeof *a);
    }
    for (size_t k = 0; k < nv; k++) r->v_next[i * nv + k] = v[k] + h * a[k];
  }
}

// a row into d, as MuJoCo wants it
static void put_row(const rows *r, size_t i) {
  mju_copy(d->qpos, r->q + i * (size_t)m->nq, m->nq);
  mju_copy(d->qvel, r->v + i * (size_t)m->nv, m->nv);
  mju_copy(d->qacc, r->a + i * (size_t)m->nv, m->nv);
  mj_inverse(m, d);
}

// s that MuJoCo takes for a chunk of rows
static double time_chunk(const rows *r, size_t from) {
  double t = bench_seconds();
  for (size_t i = from; i < from + CHUNK; i++) put_row(r, i);
  return bench_seconds() - t;
}

// the farthest that ours is from theirs, of the norm of u
static double farthest(const rows *r) {
  const size_t nv = (size_t)m->nv;
  double far = 0;
  for (size_t i = 0; i < ROWS; i++) {
    put_row(r, i);
    for (size_t j = 0; j < nv; j++) {
      double expected = d->qfrc_inverse[j] + m->dof_damping[j] * m->opt.timestep * d->qacc[j];
      far = fmax(far, fabs(expected - r->u[i * nv + j]) / (1 + mju_norm(d->qfrc_inverse, m->nv)));
    }
  }
  return far;
}

// microseconds a row, by turns: ours least of several batches, theirs of several runs of each chunk; whether both see the same
static int time_rows(rows *r, double *theirs_us, double *ours_us) {
  double least[ROWS / CHUNK];
  *theirs_us = 0, *ours_us = INFINITY;
  for (int c = 0; c < ROWS / CHUNK; c++) least[c] = INFINITY;
  for (int k = 0; k < RUNS; k++) {
    double t = bench_seconds();
    cav_inverse_batch(model, NULL, 1, ROWS, r->q, r->v, r->v_next, r->u, NULL);
    *ours_us = fmin(*ours_us, (bench_seconds() - t) * 1e6 / ROWS);
    for (int c = 0; c < ROWS / CHUNK; c++) least[c] = fmin(least[c], time_chunk(r, (size_t)(c * CHUNK)));
  }
  for (int c = 0; c < ROWS / CHUNK; c++) *theirs_us += least[c] * 1e6 / ROWS;
  return farthest(r) < 1e-9;
}

static void batches(sample bin[BINS][PER_BIN], const int *count) {
  printf("batches of %d, means: %-10s %10s %8s %7s | %s\n", ROWS, "states", "mj_inverse", "ours", "ratio",
         "knots of paths, the same");
  rows r = new_rows();
  for (int b = 0; b < BINS; b++) {
    printf("rows at the start %3d - %-3d %10s", b == 0 ? 0 : (b - 1) * WIDTH + 1, b * WIDTH, "");
    for (int paths = 0; paths < 2 && count[b] > 0; paths++) {
      double theirs_us, ours_us;
      fill_rows(bin[b], count[b], paths, &r);
      int same = time_rows(&r, &theirs_us, &ours_us);
      printf("%s %7.2f us %5.2f us %7.3f%s", paths ? " |" : "", theirs_us, ours_us, ours_us / theirs_us,
             same ? "" : ", u differs");
    }
    printf("\n");
  }
  free_rows(&r);
}

// stages of one call, over all samples
static void stages(sample bin[BINS][PER_BIN], const int *count) {
  static const char *const names[] = {"kinematics", "limits", "collide", "soften", "velocity stages"};
  printf("stages of ours, mean us:");
  for (int k = 0; k < 5; k++) {
    double best = INFINITY;
    for (int r = 0; r < RUNS; r++) {
      double sum = 0;
      int n = 0;
      for (int b = 0; b < BINS; b++) {
        for (int i = 0; i < count[b]; i++, n++) {
          const sample *s = &bin[b][i];
          cav_inverse(model, state, s->q, s->v, s->v_next, u);
          double t = bench_seconds();
          for (int c = 0; c < CALLS; c++) {
            switch (k) {
              case 0:
                cav_kinematics(model, state, s->q);
                break;
              case 1:
                cav_limits_find(model, state);
                break;
              case 2:
                cav_contacts_find(model, state);
                break;
              case 3:
                cav_contacts_soften(state);
                break;
              default:
                cav_inverse_from(model, state, CAV_STAGE_POSITION, s->q, s->v, s->v_next, u);
            }
          }
          sum += bench_seconds() - t;
        }
      }
      best = fmin(best, sum * 1e6 / CALLS / n);
    }
    printf("  %s %.2f", names[k], best);
  }
  printf("\n");
}

// MuJoCo's staged one-sided differences of u: one full inverse a column of q, skips for the columns of v and a
static void their_jacobian(const sample *s, double *dq, double *dv, double *da, double *base) {
  const double step = 1e-6;
  int nv = m->nv;
  double *q = scene_vector(m->nq), *move = scene_vector(nv);
  mju_copy(d->qpos, s->q, m->nq);
  mju_copy(d->qvel, s->v, nv);
  mju_copy(d->qacc, s->a, nv);
  mj_inverse(m, d);
  mju_copy(base, d->qfrc_inverse, nv);
  for (int which = 0; which < 3; which++) {
    double *out = which == 0 ? da : which == 1 ? dv : dq;
    for (int j = 0; j < nv; j++) {
      if (which == 0) {
        d->qacc[j] += step;
        mj_inverseSkip(m, d, mjSTAGE_VEL, 1);
        d->qacc[j] = s->a[j];
      } else if (which == 1) {
        d->qvel[j] += step;
        mj_inverseSkip(m, d, mjSTAGE_POS, 1);
        d->qvel[j] = s->v[j];
      } else {
        mju_copy(q, s->q, m->nq);
        move[j] = 1;
        mj_integratePos(m, q, move, step);
        move[j] = 0;
        mju_copy(d->qpos, q, m->nq);
        mj_inverse(m, d);
      }
      for (int i = 0; i < nv; i++) out[i * nv + j] = (d->qfrc_inverse[i] - base[i]) / step;
    }
  }
  free(q), free(move);
}

// Jacobians with respect to q, v and v_next (a) by differences, ours and theirs
static void jacobians(sample bin[BINS][PER_BIN], const int *count) {
  int nv = m->nv;
  double *x[3], *base = scene_vector(nv);
  for (int k = 0; k < 3; k++) x[k] = scene_vector(nv * nv);
  printf("Jacobians by one-sided differences, median:");
  for (int b = 0; b < BINS; b += 3) {
    int n = count[b];
    for (int i = 0; i < n; i++) {
      sample *s = &bin[b][i];
      s->ours = s->theirs = INFINITY;
      for (int r = 0; r < 3; r++) {
        double t = bench_seconds();
        their_jacobian(s, x[0], x[1], x[2], base);
        s->theirs = fmin(s->theirs, (bench_seconds() - t) * 1e6);
        t = bench_seconds();
        cav_inverse_jacobian(model, state, s->q, s->v, s->v_next, x[0], x[1], x[2]);
        s->ours = fmin(s->ours, (bench_seconds() - t) * 1e6);
      }
    }
    if (n == 0) continue;
    printf("  %d rows: MuJoCo %.0f us, ours %.0f us, ratio %.3f;", b * WIDTH, quantile(bin[b], n, 0.5, theirs),
           quantile(bin[b], n, 0.5, ours), quantile(bin[b], n, 0.5, ratio));
  }
  printf("\n");
  for (int k = 0; k < 3; k++) free(x[k]);
  free(base);
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
  u = scene_vector(model->nv);
  return d && state;
}

int main(int argc, char **argv) {
  static sample bin[BINS][PER_BIN];
  int count[BINS] = {0};
  char path[4200];
  const char *folder = check_shared_models();
  if (argc < 2 && !folder) {
    printf("skipped: name a model or set CAVORT_SHARED_MODELS\n");
    return CHECK_SKIPPED;
  }
  snprintf(path, sizeof path, "%s%s", argc > 1 ? argv[1] : folder, argc > 1 ? "" : "/mujoco/humanoid.xml");
  if (!load(path)) return EXIT_FAILURE;

  // states by number of rows
  int refused = 0;
  double *v_next = scene_vector(m->nv), *expected = scene_vector(m->nv);
  for (int k = 0; k < DRAWS; k++) {
    bench_draw(m, d);
    mj_inverse(m, d);
    int b = (d->nefc + WIDTH - 1) / WIDTH;
    if (b >= BINS || count[b] == PER_BIN) continue;
    if (alike(v_next, expected)) {
      bin[b][count[b]++] = keep();
    } else {
      refused++;
    }
  }
  free(v_next), free(expected);
  for (int r = 0; r < RUNS; r++) {
    for (int b = 0; b < BINS; b++) {
      for (int i = 0; i < count[b]; i++) run(&bin[b][i]);
    }
  }
  printf("%s: nv %d, %d pairs, h %g s, %d states left out because u differs\n", path, model->nv, model->npair,
         model->timestep, refused);
  report(bin, count);
  batches(bin, count);
  stages(bin, count);
  jacobians(bin, count);
  for (int b = 0; b < BINS; b++) {
    for (int i = 0; i < count[b]; i++) free(bin[b][i].q), free(bin[b][i].v), free(bin[b][i].a), free(bin[b][i].v_next);
  }
  mj_deleteData(d);
  mj_deleteModel(m);
  cav_state_free(state);
  cav_model_free(model);
  free(u);
  return EXIT_SUCCESS;
}
#endif
