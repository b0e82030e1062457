/// The impulse problem (9) of one state written out in matrices, shared by the forward solvers. The inverse never needs
/// it. Private to dynamics/.
#ifndef CAVORT_IMPULSE_H
#define CAVORT_IMPULSE_H

#include "jacobian.h"
#include "step.h"

/// The problem at one (q, v). Memory belongs to the state and is good until the next call of cav_impulse_new on it.
typedef struct cav_impulse {
  const cav_model *model;
  cav_state *state;
  int nv, nblock, nrow;
  int nbound, nbound_row; ///< blocks and rows before those of equality constraints
  int nspring;            ///< blocks behind those: implicit springs of tendons
  cav_block *block; ///< [nblock] contacts in their order, then scalar rows, equality constraints, springs in theirs
  const double
      *held; ///< [nblock] normal impulses that bound friction under Coulomb's law; NULL: those of the law itself
  const double *excess; ///< [nrow] what rows see beyond J v_next (cav_next_contact); NULL: nothing
  int convex;           ///< 1: contacts by the convex law, whatever the options say
  double *target;       ///< v* [nrow], m/s or rad/s
  double *R;            ///< regulariser [nrow], 1/kg
  double *M; ///< tree-sparse, D included; at the mean velocity with half of the damping that acts during the step
  double *L; ///< its factors by cav_ldl_factor
  double *force, *change; ///< scratch [nv]
  double *spare;          ///< [nspare] doubles asked for
  size_t nspare;
} cav_impulse;

/// Doubles a solver needs of its own, by what they grow with.
typedef struct cav_impulse_room {
  size_t per_block, per_row, per_row_squared, per_row_and_dof, per_dof, per_dof_squared;
} cav_impulse_room;

/// Evaluates the state at (q, v, v_next = v) and writes out the problem there, with the room asked for at spare.
/// impulse.c. Fails as cav_inverse does, with CAV_NO_MEMORY, and with CAV_BAD_INPUT if the inertia is not positive
/// definite.
cav_status cav_impulse_new(const cav_model *model, cav_state *state, const double *q, const double *v,
                           const cav_impulse_room *room, cav_impulse *problem);

/// y := J x, x [nv] -> y [nrow].
void cav_impulse_rows(const cav_impulse *problem, const double *x, double *y);

/// r := r + s J' f, f [nrow], r [nv].
void cav_impulse_push(const cav_impulse *problem, double s, const double *f, double *r);

/// r := M x, x, r [nv], not the same.
void cav_impulse_inertia(const cav_impulse *problem, const double *x, double *r);

/// What dof i has in M x, to r, after all dofs before it.
static inline void cav_impulse_inertia_of(const cav_impulse *problem, int i, const double *x, double *r) {
  const cav_workspace *work = problem->state->work;
  const double *M = problem->M + work->row[i], own = x[i];
  // nothing has come to r[i] yet: that is from dofs behind it
  double sum = M[0] * own;
  for (int j = work->parent[i], k = 1; j >= 0; j = work->parent[j], k++) {
    sum += M[k] * x[j];
    r[j] += M[k] * own;
  }
  r[i] = sum;
}

static inline double dot(const double *a, const double *b, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

/// Impulse of one block at its constraint velocity v_next: y, f [nrow] of the whole problem. hessian [dim*dim] and
/// potential may be NULL; Coulomb's law has a potential only while held is given.
void cav_impulse_law(const cav_impulse *problem, const cav_block *block, const double *y, double *f, double *hessian,
                     double *potential);

/// Momentum missing without constraints and implicit springs of tendons: r := h (smooth inverse at x - u), zero where u
/// alone takes v to x. Leaves the state's contacts as they are. v, u, x, r [nv]. Fails with CAV_NOT_FINITE.
cav_status cav_impulse_smooth(const cav_impulse *problem, const double *v, const double *u, const double *x, double *r);

/// Impulses found by the state's last evaluation, f [nrow].
void cav_impulse_read(const cav_impulse *problem, double *f);

/// Evaluates the inverse at x and compares: error receives the largest |inverse - u|, scale the largest generalised
/// force in the balance, u_found [nv] and f [nrow] what the inverse gives.
cav_status cav_impulse_check(const cav_impulse *problem, const double *q, const double *v, const double *u,
                             const double *x, double *u_found, double *f, double *error, double *scale);

/// a where b is no number.
static inline double larger(double a, double b) { return b > a ? b : a; }

#endif
