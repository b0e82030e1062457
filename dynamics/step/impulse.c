/// Writes out the impulse problem (9) of Todorov 2014 at one (q, v): inertia with its factors, Jacobian blocks, targets
/// v* and regularisers R, and the operations on them that both forward solvers use. Everything it needs of the
/// constraints comes from the state after an inverse at v_next = v, so forward and inverse cannot disagree about them.
/// Solves nothing: forward.c, gpgs.c.
#include "impulse.h"
#include "algebra.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "math3.h"

enum { DIM_MAX = CAV_IMPULSE_DIM };

void *cav_solver_room(cav_workspace *work, size_t bytes) {
  if (bytes > work->solver_bytes) {
    void *larger = malloc(bytes + bytes / 2);
    if (!larger) return NULL;
    free(work->solver);
    work->solver = larger;
    work->solver_bytes = bytes + bytes / 2;
  }
  return work->solver;
}

// M with what acts implicitly, and its factors
static cav_status fill_inertia(cav_impulse *p) {
  cav_step_inertia(p->model, p->state, p->M);
  return cav_ldl_factor(p->model, p->state->work, p->M, p->L) ? CAV_OK : CAV_BAD_INPUT;
}

static int is_spring(const cav_block *block) { return block->contact < 0 && block->row < 0 && block->equality < 0; }

static int is_implicit(const cav_state *state, int tendon) {
  const cav_tendon *t = &state->model->tendon[tendon];
  return state->options.spring == CAV_SPRING_IMPLICIT && state->options.passive && t->stiffness > 0 && t->ndof > 0;
}

static int count_springs(const cav_state *state) {
  int n = 0;
  for (int i = 0; i < state->work->ntendon_spring; i++) n += is_implicit(state, state->work->tendon_spring[i]);
  return n;
}

// implicit springs as rows: impulse -h k (x + next y - now x'(v)) of the rate y after the step, x from the upper end of
// what is slack
static void add_springs(cav_impulse *p, int block, int row) {
  const cav_state *state = p->state;
  const cav_springs_ahead ahead = cav_look_along_springs(state);
  for (int i = 0; i < state->work->ntendon_spring; i++) {
    const int k = state->work->tendon_spring[i];
    if (!is_implicit(state, k)) continue;
    const cav_tendon *t = &p->model->tendon[k];
    const double stretch = state->tendon_length[k] - t->springlength[1];
    p->block[block++] = (cav_block){.contact = -1,
                                    .row = -1,
                                    .equality = -1,
                                    .spring = k,
                                    .dim = 1,
                                    .first = row,
                                    .ndof = t->ndof,
                                    .dof = p->model->tendon_dof + t->dof,
                                    .J = state->tendon_arm + t->dof};
    p->R[row] = 1.0 / (state->options.timestep * ahead.next * t->stiffness);
    p->target[row++] = (ahead.now * cav_tendon_velocity(state, k, state->work->v) - stretch) / ahead.next;
  }
}

// v* = (1 - hB) x' - hK x and R of every row
static void fill_targets(cav_impulse *p) {
  for (int b = 0; b < p->nblock - p->nspring; b++) {
    const cav_block *block = &p->block[b];
    double *target = p->target + block->first, *R = p->R + block->first;
    if (block->contact >= 0) {
      const cav_contact *c = &p->state->contact[block->contact];
      for (int i = 0; i < c->dim; i++) {
        target[i] = (1.0 - c->damping[i]) * c->velocity[i] - (i == 0 ? c->stiffness * (c->dist - c->margin) : 0.0);
        R[i] = c->regulariser[i];
      }
    } else if (block->equality >= 0) {
      const cav_equality_rows *eq = &p->state->equality[block->equality];
      for (int k = 0; k < eq->dim; k++) {
        target[k] = cav_equality_target(p->state, eq, k);
        R[k] = eq->regulariser[k];
      }
    } else {
      const cav_row *row = &p->state->row[block->row];
      const int limit = row->type == CAV_ROW_LIMIT_JOINT || row->type == CAV_ROW_LIMIT_TENDON;
      target[0] = (1.0 - row->damping) * row->velocity - (limit ? row->stiffness * (row->dist - row->margin) : 0.0);
      R[0] = row->regulariser;
    }
  }
  const double *coupled = p->state->work->target;
  const int nrow = p->nrow - p->nspring;
  if (p->state->options.coupled && nrow > 0) memcpy(p->target, coupled, (size_t)nrow * sizeof *coupled);
}

cav_status cav_impulse_new(const cav_model *model, cav_state *state, const double *q, const double *v,
                           const cav_impulse_room *room, cav_impulse *p) {
  cav_status status = cav_position(model, state, q);
  if (status != CAV_OK) return status;
  const size_t nv = (size_t)model->nv, nspring = (size_t)count_springs(state);
  const size_t nblock = (size_t)(state->ncontact + state->nrow + state->nequality) + nspring;
  const size_t nrow = (size_t)cav_jacobian_rows(state) + nspring, entries = (size_t)state->work->row[model->nv];

  // one piece of memory: doubles first, then blocks, then indices
  const size_t spare = room->per_block * nblock + room->per_row * nrow + room->per_row_squared * nrow * nrow +
                       room->per_row_and_dof * nrow * nv + room->per_dof * nv + room->per_dof_squared * nv * nv;
  const size_t doubles = 2 * nrow + nrow * nv + 2 * entries + 2 * nv + spare;
  const size_t bytes = doubles * sizeof(double) + nblock * (sizeof(cav_block) + nv * sizeof(int));
  double *at = cav_solver_room(state->work, bytes);
  if (!at) return CAV_NO_MEMORY;
  *p = (cav_impulse){.model = model, .state = state, .nv = (int)nv, .nblock = (int)nblock, .nrow = (int)nrow};
  p->nbound = state->ncontact + state->nrow;
  p->nspring = (int)nspring;
  p->nbound_row = (int)(nrow - nspring) - cav_equality_row_count(state);
  p->target = at;
  p->R = p->target + nrow;
  double *J = p->R + nrow;
  p->M = J + nrow * nv;
  p->L = p->M + entries;
  p->force = p->L + entries;
  p->change = p->force + nv;
  p->spare = p->change + nv;
  p->block = (cav_block *)(p->spare + spare);
  p->nspare = spare;
  int *dof = (int *)(p->block + nblock);
  assert((char *)(dof + nblock * nv) == (char *)at + bytes);

  // the constraints as the inverse sees them, then the matrices
  status = cav_inverse_from(model, state, CAV_STAGE_POSITION, q, v, v, state->u);
  if (status != CAV_OK) return status;
  const int rows = cav_jacobian(model, state, p->block, dof, J);
  assert(rows == p->nrow - p->nspring);
  fill_targets(p);
  if (nspring > 0) add_springs(p, (int)(nblock - nspring), rows);
  return fill_inertia(p);
}

void cav_impulse_rows(const cav_impulse *p, const double *x, double *y) {
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    for (int i = 0; i < block->dim; i++) {
      const double *J = block->J + i * block->ndof;
      double sum = 0.0;
      for (int k = 0; k < block->ndof; k++) sum += J[k] * x[block->dof[k]];
      y[block->first + i] = sum;
    }
  }
}

void cav_impulse_push(const cav_impulse *p, double s, const double *f, double *r) {
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    for (int i = 0; i < block->dim; i++) {
      const double *J = block->J + i * block->ndof, sf = s * f[block->first + i];
      if (sf == 0.0) continue;
      for (int k = 0; k < block->ndof; k++) r[block->dof[k]] += J[k] * sf;
    }
  }
}

void cav_impulse_inertia(const cav_impulse *p, const double *x, double *r) {
  for (int i = 0; i < p->nv; i++) cav_impulse_inertia_of(p, i, x, r);
}

// soft equality: f = g, whatever it is
static void equality_law(int dim, const double *R, const double *g, double *f, double *hessian, double *potential) {
  double sum = 0.0;
  for (int i = 0; i < dim; i++) {
    f[i] = g[i];
    sum += 0.5 * R[i] * g[i] * g[i];
    for (int j = 0; hessian && j < dim; j++) hessian[i * dim + j] = i == j ? 1.0 / R[i] : 0.0;
  }
  if (potential) *potential = sum;
}

// implicit spring: slack over what a tendon's is, else f = g from either end
static void spring_law(double R, double slack, double g, double *f, double *hessian, double *potential) {
  *f = g < 0.0 ? g : R * g > slack ? g - slack / R : 0.0;
  if (hessian) *hessian = *f != 0.0 || slack == 0.0 ? 1.0 / R : 0.0;
  if (potential) *potential = 0.5 * R * *f * *f;
}

void cav_impulse_law(const cav_impulse *p, const cav_block *block, const double *y, double *f, double *hessian,
                     double *potential) {
  double g[DIM_MAX];
  const double *R = p->R + block->first;
  for (int i = 0; i < block->dim; i++) g[i] = (p->target[block->first + i] - y[block->first + i]) / R[i];
  for (int i = 0; i < block->dim && p->excess; i++) g[i] -= p->excess[block->first + i] / R[i];
  f += block->first;
  if (block->contact >= 0) {
    const cav_contact *contact = &p->state->contact[block->contact];
    const int ends = cav_contact_ends(p->state, contact);
    if (p->convex || p->state->options.sliding == CAV_SLIDING_CONVEX)
      cav_law_cone(block->dim, R, contact->friction, contact->sigma, ends, g, f, hessian, potential);
    else
      cav_law_coulomb(block->dim, R, contact->friction, contact->sigma, ends,
                      p->held ? p->held + (block - p->block) : NULL, g, f, hessian, potential);
    return;
  }
  if (block->equality >= 0) {
    equality_law(block->dim, R, g, f, hessian, potential);
    return;
  }
  if (is_spring(block)) {
    const double *rest = p->model->tendon[block->spring].springlength;
    spring_law(R[0], (rest[1] - rest[0]) / cav_look_along_springs(p->state).next, g[0], f, hessian, potential);
    return;
  }
  const cav_row *row = &p->state->row[block->row];
  if (row->type == CAV_ROW_FRICTION_DOF || row->type == CAV_ROW_FRICTION_TENDON)
    cav_law_bilateral(R[0], row->sigma, row->bound, g[0], f, hessian, potential);
  else
    cav_law_unilateral(R[0], row->sigma, 0, g[0], f, hessian, potential);
}

// what an implicit spring pulls with at the state's velocities
static double spring_force(const cav_impulse *p, const cav_block *block) {
  const cav_tendon *t = &p->model->tendon[block->spring];
  return t->stiffness * cav_tendon_stretch(t, cav_tendon_spring_length(p->state, block->spring));
}

cav_status cav_impulse_smooth(const cav_impulse *p, const double *v, const double *u, const double *x, double *r) {
  cav_smooth_inverse(p->model, p->state, v, x, r);
  for (int b = 0; b < p->nblock && p->nspring > 0; b++)
    if (is_spring(&p->block[b])) cav_tendon_pull(p->state, p->block[b].spring, -spring_force(p, &p->block[b]), r);
  for (int i = 0; i < p->nv; i++) r[i] = p->state->options.timestep * (r[i] - u[i]);
  return all_finite(r, p->nv) ? CAV_OK : CAV_NOT_FINITE;
}

void cav_impulse_read(const cav_impulse *p, double *f) {
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact >= 0)
      memcpy(f + block->first, p->state->contact[block->contact].impulse, (size_t)block->dim * sizeof *f);
    else if (block->equality >= 0)
      memcpy(f + block->first, p->state->equality[block->equality].impulse, (size_t)block->dim * sizeof *f);
    else if (is_spring(block))
      f[block->first] = -p->state->options.timestep * spring_force(p, block);
    else
      f[block->first] = p->state->row[block->row].impulse;
  }
}

cav_status cav_impulse_check(const cav_impulse *p, const double *q, const double *v, const double *u, const double *x,
                             double *u_found, double *f, double *error, double *scale) {
  const cav_workspace *work = p->state->work;
  const size_t bytes = (size_t)p->nv * sizeof *x;
  // where the problem was written out the inverse is known
  if (work->valid == CAV_STAGE_VELOCITY && !memcmp(work->v_next, x, bytes)) {
    memcpy(u_found, p->state->u, bytes);
  } else {
    const cav_status status = cav_inverse_from(p->model, p->state, CAV_STAGE_VELOCITY, q, v, x, u_found);
    if (status != CAV_OK) return status;
  }
  cav_impulse_read(p, f);

  // inertial and constraint forces are as much part of the balance as u is
  const double rate = 1.0 / p->state->options.timestep;
  double *change = p->change, *force = p->force;
  for (int i = 0; i < p->nv; i++) change[i] = rate * (x[i] - v[i]);
  if (memcmp(x, v, bytes))
    cav_impulse_inertia(p, change, force);
  else
    memset(force, 0, bytes);
  double most = 0.0, off = 0.0;
  for (int i = 0; i < p->nv; i++) {
    most = larger(larger(most, fabs(u[i])), fabs(force[i]));
    off = larger(off, fabs(u_found[i] - u[i]));
    force[i] = 0.0;
  }
  cav_impulse_push(p, rate, f, force);
  for (int i = 0; i < p->nv; i++) most = larger(most, fabs(force[i]));
  *error = off;
  *scale = most;
  return CAV_OK;
}
