/// Solvers of a problem: our own, and Ipopt with the exact Hessian, with Gauss-Newton's and with limited memory, from the
/// problem's guess, with one thread and a limit of processor time each; then our own with steps twice and half as long, and with
/// the other orders of the step. Cost, violation and unactuated force are followed on the way; feasibility and optimality
/// at the end are the verifier's. Costs of other steps and orders are those of other problems: near, not the same.
#include <stdlib.h>
#include <string.h>

#include "measure.h"

static const cav_sheet_column columns[] = {
    {"solver", "own, or Ipopt with which Hessian"},
    {"order", "of the step"},
    {"outcome", "how the solve ended"},
    {"knots", "of the motion"},
    {"step_s", "s"},
    {"seconds", "processor time, one thread"},
    {"iterations", "in all"},
    {"cost", "of the cost terms"},
    {"unactuated", "largest force without an actuator, fraction of the weight"},
    {"violation", "largest scaled violation of limits and constraints"},
    {"optimality", "fraction of the cost that may still be saved, by the verifier; none where it is not feasible"},
    {"feasible", "1: forces, limits and constraints hold to the certificate's tolerances"}};
static const cav_sheet_column trace_columns[] = {
    {"solver", "own, or Ipopt with which Hessian"},
    {"seconds", "processor time since the solve began"},
    {"iteration", "over the whole solve"},
    {"cost", "of the cost terms"},
    {"unactuated", "largest force without an actuator, fraction of the weight"},
    {"violation", "largest scaled violation of limits and constraints"}};

static const char *const order_name[] = {"euler", "midpoint", "momentum"};
static const cav_ipopt_option limited[] = {{"hessian_approximation", "limited-memory"}},
                              exact[] = {{"hessian", "exact"}}, gauss_newton[] = {{"hessian", "gauss-newton"}};

enum { VARIANTS = 9 };

typedef struct variant {
  const char *name;
  cav_solver solver;
  const cav_ipopt_option *ipopt;
  cav_order order;
  double step; // in steps of the problem
  int traced;
} variant;

// what an observer needs
typedef struct watching {
  cav_measure *m;
  cav_measure_plan *out;
  const variant *v;
  double done, last;
  double processor, wall; // at the beginning
  int stopped, late;
} watching;

// processor time counts, as others on the machine may take most of the wall clock's; that ends it too, in the end
static int stop(void *context) {
  watching *w = context;
  double limit = w->out->limit;
  w->late |= cav_measure_processor() - w->processor > limit || cav_measure_clock() - w->wall > w->out->wall;
  return w->stopped || w->late;
}

static int observe(void *context, const cav_progress *p) {
  watching *w = context;
  double seconds = cav_measure_processor() - w->processor;
  if (w->v->traced && seconds >= w->last) {
    double *row = cav_sheet_add(&w->out->trace, w->v->name, NULL, NULL);
    if (row) {
      row[CAV_TRACE_SECONDS] = seconds;
      row[CAV_TRACE_ITERATION] = p->iteration;
      row[CAV_TRACE_COST] = p->cost;
      row[CAV_TRACE_UNACTUATED] = p->unactuated;
      row[CAV_TRACE_VIOLATION] = p->violation;
    }
    // some hundred points of a solve are enough, as many for each decade
    w->last = 1.06 * seconds;
  }
  w->stopped = w->m->tell(w->m->context, w->v->name, w->done);
  return stop(w);
}

// verified figures of a motion, into its row
static void verify(const cav_problem *p, const cav_solution *s, double *row) {
  cav_verdict verdict = {0};
  cav_error error = {0};
  verdict.optimality = NAN;
  row[CAV_PLAN_FEASIBLE] = 0;
  if (cav_verify(p, s->trajectory, &s->contact, NULL, NULL, &verdict, &error)) return;
  row[CAV_PLAN_COST] = verdict.cost;
  row[CAV_PLAN_UNACTUATED] = verdict.unactuated_force_max;
  row[CAV_PLAN_VIOLATION] = fmax(verdict.limit_violation_max, verdict.constraint_violation_max);
  row[CAV_PLAN_FEASIBLE] = cav_verdict_feasible(&verdict);
  if (!cav_verdict_feasible(&verdict)) return;
  if (!cav_verify_optimality(p, s->trajectory, &s->contact, s->nrow, s->row, &verdict, &error))
    row[CAV_PLAN_OPTIMALITY] = verdict.optimality;
}

static cav_status solve(cav_measure *m, cav_measure_plan *out, const variant *v, double done) {
  cav_problem p = *m->problem;
  cav_solve_options o = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_error error = {0};
  watching w = {.m = m, .out = out, .v = v, .done = done};
  p.order = v->order;
  p.timestep = v->step * m->problem->timestep;
  o.solver = v->solver;
  o.ipopt = v->ipopt;
  o.nipopt = v->ipopt ? 1 : 0;
  o.threads = 1;
  o.gains = 0;
  o.diagnose = 0;
  o.stop = stop;
  o.stop_context = &w;
  o.observer = observe;
  o.observer_context = &w;
  w.processor = cav_measure_processor();
  w.wall = cav_measure_clock();
  cav_status status = cav_solve(&p, &o, NULL, &solution, &error);
  double seconds = cav_measure_processor() - w.processor;
  char outcome[CAV_SHEET_LABEL];
  if (w.late)
    snprintf(outcome, sizeof outcome, "stopped after %.3g s", seconds);
  else
    snprintf(outcome, sizeof outcome, "%s", status ? cav_status_name(status) : "converged");
  double *row = cav_sheet_add(&out->sheet, v->name, order_name[v->order], outcome);
  if (row) {
    row[CAV_PLAN_KNOTS] = (int)lround(p.duration / p.timestep) + 1;
    row[CAV_PLAN_STEP] = p.timestep;
    row[CAV_PLAN_SECONDS] = seconds;
    row[CAV_PLAN_COST] = row[CAV_PLAN_UNACTUATED] = row[CAV_PLAN_VIOLATION] = NAN;
    if (solution) row[CAV_PLAN_ITERATIONS] = solution->iterations;
    // what was cut off at once is not verified: that takes longer than it took
    if (solution && solution->nprogress > 0) {
      const cav_progress *last = &solution->progress[solution->nprogress - 1];
      row[CAV_PLAN_COST] = last->cost;
      row[CAV_PLAN_UNACTUATED] = last->unactuated;
      row[CAV_PLAN_VIOLATION] = last->violation;
      row[CAV_PLAN_FEASIBLE] = 0;
    }
    if (solution && (status == CAV_OK || !m->quick)) verify(&p, solution, row);
  }
  cav_solution_free(solution);
  if (w.stopped) return CAV_INTERRUPTED;
  return row ? CAV_OK : CAV_NO_MEMORY;
}

// the Pareto set of seconds and cost among the feasible ones that solve the problem itself
static void mark(const cav_problem *p, cav_sheet *sheet) {
  double x[VARIANTS], y[VARIANTS];
  int marked[VARIANTS];
  for (int r = 0; r < sheet->nrow; r++) {
    int counts = cav_sheet_get(sheet, r, CAV_PLAN_FEASIBLE) == 1 &&
                 cav_sheet_get(sheet, r, CAV_PLAN_STEP) == p->timestep &&
                 !strcmp(sheet->row[r].label[1], order_name[p->order]);
    x[r] = counts ? cav_sheet_get(sheet, r, CAV_PLAN_SECONDS) : NAN;
    y[r] = counts ? cav_sheet_get(sheet, r, CAV_PLAN_COST) : NAN;
  }
  cav_html_pareto(sheet->nrow, x, y, marked);
  for (int r = 0; r < sheet->nrow; r++) sheet->row[r].marked = marked[r];
}

cav_status cav_measure_plans(cav_measure *m, cav_measure_plan *out) {
  *out = (cav_measure_plan){
      .sheet = {.name = "plan", .ntext = 3, .nnumber = CAV_PLAN_NUMBERS, .column = columns},
      .trace = {.name = "plan_trace", .ntext = 1, .nnumber = CAV_TRACE_NUMBERS, .column = trace_columns},
      .limit = m->quick ? 1.5 : 60,
      .wall = m->quick ? 3 : 150};
  cav_order order = m->problem->order;
  const variant list[VARIANTS] = {{"own", CAV_SOLVER_GAUSS_NEWTON, NULL, order, 1, 1},
                                  {"Ipopt, exact", CAV_SOLVER_IPOPT, exact, order, 1, 1},
                                  {"Ipopt, Gauss-Newton", CAV_SOLVER_IPOPT, gauss_newton, order, 1, 1},
                                  {"Ipopt, limited memory", CAV_SOLVER_IPOPT, limited, order, 1, 1},
                                  {"own", CAV_SOLVER_GAUSS_NEWTON, NULL, order, 2, 0},
                                  {"own", CAV_SOLVER_GAUSS_NEWTON, NULL, order, 0.5, 0},
                                  {"own", CAV_SOLVER_GAUSS_NEWTON, NULL, CAV_ORDER_EULER, 1, 0},
                                  {"own", CAV_SOLVER_GAUSS_NEWTON, NULL, CAV_ORDER_MIDPOINT, 1, 0},
                                  {"own", CAV_SOLVER_GAUSS_NEWTON, NULL, CAV_ORDER_MOMENTUM, 1, 0}};
  int n = m->quick ? 4 : VARIANTS;
  cav_status status = CAV_OK;
  for (int i = 0; i < n && !status; i++) {
    double steps = m->problem->duration / (list[i].step * m->problem->timestep);
    if (cav_solver_rule_of(list[i].solver)->missing) continue;
    // the stated one is solved already, and the duration is a whole number of steps
    if (i > 5 && list[i].order == order) continue;
    if (fabs(steps - round(steps)) > 1e-6 * steps || steps < 2) continue;
    status = solve(m, out, &list[i], (double)i / n);
  }
  mark(m->problem, &out->sheet);
  return status;
}
