/// One step forward by generalised projected Gauss-Seidel on the impulse problem (9), Todorov 2014, section IV:
/// minimise 1/2 f' (A + R) f + f' (v_minus - v*) over the cones, A = J M_hat^-1 J', one object at a time and each
/// update exact. Limits and friction losses are clamped. A contact is moved first along the ray of its impulse, or from
/// the apex along the steepest ray of its cone, then in its friction part with the normal fixed: a quadratic on an
/// ellipsoid, solved by Newton's method on the multiplier (Moré and Sorensen 1983).
///
/// Equality constraints are not swept over but eliminated, eqs. (6), (7): M^-1 gives way to M_hat^-1 = M^-1 - M^-1 J_E'
/// S J_E M^-1 with S = (A_E + R_E)^-1, and v to v_hat. So they hold to rounding in every sweep and stiff ones cost no
/// more of them.
///
/// Hard ones are the same with R_E = 0 and the pseudo-inverse of A_E for S.
///
/// Under Coulomb's law the first of a contact's two updates moves its normal impulse alone: the fixed point is that
/// law's.
///
/// Starts from the impulses of the last solve on the same state, matched object by object. For midpoint and momentum
/// the smooth forces are taken anew after each sweep. The exact law only: the smoothed one has no bounded dual; use
/// cav_forward_newton.
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "algebra.h"
#include "impulse.h"
#include "math3.h"

static const double RANK_TOLERANCE = 1e-10;

enum { DIM_MAX = CAV_IMPULSE_DIM, SECULAR_STEPS = 30, PASSES = 3 };

// the solver's arrays
typedef struct gpgs {
  cav_impulse problem;
  int hard;        // equality constraints have R_E = 0
  int n, m;        // rows of bounded objects and, behind them, of equality constraints
  double *A;       // [n*n] J M_hat^-1 J' + diag(R)
  double *W;       // [(n+m)*nv] rows of J M_hat^-1, then of J_E M^-1
  double *S;       // [m*m] (A_E + R_E)^-1 or hard A_E^+, with 2 m*m of scratch behind
  double *offset;  // [n+m] v_minus - v*
  double *f, *was; // [nrow] impulses, those of the last sweep
  double *found;   // [nrow] impulses of the inverse
  double *free;    // [nv] v_hat: v without impulses of bounded objects
  double *x, *r;   // [nv] v_next; momentum missing by the smooth forces alone
  double *row;     // [n+m] scratch: rows of something
  double *hold;    // [m] impulses of equality constraints
  double *lack;    // [m] scratch: what is missing of their velocities
  double *missing; // [nv] scratch: momentum
  double *moved;   // [nv] scratch
} gpgs;

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
  enum { ROWS_MAX = DIM_MAX - 1 };
  double Q[ROWS_MAX * ROWS_MAX], c[ROWS_MAX], y[ROWS_MAX];
  int row[ROWS_MAX], n = 0;
  assert(dim <= DIM_MAX);
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

// moves the normal impulse alone, as Coulomb's law has it
static void update_normal(int dim, const double *H, double *w, double *f) {
  const double step = fmax(-w[0] / H[0], -f[0]);
  f[0] += step;
  for (int i = 0; i < dim; i++) w[i] += step * H[i * dim];
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
  const int dim = block->dim, nrow = s->n;
  double H[DIM_MAX * DIM_MAX] = {0.0}, w[DIM_MAX] = {0.0}, *f = s->f + block->first;
  for (int i = 0; i < dim; i++) {
    const double *A = s->A + (block->first + i) * nrow;
    w[i] = dot(A, s->f, nrow) + s->offset[block->first + i];
    memcpy(H + i * dim, A + block->first, (size_t)dim * sizeof *H);
  }
  if (s->problem.state->options.sliding == CAV_SLIDING_COULOMB)
    update_normal(dim, H, w, f);
  else
    update_ray(dim, H, contact->friction, w, f);
  if (dim > 1) update_friction(dim, H, contact->friction, w, f);
}

// exact update of one limit or friction loss
static void update_scalar(gpgs *s, const cav_block *block, const cav_row *row) {
  const int i = block->first, nrow = s->n;
  const double *A = s->A + i * nrow, w = dot(A, s->f, nrow) + s->offset[i];
  const int two_sided = row->type == CAV_ROW_FRICTION_DOF || row->type == CAV_ROW_FRICTION_TENDON;
  const double f = s->f[i] - w / A[i], least = two_sided ? -row->bound : 0.0, most = two_sided ? row->bound : INFINITY;
  s->f[i] = f < least ? least : f > most ? most : f;
}

// one sweep over all objects; returns the largest change of an impulse relative to the largest impulse
static double sweep(gpgs *s) {
  const cav_impulse *p = &s->problem;
  double change = 0.0, size = 0.0;
  memcpy(s->was, s->f, (size_t)s->n * sizeof *s->f);
  for (int b = 0; b < p->nbound; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact >= 0)
      update_contact(s, block, &p->state->contact[block->contact]);
    else
      update_scalar(s, block, &p->state->row[block->row]);
  }
  for (int i = 0; i < s->n; i++) {
    change = fmax(change, fabs(s->f[i] - s->was[i]));
    size = fmax(size, fmax(fabs(s->f[i]), fabs(s->was[i])));
  }
  return size > 0.0 ? change / size : 0.0;
}

// r += J_E' f, f [m]
static void push_equalities(const gpgs *s, const double *f, double *r) {
  const cav_impulse *p = &s->problem;
  for (int b = p->nbound; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    for (int i = 0; i < block->dim; i++) {
      const double *J = block->J + i * block->ndof, force = f[block->first - s->n + i];
      for (int k = 0; k < block->ndof; k++) r[block->dof[k]] += J[k] * force;
    }
  }
}

// solves M dx - J_E' df = r, J_E dx + R_E df = e and adds the two to x and f; r [nv] and e [m] are overwritten
static void solve_equalities(const gpgs *s, double *r, double *e, double *x, double *f) {
  const cav_impulse *p = &s->problem;
  cav_ldl_solve(p->model, p->state->work, p->L, r);
  cav_impulse_rows(p, r, s->row);
  for (int i = 0; i < s->m; i++) e[i] -= s->row[s->n + i];
  for (int k = 0; k < p->nv; k++) x[k] += r[k];
  for (int i = 0; i < s->m; i++) {
    const double df = dot(s->S + i * s->m, e, s->m), *W = s->W + (s->n + i) * p->nv;
    f[i] += df;
    for (int k = 0; k < p->nv; k++) x[k] += df * W[k];
  }
}

// e := what is missing of the equality rows at x with impulses f: aim v*_E - J_E x - R_E f, aim 1 or 0
static void miss_equalities(const gpgs *s, double aim, const double *x, const double *f, double *e) {
  const cav_impulse *p = &s->problem;
  cav_impulse_rows(p, x, s->row);
  for (int i = 0; i < s->m; i++) {
    const int k = s->n + i;
    e[i] = aim * p->target[k] - s->row[k] - p->R[k] * f[i];
  }
}

// v_hat from the smooth forces at x, and what it leaves to the bounded objects. With equality constraints solved twice:
// their impulses may cancel forces many digits larger
static cav_status take_smooth(gpgs *s, const double *v, const double *u) {
  const cav_impulse *p = &s->problem;
  const int nv = p->nv;
  const cav_status status = cav_impulse_smooth(p, v, u, s->x, s->r);
  if (status != CAV_OK) return status;
  memcpy(s->free, s->x, (size_t)nv * sizeof *s->x);
  memset(s->hold, 0, (size_t)s->m * sizeof *s->hold);
  for (int pass = 0; pass < (s->m > 0 ? PASSES : 1); pass++) {
    for (int i = 0; i < nv; i++) s->moved[i] = s->free[i] - s->x[i];
    if (pass > 0) {
      cav_impulse_inertia(p, s->moved, s->missing);
    } else {
      memset(s->missing, 0, (size_t)nv * sizeof *s->missing);
    }
    for (int i = 0; i < nv; i++) s->missing[i] = -s->r[i] - s->missing[i];
    push_equalities(s, s->hold, s->missing);
    miss_equalities(s, 1.0, s->free, s->hold, s->lack);
    solve_equalities(s, s->missing, s->lack, s->free, s->hold);
  }
  cav_impulse_rows(p, s->free, s->offset);
  for (int i = 0; i < p->nrow; i++) s->offset[i] -= p->target[i];
  return CAV_OK;
}

// x := v_hat + M_hat^-1 J' f
static void take_step(gpgs *s) {
  const cav_impulse *p = &s->problem;
  memcpy(s->x, s->free, (size_t)p->nv * sizeof *s->x);
  for (int i = 0; i < s->n; i++)
    for (int k = 0; k < p->nv; k++) s->x[k] += s->f[i] * s->W[i * p->nv + k];
}

// rows of J_E M^-1, and S
static void fill_equalities(gpgs *s) {
  const cav_impulse *p = &s->problem;
  const size_t square = (size_t)s->m * (size_t)s->m;
  for (int b = p->nbound; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    for (int i = 0; i < block->dim; i++) {
      double *W = s->W + (block->first + i) * p->nv;
      cav_block_spread(block, i, p->nv, W);
      cav_ldl_solve(p->model, p->state->work, p->L, W);
    }
  }
  for (int i = 0; i < s->m; i++) {
    cav_impulse_rows(p, s->W + (s->n + i) * p->nv, s->row);
    memcpy(s->S + i * s->m, s->row + s->n, (size_t)s->m * sizeof *s->row);
    if (!s->hard) s->S[i * s->m + i] += p->R[s->n + i];
  }
  if (!s->hard) {
    cav_pseudo_inverse(s->m, 0.0, s->S, s->S + square, s->S + 2 * square);
    return;
  }
  // the limit of soft rows is least squares in their metric: A_E^+ is taken of rows over sqrt(R_E)
  double *R = p->R + s->n;
  for (int i = 0; i < s->m * s->m; i++) s->S[i] /= sqrt(R[i / s->m] * R[i % s->m]);
  cav_pseudo_inverse(s->m, RANK_TOLERANCE, s->S, s->S + square, s->S + 2 * square);
  for (int i = 0; i < s->m * s->m; i++) s->S[i] /= sqrt(R[i / s->m] * R[i % s->m]);
  memset(R, 0, (size_t)s->m * sizeof *R);
}

// one row of J M_hat^-1
static void fill_row(gpgs *s, const cav_block *block, int i, double *W) {
  const cav_impulse *p = &s->problem;
  if (s->m == 0) {
    cav_block_spread(block, i, p->nv, W);
    cav_ldl_solve(p->model, p->state->work, p->L, W);
    return;
  }
  memset(W, 0, (size_t)p->nv * sizeof *W);
  memset(s->hold, 0, (size_t)s->m * sizeof *s->hold);
  for (int pass = 0; pass < PASSES; pass++) {
    cav_block_spread(block, i, p->nv, s->missing);
    cav_impulse_inertia(p, W, s->moved);
    for (int k = 0; k < p->nv; k++) s->missing[k] -= s->moved[k];
    push_equalities(s, s->hold, s->missing);
    miss_equalities(s, 0.0, W, s->hold, s->lack);
    solve_equalities(s, s->missing, s->lack, W, s->hold);
  }
}

// A + R and the rows of J M_hat^-1
static void fill_matrices(gpgs *s) {
  const cav_impulse *p = &s->problem;
  if (s->m > 0) fill_equalities(s);
  for (int b = 0; b < p->nbound; b++) {
    const cav_block *block = &p->block[b];
    for (int i = 0; i < block->dim; i++) fill_row(s, block, i, s->W + (block->first + i) * p->nv);
  }
  for (int i = 0; i < s->n; i++) {
    cav_impulse_rows(p, s->W + i * p->nv, s->row);
    memcpy(s->A + i * s->n, s->row, (size_t)s->n * sizeof *s->row);
    s->A[i * s->n + i] += p->R[i];
  }
}

// at the end: x and the impulses of equality constraints for the impulses found, without what A has lost of them
static cav_status settle(gpgs *s, const double *v, const double *u) {
  const cav_impulse *p = &s->problem;
  memset(s->hold, 0, (size_t)s->m * sizeof *s->hold);
  for (int pass = 0; pass < PASSES; pass++) {
    const cav_status status = cav_impulse_smooth(p, v, u, s->x, s->r);
    if (status != CAV_OK) return status;
    for (int k = 0; k < p->nv; k++) s->missing[k] = -s->r[k];
    memset(s->f + s->n, 0, (size_t)s->m * sizeof *s->f);
    cav_impulse_push(p, 1.0, s->f, s->missing);
    push_equalities(s, s->hold, s->missing);
    miss_equalities(s, 1.0, s->x, s->hold, s->lack);
    solve_equalities(s, s->missing, s->lack, s->x, s->hold);
  }
  return CAV_OK;
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
  for (int b = 0, next = 0; b < p->nbound; b++) {
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
  if (p->nbound > work->memory_room) {
    cav_memory *larger = realloc(work->memory, 2 * (size_t)p->nbound * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    work->memory = larger;
    work->memory_room = 2 * p->nbound;
  }
  work->nmemory = p->nbound;
  for (int b = 0; b < p->nbound; b++) {
    work->memory[b] = identify(p, &p->block[b]);
    memcpy(work->memory[b].f, s->f + p->block[b].first, (size_t)p->block[b].dim * sizeof *s->f);
  }
  return CAV_OK;
}

// by how much Coulomb's law lowers the normal target of a contact: |mu w_t|, w = R f + y - v*
static double lowered(const gpgs *s, const cav_block *block, const double *y, const double *f) {
  const cav_impulse *p = &s->problem;
  if (block->contact < 0 || p->state->options.sliding == CAV_SLIDING_CONVEX) return 0.0;
  double square = 0.0;
  for (int j = 1; j < block->dim; j++) {
    const int i = block->first + j;
    const double w = p->R[i] * f[i] + y[i] - p->target[i], mu = p->state->contact[block->contact].friction[j - 1];
    square += mu * mu * w * w;
  }
  return sqrt(square);
}

// duality gap: that of Fenchel and Young for each object, f against its best reply f_i to the velocity it causes,
// (f_i - f)' R (g - (f_i + f)/2). mismatch |f - f_i|
static void fill_report(gpgs *s, cav_forward_report *report) {
  const cav_impulse *p = &s->problem;
  double *y = s->was, *found = s->found, square = 0.0, gap = 0.0;
  cav_impulse_rows(p, s->x, y);
  for (int b = 0; b < p->nbound; b++) {
    const cav_block *block = &p->block[b];
    cav_impulse_law(p, block, y, found, NULL, NULL);
    for (int i = block->first; i < block->first + block->dim; i++) {
      const double off = found[i] - s->f[i];
      square += off * off;
      gap += off * (p->target[i] - y[i] - 0.5 * p->R[i] * (found[i] + s->f[i]));
      if (i == block->first) gap -= off * lowered(s, block, y, found);
    }
  }
  report->gap = gap;
  report->mismatch = sqrt(square);
}

// hard constraints: what is missing of the balance of forces, relative; impulses into the state
static cav_status fill_hard_report(gpgs *s, const double *v, const double *u, cav_forward_report *report) {
  const cav_impulse *p = &s->problem;
  const double rate = 1.0 / p->state->options.timestep;
  const cav_status status = cav_impulse_smooth(p, v, u, s->x, s->r);
  if (status != CAV_OK) return status;
  memcpy(s->f + s->n, s->hold, (size_t)s->m * sizeof *s->hold);
  double error = 0.0, scale = 0.0;
  for (int i = 0; i < p->nv; i++) scale = fmax(scale, fmax(fabs(u[i]), fabs(rate * s->r[i])));
  cav_impulse_push(p, -1.0, s->f, s->r);
  for (int i = 0; i < p->nv; i++) error = fmax(error, fabs(rate * s->r[i]));
  report->residual = error > 0.0 ? error / scale : 0.0;
  for (int b = p->nbound; b < p->nblock; b++) {
    cav_equality_rows *eq = &p->state->equality[p->block[b].equality];
    memcpy(eq->impulse, s->f + p->block[b].first, (size_t)eq->dim * sizeof *s->f);
  }
  return CAV_OK;
}

static cav_status prepare(gpgs *s, const cav_model *model, cav_state *state, const double *q, const double *v) {
  cav_impulse *p = &s->problem;
  if (cav_looks_ahead(&state->options)) return CAV_NOT_SUPPORTED;
  // S and its scratch are as large as A where all rows are of equality constraints
  const size_t squares = model->nequality ? 3 : 1;
  const cav_impulse_room room = {.per_row = 7, .per_row_squared = squares, .per_row_and_dof = 1, .per_dof = 5};
  const cav_status status = cav_impulse_new(model, state, q, v, &room, p);
  if (status != CAV_OK) return status;
  if (p->nspring > 0) return CAV_NOT_SUPPORTED;
  const size_t rows = (size_t)p->nrow, nv = (size_t)model->nv;
  s->n = p->nbound_row;
  s->m = p->nrow - s->n;
  s->S = p->spare;
  s->A = s->S + 3 * (size_t)s->m * (size_t)s->m;
  s->W = s->A + (size_t)s->n * (size_t)s->n;
  s->offset = s->W + rows * nv;
  s->f = s->offset + rows;
  s->was = s->f + rows;
  s->found = s->was + rows;
  s->free = s->found + rows;
  s->x = s->free + nv;
  s->r = s->x + nv;
  s->row = s->r + nv;
  s->hold = s->row + rows;
  s->lack = s->hold + rows;
  s->missing = s->lack + rows;
  s->moved = s->missing + nv;
  assert(s->moved + nv <= p->spare + p->nspare);
  for (int b = 0; b < p->nbound; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact >= 0 ? state->contact[block->contact].sigma > 0.0 : state->row[block->row].sigma > 0.0)
      return CAV_NOT_SUPPORTED;
  }
  return CAV_OK;
}

static cav_status solve(const cav_model *model, cav_state *state, const double *q, const double *v, const double *u,
                        int hard, int iterations, double tolerance, double *v_next, cav_forward_report *report) {
  if (iterations < 0 || !(tolerance >= 0.0)) return CAV_BAD_INPUT;
  if (!all_finite(u, model->nv) || !all_finite(v, model->nv)) return CAV_NOT_FINITE;
  gpgs s = {.hard = hard};
  cav_status status = prepare(&s, model, state, q, v);
  if (status != CAV_OK) return status;
  fill_matrices(&s);
  recall(&s);
  memcpy(s.x, v, (size_t)model->nv * sizeof *v);
  status = take_smooth(&s, v, u);
  if (status != CAV_OK) return status;
  take_step(&s);

  // sweeps; at the mean velocity the smooth forces follow
  const int mean = cav_takes_mean(state);
  int count = 0, converged = s.n == 0 && !mean;
  while (!converged && count < iterations) {
    if (mean && (status = take_smooth(&s, v, u)) != CAV_OK) return status;
    const double change = sweep(&s);
    memcpy(s.r, s.x, (size_t)model->nv * sizeof *s.r);
    take_step(&s);
    double moved = 0.0, size = 0.0;
    for (int i = 0; mean && i < model->nv; i++) {
      moved = fmax(moved, fabs(s.x[i] - s.r[i]));
      size = fmax(size, fabs(s.x[i]));
    }
    converged = change <= tolerance && moved <= tolerance * size;
    count++;
  }
  if (s.m > 0 && (status = settle(&s, v, u)) != CAV_OK) return status;
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
  if (s.hard && s.m > 0 && (status = fill_hard_report(&s, v, u, &mine)) != CAV_OK) return status;
  memcpy(v_next, s.x, (size_t)model->nv * sizeof *v_next);
  if (report) *report = mine;
  return converged ? CAV_OK : CAV_NOT_CONVERGED;
}

cav_status cav_forward_gpgs(const cav_model *model, cav_state *state, const double *q, const double *v, const double *u,
                            int iterations, double tolerance, double *v_next, cav_forward_report *report) {
  return solve(model, state, q, v, u, 0, iterations, tolerance, v_next, report);
}

cav_status cav_forward_hard(const cav_model *model, cav_state *state, const double *q, const double *v, const double *u,
                            int iterations, double tolerance, double *v_next, cav_forward_report *report) {
  return solve(model, state, q, v, u, 1, iterations, tolerance, v_next, report);
}
