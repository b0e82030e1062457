/// The paper's figure 3: time of one step of the inverse and of the forward dynamics with 5 and with 50 sweeps of
/// Gauss-Seidel, and their ratios, against the number of constraint rows, on the 27-dof humanoid dragged about by its
/// trunk: a spring to a place that jumps takes the part of the mouse. As there, contacts have all friction directions,
/// so that their Jacobian grows large: condim 6. Beside them Newton's method to convergence, whose answer is exact.
/// Times are the shortest of several runs of one state, the four by turns; shown are medians over the states of a bin.
/// Usage: bench_forward [FILE]; FILE gets the table in columns. tests/figures.sh draws it.
#include "bench.h"

enum { WIDTH = 6, BINS = 20, PER_BIN = 40, STEPS = 300000, RUNS = 7, METHODS = 4 };
static const char model_path[] = CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml";
static const char *const names[METHODS] = {"inverse", "forward(5)", "forward(50)", "newton"};

/// One state on the way and its times, us.
typedef struct sample {
  double *q, *v, *u, *v_next, time[METHODS];
  int rows;
} sample;

static cav_model *model;
static cav_state *state;
static double *found;

// the humanoid with six rows for every contact
static cav_model *load(void) {
  static char text[1 << 18];
  FILE *file = fopen(model_path, "r");
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[n] = 0;
  for (char *at = text; (at = strstr(at, "condim=\"")); at += 8) at[8] = '6';
  return scene_load(text);
}

static int rows_of(const cav_state *s) {
  int n = s->nrow;
  for (int i = 0; i < s->ncontact; i++) n += s->contact[i].dim;
  return n;
}

static double *kept(const double *x, int n) {
  double *copy = scene_vector(n);
  memcpy(copy, x, (size_t)n * sizeof *copy);
  return copy;
}

// springs from the trunk to a place that jumps now and then, often below the floor, and weak random moments in the
// joints
static void drag(const double *q, const double *v, double target[3], int step, double *u) {
  if (step % 80 == 0) {
    target[0] = q[0] + scene_uniform();
    target[1] = q[1] + scene_uniform();
    target[2] = scene_uniform() - 0.7;
    double effort = 8 * scene_uniform();
    for (int i = 6; i < model->nv; i++) u[i] = fmax(effort, 0) * scene_normal();
  }
  for (int k = 0; k < 3; k++) u[k] = 2000 * (target[k] - q[k]) - 200 * v[k] + (k == 2 ? 9.81 * model->mass : 0);
  for (int k = 3; k < 6; k++) u[k] = -2 * v[k];
}

// one call of one method
static cav_status call(int method, const sample *s) {
  switch (method) {
    case 0:
      return cav_inverse(model, state, s->q, s->v, s->v_next, found);
    case 1:
      return cav_forward_gpgs(model, state, s->q, s->v, s->u, 5, 0, found, NULL);
    case 2:
      return cav_forward_gpgs(model, state, s->q, s->v, s->u, 50, 0, found, NULL);
    default:
      return cav_forward(model, state, s->q, s->v, s->u, found);
  }
}

static void measure(sample *s) {
  for (int k = 0; k < METHODS; k++) s->time[k] = INFINITY;
  for (int r = 0; r < RUNS; r++) {
    for (int k = 0; k < METHODS; k++) {
      int calls = k == 0 ? 10 : 1;
      call(k, s);
      double t = bench_seconds();
      for (int c = 0; c < calls; c++) call(k, s);
      s->time[k] = fmin(s->time[k], 1e6 * (bench_seconds() - t) / calls);
    }
  }
}

static double median(const sample *s, int n, int method, int ratio) {
  double x[PER_BIN];
  for (int i = 0; i < n; i++) x[i] = ratio ? s[i].time[method] / s[i].time[0] : s[i].time[method];
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[n / 2];
}

/// What a solver needs to make forward and inverse agree: largest over states, and median time, us.
typedef struct agreement {
  double residual, mismatch, iterations, time[PER_BIN];
} agreement;

static void agree(agreement *a, int at, const sample *s, int newton) {
  cav_forward_report report = {0};
  double t = bench_seconds();
  cav_status status = newton ? cav_forward_newton(model, state, s->q, s->v, s->u, 200, 1e-12, found, &report)
                             : cav_forward_gpgs(model, state, s->q, s->v, s->u, 100000, 1e-12, found, &report);
  a->time[at] = 1e6 * (bench_seconds() - t);
  if (status != CAV_OK && status != CAV_NOT_CONVERGED) return;
  a->iterations = fmax(a->iterations, report.iterations);
  a->mismatch = fmax(a->mismatch, report.mismatch);

  // the inverse at what came out against what went in, relative
  double *u = scene_vector(model->nv), worst = 0, most = 0;
  cav_inverse(model, state, s->q, s->v, found, u);
  for (int i = 0; i < model->nv; i++) {
    worst = fmax(worst, fabs(u[i] - s->u[i]));
    most = fmax(most, fabs(s->u[i]));
  }
  a->residual = fmax(a->residual, worst / most);
  free(u);
}

// both solvers run to the end where there are about 60 rows; Gauss-Seidel starts from
// what it remembers of the state before
static void agreements(const sample *s, int n, int rows) {
  static const char *const solver[] = {"Gauss-Seidel", "Newton"};
  for (int newton = 0; newton < 2; newton++) {
    agreement a = {0};
    for (int i = 0; i < n; i++) agree(&a, i, &s[i], newton);
    qsort(a.time, (size_t)n, sizeof *a.time, bench_ascending);
    printf("%3d - %-5d %-12s inverse(forward) within %.1e of the largest u, %.0f iterations at most, %.0f us", rows,
           rows + WIDTH - 1, solver[newton], a.residual, a.iterations, a.time[n / 2]);
    if (newton)
      printf("\n");
    else
      printf(", impulses within %.1e N s\n", a.mismatch);
  }
}

int main(int argc, char **argv) {
  static sample bin[BINS][PER_BIN];
  int count[BINS] = {0}, failed = 0;
  model = load();
  FILE *out = argc > 1 ? fopen(argv[1], "w") : NULL;
  if (!model || (argc > 1 && !out)) {
    printf("cannot load %s or write\n", model_path);
    return EXIT_FAILURE;
  }
  state = cav_state_new(model);
  double *q = kept(model->q0, model->nq), *v = scene_vector(model->nv), *u = scene_vector(model->nv),
         target[3] = {0, 0, 0};
  double *next = scene_vector(model->nv);
  found = scene_vector(model->nv);
  for (int t = 0; t < STEPS; t++) {
    drag(q, v, target, t, u);
    cav_status status = cav_forward(model, state, q, v, u, next);
    failed += status != CAV_OK;
    if (status != CAV_OK && status != CAV_NOT_CONVERGED) return EXIT_FAILURE;
    int rows = rows_of(state), b = rows / WIDTH;
    if (b < BINS && count[b] < PER_BIN && (t % 10 == 0 || rows > 95))
      bin[b][count[b]++] = (sample){.q = kept(q, model->nq),
                                    .v = kept(v, model->nv),
                                    .u = kept(u, model->nv),
                                    .v_next = kept(next, model->nv),
                                    .rows = rows};
    memcpy(v, next, (size_t)model->nv * sizeof *v);
    cav_integrate(model, q, v, model->timestep, q);
  }
  printf("humanoid, nv %d, dragged for %d steps of %g ms, Newton short of its tolerance in %d; medians in us\n",
         model->nv, STEPS, 1e3 * model->timestep, failed);
  printf("%-11s %6s %8s %11s %11s %8s %14s %15s\n", "rows", "states", names[0], names[1], names[2], names[3],
         "forward(5)/inv", "forward(50)/inv");
  for (int b = 0; b < BINS; b++) {
    if (count[b] < 5) continue;
    double mean = 0;
    for (int i = 0; i < count[b]; i++) {
      measure(&bin[b][i]);
      mean += (double)bin[b][i].rows / count[b];
    }
    double time[METHODS], ratio[METHODS];
    for (int k = 0; k < METHODS; k++) {
      time[k] = median(bin[b], count[b], k, 0);
      ratio[k] = median(bin[b], count[b], k, 1);
    }
    printf("%3d - %-5d %6d %8.2f %11.1f %11.1f %8.1f %14.1f %15.1f\n", b * WIDTH, b * WIDTH + WIDTH - 1, count[b],
           time[0], time[1], time[2], time[3], ratio[1], ratio[2]);
    if (out)
      fprintf(out, "%.2f %d %.3f %.3f %.3f %.3f %.3f %.3f\n", mean, count[b], time[0], time[1], time[2], time[3],
              ratio[1], ratio[2]);
  }
  printf("to convergence, largest over the states and median time\n");
  for (int b = 60 / WIDTH; b <= 60 / WIDTH + 1; b++) {
    if (count[b]) agreements(bin[b], count[b], b * WIDTH);
  }
  if (out) fclose(out);
  return EXIT_SUCCESS;
}
