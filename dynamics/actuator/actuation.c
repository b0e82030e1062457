/// Which forces actuators can give: the orthogonal projection of u on the range of the transmission T [nv*nu], whose
/// column k is actuator k's moments times its unit of effort, and the least-norm efforts that reach it. T does not
/// depend on q for joints and fixed tendons: there T'T is inverted once per state, by division where columns share no
/// dof, otherwise as a pseudo-inverse by Jacobi rotations; with other transmissions at every call. Limits are not
/// applied.
#include <assert.h>
#include <stdlib.h>

#include "actuator.h"
#include "algebra.h"
#include "math3.h"

static const double RANK_TOLERANCE = 1e-12;

// T'T, dense; returns whether it is diagonal
static int fill_gram(const cav_model *model, const cav_workspace *w, double *G, double *column) {
  int nu = model->nactuator, diagonal = 1;
  memset(G, 0, (size_t)nu * (size_t)nu * sizeof *G);
  memset(column, 0, (size_t)model->nv * sizeof *column);
  for (int i = 0; i < nu; i++) {
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { column[w->gear_dof[e]] += w->gear[e]; }
    for (int j = 0; j < nu; j++) {
      for (int e = w->gear_start[j]; e < w->gear_start[j + 1]; e++) {
        G[i * nu + j] += w->gear[e] * column[w->gear_dof[e]];
      }
      G[i * nu + j] *= model->actuator[i].unit * model->actuator[j].unit;
      diagonal = diagonal && (i == j || G[i * nu + j] == 0);
    }
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { column[w->gear_dof[e]] = 0; }
  }
  return diagonal;
}

// inverse of T'T for the moments at hand: of its diagonal if that is all there is
static void invert_gram(const cav_model *model, cav_workspace *w, double *G) {
  int nu = model->nactuator;
  w->gram_diagonal = fill_gram(model, w, G, w->scratch);
  if (!w->gram_diagonal) {
    cav_pseudo_inverse(nu, RANK_TOLERANCE, G, G + nu * nu, G + 2 * nu * nu);
    return;
  }
  for (int i = 0; i < nu; i++) {
    double g = G[i * nu + i];
    w->gram_inverse[i] = g > 0 ? 1 / g : 0;
  }
}

cav_status cav_actuation_compile(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  int nu = model->nactuator, entries = 0;
  if (nu == 0) { return CAV_OK; }
  for (int i = 0; i < nu; i++) {
    w->gear_start[i] = entries;
    entries += cav_transmission_dofs(model, i, w->gear_dof + entries);
    if (!model->actuator[i].constant) {
      w->gear_varies = 1;
    } else {
      cav_transmission_length(state, i, w->gear + w->gear_start[i]);
    }
  }
  w->gear_start[nu] = entries;
  assert(entries == w->gear_room);
  double *G = malloc(3 * (size_t)nu * (size_t)nu * sizeof *G);
  if (!G) { return CAV_NO_MEMORY; }
  invert_gram(model, w, G);
  if (w->gear_varies || !w->gram_diagonal) {
    w->gram = G;
  } else {
    free(G);
  }
  return CAV_OK;
}

// moments that depend on q, and what inverts them
static void follow_position(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  for (int i = 0; i < model->nactuator; i++) {
    if (!model->actuator[i].constant) { cav_transmission_length(state, i, w->gear + w->gear_start[i]); }
  }
  invert_gram(model, w, w->gram);
}

// y = T' u
static void into_efforts(const cav_model *model, const cav_workspace *w, const double *u, double *y) {
  for (int i = 0; i < model->nactuator; i++) {
    y[i] = 0;
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { y[i] += w->gear[e] * u[w->gear_dof[e]]; }
    y[i] *= model->actuator[i].unit;
  }
}

// y := (T'T)^+ y
static void solve_gram(const cav_model *model, const cav_workspace *w, double *y, double *old) {
  int nu = model->nactuator;
  if (w->gram_diagonal) {
    for (int i = 0; i < nu; i++) { y[i] *= w->gram_inverse[i]; }
    return;
  }
  memcpy(old, y, (size_t)nu * sizeof *old);
  for (int i = 0; i < nu; i++) {
    y[i] = 0;
    for (int j = 0; j < nu; j++) { y[i] += w->gram[i * nu + j] * old[j]; }
  }
}

void cav_actuation(const cav_model *model, cav_state *state, const double *u, double *residual, double *effort) {
  const cav_workspace *w = state->work;
  int nu = model->nactuator;
  double *y = w->control;
  if (w->gear_varies) { follow_position(model, state); }
  into_efforts(model, w, u, y);
  solve_gram(model, w, y, y + nu);
  if (residual) {
    if (residual != u && model->nv > 0) { memcpy(residual, u, (size_t)model->nv * sizeof *u); }
    for (int i = 0; i < nu; i++) {
      double force = model->actuator[i].unit * y[i];
      for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) { residual[w->gear_dof[e]] -= w->gear[e] * force; }
    }
  }
  if (effort && nu > 0) { memcpy(effort, y, (size_t)nu * sizeof *y); }
}

int cav_actuation_inputs(const cav_model *model, cav_state *state, const double *v, const double *effort,
                         double *input) {
  int missed = 0;
  for (int i = 0; i < model->nactuator; i++) {
    double length = cav_actuator_length(model, state, i, NULL), velocity = cav_actuator_velocity(state, i, v);
    missed += !cav_actuator_input(model, i, length, velocity, model->actuator[i].unit * effort[i], &input[i]);
  }
  return missed;
}

// least-norm efforts that give the state's u, in w->control
static void least_efforts(cav_state *state) {
  const cav_workspace *w = state->work;
  const cav_model *model = state->model;
  if (w->gear_varies) { follow_position(model, state); }
  into_efforts(model, w, state->u, w->control);
  solve_gram(model, w, w->control, w->control + model->nactuator);
}

double cav_actuators_at(cav_state *state, int dof) {
  const cav_workspace *w = state->work;
  const cav_model *model = state->model;
  double sum = 0;
  if (model->nactuator == 0) { return 0; }
  least_efforts(state);
  for (int i = 0; i < model->nactuator; i++) {
    for (int e = w->gear_start[i]; e < w->gear_start[i + 1]; e++) {
      if (w->gear_dof[e] == dof) { sum += w->gear[e] * model->actuator[i].unit * w->control[i]; }
    }
  }
  return sum;
}

double cav_actuator_part(cav_state *state, int actuator) {
  const cav_workspace *w = state->work;
  const cav_model *model = state->model;
  least_efforts(state);
  return model->actuator[actuator].unit * w->control[actuator];
}
