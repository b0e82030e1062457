/// Numbers of a model that are not known, estimated with a recorded motion.
#ifndef CAVORT_ESTIMATE_H
#define CAVORT_ESTIMATE_H

#include "cavort/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A motion and parameters that were found together.
typedef struct cav_estimate {
  int nparameter;     ///< number of parameters, those of the problem
  double *value;      ///< [nparameter] in their units
  double *error;      ///< [nparameter] standard errors, the motion being as unknown as it is
  double *covariance; ///< [nparameter*nparameter]
  double *alone;      ///< [nparameter] standard errors by records and priors alone, other costs at a ten-thousandth
  double *pull; ///< [nparameter] how far other costs, or its bound, hold it off where records and priors alone would
                ///< have it, to first order
  /// [nparameter] 1: records tell it: alone is at most half of the prior's deviation (where there is no prior, of the value
  /// or of the one that the search began with, the larger), and at most three times error; 0: its value is that of priors
  /// or of other costs
  int *told;
  int *bound;   ///< [nparameter] -1, 1: at the lower, upper end of its range; 0: within
  double *seen; ///< [nparameter] what the records alone tell, in units of the priors (of the values where there
                ///< is none), of combinations of parameters, the best seen first: 1/deviation^2. Far below 1: the
                ///< records do not see that combination, and its value is the prior's
  double *combination;    ///< [nparameter*nparameter] these combinations, by rows, in the same units, of length 1
  int iterations;         ///< changes of the parameters
  const cav_model *model; ///< with these values; its names are those of the problem's model, which has to outlive it
  cav_solution *solution; ///< the motion of that model
  void *owner;            ///< memory of the estimate
} cav_estimate;

/// The problem's parameters and the motion that together cost least, priors included: for given parameters the motion is
/// solved, what that costs falls by Gauss and Newton's steps in the parameters alone, from the problem's border (the Schur
/// complement of the motion). start: of the first solve, NULL: the problem's guess. options: of the solves, NULL: the
/// default ones; gains are chosen once, at the end. Records are terms with a target or a track. As cav_solve;
/// CAV_BAD_INPUT too where there is no record, or where without a prior it does not tell a parameter, or two of them apart, by
/// name; CAV_NOT_CONVERGED where parameters still move after the last iteration, CAV_NOT_SUPPORTED: a free
/// duration. Terms' quantities of one's own must not look at the model by themselves. NULL in
/// *estimate on failure but CAV_NOT_CONVERGED. optim/solver/parameters.c; optim/METHOD.md, 1.
CAV_API cav_status cav_estimate_solve(const cav_problem *problem, const cav_solve_options *options,
                                      const cav_trajectory *start, cav_estimate **estimate, cav_error *error);
/// Frees an estimate, its model and its motion; NULL is fine.
CAV_API void cav_estimate_free(cav_estimate *estimate);

#ifdef __cplusplus
}
#endif
#endif
