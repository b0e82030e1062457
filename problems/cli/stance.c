/// How a posture touches and is in things, in one line of inspect: its centre of mass, which bodies touch the world and where,
/// which touch bodies of other trees, and which geom is deepest in what. And the two geoms of a contact by their names, what
/// stands behind what moves.
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "command.h"

// farther apart it does not touch; less deep is rounding; bodies that are named, the others are counted
static const double touching = 0.005, deep = 5e-5; // m
// m beside what bears it from which on a posture is told to fall: a goal is met within some centimetres
static const double leaning = 0.05;
enum { NAMED = 8 };

int cav_command_pair(const cav_model *m, int pair, char moves[CAV_WORDS], char stands[CAV_WORDS]) {
  const cav_pair *of = &m->pair[pair];
  const int still = m->geom[of->geom2].link == 0 ? of->geom2 : of->geom1;
  char label[CAV_WORDS];
  snprintf(moves, CAV_WORDS, "%s", cav_geom_words(m, still == of->geom1 ? of->geom2 : of->geom1, label));
  snprintf(stands, CAV_WORDS, "%s", cav_geom_words(m, still, label));
  return still;
}

const cav_contact *cav_command_deepest(const cav_state *state) {
  const cav_contact *deepest = NULL;
  for (int i = 0; i < state->ncontact; i++)
    if (!deepest || state->contact[i].dist < deepest->dist) deepest = &state->contact[i];
  return deepest;
}

// the body that touches the world by a contact, 0: none
static int body_of(const cav_model *m, const cav_contact *c) {
  const cav_pair *pair = &m->pair[c->pair];
  if (c->dist > touching || (c->link1 != 0) == (c->link2 != 0)) return 0;
  return m->geom[m->geom[pair->geom1].link == 0 ? pair->geom2 : pair->geom1].body;
}

static const char *name_of(const cav_model *m, int body) {
  return *m->body[body].name ? m->body[body].name : "(no name)";
}

// the bodies of two trees that touch by a contact, in the order of the model; 0: none do
static int bodies_of(const cav_model *m, const cav_contact *c, int body[2]) {
  const cav_pair *pair = &m->pair[c->pair];
  const int one = m->geom[pair->geom1].body, other = m->geom[pair->geom2].body;
  body[0] = one < other ? one : other, body[1] = one < other ? other : one;
  return c->dist <= touching && c->link1 > 0 && c->link2 > 0 && pair->external;
}

// ", beam touches ball" of bodies of different trees; returns how many pairs there are
static int print_pairs(const cav_model *m, const cav_state *state, int named) {
  int pairs = 0;
  for (int i = 0; i < state->ncontact; i++) {
    int body[2], other[2], before = 0;
    if (!bodies_of(m, &state->contact[i], body)) continue;
    for (int k = 0; k < i; k++) before |= bodies_of(m, &state->contact[k], other) && !memcmp(body, other, sizeof body);
    if (!before && ++pairs <= named) printf(", %.60s touches %.60s", name_of(m, body[0]), name_of(m, body[1]));
  }
  if (pairs > named) printf(" and %d more", pairs - named);
  return pairs;
}

// ", touches the world with a, b in x 0..1, y 0..1"; where is that of what actuators move, things of the scene aside. And what
// touches what else
static void print_touch(const cav_model *m, const cav_state *state, int named) {
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  int bodies = 0, driven = 0, things = 0;
  for (int i = 0; i < state->ncontact; i++) {
    const int body = body_of(m, &state->contact[i]);
    driven |= body && m->link[m->body[body].link].driven;
    things |= body && !m->link[m->body[body].link].driven;
  }
  for (int i = 0; i < state->ncontact; i++) {
    const int body = body_of(m, &state->contact[i]);
    int before = 0;
    if (!body) continue;
    for (int k = 0; k < 2 && m->link[m->body[body].link].driven == driven; k++) {
      low[k] = fmin(low[k], state->contact[i].pos[k]);
      high[k] = fmax(high[k], state->contact[i].pos[k]);
    }
    for (int k = 0; k < i; k++) before |= body_of(m, &state->contact[k]) == body;
    if (before || ++bodies > named) continue;
    printf("%s%.60s", bodies == 1 ? ", touches the world with " : ", ", name_of(m, body));
  }
  if (bodies > named) printf(" and %d more", bodies - named);
  if (bodies)
    printf("%s in x %.3f..%.3f, y %.3f..%.3f", driven && things ? "; that of what actuators move" : "", low[0], high[0],
           low[1], high[1]);
  if (!print_pairs(m, state, named) && !bodies) printf(", touches nothing of the world");
}

// the centre of mass of what actuators move, things of the scene aside; of all where they move nothing. Whether things were left
// aside. The state is at a posture
static int find_centre(const cav_model *m, const cav_state *state, double com[3]) {
  int driven = 0, aside = 0;
  double mass = 0;
  for (int k = 0; k < 3; k++) com[k] = 0;
  for (int l = 1; l < m->nlink; l++) driven |= m->link[l].driven;
  for (int l = 1; l < m->nlink; l++) {
    const cav_link *link = &m->link[l];
    const cav_pose *pose = &state->link[l];
    aside |= driven && !link->driven;
    if (driven && !link->driven) continue;
    mass += link->mass;
    for (int k = 0; k < 3; k++)
      com[k] += link->mass * (pose->pos[k] + pose->rotation[3 * k] * link->com[0] +
                              pose->rotation[3 * k + 1] * link->com[1] + pose->rotation[3 * k + 2] * link->com[2]);
  }
  for (int k = 0; k < 3 && mass > 0; k++) com[k] /= mass;
  return aside;
}

// how far the centre of mass of what actuators move, which is free, lies beside all that bears it, m, where only level surfaces
// do; 0: over it, or not known
static double beside(const cav_model *m, const cav_state *state, const double com[3]) {
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, off = 0;
  if (m->gravity[0] != 0 || m->gravity[1] != 0 || !(m->gravity[2] < 0)) return 0;
  // what hangs on the world by a joint, or on another body by a constraint, may lean on that
  for (int j = 0; j < m->njoint; j++)
    if (m->link[m->joint[j].link].driven && m->link[m->joint[j].link].parent == 0 && m->joint[j].type != CAV_JOINT_FREE)
      return 0;
  if (m->nequality) return 0;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const int body = body_of(m, c);
    if (c->dist <= touching && c->link1 > 0 && c->link2 > 0 && m->pair[c->pair].external) return 0;
    if (!body || !m->link[m->body[body].link].driven) continue;
    if (fabs(c->frame[2]) < 0.999) return 0;
    for (int k = 0; k < 2; k++) low[k] = fmin(low[k], c->pos[k]), high[k] = fmax(high[k], c->pos[k]);
  }
  for (int k = 0; k < 2 && low[0] <= high[0]; k++) off = fmax(off, fmax(low[k] - com[k], com[k] - high[k]));
  return fmax(off, 0);
}

cav_status cav_command_print_stance(const cav_problem *p, const char *name, const double *q, int rests, int all,
                                    cav_error *error) {
  cav_state *state = cav_state_new(p->model);
  double com[3];
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  // so that contacts are seen before they touch
  if (state) state->options.smoothing = state->options.smoothing_self = touching;
  if (!status) status = cav_position(p->model, state, q);
  if (status) {
    cav_state_free(state);
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "the posture of the %s cannot be evaluated: %s", name,
             cav_status_name(status));
    return status;
  }
  const int some = find_centre(p->model, state, com);
  printf("  %-6s centre of mass%s at %.3f %.3f %.3f m", name, some ? " of what actuators move" : "", com[0], com[1],
         com[2]);
  print_touch(p->model, state, all ? INT_MAX : NAMED);
  const cav_contact *deepest = cav_command_deepest(state);
  if (deepest && -deepest->dist > deep) {
    char moves[CAV_WORDS], stands[CAV_WORDS];
    cav_command_pair(p->model, deepest->pair, moves, stands);
    printf(", deepest penetration %.1f mm: '%.100s' in '%.100s'", -1e3 * deepest->dist, moves, stands);
  }
  printf("\n");
  const double off = rests ? beside(p->model, state, com) : 0;
  if (off > leaning)
    printf(
        "  note: the %s as it stands would fall: its centre of mass is %.2g m beside all that bears it; a seat, a box "
        "or a hand has to touch there\n",
        name, off);
  cav_state_free(state);
  return CAV_OK;
}
