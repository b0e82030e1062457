/// What follows for a term from its quantity. Private to optim/ and the tool.
#ifndef CAVORT_QUANTITY_H
#define CAVORT_QUANTITY_H

#include "cavort/problem.h"

enum { CAV_DEFAULT_TERMS = 10 }; ///< default costs

/// Last stage of an evaluation that a term reads.
cav_sensor_stage cav_term_stage(const cav_term *term);

/// Whether a term selects dofs.
int cav_term_has_dofs(const cav_term *term);

#endif
