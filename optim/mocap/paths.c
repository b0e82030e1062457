/// Where a fit starts, and which way it goes through the frames of a retargeted clip. Frame after frame it stays in the
/// valley that it is in: a limb of another body whose joint ran into its range, or that passed a singular posture to the
/// wrong side, stays there for good. So frames spread over the clip are begun anew and followed both ways, and of these
/// paths the cheapest way from the first frame to the last is taken, where a change from one to another costs what the kink of it
/// costs all frames together (smooth.c).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit.h"

static const double spacing = 0.4; // s between frames that are begun anew
static const double better = 0.9;  // of the cost of the way that was followed, from where on another is taken
enum { STARTS = 12, ANCHORS = 16 };

cav_status cav_fit_begin(cav_fit *fit, int frame, double part, double *q, int *iterations) {
  const cav_model *m = fit->model;
  size_t nq = (size_t)m->nq;
  double *start = malloc(2 * nq * sizeof *start), *best = start ? start + nq : NULL, least = INFINITY, cost;
  cav_status status = start ? CAV_OK : CAV_NO_MEMORY;
  for (int s = 0; s < STARTS && !status; s++) {
    memcpy(start, m->q0, nq * sizeof *start);
    for (int j = 0; j < m->njoint && s > 0; j++) {
      const cav_joint *joint = &m->joint[j];
      double way = fmod((j + 1) * 0.6180339887498949 + s * 0.7548776662466927, 1) - 0.5;
      if (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE)
        start[joint->q] += way * (joint->limited ? (joint->range[1] - joint->range[0]) / 2 : 1);
    }
    cav_fit_clip(m, start);
    status = cav_fit_align(fit, frame, start);
    if (!status) status = cav_fit_frame(fit, frame, NULL, start, iterations);
    if (!status) status = cav_fit_cost(fit, frame, start, NULL, &cost);
    if (!status && cost < part * least) least = cost, memcpy(best, start, nq * sizeof *best);
  }
  if (!status) memcpy(q, best, nq * sizeof *q);
  free(start);
  return status;
}

cav_status cav_fit_follow(cav_fit *fit, int from, int to, double *q, int *iterations) {
  size_t nq = (size_t)fit->model->nq;
  int way = to < from ? -1 : 1;
  cav_status status = CAV_OK;
  for (int t = from; t != to + way && !status; t += way) {
    double *at = q + (size_t)t * nq;
    const double *before = t == from ? NULL : way > 0 ? at - nq : at + nq;
    if (before) memcpy(at, before, nq * sizeof *at);
    status = cav_fit_frame(fit, t, before, at, iterations);
  }
  return status;
}

typedef struct paths {
  cav_fit *fit;
  int n, frames;
  size_t size;            ///< of a path
  double *q;              ///< [n*frames*nq]
  double *own, *best;     ///< [frames*n] cost of a frame and of the path's kink there; least up to there
  int *from;              ///< [frames*n] the path before
  double *ahead, *behind; ///< [nv]
} paths;

static const double *at(const paths *p, int k, int t) {
  return p->q + (size_t)k * p->size + (size_t)t * (size_t)p->fit->model->nq;
}

// half the squares of what differs, weighed as accelerations are
static double kink(const paths *p, const double *difference) {
  double cost = 0;
  for (int d = 0; d < p->fit->model->nv; d++)
    cost += cav_fit_bend_weight(p->fit, d) * difference[d] * difference[d] / 2;
  return cost;
}

static cav_status find_costs(const paths *p) {
  const cav_model *m = p->fit->model;
  cav_status status = CAV_OK;
  for (int k = 0; k < p->n; k++)
    for (int t = 0; t < p->frames && !status; t++) {
      double *own = &p->own[t * p->n + k];
      status = cav_fit_cost(p->fit, t, at(p, k, t), NULL, own);
      if (t == 0 || t == p->frames - 1) continue;
      cav_difference(m, at(p, k, t - 1), at(p, k, t), 1, p->behind);
      cav_difference(m, at(p, k, t), at(p, k, t + 1), 1, p->ahead);
      for (int d = 0; d < m->nv; d++) p->ahead[d] -= p->behind[d];
      *own += kink(p, p->ahead);
    }
  return status;
}

// the cheapest way through all frames, into q of the first path's size
static void choose(const paths *p, double *q) {
  const cav_model *m = p->fit->model;
  int n = p->n, last = 0;
  for (int t = 0; t < p->frames; t++)
    for (int k = 0; k < n; k++) {
      double *best = &p->best[t * n + k];
      *best = t ? p->best[(t - 1) * n + k] : 0, p->from[t * n + k] = k;
      for (int i = 0; i < n && t; i++) {
        // a step aside is two kinks, one each way; one that is taken has to be better than by rounding
        cav_difference(m, at(p, i, t), at(p, k, t), 1, p->ahead);
        double cost = p->best[(t - 1) * n + i] + 2 * kink(p, p->ahead);
        if (i != k && cost < (1 - 1e-9) * *best) *best = cost, p->from[t * n + k] = i;
      }
      *best += p->own[t * n + k];
    }
  for (int k = 1; k < n; k++)
    if (p->best[(p->frames - 1) * n + k] < p->best[(p->frames - 1) * n + last]) last = k;
  double followed = 0;
  for (int t = 0; t < p->frames; t++) followed += p->own[t * n];
  if (!(p->best[(p->frames - 1) * n + last] < better * followed)) return;
  for (int t = p->frames - 1, k = last; t >= 0; k = p->from[t * n + k], t--)
    memcpy(q + (size_t)t * (size_t)m->nq, at(p, k, t), (size_t)m->nq * sizeof *q);
}

static cav_status reserve(paths *p) {
  size_t nv = (size_t)p->fit->model->nv, most = ANCHORS + 2, cells = most * (size_t)p->frames;
  p->size = (size_t)p->frames * (size_t)p->fit->model->nq;
  p->q = malloc(most * p->size * sizeof *p->q);
  p->own = malloc((2 * cells + 2 * nv) * sizeof *p->own);
  p->from = malloc(cells * sizeof *p->from);
  if (!p->q || !p->own || !p->from) return CAV_NO_MEMORY;
  p->best = p->own + cells, p->ahead = p->best + cells, p->behind = p->ahead + nv;
  return CAV_OK;
}

// begun anew at a frame and followed to both ends; where a path passes as near as a fit ends, it
// is that
static cav_status add(paths *p, int frame, int *iterations) {
  static const double same = 1e-4; // rad, m
  double *q = p->q + (size_t)p->n * p->size, *begun = q + (size_t)frame * (size_t)p->fit->model->nq, apart = 0;
  cav_status status = cav_fit_begin(p->fit, frame, 1 - 1e-6, begun, iterations);
  for (int k = 0; k < p->n && !status; k++) {
    cav_difference(p->fit->model, at(p, k, frame), begun, 1, p->ahead);
    double most = 0;
    for (int d = 0; d < p->fit->model->nv; d++) most = fmax(most, fabs(p->ahead[d]));
    apart = k ? fmin(apart, most) : most;
  }
  if (status || apart < same) return status;
  status = cav_fit_follow(p->fit, frame, p->frames - 1, q, iterations);
  if (!status) status = cav_fit_follow(p->fit, frame, 0, q, iterations);
  p->n++;
  return status;
}

cav_status cav_fit_choose_paths(cav_fit *fit, double *q, int *iterations) {
  paths p = {.fit = fit, .frames = fit->nframe};
  int anchors = (int)fmin(ceil((fit->nframe - 1) * fit->step / spacing), ANCHORS);
  cav_status status = reserve(&p);
  if (!status) memcpy(p.q, q, p.size * sizeof *q), p.n = 1;
  for (int k = 0; k <= anchors && !status; k++)
    status = add(&p, (int)lround((double)k * (fit->nframe - 1) / anchors), iterations);
  if (!status) status = find_costs(&p);
  if (!status) choose(&p, q);
  free(p.q), free(p.own), free(p.from);
  return status;
}
