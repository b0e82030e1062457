/// The broad phase. First what bounding spheres leave of the pairs of the shared models, in random postures: pairs,
/// those whose bounds meet, those that touch. Then the time of cav_contacts_find and of a whole inverse with 10 to 800
/// free bodies scattered so that each touches a few others, when all pairs are looked at and when a sweep prunes them
/// (sweep.c), by turns: where the two cross is CAV_SWEEP_FROM. Usage: bench_sweep.
#include "bench.h"
#include "math3.h"
#include "step.h"

enum { POSTURES = 200, RUNS = 9 };

// --- culling ---

static int bounds_meet(const cav_state *state, const cav_pair *pair) {
  const cav_geom *a = &state->model->geom[pair->geom1], *b = &state->model->geom[pair->geom2];
  cav_pose p, q;
  double d[3], n[3];
  cav_object_pose(state->model, state, CAV_OBJECT_GEOM, pair->geom1, &p);
  cav_object_pose(state->model, state, CAV_OBJECT_GEOM, pair->geom2, &q);
  sub3(d, q.pos, p.pos);
  column3(n, p.rotation, 2);
  double reach = cav_contact_activation(state, pair) + b->bound;
  return a->type == CAV_GEOM_PLANE ? dot3(d, n) < reach : norm3(d) < reach + a->bound;
}

static void cull(const char *folder, const char *name) {
  char path[4200];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  cav_error error;
  cav_model *m = cav_model_load(path, &error);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  double *q = scene_vector(m->nq), *step = scene_vector(m->nv), meet = 0, touch = 0;
  for (int k = 0; k < POSTURES; k++) {
    scene_posture(m, q, step, 0.5);
    CHECK(cav_position(m, state, q) == CAV_OK);
    int last = -1;
    for (int p = 0; p < m->npair; p++) meet += bounds_meet(state, &m->pair[p]);
    for (int i = 0; i < state->ncontact; i++) touch += state->contact[i].pair != last, last = state->contact[i].pair;
  }
  if (m->npair) printf("%-28s %6d %10.1f %10.1f\n", name, m->npair, meet / POSTURES, touch / POSTURES);
  free(q), free(step);
  cav_state_free(state);
  cav_model_free(m);
}

// --- many bodies ---

// free bodies of all simple types over a floor
static cav_model *crowd(int bodies) {
  static const char *const shapes[] = {"type='sphere' size='.1'", "type='capsule' size='.06 .08'",
                                       "type='box' size='.08 .06 .05'"};
  size_t room = 200 + 120 * (size_t)bodies, used;
  char *text = malloc(room);
  if (!text) return NULL;
  used = (size_t)snprintf(text, room, "<mujoco><worldbody><geom type='plane' size='1 1 1'/>");
  for (int i = 0; i < bodies; i++)
    used += (size_t)snprintf(text + used, room - used, "<body><freejoint/><geom %s/></body>", shapes[i % 3]);
  snprintf(text + used, room - used, "</worldbody></mujoco>");
  cav_model *model = scene_load(text);
  free(text);
  return model;
}

// one body to 0.2^3 m^3
static void scatter(int bodies, double *q) {
  double side = 0.2 * cbrt(bodies);
  for (int i = 0; i < bodies; i++) {
    double *x = q + 7 * i;
    for (int k = 0; k < 3; k++) x[k] = side * (scene_uniform() + 1) / 2;
    for (int k = 3; k < 7; k++) x[k] = scene_normal();
    quat_normalise(x + 3);
  }
}

/// Shortest times of one kind of broad phase, microseconds.
typedef struct times {
  double collide, inverse;
} times;

static void measure(cav_state *state, const double *q, double *v, double *u, int calls, times *t) {
  double start = bench_seconds();
  for (int k = 0; k < calls; k++) cav_contacts_find(state->model, state);
  t->collide = fmin(t->collide, 1e6 * (bench_seconds() - start) / calls);
  start = bench_seconds();
  for (int k = 0; k < calls; k++) cav_inverse(state->model, state, q, v, v, u);
  t->inverse = fmin(t->inverse, 1e6 * (bench_seconds() - start) / calls);
}

static void compare(int bodies) {
  cav_model *m = crowd(bodies);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *u = scene_vector(m->nv);
  struct cav_geom_cache *kept = state->work->geom, *with[2];
  with[0] = cav_geom_cache_new(m, m->npair + 1);
  with[1] = cav_geom_cache_new(m, 0);
  times t[2] = {{INFINITY, INFINITY}, {INFINITY, INFINITY}};
  int calls = 1 + 20000 / m->npair, contacts[2] = {0, 0};
  scatter(bodies, q);
  for (int run = 0; run < RUNS && CHECK(with[0] && with[1]); run++) {
    for (int swept = 0; swept < 2; swept++) {
      state->work->geom = with[swept];
      CHECK(cav_inverse(m, state, q, v, v, u) == CAV_OK);
      measure(state, q, v, u, calls, &t[swept]);
      contacts[swept] = state->ncontact;
    }
    // moved a little, as by a step
    for (int i = 0; i < m->nq; i++) q[i] += 1e-3 * scene_uniform();
    cav_configuration_normalise(m, q);
  }
  CHECK(contacts[0] == contacts[1]);
  printf("%6d %7d %9d   %10.1f %10.1f   %10.1f %10.1f   %6zu %6zu\n", bodies, m->npair, contacts[0], t[0].collide,
         t[1].collide, t[0].inverse, t[1].inverse, cav_geom_cache_bytes(with[0]) >> 10,
         cav_geom_cache_bytes(with[1]) >> 10);
  state->work->geom = kept;
  cav_geom_cache_free(with[0]), cav_geom_cache_free(with[1]);
  free(q), free(v), free(u);
  cav_state_free(state);
  cav_model_free(m);
}

int main(void) {
  static const char *const names[] = {
      "mujoco/humanoid.xml",        "dm_control/humanoid.xml", "dm_control/hopper.xml",
      "dm_control/walker.xml",      "dm_control/cheetah.xml",  "dm_control/quadruped.xml",
      "dm_control/manipulator.xml", "dm_control/finger.xml",   "dm_control/ball_in_cup.xml"};
  const char *folder = check_shared_models();
  if (folder) {
    char kept[4096];
    snprintf(kept, sizeof kept, "%s", folder);
    printf("mean over %d postures about that of the file\n%-28s %6s %10s %10s\n", POSTURES, "model", "pairs",
           "bounds meet", "touch");
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) cull(kept, names[i]);
  } else {
    printf("shared models absent: culling not measured\n");
  }
  printf("\nfree bodies, us and kB: all pairs looked at, swept\n%6s %7s %9s   %21s   %21s   %13s\n", "bodies", "pairs",
         "contacts", "search of contacts", "inverse", "memory");
  static const int bodies[] = {10, 20, 30, 45, 60, 100, 300, 800};
  for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) compare(bodies[i]);
  return check_result();
}
