/// Contact law: the exact projection against a numerical minimiser, the smoothed one against its definition in long
/// double, gradient and Hessian against differences, convergence for sigma -> 0, extreme numbers.
#include "check.h"
#include "scene.h"
#include "step.h"

enum { DIM_MAX = 6 };

/// A random cone and a point: R with rho = R_j mu_j^2, g in units that make all three cases common.
typedef struct sample {
  int dim;
  double R[DIM_MAX], friction[DIM_MAX - 1], g[DIM_MAX];
} sample;

static unsigned long long seed = 20141;

// uniform in [0, 1)
static double uniform(void) {
  seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
  return (double)(seed >> 11) / 9007199254740992.0;
}

static sample random_sample(int dim) {
  sample s = {dim, {0.0}, {0.0}, {0.0}};
  s.R[0] = pow(10.0, 4.0 * uniform() - 3.0);
  const double rho = s.R[0] * pow(10.0, 2.0 * uniform() - 1.0);
  for (int j = 0; j < dim; j++) {
    if (j > 0) {
      s.friction[j - 1] = pow(10.0, 2.0 * uniform() - 1.5);
      s.R[j] = rho / (s.friction[j - 1] * s.friction[j - 1]);
    }
    s.g[j] = (j > 0 ? s.friction[j - 1] : 1.0) * (4.0 * uniform() - 2.0);
  }
  return s;
}

static void law(const sample *s, double sigma, double *f, double *hessian, double *potential) {
  cav_law_cone(s->dim, s->R, s->friction, sigma, 0, s->g, f, hessian, potential);
}

// f_n - |f_j/mu_j|: positive inside the cone
static double inner(const sample *s, const double *f) {
  double square = 0.0;
  for (int j = 1; j < s->dim; j++) square += f[j] * f[j] / (s->friction[j - 1] * s->friction[j - 1]);
  return f[0] - sqrt(square);
}

// solves A x = b, A symmetric positive definite, both overwritten
static void solve(int n, double *A, double *b) {
  for (int k = 0; k < n; k++)
    for (int i = k + 1; i < n; i++) {
      const double m = A[i * n + k] / A[k * n + k];
      for (int j = k; j < n; j++) A[i * n + j] -= m * A[k * n + j];
      b[i] -= m * b[k];
    }
  for (int i = n - 1; i >= 0; i--) {
    for (int j = i + 1; j < n; j++) b[i] -= A[i * n + j] * b[j];
    b[i] /= A[i * n + i];
  }
}

// value of 1/2 (f-g)' R (f-g) - t log(cone slack)
static double barrier_value(const sample *s, double t, const double *f) {
  double value = 0.0, slack = f[0] * f[0];
  for (int i = 0; i < s->dim; i++) {
    value += 0.5 * s->R[i] * (f[i] - s->g[i]) * (f[i] - s->g[i]);
    if (i > 0) slack -= f[i] * f[i] / (s->friction[i - 1] * s->friction[i - 1]);
  }
  return f[0] > 0.0 && slack > 0.0 ? value - t * log(slack) : INFINITY;
}

// projection by a logarithmic barrier and Newton's method: knows nothing of cav_law_cone
static void minimise(const sample *s, double *f) {
  const int n = s->dim;
  f[0] = 1.0;
  for (int j = 1; j < n; j++) f[j] = 0.0;
  for (double t = 1.0; t > 1e-15; t *= 0.2)
    for (int step = 0; step < 50; step++) {
      double slack = f[0] * f[0], gradient[DIM_MAX] = {0.0}, A[DIM_MAX * DIM_MAX], d[DIM_MAX], x[DIM_MAX], dot = 0.0;
      for (int j = 1; j < n; j++) slack -= f[j] * f[j] / (s->friction[j - 1] * s->friction[j - 1]);
      for (int i = 0; i < n; i++) d[i] = i > 0 ? -2.0 * f[i] / (s->friction[i - 1] * s->friction[i - 1]) : 2.0 * f[0];
      for (int i = 0; i < n; i++) {
        gradient[i] = s->R[i] * (f[i] - s->g[i]) - t * d[i] / slack;
        for (int j = 0; j < n; j++) A[i * n + j] = t * d[i] * d[j] / (slack * slack);
        A[i * n + i] +=
            s->R[i] - t * (f[i] != 0.0 ? d[i] / f[i] : -2.0 / pow(s->friction[i > 0 ? i - 1 : 0], 2)) / slack;
      }
      double step_to[DIM_MAX];
      memcpy(step_to, gradient, sizeof gradient);
      solve(n, A, step_to);
      for (int i = 0; i < n; i++) dot += gradient[i] * step_to[i];
      if (dot < 1e-17) break;
      const double now = barrier_value(s, t, f);
      double a = 1.0;
      for (; a > 1e-10; a *= 0.5) {
        for (int i = 0; i < n; i++) x[i] = f[i] - a * step_to[i];
        if (barrier_value(s, t, x) <= now - 1e-4 * a * dot) break;
      }
      if (a <= 1e-10) break;
      memcpy(f, x, sizeof x);
    }
}

static void test_exact_is_the_projection(void) {
  double worst = 0.0;
  int cases[3] = {0, 0, 0};
  static const int dims[] = {3, 4, 6};
  for (int trial = 0; trial < 3000; trial++) {
    const sample s = random_sample(dims[trial % 3]);
    double f[DIM_MAX], numeric[DIM_MAX];
    law(&s, 0.0, f, NULL, NULL);
    // optimality: f in the cone, R (f - g) in the dual cone, orthogonal; residual seen 6e-16 of the sizes involved
    double w[DIM_MAX] = {0.0}, dot = 0.0, dual = 0.0, size = 0.0;
    for (int i = 0; i < s.dim; i++) {
      w[i] = s.R[i] * (f[i] - s.g[i]);
      dot += w[i] * f[i];
      size += fabs(s.R[i] * s.g[i]) * (1.0 + fabs(f[i]));
      if (i > 0) dual += w[i] * w[i] * s.friction[i - 1] * s.friction[i - 1];
    }
    CHECK(inner(&s, f) >= -1e-14 * (1.0 + f[0]));
    CHECK(w[0] - sqrt(dual) >= -1e-13 * size);
    CHECK_NEAR(dot, 0.0, 1e-13 * size);
    cases[f[0] == 0.0 ? 0 : dot == 0.0 && w[0] == 0.0 ? 1 : 2]++;
    // the barrier stops with an objective gap of 2e-15: f is known to sqrt(2 gap/R) <= 2e-6; seen 7e-7
    if (trial >= 600) continue;
    minimise(&s, numeric);
    for (int i = 0; i < s.dim; i++) worst = fmax(worst, fabs(numeric[i] - f[i]) * sqrt(s.R[i]));
    CHECK_NEAR_ALL(f, numeric, s.dim, 2e-6 / sqrt(s.R[0] < 1.0 ? s.R[0] : 1.0));
  }
  // all three cases were met
  CHECK(cases[0] > 100 && cases[1] > 100 && cases[2] > 100);
  printf("projection against barrier method: largest difference %.1e (apex %d, inside %d, surface %d)\n", worst,
         cases[0], cases[1], cases[2]);
}

static void test_dimension_one(void) {
  const double R = 0.3, friction[1] = {0.0};
  for (double g = -2.0; g <= 2.0; g += 0.25)
    for (double sigma = 0.0; sigma < 1.0; sigma += 0.4) {
      double f, k, p, F, K, P;
      cav_law_cone(1, &R, friction, sigma, 0, &g, &f, &k, &p);
      cav_law_unilateral(R, sigma, 0, g, &F, &K, &P);
      CHECK(f == F && k == K && p == P);
      if (sigma == 0.0) CHECK(f == fmax(0.0, g));
      // two roundings
      if (sigma == 0.0) CHECK_NEAR(p, 0.5 * R * f * f, 1e-15 * p);
    }
}

// the smoothed cone in long double, straight from its definition
static void reference(const sample *s, double sigma, long double *f) {
  const long double rho = s->R[1] * s->friction[0] * s->friction[0], tangent = sqrtl(rho / s->R[0]);
  const long double cos2 = 1.0L / (1.0L + tangent * tangent), sin2 = 1.0L - cos2, G = sqrtl(s->R[0]) * s->g[0];
  long double square = 0.0L;
  for (int j = 1; j < s->dim; j++) square += powl(s->g[j] / (long double)s->friction[j - 1], 2);
  const long double length = sqrtl(square * rho);
  const long double low = sigma * log1pl(expl((G - length / tangent) / sigma));
  const long double high = sigma * log1pl(expl((G + length * tangent) / sigma));
  f[0] = (sin2 * low + cos2 * high) / sqrtl(s->R[0]);
  for (int j = 1; j < s->dim; j++) f[j] = tangent * cos2 * (high - low) / length * s->g[j];
}

static void test_smoothed_definition(void) {
  double worst = 0.0;
  for (int trial = 0; trial < 2000; trial++) {
    const sample s = random_sample(trial % 2 ? 3 : 6);
    const double sigma = sqrt(s.R[0]) * pow(10.0, 2.0 * uniform() - 2.0);
    double f[DIM_MAX];
    long double F[DIM_MAX];
    law(&s, sigma, f, NULL, NULL);
    reference(&s, sigma, F);
    // rounding only, relative to the impulse with the smoothing's own size: seen 9e-15 (arguments of exp up to 400)
    for (int i = 0; i < s.dim; i++) {
      const double scale = i > 0 ? fabs(s.g[i]) : fabs(s.g[0]) + sigma / sqrt(s.R[0]);
      worst = fmax(worst, (double)fabsl(f[i] - F[i]) / scale);
    }
    CHECK(inner(&s, f) > -1e-15 * f[0]);
    CHECK(f[0] > 0.0);
  }
  CHECK(worst <= 1e-13);
  printf("smoothed law against long double: %.1e\n", worst);
}

static void test_derivatives(void) {
  double worst_f = 0.0, worst_H = 0.0, worst_psd = 0.0;
  static const int dims[] = {1, 3, 4, 6};
  for (int trial = 0; trial < 2000; trial++) {
    const sample s = random_sample(dims[trial % 4]);
    const double sigma = trial % 3 ? sqrt(s.R[0]) * pow(10.0, 1.5 * uniform() - 1.5) : 0.0;
    const int n = s.dim;
    double f[DIM_MAX], H[DIM_MAX * DIM_MAX], psi;
    law(&s, sigma, f, H, &psi);
    // v_next = -R g up to a constant: d/dv_next = -R^-1 d/dg; step of four-point differences in scaled units
    for (int j = 0; j < n; j++) {
      const double step = 1e-3 * (sigma > 0.0 ? sigma : sqrt(s.R[0])) / sqrt(s.R[j]);
      double derivative = 0.0, F[DIM_MAX], column[DIM_MAX] = {0.0}, normal[4];
      static const double offset[] = {1.0, -1.0, 2.0, -2.0},
                          weight[] = {2.0 / 3.0, -2.0 / 3.0, -1.0 / 12.0, 1.0 / 12.0};
      for (int k = 0; k < 4; k++) {
        sample near = s;
        double value;
        near.g[j] += offset[k] * step;
        law(&near, sigma, F, NULL, &value);
        derivative += weight[k] * value / (s.R[j] * step);
        for (int i = 0; i < n; i++) column[i] += weight[k] * F[i] / (s.R[j] * step);
        normal[k] = inner(&near, F);
      }
      // dPsi/dg_j = R_j f_j: truncation (1e-3)^4, cancellation 1e-16 Psi/step: 1e-9 of the scale; seen 4e-10
      const double scale = sqrt(2.0 * psi / s.R[j]) + (sigma > 0.0 ? sigma : sqrt(s.R[0])) / sqrt(s.R[j]);
      const int kink = sigma == 0.0 && (normal[0] * normal[1] <= 0.0 || fabs(normal[2]) < 1e-2 || f[0] < 1e-2);
      if (!(sigma == 0.0 && kink)) {
        worst_f = fmax(worst_f, fabs(derivative - f[j]) / scale);
        for (int i = 0; i < n; i++) worst_H = fmax(worst_H, fabs(column[i] - H[i * n + j]) * sqrt(s.R[i] * s.R[j]));
      }
      for (int i = 0; i < n; i++) CHECK(H[i * n + j] == H[j * n + i]);
    }
    // positive semidefinite, at most 1/R: tried on random directions; rounding seen 2e-16
    for (int k = 0; k < 20; k++) {
      double x[DIM_MAX], bend = 0.0, length = 0.0;
      for (int i = 0; i < n; i++) x[i] = (uniform() - 0.5) * sqrt(s.R[i]);
      for (int i = 0; i < n; i++) {
        length += x[i] * x[i] / s.R[i];
        for (int j = 0; j < n; j++) bend += x[i] * H[i * n + j] * x[j];
      }
      worst_psd = fmax(worst_psd, fmax(-bend, bend - length) / length);
    }
  }
  CHECK(worst_f <= 1e-9);
  // second derivatives of the exact law are exact between kinks; smoothed: truncation as above; seen 4e-10
  CHECK(worst_H <= 1e-8);
  CHECK(worst_psd <= 1e-14);
  printf("derivatives against differences: impulse %.1e, Hessian %.1e, bounds of curvature %.1e\n", worst_f, worst_H,
         worst_psd);
}

static void test_monotone(void) {
  // (f(a) - f(b))'R(a - b) >= |R^1/2 (f(a) - f(b))|^2: firmly non-expansive, both laws; rounding seen 4e-16
  double worst = 0.0;
  for (int trial = 0; trial < 5000; trial++) {
    const sample a = random_sample(trial % 2 ? 3 : 6);
    sample b = a;
    for (int i = 0; i < b.dim; i++) b.g[i] += (uniform() - 0.5) * a.g[i];
    const double sigma = trial % 3 ? sqrt(a.R[0]) * 0.3 * uniform() : 0.0;
    double f[DIM_MAX], F[DIM_MAX], product = 0.0, square = 0.0, size = 0.0;
    law(&a, sigma, f, NULL, NULL);
    law(&b, sigma, F, NULL, NULL);
    for (int i = 0; i < a.dim; i++) {
      product += (f[i] - F[i]) * a.R[i] * (a.g[i] - b.g[i]);
      square += a.R[i] * (f[i] - F[i]) * (f[i] - F[i]);
      size += a.R[i] * (f[i] * f[i] + a.g[i] * a.g[i]);
    }
    worst = fmax(worst, (square - product) / size);
  }
  CHECK(worst <= 1e-14);
}

// sigma -> 0: the error is at most sigma log 2 sqrt(1 + tan^2 theta)-like everywhere, and that rate is met at the apex
static void test_convergence(void) {
  printf("   sigma   largest error/sigma   at the apex   on the surface   away from kinks\n");
  for (int k = 0; k <= 8; k++) {
    const double sigma = pow(10.0, -k);
    double most = 0.0, apex = 0.0, surface = 0.0, away = 0.0;
    seed = 7;
    for (int trial = 0; trial < 4000; trial++) {
      sample s = random_sample(trial % 2 ? 3 : 6);
      double f[DIM_MAX], F[DIM_MAX], error[3] = {0.0, 0.0, 0.0};
      for (int kind = 0; kind < 3; kind++) {
        double square = 0.0;
        for (int j = 1; j < s.dim; j++) square += pow(s.g[j] / s.friction[j - 1], 2);
        if (kind == 1) s.g[0] = sqrt(square);
        if (kind == 2)
          for (int i = 0; i < s.dim; i++) s.g[i] = 0.0;
        law(&s, sigma, f, NULL, NULL);
        law(&s, 0.0, F, NULL, NULL);
        for (int i = 0; i < s.dim; i++) error[kind] += s.R[i] * (f[i] - F[i]) * (f[i] - F[i]);
        error[kind] = sqrt(error[kind]);
        // relative size of the eigenvalues decides how near the kinks are
        if (kind == 0 && error[0] < 1e-6 * sigma) away += 1.0 / 4000.0;
      }
      most = fmax(most, error[0] / sigma);
      surface = fmax(surface, error[1] / sigma);
      apex = fmax(apex, error[2] / sigma);
    }
    printf("  %.0e   %.4f                %.4f        %.4f           %5.1f %%\n", sigma, most, apex, surface,
           100.0 * away);
    // |R^1/2 (f_sigma - f)|^2 = sigma^2 (sin^2 e1^2 + cos^2 e2^2) with e <= log 2: at most sigma log 2; the apex meets
    // it
    CHECK(most <= M_LN2 * (1.0 + 1e-6) && surface <= M_LN2 * (1.0 + 1e-6));
    CHECK_NEAR(apex, M_LN2, 1e-6);
    // away from the kinks the error falls exponentially: ever fewer of random points feel it
    if (k >= 6) CHECK(away > 0.99);
  }
}

static void test_scalars(void) {
  for (int trial = 0; trial < 2000; trial++) {
    const double R = pow(10.0, 4.0 * uniform() - 2.0), bound = pow(10.0, 4.0 * uniform() - 3.0);
    const double sigma = trial % 2 ? pow(10.0, 3.0 * uniform() - 2.0) : 0.0, g = 6.0 * uniform() - 3.0;
    double f, H, psi, F[2], P[2];
    cav_law_bilateral(R, sigma, bound, g, &f, &H, &psi);
    CHECK(fabs(f) <= bound * (1.0 + 4e-16) && f * g >= 0.0);
    CHECK(H >= 0.0 && H <= 1.0 / R);
    if (sigma == 0.0) CHECK(f == fmax(-bound, fmin(bound, g)));
    const double step = 1e-4 * (sigma > 0.0 ? sigma / sqrt(R) : 1.0);
    for (int k = 0; k < 2; k++) cav_law_bilateral(R, sigma, bound, g + (k ? step : -step), &F[k], NULL, &P[k]);
    if (sigma == 0.0 && fabs(fabs(g) - bound) < 2.0 * step) continue;
    // centred differences: truncation 1e-8 of the scale, cancellation 1e-12 Psi; seen 2e-9 and 1e-9
    const double scale = sqrt(2.0 * psi / R) + sigma / sqrt(R) + fabs(f);
    CHECK_NEAR((P[1] - P[0]) / (2.0 * step * R), f, 2e-8 * scale);
    CHECK_NEAR((F[1] - F[0]) / (2.0 * step), H * R, 2e-8);
  }
  // the smoothed forms are z(g) and -b + z(g + b) - z(g - b)
  for (double g = -3.0; g <= 3.0; g += 0.1)
    for (double bound = 1e-3; bound < 20.0; bound *= 3.0) {
      double f, whole, a, b;
      cav_law_bilateral(1.0, 0.5, bound, g, &f, NULL, NULL);
      cav_law_unilateral(1.0, 0.5, 0, g + bound, &a, NULL, NULL);
      cav_law_unilateral(1.0, 0.5, 0, g - bound, &b, NULL, NULL);
      cav_law_unilateral(1.0, 0.5, 0, g, &whole, NULL, NULL);
      // rounding of numbers up to 20: seen 4e-15
      CHECK_NEAR(f, a - b - bound, 2e-14);
      CHECK_NEAR(whole, 0.5 * log(1.0 + exp(2.0 * g)), 1e-15);
    }
}

static void test_extremes(void) {
  static const double sizes[] = {0.0, 5e-324, 1e-300, 1e-160, 1e-20, 1.0, 1e20, 1e160, 1e300};
  static const double sigmas[] = {0.0, 1e-300, 1e-30, 1e-8, 1.0, 1e8};
  static const double frictions[] = {0.0, 1e-30, 1e-5, 1.0, 1e5};
  static const double scales[] = {1e-15, 1e-6, 1.0, 1e6};
  for (int i = 0; i < 9 * 2; i++)
    for (int j = 0; j < 9 * 2; j++)
      for (int k = 0; k < 6; k++)
        for (int l = 0; l < 5; l++)
          for (int r = 0; r < 4; r++) {
            const double mu = frictions[l], friction[2] = {mu, mu},
                         g[3] = {sizes[i / 2] * (i % 2 ? -1.0 : 1.0), sizes[j / 2] * (j % 2 ? -1.0 : 1.0), 0.0};
            const double R[3] = {scales[r], scales[r] / (mu > 0.0 ? mu * mu : 1.0),
                                 scales[r] / (mu > 0.0 ? mu * mu : 1.0)};
            double f[3], H[9], psi, scalar, curvature;
            // with R mu^2 fixed the normal impulse is of the size of g_t/mu, which must be a number
            if (mu > 0.0 && fabs(g[1]) > 1e300 * (mu < 1.0 ? mu : 1.0)) continue;
            cav_law_cone(3, R, friction, sigmas[k], 0, g, f, H, &psi);
            for (int n = 0; n < 3; n++) CHECK(isfinite(f[n]));
            for (int n = 0; n < 9; n++) CHECK(isfinite(H[n]));
            CHECK(!isnan(psi) && psi >= 0.0);
            CHECK(fabs(f[1]) <= mu * f[0] * (1.0 + 1e-14) + 1e-322);
            if (mu == 0.0) CHECK(f[1] == 0.0 && f[2] == 0.0);
            cav_law_unilateral(R[0], sigmas[k], 0, g[0], &scalar, &curvature, &psi);
            CHECK(isfinite(scalar) && isfinite(curvature) && !isnan(psi));
            cav_law_bilateral(R[0], sigmas[k], fabs(g[1]), g[0], &scalar, &curvature, &psi);
            CHECK(isfinite(scalar) && isfinite(curvature) && !isnan(psi) && fabs(scalar) <= fabs(g[1]) * (1.0 + 1e-15));
          }
  // not-a-number comes out again, in every row kind
  const double R[3] = {1.0, 1.0, 1.0}, friction[2] = {1.0, 1.0};
  for (int k = 0; k < 2; k++)
    for (int row = 0; row < 3; row++) {
      double g[3] = {1.0, 0.5, 0.5}, f[3], scalar;
      g[row] = NAN;
      cav_law_cone(3, R, friction, k, 0, g, f, NULL, NULL);
      CHECK(isnan(f[0]) || isnan(f[1]) || isnan(f[2]));
      cav_law_unilateral(1.0, k, 0, NAN, &scalar, NULL, NULL);
      CHECK(isnan(scalar));
      cav_law_bilateral(1.0, k, 1.0, NAN, &scalar, NULL, NULL);
      CHECK(isnan(scalar));
    }
}

// z of the law that ends, in units of sigma, and its derivative
static double ending(double x, double *derivative, double *area) {
  double f, H, psi;
  cav_law_unilateral(1.0, 1.0, 1, x, &f, &H, &psi);
  if (derivative) *derivative = H;
  if (area) *area = psi;
  return f;
}

// the law that ends: nothing below -12 sigma, the other one from -9 sigma up, convex and with two derivatives between
static void test_end(void) {
  double worst = 0.0, before = 0.0;
  for (double x = -14.0; x < 3.0; x += 1e-3) {
    double f, H, psi, F, K, P, up[2], down[2];
    f = ending(x, &H, &psi);
    cav_law_unilateral(1.0, 1.0, 0, x, &F, &K, &P);
    if (x < -12.0) CHECK(f == 0.0 && H == 0.0 && psi == 0.0);
    if (x > -9.0) CHECK(f == F && H == K && psi < P);
    CHECK(fabs(f - F) < 2.0 * exp(-12.0) && H >= before);
    before = H;
    // centred differences: truncation 1e-8 of what z is there, rounding 1e-16/1e-4 of a potential that may be 7
    for (int side = 0; side < 2; side++) up[side] = ending(x + (side ? 1e-4 : -1e-4), &down[side], &P);
    CHECK_NEAR((up[1] - up[0]) / 2e-4, H, 1e-8);
    // one derivative more, which does not jump at the ends either: a jump would be of the size of exp(-9)
    if (x < -8.0) worst = fmax(worst, fabs((down[1] - down[0]) / 1e-4 - (ending(x + 2e-4, &F, NULL), F - H) / 1e-4));
  }
  CHECK(worst < 1e-7);
  // its potential has it for a gradient
  for (double x = -12.5; x < -8.0; x += 1e-2) {
    double high, low, f = ending(x, NULL, NULL);
    ending(x + 1e-4, NULL, &high);
    ending(x - 1e-4, NULL, &low);
    CHECK_NEAR((high - low) / 2e-4, f, 1e-11);
  }
}

// the cone of the law that ends from its two eigenvalues, straight from the definition; and its derivatives, where they are near
// each other too
static void test_end_of_the_cone(void) {
  double worst = 0.0, worst_H = 0.0;
  int tails = 0;
  for (int trial = 0; trial < 4000; trial++) {
    sample s = random_sample(trial % 2 ? 3 : 6);
    const double rho = s.R[1] * s.friction[0] * s.friction[0], tangent = sqrt(rho / s.R[0]), root = sqrt(s.R[0]);
    const double sigma = 0.1 * root, near = trial % 3 ? 1.0 : 1e-4;
    // the normal's argument from -16 to -6, friction of a few sigma or hardly any
    s.g[0] = -sigma / root * (6.0 + 10.0 * uniform());
    for (int j = 1; j < s.dim; j++) s.g[j] *= near * sigma / root / tangent;
    double square = 0.0, f[DIM_MAX], H[DIM_MAX * DIM_MAX], side[2][DIM_MAX];
    for (int j = 1; j < s.dim; j++) square += pow(s.g[j] / s.friction[j - 1], 2);
    const double length = sqrt(rho * square), cos2 = 1.0 / (1.0 + tangent * tangent);
    const double low = ending((root * s.g[0] - length / tangent) / sigma, NULL, NULL),
                 high = ending((root * s.g[0] + length * tangent) / sigma, NULL, NULL);
    cav_law_cone(s.dim, s.R, s.friction, sigma, 1, s.g, f, H, NULL);
    CHECK_NEAR(f[0], sigma / root * ((1.0 - cos2) * low + cos2 * high), 1e-15 * sigma / root);
    // without the cancellation that this has where they are near
    for (int j = 1; j < s.dim; j++) {
      const double expected = sigma * tangent * cos2 * (high - low) / length * s.g[j];
      worst = fmax(worst, fabs(f[j] - expected) * sqrt(s.R[j]) / sigma);
    }
    CHECK(inner(&s, f) >= -1e-14 * (f[0] + 1e-6 * sigma / root));
    tails += high > 0.0 && low == 0.0;
    for (int j = 0; j < s.dim; j++) {
      const double step = 1e-6 * sigma / sqrt(s.R[j]);
      for (int up = 0; up < 2; up++) {
        sample moved = s;
        moved.g[j] += up ? step : -step;
        cav_law_cone(s.dim, s.R, s.friction, sigma, 1, moved.g, side[up], NULL, NULL);
      }
      for (int i = 0; i < s.dim; i++) {
        const double derivative = (side[1][i] - side[0][i]) / (2.0 * step * s.R[j]);
        worst_H = fmax(worst_H, fabs(derivative - H[i * s.dim + j]) * sqrt(s.R[i] * s.R[j]));
      }
    }
  }
  printf("cone of the law that ends: against its eigenvalues %.1e, derivatives against differences %.1e\n", worst,
         worst_H);
  CHECK(tails > 100);
  // rounding; the law has a bend of its curvature at zero slip, thus 1e-6 of that
  CHECK(worst < 1e-15);
  CHECK(worst_H < 1e-8);
}

// a turret on a floor: its hinge cannot move it along the contact's normal, so its inverse weight there is rounding. Across
// the gap a smoothed law presses hardly harder than it does under the same body with a free joint: seen 4.0 times that;
// 1e15 times without a bound
static void test_turret(void) {
  static const char pattern[] =
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .2'>%s"
      "<geom type='cylinder' size='.06 .03' mass='2.5'/></body></worldbody>%s</mujoco>";
  double force[2] = {0};
  for (int k = 0; k < 2; k++) {
    char text[400];
    snprintf(text, sizeof text, pattern, k ? "<freejoint/>" : "<joint name='j' axis='0 0 1' armature='.1'/>",
             k ? "" : "<actuator><motor joint='j'/></actuator>");
    cav_model *m = scene_load(text);
    cav_state *state = m ? cav_state_new(m) : NULL;
    if (!CHECK(state != NULL)) return;
    double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *u = scene_vector(m->nv);
    memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
    state->options.smoothing = 0.05;
    CHECK(cav_inverse(m, state, q, v, v, u) == CAV_OK && state->ncontact > 0);
    for (int i = 0; i < state->ncontact; i++) force[k] += state->contact[i].impulse[0] / m->timestep;
    free(q), free(v), free(u);
    cav_state_free(state);
    cav_model_free(m);
  }
  CHECK(force[0] > 0 && force[0] < 4.1 * force[1]);
  printf("turret: %.3g N, free %.3g N\n", force[0], force[1]);
}

int main(void) {
  test_end();
  test_end_of_the_cone();
  test_turret();
  test_exact_is_the_projection();
  test_dimension_one();
  test_smoothed_definition();
  test_derivatives();
  test_monotone();
  test_convergence();
  test_scalars();
  test_extremes();
  return check_result();
}
