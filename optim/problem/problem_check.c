/// Checks of a problem that a caller filled by hand: every number, every index and every array that the transcription
/// reads without looking. Does not tell whether a motion is possible.
#include "problem_check.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

#include "file.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"

static const double near_step = 1e-6; // of a step, and of the horizon

// the first entry of an array that is not finite, -1: none
static int infinite_entry(const double *x, int n) {
  for (int i = 0; i < n; i++) {
    if (!isfinite(x[i])) return i;
  }
  return -1;
}

static cav_status check_vector(const char *name, const double *x, int n, cav_error *error) {
  int bad = infinite_entry(x, n);
  return bad < 0 ? CAV_OK : cav_file_fail(error, CAV_NOT_FINITE, 0, "%s[%d] of the problem is not finite", name, bad);
}

static cav_status check_horizon(const cav_problem *p, cav_error *error) {
  const char *wrong = NULL;
  if (p->duration_most != 0 && !(p->duration_least > 0 && p->duration_most >= p->duration_least &&
                                 p->duration >= p->duration_least && p->duration <= p->duration_most))
    wrong = "a free duration needs duration between duration_least, above 0, and duration_most";
  else if (!(p->duration_weight >= 0 && p->duration_weight <= CAV_WEIGHT_MOST))
    wrong = "duration_weight must not be negative, nor above 1e16";
  else if (!(p->window >= 0) || !(p->overlap >= 0) ||
           (p->window > 0 && !(p->overlap <= p->window - 2 * p->timestep * (1 - near_step))))
    wrong = "windows need an overlap that is shorter than they are by two steps";
  else if (p->window > 0 && (p->cycle.on || p->duration_most > 0))
    wrong = "windows are of a motion with a start, an end and a given duration";
  else if (p->cycle.on && !(p->duration >= 2.5 * p->timestep))
    wrong = "a cycle needs at least three steps";
  else if (p->cycle.on && p->free_start)
    wrong = "free_start is for a motion with a start; that of a cycle is free as it is";
  else if (!(p->timestep > 0) || !(p->duration >= 2 * p->timestep) || !isfinite(p->duration))
    wrong = "the horizon needs a positive timestep and at least two steps";
  else if (!(p->effort_limit > 0) || p->effort_limit > 1)
    wrong = "effort_limit must be in (0, 1]";
  else if (!(p->strength >= 0) || isinf(p->strength))
    wrong = "strength must not be negative";
  else if (!(p->limit_margin >= 0) || !isfinite(p->limit_margin))
    wrong = "limit_margin must not be negative";
  else if (!(p->residual.force >= 0) || !(p->residual.torque >= 0) || !(p->residual.within >= 0) ||
           !isfinite(p->residual.force + p->residual.torque))
    wrong = "deviations of the residual and what it is allowed must not be negative";
  else if (p->schedule.stages < 1)
    wrong = "the schedule needs at least one stage";
  else if (!(p->schedule.optimality >= 0 && p->schedule.optimality <= 1))
    wrong = "the schedule's optimality is a fraction of the cost";
  if (wrong) return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s", wrong);
  int n;
  const cav_field *field = cav_stage_fields(&n);
  cav_status status = cav_fields_check(field, n, &p->schedule.first, "first stage of the schedule", error);
  return status ? status : cav_fields_check(field, n, &p->schedule.last, "last stage of the schedule", error);
}

static int is_scalar_joint(const cav_model *m, int joint) {
  return joint >= 0 && joint < m->njoint &&
         (m->joint[joint].type == CAV_JOINT_HINGE || m->joint[joint].type == CAV_JOINT_SLIDE);
}

// times that increase from 0 to the last; the first that does not, -1: none
static int time_out_of_order(double last, int n, const double *time, size_t stride) {
  double before = -1;
  for (int i = 0; i < n; i++) {
    double at = *(const double *)(const void *)((const char *)time + (size_t)i * stride);
    if (!(at >= 0 && at > before && at <= last * (1 + near_step))) return i;
    before = at;
  }
  return -1;
}

static cav_status check_guess(const cav_problem *p, cav_error *error) {
  const double number[8] = {p->guess_height,      p->guess_from,        p->guess_to,     p->guess_rotation[0],
                            p->guess_rotation[1], p->guess_rotation[2], p->guess_bow[0], p->guess_bow[1]};
  if (infinite_entry(number, 8) >= 0)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "guess_height, guess_from, guess_to, guess_rotation and guess_bow must be finite");
  if ((p->nguess_pose && !p->guess_pose) || (p->nswing && !p->swing))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "guess_pose or swing is NULL, and counted");
  int late = time_out_of_order(p->duration, p->nguess_pose, p->nguess_pose ? &p->guess_pose->time : NULL,
                               sizeof *p->guess_pose);
  if (late >= 0)
    return cav_file_fail(
        error, CAV_BAD_INPUT, 0,
        "the time of guess_pose[%d], %g s, is not after the one before it and within the horizon, 0 .. %g s", late,
        p->guess_pose[late].time, p->duration);
  for (int i = 0; i < p->nguess_pose; i++) {
    if (!p->guess_pose[i].q || infinite_entry(p->guess_pose[i].q, p->model->nq) >= 0)
      return cav_file_fail(error, CAV_BAD_INPUT, 0, "guess_pose[%d] has no posture, or one that is not finite", i);
  }
  for (int i = 0; i < p->nswing; i++) {
    const cav_swing *s = &p->swing[i];
    if (!is_scalar_joint(p->model, s->joint))
      return cav_file_fail(error, CAV_BAD_INPUT, 0, "swing[%d] is of no hinge or slide of the model", i);
    if (!isfinite(s->amplitude) || !isfinite(s->frequency) || !isfinite(s->phase))
      return cav_file_fail(error, CAV_BAD_INPUT, 0, "a number of swing[%d] is not finite", i);
  }
  return CAV_OK;
}

static int has_object(const cav_model *m, cav_object_type type, int object) {
  int n = 0;
  size_t stride;
  if (type >= CAV_OBJECT_TYPES) return 0;
  cav_object_names(m, type, &n, &stride);
  return object >= 0 && object < n;
}

// a sensor of a term; NULL: all is there
static const char *wrong_sensor(const cav_model *m, const cav_sensor *s) {
  if (s->type >= CAV_SENSOR_TYPES || s->dim != cav_sensor_rule_of(s->type)->dim)
    return "is of a sensor of no known type, or of another length than its type's: cav_sensor_of fills one";
  if (cav_sensor_rule_of(s->type)->target != CAV_TARGET_NONE && !has_object(m, s->object_type, s->object))
    return "is of a sensor that looks at nothing in the model: cav_sensor_of fills one";
  if (s->referred && !has_object(m, s->reference_type, s->reference))
    return "is of a sensor in the frame of nothing in the model";
  return NULL;
}

static const char *wrong_component(const cav_sensor *s, int component) {
  int components = s->dim == 4 ? 3 : s->dim;
  return component < -1 || component >= components ? "is of a component that its sensor does not have; -1: all" : NULL;
}

// what a term looks at; NULL: all is there
static const char *wrong_object(const cav_model *m, const cav_term *term) {
  const cav_sensor *s = &term->sensor;
  cav_values_of of = cav_quantity_rule_of(term->quantity)->of;
  if ((of == CAV_OF_POSTURE || of == CAV_OF_RATE) && term->dofs > CAV_DOFS_ONE) return "selects no known set of dofs";
  if ((of == CAV_OF_POSTURE || of == CAV_OF_RATE) && term->dofs == CAV_DOFS_ONE &&
      !(term->joint >= 0 && term->joint < m->njoint))
    return "is of a joint that the model does not have";
  if (of == CAV_OF_CONTACTS && !(term->body >= 0 && term->body < m->nbody))
    return "is of a body that the model does not have; 0: all contacts";
  if (of != CAV_OF_SENSOR) return NULL;
  const char *wrong = wrong_sensor(m, s);
  return wrong ? wrong : wrong_component(s, term->component);
}

static const char *wrong_target(const cav_problem *p, int moving, const cav_term *term) {
  int n = cav_term_target_length(p->model, term), rows = term->nwaypoint ? term->nwaypoint : 1;
  if (term->nwaypoint < 0 || (term->nwaypoint && (!term->target || !term->waypoint_time)))
    return "counts waypoints that have no targets or no times";
  const double last = moving ? DBL_MAX / 2 : p->duration;
  if (term->nwaypoint && time_out_of_order(last, term->nwaypoint, term->waypoint_time, sizeof(double)) >= 0)
    return "has waypoints whose times do not increase within the horizon";
  if (!n || !term->target) return NULL;
  if (infinite_entry(term->target, n * rows) >= 0) return "has a target that is not finite";
  int orientation = term->quantity == CAV_QUANTITY_SENSOR && n == 4;
  for (int i = 0; orientation && i < rows; i++) {
    const double *t = term->target + 4 * i;
    if (!(t[0] * t[0] + t[1] * t[1] + t[2] * t[2] + t[3] * t[3] > 1e-18))
      return "has an orientation of length zero as target";
  }
  return NULL;
}

// numbers of a channel for what it is of, 0: any
static int columns_of(const cav_channel *channel) {
  switch (channel->kind) {
    case CAV_CHANNEL_MARKER:
    case CAV_CHANNEL_TRANSLATION:
      return 3;
    case CAV_CHANNEL_COORDINATE:
      return 1;
    case CAV_CHANNEL_ROTATION:
      return 4;
    case CAV_CHANNEL_SENSOR:
      return channel->component >= 0 && channel->sensor.dim != 4 ? 1 : channel->sensor.dim;
    case CAV_CHANNEL_KINDS:
      break;
  }
  return 0;
}

static const char *wrong_channel(const cav_model *m, const cav_track *track, const cav_channel *channel) {
  if (channel->kind >= CAV_CHANNEL_KINDS || !(channel->sd > 0) || !isfinite(channel->sd) || !channel->name)
    return "has a channel of no kind, or without a name or a noise above 0";
  if (channel->kind == CAV_CHANNEL_SENSOR) {
    const char *wrong = wrong_sensor(m, &channel->sensor);
    if (!wrong) wrong = wrong_component(&channel->sensor, channel->component);
    if (!wrong && channel->sensor.dim == 4 && channel->component >= 0)
      wrong = "has a channel of one component of an orientation; record all of it";
    if (wrong) return wrong;
  } else if (channel->kind == CAV_CHANNEL_MARKER) {
    if (!has_object(m, CAV_OBJECT_BODY, channel->object) || infinite_entry(channel->place, 3) >= 0)
      return "has a marker on a body that the model does not have, or at no place";
  } else {
    int exists = channel->object >= 0 && channel->object < m->njoint;
    cav_joint_type type = exists ? m->joint[channel->object].type : CAV_JOINT_FREE;
    int free = type == CAV_JOINT_FREE, round = free || type == CAV_JOINT_BALL;
    int fits = channel->kind == CAV_CHANNEL_COORDINATE    ? !round
               : channel->kind == CAV_CHANNEL_TRANSLATION ? free
                                                          : round;
    if (!exists || !fits) return "has a channel of a joint that the model does not have, or of another type";
  }
  if (channel->ncolumn != columns_of(channel) || channel->column < 0 ||
      channel->column + channel->ncolumn > track->ncolumn)
    return "has a channel whose columns its record does not have";
  return NULL;
}

static const char *wrong_track(const cav_problem *p, const cav_term *term) {
  const cav_track *track = term->track;
  if (term->quantity != CAV_QUANTITY_TRACK) return track ? "has a record that its quantity does not read" : NULL;
  if (!track || track->nchannel < 1 || !track->channel || track->nframe < 2 || !track->time || !track->value)
    return "of a record has none, or one without channels or with less than two frames: fill term.track";
  if (!(track->interval > 0) || !isfinite(track->offset) || !(track->gap >= 0))
    return "has a record without an interval above 0, an offset or a gap";
  for (int i = 0; i < track->nframe; i++)
    if (!isfinite(track->time[i]) || (i && !(track->time[i] > track->time[i - 1])))
      return "has a record whose times do not increase";
  for (int i = 0; i < track->nchannel; i++) {
    const char *wrong = wrong_channel(p->model, track, &track->channel[i]);
    if (wrong) return wrong;
    if (cav_channel_stage(&track->channel[i]) != cav_channel_stage(track->channel))
      return "has a record of several stages; positions, velocities, accelerations and forces are tracks of their own";
  }
  if (p->duration_most > 0) return "has a record, which has its own time, and the duration is free; fix it";
  return NULL;
}

static const char *wrong_number(const cav_problem *p, const cav_term *term) {
  double end = term->to < 0 ? p->duration : term->to;
  if (!(term->scale > 0) || !(term->weight >= 0) || !isfinite(term->scale) || !(term->weight <= CAV_WEIGHT_MOST))
    return "needs a positive scale and a weight that is not negative, nor above 1e16";
  if (!(term->from >= 0) || !(end >= term->from) || !(term->from <= p->duration * (1 + near_step)))
    return "has a window that ends before it begins, or begins after the horizon";
  double h = p->timestep;
  if (term->from < end && ceil(term->from / h - near_step) > floor(end / h + near_step))
    return "has a window in which no knot lies";
  if (!(term->within >= 0)) return "has a tolerance (within) that is negative";
  if (term->use == CAV_USE_RANGE && !(term->lower <= term->upper)) return "has a lower bound above the upper one";
  if (term->use == CAV_USE_COST && term->norm > CAV_NORM_ABSOLUTE) return "is of no known norm";
  return NULL;
}

static cav_status check_term(const cav_problem *p, int moving, int i, cav_error *error) {
  const cav_term *term = &p->term[i];
  if (term->quantity >= CAV_QUANTITY_TYPES || term->use > CAV_USE_RANGE)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "a term is of no quantity: term[%d]", i);
  if (term->use != CAV_USE_COST && !cav_quantity_rule_of(term->quantity)->hard)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "a constraint must be over a sensor, a posture, a velocity, an acceleration or a quantity of "
                         "one's own: term[%d]",
                         i);
  const char *wrong = wrong_number(p, term);
  if (!wrong) wrong = wrong_object(p->model, term);
  if (!wrong) wrong = wrong_target(p, moving, term);
  if (!wrong) wrong = wrong_track(p, term);
  if (!wrong) return CAV_OK;
  return cav_file_fail(error, CAV_BAD_INPUT, 0, "a term %s: term[%d], '%.80s'", wrong, i, term->name ? term->name : "");
}

static cav_status check_parameter(const cav_problem *p, int i, cav_error *error) {
  const cav_parameter *x = &p->parameter[i];
  const char *wrong = cav_problem_wrong_parameter(p->model, x);
  for (int k = 0; k < i && !wrong; k++)
    if (p->parameter[k].kind == x->kind && p->parameter[k].object == x->object &&
        p->parameter[k].component == x->component)
      wrong = "is the same as one before it";
  return wrong ? cav_file_fail(error, CAV_BAD_INPUT, 0, "a parameter %s: parameter[%d]", wrong, i) : CAV_OK;
}

cav_status cav_problem_check(const cav_problem *p, int moving, cav_error *error) {
  if (!p->model || !p->q_start || !p->v_start || !p->q_goal)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "the problem lacks a model, a start or a goal");
  if (p->nterm < 0 || (p->nterm && !p->term))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "term is NULL, and counted");
  cav_status status = check_horizon(p, error);
  if (!status) status = check_vector("q_start", p->q_start, p->model->nq, error);
  if (!status && !p->cycle.on) status = check_vector("v_start", p->v_start, p->model->nv, error);
  if (!status) status = check_vector("q_goal", p->q_goal, p->model->nq, error);
  if (!status) status = check_guess(p, error);
  for (int i = 0; i < p->nterm && !status; i++) status = check_term(p, moving, i, error);
  if (!status && (p->nparameter < 0 || (p->nparameter && !p->parameter)))
    status = cav_file_fail(error, CAV_BAD_INPUT, 0, "parameter is NULL, and counted");
  for (int i = 0; i < p->nparameter && !status; i++) status = check_parameter(p, i, error);
  return status;
}
