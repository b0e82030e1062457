/// Parameters of the model estimated with a motion: for given parameters the motion is solved, then both take a step of
/// Gauss and Newton's together, of which the parameters' part is kept (variable projection; Golub and Pereyra, SIAM J. Numer.
/// Anal. 1973, as simplified by Kaufman): the motion's own unknowns are a band, the parameters its border, and what is left of
/// the border after the band is what the record tells of them, whatever the motion (information.c).
///
/// Derivatives of rows by parameters are centred differences of residuals at the knots as they are. A contact that carries
/// next to nothing may come or go between them: then the side that has the same rows counts, or none.
#include "cavort/estimate.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "information.h"
#include "part.h"
#include "problem_check.h"

enum { ITERATIONS = 20, HALVINGS = 6 };

/// Difference of a parameter, fraction of its value; a step that is predicted to gain less of the cost's logarithm of a
/// likelihood is the last; most and least ratio of values of one step.
static const double difference = 1e-4, settled = 1e-6, most_ratio = 2;

/// An estimate under way.
typedef struct search {
  cav_problem problem; ///< the given one with a model of its own
  cav_part part;
  int n;
  const cav_parameter *parameter;
  double *value, *mean, *unit,
      *step; ///< [n] now; of the priors; that they are counted in; of the last factor, in units
  cav_information of;
  cav_transcription *tr;
  double **by; ///< [2*nknot] derivatives of dense rows and of constraints
  double *prior, *off;
} search;

void cav_estimate_free(cav_estimate *e) {
  if (!e) return;
  if (e->owner) cav_part_clear(e->owner);
  free(e->owner), free(e->value), free(e->error), free(e->covariance), free(e->seen), free(e->combination);
  cav_solution_free(e->solution);
  free(e);
}

static cav_estimate *make(int n) {
  cav_estimate *e = calloc(1, sizeof *e);
  size_t size = (size_t)n;
  if (!e) return NULL;
  e->nparameter = n;
  e->value = calloc(size + 1, sizeof(double));
  e->error = calloc(size + 1, sizeof(double));
  e->covariance = calloc(size * size + 1, sizeof(double));
  e->seen = calloc(size + 1, sizeof(double));
  e->combination = calloc(size * size + 1, sizeof(double));
  if (e->value && e->error && e->covariance && e->seen && e->combination) return e;
  cav_estimate_free(e);
  return NULL;
}

static cav_status fail(cav_error *error, cav_status status, const char *text) {
  if (error) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "parameters: %s", text);
  }
  return status;
}

/// The model with all parameters at a value each.
static cav_status set_model(search *s, const double *value) {
  cav_status status = CAV_OK;
  for (int k = 0; k < s->n && status == CAV_OK; k++)
    status = cav_model_set_parameter(s->part.model, &s->parameter[k], value[k]);
  return status;
}

// ---------------------------------------------------------------- derivatives

/// Rows at a motion, of the model as it is; NULL with the reason in *status.
static cav_transcription *rows_at(const search *s, const cav_solution *solution, cav_status *status) {
  cav_transcription *tr = cav_transcription_new(&s->problem, 1, NULL);
  cav_trajectory *at = cav_trajectory_copy(solution->trajectory);
  *status = tr && at && cav_transcription_keep_rows(tr) ? CAV_OK : CAV_NO_MEMORY;
  if (*status == CAV_OK) {
    tr->options = solution->contact;
    tr->penalty = (cav_penalties){0};
    tr->gradient_only = 1;
    *status = cav_transcription_linearise(tr, at);
  }
  cav_trajectory_free(at);
  if (*status == CAV_OK) return tr;
  cav_transcription_free(tr);
  return NULL;
}

/// Derivatives by parameter k from rows on both sides, width apart, beside those at the motion.
static void difference_rows(search *s, int k, const cav_transcription *low, const cav_transcription *high,
                            double width) {
  size_t n = (size_t)s->n;
  for (int t = 0; t < s->tr->nknot; t++) {
    const cav_knot *is = &s->tr->knot[t], *a = &low->knot[t], *b = &high->knot[t];
    int below = a->ndense == is->ndense, above = b->ndense == is->ndense;
    double per = s->unit[k] / (below && above ? width : 0.5 * width);
    double *dense = s->by[t], *slot = s->by[s->tr->nknot + t];
    for (int i = 0; i < is->ndense; i++)
      dense[(size_t)i * n + (size_t)k] =
          below || above ? per * ((above ? b : is)->rest[i] - (below ? a : is)->rest[i]) : 0;
    for (int i = 0; i < is->layout.count; i++)
      slot[(size_t)i * n + (size_t)k] = s->unit[k] / width * (b->slot[i].value - a->slot[i].value);
  }
}

/// Derivatives of all rows by parameter k.
static cav_status differentiate(search *s, const cav_solution *solution, int k) {
  double kept = s->value[k], distance = difference * fmax(fabs(kept), 1e-2 * s->unit[k]), width = 2 * distance;
  cav_transcription *side[2] = {NULL, NULL};
  cav_status status = CAV_OK;
  // at the end of what may be: this side alone
  int low = s->parameter[k].kind == CAV_PARAMETER_COM || kept - distance > 0;
  for (int i = 0; i < 2 && status == CAV_OK; i++) {
    s->value[k] = i ? kept + distance : low ? kept - distance : kept;
    status = set_model(s, s->value);
    if (status == CAV_OK) side[i] = rows_at(s, solution, &status);
  }
  s->value[k] = kept;
  if (status == CAV_OK) difference_rows(s, k, side[0], side[1], low ? width : distance);
  cav_transcription_free(side[0]), cav_transcription_free(side[1]);
  cav_status back = set_model(s, s->value);
  return status == CAV_OK ? back : status;
}

static void release(search *s) {
  for (int t = 0; s->by && s->tr && t < 2 * s->tr->nknot; t++) free(s->by[t]);
  free(s->by);
  cav_information_clear(&s->of);
  cav_transcription_free(s->tr);
  s->by = NULL, s->tr = NULL;
}

/// What the record tells at a motion, and the step of the parameters; *gain: what it is predicted to save.
static cav_status find_step(search *s, const cav_solution *solution, double *gain) {
  cav_status status;
  release(s);
  if (!(s->tr = rows_at(s, solution, &status))) return status;
  size_t knots = (size_t)s->tr->nknot, n = (size_t)s->n;
  if (!(s->by = calloc(2 * knots, sizeof *s->by))) return CAV_NO_MEMORY;
  for (size_t t = 0; t < 2 * knots; t++) {
    const cav_knot *knot = &s->tr->knot[t % knots];
    s->by[t] = calloc(n * (size_t)(t < knots ? knot->ndense : knot->layout.count) + 1, sizeof(double));
    if (!s->by[t]) return CAV_NO_MEMORY;
  }
  for (int k = 0; k < s->n && status == CAV_OK; k++) status = differentiate(s, solution, k);
  if (status == CAV_OK) status = cav_information_begin(&s->of, s->tr, s->n);
  if (status != CAV_OK) return status;
  for (int k = 0; k < s->n; k++) {
    s->prior[k] = isfinite(s->parameter[k].deviation) ? 1 : 0;
    s->off[k] = (s->value[k] - s->mean[k]) / s->unit[k];
  }
  s->of.dense_by = s->by, s->of.slot_by = s->by + knots, s->of.prior = s->prior, s->of.off = s->off;
  status = cav_information_factor(&s->of, solution->nrow, solution->row);
  if (status != CAV_OK) return status;
  // of (R, z) at the corner: step = -R^-1 z, gain z'z/2
  size_t p = (size_t)s->of.factor.border, first = p - n - 1;
  const double *R = s->of.factor.corner + first * p + first;
  *gain = 0;
  for (size_t i = n; i-- > 0;) {
    double x = -R[i * p + n];
    *gain += 0.5 * x * x;
    for (size_t j = i + 1; j < n; j++) x -= R[i * p + j] * s->step[j];
    s->step[i] = x / R[i * p + i];
  }
  return CAV_OK;
}

// ---------------------------------------------------------------- search

static double prior_cost(const search *s, const double *value) {
  double sum = 0;
  for (int k = 0; k < s->n; k++) {
    double off = (value[k] - s->mean[k]) / s->unit[k];
    if (isfinite(s->parameter[k].deviation)) sum += 0.5 * off * off;
  }
  return sum;
}

/// Longest part of the step that keeps positive numbers within a ratio of what they are.
static double longest(const search *s) {
  double part = 1;
  for (int k = 0; k < s->n; k++) {
    double way = s->step[k] * s->unit[k], room = fabs(s->value[k]) * (way > 0 ? most_ratio - 1 : 1 - 1 / most_ratio);
    if (s->parameter[k].kind == CAV_PARAMETER_COM || way == 0) continue;
    if (s->value[k] > 0) part = fmin(part, room / fabs(way));
    if (s->value[k] == 0 && way < 0) part = 0;
  }
  return part;
}

/// Solves the motion anew at a part of the step, shorter until it costs less. *solution moves on where it does.
static cav_status take_step(search *s, const cav_solve_options *options, cav_solution **solution, int *taken,
                            cav_error *error) {
  double cost = (*solution)->cost + prior_cost(s, s->value), part = longest(s);
  double *kept = malloc(((size_t)s->n + 1) * sizeof *kept);
  if (!kept) return CAV_NO_MEMORY;
  memcpy(kept, s->value, (size_t)s->n * sizeof *kept);
  cav_status status = CAV_OK;
  *taken = 0;
  for (int i = 0; i < HALVINGS && part > 0 && !*taken; i++, part /= 2) {
    cav_solution *next = NULL;
    for (int k = 0; k < s->n; k++) s->value[k] = kept[k] + part * s->step[k] * s->unit[k];
    status = set_model(s, s->value);
    if (status == CAV_OK) status = cav_solve(&s->problem, options, (*solution)->trajectory, &next, error);
    if (status == CAV_OK && next->cost + prior_cost(s, s->value) < cost) {
      cav_solution_free(*solution);
      *solution = next;
      *taken = 1;
      break;
    }
    cav_solution_free(next);
    if (status != CAV_OK && status != CAV_NOT_CONVERGED && status != CAV_NOT_FINITE) break;
    status = CAV_OK;
  }
  if (!*taken) {
    memcpy(s->value, kept, (size_t)s->n * sizeof *kept);
    cav_status back = set_model(s, s->value);
    if (status == CAV_OK) status = back;
  }
  free(kept);
  return status;
}

/// S of the parameters in their units: R'R.
static void square(const search *s, double *S) {
  size_t p = (size_t)s->of.factor.border, n = (size_t)s->n, first = p - n - 1;
  const double *R = s->of.factor.corner + first * p + first;
  for (size_t i = 0; i < n; i++)
    for (size_t j = 0; j < n; j++) {
      S[i * n + j] = 0;
      for (size_t k = 0; k <= (i < j ? i : j); k++) S[i * n + j] += R[k * p + i] * R[k * p + j];
    }
}

/// Eigenvalues of a symmetric matrix [n*n] onto its diagonal by Jacobi's rotations, eigenvectors by rows.
static void diagonalise(int n, double *A, double *rows) {
  for (int i = 0; i < n * n; i++) rows[i] = i % (n + 1) == 0;
  for (int sweep = 0; sweep < 50; sweep++)
    for (int p = 0; p < n; p++)
      for (int q = p + 1; q < n; q++) {
        if (A[p * n + q] == 0) continue;
        double theta = 0.5 * (A[q * n + q] - A[p * n + p]) / A[p * n + q];
        double t = (theta < 0 ? -1 : 1) / (fabs(theta) + hypot(theta, 1)), c = 1 / hypot(t, 1), r = t * c;
        for (int k = 0; k < n; k++) {
          double a = A[k * n + p], b = A[k * n + q];
          A[k * n + p] = c * a - r * b, A[k * n + q] = r * a + c * b;
        }
        for (int k = 0; k < n; k++) {
          double a = A[p * n + k], b = A[q * n + k];
          A[p * n + k] = c * a - r * b, A[q * n + k] = r * a + c * b;
          a = rows[p * n + k], b = rows[q * n + k];
          rows[p * n + k] = c * a - r * b, rows[q * n + k] = r * a + c * b;
        }
      }
}

/// Covariance, and what the record alone sees, from the last factor.
static cav_status tell(const search *s, cav_estimate *e) {
  int n = s->n;
  double *S = calloc(3 * (size_t)(n * n) + 1, sizeof *S), *axes = S ? S + n * n : NULL,
         *known = S ? axes + n * n : NULL;
  if (!S) return CAV_NO_MEMORY;
  square(s, S);
  memcpy(known, S, (size_t)(n * n) * sizeof *S);
  diagonalise(n, S, axes);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      for (int k = 0; k < n; k++)
        e->covariance[i * n + j] += s->unit[i] * s->unit[j] * axes[k * n + i] * axes[k * n + j] / S[k * n + k];
  for (int k = 0; k < n; k++) {
    e->value[k] = s->value[k];
    e->error[k] = sqrt(e->covariance[k * n + k]);
    known[k * n + k] -= s->prior[k];
  }
  diagonalise(n, known, axes);
  for (int i = 0; i < n; i++) {
    int best = -1;
    for (int k = 0; k < n; k++)
      if (!isnan(known[k * n + k]) && (best < 0 || known[k * n + k] > known[best * n + best])) best = k;
    e->seen[i] = fmax(known[best * n + best], 0);
    memcpy(e->combination + i * n, axes + best * n, (size_t)n * sizeof *axes);
    known[best * n + best] = NAN;
  }
  free(S);
  return CAV_OK;
}

static cav_status run(search *s, const cav_solve_options *given, const cav_trajectory *start, cav_estimate *e,
                      cav_error *error) {
  cav_solve_options options = given ? *given : cav_solve_options_default(), rest = options;
  double gain = INFINITY;
  int taken = 1;
  options.gains = rest.gains = 0;
  cav_status status = cav_solve(&s->problem, &options, start, &e->solution, error);
  if (status != CAV_OK) return status;
  // near where it was: the last stage, and what follows
  rest.first_stage = s->problem.schedule.stages;
  rest.resume = NULL, rest.nmultiplier = 0;
  for (; status == CAV_OK; e->iterations++) {
    status = find_step(s, e->solution, &gain);
    if (status == CAV_NOT_CONVERGED)
      return fail(error, CAV_BAD_INPUT,
                  "the record tells nothing of one of them, or of the motion; give it a prior deviation, the motion "
                  "small weights on <velocity>");
    if (status != CAV_OK || gain < settled || !taken || e->iterations == ITERATIONS) break;
    status = take_step(s, &rest, &e->solution, &taken, error);
  }
  if (status == CAV_OK) status = tell(s, e);
  // where no step costs less the solves' own tolerance is what is left
  return status == CAV_OK && e->iterations == ITERATIONS && taken ? CAV_NOT_CONVERGED : status;
}

/// A model of its own, and where parameters begin.
static cav_status open(search *s, const cav_problem *problem, int n, const cav_parameter *parameter, cav_error *error) {
  *s = (search){.problem = *problem, .n = n, .parameter = parameter};
  char *keep = malloc((size_t)problem->model->nlink + 1);
  size_t size = (size_t)n;
  s->value = calloc(6 * size + 1, sizeof(double));
  if (!keep || !s->value) {
    free(keep);
    return CAV_NO_MEMORY;
  }
  memset(keep, 1, (size_t)problem->model->nlink + 1);
  s->mean = s->value + size, s->unit = s->mean + size, s->step = s->unit + size, s->prior = s->step + size;
  s->off = s->prior + size;
  cav_status status = cav_part_take(problem->model, keep, &s->part);
  free(keep);
  if (status != CAV_OK) return status;
  s->problem.model = s->part.model;
  for (int k = 0; k < n; k++) {
    double x = cav_model_parameter(problem->model, &parameter[k]), deviation = parameter[k].deviation;
    if (isnan(x) || !(deviation > 0)) {
      if (error) {
        *error = (cav_error){.status = CAV_BAD_INPUT};
        snprintf(error->text, sizeof error->text,
                 "parameter %d: the model has no such object (a body that moves and weighs, a geom, a joint), or its "
                 "deviation is not above 0",
                 k);
      }
      return CAV_BAD_INPUT;
    }
    s->value[k] = s->mean[k] = x;
    s->unit[k] = isfinite(deviation) ? deviation : x != 0 ? fabs(x) : 0.1;
  }
  return CAV_OK;
}

cav_status cav_estimate_solve(const cav_problem *problem, int nparameter, const cav_parameter *parameter,
                              const cav_solve_options *options, const cav_trajectory *start, cav_estimate **estimate,
                              cav_error *error) {
  search s = {0};
  *estimate = NULL;
  cav_status status = cav_problem_check(problem, 0, error);
  if (status != CAV_OK) return status;
  if (nparameter < 1) return fail(error, CAV_BAD_INPUT, "there have to be some");
  if (problem->duration_most > 0) return fail(error, CAV_NOT_SUPPORTED, "not with a free duration");
  cav_estimate *e = make(nparameter);
  status = e ? open(&s, problem, nparameter, parameter, error) : CAV_NO_MEMORY;
  if (status == CAV_OK) status = run(&s, options, start, e, error);
  release(&s);
  free(s.value);
  if (e && (e->owner = malloc(sizeof s.part)))
    memcpy(e->owner, &s.part, sizeof s.part), e->model = s.part.model;
  else
    cav_part_clear(&s.part), status = CAV_NO_MEMORY;
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory");
  if (e && (status == CAV_OK || (status == CAV_NOT_CONVERGED && e->iterations == ITERATIONS))) {
    *estimate = e;
    return status;
  }
  cav_estimate_free(e);
  return status;
}
