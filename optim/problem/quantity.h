/// What follows for a term from its quantity. Private to optim/ and the tool.
#ifndef CAVORT_QUANTITY_H
#define CAVORT_QUANTITY_H

#include "cavort/problem.h"

enum { CAV_DEFAULT_TERMS = 10 }; ///< default costs

/// Last stage of an evaluation that a term reads.
cav_sensor_stage cav_term_stage(const cav_term *term);

/// The same of a channel of a record.
cav_sensor_stage cav_channel_stage(const cav_channel *channel);

/// Whether a channel is an orientation: a quaternion, compared as a rotation vector.
int cav_channel_rotates(const cav_channel *channel);

/// Values of a channel.
int cav_channel_dim(const cav_channel *channel);

/// Whether a term selects dofs.
int cav_term_has_dofs(const cav_term *term);

#endif
