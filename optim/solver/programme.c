/// The programme of one linearisation under exact penalties, which are above every multiplier, row by row (Fletcher 1985).
#include "programme.h"

#include <math.h>
#include <string.h>

/// Raises of the penalties for a programme.
enum { RAISES = 5 };

/// Near a record: what the linearised rows miss together, below which a raise is never in vain; part of it that one has
/// to bring in; part of the largest penalty that none is below then; programmes until a raise is tried again.
static const double missed_little = 1e-6, brought_in = 0.1, even = 0.1;
enum { RESTS = 8 };

/// Fraction of the cost: gap of a programme. Smallest cost that counts as a scale.
static const double gap_fraction = 1e-11, least_cost = 1e-6;

/// Part of the tolerance below which a row of what has no actuator is met where all ends at rest.
static const double met = 0.01;

/// Penalties: over the multiplier; of its kind's largest multiplier; of the cost, a unit of the row.
static const double over = 2, of_kind = 0.1, of_cost = 0.01;

double cav_programme_scale(const cav_transcription *tr) { return fmax(cav_transcription_cost(tr), least_cost); }

static int kind_of(const cav_slot_layout *at, int i) { return (i >= at->effort) + (i >= at->joint) + (i >= at->term); }

void cav_programme_values(const cav_transcription *tr, double *value) {
  for (int t = 0, k = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) value[k++] = tr->knot[t].slot[i].value;
}

void cav_programme_penalties(const cav_transcription *tr, double *penalty) {
  double most[4] = {0}, floor = of_cost * cav_programme_scale(tr);
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      double *kind = &most[kind_of(&tr->knot[t].layout, i)];
      *kind = fmax(*kind, fabs(tr->knot[t].slot[i].multiplier));
    }
  for (int t = 0, k = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++)
      penalty[k++] = fmax(fmax(over * fabs(tr->knot[t].slot[i].multiplier), floor),
                          of_kind * most[kind_of(&tr->knot[t].layout, i)]);
}

/// What a linearised row misses after the programme's step.
static double linear_miss(const cav_slot *slot, double linear) {
  return fmax(fmax(slot->lower - linear, linear - slot->upper), 0);
}

/// What a row may miss and is met. A tree without an actuator that has to end at rest has a row for every unknown and,
/// after the last knot, one for every dof more: contacts brake it by a factor a knot, so the multiplier of what is missing
/// there to the last digit grows by that factor with every knot at rest.
static double missed_in_vain(const cav_solve_run *run, int row) {
  const cav_transcription *tr = run->tr;
  if (row >= tr->nresidual || !tr->problem->close_at_rest || tr->periodicity) return 0;
  const cav_force_row *force = &tr->unactuated[row];
  for (int k = 0; k < force->n; k++)
    if (tr->model->link[tr->model->dof[force->dof[k]].link].driven) return 0;
  return met * run->options->tolerance;
}

/// Raises penalties that the multipliers press against; how many. part: of the largest, which none is below then.
static int raise_penalties(const cav_solve_run *run, cav_quadratic *qp, double part) {
  const cav_transcription *tr = run->tr;
  int raised = 0;
  const double *y = cav_quadratic_multiplier(qp), *linear = cav_quadratic_prediction(qp);
  double *penalty = cav_quadratic_penalty(qp), most = 0;
  for (int t = 0, k = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++) {
      if (fabs(y[k]) < 0.9 * penalty[k] ||
          linear_miss(&tr->knot[t].slot[i], linear[k]) < missed_in_vain(run, i - tr->knot[t].layout.unactuated))
        continue;
      penalty[k] *= 10;
      most = fmax(most, penalty[k]);
      raised++;
    }
  for (int k = 0; k < cav_quadratic_rows(qp); k++) penalty[k] = fmax(penalty[k], part * most);
  return raised;
}

double cav_programme_merit(const cav_transcription *tr, const double *penalty, double *part) {
  double sum = 0;
  for (int t = 0, k = 0; t < tr->nknot; t++) {
    part[t] = tr->knot[t].merit;
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++) {
      const cav_slot *slot = &tr->knot[t].slot[i];
      part[t] += penalty[k] * fmax(fmax(slot->lower - slot->value, slot->value - slot->upper), 0);
    }
    sum += part[t];
  }
  return sum;
}

/// Bounds of the step's logarithm about where it is.
static void step_bounds(const cav_transcription *tr, const cav_trajectory *at, double change[2]) {
  change[0] = -INFINITY, change[1] = INFINITY;
  if (!tr->free_step) return;
  change[0] = log(tr->problem->duration_least / (tr->nknot - 1) / at->timestep);
  change[1] = log(tr->problem->duration_most / (tr->nknot - 1) / at->timestep);
}

/// What the linearised rows miss after the programme's step, all together.
static double linear_violation(const cav_transcription *tr, cav_quadratic *qp) {
  const double *linear = cav_quadratic_prediction(qp);
  double sum = 0;
  for (int t = 0, k = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++) sum += linear_miss(&tr->knot[t].slot[i], linear[k]);
  return sum;
}

cav_status cav_programme_solve(cav_solve_run *run, cav_quadratic *qp, const double *radius, double *kept, int *rest,
                               int *solved) {
  double change[2], begin = cav_clock(), gap = gap_fraction * cav_programme_scale(run->tr), before = INFINITY;
  size_t bytes = (size_t)cav_quadratic_rows(qp) * sizeof *kept;
  const int checks = run->checks_raises || cav_problem_has_record(run->problem);
  step_bounds(run->tr, run->at, change);
  cav_status status = CAV_OK;
  *rest = *rest > 0 ? *rest - 1 : 0;
  for (int i = 0; i < RAISES; i++) {
    status = i == 0 ? cav_quadratic_solve(qp, radius, change, gap) : cav_quadratic_solve_again(qp, gap);
    if (status != CAV_OK) break;
    double missing = checks ? linear_violation(run->tr, qp) : 0;
    if (missing > fmax((1 - brought_in) * before, missed_little)) {
      memcpy(cav_quadratic_penalty(qp), kept, bytes);
      status = cav_quadratic_solve_again(qp, gap);
      *rest = RESTS;
      break;
    }
    memcpy(kept, cav_quadratic_penalty(qp), bytes);
    before = missing;
    int much = missing > missed_little, last = much && (*rest > 0 || i == RAISES - 1);
    if (last || !raise_penalties(run, qp, much ? even : 0)) break;
  }
  run->region.seconds_linear += cav_clock() - begin;
  *solved = status == CAV_OK;
  return status == CAV_NOT_CONVERGED ? CAV_OK : status;
}
