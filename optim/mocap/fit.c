/// One frame: Gauss-Newton with a Levenberg-Marquardt damping on the manifold of configurations, analytic Jacobians,
/// ranges of joints kept by an active set.
#include "fit.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "math3.h"

static const double least_gain = 1e-9; // of the cost, below which a frame ends

const double *cav_fit_seen(const cav_fit *fit, int frame, int i) {
  const double *p = fit->position + 3 * ((size_t)frame * (size_t)fit->nmarker + (size_t)fit->column[i]);
  return isfinite(p[0]) ? p : NULL;
}

void cav_fit_place(const cav_fit *fit, int i, double world[3]) {
  const cav_marker *marker = &fit->set->marker[fit->marker[i]];
  cav_pose pose;
  cav_object_pose(fit->model, fit->state, CAV_OBJECT_XBODY, marker->body, &pose);
  transform(world, pose.pos, pose.rotation, marker->place);
}

void cav_fit_column(const cav_fit *fit, int d, const double point[3], double column[3]) {
  const double *axis = fit->state->axis + 6 * d;
  velocity_at(column, axis, fit->state->reference + 3 * fit->model->dof[d].link, point);
}

double cav_fit_weight(const cav_fit *fit, int frame, int i) {
  double weight = fit->set->marker[fit->marker[i]].weight;
  return fit->planted && fit->planted[(size_t)frame * (size_t)fit->n + (size_t)i] ? fit->firm * weight : weight;
}

int cav_fit_last_dof(const cav_model *m, int body) {
  int link = m->body[body].link;
  while (link > 0 && m->link[link].ndof == 0) link = m->link[link].parent;
  return link > 0 ? m->link[link].dof + m->link[link].ndof - 1 : -1;
}

// weight of the way of dof d from the model's own configuration: free roots are wherever the markers are
static double holds(const cav_fit *fit, int d) {
  return fit->model->joint[fit->model->dof[d].joint].type == CAV_JOINT_FREE ? 0 : fit->options->posture;
}

cav_status cav_fit_cost(const cav_fit *fit, int frame, const double *q, const double *before, double *cost) {
  const cav_model *m = fit->model;
  cav_status status = cav_position(m, fit->state, q);
  if (status) return status;
  *cost = 0;
  for (int i = 0; i < fit->n; i++) {
    const double *seen = cav_fit_seen(fit, frame, i);
    double x[3];
    if (!seen) continue;
    cav_fit_place(fit, i, x);
    sub3(x, x, seen);
    *cost += cav_fit_weight(fit, frame, i) * dot3(x, x) / 2;
  }
  for (int f = 0; f < fit->nfoot; f++) {
    int rows = cav_fit_floor_rows(fit, frame, f);
    double clear = cav_fit_clear(fit, frame, f);
    for (int k = 0; k < rows; k++) *cost += fit->firm * fit->options->floor * pow(fit->point[3 * k + 2] - clear, 2) / 2;
  }
  *cost += cav_fit_apart_cost(fit);
  cav_difference(m, m->q0, q, 1, fit->move);
  for (int d = 0; d < m->nv; d++) *cost += pow(holds(fit, d) * fit->move[d], 2) / 2;
  if (!before) return CAV_OK;
  cav_difference(m, before, q, 1, fit->move);
  for (int d = 0; d < m->nv; d++) *cost += pow(fit->options->roughness * fit->move[d], 2) / 2;
  return CAV_OK;
}

// markers' part of the lower triangle of H, and of g
static void add_marker(const cav_fit *fit, int frame, int i) {
  const cav_model *m = fit->model;
  const cav_marker *marker = &fit->set->marker[fit->marker[i]];
  const double *seen = cav_fit_seen(fit, frame, i);
  double x[3], off[3], a[3], b[3], w = cav_fit_weight(fit, frame, i);
  if (!seen) return;
  cav_fit_place(fit, i, x);
  sub3(off, x, seen);
  for (int d = cav_fit_last_dof(m, marker->body); d >= 0; d = m->dof[d].parent) {
    cav_fit_column(fit, d, x, a);
    fit->g[d] += w * dot3(a, off);
    for (int e = d; e >= 0; e = m->dof[e].parent) {
      cav_fit_column(fit, e, x, b);
      fit->H[(size_t)e * (size_t)m->nv + (size_t)d] += w * dot3(a, b);
    }
  }
}

// the height of a point of a foot over what it keeps from the floor
static void add_height(const cav_fit *fit, int f, const double x[3], double clear) {
  const cav_model *m = fit->model;
  double a[3], b[3], w = fit->firm * fit->options->floor;
  for (int d = cav_fit_last_dof(m, fit->foot[f]); d >= 0; d = m->dof[d].parent) {
    cav_fit_column(fit, d, x, a);
    fit->g[d] += w * a[2] * (x[2] - clear);
    for (int e = d; e >= 0; e = m->dof[e].parent) {
      cav_fit_column(fit, e, x, b);
      fit->H[(size_t)e * (size_t)m->nv + (size_t)d] += w * a[2] * b[2];
    }
  }
}

void cav_fit_normal(const cav_fit *fit, int frame, const double *q, const double *before) {
  const cav_model *m = fit->model;
  size_t nv = (size_t)m->nv;
  memset(fit->H, 0, nv * nv * sizeof *fit->H);
  memset(fit->g, 0, nv * sizeof *fit->g);
  for (int i = 0; i < fit->n; i++) add_marker(fit, frame, i);
  for (int f = 0; f < fit->nfoot; f++) {
    int rows = cav_fit_floor_rows(fit, frame, f);
    for (int k = 0; k < rows; k++) add_height(fit, f, fit->point + 3 * k, cav_fit_clear(fit, frame, f));
  }
  cav_fit_apart_normal(fit);
  cav_difference(m, m->q0, q, 1, fit->move);
  for (size_t d = 0; d < nv; d++) {
    double w = pow(holds(fit, (int)d), 2);
    fit->H[d * nv + d] += w, fit->g[d] += w * fit->move[d];
  }
  if (!before) return;
  double w = pow(fit->options->roughness, 2);
  cav_difference(m, before, q, 1, fit->move);
  for (size_t d = 0; d < nv; d++) fit->H[d * nv + d] += w, fit->g[d] += w * fit->move[d];
}

// a hinge or slide with limits; NULL: dof d is of none
static const cav_joint *ranged(const cav_model *m, int d) {
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  return joint->limited && (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE) ? joint : NULL;
}

void cav_fit_clip(const cav_model *m, double *q) {
  for (int d = 0; d < m->nv; d++) {
    const cav_joint *joint = ranged(m, d);
    if (joint) q[joint->q] = fmin(fmax(q[joint->q], joint->range[0]), joint->range[1]);
  }
}

void cav_fit_pin(const cav_fit *fit, const double *q, double *B, int n) {
  int nv = fit->model->nv;
  for (int d = 0; d < nv; d++) {
    const cav_joint *joint = ranged(fit->model, d);
    int out = joint &&
              ((fit->g[d] < 0 && q[joint->q] >= joint->range[1]) || (fit->g[d] > 0 && q[joint->q] <= joint->range[0]));
    if (!out) continue;
    for (int e = 0; e < nv; e++) fit->H[d > e ? e * nv + d : d * nv + e] = d == e;
    for (int c = 0; c < n; c++) B[(size_t)c * (size_t)nv + (size_t)d] = 0;
    fit->g[d] = 0;
  }
}

cav_status cav_fit_frame(cav_fit *fit, int frame, const double *before, double *q, int *iterations) {
  const cav_model *m = fit->model;
  int nv = m->nv, fresh = 0;
  double cost, damping = 0, *H = fit->H;
  cav_status status = cav_fit_cost(fit, frame, q, before, &cost);
  for (int i = 0; i < fit->options->iterations && !status; i++) {
    if (fresh) status = cav_position(m, fit->state, q);
    if (status) break;
    ++*iterations;
    cav_fit_normal(fit, frame, q, before);
    cav_fit_pin(fit, q, NULL, 0);
    for (int d = 0; d < nv; d++) H[d * nv + d] += damping + 1e-12;
    double after = INFINITY;
    if (cav_dense_factor(nv, nv - 1, H, nv)) {
      for (int d = 0; d < nv; d++) fit->move[d] = -fit->g[d];
      cav_dense_solve_lower(nv, nv - 1, H, nv, 1, fit->move, nv);
      cav_dense_solve_upper(nv, nv - 1, H, nv, 1, fit->move, nv);
      cav_integrate(m, q, fit->move, 1, fit->try);
      cav_fit_clip(m, fit->try);
      status = cav_fit_cost(fit, frame, fit->try, before, &after);
    }
    fresh = !(after < cost);
    if (fresh) {
      if (damping > 1e6) break;
      damping = damping > 0 ? 10 * damping : 1e-4;
      continue;
    }
    memcpy(q, fit->try, (size_t)m->nq * sizeof *q);
    int done = cost - after < least_gain * cost;
    cost = after;
    damping = damping > 1e-8 ? damping / 10 : 0;
    if (done) break;
  }
  return status;
}

// rotation that takes the points of a nearest to those of b, both about their means, by the matrix S = sum a b'
// (Horn, J. Opt. Soc. Am. A 4, 1987): the eigenvector of the largest eigenvalue of a symmetric matrix, by squaring
// it
static void nearest_rotation(const double S[9], double quat[4]) {
  double trace = S[0] + S[4] + S[8], next[16],
         N[16] = {trace,       S[5] - S[7], S[6] - S[2], S[1] - S[3],        S[5] - S[7],         S[0] - S[4] - S[8],
                  S[1] + S[3], S[6] + S[2], S[6] - S[2], S[1] + S[3],        -S[0] + S[4] - S[8], S[5] + S[7],
                  S[1] - S[3], S[6] + S[2], S[5] + S[7], -S[0] - S[4] + S[8]};
  double size = 0;
  for (int i = 0; i < 16; i++) size += N[i] * N[i];
  for (int i = 0; i < 4; i++) N[5 * i] += sqrt(size);
  for (int k = 0; k < 40; k++) {
    double largest = 0;
    for (int i = 0; i < 16; i++) largest = fmax(largest, fabs(N[i]));
    for (int i = 0; i < 16 && largest > 0; i++) N[i] /= largest;
    for (int i = 0; i < 16; i++) {
      next[i] = 0;
      for (int j = 0; j < 4; j++) next[i] += N[i / 4 * 4 + j] * N[4 * j + i % 4];
    }
    memcpy(N, next, sizeof N);
  }
  int most = 0;
  for (int i = 1; i < 4; i++)
    if (N[5 * i] > N[5 * most]) most = i;
  for (int i = 0; i < 4; i++) quat[i] = N[4 * i + most];
  quat_normalise(quat);
}

cav_status cav_fit_align(const cav_fit *fit, int frame, double *q) {
  const cav_model *m = fit->model;
  cav_status status = cav_position(m, fit->state, q);
  for (int j = 0; j < m->njoint && !status; j++) {
    if (m->joint[j].type != CAV_JOINT_FREE) continue;
    double S[9] = {0}, mean[2][3] = {{0}}, x[3], turn[4];
    int n = 0;
    for (int pass = 0; pass < 2; pass++) {
      for (int i = 0; i < fit->n; i++) {
        const double *seen = cav_fit_seen(fit, frame, i);
        int link = m->body[fit->set->marker[fit->marker[i]].body].link;
        if (!seen || m->link[link].root != m->joint[j].link) continue;
        cav_fit_place(fit, i, x);
        if (pass == 0) {
          add3(mean[0], mean[0], x), add3(mean[1], mean[1], seen), n++;
          continue;
        }
        for (int k = 0; k < 9; k++) S[k] += (x[k / 3] - mean[0][k / 3]) * (seen[k % 3] - mean[1][k % 3]);
      }
      if (n < 3) break;
      for (int k = 0; k < 2 && pass == 0; k++) scale3(mean[k], 1.0 / n, mean[k]);
    }
    if (n < 3) continue;
    double *root = q + m->joint[j].q, old[4];
    nearest_rotation(S, turn);
    sub3(x, root, mean[0]);
    quat_rotate(x, turn, x);
    add3(root, mean[1], x);
    memcpy(old, root + 3, sizeof old);
    quat_mul(root + 3, turn, old);
  }
  return status;
}
