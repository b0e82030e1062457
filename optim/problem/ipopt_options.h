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
  const char *words;
} cav_ipopt_rule;

// name, type, least, most, strict, words: as Ipopt's manual has them, but for hessian, which is ours (ipopt.c)
#define CAV_IPOPT_OPTIONS(X)                                                               \
  X(acceptable_constr_viol_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                         \
  X(acceptable_dual_inf_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                            \
  X(acceptable_iter, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL)                                     \
  X(acceptable_obj_change_tol, CAV_IPOPT_REAL, 0, 1e300, 0, NULL)                          \
  X(acceptable_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                     \
  X(bound_frac, CAV_IPOPT_REAL, 0, 0.5, 1, NULL)                                           \
  X(bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                         \
  X(bound_relax_factor, CAV_IPOPT_REAL, 0, 1e300, 0, NULL)                                 \
  X(compl_inf_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                      \
  X(constr_viol_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                    \
  X(dual_inf_tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                       \
  X(expect_infeasible_problem, CAV_IPOPT_WORD, 0, 0, 0, "no yes")                          \
  X(hessian, CAV_IPOPT_WORD, 0, 0, 0, "auto exact gauss-newton")                           \
  X(hessian_approximation, CAV_IPOPT_WORD, 0, 0, 0, "exact limited-memory")                \
  X(limited_memory_max_history, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL)                          \
  X(linear_solver, CAV_IPOPT_WORD, 0, 0, 0, "mumps ma27 ma57 ma77 ma86 ma97 pardiso wsmp") \
  X(max_cpu_time, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                       \
  X(max_iter, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL)                                            \
  X(max_soc, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL)                                             \
  X(derivative_test_perturbation, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                       \
  X(mu_init, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                            \
  X(mu_strategy, CAV_IPOPT_WORD, 0, 0, 0, "monotone adaptive")                             \
  X(mu_target, CAV_IPOPT_REAL, 0, 1e300, 0, NULL)                                          \
  X(mumps_mem_percent, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL)                                   \
  X(mumps_pivot_order, CAV_IPOPT_WHOLE, 0, 7, 0, NULL)                                     \
  X(mumps_pivtol, CAV_IPOPT_REAL, 0, 1, 0, NULL)                                           \
  X(mumps_scaling, CAV_IPOPT_WHOLE, -2, 77, 0, NULL)                                       \
  X(nlp_scaling_method, CAV_IPOPT_WORD, 0, 0, 0, "none gradient-based")                    \
  X(tol, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                                                \
  X(warm_start_bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                              \
  X(warm_start_init_point, CAV_IPOPT_WORD, 0, 0, 0, "no yes")                              \
  X(warm_start_mult_bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                         \
  X(warm_start_slack_bound_push, CAV_IPOPT_REAL, 0, 1e300, 1, NULL)                        \
  X(watchdog_shortened_iter_trigger, CAV_IPOPT_WHOLE, 0, 1e9, 0, NULL)

/// The table; its length in *n.
const cav_ipopt_rule *cav_ipopt_rules(int *n);

/// The rule of an option that is right, with its number; NULL with the reason in error (may be NULL).
const cav_ipopt_rule *cav_ipopt_check(const cav_ipopt_option *option, double *number, cav_error *error);

#endif
