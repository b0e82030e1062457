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
#include "half_step.h"
#include "math3.h"
#include "options.h"
#include "step.h"

static void copy(double *to, const double *from, int n) {
  if (n > 0 && to != from) { memcpy(to, from, (size_t)n * sizeof *to); }
}

// v NULL: all contacts; else those that bear something at v and v_next or may do so near them
static cav_status find_position(const cav_model *model, cav_state *state, const double *q, const double *v,
                                const double *v_next) {
  cav_workspace *w = state->work;
  state->work->valid = CAV_STAGE_NONE;
  state->ncontact = state->nrow = state->nequality = 0;
  if (!cav_options_valid(&state->options)) { return CAV_BAD_INPUT; }
  if (!all_finite(q, model->nq)) { return CAV_NOT_FINITE; }
  cav_kinematics(model, state, q);
  cav_stabilisation_prepare(state);
  cav_status status = cav_limits_find(model, state);
  if (status) { return status; }
  w->narrowed = v && cav_contacts_narrow(state);
  if (w->narrowed) {
    copy(w->narrow_v, v, model->nv);
    copy(w->narrow_v + model->nv, v_next, model->nv);
    cav_link_velocities(model, state, w->narrow_v, w->velocity_now);
    cav_link_velocities(model, state, w->narrow_v + model->nv, state->velocity_next);
    if (cav_looks_ahead(&state->options)) {
      status = cav_next_knot_new(model, state);
      if (status) { return status; }
      cav_next_links_place(model, state, v_next);
    }
  }
  status = cav_contacts_find(model, state);
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

// velocity of the contact point and angular velocity of a link, added with a sign; the world has none
static inline void add_link_velocity(const cav_state *state, int link, const double point[3], const double *velocity,
                                     double sign, double linear[3], double angular[3]) {
  if (link == 0) return;
  const double *V = velocity + 6 * link;
  double at[3];
  velocity_at(at, V, state->reference + 3 * link, point);
  axpy3(linear, linear, sign, at);
  axpy3(angular, angular, sign, V);
}

void cav_contact_velocity(const cav_state *state, const cav_contact *c, const double *velocity, double *out) {
  double linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
  add_link_velocity(state, c->link1, c->pos, velocity, -1, linear, angular);
  add_link_velocity(state, c->link2, c->pos, velocity, 1, linear, angular);
  out[0] = dot3(c->frame, linear);
  if (c->dim == 1) return;
  out[1] = dot3(c->frame + 3, linear);
  out[2] = dot3(c->frame + 6, linear);
  for (int k = 3; k < c->dim; k++) out[k] = dot3(c->frame + 3 * (k - 3), angular);
}

// wrench of a contact on one of its links, at the link's reference
static inline void push_link(cav_state *state, int link, const double point[3], const double force[3],
                             const double moment[3]) {
  if (link == 0) return;
  double *F = state->force + 6 * link;
  push_at(F, state->reference + 3 * link, point, force);
  add3(F, F, moment);
}

static void contact_push(cav_state *state, const cav_contact *c, double scale) {
  double force[3], moment[3] = {0, 0, 0};
  scale3(force, scale * c->impulse[0], c->frame);
  if (c->dim > 1) {
    axpy3(force, force, scale * c->impulse[1], c->frame + 3);
    axpy3(force, force, scale * c->impulse[2], c->frame + 6);
  }
  for (int k = 3; k < c->dim; k++) axpy3(moment, moment, scale * c->impulse[k], c->frame + 3 * (k - 3));
  push_link(state, c->link2, c->pos, force, moment);
  scale3(force, -1, force);
  scale3(moment, -1, moment);
  push_link(state, c->link1, c->pos, force, moment);
}

// f of one contact: its law at g = R^-1 (v* - v_next), v* = (1 - hB) x' - hK x in the normal row or as
// coupled rows have it
static void contact_impulse(const cav_state *state, cav_contact *c, const double *coupled) {
  double g[6];
  for (int k = 0; k < c->dim; k++) {
    double target = (1 - c->damping[k]) * c->velocity[k];
    if (k == 0) { target -= c->stiffness * (c->dist - c->margin); }
    if (coupled) { target = coupled[k]; }
    g[k] = (target - c->velocity_next[k] - (k == 0 ? cav_contact_excess(state, c) : 0)) / c->regulariser[k];
  }
  cav_law_contact(state, c, g, c->impulse, NULL);
}

// all contacts: velocities (those at v only if v has changed), impulses, wrenches
static void contacts(const cav_model *model, cav_state *state, const double *velocity_now, double scale) {
  const double *coupled = state->options.coupled ? state->work->target : NULL;
  for (int i = 0; i < state->ncontact; i++) {
    cav_contact *c = &state->contact[i];
    if (velocity_now) { cav_contact_velocity(state, c, velocity_now, c->velocity); }
    cav_contact_velocity(state, c, state->velocity_next, c->velocity_next);
  }
  if (cav_looks_ahead(&state->options)) { cav_next_contacts_find(model, state); }
  for (int i = 0; i < state->ncontact; i++) {
    cav_contact *c = &state->contact[i];
    contact_impulse(state, c, coupled);
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

// velocity of bias and passive forces, and acceleration; returns the velocity at which joint damping acts
static const double *step_velocities(const cav_model *model, cav_state *state, double *bias, double *a) {
  const cav_workspace *w = state->work;
  int mean = cav_takes_mean(state);
  double inverse_h = 1 / state->options.timestep;
  for (int i = 0; i < model->nv; i++) {
    a[i] = (w->v_next[i] - w->v[i]) * inverse_h;
    bias[i] = mean ? 0.5 * (w->v[i] + w->v_next[i]) : w->v[i];
  }
  return mean ? bias : w->v_next;
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

static void evaluate(const cav_model *model, cav_state *state, int with_constraints, int new_velocity, double *u) {
  cav_workspace *w = state->work;
  w->derived = 0;
  double *bias = w->scratch, *a = w->scratch + model->nv, scale = -1 / state->options.timestep;
  const double *damped = step_velocities(model, state, bias, a);

  // inertial forces of links, then contacts and equality constraints on them
  cav_newton_euler(model, state, bias, w->v_next, a);
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

  // up the tree, then what acts on dofs
  cav_force_project(model, state, u);
  cav_add_joint_forces(model, state, damped, a, u);
  cav_add_tendon_forces(model, state, bias, u);
  if (with_constraints) {
    rows(state, w->v, w->v_next, scale, u);
    if (state->nequality > 0) { cav_equality_apply(model, state, scale, u); }
  }
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
  if (moved || unchanged == CAV_STAGE_NONE) {
    cav_status status = find_position(model, state, q, moved ? NULL : v, v_next);
    if (status) { return status; }
    unchanged = CAV_STAGE_NONE;
  }
  if (state->options.order == CAV_ORDER_MOMENTUM) {
    cav_status status = cav_half_steps_new(model, state);
    if (status) { return status; }
  }
  if (cav_looks_ahead(&state->options)) {
    cav_status status = cav_next_knot_new(model, state);
    if (status) { return status; }
  }
  copy(w->v, v, model->nv);
  copy(w->v_next, v_next, model->nv);
  w->valid = CAV_STAGE_POSITION;
  evaluate(model, state, 1, unchanged < CAV_STAGE_VELOCITY, state->u);

  // one number that is not finite anywhere above reaches u
  if (!all_finite(state->u, model->nv)) { return CAV_NOT_FINITE; }
  w->valid = CAV_STAGE_VELOCITY;
  w->options = state->options;
  copy(u, state->u, model->nv);
  return CAV_OK;
}

cav_status cav_inverse(const cav_model *model, cav_state *state, const double *q, const double *v, const double *v_next,
                       double *u) {
  return cav_inverse_from(model, state, CAV_STAGE_NONE, q, v, v_next, u);
}
