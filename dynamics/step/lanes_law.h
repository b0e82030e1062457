/// Laws of rows in four states side by side: what does not depend on the violation once for all, the rest by
/// vectors, with the operations of one row (limits.c). After by_four.h. Private to dynamics/.
#ifndef CAVORT_LANES_LAW_H
#define CAVORT_LANES_LAW_H

#include "impedance.h"

/// What a row's law has in common.
static inline cav_row_law row_law_of(const cav_state *state, const cav_softness *softness, double weight) {
  cav_row_law law = {.known = 1, .weight = weight};
  if (state->options.stabilisation == CAV_STABILISATION_DISCRETE) {
    const cav_law discrete = discrete_law(state, weight);
    law.regulariser = discrete.regulariser, law.damping = discrete.damping, law.stiffness = discrete.stiffness;
    return law;
  }
  const law_terms terms = terms_of(state, softness);
  law.curved = 1;
  law.ends[0] = terms.d0, law.ends[1] = terms.dw;
  law.width = softness->solimp[2];
  law.midpoint = clamp_between(softness->solimp[3], IMPEDANCE_MIN, IMPEDANCE_MAX);
  law.power = larger(1, softness->solimp[4]);
  law.damping = terms.damping;
  law.factor = terms.factor, law.stiffness = terms.by;
  return law;
}

CAV_INLINE cav_four larger_four(cav_four a, cav_four b) { return choose(a > b, a, b); }

// sigmoid of solimp
CAV_INLINE cav_four sigmoid_four(cav_four x, double midpoint, double power) {
  if (power == 1) return x;
  if (power == 2) return choose(x <= midpoint, x * x / midpoint, 1 - (1 - x) * (1 - x) / (1 - midpoint));
  cav_four y;
  for (int i = 0; i < 4; i++) y[i] = sigmoid(x[i], midpoint, power);
  return y;
}

CAV_INLINE cav_four impedance_four(const cav_row_law *law, cav_four x) {
  const double d0 = law->ends[0], dw = law->ends[1], width = law->width;
  if (d0 == dw || width <= R_MIN) return CAV_ALL(0.5 * (d0 + dw));
  const cav_four_masks whole = x >= width, none = x <= 0;
  // where neither end counts
  const cav_four inside = choose(whole | none, CAV_ALL(0), x);
  const cav_four d = d0 + sigmoid_four(inside / width, law->midpoint, law->power) * (dw - d0);
  return choose(whole, CAV_ALL(dw), choose(none, CAV_ALL(d0), d));
}

/// R and h K of one-sided rows at a distance beyond their margin.
CAV_INLINE void law_at(const cav_row_law *law, cav_four distance, cav_four *R, cav_four *stiffness) {
  *R = CAV_ALL(law->regulariser);
  *stiffness = CAV_ALL(law->stiffness);
  if (!law->curved) return;
  const cav_four d = impedance_four(law, larger_four(CAV_ALL(0), -distance));
  *R = larger_four(CAV_ALL(R_MIN), (1 - d) / d * law->weight);
  *stiffness = law->factor * d / law->stiffness;
}

#endif
