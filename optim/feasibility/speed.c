/// What limits of speeds allow: the rate of a dof at a knot, and ways by then.
///
/// The rate at a knot is the way of the step before it over its time, so that of a joint with a range is at most the
/// range over a step; terms on rates bound it further. From the start on these give an interval of every joint at every
/// knot; and a point comes no farther than the sum of what each dof above it can move it, its rate times the largest
/// distance from its axis. A limit of the speed of a centre of mass bounds its own way, but for a fifth: it is read at
/// one end of a step.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "feasibility.h"
#include "math3.h"
#include "problem_file.h"
#include "quantity.h"
#include "transcription.h"

static const double usual_rate = 0.3; // tolerance of a rate, m/s or rad/s
static const double slack = 1e-6;     // of rates and ways, relative and in their unit
static const double give = 0.01;      // rad or m that a limit can give way at either end
static const double read_late = 1.2;

/// Rates of all dofs at all knots.
typedef struct rates {
  double *low, *high; ///< [nknot*nv]
  int *term;          ///< [nknot*nv] that bounded it last; -1: the range
  double longest, shortest;
} rates;

static const char *unit_of(const cav_model *m, int d) {
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  int line = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && d < joint->dof + 3);
  return line ? "m/s" : "rad/s";
}

static void tell_rate(cav_examination *e, int i, int t, int d, double wanted, const rates *r, double can) {
  const cav_model *m = e->model;
  const cav_term *term = &e->problem->term[i];
  const cav_requirement at = {.term = i, .knot = t};
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  int other = r->term[t * m->nv + d];
  char name[48], who[60] = "";
  const char *unit = unit_of(m, d);
  if (*term->name) snprintf(who, sizeof who, "'%.48s' wants ", term->name);
  if (other < 0)
    cav_impossible(e, CAV_CONDITION_RANGE, &at, "A lower speed, or a shorter timestep.",
                   "%sjoint '%.48s' at %.4g %s at %.4g s, but in one step of %.3g s its range of %.3g allows %.3g %s",
                   who, cav_name_or(joint->name, "joint", m->dof[d].joint, name), wanted, unit,
                   t * e->problem->timestep, e->problem->timestep, joint->range[1] - joint->range[0], can, unit);
  else
    cav_impossible(e, CAV_CONDITION_CONTRADICTION, &at, "Drop or loosen one of the two, or set them apart in time.",
                   "%sjoint '%.48s' at %.4g %s at %.4g s, but '%.48s' bounds it by %.3g %s", who,
                   cav_name_or(joint->name, "joint", m->dof[d].joint, name), wanted, unit, t * e->problem->timestep,
                   e->problem->term[other].name, can, unit);
}

/// One more bound of a dof's rate at a knot, told where it cannot be; kept 0: looked at alone.
static void meet(cav_examination *e, rates *r, int i, int t, int d, double low, double high, int kept) {
  size_t at = (size_t)(t * e->model->nv + d);
  if (t == 0 || e->nfound > 0 || (!kept && r->term[at] >= 0)) return;
  double room = slack * (1 + fabs(r->low[at]) + fabs(r->high[at]));
  if (low > r->high[at] + room) {
    tell_rate(e, i, t, d, low, r, r->high[at]);
  } else if (high < r->low[at] - room) {
    tell_rate(e, i, t, d, high, r, r->low[at]);
  }
  if (!kept) return;
  if (low > r->low[at] || high < r->high[at]) r->term[at] = i;
  r->low[at] = fmax(r->low[at], low), r->high[at] = fmin(r->high[at], high);
}

static void bound_by_term(cav_examination *e, rates *r, int i) {
  const cav_model *m = e->model;
  const cav_term *term = &e->problem->term[i];
  int first, last, rate = term->quantity == CAV_QUANTITY_VELOCITY;
  int joint = term->quantity == CAV_QUANTITY_SENSOR && term->sensor.type == CAV_SENSOR_JOINTVEL;
  if (!rate && !joint) return;
  double tolerance = cav_term_tolerance(e->problem, term, usual_rate), low[3], high[3];
  cav_requirement_window(e, term, &first, &last);
  for (int t = first; t <= last && t < e->nknot && isfinite(tolerance); t++) {
    // a sensor reads the rate of the step before a knot or after it: what a window has on both sides is kept
    if (joint && cav_requirement_interval(e, term, t, usual_rate, low, high))
      meet(e, r, i, t, m->joint[term->sensor.object].dof, low[0], high[0], t > first);
    for (int d = 0; d < m->nv && rate; d++) {
      if (!cav_problem_selects(m, term, d)) continue;
      double target = term->target && !term->nwaypoint ? term->target[d] : 0;
      if (term->nwaypoint) continue;
      int range = term->use == CAV_USE_RANGE;
      meet(e, r, i, t, d, target + (range ? term->lower : 0) - tolerance,
           target + (range ? term->upper : 0) + tolerance, 1);
    }
  }
}

/// How far a joint can go at most, its stops included.
static double width_of(const cav_joint *joint) {
  return joint->range[1] - joint->range[0] + 2 * (give + cav_joint_stop(joint));
}

static cav_status collect(cav_examination *e, rates *r) {
  const cav_model *m = e->model;
  size_t n = (size_t)e->nknot * (size_t)m->nv;
  r->low = malloc((2 * n + 1) * sizeof *r->low);
  r->term = malloc((n + 1) * sizeof *r->term);
  if (!r->low || !r->term) return CAV_NO_MEMORY;
  r->high = r->low + n;
  for (size_t i = 0; i < n; i++) {
    const cav_joint *joint = &m->joint[m->dof[i % (size_t)m->nv].joint];
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    r->high[i] = scalar && joint->limited ? width_of(joint) / r->shortest : INFINITY;
    r->low[i] = -r->high[i];
    r->term[i] = -1;
  }
  for (int i = 0; i < e->problem->nterm; i++) bound_by_term(e, r, i);
  return CAV_OK;
}

/// The way that a rate gives in a step of a free or stated length: the farther one.
static double forward(const rates *r, double rate) { return rate * (rate > 0 ? r->longest : r->shortest); }

/// The interval of a joint from the start on, met with what is required of it.
static void examine_joint(cav_examination *e, const rates *r, int j) {
  const cav_joint *joint = &e->model->joint[j];
  double low = e->problem->q_start[joint->q], high = low, start = low;
  int at = 0;
  for (int t = 0; t < e->nknot; t++) {
    size_t rate = (size_t)(t * e->model->nv + joint->dof);
    if (t > 0) high += forward(r, r->high[rate]), low -= forward(r, -r->low[rate]);
    while (at < e->n && e->requirement[at].knot < t) at++;
    for (int i = at; i < e->n && e->requirement[i].knot == t; i++) {
      const cav_requirement *q = &e->requirement[i];
      if (q->kind != CAV_REQUIRE_COORDINATE || q->object != j) continue;
      double over = fmax(q->low[0] - high, low - q->high[0]), room = slack * (1 + t);
      if (over > room && t > 0) {
        char what[160];
        const char *unit = joint->type == CAV_JOINT_HINGE ? "rad" : "m";
        cav_requirement_words(e, q, what, sizeof what);
        const double stop = cav_joint_stop(joint);
        if (joint->limited) low = fmax(low, joint->range[0] - stop), high = fmin(high, joint->range[1] + stop);
        cav_impossible(
            e, CAV_CONDITION_ENERGY, q, "More time, a nearer target, or a looser limit of speed.",
            "%s, too far for its speed: limits of speed leave %.4g to %.4g %s by then, from %.4g at the start", what,
            low, high, unit, start);
        const double way = q->low[0] > high ? q->low[0] - start : start - q->high[0];
        cav_impossible_fraction(e, (q->low[0] > high ? high - start : start - low) / way);
        return;
      }
      low = fmax(low, q->low[0]), high = fmin(high, q->high[0]);
    }
  }
}

/// Farthest that a point goes in the step before a knot, by the dofs of one joint.
static double step_by_joint(const cav_examination *e, const rates *r, const cav_requirement *q, int j, int t) {
  static const double zero[3] = {0};
  const cav_model *m = e->model;
  const cav_joint *joint = &m->joint[j];
  int n = joint->type == CAV_JOINT_FREE ? 6 : joint->type == CAV_JOINT_BALL ? 3 : 1;
  double line = 0, turn = 0, anchor[6];
  for (int k = 0; k < n; k++) {
    size_t i = (size_t)(t * m->nv + joint->dof + k);
    double most = fmax(fabs(r->low[i]), fabs(r->high[i]));
    int moves = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && k < 3);
    *(moves ? &line : &turn) += most * most;
  }
  if (turn == 0) return sqrt(line) * r->longest;
  cav_distance_range d = {0, norm3(q->point)};
  const double *pivot = joint->type == CAV_JOINT_FREE ? zero : joint->pos;
  if (q->object != joint->link || joint->type != CAV_JOINT_FREE)
    cav_distance_between(m, q->object, q->point, joint->link, pivot, anchor, &d);
  return (sqrt(line) + (d.largest > 0 ? sqrt(turn) * d.largest : 0)) * r->longest;
}

static void tell_way(cav_examination *e, const cav_requirement *q, double way, double can) {
  char what[160];
  cav_requirement_words(e, q, what, sizeof what);
  cav_impossible(e, CAV_CONDITION_ENERGY, q, "More time, a nearer target, or a looser limit of speed.",
                 "%s, too far for its speed: %.3g m away, and limits of speed leave %.3g m by then", what, way, can);
  cav_impossible_fraction(e, can / way);
}

static void examine_point(cav_examination *e, const rates *r, const cav_requirement *q) {
  const cav_model *m = e->model;
  double at[3], way = 0, can = slack;
  transform(at, e->start->link[q->object].pos, e->start->link[q->object].rotation, q->point);
  for (int k = 0; k < 3; k++) {
    double off = fmax(fmax(q->low[k] - at[k], at[k] - q->high[k]), 0);
    way = hypot(way, off);
  }
  for (int t = 1; t <= q->knot && can < way; t++)
    for (int l = q->object; l > 0 && can < way; l = m->link[l].parent)
      for (int j = m->link[l].joint; j < m->link[l].joint + m->link[l].njoint; j++)
        can += (1 + slack) * step_by_joint(e, r, q, j, t);
  if (can < way) tell_way(e, q, way, can);
}

/// A centre of mass whose own speed a constraint bounds from the start to what is required.
static void examine_centre(cav_examination *e, const rates *r, const cav_requirement *q) {
  const cav_problem *p = e->problem;
  cav_sensor centre = {
      .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = q->object, .dim = 3};
  double at[3], low[3], high[3];
  cav_sensor_read(e->model, e->start, &centre, at);
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    int first, last;
    if (term->quantity != CAV_QUANTITY_SENSOR || term->sensor.type != CAV_SENSOR_SUBTREELINVEL) continue;
    cav_requirement_window(e, term, &first, &last);
    // what is read at a knot is of the step after it
    if (term->sensor.object != q->object || first > 0 || last < q->knot - 1 || term->nwaypoint) continue;
    if (!cav_requirement_interval(e, term, first, usual_rate, low, high)) continue;
    for (int k = 0; k < 3; k++) {
      double way = q->low[k] > at[k] ? q->low[k] - at[k] : at[k] - q->high[k];
      double can = read_late * q->knot * r->longest * fmax(q->low[k] > at[k] ? high[k] : -low[k], 0) + give;
      if (way > can) {
        tell_way(e, q, way, can);
        return;
      }
    }
  }
}

cav_status cav_examine_speeds(cav_examination *e) {
  const cav_problem *p = e->problem;
  if (!cav_start_is_given(p)) return CAV_OK;
  double least = p->duration_most > 0 ? p->duration_least / p->duration : 1;
  rates r = {.longest = p->timestep * fmax(e->longest, 1), .shortest = p->timestep * fmin(least, 1)};
  int before = e->nfound;
  cav_status status = collect(e, &r);
  for (int j = 0; j < e->model->njoint && !status && e->nfound == before; j++) {
    cav_joint_type type = e->model->joint[j].type;
    if (type == CAV_JOINT_HINGE || type == CAV_JOINT_SLIDE) examine_joint(e, &r, j);
  }
  for (int i = 0; i < e->n && !status && e->nfound == before; i++) {
    const cav_requirement *q = &e->requirement[i];
    if (q->kind == CAV_REQUIRE_POINT && q->object) examine_point(e, &r, q);
    if (q->kind == CAV_REQUIRE_CENTRE) examine_centre(e, &r, q);
  }
  free(r.low);
  free(r.term);
  return status;
}
