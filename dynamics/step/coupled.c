/// What needs A = J M_hat^-1 J' itself at q (Todorov 2014, section V): R by its true diagonal, and dense B and K.
///
/// Exact diagonal: every R is the one by reference weights times (true diagonal / reference weight), so (27) holds with
/// the true A_ii; friction rows go with their normal row, which keeps (22). Equality constraints take the diagonal of
/// J_E M^-1 J_E', as M_hat depends on their R; the rest that of J M_hat^-1 J'. r_min is a millionth of the reference: a
/// row that nothing can move stays finite.
///
/// Coupled rows: B = (I + R A^+) 2/kappa, K = (I + R A^+)/kappa^2 solve A R^-1 B = (2/kappa)(I + A R^-1) and its like,
/// which makes all rows together critically damped: x'' + (2/kappa) x' + x/kappa^2 = (I + A R^-1)^-1 a where the rows
/// hold (not those that pull away, not friction at its bound). A takes all rows of the state, equality constraints
/// among them, by M. A^+ is a generalised inverse, of A scaled to a unit diagonal. The diagonal law's h B and h K hold
/// a factor 1 + epsilon for this coupling with the row itself; it is taken out first, so both laws are one where A is
/// diagonal.
#include <stdlib.h>

#include <assert.h>

#include "algebra.h"
#include "impulse.h"
#include "math3.h"

static const double LEAST = 1e-6, RANK = 1e-9;

/// All rows at one q.
typedef struct rows {
  cav_impulse p;   ///< of which only blocks and counts are used
  int n, m;        ///< rows of bounded objects and of equality constraints
  double *W;       ///< [(n+m)*nv] rows of J M^-1
  double *row;     ///< [n+m]
  double *S;       ///< [m*m] (A_E + R_E)^-1
  double *scratch; ///< [2 (n+m)^2]
} rows;

// blocks of the Jacobian and W
static cav_status fill(rows *r, const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  const size_t nv = (size_t)model->nv, nblock = (size_t)(state->ncontact + state->nrow + state->nequality);
  const size_t nrow = (size_t)cav_jacobian_rows(state), m = (size_t)cav_equality_row_count(state);
  const size_t doubles = 2 * nrow * nv + nrow + m * m + 2 * nrow * nrow;
  const size_t bytes = doubles * sizeof(double) + nblock * (sizeof(cav_block) + nv * sizeof(int));
  double *J = cav_solver_room(w, bytes);
  if (!J) return CAV_NO_MEMORY;
  r->W = J + nrow * nv;
  r->row = r->W + nrow * nv;
  r->S = r->row + nrow;
  r->scratch = r->S + m * m;
  r->p = (cav_impulse){.model = model, .state = state, .nv = model->nv, .nblock = (int)nblock, .nrow = (int)nrow};
  r->p.block = (cav_block *)(r->scratch + 2 * nrow * nrow);
  r->p.nbound = state->ncontact + state->nrow;
  r->m = (int)m;
  r->n = (int)(nrow - m);
  int *dof = (int *)(r->p.block + nblock);
  assert((char *)(dof + nblock * nv) == (char *)J + bytes);
  const int rows_laid = cav_jacobian(model, state, r->p.block, dof, J);
  assert(rows_laid == r->p.nrow);
  (void)rows_laid;
  cav_step_inertia(model, state, w->M);
  if (!cav_ldl_factor(model, w, w->M, w->L)) return CAV_BAD_INPUT;
  for (int b = 0; b < r->p.nblock; b++) {
    const cav_block *block = &r->p.block[b];
    for (int i = 0; i < block->dim; i++) {
      double *W = r->W + (block->first + i) * model->nv;
      cav_block_spread(block, i, model->nv, W);
      cav_ldl_solve(model, w, w->L, W);
    }
  }
  return CAV_OK;
}

// row i of A by M, into r->row
static const double *row_of(rows *r, int i) {
  cav_impulse_rows(&r->p, r->W + i * r->p.nv, r->row);
  return r->row;
}

// reference weight that the R of an object's row k was made with
static double reference(const cav_state *state, const cav_block *block, int k) {
  const cav_model *model = state->model;
  if (block->contact >= 0) return model->pair[state->contact[block->contact].pair].weight[0];
  if (block->equality >= 0) return model->equality[state->equality[block->equality].equality].weight[k > 2];
  const cav_row *row = &state->row[block->row];
  switch (row->type) {
    case CAV_ROW_LIMIT_JOINT:
      return model->dof[model->joint[row->object].dof].inverse_weight;
    case CAV_ROW_FRICTION_DOF:
      return model->dof[row->object].inverse_weight;
    default:
      return model->tendon[row->object].inverse_weight;
  }
}

// --- exact diagonal ---

// R and, for sigma = h K delta/sqrt(R), the smoothing of one object by the diagonal of its first row
static void scale_bounded(cav_state *state, const cav_block *block, double factor) {
  if (block->contact >= 0) {
    cav_contact *c = &state->contact[block->contact];
    for (int k = 0; k < c->dim; k++) c->regulariser[k] *= factor;
    c->sigma /= sqrt(factor);
  } else {
    state->row[block->row].regulariser *= factor;
    state->row[block->row].sigma /= sqrt(factor);
  }
}

static double factor_of(const cav_state *state, const cav_block *block, int k, double diagonal) {
  return fmax(LEAST, diagonal / reference(state, block, k));
}

static void take_diagonal(rows *r) {
  cav_state *state = r->p.state;
  // equality constraints first: M_hat is made of their R
  for (int b = r->p.nbound; b < r->p.nblock; b++) {
    const cav_block *block = &r->p.block[b];
    cav_equality_rows *eq = &state->equality[block->equality];
    for (int k = 0; k < block->dim; k++) {
      const double *A = row_of(r, block->first + k);
      memcpy(r->S + (block->first + k - r->n) * r->m, A + r->n, (size_t)r->m * sizeof *A);
      eq->regulariser[k] *= factor_of(state, block, k, A[block->first + k]);
      r->S[(block->first + k - r->n) * (r->m + 1)] += eq->regulariser[k];
    }
  }
  if (r->m > 0) cav_pseudo_inverse(r->m, 0, r->S, r->scratch, r->scratch + r->m * r->m);
  for (int b = 0; b < r->p.nbound; b++) {
    const cav_block *block = &r->p.block[b];
    const double *A = row_of(r, block->first), *E = A + r->n;
    double diagonal = A[block->first];
    for (int i = 0; i < r->m; i++) diagonal -= E[i] * dot(r->S + i * r->m, E, r->m);
    scale_bounded(state, block, factor_of(state, block, 0, diagonal));
  }
}

// --- coupled rows ---

// room for n rows in the workspace
static cav_status coupling_room(cav_workspace *w, size_t n) {
  if (n * n + 2 * n > w->coupling_room) {
    double *larger = malloc((n * n + 2 * n) * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    free(w->coupling);
    w->coupling = larger;
    w->coupling_room = n * n + 2 * n;
  }
  w->target = w->coupling + n * n;
  return CAV_OK;
}

static double regulariser_of(const cav_state *state, const cav_block *block, int k) {
  if (block->contact >= 0) return state->contact[block->contact].regulariser[k];
  if (block->equality >= 0) return state->equality[block->equality].regulariser[k];
  return state->row[block->row].regulariser;
}

// by how much more than by its softness an object's R was raised
static double eased(const cav_state *state, const cav_block *block) {
  double rate;
  return block->contact < 0 ? 1 : 1 / cav_contact_stiffness_ratio(state, &state->contact[block->contact], &rate);
}

// (I + R A^+) diag(1/(1 + epsilon)); epsilon = R/weight of a block's first row is the one that h B and h K were made
// with. exact says that the weights are the true diagonal
static cav_status fill_coupling(rows *r, int exact) {
  cav_state *state = r->p.state;
  cav_workspace *w = state->work;
  const int n = r->p.nrow;
  const cav_status status = coupling_room(w, (size_t)n);
  if (status != CAV_OK) return status;
  double *G = w->coupling, *root = w->target + n;
  for (int i = 0; i < n; i++) memcpy(G + i * n, row_of(r, i), (size_t)n * sizeof *G);
  for (int i = 0; i < n; i++) root[i] = G[i * (n + 1)] > 0 ? 1 / sqrt(G[i * (n + 1)]) : 0;
  double *damped = r->row;
  for (int b = 0; b < r->p.nblock; b++) {
    const cav_block *block = &r->p.block[b];
    for (int k = 0; k < block->dim; k++) {
      const int i = block->first + (block->equality >= 0 ? k : 0);
      const double R = regulariser_of(state, block, i - block->first);
      const double constant = reference(state, block, i - block->first);
      const double weight = eased(state, block) * (exact ? fmax(LEAST * constant, G[i * (n + 1)]) : constant);
      damped[block->first + k] = weight / (weight + R);
    }
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) G[i * n + j] *= root[i] * root[j];
  cav_pseudo_inverse(n, RANK, G, r->scratch, r->scratch + n * n);
  for (int b = 0; b < r->p.nblock; b++) {
    const cav_block *block = &r->p.block[b];
    for (int k = 0; k < block->dim; k++) {
      const int i = block->first + k;
      const double R = regulariser_of(state, block, k);
      for (int j = 0; j < n; j++) G[i * n + j] = ((i == j) + R * root[i] * root[j] * G[i * n + j]) * damped[j];
    }
  }
  w->first_equality = r->n;
  w->first_row = r->n - state->nrow;
  return CAV_OK;
}

void cav_coupled_targets(cav_state *state) {
  const cav_workspace *w = state->work;
  const int n = cav_jacobian_rows(state);
  if (n == 0) return;
  double *rate = w->target + n, *out = w->target;
  const double stops = cav_friction_stops(state);
  int i = 0;
  // h B x' + h K x by the diagonal law, x' into out
  for (int c = 0; c < state->ncontact; c++) {
    const cav_contact *contact = &state->contact[c];
    for (int k = 0; k < contact->dim; k++, i++) {
      const double v = contact->velocity[k], more = k ? stops : 0;
      out[i] = (1 - more) * v;
      rate[i] = (contact->damping[k] - more) * v + (k ? 0 : contact->stiffness * (contact->dist - contact->margin));
    }
  }
  for (int k = 0; k < state->nrow; k++, i++) {
    const cav_row *row = &state->row[k];
    const double more = row->bound > 0 ? stops : 0;
    out[i] = (1 - more) * row->velocity;
    rate[i] = (row->damping - more) * row->velocity + row->stiffness * (row->dist - row->margin);
  }
  for (int t = 0; t < state->nequality; t++) {
    const cav_equality_rows *eq = &state->equality[t];
    for (int k = 0; k < eq->dim; k++, i++) {
      rate[i] = eq->damping * eq->velocity[k] + eq->stiffness * eq->error[k];
      out[i] = eq->velocity[k] - state->options.timestep * eq->bias[k];
    }
  }
  for (int k = 0; k < n; k++) out[k] -= dot(w->coupling + k * n, rate, n);
}

cav_status cav_coupled_prepare(const cav_model *model, cav_state *state) {
  if (cav_jacobian_rows(state) == 0) return CAV_OK;
  const int exact = state->options.regulariser == CAV_REGULARISER_EXACT;
  rows r;
  const cav_status status = fill(&r, model, state);
  if (status != CAV_OK) return status;
  if (exact) take_diagonal(&r);
  return state->options.coupled ? fill_coupling(&r, exact) : CAV_OK;
}
