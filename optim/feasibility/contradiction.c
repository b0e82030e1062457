/// Targets that exclude each other: two of one thing at one knot, one at the start that the start does not have, one
/// outside the range of its joint.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"
#include "rotation.h"
#include "transcription.h"

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
  cav_impossible(e, CAV_CONDITION_RANGE, r, "Move the target into the range, or check the range in the model.",
                 "%s, but its range is %.4g to %.4g", what, joint->range[0], joint->range[1]);
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
    if (e->found[i].term == r->term) return 1;
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
  examine_start_readings(e);
  return CAV_OK;
}
