/// Links and contacts after the step, at q (+) h v_next, for the options that have rows see what is there in the place of
/// J v_next: the gap (next_gap.c), the way of the point (next_slip.c). In the inverse v_next is known: it stays closed.
#include <stdlib.h>
#include <string.h>

#include "constraint.h"
#include "math3.h"

static cav_next_knot *knot_new(const cav_model *model, const cav_state *state) {
  size_t n = (size_t)model->nlink, nv = (size_t)model->nv, nq = (size_t)model->nq;
  size_t bytes = sizeof(cav_next_knot) + n * sizeof(cav_pose) + (nq + 9 * n + 18 * nv) * sizeof(double);
  cav_next_knot *next = calloc(1, bytes);
  if (!next) return NULL;
  next->bytes = bytes;
  next->link = (cav_pose *)(next + 1);
  next->q = (double *)(next->link + n);
  next->com = next->q + nq;
  next->inertia = next->com + 3 * n;
  next->axis = next->inertia + 6 * n;
  next->by_q = next->axis + 6 * nv;
  next->by_v = next->by_q + 6 * nv;
  int hinted = 0;
  for (int p = 0; p < model->npair; p++) hinted |= cav_pair_keeps_hint(model, &model->pair[p]);
  if (hinted) {
    next->hint = calloc((size_t)model->npair, sizeof *next->hint);
    next->bytes += (size_t)model->npair * sizeof *next->hint;
  }
  if (hinted && !next->hint) {
    free(next);
    return NULL;
  }
  // the world stays where it is
  next->link[0] = state->link[0];
  return next;
}

cav_status cav_next_knot_new(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  if (!w->next) w->next = knot_new(model, state);
  cav_next_knot *next = w->next;
  if (!next) return CAV_NO_MEMORY;
  if (state->ncontact <= next->room) return CAV_OK;
  cav_next_contact *larger = realloc(next->contact, (size_t)w->contact_room * sizeof *larger);
  if (!larger) return CAV_NO_MEMORY;
  next->contact = larger;
  next->room = w->contact_room;
  return CAV_OK;
}

void cav_next_knot_free(cav_next_knot *next) {
  if (!next) return;
  free(next->contact);
  free(next->hint);
  free(next);
}

size_t cav_next_knot_bytes(const cav_next_knot *next) {
  return next ? next->bytes + (size_t)next->room * sizeof *next->contact : 0;
}

// J v_next of tangential rows gives way to what they see
static void see_way(const cav_state *state, cav_contact *c, cav_next_contact *next) {
  for (int k = 1; k < 3; k++) {
    const double seen = dot3(c->frame + 3 * k, next->way) / state->options.timestep;
    next->excess[k] = seen - c->velocity_next[k];
    c->velocity_next[k] = seen;
  }
}

void cav_next_links_place(const cav_model *model, cav_state *state, const double *v_next) {
  cav_next_knot *next = state->work->next;
  cav_integrate(model, state->work->q, v_next, state->options.timestep, next->q);
  const cav_posture at = {next->q, next->link, next->com, next->inertia, state->reference, next->axis, 1};
  cav_posture_place(model, state->work, &at);
}

void cav_next_contacts_find(const cav_model *model, cav_state *state) {
  cav_next_knot *next = state->work->next;
  const cav_options *o = &state->options;
  if (state->ncontact == 0) return;
  cav_next_links_place(model, state, state->work->v_next);
  memset(next->contact, 0, (size_t)state->ncontact * sizeof *next->contact);
  if (o->next_gap == CAV_NEXT_GAP_EXACT) cav_next_gaps_find(model, state);
  for (int i = 0; i < state->ncontact && o->next_slip == CAV_NEXT_SLIP_EXACT; i++) {
    cav_contact *c = &state->contact[i];
    if (c->dim == 1) continue;
    cav_next_slip_find(state, c, &next->contact[i]);
    see_way(state, c, &next->contact[i]);
  }
}

void cav_next_contacts_differentiate(const cav_model *model, cav_state *state) {
  cav_next_knot *next = state->work->next;
  if (state->ncontact == 0) return;
  cav_displaced_twists(model, state->options.timestep, state->work->v_next, next->axis, next->by_q, next->by_v);
  if (state->options.next_gap == CAV_NEXT_GAP_EXACT) cav_next_gaps_differentiate(model, state);
}

void cav_next_contact_rates(const cav_model *model, const cav_state *state, int contact, int dof, double rate[3][2]) {
  const cav_next_knot *next = state->work->next;
  const cav_next_contact *c = &next->contact[contact];
  const double *reference = state->reference + 3 * model->dof[dof].link;
  const double *twist[2] = {next->by_q + 6 * dof, next->by_v + 6 * dof};
  for (int k = 0; k < 2; k++) {
    double velocity[3];
    velocity_at(velocity, twist[k], reference, c->pos);
    rate[0][k] = dot3(c->gradient, twist[k]) + dot3(c->gradient + 3, velocity);
    velocity_at(velocity, twist[k], reference, c->after);
    for (int i = 0; i < 2; i++) rate[1 + i][k] = dot3(c->tangent[i], velocity);
  }
}
