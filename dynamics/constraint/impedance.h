/// The law of one row from its softness and violation (limits.c), in parts, for who takes several contacts at once.
#ifndef CAVORT_IMPEDANCE_H
#define CAVORT_IMPEDANCE_H

#include <math.h>

#include "constraint.h"

static const double R_MIN = 1e-15, IMPEDANCE_MIN = 1e-4, IMPEDANCE_MAX = 0.9999, FRICTION_MIN = 1e-5;

static inline double larger(double a, double b) { return a > b ? a : b; }

static inline double clamp_between(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

// sigmoid of solimp on [0, 1]: a power on either side of the midpoint, meeting there with equal derivative
static inline double sigmoid(double x, double midpoint, double power) {
  if (power == 1) { return x; }
  if (power == 2) { return x <= midpoint ? x * x / midpoint : 1 - (1 - x) * (1 - x) / (1 - midpoint); }
  if (x <= midpoint) { return pow(x, power) / pow(midpoint, power - 1); }
  return 1 - pow(1 - x, power) / pow(1 - midpoint, power - 1);
}

// impedance d(x) of solimp at a violation x, between its ends
static inline double impedance(const double solimp[5], double d0, double dw, double x) {
  double width = solimp[2];
  if (d0 == dw || width <= R_MIN) { return 0.5 * (d0 + dw); }
  if (x >= width) { return dw; }
  if (x <= 0) { return d0; }
  double y = sigmoid(x / width, clamp_between(solimp[3], IMPEDANCE_MIN, IMPEDANCE_MAX), larger(1, solimp[4]));
  return d0 + y * (dw - d0);
}

/// What of a softness is the same at any violation.
typedef struct law_terms {
  double d0, dw, damping,
      by; ///< ends of the impedance; h B; h K is h times the impedance, or that times factor, over by
  double factor;
  int direct; ///< stiffness and damping are given
} law_terms;

static inline law_terms terms_of(const cav_state *state, const cav_softness *softness) {
  double h = state->options.timestep, kappa = softness->solref[0], zeta = softness->solref[1];
  law_terms t = {.d0 = clamp_between(softness->solimp[0], IMPEDANCE_MIN, IMPEDANCE_MAX),
                 .dw = clamp_between(softness->solimp[1], IMPEDANCE_MIN, IMPEDANCE_MAX)};
  if ((kappa > 0) != (zeta > 0)) kappa = 0.02, zeta = 1;
  t.direct = !(kappa > 0);
  if (t.direct) {
    t.damping = h * -zeta / t.dw;
    t.factor = h * -kappa;
    t.by = t.dw * t.dw;
  } else {
    if (state->options.refsafe) { kappa = larger(kappa, 2 * h); }
    t.damping = h * 2 / larger(R_MIN, t.dw * kappa);
    t.factor = h;
    t.by = larger(R_MIN, t.dw * t.dw * kappa * kappa * zeta * zeta);
  }
  return t;
}

// by solref and solimp; violation x >= 0
static inline cav_law solref_law(const cav_softness *softness, const law_terms *t, double x, double weight) {
  const double d = impedance(softness->solimp, t->d0, t->dw, x);
  return (cav_law){larger(R_MIN, (1 - d) / d * weight), t->damping, t->factor * d / t->by};
}

// by the discrete step: the same for every row but R
static inline cav_law discrete_law(const cav_state *state, double weight) {
  const cav_workspace *w = state->work;
  return (cav_law){larger(R_MIN, state->options.softness * weight), w->discrete_damping, w->discrete_stiffness};
}

// inverse weight of a contact. Next to a base that is fixed, a link (the turret of an arm) has almost none where its
// joints cannot move it, and its softness would be as small: a smoothed law, which reaches across gaps, would press
// with forces beyond any bound. There it has at least a quarter of that of all that moves: less than any body has
// whose base is free, along a single line (a third, the mean of its three directions), too.
static inline double contact_weight(const cav_state *state, const cav_pair *pair) {
  const cav_model *model = state->model;
  return state->options.smoothing > 0 && model->mass > 0 ? larger(pair->weight[0], 0.25 / model->mass)
                                                         : pair->weight[0];
}

#endif
