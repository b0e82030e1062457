/// Which of two motions is the better one, and what is so near a certificate that it is mended from where it is.
#include "rank.h"

#include <math.h>

// times its tolerance up to which what a feasible motion misses of a certificate is little
static const double several = 8;

// the same of depths, which harder contacts make less
static const double twice = 2;

// part of what was missed that a cure leaves where it helped
static const double helped = 0.95;

// fraction of the cost by which a motion has to be cheaper to come before one that was found earlier; before that of the problem
// as it is stated, where it is one of a changed problem
static const double cheaper = 1e-4, worth = 1e-2;

// force without an actuator, fraction of the weight, and violation of limits and constraints up to which it nearly keeps them
static const double nearly = 5e-3;

// part of the cost from which on what nearly keeps these is nearer to what was asked than one that is certified and does
// something else: what is missed is in the cost
static const double undone = 0.1;

// times its tolerance from which on what a certified motion misses is not a matter of weights
static const double far = 5;

static int misses_little(const cav_verdict *v) { return v->missed_most > 0 && v->missed_most < CAV_MISSED_LITTLE; }

int cav_rank_keeps(const cav_verdict *v) {
  return fmax(v->unactuated_force_max, fmax(v->limit_violation_max, v->constraint_violation_max)) <= nearly;
}

// how much of what is wanted a motion is: certified and as asked; certified and most of what was asked; as asked, forces,
// limits and constraints hold, and only the rest of a certificate is missed; certified and something else; none of these
static int class_of(const cav_race_report *report) {
  const cav_verdict *v = &report->verdict;
  if (cav_race_success(report)) return 4;
  if (v->certified) return misses_little(v) || (2 * v->nmissed < v->ntarget && !cav_rank_far(report)) ? 3 : 1;
  return v->achieved && cav_verdict_feasible(v) ? 2 : 0;
}

// whether one that is certified stands still, or the like, where another one nearly does what was asked
static int leaves_undone(const cav_race_report *done, const cav_race_report *other) {
  return class_of(done) == 1 && !other->verdict.certified && cav_rank_keeps(&other->verdict) &&
         other->cost < undone * done->cost;
}

int cav_rank_better(const cav_race_report *a, const cav_race_report *b, int cheapest) {
  const cav_verdict *v = &a->verdict, *w = &b->verdict;
  const double missed[][3] = {{v->unactuated_force_max, w->unactuated_force_max, CAV_TOLERANCE_UNACTUATED},
                              {v->limit_violation_max, w->limit_violation_max, CAV_TOLERANCE_LIMIT},
                              {v->constraint_violation_max, w->constraint_violation_max, CAV_TOLERANCE_CONSTRAINT},
                              {v->residual_fraction_max, w->residual_fraction_max, v->residual_within},
                              {v->penetration_max_m, w->penetration_max_m, CAV_TOLERANCE_PENETRATION},
                              {v->penetration_between_m, w->penetration_between_m, CAV_TOLERANCE_PENETRATION},
                              {v->momentum_defect_rms, w->momentum_defect_rms, CAV_TOLERANCE_MOMENTUM},
                              {v->slip_mean_m_s, w->slip_mean_m_s, CAV_TOLERANCE_SLIP},
                              {v->hover_fraction, w->hover_fraction, CAV_TOLERANCE_HOVER},
                              {v->replay_step_max_error, w->replay_step_max_error, CAV_TOLERANCE_STEP}};
  // what was stopped was not verified
  int stopped = a->status == CAV_INTERRUPTED, other = b->status == CAV_INTERRUPTED;
  if (stopped || other) return !stopped;
  if (cav_race_success(a) && cav_race_success(b)) return cheapest && a->cost < (1 - cheaper) * b->cost;
  if (leaves_undone(a, b) || leaves_undone(b, a)) return leaves_undone(b, a);
  if (class_of(a) != class_of(b)) return class_of(a) > class_of(b);
  // what was asked is in the cost
  if (v->certified) return a->cost < (1 - cheaper) * b->cost;
  for (size_t k = 0; k < sizeof missed / sizeof *missed; k++)
    if (missed[k][0] > missed[k][2] || missed[k][1] > missed[k][2]) return missed[k][0] < missed[k][1];
  if (v->closed_loop_seconds != w->closed_loop_seconds) return v->closed_loop_seconds > w->closed_loop_seconds;
  return v->model_contacts_seconds > w->model_contacts_seconds;
}

int cav_rank_worth(const cav_race_report *a, const cav_race_report *b) {
  if (class_of(a) != class_of(b) || !a->verdict.certified || cav_race_success(a)) return 1;
  return a->cost < (1 - worth) * b->cost;
}

// the largest depth in anything, in its tolerance
static double depth_of(const cav_verdict *v) {
  return fmax(v->penetration_max_m, v->penetration_between_m) / CAV_TOLERANCE_PENETRATION;
}

int cav_rank_rough(const cav_verdict *v) {
  return !v->certified && cav_verdict_feasible(v) && depth_of(v) <= twice &&
         v->momentum_defect_rms <= several * CAV_TOLERANCE_MOMENTUM &&
         v->slip_mean_m_s <= several * CAV_TOLERANCE_SLIP && v->hover_fraction <= several * CAV_TOLERANCE_HOVER;
}

// the largest ratio of a figure to its tolerance; *which: 0 of the balance of momentum, 1 slip, 2 hover
static double over_tolerance(const cav_verdict *v, int *which) {
  const double over[] = {v->momentum_defect_rms / CAV_TOLERANCE_MOMENTUM, v->slip_mean_m_s / CAV_TOLERANCE_SLIP,
                         v->hover_fraction / CAV_TOLERANCE_HOVER};
  *which = 0;
  for (int k = 1; k < 3; k++)
    if (over[k] > over[*which]) *which = k;
  return over[*which];
}

int cav_rank_beside(const cav_verdict *v) {
  int which;
  return cav_rank_rough(v) && v->nmissed > 0 && !v->has_gains && depth_of(v) <= 1 && over_tolerance(v, &which) <= 1 &&
         v->replay_step_max_error <= CAV_TOLERANCE_STEP;
}

int cav_rank_close(const cav_race_report *report) {
  const cav_verdict *v = &report->verdict;
  return (v->certified || cav_rank_beside(v)) && misses_little(v);
}

int cav_rank_far(const cav_race_report *report) {
  const cav_verdict *v = &report->verdict;
  return (v->certified || cav_rank_beside(v)) && v->missed_most > far;
}

int cav_rank_near(const cav_race_report *report, double effort) {
  const cav_verdict *v = &report->verdict;
  if (!report->solution || report->status == CAV_INTERRUPTED) return 0;
  if (v->certified || cav_rank_beside(v)) return !v->achieved && (2 * v->nmissed < v->ntarget || misses_little(v));
  // a motion that does something else is not what is looked for
  if (2 * v->nmissed > v->ntarget) return 0;
  if (cav_rank_rough(v)) return 1;
  return v->unactuated_force_max <= CAV_TOLERANCE_UNACTUATED && depth_of(v) <= 1 &&
         v->constraint_violation_max <= CAV_TOLERANCE_CONSTRAINT && v->limit_violation_max > CAV_TOLERANCE_LIMIT &&
         v->limit_violation_max < (1 - effort) / 2;
}

// what a forward step that has another solution than the planned one counts, however far that is: less than slip of a fifth
// beyond its tolerance, since another law of contacts mends it
static const double folded = 1.1;

// times of its tolerance that a possible motion has of what it keeps least of a certificate; of a closed loop that is lost,
// the duration over the time until then
static double excess_of(const cav_verdict *v) {
  int which;
  double most = fmax(over_tolerance(v, &which), depth_of(v));
  if (v->replay_step_max_error > CAV_TOLERANCE_STEP) most = fmax(most, folded);
  // one without gains was left before they were chosen
  if (!v->has_gains) return most;
  const double followed = fmin(v->closed_loop_seconds, v->model_contacts_seconds);
  return fmax(most, v->duration / fmax(followed, v->duration / 100));
}

int cav_rank_helped(const cav_verdict *repaired, const cav_verdict *before) {
  int most, other;
  // of targets alone
  if (repaired->certified && before->certified && repaired->nmissed && before->nmissed)
    return repaired->nmissed < before->nmissed || repaired->missed_most < helped * before->missed_most;
  if (!cav_rank_rough(repaired) || !cav_rank_rough(before)) return 1;
  const double now = over_tolerance(repaired, &most), then = over_tolerance(before, &other);
  return now <= 1 || most != other || now < helped * then;
}

int cav_rank_nearer(const cav_race_report *a, const cav_race_report *b) {
  const cav_verdict *v = &a->verdict, *w = &b->verdict;
  if (v->certified && w->certified && v->nmissed && w->nmissed)
    return v->nmissed != w->nmissed ? v->nmissed < w->nmissed : v->missed_most < w->missed_most;
  if (!cav_rank_rough(v) || !cav_rank_rough(w)) return cav_rank_better(a, b, 0);
  if (!v->nmissed != !w->nmissed) return !v->nmissed;
  return excess_of(v) < excess_of(w);
}

int cav_rank_spent(const cav_race *race, int i) {
  double mended = 0, sought = 0;
  for (int k = 0; k < i; k++) {
    const cav_race_entry *e = &race->entry[k];
    if (e->state != CAV_RACE_DONE || !e->report.solution) continue;
    const double step = e->strategy.timestep > 0 ? e->strategy.timestep : race->problem->timestep;
    *(e->from >= 0 ? &mended : &sought) += e->report.verdict.iterations / step;
  }
  return mended > sought;
}
