/// Targets that exclude each other: two of one thing at one knot, one at the start that the start does not have, one
/// outside the range of its joint.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"

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
  return CAV_OK;
}
