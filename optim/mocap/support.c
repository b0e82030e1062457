/// Nonnegative least squares over the edges of friction cones (Lawson and Hanson, Solving Least Squares Problems, 1974, ch. 23),
/// on the normal equations.
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "math3.h"

enum { EDGES = 16 };
static const double arm = 0.3;    // m: of turning forces
static const double least = 1e-3; // weight of an effort at its limit, over that of a residual as large as the weight
static const double ridge = 1e-10, done = 1e-9;

struct cav_support {
  const cav_model *model;
  cav_state *state;
  int rows, room;       // nv + nu; columns that there is memory for
  double weight;        // N
  double *scale;        // [rows] over what a row is measured
  double *u, *residual; // [nv], [nv]
  double *b;            // [rows] what is wanted
  double *axis;         // [3*rows] of one contact's axes
  double *A;            // [rows*room] by columns: what edges give
  double *G, *L, *d;    // [room^2], [room^2], [room]
  double *x, *z;        // [room]
  int *list;            // [room] columns above zero
};

void cav_state_look(cav_state *state, double gap) {
  // the smoothed law reaches twelve of its distances
  state->options.stabilisation = CAV_STABILISATION_SOLREF;
  state->options.smoothing = gap / 12;
  state->options.smoothing_self = 0;
}

void cav_support_free(cav_support *s) {
  if (!s) return;
  cav_state_free(s->state);
  free(s->scale), free(s->A), free(s->list);
  free(s);
}

// what each row is measured over: weight of a force, limits of efforts
static void set_scales(cav_support *s) {
  const cav_model *m = s->model;
  double pull = norm3(m->gravity);
  s->weight = (pull > 0 ? pull : 9.81) * (m->mass > 0 ? m->mass : 1);
  for (int d = 0; d < m->nv; d++) {
    const cav_joint *joint = &m->joint[m->dof[d].joint];
    int line = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && d - joint->dof < 3);
    s->scale[d] = s->weight * (line ? 1 : arm);
  }
  for (int a = 0; a < m->nu; a++) {
    double range[2], limit;
    cav_actuator_effort_range(m, a, range);
    limit = fmax(fabs(range[0]), fabs(range[1]));
    s->scale[m->nv + a] = (isfinite(limit) && limit > 0 ? limit : s->weight) / least;
  }
}

cav_support *cav_support_new(const cav_model *model, const cav_options *law, double timestep) {
  cav_support *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  size_t nv = (size_t)model->nv, rows = nv + (size_t)model->nu;
  s->model = model, s->rows = (int)rows;
  s->state = cav_state_new(model);
  s->scale = malloc((2 * rows + 2 * nv + 3 * rows + 1) * sizeof *s->scale);
  if (!s->state || !s->scale) {
    cav_support_free(s);
    return NULL;
  }
  s->b = s->scale + rows, s->u = s->b + rows, s->residual = s->u + nv, s->axis = s->residual + nv;
  if (law) s->state->options = *law;
  s->state->options.timestep = timestep;
  // joint forces are those of actuators; contacts are chosen below
  s->state->options.constraint = s->state->options.contact = 0;
  set_scales(s);
  return s;
}

// room for n columns
static cav_status grow(cav_support *s, int columns) {
  size_t n = (size_t)columns;
  if (columns <= s->room) return CAV_OK;
  free(s->A), free(s->list);
  s->room = 0;
  s->A = malloc(((size_t)s->rows * n + 2 * n * n + 3 * n) * sizeof *s->A);
  s->list = malloc(n * sizeof *s->list);
  if (!s->A || !s->list) return CAV_NO_MEMORY;
  s->room = columns;
  s->G = s->A + (size_t)s->rows * n, s->L = s->G + n * n, s->d = s->L + n * n, s->x = s->d + n, s->z = s->x + n;
  return CAV_OK;
}

// rows of a generalised force: what no actuator gives of it, and efforts
static void split(const cav_support *s, const double *u, double *row) {
  cav_actuation(s->model, s->state, u, row, row + s->model->nv);
  for (int i = 0; i < s->rows; i++) row[i] /= s->scale[i];
}

// rows of a force of one weight along each axis of a contact
static void split_axes(const cav_support *s, const cav_contact *c) {
  const cav_model *m = s->model;
  for (int k = 0; k < 3; k++) {
    memset(s->residual, 0, (size_t)m->nv * sizeof *s->residual);
    for (int side = 0; side < 2; side++) {
      int link = side ? c->link2 : c->link1;
      while (link > 0 && m->link[link].ndof == 0) link = m->link[link].parent;
      for (int d = link > 0 ? m->link[link].dof + m->link[link].ndof - 1 : -1; d >= 0; d = m->dof[d].parent) {
        double move[3];
        velocity_at(move, s->state->axis + 6 * d, s->state->reference + 3 * m->dof[d].link, c->pos);
        s->residual[d] += (side ? 1 : -1) * s->weight * dot3(move, c->frame + 3 * k);
      }
    }
    split(s, s->residual, s->axis + k * s->rows);
  }
}

// edges of a contact's cone as columns from n on; how many there are then
static int add_edges(const cav_support *s, const cav_contact *c, int n) {
  int edges = c->dim < 3 || !(c->friction[0] > 0) ? 1 : EDGES;
  split_axes(s, c);
  for (int e = 0; e < edges; e++, n++) {
    double angle = 2 * M_PI * e / EDGES, a = edges > 1 ? c->friction[0] * cos(angle) : 0,
           b = edges > 1 ? c->friction[1] * sin(angle) : 0, *column = s->A + (size_t)n * (size_t)s->rows;
    for (int i = 0; i < s->rows; i++) column[i] = s->axis[i] + a * s->axis[s->rows + i] + b * s->axis[2 * s->rows + i];
  }
  return n;
}

// z: least squares over the columns of the list
static int solve(const cav_support *s, int n, const int *list, int k) {
  for (int i = 0; i < k; i++) {
    s->z[i] = s->d[list[i]];
    for (int j = 0; j <= i; j++) s->L[j * k + i] = s->G[list[j] * n + list[i]];
    s->L[i * k + i] *= 1 + ridge;
  }
  if (!cav_dense_factor(k, k - 1, s->L, k)) return 0;
  cav_dense_solve_lower(k, k - 1, s->L, k, 1, s->z, k);
  cav_dense_solve_upper(k, k - 1, s->L, k, 1, s->z, k);
  return 1;
}

// columns of the list that a step to z would take below zero are stopped at it and leave; how many are left
static int step(const cav_support *s, int *list, int k) {
  double part = 1;
  int kept = 0;
  for (int i = 0; i < k; i++)
    if (s->z[i] <= 0) part = fmin(part, s->x[list[i]] / (s->x[list[i]] - s->z[i]));
  for (int i = 0; i < k; i++) {
    double *x = &s->x[list[i]];
    *x += part * (s->z[i] - *x);
    if (part < 1 && s->z[i] <= 0 && *x <= done) {
      *x = 0;
      continue;
    }
    list[kept++] = list[i];
  }
  return part < 1 ? kept : -k;
}

// x >= 0 with the least |A x - b|
static void fit(const cav_support *s, int n) {
  int *list = s->list, k = 0;
  if (n == 0) return;
  memset(s->G, 0, (size_t)n * (size_t)n * sizeof *s->G);
  memset(s->d, 0, (size_t)n * sizeof *s->d), memset(s->x, 0, (size_t)n * sizeof *s->x);
  cav_dense_product_transposed(CAV_TRIANGLE_BOTH, n, n, s->rows, 1, s->A, s->rows, s->A, s->rows, s->G, n);
  cav_dense_product_transposed(CAV_TRIANGLE_BOTH, n, 1, s->rows, 1, s->A, s->rows, s->b, s->rows, s->d, n);
  for (int turn = 0; turn < 3 * n && k < n; turn++) {
    int best = -1;
    double most = done;
    for (int j = 0; j < n; j++) {
      double gain = s->d[j];
      if (s->x[j] > 0) continue;
      for (int i = 0; i < k; i++) gain -= s->G[list[i] * n + j] * s->x[list[i]];
      if (gain > most) most = gain, best = j;
    }
    if (best < 0) return;
    list[k++] = best;
    while (k > 0) {
      if (!solve(s, n, list, k)) {
        s->x[list[--k]] = 0;
        return;
      }
      int left = step(s, list, k);
      if (left < 0) break;
      k = left;
    }
  }
}

cav_status cav_support_find(cav_support *s, cav_state *look, double gap, const double *q, const double *v,
                            const double *v_next, double *residual, double *excess, double *effort) {
  const cav_model *m = s->model;
  int n = 0;
  cav_status status = cav_inverse(m, s->state, q, v, v_next, s->u);
  if (!status) status = cav_position(m, look, q);
  if (status) return status;
  split(s, s->u, s->b);
  status = grow(s, EDGES * look->ncontact);
  for (int i = 0; i < look->ncontact && !status; i++) {
    const cav_contact *c = &look->contact[i];
    double at[2][3] = {{0}}, way[3];
    if (!m->pair[c->pair].external) continue;
    for (int side = 0; side < 2; side++) {
      int link = side ? c->link2 : c->link1;
      if (link > 0) velocity_at(at[side], s->state->velocity_next + 6 * link, s->state->reference + 3 * link, c->pos);
    }
    sub3(way, at[1], at[0]);
    if (fmin(c->dist, c->dist + s->state->options.timestep * dot3(c->frame, way)) < gap) n = add_edges(s, c, n);
  }
  if (status) return status;
  fit(s, n);
  for (int j = 0; j < n; j++)
    for (int i = 0; i < s->rows && s->x[j] > 0; i++) s->b[i] -= s->x[j] * s->A[(size_t)j * (size_t)s->rows + (size_t)i];
  *residual = *excess = *effort = 0;
  for (int d = 0; d < m->nv; d++) *residual += s->b[d] * s->b[d];
  *residual = sqrt(*residual);
  for (int a = 0; a < m->nu; a++) {
    double range[2], force = s->b[m->nv + a] * s->scale[m->nv + a];
    cav_actuator_effort_range(m, a, range);
    double limit = fmax(fabs(range[0]), fabs(range[1]));
    if (!(limit > 0) || !isfinite(limit)) continue;
    *excess = fmax(*excess, fmax(force - range[1], range[0] - force) / limit);
    *effort += force * force / (limit * limit) / m->nu;
  }
  return CAV_OK;
}
