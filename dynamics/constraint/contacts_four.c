/// Contacts of a state four at a time: axes from normals and tangents, and the exact law of friction cones of three rows, with
/// the operations and the order of a single one (collide.c, contact_law.c).
#include <float.h>
#include <math.h>

// first of what is written over its numbers: what is below takes four where it would take one
#include "by_four.h"

#include "constraint.h"
#include "four_turn.h"
#include "spatial.h"

// four numbers of each of four contacts from a member on, by number, and back
#define OF_EACH(c, member) \
  { &(c)[0].member, &(c)[1].member, &(c)[2].member, &(c)[3].member }

CAV_BY_FOUR void cav_frames_four(cav_contact *c) {
  cav_four n[4], t[4], s[3], frame[8];
  turn_in((const double *const[])OF_EACH(c, frame[0]), n);
  turn_in((const double *const[])OF_EACH(c, frame[2]), t);
  // t: the normal's last number, then the tangent
  axpy3(s, t + 1, -dot3(n, t + 1), n);
  const cav_four_masks none = dot3(s, s) < 1e-12;
  if (any(none)) {
    const cav_four_masks y = sizes(n[1]) < 0.5;
    cav_four other[3] = {CAV_ALL(0), choose(y, CAV_ALL(1), CAV_ALL(0)), choose(y, CAV_ALL(0), CAV_ALL(1))};
    axpy3(other, other, -dot3(n, other), n);
    for (int k = 0; k < 3; k++) s[k] = choose(none, other[k], s[k]);
  }
  const cav_four length = roots(dot3(s, s)), inverse = 1 / length;
  for (int k = 0; k < 3; k++) s[k] = choose(length > 0, inverse * s[k], CAV_ALL(k == 0));
  copy3(frame, s);
  cross3(frame + 3, n, s);
  turn_out(frame, (double *const[])OF_EACH(c, frame[3]));
  turn_out(frame + 2, (double *const[])OF_EACH(c, frame[5]));
}

CAV_BY_FOUR int cav_law_four(cav_contact *c) {
  for (int i = 0; i < 4; i++)
    if (c[i].dim != 3 || c[i].sigma != 0) return 0;
  cav_four place[4], softness[4], keep[4], now[4], next[4], g[3], f[4], R[3];
  turn_in((const double *const[])OF_EACH(c, dist), place);
  turn_in((const double *const[])OF_EACH(c, stiffness), softness);
  turn_in((const double *const[])OF_EACH(c, damping[0]), keep);
  turn_in((const double *const[])OF_EACH(c, velocity[0]), now);
  turn_in((const double *const[])OF_EACH(c, velocity_next[0]), next);
  const cav_four dist = place[0], margin = place[1], *friction = softness + 2;
  R[0] = place[2], R[1] = place[3];
  R[2] = (cav_four){c[0].regulariser[2], c[1].regulariser[2], c[2].regulariser[2], c[3].regulariser[2]};
  cav_four size = CAV_ALL(0);
  for (int k = 0; k < 3; k++) {
    cav_four target = (1 - keep[k]) * now[k];
    if (k == 0) target = target - softness[0] * (dist - margin);
    g[k] = (target - next[k]) / R[k];
    size = choose(size > sizes(g[k]), size, sizes(g[k]));
  }
  // what would overflow or vanish, and what has no friction, is a single one's
  const cav_four rho = R[1] * friction[0] * friction[0], tangent = roots(rho / R[0]);
  const cav_four_masks ordinary = ((size <= 1e100) & (size >= 1e-100)) | (size == 0);
  if (any(~(ordinary & (friction[0] > 0) & (friction[1] > 0) & (tangent > 0)))) return 0;

  const cav_four side[2] = {g[1] / friction[0], g[2] / friction[1]};
  const cav_four root = roots(R[0]), length = roots(rho) * roots(side[0] * side[0] + side[1] * side[1]);
  const cav_four normal = root * g[0], top = normal + length * tangent, cos2 = 1 / (1 + tangent * tangent);
  const cav_four_masks inside = normal * tangent >= length, off = top <= 0;
  const cav_four on_surface = cos2 * top, pushed = choose(off, CAV_ALL(0), on_surface);
  const cav_four ratio = choose(inside, CAV_ALL(1), choose(off, CAV_ALL(0), tangent * on_surface / length));
  f[0] = choose(inside, g[0], pushed / root);
  for (int k = 1; k < 3; k++) f[k] = ratio * g[k];
  f[3] = CAV_ALL(0);
  turn_out(f, (double *const[])OF_EACH(c, impulse[0]));
  return 1;
}
