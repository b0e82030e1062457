/// Gauss-Newton: one factorisation of the normal equations (normal_equations.c) an iteration, and Powell's dogleg in
/// the norm of sqrt(diag H), which is blind to the units of the unknowns. The radius outlives a run, so a continuation
/// keeps what it has learnt.
#include "gauss_newton.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "clock.h"

/// Added to the diagonal, relative: condition numbers reach 1e15 under stiff penalties.
static const double jitter = 1e-10;

/// Largest change of one unknown in a step, rad or m: rotations stay well inside their chart.
static const double step_limit = 0.7;

/// Fraction of the merit that rounding makes of its differences.
static const double noise = 1e-10;

/// Doublings of the radius on one linearisation, at most.
enum { GROWTH = 12 };

/// Decrease over that of a shorter step from which a longer one is taken.
static const double gain = 1.01;

/// Fraction of the Newton step below which a radius that still shrinks is one that a jump of the merit holds.
static const double collapse = 1e-6;

/// Steps in a row that gain less than the tolerance, each shorter than the one before, that end a run: they come nearer and
/// nearer to a jump of the merit (features of meshes that change), half the way each time, and the next stage may do without it.
enum { WANING = 4 };

/// Directions of one iteration and the model's numbers along them.
typedef struct dogleg {
  const cav_normal *normal;
  int size;
  double *newton, *cauchy, *product, *step, *scale; ///< product = H cauchy; scale = diag H
  double newton_norm, cauchy_norm;                  ///< cauchy_norm negative: its point was not needed yet
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

/// Cauchy point, unless it is known.
static void find_cauchy(dogleg *d) {
  if (d->cauchy_norm >= 0) return;
  const double *gradient = d->normal->gradient;
  for (int i = 0; i < d->size; i++) d->cauchy[i] = -gradient[i] / d->scale[i];
  cav_normal_multiply(d->normal, d->cauchy, d->product);
  double derivative = dot(d->size, gradient, d->cauchy), curve = dot(d->size, d->cauchy, d->product);
  double length = curve > 0 ? -derivative / curve : 1;
  for (int i = 0; i < d->size; i++) d->cauchy[i] *= length, d->product[i] *= length;
  d->cauchy_norm = scaled_norm(d, d->cauchy);
}

/// Newton point of the gathered equations, which have been factored with the jitter; the shift grows until the factor exists.
static cav_status prepare(dogleg *d, cav_normal *normal, cav_status status) {
  const double *gradient = normal->gradient;
  for (double shift = 100 * jitter; status == CAV_NOT_CONVERGED && shift < 1; shift *= 100)
    status = cav_normal_factor(normal, shift);
  if (status != CAV_OK) return status;
  for (int i = 0; i < d->size; i++) {
    d->scale[i] = normal->diagonal[i] > 0 ? normal->diagonal[i] : 1;
    d->step[i] = -gradient[i];
  }
  cav_normal_solve(normal, d->step, d->newton);
  d->newton_norm = scaled_norm(d, d->newton);
  d->cauchy_norm = -1;
  return CAV_OK;
}

/// Dogleg step of scaled length radius at most. Returns the decrease that the quadratic model predicts.
static double bend(dogleg *d, double radius) {
  const double *gradient = d->normal->gradient;
  double a, b; // step = a cauchy + b newton
  if (d->newton_norm > radius) find_cauchy(d);
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
    d->step[i] = (a != 0 ? a * d->cauchy[i] : 0) + b * d->newton[i];
    largest = fmax(largest, fabs(d->step[i]));
  }
  if (largest > step_limit) {
    a *= step_limit / largest, b *= step_limit / largest;
    for (int i = 0; i < d->size; i++) d->step[i] *= step_limit / largest;
  }
  // H newton = -gradient
  double gc = a != 0 ? dot(d->size, gradient, d->cauchy) : 0, gn = dot(d->size, gradient, d->newton);
  double curve = (a != 0 ? a * a * dot(d->size, d->cauchy, d->product) : 0) - 2 * a * b * gc - b * b * gn;
  return -(a * gc + b * gn) - 0.5 * curve;
}

static void dogleg_set(dogleg *d, const cav_normal *normal) {
  int size = normal->size;
  double *block = normal->room;
  *d = (dogleg){.normal = normal, .size = size};
  d->newton = block, d->cauchy = block + size, d->product = block + 2 * size, d->step = block + 3 * size;
  d->scale = block + 4 * size;
}

/// Whether the step would leave its bounds, at one of which it is.
static int step_is_held(const cav_transcription *tr, const cav_trajectory *at, double change) {
  double least = tr->problem->duration_least / (tr->nknot - 1), most = tr->problem->duration_most / (tr->nknot - 1);
  return (at->timestep <= least * (1 + DBL_EPSILON) && change < 0) ||
         (at->timestep >= most * (1 - DBL_EPSILON) && change > 0);
}

/// Newton point at a trajectory whose normal equations are gathered and factored.
static cav_status prepare_at(dogleg *d, cav_normal *normal, const cav_transcription *tr, const cav_trajectory *at,
                             cav_status factored) {
  cav_status status = prepare(d, normal, factored);
  if (status != CAV_OK || !tr->free_step || !step_is_held(tr, at, d->newton[d->size - 1])) return status;
  cav_normal_hold(normal);
  return prepare(d, normal, cav_normal_factor(normal, jitter));
}

/// A step tried, and what came of it.
typedef struct trial {
  double length, decrease, predicted;
  int grown; ///< only the radius held it back
} trial;

/// Step of the present radius to a trajectory, of use with a merit up to a bound; its values are known where they have been put
/// by. The transcription ends at it if it is of use.
static cav_status try_radius(const cav_region *region, dogleg *d, cav_transcription *tr, const cav_trajectory *at,
                             cav_trajectory *to, double merit, double bound, int known, trial *t) {
  int beyond = 0;
  t->predicted = bend(d, region->radius);
  t->length = scaled_norm(d, d->step);
  cav_transcription_move(tr, at, d->step, to);
  cav_status status =
      known ? cav_transcription_return(tr, to) : cav_transcription_values_within(tr, to, bound, &beyond);
  t->decrease = status == CAV_OK && !beyond ? merit - cav_transcription_merit(tr) : -INFINITY;
  return status == CAV_NO_MEMORY || status == CAV_INTERRUPTED ? status : CAV_OK;
}

/// Whether a step is as good as predicted, and only the radius holds it back.
static int is_held_back(const cav_region *region, const dogleg *d, const trial *t) {
  return t->decrease > 0.75 * t->predicted && t->length > 0.9 * region->radius && t->length < 0.99 * d->newton_norm;
}

/// Grows the radius while steps of this linearisation are as good as predicted, and gain. Ends with the best step in to.
static cav_status grow(cav_region *region, dogleg *d, cav_transcription *tr, const cav_trajectory *at,
                       cav_trajectory *to, double merit, trial *t) {
  for (int i = 0; i < GROWTH && is_held_back(region, d, t); i++) {
    trial longer = {0};
    double radius = region->radius;
    region->radius *= 2;
    if (!cav_values_keep(tr)) return CAV_NO_MEMORY;
    // what is above has no decrease that is larger, however it is rounded
    const double bound = merit - gain * t->decrease + 8 * DBL_EPSILON * merit;
    cav_status status = try_radius(region, d, tr, at, to, merit, bound, 0, &longer);
    if (status != CAV_OK) return status;
    if (longer.decrease > gain * t->decrease) {
      *t = longer;
      t->grown = is_held_back(region, d, t);
      continue;
    }
    // back to the shorter one; the radius stays for the next linearisation
    region->radius = radius;
    status = try_radius(region, d, tr, at, to, merit, INFINITY, 1, t);
    region->radius = 2 * radius;
    return status;
  }
  return CAV_OK;
}

/// Shrinks the radius until a step is as good as predicted, or grows it while it is. What is within rounding of the
/// merit says nothing about the radius.
static cav_status search(cav_region *region, dogleg *d, cav_transcription *tr, const cav_trajectory *at,
                         cav_trajectory *to, double merit, trial *t) {
  for (int attempt = 0;; attempt++) {
    cav_status status = try_radius(region, d, tr, at, to, merit, merit, 0, t);
    if (status != CAV_OK) return status;
    double ratio = t->predicted > 0 ? t->decrease / t->predicted : -1;
    if (t->predicted <= noise * merit) return CAV_OK;
    t->grown = is_held_back(region, d, t);
    if (t->grown && !region->single) return grow(region, d, tr, at, to, merit, t);
    if (t->grown) region->radius *= 2;
    if (ratio < 0.25) region->radius = 0.5 * fmin(t->length, region->radius);
    if (ratio > 1e-4 || attempt > 30 || region->single) return CAV_OK;
  }
}

cav_status cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *tr, cav_trajectory **at,
                               cav_trajectory **spare) {
  dogleg d;
  dogleg_set(&d, normal);
  int calm = 0, fresh = 0; // consecutive small decreases; whether the transcription holds values at *at
  int waning = 0;
  double length = 0; // of the step before
  region->stalled = region->settled = 0;
  cav_status status = CAV_OK;
  for (int i = 0; i < region->iterations && calm < 2; i++) {
    cav_status factored = CAV_OK;
    if ((status = cav_normal_linearise(normal, tr, *at, jitter, &factored)) != CAV_OK) break;
    double merit = cav_transcription_merit(tr), start = cav_clock();
    if ((status = prepare_at(&d, normal, tr, *at, factored)) != CAV_OK) break;
    region->seconds_linear += cav_clock() - start;
    if (!(region->radius > 0)) {
      find_cauchy(&d);
      region->radius = d.cauchy_norm;
    }

    // a Newton step that predicts no more than rounding is the end
    double predicted = bend(&d, INFINITY);
    if (predicted <= noise * merit) {
      region->settled = 1;
      fresh = 0;
      break;
    }
    trial t = {0};
    status = search(region, &d, tr, *at, *spare, merit, &t);
    region->done++;
    fresh = t.decrease > 0 && status == CAV_OK;
    if (fresh) {
      cav_trajectory *swap = *at;
      *at = *spare;
      *spare = swap;
    }
    if (status != CAV_OK) break;
    region->stalled = t.length < collapse * d.newton_norm || (!fresh && predicted > region->tolerance * merit);
    // a good step that only the radius held back says nothing about the end
    int held = t.grown && t.length < 0.99 * d.newton_norm;
    calm = t.decrease < region->tolerance * merit && !held ? calm + 1 : 0;
    waning = t.decrease < region->tolerance * merit && t.length < length ? waning + 1 : 0;
    length = t.length;
    if (waning == WANING) calm = 2;
    region->settled = (calm == 2 || !fresh) && !region->stalled;
    if (!fresh) break;
    if (region->report && region->report(region->context, t.length, region->radius)) {
      status = CAV_INTERRUPTED;
      break;
    }
  }
  if (!fresh && status == CAV_OK) status = cav_transcription_values(tr, *at);
  return status;
}
