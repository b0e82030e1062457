/// Stiff constraints by the proximal point method: the impulse problem with more regulariser than it has, and what that
/// changes given back by impulses found before. Private to dynamics/.
#ifndef CAVORT_PROXIMAL_H
#define CAVORT_PROXIMAL_H

#include "impulse.h"

/// Rows with regulariser r R, r >= 1, and target v* + (r - 1) R f, f the impulses last found: who finds f again has
/// solved the problem itself.
typedef struct cav_proximal {
  cav_impulse *problem;
  double *R, *target; ///< [nrow] of the problem itself
  double *f;          ///< [nrow] impulses last found
  double *weight;     ///< [nblock] estimate of the diagonal of A, by which the level is measured
} cav_proximal;

enum { CAV_PROXIMAL_PER_ROW = 3, CAV_PROXIMAL_PER_BLOCK = 1 }; ///< doubles of room

/// Takes over the problem, no impulses found yet; room: doubles as counted above. proximal.c.
void cav_proximal_begin(cav_proximal *s, cav_impulse *problem, double *room);

/// Raises R to level times the weight where it is less, in rows of an exact law. Returns whether none was less.
int cav_proximal_set(cav_proximal *s, double level);

/// Takes f [nrow] for what was found at y [nrow]. Returns the largest change of a target by it, relative to the
/// velocities of its block: how far y is from the problem's own.
double cav_proximal_update(cav_proximal *s, const double *f, const double *y);

/// The problem as it was.
void cav_proximal_end(cav_proximal *s);

#endif
