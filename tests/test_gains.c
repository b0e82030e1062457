/// The choice of gains against its rule, on closed loops whose outcomes are drawn: what is kept is what a look at every loop
/// of every trial would keep, the search ends where the rule says, and few loops are run for it.
#include "lqr.h"
#include "rollout.h"
#include "scene.h"
#include "verification.h"

enum { TRIALS = 120, UNHELD = 64, PLAIN = 40, ROLLED = 12, FEW = 3 };
/// s: of the motion.
static const double duration = 0.2;

static const char cart[] =
    "<mujoco><option gravity='0 0 0'/><worldbody>"
    "<body><joint name='x' type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='2'/></body></worldbody>"
    "<actuator><motor joint='x' gear='5' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

/// What each loop of each trial does, of which trial it is the turn, and loops run.
static struct cav_follow drawn[TRIALS + 1][CAV_LOOPS];
static int trial, run;

cav_status __wrap_cav_closed_loop(const cav_verification *verification, int loop, const double *gain_q,
                                  const double *gain_v, cav_before *before, struct cav_follow *follow);
cav_status __wrap_cav_closed_loop(const cav_verification *verification, int loop, const double *gain_q,
                                  const double *gain_v, cav_before *before, struct cav_follow *follow) {
  (void)verification, (void)gain_v, (void)before;
  // what is kept tells its trial
  *(double *)gain_q = trial;
  run++;
  *follow = drawn[trial][loop];
  return CAV_OK;
}

/// How far a forward step from a knot ends from the next one.
static double apart;

cav_status __wrap_cav_replay_steps(const cav_verification *verification, cav_replay *replay);
cav_status __wrap_cav_replay_steps(const cav_verification *verification, cav_replay *replay) {
  (void)verification;
  replay->step_error = apart;
  return CAV_OK;
}

/// Gains put together, which are told by this number, and of how many sets; what their loops do is drawn.
enum { TOGETHER = TRIALS };
static int together;

cav_status __real_cav_rollout(const cav_transcription *tr, const cav_verification *verification, int sets,
                              const double *const *set, double *gain);
cav_status __wrap_cav_rollout(const cav_transcription *tr, const cav_verification *verification, int sets,
                              const double *const *set, double *gain);
cav_status __wrap_cav_rollout(const cav_transcription *tr, const cav_verification *verification, int sets,
                              const double *const *set, double *gain) {
  (void)tr, (void)verification;
  // the gains of each set are its own
  for (int k = 0; k < sets; k++) CHECK((int)*set[k] == k);
  (void)gain;
  together = sets, trial = TOGETHER;
  return CAV_OK;
}

/// Sets that are told to be tried at most.
static int all_sets = TRIALS;

static int next(void *context, int set, int most) {
  (void)context;
  CHECK(most == all_sets);
  trial = set - 1;
  return 0;
}

/// A pole that stands on a motor, held by one regulator in the first half and by another in the second; in the other half each
/// throws it over.
static void test_pole(void) {
  static const char pole[] =
      "<mujoco><worldbody><body><joint name='x' type='hinge' axis='0 1 0'/><geom type='capsule' fromto='0 0 0 0 0 1' "
      "size='.05' "
      "mass='1' contype='0' conaffinity='0'/></body></worldbody><actuator><motor joint='x'/></actuator></mujoco>";
  cav_model *model = scene_load(pole);
  cav_problem problem = cav_problem_default(model);
  double still = 0;
  problem.timestep = 0.02, problem.duration = 2;
  problem.q_start = problem.q_goal = (double *)model->q0;
  problem.v_start = &still;
  cav_transcription *tr = cav_transcription_new(&problem, 1, NULL);
  cav_trajectory *motion = cav_trajectory_new(model, tr->nknot, problem.timestep);
  cav_verification v;
  CHECK(cav_closed_loops_begin(&v, &problem, motion, &tr->options, NULL) == CAV_OK);
  const int last = v.last;
  double *gain = calloc(3 * 2 * (size_t)last, sizeof *gain);
  const double *set[] = {gain, gain + 2 * last};
  double *rolled = gain + 4 * last;
  for (int t = 0; t < last; t++)
    for (int k = 0; k < 2; k++) {
      const double way = (2 * t < last) == (k == 0) ? -1 : 1;
      gain[2 * last * k + t] = 60 * way, gain[2 * last * k + last + t] = 15 * way;
    }
  CHECK(__real_cav_rollout(tr, &v, 2, set, rolled) == CAV_OK);
  for (int k = 0; k < 3; k++) {
    double strayed = 0;
    const double *one = k < 2 ? set[k] : rolled;
    cav_lane *lane = cav_lane_own(&v, 0, 1);
    CHECK(lane && cav_lane_run(&v, lane, one, one + last, 0, last, &strayed) == CAV_OK);
    printf("pole held by %s: %.3g of what loses it\n", k == 0 ? "the first" : k == 1 ? "the second" : "both", strayed);
    CHECK(k < 2 ? strayed >= 1 : strayed < 1e-6);
    cav_lane_free(lane);
  }
  free(gain);
  cav_verification_end(&v);
  cav_trajectory_free(motion);
  cav_transcription_free(tr);
  cav_model_free(model);
}

static double chance(void) { return 0.5 + 0.5 * scene_uniform(); }

static void draw(double lost, double far) {
  for (int i = 0; i <= TOGETHER; i++)
    for (int k = 0; k < CAV_LOOPS; k++) {
      struct cav_follow *f = &drawn[i][k];
      *f = (struct cav_follow){.seconds = duration, .error = far * chance()};
      // a few values, so that some are equal
      if (chance() < lost)
        f->seconds = 0.1 * duration * floor(10 * chance()), snprintf(f->lost, sizeof f->lost, "lost");
    }
}

/// Follows, seconds of the next loop, worst end: of all loops in their order.
static void outcome(int i, int *follows, double *seconds, double *error) {
  *error = 0;
  *seconds = 0;
  for (*follows = 0; *follows < CAV_LOOPS; ++*follows) {
    const struct cav_follow *f = &drawn[i][*follows];
    *seconds = f->seconds;
    if (*f->lost) return;
    *error = fmax(*error, f->error * (*follows < CAV_LOOP_START ? 1 : 0.25));
  }
}

/// The trial that the rule keeps, and how many sets it takes; *ends: 1 where it ends with the ones put together.
static int expected(int *trials, int *ends) {
  int best = -1, follows = 0;
  double seconds = 0, error = 0;
  for (*trials = 1; *trials <= TRIALS; ++*trials)
    for (*ends = 0; *ends < (*trials == ROLLED ? 2 : 1); ++*ends) {
      int f;
      double s, e;
      const int now = *ends ? TOGETHER : *trials - 1;
      outcome(now, &f, &s, &e);
      if (best < 0 || f > follows || (f == follows && (f < CAV_LOOPS ? s > seconds : e < error)))
        best = now, follows = f, seconds = s, error = e;
      // what no set follows from its own start
      if (*trials >= (seconds < 0.85 * duration ? PLAIN : UNHELD) && follows == CAV_LOOP_OWN) return best;
      if (follows < (*trials <= FEW ? CAV_LOOPS : CAV_LOOP_PUSHED)) continue;
      if (error <= 0.05 + 0.03 * (*trials - 1)) return best;
    }
  *trials = TRIALS, *ends = 0;
  return best;
}

int main(void) {
  test_pole();
  cav_model *model = scene_load(cart);
  cav_problem problem = cav_problem_default(model);
  double still = 0;
  problem.timestep = 0.02;
  problem.duration = duration;
  problem.q_start = problem.q_goal = (double *)model->q0;
  problem.v_start = &still;
  cav_transcription *tr = cav_transcription_new(&problem, 1, NULL);
  cav_trajectory *motion = cav_trajectory_new(model, tr->nknot, problem.timestep);
  for (int k = 0; k < 300; k++) {
    int trials, ends, whole = 0;
    if (k == 0)
      draw(0, 0.05);
    else
      draw(0.02 * (k % 20), k % 3 ? 0.5 : 2);
    const int best = expected(&trials, &ends);
    const int rolls = trials > ROLLED || ends;
    for (int i = 0; i < trials + rolls; i++) {
      int follows;
      double seconds, error;
      outcome(i < trials ? i : TOGETHER, &follows, &seconds, &error);
      whole += follows < CAV_LOOPS ? follows + 1 : CAV_LOOPS;
    }
    cav_solution solution = {.contact = tr->options};
    cav_error error = {0};
    int follows, first;
    double seconds, off;
    run = together = 0;
    CHECK(cav_choose_gains(&problem, tr, motion, 0, next, NULL, &solution, &follows, &error) == CAV_OK);
    outcome(best, &first, &seconds, &off);
    CHECK(follows == (first >= CAV_LOOP_START));
    CHECK(trial == (ends ? TOGETHER : trials - 1) && together == (rolls ? ROLLED : 0));
    if (CHECK(solution.gain_q)) CHECK((int)*solution.gain_q == best);
    // a loop out of its order is one more at most
    CHECK(run <= whole + trials + rolls);
    // where the first set serves, each loop once
    if (k == 0) CHECK(trials == 1 && run == CAV_LOOPS);
    cav_gains_free(&solution);
  }
  // where the last loop alone is lost, the next sets begin there
  draw(0, 0.15);
  for (int i = 0; i < TRIALS; i++) drawn[i][CAV_LOOP_PUSHED_BACK] = (struct cav_follow){.lost = "lost"};
  for (int k = 0; k < CAV_LOOP_START; k++) drawn[0][k].error = 0.04;
  cav_solution solution = {.contact = tr->options};
  run = 0;
  CHECK(cav_choose_gains(&problem, tr, motion, 0, next, NULL, &solution, NULL, NULL) == CAV_OK);
  CHECK(trial == FEW && run == CAV_LOOPS + FEW);
  cav_gains_free(&solution);
  // what is lost from its own start is left, the sooner the earlier it is lost, unless a set follows it
  static const struct {
    double part; // of the duration until it is lost
    int held;    // trial from which on it is followed from its own start, and lost at the finer step
    int trials;
  } lost[] = {{0.8, TRIALS, PLAIN}, {0.9, TRIALS, UNHELD}, {0.9, PLAIN + 10, TRIALS}, {0.8, PLAIN + 10, PLAIN}};
  for (size_t n = 0; n < sizeof lost / sizeof *lost; n++) {
    for (int i = 0; i <= TOGETHER; i++)
      for (int k = 0; k < CAV_LOOPS; k++)
        drawn[i][k] = (struct cav_follow){.seconds = lost[n].part * duration, .lost = "lost"};
    for (int i = lost[n].held; i < TRIALS; i++) *drawn[i][CAV_LOOP_OWN].lost = 0;
    solution = (cav_solution){.contact = tr->options};
    CHECK(cav_choose_gains(&problem, tr, motion, 0, next, NULL, &solution, NULL, NULL) == CAV_OK);
    CHECK(trial == lost[n].trials - 1);
    cav_gains_free(&solution);
  }
  // what ends 0.12 m away is near enough once three others were no nearer
  for (int i = 0; i < TRIALS; i++)
    for (int k = 0; k < CAV_LOOPS; k++) drawn[i][k] = (struct cav_follow){.seconds = 1, .error = 0.12};
  solution = (cav_solution){.contact = tr->options};
  run = 0;
  CHECK(cav_choose_gains(&problem, tr, motion, 0, next, NULL, &solution, NULL, NULL) == CAV_OK);
  CHECK(trial == FEW && run == CAV_LOOPS + FEW && (int)*solution.gain_q == 0);
  cav_gains_free(&solution);
  // a motion that does not go on from a knot as planned has one set, unless it is not at its end yet
  draw(1, 1);
  apart = 2 * CAV_TOLERANCE_STEP;
  for (int early = 0; early < 2; early++) {
    int follows;
    all_sets = early ? TRIALS : 1;
    solution = (cav_solution){.contact = tr->options};
    CHECK(cav_choose_gains(&problem, tr, motion, 0, next, NULL, &solution, early ? &follows : NULL, NULL) == CAV_OK);
    CHECK(solution.gain_q && (early ? trial > 0 : trial == 0));
    cav_gains_free(&solution);
  }
  cav_trajectory_free(motion);
  cav_transcription_free(tr);
  cav_model_free(model);
  return check_result();
}
