/// Load that a motion carries across open gaps: the fraction of all normal impulse between knots t and t+1 that acts on
/// a contact more than CAV_HOVER_GAP apart at t and still so at t+1. A contact that closes within the step is an
/// arrival, which laws that look at the end of the step catch in flight; one that stays open leans on air. The gap is
/// that of the same point of the same pair at the next knot, or, where that point is gone, of its motion from there.
/// Gaps are counted from the pair's margin, where the file has its contacts begin. What bears less than a hundredth of
/// the weight on average, the tail of the smoothed law in flight, is held against that.
#include <stdio.h>
#include <stdlib.h>

#include "verification.h"

static const double least = 0.01; // of the weight, all contacts, on average

/// A contact that was apart at the knot before.
typedef struct lean {
  int pair, feature;
  double gap, ahead; ///< m; at the knot, and after the step by the contact's velocity
  double load;       ///< N s
} lean;

struct cav_hover {
  lean *open;
  int nopen, room;
  double load, own, total, largest; ///< N s; own: of load between links of one tree
  cav_metric worst;
};

cav_hover *cav_hover_new(void) { return calloc(1, sizeof(cav_hover)); }

void cav_hover_free(cav_hover *hover) {
  if (!hover) return;
  free(hover->open);
  free(hover);
}

static double gap_of(const cav_contact *contact) { return contact->dist - contact->margin; }

// gap of the same point now
static double gap_now(const cav_verification *verification, const lean *l) {
  for (int i = 0; verification && i < verification->state->ncontact; i++) {
    const cav_contact *c = verification->state->contact + i;
    if (c->pair == l->pair && c->feature == l->feature) return gap_of(c);
  }
  return l->ahead;
}

// what was apart at the knot before: still so at this one? verification NULL: there is no such knot
static void settle(cav_hover *hover, const cav_verification *verification, const cav_model *model, int t, double h) {
  for (int i = 0; i < hover->nopen; i++) {
    const lean *l = hover->open + i;
    const double gap = gap_now(verification, l);
    if (!(gap > CAV_HOVER_GAP)) continue;
    hover->load += l->load;
    if (!model->pair[l->pair].external) hover->own += l->load;
    if (l->load <= hover->largest) continue;
    char name1[32], name2[32];
    const cav_pair *pair = model->pair + l->pair;
    hover->largest = l->load;
    hover->worst.knot = t - 1;
    snprintf(hover->worst.where, sizeof hover->worst.where,
             "%.4g N between %.60s and %.60s, %.3g mm apart, then %.3g mm", l->load / h,
             cav_verification_link_name(model, model->geom[pair->geom1].link, name1),
             cav_verification_link_name(model, model->geom[pair->geom2].link, name2), 1e3 * l->gap, 1e3 * gap);
  }
  hover->nopen = 0;
}

cav_status cav_hover_add(cav_hover *hover, const cav_verification *verification, int t) {
  settle(hover, verification, verification->model, t, verification->h);
  if (t >= verification->rows) return CAV_OK;
  const int n = verification->state->ncontact;
  if (n > hover->room) {
    lean *larger = realloc(hover->open, 2 * (size_t)n * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    hover->open = larger;
    hover->room = 2 * n;
  }
  for (int i = 0; i < n; i++) {
    const cav_contact *c = verification->state->contact + i;
    const double gap = gap_of(c);
    hover->total += c->impulse[0];
    if (!(gap > CAV_HOVER_GAP)) continue;
    hover->open[hover->nopen++] =
        (lean){c->pair, c->feature, gap, gap + verification->h * c->velocity_next[0], c->impulse[0]};
  }
  return CAV_OK;
}

void cav_hover_result(cav_hover *hover, const cav_verification *verification, cav_metric *metric, double *self) {
  settle(hover, NULL, verification->model, verification->rows, verification->h);
  *metric = hover->worst;
  const double whole = least * verification->weight * verification->h * verification->rows;
  metric->value = hover->load / (hover->total > whole ? hover->total : whole);
  *self = hover->load > 0 ? hover->own / hover->load : 0;
}
