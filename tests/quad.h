/// A forward step of the convex law in quadruple precision, by means of its own: the reference of test_stiff where
/// rounding is what is in question. The problem (9) is rebuilt from the public interface (inertia, unit motions, laws
/// of contacts and rows), then minimised over v_next by Newton with the exact law, dense, softness lowered decade by
/// decade from where nothing is stiff. Contacts, limits and friction losses; no equality constraints.
#ifndef CAVORT_TESTS_QUAD_H
#define CAVORT_TESTS_QUAD_H

#include "cavort/dynamics.h"
#include "check.h"

#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 quad;
#else
typedef long double quad; // quadruple where there is no other
#endif

enum { QUAD_DIM = 6, QUAD_ITERATIONS = 400 };

typedef struct quad_block {
  int first, dim, ndof, *dof;
  quad *J;  // [dim*ndof]
  int type; // 0: contact, 1: limit, 2: friction loss
  const double *friction;
  double bound;
} quad_block;

typedef struct quad_step {
  int nv, nrow, nblock;
  quad_block *block;
  double *M;        // [nv*nv]
  quad *J;          // [nrow*nv], packed by blocks
  quad *R, *target; // [nrow]
  quad *force;      // [nv] h (smooth inverse at v - u)
  quad *v, *x, *f;  // v, v_next, impulses
  quad *H, *g, *d, *y, *z;
} quad_step;

static inline quad quad_abs(quad a) { return a < 0 ? -a : a; }

static inline quad quad_sqrt(quad a) {
  if (!(a > 0)) return 0;
  quad r = (quad)sqrt((double)a);
  if (!(r > 0)) return 0;
  for (int k = 0; k < 3; k++) r = (r + a / r) / 2;
  return r;
}

// impulse of one block at y, -df/dy and the potential
static inline quad quad_law(const quad_step *s, const quad_block *b, const quad *y, quad *f, quad *H) {
  quad g[QUAD_DIM], R0 = s->R[b->first];
  for (int i = 0; i < b->dim; i++) g[i] = (s->target[b->first + i] - y[b->first + i]) / s->R[b->first + i];
  for (int i = 0; i < b->dim * b->dim; i++) H[i] = 0;
  f += b->first;
  if (b->type == 2) {
    quad bound = b->bound, size = quad_abs(g[0]);
    f[0] = g[0] > bound ? bound : g[0] < -bound ? -bound : g[0];
    H[0] = size <= bound ? 1 / R0 : 0;
    return size <= bound ? R0 * g[0] * g[0] / 2 : R0 * bound * (size - bound / 2);
  }
  if (b->type == 1 || b->dim == 1) {
    f[0] = g[0] > 0 ? g[0] : 0;
    H[0] = g[0] > 0 ? 1 / R0 : 0;
    return R0 * f[0] * f[0] / 2;
  }
  // projection on the cone in the metric R
  quad square = 0, rho = s->R[b->first + 1] * b->friction[0] * b->friction[0], e[QUAD_DIM];
  for (int j = 1; j < b->dim; j++) square += g[j] / b->friction[j - 1] * (g[j] / b->friction[j - 1]);
  quad T = quad_sqrt(square), value = 0;
  if (g[0] >= T) {
    for (int i = 0; i < b->dim; i++) {
      f[i] = g[i], H[i * b->dim + i] = 1 / s->R[b->first + i];
      value += s->R[b->first + i] * g[i] * g[i] / 2;
    }
    return value;
  }
  quad top = R0 * g[0] + rho * T;
  if (top <= 0) {
    for (int i = 0; i < b->dim; i++) f[i] = 0;
    return 0;
  }
  quad n = top / (R0 + rho);
  f[0] = n;
  for (int j = 1; j < b->dim; j++) {
    e[j] = g[j] / b->friction[j - 1] / T;
    f[j] = b->friction[j - 1] * n * e[j];
  }
  // df/dg, then times 1/R: n' = (R0, rho e/mu)/(R0 + rho)
  for (int i = 0; i < b->dim; i++)
    for (int j = 0; j < b->dim; j++) {
      quad dn = (j ? rho * e[j] / b->friction[j - 1] : R0) / (R0 + rho), of = dn;
      if (i) {
        of = b->friction[i - 1] * e[i] * dn;
        if (j) of += b->friction[i - 1] * n / T / b->friction[j - 1] * ((i == j) - e[i] * e[j]);
      }
      H[i * b->dim + j] = of / s->R[b->first + j];
    }
  return (R0 + rho) * n * n / 2;
}

static inline void quad_rows(const quad_step *s, const quad *x, quad *y) {
  for (int b = 0; b < s->nblock; b++)
    for (int i = 0; i < s->block[b].dim; i++) {
      quad sum = 0;
      for (int k = 0; k < s->block[b].ndof; k++) sum += s->block[b].J[i * s->block[b].ndof + k] * x[s->block[b].dof[k]];
      y[s->block[b].first + i] = sum;
    }
}

// potential at x with impulses; gradient and Hessian if asked
static inline quad quad_potential(quad_step *s, const quad *x, int all) {
  quad value = 0, H[QUAD_DIM * QUAD_DIM];
  for (int i = 0; i < s->nv; i++) {
    quad sum = 0;
    for (int j = 0; j < s->nv; j++)
      if (s->M[i * s->nv + j] != 0) sum += s->M[i * s->nv + j] * (x[j] - s->v[j]);
    value += (x[i] - s->v[i]) * (sum / 2 + s->force[i]);
    s->z[i] = sum + s->force[i];
  }
  if (all)
    for (int i = 0; i < s->nv * s->nv; i++) s->H[i] = s->M[i];
  quad_rows(s, x, s->y);
  for (int b = 0; b < s->nblock; b++) {
    const quad_block *k = &s->block[b];
    value += quad_law(s, k, s->y, s->f, H);
    for (int i = 0; i < k->dim; i++)
      for (int a = 0; a < k->ndof; a++) {
        const quad J = k->J[i * k->ndof + a];
        if (J == 0) continue;
        s->z[k->dof[a]] -= J * s->f[k->first + i];
        for (int j = 0; all && j < k->dim; j++) {
          const quad bent = J * H[i * k->dim + j];
          if (bent == 0) continue;
          for (int c = 0; c < k->ndof; c++) s->H[k->dof[a] * s->nv + k->dof[c]] += bent * k->J[j * k->ndof + c];
        }
      }
  }
  for (int i = 0; all && i < s->nv; i++) s->g[i] = s->z[i];
  return value;
}

// d := -H^-1 g by elimination from the last, zeros left alone
static inline void quad_solve(quad_step *s) {
  const int n = s->nv;
  for (int i = 0; i < n; i++) s->d[i] = -s->g[i];
  for (int k = n - 1; k >= 0; k--)
    for (int i = 0; i < k; i++) {
      quad *Hi = s->H + i * n, *Hk = s->H + k * n;
      if (Hi[k] == 0) continue;
      const quad ratio = Hi[k] / Hk[k];
      for (int j = 0; j < k; j++)
        if (Hk[j] != 0) Hi[j] -= ratio * Hk[j];
      s->d[i] -= ratio * s->d[k];
    }
  for (int k = 0; k < n; k++) {
    for (int j = 0; j < k; j++) s->d[k] -= s->H[k * n + j] * s->d[j];
    s->d[k] /= s->H[k * n + k];
  }
}

// Newton at the softness that R has, to a step of that size; returns the largest last step relative to the largest
// velocity
static inline double quad_minimise(quad_step *s, double enough) {
  double last = INFINITY;
  quad *try = calloc((size_t)s->nv, sizeof *try);
  for (int k = 0; k < QUAD_ITERATIONS && last > enough; k++) {
    const quad at = quad_potential(s, s->x, 1);
    quad_solve(s);
    quad slope = 0, length = 1, most = 0, size = 0;
    for (int i = 0; i < s->nv; i++) slope += s->g[i] * s->d[i];
    for (int i = 0; i < s->nv; i++) most = quad_abs(s->d[i]) > most ? quad_abs(s->d[i]) : most;
    for (int i = 0; i < s->nv; i++) size = quad_abs(s->x[i]) > size ? quad_abs(s->x[i]) : size;
    last = (double)(most / (size > 0 ? size : 1));
    int cut = 0;
    for (; cut < 60; cut++, length /= 2) {
      for (int i = 0; i < s->nv; i++) try[i] = s->x[i] + length * s->d[i];
      if (last < 1e-20 || quad_potential(s, try, 0) <= at + length * slope / 1000) break;
    }
    if (cut == 60) break; // at the last digit of the potential
    memcpy(s->x, try, (size_t)s->nv * sizeof *try);
  }
  free(try);
  return last;
}

static inline void quad_free(quad_step *s) {
  for (int b = 0; b < s->nblock; b++) free(s->block[b].dof), free(s->block[b].J);
  free(s->block), free(s->M), free(s->R), free(s->target), free(s->force), free(s->v), free(s->x), free(s->f);
  free(s->H), free(s->g), free(s->d), free(s->y), free(s->z);
  memset(s, 0, sizeof *s);
}

// the problem at (q, v, u), softness of the state's options; discrete stabilisation, order euler
static inline int quad_open(quad_step *s, const cav_model *model, cav_state *state, const double *q, const double *v,
                            const double *u) {
  const size_t nv = (size_t)model->nv;
  double *found = calloc(nv, sizeof *found), *unit = calloc(nv, sizeof *unit);
  memset(s, 0, sizeof *s);
  if (!CHECK(cav_inverse(model, state, q, v, v, found) == CAV_OK)) return 0;
  s->nv = (int)nv;
  s->nblock = state->ncontact + state->nrow;
  s->nrow = state->nrow;
  for (int i = 0; i < state->ncontact; i++) s->nrow += state->contact[i].dim;
  const size_t n = (size_t)s->nrow + 1;
  s->block = calloc((size_t)s->nblock + 1, sizeof *s->block);
  s->M = calloc(nv * nv, sizeof *s->M), s->H = calloc(nv * nv, sizeof *s->H);
  s->R = calloc(n, sizeof(quad)), s->target = calloc(n, sizeof(quad)), s->y = calloc(n, sizeof(quad));
  s->f = calloc(n, sizeof(quad));
  quad **const of[] = {&s->force, &s->v, &s->x, &s->g, &s->d, &s->z};
  for (int i = 0; i < 6; i++) *of[i] = calloc(nv, sizeof(quad));
  for (int b = 0, first = 0; b < s->nblock; b++) {
    const cav_contact *c = b < state->ncontact ? &state->contact[b] : NULL;
    const cav_row *r = c ? NULL : &state->row[b - state->ncontact];
    quad_block *k = &s->block[b];
    const int limit = r && (r->type == CAV_ROW_LIMIT_JOINT || r->type == CAV_ROW_LIMIT_TENDON);
    *k = (quad_block){.first = first, .dim = c ? c->dim : 1, .type = c ? 0 : limit ? 1 : 2};
    if (c) k->friction = c->friction;
    if (r) k->bound = r->bound;
    for (int i = 0; i < k->dim && i < QUAD_DIM; i++) {
      quad damping = c ? c->damping[i] : r->damping, velocity = c ? c->velocity[i] : r->velocity;
      s->R[first + i] = c ? c->regulariser[i] : r->regulariser;
      s->target[first + i] = (1 - damping) * velocity;
      if (i == 0 && (c || limit))
        s->target[first] -= (quad)(c ? c->stiffness : r->stiffness) * (c ? c->dist - c->margin : r->dist - r->margin);
    }
    first += k->dim;
  }
  // columns by unit motions; each block keeps the dofs that move it
  double *J = calloc(n * nv, sizeof *J);
  for (size_t j = 0; j < nv; j++) {
    unit[j] = 1;
    cav_inverse_from(model, state, CAV_STAGE_POSITION, q, v, unit, found);
    unit[j] = 0;
    int at = 0;
    for (int i = 0; i < state->ncontact; i++)
      for (int k = 0; k < state->contact[i].dim; k++) J[(size_t)at++ * nv + j] = state->contact[i].velocity_next[k];
    for (int i = 0; i < state->nrow; i++) J[(size_t)at++ * nv + j] = state->row[i].velocity_next;
  }
  for (int b = 0; b < s->nblock; b++) {
    quad_block *k = &s->block[b];
    k->dof = calloc(nv, sizeof(int));
    k->J = calloc(nv * (size_t)k->dim, sizeof(quad));
    for (int j = 0; j < s->nv; j++) {
      int moves = 0;
      for (int i = 0; i < k->dim; i++) moves |= J[(size_t)(k->first + i) * nv + (size_t)j] != 0;
      if (moves) k->dof[k->ndof++] = j;
    }
    for (int i = 0; i < k->dim; i++)
      for (int j = 0; j < k->ndof; j++) k->J[i * k->ndof + j] = J[(size_t)(k->first + i) * nv + (size_t)k->dof[j]];
  }
  const int kept = state->options.constraint;
  state->options.constraint = 0;
  CHECK(cav_inverse(model, state, q, v, v, found) == CAV_OK);
  CHECK(cav_inertia(model, state, q, s->M) == CAV_OK);
  state->options.constraint = kept;
  CHECK(cav_inverse(model, state, q, v, v, unit) == CAV_OK);
  for (size_t i = 0; i < nv; i++) {
    s->v[i] = s->x[i] = v[i];
    s->force[i] = (quad)state->options.timestep * ((quad)found[i] - u[i]);
  }
  free(J), free(found), free(unit);
  return 1;
}

// v_next to the last digit of a double, from what v_next holds: the solution at a softness not far above the first;
// returns the last step's size, relative
static inline double quad_forward(quad_step *s, double from_softness, double softness, double *v_next) {
  double last = INFINITY;
  for (int i = 0; i < s->nv; i++) s->x[i] = v_next[i];
  for (double at = from_softness; at > 0.99 * softness; at *= 0.1) {
    const quad ratio = (quad)at / softness;
    for (int i = 0; i < s->nrow; i++) s->R[i] *= ratio;
    last = quad_minimise(s, at > 1.01 * softness ? 1e-3 : 1e-24);
    for (int i = 0; i < s->nrow; i++) s->R[i] /= ratio;
  }
  for (int i = 0; i < s->nv; i++) v_next[i] = (double)s->x[i];
  return last;
}

#endif
