/// Which slots of a transcription are rows for Ipopt and which bound its unknowns; the structure of the rows' Jacobian; bounds
/// and multipliers there and back.
#include "ipopt_rows.h"

#include <math.h>
#include <stdlib.h>

/// Whether a slot is the range of a scalar joint, which bounds an unknown.
static int is_bound(const cav_transcription *tr, int t, int i, int *dof) {
  const cav_slot_layout *at = &tr->knot[t].layout;
  if (i < at->joint || i >= at->tendon) return 0;
  int joint = 0;
  for (int left = i - at->joint; left >= 0; joint++) left -= tr->model->joint[joint].limited;
  *dof = tr->model->joint[joint - 1].dof;
  return tr->model->joint[joint - 1].type != CAV_JOINT_BALL;
}

int cav_ipopt_law_acts(const cav_model *m) {
  int acts = m->npair > 0 || m->nequality > 0;
  for (int j = 0; j < m->njoint; j++) acts |= m->joint[j].limited;
  for (int d = 0; d < m->nv; d++) acts |= m->dof[d].frictionloss > 0;
  for (int k = 0; k < m->ntendon; k++) acts |= m->tendon[k].limited || m->tendon[k].frictionloss > 0;
  return acts;
}

/// Whether slot i of knot t is a row of its own. Where the contact law acts, one without bounds is none: Ipopt would give it a
/// slack, and count the distance to it as violation, so that its filter takes steps that make the cost worse. Elsewhere such
/// a row lifts the force to an unknown of its own, which bends less.
static int is_row(const cav_ipopt_rows *p, const cav_transcription *tr, int t, int i) {
  const cav_slot *slot = &tr->knot[t].slot[i];
  int dof;
  if (p->passing) return 0;
  return !is_bound(tr, t, i, &dof) &&
         (!cav_ipopt_law_acts(tr->model) || isfinite(slot->lower) || isfinite(slot->upper));
}

/// Whether a row depends on the step: forces, and terms that read more than the configuration.
static int sees_step(const cav_transcription *tr, int t, int i) {
  const cav_slot_layout *at = &tr->knot[t].layout;
  return i < at->joint || i >= at->term;
}

int cav_ipopt_rows_list(cav_ipopt_rows *p, const cav_transcription *tr) {
  int nv = tr->nv;
  char *pattern = malloc(4 * (size_t)nv);
  if (!pattern) return 0;
  p->n = cav_transcription_unknowns(tr);
  for (int pass = 0; pass < 2; pass++) {
    int m = 0, entries = 0;
    for (int t = 0; t < tr->nknot; t++) {
      for (int i = 0; i < tr->knot[t].layout.count; i++) {
        if (!is_row(p, tr, t, i)) continue;
        if (pass) p->row_knot[m] = t, p->row_slot[m] = i;
        cav_transcription_pattern(tr, t, i, pattern);
        for (int c = 0; c < 3 * nv; c++) {
          if (!pattern[c]) continue;
          if (pass) {
            p->jacobian_row[entries] = m;
            p->jacobian_column[entries] = cav_transcription_block(tr, t, c / nv) * nv + c % nv;
            p->source[entries] = c;
          }
          entries++;
        }
        // a free step is seen by what is not of the posture alone
        if (tr->free_step && sees_step(tr, t, i)) {
          if (pass) {
            p->jacobian_row[entries] = m;
            p->jacobian_column[entries] = p->n - 1;
            p->source[entries] = 3 * nv;
          }
          entries++;
        }
        m++;
      }
    }
    if (pass) break;
    p->m = m;
    p->entries = entries;
    p->row_knot = malloc((size_t)(m + 1) * sizeof(int));
    p->row_slot = malloc((size_t)(m + 1) * sizeof(int));
    p->jacobian_row = malloc((size_t)(entries + 1) * sizeof(int));
    p->jacobian_column = malloc((size_t)(entries + 1) * sizeof(int));
    p->source = malloc((size_t)(entries + 1) * sizeof(int));
    if (!p->row_knot || !p->row_slot || !p->jacobian_row || !p->jacobian_column || !p->source) break;
  }
  free(pattern);
  return p->row_knot && p->row_slot && p->jacobian_row && p->jacobian_column && p->source;
}

void cav_ipopt_rows_free(cav_ipopt_rows *p) {
  free(p->row_knot), free(p->row_slot), free(p->jacobian_row), free(p->jacobian_column), free(p->source);
}

void cav_ipopt_rows_bounds(const cav_ipopt_rows *p, const cav_transcription *tr, double step, double *x_lower,
                           double *x_upper, double *g_lower, double *g_upper) {
  const double infinite = 2e19;
  int dof;
  for (int i = 0; i < p->n; i++) x_lower[i] = -infinite, x_upper[i] = infinite;
  if (tr->free_step) {
    double steps = tr->nknot - 1;
    x_lower[p->n - 1] = log(tr->problem->duration_least / (steps * step));
    x_upper[p->n - 1] = log(tr->problem->duration_most / (steps * step));
  }
  for (int t = 0; t < tr->nknot && !p->passing; t++) {
    for (int i = tr->knot[t].layout.joint; i < tr->knot[t].layout.tendon; i++) {
      if (!is_bound(tr, t, i, &dof)) continue;
      const cav_slot *slot = &tr->knot[t].slot[i];
      x_lower[(t - tr->first) * tr->nv + dof] = slot->lower - slot->value;
      x_upper[(t - tr->first) * tr->nv + dof] = slot->upper - slot->value;
    }
  }
  for (int i = 0; i < p->m; i++) {
    const cav_slot *slot = &tr->knot[p->row_knot[i]].slot[p->row_slot[i]];
    g_lower[i] = fmax(slot->lower, -infinite);
    g_upper[i] = fmin(slot->upper, infinite);
  }
}

void cav_ipopt_rows_multipliers(const cav_ipopt_rows *p, cav_transcription *tr, double *multiplier, int back) {
  double *lower = multiplier + p->m, *upper = lower + p->n;
  int dof;
  for (int i = 0; i < p->m; i++) {
    cav_slot *slot = &tr->knot[p->row_knot[i]].slot[p->row_slot[i]];
    if (back) slot->multiplier = multiplier[i];
    multiplier[i] = slot->final_multiplier;
  }
  for (int t = 0; t < tr->nknot && !p->passing; t++) {
    for (int i = tr->knot[t].layout.joint; i < tr->knot[t].layout.tendon; i++) {
      if (!is_bound(tr, t, i, &dof)) continue;
      int k = (t - tr->first) * tr->nv + dof;
      cav_slot *slot = &tr->knot[t].slot[i];
      if (back) slot->multiplier = upper[k] - lower[k];
      lower[k] = fmax(-slot->final_multiplier, 0);
      upper[k] = fmax(slot->final_multiplier, 0);
    }
  }
}
