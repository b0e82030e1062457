/// Feedback gains of a solved motion. Private to optim/.
#ifndef CAVORT_FEEDBACK_H
#define CAVORT_FEEDBACK_H

#include "transcription.h"

/// Penalty on straying from a motion.
typedef struct cav_feedback_penalty {
  double tracking; ///< of the energy of straying, in weight times CAV_MOMENT_ARM, against one actuator at its limit
  double rate;     ///< rad/s: straying by an angle or way counts as a velocity of rate times that
  double
      balance; ///< times that the energy of the centre of mass of a tree that moves freely counts beside that of its links
  int room;    ///< 1: an effort counts over what the motion leaves of its actuator's limit; 0: over the limit
} cav_feedback_penalty;

/// Gains du = gain_q dq + gain_v dv from knot t to t+1, t = 0 .. nknot-2, each [nv*nv] row-major, at tenths of the step
/// and below, for contacts by any of the laws [laws], at least one, each as likely. q, v of the motion are used.
/// CAV_NO_MEMORY, CAV_NOT_FINITE, CAV_NOT_CONVERGED: the motion is too far from any that a regulator can hold.
cav_status cav_feedback(const cav_transcription *transcription, const cav_trajectory *motion, const cav_options *law,
                        int laws, const cav_feedback_penalty *penalty, double *gain_q, double *gain_v);

/// Feedback gains of a motion into its solution: the best of a number of sets, 0: of all, by the closed loops of
/// verification. report is called before each set, from 1 to most, and ends the search by a nonzero return:
/// CAV_INTERRUPTED with the best so far, NULL if there is none. follows, NULL: not asked for: whether the motion is followed
/// from its own start with them. choose_gains.c.
cav_status cav_choose_gains(const cav_problem *problem, const cav_transcription *transcription,
                            const cav_trajectory *at, int sets, int (*report)(void *context, int set, int most),
                            void *context, cav_solution *solution, int *follows, cav_error *error);

/// Frees a solution's gains and what is known of their closed loops: it has none then.
void cav_gains_free(cav_solution *solution);

#endif
