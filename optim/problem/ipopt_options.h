/// Ipopt's options that problem files and command lines may set: one table serves the grammar, the checks and Ipopt
/// itself. Private to optim/.
#ifndef CAVORT_IPOPT_OPTIONS_H
#define CAVORT_IPOPT_OPTIONS_H

#include "cavort/problem.h"

typedef enum cav_ipopt_type { CAV_IPOPT_WHOLE, CAV_IPOPT_REAL, CAV_IPOPT_WORD } cav_ipopt_type;

/// One option: numbers from least to most (reals: above least if strict), words separated by spaces.
typedef struct cav_ipopt_rule {
  const char *name;
  cav_ipopt_type type;
  double least, most;
  int strict;
  const char *words, *text;
} cav_ipopt_rule;

// clang-format off
// name, type, least, most, strict, words, text: as Ipopt's manual has them, but for hessian, which is ours (ipopt.c)
#define CAV_IPOPT_OPTIONS(X) \
  X(acceptable_constr_viol_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "constraint violation that an acceptable point may have") \
  X(acceptable_dual_inf_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "dual infeasibility that an acceptable point may have") \
  X(acceptable_iter, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL, "acceptable points in a row after which it ends; 0: never so") \
  X(acceptable_obj_change_tol, CAV_IPOPT_REAL, 0, 1e300, 0, NULL, "relative change of the cost that an acceptable point may have") \
  X(acceptable_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "scaled error of an acceptable point") \
  X(bound_frac, CAV_IPOPT_REAL, 0, 0.5, 1, NULL, "least distance of the first point from its bounds, as a fraction of their width") \
  X(bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "least distance of the first point from its bounds, absolute") \
  X(bound_relax_factor, CAV_IPOPT_REAL, 0, 1e300, 0, NULL, "by which bounds are widened at the start, relative") \
  X(compl_inf_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "complementarity at the end, unscaled") \
  X(constr_viol_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "constraint violation at the end, unscaled") \
  X(dual_inf_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "dual infeasibility at the end, unscaled") \
  X(expect_infeasible_problem, CAV_IPOPT_WORD, 0, 0, 0, "no yes", "looks for infeasibility early") \
  X(hessian, CAV_IPOPT_WORD, 0, 0, 0, "auto exact gauss-newton", "second derivatives: exact of the Lagrangian, those of Gauss-Newton, or auto: exact where no contact acts") \
  X(hessian_approximation, CAV_IPOPT_WORD, 0, 0, 0, "exact limited-memory", "exact: as hessian= says; limited-memory: a quasi-Newton update") \
  X(limited_memory_max_history, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL, "updates that the limited memory keeps") \
  X(linear_solver, CAV_IPOPT_WORD, 0, 0, 0, "mumps ma27 ma57 ma77 ma86 ma97 pardiso wsmp", "solver of the linear systems, of those that this Ipopt is built with") \
  X(max_cpu_time, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "processor time of a stage at most, s") \
  X(max_iter, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL, "iterations of a stage at most") \
  X(max_soc, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL, "second-order corrections of a step at most") \
  X(derivative_test_perturbation, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "step of its derivative checker") \
  X(mu_init, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "barrier parameter to begin with") \
  X(mu_strategy, CAV_IPOPT_WORD, 0, 0, 0, "monotone adaptive", "how the barrier parameter falls") \
  X(mu_target, CAV_IPOPT_REAL, 0, 1e300, 0, NULL, "barrier parameter to end with") \
  X(mumps_mem_percent, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL, "memory that MUMPS takes beyond its estimate, percent") \
  X(mumps_pivot_order, CAV_IPOPT_WHOLE, 0, 7, 0, NULL, "ordering of MUMPS") \
  X(mumps_pivtol, CAV_IPOPT_REAL, 0, 1, 0, NULL, "pivot tolerance of MUMPS") \
  X(mumps_scaling, CAV_IPOPT_WHOLE, -2, 77, 0, NULL, "scaling of MUMPS") \
  X(nlp_scaling_method, CAV_IPOPT_WORD, 0, 0, 0, "none gradient-based", "scaling of the problem") \
  X(tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "scaled error at which it ends") \
  X(warm_start_bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "bound_push from a warm start") \
  X(warm_start_init_point, CAV_IPOPT_WORD, 0, 0, 0, "no yes", "starts from the multipliers of the point before") \
  X(warm_start_mult_bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "least multiplier of a bound from a warm start") \
  X(warm_start_slack_bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL, "bound_push of slacks from a warm start") \
  X(watchdog_shortened_iter_trigger, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL, "shortened steps in a row after which a full one is tried; 0: never")
// clang-format on

/// The table; its length in *n.
const cav_ipopt_rule *cav_ipopt_rules(int *n);

/// The rule of an option that is right, with its number; NULL with the reason in error (may be NULL).
const cav_ipopt_rule *cav_ipopt_check(const cav_ipopt_option *option, double *number, cav_error *error);

#endif
