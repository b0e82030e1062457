/// Time of one forward step of heaps of free bodies against its error, beside MuJoCo's Newton solver on the same states
/// of the same model: elliptic cones, no warm start on either side, constraints of the file, MuJoCo's Jacobian dense
/// and sparse. Times are of the processor. Error is that of v_next against the same library's own answer run to the
/// end, relative to the largest entry: the two libraries find contacts of their own, so answers differ a little. For
/// each number of iterations a time and an error; shown is the least time that reaches an error. A heap is dropped into
/// a tray and followed by MuJoCo to the middle of its fall and to its rest. Beside it scenes that come apart: the same
/// bodies spread over the floor in piles, and lying alone. Usage: bench_heap [BODIES...]; default 30 100 300. With files of
/// models instead: states of each as it falls to the floor and is shaken there, medians over them; and the error that ours has
/// when MuJoCo's better Jacobian has reached one. With joints' springs and dampers, which ours takes at the end of the step as
/// part of it and MuJoCo after its solver, and without, where both libraries solve the same.
#include "bench.h"
#include "hessian.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else

enum { LEVELS = 3, LIMIT = 60, RUNS = 7, STATES = 40, APART = 25 };
static const double level[LEVELS] = {1e-3, 1e-6, 1e-9};

/// A scene, by both libraries.
typedef struct heap {
  mjModel *m;
  mjData *d;
  cav_model *model;
  cav_state *state;
  double *q, *v, *u, *found, *truth;
} heap;

/// Times, s, by error and by iterations asked for, and errors by these; iterations and error of the last answer.
typedef struct curve {
  double time[LEVELS], error, time_of[LIMIT], error_of[LIMIT];
  int iterations, contacts, tried;
} curve;

/// What is measured: MuJoCo by the kind of its Jacobian, ours with the contacts of the step before or with others.
typedef enum method { DENSE, SPARSE, SAME, OTHER } method;

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double largest(const double *x, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(x[i]));
  return most;
}

static double apart(const double *a, const double *b, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i] - b[i]));
  return most / fmax(largest(b, n), 1e-6);
}

static int is_spread(const char *layout) { return strcmp(layout, "heap") && strcmp(layout, "fall"); }

static int side_of(int n) { return (int)ceil(cbrt(n)); }

// where body i of n stands before it falls: a heap over a tray as wide as high, piles of five, or alone
static void place(const char *layout, int i, int n, double at[3]) {
  const int side = side_of(n);
  if (!is_spread(layout)) {
    const double middle = 0.5 * (side - 1);
    at[0] = 0.26 * (i % side - middle), at[1] = 0.26 * (i / side % side - middle);
    at[2] = 0.3 + 0.27 * (i / (side * side));
  } else {
    const int high = strcmp(layout, "alone") ? 5 : 1, pile = i / high;
    at[0] = 1.5 * (pile % 16), at[1] = 1.5 * (pile / 16), at[2] = 0.11 + 0.21 * (i % high);
  }
}

static char *text_of(const char *shape, const char *layout, int n) {
  char *text = malloc(2000 + 300 * (size_t)n), *to = text;
  const int spread = is_spread(layout);
  to +=
      sprintf(to,
              "<mujoco><size nconmax='%d' njmax='%d' nstack='%d'/><option timestep='0.002' cone='elliptic'/><worldbody>"
              "<geom type='plane' size='50 50 1'/>",
              8 * n + 100, 24 * n + 300, 40000000);
  const double half = 0.13 * side_of(n) + 0.15;
  for (int k = 0; k < 4 && !spread; k++)
    to += sprintf(to, "<geom type='box' size='%g %g 2' pos='%g %g 2'/>", k < 2 ? 0.1 : half, k < 2 ? half : 0.1,
                  k < 2 ? half * (2 * k - 1) : 0.0, k < 2 ? 0.0 : half * (2 * k - 5));
  for (int i = 0; i < n; i++) {
    double at[3];
    place(layout, i, n, at);
    const double tilt = spread ? 0 : 40 * scene_uniform();
    to += sprintf(to, "<body pos='%g %g %g' euler='%g %g %g'><freejoint/><geom %s density='500'/></body>",
                  at[0] + (spread ? 0 : 0.02 * scene_uniform()), at[1], at[2], tilt, tilt, 3 * tilt,
                  !strcmp(shape, "box") ? "type='box' size='.1 .1 .1'" : "type='capsule' size='.06 .07'");
  }
  sprintf(to, "</worldbody></mujoco>");
  return text;
}

static int load(heap *h, const char *shape, const char *layout, int n) {
  char path[] = "/tmp/cavort-heap-XXXXXX", why[1000] = "";
  cav_error error = {0};
  char *text = text_of(shape, layout, n);
  const int file = mkstemp(path);
  if (file < 0 || write(file, text, strlen(text)) != (ssize_t)strlen(text)) return 0;
  close(file);
  free(text);
  *h = (heap){.m = mj_loadXML(path, NULL, why, sizeof why), .model = cav_model_load(path, &error)};
  unlink(path);
  if (!h->m || !h->model) {
    fprintf(stderr, "%s%s\n", why, error.text);
    return 0;
  }
  h->d = mj_makeData(h->m);
  h->state = cav_state_new(h->model);
  double **const all[] = {&h->v, &h->u, &h->found, &h->truth};
  for (int k = 0; k < 4; k++) *all[k] = scene_vector(h->model->nv);
  h->q = scene_vector(h->model->nq);
  memset(h->u, 0, (size_t)h->model->nv * sizeof *h->u);
  return h->state && h->d;
}

static void unload(heap *h) {
  mj_deleteData(h->d), mj_deleteModel(h->m);
  cav_state_free(h->state), cav_model_free(h->model);
  free(h->q), free(h->v), free(h->u), free(h->found), free(h->truth);
}

// the heap in the middle of its fall, or as it lies after it
static void settle(heap *h, int steps) {
  const mjOption kept = h->m->opt;
  h->m->opt.solver = mjSOL_CG;
  h->m->opt.jacobian = mjJAC_SPARSE;
  h->m->opt.iterations = 10;
  h->m->opt.timestep = 0.004;
  for (int t = 0; t < steps; t++) mj_step(h->m, h->d);
  h->m->opt = kept;
  mju_copy(h->q, h->d->qpos, h->m->nq);
  mju_copy(h->v, h->d->qvel, h->m->nv);
}

// one step of MuJoCo from scratch; v_next
static void theirs(const heap *h, int iterations, double *v_next) {
  mjModel *m = h->m;
  m->opt.iterations = iterations;
  mju_copy(h->d->qpos, h->q, m->nq);
  mju_copy(h->d->qvel, h->v, m->nv);
  mju_copy(h->d->qfrc_applied, h->u, m->nv);
  mj_forward(m, h->d);
  for (int i = 0; i < m->nv; i++) v_next[i] = h->v[i] + m->opt.timestep * h->d->qacc[i];
}

// one step of ours; method OTHER lifts the first body before, so that the pattern is a new one
static int ours(const heap *h, method by, int iterations, double *v_next, double *time) {
  cav_forward_report report = {0};
  if (by == OTHER) {
    h->q[2] += 10;
    cav_forward(h->model, h->state, h->q, h->v, h->u, v_next);
    h->q[2] -= 10;
  }
  const double start = seconds();
  cav_forward_newton(h->model, h->state, h->q, h->v, h->u, iterations, 1e-13, v_next, &report);
  *time = seconds() - start;
  return report.iterations;
}

static curve measure(const heap *h, method by) {
  curve c = {.error = INFINITY};
  for (int k = 0; k < LEVELS; k++) c.time[k] = INFINITY;
  h->m->opt.solver = mjSOL_NEWTON;
  h->m->opt.tolerance = 0;
  h->m->opt.disableflags |= mjDSBL_WARMSTART;
  h->m->opt.jacobian = by == DENSE ? mjJAC_DENSE : mjJAC_SPARSE;
  double time = 0;
  if (by >= SAME)
    ours(h, by, 200, h->truth, &time);
  else
    theirs(h, 200, h->truth);
  for (int k = 1; k <= LIMIT && c.error > level[LEVELS - 1]; k++) {
    double best = INFINITY;
    int done = k;
    for (int run = 0; run < RUNS && (run < 1 || best < 0.3); run++) {
      const double start = seconds();
      if (by >= SAME) {
        done = ours(h, by, k, h->found, &time);
      } else {
        theirs(h, k, h->found);
        time = seconds() - start;
      }
      best = fmin(best, time);
    }
    c.error = apart(h->found, h->truth, h->m->nv);
    c.time_of[k - 1] = best, c.error_of[k - 1] = c.error, c.tried = k;
    for (int l = 0; l < LEVELS; l++)
      if (c.error <= level[l]) c.time[l] = fmin(c.time[l], best);
    c.iterations = done;
  }
  c.contacts = by >= SAME ? h->state->ncontact : h->d->ncon;
  return c;
}

static void show(const char *name, const curve *c, const curve *best) {
  printf("    %-22s %5d contacts, %2d iterations to %7.1e: ", name, c->contacts, c->iterations, c->error);
  for (int l = 0; l < LEVELS; l++) {
    printf(" %9.2f ms", 1e3 * c->time[l]);
    if (best) printf(" (%.2f)", c->time[l] / best->time[l]);
  }
  printf("\n");
}

static void compare(const char *shape, const char *layout, int n) {
  heap h;
  if (!CHECK(load(&h, shape, layout, n))) return;
  settle(&h, strcmp(layout, "fall") ? 300 : 90);
  const curve dense = n <= 100 ? measure(&h, DENSE) : (curve){.time = {INFINITY, INFINITY, INFINITY}};
  const curve sparse = measure(&h, SPARSE), same = measure(&h, SAME), other = measure(&h, OTHER);
  curve best = dense;
  for (int l = 0; l < LEVELS; l++) best.time[l] = fmin(dense.time[l], sparse.time[l]);
  printf("%d %s, %s; islands given to CHOLMOD: %d\n", n, strcmp(shape, "box") ? "capsules" : "boxes", layout,
         cav_hessian_sparse_islands(h.state->work->hessian));
  if (dense.contacts) show("MuJoCo, dense", &dense, NULL);
  show("MuJoCo, sparse", &sparse, NULL);
  show("cavort", &same, &best);
  show("cavort, new contacts", &other, &best);
  fflush(stdout);
  unload(&h);
}

// both libraries' models of a file; without: no springs and dampers of joints
static int load_file(heap *h, const char *path, int without) {
  char why[1000] = "";
  cav_error error = {0};
  *h = (heap){.m = mj_loadXML(path, NULL, why, sizeof why), .model = cav_model_load(path, &error)};
  if (!h->m || !h->model) {
    fprintf(stderr, "%s: %s%s\n", path, why, error.text);
    return 0;
  }
  if (without) h->m->opt.disableflags |= mjDSBL_PASSIVE;
  h->m->opt.cone = mjCONE_ELLIPTIC;
  h->m->opt.disableflags |= mjDSBL_ACTUATION;
  h->d = mj_makeData(h->m);
  h->state = cav_state_new(h->model);
  double **const all[] = {&h->v, &h->u, &h->found, &h->truth};
  for (int k = 0; k < 4; k++) *all[k] = scene_vector(h->model->nv);
  h->q = scene_vector(h->model->nq);
  if (h->state) h->state->options.passive = !without;
  return h->state && h->d;
}

// on to the next state in which something touches, by moments that change now and then
static void shake(heap *h) {
  const int nv = h->m->nv;
  for (int i = 6; i < nv; i++) h->u[i] = 5 * scene_normal();
  for (int i = 0; i < 6; i++) h->u[i] = 0;
  h->m->opt.solver = mjSOL_NEWTON;
  h->m->opt.tolerance = 1e-10, h->m->opt.iterations = 100;
  for (int t = 0; t < APART || (h->d->ncon == 0 && t < 100 * APART); t++) {
    mju_copy(h->d->qfrc_applied, h->u, nv);
    mj_step(h->m, h->d);
  }
  mju_copy(h->q, h->d->qpos, h->m->nq);
  mju_copy(h->v, h->d->qvel, nv);
}

static double median(double *x, int n) {
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[n / 2];
}

// least error that is reached within a time; 1: none
static double error_within(const curve *c, double time) {
  double least = 1;
  for (int k = 0; k < c->tried; k++)
    if (c->time_of[k] <= time) least = fmin(least, c->error_of[k]);
  return least;
}

// medians over states of a model's fall
static void follow(const char *path, int without) {
  heap h;
  if (!CHECK(load_file(&h, path, without))) return;
  double time[2][LEVELS][STATES], ratio[LEVELS][STATES], error[LEVELS][STATES], differ[STATES], contacts[2] = {0};
  double *answer = scene_vector(h.m->nv);
  for (int i = 0; i < STATES; i++) {
    shake(&h);
    // the state stays; theirs moves MuJoCo's data
    mjData *kept = mj_copyData(NULL, h.m, h.d);
    const curve dense = measure(&h, DENSE), sparse = measure(&h, SPARSE);
    mju_copy(answer, h.truth, h.m->nv);
    const curve own = measure(&h, SAME);
    differ[i] = apart(h.truth, answer, h.m->nv);
    contacts[0] += (double)dense.contacts / STATES, contacts[1] += (double)own.contacts / STATES;
    for (int l = 0; l < LEVELS; l++) {
      time[0][l][i] = fmin(dense.time[l], sparse.time[l]), time[1][l][i] = own.time[l];
      ratio[l][i] = own.time[l] / time[0][l][i];
      error[l][i] = error_within(&own, time[0][l][i]);
    }
    mj_deleteData(h.d);
    h.d = kept;
  }
  printf("%s, %s, nv %d, %d states, %.1f contacts of MuJoCo's, %.1f of cavort's; answers apart by %.0e (median)\n",
         path, without ? "no springs and dampers" : "with those of the file", h.m->nv, STATES, contacts[0], contacts[1],
         median(differ, STATES));
  for (int l = 0; l < LEVELS; l++) {
    printf("    to %.0e: MuJoCo %6.1f us, cavort %6.1f us, ratio %.2f; error of cavort in MuJoCo's time %.0e\n",
           level[l], 1e6 * median(time[0][l], STATES), 1e6 * median(time[1][l], STATES), median(ratio[l], STATES),
           median(error[l], STATES));
  }
  fflush(stdout);
  free(answer);
  unload(&h);
}

int main(int argc, char **argv) {
  static const int usual[] = {30, 100, 300};
  printf("least time of a step whose v_next errs by %.0e, %.0e, %.0e at most (over the better of MuJoCo's)\n", level[0],
         level[1], level[2]);
  for (int i = 0; i < (argc > 1 ? argc - 1 : 3); i++) {
    const int n = argc > 1 ? atoi(argv[i + 1]) : usual[i];
    if (n == 0) {
      follow(argv[i + 1], 0);
      follow(argv[i + 1], 1);
      continue;
    }
    compare("box", "heap", n);
    compare("capsule", "heap", n);
    if (n == 100) compare("box", "fall", n);
    if (n == 100) compare("box", "piles", n);
    if (n == 100) compare("box", "alone", n);
  }
  return check_result();
}
#endif
