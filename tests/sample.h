/// Motions made by hand for the verifier: a model from a text, a problem without costs, knots that tests write. Bounds of 1e-11
/// and 1e-12 are on fractions of weight, metres and radians of order one or less: rounding of positions of a metre over
/// h^2 = 4e-4 s^2 is 1e-13 of g. Seen: 6e-13 in forces, 9e-15 in momentum, 3e-15 in the others.
#ifndef CAVORT_TESTS_SAMPLE_H
#define CAVORT_TESTS_SAMPLE_H

#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"

#define HEAD "<mujoco><compiler angle='radian'/><option timestep='0.02'/><worldbody>"

static const char *const flying = HEAD
    "<body name='ball' pos='0 0 1'><freejoint name='root'/><geom name='skin' type='sphere' size='0.1' mass='2'/></body>"
    "</worldbody></mujoco>";

/// A case: model, problem, motion
typedef struct sample {
  cav_model *model;
  cav_problem problem;
  cav_trajectory *motion;
  cav_options law;
  double *q, *v;
  cav_verdict verdict;
} sample;

static inline cav_model *model_of(const char *text) {
  const char *folder = getenv("TMPDIR");
  char path[4096];
  snprintf(path, sizeof path, "%.4000s/cavort-verify-XXXXXX", folder ? folder : "/tmp");
  int descriptor = mkstemp(path);
  if (descriptor < 0) return NULL;
  FILE *file = fdopen(descriptor, "w");
  fputs(text, file);
  fclose(file);
  cav_error error = {0};
  cav_model *model = cav_model_load(path, &error);
  if (!model) fprintf(stderr, "%s\n", error.text);
  unlink(path);
  return model;
}

// knots copies of the file's posture at rest, claimed under the exact law and the given order
static inline sample sample_new(const char *text, int last, double h, cav_order order) {
  sample s = {.model = model_of(text)};
  CHECK(s.model != NULL);
  if (!s.model) exit(check_result());
  s.motion = cav_trajectory_new(s.model, last + 1, h);
  s.q = calloc((size_t)s.model->nq, sizeof(double));
  s.v = calloc((size_t)s.model->nv, sizeof(double));
  cav_configuration_reset(s.model, s.q);
  s.problem = (cav_problem){.name = "sample",
                            .model = s.model,
                            .duration = last * h,
                            .timestep = h,
                            .order = order,
                            .q_start = s.q,
                            .v_start = s.v,
                            .effort_limit = 1};
  s.law = s.model->options;
  s.law.order = order;
  s.law.timestep = h;
  s.law.stabilisation = CAV_STABILISATION_DISCRETE;
  s.law.softness = 0.01;
  return s;
}

static inline void sample_free(sample *s) {
  cav_trajectory_free(s->motion);
  cav_model_free(s->model);
  free(s->q);
  free(s->v);
}

static inline cav_status verify(sample *s, const double *gain_q, const double *gain_v) {
  cav_error error = {0};
  s->verdict = (cav_verdict){0};
  cav_status status = cav_verify(&s->problem, s->motion, &s->law, gain_q, gain_v, &s->verdict, &error);
  if (status != CAV_OK) fprintf(stderr, "%s\n", error.text);
  return status;
}

static inline double *knot(sample *s, int t) { return s->motion->q + t * s->motion->nq; }

// knots from the start under no force but the model's own
static inline void let_go(sample *s) {
  int nv = s->model->nv;
  cav_state *state = cav_state_new(s->model);
  double *v = calloc((size_t)(3 * nv), sizeof *v), *next = v + nv, *none = next + nv;
  state->options = s->law;
  state->options.timestep = s->motion->timestep;
  memcpy(v, s->v, sizeof(double) * nv);
  memcpy(knot(s, 0), s->q, sizeof(double) * s->model->nq);
  for (int t = 0; t + 1 < s->motion->nknot; t++) {
    cav_forward_report report;
    CHECK(cav_forward_newton(s->model, state, knot(s, t), v, none, 100, 1e-13, next, &report) == CAV_OK ||
          report.residual < 1e-10);
    cav_integrate(s->model, knot(s, t), next, s->motion->timestep, knot(s, t + 1));
    memcpy(v, next, sizeof(double) * nv);
  }
  free(v);
  cav_state_free(state);
}

// an exact discrete parabola with a constant spin
static inline void fly(sample *s) {
  double v[6] = {0.5, -0.2, 3, 1, 2, -1}, h = s->motion->timestep;
  memcpy(s->v, v, sizeof v);
  memcpy(knot(s, 0), s->q, sizeof(double) * 7);
  for (int t = 0; t + 1 < s->motion->nknot; t++) {
    v[2] -= h * 9.81;
    cav_integrate(s->model, knot(s, t), v, h, knot(s, t + 1));
  }
}

#endif
