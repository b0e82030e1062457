/// Feedback gains of a solved motion. Private to optim/.
#ifndef CAVORT_FEEDBACK_H
#define CAVORT_FEEDBACK_H

#include "gauss_newton.h"

/// Gains du_t = gain_q dq_t + gain_v dv_t for t = 0 .. nknot-2, each [nv*nv] row-major, from gathered normal equations and the
/// derivatives of u at the same point. tracking is added to the Hessian's diagonal: the price of straying from the motion.
/// Knots 0 and 1 repeat the gains of knot 2: what they look back on is given, so they have none of their own.
cav_status cav_feedback(const cav_transcription *transcription, const cav_normal *normal, double tracking,
                        double *gain_q, double *gain_v);

#endif
