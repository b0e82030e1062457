/// The controller of cavort mpc with MuJoCo as the body, at 1 ms in its own contacts: pushed from all sides the humanoid
/// stands, and without the controller's plans, springs alone, it does not. Plans, and what they look ahead over, are ours.
/// Usage: test_mpc_peer [N_S DIRECTIONS [PROBLEM KNOTS SECONDS]]: four of five pushes of 20 N s and less have to be survived.
#include "check.h"

#if !defined(CAVORT_HAVE_MUJOCO) || defined(SANITIZED)
int main(void) {
  printf("skipped: built without MuJoCo, or under a sanitizer\n");
  return CHECK_SKIPPED;
}
#else
#include "replay.h"

enum { PERIOD = 10 };
static const double length = 0.1, start = 0.5;

/// Runs with a push on a body, N s in the direction of an angle; 1 if it stands at the end. plans 0: the first plan for
/// ever.
static int stands(replay *s, const cav_mpc_options *options, double impulse, double angle, double begin, double seconds,
                  int plans, double *strayed) {
  cav_error error = {0};
  cav_mpc *mpc = cav_mpc_new(s->problem, options, s->plan, &error);
  const int body = mj_name2id(s->theirs, mjOBJ_BODY, "torso");
  double input[CAV_USER_DIM_MAX], place[2];
  if (!CHECK(mpc && body >= 0 && s->model->nu <= CAV_USER_DIM_MAX)) return 0;
  mj_resetData(s->theirs, s->data);
  for (int k = 0; k < s->model->nq; k++) s->data->qpos[s->q_at[k]] = s->plan->q[k];
  mj_forward(s->theirs, s->data);
  memcpy(place, s->data->subtree_com + 3 * body, sizeof place);
  *strayed = 0;
  for (int i = 0; i < (int)(1000 * seconds); i++) {
    const double time = i * s->theirs->opt.timestep;
    const int pushed = time > begin - 1e-9 && time < begin + length - 1e-9;
    replay_take(s);
    if (plans && i % PERIOD == 0) CHECK(cav_mpc_plan(mpc, time, s->q, s->v, NULL) == CAV_OK);
    CHECK(cav_mpc_command(mpc, time, s->q, s->v, input, NULL) == CAV_OK);
    for (int a = 0; a < s->model->nu; a++) s->data->ctrl[s->u_at[a]] = input[a];
    s->data->xfrc_applied[6 * body] = pushed ? impulse / length * cos(angle) : 0;
    s->data->xfrc_applied[6 * body + 1] = pushed ? impulse / length * sin(angle) : 0;
    mj_step(s->theirs, s->data);
    const double *com = s->data->subtree_com + 3 * body;
    *strayed = fmax(*strayed, hypot(com[0] - place[0], com[1] - place[1]));
  }
  cav_mpc_free(mpc);
  return s->data->xpos[3 * body + 2] > 0.8 * s->problem->q_goal[2];
}

int main(int argc, char **argv) {
  const double impulse = argc > 1 ? atof(argv[1]) : 20;
  const int directions = argc > 2 ? atoi(argv[2]) : 5, knots = argc > 5 ? atoi(argv[4]) : 0;
  const double seconds = argc > 5 ? atof(argv[5]) : 3;
  const char *path = argc > 5 ? argv[3] : CAVORT_SOURCE_ROOT "/problems/mpc/stand.xml";
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  if (!CHECK(problem != NULL)) return check_result();
  cav_mpc_options options = cav_mpc_options_default();
  options.delay = PERIOD * options.timestep;
  options.knots = knots;
  cav_mpc *first = cav_mpc_new(problem, &options, NULL, &error);
  replay s = {.problem = problem, .plan = first ? cav_mpc_trajectory(first, NULL) : NULL};
  if (CHECK(s.plan) && replay_open(&s, path)) {
    s.theirs->opt.timestep = options.timestep;
    double strayed = 0;
    int survived = 0;
    for (int i = 0; i < directions; i++) {
      const double angle = 2 * 3.14159265358979 * i / directions;
      const int one = stands(&s, &options, impulse, angle, start + 0.0137 * i, seconds, 1, &strayed);
      printf("%g N s, %.0f degrees: %s, strayed %.3f m\n", impulse, 360.0 * i / directions, one ? "stands" : "falls",
             strayed);
      survived += one;
    }
    printf("stands after %d of %d\n", survived, directions);
    CHECK(impulse > 20 || 5 * survived >= 4 * directions);
    CHECK(!stands(&s, &options, impulse, 0, start, seconds, 0, &strayed));
  }
  replay_close(&s);
  cav_mpc_free(first);
  cav_problem_free(problem);
  return check_result();
}
#endif
