/// Groups of dofs that no second derivative of a knot's readings joins. Inertial forces are sums over links, each a function of
/// the dofs between it and the root: two dofs meet where one is above the other in the tree, and so left and right arm do not.
/// A contact joins what moves either of its links, a tendon what moves it. Columns of a group are differenced as one: a sparse
/// symmetric matrix needs as many differences as a star colouring of its graph has colours (Coleman and Moré 1984), found
/// greedily, the dofs near the root first.
#include "dof_groups.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "knot.h"

/// Fraction of the weight below which solids that do not touch do not push.
static const double no_push = 1e-12;

int cav_dof_groups_make(cav_dof_groups *g, int nv) {
  size_t n = (size_t)nv;
  *g = (cav_dof_groups){.nv = nv, .joined = malloc(n * n + 1), .group = malloc((n * n + n + 1) * sizeof(int))};
  g->count = g->group ? g->group + n : NULL;
  return g->joined && g->group;
}

void cav_dof_groups_clear(cav_dof_groups *g) { free(g->joined), free(g->group); }

/// Last dof that moves a link; -1: none.
static int dof_of(const cav_model *model, int link) {
  while (link >= 0 && model->link[link].ndof == 0) link = model->link[link].parent;
  return link < 0 ? -1 : model->link[link].dof + model->link[link].ndof - 1;
}

static void join(cav_dof_groups *g, int a, int b) { g->joined[a * g->nv + b] = g->joined[b * g->nv + a] = 1; }

/// Joins what moves one link with what moves another.
static void join_links(cav_dof_groups *g, const cav_model *model, int link1, int link2) {
  for (int a = dof_of(model, link1); a >= 0; a = model->dof[a].parent)
    for (int b = dof_of(model, link2); b >= 0; b = model->dof[b].parent) join(g, a, b);
}

/// Joins what a reading of a sensor joins beside the tree; 0 if that may be anything: it is of one link, of two, or a sum over
/// links.
static int join_sensor(cav_dof_groups *g, const cav_model *model, const cav_sensor *sensor) {
  switch ((int)sensor->type) {
    case CAV_SENSOR_FRAMEPOS:
    case CAV_SENSOR_FRAMEQUAT:
    case CAV_SENSOR_FRAMEXAXIS:
    case CAV_SENSOR_FRAMEYAXIS:
    case CAV_SENSOR_FRAMEZAXIS:
    case CAV_SENSOR_FRAMELINVEL:
    case CAV_SENSOR_FRAMEANGVEL: {
      if (!sensor->referred) return 1;
      join_links(g, model, cav_object_link(model, sensor->object_type, sensor->object),
                 cav_object_link(model, sensor->reference_type, sensor->reference));
      return 1;
    }

    case CAV_SENSOR_JOINTPOS:
    case CAV_SENSOR_JOINTVEL:
    case CAV_SENSOR_SUBTREECOM:
    case CAV_SENSOR_SUBTREELINVEL:
      return 1;
    default:
      return 0;
  }
}

/// The same of all terms whose readings are pulled.
static int join_terms(cav_dof_groups *g, const cav_transcription *tr, int t, const double *pull) {
  pull += tr->nv + CAV_CONTACT_READINGS * tr->knot[t].ncontact;
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    int dim = cav_term_readings(tr, term, t), pulls = 0;
    for (int k = 0; k < dim; k++) pulls |= *pull++ != 0;
    if (pulls && !(term->quantity == CAV_QUANTITY_SENSOR && join_sensor(g, tr->model, &term->sensor))) return 0;
  }
  return 1;
}

/// Whether a contact pushes, or may: its force falls by e in a few tenths of a millimetre.
static int may_push(const cav_transcription *tr, const cav_contact *c) {
  return c->dist <= 0 || fabs(c->impulse[0]) > no_push * tr->options.timestep * tr->weight;
}

static void find_joined(cav_dof_groups *g, const cav_transcription *tr, const cav_state *state, int t,
                        const double *pull) {
  const cav_model *model = tr->model;
  size_t n = (size_t)g->nv;
  memset(g->joined, 0, n * n);
  if (model->nequality > 0 || !join_terms(g, tr, t, pull)) {
    memset(g->joined, 1, n * n);
    return;
  }
  for (int a = 0; a < g->nv; a++)
    for (int b = a; b >= 0; b = model->dof[b].parent) join(g, a, b);
  for (int i = 0; i < state->ncontact; i++)
    if (may_push(tr, &state->contact[i])) join_links(g, model, state->contact[i].link1, state->contact[i].link2);
  for (int i = 0; i < model->ntendon; i++) {
    const int *dof = model->tendon_dof + model->tendon[i].dof;
    for (int a = 0; a < model->tendon[i].ndof; a++)
      for (int b = 0; b < a; b++) join(g, dof[a], dof[b]);
  }
}

/// Whether dof i may join a group, among those before it.
static int fits(const cav_dof_groups *g, int i, int group) {
  int nv = g->nv;
  for (int r = 0; r < i; r++) {
    if (!g->joined[r * nv + i]) continue;
    if (g->group[r] == group) return 0;
    // entries of i and r: in row i of r's group, or in row r of i's
    if (g->count[i * nv + g->group[r]] != 1 && g->count[r * nv + group] != 0) return 0;
    // and those of r that were alone there so far: in the rows of the others
    for (int m = 0; m < i && g->count[r * nv + group] > 0; m++)
      if (g->group[m] == group && g->joined[m * nv + r] && g->count[m * nv + g->group[r]] != 1) return 0;
  }
  return 1;
}

void cav_dof_groups_find(cav_dof_groups *g, const cav_transcription *tr, const cav_state *state, int t,
                         const double *pull) {
  int nv = g->nv;
  find_joined(g, tr, state, t, pull);
  memset(g->count, 0, (size_t)nv * (size_t)nv * sizeof *g->count);
  g->ngroup = 0;
  for (int i = 0; i < nv; i++) {
    int group = 0;
    while (group < g->ngroup && !fits(g, i, group)) group++;
    g->group[i] = group;
    if (group == g->ngroup) g->ngroup++;
    for (int r = 0; r < nv; r++) g->count[r * nv + group] += g->joined[r * nv + i];
  }
}
