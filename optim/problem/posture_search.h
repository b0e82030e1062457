/// Postures by least squares: rows over configurations, made as small as they can be. Private to optim/problem.
#ifndef CAVORT_POSTURE_SEARCH_H
#define CAVORT_POSTURE_SEARCH_H

#include "cavort/dynamics.h"

/// What is searched.
typedef struct cav_posture_search {
  const cav_model *model;
  int nrow;  ///< rows that there are
  double *q; ///< [nq] where it begins, and in the end what was found
  /// Rows [nrow] at q [nq].
  cav_status (*rows)(void *user, const double *q, double *row);
  void *user; ///< handed to rows
} cav_posture_search;

/// Gauss-Newton with a Levenberg-Marquardt damping on the manifold of configurations, derivatives by differences; hinges and
/// slides stay within their ranges by 0.02 rad or m. Calls rows at what it found last. Errors are those of rows, or
/// CAV_NO_MEMORY.
cav_status cav_posture_find(cav_posture_search *search);

/// How deep links are inside each other: of the deepest pair, or root of the sum of squares over all of them.
typedef enum cav_depth { CAV_DEPTH_DEEPEST, CAV_DEPTH_ALL } cav_depth;

/// It, m, by the contacts that the state has.
double cav_posture_depth(const cav_model *model, const cav_state *state, cav_depth of);

/// Brings hinges and slides of q [nq] into these ranges.
void cav_posture_clip(const cav_model *model, double *q);

#endif
