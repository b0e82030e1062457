/// Optimal control with known optima: cost, duration, states, forces and multipliers against the truth on grids from
/// coarse to ten times as fine, errors falling at the stated order, iterations of linear-quadratic problems, and how
/// optimal the solver and the verifier say that the motion is. Usage: test_optimum [gn|ipopt|both] [table] [NAME...].
/// table prints the whole decade as Markdown; else two grids are run. test_optimum methods [NAME...] compares methods on
/// one grid, the second of the decade, and judges nothing.
#include "optimum.h"

#include <time.h>

// ---------------------------------------------------------------- construction

double *optimum_values(optimum_problem *p, int n, const double *value) {
  double *at = p->value + p->nvalue;
  if (!CHECK(p->nvalue + n <= OPTIMUM_VALUES)) exit(EXIT_FAILURE);
  memcpy(at, value, (size_t)n * sizeof(double));
  p->nvalue += n;
  return at;
}

static cav_term *add_term(optimum_problem *p, cav_term_use use, cav_quantity quantity) {
  if (!CHECK(p->problem.nterm < OPTIMUM_TERMS)) exit(EXIT_FAILURE);
  cav_term *term = &p->term[p->problem.nterm++];
  *term = (cav_term){.name = "", .quantity = quantity, .use = use, .component = -1, .joint = -1, .to = -1};
  term->scale = 1;
  term->lower = -INFINITY;
  term->upper = INFINITY;
  return term;
}

cav_term *optimum_cost(optimum_problem *p, cav_quantity quantity, double weight) {
  cav_term *term = add_term(p, CAV_USE_COST, quantity);
  term->weight = weight;
  return term;
}

cav_term *optimum_fix(optimum_problem *p, cav_quantity quantity, double time, const double *target) {
  const cav_model *m = p->problem.model;
  cav_term *term = add_term(p, CAV_USE_EQUAL, quantity);
  term->from = term->to = time;
  term->target = optimum_values(p, quantity == CAV_QUANTITY_CONFIGURATION ? m->nq : m->nv, target);
  return term;
}

void optimum_end(optimum_problem *p, const double *q, const double *v) {
  optimum_fix(p, CAV_QUANTITY_CONFIGURATION, p->problem.duration, q);
  optimum_fix(p, CAV_QUANTITY_VELOCITY, p->problem.duration, v);
  memcpy(p->problem.q_goal, q, (size_t)p->problem.model->nq * sizeof(double));
}

cav_term *optimum_range(optimum_problem *p, cav_quantity quantity, double lower, double upper) {
  cav_term *term = add_term(p, CAV_USE_RANGE, quantity);
  term->target = quantity == CAV_QUANTITY_CONFIGURATION ? p->problem.model->q0 : NULL;
  term->lower = lower, term->upper = upper;
  return term;
}

double optimum_multiplier_sum(const cav_solution *s, cav_binding_kind kind, int first, int last) {
  double sum = 0;
  for (int i = 0; i < s->nrow; i++)
    if (s->row[i].kind == kind && s->row[i].knot >= first && s->row[i].knot <= last) sum += s->row[i].multiplier;
  return sum;
}

// ---------------------------------------------------------------- one grid

/// What a solve on one grid came to: errors relative to the truth.
typedef struct outcome {
  cav_status status;
  double step, cost, time, state, force, multiplier_error, optimality, verified;
  double seconds;                    ///< processor time
  int iterations, stage_most, after; ///< of the solve, of one stage, after the last stage
} outcome;

/// A way to solve.
typedef struct method {
  const char *name;
  cav_solver solver;
  int noption;
  cav_ipopt_option option;
} method;

/// Largest or mean |a - b| over the largest |b|; 0 where b is not known.
static double distance(int n, const double *a, const double *b, int in_mean) {
  double sum = 0, most = 0, size = 0;
  for (int i = 0; i < n; i++) {
    if (isnan(b[i])) return 0;
    sum += fabs(a[i] - b[i]) / n;
    most = fmax(most, fabs(a[i] - b[i]));
    size = fmax(size, fabs(b[i]));
  }
  return (in_mean ? sum : most) / (size > 0 ? size : 1);
}

static void count_iterations(const cav_solution *s, outcome *out) {
  out->iterations = s->iterations;
  for (int i = 0; i < s->nstage; i++) {
    int in_stages = !strcmp(s->stage[i].phase, "continuation");
    if (in_stages && s->stage[i].iterations > out->stage_most) out->stage_most = s->stage[i].iterations;
    if (!in_stages) out->after += s->stage[i].iterations;
  }
}

static void compare(const optimum *o, const cav_problem *problem, const cav_solution *s, int n, outcome *out) {
  const cav_trajectory *at = s->trajectory;
  optimum_truth truth = {.q = calloc((size_t)(n + 1) * at->nq, sizeof(double)),
                         .u = calloc((size_t)(n + 1) * at->nv, sizeof(double))};
  o->truth(n, &truth);
  double duration = n * at->timestep, scale = truth.cost > 0 ? truth.cost : 1;
  out->step = at->timestep;
  out->cost = fabs(s->cost - truth.cost) / scale;
  out->time = fabs(duration - truth.duration) / truth.duration;
  out->state = distance((n + 1) * at->nq, at->q, truth.q, 0);
  out->force = distance(n * at->nv, at->u, truth.u, o->force_in_mean);
  out->multiplier_error = o->multiplier ? o->multiplier(problem, s) : 0;
  free(truth.q), free(truth.u);
}

/// How optimal the verifier says that a solution is.
static double verify(const cav_problem *problem, const cav_solution *s) {
  cav_verdict verdict = {.cost = s->cost};
  cav_error error = {0};
  if (!CHECK(cav_verify_optimality(problem, s->trajectory, &s->contact, s->nrow, s->row, &verdict, &error) == CAV_OK))
    fprintf(stderr, "    %s\n", error.text);
  return verdict.optimality;
}

static const method methods[] = {
    {"own", CAV_SOLVER_GAUSS_NEWTON, 0, {0}},
    {"Ipopt, auto", CAV_SOLVER_IPOPT, 0, {0}},
    {"Ipopt, exact", CAV_SOLVER_IPOPT, 1, {"hessian", "exact"}},
    {"Ipopt, Gauss-Newton", CAV_SOLVER_IPOPT, 1, {"hessian", "gauss-newton"}},
    {"Ipopt, limited memory", CAV_SOLVER_IPOPT, 1, {"hessian_approximation", "limited-memory"}}};
enum { METHODS = sizeof methods / sizeof *methods };

static outcome solve(const optimum *o, const cav_model *model, int n, const method *by) {
  optimum_problem p = {.problem = cav_problem_default(model)};
  outcome out = {0};
  double *ends = calloc((size_t)(2 * model->nq + model->nv), sizeof(double));
  p.problem.name = o->name;
  p.problem.duration = o->duration;
  p.problem.timestep = o->duration / n;
  p.problem.close_at_rest = 0;
  p.problem.effort_limit = 1;
  p.problem.limit_margin = 0;
  p.problem.q_start = ends, p.problem.q_goal = ends + model->nq, p.problem.v_start = ends + 2 * model->nq;
  memcpy(p.problem.q_start, model->q0, (size_t)model->nq * sizeof(double));
  memcpy(p.problem.q_goal, model->q0, (size_t)model->nq * sizeof(double));
  p.table = calloc((size_t)n + 1, sizeof(double)), p.times = calloc((size_t)n + 1, sizeof(double));
  p.problem.term = p.term;
  o->build(&p, n);

  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_error error = {0};
  options.solver = by->solver;
  options.ipopt = &by->option;
  options.nipopt = by->noption;
  options.optimality = 1e-5; // errors are the discretisation's, to their order
  // an optimum is known, so no proof says that there is none, however near the bounds it lies
  cav_impossibility proof;
  int proofs = -1;
  CHECK(cav_problem_impossible(&p.problem, &proof, 1, &proofs, &error) == CAV_OK && proofs == 0);
  if (proofs > 0) fprintf(stderr, "    %s: %s\n", o->name, proof.what);
  double begin = (double)clock();
  out.status = cav_solve(&p.problem, &options, NULL, &solution, &error);
  out.seconds = ((double)clock() - begin) / CLOCKS_PER_SEC;
  if (out.status != CAV_OK)
    fprintf(stderr, "    %s, %d steps: %s: %s\n", o->name, n, cav_status_name(out.status), error.text);
  if (solution) {
    compare(o, &p.problem, solution, n, &out);
    count_iterations(solution, &out);
    out.optimality = solution->optimality;
    out.verified = verify(&p.problem, solution);
  }
  cav_solution_free(solution);
  free(ends), free(p.table), free(p.times);
  return out;
}

// ---------------------------------------------------------------- judgement

/// An error at this size is the solver's tolerance, and falls no further with the step.
static const double least_error = 1e-6;

/// How far from the stated order a measured one may be.
static const double order_slack = 0.25;

static double order_of(double coarse, double fine, double refinement) { return log(coarse / fine) / log(refinement); }

static void decide(const char *name, const char *what, optimum_bound bound, double coarse, double fine,
                   double refinement) {
  if (bound.error == 0) return;
  double order = order_of(coarse, fine, refinement);
  if (!CHECK(fine <= bound.error))
    fprintf(stderr, "    %s: %s is %.2g off at the finest grid, at most %.2g\n", name, what, fine, bound.error);
  if (!CHECK(bound.order == 0 || fine < least_error || order > bound.order - order_slack))
    fprintf(stderr, "    %s: %s falls from %.2g to %.2g at order %.2f, not %.0f\n", name, what, coarse, fine, order,
            bound.order);
}

static void judge_all(const optimum *o, const outcome *coarse, const outcome *fine, double refinement) {
  CHECK(coarse->status == CAV_OK && fine->status == CAV_OK);
  decide(o->name, "the cost", o->cost, coarse->cost, fine->cost, refinement);
  decide(o->name, "the duration", o->time, coarse->time, fine->time, refinement);
  decide(o->name, "a state", o->state, coarse->state, fine->state, refinement);
  decide(o->name, "a force", o->force, coarse->force, fine->force, refinement);
  decide(o->name, "a multiplier", o->multiplier_error, coarse->multiplier_error, fine->multiplier_error, refinement);
  for (int i = 0; i < 2; i++) {
    const outcome *is = i ? fine : coarse;
    if (!CHECK(is->optimality <= 1e-4))
      fprintf(stderr, "    %s: optimal to %.2g only at a step of %g s\n", o->name, is->optimality, is->step);
    double most = o->optimal > 0 ? o->optimal : 1e-4;
    if (!CHECK(is->verified <= most))
      fprintf(stderr, "    %s: by the verifier optimal to %.2g only at a step of %g s\n", o->name, is->verified,
              is->step);
  }
}

/// A linear-quadratic problem is one step away.
static void judge_iterations(const optimum *o, const outcome *is) {
  if (!CHECK(is->stage_most <= 5 && is->after <= 1))
    fprintf(stderr, "    %s: %d iterations in a stage and %d after the last at a step of %g s\n", o->name,
            is->stage_most, is->after, is->step);
}

static void print_row(const optimum *o, const outcome *out) {
  printf("| %s | %.4g | %s | %d | %d | %d | %.1e | %.1e | %.1e | %.1e | %.1e | %.1e | %.1e |\n", o->name, out->step,
         out->status == CAV_OK ? "yes" : "no", out->iterations, out->stage_most, out->after, out->cost, out->time,
         out->state, out->force, out->multiplier_error, out->optimality, out->verified);
  fflush(stdout);
}

/// Grids: steps over those of the coarsest; one linear-quadratic problem goes on to steps half as long.
enum { GRIDS = 4 };
static const int decade[GRIDS] = {1, 2, 5, 10}, beyond[GRIDS] = {1, 4, 10, 20};

static void compare_methods(const optimum *o) {
  cav_model *model = scene_load(o->model);
  if (!CHECK(model != NULL)) return;
  for (int k = 0; k < METHODS; k++) {
    outcome out = solve(o, model, decade[1] * o->coarsest, &methods[k]);
    printf("| %s | %s | %s | %.1e | %.1e | %d | %.2f |\n", o->name, methods[k].name,
           out.status == CAV_OK ? "yes" : "no", out.cost, out.optimality, out.iterations, out.seconds);
    fflush(stdout);
  }
  cav_model_free(model);
}

static void run(const optimum *o, const method *by, int table) {
  cav_model *model = scene_load(o->model);
  if (!CHECK(model != NULL)) return;
  outcome out[GRIDS] = {0};
  int last = GRIDS - 1;
  const int *refinement = o->quadratic > 1 ? beyond : decade;
  for (int i = 0; i <= last; i++) {
    if (!table && !o->quadratic && i > 0 && i < last) continue;
    out[i] = solve(o, model, refinement[i] * o->coarsest, by);
    if (table) print_row(o, &out[i]);
    if (o->quadratic && by->solver == CAV_SOLVER_GAUSS_NEWTON) judge_iterations(o, &out[i]);
  }
  judge_all(o, &out[0], &out[last], refinement[last]);
  cav_model_free(model);
}

static int wanted(const char *name, int n, char **names) {
  for (int i = 0; i < n; i++)
    if (!strcmp(names[i], name)) return 1;
  return n == 0;
}

int main(int argc, char **argv) {
  struct {
    const optimum *row;
    int n;
  } const part[] = {{optimum_smooth, optimum_nsmooth},
                    {optimum_bounded, optimum_nbounded},
                    {optimum_contact, optimum_ncontact},
                    {optimum_pendulum, optimum_npendulum},
                    {optimum_further, optimum_nfurther}};
  method by = {.name = "gn", .solver = CAV_SOLVER_GAUSS_NEWTON};
  int i = 1, table = 0, compared = i < argc && !strcmp(argv[i], "methods");
  if (compared) i++;
  if (i < argc && !strcmp(argv[i], "gn")) i++;
  if (i < argc && !strcmp(argv[i], "ipopt")) by.solver = CAV_SOLVER_IPOPT, i++;
  if (i < argc && !strcmp(argv[i], "both")) by.solver = CAV_SOLVER_BOTH, i++;
  if (i < argc && !strcmp(argv[i], "table")) table = 1, i++;
  if (compared)
    printf("| problem | method | solved | cost off | optimal to | iterations | s |\n|---|---|---|---|---|---|---|\n");
  if (table)
    printf(
        "| problem | step, s | solved | iterations | most in a stage | after the last | cost | duration | states | "
        "forces | multiplier or impulse | optimal to | by the verifier "
        "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (size_t k = 0; k < sizeof part / sizeof *part; k++)
    for (int j = 0; j < part[k].n; j++)
      if (wanted(part[k].row[j].name, argc - i, argv + i))
        compared ? compare_methods(&part[k].row[j]) : run(&part[k].row[j], &by, table);
  return check_result();
}
