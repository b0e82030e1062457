/// Lengths of tendons within their ranges: by how much they are outside, which they are, and a posture nearby that has all
/// of them inside. A model's own posture need not: MuJoCo's limits are soft, and a string that hangs taut is often modelled as
/// one that is too long at first.
#include "tendon_range.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/problem.h"

static const double inset = 0.05;   // of a range, and m or rad at most: how far inside a length is brought
static const double within = 1e-7;  // m or rad: what counts as inside
static const double farthest = 0.2; // m and rad that a step goes: lengths are not straight
static const double flat = 1e-12, nudge = 0.01;
enum { SWEEPS = 200 };

double cav_tendon_outside(const cav_tendon *t, double length) {
  if (!t->limited) return 0;
  return fmin(length - t->range[0], 0) + fmax(length - t->range[1], 0);
}

/// Brings one tendon that is outside to just inside, by the least motion of dofs. 1: it was outside.
static int bring_in(const cav_model *m, const cav_state *state, int i, double *v, double *next, double *q) {
  const cav_tendon *t = &m->tendon[i];
  const double off = cav_tendon_outside(t, state->tendon_length[i]);
  double square = 0;
  if (fabs(off) <= within) return 0;
  double way = -off - copysign(inset * fmin(t->range[1] - t->range[0], 1), off);
  for (int k = t->dof; k < t->dof + t->ndof; k++) square += state->tendon_arm[k] * state->tendon_arm[k];
  way = copysign(fmin(fabs(way), farthest * sqrt(square)), way);
  memset(v, 0, (size_t)m->nv * sizeof *v);
  // where no dof changes it, as that of a string straight along its least length, all of them a little first
  for (int k = t->dof; k < t->dof + t->ndof; k++)
    v[m->tendon_dof[k]] += square > flat ? way / square * state->tendon_arm[k] : nudge;
  cav_integrate(m, q, v, 1, next);
  memcpy(q, next, (size_t)m->nq * sizeof *q);
  cav_configuration_clip(m, q);
  return 1;
}

cav_status cav_tendons_clip(const cav_model *m, cav_state *state, double *q) {
  int limited = 0, outside = 1;
  for (int i = 0; i < m->ntendon; i++) limited |= m->tendon[i].limited;
  if (!limited) return CAV_OK;
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv;
  double *work = malloc((2 * nq + nv) * sizeof *work), *tried = work, *next = work + nq, *v = work + 2 * nq;
  if (!work) return CAV_NO_MEMORY;
  memcpy(tried, q, nq * sizeof *q);
  cav_status status = CAV_OK;
  for (int sweep = 0; outside && sweep < SWEEPS && !status; sweep++) {
    outside = 0;
    for (int i = 0; i < m->ntendon && !status; i++) {
      status = cav_position(m, state, tried);
      if (!status) outside |= bring_in(m, state, i, v, next, tried);
    }
  }
  // what is not found stays as it was
  if (!status && !outside) memcpy(q, tried, nq * sizeof *q);
  free(work);
  return status == CAV_NO_MEMORY ? status : CAV_OK;
}

static const char *or_nameless(const char *name) { return *name ? name : "(no name)"; }

void cav_tendon_label(const cav_model *m, int i, char label[CAV_TENDON_LABEL]) {
  const cav_tendon *t = &m->tendon[i];
  const char *end[2] = {NULL, NULL};
  int n = 0;
  if (*t->name) {
    snprintf(label, CAV_TENDON_LABEL, "tendon '%.60s'", t->name);
    return;
  }
  for (int k = t->part; t->npath == 0 && k < t->part + t->npart; k++)
    end[n++ > 0] = or_nameless(m->joint[m->tendon_part[k].joint].name);
  for (int k = t->path; t->npath > 0 && k < t->path + t->npath; k++)
    if (m->tendon_path[k].type == CAV_TENDON_PATH_SITE)
      end[n++ > 0] = or_nameless(m->site[m->tendon_path[k].object].name);
  int used = snprintf(label, CAV_TENDON_LABEL, "tendon %d (no name)", i);
  if (end[1])
    snprintf(label + used, CAV_TENDON_LABEL - (size_t)used, ", %s '%.48s' %s '%.48s'",
             t->npath ? "from site"
             : n > 2  ? "of joints from"
                      : "of joints",
             end[0], t->npath || n > 2 ? "to" : "and", end[1]);
}
