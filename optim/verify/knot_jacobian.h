/// Derivatives of a knot's rows by the unknowns of a motion: tangents of the knots that are not given, before them the
/// step times v_0 where the start is free, and the logarithm of the step where that is free. Private to optim/verify.
#ifndef CAVORT_KNOT_JACOBIAN_H
#define CAVORT_KNOT_JACOBIAN_H

#include "knot_rows.h"

typedef struct cav_knot_jacobian {
  int blocks, unknowns; ///< nv unknowns each, in the order of time; in all
  int width, free_step; ///< columns of a knot: three blocks, and the step's where it is free
  cav_knot_rows rows;   ///< of the knot differentiated last
  double *value;        ///< [rows.n] their values
  double *row;          ///< [rows.n*width]
  // private
  const cav_verification *base;
  cav_verification at; ///< the motion, its knots being moved
  double *q, *tangent; ///< at.q; [nv]
  double *push;        ///< [nv] what is added to the step times v_0
  int evaluated;       ///< knot that the state is at, -1: none; at this step, and [nq+nv] q and v:
  double step, *point;
  int room;
  double *plus, *minus; ///< [room]
} cav_knot_jacobian;

/// For a motion whose velocities are known; CAV_NO_MEMORY. Clear it in any case.
cav_status cav_knot_jacobian_start(cav_knot_jacobian *jacobian, const cav_verification *verification);
void cav_knot_jacobian_clear(cav_knot_jacobian *jacobian);

/// Lists the rows of knot t, with multipliers from binding [nbinding], and differentiates them.
cav_status cav_knot_jacobian_find(cav_knot_jacobian *jacobian, int t, int nbinding, const cav_binding *binding);

/// The unknown that a column of knot t is; -1: none.
int cav_knot_jacobian_unknown(const cav_knot_jacobian *jacobian, int t, int column);

#endif
