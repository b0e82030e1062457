/// Solutions of a step of the mean velocity, followed from a problem that has exactly one: with bias and passive forces at
/// v + b (x - v)/2 in the place of the mean velocity,
///
///     G(x, b) = (1 - b) M (x - v) + smooth(v + b (x - v)) - J' f(J x),    smooth = h (inverse without constraints - u)
///
/// is the gradient of a convex potential at b = 0, and h (inverse - u) at b = 1; where nothing is constrained that of midpoint
/// is of a step of b h. Its zeros lie on curves; the one from b = 0 is followed by its arc length, predicted along the
/// tangent and corrected by Newton's method across it (Keller 1977), so that it may turn. It cannot come back to b = 0,
/// where there is no second solution: it ends at b = 1, or runs off to velocities without bound, of which some times those at
/// its start are taken for the sign. Then there is no step on it, and none that is joined with shorter ones (test_path follows
/// the same by the length of the step). What is found past folds is one solution of several, and its sign says so.
#include <assert.h>

#include "newton.h"

enum { CORRECTIONS = 8 };
// arc length of the first step and the least, change at which a correction ends, cosine of the largest turn, times the
// start's velocities beyond which nothing comes back
static const double FIRST = 0.1, LEAST = 1e-7, CLOSE = 1e-6, STRAIGHT = 0.9, FAR = 32.0;

/// A place is b, then x in units of size.
typedef struct path {
  cav_newton *newton;
  int n; ///< nv + 1
  double size;
  double *at, *next, *guess; ///< [n] places
  double *tangent, *turned;  ///< [n] there, and at the next one
  double *change;            ///< [n] of a place
  double *A, *factors;       ///< [n*n] derivative below its border, and room for its factors
  int *found;                ///< [2*n] room
  int sign;                  ///< of the derivative's determinant with its border
} path;

static void open_path(path *p, cav_newton *s) {
  const size_t n = (size_t)s->problem.nv + 1;
  *p = (path){.newton = s, .n = (int)n};
  double *at = s->path, **const vector[] = {&p->at, &p->next, &p->guess, &p->tangent, &p->turned, &p->change};
  for (int i = 0; i < 6; i++, at += n) *vector[i] = at;
  p->found = (int *)at;
  p->A = at + n;
  p->factors = p->A + n * n;
  memset(s->path, 0, (size_t)(p->A - s->path) * sizeof *s->path);
  assert(p->factors + n * n <= s->path + CAV_PATH_PER_DOF * (n - 1) + CAV_PATH_PER_DOF_SQUARED * (n - 1) * (n - 1));
}

static double length(const double *a, int n) { return sqrt(dot(a, a, n)); }

// A := derivative of G at a place below its border, change := -G
static cav_status linearise(path *p, const double *at) {
  cav_newton *s = p->newton;
  const cav_impulse *problem = &s->problem;
  const int nv = problem->nv;
  const double b = at[0];
  for (int i = 0; i < nv; i++) s->x[i] = s->v[i] + b * (p->size * at[i + 1] - s->v[i]);
  const cav_status status = cav_newton_differentiate_smooth(s);
  if (status != CAV_OK) return status;
  for (int i = 0; i < nv; i++) {
    s->x[i] = p->size * at[i + 1];
    problem->change[i] = s->x[i] - s->v[i];
  }
  cav_impulse_inertia(problem, problem->change, s->momentum);
  for (int i = 0; i < nv; i++) {
    s->gradient[i] = (1.0 - b) * s->momentum[i] + s->base[i];
    p->A[(i + 1) * p->n] = dot(s->smooth + i * nv, problem->change, nv) - s->momentum[i];
  }
  cav_newton_fill_inertia(problem, s->matrix);
  for (int i = 0; i < nv * nv; i++) s->matrix[i] = (1.0 - b) * s->matrix[i] + b * s->smooth[i];
  cav_impulse_rows(problem, s->x, s->y);
  cav_newton_laws(s, s->y, s->f, s->curvature, 0);
  cav_impulse_push(problem, -1.0, s->f, s->gradient);
  cav_newton_add_constraints(s);
  for (int i = 0; i < nv; i++) {
    for (int j = 0; j < nv; j++) p->A[(i + 1) * p->n + j + 1] = p->size * s->matrix[i * nv + j];
    p->change[i + 1] = -s->gradient[i];
  }
  return CAV_OK;
}

// change := the derivative's inverse times it, turned := the direction that it does not change, along the border, sign := that
// of its determinant; 0 if it is singular
static int solve(path *p) {
  const size_t size = (size_t)p->n * (size_t)p->n;
  memcpy(p->factors, p->A, size * sizeof *p->A);
  p->sign = cav_newton_solve_general(p->n, p->factors, p->change, p->found);
  if (!p->sign) return 0;
  memset(p->turned, 0, (size_t)p->n * sizeof *p->turned);
  p->turned[0] = 1.0;
  return cav_newton_solve_general(p->n, p->A, p->turned, p->found);
}

// from next to a zero of G across the tangent, or, if ends, at b = 1, where sign is that of dG/dx; turned := the tangent of the
// curve there. Returns how many iterations it took, 0 if it found none
static int correct(path *p, int ends) {
  const int n = p->n;
  copy(p->guess, p->next, n);
  for (int k = 1; k <= CORRECTIONS && p->newton->iterations < p->newton->limit; k++) {
    p->newton->iterations++;
    if (linearise(p, p->next) != CAV_OK) return 0;
    if (ends) {
      memset(p->A, 0, (size_t)n * sizeof *p->A);
      p->A[0] = 1.0;
      p->change[0] = 1.0 - p->next[0];
    } else {
      copy(p->A, p->tangent, n);
      p->change[0] = dot(p->tangent, p->guess, n) - dot(p->tangent, p->next, n);
    }
    if (!solve(p)) return 0;
    for (int i = 0; i < n; i++) p->next[i] += p->change[i];
    const double size = length(p->next, n), turned = length(p->turned, n);
    if (!(size < 10.0 * FAR) || !isfinite(turned)) return 0;
    if (largest(p->change, n) > CLOSE * (1.0 + size)) continue;
    for (int i = 0; i < n; i++) p->turned[i] /= turned;
    return k;
  }
  return 0;
}

// a place on the curve by so long a step along it; 0 if it is too long. Along one curve the bordered determinant never
// changes its sign, which at b = 0 is that of a convex potential's Hessian: where it has the other, there is another curve
static int advance(path *p, double step) {
  for (int i = 0; i < p->n; i++) p->next[i] = p->at[i] + step * p->tangent[i];
  const int taken = correct(p, 0);
  return taken && p->sign > 0 && dot(p->tangent, p->turned, p->n) > STRAIGHT ? taken : 0;
}

// from a place before b = 1 to that beyond it: next := where the curve is at 1; 0 if the chord does not lead there
static int cross(path *p) {
  const double part = (1.0 - p->at[0]) / (p->next[0] - p->at[0]);
  const int sign = p->turned[0] < 0.0 ? -1 : 1;
  for (int i = 0; i < p->n; i++) p->next[i] = p->at[i] + part * (p->next[i] - p->at[i]);
  return correct(p, 1) && p->sign == sign;
}

// along the curve to b = 1; lost tells whether it runs off to velocities without bound
static int follow(path *p, int *lost) {
  double step = FIRST;
  p->tangent[0] = 1.0;
  copy(p->next, p->at, p->n);
  // the border of a curve that is nowhere steep yet
  if (!correct(p, 0)) return 0;
  copy(p->at, p->next, p->n);
  copy(p->tangent, p->turned, p->n);
  while (step > LEAST && p->newton->iterations < p->newton->limit) {
    const int taken = advance(p, step);
    if (taken && p->next[0] >= 1.0) {
      if (cross(p)) return 1;
    } else if (taken) {
      copy(p->at, p->next, p->n);
      copy(p->tangent, p->turned, p->n);
      const double size = length(p->at, p->n);
      if (size > FAR) {
        *lost = 1;
        return 0;
      }
      step = fmin(step * (taken <= 3 ? 1.6 : taken > 6 ? 0.7 : 1.0), 0.5 * (1.0 + size));
      continue;
    }
    step *= 0.5;
  }
  return 0;
}

// the start of the curve: the convex problem with all that is quadratic frozen at v
static cav_status start(path *p) {
  cav_newton *s = p->newton;
  copy(s->x, s->v, s->problem.nv);
  cav_status status = cav_newton_measure(s);
  if (status == CAV_OK) status = cav_newton_first(s, 1, CLOSE);
  p->size = fmax(largest(s->x, s->problem.nv), largest(s->v, s->problem.nv));
  if (status == CAV_OK && !(p->size > 0.0)) status = CAV_NOT_CONVERGED;
  for (int i = 0; i < s->problem.nv && status == CAV_OK; i++) p->at[i + 1] = s->x[i] / p->size;
  return status;
}

cav_status cav_newton_follow(cav_newton *s, double tolerance, cav_status before) {
  path p;
  open_path(&p, s);
  int lost = 0;
  copy(s->ended, s->x, s->problem.nv);
  cav_status status = start(&p);
  const int found = status == CAV_OK && follow(&p, &lost), folded = found && p.sign < 0;
  s->have_smooth = 0;
  if (found && !(folded && before == CAV_OK)) {
    s->sign = folded ? -1 : 1;
    for (int i = 0; i < s->problem.nv; i++) s->x[i] = p.size * p.next[i + 1];
    status = cav_newton_iterate(s, 1, tolerance);
    // at velocities that are no step's
    lost = s->scale > s->most;
  } else if (status == CAV_OK || status == CAV_NOT_FINITE) {
    status = CAV_NOT_CONVERGED;
  }
  if (status == CAV_NOT_CONVERGED) {
    s->sign = lost || before == CAV_OK ? -1 : 0;
    copy(s->x, s->ended, s->problem.nv);
    status = cav_newton_measure(s);
    if (status == CAV_OK) status = before;
  }
  return status;
}
