/// The analytic inverse: u from (q, v, v_next), Todorov 2014, eqs. (2), (19)-(22). Kinematics, contacts and limits;
/// link velocities; every impulse in closed form from the velocities of its own two bodies; one pass up the tree that
/// carries the impulses along with the inertial forces. No matrix is formed.
///
/// The order of the step says at which velocity bias and passive forces are taken: v with joint damping at v_next
/// (euler), or the mean of both (midpoint, momentum). For momentum the root link bears what is missing to the change of
/// the momentum of its tree from half a step before to half a step after (half_step.c). Constraints always compare J v
/// with J v_next at q.
///
/// What a stage may reuse depends on the options too: after a change of those that positions depend on, all is new.
#include <stdlib.h>

#include "four_states.h"
#include "half_step.h"
#include "math3.h"
#include "options.h"
#include "step.h"
#include "tree.h"
#include "vectors.h"

static void copy(double *to, const double *from, int n) {
  if (n > 0 && to != from) { memcpy(to, from, (size_t)n * sizeof *to); }
}

// whether a position can be evaluated at q; nothing of the last one holds
static cav_status open_position(const cav_model *model, cav_state *state, const double *q) {
  state->work->valid = CAV_STAGE_NONE;
  state->ncontact = state->nrow = state->nequality = 0;
  if (!cav_options_valid(&state->options)) { return CAV_BAD_INPUT; }
  return all_finite(q, model->nq) ? CAV_OK : CAV_NOT_FINITE;
}

/// Limits, and contacts where their pairs are listed, among what is known to be near: those of one of four states.
typedef struct nearby {
  const cav_lanes *lanes;
  int lane, listed;
} nearby;

static cav_status find_contacts(const cav_model *model, cav_state *state, const double *v, const double *v_next) {
  cav_workspace *w = state->work;
  w->narrowed = v && cav_contacts_narrow(state);
  if (w->narrowed) {
    copy(w->narrow_v, v, model->nv);
    copy(w->narrow_v + model->nv, v_next, model->nv);
    cav_link_velocities(model, state, w->narrow_v, w->velocity_now);
    cav_link_velocities(model, state, w->narrow_v + model->nv, state->velocity_next);
    if (cav_looks_ahead(&state->options)) {
      cav_status status = cav_next_knot_new(model, state);
      if (status) { return status; }
      cav_next_links_place(model, state, v_next);
    }
  }
  return cav_contacts_find(model, state);
}

// all that is not smooth, at the state's poses. v NULL: all contacts; else those that bear something at v and v_next or may do so
// near them. near, if not NULL, is where they are looked for
static cav_status find_constraints(const cav_model *model, cav_state *state, const double *v, const double *v_next,
                                   const nearby *near) {
  cav_stabilisation_prepare(state);
  cav_status status = near ? cav_limits_of_near(model, state, near->lanes, near->lane) : cav_limits_find(model, state);
  if (status) { return status; }
  state->work->narrowed = 0;
  status = near && near->listed ? cav_contacts_of_near(model, state, near->lanes, near->lane)
                                : find_contacts(model, state, v, v_next);
  if (status) { return status; }
  if (model->nequality) { cav_equality_evaluate(model, state); }
  cav_contacts_soften(state);
  if (state->options.regulariser == CAV_REGULARISER_EXACT || state->options.coupled) {
    status = cav_coupled_prepare(model, state);
    if (status) { return status; }
  }
  state->work->valid = CAV_STAGE_POSITION;
  state->work->options = state->options;
  return CAV_OK;
}

static cav_status find_position(const cav_model *model, cav_state *state, const double *q, const double *v,
                                const double *v_next) {
  cav_status status = open_position(model, state, q);
  if (status) { return status; }
  cav_kinematics(model, state, q);
  return find_constraints(model, state, v, v_next, NULL);
}

cav_status cav_position(const cav_model *model, cav_state *state, const double *q) {
  return find_position(model, state, q, NULL, NULL);
}

// whether velocities are so near to those that contacts were sought for that none is missed (SLACK of reach, collide.c)
static int is_within_reach(const cav_workspace *w, const double *v, const double *v_next, int nv) {
  for (int i = 0; i < nv; i++) {
    if (!(fabs(v[i] - w->narrow_v[i]) <= 1e-3) || !(fabs(v_next[i] - w->narrow_v[nv + i]) <= 1e-3)) return 0;
  }
  return 1;
}

// velocity of the contact's point of a link, added with a sign; the world has none
CAV_VECTOR_BODY void add_point_velocity(int link, const double arm[3], const double *velocity, double sign,
                                        double linear[3]) {
  if (link == 0) return;
  const double *V = velocity + 6 * link;
  double at[3];
  copy3(at, V + 3);
  cross_add3(at, V, arm);
  axpy3(linear, linear, sign, at);
}

// in the frame, from where the contact is on both links
CAV_VECTOR_BODY void velocity_by_arms(const cav_contact *c, double arm[2][3], const double *velocity, double *out) {
  double linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
  add_point_velocity(c->link1, arm[0], velocity, -1, linear);
  add_point_velocity(c->link2, arm[1], velocity, 1, linear);
  out[0] = dot3(c->frame, linear);
  if (c->dim == 1) return;
  out[1] = dot3(c->frame + 3, linear);
  out[2] = dot3(c->frame + 6, linear);
  if (c->dim == 3) return;
  if (c->link1) axpy3(angular, angular, -1, velocity + 6 * c->link1);
  if (c->link2) axpy3(angular, angular, 1, velocity + 6 * c->link2);
  for (int k = 3; k < c->dim; k++) out[k] = dot3(c->frame + 3 * (k - 3), angular);
}

// from the references of both links
CAV_VECTOR_BODY void contact_arms(const cav_state *state, const cav_contact *c, double arm[2][3]) {
  if (c->link1) sub3(arm[0], c->pos, state->reference + 3 * c->link1);
  if (c->link2) sub3(arm[1], c->pos, state->reference + 3 * c->link2);
}

void cav_contact_velocity(const cav_state *state, const cav_contact *c, const double *velocity, double *out) {
  double arm[2][3] = {{0}};
  contact_arms(state, c, arm);
  velocity_by_arms(c, arm, velocity, out);
}

// wrench of a contact on one of its links, at the link's reference; moment NULL: none
static inline void push_link(cav_state *state, int link, const double point[3], const double force[3],
                             const double *moment) {
  if (link == 0) return;
  double *F = state->force + 6 * link;
  push_at(F, state->reference + 3 * link, point, force);
  if (moment) add3(F, F, moment);
}

static void contact_push(cav_state *state, const cav_contact *c, double scale) {
  double force[3], moment[3] = {0, 0, 0};
  scale3(force, scale * c->impulse[0], c->frame);
  if (c->dim > 1) {
    axpy3(force, force, scale * c->impulse[1], c->frame + 3);
    axpy3(force, force, scale * c->impulse[2], c->frame + 6);
  }
  for (int k = 3; k < c->dim; k++) axpy3(moment, moment, scale * c->impulse[k], c->frame + 3 * (k - 3));
  const double *turn = c->dim > 3 ? moment : NULL;
  push_link(state, c->link2, c->pos, force, turn);
  if (c->link1 == 0) return;
  scale3(force, -1, force);
  scale3(moment, -1, moment);
  push_link(state, c->link1, c->pos, force, turn);
}

// f of one contact: its law at g = R^-1 (v* - v_next), v* = (1 - hB) x' - hK x in the normal row or as
// coupled rows have it
void cav_contact_impulse(const cav_state *state, cav_contact *c, const double *coupled, double *hessian) {
  double g[6];
  for (int k = 0; k < c->dim; k++) {
    double target = (1 - c->damping[k]) * c->velocity[k];
    if (k == 0) { target -= c->stiffness * (c->dist - c->margin); }
    if (coupled) { target = coupled[k]; }
    g[k] = (target - c->velocity_next[k] - (k == 0 ? cav_contact_excess(state, c) : 0)) / c->regulariser[k];
  }
  cav_law_contact(state, c, g, c->impulse, hessian);
}

// velocities of all contacts, those at v only if it has changed
CAV_VECTOR_BODY void contact_velocities_body(cav_state *state, const double *velocity_now) {
  for (int i = 0; i < state->ncontact; i++) {
    cav_contact *c = &state->contact[i];
    double arm[2][3] = {{0}};
    contact_arms(state, c, arm);
    if (velocity_now) { velocity_by_arms(c, arm, velocity_now, c->velocity); }
    velocity_by_arms(c, arm, state->velocity_next, c->velocity_next);
  }
}
CAV_BY_VECTORS(contact_velocities, (cav_state * state, const double *velocity_now), (state, velocity_now))

// where derivatives of the laws of all contacts go, NULL if memory runs out: none is known then, and each is found when it is
// asked for
static double *laws_of(cav_state *state) {
  cav_workspace *w = state->work;
  if (state->ncontact <= w->law_room) return w->law;
  free(w->law);
  w->law = malloc((size_t)w->contact_room * CAV_LAW_NUMBERS * sizeof *w->law);
  w->law_room = w->law ? w->contact_room : 0;
  return w->law;
}

// all contacts: velocities, impulses, wrenches
static void contacts(const cav_model *model, cav_state *state, const double *velocity_now, double scale) {
  const double *coupled = state->options.coupled ? state->work->target : NULL;
  contact_velocities(state, velocity_now);
  if (cav_looks_ahead(&state->options)) { cav_next_contacts_find(model, state); }
  const int by_four =
      cav_lanes_pay() && !coupled && !cav_looks_ahead(&state->options) && state->options.sliding == CAV_SLIDING_CONVEX;
  double *law = laws_of(state);
  for (int i = 0, known = 0; i < state->ncontact; i++) {
    cav_contact *c = &state->contact[i];
    double *hessian = law ? law + CAV_LAW_NUMBERS * i : NULL;
    if (hessian) hessian[0] = -1;
    if (i >= known && by_four && i + CAV_LANES <= state->ncontact && cav_law_four(c)) known = i + CAV_LANES;
    // that of coupled rows is of all of them together
    if (i >= known) cav_contact_impulse(state, c, coupled, c->dim <= 3 && !coupled ? hessian : NULL);
    if (coupled) { coupled += c->dim; }
    contact_push(state, c, scale);
  }
}

// limits and friction losses: they act on dofs directly
static void rows(cav_state *state, const double *v, const double *v_next, double scale, double *u) {
  const double *coupled =
      state->options.coupled && state->nrow > 0 ? state->work->target + state->work->first_row : NULL;
  for (int i = 0; i < state->nrow; i++) {
    cav_row *row = &state->row[i];
    row->velocity = cav_row_velocity(state, row, v);
    row->velocity_next = cav_row_velocity(state, row, v_next);
    double target = (1 - row->damping) * row->velocity;
    int limit = row->type == CAV_ROW_LIMIT_JOINT || row->type == CAV_ROW_LIMIT_TENDON;
    if (limit) { target -= row->stiffness * (row->dist - row->margin); }
    if (coupled) { target = coupled[i]; }
    if (limit) {
      double g = (target - row->velocity_next) / row->regulariser;
      cav_law_unilateral(row->regulariser, row->sigma, 0, g, &row->impulse, NULL, NULL);
    } else {
      double g = (target - row->velocity_next) / row->regulariser;
      cav_law_bilateral(row->regulariser, row->sigma, row->bound, g, &row->impulse, NULL, NULL);
    }
    cav_row_push_force(state, row, scale * row->impulse, u);
  }
}

/// Velocities [nv] of bias and passive forces, and at which joint damping acts; acceleration.
typedef struct step_motion {
  double *bias, *a;
  const double *damped;
} step_motion;

static step_motion motion_of(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  const int mean = cav_takes_mean(state);
  step_motion m = {.bias = w->scratch, .a = w->scratch + model->nv};
  find_motion(model->nv, mean, 1 / state->options.timestep, w->v, w->v_next, m.bias, m.a);
  m.damped = mean ? m.bias : w->v_next;
  return m;
}

// v* of coupled rows: from the velocities of all at v, those of links at velocity_now
static void couple(const cav_model *model, cav_state *state, const double *velocity_now) {
  const double *v = state->work->v;
  for (int i = 0; i < state->ncontact; i++) {
    cav_contact_velocity(state, &state->contact[i], velocity_now, state->contact[i].velocity);
  }
  for (int i = 0; i < state->nrow; i++) state->row[i].velocity = cav_row_velocity(state, &state->row[i], v);
  for (int i = 0; i < state->nequality; i++) {
    cav_equality_velocity(model, state, &state->equality[i], v, velocity_now, state->equality[i].velocity);
  }
  cav_coupled_targets(state);
}

// on links, beside their inertia: what a medium and gravity compensation do, contacts and equality constraints
static void push_links(const cav_model *model, cav_state *state, int with_constraints, int new_velocity) {
  cav_workspace *w = state->work;
  const double scale = -1 / state->options.timestep;
  if (state->options.order == CAV_ORDER_MOMENTUM) { cav_half_steps_forces(model, state); }
  if (w->nbuoy > 0) { cav_add_buoyancy(model, state); }
  if (w->nfloat > 0) { cav_add_fluid_forces(model, state); }
  const double *now = NULL;
  int links = with_constraints && (state->ncontact > 0 || state->nequality > 0);
  if (links) {
    if (new_velocity && cav_takes_mean(state)) {
      cav_link_velocities(model, state, w->v, w->velocity_now);
      now = w->velocity_now;
    } else if (new_velocity) {
      now = state->velocity;
    }
  }
  if (now && state->nequality > 0) { cav_equality_biases(model, state, w->v, now); }
  if (with_constraints && new_velocity && state->options.coupled) { couple(model, state, now); }
  if (links) {
    contacts(model, state, now, scale);
    if (state->nequality > 0) { cav_equality_impulses(model, state, w->v, now, w->v_next, scale); }
  }
}

// what acts on dofs but their own inertia and damping; bias [nv] is read where tendons have springs
static void push_dofs(const cav_model *model, cav_state *state, int with_constraints, const double *bias, double *u) {
  const cav_workspace *w = state->work;
  const double scale = -1 / state->options.timestep;
  cav_add_spring_forces(model, state, u);
  cav_add_tendon_forces(model, state, bias, u);
  if (!with_constraints) { return; }
  rows(state, w->v, w->v_next, scale, u);
  if (state->nequality > 0) { cav_equality_apply(model, state, scale, u); }
}

static void evaluate(const cav_model *model, cav_state *state, int with_constraints, int new_velocity, double *u) {
  state->work->derived = 0;
  const step_motion m = motion_of(model, state);
  cav_newton_euler(model, state, m.bias, state->work->v_next, m.a);
  push_links(model, state, with_constraints, new_velocity);
  cav_force_project(model, state, u);
  cav_add_resistance(model, state, m.damped, m.a, u);
  push_dofs(model, state, with_constraints, m.bias, u);
}

void cav_smooth_inverse(const cav_model *model, cav_state *state, const double *v, const double *v_next, double *u) {
  cav_workspace *w = state->work;
  if (w->valid > CAV_STAGE_POSITION) { w->valid = CAV_STAGE_POSITION; }
  copy(w->v, v, model->nv);
  copy(w->v_next, v_next, model->nv);
  evaluate(model, state, 0, 1, u);
}

int cav_state_evaluated(const cav_state *state) {
  return state->work->valid == CAV_STAGE_VELOCITY &&
         cav_options_same(&state->options, &state->work->options, CAV_STAGE_VELOCITY);
}

void cav_state_point(const cav_state *state, const double **q, const double **v, const double **v_next) {
  if (q) *q = state->work->q;
  if (v) *v = state->work->v;
  if (v_next) *v_next = state->work->v_next;
}

// what only some options need
static cav_status make_rooms(const cav_model *model, cav_state *state) {
  cav_status status = CAV_OK;
  if (state->options.order == CAV_ORDER_MOMENTUM) { status = cav_half_steps_new(model, state); }
  if (!status && cav_looks_ahead(&state->options)) { status = cav_next_knot_new(model, state); }
  return status;
}

// one number that is not finite anywhere before reaches the state's u
static cav_status close_inverse(const cav_model *model, cav_state *state, double *u) {
  cav_workspace *w = state->work;
  if (!all_finite(state->u, model->nv)) { return CAV_NOT_FINITE; }
  w->valid = CAV_STAGE_VELOCITY;
  w->options = state->options;
  copy(u, state->u, model->nv);
  return CAV_OK;
}

cav_status cav_inverse_from(const cav_model *model, cav_state *state, cav_stage unchanged, const double *q,
                            const double *v, const double *v_next, double *u) {
  cav_workspace *w = state->work;
  if (unchanged > w->valid) unchanged = w->valid;
  if (!cav_options_valid(&state->options)) { return CAV_BAD_INPUT; }
  if (!cav_options_same(&state->options, &w->options, CAV_STAGE_POSITION)) unchanged = CAV_STAGE_NONE;
  if (!cav_options_same(&state->options, &w->options, CAV_STAGE_VELOCITY) && unchanged > CAV_STAGE_POSITION)
    unchanged = CAV_STAGE_POSITION;
  // velocities move on from the same q: once all contacts, for any velocity
  int moved = unchanged != CAV_STAGE_NONE && w->narrowed && !is_within_reach(w, v, v_next, model->nv);
  cav_status status = CAV_OK;
  if (moved || unchanged == CAV_STAGE_NONE) {
    status = find_position(model, state, q, moved ? NULL : v, v_next);
    if (status) { return status; }
    unchanged = CAV_STAGE_NONE;
  }
  status = make_rooms(model, state);
  if (status) { return status; }
  copy(w->v, v, model->nv);
  copy(w->v_next, v_next, model->nv);
  w->valid = CAV_STAGE_POSITION;
  evaluate(model, state, 1, unchanged < CAV_STAGE_VELOCITY, state->u);
  return close_inverse(model, state, u);
}

cav_status cav_inverse(const cav_model *model, cav_state *state, const double *q, const double *v, const double *v_next,
                       double *u) {
  return cav_inverse_from(model, state, CAV_STAGE_NONE, q, v, v_next, u);
}

// whether contacts and limits read nothing of a position but poses of links. Contacts that are sought state by state where there
// are meshes are all found for four, to the same forces
static int is_plain(const cav_model *model, const cav_state *state) {
  const cav_workspace *w = state->work;
  const cav_options *o = &state->options;
  return !model->nequality && !w->nstring && !w->nbuoy && !w->nfloat && o->order != CAV_ORDER_MOMENTUM && !o->coupled &&
         o->regulariser != CAV_REGULARISER_EXACT && !cav_looks_ahead(o) && !o->stops &&
         !(cav_contacts_narrow(state) && cav_contacts_have_meshes(state));
}

// positions of four states that contacts and limits are then sought at state by state; status [4]
static void find_positions(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES], int plain,
                           cav_status *status) {
  const int listed = cav_contacts_listed(model, state[0]);
  cav_lanes_kinematics(model, lanes, state, plain ? CAV_EXTENT_CONTACTS : CAV_EXTENT_ALL);
  if (listed) {
    cav_contacts_near(model, lanes, state[0]);
    cav_contacts_place_near(lanes, state);
  }
  cav_lanes_limits(model, lanes, state[0]);
  for (int l = 0; l < CAV_LANES; l++) {
    cav_workspace *w = state[l]->work;
    const nearby near = {lanes, l, listed};
    status[l] = find_constraints(model, state[l], w->v, w->v_next, &near);
    if (!status[l]) status[l] = make_rooms(model, state[l]);
  }
}

// what acts on dofs of each of four states, whose u have the rest; u is theirs
static void close_four(const cav_model *model, cav_state *const state[CAV_LANES], double *const u[CAV_LANES],
                       cav_status status[CAV_LANES]) {
  for (int l = 0; l < CAV_LANES; l++) {
    if (status[l]) continue;
    const double *bias = state[l]->work->ntendon_spring ? motion_of(model, state[l]).bias : NULL;
    push_dofs(model, state[l], 1, bias, state[l]->u);
    status[l] = close_inverse(model, state[l], u[l]);
    state[l]->work->valid = CAV_STAGE_NONE;
  }
}

// scenes whose links, contacts and rows stay in the lanes: their vectors hold u at last, and the states nothing
static void inverse_in_lanes(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                             double *const u[CAV_LANES], cav_status status[CAV_LANES]) {
  cav_lanes_kinematics(model, lanes, state, CAV_EXTENT_NONE);
  cav_contacts_near(model, lanes, state[0]);
  cav_lanes_limits(model, lanes, state[0]);
  cav_stabilisation_prepare(state[0]);
  for (int l = 1; l < CAV_LANES; l++) {
    state[l]->work->discrete_damping = state[0]->work->discrete_damping;
    state[l]->work->discrete_stiffness = state[0]->work->discrete_stiffness;
  }
  cav_lanes_prepare(model, lanes, state[0]);
  cav_lanes_newton_euler(model, lanes, state, 0);
  cav_lanes_contacts(model, lanes, state);
  double *found[CAV_LANES];
  for (int l = 0; l < CAV_LANES; l++) found[l] = state[l]->u;
  if (lanes->rows) {
    cav_lanes_project(model, lanes, state, 0, NULL);
    cav_lanes_rows(model, lanes, state[0]);
    const int finite = cav_lanes_finite(lanes->u, model->nv);
    cav_lanes_scatter(finite == CAV_LANE_BITS - 1 ? u : found, lanes->u, model->nv);
    for (int l = 0; l < CAV_LANES; l++) {
      status[l] = finite >> l & 1 ? CAV_OK : CAV_NOT_FINITE;
      if (finite != CAV_LANE_BITS - 1 && !status[l]) copy(u[l], found[l], model->nv);
    }
    return;
  }
  cav_lanes_project(model, lanes, state, 0, found);
  for (int l = 0; l < CAV_LANES; l++) {
    cav_kinematics_close(model, state[l]);
    status[l] = cav_limits_of_near(model, state[l], lanes, l);
    state[l]->work->options = state[l]->options;
  }
  close_four(model, state, u, status);
}

void cav_inverse_four(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                      const double *const q[CAV_LANES], const double *const v[CAV_LANES],
                      const double *const v_next[CAV_LANES], double *const u[CAV_LANES], cav_status status[CAV_LANES]) {
  int open = 1;
  for (int l = 0; l < CAV_LANES && open; l++) open = !open_position(model, state[l], q[l]);
  if (!open || !cav_lanes_pay()) {
    for (int l = 0; l < CAV_LANES; l++) status[l] = cav_inverse(model, state[l], q[l], v[l], v_next[l], u[l]);
    return;
  }
  const int plain = is_plain(model, state[0]), stays = plain && cav_contacts_listed(model, state[0]);
  for (int l = 0; l < CAV_LANES; l++) {
    cav_workspace *w = state[l]->work;
    copy(w->q, q[l], model->nq);
    copy(w->v, v[l], model->nv);
    copy(w->v_next, v_next[l], model->nv);
    w->derived = 0;
  }
  cav_lanes_gather(lanes->v, v, model->nv);
  cav_lanes_gather(lanes->v_next, v_next, model->nv);
  if (stays) {
    inverse_in_lanes(model, lanes, state, u, status);
    return;
  }
  find_positions(model, lanes, state, plain, status);

  // links of states without contacts are left in the lanes
  int pushed = !plain;
  for (int l = 0; l < CAV_LANES; l++) pushed |= state[l]->ncontact > 0;
  cav_lanes_newton_euler(model, lanes, state, pushed);
  for (int l = 0; l < CAV_LANES && pushed; l++) {
    if (!status[l]) push_links(model, state[l], 1, 1);
  }
  double *found[CAV_LANES];
  for (int l = 0; l < CAV_LANES; l++) found[l] = state[l]->u;
  cav_lanes_project(model, lanes, state, pushed, found);
  close_four(model, state, u, status);
}
