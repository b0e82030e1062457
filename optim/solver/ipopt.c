/// Ipopt on the transcription, stage by stage of the continuation: unknowns are tangent increments about the trajectory
/// that a stage starts from. On the way constraints are penalised; at the end forces that no actuator can give are hard
/// equalities, efforts, tendon ranges and hard terms are bounded rows, joint ranges bound the unknowns (METHOD.md, 2).
/// The only user of Ipopt; written against 3.11 and 3.14 (index and number are int and double in both).
#include "ipopt.h"

#include <IpStdCInterface.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "ipopt_options.h"
#include "ipopt_rows.h"
#include "lagrangian.h"
#include "library.h"
#include "rotation.h"

// clang-format off
#define FUNCTIONS(X) \
  X(CreateIpoptProblem) X(FreeIpoptProblem) X(AddIpoptStrOption) X(AddIpoptNumOption) X(AddIpoptIntOption) \
  X(OpenIpoptOutputFile) X(SetIntermediateCallback) X(IpoptSolve)
// clang-format on

typedef struct functions {
  FUNCTIONS(CAV_LIBRARY_POINTER)
} functions;

static const cav_library library = {
    "Ipopt", CAVORT_LOADS_IPOPT, "coinor-libipopt-dev", {FUNCTIONS(CAV_LIBRARY_NAME) NULL}};

/// Our own option among Ipopt's: which Hessian it gets.
static const char hessian_option[] = "hessian";

/// Dual infeasibility that the noise of derivatives explains where contacts act, and where none does; violation from
/// which the last step brings all rows in.
static const double contact_noise = 1, smooth_noise = 1e-6, acceptable = 1e-4;

/// Iterations of a stage on the way, at most.
enum { STAGE_ITERATIONS = 60 };

/// Barrier parameters: of a solve that begins with the rows; after the continuation, which ends near the optimum, where
/// a barrier only leads away; and from an optimum with its multipliers. After the continuation Ipopt may not push its
/// start off the bounds by more than that: pushed by its usual 1e-2 rad contacts give forces of hundreds of weights.
static const double cold_barrier = 1e-4, near_barrier = 1e-6, warm_barrier = 1e-8;
static const char near_push[] = "1e-6";

/// After the continuation the filter takes no iterate whose rows are farther off, all together, than at its start, or
/// than this: by its usual 1e4 times that, steps of a Gauss-Newton Hessian leave for where nothing comes back from.
static const double near_violation = 1;

/// Gauss-Newton Hessians, whose dual infeasibility says nothing where contacts act: a stage has settled where what it
/// minimises stays within a fraction of itself over a window of iterations, its rows not far off. On the way it ends.
/// The last one is closed: steps that the damping makes the shortest bring the rows in, within so many iterations.
typedef struct settling {
  int window;
  double change;
} settling;
static const settling on_the_way = {4, 2.5e-3}, at_the_end = {12, 2e-3};
static const double settled_violation = 0.1, closing_damping = 1e4;
enum { CLOSING_ITERATIONS = 25, WINDOW_MOST = 16 };

/// Gauss-Newton Hessians: added to the diagonal, per second of the step, 1/rad^2 or 1/m^2, at a stage's start and at
/// least. It stands for the curvature that is left out: four times as much after a step that the line search cut, a
/// quarter after a full one.
static const double damping = 1.2, least_damping = 0.1, most_damping = 1e4, damping_change = 4;

/// After Gauss-Newton's last stage: iterations with the exact Hessian, times degrees of freedom, as each takes about
/// that much longer; fewer than the least are not worth it.
enum { EXACT_ITERATIONS = 200, LEAST_EXACT_ITERATIONS = 10 };

/// Differences of the Lagrangian's gradient by the step's logarithm.
static const double step_shift = 1e-4;

/// Ipopt's checker takes one-sided differences, at the start itself: away from it the law is stiff beyond any step.
/// Contacts and their costs have second derivatives up to 3e7, so a step p is off by 1.5e7 p, and rounding of objective
/// and forces by about 5e-13 / p: least near 2e-10, where both together mostly stay below the tolerance. Second derivatives
/// of 5e7 occur (squat-jump on another humanoid): tests look again at half of the step (tests/motion.h).
static const double test_step = 2e-10, test_tolerance = 8e-3;

/// What one run of Ipopt is to do.
typedef struct stage {
  double fraction; ///< of the schedule
  int passing;     ///< on the way to the last: rows and bounds are penalised in the objective
  int near;        ///< starts where stages on the way ended
  int exact;       ///< the Hessian has the curvature of all rows
  int iterations;  ///< at most, 0: as the options say
} stage;

typedef struct program {
  functions call;
  IpoptProblem nlp;
  cav_solve_run *run;
  cav_trajectory *anchor; ///< x = 0
  int n;
  cav_ipopt_rows rows;
  double *x;      ///< [n] point of the last evaluation
  int known;      ///< 1: values at x are known, 2: derivatives too
  double *full;   ///< [3nv+1] a row while it is rotated, and its entry of the step
  double damping; ///< of Gauss-Newton Hessians, per second
  double noise;   ///< of the dual
  double barrier; ///< parameter that the stage starts from
  int exact;
  double **hessian;           ///< [nknot][9nv^2] of the Lagrangian
  double *near;               ///< [3n] a point beside x and gradients there, where the step is free
  int *entry;                 ///< [2*entries of the Hessian] its rows, then its columns, where the step is free
  int settles;                ///< with a Hessian of Gauss-Newton that the damping can steer
  double infeasibility, dual; ///< of the last iterate, as Ipopt measures them
  double *best_x;             ///< [n] the iterate that is nearest to an optimum
  double best_error, best_infeasibility, best_dual;
  int best_iteration;              ///< -1: none yet
  int begins_near;                 ///< as of the stage
  double recent_cost[WINDOW_MOST]; ///< a ring
  int window_start, settled;       ///< iteration from which costs count; one at which they had settled, 0: not yet
  int finished;                    ///< stopped by us: settled, and where it is the last stage with its rows in
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
  *value = cav_transcription_merit(p->run->tr);
  return 1;
}

static Bool objective_gradient(int n, double *x, Bool fresh, double *gradient, UserDataPtr data) {
  program *p = data;
  (void)fresh;
  if (!evaluate(p, x, 1)) return 0;
  memcpy(gradient, cav_normal_gradient(p->run->normal), (size_t)n * sizeof *gradient);
  for (int b = 0; b < cav_transcription_blocks(p->run->tr); b++)
    rotation_row(p, b, gradient + (size_t)b * p->run->tr->nv);
  return 1;
}

static Bool constraints(int n, double *x, Bool fresh, int m, double *g, UserDataPtr data) {
  program *p = data;
  (void)n, (void)fresh;
  if (!evaluate(p, x, 0)) return 0;
  for (int i = 0; i < m; i++) g[i] = p->run->tr->knot[p->rows.row_knot[i]].slot[p->rows.row_slot[i]].value;
  return 1;
}

static Bool constraint_jacobian(int n, double *x, Bool fresh, int m, int entries, int *row, int *column, double *value,
                                UserDataPtr data) {
  program *p = data;
  (void)n, (void)fresh, (void)m;
  if (!value) {
    memcpy(row, p->rows.jacobian_row, (size_t)entries * sizeof *row);
    memcpy(column, p->rows.jacobian_column, (size_t)entries * sizeof *column);
    return 1;
  }
  if (!evaluate(p, x, 1)) return 0;
  const cav_transcription *tr = p->run->tr;
  int nv = tr->nv, last = -1;
  for (int k = 0; k < entries; k++) {
    int i = p->rows.jacobian_row[k], t = p->rows.row_knot[i];
    if (i != last) {
      memcpy(p->full, tr->knot[t].slot_row + (size_t)p->rows.row_slot[i] * 3 * nv, 3 * (size_t)nv * sizeof(double));
      for (int c = 0; c < 3; c++) rotation_row(p, cav_transcription_block(tr, t, c), p->full + c * nv);
      p->full[3 * nv] = tr->knot[t].slot_step[p->rows.row_slot[i]];
      last = i;
    }
    value[k] = p->full[p->rows.source[k]];
  }
  return 1;
}

/// A lower triangle of size n onto the upper one, too; or the upper one zero.
static void fill_upper(int n, double *H, int mirrored) {
  for (int i = 0; i < n; i++)
    for (int j = i + 1; j < n; j++) H[i * n + j] = mirrored ? H[j * n + i] : 0;
}

static void transpose(int n, double *H) {
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < i; j++) {
      double kept = H[i * n + j];
      H[i * n + j] = H[j * n + i];
      H[j * n + i] = kept;
    }
  }
}

/// A knot's Hessian over tangents at the configurations to one over the unknowns: Jr' H Jr.
static void rotate_hessian(const program *p, int t) {
  const cav_transcription *tr = p->run->tr;
  int width = 3 * tr->nv;
  double *H = tr->knot[t].hessian;
  if (tr->nrotation == 0) return;
  fill_upper(width, H, 1);
  for (int side = 0; side < 2; side++) {
    for (int i = 0; i < width; i++)
      for (int c = 0; c < 3; c++) rotation_row(p, cav_transcription_block(tr, t, c), H + i * width + c * tr->nv);
    transpose(width, H);
  }
  fill_upper(width, H, 0);
}

/// Gradient of the Lagrangian at x.
static int lagrangian_gradient(program *p, const double *x, double factor, const double *multiplier, double *g) {
  if (!evaluate(p, x, 1)) return 0;
  const cav_transcription *tr = p->run->tr;
  for (int i = 0; i < p->n; i++) g[i] = factor * cav_normal_gradient(p->run->normal)[i];
  for (int i = 0; i < p->rows.m; i++) {
    int t = p->rows.row_knot[i];
    const double *row = tr->knot[t].slot_row + (size_t)p->rows.row_slot[i] * 3 * tr->nv;
    for (int c = 0; c < 3; c++) {
      int block = cav_transcription_block(tr, t, c);
      for (int d = 0; block >= 0 && d < tr->nv; d++) g[block * tr->nv + d] += multiplier[i] * row[c * tr->nv + d];
    }
    if (tr->free_step) g[p->n - 1] += multiplier[i] * tr->knot[t].slot_step[p->rows.row_slot[i]];
  }
  for (int b = 0; b < cav_transcription_blocks(tr); b++) rotation_row(p, b, g + (size_t)b * tr->nv);
  return 1;
}

/// Second derivatives by the step's logarithm, into the entries of the last row: every row bends with the step, so
/// Gauss-Newton has nothing to offer here. Ends at x, with derivatives.
static int step_hessian(program *p, const double *x, double factor, const double *multiplier, int entries,
                        double *value) {
  double *y = p->near, *after = y + p->n, *before = after + p->n;
  memcpy(y, x, (size_t)p->n * sizeof *y);
  y[p->n - 1] = x[p->n - 1] + step_shift;
  if (!lagrangian_gradient(p, y, factor, multiplier, after)) return 0;
  y[p->n - 1] = x[p->n - 1] - step_shift;
  if (!lagrangian_gradient(p, y, factor, multiplier, before)) return 0;
  for (int k = 0; k < entries; k++) {
    int column = p->entry[entries + k];
    if (p->entry[k] == p->n - 1) value[k] = (after[column] - before[column]) / (2 * step_shift);
  }
  return evaluate(p, x, 1);
}

/// Exchanges the knots' Hessians for those of the Lagrangian, or back.
static void exchange_hessians(program *p) {
  cav_transcription *tr = p->run->tr;
  for (int t = 0; t < tr->nknot; t++) {
    double *kept = tr->knot[t].hessian;
    tr->knot[t].hessian = p->hessian[t];
    p->hessian[t] = kept;
  }
}

/// What each slot pulls with: its row's multiplier, or on the way its penalty.
static void take_multipliers(program *p, double factor, const double *multiplier) {
  cav_transcription *tr = p->run->tr;
  for (int i = 0; i < p->rows.m; i++)
    tr->knot[p->rows.row_knot[i]].slot[p->rows.row_slot[i]].final_multiplier = multiplier[i];
  if (!p->rows.passing) return;
  cav_transcription_estimate_multipliers(tr, NULL);
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].final_multiplier *= factor;
}

/// Gathers the Hessian of the Lagrangian at the last linearisation, which stays as it is.
static int gather_hessian(program *p, double factor, const double *multiplier) {
  cav_transcription *tr = p->run->tr;
  int width = 3 * tr->nv;
  cav_status status = CAV_OK;
  take_multipliers(p, factor, multiplier);
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < width * width; i++) p->hessian[t][i] = factor * tr->knot[t].hessian[i];
  exchange_hessians(p);
  if (p->exact) status = cav_lagrangian_curvature(tr, p->run->at, factor, NULL);
  for (int t = 0; t < tr->nknot; t++) rotate_hessian(p, t);
  cav_normal_gather(p->run->normal, tr);
  exchange_hessians(p);
  return status == CAV_OK;
}

static Bool lagrangian_hessian(int n, double *x, Bool fresh, double factor, int m, double *multiplier,
                               Bool fresh_multiplier, int entries, int *row, int *column, double *value,
                               UserDataPtr data) {
  program *p = data;
  const cav_transcription *tr = p->run->tr;
  (void)n, (void)fresh, (void)m, (void)fresh_multiplier;
  if (!value) {
    cav_normal_entries(p->run->normal, row, column, NULL);
    return 1;
  }
  if (!evaluate(p, x, 1) || !gather_hessian(p, factor, multiplier)) return 0;
  cav_normal_entries(p->run->normal, NULL, NULL, value);
  if (!p->exact) cav_normal_shift_entries(p->run->normal, 1, p->damping * tr->options.timestep, 0, value);
  return !tr->free_step || step_hessian(p, x, factor, multiplier, entries, value);
}

/// Keeps the iterate if none was nearer to an optimum. A line search that meets the noise of the derivatives can wander
/// off, and the restoration of Ipopt ends anywhere. On the way, where there are no rows, cost is what tells.
static void keep_best(program *p, int iteration, double cost) {
  double error = p->rows.passing ? cost : fmax(p->infeasibility / p->run->options->tolerance, p->dual / p->noise);
  if (p->known < 2 || !(p->best_iteration < 0 || error < p->best_error)) return;
  memcpy(p->best_x, p->x, (size_t)p->n * sizeof(double));
  p->best_error = error;
  p->best_infeasibility = p->infeasibility;
  p->best_dual = p->dual;
  p->best_iteration = iteration;
}

/// Notes an iterate's cost; whether the window up to it has settled. Restoration knows no cost: the window begins anew.
static int has_settled(program *p, int mode, int iteration, double cost) {
  const settling *rule = p->rows.passing ? &on_the_way : &at_the_end;
  double least = cost, most = cost;
  p->recent_cost[iteration % WINDOW_MOST] = cost;
  if (mode) p->window_start = iteration + 1;
  if (!p->settles || iteration < p->window_start + rule->window || p->infeasibility > settled_violation) return 0;
  for (int i = 1; i <= rule->window; i++) {
    least = fmin(least, p->recent_cost[(iteration - i) % WINDOW_MOST]);
    most = fmax(most, p->recent_cost[(iteration - i) % WINDOW_MOST]);
  }
  return most - least < rule->change * fabs(cost);
}

/// Whether Ipopt is to stop here: a stage that has settled, the last one also closed.
static int is_finished(program *p, int mode, int iteration, double cost) {
  if (!p->settled && has_settled(p, mode, iteration, cost)) p->settled = iteration;
  if (!p->settled) return 0;
  p->damping = closing_damping;
  return p->rows.passing || p->infeasibility <= p->run->options->tolerance ||
         iteration >= p->settled + CLOSING_ITERATIONS;
}

static Bool progress(int mode, int iteration, double cost, double infeasibility, double dual, double mu, double step,
                     double regularisation, double dual_step, double primal_step, int trials, UserDataPtr data) {
  program *p = data;
  (void)mu, (void)regularisation, (void)dual_step;
  p->infeasibility = infeasibility;
  p->dual = dual;
  if (mode == 0) keep_best(p, iteration, cost);
  if (iteration > 0)
    p->damping =
        trials > 1 ? fmin(p->damping * damping_change, most_damping) : fmax(p->damping / damping_change, least_damping);
  // the Hessian is next, and with other duals another one
  if (p->known == 2 && cav_absolute_advance(p->run->tr, iteration > 0 ? primal_step : 0)) p->known = 1;
  p->finished = is_finished(p, mode, iteration, cost);
  // the start is none of its iterations
  if (p->known) p->interrupted = iteration > 0 ? cav_run_report(p->run, step * primal_step, 0) : cav_run_stop(p->run);
  // from near an optimum the restoration of Ipopt only leads away, for as long as it may
  int leaves = p->begins_near && p->settles && mode;
  return !p->interrupted && !p->finished && !leaves;
}

/// Options that serve all motions; a problem or a caller may set others, and these anew.
static const cav_ipopt_option usual[] = {
    {"nlp_scaling_method", "none"},
    {"max_iter", "200"},
    {"acceptable_iter", "10"},
    {"acceptable_constr_viol_tol", "1e-4"},
    {"mumps_mem_percent", "200"},
    {"mumps_pivot_order", "2"}, // AMF; of AMD, METIS and SCOTCH none is faster on motions
    {"mumps_pivtol", "1e-8"},   // of 1e-6: pivots that are delayed fill the band, up to ten times the time
    {"warm_start_bound_push", "1e-6"},
    {"warm_start_slack_bound_push", "1e-6"},
    {"warm_start_mult_bound_push", "1e-6"},
};

/// What a Hessian can reach: Gauss-Newton's creeps where constraints bend, the exact one ends at rounding.
static const cav_ipopt_option rough[] = {{"tol", "1e-3"}, {"acceptable_tol", "1e-1"}},
                              sharp[] = {{"tol", "1e-9"}, {"acceptable_tol", "1e-7"}, {"compl_inf_tol", "1e-10"}};

static int set_option(const program *p, const cav_ipopt_option *option) {
  double number = 0;
  if (!strcmp(option->name, hessian_option)) return 1;
  const cav_ipopt_rule *rule = cav_ipopt_check(option, &number, NULL);
  if (!rule) return 0;
  if (rule->type == CAV_IPOPT_WHOLE) return p->call.AddIpoptIntOption(p->nlp, (char *)option->name, (int)number);
  if (rule->type == CAV_IPOPT_REAL) return p->call.AddIpoptNumOption(p->nlp, (char *)option->name, number);
  return p->call.AddIpoptStrOption(p->nlp, (char *)option->name, (char *)option->value);
}

static int set_list(const program *p, int n, const cav_ipopt_option *option) {
  int ok = 1;
  for (int i = 0; i < n; i++) ok = ok && set_option(p, &option[i]);
  return ok;
}

/// The last value that the problem or the caller gives an option; NULL: neither does.
static const char *option_given(const cav_solve_run *run, const char *name) {
  const char *value = NULL;
  for (int i = 0; i < run->problem->nipopt; i++)
    if (!strcmp(run->problem->ipopt[i].name, name)) value = run->problem->ipopt[i].value;
  for (int i = 0; i < run->options->nipopt; i++)
    if (!strcmp(run->options->ipopt[i].name, name)) value = run->options->ipopt[i].value;
  return value;
}

/// Options of a stage, whose iterations are limited if that is not 0.
static int set_options(const program *p, const stage *what) {
  const cav_solve_run *run = p->run;
  const cav_solve_options *o = run->options;
  // silent, and deaf to a file ipopt.opt that happens to lie where the program runs
  int ok = p->call.AddIpoptIntOption(p->nlp, "print_level", 0) && p->call.AddIpoptStrOption(p->nlp, "sb", "yes") &&
           p->call.AddIpoptStrOption(p->nlp, "option_file_name", "");
  ok = ok && set_list(p, sizeof usual / sizeof *usual, usual);
  ok = ok &&
       (p->exact ? set_list(p, sizeof sharp / sizeof *sharp, sharp) : set_list(p, sizeof rough / sizeof *rough, rough));
  ok = ok && p->call.AddIpoptNumOption(p->nlp, "constr_viol_tol", o->tolerance) &&
       p->call.AddIpoptNumOption(p->nlp, "mu_init", p->barrier);
  const cav_ipopt_option push[] = {{"bound_push", near_push}, {"bound_frac", near_push}};
  if (what->near)
    ok = ok && set_list(p, sizeof push / sizeof *push, push) &&
         p->call.AddIpoptNumOption(p->nlp, "theta_max_fact", near_violation);
  if (run->warm) ok = ok && p->call.AddIpoptStrOption(p->nlp, "warm_start_init_point", "yes");
  if (o->ipopt_derivative_test) {
    ok = ok && p->call.AddIpoptStrOption(p->nlp, "derivative_test", "first-order");
    ok = ok && p->call.AddIpoptNumOption(p->nlp, "point_perturbation_radius", 0) &&
         p->call.AddIpoptNumOption(p->nlp, "derivative_test_perturbation", test_step);
    ok = ok && p->call.AddIpoptNumOption(p->nlp, "derivative_test_tol", test_tolerance);
  }
  ok = ok && set_list(p, run->problem->nipopt, run->problem->ipopt) && set_list(p, o->nipopt, o->ipopt);
  const char *most = option_given(run, "max_iter");
  if (what->passing) ok = ok && p->call.AddIpoptIntOption(p->nlp, "watchdog_shortened_iter_trigger", 0);
  if (what->iterations > 0 && !(most && atoi(most) < what->iterations))
    ok = ok && p->call.AddIpoptIntOption(p->nlp, "max_iter", what->iterations);
  if (o->ipopt_output) ok = ok && p->call.OpenIpoptOutputFile(p->nlp, (char *)o->ipopt_output, 5);
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
      {User_Requested_Stop, CAV_NOT_CONVERGED,
       "Ipopt was stopped, its costs settled or its restoration begun, before its constraints held"},
      {Maximum_CpuTime_Exceeded, CAV_NOT_CONVERGED, "Ipopt reached its time limit (max_cpu_time)"},
      {Not_Enough_Degrees_Of_Freedom, CAV_NOT_CONVERGED, "the problem has more equality constraints than unknowns"},
      {Invalid_Number_Detected, CAV_NOT_FINITE, "the dynamics gave Ipopt a number that is not finite"},
      {Restoration_Failed, CAV_NOT_CONVERGED, "Ipopt's restoration of feasibility failed"},
      {Error_In_Step_Computation, CAV_NOT_CONVERGED, "Ipopt could not compute a step"},
      {Invalid_Option, CAV_BAD_INPUT, "Ipopt does not know an option's value: is the linear solver installed?"},
      {Insufficient_Memory, CAV_NO_MEMORY, "Ipopt ran out of memory"},
  };
  if (p->interrupted) return CAV_INTERRUPTED;
  if (p->finished && (p->rows.passing || p->infeasibility <= p->run->options->tolerance)) return CAV_OK;
  for (size_t i = 0; i < sizeof meaning / sizeof *meaning; i++) {
    if (meaning[i].code != code) continue;
    // an iterate whose rows hold and whose dual is noise is a solution, however Ipopt went on from there
    if (meaning[i].status == CAV_NOT_CONVERGED && !p->rows.passing && p->best_error <= 1 && p->best_iteration >= 0)
      return CAV_OK;
    if (error && meaning[i].status != CAV_OK) {
      *error = (cav_error){.status = meaning[i].status};
      // where it ended, what is kept instead, and whether it is the derivatives' noise that keeps the dual up
      int n = snprintf(error->text, sizeof error->text, "%s; constraints were left with %.2g, the dual with %.2g",
                       meaning[i].text, p->infeasibility, p->dual);
      if (p->best_iteration >= 0)
        snprintf(error->text + n, sizeof error->text - (size_t)n, "; kept is its iterate %d, with %.2g and %.2g%s",
                 p->best_iteration, p->best_infeasibility, p->best_dual,
                 p->best_infeasibility <= acceptable && p->best_dual < p->noise
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
  for (int t = 0; p->hessian && t < p->run->tr->nknot; t++) free(p->hessian[t]);
  cav_trajectory_free(p->anchor);
  cav_ipopt_rows_free(&p->rows);
  free(p->x), free(p->full), free(p->best_x), free(p->hessian), free(p->near), free(p->entry);
}

/// Memory of a program, and the structure of its Jacobian and Hessian.
static int program_new(program *p) {
  const cav_transcription *tr = p->run->tr;
  size_t n = (size_t)p->n, width = 3 * (size_t)tr->nv;
  int entries = cav_normal_entries(p->run->normal, NULL, NULL, NULL);
  p->x = calloc(n, sizeof(double));
  p->full = malloc((width + 1) * sizeof(double));
  p->best_x = malloc(n * sizeof(double));
  p->hessian = calloc((size_t)tr->nknot, sizeof *p->hessian);
  p->near = malloc(3 * n * sizeof(double));
  p->entry = malloc(2 * (size_t)entries * sizeof(int));
  int ok = p->anchor && p->x && p->full && p->best_x && p->hessian && p->near && p->entry;
  for (int t = 0; ok && t < tr->nknot; t++) ok = (p->hessian[t] = malloc(width * width * sizeof(double))) != NULL;
  ok = ok && cav_ipopt_rows_list(&p->rows, tr);
  if (ok) cav_normal_entries(p->run->normal, p->entry, p->entry + entries, NULL);
  return ok;
}

/// Whether Ipopt is to approximate the Hessian by itself.
static int is_limited(const cav_solve_run *run) {
  const char *approximation = option_given(run, "hessian_approximation");
  return approximation && !strcmp(approximation, "limited-memory");
}

static cav_status load(functions *call, cav_error *error) {
  char reason[300];
  cav_status status = cav_library_load(&library, call, sizeof *call, reason, sizeof reason);
  return status == CAV_OK ? status : cav_file_fail(error, status, 0, "%s", reason);
}

cav_status cav_ipopt_load(cav_error *error) {
  functions call;
  return load(&call, error);
}

/// Solves at the transcription's law from run->at and leaves the result there: at a stage's end its last iterate, else
/// the best.
static cav_status solve_stage(cav_solve_run *run, const stage *what, cav_error *error) {
  cav_transcription *tr = run->tr;
  cav_penalties kept = tr->penalty;
  cav_derivative difference = tr->difference;
  program p = {.run = run,
               .n = cav_transcription_unknowns(tr),
               .anchor = cav_trajectory_copy(run->at),
               .best_iteration = -1,
               .noise = cav_ipopt_law_acts(tr->model) ? contact_noise : smooth_noise,
               .barrier = run->warm    ? warm_barrier
                          : what->near ? near_barrier
                                       : cold_barrier,
               .damping = damping,
               .exact = what->exact,
               .settles = !what->exact && !is_limited(run),
               .rows = {.passing = what->passing},
               .begins_near = what->near};
  double *bound = NULL, *start = NULL, *multiplier = NULL;
  cav_status status = load(&p.call, error);
  if (status != CAV_OK) goto end;
  // costs are the objective: constraint rows get a weight of their own on the way alone
  if (!p.rows.passing) tr->penalty = (cav_penalties){0};
  tr->difference = CAV_DERIVATIVE_CENTRED;
  if ((status = cav_transcription_values(tr, run->at)) != CAV_OK) goto end;
  status = CAV_NO_MEMORY;
  if (!cav_transcription_keep_rows(tr) || !program_new(&p)) goto end;
  if (!is_limited(run) && !cav_absolute_begin(tr)) goto end;
  bound = malloc((2 * (size_t)p.n + 2 * (size_t)p.rows.m + 1) * sizeof(double));
  start = calloc((size_t)p.n, sizeof(double));
  multiplier = calloc(2 * (size_t)p.n + (size_t)p.rows.m + 1, sizeof(double));
  if (!bound || !start || !multiplier) goto end;

  cav_ipopt_rows_bounds(&p.rows, tr, p.anchor->timestep, bound, bound + p.n, bound + 2 * p.n,
                        bound + 2 * p.n + p.rows.m);
  p.nlp = p.call.CreateIpoptProblem(p.n, bound, bound + p.n, p.rows.m, bound + 2 * p.n, bound + 2 * p.n + p.rows.m,
                                    p.rows.entries, cav_normal_entries(run->normal, NULL, NULL, NULL), 0, objective,
                                    constraints, objective_gradient, constraint_jacobian, lagrangian_hessian);
  if (!p.nlp) goto end;
  if (!set_options(&p, what)) {
    status = conclude(&p, Invalid_Option, error);
    goto end;
  }
  p.call.SetIntermediateCallback(p.nlp, progress);
  cav_ipopt_rows_multipliers(&p.rows, tr, multiplier, 0);
  enum ApplicationReturnStatus code =
      p.call.IpoptSolve(p.nlp, start, NULL, NULL, multiplier, multiplier + p.rows.m, multiplier + p.rows.m + p.n, &p);
  status = conclude(&p, code, error);
  // one that failed or was stopped gives its best iterate, with the multipliers that it started from
  int ended = code == Solve_Succeeded || code == Solved_To_Acceptable_Level || p.finished ||
              (what->iterations > 0 && code == Maximum_Iterations_Exceeded);
  int best = !ended && p.best_iteration >= 0;
  if (!best) cav_ipopt_rows_multipliers(&p.rows, tr, multiplier, 1);
  cav_transcription_move(tr, p.anchor, best ? p.best_x : start, run->at);
end:
  tr->penalty = kept;
  tr->difference = difference;
  cav_absolute_drop(tr);
  if (p.nlp) p.call.FreeIpoptProblem(p.nlp);
  program_free(&p);
  free(bound), free(start), free(multiplier);
  return status;
}

/// Whether Hessians have the curvature of all rows: as asked, or where no contact makes it change within a millimetre.
static int is_exact(const cav_solve_run *run) {
  const char *hessian = option_given(run, hessian_option);
  if (hessian && strcmp(hessian, "auto")) return !strcmp(hessian, "exact");
  return !cav_ipopt_law_acts(run->problem->model);
}

/// Largest violation of all rows at run->at, with its costs.
static cav_status measure(cav_solve_run *run, double *violation, double *cost) {
  cav_status status = cav_transcription_values(run->tr, run->at);
  *violation = cav_run_rows_off(run);
  *cost = cav_transcription_cost(run->tr);
  return status;
}

/// One stage, noted.
static cav_status run_stage(cav_solve_run *run, const stage *what, cav_error *error) {
  int begin = run->solution->iterations;
  run->stage++;
  cav_status status = solve_stage(run, what, error);
  cav_outcome outcome = status == CAV_OK              ? CAV_OUTCOME_SETTLED
                        : status == CAV_NOT_CONVERGED ? CAV_OUTCOME_LIMIT
                                                      : CAV_OUTCOME_STOPPED;
  return cav_run_note(run, what->fraction, begin, outcome) ? status : CAV_NO_MEMORY;
}

static int goes_on(cav_status status) { return status == CAV_OK || status == CAV_NOT_CONVERGED; }

/// After Gauss-Newton the exact Hessian, whose steps are right where contacts have settled and wild where they have
/// not: kept if it converges, or if it leaves less violation or, with no more of it, less cost.
static cav_status sharpen(cav_solve_run *run, const stage *what, cav_status before, cav_error *error) {
  double violation, cost, was_violation, was_cost;
  cav_error mine = {0};
  cav_trajectory *kept = cav_trajectory_copy(run->at);
  if (!kept) return CAV_NO_MEMORY;
  cav_status status = measure(run, &was_violation, &was_cost);
  run->phase = "sharpening";
  if (status == CAV_OK) status = run_stage(run, what, &mine);
  if (goes_on(status)) {
    cav_status trial = measure(run, &violation, &cost);
    int better = violation <= fmax(acceptable, was_violation) && (was_violation > 10 * acceptable || cost < was_cost);
    if (trial != CAV_OK || !better) {
      cav_trajectory *swap = run->at;
      run->at = kept, kept = swap;
      status = before;
    } else if (error) {
      *error = mine;
    }
  }
  cav_trajectory_free(kept);
  return status;
}

cav_status cav_ipopt(cav_solve_run *run, cav_error *error) {
  int acts = cav_ipopt_law_acts(run->problem->model), alone = run->options->solver == CAV_SOLVER_IPOPT && acts;
  int stages = alone && !run->options->ipopt_derivative_test ? run->problem->schedule.stages : 0;
  int exact = is_exact(run), iterations = acts && !exact ? EXACT_ITERATIONS / run->problem->model->nv : 0;
  if (iterations < LEAST_EXACT_ITERATIONS || option_given(run, hessian_option) || is_limited(run)) iterations = 0;
  cav_status status = CAV_OK;
  run->stages = stages + 1 + (iterations > 0);
  run->stage = 0;
  run->phase = "continuation";
  for (int i = 0; i < stages && goes_on(status); i++) {
    double fraction = stages > 1 ? i / (stages - 1.0) : 1;
    stage way = {.fraction = fraction, .passing = 1, .exact = exact, .iterations = STAGE_ITERATIONS};
    cav_error passing; // that a stage is left at its limit is its nature
    cav_stage_set(run->problem, fraction, run->tr);
    status = run_stage(run, &way, &passing);
  }
  if (!goes_on(status)) return status;
  run->phase = "ipopt";
  if (run->options->solver == CAV_SOLVER_IPOPT) cav_stage_set(run->problem, 1, run->tr);
  stage last = {.fraction = 1, .near = stages > 0, .exact = exact};
  status = run_stage(run, &last, error);
  stage sharper = {.fraction = 1, .near = stages > 0, .exact = 1, .iterations = iterations};
  return iterations > 0 && goes_on(status) ? sharpen(run, &sharper, status, error) : status;
}
