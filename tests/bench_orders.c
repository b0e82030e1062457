/// Error against run time of the orders of the step, on one thread. Forces: the inverse along a prescribed flight of a
/// humanoid whose joints swing at up to 6 rad/s, against that of a step a hundred times finer; and what an inverse, its
/// analytic derivatives and a Gauss-Newton iteration take. Motion: the humanoid thrown without weight, its joints free
/// or at work, forwards, against a step much finer; with what becomes of momentum (half way between knots, where
/// momentum keeps it) and energy. Velocities start half a step back, as the steps read them (optim/METHOD.md, 1). Times
/// are the shortest of several. Usage: bench_orders [MODEL]; default problems/models/humanoid.xml.
#include "bench.h"
#include "continuation.h"
#include "transcription.h"

enum { ORDERS = 3, STEPS = 5, RUNS = 7, KNOTS = 40 };
static const char *const order_name[ORDERS] = {"euler", "midpoint", "momentum"};
static const double step[STEPS] = {0.04, 0.02, 0.01, 0.005, 0.0025};
static const double swing_seconds = 1, flight_seconds = 0.4;

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

/// A flight: where it ended and what it did on the way.
typedef struct flight {
  double *q; ///< [nq] at the end
  double seconds, momentum, energy;
} flight;

// linear momentum and angular momentum about the origin over mass, m/s and m^2/s, and energy, J, at q with v
static double account(cav_state *other, const double *q, const double *v, double *M, double out[6]) {
  double com[3], energy = 0;
  CHECK(cav_inertia(m, other, q, M) == CAV_OK);
  for (int i = 0; i < m->nv; i++)
    for (int j = 0; j < m->nv; j++) energy += 0.5 * v[i] * M[i * m->nv + j] * v[j];
  CHECK(cav_position(m, other, q) == CAV_OK);
  cav_momentum(m, other, v, com, out, out + 3);
  for (int k = 0; k < 3; k++) {
    int x = (k + 1) % 3, y = (k + 2) % 3;
    out[3 + k] = out[3 + k] / m->mass + com[x] * out[y] - com[y] * out[x];
  }
  return energy;
}

// velocity half a step before a start at v, from the acceleration there
static void start_back(double h, const double *v, double *before) {
  double *next = scene_vector(m->nv), *u = scene_vector(m->nv), tiny = 1e-7;
  state->options.order = CAV_ORDER_EULER;
  state->options.timestep = tiny;
  state->options.gravity = 0;
  CHECK(cav_forward(m, state, m->q0, v, u, next) == CAV_OK);
  for (int d = 0; d < m->nv; d++) before[d] = v[d] - 0.5 * h * (next[d] - v[d]) / tiny;
  free(next), free(u);
}

static flight fly(cav_order order, double h, const double *v_start, double push, int watch) {
  flight f = {.q = scene_vector(m->nq)};
  cav_state *other = cav_state_new(m);
  other->options = state->options;
  double *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv), *mean = scene_vector(m->nv);
  double *M = scene_vector(m->nv * m->nv), *middle = scene_vector(m->nq), first[6] = {0}, now[6], energy = 0;
  int n = (int)lround(flight_seconds / h);
  start_back(h, v_start, v);
  state->options.order = order;
  state->options.timestep = h;
  memcpy(f.q, m->q0, (size_t)m->nq * sizeof *f.q);
  for (int t = 0; t < n; t++) {
    for (int d = 6; d < m->nv; d++) u[d] = push * sin(10 * t * h) / m->dof[d].inverse_weight;
    double start = cpu_seconds();
    CHECK(cav_forward_newton(m, state, f.q, v, u, 100, 1e-11, next, NULL) == CAV_OK);
    f.seconds += cpu_seconds() - start;
    if (watch) {
      cav_integrate(m, f.q, next, 0.5 * h, middle);
      account(other, middle, next, M, now);
      if (t == 0) memcpy(first, now, sizeof first);
      for (int k = 0; k < 6; k++) f.momentum = fmax(f.momentum, fabs(now[k] - first[k]));
      for (int d = 0; d < m->nv; d++) mean[d] = 0.5 * (v[d] + next[d]);
      double here = account(other, f.q, mean, M, now);
      if (t == 0) energy = here;
      if (push == 0) f.energy = fmax(f.energy, fabs(here - energy));
    }
    memcpy(v, next, (size_t)m->nv * sizeof *v);
    cav_integrate(m, f.q, v, h, f.q);
  }
  cav_state_free(other);
  free(v), free(next), free(u), free(mean), free(M), free(middle);
  return f;
}

static void flights(double push) {
  double *v = scene_vector(m->nv), *apart = scene_vector(m->nv);
  scene_seed = 5;
  scene_normals(v, m->nv, 1.5);
  flight fine = fly(CAV_ORDER_MIDPOINT, 1e-4, v, push, 0);
  printf("\nthe humanoid thrown, its joints %s, %g s forwards\n\n", push > 0 ? "at work" : "free", flight_seconds);
  printf("| order | step, ms | ms | error at the end, rad or m | momentum over mass, m/s or m^2/s |%s\n",
         push > 0 ? "" : " energy, J |");
  printf("|---|---|---|---|---|%s\n", push > 0 ? "" : "---|");
  for (int order = 0; order < ORDERS; order++) {
    for (int i = 0; i < STEPS; i++) {
      flight f = fly((cav_order)order, step[i], v, push, 1);
      double seconds = f.seconds, error = 0;
      for (int r = 1; r < RUNS; r++) {
        flight again = fly((cav_order)order, step[i], v, push, 0);
        seconds = fmin(seconds, again.seconds);
        free(again.q);
      }
      cav_difference(m, fine.q, f.q, 1, apart);
      for (int d = 0; d < m->nv; d++) error = fmax(error, fabs(apart[d]));
      printf("| %s | %g | %.2f | %.1e | %.1e |", order_name[order], 1e3 * step[i], 1e3 * seconds, error, f.momentum);
      if (push > 0) printf("\n");
      if (push == 0) printf(" %.1e |\n", f.energy);
      free(f.q);
    }
  }
  free(fine.q), free(v), free(apart);
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
  flights(0);
  flights(0.5);
  cav_state_free(state);
  cav_model_free(m);
  free(amplitude), free(rate), free(phase);
  return check_result();
}
