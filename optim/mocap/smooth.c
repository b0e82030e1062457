/// All frames of a retargeted clip at once: markers, feet and posture of every frame as before, and what a frame alone does not
/// know. Accelerations have a size, so a limb that a frame leaves open (an elbow nearly straight, a hip at its range) does not
/// jump to and fro; and links of another body's shape stay out of each other. Gauss-Newton over all configurations, whose
/// normal equations are a band of three blocks, with a Levenberg-Marquardt damping and ranges by an active set.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "fit.h"
#include "math3.h"

// what is usual: m that a marker of another body is off, rad/s² of joints, m/s² of roots; the weight of changes from frame to
// frame of a retargeted clip, in proportion to which accelerations weigh
static const double off = 0.03, turning = 100, moving = 30, usual_roughness = 0.01;
// m that links keep from each other, or what they are apart in the model's own configuration; weight of what is missing,
// times that of a marker; of the smoothed law, so that contacts are told from further away
static const double apart = 0.01, apart_weight = 1e3, told = 2e-3;
static const double least_gain = 1e-4; // of the cost, below which, three times in a row, it ends
static const double first_damping = 1e-2, least_damping = 1e-6, most_damping = 1e6;
enum { ITERATIONS = 100 };

typedef struct band {
  cav_fit *fit;
  int frames, nv, below, n;
  double *A, *g, *x, *try; ///< [n*(below+1)]; [n]; [n]; [frames*nq]
  double *weight;          ///< [nv] of accelerations
  double *cost, *after;    ///< [frames] of a frame's own rows, at q and where a step leads
  double *damping;         ///< [frames]
  double *ahead, *behind;  ///< [nv] ways to the next frame and from the one before
} band;

// ---------------------------------------------------------------- links apart

// contacts of the state within a tree that are nearer than they shall be, the nearest of every pair: its index from i on, -1
static int next_touching(const cav_fit *fit, int i) {
  const cav_state *s = fit->state;
  while (i < s->ncontact) {
    int best = i, pair = s->contact[i].pair;
    for (; i < s->ncontact && s->contact[i].pair == pair; i++)
      if (s->contact[i].dist < s->contact[best].dist) best = i;
    if (!fit->model->pair[pair].external && s->contact[best].dist < fit->apart[pair]) return best;
  }
  return -1;
}

static int after_pair(const cav_state *s, int i) {
  int pair = s->contact[i].pair;
  while (i < s->ncontact && s->contact[i].pair == pair) i++;
  return i;
}

double cav_fit_apart_cost(const cav_fit *fit) {
  double cost = 0;
  for (int i = 0; fit->apart && (i = next_touching(fit, i)) >= 0; i = after_pair(fit->state, i)) {
    const cav_contact *c = &fit->state->contact[i];
    cost += apart_weight * pow(fit->apart[c->pair] - c->dist, 2) / 2;
  }
  return cost;
}

// how the distance of a contact changes with the dofs, into rate [nv]
static void distance_rates(const cav_fit *fit, const cav_contact *c, double *rate) {
  const cav_model *m = fit->model;
  memset(rate, 0, (size_t)m->nv * sizeof *rate);
  for (int side = 0; side < 2; side++) {
    int link = side ? c->link2 : c->link1;
    while (link > 0 && m->link[link].ndof == 0) link = m->link[link].parent;
    for (int d = link > 0 ? m->link[link].dof + m->link[link].ndof - 1 : -1; d >= 0; d = m->dof[d].parent) {
      double column[3];
      cav_fit_column(fit, d, c->pos, column);
      rate[d] += (side ? 1 : -1) * dot3(c->frame, column);
    }
  }
}

void cav_fit_apart_normal(const cav_fit *fit) {
  int nv = fit->model->nv;
  double *rate = fit->move;
  for (int i = 0; fit->apart && (i = next_touching(fit, i)) >= 0; i = after_pair(fit->state, i)) {
    const cav_contact *c = &fit->state->contact[i];
    double missing = fit->apart[c->pair] - c->dist;
    distance_rates(fit, c, rate);
    for (int d = 0; d < nv; d++) {
      if (rate[d] == 0) continue;
      fit->g[d] -= apart_weight * missing * rate[d];
      for (int e = 0; e <= d; e++) fit->H[(size_t)e * (size_t)nv + (size_t)d] += apart_weight * rate[d] * rate[e];
    }
  }
}

// from here on the state tells contacts; how far apart links are at q0 they may be
static cav_status keep_apart(cav_fit *fit) {
  const cav_model *m = fit->model;
  fit->apart = malloc(((size_t)m->npair + 1) * sizeof *fit->apart);
  if (!fit->apart) return CAV_NO_MEMORY;
  fit->state->options.contact = fit->state->options.constraint = 1;
  fit->state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  fit->state->options.smoothing = fit->state->options.smoothing_self = told;
  for (int p = 0; p < m->npair; p++) fit->apart[p] = apart;
  cav_status status = cav_position(m, fit->state, m->q0);
  for (int i = 0; i < fit->state->ncontact && !status; i++) {
    const cav_contact *c = &fit->state->contact[i];
    fit->apart[c->pair] = fmin(fit->apart[c->pair], c->dist);
  }
  return status;
}

// ---------------------------------------------------------------- all frames

// ways of frame t from the one before and to the next, and what they differ by, into b->ahead
static void bend(const band *b, const double *q, int t) {
  const cav_model *m = b->fit->model;
  size_t nq = (size_t)m->nq;
  const double *at = q + (size_t)t * nq;
  cav_difference(m, at - nq, at, 1, b->behind);
  cav_difference(m, at, at + nq, 1, b->ahead);
  for (int d = 0; d < b->nv; d++) b->ahead[d] -= b->behind[d];
}

static cav_status cost_of(const band *b, const double *q, double *of, double *cost) {
  cav_status status = CAV_OK;
  *cost = 0;
  for (int t = 0; t < b->frames && !status; t++) {
    status = cav_fit_cost(b->fit, t, q + (size_t)t * (size_t)b->fit->model->nq, NULL, &of[t]);
    *cost += of[t];
    if (t == 0 || t == b->frames - 1) continue;
    bend(b, q, t);
    for (int d = 0; d < b->nv; d++) *cost += b->weight[d] * b->ahead[d] * b->ahead[d] / 2;
  }
  return status;
}

static double *entry(const band *b, int i, int j) { return b->A + i + (size_t)j * (size_t)b->below; }

// normal equations at q
static cav_status normal(const band *b, const double *q) {
  static const double part[3] = {1, -2, 1};
  int nv = b->nv;
  memset(b->A, 0, (size_t)b->n * (size_t)(b->below + 1) * sizeof *b->A);
  for (int t = 0; t < b->frames; t++) {
    const double *at = q + (size_t)t * (size_t)b->fit->model->nq;
    cav_status status = cav_position(b->fit->model, b->fit->state, at);
    if (status) return status;
    cav_fit_normal(b->fit, t, at, NULL);
    memcpy(b->g + t * nv, b->fit->g, (size_t)nv * sizeof *b->g);
    for (int j = 0; j < nv; j++)
      for (int i = j; i < nv; i++) *entry(b, t * nv + i, t * nv + j) += b->fit->H[(size_t)j * (size_t)nv + (size_t)i];
  }
  for (int t = 1; t < b->frames - 1; t++) {
    bend(b, q, t);
    for (int d = 0; d < nv; d++)
      for (int i = 0; i < 3; i++) {
        int row = (t - 1 + i) * nv + d;
        b->g[row] += b->weight[d] * part[i] * b->ahead[d];
        for (int j = 0; j <= i; j++) *entry(b, row, (t - 1 + j) * nv + d) += b->weight[d] * part[i] * part[j];
      }
  }
  return CAV_OK;
}

// takes unknown k out
static void pin(const band *b, int k) {
  for (int j = k - b->below > 0 ? k - b->below : 0; j < k; j++) *entry(b, k, j) = 0;
  for (int i = k + 1; i < b->n && i <= k + b->below; i++) *entry(b, i, k) = 0;
  *entry(b, k, k) = 1;
  b->g[k] = 0;
}

static void pin_ranges(const band *b, const double *q) {
  const cav_model *m = b->fit->model;
  for (int t = 0; t < b->frames; t++)
    for (int d = 0; d < b->nv; d++) {
      const cav_joint *joint = &m->joint[m->dof[d].joint];
      if (!joint->limited || (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE)) continue;
      double at = q[(size_t)t * (size_t)m->nq + (size_t)joint->q], down = b->g[t * b->nv + d];
      if ((down < 0 && at >= joint->range[1]) || (down > 0 && at <= joint->range[0])) pin(b, t * b->nv + d);
    }
}

// where the normal equations lead, into try; 0: they have no factor
static int step(const band *b, const double *q) {
  const cav_model *m = b->fit->model;
  for (int k = 0; k < b->n; k++) *entry(b, k, k) += b->damping[k / b->nv];
  if (!cav_dense_factor(b->n, b->below, b->A, b->below)) return 0;
  for (int k = 0; k < b->n; k++) b->x[k] = -b->g[k];
  cav_dense_solve_lower(b->n, b->below, b->A, b->below, 1, b->x, b->n);
  cav_dense_solve_upper(b->n, b->below, b->A, b->below, 1, b->x, b->n);
  for (int t = 0; t < b->frames; t++) {
    double *to = b->try + (size_t)t * (size_t)m->nq;
    cav_integrate(m, q + (size_t)t * (size_t)m->nq, b->x + t * b->nv, 1, to);
    cav_fit_clip(m, to);
  }
  return 1;
}

// A step that was not taken is damped where frames became worse, up to where they stand still, one that was nowhere worse
// everywhere. 0: no frame can move less
static int damp(const band *b, int taken) {
  int more = 0;
  for (int pass = 0; pass < 2 && !more; pass++)
    for (int t = 0; t < b->frames; t++) {
      if (taken)
        b->damping[t] = fmax(b->damping[t] / 4, least_damping), more = 1;
      else if ((pass || !(b->after[t] <= b->cost[t])) && b->damping[t] < most_damping)
        b->damping[t] *= 10, more = 1;
    }
  return more;
}

static cav_status descend(const band *b, double *q, int *iterations) {
  double cost;
  int calm = 0, more = 1;
  for (int t = 0; t < b->frames; t++) b->damping[t] = first_damping;
  cav_status status = cost_of(b, q, b->cost, &cost);
  for (int i = 0; i < ITERATIONS && !status && calm < 3 && more; i++) {
    double after = INFINITY;
    status = normal(b, q);
    if (status) break;
    ++*iterations;
    pin_ranges(b, q);
    if (step(b, q)) status = cost_of(b, b->try, b->after, &after);
    more = damp(b, after < cost);
    if (!(after < cost)) continue;
    memcpy(q, b->try, (size_t)b->frames * (size_t)b->fit->model->nq * sizeof *q);
    memcpy(b->cost, b->after, (size_t)b->frames * sizeof *b->cost);
    calm = cost - after < least_gain * cost ? calm + 1 : 0;
    cost = after;
  }
  return status;
}

double cav_fit_bend_weight(const cav_fit *fit, int dof) {
  const cav_joint *joint = &fit->model->joint[fit->model->dof[dof].joint];
  int linear = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && dof - joint->dof < 3);
  double size = (linear ? moving : turning) * fit->step * fit->step;
  return pow(fit->options->roughness / usual_roughness * off / size, 2);
}

cav_status cav_fit_smooth(cav_fit *fit, double *q, int *iterations) {
  const cav_model *m = fit->model;
  size_t nv = (size_t)m->nv, n = nv * (size_t)fit->nframe, width = 3 * nv;
  band b = {.fit = fit, .frames = fit->nframe, .nv = m->nv, .n = (int)n, .below = (int)width - 1};
  if (fit->nframe < 3 || m->nv == 0) return CAV_OK;
  cav_status status = fit->set->floor ? keep_apart(fit) : CAV_OK;
  b.A = malloc((n * width + 2 * n + (size_t)fit->nframe * ((size_t)m->nq + 3) + 3 * nv) * sizeof *b.A);
  if (!b.A || status) {
    free(b.A);
    return status ? status : CAV_NO_MEMORY;
  }
  b.g = b.A + n * width, b.x = b.g + n, b.try = b.x + n, b.weight = b.try + (size_t)fit->nframe * (size_t)m->nq;
  b.ahead = b.weight + nv, b.behind = b.ahead + nv;
  b.cost = b.behind + nv, b.after = b.cost + fit->nframe, b.damping = b.after + fit->nframe;
  for (int d = 0; d < m->nv; d++) b.weight[d] = cav_fit_bend_weight(fit, d);
  status = descend(&b, q, iterations);
  free(b.A);
  return status;
}
