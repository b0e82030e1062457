/// Contacts, limits, friction losses and equality constraints at a configuration, and the law that gives their
/// impulses. Private to dynamics/.
#ifndef CAVORT_CONSTRAINT_H
#define CAVORT_CONSTRAINT_H

#include "four_states.h"
#include "geometry.h"
#include "smooth.h"
#include "touch_four.h"

/// World placement of the geoms that are in pairs: what collide.c keeps between its own calls.
struct cav_geom_cache;
enum { CAV_SWEEP_FROM = 1000 }; ///< pairs from which on a sweep prunes them (bench_sweep)
struct cav_geom_cache *cav_geom_cache_new(const cav_model *model, int sweep_from);
void cav_geom_cache_free(struct cav_geom_cache *cache);
size_t cav_geom_cache_bytes(const struct cav_geom_cache *cache);

/// Whether contacts that bear nothing at the velocities of links in the state need not be sought (state->work->narrowed
/// asks for that): there are pairs that are sought so, and a law that tells.
int cav_contacts_narrow(const cav_state *state);

/// Whether a pair of the state's model has a mesh. collide.c.
int cav_contacts_have_meshes(const cav_state *state);

/// Where the state's searches of pairs that keep a hint ended, [npair]; another array of these may take its place, which the
/// state then owns. NULL: it has no such pair. collide.c.
cav_hint **cav_contacts_hints(cav_state *state);

/// Broad and narrow phase over model->pair at the state's poses: fills pair, feature, dim, links, pos, frame, dist,
/// margin, friction of state->contact and ncontact. collide.c. The activation distance of a pair is its margin, or
/// where the smoothed law is active (cav_contact_activation), whichever is larger.
cav_status cav_contacts_find(const cav_model *model, cav_state *state);

/// Whether one of the two is a mesh.
static inline int cav_pair_has_mesh(const cav_model *model, const cav_pair *pair) {
  return model->geom[pair->geom1].type == CAV_GEOM_MESH || model->geom[pair->geom2].type == CAV_GEOM_MESH;
}

/// Whether searches of a pair are noted (cav_collide_again).
static inline int cav_pair_keeps_hint(const cav_model *model, const cav_pair *pair) {
  return cav_types_keep_hint(model->geom[pair->geom1].type, model->geom[pair->geom2].type);
}

/// Whether contacts of a pair are sought only where they may bear something, as their search is expensive: with a mesh, and in
/// one tree with an ellipsoid, a cylinder or a box, as housings of robots near a joint have them by the dozen.
static inline int cav_pair_is_sought(const cav_model *model, const cav_pair *pair) {
  const cav_geom_type first = model->geom[pair->geom1].type, second = model->geom[pair->geom2].type;
  return cav_pair_has_mesh(model, pair) ||
         (!pair->external && first != CAV_GEOM_PLANE && second >= CAV_GEOM_ELLIPSOID && second <= CAV_GEOM_BOX);
}

/// Of four contacts that follow each other, where vectors have four numbers: axes, from a normal and a tangent in their first two
/// places; and impulses from velocities by the exact law of friction cones of three rows that see no gap after the step, 0
/// where one of them is another. contacts_four.c.
void cav_frames_four(cav_contact *contact);
int cav_law_four(cav_contact *contact);

/// Whether pairs of four states are listed together: not where the scene has what only a single state looks for. Then
/// those whose bounds are near in some state, into lanes, from their poses there; and for cav_contacts_find of one of
/// the states among those the places of their geoms. collide.c.
int cav_contacts_listed(const cav_model *model, const cav_state *state);
void cav_contacts_near(const cav_model *model, cav_lanes *lanes, cav_state *state);
void cav_contacts_place_near(const cav_lanes *lanes, cav_state *const state[CAV_LANES]);
cav_status cav_contacts_of_near(const cav_model *model, cav_state *state, const cav_lanes *lanes, int lane);

/// The pairs alone, by the margins that are added to those of pairs between links and with the world; then the
/// places. broad_four.c.
void cav_lanes_near(const cav_model *model, cav_lanes *lanes, cav_state *state, const double activation[2]);
void cav_lanes_place_near(const cav_lanes *lanes, cav_state *const state[CAV_LANES]);

/// Points of pair k of those, in the order and with the bits of cav_contacts_find of each state; touch has room for
/// CAV_LANES times CAV_TOUCH_MAX. And the place of a geom, by its slot in the broad phase, to the states.
/// narrow_four.c.
int cav_lanes_touches(const cav_lanes *lanes, cav_state *const state[CAV_LANES], int k, cav_touch_four *touch);
void cav_lanes_pose(const cav_lanes *lanes, cav_state *const state[CAV_LANES], int slot);

/// Distance from which a pair's force is not negligible under the state's options.
double cav_contact_activation(const cav_state *state, const cav_pair *pair);

/// R, h B and h K of a row violated by x >= 0, by the state's options. limits.c.
typedef struct cav_law {
  double regulariser, damping, stiffness;
} cav_law;
cav_law cav_law_at(const cav_state *state, const cav_softness *softness, double x, double weight);

/// rho = R_j mu_j^2, the same for all friction rows of a contact; 0 if none has friction.
static inline double cav_friction_regulariser(int dim, const double *R, const double *friction) {
  for (int j = 1; j < dim; j++)
    if (friction[j - 1] > 0.0) return R[j] * friction[j - 1] * friction[j - 1];
  return 0.0;
}

/// What rows of friction add to h B: 1 in the step after which nothing moves, where they feel the velocity before it as they
/// do that after any other step: what friction holds creeps, and would be let go by a step that ends that.
static inline double cav_friction_stops(const cav_state *state) { return state->options.stops ? 1 : 0; }

/// Fills state->equality constraint at the state's positions: errors, what their rates depend on, laws. equality.c.
void cav_equality_evaluate(const cav_model *model, cav_state *state);

/// Velocity of an equality constraint's rows, out [dim], at v [nv] with the links' spatial velocities [nlink*6].
/// equality.c.
void cav_equality_velocity(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, const double *v,
                           const double *velocity, double *out);

/// Whether its rows accelerate at v without any acceleration of dofs: connects and welds.
static inline int cav_equality_turns(const cav_equality *e) {
  return e->type == CAV_EQUALITY_CONNECT || e->type == CAV_EQUALITY_WELD;
}

/// That acceleration of all of them, J'v, from v and the links' velocities [nlink*6]. equality.c.
void cav_equality_biases(const cav_model *model, cav_state *state, const double *v, const double *velocity);

/// Motion of a link's point: its angular velocity w and acceleration, and its own, from spatial ones about the reference.
/// equality.c.
void cav_point_motion(const double V[6], const double A[6], const double reference[3], const double point[3],
                      double velocity[6], double acceleration[6]);

/// v* of dimension k of an equality constraint, coupled rows apart.
static inline double cav_equality_target(const cav_state *state, const cav_equality_rows *eq, int k) {
  return (1 - eq->damping) * eq->velocity[k] - eq->stiffness * eq->error[k] - state->options.timestep * eq->bias[k];
}

/// r = s/2 Im(q2 y q1): what the rotation rows of a weld make of y, for frames of which the second is conjugated.
/// equality.c.
void cav_weld_turn(double s, const double q2[4], const double y[4], const double q1[4], double r[3]);

/// Impulses of all equality constraints, v* taken at velocity_now (NULL: as it was); wrenches, times scale, into
/// state->force. Then, once forces are projected: u [nv] += scale J' f of those between joints or tendons. equality.c.
void cav_equality_impulses(const cav_model *model, cav_state *state, const double *v, const double *velocity_now,
                           const double *v_next, double scale);
void cav_equality_apply(const cav_model *model, const cav_state *state, double scale, double *u);

/// Points, frames, references and weight of an equality constraint of a model under construction, at q0. equality.c.
void cav_equality_settle(const cav_model *model, const cav_state *state, cav_equality *equality);

/// Constants of the discrete stabilisation for the state's options; before the two below. limits.c.
void cav_stabilisation_prepare(cav_state *state);

/// Fills state->row at the state's positions; gives every contact its R, h B, h K and sigma. limits.c.
cav_status cav_limits_find(const cav_model *model, cav_state *state);

/// Limits of joints that are near in some of four states, of which state is one, into lanes, which have their positions
/// (broad_four.c). Then cav_limits_find of one of them among those. limits.c.
void cav_lanes_limits(const cav_model *model, cav_lanes *lanes, const cav_state *state);
cav_status cav_limits_of_near(const cav_model *model, cav_state *state, const cav_lanes *lanes, int lane);
void cav_contacts_soften(cav_state *state);
/// Of one contact that need not be in the state.
void cav_contact_soften(const cav_state *state, cav_contact *contact);

/// Fraction of its stiffness that a contact has, by which its R is divided, and the rate of its logarithm by the
/// distance: self_stiffness between links of one tree. Where the law is smoothed it fades out towards the end of its
/// activation distance, so that what comes faster than the activation distance foresees does not jump, and where the
/// axes of two spheres or capsules meet, so that the force does not jump as the normal changes side; that is deeper
/// than half the sum of their radii. limits.c.
double cav_contact_stiffness_ratio(const cav_state *state, const cav_contact *contact, double *rate);

/// Distance beyond the margin from which a limit or a contact counts: as far as the smoothed law of scale delta is
/// active, and where the discrete law looks ahead, as far as an approach at speed gets within a step before that.
/// limits.c.
double cav_law_activation(const cav_state *state, double delta, double speed);

/// Distance from which a limit is a row: its margin and what the state's options add. limits.c.
double cav_limit_activation(const cav_state *state, double margin);

/// Velocity of a row at v [nv]; u [nv] += J' force of a row. limits.c.
double cav_row_velocity(const cav_state *state, const cav_row *row, const double *v);
void cav_row_push_force(const cav_state *state, const cav_row *row, double force, double *u);

/// Scales of smoothing below contact from which on a smoothed law that ends bears nothing at all. Whether a contact's ends:
/// where it is sought only if it may bear something; others trail off.
#define CAV_LAW_END 12.0
static inline int cav_contact_ends(const cav_state *state, const cav_contact *contact) {
  return cav_pair_is_sought(state->model, &state->model->pair[contact->pair]);
}

/// Impulse of an elliptic contact from g = R^-1 (v* - v_next) [dim]; R [dim], sigma 0: exact law, else smoothed; ends: the
/// smoothed law is zero from CAV_LAW_END sigma on. Writes f [dim]. Eqs. (19)-(22) and METHOD.md, 3. hessian, if not NULL,
/// gets -df/dv_next [dim*dim], symmetric, psd. potential, if not NULL, gets Psi, the convex function of v_next whose
/// gradient is -f. contact_law.c.
void cav_law_cone(int dim, const double *R, const double *friction, double sigma, int ends, const double *g, double *f,
                  double *hessian, double *potential);

/// Impulse of a contact by Coulomb's law, in the same words. hessian is not symmetric. With held, not NULL, the bound
/// of friction is mu times that normal impulse instead of the contact's own: hessian is symmetric, psd, and there is a
/// potential (without held: NULL). coulomb.c.
void cav_law_coulomb(int dim, const double *R, const double *friction, double sigma, int ends, const double *held,
                     const double *g, double *f, double *hessian, double *potential);

/// By the law that the state's options choose; hessian may be NULL. coulomb.c.
void cav_law_contact(const cav_state *state, const cav_contact *contact, const double *g, double *f, double *hessian);

/// A contact after the step, at q (+) h v_next, and what its rows see of it beyond J v_next: the normal one the velocity
/// (gap there - gap)/h, the tangential ones the way of its point over h.
typedef struct cav_next_contact {
  double excess[3]; ///< m/s
  double by_next,
      by_linear;            ///< h times the rate of the first by the gap there, and by the linear one, gap + h n.v_next
  double pos[3], normal[3]; ///< of the gap there, world
  double margin;            ///< within which it was found
  double gradient[6];       ///< of the gap there by twists about pos of the second geom against the first
  double after[3];          ///< where the point of the second link is
  double way[3];            ///< from that of the first link to it, turned back with the first link
  double tangent[2][3];     ///< the tangents, turned on with the first link
  double turn[9];           ///< rotation of the second link as the first sees it
} cav_next_contact;

/// Links and contacts after the step; made by the first evaluation that looks there.
typedef struct cav_next_knot {
  double *q; ///< [nq]
  cav_pose *link;
  double *com, *inertia, *axis;
  double *by_q, *by_v; ///< [nv*6] cav_displaced_twists
  size_t bytes;
  int room;
  cav_next_contact *contact; ///< [room]
  cav_hint *hint;            ///< [npair] where its searches ended; NULL: no pair keeps one
} cav_next_knot;

/// Whether rows of contacts see what is there after the step, or J v_next alone.
static inline int cav_looks_ahead(const cav_options *options) {
  return options->next_gap == CAV_NEXT_GAP_EXACT || options->next_slip == CAV_NEXT_SLIP_EXACT;
}

/// Room for the state's contacts after the step. CAV_NO_MEMORY. next_knot.c.
cav_status cav_next_knot_new(const cav_model *model, cav_state *state);
void cav_next_knot_free(cav_next_knot *next);
size_t cav_next_knot_bytes(const cav_next_knot *next);

/// Whether contacts of a pair see the gap after the step, where the options ask for it. next_gap.c.
int cav_sees_next_gap(const cav_model *model, const cav_pair *pair);

/// Links at q (+) h v_next of the workspace's q. next_knot.c.
void cav_next_links_place(const cav_model *model, cav_state *state, const double *v_next);

/// All contacts after the step, from J v_next in their velocity_next, whose tangential part becomes what is seen, and
/// v_next of the workspace. next_knot.c.
void cav_next_contacts_find(const cav_model *model, cav_state *state);

/// Then what their derivatives are made of. next_knot.c.
void cav_next_contacts_differentiate(const cav_model *model, cav_state *state);

/// Rates of a contact after the step by a dof that moves its second link, negative by one that moves its first: of its gap
/// [0] and of h times what its tangential rows see [1, 2], links held at q; by q [0] and by v_next [1]. After
/// cav_next_contacts_differentiate. next_knot.c.
void cav_next_contact_rates(const cav_model *model, const cav_state *state, int contact, int dof, double rate[3][2]);

/// Gaps of all contacts there, links placed; then their gradients. next_gap.c.
void cav_next_gaps_find(const cav_model *model, cav_state *state);
void cav_next_gaps_differentiate(const cav_model *model, cav_state *state);

/// The way of one contact's point, links placed. next_slip.c.
void cav_next_slip_find(const cav_state *state, const cav_contact *contact, cav_next_contact *out);

/// What a contact of the state's is after the step; NULL: its rows do not look there.
static inline const cav_next_contact *cav_contact_next(const cav_state *state, const cav_contact *contact) {
  return cav_looks_ahead(&state->options) ? state->work->next->contact + (contact - state->contact) : NULL;
}

/// Whether a row of a contact looks there.
static inline int cav_row_looks_ahead(const cav_options *options, const cav_contact *contact, int row) {
  if (row == 0) return options->next_gap == CAV_NEXT_GAP_EXACT;
  return row < 3 && row < contact->dim && options->next_slip == CAV_NEXT_SLIP_EXACT;
}

/// What the normal row of a contact of the state's sees beyond n.v_next, which its velocity_next keeps.
static inline double cav_contact_excess(const cav_state *state, const cav_contact *contact) {
  const cav_next_contact *next = cav_contact_next(state, contact);
  return next ? next->excess[0] : 0;
}

/// The same for one-sided rows (limits) and two-sided ones (friction loss, |f| <= bound).
void cav_law_unilateral(double R, double sigma, int ends, double g, double *f, double *hessian, double *potential);
void cav_law_bilateral(double R, double sigma, double bound, double g, double *f, double *hessian, double *potential);

/// Rates by the distance to the constraint (dist - margin) of ln R and of ln hK of a row or contact's normal whose
/// regulariser is R. limits.c.
void cav_law_rates(const cav_state *state, const cav_softness *softness, double gap, double R, double *regulariser,
                   double *stiffness);

#endif
