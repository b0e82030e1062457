/// Solving a problem and certifying the result.
#ifndef CAVORT_SOLVE_H
#define CAVORT_SOLVE_H

#include "cavort/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum cav_solver {
  CAV_SOLVER_GAUSS_NEWTON, ///< own: continuation, trust region, augmented Lagrangian
  CAV_SOLVER_IPOPT,        ///< Ipopt from the guess, the last stage's contacts
  CAV_SOLVER_BOTH          ///< own, then Ipopt from its result
} cav_solver;

/// One line of progress, and of the log.
typedef struct cav_progress {
  const char *phase; ///< "continuation", "multipliers", "ipopt"
  int stage, stages;
  int iteration;     ///< over the whole solve
  double cost;       ///< of the cost terms alone
  double unactuated; ///< largest unactuated force, share of weight (moments: per 0.3 m)
  double violation;  ///< largest scaled violation of limits and other constraints
  double step, radius;
  double seconds;
  int knot; ///< knot of the largest unactuated force
} cav_progress;

/// Called after every iteration; a nonzero return ends the solve with CAV_INTERRUPTED and the best iterate.
typedef int (*cav_observer)(void *context, const cav_progress *progress);

typedef struct cav_solve_options {
  cav_solver solver;
  int threads;           ///< over knots, >= 1; the result does not depend on it
  cav_observer observer; ///< may be NULL
  void *observer_context;
  double tolerance; ///< unactuated force at the end, share of weight
  int ipopt_iterations;
  int ipopt_derivative_test; ///< 1: Ipopt's first-order checker runs before its first iteration; its text goes to ipopt_output
  const char *ipopt_output;  ///< file of Ipopt's own log, NULL: none
  const char *linear_solver; ///< Ipopt's, NULL: its default
} cav_solve_options;

cav_solve_options cav_solve_options_default(void);

/// A solved motion.
typedef struct cav_solution {
  cav_trajectory *trajectory;
  cav_options contact;     ///< contact law the motion obeys
  double *gain_q, *gain_v; ///< [(nknot-1)*nv*nv] du_t = gain_q dq_t + gain_v dv_t, row-major
  double cost;
  double optimality; ///< largest scaled component of the Lagrangian's gradient
  double unactuated; ///< largest, share of weight
  int iterations;
  double seconds, seconds_dynamics, seconds_assembly, seconds_linear; ///< wall clock
  int nprogress;
  cav_progress *progress; ///< log
} cav_solution;

/// Solves from the problem's guess, or from start if not NULL. CAV_NOT_CONVERGED and CAV_INTERRUPTED leave the best iterate in
/// the solution; NULL in *solution only where error says so.
cav_status cav_solve(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                     cav_solution **solution, cav_error *error);
void cav_solution_free(cav_solution *solution);

/// What a certificate promises: the largest value of the verdict's field of that name.
#define CAV_PROMISE_UNACTUATED 1e-6  ///< share of weight
#define CAV_PROMISE_LIMIT 1e-6       ///< relative (actuators), rad or m (ranges)
#define CAV_PROMISE_CONSTRAINT 1e-6  ///< scaled; rad, m, rad/s or m/s of the given start
#define CAV_PROMISE_PENETRATION 0.01 ///< m
#define CAV_PROMISE_MOMENTUM 0.01    ///< share of weight, root mean square
#define CAV_PROMISE_STEP 1e-8        ///< rad or m

/// What verification found; from the knots alone, with code apart from the optimiser's. optimisation.md, 6.
/// optimality, solve_seconds and iterations are the solver's: cav_verify leaves them as they are.
typedef struct cav_verdict {
  int certified;
  double unactuated_force_max; ///< share of weight
  int unactuated_force_knot;
  double momentum_defect_rms;      ///< share of weight
  double limit_violation_max;      ///< relative to the limit (effort), rad or m (range)
  double constraint_violation_max; ///< of the problem's hard terms, scaled
  double penetration_max_m;
  double slip_mean_m_s; ///< of loaded contacts, weighted by force
  double optimality;
  double replay_step_max_error;      ///< largest |v' - v_{t+1}| h of single forward steps from each knot, rad or m
  double replay_same_step_max_error; ///< largest |q - knot|, rad or m, open loop at the same step
  double replay_same_step_seconds;   ///< how long it stays within 1e-6
  double
      closed_loop_seconds; ///< how long the closed loop at a tenth of the step follows (all links within 0.5 m, roots 1 rad)
  double closed_loop_end_error_m; ///< largest distance of a body's centre of mass at the end
  double duration, solve_seconds;
  int iterations;
  char reason[400]; ///< why not certified: the first condition missed; "" if certified
} cav_verdict;

/// Certifies a motion: q, v of the trajectory and the gains are used, all else is recomputed. contact is the law it claims.
cav_status cav_verify(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                      const double *gain_q, const double *gain_v, cav_verdict *verdict, cav_error *error);

#ifdef __cplusplus
}
#endif
#endif
