/// The stages of one evaluation and what they share. Private to dynamics/. Order of the stages: README.md.
#ifndef CAVORT_STAGE_H
#define CAVORT_STAGE_H

#include "cavort/dynamics.h"

/// Contact point found by the narrow phase: world position midway between the surfaces, unit normal from the first to the
/// second geom, signed gap. feature tells the points of one manifold apart and is stable between nearby poses.
typedef struct cav_touch {
  double pos[3];
  double normal[3];
  double tangent[3]; ///< a direction to align the second contact axis with; zero: any
  double dist;
  int feature;
} cav_touch;

enum { CAV_TOUCH_MAX = 8 }; ///< most points one pair can give

/// A geom in the world.
typedef struct cav_shape {
  cav_geom_type type;
  const double *size;
  const cav_mesh *mesh;     ///< of a mesh
  const cav_hfield *hfield; ///< of a height field
  double pos[3];
  double rotation[9]; ///< row-major, world = rotation * local + pos
} cav_shape;

/// Kind, size and asset of a geom; its place is left to the caller.
static inline cav_shape cav_shape_of(const cav_model *model, const cav_geom *geom) {
  cav_shape shape = {.type = geom->type, .size = geom->size};
  if (geom->type == CAV_GEOM_MESH) shape.mesh = &model->mesh[geom->asset];
  if (geom->type == CAV_GEOM_HFIELD) shape.hfield = &model->hfield[geom->asset];
  return shape;
}

/// All contact points of two shapes with dist < margin; a->type <= b->type, in the order of their features. Returns their
/// number, at most CAV_TOUCH_MAX.
/// pairs.c: table over types; exact routines where they exist, convex.c (libccd) for the rest.
int cav_collide_shapes(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// Distance along a ray, unit direction, to the surface of a shape; -1 if it misses. A ray that starts inside meets the
/// surface where it leaves; a plane is met from above only, within its size where that is not 0. ray.c.
double cav_ray(const cav_shape *shape, const double point[3], const double direction[3]);

/// 1 if shapes of these two types can be collided by this build (some need libccd), else 0. convex.c.
int cav_collide_supported(cav_geom_type a, cav_geom_type b);

/// Pairs without a routine of their own: penetration or distance through libccd. One point, and up to 4 more
/// where a cylinder or a box stands on a face. convex.c.
int cav_collide_convex(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch);

/// Broad and narrow phase over model->pair at the state's poses: fills pair, feature, dim, links, pos, frame, dist, margin,
/// friction of state->contact and ncontact. collide.c. The activation distance of a pair is its margin, or where the smoothed law is
/// active (cav_contact_activation), whichever is larger.
cav_status cav_contacts_find(const cav_model *model, cav_state *state);

/// Distance from which a pair's force is not negligible under the state's options.
double cav_contact_activation(const cav_state *state, const cav_pair *pair);

/// Room for one more contact or row at the end of the state's arrays; NULL if memory runs out. state.c.
cav_contact *cav_contact_push(cav_state *state);
cav_row *cav_row_push(cav_state *state);

/// Poses, centres of mass, world inertias, motion subspaces from q. kinematics.c.
void cav_kinematics(const cav_model *model, cav_state *state, const double *q);

/// Spatial velocities of all links at v [nv] into velocity [nlink*6]; entry 0 is read: the world's, zero. rne.c.
void cav_link_velocities(const cav_model *model, const cav_state *state, const double *v, double *velocity);

/// Down the tree: velocities at v and v_next, accelerations at (v, a), wrench of each link's own inertia into
/// state->force. Up the tree: state->force becomes that of subtrees, u [nv] its share along each dof. rne.c.
void cav_newton_euler(const cav_model *model, cav_state *state, const double *v, const double *v_next, const double *a);
void cav_force_project(const cav_model *model, cav_state *state, double *u);

/// Those wrenches again, from the state's last evaluation, force [nlink*6]. rne.c.
void cav_inertial_forces(const cav_model *model, const cav_state *state, double *force);

/// Forces on links that only (q, v) make, taken off state->force after cav_newton_euler: gravity compensation, drag and
/// lift of a medium at state->velocity. passive.c, fluid.c.
void cav_add_buoyancy(const cav_model *model, cav_state *state);
void cav_add_fluid_forces(const cav_model *model, cav_state *state);

/// u += armature a + damping v - springs of joints; tendons' springs and dampers likewise. passive.c.
void cav_add_joint_forces(const cav_model *model, const cav_state *state, const double *v, const double *a, double *u);
void cav_add_tendon_forces(const cav_model *model, const cav_state *state, const double *v, double *u);

/// Last dof that moves a link, -1 for the world. jacobian.c.
int cav_last_dof(const cav_model *model, int link);

/// Writes the constant arms of fixed tendons and lists the spatial ones, once. Lengths and arms at the state's poses.
/// tendon.c.
void cav_tendon_compile(const cav_model *model, cav_state *state);
void cav_tendon_lengths(const cav_model *model, cav_state *state);

/// Rate of length of a tendon at v [nv]; u [nv] += force along a tendon's gradient. tendon.c.
double cav_tendon_velocity(const cav_state *state, int tendon, const double *v);
void cav_tendon_pull(const cav_state *state, int tendon, double force, double *u);

/// R, h B and h K of a row violated by x >= 0, by the state's options. limits.c.
typedef struct cav_law {
  double regulariser, damping, stiffness;
} cav_law;
cav_law cav_law_at(const cav_state *state, const cav_softness *softness, double x, double weight);

/// R by the true diagonal of A where the options ask, and what cav_coupled_targets needs. After all else of the position stage.
/// Fails with CAV_NO_MEMORY, and with CAV_BAD_INPUT if the inertia is not positive definite. coupled.c.
cav_status cav_coupled_prepare(const cav_model *model, cav_state *state);

/// v* of all rows together from their velocities in the state, into its workspace. coupled.c.
void cav_coupled_targets(cav_state *state);

/// Fills state->equality constraint at the state's positions: errors, what their rates depend on, laws. equality.c.
void cav_equality_evaluate(const cav_model *model, cav_state *state);

/// Velocity of an equality constraint's rows, out [dim], at v [nv] with the links' spatial velocities [nlink*6]. equality.c.
void cav_equality_velocity(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, const double *v,
                           const double *velocity, double *out);

/// Impulses of all equality constraints, v* taken at velocity_now (NULL: as it was); wrenches, times scale, into state->force. Then, once
/// forces are projected: u [nv] += scale J' f of those between joints or tendons. equality.c.
void cav_equality_impulses(const cav_model *model, cav_state *state, const double *v, const double *velocity_now,
                           const double *v_next, double scale);
void cav_equality_apply(const cav_model *model, const cav_state *state, double scale, double *u);

/// Points, frames, references and weight of an equality constraint of a model under construction, at q0. equality.c.
void cav_equality_settle(const cav_model *model, const cav_state *state, cav_equality *equality);

/// Constants of the discrete stabilisation for the state's options; before the two below. limits.c.
void cav_stabilisation_prepare(cav_state *state);

/// Fills state->row at the state's positions; gives every contact its R, h B, h K and sigma. limits.c.
cav_status cav_limits_find(const cav_model *model, cav_state *state);
void cav_contacts_soften(cav_state *state);

/// Share of its stiffness that a contact has, by which its R is divided, and the rate of its logarithm by the distance:
/// self_stiffness between links of one tree. Where the law is smoothed it fades out towards the end of its activation distance, so that what
/// comes faster than the activation distance foresees does not jump, and where the axes of two spheres or capsules meet, so that the force
/// does not jump as the normal changes side; that is deeper than half the sum of their radii. limits.c.
double cav_contact_stiffness_ratio(const cav_state *state, const cav_contact *contact, double *rate);

/// Distance beyond the margin from which a limit or a contact counts: as far as the smoothed law of scale delta is active,
/// and where the discrete law looks ahead, as far as an approach at speed gets within a step before that.
/// limits.c.
double cav_law_activation(const cav_state *state, double delta, double speed);

/// Distance from which a limit is a row: its margin and what the state's options add. limits.c.
double cav_limit_activation(const cav_state *state, double margin);

/// Velocity of a row at v [nv]; u [nv] += J' force of a row. limits.c.
double cav_row_velocity(const cav_state *state, const cav_row *row, const double *v);
void cav_row_push_force(const cav_state *state, const cav_row *row, double force, double *u);

/// Velocity of a contact in its frame, out [dim], from spatial velocities of links [nlink*6]. inverse.c.
void cav_contact_velocity(const cav_state *state, const cav_contact *contact, const double *velocity, double *out);

/// Whether the state holds a whole evaluation of the inverse under its present options. inverse.c.
int cav_state_evaluated(const cav_state *state);

/// u [nv] of the step without constraints, at the state's positions: u = RNE + D a - p. Fills velocities. Under an order that
/// the state has evaluated before. inverse.c.
void cav_smooth_inverse(const cav_model *model, cav_state *state, const double *v, const double *v_next, double *u);

/// q := q (+) step e_dof: one coordinate of the tangent. configuration.c.
void cav_configuration_perturb(const cav_model *model, int dof, double step, double *q);

/// Mass, first moment and inertia of every subtree at its reference, into the workspace [nlink*10]. inertia.c.
void cav_composites(const cav_model *model, cav_state *state);

/// Composite inertia at the state's poses without D, tree-sparse (row i: dof i, its parent, ...). inertia.c.
void cav_composite_inertia(const cav_model *model, cav_state *state, double *M);

/// M as a step sees it, tree-sparse: with D and, where a step takes the mean velocity, half of the damping that acts during the step. inertia.c.
void cav_step_inertia(const cav_model *model, cav_state *state, double *M);

/// D of a dof under the state's options: armature, and damping times h where damping is implicit. inertia.c.
double cav_added_inertia(const cav_model *model, const cav_state *state, int dof);

/// Principal frame of a body at its centre of mass, world. sensor.c.
void cav_mass_pose(const cav_state *state, const cav_body *body, cav_pose *pose);

/// Whether a body is another one or stands on it, in the tree of the file. wrench.c.
int cav_descends(const cav_model *model, int body, int from);

/// Acceleration of a point of a link at the last evaluation, world axes, relative to free fall. wrench.c.
void cav_point_acceleration(const cav_state *state, int link, const double point[3], double out[3]);

/// Wrench (moment about point, force) by which its parent holds a body with all that stands on it. wrench.c.
void cav_body_wrench(const cav_model *model, const cav_state *state, int body, const double point[3], double F[6]);

/// Sum of the normal forces on the body of a site that lie in its zone or point out through it, N. wrench.c.
double cav_touch_force(const cav_model *model, const cav_state *state, int site);

/// Rate of length of an actuator's transmission at v [nv], at the state's position. transmission.c.
double cav_actuator_velocity(const cav_state *state, int actuator, const double *v);

/// Force of an actuator, before gear, among the least-norm ones that give the state's u. actuation.c.
double cav_actuator_part(const cav_state *state, int actuator);

/// G [n*n] := pseudo-inverse of the symmetric positive semidefinite G by Jacobi rotations; eigenvalues up to rank times
/// the largest count as 0. A, E [n*n] are scratch. symmetric.c.
void cav_pseudo_inverse(int n, double rank, double *G, double *A, double *E);

/// Fills the length ranges of muscles that the file leaves open, of a model under construction. Returns the first actuator
/// whose length has no end within the ranges of the joints, nactuator if memory runs out, -1 if all is well. length_range.c.
int cav_length_range_fill(cav_model *model);

/// Whether a step takes bias and passive forces at the mean of v and v_next, not at v.
static inline int cav_takes_mean(const cav_state *state) { return state->options.order != CAV_ORDER_EULER; }

struct cav_workspace;

/// Factors a tree-sparse matrix, M = L' D L; L may be M. Returns 0 if M is not positive definite. ldl.c.
int cav_ldl_factor(const cav_model *model, const struct cav_workspace *w, const double *M, double *L);

/// x := M^-1 x with the factors of cav_ldl_factor, x [nv]. ldl.c.
void cav_ldl_solve(const cav_model *model, const struct cav_workspace *w, const double *L, double *x);

/// Fills inverse_weight of dofs, bodies, tendons and weight of pairs of a model under construction at q0. reference.c.
cav_status cav_reference_weights(cav_model *model);

/// Impulse of an elliptic contact from g = R^-1 (v* - v_next) [dim]; R [dim], sigma 0: exact law, else smoothed.
/// Writes f [dim]. Eqs. (19)-(22) and dynamics.md, 3. hessian, if not NULL, gets -df/dv_next [dim*dim], symmetric, psd.
/// potential, if not NULL, gets Psi, the convex function of v_next whose gradient is -f. contact_law.c.
void cav_law_cone(int dim, const double *R, const double *friction, double sigma, const double *g, double *f,
                  double *hessian, double *potential);

/// The same for one-sided rows (limits) and two-sided ones (friction loss, |f| <= bound).
void cav_law_unilateral(double R, double sigma, double g, double *f, double *hessian, double *potential);
void cav_law_bilateral(double R, double sigma, double bound, double g, double *f, double *hessian, double *potential);

#endif
