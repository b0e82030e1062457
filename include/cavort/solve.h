/// Solving a problem and certifying the result.
#ifndef CAVORT_SOLVE_H
#define CAVORT_SOLVE_H

#include "cavort/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Solvers, X(solver, word on the command line, library it needs or NONE, text). The enumeration, the dispatch of
/// cav_solve, and words and help of the command line follow from this list (optim/solver/solvers.c).
// clang-format off
#define CAV_SOLVERS(X)                                                                                             \
  X(GAUSS_NEWTON, gn, NONE, "own: continuation, trust region, augmented Lagrangian")                               \
  X(IPOPT, ipopt, IPOPT, "Ipopt from the guess, by stages of the same schedule")                                     \
  X(BOTH, both, IPOPT, "own, then Ipopt from its result")
// clang-format on

/// Solvers: CAV_SOLVERS.
typedef enum cav_solver {
#define CAV_SOLVER_MEMBER(solver, ...) CAV_SOLVER_##solver,
  CAV_SOLVERS(CAV_SOLVER_MEMBER)
#undef CAV_SOLVER_MEMBER
      CAV_SOLVER_TYPES
} cav_solver;

/// What holds for a solver.
typedef struct cav_solver_rule {
  const char *name;    ///< on the command line
  const char *library; ///< whose options it takes, "" if it needs none
  const char *missing; ///< NULL, or what this build lacks and what to do
  const char *text;    ///< what it does
} cav_solver_rule;

/// solver < CAV_SOLVER_TYPES.
CAV_API const cav_solver_rule *cav_solver_rule_of(cav_solver solver);

/// One line of progress, and of the log.
typedef struct cav_progress {
  const char *phase;   ///< "kinematics", "continuation", "sqp", "softened", "multipliers", "restoration", "ipopt",
                       ///< "diagnosis", "recovery", "feedback"; "sampling" by searches: cost is the score of one
  int stage, stages;   ///< where the phase is, from 1
  double fraction;     ///< of the whole solve that is done, by the stages that are behind it: an estimate
  int iteration;       ///< over the whole solve
  double cost;         ///< of the cost terms alone
  double unactuated;   ///< largest unactuated force, fraction of weight (moments: per 0.3 m)
  double violation;    ///< largest scaled violation of limits and other constraints
  double step, radius; ///< of the last step: fraction of the wanted one that was taken; of the trust region
  double seconds;      ///< since the beginning, wall clock
  int knot;            ///< knot of the largest unactuated force
} cav_progress;

/// Called after every iteration, and before each trial of feedback; a nonzero return ends the solve with
/// CAV_INTERRUPTED and the best iterate.
typedef int (*cav_observer)(void *context, const cav_progress *progress);

/// Asked many times an iteration, by the thread that solves; nonzero ends the solve as an observer does. CAV_STOP_SOON: where
/// gains are asked for, rows that are nearly in are brought in first, and a motion whose rows hold gets gains, of a few sets:
/// seconds, in which CAV_STOP_NOW, or any other value, is still obeyed.
typedef int (*cav_stop)(void *context);

/// What a stop may ask for.
enum {
  CAV_STOP_NOW = 1, ///< the end, at once
  CAV_STOP_SOON = 2 ///< the end, after gains
};

/// Places of a solve between two of its parts, X(place, word in files, what comes next). A solve goes through them in
/// this order; only where rows do not come in does it come to those after the first programme.
// clang-format off
#define CAV_PLACES(X)                                                      \
  X(CONTINUATION, continuation, "a stage of the schedule")                 \
  X(SQP, sqp, "sequential quadratic programming")                          \
  X(MULTIPLIERS, multipliers, "a round of the augmented Lagrangian")       \
  X(RESTORATION, restoration, "restoration of the rows")                   \
  X(SQP_AGAIN, sqp_again, "sequential quadratic programming, once more")   \
  X(IPOPT, ipopt, "Ipopt")                                                 \
  X(DIAGNOSIS, diagnosis, "the point of least violation")                  \
  X(RECOVERY, recovery, "costs again, from a point that is feasible")      \
  X(FEEDBACK, feedback, "the choice of gains")
// clang-format on

/// Parts of a solve between which it may be stopped: CAV_PLACES.
typedef enum cav_place {
#define CAV_PLACE_MEMBER(place, ...) CAV_PLACE_##place,
  CAV_PLACES(CAV_PLACE_MEMBER)
#undef CAV_PLACE_MEMBER
      CAV_PLACE_TYPES
} cav_place;

/// What the first stage of a solve began with (optim/METHOD.md, 5).
typedef enum cav_begin {
  CAV_BEGIN_GIVEN,     ///< a start that the caller gave
  CAV_BEGIN_GUESS,     ///< the problem's guess
  CAV_BEGIN_KINEMATICS ///< that, brought to its targets by inverse kinematics
} cav_begin;

/// All that a solve needs to go on between two of its parts and end with the same bits as if it had not stopped.
typedef struct cav_checkpoint {
  char key[96];                   ///< the caller's mark of problem and model, "" if none; kept in files, not looked at
  cav_place place;                ///< what comes next
  cav_order order;                ///< of the problem that is being solved: a strategy may solve one before
  int stage, stages;              ///< of the schedule or of the rounds of multipliers, from 1
  double fraction, settled;       ///< of the schedule: this stage's, and that of the stage before it
  int retries;                    ///< how often this stage was taken back
  cav_begin begin;                ///< what the first stage began with
  double radius;                  ///< of the trust region
  double law_step, time_constant; ///< s, of the contact law, which follows the step where that is free
  int iterations;                 ///< so far
  double seconds;                 ///< so far, wall clock
  cav_status status;              ///< of the solve, at CAV_PLACE_FEEDBACK
  double optimality;              ///< as in cav_solution, NaN: not measured
  cav_trajectory *trajectory;     ///< of the trees that are planned: the dofs of others are not in it
  cav_trajectory *stood;          ///< where the last stage whose rows were nearly in has led; NULL: none was
  int nmultiplier;                ///< number of rows
  double *multiplier;             ///< [nmultiplier] of the augmented Lagrangian, row by row as in cav_solution
  double *final_multiplier;       ///< [nmultiplier] of the programme
} cav_checkpoint;

/// Called at every place; the checkpoint and what it holds last as long as the call. Nonzero ends the solve.
typedef int (*cav_keeper)(void *context, const cav_checkpoint *checkpoint);

/// Writes a checkpoint as one file, atomically, and reads it: bits come back as they were. Freed with
/// cav_checkpoint_free. CAV_BAD_INPUT: a file that cannot be written or read, or that is no checkpoint of this model;
/// CAV_NO_MEMORY. optim/solver/checkpoint.c.
CAV_API cav_status cav_checkpoint_write(const char *path, const cav_checkpoint *checkpoint, cav_error *error);
CAV_API cav_checkpoint *cav_checkpoint_read(const char *path, const cav_model *model, cav_error *error);
CAV_API void cav_checkpoint_free(cav_checkpoint *checkpoint);

/// How to solve.
typedef struct cav_solve_options {
  cav_solver solver;            ///< which solver
  int threads;                  ///< over knots, >= 1; the result does not depend on it
  cav_observer observer;        ///< may be NULL
  void *observer_context;       ///< handed to the observer
  cav_stop stop;                ///< may be NULL
  void *stop_context;           ///< handed to stop
  cav_keeper keeper;            ///< may be NULL
  void *keeper_context;         ///< handed to the keeper
  const cav_checkpoint *resume; ///< where to go on, of the same problem, by the same solver; NULL: from the beginning
  int first_stage; ///< of the schedule, from 1 (0 is 1); more than it has stages: straight to the optimum, from a start
                   ///< that is near it. Of the own solver
  int max_iterations;       ///< of this call; 0: no limit. It ends as if it were interrupted
  double max_seconds;       ///< of this call before gains are chosen, wall clock: CAV_STOP_SOON; 0: no limit
  int gains;                ///< 1: feedback gains are chosen, where the motion may be certified with them
  int nmultiplier;          ///< 0, or number of rows: cav_solution's of a solve of the same knots and rows
  const double *multiplier; ///< [nmultiplier] to start with, NULL: zeros
  int fixed_multipliers;    ///< 1: cav_optimiser_iterate leaves them as they are, rows are held by penalties
  int moving_targets; ///< 1: waypoints of targets keep to the first start's clock, whatever cav_optimiser_shift takes off
  double tolerance;   ///< unactuated force at the end, fraction of weight
  double
      optimality; ///< of the own solver: its last phase ends where steps gain slowly and a step may save no more than this
                  ///< fraction of the cost, by the model of cav_verify_optimality; 0: where none gains
  int diagnose; ///< 1: where constraints cannot all hold, end at their least violation, which cav_explain needs
  /// 1: with gains, a motion whose constraints hold, but that no gains would certify, for its slip, hover, depth or
  /// momentum, or that misses what it is asked to reach by less than CAV_MISSED_LITTLE tolerances, is made no cheaper and has
  /// none; nor is one that is stuck and that no set of a few gains follows, or that misses a target, which has the best of
  /// them: who goes on to another one loses nothing by it. Of the own solver.
  int leave_refused;
  /// Of the dynamics: analytic, and what has none (cav_derivatives_missing, sensors) by one-sided differences, or all
  /// by differences. Ipopt always takes centred ones.
  cav_derivative derivative;
  int ipopt_derivative_test; ///< 1: Ipopt's first-order checker runs before its first iteration, at the start; its text goes to
                             ///< ipopt_output. Its time grows with the cube of the number of knots
  const char *ipopt_output;      ///< file of Ipopt's own log, NULL: none
  int nipopt;                    ///< options for Ipopt, laid over the problem's
  const cav_ipopt_option *ipopt; ///< [nipopt]
} cav_solve_options;

/// The own solver, one thread, no limits, gains.
CAV_API cav_solve_options cav_solve_options_default(void);

/// How a stage of a solve ended.
typedef enum cav_outcome {
  CAV_OUTCOME_SETTLED, ///< by its tolerance, or its rows hold
  CAV_OUTCOME_LIMIT,   ///< by its number of iterations
  CAV_OUTCOME_STALLED, ///< at a jump of the merit, which no step passes, or its rows do not come in
  CAV_OUTCOME_AGAIN,   ///< stalled and taken back: the stage after it starts where this one did, and goes half as far
  CAV_OUTCOME_STOPPED  ///< interrupted, or by an error
} cav_outcome;

/// One stage of a solve, and what it left.
typedef struct cav_stage_record {
  const char *phase;                  ///< as in cav_progress
  int stage, stages;                  ///< number of the stage, and how many there are
  double fraction;                    ///< of the way from the schedule's first to its last stage
  int iterations;                     ///< that it took
  double cost, unactuated, violation; ///< as in cav_progress
  cav_outcome outcome;                ///< how it ended
  double seconds;                     ///< since the one before it ended, wall clock
} cav_stage_record;

/// Where a constraint row comes from.
typedef enum cav_binding_kind {
  CAV_BINDING_UNACTUATED,  ///< force that no actuator can give; object: the dof that it falls on most
  CAV_BINDING_EFFORT,      ///< actuator force over its limit; object: actuator
  CAV_BINDING_JOINT,       ///< object: joint
  CAV_BINDING_TENDON,      ///< object: tendon
  CAV_BINDING_TERM,        ///< object: number among the hard terms; component: of the reading, or the dof
  CAV_BINDING_PENETRATION, ///< depth of a contact, m; object: pair. Not a row of the solver: cav_explain adds it
  CAV_BINDING_KINDS
} cav_binding_kind;

/// A constraint row lower <= value <= upper of a solved problem, scaled as the solver sees it.
typedef struct cav_binding {
  int knot;                   ///< at which it stands
  cav_binding_kind kind;      ///< what it comes from
  int object, component;      ///< which object of that kind, and which of its values
  double value, lower, upper; ///< scaled, of the row and its bounds
  double allowed;             ///< violation that planning leaves room for
  double
      multiplier; ///< penalty: what the cost would fall by if the bound gave way by one. Where constraints do not hold: the
                  ///< weighted violation, which balances that of the rows it is in conflict with
  double
      pull; ///< force on the motion that the multipliers of it and its like at neighbouring knots leave, per rad or m
} cav_binding;

/// Closed loops that the verifier ran while gains were chosen.
typedef struct cav_followed cav_followed;

/// A solved motion.
typedef struct cav_solution {
  cav_trajectory *trajectory; ///< the motion
  cav_options contact;        ///< contact law the motion obeys
  double *gain_q, *gain_v;    ///< [(nknot-1)*nv*nv] du_t = gain_q dq_t + gain_v dv_t, row-major; NULL: none were asked
                              ///< for, or none help: it was interrupted, or misses what a certificate requires
  double cost;                ///< of the cost terms
  double
      optimality; ///< the solver's own: decrease of the cost along the constraints that its last model predicts, over
                  ///< the cost; NaN where the constraints do not hold. A verdict's is the verifier's
  double unactuated; ///< largest, fraction of weight, of what moves light things of their own (optim/METHOD.md)
  int holds;         ///< 1: forces, limits and constraints hold as a certificate asks
  int iterations;    ///< of all phases
  double seconds, seconds_dynamics, seconds_assembly, seconds_linear; ///< wall clock
  int nprogress;                                                      ///< lines of the log
  cav_progress *progress;                                             ///< log
  int nstage;                                                         ///< stages that were run
  cav_stage_record *stage;                                            ///< its stages in order
  int nrow;         ///< rows at the end that are violated or hold something back
  cav_binding *row; ///< constraint rows that are violated or have a multiplier, by knot
  int nmultiplier;  ///< number of constraint rows
  double
      *multiplier; ///< [nmultiplier] of every constraint row, scaled as the solver sees it, positive at upper bounds.
                   ///< Rows by knot; of a knot: unactuated forces, efforts, ranges of joints and of tendons, hard terms
  cav_followed *followed; ///< those that were run for the choice of gains, for cav_verify_solution; NULL: none
} cav_solution;

/// What a plan is made of, and how the own solver factors its normal equations, at the problem's guess, first stage: a
/// band with a border for each group of trees that nothing joins there; a free step beside several of them as an arrow.
typedef struct cav_equations {
  int unknowns;                ///< numbers that are solved for
  int left_out, left_out_dofs; ///< trees that the plan leaves out, and their dofs (optim/METHOD.md, 1)
  int rows, constraints;       ///< of costs and constraints over all knots; the latter
  int blocks;                  ///< of unknowns, one a knot
  int groups, largest;         ///< groups of trees; dofs of the largest
  int width, border; ///< of its band: entries of a column; unknowns after it (of a cycle's last knots, the free step)
  int arrow;         ///< 1: the free step stands beside the groups
  double bytes;      ///< of the matrix and its factors
  double rows_time, sums_time; ///< s, once, by one thread: rows with derivatives; the normal equations from them
  double factor_time;          ///< s, of their factors; -1: they are not positive definite at the guess
} cav_equations;

/// Fails as cav_solve does where the problem or its guess cannot be evaluated. structure.c.
CAV_API cav_status cav_problem_equations(const cav_problem *problem, cav_equations *equations, cav_error *error);

/// Solves from the problem's guess, or from start if not NULL. CAV_NOT_CONVERGED and CAV_INTERRUPTED leave the best
/// iterate in the solution; NULL in *solution only where error says so. CAV_BAD_INPUT: multipliers or a checkpoint of
/// another number of rows or knots, besides what is wrong in the problem.
CAV_API cav_status cav_solve(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                             cav_solution **solution, cav_error *error);
/// Frees a solution; NULL is fine.
CAV_API void cav_solution_free(cav_solution *solution);

/// The trajectory that a solve starts from: the problem's guess, without forces. NULL with the reason in error.
CAV_API cav_trajectory *cav_problem_guess(const cav_problem *problem, cav_error *error);

/// Standard errors of a motion that is estimated: roots of the diagonal of the covariance that the cost has as the
/// negative logarithm of a likelihood, to second order (Gauss and Newton's) about the motion. A weight w over a window
/// is then a measurement of variance scale^2/(w timestep) at each knot, one at a time of variance scale^2/w.
/// Constraints and forces that no actuator can give hold exactly, bounds that hold something back too. Rows are knots;
/// NaN: no forces there.
typedef struct cav_standard_errors {
  int nknot, nq, nv, nu; ///< sizes of the motion
  double *q;             ///< [nknot*nv] of the tangent at q, rad or m; 0 at a start that is given
  double *v;             ///< [nknot*nv] rad/s or m/s
  double *u;             ///< [nknot*nv] N m or N; of dofs of roots: of their residual forces
  double *force;         ///< [nknot*nu] of actuators, before the gear, as in controls.csv
  double *covariance;    ///< [nknot*nv*nv] of the tangent at each q, row-major
} cav_standard_errors;

/// At a motion under the law contact, with the bindings of its solution (or of a result folder). Takes the time of a
/// few iterations. CAV_NOT_SUPPORTED: a free duration; CAV_NOT_CONVERGED: an unknown of which neither costs nor
/// dynamics tell anything; else as cav_solve. NULL in *errors on failure. optim/solver/standard_errors.c.
CAV_API cav_status cav_standard_errors_find(const cav_problem *problem, const cav_trajectory *motion,
                                            const cav_options *contact, int nrow, const cav_binding *row,
                                            cav_standard_errors **errors, cav_error *error);
/// Frees them; NULL is fine.
CAV_API void cav_standard_errors_free(cav_standard_errors *errors);

/// A solver that is made once, for one problem, and keeps its memory, motion and multipliers between solves: for
/// problems whose weights and targets change a little, and for planning while moving (shift, iterate). It reads the
/// problem's terms anew at every call: their weights, targets and scales may be changed in place, not their number,
/// kind, use and window. optim/METHOD.md, 5.
typedef struct cav_optimiser cav_optimiser;

/// At the problem's guess, or at start if not NULL, with options->multiplier if there are any. Copies the options and
/// the problem's start; all else of the problem is borrowed. gains, keeper, resume and first_stage of the options have
/// no meaning here. NULL with the reason in error, as cav_solve.
CAV_API cav_optimiser *cav_optimiser_new(const cav_problem *problem, const cav_solve_options *options,
                                         const cav_trajectory *start, cav_error *error);
/// Frees an optimiser; NULL is fine.
CAV_API void cav_optimiser_free(cav_optimiser *optimiser);

/// Solves from where it is, as cav_solve does from first_stage of the schedule on (1: all; more than it has: straight
/// to the optimum, from near it), and keeps the multipliers. Statuses of cav_solve. last may be NULL.
CAV_API cav_status cav_optimiser_solve(cav_optimiser *optimiser, int first_stage, cav_progress *last, cav_error *error);

/// At most so many Gauss-Newton iterations at the last stage's law, then an update of the multipliers (augmented
/// Lagrangian) unless they are fixed. From the second call on allocates nothing unless more touches than ever before.
/// Each costs a linearisation, a factor and an evaluation. It ends before where no step decreases the merit. CAV_OK,
/// CAV_INTERRUPTED, CAV_NOT_FINITE, CAV_NO_MEMORY; CAV_BAD_INPUT for iterations < 1, or where a quantity of one's own
/// refuses. last, of the last iteration, may be NULL.
CAV_API cav_status cav_optimiser_iterate(cav_optimiser *optimiser, int iterations, cav_progress *last);

/// Takes so many knots off the front and starts the rest at q [nq], v [nv], both NULL: as planned there. A part of a
/// knot moves every knot by that part of the step to the next. Knots that are new at the end hold the last
/// configuration. Multipliers move along where rows of two knots are alike. Windows and targets of terms stay at their
/// times after the new start, but for moving_targets. CAV_BAD_INPUT: not 0 to all knots but two, or q or v not finite;
/// CAV_NOT_SUPPORTED: a cycle. Allocates nothing.
CAV_API cav_status cav_optimiser_shift(cav_optimiser *optimiser, double knots, const double *q, const double *v);

/// The motion, the problem with the present start, and the contact law of the motion, as cav_verify takes them; the
/// multipliers of all rows [n]. All until the next call.
CAV_API const cav_trajectory *cav_optimiser_trajectory(const cav_optimiser *optimiser);
CAV_API const cav_problem *cav_optimiser_problem(const cav_optimiser *optimiser);
CAV_API const cav_options *cav_optimiser_contact(const cav_optimiser *optimiser);
CAV_API const double *cav_optimiser_multipliers(cav_optimiser *optimiser, int *n);

enum {
  CAV_STRATEGIES = 64,       ///< most strategies of a problem
  CAV_STRATEGY_SWINGS = 16,  ///< most sines of one: two joints of eight limbs, further ones stand
  CAV_STRATEGY_CHANGES = 160 ///< room for what a repair changed, in words
};

/// When a strategy is worth trying.
typedef enum cav_strategy_use {
  CAV_STRATEGY_TRY,      ///< where none before it succeeds
  CAV_STRATEGY_MOMENTUM, ///< where, besides, the balance of momentum is the first condition that one of them misses
  CAV_STRATEGY_REPAIR, ///< where, besides, the best motion of those before misses something that has a usual cure: what
                       ///< to do is known then alone (cav_strategy_repair)
  CAV_STRATEGY_NEAR, ///< such a repair at once, from the motion itself: where one before misses limits alone, by less than
                     ///< half of what planning keeps, is certified and misses fewer than half of its targets, or obeys
                     ///< physics and misses little else of a certificate
  CAV_STRATEGY_DIAGNOSIS ///< where none of all succeeds: what it finds is told and not kept, since more was given than
                         ///< asked: a duration free up to twice the stated one, times of windows in proportion
} cav_strategy_use;

/// Where a hinge or slide is at the end of a guess that goes elsewhere than to the goal.
typedef struct cav_joint_value {
  int joint; ///< of the model
  double to; ///< rad or m
} cav_joint_value;

/// A way to a motion: the guess and the schedule that a solve starts from.
typedef struct cav_strategy {
  const char *name, *text;              ///< in a word, and in words
  int stated;                           ///< 1: the problem's own guess, 0: guess and swing
  int left;                             ///< 1: with the postures of cav_problem.guess_left
  cav_order order;                      ///< that the motion obeys
  int first_midpoint;                   ///< 1: solved under CAV_ORDER_MIDPOINT, then from there under order
  cav_strategy_use use;                 ///< when
  cav_guess guess;                      ///< what its guess is made from
  int nswing;                           ///< sines over joints of the guess
  cav_swing swing[CAV_STRATEGY_SWINGS]; ///< [nswing]
  int nreach; ///< joints of a guess that ends elsewhere than at the goal: where terms of the end ask
  cav_joint_value reach[CAV_STRATEGY_SWINGS]; ///< [nreach]
  int ground;                                 ///< 1: its guess stands on what is below it
  int samples; ///< it begins with the best of many simulated motions, other draws by number; 0: it does not
  int hand;    ///< hands that are brought first to what has to be pushed, carried or touched: 1 or 2
  double
      met; ///< s: until then what is moved stays as it is at the start in the guess, since a term brings something to it; or 0
  int moved;                     ///< with met, its joint
  double height, from, to;       ///< not stated: of a ballistic arc, m, and when, s
  double bow[2];                 ///< not stated: cav_problem.guess_bow, over the whole way
  int flies;                     ///< 1: start and goal are held before and after that arc
  cav_guess_pose pose[2];        ///< where it flies
  cav_schedule schedule;         ///< schedule that it takes
  double effort_limit, timestep; ///< those of the problem where 0
  double strength;               ///< a diagnosis: cav_problem.strength
  int open;                      ///< 1: a diagnosis that need not end at rest; 0 without strength: may last longer
  int nterm;                     ///< number of the changed terms
  cav_term *term;                ///< [nterm] in the place of the problem's, whose names and targets they borrow; NULL
  char changed[CAV_STRATEGY_CHANGES]; ///< what a repair changes in the problem, in words
} cav_strategy;

/// What it takes to swing up: found by simulating laws that pump energy into the model, so that is enough; less may be
/// (optim/METHOD.md, 7); of a model that is one hinge the least, exact. Bounds from below: cav_problem_impossible.
typedef struct cav_pumping {
  int needed;     ///< 1: start and goal stand by themselves, nothing touches, and actuators cannot hold what is between
  double seconds; ///< in which it came near the goal with the efforts planned with; infinite: not in eight durations
  double efforts; ///< multiple of these efforts with which it came near the goal in the duration; infinite: not with 9
  int exact;      ///< 1: less time, or less effort, is not enough
} cav_pumping;

/// Takes seconds where pumping is needed, milliseconds where it is not. CAV_NO_MEMORY, or what the dynamics says of
/// start and goal.
CAV_API cav_status cav_problem_pumping(const cav_problem *problem, cav_pumping *pumping);

/// Strategies for a problem, in the order in which they are worth trying; the first is the problem's own.
/// CAV_NO_MEMORY, or what the dynamics says of the goal posture. Cleared by cav_strategies_clear, after a failure, too.
CAV_API cav_status cav_strategy_list(const cav_problem *problem, cav_strategy strategy[CAV_STRATEGIES], int *n);

/// Frees what one strategy owns, or n of them: their terms.
CAV_API void cav_strategy_clear(cav_strategy *strategy);
CAV_API void cav_strategies_clear(cav_strategy *strategy, int n);

/// The problem by a strategy: borrows all else from the problem, and the swings from the strategy.
CAV_API void cav_strategy_apply(const cav_problem *problem, const cav_strategy *strategy, cav_problem *taken);

/// Solves by a strategy: cav_solve of what cav_strategy_apply gives, after one under the midpoint order, or after some with
/// a hand at what has to be pushed, where the strategy says so, whose iterations and seconds are counted but whose log is not
/// kept; from the best of simulated motions, where it says that. A repair that has a start goes on from there, with the last
/// stages of its schedule alone.
CAV_API cav_status cav_strategy_solve(const cav_problem *problem, const cav_strategy *strategy,
                                      const cav_solve_options *options, const cav_trajectory *start,
                                      cav_solution **solution, cav_error *error);

/// m: a moment counts as a force at this distance where it is compared with the weight.
#define CAV_MOMENT_ARM 0.3

/// What a certificate requires: the largest value of the verdict's field of that name.
#define CAV_TOLERANCE_UNACTUATED 1e-6   ///< fraction of weight
#define CAV_TOLERANCE_LIMIT 1e-6        ///< relative (actuators), rad or m (ranges)
#define CAV_TOLERANCE_CONSTRAINT 1e-6   ///< scaled; rad, m, rad/s or m/s of the given start
#define CAV_TOLERANCE_PENETRATION 0.005 ///< m, of contacts between moving links too
#define CAV_TOLERANCE_MOMENTUM 0.005    ///< fraction of weight, root mean square
#define CAV_TOLERANCE_SLIP 0.01         ///< m/s
#define CAV_TOLERANCE_HOVER 0.03        ///< fraction of all contact force; CAV_HOVER_GAP says what counts
#define CAV_TOLERANCE_REPLAY \
  0.5 ///< s, or the whole motion: the open loop at the same step reproduces the knots at least so long
#define CAV_TOLERANCE_STEP 1e-8        ///< rad or m
#define CAV_LOST_DISTANCE 0.5          ///< m from its plan at which a replay has lost the motion
#define CAV_TOLERANCE_PERIODICITY 1e-9 ///< m, rad, and these per step
#define CAV_TOLERANCE_MIRRORED 0.05 ///< other half stride of what is nearly its own mirror image: as mirrored_force_max

/// What the word optimal requires of a verdict's optimality: a fraction of the cost.
#define CAV_TOLERANCE_OPTIMAL 1e-4
#define CAV_MISSED_LITTLE 2 ///< times its tolerance: a target that is off by less is missed by little
#define CAV_HOVER_GAP 0.003 ///< m: a loaded contact farther apart, that stays so over a step, leans on air
/// What a term asked and what the motion does.
typedef struct cav_term_report {
  double cost, fraction; ///< of a cost term, and of the motion's whole cost
  int has_target;     ///< 0: nothing is to be reached: a running cost, a term over contacts, or no knot in its window
  double time;        ///< s, of the knot at which it is missed most; of the value missed most there:
  double wanted, got; ///< its target (of a range the nearest value allowed) and itself, in unit
  double off;         ///< distance: of a sensor's vector its length, of dofs the largest
  double off_alone;   ///< of the component of wanted and got: less than off where others of a vector are off
  double within;      ///< tolerance: the term's, or for goals at one time a usual one; infinite: told only
  int met;            ///< off <= within
  char unit[16], what[64]; ///< unit of its numbers; name of what is measured
} cav_term_report;

/// By how much values of a term in one unit may be off for the motion to have achieved what was asked.
typedef struct cav_tolerance {
  double within; ///< above 0, in unit
  char unit[16]; ///< "m", "rad", "of limit"
} cav_tolerance;

/// What verification found; from the knots alone, with code apart from the optimiser's. optim/METHOD.md, 6.
/// optimality is filled by cav_verify_optimality; solve_seconds and iterations are the solver's. cav_verify leaves these
/// as they are.
typedef struct cav_verdict {
  int certified;               ///< 1: all that a certificate requires holds
  double unactuated_force_max; ///< fraction of weight
  int unactuated_force_knot;   ///< knot of the largest one
  double momentum_defect_rms;  ///< fraction of weight
  /// Of forces on roots that the problem penalises (cav_residual), of the tree that has most at a knot: root mean square and
  /// largest. NaN: there are none.
  double residual_force_rms_n, residual_force_max_n, residual_torque_rms_n_m, residual_torque_max_n_m;
  double residual_fraction_max; ///< largest of all of these, fraction of the weight
  double residual_within;       ///< what the problem allows of that
  double limit_violation_max;   ///< relative to the limit (effort), rad or m (range)
  double
      stop_fraction_max; ///< largest depth in the stop of a joint without an actuator, over cav_joint_stop; NaN: none has a range
  double constraint_violation_max;                 ///< of the problem's hard terms, scaled
  double penetration_max_m, penetration_between_m; ///< at the knots; along the steps between them
  double slip_mean_m_s;                            ///< of loaded contacts, weighted by force
  double slip_step_mean_m_s;                       ///< the same by the way of a contact's point over the step
  double slip_self;                                ///< fraction of that between links of one tree
  double hover_fraction;                           ///< of contact force, by impulse, across gaps that stay open
  double hover_self;                               ///< fraction of that between links of one tree
  double power_max_w;            ///< of an actuator: mechanical, at the mean velocity of a step, either way
  double joint_speed_max_rad_s;  ///< of hinges and ball joints
  double slide_speed_max_m_s;    ///< of slides; NaN: the model has none
  double joint_speed_over_limit; ///< of joints whose file states a limit, the largest ratio; NaN where none does
  double optimality;             ///< fraction of the cost that a step may still save at most; cav_verify_optimality
  /// largest |v' - v_{t+1}| h of single forward steps from each knot, rad or m; INFINITY where one leaves all numbers
  double replay_step_max_error;
  double replay_same_step_max_error; ///< largest |q - knot|, rad or m, open loop at the same step
  double replay_same_step_seconds;   ///< how long it stays within 1e-6
  double
      closed_loop_seconds; ///< how long the closed loop at a tenth of the step follows (all links within 0.5 m, roots 1 rad)
  int has_gains;           ///< 1: the closed loops had gains; 0: without, what was planned alone is applied
  double closed_loop_end_error_m; ///< largest distance of a body's centre of mass at the end
  double model_contacts_seconds,
      model_contacts_end_error_m; ///< the same under the contacts of the model's file: the worst of steps of 2 and 1 ms, and of
                                  ///< four starts a little off
  double
      feedback_effort_max; ///< largest effort that either closed loop asks of an actuator, over its limit, before clipping
  /// Impulse on the root link a third of the way, along x and y either way, with which the motion follows under the model's
  /// contacts, to a factor of 2; 0: less than the smallest tried, NaN: the motion is not certified, or not known.
  double push_survived_n_s;
  double
      periodicity_error; ///< cycles: how far the last knot is from the first one moved, m, rad, or their rates; else 0
  /// Mirrored cycles of a model that is its own mirror image but for millimetres of its masses, in the other half stride:
  /// unactuated force, fraction of weight, or effort beyond its planned limit, fraction of that, whichever is more. Feedback
  /// makes it up. Else NaN.
  double mirrored_force_max;
  int periods; ///< that the closed loop ran for: 1, of cycles more
  double end_speed_m_s,
      end_rate_rad_s; ///< of end_body's tree, of its centre of mass and of itself; NaN where nothing moves
  char end_body[64]; ///< what still moves at an end that need not be at rest, what no actuator moves first; "": nothing
  double duration, solve_seconds;  ///< duration: of one period
  int iterations;                  ///< as the solver left them
  double cost;                     ///< of the cost terms, summed anew from the knots
  int achieved;                    ///< every target with a tolerance is met
  int ntarget, nmissed;            ///< such targets, and those missed
  double missed_most;              ///< how far the one missed most is off over its tolerance; 0 if achieved
  unsigned long long missed_terms; ///< bit i: term i is one of those missed; of the first 64 terms
  char missed[240];                ///< the one missed most: name, by how much, wanted and got; "" if achieved
  char reason[480];                ///< why not certified: the first condition missed; "" if certified
} cav_verdict;

/// A strategy with one change more: number k of the usual cures of what a motion found by it misses first. *found 0: there
/// are no more. changed says all that differs from the problem: that of the strategy given where the cure changes nothing.
/// To be cleared. CAV_NO_MEMORY.
CAV_API cav_status cav_strategy_repair(const cav_problem *problem, const cav_strategy *from, const cav_verdict *verdict,
                                       int k, cav_strategy *repaired, int *found);

/// What replay_same_step_seconds has to be, s: CAV_TOLERANCE_REPLAY, or the whole motion where that is shorter; less
/// rounding.
CAV_API double cav_verdict_replay(const cav_verdict *verdict);

/// Whether the motion is feasible (forces, limits and constraints within their tolerances), and whether it is optimal,
/// too: to CAV_TOLERANCE_OPTIMAL. Neither says that it is certified.
CAV_API int cav_verdict_feasible(const cav_verdict *verdict);
CAV_API int cav_verdict_optimal(const cav_verdict *verdict);

/// Certifies a motion: q, v of the trajectory and the gains are used, all else is recomputed. contact is the law it
/// claims.
CAV_API cav_status cav_verify(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                              const double *gain_q, const double *gain_v, cav_verdict *verdict, cav_error *error);

/// What cav_verify measures at the knots and between them alone, much sooner: nothing is simulated, so nothing is certified,
/// and the figures of simulations are 0.
CAV_API cav_status cav_verify_knots(const cav_problem *problem, const cav_trajectory *trajectory,
                                    const cav_options *contact, cav_verdict *verdict, cav_error *error);

/// The verdict of cav_verify on a solution, sooner: closed loops that verification has run for the choice of its gains are
/// not run again where motion, law and gains are those of then, to the bit. The model has to be unchanged since the solve.
CAV_API cav_status cav_verify_solution(const cav_problem *problem, const cav_solution *solution, cav_verdict *verdict,
                                       cav_error *error);

/// From how many of so many starts a little off a motion's gains follow it to its end: up to 1 mm and 1 mrad of its joints,
/// 10 mm/s and 10 mrad/s of its dofs, spread evenly, under the contacts of the model's file in steps of 2 ms. No loop of
/// cav_verify, for which gains are chosen, has one of these starts, so this tells how far what they were chosen by carries.
typedef struct cav_starts_report {
  int starts;          ///< that were simulated
  int followed;        ///< from which the motion is followed to its end
  double soonest_lost; ///< s into the motion, of those that are lost; NaN: none is
  double end_error_m;  ///< worst of those that follow; NaN: none does
} cav_starts_report;

/// gain_q, gain_v NULL: no feedback. CAV_BAD_INPUT: less than one start; else fails as cav_verify does.
CAV_API cav_status cav_verify_starts(const cav_problem *problem, const cav_trajectory *trajectory,
                                     const cav_options *contact, const double *gain_q, const double *gain_v, int starts,
                                     cav_starts_report *report, cav_error *error);

/// How optimal a verified motion is, into verdict->optimality: no step of 0.5 rad or m (root mean square over knots)
/// along the linearised constraints decreases the cost by a larger fraction, to second order in the cost's residuals.
/// From the knots, the problem and the multipliers of bounds among the solution's rows [nrow], which can be wrong: then
/// it is larger, never smaller. NaN where the verdict, as cav_verify left it, is not feasible. Fails as cav_verify does.
CAV_API cav_status cav_verify_optimality(const cav_problem *problem, const cav_trajectory *trajectory,
                                         const cav_options *contact, int nrow, const cav_binding *row,
                                         cav_verdict *verdict, cav_error *error);

/// What each term asked and got: report [problem->nterm]. Fails as cav_verify does. cost may be NULL.
CAV_API cav_status cav_terms_report(const cav_problem *problem, const cav_trajectory *trajectory,
                                    const cav_options *contact, cav_term_report *report, double *cost,
                                    cav_error *error);

/// What a verdict will ask of a term, before there is a motion: how many tolerances its values have, one for each unit (a posture
/// may have rad and m), the first most of them in list (may be NULL if most is 0). 0: achieved does not need it. *reported
/// (may be NULL) is 1 where it has a target at all, so that a report tells what a motion has there.
CAV_API int cav_term_tolerances(const cav_problem *problem, const cav_term *term, int most, cav_tolerance *list,
                                int *reported);

/// One value of a term at one knot of a motion.
typedef struct cav_term_value {
  int knot; ///< at which it is
  int component; ///< number of the value among those of the term at that knot: of a sensor, of selected dofs, of actuators or
                 ///< of contacts in their order
  double value,
      target;  ///< in the unit of the quantity; of postures and orientations the difference from the target, and 0
  double cost; ///< that it adds to the motion's; 0 of a constraint
} cav_term_value;

/// The values of term number term of the problem at the knots of its window, knot by knot: the first most of them into value
/// (NULL if most is 0), all counted in *n. Evaluated anew like a certificate, and fails as cav_verify does.
CAV_API cav_status cav_term_values(const cav_problem *problem, const cav_trajectory *trajectory,
                                   const cav_options *contact, int term, int most, cav_term_value *value, int *n,
                                   cav_error *error);

/// How far a motion is from what a channel of a record says, over the knots that see it. Of several numbers the length counts, of
/// orientations the angle between the two.
typedef struct cav_channel_residual {
  const char *what;  ///< that is compared: "position", "orientation", "coordinate", or the type of the sensor; static
  const char *unit;  ///< of rms, worst and the channel's sd; "": a number; static
  int seen;          ///< knots
  double rms, worst; ///< in the unit of the channel; NaN: no knot sees it
  double worst_time; ///< s, of the motion; NaN: likewise
} cav_channel_residual;

/// Residuals of the record of term number term, of which term[term].track is not NULL: residual [track->nchannel]. Evaluated
/// anew like a certificate, and fails as cav_verify does; CAV_BAD_INPUT, too: that term has no record.
CAV_API cav_status cav_track_residuals(const cav_problem *problem, const cav_trajectory *trajectory,
                                       const cav_options *contact, int term, cav_channel_residual *residual,
                                       cav_error *error);

/// Why a motion is as it is: one thing that is missed, or that pulls.
typedef struct cav_reason {
  cav_binding row;  ///< the worst of its knots
  int first, last;  ///< knots at which the same thing is missed or pulls
  double time;      ///< of row.knot, s
  double violation; ///< scaled, 0 if within what is allowed
  double pull;      ///< of row
  double fraction;  ///< of all pulls, over all its knots
  double
      saving; ///< where all holds: what the cost falls by if its bound gives way by one at all its knots, to first order, in
              ///< the unit of the problem (effort: the whole limit); of an equality if its target moves by one
  char what[320]; ///< what, of which body, how far, in words
  char cure[400]; ///< what usually helps
} cav_reason;

enum { CAV_REASONS = 10 }; ///< most reasons of a kind

/// Reasons in order of their size, twice: by violation, and by fraction of the conflict.
typedef struct cav_explanation {
  int met; ///< 1: every constraint holds, and what pulls is what the motion's cost hangs on: rows at their bounds
  int nviolation, nconflict;                                ///< how many of each there are
  cav_reason violation[CAV_REASONS], conflict[CAV_REASONS]; ///< largest first
  char contradiction
      [400]; ///< equalities of which, near this motion, each follows from the others but for its value, and
             ///< how far they are apart; "": none, or built without SPQR (optim/METHOD.md, 9)
} cav_explanation;

/// Ranks what a motion misses and which constraints pull against each other, from the rows of its solution.
/// CAV_BAD_INPUT: a row that is not of this problem; CAV_NO_MEMORY; CAV_NOT_FINITE; CAV_NOT_SUPPORTED: SPQR, which the build
/// found, is not on this machine.
CAV_API cav_status cav_explain(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                               int nrow, const cav_binding *row, cav_explanation *explanation, cav_error *error);

#ifdef __cplusplus
}
#endif
#endif
