/// Pairs of geoms of one robot that are inside each other at rest: covers around a joint, a base and what turns on it.
/// Their makers do not mean them to push, and an engine that lets them does so for good. Left out on demand: pairs of
/// two links of one tree, or of a link and a body that carries it and stands in the world, that overlap by more than a
/// millimetre in the model's own configuration and in every keyframe. So are the two sides of the bearing of a base that
/// stands in the world, where they are within a millimetre of each other: MJCF's filter of parents keeps such pairs of the
/// world alone, and a plan's smoothed law would press them together and brake the joint. Pairs that the file lists are
/// kept. Left out always: a link that no actuator moves and a plane that it keeps its distance from in every posture, as a
/// door that is hinged over the floor. A smoothed law, which acts at a distance, would have it rub there.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "compile.h"
#include "math3.h"

static const double least = 1e-3; // m: fingers that close on each other overlap by rounding

// whether a body stands on the way from a link's body to the world, the world itself left aside
static int carries(const cav_model *m, int body, int link) {
  for (int b = m->link[link].body; b > 0; b = m->body[b].parent)
    if (b == body) return 1;
  return 0;
}

static int of_one_robot(const cav_model *m, const cav_pair *pair) {
  const cav_geom *g1 = &m->geom[pair->geom1], *g2 = &m->geom[pair->geom2];
  if (g1->link && g2->link) return m->link[g1->link].root == m->link[g2->link].root;
  return g1->link ? carries(m, g2->body, g1->link) : carries(m, g1->body, g2->link);
}

// a base that stands in the world and what its own joint carries
static int of_bearing(const cav_model *m, const cav_pair *pair) {
  int a = m->geom[pair->geom1].link, b = m->geom[pair->geom2].link;
  return !a != !b && m->link[a + b].parent == 0 && of_one_robot(m, pair);
}

// counts for each pair the configurations in which it overlaps, and how deep at most
static cav_status note(const cav_model *m, cav_state *state, const double *q, int *times, double *depth, char *seen) {
  cav_status status = cav_position(m, state, q);
  memset(seen, 0, (size_t)m->npair + 1);
  for (int i = 0; i < state->ncontact && status == CAV_OK; i++) {
    const cav_contact *c = &state->contact[i];
    if (-c->dist > depth[c->pair]) depth[c->pair] = -c->dist;
    double beyond = of_bearing(m, &m->pair[c->pair]) ? -least : least;
    if (-c->dist > beyond && !seen[c->pair]) seen[c->pair] = 1, times[c->pair]++;
  }
  return status;
}

// takes the pairs out that overlap in all configurations; the deepest is named
static int take_out(cav_model *m, int configurations, const int *times, const double *depth, char *text, size_t room) {
  cav_pair *pair = (cav_pair *)m->pair;
  int n = 0, deepest = -1, taken = 0;
  char one[CAV_GEOM_LABEL], other[CAV_GEOM_LABEL];
  for (int i = 0; i < m->npair; i++) {
    int out = times[i] == configurations && !pair[i].listed && of_one_robot(m, &pair[i]);
    if (out && (deepest < 0 || depth[i] > depth[deepest])) deepest = i;
    taken += out;
  }
  if (taken) {
    snprintf(
        text, room,
        "left out: %d %s of geoms that overlap at rest%s, '%.60s' and '%.60s' by %.3g mm%s; list a <pair> to keep one",
        taken, taken == 1 ? "pair" : "pairs", depth[deepest] > least ? "" : " or meet in the bearing of a base",
        cav_geom_label(m, pair[deepest].geom1, one), cav_geom_label(m, pair[deepest].geom2, other),
        1e3 * depth[deepest], taken == 1 ? "" : " the most");
  }
  for (int i = 0; i < m->npair; i++) {
    int out = times[i] == configurations && !pair[i].listed && of_one_robot(m, &pair[i]);
    if (!out) pair[n++] = pair[i];
  }
  m->npair = n;
  return taken;
}

int cav_overlaps_leave(cav_model *model, char *text, size_t room) {
  cav_state *state = cav_state_new(model);
  int *times = calloc((size_t)model->npair + 1, sizeof *times), taken = -1;
  double *depth = calloc((size_t)model->npair + 1, sizeof *depth);
  char *seen = calloc((size_t)model->npair + 1, 1);
  cav_status status = state && times && depth && seen ? CAV_OK : CAV_NO_MEMORY;
  // contacts are listed as far as the smoothed law acts
  if (state) state->options.smoothing = state->options.smoothing_self = least;
  if (!status) status = note(model, state, model->q0, times, depth, seen);
  for (int k = 0; k < model->nkey && !status; k++) status = note(model, state, model->key[k].q, times, depth, seen);
  // where there are no poses nothing is said of them here
  if (status != CAV_NO_MEMORY) taken = status ? 0 : take_out(model, 1 + model->nkey, times, depth, text, room);
  cav_state_free(state);
  free(times);
  free(depth);
  free(seen);
  return taken;
}

// whether all joints between a link and the world turn about n or slide square to it, n in the world; without a state, whether
// they may
static int keeps_height(const cav_model *m, const cav_state *state, int link, const double n[3]) {
  for (int l = link; l > 0; l = m->link[l].parent)
    for (int j = m->link[l].joint; j < m->link[l].joint + m->link[l].njoint; j++) {
      const cav_joint *joint = m->joint + j;
      if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) return 0;
      if (!state) continue;
      double axis[3];
      rotate(axis, state->link[l].rotation, joint->axis);
      const double along = fabs(dot3(axis, n));
      if (joint->type == CAV_JOINT_HINGE ? along < 1 - 1e-12 : along > 1e-9) return 0;
    }
  return 1;
}

// whether a pair is of a plane of the world and of what keeps its distance from it, moved by no actuator; without a state,
// whether it may be
static int keeps_off(const cav_model *m, const cav_state *state, const cav_pair *pair) {
  const cav_geom *plane = m->geom + pair->geom1;
  const int link = m->geom[pair->geom2].link;
  double n[3];
  column3(n, plane->rotation, 2);
  return plane->type == CAV_GEOM_PLANE && !plane->link && !pair->listed && !m->link[link].driven &&
         keeps_height(m, state, link, n);
}

cav_status cav_pairs_leave(cav_model *model) {
  cav_pair *pair = (cav_pair *)model->pair;
  int n = 0;
  for (int i = 0; i < model->npair; i++) n += keeps_off(model, NULL, &pair[i]);
  if (!n) return CAV_OK;
  cav_state *state = cav_state_new(model);
  char *near = calloc((size_t)model->npair + 1, 1);
  cav_status status = state && near ? CAV_OK : CAV_NO_MEMORY;
  // contacts are listed where they are this near, and farther
  if (state) state->options.smoothing = least;
  if (!status) status = cav_position(model, state, model->q0);
  for (int i = 0; !status && i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    near[c->pair] |= c->dist <= fmax(c->margin, 0) + 1e-9;
  }
  n = 0;
  for (int i = 0; i < model->npair && !status; i++)
    if (near[i] || !keeps_off(model, state, &pair[i])) pair[n++] = pair[i];
  // where there are no poses nothing is left out
  if (!status) model->npair = n;
  cav_state_free(state);
  free(near);
  return status == CAV_NO_MEMORY ? status : CAV_OK;
}
