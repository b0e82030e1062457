/// Steps of sequential quadratic programming on a transcription: the programme of a linearisation in boxes, the step that it
/// leads to, and what it says of the motion. sqp.c says when they end.
///
/// Each iteration solves the programme of quadratic.c in a box, whose rows have exact penalties (Fletcher 1985:
/// S-l1-QP), and takes its step where cost plus penalties fall by a fraction of what the programme predicted; a step
/// that misses the rows by their curvature is corrected in the same metric (Maratos). Penalties are above every
/// multiplier, row by row. Every knot has a box of its own: merit and prediction are sums over knots, so what a step
/// misses is known by knot, and one at which a contact comes or goes does not hold the others back. The Hessian is
/// Gauss-Newton's at first, then the Lagrangian's, found anew at knots that miss.
#include "descent.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "programme.h"

/// Programmes for a linearisation; corrections of a step, and of rows where a run ends.
enum { ATTEMPTS = 20, CORRECTIONS = 16, SETTLING = 20 };

/// Boxes at the start and at most (rad, m, log of the step), and where they are too small to go on.
static const double first_radius = 0.1, most_radius = 0.7, least_radius = 1e-7;

/// Parts of a look's step that are tried, largest first.
static const double ahead[] = {1, 0.5, 0.25, 0.1, 0.03};
enum { PARTS = sizeof ahead / sizeof *ahead };

/// Fractions of the cost: predicted decrease that ends a run; one that ends it if it does not come true.
static const double stationary = 1e-9, predicted_enough = 1e-6;

/// A decrease of the cost below this fraction, by a Hessian that served so many iterations, has it found anew.
static const double old_gain = 1e-5;
enum { SERVED = 5 };

/// So many steps in a row by Gauss-Newton's model that gain less than this fraction of the cost end its part.
static const double gauss_newton = 1e-4;
enum { FEW = 3 };

/// Boxes that a step across a jump of the merit is tried in, and the fraction of the cost that it may lose.
static const double leap_box[] = {1e-2, 3e-3, 1e-3, 3e-4, 1e-4}, leap_loss = 1e-3;
enum { LEAP_BOXES = sizeof leap_box / sizeof *leap_box };

/// How far the ratio of a decrease to what was predicted may be from 1 before the Hessian is found anew; how much of
/// the decrease a knot has to miss for its box to be at fault instead.
static const double poor_ratio = 0.4, far = 2;

/// Parts of a step that are tried where it falls short, from which ratios of it on; from where it does not.
static const double shorter[2][2] = {{0.5, -3}, {0.25, -20}}, enough_of_it = 0.5;

/// Part of what a step misses that a correction has to bring for another one to follow.
static const double worth = 0.1;

/// Ratios to a forecast from which a step is lengthened: whatever it is; where the model itself goes on down along it,
/// by this part of the decrease.
static const double exceeded = 1.3, fair = 0.5, unfinished = 0.1;

/// Part of what all knots' forecasts were off by that the knots whose curvature is kept may be off by.
static const double unmarked = 0.3;

/// Squares of the step, rad or m, that make a programme convex, of the cost: of all knots, and of single ones.
/// A wave of these takes what is within this fraction of the largest.
static const double least_shift = 1, most_shift[2] = {10, 1e6}, most_knot_shift = 1e14, wave = 0.05;

/// Sets aside the augmented Lagrangian, but for squares of the unactuated force: these leave the solution where it is,
/// and make the Lagrangian convex across these rows.
static void take_penalties(cav_transcription *tr) {
  tr->penalty = (cav_penalties){.unactuated = tr->problem->schedule.last.penalty};
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].multiplier = 0;
}

static void set_radius(const cav_transcription *tr, double *radius, double value) {
  for (int b = 0; b <= cav_transcription_blocks(tr); b++) radius[b] = value;
}

int cav_descent_make(cav_descent *d, cav_solve_run *run) {
  *d = (cav_descent){.qp = cav_quadratic_new(run->tr, run->normal), .ratio = 1, .age = -1};
  size_t n = (size_t)cav_transcription_unknowns(run->tr), rows = d->qp ? (size_t)cav_quadratic_rows(d->qp) : 0;
  d->curvature = cav_curvature_new(run->tr);
  d->stale = malloc((size_t)run->tr->nknot);
  int whole = d->qp && cav_course_make(&d->course, run->tr, (int)rows);
  size_t knots = (size_t)run->tr->nknot, boxes = (size_t)cav_transcription_blocks(run->tr) + 1;
  d->x = calloc(n + 3 * rows + 6 * knots + 2 * boxes, sizeof(double));
  d->second = cav_trajectory_copy(run->at);
  d->best = cav_trajectory_copy(run->at);
  if (!whole || !d->curvature || !d->stale || !d->x || !d->second || !d->best || !cav_transcription_keep_rows(run->tr))
    return 0;
  d->offset = d->x + n;
  d->multiplier = d->offset + rows;
  d->kept = d->multiplier + rows;
  d->radius = d->kept + rows;
  d->before = d->radius + boxes;
  d->after = d->before + knots;
  d->tried = d->after + knots;
  d->forecast = d->tried + knots;
  d->next = d->forecast + knots;
  d->need = d->next + boxes;
  d->parts = d->need + knots;
  set_radius(run->tr, d->radius, first_radius);
  return 1;
}

void cav_descent_clear(cav_descent *d) {
  cav_quadratic_free(d->qp);
  cav_curvature_free(d->curvature);
  cav_course_clear(&d->course);
  cav_trajectory_free(d->second);
  cav_trajectory_free(d->best);
  cav_trajectory_free(d->held);
  free(d->x), free(d->stale);
}

/// Changes what all unknowns' own squares cost besides.
static void shift_all(const cav_transcription *tr, cav_descent *d, double next) {
  size_t nv = (size_t)tr->nv, width = 3 * nv;
  for (int t = 0; t < tr->nknot; t++)
    for (size_t i = t + tr->first < 0 ? 0 : nv; i < 2 * nv; i++) tr->knot[t].hessian[i * width + i] += next - d->shift;
  d->shift = next;
}

/// What each knot's part needs to be convex by itself.
static void find_needs(const cav_transcription *tr, cav_descent *d) {
  double least = least_shift * cav_programme_scale(tr);
  for (int t = 0; t < tr->nknot; t++) {
    d->need[t] = 0;
    while (d->need[t] < most_knot_shift * least && !cav_quadratic_knot_convex(d->qp, t, d->need[t]))
      d->need[t] = d->need[t] > 0 ? 10 * d->need[t] : least;
  }
  d->needs_known = 1;
}

/// Makes the model more convex: by squares of all unknowns; then, in their place, by those of the knots that need most,
/// where a contact comes or goes, and of more and more knots; then by those of all beside. 0: there is no more to be
/// had.
static int raise_shift(const cav_transcription *tr, cav_descent *d) {
  double least = least_shift * cav_programme_scale(tr);
  if (!d->needs_known && d->shift < most_shift[0] * least) {
    shift_all(tr, d, d->shift > 0 ? 10 * d->shift : least);
    return 1;
  }
  if (!d->needs_known) {
    shift_all(tr, d, 0);
    find_needs(tr, d);
  }
  int width = 3 * tr->nv;
  double most = 0;
  for (int t = 0; t < tr->nknot; t++) most = fmax(most, d->need[t]);
  if (most == 0) {
    if (d->shift >= most_shift[1] * least) return 0;
    shift_all(tr, d, d->shift > 0 ? 10 * d->shift : most_shift[0] * least);
    return 1;
  }
  for (int t = 0; t < tr->nknot; t++) {
    if (d->need[t] < wave * most) continue;
    for (int i = 0; i < width; i++) tr->knot[t].hessian[i * width + i] += d->need[t];
    d->need[t] = 0;
  }
  return 1;
}

/// Adds the Lagrangian's curvature to the linearisation, with squares of the step that make it convex along the rows
/// that hold the motion.
static void add_curvature(cav_solve_run *run, cav_descent *d) {
  cav_curvature_add(d->curvature, run->tr, 1);
  d->shift = 0;
  d->needs_known = 0;
  while (!cav_quadratic_convex(d->qp) && raise_shift(run->tr, d)) continue;
}

/// Solves the model in a box, with more and more squares until that can be done.
static cav_status solve_model(cav_solve_run *run, cav_descent *d) {
  for (;;) {
    int solved = 0;
    cav_status status = cav_programme_solve(run, d->qp, d->radius, d->kept, &d->rest, &solved);
    if (status != CAV_OK || solved || !raise_shift(run->tr, d)) return status;
  }
}

/// What a knot's part of the merit misses of its forecast.
static double missed(const cav_descent *d, int t) {
  return isfinite(d->after[t]) ? d->forecast[t] - (d->before[t] - d->after[t]) : INFINITY;
}

/// Marks the knots whose forecasts were off most: all but those that together are off by a small part of what all are.
static void mark_stale(const cav_transcription *tr, cav_descent *d) {
  double all = 0, left = 0, next = 0;
  for (int t = 0; t < tr->nknot; t++) all += fmin(fabs(missed(d, t)), fabs(d->predicted));
  memset(d->stale, 1, (size_t)tr->nknot);
  // the least of the marked ones is next to go
  for (;;) {
    double least = INFINITY;
    for (int t = 0; t < tr->nknot; t++)
      if (d->stale[t]) least = fmin(least, fabs(missed(d, t)));
    next = left + least;
    if (!(next <= unmarked * all)) break;
    for (int t = 0; t < tr->nknot; t++)
      if (d->stale[t] && fabs(missed(d, t)) <= least) d->stale[t] = 0, left += least;
  }
}

/// Costs, rows and their model at run->at: Gauss-Newton's while its steps gain, then with the Lagrangian's curvature,
/// which is found anew where the last one's predictions have not come true. all: at all knots.
static cav_status model(cav_solve_run *run, cav_descent *d, int all) {
  int poor = d->age >= 0 && fabs(d->ratio - 1) > poor_ratio;
  int little = d->age >= SERVED && d->gain < old_gain * cav_programme_scale(run->tr);
  cav_status status = CAV_OK;
  if (poor || little || all || (d->age < 0 && d->few >= FEW)) {
    int whole = !poor || little || all;
    if (!whole) mark_stale(run->tr, d);
    status = cav_curvature_find(d->curvature, run->tr, run->at, run->spare, d->multiplier, whole ? NULL : d->stale);
    d->age = 0;
    d->whole = whole;
  } else {
    status = cav_transcription_linearise(run->tr, run->at);
    if (d->age >= 0) d->age++;
    d->whole = 0;
  }
  d->shift = 0;
  d->needs_known = 0;
  if (status == CAV_OK && d->age >= 0) add_curvature(run, d);
  return status;
}

/// Merit of a trajectory, infinite where it cannot be evaluated.
static cav_status try_at(cav_solve_run *run, cav_descent *d, cav_trajectory *at, double *merit) {
  cav_status status = cav_transcription_values(run->tr, at);
  d->last = at;
  *merit = status == CAV_OK ? cav_programme_merit(run->tr, cav_quadratic_penalty(d->qp), d->tried) : INFINITY;
  return status == CAV_NO_MEMORY || status == CAV_INTERRUPTED ? status : CAV_OK;
}

static void keep_parts(cav_descent *d) {
  double *kept = d->after;
  d->after = d->tried;
  d->tried = kept;
}

/// Evaluates a trajectory moved by x and takes it to run->spare where it is better than what is there. *better:
/// whether it is.
static cav_status try_better(cav_solve_run *run, cav_descent *d, const cav_trajectory *from, const double *x,
                             double *merit, int *better) {
  double there;
  cav_transcription_move(run->tr, from, x, d->second);
  cav_status status = try_at(run, d, d->second, &there);
  *better = there < *merit;
  if (!*better) return status;
  *merit = there;
  cav_run_exchange(&run->spare, &d->second);
  keep_parts(d);
  return status;
}

/// Takes a multiple of the programme's step to run->spare; where that gains less than enough, with its bend, then corrected
/// again and again, as long as that is better. Returns the merit there.
static cav_status try_step(cav_solve_run *run, cav_descent *d, double multiple, double enough, double *merit) {
  int n = cav_transcription_unknowns(run->tr), better;
  const double *step = cav_quadratic_step(d->qp);
  for (int i = 0; i < n; i++) d->x[i] = multiple * step[i];
  cav_transcription_move(run->tr, run->at, d->x, run->spare);
  cav_status status = try_at(run, d, run->spare, merit);
  keep_parts(d);
  if (status != CAV_OK || !isfinite(*merit) || d->merit - *merit > enough) return status;
  if (!d->course.known) {
    status = cav_course_find(&d->course, run->tr, d->qp, run->at, d->second);
    d->last = NULL;
  }
  for (int i = 0; i < n; i++) d->x[i] = multiple * (step[i] + multiple * d->course.bend[i]);
  if (status == CAV_OK && d->course.known) status = try_better(run, d, run->at, d->x, merit, &better);
  // corrections start from the values of what they correct
  if (status == CAV_OK && d->last != run->spare) status = cav_transcription_values(run->tr, run->spare);
  for (int round = 0; round < CORRECTIONS && status == CAV_OK && d->merit - *merit <= enough; round++) {
    double before = *merit;
    cav_course_correct(&d->course, run->tr, d->qp, multiple, d->x);
    status = try_better(run, d, run->spare, d->x, merit, &better);
    if (!better || before - *merit < worth * fabs(d->predicted - d->merit + before)) break;
  }
  return status;
}

/// A part of a step that falls short, in the place of a programme in smaller boxes: what its course misses goes with the
/// cube of it. run->spare stays what it is where the part gains less.
static cav_status shorten(cav_solve_run *run, cav_descent *d, double *merit) {
  for (int i = 0; i < 2; i++) {
    double part = shorter[i][0], fraction = part * (2 - part), there;
    if (d->ratio < shorter[i][1]) continue;
    memcpy(d->parts, d->after, (size_t)run->tr->nknot * sizeof(double));
    cav_run_exchange(&run->spare, &d->best);
    cav_status status = try_step(run, d, part, fraction * d->predicted, &there);
    if (status != CAV_OK) return status;
    if (there < *merit && d->merit - there > 0.1 * fraction * d->predicted) {
      *merit = there;
      d->predicted *= fraction;
      for (int t = 0; t < run->tr->nknot; t++) d->forecast[t] *= fraction;
      d->ratio = (d->merit - there) / d->predicted;
      return CAV_OK;
    }
    cav_run_exchange(&run->spare, &d->best);
    memcpy(d->after, d->parts, (size_t)run->tr->nknot * sizeof(double));
    d->last = NULL;
  }
  return CAV_OK;
}

/// Whether the programme's step is too short: the curvature was made convex, or what held its factors held the step.
static int is_short(const cav_descent *d) {
  return d->ratio > exceeded || (d->ratio > fair && cav_quadratic_unfinished(d->qp) > unfinished);
}

/// Longer and longer steps while they gain.
static cav_status extrapolate(cav_solve_run *run, cav_descent *d, double *merit) {
  double multiple = 2, limit = most_radius / cav_quadratic_length(d->qp);
  for (; multiple <= limit; multiple *= 2) {
    cav_run_exchange(&run->spare, &d->best);
    double longer;
    cav_status status = try_step(run, d, multiple, INFINITY, &longer);
    if (status != CAV_OK) return status;
    if (longer < *merit) {
      *merit = longer;
      continue;
    }
    cav_run_exchange(&run->spare, &d->best);
    break;
  }
  return CAV_OK;
}

static cav_status iterate(cav_solve_run *run, cav_descent *d, int *taken);

/// The iteration over again, with the curvature of where it stands; all: of all knots.
static cav_status renew(cav_solve_run *run, cav_descent *d, int all, int *taken) {
  d->ratio = 0;
  cav_status status = model(run, d, all);
  return status == CAV_OK ? iterate(run, d, taken) : status;
}

/// Largest step within a block of unknowns.
static double block_length(const cav_transcription *tr, const double *x, int block) {
  double most = 0;
  if (block == cav_transcription_blocks(tr)) return tr->free_step ? fabs(x[block * tr->nv]) : 0;
  for (int i = 0; i < tr->nv; i++) most = fmax(most, fabs(x[block * tr->nv + i]));
  return most;
}

/// Boxes of the unknowns that a knot sees become factor times their steps at most.
static void shrink(const cav_solve_run *run, cav_descent *d, int t, double factor) {
  const double *x = cav_quadratic_step(d->qp);
  for (int c = 0; c < 3; c++) {
    int b = cav_transcription_block(run->tr, t, c);
    if (b >= 0) d->next[b] = fmin(d->next[b], factor * fmin(block_length(run->tr, x, b), d->radius[b]));
  }
}

/// Boxes for the next programme: smaller about knots that keep a step from what it should gain, larger about those that
/// do as forecast, where they held the step.
static void find_boxes(const cav_solve_run *run, cav_descent *d) {
  const cav_transcription *tr = run->tr;
  const double *x = cav_quadratic_step(d->qp);
  double most = 0;
  for (int t = 0; t < tr->nknot; t++) most = fmax(most, missed(d, t));
  double bad = d->ratio < 0.25 ? fmin(0.1 * d->predicted, 0.5 * most) : 0.25 * d->predicted;
  for (int b = 0; b <= cav_transcription_blocks(tr); b++)
    d->next[b] = block_length(tr, x, b) > 0.9 * d->radius[b] && d->ratio > 0.25 ? fmin(2 * d->radius[b], most_radius)
                                                                                : d->radius[b];
  for (int t = 0; t < tr->nknot; t++) {
    double off = missed(d, t);
    if (off >= bad && d->ratio < 0.75)
      shrink(run, d, t, off > 10 * d->predicted ? 0.2 : 0.5);
    else if (off > 0.1 * d->predicted && d->ratio < 0.75)
      shrink(run, d, t, 1);
  }
}

static void take_boxes(const cav_solve_run *run, cav_descent *d) {
  memcpy(d->radius, d->next, ((size_t)cav_transcription_blocks(run->tr) + 1) * sizeof(double));
}

/// Whether rows are off that Gauss-Newton's programmes, which are convex, do not bring nearer: curvature does not either,
/// the augmented Lagrangian may.
static int is_lost(const cav_solve_run *run, const cav_descent *d) { return d->age < 0 && !cav_run_met(run); }

double cav_descent_radius(const cav_transcription *tr, const cav_descent *d) {
  double most = 0;
  for (int b = 0; b < cav_transcription_blocks(tr) + tr->free_step; b++) most = fmax(most, d->radius[b]);
  return most;
}

/// One iteration from a linearisation: programmes in smaller and smaller boxes until a step is accepted, or until the
/// model has to be a better one. *taken: whether one was.
static cav_status iterate(cav_solve_run *run, cav_descent *d, int *taken) {
  *taken = 0;
  cav_programme_values(run->tr, cav_quadratic_value(d->qp));
  cav_course_begin(&d->course, run->tr);
  for (int i = 0; i < ATTEMPTS; i++) {
    cav_status status = solve_model(run, d);
    if (status != CAV_OK) return status;
    double scale = cav_programme_scale(run->tr), trial;
    d->course.known = 0;
    d->merit = cav_programme_merit(run->tr, cav_quadratic_penalty(d->qp), d->before);
    d->predicted = cav_quadratic_decrease(d->qp);
    for (int t = 0; t < run->tr->nknot; t++) d->forecast[t] = cav_quadratic_knot_decrease(d->qp, t);
    memcpy(d->multiplier, cav_quadratic_multiplier(d->qp), (size_t)cav_quadratic_rows(d->qp) * sizeof(double));
    if (d->predicted <= stationary * scale) return is_lost(run, d) || d->whole ? CAV_OK : renew(run, d, 1, taken);
    status = try_step(run, d, 1, 0.9 * d->predicted, &trial);
    if (status != CAV_OK) return status;
    d->ratio = (d->merit - trial) / d->predicted;
    find_boxes(run, d);
    status = d->ratio < enough_of_it ? shorten(run, d, &trial) : is_short(d) ? extrapolate(run, d, &trial) : CAV_OK;
    if (status != CAV_OK) return status;
    if (d->ratio > 1e-4) {
      take_boxes(run, d);
      d->gain = d->merit - trial;
      d->few = d->gain < gauss_newton * scale ? d->few + 1 : 0;
      cav_run_exchange(&run->at, &run->spare);
      *taken = 1;
      return d->last == run->at ? CAV_OK : cav_transcription_values(run->tr, run->at);
    }
    // values of the linearisation, which the trial has overwritten
    status = cav_transcription_values(run->tr, run->at);
    if (status != CAV_OK) return status;
    int enough = d->predicted <= predicted_enough * scale && cav_run_met(run);
    if (enough) return d->whole ? CAV_OK : renew(run, d, 1, taken);
    double miss = 0;
    for (int t = 0; t < run->tr->nknot; t++) miss = fmax(miss, missed(d, t));
    if (d->age > 0 && miss < far * d->predicted) return renew(run, d, 0, taken);
    take_boxes(run, d);
    if (cav_descent_radius(run->tr, d) < least_radius) break;
  }
  return d->age < 0 && !is_lost(run, d) ? renew(run, d, 1, taken) : CAV_OK;
}

cav_status cav_descent_step(cav_solve_run *run, cav_descent *d, int *taken) {
  cav_status status = model(run, d, 0);
  return status == CAV_OK ? iterate(run, d, taken) : status;
}

cav_status cav_descent_leap(cav_solve_run *run, cav_descent *d, int *taken) {
  *taken = 0;
  double scale = cav_programme_scale(run->tr), trial;
  cav_status status = CAV_OK;
  for (int i = 0; i < LEAP_BOXES && !*taken; i++) {
    set_radius(run->tr, d->radius, leap_box[i]);
    status = solve_model(run, d);
    if (status != CAV_OK) return status;
    d->merit = cav_programme_merit(run->tr, cav_quadratic_penalty(d->qp), d->before);
    d->predicted = cav_quadratic_decrease(d->qp);
    cav_course_begin(&d->course, run->tr);
    status = try_step(run, d, 1, d->predicted, &trial);
    if (status != CAV_OK) return status;
    *taken = trial - d->merit < leap_loss * scale;
    if (!*taken) status = cav_transcription_values(run->tr, run->at);
    if (status != CAV_OK) return status;
  }
  if (*taken) cav_run_exchange(&run->at, &run->spare);
  return CAV_OK;
}

cav_status cav_descent_settle_rows(cav_solve_run *run, cav_descent *d) {
  cav_transcription *tr = run->tr;
  cav_status status = CAV_OK;
  double worst = INFINITY;
  for (int i = 0; i < SETTLING && status == CAV_OK; i++) {
    const double is = cav_run_rows_off(run);
    if (!(is < 0.5 * worst) || is < 0.01 * run->options->tolerance) break;
    worst = is;
    for (int t = 0, k = 0; t < tr->nknot; t++)
      for (int j = 0; j < tr->knot[t].layout.count; j++) {
        const cav_slot *slot = &tr->knot[t].slot[j];
        d->offset[k++] = slot->value - fmin(fmax(slot->value, slot->lower), slot->upper);
      }
    cav_quadratic_correct(d->qp, d->offset, NULL, d->x);
    cav_transcription_move(tr, run->at, d->x, run->spare);
    double merit;
    status = try_at(run, d, run->spare, &merit);
    int nearer = isfinite(merit) && cav_run_rows_off(run) < is;
    if (nearer) cav_run_exchange(&run->at, &run->spare);
    if (!nearer && status == CAV_OK) status = cav_transcription_values(tr, run->at);
  }
  return status;
}

void cav_descent_begin(cav_solve_run *run, cav_descent *d) {
  cav_transcription_multipliers(run->tr);
  cav_programme_penalties(run->tr, cav_quadratic_penalty(d->qp));
  for (int t = 0, k = 0; t < run->tr->nknot; t++)
    for (int i = 0; i < run->tr->knot[t].layout.count; i++) d->multiplier[k++] = run->tr->knot[t].slot[i].multiplier;
  take_penalties(run->tr);
}

cav_status cav_descent_measure(cav_solve_run *run, cav_descent *d, int curved) {
  cav_status status = curved ? cav_curvature_find(d->curvature, run->tr, run->at, run->spare, d->multiplier, NULL)
                             : cav_transcription_linearise(run->tr, run->at);
  if (status != CAV_OK) return status;
  d->shift = 0;
  d->needs_known = 0;
  d->ratio = 0;
  if (curved) add_curvature(run, d);
  cav_programme_values(run->tr, cav_quadratic_value(d->qp));
  set_radius(run->tr, d->radius, most_radius);
  cav_quadratic_let_give(d->qp, cav_programme_scale(run->tr));
  status = solve_model(run, d);
  cav_quadratic_let_give(d->qp, 0);
  if (status != CAV_OK) return status;
  // a bound: what the programme decreases, and what its gap leaves open
  run->optimality = (fmax(cav_quadratic_decrease(d->qp), 0) + cav_quadratic_gap(d->qp)) / cav_programme_scale(run->tr);
  run->measured = 1;
  memcpy(d->multiplier, cav_quadratic_multiplier(d->qp), (size_t)cav_quadratic_rows(d->qp) * sizeof(double));
  for (int t = 0, k = 0; t < run->tr->nknot; t++)
    for (int i = 0; i < run->tr->knot[t].layout.count; i++)
      run->tr->knot[t].slot[i].final_multiplier = d->multiplier[k++];
  return CAV_OK;
}

/// The programme of a look, in full boxes; its decrease and gap, over the cost, into *saving, infinite where it is not solved
/// to its end. gives: its rows do.
static cav_status look_ahead(cav_solve_run *run, cav_descent *d, int gives, double *saving) {
  const double scale = cav_programme_scale(run->tr);
  const size_t bytes = (size_t)cav_quadratic_rows(d->qp) * sizeof(double);
  int solved = 0;
  set_radius(run->tr, d->next, most_radius);
  memcpy(d->offset, cav_quadratic_penalty(d->qp), bytes);
  cav_quadratic_let_give(d->qp, gives ? scale : 0);
  const cav_status status = cav_programme_solve(run, d->qp, d->next, d->kept, &d->rest, &solved);
  cav_quadratic_let_give(d->qp, 0);
  memcpy(cav_quadratic_penalty(d->qp), d->offset, bytes);
  *saving = INFINITY;
  if (!gives) d->at_least = solved ? fmax(cav_quadratic_decrease(d->qp), 0) / scale : 0;
  if (solved && fabs(cav_quadratic_unfinished(d->qp)) <= unfinished)
    *saving = (fmax(cav_quadratic_decrease(d->qp), 0) + cav_quadratic_gap(d->qp)) / scale;
  return status;
}

cav_status cav_descent_foresee(cav_solve_run *run, cav_descent *d, double *saving) {
  cav_status status = cav_transcription_linearise(run->tr, run->at);
  if (status != CAV_OK) return status;
  cav_programme_values(run->tr, cav_quadratic_value(d->qp));
  status = look_ahead(run, d, 0, saving);
  d->doubted = !isfinite(*saving);
  return status == CAV_OK && d->doubted ? look_ahead(run, d, 1, saving) : status;
}

/// Tries parts of the last look's step, smaller and smaller ones while they gain more, with the penalties of its programme; the
/// best one to d->best. *gain: what it gains, 0 where none does; *part: which it is.
static cav_status try_ahead(cav_solve_run *run, cav_descent *d, double *gain, double *part) {
  *gain = *part = 0;
  cav_course_begin(&d->course, run->tr);
  d->merit = cav_programme_merit(run->tr, cav_quadratic_penalty(d->qp), d->before);
  d->predicted = cav_quadratic_decrease(d->qp);
  for (int i = 0; i < PARTS; i++) {
    const double p = ahead[i];
    double trial;
    const cav_status status = try_step(run, d, p, 0.9 * p * (2 - p) * d->predicted, &trial);
    if (status != CAV_OK) return status;
    if (d->merit - trial > *gain) {
      *gain = d->merit - trial, *part = p;
      cav_run_exchange(&run->spare, &d->best);
    } else if (*gain > 0)
      break;
  }
  return CAV_OK;
}

cav_status cav_descent_go_ahead(cav_solve_run *run, cav_descent *d, double least, int *taken) {
  const size_t bytes = (size_t)cav_quadratic_rows(d->qp) * sizeof(double);
  double gain, part;
  memcpy(d->offset, cav_quadratic_penalty(d->qp), bytes);
  memcpy(cav_quadratic_penalty(d->qp), d->kept, bytes);
  const cav_status status = try_ahead(run, d, &gain, &part);
  *taken = status == CAV_OK && gain > least;
  if (!*taken) memcpy(cav_quadratic_penalty(d->qp), d->offset, bytes);
  if (status != CAV_OK) return status;
  d->last = NULL;
  if (*taken) {
    cav_run_exchange(&run->at, &d->best);
    d->gain = gain;
    d->ratio = gain / (part * (2 - part) * d->predicted);
    for (int b = 0; b <= cav_transcription_blocks(run->tr); b++)
      d->radius[b] = fmax(d->radius[b], part * block_length(run->tr, cav_quadratic_step(d->qp), b));
  }
  return cav_transcription_values(run->tr, run->at);
}

cav_status cav_descent_confirm(cav_solve_run *run, cav_descent *d, double *saving) {
  return d->doubted ? CAV_OK : look_ahead(run, d, 1, saving);
}
