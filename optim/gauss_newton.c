/// Gauss-Newton on block-banded normal equations: a banded Cholesky (LAPACK's dpbtrf) an iteration, and Powell's dogleg in the
/// norm of sqrt(diag H), which is blind to the units of the unknowns. The radius outlives a run, so a continuation keeps
/// what it has learnt. Three neighbouring knots fill the band, so a general sparse factorisation has nothing to leave out.
#include "gauss_newton.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/// LAPACK: Cholesky factor of a symmetric positive definite band matrix, and the solution with it.
extern void dpbtrf_(const char *uplo, const int *n, const int *kd, double *ab, const int *ldab, int *info);
extern void dpbtrs_(const char *uplo, const int *n, const int *kd, const int *nrhs, const double *ab, const int *ldab,
                    double *b, const int *ldb, int *info);

/// Added to the diagonal, relative: condition numbers reach 1e15 under stiff penalties.
static const double jitter = 1e-10;

/// Largest change of one unknown in a step, rad or m: rotations stay well inside their chart.
static const double step_limit = 0.7;

struct cav_normal {
  int blocks, n, size;
  int band;       ///< entries kept of a column: itself and three blocks below, of which the last is never reached
  double *H;      ///< [size*band] lower triangle by columns: H[j*band + i - j] is H(i, j)
  double *factor; ///< [size*band]
  double *gradient, *diagonal; ///< [size]
};

/// Last row of H(:, j) that is not zero by structure.
static int end_of(const cav_normal *normal, int j) {
  int block = j / normal->n + 3;
  return (block < normal->blocks ? block : normal->blocks) * normal->n;
}

cav_normal *cav_normal_new(int blocks, int n) {
  cav_normal *normal = calloc(1, sizeof *normal);
  if (!normal) return NULL;
  normal->blocks = blocks;
  normal->n = n;
  normal->size = blocks * n;
  normal->band = 3 * n;
  size_t size = (size_t)normal->size, entries = size * (size_t)normal->band;
  normal->H = calloc(entries, sizeof(double));
  normal->factor = malloc(entries * sizeof(double));
  normal->gradient = malloc(size * sizeof(double));
  normal->diagonal = malloc(size * sizeof(double));
  if (normal->H && normal->factor && normal->gradient && normal->diagonal) return normal;
  cav_normal_free(normal);
  return NULL;
}

void cav_normal_free(cav_normal *normal) {
  if (!normal) return;
  free(normal->H), free(normal->factor), free(normal->gradient), free(normal->diagonal);
  free(normal);
}

void cav_normal_gather(cav_normal *normal, const cav_transcription *tr) {
  int n = normal->n, width = 3 * n;
  memset(normal->H, 0, (size_t)normal->size * (size_t)normal->band * sizeof(double));
  memset(normal->gradient, 0, (size_t)normal->size * sizeof(double));
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    for (int c = 0; c < width; c++) {
      int j = (t - 2) * n + c; // unknown of column c of the knot
      if (j < 0 || j >= normal->size) continue;
      normal->gradient[j] += knot->gradient[c];
      double *out = normal->H + (size_t)j * normal->band - c;
      int last = width < normal->size - j + c ? width : normal->size - j + c;
      for (int r = c; r < last; r++) out[r] += knot->hessian[(size_t)r * width + c];
    }
  }
  for (int j = 0; j < normal->size; j++) normal->diagonal[j] = normal->H[(size_t)j * normal->band];
}

const double *cav_normal_gradient(const cav_normal *normal) { return normal->gradient; }
const double *cav_normal_diagonal(const cav_normal *normal) { return normal->diagonal; }

cav_status cav_normal_factor(cav_normal *normal, double shift) {
  int below = normal->band - 1, info = 0;
  memcpy(normal->factor, normal->H, (size_t)normal->size * (size_t)normal->band * sizeof(double));
  for (int j = 0; j < normal->size; j++)
    normal->factor[(size_t)j * normal->band] = normal->diagonal[j] > 0 ? normal->diagonal[j] * (1 + shift) : 1;
  dpbtrf_("L", &normal->size, &below, normal->factor, &normal->band, &info);
  return info == 0 ? CAV_OK : CAV_NOT_CONVERGED;
}

void cav_normal_solve(const cav_normal *normal, const double *b, double *x) {
  int below = normal->band - 1, one = 1, info = 0;
  memcpy(x, b, (size_t)normal->size * sizeof *x);
  dpbtrs_("L", &normal->size, &below, &one, normal->factor, &normal->band, x, &normal->size, &info);
}

void cav_normal_multiply(const cav_normal *normal, const double *x, double *product) {
  memset(product, 0, (size_t)normal->size * sizeof(double));
  for (int j = 0; j < normal->size; j++) {
    const double *H = normal->H + (size_t)j * normal->band - j;
    int end = end_of(normal, j);
    double sum = H[j] * x[j];
    for (int i = j + 1; i < end; i++) {
      product[i] += H[i] * x[j];
      sum += H[i] * x[i];
    }
    product[j] += sum;
  }
}

int cav_normal_entries(const cav_normal *normal, int *row, int *col, double *value) {
  int entries = 0;
  for (int j = 0; j < normal->size; j++) {
    for (int i = j; i < end_of(normal, j); i++, entries++) {
      if (row) row[entries] = i;
      if (col) col[entries] = j;
      if (value) value[entries] = normal->H[(size_t)j * normal->band + (size_t)(i - j)];
    }
  }
  return entries;
}

void cav_normal_shift_entries(const cav_normal *normal, double factor, double absolute, double share, double *value) {
  for (int j = 0, k = 0; j < normal->size; j++) {
    int n = end_of(normal, j) - j;
    for (int i = 0; i < n; i++) value[k + i] *= factor;
    value[k] += absolute + share * normal->diagonal[j];
    k += n;
  }
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
  for (double shift = jitter; status == CAV_NOT_CONVERGED && shift < 1; shift *= 100)
    status = cav_normal_factor(normal, shift);
  if (status != CAV_OK) return status;
  for (int i = 0; i < d->size; i++) {
    d->scale[i] = normal->diagonal[i] > 0 ? normal->diagonal[i] : 1;
    d->cauchy[i] = -gradient[i] / d->scale[i];
    d->step[i] = -gradient[i];
  }
  cav_normal_solve(normal, d->step, d->newton);
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
    int grown = 0;
    for (int attempt = 0;; attempt++) {
      predicted = bend(&d, normal->gradient, region->radius);
      length = scaled_norm(&d, d.step);
      cav_transcription_move(tr, *at, d.step, *spare);
      cav_status trial = cav_transcription_values(tr, *spare);
      decrease = trial == CAV_OK ? merit - cav_transcription_merit(tr) : -INFINITY;
      double ratio = predicted > 0 ? decrease / predicted : -1;
      if (trial == CAV_NO_MEMORY) status = trial;
      if (ratio < 0.25) region->radius = 0.5 * fmin(length, region->radius);
      grown = ratio > 0.75 && length > 0.9 * region->radius;
      if (grown) region->radius *= 2;
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
    // a good step that only the radius held back says nothing about the end
    int held = grown && length < 0.99 * d.newton_norm;
    calm = decrease < region->tolerance * merit && !held ? calm + 1 : 0;
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
