/// Standard errors of an estimated motion: with the cost as minus the logarithm of a likelihood its Hessian is the
/// information, and its inverse along the constraints the covariance of the unknowns (Cramer, Rao). The inverse is
/// taken where the band has entries alone, which is what positions, velocities and forces of a knot depend on: a row r
/// over the three knots about it has the deviation |r G|, with G G' their covariance (row_factor.c).
///
/// Rows that hold (equalities, and bounds with a multiplier) enter with a large weight, counted in what the costs have
/// along the row: with D their diagonal, stiffness/(r D^-1 r'). Beside them what costs tell of slow deviations would
/// drown in the rounding of squares, so rows are factored, not their sum (row_factor.c); of the costs' Hessian at each
/// knot those of a pivoted Cholesky factor. Unknowns are counted in roots of D.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "problem_check.h"
#include "readings.h"
#include "row_factor.h"

static const double stiffness = 1e14;

/// Costs below this fraction of the largest tell nothing of an unknown; so does a pivot below it, of unknowns in roots
/// of D.
static const double nothing = 1e-13, least_pivot = 1e-9;

/// What is being found.
typedef struct estimate {
  cav_transcription *tr;
  int blocks, core; ///< of unknowns; those in the band
  cav_row_factor factor;
  cav_standard_errors *out;
  double *scale;  ///< [unknowns] roots of D
  int *first;     ///< [nknot] of each knot's rows in
  char *holds;    ///< [rows]
  double *window; ///< [3nv*3nv] scratch
  double *row;    ///< [3nv*3nv] rows over three knots
  double *unit;   ///< [3nv] a row over (q, v, v_next)
  double *image;  ///< [nv*(3nv+border)] rows times G
} estimate;

void cav_standard_errors_free(cav_standard_errors *e) {
  if (!e) return;
  free(e->q), free(e->v), free(e->u), free(e->force), free(e->covariance);
  free(e);
}

static cav_standard_errors *make(const cav_model *m, int nknot) {
  cav_standard_errors *e = calloc(1, sizeof *e);
  size_t n = (size_t)nknot, nv = (size_t)m->nv;
  if (!e) return NULL;
  e->nknot = nknot, e->nq = m->nq, e->nv = m->nv, e->nu = m->nu;
  e->q = calloc(n * nv + 1, sizeof(double));
  e->v = calloc(n * nv + 1, sizeof(double));
  e->u = calloc(n * nv + 1, sizeof(double));
  e->force = calloc(n * (size_t)m->nu + 1, sizeof(double));
  e->covariance = calloc(n * nv * nv + 1, sizeof(double));
  if (e->q && e->v && e->u && e->force && e->covariance) return e;
  cav_standard_errors_free(e);
  return NULL;
}

/// Notes which rows hold: equalities, and bounds that a binding with a multiplier names.
static void find_holding(estimate *f, int nrow, const cav_binding *row) {
  const cav_transcription *tr = f->tr;
  cav_binding own;
  for (int t = 0, k = 0; t < tr->nknot; t++) {
    f->first[t] = k;
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++)
      f->holds[k] = tr->knot[t].slot[i].lower == tr->knot[t].slot[i].upper;
  }
  for (int n = 0; n < nrow; n++) {
    int t = row[n].knot;
    if (row[n].multiplier == 0 || t < 0 || t >= tr->nknot) continue;
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      cav_transcription_origin(tr, t, i, &own);
      if (own.kind == row[n].kind && own.object == row[n].object && own.component == row[n].component)
        f->holds[f->first[t] + i] = 1;
    }
  }
}

/// Unknown that column c of knot t is; -1: none.
static int unknown_of(const cav_transcription *tr, int t, int c) {
  int block = cav_transcription_block(tr, t, c / tr->nv);
  return block < 0 ? -1 : block * tr->nv + c % tr->nv;
}

/// Weight of a row that holds, by what costs have along it; 0: no unknown moves it.
static double weight_of(const estimate *f, int t, const double *row, double most) {
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

/// Roots of D: of the costs' diagonal, where that is nothing of what the rows that hold have.
static void find_scale(estimate *f) {
  cav_transcription *tr = f->tr;
  int width = 3 * tr->nv, n = f->blocks * tr->nv;
  double most = 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int c = 0; c < width; c++)
      if (unknown_of(tr, t, c) >= 0) f->scale[unknown_of(tr, t, c)] += tr->knot[t].hessian[c * width + c];
  for (int k = 0; k < n; k++) most = fmax(most, f->scale[k]);
  for (int k = 0; k < n; k++) f->scale[k] = f->scale[k] > nothing * most ? f->scale[k] : 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      const double *r = tr->knot[t].slot_row + (size_t)i * (size_t)width;
      double weight = f->holds[f->first[t] + i] ? weight_of(f, t, r, most) : 0;
      for (int c = 0; c < width && weight > 0; c++) {
        int k = unknown_of(tr, t, c);
        // those without a cost are negative meanwhile
        if (k >= 0 && f->scale[k] <= 0) f->scale[k] -= weight / stiffness * r[c] * r[c];
      }
    }
  for (int k = 0; k < n; k++) f->scale[k] = f->scale[k] != 0 ? sqrt(fabs(f->scale[k])) : 1;
}

/// Adds a row over the columns of knot t to those of the factor, times root, in scaled unknowns.
static void lay(estimate *f, int t, const double *row, double root, double *to) {
  int nv = f->tr->nv, first = f->factor.next * nv, core = f->core * nv;
  for (int c = 0; c < 3 * nv; c++) {
    int k = unknown_of(f->tr, t, c);
    if (k >= 0 && row[c] != 0) to[k < core ? k - first : 3 * nv + k - core] += root * row[c] / f->scale[k];
  }
}

/// Rows of a knot's costs: of the pivoted Cholesky factor of its Hessian, [3nv*3nv] in place; their number.
static int factor_costs(const estimate *f, int t, double *H, double *rows) {
  int width = 3 * f->tr->nv, n = 0;
  double most = 0;
  const double *lower = f->tr->knot[t].hessian;
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
    double *row = rows + (size_t)n * (size_t)width;
    for (int i = 0; i < width; i++) row[i] = H[p * width + i] / root;
    for (int i = 0; i < width; i++)
      for (int j = 0; j < width && row[i] != 0; j++) H[i * width + j] -= row[i] * row[j];
    for (int i = 0; i < width; i++) H[p * width + i] = H[i * width + p] = 0;
  }
  // lay divides by the scale once more
  for (int i = 0; i < n; i++)
    for (int c = 0; c < width; c++) {
      int k = unknown_of(f->tr, t, c);
      if (k >= 0) rows[(size_t)i * (size_t)width + (size_t)c] *= f->scale[k];
    }
  return n;
}

/// Adds all rows of knot t to the factor.
static cav_status add_knot(estimate *f, int t) {
  cav_transcription *tr = f->tr;
  int width = 3 * tr->nv, across = width + f->factor.border;
  double *rows = f->row;
  int n = factor_costs(f, t, f->window, rows);
  double *to = cav_row_factor_add(&f->factor, n + tr->knot[t].layout.count);
  if (!to) return CAV_NO_MEMORY;
  for (int i = 0; i < n; i++) lay(f, t, rows + (size_t)i * (size_t)width, 1, to + (size_t)i * (size_t)across);
  to += (size_t)n * (size_t)across;
  for (int i = 0; i < tr->knot[t].layout.count; i++, to += across) {
    const double *r = tr->knot[t].slot_row + (size_t)i * (size_t)width;
    double size = 0;
    if (!f->holds[f->first[t] + i]) continue;
    for (int c = 0; c < width; c++) {
      int k = unknown_of(tr, t, c);
      if (k >= 0) size += r[c] * r[c] / (f->scale[k] * f->scale[k]);
    }
    if (size > 0) lay(f, t, r, sqrt(stiffness / size), to);
  }
  return CAV_OK;
}

/// First block in the band that a knot sees; the number of those in the band: none.
static int first_block(const estimate *f, int t) {
  int first = f->core;
  for (int c = 0; c < 3; c++) {
    int block = cav_transcription_block(f->tr, t, c);
    if (block >= 0 && block < first) first = block;
  }
  return first;
}

/// The factor of all rows.
static cav_status factor_rows(estimate *f) {
  cav_status status = CAV_OK;
  find_scale(f);
  for (int b = 0; b <= f->core && status == CAV_OK; b++) {
    for (int t = 0; t < f->tr->nknot && status == CAV_OK; t++)
      if (first_block(f, t) == b) status = add_knot(f, t);
    if (status == CAV_OK) cav_row_factor_advance(&f->factor);
  }
  if (status != CAV_OK) return status;
  return cav_row_factor_least(&f->factor) < least_pivot ? CAV_NOT_CONVERGED : CAV_OK;
}

/// Turns n rows over the columns of knot t, in f->row, into those over the unknowns across the seam of a cycle.
static void wrap(estimate *f, int t, int n) {
  const cav_transcription *tr = f->tr;
  if (tr->periodicity && (t < 2 || t == tr->nknot - 1)) cav_transcription_wrap(tr, &tr->scratch[0], t, n, f->row);
}

/// n rows over the unknowns about knot t times G, of the block that the factor has gone back to.
static void multiply(estimate *f, int t, int n) {
  int nv = f->tr->nv, width = 3 * nv, first = first_block(f, t) * nv, core = f->core * nv;
  size_t across = (size_t)(width + f->factor.border);
  wrap(f, t, n);
  memset(f->image, 0, (size_t)n * across * sizeof(double));
  for (int i = 0; i < n; i++)
    for (int c = 0; c < width; c++) {
      int k = unknown_of(f->tr, t, c);
      double x = k < 0 ? 0 : f->row[i * width + c] / f->scale[k];
      const double *G = f->factor.spread + (size_t)(k < core ? k - first : width + k - core) * across;
      for (size_t j = 0; j < across && x != 0; j++) f->image[(size_t)i * across + j] += x * G[j];
    }
}

/// Covariance of rows i and j that were multiplied.
static double covariance(const estimate *f, int i, int j) {
  size_t across = (size_t)(3 * f->tr->nv + f->factor.border);
  double sum = 0;
  for (size_t k = 0; k < across; k++) sum += f->image[(size_t)i * across + k] * f->image[(size_t)j * across + k];
  return sum;
}

/// Errors of n rows.
static void note(estimate *f, int t, int n, double *out) {
  multiply(f, t, n);
  for (int i = 0; i < n; i++) out[i] = sqrt(covariance(f, i, i));
}

/// Rows of q (kind 0) or v (1) of knot t.
static void lay_states(estimate *f, int t, int kind) {
  size_t nv = (size_t)f->tr->nv;
  for (size_t d = 0; d < nv; d++) {
    memset(f->unit, 0, 3 * nv * sizeof(double));
    f->unit[(size_t)kind * nv + d] = 1;
    cav_transcription_chain(f->tr, t, 1, f->unit, f->row + d * 3 * nv);
  }
}

/// Row of an actuator's force.
static void lay_actuator(estimate *f, int t, int actuator) {
  const cav_force_row *form = &f->tr->effort[actuator];
  size_t width = 3 * (size_t)f->tr->nv;
  memset(f->row, 0, width * sizeof(double));
  for (int k = 0; k < form->n; k++)
    for (size_t c = 0; c < width; c++)
      f->row[c] += f->tr->effort_unit[actuator] * form->coef[k] * f->tr->knot[t].du[(size_t)form->dof[k] * width + c];
}

static void find_knot(estimate *f, int t) {
  const cav_transcription *tr = f->tr;
  cav_standard_errors *e = f->out;
  int nv = tr->nv, nu = tr->model->nu, has_force = tr->knot[t].has_force;
  size_t at = (size_t)t * (size_t)nv, control = (size_t)t * (size_t)nu;
  lay_states(f, t, 1);
  note(f, t, nv, e->v + at);
  lay_states(f, t, 0);
  note(f, t, nv, e->q + at);
  for (int i = 0; i < nv; i++)
    for (int j = 0; j < nv; j++) e->covariance[(at + (size_t)i) * (size_t)nv + (size_t)j] = covariance(f, i, j);
  memcpy(f->row, tr->knot[t].du, 3 * (size_t)nv * (size_t)nv * sizeof(double));
  note(f, t, nv, e->u + at);
  for (int d = 0; d < nv && !has_force; d++) e->u[at + (size_t)d] = NAN;
  for (int a = 0; a < nu; a++) {
    lay_actuator(f, t, a);
    note(f, t, 1, e->force + control + a);
    if (!has_force) e->force[control + (size_t)a] = NAN;
  }
}

/// Everything at the motion, whose transcription is made.
static cav_status find(estimate *f, cav_trajectory *at, const cav_options *contact, int nrow, const cav_binding *row) {
  cav_transcription *tr = f->tr;
  size_t nv = (size_t)tr->nv;
  // of a cycle the last two blocks meet the first two
  f->blocks = cav_transcription_blocks(tr);
  f->core = f->blocks - (tr->periodicity ? 2 : 0);
  size_t rows = 0;
  for (int t = 0; t < tr->nknot; t++) rows += (size_t)tr->knot[t].layout.count;
  f->scale = calloc((size_t)f->blocks * nv + 1, sizeof(double));
  f->first = malloc((size_t)tr->nknot * sizeof *f->first);
  f->holds = calloc(rows + 1, 1);
  size_t border = (size_t)(f->blocks - f->core) * nv;
  f->window = malloc((18 * nv * nv + 3 * nv + nv * (3 * nv + border) + 1) * sizeof(double));
  f->out = make(tr->model, tr->nknot);
  if (!f->scale || !f->first || !f->holds || !f->window || !f->out || !cav_transcription_keep_rows(tr))
    return CAV_NO_MEMORY;
  f->row = f->window + 9 * nv * nv;
  f->unit = f->row + 9 * nv * nv;
  f->image = f->unit + 3 * nv;
  cav_status status = cav_row_factor_begin(&f->factor, tr->nv, f->core, (int)border);
  tr->options = *contact;
  tr->penalty = (cav_penalties){0};
  if (status == CAV_OK) status = cav_transcription_linearise(tr, at);
  if (status == CAV_OK) {
    find_holding(f, nrow, row);
    status = factor_rows(f);
  }
  for (int b = f->core - 1; b >= 0 && status == CAV_OK; b--) {
    cav_row_factor_back(&f->factor, b);
    for (int t = 0; t < tr->nknot; t++)
      if (first_block(f, t) == b) find_knot(f, t);
  }
  return status;
}

static cav_status fail(cav_error *error, cav_status status, const char *text) {
  if (error) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "standard errors: %s", text);
  }
  return status;
}

cav_status cav_standard_errors_find(const cav_problem *problem, const cav_trajectory *motion,
                                    const cav_options *contact, int nrow, const cav_binding *row,
                                    cav_standard_errors **errors, cav_error *error) {
  estimate f = {0};
  *errors = NULL;
  cav_status status = cav_problem_check(problem, error);
  if (status != CAV_OK) return status;
  if (problem->duration_most > 0)
    return fail(error, CAV_NOT_SUPPORTED, "not of a motion with a free duration; fix it with <horizon duration>");
  if (!(f.tr = cav_transcription_new(problem, 1, error))) return error ? error->status : CAV_NO_MEMORY;
  cav_trajectory *at = NULL;
  if (motion->nknot != f.tr->nknot || motion->nv != f.tr->nv || motion->nq != problem->model->nq)
    status = fail(error, CAV_BAD_INPUT, "the motion is not one of the problem: other knots or another model");
  else
    status = (at = cav_trajectory_copy(motion)) ? find(&f, at, contact, nrow, row) : CAV_NO_MEMORY;
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory");
  if (status == CAV_NOT_CONVERGED)
    fail(error, status,
         "neither costs nor dynamics tell anything of one of the unknowns; a small weight of <velocity> or <posture> "
         "on all dofs does");
  if (status == CAV_NOT_FINITE) fail(error, status, "the motion cannot be evaluated");
  if (status == CAV_OK) *errors = f.out, f.out = NULL;
  cav_standard_errors_free(f.out);
  cav_trajectory_free(at);
  cav_row_factor_clear(&f.factor);
  free(f.scale), free(f.window), free(f.first), free(f.holds);
  cav_transcription_free(f.tr);
  return status;
}
