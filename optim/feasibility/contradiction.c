/// Targets that exclude each other: two of one thing or of one reading at one knot, one at the start that the start does not
/// have, one outside the range of its joint.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"
#include "quantity.h"
#include "rotation.h"

static const double slack = 1e-6; // m or rad, beyond tolerances: what a certificate leaves room for

static int is_same_thing(const cav_requirement *a, const cav_requirement *b) {
  return a->kind == b->kind && a->object == b->object &&
         (a->kind != CAV_REQUIRE_POINT || !memcmp(a->point, b->point, sizeof a->point));
}

/// Whether the intervals of one of the values have nothing in common.
static int is_disjoint(const cav_requirement *a, const cav_requirement *b) {
  for (int k = 0; k < (a->kind == CAV_REQUIRE_COORDINATE ? 1 : 3); k++)
    if (a->low[k] > b->high[k] + slack || b->low[k] > a->high[k] + slack) return 1;
  return 0;
}

static void examine_pair(cav_examination *e, const cav_requirement *a, const cav_requirement *b) {
  char one[160], other[160];
  if (!is_same_thing(a, b) || !is_disjoint(a, b)) return;
  cav_requirement_words(e, a, one, sizeof one);
  cav_requirement_words(e, b, other, sizeof other);
  cav_impossible(e, CAV_CONDITION_CONTRADICTION, a, "Drop or loosen one of the two, or set them apart in time.",
                 "%s, but %s", one, other);
}

/// What a requirement is about, as the start has it.
static void read_start(const cav_examination *e, const cav_requirement *r, double value[3]) {
  const cav_model *m = e->model;
  zero3(value);
  if (r->kind == CAV_REQUIRE_COORDINATE) value[0] = e->problem->q_start[m->joint[r->object].q];
  if (r->kind == CAV_REQUIRE_POINT)
    transform(value, e->start->link[r->object].pos, e->start->link[r->object].rotation, r->point);
  if (r->kind != CAV_REQUIRE_CENTRE) return;
  cav_sensor centre = {
      .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = r->object, .dim = 3};
  cav_sensor_read(m, e->start, &centre, value);
}

static void examine_start(cav_examination *e, const cav_requirement *r) {
  cav_requirement has = *r;
  char what[160];
  if (r->knot > 0 || !cav_start_is_given(e->problem)) return;
  read_start(e, r, has.low);
  copy3(has.high, has.low);
  if (!is_disjoint(r, &has)) return;
  cav_requirement_words(e, r, what, sizeof what);
  int one = r->kind == CAV_REQUIRE_COORDINATE;
  if (one)
    cav_impossible(e, CAV_CONDITION_CONTRADICTION, r, "Change <start>, or ask for it later.",
                   "%s, but the start has it at %.4g", what, has.low[0]);
  else
    cav_impossible(e, CAV_CONDITION_CONTRADICTION, r, "Change <start>, or ask for it later.",
                   "%s, but at the start it is at %.4g %.4g %.4g", what, has.low[0], has.low[1], has.low[2]);
}

static void examine_range(cav_examination *e, const cav_requirement *r) {
  char what[160];
  if (r->kind != CAV_REQUIRE_COORDINATE) return;
  const cav_joint *joint = &e->model->joint[r->object];
  const double room = slack + cav_joint_stop(joint);
  if (!joint->limited || (r->low[0] <= joint->range[1] + room && r->high[0] >= joint->range[0] - room)) return;
  cav_requirement_words(e, r, what, sizeof what);
  char cure[160] = "Move the target into the range, or check the range in the model.";
  // a number that was meant in degrees
  const double wanted = isinf(r->low[0]) ? r->high[0] : isinf(r->high[0]) ? r->low[0] : (r->low[0] + r->high[0]) / 2;
  const double turned = wanted * M_PI / 180, edge = 0.1;
  const int beyond = wanted < joint->range[0] - edge || wanted > joint->range[1] + edge;
  if (joint->type == CAV_JOINT_HINGE && beyond && turned >= joint->range[0] && turned <= joint->range[1])
    snprintf(cure, sizeof cure,
             "Targets are in radians, whatever <compiler angle> of the model says: %.4g degrees are %.4g.", wanted,
             turned);
  cav_impossible(e, CAV_CONDITION_RANGE, r, cure, "%s, but its range is %.4g to %.4g", what, joint->range[0],
                 joint->range[1]);
}

// ---------------------------------------------------------------- two of one reading

/// What verification takes for the tolerance of a goal on a reading, where its term gives none; 0: none.
static double usual_of(const cav_model *m, const cav_sensor *s) {
  static const double rate = 0.3, ratio = 0.1;
  const cav_sensor_stage stage = cav_sensor_rule_of(s->type)->stage;
  if (s->type == CAV_SENSOR_FRAMEXAXIS || s->type == CAV_SENSOR_FRAMEYAXIS || s->type == CAV_SENSOR_FRAMEZAXIS)
    return ratio;
  if (stage == CAV_READS_VELOCITY) return s->type == CAV_SENSOR_SUBTREEANGMOM ? 0 : rate;
  if (stage != CAV_READS_POSITION || s->type == CAV_SENSOR_MAGNETOMETER) return 0;
  const int turns = s->object_type == CAV_OBJECT_JOINT && m->joint[s->object].type != CAV_JOINT_SLIDE;
  return s->dim == 4 || turns ? CAV_WITHIN_ANGLE : CAV_WITHIN_LENGTH;
}

static int is_same_reading(const cav_sensor *a, const cav_sensor *b) {
  return a->type == b->type && a->object_type == b->object_type && a->object == b->object && a->cutoff == b->cutoff &&
         a->referred == b->referred &&
         (!a->referred || (a->reference_type == b->reference_type && a->reference == b->reference));
}

/// Whether two terms on one reading, which is known there, exclude each other at a knot.
static int excludes(const cav_examination *e, const cav_term *a, const cav_term *b, int knot) {
  const cav_problem *p = e->problem;
  const cav_sensor *s = &a->sensor;
  const double usual = usual_of(e->model, s), time = knot * p->timestep, ta = cav_term_tolerance(p, a, usual),
               tb = cav_term_tolerance(p, b, usual);
  double one[CAV_SENSOR_DIM_MAX] = {1}, other[CAV_SENSOR_DIM_MAX] = {1}, way[3], square = 0;
  const int vector = a->component < 0 && b->component < 0 && a->use != CAV_USE_RANGE && b->use != CAV_USE_RANGE;
  if (isinf(ta) || isinf(tb) || (s->dim == 4 && !vector)) return 0;
  if (a->target || s->dim < 4) cav_term_target(a, time, s->dim, one);
  if (b->target || s->dim < 4) cav_term_target(b, time, s->dim, other);
  if (s->dim == 4) {
    cav_rotation_between(one, other, way);
    return norm3(way) > ta + tb + slack;
  }
  for (int k = 0; k < s->dim; k++) {
    if ((a->component >= 0 && a->component != k) || (b->component >= 0 && b->component != k)) continue;
    const int ra = a->use == CAV_USE_RANGE, rb = b->use == CAV_USE_RANGE;
    const double low = one[k] + (ra ? a->lower : 0), high = one[k] + (ra ? a->upper : 0);
    const double least = other[k] + (rb ? b->lower : 0), most = other[k] + (rb ? b->upper : 0);
    if (low - ta > most + tb + slack || least - tb > high + ta + slack) return 1;
    square += (one[k] - other[k]) * (one[k] - other[k]);
  }
  return vector && sqrt(square) > ta + tb + slack;
}

/// What a term wants of its sensor at a knot, in numbers.
static void tell_wanted(const cav_term *term, double time, char *out, size_t size) {
  double x[CAV_SENSOR_DIM_MAX] = {1};
  const int dim = term->sensor.dim;
  if (term->use == CAV_USE_RANGE && !term->target && isfinite(term->lower) && isfinite(term->upper))
    snprintf(out, size, "%.4g to %.4g", term->lower, term->upper);
  else if (term->use == CAV_USE_RANGE && !term->target)
    snprintf(out, size, "at %s %.4g", isinf(term->upper) ? "least" : "most",
             isinf(term->upper) ? term->lower : term->upper);
  else {
    if (term->target || dim < 4) cav_term_target(term, time, dim, x);
    size_t n = 0;
    for (int k = 0; k < dim && n < size; k++)
      if (dim == 4 || term->component < 0 || term->component == k)
        n += (size_t)snprintf(out + n, size - n, "%s%.4g", n ? " " : "", x[k]);
  }
}

/// Last knot at which a reading is measured: of forces that of a motion that closes at rest is the last one.
static int last_measured(const cav_examination *e, const cav_sensor *s) {
  const int late = cav_sensor_rule_of(s->type)->stage == CAV_READS_ACCELERATION;
  return e->nknot - 1 - (late && (!e->problem->close_at_rest || e->problem->cycle.on));
}

static void examine_readings_of_two(cav_examination *e, int i, int k) {
  const cav_term *a = &e->problem->term[i], *b = &e->problem->term[k];
  int first, last, begin, end;
  const cav_requirement at = {.term = i};
  cav_requirement_window(e, a, &first, &last);
  cav_requirement_window(e, b, &begin, &end);
  if (begin > first) first = begin;
  if (end < last) last = end;
  if (last > last_measured(e, &a->sensor)) last = last_measured(e, &a->sensor);
  for (int t = first; t <= last; t++) {
    if ((t % cav_requirement_stride(e) && t != first && t != last) || !excludes(e, a, b, t)) continue;
    char one[160], other[160], wants[80], but[80];
    const double time = t * e->problem->timestep;
    cav_requirement_sensor_words(e, a, t, one, sizeof one);
    tell_wanted(a, time, wants, sizeof wants);
    tell_wanted(b, time, but, sizeof but);
    const int named = *b->name && strcmp(b->name, cav_quantity_rule_of(b->quantity)->name);
    snprintf(other, sizeof other, "%s%.60s%s", named ? "'" : "", named ? b->name : "another term", named ? "'" : "");
    cav_impossible(e, CAV_CONDITION_CONTRADICTION, &at, "Drop or loosen one of the two, or set them apart in time.",
                   "%s to be %s, but %s wants %s then", one, wants, other, but);
    return;
  }
}

/// Whether the requirements of a term tell of its reading already.
static int is_required(const cav_examination *e, int term) {
  for (int i = 0; i < e->n; i++)
    if (e->requirement[i].term == term) return 1;
  return 0;
}

static void examine_same_readings(cav_examination *e) {
  const cav_problem *p = e->problem;
  for (int i = 0; i < p->nterm; i++) {
    if (p->term[i].quantity != CAV_QUANTITY_SENSOR || is_required(e, i)) continue;
    for (int k = i + 1; k < p->nterm; k++)
      if (p->term[k].quantity == CAV_QUANTITY_SENSOR && is_same_reading(&p->term[i].sensor, &p->term[k].sensor))
        examine_readings_of_two(e, i, k);
  }
}

/// Whether a term asks for a place or an orientation that is read at the start and that no requirement tells: in a frame of
/// another body, or turned.
static int is_asked_of_start(const cav_examination *e, int term) {
  const cav_term *at = &e->problem->term[term];
  int first, last, turn = at->sensor.type == CAV_SENSOR_FRAMEQUAT;
  if (at->quantity != CAV_QUANTITY_SENSOR || (!turn && at->sensor.type != CAV_SENSOR_FRAMEPOS)) return 0;
  // of an orientation all of it: a component's interval is about one axis
  if (at->sensor.cutoff > 0 || (turn && (at->component >= 0 || at->use == CAV_USE_RANGE))) return 0;
  for (int i = 0; i < e->n; i++)
    if (e->requirement[i].term == term) return 0;
  cav_requirement_window(e, at, &first, &last);
  return first == 0;
}

/// How far a reading at the start is from what a term asks for, beyond its tolerance.
static double missed_at_start(const cav_examination *e, const cav_term *term, double reading[4]) {
  const int turn = term->sensor.dim == 4;
  double target[CAV_SENSOR_DIM_MAX], phi[3], most = 0;
  const double tolerance = cav_term_tolerance(e->problem, term, turn ? CAV_WITHIN_ANGLE : CAV_WITHIN_LENGTH);
  cav_sensor_read(e->model, e->start, &term->sensor, reading);
  cav_term_target(term, 0, term->sensor.dim, target);
  if (turn) {
    if (!term->target) target[0] = 1;
    cav_rotation_between(target, reading, phi);
    return norm3(phi) - tolerance;
  }
  for (int k = 0; k < 3; k++) {
    if (term->component >= 0 && term->component != k) continue;
    const double off = reading[k] - target[k];
    most = fmax(most, term->use == CAV_USE_RANGE ? fmax(term->lower - off, off - term->upper) : fabs(off));
  }
  return most - tolerance;
}

static void examine_start_readings(cav_examination *e) {
  static const char help[] = "Change <start>, or ask for it later.";
  if (!cav_start_is_given(e->problem)) return;
  for (int i = 0; i < e->problem->nterm; i++) {
    const cav_term *term = &e->problem->term[i];
    const cav_requirement at = {.term = i};
    double reading[4], off;
    char what[200];
    if (!is_asked_of_start(e, i) || !((off = missed_at_start(e, term, reading)) > slack)) continue;
    cav_requirement_sensor_words(e, term, 0, what, sizeof what);
    if (term->sensor.dim == 4)
      cav_impossible(e, CAV_CONDITION_CONTRADICTION, &at, help,
                     "%s, but the start is turned %.4g rad beyond its tolerance", what, off);
    else
      cav_impossible(e, CAV_CONDITION_CONTRADICTION, &at, help,
                     "%s, but at the start it reads %.4g %.4g %.4g, %.4g m beyond its tolerance", what, reading[0],
                     reading[1], reading[2], off);
  }
}

/// A term speaks at many knots: one proof for each is enough.
static int is_known(const cav_examination *e, const cav_requirement *r) {
  for (int i = 0; i < e->nfound; i++)
    if (e->found[i].said.term == r->term) return 1;
  return 0;
}

cav_status cav_examine_contradictions(cav_examination *e) {
  for (int i = 0; i < e->n; i++) {
    const cav_requirement *r = &e->requirement[i];
    if (!is_known(e, r)) examine_start(e, r);
    if (!is_known(e, r)) examine_range(e, r);
    for (int k = i - 1; k >= 0 && e->requirement[k].knot == r->knot && !is_known(e, r); k--)
      examine_pair(e, &e->requirement[k], r);
  }
  examine_same_readings(e);
  examine_start_readings(e);
  return CAV_OK;
}
