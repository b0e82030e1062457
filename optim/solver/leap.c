/// Arcs that a problem asks for: where a term wants a point or a centre of mass higher at one time than it is on the
/// straight way from start to goal, what floats has to be thrown there, and a guess that stays on the ground is
/// drawn to the optimum next to it, which stands still. The arc is ballistic: of the largest rise r that is asked
/// for, it lasts 2 sqrt(2 r/g) about that time, cut to the horizon.
#include "leap.h"

#include <math.h>
#include <stdlib.h>

#include "clear.h"
#include "continuation.h"
#include "math3.h"
#include "quantity.h"

static const double least_rise = 0.05; // m: less is done by stretching

// Flights: travel and step in height from which there is one, the lowest arc (else a quarter of the travel: 45
// degrees), how much higher the next one is, and how much higher than the first the last, m
static const double least_travel = 0.3, least_step = 0.1, low = 0.1, higher = 0.05, most = 1;

/// Whether a root can rise by itself: nothing holds it down.
static int can_rise(const cav_model *m) {
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (m->link[joint->link].parent != 0) continue;
    if (joint->type == CAV_JOINT_FREE || (joint->type == CAV_JOINT_SLIDE && fabs(joint->axis[2]) > 0.9)) return 1;
  }
  return 0;
}

/// How far above the straight way a term wants its height, m; 0 for terms that want none.
static cav_status rise_of(const cav_problem *p, const cav_term *term, cav_state *state, const cav_trajectory *way,
                          double *rise) {
  const cav_sensor *s = &term->sensor;
  double target[CAV_SENSOR_DIM_MAX], at[CAV_SENSOR_DIM_MAX];
  int upright = term->quantity == CAV_QUANTITY_SENSOR && (term->component < 0 || term->component == 2) &&
                (s->type == CAV_SENSOR_SUBTREECOM || (s->type == CAV_SENSOR_FRAMEPOS && !s->referred));
  *rise = 0;
  if (!upright || term->from != term->to || (term->use == CAV_USE_COST && term->weight == 0)) return CAV_OK;
  double time = term->to < 0 ? p->duration : fmin(term->to, p->duration);
  int t = (int)lround(time / p->timestep);
  cav_status status = cav_position(p->model, state, way->q + (size_t)t * (size_t)way->nq);
  if (status) return status;
  cav_sensor_read(p->model, state, s, at);
  cav_term_target(term, time, s->dim, target);
  *rise = target[2] + (term->use == CAV_USE_RANGE ? fmax(term->lower, -1e3) : 0) - at[2];
  return CAV_OK;
}

cav_status cav_leap_find(const cav_problem *problem, double *height, double *from, double *to) {
  cav_problem straight = *problem;
  double time = 0, g = norm3(problem->model->gravity), rise;
  *height = *from = *to = 0;
  if (problem->cycle.on || g == 0 || !can_rise(problem->model)) return CAV_OK;
  straight.guess = CAV_GUESS_INTERPOLATE, straight.guess_height = straight.guess_bow[0] = straight.guess_bow[1] = 0,
  straight.nguess_pose = straight.nswing = 0;
  zero3(straight.guess_rotation);
  cav_trajectory *way = cav_problem_guess(&straight, NULL);
  cav_state *state = cav_state_new(problem->model);
  cav_status status = way && state ? CAV_OK : CAV_NO_MEMORY;
  for (int i = 0; i < problem->nterm && !status; i++) {
    const cav_term *term = &problem->term[i];
    status = rise_of(problem, term, state, way, &rise);
    if (!status && rise > fmax(*height, least_rise)) *height = rise, time = term->to < 0 ? problem->duration : term->to;
  }
  double half = sqrt(2 * *height / g);
  *from = fmax(time - half, 0), *to = fmin(time + half, problem->duration);
  // at the end there is nothing to come down to
  if (*to - time < half / 2) *height = 0;
  cav_state_free(state);
  cav_trajectory_free(way);
  return status;
}

/// How far the first root is from where it starts at the goal, along the ground and in height, m.
static void find_way(const cav_problem *p, double *along, double *up) {
  const cav_model *m = p->model;
  double way[3] = {0};
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    int free = joint->type == CAV_JOINT_FREE;
    if (m->link[joint->link].parent != 0 || (!free && joint->type != CAV_JOINT_SLIDE)) continue;
    for (int k = 0; k < 3; k++) {
      if (free) way[k] = p->q_goal[joint->q + k] - p->q_start[joint->q + k];
      if (!free) way[k] += (p->q_goal[joint->q] - p->q_start[joint->q]) * joint->axis[k];
    }
    if (free) break;
  }
  *along = hypot(way[0], way[1]), *up = fabs(way[2]);
}

void cav_flight_apply(double height, double from, double to, cav_guess_pose pose[2], cav_problem *taken) {
  pose[0] = (cav_guess_pose){from, taken->q_start};
  pose[1] = (cav_guess_pose){to, taken->q_goal};
  taken->guess = CAV_GUESS_INTERPOLATE;
  taken->guess_height = height, taken->guess_from = from, taken->guess_to = to;
  zero3(taken->guess_rotation);
  taken->guess_bow[0] = taken->guess_bow[1] = 0;
  taken->nguess_pose = 2, taken->guess_pose = pose;
  taken->nswing = 0;
}

cav_status cav_flight_find(const cav_problem *problem, double *height, double *from, double *to) {
  double g = norm3(problem->model->gravity), middle = problem->duration / 2;
  int stated = problem->guess_height > 0 && problem->guess_to > problem->guess_from, collides = 1;
  *height = *from = *to = 0;
  if (problem->cycle.on || g == 0 || !can_rise(problem->model)) return CAV_OK;
  double along, up;
  find_way(problem, &along, &up);
  if (along < least_travel && up < least_step) return CAV_OK;
  cav_status status = CAV_OK;
  double first = stated ? problem->guess_height : fmax(low, along / 4), begin = problem->guess_from,
         end = problem->guess_to, at = first;
  for (; at <= first + most && !status; at += higher) {
    if (!stated) begin = middle - sqrt(2 * at / g), end = middle + sqrt(2 * at / g);
    if (begin <= 0 || end >= problem->duration) return CAV_OK;
    cav_problem flight = *problem;
    cav_guess_pose pose[2];
    cav_flight_apply(at, begin, end, pose, &flight);
    status = cav_guess_collides(&flight, &collides);
    if (!collides) break;
  }
  if (!status && !collides) *height = at, *from = begin, *to = end;
  return status;
}
