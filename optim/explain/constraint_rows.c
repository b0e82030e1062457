/// Constraint rows of a solved transcription by what they come from: the way back from a knot's slots to actuators,
/// joints, tendons and terms, with the penalty on each row and its pull: the force that penalty times gradient puts on
/// the motion, summed with the rows of the same thing at the knots beside it, since what acts and recoils within one
/// thing is no conflict. Only rows that are violated or have a multiplier are listed; what they mean in words is
/// explain.c's.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "transcription.h"

/// Multipliers below this fraction of the largest are noise.
static const double floor_fraction = 1e-9;

/// A listed row and its slot.
typedef struct listed {
  cav_binding binding;
  int slot;
} listed;

typedef struct list {
  const cav_transcription *tr;
  int n, room;
  listed *item;
  int *first;    ///< [nknot+1] where each knot's items start
  double *force; ///< [nv] scratch
} list;

static double slot_excess(const cav_slot *slot) {
  return fmax(fmax(slot->lower - slot->value, slot->value - slot->upper), 0);
}

/// The dof on which a linear form of u falls most.
static int main_dof(const cav_force_row *form) {
  int best = 0;
  for (int k = 1; k < form->n; k++)
    if (fabs(form->coef[k]) > fabs(form->coef[best])) best = k;
  return form->n ? form->dof[best] : 0;
}

/// The i-th limited joint or tendon.
static int limited_joint(const cav_model *m, int i) {
  int j = 0;
  for (; i >= 0; j++) i -= m->joint[j].limited;
  return j - 1;
}

static int limited_tendon(const cav_model *m, int i) {
  int k = 0;
  for (; i >= 0; k++) i -= m->tendon[k].limited;
  return k - 1;
}

/// The hard term and component behind the i-th term row of a knot.
static void term_origin(const cav_transcription *tr, int t, int i, cav_binding *b) {
  int hard = -1;
  for (int k = 0; k < tr->problem->nterm; k++) {
    const cav_term *term = &tr->problem->term[k];
    hard += term->use != CAV_USE_COST;
    if (term->use == CAV_USE_COST || cav_term_weight(tr, term, t) == 0) continue;
    int dim = cav_term_dim(term), reading = cav_term_is_reading(term);
    b->object = hard;
    b->component = reading && term->component >= 0 ? term->component : i;
    if (reading && i < dim) return;
    for (int d = 0; !reading && d < tr->nv; d++) {
      b->component = d;
      if (cav_dof_selected(tr, term, d) && i-- == 0) return;
    }
    i -= dim;
  }
}

void cav_transcription_origin(const cav_transcription *tr, int t, int i, cav_binding *b) {
  const cav_slot_layout *at = &tr->knot[t].layout;
  const cav_slot *slot = &tr->knot[t].slot[i];
  *b = (cav_binding){.knot = t, .value = slot->value, .lower = slot->lower, .upper = slot->upper};
  if (i < at->effort) {
    b->kind = CAV_BINDING_UNACTUATED, b->object = main_dof(&tr->unactuated[i]), b->component = i;
  } else if (i < at->joint) {
    b->kind = CAV_BINDING_EFFORT, b->object = tr->limited[i - at->effort];
    b->component = i - at->effort >= tr->model->nu;
  } else if (i < at->tendon) {
    b->kind = CAV_BINDING_JOINT, b->object = limited_joint(tr->model, i - at->joint);
  } else if (i < at->term) {
    b->kind = CAV_BINDING_TENDON, b->object = limited_tendon(tr->model, i - at->tendon);
  } else {
    b->kind = CAV_BINDING_TERM;
    term_origin(tr, t, i - at->term, b);
  }
}

/// Finds the binding of the same thing at knot t; NULL if none is listed there.
static const listed *same_at(const list *all, const cav_binding *b, int t) {
  if (t < 0 || t >= all->tr->nknot) return NULL;
  for (int i = all->first[t]; i < all->first[t + 1]; i++) {
    const cav_binding *other = &all->item[i].binding;
    if (other->kind == b->kind && other->object == b->object && other->component == b->component) return &all->item[i];
  }
  return NULL;
}

/// Squared norm of the force on the unknowns of knot k by all rows of the same thing.
static double net_force(const list *all, const cav_binding *b, int k) {
  const cav_transcription *tr = all->tr;
  int nv = tr->nv;
  double sum = 0;
  if (tr->periodicity) k = (k + tr->nknot - 2) % (tr->nknot - 1) + 1;
  if (k < tr->first || k >= tr->nknot) return 0;
  memset(all->force, 0, (size_t)nv * sizeof(double));
  // knots that see it: beside it, and across the seam of a cycle
  for (int i = 0; i < 9; i++) {
    int t = k - 1 + i % 3 + (i / 3 - 1) * (tr->nknot - 1);
    const listed *at = same_at(all, b, t);
    for (int c = 0; at && c < 3; c++) {
      if (cav_transcription_block(tr, t, c) != k - tr->first) continue;
      const double *row = tr->knot[t].slot_row + ((size_t)at->slot * 3 + (size_t)c) * (size_t)nv;
      for (int d = 0; d < nv; d++) all->force[d] += at->binding.multiplier * row[d];
    }
  }
  for (int d = 0; d < nv; d++) sum += all->force[d] * all->force[d];
  return sum;
}

static int list_add(list *all, const listed *item) {
  if (all->n == all->room) {
    all->room = all->room ? 2 * all->room : 64;
    listed *larger = realloc(all->item, (size_t)all->room * sizeof *larger);
    if (!larger) return 0;
    all->item = larger;
  }
  all->item[all->n++] = *item;
  return 1;
}

/// Lists the rows that are violated or have a multiplier.
static int list_rows(list *all, const double allowed[CAV_BINDING_KINDS]) {
  const cav_transcription *tr = all->tr;
  double largest = 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++)
      largest = fmax(largest, fabs(tr->knot[t].slot[i].final_multiplier));
  for (int t = 0; t < tr->nknot; t++) {
    all->first[t] = all->n;
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      const cav_slot *slot = &tr->knot[t].slot[i];
      cav_binding b;
      cav_transcription_origin(tr, t, i, &b);
      b.allowed = allowed[b.kind];
      b.multiplier = slot->final_multiplier;
      if (slot_excess(slot) <= b.allowed && fabs(slot->final_multiplier) <= floor_fraction * largest) continue;
      if (!list_add(all, &(listed){b, i})) return 0;
    }
  }
  all->first[tr->nknot] = all->n;
  return 1;
}

cav_status cav_transcription_rows(const cav_transcription *tr, const double allowed[CAV_BINDING_KINDS],
                                  cav_binding **row, int *n) {
  list all = {.tr = tr};
  cav_status status = CAV_NO_MEMORY;
  *row = NULL;
  *n = 0;
  all.first = malloc(((size_t)tr->nknot + 1) * sizeof(int));
  all.force = malloc((size_t)tr->nv * sizeof(double));
  if (!all.first || !all.force || !list_rows(&all, allowed)) goto end;
  *row = malloc(((size_t)all.n + 1) * sizeof **row);
  if (!*row) goto end;
  for (int i = 0; i < all.n; i++) {
    cav_binding *b = &(*row)[i];
    *b = all.item[i].binding;
    double sum = net_force(&all, b, b->knot - 1) + net_force(&all, b, b->knot) + net_force(&all, b, b->knot + 1);
    b->pull = sqrt(sum / 3);
  }
  *n = all.n;
  status = CAV_OK;
end:
  free(all.item), free(all.first), free(all.force);
  return status;
}
