/// Ipopt on the transcription: unknowns are tangent increments about the trajectory it starts from, forces that no actuator can
/// give are hard equalities, efforts, tendon ranges and hard terms are bounded rows, joint ranges bound the unknowns. The
/// Hessian is Gauss-Newton's of the cost plus a diagonal that stands for the neglected curvature of the constraints, which
/// grows with their multipliers
/// (METHOD.md, 2). The only user of Ipopt; written against 3.11 and 3.14 (index and number are int and double in both).
#include "ipopt.h"

#include <IpStdCInterface.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ipopt_options.h"
#include "rotation.h"

/// Dual infeasibility that the noise of derivatives explains, and violation from which the last step brings all rows in.
static const double noise = 1, acceptable = 1e-4;

/// What stands for the curvature of the constraints on the diagonal: in proportion to the largest multiplier, and to the diagonal
/// itself.
static const double curvature = 3, curvature_fraction = 0.01;

/// Ipopt's checker takes one-sided differences, at the start itself: away from it the law is stiff beyond any step. Contacts
/// and their costs have second derivatives up to 3e7, so a step p is off by 1.5e7 p, and rounding of objective and forces by
/// about 5e-13 / p: least near 2e-10, where both together stay below the tolerance.
static const double test_step = 2e-10, test_tolerance = 8e-3;

typedef struct program {
  cav_solve_run *run;
  cav_trajectory *anchor; ///< x = 0
  int n, m;
  int entries;                                  ///< of the Jacobian
  int *row_knot, *row_slot;                     ///< [m]
  int *jacobian_row, *jacobian_column, *source; ///< [entries]; source: column among the row's 3nv
  double *x;                                    ///< [n] point of the last evaluation
  int known;                                    ///< 1: values at x are known, 2: derivatives too
  double *full;                                 ///< [3nv+1] a row while it is turned, and its entry of the step
  double infeasibility, dual;                   ///< of the last iterate, as Ipopt measures them
  double *best_x;                               ///< [n] the iterate that is nearest to an optimum
  double best_error, best_infeasibility, best_dual;
  int best_iteration; ///< -1: none yet
  int interrupted;
} program;

/// Brings the transcription to x; derivatives where asked for. False where the dynamics has no finite value.
static int evaluate(program *p, const double *x, int derivatives) {
  if (p->known && memcmp(p->x, x, (size_t)p->n * sizeof *x)) p->known = 0;
  if (p->known > derivatives) return 1;
  cav_transcription *tr = p->run->tr;
  memcpy(p->x, x, (size_t)p->n * sizeof *x);
  cav_transcription_move(tr, p->anchor, x, p->run->at);
  p->known = 0;
  cav_status status =
      derivatives ? cav_transcription_linearise(tr, p->run->at) : cav_transcription_values(tr, p->run->at);
  if (status != CAV_OK) return 0;
  if (derivatives) cav_normal_gather(p->run->normal, tr);
  p->known = 1 + derivatives;
  return 1;
}

/// Tangent of a block of unknowns to tangent at its configuration: row := row * Jr(x) on rotations.
static void rotation_row(const program *p, int block, double *row) {
  const cav_transcription *tr = p->run->tr;
  for (int k = 0; block >= 0 && k < tr->nrotation; k++) {
    double J[9], y[3], *r = row + tr->rotation_dof[k];
    cav_rotation_jacobian(p->x + (size_t)block * tr->nv + tr->rotation_dof[k], J);
    for (int c = 0; c < 3; c++) y[c] = r[0] * J[c] + r[1] * J[3 + c] + r[2] * J[6 + c];
    memcpy(r, y, sizeof y);
  }
}

static Bool objective(int n, double *x, Bool fresh, double *value, UserDataPtr data) {
  program *p = data;
  (void)n, (void)fresh;
  if (!evaluate(p, x, 0)) return 0;
  *value = cav_transcription_cost(p->run->tr);
  return 1;
}

static Bool objective_gradient(int n, double *x, Bool fresh, double *gradient, UserDataPtr data) {
  program *p = data;
  (void)fresh;
  if (!evaluate(p, x, 1)) return 0;
  memcpy(gradient, cav_normal_gradient(p->run->normal), (size_t)n * sizeof *gradient);
  for (int b = 0; b < p->run->tr->nknot - 1; b++) rotation_row(p, b, gradient + (size_t)b * p->run->tr->nv);
  return 1;
}

static Bool constraints(int n, double *x, Bool fresh, int m, double *g, UserDataPtr data) {
  program *p = data;
  (void)n, (void)fresh;
  if (!evaluate(p, x, 0)) return 0;
  for (int i = 0; i < m; i++) g[i] = p->run->tr->knot[p->row_knot[i]].slot[p->row_slot[i]].value;
  return 1;
}

static Bool constraint_jacobian(int n, double *x, Bool fresh, int m, int entries, int *row, int *column, double *value,
                                UserDataPtr data) {
  program *p = data;
  (void)n, (void)fresh, (void)m;
  if (!value) {
    memcpy(row, p->jacobian_row, (size_t)entries * sizeof *row);
    memcpy(column, p->jacobian_column, (size_t)entries * sizeof *column);
    return 1;
  }
  if (!evaluate(p, x, 1)) return 0;
  const cav_transcription *tr = p->run->tr;
  int nv = tr->nv, last = -1;
  for (int k = 0; k < entries; k++) {
    int i = p->jacobian_row[k], t = p->row_knot[i];
    if (i != last) {
      memcpy(p->full, tr->knot[t].slot_row + (size_t)p->row_slot[i] * 3 * nv, 3 * (size_t)nv * sizeof(double));
      for (int c = 0; c < 3; c++) rotation_row(p, cav_transcription_block(tr, t, c), p->full + c * nv);
      p->full[3 * nv] = tr->knot[t].slot_step[p->row_slot[i]];
      last = i;
    }
    value[k] = p->full[p->source[k]];
  }
  return 1;
}

static Bool lagrangian_hessian(int n, double *x, Bool fresh, double factor, int m, double *multiplier,
                               Bool fresh_multiplier, int entries, int *row, int *column, double *value,
                               UserDataPtr data) {
  program *p = data;
  (void)n, (void)fresh, (void)fresh_multiplier, (void)entries;
  if (!value) {
    cav_normal_entries(p->run->normal, row, column, NULL);
    return 1;
  }
  if (!evaluate(p, x, 1)) return 0;
  double largest = 0;
  for (int i = 0; i < m; i++) largest = fmax(largest, fabs(multiplier[i]));
  cav_normal_entries(p->run->normal, NULL, NULL, value);
  cav_normal_shift_entries(p->run->normal, factor, curvature * largest, curvature_fraction, value);
  return 1;
}

/// Keeps the iterate if none was nearer to an optimum. A line search that meets the noise of the derivatives can wander off,
/// and the restoration of Ipopt ends anywhere.
static void keep_best(program *p, int iteration) {
  double error = fmax(p->infeasibility / p->run->options->tolerance, p->dual / noise);
  if (p->known < 2 || !(p->best_iteration < 0 || error < p->best_error)) return;
  memcpy(p->best_x, p->x, (size_t)p->n * sizeof(double));
  p->best_error = error;
  p->best_infeasibility = p->infeasibility;
  p->best_dual = p->dual;
  p->best_iteration = iteration;
}

static Bool progress(int mode, int iteration, double cost, double infeasibility, double dual, double mu, double step,
                     double regularisation, double dual_step, double primal_step, int trials, UserDataPtr data) {
  program *p = data;
  (void)cost, (void)mu, (void)regularisation, (void)dual_step, (void)trials;
  p->run->stage = mode;
  p->infeasibility = infeasibility;
  p->dual = dual;
  if (mode == 0) keep_best(p, iteration);
  if (!p->known) return 1;
  p->interrupted = cav_run_report(p->run, step * primal_step, 0) != 0;
  return !p->interrupted;
}

/// Rows: every slot but the ranges of scalar joints, which bound the unknowns.
static int is_bound(const cav_transcription *tr, int t, int i, int *dof) {
  const cav_slot_layout *at = &tr->knot[t].layout;
  if (i < at->joint || i >= at->tendon) return 0;
  int joint = 0;
  for (int left = i - at->joint; left >= 0; joint++) left -= tr->model->joint[joint].limited;
  *dof = tr->model->joint[joint - 1].dof;
  return tr->model->joint[joint - 1].type != CAV_JOINT_BALL;
}

/// Whether a row depends on the step: forces, and terms that read more than the configuration.
static int sees_step(const cav_transcription *tr, int t, int i) {
  const cav_slot_layout *at = &tr->knot[t].layout;
  return i < at->joint || i >= at->term;
}

static int list_rows(program *p, char *pattern) {
  const cav_transcription *tr = p->run->tr;
  int nv = tr->nv, dof;
  for (int pass = 0; pass < 2; pass++) {
    int m = 0, entries = 0;
    for (int t = 0; t < tr->nknot; t++) {
      for (int i = 0; i < tr->knot[t].layout.count; i++) {
        if (is_bound(tr, t, i, &dof)) continue;
        if (pass) p->row_knot[m] = t, p->row_slot[m] = i;
        cav_transcription_pattern(tr, t, i, pattern);
        for (int c = 0; c < 3 * nv; c++) {
          if (!pattern[c]) continue;
          if (pass) {
            p->jacobian_row[entries] = m;
            p->jacobian_column[entries] = cav_transcription_block(tr, t, c / nv) * nv + c % nv;
            p->source[entries] = c;
          }
          entries++;
        }
        // a free step is seen by what is not of the posture alone
        if (tr->free_step && sees_step(tr, t, i)) {
          if (pass) {
            p->jacobian_row[entries] = m;
            p->jacobian_column[entries] = p->n - 1;
            p->source[entries] = 3 * nv;
          }
          entries++;
        }
        m++;
      }
    }
    if (pass) break;
    p->m = m;
    p->entries = entries;
    p->row_knot = malloc((size_t)(m + 1) * sizeof(int));
    p->row_slot = malloc((size_t)(m + 1) * sizeof(int));
    p->jacobian_row = malloc((size_t)(entries + 1) * sizeof(int));
    p->jacobian_column = malloc((size_t)(entries + 1) * sizeof(int));
    p->source = malloc((size_t)(entries + 1) * sizeof(int));
    if (!p->row_knot || !p->row_slot || !p->jacobian_row || !p->jacobian_column || !p->source) return 0;
  }
  return 1;
}

/// Bounds of unknowns and rows, Ipopt's infinity where open.
static void set_bounds(const program *p, double *x_lower, double *x_upper, double *g_lower, double *g_upper) {
  const cav_transcription *tr = p->run->tr;
  const double infinite = 2e19;
  int dof;
  for (int i = 0; i < p->n; i++) x_lower[i] = -infinite, x_upper[i] = infinite;
  if (tr->free_step) {
    double steps = tr->nknot - 1;
    x_lower[p->n - 1] = log(tr->problem->duration_least / (steps * p->anchor->timestep));
    x_upper[p->n - 1] = log(tr->problem->duration_most / (steps * p->anchor->timestep));
  }
  for (int t = 1; t < tr->nknot; t++) {
    for (int i = tr->knot[t].layout.joint; i < tr->knot[t].layout.tendon; i++) {
      if (!is_bound(tr, t, i, &dof)) continue;
      const cav_slot *slot = &tr->knot[t].slot[i];
      x_lower[(t - 1) * tr->nv + dof] = slot->lower - slot->value;
      x_upper[(t - 1) * tr->nv + dof] = slot->upper - slot->value;
    }
  }
  for (int i = 0; i < p->m; i++) {
    const cav_slot *slot = &tr->knot[p->row_knot[i]].slot[p->row_slot[i]];
    g_lower[i] = fmax(slot->lower, -infinite);
    g_upper[i] = fmin(slot->upper, infinite);
  }
}

/// Multipliers of rows [m], lower and upper bounds [n] each: from the rows' multipliers, or back into their multipliers.
static void multipliers_of(const program *p, double *multiplier, int back) {
  const cav_transcription *tr = p->run->tr;
  double *lower = multiplier + p->m, *upper = lower + p->n;
  int dof;
  for (int i = 0; i < p->m; i++) {
    cav_slot *slot = &tr->knot[p->row_knot[i]].slot[p->row_slot[i]];
    if (back) slot->multiplier = multiplier[i];
    multiplier[i] = slot->final_multiplier;
  }
  for (int t = 1; t < tr->nknot; t++) {
    for (int i = tr->knot[t].layout.joint; i < tr->knot[t].layout.tendon; i++) {
      if (!is_bound(tr, t, i, &dof)) continue;
      int k = (t - 1) * tr->nv + dof;
      cav_slot *slot = &tr->knot[t].slot[i];
      if (back) slot->multiplier = upper[k] - lower[k];
      lower[k] = fmax(-slot->final_multiplier, 0);
      upper[k] = fmax(slot->final_multiplier, 0);
    }
  }
}

/// Options that serve all motions; a problem or a caller may set others, and these anew.
static const cav_ipopt_option usual[] = {
    {"nlp_scaling_method", "none"},
    {"max_iter", "200"},
    {"tol", "1e-3"},
    {"acceptable_tol", "1e-1"},
    {"acceptable_iter", "10"},
    {"acceptable_constr_viol_tol", "1e-4"},
    {"mu_init", "1e-4"},
    {"mumps_mem_percent", "200"},
    {"mumps_pivot_order", "0"},
    {"warm_start_bound_push", "1e-6"},
    {"warm_start_slack_bound_push", "1e-6"},
    {"warm_start_mult_bound_push", "1e-6"},
};

static int set_option(IpoptProblem nlp, const cav_ipopt_option *option) {
  double number = 0;
  const cav_ipopt_rule *rule = cav_ipopt_check(option, &number, NULL);
  if (!rule) return 0;
  if (rule->type == CAV_IPOPT_WHOLE) return AddIpoptIntOption(nlp, (char *)option->name, (int)number);
  if (rule->type == CAV_IPOPT_REAL) return AddIpoptNumOption(nlp, (char *)option->name, number);
  return AddIpoptStrOption(nlp, (char *)option->name, (char *)option->value);
}

static int set_options(IpoptProblem nlp, const cav_solve_run *run) {
  const cav_solve_options *o = run->options;
  // silent, and deaf to a file ipopt.opt that happens to lie where the program runs
  int ok = AddIpoptIntOption(nlp, "print_level", 0) && AddIpoptStrOption(nlp, "sb", "yes") &&
           AddIpoptStrOption(nlp, "option_file_name", "");
  for (size_t i = 0; i < sizeof usual / sizeof *usual; i++) ok = ok && set_option(nlp, &usual[i]);
  ok = ok && AddIpoptNumOption(nlp, "constr_viol_tol", o->tolerance);
  if (run->warm) ok = ok && AddIpoptStrOption(nlp, "warm_start_init_point", "yes");
  for (int i = 0; i < run->problem->nipopt; i++) ok = ok && set_option(nlp, &run->problem->ipopt[i]);
  for (int i = 0; i < o->nipopt; i++) ok = ok && set_option(nlp, &o->ipopt[i]);
  if (o->ipopt_derivative_test) {
    ok = ok && AddIpoptStrOption(nlp, "derivative_test", "first-order");
    ok = ok && AddIpoptNumOption(nlp, "point_perturbation_radius", 0) &&
         AddIpoptNumOption(nlp, "derivative_test_perturbation", test_step);
    ok = ok && AddIpoptNumOption(nlp, "derivative_test_tol", test_tolerance);
  }
  if (o->ipopt_output) ok = ok && OpenIpoptOutputFile(nlp, (char *)o->ipopt_output, 5);
  return ok;
}

/// Ipopt's verdict as a status with its meaning in words.
static cav_status conclude(const program *p, enum ApplicationReturnStatus code, cav_error *error) {
  static const struct {
    enum ApplicationReturnStatus code;
    cav_status status;
    const char *text;
  } meaning[] = {
      {Solve_Succeeded, CAV_OK, ""},
      {Solved_To_Acceptable_Level, CAV_OK, ""},
      {Feasible_Point_Found, CAV_OK, ""},
      {Infeasible_Problem_Detected, CAV_NOT_CONVERGED, "Ipopt found the constraints locally infeasible"},
      {Search_Direction_Becomes_Too_Small, CAV_NOT_CONVERGED,
       "Ipopt's steps became too small: the noise of the derivatives bounds what it can reach"},
      {Diverging_Iterates, CAV_NOT_CONVERGED, "Ipopt's iterates diverge"},
      {Maximum_Iterations_Exceeded, CAV_NOT_CONVERGED, "Ipopt reached its iteration limit (max_iter)"},
      {Maximum_CpuTime_Exceeded, CAV_NOT_CONVERGED, "Ipopt reached its time limit (max_cpu_time)"},
      {Not_Enough_Degrees_Of_Freedom, CAV_NOT_CONVERGED, "the problem has more equality constraints than unknowns"},
      {Invalid_Number_Detected, CAV_NOT_FINITE, "the dynamics gave Ipopt a number that is not finite"},
      {Restoration_Failed, CAV_NOT_CONVERGED, "Ipopt's restoration of feasibility failed"},
      {Error_In_Step_Computation, CAV_NOT_CONVERGED, "Ipopt could not compute a step"},
      {Invalid_Option, CAV_BAD_INPUT, "Ipopt does not know an option's value: is the linear solver installed?"},
      {Insufficient_Memory, CAV_NO_MEMORY, "Ipopt ran out of memory"},
  };
  if (p->interrupted) return CAV_INTERRUPTED;
  for (size_t i = 0; i < sizeof meaning / sizeof *meaning; i++) {
    if (meaning[i].code != code) continue;
    // an iterate whose rows hold and whose dual is noise is a solution, however Ipopt went on from there
    if (meaning[i].status == CAV_NOT_CONVERGED && p->best_error <= 1 && p->best_iteration >= 0) return CAV_OK;
    if (error && meaning[i].status != CAV_OK) {
      *error = (cav_error){.status = meaning[i].status};
      // where it ended, what is kept instead, and whether it is the derivatives' noise that keeps the dual up
      const char *better = p->run->warm ? "" : " (from the guess alone: --solver both starts it from a better motion)";
      int n = snprintf(error->text, sizeof error->text, "%s%s; constraints were left with %.2g, the dual with %.2g",
                       meaning[i].text, better, p->infeasibility, p->dual);
      if (p->best_iteration >= 0)
        snprintf(error->text + n, sizeof error->text - (size_t)n, "; kept is its iterate %d, with %.2g and %.2g%s",
                 p->best_iteration, p->best_infeasibility, p->best_dual,
                 p->best_infeasibility <= acceptable && p->best_dual < noise
                     ? ": all but optimal, within the noise of the derivatives"
                     : "");
    }
    return meaning[i].status;
  }
  if (error) {
    *error = (cav_error){.status = CAV_NOT_CONVERGED};
    snprintf(error->text, sizeof error->text, "Ipopt stopped with return code %d", (int)code);
  }
  return CAV_NOT_CONVERGED;
}

static void program_free(program *p) {
  cav_trajectory_free(p->anchor);
  free(p->row_knot), free(p->row_slot), free(p->jacobian_row), free(p->jacobian_column), free(p->source);
  free(p->x), free(p->full), free(p->best_x);
}

cav_status cav_ipopt(cav_solve_run *run, cav_error *error) {
  cav_transcription *tr = run->tr;
  cav_penalties kept = tr->penalty;
  cav_derivative difference = tr->difference;
  program p = {
      .run = run, .n = cav_transcription_unknowns(tr), .anchor = cav_trajectory_copy(run->at), .best_iteration = -1};
  IpoptProblem nlp = NULL;
  double *bound = NULL, *start = NULL, *multiplier = NULL;
  char *pattern = malloc(4 * (size_t)tr->nv);
  cav_status status = CAV_NO_MEMORY;
  p.x = calloc((size_t)p.n, sizeof(double));
  p.full = malloc((3 * (size_t)tr->nv + 1) * sizeof(double));
  p.best_x = malloc((size_t)p.n * sizeof(double));
  if (!p.anchor || !p.x || !p.full || !p.best_x || !pattern || !cav_transcription_keep_rows(tr) ||
      !list_rows(&p, pattern))
    goto end;
  bound = malloc((2 * (size_t)p.n + 2 * (size_t)p.m + 1) * sizeof(double));
  start = calloc((size_t)p.n, sizeof(double));
  multiplier = calloc(2 * (size_t)p.n + (size_t)p.m + 1, sizeof(double));
  if (!bound || !start || !multiplier) goto end;

  // costs alone are the objective: constraint rows get no weight of their own
  run->phase = "ipopt";
  run->stages = 0;
  tr->penalty = (cav_penalties){0};
  tr->difference = CAV_DERIVATIVE_CENTRED;
  if ((status = cav_transcription_values(tr, run->at)) != CAV_OK) goto end;
  set_bounds(&p, bound, bound + p.n, bound + 2 * p.n, bound + 2 * p.n + p.m);
  nlp = CreateIpoptProblem(p.n, bound, bound + p.n, p.m, bound + 2 * p.n, bound + 2 * p.n + p.m, p.entries,
                           cav_normal_entries(run->normal, NULL, NULL, NULL), 0, objective, constraints,
                           objective_gradient, constraint_jacobian, lagrangian_hessian);
  status = CAV_NO_MEMORY;
  if (!nlp) goto end;
  if (!set_options(nlp, run)) {
    status = conclude(&p, Invalid_Option, error);
    goto end;
  }
  SetIntermediateCallback(nlp, progress);
  multipliers_of(&p, multiplier, 0);
  enum ApplicationReturnStatus code =
      IpoptSolve(nlp, start, NULL, NULL, multiplier, multiplier + p.m, multiplier + p.m + p.n, &p);
  status = conclude(&p, code, error);
  // one that failed or was stopped gives its best iterate, with the multipliers that it started from
  int best = code != Solve_Succeeded && code != Solved_To_Acceptable_Level && p.best_iteration >= 0;
  if (!best) multipliers_of(&p, multiplier, 1);
  cav_transcription_move(tr, p.anchor, best ? p.best_x : start, run->at);
end:
  tr->penalty = kept;
  tr->difference = difference;
  if (nlp) FreeIpoptProblem(nlp);
  program_free(&p);
  free(bound), free(start), free(multiplier), free(pattern);
  return status;
}
