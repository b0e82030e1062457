/// Time of one Gauss-Newton iteration of our humanoid at 40 knots on one thread: whole iterations of the trust region
/// (linearisation, factor and trials), ten each in the schedule's first, middle and last stage, one after the other; and
/// of a stance from which every joint is moved a little, split into dynamics with derivatives, assembly and
/// factorisation, by method of derivatives. Times are the shortest of several runs, those of whole iterations the processor's.
/// Instructions are the processor's own count, where the system gives it. Usage: bench_iteration [PROBLEM [count|threads]];
/// default problems/motions/squat-jump; count: whole iterations alone, once, for a profiler; threads: one iteration of each
/// stage by one and by two threads in turns, the least of many by the clock on the wall; and what of it is neither
/// linearisation on the way to the factor nor values of the step tried, hence one thread's; before them a quadratic programme of
/// the last phase, the same way.
#include <linux/perf_event.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "bench.h"
#include "continuation.h"
#include "programme.h"
#include "transcription.h"

enum { KNOTS = 40, RUNS = 15, ITERATIONS = 10 };

static void shake(cav_trajectory *at, const cav_model *m, double size) {
  double *step = scene_vector(m->nv), *moved = scene_vector(m->nq);
  for (int t = 1; t < at->nknot; t++) {
    for (int d = 0; d < m->nv; d++) step[d] = size * scene_uniform();
    cav_integrate(m, at->q + (size_t)t * at->nq, step, 1, moved);
    memcpy(at->q + (size_t)t * at->nq, moved, (size_t)at->nq * sizeof *moved);
  }
  cav_trajectory_velocities(m, at);
  free(step), free(moved);
}

// one method under one law; milliseconds
static void measure(cav_transcription *tr, cav_normal *normal, cav_trajectory *at, const char *name) {
  double best[4] = {INFINITY, INFINITY, INFINITY, INFINITY};
  for (int r = 0; r < RUNS; r++) {
    tr->seconds_dynamics = tr->seconds_assembly = 0;
    double start = bench_seconds();
    CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
    double gather = bench_seconds();
    cav_normal_gather(normal, tr);
    double factor = bench_seconds();
    CHECK(cav_normal_factor(normal, 1e-6) == CAV_OK);
    double end = bench_seconds();
    double part[4] = {tr->seconds_dynamics, tr->seconds_assembly + factor - gather, end - factor, end - start};
    for (int k = 0; k < 4; k++) best[k] = fmin(best[k], 1e3 * part[k]);
  }
  printf("  %-10s dynamics %6.2f ms, assembly %5.2f ms, factorisation %5.2f ms, all %6.2f ms\n", name, best[0], best[1],
         best[2], best[3]);
}

// of this thread alone: whole iterations are too long to be left in peace on a machine with other work
static double processor_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// instructions of this process from now on: a counter that is read, or -1
static int counter(void) {
  struct perf_event_attr what = {.type = PERF_TYPE_HARDWARE, .size = sizeof what};
  what.config = PERF_COUNT_HW_INSTRUCTIONS;
  what.exclude_kernel = what.exclude_hv = 1;
  return (int)syscall(SYS_perf_event_open, &what, 0, -1, -1, 0);
}

static double instructions(int events) {
  long long n = 0;
  return events >= 0 && read(events, &n, sizeof n) == (ssize_t)sizeof n ? 1e-6 * (double)n : NAN;
}

// ten iterations each of three stages from a motion on
static void whole(const cav_problem *p, cav_transcription *tr, cav_normal *normal, const cav_trajectory *from,
                  int runs) {
  double best[3] = {INFINITY, INFINITY, INFINITY};
  double merit = 0, count[3] = {0};
  int done[3] = {0}, events = counter();
  for (int r = 0; r < runs; r++) {
    cav_trajectory *at = cav_trajectory_copy(from), *spare = cav_trajectory_copy(from);
    cav_region region = {.radius = 0};
    if (!CHECK(at && spare)) return;
    for (int s = 0; s < 3; s++) {
      int before = region.done;
      cav_stage_set(p, 0.5 * s, tr);
      region.iterations = ITERATIONS;
      double begun = instructions(events), start = processor_seconds();
      CHECK(cav_region_minimise(&region, normal, tr, &at, &spare) == CAV_OK);
      done[s] = region.done - before;
      best[s] = fmin(best[s], 1e3 * (processor_seconds() - start) / done[s]);
      count[s] = (instructions(events) - begun) / done[s];
    }
    merit = cav_transcription_merit(tr);
    cav_trajectory_free(at), cav_trajectory_free(spare);
  }
  static const char *const names[] = {"first", "middle", "last"};
  for (int s = 0; s < 3; s++)
    printf("%s stage, %d whole iterations: %.3f ms, %.2f million instructions each\n", names[s], done[s], best[s],
           count[s]);
  printf("to merit %.17g\n", merit);
  if (events >= 0) close(events);
}

// one iteration of a stage from a motion; seconds
static double once(const cav_problem *p, cav_transcription *tr, cav_normal *normal, const cav_trajectory *from,
                   int stage, double *merit) {
  cav_trajectory *at = cav_trajectory_copy(from), *spare = cav_trajectory_copy(from);
  cav_region region = {.iterations = 1, .single = 1};
  double seconds = NAN;
  if (CHECK(at && spare)) {
    cav_stage_set(p, 0.5 * stage, tr);
    const double start = bench_seconds();
    CHECK(cav_region_minimise(&region, normal, tr, &at, &spare) == CAV_OK);
    seconds = bench_seconds() - start;
    *merit = cav_transcription_merit(tr);
  }
  cav_trajectory_free(at), cav_trajectory_free(spare);
  return seconds;
}

// what an iteration has to do on knots, by one thread: linearisation up to the factor, of this gathering and the factor
// alone, values; ms
static void time_parts(cav_transcription *tr, cav_normal *normal, const cav_trajectory *from, double part[3]) {
  cav_trajectory *at = cav_trajectory_copy(from);
  cav_status factored = CAV_OK;
  part[0] = part[1] = part[2] = INFINITY;
  // gathered again below: those of knots that are taken at once are not kept
  CHECK(at && cav_transcription_linearise(tr, at) == CAV_OK);
  for (int r = 0; r < 10 * RUNS && CHECK(at != NULL); r++) {
    double clock[4];
    clock[0] = bench_seconds();
    CHECK(cav_normal_linearise(normal, tr, at, 1e-10, &factored) == CAV_OK);
    clock[1] = bench_seconds();
    cav_normal_gather(normal, tr);
    CHECK(cav_normal_factor(normal, 1e-10) == factored);
    clock[2] = bench_seconds();
    CHECK(cav_transcription_values(tr, at) == CAV_OK);
    clock[3] = bench_seconds();
    for (int k = 0; k < 3; k++) part[k] = fmin(part[k], 1e3 * (clock[k + 1] - clock[k]));
  }
  cav_trajectory_free(at);
}

// both numbers of threads by turns
static void compare_threads(const cav_problem *p, const cav_trajectory *from) {
  static const char *const names[] = {"first", "middle", "last"};
  for (int s = 0; s < 3; s++) {
    double best[2] = {INFINITY, INFINITY}, merit[2] = {0};
    cav_transcription *tr[2] = {cav_transcription_new(p, 1, NULL), cav_transcription_new(p, 2, NULL)};
    cav_normal *normal[2] = {tr[0] ? cav_normal_new(tr[0]) : NULL, tr[1] ? cav_normal_new(tr[1]) : NULL};
    for (int r = 0; r < 40 * RUNS && CHECK(normal[0] && normal[1]); r++)
      for (int k = 0; k < 2; k++) best[k] = fmin(best[k], 1e3 * once(p, tr[k], normal[k], from, s, &merit[k]));
    CHECK(!memcmp(&merit[0], &merit[1], sizeof *merit));
    double part[3] = {0};
    if (normal[0]) time_parts(tr[0], normal[0], from, part);
    const double left = best[0] - part[0] - part[2];
    printf(
        "%-6s stage, one iteration: one thread %6.3f ms, two threads %6.3f ms, ratio %.2f; left to one thread %.1f %%, "
        "%.1f with gathering and factor\n",
        names[s], best[0], best[1], best[0] / best[1], 100 * left / best[0], 100 * (left + part[1]) / best[0]);
    for (int k = 0; k < 2; k++) cav_normal_free(normal[k]), cav_transcription_free(tr[k]);
  }
}

// the programme of the last stage's rows and costs at a motion, by both numbers of threads by turns
static void compare_programmes(const cav_problem *p, const cav_trajectory *from) {
  enum { RUNS_OF_ALL = 4 * RUNS };
  cav_transcription *tr[2] = {0};
  cav_normal *normal[2] = {0};
  cav_quadratic *qp[2] = {0};
  cav_trajectory *at = cav_trajectory_copy(from);
  double best[2] = {INFINITY, INFINITY}, *radius = NULL, change[2] = {-INFINITY, INFINITY};
  int whole = at != NULL;
  for (int k = 0; k < 2 && whole; k++) {
    tr[k] = cav_transcription_new(p, k + 1, NULL);
    normal[k] = tr[k] ? cav_normal_new(tr[k]) : NULL;
    whole = normal[k] && cav_transcription_keep_rows(tr[k]);
    if (!whole) break;
    cav_stage_set(p, 1, tr[k]);
    tr[k]->penalty = (cav_penalties){.unactuated = p->schedule.last.penalty};
    qp[k] = cav_quadratic_new(tr[k], normal[k]);
    whole = qp[k] && cav_transcription_linearise(tr[k], at) == CAV_OK;
    if (!whole) break;
    cav_programme_values(tr[k], cav_quadratic_value(qp[k]));
    for (int i = 0; i < cav_quadratic_rows(qp[k]); i++) cav_quadratic_penalty(qp[k])[i] = cav_programme_scale(tr[k]);
  }
  if (whole) radius = malloc(((size_t)cav_transcription_blocks(tr[0]) + 1) * sizeof *radius);
  for (int b = 0; radius && b <= cav_transcription_blocks(tr[0]); b++) radius[b] = 0.01;
  for (int r = 0; r < RUNS_OF_ALL && CHECK(radius != NULL); r++)
    for (int k = 0; k < 2; k++) {
      const double start = bench_seconds();
      const cav_status status = cav_quadratic_solve(qp[k], radius, change, 1e-9 * cav_programme_scale(tr[k]));
      best[k] = fmin(best[k], 1e3 * (bench_seconds() - start));
      CHECK(status == CAV_OK);
    }
  if (radius)
    CHECK(!memcmp(cav_quadratic_step(qp[0]), cav_quadratic_step(qp[1]),
                  (size_t)cav_transcription_unknowns(tr[0]) * sizeof(double)));
  printf("a programme of the last stage: one thread %6.2f ms, two threads %6.2f ms, ratio %.2f\n", best[0], best[1],
         best[0] / best[1]);
  for (int k = 0; k < 2; k++) cav_quadratic_free(qp[k]), cav_normal_free(normal[k]), cav_transcription_free(tr[k]);
  cav_trajectory_free(at), free(radius);
}

int main(int argc, char **argv) {
  static const char *const names[] = {"one-sided", "centred", "analytic"};
  cav_error error = {0};
  cav_problem *p = cav_problem_load(argc > 1 ? argv[1] : CAVORT_SOURCE_ROOT "/problems/motions/squat-jump/problem.xml",
                                    NULL, &error);
  if (!p) {
    fprintf(stderr, "%s\n", error.text);
    return EXIT_FAILURE;
  }
  p->duration = (KNOTS - 1) * p->timestep;
  cav_transcription *tr = cav_transcription_new(p, 1, &error);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = tr ? cav_trajectory_new(p->model, tr->nknot, p->timestep) : NULL;
  if (!CHECK(normal && at)) return check_result();
  cav_guess_fill(p, p->q_goal, at);
  shake(at, p->model, 0.02);
  int count = argc > 2 && !strcmp(argv[2], "count");
  printf("%s: %d dofs, %d knots, step %g s\n", p->name, tr->nv, tr->nknot, p->timestep);
  const int threads = argc > 2 && !strcmp(argv[2], "threads");
  if (threads)
    compare_programmes(p, at), compare_threads(p, at);
  else
    whole(p, tr, normal, at, count ? 1 : RUNS);
  for (int s = 0; s < 3 && !count && !threads; s++) {
    cav_stage_set(p, 0.5 * s, tr);
    printf("%s stage\n", s == 0 ? "first" : s == 1 ? "middle" : "last");
    for (int k = 0; k < 3; k++) {
      tr->derivative = (cav_derivative)k;
      tr->difference = k == 1 ? CAV_DERIVATIVE_CENTRED : CAV_DERIVATIVE_FORWARD;
      measure(tr, normal, at, names[k]);
    }
  }
  cav_trajectory_free(at);
  cav_normal_free(normal);
  cav_transcription_free(tr);
  cav_problem_free(p);
  return check_result();
}
