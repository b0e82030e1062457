/// Sequential quadratic programming on a transcription: from near an optimum to stationarity, all constraints held at
/// once, in the metric of the Lagrangian's Hessian. The steps are those of descent.c; here is when a run of them ends, which
/// motion it leaves, and how optimal that is.
///
/// The end is where the programme of a Hessian found there predicts next to nothing: its prediction over the cost is how
/// optimal the motion is, in the full box; or where little is left to be saved and that comes slowly. A run that ends
/// beside its rows goes back to where they last held.
#include "sqp.h"

#include <math.h>

#include "descent.h"
#include "programme.h"

/// Iterations at a softer law on the way.
enum { SOFT_ITERATIONS = 40 };

/// Decreases of the cost below this fraction, so many in a row, end a run.
static const double slow = 1e-6;
enum { PATIENCE = 8 };

/// Iterations between two looks at what there is to be saved, and looks in a row that end a run; part of it that a step
/// gains where progress is not slow, and where it is so slow that a run is stuck: that is its end too, where what is left
/// is no more than so many times what is asked for.
enum { LOOK = 5, LOOKS = 2 };
static const double brisk = 0.5, sluggish = 0.03, doubtful = 0.01, left_alone = 1.25;

/// Gain of the cost, each, below which iterations are looked at whatever is asked for.
static const double looked_at = 8e-4;

/// Part of what a look finds that iterations gain, below which its own step is tried.
static const double slower = 0.1;

/// Part of what may be left to be saved: one look that finds no more ends a run whose iterations gain less than that each,
/// however fast it converges.
static const double near_end = 0.1;

/// What may be left to be saved on the way, a fraction of the cost.
static const double soft_optimality = 2e-3;

/// What is optimal, as a fraction of the cost; where it is not so many steps across jumps of the merit are tried.
static const double optimal = 1e-6;
enum { LEAPS = 4 };

/// What a motion whose rows hold may be dearer than where a run ends without that; rows that nearly hold; part of what they were
/// off by before a run that nearly brings them in.
static const double held_loss = 1e-2, nearly = 1e-4, brought_in = 0.1;

/// Iterations after which rows that are farther off than nearly, and have never been half as far as at first, do not come in; and
/// those that are astray, at first or after they came nearer by half.
static const double astray = 1e-2;
enum { HOPELESS = 60, ASTRAY = 40 };

/// Times what the rows of such a run were off by at first, and how far at least, where it ends at once: penalties of single rows
/// have outgrown all others.
static const double lost = 100, lost_at_least = 1;

/// Slow progress where there is little to be saved: how often in a row that was so.
typedef struct tail {
  int iterations, met, stuck; ///< since the last look; looks in a row that saw the end, or next to no progress
  int near, hinted;           ///< the last one found next to nothing; was between two that were due
  double gain, saving;        ///< of these iterations, of the cost; what the last look found
} tail;

/// Whether that ends a run: 2, little is left; 3, it is stuck; 0, neither.
static int is_end(const cav_descent *d, const tail *end) {
  int stuck = end->stuck >= LOOKS;
  if (end->near || end->met >= LOOKS || (stuck && end->saving <= left_alone * d->asked)) return 2;
  return stuck && !d->patient ? 3 : 0;
}

/// Whether the last iteration hints at an end: it gained next to nothing and its programme predicted no more.
static int hints(const cav_solve_run *run, const cav_descent *d) {
  double little = d->near * cav_programme_scale(run->tr);
  return d->gain < little && d->predicted < little;
}

/// Asks once more, of rows that give, whether what a look takes for the end is one; where that is not finished either nothing
/// speaks against it.
static cav_status confirm(cav_solve_run *run, cav_descent *d, tail *end) {
  if (!end->near && end->met < LOOKS) return CAV_OK;
  cav_status status = cav_descent_confirm(run, d, &end->saving);
  if (isfinite(end->saving) && end->saving > d->asked) end->near = end->met = 0;
  return status;
}

/// Tries the step of a look that finds much more than iterations gain, gain of the cost each; a run that takes it is not stuck.
static cav_status go_ahead(cav_solve_run *run, cav_descent *d, double gain, tail *end) {
  if (end->near || !(end->saving > d->asked) || !(gain < slower * d->at_least)) return CAV_OK;
  const double scale = cav_programme_scale(run->tr);
  int taken;
  const cav_status status = cav_descent_go_ahead(run, d, gain * scale, &taken);
  if (taken) end->stuck = 0, end->gain = d->gain / scale;
  return status;
}

/// Where no step gains in its boxes, that of a look, if there is something to be saved by it.
static cav_status go_on(cav_solve_run *run, cav_descent *d, int *taken) {
  if (!cav_run_met(run)) return CAV_OK;
  double saving;
  const cav_status status = cav_descent_foresee(run, d, &saving);
  if (status != CAV_OK || d->at_least <= fmax(d->asked, optimal)) return status;
  return cav_descent_go_ahead(run, d, slow * cav_programme_scale(run->tr), taken);
}

/// Looks, every few iterations that gain little; between two such looks once where an iteration hints at an end.
static cav_status look(cav_solve_run *run, cav_descent *d, tail *end) {
  end->saving = INFINITY;
  end->gain += d->gain / cav_programme_scale(run->tr);
  int due = ++end->iterations >= LOOK, early = end->iterations > 1 && !end->hinted && hints(run, d);
  if (!due && !early) return CAV_OK;
  double gain = end->gain / end->iterations;
  const int slowly = gain < fmax(d->asked, looked_at);
  cav_status status = slowly ? cav_descent_foresee(run, d, &end->saving) : CAV_OK;
  end->near = end->saving <= d->near && gain < d->near;
  end->hinted = !due;
  if (!due) return status == CAV_OK ? confirm(run, d, end) : status;
  end->iterations = 0, end->gain = 0;
  end->met = end->saving <= d->asked && gain < brisk * end->saving ? end->met + 1 : 0;
  // what is not finished tells less
  const double little = d->doubted ? doubtful : sluggish;
  end->stuck = gain < d->asked && gain < little * d->at_least ? end->stuck + 1 : 0;
  if (status == CAV_OK && slowly) status = go_ahead(run, d, gain, end);
  return status == CAV_OK ? confirm(run, d, end) : status;
}

/// Keeps the motion where its rows hold, or are as near as a certificate asks; until there is one, where they nearly do.
static cav_status hold(const cav_solve_run *run, cav_descent *d) {
  int holds = cav_run_certifiable(run);
  const double most = cav_run_rows_off(run);
  if (!holds && (d->holds || most > nearly)) return CAV_OK;
  d->holds = holds;
  cav_trajectory_free(d->held);
  d->held = cav_trajectory_copy(run->at);
  d->held_cost = cav_transcription_cost(run->tr);
  return d->held ? CAV_OK : CAV_NO_MEMORY;
}

/// Rows brought in where the motion stands, and kept if they hold there.
static cav_status settle_here(cav_solve_run *run, cav_descent *d) {
  cav_status status = cav_descent_settle_rows(run, d);
  return status == CAV_OK ? hold(run, d) : status;
}

/// Of a run that is stopped the last motion whose rows held; where there is time, and gains are asked for, the last one, if its
/// rows can be brought in, or else the last one whose rows nearly held.
static cav_status leave(cav_solve_run *run, cav_descent *d) {
  run->ending = run->soon && !run->at_once && run->options->gains;
  cav_status status = CAV_OK;
  if (run->ending && cav_quadratic_length(d->qp) > 0) {
    status = cav_transcription_values(run->tr, run->at);
    if (status == CAV_OK) status = settle_here(run, d);
    if (status == CAV_OK && d->held && !d->holds) {
      double saving;
      cav_run_exchange(&run->at, &d->held);
      status = cav_descent_foresee(run, d, &saving);
      if (status == CAV_OK) status = settle_here(run, d);
    }
  }
  if (d->held && d->holds) cav_run_exchange(&run->at, &d->held);
  return status == CAV_NO_MEMORY ? status : CAV_INTERRUPTED;
}

/// Where a run ends beside its rows: back to where they held, if that costs little, and by the metric of there.
static cav_status go_back(cav_solve_run *run, cav_descent *d) {
  double most = (1 + held_loss) * cav_transcription_cost(run->tr), saving;
  if (cav_run_met(run) || !d->held || d->held_cost > most) return CAV_OK;
  cav_run_exchange(&run->at, &d->held);
  cav_trajectory_free(d->held);
  d->held = NULL;
  cav_status status = d->holds ? cav_transcription_values(run->tr, run->at) : cav_descent_foresee(run, d, &saving);
  return status == CAV_OK ? cav_descent_settle_rows(run, d) : status;
}

/// Asks once, where rows first nearly hold, whether a certificate would refuse the motion; the run ends there if they come in.
static cav_status screen(cav_solve_run *run, cav_descent *d) {
  if (!d->screens || cav_run_rows_off(run) > nearly) return CAV_OK;
  d->screens = 0;
  cav_status status = cav_run_screen(run);
  if (status != CAV_OK || !run->refused) return status;
  cav_trajectory *from = cav_trajectory_copy(run->at);
  if (!from) return CAV_NO_MEMORY;
  status = cav_descent_settle_rows(run, d);
  run->refused = cav_run_met(run);
  if (!run->refused) cav_run_exchange(&run->at, &from);
  if (status == CAV_OK && !run->refused) status = cav_transcription_values(run->tr, run->at);
  cav_trajectory_free(from);
  return status;
}

/// Iterations to where no step gains, 1, what one may gain is little and is slow to come, 2, or is more and hardly
/// comes, 3; or 0.
static cav_status settle(cav_solve_run *run, cav_descent *d, int *left, int *settled) {
  int calm = 0, taken = 1;
  tail end = {0};
  double off = cav_run_rows_off(run);
  const double most = off > astray ? fmax(lost * off, lost_at_least) : INFINITY;
  // iterations left to bring rows in by half; 0: they came, or were in
  int away = off > astray ? ASTRAY : off > nearly ? HOPELESS : 0;
  cav_status status = CAV_OK;
  for (; status == CAV_OK && *left > 0 && calm < PATIENCE && !is_end(d, &end) && !run->refused; --*left) {
    status = cav_descent_step(run, d, &taken);
    if (status == CAV_OK && !taken) status = go_on(run, d, &taken);
    if (status != CAV_OK || !taken) break;
    calm = d->gain < slow * cav_programme_scale(run->tr) ? calm + 1 : 0;
    if (cav_run_report(run, cav_quadratic_length(d->qp), cav_descent_radius(run->tr, d))) status = CAV_INTERRUPTED;
    if (status == CAV_OK) status = hold(run, d);
    if (status == CAV_OK) status = screen(run, d);
    if (status == CAV_OK) status = look(run, d, &end);
    const int nearer = away && cav_run_rows_off(run) < 0.5 * off;
    if (nearer) off = cav_run_rows_off(run), away = off > astray ? ASTRAY : 0;
    if ((away && !nearer && !--away) || cav_run_rows_off(run) > most) break;
  }
  int ended = is_end(d, &end);
  *settled = ended ? ended : !taken || calm >= PATIENCE;
  if (status == CAV_OK) status = cav_descent_settle_rows(run, d);
  return status == CAV_OK ? go_back(run, d) : status;
}

/// Iterations to the end, so many at most. Where they end before the motion is optimal a jump of the merit holds them: a
/// contact comes or goes there. Steps across are tried, and the best of the ends is kept. *settled: how the last of them
/// ended, as in settle.
static cav_status descend(cav_solve_run *run, cav_descent *d, int *left, int *settled) {
  int taken = 1, ended;
  cav_trajectory *best = NULL;
  double cost = INFINITY;
  cav_status status = CAV_OK;
  for (int i = 0; taken && status == CAV_OK; i++) {
    status = settle(run, d, left, &ended);
    if (status != CAV_OK) break;
    double reached = cav_run_met(run) ? cav_transcription_cost(run->tr) : INFINITY;
    if (i == 0 && !cav_run_met(run)) break;
    if (!(reached < (1 - slow) * cost)) {
      if (reached >= cost) cav_run_exchange(&run->at, &best);
      status = cav_transcription_values(run->tr, run->at);
      if (status == CAV_OK) status = cav_descent_measure(run, d, 1);
      break;
    }
    cost = reached;
    *settled = ended;
    cav_trajectory_free(best);
    best = cav_trajectory_copy(run->at);
    status = best ? cav_descent_measure(run, d, ended < 2) : CAV_NO_MEMORY;
    if (status != CAV_OK || run->refused || ended >= 2 || run->optimality < optimal || i == LEAPS || *left <= 0) break;
    status = cav_descent_leap(run, d, &taken);
  }
  cav_trajectory_free(best);
  return status;
}

/// A run of so many iterations at most, to what may be left to be saved; noted at a fraction of the way. soft: on the way,
/// where rows need not come in.
static cav_status run_of(cav_solve_run *run, int *left, double asked, double fraction, int soft, int *stuck) {
  cav_descent d;
  int first = run->solution->iterations, settled = 0;
  cav_penalties kept = run->tr->penalty;
  cav_trajectory *entry = cav_trajectory_copy(run->at);
  if (!entry) return CAV_NO_MEMORY;
  cav_status status = cav_descent_make(&d, run) ? cav_transcription_values(run->tr, run->at) : CAV_NO_MEMORY;
  const double off = cav_run_rows_off(run);
  d.asked = asked;
  d.near = soft ? 0 : near_end * asked;
  d.patient = !stuck;
  d.screens = !soft;
  if (status == CAV_OK) cav_descent_begin(run, &d);
  if (status == CAV_OK && cav_run_certifiable(run)) status = hold(run, &d);
  run->measured = 0;
  if (status == CAV_OK) status = descend(run, &d, left, &settled);
  if (status == CAV_INTERRUPTED && !soft) status = leave(run, &d);
  run->tr->penalty = kept;
  if (status == CAV_OK) status = cav_transcription_values(run->tr, run->at);
  int met = status == CAV_OK && cav_run_met(run);
  cav_outcome outcome = status != CAV_OK ? CAV_OUTCOME_STOPPED
                        : !met           ? CAV_OUTCOME_STALLED
                        : settled        ? CAV_OUTCOME_SETTLED
                                         : CAV_OUTCOME_LIMIT;
  if (stuck) *stuck = met && settled == 3;
  if (!cav_run_note(run, fraction, first, outcome)) status = CAV_NO_MEMORY;
  if (status == CAV_OK && !met && !soft) {
    // what nearly brings the rows in is nearer to the end than where it began
    const double still = cav_run_rows_off(run);
    const int better = still <= nearly && still <= brought_in * off;
    if (!better) cav_run_exchange(&run->at, &entry);
    if (!better) status = cav_transcription_values(run->tr, run->at);
    if (status == CAV_OK) status = CAV_NOT_CONVERGED;
  }
  cav_trajectory_free(entry);
  cav_descent_clear(&d);
  return status;
}

/// What may be left to be saved at the end: the problem says so, or the options, unless these go on to the last.
static double asked_for(const cav_solve_run *run) {
  double stated = run->problem->schedule.optimality;
  return stated > 0 && run->options->optimality > 0 ? stated : run->options->optimality;
}

cav_status cav_sqp(cav_solve_run *run, int *left, int *stuck) {
  run->phase = "sqp";
  run->stage = run->stages = 1;
  return run_of(run, left, asked_for(run), 1, 0, stuck);
}

cav_status cav_sqp_on_the_way(cav_solve_run *run, double fraction, int *left) {
  int stuck, most = *left < SOFT_ITERATIONS ? *left : SOFT_ITERATIONS, rest = most;
  cav_status status = run_of(run, &rest, soft_optimality, fraction, 1, &stuck);
  *left -= most - rest;
  return status;
}

cav_status cav_sqp_measure(cav_solve_run *run) {
  cav_descent d;
  cav_penalties kept = run->tr->penalty;
  cav_status status = cav_descent_make(&d, run) ? cav_transcription_values(run->tr, run->at) : CAV_NO_MEMORY;
  if (status == CAV_OK) cav_descent_begin(run, &d);
  // multipliers first, then the decrease with the curvature that goes with them
  if (status == CAV_OK) status = cav_descent_measure(run, &d, 0);
  if (status == CAV_OK) status = cav_descent_measure(run, &d, 1);
  run->tr->penalty = kept;
  cav_descent_clear(&d);
  return status;
}
