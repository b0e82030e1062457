/// Inverse and forward dynamics with contacts. Todorov, ICRA 2014; equation numbers are that paper's.
/// One state per thread; the model is shared. After the first call on a state nothing allocates, unless more
/// contacts appear than ever before.
#ifndef CAVORT_DYNAMICS_H
#define CAVORT_DYNAMICS_H

#include "cavort/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/// m: contacts with planes and height fields of the world are listed at least as far as this, or 5 m/s times the step, though
/// nothing bears there.
#define CAV_CLEARANCE 0.03

/// One contact point at (q, v, v_next). Impulses act on geom2 (and reversed on geom1) along the axes of frame.
typedef struct cav_contact {
  int pair;                ///< index into model->pair
  int feature;             ///< which point of the pair's manifold: stable between nearby configurations
  int dim;                 ///< rows: 1, 3, 4 or 6
  int link1, link2;        ///< links that touch, of geom1 and geom2
  double pos[3];           ///< m, world, midway between the surfaces
  double frame[9];         ///< rows are axes in world coordinates; the first is the normal, from geom1 to geom2
  double dist;             ///< m, gap between the surfaces; negative: penetration
  double margin;           ///< m, the constraint pushes below this distance
  double regulariser[6];   ///< R, 1/kg
  double damping[6];       ///< h B, dimensionless: v* = (1 - hB) x' - h K x
  double stiffness;        ///< h K of the normal row, 1/s
  double sigma;            ///< smoothing of the law in impulse scale (dynamics/METHOD.md, 3), 0: exact
  double friction[5];      ///< two tangential, one torsional, two rolling coefficients
  double velocity[6];      ///< J v, m/s (rad/s for the last three); of all these the first dim count
  double velocity_next[6]; ///< J v_next; tangential ones as the option next_slip has them
  double impulse[6];       ///< f, N s
} cav_contact;

/// One scalar constraint at (q, v, v_next): a limit or a friction loss, of a joint (dof) or of a tendon.
typedef enum cav_row_type {
  CAV_ROW_LIMIT_JOINT,    ///< range of a joint
  CAV_ROW_LIMIT_TENDON,   ///< range of a tendon
  CAV_ROW_FRICTION_DOF,   ///< dry friction of a dof
  CAV_ROW_FRICTION_TENDON ///< dry friction of a tendon
} cav_row_type;
/// A scalar constraint of a state: a limit, or a friction loss.
typedef struct cav_row {
  cav_row_type type; ///< what it limits
  int object;        ///< joint, tendon or dof
  int side;          ///< limits: 0 lower, 1 upper; of a ball's cylinder 2 lower and 3 upper twist, 4 swing
  double dist;       ///< limits: distance to the limit, negative: violated
  double margin;     ///< m or rad: distance at which it becomes active
  double axis[3];    ///< gradient of dist: 1 value for scalar objects (+1 or -1), 3 for a ball joint
  double bound;      ///< friction loss: h eta, N s
  double regulariser, damping, stiffness, sigma; ///< R, B, K and the smoothing of its law (dynamics/METHOD.md, 4)
  double velocity, velocity_next;                ///< J v and J v_next
  double impulse;                                ///< f, N s or N m s
} cav_row;

/// One equality constraint at (q, v, v_next). Impulses act on the first object and, reversed, on the second.
typedef struct cav_equality_rows {
  int equality;       ///< index into model->equality
  int dim;            ///< rows: 1, 3 or 6
  double error[6];    ///< x: m; weld, last three: torquescale times sines of half angles; joint and tendon: their unit
  double point[2][3]; ///< connect, weld, distance: m, world, where the impulse acts on each link
  double rotation[9]; ///< weld: rate of error[3..5] = rotation (w1 - w2), angular velocities in world axes
  double normal[3];   ///< distance: from the second geom to the first
  double derivative;  ///< joint, tendon: rate of error = v1 - derivative v2
  double regulariser[6];     ///< R of each dimension
  double damping, stiffness; ///< h B and h K of all rows: v* = (1 - hB) x' - hK x - h J'v
  double bias[6];            ///< connect, weld: J'v, the acceleration at v without any of the dofs', m/s^2; others 0
  double velocity[6], velocity_next[6], impulse[6]; ///< J v, J v_next and impulse of each dimension
} cav_equality_rows;

/// World pose of a link. Row-major rotation: world = rotation * local + pos.
typedef struct cav_pose {
  double pos[3];      ///< m, world
  double rotation[9]; ///< its axes in the world, row-major
  double quat[4];     ///< the same as a unit quaternion w x y z
} cav_pose;

/// What one thread computes at one (q, v, v_next). Readable after the call that fills it, written by the library only
/// (except options). Spatial vectors are (angular, linear) in world axes at the tree's reference point.
typedef struct cav_state {
  const cav_model *model; ///< that it was made for
  cav_options options;    ///< starts as the model's; may be changed before an evaluation
  double time;            ///< s, the caller's: what a clock reads

  // position: filled from q
  cav_pose *link;        ///< [nlink] world poses
  double *com;           ///< [nlink*3] centres of mass, world
  double *inertia;       ///< [nlink*6] about the centre of mass, world axes: xx yy zz xy xz yz
  double *reference;     ///< [nlink*3] point at which the link's spatial vectors are taken (its tree's root position)
  double *axis;          ///< [nv*6] motion subspace of each dof: what a unit velocity does
  double *tendon_length; ///< [ntendon]
  double *tendon_arm;    ///< [ntendon_dof] gradient of the length along each dof of model->tendon_dof
  int ncontact, nrow, nequality; ///< what is active
  cav_contact *contact;          ///< [ncontact]; geometry only depends on q, velocities and impulses on all
  cav_row *row;                  ///< [nrow]
  cav_equality_rows *equality;   ///< [nequality] one for each equality constraint, in their order

  // velocity: filled from q and v (euler) or the mean of v and v_next (midpoint, momentum)
  double *velocity;      ///< [nlink*6] spatial velocity of each link at the velocity the bias is taken
  double *velocity_next; ///< [nlink*6] spatial velocity of each link at v_next

  // inverse
  double *force; ///< [nlink*6] wrench of each subtree
  double *u;     ///< [nv] last result of cav_inverse

  struct cav_workspace *work; ///< private
} cav_state;

/// A state for one thread; NULL if memory runs out.
CAV_API cav_state *cav_state_new(const cav_model *model);

/// Frees a state; NULL is fine.
CAV_API void cav_state_free(cav_state *state);

/// Which part of the last evaluation is still valid: what cav_inverse_from may reuse.
typedef enum cav_stage {
  CAV_STAGE_NONE,     ///< nothing: all is new
  CAV_STAGE_POSITION, ///< q is unchanged
  CAV_STAGE_VELOCITY  ///< q and v are unchanged
} cav_stage;

/// Poses, motion subspaces, tendon lengths, contacts and limits at q [nq]. Fails with CAV_NOT_FINITE or CAV_NO_MEMORY.
CAV_API cav_status cav_position(const cav_model *model, cav_state *state, const double *q);

/// Generalised force that takes v to v_next in one step: u = RNE(q, v, a) + D a - p - (J' f)/h, a = (v_next - v)/h.
/// Under the order momentum the change of momentum of whole trees stands for RNE in the rows of their root links. q
/// [nq], v, v_next [nv] -> u [nv], N or N m. D = armature (+ h B for euler). Forms no matrix. Fails with
/// CAV_NOT_FINITE, u untouched. Todorov 2014, eqs. (2), (19)-(22). Contacts of meshes that bear nothing at v and v_next
/// may be missing from the state: cav_position lists all.
CAV_API cav_status cav_inverse(const cav_model *model, cav_state *state, const double *q, const double *v,
                               const double *v_next, double *u);

/// The same, reusing from the state's last evaluation what stage says is unchanged (MuJoCo's mj_inverseSkip).
CAV_API cav_status cav_inverse_from(const cav_model *model, cav_state *state, cav_stage unchanged, const double *q,
                                    const double *v, const double *v_next, double *u);

/// One step forward: v_next from u [nv], by Newton on the convex potential (9) in v_next, exact or smoothed law.
/// Inverse of cav_inverse to 1e-9, or to what a rounding of v_next is worth in force where constraints are stiff;
/// v_next is right to 1e-10 at any softness (dynamics/METHOD.md, 11). Starts from v.
/// CAV_NOT_CONVERGED leaves the best iterate. The position afterwards is cav_integrate(q, v_next, timestep).
CAV_API cav_status cav_forward(const cav_model *model, cav_state *state, const double *q, const double *v,
                               const double *u, double *v_next);

/// What a forward solve did.
typedef struct cav_forward_report {
  int iterations; ///< of Newton's method, or sweeps
  /// 1: past a fold, where steps that are not convex come in pairs; with CAV_NOT_CONVERGED: there is no step, the curve of
  /// those of shorter ones turns before it (Newton only).
  int folded;
  double residual; ///< largest |inverse(q, v, v_next) - u| relative to the largest |u| involved
  double gap;      ///< duality gap of (9), v* lowered where Coulomb's law does, J (GPGS only)
  double mismatch; ///< |f_forward - f_inverse(v_next)| over all impulses, N s (GPGS only)
} cav_forward_report;

/// Forward step by generalised projected Gauss-Seidel on (9), exact law only. At most iterations sweeps, fewer when the
/// largest change of an impulse, relative, falls below tolerance. report may be NULL. CAV_NOT_SUPPORTED for the
/// smoothed law, for CAV_NEXT_GAP_EXACT and for implicit springs of tendons. Paper, section IV.
CAV_API cav_status cav_forward_gpgs(const cav_model *model, cav_state *state, const double *q, const double *v,
                                    const double *u, int iterations, double tolerance, double *v_next,
                                    cav_forward_report *report);

/// The same with equality constraints hard: R_E = 0, the limit that the soft ones approach as R_E does. Forward only,
/// as it has no inverse: many u give one v_next. Rows may repeat or contradict each other; what cannot hold together
/// holds in the least squares of the soft rows. residual of the report is the force missing from the balance, relative;
/// the impulses that hold the constraints are left in state->equality constraint. CAV_NOT_SUPPORTED as above. Paper,
/// section II C.
CAV_API cav_status cav_forward_hard(const cav_model *model, cav_state *state, const double *q, const double *v,
                                    const double *u, int iterations, double tolerance, double *v_next,
                                    cav_forward_report *report);

/// cav_forward with tolerance (relative, on u), iteration limit and a report.
CAV_API cav_status cav_forward_newton(const cav_model *model, cav_state *state, const double *q, const double *v,
                                      const double *u, int iterations, double tolerance, double *v_next,
                                      cav_forward_report *report);

/// cav_forward_newton from a guess of v_next [nv], such as v and the last step's change of it, in the place of v; where Newton
/// does not come from it to a solution, from v after all. guess NULL, or a step of the mean velocity or with stiff rows: from
/// v. Where Coulomb's law has more than one solution, guesses may lead to others. v_next may be guess.
CAV_API cav_status cav_forward_newton_from(const cav_model *model, cav_state *state, const double *q, const double *v,
                                           const double *u, const double *guess, int iterations, double tolerance,
                                           double *v_next, cav_forward_report *report);

/// How derivatives are computed.
typedef enum cav_derivative {
  CAV_DERIVATIVE_FORWARD, ///< staged one-sided differences
  CAV_DERIVATIVE_CENTRED, ///< staged centred differences
  CAV_DERIVATIVE_ANALYTIC ///< closed form
} cav_derivative;

/// Derivatives of cav_inverse, nv x nv, row-major (du[i*nv+j] = du_i/dx_j); NULL = not needed. Positions are
/// differentiated in the tangent: q (+) e_j. Staged one-sided differences with the default step;
/// cav_inverse_jacobian_by chooses.
CAV_API cav_status cav_inverse_jacobian(const cav_model *model, cav_state *state, const double *q, const double *v,
                                        const double *v_next, double *du_dq, double *du_dv, double *du_dv_next);

/// The same by any method. CAV_DERIVATIVE_ANALYTIC fails as cav_derivatives does; nothing takes its place.
CAV_API cav_status cav_inverse_jacobian_by(const cav_model *model, cav_state *state, cav_derivative method,
                                           const double *q, const double *v, const double *v_next, double *du_dq,
                                           double *du_dv, double *du_dv_next);

/// What part of a model has no analytic derivatives, in a few words; NULL if every part has.
CAV_API const char *cav_derivatives_missing(const cav_model *model);

/// Analytic derivatives of u at the state's last cav_inverse, as cav_inverse_jacobian gives them; NULL = not needed.
/// CAV_BAD_INPUT if the state holds no evaluation under its present options; CAV_NOT_SUPPORTED if
/// cav_derivatives_missing names something or under the options CAV_REGULARISER_EXACT and coupled. Outputs are
/// undefined after a failure. At kinks one element of the generalised derivative: of the exact law, and where contact
/// points of a pair come and go within 1e-5 of the posture (the rate of their gap is exact).
CAV_API cav_status cav_derivatives(const cav_model *model, cav_state *state, double *du_dq, double *du_dv,
                                   double *du_dv_next);

/// Derivatives of one contact, rows by nv, row-major; NULL = not needed.
typedef struct cav_contact_derivative {
  double *dist_dq;                                   ///< [nv]
  double *pos_dq;                                    ///< [3*nv] of the position
  double *velocity_dq;                               ///< [dim*nv] of velocity_next
  double *velocity_dv_next;                          ///< [dim*nv] of velocity_next
  double *impulse_dq, *impulse_dv, *impulse_dv_next; ///< [dim*nv]
  int normal_only;                                   ///< 1: of the impulse its first row alone, [nv]
} cav_contact_derivative;

/// Derivatives of contact number contact of the state, after cav_derivatives and before the next evaluation
/// (CAV_BAD_INPUT otherwise). Writes where out points.
CAV_API cav_status cav_contact_derivatives(const cav_model *model, cav_state *state, int contact,
                                           cav_contact_derivative *out);

/// Derivatives of cav_sensor_read at the same point, [sensor->dim*nv] each; NULL = not needed. Readings do not depend
/// on v. CAV_BAD_INPUT as above, CAV_NOT_SUPPORTED for a type of sensor without derivative (touch: cav_touch_derivatives).
CAV_API cav_status cav_sensor_derivatives(const cav_model *model, cav_state *state, const cav_sensor *sensor,
                                          double *d_dq, double *d_dv_next);

/// Whether a geom is what a touch sensor looks at: its geom, one of its body or fixed to that, or of the body of its site.
CAV_API int cav_touch_sees(const cav_model *model, const cav_sensor *sensor, int geom);

/// Derivatives of the reading of a touch sensor at the same point, [nv] each; NULL = not needed: of the contacts that it feels,
/// which are none while nothing pushes. CAV_BAD_INPUT as above, CAV_NOT_SUPPORTED for other sensors and readings that are cut.
CAV_API cav_status cav_touch_derivatives(const cav_model *model, cav_state *state, const cav_sensor *sensor,
                                         double *d_dq, double *d_dv, double *d_dv_next);

/// A function of (q, v, v_next) read off a state after cav_inverse has filled it: writes n values.
/// It may call what uses scratch of the state, such as cav_sensor_read, and changes nothing else.
typedef void (*cav_readout)(const cav_model *model, cav_state *state, void *context, double *value);

/// The point of the state's last cav_inverse: q [nq], its quaternions brought to unit length, v and v_next [nv]. Theirs is
/// the state's memory, until its next evaluation. NULL = not needed.
CAV_API void cav_state_point(const cav_state *state, const double **q, const double **v, const double **v_next);

/// Staged finite differences of any readout of n values. step 0: chosen by coordinate scale. method is one of the two
/// differences (CAV_BAD_INPUT otherwise). value [n] at the point; d_dq, d_dv, d_dv_next [n*nv] row-major, NULL = not
/// needed. dynamics/METHOD.md, 7. A pass over v or v_next repeats no position work. The state is left at the point
/// itself.
CAV_API cav_status cav_readout_differentiate(const cav_model *model, cav_state *state, cav_derivative method,
                                             double step, const double *q, const double *v, const double *v_next,
                                             cav_readout readout, void *context, int n, double *value, double *d_dq,
                                             double *d_dv, double *d_dv_next);

/// Many points at once, one a row: q [n*nq], v, v_next, u [n*nv]. Threads (>= 1, the caller's among them) share them out;
/// a row depends on its own point alone, so its bits are those of the single call at any number of threads. options: of the
/// evaluations, NULL: the model's. status [n], of each row, may be NULL; rows that fail are left as the single call leaves
/// them, and all others are done. Returns the status of the first row that failed; CAV_BAD_INPUT for n < 0, threads < 1;
/// CAV_NO_MEMORY. Each call makes its states anew.
CAV_API cav_status cav_inverse_batch(const cav_model *model, const cav_options *options, int threads, int n,
                                     const double *q, const double *v, const double *v_next, double *u,
                                     cav_status *status);

/// cav_forward of every row: u [n*nv] -> v_next [n*nv].
CAV_API cav_status cav_forward_batch(const cav_model *model, const cav_options *options, int threads, int n,
                                     const double *q, const double *v, const double *u, double *v_next,
                                     cav_status *status);

/// cav_inverse_jacobian_by of every row: du_dq, du_dv, du_dv_next [n*nv*nv], NULL = not needed.
CAV_API cav_status cav_inverse_jacobian_batch(const cav_model *model, const cav_options *options, cav_derivative method,
                                              int threads, int n, const double *q, const double *v,
                                              const double *v_next, double *du_dq, double *du_dv, double *du_dv_next,
                                              cav_status *status);

/// Inertia matrix M(q) with D, dense [nv*nv] row-major. q [nq].
CAV_API cav_status cav_inertia(const cav_model *model, cav_state *state, const double *q, double *M);

/// Centre of mass of all that moves [3], its velocity [3] and the angular momentum about it [3], world, for the state's
/// last position and the velocity v [nv]. Any output may be NULL.
CAV_API void cav_momentum(const cav_model *model, cav_state *state, const double *v, double *com, double *com_velocity,
                          double *angular_momentum);

/// Reading of a sensor at the state's last evaluation; out [sensor->dim]. Positions are there after cav_position;
/// velocities (at v_next), accelerations and forces after cav_inverse or cav_forward, which leave them at (q, v,
/// v_next). Uses scratch of the state, as all that takes a state that is not const.
CAV_API void cav_sensor_read(const cav_model *model, cav_state *state, const cav_sensor *sensor, double *out);

/// Link that carries an object; the world's, 0, for kinds without a frame.
CAV_API int cav_object_link(const cav_model *model, cav_object_type type, int object);

/// World pose of a named kind of object at the state's last position.
CAV_API void cav_object_pose(const cav_model *model, const cav_state *state, cav_object_type type, int object,
                             cav_pose *pose);

/// Force of each dof that actuators can give at the state's last position, for u [nv]: P u with P the orthogonal
/// projector onto the range of the transmission. residual [nv] = u - P u, effort [nu] least-norm, limits not applied (a
/// muscle only pulls). Any output may be NULL. Where all moments are constant, no position is needed.
CAV_API void cav_actuation(const cav_model *model, cav_state *state, const double *u, double *residual, double *effort);

/// Inputs that give efforts [nu] at the state's last position and the velocity v [nv]: controls, or activations of
/// actuators that have one (what control brings them about is the caller's). input [nu] is the nearest within the
/// limits; returns the number of actuators that cannot give their effort.
CAV_API int cav_actuation_inputs(const cav_model *model, cav_state *state, const double *v, const double *effort,
                                 double *input);

/// Length of an actuator's transmission, m or rad times gear, at the state's last position, and its moments [nv] (NULL:
/// not needed): u per unit of force, rate of length per unit of v. Uses scratch of the state.
CAV_API double cav_actuator_length(const cav_model *model, cav_state *state, int actuator, double *moment);

/// Force of an actuator at a length, velocity and input (control or activation), limits applied. N or N m, before gear.
CAV_API double cav_actuator_force(const cav_model *model, int actuator, double length, double velocity, double input);

/// Input that gives a force; returns 1, or 0 where the limits (or a muscle that is too short) do not allow it: input is
/// then the nearest.
CAV_API int cav_actuator_input(const cav_model *model, int actuator, double length, double velocity, double force,
                               double *input);

/// Range of effort that an actuator's limits leave whatever its length and velocity are; infinite where they do not
/// bound it. The limits of a servo's control bound no effort of their own.
CAV_API void cav_actuator_effort_range(const cav_model *model, int actuator, double range[2]);

/// The same law at another step: a discrete stabilisation keeps the fraction of a gap that it closes a second, and so
/// its stiffness; deadbeat (time constant 0) where that is more than the whole gap in a step.
CAV_API cav_options cav_options_at_step(const cav_options *options, double timestep);

/// Softness of a row that acts as ODE's with that CFM (m/(N s), or rad/(N m s)) and ERP at that time step: J v_next =
/// -(ERP/h) x - CFM F, exactly. weight is the diagonal of A that the row's R is scaled with (cav_pair.weight[0],
/// cav_dof.inverse_weight, cav_tendon.inverse_weight, cav_equality.weight). CAV_BAD_INPUT if CFM is not between 1e-4 h
/// and 1e4 h times the weight, where no impedance is used: softness is then untouched. Methods in softness.c.
CAV_API cav_status cav_softness_from_ode(double cfm, double erp, double timestep, double weight,
                                         cav_softness *softness);

/// CFM and ERP of the spring and damper that a row amounts to under the state's options: alike where the step is short
/// and inertia matters little, as a row also has a mass 1/R. CAV_BAD_INPUT if it has neither.
CAV_API cav_status cav_softness_to_ode(const cav_state *state, const cav_softness *softness, double weight, double *cfm,
                                       double *erp);

#ifdef __cplusplus
}
#endif
#endif
