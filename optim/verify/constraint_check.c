/// Hard terms of a problem (CAV_USE_EQUAL, CAV_USE_RANGE), evaluated at one knot for verification: what is measured,
/// its target at that time, how far it is missed, over the term's scale. Written from the meaning of the terms in
/// problem.h, apart from the optimiser's rows.
/// A window holds the knots whose times lie in it, ends included (a negative time is the end); a window of one
/// instant, or one that falls between two knots, holds the knot nearest to its middle. A range bounds what is left
/// after the target. Velocity sensors read the velocity that leaves the knot; at a last knot that nothing leaves, the
/// velocity that reaches it. What needs a force or an acceleration has no value there.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "clearance.h"
#include "verification.h"

// time of a knot for windows and targets: a fraction of the problem's duration, whatever the step has become
static double when(const cav_verification *verification, int t) { return t * verification->problem->timestep; }

int cav_verification_holds(const cav_verification *verification, const cav_term *term, int t, int *single, int *whole) {
  double h = verification->problem->timestep, duration = verification->last * h;
  double from = term->from < 0 || term->from > duration ? duration : term->from;
  double to = term->to < 0 || term->to > duration ? duration : term->to;
  int first = (int)ceil(from / h - 1e-6), last = (int)floor(to / h + 1e-6);
  *single = to - from < 1e-9 || first > last;
  if (*single) first = last = (int)lround((from + to) / 2 / h);
  *whole = first == 0 && last == verification->last;
  return t >= first && t <= last;
}

// rotation vector of the turn from unit quaternion a to b, in a's axes
static void rotation(const double *a, const double *b, double *out) {
  double w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  double x = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2];
  double y = a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1];
  double z = a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0];
  double s = sqrt(x * x + y * y + z * z), angle = 2 * atan2(s, fabs(w));
  double scale = (w < 0 ? -1 : 1) * (s > 1e-12 ? angle / s : 2);
  out[0] = scale * x;
  out[1] = scale * y;
  out[2] = scale * z;
}

// the two waypoints around the knot's time and the fraction of the second
static double waypoints(const cav_term *term, double time, int *low, int *high) {
  *low = *high = 0;
  if (term->nwaypoint < 2 || time <= term->waypoint_time[0]) return 0;
  *low = *high = term->nwaypoint - 1;
  if (time >= term->waypoint_time[*high]) return 0;
  while (*low > 0 && term->waypoint_time[*low] > time) --*low;
  *high = *low + 1;
  return (time - term->waypoint_time[*low]) / (term->waypoint_time[*high] - term->waypoint_time[*low]);
}

// target of dim values at a time, linear between waypoints; zeros where the term gives none
static void target_at(const cav_term *term, double time, int dim, double *out) {
  int low, high;
  memset(out, 0, sizeof(double) * dim);
  if (!term->target) return;
  double fraction = waypoints(term, time, &low, &high);
  const double *a = term->target + low * dim, *b = term->target + high * dim;
  for (int k = 0; k < dim; k++) out[k] = (1 - fraction) * a[k] + fraction * b[k];
}

// unit quaternion of a target: the identity where the term gives none
static void target_quat(const cav_term *term, double time, double *out) {
  int low, high;
  const double identity[4] = {1, 0, 0, 0};
  memcpy(out, identity, sizeof identity);
  if (!term->target) return;
  double fraction = waypoints(term, time, &low, &high), norm = 0;
  const double *a = term->target + 4 * low, *b = term->target + 4 * high;
  double sign = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0 ? -1 : 1;
  for (int k = 0; k < 4; k++) {
    out[k] = (1 - fraction) * a[k] + fraction * sign * b[k];
    norm += out[k] * out[k];
  }
  for (int k = 0; k < 4; k++) out[k] = norm > 0 ? out[k] / sqrt(norm) : identity[k];
}

// a sensor's values and their target; work has room for one more reading
static int sensor_values(const cav_verification *verification, const cav_term *term, int t, double *x, double *target) {
  const cav_sensor *sensor = &term->sensor;
  double reading[4], aim[4];
  int n = sensor->dim;
  cav_sensor_read(verification->model, verification->state, sensor, reading);
  if (sensor->dim == 4) {
    target_quat(term, when(verification, t), aim);
    rotation(aim, reading, x);
    memset(target, 0, sizeof(double) * 3);
    n = 3;
  } else {
    memcpy(x, reading, sizeof(double) * n);
    target_at(term, when(verification, t), n, target);
  }
  if (term->component < 0) return n;
  x[0] = x[term->component];
  target[0] = target[term->component];
  return 1;
}

// values of a quantity of one's own and their target. What it refuses, or what is not finite, is told in failure
static int user_values(const cav_verification *verification, const cav_term *term, int t, double *x, double *target) {
  const cav_user_quantity *user = term->user;
  cav_error *failure = verification->failure;
  cav_knot_view view = {.model = verification->model, .state = verification->state};
  view.time = when(verification, t);
  view.timestep = verification->h;
  view.u = verification->state->u;
  cav_state_point(verification->state, &view.q, &view.v, &view.v_next);
  memset(x, 0, sizeof(double) * (size_t)user->dim);
  int code = user->value(user->context, &view, x), bad = 0;
  while (bad < user->dim && isfinite(x[bad])) bad++;
  if ((code || bad < user->dim) && failure->status == CAV_OK) {
    char what[40];
    snprintf(what, sizeof what, code ? "returned %d" : "gave value %d, not finite,", code ? code : bad);
    failure->status = code ? CAV_BAD_INPUT : CAV_NOT_FINITE;
    snprintf(failure->text, sizeof failure->text, "term '%.80s': the quantity '%.80s' %s at knot %d (%.4g s)",
             term->name && *term->name ? term->name : user->name, user->name, what, t, t * verification->h);
  }
  target_at(term, when(verification, t), user->dim, target);
  if (term->component < 0) return user->dim;
  x[0] = x[term->component];
  target[0] = target[term->component];
  return 1;
}

int cav_verification_selects(const cav_model *model, const cav_term *term, int dof) {
  const cav_joint *joint = model->joint + model->dof[dof].joint;
  int free = joint->type == CAV_JOINT_FREE, place = dof - joint->dof;
  switch (term->dofs) {
    case CAV_DOFS_ALL:
      return 1;
    case CAV_DOFS_ROOT_LINEAR:
      return free && place < 3;
    case CAV_DOFS_ROOT_ANGULAR:
      return free && place >= 3;
    case CAV_DOFS_JOINTS:
      return !free;
    case CAV_DOFS_DRIVEN:
      return !free && model->link[joint->link].driven;
    case CAV_DOFS_ONE:
      return model->dof[dof].joint == term->joint;
  }
  return 0;
}

// keeps the selected dofs of x and target [nv]
static int select_dofs(const cav_model *model, const cav_term *term, double *x, double *target) {
  int n = 0;
  for (int d = 0; d < model->nv; d++) {
    if (!cav_verification_selects(model, term, d)) continue;
    x[n] = x[d];
    target[n++] = target[d];
  }
  return n;
}

// q (-) target in the tangent; the goal where the term gives none. q: room for one configuration
static int configuration_values(const cav_verification *verification, const cav_term *term, int t, double *q, double *x,
                                double *target) {
  const cav_model *model = verification->model;
  int low = 0, high = 0;
  const double *from = verification->problem->q_goal, *to = from;
  double fraction = 0;
  if (term->target) {
    fraction = waypoints(term, when(verification, t), &low, &high);
    from = term->target + low * model->nq;
    to = term->target + high * model->nq;
  }
  if (!from) return 0;
  // geodesic between waypoints
  cav_difference(model, from, to, 1, x);
  cav_integrate(model, from, x, fraction, q);
  cav_difference(model, q, verification->q + t * model->nq, 1, x);
  memset(target, 0, sizeof(double) * model->nv);
  return select_dofs(model, term, x, target);
}

static int velocity_values(const cav_verification *verification, const cav_term *term, int t, double *x,
                           double *target) {
  const cav_model *model = verification->model;
  const double *v = verification->v + t * model->nv, *next = v + model->nv;
  int rate = term->quantity == CAV_QUANTITY_ACCELERATION;
  for (int d = 0; d < model->nv; d++) x[d] = rate ? (next[d] - v[d]) / verification->h : v[d];
  target_at(term, when(verification, t), model->nv, target);
  return select_dofs(model, term, x, target);
}

static int effort_values(const cav_verification *verification, const cav_term *term, int t, double *x, double *target) {
  const cav_model *model = verification->model;
  for (int a = 0; a < model->nu; a++)
    x[a] = verification->control[t * model->nu + a] / cav_verification_effort_scale(model, a);
  target_at(term, when(verification, t), model->nu, target);
  return model->nu;
}

// moment: room for one configuration
static int power_values(const cav_verification *verification, const cav_term *term, int t, double *moment, double *x,
                        double *target) {
  const cav_model *model = verification->model;
  const double *v = verification->v + t * model->nv, *next = v + model->nv;
  for (int a = 0; a < model->nu; a++) {
    double velocity = 0;
    cav_actuator_length(model, verification->state, a, moment);
    for (int d = 0; d < model->nv; d++) velocity += moment[d] * (v[d] + next[d]) / 2;
    x[a] = verification->control[t * model->nu + a] * model->actuator[a].unit * velocity / verification->weight;
  }
  target_at(term, when(verification, t), model->nu, target);
  return model->nu;
}

// what no actuator moves on either side
static int is_idle(const cav_model *model, const cav_contact *contact) {
  return !model->link[contact->link1].driven && !model->link[contact->link2].driven;
}

double cav_verification_may_slide(const cav_verification *verification, int t, const cav_contact *contact, int named) {
  const cav_problem *problem = verification->problem;
  const cav_model *model = verification->model;
  double speed = 0;
  int single, whole;
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = problem->term + i;
    int link = model->body[term->body].link;
    if (term->quantity != CAV_QUANTITY_SLIP || !(term->within > speed) || (named && term->body <= 0)) continue;
    if (!cav_verification_holds(verification, term, t, &single, &whole)) continue;
    if (term->body > 0 && contact->link1 != link && contact->link2 != link) continue;
    // a box may slide over the floor: the hands on it hold
    if (term->body <= 0 || model->link[link].driven || is_idle(model, contact)) speed = term->within;
  }
  return speed;
}

// whether slip costs anything: what may slide everywhere need not keep clear
static int holds_still(const cav_problem *problem) {
  int costs = 0;
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = problem->term + i;
    costs |= term->quantity == CAV_QUANTITY_SLIP && term->use == CAV_USE_COST && term->weight > 0;
  }
  return costs;
}

int cav_verification_looks_at(const cav_verification *verification, const cav_term *term, int t,
                              const cav_contact *contact) {
  const cav_model *model = verification->model;
  const cav_pair *pair = model->pair + contact->pair;
  int self = term->quantity == CAV_QUANTITY_SELF_PENETRATION || term->quantity == CAV_QUANTITY_SELF_FORCE;
  if (pair->external == self) return 0;
  if (term->quantity == CAV_QUANTITY_CLEARANCE && !(cav_pair_clears(model, pair) && holds_still(verification->problem)))
    return 0;
  // by its pair alone: rows are read again where what touches has moved
  if (term->quantity == CAV_QUANTITY_EDGE_FORCE && !cav_edges_of_pair(model, verification->edges, pair)) return 0;
  int link = model->body[term->body].link;
  // a body that is fixed shares its link with all of the world
  if (term->body > 0 && link == 0)
    return model->geom[pair->geom1].body == term->body || model->geom[pair->geom2].body == term->body;
  if (term->body > 0) return contact->link1 == link || contact->link2 == link;
  const int slip = term->quantity == CAV_QUANTITY_SLIP && is_idle(model, contact);
  return !(slip || term->quantity == CAV_QUANTITY_CLEARANCE) ||
         !(cav_verification_may_slide(verification, t, contact, 1) > 0);
}

int cav_verification_contact(const cav_verification *verification, const cav_term *term, const cav_contact *contact,
                             double value[2]) {
  double part = fmax(contact->impulse[0], 0) / verification->h / verification->weight, load = sqrt(part);
  const double *rate = contact->velocity_next;
  value[0] = load * fmax(contact->dist, 0);
  if (term->quantity == CAV_QUANTITY_SLIP) {
    for (int k = 0; k < 2; k++) value[k] = contact->dim > 1 ? load * rate[1 + k] : 0;
    return 2;
  }
  if (term->quantity == CAV_QUANTITY_CLEARANCE) {
    const double near = cav_clearance_nearness(cav_clearance_height(verification->h), contact->dist, NULL);
    for (int k = 0; k < 2; k++) value[k] = contact->dim > 1 ? near * rate[1 + k] : 0;
    return 2;
  }
  if (term->quantity == CAV_QUANTITY_IMPACT) value[0] = load * rate[0];
  if (term->quantity == CAV_QUANTITY_SELF_PENETRATION) value[0] = fmax(-contact->dist, 0);
  if (term->quantity == CAV_QUANTITY_EDGE_FORCE)
    value[0] = part * cav_edge_nearness(verification->model, verification->edges, contact, NULL);
  if (term->quantity == CAV_QUANTITY_FORCE || term->quantity == CAV_QUANTITY_SELF_FORCE) value[0] = part;
  return 1;
}

// those of every contact
static int contact_values(const cav_verification *verification, const cav_term *term, int t, double *x,
                          double *target) {
  const cav_state *state = verification->state;
  int n = 0;
  for (int i = 0; i < state->ncontact; i++) {
    if (!cav_verification_looks_at(verification, term, t, state->contact + i)) continue;
    n += cav_verification_contact(verification, term, state->contact + i, x + n);
  }
  memset(target, 0, sizeof(double) * n);
  return n;
}

// what the motion has where a channel of a record has its numbers
static void channel_values(const cav_verification *verification, const cav_channel *channel, int t, double *x) {
  const cav_model *model = verification->model;
  const double *q = verification->q + (size_t)t * (size_t)model->nq;
  cav_pose pose;
  double reading[CAV_SENSOR_DIM_MAX];
  if (channel->kind == CAV_CHANNEL_SENSOR) {
    cav_sensor_read(model, verification->state, &channel->sensor, reading);
    for (int c = 0; c < channel->ncolumn; c++) x[c] = reading[channel->component < 0 ? c : channel->component];
  } else if (channel->kind == CAV_CHANNEL_MARKER) {
    cav_object_pose(model, verification->state, CAV_OBJECT_XBODY, channel->object, &pose);
    for (int c = 0; c < 3; c++) {
      x[c] = pose.pos[c];
      for (int k = 0; k < 3; k++) x[c] += pose.rotation[3 * c + k] * channel->place[k];
    }
  } else {
    const cav_joint *joint = &model->joint[channel->object];
    int behind = channel->kind == CAV_CHANNEL_ROTATION && joint->type == CAV_JOINT_FREE ? 3 : 0;
    memcpy(x, q + joint->q + behind, (size_t)channel->ncolumn * sizeof *x);
  }
}

int cav_verification_channel(const cav_verification *verification, const cav_track *track, int channel, int t,
                             double *value, double *recorded) {
  const cav_channel *c = &track->channel[channel];
  double record[CAV_SENSOR_DIM_MAX], has[CAV_SENSOR_DIM_MAX], phi[3] = {0};
  int turned = c->ncolumn == 4, dim = turned ? 3 : c->ncolumn;
  int seen = cav_track_sample(track, c, when(verification, t), verification->problem->timestep, record) != 0;
  channel_values(verification, c, t, has);
  if (turned && seen) rotation(record, has, phi);
  for (int k = 0; k < dim; k++) {
    int gap = !seen || isnan(record[turned ? 0 : k]);
    value[k] = turned ? phi[k] : has[k];
    recorded[k] = gap ? NAN : turned ? 0 : record[k];
  }
  return dim;
}

// of all channels, over the noise; what was not recorded is zero, and so is its target
static int record_values(const cav_verification *verification, const cav_term *term, int t, double *x, double *target) {
  int n = 0;
  for (int i = 0; i < term->track->nchannel; i++) {
    double sd = term->track->channel[i].sd;
    int dim = cav_verification_channel(verification, term->track, i, t, x + n, target + n);
    for (int k = n; k < n + dim; k++) {
      int gap = isnan(target[k]);
      x[k] = gap ? 0 : x[k] / sd;
      target[k] = gap ? 0 : target[k] / sd;
    }
    n += dim;
  }
  return n;
}

int cav_verification_is_late(const cav_track *track) {
  return track->channel->kind == CAV_CHANNEL_SENSOR &&
         cav_sensor_rule_of(track->channel->sensor.type)->stage != CAV_READS_POSITION;
}

int cav_verification_measure(const cav_verification *verification, const cav_term *term, int t, double *q, double *x,
                             double *target) {
  int forced = t < verification->rows;
  switch (term->quantity) {
    case CAV_QUANTITY_SENSOR:
      if (!forced && cav_sensor_rule_of(term->sensor.type)->stage == CAV_READS_ACCELERATION) return 0;
      return sensor_values(verification, term, t, x, target);
    case CAV_QUANTITY_CONFIGURATION:
      return configuration_values(verification, term, t, q, x, target);
    case CAV_QUANTITY_VELOCITY:
      return velocity_values(verification, term, t, x, target);
    case CAV_QUANTITY_ACCELERATION:
      return forced ? velocity_values(verification, term, t, x, target) : 0;
    case CAV_QUANTITY_EFFORT:
      return forced ? effort_values(verification, term, t, x, target) : 0;
    case CAV_QUANTITY_POWER:
      return forced ? power_values(verification, term, t, q, x, target) : 0;
    case CAV_QUANTITY_GAP:
    case CAV_QUANTITY_SLIP:
    case CAV_QUANTITY_IMPACT:
    case CAV_QUANTITY_SELF_PENETRATION:
    case CAV_QUANTITY_FORCE:
    case CAV_QUANTITY_EDGE_FORCE:
    case CAV_QUANTITY_CLEARANCE:
    case CAV_QUANTITY_SELF_FORCE:
      return forced ? contact_values(verification, term, t, x, target) : 0;
    case CAV_QUANTITY_TRACK:
      return forced || !cav_verification_is_late(term->track) ? record_values(verification, term, t, x, target) : 0;
    case CAV_QUANTITY_USER:
      return forced || term->user->reads != CAV_READS_ACCELERATION ? user_values(verification, term, t, x, target) : 0;
    case CAV_QUANTITY_TYPES:
      break;
  }
  return 0;
}

int cav_constraint_check_room(const cav_verification *verification) {
  const cav_model *model = verification->model;
  int most = model->nv > model->nu ? model->nv : model->nu;
  if (2 * verification->state->ncontact > most) most = 2 * verification->state->ncontact;
  for (int i = 0; i < verification->problem->nterm; i++) {
    const cav_term *term = &verification->problem->term[i];
    if (term->quantity == CAV_QUANTITY_TRACK && term->track->ncolumn > most) most = term->track->ncolumn;
  }
  return model->nq + 2 * (most > CAV_USER_DIM_MAX ? most : CAV_USER_DIM_MAX);
}

void cav_constraint_check(const cav_verification *verification, int t, double *work, cav_metric *metric) {
  int room = (cav_constraint_check_room(verification) - verification->model->nq) / 2;
  double *q = work, *x = q + verification->model->nq, *target = x + room;
  for (int i = 0; i < verification->problem->nterm; i++) {
    const cav_term *term = verification->problem->term + i;
    int single, whole;
    if (term->use == CAV_USE_COST || !cav_verification_holds(verification, term, t, &single, &whole)) continue;
    int n = cav_verification_measure(verification, term, t, q, x, target);
    for (int k = 0; k < n; k++) {
      double left = x[k] - target[k], missed = fabs(left);
      if (term->use == CAV_USE_RANGE) missed = fmax(fmax(term->lower - left, left - term->upper), 0);
      // fmax drops what is not a number: keep it
      if (isnan(left)) missed = left;
      char words[200];
      if (missed / term->scale <= metric->value) continue;
      cav_target_words(verification, term, t, k, x[k], target[k], words, sizeof words);
      cav_metric_note(metric, missed / term->scale, t, "%s", words);
    }
  }
}
