/// Model-predictive control: a plan that is made anew, from where the body has come to, while it moves.
#ifndef CAVORT_MPC_H
#define CAVORT_MPC_H

#include "cavort/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

/// How to control.
typedef struct cav_mpc_options {
  int threads;     ///< over knots, >= 1; plans do not depend on it
  int knots;       ///< that a plan looks ahead, from 2 on; 0: all of the problem's
  int iterations;  ///< Gauss-Newton steps for a plan, >= 1
  double delay;    ///< s from a state to the plan that is made from it: what making one takes at most; 0: at once
  double timestep; ///< s, > 0: step at which the delay is looked ahead over
  /// rad/s: actuators pull every dof back to the plan as a spring of this natural frequency on that dof's inertia would,
  /// with critical damping, as far as steps of timestep can hold it; 0: the plan's forces alone
  double stiffness;
} cav_mpc_options;

/// One thread, two iterations, no delay, 1 ms, 40 rad/s.
CAV_API cav_mpc_options cav_mpc_options_default(void);

/// A controller for one problem: its start is where the first plan begins, from which on waypoints are timed. Plans
/// obey the law of the schedule's last stage, so that is a soft one (optim/METHOD.md, 13). Weights, targets and scales of
/// terms may be changed in place between calls. Windows of terms move along with the plan, waypoints of their targets
/// do not: they keep to the clock, so that what is to be followed may move. One thread at a time.
typedef struct cav_mpc cav_mpc;

/// At a plan for the problem's start: start if not NULL, else one that is solved for from the first knots of the problem's
/// guess; that it did not converge is no error. The problem is borrowed. NULL with the reason in error: as cav_solve, and
/// CAV_BAD_INPUT for options out of range, CAV_NOT_SUPPORTED for a cycle or a free duration.
CAV_API cav_mpc *cav_mpc_new(const cav_problem *problem, const cav_mpc_options *options, const cav_trajectory *start,
                             cav_error *error);
/// Frees a controller; NULL is fine.
CAV_API void cav_mpc_free(cav_mpc *mpc);

/// A new plan from the state q [nq], v [nv] at a time, s; 0 is that of the first plan's start, and no call comes before the
/// last plan is in force. It begins one delay later, where the commands of the present plan lead under the model's
/// contacts, and is in force from then on. What cav_optimiser_iterate returns; after a failure the present plan stays in
/// force. CAV_BAD_INPUT: q or v not finite, too early, or nearly the whole horizon after the call before. last may be
/// NULL.
CAV_API cav_status cav_mpc_plan(cav_mpc *mpc, double time, const double *q, const double *v, cav_progress *last);

/// What actuators do at a time and a state: forces of the plan in force and the pull back to it, within their limits.
/// input [nu]: controls, of actuators with an activation that; u [nv]: the generalised force that they give, N or N m.
/// Either may be NULL. Beyond its horizon a plan holds its end. Allocates nothing. CAV_NOT_FINITE.
CAV_API cav_status cav_mpc_command(cav_mpc *mpc, double time, const double *q, const double *v, double *input,
                                   double *u);

/// The newest plan and the time of its first knot, s (NULL: not needed); until the next plan.
CAV_API const cav_trajectory *cav_mpc_trajectory(const cav_mpc *mpc, double *start);

#ifdef __cplusplus
}
#endif
#endif
