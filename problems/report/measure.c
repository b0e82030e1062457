/// The scene that a report measures: its law, the states it comes to under random forces, references, and the clock.
#include "measure.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "random.h"
#include "schedule.h"

const char *const cav_measure_bin_names[CAV_MEASURE_BINS] = {"0",        "1 to 9",   "10 to 19",   "20 to 29",
                                                             "30 to 49", "50 to 79", "80 and more"};
static const int bin_from[CAV_MEASURE_BINS] = {0, 1, 10, 20, 30, 50, 80};

// forces of a random motion, as accelerations of a dof alone; how long they stay, and an episode, s
static const double push_joint = 15, push_root = 3, hold_seconds = 0.1, episode_seconds = 1;
// how long the scene is left alone, s
static const double least_rest = 0.5, most_rest = 2;

// --- clocks ---

static double read_clock(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double cav_measure_clock(void) { return read_clock(CLOCK_MONOTONIC); }

double cav_measure_processor(void) { return read_clock(CLOCK_THREAD_CPUTIME_ID); }

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

double cav_measure_quantile(double *x, int n, double fraction) {
  if (n == 0) return NAN;
  for (int i = 0; i < n; i++)
    if (isnan(x[i])) x[i] = INFINITY;
  qsort(x, (size_t)n, sizeof *x, ascending);
  return x[(int)(fraction * (n - 1) + 0.5)];
}

int cav_measure_eliminate(int n, double *A, double *b) {
  for (int i = 0; i < n; i++) {
    int pivot = i;
    for (int r = i + 1; r < n; r++)
      if (fabs(A[r * n + i]) > fabs(A[pivot * n + i])) pivot = r;
    if (!(fabs(A[pivot * n + i]) > 0) || !isfinite(A[pivot * n + i])) return 0;
    for (int k = 0; k < n && pivot != i; k++) {
      double swap = A[i * n + k];
      A[i * n + k] = A[pivot * n + k];
      A[pivot * n + k] = swap;
    }
    double swap = b[i];
    b[i] = b[pivot];
    b[pivot] = swap;
    for (int r = i + 1; r < n; r++) {
      double factor = A[r * n + i] / A[i * n + i];
      for (int k = i; k < n && factor != 0; k++) A[r * n + k] -= factor * A[i * n + k];
      b[r] -= factor * b[i];
    }
  }
  for (int i = n - 1; i >= 0; i--) {
    for (int k = i + 1; k < n; k++) b[i] -= A[i * n + k] * b[k];
    b[i] /= A[i * n + i];
  }
  return 1;
}

// --- the scene ---

static void free_samples(cav_measure *m) {
  for (int i = 0; i < m->nsample; i++) free(m->sample[i].q);
  free(m->sample);
  m->sample = NULL;
  m->nsample = 0;
}

cav_status cav_measure_begin(cav_measure *m, cav_error *error) {
  const cav_model *model = m->model;
  size_t nv = (size_t)model->nv, n = (size_t)(model->nq > model->nv ? model->nq : model->nv);
  if (model->nv == 0)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "nothing moves in this scene: there is nothing to measure");
  m->state = cav_state_new(model);
  m->other = cav_state_new(model);
  double *room = calloc((CAV_MEASURE_VECTORS + 2) * n + CAV_MEASURE_MATRICES * nv * nv, sizeof *room);
  if (!m->state || !m->other || !room) {
    free(room);
    cav_measure_end(m);
    return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory to measure the scene");
  }
  for (int i = 0; i < CAV_MEASURE_VECTORS; i++) m->vector[i] = room + (size_t)i * n;
  for (int i = 0; i < CAV_MEASURE_MATRICES; i++) m->matrix[i] = room + CAV_MEASURE_VECTORS * n + (size_t)i * nv * nv;
  m->contact_q = room + CAV_MEASURE_VECTORS * n + CAV_MEASURE_MATRICES * nv * nv;
  m->contact_v = m->contact_q + n;
  m->options = m->state->options;
  m->start = model->q0;
  if (m->problem) {
    // the law that its motion is to obey in the end
    cav_stage_law(m->problem, 1, m->problem->timestep, &m->options);
    m->options.order = m->problem->order;
    m->options.timestep = m->problem->timestep;
    m->start = m->problem->q_start;
  }
  cav_measure_set(m, &m->options);
  return CAV_OK;
}

void cav_measure_end(cav_measure *m) {
  free_samples(m);
  free(m->vector[0]);
  m->vector[0] = NULL;
  cav_state_free(m->state);
  cav_state_free(m->other);
  m->state = m->other = NULL;
}

void cav_measure_set(cav_measure *m, const cav_options *options) {
  m->state->options = *options;
  m->other->options = *options;
}

void cav_measure_section(cav_measure *m, double quick_seconds, double seconds) {
  m->seconds = m->quick ? quick_seconds : seconds;
  m->begin = cav_measure_clock();
}

int cav_measure_late(const cav_measure *m) { return cav_measure_clock() - m->begin > m->seconds; }

int cav_measure_rows(const cav_state *state) {
  int n = state->nrow;
  for (int i = 0; i < state->ncontact; i++) n += state->contact[i].dim;
  for (int i = 0; i < state->nequality; i++) n += state->equality[i].dim;
  return n;
}

double cav_measure_push(const cav_model *model, int dof, double acceleration) {
  double weight = model->dof[dof].inverse_weight;
  return weight > 0 ? acceleration / weight : 0;
}

static double largest(const double *x, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(x[i]));
  return most;
}

double cav_measure_mismatch(cav_measure *m, const double *q, const double *v, const double *u, const double *v_next,
                            double *residual) {
  const cav_model *model = m->model;
  int nv = model->nv;
  double *rest = m->vector[CAV_MEASURE_VECTORS - 1];
  // the largest force in the balance: what is asked, and what takes v to v_next where nothing pushes
  if (cav_inverse(model, m->other, q, v, v_next, residual)) return NAN;
  const cav_options options = m->other->options;
  m->other->options.constraint = 0;
  cav_status status = cav_inverse(model, m->other, q, v, v_next, rest);
  m->other->options = options;
  if (status) return NAN;
  double scale = fmax(largest(u, nv), largest(rest, nv));
  for (int i = 0; i < nv; i++) residual[i] -= u[i];
  double error = largest(residual, nv);
  return scale > 0 ? error / scale : error;
}

// v_next to rounding: Newton as tight as it goes, then by the derivative of the inverse while that is nearer
static void refer(cav_measure *m, cav_measure_sample *s) {
  const cav_model *model = m->model;
  int nv = model->nv;
  double *x = m->vector[0], *step = m->vector[1], *J = m->matrix[0];
  s->uncertainty = NAN;
  cav_status status = cav_forward_newton(model, m->state, s->q, s->v, s->u, 300, 1e-15, s->v_next, NULL);
  if (status && status != CAV_NOT_CONVERGED) return;
  double error = cav_measure_mismatch(m, s->q, s->v, s->u, s->v_next, step);
  cav_derivative method =
      cav_derivatives_missing(model) || m->options.regulariser == CAV_REGULARISER_EXACT || m->options.coupled
          ? CAV_DERIVATIVE_CENTRED
          : CAV_DERIVATIVE_ANALYTIC;
  for (int pass = 0; pass < 3; pass++) {
    if (cav_inverse_jacobian_by(model, m->other, method, s->q, s->v, s->v_next, NULL, NULL, J)) return;
    if (!cav_measure_eliminate(nv, J, step)) return;
    s->uncertainty = largest(step, nv);
    for (int i = 0; i < nv; i++) x[i] = s->v_next[i] - step[i];
    double now = cav_measure_mismatch(m, s->q, s->v, s->u, x, step);
    if (!(now < error)) return;
    error = now;
    memcpy(s->v_next, x, (size_t)nv * sizeof *x);
  }
}

// --- states ---

static void random_posture(const cav_measure *m, uint64_t *seed, double spread, double *q) {
  const cav_model *model = m->model;
  memcpy(q, m->start, (size_t)model->nq * sizeof *q);
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = &model->joint[j];
    double shift = spread * cav_random_uniform(seed);
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    if (!scalar || !joint->limited) continue;
    double *x = q + joint->q, width = fmin(joint->range[1] - joint->range[0], 2);
    *x = fmin(fmax(*x + shift * width, joint->range[0]), joint->range[1]);
  }
}

static int is_root(const cav_model *model, int dof) {
  return model->joint[model->dof[dof].joint].type == CAV_JOINT_FREE;
}

static void random_forces(const cav_model *model, uint64_t *seed, double *u) {
  for (int d = 0; d < model->nv; d++)
    u[d] = cav_measure_push(model, d, (is_root(model, d) ? push_root : push_joint) * cav_random_normal(seed));
}

static int bin_of(int rows) {
  int bin = 0;
  while (bin + 1 < CAV_MEASURE_BINS && rows >= bin_from[bin + 1]) bin++;
  return bin;
}

// keeps a step; 0 if memory runs out
static int keep(cav_measure *m, const double *const from[6], int rows) {
  const cav_model *model = m->model;
  size_t nq = (size_t)model->nq, nv = (size_t)model->nv;
  cav_measure_sample *sample = realloc(m->sample, ((size_t)m->nsample + 1) * sizeof *sample);
  if (sample) m->sample = sample;
  double *room = sample ? malloc((2 * nq + 5 * nv) * sizeof *room) : NULL;
  if (!room) return 0;
  cav_measure_sample *s = &m->sample[m->nsample++];
  *s = (cav_measure_sample){.rows = rows, .bin = bin_of(rows)};
  double **const to[] = {&s->q, &s->v, &s->u, &s->q_before, &s->v_before, &s->u_before};
  for (int i = 0; i < 6; i++) {
    size_t n = i % 3 ? nv : nq;
    *to[i] = room;
    memcpy(room, from[i], n * sizeof *room);
    room += n;
  }
  s->v_next = room;
  return 1;
}

// one run from one posture; steps of each number of rows are kept while there is room for them
static cav_status run_episode(cav_measure *m, int episode, int *count, int most) {
  const cav_model *model = m->model;
  size_t nq = (size_t)model->nq * sizeof(double), nv = (size_t)model->nv * sizeof(double);
  double **w = m->vector, *q = w[0], *v = w[1], *u = w[2], *next = w[3], *q_before = w[4], *v_before = w[5],
         *u_before = w[6];
  uint64_t seed = 77 + 1000003u * (uint64_t)episode;
  double h = m->options.timestep;
  int hold = (int)fmax(1, hold_seconds / h), n = (int)fmin(fmax(10, episode_seconds / h), 1000),
      taken[CAV_MEASURE_BINS] = {0};
  random_posture(m, &seed, episode ? 0.25 : 0, q);
  for (int d = 0; d < model->nv; d++) v[d] = (is_root(model, d) ? 0.3 : 1) * cav_random_normal(&seed);
  for (int t = 0; t < n && !cav_measure_late(m); t++) {
    if (t % hold == 0) random_forces(model, &seed, u);
    cav_status status = cav_forward_newton(model, m->state, q, v, u, 100, 1e-12, next, NULL);
    if (status && status != CAV_NOT_CONVERGED) {
      m->lost++;
      return status == CAV_NO_MEMORY ? status : CAV_OK;
    }
    int rows = cav_measure_rows(m->state), bin = bin_of(rows);
    if (t > 0 && t % 7 == 0 && count[bin] < most && taken[bin] < 2) {
      const double *const from[] = {q, v, u, q_before, v_before, u_before};
      if (!keep(m, from, rows)) return CAV_NO_MEMORY;
      count[bin]++;
      taken[bin]++;
    }
    memcpy(q_before, q, nq);
    memcpy(v_before, v, nv);
    memcpy(u_before, u, nv);
    memcpy(v, next, nv);
    cav_integrate(model, q, v, h, q);
  }
  return CAV_OK;
}

// lets the scene go from its start; where nothing pushes then, a sampled state with rows stands in
static cav_status let_go(cav_measure *m) {
  const cav_model *model = m->model;
  double *q = m->contact_q, *v = m->contact_v, *u = m->vector[0], *next = m->vector[1], h = m->options.timestep;
  memcpy(q, m->start, (size_t)model->nq * sizeof *q);
  memset(v, 0, (size_t)model->nv * sizeof *v);
  memset(u, 0, (size_t)model->nv * sizeof *u);
  m->contact_rows = 0;
  for (int t = 0; (t * h < least_rest || (m->contact_rows == 0 && t * h < most_rest)) && !cav_measure_late(m); t++) {
    cav_status status = cav_forward_newton(model, m->state, q, v, u, 100, 1e-12, next, NULL);
    if (status == CAV_NO_MEMORY) return status;
    m->contact_rows = 0;
    if ((status && status != CAV_NOT_CONVERGED) || t >= 4000) break;
    memcpy(v, next, (size_t)model->nv * sizeof *v);
    cav_integrate(model, q, v, h, q);
    m->contact_rows = cav_measure_rows(m->state);
  }
  for (int i = 0; i < m->nsample && m->contact_rows == 0; i++)
    if (m->sample[i].rows > 0) {
      m->contact_rows = m->sample[i].rows;
      memcpy(q, m->sample[i].q, (size_t)model->nq * sizeof *q);
      memcpy(v, m->sample[i].v, (size_t)model->nv * sizeof *v);
    }
  return CAV_OK;
}

cav_status cav_measure_collect(cav_measure *m) {
  int count[CAV_MEASURE_BINS] = {0}, most = m->quick ? 5 : 16, episodes = m->quick ? 10 : 40;
  free_samples(m);
  m->lost = 0;
  cav_measure_set(m, &m->options);
  cav_measure_section(m, 1, 8);
  for (int e = 0; e < episodes && !cav_measure_late(m); e++) {
    cav_status status = run_episode(m, e, count, most);
    if (status) return status;
    if (m->tell(m->context, "states of the scene", 0.4 * e / episodes)) return CAV_INTERRUPTED;
  }
  for (int i = 0; i < m->nsample; i++) m->sample[i].uncertainty = NAN;
  cav_measure_section(m, 1, 10);
  for (int i = 0; i < m->nsample && !cav_measure_late(m); i++) {
    refer(m, &m->sample[i]);
    if (m->tell(m->context, "states of the scene", 0.4 + 0.6 * i / m->nsample)) return CAV_INTERRUPTED;
  }
  cav_measure_section(m, 1, 10);
  return let_go(m);
}

double cav_measure_noise(void) {
  enum { RUNS = 60, WORK = 20000 };
  double time[RUNS];
  volatile double sink = 0;
  for (int r = 0; r < RUNS; r++) {
    double begin = cav_measure_processor(), x = 1;
    for (int i = 0; i < WORK; i++) x = x * 1.0000001 + 1e-9;
    sink = sink + x;
    time[r] = cav_measure_processor() - begin;
  }
  double least = cav_measure_quantile(time, RUNS, 0), upper = cav_measure_quantile(time, RUNS, 0.75);
  return upper / least;
}
