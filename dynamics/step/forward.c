/// One step forward by Newton's method on the convex potential in v_next (METHOD.md, 3; Todorov 2014, eqs.
/// (5)-(9)): minimise 1/2 (x - x_free)' M (x - x_free) + sum Psi(R^-1 (v* - J x)), whose gradient is h (inverse(x) -
/// u) (potential.c). Outer passes refine: they measure the inverse itself, not the model of it (newton.c). Here are the ways that
/// lead there: levels of softness, second starts.
///
/// midpoint, momentum: bias and passive forces depend on v_next. The convex problem with these frozen gives the start;
/// Newton with their derivative (differences of the smooth inverse, reused while it serves) finishes. Nothing then is
/// symmetric or convex: such a step need not exist once a body turns by a radian or so within it (gyroscopic torques at
/// speeds near 2/h). A second start has v_next = -v; then the curve of solutions is followed from the convex problem
/// (path.c), and where it ends in a fold the best iterate is returned as not converged. Past a fold, which the sign of the
/// derivative's determinant tells, and where the curve ends in one, the report says so.
/// What forces a thousand times those of the convex problem hold at an absurd speed is no step: errors are relative to
/// no more than that, and there CAV_OK is never said.
///
/// Coulomb's law (coulomb.c) has no potential either: Newton from the convex law's solution, and where it does not
/// descend, convex problems with the bounds of friction held. A solution need not exist nor be the only one (Painleve).
/// Nor have gaps and ways after the step (next_knot.c), whose derivatives Newton takes along, or which are followed: frozen
/// for a solution, taken anew where it ends.
///
/// Stiff rows of the exact law are come to from softer ones by the proximal point method (proximal.c), which all of the
/// above is the inner solver of.
///
/// Stops when |inverse - u| is within tolerance of the largest force in the balance, or within what rounding of v_next
/// to a double does to stiff constraints, whichever is larger; up to two more passes serve light links, whose forces
/// are small against the largest. No step depends on earlier calls. Integrates no positions.
#include <assert.h>
#include <math.h>
#include <string.h>

#include "algebra.h"
#include "math3.h"
#include "newton.h"
#include "proximal.h"

enum { DEFAULT_ITERATIONS = 100, PATH_ITERATIONS = 1000, COULOMB_ITERATIONS = 500, LEVELS = 8 };

static const double ROUGH = 1e-9, NEAR = 1e-2;
// of the proximal point method: softness below which it is taken, ratio of levels and the least, change of a velocity
// at which it ends and the most that counts as an end
static const double STIFF = 1e-5, LEVEL_STEP = 1e-2, LEAST_LEVEL = 1e-10, AT_REST = 1e-15, CLOSE = 1e-10;

// where Newton finds no way with gaps or ways after the step that move: solutions with their excess frozen, each where the one
// before ends, the first with none. Their fixed point is the law; the excess is small against the velocities that it
// hangs on, so it mostly attracts
static cav_status follow_ahead(cav_newton *s, double tolerance) {
  memset(s->excess, 0, (size_t)s->problem.nrow * sizeof *s->excess);
  for (int k = 0; s->iterations < s->limit; k++) {
    s->frozen = 1;
    cav_status status = cav_newton_iterate(s, k > 0, fmax(ROUGH, tolerance));
    s->frozen = 0;
    if (status != CAV_OK && status != CAV_NOT_CONVERGED) return status;
    status = cav_newton_measure(s);
    if (status != CAV_OK) return status;
    if (cav_newton_residual(s) <= NEAR) break;
  }
  return cav_newton_iterate(s, 1, tolerance);
}

// the last digits with the problem's own rows, from where the proximal point method ended; taken back where elimination
// does not bear them
static cav_status finish(cav_newton *s, double tolerance) {
  const int nv = s->problem.nv;
  double *kept = s->ended;
  copy(kept, s->x, nv);
  const cav_status status = cav_newton_iterate(s, 1, tolerance);
  double change = 0.0;
  for (int i = 0; i < nv; i++) change = fmax(change, fabs(s->x[i] - kept[i]));
  if (status == CAV_OK && change <= CLOSE * largest(kept, nv)) return CAV_OK;
  copy(s->x, kept, nv);
  return cav_newton_measure(s);
}

// the convex problem with what is quadratic in v_next frozen at v: at a v_next that soft rows let run off it is no guess
static cav_status solve_frozen(cav_newton *s, double tolerance) {
  copy(s->x, s->v, s->problem.nv);
  cav_status status = cav_newton_first(s, 1, tolerance);
  if (status == CAV_OK) status = cav_newton_measure(s);
  if (status == CAV_OK) cav_newton_bound_forces(s);
  return status;
}

// stiff rows by the proximal point method: solutions with R raised to a level, each from the one before, the level
// lowered until R is the problem's own or the least that elimination bears; then until nothing changes
static cav_status approach(cav_newton *s, double tolerance) {
  cav_proximal proximal;
  cav_proximal_begin(&proximal, &s->problem, s->room);
  cav_status status = CAV_OK;
  double change = INFINITY;
  int whole = 0, rough = 1;
  for (int k = 0; !whole && (rough || change > AT_REST) && k < LEVELS; k++) {
    const double level = fmax(pow(LEVEL_STEP, k + 1), LEAST_LEVEL);
    whole = cav_proximal_set(&proximal, level);
    // the last solution is a close one: what a level leaves as it is, the next one ends
    rough = level > LEAST_LEVEL && !whole && change > AT_REST;
    s->raised = !whole;
    cav_newton_leave_island(s);
    if (rough && cav_takes_mean(s->problem.state))
      status = solve_frozen(s, fmax(ROUGH, tolerance));
    else
      status = cav_newton_iterate(s, k > 0, rough ? fmax(ROUGH, tolerance) : tolerance);
    if (status != CAV_OK && status != CAV_NOT_CONVERGED) break;
    cav_impulse_rows(&s->problem, s->x, s->y);
    cav_newton_laws(s, s->y, s->f, NULL, 0);
    change = cav_proximal_update(&proximal, s->f, s->y);
  }
  cav_proximal_end(&proximal);
  s->raised = 0;
  if (whole || (status != CAV_OK && status != CAV_NOT_CONVERGED)) return status;
  const cav_status finished = finish(s, tolerance);
  if (finished != CAV_OK) return finished;
  return change <= CLOSE ? status : CAV_NOT_CONVERGED;
}

// where Newton finds no step of the mean velocity: from where that is zero, and with it all that is quadratic in it
static cav_status turn_back(cav_newton *s, double tolerance) {
  for (int i = 0; i < s->problem.nv; i++) s->x[i] = -s->v[i];
  s->have_smooth = 0;
  return cav_newton_iterate(s, 1, tolerance);
}

// whether a step of the mean velocity is convex but for what is quadratic in it
static int has_path(const cav_state *state) {
  return cav_takes_mean(state) && state->options.sliding == CAV_SLIDING_CONVEX && !cav_looks_ahead(&state->options);
}

// whether rows are so stiff that nothing is lost by coming from softer ones
static int is_stiff(const cav_state *state) {
  const cav_options *o = &state->options;
  return o->stabilisation == CAV_STABILISATION_DISCRETE && o->softness < STIFF && !(o->smoothing > 0.0);
}

// from a guess, or from v. Where the problem is not convex, Newton on the inverse begins at the guess itself
static cav_status begin(cav_newton *s, const double *guess, double tolerance) {
  const cav_state *state = s->problem.state;
  const int stiff = is_stiff(state) && s->problem.nrow > 0;
  if (stiff) return approach(s, tolerance);
  if (guess && !cav_takes_mean(state)) {
    if (cav_newton_is_convex(state) || s->problem.nrow == 0) {
      s->begin = guess;
    } else {
      copy(s->x, guess, s->problem.nv);
      const cav_status status = cav_newton_iterate(s, 1, tolerance);
      if (status == CAV_OK || status == CAV_NO_MEMORY) return status;
    }
  }
  return cav_newton_iterate(s, 0, tolerance);
}

cav_status cav_forward_newton_from(const cav_model *model, cav_state *state, const double *q, const double *v,
                                   const double *u, const double *guess, int iterations, double tolerance,
                                   double *v_next, cav_forward_report *report) {
  if (iterations < 0 || !(tolerance >= 0.0)) return CAV_BAD_INPUT;
  if (!all_finite(u, model->nv) || !all_finite(v, model->nv)) return CAV_NOT_FINITE;
  if (guess && !all_finite(guess, model->nv)) return CAV_NOT_FINITE;
  // where nothing moves there is no step to look for
  if (model->nv == 0) {
    if (report) *report = (cav_forward_report){0};
    return cav_inverse(model, state, q, v, v_next, v_next);
  }
  cav_newton s = {.q = q, .v = v, .u = u, .limit = iterations, .most = INFINITY};
  cav_status status = cav_newton_prepare(&s, model, state);
  if (status != CAV_OK) return status;
  status = begin(&s, guess, tolerance);
  if (status == CAV_NOT_CONVERGED && s.problem.excess) status = follow_ahead(&s, tolerance);
  if (status == CAV_NOT_CONVERGED && cav_takes_mean(state)) status = turn_back(&s, tolerance);
  if (has_path(state) && (status == CAV_NOT_CONVERGED || (status == CAV_OK && s.sign < 0)))
    status = cav_newton_follow(&s, tolerance, status);
  if (status != CAV_OK && status != CAV_NOT_CONVERGED) return status;
  copy(v_next, s.x, model->nv);
  if (report)
    *report = (cav_forward_report){.iterations = s.iterations,
                                   .residual = cav_newton_residual(&s),
                                   .folded = s.sign < 0 && (status == CAV_OK || has_path(state))};
  return status;
}

cav_status cav_forward_newton(const cav_model *model, cav_state *state, const double *q, const double *v,
                              const double *u, int iterations, double tolerance, double *v_next,
                              cav_forward_report *report) {
  return cav_forward_newton_from(model, state, q, v, u, NULL, iterations, tolerance, v_next, report);
}

int cav_forward_limit(const cav_state *state) {
  const cav_options *o = &state->options;
  if (has_path(state)) return PATH_ITERATIONS;
  // friction by Coulomb's law is solved for all piles of a heap at once, and some of them need another round each
  if (o->sliding == CAV_SLIDING_COULOMB) return COULOMB_ITERATIONS;
  // what is followed takes as many again
  return (cav_looks_ahead(o) ? 2 : 1) * DEFAULT_ITERATIONS;
}

cav_status cav_forward(const cav_model *model, cav_state *state, const double *q, const double *v, const double *u,
                       double *v_next) {
  return cav_forward_newton(model, state, q, v, u, cav_forward_limit(state), CAV_FORWARD_TOLERANCE, v_next, NULL);
}
