/// optim/solver/ipopt.c, ipopt_options.c: the same motion and multipliers from Ipopt as from the own solver;
/// multipliers as a warm start; options from the problem and from the caller, and which of the two wins; a
/// limited-memory Hessian; limits told in words; stages that end where costs settle; deaf to an ipopt.opt
/// where the program runs.
#include <unistd.h>

#include "cavort/cavort.h"
#include "scene.h"

#ifndef CAVORT_HAVE_IPOPT
int main(void) {
  printf("skipped: built without Ipopt\n");
  return CHECK_SKIPPED;
}
#else

static char folder[] = "/tmp/cavort-ipopt-XXXXXX";

// an arm that raises its tip to a height, its shoulder at the limit of its torque for a while
static const char arm[] =
    "<mujoco><worldbody><body name='upper' pos='0 0 2'><joint name='shoulder' axis='0 1 0' limited='true' range='-170 "
    "170'/><geom type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/>"
    "<body name='lower' pos='.5 0 0'><joint name='elbow' axis='0 1 0' limited='true' range='-20 20'/>"
    "<geom type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/><site name='tip' pos='.5 0 "
    "0'/></body></body></worldbody>"
    "<actuator><motor name='shoulder' joint='shoulder' gear='17' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor name='elbow' joint='elbow' gear='40' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
static const char raise[] =
    "<problem name='raise' model='arm.xml'>\n<horizon duration='1' timestep='.05'/>\n<start/>\n%s"
    "<constraint><sensor name='high' type='framepos' site='tip' component='z' lower='2.6' "
    "at='.6'/></constraint>\n</problem>";

static cav_problem *load(const char *element) {
  char text[1000], path[160];
  cav_error error = {0};
  snprintf(text, sizeof text, raise, element);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  CHECK(problem != NULL);
  if (!problem) fprintf(stderr, "    %s\n", error.text);
  return problem;
}

static cav_solution *solve(const cav_problem *problem, cav_solver solver, int n, const cav_ipopt_option *option,
                           cav_status expected, cav_error *error) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  options.solver = solver;
  options.nipopt = n;
  options.ipopt = option;
  *error = (cav_error){0};
  cav_status status = cav_solve(problem, &options, NULL, &solution, error);
  CHECK(status == expected);
  if (status != expected) fprintf(stderr, "    %s: %s\n", cav_status_name(status), error->text);
  return solution;
}

static int iterations(const cav_solution *solution, const char *phase) {
  int n = 0;
  for (int i = 0; i < solution->nprogress; i++) n += !strcmp(solution->progress[i].phase, phase);
  return n;
}

static double multiplier(const cav_solution *solution, const cav_binding *of) {
  for (int i = 0; i < solution->nrow; i++) {
    const cav_binding *b = &solution->row[i];
    if (b->knot == of->knot && b->kind == of->kind && b->object == of->object && b->component == of->component)
      return b->multiplier;
  }
  return 0;
}

// one optimum, the same multipliers, fewer iterations from the multipliers than from none
static void check_both(const cav_problem *problem) {
  cav_error error;
  static const cav_ipopt_option cold[] = {{"warm_start_init_point", "no"}};
  cav_solution *own = solve(problem, CAV_SOLVER_GAUSS_NEWTON, 0, NULL, CAV_OK, &error);
  cav_solution *both = solve(problem, CAV_SOLVER_BOTH, 0, NULL, CAV_OK, &error);
  cav_solution *without = solve(problem, CAV_SOLVER_BOTH, 1, cold, CAV_OK, &error);
  if (own && both && without) {
    double largest = 0, worst = 0;
    for (int i = 0; i < own->nrow; i++) largest = fmax(largest, fabs(own->row[i].multiplier));
    for (int i = 0; i < own->nrow; i++)
      worst = fmax(worst, fabs(own->row[i].multiplier - multiplier(both, &own->row[i])));
    printf("cost %.9g and %.9g; multipliers differ by %.2g of %.3g; %d iterations of Ipopt, %d without multipliers\n",
           own->cost, both->cost, worst / largest, largest, iterations(both, "ipopt"), iterations(without, "ipopt"));
    // the own solver plans with headroom that its rows may use: its optimum is the lower
    CHECK_NEAR(both->cost, own->cost, 1e-3 * own->cost);
    CHECK(largest > 0 && worst < 0.05 * largest);
    CHECK(iterations(both, "ipopt") < iterations(without, "ipopt"));
  }
  cav_solution_free(own);
  cav_solution_free(both);
  cav_solution_free(without);
}

// the caller's option is laid over the problem's; limits, where one stage comes before, are told; an impossible value is
// refused before anything runs
static void check_options(void) {
  cav_error error;
  cav_problem *problem = load("<schedule stages='1'/>\n<ipopt max_iter='1'/>\n");
  if (!problem) return;
  cav_solution *solution = solve(problem, CAV_SOLVER_IPOPT, 0, NULL, CAV_NOT_CONVERGED, &error);
  CHECK(solution && strstr(error.text, "max_iter") && strstr(error.text, "constraints were left with") &&
        strstr(error.text, "kept is its iterate"));
  if (solution) CHECK(iterations(solution, "ipopt") == 1);
  cav_solution_free(solution);
  static const cav_ipopt_option more[] = {{"max_iter", "2"}}, wrong[] = {{"max_iter", "-2"}};
  solution = solve(problem, CAV_SOLVER_IPOPT, 1, more, CAV_OK, &error);
  if (solution) CHECK(iterations(solution, "ipopt") == 2);
  cav_solution_free(solution);
  CHECK(solve(problem, CAV_SOLVER_IPOPT, 1, wrong, CAV_BAD_INPUT, &error) == NULL && strstr(error.text, "max_iter"));
  cav_problem_free(problem);
}

// the comparison: it nears the optimum of a small problem, and is left at its usual tolerances
static void check_limited_memory(const cav_problem *problem) {
  cav_error error;
  static const cav_ipopt_option limited[] = {{"hessian_approximation", "limited-memory"}, {"max_iter", "1000"}};
  // to the end: at the usual tolerances, made for motions that cost some units, both stop within a tenth
  static const cav_ipopt_option tight[] = {{"acceptable_iter", "0"}, {"max_iter", "1000"}, {"tol", "1e-5"}};
  cav_solution *exact = solve(problem, CAV_SOLVER_IPOPT, 3, tight, CAV_OK, &error);
  cav_solution *solution = solve(problem, CAV_SOLVER_IPOPT, 2, limited, CAV_OK, &error);
  if (exact && solution) {
    printf("limited memory: %d iterations, exact %d\n", iterations(solution, "ipopt"), iterations(exact, "ipopt"));
    CHECK_NEAR(solution->cost, exact->cost, 0.06 * exact->cost); // seen 0.037
  }
  cav_solution_free(exact);
  cav_solution_free(solution);
}

// a body on an actuated leg that leaves the floor and lands
static const char leg[] =
    "<mujoco><worldbody><geom type='plane' size='5 5 .1'/><body pos='0 0 .62'><joint name='up' type='slide' axis='0 0 "
    "1'/>"
    "<geom type='sphere' size='.1' mass='3' contype='0' conaffinity='0'/><site name='body'/>"
    "<body><joint name='reach' type='slide' axis='0 0 1' limited='true' range='-.2 .3'/>"
    "<geom type='capsule' fromto='0 0 -.1 0 0 -.6' size='.02' mass='.5'/></body></body></worldbody>"
    "<actuator><motor joint='reach' gear='200' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
static const char jump[] =
    "<problem name='jump' model='leg.xml'>\n<horizon duration='1.2' timestep='.02'/>\n<start/>\n<cost><sensor "
    "type='framepos' site='body' component='z' target='.9' at='.6' weight='100'/><effort "
    "weight='.1'/></cost>\n</problem>";

// with contacts the dual never tells that a stage is over: costs that have settled do, and Ipopt brings the rows in
static void check_settled(void) {
  static const cav_ipopt_option rough[] = {{"hessian", "gauss-newton"}};
  cav_error error = {0};
  scene_write(folder, "leg.xml", leg);
  scene_write(folder, "jump.xml", jump);
  cav_problem *problem = cav_problem_load("jump.xml", NULL, &error);
  if (!CHECK(problem != NULL)) fprintf(stderr, "    %s\n", error.text);
  cav_solution *solution = problem ? solve(problem, CAV_SOLVER_IPOPT, 1, rough, CAV_OK, &error) : NULL;
  cav_solution *own = problem ? solve(problem, CAV_SOLVER_GAUSS_NEWTON, 0, NULL, CAV_OK, &error) : NULL;
  if (solution && own) {
    printf("a jump: cost %.5g, own solver %.5g; %d iterations of the last stage, %d of restoration, force left %.1e\n",
           solution->cost, own->cost, iterations(solution, "ipopt"), iterations(solution, "restoration"),
           solution->unactuated);
    CHECK(iterations(solution, "ipopt") < 100);
    CHECK(iterations(solution, "restoration") == 0);
    CHECK(solution->unactuated <= cav_solve_options_default().tolerance);
    CHECK_NEAR(solution->cost, own->cost, 0.05 * own->cost);
  }
  cav_solution_free(solution);
  cav_solution_free(own);
  cav_problem_free(problem);
  CHECK(unlink("leg.xml") == 0 && unlink("jump.xml") == 0);
}

int main(void) {
  if (!mkdtemp(folder) || chdir(folder) != 0) return EXIT_FAILURE;
  scene_write(folder, "arm.xml", arm);
  // would end every run after its start
  scene_write(folder, "ipopt.opt", "max_iter 0\n");
  cav_problem *problem = load("");
  if (problem) {
    check_both(problem);
    check_limited_memory(problem);
  }
  cav_problem_free(problem);
  check_options();
  check_settled();
  static const char *const file[] = {"arm.xml", "problem.xml", "ipopt.opt"};
  for (int i = 0; i < 3; i++) CHECK(unlink(file[i]) == 0);
  CHECK(rmdir(folder) == 0);
  return check_result();
}
#endif
