/// What the parts of verification share. Private to optim/; none of it is seen or used by the optimiser, and none of
/// the optimiser is used here.
#ifndef CAVORT_AUDIT_H
#define CAVORT_AUDIT_H

#include "cavort/solve.h"
#include "cycle_image.h"
#include "edge.h"

/// A worst value and where it was found.
typedef struct cav_metric {
  double value;
  int knot;        ///< -1: not at a knot
  char where[200]; ///< what, in words; always terminated
} cav_metric;

/// A motion under examination. Between cav_verification calls at a knot the state holds cav_inverse at that knot.
typedef struct cav_verification {
  const cav_problem *problem;
  const cav_model *model;
  cav_options law;   ///< claimed contact law, at the step of the knots
  int last;          ///< last knot, T
  int rows;          ///< knots 0 .. rows-1 have a force: T, or T+1 where the motion closes at rest
  double h;          ///< s
  double weight;     ///< N, unit of forces
  double arm;        ///< m, unit of moments is weight*arm
  double *deviation; ///< [nv] of what no actuator gives on dofs of roots, where that is penalised; 0: it has to be zero
  cav_cycle_image *image; ///< cycles: from one period to the next; else NULL
  int periods;            ///< that replays run for
  const double *q;        ///< [(T+1)*nq] knots
  double *v;          ///< [(T+2)*nv] from the knots; the last row closes the motion: zero, v_1 moved in a cycle, or v_T
                      ///< where nothing closes it
  double *u;          ///< [(T+1)*nv] inverse dynamics under the claimed law; meaningful for rows knots
  double *control;    ///< [(T+1)*nu] least-norm fraction of the actuators
  cav_state *state;   ///< claimed law
  cav_state *bare;    ///< positions only: no contacts, no constraints
  cav_edges *edges;   ///< of boxes of the world
  cav_error *failure; ///< what a quantity of one's own refused first; CAV_OK: nothing
} cav_verification;

/// Admits a motion for examination and fills its velocities; what is not admitted is told in error. End it in any case.
cav_status cav_verification_begin(cav_verification *verification, const cav_problem *problem,
                                  const cav_trajectory *trajectory, const cav_options *contact, const double *gain_q,
                                  const double *gain_v, cav_error *error);
void cav_verification_end(cav_verification *verification);

/// The claimed law at a knot: its stops is of the last one of a motion that closes at rest.
cav_options cav_verification_law(const cav_verification *verification, int t);

/// Writes why a call failed, by printf's rules, unless error is NULL; gives the status.
cav_status cav_verification_fail(cav_error *error, cav_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/// Keeps the larger of the two; a value that is not a number counts as larger. Writes where by printf's rules.
void cav_metric_note(cav_metric *metric, double value, int knot, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/// Name of a link's body for people: its name, or "body N".
const char *cav_verification_link_name(const cav_model *model, int link, char buffer[32]);

/// Whether the force of a dof is one, N: of a slide, or of a free joint along an axis; else it is a moment.
int cav_verification_is_line(const cav_model *model, int dof);

/// Range of an actuator's effort by its constant limits, infinite where open. scale: the larger finite
/// magnitude of the two, 1 where there is none. actuator_check.c.
void cav_verification_actuator_range(const cav_model *model, int actuator, double range[2], double *scale);

/// CAV_NOT_SUPPORTED with the name of the first actuator whose limits are not checked here, and why. actuator_check.c.
cav_status cav_verification_actuators(const cav_model *model, cav_error *error);

/// By how much an effort at knot t and velocity v is beyond an actuator's limits, relative to them; the state is at the
/// knot, moment [nv] is scratch. suffix ends what is said of it. actuator_check.c.
void cav_verification_effort(const cav_verification *verification, int t, int actuator, double effort, const double *v,
                             double *moment, const char *suffix, cav_metric *metric);

/// Effort that costs count as one: the limit, of a servo whose control alone is limited what that gives, 1 where there is
/// none. actuator_check.c.
double cav_verification_effort_scale(const cav_model *model, int actuator);

/// What is bounded of an actuator in planning, over the size of its limits, and these with the problem's headroom: its
/// effort, or the control of a servo whose control alone is limited; component 1, of one that is limited in both: its
/// control. actuator_check.c.
double cav_verification_effort_row(const cav_verification *verification, int actuator, int component, double effort,
                                   const double *v, double *moment, double range[2]);

/// How many of these an actuator has, 1 or 2. actuator_check.c.
int cav_verification_effort_rows(const cav_model *model, int actuator);

/// Balance of momentum of every tree over all knots against gravity, contacts and equality constraints with what is not
/// of the tree: root mean square and worst knot, fraction of weight. momentum_balance.c.
typedef struct cav_balance cav_balance;
cav_balance *cav_balance_new(const cav_verification *verification);
void cav_balance_free(cav_balance *balance);
/// Adds knot t; verification->state holds the inverse there. residual [nv]: what actuators leave of its forces.
void cav_balance_add(cav_balance *balance, const cav_verification *verification, int t, const double *residual);
/// Root mean square of the worst tree, and its worst knot.
void cav_balance_result(const cav_balance *balance, const cav_verification *verification, cav_metric *metric);

/// Depths of the contacts that the state has, which is at knot t or near it; suffix ends what is said of it. Then those
/// along the steps between knots, which leaves the state between them. penetration.c.
void cav_verification_penetration(const cav_verification *verification, int t, const char *suffix, cav_metric *metric);
cav_status cav_verification_between(const cav_verification *verification, cav_metric *metric);

/// Load carried across open gaps, fraction of all: value, and the largest one's knot. hover.c.
typedef struct cav_hover cav_hover;
cav_hover *cav_hover_new(void);
void cav_hover_free(cav_hover *hover);
/// Adds knot t, in their order up to the last; verification->state holds the inverse there. Fails with CAV_NO_MEMORY.
cav_status cav_hover_add(cav_hover *hover, const cav_verification *verification, int t);
/// self: fraction of it between links of one tree.
void cav_hover_result(cav_hover *hover, const cav_verification *verification, cav_metric *metric, double *self);

/// Load that slides, beyond what is asked: sums over the knots that have been added. slip.c.
typedef struct cav_slip {
  double load;        ///< N s, of loaded contacts
  double slides, own; ///< N m: load times speed; of it between links of one tree
  double carried;     ///< N m: load times the way of the contact's point over the step, by its length
  cav_metric most;    ///< the largest at a knot and contact
} cav_slip;

/// Adds knot t; verification->state holds the inverse there, q [nq] is scratch. Fails as cav_position.
cav_status cav_slip_add(const cav_verification *verification, int t, double *q, cav_slip *slip);

/// Rates that are told: of an actuator W, of joints rad/s and over the limit of the model's file (negative: none has
/// one). rates.c.
typedef struct cav_rates {
  double power, speed, slide_speed, over_limit;
} cav_rates;

/// What still moves at an end that need not be at rest, into end_speed_m_s, end_rate_rad_s and end_body. ending.c.
cav_status cav_verification_ending(const cav_verification *verification, cav_verdict *verdict);

/// Adds knot t, whose forces, where it has them, are in verification->control; moment [nv] is scratch.
void cav_rates_add(const cav_verification *verification, int t, double *moment, cav_rates *rates);

/// Forces on roots that are penalised: sums over the knots that have been added, and their part of the cost.
typedef struct cav_residual_sum {
  int knots;
  double force, torque;         ///< sums of squares, of the tree that has most at a knot
  double force_max, torque_max; ///< N, N m
  double cost;
  cav_metric worst; ///< fraction of the weight
} cav_residual_sum;

/// Fills verification->deviation; unit and residual [nv] are scratch. Adds knot t by what actuators leave of its forces,
/// residual [nv]. Tells the verdict. residual.c.
void cav_residual_find(cav_verification *verification, double *unit, double *residual);
void cav_residual_add(const cav_verification *verification, int t, const double *residual, cav_residual_sum *sum);
void cav_residual_tell(const cav_verification *verification, const cav_residual_sum *sum, cav_verdict *verdict);

/// 1 if the term's window holds knot t; whether it is one knot, whether it is the whole horizon. constraint_check.c.
int cav_verification_holds(const cav_verification *verification, const cav_term *term, int t, int *single, int *whole);

/// 1 if a term over dofs selects this one. constraint_check.c.
int cav_verification_selects(const cav_model *model, const cav_term *term, int dof);

/// 1 if a term over contacts looks at this one at knot t: those between trees or with the world, of one body alone if it names
/// one, slip of all contacts not at those that no actuator moves and another term lets slide; self-penetration at those
/// between two links of one tree. constraint_check.c.
int cav_verification_looks_at(const cav_verification *verification, const cav_term *term, int t,
                              const cav_contact *contact);

/// m/s up to which terms of slip, those that name a body alone where named is 1, let a contact slide at knot t. One that
/// names a body which no actuator moves lets it slide over what none moves either. constraint_check.c.
double cav_verification_may_slide(const cav_verification *verification, int t, const cav_contact *contact, int named);

/// What a term over contacts measures of one: one value, of slip and clearance two. constraint_check.c.
int cav_verification_contact(const cav_verification *verification, const cav_term *term, const cav_contact *contact,
                             double value[2]);

/// Values of a term at knot t and their targets, x and target [room], q [nq]; their number, 0 where the term has no
/// value. verification->state holds the inverse there. constraint_check.c.
int cav_verification_measure(const cav_verification *verification, const cav_term *term, int t, double *q, double *x,
                             double *target);

/// One channel of a record at knot t, as verification->state has it: what the motion has and what was recorded, in the
/// channel's unit, NaN where nothing was; of orientations the rotation between the two, and zeros. Their number.
/// constraint_check.c.
int cav_verification_channel(const cav_verification *verification, const cav_track *track, int channel, int t,
                             double *value, double *recorded);

/// Whether a record compares velocities or forces, which a knot that nothing leaves has none of. constraint_check.c.
int cav_verification_is_late(const cav_track *track);

/// Whether a term asks for what knot t is given with: the posture or velocity of a start that is not free, of which no cost is
/// taken. targets.c.
int cav_verification_is_given(const cav_verification *verification, const cav_term *term, int t);

/// Weight of a term's norm at knot t in the sum that a cost is: the step over a window, 1 at one knot; both ends of a
/// cycle are one knot. targets.c.
double cav_verification_weight(const cav_verification *verification, const cav_term *term, int t);

/// Adds knot t to the report of every term [nterm], zeroed at first; then what the verdict says of them, with what residual
/// forces cost. targets.c.
void cav_targets_note(const cav_verification *verification, int t, double *work, cav_term_report *report);
void cav_targets_verdict(const cav_verification *verification, cav_term_report *report, double residual_cost,
                         cav_verdict *verdict);

/// Residuals of a record's channels before any knot: what each compares and its unit. targets.c.
void cav_records_begin(const cav_model *model, const cav_track *track, cav_channel_residual *residual);

/// Adds knot t to the residuals of a record's channels: rms sums squares until all knots are in. targets.c.
void cav_records_note(const cav_verification *verification, const cav_term *term, int t,
                      cav_channel_residual *residual);

/// Adds the values of one term at knot t to a list of which the first most are kept. targets.c.
void cav_targets_list(const cav_verification *verification, const cav_term *term, int t, double *work, int most,
                      cav_term_value *value, int *n);

/// A value of a term at knot t in words: name, what it is of, wanted and got. targets.c.
void cav_target_words(const cav_verification *verification, const cav_term *term, int t, int k, double x, double target,
                      char *out, size_t size);

/// Hard terms of the problem at knot t; verification->state holds the inverse there. work holds
/// cav_constraint_check_room values. constraint_check.c.
int cav_constraint_check_room(const cav_verification *verification);
void cav_constraint_check(const cav_verification *verification, int t, double *work, cav_metric *metric);

/// How long and how near a closed loop follows.
struct cav_follow {
  double seconds;
  double error;   ///< m, at its end
  double asked;   ///< largest effort that forces and feedback ask of an actuator, over its limit, before it is clipped
  char lost[160]; ///< why it ended early, "" if it did not
};

/// Forward simulations. replay.c.
typedef struct cav_replay {
  double step_error; ///< |v' - v_{t+1}| h of single steps from the knots
  int step_knot;
  double open_error;             ///< largest |q - knot| in open loop
  double open_seconds;           ///< within 1e-6
  struct cav_follow closed, own; ///< closed loop under the claimed contact law, and under the model's own
} cav_replay;
cav_status cav_replay_steps(const cav_verification *verification, cav_replay *replay);
cav_status cav_replay_open(const cav_verification *verification, cav_replay *replay);
/// law is what the simulation obeys, its timestep apart.
cav_status cav_replay_closed(const cav_verification *verification, const cav_options *law, const double *gain_q,
                             const double *gain_v, struct cav_follow *follow);

/// What a replay meets that the motion does not know of: an impulse on the centre of mass of a root link, at a fraction
/// of the motion, or a start that is a little off.
typedef struct cav_disturbance {
  int link;                    ///< 0: no impulse
  double fraction, impulse[3]; ///< N s, world
  int start;                   ///< 1 .. CAV_STARTS: one of the certificate's; more: others; 0: the motion's own
  struct cav_before *before;   ///< NULL, or what is kept for all impulses of one fraction under the same gains; by
                               ///< itself: it is found
} cav_disturbance;

/// Where a replay stands when an impulse comes: the first finds it, with an impulse or without, the others go on from
/// there.
typedef struct cav_before {
  int known;
  double *x; ///< [nq+2*nv] q, v, mean acceleration of the step before
} cav_before;
size_t cav_before_numbers(const cav_verification *verification);
enum { CAV_STARTS = 4 };

/// By how much at most a start is off: m or rad, m/s or rad/s. What two simulators make of a touch differs by more.
#define CAV_START_POSITION 0.001
#define CAV_START_VELOCITY 0.01

/// Under the contacts of the model's file at the longest of the steps that simulators take, or at the next finer one;
/// disturbance NULL: none.
cav_status cav_replay_own(const cav_verification *verification, int finer, const double *gain_q, const double *gain_v,
                          const cav_disturbance *disturbance, struct cav_follow *follow);

/// Such a loop that is taken on by pieces, or one under the claimed law at a tenth of the step: NULL, no memory. start: as of a
/// disturbance.
typedef struct cav_lane cav_lane;
cav_lane *cav_lane_own(const cav_verification *verification, int finer, int start);
cav_lane *cav_lane_claimed(const cav_verification *verification);
void cav_lane_free(cav_lane *lane);

/// Where it stands, as in cav_before: to be kept, and set to what was.
double *cav_lane_state(cav_lane *lane);

/// On from one knot to another. *strayed: how far it is then, of what loses it; where it is lost 1 and the seconds that are
/// missing.
cav_status cav_lane_run(const cav_verification *verification, cav_lane *lane, const double *gain_q,
                        const double *gain_v, int from, int to, double *strayed);

/// The closed loops of a motion with its gains, for their choice: those of a verification, the last of which start off,
/// and then two small pushes. closed_loop.c.
enum {
  CAV_LOOP_OWN,
  CAV_LOOP_FINE,
  CAV_LOOP_CLAIMED,
  CAV_LOOP_START,
  CAV_LOOP_PUSHED = CAV_LOOP_START + CAV_STARTS,
  CAV_LOOP_PUSHED_BACK,
  CAV_LOOPS
};

/// Makes a motion ready for them; ended as any verification, in any case. Then runs one of them. before: what all loops of
/// one set of gains share, or NULL; cav_before_numbers is its room.
cav_status cav_closed_loops_begin(cav_verification *verification, const cav_problem *problem,
                                  const cav_trajectory *trajectory, const cav_options *contact, cav_error *error);
cav_status cav_closed_loop(const cav_verification *verification, int loop, const double *gain_q, const double *gain_v,
                           cav_before *before, struct cav_follow *follow);

/// The loop before the pushes, for pieces.
cav_lane *cav_closed_loop_lane(const cav_verification *verification, int loop);

/// The worst of those under the contacts of the model's file at each of the steps and from each of the starts that are off;
/// where it is lost in one, the first of these. known: those of all loops before the pushes, or NULL: they are run.
cav_status cav_closed_loops_own(const cav_verification *verification, const struct cav_follow *known,
                                const double *gain_q, const double *gain_v, struct cav_follow *follow);

/// The loops that a certificate asks for, into closed and own of a replay; followed, or NULL: what is known of them.
cav_status cav_closed_loops_certify(const cav_verification *verification, const cav_followed *followed,
                                    const double *gain_q, const double *gain_v, cav_replay *replay);

/// N s of the largest push along x and y, either way, with which a certified motion still follows; NaN: nothing can be pushed.
cav_status cav_closed_loops_push(const cav_verification *verification, const double *gain_q, const double *gain_v,
                                 double *survived);

/// What loops before the pushes have done with a motion that is no cycle, its law and gains, copied; NULL: no memory. Then
/// theirs where all that a loop reads is the same to the bit, else NULL. followed.c.
cav_followed *cav_followed_new(const cav_verification *verification, const double *gain_q, const double *gain_v,
                               const struct cav_follow follow[CAV_LOOP_PUSHED]);
void cav_followed_free(cav_followed *followed);
const struct cav_follow *cav_followed_find(const cav_followed *followed, const cav_verification *verification,
                                           const double *gain_q, const double *gain_v);

#endif
