/// One step forward by generalised projected Gauss-Seidel on the impulse problem (9), Todorov 2014, section IV:
/// minimise 1/2 f' (A + R) f + f' (v_minus - v*) over the cones, A = J M^-1 J', one object at a time and each update
/// exact. Limits and friction losses are clamped. A contact is moved first along the ray of its impulse, or from the
/// apex along the steepest ray of its cone, then in its friction part with the normal fixed: a quadratic on an
/// ellipsoid, solved by Newton's method on the multiplier (Moré and Sorensen 1983).
///
/// Starts from the impulses of the last solve on the same state, matched object by object. For midpoint the smooth
/// forces are taken anew after each sweep. The exact law only: the smoothed one has no bounded dual; use
/// cav_forward_newton.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "impulse.h"
#include "math3.h"

enum { DIM_MAX = 6, SECULAR_STEPS = 30 };

/// An impulse remembered between solves, and of which object.
typedef struct cav_memory {
  int type;   ///< -1 for a contact, else the cav_row_type
  int object; ///< pair, or the object of the row
  int detail; ///< feature, or the side of the row
  double f[DIM_MAX];
} cav_memory;

// the solver's arrays
typedef struct gpgs {
  cav_impulse problem;
  double *A;       // [nrow*nrow] J M^-1 J' + diag(R)
  double *W;       // [nrow*nv] rows of J M^-1
  double *offset;  // [nrow] v_minus - v*
  double *f, *was; // [nrow] impulses, those of the last sweep
  double *found;   // [nrow] impulses of the inverse
  double *free;    // [nv] v without constraint impulses
  double *x, *r;   // [nv] v_next; scratch
} gpgs;

static double dot(const double *a, const double *b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// factors the symmetric Q + shift (n <= 5) as C C' and solves for x = -(Q + shift)^-1 c; curvature gets x' (Q +
// shift)^-1 x
static int solve_shifted(int n, const double *Q, double shift, const double *c, double *x, double *curvature) {
  double C[25], z[5];
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      const double sum = Q[i * n + j] + (i == j ? shift : 0.0) - dot(C + i * n, C + j * n, j);
      if (i == j && !(sum > 0.0)) return 0;
      C[i * n + j] = i == j ? sqrt(sum) : sum / C[j * n + j];
    }
  for (int i = 0; i < n; i++) x[i] = (-c[i] - dot(C + i * n, x, i)) / C[i * n + i];
  for (int i = n - 1; i >= 0; i--) {
    for (int j = i + 1; j < n; j++) x[i] -= C[j * n + i] * x[j];
    x[i] /= C[i * n + i];
  }
  for (int i = 0; i < n; i++) z[i] = (x[i] - dot(C + i * n, z, i)) / C[i * n + i];
  *curvature = dot(z, z, n);
  return 1;
}

// least 1/2 y' Q y + c' y with |y| <= radius: the free minimum if it is inside, else Newton on 1/|y| - 1/radius in the
// multiplier, which is concave and increasing there, so the iterates never pass the root
static void minimise_in_ball(int n, const double *Q, const double *c, double radius, double *y) {
  double shift = 0.0, curvature, norm = 0.0;
  for (int i = 0; i < n; i++) y[i] = 0.0;
  if (!(radius > 0.0)) return;
  for (int k = 0; k < SECULAR_STEPS; k++) {
    if (!solve_shifted(n, Q, shift, c, y, &curvature)) return;
    norm = sqrt(dot(y, y, n));
    if (norm <= radius * (1.0 + 1e-15)) break;
    const double step = norm * norm / curvature * (norm - radius) / radius;
    if (!(shift + step > shift)) break;
    shift += step;
  }
  // the last digit, so that the impulse never leaves its cone
  if (norm > radius)
    for (int i = 0; i < n; i++) y[i] *= radius / norm;
}

// friction part of a contact with its normal impulse fixed. H is the contact's block of A + R, w the gradient at f
static void update_friction(int dim, const double *H, const double *friction, const double *w, double *f) {
  double Q[25], c[5], y[5];
  int row[5], n = 0;
  for (int i = 1; i < dim; i++)
    if (friction[i - 1] > 0.0) row[n++] = i;
  for (int i = 0; i < n; i++) {
    const double mu = friction[row[i] - 1];
    c[i] = mu * w[row[i]];
    for (int j = 0; j < n; j++) {
      c[i] -= mu * H[row[i] * dim + row[j]] * f[row[j]];
      Q[i * n + j] = mu * H[row[i] * dim + row[j]] * friction[row[j] - 1];
    }
  }
  minimise_in_ball(n, Q, c, f[0], y);
  for (int i = 0; i < n; i++) f[row[i]] = friction[row[i] - 1] * y[i];
}

// w := w + H d
static void follow(int dim, const double *H, const double *d, double *w) {
  for (int i = 0; i < dim; i++) w[i] += dot(H + i * dim, d, dim);
}

// moves f along a ray of its cone: its own, or from the apex the one on which the cost falls most steeply
static void update_ray(int dim, const double *H, const double *friction, double *w, double *f) {
  double ray[DIM_MAX] = {1.0}, bent[DIM_MAX] = {0.0}, least = -1.0;
  if (f[0] > 0.0) {
    memcpy(ray, f, (size_t)dim * sizeof *f);
  } else {
    double pull = 0.0;
    for (int i = 1; i < dim; i++) pull += friction[i - 1] * friction[i - 1] * w[i] * w[i];
    pull = sqrt(pull);
    for (int i = 1; i < dim; i++) ray[i] = pull > 0.0 ? -friction[i - 1] * friction[i - 1] * w[i] / pull : 0.0;
    least = 0.0;
  }
  follow(dim, H, ray, bent);
  double length = -dot(ray, w, dim) / dot(ray, bent, dim);
  if (!(length > least)) length = least;
  for (int i = 0; i < dim; i++) {
    f[i] += length * ray[i];
    w[i] += length * bent[i];
  }
  if (f[0] <= 0.0) memset(f, 0, (size_t)dim * sizeof *f);
}

// exact update of one contact
static void update_contact(gpgs *s, const cav_block *block, const cav_contact *contact) {
  const int dim = block->dim, nrow = s->problem.nrow;
  double H[DIM_MAX * DIM_MAX], w[DIM_MAX], *f = s->f + block->first;
  for (int i = 0; i < dim; i++) {
    const double *A = s->A + (block->first + i) * nrow;
    w[i] = dot(A, s->f, nrow) + s->offset[block->first + i];
    memcpy(H + i * dim, A + block->first, (size_t)dim * sizeof *H);
  }
  update_ray(dim, H, contact->friction, w, f);
  if (dim > 1) update_friction(dim, H, contact->friction, w, f);
}

// exact update of one limit or friction loss
static void update_scalar(gpgs *s, const cav_block *block, const cav_row *row) {
  const int i = block->first, nrow = s->problem.nrow;
  const double *A = s->A + i * nrow, w = dot(A, s->f, nrow) + s->offset[i];
  const int two_sided = row->type == CAV_ROW_FRICTION_DOF || row->type == CAV_ROW_FRICTION_TENDON;
  const double f = s->f[i] - w / A[i], least = two_sided ? -row->bound : 0.0, most = two_sided ? row->bound : INFINITY;
  s->f[i] = f < least ? least : f > most ? most : f;
}

// one sweep over all objects; returns the largest change of an impulse relative to the largest impulse
static double sweep(gpgs *s) {
  const cav_impulse *p = &s->problem;
  double change = 0.0, size = 0.0;
  memcpy(s->was, s->f, (size_t)p->nrow * sizeof *s->f);
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact >= 0)
      update_contact(s, block, &p->state->contact[block->contact]);
    else
      update_scalar(s, block, &p->state->row[block->row]);
  }
  for (int i = 0; i < p->nrow; i++) {
    change = fmax(change, fabs(s->f[i] - s->was[i]));
    size = fmax(size, fmax(fabs(s->f[i]), fabs(s->was[i])));
  }
  return size > 0.0 ? change / size : 0.0;
}

// velocity without constraint impulses, from the smooth forces at x, and what it leaves to the constraints
static cav_status take_smooth(gpgs *s, const double *v, const double *u) {
  const cav_impulse *p = &s->problem;
  const cav_status status = cav_impulse_smooth(p, v, u, s->x, s->r);
  if (status != CAV_OK) return status;
  cav_ldl_solve(p->model, p->state->work, p->L, s->r);
  for (int i = 0; i < p->nv; i++) s->free[i] = s->x[i] - s->r[i];
  cav_impulse_rows(p, s->free, s->offset);
  for (int i = 0; i < p->nrow; i++) s->offset[i] -= p->target[i];
  return CAV_OK;
}

// x := free + M^-1 J' f
static void take_step(gpgs *s) {
  const cav_impulse *p = &s->problem;
  memcpy(s->x, s->free, (size_t)p->nv * sizeof *s->x);
  for (int i = 0; i < p->nrow; i++)
    for (int k = 0; k < p->nv; k++) s->x[k] += s->f[i] * s->W[i * p->nv + k];
}

// A + R and the rows of J M^-1
static void fill_matrices(gpgs *s) {
  const cav_impulse *p = &s->problem;
  memset(s->W, 0, (size_t)p->nrow * (size_t)p->nv * sizeof *s->W);
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    for (int i = 0; i < block->dim; i++) {
      double *W = s->W + (block->first + i) * p->nv;
      for (int k = 0; k < block->ndof; k++) W[block->dof[k]] = block->J[i * block->ndof + k];
      cav_ldl_solve(p->model, p->state->work, p->L, W);
    }
  }
  for (int i = 0; i < p->nrow; i++) {
    cav_impulse_rows(p, s->W + i * p->nv, s->A + i * p->nrow);
    s->A[i * p->nrow + i] += p->R[i];
  }
}

// which object a block is
static cav_memory identify(const cav_impulse *p, const cav_block *block) {
  cav_memory m = {-1, 0, 0, {0.0}};
  if (block->contact >= 0) {
    m.object = p->state->contact[block->contact].pair;
    m.detail = p->state->contact[block->contact].feature;
  } else {
    const cav_row *row = &p->state->row[block->row];
    m = (cav_memory){(int)row->type, row->object, row->side, {0.0}};
  }
  return m;
}

// impulses of the last solve for the objects that are still there, zero for the rest. Both lists have one order, so the
// search goes on from the last hit
static void recall(gpgs *s) {
  const cav_impulse *p = &s->problem;
  const cav_workspace *work = p->state->work;
  memset(s->f, 0, (size_t)p->nrow * sizeof *s->f);
  for (int b = 0, next = 0; b < p->nblock; b++) {
    const cav_memory m = identify(p, &p->block[b]);
    for (int k = 0; k < work->nmemory; k++) {
      const int at = (next + k) % work->nmemory;
      const cav_memory *old = &work->memory[at];
      if (old->type != m.type || old->object != m.object || old->detail != m.detail) continue;
      memcpy(s->f + p->block[b].first, old->f, (size_t)p->block[b].dim * sizeof *s->f);
      next = at + 1;
      break;
    }
  }
}

static cav_status remember(const gpgs *s) {
  const cav_impulse *p = &s->problem;
  cav_workspace *work = p->state->work;
  if (p->nblock > work->memory_room) {
    cav_memory *larger = realloc(work->memory, 2 * (size_t)p->nblock * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    work->memory = larger;
    work->memory_room = 2 * p->nblock;
  }
  work->nmemory = p->nblock;
  for (int b = 0; b < p->nblock; b++) {
    work->memory[b] = identify(p, &p->block[b]);
    memcpy(work->memory[b].f, s->f + p->block[b].first, (size_t)p->block[b].dim * sizeof *s->f);
  }
  return CAV_OK;
}

// duality gap: that of Fenchel and Young for each object, f against its best reply f_i to the velocity it causes,
// (f_i - f)' R (g - (f_i + f)/2). mismatch |f - f_i|
static void fill_report(gpgs *s, cav_forward_report *report) {
  const cav_impulse *p = &s->problem;
  double *y = s->was, *found = s->found, square = 0.0, gap = 0.0;
  cav_impulse_rows(p, s->x, y);
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    cav_impulse_law(p, block, y, found, NULL, NULL);
    for (int i = block->first; i < block->first + block->dim; i++) {
      const double off = found[i] - s->f[i];
      square += off * off;
      gap += off * (p->target[i] - y[i] - 0.5 * p->R[i] * (found[i] + s->f[i]));
    }
  }
  report->gap = gap;
  report->mismatch = sqrt(square);
}

static cav_status prepare(gpgs *s, const cav_model *model, cav_state *state, const double *q, const double *v) {
  cav_impulse *p = &s->problem;
  const cav_impulse_room room = {.per_row = 4, .per_row_squared = 1, .per_row_and_dof = 1, .per_dof = 3};
  const cav_status status = cav_impulse_new(model, state, q, v, &room, p);
  if (status != CAV_OK) return status;
  const size_t rows = (size_t)p->nrow, nv = (size_t)model->nv;
  s->A = p->spare;
  s->W = s->A + rows * rows;
  s->offset = s->W + rows * nv;
  s->f = s->offset + rows;
  s->was = s->f + rows;
  s->found = s->was + rows;
  s->free = s->found + rows;
  s->x = s->free + nv;
  s->r = s->x + nv;
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact >= 0 ? state->contact[block->contact].sigma > 0.0 : state->row[block->row].sigma > 0.0)
      return CAV_NOT_SUPPORTED;
  }
  return CAV_OK;
}

cav_status cav_forward_gpgs(const cav_model *model, cav_state *state, const double *q, const double *v, const double *u,
                            int iterations, double tolerance, double *v_next, cav_forward_report *report) {
  if (iterations < 0 || !(tolerance >= 0.0)) return CAV_BAD_INPUT;
  if (!all_finite(u, model->nv) || !all_finite(v, model->nv)) return CAV_NOT_FINITE;
  gpgs s;
  cav_status status = prepare(&s, model, state, q, v);
  if (status != CAV_OK) return status;
  fill_matrices(&s);
  recall(&s);
  memcpy(s.x, v, (size_t)model->nv * sizeof *v);
  status = take_smooth(&s, v, u);
  if (status != CAV_OK) return status;
  take_step(&s);

  // sweeps; for midpoint the smooth forces follow
  const int midpoint = state->options.order == CAV_ORDER_MIDPOINT;
  int count = 0, converged = s.problem.nrow == 0 && !midpoint;
  while (!converged && count < iterations) {
    if (midpoint && (status = take_smooth(&s, v, u)) != CAV_OK) return status;
    const double change = sweep(&s);
    memcpy(s.r, s.x, (size_t)model->nv * sizeof *s.r);
    take_step(&s);
    double moved = 0.0, size = 0.0;
    for (int i = 0; midpoint && i < model->nv; i++) {
      moved = fmax(moved, fabs(s.x[i] - s.r[i]));
      size = fmax(size, fabs(s.x[i]));
    }
    converged = change <= tolerance && moved <= tolerance * size;
    count++;
  }
  if (!all_finite(s.x, model->nv)) return CAV_NOT_FINITE;
  status = remember(&s);
  if (status != CAV_OK) return status;

  // what the inverse says to it
  cav_forward_report mine = {.iterations = count};
  double error, scale;
  status = cav_impulse_check(&s.problem, q, v, u, s.x, s.r, s.found, &error, &scale);
  if (status != CAV_OK) return status;
  fill_report(&s, &mine);
  mine.residual = error > 0.0 ? error / scale : 0.0;
  memcpy(v_next, s.x, (size_t)model->nv * sizeof *v_next);
  if (report) *report = mine;
  return converged ? CAV_OK : CAV_NOT_CONVERGED;
}
