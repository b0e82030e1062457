/// What a motion should achieve: a model, a horizon, a start, a guess, costs and constraints. Everything a problem file
/// can say, these structs can say.
#ifndef CAVORT_PROBLEM_H
#define CAVORT_PROBLEM_H

#include "cavort/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// What a term measures at a knot, X(quantity, element of problem files, what it has values of, what it reads, hard,
/// unit, in words, text). Values are of a SENSOR, of a POSTURE (a tangent, by dofs), of RATEs of dofs, of ACTUATORS or
/// of CONTACTS, or what a TRACK records; hard 1: a constraint can be of it, too. The enumeration, reading, writing,
/// grammar and help of <cost> and <constraint> follow from it.
// clang-format off
#define CAV_QUANTITIES(X)                                                                                          \
  X(SENSOR, sensor, SENSOR, POSITION, 1, "its own", "sensor", "reading of a sensor; quaternions as the rotation vector to the target") \
  X(CONFIGURATION, posture, POSTURE, POSITION, 1, "rad or m", "posture", "q (-) target, tangent, of the selected dofs") \
  X(VELOCITY, velocity, RATE, VELOCITY, 1, "rad/s or m/s", "velocity", "v_t of the selected dofs")                 \
  X(ACCELERATION, acceleration, RATE, ACCELERATION, 1, "rad/s^2 or m/s^2", "acceleration", "(v_{t+1} - v_t)/h of the selected dofs") \
  X(EFFORT, effort, ACTUATORS, ACCELERATION, 0, "of limits", "effort of actuators", "force of every actuator over its limit, of a servo over what the limit of its control gives (force itself where there is none)") \
  X(POWER, power, ACTUATORS, ACCELERATION, 0, "m/s", "power of actuators", "power of every actuator over the weight, at its mean velocity of the step; norm=\"absolute\" with a small scale: the cost of transport") \
  X(GAP, gap, CONTACTS, ACCELERATION, 0, "m", "gap of loaded contacts", "sqrt(f_n/weight) * max(gap, 0) of every contact: force only where there is touch") \
  X(SLIP, slip, CONTACTS, ACCELERATION, 0, "m/s", "slip of loaded contacts", "sqrt(f_n/weight) * tangential velocity of every contact") \
  X(IMPACT, impact, CONTACTS, ACCELERATION, 0, "m/s", "impact of loaded contacts", "sqrt(f_n/weight) * normal velocity of every contact") \
  X(CLEARANCE, clearance, CONTACTS, ACCELERATION, 0, "m/s", "clearance over the ground", "tangential velocity of every point that passes over planes and height fields of the world within 3 cm, fading over these, of trees that actuators move and whose root floats: swinging feet are lifted; not of what a term of slip lets slide, and nothing where slip costs nothing") \
  X(SELF_PENETRATION, self_penetration, CONTACTS, ACCELERATION, 0, "m", "self-penetration", "depth of every contact between two links of one tree") \
  X(FORCE, force, CONTACTS, ACCELERATION, 0, "of weight", "force of contacts", "normal force of every contact between trees or with the world") \
  X(EDGE_FORCE, edge_force, CONTACTS, ACCELERATION, 0, "of weight", "force at edges", "normal force of every contact with a box of the world at an edge of it, fading over the 3 cm beside; edges where the next box or the ground begins are none") \
  X(SELF_FORCE, self_force, CONTACTS, ACCELERATION, 0, "of weight", "force between links", "normal force of every contact between two links of one tree") \
  X(TRACK, track, TRACK, POSITION, 0, "of the noise", "recorded motion", "difference from a record (markers, joints, sensors) over the standard deviation of its noise; what was not recorded is not compared")
// clang-format on

/// Quantities: CAV_QUANTITIES, and one of the caller's own.
typedef enum cav_quantity {
#define CAV_QUANTITY_MEMBER(quantity, ...) CAV_QUANTITY_##quantity,
  CAV_QUANTITIES(CAV_QUANTITY_MEMBER)
#undef CAV_QUANTITY_MEMBER
      CAV_QUANTITY_USER, ///< one's own: term->user. In code alone: files cannot name a function
  CAV_QUANTITY_TYPES
} cav_quantity;

/// What a quantity has values of.
typedef enum cav_values_of {
  CAV_OF_SENSOR,    ///< term->sensor, or one component of it
  CAV_OF_POSTURE,   ///< the dofs that a term selects, against a configuration
  CAV_OF_RATE,      ///< the dofs that a term selects
  CAV_OF_ACTUATORS, ///< all actuators
  CAV_OF_CONTACTS,  ///< the contacts of a knot, or those of term->body
  CAV_OF_TRACK,     ///< the channels of term->track
  CAV_OF_USER       ///< term->user, or one component of it
} cav_values_of;

/// What holds for all terms of a quantity.
typedef struct cav_quantity_rule {
  const char *name;                ///< its element in problem files
  cav_values_of of;                ///< what it has values of
  cav_sensor_stage reads;          ///< of sensors: what cav_sensor_rule_of tells; of one's own: what it says itself
  int hard;                        ///< 1: a constraint can be of it, too
  const char *unit, *words, *text; ///< of its values; name in sentences; what it measures
} cav_quantity_rule;

/// quantity < CAV_QUANTITY_TYPES.
CAV_API const cav_quantity_rule *cav_quantity_rule_of(cav_quantity quantity);

/// What a quantity of one's own is read off: one knot, at which the state holds cav_inverse. All of it lasts as long as the
/// call. Contacts are state->contact [state->ncontact], their forces impulse/timestep, N; efforts [nu]: cav_actuation of
/// u. What uses scratch of the state alone may be called with it (cav_sensor_read, cav_object_pose, cav_actuation,
/// cav_actuator_length), no evaluation. At a knot without forces, the last of a motion that does not close at rest, v_next
/// is v, and a quantity that reads CAV_READS_ACCELERATION is not asked.
typedef struct cav_knot_view {
  const cav_model *model; ///< of the problem
  cav_state *state;       ///< at the knot: poses, contacts, impulses
  double time;            ///< s: that of windows and targets, a fraction of the problem's duration where that is free
  double timestep;        ///< s
  const double *q, *v, *v_next; ///< [nq], [nv], [nv]: accelerations are (v_next - v)/timestep
  const double *u;              ///< [nv] N or N m
} cav_knot_view;

/// Derivatives of dim values by all that they are made of, row-major, zeros at first; what a value has of one through
/// another is added by the library: of u and of the impulses through q, v and v_next. Velocities and impulses are that
/// of the view, positions are moved in the tangent, q (+) e_j.
typedef struct cav_view_jacobian {
  double *dq, *dv, *dv_next, *du; ///< [dim*nv]
  double *dimpulse;               ///< [dim*6*ncontact] by impulse[k] of contact i: column 6*i + k, k < contact[i].dim
} cav_view_jacobian;

/// Writes the values [dim] at a knot; returns 0. Anything else ends the solve with CAV_BAD_INPUT. A value that is not
/// finite refuses a step of the optimiser there, and is an error (CAV_NOT_FINITE) at a motion that it has to be taken
/// at. Called from all threads of a solve at once, so it changes nothing but values, and the same view gives the same
/// bits.
typedef int (*cav_user_value)(void *context, const cav_knot_view *view, double *value);

/// Adds the derivatives at a knot, likewise. cav_derivatives has been called: cav_contact_derivatives and
/// cav_sensor_derivatives, for what of contacts (gap, slip) and sensors a value is made of, may be called with the
/// view's state; what they give goes into dq, dv and dv_next.
typedef int (*cav_user_jacobian)(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian);

enum { CAV_USER_DIM_MAX = 64 }; ///< most values of a quantity of one's own

/// A quantity of one's own (CAV_QUANTITY_USER): terms, reports, explanations and certificates treat it as those of the
/// list. Its second derivatives are those of the Jacobian, by differences, where the solver takes any (Ipopt, the last
/// programmes); without Jacobian only the squares of Gauss and Newton. optim/METHOD.md, 4.
typedef struct cav_user_quantity {
  const char *name;       ///< what reports and errors call it, never NULL
  const char *unit;       ///< of its values; NULL: none
  int dim;                ///< number of values, 1 .. CAV_USER_DIM_MAX
  cav_sensor_stage reads; ///< the last stage that it looks at: of q alone, of q and v_next, or of anything
  cav_user_value value;   ///< reads its values
  /// NULL: by differences of value, as of all that has no closed form: nv evaluations of the dynamics a knot for each of
  /// q, v_next and v that it reads, one-sided with a relative step of 1e-7 (positions) and 1e-6 (velocities), for Ipopt
  /// centred with 1e-5 and 1e-4 (cav_readout_differentiate). Right to some 1e-6 or 1e-9 where value is smooth; at a kink
  /// the derivative of one of its sides, or of Ipopt's their mean.
  cav_user_jacobian jacobian;
  void *context; ///< the functions' first argument
  double within; ///< usual tolerance of a goal that states none, in its unit; 0: there is none
} cav_user_quantity;

/// Largest relative difference of a quantity's Jacobian from centred differences of its values at a point q [nq], v and
/// v_next [nv] under the state's options, over the largest entry of its row (1e-3 of the largest of all rows at least);
/// where: number of the value and the dof of the worst entry, and whether that is by q (0), v (1) or v_next (2); may be
/// NULL. The state is left at the point. CAV_BAD_INPUT: the quantity has no Jacobian, is refused as a term, or changes
/// with what it says it does not read;
/// CAV_NOT_SUPPORTED: the model has no analytic derivatives (cav_derivatives_missing), so the Jacobian is not used;
/// CAV_NOT_FINITE, CAV_NO_MEMORY.
CAV_API cav_status cav_user_quantity_check(const cav_user_quantity *quantity, cav_state *state, const double *q,
                                           const double *v, const double *v_next, double *error_relative, int where[3],
                                           cav_error *error);

/// What a channel of a record is of, X(kind, element of problem files, text).
// clang-format off
#define CAV_CHANNELS(X)                                                                                            \
  X(MARKER, marker, "place of a point of a body, m: 3 numbers")                                                    \
  X(COORDINATE, joint, "coordinate of a hinge or slide, rad or m")                                                 \
  X(TRANSLATION, joint, "place of a free joint, m: 3 numbers")                                                     \
  X(ROTATION, joint, "orientation of a ball or free joint: quaternion w x y z, compared as a rotation vector, rad") \
  X(SENSOR, sensor, "reading of a sensor, or one component of it; quaternions as a rotation vector, rad")
// clang-format on

/// Kinds of channels: CAV_CHANNELS.
typedef enum cav_channel_kind {
#define CAV_CHANNEL_MEMBER(kind, ...) CAV_CHANNEL_##kind,
  CAV_CHANNELS(CAV_CHANNEL_MEMBER)
#undef CAV_CHANNEL_MEMBER
      CAV_CHANNEL_KINDS
} cav_channel_kind;

/// What one group of columns of a record is compared with.
typedef struct cav_channel {
  const char *name;      ///< of the marker, joint or sensor
  cav_channel_kind kind; ///< what it is of
  int object;            ///< body of a marker, joint; not of a sensor
  double place[3];       ///< of a marker in its body's frame, m
  cav_sensor sensor;     ///< CAV_CHANNEL_SENSOR
  int component;         ///< of the sensor, -1: all
  int column, ncolumn;   ///< its numbers in a frame, at most CAV_SENSOR_DIM_MAX
  double sd;             ///< standard deviation of the record's noise, > 0, in the unit of the channel
} cav_channel;

/// A record that a motion is compared with (CAV_QUANTITY_TRACK): frames over a time of their own. Sensors that read
/// accelerations or forces, those that read velocities, and all else are of different tracks.
typedef struct cav_track {
  int nchannel;               ///< from 1
  const cav_channel *channel; ///< [nchannel]
  int nframe, ncolumn;        ///< nframe >= 2
  const double *time;         ///< [nframe] s, increasing
  const double *value;        ///< [nframe*ncolumn], NaN: not recorded; quaternions continuous
  double interval;            ///< s from frame to frame, in the mean
  double offset;              ///< s: time of the record at which the motion begins
  double gap;                 ///< s: longest time between frames of a column that is bridged
  int unused,
      absent; ///< told only: columns of the file that nothing asks for, markers of the set that it does not have
} cav_track;

/// What a channel of a record says at a time of the motion, for knots timestep apart: value [ncolumn], NaN where it says
/// nothing; an orientation of unit length. Returns whether it says anything. Linear between frames; where knots are
/// farther apart than frames the mean of the frames by weights that fall linearly to zero a timestep away. All frames
/// that count have to be there, or be bridged. Channels that read velocities are read half a step later, since the velocity
/// that leaves a knot is the mean over a step. optim/METHOD.md, 12.
CAV_API int cav_track_sample(const cav_track *track, const cav_channel *channel, double time, double timestep,
                             double value[CAV_SENSOR_DIM_MAX]);

/// What a cost makes of a residual x, value minus target over scale.
typedef enum cav_norm {
  CAV_NORM_SQUARE,  ///< x^2/2
  CAV_NORM_ABSOLUTE ///< sqrt(1 + x^2) - 1: x^2/2 within the scale, |x| far beyond it, where it pulls no harder
} cav_norm;

/// Tolerances of goals where the term gives none, by what is measured.
#define CAV_WITHIN_LENGTH 0.03 ///< m
#define CAV_WITHIN_ANGLE 0.1   ///< rad

/// What becomes of a term.
typedef enum cav_term_use {
  CAV_USE_COST, ///< weight times norm of every component, integrated over the window; at a single knot not multiplied by time
  CAV_USE_EQUAL, ///< x = target, hard
  CAV_USE_RANGE  ///< lower <= x <= upper, hard
} cav_term_use;

/// Which dofs a term over velocities, accelerations or configurations selects.
typedef enum cav_dof_set {
  CAV_DOFS_ALL,          ///< all dofs
  CAV_DOFS_ROOT_LINEAR,  ///< the three translations of free joints
  CAV_DOFS_ROOT_ANGULAR, ///< the three rotations of free joints
  CAV_DOFS_JOINTS,       ///< all but free joints
  CAV_DOFS_DRIVEN,       ///< those of them in trees that an actuator moves (cav_link.driven)
  CAV_DOFS_ONE           ///< the dofs of one joint: term->object
} cav_dof_set;

/// A cost or a constraint.
typedef struct cav_term {
  const char *name;              ///< for logs and explanations; "" is fine
  cav_quantity quantity;         ///< what it measures
  cav_term_use use;              ///< cost, equality or range
  cav_sensor sensor;             ///< CAV_QUANTITY_SENSOR: from the model or declared by the problem
  const cav_user_quantity *user; ///< CAV_QUANTITY_USER: borrowed; NULL for others
  const cav_track *track;        ///< CAV_QUANTITY_TRACK: borrowed; NULL for others
  int component;                 ///< component of a sensor or of user, -1: all
  cav_dof_set dofs;              ///< dofs that count, of velocities, accelerations and configurations
  int joint;                     ///< CAV_DOFS_ONE
  double from, to;               ///< window, s; equal: one knot (the nearest). to < 0: the end
  double weight;                 ///< cost
  cav_norm norm;                 ///< cost
  int body;                      ///< over contacts: those of this body's link alone; 0: all
  double scale;                  ///< values are divided by it, > 0, unit of the quantity
  const double *target; ///< constant: sensors [sensor.dim], user [user->dim], all of them even if one component counts;
      ///< configurations a q [nq]; rates [nv]. NULL: zeros (quaternion: identity; configuration: the goal)
  int nwaypoint;               ///< 0, or target is [nwaypoint*dim], linear between times, constant before and after
  const double *waypoint_time; ///< [nwaypoint], s, increasing
  double within; ///< tolerance of the target, in the unit of the quantity: the motion achieves it if off by at most
                 ///< this. 0: a usual one for goals, at one time or held over a window, none for running costs
                 ///< (problems/README.md); infinite: told only. Of slip, m/s: up to which contacts may slide, in a
                 ///< certificate
  double lower,
      upper; ///< CAV_USE_RANGE, infinite where open; target is NULL then, or a posture or orientation to start from
} cav_term;

/// A sine laid over a scalar joint of the guess; it fades in and out over the first and last fifth of the motion.
typedef struct cav_swing {
  int joint;        ///< it is laid over
  double amplitude; ///< rad or m
  double frequency; ///< Hz
  double phase;     ///< rad
} cav_swing;

/// Axis that a cycle reflects.
typedef enum cav_mirror {
  CAV_MIRROR_NONE, ///< no mirror
  CAV_MIRROR_X,    ///< x is reflected
  CAV_MIRROR_Y     ///< y is reflected
} cav_mirror;

/// A motion without start and end: the last knot is the first one moved, and so are their velocities. With a mirror the
/// horizon is half a stride, and the second half is the first one reflected, left for right.
typedef struct cav_cycle {
  int on;                ///< 0: the motion has a start and an end
  double translation[3]; ///< m, from one period to the next, of all that floats or slides
  double rotation;       ///< rad about the vertical through the first free joint of q_start, before the translation
  cav_mirror mirror;     ///< in the origin of the world, before the translation; excludes a rotation
  int npair;             ///< counterparts that names do not tell
  const int (*pair)[2];  ///< [npair] joints
} cav_cycle;

/// What the guess is made from.
typedef enum cav_guess {
  CAV_GUESS_HOLD,        ///< the start, held
  CAV_GUESS_INTERPOLATE, ///< from start to goal, by its postures on the way
  CAV_GUESS_PUMP         ///< simulated under laws that pump energy, contacts left out: a swing-up (optim/METHOD.md, 7)
} cav_guess;

/// A posture that the guess passes.
typedef struct cav_guess_pose {
  double time;     ///< s
  const double *q; ///< [nq]
} cav_guess_pose;

/// Options of a stage of the continuation (optim/METHOD.md, 5): REAL(name, first, last, least, most, course, law, unit,
/// text) and WHOLE(name, first, last, least, most, text), with the defaults of the first and the last stage. course:
/// ALL goes from first to last over all stages, HALF over the first half of them, KEEP stays until the last stage, as
/// whole numbers do. law: SAME is the option of that name of the contact law, STEPS too, in steps of the horizon, NONE
/// is not. The struct, its defaults, interpolation and checks, and reading, writing, grammar and help of <first> and
/// <last> in problem files follow from this list.
// clang-format off
#define CAV_STAGE_OPTIONS(REAL, WHOLE)                                                                             \
  REAL(softness, 4, 0.005, DBL_MIN, DBL_MAX, ALL, SAME, "", "epsilon of the contacts")                             \
  REAL(time_constant, 1, 0, 0, DBL_MAX, ALL, STEPS, "steps", "kappa of the contacts; 0: deadbeat")                 \
  REAL(smoothing, 0.05, 0.0005, DBL_MIN, DBL_MAX, ALL, SAME, "m", "delta of the contacts")                         \
  REAL(smoothing_self, 0.002, 0.001, DBL_MIN, DBL_MAX, ALL, SAME, "m", "delta between links of one tree and of limits (rad)") \
  REAL(self_stiffness, 1e-3, 1, DBL_MIN, 1, ALL, SAME, "", "fraction of the stiffness of contacts between links of one tree; ends at 1") \
  REAL(penalty, 1e3, 1e5, DBL_MIN, DBL_MAX, HALF, NONE, "", "weight of the unactuated force (fraction of weight, squared)") \
  WHOLE(iterations, 30, 40, 1, INT_MAX, "at most")                                                                \
  REAL(tolerance, 1e-3, 1e-4, DBL_MIN, 1, KEEP, NONE, "", "relative decrease below which, twice in a row, the stage ends")
// clang-format on

/// Options of a stage: CAV_STAGE_OPTIONS.
typedef struct cav_stage_options {
#define CAV_REAL_MEMBER(name, ...) double name;
#define CAV_WHOLE_MEMBER(name, ...) int name;
  CAV_STAGE_OPTIONS(CAV_REAL_MEMBER, CAV_WHOLE_MEMBER)
#undef CAV_REAL_MEMBER
#undef CAV_WHOLE_MEMBER
} cav_stage_options;

/// The table of cav_stage_options; its length in *n.
CAV_API const cav_field *cav_stage_fields(int *n);

/// How solids of the world begin in a schedule (optim/METHOD.md, 5).
#define CAV_SOLIDS(X)                       \
  X(CAV_SOLIDS_HARD, "hard", "as they are") \
  X(CAV_SOLIDS_GROW, "grow", "the guess is lifted out of them; depth costs, and forces saturate with it")

/// How solids begin: CAV_SOLIDS.
typedef enum cav_solids {
#define CAV_WORD_MEMBER(enumerator, word, text) enumerator,
  CAV_SOLIDS(CAV_WORD_MEMBER)
#undef CAV_WORD_MEMBER
} cav_solids;

/// The schedule: stages go geometrically from first to last; the penalty reaches its end at half way.
typedef struct cav_schedule {
  int stages;            ///< from 1
  cav_sliding sliding;   ///< law of contacts that slide from three quarters of the way on; before it is the convex one
  cav_solids solids;     ///< how solids of the world begin
  cav_next_gap next_gap; ///< gap after the step that contacts see from half way on; before it is the linear one
  cav_next_slip next_slip;       ///< slip over the step, the same way
  int kinematics;                ///< 1: before the first stage the guess goes to its targets by kinematics alone
  int light_avoided;             ///< 1: costs on forces of bodies of the world grow from three tenths over the stages
  int calm;                      ///< 1: costs on the turning of roots weigh more before the last stage
  double optimality;             ///< what the last phase may leave to be saved; 0: cav_solve_options.optimality
  cav_stage_options first, last; ///< options of the first and of the last stage
} cav_schedule;

/// One option of Ipopt by its own name, its value as text.
typedef struct cav_ipopt_option {
  const char *name, *value; ///< as Ipopt has them, both as text
} cav_ipopt_option;

/// Forces on roots that nothing in the model gives: zero, or at a cost. Of dofs of joints between the world and a root
/// link that no actuator moves; all others have to be zero in any case. For records that the model cannot follow exactly; a
/// certificate tells how large they are.
typedef struct cav_residual {
  double force,
      torque; ///< N, N m: deviations: the cost is half of the integral of their squares over these, 0: they are zero
  double
      within; ///< the largest that a certificate allows at any knot, fraction of the weight (torques: over weight times
              ///< CAV_MOMENT_ARM)
} cav_residual;

/// A motion that is wanted.
typedef struct cav_problem {
  const char *name;       ///< for result folders and pages; "" is fine
  const cav_model *model; ///< what moves; borrowed unless the problem was read from a file
  const char *
      scene; ///< what the problem file added to the world of the model's file, as MJCF; the model has it. NULL: nothing
  double duration, timestep; ///< s; knots are round(duration/timestep) + 1
  cav_order order;           ///< of the step
  int close_at_rest; ///< 1: v after the last knot is zero, with rows there (options.stops); 0: no rows at the last knot
  /// Free duration: the step is an unknown, the same for all knots, between these; both 0: duration is what it is.
  /// Times of windows and waypoints stay fractions of duration.
  double duration_least, duration_most;
  double duration_weight; ///< cost weight/2 * (duration in s)^2 where the duration is free
  /// Solved by windows of time, s, each looking ahead over the overlap that the next one solves again; window 0, or as long
  /// as the motion: all at once.
  double window, overlap;
  cav_cycle cycle;     ///< where on: close_at_rest and v_start do not count, and q_start is where the guess starts
  int free_start;      ///< 1: q_0 and v_0 are unknowns, and q_start and v_start where the guess starts; not of a cycle
  double *q_start;     ///< [nq]
  double *v_start;     ///< [nv]
  double *q_goal;      ///< [nq] goal posture of the guess and of configuration terms without a target
  cav_guess guess;     ///< what the guess is made from
  double guess_height; ///< m: ballistic arc added to the guess over guess_from .. guess_to
  double guess_bow[2]; ///< m: half sine along x and y added to the first free joint's guess over guess_from .. guess_to
  double guess_from, guess_to; ///< s
  double
      guess_rotation[3]; ///< rotation vector that the first free joint's guess makes over guess_from .. guess_to, rad
  int guess_ground;      ///< 1: between start and goal the guess stands on what is below it, so high as there
  int nguess_pose;       ///< postures on the way
  const cav_guess_pose
      *guess_pose; ///< [nguess_pose], times increasing within the horizon: postures on the way to the goal
  const cav_guess_pose
      *guess_left;  ///< [nguess_pose] the same, joints that ranges="clip" moved in any of them left as at the start;
                    ///< NULL: it moved none. For strategies
  int nswing;       ///< sines over joints
  cav_swing *swing; ///< [nswing]
  int nterm;        ///< costs and constraints
  cav_term *term;   ///< [nterm]
  cav_residual residual;          ///< forces on roots that are penalised
  int nparameter;                 ///< numbers of the model that are not known
  const cav_parameter *parameter; ///< [nparameter] found by cav_estimate_solve; all else takes the model as it is
  double effort_limit;            ///< fraction of the actuator limits planned with, 0 .. 1
  double strength;                ///< times their limits that actuators are taken to have, of a diagnosis; 0: once. The
                                  ///< certificate is of such actuators
  double limit_margin;            ///< rad or m kept from joint and tendon limits in planning
  cav_schedule schedule;          ///< of the continuation
  int nipopt;                     ///< options for Ipopt, where it is the solver
  const cav_ipopt_option *ipopt;  ///< [nipopt]
  int solved;                     ///< 1: read from a result folder, contact holds
  cav_options contact;            ///< the law that the recorded motion obeys, for verification; solving does not use it
  const char *model_path;         ///< file the model was read from; NULL: made in C
  int floating;                   ///< 1: the root link of that file, a URDF, floats
  void *owner;                    ///< memory of a problem read from a file
} cav_problem;

/// A term with what files give one that says no more: its element's name, over the whole horizon, of all joints but free
/// ones, of all components, scale 1, the norm a square, no target (zeros, or the goal posture). Set what else there is to say:
/// sensor or user, window, target, dofs, within. quantity < CAV_QUANTITY_TYPES; a constraint's has hard in its rule.
CAV_API cav_term cav_term_cost(cav_quantity quantity, double weight);
CAV_API cav_term cav_term_equal(cav_quantity quantity, const double *target);
CAV_API cav_term cav_term_range(cav_quantity quantity, double lower, double upper);

/// The first object of the model that has one of the names, separated by |, as files have it: of bodies also by role ("right
/// foot"), whose kind *type then may become CAV_OBJECT_GEOM. -1 with the reason in error. Uses the state.
CAV_API int cav_object_named(const cav_model *model, cav_state *state, const char *names, cav_object_type *type,
                             cav_error *error);

/// A sensor of an object of the model, in the world's frame, for a term's sensor. CAV_BAD_INPUT with the reason in error:
/// sensors of that type do not look at such an object.
CAV_API cav_status cav_sensor_of(const cav_model *model, cav_sensor_type type, cav_object_type object_type, int object,
                                 cav_sensor *sensor, cav_error *error);

/// What key="stand" is in files: q [nq] of a posture that stands, of any model with feet: its keyframe "stand" or "home", or
/// one found. CAV_BAD_INPUT: there is none, and why; CAV_NOT_FINITE, CAV_NO_MEMORY. Uses the state.
CAV_API cav_status cav_configuration_stand(const cav_model *model, cav_state *state, double *q, cav_error *error);

/// What key="kneel" and the like are in files: q [nq] of a posture that is found, by name: squat, kneel, half-kneel, sit,
/// sit-floor, all-fours, lie-back, hook-lying, lie-front or lie-side of a biped, lie of a quadruped, stand of both.
/// CAV_BAD_INPUT: no such posture, or the model has none, and why; CAV_NOT_FINITE, CAV_NO_MEMORY. Uses the state.
CAV_API cav_status cav_configuration_posture(const cav_model *model, cav_state *state, const char *name, double *q,
                                             cav_error *error);

/// What height="floor" of a posture in files does to q [nq]: moves each tree that is free or slides along the vertical until
/// its lowest geom touches a plane of the world, or going down something else that stands there first. rise: planes alone,
/// and so many metres higher; NULL: no such. The state is left at q. Trees whose <root> says height="keep" stay, in files.
/// CAV_BAD_INPUT: nothing can be moved so; CAV_NOT_FINITE, CAV_NO_MEMORY: q is undefined.
CAV_API cav_status cav_configuration_to_floor(const cav_model *model, cav_state *state, const double *rise, double *q,
                                              cav_error *error);

/// What ranges="clip" does to joints: hinges and slides of q [nq] into their ranges, where they have any. Returns how many
/// were outside. In files it then brings in tendons, too.
CAV_API int cav_configuration_clip(const cav_model *model, double *q);

/// Largest weight of a cost and of a free duration: beside a cost of that size, and so with 16 digits, one of weight 1 is lost
/// in rounding. What has to hold exactly is a constraint.
#define CAV_WEIGHT_MOST 1e16

/// Weights, schedule and options that serve all motions; the caller sets duration, start, goal and terms. Owns nothing.
CAV_API cav_problem cav_problem_default(const cav_model *model);

/// The running costs that serve all motions: effort, velocities, accelerations, posture, gap, slip, impact, force at edges,
/// clearance, self-penetration.
/// Writes the first most of them to term (may be NULL if most is 0) and returns how many there are.
CAV_API int cav_problem_default_terms(cav_term *term, int most);

/// How far a joint that no actuator works on may lie beyond its range, where its stop holds it as the floor holds a foot:
/// rad, of a hinge or ball. Ranges of other joints are exact.
#define CAV_TOLERANCE_STOP_ANGLE 0.05
#define CAV_TOLERANCE_STOP_WAY 0.005 ///< m, of a slide

/// The one of the two that goes for a joint; 0: an actuator works on it.
CAV_API double cav_joint_stop(const cav_joint *joint);

/// By how much a term of a problem may be off its target: what it states (within), of a constraint CAV_TOLERANCE_CONSTRAINT of
/// its scale, of a goal (a cost at one time, or held over a window of its own at one value) the usual one, if there is one
/// (> 0); infinite: any, as of running costs, and of what is known of a free start beside a record.
CAV_API double cav_term_tolerance(const cav_problem *problem, const cav_term *term, double usual);

/// Whether a term's bounds are a tolerance of its target: as far below that as above, and finite.
CAV_API int cav_term_is_band(const cav_term *term);

/// Reads a problem file and its model (model_path overrides the file's; NULL: as written). NULL on failure.
/// The result and its model are freed by cav_problem_free.
CAV_API cav_problem *cav_problem_load(const char *path, const char *model_path, cav_error *error);

/// Whether an option of Ipopt may be set and its value fits; CAV_BAD_INPUT with the reason in error (may be NULL).
CAV_API cav_status cav_ipopt_option_check(const cav_ipopt_option *option, cav_error *error);

/// Why motions cannot be planned with an actuator of a model; NULL: they can.
CAV_API const char *cav_actuator_unplannable(const cav_model *model, int actuator);

/// Frees a problem that cav_problem_load gave, and its model; NULL is fine.
CAV_API void cav_problem_free(cav_problem *problem);

/// Writes a problem such that reading it gives the same: poses as numbers, every term spelt out. model_path is written
/// as it stands (NULL: problem->model_path). Replaces the file atomically. CAV_BAD_INPUT: path cannot be written, or a
/// term looks at a body, site or geom without a name, or is of a quantity of one's own.
CAV_API cav_status cav_problem_write(const char *path, const cav_problem *problem, const char *model_path,
                                     cav_error *error);

/// Why a problem cannot have a solution, X(condition, word, text): necessary conditions that it may break.
// clang-format off
#define CAV_CONDITIONS(X)                                                                                          \
  X(CONTRADICTION, "contradiction", "two targets, or a target and the start, exclude each other")                  \
  X(RANGE, "range", "a target outside the range of a joint")                                                       \
  X(DISTANCE, "distance", "targets farther apart, or nearer, than links and ranges of joints allow")               \
  X(SOLID, "solid", "a posture or a target inside a solid")                                                        \
  X(TOUCH, "touch", "a force asked of what nothing can touch")                                                  \
  X(MOMENTUM, "momentum", "no force from outside that could move the centre of mass so far")                       \
  X(STRENGTH, "strength", "a posture to be held that actuators and contacts cannot hold")                          \
  X(ENERGY, "energy", "more energy, or a faster motion, than actuators can give in the time")
// clang-format on

/// Necessary conditions: CAV_CONDITIONS.
typedef enum cav_condition {
#define CAV_CONDITION_MEMBER(condition, ...) CAV_CONDITION_##condition,
  CAV_CONDITIONS(CAV_CONDITION_MEMBER)
#undef CAV_CONDITION_MEMBER
      CAV_CONDITION_TYPES
} cav_condition;

/// A proof that a problem has no solution.
typedef struct cav_impossibility {
  cav_condition condition; ///< that is broken
  int term;                ///< that asks for it, -1: none
  int knot;                ///< at which
  int joint;               ///< that lacks force against gravity (CAV_CONDITION_STRENGTH), -1: none
  char what[400];          ///< the cause, in words
  char cure[160];          ///< what helps
} cav_impossibility;

/// Proofs that no motion can be certified and achieve what a problem asks, most at most, *n found; the first is the
/// cause to tell. Necessary conditions of values at knots, on the safe side: a possible problem has none, an impossible
/// one need not have any. Takes milliseconds and solves nothing. optim/METHOD.md, 10. CAV_NO_MEMORY, CAV_NOT_FINITE.
CAV_API cav_status cav_problem_impossible(const cav_problem *problem, cav_impossibility *found, int most, int *n,
                                          cav_error *error);

#ifdef __cplusplus
}
#endif
#endif
