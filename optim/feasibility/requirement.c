/// What a problem requires at its knots: intervals of points, centres of mass and coordinates, from constraints and from
/// costs with a tolerance. Orientations, rates and forces are not collected, nor is what is read in a frame that moves.
/// Of long horizons a few hundred knots are looked at.
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"

static const double near_knot = 1e-6; // of a step
enum { MOST_KNOTS = 256 };            // of a window

void cav_requirement_window(const cav_examination *e, const cav_term *term, int *first, int *last) {
  double h = e->problem->timestep, end = (e->nknot - 1) * h, to = fmin(term->to < 0 ? end : term->to, end);
  double from = fmin(term->from < 0 ? end : term->from, end);
  *first = (int)ceil(from / h - near_knot);
  *last = (int)floor(to / h + near_knot);
  // one instant, or a window between two knots: the knot nearest to its middle
  if (to - from < 1e-9 || *first > *last) *first = *last = (int)lround((from + to) / (2 * h));
}

int cav_requirement_stride(const cav_examination *e) { return e->nknot / MOST_KNOTS + 1; }

double cav_requirement_time(const cav_examination *e, int knot) {
  return knot * e->problem->timestep * fmax(e->longest, 1);
}

static cav_status add(cav_examination *e, const cav_requirement *r) {
  if (e->n == e->room) {
    int room = e->room ? 2 * e->room : 64;
    cav_requirement *larger = realloc(e->requirement, (size_t)room * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    e->requirement = larger;
    e->room = room;
  }
  e->requirement[e->n++] = *r;
  return CAV_OK;
}

/// The interval of one value.
static void bound(const cav_term *term, double target, double tolerance, double *low, double *high) {
  int range = term->use == CAV_USE_RANGE;
  *low = target + (range ? term->lower : 0) - tolerance;
  *high = target + (range ? term->upper : 0) + tolerance;
}

int cav_requirement_interval(const cav_examination *e, const cav_term *term, int knot, double usual, double low[3],
                             double high[3]) {
  double target[CAV_SENSOR_DIM_MAX], tolerance = cav_term_tolerance(e->problem, term, usual);
  int dim = term->sensor.dim;
  if (isinf(tolerance) || dim > 3 || term->sensor.cutoff > 0 || term->sensor.referred) return 0;
  cav_term_target(term, knot * e->problem->timestep, dim, target);
  for (int k = 0; k < 3; k++) {
    low[k] = -INFINITY, high[k] = INFINITY;
    if (k < dim && (term->component < 0 || term->component == k)) bound(term, target[k], tolerance, &low[k], &high[k]);
  }
  return 1;
}

/// The object of a position sensor in the world; 0 if it is none of those that are collected.
static int is_position(const cav_model *m, const cav_sensor *s, cav_requirement *r) {
  cav_sensor_type type = s->type;
  if (s->cutoff > 0) return 0;
  if (type == CAV_SENSOR_JOINTPOS) {
    r->kind = CAV_REQUIRE_COORDINATE, r->object = s->object;
    return 1;
  }
  if (type == CAV_SENSOR_SUBTREECOM) {
    r->kind = CAV_REQUIRE_CENTRE, r->object = s->object;
    return 1;
  }
  if (type != CAV_SENSOR_FRAMEPOS || s->referred) return 0;
  r->kind = CAV_REQUIRE_POINT;
  r->object = cav_object_link(m, s->object_type, s->object);
  if (s->object_type == CAV_OBJECT_SITE) copy3(r->point, m->site[s->object].pos);
  if (s->object_type == CAV_OBJECT_GEOM) copy3(r->point, m->geom[s->object].pos);
  if (s->object_type == CAV_OBJECT_XBODY) copy3(r->point, m->body[s->object].pos);
  if (s->object_type == CAV_OBJECT_BODY) cav_body_centre(&m->body[s->object], r->point);
  return 1;
}

static cav_status sensor_requirement(cav_examination *e, const cav_term *term, cav_requirement r) {
  double target[CAV_SENSOR_DIM_MAX];
  if (!is_position(e->model, &term->sensor, &r)) return CAV_OK;
  int hinge = r.kind == CAV_REQUIRE_COORDINATE && e->model->joint[r.object].type == CAV_JOINT_HINGE;
  double tolerance = cav_term_tolerance(e->problem, term, hinge ? CAV_WITHIN_ANGLE : CAV_WITHIN_LENGTH);
  if (isinf(tolerance)) return CAV_OK;
  cav_term_target(term, r.knot * e->problem->timestep, term->sensor.dim, target);
  for (int k = 0; k < 3; k++) {
    r.low[k] = -INFINITY, r.high[k] = INFINITY;
    if (k < term->sensor.dim && (term->component < 0 || term->component == k))
      bound(term, target[k], tolerance, &r.low[k], &r.high[k]);
  }
  return add(e, &r);
}

static cav_status posture_requirement(cav_examination *e, const cav_term *term, cav_requirement r, double *q) {
  const cav_model *m = e->model;
  const double *target = e->problem->q_goal;
  if (term->target) {
    cav_term_target(term, r.knot * e->problem->timestep, m->nq, q);
    target = q;
  }
  if (term->use == CAV_USE_RANGE && term->lower > term->upper) return CAV_OK;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    double tolerance =
        cav_term_tolerance(e->problem, term, joint->type == CAV_JOINT_HINGE ? CAV_WITHIN_ANGLE : CAV_WITHIN_LENGTH);
    int line = joint->type == CAV_JOINT_FREE, scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    if ((!line && !scalar) || !cav_problem_selects(m, term, joint->dof) || isinf(tolerance)) continue;
    r.kind = line ? CAV_REQUIRE_POINT : CAV_REQUIRE_COORDINATE;
    r.object = line ? joint->link : j;
    zero3(r.point);
    for (int k = 0; k < (line ? 3 : 1); k++) bound(term, target[joint->q + k], tolerance, &r.low[k], &r.high[k]);
    cav_status status = add(e, &r);
    if (status) return status;
  }
  return CAV_OK;
}

/// By knot, then by term; stable, as a term names its values in order.
static int by_knot(const void *a, const void *b) {
  const cav_requirement *x = a, *y = b;
  if (x->knot != y->knot) return x->knot < y->knot ? -1 : 1;
  if (x->term != y->term) return x->term < y->term ? -1 : 1;
  return x->object < y->object ? -1 : x->object > y->object;
}

cav_status cav_requirements_collect(cav_examination *e) {
  const cav_problem *p = e->problem;
  double *q = malloc((size_t)e->model->nq * sizeof *q);
  cav_status status = q ? CAV_OK : CAV_NO_MEMORY;
  int stride = cav_requirement_stride(e);
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    int sensor = term->quantity == CAV_QUANTITY_SENSOR, first, last;
    if (!sensor && term->quantity != CAV_QUANTITY_CONFIGURATION) continue;
    cav_requirement_window(e, term, &first, &last);
    for (int t = first; t <= last && !status; t++) {
      if (t % stride && t != first && t != last) continue;
      cav_requirement r = {.term = i, .knot = t};
      status = sensor ? sensor_requirement(e, term, r) : posture_requirement(e, term, r, q);
    }
  }
  free(q);
  if (!status && e->n > 0) qsort(e->requirement, (size_t)e->n, sizeof *e->requirement, by_knot);
  return status;
}

// ---------------------------------------------------------------- words

/// "x 1.5", "z at least 2": what is wanted of one value.
static int tell_value(char *out, size_t size, const char *axis, double low, double high, int range) {
  if (isinf(low) && isinf(high)) return 0;
  if (isinf(high)) return snprintf(out, size, " %s%sat least %.4g", axis, *axis ? " " : "", low);
  if (isinf(low)) return snprintf(out, size, " %s%sat most %.4g", axis, *axis ? " " : "", high);
  double middle = (low + high) / 2;
  if (range && high - low > 1e-3) return snprintf(out, size, " %s%s%.4g to %.4g", axis, *axis ? " " : "", low, high);
  if (high - low < 1e-4) return snprintf(out, size, " %s%s%.4g", axis, *axis ? " " : "", middle);
  return snprintf(out, size, " %s%s%.4g (to %.2g)", axis, *axis ? " " : "", middle, (high - low) / 2);
}

void cav_requirement_sensor_words(const cav_examination *e, const cav_term *term, int knot, char *out, size_t size) {
  const cav_sensor *s = &term->sensor;
  const char *kind = cav_object_kind_of(s->object_type)->text;
  char buffer[48];
  int named = *term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name);
  snprintf(out, size, "%s%.48s%s%s of %s '%.48s' at %.4g s", named ? "'" : "", named ? term->name : "",
           named ? "' wants a " : "", cav_sensor_rule_of(s->type)->name, kind,
           cav_name_or(cav_object_name(e->model, s->object_type, s->object), kind, s->object, buffer),
           knot * e->problem->timestep);
}

void cav_requirement_words(const cav_examination *e, const cav_requirement *r, char *out, size_t size) {
  static const char *const axis[] = {"x", "y", "z"};
  const cav_model *m = e->model;
  const cav_term *term = &e->problem->term[r->term];
  char subject[100], buffer[48];
  if (r->kind == CAV_REQUIRE_COORDINATE) {
    snprintf(subject, sizeof subject, "joint '%.48s'",
             cav_name_or(m->joint[r->object].name, "joint", r->object, buffer));
  } else if (term->quantity != CAV_QUANTITY_SENSOR) {
    int body = m->link[r->object].body;
    snprintf(subject, sizeof subject, "body '%.48s'", cav_name_or(m->body[body].name, "body", body, buffer));
  } else {
    const char *kind = cav_object_kind_of(term->sensor.object_type)->text;
    snprintf(subject, sizeof subject, "%s%s '%.48s'", r->kind == CAV_REQUIRE_CENTRE ? "the centre of mass of " : "",
             kind,
             cav_name_or(cav_object_name(m, term->sensor.object_type, term->sensor.object), kind, term->sensor.object,
                         buffer));
  }
  int named = *term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name);
  int n = named ? snprintf(out, size, "'%.48s' wants %s at", term->name, subject)
                : snprintf(out, size, "%s wanted at", subject);
  for (int k = 0; k < 3 && n < (int)size; k++)
    if (r->kind != CAV_REQUIRE_COORDINATE || k == 0)
      n += tell_value(out + n, size - (size_t)n, r->kind == CAV_REQUIRE_COORDINATE ? "" : axis[k], r->low[k],
                      r->high[k], term->use == CAV_USE_RANGE);
  if (n < (int)size) snprintf(out + n, size - (size_t)n, " at %.4g s", r->knot * e->problem->timestep);
}
