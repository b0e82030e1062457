/// What goes on the ground goes round a post, not over it: lifted out of it a guess would be above its head. So the straight way
/// is bowed to the side, by no more than is needed, where what it runs into stands on the ground and is as high as the body. What
/// is lower is stepped on or over, and what hangs is ducked under.
#include "bypass.h"

#include <math.h>
#include <stdlib.h>

#include "clear.h"
#include "continuation.h"
#include "detour.h"
#include "extent.h"
#include "role.h"

enum { KNOTS = 41 };
static const double clear = 0.06;               // m: from solids, but where start or goal are nearer
static const double step = 0.05, most = 1.6;    // m: of bows
static const double least_travel = 0.2;         // m
static const double high = 0.8, grounded = 0.1; // of the height of the root: a top from there on, a foot up to there

/// A way that is looked at.
typedef struct search {
  cav_problem bowed;
  cav_state *state;
  cav_trajectory *at;
  double *apart;        // [npair] m: how far pairs have to be from each other
  double floor, height; // m: of the lowest point of the body at the start; of its root over that
} search;

// where the body stands at the start, and how high its root is over that
static cav_status find_height(search *s, int root) {
  const cav_model *m = s->bowed.model;
  const cav_status status = cav_position(m, s->state, s->bowed.q_start);
  s->floor = status ? 0 : cav_lowest_point(m, s->state, m->joint[root].link);
  s->height = s->bowed.q_start[m->joint[root].q + 2] - s->floor;
  return status;
}

// whether a geom of the world stands on the ground and is as high as the body
static int is_tall(const search *s, int g) {
  static const double up[3] = {0, 0, 1};
  cav_pose pose;
  cav_object_pose(s->bowed.model, s->state, CAV_OBJECT_GEOM, g, &pose);
  const double top = pose.pos[2] + cav_geom_reach(s->bowed.model, g, &pose, up),
               bottom = cav_geom_bottom(s->bowed.model, g, &pose);
  return top - s->floor > high * s->height && bottom - s->floor < grounded * s->height;
}

// whether the way is nowhere nearer to solids than is wanted; *tall: it runs into something tall
static cav_status look(search *s, int *good, int *tall) {
  const cav_model *m = s->bowed.model;
  cav_status status = cav_guess_fill(&s->bowed, s->bowed.q_goal, s->at);
  *good = 1, *tall = 0;
  for (int t = 0; t < KNOTS && !status; t++) {
    status = cav_position(m, s->state, s->at->q + (size_t)t * (size_t)s->at->nq);
    for (int i = 0; i < s->state->ncontact && !status; i++) {
      const cav_contact *c = &s->state->contact[i];
      if (!cav_is_with_solid(m, c) || c->dist >= s->apart[c->pair]) continue;
      *good = 0;
      if (c->dist < 0) *tall |= is_tall(s, c->link1 == 0 ? m->pair[c->pair].geom1 : m->pair[c->pair].geom2);
    }
  }
  return status;
}

static cav_status search_all(search *s, int root, cav_strategy *strategy) {
  const cav_joint *joint = &s->bowed.model->joint[root];
  const double x = s->bowed.q_goal[joint->q] - s->bowed.q_start[joint->q],
               y = s->bowed.q_goal[joint->q + 1] - s->bowed.q_start[joint->q + 1], way = hypot(x, y);
  int good = 1, tall = 0;
  if (way < least_travel) return CAV_OK;
  cav_status status = find_height(s, root);
  if (!status) status = cav_detour_apart(&s->bowed, s->state, clear, s->apart);
  // what is near is listed
  s->state->options.smoothing = clear;
  if (!status) status = look(s, &good, &tall);
  if (!tall) return status;
  for (double bow = step; bow <= most && !good && !status; bow += step)
    for (int side = 1; side >= -1 && !good && !status; side -= 2) {
      s->bowed.guess_bow[0] = -side * bow * y / way, s->bowed.guess_bow[1] = side * bow * x / way;
      status = look(s, &good, &tall);
    }
  for (int k = 0; k < 2 && good; k++) strategy->bow[k] = s->bowed.guess_bow[k];
  return status;
}

cav_status cav_bypass_find(const cav_problem *problem, cav_strategy *strategy) {
  const cav_model *m = problem->model;
  const int root = cav_first_free(m);
  strategy->bow[0] = strategy->bow[1] = 0;
  if (root < 0) return CAV_OK;
  search s = {.bowed = *problem};
  s.bowed.guess = CAV_GUESS_INTERPOLATE;
  s.bowed.schedule.solids = CAV_SOLIDS_HARD;
  s.bowed.timestep = problem->duration / (KNOTS - 1);
  s.bowed.guess_from = 0, s.bowed.guess_to = problem->duration;
  s.bowed.nswing = 0;
  s.state = cav_state_new(m);
  s.at = cav_trajectory_new(m, KNOTS, s.bowed.timestep);
  s.apart = calloc((size_t)m->npair + 1, sizeof *s.apart);
  cav_status status = s.state && s.at && s.apart ? search_all(&s, root, strategy) : CAV_NO_MEMORY;
  free(s.apart);
  cav_state_free(s.state);
  cav_trajectory_free(s.at);
  return status;
}
