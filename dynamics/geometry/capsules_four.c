/// One capsule against four, with the operations and the order of a single pair (pairs.c), where all four meet by the same rule.
#include <math.h>

// first of what is written over its numbers: what is below takes four where it would take one
#include "by_four.h"

#include "capsules_four.h"
#include "spatial.h"

CAV_INLINE cav_four clamp(cav_four x, double most) {
  return choose(x < -most, CAV_ALL(-most), choose(x > most, CAV_ALL(most), x));
}

CAV_BY_FOUR int cav_capsules_four(const cav_shape *a, const double radius, const double half, const double place[3][4],
                                  const double axis[3][4], double margin, int count[4], cav_touch *const touch[4]) {
  const double lu = a->size[1], lw = half;
  cav_four u[3], w[3], p[3], q[3], d[3], cross[3], turned[3], n[3], x[3], y[3];
  for (int i = 0; i < 3; i++) {
    u[i] = CAV_ALL(a->rotation[3 * i + 2]), p[i] = CAV_ALL(a->pos[i]);
    w[i] = *(const cav_four *)axis[i], q[i] = *(const cav_four *)place[i];
  }
  sub3(d, q, p);
  const cav_four uw = dot3(u, w), ud = dot3(u, d), wd = dot3(w, d);
  cross3(cross, u, w);
  const cav_four sine2 = dot3(cross, cross);
  if (any(~(sine2 > CAV_PARALLEL * CAV_PARALLEL))) return 0;
  cross3(turned, d, w);
  cav_four s = dot3(turned, cross) / sine2, t = s * uw - wd, dist;
  const cav_four_masks across = (sizes(s) < lu) & (sizes(t) < lw);
  cav_four_masks there;
  if (!any(~across)) {
    const cav_four length = roots(dot3(cross, cross));
    const cav_four_masks back = dot3(d, cross) < -CAV_CROSSING * length * (lu + lw);
    scale3(n, choose(back, CAV_ALL(-1), CAV_ALL(1)) / length, cross);
    const cav_four apart = dot3(d, n);
    dist = choose(apart > 0, apart, CAV_ALL(0)) - a->size[0] - radius;
    there = ~(dist >= margin);
    axpy3(x, p, s, u);
  } else if (!any(across)) {
    t = clamp(clamp(s, lu) * uw - wd, lw);
    s = clamp(ud + t * uw, lu);
    axpy3(x, p, s, u);
    axpy3(y, q, t, w);
    sub3(n, y, x);
    const cav_four length2 = dot3(n, n), length = roots(length2);
    const double reach = margin + a->size[0] + radius;
    if (reach <= 0 || any(~(length > 0))) return 0;
    there = ~(length2 >= reach * reach);
    scale3(n, 1 / length, n);
    dist = length - a->size[0] - radius;
  } else {
    return 0;
  }
  axpy3(x, x, a->size[0] + dist / 2, n);
  for (int k = 0; k < 4; k++) {
    count[k] = there[k] != 0;
    if (!count[k]) continue;
    *touch[k] = (cav_touch){.dist = dist[k]};
    for (int i = 0; i < 3; i++) touch[k]->pos[i] = x[i][k], touch[k]->normal[i] = n[i][k];
  }
  return 1;
}
