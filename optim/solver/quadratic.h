/// The quadratic programme of one linearisation: the costs' Gauss-Newton model, linear rows with exact penalties, a
/// box. Private to optim/.
#ifndef CAVORT_QUADRATIC_H
#define CAVORT_QUADRATIC_H

#include "gauss_newton.h"

/// With g, H of the costs and c, J of the constraint rows at the last linearisation (whose rows were kept, under no
/// penalties):
///
///     minimise  g'x + x'Hx/2 + sum of penalty_i * distance(c_i + J_i x, [lower_i, upper_i])   subject to  |x| <=
///     radius
typedef struct cav_quadratic cav_quadratic;

/// NULL if memory runs out.
cav_quadratic *cav_quadratic_new(const cav_transcription *transcription, cav_normal *normal);
void cav_quadratic_free(cav_quadratic *quadratic);

/// Solves it by a primal-dual interior point, to a duality gap in units of the cost. The step's logarithm stays within
/// change[0] .. change[1], too. CAV_NOT_CONVERGED: the gap was not reached; the best iterate stands. CAV_INTERRUPTED.
cav_status cav_quadratic_solve(cav_quadratic *quadratic, const double *radius, const double change[2], double gap);

/// The last programme again, whose penalties have changed since: from its solution, in a third of the iterations.
/// Same results as cav_quadratic_solve.
cav_status cav_quadratic_solve_again(cav_quadratic *quadratic, double gap);

/// Whether programmes after this are solved so well that their value can be trusted, in up to twice the iterations: rows
/// give on the way to the solution, so that the Hessian keeps its digits beside them. scale: the cost, 0: not.
void cav_quadratic_let_give(cav_quadratic *quadratic, double scale);

/// Further step from the solution x, in the metric that it was found in, towards rows that are off by offset [rows], and
/// forces that are off by force [nknot*nv] as the costs of efforts weigh them (NULL: rows alone). Writes x [unknowns].
void cav_quadratic_correct(cav_quadratic *quadratic, const double *offset, const double *force, double *x);

/// Whether the costs' Hessian of the knots is convex along the rows that hold the last solution. 1 before the first one
/// where it is positive definite by itself.
int cav_quadratic_convex(cav_quadratic *quadratic);

/// Whether a knot's own part of it is, with so much added to its diagonal. Where all are, their sum is convex.
int cav_quadratic_knot_convex(cav_quadratic *quadratic, int t, double shift);

/// Results, and what the caller sets before it solves: penalties and values of the rows, by knot and slot. [unknowns],
/// [rows]
const double *cav_quadratic_step(const cav_quadratic *quadratic);
const double *cav_quadratic_multiplier(const cav_quadratic *quadratic); ///< positive at upper bounds
double *cav_quadratic_penalty(cav_quadratic *quadratic);
double *cav_quadratic_value(cav_quadratic *quadratic);
int cav_quadratic_rows(const cav_quadratic *quadratic);

/// Values of the rows that the solution leads to, to first order. [rows]
const double *cav_quadratic_prediction(cav_quadratic *quadratic);

/// Decrease of the objective from x = 0 to the solution.
double cav_quadratic_decrease(cav_quadratic *quadratic);

/// Derivative of the objective at the solution, downwards along it, over the decrease: 0 where it is stationary, 1 where
/// it goes on down as steeply. Where the Hessian is not convex, what its factors need on their diagonals besides holds
/// steps back until nothing is left of the gap, with all of the gradient.
double cav_quadratic_unfinished(cav_quadratic *quadratic);

/// A knot's part of that decrease, which was asked for before.
double cav_quadratic_knot_decrease(cav_quadratic *quadratic, int t);

/// Duality gap of the solution, in units of the cost: no step decreases a convex objective by more than this beyond it.
double cav_quadratic_gap(const cav_quadratic *quadratic);

/// Largest entry of the solution.
double cav_quadratic_length(const cav_quadratic *quadratic);

#endif
