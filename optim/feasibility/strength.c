/// Postures that are to be held: forces of actuators and contacts against gravity.
///
/// Where constraints give the whole posture at three knots in a row, the same, the middle one is at rest: u = g(q), and
/// that has to be B e + J' f with efforts e within limits and contact forces f within cones (pyramids about them, of all
/// contacts that could touch, up to a thousand times the weight), friction losses and limits of joints that are near.
/// The nearest such force is found by least squares with bounds, one coordinate after the other; what is left, r, is a
/// proof by itself where r g > max r (B e + J' f) (Farkas 1902), whether or not the search has come to its end.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"
#include "objects.h"
#include "problem_file.h"
#include "transcription.h"

enum { SWEEPS = 400 };
static const double near_contact = 0.02, near_limit = 0.05; // m, and m or rad: what may bear
static const double most_load = 1000;                       // of the weight
static const double unmoved = 0.01; // how much of the force that it lacks counts of what no actuator moves

/// Forces that can act: columns, each with bounds of its factor.
typedef struct bearing {
  int nv, n, room;
  double *column; ///< [n*nv]
  double *low, *high, *factor;
} bearing;

static double *bearing_add(bearing *b, double low, double high) {
  if (b->n == b->room) {
    int room = b->room ? 2 * b->room : 64;
    double *column = realloc(b->column, sizeof(double) * (size_t)room * (size_t)b->nv);
    if (column) b->column = column;
    double *bounds = column ? realloc(b->low, sizeof(double) * 3 * (size_t)room) : NULL;
    if (!bounds) return NULL;
    // three arrays in one block: moved from the back
    memmove(bounds + 2 * room, bounds + 2 * b->room, sizeof(double) * (size_t)b->n);
    memmove(bounds + room, bounds + b->room, sizeof(double) * (size_t)b->n);
    b->low = bounds, b->high = bounds + room, b->factor = bounds + 2 * room;
    b->room = room;
  }
  double *column = b->column + (size_t)b->n * (size_t)b->nv;
  memset(column, 0, sizeof(double) * (size_t)b->nv);
  b->low[b->n] = low, b->high[b->n] = high, b->factor[b->n] = 0;
  b->n++;
  return column;
}

/// u += J' of a force and a torque at a point of a link.
static void add_wrench(const cav_model *m, const cav_state *state, int link, const double at[3], const double force[3],
                       const double torque[3], double sign, double *u) {
  for (int l = link; l > 0; l = m->link[l].parent) {
    double arm[3], moment[3];
    sub3(arm, at, state->reference + 3 * (size_t)link);
    cross3(moment, arm, force);
    add3(moment, moment, torque);
    for (int d = m->link[l].dof; d < m->link[l].dof + m->link[l].ndof; d++)
      u[d] += sign * (dot3(state->axis + 6 * (size_t)d, moment) + dot3(state->axis + 6 * (size_t)d + 3, force));
  }
}

static int add_contact_column(const cav_model *m, const cav_state *state, const cav_contact *c, const double force[3],
                              const double torque[3], double load, bearing *b) {
  double *u = bearing_add(b, 0, load);
  if (!u) return 0;
  add_wrench(m, state, c->link2, c->pos, force, torque, 1, u);
  add_wrench(m, state, c->link1, c->pos, force, torque, -1, u);
  return 1;
}

/// A pyramid about the cone of a contact: sliding friction, and, each by itself, torsion and rolling.
static int add_contact(const cav_model *m, const cav_state *state, const cav_contact *c, double load, bearing *b) {
  static const double none[3] = {0};
  const double *n = c->frame;
  int turns = c->dim > 3, ok = 1;
  double part = turns ? 4 : 1; // the load is split among the corners of each
  for (int corner = 0; corner < 4 && ok; corner++) {
    double force[3];
    copy3(force, n);
    if (c->dim >= 3) {
      axpy3(force, force, part * (corner & 1 ? 1 : -1) * c->friction[0], c->frame + 3);
      axpy3(force, force, part * (corner & 2 ? 1 : -1) * c->friction[1], c->frame + 6);
    }
    ok = add_contact_column(m, state, c, force, none, load, b);
  }
  for (int k = 3; k < c->dim && ok; k++) {
    for (int sign = -1; sign <= 1 && ok; sign += 2) {
      double torque[3];
      scale3(torque, sign * part * c->friction[k - 1], c->frame + 3 * (k - 3));
      ok = add_contact_column(m, state, c, n, torque, load, b);
    }
  }
  return ok;
}

static int add_actuators(cav_examination *e, double load, bearing *b) {
  const cav_model *m = e->model;
  for (int i = 0; i < m->nu; i++) {
    double range[2], unit = m->actuator[i].unit;
    cav_actuator_effort_range(m, i, range);
    for (int k = 0; k < 2; k++) range[k] *= cav_effort_part(e);
    double *u = bearing_add(b, fmax(range[0], -load), fmin(range[1], load));
    if (!u) return 0;
    cav_actuator_length(m, e->scratch, i, u);
    for (int d = 0; d < m->nv; d++) u[d] *= unit;
  }
  return 1;
}

/// Friction losses, and limits that a joint is near to.
static int add_joints(const cav_model *m, const double *q, double load, bearing *b) {
  for (int d = 0; d < m->nv; d++) {
    const cav_joint *joint = &m->joint[m->dof[d].joint];
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    double up = m->dof[d].frictionloss, down = m->dof[d].frictionloss, near = near_limit + joint->margin;
    if (joint->limited && scalar && q[joint->q] < joint->range[0] + near) up += load;
    if (joint->limited && scalar && q[joint->q] > joint->range[1] - near) down += load;
    if (up == 0 && down == 0) continue;
    double *u = bearing_add(b, -down, up);
    if (!u) return 0;
    u[d] = 1;
  }
  return 1;
}

/// Least squares within bounds: left [nv] := need - columns * factors, coordinate by coordinate.
static void search(bearing *b, double *left) {
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    double moved = 0;
    for (int i = 0; i < b->n; i++) {
      const double *c = b->column + (size_t)i * (size_t)b->nv;
      double square = 0, along = 0;
      for (int d = 0; d < b->nv; d++) square += c[d] * c[d], along += c[d] * left[d];
      if (square < 1e-20) continue;
      double to = fmin(fmax(b->factor[i] + along / square, b->low[i]), b->high[i]), step = to - b->factor[i];
      for (int d = 0; d < b->nv && step != 0; d++) left[d] -= step * c[d];
      b->factor[i] = to;
      moved = fmax(moved, fabs(step) * sqrt(square));
    }
    if (moved < 1e-12 * most_load) break;
  }
}

/// r need - max r (columns): above zero, what is left proves that the forces cannot be.
static double separation(const bearing *b, const double *need, const double *r) {
  double sum = 0;
  for (int d = 0; d < b->nv; d++) sum += r[d] * need[d];
  for (int i = 0; i < b->n; i++) {
    double along = 0;
    for (int d = 0; d < b->nv; d++) along += r[d] * b->column[(size_t)i * (size_t)b->nv + (size_t)d];
    sum -= fmax(along * b->low[i], along * b->high[i]);
  }
  return sum;
}

/// Whether a model has what can bear that is not counted here.
static int is_covered(const cav_model *m) {
  if (m->nequality > 0) return 0;
  for (int i = 0; i < m->ntendon; i++)
    if (m->tendon[i].limited || m->tendon[i].frictionloss > 0) return 0;
  for (int j = 0; j < m->njoint; j++)
    if (m->joint[j].twist_limited || m->joint[j].swing_limited ||
        (m->joint[j].limited && m->joint[j].type == CAV_JOINT_BALL))
      return 0;
  for (int i = 0; i < m->nu; i++) {
    double range[2];
    cav_actuator_effort_range(m, i, range);
    // a servo's or a muscle's limits are not of efforts
    if (isinf(range[0]) && isinf(range[1]) && m->actuator[i].ctrllimited) return 0;
  }
  return 1;
}

/// Whether terms that are equalities give every dof the same at knots t - 1, t and t + 1; then q [nq], and in term one
/// of them.
static int is_held(const cav_examination *e, int t, double *q, int *term) {
  const cav_model *m = e->model;
  const cav_problem *p = e->problem;
  for (int d = 0; d < m->nv; d++) {
    int found = 0;
    for (int i = 0; i < p->nterm && !found; i++) {
      const cav_term *one = &p->term[i];
      int first, last;
      if (one->quantity != CAV_QUANTITY_CONFIGURATION || one->use != CAV_USE_EQUAL || one->nwaypoint) continue;
      if (!cav_problem_selects(m, one, d)) continue;
      cav_requirement_window(e, one, &first, &last);
      if (first > t - 1 || last < t + 1) continue;
      const cav_joint *joint = &m->joint[m->dof[d].joint];
      const double *target = one->target ? one->target : p->q_goal;
      int width = joint->type == CAV_JOINT_FREE ? 7 : joint->type == CAV_JOINT_BALL ? 4 : 1;
      // a free joint is given by one term as a whole
      if (joint->type == CAV_JOINT_FREE && one->dofs != CAV_DOFS_ALL && one->dofs != CAV_DOFS_ONE) continue;
      memcpy(q + joint->q, target + joint->q, sizeof(double) * (size_t)width);
      *term = i;
      found = 1;
    }
    if (!found) return 0;
  }
  return m->nv > 0;
}

/// The actuator that has most of what is missing to give, at its limit; -1: none.
static int weakest(const bearing *b, const double *left, int nu) {
  int worst = -1;
  double most = 0;
  for (int i = 0; i < nu; i++) {
    double along = 0;
    for (int d = 0; d < b->nv; d++) along += left[d] * b->column[(size_t)i * (size_t)b->nv + (size_t)d];
    int at_limit = b->factor[i] <= b->low[i] || b->factor[i] >= b->high[i];
    if (at_limit && fabs(along) > most) most = fabs(along), worst = i;
  }
  return worst;
}

static void tell(cav_examination *e, const bearing *b, const double *need, const double *left, int t, int term) {
  const cav_model *m = e->model;
  const cav_term *held = &e->problem->term[term];
  const cav_requirement at = {.term = term, .knot = t};
  char name[CAV_WORDS], joint[48];
  double time = t * e->problem->timestep;
  int weak = weakest(b, left, m->nu), worst = 0, before = e->nfound;
  // where actuators move something that lacks force, that: what nothing moves may be meant to fall
  double most = 0;
  for (int d = 0; d < m->nv; d++) {
    const double size = fabs(left[d]) * (m->link[m->dof[d].link].driven ? 1 : unmoved);
    if (size > most) most = size, worst = d;
  }
  int j = m->dof[worst].joint;
  const char *unit =
      m->joint[j].type == CAV_JOINT_SLIDE || (m->joint[j].type == CAV_JOINT_FREE && worst < m->joint[j].dof + 3)
          ? "N"
          : "N m";
  // what is missing may be more than what gravity asks of the joint: a torque that others leave there
  char lacks[160], needs[64] = "";
  const char *what = cav_name_or(m->joint[j].name, "joint", j, joint);
  const int part = fabs(left[worst]) <= fabs(need[worst]);
  if (part) snprintf(needs, sizeof needs, "needs %.4g %s against gravity and ", need[worst], unit);
  snprintf(lacks, sizeof lacks, "joint '%.48s' %slacks %.3g %s%s", what, needs, fabs(left[worst]), unit,
           part ? " of it" : " against gravity");
  if (weak >= 0)
    cav_impossible(e, CAV_CONDITION_STRENGTH, &at, "A stronger actuator, a lighter load, or a posture that needs less.",
                   "posture '%.48s' cannot be held at %.4g s: with actuator '%.80s' at its limit of %.3g and all that "
                   "contacts can "
                   "give, %s",
                   held->name, time, cav_actuator_words(m, weak, name), b->factor[weak], lacks);
  else
    cav_impossible(e, CAV_CONDITION_STRENGTH, &at, "A posture that stands, or one that is not held.",
                   "posture '%.48s' cannot be held at %.4g s: %s, which no actuator or contact can give", held->name,
                   time, lacks);
  if (e->nfound > before) e->found[before].said.joint = j;
}

/// The balance of a posture at rest.
static cav_status examine_posture(cav_examination *e, int t, int term, const double *q, double *need) {
  const cav_model *m = e->model;
  cav_state *state = e->scratch;
  bearing b = {.nv = m->nv};
  double *left = need + m->nv, load = most_load * fmax(m->mass * norm3(m->gravity), 1);
  memset(left, 0, sizeof(double) * (size_t)m->nv);
  state->options.constraint = state->options.contact = 0;
  cav_status status = cav_inverse(m, state, q, left, left, need);
  // contacts that may bear, by the width of their smoothing
  state->options.constraint = state->options.contact = 1;
  state->options.smoothing = state->options.smoothing_self = near_contact;
  if (!status) status = cav_position(m, state, q);
  if (!status && !(add_actuators(e, load, &b) && add_joints(m, q, load, &b))) status = CAV_NO_MEMORY;
  for (int i = 0; i < state->ncontact && !status; i++)
    if (state->contact[i].dist < near_contact && !add_contact(m, state, &state->contact[i], load, &b))
      status = CAV_NO_MEMORY;
  if (!status) {
    memcpy(left, need, sizeof(double) * (size_t)m->nv);
    search(&b, left);
    double size = 0;
    for (int d = 0; d < m->nv; d++) size += left[d] * left[d];
    // more than a certificate's tolerance of force, by a wide margin
    if (sqrt(size) > 1e-4 * load / most_load && separation(&b, need, left) > 0.5 * size)
      tell(e, &b, need, left, t, term);
  }
  state->options.smoothing = state->options.smoothing_self = 0;
  free(b.column);
  free(b.low);
  return status;
}

cav_status cav_examine_strength(cav_examination *e) {
  const cav_model *m = e->model;
  if (!is_covered(m)) return CAV_OK;
  double *q = malloc(sizeof(double) * (size_t)(m->nq + 2 * m->nv));
  cav_status status = q ? CAV_OK : CAV_NO_MEMORY;
  int before = e->nfound, known = -1;
  for (int i = 0; i < e->problem->nterm && !status && e->nfound == before; i++) {
    const cav_term *term = &e->problem->term[i];
    int first, last, which = i;
    if (term->quantity != CAV_QUANTITY_CONFIGURATION || term->use != CAV_USE_EQUAL) continue;
    cav_requirement_window(e, term, &first, &last);
    if (first + 1 > last - 1 || first == known || !is_held(e, first + 1, q, &which)) continue;
    known = first;
    status = examine_posture(e, first + 1, which, q, q + m->nq);
  }
  free(q);
  return status;
}
