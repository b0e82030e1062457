/// What was asked and what the motion does: every term of a problem with its cost, and for those with a target the knot
/// at which it is missed most: what was wanted there, what is, how far off, and whether that is within the term's
/// tolerance. Costs are summed here from the meaning of the terms in problem.h, apart from the optimiser's rows; the
/// sum is the motion's cost (tests/test_targets.c holds it against the solver's).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

// tolerances of goals, where the term gives none
static const double within_length = CAV_WITHIN_LENGTH, within_angle = CAV_WITHIN_ANGLE, within_speed = 0.3,
                    within_ratio = 0.1, within_effort = 0.05;

// of a force or torque of an actuator: a part of its limit; 0: it has none
static double within_limit(const cav_model *model, int actuator) {
  double range[2];
  cav_actuator_effort_range(model, actuator, range);
  double most = fmax(fabs(range[0]), fabs(range[1])) * fabs(model->actuator[actuator].unit);
  return isfinite(most) ? within_effort * most : 0;
}

// part of a vector's length from which a component of it is the whole
static const double all_of_it = 0.999;

// unit of a sensor's reading and the tolerance it has by default; 0: none, the quantity has no usual one
static const char *sensor_unit(const cav_model *model, const cav_sensor *sensor, double *within) {
  *within = 0;
  switch (sensor->type) {
    case CAV_SENSOR_FRAMEPOS:
    case CAV_SENSOR_SUBTREECOM:
    case CAV_SENSOR_RANGEFINDER:
      *within = within_length;
      return "m";
    case CAV_SENSOR_JOINTPOS:
    case CAV_SENSOR_JOINTLIMITPOS: {
      int hinge = model->joint[sensor->object].type != CAV_JOINT_SLIDE;
      *within = hinge ? within_angle : within_length;
      return hinge ? "rad" : "m";
    }
    case CAV_SENSOR_FRAMEQUAT:
    case CAV_SENSOR_BALLQUAT:
      *within = within_angle;
      return "rad";
    case CAV_SENSOR_FRAMEXAXIS:
    case CAV_SENSOR_FRAMEYAXIS:
    case CAV_SENSOR_FRAMEZAXIS:
      *within = within_ratio;
      return "";
    case CAV_SENSOR_JOINTVEL:
    case CAV_SENSOR_JOINTLIMITVEL: {
      int hinge = model->joint[sensor->object].type != CAV_JOINT_SLIDE;
      *within = within_speed;
      return hinge ? "rad/s" : "m/s";
    }
    case CAV_SENSOR_FRAMELINVEL:
    case CAV_SENSOR_SUBTREELINVEL:
    case CAV_SENSOR_VELOCIMETER:
      *within = within_speed;
      return "m/s";
    case CAV_SENSOR_FRAMEANGVEL:
    case CAV_SENSOR_GYRO:
    case CAV_SENSOR_BALLANGVEL:
      *within = within_speed;
      return "rad/s";
    case CAV_SENSOR_SUBTREEANGMOM:
      return "kg m2/s";
    case CAV_SENSOR_TOUCH:
    case CAV_SENSOR_FORCE:
    case CAV_SENSOR_TENDONLIMITFRC:
      return "N";
    case CAV_SENSOR_TORQUE:
      return "N m";
    case CAV_SENSOR_ACTUATORFRC:
      *within = within_limit(model, sensor->object);
      return "N or N m";
    case CAV_SENSOR_JOINTLIMITFRC:
    case CAV_SENSOR_JOINTACTUATORFRC:
      return "N or N m";
    case CAV_SENSOR_ACCELEROMETER:
    case CAV_SENSOR_FRAMELINACC:
      return "m/s2";
    case CAV_SENSOR_FRAMEANGACC:
      return "rad/s2";
    case CAV_SENSOR_TENDONPOS:
    case CAV_SENSOR_TENDONLIMITPOS:
    case CAV_SENSOR_ACTUATORPOS:
      *within = within_length;
      return "m or rad";
    case CAV_SENSOR_TENDONVEL:
    case CAV_SENSOR_TENDONLIMITVEL:
    case CAV_SENSOR_ACTUATORVEL:
      *within = within_speed;
      return "m/s or rad/s";
    case CAV_SENSOR_CLOCK:
      return "s";
    case CAV_SENSOR_MAGNETOMETER:
    case CAV_SENSOR_TYPES:
      break;
  }
  return "";
}

// whether a term names a value to be reached: at one time, by a target or a tolerance of its own, or as a constraint
static int states_target(const cav_problem *problem, const cav_term *term) {
  if (cav_quantity_rule_of(term->quantity)->of == CAV_OF_CONTACTS) return 0;
  if (term->quantity == CAV_QUANTITY_TRACK) return 0;
  return term->target != NULL || term->within > 0 || !isinf(cav_term_tolerance(problem, term, 1));
}

// number of the dof that the k-th selected value of a term belongs to
static int selected_dof(const cav_model *model, const cav_term *term, int k) {
  for (int d = 0; d < model->nv; d++)
    if (cav_verification_selects(model, term, d) && k-- == 0) return d;
  return -1;
}

// unit, usual tolerance and a text for the value that is missed most
static void describe(const cav_model *model, const cav_term *term, int k, cav_term_report *r, double *usual) {
  static const char *const axis[] = {"x", "y", "z"};
  const char *unit = "";
  *usual = 0;
  r->what[0] = 0;
  if (term->quantity == CAV_QUANTITY_SENSOR) {
    int one = term->component >= 0 ? term->component : k, several = term->sensor.dim >= 3 && one < 3;
    unit = sensor_unit(model, &term->sensor, usual);
    snprintf(r->what, sizeof r->what, "%s%s%s", cav_sensor_rule_of(term->sensor.type)->name, several ? " " : "",
             several ? axis[one] : "");
  } else if (term->quantity == CAV_QUANTITY_USER) {
    int one = term->component >= 0 ? term->component : k;
    unit = term->user->unit ? term->user->unit : "";
    *usual = term->user->within;
    int n = snprintf(r->what, sizeof r->what, "%.50s", term->user->name);
    if (term->user->dim > 1) snprintf(r->what + n, sizeof r->what - (size_t)n, " %d", one);
  } else if (cav_quantity_rule_of(term->quantity)->of == CAV_OF_ACTUATORS) {
    unit = term->quantity == CAV_QUANTITY_POWER ? "m/s" : "of limit";
    snprintf(r->what, sizeof r->what, "%s of %.40s", cav_quantity_rule_of(term->quantity)->name,
             k < model->nu ? model->actuator[k].name : "");
  } else {
    int d = selected_dof(model, term, k);
    const cav_joint *joint = d >= 0 ? &model->joint[model->dof[d].joint] : NULL;
    int line = joint && cav_verification_is_line(model, d);
    static const char *const units[][2] = {{"rad", "m"}, {"rad/s", "m/s"}, {"rad/s2", "m/s2"}};
    int rate = term->quantity == CAV_QUANTITY_VELOCITY ? 1 : term->quantity == CAV_QUANTITY_ACCELERATION ? 2 : 0;
    unit = units[rate][line];
    *usual = rate == 0 ? (line ? within_length : within_angle) : rate == 1 ? within_speed : 0;
    if (joint) {
      int several = joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL;
      snprintf(r->what, sizeof r->what, "%.40s%s%s", *joint->name ? joint->name : "joint", several ? " " : "",
               several ? axis[(d - joint->dof) % 3] : "");
    }
  }
  snprintf(r->unit, sizeof r->unit, "%s", unit);
}

// distance of one value to what is wanted there: the target, or the nearest of a range
static double miss_of(const cav_term *term, double x, double target, double *wanted) {
  *wanted = target;
  if (term->use != CAV_USE_RANGE) return x - target;
  double left = x - target;
  *wanted = target + fmin(fmax(left, term->lower), term->upper);
  return x - *wanted;
}

// whether a term has a name other than its element's, which says nothing of which it is
static int is_named(const cav_term *term) {
  return term->name && *term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name);
}

// a posture's difference as the coordinate itself where it is one: of hinges, slides and the place of a free joint
static void make_coordinate(const cav_verification *verification, const cav_term *term, int t, int k,
                            cav_term_report *r) {
  const cav_model *model = verification->model;
  int d = selected_dof(model, term, k);
  if (term->quantity != CAV_QUANTITY_CONFIGURATION || d < 0) return;
  const cav_joint *joint = &model->joint[model->dof[d].joint];
  int line = joint->type == CAV_JOINT_FREE && d - joint->dof < 3;
  if (!line && joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) return;
  double at = verification->q[(size_t)t * (size_t)model->nq + (size_t)(joint->q + (line ? d - joint->dof : 0))];
  r->wanted += at - r->got;
  r->got = at;
}

// keeps knot t if the term is missed more there than at any knot before
static void note_target(const cav_verification *verification, const cav_term *term, int t, int n, const double *x,
                        const double *target, cav_term_report *r) {
  // of a band about the target each component counts
  const int band = cav_term_is_band(term);
  int vector = term->quantity == CAV_QUANTITY_SENSOR && n > 1 && !band, worst = 0;
  double square = 0, most = -1, wanted;
  for (int k = 0; k < n; k++) {
    double miss = fabs(band ? x[k] - target[k] : miss_of(term, x[k], target[k], &wanted));
    square += miss * miss;
    if (!(miss <= most)) most = miss, worst = k;
  }
  double off = vector ? sqrt(square) : most, usual;
  if (r->has_target && !(off > r->off)) return;
  r->has_target = 1;
  r->off = off;
  r->got = x[worst];
  miss_of(term, x[worst], target[worst], &r->wanted);
  if (band) r->wanted = target[worst];
  make_coordinate(verification, term, t, worst, r);
  const int several = vector && term->component < 0 && term->sensor.dim > 1;
  const double alone = fabs(r->got - r->wanted);
  r->off_alone = several && alone < all_of_it * off ? alone : off;
  r->time = t * verification->h;
  describe(verification->model, term, worst, r, &usual);
  r->within = (band ? term->upper : 0) + cav_term_tolerance(verification->problem, term, usual);
}

// values that a term has at a knot, as they are compared; those of contacts and records have no target
static int values_of(const cav_model *model, const cav_term *term) {
  int n = 0;
  switch (cav_quantity_rule_of(term->quantity)->of) {
    case CAV_OF_SENSOR:
      return term->component >= 0 ? 1 : term->sensor.dim < 4 ? term->sensor.dim : 3;
    case CAV_OF_POSTURE:
    case CAV_OF_RATE:
      while (selected_dof(model, term, n) >= 0) n++;
      return n;
    case CAV_OF_ACTUATORS:
      return model->nu;
    case CAV_OF_USER:
      return term->component >= 0 ? 1 : term->user->dim;
    case CAV_OF_CONTACTS:
    case CAV_OF_TRACK:
      break;
  }
  return 0;
}

int cav_term_tolerances(const cav_problem *problem, const cav_term *term, int most, cav_tolerance *list,
                        int *reported) {
  enum { UNITS = 4 };
  cav_tolerance found[UNITS];
  const int values = states_target(problem, term) ? values_of(problem->model, term) : 0;
  int n = 0;
  if (reported) *reported = values > 0;
  for (int k = 0; k < values && n < UNITS; k++) {
    cav_term_report r;
    double usual;
    int known = 0;
    describe(problem->model, term, k, &r, &usual);
    const double within = cav_term_tolerance(problem, term, usual);
    while (known < n && (found[known].within != within || strcmp(found[known].unit, r.unit))) known++;
    if (isinf(within) || known < n) continue;
    found[n].within = within;
    memcpy(found[n++].unit, r.unit, sizeof r.unit);
  }
  for (int k = 0; k < n && k < most; k++) list[k] = found[k];
  return n;
}

void cav_target_words(const cav_verification *verification, const cav_term *term, int t, int k, double x, double target,
                      char *out, size_t size) {
  cav_term_report r = {.got = x};
  double usual;
  miss_of(term, x, target, &r.wanted);
  make_coordinate(verification, term, t, k, &r);
  describe(verification->model, term, k, &r, &usual);
  int named = is_named(term);
  snprintf(out, size, "%s%.60s%s%s, wanted %.4g, got %.4g", named ? "'" : "", named ? term->name : "",
           named ? "' " : "", r.what, r.wanted, r.got);
}

// cost of one value
static double norm_of(const cav_term *term, double x) {
  return term->norm == CAV_NORM_ABSOLUTE ? sqrt(1 + x * x) - 1 : 0.5 * x * x;
}

// cost of one value at knot t, where the norm has that weight
static double cost_of(const cav_verification *verification, const cav_term *term, int t, double weight, double x,
                      double target) {
  if (term->use != CAV_USE_COST || cav_verification_is_given(verification, term, t)) return 0;
  return weight * term->weight * norm_of(term, (x - target) / term->scale);
}

int cav_verification_is_given(const cav_verification *verification, const cav_term *term, int t) {
  const cav_problem *p = verification->problem;
  int of_start = term->quantity == CAV_QUANTITY_VELOCITY || term->quantity == CAV_QUANTITY_CONFIGURATION;
  return t == 0 && !p->cycle.on && !p->free_start && of_start;
}

double cav_verification_weight(const cav_verification *verification, const cav_term *term, int t) {
  int single, whole;
  if (!cav_verification_holds(verification, term, t, &single, &whole)) return 0;
  int forced = term->quantity != CAV_QUANTITY_CONFIGURATION && term->quantity != CAV_QUANTITY_VELOCITY;
  if (term->quantity == CAV_QUANTITY_SENSOR)
    forced = cav_sensor_rule_of(term->sensor.type)->stage == CAV_READS_ACCELERATION;
  if (term->quantity == CAV_QUANTITY_TRACK)
    forced = term->track->channel->kind == CAV_CHANNEL_SENSOR &&
             cav_sensor_rule_of(term->track->channel->sensor.type)->stage != CAV_READS_POSITION;
  if (term->quantity == CAV_QUANTITY_USER) forced = term->user->reads == CAV_READS_ACCELERATION;
  if (verification->problem->cycle.on && whole && t == 0 && !forced) return 0;
  return single ? 1 : verification->h;
}

void cav_targets_note(const cav_verification *verification, int t, double *work, cav_term_report *report) {
  int room = (cav_constraint_check_room(verification) - verification->model->nq) / 2;
  double *q = work, *x = q + verification->model->nq, *target = x + room;
  for (int i = 0; i < verification->problem->nterm; i++) {
    const cav_term *term = verification->problem->term + i;
    double weight = cav_verification_weight(verification, term, t);
    if (weight == 0) continue;
    int n = cav_verification_measure(verification, term, t, q, x, target);
    if (n > 0 && states_target(verification->problem, term))
      note_target(verification, term, t, n, x, target, &report[i]);
    for (int k = 0; k < n; k++) report[i].cost += cost_of(verification, term, t, weight, x[k], target[k]);
  }
}

// what a channel compares and in which unit
static void name_channel(const cav_model *model, const cav_channel *channel, cav_channel_residual *residual) {
  double within;
  residual->what = "position", residual->unit = "m";
  switch (channel->kind) {
    case CAV_CHANNEL_MARKER:
    case CAV_CHANNEL_TRANSLATION:
      break;
    case CAV_CHANNEL_COORDINATE:
      residual->what = "coordinate";
      residual->unit = model->joint[channel->object].type == CAV_JOINT_SLIDE ? "m" : "rad";
      break;
    case CAV_CHANNEL_ROTATION:
      residual->what = "orientation", residual->unit = "rad";
      break;
    case CAV_CHANNEL_SENSOR:
      residual->what = cav_sensor_rule_of(channel->sensor.type)->name;
      residual->unit = sensor_unit(model, &channel->sensor, &within);
      break;
    case CAV_CHANNEL_KINDS:
      break;
  }
}

void cav_records_begin(const cav_model *model, const cav_track *track, cav_channel_residual *residual) {
  for (int i = 0; i < track->nchannel; i++) {
    residual[i] = (cav_channel_residual){.worst_time = NAN};
    name_channel(model, &track->channel[i], &residual[i]);
  }
}

void cav_records_note(const cav_verification *verification, const cav_term *term, int t,
                      cav_channel_residual *residual) {
  int single, whole;
  if (!cav_verification_holds(verification, term, t, &single, &whole)) return;
  if (t >= verification->rows && cav_verification_is_late(term->track)) return;
  for (int i = 0; i < term->track->nchannel; i++) {
    double value[CAV_SENSOR_DIM_MAX], recorded[CAV_SENSOR_DIM_MAX], square = 0;
    int dim = cav_verification_channel(verification, term->track, i, t, value, recorded), seen = 0;
    for (int k = 0; k < dim; k++) {
      if (isnan(recorded[k])) continue;
      square += (value[k] - recorded[k]) * (value[k] - recorded[k]);
      seen = 1;
    }
    if (!seen) continue;
    residual[i].seen++;
    residual[i].rms += square;
    if (!(sqrt(square) > residual[i].worst) && residual[i].seen > 1) continue;
    residual[i].worst = sqrt(square);
    residual[i].worst_time = t * verification->h;
  }
}

void cav_targets_list(const cav_verification *verification, const cav_term *term, int t, double *work, int most,
                      cav_term_value *value, int *n) {
  int room = (cav_constraint_check_room(verification) - verification->model->nq) / 2, single, whole;
  double *q = work, *x = q + verification->model->nq, *target = x + room;
  if (!cav_verification_holds(verification, term, t, &single, &whole)) return;
  double weight = cav_verification_weight(verification, term, t);
  int here = cav_verification_measure(verification, term, t, q, x, target);
  for (int k = 0; k < here; k++, ++*n) {
    double cost = cost_of(verification, term, t, weight, x[k], target[k]);
    if (*n < most) value[*n] = (cav_term_value){t, k, x[k], target[k], cost};
  }
}

// a target that is missed, in words; of a vector what the worst component alone is off by, too, which the numbers are of
static void tell_miss(const cav_term *term, const cav_term_report *r, char *text, size_t size) {
  const char *component = r->off_alone < r->off ? strrchr(r->what, ' ') : NULL;
  const int named = is_named(term), kind = component ? (int)(component - r->what) : (int)strlen(r->what);
  const int n = snprintf(text, size, "'%.*s' by %.3g %s (within %.3g) at %.3g s:", named ? 60 : kind,
                         named ? term->name : r->what, r->off, r->unit, r->within, r->time);
  const size_t used = n < (int)size ? (size_t)n : size;
  if (component)
    snprintf(text + used, size - used, "%s alone by %.3g, wanted %.4g, got %.4g", component, r->off_alone, r->wanted,
             r->got);
  else
    snprintf(text + used, size - used, " wanted %.4g, got %.4g", r->wanted, r->got);
}

void cav_targets_verdict(const cav_verification *verification, cav_term_report *report, double residual_cost,
                         cav_verdict *verdict) {
  const cav_problem *p = verification->problem;
  double worst = 0, duration = verification->last * verification->h;
  verdict->cost = residual_cost + (p->duration_most > 0 ? 0.5 * p->duration_weight * duration * duration : 0);
  verdict->ntarget = verdict->nmissed = 0;
  verdict->missed_terms = 0;
  verdict->missed[0] = 0;
  for (int i = 0; i < p->nterm; i++) verdict->cost += report[i].cost;
  for (int i = 0; i < p->nterm; i++) {
    cav_term_report *r = &report[i];
    r->fraction = verdict->cost > 0 ? r->cost / verdict->cost : 0;
    if (!r->has_target) continue;
    // a value that is not a number is not met
    r->met = r->off <= r->within;
    verdict->ntarget += isfinite(r->within);
    if (r->met) continue;
    verdict->nmissed++;
    if (i < 64) verdict->missed_terms |= 1ull << i;
    if (isnan(r->off) || r->off / r->within > worst) {
      worst = isnan(r->off) ? INFINITY : r->off / r->within;
      const cav_term *term = &p->term[i];
      tell_miss(term, r, verdict->missed, sizeof verdict->missed);
    }
  }
  verdict->missed_most = worst;
  verdict->achieved = verdict->nmissed == 0;
}
