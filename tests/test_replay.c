/// Solved motions in MuJoCo, with the contacts of the model's own file: feedforward and gains through MuJoCo's
/// actuators and their limits, at a tenth of the step. All bodies' centres of mass have to end within 5 cm of the plan.
#include "check.h"

#if !defined(CAVORT_HAVE_MUJOCO) || defined(SANITIZED)
int main(void) {
  printf("skipped: built without MuJoCo, or under a sanitizer, which would take half an hour\n");
  return CHECK_SKIPPED;
}
#else
#include <mujoco/mujoco.h>

#include "motion.h"

enum { FINER = 10 };

/// A solved motion and MuJoCo's model of the same file.
typedef struct scene {
  const cav_problem *problem;
  const cav_solution *solution;
  cav_trajectory *motion; ///< at the finer step
  cav_state *state;
  mjModel *theirs;
  mjData *data;
} scene;

/// Largest distance of a body's centre of mass between two configurations.
static double distance(const scene *s, const double *q0, const double *q1, double *place) {
  const cav_model *model = s->problem->model;
  double most = 0;
  CHECK(cav_position(model, s->state, q0) == CAV_OK);
  memcpy(place, s->state->com, 3 * (size_t)model->nlink * sizeof *place);
  CHECK(cav_position(model, s->state, q1) == CAV_OK);
  for (int l = 1; l < model->nlink; l++) {
    const double *a = place + 3 * l, *b = s->state->com + 3 * l;
    most = fmax(most, hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]));
  }
  return most;
}

/// Controls at step i of the finer motion, from MuJoCo's state.
static void control(const scene *s, int i, double *work) {
  const cav_model *model = s->problem->model;
  int nv = model->nv;
  size_t gain = (size_t)(i / FINER) * nv * nv;
  double *dq = work, *u = dq + nv, *effort = u + nv;
  cav_difference(model, s->motion->q + i * model->nq, s->data->qpos, 1, dq);
  for (int a = 0; a < nv; a++) {
    u[a] = s->motion->u[i * nv + a];
    for (int b = 0; b < nv; b++)
      u[a] += s->solution->gain_q[gain + (size_t)(a * nv + b)] * dq[b] +
              s->solution->gain_v[gain + (size_t)(a * nv + b)] * (s->data->qvel[b] - s->motion->v[i * nv + b]);
  }
  CHECK(cav_position(model, s->state, s->data->qpos) == CAV_OK);
  cav_actuation(model, s->state, u, NULL, effort);
  for (int a = 0; a < model->nu; a++) s->data->ctrl[a] = effort[a] / s->theirs->actuator_gainprm[mjNGAIN * a];
}

/// End error, m; forces of the plan and gains only where with is set.
static double follow(const scene *s, int with, double *work) {
  const cav_model *model = s->problem->model;
  mj_resetData(s->theirs, s->data);
  memcpy(s->data->qpos, s->motion->q, (size_t)model->nq * sizeof(double));
  memcpy(s->data->qvel, s->motion->v, (size_t)model->nv * sizeof(double));
  for (int i = 0; i + 1 < s->motion->nknot; i++) {
    if (with) control(s, i, work);
    mj_step(s->theirs, s->data);
  }
  return distance(s, s->motion->q + (s->motion->nknot - 1) * model->nq, s->data->qpos, work);
}

static void check_motion(const motion_case *c) {
  cav_problem *problem = motion_load(c);
  if (!problem) {
    printf("%-14s %-26s not tried: the shared models are absent\n", c->motion, c->model ? c->model : "");
    return;
  }
  cav_error error = {0};
  cav_solution *solution = NULL;
  char text[1000] = "";
  CHECK(cav_solve(problem, NULL, NULL, &solution, &error) == CAV_OK);
  scene s = {.problem = problem, .solution = solution, .state = cav_state_new(problem->model)};
  s.theirs = mj_loadXML(problem->model_path, NULL, text, sizeof text);
  CHECK(s.theirs && s.theirs->nq == problem->model->nq && s.theirs->nu == problem->model->nu);
  if (!s.theirs) fprintf(stderr, "    %s\n", text);
  if (solution && s.theirs) {
    s.motion = cav_trajectory_resample(problem->model, solution->trajectory, solution->trajectory->timestep / FINER);
    s.data = mj_makeData(s.theirs);
    s.theirs->opt.timestep = s.motion->timestep;
    double *work =
        malloc(sizeof(double) * (size_t)(2 * problem->model->nv + problem->model->nu + 3 * problem->model->nlink));
    double end = follow(&s, 1, work), limp = follow(&s, 0, work);
    printf("%-14s %-26s ends %4.0f mm from the plan (without forces %4.0f mm)\n", c->motion, problem->model->name,
           1e3 * end, 1e3 * limp);
    CHECK(end <= 0.05 && limp > 0.3);
    free(work);
    mj_deleteData(s.data);
  }
  if (s.theirs) mj_deleteModel(s.theirs);
  cav_trajectory_free(s.motion);
  cav_state_free(s.state);
  cav_solution_free(solution);
  cav_problem_free(problem);
}

int main(void) {
  static const motion_case cases[] = {{"squat-jump", NULL},
                                      {"walk", NULL},
                                      {"kick", NULL},
                                      {"get-up-back", "mujoco/humanoid.xml"},
                                      {"get-up-back", "dm_control/humanoid.xml"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) check_motion(&cases[i]);
  return check_result();
}
#endif
