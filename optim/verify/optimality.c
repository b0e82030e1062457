/// How optimal a motion is, from its knots, its problem and the multipliers of its bounds (METHOD.md, 6). With the cost
/// f, the values c(x) of all constraints, their multipliers y, and steps d that keep the linearised constraints and have
/// d'S d <= R^2, the cost's second-order model falls by at most
///
///     max over d of -(g'd + d'B d/2) - mu (d'S d - R^2)/2, and the sum of |y_i| times the way of c_i to its bound,
///
/// with g the gradient of f + y'c, B the Gauss-Newton Hessian of f, S the mean over knots. That holds whatever y and mu
/// >= 0 are: multipliers that are wrong make it larger, never smaller. Equalities (forces that no actuator gives, hard
/// equalities, a duration at the end of its range) need no multipliers from outside: their squares stand in B, which
/// changes nothing for steps that keep them, and their multipliers follow by the iteration of Hestenes and Powell. mu is
/// the best of a geometric series. The curvature of constraints is not in the model.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "envelope.h"
#include "knot_jacobian.h"

/// R: root mean square over knots of all dofs, rad or m, and of the step's logarithm.
static const double radius = 0.5;

/// Squares of equalities, over the largest curvature of the cost; fraction of the cost that the least mu adds.
static const double stiffness = 1e4, least_part = 1e-9;

/// Costs below this count as this. A duration is at the end of its range within this fraction.
static const double least_cost = 1e-6, at_end = 1e-9;

/// Where the whole cost is below the least one, what residuals up to this part of their scale cost is nothing that may be saved.
static const double nothing = 1e-5;

enum { ITERATIONS = 40, SERIES = 60 };

/// An equality over the unknowns, sparse.
typedef struct equality {
  int n, start; ///< of its entries
  double value, square, multiplier;
} equality;

typedef struct model {
  cav_knot_jacobian knot;
  double *gradient; ///< [unknowns] g without the equalities' part; then room [2*unknowns]
  cav_envelope *hessian;
  double *local; ///< [width*width] of one knot
  double slack;  ///< sum of multipliers times ways to their bounds
  double little; ///< cost of residuals that are nothing
  int nequality, equality_room, nentry, entry_room;
  equality *equality;
  int *column;
  double *entry;
} model;

// ---------------------------------------------------------------- assembly

static void add_gradient(model *s, int t, double factor, const double *row) {
  for (int c = 0; c < s->knot.width && factor != 0; c++)
    if (row[c] != 0) s->gradient[cav_knot_jacobian_unknown(&s->knot, t, c)] += factor * row[c];
}

// adds a cost's row. Gauss-Newton's part is the square of its derivative, in windows, whose weight is the step, that of
// the root of the step times the row
static void add_cost(model *s, int t, const cav_knot_row *row, double x, const double *J) {
  int width = s->knot.width, last = width - 1, free_step = s->knot.free_step;
  double root = row->term->norm == CAV_NORM_ABSOLUTE ? sqrt(1 + x * x) : 1;
  // of a norm other than a square, y^2/2 is the norm: the derivative of y, squared
  double second = row->weight * (1 + root) / (2 * root * root), step = free_step ? J[last] : 0;
  add_gradient(s, t, row->weight * x / root, J);
  if (fabs(x) <= nothing) s->little += 0.5 * row->weight * x * x;
  if (free_step && row->windowed) {
    s->gradient[s->knot.unknowns - 1] += row->weight * (row->term->norm == CAV_NORM_ABSOLUTE ? root - 1 : 0.5 * x * x);
    step += x / 2;
  }
  for (int i = 0; i < width; i++) {
    double a = free_step && i == last ? step : J[i];
    if (a == 0) continue;
    for (int j = 0; j <= i; j++) s->local[i * width + j] += second * a * (free_step && j == last ? step : J[j]);
  }
}

// room for one more equality and its entries
static cav_status make_room(model *s) {
  if (s->nequality == s->equality_room) {
    int room = s->equality_room ? 2 * s->equality_room : 256;
    equality *larger = realloc(s->equality, (size_t)room * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    s->equality = larger;
    s->equality_room = room;
  }
  if (s->nentry + s->knot.width <= s->entry_room) return CAV_OK;
  int room = 2 * (s->entry_room + s->knot.width);
  int *column = realloc(s->column, (size_t)room * sizeof *column);
  if (column) s->column = column;
  double *entry = realloc(s->entry, (size_t)room * sizeof *entry);
  if (entry) s->entry = entry;
  if (!column || !entry) return CAV_NO_MEMORY;
  s->entry_room = room;
  return CAV_OK;
}

// adds a row that is to stay as it is; one that no unknown moves holds nothing
static cav_status add_equality(model *s, int t, double value, const double *J) {
  cav_status status = make_room(s);
  if (status != CAV_OK) return status;
  equality *e = s->equality + s->nequality;
  *e = (equality){.start = s->nentry, .value = value};
  for (int c = 0; c < s->knot.width; c++) {
    if (J[c] == 0) continue;
    s->column[s->nentry] = cav_knot_jacobian_unknown(&s->knot, t, c);
    s->entry[s->nentry++] = J[c];
    e->n++;
  }
  s->nequality += e->n > 0;
  return CAV_OK;
}

// adds a bounded row by its multiplier, where that points at a bound that is there
static void add_bounded(model *s, int t, const cav_knot_row *row, double x, const double *J) {
  double y = row->multiplier, way = y > 0 ? row->upper - x : x - row->lower;
  if (y == 0 || !isfinite(y) || !isfinite(way)) return;
  s->slack += fabs(y * way);
  add_gradient(s, t, y, J);
}

static cav_status add_knot(model *s, int t, int nbinding, const cav_binding *binding) {
  const cav_knot_jacobian *k = &s->knot;
  cav_status status = cav_knot_jacobian_find(&s->knot, t, nbinding, binding);
  if (status != CAV_OK) return status;
  memset(s->local, 0, (size_t)k->width * (size_t)k->width * sizeof *s->local);
  for (int i = 0; i < k->rows.n && status == CAV_OK; i++) {
    const cav_knot_row *row = k->rows.row + i;
    const double *J = k->row + (size_t)i * (size_t)k->width, x = k->value[i];
    if (row->term) {
      add_cost(s, t, row, x, J);
    } else if (row->lower == row->upper) {
      status = add_equality(s, t, x - row->lower, J);
    } else {
      add_bounded(s, t, row, x, J);
    }
  }
  // of what is not a number there are entries in columns that are no unknowns; the others are found in the factor
  for (int i = 0; i < k->width; i++) {
    const int row = cav_knot_jacobian_unknown(k, t, i);
    for (int j = 0; j <= i && row >= 0; j++) {
      const double entry = s->local[i * k->width + j];
      const int column = entry != 0 ? cav_knot_jacobian_unknown(k, t, j) : -1;
      if (column >= 0) cav_envelope_add(s->hessian, row, column, entry);
    }
  }
  return status;
}

// the cost of a free duration, and that it stays where it is at the end of its range: *held is 1 at the upper end, -1
// at the lower one, 0 between them
static cav_status add_duration(model *s, const cav_verification *verification, int *held) {
  const cav_problem *p = verification->problem;
  int last = s->knot.unknowns - 1;
  double T = verification->last * verification->h, bend = p->duration_weight * T * T;
  *held = T >= p->duration_most * (1 - at_end) ? 1 : T <= p->duration_least * (1 + at_end) ? -1 : 0;
  s->gradient[last] += bend;
  cav_envelope_add(s->hessian, last, last, bend);
  cav_status status = *held ? make_room(s) : CAV_OK;
  if (!*held || status != CAV_OK) return status;
  s->equality[s->nequality++] = (equality){.n = 1, .start = s->nentry};
  s->column[s->nentry] = last;
  s->entry[s->nentry++] = 1;
  return CAV_OK;
}

static void add_square(model *s, const equality *e, double factor) {
  const int *column = s->column + e->start;
  const double *entry = s->entry + e->start;
  for (int i = 0; i < e->n; i++)
    for (int j = 0; j <= i; j++) cav_envelope_add(s->hessian, column[i], column[j], factor * entry[i] * entry[j]);
}

static void add_squares(model *s) {
  double most = 0;
  for (int i = 0; i < s->knot.unknowns; i++) most = fmax(most, cav_envelope_diagonal(s->hessian, i));
  if (most == 0) most = 1;
  for (int k = 0; k < s->nequality; k++) {
    equality *e = s->equality + k;
    double size = 0;
    for (int i = 0; i < e->n; i++) size += s->entry[e->start + i] * s->entry[e->start + i];
    e->square = stiffness * most / size;
    add_square(s, e, e->square);
  }
}

// ---------------------------------------------------------------- the bound

// what a step may decrease the model by, for the factor at hand: multipliers of equalities until that settles, and what
// these are off by
static double decrease(model *s) {
  int n = s->knot.unknowns;
  double least = INFINITY, *g = s->gradient + n, *d = g + n;
  for (int i = 0; i < ITERATIONS; i++) {
    double is = 0, before = least;
    memcpy(g, s->gradient, (size_t)n * sizeof *g);
    for (int k = 0; k < s->nequality; k++) {
      const equality *e = s->equality + k;
      is += fabs(e->multiplier * e->value);
      for (int j = 0; j < e->n; j++) g[s->column[e->start + j]] += e->multiplier * s->entry[e->start + j];
    }
    memcpy(d, g, (size_t)n * sizeof *d);
    cav_envelope_solve(s->hessian, d);
    for (int j = 0; j < n; j++) is += 0.5 * g[j] * d[j];
    least = fmin(least, is);
    if (least >= before * (1 - 1e-3)) break;
    for (int k = 0; k < s->nequality; k++) {
      equality *e = s->equality + k;
      for (int j = 0; j < e->n; j++) e->multiplier -= e->square * s->entry[e->start + j] * d[s->column[e->start + j]];
    }
  }
  return least;
}

// the least bound over mu; scale: what it is to be small against
static double bound(model *s, double scale) {
  int n = s->knot.unknowns;
  double least = INFINITY, *diagonal = s->gradient + n, mu = 2 * least_part * scale / (radius * radius);
  for (int i = 0; i < SERIES; i++, mu *= 4) {
    for (int j = 0; j < n; j++) diagonal[j] = mu / (s->knot.free_step && j == n - 1 ? 1 : s->knot.blocks);
    if (!cav_envelope_factor(s->hessian, diagonal)) continue;
    double is = decrease(s) + 0.5 * mu * radius * radius;
    if (is >= least) break;
    least = is;
  }
  return least + s->slack;
}

static cav_status model_start(model *s, const cav_verification *verification) {
  cav_status status = cav_knot_jacobian_start(&s->knot, verification);
  const cav_knot_jacobian *k = &s->knot;
  int nv = verification->model->nv, *first = malloc(((size_t)k->unknowns + 1) * sizeof *first);
  s->gradient = calloc(3 * (size_t)k->unknowns + 1, sizeof *s->gradient);
  s->local = malloc(((size_t)k->width * (size_t)k->width + 1) * sizeof *s->local);
  if (status == CAV_OK && (!first || !s->gradient || !s->local)) status = CAV_NO_MEMORY;
  // the ends of a cycle and a free step meet blocks from the first on
  for (int i = 0; i < k->unknowns && status == CAV_OK; i++) {
    int block = i / nv, far = (verification->image && block >= k->blocks - 2) || block == k->blocks;
    first[i] = far || block < 2 ? 0 : (block - 2) * nv;
  }
  if (status == CAV_OK && !(s->hessian = cav_envelope_new(k->unknowns, first))) status = CAV_NO_MEMORY;
  free(first);
  return status;
}

static void model_clear(model *s) {
  cav_knot_jacobian_clear(&s->knot);
  cav_envelope_free(s->hessian);
  free(s->gradient), free(s->local), free(s->equality), free(s->column), free(s->entry);
}

// first [T+2]: where each knot's bindings begin
static cav_status measure(const cav_verification *verification, const int *first, const cav_binding *binding,
                          double cost, double *optimality) {
  model s = {0};
  int held = 0;
  cav_status status = model_start(&s, verification);
  for (int t = 0; t <= verification->last && status == CAV_OK; t++)
    status = add_knot(&s, t, first[t + 1] - first[t], binding + first[t]);
  if (s.knot.free_step && status == CAV_OK) status = add_duration(&s, verification, &held);
  if (status == CAV_OK) {
    add_squares(&s);
    double scale = fmax(cost, least_cost), is = bound(&s, scale);
    equality *end = held ? s.equality + s.nequality - 1 : NULL;
    if (end && end->multiplier * held < 0) {
      // the cost would have the duration back within its range
      add_square(&s, end, -end->square);
      s.nequality--;
      is = bound(&s, scale);
    }
    // costs are sums of squares: no more than all of it can be saved
    *optimality = fmax(fmin(is, cost) - (cost < least_cost ? s.little : 0), 0) / scale;
  }
  model_clear(&s);
  return status;
}

static int by_knot(const void *a, const void *b) {
  const cav_binding *x = a, *y = b;
  return (x->knot > y->knot) - (x->knot < y->knot);
}

cav_status cav_verify_optimality(const cav_problem *problem, const cav_trajectory *trajectory,
                                 const cav_options *contact, int nrow, const cav_binding *row, cav_verdict *verdict,
                                 cav_error *error) {
  cav_verification verification;
  verdict->optimality = NAN;
  cav_status status = cav_verification_begin(&verification, problem, trajectory, contact, NULL, NULL, error);
  if (status == CAV_OK) status = cav_verification_actuators(problem->model, error);
  int last = status == CAV_OK ? verification.last : 0, *first = calloc((size_t)last + 2, sizeof *first);
  cav_binding *sorted = malloc(((size_t)nrow + 1) * sizeof *sorted);
  if (status == CAV_OK && (!first || !sorted)) status = CAV_NO_MEMORY;
  if (status == CAV_OK && verification.image && last < 3) {
    status = CAV_BAD_INPUT;
    if (error) snprintf(error->text, sizeof error->text, "a cycle needs at least three steps");
  }
  if (status == CAV_OK && cav_verdict_feasible(verdict)) {
    if (nrow) memcpy(sorted, row, (size_t)nrow * sizeof *sorted);
    qsort(sorted, (size_t)nrow, sizeof *sorted, by_knot);
    for (int t = 0, i = 0; t <= last + 1; t++) {
      while (i < nrow && sorted[i].knot < t) i++;
      first[t] = i;
    }
    status = measure(&verification, first, sorted, verdict->cost, &verdict->optimality);
  }
  if (status != CAV_OK && error && verification.failure && verification.failure->status) *error = *verification.failure;
  if (status != CAV_OK && error) error->status = status;
  if (status != CAV_OK && error && !*error->text) {
    snprintf(error->text, sizeof error->text, "optimality: %s", cav_status_name(status));
  }
  free(first), free(sorted);
  cav_verification_end(&verification);
  return status;
}
