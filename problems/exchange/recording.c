/// A motion sampled at a rate: between knots along the curves of cav_trajectory_resample, controls and contacts held as a
/// step holds them. Of a cycle one stride, mirrored ones both parts of the stride.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "exchange.h"
#include "file.h"
#include "periodicity.h"

#define RULE(id, word, file, text) {#word, file, text, cav_exchange_write_##word},
static const cav_exchange_rule rules[] = {CAV_EXCHANGES(RULE)};

const cav_exchange_rule *cav_exchange_rule_of(cav_exchange format) { return &rules[format]; }

static cav_status no_memory(cav_error *error) {
  return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the motion");
}

// the motion at its knots
static cav_trajectory *whole(const cav_result *result, cav_error *error) {
  cav_trajectory *motion = NULL;
  cav_periodicity *periodicity = NULL;
  if (!result->problem->cycle.on || result->problem->cycle.mirror == CAV_MIRROR_NONE) {
    motion = cav_trajectory_copy(result->trajectory);
  } else {
    if (!(periodicity = cav_periodicity_new(result->problem, error))) return NULL;
    motion = cav_periodicity_unroll(periodicity, result->trajectory, 2);
  }
  cav_periodicity_free(periodicity);
  if (!motion) no_memory(error);
  return motion;
}

cav_status cav_recording_open(cav_recording *r, const cav_result *result, double rate, cav_error *error) {
  const cav_problem *p = result->problem;
  *r = (cav_recording){.result = result, .problem = p, .model = p->model};
  cav_trajectory *knots = whole(result, error);
  if (!knots) return error->status;
  int last_rests = p->close_at_rest && !p->cycle.on, forced = last_rests ? knots->nknot : knots->nknot - 1;
  double duration = knots->timestep * (knots->nknot - 1);
  r->timestep = rate > 0 ? 1 / rate : knots->timestep;
  cav_status status = CAV_OK;
  if (rate > 0 && duration * rate < 0.5)
    status = cav_file_fail(error, CAV_BAD_INPUT, 0, "--rate: %g samples a second leave one of a motion of %g s", rate,
                           duration);
  if (!status && !(r->forces = cav_forces_new(p->model, knots, &p->contact, last_rests, error))) status = error->status;
  if (!status) {
    r->motion = rate > 0 ? cav_trajectory_resample(p->model, knots, r->timestep) : cav_trajectory_copy(knots);
    r->n = r->motion ? r->motion->nknot : 0;
    r->knot = calloc((size_t)r->n + 1, sizeof *r->knot);
    if (!r->motion || !r->knot) status = no_memory(error);
  }
  for (int i = 0; i < r->n && !status; i++) {
    // a sample at a knot belongs to the step that leaves it
    r->knot[i] = (int)fmin(floor(i * r->timestep / knots->timestep + 1e-6), forced - 1);
    memcpy(r->motion->u + (size_t)i * (size_t)p->model->nv, r->forces->u + r->knot[i] * p->model->nv,
           (size_t)p->model->nv * sizeof(double));
  }
  cav_trajectory_free(knots);
  if (status) cav_recording_close(r);
  return status;
}

void cav_recording_close(cav_recording *r) {
  cav_trajectory_free(r->motion);
  if (r->forces) cav_forces_free(r->forces);
  free(r->knot);
  *r = (cav_recording){0};
}

cav_pose *cav_recording_poses(const cav_recording *r, cav_error *error) {
  size_t n = (size_t)r->model->nlink;
  cav_pose *pose = malloc((size_t)r->n * n * sizeof *pose);
  cav_state *state = cav_state_new(r->model);
  cav_status status = pose && state ? CAV_OK : no_memory(error);
  // poses alone
  if (state) state->options.contact = 0;
  for (int i = 0; i < r->n && !status; i++) {
    status = cav_position(r->model, state, r->motion->q + (size_t)i * (size_t)r->model->nq);
    if (status) cav_file_fail(error, status, 0, "sample %d has no poses (%s)", i, cav_status_name(status));
    if (!status) memcpy(pose + (size_t)i * n, state->link, n * sizeof *pose);
  }
  cav_state_free(state);
  if (!status) return pose;
  free(pose);
  return NULL;
}

const char *cav_recording_body_name(const cav_model *model, int body, char label[96]) {
  if (*model->body[body].name)
    snprintf(label, 96, "%.90s", model->body[body].name);
  else
    snprintf(label, 96, body ? "body %d" : "world", body);
  return label;
}
