/// A motion as one page of HTML that needs no server and no network.
#ifndef CAVORT_VIEW_H
#define CAVORT_VIEW_H

#include "cavort/dynamics.h"

/// One contact force to draw as an arrow, on the second body of the contact.
typedef struct cav_view_force {
  double pos[3];   ///< m, world
  double force[3]; ///< N, world
} cav_view_force;

/// One chart: a value at every knot. What is not finite is a gap in the line.
typedef struct cav_view_series {
  const char *group; ///< heading the chart stands under; NULL: none
  const char *name;
  const char *unit;     ///< NULL: none
  const double *value;  ///< [nknot]
  double lower, upper;  ///< limits to draw; not finite: none
  const double *wanted; ///< [nknot] what was asked of it there, not finite: nothing; NULL: nothing anywhere
} cav_view_series;

/// One line of the verdict.
typedef struct cav_view_line {
  const char *label;
  const char *value; ///< with its unit, as it is to be read
  int passed;        ///< 1: held, 0: missed, -1: only told
} cav_view_line;

/// What to show. Everything but the motion may be absent: zero counts, NULL.
typedef struct cav_view_input {
  const char *title;
  int nknot;                   ///< >= 1
  double timestep;             ///< s, > 0
  const double *q;             ///< [nknot*nq]
  const double *goal;          ///< [nq] posture to show as a ghost; NULL: none
  const int *nforce;           ///< [nknot] forces at each knot; NULL: no forces
  const cav_view_force *force; ///< of all knots, one after the other
  int nseries;
  const cav_view_series *series;
  int nline;
  const cav_view_line *line;
} cav_view_input;

/// Writes the page: poses of all links at all knots, the model's geoms, forces, charts and verdict, three.js inlined.
/// three.js is read from $CAVORT_THREE_JS, or from where the build found it. The file is replaced atomically.
/// CAV_BAD_INPUT: sizes are wrong, three.js is missing, or path cannot be written; CAV_NOT_FINITE: a configuration is
/// not; CAV_NO_MEMORY. In each case there is no new page and error (may be NULL) says why.
cav_status cav_view_write(const char *path, const cav_model *model, const cav_view_input *input, cav_error *error);

#endif
