/// Factor and solution of the normal equations, as they are and by CHOLMOD on the same entries without those that are zero
/// by structure: a motion in a band, a cycle of 60 knots, scenes with free bodies, and the same with a free duration, whose
/// unknown meets all; the ways by turns. Time of the processor, median and quartiles; residual of the shifted equations;
/// bits, which are checked to be the same in every turn and, but for CHOLMOD, by the vectors of other processors
#include "bench.h"
#include "continuation.h"
#include "crowd.h"
#include "lanes.h"
#include "sparse.h"
#include "transcription.h"

enum { TURNS = 15, WAYS = 3 };
static const double SHIFT = 1e-6;
static const char *const way_name[WAYS] = {"one band", "groups", "CHOLMOD"};

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double quantile(double *x, int n, double fraction) {
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[(int)(fraction * (n - 1) + 0.5)];
}

static uint64_t bits_of(const double *x, int n) {
  uint64_t sum = 14695981039346656037u, bits;
  for (int i = 0; i < n; i++) {
    memcpy(&bits, x + i, sizeof bits);
    sum = (sum ^ bits) * 1099511628211u;
  }
  return sum;
}

// entries of the shifted matrix that trees of one group have, or the free step with any
typedef struct entries {
  int n, *row, *column, *start;
  double *value;
} entries;

static entries list_entries(const cav_normal *normal) {
  const int all = cav_normal_entries(normal, NULL, NULL, NULL), size = normal->size, last = size - 1;
  entries e = {.row = malloc((size_t)all * sizeof(int)),
               .column = malloc((size_t)all * sizeof(int)),
               .start = calloc((size_t)size + 1, sizeof(int)),
               .value = scene_vector(all)};
  cav_normal_entries(normal, e.row, e.column, e.value);
  cav_normal_shift_entries(normal, 1, 0, SHIFT, e.value);
  for (int k = 0; k < all; k++) {
    int i = e.row[k], j = e.column[k], step = normal->free_step && i == last;
    if (!step && normal->owner[i % normal->n] != normal->owner[j % normal->n]) continue;
    e.row[e.n] = i, e.column[e.n] = j, e.value[e.n++] = e.value[k];
  }
  for (int k = 0; k < e.n; k++) e.start[e.column[k] + 1]++;
  for (int j = 0; j < size; j++) e.start[j + 1] += e.start[j];
  return e;
}

static double residual(const entries *e, const double *x, const double *b, int n) {
  double *r = scene_vector(n), off = 0, most = 0;
  for (int i = 0; i < n; i++) r[i] = -b[i], most = fmax(most, fabs(b[i]));
  for (int k = 0; k < e->n; k++) {
    r[e->row[k]] += e->value[k] * x[e->column[k]];
    if (e->row[k] != e->column[k]) r[e->column[k]] += e->value[k] * x[e->row[k]];
  }
  for (int i = 0; i < n; i++) off = fmax(off, fabs(r[i]));
  free(r);
  return off / most;
}

// one group of all trees, or as they are
static void set_groups(cav_normal *normal, const cav_transcription *tr, int apart) {
  const int trees = normal->ntree, first = normal->tree[1];
  if (!apart) normal->ntree = 1, normal->tree[1] = normal->n;
  cav_normal_gather(normal, tr);
  normal->ntree = trees, normal->tree[1] = first;
}

static void compare(cav_normal *normal, const cav_transcription *tr, int turns) {
  static double time[WAYS][TURNS];
  uint64_t bits[WAYS] = {0};
  double *x = scene_vector(normal->size), off[WAYS] = {0}, begin;
  set_groups(normal, tr, 1);
  int most = 0, groups = cav_normal_groups(normal, &most);
  entries e = list_entries(normal);
  cav_sparse *sparse = cav_sparse_new(1);
  begin = seconds();
  CHECK(cav_sparse_analyse(sparse, normal->size, e.start, e.row) == CAV_OK);
  const double analysis = 1e3 * (seconds() - begin);
  for (int turn = 0; turn < turns; turn++) {
    for (int way = 0; way < WAYS; way++) {
      if (way < 2) set_groups(normal, tr, way);
      begin = seconds();
      if (way < 2) {
        CHECK(cav_normal_factor(normal, SHIFT) == CAV_OK);
        cav_normal_solve(normal, normal->gradient, x);
      } else {
        CHECK(cav_sparse_factor(sparse, e.value) == CAV_OK && cav_sparse_solve(sparse, normal->gradient, x) == CAV_OK);
      }
      time[way][turn] = 1e3 * (seconds() - begin);
      uint64_t now = bits_of(x, normal->size);
      CHECK(turn == 0 || now == bits[way]);
      bits[way] = now;
      off[way] = residual(&e, x, normal->gradient, normal->size);
      CHECK(off[way] < 1e-6);
    }
  }
  printf("    %d groups of at most %d dofs, analysis by CHOLMOD %.2f ms, %d entries, %.0f in its factor\n", groups,
         most, analysis, e.n, cav_sparse_entries(sparse));
  for (int lanes = 4; lanes >= 2; lanes /= 2)
    for (int way = 0; way < 2; way++) {
      lanes_most = lanes;
      set_groups(normal, tr, way);
      CHECK(cav_normal_factor(normal, SHIFT) == CAV_OK);
      cav_normal_solve(normal, normal->gradient, x);
      CHECK(bits_of(x, normal->size) == bits[way]);
    }
  lanes_most = 8;
  for (int way = 0; way < WAYS; way++) {
    printf("    %-9s", way_name[way]);
    printf(" %9.3f ms (%.3f, %.3f), residual %.0e, bits %016llx\n", quantile(time[way], turns, 0.5),
           quantile(time[way], turns, 0.25), quantile(time[way], turns, 0.75), off[way], (unsigned long long)bits[way]);
  }
  cav_sparse_free(sparse);
  free(e.row), free(e.column), free(e.start), free(e.value), free(x);
}

// with so many balls, -1 for the model of the problem; free: its duration within a tenth
static void measure(const char *path, int knots, int balls, int free_duration) {
  cav_error error = {0};
  cav_problem *p = balls < 0 ? cav_problem_load(path, NULL, &error) : crowd_problem(path, balls, 0);
  if (!CHECK(p != NULL)) return;
  p->duration = (knots - 1) * p->timestep;
  if (free_duration) p->duration_least = 0.9 * p->duration, p->duration_most = 1.1 * p->duration;
  cav_transcription *tr = cav_transcription_new(p, 1, &error);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = tr ? cav_trajectory_new(p->model, tr->nknot, p->timestep) : NULL;
  if (!CHECK(normal && at)) {
    fprintf(stderr, "%s\n", error.text);
    return;
  }
  cav_guess_fill(p, p->q_goal, at);
  cav_stage_set(p, 0.5, tr);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  printf("%-12s %4d dofs %3d knots %6d unknowns%s\n", p->name, tr->nv, tr->nknot, normal->size,
         free_duration ? ", duration free" : "");
  compare(normal, tr, tr->nv > 500 ? 5 : TURNS);
  fflush(stdout);
  cav_trajectory_free(at), cav_normal_free(normal), cav_transcription_free(tr), cav_problem_free(p);
}

int main(void) {
  if (!cav_sparse_available()) return printf("skipped: built without CHOLMOD\n"), CHECK_SKIPPED;
  const char *jump = CAVORT_SOURCE_ROOT "/problems/motions/squat-jump/problem.xml",
             *cycle = CAVORT_SOURCE_ROOT "/problems/motions/walk-cycle/problem.xml";
  for (int k = 0; k < 2; k++) {
    measure(jump, 60, -1, k);
    measure(cycle, 60, -1, k);
    measure(jump, 60, 5, k);
    measure(jump, 60, 20, k);
  }
  measure(jump, 4, 200, 0), measure(jump, 4, 200, 1);
  return check_result();
}
