/// Ipopt's own derivative checker, which has to find nothing where derivatives are right and a Jacobian or gradient
/// that is wrong by a hundredth where they are not; motions solved by our own path and then Ipopt, and by Ipopt alone.
/// The motions themselves go through the checker in test_solve.c, at their solutions.
#include "motion.h"
#include "transcription.h"

#ifndef CAVORT_HAVE_IPOPT
int main(void) {
  printf("skipped: built without Ipopt\n");
  return CHECK_SKIPPED;
}
#else

/// What the linker puts in the place of cav_transcription_linearise: the true one, then the fault.
static enum { SOUND, WRONG_ROW, WRONG_COST } fault;

cav_status __real_cav_transcription_linearise(cav_transcription *transcription, cav_trajectory *trajectory);
cav_status __wrap_cav_transcription_linearise(cav_transcription *transcription, cav_trajectory *trajectory);

// largest of n numbers, by size
static double *largest(double *x, int n) {
  double *best = x;
  for (int i = 1; i < n; i++) best = fabs(x[i]) > fabs(*best) ? x + i : best;
  return best;
}

cav_status __wrap_cav_transcription_linearise(cav_transcription *tr, cav_trajectory *trajectory) {
  cav_status status = __real_cav_transcription_linearise(tr, trajectory);
  cav_knot *knot = &tr->knot[tr->nknot / 2];
  int rows = knot->layout.effort, columns = 3 * tr->nv;
  if (fault == WRONG_ROW && knot->slot_row) *largest(knot->slot_row, rows * columns) *= 1.01;
  if (fault == WRONG_COST) {
    double *entry = largest(knot->gradient, columns);
    *entry += 0.01 * fmax(1, fabs(*entry));
  }
  return status;
}

// stands on a plane with a foot of four spheres; a knee, a hip and a waist hold it up
static const char text[] =
    "<mujoco><compiler angle='degree'/><worldbody><geom type='plane' size='9 9 1'/>"
    "<body name='foot' pos='0 0 .05'><freejoint/><geom type='sphere' size='.03' pos='.1 .08 -.02' mass='.5'/>"
    "<geom type='sphere' size='.03' pos='-.1 .08 -.02' mass='.5'/><geom type='sphere' size='.03' pos='.1 -.08 -.02' "
    "mass='.5'/><geom type='sphere' size='.03' pos='-.1 -.08 -.02' mass='.5'/><body name='shank'>"
    "<joint name='ankle' axis='0 1 0' range='-60 60' limited='true' damping='.5'/>"
    "<geom type='capsule' fromto='0 0 .03 0 0 .4' size='.04' mass='3'/><body name='trunk' pos='0 0 .45'>"
    "<joint name='knee' axis='0 1 0' range='-150 5' limited='true' damping='.5'/>"
    "<geom type='capsule' fromto='0 0 .05 0 0 .5' size='.08' mass='12'/></body></body></body></worldbody>"
    "<actuator><motor joint='ankle' gear='150' ctrlrange='-1 1' ctrllimited='true'/>"
    "<motor joint='knee' gear='250' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";
static const char problem_text[] =
    "<problem name='rise' model='model.xml'><horizon duration='.6' timestep='.025'/>"
    "<start height='floor'><joint name='ankle' degrees='25'/><joint name='knee' degrees='-40'/></start>"
    "<goal height='floor'/><cost><posture dofs='all' at='end' weight='300'/>"
    "<velocity dofs='all' at='end' weight='100'/></cost></problem>";

static void write_text(const char *path, const char *content) {
  FILE *file = fopen(path, "w");
  CHECK(file && fputs(content, file) >= 0);
  if (file) fclose(file);
}

static cav_problem *load_rise(void) {
  char folder[] = "/tmp/cavort-ipopt-XXXXXX", model[64], path[64];
  CHECK(mkdtemp(folder) != NULL);
  snprintf(model, sizeof model, "%s/model.xml", folder);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  write_text(model, text);
  write_text(path, problem_text);
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  CHECK(problem != NULL);
  if (!problem) fprintf(stderr, "    %s\n", error.text);
  unlink(model);
  unlink(path);
  rmdir(folder);
  return problem;
}

// solves; the verdict tells whether it is certified
static cav_solution *solve(const cav_problem *problem, cav_solver solver, cav_verdict *verdict) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_error error = {0};
  options.solver = solver;
  cav_status status = cav_solve(problem, &options, NULL, &solution, &error);
  CHECK(solution != NULL && (status == CAV_OK || status == CAV_NOT_CONVERGED));
  if (!solution) return NULL;
  CHECK(cav_verify(problem, solution->trajectory, &solution->contact, solution->gain_q, solution->gain_v, verdict,
                   &error) == CAV_OK);
  printf("  solver %d: %s, %d iterations, %.1f s, cost %.4g, unactuated %.1e %s\n", (int)solver,
         cav_status_name(status), solution->iterations, solution->seconds, solution->cost,
         verdict->unactuated_force_max, verdict->reason);
  return solution;
}

static int phases(const cav_solution *solution, const char *phase) {
  int n = 0;
  for (int i = 0; i < solution->nprogress; i++) n += !strcmp(solution->progress[i].phase, phase);
  return n;
}

// certified by our own path, and by Ipopt on top of it
static void check_both(const cav_problem *problem) {
  cav_verdict own_verdict = {0}, verdict = {0};
  cav_solution *own = solve(problem, CAV_SOLVER_GAUSS_NEWTON, &own_verdict);
  cav_solution *both = solve(problem, CAV_SOLVER_BOTH, &verdict);
  CHECK(own_verdict.certified && verdict.certified);
  if (own && both) {
    CHECK(phases(own, "ipopt") == 0 && phases(both, "continuation") > 0 && phases(both, "ipopt") > 0);
    // Ipopt may end elsewhere, but must not lose what it was given
    CHECK(both->cost <= own->cost * (1 + 1e-9));
  }
  cav_solution_free(own);
  cav_solution_free(both);
}

// Ipopt from the guess by its own continuation: a motion that obeys the dynamics
static void check_alone(const cav_problem *problem) {
  cav_verdict verdict = {0};
  cav_solution *solution = solve(problem, CAV_SOLVER_IPOPT, &verdict);
  if (solution) CHECK(phases(solution, "continuation") > 0 && phases(solution, "ipopt") > 0);
  CHECK(verdict.unactuated_force_max <= CAV_TOLERANCE_UNACTUATED);
  CHECK(verdict.limit_violation_max <= CAV_TOLERANCE_LIMIT);
  cav_solution_free(solution);
}

// the checker: silent on the true derivatives, loud on wrong ones
static void check_checker(const cav_problem *problem) {
  cav_verdict verdict;
  cav_solution *solution = solve(problem, CAV_SOLVER_GAUSS_NEWTON, &verdict);
  if (!solution) return;
  for (fault = SOUND; fault <= WRONG_COST; fault++) {
    motion_findings found = motion_check_derivatives(problem, solution->trajectory);
    printf("  %s: %d windows, %d errors, largest %.1e\n",
           fault == SOUND       ? "sound derivatives"
           : fault == WRONG_ROW ? "a row wrong by 1 %"
                                : "gradient wrong by 1 %",
           found.windows, found.errors, found.worst);
    CHECK(found.windows > 0 && found.silent == 0);
    CHECK(fault == SOUND ? found.errors == 0 : found.errors > 0);
  }
  fault = SOUND;
  cav_solution_free(solution);
}

int main(void) {
  cav_problem *problem = load_rise();
  if (!problem) return check_result();
  printf("rise from a squat\n");
  check_checker(problem);
  check_both(problem);
  check_alone(problem);
  cav_problem_free(problem);
  for (int i = 0; i < MOTION_CASES; i++) {
    if (strcmp(motion_cases[i].motion, "walker-jump") && strcmp(motion_cases[i].motion, "hopper-hop")) continue;
    if (!(problem = motion_load(&motion_cases[i]))) continue;
    printf("%s\n", motion_cases[i].motion);
    check_both(problem);
    cav_problem_free(problem);
  }
  return check_result();
}
#endif
