/// Guesses lifted out of what stands in the world: where the line from start to goal goes through a solid there is no way
/// to the outside that a solver could follow. At each knot the least lift straight up that frees the model; then so smooth a
/// course above these that no step is taken in less than half a second. Where all of a way through what hangs is shorter below
/// it, so deep that it is clear: limbs that reach the ground then are folded by it.
#include "clear.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "extent.h"
#include "math3.h"
#include "role.h"

/// Depth that is free, m; least step upwards of the search, and how many of them.
static const double touching = 1e-3, step = 0.01;
enum { STEPS = 500 };

/// Smoothing whose contacts reach what is below a guess, about ten times as far, m; the vertical part of a normal from which
/// that bears, and steps of the search.
static const double reach = 0.3, level = 0.5;
enum { GROUNDINGS = 5 };

/// How often a thing is lifted at most.
enum { PASSES = 5 };

/// Depth in a solid from which a guess runs into it, m.
static const double deep = 0.01;

/// Depth in the ground of a guess that goes through it, over the size of the model.
static const double buried = 0.5;

/// How far a guess goes down at most below what hangs, over the height of its root; how high the foot of what hangs is over the
/// lowest point of the start, m; what is met within so many s is passed on one side.
static const double crouch = 0.45, hanging = 0.05, together = 1;

/// Time over which the course looks ahead and back, s.
static const double ahead = 0.25;

/// Whether a joint lifts the tree that it is the root of.
static int rises(const cav_model *m, const cav_joint *joint) {
  const int vertical = joint->type == CAV_JOINT_SLIDE && fabs(joint->axis[2]) > 0.9;
  return m->link[joint->link].parent == 0 && (vertical || joint->type == CAV_JOINT_FREE);
}

/// Raises a tree, or all that can rise where it is 0.
static void lift(const cav_model *m, int tree, double height, double *q) {
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (!rises(m, joint) || (tree && m->link[joint->link].root != tree)) continue;
    if (joint->type == CAV_JOINT_FREE)
      q[joint->q + 2] += height;
    else
      q[joint->q] += copysign(height, joint->axis[2]);
  }
}

void cav_lift(const cav_model *m, double height, double *q) { lift(m, 0, height, q); }

int cav_is_with_solid(const cav_model *m, const cav_contact *c) {
  if (c->link1 > 0 && c->link2 > 0) return 0;
  const cav_pair *pair = &m->pair[c->pair];
  const cav_geom_type type = m->geom[c->link1 == 0 ? pair->geom1 : pair->geom2].type;
  return type != CAV_GEOM_PLANE && type != CAV_GEOM_HFIELD;
}

/// How deep a configuration is in the world: in all of it, or in solids alone.
static cav_status depth_at(const cav_model *m, cav_state *state, const double *q, int solids, double *depth) {
  cav_status status = cav_position(m, state, q);
  *depth = 0;
  for (int i = 0; i < state->ncontact && !status; i++) {
    const cav_contact *c = &state->contact[i];
    if (solids ? cav_is_with_solid(m, c) : c->link1 == 0 || c->link2 == 0) *depth = fmax(*depth, -c->dist);
  }
  return status;
}

int cav_first_free(const cav_model *m) {
  int j = 0;
  while (j < m->njoint && m->joint[j].type != CAV_JOINT_FREE) j++;
  return j < m->njoint ? j : -1;
}

double cav_lowest_point(const cav_model *m, const cav_state *state, int root) {
  double lowest = INFINITY;
  for (int g = 0; g < m->ngeom; g++) {
    cav_pose pose;
    if (m->geom[g].link == 0 || !(m->geom[g].contype || m->geom[g].conaffinity)) continue;
    if (root && m->link[m->geom[g].link].root != root) continue;
    cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &pose);
    lowest = fmin(lowest, cav_geom_bottom(m, g, &pose));
  }
  return lowest;
}

/// Ways out of the world of the knots of a guess: straight up; down, below solids, where it is in them or comes there on the way
/// up, else negative; and a smooth course. Of what actuators move, which takes all along; or of a thing, alone.
typedef struct ways {
  const cav_model *m;
  cav_state *state;
  int tree; ///< of the thing, 0: of what actuators move
  int n, window;
  double *up, *down, *wide, *course; ///< [n]
} ways;

/// Whether a contact is with the world, and of what a way is sought for.
static int counts(const ways *w, const cav_contact *c) {
  if (c->link1 > 0 && c->link2 > 0) return 0;
  const cav_link *link = &w->m->link[c->link1 > 0 ? c->link1 : c->link2];
  return w->tree ? link->root == w->tree : link->driven;
}

/// How deep it is in the world at a configuration; *met: whether in a solid, too.
static cav_status depth_of(const ways *w, const double *q, double *depth, int *met) {
  cav_status status = cav_position(w->m, w->state, q);
  *depth = 0;
  for (int i = 0; i < w->state->ncontact && !status; i++) {
    const cav_contact *c = &w->state->contact[i];
    if (!counts(w, c)) continue;
    *depth = fmax(*depth, -c->dist);
    *met |= -c->dist > touching && cav_is_with_solid(w->m, c);
  }
  return status;
}

static void raise_by(const ways *w, double height, double *q) { lift(w->m, w->tree, height, q); }

/// Whether all solids that it is in at the state hang over a height.
static int is_hung_over(const ways *w, double lowest) {
  for (int i = 0; i < w->state->ncontact; i++) {
    const cav_contact *c = &w->state->contact[i];
    if (c->dist >= -touching || !counts(w, c) || !cav_is_with_solid(w->m, c)) continue;
    const int g = c->link1 == 0 ? w->m->pair[c->pair].geom1 : w->m->pair[c->pair].geom2;
    cav_pose pose;
    cav_object_pose(w->m, w->state, CAV_OBJECT_GEOM, g, &pose);
    if (cav_geom_bottom(w->m, g, &pose) <= lowest + hanging) return 0;
  }
  return 1;
}

/// How far what is in solids has to go down to be clear of them, up to most; infinite: that is no way.
static cav_status find_way_below(const ways *w, double *q, double lowest, double most, double *down) {
  double way = 0, depth;
  int in = 0;
  cav_status status = depth_of(w, q, &depth, &in);
  const int hung = !status && is_hung_over(w, lowest);
  while (!status && hung && in && way < most) {
    raise_by(w, -step, q), way += step, in = 0;
    status = depth_of(w, q, &depth, &in);
  }
  raise_by(w, way, q);
  *down = hung && !in ? way : INFINITY;
  return status;
}

/// The least lift of each knot, which it gets, and its way down.
static cav_status find_ways(const ways *w, cav_trajectory *at, double *before) {
  cav_status status = cav_position(w->m, w->state, at->q);
  const double lowest = status ? 0 : cav_lowest_point(w->m, w->state, w->tree);
  const double most = status ? 0 : crouch * (w->state->com[3 * (w->tree ? w->tree : w->m->nlink > 1) + 2] - lowest);
  for (int t = 1; t < w->n && !status; t++) {
    double *q = at->q + (size_t)t * at->nq, depth = 1;
    int met = 0;
    memcpy(before, q, (size_t)at->nq * sizeof *q);
    w->down[t] = -1;
    for (int k = 0; k < STEPS && !status; k++) {
      status = depth_of(w, q, &depth, &met);
      if (depth <= touching) break;
      const double up = fmax(depth, step);
      raise_by(w, up, q);
      w->up[t] += up;
    }
    if (met && !status) status = find_way_below(w, before, lowest, most, &w->down[t]);
  }
  return status;
}

/// Takes knots that are in solids one soon after the other below these, where that is shorter for all of them.
static void go_below(cav_trajectory *at, const ways *w) {
  const int soon = (int)ceil(together / at->timestep);
  for (int first = 1, last; first < w->n; first = last + 1) {
    double up = 0, down = 0;
    last = first;
    if (w->down[first] < 0) continue;
    for (int t = first; t < w->n && t <= last + soon; t++) {
      up = fmax(up, w->up[t]), down = fmax(down, w->down[t]);
      if (w->down[t] >= 0) last = t;
    }
    // a thing that is put on a shelf from below does not go on below it; limbs may brush what is passed below
    const int through = w->tree && (w->down[first] > w->up[first] || w->down[last] > w->up[last]);
    const int below = down <= up && !through;
    for (int t = first; t <= last; t++) {
      if (below) {
        raise_by(w, -w->up[t] - fmax(w->down[t], 0), at->q + (size_t)t * at->nq);
        w->up[t] = 0;
      } else {
        w->down[t] = 0;
      }
    }
  }
  for (int t = 0; t < w->n; t++) w->down[t] = fmax(w->down[t], 0);
}

/// Lifts each knot, or lowers it, from the least that it got to a smooth course.
static void follow_course(cav_trajectory *at, const ways *w, const double *least, double sign) {
  memset(w->wide, 0, (size_t)w->n * sizeof *w->wide);
  for (int t = 0; t < w->n; t++)
    for (int k = -w->window; k <= w->window; k++)
      if (t + k >= 0 && t + k < w->n) w->wide[t] = fmax(w->wide[t], least[t + k]);
  for (int t = 1; t < w->n; t++) {
    double sum = 0, weights = 0;
    for (int k = -w->window; k <= w->window; k++) {
      double weight = 1 + cos(M_PI * k / (w->window + 1));
      weights += weight;
      if (t + k >= 0) sum += weight * w->wide[t + k < w->n ? t + k : w->n - 1];
    }
    w->course[t] = sum / weights;
    double rest = t < w->n - 1 ? fmax(w->course[t] - least[t], 0) : 0;
    raise_by(w, sign * rest, at->q + (size_t)t * at->nq);
  }
}

/// Clears all that actuators move, tree 0, or a thing: anew where a smooth course lifts it into what is over its way.
static cav_status clear_tree(ways *w, int tree, cav_trajectory *at, double *before) {
  cav_status status = CAV_OK;
  double most = 1;
  w->tree = tree;
  for (int pass = 0; pass < (tree ? PASSES : 1) && most > 0 && !status; pass++) {
    memset(w->up, 0, 4 * (size_t)w->n * sizeof *w->up);
    status = find_ways(w, at, before);
    if (status) break;
    go_below(at, w);
    most = 0;
    for (int t = 0; t < w->n; t++) most = fmax(most, fmax(w->up[t], w->down[t]));
    follow_course(at, w, w->up, 1);
    follow_course(at, w, w->down, -1);
  }
  return status;
}

/// Whether something lifts a tree that nothing moves, or any that actuators do: 0.
static int can_rise(const cav_model *m, int tree) {
  for (int j = 0; j < m->njoint; j++) {
    const cav_link *link = &m->link[m->joint[j].link];
    if (rises(m, &m->joint[j]) && (tree ? link->root == tree && !link->driven : link->driven)) return 1;
  }
  return 0;
}

cav_status cav_clear(const cav_model *m, cav_trajectory *at) {
  const size_t n = (size_t)at->nknot;
  cav_state *state = cav_state_new(m);
  double *room = calloc(4 * n + (size_t)at->nq, sizeof *room);
  ways w = {m, state, 0, at->nknot, (int)ceil(ahead / at->timestep), room, room + n, room + 2 * n, room + 3 * n};
  cav_status status = state && room ? CAV_OK : CAV_NO_MEMORY;
  for (int tree = 0; tree < m->nlink && !status; tree++)
    if (can_rise(m, tree)) status = clear_tree(&w, tree, at, room + 4 * n);
  cav_state_free(state);
  free(room);
  return status;
}

/// The height of a tree over what is below it in the world; infinite where nothing is within reach, or beside it alone.
static cav_status height_over(const cav_model *m, cav_state *state, int tree, const double *q, double *height) {
  cav_status status = cav_position(m, state, q);
  *height = INFINITY;
  for (int i = 0; i < state->ncontact && !status; i++) {
    const cav_contact *c = &state->contact[i];
    if ((c->link1 > 0 && c->link2 > 0) || m->link[c->link1 > 0 ? c->link1 : c->link2].root != tree) continue;
    const double up = fabs(c->frame[2]);
    if (up > level) *height = fmin(*height, c->dist / up);
  }
  return status;
}

/// How far each knot but the first and the last is below the height that it should have, m.
static cav_status find_sinks(const cav_model *m, cav_state *state, int tree, const cav_trajectory *at, double *q,
                             double *low) {
  const int last = at->nknot - 1;
  double ends[2];
  cav_status status = height_over(m, state, tree, at->q, &ends[0]);
  if (!status) status = height_over(m, state, tree, at->q + (size_t)last * at->nq, &ends[1]);
  // what begins or ends in the air stands on nothing
  if (!isfinite(ends[0]) || !isfinite(ends[1])) return status;
  for (int t = 1; t < last && !status; t++) {
    const double wanted = ends[0] + (ends[1] - ends[0]) * t / last;
    double height = 0;
    memcpy(q, at->q + (size_t)t * at->nq, (size_t)at->nq * sizeof *q);
    for (int k = 0; k < GROUNDINGS && !status; k++) {
      status = height_over(m, state, tree, q, &height);
      if (!isfinite(height) || fabs(wanted - height) < touching) break;
      lift(m, tree, wanted - height, q);
      low[t] += wanted - height;
    }
  }
  return status;
}

cav_status cav_ground(const cav_model *m, cav_trajectory *at) {
  int n = at->nknot, w = (int)ceil(0.5 * ahead / at->timestep), first = 0;
  while (first < m->njoint && !rises(m, &m->joint[first])) first++;
  if (first == m->njoint) return CAV_OK;
  const int tree = m->link[m->joint[first].link].root;
  cav_state *state = cav_state_new(m);
  double *low = calloc((size_t)n + (size_t)at->nq, sizeof *low);
  cav_status status = state && low ? CAV_OK : CAV_NO_MEMORY;
  if (state) state->options.smoothing = reach;
  if (!status) status = find_sinks(m, state, tree, at, low + n, low);
  for (int t = 1; t < n - 1 && !status; t++) {
    double sum = 0, weights = 0;
    for (int k = -w; k <= w; k++) {
      if (t + k < 0 || t + k >= n) continue;
      const double weight = 1 + cos(M_PI * k / (w + 1));
      weights += weight, sum += weight * low[t + k];
    }
    lift(m, tree, sum / weights, at->q + (size_t)t * at->nq);
  }
  cav_state_free(state);
  free(low);
  return status;
}

cav_status cav_stands_on_solid(const cav_problem *problem, int *stands) {
  const double *const ends[2] = {problem->q_start, problem->q_goal};
  const cav_model *m = problem->model;
  cav_state *state = cav_state_new(m);
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  *stands = 0;
  if (state) state->options.smoothing = deep;
  for (int k = 0; k < 2 && !status; k++) {
    status = cav_position(m, state, ends[k]);
    for (int i = 0; i < state->ncontact && !status; i++) {
      const cav_contact *c = &state->contact[i];
      *stands |= c->dist < deep && cav_is_with_solid(m, c);
    }
  }
  cav_state_free(state);
  return status;
}

/// Whether a model may touch a solid of the world at all.
static int has_solid(const cav_model *m) {
  for (int i = 0; i < m->npair; i++)
    for (int k = 0; k < 2; k++) {
      const cav_geom *geom = &m->geom[k ? m->pair[i].geom2 : m->pair[i].geom1];
      if (geom->link == 0 && geom->type != CAV_GEOM_PLANE && geom->type != CAV_GEOM_HFIELD) return 1;
    }
  return 0;
}

/// Whether any knot of the problem's guess is deeper than this in the world: in all of it, or in solids alone.
static cav_status is_deeper(const cav_problem *problem, int solids, double than, int *deeper) {
  int n = (int)lround(problem->duration / problem->timestep) + 1;
  cav_problem stated = *problem;
  stated.schedule.solids = CAV_SOLIDS_HARD;
  cav_trajectory *at = cav_trajectory_new(problem->model, n, problem->timestep);
  cav_state *state = cav_state_new(problem->model);
  cav_status status = at && state ? cav_guess_fill(&stated, problem->q_goal, at) : CAV_NO_MEMORY;
  *deeper = 0;
  for (int t = 0; t < n && !status && !*deeper; t++) {
    double depth = 0;
    status = depth_at(problem->model, state, at->q + (size_t)t * at->nq, solids, &depth);
    *deeper = depth > than;
  }
  cav_state_free(state);
  cav_trajectory_free(at);
  return status;
}

cav_status cav_guess_collides(const cav_problem *problem, int *collides) {
  *collides = 0;
  return problem->cycle.on || !has_solid(problem->model) ? CAV_OK : is_deeper(problem, 1, deep, collides);
}

cav_status cav_guess_sinks(const cav_problem *problem, int *sinks) {
  const cav_model *m = problem->model;
  cav_state *state = cav_state_new(m);
  double size = 0;
  *sinks = 0;
  cav_status status = state ? cav_position(m, state, problem->q_start) : CAV_NO_MEMORY;
  // how far the links of a tree are apart at the start
  for (int i = 1; i < m->nlink && !status; i++)
    for (int k = 1; k < i; k++)
      if (m->link[i].root == m->link[k].root) {
        double apart[3];
        sub3(apart, state->com + 3 * i, state->com + 3 * k);
        size = fmax(size, norm3(apart));
      }
  cav_state_free(state);
  return status || size == 0 ? status : is_deeper(problem, 0, buried * size, sinks);
}
