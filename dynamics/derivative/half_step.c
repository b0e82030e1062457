/// Derivatives of the balance of momentum (half_step.c), in closed form. When a dof of q moves by a unit, its subtree
/// moves half a step on by a twist X about the references: the axis there, or three axes turned into each other where
/// the joint's own rotation lies between; and the velocity before the joint stays, so that
///
///   d(momentum of the tree) = X x* L + I (V x X)     L momentum and I inertia of the subtree, V velocity before the
///   joint
///
/// By a dof of the velocity the twist is Y, half a step of the axis or of three times the right Jacobian of the
/// rotation, and the change Y x* L + I (axis + V x Y). The weight moves along with the subtree. Forces that turn with
/// the subtree of a dof (S x* F), whatever they are, are added for the dofs above it together, as in smooth.c, where
/// the sums of contacts count on it.
#include "half_step.h"
#include "math3.h"

// r = w x* f: what a wrench about a fixed point becomes when carried along by a twist
static void carry(double r[6], const double twist[6], const double f[6]) {
  cross3(r, twist, f);
  cross_add3(r, twist + 3, f + 3);
  cross3(r + 3, twist, f + 3);
}

// twists by the dofs of one group of the joint, which share the velocity V before them
static void group_twists(const cav_half_step *half, int first, int end, const double V[6]) {
  for (int k = first; k < end; k++) {
    double *X = half->by_q + 12 * k, *Y = half->by_v + 12 * k;
    copy6(X, half->twist_q + 6 * k);
    copy6(Y, half->twist_v + 6 * k);
    zero3(X + 6), zero3(X + 9);
    motion_cross_add(X + 6, V, X);
    copy6(Y + 6, half->axis + 6 * k);
    motion_cross_add(Y + 6, V, Y);
  }
}

static void twists(const cav_model *model, const cav_state *state, const cav_half_step *half, const double *v) {
  const int *group = state->work->group;
  double step = 0.5 * half->sign * state->options.timestep;
  cav_displaced_twists(model, step, v, half->axis, half->twist_q, half->twist_v);
  for (int i = 1; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    double V[6];
    copy6(V, half->velocity + 6 * link->parent);
    int end = link->dof + link->ndof;
    for (int first = link->dof, last; first < end; first = last) {
      for (last = first + 1; last < end && !group[last]; last++) continue;
      group_twists(half, first, last, V);
      for (int k = first; k < last; k++) axpy6(V, V, v[k], half->axis + 6 * k);
    }
  }
}

// r [nlink*6] := sums over subtrees
static void sum_up(const cav_model *model, double *r) {
  for (int i = model->nlink - 1; i > 0; i--) {
    int parent = model->link[i].parent;
    if (parent > 0) accumulate6(r + 6 * parent, r + 6 * i);
  }
}

// inertia and momentum of subtrees
static void sum_half(const cav_model *model, cav_state *state, cav_half_step *half) {
  const cav_posture at = {.com = half->com, .inertia = half->inertia, .reference = state->reference};
  cav_composites_at(model, &at, half->composite);
  memcpy(half->whole, half->momentum, 6 * (size_t)model->nlink * sizeof *half->whole);
  sum_up(model, half->whole);
}

void cav_half_steps_derivatives(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  cav_half_steps *half_steps = w->half_steps;
  sum_half(model, state, &half_steps->before);
  sum_half(model, state, &half_steps->after);
  twists(model, state, &half_steps->before, w->v);
  twists(model, state, &half_steps->after, w->v_next);
  cav_inertial_forces(model, state, half_steps->inner);
  sum_up(model, half_steps->inner);
  for (int i = 1; i < model->nlink; i++) {
    if (model->link[i].root == i) accumulate6(half_steps->inner + 6 * i, half_steps->missing + 6 * i);
  }
}

// adds the change of a tree's momentum, as a rate, by the twist of a subtree and what its inertia multiplies
static void add_change(double r[6], const cav_half_step *half, int link, const double *by, double scale) {
  double part[6], carried[6];
  inertia_mul(part, half->composite + 10 * link, by + 6);
  carry(carried, by, half->whole + 6 * link);
  accumulate6(part, carried);
  axpy6(r, r, scale, part);
}

void cav_half_steps_column(const cav_model *model, const cav_state *state, int j, double *dq, double *dv, double *dn) {
  const cav_workspace *w = state->work;
  const cav_half_steps *half_steps = w->half_steps;
  int nv = model->nv, link = model->dof[j].link;
  const double *S = state->axis + 6 * j;
  double rate = 1 / state->options.timestep, by_q[6] = {0}, by_v[6] = {0}, by_next[6] = {0}, part[6], carried[6];
  add_change(by_q, &half_steps->before, link, half_steps->before.by_q + 12 * j, -rate);
  add_change(by_q, &half_steps->after, link, half_steps->after.by_q + 12 * j, rate);
  add_change(by_v, &half_steps->before, link, half_steps->before.by_v + 12 * j, -rate);
  add_change(by_next, &half_steps->after, link, half_steps->after.by_v + 12 * j, rate);
  if (state->options.gravity) {
    // mass times the displacement of the subtree's centre
    inertia_mul(part, w->composite + 10 * link, S);
    cross3(carried, model->gravity, part + 3);
    add3(by_q, by_q, carried);
  }
  // inertial forces alone do not turn along here, all forces on the subtree do
  carry(part, S, half_steps->inner + 6 * link);
  axpy6(by_q, by_q, -1, part);
  carry(carried, S, state->force + 6 * link);

  const cav_link *root = &model->link[model->link[link].root];
  int group = j;
  while (!w->group[group]) group--;
  for (int k = root->dof; k < root->dof + root->ndof; k++) {
    const double *axis = state->axis + 6 * k;
    int at = k * nv + j;
    dq[at] += dot6(by_q, axis) + (k < group ? dot6(carried, axis) : 0);
    dv[at] += dot6(by_v, axis);
    dn[at] += dot6(by_next, axis);
  }
}
