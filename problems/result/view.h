/// A motion, or two beside each other, as one page of HTML that needs no server and no network.
#ifndef CAVORT_VIEW_H
#define CAVORT_VIEW_H

#include "cavort/dynamics.h"

/// One contact force, on the second link of the contact.
typedef struct cav_view_force {
  double pos[3];    ///< m, world
  double force[3];  ///< N, world
  double normal[3]; ///< from the first link to the second
  double friction;  ///< of sliding, 0: none
  int link1, link2;
} cav_view_force;

/// A place that was asked of something, to mark.
typedef struct cav_view_target {
  const char *name;
  int from, to;  ///< knots
  double pos[3]; ///< m, world; what is not finite was not asked
  double got[3]; ///< where the thing is at the first of the knots
} cav_view_target;

/// One chart: a value at every knot. What is not finite is a gap in the line.
typedef struct cav_view_series {
  const char *group; ///< heading the chart stands under; NULL: none
  const char *name;
  const char *unit;     ///< NULL: none
  const double *value;  ///< [nknot]
  double lower, upper;  ///< limits to draw; not finite: none
  int share;            ///< 1: an effort, told as a fraction of its limit too
  const double *wanted; ///< [nknot] what was asked of it there, not finite: nothing; NULL: nothing anywhere
} cav_view_series;

/// One line of the verdict.
typedef struct cav_view_line {
  const char *label;
  const char *value; ///< with its unit, as it is to be read
  int passed;        ///< 1: held, 0: missed, -1: only told
} cav_view_line;

/// What to show. Everything but the model and the motion may be absent: zero counts, NULL.
typedef struct cav_view_input {
  const cav_model *model;
  const cav_model
      *drawn; ///< the model's file with what is only seen of it: its meshes are drawn; NULL: the model's own geoms
  const char *title;
  const char *label;           ///< tells it from another motion on the page
  int nknot;                   ///< >= 1
  double timestep;             ///< s, > 0
  const double *q;             ///< [nknot*nq]
  const double *goal;          ///< [nq] posture to show as a ghost; NULL: none
  const int *nforce;           ///< [nknot] forces at each knot; NULL: no forces
  const cav_view_force *force; ///< of all knots, one after the other
  int ntarget;
  const cav_view_target *target;
  int nseries;
  const cav_view_series *series;
  int nline;
  const cav_view_line *line;
} cav_view_input;

/// Writes the page of n motions, 1 or 2: poses of all links at all knots, the models' geoms, forces, charts and verdicts,
/// three.js inlined. Two are drawn one within the other or side by side, their charts over each other.
/// three.js is read from $CAVORT_THREE_JS, or from where the build found it. The file is replaced atomically.
/// CAV_BAD_INPUT: sizes are wrong, three.js is missing, or path cannot be written; CAV_NOT_FINITE: a configuration is
/// not; CAV_NO_MEMORY. In each case there is no new page and error (may be NULL) says why.
cav_status cav_view_write(const char *path, int n, const cav_view_input *input, cav_error *error);

#endif
