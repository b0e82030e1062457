/// Parameters of the model estimated with a motion: for given parameters the motion is solved, then both take a step of
/// Gauss and Newton's together, of which the parameters' part is kept (variable projection; Golub and Pereyra, SIAM J. Numer.
/// Anal. 1973, as simplified by Kaufman): the motion's own unknowns are a band, the parameters its border, and what is left of
/// the border after the band is what the record tells of them, whatever the motion (information.c). What it tells alone is
/// asked with all other costs set aside: where these decide, or nothing does, no number is given that looks sure.
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
#include "quantity.h"
#include "windows.h"

enum { ITERATIONS = 40, HALVINGS = 6 };

/// Difference of a parameter, fraction of its value; a step that is predicted to gain less of the cost's logarithm of a
/// likelihood is the last; most ratio of values of one step; where more than this part of the cost should be saved and no step
/// does, the search is stuck; factor by which costs that were scaled become heavier.
static const double difference = 1e-4, settled = 1e-6, most_ratio = 2, stuck = 1e-2, heavier = 100;

/// Weight of costs that are no record where the record's own say is asked for. A combination of which it knows less than a
/// hundredth of all, or less than the rounding of squares leaves of the best known, is not told.
static const double aside = 1e-4, least_part = 1e-2, rounding = 1e-12;

/// Nor is one that it knows to no better than ten thousand times the values: that is the rounding of differences.
static const double least_known = 1e-8;

/// A pivot of the motion below it: nothing tells of an unknown (information.c).
static const double least_pivot = 1e-9;

/// An estimate under way.
typedef struct search {
  cav_problem problem; ///< the given one with a model of its own
  cav_problem records; ///< the same with costs that are no record set aside
  cav_term *term;      ///< [2*nterm] of both
  double scale;        ///< costs are divided by it, and priors
  const cav_problem *given;
  cav_part part;
  int n;
  const cav_parameter *parameter;
  double *value, *mean, *unit, *step, *prior, *off; ///< [n] now; of the priors; that they are counted in; in units
  double *S, *g; ///< [n*n], [n] square of the last factor's corner, and the gradient, in units, times the scale
  cav_information of;
  cav_transcription *tr;
  double **by; ///< [2*nknot] derivatives of dense rows and of constraints
} search;

void cav_estimate_free(cav_estimate *e) {
  if (!e) return;
  if (e->owner) cav_part_clear(e->owner);
  free(e->owner), free(e->value), free(e->told);
  cav_solution_free(e->solution);
  free(e);
}

static cav_estimate *make(int n) {
  cav_estimate *e = calloc(1, sizeof *e);
  size_t size = (size_t)n;
  if (!e) return NULL;
  e->nparameter = n;
  e->value = calloc(5 * size + 2 * size * size + 1, sizeof(double));
  e->told = calloc(2 * size + 1, sizeof(int));
  if (!e->value || !e->told) {
    cav_estimate_free(e);
    return NULL;
  }
  e->error = e->value + size, e->alone = e->error + size, e->pull = e->alone + size, e->seen = e->pull + size;
  e->covariance = e->seen + size, e->combination = e->covariance + size * size;
  e->bound = e->told + size;
  return e;
}

static cav_status fail(cav_error *error, cav_status status, const char *text) {
  if (error) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "parameters: %s", text);
  }
  return status;
}

static int has_prior(const cav_parameter *p) { return p->prior[1] > 0; }

/// Whether a number may be negative: a coordinate.
static int has_sign(const cav_parameter *p) { return cav_parameter_rule_of(p->kind)->components > 1; }

/// Whether a number may vanish, and not be negative.
static int may_vanish(const cav_parameter *p) {
  return p->kind == CAV_PARAMETER_FRICTION || p->kind == CAV_PARAMETER_STIFFNESS || p->kind == CAV_PARAMETER_DAMPING ||
         p->kind == CAV_PARAMETER_ARMATURE;
}

/// An end of the range of a number, that of its kind included.
static double bound_of(const cav_parameter *p, int upper) {
  const double least = may_vanish(p) ? 0 : -INFINITY;
  if (p->range[0] == 0 && p->range[1] == 0) return upper ? INFINITY : least;
  return upper ? p->range[1] : fmax(p->range[0], least);
}

/// Whether a cost compares with something that was measured.
static int is_record(const cav_term *term) {
  if (term->use != CAV_USE_COST || !(term->weight > 0)) return 0;
  switch (term->quantity) {
    case CAV_QUANTITY_TRACK:
    case CAV_QUANTITY_USER:
      return 1;
    case CAV_QUANTITY_SENSOR:
    case CAV_QUANTITY_CONFIGURATION:
    case CAV_QUANTITY_VELOCITY:
    case CAV_QUANTITY_ACCELERATION:
      return term->target != NULL;
    default:
      return 0;
  }
}

/// The model with all parameters at a value each.
static cav_status set_model(search *s, const double *value) {
  return cav_model_set_parameters(s->part.model, s->n, s->parameter, value);
}

// ---------------------------------------------------------------- derivatives

/// Rows at a motion, of the model as it is; NULL with the reason in *status.
static cav_transcription *rows_at(const cav_problem *problem, const cav_solution *solution, cav_status *status) {
  cav_transcription *tr = cav_transcription_new(problem, 1, NULL);
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
static cav_status differentiate(search *s, const cav_problem *problem, const cav_solution *solution, int k) {
  double kept = s->value[k], distance = difference * fmax(fabs(kept), 1e-2 * s->unit[k]), width = 2 * distance;
  cav_transcription *side[2] = {NULL, NULL};
  cav_status status = CAV_OK;
  // at the end of what may be: this side alone
  int low = has_sign(&s->parameter[k]) || kept - distance > 0;
  for (int i = 0; i < 2 && status == CAV_OK; i++) {
    s->value[k] = i ? kept + distance : low ? kept - distance : kept;
    status = set_model(s, s->value);
    if (status == CAV_OK) side[i] = rows_at(problem, solution, &status);
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

/// S = R'R of the parameters in their units, and the gradient R'z, from the corner (R, z).
static void square(search *s) {
  size_t p = (size_t)s->of.factor.border, n = (size_t)s->n, first = p - n - 1;
  const double *R = s->of.factor.corner + first * p + first;
  for (size_t i = 0; i < n; i++) {
    s->g[i] = 0;
    for (size_t k = 0; k <= i; k++) s->g[i] += s->scale * R[k * p + i] * R[k * p + n];
    for (size_t j = 0; j < n; j++) {
      s->S[i * n + j] = 0;
      for (size_t k = 0; k <= (i < j ? i : j); k++) s->S[i * n + j] += s->scale * R[k * p + i] * R[k * p + j];
    }
  }
}

/// S and g at a motion of a problem, all of its costs or those of the record: what it tells of the parameters, whatever
/// the motion. CAV_NOT_CONVERGED: nothing tells of the motion.
static cav_status look(search *s, const cav_problem *problem, const cav_solution *solution) {
  cav_status status;
  release(s);
  if (!(s->tr = rows_at(problem, solution, &status))) return status;
  size_t knots = (size_t)s->tr->nknot, n = (size_t)s->n;
  if (!(s->by = calloc(2 * knots, sizeof *s->by))) return CAV_NO_MEMORY;
  for (size_t t = 0; t < 2 * knots; t++) {
    const cav_knot *knot = &s->tr->knot[t % knots];
    s->by[t] = calloc(n * (size_t)(t < knots ? knot->ndense : knot->layout.count) + 1, sizeof(double));
    if (!s->by[t]) return CAV_NO_MEMORY;
  }
  for (int k = 0; k < s->n && status == CAV_OK; k++) status = differentiate(s, problem, solution, k);
  if (status == CAV_OK) status = cav_information_begin(&s->of, s->tr, s->n);
  if (status != CAV_OK) return status;
  for (int k = 0; k < s->n; k++) s->off[k] = (s->value[k] - s->mean[k]) / s->unit[k];
  s->of.dense_by = s->by, s->of.slot_by = s->by + knots, s->of.prior = s->prior, s->of.off = s->off;
  status = cav_information_factor(&s->of, solution->nrow, solution->row);
  // parameters that nothing tells of are told by name
  if (status == CAV_NOT_CONVERGED && cav_row_factor_least(&s->of.factor, s->n + 1) >= least_pivot) status = CAV_OK;
  if (status == CAV_OK) square(s);
  return status;
}

/// Solves S x = -g over those that are free; 0: S is singular there.
static int solve_free(const search *s, const char *fixed, double *x) {
  int n = s->n, ok = 1;
  double *L = malloc(((size_t)(n * n) + 1) * sizeof *L);
  if (!L) return 0;
  for (int i = 0; i < n && ok; i++) {
    for (int j = 0; j <= i; j++) {
      double sum = fixed[i] || fixed[j] ? i == j : s->S[i * n + j];
      for (int k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
      if (i == j && !(sum > 0)) ok = 0;
      L[i * n + j] = i == j ? sqrt(fmax(sum, 0)) : sum / L[j * n + j];
    }
    x[i] = fixed[i] ? 0 : -s->g[i];
    for (int k = 0; k < i; k++) x[i] -= L[i * n + k] * x[k];
    x[i] /= L[i * n + i];
  }
  for (int i = n; i-- > 0 && ok;) {
    for (int k = i + 1; k < n; k++) x[i] -= L[k * n + i] * x[k];
    x[i] /= L[i * n + i];
  }
  free(L);
  return ok;
}

/// Gauss and Newton's step of the parameters, those at an end of their range that it would leave held there; *gain: what it
/// is predicted to save.
static cav_status find_step(search *s, double *gain) {
  int n = s->n, held = 1;
  char *fixed = calloc((size_t)n + 1, 1);
  if (!fixed) return CAV_NO_MEMORY;
  while (held) {
    held = 0;
    if (!solve_free(s, fixed, s->step)) {
      free(fixed);
      return CAV_NOT_FINITE;
    }
    for (int k = 0; k < n; k++) {
      int out = (s->step[k] > 0 && s->value[k] >= bound_of(&s->parameter[k], 1)) ||
                (s->step[k] < 0 && s->value[k] <= bound_of(&s->parameter[k], 0));
      if (out && !fixed[k]) fixed[k] = 1, held = 1;
    }
  }
  *gain = 0;
  for (int k = 0; k < n; k++) *gain -= 0.5 * s->g[k] * s->step[k];
  free(fixed);
  return CAV_OK;
}

// ---------------------------------------------------------------- search

static double prior_cost(const search *s, const double *value) {
  double sum = 0;
  for (int k = 0; k < s->n; k++) {
    double off = (value[k] - s->mean[k]) / s->unit[k];
    if (has_prior(&s->parameter[k])) sum += 0.5 * off * off;
  }
  return sum / s->scale;
}

/// Longest part of the step that keeps positive numbers within a ratio of what they are; to 0 where they may vanish and
/// the step leads beyond.
static double longest(const search *s) {
  double part = 1;
  for (int k = 0; k < s->n; k++) {
    double way = s->step[k] * s->unit[k], room = fabs(s->value[k]) * (way > 0 ? most_ratio - 1 : 1 - 1 / most_ratio);
    if (has_sign(&s->parameter[k]) || way == 0) continue;
    if (may_vanish(&s->parameter[k]) && way <= -s->value[k]) continue;
    if (s->value[k] > 0) part = fmin(part, room / fabs(way));
    if (s->value[k] == 0 && way < 0) part = 0;
  }
  return part;
}

/// What was spent before a solution is spent on it, too.
static void count(const cav_solution *before, cav_solution *next) {
  if (next) next->iterations += before->iterations, next->seconds += before->seconds;
}

/// Solves the motion anew near where it was, straight to the optimum, and where that fails by the last stage; multipliers
/// times a ratio of costs.
static cav_status solve_near(const search *s, const cav_solve_options *options, const cav_solution *before,
                             double ratio, cav_solution **next, cav_error *error) {
  cav_solve_options o = *options;
  *next = NULL;
  cav_status status = CAV_NOT_CONVERGED;
  // windows begin anew
  int windows = cav_windows_apply(&s->problem);
  double *multiplier = windows ? NULL : malloc(((size_t)before->nmultiplier + 1) * sizeof *multiplier);
  for (int i = 0; i < before->nmultiplier && multiplier; i++) multiplier[i] = ratio * before->multiplier[i];
  if (multiplier) {
    o.first_stage = s->problem.schedule.stages + 1;
    o.nmultiplier = before->nmultiplier, o.multiplier = multiplier;
    status = cav_solve(&s->problem, &o, before->trajectory, next, error);
  }
  free(multiplier);
  if (status != CAV_NOT_CONVERGED && status != CAV_NOT_FINITE) {
    count(before, *next);
    return status;
  }
  cav_solution_free(*next);
  o.first_stage = windows ? 0 : s->problem.schedule.stages;
  o.nmultiplier = 0, o.multiplier = NULL;
  status = cav_solve(&s->problem, &o, before->trajectory, next, error);
  count(before, *next);
  return status;
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
    for (int k = 0; k < s->n; k++)
      s->value[k] = fmin(fmax(kept[k] + part * s->step[k] * s->unit[k], bound_of(&s->parameter[k], 0)),
                         bound_of(&s->parameter[k], 1));
    status = set_model(s, s->value);
    if (status == CAV_OK) status = solve_near(s, options, *solution, 1, &next, error);
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

/// Whether the record tells of a combination (row of axes) of which it knows so much, of the best known and of all.
static int is_told(double known, double best, double all) {
  return known > rounding * best && known > least_part * all && known > least_known;
}

/// The parameters of a combination by name.
static void name_combination(const search *s, const double *axis, char *text, size_t room) {
  double most = 0;
  size_t used = 0;
  for (int k = 0; k < s->n; k++) most = fmax(most, fabs(axis[k]));
  for (int k = 0; k < s->n; k++) {
    char label[CAV_PARAMETER_LABEL];
    if (fabs(axis[k]) < 0.1 * most || used + 1 >= room) continue;
    int n = snprintf(text + used, room - used, "%s%s", used ? ", " : "",
                     cav_parameter_label(s->problem.model, &s->parameter[k], label));
    used += n > 0 ? (size_t)n : 0;
  }
}

/// Refuses combinations without a prior of which the record tells nothing: what comes out would be the other costs' or
/// rounding's. all: [n*n] S of all costs; s->S that of the record.
static cav_status refuse_untold(const search *s, const double *all, cav_error *error) {
  int n = s->n;
  double *own = malloc(((size_t)(2 * n * n) + 1) * sizeof *own), *axes = own ? own + n * n : NULL, best = 0;
  cav_status status = own ? CAV_OK : CAV_NO_MEMORY;
  if (own) memcpy(own, s->S, (size_t)(n * n) * sizeof *own);
  if (own) diagonalise(n, own, axes);
  for (int k = 0; k < n && own; k++) best = fmax(best, own[k * n + k]);
  for (int k = 0; k < n && status == CAV_OK; k++) {
    double prior = 0, sum = 0;
    const double *axis = axes + k * n;
    for (int i = 0; i < n; i++) {
      prior += has_prior(&s->parameter[i]) * axis[i] * axis[i];
      for (int j = 0; j < n; j++) sum += axis[i] * axis[j] * all[i * n + j];
    }
    if (prior > least_part || is_told(own[k * n + k], best, sum)) continue;
    char text[400], names[240] = "";
    name_combination(s, axis, names, sizeof names);
    int several = strchr(names, ',') != NULL;
    snprintf(text, sizeof text,
             "the record does not tell %s%s: %s; give %s an sd, how well it is known beforehand, or %s",
             several ? "apart " : "", names,
             several ? "it sees them together alone" : "no motion or force that was recorded depends on it",
             several ? "one of them" : "it", several ? "leave one out" : "leave it out");
    status = fail(error, CAV_BAD_INPUT, text);
  }
  free(own);
  return status;
}

/// Inverse of a matrix by its eigenvalues and axes, in the parameters' units, onto one of zeros; without end where an
/// eigenvalue is nothing.
static void invert(const search *s, const double *values, const double *axes, double *inverse) {
  int n = s->n;
  double best = 0;
  for (int k = 0; k < n; k++) best = fmax(best, values[k * n + k]);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      for (int k = 0; k < n; k++) {
        double both = s->unit[i] * s->unit[j] * axes[k * n + i] * axes[k * n + j];
        int none = !(values[k * n + k] > rounding * best), small = fabs(axes[k * n + i] * axes[k * n + j]) < 1e-6;
        inverse[i * n + j] += !none ? both / values[k * n + k] : small ? 0 : both * INFINITY;
      }
}

/// Combinations, the best seen first, of s->S without the priors; work [2*n*n].
static void order_combinations(const search *s, cav_estimate *e, double *work) {
  int n = s->n;
  double *axes = work + n * n;
  memcpy(work, s->S, (size_t)(n * n) * sizeof *work);
  for (int k = 0; k < n; k++) work[k * n + k] -= has_prior(&s->parameter[k]);
  diagonalise(n, work, axes);
  for (int i = 0; i < n; i++) {
    int best = -1;
    for (int k = 0; k < n; k++)
      if (!isnan(work[k * n + k]) && (best < 0 || work[k * n + k] > work[best * n + best])) best = k;
    e->seen[i] = fmax(work[best * n + best], 0);
    memcpy(e->combination + i * n, axes + best * n, (size_t)n * sizeof *axes);
    work[best * n + best] = NAN;
  }
}

/// Values and their covariance, from s->S of all costs.
static cav_status tell(const search *s, cav_estimate *e) {
  int n = s->n;
  double *S = calloc(2 * (size_t)(n * n) + 1, sizeof *S);
  if (!S) return CAV_NO_MEMORY;
  memcpy(S, s->S, (size_t)(n * n) * sizeof *S);
  diagonalise(n, S, S + n * n);
  invert(s, S, S + n * n, e->covariance);
  for (int k = 0; k < n; k++) {
    e->value[k] = s->value[k];
    e->error[k] = sqrt(e->covariance[k * n + k]);
    e->bound[k] = s->value[k] <= bound_of(&s->parameter[k], 0) ? -1 : s->value[k] >= bound_of(&s->parameter[k], 1);
  }
  free(S);
  return CAV_OK;
}

/// What the record says alone, from s->S and s->g of it.
static cav_status tell_alone(search *s, cav_estimate *e) {
  int n = s->n;
  size_t size = (size_t)(n * n);
  double *S = calloc(3 * size + (size_t)n + 1, sizeof *S), *inverse = S ? S + 2 * size : NULL;
  char *fixed = calloc((size_t)n + 1, 1);
  if (!S || !fixed) {
    free(S), free(fixed);
    return CAV_NO_MEMORY;
  }
  memcpy(S, s->S, size * sizeof *S);
  diagonalise(n, S, S + size);
  invert(s, S, S + size, inverse);
  int moves = solve_free(s, fixed, inverse + size);
  for (int k = 0; k < n; k++) {
    const double begun = s->unit[k], unit = has_prior(&s->parameter[k]) ? begun : fmax(begun, fabs(s->value[k]));
    e->alone[k] = sqrt(inverse[k * n + k]);
    e->pull[k] = moves ? -inverse[size + (size_t)k] * s->unit[k] : NAN;
    e->told[k] = e->alone[k] <= 0.5 * unit && e->alone[k] <= 3 * e->error[k];
  }
  order_combinations(s, e, S);
  free(S), free(fixed);
  return CAV_OK;
}

/// What the heaviest record weighs beside the unactuated force, which is counted in fractions of the weight.
static double heaviest(const cav_problem *p) {
  double most = 0, weight = p->model->mass * sqrt(p->model->gravity[0] * p->model->gravity[0] +
                                                  p->model->gravity[1] * p->model->gravity[1] +
                                                  p->model->gravity[2] * p->model->gravity[2]);
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    double least = 1, unit = cav_term_stage(term) == CAV_READS_ACCELERATION ? fmax(weight, 1) : 1;
    if (!is_record(term)) continue;
    for (int k = 0; term->track && k < term->track->nchannel; k++)
      least = k ? fmin(least, term->track->channel[k].sd) : term->track->channel[k].sd;
    most = fmax(most, term->weight * unit * unit / (term->scale * term->scale * least * least));
  }
  return most;
}

static void scale_costs(cav_problem *p, cav_term *term, double records, double others) {
  for (int i = 0; i < p->nterm; i++) {
    term[i] = p->term[i];
    term[i].weight *= is_record(&term[i]) ? records : others;
  }
  p->term = term;
  p->residual.force /= sqrt(others), p->residual.torque /= sqrt(others);
}

/// Both problems with costs over s->scale: what costs least does not change when all costs do by one factor, and stages that
/// hold dynamics by a penalty lead nowhere below a record of fractions of a millimetre.
static void scale_problems(search *s) {
  s->problem.term = s->given->term, s->problem.residual = s->given->residual;
  s->records = s->problem;
  scale_costs(&s->records, s->term + s->problem.nterm, 1 / s->scale, aside / s->scale);
  scale_costs(&s->problem, s->term, 1 / s->scale, 1 / s->scale);
  for (int k = 0; k < s->n; k++) s->prior[k] = has_prior(&s->parameter[k]) / s->scale;
}

/// A solution of the scaled problem as one of that which was given.
static void unscale(const search *s, cav_solution *solution) {
  solution->cost *= s->scale;
  for (int i = 0; i < solution->nmultiplier; i++) solution->multiplier[i] *= s->scale;
  for (int i = 0; i < solution->nrow; i++) solution->row[i].multiplier *= s->scale, solution->row[i].pull *= s->scale;
}

/// Refuses at the motion that was found first what the record does not tell.
static cav_status check_told(search *s, cav_estimate *e, cav_error *error) {
  size_t size = (size_t)(s->n * s->n) * sizeof *s->S;
  cav_status status = look(s, &s->problem, e->solution);
  memcpy(e->covariance, s->S, size);
  if (status == CAV_OK) status = look(s, &s->records, e->solution);
  if (status == CAV_OK) status = refuse_untold(s, e->covariance, error);
  memset(e->covariance, 0, size);
  return status;
}

/// Changes the parameters until nothing is gained. *gain: what one more change should save, where none did so; 0: settled.
static cav_status change(search *s, const cav_solve_options *options, cav_estimate *e, double *gain, cav_error *error) {
  cav_status status = CAV_OK;
  for (int taken = 1; status == CAV_OK; e->iterations += taken) {
    status = look(s, &s->problem, e->solution);
    if (status == CAV_OK) status = find_step(s, gain);
    if (status == CAV_NOT_FINITE) return fail(error, status, "their derivatives cannot be taken where the motion is");
    if (status != CAV_OK || !taken || e->iterations == ITERATIONS) return status;
    if (*gain < settled) *gain = taken = 0;
    if (taken) status = take_step(s, options, &e->solution, &taken, error);
    if (*gain == 0) return status;
  }
  return status;
}

/// Goes on with costs a hundred times heavier, at the same parameters. *moved 0: no motion is found there.
static cav_status go_heavier(search *s, const cav_solve_options *options, cav_estimate *e, int *moved,
                             cav_error *error) {
  cav_solution *next = NULL;
  double before = s->scale;
  s->scale = fmax(1, before / heavier);
  scale_problems(s);
  cav_status status = solve_near(s, options, e->solution, before / s->scale, &next, error);
  *moved = status == CAV_OK;
  if (*moved) {
    cav_solution_free(e->solution);
    e->solution = next;
    return CAV_OK;
  }
  cav_solution_free(next);
  s->scale = before;
  scale_problems(s);
  return status == CAV_NOT_CONVERGED || status == CAV_NOT_FINITE ? CAV_OK : status;
}

/// The motion once more with feedback gains.
static void choose_gains(search *s, const cav_solve_options *options, cav_estimate *e) {
  cav_solution *last = NULL;
  cav_error ignored = {0};
  cav_solve_options o = *options;
  o.gains = 1;
  if (solve_near(s, &o, e->solution, 1, &last, &ignored) != CAV_OK || !last) {
    cav_solution_free(last);
    return;
  }
  cav_solution_free(e->solution);
  e->solution = last;
}

static cav_status run(search *s, const cav_solve_options *given, const cav_trajectory *start, cav_estimate *e,
                      cav_error *error) {
  cav_solve_options options = given ? *given : cav_solve_options_default(), rest = options;
  double gain = 0;
  options.gains = rest.gains = 0;
  rest.resume = NULL;
  cav_status status = cav_solve(&s->problem, &options, start, &e->solution, error);
  if (status == CAV_NOT_CONVERGED)
    return fail(
        error, status,
        "no motion was found under the values to begin with; values nearer to what is sought, a guess near the record "
        "(<guess file>) or larger sd of records help");
  if (status == CAV_OK) status = check_told(s, e, error);
  for (int moved = 1; status == CAV_OK && moved;) {
    status = change(s, &rest, e, &gain, error);
    moved = s->scale > 1;
    if (status == CAV_OK && moved) status = go_heavier(s, &rest, e, &moved, error);
  }
  if (status == CAV_OK) status = tell(s, e);
  if (status == CAV_OK) status = look(s, &s->records, e->solution);
  if (status == CAV_OK) status = tell_alone(s, e);
  if (status == CAV_NOT_CONVERGED)
    return fail(error, CAV_BAD_INPUT,
                "the record tells nothing of a part of the motion; give it small weights on <velocity>");
  if (status == CAV_OK && (!given || given->gains)) choose_gains(s, &rest, e);
  if (status != CAV_OK) return status;
  unscale(s, e->solution);
  // where no step costs less the solves' own tolerance is what is left, or something is in the way
  if (gain > fmax(1, stuck * e->solution->cost))
    return fail(
        error, CAV_BAD_INPUT,
        "no change of theirs costs less, though much should: the motion that was found is not near the record; give "
        "a guess near it (<guess file>), or values nearer to what is sought");
  if (e->iterations < ITERATIONS) return CAV_OK;
  return fail(error, CAV_NOT_CONVERGED, "they still move after many changes; the last values are saved");
}

/// A model of its own, and where parameters begin.
static cav_status open(search *s, const cav_problem *problem, cav_error *error) {
  int n = problem->nparameter;
  double most = heaviest(problem);
  *s = (search){.problem = *problem, .given = problem, .n = n, .parameter = problem->parameter};
  if (most == 0)
    return fail(error, CAV_BAD_INPUT,
                "there is nothing that they could be found from: add a record, <track file=...> among costs");
  s->scale = fmax(1, most / problem->schedule.last.penalty);
  char *keep = malloc((size_t)problem->model->nlink + 1);
  size_t size = (size_t)n;
  s->value = calloc(7 * size + size * size + 1, sizeof(double));
  s->term = malloc((2 * (size_t)problem->nterm + 1) * sizeof *s->term);
  if (!keep || !s->value || !s->term) {
    free(keep);
    return CAV_NO_MEMORY;
  }
  memset(keep, 1, (size_t)problem->model->nlink + 1);
  s->mean = s->value + size, s->unit = s->mean + size, s->step = s->unit + size, s->prior = s->step + size;
  s->off = s->prior + size, s->g = s->off + size, s->S = s->g + size;
  cav_status status = cav_part_take(problem->model, keep, &s->part);
  free(keep);
  if (status != CAV_OK) return status;
  s->problem.model = s->part.model;
  for (int k = 0; k < n; k++) {
    const cav_parameter *p = &s->parameter[k];
    double x = cav_model_parameter(problem->model, p);
    s->value[k] = x;
    s->mean[k] = has_prior(p) ? p->prior[0] : x;
    s->unit[k] = has_prior(p) ? p->prior[1] : x != 0 ? fabs(x) : 0.1;
  }
  scale_problems(s);
  return CAV_OK;
}

cav_status cav_estimate_solve(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                              cav_estimate **estimate, cav_error *error) {
  search s = {0};
  *estimate = NULL;
  cav_status status = cav_problem_check(problem, 0, error);
  if (status != CAV_OK) return status;
  if (problem->nparameter < 1) return fail(error, CAV_BAD_INPUT, "the problem has none: <parameter type= ...>");
  if (problem->duration_most > 0)
    return fail(error, CAV_NOT_SUPPORTED, "not with a free duration; fix it with <horizon duration>");
  cav_estimate *e = make(problem->nparameter);
  status = e ? open(&s, problem, error) : CAV_NO_MEMORY;
  if (status == CAV_OK) status = run(&s, options, start, e, error);
  release(&s);
  free(s.value), free(s.term);
  if (e && (e->owner = malloc(sizeof s.part)))
    memcpy(e->owner, &s.part, sizeof s.part), e->model = s.part.model;
  else
    cav_part_clear(&s.part), status = CAV_NO_MEMORY;
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory");
  if (status == CAV_INTERRUPTED) fail(error, status, "stopped before they were found; nothing is saved");
  if (status == CAV_NOT_FINITE)
    fail(error, status,
         "a number that is not finite came up; a guess near the record (<guess file>) or values nearer to what is "
         "sought help");
  if (e && (status == CAV_OK || (status == CAV_NOT_CONVERGED && e->iterations == ITERATIONS))) {
    *estimate = e;
    return status;
  }
  cav_estimate_free(e);
  return status;
}
