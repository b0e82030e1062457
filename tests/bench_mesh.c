/// What meshes cost: the inverse and its derivatives at the smoothings of a schedule's stages, of a model with collision
/// meshes and of another, say with primitives in their place, or of the same whose meshes touch nothing; in one run, by
/// turns.
/// Shown are means over postures about the initial one, microseconds of processor time.
/// Usage: bench_mesh [MODEL [OTHER]]; default unitree/g1/scene_29dof.xml among the shared models.
#include "bench.h"

enum { POSTURES = 60, MODELS = 2, STAGES = 6 };
static const double contact_delta[STAGES] = {0.05, 0.02, 0.008, 0.003, 0.0005, 0};
static const double self_delta[STAGES] = {0.002, 0.0017, 0.0014, 0.0012, 0.001, 0};

typedef struct cost {
  double inverse, derivatives, contacts;
} cost;

static double processor_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int measure(const cav_model *m, cav_state *state, int stage, cost *out) {
  int nv = m->nv;
  double *q = scene_vector(m->nq), *v = scene_vector(nv), *next = scene_vector(nv), *u = scene_vector(nv);
  double *J = scene_vector(3 * nv * nv);
  int ok = 1;
  *out = (cost){0};
  state->options.timestep = 0.02;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.smoothing = contact_delta[stage];
  state->options.smoothing_self = self_delta[stage];
  scene_seed = 0x9E3779B97F4A7C15u;
  for (int k = 0; k < POSTURES && ok; k++) {
    scene_posture(m, q, v, 0.1);
    scene_normals(v, nv, 0.5);
    for (int i = 0; i < nv; i++) next[i] = v[i] + 0.05 * scene_normal();
    double start = processor_seconds();
    ok = cav_inverse(m, state, q, v, next, u) == CAV_OK;
    double middle = processor_seconds();
    ok = ok && cav_derivatives(m, state, J, J + nv * nv, J + 2 * nv * nv) == CAV_OK;
    out->inverse += 1e6 * (middle - start) / POSTURES;
    out->derivatives += 1e6 * (processor_seconds() - middle) / POSTURES;
    out->contacts += (double)state->ncontact / POSTURES;
  }
  free(q), free(v), free(next), free(u), free(J);
  return ok;
}

// the contacts of primitives alone
static void leave_meshes(cav_model *m) {
  cav_pair *pair = (cav_pair *)m->pair;
  int n = 0;
  for (int p = 0; p < m->npair; p++) {
    if (m->geom[pair[p].geom1].type != CAV_GEOM_MESH && m->geom[pair[p].geom2].type != CAV_GEOM_MESH)
      pair[n++] = pair[p];
  }
  m->npair = n;
}

int main(int argc, char **argv) {
  cav_model *model[MODELS] = {NULL};
  cav_state *state[MODELS] = {NULL};
  char usual[4200];
  const char *shared = argc > 1 ? "" : check_shared_models();
  if (!shared) {
    printf("skipped: no shared models\n");
    return CHECK_SKIPPED;
  }
  snprintf(usual, sizeof usual, "%s/unitree/g1/scene_29dof.xml", shared);
  int ok = 1;
  for (int i = 0; i < MODELS && ok; i++) {
    cav_error error = {0};
    model[i] = cav_model_load(argc > i + 1 ? argv[i + 1] : argc > 1 ? argv[1] : usual, &error);
    if (model[i] && i && argc < 3) leave_meshes(model[i]);
    state[i] = model[i] ? cav_state_new(model[i]) : NULL;
    ok = state[i] != NULL;
    if (!ok) fprintf(stderr, "%s\n", error.text);
  }
  const char *const names[MODELS] = {"meshes", argc > 2 ? "other" : "primitives alone"};
  if (ok) printf("%8s %-16s %10s %12s %12s\n", "delta, m", "model", "contacts", "inverse, us", "derivatives");
  for (int stage = 0; stage < STAGES && ok; stage++) {
    cost c[MODELS];
    // the first round warms up
    for (int round = 0; round < 2; round++) {
      for (int i = 0; i < MODELS && ok; i++) ok = measure(model[i], state[i], stage, &c[i]);
    }
    for (int i = 0; i < MODELS && ok; i++) {
      printf("%8g %-16s %10.1f %12.1f %12.1f\n", contact_delta[stage], names[i], c[i].contacts, c[i].inverse,
             c[i].derivatives);
    }
  }
  for (int i = 0; i < MODELS; i++) {
    cav_state_free(state[i]);
    cav_model_free(model[i]);
  }
  return ok ? 0 : 1;
}
