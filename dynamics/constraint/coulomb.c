/// Contact law without the sliding artefact of the convex one, in closed form (dynamics/METHOD.md, 9). The convex law
/// of contact_law.c puts the slack w = R f + v_next - v* into the dual cone, so a contact that slides has w_n = |mu
/// w_t|: it is held off. De Saxce's correction lowers v*_n by |mu w_t|; torsion and rolling enter with their own
/// coefficients. The normal row is then alone, 0 <= f_n complementary to w_n >= 0, and friction is the nearest to g
/// within the ellipse that the normal impulse allows:
///
///   f_n = max(0, g_n),  f_j = mu_j h_j min(T, f_n)/T,  h_j = g_j/mu_j,  T = |h|.
///
/// Smoothed: f_n by z of contact_law.c, and for the lesser of T and f_n, with a = sqrt(rho) T/tau and b = sqrt(rho)
/// f_n/tau,
///
///   m(a, b) = log cosh((a + b)/2) - log cosh((a - b)/2) < min(a, b),  tau = sigma tan(theta)/2,
///
/// so that slow sliding meets the same friction as under the convex law: f_n times the slip over mu delta/h. It is odd
/// in T, so nothing happens at zero slip; homogeneous in (g, sigma) as the convex law is, but no gradient of a
/// potential: its derivative is not symmetric. With the normal impulse of friction held it is one, which a forward step
/// makes use of.
#include <math.h>

#include "constraint.h"

enum { DIM_MAX = 6 };

/// The lesser of two positive numbers, rounded over tau, and its derivatives.
typedef struct lesser {
  double ratio; ///< m/a
  double a, b;  ///< dm/da, dm/db
} lesser;

static lesser exact_lesser(double a, double b) {
  if (!(b > 0.0)) return (lesser){0.0, 0.0, a > 0.0};
  return a <= b ? (lesser){1.0, 1.0, 0.0} : (lesser){b / a, 0.0, 1.0};
}

// from where on a number and one more than its e^-x are the same
static const double NOTHING = 38.0;

static double decay(double x) { return x < NOTHING ? exp(-x) : 0.0; }

// 1 - e^-x
static double rise(double x) { return x < NOTHING ? -expm1(-x) : 1.0; }

// the derivatives on request only: sinh(y)/(cosh(x) + cosh(y)) at x = a/tau, y = b/tau, and with x and y the other way round.
// With u = e^-x, w = e^-y the first is u (1 - w^2)/((u + w) (1 + u w)): near is the lesser of u/w and w/u, far is u w
static lesser smooth_lesser(double a, double b, double tau, int derivatives) {
  lesser m = {0.0, 0.0, 0.0};
  const double low = a < b ? a : b, near = exp(-fabs(a - b) / tau), far = decay((a + b) / tau);
  if (derivatives) {
    const double lower = 1.0 / (1.0 + near) / (1.0 + far), higher = near * lower;
    m.a = (a < b ? lower : higher) * rise(2.0 * b / tau);
    m.b = (a < b ? higher : lower) * rise(2.0 * a / tau);
  }
  if (!(a > 0.0))
    m.ratio = tanh(0.5 * b / tau);
  else if (low < tau)
    m.ratio = atanh(tanh(0.5 * a / tau) * tanh(0.5 * b / tau)) / (0.5 * a / tau);
  else
    m.ratio = (low + tau * (log1p(far) - log1p(near))) / a;
  return m;
}

// length of the friction coordinates h [dim-1] and their direction in their place; returns 0 where there is none
static double normalise(int n, double *h) {
  double most = 0.0, square = 0.0;
  for (int j = 0; j < n; j++) most = !(fabs(h[j]) <= most) ? fabs(h[j]) : most;
  if (most == 0.0) return 0.0;
  for (int j = 0; j < n; j++) square += h[j] / most * (h[j] / most);
  const double root = sqrt(square);
  for (int j = 0; j < n; j++) h[j] = h[j] / most / root;
  return most * root;
}

void cav_law_coulomb(int dim, const double *R, const double *friction, double sigma, int ends, const double *held,
                     const double *g, double *f, double *hessian, double *potential) {
  double h[DIM_MAX - 1] = {0.0}, curvature;
  cav_law_unilateral(R[0], sigma, ends, g[0], f, &curvature, potential);
  for (int i = 1; hessian && i < dim * dim; i++) hessian[i] = 0.0;
  for (int j = 1; j < dim; j++) f[j] = 0.0;
  if (hessian) hessian[0] = curvature;
  const double rho = cav_friction_regulariser(dim, R, friction);
  if (!(rho > 0.0)) return;
  // where the law has ended there is no friction to find
  if (ends && !held && f[0] == 0.0) return;

  // friction coordinates
  for (int j = 1; j < dim; j++) h[j - 1] = friction[j - 1] > 0.0 ? g[j] / friction[j - 1] : 0.0;
  const double length = normalise(dim - 1, h), bound = held ? *held : f[0], root = sqrt(rho);
  const double tau = 0.5 * sigma * sqrt(rho / R[0]);
  const lesser m =
      tau > 0.0 ? smooth_lesser(root * length, root * bound, tau, hessian != NULL) : exact_lesser(length, bound);
  for (int j = 1; j < dim; j++) f[j] = friction[j - 1] * (m.ratio * length) * h[j - 1];
  if (potential && held) {
    double along, friction_potential;
    cav_law_bilateral(rho, tau, bound, length, &along, NULL, &friction_potential);
    *potential += friction_potential;
  }
  for (int j = 1; hessian && j < dim; j++) {
    const double mu = friction[j - 1], towards = mu * h[j - 1];
    hessian[j * dim] = held ? 0.0 : towards * m.b * curvature;
    for (int k = 1; k < dim; k++) hessian[j * dim + k] = (m.a - m.ratio) / rho * towards * (friction[k - 1] * h[k - 1]);
    hessian[j * dim + j] += m.ratio / rho * mu * mu;
  }
}

void cav_law_contact(const cav_state *state, const cav_contact *c, const double *g, double *f, double *hessian) {
  const int ends = cav_contact_ends(state, c);
  if (state->options.sliding == CAV_SLIDING_COULOMB)
    cav_law_coulomb(c->dim, c->regulariser, c->friction, c->sigma, ends, NULL, g, f, hessian, NULL);
  else
    cav_law_cone(c->dim, c->regulariser, c->friction, c->sigma, ends, g, f, hessian, NULL);
}
