/// What a problem asks at one knot as a list of values: residuals of costs, and constraints between bounds with the
/// multipliers that a solution gives them. Private to optim/verify.
#ifndef CAVORT_KNOT_ROWS_H
#define CAVORT_KNOT_ROWS_H

#include "verification.h"

typedef struct cav_knot_row {
  const cav_term *term; ///< a cost: weight times the norm of the value; NULL: a constraint
  double weight;
  int windowed; ///< 1: the weight is the step times that of the term
  cav_binding_kind kind;
  int object, component; ///< as in cav_binding; unactuated: the dof
  double lower, upper, multiplier;
} cav_knot_row;

typedef struct cav_knot_rows {
  int n, room;
  cav_knot_row *row; ///< [n]
  int ncontact, contact_room;
  int (*contact)[2]; ///< [ncontact] pair and feature of the contacts that rows are of
  char *unactuated;  ///< [nv] 1: no actuator gives all of this dof's force; NULL until found
  int work_room;
  double *work;
} cav_knot_rows;

void cav_knot_rows_clear(cav_knot_rows *rows);

/// Lists the rows of knot t, at which verification->state and control are, with the multipliers among row [nrow] (those
/// of forces that no actuator gives are left out). CAV_NO_MEMORY.
cav_status cav_knot_rows_list(const cav_verification *verification, int t, int nrow, const cav_binding *row,
                              cav_knot_rows *rows);

/// Their values [n] at the knot's present state; NaN for rows of contacts that are gone. CAV_NO_MEMORY.
cav_status cav_knot_rows_read(const cav_verification *verification, int t, cav_knot_rows *rows, double *value);

#endif
