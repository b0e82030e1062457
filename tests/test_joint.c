/// The paper's figure 2: impulses of dry friction, contact and limit in a single joint under random control, by the
/// forward dynamics (Gauss-Seidel) and by the inverse at the velocity that the forward step reaches. They are to agree
/// to 1e-10; the paper shows 1e-5. Usage: test_joint [FILE]; FILE gets a line a step: time, angle, control, then
/// friction, contact and limit impulses of the forward and of the inverse dynamics, N s and N m s. tests/figures.sh
/// draws it.
#include "scene.h"
#include "step.h"

enum { STEPS = 400, KINDS = 3 };
static const char model_path[] = CAVORT_SOURCE_ROOT "/problems/models/joint.xml";

// impulses the last Gauss-Seidel solve ended with, as it remembers them: friction, normal contact, limit
static void forward_impulses(const cav_state *state, double f[KINDS]) {
  const cav_workspace *w = state->work;
  memset(f, 0, KINDS * sizeof *f);
  for (int i = 0; i < w->nmemory; i++) {
    const cav_memory *m = &w->memory[i];
    f[m->type < 0 ? 1 : m->type == CAV_ROW_LIMIT_JOINT ? 2 : 0] += m->f[0];
  }
}

static void inverse_impulses(const cav_state *state, double f[KINDS]) {
  memset(f, 0, KINDS * sizeof *f);
  for (int i = 0; i < state->nrow; i++) f[state->row[i].type == CAV_ROW_LIMIT_JOINT ? 2 : 0] += state->row[i].impulse;
  for (int i = 0; i < state->ncontact; i++) f[1] += state->contact[i].impulse[0];
}

int main(int argc, char **argv) {
  cav_error error = {0};
  cav_model *m = cav_model_load(model_path, &error);
  FILE *out = argc > 1 ? fopen(argv[1], "w") : NULL;
  if (!CHECK(m != NULL) || !CHECK(argc < 2 || out != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return check_result();
  }
  cav_state *state = cav_state_new(m);
  double q, v = 0, next, u, control, walk = 0, worst[KINDS] = {0}, most[KINDS] = {0}, back = 0;
  int active[KINDS] = {0};
  cav_configuration_reset(m, &q);
  for (int t = 0; t < STEPS; t++) {
    // a random walk that forgets, about a slow swing so that it meets floor and limit
    walk = 0.95 * walk + 0.12 * scene_normal();
    control = fmax(-1, fmin(1, walk + 0.6 * sin(5 * t * m->timestep) - 0.25));
    u = m->actuator[0].gear[0] * control;
    double forward[KINDS], inverse[KINDS], found;
    next = v;
    CHECK(cav_forward_gpgs(m, state, &q, &v, &u, 100000, 1e-13, &next, NULL) == CAV_OK);
    forward_impulses(state, forward);
    CHECK(cav_inverse(m, state, &q, &v, &next, &found) == CAV_OK);
    inverse_impulses(state, inverse);
    back = fmax(back, fabs(found - u));
    if (out) fprintf(out, "%g %.6f %.6f", t * m->timestep, q, u);
    for (int k = 0; k < KINDS; k++) {
      worst[k] = fmax(worst[k], fabs(forward[k] - inverse[k]));
      most[k] = fmax(most[k], fabs(forward[k]));
      active[k] += forward[k] != 0;
      if (out) fprintf(out, " %.15g %.15g", forward[k], inverse[k]);
    }
    if (out) fprintf(out, "\n");
    v = next;
    cav_integrate(m, &q, &v, m->timestep, &q);
  }
  static const char *const names[] = {"friction", "contact", "limit"};
  for (int k = 0; k < KINDS; k++) {
    printf("%-8s impulse up to %.3g, forward and inverse within %.1e, acts in %d of %d steps\n", names[k], most[k],
           worst[k], active[k], STEPS);
    // bound: the tolerance; what the slow tail of Gauss-Seidel leaves, seen 2e-11
    CHECK(worst[k] <= 1e-10);
    CHECK(active[k] > 20);
  }
  // bound: the same over the step; seen 1e-10
  CHECK_NEAR(back, 0, 1e-8);
  if (out) fclose(out);
  cav_state_free(state);
  cav_model_free(m);
  return check_result();
}
