/// Contacts, limits, friction losses and equality constraints at a configuration, and the law that gives their
/// impulses. Private to dynamics/.
#ifndef CAVORT_CONSTRAINT_H
#define CAVORT_CONSTRAINT_H

#include "geometry.h"
#include "smooth.h"

/// World placement of the geoms that are in pairs: what collide.c keeps between its own calls.
struct cav_geom_cache;
enum { CAV_SWEEP_FROM = 1000 }; ///< pairs from which on a sweep prunes them (bench_sweep)
struct cav_geom_cache *cav_geom_cache_new(const cav_model *model, int sweep_from);
void cav_geom_cache_free(struct cav_geom_cache *cache);
size_t cav_geom_cache_bytes(const struct cav_geom_cache *cache);

/// Broad and narrow phase over model->pair at the state's poses: fills pair, feature, dim, links, pos, frame, dist,
/// margin, friction of state->contact and ncontact. collide.c. The activation distance of a pair is its margin, or
/// where the smoothed law is active (cav_contact_activation), whichever is larger.
cav_status cav_contacts_find(const cav_model *model, cav_state *state);

/// Distance from which a pair's force is not negligible under the state's options.
double cav_contact_activation(const cav_state *state, const cav_pair *pair);

/// R, h B and h K of a row violated by x >= 0, by the state's options. limits.c.
typedef struct cav_law {
  double regulariser, damping, stiffness;
} cav_law;
cav_law cav_law_at(const cav_state *state, const cav_softness *softness, double x, double weight);

/// Fills state->equality constraint at the state's positions: errors, what their rates depend on, laws. equality.c.
void cav_equality_evaluate(const cav_model *model, cav_state *state);

/// Velocity of an equality constraint's rows, out [dim], at v [nv] with the links' spatial velocities [nlink*6].
/// equality.c.
void cav_equality_velocity(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, const double *v,
                           const double *velocity, double *out);

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
void cav_contacts_soften(cav_state *state);

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

/// Impulse of an elliptic contact from g = R^-1 (v* - v_next) [dim]; R [dim], sigma 0: exact law, else smoothed.
/// Writes f [dim]. Eqs. (19)-(22) and METHOD.md, 3. hessian, if not NULL, gets -df/dv_next [dim*dim], symmetric, psd.
/// potential, if not NULL, gets Psi, the convex function of v_next whose gradient is -f. contact_law.c.
void cav_law_cone(int dim, const double *R, const double *friction, double sigma, const double *g, double *f,
                  double *hessian, double *potential);

/// Impulse of a contact by Coulomb's law, in the same words. hessian is not symmetric. With held, not NULL, the bound
/// of friction is mu times that normal impulse instead of the contact's own: hessian is symmetric, psd, and there is a
/// potential (without held: NULL). coulomb.c.
void cav_law_coulomb(int dim, const double *R, const double *friction, double sigma, const double *held,
                     const double *g, double *f, double *hessian, double *potential);

/// By the law that the state's options choose; hessian may be NULL. coulomb.c.
void cav_law_contact(const cav_state *state, const cav_contact *contact, const double *g, double *f, double *hessian);

/// The same for one-sided rows (limits) and two-sided ones (friction loss, |f| <= bound).
void cav_law_unilateral(double R, double sigma, double g, double *f, double *hessian, double *potential);
void cav_law_bilateral(double R, double sigma, double bound, double g, double *f, double *hessian, double *potential);

/// Rates by the distance to the constraint (dist - margin) of ln R and of ln hK of a row or contact's normal.
/// limits.c.
void cav_law_rates(const cav_state *state, const cav_softness *softness, double gap, double *regulariser,
                   double *stiffness);

#endif
