/// Forces on roots at a cost. A box that is held in the air, which no physics does, is held by its weight, told in newtons
/// and in percent, and certified only where that is allowed; a mass without a motor under a penalised force is the same mass
/// with a motor whose effort costs as much.
#include <unistd.h>

#include "cavort/cavort.h"
#include "cavort/result.h"
#include "scene.h"
#include "storage.h"

static const double gravity = 9.81;

static int make(bench *b, const char *text, double duration) {
  *b = (bench){.model = scene_load(text)};
  if (!CHECK(b->model != NULL)) return 0;
  b->problem = cav_problem_default(b->model);
  memcpy(b->q_start, b->model->q0, (size_t)b->model->nq * sizeof(double));
  b->problem.duration = duration;
  b->problem.q_start = b->problem.q_goal = b->q_start, b->problem.v_start = b->v_start;
  b->problem.term = b->term;
  return 1;
}

/// Solves and verifies; NULL: a check failed.
static cav_solution *solve(const cav_problem *p, cav_solver solver, cav_verdict *verdict) {
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *s = NULL;
  options.solver = solver;
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  if (!CHECK(status == CAV_OK && s)) fprintf(stderr, "    %s\n", error.text);
  if (!s) return NULL;
  CHECK(!cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, verdict, &error));
  CHECK_NEAR(verdict->cost, s->cost, 1e-9 * s->cost + 1e-12);
  CHECK(!cav_verify_optimality(p, s->trajectory, &s->contact, s->nrow, s->row, verdict, &error));
  CHECK(verdict->optimality < 1e-4);
  return s;
}

// ---------------------------------------------------------------- a box in the air

static const char box[] =
    "<mujoco model='box'><worldbody><geom type='plane' size='1 1 1'/><body name='box' pos='0 0 .11'>"
    "<freejoint name='root'/><geom type='box' size='.1 .2 .1' mass='3'/></body></worldbody></mujoco>";

/// Held a centimetre above the floor by a hard posture.
static void test_box(double within) {
  const double weight = 3 * gravity;
  bench b;
  cav_verdict verdict;
  if (!make(&b, box, 0.5)) return;
  b.problem.residual = (cav_residual){.force = 20, .torque = 5, .within = within};
  add(&b, cav_term_equal(CAV_QUANTITY_CONFIGURATION, NULL));
  cav_solution *s = solve(&b.problem, CAV_SOLVER_GAUSS_NEWTON, &verdict);
  if (s) {
    CHECK_NEAR(verdict.residual_force_rms_n, weight, 1e-4);
    CHECK_NEAR(verdict.residual_force_max_n, weight, 1e-4);
    CHECK_NEAR(verdict.residual_torque_max_n_m, 0, 1e-4);
    CHECK_NEAR(verdict.residual_fraction_max, 1, 1e-5);
    // half of (weight/deviation)^2 a second; 21 knots have forces
    CHECK_NEAR(verdict.cost, 0.5 * 21 * 0.025 * weight * weight / 400, 1e-5);
    CHECK(verdict.unactuated_force_max == 0);
    CHECK(verdict.momentum_defect_rms < 1e-6);
    CHECK(verdict.certified == (within >= 1.01));
    if (!CHECK(verdict.certified || strstr(verdict.reason, "residual force")))
      fprintf(stderr, "    %s\n", verdict.reason);
    CHECK_NEAR(s->trajectory->u[2], weight, 1e-4);
    // without the penalty the same motion is refused, as it was before there was one
    b.problem.residual = (cav_residual){0};
    CHECK(!cav_verify(&b.problem, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, NULL));
    CHECK(!verdict.certified && isnan(verdict.residual_fraction_max));
    CHECK_NEAR(verdict.unactuated_force_max, 1, 1e-5);
    CHECK(verdict.momentum_defect_rms > 0.1);
  }
  cav_solution_free(s);
  cav_model_free(b.model);
}

/// Only the force is penalised: the torque has to be zero as ever, and is.
static void test_force_alone(void) {
  bench b;
  cav_verdict verdict;
  if (!make(&b, box, 0.25)) return;
  b.problem.residual = (cav_residual){.force = 20, .within = 2};
  b.problem.close_at_rest = 0;
  cav_term *term = add(&b, cav_term_equal(CAV_QUANTITY_CONFIGURATION, NULL));
  term->dofs = CAV_DOFS_ROOT_LINEAR;
  cav_solution *s = solve(&b.problem, CAV_SOLVER_GAUSS_NEWTON, &verdict);
  if (s) {
    CHECK(verdict.residual_torque_max_n_m == 0 && verdict.certified);
    CHECK_NEAR(verdict.residual_force_max_n, 3 * gravity, 1e-4);
    CHECK(verdict.unactuated_force_max < 1e-6);
  }
  cav_solution_free(s);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- a penalty is a cost

#define CART(ACTUATORS)                                                                                                \
  "<mujoco model='cart'><option gravity='0 0 0'/><worldbody><body name='cart'><joint name='x' type='slide' axis='1 0 " \
  "0' "                                                                                                                \
  "damping='.2'/><geom type='sphere' size='.1' mass='1.7'/></body></worldbody>" ACTUATORS "</mujoco>"

static void test_penalty(cav_solver solver) {
  const double seen[3] = {0.2, -0.1, 0.6}, time[3] = {0, 0.5, 1}, deviation = 1.5;
  cav_trajectory *at[2] = {NULL};
  double cost[2] = {0};
  for (int k = 0; k < 2; k++) {
    bench b;
    cav_verdict verdict;
    if (!make(&b, k ? CART("<actuator><motor joint='x'/></actuator>") : CART(""), 1)) return;
    b.problem.close_at_rest = 0;
    b.problem.free_start = 1;
    cav_term *term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 500));
    term->target = seen, term->nwaypoint = 3, term->waypoint_time = time;
    if (k == 0) b.problem.residual = (cav_residual){.force = deviation, .within = 1e6};
    if (k == 1) add(&b, cav_term_cost(CAV_QUANTITY_EFFORT, 1 / (deviation * deviation)));
    cav_solution *s = solve(&b.problem, solver, &verdict);
    if (s) at[k] = cav_trajectory_copy(s->trajectory), cost[k] = s->cost;
    cav_solution_free(s);
    cav_model_free(b.model);
  }
  if (CHECK(at[0] && at[1])) {
    CHECK_NEAR(cost[0], cost[1], 1e-9 * cost[1]);
    CHECK_NEAR_ALL(at[0]->q, at[1]->q, 41, 1e-5);
    CHECK_NEAR_ALL(at[0]->u, at[1]->u, 40, 1e-2);
  }
  cav_trajectory_free(at[0]), cav_trajectory_free(at[1]);
}

// ---------------------------------------------------------------- files

static void test_files(void) {
  static const char *const left[] = {"model.xml",         "problem.xml",         "written.xml", "result/residual.csv",
                                     "result/forces.csv", "result/controls.csv", "result"};
  char folder[] = "/tmp/cavort-residual-XXXXXX", path[300], first[200] = "";
  cav_error error = {0};
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  scene_write(folder, "model.xml", box);
  scene_write(
      folder, "problem.xml",
      "<problem model='model.xml'>\n<horizon duration='.5' timestep='.025'/>\n<start><root pos='0 0 .6'/></start>\n"
      "<constraint><posture dofs='all'/></constraint><residual force='20' torque='3' within='1.5'/></problem>");
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  if (p) {
    cav_impossibility found[4];
    int n = 0;
    CHECK(p->residual.force == 20 && p->residual.torque == 3 && p->residual.within == 1.5);
    CHECK(!cav_problem_impossible(p, found, 4, &n, &error) && n == 0);
    snprintf(path, sizeof path, "%s/written.xml", folder);
    CHECK(!cav_problem_write(path, p, NULL, &error));
    cav_problem *again = cav_problem_load(path, NULL, &error);
    CHECK(again && again->residual.force == 20 && again->residual.torque == 3 && again->residual.within == 1.5);
    cav_problem_free(again);
    cav_verdict verdict;
    cav_solution *s = solve(p, CAV_SOLVER_GAUSS_NEWTON, &verdict);
    snprintf(path, sizeof path, "%s/result", folder);
    CHECK(s && !cav_result_write_forces(path, p, s->trajectory, &s->contact, &error));
    snprintf(path, sizeof path, "%s/result/residual.csv", folder);
    FILE *file = fopen(path, "r");
    double x[7] = {0};
    CHECK(file && fgets(first, sizeof first, file) &&
          fscanf(file, "%lf,%lf,%lf,%lf,%lf,%lf,%lf", x, x + 1, x + 2, x + 3, x + 4, x + 5, x + 6) == 7);
    if (file) fclose(file);
    CHECK_TEXT(first,
               "time,residual_root_0,residual_root_1,residual_root_2,residual_root_3,residual_root_4,"
               "residual_root_5\n");
    CHECK_NEAR(x[3], 3 * gravity, 1e-4);
    cav_solution_free(s);
    // without the penalty it is proven impossible
    p->residual = (cav_residual){0};
    CHECK(!cav_problem_impossible(p, found, 4, &n, &error) && n > 0);
  }
  cav_problem_free(p);
  scene_write(folder, "problem.xml",
              "<problem model='model.xml'>\n<horizon duration='.5'/>\n<start/>\n<residual within='1'/></problem>");
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  CHECK(!cav_problem_load(path, NULL, &error) && error.line == 4 && strstr(error.text, "'force' in N"));
  for (size_t i = 0; i < sizeof left / sizeof *left; i++) {
    snprintf(path, sizeof path, "%s/%s", folder, left[i]);
    if (i + 1 < sizeof left / sizeof *left) unlink(path);
    if (i + 1 == sizeof left / sizeof *left) rmdir(path);
  }
  CHECK(rmdir(folder) == 0);
}

int main(void) {
  test_box(1.5);
  test_box(0.5);
  test_force_alone();
  test_penalty(CAV_SOLVER_GAUSS_NEWTON);
  test_files();
  return check_result();
}
