/// Which rows one knot has, and room for them: knot.c lays as many as are counted here.
#include "knot.h"

#include <assert.h>
#include <limits.h>
#include <string.h>

int cav_knot_moves(const cav_transcription *tr, int t) { return tr->periodicity || (t >= tr->first && t < tr->nknot); }

/// Readings of a contact that a cost takes: n from the first, of those whose bits under the mask are so.
typedef struct contact_part {
  int first, n, mask, bits;
} contact_part;

/// n 0: not a cost of contacts.
static contact_part contact_part_of(cav_quantity quantity) {
  enum { SELF = CAV_WITHIN_TREE, EDGE = CAV_AT_EDGE, IDLE = CAV_IDLE };
  static const contact_part part[CAV_QUANTITY_TYPES] = {
      [CAV_QUANTITY_GAP] = {0, 1, SELF | IDLE, 0},           [CAV_QUANTITY_SLIP] = {1, 2, SELF | IDLE, 0},
      [CAV_QUANTITY_IMPACT] = {3, 1, SELF | IDLE, 0},        [CAV_QUANTITY_SELF_PENETRATION] = {0, 1, SELF, SELF},
      [CAV_QUANTITY_FORCE] = {4, 1, SELF | IDLE, 0},         [CAV_QUANTITY_SELF_FORCE] = {4, 1, SELF, SELF},
      [CAV_QUANTITY_EDGE_FORCE] = {5, 1, EDGE | IDLE, EDGE}, [CAV_QUANTITY_CLEARANCE] = {6, 2, CAV_CLEARS, CAV_CLEARS},
  };
  assert(part[quantity].first + part[quantity].n <= CAV_CONTACT_READINGS);
  return part[quantity];
}

/// Rows that are begun, and how many of them at most are laid over all columns.
typedef struct row_count {
  size_t rows, dense;
} row_count;

int cav_knot_stands_alone(const cav_force_row *form) { return form->n != 1; }

/// Whether a term of slip lets a contact of two links slide at knot t: the floor under a box.
static int frees(const cav_transcription *tr, const cav_term *term, int t, int link1, int link2) {
  if (term->quantity != CAV_QUANTITY_SLIP || term->body <= 0 || !(term->within > 0)) return 0;
  int link = tr->model->body[term->body].link;
  return (link == link1 || link == link2) && cav_term_weight(tr, term, t) > 0;
}

/// Whether a term counts the k-th contact of knot t, key [2*contacts]: of a body that moves those of its link, of one that is
/// fixed to the world those of its own geoms. One of slip over all contacts leaves those of what no actuator moves that another
/// term frees, one of clearance all that it frees.
static int counts(const cav_transcription *tr, const int *key, const cav_term *term, int t, int k) {
  const cav_model *m = tr->model;
  const int clearance = term->quantity == CAV_QUANTITY_CLEARANCE;
  if (term->body <= 0 && term->quantity != CAV_QUANTITY_SLIP && !clearance) return 1;
  const cav_pair *pair = &m->pair[key[2 * k]];
  const cav_geom *one = &m->geom[pair->geom1], *two = &m->geom[pair->geom2];
  int link = m->body[term->body].link, link1 = one->link, link2 = two->link;
  if (term->body > 0 && link == 0) return one->body == term->body || two->body == term->body;
  if (term->body > 0) return link1 == link || link2 == link;
  if (!clearance && (m->link[link1].driven || m->link[link2].driven)) return 1;
  for (int i = 0; i < tr->problem->nterm; i++)
    if (frees(tr, &tr->problem->term[i], t, link1, link2)) return 0;
  return 1;
}

int cav_knot_takes_contacts(const cav_term *term) { return contact_part_of(term->quantity).n > 0; }

int cav_knot_contact(const cav_transcription *tr, const int *key, const cav_term *term, int t, int k, int *first) {
  contact_part part = contact_part_of(term->quantity);
  *first = part.first;
  return part.n > 0 && (tr->knot[t].moving[k] & part.mask) == part.bits && counts(tr, key, term, t, k) ? part.n : 0;
}

/// Rows of a cost at knot t, whose contacts are listed.
static row_count cost_rows(const cav_transcription *tr, cav_scratch *s, const cav_term *term, int t) {
  const cav_knot *knot = &tr->knot[t];
  row_count n = {0};
  if (cav_term_weight(tr, term, t) == 0) return n;
  int rate = term->quantity == CAV_QUANTITY_ACCELERATION, first;
  switch (term->quantity) {
    case CAV_QUANTITY_SENSOR:
    case CAV_QUANTITY_TRACK:
    case CAV_QUANTITY_USER:
      n.rows = n.dense = (size_t)cav_term_dim(term);
      break;
    case CAV_QUANTITY_CONFIGURATION:
    case CAV_QUANTITY_VELOCITY:
    case CAV_QUANTITY_ACCELERATION:
      if (rate ? !knot->has_force : !cav_knot_moves(tr, t)) break;
      n.rows = (size_t)cav_term_window(tr, term)->dofs;
      break;
    case CAV_QUANTITY_EFFORT:
      if (!knot->has_force) break;
      n.rows = (size_t)tr->model->nu;
      for (int k = 0; k < tr->model->nu; k++) n.dense += (size_t)cav_knot_stands_alone(&tr->effort[k]);
      break;
    case CAV_QUANTITY_POWER:
      if (knot->has_force) n.rows = n.dense = (size_t)tr->model->nu;
      break;
    case CAV_QUANTITY_GAP:
    case CAV_QUANTITY_SLIP:
    case CAV_QUANTITY_IMPACT:
    case CAV_QUANTITY_SELF_PENETRATION:
    case CAV_QUANTITY_FORCE:
    case CAV_QUANTITY_EDGE_FORCE:
    case CAV_QUANTITY_CLEARANCE:
    case CAV_QUANTITY_SELF_FORCE:
      for (int k = 0; k < knot->ncontact; k++) {
        const int readings = cav_knot_contact(tr, s->key, term, t, k, &first);
        n.rows += (size_t)readings;
        s->used[k] |= (unsigned char)(((1 << readings) - 1) << first);
      }
      n.dense = n.rows;
      break;
    case CAV_QUANTITY_TYPES:
      break;
  }
  return n;
}

/// Rows of all constraints at knot t.
static row_count constraint_rows(const cav_transcription *tr, int t) {
  row_count n = {.rows = (size_t)tr->knot[t].layout.count};
  if (tr->knot[t].has_force) {
    for (int k = 0; k < tr->nresidual; k++) n.dense += (size_t)cav_knot_stands_alone(&tr->unactuated[k]);
    for (int k = 0; k < tr->nlimit; k++) n.dense += tr->servo[k].n > 0 || cav_knot_stands_alone(&tr->effort[k]);
  }
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    if (term->use != CAV_USE_COST) n.dense += (size_t)cav_term_readings(tr, term, t);
  }
  return n;
}

int cav_knot_has_duration(const cav_transcription *tr, int t) { return tr->free_step && t == 0; }

/// All rows of knot t.
static row_count knot_rows(const cav_transcription *tr, cav_scratch *s, int t) {
  row_count n = constraint_rows(tr, t);
  // those along single dofs
  n.dense += (size_t)tr->nv;
  if (tr->constraints_only) return n;
  n.rows += (size_t)cav_knot_has_duration(tr, t);
  for (int k = 0; k < tr->knot[t].ncontact && tr->depth_weight > 0; k++)
    if (!(tr->knot[t].moving[k] & (CAV_WITHIN_TREE | CAV_IDLE))) n.rows++, n.dense++, s->used[k] |= 1;
  for (int k = 0; k < tr->npenalised && tr->knot[t].has_force; k++)
    n.rows++, n.dense += cav_knot_stands_alone(&tr->penalised[k]);
  for (int i = 0; i < tr->problem->nterm; i++) {
    if (tr->problem->term[i].use != CAV_USE_COST) continue;
    row_count cost = cost_rows(tr, s, &tr->problem->term[i], t);
    n.rows += cost.rows;
    n.dense += cost.dense;
  }
  return n;
}

/// Room for the dense rows of a sum; 0 if memory runs out.
static int reserve_dense(cav_sum *a) {
  cav_scratch *s = a->s;
  cav_knot *knot = a->knot;
  int *room = a->passing ? &s->dense_room : &knot->dense_room;
  double **dense = a->passing ? &s->dense : &knot->dense, **rest = a->passing ? &s->rest : &knot->rest;
  if (a->jacobian && knot->dense_most > *room) {
    if (!cav_readings_grow(dense, (size_t)knot->dense_most * 3 * (size_t)a->tr->nv) ||
        !cav_readings_grow(rest, (size_t)knot->dense_most))
      return 0;
    *room = knot->dense_most;
  }
  a->dense = *dense, a->rest = *rest;
  return 1;
}

int cav_knot_reserve(cav_sum *a) {
  cav_transcription *tr = a->tr;
  cav_scratch *s = a->s;
  cav_knot *knot = a->knot;
  if (knot->ncontact > 0) memset(s->used, 0, (size_t)knot->ncontact);
  row_count n = knot_rows(tr, s, a->t);
  if (n.rows > INT_MAX / 2 || n.dense > INT_MAX / 2) return 0;
  knot->nrow = (int)n.rows;
  a->counted = 1;
  knot->dense_most = (int)n.dense;
  if (!reserve_dense(a)) return 0;
  if (!tr->free_step) return 1;
  if (knot->nrow > s->trace_room) {
    if (!cav_readings_grow(&s->trace[0], n.rows) || !cav_readings_grow(&s->trace[1], n.rows)) return 0;
    s->trace_room = knot->nrow;
  }
  size_t slots = (size_t)knot->layout.count;
  if (knot->layout.count > s->slot_room) {
    if (!cav_readings_grow(&s->slot[0], slots) || !cav_readings_grow(&s->slot[1], slots)) return 0;
    s->slot_room = knot->layout.count;
  }
  return 1;
}
