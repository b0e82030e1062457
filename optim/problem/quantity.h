/// What follows for a term from its quantity. Private to optim/ and the tool.
#ifndef CAVORT_QUANTITY_H
#define CAVORT_QUANTITY_H

#include "cavort/problem.h"

enum { CAV_DEFAULT_TERMS = 12 }; ///< default costs

/// Ready sets of running costs, X(style, word, text): weights in the place of some defaults, and costs beside them.
#define CAV_STYLES(X)                                                         \
  X(CAREFUL, "careful", "slow changes of speed, soft landings, little force") \
  X(ATHLETIC, "athletic", "free limbs and speed, less effort")

/// Styles: CAV_STYLES.
typedef enum cav_style {
#define CAV_STYLE_MEMBER(style, ...) CAV_STYLE_##style,
  CAV_STYLES(CAV_STYLE_MEMBER)
#undef CAV_STYLE_MEMBER
      CAV_STYLE_TYPES
} cav_style;

enum { CAV_STYLE_TERMS = 1 }; ///< most costs that a style adds

/// Gives n default costs the weights of a style and adds its own behind them, CAV_STYLE_TERMS at most; returns how many
/// there are.
int cav_style_terms(cav_style style, cav_term *term, int n);

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

/// Numbers of a term's target, components that it may pick; 0: it has one number for all that it is of.
int cav_term_target_length(const cav_model *model, const cav_term *term);

/// Target of a term at a time, dim numbers: constant, between waypoints, or zeros.
void cav_term_target(const cav_term *term, double time, int dim, double *target);

/// Whether a term asks for anything: it is no cost without a weight.
int cav_term_asks(const cav_term *term);

/// Whether it is a cost on the forces of a body of the world, which says that this is to be avoided.
int cav_term_avoids(const cav_model *model, const cav_term *term);

/// Whether it is a cost on the turning of free roots over the whole motion.
int cav_term_calms(const cav_term *term);

/// The link whose place in the world a term is of, 0: the world; -1: it is of no place.
int cav_term_placed(const cav_model *model, const cav_term *term);

#endif
