/// What the orders of the step cost and leave in an inverse, on one thread: the forces along a prescribed flight of a
/// humanoid whose joints swing at up to 6 rad/s, against those of a step a hundred times finer; and what an inverse, its
/// analytic derivatives and a Gauss-Newton iteration take. Times are the shortest of several. Motions forwards are
/// measured by cavort report. Usage: bench_orders [MODEL]; default problems/models/humanoid.xml.
#include "bench.h"
#include "continuation.h"
#include "transcription.h"

enum { ORDERS = 3, STEPS = 5, RUNS = 7, KNOTS = 40 };
static const char *const order_name[ORDERS] = {"euler", "midpoint", "momentum"};
static const double step[STEPS] = {0.04, 0.02, 0.01, 0.005, 0.0025};
static const double swing_seconds = 1;

static cav_model *m;
static cav_state *state;
static double *amplitude, *rate, *phase;

// of this process alone, for what lasts longer than a turn of the scheduler
static double cpu_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// the prescribed motion
static void motion(double t, double *q) {
  double *move = scene_vector(m->nv);
  for (int d = 3; d < m->nv; d++) move[d] = amplitude[d] * sin(rate[d] * t + phase[d]);
  cav_integrate(m, m->q0, move, 1, q);
  q[0] += t, q[2] += 3 * t - 4.905 * t * t;
  free(move);
}

static void force_at(double t, double h, double *u) {
  double *q[3] = {scene_vector(m->nq), scene_vector(m->nq), scene_vector(m->nq)};
  double *v = scene_vector(m->nv), *next = scene_vector(m->nv);
  for (int k = 0; k < 3; k++) motion(t + (k - 1) * h, q[k]);
  cav_difference(m, q[0], q[1], h, v);
  cav_difference(m, q[1], q[2], h, next);
  state->options.timestep = h;
  CHECK(cav_inverse(m, state, q[1], v, next, u) == CAV_OK);
  for (int k = 0; k < 3; k++) free(q[k]);
  free(v), free(next);
}

// error of the forces along the prescribed motion, rms over time and dofs relative to their rms
static double force_error(cav_order order, double h) {
  double *u = scene_vector(m->nv), *fine = scene_vector(m->nv), error = 0, size = 0;
  for (double t = 0; t < swing_seconds; t += 0.037) {
    state->options.order = CAV_ORDER_MIDPOINT;
    force_at(t, 1e-4, fine);
    state->options.order = order;
    force_at(t, h, u);
    for (int d = 0; d < m->nv; d++) error += (u[d] - fine[d]) * (u[d] - fine[d]), size += fine[d] * fine[d];
  }
  free(u), free(fine);
  return sqrt(error / size);
}

// microseconds of an inverse and of an inverse with its derivatives
static void evaluation_times(cav_order order, double *inverse, double *derivatives) {
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv);
  double *J = scene_vector(3 * m->nv * m->nv);
  size_t n = (size_t)(m->nv * m->nv);
  motion(0.3, q);
  scene_normals(v, m->nv, 1);
  memcpy(next, v, (size_t)m->nv * sizeof *v);
  state->options.order = order;
  state->options.timestep = 0.025;
  *inverse = *derivatives = INFINITY;
  for (int r = 0; r < 5 * RUNS; r++) {
    double start = bench_seconds();
    for (int k = 0; k < 200; k++) cav_inverse(m, state, q, v, next, u);
    double middle = bench_seconds();
    for (int k = 0; k < 50; k++)
      cav_inverse_jacobian_by(m, state, CAV_DERIVATIVE_ANALYTIC, q, v, next, J, J + n, J + 2 * n);
    *derivatives = fmin(*derivatives, (bench_seconds() - middle) * 1e6 / 50);
    *inverse = fmin(*inverse, (middle - start) * 1e6 / 200);
  }
  free(q), free(v), free(next), free(u), free(J);
}

// milliseconds of a Gauss-Newton iteration of squat-jump at 40 knots, last stage
static double iteration_time(cav_order order) {
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/squat-jump/problem.xml", NULL, NULL);
  if (!CHECK(p != NULL)) return NAN;
  p->order = order;
  p->duration = (KNOTS - 1) * p->timestep;
  cav_transcription *tr = cav_transcription_new(p, 1, NULL);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = tr ? cav_trajectory_new(p->model, tr->nknot, p->timestep) : NULL;
  double best = INFINITY;
  if (CHECK(normal && at)) {
    cav_guess_fill(p, p->q_goal, at);
    cav_stage_set(p, 1, tr);
    for (int r = 0; r < 3 * RUNS; r++) {
      double start = cpu_seconds();
      CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
      cav_normal_gather(normal, tr);
      CHECK(cav_normal_factor(normal, 1e-6) == CAV_OK);
      best = fmin(best, 1e3 * (cpu_seconds() - start));
    }
  }
  cav_trajectory_free(at);
  cav_normal_free(normal);
  cav_transcription_free(tr);
  cav_problem_free(p);
  return best;
}

int main(int argc, char **argv) {
  cav_error error = {0};
  m = cav_model_load(argc > 1 ? argv[1] : CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error);
  if (!m) {
    fprintf(stderr, "%s\n", error.text);
    return EXIT_FAILURE;
  }
  state = cav_state_new(m);
  state->options.constraint = state->options.passive = 0;
  amplitude = scene_vector(m->nv), rate = scene_vector(m->nv), phase = scene_vector(m->nv);
  for (int d = 0; d < m->nv; d++) {
    rate[d] = 8 + 4 * scene_uniform();
    amplitude[d] = (4 + 2 * scene_uniform()) / rate[d];
    phase[d] = M_PI * scene_uniform();
  }
  printf(
      "error of the inverse's forces along a prescribed flight, by step; time of an inverse, with its derivatives, of\n"
      "a Gauss-Newton iteration of squat-jump at %d knots\n\n| order |",
      KNOTS);
  for (int i = 0; i < STEPS; i++) printf(" %g ms |", 1e3 * step[i]);
  printf(" inverse, us | derivatives, us | iteration, ms |\n|---|---|---|---|---|---|---|---|---|\n");
  for (int order = 0; order < ORDERS; order++) {
    double inverse, derivatives;
    printf("| %s |", order_name[order]);
    for (int i = 0; i < STEPS; i++) printf(" %.1e |", force_error((cav_order)order, step[i]));
    evaluation_times((cav_order)order, &inverse, &derivatives);
    printf(" %.2f | %.1f | %.2f |\n", inverse, derivatives, iteration_time((cav_order)order));
  }
  cav_state_free(state);
  cav_model_free(m);
  free(amplitude), free(rate), free(phase);
  return check_result();
}
