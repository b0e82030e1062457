/// Charts and verdict lines of a result's page; view.c draws them. Efforts are fractions of an actuator's own limit,
/// contact forces and unactuated forces fractions of the weight.
#include "page.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "certificate.h"
#include "file.h"
#include "problem_file.h"
#include "view.h"

// charts on their way: series, and the numbers that they point at
typedef struct charts {
  int n, nknot;
  cav_view_series *series;
  double *value, *wanted; ///< [nknot] of each
} charts;

// a new chart; returns where its values go
static double *add(charts *c, const char *group, const char *name, const char *unit, double lower, double upper) {
  double *value = c->value + (size_t)c->n * (size_t)c->nknot;
  c->series[c->n++] = (cav_view_series){group, name, unit, value, lower, upper, NULL};
  return value;
}

// ---------------------------------------------------------------- what was asked

// whether a term asks for a value: a target that is not only a pull over the whole time
static int asks(const cav_term *term) {
  int posture = term->quantity == CAV_QUANTITY_CONFIGURATION, sensor = term->quantity == CAV_QUANTITY_SENSOR;
  if (!posture && !sensor) return 0;
  return term->use == CAV_USE_EQUAL ||
         (term->use == CAV_USE_COST && (term->from == term->to || term->nwaypoint > 0 || term->within > 0));
}

// knots of a term's window, one at least
static void find_knots(const charts *c, const cav_problem *p, const cav_term *term, int *first, int *last) {
  double h = p->duration / (c->nknot - 1), to = term->to < 0 ? p->duration : fmin(term->to, p->duration);
  double from = term->from < 0 ? p->duration : fmin(term->from, p->duration);
  *first = (int)ceil(from / h - 1e-6), *last = (int)floor(to / h + 1e-6);
  if (from == to || *first > *last) *first = *last = (int)lround((from + to) / (2 * h));
}

// number k of a term's target at a time, linear between waypoints; dim numbers each
static double wanted_at(const cav_term *term, double time, int dim, int k) {
  const double *target = term->target, *when = term->waypoint_time;
  int i = 0;
  if (!target) return 0;
  while (i < term->nwaypoint && when[i] <= time) i++;
  if (term->nwaypoint == 0 || i == 0) return target[k];
  if (i == term->nwaypoint) return target[(i - 1) * dim + k];
  double s = (time - when[i - 1]) / (when[i] - when[i - 1]);
  return (1 - s) * target[(i - 1) * dim + k] + s * target[i * dim + k];
}

// marks a value as asked for in the chart that was made last, or in one of an index
static void mark(charts *c, int chart, int knot, double value) {
  double *wanted = c->wanted + (size_t)chart * (size_t)c->nknot;
  if (!c->series[chart].wanted)
    for (int t = 0; t < c->nknot; t++) wanted[t] = NAN;
  c->series[chart].wanted = wanted;
  wanted[knot] = value;
}

// marks of a joint's chart: postures, and sensors of its angle
static void mark_joint(charts *c, int chart, const cav_problem *p, int j, double scale) {
  const cav_joint *joint = &p->model->joint[j];
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    int posture = term->quantity == CAV_QUANTITY_CONFIGURATION, first, last;
    if (!asks(term) || (posture && !cav_problem_selects(p->model, term, joint->dof))) continue;
    if (!posture && (term->sensor.type != CAV_SENSOR_JOINTPOS || term->sensor.object != j)) continue;
    find_knots(c, p, term, &first, &last);
    for (int t = first; t <= last; t++) {
      double time = t * p->duration / (c->nknot - 1);
      double goal = posture ? wanted_at(term, time, p->model->nq, joint->q) : wanted_at(term, time, 1, 0);
      mark(c, chart, t, scale * (posture && !term->target ? p->q_goal[joint->q] : goal));
    }
  }
}

// a chart of one component of a sensor that is asked for, with its marks; what follows from postures alone
static cav_status add_sensor(charts *c, const cav_problem *p, const cav_term *term, int k, cav_state *state,
                             const double *q) {
  static const char *const unit[2][4] = {{NULL, "x", "y", "z"}, {"m", "m, x", "m, y", "m, z"}};
  int length = term->sensor.type == CAV_SENSOR_FRAMEPOS || term->sensor.type == CAV_SENSOR_SUBTREECOM;
  double reading[CAV_SENSOR_DIM_MAX];
  int first, last;
  const char *along = unit[length][term->sensor.dim > 1 ? k + 1 : 0];
  double *value = add(c, "Asked", *term->name ? term->name : "unnamed", along, NAN, NAN);
  for (int t = 0; t < c->nknot; t++) {
    cav_status status = cav_position(p->model, state, q + (size_t)t * (size_t)p->model->nq);
    if (status) return status;
    cav_sensor_read(p->model, state, &term->sensor, reading);
    value[t] = reading[k];
  }
  find_knots(c, p, term, &first, &last);
  for (int t = first; t <= last; t++)
    mark(c, c->n - 1, t, wanted_at(term, t * p->duration / (c->nknot - 1), term->sensor.dim, k));
  return CAV_OK;
}

static int is_charted(const cav_term *term) {
  return asks(term) && term->quantity == CAV_QUANTITY_SENSOR && term->sensor.dim <= 3 &&
         term->sensor.type != CAV_SENSOR_JOINTPOS && cav_sensor_rule_of(term->sensor.type)->stage == CAV_READS_POSITION;
}

static cav_status add_asked(charts *c, const cav_problem *p, const double *q) {
  cav_state *state = cav_state_new(p->model);
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  for (int i = 0; i < p->nterm && !status; i++)
    for (int k = 0; k < 3 && !status && is_charted(&p->term[i]); k++)
      if (k < p->term[i].sensor.dim && (p->term[i].component < 0 || p->term[i].component == k))
        status = add_sensor(c, p, &p->term[i], k, state, q);
  cav_state_free(state);
  return status;
}

static void add_whole(charts *c, const cav_model *model, const cav_trajectory *trajectory, const cav_forces *forces,
                      double weight) {
  double *height = add(c, "Motion", "height of the centre of mass", "m", NAN, NAN);
  double *press = add(c, "Motion", "contact forces, vertical", "weight", NAN, NAN);
  double *effort = add(c, "Motion", "largest effort", "of its limit", -INFINITY, 1);
  double *helper = add(c, "Motion", "unactuated force", "weight", NAN, NAN);
  double *depth = add(c, "Motion", "penetration", "mm", NAN, NAN);
  for (int t = 0, i = 0; t < c->nknot; t++) {
    height[t] = forces->com[3 * t + 2];
    press[t] = t + 1 < c->nknot || isfinite(forces->unactuated[t]) ? 0 : NAN;
    for (; i < forces->nforce && forces->force[i].knot == t; i++) {
      // forces between limbs cancel: only those from what does not move count
      int from_world = model->geom[forces->force[i].geom1].link == 0,
          on_world = model->geom[forces->force[i].geom2].link == 0;
      press[t] += (from_world - on_world) * forces->force[i].force[2] / weight;
    }
    effort[t] = model->nu && isfinite(forces->control[t * model->nu]) ? 0 : NAN;
    for (int a = 0; a < model->nu; a++) {
      double range[2], u = forces->control[t * model->nu + a];
      cav_actuator_effort_range(model, a, range);
      double fraction = u > 0 ? u / range[1] : u / range[0];
      if (isfinite(fraction)) effort[t] = fmax(effort[t], fraction);
    }
    helper[t] = forces->unactuated[t] / weight;
    depth[t] = 1e3 * forces->depth[t];
  }
  (void)trajectory;
}

static void add_each(charts *c, const cav_problem *problem, const cav_trajectory *trajectory,
                     const cav_forces *forces) {
  const cav_model *model = problem->model;
  for (int a = 0; a < model->nu; a++) {
    double range[2];
    cav_actuator_effort_range(model, a, range);
    double *value = add(c, "Controls", model->actuator[a].name, "", range[0], range[1]);
    for (int t = 0; t < c->nknot; t++) value[t] = forces->control[t * model->nu + a];
  }
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = &model->joint[j];
    if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) continue;
    double scale = joint->type == CAV_JOINT_HINGE ? 180 / M_PI : 1;
    double *value = add(c, "Joints", joint->name, joint->type == CAV_JOINT_HINGE ? "deg" : "m",
                        joint->limited ? scale * joint->range[0] : NAN, joint->limited ? scale * joint->range[1] : NAN);
    for (int t = 0; t < c->nknot; t++) value[t] = scale * trajectory->q[t * model->nq + joint->q];
    mark_joint(c, c->n - 1, problem, j, scale);
  }
}

// whether the goal is another posture than the start, and the motion has one
static int has_goal(const cav_problem *p) {
  double apart = 0;
  for (int i = 0; i < p->model->nq; i++) apart = fmax(apart, fabs(p->q_goal[i] - p->q_start[i]));
  return !p->cycle.on && apart > 1e-3;
}

// lines of the certificate, and the solver's time
static int verdict_lines(const cav_verdict *verdict, cav_certificate_line *told, cav_view_line *line,
                         char seconds[64]) {
  int n = 0, count = cav_certificate_lines(verdict, told);
  if (!verdict->certified) line[n++] = (cav_view_line){"not certified", verdict->reason, -1};
  if (!verdict->achieved) line[n++] = (cav_view_line){"misses", verdict->missed, -1};
  for (int i = 0; i < count; i++) line[n++] = (cav_view_line){told[i].label, told[i].value, told[i].passed};
  if (isnan(verdict->solve_seconds)) return n;
  snprintf(seconds, 64, "%.1f s, %d iterations", verdict->solve_seconds, verdict->iterations);
  line[n++] = (cav_view_line){"solved in", seconds, -1};
  return n;
}

cav_status cav_page_write(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                          const cav_forces *forces, const cav_verdict *verdict, cav_error *error) {
  const cav_model *model = problem->model;
  const double *g = model->gravity;
  double weight = model->mass * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  size_t most = (size_t)(5 + model->nu + model->njoint + 3 * problem->nterm), nknot = (size_t)trajectory->nknot;
  charts c = {0, trajectory->nknot, calloc(most, sizeof *c.series), calloc(2 * most * nknot, sizeof *c.value), NULL};
  cav_view_force *force = calloc((size_t)forces->nforce + 1, sizeof *force);
  if (!c.series || !c.value || !force) {
    free(c.series);
    free(c.value);
    free(force);
    return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory for the page", path);
  }
  c.wanted = c.value + most * nknot;
  add_whole(&c, model, trajectory, forces, weight > 0 ? weight : 1);
  cav_status status = add_asked(&c, problem, trajectory->q);
  add_each(&c, problem, trajectory, forces);
  for (int i = 0; i < forces->nforce; i++) {
    memcpy(force[i].pos, forces->force[i].pos, sizeof force[i].pos);
    memcpy(force[i].force, forces->force[i].force, sizeof force[i].force);
  }
  cav_certificate_line told[CAV_CERTIFICATE_LINES];
  cav_view_line line[CAV_CERTIFICATE_LINES + 3];
  char seconds[64], title[300];
  snprintf(title, sizeof title, "%.140s on %.140s", problem->name, model->name);
  cav_view_input input = {.title = title,
                          .nknot = trajectory->nknot,
                          .timestep = trajectory->timestep,
                          .q = trajectory->q,
                          .goal = has_goal(problem) ? problem->q_goal : NULL,
                          .nforce = forces->count,
                          .force = force,
                          .nseries = c.n,
                          .series = c.series,
                          .nline = verdict ? verdict_lines(verdict, told, line, seconds) : 0,
                          .line = line};
  if (status) cav_file_fail(error, status, 0, "%s: no charts of what was asked", path);
  if (!status) status = cav_view_write(path, model, &input, error);
  free(c.series);
  free(c.value);
  free(force);
  return status;
}
