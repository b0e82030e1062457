/// Inverse kinematics for an arm whose file says where its hand has to be, and not how: with the start held as a guess the hand
/// is drawn straight through what stands between, and stays against it. So postures that meet the terms of the end are sought
/// by least squares, clear of everything, from the start and from an even sequence about it; where the straight way to the first
/// of them is free nothing is needed. Else the nearest with a free way, straight or bowed (detour.c), is where the guess goes.
#include "reach.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "detour.h"
#include "math3.h"
#include "posture_search.h"
#include "problem_file.h"
#include "quantity.h"

enum { TRIES = 32, KEPT = 3 };
static const double spread = 2; // rad, largest offset from the start that a search begins at; of slides half of it in m
static const double clear = 0.02;    // m, from what is not nearer at the start
static const double bending = 1e-3;  // rows per rad or m from where a search begins
static const double fixed = 1e3;     // of what may not move
static const double met = 0.5;       // part of a term's tolerance
static const double touching = 1e-3; // m, nearer than at the start or than nothing

/// What is searched, and by what rows.
typedef struct reacher {
  const cav_problem *problem;
  cav_state *state;
  int nrow;
  int aside;            // 1: solids count
  signed char *moves;   // [nv] whether the search may move a dof
  double *start, *from; // [nq] of the problem, and where a search begins
  double *apart;        // [npair] m, how far pairs have to be from each other
  double *difference;   // [nv]
  double off, depth;    // at what was evaluated last: of the tolerances of terms, and m, of what is too near
} reacher;

/// A posture that meets the terms.
typedef struct found_posture {
  double far, *q; // from the start; [nq]
} found_posture;

static int is_last(const cav_problem *p, const cav_term *term) {
  return term->to < 0 || term->to >= p->duration - 0.5 * p->timestep;
}

// whether a term says what a posture has to be at the end
static int is_of_end(const cav_problem *p, const cav_term *term) {
  return is_last(p, term) && term->quantity == CAV_QUANTITY_SENSOR &&
         (term->use != CAV_USE_RANGE || cav_term_is_band(term)) && cav_term_asks(term) &&
         cav_term_stage(term) == CAV_READS_POSITION && isfinite(cav_term_tolerance(p, term, 1));
}

// rows of a term, of its tolerance; how many
static int term_rows(reacher *r, const cav_term *term, double *row) {
  const cav_problem *p = r->problem;
  const cav_sensor *s = &term->sensor;
  double at[CAV_SENSOR_DIM_MAX], target[CAV_SENSOR_DIM_MAX], sign = 1, along = 0;
  const double usual = s->type == CAV_SENSOR_FRAMEPOS ? CAV_WITHIN_LENGTH : CAV_WITHIN_ANGLE;
  const double within = fmax(cav_term_is_band(term) ? term->upper : 0, cav_term_tolerance(p, term, usual));
  cav_sensor_read(p->model, r->state, s, at);
  cav_term_target(term, p->duration, s->dim, target);
  if (s->type == CAV_SENSOR_FRAMEQUAT) {
    if (!term->target) set3(target + 1, 0, 0, 0), target[0] = 1;
    for (int k = 0; k < s->dim; k++) along += at[k] * target[k];
    // half of the angle
    sign = along < 0 ? -2 : 2;
  }
  int n = 0;
  for (int k = 0; k < s->dim; k++) {
    if (term->component >= 0 && term->component != k) continue;
    row[n] = (fabs(sign) * target[k] - sign * at[k]) / within;
    r->off = fmax(r->off, fabs(row[n++]));
  }
  return n;
}

// terms, what is too near, how far from where it began
static cav_status rows(void *user, const double *q, double *row) {
  reacher *r = user;
  const cav_model *m = r->problem->model;
  r->state->options.contact = r->aside;
  cav_status status = cav_position(m, r->state, q);
  if (status) return status;
  int n = 0;
  r->off = r->depth = 0;
  for (int i = 0; i < r->problem->nterm; i++)
    if (is_of_end(r->problem, &r->problem->term[i])) n += term_rows(r, &r->problem->term[i], row + n);
  double squares = 0;
  for (int i = 0; i < r->state->ncontact && r->aside; i++) {
    const double near = fmax(r->apart[r->state->contact[i].pair] - r->state->contact[i].dist, 0);
    squares += near * near, r->depth = fmax(r->depth, near);
  }
  row[n++] = sqrt(squares) / clear;
  cav_difference(m, r->from, q, 1, r->difference);
  for (int d = 0; d < m->nv; d++) row[n++] = (r->moves[d] ? bending : fixed) * r->difference[d];
  return CAV_OK;
}

// pairs are to be a little apart, those nearer at the start as far as there
static cav_status want_apart(reacher *r) {
  const cav_model *m = r->problem->model;
  for (int i = 0; i < m->npair; i++) r->apart[i] = clear;
  r->state->options.smoothing = clear; // what is so far away is listed
  cav_status status = cav_position(m, r->state, r->start);
  for (int i = 0; i < r->state->ncontact && !status; i++) {
    const cav_contact *c = &r->state->contact[i];
    r->apart[c->pair] = fmin(r->apart[c->pair], c->dist - touching);
  }
  return status;
}

// a search from r->from into q; *good: whether it met the terms and is clear
static cav_status search(reacher *r, double *q, int *good) {
  const cav_model *m = r->problem->model;
  cav_posture_search s = {.model = m, .nrow = r->nrow, .q = q, .rows = rows, .user = r};
  // what is kept in its range by the search is not to be drawn back to a start that is not
  cav_posture_clip(m, r->from);
  memcpy(q, r->from, (size_t)m->nq * sizeof *q);
  cav_status status = cav_posture_find(&s);
  // what may not move stays to the bit
  double to[CAV_STRATEGY_SWINGS];
  for (int j = 0, k = 0; j < m->njoint; j++)
    if (r->moves[m->joint[j].dof]) to[k++] = q[m->joint[j].q];
  memcpy(q, r->start, (size_t)m->nq * sizeof *q);
  for (int j = 0, k = 0; j < m->njoint; j++)
    if (r->moves[m->joint[j].dof]) q[m->joint[j].q] = to[k++];
  *good = !status && r->off <= met && r->depth <= clear / 2;
  return status;
}

// keeps the nearest ones, in their order; the last one's room is the next one's
static void keep(found_posture *kept, int *n, double far, const double *q, int nq) {
  if (*n == KEPT && far >= kept[KEPT - 1].far) return;
  int k = *n < KEPT ? (*n)++ : KEPT - 1;
  double *room = kept[k].q;
  for (; k > 0 && kept[k - 1].far > far; k--) kept[k] = kept[k - 1];
  kept[k] = (found_posture){far, room};
  memcpy(room, q, (size_t)nq * sizeof *q);
}

static double distance(const reacher *r, const double *q) {
  double square = 0;
  cav_difference(r->problem->model, r->start, q, 1, r->difference);
  for (int d = 0; d < r->problem->model->nv; d++) square += r->difference[d] * r->difference[d];
  return sqrt(square);
}

// postures clear of all, nearest first
static cav_status search_all(reacher *r, double *q, found_posture *kept, int *n) {
  static const int prime[CAV_STRATEGY_SWINGS] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53};
  const cav_model *m = r->problem->model;
  cav_status status = CAV_OK;
  for (int k = 0; k < TRIES && !status; k++) {
    int good, i = 0;
    memcpy(r->from, r->start, (size_t)m->nq * sizeof *q);
    for (int j = 0; j < m->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      if (!r->moves[joint->dof]) continue;
      const double whole = k * sqrt(prime[i++]), even = 2 * (whole - floor(whole)) - 1;
      // the first one begins at the start itself
      if (k > 0) r->from[joint->q] += spread * (joint->type == CAV_JOINT_SLIDE ? 0.5 : 1) * even;
    }
    status = search(r, q, &good);
    if (good) keep(kept, n, distance(r, q), q, m->nq);
  }
  return status;
}

// where joints go, into the strategy
static void set_reach(const reacher *r, const double *q, cav_strategy *strategy) {
  const cav_model *m = r->problem->model;
  strategy->nreach = 0;
  for (int j = 0; j < m->njoint; j++)
    if (r->moves[m->joint[j].dof])
      strategy->reach[strategy->nreach++] = (cav_joint_value){.joint = j, .to = q[m->joint[j].q]};
}

// the first of these with a free way, straight or else bowed
static cav_status choose(const reacher *r, const found_posture *kept, int n, cav_strategy *strategy) {
  cav_problem moved = *r->problem;
  cav_status status = CAV_OK;
  for (int bowed = 0; bowed < 2 && !strategy->nreach; bowed++) {
    for (int k = 0; k < n && !status && !strategy->nreach; k++) {
      int is_free = 0;
      moved.q_goal = kept[k].q;
      status = bowed ? cav_detour_find(&moved, strategy) : cav_detour_straight(&moved, &is_free);
      if (!status && (is_free || strategy->nswing)) set_reach(r, kept[k].q, strategy);
    }
  }
  return status;
}

static cav_status find(reacher *r, double *q, found_posture *kept, cav_strategy *strategy) {
  int good, is_free = 0, n = 0;
  cav_problem moved = *r->problem;
  memcpy(r->from, r->start, (size_t)r->problem->model->nq * sizeof *q);
  cav_status status = search(r, q, &good);
  if (status || r->off > met) return status; // out of reach, or not by the arm alone
  moved.q_goal = q;
  if ((status = cav_detour_straight(&moved, &is_free)) || is_free) return status;
  r->aside = 1;
  status = want_apart(r);
  if (!status) status = search_all(r, q, kept, &n);
  return status ? status : choose(r, kept, n, strategy);
}

// what may move, and how many rows there are; 0 where there is nothing to find
static int prepare(reacher *r) {
  const cav_problem *p = r->problem;
  int joints = 0, asked = 0;
  for (int j = 0; j < p->model->njoint; j++) {
    if (!cav_detour_moves(p->model, j) || joints == CAV_STRATEGY_SWINGS) continue;
    r->moves[p->model->joint[j].dof] = 1;
    joints++;
  }
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    if (is_of_end(p, term)) asked += term->component < 0 ? term->sensor.dim : 1;
    // the start's posture once more
    if (term->quantity == CAV_QUANTITY_CONFIGURATION && is_last(p, term) && cav_term_asks(term) &&
        isfinite(cav_term_tolerance(p, term, 1)))
      return 0;
  }
  r->nrow = asked + 1 + p->model->nv;
  return joints > 0 && asked > 0;
}

cav_status cav_reach_find(const cav_problem *problem, cav_strategy *strategy) {
  const size_t nq = (size_t)problem->model->nq, nv = (size_t)problem->model->nv, npair = (size_t)problem->model->npair;
  reacher r = {.problem = problem, .state = cav_state_new(problem->model), .start = (double *)problem->q_start};
  double *room = calloc((2 + KEPT) * nq + nv + npair + 1, sizeof *room);
  r.moves = calloc(nv + 1, 1);
  strategy->nreach = strategy->nswing = 0;
  cav_status status = r.state && room && r.moves ? CAV_OK : CAV_NO_MEMORY;
  if (!status && prepare(&r)) {
    found_posture kept[KEPT];
    r.from = room + nq, r.difference = room + (2 + KEPT) * nq, r.apart = r.difference + nv;
    for (int k = 0; k < KEPT; k++) kept[k] = (found_posture){INFINITY, room + (2 + (size_t)k) * nq};
    status = find(&r, room, kept, strategy);
  }
  free(r.moves);
  free(room);
  cav_state_free(r.state);
  return status;
}
