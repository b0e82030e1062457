/// Finite differences of the inverse: against a higher-order difference, one-sided and centred; staged columns are the
/// columns of full evaluations; du/dv_next is M/h where nothing touches; the state ends at the point; failures leave
/// the outputs alone.
#include "scene.h"
#include "step.h"

static const char humanlike[] =
    "<mujoco><option timestep='0.005'/><default><geom condim='3' friction='.7'/></default><worldbody>"
    "<geom type='plane' size='1 1 1'/><body pos='0 0 .38'><freejoint/><geom type='capsule' size='.08' fromto='0 -.1 0 "
    "0 .1 0'/>"
    "<body pos='0 .1 0'><joint type='ball' damping='.5'/><geom type='capsule' size='.05' fromto='0 0 -.1 0 0 -.3'/>"
    "<body pos='0 0 -.3'><joint axis='0 1 0' limited='true' range='-5 90' damping='.2' armature='.01'/>"
    "<geom type='capsule' size='.04' fromto='-.05 0 -.05 .12 0 -.05'/></body></body>"
    "<body pos='0 -.1 0'><joint type='ball' damping='.5'/><geom type='capsule' size='.05' fromto='0 0 -.1 0 0 -.3'/>"
    "<body pos='0 0 -.3'><joint axis='0 1 0' limited='true' range='-5 90' damping='.2' armature='.01' stiffness='3'/>"
    "<geom type='capsule' size='.04' fromto='-.05 0 -.05 .12 0 -.05'/></body></body></body></worldbody></mujoco>";

static cav_model *model;
static cav_state *state;
static double *q, *v, *v_next, *u;

static void random_state(double height) {
  scene_posture(model, q, u, 0.1);
  q[2] += height;
  scene_normals(v, model->nv, 0.5);
  for (int i = 0; i < model->nv; i++) v_next[i] = v[i] + model->timestep * scene_normal();
}

// u with one coordinate moved, from scratch; which: 0 q, 1 v, 2 v_next
static void moved(int which, int j, double step, double *out) {
  double *x = scene_vector(model->nq);
  if (which == 0) {
    memcpy(x, q, (size_t)model->nq * sizeof *x);
    cav_configuration_perturb(model, j, step, x);
    CHECK(cav_inverse(model, state, x, v, v_next, out) == CAV_OK);
  } else {
    memcpy(x, which == 1 ? v : v_next, (size_t)model->nv * sizeof *x);
    x[j] += step;
    CHECK(cav_inverse(model, state, q, which == 1 ? x : v, which == 1 ? v_next : x, out) == CAV_OK);
  }
  free(x);
}

// six-point difference, error of order step^6
static void reference_column(int which, int j, double *out) {
  static const double weight[] = {-1.0 / 60, 3.0 / 20, -3.0 / 4, 3.0 / 4, -3.0 / 20, 1.0 / 60};
  static const int at[] = {-3, -2, -1, 1, 2, 3};
  double step = which == 0 ? 2e-4 : 2e-3, *value = scene_vector(model->nv);
  memset(out, 0, (size_t)model->nv * sizeof *out);
  for (int k = 0; k < 6; k++) {
    moved(which, j, at[k] * step, value);
    for (int i = 0; i < model->nv; i++) out[i] += weight[k] * value[i] / step;
  }
  free(value);
}

static void read_u(const cav_model *m, cav_state *s, void *context, double *value) {
  (*(int *)context)++;
  memcpy(value, s->u, (size_t)m->nv * sizeof *value);
}

// largest error of each method and each of the three derivatives against the reference, relative to the derivative
static void accuracy(const char *name, double height, double smoothing, const double bound[2][3]) {
  int nv = model->nv;
  double *d[3], *reference = scene_vector(nv * nv), *column = scene_vector(nv), worst[2][3] = {{0}};
  for (int which = 0; which < 3; which++) d[which] = scene_vector(nv * nv);
  cav_options usual = state->options;
  state->options.constraint = smoothing > 0;
  state->options.smoothing = state->options.smoothing_self = smoothing;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  for (int k = 0; k < 10; k++) {
    random_state(height);
    state->options.order = (cav_order)(k % 3);
    for (int method = 0; method < 2; method++) {
      int calls = 0;
      CHECK(cav_readout_differentiate(model, state, (cav_derivative)method, 0, q, v, v_next, read_u, &calls, nv, u,
                                      d[0], d[1], d[2]) == CAV_OK);
      CHECK(calls == 1 + 3 * nv * (method + 1));
      CHECK(!memcmp(u, state->u, (size_t)nv * sizeof *u));
      for (int which = 0; which < 3; which++) {
        for (int j = 0; j < nv; j++) {
          reference_column(which, j, column);
          for (int i = 0; i < nv; i++) reference[i * nv + j] = column[i];
        }
        worst[method][which] = fmax(worst[method][which], scene_error(d[which], reference, nv * nv));
      }
    }
  }
  for (int method = 0; method < 2; method++) {
    printf("%-9s %-9s dq %.2g  dv %.2g  dv_next %.2g\n", name, method ? "centred" : "one-sided", worst[method][0],
           worst[method][1], worst[method][2]);
    for (int which = 0; which < 3; which++) CHECK(worst[method][which] <= bound[method][which]);
  }
  state->options = usual;
  for (int which = 0; which < 3; which++) free(d[which]);
  free(reference), free(column);
}

// out of contact du/dv_next = M/h, and a translation of the root changes nothing
static void known_columns(void) {
  int nv = model->nv;
  double *M = scene_vector(nv * nv), *dq = scene_vector(nv * nv), *dn = scene_vector(nv * nv);
  random_state(5);
  for (int i = 0; i < model->njoint; i++) {
    if (model->joint[i].limited) q[model->joint[i].q] = 0.5;
  }
  CHECK(cav_inverse_jacobian(model, state, q, v, v_next, dq, NULL, dn) == CAV_OK);
  CHECK(state->ncontact == 0 && state->nrow == 0);
  cav_inertia(model, state, q, M);
  for (int i = 0; i < nv * nv; i++) {
    // bound: rounding of forces about 1e3 over a step of 1e-6; seen 4e-8 of entries up to 1e4
    CHECK_NEAR(dn[i], M[i] / model->timestep, 1e-6);
  }
  for (int i = 0; i < nv; i++)
    // bound: rounding over a step of 1e-7; seen 4e-9
    for (int j = 0; j < 3; j++) CHECK_NEAR(dq[i * nv + j], 0, 1e-6);
  free(M), free(dq), free(dn);
}

static void failures(void) {
  int nv = model->nv, calls = 0;
  double *d = scene_vector(nv * nv);
  random_state(0);
  v[3] = NAN;
  d[0] = u[0] = 42;
  CHECK(cav_readout_differentiate(model, state, CAV_DERIVATIVE_FORWARD, 0, q, v, v_next, read_u, &calls, nv, u, d, d,
                                  d) == CAV_NOT_FINITE);
  CHECK(d[0] == 42 && u[0] == 42 && calls == 0);
  v[3] = 0;
  CHECK(cav_readout_differentiate(model, state, CAV_DERIVATIVE_FORWARD, -1, q, v, v_next, read_u, &calls, nv, u, d, d,
                                  d) == CAV_BAD_INPUT);
  CHECK(cav_readout_differentiate(model, state, CAV_DERIVATIVE_FORWARD, 0, q, v, v_next, read_u, &calls, 0, NULL, NULL,
                                  NULL, NULL) == CAV_OK);
  free(d);
}

int main(void) {
  model = scene_load(humanlike);
  CHECK(model != NULL);
  if (!model) return check_result();
  state = cav_state_new(model);
  q = scene_vector(model->nq), v = scene_vector(model->nv), v_next = scene_vector(model->nv);
  u = scene_vector(model->nv);
  // bounds: twenty to a hundred times what was seen (printed); one-sided errors are the step times the curvature
  static const double flight[2][3] = {{1e-6, 1e-8, 1e-8}, {1e-8, 1e-11, 1e-11}};
  static const double contact[2][3] = {{1e-4, 1e-4, 1e-5}, {5e-6, 1e-6, 1e-7}};
  accuracy("flight", 5, 0, flight);
  accuracy("smoothed", 0, 0.01, contact);
  known_columns();
  failures();
  cav_state_free(state);
  cav_model_free(model);
  free(q), free(v), free(v_next), free(u);
  return check_result();
}
