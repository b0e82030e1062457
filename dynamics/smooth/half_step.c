/// The balance of momentum in the inverse (METHOD.md, 2). With l the spatial momentum of a tree of links, linear and
/// angular about a point fixed in space, half a step before a knot at q (-) h v/2 with v, and half a step after it at
/// q (+) h v_next/2 with v_next, the wrench that moves the tree is
///
///   W = (l_after - l_before)/h - weight at q
///
/// and the root link bears what the sum of its links' Newton-Euler forces at the mean velocity lacks of it: all other
/// rows of u are those of midpoint, the rows of the root are S(q) . W. What is after one knot is before the next, so
/// over a motion these add up to the balance of linear and angular momentum, exactly, whatever the step. Second order
/// in h, and the same read backwards in time. Two more placements of the links are its cost; no matrix is formed.
///
/// Tried and left: changes of momentum for the forces of every link, which is neater, but errs several times as much
/// where limbs turn fast; and a discrete action (as in Lee, Liu, Park and Srinivasa 2016, arXiv 1609.02898), which
/// keeps momentum too and errs more still, as it takes chords between knots for velocities. Not conserved exactly:
/// energy.
#include "half_step.h"

#include <assert.h>
#include <stdlib.h>

#include "math3.h"

enum { DOUBLES_PER_LINK = 3 + 6 + 6 + 6 + 10 + 6, DOUBLES_PER_DOF = 6 + 12 + 12 + 6 + 6 };

static double *carve_numbers(double **at, size_t n) {
  double *piece = *at;
  *at += n;
  return piece;
}

// what an evaluation leaves to derivatives
static void carve_evaluated(cav_half_step *half, double **at, size_t nlink, size_t nv) {
  half->com = carve_numbers(at, 3 * nlink);
  half->inertia = carve_numbers(at, 6 * nlink);
  half->velocity = carve_numbers(at, 6 * nlink);
  half->momentum = carve_numbers(at, 6 * nlink);
  half->axis = carve_numbers(at, 6 * nv);
}

static void carve_scratch(cav_half_step *half, double **at, size_t nlink, size_t nv, size_t nq) {
  half->composite = carve_numbers(at, 10 * nlink);
  half->whole = carve_numbers(at, 6 * nlink);
  half->by_q = carve_numbers(at, 12 * nv);
  half->by_v = carve_numbers(at, 12 * nv);
  half->twist_q = carve_numbers(at, 6 * nv);
  half->twist_v = carve_numbers(at, 6 * nv);
  half->q = carve_numbers(at, nq);
}

cav_status cav_half_steps_new(const cav_model *model, cav_state *state) {
  if (state->work->half_steps) { return CAV_OK; }
  size_t n = (size_t)model->nlink, nv = (size_t)model->nv, nq = (size_t)model->nq;
  size_t doubles = 2 * (DOUBLES_PER_LINK * n + DOUBLES_PER_DOF * nv + nq) + nv + 12 * n;
  size_t bytes = sizeof(cav_half_steps) + 2 * n * sizeof(cav_pose) + doubles * sizeof(double);
  cav_half_steps *half_steps = calloc(1, bytes);
  if (!half_steps) { return CAV_NO_MEMORY; }
  half_steps->bytes = bytes;
  half_steps->before.link = (cav_pose *)(half_steps + 1);
  half_steps->after.link = half_steps->before.link + n;
  double *at = (double *)(half_steps->after.link + n);
  half_steps->before.sign = -1, half_steps->after.sign = 1;
  carve_evaluated(&half_steps->before, &at, n, nv);
  carve_evaluated(&half_steps->after, &at, n, nv);
  half_steps->v = carve_numbers(&at, nv);
  half_steps->missing = carve_numbers(&at, 6 * n);
  half_steps->evaluated = (size_t)(at - half_steps->before.com);
  carve_scratch(&half_steps->before, &at, n, nv, nq);
  carve_scratch(&half_steps->after, &at, n, nv, nq);
  half_steps->inner = carve_numbers(&at, 6 * n);
  assert((char *)at == (char *)half_steps + bytes);
  // the world stays where it is
  half_steps->before.link[0] = half_steps->after.link[0] = state->link[0];
  state->work->half_steps = half_steps;
  return CAV_OK;
}

// momentum of a mass about its reference
static void momentum_of(double l[6], double mass, const double *inertia, const double *com, const double *reference,
                        const double *V) {
  double d[3];
  sub3(d, com, reference);
  copy3(l + 3, V + 3);
  cross_add3(l + 3, V, d);
  scale3(l + 3, mass, l + 3);
  symmetric_mul(l, inertia, V);
  cross_add3(l, d, l + 3);
}

// goes half a step from the state's q and takes the momenta there
static void go(const cav_model *model, cav_state *state, cav_half_step *half, const double *v) {
  cav_workspace *w = state->work;
  cav_integrate(model, w->q, v, 0.5 * half->sign * state->options.timestep, half->q);
  const cav_posture at = {half->q, half->link, half->com, half->inertia, state->reference, half->axis, 1};
  cav_posture_place(model, w, &at);
  for (int i = 1; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    double V[6];
    copy6(V, half->velocity + 6 * link->parent);
    for (int k = link->dof; k < link->dof + link->ndof; k++) axpy6(V, V, v[k], half->axis + 6 * k);
    copy6(half->velocity + 6 * i, V);
    momentum_of(half->momentum + 6 * i, link->mass, half->inertia + 6 * i, half->com + 3 * i, state->reference + 3 * i,
                V);
  }
}

// whether what is before the knot is there already
static int keeps_before(const cav_model *model, const cav_state *state) {
  const cav_half_steps *half_steps = state->work->half_steps;
  return half_steps->fresh && half_steps->timestep == state->options.timestep &&
         !memcmp(half_steps->v, state->work->v, (size_t)model->nv * sizeof *half_steps->v);
}

void cav_half_steps_forces(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  cav_half_steps *half_steps = w->half_steps;
  if (!keeps_before(model, state)) {
    go(model, state, &half_steps->before, w->v);
    memcpy(half_steps->v, w->v, (size_t)model->nv * sizeof *half_steps->v);
    half_steps->timestep = state->options.timestep;
    half_steps->fresh = 1;
  }
  go(model, state, &half_steps->after, w->v_next);

  // what links change by, less what their inertial forces are, at the root
  double rate = 1 / state->options.timestep, weight[3], change[6];
  for (int i = 1; i < model->nlink; i++) {
    int root = model->link[i].root;
    double *missing = half_steps->missing + 6 * root;
    if (i == root) zero3(missing), zero3(missing + 3);
    axpy6(change, half_steps->after.momentum + 6 * i, -1, half_steps->before.momentum + 6 * i);
    axpy6(missing, missing, rate, change);
    axpy6(missing, missing, -1, state->force + 6 * i);
    if (!state->options.gravity) continue;
    scale3(weight, -model->link[i].mass, model->gravity);
    push_at(missing, state->reference + 3 * i, state->com + 3 * i, weight);
  }
  for (int i = 1; i < model->nlink; i++) {
    if (model->link[i].root == i) accumulate6(state->force + 6 * i, half_steps->missing + 6 * i);
  }
}
