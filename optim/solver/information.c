/// What a motion's costs and the rows that hold tell of its unknowns, as a triangular factor of rows (row_factor.c).
///
/// Rows that hold (equalities, and bounds with a multiplier) enter with a large weight, counted in what the costs have
/// along the row: with D their diagonal, stiffness/(r D^-1 r'). Beside them what costs tell of slow deviations would
/// drown in the rounding of squares, so rows are factored, not their sum; of costs whose rows are added at once (those of
/// single dofs) those of a pivoted Cholesky factor of their Hessian, which no parameter changes. Unknowns are counted in
/// roots of D.
#include "information.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double stiffness = 1e14;

/// Costs below this fraction of the largest tell nothing of an unknown; so does a pivot below it, of unknowns in roots
/// of D.
static const double nothing = 1e-13, least_pivot = 1e-9;

/// So near its bound a row with a multiplier is held by it, scaled: farther inside the multiplier is what rounding left.
static const double at_bound = 1e-4;

static int is_held(const cav_binding *row) {
  double inside = row->multiplier > 0 ? row->upper - row->value : row->value - row->lower;
  return row->multiplier != 0 && inside <= at_bound;
}

/// Notes which rows hold: equalities, and bounds that a binding with a multiplier names.
static void find_holding(cav_information *f, int nrow, const cav_binding *row) {
  const cav_transcription *tr = f->tr;
  cav_binding own;
  for (int t = 0, k = 0; t < tr->nknot; t++) {
    f->first[t] = k;
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++)
      f->holds[k] = !f->merit && tr->knot[t].slot[i].lower == tr->knot[t].slot[i].upper;
  }
  for (int n = 0; n < nrow; n++) {
    int t = row[n].knot;
    if (!is_held(&row[n]) || t < 0 || t >= tr->nknot) continue;
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      cav_transcription_origin(tr, t, i, &own);
      if (own.kind == row[n].kind && own.object == row[n].object && own.component == row[n].component)
        f->holds[f->first[t] + i] = 1;
    }
  }
}

static int unknown_of(const cav_transcription *tr, int t, int c) {
  int block = cav_transcription_block(tr, t, c / tr->nv);
  return block < 0 ? -1 : block * tr->nv + c % tr->nv;
}

/// Weight of a row that holds, by what costs have along it; 0: no unknown moves it.
static double weight_of(const cav_information *f, int t, const double *row, double most) {
  double size = 0, all = 0;
  for (int c = 0; c < 3 * f->tr->nv; c++) {
    int k = unknown_of(f->tr, t, c);
    if (k < 0) continue;
    if (f->scale[k] > 0) size += row[c] * row[c] / f->scale[k];
    all += row[c] * row[c];
  }
  if (all == 0) return 0;
  return size > 0 ? stiffness / size : stiffness * most / all;
}

/// Diagonal of a knot's costs.
static double cost_square(const cav_knot *knot, int width, int c) {
  double sum = knot->hessian[c * width + c];
  for (int i = 0; i < knot->ndense; i++) sum += knot->dense[i * width + c] * knot->dense[i * width + c];
  return sum;
}

/// Roots of D: of the costs' diagonal, where that is nothing of what the rows that hold have.
static void find_scale(cav_information *f) {
  cav_transcription *tr = f->tr;
  int width = 3 * tr->nv, n = f->blocks * tr->nv;
  double most = 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int c = 0; c < width; c++)
      if (unknown_of(tr, t, c) >= 0) f->scale[unknown_of(tr, t, c)] += cost_square(&tr->knot[t], width, c);
  for (int k = 0; k < n; k++) most = fmax(most, f->scale[k]);
  for (int k = 0; k < n; k++) f->scale[k] = f->scale[k] > nothing * most ? f->scale[k] : 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      if (!f->holds[f->first[t] + i]) continue;
      const double *r = tr->knot[t].slot_row + (size_t)i * (size_t)width, weight = weight_of(f, t, r, most);
      for (int c = 0; c < width && weight > 0; c++) {
        int k = unknown_of(tr, t, c);
        // those without a cost are negative meanwhile
        if (k >= 0 && f->scale[k] <= 0) f->scale[k] -= weight / stiffness * r[c] * r[c];
      }
    }
  for (int k = 0; k < n; k++) f->scale[k] = f->scale[k] != 0 ? sqrt(fabs(f->scale[k])) : 1;
}

/// Gradient of a knot's sparse costs over scaled unknowns, [3nv].
static void sparse_gradient(const cav_information *f, int t, double *g) {
  const cav_knot *knot = &f->tr->knot[t];
  int width = 3 * f->tr->nv;
  for (int c = 0; c < width; c++) {
    int k = unknown_of(f->tr, t, c);
    g[c] = knot->gradient[c];
    for (int i = 0; i < knot->ndense; i++) g[c] -= knot->rest[i] * knot->dense[i * width + c];
    g[c] = k < 0 ? 0 : g[c] / f->scale[k];
  }
}

/// Rows of a knot's sparse costs, [3nv+1]: of the pivoted Cholesky factor of their Hessian over scaled unknowns, each with
/// the residual that goes with their gradient; their number. H, g are scratch.
static int factor_costs(const cav_information *f, int t, double *H, double *g, double *rows) {
  int width = 3 * f->tr->nv, n = 0;
  double most = 0;
  const double *lower = f->tr->knot[t].hessian;
  sparse_gradient(f, t, g);
  for (int i = 0; i < width; i++)
    for (int j = 0; j < width; j++) {
      int a = unknown_of(f->tr, t, i), b = unknown_of(f->tr, t, j);
      double x = i >= j ? lower[i * width + j] : lower[j * width + i];
      H[i * width + j] = a < 0 || b < 0 ? 0 : x / (f->scale[a] * f->scale[b]);
    }
  for (; n < width; n++) {
    int p = 0;
    for (int i = 1; i < width; i++) p = H[i * width + i] > H[p * width + p] ? i : p;
    double pivot = H[p * width + p], root = sqrt(fmax(pivot, 0));
    most = fmax(most, pivot);
    if (!(pivot > width * 1e-16 * most)) break;
    double *row = rows + (size_t)n * (size_t)(width + 1), rest = g[p] / root;
    for (int i = 0; i < width; i++) row[i] = H[p * width + i] / root;
    row[width] = rest;
    for (int i = 0; i < width; i++)
      for (int j = 0; j < width && row[i] != 0; j++) H[i * width + j] -= row[i] * row[j];
    for (int i = 0; i < width; i++) H[p * width + i] = H[i * width + p] = 0, g[i] -= row[i] * rest;
  }
  return n;
}

/// Adds a row over the columns of knot t to those of the factor, times root; scaled 1: over scaled unknowns.
static void lay(const cav_information *f, int t, const double *row, double root, int scaled, double *to) {
  int nv = f->tr->nv, first = f->factor.next * nv, core = f->core * nv;
  for (int c = 0; c < 3 * nv; c++) {
    int k = unknown_of(f->tr, t, c);
    if (k >= 0 && row[c] != 0)
      to[k < core ? k - first : 3 * nv + k - core] += root * row[c] / (scaled ? 1 : f->scale[k]);
  }
}

/// Adds derivatives by the parameters (NULL: none) and the residual, times root, to a row of the factor.
static void lay_rest(const cav_information *f, const double *by, double rest, double root, double *to) {
  double *out = to + 3 * f->tr->nv + f->factor.border - f->nparameter - 1;
  for (int k = 0; k < f->nparameter && by; k++) out[k] += root * by[k];
  if (f->residuals) out[f->nparameter] += root * rest;
}

/// Adds the row of a constraint that holds, if an unknown moves it.
static void lay_holding(const cav_information *f, int t, int i, double *to) {
  cav_transcription *tr = f->tr;
  int width = 3 * tr->nv;
  const double *r = tr->knot[t].slot_row + (size_t)i * (size_t)width;
  const cav_slot *slot = &tr->knot[t].slot[i];
  double size = 0, middle = 0.5 * (slot->lower + slot->upper), bound = slot->value > middle ? slot->upper : slot->lower;
  for (int c = 0; c < width; c++) {
    int k = unknown_of(tr, t, c);
    if (k >= 0) size += r[c] * r[c] / (f->scale[k] * f->scale[k]);
  }
  if (size == 0) return;
  lay(f, t, r, sqrt(stiffness / size), 0, to);
  // of one that is open on a side the bound that is there
  if (!isfinite(middle)) bound = isfinite(slot->upper) ? slot->upper : slot->lower;
  lay_rest(f, f->nparameter ? f->slot_by[t] + i * f->nparameter : NULL, slot->value - bound, sqrt(stiffness / size),
           to);
}

/// Adds all rows of knot t to the factor.
static cav_status add_knot(cav_information *f, int t) {
  cav_transcription *tr = f->tr;
  const cav_knot *knot = &tr->knot[t];
  int width = 3 * tr->nv, across = width + f->factor.border;
  int n = factor_costs(f, t, f->square, f->square + width * width, f->row);
  double *to = cav_row_factor_add(&f->factor, n + knot->ndense + (f->merit ? 0 : knot->layout.count));
  if (!to) return CAV_NO_MEMORY;
  for (int i = 0; i < n; i++, to += across) {
    const double *row = f->row + (size_t)i * (size_t)(width + 1);
    lay(f, t, row, 1, 1, to);
    lay_rest(f, NULL, row[width], 1, to);
  }
  for (int i = 0; i < knot->ndense; i++, to += across) {
    lay(f, t, knot->dense + (size_t)i * (size_t)width, 1, 0, to);
    lay_rest(f, f->nparameter ? f->dense_by[t] + i * f->nparameter : NULL, knot->rest[i], 1, to);
  }
  for (int i = 0; i < knot->layout.count; i++, to += across)
    if (f->holds[f->first[t] + i]) lay_holding(f, t, i, to);
  return CAV_OK;
}

/// Adds the priors of the parameters.
static cav_status add_priors(cav_information *f) {
  int across = 3 * f->tr->nv + f->factor.border;
  double *to = f->nparameter ? cav_row_factor_add(&f->factor, f->nparameter) : NULL;
  if (f->nparameter && !to) return CAV_NO_MEMORY;
  for (int k = 0; k < f->nparameter; k++, to += across) {
    to[across - f->nparameter - 1 + k] = sqrt(f->prior[k]);
    to[across - 1] = sqrt(f->prior[k]) * f->off[k];
  }
  return CAV_OK;
}

/// First block in the band that a knot sees; the number of those in the band: none.
int cav_information_block(const cav_information *f, int t) {
  int first = f->core;
  for (int c = 0; c < 3; c++) {
    int block = cav_transcription_block(f->tr, t, c);
    if (block >= 0 && block < first) first = block;
  }
  return first;
}

static cav_status begin(cav_information *f, cav_transcription *tr) {
  size_t nv = (size_t)tr->nv, rows = 0;
  f->tr = tr, f->blocks = cav_transcription_blocks(tr);
  // of a cycle the last two blocks meet the first two
  f->core = f->blocks - (tr->periodicity ? 2 : 0);
  for (int t = 0; t < tr->nknot; t++) rows += (size_t)tr->knot[t].layout.count;
  f->scale = calloc((size_t)f->blocks * nv + 1, sizeof(double));
  f->first = malloc((size_t)tr->nknot * sizeof *f->first);
  f->holds = calloc(rows + 1, 1);
  f->square = malloc((9 * nv * nv + 3 * nv + (3 * nv + 1) * 3 * nv + 1) * sizeof(double));
  cav_status status =
      cav_row_factor_begin(&f->factor, tr->nv, f->core, (f->blocks - f->core) * tr->nv + f->nparameter + f->residuals);
  if (!f->scale || !f->first || !f->holds || !f->square) return CAV_NO_MEMORY;
  f->row = f->square + 9 * nv * nv + 3 * nv;
  return status;
}

cav_status cav_information_begin(cav_information *f, cav_transcription *tr, int nparameter) {
  *f = (cav_information){.nparameter = nparameter, .residuals = nparameter > 0};
  return begin(f, tr);
}

cav_status cav_information_begin_merit(cav_information *f, cav_transcription *tr) {
  *f = (cav_information){.merit = 1, .residuals = 1};
  return begin(f, tr);
}

void cav_information_clear(cav_information *f) {
  free(f->scale), free(f->first), free(f->holds), free(f->square);
  cav_row_factor_clear(&f->factor);
  *f = (cav_information){0};
}

void cav_information_start(cav_information *f, int nrow, const cav_binding *row) {
  memset(f->scale, 0, (size_t)f->blocks * (size_t)f->tr->nv * sizeof *f->scale);
  cav_row_factor_restart(&f->factor);
  find_holding(f, nrow, row);
  find_scale(f);
}

cav_status cav_information_advance(cav_information *f) {
  const int b = f->factor.next;
  cav_status status = CAV_OK;
  for (int t = 0; t < f->tr->nknot && status == CAV_OK; t++)
    if (cav_information_block(f, t) == b) status = add_knot(f, t);
  if (status == CAV_OK && b == f->core) status = add_priors(f);
  if (status == CAV_OK) cav_row_factor_advance(&f->factor);
  return status;
}

cav_status cav_information_finish(cav_information *f) {
  cav_status status = CAV_OK;
  while (f->factor.next < f->core && status == CAV_OK) status = cav_information_advance(f);
  // the border
  if (status == CAV_OK) status = cav_information_advance(f);
  if (status != CAV_OK) return status;
  return cav_row_factor_least(&f->factor, f->residuals) < least_pivot ? CAV_NOT_CONVERGED : CAV_OK;
}

cav_status cav_information_factor(cav_information *f, int nrow, const cav_binding *row) {
  cav_information_start(f, nrow, row);
  return cav_information_finish(f);
}

void cav_information_step(const cav_information *f, double *x) {
  cav_row_factor_solve(&f->factor, x);
  for (int k = 0; k < f->blocks * f->tr->nv; k++) x[k] /= f->scale[k];
}

void cav_information_spread(const cav_information *f, int t, int n, const double *row, double *image) {
  int nv = f->tr->nv, width = 3 * nv, first = cav_information_block(f, t) * nv, core = f->core * nv;
  size_t across = (size_t)(width + f->factor.border);
  memset(image, 0, (size_t)n * across * sizeof(double));
  for (int i = 0; i < n; i++)
    for (int c = 0; c < width; c++) {
      int k = unknown_of(f->tr, t, c);
      if (k < 0) continue;
      double x = row[i * width + c] / f->scale[k];
      const double *G = f->factor.spread + (size_t)(k < core ? k - first : width + k - core) * across;
      for (size_t j = 0; j < across && x != 0; j++) image[(size_t)i * across + j] += x * G[j];
    }
}
