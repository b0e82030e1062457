/// What the stages of one evaluation of the inverse take, by running each alone: for `cavort inspect` and for whoever
/// wants to know where the time goes. A stage is repeated until it can be measured and the shortest of several such
/// runs counts, so the caches are warm. What the velocity stages take is told apart by leaving the constraints out.
#include "clock.h"
#include "math3.h"
#include "step.h"

enum { RUNS = 5, CALLS = 200 };

/// One measurement.
typedef struct probe {
  const cav_model *model;
  cav_state *state;
  const double *q, *v, *v_next;
} probe;

static void run_poses(probe *p) { cav_kinematics(p->model, p->state, p->q); }
static void run_rows(probe *p) { cav_limits_find(p->model, p->state); }
static void run_contacts(probe *p) { cav_contacts_find(p->model, p->state); }
static void run_equalities(probe *p) { cav_equality_evaluate(p->model, p->state); }

static void run_laws(probe *p) {
  cav_stabilisation_prepare(p->state);
  cav_contacts_soften(p->state);
}

static void run_motion(probe *p) { cav_smooth_inverse(p->model, p->state, p->v, p->v_next, p->state->u); }

static void run_velocities(probe *p) {
  cav_inverse_from(p->model, p->state, CAV_STAGE_POSITION, p->q, p->v, p->v_next, p->state->u);
}

static void run_whole(probe *p) { cav_inverse(p->model, p->state, p->q, p->v, p->v_next, p->state->u); }

// seconds of one call, positions and velocities being there
static double stage_seconds(probe *p, void (*run)(probe *)) {
  double best = INFINITY;
  for (int k = 0; k < RUNS; k++) {
    run_whole(p);
    double start = cav_clock();
    for (int i = 0; i < CALLS; i++) run(p);
    best = fmin(best, (cav_clock() - start) / CALLS);
  }
  return best;
}

cav_status cav_profile_inverse(const cav_model *model, cav_state *state, const double *q, const double *v,
                               const double *v_next, cav_profile *profile) {
  probe p = {.model = model, .state = state, .q = q, .v = v, .v_next = v_next};
  const cav_workspace *w = state->work;
  cav_status status = cav_inverse(model, state, q, v, v_next, state->u);
  if (status != CAV_OK) { return status; }
  int bounded = w->nlimit + w->nfriction + w->ntendon_limit + w->ntendon_friction > 0;
  int held = state->ncontact + state->nrow + state->nequality > 0;
  *profile = (cav_profile){.poses = stage_seconds(&p, run_poses), .motion = stage_seconds(&p, run_motion)};
  if (bounded) { profile->rows = stage_seconds(&p, run_rows); }
  if (model->npair > 0) { profile->contacts = stage_seconds(&p, run_contacts); }
  if (model->nequality > 0) { profile->equalities = stage_seconds(&p, run_equalities); }
  if (state->ncontact > 0) { profile->laws = stage_seconds(&p, run_laws); }
  if (held) { profile->impulses = fmax(0, stage_seconds(&p, run_velocities) - profile->motion); }
  profile->whole = stage_seconds(&p, run_whole);
  return cav_inverse(model, state, q, v, v_next, state->u);
}
