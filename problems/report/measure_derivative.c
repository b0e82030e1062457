/// Derivatives of the inverse by q, v and v_next: closed form, and one-sided and centred differences over steps from 1e-1
/// to 1e-12, at states of the scene, with constraints and without. The reference is extrapolated entry by entry (Ridders'
/// tableau: centred differences over steps of 1e-2 to 2e-8, each a third of the one before, each column two orders higher;
/// contacts that come and go within a step spoil the coarse ones alone). It knows its own uncertainty: the disagreement of
/// the entries that it is taken from, no less than what rounding does. An error is the largest of a block over the block's
/// largest entry.
#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "measure.h"

static const cav_sheet_column columns[] = {
    {"states", "free: without constraints; contacts: with"},
    {"block", "of u by what: q, v or v_next"},
    {"method", "analytic; one-sided or centred differences, at their default step or at that of the row"},
    {"step", "of the differences; by default it goes by the scale of the coordinate"},
    {"count", "states"},
    {"error_median", "largest error of an entry over the largest entry of the block, median over states"},
    {"error_max", "the same, largest over states"},
    {"uncertainty", "of the reference, in the same measure: an error below it may be the reference's"},
    {"time_us", "of all three blocks, microseconds, median"},
    {"time_low_us", "the same, lower quartile"},
    {"time_high_us", "the same, upper quartile"},
    {"failed", "states without an answer"}};

enum { LEVELS = 13, STATES = 4, REPEATS = 9, METHODS = 32 };
static const double coarsest = 1e-2;
static const char *const block_name[] = {"q", "v", "v_next"};

typedef struct method {
  cav_derivative kind;
  double step;
} method;

typedef struct outcome {
  double error[3], time[REPEATS];
  int failed;
} outcome;

static void read_u(const cav_model *model, cav_state *state, void *context, double *value) {
  (void)context;
  memcpy(value, state->u, (size_t)model->nv * sizeof *value);
}

// J: three blocks, one after the other
static cav_status differentiate(cav_measure *m, const cav_measure_sample *s, const method *k, double *J) {
  size_t block = (size_t)m->model->nv * (size_t)m->model->nv;
  if (k->step == 0)
    return cav_inverse_jacobian_by(m->model, m->state, k->kind, s->q, s->v, s->v_next, J, J + block, J + 2 * block);
  return cav_readout_differentiate(m->model, m->state, k->kind, k->step, s->q, s->v, s->v_next, read_u, NULL,
                                   m->model->nv, m->vector[0], J, J + block, J + 2 * block);
}

static double largest(const double *x, size_t n) {
  double most = 0;
  for (size_t i = 0; i < n; i++) most = isfinite(x[i]) ? fmax(most, fabs(x[i])) : INFINITY;
  return most;
}

// reference and uncertainty of n entries from LEVELS differences, table [LEVELS*n], of forces of such a size
static void extrapolate(size_t n, double force, double *table, double *reference, double *uncertainty) {
  for (size_t e = 0; e < n; e++) {
    double least = INFINITY, row[LEVELS] = {0};
    double step = coarsest;
    reference[e] = 0;
    for (int k = 0; k < LEVELS; k++, step /= 3) {
      double before = row[0], power = 1;
      row[0] = table[(size_t)k * n + e];
      for (int j = 1; j <= k; j++) {
        double above = row[j];
        power *= 9;
        row[j] = row[j - 1] + (row[j - 1] - before) / (power - 1);
        double error = fmax(fabs(row[j] - row[j - 1]), fabs(row[j] - before));
        error = fmax(error, 4 * DBL_EPSILON * force / step);
        if (error < least) least = error, reference[e] = row[j];
        before = above;
      }
    }
    uncertainty[e] = least;
  }
}

// s, that a reference takes: LEVELS centred differences
static double reference_seconds(cav_measure *m, const cav_measure_sample *s) {
  double begin = cav_measure_clock();
  cav_inverse(m->model, m->state, s->q, s->v, s->v_next, m->vector[0]);
  return LEVELS * 6.0 * m->model->nv * (cav_measure_clock() - begin);
}

static cav_status refer(cav_measure *m, const cav_measure_sample *s, double *table, double *reference,
                        double *uncertainty) {
  size_t n = 3 * (size_t)m->model->nv * (size_t)m->model->nv;
  double step = coarsest;
  for (int k = 0; k < LEVELS; k++, step /= 3) {
    const method centred = {CAV_DERIVATIVE_CENTRED, step};
    cav_status status = differentiate(m, s, &centred, table + (size_t)k * n);
    if (status) return status;
  }
  extrapolate(n, largest(m->state->u, (size_t)m->model->nv), table, reference, uncertainty);
  return CAV_OK;
}

static void measure(cav_measure *m, const cav_measure_sample *s, const method *k, const double *reference, double *J,
                    int repeat, outcome *out) {
  size_t n = (size_t)m->model->nv * (size_t)m->model->nv;
  double begin = cav_measure_processor();
  cav_status status = differentiate(m, s, k, J);
  out->time[repeat] = 1e6 * (cav_measure_processor() - begin);
  if (repeat > 0) return;
  out->failed = status != CAV_OK;
  for (int b = 0; b < 3 && !out->failed; b++) {
    double most = largest(reference + (size_t)b * n, n), error = 0;
    for (size_t i = (size_t)b * n; i < (size_t)(b + 1) * n; i++) {
      double e = fabs(J[i] - reference[i]);
      error = isfinite(e) ? fmax(error, e) : INFINITY;
    }
    out->error[b] = most > 0 ? error / most : error;
  }
}

static int list_methods(const cav_measure *m, method *list) {
  int n = 0;
  if (!cav_derivatives_missing(m->model) && m->options.regulariser != CAV_REGULARISER_EXACT && !m->options.coupled)
    list[n++] = (method){CAV_DERIVATIVE_ANALYTIC, 0};
  for (int kind = CAV_DERIVATIVE_FORWARD; kind <= CAV_DERIVATIVE_CENTRED; kind++) {
    list[n++] = (method){(cav_derivative)kind, 0};
    for (int p = 1; p <= 12; p++) list[n++] = (method){(cav_derivative)kind, pow(10, -p)};
  }
  return n;
}

// rows of the methods over the states of a kind; found [nstate*nmethod], uncertainty [nstate*3]
static int summarise(cav_measure_derivative *out, const char *kind, const method *list, int nmethod, int nstate,
                     int repeats, const outcome *found, const double *uncertainty) {
  static const char *const name[] = {"one-sided", "centred", "analytic", "one-sided, default", "centred, default"};
  for (int b = 0; b < 3; b++) {
    for (int k = 0; k < nmethod; k++) {
      int by_scale = list[k].kind != CAV_DERIVATIVE_ANALYTIC && list[k].step == 0;
      double error[STATES], time[STATES * REPEATS], unknown = 0;
      int held = 0, failed = 0, ntime = 0;
      for (int i = 0; i < nstate; i++) {
        const outcome *o = &found[i * nmethod + k];
        unknown = fmax(unknown, uncertainty[3 * i + b]);
        for (int r = 0; r < repeats; r++) time[ntime++] = o->time[r];
        failed += o->failed;
        if (!o->failed) error[held++] = o->error[b];
      }
      double *row = cav_sheet_add(&out->sheet, kind, block_name[b], name[list[k].kind + (by_scale ? 3 : 0)]);
      if (!row) return 0;
      if (list[k].step > 0) row[CAV_DERIVATIVE_STEP] = list[k].step;
      row[CAV_DERIVATIVE_STATES] = nstate;
      row[CAV_DERIVATIVE_ERROR] = cav_measure_quantile(error, held, 0.5);
      row[CAV_DERIVATIVE_ERROR_MAX] = failed ? NAN : cav_measure_quantile(error, held, 1);
      row[CAV_DERIVATIVE_UNCERTAINTY] = unknown;
      row[CAV_DERIVATIVE_TIME] = cav_measure_quantile(time, ntime, 0.5);
      row[CAV_DERIVATIVE_LOW] = cav_measure_quantile(time, ntime, 0.25);
      row[CAV_DERIVATIVE_HIGH] = cav_measure_quantile(time, ntime, 0.75);
      row[CAV_DERIVATIVE_FAILED] = failed;
    }
  }
  return 1;
}

// states: those with most rows, or with fewest
static int choose(const cav_measure *m, int with_rows, int most, const cav_measure_sample **chosen) {
  int n = 0;
  for (int k = 0; k < CAV_MEASURE_BINS && n < most; k++) {
    int bin = with_rows ? CAV_MEASURE_BINS - 1 - k : k;
    for (int i = 0; i < m->nsample && n < most; i++)
      if (m->sample[i].bin == bin && isfinite(m->sample[i].uncertainty) && (!with_rows || m->sample[i].rows > 0))
        chosen[n++] = &m->sample[i];
  }
  return n;
}

cav_status cav_measure_derivatives(cav_measure *m, cav_measure_derivative *out) {
  *out = (cav_measure_derivative){
      .sheet = {.name = "derivative", .ntext = 3, .nnumber = CAV_DERIVATIVE_NUMBERS, .column = columns}};
  method list[METHODS];
  int nmethod = list_methods(m, list), repeats = m->quick ? 2 : REPEATS;
  size_t n = (size_t)m->model->nv * (size_t)m->model->nv;
  double *room = malloc((3 * LEVELS + 9) * n * sizeof *room);
  outcome *found = calloc((size_t)STATES * (size_t)nmethod, sizeof *found);
  cav_status status = room && found ? CAV_OK : CAV_NO_MEMORY;
  cav_measure_section(m, 1.5, 20);
  cav_measure_set(m, &m->options);
  for (int with_rows = 0; with_rows < 2 && !status; with_rows++) {
    const cav_measure_sample *chosen[STATES];
    double *reference = room, *uncertainty = room + 3 * n, *J = room + 6 * n, *table = room + 9 * n,
           unknown[3 * STATES];
    cav_options options = m->options;
    if (!with_rows) options.constraint = 0;
    cav_measure_set(m, &options);
    int nstate = choose(m, with_rows, m->quick ? 2 : STATES, chosen), done = 0;
    if (nstate > 0 && reference_seconds(m, chosen[0]) > m->seconds) {
      out->seconds = reference_seconds(m, chosen[0]);
      nstate = out->seconds > m->seconds ? 0 : nstate;
    }
    memset(found, 0, (size_t)STATES * (size_t)nmethod * sizeof *found);
    for (int i = 0; i < nstate && !status && (i == 0 || !cav_measure_late(m)); i++) {
      status = refer(m, chosen[i], table, reference, uncertainty);
      for (int b = 0; b < 3 && !status; b++) {
        double most = largest(reference + (size_t)b * n, n), off = largest(uncertainty + (size_t)b * n, n);
        unknown[3 * i + b] = most > 0 ? off / most : off;
      }
      for (int r = 0; r < repeats && !status; r++)
        for (int k = 0; k < nmethod; k++) measure(m, chosen[i], &list[k], reference, J, r, &found[i * nmethod + k]);
      if (m->tell(m->context, "derivatives", 0.5 * (with_rows + (double)i / nstate))) status = CAV_INTERRUPTED;
      done = i + 1;
    }
    out->states[with_rows] = done;
    if (!status && done > 0 &&
        !summarise(out, with_rows ? "contacts" : "free", list, nmethod, done, repeats, found, unknown))
      status = CAV_NO_MEMORY;
  }
  free(room);
  free(found);
  return status;
}
