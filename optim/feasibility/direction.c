/// Directions that no joint moves in: what a planar robot is asked sideways, or a lift along the floor.
///
/// A coordinate along n of a point is what it is at the start if every joint between the point and the world is a slide
/// across n or a hinge about n: turning about n changes no coordinate along n, of points or of the axes of joints that
/// follow, so what holds of these axes in one posture holds in all. Of a centre of mass, if it holds for all its bodies; of an
/// axis of a body, slides do not count.
#include <math.h>
#include <stdio.h>

#include "feasibility.h"
#include "math3.h"
#include "objects.h"

static const double slack = 1e-3; // m: rounding, and what limits give way
static const double right = 1e-9; // cosine of an angle that counts as right, sine of one that counts as none

/// Whether nothing moves a link along n.
static int is_still(const cav_examination *e, int link, const double n[3]) {
  const cav_model *m = e->model;
  for (; link > 0; link = m->link[link].parent) {
    for (int j = m->link[link].joint; j < m->link[link].joint + m->link[link].njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      const double *axis = e->start->axis + 6 * (size_t)joint->dof;
      double across[3];
      cross3(across, axis, n);
      int still = (joint->type == CAV_JOINT_SLIDE && fabs(dot3(axis + 3, n)) < right) ||
                  (joint->type == CAV_JOINT_HINGE && norm3(across) < right);
      if (!still) return 0;
    }
  }
  return 1;
}

/// Where what is required is at the start; 0: it moves along n.
static int read_still(const cav_examination *e, const cav_requirement *r, const double n[3], double at[3]) {
  const cav_model *m = e->model;
  if (r->kind == CAV_REQUIRE_POINT) {
    transform(at, e->start->link[r->object].pos, e->start->link[r->object].rotation, r->point);
    return is_still(e, r->object, n);
  }
  for (int i = r->object; i < m->nbody; i++)
    if (m->body[i].mass > 0 && cav_body_within(m, i, r->object) && !is_still(e, m->body[i].link, n)) return 0;
  cav_sensor s = {
      .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = r->object, .dim = 3};
  cav_sensor_read(m, e->start, &s, at);
  return 1;
}

static void examine_direction(cav_examination *e, const cav_requirement *r) {
  static const char *const axis[] = {"x", "y", "z"};
  for (int k = 0; k < 3; k++) {
    double n[3] = {k == 0, k == 1, k == 2}, at[3];
    if (!read_still(e, r, n, at)) continue;
    double off = fmax(r->low[k] - at[k], at[k] - r->high[k]);
    if (!(off > slack)) continue;
    char what[160];
    cav_requirement_words(e, r, what, sizeof what);
    cav_impossible(e, CAV_CONDITION_DISTANCE, r, "Give it a joint that way, or ask for a direction in which it moves.",
                   "%s, but no joint moves it along %s: it stays at %.4g, %.3g m off", what, axis[k],
                   fabs(at[k]) < slack ? 0 : at[k], off);
    return;
  }
}

/// An axis of a body keeps its component along n where all joints slide or turn about n.
static int is_unturned(const cav_examination *e, int link, const double n[3]) {
  const cav_model *m = e->model;
  for (; link > 0; link = m->link[link].parent) {
    for (int j = m->link[link].joint; j < m->link[link].joint + m->link[link].njoint; j++) {
      double across[3];
      cross3(across, e->start->axis + 6 * (size_t)m->joint[j].dof, n);
      int slide = m->joint[j].type == CAV_JOINT_SLIDE,
          about = m->joint[j].type == CAV_JOINT_HINGE && norm3(across) < right;
      if (!slide && !about) return 0;
    }
  }
  return 1;
}

static void examine_axis(cav_examination *e, int i) {
  static const char *const axis[] = {"x", "y", "z"};
  static const double usual = 0.1;
  const cav_term *term = &e->problem->term[i];
  const cav_sensor *s = &term->sensor;
  double low[3], high[3], at[CAV_SENSOR_DIM_MAX];
  int first, last;
  int looks =
      term->quantity == CAV_QUANTITY_SENSOR &&
      (s->type == CAV_SENSOR_FRAMEXAXIS || s->type == CAV_SENSOR_FRAMEYAXIS || s->type == CAV_SENSOR_FRAMEZAXIS);
  if (!looks) return;
  cav_requirement_window(e, term, &first, &last);
  if (!cav_requirement_interval(e, term, last, usual, low, high)) return;
  cav_sensor_read(e->model, e->start, s, at);
  for (int k = 0; k < 3; k++) {
    double n[3] = {k == 0, k == 1, k == 2}, off = fmax(low[k] - at[k], at[k] - high[k]);
    if (!(off > slack) || !is_unturned(e, cav_object_link(e->model, s->object_type, s->object), n)) continue;
    const cav_requirement r = {.term = i, .knot = last};
    char what[160];
    cav_requirement_sensor_words(e, term, last, what, sizeof what);
    cav_impossible(e, CAV_CONDITION_DISTANCE, &r, "Give it a joint that turns it so, or ask for another direction.",
                   "%s with %s %.3g off, but no joint turns it that way: it stays at %.3g", what, axis[k], off, at[k]);
    return;
  }
}

cav_status cav_examine_directions(cav_examination *e) {
  int before = e->nfound;
  for (int i = 0; i < e->n && e->nfound == before; i++) {
    const cav_requirement *r = &e->requirement[i];
    // what is fixed to the world is told as such
    if (r->kind == CAV_REQUIRE_COORDINATE || (r->kind == CAV_REQUIRE_POINT && r->object == 0)) continue;
    examine_direction(e, r);
  }
  for (int i = 0; i < e->problem->nterm && e->nfound == before; i++) examine_axis(e, i);
  return CAV_OK;
}
