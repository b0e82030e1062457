/// Newton's iteration on one step forward (forward.c): what its parts share. Private to dynamics/step.
#ifndef CAVORT_NEWTON_H
#define CAVORT_NEWTON_H

#include <math.h>
#include <string.h>

#include "hessian.h"
#include "island.h"

/// Doubles that path.c needs at the mean velocity, by what they grow with.
enum { CAV_PATH_PER_DOF = 20, CAV_PATH_PER_DOF_SQUARED = 2 };

/// The solver's own arrays, and where it is.
typedef struct cav_newton {
  cav_impulse problem;
  cav_islands islands;
  cav_impulse part; ///< the problem with the blocks of the island in hand, or all
  int ndof;         ///< its dofs
  const int *dof;   ///< [ndof]
  cav_hessian *hessian;
  const double *q, *v, *u;
  const double *begin;     ///< [nv] where the first pass begins, or NULL: at v
  double *y, *f;           ///< [nrow] J x and impulses there
  double *derivative;      ///< [nrow] J d
  double *try_y, *try_f;   ///< [nrow] the same along the line
  double *curvature;       ///< [nblock*36] -df/dy
  double *excess;          ///< [nrow] what rows see beyond J x, as last measured
  double *ahead;           ///< [nrow*nv] its rate by the dofs of each contact's block
  double *held;            ///< [nblock] normal impulses held under Coulomb's law
  double *x, *anchor;      ///< [nv] iterate; where base was taken
  double *base;            ///< [nv] h (smooth inverse - u) at anchor
  double *step, *momentum; ///< [nv] d; M (x - anchor) or M d
  double *gradient;        ///< [nv]
  double *best, *found;    ///< [nv] best iterate; inverse there
  double *matrix;          ///< [nv*nv] derivative of h times the inverse, not for euler
  double *smooth;          ///< [nv*nv] that of the smooth part alone, not for euler
  int have_smooth;
  int frozen;          ///< the excess stays as it is
  int sign;            ///< of the determinant of the last Newton step's derivative; 0: none was taken
  int raised;          ///< the problem's rows are softer than the state's
  double *room, *path; ///< of proximal.c; of path.c
  double *ended;       ///< [nv] where it ended, or how far a trace came
  double error, scale; ///< of the last measurement
  double rounding;     ///< what rounding of x can make of the error there; negative: not known yet
  double most;         ///< scale beyond which x is no step
  int iterations, limit;
} cav_newton;

static inline double largest(const double *x, int n) {
  double most = 0.0;
  for (int i = 0; i < n; i++) most = most > fabs(x[i]) ? most : fabs(x[i]);
  return most;
}

static inline void copy(double *to, const double *from, int n) {
  if (n > 0) memcpy(to, from, (size_t)n * sizeof *to);
}

/// From now on the whole problem is in hand again. potential.c.
void cav_newton_leave_island(cav_newton *newton);

/// Impulses f [nrow] at y [nrow] of the part in hand; with their curvature, or the potential, which is returned. potential.c.
double cav_newton_laws(cav_newton *newton, const double *y, double *f, double *curvature, int potential);

/// Largest error of a momentum that rounding of x causes: through inertia, terms times, and through the constraints with
/// their curvature at x. room [nv] is overwritten. potential.c.
double cav_newton_momentum_rounding(const cav_newton *newton, double terms, double *room);

/// Minimises the potential with smooth forces linear in M about x, island by island, to tolerance of the largest force
/// or to rounding. Iterations are those of the island that takes most. potential.c.
cav_status cav_newton_descend(cav_newton *newton, double tolerance);

/// Whether the step is the least point of one convex potential. newton.c.
int cav_newton_is_convex(const cav_state *state);

/// Writes the problem out at q and v, with all that the iteration needs. Fails as cav_impulse_new does. newton.c.
cav_status cav_newton_prepare(cav_newton *newton, const cav_model *model, cav_state *state);

/// Measures the inverse at x; while the excess is frozen, with the impulses that it gives. newton.c.
cav_status cav_newton_measure(cav_newton *newton);

/// matrix := M. newton.c.
void cav_newton_fill_inertia(const cav_impulse *problem, double *matrix);

/// smooth := derivative of h times the smooth inverse with respect to v_next at x: the inertia, or at the mean velocity by
/// columns, base there. It is quadratic in v_next, or nearly so: a one-sided difference errs by the step, 1e-5 of the Coriolis
/// terms, which costs Newton nothing. newton.c.
cav_status cav_newton_differentiate_smooth(cav_newton *newton);

/// matrix := matrix + J' H (J + what rows see beyond it). newton.c.
void cav_newton_add_constraints(cav_newton *newton);

/// b := A^-1 b by elimination from the last dof, so that what hangs on few others fills little, A [n*n] overwritten; rows
/// are exchanged where the diagonal is small. found [2*n] is overwritten. Returns the sign of the determinant, 0 if A is
/// singular. newton.c.
int cav_newton_solve_general(int n, double *A, double *b, int *found);

/// What was measured relative to the forces at x as far as those are a step's: what runs away is not nearer for what it runs
/// against. newton.c.
double cav_newton_residual(const cav_newton *newton);

/// Bounds the forces that a step of the mean velocity can come to by those just measured, of the convex problem, and the
/// momentum that it begins with. What is quadratic in v_next has other roots, at speeds that turn links by thousands of
/// radians. newton.c.
void cav_newton_bound_forces(cav_newton *newton);

/// The convex law's solution with linear gaps, whatever the options say; or without friction, which lifts nothing that
/// slides. newton.c.
cav_status cav_newton_first(cav_newton *newton, int friction, double tolerance);

/// Passes from where they are to begin, or v, or with go_on from x, until the inverse agrees with u; x is then the best
/// iterate and the state evaluated there. newton.c.
cav_status cav_newton_iterate(cav_newton *newton, int go_on, double tolerance);

/// From the convex problem along the curve of solutions to one of the mean velocity, where there is one on it. Of a step that
/// was found past a fold (status CAV_OK) only one that is not replaces it; of one that was not found, x stays where it is if
/// there is none, and sign is negative if the curve turned before it was lost. Convex law and linear gaps alone. path.c.
cav_status cav_newton_follow(cav_newton *newton, double tolerance, cav_status status);

#endif
