/// Model-predictive control against what is known: on a linear system with square costs and a long horizon its first
/// force is the linear-quadratic regulator's, whose gains are found here from the step itself by iterating Riccati's
/// equation; parts of a knot and delays move plans as their motion says; and what is refused.
#include "cavort/cavort.h"
#include "linear_step.h"
#include "scene.h"

enum { N = 2, S = 2 * N };
static double begin[S] = {0.4, -0.7, 1.1, 0.3};
static const double step = 0.02, weight_q = 40, weight_v = 1.5, weight_u = 0.2;

/// A problem of that model with running costs alone.
static cav_problem problem_of(const cav_model *m, cav_term term[3], double duration) {
  cav_problem p = cav_problem_default(m);
  static double goal[N];
  term[0] = cav_term_cost(CAV_QUANTITY_CONFIGURATION, weight_q);
  term[1] = cav_term_cost(CAV_QUANTITY_VELOCITY, weight_v);
  term[2] = cav_term_cost(CAV_QUANTITY_EFFORT, weight_u);
  term[1].dofs = CAV_DOFS_ALL;
  p.name = "masses";
  p.duration = duration, p.timestep = step;
  p.q_start = begin, p.v_start = begin + N, p.q_goal = goal;
  p.term = term, p.nterm = 3;
  return p;
}

/// Gains K [N*S] and cost matrix P [S*S] of the regulator: cost h/2 (wq q'q + wv v'v + wu u'u) a step, for ever.
static void regulate(double A[S][S], double B[S][N], double K[N][S], double P[S][S]) {
  memset(P, 0, sizeof(double) * S * S);
  for (int round = 0; round < 4000; round++) {
    double PA[S][S] = {{0}}, PB[S][N] = {{0}}, H[N][N] = {{0}}, G[N][S] = {{0}}, Q[S][S] = {{0}};
    for (int i = 0; i < S; i++)
      for (int k = 0; k < S; k++) {
        for (int j = 0; j < S; j++) PA[i][j] += P[i][k] * A[k][j];
        for (int j = 0; j < N; j++) PB[i][j] += P[i][k] * B[k][j];
      }
    for (int k = 0; k < S; k++)
      for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) H[i][j] += B[k][i] * PB[k][j];
        for (int j = 0; j < S; j++) G[i][j] += B[k][i] * PA[k][j];
      }
    for (int i = 0; i < N; i++) H[i][i] += step * weight_u;
    const double det = H[0][0] * H[1][1] - H[0][1] * H[1][0];
    for (int j = 0; j < S; j++) {
      K[0][j] = (H[1][1] * G[0][j] - H[0][1] * G[1][j]) / det;
      K[1][j] = (H[0][0] * G[1][j] - H[1][0] * G[0][j]) / det;
    }
    for (int i = 0; i < S; i++)
      for (int j = 0; j < S; j++) {
        Q[i][j] = i == j ? step * (i < N ? weight_q : weight_v) : 0;
        for (int k = 0; k < S; k++) Q[i][j] += A[k][i] * PA[k][j];
        for (int k = 0; k < N; k++) Q[i][j] -= G[k][i] * K[k][j];
      }
    memcpy(P, Q, sizeof Q);
  }
}

/// The controller's first force is the regulator's, and so is the closed loop, step by step.
static void test_regulator(const cav_model *m, cav_order order) {
  cav_term term[3];
  cav_problem p = problem_of(m, term, 12);
  cav_error error = {0};
  cav_state *s = cav_state_new(m);
  if (!CHECK(s != NULL)) return;
  p.order = order;
  s->options.timestep = step;
  s->options.order = order;
  double A[S][S], B[S][N], K[N][S], P[S][S];
  linear_map(m, s, step, &A[0][0], &B[0][0]);
  regulate(A, B, K, P);
  cav_mpc_options o = cav_mpc_options_default();
  o.iterations = 1;
  o.stiffness = 0;
  cav_mpc *mpc = cav_mpc_new(&p, &o, NULL, &error);
  if (!CHECK(mpc != NULL)) return;
  double x[S], worst = 0, most = 0, cost = 0, whole = 0;
  memcpy(x, begin, sizeof x);
  for (int i = 0; i < S; i++)
    for (int j = 0; j < S; j++) whole += 0.5 * x[i] * P[i][j] * x[j];
  for (int t = 0; t < 300; t++) {
    double u[N], next[S];
    CHECK(cav_mpc_plan(mpc, t * step, x, x + N, NULL) == CAV_OK);
    CHECK(cav_mpc_command(mpc, t * step, x, x + N, NULL, u) == CAV_OK);
    for (int i = 0; i < N; i++) {
      double wanted = 0;
      for (int j = 0; j < S; j++) wanted -= K[i][j] * x[j];
      worst = fmax(worst, fabs(u[i] - wanted));
      most = fmax(most, fabs(wanted));
      cost += 0.5 * step * (weight_q * x[i] * x[i] + weight_v * x[N + i] * x[N + i] + weight_u * u[i] * u[i]);
    }
    linear_step(m, s, step, x, u, next);
    memcpy(x, next, sizeof x);
  }
  printf("order %d: largest difference from the regulator's force %.1e of %.3g N, cost %.9g, the regulator's %.9g\n",
         (int)order, worst, most, cost, whole);
  CHECK(worst < 1e-6 * most);
  CHECK_NEAR(cost, whole, 1e-6 * whole);
  cav_mpc_free(mpc);
  cav_state_free(s);
}

/// Cost of three seconds at 1 ms, planned anew every 50 ms. behind: plans are made from the state one period before.
static double run(const cav_problem *p, const cav_mpc_options *o, int behind) {
  cav_error error = {0};
  cav_state *s = cav_state_new(p->model);
  cav_mpc *mpc = cav_mpc_new(p, o, NULL, &error);
  double q[N], v[N], u[N], next[N], old[S], cost = 0;
  memcpy(q, begin, sizeof q), memcpy(v, begin + N, sizeof v), memcpy(old, begin, sizeof old);
  for (int i = 0; CHECK(s && mpc) && i < 3000; i++) {
    if (i % 50 == 0) {
      CHECK(cav_mpc_plan(mpc, i * 0.001, behind ? old : q, behind ? old + N : v, NULL) == CAV_OK);
      memcpy(old, q, sizeof q), memcpy(old + N, v, sizeof v);
    }
    CHECK(cav_mpc_command(mpc, i * 0.001, q, v, NULL, u) == CAV_OK);
    CHECK(cav_forward(p->model, s, q, v, u, next) == CAV_OK);
    memcpy(v, next, sizeof v);
    cav_integrate(p->model, q, v, 0.001, q);
    for (int d = 0; d < N; d++)
      cost += 0.0005 * (weight_q * q[d] * q[d] + weight_v * v[d] * v[d] + weight_u * u[d] * u[d]);
  }
  cav_mpc_free(mpc);
  cav_state_free(s);
  return cost;
}

/// A delay that is looked ahead over costs nothing, one that is not does; springs to the plan cost little.
static void test_delay(const cav_model *m) {
  cav_term term[3];
  cav_problem p = problem_of(m, term, 4);
  cav_mpc_options o = cav_mpc_options_default();
  const double springs = run(&p, &o, 0);
  o.stiffness = 0;
  const double once = run(&p, &o, 0), behind = run(&p, &o, 1);
  o.delay = 0.05;
  const double ahead = run(&p, &o, 0);
  printf("cost at once %.4f (springs %.4f), with a delay looked ahead over %.4f, with one that is not %.4f\n", once,
         springs, ahead, behind);
  CHECK_NEAR(ahead, once, 1e-4 * once);
  CHECK(behind > 1.02 * once);
  CHECK(springs < 1.1 * once);
}

/// A plan that is moved by parts of a knot is that of its motion: quarters of a knot, four times, are a knot.
static void test_parts(const cav_model *m) {
  cav_term term[3];
  cav_problem p = problem_of(m, term, 1);
  cav_error error = {0};
  cav_solve_options options = cav_solve_options_default();
  cav_optimiser *o = cav_optimiser_new(&p, &options, NULL, &error);
  if (!CHECK(o != NULL)) return;
  CHECK(cav_optimiser_solve(o, 1, NULL, &error) == CAV_OK);
  cav_trajectory *before = cav_trajectory_copy(cav_optimiser_trajectory(o));
  const cav_trajectory *at = cav_optimiser_trajectory(o);
  CHECK(cav_optimiser_shift(o, 2.25, NULL, NULL) == CAV_OK);
  for (int t = 0; t + 3 < at->nknot; t++)
    for (int d = 0; d < N; d++)
      CHECK_NEAR(at->q[t * N + d], 0.75 * before->q[(t + 2) * N + d] + 0.25 * before->q[(t + 3) * N + d], 1e-12);
  for (int d = 0; d < N; d++) CHECK_NEAR(at->v[d], 0.75 * before->v[2 * N + d] + 0.25 * before->v[3 * N + d], 1e-12);
  CHECK(!memcmp(at->q + (at->nknot - 1) * N, before->q + (at->nknot - 1) * N, N * sizeof(double)));
  CHECK(cav_optimiser_shift(o, -0.25, NULL, NULL) == CAV_BAD_INPUT);
  CHECK(cav_optimiser_shift(o, NAN, NULL, NULL) == CAV_BAD_INPUT);
  CHECK(cav_optimiser_shift(o, at->nknot - 1.5, NULL, NULL) == CAV_BAD_INPUT);
  cav_trajectory_free(before);
  cav_optimiser_free(o);
}

/// Targets that move: after a shift of five knots the optimum is that of a problem whose waypoints come five knots sooner.
static void test_targets(const cav_model *m) {
  enum { SHIFT = 5, POINTS = 3 };
  cav_term term[3];
  cav_problem p = problem_of(m, term, 1);
  cav_error error = {0};
  cav_solve_options options = cav_solve_options_default();
  double way[POINTS] = {0.1, 0.5, 0.9}, sooner[POINTS], place[POINTS * N] = {0, 0, 1, -1, -0.5, 2}, most[2] = {0};
  for (int i = 0; i < POINTS; i++) sooner[i] = way[i] - SHIFT * step;
  term[0].target = place, term[0].nwaypoint = POINTS, term[0].waypoint_time = way;
  for (int moving = 0; moving < 2; moving++) {
    options.moving_targets = moving;
    term[0].waypoint_time = way;
    cav_optimiser *o = cav_optimiser_new(&p, &options, NULL, &error);
    if (!CHECK(o != NULL)) return;
    CHECK(cav_optimiser_shift(o, SHIFT, begin, begin + N) == CAV_OK);
    CHECK(cav_optimiser_solve(o, 1, NULL, &error) == CAV_OK);
    term[0].waypoint_time = sooner;
    cav_optimiser *other = cav_optimiser_new(&p, &options, NULL, &error);
    if (!CHECK(other != NULL)) return;
    CHECK(cav_optimiser_solve(other, 1, NULL, &error) == CAV_OK);
    const cav_trajectory *a = cav_optimiser_trajectory(o), *b = cav_optimiser_trajectory(other);
    for (int i = 0; i < a->nknot * N; i++) most[moving] = fmax(most[moving], fabs(a->q[i] - b->q[i]));
    cav_optimiser_free(o);
    cav_optimiser_free(other);
  }
  printf("targets: %.1e apart where they move, %.2g where they do not\n", most[1], most[0]);
  CHECK(most[1] < 1e-6 && most[0] > 0.05);
}

/// A cart whose motor gives 12 N: its pole falls without plans, and comes back up with them after a push that the motor
/// cannot undo at once. Controls stay within their limits.
static void test_pole(void) {
  static const char text[] =
      "<mujoco model='pole'><option timestep='.001'/><worldbody><body><joint name='cart' type='slide' axis='1 0 0' "
      "damping='.1'/><geom size='.1' mass='1' contype='0' conaffinity='0'/><body><joint name='pole' axis='0 1 0'/>"
      "<geom type='capsule' size='.02' fromto='0 0 0 0 0 .8' mass='.3' contype='0' conaffinity='0'/></body></body>"
      "</worldbody><actuator><motor joint='cart' gear='12' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
  cav_error error = {0};
  cav_model *m = cav_model_parse(text, NULL, NULL, &error);
  if (!CHECK(m != NULL)) return;
  double zero[S] = {0}, tilt[2], most = 0;
  cav_term term[3];
  cav_problem p = problem_of(m, term, 1);
  p.q_start = p.q_goal = zero, p.v_start = zero + N;
  cav_mpc_options o = cav_mpc_options_default();
  o.delay = 0.02;
  // the one joint that is driven has no plan of its own to go back to: the pole's is what counts
  o.stiffness = 0;
  for (int plans = 0; plans < 2; plans++) {
    cav_mpc *mpc = cav_mpc_new(&p, &o, NULL, &error);
    cav_state *s = cav_state_new(m);
    double q[N] = {0}, v[N] = {0}, u[N], next[N], input;
    for (int i = 0; CHECK(s && mpc) && i < 5000; i++) {
      if (plans && i % 20 == 0) CHECK(cav_mpc_plan(mpc, i * 0.001, q, v, NULL) == CAV_OK);
      CHECK(cav_mpc_command(mpc, i * 0.001, q, v, &input, u) == CAV_OK);
      most = fmax(most, fabs(input));
      // 0.1 N m s on the pole
      if (i >= 500 && i < 600) u[1] += 1;
      CHECK(cav_forward(m, s, q, v, u, next) == CAV_OK);
      memcpy(v, next, sizeof v);
      cav_integrate(m, q, v, 0.001, q);
    }
    tilt[plans] = fabs(q[1]);
    if (plans) CHECK(fabs(q[0]) < 0.05 && fabs(v[0]) < 0.05);
    cav_mpc_free(mpc);
    cav_state_free(s);
  }
  printf("pole: %.1e rad off with plans, %.1f without, largest control %.2f\n", tilt[1], tilt[0], most);
  CHECK(tilt[1] < 0.01 && tilt[0] > 1 && most <= 1);
  cav_model_free(m);
}

/// A light hub that turns freely and drives a heavy arm: springs on what the joint carries, a hundred times what moves when it
/// pushes, would turn its velocity around every millisecond. Torques die out.
static void test_hub(void) {
  static const char text[] =
      "<mujoco model='hub'><option gravity='0 0 0' timestep='.001'/><worldbody><body><joint name='hub' axis='0 1 0'/>"
      "<inertial pos='0 0 0' mass='1' diaginertia='.01 .01 .01'/><body><joint name='arm' axis='0 1 0'/>"
      "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></body></worldbody>"
      "<actuator><motor joint='arm' ctrllimited='true' ctrlrange='-50 50'/></actuator></mujoco>";
  cav_error error = {0};
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  double zero[S] = {0}, q[N] = {0}, v[N] = {0, 0.1}, u[N], next[N], before = 0, change = 0, most = 0;
  cav_term term[3];
  cav_problem p = problem_of(m, term, 1);
  p.q_start = p.q_goal = zero, p.v_start = zero + N;
  cav_mpc *mpc = cav_mpc_new(&p, NULL, NULL, &error);
  cav_state *s = cav_state_new(m);
  s->options.timestep = 0.001;
  for (int i = 0; CHECK(s && mpc) && i < 500; i++) {
    CHECK(cav_mpc_command(mpc, i * 0.001, q, v, NULL, u) == CAV_OK);
    most = fmax(most, fabs(u[1]));
    if (i >= 400) change = fmax(change, fabs(u[1] - before));
    before = u[1];
    CHECK(cav_forward(m, s, q, v, u, next) == CAV_OK);
    memcpy(v, next, sizeof v);
    cav_integrate(m, q, v, 0.001, q);
  }
  printf("hub: torques of %.2g N m at most, changing by %.1e at the end\n", most, change);
  CHECK(change < 1e-3 * most);
  cav_mpc_free(mpc);
  cav_state_free(s);
  cav_model_free(m);
}

static void test_refusals(const cav_model *m) {
  cav_term term[3];
  cav_problem p = problem_of(m, term, 1);
  cav_error error = {0};
  const cav_mpc_options good = cav_mpc_options_default();
  cav_mpc_options bad[] = {good, good, good, good, good};
  bad[0].iterations = 0, bad[1].delay = -1, bad[2].timestep = 0, bad[3].delay = 1, bad[4].stiffness = NAN;
  for (int i = 0; i < 5; i++) {
    error = (cav_error){0};
    CHECK(!cav_mpc_new(&p, &bad[i], NULL, &error) && error.status == CAV_BAD_INPUT && *error.text);
  }
  p.duration_least = 0.5, p.duration_most = 2;
  CHECK(!cav_mpc_new(&p, NULL, NULL, &error) && error.status == CAV_NOT_SUPPORTED);
  p.duration_least = p.duration_most = 0;
  cav_mpc_options late = good;
  late.delay = 0.1;
  cav_mpc *mpc = cav_mpc_new(&p, &late, NULL, &error);
  if (!CHECK(mpc != NULL)) return;
  double x[S] = {0}, bent[S] = {NAN}, from;
  CHECK(cav_mpc_plan(mpc, 0.2, x, x + N, NULL) == CAV_OK);
  CHECK(cav_mpc_trajectory(mpc, &from) && fabs(from - 0.3) < 1e-12);
  // before the plan is in force, states that are none, and long after
  CHECK(cav_mpc_plan(mpc, 0.25, x, x + N, NULL) == CAV_BAD_INPUT);
  CHECK(cav_mpc_plan(mpc, 0.4, bent, x + N, NULL) != CAV_OK);
  CHECK(cav_mpc_plan(mpc, 3, x, x + N, NULL) == CAV_BAD_INPUT);
  CHECK(cav_mpc_plan(mpc, 0.4, x, x + N, NULL) == CAV_OK);
  cav_mpc_free(mpc);
}

int main(void) {
  char folder[] = "/tmp/cavort-mpc-XXXXXX", path[300], command[300];
  cav_error error = {0};
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  scene_write(folder, "model.xml", two_masses);
  snprintf(path, sizeof path, "%.250s/model.xml", folder);
  cav_model *m = cav_model_load(path, &error);
  if (CHECK(m != NULL)) {
    test_regulator(m, CAV_ORDER_EULER);
    test_regulator(m, CAV_ORDER_MIDPOINT);
    test_delay(m);
    test_parts(m);
    test_targets(m);
    test_pole();
    test_hub();
    test_refusals(m);
  }
  cav_model_free(m);
  snprintf(command, sizeof command, "rm -rf %s", folder);
  CHECK(system(command) == 0);
  return check_result();
}
