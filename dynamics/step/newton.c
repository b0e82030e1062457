/// Newton's iteration on the inverse itself (forward.c): measures it, takes the derivative of its smooth part and of the
/// constraints, and goes on where the error falls; where it does not, convex problems with what is not convex held.
#include <assert.h>
#include <float.h>

#include "algebra.h"
#include "math3.h"
#include "newton.h"
#include "proximal.h"

enum { BLOCK = CAV_CURVATURE, STALLS = 4, CHANGES = 30, POLISH = 2, FEW = 2 };

static const double SHORTEST_STEP = 0.02, RUNAWAY = 1e3;

int cav_newton_is_convex(const cav_state *state) {
  return !cav_takes_mean(state) && state->options.sliding == CAV_SLIDING_CONVEX && !cav_looks_ahead(&state->options);
}

cav_status cav_newton_prepare(cav_newton *s, const cav_model *model, cav_state *state) {
  const size_t matrices = cav_newton_is_convex(state) ? 0 : 2, looks = cav_looks_ahead(&state->options) != 0,
               mean = cav_takes_mean(state) != 0;
  const cav_impulse_room room = {.per_block = BLOCK + 1 + CAV_PROXIMAL_PER_BLOCK + CAV_ISLAND_PER_BLOCK,
                                 .per_row = 6 + CAV_PROXIMAL_PER_ROW,
                                 .per_row_and_dof = looks,
                                 .per_dof = 9 + CAV_ISLAND_PER_DOF + mean * CAV_PATH_PER_DOF,
                                 .per_dof_squared = matrices + mean * CAV_PATH_PER_DOF_SQUARED};
  cav_workspace *work = state->work;
  if (!work->hessian && !(work->hessian = cav_hessian_new(CAV_SPARSE_FROM))) return CAV_NO_MEMORY;
  const cav_status status = cav_impulse_new(model, state, s->q, s->v, &room, &s->problem);
  if (status != CAV_OK) return status;
  const size_t nv = (size_t)model->nv, nrow = (size_t)s->problem.nrow, nblock = (size_t)s->problem.nblock;
  double **const row[] = {&s->y, &s->f, &s->derivative, &s->try_y, &s->try_f};
  double **const dof[] = {&s->x,        &s->anchor, &s->base,  &s->step, &s->momentum,
                          &s->gradient, &s->best,   &s->found, &s->ended};
  double *at = s->problem.spare;
  s->room = at;
  at += CAV_PROXIMAL_PER_ROW * nrow + CAV_PROXIMAL_PER_BLOCK * nblock;
  for (int i = 0; i < 5; i++, at += nrow) *row[i] = at;
  for (int i = 0; i < 9; i++, at += nv) *dof[i] = at;
  s->curvature = at;
  s->held = s->curvature + BLOCK * nblock;
  s->excess = s->held + nblock;
  s->problem.excess = looks ? s->excess : NULL;
  s->ahead = s->excess + nrow;
  s->matrix = s->ahead + looks * nrow * nv;
  s->smooth = s->matrix + nv * nv;
  s->path = s->matrix + matrices * nv * nv;
  double *islands = s->path + mean * (CAV_PATH_PER_DOF * nv + CAV_PATH_PER_DOF_SQUARED * nv * nv);
  assert(islands + CAV_ISLAND_PER_BLOCK * nblock + CAV_ISLAND_PER_DOF * nv == s->problem.spare + s->problem.nspare);
  cav_islands_find(&s->problem, islands, &s->islands);
  s->hessian = work->hessian;
  cav_newton_leave_island(s);
  return CAV_OK;
}

// rates of the excess of a contact's rows by the dofs of its block, at the state's last evaluation
static void fill_block_ahead(cav_newton *s, const cav_block *block) {
  const cav_impulse *p = &s->problem;
  const double rate = 1.0 / p->state->options.timestep;
  const cav_contact *contact = &p->state->contact[block->contact];
  const cav_next_contact *next = cav_contact_next(p->state, contact);
  double *to = s->ahead + (size_t)block->first * (size_t)p->nv;
  const int slip = cav_row_looks_ahead(&p->state->options, contact, 1);
  int second = cav_last_dof(p->model, contact->link2);
  memset(to, 0, (size_t)block->dim * (size_t)p->nv * sizeof *to);
  for (int k = 0; k < block->ndof; k++) {
    // dofs from the leaves: of the second link, or of the first
    const int dof = block->dof[k];
    const double sign = dof == second ? 1.0 : -1.0;
    double there[3][2];
    cav_next_contact_rates(p->model, p->state, block->contact, dof, there);
    to[k] = rate * sign * next->by_next * there[0][1] + next->by_linear * block->J[k];
    for (int i = 1; i < 3 && slip; i++) to[i * p->nv + k] = rate * sign * there[i][1] - block->J[i * block->ndof + k];
    if (dof == second) second = p->model->dof[dof].parent;
  }
}

static void fill_ahead(cav_newton *s) {
  cav_next_contacts_differentiate(s->problem.model, s->problem.state);
  for (int b = 0; b < s->problem.nblock; b++)
    if (s->problem.block[b].contact >= 0) fill_block_ahead(s, &s->problem.block[b]);
}

void cav_newton_add_constraints(cav_newton *s) {
  const int nv = s->problem.nv;
  for (int b = 0; b < s->problem.nblock; b++) {
    const cav_block *block = &s->problem.block[b];
    const double *H = s->curvature + BLOCK * b, *J = block->J;
    const double *ahead =
        s->problem.excess && !s->frozen && block->contact >= 0 ? s->ahead + (size_t)block->first * (size_t)nv : NULL;
    const int n = block->ndof, dim = block->dim;
    if (largest(H, dim * dim) == 0.0) continue;
    for (int i = 0; i < n; i++) {
      double bent[CAV_IMPULSE_DIM] = {0.0}, *to = s->matrix + block->dof[i] * nv;
      for (int k = 0; k < dim; k++)
        for (int l = 0; l < dim; l++) bent[k] += H[l * dim + k] * J[l * n + i];
      for (int j = 0; j < n; j++) {
        double sum = 0.0;
        for (int k = 0; k < dim; k++) sum += bent[k] * J[k * n + j];
        for (int k = 0; k < dim && k < 3 && ahead; k++) sum += bent[k] * ahead[k * nv + j];
        to[block->dof[j]] += sum;
      }
    }
  }
}

// largest error of the generalised force that rounding causes where it was measured: of x through inertia and stiff
// constraints, and of the largest forces
static double rounding(cav_newton *s) {
  const cav_impulse *p = &s->problem;
  if (s->rounding >= 0.0) return s->rounding;
  cav_impulse_rows(p, s->x, s->y);
  cav_newton_laws(s, s->y, s->f, s->curvature, 0);
  // two momenta, each at poses that are rounded, or one change of velocity
  const double terms = p->state->options.order == CAV_ORDER_MOMENTUM ? 4.0 : 1.0;
  s->rounding = cav_newton_momentum_rounding(s, terms, s->gradient) / p->state->options.timestep +
                8.0 * DBL_EPSILON * (s->scale + DBL_MIN / p->state->options.timestep);
  return s->rounding;
}

void cav_newton_fill_inertia(const cav_impulse *p, double *matrix) {
  const cav_workspace *work = p->state->work;
  memset(matrix, 0, (size_t)p->nv * (size_t)p->nv * sizeof *matrix);
  for (int i = 0; i < p->nv; i++) {
    const double *M = p->M + work->row[i];
    for (int j = i, k = 0; j >= 0; j = work->parent[j], k++) matrix[i * p->nv + j] = matrix[j * p->nv + i] = M[k];
  }
}

cav_status cav_newton_differentiate_smooth(cav_newton *s) {
  const int nv = s->problem.nv;
  if (!cav_takes_mean(s->problem.state)) {
    cav_newton_fill_inertia(&s->problem, s->smooth);
    s->have_smooth = 1;
    return CAV_OK;
  }
  cav_status status = cav_impulse_smooth(&s->problem, s->v, s->u, s->x, s->base);
  for (int j = 0; j < nv && status == CAV_OK; j++) {
    const double kept = s->x[j], step = 1e-5 * fmax(1.0, fabs(kept));
    s->x[j] = kept + step;
    const double taken = s->x[j] - kept;
    status = cav_impulse_smooth(&s->problem, s->v, s->u, s->x, s->gradient);
    s->x[j] = kept;
    for (int i = 0; i < nv; i++) s->smooth[i * nv + j] = (s->gradient[i] - s->base[i]) / taken;
  }
  s->have_smooth = status == CAV_OK;
  return status;
}

// exchanges rows k and l of A up to column k, and entries of b
static void exchange_rows(int n, double *A, double *b, int k, int l) {
  for (int j = 0; j <= k; j++) {
    const double held = A[k * n + j];
    A[k * n + j] = A[l * n + j];
    A[l * n + j] = held;
  }
  const double held = b[k];
  b[k] = b[l];
  b[l] = held;
}

int cav_newton_solve_general(int n, double *A, double *b, int *found) {
  int *row = found, *column = found + n, sign = 1;
  for (int k = n - 1; k >= 0; k--) {
    int pivot = k, nrow = 0, ncolumn = 0;
    for (int i = 0; i < k; i++) {
      if (A[i * n + k] == 0.0) continue;
      row[nrow++] = i;
      if (fabs(A[i * n + k]) > fabs(A[pivot * n + k])) pivot = i;
    }
    if (!(fabs(A[pivot * n + k]) > 0.0)) return 0;
    const int exchanges = fabs(A[k * n + k]) < 0.1 * fabs(A[pivot * n + k]);
    if (exchanges) exchange_rows(n, A, b, k, pivot);
    if (exchanges != (A[k * n + k] < 0.0)) sign = -sign;
    for (int j = 0; j < k; j++)
      if (A[k * n + j] != 0.0) column[ncolumn++] = j;
    for (int r = 0; r < nrow; r++) {
      double *Ai = A + row[r] * n;
      const double ratio = Ai[k] / A[k * n + k];
      for (int e = 0; e < ncolumn; e++) Ai[column[e]] -= ratio * A[k * n + column[e]];
      b[row[r]] -= ratio * b[k];
    }
  }
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < i; j++) b[i] -= A[i * n + j] * b[j];
    b[i] /= A[i * n + i];
  }
  return all_finite(b, n) ? sign : 0;
}

// measures the inverse at x with the problem's own rows in the place of the state's
static cav_status measure_raised(cav_newton *s) {
  const cav_impulse *p = &s->problem;
  const double h = p->state->options.timestep;
  const cav_status status = cav_impulse_smooth(p, s->v, s->u, s->x, s->found);
  cav_impulse_rows(p, s->x, s->y);
  cav_newton_laws(s, s->y, s->f, NULL, 0);
  cav_impulse_push(p, -1.0, s->f, s->found);
  for (int i = 0; i < p->nv; i++) p->change[i] = s->x[i] - s->v[i];
  cav_impulse_inertia(p, p->change, p->force);
  s->scale = fmax(largest(s->u, p->nv), largest(p->force, p->nv) / h);
  memset(p->force, 0, (size_t)p->nv * sizeof *p->force);
  cav_impulse_push(p, 1.0 / h, s->f, p->force);
  s->scale = fmax(s->scale, largest(p->force, p->nv));
  s->error = largest(s->found, p->nv) / h;
  for (int i = 0; i < p->nv; i++) s->found[i] = s->u[i] + s->found[i] / h;
  return status;
}

cav_status cav_newton_measure(cav_newton *s) {
  const cav_impulse *p = &s->problem;
  s->rounding = -1.0;
  if (s->raised && !p->excess) return measure_raised(s);
  const cav_status status = cav_impulse_check(p, s->q, s->v, s->u, s->x, s->found, s->f, &s->error, &s->scale);
  if (!p->excess || status != CAV_OK) return status;
  memset(s->excess, 0, s->frozen ? 0 : (size_t)p->nrow * sizeof *s->excess);
  for (int b = 0; b < p->nblock && !s->frozen; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact < 0) continue;
    const cav_next_contact *next = cav_contact_next(p->state, &p->state->contact[block->contact]);
    for (int i = 0; i < block->dim && i < 3; i++) s->excess[block->first + i] = next->excess[i];
  }
  if (s->raised) return measure_raised(s);
  if (!s->frozen) return CAV_OK;
  cav_impulse_rows(p, s->x, s->y);
  cav_newton_laws(s, s->y, s->try_f, NULL, 0);
  for (int i = 0; i < p->nrow; i++) s->f[i] -= s->try_f[i];
  cav_impulse_push(p, 1.0 / p->state->options.timestep, s->f, s->found);
  copy(s->f, s->try_f, p->nrow);
  s->error = 0.0;
  for (int i = 0; i < p->nv; i++) s->error = fmax(s->error, fabs(s->found[i] - s->u[i]));
  return CAV_OK;
}

double cav_newton_residual(const cav_newton *s) { return s->error > 0.0 ? s->error / fmin(s->scale, s->most) : 0.0; }

void cav_newton_bound_forces(cav_newton *s) {
  const cav_impulse *p = &s->problem;
  cav_impulse_inertia(p, s->v, p->force);
  s->most = RUNAWAY * fmax(s->scale, largest(p->force, p->nv) / p->state->options.timestep);
}

// one Newton step on the inverse itself, smooth derivative included, from a point just measured; shortened until the
// error falls. accepted tells whether it did; x is measured afterwards in either case
static cav_status newton_step(cav_newton *s, int *accepted) {
  const int nv = s->problem.nv;
  const double before = cav_newton_residual(s);
  *accepted = 0;
  copy(s->momentum, s->found, nv);
  if (s->problem.excess && !s->frozen) fill_ahead(s);
  if (!s->have_smooth) {
    const cav_status status = cav_newton_differentiate_smooth(s);
    if (status != CAV_OK) return status;
  }
  cav_impulse_rows(&s->problem, s->x, s->y);
  cav_newton_laws(s, s->y, s->f, s->curvature, 0);
  copy(s->matrix, s->smooth, nv * nv);
  cav_newton_add_constraints(s);
  for (int i = 0; i < nv; i++) s->step[i] = s->problem.state->options.timestep * (s->u[i] - s->momentum[i]);
  s->iterations++;
  s->sign = cav_newton_solve_general(nv, s->matrix, s->step, (int *)s->momentum);
  if (s->sign == 0) return CAV_OK;
  copy(s->anchor, s->x, nv);
  for (double length = 1.0; length > SHORTEST_STEP; length *= 0.5) {
    for (int i = 0; i < nv; i++) s->x[i] = s->anchor[i] + length * s->step[i];
    const cav_status status = cav_newton_measure(s);
    // a derivative that served badly is taken anew next time, unless what is left is rounding
    if (length == 1.0 && cav_newton_residual(s) > 0.02 * before && s->error > rounding(s)) s->have_smooth = 0;
    *accepted = status == CAV_OK && cav_newton_residual(s) <= (1.0 - 0.5 * length) * before;
    if (*accepted) return CAV_OK;
  }
  copy(s->x, s->anchor, nv);
  return cav_newton_measure(s);
}

// error of v_next relative to its largest entry that the error of u stands for, if constraints did not hold it back: a
// force small against the largest may still move a light link
static double velocity_error(cav_newton *s) {
  const cav_impulse *p = &s->problem;
  for (int i = 0; i < p->nv; i++) s->gradient[i] = p->state->options.timestep * (s->found[i] - s->u[i]);
  cav_ldl_solve(p->model, p->state->work, p->L, s->gradient);
  const double error = largest(s->gradient, p->nv);
  return error > 0.0 ? error / largest(s->x, p->nv) : 0.0;
}

// towards the law from x by convex problems in which what is not convex is held: the bounds of friction (Tresca's
// friction), from the impulses of the one before, half way from the second on; gaps after the step beyond the linear
// ones. Their fixed point is the law
static cav_status solve_held(cav_newton *s, int count, double tolerance) {
  cav_impulse *p = &s->problem;
  const int coulomb = p->state->options.sliding == CAV_SLIDING_COULOMB;
  cav_status status = CAV_OK;
  for (int k = 0; k < count && status == CAV_OK && s->iterations < s->limit; k++) {
    if (k > 0 && p->excess) status = cav_newton_measure(s);
    if (status != CAV_OK) break;
    cav_impulse_rows(p, s->x, s->y);
    cav_newton_laws(s, s->y, s->f, NULL, 0);
    for (int b = 0; b < p->nblock; b++) {
      const double f = s->f[p->block[b].first];
      s->held[b] = k > 0 ? 0.5 * (s->held[b] + f) : f;
    }
    p->held = coulomb ? s->held : NULL;
    status = cav_newton_descend(s, tolerance);
    p->held = NULL;
    cav_newton_leave_island(s);
  }
  return status;
}

cav_status cav_newton_first(cav_newton *s, int friction, double tolerance) {
  cav_impulse *p = &s->problem;
  const double *excess = p->excess;
  for (int b = 0; b < p->nblock && !friction; b++) s->held[b] = 0.0;
  p->convex = friction;
  p->held = friction ? NULL : s->held;
  p->excess = NULL;
  const cav_status status = cav_newton_descend(s, tolerance);
  p->convex = 0;
  p->held = NULL;
  p->excess = excess;
  cav_newton_leave_island(s);
  return status;
}

cav_status cav_newton_iterate(cav_newton *s, int go_on, double tolerance) {
  const int nv = s->problem.nv, convex = cav_newton_is_convex(s->problem.state);
  const int coulomb = s->problem.state->options.sliding == CAV_SLIDING_COULOMB, changes = coulomb || s->problem.excess;
  // bounds of friction or gaps that change need not lower the error at once
  const int patience = changes ? CHANGES : STALLS;
  double least = INFINITY, least_error = INFINITY;
  int stalls = 0, accepted = 0, polished = 0, held = 1, at_best = 0;
  if (!go_on) copy(s->x, s->begin ? s->begin : s->v, nv);
  for (int pass = go_on;; pass++) {
    if (!accepted) {
      const cav_status status = cav_newton_measure(s);
      if (status != CAV_OK) return status;
    }
    if (pass == 1 && !go_on && cav_takes_mean(s->problem.state)) cav_newton_bound_forces(s);
    stalls = cav_newton_residual(s) < 0.99 * least ? 0 : stalls + 1;
    at_best = cav_newton_residual(s) < least;
    if (at_best) {
      least = cav_newton_residual(s);
      least_error = s->error;
      copy(s->best, s->x, nv);
    }
    if (least <= tolerance && (polished++ == POLISH || velocity_error(s) <= 10.0 * tolerance)) break;
    // one solve of a system as badly conditioned as a long chain is not at rounding yet
    if (pass > (s->problem.nblock == 0) && s->error <= rounding(s)) {
      // where no force is larger than the error, the least residual is not the least error
      if (s->error < least_error) {
        copy(s->best, s->x, nv);
        at_best = 1;
      }
      break;
    }
    if (stalls >= patience || s->iterations >= s->limit) break;
    // gaps that move with x are better followed
    if (s->problem.excess && !s->frozen && !go_on && held > FEW) break;
    accepted = 0;
    cav_status status = CAV_OK;
    if (!convex && pass > 0) status = newton_step(s, &accepted);
    if (status == CAV_OK && !accepted) {
      const double aim = !convex && pass == 0 ? 1e-2 : 0.1 * tolerance;
      if (changes && pass > 0)
        status = coulomb && held == 2 ? cav_newton_first(s, 0, aim) : solve_held(s, held, aim);
      else
        status = cav_newton_first(s, 1, aim);
      if (pass > 0 && held < CHANGES) held *= 2;
    }
    // held problems may run away where their fixed point repels
    at_best = 0;
    if (status == CAV_NOT_FINITE && pass > 0) break;
    if (status != CAV_OK) return status;
  }
  if (!at_best) {
    copy(s->x, s->best, nv);
    const cav_status status = cav_newton_measure(s);
    if (status != CAV_OK) return status;
  }
  if (s->scale > s->most) return CAV_NOT_CONVERGED;
  return cav_newton_residual(s) <= tolerance || s->error <= 4.0 * rounding(s) ? CAV_OK : CAV_NOT_CONVERGED;
}
