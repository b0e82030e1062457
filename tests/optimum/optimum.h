/// Optimal-control problems whose optima are known in closed form, or from an independent solution, as a table: each
/// entry builds its problem on a grid and knows the truth at the grid's times. runner in test_optimum.c.
#ifndef CAVORT_TESTS_OPTIMUM_H
#define CAVORT_TESTS_OPTIMUM_H

#include "cavort/cavort.h"
#include "scene.h"

enum { OPTIMUM_TERMS = 8, OPTIMUM_VALUES = 64 };

/// A problem under construction: the storage of what cav_problem only points to.
typedef struct optimum_problem {
  cav_problem problem;
  cav_term term[OPTIMUM_TERMS];
  double value[OPTIMUM_VALUES]; ///< targets
  int nvalue;
  double *table, *times; ///< [n+1], [n+1] targets over time
} optimum_problem;

/// The optimum on a grid of n steps over its duration.
typedef struct optimum_truth {
  double cost, duration;
  double *q, *u; ///< [(n+1)*nv] row-major; u at the times of the knots; NAN: not known
} optimum_truth;

/// Error of a figure at the finest grid, relative to its scale, and the order at which it has to fall with the step. 0:
/// not checked.
typedef struct optimum_bound {
  double error, order;
} optimum_bound;

typedef struct optimum {
  const char *name, *text, *model;
  double duration; ///< s, of the problem; that of the optimum is in the truth
  int coarsest;    ///< steps of the coarsest grid; the finest has ten times as many
  void (*build)(optimum_problem *problem, int n);
  void (*truth)(int n, optimum_truth *truth);
  optimum_bound cost, time, state, force;
  int force_in_mean; ///< forces jump: their error is the mean over knots instead of the largest
  double (*multiplier)(const cav_problem *problem,
                       const cav_solution *solution); ///< relative error of one; may be NULL
  optimum_bound multiplier_error;
  double optimal; ///< at most this by the verifier; 0: 1e-4
  int quadratic; ///< linear-quadratic: by the own solver at most 5 iterations a stage, 1 after the last; 2: and on grids
                 ///< of up to twenty times the coarsest's steps
} optimum;

/// Rows of one file each.
extern const optimum optimum_smooth[], optimum_bounded[], optimum_contact[], optimum_pendulum[], optimum_further[];
extern const int optimum_nsmooth, optimum_nbounded, optimum_ncontact, optimum_npendulum, optimum_nfurther;

/// Adds a cost of weight/2 times the square over the whole horizon, or at its end. Targets are zeros.
cav_term *optimum_cost(optimum_problem *problem, cav_quantity quantity, double weight);
/// Adds an equality at a time: configuration or velocity [nv] of all dofs.
cav_term *optimum_fix(optimum_problem *problem, cav_quantity quantity, double time, const double *target);
/// Fixes configuration and velocity at the end.
void optimum_end(optimum_problem *problem, const double *q, const double *v);
/// Adds a range for the configuration over the whole horizon.
cav_term *optimum_range(optimum_problem *problem, cav_quantity quantity, double lower, double upper);
/// Copies numbers to where they stay.
double *optimum_values(optimum_problem *problem, int n, const double *value);
/// Sum of the multipliers of a kind of rows over knots first .. last.
double optimum_multiplier_sum(const cav_solution *solution, cav_binding_kind kind, int first, int last);

#endif
