/// The smooth part: poses, velocities, inertia, forces without contacts. Private to dynamics/.
#ifndef CAVORT_SMOOTH_H
#define CAVORT_SMOOTH_H

#include "workspace.h"

/// Links at one configuration; arrays as in cav_state.
typedef struct cav_posture {
  double *q; ///< [nq], its quaternions are made unit
  cav_pose *link;
  double *com, *inertia, *reference, *axis;
  int referred; ///< 1: reference is given and stays
} cav_posture;

/// Poses, centres of mass, world inertias and motion subspaces at a posture. kinematics.c.
void cav_posture_place(const cav_model *model, struct cav_workspace *w, const cav_posture *at);

/// Mass, first moment and inertia of every subtree about its reference, all [nlink*10], from com, inertia and reference
/// of a posture. inertia.c.
void cav_composites_at(const cav_model *model, const cav_posture *at, double *all);

/// By each dof of q, and of v, the twist that it gives what it moves at q (+) distance v; axis [nv*6] are those there,
/// by_q and by_v [nv*6]. configuration.c.
void cav_displaced_twists(const cav_model *model, double distance, const double *v, const double *axis, double *by_q,
                          double *by_v);

/// Poses, centres of mass, world inertias, motion subspaces from q. kinematics.c.
void cav_kinematics(const cav_model *model, cav_state *state, const double *q);

/// Spatial velocities of all links at v [nv] into velocity [nlink*6]; entry 0 is read: the world's, zero. rne.c.
void cav_link_velocities(const cav_model *model, const cav_state *state, const double *v, double *velocity);

/// Spatial accelerations of all links that v alone makes, J'v, into bias [nlink*6], from their velocities; the world's
/// are zero. rne.c.
void cav_link_biases(const cav_model *model, const cav_state *state, const double *v, const double *velocity,
                     double *bias);

/// Down the tree: velocities at v and v_next, accelerations at (v, a), wrench of each link's own inertia into
/// state->force. Up the tree: state->force becomes that of subtrees, u [nv] its component along each dof. rne.c.
void cav_newton_euler(const cav_model *model, cav_state *state, const double *v, const double *v_next, const double *a);
void cav_force_project(const cav_model *model, cav_state *state, double *u);

/// Those wrenches again, from the state's last evaluation, force [nlink*6]. rne.c.
void cav_inertial_forces(const cav_model *model, const cav_state *state, double *force);

/// Forces on links that only (q, v) make, taken off state->force after cav_newton_euler: gravity compensation, drag and
/// lift of a medium at state->velocity. passive.c, fluid.c.
/// How far a tendon's spring is from the lengths between which it is slack. passive.c.
static inline double cav_tendon_stretch(const cav_tendon *tendon, double length) {
  const double *rest = tendon->springlength;
  return length < rest[0] ? length - rest[0] : length > rest[1] ? length - rest[1] : 0;
}

void cav_add_buoyancy(const cav_model *model, cav_state *state);

/// Force on a body by its gravity compensation, against the inverse, and where it acts, world. passive.c.
void cav_buoyancy(const cav_model *model, const cav_state *state, int body, double point[3], double force[3]);
void cav_add_fluid_forces(const cav_model *model, cav_state *state);

/// u += armature a + damping v of joints; then less their springs and what actuators give of gravity compensation; tendons'
/// springs and dampers likewise. passive.c.
void cav_add_resistance(const cav_model *model, const cav_state *state, const double *v, const double *a, double *u);
void cav_add_spring_forces(const cav_model *model, const cav_state *state, double *u);
void cav_add_tendon_forces(const cav_model *model, const cav_state *state, const double *v, double *u);

/// Last dof that moves a link, -1 for the world. kinematics.c.
int cav_last_dof(const cav_model *model, int link);

/// World pose of a frame that is fixed in a link. frames.c.
void cav_frame_pose(const cav_state *state, int link, const double pos[3], const double quat[4], cav_pose *pose);

/// Principal frame of a body at its centre of mass, world. frames.c.
void cav_mass_pose(const cav_state *state, const cav_body *body, cav_pose *pose);

/// Writes the constant arms of fixed tendons and lists the spatial ones, once. Lengths and arms at the state's poses.
/// tendon.c.
void cav_tendon_compile(const cav_model *model, cav_state *state);
void cav_tendon_lengths(const cav_model *model, cav_state *state);

/// Rate of length of a tendon at v [nv]; u [nv] += force along a tendon's gradient. tendon.c.
double cav_tendon_velocity(const cav_state *state, int tendon, const double *v);
void cav_tendon_pull(const cav_state *state, int tendon, double force, double *u);

/// q := q (+) step e_dof: one coordinate of the tangent. configuration.c.
void cav_configuration_perturb(const cav_model *model, int dof, double step, double *q);

/// Mass, first moment and inertia of every subtree at its reference, into the workspace [nlink*10]. inertia.c.
void cav_composites(const cav_model *model, cav_state *state);

/// Composite inertia at the state's poses without D, tree-sparse (row i: dof i, its parent, ...). inertia.c.
void cav_composite_inertia(const cav_model *model, cav_state *state, double *M);

/// M as a step sees it, tree-sparse: with D and, where a step takes the mean velocity, half of the damping that acts
/// during the step. inertia.c.
void cav_step_inertia(const cav_model *model, cav_state *state, double *M);

/// D of a dof under the state's options: armature, damping times h where damping is implicit, and what springs of
/// joints add that are. inertia.c.
double cav_added_inertia(const cav_model *model, const cav_state *state, int dof);

/// Factors a tree-sparse matrix, M = L' D L; L may be M. Returns 0 if M is not positive definite. ldl.c.
int cav_ldl_factor(const cav_model *model, const cav_workspace *w, const double *M, double *L);

/// x := M^-1 x with the factors of cav_ldl_factor, x [nv]. ldl.c.
void cav_ldl_solve(const cav_model *model, const cav_workspace *w, const double *L, double *x);

/// Whether a step takes bias and passive forces at the mean of v and v_next, not at v.
static inline int cav_takes_mean(const cav_state *state) { return state->options.order != CAV_ORDER_EULER; }

/// Where springs act between knots: at their stretch plus next times its rate at v_next less now times that at v, s.
typedef struct cav_springs_ahead {
  double next, now;
} cav_springs_ahead;

static inline cav_springs_ahead cav_look_along_springs(const cav_state *state) {
  const double h = state->options.timestep;
  if (state->options.spring == CAV_SPRING_EXPLICIT) return (cav_springs_ahead){0, 0};
  return cav_takes_mean(state) ? (cav_springs_ahead){0.25 * h, 0.25 * h} : (cav_springs_ahead){h, 0};
}

/// Length at which the spring of a tendon acts. passive.c.
double cav_tendon_spring_length(const cav_state *state, int tendon);

/// What a medium acts on, if there is one. fluid.c.
cav_status cav_fluid_compile(const cav_model *model, cav_workspace *w);
size_t cav_fluid_bytes(const cav_workspace *w);

#endif
