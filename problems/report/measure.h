/// What the sections of a report share: the scene with its law, states that it comes to, a clock that tells its spread,
/// and references to measure errors against. Everything but times is the same in every run of one build.
#ifndef CAVORT_MEASURE_H
#define CAVORT_MEASURE_H

#include <stdint.h>

#include "cavort/solve.h"
#include "sheet.h"

/// Told now and then: what is being measured and how much of all is done, 0 .. 1. Nonzero ends the report.
typedef int (*cav_measure_tell)(void *context, const char *what, double fraction);

/// A step of the scene: what leads to it and what it is.
typedef struct cav_measure_sample {
  double *q, *v, *u;                      ///< [nq], [nv], [nv]
  double *q_before, *v_before, *u_before; ///< of the step before, from which a solver with a memory starts
  double *v_next;                         ///< [nv] reference, converged to rounding
  double uncertainty; ///< of v_next, m/s or rad/s: what one more Newton step by the exact derivative changes
  int rows, bin;
} cav_measure_sample;

/// A reference less certain than this, m/s or rad/s, is none.
#define CAV_MEASURE_KNOWN 1e-7

/// Bins of states by their number of constraint rows.
enum { CAV_MEASURE_BINS = 7, CAV_MEASURE_VECTORS = 16, CAV_MEASURE_MATRICES = 4 };
extern const char *const cav_measure_bin_names[CAV_MEASURE_BINS];

typedef struct cav_measure {
  const cav_model *model;
  const cav_problem *problem; ///< NULL: a model alone
  cav_options options;        ///< law, order and step of the scene
  const double *start;        ///< [nq]
  int quick;
  cav_measure_tell tell;
  void *context;
  double seconds; ///< that the section in hand may take, from begin on
  double begin;
  cav_state *state, *other;
  double *vector[CAV_MEASURE_VECTORS];  ///< scratch, each for a q, v or u
  double *matrix[CAV_MEASURE_MATRICES]; ///< [nv*nv] scratch
  double *contact_q, *contact_v;        ///< [nq], [nv] where the scene has come to by itself, with constraint rows
  int contact_rows;                     ///< 0: it came to none
  int nsample, lost;                    ///< lost: episodes in which a step could not be taken
  cav_measure_sample *sample;
} cav_measure;

/// Makes what is needed of a scene: model, problem (or NULL), quick, tell and context are set. CAV_BAD_INPUT where
/// nothing moves.
cav_status cav_measure_begin(cav_measure *m, cav_error *error);
void cav_measure_end(cav_measure *m);

/// Runs the scene from its start and other postures under random forces and keeps steps of many numbers of rows, with
/// their references; and from its start without forces for half a second, and on to contacts.
cav_status cav_measure_collect(cav_measure *m);

/// A section begins, and may take so many seconds; whether they are over.
void cav_measure_section(cav_measure *m, double quick_seconds, double seconds);
int cav_measure_late(const cav_measure *m);

/// Both states get options.
void cav_measure_set(cav_measure *m, const cav_options *options);

/// Wall clock, s; processor time of this thread, s, which others on the machine disturb less.
double cav_measure_clock(void);
double cav_measure_processor(void);

/// Sorts x [n] and returns its quantile; NaN of none.
double cav_measure_quantile(double *x, int n, double fraction);

/// Solves A x = b in place by elimination with pivots: A [n*n] is destroyed, b becomes x. 0 where it is singular.
int cav_measure_eliminate(int n, double *A, double *b);

/// |inverse(q, v, v_next) - u|, the largest, relative to the largest force that takes part; NaN where it fails. The
/// difference itself is left in residual [nv].
double cav_measure_mismatch(cav_measure *m, const double *q, const double *v, const double *u, const double *v_next,
                            double *residual);

/// How rough the clock is: the upper quartile of a fixed piece of work over its shortest time.
double cav_measure_noise(void);

/// Number of constraint rows at the state's last evaluation.
int cav_measure_rows(const cav_state *state);

/// Random forces of a dof, N or N m: such as would move it alone by so many m/s^2 or rad/s^2.
double cav_measure_push(const cav_model *model, int dof, double acceleration);

// the sections; each fills its sheets, which are empty, and what it tells

/// Forward solvers: errors and times of Newton's method and Gauss-Seidel.
typedef struct cav_measure_forward {
  cav_sheet sheet;
  int states, without;        ///< states that count; those whose reference is not known well enough
  int unmeasured;             ///< those that there was no time for
  double uncertainty;         ///< largest of the references
  const char *sweeps_missing; ///< why Gauss-Seidel has no rows; NULL: it has
} cav_measure_forward;
cav_status cav_measure_forwards(cav_measure *m, cav_measure_forward *out);

/// Orders and steps: errors of a motion, drift of what is conserved.
typedef struct cav_measure_motion {
  int known;          ///< 0: there is no such motion
  int slow;           ///< 1: as it would have taken too long
  double size;        ///< largest way of a dof, m or rad
  double uncertainty; ///< of the reference, m or rad
  double order;       ///< observed in the steps that it is taken from; NaN: none
  int extrapolated;   ///< 1: with that order; 0: it is no order, and the reference is the finest motion
  int steps;          ///< of the finest
} cav_measure_motion;
typedef struct cav_measure_step {
  cav_sheet sheet;
  cav_measure_motion motion[2]; ///< without and with contacts
  double seconds;               ///< that a motion lasts
  int momentum;                 ///< 1: momentum is conserved, as nothing is fixed
} cav_measure_step;
cav_status cav_measure_steps(cav_measure *m, cav_measure_step *out);

/// Derivatives of the inverse.
typedef struct cav_measure_derivative {
  cav_sheet sheet;
  int states[2];  ///< without constraints and with
  double seconds; ///< that a reference takes, where that is more than there is time for; 0: it is not
} cav_measure_derivative;
cav_status cav_measure_derivatives(cav_measure *m, cav_measure_derivative *out);

/// The contact law.
typedef struct cav_measure_law {
  cav_sheet sheet;
  double seconds, timestep; ///< of a run
  int contacts;             ///< 0: the scene made none
} cav_measure_law;
cav_status cav_measure_laws(cav_measure *m, cav_measure_law *out);

/// Solvers of a problem.
typedef struct cav_measure_plan {
  cav_sheet sheet, trace;
  double limit; ///< s, processor time of each solve
  double wall;  ///< s, wall clock of each, which ends it on a machine that others use
} cav_measure_plan;
cav_status cav_measure_plans(cav_measure *m, cav_measure_plan *out);

// columns of numbers of the sheets
enum {
  CAV_FORWARD_SETTING,
  CAV_FORWARD_STATES,
  CAV_FORWARD_ROWS,
  CAV_FORWARD_TIME,
  CAV_FORWARD_LOW,
  CAV_FORWARD_HIGH,
  CAV_FORWARD_ITERATIONS,
  CAV_FORWARD_ERROR,
  CAV_FORWARD_ERROR_MAX,
  CAV_FORWARD_MISMATCH,
  CAV_FORWARD_MISMATCH_MAX,
  CAV_FORWARD_FAILED,
  CAV_FORWARD_NUMBERS
};
enum {
  CAV_STEP_STEP,
  CAV_STEP_TIME,
  CAV_STEP_LOW,
  CAV_STEP_HIGH,
  CAV_STEP_ERROR,
  CAV_STEP_ORDER,
  CAV_STEP_ENERGY,
  CAV_STEP_LINEAR,
  CAV_STEP_ANGULAR,
  CAV_STEP_FAILED,
  CAV_STEP_NUMBERS
};
enum {
  CAV_DERIVATIVE_STEP,
  CAV_DERIVATIVE_STATES,
  CAV_DERIVATIVE_ERROR,
  CAV_DERIVATIVE_ERROR_MAX,
  CAV_DERIVATIVE_UNCERTAINTY,
  CAV_DERIVATIVE_TIME,
  CAV_DERIVATIVE_LOW,
  CAV_DERIVATIVE_HIGH,
  CAV_DERIVATIVE_FAILED,
  CAV_DERIVATIVE_NUMBERS
};
enum {
  CAV_LAW_SOFTNESS,
  CAV_LAW_TIME_CONSTANT,
  CAV_LAW_SMOOTHING,
  CAV_LAW_DEEPEST,
  CAV_LAW_DEPTH,
  CAV_LAW_SLIP,
  CAV_LAW_HOVER,
  CAV_LAW_PREDICTED,
  CAV_LAW_TIME,
  CAV_LAW_LOW,
  CAV_LAW_HIGH,
  CAV_LAW_ITERATIONS,
  CAV_LAW_FAILED,
  CAV_LAW_NUMBERS
};
enum {
  CAV_PLAN_KNOTS,
  CAV_PLAN_STEP,
  CAV_PLAN_SECONDS,
  CAV_PLAN_ITERATIONS,
  CAV_PLAN_COST,
  CAV_PLAN_UNACTUATED,
  CAV_PLAN_VIOLATION,
  CAV_PLAN_OPTIMALITY,
  CAV_PLAN_FEASIBLE,
  CAV_PLAN_NUMBERS
};
enum {
  CAV_TRACE_SECONDS,
  CAV_TRACE_ITERATION,
  CAV_TRACE_COST,
  CAV_TRACE_UNACTUATED,
  CAV_TRACE_VIOLATION,
  CAV_TRACE_NUMBERS
};

#endif
