/// Forward solvers over the states of a scene: Newton's method stopped by tolerance and by number of iterations, and
/// Gauss-Seidel by number of sweeps, against references converged to rounding. An error is the largest of v_next, m/s or
/// rad/s; a mismatch |inverse(v_next) - u| over the largest force. Gauss-Seidel starts from the impulses of the step
/// before, as it does in a simulation; Newton from v. Methods take turns, so that a slow moment meets them all.
#include <stdlib.h>
#include <string.h>

#include "measure.h"

static const cav_sheet_column columns[] = {
    {"method", "inverse; Newton by tolerance or by iterations; Gauss-Seidel by sweeps"},
    {"rows", "states by their number of constraint rows; all: all of them"},
    {"setting", "relative tolerance, iterations at most, or sweeps"},
    {"states", "states with a reference"},
    {"rows_mean", "their constraint rows, mean"},
    {"time_us", "time of a step, microseconds: median over states of the median over repeats"},
    {"time_low_us", "the same, lower quartile over repeats"},
    {"time_high_us", "the same, upper quartile"},
    {"iterations", "median"},
    {"error_median", "largest error of a velocity after the step, m/s or rad/s, median over states"},
    {"error_max", "the same, largest over states"},
    {"mismatch_median", "largest |inverse(v_next) - u| over the largest force, median over states"},
    {"mismatch_max", "the same, largest over states"},
    {"failed", "states without an answer"}};

enum { REPEATS = 9, METHODS = 64 };
typedef enum method_kind { INVERSE, TOLERANCE, ITERATIONS, SWEEPS } method_kind;
static const char *const kind_name[] = {"inverse", "Newton by tolerance", "Newton by iterations",
                                        "Gauss-Seidel by sweeps"};

typedef struct method {
  method_kind kind;
  double setting;
} method;

// what one method did on one state
typedef struct outcome {
  double time[REPEATS], error, mismatch;
  int iterations, failed;
  int repeats; // 0: there was no time for it
} outcome;

static int list_methods(const cav_measure *m, int sweeps, method *list) {
  static const double tolerance[] = {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14};
  static const int iteration[] = {1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30},
                   sweep[] = {1, 2, 5, 10, 20, 50, 100, 200, 500, 1000};
  int n = 0, skip = m->quick ? 2 : 1;
  list[n++] = (method){INVERSE, 0};
  for (int i = 0; i < 10; i++) list[n++] = (method){TOLERANCE, tolerance[i]};
  for (int i = 0; i < 11; i += skip) list[n++] = (method){ITERATIONS, iteration[i]};
  for (int i = 0; i < (m->quick ? 8 : 10) && sweeps; i++) list[n++] = (method){SWEEPS, sweep[i]};
  return n;
}

static cav_status call(cav_measure *m, const cav_measure_sample *s, const method *k, double *v_next,
                       cav_forward_report *report) {
  switch (k->kind) {
    case INVERSE:
      return cav_inverse(m->model, m->state, s->q, s->v, s->v_next, v_next);
    case TOLERANCE:
      return cav_forward_newton(m->model, m->state, s->q, s->v, s->u, 100, k->setting, v_next, report);
    case ITERATIONS:
      return cav_forward_newton(m->model, m->state, s->q, s->v, s->u, (int)k->setting, 1e-14, v_next, report);
    case SWEEPS:
      break;
  }
  return cav_forward_gpgs(m->model, m->state, s->q, s->v, s->u, (int)k->setting, 0, v_next, report);
}

static void measure(cav_measure *m, const cav_measure_sample *s, const method *k, int repeat, outcome *out) {
  double *x = m->vector[0], *residual = m->vector[1];
  cav_forward_report report = {0};
  // what Gauss-Seidel remembers is the step before
  if (k->kind == SWEEPS) cav_forward_gpgs(m->model, m->state, s->q_before, s->v_before, s->u_before, 50, 0, x, NULL);
  int calls = k->kind == INVERSE ? 10 : 1;
  double begin = cav_measure_processor();
  cav_status status = CAV_OK;
  for (int c = 0; c < calls; c++) status = call(m, s, k, x, &report);
  out->repeats = repeat + 1;
  out->time[repeat] = 1e6 * (cav_measure_processor() - begin) / calls;
  if (repeat > 0) return;
  out->failed = status != CAV_OK && status != CAV_NOT_CONVERGED;
  if (out->failed || k->kind == INVERSE) return;
  out->iterations = report.iterations;
  for (int d = 0; d < m->model->nv; d++) out->error = fmax(out->error, fabs(x[d] - s->v_next[d]));
  out->mismatch = cav_measure_mismatch(m, s->q, s->v, s->u, x, residual);
}

// a row of the sheet: one method over the states of a bin, -1: of all
static int summarise(cav_measure *m, cav_measure_forward *out, const method *k, int bin, int nmethod, int at,
                     const outcome *found, double *work) {
  double *time = work, *ratio = time + m->nsample, *error = ratio + m->nsample * REPEATS,
         *mismatch = error + m->nsample;
  double *iterations = mismatch + m->nsample;
  int n = 0, nratio = 0, held = 0, failed = 0;
  double rows = 0;
  for (int i = 0; i < m->nsample; i++) {
    const outcome *o = &found[i * nmethod + at];
    if (o->repeats == 0 || (bin >= 0 && m->sample[i].bin != bin)) continue;
    double sorted[REPEATS];
    memcpy(sorted, o->time, sizeof sorted);
    time[n] = cav_measure_quantile(sorted, o->repeats, 0.5);
    for (int r = 0; r < o->repeats; r++) ratio[nratio++] = o->time[r] / time[n];
    n++;
    rows += m->sample[i].rows;
    failed += o->failed;
    if (o->failed) continue;
    error[held] = o->error;
    mismatch[held] = o->mismatch;
    iterations[held++] = o->iterations;
  }
  if (n == 0) return 1;
  double *row = cav_sheet_add(&out->sheet, kind_name[k->kind], bin < 0 ? "all" : cav_measure_bin_names[bin], NULL);
  if (!row) return 0;
  double median = cav_measure_quantile(time, n, 0.5);
  row[CAV_FORWARD_STATES] = n;
  row[CAV_FORWARD_ROWS] = rows / n;
  row[CAV_FORWARD_TIME] = median;
  row[CAV_FORWARD_LOW] = median * cav_measure_quantile(ratio, nratio, 0.25);
  row[CAV_FORWARD_HIGH] = median * cav_measure_quantile(ratio, nratio, 0.75);
  row[CAV_FORWARD_FAILED] = failed;
  if (k->kind == INVERSE) return 1;
  row[CAV_FORWARD_SETTING] = k->setting;
  row[CAV_FORWARD_ITERATIONS] = cav_measure_quantile(iterations, held, 0.5);
  row[CAV_FORWARD_ERROR] = cav_measure_quantile(error, held, 0.5);
  row[CAV_FORWARD_MISMATCH] = cav_measure_quantile(mismatch, held, 0.5);
  // one that failed has no bound
  row[CAV_FORWARD_ERROR_MAX] = failed ? NAN : cav_measure_quantile(error, held, 1);
  row[CAV_FORWARD_MISMATCH_MAX] = failed ? NAN : cav_measure_quantile(mismatch, held, 1);
  return 1;
}

// the Pareto set of the rows that are of all states
static void mark(cav_sheet *sheet) {
  double *x = malloc(2 * (size_t)sheet->nrow * sizeof *x + 1), *y = x ? x + sheet->nrow : NULL;
  int *marked = malloc((size_t)sheet->nrow * sizeof *marked + 1);
  for (int r = 0; x && marked && r < sheet->nrow; r++) {
    double error = cav_sheet_get(sheet, r, CAV_FORWARD_ERROR_MAX);
    int counts = !strcmp(sheet->row[r].label[1], "all") && error != CAV_SHEET_NONE;
    x[r] = counts ? cav_sheet_get(sheet, r, CAV_FORWARD_TIME) : NAN;
    y[r] = counts ? error : NAN;
  }
  if (x && marked) {
    cav_html_pareto(sheet->nrow, x, y, marked);
    for (int r = 0; r < sheet->nrow; r++) sheet->row[r].marked = marked[r];
  } else {
    sheet->lost++;
  }
  free(x);
  free(marked);
}

cav_status cav_measure_forwards(cav_measure *m, cav_measure_forward *out) {
  *out = (cav_measure_forward){
      .sheet = {.name = "forward", .ntext = 2, .nnumber = CAV_FORWARD_NUMBERS, .column = columns}};
  method list[METHODS];
  if (m->options.smoothing > 0)
    out->sweeps_missing = "Gauss-Seidel knows the exact law alone, and this scene's is smoothed";
  else if (m->options.next_gap == CAV_NEXT_GAP_EXACT || m->options.next_slip == CAV_NEXT_SLIP_EXACT)
    out->sweeps_missing = "Gauss-Seidel does not follow contacts to the end of the step, as this scene's law does";
  int nmethod = list_methods(m, !out->sweeps_missing, list), repeats = m->quick ? 3 : REPEATS;
  size_t ns = (size_t)m->nsample;
  outcome *found = calloc(ns * (size_t)nmethod + 1, sizeof *found);
  double *work = calloc(ns * (4 + REPEATS) + 1, sizeof *work);
  cav_status status = found && work ? CAV_OK : CAV_NO_MEMORY;
  cav_measure_section(m, 2.5, 25);
  cav_measure_set(m, &m->options);
  for (int i = 0; i < m->nsample; i++) {
    double known = m->sample[i].uncertainty;
    if (known <= CAV_MEASURE_KNOWN) out->uncertainty = fmax(out->uncertainty, known);
  }
  for (int r = 0; r < repeats && !status && !cav_measure_late(m); r++) {
    // a state is measured by all methods or by none, the first of them in any case
    for (int i = 0; i < m->nsample && !status && (i == 0 || !cav_measure_late(m)); i++) {
      for (int k = 0; k < nmethod; k++)
        if (m->sample[i].uncertainty <= CAV_MEASURE_KNOWN)
          measure(m, &m->sample[i], &list[k], r, &found[i * nmethod + k]);
      if (m->tell(m->context, "forward solvers", (r + (double)i / m->nsample) / repeats)) status = CAV_INTERRUPTED;
    }
  }
  for (int i = 0; i < m->nsample; i++) {
    out->without += !(m->sample[i].uncertainty <= CAV_MEASURE_KNOWN);
    out->states += found && found[i * nmethod].repeats > 0;
  }
  out->unmeasured = m->nsample - out->without - out->states;
  for (int k = 0; k < nmethod && !status; k++)
    for (int bin = -1; bin < CAV_MEASURE_BINS && !status; bin++)
      if (!summarise(m, out, &list[k], bin, nmethod, k, found, work)) status = CAV_NO_MEMORY;
  if (!status) mark(&out->sheet);
  free(found);
  free(work);
  return status;
}
