/// Gauss-Newton on block-banded normal equations: one symbolic analysis, a supernodal Cholesky (CHOLMOD) an iteration, and
/// Powell's dogleg in the norm of sqrt(diag H), which is blind to the units of the unknowns. The radius outlives a run, so
/// a continuation keeps what it has learnt. The only user of SuiteSparse.
#include "gauss_newton.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <suitesparse/cholmod.h>
#include <time.h>

/// Added to the diagonal, relative: condition numbers reach 1e15 under stiff penalties.
static const double jitter = 1e-10;

/// Largest change of one unknown in a step, rad or m: rotations stay well inside their chart.
static const double step_limit = 0.7;

struct cav_normal {
  int blocks, n, size;
  cholmod_common common;
  cholmod_sparse *H; ///< lower triangle by columns: of a column, the rest of its block and two blocks below
  cholmod_factor *factor;
  cholmod_dense *b, *x, *work1, *work2;
  double *gradient, *diagonal;
};

/// First entry of a column.
static int *column(const cav_normal *normal, int j) { return (int *)normal->H->p + j; }

static int depth(const cav_normal *normal, int block) {
  int below = normal->blocks - 1 - block;
  return below < 2 ? below : 2;
}

cav_normal *cav_normal_new(int blocks, int n) {
  cav_normal *normal = calloc(1, sizeof *normal);
  if (!normal) return NULL;
  normal->blocks = blocks;
  normal->n = n;
  normal->size = blocks * n;
  cholmod_start(&normal->common);
  normal->common.print = 0;
  normal->common.error_handler = NULL;
  normal->common.supernodal = CHOLMOD_SUPERNODAL;
  normal->common.nmethods = 1;
  normal->common.method[0].ordering = CHOLMOD_NATURAL;
  normal->common.postorder = 0;

  // pattern
  size_t entries = 0;
  for (int b = 0; b < blocks; b++) entries += (size_t)n * (n + 1) / 2 + (size_t)depth(normal, b) * n * n;
  normal->H = cholmod_allocate_sparse((size_t)normal->size, (size_t)normal->size, entries, 1, 1, -1, CHOLMOD_REAL, &normal->common);
  normal->b = cholmod_allocate_dense((size_t)normal->size, 1, (size_t)normal->size, CHOLMOD_REAL, &normal->common);
  normal->gradient = malloc((size_t)normal->size * sizeof(double));
  normal->diagonal = malloc((size_t)normal->size * sizeof(double));
  if (!normal->H || !normal->b || !normal->gradient || !normal->diagonal) goto fail;
  int *p = normal->H->p, *i = normal->H->i, at = 0;
  for (int j = 0; j < normal->size; j++) {
    p[j] = at;
    int end = (j / n + 1 + depth(normal, j / n)) * n;
    for (int row = j; row < end; row++) i[at++] = row;
  }
  p[normal->size] = at;
  normal->factor = cholmod_analyze(normal->H, &normal->common);
  if (!normal->factor) goto fail;
  return normal;
fail:
  cav_normal_free(normal);
  return NULL;
}

void cav_normal_free(cav_normal *normal) {
  if (!normal) return;
  cholmod_common *common = &normal->common;
  cholmod_free_factor(&normal->factor, common);
  cholmod_free_sparse(&normal->H, common);
  cholmod_free_dense(&normal->b, common);
  cholmod_free_dense(&normal->x, common);
  cholmod_free_dense(&normal->work1, common);
  cholmod_free_dense(&normal->work2, common);
  cholmod_finish(common);
  free(normal->gradient), free(normal->diagonal);
  free(normal);
}

void cav_normal_gather(cav_normal *normal, const cav_transcription *tr) {
  int n = normal->n, width = 3 * n;
  double *value = normal->H->x;
  memset(value, 0, (size_t)*column(normal, normal->size) * sizeof(double));
  memset(normal->gradient, 0, (size_t)normal->size * sizeof(double));
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    for (int c = 0; c < 3; c++) {
      int block = t + c - 2; // of the unknowns; column block c of the knot
      if (block < 0 || block >= normal->blocks) continue;
      for (int j = 0; j < n; j++) {
        normal->gradient[block * n + j] += knot->gradient[c * n + j];
        double *out = value + *column(normal, block * n + j);
        int below = depth(normal, block) < 2 - c ? depth(normal, block) : 2 - c;
        for (int i = j; i < (1 + below) * n; i++) out[i - j] += knot->hessian[(size_t)(c * n + i) * width + c * n + j];
      }
    }
  }
  for (int j = 0; j < normal->size; j++) normal->diagonal[j] = value[*column(normal, j)];
}

const double *cav_normal_gradient(const cav_normal *normal) { return normal->gradient; }
const double *cav_normal_diagonal(const cav_normal *normal) { return normal->diagonal; }

cav_status cav_normal_factor(cav_normal *normal, double shift) {
  double *value = normal->H->x;
  for (int j = 0; j < normal->size; j++)
    value[*column(normal, j)] = normal->diagonal[j] * (1 + shift) + (normal->diagonal[j] > 0 ? 0 : 1);
  int ok = cholmod_factorize(normal->H, normal->factor, &normal->common);
  for (int j = 0; j < normal->size; j++) value[*column(normal, j)] = normal->diagonal[j];
  if (!ok) return CAV_NO_MEMORY;
  return normal->common.status == CHOLMOD_OK ? CAV_OK : CAV_NOT_CONVERGED;
}

cav_status cav_normal_solve(cav_normal *normal, const double *b, double *x) {
  memcpy(normal->b->x, b, (size_t)normal->size * sizeof(double));
  if (!cholmod_solve2(CHOLMOD_A, normal->factor, normal->b, NULL, &normal->x, NULL, &normal->work1, &normal->work2,
                      &normal->common))
    return CAV_NO_MEMORY;
  memcpy(x, normal->x->x, (size_t)normal->size * sizeof(double));
  return CAV_OK;
}

void cav_normal_multiply(const cav_normal *normal, const double *x, double *product) {
  const double *value = normal->H->x;
  const int *row = normal->H->i;
  memset(product, 0, (size_t)normal->size * sizeof(double));
  for (int j = 0; j < normal->size; j++) {
    int first = *column(normal, j), end = *column(normal, j + 1);
    double sum = value[first] * x[j];
    for (int k = first + 1; k < end; k++) {
      product[row[k]] += value[k] * x[j];
      sum += value[k] * x[row[k]];
    }
    product[j] += sum;
  }
}

void cav_normal_block(const cav_normal *normal, int row, int col, double *out) {
  int n = normal->n, below = row - col;
  const double *value = normal->H->x;
  for (int j = 0; j < n; j++) {
    const double *entry = value + *column(normal, col * n + j);
    for (int i = 0; i < n; i++) out[i * n + j] = below * n + i >= j ? entry[below * n + i - j] : 0;
  }
}

int cav_normal_entries(const cav_normal *normal, int *row, int *col, double *value) {
  int entries = *column(normal, normal->size);
  if (row) memcpy(row, normal->H->i, (size_t)entries * sizeof *row);
  if (value) memcpy(value, normal->H->x, (size_t)entries * sizeof *value);
  for (int j = 0; col && j < normal->size; j++)
    for (int k = *column(normal, j); k < *column(normal, j + 1); k++) col[k] = j;
  return entries;
}

void cav_normal_shift_entries(const cav_normal *normal, double factor, double absolute, double share, double *value) {
  int entries = *column(normal, normal->size);
  for (int k = 0; k < entries; k++) value[k] *= factor;
  for (int j = 0; j < normal->size; j++) value[*column(normal, j)] += absolute + share * normal->diagonal[j];
}

// ---------------------------------------------------------------- trust region

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/// Directions of one iteration and the model's numbers along them.
typedef struct dogleg {
  int size;
  double *newton, *cauchy, *product, *step, *scale; ///< product = H cauchy; scale = diag H
  double newton_norm, cauchy_norm;
} dogleg;

static double scaled_norm(const dogleg *d, const double *x) {
  double sum = 0;
  for (int i = 0; i < d->size; i++) sum += d->scale[i] * x[i] * x[i];
  return sqrt(sum);
}

static double dot(int n, const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

/// Newton and Cauchy points of the gathered equations; the shift grows until the factor exists.
static cav_status prepare(dogleg *d, cav_normal *normal) {
  const double *gradient = normal->gradient;
  cav_status status = CAV_NOT_CONVERGED;
  for (double shift = jitter; status == CAV_NOT_CONVERGED && shift < 1; shift *= 100) status = cav_normal_factor(normal, shift);
  if (status != CAV_OK) return status;
  for (int i = 0; i < d->size; i++) {
    d->scale[i] = normal->diagonal[i] > 0 ? normal->diagonal[i] : 1;
    d->cauchy[i] = -gradient[i] / d->scale[i];
    d->step[i] = -gradient[i];
  }
  if ((status = cav_normal_solve(normal, d->step, d->newton)) != CAV_OK) return status;
  cav_normal_multiply(normal, d->cauchy, d->product);
  double slope = dot(d->size, gradient, d->cauchy), curve = dot(d->size, d->cauchy, d->product);
  double length = curve > 0 ? -slope / curve : 1;
  for (int i = 0; i < d->size; i++) d->cauchy[i] *= length, d->product[i] *= length;
  d->newton_norm = scaled_norm(d, d->newton);
  d->cauchy_norm = scaled_norm(d, d->cauchy);
  return CAV_OK;
}

/// Dogleg step of scaled length radius at most. Returns the decrease that the quadratic model predicts.
static double bend(dogleg *d, const double *gradient, double radius) {
  double a, b; // step = a cauchy + b newton
  if (d->newton_norm <= radius) {
    a = 0, b = 1;
  } else if (d->cauchy_norm >= radius) {
    a = radius / d->cauchy_norm, b = 0;
  } else {
    // |cauchy + s (newton - cauchy)| = radius
    double cc = d->cauchy_norm * d->cauchy_norm, cn = 0;
    for (int i = 0; i < d->size; i++) cn += d->scale[i] * d->cauchy[i] * d->newton[i];
    double nn = d->newton_norm * d->newton_norm, qa = nn - 2 * cn + cc, qb = cn - cc, qc = cc - radius * radius;
    double s = qa > 0 ? (-qb + sqrt(fmax(qb * qb - qa * qc, 0))) / qa : 0;
    a = 1 - s, b = s;
  }
  double largest = 0;
  for (int i = 0; i < d->size; i++) {
    d->step[i] = a * d->cauchy[i] + b * d->newton[i];
    largest = fmax(largest, fabs(d->step[i]));
  }
  if (largest > step_limit) {
    a *= step_limit / largest, b *= step_limit / largest;
    for (int i = 0; i < d->size; i++) d->step[i] *= step_limit / largest;
  }
  // H newton = -gradient
  double gc = dot(d->size, gradient, d->cauchy), gn = dot(d->size, gradient, d->newton);
  double curve = a * a * dot(d->size, d->cauchy, d->product) - 2 * a * b * gc - b * b * gn;
  return -(a * gc + b * gn) - 0.5 * curve;
}

static int dogleg_new(dogleg *d, int size) {
  *d = (dogleg){.size = size};
  double *block = malloc(5 * (size_t)size * sizeof(double));
  if (!block) return 0;
  d->newton = block, d->cauchy = block + size, d->product = block + 2 * size, d->step = block + 3 * size;
  d->scale = block + 4 * size;
  return 1;
}

cav_status cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *tr, cav_trajectory **at,
                               cav_trajectory **spare) {
  dogleg d;
  if (!dogleg_new(&d, normal->size)) return CAV_NO_MEMORY;
  int calm = 0, fresh = 0; // consecutive small decreases; whether the transcription holds values at *at
  cav_status status = CAV_OK;
  for (int i = 0; i < region->iterations && calm < 2; i++) {
    if ((status = cav_transcription_linearise(tr, *at)) != CAV_OK) break;
    double merit = cav_transcription_merit(tr), start = now();
    cav_normal_gather(normal, tr);
    if ((status = prepare(&d, normal)) != CAV_OK) break;
    region->seconds_linear += now() - start;
    if (!(region->radius > 0)) region->radius = d.cauchy_norm;

    // shrink the radius until the step is as good as promised
    double decrease = 0, predicted = 0, length = 0;
    for (int attempt = 0;; attempt++) {
      predicted = bend(&d, normal->gradient, region->radius);
      length = scaled_norm(&d, d.step);
      cav_transcription_move(tr, *at, d.step, *spare);
      cav_status trial = cav_transcription_values(tr, *spare);
      decrease = trial == CAV_OK ? merit - cav_transcription_merit(tr) : -INFINITY;
      double ratio = predicted > 0 ? decrease / predicted : -1;
      if (trial == CAV_NO_MEMORY) status = trial;
      if (ratio < 0.25) region->radius = 0.5 * fmin(length, region->radius);
      if (ratio > 0.75 && length > 0.9 * region->radius) region->radius *= 2;
      if (ratio > 1e-4 || attempt > 30 || predicted <= 1e-14 * merit || status != CAV_OK) break;
    }
    region->done++;
    fresh = decrease > 0;
    if (fresh) {
      cav_trajectory *swap = *at;
      *at = *spare;
      *spare = swap;
    }
    if (status != CAV_OK) break;
    calm = decrease < region->tolerance * merit ? calm + 1 : 0;
    if (!fresh) break;
    if (region->report && region->report(region->context, length, region->radius)) {
      status = CAV_INTERRUPTED;
      break;
    }
  }
  if (!fresh && status == CAV_OK) status = cav_transcription_values(tr, *at);
  free(d.newton);
  return status;
}
