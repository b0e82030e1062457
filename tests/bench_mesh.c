/// What meshes cost: the inverse and its derivatives of Unitree G1 at the smoothings of a schedule's stages, (1) as its maker
/// ships it, with a mesh on most links, (2) with a capsule fitted to each of these in its place and the same pairs, (3) with
/// its primitives alone, which touch with the feet. As in a plan, pairs that overlap at rest are left out. By turns in one
/// run; shown are means over knots of motions, standing, squatting, stepping and falling: microseconds of processor time, and
/// those of the meshes over those of the others.
/// Usage: bench_mesh MESHES FITTED, as by sh tests/results.sh mesh, which makes the second file.
#include "bench.h"

enum { KNOTS = 15, KINDS = 4, MODELS = 3, STAGES = 6, ROUNDS = 4 };
static const double STEP = 0.02;
static const double contact_delta[STAGES] = {0.05, 0.02, 0.008, 0.003, 0.0005, 0};
static const double self_delta[STAGES] = {0.002, 0.0017, 0.0014, 0.0012, 0.001, 0};

/// A posture by angles of joints, rad, and the way it moves.
typedef struct kind {
  struct {
    const char *joint;
    double angle;
  } set[8];
  double lean, height, sink, spread; ///< of the base: rad, m above the lowest touch, m/s; rad/s of the joints
} kind;

static const kind kinds[KINDS] = {
    {{{NULL, 0}}, 0, 0, 0, 0.05},
    {{{"left_hip_pitch_joint", -1.0},
      {"left_knee_joint", 1.8},
      {"left_ankle_pitch_joint", -0.8},
      {"right_hip_pitch_joint", -1.0},
      {"right_knee_joint", 1.8},
      {"right_ankle_pitch_joint", -0.8}},
     0,
     0,
     0.3,
     0.3},
    {{{"left_hip_pitch_joint", -0.8},
      {"left_knee_joint", 1.2},
      {"left_ankle_pitch_joint", -0.4},
      {"right_hip_pitch_joint", 0.2},
      {"right_knee_joint", 0.1},
      {"left_shoulder_pitch_joint", 0.4},
      {"right_shoulder_pitch_joint", -0.4}},
     0.05,
     0,
     0.1,
     1},
    {{{"left_elbow_joint", 0.8}, {"right_elbow_joint", 0.8}, {"left_knee_joint", 0.4}, {"right_knee_joint", 0.4}},
     0.9,
     0.05,
     1.5,
     0.5},
};

typedef struct cost {
  double inverse, derivatives, contacts;
} cost;

static double processor_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// the posture that a kind starts from; 0 if the model has no such joint
static int take_posture(const cav_model *m, const kind *k, double *q, double *v) {
  cav_configuration_reset(m, q);
  for (size_t i = 0; i < sizeof k->set / sizeof *k->set && k->set[i].joint; i++) {
    int j = cav_object_find(m, CAV_OBJECT_JOINT, k->set[i].joint);
    if (j < 0) return 0;
    q[m->joint[j].q] = k->set[i].angle;
  }
  scene_normals(v, m->nv, 0.05);
  v[4] += k->lean;
  cav_integrate(m, q, v, 1, q);
  return 1;
}

// lifts or lowers it until what is lowest is at a height; 0 if there is no floor
static int put_at(const cav_model *m, cav_state *state, double height, double *q) {
  state->options.smoothing = state->options.smoothing_self = 0.2;
  if (cav_position(m, state, q) != CAV_OK) return 0;
  double lowest = INFINITY;
  for (int i = 0; i < state->ncontact; i++)
    if (m->pair[state->contact[i].pair].external) lowest = fmin(lowest, state->contact[i].dist);
  q[2] += height - lowest;
  return isfinite(lowest);
}

// the knots of a motion of a kind: q (+) h v is the next one's, but for its height
static int draw(const cav_model *m, cav_state *state, const kind *k, double *q, double *v, double *next) {
  int nq = m->nq, nv = m->nv, ok = take_posture(m, k, q, v);
  scene_normals(v, nv, k->spread);
  for (int i = 0; i < 6; i++) v[i] *= 0.3;
  v[2] -= k->sink;
  v[4] += k->lean;
  for (int n = 0; n < KNOTS && ok; n++, q += nq, v += nv, next += nv) {
    ok = put_at(m, state, fmax(0, k->height - STEP * k->sink * n), q);
    for (int i = 0; i < nv; i++) next[i] = v[i] + 0.05 * scene_normal();
    if (n + 1 == KNOTS) break;
    cav_integrate(m, q, v, STEP, q + nq);
    memcpy(v + nv, next, sizeof *v * (size_t)nv);
  }
  return ok;
}

typedef struct motion {
  double *q, *v, *next;
} motion;

static int measure(const cav_model *m, cav_state *state, const motion *s, int stage, cost *out) {
  int nv = m->nv, ok = 1;
  double *u = scene_vector(nv), *J = scene_vector(3 * nv * nv);
  cost now = {0};
  state->options.timestep = STEP;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.sliding = CAV_SLIDING_COULOMB;
  state->options.smoothing = contact_delta[stage];
  state->options.smoothing_self = self_delta[stage];
  for (int k = 0; k < KINDS * KNOTS && ok; k++) {
    const double *q = s->q + k * m->nq, *v = s->v + k * nv, *next = s->next + k * nv;
    double start = processor_seconds();
    ok = cav_inverse(m, state, q, v, next, u) == CAV_OK;
    double middle = processor_seconds();
    ok = ok && cav_derivatives(m, state, J, J + nv * nv, J + 2 * nv * nv) == CAV_OK;
    now.inverse += 1e6 * (middle - start) / (KINDS * KNOTS);
    now.derivatives += 1e6 * (processor_seconds() - middle) / (KINDS * KNOTS);
    now.contacts += (double)state->ncontact / (KINDS * KNOTS);
  }
  // the least of the rounds, as what else runs only adds
  out->contacts = now.contacts;
  out->inverse = out->inverse > 0 ? fmin(out->inverse, now.inverse) : now.inverse;
  out->derivatives = out->derivatives > 0 ? fmin(out->derivatives, now.derivatives) : now.derivatives;
  free(u), free(J);
  return ok;
}

// keeps the pairs that another model with the same geoms has too, or those of primitives alone
static void leave_pairs(cav_model *m, const cav_model *like) {
  cav_pair *pair = (cav_pair *)m->pair;
  int n = 0;
  for (int p = 0; p < m->npair; p++) {
    int keep = !like && m->geom[pair[p].geom1].type != CAV_GEOM_MESH && m->geom[pair[p].geom2].type != CAV_GEOM_MESH;
    for (int i = 0; like && i < like->npair; i++)
      keep |= like->pair[i].geom1 == pair[p].geom1 && like->pair[i].geom2 == pair[p].geom2;
    if (keep) pair[n++] = pair[p];
  }
  m->npair = n;
}

// the three models, their states, and the postures of the first
static int open_models(const char *meshes, const char *fitted, cav_model *model[MODELS], cav_state *state[MODELS],
                       motion *s) {
  cav_load_options plan = cav_load_options_default();
  plan.overlaps = 1;
  cav_error error = {0};
  for (int i = 0; i < MODELS; i++) {
    model[i] = i == 1 ? cav_model_load(fitted, &error) : cav_model_load_with(meshes, &plan, &error);
    if (model[i] && i) leave_pairs(model[i], i == 1 ? model[0] : NULL);
    state[i] = model[i] ? cav_state_new(model[i]) : NULL;
    if (!state[i]) {
      fprintf(stderr, "%s\n", error.text);
      return 0;
    }
  }
  const cav_model *m = model[0];
  int n = KINDS * KNOTS;
  *s = (motion){scene_vector(n * m->nq), scene_vector(n * m->nv), scene_vector(n * m->nv)};
  scene_seed = 0x9E3779B97F4A7C15u;
  for (int k = 0; k < n; k += KNOTS) {
    if (draw(m, state[0], &kinds[k / KNOTS], s->q + k * m->nq, s->v + k * m->nv, s->next + k * m->nv)) continue;
    fprintf(stderr, "%s: not a robot with G1's joints and a floor\n", meshes);
    return 0;
  }
  return 1;
}

static void print_row(double delta, const char *name, const cost *c, const cost *meshes) {
  printf("%8g  %-20s %8.1f %12.1f %12.1f", delta, name, c->contacts, c->inverse, c->derivatives);
  if (c != meshes) printf(" %10.2f %12.2f", meshes->inverse / c->inverse, meshes->derivatives / c->derivatives);
  printf("\n");
}

int main(int argc, char **argv) {
  cav_model *model[MODELS] = {NULL};
  cav_state *state[MODELS] = {NULL};
  motion s = {NULL, NULL, NULL};
  if (argc != 3) {
    printf("skipped: sh tests/results.sh mesh makes the two files\n");
    return CHECK_SKIPPED;
  }
  int ok = open_models(argv[1], argv[2], model, state, &s);
  static const char *const names[MODELS] = {"meshes", "capsules fitted", "primitives alone"};
  if (ok)
    printf("%8s  %-20s %8s %12s %12s %10s %12s\n", "delta, m", "model", "contacts", "inverse, us", "derivatives",
           "meshes by", "derivatives");
  for (int stage = 0; stage < STAGES && ok; stage++) {
    cost c[MODELS] = {{0}};
    for (int round = 0; round < ROUNDS; round++)
      for (int i = 0; i < MODELS && ok; i++) ok = measure(model[i], state[i], &s, stage, &c[i]);
    for (int i = 0; i < MODELS && ok; i++) print_row(contact_delta[stage], names[i], &c[i], &c[0]);
  }
  for (int i = 0; i < MODELS; i++) {
    cav_state_free(state[i]);
    cav_model_free(model[i]);
  }
  free(s.q), free(s.v), free(s.next);
  return ok ? 0 : 1;
}
