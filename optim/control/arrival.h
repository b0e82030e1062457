/// Arrival cost: what all that comes before a window says of its first state. Private to optim/.
#ifndef CAVORT_ARRIVAL_H
#define CAVORT_ARRIVAL_H

#include "information.h"

enum { CAV_ARRIVAL_TERMS = 2 };

/// Half the square of root (q (-) q0; v - v0) + rest, in two terms of nv rows each.
typedef struct cav_arrival {
  const cav_model *model;
  double *root, *rest; ///< [2nv*2nv] upper triangular, [2nv]
  double *q, *v;       ///< [nq], [nv] about which
  cav_user_quantity quantity[CAV_ARRIVAL_TERMS];
  struct cav_arrival_part {
    const struct cav_arrival *of;
    int first; ///< row
  } part[CAV_ARRIVAL_TERMS];
} cav_arrival;

/// Zero. CAV_NO_MEMORY. Clear it in any case; it has to stay where it is.
cav_status cav_arrival_begin(cav_arrival *arrival, const cav_model *model);
void cav_arrival_clear(cav_arrival *arrival);

/// Its terms, at the first knot.
void cav_arrival_terms(const cav_arrival *arrival, cav_term term[CAV_ARRIVAL_TERMS]);

/// The arrival cost of the window that begins a knot later: from the rows that the elimination of the first block has left in
/// an information of the merit, at the motion that it is of.
void cav_arrival_take(cav_arrival *arrival, const cav_information *information, const cav_trajectory *at);

/// The same cost for another; both of one model.
void cav_arrival_copy(cav_arrival *to, const cav_arrival *from);

#endif
