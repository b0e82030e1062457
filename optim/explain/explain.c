/// Why a motion misses what it was asked for: constraint rows of its solution gathered by what they come from, ranked
/// twice.
///
/// By violation: how far the worst knot of each is from its bound, scaled, beyond what planning leaves room for. By
/// conflict: at a point where constraints cannot all hold, Gauss-Newton on the rows alone has come to rest, so their
/// weighted violations times their gradients sum to zero: sum_i y_i dg_i = 0, a local certificate of infeasibility
/// (Farkas). What one thing (an actuator, a joint, a component of a term) adds to that sum over its knots is its pull.
/// It does not depend on the weights that spread the violation over the rows, so what pulls hardest is the
/// contradiction, wherever its violation shows. Where all constraints hold the y_i are the multipliers, and the same
/// ranking says what the cost hangs on. Then only rows at their bounds count, and what a thing saves by giving way is
/// the sum over its knots; tests/test_explain.c holds it against solves with the bound moved.
///
/// Penetrations are added from the knots. Costs are not explained, nor is a local minimum told from a true
/// impossibility.
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/solve.h"
#include "contradiction.h"
#include "file.h"
#include "math3.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"
#include "transcription.h"

/// A contact counts as deep where planning would not have left it.
static const double deep = CAV_TOLERANCE_PENETRATION;

/// Depth in a solid of the world at which that is the cause, m.
static const double far_inside = 0.03;

/// Scaled distance from a bound within which a row is at it.
static const double at_bound = 1e-4;

/// Part of the motion from which on a knot belongs to its end.
static const double end_part = 0.75;

/// Part of a body's weight from which on a missing force is what should hold it up.
static const double carried = 0.3;

/// Same thing over all its knots.
typedef struct group {
  cav_binding_kind kind;
  int object, component;
  const cav_binding *missed, *pulled; ///< worst of its rows, NULL: none
  int missed_first, missed_last;      ///< knots
  int pulled_first, pulled_last;      ///< knots with at least a tenth of the worst pull
  double violation, pull, sum;        ///< worst and worst, sum of pulls
  double saving;                      ///< sum of multipliers
} group;

/// An explanation in progress.
typedef struct inquiry {
  const cav_problem *problem;
  const cav_model *model;
  double timestep;
  int nrow, room;
  cav_binding *row; ///< those given, then penetrations
  int ngroup;
  group *group;
  int met; ///< all but penetrations hold
  double pulls;
} inquiry;

static double binding_excess(const cav_binding *row) {
  double e = fmax(fmax(row->lower - row->value, row->value - row->upper), 0);
  return e > row->allowed ? e : 0;
}

/// Whether a row is at the bound that its multiplier is of.
static int is_active(const cav_binding *row) {
  double bound = row->multiplier < 0 ? row->lower : row->upper;
  return fabs(row->value - bound) <= fmax(row->allowed, at_bound);
}

// ---------------------------------------------------------------- gathering

static int add_row(inquiry *in, const cav_binding *row) {
  if (in->nrow == in->room) {
    in->room = in->room ? 2 * in->room : 64;
    cav_binding *larger = realloc(in->row, (size_t)in->room * sizeof *larger);
    if (!larger) return 0;
    in->row = larger;
  }
  in->row[in->nrow++] = *row;
  return 1;
}

/// The hard term of that number among the hard ones, -1: there are fewer.
static int hard_term(const cav_problem *p, int k) {
  for (int i = 0; i < p->nterm; i++)
    if (p->term[i].use != CAV_USE_COST && k-- == 0) return i;
  return -1;
}

/// Number of objects of a kind of row.
static int objects(const cav_problem *p, cav_binding_kind kind) {
  switch (kind) {
    case CAV_BINDING_UNACTUATED:
      return p->model->nv;
    case CAV_BINDING_EFFORT:
      return p->model->nu;
    case CAV_BINDING_JOINT:
      return p->model->njoint;
    case CAV_BINDING_TENDON:
      return p->model->ntendon;
    case CAV_BINDING_TERM:
      return p->nterm; // told more closely by hard_term
    case CAV_BINDING_PENETRATION:
    case CAV_BINDING_KINDS:
      break;
  }
  return 0;
}

/// Components of a row of that kind and object.
static int components(const cav_problem *p, const cav_binding *row) {
  if (row->kind == CAV_BINDING_UNACTUATED) return p->model->nv;
  if (row->kind == CAV_BINDING_EFFORT) return 2; // the force, and the control of a servo
  if (row->kind != CAV_BINDING_TERM) return 1;
  int i = hard_term(p, row->object);
  if (i < 0) return 0;
  const cav_term *term = &p->term[i];
  if (term->quantity == CAV_QUANTITY_USER) return term->user->dim;
  return term->quantity == CAV_QUANTITY_SENSOR ? term->sensor.dim : p->model->nv;
}

static cav_status take_rows(inquiry *in, int nknot, int nrow, const cav_binding *row, cav_error *error) {
  for (int i = 0; i < nrow; i++) {
    const cav_binding *r = &row[i];
    int known = r->kind >= 0 && r->object >= 0 && r->object < objects(in->problem, r->kind);
    if (!known || r->knot < 0 || r->knot >= nknot || r->component < 0 || r->component >= components(in->problem, r) ||
        !isfinite(r->value) || !isfinite(r->multiplier) || !isfinite(r->pull))
      return cav_file_fail(error, CAV_BAD_INPUT, 0, "constraint row %d is not of this problem; solve it again", i);
    if (!add_row(in, r)) return CAV_NO_MEMORY;
  }
  return CAV_OK;
}

/// Contacts that are deeper than a certificate allows.
static cav_status take_penetrations(inquiry *in, const cav_trajectory *at, const cav_options *law) {
  cav_state *state = cav_state_new(in->model);
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  if (state) state->options = *law;
  for (int t = 0; t < at->nknot && status == CAV_OK; t++) {
    status = cav_position(in->model, state, at->q + (size_t)t * (size_t)at->nq);
    for (int i = 0; i < state->ncontact && status == CAV_OK; i++) {
      cav_binding row = {.knot = t,
                         .kind = CAV_BINDING_PENETRATION,
                         .object = state->contact[i].pair,
                         .value = -state->contact[i].dist,
                         .lower = -INFINITY,
                         .upper = deep};
      if (row.value > deep && !add_row(in, &row)) status = CAV_NO_MEMORY;
    }
  }
  cav_state_free(state);
  return status;
}

static group *group_of(inquiry *in, const cav_binding *row) {
  for (int i = 0; i < in->ngroup; i++) {
    group *g = &in->group[i];
    if (g->kind == row->kind && g->object == row->object && g->component == row->component) return g;
  }
  if ((in->ngroup & (in->ngroup + 1)) == 0) {
    // full at 0, 1, 3, 7, ...
    group *larger = realloc(in->group, (2 * (size_t)in->ngroup + 1) * sizeof *larger);
    if (!larger) return NULL;
    in->group = larger;
  }
  in->group[in->ngroup] = (group){.kind = row->kind,
                                  .object = row->object,
                                  .component = row->component,
                                  .pulled_first = INT_MAX,
                                  .pulled_last = -1};
  return &in->group[in->ngroup++];
}

static cav_status gather(inquiry *in) {
  in->met = 1;
  for (int i = 0; i < in->nrow; i++)
    if (in->row[i].kind != CAV_BINDING_PENETRATION && binding_excess(&in->row[i]) > 0) in->met = 0;
  for (int i = 0; i < in->nrow; i++) {
    const cav_binding *row = &in->row[i];
    group *g = group_of(in, row);
    if (!g) return CAV_NO_MEMORY;
    double e = binding_excess(row);
    if (e > 0) {
      if (!g->missed) g->missed_first = row->knot;
      g->missed_last = row->knot;
      if (!g->missed || e > g->violation) g->missed = row, g->violation = e;
    }
    // the laws of motion hold back everything: no news where they hold
    if (in->met && (row->kind == CAV_BINDING_UNACTUATED || !is_active(row))) continue;
    // a bound gives way on either side, a target to one
    g->saving += row->lower < row->upper ? fabs(row->multiplier) : row->multiplier;
    if (row->pull > 0 && (!g->pulled || row->pull > g->pull)) g->pulled = row, g->pull = row->pull;
    g->sum += row->pull;
    in->pulls += row->pull;
  }
  for (int i = 0; i < in->nrow; i++) {
    const cav_binding *row = &in->row[i];
    group *g = group_of(in, row);
    if (!g || !g->pulled || row->pull < 0.1 * g->pull || (in->met && !is_active(row))) continue;
    if (row->knot < g->pulled_first) g->pulled_first = row->knot;
    if (row->knot > g->pulled_last) g->pulled_last = row->knot;
  }
  return CAV_OK;
}

// ---------------------------------------------------------------- words

static const char *or_number(const char *name, const char *kind, int i, char buffer[48]) {
  if (name && *name) return name;
  snprintf(buffer, 48, "%s %d", kind, i);
  return buffer;
}

static const char *body_name(const cav_model *m, int body, char buffer[48]) {
  return body == 0 ? "the world" : or_number(m->body[body].name, "body", body, buffer);
}

/// A dof as "joint, what of it, of body".
static void tell_dof(const cav_model *m, int d, char *out, size_t size) {
  static const char *const along[] = {"x", "y", "z", "turn about x", "turn about y", "turn about z"};
  char joint[48], body[48];
  const cav_joint *j = &m->joint[m->dof[d].joint];
  int place = d - j->dof;
  const char *which = j->type == CAV_JOINT_FREE ? along[place] : j->type == CAV_JOINT_BALL ? along[3 + place] : "";
  snprintf(out, size, "joint '%.60s'%s%s (body '%.60s')", or_number(j->name, "joint", m->dof[d].joint, joint),
           *which ? ", " : "", which, body_name(m, j->body, body));
}

static int is_line(const cav_model *m, int d) {
  const cav_joint *j = &m->joint[m->dof[d].joint];
  return j->type == CAV_JOINT_SLIDE || (j->type == CAV_JOINT_FREE && d - j->dof < 3);
}

/// Name of a hard term; "" where it has but that of its element, which does not tell it from others.
static const char *term_name(const cav_problem *p, int k) {
  const cav_term *term = &p->term[hard_term(p, k)];
  int named = term->name && *term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name);
  return named ? term->name : "";
}

/// What a sensor looks at: kind and name; "" where it is not of a body.
static void tell_sensor(const cav_model *m, const cav_sensor *s, char *out, size_t size) {
  char buffer[CAV_WORDS];
  int i = s->object;
  *out = 0;
  if (s->object_type == CAV_OBJECT_BODY || s->object_type == CAV_OBJECT_XBODY)
    snprintf(out, size, " of body '%.60s'", body_name(m, i, buffer));
  if (s->object_type == CAV_OBJECT_GEOM) snprintf(out, size, " of geom '%.90s'", cav_geom_words(m, i, buffer));
  if (s->object_type == CAV_OBJECT_SITE)
    snprintf(out, size, " of site '%.60s'", or_number(m->site[i].name, "site", i, buffer));
  if (s->object_type == CAV_OBJECT_JOINT)
    snprintf(out, size, " of joint '%.60s'", or_number(m->joint[i].name, "joint", i, buffer));
}

static void tell_term(const cav_problem *p, const cav_binding *row, char *out, size_t size) {
  static const char *const component[] = {"x", "y", "z", "w"};
  const cav_term *term = &p->term[hard_term(p, row->object)];
  char of[160] = "";
  const char *which = "";
  char number[32] = "";
  if (term->quantity == CAV_QUANTITY_SENSOR) {
    tell_sensor(p->model, &term->sensor, of, sizeof of);
    if (term->sensor.dim > 1) which = component[row->component & 3];
  } else if (term->quantity == CAV_QUANTITY_USER) {
    snprintf(number, sizeof number, "value %d", row->component);
    if (term->user->dim > 1) which = number;
  } else {
    of[0] = ',', of[1] = ' ';
    tell_dof(p->model, row->component, of + 2, sizeof of - 2);
  }
  const char *kind = term->quantity == CAV_QUANTITY_SENSOR ? cav_sensor_rule_of(term->sensor.type)->name
                     : term->quantity == CAV_QUANTITY_USER ? term->user->name
                                                           : cav_quantity_rule_of(term->quantity)->name;
  const char *name = term_name(p, row->object);
  snprintf(out, size, "constraint%s%.60s%s, %.60s%s%s%s", *name ? " '" : "", name, *name ? "'" : "", kind, of,
           *which ? ", " : "", which);
}

/// What a row is about, without its numbers.
static void tell_subject(const inquiry *in, const cav_binding *row, char *out, size_t size) {
  const cav_model *m = in->model;
  char a[CAV_WORDS], b[CAV_WORDS], dof[160];
  switch (row->kind) {
    case CAV_BINDING_UNACTUATED:
      tell_dof(m, row->object, dof, sizeof dof);
      snprintf(out, size, "force without an actuator on %s", dof);
      break;
    case CAV_BINDING_EFFORT: {
      const cav_actuator *actuator = &m->actuator[row->object];
      const char *body =
          actuator->transmission == CAV_TRANSMISSION_JOINT ? body_name(m, m->joint[actuator->target].body, b) : "";
      snprintf(out, size, "%s of actuator '%.90s'%s%.60s%s", row->component > 0 ? "control" : "effort",
               cav_actuator_words(m, row->object, a), *body ? " (body '" : "", body, *body ? "')" : "");
      break;
    }
    case CAV_BINDING_JOINT:
      snprintf(out, size, "range of joint '%.60s' (body '%.60s')",
               or_number(m->joint[row->object].name, "joint", row->object, a),
               body_name(m, m->joint[row->object].body, b));
      break;
    case CAV_BINDING_TENDON:
      snprintf(out, size, "range of tendon '%.60s'", or_number(m->tendon[row->object].name, "tendon", row->object, a));
      break;
    case CAV_BINDING_TERM:
      tell_term(in->problem, row, out, size);
      break;
    case CAV_BINDING_PENETRATION:
    case CAV_BINDING_KINDS: {
      const cav_pair *pair = &m->pair[row->object];
      snprintf(out, size, "penetration of geom '%.80s' into '%.80s'", cav_geom_words(m, pair->geom2, a),
               cav_geom_words(m, pair->geom1, b));
      break;
    }
  }
}

/// What a component of a term is held against at a knot, in its unit; NAN where it has no number of its own: rotations.
static double target_of(const inquiry *in, const cav_term *term, const cav_binding *row) {
  const cav_model *m = in->model;
  double time = row->knot * in->problem->timestep, one[CAV_USER_DIM_MAX];
  if (term->quantity == CAV_QUANTITY_SENSOR) {
    if (term->sensor.dim == 4) return NAN;
    cav_term_target(term, time, term->sensor.dim, one);
    return one[row->component];
  }
  if (term->quantity == CAV_QUANTITY_USER) {
    cav_term_target(term, time, term->user->dim, one);
    return one[row->component];
  }
  int posture = term->quantity == CAV_QUANTITY_CONFIGURATION, n = posture ? m->nq : m->nv, at = row->component;
  if (posture) {
    const cav_joint *joint = &m->joint[m->dof[at].joint];
    int line = joint->type == CAV_JOINT_FREE && at - joint->dof < 3;
    if ((joint->type == CAV_JOINT_FREE && !line) || joint->type == CAV_JOINT_BALL) return NAN;
    at = joint->q + (line ? at - joint->dof : 0);
    if (!term->target) return in->problem->q_goal[at];
  }
  double *all = malloc(sizeof(double) * (size_t)n), target = NAN;
  if (!all) return NAN;
  cav_term_target(term, time, n, all);
  target = all[at];
  free(all);
  return target;
}

/// A term with its numbers: how far off, and where it has numbers of its own, what is wanted and what is.
static void tell_target(const inquiry *in, const cav_binding *row, double off, const char *subject, char *out,
                        size_t size) {
  const cav_term *term = &in->problem->term[hard_term(in->problem, row->object)];
  double target = target_of(in, term, row), got = target + row->value * term->scale;
  int n = off != 0 || isnan(target) ? snprintf(out, size, "%s: off by %.4g", subject, off * term->scale)
                                    : snprintf(out, size, "%s: at %.4g", subject, got);
  if (isnan(target) || off == 0 || n >= (int)size) return;
  double wanted = got - off * term->scale;
  snprintf(out + n, size - (size_t)n, ", wanted %s%.4g, got %.4g",
           term->use == CAV_USE_RANGE ? (off < 0 ? "at least " : "at most ") : "", wanted, got);
}

/// The same with its numbers, in the units of the user.
static void tell(const inquiry *in, const cav_binding *row, char *out, size_t size) {
  char subject[200];
  tell_subject(in, row, subject, sizeof subject);
  double off = row->value < row->lower   ? row->value - row->lower
               : row->value > row->upper ? row->value - row->upper
                                         : 0;
  switch (row->kind) {
    case CAV_BINDING_UNACTUATED:
      snprintf(out, size, "%s: %.3g of the weight%s", subject, row->value * cav_force_fraction(in->model, row->object),
               is_line(in->model, row->object) ? "" : " times 0.3 m");
      break;
    case CAV_BINDING_EFFORT:
      snprintf(out, size, "%s: %.3g of its limit, planned with %.3g .. %.3g", subject, row->value, row->lower,
               row->upper);
      break;
    case CAV_BINDING_JOINT:
    case CAV_BINDING_TENDON:
      snprintf(out, size, "%s: at %.4g, planned with %.4g .. %.4g", subject, row->value, row->lower, row->upper);
      break;
    case CAV_BINDING_TERM:
      tell_target(in, row, off, subject, out, size);
      break;
    case CAV_BINDING_PENETRATION:
    case CAV_BINDING_KINDS:
      snprintf(out, size, "%s: %.3g mm deep, %.3g mm allowed", subject, 1e3 * row->value, 1e3 * row->upper);
      break;
  }
}

// ---------------------------------------------------------------- cures

/// The strongest row of another group at the same knot or one beside it that pulls; NULL: none.
static const cav_binding *opponent(const inquiry *in, const cav_binding *row) {
  const cav_binding *best = NULL;
  for (int i = 0; i < in->nrow; i++) {
    const cav_binding *r = &in->row[i];
    int same = r->kind == row->kind && r->object == row->object && r->component == row->component;
    if (same || abs(r->knot - row->knot) > 1 || r->pull <= 0) continue;
    if (!best || r->pull > best->pull) best = r;
  }
  return best;
}

/// Link that a sensor is on, 0 where it is on none alone.
static int sensor_link(const cav_model *m, const cav_sensor *s) {
  if (s->object_type == CAV_OBJECT_BODY || s->object_type == CAV_OBJECT_XBODY) return m->body[s->object].link;
  if (s->object_type == CAV_OBJECT_GEOM) return m->geom[s->object].link;
  if (s->object_type == CAV_OBJECT_SITE) return m->site[s->object].link;
  return 0;
}

/// Knots within which a penetration belongs to a target: contacts give way before or after it.
enum { near_knots = 2 };

/// The deepest penetration of a link at a knot; NULL: none.
static const cav_binding *buried(const inquiry *in, int link, int knot) {
  const cav_binding *best = NULL;
  for (int i = 0; i < in->nrow; i++) {
    const cav_binding *r = &in->row[i];
    if (r->kind != CAV_BINDING_PENETRATION || abs(r->knot - knot) > near_knots) continue;
    const cav_pair *pair = &in->model->pair[r->object];
    if (in->model->geom[pair->geom1].link != link && in->model->geom[pair->geom2].link != link) continue;
    if (!best || r->value > best->value) best = r;
  }
  return best;
}

static void cure_term(const inquiry *in, const cav_binding *row, const cav_binding *against, char *out, size_t size) {
  const cav_term *term = &in->problem->term[hard_term(in->problem, row->object)];
  int link = term->quantity == CAV_QUANTITY_SENSOR ? sensor_link(in->model, &term->sensor) : 0;
  const cav_binding *deepest = link > 0 ? buried(in, link, row->knot) : NULL;
  if (deepest) {
    snprintf(out, size, "What it asks for leads %.3g mm inside a solid: move the target out of it.",
             1e3 * deepest->value);
  } else if (against && against->kind == CAV_BINDING_TERM && against->object != row->object) {
    char other[200];
    tell_term(in->problem, against, other, sizeof other);
    snprintf(out, size, "It contradicts %s at this time: drop or loosen one, or set them apart in time.", other);
  } else if (against && against->kind == CAV_BINDING_EFFORT) {
    snprintf(out, size, "The actuators are too weak for it: more time, a nearer target, or stronger actuators.");
  } else if (against && (against->kind == CAV_BINDING_JOINT || against->kind == CAV_BINDING_TENDON)) {
    snprintf(out, size, "A range ends before it is reached: move the target, or check the range.");
  } else if (against && against->kind == CAV_BINDING_UNACTUATED && in->model->npair == 0) {
    snprintf(out, size, "Nothing drives the body that way: more time, or a target nearer to what moves by itself.");
  } else if (against && against->kind == CAV_BINDING_UNACTUATED) {
    snprintf(out, size,
             "Contacts cannot carry the body that way: more time, a target nearer to balance, or a guess that "
             "touches where it should push.");
  } else {
    snprintf(out, size, "It is out of reach: move the target nearer, or make it a cost.");
  }
}

/// The geom of the world that a penetration is in, where that is a solid and no ground: from inside of those there is no
/// one way out. NULL: another.
static const cav_geom *solid_of(const cav_model *m, const cav_binding *row, const cav_geom **other) {
  const cav_geom *a = &m->geom[m->pair[row->object].geom1], *b = &m->geom[m->pair[row->object].geom2];
  const cav_geom *solid = a->link == 0 ? a : b;
  *other = a->link == 0 ? b : a;
  int ground = solid->type == CAV_GEOM_PLANE || solid->type == CAV_GEOM_HFIELD;
  return solid->link == 0 && !ground ? solid : NULL;
}

/// What is far inside a solid of the world about a knot; NULL: nothing.
static const cav_binding *stuck(const inquiry *in, int knot) {
  const cav_binding *best = NULL;
  const cav_geom *other;
  for (int i = 0; i < in->nrow; i++) {
    const cav_binding *r = &in->row[i];
    if (r->kind != CAV_BINDING_PENETRATION || abs(r->knot - knot) > near_knots || r->value < far_inside) continue;
    if (solid_of(in->model, r, &other) && (!best || r->value > best->value)) best = r;
  }
  return best;
}

static void cure_stuck(const inquiry *in, const cav_binding *row, char *out, size_t size) {
  const cav_geom *other, *solid = solid_of(in->model, row, &other);
  const int nameless = !*other->name && *in->model->body[other->body].name;
  const int grows = in->problem->schedule.solids == CAV_SOLIDS_GROW;
  snprintf(out, size,
           "%s '%.60s' is %.3g mm inside '%.60s' there, and no force leads out: %sa guess that stays clear of it%s.",
           nameless ? "A geom of" : "Geom", nameless ? in->model->body[other->body].name : other->name,
           1e3 * row->value, *solid->name ? solid->name : in->model->body[solid->body].name,
           grows ? "" : "<schedule solids=\"grow\"/>, or ",
           grows ? ", by postures on the way (<waypoint>) or round it (bow=)" : "");
}

/// Whether a force without an actuator is missed up to the end, which has to be at rest, of what no actuator moves.
static int ends_moving(const inquiry *in, const group *g, const cav_binding *row) {
  int last = (int)lround(in->problem->duration / in->timestep);
  int until = row->kind == CAV_BINDING_UNACTUATED && !in->model->link[in->model->dof[row->object].link].driven &&
              g->missed && g->missed_last >= last - near_knots;
  return until && in->problem->close_at_rest && !in->problem->cycle.on && row->knot >= end_part * last;
}

/// Weight in N of a body that no actuator moves where a good part of it is missed by a force without an actuator; 0:
/// something else is.
static double unsupported(const inquiry *in, const cav_binding *row) {
  const cav_model *m = in->model;
  if (row->kind != CAV_BINDING_UNACTUATED || !is_line(m, row->object)) return 0;
  const cav_joint *joint = &m->joint[m->dof[row->object].joint];
  if (m->link[joint->link].driven || m->link[joint->link].parent != 0) return 0;
  double gravity = norm3(m->gravity), mass = 0;
  double up = joint->type == CAV_JOINT_FREE ? -m->gravity[row->object - joint->dof] : -dot3(m->gravity, joint->axis);
  for (int i = 1; i < m->nlink; i++) mass += m->link[i].root == joint->link ? m->link[i].mass : 0;
  // the row is over the weight of all
  return row->value * up * m->mass >= carried * mass * gravity ? mass * gravity : 0;
}

static void tell_cure(const inquiry *in, const group *g, const cav_binding *row, double saving, char *out,
                      size_t size) {
  static const char *const usual[] = {
      [CAV_BINDING_UNACTUATED] =
          "Nothing can push there: more time, a start and goal that stand, a guess that touches the "
          "ground where it should push, or more stages.",
      [CAV_BINDING_EFFORT] =
          "The actuator is too weak for what is asked: more time, a nearer target, or a stronger actuator.",
      [CAV_BINDING_JOINT] =
          "The range ends too early for what is asked: move the target, or check the range in the model.",
      [CAV_BINDING_TENDON] =
          "The range ends too early for what is asked: move the target, or check the range in the model.",
      [CAV_BINDING_PENETRATION] =
          "A lower softness or smoothing at the end of the schedule, or a target that is not inside a "
          "solid.",
  };
  const cav_binding *against = opponent(in, row);
  char subject[200];
  if (in->met && row->kind != CAV_BINDING_PENETRATION) {
    int term = row->kind == CAV_BINDING_TERM, equal = !(row->lower < row->upper);
    const char *unit = row->kind == CAV_BINDING_EFFORT ? " of the limit" : term ? "" : " rad or m";
    if (equal)
      snprintf(out, size, "The cost falls by about %.3g for each 0.01 that its target %s.", 0.01 * fabs(saving),
               saving > 0 ? "grows" : "shrinks");
    else
      snprintf(out, size, "The cost falls by about %.3g for each 0.01%s that it gives way.", 0.01 * saving, unit);
    return;
  }
  const double weight = unsupported(in, row);
  const cav_binding *inside = row->kind == CAV_BINDING_UNACTUATED ? stuck(in, row->knot) : NULL;
  if (inside) {
    cure_stuck(in, inside, out, size);
    return;
  }
  if (row->kind == CAV_BINDING_TERM) {
    cure_term(in, row, against, out, size);
  } else if (weight > 0) {
    snprintf(
        out, size,
        "Nothing holds it up there, and it weighs %.3g N: a lighter body, stronger actuators, or a guess in which what "
        "is to hold it touches it.",
        weight);
  } else if (ends_moving(in, g, row)) {
    snprintf(
        out, size,
        "All has to be at rest at the end, and nothing brakes it there: <horizon close=\"open\"/> where it may still "
        "move, or more time.");
  } else if (row->kind == CAV_BINDING_UNACTUATED && in->model->npair == 0) {
    snprintf(out, size, "Nothing can push there: more time, a guess that swings, or more stages.");
  } else if (row->kind == CAV_BINDING_EFFORT && row->component > 0) {
    snprintf(
        out, size,
        "Its control is at the end of its range there: a target nearer to what the servo can be told, or more time.");
  } else if (row->kind == CAV_BINDING_EFFORT && in->problem->effort_limit < 1 &&
             !(g->missed && fabs(g->missed->value) > 1)) {
    snprintf(out, size,
             "It is within the actuator's limit, not within what is planned with: <limits effort> nearer to 1, more "
             "time, or a nearer target.");
  } else {
    snprintf(out, size, "%s", usual[row->kind]);
  }
  size_t n = strlen(out);
  if (!against || n + 1 >= size) return;
  tell_subject(in, against, subject, sizeof subject);
  snprintf(out + n, size - n, " Pulls against: %s.", subject);
}

// ---------------------------------------------------------------- ranking

/// What a group saves by giving way by one, in the units of the user: rows of terms are over their scale.
static double saving_of(const inquiry *in, const group *g, const cav_binding *row) {
  double scale = row->kind == CAV_BINDING_TERM ? in->problem->term[hard_term(in->problem, row->object)].scale : 1;
  return g->saving / scale;
}

static cav_reason reason_of(const inquiry *in, const group *g, const cav_binding *row, int first, int last) {
  cav_reason reason = {.row = *row, .first = first, .last = last, .time = row->knot * in->timestep};
  reason.violation = binding_excess(row);
  reason.pull = row->pull;
  reason.fraction = in->pulls > 0 ? g->sum / in->pulls : 0;
  tell(in, row, reason.what, sizeof reason.what);
  if (in->met) reason.saving = saving_of(in, g, row);
  tell_cure(in, g, row, reason.saving, reason.cure, sizeof reason.cure);
  return reason;
}

static int by_violation(const void *a, const void *b) {
  double x = ((const group *)a)->violation, y = ((const group *)b)->violation;
  return (x < y) - (x > y);
}

static int by_pull(const void *a, const void *b) {
  double x = ((const group *)a)->sum, y = ((const group *)b)->sum;
  return (x < y) - (x > y);
}

static void rank(inquiry *in, cav_explanation *out) {
  out->met = in->met;
  qsort(in->group, (size_t)in->ngroup, sizeof *in->group, by_violation);
  for (int i = 0; i < in->ngroup && out->nviolation < CAV_REASONS; i++) {
    const group *g = &in->group[i];
    if (!g->missed) break;
    out->violation[out->nviolation++] = reason_of(in, g, g->missed, g->missed_first, g->missed_last);
  }
  qsort(in->group, (size_t)in->ngroup, sizeof *in->group, by_pull);
  for (int i = 0; i < in->ngroup && out->nconflict < CAV_REASONS; i++) {
    const group *g = &in->group[i];
    if (!g->pulled) break;
    out->conflict[out->nconflict++] = reason_of(in, g, g->pulled, g->pulled_first, g->pulled_last);
  }
}

// ---------------------------------------------------------------- contradictions

/// The rows of a group in words, each thing once with its knots.
static void tell_rows(const inquiry *in, const cav_row_group *rows, const cav_binding *row, char *out, size_t size) {
  int n = snprintf(out, size, "cannot hold together, %.3g apart: ", fabs(rows->mismatch)), more = 0;
  for (int i = 0; i < rows->n; i++) {
    const cav_binding *r = &row[rows->row[i]];
    int told = 0, last = r->knot;
    char subject[200], when[80];
    for (int k = 0; k < rows->n; k++) {
      const cav_binding *other = &row[rows->row[k]];
      if (other->kind != r->kind || other->object != r->object || other->component != r->component) continue;
      told |= k < i;
      last = other->knot > last ? other->knot : last;
    }
    if (told) continue;
    tell_subject(in, r, subject, sizeof subject);
    if (last > r->knot)
      snprintf(when, sizeof when, " from %.4g to %.4g s", r->knot * in->timestep, last * in->timestep);
    else
      snprintf(when, sizeof when, " at %.4g s", r->knot * in->timestep);
    // room for the count of those left out
    if ((size_t)n + strlen(subject) + strlen(when) + 20 < size)
      n += snprintf(out + n, size - (size_t)n, "%s%s%s", i ? "; " : "", subject, when);
    else
      more++;
  }
  if (more) snprintf(out + n, size - (size_t)n, "; and %d more", more);
}

/// Equalities that contradict each other at the motion; nothing where derivatives are not exact enough to tell.
static cav_status find_contradiction(const inquiry *in, const cav_trajectory *trajectory, const cav_options *contact,
                                     cav_explanation *out, cav_error *error) {
  if (!cav_contradictions_available() || cav_derivatives_missing(in->model)) return CAV_OK;
  if (cav_contradictions_load(error) != CAV_OK) return CAV_NOT_SUPPORTED;
  cav_row_groups groups;
  cav_binding *row = NULL;
  cav_transcription *tr = cav_transcription_new(in->problem, 1, NULL);
  if (!tr) return CAV_NO_MEMORY;
  tr->options = *contact;
  tr->derivative = CAV_DERIVATIVE_ANALYTIC;
  cav_trajectory *at = cav_trajectory_copy(trajectory);
  cav_status status = at && cav_transcription_keep_rows(tr) ? CAV_OK : CAV_NO_MEMORY;
  if (!status) status = cav_transcription_linearise(tr, at);
  if (!status) status = cav_transcription_contradictions(tr, CAV_TOLERANCE_CONSTRAINT, &groups, &row);
  for (int g = 0; !status && g < groups.n && !*out->contradiction; g++)
    if (groups.group[g].contradicts)
      tell_rows(in, &groups.group[g], row, out->contradiction, sizeof out->contradiction);
  if (!status) cav_row_groups_clear(&groups);
  free(row);
  cav_trajectory_free(at);
  cav_transcription_free(tr);
  return status;
}

cav_status cav_explain(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                       int nrow, const cav_binding *row, cav_explanation *explanation, cav_error *error) {
  inquiry in = {.problem = problem, .model = problem->model, .timestep = trajectory->timestep};
  *explanation = (cav_explanation){.met = 1};
  if (trajectory->nq != in.model->nq || trajectory->nv != in.model->nv)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "the trajectory is not of the problem's model");
  cav_status status = take_rows(&in, trajectory->nknot, nrow, row, error);
  if (status == CAV_OK) status = take_penetrations(&in, trajectory, contact);
  if (status == CAV_OK) status = gather(&in);
  if (status == CAV_OK && in.ngroup > 0) rank(&in, explanation);
  if (status == CAV_OK && !in.met) status = find_contradiction(&in, trajectory, contact, explanation, error);
  free(in.row);
  free(in.group);
  if (status == CAV_NO_MEMORY) cav_file_fail(error, status, 0, "not enough memory to explain this motion");
  if (status == CAV_NOT_FINITE) cav_file_fail(error, status, 0, "the trajectory holds a number that is not finite");
  return status;
}
