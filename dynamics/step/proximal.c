/// Proximal point method on the dual problem (9), Rockafellar 1976: minimise 1/2 f' (A + R) f + f' b + 1/2 |f - f_k|^2
/// in the metric (r - 1) R, and again from the f found. Each is the same problem with R made larger and v* shifted, so
/// the laws keep their closed form and (22); its fixed point is the problem with its own R, under Coulomb's law too.
/// So what Newton factors is never stiffer than the least level, and impulses are sums of what was found, not differences
/// of velocities over R. Directions in which A is not singular converge by level/A a time; impulses that no motion tells
/// apart stay nearly what they are, which is the least that does.
///
/// The smoothed law has no such form, and no need: it bends over its smoothing distance, whatever R is.
#include "proximal.h"

#include <math.h>
#include <string.h>

static double sigma_of(const cav_impulse *p, const cav_block *block) {
  if (block->contact >= 0) return p->state->contact[block->contact].sigma;
  return block->row >= 0 ? p->state->row[block->row].sigma : 0.0;
}

// by what is left of the inertia of each dof when its children move freely
static double weight_of(const cav_impulse *p, const cav_block *block) {
  double sum = 0.0;
  for (int i = 0; i < (block->contact >= 0 ? 1 : block->dim); i++) {
    double own = 0.0;
    for (int k = 0; k < block->ndof; k++) {
      const double J = block->J[i * block->ndof + k];
      own += J * J / p->L[p->state->work->row[block->dof[k]]];
    }
    sum = sum > own ? sum : own;
  }
  return sum;
}

void cav_proximal_begin(cav_proximal *s, cav_impulse *p, double *room) {
  const size_t n = (size_t)p->nrow;
  *s = (cav_proximal){.problem = p, .R = room, .target = room + n, .f = room + 2 * n, .weight = room + 3 * n};
  if (n > 0) {
    memcpy(s->R, p->R, n * sizeof(double));
    memcpy(s->target, p->target, n * sizeof(double));
    memset(s->f, 0, n * sizeof(double));
  }
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    s->weight[b] = sigma_of(p, block) > 0.0 ? 0.0 : weight_of(p, block);
  }
}

int cav_proximal_set(cav_proximal *s, double level) {
  const cav_impulse *p = s->problem;
  int whole = 1;
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    // friction rows keep their ratio to the normal one (22)
    const double more = fmax(level * s->weight[b] / s->R[block->first], 1.0) - 1.0;
    if (more > 0.0) whole = 0;
    for (int i = block->first; i < block->first + block->dim; i++) {
      const double added = more * s->R[i];
      p->R[i] = s->R[i] + added;
      p->target[i] = s->target[i] + added * s->f[i];
    }
  }
  return whole;
}

double cav_proximal_update(cav_proximal *s, const double *f, const double *y) {
  const cav_impulse *p = s->problem;
  double most = 0.0;
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    double change = 0.0, size = 0.0;
    for (int i = block->first; i < block->first + block->dim; i++) {
      change = fmax(change, (p->R[i] - s->R[i]) * fabs(f[i] - s->f[i]));
      size = fmax(size, fmax(fabs(y[i]), fabs(s->target[i])));
      s->f[i] = f[i];
    }
    if (change > 0.0) most = fmax(most, change / size);
  }
  return most;
}

void cav_proximal_end(cav_proximal *s) {
  const size_t n = (size_t)s->problem->nrow;
  if (n == 0) return;
  memcpy(s->problem->R, s->R, n * sizeof(double));
  memcpy(s->problem->target, s->target, n * sizeof(double));
}
