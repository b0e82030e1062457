/// One step forward by Newton's method on the convex potential in v_next (METHOD.md, 3; Todorov 2014, eqs.
/// (5)-(9)): minimise 1/2 (x - x_free)' M (x - x_free) + sum Psi(R^-1 (v* - J x)), whose gradient is h (inverse(x) -
/// u). Exact Hessian M + J' H J, factored from the leaves so that zeros of the tree stay zeros; line search on the
/// derivative, which needs no differences of the potential and so works to the last digit. The exact law makes it a
/// semismooth Newton method, the smoothed law an ordinary one. Outer passes refine: they measure the inverse itself,
/// not the model of it.
///
/// midpoint, momentum: bias and passive forces depend on v_next. The convex problem with these frozen gives the start;
/// Newton with their derivative (differences of the smooth inverse, reused while it serves) finishes. Nothing then is
/// symmetric or convex: such a step need not exist once a body turns by a radian or so within it (gyroscopic torques at
/// speeds near 2/h; the solutions traced there end in a fold). A second start has v_next = -v; then the best iterate is
/// returned as not converged. Past a fold, which the sign of the derivative's determinant tells, the report says so.
/// What forces a thousand times those of the convex problem hold at an absurd speed is no step: errors are relative to
/// no more than that, and there CAV_OK is never said.
///
/// Coulomb's law (coulomb.c) has no potential either: Newton from the convex law's solution, and where it does not
/// descend, convex problems with the bounds of friction held. A solution need not exist nor be the only one (Painleve).
/// Nor have gaps after the step (next_gap.c), whose derivative Newton takes along, or which are followed: frozen for a
/// solution, taken anew where it ends.
///
/// Stiff rows of the exact law are come to from softer ones by the proximal point method (proximal.c), which all of the
/// above is the inner solver of.
///
/// Stops when |inverse - u| is within tolerance of the largest force in the balance, or within what rounding of v_next
/// to a double does to stiff constraints, whichever is larger; up to two more passes serve light links, whose forces
/// are small against the largest. No step depends on earlier calls. Integrates no positions.
#include <assert.h>
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.h"
#include "hessian.h"
#include "island.h"
#include "math3.h"
#include "proximal.h"

enum {
  BLOCK = CAV_CURVATURE,
  DEFAULT_ITERATIONS = 100,
  SEARCH_STEPS = 60,
  STALLS = 4,
  CHANGES = 30,
  POLISH = 2,
  FEW = 2,
  LEVELS = 8,
  PATIENCE = 15
};

static const double DEFAULT_TOLERANCE = 1e-13, ROUGH = 1e-9, NEAR = 1e-2, SHORTEST_STEP = 0.02, SOFTER = 1024.0,
                    SHARPER = 32.0, RUNAWAY = 1e3;
// of the proximal point method: softness below which it is taken, ratio of levels and the least, change of a velocity
// at which it ends and the most that counts as an end
static const double STIFF = 1e-5, LEVEL_STEP = 1e-2, LEAST_LEVEL = 1e-10, AT_REST = 1e-15, CLOSE = 1e-10;

// the solver's own arrays; names as in the text above
typedef struct newton {
  cav_impulse problem;
  cav_islands islands;
  cav_impulse part; // the problem with the blocks of the island in hand, or all
  int ndof;         // its dofs
  const int *dof;   // [ndof]
  cav_hessian *hessian;
  const double *q, *v, *u;
  double *y, *f;           // [nrow] J x and impulses there
  double *derivative;      // [nrow] J d
  double *try_y, *try_f;   // [nrow] the same along the line
  double *curvature;       // [nblock*36] -df/dy
  double *excess;          // [nblock] of normal rows beyond J x, as last measured
  double *ahead;           // [ncontact*nv] its rate by the dofs of each contact's block
  double *held;            // [nblock] normal impulses held under Coulomb's law
  double *x, *anchor;      // [nv] iterate; where base was taken
  double *base;            // [nv] h (smooth inverse - u) at anchor
  double *step, *momentum; // [nv] d; M (x - anchor) or M d
  double *gradient;        // [nv]
  double *best, *found;    // [nv] best iterate; inverse there
  double *matrix;          // [nv*nv] derivative of h times the inverse, not for euler
  double *smooth;          // [nv*nv] that of the smooth part alone, not for euler
  int have_smooth;
  int frozen;          // the excess stays as it is
  int sign;            // of the determinant of the last Newton step's derivative; 0: none was taken
  int raised;          // the problem's rows are softer than the state's
  double *room;        // of proximal.c
  double *ended;       // [nv] where it ended, or how far a trace came
  double error, scale; // of the last measurement
  double most;         // scale beyond which x is no step
  int iterations, limit;
} newton;

static double largest(const double *x, int n) {
  double most = 0.0;
  for (int i = 0; i < n; i++) most = most > fabs(x[i]) ? most : fabs(x[i]);
  return most;
}

static double dot(const double *a, const double *b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

static void copy(double *to, const double *from, int n) {
  if (n > 0) memcpy(to, from, (size_t)n * sizeof *to);
}

// from now on the island in hand is all there is: a problem of its own
static void enter_island(newton *s, int island) {
  const cav_islands *all = &s->islands;
  s->part = s->problem;
  s->part.block = s->problem.block + all->first_block[island];
  s->part.nblock = all->first_block[island + 1] - all->first_block[island];
  if (s->problem.held) s->part.held = s->problem.held + all->first_block[island];
  if (s->problem.excess) s->part.excess = s->problem.excess + all->first_block[island];
  s->dof = all->dof + all->first_dof[island];
  s->ndof = all->first_dof[island + 1] - all->first_dof[island];
}

static void leave_island(newton *s) {
  s->part = s->problem;
  s->dof = s->islands.dof;
  s->ndof = s->problem.nv;
}

// whether the step is the least point of one convex potential
static int is_convex(const cav_state *state) {
  return !cav_takes_mean(state) && state->options.sliding == CAV_SLIDING_CONVEX &&
         state->options.next_gap == CAV_NEXT_GAP_LINEAR;
}

static cav_status prepare(newton *s, const cav_model *model, cav_state *state) {
  const size_t matrices = is_convex(state) ? 0 : 2, looks = state->options.next_gap == CAV_NEXT_GAP_EXACT;
  const cav_impulse_room room = {.per_block = BLOCK + 2 + CAV_PROXIMAL_PER_BLOCK + CAV_ISLAND_PER_BLOCK,
                                 .per_row = 5 + CAV_PROXIMAL_PER_ROW,
                                 .per_row_and_dof = looks,
                                 .per_dof = 9 + CAV_ISLAND_PER_DOF,
                                 .per_dof_squared = matrices};
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
  s->ahead = s->excess + nblock;
  s->matrix = s->ahead + looks * nrow * nv;
  s->smooth = s->matrix + nv * nv;
  const size_t room_of_islands = CAV_ISLAND_PER_BLOCK * nblock + CAV_ISLAND_PER_DOF * nv;
  assert(s->matrix + matrices * nv * nv + room_of_islands == s->problem.spare + s->problem.nspare);
  cav_islands_find(&s->problem, s->matrix + matrices * nv * nv, &s->islands);
  s->hessian = work->hessian;
  leave_island(s);
  return CAV_OK;
}

// impulses at y; with their curvature or the potential if asked
static double laws(newton *s, const double *y, double *f, double *curvature, int potential) {
  double sum = 0.0, psi = 0.0;
  for (int b = 0; b < s->part.nblock; b++) {
    cav_impulse_law(&s->part, &s->part.block[b], y, f, curvature ? curvature + BLOCK * b : NULL,
                    potential ? &psi : NULL);
    sum += psi;
  }
  return sum;
}

// rates of the excess of each contact by the dofs of its block, at the state's last evaluation
static void fill_ahead(newton *s) {
  const cav_impulse *p = &s->problem;
  const double rate = 1.0 / p->state->options.timestep;
  cav_next_gaps_differentiate(p->model, p->state);
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    if (block->contact < 0) continue;
    const cav_contact *contact = &p->state->contact[block->contact];
    const cav_next_contact *next = &p->state->work->next->contact[block->contact];
    double *to = s->ahead + (size_t)block->contact * (size_t)p->nv;
    int second = cav_last_dof(p->model, contact->link2);
    for (int k = 0; k < block->ndof; k++) {
      // dofs from the leaves: of the second link, or of the first
      const int dof = block->dof[k];
      const double sign = dof == second ? 1.0 : -1.0;
      double there[2];
      cav_next_gap_rates(p->model, p->state, block->contact, dof, there);
      to[k] = rate * sign * next->by_next * there[1] + next->by_linear * block->J[k];
      if (dof == second) second = p->model->dof[dof].parent;
    }
  }
}

// matrix := matrix + J' H (J + what rows see beyond it)
static void add_constraints(newton *s) {
  const int nv = s->problem.nv;
  for (int b = 0; b < s->problem.nblock; b++) {
    const cav_block *block = &s->problem.block[b];
    const double *H = s->curvature + BLOCK * b, *J = block->J;
    const double *ahead =
        s->problem.excess && !s->frozen && block->contact >= 0 ? s->ahead + block->contact * nv : NULL;
    const int n = block->ndof, dim = block->dim;
    if (largest(H, dim * dim) == 0.0) continue;
    for (int i = 0; i < n; i++) {
      double bent[CAV_IMPULSE_DIM] = {0.0}, *to = s->matrix + block->dof[i] * nv;
      for (int k = 0; k < dim; k++)
        for (int l = 0; l < dim; l++) bent[k] += H[l * dim + k] * J[l * n + i];
      for (int j = 0; j < n; j++) {
        double sum = 0.0;
        for (int k = 0; k < dim; k++) sum += bent[k] * J[k * n + j];
        if (ahead) sum += bent[0] * ahead[j];
        to[block->dof[j]] += sum;
      }
    }
  }
}

// sums over the dofs of the island in hand
static double largest_of(const newton *s, const double *x) {
  double most = 0.0;
  for (int e = 0; e < s->ndof; e++) most = fmax(most, fabs(x[s->dof[e]]));
  return most;
}

static double dot_of(const newton *s, const double *a, const double *b) {
  double sum = 0.0;
  for (int e = 0; e < s->ndof; e++) sum += a[s->dof[e]] * b[s->dof[e]];
  return sum;
}

// gradient of the convex potential at x, the island's
static void fill_gradient(newton *s) {
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = s->x[s->dof[e]] - s->anchor[s->dof[e]];
  cav_island_inertia(&s->part, s->ndof, s->dof, s->step, s->momentum);
  for (int e = 0; e < s->ndof; e++) s->gradient[s->dof[e]] = s->momentum[s->dof[e]] + s->base[s->dof[e]];
  cav_impulse_push(&s->part, -1.0, s->f, s->gradient);
}

// sum over the rows of the island of a_i b_i
static double dot_rows(const newton *s, const double *a, const double *b) {
  double sum = 0.0;
  for (int k = 0; k < s->part.nblock; k++)
    sum += dot(a + s->part.block[k].first, b + s->part.block[k].first, s->part.block[k].dim);
  return sum;
}

// least point of the potential along step, by its derivative: Newton within a shrinking bracket. Returns how far to go
static double search(newton *s) {
  const cav_impulse *p = &s->part;
  double linear = dot_of(s, s->step, s->momentum) + dot_of(s, s->step, s->base), low = 0.0, high = INFINITY,
         length = 1.0;
  cav_island_inertia(p, s->ndof, s->dof, s->step, s->found);
  const double bend = dot_of(s, s->step, s->found);
  cav_impulse_rows(p, s->step, s->derivative);
  const double pull = dot_rows(s, s->derivative, s->f), start = linear - pull;
  const double noise = 4.0 * DBL_EPSILON * (fabs(linear) + fabs(pull));
  for (int k = 0; k < SEARCH_STEPS; k++) {
    for (int b = 0; b < p->nblock; b++)
      for (int i = p->block[b].first; i < p->block[b].first + p->block[b].dim; i++)
        s->try_y[i] = s->y[i] + length * s->derivative[i];
    laws(s, s->try_y, s->try_f, s->curvature, 0);
    const double derivative = linear + length * bend - dot_rows(s, s->derivative, s->try_f);
    // short of the minimum a rough answer will do, beyond it a close one is needed to be sure of descent
    if ((derivative <= 0.0 && derivative >= 0.3 * start) || fabs(derivative) <= fmax(1e-3 * fabs(start), noise)) break;
    double curve = bend;
    for (int b = 0; b < p->nblock; b++) {
      const cav_block *block = &p->block[b];
      const double *H = s->curvature + BLOCK * b, *Jd = s->derivative + block->first;
      for (int i = 0; i < block->dim; i++) curve += Jd[i] * dot(H + i * block->dim, Jd, block->dim);
    }
    if (derivative < 0.0)
      low = length;
    else
      high = length;
    length -= derivative / curve;
    if (!(length > low && length < high)) length = high < INFINITY ? 0.5 * (low + high) : 2.0 * low;
  }
  return length;
}

// start of the convex problem: where it is lower, x or where the smooth forces alone lead
static void choose_start(newton *s) {
  const cav_impulse *p = &s->part;
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = s->base[s->dof[e]];
  cav_island_fall(p, s->ndof, s->dof, s->step);
  const double fall = 0.5 * dot_of(s, s->base, s->step);
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = s->x[s->dof[e]] - s->step[s->dof[e]];
  cav_impulse_rows(p, s->x, s->y);
  const double stay = laws(s, s->y, s->f, NULL, 1);
  cav_impulse_rows(p, s->step, s->try_y);
  const double go = laws(s, s->try_y, s->try_f, NULL, 1) - fall;
  if (go < stay)
    for (int e = 0; e < s->ndof; e++) s->x[s->dof[e]] = s->step[s->dof[e]];
}

// adds to error [nv] what rounding of J x and of v* changes in the force of one block, relative to the rounding
static void add_row_rounding(const newton *s, int b, double *error) {
  const cav_impulse *p = &s->part;
  const cav_block *block = &p->block[b];
  const double *H = s->curvature + BLOCK * b;
  for (int i = 0; i < block->dim; i++) {
    const double *J = block->J + i * block->ndof;
    double size = fabs(p->target[block->first + i]) + DBL_MIN;
    // of positions after the step, which come about by several roundings
    if (p->excess && block->contact >= 0 && i == 0)
      size += 8.0 * norm3(p->state->contact[block->contact].pos) / p->state->options.timestep;
    for (int k = 0; k < block->ndof; k++) size += fabs(J[k] * s->x[block->dof[k]]);
    for (int j = 0; j < block->dim; j++)
      for (int k = 0; k < block->ndof; k++)
        error[block->dof[k]] += fabs(block->J[j * block->ndof + k] * H[j * block->dim + i]) * size;
  }
}

// largest error of a momentum that rounding of x causes: through inertia, terms times, and through the constraints with
// their curvature at x. room [nv] is overwritten
static double momentum_rounding(const newton *s, double terms, double *room) {
  const cav_workspace *work = s->part.state->work;
  for (int e = 0; e < s->ndof; e++) {
    const int i = s->dof[e];
    const double *M = s->part.M + work->row[i];
    // a number near zero is rounded to what the least normal one is
    room[i] = terms * fabs(M[0]) * (fabs(s->x[i]) + DBL_MIN);
    for (int j = work->parent[i], k = 1; j >= 0; j = work->parent[j], k++) {
      room[i] += terms * fabs(M[k] * s->x[j]);
      room[j] += terms * fabs(M[k] * s->x[i]);
    }
  }
  for (int b = 0; b < s->part.nblock; b++) add_row_rounding(s, b, room);
  return DBL_EPSILON * largest_of(s, room);
}

// step := (M + J' H J)^-1 step for the island in hand; where nothing touches it, the inertia has its factors already
static cav_status solve_hessian(newton *s, const int *local, int begin) {
  cav_status status = CAV_OK;
  if (s->part.nblock == 0) {
    cav_island_fall(&s->part, s->ndof, s->dof, s->step);
  } else {
    if (begin) status = cav_hessian_begin(s->hessian, &s->part, s->ndof, s->dof, local);
    if (status == CAV_OK) status = cav_hessian_factor(s->hessian, s->curvature);
    if (status == CAV_OK) status = cav_hessian_solve(s->hessian, s->step);
  }
  for (int e = 0; e < s->ndof && status == CAV_OK; e++)
    if (!isfinite(s->step[s->dof[e]])) status = CAV_NOT_FINITE;
  return status;
}

// least point of the potential of an island that nothing touches: one step from the anchor
static cav_status fall(newton *s) {
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = -s->base[s->dof[e]];
  const cav_status status = solve_hessian(s, NULL, 0);
  for (int e = 0; e < s->ndof && status == CAV_OK; e++) s->x[s->dof[e]] += s->step[s->dof[e]];
  return status;
}

// minimises the potential of the island in hand from x by at most limit iterations; taken counts them, on top of those
// before
static cav_status descend(newton *s, const int *local, double tolerance, double scale, int limit, int *taken) {
  const cav_impulse *p = &s->part;
  double before = INFINITY; // largest gradient at the last iterate
  for (int first = 1; *taken < limit; first = 0) {
    cav_impulse_rows(p, s->x, s->y);
    laws(s, s->y, s->f, s->curvature, 0);
    fill_gradient(s);
    const double inertial = fmax(largest_of(s, s->base), largest_of(s, s->momentum)),
                 error = largest_of(s, s->gradient);
    if (!first && error <= tolerance * fmax(scale, inertial)) break;
    // at rounding the gradient only wanders
    if (!first && error > 0.5 * before && error <= momentum_rounding(s, 1.0, s->step)) break;
    before = error;
    for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = -s->gradient[s->dof[e]];
    const cav_status status = solve_hessian(s, local, *taken == 0);
    if (status != CAV_OK) return status;
    ++*taken;
    const double length = search(s);
    for (int e = 0; e < s->ndof; e++) s->x[s->dof[e]] += length * s->step[s->dof[e]];
    if (length * largest_of(s, s->step) <= 64.0 * DBL_EPSILON * largest_of(s, s->x)) break;
  }
  return CAV_OK;
}

// R of all rows of the island by a power of two, which rounds nothing
static void soften(newton *s, double factor) {
  for (int b = 0; b < s->part.nblock; b++) {
    const cav_block *block = &s->part.block[b];
    for (int i = block->first; i < block->first + block->dim; i++) s->part.R[i] *= factor;
  }
}

// least point of the potential of the island in hand by at most limit iterations; taken counts them. Where many contacts
// begin to slide at once the line search holds Newton back at their cones; then the island is come to from a softer one,
// whose cones are wider apart
static cav_status solve_island(newton *s, const int *local, double tolerance, double scale, int limit, int *taken) {
  *taken = s->part.nblock == 0 && limit > 0;
  if (s->part.nblock == 0) return *taken ? fall(s) : CAV_OK;
  choose_start(s);
  cav_status status = descend(s, local, tolerance, scale, limit < PATIENCE ? limit : PATIENCE, taken);
  if (*taken < PATIENCE) return status;
  for (double factor = SOFTER; factor > 1.0 && status == CAV_OK; factor /= SHARPER) {
    soften(s, factor);
    status = descend(s, local, NEAR, scale, limit, taken);
    soften(s, 1.0 / factor);
  }
  return status == CAV_OK ? descend(s, local, tolerance, scale, limit, taken) : status;
}

// minimises the potential with smooth forces linear in M about x, island by island, to tolerance of the largest force
// or to rounding. Iterations are those of the island that takes most
static cav_status solve_convex(newton *s, double tolerance) {
  const cav_impulse *p = &s->problem;
  copy(s->anchor, s->x, p->nv);
  cav_status status = CAV_OK;
  if (p->nblock > 0) {
    status = cav_impulse_smooth(p, s->v, s->u, s->x, s->base);
  } else {
    // the inverse is smooth, and was measured at x
    for (int i = 0; i < p->nv; i++) s->base[i] = p->state->options.timestep * (s->found[i] - s->u[i]);
  }
  // impulses where v_next = v say nothing about those of the solution, so the first pass does not count them
  const double scale = p->state->options.timestep * (s->iterations > 0 ? s->scale : largest(s->u, p->nv));
  int most = 0;
  cav_hessian_restart(s->hessian);
  for (int k = 0; k < s->islands.n && status == CAV_OK; k++) {
    int taken = 0;
    enter_island(s, k);
    status = solve_island(s, s->islands.local, tolerance, scale, s->limit - s->iterations, &taken);
    most = most > taken ? most : taken;
  }
  leave_island(s);
  s->iterations += most;
  return status;
}

// largest error of the generalised force that rounding causes: of x through inertia and stiff constraints, and of the
// largest forces
static double rounding(newton *s) {
  const cav_impulse *p = &s->problem;
  cav_impulse_rows(p, s->x, s->y);
  laws(s, s->y, s->f, s->curvature, 0);
  // two momenta, each at poses that are rounded, or one change of velocity
  const double terms = p->state->options.order == CAV_ORDER_MOMENTUM ? 4.0 : 1.0;
  return momentum_rounding(s, terms, s->gradient) / p->state->options.timestep +
         8.0 * DBL_EPSILON * (s->scale + DBL_MIN / p->state->options.timestep);
}

// matrix := M
static void fill_inertia(const cav_impulse *p, double *matrix) {
  const cav_workspace *work = p->state->work;
  memset(matrix, 0, (size_t)p->nv * (size_t)p->nv * sizeof *matrix);
  for (int i = 0; i < p->nv; i++) {
    const double *M = p->M + work->row[i];
    for (int j = i, k = 0; j >= 0; j = work->parent[j], k++) matrix[i * p->nv + j] = matrix[j * p->nv + i] = M[k];
  }
}

// derivative of h times the smooth inverse with respect to v_next: the inertia, or at the mean velocity by columns. It
// is quadratic in v_next, or nearly so: a one-sided difference errs by the step, 1e-5 of the Coriolis terms, which
// costs Newton nothing
static cav_status differentiate_smooth(newton *s) {
  const int nv = s->problem.nv;
  if (!cav_takes_mean(s->problem.state)) {
    fill_inertia(&s->problem, s->smooth);
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

// b := A^-1 b by elimination from the last dof, so that what hangs on few others fills little, A overwritten; rows are
// exchanged where the diagonal is small. found [2*n] is overwritten. Returns the sign of the determinant,
// 0 if A is singular
static int solve_general(int n, double *A, double *b, int *found) {
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
static cav_status measure_raised(newton *s) {
  const cav_impulse *p = &s->problem;
  const double h = p->state->options.timestep;
  const cav_status status = cav_impulse_smooth(p, s->v, s->u, s->x, s->found);
  cav_impulse_rows(p, s->x, s->y);
  laws(s, s->y, s->f, NULL, 0);
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

// measures the inverse at x; while the excess is frozen, with the impulses that it gives
static cav_status measure(newton *s) {
  const cav_impulse *p = &s->problem;
  if (s->raised && !p->excess) return measure_raised(s);
  const cav_status status = cav_impulse_check(p, s->q, s->v, s->u, s->x, s->found, s->f, &s->error, &s->scale);
  if (!p->excess || status != CAV_OK) return status;
  for (int b = 0; b < p->nblock && !s->frozen; b++) {
    const int contact = p->block[b].contact;
    s->excess[b] = contact >= 0 ? cav_contact_excess(p->state, &p->state->contact[contact]) : 0.0;
  }
  if (s->raised) return measure_raised(s);
  if (!s->frozen) return CAV_OK;
  cav_impulse_rows(p, s->x, s->y);
  laws(s, s->y, s->try_f, NULL, 0);
  for (int i = 0; i < p->nrow; i++) s->f[i] -= s->try_f[i];
  cav_impulse_push(p, 1.0 / p->state->options.timestep, s->f, s->found);
  copy(s->f, s->try_f, p->nrow);
  s->error = 0.0;
  for (int i = 0; i < p->nv; i++) s->error = fmax(s->error, fabs(s->found[i] - s->u[i]));
  return CAV_OK;
}

// relative to the forces at x as far as those are a step's: what runs away is not nearer for what it runs against
static double residual(const newton *s) { return s->error > 0.0 ? s->error / fmin(s->scale, s->most) : 0.0; }

// forces that a step of the mean velocity can come to, from those of the convex problem, just measured, and the momentum
// that it begins with. What is quadratic in v_next has other roots, at speeds that turn links by thousands of radians
static void bound_forces(newton *s) {
  const cav_impulse *p = &s->problem;
  cav_impulse_inertia(p, s->v, p->force);
  s->most = RUNAWAY * fmax(s->scale, largest(p->force, p->nv) / p->state->options.timestep);
}

// one Newton step on the inverse itself, smooth derivative included, from a point just measured; shortened until the
// error falls. accepted tells whether it did; x is measured afterwards in either case
static cav_status newton_step(newton *s, int *accepted) {
  const int nv = s->problem.nv;
  const double before = residual(s);
  *accepted = 0;
  copy(s->momentum, s->found, nv);
  if (s->problem.excess && !s->frozen) fill_ahead(s);
  if (!s->have_smooth) {
    const cav_status status = differentiate_smooth(s);
    if (status != CAV_OK) return status;
  }
  cav_impulse_rows(&s->problem, s->x, s->y);
  laws(s, s->y, s->f, s->curvature, 0);
  copy(s->matrix, s->smooth, nv * nv);
  add_constraints(s);
  for (int i = 0; i < nv; i++) s->step[i] = s->problem.state->options.timestep * (s->u[i] - s->momentum[i]);
  s->iterations++;
  s->sign = solve_general(nv, s->matrix, s->step, (int *)s->momentum);
  if (s->sign == 0) return CAV_OK;
  copy(s->anchor, s->x, nv);
  for (double length = 1.0; length > SHORTEST_STEP; length *= 0.5) {
    for (int i = 0; i < nv; i++) s->x[i] = s->anchor[i] + length * s->step[i];
    const cav_status status = measure(s);
    // a derivative that served badly is taken anew next time, unless what is left is rounding
    if (length == 1.0 && residual(s) > 0.02 * before && s->error > rounding(s)) s->have_smooth = 0;
    *accepted = status == CAV_OK && residual(s) <= (1.0 - 0.5 * length) * before;
    if (*accepted) return CAV_OK;
  }
  copy(s->x, s->anchor, nv);
  return measure(s);
}

// error of v_next relative to its largest entry that the error of u stands for, if constraints did not hold it back: a
// force small against the largest may still move a light link
static double velocity_error(newton *s) {
  const cav_impulse *p = &s->problem;
  for (int i = 0; i < p->nv; i++) s->gradient[i] = p->state->options.timestep * (s->found[i] - s->u[i]);
  cav_ldl_solve(p->model, p->state->work, p->L, s->gradient);
  const double error = largest(s->gradient, p->nv);
  return error > 0.0 ? error / largest(s->x, p->nv) : 0.0;
}

// towards the law from x by convex problems in which what is not convex is held: the bounds of friction (Tresca's
// friction), from the impulses of the one before, half way from the second on; gaps after the step beyond the linear
// ones. Their fixed point is the law
static cav_status solve_held(newton *s, int count, double tolerance) {
  cav_impulse *p = &s->problem;
  const int coulomb = p->state->options.sliding == CAV_SLIDING_COULOMB;
  cav_status status = CAV_OK;
  for (int k = 0; k < count && status == CAV_OK && s->iterations < s->limit; k++) {
    if (k > 0 && p->excess) status = measure(s);
    if (status != CAV_OK) break;
    cav_impulse_rows(p, s->x, s->y);
    laws(s, s->y, s->f, NULL, 0);
    for (int b = 0; b < p->nblock; b++) {
      const double f = s->f[p->block[b].first];
      s->held[b] = k > 0 ? 0.5 * (s->held[b] + f) : f;
    }
    p->held = coulomb ? s->held : NULL;
    status = solve_convex(s, tolerance);
    p->held = NULL;
    leave_island(s);
  }
  return status;
}

// the convex law's solution with linear gaps, whatever the options say; or without friction, which lifts nothing that
// slides
static cav_status solve_first(newton *s, int friction, double tolerance) {
  cav_impulse *p = &s->problem;
  const double *excess = p->excess;
  for (int b = 0; b < p->nblock && !friction; b++) s->held[b] = 0.0;
  p->convex = friction;
  p->held = friction ? NULL : s->held;
  p->excess = NULL;
  const cav_status status = solve_convex(s, tolerance);
  p->convex = 0;
  p->held = NULL;
  p->excess = excess;
  leave_island(s);
  return status;
}

// passes from v, or with go_on from x, until the inverse agrees with u; x is then the best iterate and the state
// evaluated there
static cav_status iterate(newton *s, int go_on, double tolerance) {
  const int nv = s->problem.nv, convex = is_convex(s->problem.state);
  const int coulomb = s->problem.state->options.sliding == CAV_SLIDING_COULOMB, changes = coulomb || s->problem.excess;
  // bounds of friction or gaps that change need not lower the error at once
  const int patience = changes ? CHANGES : STALLS;
  double least = INFINITY, least_error = INFINITY;
  int stalls = 0, accepted = 0, polished = 0, held = 1;
  if (!go_on) copy(s->x, s->v, nv);
  for (int pass = go_on;; pass++) {
    if (!accepted) {
      const cav_status status = measure(s);
      if (status != CAV_OK) return status;
    }
    if (pass == 1 && !go_on && cav_takes_mean(s->problem.state)) bound_forces(s);
    stalls = residual(s) < 0.99 * least ? 0 : stalls + 1;
    if (residual(s) < least) {
      least = residual(s);
      least_error = s->error;
      copy(s->best, s->x, nv);
    }
    if (least <= tolerance && (polished++ == POLISH || velocity_error(s) <= 10.0 * tolerance)) break;
    // one solve of a system as badly conditioned as a long chain is not at rounding yet
    if (pass > (s->problem.nblock == 0) && s->error <= rounding(s)) {
      // where no force is larger than the error, the least residual is not the least error
      if (s->error < least_error) copy(s->best, s->x, nv);
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
        status = coulomb && held == 2 ? solve_first(s, 0, aim) : solve_held(s, held, aim);
      else
        status = solve_first(s, 1, aim);
      if (pass > 0 && held < CHANGES) held *= 2;
    }
    // held problems may run away where their fixed point repels
    if (status == CAV_NOT_FINITE && pass > 0) break;
    if (status != CAV_OK) return status;
  }
  copy(s->x, s->best, nv);
  const cav_status status = measure(s);
  if (status != CAV_OK) return status;
  if (s->scale > s->most) return CAV_NOT_CONVERGED;
  return residual(s) <= tolerance || s->error <= 4.0 * rounding(s) ? CAV_OK : CAV_NOT_CONVERGED;
}

// where Newton finds no way with gaps after the step that move: solutions with their excess frozen, each where the one
// before ends, the first with none. Their fixed point is the law; the excess is small against the velocities that it
// hangs on, so it mostly attracts
static cav_status follow_gaps(newton *s, double tolerance) {
  for (int b = 0; b < s->problem.nblock; b++) s->excess[b] = 0.0;
  for (int k = 0; s->iterations < s->limit; k++) {
    s->frozen = 1;
    cav_status status = iterate(s, k > 0, fmax(ROUGH, tolerance));
    s->frozen = 0;
    if (status != CAV_OK && status != CAV_NOT_CONVERGED) return status;
    status = measure(s);
    if (status != CAV_OK) return status;
    if (residual(s) <= NEAR) break;
  }
  return iterate(s, 1, tolerance);
}

// the last digits with the problem's own rows, from where the proximal point method ended; taken back where elimination
// does not bear them
static cav_status finish(newton *s, double tolerance) {
  const int nv = s->problem.nv;
  double *kept = s->ended;
  copy(kept, s->x, nv);
  const cav_status status = iterate(s, 1, tolerance);
  double change = 0.0;
  for (int i = 0; i < nv; i++) change = fmax(change, fabs(s->x[i] - kept[i]));
  if (status == CAV_OK && change <= CLOSE * largest(kept, nv)) return CAV_OK;
  copy(s->x, kept, nv);
  return measure(s);
}

// the convex problem with what is quadratic in v_next frozen at v: at a v_next that soft rows let run off it is no guess
static cav_status solve_frozen(newton *s, double tolerance) {
  copy(s->x, s->v, s->problem.nv);
  cav_status status = solve_first(s, 1, tolerance);
  if (status == CAV_OK) status = measure(s);
  if (status == CAV_OK) bound_forces(s);
  return status;
}

// stiff rows by the proximal point method: solutions with R raised to a level, each from the one before, the level
// lowered until R is the problem's own or the least that elimination bears; then until nothing changes
static cav_status approach(newton *s, double tolerance) {
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
    leave_island(s);
    if (rough && cav_takes_mean(s->problem.state))
      status = solve_frozen(s, fmax(ROUGH, tolerance));
    else
      status = iterate(s, k > 0, rough ? fmax(ROUGH, tolerance) : tolerance);
    if (status != CAV_OK && status != CAV_NOT_CONVERGED) break;
    cav_impulse_rows(&s->problem, s->x, s->y);
    laws(s, s->y, s->f, NULL, 0);
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
static cav_status turn_back(newton *s, double tolerance) {
  for (int i = 0; i < s->problem.nv; i++) s->x[i] = -s->v[i];
  s->have_smooth = 0;
  return iterate(s, 1, tolerance);
}

// whether rows are so stiff that nothing is lost by coming from softer ones
static int is_stiff(const cav_state *state) {
  const cav_options *o = &state->options;
  return o->stabilisation == CAV_STABILISATION_DISCRETE && o->softness < STIFF && !(o->smoothing > 0.0);
}

cav_status cav_forward_newton(const cav_model *model, cav_state *state, const double *q, const double *v,
                              const double *u, int iterations, double tolerance, double *v_next,
                              cav_forward_report *report) {
  if (iterations < 0 || !(tolerance >= 0.0)) return CAV_BAD_INPUT;
  if (!all_finite(u, model->nv) || !all_finite(v, model->nv)) return CAV_NOT_FINITE;
  // where nothing moves there is no step to look for
  if (model->nv == 0) {
    if (report) *report = (cav_forward_report){0};
    return cav_inverse(model, state, q, v, v_next, v_next);
  }
  newton s = {.q = q, .v = v, .u = u, .limit = iterations, .most = INFINITY};
  cav_status status = prepare(&s, model, state);
  if (status != CAV_OK) return status;
  const int stiff = is_stiff(state) && s.problem.nrow > 0;
  status = stiff ? approach(&s, tolerance) : iterate(&s, 0, tolerance);
  if (status == CAV_NOT_CONVERGED && s.problem.excess) status = follow_gaps(&s, tolerance);
  if (status == CAV_NOT_CONVERGED && cav_takes_mean(state)) status = turn_back(&s, tolerance);
  if (status != CAV_OK && status != CAV_NOT_CONVERGED) return status;
  copy(v_next, s.x, model->nv);
  if (report)
    *report = (cav_forward_report){.iterations = s.iterations, .residual = residual(&s), .folded = s.sign < 0};
  return status;
}

cav_status cav_forward(const cav_model *model, cav_state *state, const double *q, const double *v, const double *u,
                       double *v_next) {
  // followed gaps take as many again
  const int limit = DEFAULT_ITERATIONS * (state->options.next_gap == CAV_NEXT_GAP_EXACT ? 2 : 1);
  return cav_forward_newton(model, state, q, v, u, limit, DEFAULT_TOLERANCE, v_next, NULL);
}
