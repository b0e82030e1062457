/// Contact law of one constraint, in closed form: impulse f from g = R^-1 (v* - v_next), its derivative and its
/// potential. Todorov 2014, eqs. (19)-(22), and METHOD.md, 3: f is the projection of g on the constraint's
/// cone in the metric R. In the scaled coordinates G = R^(1/2) g the elliptic cone is circular, its half angle theta
/// has tan^2 theta = rho/R_n with rho = R_j mu_j^2 the same for every friction row j, and the projection is spectral,
///
///   l1 = G_n - |G_t| cot theta,  l2 = G_n + |G_t| tan theta,  F_n = sin^2 z(l1) + cos^2 z(l2),
///   F_t = s G_t,  s = (z(l2) - z(l1))/(l2 - l1),  potential = sin^2 Z(l1) + cos^2 Z(l2),  Z' = z.
///
/// z = max(0, x) gives the exact law, z = sigma log(1 + exp(x/sigma)) the smoothed one. Everything smoothed is the
/// exact law plus a bounded correction in exp(-|x|/sigma), so nothing overflows and sigma -> 0 loses no digit. Where it
/// shall end, so that what is far need not be sought, z is zero below -12 sigma: from -9 sigma down it is a polynomial of
/// fifth degree that meets both ends with two derivatives, convex as all of z is. Rows with zero friction carry no
/// impulse. sigma is in units of G for every kind of constraint. Computes no v* and no R: limits.c.
#include <float.h>
#include <math.h>

#include "constraint.h"

enum { DIM_MAX = CAV_IMPULSE_DIM };
// the tail of a law that ends: from END up over WIDTH, both in units of sigma
static const double END = -CAV_LAW_END, WIDTH = 3;
// of t = (x - END)/WIDTH: coefficients of t^3, t^4, t^5, so that at t = 1 it is log(1 + exp(-9)) with two derivatives; derivative
// of that; what the tail of exp lacks in area
static const double TAIL[3] = {3.0849405933962749e-4, -3.7016089802165609e-4, 1.8506902840528742e-4};
static const double TAIL_DERIVATIVE = 1.2339457598623173e-4, AREA_LOST = 2.1597476906194739e-5;

/// Smoothed positive part at x = lambda/sigma, in pieces.
typedef struct smooth {
  double excess;     ///< log(1 + e^x) - max(0, x)
  double derivative; ///< logistic function
  double area;       ///< integral of log(1 + e^t) up to x, minus max(0, x)^2/2
} smooth;

/// What the law needs of one cone at one point, in scaled coordinates.
typedef struct spectrum {
  double normal;     ///< F_n
  double ratio;      ///< s = |F_t|/|G_t|, also the curvature across G_t
  double nn, nt, tt; ///< second derivatives of the potential: normal, mixed, along G_t
  double potential;
} spectrum;

// -Li2(-y) for 0 <= y <= 1, by the Bernoulli series of the dilogarithm in u = log(1 + y) <= log 2.
static double dilogarithm(double y) {
  // B_2k/(2k+1)! for k = 1..8; the next term is below 2e-18 of the sum
  static const double bernoulli[] = {
      1.0 / 36.0,        -1.0 / 3600.0,           1.0 / 211680.0,        -1.0 / 10886400.0,
      1.0 / 526901760.0, -4.0647616451442255e-11, 8.921691020456453e-13, -1.9939295860721076e-14};
  const double u = log1p(y), u2 = u * u;
  double series = 0.0;
  for (int k = 7; k >= 0; k--) series = series * u2 + bernoulli[k];
  return u + u2 * (0.25 + u * series);
}

static double clamp_fraction(double t) { return t > 0.0 ? (t < 1.0 ? t : 1.0) : 0.0; }

// the tail of a law that ends
static smooth ending(double x) {
  const double t = clamp_fraction((x - END) / WIDTH), t2 = t * t, t3 = t2 * t, *a = TAIL;
  return (smooth){t3 * (a[0] + t * (a[1] + t * a[2])), t2 * (3.0 * a[0] + t * (4.0 * a[1] + t * 5.0 * a[2])) / WIDTH,
                  WIDTH * t2 * t2 * (a[0] / 4.0 + t * (a[1] / 5.0 + t * a[2] / 6.0))};
}

// mean of its derivative from x over a width, without cancellation: beyond the tail that of the logistic function
static double ending_derivative(double x, double width) {
  const double t = clamp_fraction((x - END) / WIDTH), top = clamp_fraction((x + width - END) / WIDTH);
  double difference = 0.0, powers = top * top + top * t + t * t, power = t * t * t;
  // (top^k - t^k)/(top - t)
  for (int k = 0; k < 3; k++) {
    difference += TAIL[k] * powers;
    powers = powers * top + power;
    power *= t;
  }
  const double beyond = x + width - END - WIDTH;
  if (t == top && !(beyond > 0.0)) return difference / WIDTH;
  difference *= top - t;
  return (difference + (beyond > 0.0 ? log1p(TAIL_DERIVATIVE * expm1(beyond)) : 0.0)) / width;
}

// area is filled on request only: it is the costly piece.
static smooth smooth_positive(double x, int ends, int area) {
  if (ends && x < END + WIDTH) return ending(x);
  // far inside one more than the tail is one, and what it adds is lost in what there is
  if (x > 38.0 && !area) return (smooth){0.0, 1.0, 0.0};
  const double tail = exp(-fabs(x));
  // so far off that one more than the tail is one, exactly
  if (tail < 0x1p-54 && !area) return (smooth){tail, x > 0.0 ? 1.0 : tail, 0.0};
  smooth s = {log1p(tail), (x > 0.0 ? 1.0 : tail) / (1.0 + tail), 0.0};
  if (area) {
    const double integral = dilogarithm(tail);
    s.area = (x > 0.0 ? M_PI * M_PI / 6.0 - integral : integral) - (ends ? AREA_LOST : 0.0);
  }
  return s;
}

// exact law: the three cases of the projection. length = |G_t|, tangent = tan theta.
static spectrum exact_cone(double normal, double length, double tangent) {
  spectrum s = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  const double cos2 = 1.0 / (1.0 + tangent * tangent), top = normal + length * tangent;
  if (normal * tangent >= length) {
    // inside: nothing to do
    s = (spectrum){normal, 1.0, 1.0, 0.0, 1.0, 0.5 * (normal * normal + length * length)};
  } else if (!(top <= 0.0)) {
    // outside, nearest to the surface: length > 0 here; not-a-number comes this way too and is passed on
    s.normal = cos2 * top;
    s.ratio = tangent * s.normal / length;
    s.nn = cos2;
    s.nt = cos2 * tangent;
    s.tt = 1.0 - cos2;
    s.potential = 0.5 * cos2 * top * top;
  }
  return s;
}

// adds what smoothing by sigma changes.
static void soften_cone(spectrum *s, double normal, double length, double tangent, double sigma, int ends,
                        int potential) {
  const double cos2 = 1.0 / (1.0 + tangent * tangent), sin2 = tangent * tangent * cos2;
  const double width = length / sigma * (tangent + 1.0 / tangent);
  const double lower = (normal - length / tangent) / sigma;
  const smooth low = smooth_positive(lower, ends, potential);
  const smooth high = smooth_positive((normal + length * tangent) / sigma, ends, potential);
  s->normal += sigma * (sin2 * low.excess + cos2 * high.excess);
  // mean of the logistic derivative between the two eigenvalues; the first form has no cancellation when they are near
  if (width < 1.0 && ends && lower < END + WIDTH)
    s->ratio = ending_derivative(lower, width);
  else if (width < 1.0)
    s->ratio = width > 0.0 ? log1p(low.derivative * expm1(width)) / width : low.derivative;
  else
    s->ratio += (high.excess - low.excess) / width;
  s->nn = sin2 * low.derivative + cos2 * high.derivative;
  s->nt = tangent * cos2 * (high.derivative - low.derivative);
  s->tt = cos2 * low.derivative + sin2 * high.derivative;
  if (potential) s->potential += sigma * sigma * (sin2 * low.area + cos2 * high.area);
}

// -df/dv_next from the scaled curvature: rows and columns over sqrt(R). direction = G_t/|G_t|, 0 where it has none.
static void fill_hessian(int dim, double normal_R, double rho, const double *friction, const double *direction,
                         const spectrum *s, double *hessian) {
  hessian[0] = s->nn / normal_R;
  const double mixed = s->nt / sqrt(normal_R * rho), along = (s->tt - s->ratio) / rho, across = s->ratio / rho;
  for (int j = 1; j < dim; j++) {
    const double weight = friction[j - 1] * direction[j - 1];
    hessian[j] = hessian[j * dim] = mixed * weight;
    for (int k = 1; k < j; k++)
      hessian[j * dim + k] = hessian[k * dim + j] = along * weight * friction[k - 1] * direction[k - 1];
    hessian[j * dim + j] = along * weight * weight + across * friction[j - 1] * friction[j - 1];
  }
}

// the law for g of ordinary size.
static void ordinary_cone(int dim, const double *R, const double *friction, double sigma, int ends, const double *g,
                          double *f, double *hessian, double *potential) {
  // friction coordinates g_j/mu_j, their length and direction
  double direction[DIM_MAX - 1], square = 0.0;
  for (int j = 1; j < dim; j++) {
    direction[j - 1] = friction[j - 1] > 0.0 ? g[j] / friction[j - 1] : 0.0;
    square += direction[j - 1] * direction[j - 1];
  }
  const double rho = cav_friction_regulariser(dim, R, friction), root = sqrt(R[0]), norm = sqrt(square);
  const double tangent = sqrt(rho / R[0]), length = sqrt(rho) * norm;
  // without friction the cone is a ray and only the normal matters
  if (!(tangent > 0.0)) {
    double curvature = 0.0;
    cav_law_unilateral(R[0], sigma, ends, g[0], f, hessian ? &curvature : NULL, potential);
    for (int j = 1; j < dim; j++) f[j] = 0.0;
    if (hessian) {
      for (int i = 0; i < dim * dim; i++) hessian[i] = 0.0;
      hessian[0] = curvature;
    }
    return;
  }
  spectrum s = exact_cone(root * g[0], length, tangent);
  const int inside = s.nn == 1.0 && s.tt == 1.0;
  if (sigma > 0.0) soften_cone(&s, root * g[0], length, tangent, sigma, ends, potential != NULL);
  // inside, the exact law returns g to the last bit
  f[0] = inside && !(sigma > 0.0) ? g[0] : s.normal / root;
  for (int j = 1; j < dim; j++) f[j] = friction[j - 1] > 0.0 ? s.ratio * g[j] : 0.0;
  if (potential) *potential = s.potential;
  if (!hessian) return;
  for (int j = 1; j < dim; j++) direction[j - 1] = norm > 0.0 ? direction[j - 1] / norm : 0.0;
  fill_hessian(dim, R[0], rho, friction, direction, &s, hessian);
}

void cav_law_cone(int dim, const double *R, const double *friction, double sigma, int ends, const double *g, double *f,
                  double *hessian, double *potential) {
  if (dim == 1) {
    cav_law_unilateral(R[0], sigma, ends, g[0], f, hessian, potential);
    return;
  }
  // the law is homogeneous in (g, sigma): numbers whose squares would overflow or vanish are brought near one
  double size = 0.0, scaled[DIM_MAX] = {0.0};
  for (int i = 0; i < dim; i++) size = size > fabs(g[i]) ? size : fabs(g[i]);
  const double scale = sigma / sqrt(R[0]), with_sigma = size > scale ? size : scale;
  if ((size <= 1e100 && with_sigma >= 1e-100) || with_sigma == 0.0 || !(with_sigma <= DBL_MAX)) {
    ordinary_cone(dim, R, friction, sigma, ends, g, f, hessian, potential);
    return;
  }
  const int exponent = ilogb(with_sigma);
  for (int i = 0; i < dim; i++) scaled[i] = scalbn(g[i], -exponent);
  ordinary_cone(dim, R, friction, scalbn(sigma, -exponent), ends, scaled, f, hessian, potential);
  for (int i = 0; i < dim; i++) f[i] = scalbn(f[i], exponent);
  if (potential) *potential = scalbn(*potential, 2 * exponent);
}

void cav_law_unilateral(double R, double sigma, int ends, double g, double *f, double *hessian, double *potential) {
  const double root = sqrt(R), positive = g <= 0.0 ? 0.0 : g, G = root * positive;
  *f = positive;
  if (hessian) *hessian = g >= 0.0 ? 1.0 / R : 0.0;
  if (potential) *potential = 0.5 * G * G;
  if (!(sigma > 0.0)) return;
  const smooth s = smooth_positive(root * g / sigma, ends, potential != NULL);
  *f += sigma / root * s.excess;
  if (hessian) *hessian = s.derivative / R;
  if (potential) *potential += sigma * sigma * s.area;
}

void cav_law_bilateral(double R, double sigma, double bound, double g, double *f, double *hessian, double *potential) {
  const double root = sqrt(R), G = root * g, B = root * bound, size = fabs(G);
  *f = g > bound ? bound : g < -bound ? -bound : g;
  if (hessian) *hessian = size <= B ? 1.0 / R : 0.0;
  if (potential) *potential = size <= B ? 0.5 * G * G : B * (size - 0.5 * B);
  if (!(sigma > 0.0)) return;
  const double width = 2.0 * B / sigma;
  // log of a ratio of two hyperbolic cosines, without cancellation where they are near
  if (width < 1.0) *f = 2.0 * sigma / root * atanh(tanh(0.5 * G / sigma) * tanh(0.25 * width));
  if (width < 1.0 && !hessian && !potential) return;
  const smooth low = smooth_positive((G + B) / sigma, 0, potential != NULL);
  const smooth high = smooth_positive((G - B) / sigma, 0, potential != NULL);
  if (!(width < 1.0)) *f += sigma / root * (low.excess - high.excess);
  if (hessian) *hessian = -low.derivative * (1.0 - high.derivative) * expm1(-width) / R;
  if (potential) *potential += sigma * sigma * (low.area - high.area);
}
