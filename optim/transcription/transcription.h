/// A problem as rows over knots: values, derivatives, normal equations. Private to optim/.
#ifndef CAVORT_TRANSCRIPTION_H
#define CAVORT_TRANSCRIPTION_H

#include <assert.h>
#include <math.h>
#include <stddef.h>

#include "cavort/solve.h"
#include "edge.h"
#include "evaluation.h"
#include "parallel.h"
#include "periodicity.h"
#include "plannable.h"
#include "user.h"

/// A constraint row lower <= value <= upper, scaled; equalities have lower = upper.
typedef struct cav_slot {
  double value, lower, upper;
  double multiplier;
  double final_multiplier; ///< multiplier at the end of a solve, for explanations and warm starts
} cav_slot;

/// By how much a row is beyond its bounds, 0: it is not.
static inline double cav_slot_excess(const cav_slot *slot) {
  return fmax(fmax(slot->lower - slot->value, slot->value - slot->upper), 0);
}

/// Where a knot's constraint rows come from, in the order in which they stand in cav_knot.slot.
typedef struct cav_slot_layout {
  int unactuated; ///< first row of the forces that no actuator can give
  int effort;     ///< of the actuator forces
  int joint;      ///< of the joint ranges (empty at a knot 0 that is given)
  int tendon;     ///< of the tendon ranges (likewise)
  int term;       ///< of the problem's hard terms
  int count;
} cav_slot_layout;

/// A linear form in the generalised force: value = sum coef[k] u[dof[k]].
typedef struct cav_force_row {
  int n;
  int *dof;
  double *coef;
} cav_force_row;

/// Its value at u [nv].
static inline double cav_force_value(const cav_force_row *row, const double *u) {
  double value = 0;
  for (int k = 0; k < row->n; k++) value += row->coef[k] * u[row->dof[k]];
  return value;
}

/// A cost row with an absolute norm sqrt(1 + x^2) - 1: its argument at the last linearisation and at the iterate before,
/// and the dual w of x/sqrt(1 + x^2), -1 .. 1, that its Hessian is taken with.
typedef struct cav_absolute {
  double x, before, dual;
} cav_absolute;

enum { CAV_ROTATION_SIZE = 21 };

/// Readings of a contact: gap or depth, slip (2), impact, force, force at an edge, clearance (2).
enum { CAV_CONTACT_READINGS = 8 };
/// Of a contact that is read: between two links of one tree, its first reading is the depth; near an edge of a box of the world;
/// of a driven link that has to keep clear of the world; one that bears nothing, read for that alone.
enum { CAV_WITHIN_TREE = 1, CAV_AT_EDGE = 2, CAV_CLEARS = 4, CAV_IDLE = 8 };

/// Depth of a contact with the world that costs nothing where depth costs, m.
#define CAV_DEPTH_FREE 0.004

/// One knot. Columns of its derivatives: tangent increments of q_{t-1}, q_t, q_{t+1}; those of knots that are not
/// unknowns are zero. In cycles q_{-1}, q_0 and q_{T+1} are the unknowns of q_{T-1}, q_T and q_1 moved: columns of
/// hessian, gradient, step_row and slot_row are of the unknowns themselves, those of du of the knots beside.
typedef struct cav_knot {
  double time;
  int has_force; ///< u is defined here
  cav_slot_layout layout;
  cav_slot *slot;      ///< [layout.count]
  double *slot_row;    ///< [layout.count*3nv] derivatives of the slots' values, if kept
  double *slot_step;   ///< [layout.count] the same by the logarithm of the step, where that is free
  double *u;           ///< [nv]
  double *du;          ///< [nv*3nv] row-major; not of a linearisation whose knots are taken at once
  int nread, ncontact; ///< readings beside u: CAV_CONTACT_READINGS a contact, then sensors
  int room;            ///< readings for which y has space
  int moving_room;
  char *moving;           ///< [ncontact] bits: CAV_WITHIN_TREE, CAV_AT_EDGE, CAV_CLEARS, CAV_IDLE
  double *y;              ///< [nread]
  int nrow;               ///< rows of costs and constraints
  int ndense, dense_most; ///< rows over all columns, weighted, that make up the Hessian beside the sparse ones; at most
  int dense_room;
  double *dense, *rest; ///< [dense_room*3nv], [dense_room]; as du
  double *hessian;      ///< [3nv*3nv] Gauss-Newton, lower triangle; as du
  double *present;  ///< that of the evaluation at hand: hessian, or a single thread's, where the knot is taken at once
  double *gradient; ///< [3nv]
  double *
      step_row; ///< [3nv] of the Hessian, by the logarithm of the step where that is free; then its square and derivative
  double step_square, step_derivative;
  double
      *rotation; ///< [nturn*CAV_ROTATION_SIZE] of the step that ends here: Jr^-1, Jl^-1 and the rotation vector itself
  double cost, merit;       ///< cost terms; and with penalties
  cav_user_refusal refusal; ///< of a quantity of one's own, in the knot's last evaluation
  int refused_term;         ///< whose it is
  int nabsolute;
  cav_absolute
      *absolute; ///< [nabsolute] of the rows with an absolute norm that are not of contacts, in their order; where
                 ///< nabsolute is 0 their Hessian is that of the squares that stand for them
  struct cav_kept *kept;      ///< values put by; NULL: none yet
  struct cav_hint *hints;     ///< where searches for contacts of meshes ended there; NULL: none yet
  cav_evaluation *evaluation; ///< of the last values, unless it has been linearised since; NULL: none yet
} cav_knot;

/// Weights of the augmented Lagrangian, per kind of row.
typedef struct cav_penalties {
  double unactuated, effort, range, term;
} cav_penalties;

/// What a servo's bias adds to its row: control = effort over gain - constant - sum of weights times q and v of dofs,
/// scaled as the row. n 0: the row is that of the effort alone. servo.c.
typedef struct cav_servo {
  int n, *dof;
  double constant, *of_q, *of_v; ///< [n]
} cav_servo;

/// Where a term speaks.
typedef struct cav_window {
  int first, last; ///< knots, none where last is below first
  int single;      ///< 1: at one knot with weight 1; 0: an integral
  int dofs;        ///< number that it selects
} cav_window;

typedef struct cav_transcription {
  const cav_problem *problem;
  const cav_model *model;
  int nv, nknot; ///< unknown blocks are knots first .. nknot-1
  int first;     ///< 1; with a free start -1: v_0 = (q_0 (-) q_{-1})/h is an unknown by a knot -1, which has no rows
  int free_step; ///< 1: one more unknown after them, the logarithm of the step over that of the trajectory
  cav_periodicity *periodicity; ///< cycles: from one period to the next; else NULL
  double *before, *after;       ///< [nv] velocity at knot 0 (cycles), and after the last one
  double *start;                ///< [2*nq] room: the knot before a free start, as it is and as it is moved
  double *rotation_after;       ///< [nturn*CAV_ROTATION_SIZE] of the step after the last knot, in cycles
  double weight;                ///< N: model mass times gravity
  double smoothness;         ///< curvature of squared accelerations, s^4/m^2, where no running cost has any; 0: one has
  int nresidual;             ///< rows of unactuated
  cav_force_row *unactuated; ///< orthonormal complement of the actuators' range, scaled to fractions of weight
  double *fraction;          ///< [nv] of each of these rows: its unit, as a fraction of the certificate's
  int npenalised;            ///< dofs of roots whose unactuated forces are a cost
  cav_force_row *penalised;  ///< [npenalised] over their deviations
  int nlimit;                ///< rows of effort: one an actuator; then of control, of servos limited in both
  int *limited;              ///< [nlimit] the actuator of each
  cav_force_row *effort;     ///< [nlimit] actuator force over its limit
  double *effort_unit;       ///< [nlimit] force of its transmission, N or N m, that one unit of the row of effort is
  double (*effort_range)[2]; ///< [nlimit] limits of effort, scaled; of servos with limits of control alone, those
  cav_servo *servo;          ///< [nlimit]
  int nrotation;
  int *rotation_dof;  ///< [nturn] first of three rotational dofs
  int *rotation_of;   ///< [nv] index into turn_dof or -1
  cav_window *window; ///< [nterm]
  char *selected;     ///< [nterm*nv] 1: the term selects the dof
  cav_penalties penalty;
  int self_force;                   ///< 1: a term asks for forces between links of one tree
  double clearance;                 ///< m over the world in which speed along it costs; 0: nowhere
  cav_edges *edges;                 ///< NULL: no term asks for forces at edges
  double lightened;                 ///< part of costs on forces of bodies of the world that is left out
  double calmed;                    ///< so many times more costs on the turning of roots weigh
  double depth_weight;              ///< 1/(m^2 s), of depth in the world beyond CAV_DEPTH_FREE; 0: none
  cav_derivative derivative;        ///< of u, contacts and sensors
  cav_derivative difference;        ///< what stands in where there is no analytic one
  int constraints_only;             ///< costs and multipliers are left out: the merit is the violation alone
  double elapsed;                   ///< s since the start that waypoints of targets are timed from
  double slack_effort, slack_range; ///< how far constraints_only lets these rows pass their planned bounds
  int gradient_only;                ///< linearisations leave the Hessians unfinished
  int keep_rows;                    ///< slot_row of the knots is filled by linearisations
  int (*stop)(void *context);       ///< asked before every evaluation; nonzero: CAV_INTERRUPTED. NULL: none asks
  void *stop_context;
  cav_options options; ///< contact law of this stage, stops of the last knot alone; its timestep is the step of the
                       ///< last trajectory
  cav_knot *knot;      ///< [nknot]
  struct cav_scratch *scratch; ///< one a thread
  cav_parallel *pool;
  cav_status *status;       ///< [nknot] of an evaluation
  cav_parallel_flag *ready; ///< [nknot]
  int *order;               ///< [nknot] in which values within a bound are evaluated: by their last merits
  cav_error failure; ///< what a quantity of one's own refused in the last one; CAV_BAD_INPUT: from then on, all end
  double seconds_dynamics, seconds_assembly;
} cav_transcription;

/// Fills the row of such a servo: what control is per unit of effort (per_effort), its limits over the larger of them,
/// and what q and v add. Returns 0 if memory runs out. servo.c.
int cav_servo_set(const cav_model *model, int actuator, cav_servo *servo, double *per_effort, double range[2]);
void cav_servo_free(cav_servo *servo);

/// Part of the row at q [nq], v [nv]. servo.c.
double cav_servo_value(const cav_model *model, const cav_servo *servo, const double *q, const double *v);

/// NULL with the reason in error: no memory, actuators that cannot be planned with, a cycle that is none.
cav_transcription *cav_transcription_new(const cav_problem *problem, int threads, cav_error *error);
void cav_transcription_free(cav_transcription *transcription);

/// From now on linearisations keep the derivative of every constraint row; 0 if memory runs out.
int cav_transcription_keep_rows(cav_transcription *transcription);

/// Number of unknowns, of their blocks of nv, one a knot from the first on, and the block that columns c*nv ..
/// (c+1)*nv-1 of knot t belong to; -1: none.
int cav_transcription_unknowns(const cav_transcription *transcription);
int cav_transcription_blocks(const cav_transcription *transcription);
int cav_transcription_block(const cav_transcription *transcription, int t, int c);

/// Columns (of 3nv) in which constraint row i of knot t may be nonzero: pattern [3nv] is 1 there; the nv after them are
/// scratch. pattern.c.
void cav_transcription_pattern(const cav_transcription *transcription, int t, int i, char *pattern);

/// Whether somebody asks for the end.
int cav_transcription_stopped(const cav_transcription *transcription);

/// Values at a trajectory: u, constraint rows, cost and merit of every knot. Fills trajectory->u. CAV_INTERRUPTED, as
/// the next: stopped asks for the end, and nothing was evaluated.
cav_status cav_transcription_values(cav_transcription *transcription, cav_trajectory *trajectory);

/// The same as long as they may be of use: once the merits of some knots are above a bound together, that of all is, as none is
/// negative; then *beyond is 1, and what is left undone keeps what it had. Which knots these are threads decide.
cav_status cav_transcription_values_within(cav_transcription *transcription, cav_trajectory *trajectory, double bound,
                                           int *beyond);

/// Puts the values of the last evaluation by, 0 if memory runs out; then, after others, takes them back in the place of an
/// evaluation at the trajectory that they are of, as cav_transcription_values. keep.c.
int cav_values_keep(cav_transcription *transcription);
void cav_values_take(cav_transcription *transcription, cav_trajectory *trajectory);
cav_status cav_transcription_return(cav_transcription *transcription, cav_trajectory *trajectory);
void cav_kept_free(struct cav_kept *kept);

/// Values and derivatives: du, dense rows, hessian and gradient of the merit of every knot.
cav_status cav_transcription_linearise(cav_transcription *transcription, cav_trajectory *trajectory);

/// The same, and take(context, t) for each knot once its derivatives are there, one call at a time and in ascending order,
/// while other threads do those of later knots; none from a knot that failed on. With it du, dense rows and Hessians are not
/// kept.
cav_status cav_transcription_linearise_then(cav_transcription *transcription, cav_trajectory *trajectory,
                                            void (*take)(void *context, int t), void *context);

/// Gives rows with an absolute norm duals, all 0, from which their Hessians are taken until they are dropped; 0 if memory
/// runs out. absolute.c.
int cav_absolute_begin(cav_transcription *transcription);
void cav_absolute_drop(cav_transcription *transcription);

/// Moves the duals along with an iterate: the one of the last linearisation is a fraction of the step away from the one
/// at which this was called before, 0: it is the first. Returns whether there are any: Hessians stay those of the last
/// linearisation.
int cav_absolute_advance(cav_transcription *transcription, double fraction);

/// What an absolute norm bends by at argument x, with its dual. absolute.c.
double cav_absolute_curvature(const cav_absolute *row);

/// Moves the start on: waypoints of targets come so much sooner, windows stay as they are. terms.c.
void cav_transcription_elapse(cav_transcription *transcription, double seconds);

/// Adds the product of a knot's dense rows [ndense*3nv] to its Hessian, by this thread's room. join.c. CAV_NO_MEMORY.
cav_status cav_rows_join(const cav_transcription *transcription, struct cav_scratch *scratch, cav_knot *knot,
                         const double *dense);

/// Chains rows [n*3nv] over (q_t, v_t, v_{t+1}) to rows over the three neighbouring knots, at the last linearisation.
void cav_transcription_chain(const cav_transcription *transcription, int t, int n, const double *row, double *out);

/// Velocity that reaches knot t, and the one that leaves it: that of the next knot, or what closes the motion.
const double *cav_velocity_at(const cav_transcription *transcription, const cav_trajectory *at, int t);
const double *cav_velocity_after(const cav_transcription *transcription, const cav_trajectory *at, int t);

/// Sums over knots of the last values.
double cav_transcription_cost(const cav_transcription *transcription);
double cav_transcription_merit(const cav_transcription *transcription);

/// Unit of the forces on a dof that no actuator gives, over the scene's weight: of what is light and no actuator moves its
/// own weight's. In units of a person's weight a force from nowhere that throws a ball is a rounding error.
double cav_force_fraction(const cav_model *model, int dof);

/// Largest unactuated force (fraction of weight, of light bodies of their own) and its knot; largest violation of the other
/// constraint rows.
double cav_transcription_unactuated(const cav_transcription *transcription, int *knot);
double cav_transcription_violation(const cav_transcription *transcription);

/// Multiplier update of the augmented Lagrangian at the last values.
void cav_transcription_multipliers(cav_transcription *transcription);

/// Multipliers of all rows at the last linearisation, whose rows were kept: the multipliers after a step x [unknowns],
/// or with x NULL the weighted violations alone.
void cav_transcription_estimate_multipliers(cav_transcription *transcription, const double *x);

/// Rows that are violated or have a multiplier, with where they come from, at the last linearisation, whose rows were
/// kept; in fresh memory. allowed: violation, by kind of row. CAV_NO_MEMORY. constraint_rows.c.
cav_status cav_transcription_rows(const cav_transcription *transcription, const double allowed[CAV_BINDING_KINDS],
                                  cav_binding **row, int *n);

/// Where row i of knot t comes from, and its value and bounds. constraint_rows.c.
void cav_transcription_origin(const cav_transcription *transcription, int t, int i, cav_binding *binding);

/// q_t := q_t (+) x_t for every unknown knot, the step by its unknown within its bounds; v follows, in cycles q_0 and v_0
/// too, and with a free start v_0. x [unknowns].
void cav_transcription_move(const cav_transcription *transcription, const cav_trajectory *from, const double *x,
                            cav_trajectory *to);

/// Windows of the terms from the problem; evaluations find them anew. Window of a term of the problem. terms.c.
void cav_term_windows(cav_transcription *transcription);
static inline const cav_window *cav_term_window(const cav_transcription *transcription, const cav_term *term) {
  const ptrdiff_t i = term - transcription->problem->term;
  assert(i >= 0 && i < transcription->problem->nterm);
  return &transcription->window[i];
}

/// Which dofs a term of the problem selects, [nv].
static inline const char *cav_term_dofs(const cav_transcription *transcription, const cav_term *term) {
  return transcription->selected + (term - transcription->problem->term) * transcription->nv;
}

/// Whether something leaves knot t, so that it has forces.
int cav_knot_has_force(const cav_transcription *transcription, int t);

/// The contact law of a knot: that of the transcription, whose stops is of the last one of a motion that closes at rest.
cav_options cav_knot_law(const cav_transcription *transcription, int t);

/// Weight with which a term of the problem speaks at knot t: the step for an integral, 1 at a single knot, 0 outside its
/// window. terms.c.
double cav_term_weight(const cav_transcription *transcription, const cav_term *term, int t);

/// Status of an evaluation by those of its knots: the first that is not CAV_OK, with the refusal behind it told.
cav_status cav_transcription_conclude(cav_transcription *transcription, const cav_status *status);

/// Readings of a term (of sensors and quantities of one's own: those alone have any) where it speaks, and at knot t: 0
/// where it does not; whether it selects a dof; and value minus target over scale at knot t.
int cav_term_is_reading(const cav_term *term);
int cav_term_dim(const cav_term *term);
int cav_term_readings(const cav_transcription *transcription, const cav_term *term, int t);
int cav_dof_selected(const cav_transcription *transcription, const cav_term *term, int dof);
void cav_term_read(const cav_transcription *transcription, cav_state *state, const cav_term *term, int t, double *y);

/// Time of a knot for windows and targets: a fraction of the problem's duration, whatever the step has become. terms.c.
double cav_knot_time(const cav_transcription *transcription, int t);

#endif
