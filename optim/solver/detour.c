/// An arm that would sweep through a post is not lifted out of it as a body is, and where its guess goes through, forces fade
/// into a motion that scrapes along. So the straight way is bowed: each driven hinge and slide has a half sine over the
/// duration, of amplitudes out of an even sequence in a cube that grows from a fourth of a radian to 1.5. Of the smallest cube
/// with a way whose knots are clear of the world and of each other the one with the least amplitudes is taken, 2 cm clear if
/// there is one.
#include "detour.h"

#include <math.h>
#include <stdlib.h>

#include "continuation.h"

enum { KNOTS = 41, TRIES = 1500, CUBES = 6 };
static const double largest = 1.5; // rad; of slides half their range, at least a third of it in m
static const double clear = 0.02;  // m
static const double inside = 1e-3; // m: deeper than where it begins and ends by so much is no way

/// A way that is looked at.
typedef struct search {
  cav_problem bowed; // with the swings
  cav_state *state;
  cav_trajectory *at;
  double *apart; // [npair] m: how far they have to be from each other
} search;

// whether all that is near at a configuration is as far apart as is wanted
static cav_status is_apart(const search *s, const double *q, int *good) {
  cav_status status = cav_position(s->bowed.model, s->state, q);
  for (int i = 0; i < s->state->ncontact && !status && *good; i++)
    *good = s->state->contact[i].dist >= s->apart[s->state->contact[i].pair];
  return status;
}

// the same at all knots
static cav_status is_clear(search *s, int *good) {
  // an odd stride meets all knots of a prime number, those in the middle early
  enum { STRIDE = 7, FIRST = 20 };
  cav_status status = cav_guess_fill(&s->bowed, s->bowed.q_goal, s->at);
  *good = 1;
  for (int k = 0; k < KNOTS && !status && *good; k++)
    status = is_apart(s, s->at->q + (size_t)((FIRST + k * STRIDE) % KNOTS) * (size_t)s->at->nq, good);
  return status;
}

cav_status cav_detour_apart(const cav_problem *problem, cav_state *state, double distance, double *apart) {
  const double *const ends[2] = {problem->q_start, problem->q_goal};
  cav_status status = CAV_OK;
  for (int i = 0; i < problem->model->npair; i++) apart[i] = distance;
  for (int k = 0; k < 2 && !status; k++) {
    status = cav_position(problem->model, state, ends[k]);
    for (int i = 0; i < state->ncontact && !status; i++) {
      const cav_contact *c = &state->contact[i];
      apart[c->pair] = fmin(apart[c->pair], c->dist - inside);
    }
  }
  return status;
}

int cav_detour_moves(const cav_model *m, int j) {
  const cav_joint *joint = &m->joint[j];
  const int root = m->link[joint->link].root;
  if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) return 0;
  if (m->joint[m->link[root].joint].type == CAV_JOINT_FREE) return 0;
  for (int i = 0; i < m->nequality; i++)
    if (m->equality[i].type == CAV_EQUALITY_JOINT && (m->equality[i].object[0] == j || m->equality[i].object[1] == j))
      return 0;
  for (int i = 0; i < m->nactuator; i++)
    if (m->actuator[i].transmission == CAV_TRANSMISSION_JOINT && m->actuator[i].target == j) return 1;
  return 0;
}

// what a joint is bowed by for each radian of a cube
static double unit_of(const cav_joint *joint) {
  static const double third = 1.0 / 3;
  if (joint->type != CAV_JOINT_SLIDE) return 1;
  return joint->limited ? fmax(third, (joint->range[1] - joint->range[0]) / (2 * largest)) : third;
}

// the best of the ways of a cube into the strategy
static cav_status search_cube(search *s, double size, cav_strategy *strategy) {
  // square roots of primes: even in as many dimensions as there are
  static const int prime[CAV_STRATEGY_SWINGS] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53};
  cav_status status = CAV_OK;
  double best = INFINITY;
  cav_swing swing[CAV_STRATEGY_SWINGS];
  const int n = s->bowed.nswing;
  for (int k = 1; k <= TRIES && !status; k++) {
    double square = 0;
    for (int i = 0; i < n; i++) {
      const double whole = k * sqrt(prime[i]), even = 2 * (whole - floor(whole)) - 1;
      s->bowed.swing[i].amplitude = size * unit_of(&s->bowed.model->joint[s->bowed.swing[i].joint]) * even;
      square += even * even;
    }
    if (square >= best) continue;
    int good;
    status = is_clear(s, &good);
    if (!good || status) continue;
    best = square;
    for (int i = 0; i < n; i++) swing[i] = s->bowed.swing[i];
  }
  if (best == INFINITY) return status;
  strategy->nswing = n;
  for (int i = 0; i < n; i++) strategy->swing[i] = swing[i];
  return status;
}

static cav_status search_all(search *s, cav_strategy *strategy) {
  cav_status status = CAV_OK;
  // what is two centimetres away is listed
  s->state->options.smoothing = clear;
  for (int tight = 0; tight < 2 && !strategy->nswing && !status; tight++) {
    status = cav_detour_apart(&s->bowed, s->state, tight ? 0 : clear, s->apart);
    for (int k = 1; k <= CUBES && !strategy->nswing && !status; k++)
      status = search_cube(s, largest * k / CUBES, strategy);
  }
  return status;
}

static search search_of(const cav_problem *problem) {
  const cav_model *m = problem->model;
  search s = {.bowed = *problem};
  s.bowed.guess = CAV_GUESS_INTERPOLATE;
  s.bowed.schedule.solids = CAV_SOLIDS_HARD;
  s.bowed.timestep = problem->duration / (KNOTS - 1);
  s.bowed.nswing = 0;
  s.state = cav_state_new(m);
  s.at = cav_trajectory_new(m, KNOTS, s.bowed.timestep);
  s.apart = calloc((size_t)m->npair + 1, sizeof *s.apart);
  return s;
}

static int has_memory(const search *s) { return s->state && s->at && s->apart; }

static void search_free(search *s) {
  free(s->apart);
  cav_state_free(s->state);
  cav_trajectory_free(s->at);
}

cav_status cav_detour_straight(const cav_problem *problem, int *is_free) {
  search s = search_of(problem);
  cav_status status = has_memory(&s) ? cav_detour_apart(&s.bowed, s.state, 0, s.apart) : CAV_NO_MEMORY;
  if (!status) status = is_clear(&s, is_free);
  search_free(&s);
  return status;
}

cav_status cav_detour_find(const cav_problem *problem, cav_strategy *strategy) {
  const cav_model *m = problem->model;
  cav_swing swing[CAV_STRATEGY_SWINGS];
  int n = 0;
  strategy->nswing = 0;
  for (int j = 0; j < m->njoint && n < CAV_STRATEGY_SWINGS; j++)
    if (cav_detour_moves(m, j)) swing[n++] = (cav_swing){.joint = j, .frequency = 0.5 / problem->duration};
  if (!n) return CAV_OK;
  search s = search_of(problem);
  s.bowed.swing = swing, s.bowed.nswing = n;
  cav_status status = has_memory(&s) ? search_all(&s, strategy) : CAV_NO_MEMORY;
  search_free(&s);
  return status;
}
