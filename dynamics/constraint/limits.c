/// Constraints at q: the rows of limits and friction losses, and what makes the law of each row and contact: R, h B, h
/// K and the scale of smoothing (METHOD.md, 4). Two ways to them: MJCF's solref and solimp with their impedance curve,
/// eqs. (27), (28); or the discrete step, critically damped with double pole z = exp(-h/kappa), h B = (1 + eps)(1 -
/// z^2), h^2 K = (1 + eps)(1 - z)^2. Friction rows have K = 0. Contacts are found by collide.c, impulses are computed
/// in inverse.c.
///
/// Which limits are rows and which contacts are sought: distance below the margin with solref (MuJoCo's rule), and one
/// rule for what reaches beyond it (cav_law_activation). The discrete law looks at where the step ends, x + h v_next,
/// so there an object counts from speed h before the margin: slower than that, nothing is missed. The smoothed law is
/// active up to SMOOTH_ACTIVATION delta from there: the two add up.
#include "constraint.h"
#include "impedance.h"
#include "math3.h"
#include "rotation.h"

// fraction of smoothing distances beyond which the smoothed force is dropped: exp(-12) = 6e-6 of its value at contact
static const double SMOOTH_ACTIVATION = 12;
// fastest approach to a limit met without a jump, rad/s or m/s
static const double LIMIT_SPEED = 20;

// friction losses and ranges of joints that no actuator moves are rounded over so much less: as long as they creep, a door or a
// lever does not come to rest, and a stop throws out what begins at it
static const double PASSIVE = 0.01;
// such stops are set back by so many times what is left of the distance, where the tail of their force pushes nothing
static const double BEHIND = 20;
// contacts of the smoothed law: fraction of their activation distance over which they fade out at its end, fraction of
// the radii of round geoms over which they fade out where axes meet, and the least that is left
static const double FADING = 0.3, CORE = 0.5, STIFFNESS_RATIO_MIN = 1e-12;

// derivative of the sigmoid
static double sigmoid_derivative(double x, double midpoint, double power) {
  if (power == 1) { return 1; }
  if (x <= midpoint) { return power * pow(x / midpoint, power - 1); }
  return power * pow((1 - x) / (1 - midpoint), power - 1);
}

void cav_law_rates(const cav_state *state, const cav_softness *softness, double gap, double R, double *regulariser,
                   double *stiffness) {
  const double *solimp = softness->solimp;
  double d0 = clamp_between(solimp[0], IMPEDANCE_MIN, IMPEDANCE_MAX),
         dw = clamp_between(solimp[1], IMPEDANCE_MIN, IMPEDANCE_MAX);
  double width = solimp[2];
  *regulariser = *stiffness = 0;
  if (state->options.stabilisation == CAV_STABILISATION_DISCRETE) { return; }
  if (d0 == dw || width <= R_MIN || -gap >= width || gap >= 0) { return; }
  double derivative =
      sigmoid_derivative(-gap / width, clamp_between(solimp[3], IMPEDANCE_MIN, IMPEDANCE_MAX), larger(1, solimp[4]));
  double d = impedance(solimp, d0, dw, -gap), rate = -derivative / width * (dw - d0);
  // R goes with (1 - d)/d above its least value, hK with d
  *regulariser = R > R_MIN ? -rate / (d * (1 - d)) : 0;
  *stiffness = rate / d;
}

void cav_stabilisation_prepare(cav_state *state) {
  const cav_options *o = &state->options;
  if (o->stabilisation != CAV_STABILISATION_DISCRETE) return;
  double z = o->time_constant > 0 ? exp(-o->timestep / o->time_constant) : 0;
  state->work->discrete_damping = (1 + o->softness) * (1 - z * z);
  state->work->discrete_stiffness = (1 + o->softness) * (1 - z) * (1 - z) / o->timestep;
}

cav_law cav_law_at(const cav_state *state, const cav_softness *softness, double x, double weight) {
  if (state->options.stabilisation == CAV_STABILISATION_DISCRETE) return discrete_law(state, weight);
  const law_terms terms = terms_of(state, softness);
  return solref_law(softness, &terms, x, weight);
}

// of a one-sided row at a distance
static cav_law row_law(const cav_state *state, const cav_softness *softness, double dist, double weight) {
  return cav_law_at(state, softness, larger(0, -dist), weight);
}

// scale of the smoothed law active at a distance delta
static double smoothing_scale(const cav_law *l, double delta) {
  return delta > 0 ? l->stiffness * delta / sqrt(l->regulariser) : 0;
}

// distance over which limits and contacts between links of one tree are smoothed
static double self_smoothing(const cav_state *state) {
  return state->options.smoothing > 0 ? state->options.smoothing_self : 0;
}

double cav_law_activation(const cav_state *state, double delta, double speed) {
  double activation = SMOOTH_ACTIVATION * delta;
  if (state->options.stabilisation == CAV_STABILISATION_DISCRETE) { activation += speed * state->options.timestep; }
  return activation;
}

double cav_limit_activation(const cav_state *state, double margin) {
  return margin + cav_law_activation(state, self_smoothing(state), LIMIT_SPEED);
}

// one more row with its law, whose sigma is a distance until then. Friction loss (bound > 0) has no position error; where the law
// is smoothed, its corners are rounded over the velocity at which a limit of the same softness would be
static cav_status add_row(cav_state *state, cav_row row, const cav_softness *softness, double weight) {
  int friction = row.type == CAV_ROW_FRICTION_DOF || row.type == CAV_ROW_FRICTION_TENDON;
  cav_law l = row_law(state, softness, friction ? 0 : row.dist - row.margin, weight);
  row.regulariser = l.regulariser;
  row.damping = l.damping + (friction ? cav_friction_stops(state) : 0);
  row.stiffness = friction ? 0 : l.stiffness;
  row.sigma = smoothing_scale(&l, row.sigma);
  cav_row *slot = cav_row_push(state);
  if (!slot) { return CAV_NO_MEMORY; }
  *slot = row;
  return CAV_OK;
}

// a motor holds a joint where it stands; where there is none, friction and stops alone do
static double smoothing_of(const cav_state *state, const cav_joint *joint) {
  return (joint->driven ? 1 : PASSIVE) * self_smoothing(state);
}

static cav_status add_friction(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  cav_status status = CAV_OK;
  for (int i = 0; i < w->nfriction && !status; i++) {
    int k = w->friction[i];
    const cav_dof *dof = &model->dof[k];
    cav_row row = {.type = CAV_ROW_FRICTION_DOF, .object = k, .axis = {1}};
    row.bound = state->options.timestep * dof->frictionloss;
    row.sigma = smoothing_of(state, &model->joint[dof->joint]);
    status = add_row(state, row, &dof->friction, dof->inverse_weight);
  }
  for (int i = 0; i < w->ntendon_friction && !status; i++) {
    int k = w->tendon_friction[i];
    const cav_tendon *tendon = &model->tendon[k];
    cav_row row = {.type = CAV_ROW_FRICTION_TENDON, .object = k, .axis = {1}, .sigma = self_smoothing(state)};
    row.bound = state->options.timestep * tendon->frictionloss;
    status = add_row(state, row, &tendon->friction, tendon->inverse_weight);
  }
  return status;
}

// both ends of a scalar range
static cav_status limit_scalar(cav_state *state, cav_row row, double value, const double range[2],
                               const cav_softness *softness, double weight, double activation) {
  cav_status status = CAV_OK;
  for (int side = 0; side < 2 && !status; side++) {
    row.side = side;
    row.axis[0] = side ? -1 : 1;
    row.dist = side ? range[1] - value : value - range[0];
    if (row.dist < activation) { status = add_row(state, row, softness, weight); }
  }
  return status;
}

// one side of a ball's cylinder, whose distance grows along n in the rotation vector that J moves
static cav_status limit_turn(cav_state *state, cav_row row, int side, double dist, const double n[3], const double J[9],
                             const cav_joint *joint, double weight, double activation) {
  if (!(dist < activation)) { return CAV_OK; }
  row.side = side;
  row.dist = dist;
  rotate_back(row.axis, J, n);
  return add_row(state, row, &joint->limit, weight);
}

// twist range and swing radius of a ball joint
static cav_status limit_cylinder(cav_state *state, cav_row row, const cav_joint *joint, double weight,
                                 double activation) {
  double w[3], J[9], n[3], away[3];
  quat_log(w, state->work->q + joint->q);
  cav_rotation_jacobian_inverse(w, J);
  double twist = dot3(w, joint->axis);
  cav_status status = CAV_OK;
  if (joint->twist_limited) {
    scale3(n, -1, joint->axis);
    status = limit_turn(state, row, 2, twist - joint->twist[0], joint->axis, J, joint, weight, activation);
    if (!status) { status = limit_turn(state, row, 3, joint->twist[1] - twist, n, J, joint, weight, activation); }
  }
  if (joint->swing_limited && !status) {
    axpy3(away, w, -twist, joint->axis);
    double swing = norm3(away);
    // without swing no direction leads to the limit more than another
    scale3(n, swing > 0 ? -1 / swing : 0, away);
    status = limit_turn(state, row, 4, joint->swing - swing, n, J, joint, weight, activation);
  }
  return status;
}

// largest rotation angle of a ball joint
static cav_status limit_ball(cav_state *state, cav_row row, const cav_joint *joint, double weight, double activation) {
  double turn[3];
  quat_log(turn, state->work->q + joint->q);
  row.side = 1;
  row.dist = joint->range[1] - normalise3(turn);
  scale3(row.axis, -1, turn);
  return row.dist < activation ? add_row(state, row, &joint->limit, weight) : CAV_OK;
}

// limit i of the list of those of joints; beyond: how far from its margin it counts
static cav_status add_joint_limit(const cav_model *model, cav_state *state, int i, double beyond) {
  const cav_workspace *w = state->work;
  const int k = w->limit[i];
  const cav_joint *joint = &model->joint[k];
  double weight = model->dof[joint->dof].inverse_weight, activation = joint->margin + beyond;
  // most are far from both ends of a range
  const double *at = w->q + joint->q, *range = joint->range;
  if (joint->type != CAV_JOINT_BALL && !(at[0] - range[0] < activation) && !(range[1] - at[0] < activation))
    return CAV_OK;
  cav_row row = {
      .type = CAV_ROW_LIMIT_JOINT, .object = k, .margin = joint->margin, .sigma = smoothing_of(state, joint)};
  if (!joint->driven) row.margin -= BEHIND * row.sigma;
  if (joint->type != CAV_JOINT_BALL) return limit_scalar(state, row, at[0], range, &joint->limit, weight, activation);
  cav_status status = joint->limited ? limit_ball(state, row, joint, weight, activation) : CAV_OK;
  return status ? status : limit_cylinder(state, row, joint, weight, activation);
}

static cav_status add_tendon_limits(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  cav_status status = CAV_OK;
  for (int i = 0; i < w->ntendon_limit && !status; i++) {
    int k = w->tendon_limit[i];
    const cav_tendon *tendon = &model->tendon[k];
    cav_row row = {.type = CAV_ROW_LIMIT_TENDON, .object = k, .margin = tendon->margin, .sigma = self_smoothing(state)};
    status = limit_scalar(state, row, state->tendon_length[k], tendon->range, &tendon->limit, tendon->inverse_weight,
                          cav_limit_activation(state, tendon->margin));
  }
  return status;
}

cav_status cav_limits_find(const cav_model *model, cav_state *state) {
  state->nrow = 0;
  if (!state->options.constraint) { return CAV_OK; }
  cav_status status = add_friction(model, state);
  const double beyond = cav_limit_activation(state, 0);
  for (int i = 0; i < state->work->nlimit && !status; i++) status = add_joint_limit(model, state, i, beyond);
  return status ? status : add_tendon_limits(model, state);
}

cav_status cav_limits_of_near(const cav_model *model, cav_state *state, const cav_lanes *lanes, int lane) {
  state->nrow = 0;
  if (!state->options.constraint) { return CAV_OK; }
  cav_status status = add_friction(model, state);
  const double beyond = cav_limit_activation(state, 0);
  for (int k = 0; k < lanes->nbounded && !status; k++) {
    const int i = lanes->bounded[k];
    if (i >> lane & 1) status = add_joint_limit(model, state, i / CAV_LANE_BITS, beyond);
  }
  return status ? status : add_tendon_limits(model, state);
}

// 0 below 0, 1 above 1, with no derivative at either, and the rate of its logarithm
static double rise(double x, double *rate) {
  *rate = x > 0 && x < 1 ? 6 * (1 - x) / (x * (3 - 2 * x)) : 0;
  return x <= 0 ? 0 : x >= 1 ? 1 : x * x * (3 - 2 * x);
}

// distance between the axes of two round geoms at which they touch; 0: one of them is not round
static double round_thickness(const cav_model *model, const cav_pair *pair) {
  const cav_geom *geom[2] = {&model->geom[pair->geom1], &model->geom[pair->geom2]};
  double sum = 0;
  for (int k = 0; k < 2; k++) {
    if (geom[k]->type != CAV_GEOM_SPHERE && geom[k]->type != CAV_GEOM_CAPSULE) return 0;
    sum += geom[k]->size[0];
  }
  return sum;
}

// radius of a round geom that stands against a solid, of which the least way out is not the same all over; 0: none
static double radius_in_solid(const cav_model *model, const cav_pair *pair) {
  const cav_geom *geom[2] = {&model->geom[pair->geom1], &model->geom[pair->geom2]};
  int round = -1;
  for (int k = 0; k < 2; k++) {
    cav_geom_type type = geom[k]->type;
    if (type == CAV_GEOM_PLANE || type == CAV_GEOM_HFIELD) return 0;
    if (type == CAV_GEOM_SPHERE || type == CAV_GEOM_CAPSULE) round = round < 0 ? k : 2;
  }
  return round == 0 || round == 1 ? geom[round]->size[0] : 0;
}

// 1 at the surface, and less the deeper, so that force approaches what it is at the depth of saturation; round geoms fade
// out where their axes get into a solid, as the way out of it flips there
static double saturate(const cav_state *state, const cav_contact *c, double *rate) {
  double x = fmin(c->dist, 0) / state->options.saturation, fraction = 1 / sqrt(1 + x * x), derivative;
  *rate = -x / (1 + x * x) / state->options.saturation;
  double radius = radius_in_solid(state->model, &state->model->pair[c->pair]), core = CORE * radius;
  if (!(radius > 0)) return fraction;
  fraction *= larger(STIFFNESS_RATIO_MIN, rise((c->dist + radius) / core, &derivative));
  *rate += derivative / core;
  return fraction;
}

double cav_contact_stiffness_ratio(const cav_state *state, const cav_contact *c, double *rate) {
  const cav_pair *pair = &state->model->pair[c->pair];
  double fraction = pair->external ? 1 : state->options.self_stiffness, derivative, more = 0;
  *rate = 0;
  if (!(state->options.smoothing > 0)) return fraction;
  if (state->options.saturation > 0 && pair->external) { fraction = saturate(state, c, &more); }
  double activation = cav_contact_activation(state, pair), width = FADING * activation;
  fraction *= larger(STIFFNESS_RATIO_MIN, rise((activation - c->dist) / width, &derivative));
  *rate = -derivative / width;
  if (more != 0) *rate += more;
  double thickness = round_thickness(state->model, pair), core = CORE * thickness;
  if (!(thickness > 0)) return fraction;
  fraction *= larger(STIFFNESS_RATIO_MIN, rise((c->dist + thickness) / core, &derivative));
  *rate += derivative / core;
  return fraction;
}

// R of the friction rows so that R_j mu_j^2 is the same for all (22); these share the damping
static void soften_contact(const cav_state *state, cav_contact *c, const law_terms *terms, double inverse_impratio) {
  const cav_pair *pair = &state->model->pair[c->pair];
  double rate, weight = contact_weight(state, pair) / cav_contact_stiffness_ratio(state, c, &rate);
  const double x = larger(0, c->margin - c->dist);
  const cav_law l = terms ? solref_law(&pair->softness, terms, x, weight) : discrete_law(state, weight);
  c->stiffness = l.stiffness;
  c->sigma = smoothing_scale(&l, pair->external ? state->options.smoothing : self_smoothing(state));
  c->regulariser[0] = l.regulariser;
  c->damping[0] = l.damping;
  const double tangential = larger(R_MIN, l.regulariser * inverse_impratio);
  const double damping = l.damping + cav_friction_stops(state);
  for (int k = 1; k < c->dim; k++) {
    double *mu = &c->friction[k - 1];
    *mu = larger(*mu, FRICTION_MIN);
    double ratio = *mu == c->friction[0] ? 1 : c->friction[0] / *mu;
    c->regulariser[k] = tangential * ratio * ratio;
    c->damping[k] = damping;
  }
}

static int is_same(const cav_softness *a, const cav_softness *b) {
  int same = 1;
  for (int k = 0; k < 2; k++) same &= a->solref[k] == b->solref[k];
  for (int k = 0; k < 5; k++) same &= a->solimp[k] == b->solimp[k];
  return same;
}

void cav_contacts_soften(cav_state *state) {
  const int discrete = state->options.stabilisation == CAV_STABILISATION_DISCRETE;
  const cav_softness *of = NULL;
  double inverse_impratio = 1 / larger(R_MIN, state->options.impratio);
  law_terms terms;
  for (int i = 0; i < state->ncontact; i++) {
    cav_contact *c = &state->contact[i];
    const cav_softness *softness = &state->model->pair[c->pair].softness;
    // mostly that of the one before
    if (!discrete && !(of && is_same(of, softness))) {
      terms = terms_of(state, softness);
      of = softness;
    }
    soften_contact(state, c, discrete ? NULL : &terms, inverse_impratio);
  }
}

void cav_contact_soften(const cav_state *state, cav_contact *c) {
  const law_terms terms = terms_of(state, &state->model->pair[c->pair].softness);
  const int discrete = state->options.stabilisation == CAV_STABILISATION_DISCRETE;
  soften_contact(state, c, discrete ? NULL : &terms, 1 / larger(R_MIN, state->options.impratio));
}

double cav_row_velocity(const cav_state *state, const cav_row *row, const double *v) {
  const cav_model *model = state->model;
  switch (row->type) {
    case CAV_ROW_LIMIT_JOINT: {
      const cav_joint *joint = &model->joint[row->object];
      return joint->type == CAV_JOINT_BALL ? dot3(row->axis, v + joint->dof) : row->axis[0] * v[joint->dof];
    }
    case CAV_ROW_FRICTION_DOF:
      return v[row->object];
    default:
      return row->axis[0] * cav_tendon_velocity(state, row->object, v);
  }
}

void cav_row_push_force(const cav_state *state, const cav_row *row, double force, double *u) {
  const cav_model *model = state->model;
  switch (row->type) {
    case CAV_ROW_LIMIT_JOINT: {
      const cav_joint *joint = &model->joint[row->object];
      int n = joint->type == CAV_JOINT_BALL ? 3 : 1;
      for (int k = 0; k < n; k++) { u[joint->dof + k] += row->axis[k] * force; }
      break;
    }
    case CAV_ROW_FRICTION_DOF:
      u[row->object] += force;
      break;
    default:
      cav_tendon_pull(state, row->object, row->axis[0] * force, u);
  }
}
