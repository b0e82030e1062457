/// Places of markers on their bodies, found together with the configurations of frames spread over the clip: Gauss-
/// Newton on the arrow of both, configurations eliminated frame by frame.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "fit.h"
#include "math3.h"

enum { FRAMES = 40, ITERATIONS = 60 };
static const double hold = 1e-2;  // weight of the way of a place that was not known, over that of a marker at one frame
static const double noise = 5e-3; // m, of markers: what adjust is measured against
static const double gain = 1e-6;  // of the cost, below which the search ends

typedef struct search {
  cav_fit *fit;
  cav_marker_set *set;
  int nfree, *free, *slot; // markers of the fit whose places move; of each marker of the fit its place among them, -1
  int nframe, *frame;
  double *q, *q_try;     // [nframe*nq]
  double *place, *start; // [nfree*3] as they are, as they were given
  double *S, *r;         // [(3 nfree)^2] lower, by columns; [3 nfree]
  double *B, *H, *g;     // of each frame: [nframe*nv*3 nfree], factors [nframe*nv*nv], [nframe*nv]
} search;

static double held(const search *s, int k) {
  const cav_marker *marker = &s->set->marker[s->fit->marker[s->free[k]]];
  double w = marker->placed ? noise / s->set->adjust : hold;
  return marker->weight * w * w;
}

static void set_places(const search *s, const double *place) {
  for (int k = 0; k < s->nfree; k++) copy3(s->set->marker[s->fit->marker[s->free[k]]].place, place + 3 * k);
}

static cav_status total(const search *s, const double *q, double *cost) {
  double one;
  *cost = 0;
  for (int f = 0; f < s->nframe; f++) {
    cav_status status = cav_fit_cost(s->fit, s->frame[f], q + (size_t)f * (size_t)s->fit->model->nq, NULL, &one);
    if (status) return status;
    *cost += one;
  }
  for (int k = 0; k < s->nfree; k++) {
    double d[3];
    sub3(d, s->set->marker[s->fit->marker[s->free[k]]].place, s->start + 3 * k);
    *cost += held(s, k) * dot3(d, d) / 2;
  }
  return CAV_OK;
}

// what places have to do with the configuration of frame f, and with themselves
static void couple(const search *s, int f, double *B) {
  const cav_fit *fit = s->fit;
  const cav_model *m = fit->model;
  int nv = m->nv, n = 3 * s->nfree;
  for (int i = 0; i < fit->n; i++) {
    const double *seen = cav_fit_seen(fit, s->frame[f], i);
    int k = s->slot[i];
    if (!seen || k < 0) continue;
    const cav_marker *marker = &s->set->marker[fit->marker[i]];
    cav_pose pose;
    double x[3], off[3], column[3], local[3];
    cav_object_pose(m, fit->state, CAV_OBJECT_XBODY, marker->body, &pose);
    cav_fit_place(fit, i, x);
    sub3(off, x, seen);
    rotate_back(local, pose.rotation, off);
    for (int c = 0; c < 3; c++) {
      s->S[(size_t)(3 * k + c) * (size_t)n + (size_t)(3 * k + c)] += marker->weight;
      s->r[3 * k + c] += marker->weight * local[c];
    }
    for (int d = cav_fit_last_dof(m, marker->body); d >= 0; d = m->dof[d].parent) {
      cav_fit_column(fit, d, x, column);
      rotate_back(local, pose.rotation, column);
      for (int c = 0; c < 3; c++) B[(size_t)(3 * k + c) * (size_t)nv + (size_t)d] = marker->weight * local[c];
    }
  }
}

// normal equations at q, configurations eliminated; zero: a pivot is not positive
static cav_status assemble(const search *s, double damping, int *definite) {
  cav_fit *fit = s->fit;
  const cav_model *m = fit->model;
  int nv = m->nv, n = 3 * s->nfree;
  size_t square = (size_t)nv * (size_t)nv, block = (size_t)nv * (size_t)n;
  memset(s->S, 0, (size_t)n * (size_t)n * sizeof *s->S);
  memset(s->r, 0, (size_t)n * sizeof *s->r);
  memset(s->B, 0, (size_t)s->nframe * block * sizeof *s->B);
  *definite = 1;
  for (int f = 0; f < s->nframe && *definite; f++) {
    const double *q = s->q + (size_t)f * (size_t)m->nq;
    double *B = s->B + (size_t)f * block, *H = s->H + (size_t)f * square, *g = s->g + f * nv;
    cav_status status = cav_position(m, fit->state, q);
    if (status) return status;
    cav_fit_normal(fit, s->frame[f], q, NULL);
    couple(s, f, B);
    cav_fit_pin(fit, q, B, n);
    memcpy(H, fit->H, square * sizeof *H);
    memcpy(g, fit->g, (size_t)nv * sizeof *g);
    for (int d = 0; d < nv; d++) H[d * nv + d] += damping + 1e-12;
    *definite = cav_dense_factor(nv, nv - 1, H, nv);
    if (!*definite) break;
    // S -= B' H^-1 B by the half B := L^-1 B
    cav_dense_solve_lower(nv, nv - 1, H, nv, n, B, nv);
    cav_dense_solve_lower(nv, nv - 1, H, nv, 1, g, nv);
    cav_dense_product_transposed(CAV_PART_LOWER, n, n, nv, -1, B, nv, B, nv, s->S, n);
    cav_dense_product_transposed(CAV_PART_ALL, n, 1, nv, -1, B, nv, g, nv, s->r, n);
  }
  for (int k = 0; k < n; k++) {
    double w = held(s, k / 3);
    s->S[k * n + k] += w + damping;
    s->r[k] += w * (s->place[k] - s->start[k]);
  }
  if (*definite) *definite = cav_dense_factor(n, n - 1, s->S, n);
  return CAV_OK;
}

// the step of both; places of it in s->r
static void solve(const search *s) {
  const cav_model *m = s->fit->model;
  int nv = m->nv, n = 3 * s->nfree;
  for (int k = 0; k < n; k++) s->r[k] = -s->r[k];
  cav_dense_solve_lower(n, n - 1, s->S, n, 1, s->r, n);
  cav_dense_solve_upper(n, n - 1, s->S, n, 1, s->r, n);
  for (int f = 0; f < s->nframe; f++) {
    double *B = s->B + (size_t)f * (size_t)nv * (size_t)n, *H = s->H + (size_t)f * (size_t)nv * (size_t)nv,
           *g = s->g + f * nv;
    for (int d = 0; d < nv; d++) g[d] = -g[d];
    cav_dense_product(nv, 1, n, -1, B, nv, s->r, n, g, nv);
    cav_dense_solve_upper(nv, nv - 1, H, nv, 1, g, nv);
    cav_integrate(m, s->q + (size_t)f * (size_t)m->nq, g, 1, s->q_try + (size_t)f * (size_t)m->nq);
    cav_fit_clip(m, s->q_try + (size_t)f * (size_t)m->nq);
  }
}

static cav_status descend(search *s, int *iterations) {
  int n = 3 * s->nfree;
  size_t all = (size_t)s->nframe * (size_t)s->fit->model->nq;
  double cost, after, damping = 1e-4;
  cav_status status = total(s, s->q, &cost);
  for (int i = 0; i < ITERATIONS && !status && damping < 1e6; i++) {
    int definite, done;
    status = assemble(s, damping, &definite);
    ++*iterations;
    if (status) break;
    after = INFINITY;
    if (definite) {
      solve(s);
      for (int k = 0; k < n; k++) s->r[k] += s->place[k];
      set_places(s, s->r);
      status = total(s, s->q_try, &after);
    }
    if (!(after < cost)) {
      set_places(s, s->place);
      damping *= 10;
      continue;
    }
    memcpy(s->q, s->q_try, all * sizeof *s->q);
    memcpy(s->place, s->r, (size_t)n * sizeof *s->place);
    done = cost - after < gain * cost;
    cost = after, damping = fmax(damping / 10, 1e-9);
    if (done) break;
  }
  return status;
}

// frames spread evenly that show three markers or more
static void choose_frames(search *s) {
  const cav_fit *fit = s->fit;
  int last = -1;
  for (int f = 0; f < FRAMES; f++) {
    int t = FRAMES < 2 || fit->nframe < 2 ? 0 : (int)lround((double)f * (fit->nframe - 1) / (FRAMES - 1)), seen = 0;
    for (int i = 0; i < fit->n; i++) seen += cav_fit_seen(fit, t, i) != NULL;
    if (t != last && seen >= 3) s->frame[s->nframe++] = t;
    last = t;
  }
}

static void release(search *s) {
  free(s->free), free(s->slot), free(s->frame), free(s->q), free(s->q_try), free(s->place), free(s->start);
  free(s->S), free(s->r), free(s->B), free(s->H), free(s->g);
}

cav_status cav_fit_places(cav_fit *fit, cav_marker_set *set, const double *q, int *iterations) {
  const cav_model *m = fit->model;
  search s = {.fit = fit, .set = set};
  s.free = malloc((size_t)fit->n * sizeof *s.free), s.slot = malloc((size_t)fit->n * sizeof *s.slot);
  s.frame = malloc(FRAMES * sizeof *s.frame);
  cav_status status = s.free && s.slot && s.frame ? CAV_OK : CAV_NO_MEMORY;
  for (int i = 0; i < fit->n && !status; i++) {
    int moves = !set->marker[fit->marker[i]].placed || set->adjust > 0;
    s.slot[i] = moves ? s.nfree : -1;
    if (moves) s.free[s.nfree++] = i;
  }
  if (!status) choose_frames(&s);
  if (!status && s.nfree && s.nframe) {
    size_t nv = (size_t)m->nv, n = 3 * (size_t)s.nfree, frames = (size_t)s.nframe;
    s.q = malloc(frames * (size_t)m->nq * sizeof *s.q), s.q_try = malloc(frames * (size_t)m->nq * sizeof *s.q);
    s.place = malloc(n * sizeof *s.place), s.start = malloc(n * sizeof *s.start);
    s.S = malloc(n * n * sizeof *s.S), s.r = malloc(n * sizeof *s.r);
    s.B = malloc(frames * nv * n * sizeof *s.B), s.H = malloc(frames * nv * nv * sizeof *s.H);
    s.g = malloc(frames * nv * sizeof *s.g);
    if (!s.q || !s.q_try || !s.place || !s.start || !s.S || !s.r || !s.B || !s.H || !s.g) status = CAV_NO_MEMORY;
    for (int k = 0; k < s.nfree && !status; k++) copy3(s.place + 3 * k, set->marker[fit->marker[s.free[k]]].place);
    if (!status) memcpy(s.start, s.place, n * sizeof *s.start);
    // each frame from the one before
    for (int f = 0; f < s.nframe && !status; f++) {
      double *at = s.q + (size_t)f * (size_t)m->nq;
      memcpy(at, f ? at - m->nq : q, (size_t)m->nq * sizeof *at);
      status = cav_fit_frame(fit, s.frame[f], NULL, at, iterations);
    }
    if (!status) status = descend(&s, iterations);
  }
  release(&s);
  return status;
}
