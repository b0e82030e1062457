/// The arrival cost of a window is what is left of the one before when its oldest unknown is eliminated: rows of the arrival
/// cost there, of the first knot's costs and of the step after it, to a triangle by reflections (optim/METHOD.md, 15).
#include "arrival.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rotation.h"

cav_status cav_arrival_begin(cav_arrival *a, const cav_model *m) {
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv;
  *a = (cav_arrival){.model = m};
  a->root = calloc(4 * nv * nv + 3 * nv + nq, sizeof *a->root);
  if (!a->root) return CAV_NO_MEMORY;
  a->rest = a->root + 4 * nv * nv;
  a->v = a->rest + 2 * nv;
  a->q = a->v + nv;
  return CAV_OK;
}

void cav_arrival_clear(cav_arrival *a) {
  free(a->root);
  *a = (cav_arrival){0};
}

static int read_values(void *context, const cav_knot_view *view, double *value) {
  const struct cav_arrival_part *part = context;
  const cav_arrival *a = part->of;
  const int nv = a->model->nv;
  double off[2 * CAV_USER_DIM_MAX];
  cav_difference(a->model, a->q, view->q, 1, off);
  for (int d = 0; d < nv; d++) off[nv + d] = view->v[d] - a->v[d];
  for (int i = 0; i < nv; i++) {
    const double *root = a->root + (size_t)(part->first + i) * 2 * (size_t)nv;
    value[i] = a->rest[part->first + i];
    for (int c = part->first + i; c < 2 * nv; c++) value[i] += root[c] * off[c];
  }
  return 0;
}

/// First of three rotational dofs of a joint, -1: it has none.
static int rotation_of(const cav_joint *joint) {
  if (joint->type == CAV_JOINT_FREE) return joint->dof + 3;
  return joint->type == CAV_JOINT_BALL ? joint->dof : -1;
}

static int read_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  const struct cav_arrival_part *part = context;
  const cav_arrival *a = part->of;
  const cav_model *m = a->model;
  const size_t nv = (size_t)m->nv;
  double off[CAV_USER_DIM_MAX], J[9];
  cav_difference(m, a->q, view->q, 1, off);
  for (size_t i = 0; i < nv; i++) {
    const double *root = a->root + ((size_t)part->first + i) * 2 * nv;
    for (size_t c = 0; c < nv; c++) jacobian->dq[i * nv + c] += root[c], jacobian->dv[i * nv + c] += root[nv + c];
  }
  for (int j = 0; j < m->njoint; j++) {
    const int d = rotation_of(&m->joint[j]);
    if (d < 0) continue;
    cav_rotation_jacobian_inverse(off + d, J);
    for (size_t i = 0; i < nv; i++) {
      double *row = jacobian->dq + i * nv + d;
      const double x[3] = {row[0], row[1], row[2]};
      for (int k = 0; k < 3; k++) row[k] = x[0] * J[k] + x[1] * J[3 + k] + x[2] * J[6 + k];
    }
  }
  return 0;
}

void cav_arrival_terms(const cav_arrival *at, cav_term term[CAV_ARRIVAL_TERMS]) {
  cav_arrival *a = (cav_arrival *)at;
  for (int i = 0; i < CAV_ARRIVAL_TERMS; i++) {
    a->part[i] = (struct cav_arrival_part){a, i * a->model->nv};
    a->quantity[i] = (cav_user_quantity){.name = "arrival cost",
                                         .dim = a->model->nv,
                                         .reads = CAV_READS_ACCELERATION,
                                         .value = read_values,
                                         .jacobian = read_jacobian,
                                         .context = &a->part[i]};
    term[i] = cav_term_cost(CAV_QUANTITY_USER, 1);
    term[i].user = &a->quantity[i];
    term[i].from = term[i].to = 0;
  }
}

/// A row over q_0 and q_1 to one over q_1 and the velocity between them: h dv = Jr^-1 dq_1 - Jl^-1 dq_0.
static void turn_row(const cav_model *m, const double *v, double h, double *row) {
  const int nv = m->nv;
  double *later = row + nv;
  for (int j = 0; j < m->njoint; j++) {
    const int d = rotation_of(&m->joint[j]);
    if (d < 0) continue;
    // dq_0 = Jl (Jr^-1 dq_1 - h dv), the left Jacobian the transpose of the right one
    const double phi[3] = {h * v[d], h * v[d + 1], h * v[d + 2]}, x[3] = {row[d], row[d + 1], row[d + 2]};
    double right[9], inverse[9];
    cav_rotation_jacobian(phi, right);
    cav_rotation_jacobian_inverse(phi, inverse);
    // row Jl, into the place of row: what the linear ones have as it is
    for (int k = 0; k < 3; k++) row[d + k] = x[0] * right[3 * k] + x[1] * right[3 * k + 1] + x[2] * right[3 * k + 2];
    for (int k = 0; k < 3; k++)
      later[d + k] += row[d] * inverse[k] + row[d + 1] * inverse[3 + k] + row[d + 2] * inverse[6 + k];
  }
  for (int d = 0; d < nv; d++) {
    const int joint = m->dof[d].joint, first = rotation_of(&m->joint[joint]);
    if (first < 0 || d < first) later[d] += row[d];
  }
  for (int d = 0; d < nv; d++) {
    const double before = row[d];
    row[d] = later[d], later[d] = -h * before;
  }
}

/// Rows [n*(2nv+1)] to a triangle by reflections; the rest is in the last column.
static void make_triangle(int n, int width, double *A) {
  for (int j = 0; j < width - 1 && j < n; j++) {
    double size = 0;
    for (int i = j; i < n; i++) size += A[i * width + j] * A[i * width + j];
    if (size == 0) continue;
    size = sqrt(size);
    const double end = A[j * width + j] > 0 ? -size : size, head = A[j * width + j] - end, scale = -1 / (end * head);
    for (int c = j + 1; c < width; c++) {
      double sum = head * A[j * width + c];
      for (int i = j + 1; i < n; i++) sum += A[i * width + j] * A[i * width + c];
      A[j * width + c] -= scale * head * sum;
      for (int i = j + 1; i < n; i++) A[i * width + c] -= scale * sum * A[i * width + j];
    }
    A[j * width + j] = end;
    for (int i = j + 1; i < n; i++) A[i * width + j] = 0;
  }
}

void cav_arrival_take(cav_arrival *a, const cav_information *f, const cav_trajectory *at) {
  const cav_model *m = a->model;
  const int nv = m->nv, across = 3 * nv + f->factor.border, rows = f->factor.rows < 2 * nv ? f->factor.rows : 2 * nv;
  const double *v = at->v + nv;
  double A[2 * CAV_USER_DIM_MAX * (2 * CAV_USER_DIM_MAX + 1)];
  for (int i = 0; i < rows; i++) {
    const double *from = f->factor.work + (size_t)i * (size_t)across;
    double *row = A + i * (2 * nv + 1);
    // unknowns of the factor are scaled; its next block is that of the configuration at the first knot
    for (int c = 0; c < 2 * nv; c++) row[c] = from[c] * f->scale[f->factor.next * nv + c];
    row[2 * nv] = from[3 * nv];
    turn_row(m, v, at->timestep, row);
  }
  make_triangle(rows, 2 * nv + 1, A);
  memset(a->root, 0, (size_t)(4 * nv * nv + 2 * nv) * sizeof *a->root);
  for (int i = 0; i < rows; i++) {
    for (int c = i; c < 2 * nv; c++) a->root[i * 2 * nv + c] = A[i * (2 * nv + 1) + c];
    a->rest[i] = A[i * (2 * nv + 1) + 2 * nv];
  }
  memcpy(a->q, at->q + m->nq, (size_t)m->nq * sizeof *a->q);
  memcpy(a->v, v, (size_t)nv * sizeof *a->v);
}

void cav_arrival_copy(cav_arrival *to, const cav_arrival *from) {
  const size_t nq = (size_t)from->model->nq, nv = (size_t)from->model->nv;
  memcpy(to->root, from->root, (4 * nv * nv + 3 * nv + nq) * sizeof *to->root);
}
