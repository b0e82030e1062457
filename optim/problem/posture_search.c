/// Least squares over configurations; posture_search.h.
#include "posture_search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"

static const double inside = 0.02; // rad or m from a limit

/// Where a search works.
typedef struct workspace {
  double *row, *moved, *jacobian; // [nrow], [nrow], [nrow*nv]
  double *a, *b, *unit, *trial;   // [nv*nv], [nv], [nv], [nq]
} workspace;

// the range that a joint is kept in
static void kept_range(const cav_joint *joint, double range[2]) {
  int scalar = joint->limited && (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE);
  double room = scalar ? fmin(inside, (joint->range[1] - joint->range[0]) / 4) : 0;
  range[0] = scalar ? joint->range[0] + room : -INFINITY;
  range[1] = scalar ? joint->range[1] - room : INFINITY;
}

void cav_posture_clip(const cav_model *m, double *q) {
  double range[2];
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    kept_range(joint, range);
    // a door stays as it is, where something else is driven
    if (m->nu > 0 && !m->link[m->link[joint->link].root].driven) continue;
    if (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE)
      q[joint->q] = fmin(fmax(q[joint->q], range[0]), range[1]);
  }
}

double cav_posture_depth(const cav_model *m, const cav_state *state, cav_depth of) {
  double deepest = 0, squares = 0;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    if (m->pair[c->pair].external) continue;
    double depth = fmax(-c->dist, 0);
    deepest = fmax(deepest, depth), squares += depth * depth;
  }
  return of == CAV_DEPTH_DEEPEST ? deepest : sqrt(squares);
}

// whether a dof is at an end of its range and would go beyond it
static int is_pinned(const cav_posture_search *s, int d, double way) {
  const cav_joint *joint = &s->model->joint[s->model->dof[d].joint];
  double range[2];
  kept_range(joint, range);
  return (way > 0 && s->q[joint->q] >= range[1]) || (way < 0 && s->q[joint->q] <= range[0]);
}

static double square(const double *row, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += row[i] * row[i];
  return sum;
}

// rows at the search's posture, and their derivatives
static cav_status differentiate(const cav_posture_search *s, const workspace *w) {
  static const double difference = 1e-6;
  const cav_model *m = s->model;
  int nv = m->nv;
  cav_status status = s->rows(s->user, s->q, w->row);
  for (int d = 0; d < nv && !status; d++) {
    memset(w->unit, 0, (size_t)nv * sizeof *w->unit);
    w->unit[d] = difference;
    cav_integrate(m, s->q, w->unit, 1, w->trial);
    status = s->rows(s->user, w->trial, w->moved);
    for (int i = 0; i < s->nrow; i++) w->jacobian[i * nv + d] = (w->moved[i] - w->row[i]) / difference;
  }
  return status;
}

// the step into w->b by these derivatives; 0 where the damping is too small for a factor
static int find_step(const cav_posture_search *s, const workspace *w, double damping) {
  int nv = s->model->nv;
  double *a = w->a, *b = w->b, *jacobian = w->jacobian;
  for (int d = 0; d < nv; d++) {
    for (int e = 0; e <= d; e++) {
      a[e * nv + d] = d == e ? damping : 0;
      for (int i = 0; i < s->nrow; i++) a[e * nv + d] += jacobian[i * nv + d] * jacobian[i * nv + e];
    }
    b[d] = 0;
    for (int i = 0; i < s->nrow; i++) b[d] -= jacobian[i * nv + d] * w->row[i];
  }
  for (int d = 0; d < nv; d++) {
    if (!is_pinned(s, d, b[d])) continue;
    for (int e = 0; e < nv; e++) a[d > e ? e * nv + d : d * nv + e] = d == e;
    b[d] = 0;
  }
  if (!cav_dense_factor(nv, nv - 1, a, nv)) return 0;
  cav_dense_solve_lower(nv, nv - 1, a, nv, 1, b, nv);
  cav_dense_solve_upper(nv, nv - 1, a, nv, 1, b, nv);
  return 1;
}

// one step with that damping; *better: whether it was taken
static cav_status iterate(cav_posture_search *s, const workspace *w, double damping, int *better) {
  const cav_model *m = s->model;
  *better = 0;
  cav_status status = differentiate(s, w);
  if (status || !find_step(s, w, damping)) return status;
  cav_integrate(m, s->q, w->b, 1, w->trial);
  cav_posture_clip(m, w->trial);
  status = s->rows(s->user, w->trial, w->moved);
  *better = !status && square(w->moved, s->nrow) < square(w->row, s->nrow);
  if (*better) memcpy(s->q, w->trial, (size_t)m->nq * sizeof *s->q);
  return status;
}

cav_status cav_posture_find(cav_posture_search *s) {
  enum { ITERATIONS = 100 };
  size_t nv = (size_t)s->model->nv, nq = (size_t)s->model->nq, n = (size_t)s->nrow;
  double *block = calloc(n * (nv + 2) + nv * nv + 2 * nv + nq, sizeof *block);
  if (!block) return CAV_NO_MEMORY;
  workspace w = {.row = block, .moved = block + n, .jacobian = block + 2 * n};
  w.a = w.jacobian + n * nv, w.b = w.a + nv * nv, w.unit = w.b + nv, w.trial = w.unit + nv;
  double damping = 1e-3;
  cav_status status = CAV_OK;
  for (int i = 0; i < ITERATIONS && damping < 1e6 && !status; i++) {
    int better;
    status = iterate(s, &w, damping, &better);
    damping = better ? fmax(damping / 5, 1e-9) : damping * 5;
  }
  if (!status) status = s->rows(s->user, s->q, w.row);
  free(block);
  return status;
}
