/// From measurements to a recommendation. The motion with contacts counts where its reference is known to a tenth of the
/// error that is allowed, and the one without always. The step is the cheapest measured one whose error at the end is
/// within the fraction; the solver's tolerance the cheapest whose error, made in every step, adds a tenth of that.
#include "advice.h"

#include <string.h>

// ratios of times that count as clearly less, and as hardly more
static const double clearly = 0.7, hardly = 1.1;

static const double fractions[CAV_ADVICE_STEPS] = {0.1, 0.01, 1e-3, 1e-4, 1e-5};

// error of the motion without contacts by the order and step of a row; infinite where that was not measured
static double error_without(const cav_sheet *sheet, int row) {
  for (int r = 0; r < sheet->nrow; r++) {
    int alike = !strcmp(sheet->row[r].label[0], "free") && !strcmp(sheet->row[r].label[1], sheet->row[row].label[1]);
    if (alike && cav_sheet_get(sheet, r, CAV_STEP_STEP) == cav_sheet_get(sheet, row, CAV_STEP_STEP))
      return cav_sheet_get(sheet, r, CAV_STEP_ERROR);
  }
  return INFINITY;
}

// cheapest row of a motion whose error, and that of the other one where both count, is at most so large
static cav_advice_step cheapest_step(const cav_sheet *sheet, const char *motion, int both, double fraction,
                                     double size) {
  cav_advice_step best = {fraction, -1, NAN};
  for (int r = 0; r < sheet->nrow; r++) {
    double e = cav_sheet_get(sheet, r, CAV_STEP_ERROR), time = cav_sheet_get(sheet, r, CAV_STEP_TIME);
    if (strcmp(sheet->row[r].label[0], motion) || !isfinite(e) || !isfinite(time)) continue;
    if (both) e = error_without(sheet, r) > e ? error_without(sheet, r) : e;
    if (!(e <= fraction * size)) continue;
    if (best.row < 0 || time < cav_sheet_get(sheet, best.row, CAV_STEP_TIME)) best = (cav_advice_step){fraction, r, e};
  }
  return best;
}

// row of the tightest tolerance that costs hardly more than that of another row
static int tightest(const cav_sheet *sheet, int row) {
  double time = cav_sheet_get(sheet, row, CAV_FORWARD_TIME);
  int best = row;
  for (int r = 0; r < sheet->nrow; r++) {
    if (strcmp(sheet->row[r].label[0], sheet->row[row].label[0]) || strcmp(sheet->row[r].label[1], "all")) continue;
    if (cav_sheet_get(sheet, r, CAV_FORWARD_TIME) > hardly * time) continue;
    if (cav_sheet_get(sheet, r, CAV_FORWARD_SETTING) < cav_sheet_get(sheet, best, CAV_FORWARD_SETTING)) best = r;
  }
  return best;
}

// cheapest row over all states of methods whose name begins so
static int cheapest_solver(const cav_sheet *sheet, const char *method, double error) {
  int best = -1;
  for (int r = 0; r < sheet->nrow; r++) {
    double e = cav_sheet_get(sheet, r, CAV_FORWARD_ERROR_MAX), time = cav_sheet_get(sheet, r, CAV_FORWARD_TIME);
    if (strcmp(sheet->row[r].label[1], "all") || strncmp(sheet->row[r].label[0], method, strlen(method))) continue;
    if (e == CAV_SHEET_NONE || !(e <= error)) continue;
    if (best < 0 || time < cav_sheet_get(sheet, best, CAV_FORWARD_TIME)) best = r;
  }
  return best;
}

// how far a solve is from a feasible motion
static double off(const cav_sheet *sheet, int row) {
  double x = cav_sheet_get(sheet, row, CAV_PLAN_UNACTUATED), y = cav_sheet_get(sheet, row, CAV_PLAN_VIOLATION);
  return isfinite(x) && isfinite(y) ? fmax(x, y) : INFINITY;
}

// other steps and orders are other problems
static int own_problem(const cav_sheet *sheet, int r) {
  return cav_sheet_get(sheet, r, CAV_PLAN_STEP) == cav_sheet_get(sheet, 0, CAV_PLAN_STEP) &&
         !strcmp(sheet->row[r].label[1], sheet->row[0].label[1]);
}

static void choose_plan(const cav_sheet *sheet, cav_advice *a) {
  double least = INFINITY;
  for (int r = 0; r < sheet->nrow; r++) {
    if (!own_problem(sheet, r)) continue;
    if (isfinite(off(sheet, r)) && (a->nearest < 0 || off(sheet, r) < off(sheet, a->nearest))) a->nearest = r;
    if (cav_sheet_get(sheet, r, CAV_PLAN_FEASIBLE) == 1) least = fmin(least, cav_sheet_get(sheet, r, CAV_PLAN_COST));
  }
  for (int r = 0; r < sheet->nrow; r++) {
    if (!own_problem(sheet, r) || cav_sheet_get(sheet, r, CAV_PLAN_FEASIBLE) != 1) continue;
    if (cav_sheet_get(sheet, r, CAV_PLAN_COST) > hardly * least) continue;
    if (a->plan < 0 || cav_sheet_get(sheet, r, CAV_PLAN_SECONDS) < cav_sheet_get(sheet, a->plan, CAV_PLAN_SECONDS))
      a->plan = r;
  }
}

void cav_advice_take(const cav_measure_forward *forward, const cav_measure_step *step, const cav_measure_plan *plan,
                     cav_advice *a) {
  *a = (cav_advice){.motion = -1, .forward = -1, .cheapest = -1, .sweeps = -1, .plan = -1, .nearest = -1};
  for (int k = 0; k < 2; k++)
    if (step->motion[k].known) a->size = fmax(a->size, step->motion[k].size);
  for (int k = 1; k >= 0 && a->motion < 0; k--) {
    const cav_measure_motion *motion = &step->motion[k];
    if (motion->known && motion->uncertainty <= 0.1 * fractions[CAV_ADVICE_TARGET] * a->size) a->motion = k;
  }
  a->both = a->motion == 1 && step->motion[0].known;
  for (int i = 0; i < CAV_ADVICE_STEPS; i++) {
    a->step[i] = (cav_advice_step){fractions[i], -1, NAN};
    const cav_measure_motion *motion = a->motion >= 0 ? &step->motion[a->motion] : NULL;
    // an error that the reference itself may have says nothing
    if (motion && motion->uncertainty <= 0.3 * fractions[i] * a->size)
      a->step[i] = cheapest_step(&step->sheet, a->motion ? "contacts" : "free", a->both, fractions[i], a->size);
  }
  if (a->motion >= 0) a->bound = 0.1 * fractions[CAV_ADVICE_TARGET] * a->size / step->seconds;
  const int newton = cheapest_solver(&forward->sheet, "Newton by tolerance", a->bound);
  // without rows there is nothing to iterate on
  if (newton < 0 || cav_sheet_get(&forward->sheet, newton, CAV_FORWARD_ROWS) > 0)
    a->sweeps = cheapest_solver(&forward->sheet, "Gauss-Seidel", a->bound);
  a->cheapest = a->forward = newton;
  // Gauss-Seidel's errors fall slowly: it has to be clearly cheaper
  if (a->sweeps >= 0 && (newton < 0 || cav_sheet_get(&forward->sheet, a->sweeps, CAV_FORWARD_TIME) <
                                           clearly * cav_sheet_get(&forward->sheet, newton, CAV_FORWARD_TIME)))
    a->cheapest = a->forward = a->sweeps;
  else if (newton >= 0)
    a->forward = tightest(&forward->sheet, newton);
  if (plan) choose_plan(&plan->sheet, a);
}
