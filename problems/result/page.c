/// Charts, targets and verdict lines of a result's page; view.c draws them. Efforts are N m or N at their joint with their
/// fraction of the actuator's own limit, contact forces and unactuated forces fractions of the weight.
#include "page.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "certificate.h"
#include "file.h"
#include "problem_file.h"
#include "view.h"

#define COUNT(...) +1
enum { QUALITIES = 0 CAV_QUALITIES(COUNT) };
#undef COUNT

typedef struct quality_text {
  char label[48], value[32];
} quality_text;

// charts on their way: series, and the numbers that they point at
typedef struct charts {
  int n, nknot;
  int steps; ///< of the problem's own duration: of one period of a cycle
  cav_view_series *series;
  double *value, *wanted; ///< [nknot] of each
} charts;

// a new chart; returns where its values go
static double *add(charts *c, const char *group, const char *name, const char *unit, double lower, double upper) {
  double *value = c->value + (size_t)c->n * (size_t)c->nknot;
  c->series[c->n++] = (cav_view_series){group, name, unit, value, lower, upper, 0, NULL};
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
  double h = p->duration / c->steps, to = term->to < 0 ? p->duration : fmin(term->to, p->duration);
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
      double time = t * p->duration / c->steps;
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
    mark(c, c->n - 1, t, wanted_at(term, t * p->duration / c->steps, term->sensor.dim, k));
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

// --- targets in space ---

// targets on their way
typedef struct targets {
  int n;
  cav_view_target *target; ///< two a term at most
} targets;

// a term's target at a knot, if it is a place in the world
static cav_status add_target(targets *list, const cav_problem *p, const cav_term *term, int first, int last,
                             cav_state *state, const double *q, double timestep) {
  cav_view_target at = {.name = *term->name ? term->name : "unnamed", .from = first, .to = last};
  cav_status status = cav_position(p->model, state, q + (size_t)first * (size_t)p->model->nq);
  if (status) return status;
  cav_sensor_read(p->model, state, &term->sensor, at.got);
  for (int k = 0; k < 3; k++)
    at.pos[k] = term->component < 0 || term->component == k ? wanted_at(term, first * timestep, 3, k) : NAN;
  list->target[list->n++] = at;
  return CAV_OK;
}

// one marker a term; two where its target moves, at both ends
static cav_status add_targets(targets *list, const cav_problem *p, const charts *c, const double *q) {
  cav_state *state = cav_state_new(p->model);
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  double h = p->duration / c->steps;
  for (int i = 0; i < p->nterm && !status; i++) {
    const cav_term *term = &p->term[i];
    int place = term->sensor.type == CAV_SENSOR_FRAMEPOS || term->sensor.type == CAV_SENSOR_SUBTREECOM, first, last;
    if (!asks(term) || term->quantity != CAV_QUANTITY_SENSOR || !place || term->sensor.referred) continue;
    find_knots(c, p, term, &first, &last);
    int moves = term->nwaypoint > 1;
    status = add_target(list, p, term, first, moves ? first : last, state, q, h);
    if (!status && moves) status = add_target(list, p, term, last, last, state, q, h);
  }
  cav_state_free(state);
  return status;
}

// --- what every motion has ---

static void add_whole(charts *c, const cav_model *model, const cav_forces *forces, double weight) {
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
}

// what one unit of effort does to a hinge or slide; for all else the actuator's own force
static double force_of_effort(const cav_model *model, const cav_actuator *a, const char **unit) {
  *unit = "";
  if (a->transmission != CAV_TRANSMISSION_JOINT) return a->unit;
  cav_joint_type type = model->joint[a->target].type;
  if (type != CAV_JOINT_HINGE && type != CAV_JOINT_SLIDE) return a->unit;
  *unit = type == CAV_JOINT_HINGE ? "N m" : "N";
  return a->unit * a->gear[0];
}

static void add_each(charts *c, const cav_problem *problem, const cav_trajectory *trajectory,
                     const cav_forces *forces) {
  const cav_model *model = problem->model;
  for (int a = 0; a < model->nu; a++) {
    double range[2];
    const char *unit;
    double scale = force_of_effort(model, &model->actuator[a], &unit);
    cav_actuator_effort_range(model, a, range);
    int back = scale < 0; // a negative gear turns the range over
    double *value = add(c, "Efforts", model->actuator[a].name, unit, scale * range[back], scale * range[!back]);
    c->series[c->n - 1].share = 1;
    for (int t = 0; t < c->nknot; t++) value[t] = scale * forces->control[t * model->nu + a];
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

// whether a measure says how natural a motion looks: from jerk to asymmetry
static int is_manner(const cav_quality_rule *rule) {
  return rule->offset >= offsetof(cav_quality, jerk) && rule->offset <= offsetof(cav_quality, asymmetry);
}

// a line for each measure of quality, in words apart from those of the certificate; alone: those that it does not have
static int quality_lines(const cav_quality *quality, int alone, quality_text text[QUALITIES], cav_view_line *line) {
  int n, told = 0;
  const cav_quality_rule *rule = cav_quality_rules(&n);
  assert(n == QUALITIES);
  for (int i = 0; i < n; i++) {
    if (alone && (!is_manner(&rule[i]) || isnan(*(const double *)((const char *)quality + rule[i].offset)))) continue;
    double x = *(const double *)((const char *)quality + rule[i].offset);
    snprintf(text[i].label, sizeof text[i].label, "%s, quality", rule[i].name);
    for (char *c = text[i].label; *c; c++)
      if (*c == '_') *c = ' ';
    snprintf(text[i].value, sizeof text[i].value, "%.3g %s", x, rule[i].unit);
    line[told++] = (cav_view_line){text[i].label, text[i].value, isfinite(rule[i].bar) ? x <= rule[i].bar : -1};
  }
  return told;
}

// --- the page ---

cav_model *cav_page_drawn(const cav_problem *p, char undrawn[CAV_PAGE_UNDRAWN]) {
  *undrawn = 0;
  if (!p->model_path) return NULL;
  cav_error error = {0};
  cav_load_options options = cav_load_options_default();
  options.visual = options.overlaps = 1;
  options.floating = p->floating;
  cav_model *drawn = cav_model_load_with(p->model_path, &options, &error);
  int same = drawn && drawn->nbody <= p->model->nbody;
  for (int i = 0; same && i < drawn->nbody; i++) same = !strcmp(drawn->body[i].name, p->model->body[i].name);
  if (same) return drawn;
  snprintf(undrawn, CAV_PAGE_UNDRAWN, "by what collides alone: %.400s",
           drawn ? "the problem's scene changes the order of bodies" : error.text);
  cav_model_free(drawn);
  return NULL;
}

// what a motion's page points at
typedef struct parts {
  cav_model *drawn;
  char undrawn[CAV_PAGE_UNDRAWN];
  charts charts;
  targets targets;
  int *nforce;
  cav_view_force *force;
  cav_certificate_line told[CAV_CERTIFICATE_LINES];
  cav_view_line line[CAV_CERTIFICATE_LINES + 4 + QUALITIES];
  char seconds[64], title[300];
  quality_text quality[QUALITIES];
} parts;

static void free_page(parts *page) {
  cav_model_free(page->drawn);
  free(page->charts.series);
  free(page->charts.value);
  free(page->targets.target);
  free(page->nforce);
  free(page->force);
}

static cav_status make_page(parts *page, const cav_page_motion *m) {
  const cav_problem *p = m->problem;
  size_t most = (size_t)(5 + p->model->nu + p->model->njoint + 3 * p->nterm), nknot = (size_t)m->trajectory->nknot;
  page->charts.nknot = m->trajectory->nknot;
  page->charts.steps = (m->trajectory->nknot - 1) / m->periods;
  page->charts.series = calloc(most, sizeof *page->charts.series);
  page->charts.value = calloc(2 * most * nknot, sizeof *page->charts.value);
  page->targets.target = calloc((size_t)(2 * p->nterm) + 1, sizeof *page->targets.target);
  page->nforce = calloc(nknot, sizeof *page->nforce);
  page->force = calloc((size_t)m->forces->nforce + 1, sizeof *page->force);
  if (!page->charts.series || !page->charts.value || !page->targets.target || !page->nforce || !page->force)
    return CAV_NO_MEMORY;
  page->charts.wanted = page->charts.value + most * nknot;
  page->drawn = cav_page_drawn(p, page->undrawn);
  return CAV_OK;
}

// contacts that can be seen: a ten thousandth of the weight or more
static void take_forces(parts *page, const cav_model *model, const cav_forces *forces, double weight) {
  cav_view_force *to = page->force;
  for (int i = 0; i < forces->nforce; i++) {
    const cav_contact_force *from = &forces->force[i];
    const double *f = from->force;
    if (!(sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) > 1e-4 * weight)) continue;
    *to = (cav_view_force){
        .friction = from->friction, .link1 = model->geom[from->geom1].link, .link2 = model->geom[from->geom2].link};
    memcpy(to->pos, from->pos, sizeof to->pos);
    memcpy(to->force, from->force, sizeof to->force);
    memcpy(to->normal, from->normal, sizeof to->normal);
    page->nforce[from->knot]++;
    to++;
  }
}

static cav_status fill_page(parts *page, const cav_page_motion *m, int alone, cav_view_input *input) {
  const cav_problem *p = m->problem;
  const double *g = p->model->gravity;
  double weight = p->model->mass * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  add_whole(&page->charts, p->model, m->forces, weight > 0 ? weight : 1);
  cav_status status = add_asked(&page->charts, p, m->trajectory->q);
  if (!status) status = add_targets(&page->targets, p, &page->charts, m->trajectory->q);
  add_each(&page->charts, p, m->trajectory, m->forces);
  take_forces(page, p->model, m->forces, weight);
  snprintf(page->title, sizeof page->title, "%.140s on %.140s", p->name, p->model->name);
  int nline = m->verdict ? verdict_lines(m->verdict, page->told, page->line, page->seconds) : 0;
  if (m->quality) nline += quality_lines(m->quality, alone, page->quality, page->line + nline);
  if (*page->undrawn) page->line[nline++] = (cav_view_line){"drawn", page->undrawn, -1};
  *input = (cav_view_input){.model = p->model,
                            .drawn = page->drawn,
                            .title = page->title,
                            .label = m->label,
                            .nknot = m->trajectory->nknot,
                            .timestep = m->trajectory->timestep,
                            .q = m->trajectory->q,
                            .goal = has_goal(p) ? p->q_goal : NULL,
                            .nforce = page->nforce,
                            .force = page->force,
                            .ntarget = page->targets.n,
                            .target = page->targets.target,
                            .nseries = page->charts.n,
                            .series = page->charts.series,
                            .nline = nline,
                            .line = page->line};
  return status;
}

cav_status cav_page_write(const char *path, int n, const cav_page_motion *motion, cav_error *error) {
  parts page[2] = {0};
  cav_view_input input[2];
  assert(n == 1 || n == 2);
  cav_status status = CAV_OK;
  for (int i = 0; i < n && !status; i++) {
    status = make_page(&page[i], &motion[i]);
    if (!status) status = fill_page(&page[i], &motion[i], n == 1, &input[i]);
    if (status) cav_file_fail(error, status, 0, "%s: no charts of the motion (%s)", path, cav_status_name(status));
  }
  if (!status) status = cav_view_write(path, n, input, error);
  for (int i = 0; i < n; i++) free_page(&page[i]);
  return status;
}
