/// Least point of the convex potential of one step forward (forward.c), island by island: exact Hessian M + J' H J, factored
/// from the leaves so that zeros of the tree stay zeros; line search on the derivative, which needs no differences of the
/// potential and so works to the last digit. The exact law makes it a semismooth Newton method, the smoothed law an ordinary one.
#include <float.h>

#include "math3.h"
#include "newton.h"

enum { BLOCK = CAV_CURVATURE, SEARCH_STEPS = 60, PATIENCE = 15 };

static const double NEAR = 1e-2, SOFTER = 1024.0, SHARPER = 32.0;

double cav_newton_laws(cav_newton *s, const double *y, double *f, double *curvature, int potential) {
  double sum = 0.0, psi = 0.0;
  for (int b = 0; b < s->part.nblock; b++) {
    cav_impulse_law(&s->part, &s->part.block[b], y, f, curvature ? curvature + BLOCK * b : NULL,
                    potential ? &psi : NULL);
    sum += psi;
  }
  return sum;
}

// from now on the island in hand is all there is: a problem of its own
static void enter_island(cav_newton *s, int island) {
  const cav_islands *all = &s->islands;
  s->part = s->problem;
  s->part.block = s->problem.block + all->first_block[island];
  s->part.nblock = all->first_block[island + 1] - all->first_block[island];
  if (s->problem.held) s->part.held = s->problem.held + all->first_block[island];
  s->dof = all->dof + all->first_dof[island];
  s->ndof = all->first_dof[island + 1] - all->first_dof[island];
}

void cav_newton_leave_island(cav_newton *s) {
  s->part = s->problem;
  s->dof = s->islands.dof;
  s->ndof = s->problem.nv;
}

// sums over the dofs of the island in hand
static double largest_of(const cav_newton *s, const double *x) {
  double most = 0.0;
  for (int e = 0; e < s->ndof; e++) most = larger(most, fabs(x[s->dof[e]]));
  return most;
}

static double dot_of(const cav_newton *s, const double *a, const double *b) {
  double sum = 0.0;
  for (int e = 0; e < s->ndof; e++) sum += a[s->dof[e]] * b[s->dof[e]];
  return sum;
}

// what the gradient at x is made of: velocities of rows, impulses with their curvature, momentum
static void evaluate(cav_newton *s) {
  cav_impulse_rows(&s->part, s->x, s->y);
  cav_newton_laws(s, s->y, s->f, s->curvature, 0);
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = s->x[s->dof[e]] - s->anchor[s->dof[e]];
  cav_island_inertia(&s->part, s->ndof, s->dof, s->step, s->momentum);
}

// gradient of the convex potential at x, the island's, from what it is made of
static void fill_gradient(cav_newton *s) {
  for (int e = 0; e < s->ndof; e++) s->gradient[s->dof[e]] = s->momentum[s->dof[e]] + s->base[s->dof[e]];
  cav_impulse_push(&s->part, -1.0, s->f, s->gradient);
}

// x and what the gradient there is made of, by so much of the step, where the line search ended: all of it is known there
static void go_along(cav_newton *s, double length) {
  double *const y = s->y, *const f = s->f;
  for (int e = 0; e < s->ndof; e++) {
    s->x[s->dof[e]] += length * s->step[s->dof[e]];
    s->momentum[s->dof[e]] += length * s->found[s->dof[e]];
  }
  s->y = s->try_y, s->f = s->try_f;
  s->try_y = y, s->try_f = f;
}

// sum over the rows of the island of a_i b_i
static double dot_rows(const cav_newton *s, const double *a, const double *b) {
  double sum = 0.0;
  for (int k = 0; k < s->part.nblock; k++)
    sum += dot(a + s->part.block[k].first, b + s->part.block[k].first, s->part.block[k].dim);
  return sum;
}

// least point of the potential along step, by its derivative: Newton within a shrinking bracket. Returns how far to go;
// try_y, try_f and curvature are those there, found is M step
static double search(cav_newton *s) {
  const cav_impulse *p = &s->part;
  double linear = dot_of(s, s->step, s->momentum) + dot_of(s, s->step, s->base), low = 0.0, high = INFINITY,
         length = 1.0;
  cav_island_inertia(p, s->ndof, s->dof, s->step, s->found);
  const double bend = dot_of(s, s->step, s->found);
  cav_impulse_rows(p, s->step, s->derivative);
  const double pull = dot_rows(s, s->derivative, s->f), start = linear - pull;
  const double noise = 4.0 * DBL_EPSILON * (fabs(linear) + fabs(pull));
  for (int k = 0;; k++) {
    for (int b = 0; b < p->nblock; b++)
      for (int i = p->block[b].first; i < p->block[b].first + p->block[b].dim; i++)
        s->try_y[i] = s->y[i] + length * s->derivative[i];
    cav_newton_laws(s, s->try_y, s->try_f, s->curvature, 0);
    const double derivative = linear + length * bend - dot_rows(s, s->derivative, s->try_f);
    // short of the minimum a rough answer will do, beyond it a close one is needed to be sure of descent
    if ((derivative <= 0.0 && derivative >= 0.3 * start) || fabs(derivative) <= fmax(1e-3 * fabs(start), noise)) break;
    if (k == SEARCH_STEPS) break;
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
static void choose_start(cav_newton *s) {
  const cav_impulse *p = &s->part;
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = s->base[s->dof[e]];
  cav_island_fall(p, s->ndof, s->dof, s->step);
  const double fall = 0.5 * dot_of(s, s->base, s->step);
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = s->x[s->dof[e]] - s->step[s->dof[e]];
  cav_impulse_rows(p, s->x, s->y);
  const double stay = cav_newton_laws(s, s->y, s->f, NULL, 1);
  cav_impulse_rows(p, s->step, s->try_y);
  const double go = cav_newton_laws(s, s->try_y, s->try_f, NULL, 1) - fall;
  if (go < stay)
    for (int e = 0; e < s->ndof; e++) s->x[s->dof[e]] = s->step[s->dof[e]];
}

// adds to error [nv] what rounding of J x and of v* changes in the force of one block, relative to the rounding
static void add_row_rounding(const cav_newton *s, int b, double *error) {
  const cav_impulse *p = &s->part;
  const cav_block *block = &p->block[b];
  const double *H = s->curvature + BLOCK * b;
  double change[CAV_IMPULSE_DIM] = {0.0}; // of each impulse
  for (int i = 0; i < block->dim; i++) {
    const double *J = block->J + i * block->ndof;
    double size = fabs(p->target[block->first + i]) + DBL_MIN;
    // of positions after the step, which come about by several roundings
    const cav_contact *contact = p->excess && block->contact >= 0 ? &p->state->contact[block->contact] : NULL;
    if (contact && cav_row_looks_ahead(&p->state->options, contact, i))
      size += 8.0 * norm3(contact->pos) / p->state->options.timestep;
    for (int k = 0; k < block->ndof; k++) size += fabs(J[k] * s->x[block->dof[k]]);
    for (int j = 0; j < block->dim; j++) change[j] += fabs(H[j * block->dim + i]) * size;
  }
  for (int j = 0; j < block->dim; j++) {
    if (change[j] == 0.0) continue;
    const double *J = block->J + j * block->ndof;
    for (int k = 0; k < block->ndof; k++) error[block->dof[k]] += fabs(J[k]) * change[j];
  }
}

double cav_newton_momentum_rounding(const cav_newton *s, double terms, double *room) {
  const cav_workspace *work = s->part.state->work;
  for (int e = 0; e < s->ndof; e++) {
    const int i = s->dof[e];
    const double *M = s->part.M + work->row[i];
    // a number near zero is rounded to what the least normal one is
    const double own = terms * fabs(s->x[i]);
    double sum = fabs(M[0]) * (own + terms * DBL_MIN);
    for (int j = work->parent[i], k = 1; j >= 0; j = work->parent[j], k++) {
      sum += terms * fabs(M[k] * s->x[j]);
      room[j] += fabs(M[k]) * own;
    }
    room[i] = sum;
  }
  for (int b = 0; b < s->part.nblock; b++) add_row_rounding(s, b, room);
  return DBL_EPSILON * largest_of(s, room);
}

// step := (M + J' H J)^-1 step for the island in hand; where nothing touches it, the inertia has its factors already
static cav_status solve_hessian(cav_newton *s, const int *local, int begin) {
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
static cav_status fall(cav_newton *s) {
  for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = -s->base[s->dof[e]];
  const cav_status status = solve_hessian(s, NULL, 0);
  for (int e = 0; e < s->ndof && status == CAV_OK; e++) s->x[s->dof[e]] += s->step[s->dof[e]];
  return status;
}

// minimises the potential of the island in hand from x by at most limit iterations; taken counts them, on top of those
// before
static cav_status descend(cav_newton *s, const int *local, double tolerance, double scale, int limit, int *taken) {
  double before = INFINITY; // largest gradient at the last iterate
  // steps since the gradient was evaluated at x itself: sums of steps differ from that by their rounding
  int summed = 0;
  const double outset = largest_of(s, s->base);
  evaluate(s);
  for (int first = 1; *taken < limit; first = 0) {
    fill_gradient(s);
    const double inertial = larger(outset, largest_of(s, s->momentum)), error = largest_of(s, s->gradient);
    // at rounding the gradient only wanders
    const int ends = !first && (error <= tolerance * larger(scale, inertial) ||
                                (error > 0.5 * before && error <= cav_newton_momentum_rounding(s, 1.0, s->step)));
    if (ends && !summed) break;
    if (ends) {
      evaluate(s);
      summed = 0;
      continue;
    }
    before = error;
    for (int e = 0; e < s->ndof; e++) s->step[s->dof[e]] = -s->gradient[s->dof[e]];
    const cav_status status = solve_hessian(s, local, *taken == 0);
    if (status != CAV_OK) return status;
    ++*taken;
    const double length = search(s);
    go_along(s, length);
    summed++;
    if (length * largest_of(s, s->step) <= 64.0 * DBL_EPSILON * largest_of(s, s->x)) break;
  }
  return CAV_OK;
}

// R of all rows of the island by a power of two, which rounds nothing
static void soften(cav_newton *s, double factor) {
  for (int b = 0; b < s->part.nblock; b++) {
    const cav_block *block = &s->part.block[b];
    for (int i = block->first; i < block->first + block->dim; i++) s->part.R[i] *= factor;
  }
}

// least point of the potential of the island in hand by at most limit iterations; taken counts them. Where many contacts
// begin to slide at once the line search holds Newton back at their cones; then the island is come to from a softer one,
// whose cones are wider apart
static cav_status solve_island(cav_newton *s, const int *local, double tolerance, double scale, int limit, int *taken) {
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

cav_status cav_newton_descend(cav_newton *s, double tolerance) {
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
  cav_newton_leave_island(s);
  s->iterations += most;
  return status;
}
