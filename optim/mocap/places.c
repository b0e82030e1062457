/// Places of markers on their bodies and sizes of links, found together with the configurations of frames spread over the
/// clip: Gauss-Newton on the arrow of both, configurations eliminated frame by frame.
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
static const double whole = 0.01; // weight of the size of all links together, over that of one's way from it

typedef struct search {
  cav_fit *fit;
  cav_marker_set *set;
  cav_fit_sizes *sizes;    // NULL: known
  int nfree, *free, *slot; // markers of the fit whose places move; of each marker of the fit its place among them, -1
  int nunknown;            // 3 nfree coordinates of places on links of the given size, then logarithms of factors
  int nframe, *frame;
  double *q, *q_try; // [nframe*nq]
  double *x, *start; // [nunknown] as they are, as they were given
  double *given;     // [3*n] places of all markers, as they were given
  double *S, *r;     // [nunknown^2] lower, by columns; [nunknown]
  double *B, *H, *g; // of each frame: [nframe*nv*nunknown], factors [nframe*nv*nv], [nframe*nv]
  double *move;      // [3*ngroup]
} search;

static int groups(const search *s) { return s->sizes ? s->sizes->ngroup : 0; }

static double held(const search *s, int k) {
  const cav_marker *marker = &s->set->marker[s->fit->marker[s->free[k]]];
  double w = marker->placed ? noise / s->set->adjust : hold;
  return marker->weight * w * w;
}

// of what sizes cost: links may be off the size of all by scale, all together by ten times that
static double held_size(const search *s, int a, int b) {
  double w = noise / s->set->scale, n = groups(s);
  return w * w * ((a == b) - (1 - whole) / n);
}

static double factor_of(const search *s, int i) {
  return s->sizes ? s->sizes->factor[s->fit->model->body[s->set->marker[s->fit->marker[i]].body].link] : 1;
}

// places as the set has them, on links of the size that they have then
static cav_status set_unknowns(const search *s, const double *x) {
  cav_status status = s->sizes ? cav_fit_sizes_set(s->sizes, x + 3 * s->nfree) : CAV_OK;
  for (int i = 0; i < s->fit->n; i++) {
    const double *place = s->slot[i] < 0 ? s->given + 3 * i : x + 3 * s->slot[i];
    scale3(s->set->marker[s->fit->marker[i]].place, factor_of(s, i), place);
  }
  return status;
}

static cav_status total(const search *s, const double *q, const double *x, double *cost) {
  double one;
  *cost = 0;
  for (int f = 0; f < s->nframe; f++) {
    cav_status status = cav_fit_cost(s->fit, s->frame[f], q + (size_t)f * (size_t)s->fit->model->nq, NULL, &one);
    if (status) return status;
    *cost += one;
  }
  for (int k = 0; k < s->nfree; k++) {
    double d[3];
    sub3(d, x + 3 * k, s->start + 3 * k);
    *cost += held(s, k) * dot3(d, d) / 2;
  }
  const double *size = x + 3 * s->nfree;
  for (int a = 0; a < groups(s); a++)
    for (int b = 0; b < groups(s); b++) *cost += held_size(s, a, b) * size[a] * size[b] / 2;
  return CAV_OK;
}

// a point of a link, off by so much: what its residual, along the rows that count, has to do with sizes
static void couple_sizes(const search *s, const double *q, int link, const double point[3], const double off[3],
                         double weight, int from, double *B) {
  const cav_fit *fit = s->fit;
  int nv = fit->model->nv, n = s->nunknown, first = 3 * s->nfree;
  cav_fit_sizes_move(s->sizes, fit->state, q, link, point, s->move);
  for (int a = 0; a < groups(s); a++) {
    const double *c = s->move + 3 * a;
    for (int k = from; k < 3; k++) s->r[first + a] += weight * c[k] * off[k];
    for (int b = 0; b <= a; b++)
      for (int k = from; k < 3; k++)
        s->S[(size_t)(first + b) * (size_t)n + (size_t)(first + a)] += weight * c[k] * s->move[3 * b + k];
  }
  for (int d = cav_fit_last_dof(fit->model, fit->model->link[link].body); d >= 0; d = fit->model->dof[d].parent) {
    double column[3];
    cav_fit_column(fit, d, point, column);
    for (int a = 0; a < groups(s); a++)
      for (int k = from; k < 3; k++)
        B[(size_t)(first + a) * (size_t)nv + (size_t)d] += weight * column[k] * s->move[3 * a + k];
  }
}

// what places and sizes have to do with the configuration of frame f, and with themselves
static void couple(const search *s, int f, const double *q, double *B) {
  const cav_fit *fit = s->fit;
  const cav_model *m = fit->model;
  size_t nv = (size_t)m->nv, n = (size_t)s->nunknown;
  for (int i = 0; i < fit->n; i++) {
    const double *seen = cav_fit_seen(fit, s->frame[f], i);
    int k = s->slot[i];
    if (!seen) continue;
    const cav_marker *marker = &s->set->marker[fit->marker[i]];
    cav_pose pose;
    double x[3], off[3], column[3], local[3], size = factor_of(s, i), w = marker->weight;
    cav_fit_place(fit, i, x);
    sub3(off, x, seen);
    if (s->sizes) couple_sizes(s, q, m->body[marker->body].link, x, off, w, 0, B);
    if (k < 0) continue;
    cav_object_pose(m, fit->state, CAV_OBJECT_XBODY, marker->body, &pose);
    rotate_back(local, pose.rotation, off);
    for (size_t c = 0; c < 3; c++) {
      size_t at = 3 * (size_t)k + c;
      s->S[at * n + at] += w * size * size;
      s->r[at] += w * size * local[c];
    }
    for (int a = 0; a < groups(s); a++) {
      rotate_back(local, pose.rotation, s->move + 3 * a);
      for (size_t c = 0; c < 3; c++) s->S[(3 * (size_t)k + c) * n + (size_t)(3 * s->nfree + a)] += w * size * local[c];
    }
    for (int d = cav_fit_last_dof(m, marker->body); d >= 0; d = m->dof[d].parent) {
      cav_fit_column(fit, d, x, column);
      rotate_back(local, pose.rotation, column);
      for (size_t c = 0; c < 3; c++) B[(3 * (size_t)k + c) * nv + (size_t)d] = w * size * local[c];
    }
  }
  for (int foot = 0; s->sizes && foot < fit->nfoot; foot++) {
    int rows = cav_fit_floor_rows(fit, s->frame[f], foot);
    for (int k = 0; k < rows; k++) {
      const double *x = fit->point + 3 * k;
      couple_sizes(s, q, m->body[fit->foot[foot]].link, x, x, fit->firm * fit->options->floor, 2, B);
    }
  }
}

// normal equations at q, configurations eliminated; zero: a pivot is not positive
static cav_status assemble(const search *s, double damping, int *definite) {
  cav_fit *fit = s->fit;
  const cav_model *m = fit->model;
  int nv = m->nv, n = s->nunknown;
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
    couple(s, f, q, B);
    cav_fit_pin(fit, q, B, n);
    memcpy(H, fit->H, square * sizeof *H);
    memcpy(g, fit->g, (size_t)nv * sizeof *g);
    for (int d = 0; d < nv; d++) H[d * nv + d] += damping + 1e-12;
    *definite = cav_dense_factor(nv, nv - 1, H, nv);
    if (!*definite) break;
    // S -= B' H^-1 B by the half B := L^-1 B
    cav_dense_solve_lower(nv, nv - 1, H, nv, n, B, nv);
    cav_dense_solve_lower(nv, nv - 1, H, nv, 1, g, nv);
    cav_dense_product_transposed(CAV_TRIANGLE_LOWER, n, n, nv, -1, B, nv, B, nv, s->S, n);
    cav_dense_product_transposed(CAV_TRIANGLE_BOTH, n, 1, nv, -1, B, nv, g, nv, s->r, n);
  }
  for (int k = 0; k < 3 * s->nfree; k++) {
    double w = held(s, k / 3);
    s->S[(size_t)k * (size_t)n + (size_t)k] += w;
    s->r[k] += w * (s->x[k] - s->start[k]);
  }
  for (int a = 3 * s->nfree; a < n; a++)
    for (int b = 3 * s->nfree; b < n; b++) {
      double w = held_size(s, a, b);
      if (b <= a) s->S[(size_t)b * (size_t)n + (size_t)a] += w;
      s->r[a] += w * s->x[b];
    }
  for (int k = 0; k < n; k++) s->S[(size_t)k * (size_t)n + (size_t)k] += damping;
  if (*definite) *definite = cav_dense_factor(n, n - 1, s->S, n);
  return CAV_OK;
}

// the step of both; that of the unknowns in s->r
static void solve(const search *s) {
  const cav_model *m = s->fit->model;
  int nv = m->nv, n = s->nunknown;
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

static cav_status descend(search *s, double *cost, int *iterations) {
  int n = s->nunknown;
  size_t all = (size_t)s->nframe * (size_t)s->fit->model->nq;
  double after, damping = 1e-4;
  cav_status status = total(s, s->q, s->x, cost);
  for (int i = 0; i < ITERATIONS && !status && damping < 1e6; i++) {
    int definite, done;
    status = assemble(s, damping, &definite);
    ++*iterations;
    if (status) break;
    after = INFINITY;
    if (definite) {
      solve(s);
      for (int k = 0; k < n; k++) s->r[k] += s->x[k];
      if (set_unknowns(s, s->r) == CAV_OK) status = total(s, s->q_try, s->r, &after);
    }
    if (!(after < *cost)) {
      status = set_unknowns(s, s->x);
      damping *= 10;
      continue;
    }
    memcpy(s->q, s->q_try, all * sizeof *s->q);
    memcpy(s->x, s->r, (size_t)n * sizeof *s->x);
    done = *cost - after < gain * *cost;
    *cost = after, damping = fmax(damping / 10, 1e-9);
    if (done) break;
  }
  return status;
}

// standard errors of sizes: noise as large as the residuals say, by the normal equations at the least
static cav_status estimate_errors(search *s, double cost) {
  const cav_model *m = s->fit->model;
  int n = s->nunknown, definite, seen = 0;
  cav_status status = assemble(s, 0, &definite);
  if (status) return status;
  for (int f = 0; f < s->nframe; f++)
    for (int i = 0; i < s->fit->n; i++) seen += 3 * (cav_fit_seen(s->fit, s->frame[f], i) != NULL);
  int spare = seen - s->nframe * m->nv - n;
  double variance = spare > 0 ? 2 * cost / spare : INFINITY;
  for (int a = 0; a < groups(s); a++) {
    memset(s->r, 0, (size_t)n * sizeof *s->r);
    s->r[3 * s->nfree + a] = 1;
    if (definite) cav_dense_solve_lower(n, n - 1, s->S, n, 1, s->r, n);
    double error = 0;
    for (int k = 0; k < n; k++) error += s->r[k] * s->r[k];
    for (int i = 1; i < m->nlink; i++)
      if (s->sizes->group[i] == a)
        s->sizes->error[i] = definite ? s->sizes->factor[i] * sqrt(error * variance) : INFINITY;
  }
  return CAV_OK;
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
  free(s->free), free(s->slot), free(s->frame), free(s->q), free(s->q_try), free(s->x), free(s->start), free(s->given);
  free(s->S), free(s->r), free(s->B), free(s->H), free(s->g), free(s->move);
}

// which markers and frames take part
static cav_status choose(search *s) {
  const cav_fit *fit = s->fit;
  size_t markers = (size_t)fit->n;
  s->free = malloc(markers * sizeof *s->free), s->slot = malloc(markers * sizeof *s->slot);
  s->given = malloc(3 * markers * sizeof *s->given), s->frame = malloc(FRAMES * sizeof *s->frame);
  if (!s->free || !s->slot || !s->given || !s->frame) return CAV_NO_MEMORY;
  for (int i = 0; i < fit->n; i++) {
    const cav_marker *marker = &s->set->marker[fit->marker[i]];
    int moves = !marker->placed || s->set->adjust > 0;
    copy3(s->given + 3 * i, marker->place);
    s->slot[i] = moves ? s->nfree : -1;
    if (moves) s->free[s->nfree++] = i;
  }
  choose_frames(s);
  s->nunknown = 3 * s->nfree + groups(s);
  return CAV_OK;
}

static cav_status reserve(search *s) {
  size_t nq = (size_t)s->fit->model->nq, nv = (size_t)s->fit->model->nv, n = (size_t)s->nunknown,
         frames = (size_t)s->nframe;
  s->q = malloc(frames * nq * sizeof *s->q), s->q_try = malloc(frames * nq * sizeof *s->q);
  s->x = calloc(n, sizeof *s->x), s->start = calloc(n, sizeof *s->start);
  s->S = malloc(n * n * sizeof *s->S), s->r = malloc(n * sizeof *s->r);
  s->B = malloc(frames * nv * n * sizeof *s->B), s->H = malloc(frames * nv * nv * sizeof *s->H);
  s->g = malloc(frames * nv * sizeof *s->g), s->move = malloc((3 * (size_t)groups(s) + 1) * sizeof *s->move);
  return s->q && s->q_try && s->x && s->start && s->S && s->r && s->B && s->H && s->g && s->move ? CAV_OK
                                                                                                 : CAV_NO_MEMORY;
}

cav_status cav_fit_places(cav_fit *fit, cav_marker_set *set, cav_fit_sizes *sizes, const double *q, int *iterations) {
  const cav_model *m = fit->model;
  search s = {.fit = fit, .set = set, .sizes = sizes};
  double cost = 0;
  cav_status status = choose(&s);
  if (!status && s.nunknown && s.nframe) {
    status = reserve(&s);
    for (int k = 0; k < s.nfree && !status; k++) copy3(s.x + 3 * k, s.given + 3 * s.free[k]);
    if (!status) memcpy(s.start, s.x, (size_t)s.nunknown * sizeof *s.start);
    // each frame from the one before
    for (int f = 0; f < s.nframe && !status; f++) {
      double *at = s.q + (size_t)f * (size_t)m->nq;
      memcpy(at, f ? at - m->nq : q, (size_t)m->nq * sizeof *at);
      status = cav_fit_frame(fit, s.frame[f], NULL, at, iterations);
    }
    if (!status) status = descend(&s, &cost, iterations);
    if (!status && sizes) status = estimate_errors(&s, cost);
  }
  release(&s);
  return status;
}
