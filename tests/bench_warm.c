/// Solves again: five motions cold, then with the weight of their first cost term a tenth higher, cold again and warm, from the
/// motion and multipliers of the first solve; and one iteration through cav_optimiser_iterate against its parts called by
/// themselves, as bench_iteration does: linearisation, gathering and factorisation at the same motion, by turns, the shortest
/// of several, in processor time. One thread, no gains. Usage: bench_warm [MOTION...].
#include <time.h>

#include "bench.h"
#include "continuation.h"
#include "motion.h"
#include "transcription.h"

enum { RUNS = 4, CALLS = 25 };

static const motion_case cases[] = {
    {"kick", NULL}, {"squat-jump", NULL}, {"walker-walk", NULL}, {"cheetah-gallop", NULL}, {"hopper-hop", NULL}};

// processor time, s: one thread works, and others may be at work beside it
static double processor_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// the parts of an iteration at a motion; seconds
static double parts(cav_transcription *tr, cav_normal *normal, cav_trajectory *at) {
  double start = processor_seconds();
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  cav_normal_gather(normal, tr);
  CHECK(cav_normal_factor(normal, 1e-6) == CAV_OK);
  return processor_seconds() - start;
}

// every configuration but the first moved a little
static void shake(const cav_model *m, cav_trajectory *at) {
  double *step = scene_vector(m->nv), *moved = scene_vector(m->nq);
  for (int t = 1; t < at->nknot; t++) {
    for (int d = 0; d < m->nv; d++) step[d] = 1e-3 * scene_uniform();
    cav_integrate(m, at->q + (size_t)t * at->nq, step, 1, moved);
    memcpy(at->q + (size_t)t * at->nq, moved, (size_t)at->nq * sizeof *moved);
  }
  cav_trajectory_velocities(m, at);
  free(step), free(moved);
}

// shortest times of an iteration through the interface and of its parts, milliseconds
static void time_iterations(const cav_problem *p, const cav_solution *s, double shortest[2]) {
  cav_error error = {0};
  cav_solve_options options = cav_solve_options_default();
  cav_transcription *tr = cav_transcription_new(p, 1, &error);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = cav_trajectory_copy(s->trajectory);
  shortest[0] = shortest[1] = INFINITY;
  if (!CHECK(normal && at)) return;
  cav_stage_set(p, 1, tr);
  options.nmultiplier = s->nmultiplier;
  options.multiplier = s->multiplier;
  for (int r = 0; r < RUNS; r++) {
    // each from a motion that is a little off, as it is when a plan is followed
    cav_progress last = {0};
    cav_trajectory *start = cav_trajectory_copy(s->trajectory);
    if (!CHECK(start != NULL)) break;
    shake(p->model, start);
    cav_optimiser *o = cav_optimiser_new(p, &options, start, &error);
    cav_trajectory_free(start);
    if (!CHECK(o != NULL)) break;
    for (int k = 0; k < CALLS; k++) {
      int before = last.iteration;
      double begin = processor_seconds();
      CHECK(cav_optimiser_iterate(o, 1, &last) == CAV_OK);
      double time = processor_seconds() - begin;
      // the first makes room; what settles at once is no iteration
      if (k > 0 && last.iteration == before + 1) shortest[0] = fmin(shortest[0], 1e3 * time);
      shortest[1] = fmin(shortest[1], 1e3 * parts(tr, normal, at));
    }
    cav_optimiser_free(o);
  }
  cav_trajectory_free(at);
  cav_normal_free(normal);
  cav_transcription_free(tr);
}

static cav_solution *solve(const cav_problem *p, const cav_solve_options *options, const cav_trajectory *start) {
  cav_error error = {0};
  cav_solution *s = NULL;
  cav_status status = cav_solve(p, options, start, &s, &error);
  CHECK(status == CAV_OK && s);
  if (status) fprintf(stderr, "    %s: %s %s\n", p->name, cav_status_name(status), error.text);
  return s;
}

static void measure(const motion_case *c) {
  cav_problem *p = motion_load(c);
  if (!p) return;
  cav_solve_options options = cav_solve_options_default();
  options.gains = 0;
  cav_solution *first = solve(p, &options, NULL), *cold = NULL, *warm = NULL;
  int term = 0;
  while (term < p->nterm && p->term[term].use != CAV_USE_COST) term++;
  if (first && CHECK(term < p->nterm)) {
    double shortest[2];
    time_iterations(p, first, shortest);
    p->term[term].weight *= 1.1;
    cold = solve(p, &options, NULL);
    options.first_stage = p->schedule.stages + 1;
    options.nmultiplier = first->nmultiplier;
    options.multiplier = first->multiplier;
    warm = solve(p, &options, first->trajectory);
    if (cold && warm)
      printf("| %s | %d | %.2f | %d | %.2f | %.3f | %.6g | %.6g | %.0e | %.2f | %.2f | %.2f |\n", c->motion,
             cold->iterations, cold->seconds, warm->iterations, warm->seconds,
             (double)warm->iterations / cold->iterations, cold->cost, warm->cost, warm->optimality, shortest[1],
             shortest[0], shortest[0] / shortest[1]);
    fflush(stdout);
  }
  cav_solution_free(first);
  cav_solution_free(cold);
  cav_solution_free(warm);
  cav_problem_free(p);
}

int main(int argc, char **argv) {
  printf(
      "| motion | cold: iterations | s | warm: iterations | s | of the cold | cost, cold | cost, warm | warm: optimal "
      "to | "
      "parts of an iteration, ms | iteration by cav_optimiser_iterate, ms | ratio |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    int wanted = argc == 1;
    for (int k = 1; k < argc; k++) wanted |= !strcmp(argv[k], cases[i].motion);
    if (wanted) measure(&cases[i]);
  }
  return check_result();
}
