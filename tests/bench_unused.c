/// What a plan pays for things beside it that it has no use for: squat-jump as it is, with five free balls ten metres
/// away, and with fifty boxes in a ring there; each as cav_solve plans it (idle.c), the balls also as if nothing were
/// left out. Time of the processor for each part of an iteration and for the inverse, the scenes by turns; medians,
/// quartiles, and the median of the ratios within a turn. Usage: bench_unused [PROBLEM]
#include "bench.h"
#include "continuation.h"
#include "crowd.h"
#include "idle.h"

enum { PLAIN, BALLS, ALL_BALLS, BOXES, SCENES };
enum { INVERSE, LINEARISE, GATHER, FACTOR, SOLVE, SEARCH, WHOLE, PARTS };
enum { TURNS = 41 };
static const char *const scene_name[SCENES] = {"alone", "5 balls", "planned too", "50 boxes"};
static const char *const part_name[PARTS] = {"inverse of a knot", "linearise", "assemble", "factor", "solve", "search",
                                             "iteration"};

static double processor(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct planned {
  cav_problem *whole;
  const cav_problem *problem; ///< that is planned
  cav_idle idle;
  double once; ///< finding what is left out, ms
  cav_transcription *tr;
  cav_normal *normal;
  cav_trajectory *at, *to;
  cav_state *state;
  double *x, *u;
} planned;

static int open_scene(planned *s, const char *path, int scene) {
  cav_error error = {0};
  s->whole = crowd_problem(path, scene == BALLS || scene == ALL_BALLS ? 5 : 0, scene == BOXES ? 50 : 0);
  if (!s->whole) return 0;
  s->once = processor();
  CHECK(cav_idle_find(s->whole, &s->idle) == CAV_OK && s->idle.ntree == (scene == BALLS || scene == ALL_BALLS ? 5 : 0));
  s->once = 1e3 * (processor() - s->once);
  s->problem = scene == BALLS ? &s->idle.problem : s->whole;
  s->tr = cav_transcription_new(s->problem, 1, &error);
  s->normal = s->tr ? cav_normal_new(s->tr) : NULL;
  if (!CHECK(s->normal != NULL)) return 0;
  s->at = cav_trajectory_new(s->problem->model, s->tr->nknot, s->problem->timestep);
  s->to = cav_trajectory_new(s->problem->model, s->tr->nknot, s->problem->timestep);
  s->state = cav_state_new(s->problem->model);
  s->x = scene_vector(s->normal->size);
  s->u = scene_vector(s->tr->nv);
  cav_guess_fill(s->problem, s->problem->q_goal, s->at);
  cav_stage_set(s->problem, 0.5, s->tr);
  return 1;
}

static void close_scene(planned *s) {
  free(s->x), free(s->u);
  cav_state_free(s->state);
  cav_trajectory_free(s->at), cav_trajectory_free(s->to);
  cav_normal_free(s->normal);
  cav_transcription_free(s->tr);
  cav_idle_clear(&s->idle);
  cav_problem_free(s->whole);
}

// time since the last call, ms
static double lap(double *last) {
  double now = processor(), passed = 1e3 * (now - *last);
  *last = now;
  return passed;
}

// one iteration by its parts, and the inverse at its knots
static void iterate(planned *s, double part[PARTS]) {
  double clock = processor();
  CHECK(cav_transcription_linearise(s->tr, s->at) == CAV_OK);
  part[LINEARISE] = lap(&clock);
  cav_normal_gather(s->normal, s->tr);
  part[GATHER] = lap(&clock);
  CHECK(cav_normal_factor(s->normal, 1e-6) == CAV_OK);
  part[FACTOR] = lap(&clock);
  cav_normal_solve(s->normal, s->normal->gradient, s->x);
  part[SOLVE] = lap(&clock);
  for (int i = 0; i < s->normal->size; i++) s->x[i] *= -1e-3;
  lap(&clock);
  cav_transcription_move(s->tr, s->at, s->x, s->to);
  CHECK(cav_transcription_values(s->tr, s->to) == CAV_OK);
  part[SEARCH] = lap(&clock);
  part[WHOLE] = 0;
  for (int i = LINEARISE; i <= SEARCH; i++) part[WHOLE] += part[i];
  s->state->options = s->tr->options;
  lap(&clock);
  for (int t = 1; t + 1 < s->at->nknot; t++) {
    const double *v = s->at->v + (size_t)t * (size_t)s->at->nv;
    CHECK(cav_inverse(s->problem->model, s->state, s->at->q + (size_t)t * (size_t)s->at->nq, v, v + s->at->nv, s->u) ==
          CAV_OK);
  }
  part[INVERSE] = lap(&clock) / (s->at->nknot - 2);
}

static double quantile(double *x, int n, double fraction) {
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[(int)(fraction * (n - 1) + 0.5)];
}

int main(int argc, char **argv) {
  const char *path = argc > 1 ? argv[1] : CAVORT_SOURCE_ROOT "/problems/motions/squat-jump/problem.xml";
  static double time[SCENES][TURNS][PARTS];
  planned scene[SCENES] = {0};
  for (int s = 0; s < SCENES; s++)
    if (!open_scene(&scene[s], path, s)) return check_result();
  for (int turn = -2; turn < TURNS; turn++)
    for (int s = 0; s < SCENES; s++) iterate(&scene[s], time[s][turn < 0 ? 0 : turn]);
  for (int s = 0; s < SCENES; s++)
    printf("%-11s %4d dofs %5d unknowns %5d pairs of geoms; what is left out found in %.2f ms\n", scene_name[s],
           scene[s].tr->nv, scene[s].normal->size, scene[s].problem->model->npair, scene[s].once);
  printf("\nms, median (quartiles) of %d turns, and over the same alone in the same turn\n%-18s", TURNS, "");
  for (int s = 0; s < SCENES; s++) printf("  %-26s%s", scene_name[s], s > 0 ? "       " : "");
  printf("\n");
  for (int p = 0; p < PARTS; p++) {
    printf("%-18s", part_name[p]);
    for (int s = 0; s < SCENES; s++) {
      double x[TURNS], ratio[TURNS];
      for (int t = 0; t < TURNS; t++) x[t] = time[s][t][p], ratio[t] = time[s][t][p] / time[PLAIN][t][p];
      double low = quantile(x, TURNS, 0.25), high = quantile(x, TURNS, 0.75);
      printf("  %9.4f (%.4f, %.4f)", quantile(x, TURNS, 0.5), low, high);
      if (s > 0) printf(" %6.3f", quantile(ratio, TURNS, 0.5));
    }
    printf("\n");
  }
  for (int s = 0; s < SCENES; s++) close_scene(&scene[s]);
  return check_result();
}
