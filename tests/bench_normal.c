/// Time of the normal equations' factorisation and solution, as they are and by CHOLMOD on the same entries: a motion
/// in a band, a cycle of 60 knots, and scenes with free bodies that touch nothing. Times are of the processor, shortest
/// of several. Usage: bench_normal [PROBLEM]...
#include "bench.h"
#include "continuation.h"
#include "sparse.h"
#include "transcription.h"

enum { RUNS = 7 };
static const double SHIFT = 1e-6;

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double relative(const double *a, const double *b, int n) {
  double most = 0, apart = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(b[i])), apart = fmax(apart, fabs(a[i] - b[i]));
  return apart / most;
}

// the same by CHOLMOD: analysis, factor and solution, ms; largest difference of solutions
static void by_sparse(cav_normal *normal, const double *b, const double *expected, double time[2], double *apart) {
  const int n = normal->size, entries = cav_normal_entries(normal, NULL, NULL, NULL);
  int *row = malloc(2 * (size_t)entries * sizeof *row), *column = row + entries,
      *start = calloc((size_t)n + 1, sizeof *start);
  double *value = scene_vector(entries), *x = scene_vector(n);
  cav_normal_entries(normal, row, column, value);
  cav_normal_shift_entries(normal, 1, 0, SHIFT, value);
  for (int k = 0; k < entries; k++) start[column[k] + 1]++;
  for (int j = 0; j < n; j++) start[j + 1] += start[j];
  cav_sparse *sparse = cav_sparse_new(1);
  double begin = seconds();
  CHECK(cav_sparse_analyse(sparse, n, start, row) == CAV_OK);
  time[0] = 1e3 * (seconds() - begin);
  time[1] = INFINITY;
  for (int r = 0; r < RUNS; r++) {
    begin = seconds();
    CHECK(cav_sparse_factor(sparse, value) == CAV_OK);
    CHECK(cav_sparse_solve(sparse, b, x) == CAV_OK);
    time[1] = fmin(time[1], 1e3 * (seconds() - begin));
  }
  *apart = relative(x, expected, n);
  cav_sparse_free(sparse);
  free(row), free(start), free(value), free(x);
}

// times of gathering and of factor and solution, ms
static void factor(cav_normal *normal, const cav_transcription *tr, double *x, double time[2]) {
  time[0] = time[1] = INFINITY;
  for (int r = 0; r < RUNS && (r == 0 || time[1] < 300); r++) {
    double begin = seconds();
    cav_normal_gather(normal, tr);
    time[0] = fmin(time[0], 1e3 * (seconds() - begin));
    begin = seconds();
    CHECK(cav_normal_factor(normal, SHIFT) == CAV_OK);
    cav_normal_solve(normal, normal->gradient, x);
    time[1] = fmin(time[1], 1e3 * (seconds() - begin));
  }
}

// our humanoid with so many free balls that lie ten metres away, as a file
static int add_balls(int n, char *path) {
  static char text[1 << 18];
  FILE *file = fopen(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", "r");
  const size_t size = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[size] = 0;
  char *end = strstr(text, "</worldbody>");
  const int out = mkstemp(path);
  file = out >= 0 ? fdopen(out, "w") : NULL;
  if (!CHECK(end && file)) return 0;
  fprintf(file, "%.*s", (int)(end - text), text);
  for (int i = 0; i < n; i++)
    fprintf(file, "<body pos='%g %g .0999'><freejoint/><geom type='sphere' size='.1'/></body>", 10.0 + i % 15,
            i / 15 * 1.0);
  // postures of the file have no balls
  const char *keys = strstr(end, "<keyframe>"), *after = keys ? strstr(keys, "</keyframe>") : NULL;
  fprintf(file, "%.*s%s", (int)((after ? keys : end) - end), end, after ? after + strlen("</keyframe>") : end);
  return fclose(file) == 0;
}

// with so many balls, or none for the model of the problem
static void measure(const char *path, int knots, int balls) {
  char model[] = "/tmp/cavort-balls-XXXXXX";
  if (balls && !add_balls(balls, model)) return;
  cav_error error = {0};
  cav_problem *p = cav_problem_load(path, balls ? model : NULL, &error);
  if (balls) unlink(model);
  if (!CHECK(p != NULL)) {
    fprintf(stderr, "%s\n", error.text);
    return;
  }
  p->duration = (knots - 1) * p->timestep;
  cav_transcription *tr = cav_transcription_new(p, 1, &error);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = tr ? cav_trajectory_new(p->model, tr->nknot, p->timestep) : NULL;
  if (!CHECK(normal && at)) {
    fprintf(stderr, "%s\n", error.text);
    return;
  }
  cav_guess_fill(p, p->q_goal, at);
  cav_stage_set(p, 0.5, tr);
  double best = INFINITY;
  for (int r = 0; r < (balls > 100 ? 2 : RUNS); r++) {
    const double begin = seconds();
    CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
    best = fmin(best, 1e3 * (seconds() - begin));
  }
  printf("%-12s %4d dofs %3d knots %6d unknowns: rows, derivatives and blocks %.2f ms\n", p->name, tr->nv, tr->nknot,
         normal->size, best);
  double *x = scene_vector(normal->size), *whole = scene_vector(normal->size), sparse[2] = {0}, apart = 0, own[2];
  const int trees = normal->ntree, second = normal->tree[1];
  for (int apart_too = 0; apart_too < (trees > 1 ? 2 : 1); apart_too++) {
    normal->ntree = apart_too ? trees : 1;
    normal->tree[1] = apart_too ? second : normal->n;
    factor(normal, tr, x, own);
    if (!apart_too) memcpy(whole, x, (size_t)normal->size * sizeof *x);
    int most = 0, groups = cav_normal_groups(normal, &most);
    printf(
        "    %3d group%s of at most %4d dofs: gather %9.2f ms, factor and solve %9.2f ms, apart from one group %.0e\n",
        groups, groups > 1 ? "s" : " ", most, own[0], own[1], relative(x, whole, normal->size));
  }
  if (normal->size < 5000) {
    by_sparse(normal, normal->gradient, whole, sparse, &apart);
    printf("    CHOLMOD, analysis %.2f ms: %22s factor and solve %9.2f ms, apart from one group %.0e\n", sparse[0], "",
           sparse[1], apart);
  }
  fflush(stdout);
  cav_trajectory_free(at), cav_normal_free(normal), cav_transcription_free(tr), cav_problem_free(p);
  free(x), free(whole);
}

int main(int argc, char **argv) {
  if (!cav_sparse_available()) return printf("skipped: built without CHOLMOD\n"), CHECK_SKIPPED;
  for (int i = 1; i < argc; i++) measure(argv[i], 60, 0);
  if (argc > 1) return check_result();
  const char *jump = CAVORT_SOURCE_ROOT "/problems/motions/squat-jump/problem.xml";
  measure(jump, 60, 0);
  measure(CAVORT_SOURCE_ROOT "/problems/motions/walk-cycle/problem.xml", 60, 0);
  measure(jump, 60, 5);
  measure(jump, 60, 20);
  measure(jump, 4, 200);
  return check_result();
}
