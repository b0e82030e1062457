/// One model, its state and numbers of one step, for tests of what contacts see after a step.
#ifndef CAVORT_STEP_BENCH_H
#define CAVORT_STEP_BENCH_H

#include "scene.h"

enum { ROOM = 64 };

static cav_model *model;
static cav_state *state;
static double q[ROOM], v[ROOM], u[ROOM], next[ROOM], found[ROOM], other[ROOM];

/// Coulomb's law by discrete stabilisation, linear in gap and slip.
static void choose_linear(double timestep, double softness, double smoothing) {
  cav_options *o = &state->options;
  o->next_gap = CAV_NEXT_GAP_LINEAR;
  o->next_slip = CAV_NEXT_SLIP_LINEAR;
  o->timestep = timestep;
  o->sliding = CAV_SLIDING_COULOMB;
  o->stabilisation = CAV_STABILISATION_DISCRETE;
  o->softness = softness;
  o->time_constant = 0;
  o->smoothing = o->smoothing_self = smoothing;
}

static int open_model(cav_model *loaded) {
  model = loaded;
  CHECK(model != NULL);
  if (!model) return 0;
  state = cav_state_new(model);
  CHECK(state != NULL && model->nq <= ROOM && model->nv <= ROOM);
  cav_configuration_reset(model, q);
  memset(v, 0, sizeof v);
  memset(u, 0, sizeof u);
  memset(next, 0, sizeof next);
  return 1;
}

static void close_model(void) {
  cav_state_free(state);
  cav_model_free(model);
}

#endif
