/// Motions of problems/motions for tests: which models they are tried on, and Ipopt's derivative checker run over one.
#ifndef CAVORT_TESTS_MOTION_H
#define CAVORT_TESTS_MOTION_H

#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"

/// A motion on a model: NULL is the problem's own, others lie in the folder of models that no one here wrote.
typedef struct motion_case {
  const char *motion, *model;
} motion_case;

/// Under sanitizers, which take ten times as long, one of each kind.
static const motion_case motion_cases[] = {
    {"squat-jump", NULL},
    {"hopper-hop", NULL},
    {"walker-jump", NULL},
    {"hop", NULL},
#ifndef SANITIZED
    {"squat-jump", "mujoco/humanoid.xml"},
    {"squat-jump", "dm_control/humanoid.xml"},
    {"hopper-hop", "dm_control/hopper.xml"},
    {"cheetah-jump", NULL},
    {"quadruped-trot", NULL},
    {"walk-cycle", NULL},
#endif
};
enum { MOTION_CASES = sizeof motion_cases / sizeof *motion_cases };

static inline void motion_file(char path[4200], const char *motion, const char *name) {
  snprintf(path, 4200, "%.4000s/problems/motions/%.80s/%.80s", CAVORT_SOURCE_ROOT, motion, name);
}

/// The problem; NULL with a failed check, or without one where the shared models are absent.
static inline cav_problem *motion_load(const motion_case *c) {
  char path[4200], model[4200] = "";
  const char *shared = c->model ? check_shared_models() : NULL;
  if (c->model && !shared) return NULL;
  if (c->model) snprintf(model, sizeof model, "%.4000s/%.100s", shared, c->model);
  motion_file(path, c->motion, "problem.xml");
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(path, c->model ? model : NULL, &error);
  CHECK(problem != NULL);
  if (!problem) fprintf(stderr, "    %s\n", error.text);
  return problem;
}

/// What Ipopt's checker found: entries that differ, and by how much, relative to max(1, |entry|).
typedef struct motion_findings {
  int windows, silent; ///< silent: runs in which the checker did not report at all
  int errors;
  double worst;
  char name[64][64]; ///< of the first entries
  double by[64];     ///< by how much these differ
} motion_findings;
enum { MOTION_NAMES = sizeof((motion_findings *)NULL)->name / sizeof *((motion_findings *)NULL)->name };

// reads Ipopt's log: each entry that differs has a line "* name = ... [ error]", and the checker ends with a word of
// its own. Counted are entries among those that the run before found, where there was one and it kept all their names
static inline void motion_read_log(const char *path, const motion_findings *before, motion_findings *found) {
  char line[512];
  FILE *file = fopen(path, "r");
  int spoke = 0;
  while (file && fgets(line, sizeof line, file)) {
    const char *bracket = strrchr(line, '['), *equals = strchr(line, '=');
    spoke |= strstr(line, "No errors detected by derivative checker") || strstr(line, "Derivative checker detected");
    if (line[0] != '*' || !bracket || !equals) continue;
    char name[64];
    snprintf(name, sizeof name, "%.*s", (int)(equals - line), line);
    int known = !before || before->errors > MOTION_NAMES;
    for (int i = 0; !known && i < before->errors; i++) known = !strcmp(name, before->name[i]);
    if (!known) continue;
    double by = strtod(bracket + 1, NULL);
    if (found->errors < MOTION_NAMES) {
      memcpy(found->name[found->errors], name, sizeof name);
      found->by[found->errors] = by;
    }
    found->errors++;
    found->worst = fmax(found->worst, by);
  }
  if (file) fclose(file);
  found->silent += !spoke;
}

// leaves out entries whose error grows as the step does, by eight from the run before: none of it is left at no step.
// There the derivative changes by 1e8 a unit, as hop's gradient may; it is not wrong
static inline void motion_leave_curved(const motion_findings *before, motion_findings *found) {
  int left = 0;
  if (found->errors > MOTION_NAMES || before->errors > MOTION_NAMES) return;
  found->worst = 0;
  for (int i = 0; i < found->errors; i++) {
    double small = INFINITY;
    for (int k = 0; k < before->errors; k++)
      if (!strcmp(before->name[k], found->name[i])) small = before->by[k];
    if (fabs(8 * small - found->by[i]) / 7 < 0.1 * small) continue;
    memmove(found->name[left], found->name[i], sizeof found->name[i]);
    found->by[left++] = found->by[i];
    found->worst = fmax(found->worst, found->by[i]);
  }
  found->errors = left;
}

/// The part of a problem that lies between two knots of its solution, as a problem of its own; terms [problem->nterm].
static inline cav_problem motion_window(const cav_problem *problem, const cav_trajectory *at, int first, int last,
                                        cav_term *terms) {
  cav_problem part = *problem;
  double h = at->timestep, before = first * h;
  part.timestep = h;
  part.duration = (last - first) * h;
  part.q_start = at->q + (size_t)first * at->nq;
  part.v_start = at->v + (size_t)first * at->nv;
  part.close_at_rest = problem->close_at_rest && !problem->cycle.on && last == at->nknot - 1;
  part.cycle.on = 0;
  part.duration_most = 0;
  part.term = terms;
  part.nterm = 0;
  for (int i = 0; i < problem->nterm; i++) {
    cav_term term = problem->term[i];
    if (term.nwaypoint) continue;
    if (term.to < 0) term.to = problem->duration;
    term.from = fmax(term.from - before, 0);
    term.to = fmin(term.to - before, part.duration);
    if (term.from <= term.to + 1e-9) terms[part.nterm++] = term;
  }
  return part;
}

/// Ipopt's first-order checker on gradient, Jacobian and its sparsity at every knot of a solution. The whole at once
/// would take the cube of the number of knots, so windows of five knots are taken that overlap by two: rows see three
/// neighbouring knots.
static inline motion_findings motion_check_derivatives(const cav_problem *problem, const cav_trajectory *at) {
  enum { STEPS = 5, OVERLAP = 2 };
  // what rounding shows at a small step is gone at a large one and what curvature shows the other way round; a wrong
  // derivative is wrong at all, as much: an entry counts that is found at each and does not grow with the step
  static const cav_ipopt_option look[][2] = {{{"max_iter", "0"}, {"derivative_test_perturbation", "2e-10"}},
                                             {{"max_iter", "0"}, {"derivative_test_perturbation", "1e-10"}},
                                             {{"max_iter", "0"}, {"derivative_test_perturbation", "8e-10"}}};
  enum { LOOKS = sizeof look / sizeof *look };
  motion_findings found = {0};
  char log[] = "/tmp/cavort-ipopt-XXXXXX";
  int file = mkstemp(log);
  cav_term *terms = calloc((size_t)problem->nterm + 1, sizeof *terms);
  CHECK(file >= 0 && terms);
  if (file >= 0) close(file);
  for (int first = 0, last = 0; file >= 0 && terms && last < at->nknot - 1; first = last - OVERLAP) {
    last = first + STEPS < at->nknot - 1 ? first + STEPS : at->nknot - 1;
    cav_problem part = motion_window(problem, at, first, last, terms);
    cav_trajectory *start = cav_trajectory_new(problem->model, last - first + 1, problem->timestep);
    cav_solve_options options = cav_solve_options_default();
    options.solver = CAV_SOLVER_IPOPT;
    options.ipopt_derivative_test = 1;
    options.ipopt_output = log;
    options.diagnose = 0;
    memcpy(start->q, part.q_start, (size_t)(last - first + 1) * at->nq * sizeof(double));
    memcpy(start->v, part.v_start, (size_t)at->nv * sizeof(double));
    motion_findings seen = {0}, before;
    for (int k = 0; k < LOOKS && (k == 0 || seen.errors); k++) {
      cav_solution *solution = NULL;
      cav_error error = {0};
      options.nipopt = 2;
      options.ipopt = look[k];
      before = seen;
      seen = (motion_findings){0};
      cav_status status = cav_solve(&part, &options, start, &solution, &error);
      CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED);
      motion_read_log(log, k ? &before : NULL, &seen);
      if (k == LOOKS - 1) motion_leave_curved(&before, &seen);
      cav_solution_free(solution);
    }
    found.errors += seen.errors;
    found.silent += seen.silent;
    found.worst = fmax(found.worst, seen.worst);
    found.windows++;
    cav_trajectory_free(start);
  }
  unlink(log);
  free(terms);
  return found;
}

#endif
