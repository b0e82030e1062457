/// Moving-horizon estimation on a solver that keeps its memory (optimiser.c). A window of knots is moved on by one for each
/// update; what leaves it goes into its arrival cost (arrival.c). The last step of an update is taken from the rows themselves
/// (information.c), whose factor has the covariance and the next arrival cost, too (optim/METHOD.md, 15).
#include "cavort/mhe.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arrival.h"
#include "optimiser.h"
#include "quantity.h"
#include "stream.h"

/// Largest change of one unknown in a step that is taken whole, rad or m; fraction of the merit that rounding makes.
static const double longest = 0.7, noise = 1e-10;

enum { LEAST_KNOTS = 3, FIRST_ITERATIONS = 50 };

struct cav_mhe {
  cav_problem problem; ///< the given one with the terms below
  cav_mhe_options options;
  cav_term *term;     ///< [problem.nterm] those of the arrival cost last
  cav_stream *stream; ///< [problem.nterm]
  cav_optimiser *optimiser;
  cav_information information;
  cav_arrival arrival, next;               ///< of the window, and of the one after it
  int now;                                 ///< knot of the last update, -1: none yet
  int first;                               ///< knots that have left the window
  double *x;                               ///< [unknowns] step; holds the room of all
  double *row, *unit, *image, *covariance; ///< [2nv*3nv], [3nv], [2nv*(3nv+1)], [4nv*nv]
  cav_state *state;
};

cav_mhe_options cav_mhe_options_default(void) { return (cav_mhe_options){.threads = 1, .iterations = 1}; }

static cav_status refuse(cav_error *error, cav_status status, const char *text) {
  *error = (cav_error){.status = status};
  snprintf(error->text, sizeof error->text, "mhe: %s", text);
  return status;
}

/// Whether a term is over a part of the horizon, but for its beginning.
static int is_part(const cav_problem *p, const cav_term *term) {
  const int start = term->from == 0 && term->to == 0, end = term->to < 0 || term->to > p->duration - 0.5 * p->timestep;
  return !start && !(term->from == 0 && end);
}

static cav_status check(const cav_problem *p, const cav_mhe_options *o, cav_error *error) {
  const double length = o->knots ? (o->knots - 1) * p->timestep : p->duration;
  if (!p->model || !p->term || p->nterm < 1) return refuse(error, CAV_BAD_INPUT, "expected a model and terms");
  if (!p->free_start || p->close_at_rest || p->cycle.on || p->duration_most > 0)
    return refuse(
        error, CAV_NOT_SUPPORTED,
        "where a body is, is not known: expected <start free=\"true\"> and close=\"open\", no cycle and no free "
        "duration");
  if (p->model->nv > CAV_USER_DIM_MAX) return refuse(error, CAV_NOT_SUPPORTED, "a model with more than 64 dofs");
  if (o->threads < 1 || o->iterations < 1 || !(o->deadline >= 0))
    return refuse(error, CAV_BAD_INPUT, "expected at least one thread and one iteration, and a deadline from 0 on");
  if (o->knots != 0 && (o->knots < LEAST_KNOTS || length > p->duration + 0.5 * p->timestep)) {
    char text[120];
    snprintf(text, sizeof text, "expected a window of %d to %d knots, as many as the problem has, got %d", LEAST_KNOTS,
             (int)lround(p->duration / p->timestep) + 1, o->knots);
    return refuse(error, CAV_BAD_INPUT, text);
  }
  int records = 0;
  for (int i = 0; i < p->nterm; i++) {
    records += p->term[i].quantity == CAV_QUANTITY_TRACK;
    if (is_part(p, &p->term[i]))
      return refuse(error, CAV_NOT_SUPPORTED, "terms are over the whole window, or at 0 s: what is known of the start");
  }
  return records ? CAV_OK
                 : refuse(error, CAV_BAD_INPUT, "expected a record, <track>: what is measured, with its noise");
}

/// Terms with streams in the place of records, and the arrival cost.
static cav_status copy_terms(cav_mhe *mhe, const cav_problem *p) {
  const size_t n = (size_t)p->nterm + CAV_ARRIVAL_TERMS;
  mhe->term = calloc(n, sizeof *mhe->term);
  mhe->stream = calloc(n, sizeof *mhe->stream);
  cav_status status = mhe->term && mhe->stream ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) memcpy(mhe->term, p->term, (size_t)p->nterm * sizeof *p->term);
  for (int i = 0; i < p->nterm && status == CAV_OK; i++) {
    if (!mhe->term[i].track) continue;
    status = cav_stream_begin(&mhe->stream[i], mhe->term[i].track);
    mhe->term[i].track = &mhe->stream[i].track;
  }
  if (status == CAV_OK) status = cav_arrival_begin(&mhe->arrival, p->model);
  if (status == CAV_OK) status = cav_arrival_begin(&mhe->next, p->model);
  if (status != CAV_OK) return status;
  cav_arrival_terms(&mhe->arrival, mhe->term + p->nterm);
  mhe->problem.term = mhe->term;
  mhe->problem.nterm = (int)n;
  return CAV_OK;
}

/// Frees what has the size of the window.
static void close_window(cav_mhe *mhe) {
  cav_information_clear(&mhe->information);
  cav_optimiser_free(mhe->optimiser);
  free(mhe->x);
  mhe->optimiser = NULL, mhe->x = NULL;
}

static cav_status make_room(cav_mhe *mhe) {
  cav_transcription *tr = cav_optimiser_run(mhe->optimiser)->tr;
  const size_t nv = (size_t)tr->nv, unknowns = (size_t)cav_transcription_unknowns(tr);
  const size_t image = 2 * nv * (3 * nv + 1);
  mhe->x = calloc(unknowns + 6 * nv * nv + 3 * nv + image + 4 * nv * nv, sizeof *mhe->x);
  if (!mhe->x) return CAV_NO_MEMORY;
  mhe->row = mhe->x + unknowns;
  mhe->unit = mhe->row + 6 * nv * nv;
  mhe->image = mhe->unit + 3 * nv;
  mhe->covariance = mhe->image + image;
  return cav_information_begin_merit(&mhe->information, tr);
}

/// A window of so many knots, at the problem's guess or at start.
static cav_status open_window(cav_mhe *mhe, int knots, const cav_trajectory *start, cav_error *error) {
  cav_solve_options options = cav_solve_options_default();
  options.threads = mhe->options.threads;
  options.gains = options.diagnose = 0;
  options.fixed_multipliers = options.moving_targets = 1;
  close_window(mhe);
  mhe->problem.duration = (knots - 1) * mhe->problem.timestep;
  mhe->optimiser = cav_optimiser_new(&mhe->problem, &options, start, error);
  if (!mhe->optimiser) return error->status;
  return make_room(mhe) == CAV_OK ? CAV_OK : refuse(error, CAV_NO_MEMORY, "not enough memory");
}

static cav_status open_all(cav_mhe *mhe, const cav_problem *p, cav_error *error) {
  mhe->problem = *p;
  mhe->problem.window = 0, mhe->problem.nguess_pose = 0;
  if (!mhe->options.knots) mhe->options.knots = (int)lround(p->duration / p->timestep) + 1;
  mhe->state = cav_state_new(p->model);
  if (!mhe->state || copy_terms(mhe, p) != CAV_OK) return refuse(error, CAV_NO_MEMORY, "not enough memory");
  return open_window(mhe, LEAST_KNOTS, NULL, error);
}

cav_mhe *cav_mhe_new(const cav_problem *problem, const cav_mhe_options *options, cav_error *error) {
  cav_error ignored;
  if (!error) error = &ignored;
  const cav_mhe_options o = options ? *options : cav_mhe_options_default();
  if (check(problem, &o, error) != CAV_OK) return NULL;
  cav_mhe *mhe = calloc(1, sizeof *mhe);
  if (!mhe) {
    refuse(error, CAV_NO_MEMORY, "not enough memory");
    return NULL;
  }
  mhe->options = o;
  mhe->now = -1;
  if (open_all(mhe, problem, error) == CAV_OK) return mhe;
  cav_mhe_free(mhe);
  return NULL;
}

void cav_mhe_free(cav_mhe *mhe) {
  if (!mhe) return;
  close_window(mhe);
  for (int i = 0; mhe->stream && i < mhe->problem.nterm; i++) cav_stream_clear(&mhe->stream[i]);
  cav_arrival_clear(&mhe->arrival);
  cav_arrival_clear(&mhe->next);
  cav_state_free(mhe->state);
  free(mhe->stream), free(mhe->term);
  free(mhe);
}

cav_status cav_mhe_measure(cav_mhe *mhe, int term, double time, const double *value) {
  const int n = mhe->problem.nterm - CAV_ARRIVAL_TERMS;
  if (term < 0 || term >= n || !mhe->term[term].track) return CAV_BAD_INPUT;
  // a step back, since readings are means over one
  const double oldest = mhe->stream[term].track.offset + (mhe->first - 2) * mhe->problem.timestep;
  return cav_stream_add(&mhe->stream[term], time, value, oldest);
}

// ---------------------------------------------------------------- the window

/// Whether forces u are beyond a limit of the problem.
static int oversteps(const cav_transcription *tr, const double *u) {
  for (int i = 0; i < tr->nlimit; i++) {
    const cav_force_row *row = &tr->effort[i];
    double effort = 0;
    for (int k = 0; k < row->n; k++) effort += row->coef[k] * u[row->dof[k]];
    if (tr->servo[i].n == 0 && (effort < tr->effort_range[i][0] || effort > tr->effort_range[i][1])) return 1;
  }
  return 0;
}

/// The last knot goes on at the velocity of the one before it; where that asks for more than a limit allows, by the forces of the
/// step before: a row that holds something back where it is linearised first would hold it through the step.
static void go_on(cav_mhe *mhe, cav_trajectory *at) {
  const cav_model *m = mhe->problem.model;
  const cav_transcription *tr = cav_optimiser_run(mhe->optimiser)->tr;
  const size_t nq = (size_t)at->nq, nv = (size_t)at->nv, last = (size_t)at->nknot - 1;
  const double *q = at->q + (last - 1) * nq, *v = at->v + (last - 1) * nv;
  double *next = at->v + last * nv;
  mhe->state->options = tr->options;
  cav_status status = cav_inverse(m, mhe->state, q, v, v, mhe->unit);
  int forced = status == CAV_OK && oversteps(tr, mhe->unit);
  if (forced) status = cav_inverse(m, mhe->state, q - nq, v - nv, v, mhe->unit);
  if (forced && status == CAV_OK) status = cav_forward(m, mhe->state, q, v, mhe->unit, next);
  if (!forced || status != CAV_OK) memcpy(next, v, nv * sizeof(double));
  cav_integrate(m, q, next, at->timestep, at->q + last * nq);
}

/// A window that is longer by a knot.
static cav_status lengthen(cav_mhe *mhe) {
  const cav_trajectory *at = cav_optimiser_run(mhe->optimiser)->at;
  const size_t n = (size_t)at->nknot, nq = (size_t)at->nq, nv = (size_t)at->nv;
  cav_trajectory *longer = cav_trajectory_new(mhe->problem.model, at->nknot + 1, at->timestep);
  cav_error error = {0};
  if (!longer) return CAV_NO_MEMORY;
  memcpy(longer->q, at->q, n * nq * sizeof(double)), memcpy(longer->v, at->v, n * nv * sizeof(double));
  go_on(mhe, longer);
  cav_status status = open_window(mhe, longer->nknot, longer, &error);
  cav_trajectory_free(longer);
  return status;
}

/// Moves the window on by a knot.
static cav_status slide(cav_mhe *mhe) {
  cav_status status = cav_optimiser_shift(mhe->optimiser, 1, NULL, NULL);
  if (status != CAV_OK) return status;
  go_on(mhe, cav_optimiser_run(mhe->optimiser)->at);
  cav_arrival_copy(&mhe->arrival, &mhe->next);
  // what was known of the start has gone into the arrival cost
  for (int i = 0; i < mhe->problem.nterm - CAV_ARRIVAL_TERMS; i++)
    if (mhe->term[i].from == 0 && mhe->term[i].to == 0) mhe->term[i].weight = 0;
  mhe->first++;
  return CAV_OK;
}

/// The window that ends at the next knot; the first ones end after it.
static cav_status advance(cav_mhe *mhe) {
  const int knots = cav_optimiser_run(mhe->optimiser)->tr->nknot;
  cav_status status = CAV_OK;
  if (mhe->now + 1 == mhe->options.knots) return slide(mhe);
  if (mhe->now + 1 == knots) status = lengthen(mhe);
  if (status == CAV_OK) mhe->now++;
  return status;
}

/// Covariance of the state at the present knot.
static void find_covariance(cav_mhe *mhe) {
  cav_information *f = &mhe->information;
  const cav_transcription *tr = f->tr;
  const int nv = tr->nv, n = 2 * nv, across = 3 * nv + 1, block = cav_information_block(f, mhe->now);
  for (int d = 0; d < n; d++) {
    memset(mhe->unit, 0, 3 * (size_t)nv * sizeof(double));
    mhe->unit[d] = 1;
    cav_transcription_chain(tr, mhe->now, 1, mhe->unit, mhe->row + (size_t)d * 3 * (size_t)nv);
  }
  cav_row_factor_ignore_border(&f->factor);
  for (int b = f->core - 1; b >= block; b--) cav_row_factor_back(&f->factor, b);
  cav_information_spread(f, mhe->now, n, mhe->row, mhe->image);
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      double sum = 0;
      for (int k = 0; k < across; k++) sum += mhe->image[i * across + k] * mhe->image[j * across + k];
      mhe->covariance[i * n + j] = mhe->covariance[j * n + i] = sum;
    }
}

/// The rows at the present motion to their factor: step, covariance, and what the next window arrives with.
static cav_status factor(cav_mhe *mhe, double *merit) {
  cav_solve_run *run = cav_optimiser_run(mhe->optimiser);
  cav_transcription *tr = run->tr;
  tr->gradient_only = 1;
  cav_status status = cav_transcription_linearise(tr, run->at);
  tr->gradient_only = 0;
  if (status != CAV_OK) return status;
  *merit = cav_transcription_merit(tr);
  cav_information_start(&mhe->information, 0, NULL);
  status = cav_information_advance(&mhe->information);
  if (status == CAV_OK && mhe->now == tr->nknot - 1) cav_arrival_take(&mhe->next, &mhe->information, run->at);
  if (status == CAV_OK) status = cav_information_finish(&mhe->information);
  if (status != CAV_OK) return status;
  cav_information_step(&mhe->information, mhe->x);
  find_covariance(mhe);
  return CAV_OK;
}

/// Takes the whole step if it makes the merit no larger. *taken 0: it does.
static cav_status take_step(cav_mhe *mhe, double merit, int *taken) {
  cav_solve_run *run = cav_optimiser_run(mhe->optimiser);
  double most = 0;
  for (int k = 0; k < cav_transcription_unknowns(run->tr); k++) most = fmax(most, fabs(mhe->x[k]));
  *taken = 0;
  if (!(most <= longest)) return CAV_OK;
  cav_transcription_move(run->tr, run->at, mhe->x, run->spare);
  cav_status status = cav_transcription_values(run->tr, run->spare);
  if (status == CAV_NO_MEMORY) return status;
  *taken = status == CAV_OK && cav_transcription_merit(run->tr) <= merit * (1 + noise);
  if (!*taken) return CAV_OK;
  cav_trajectory *swap = run->at;
  run->at = run->spare;
  run->spare = swap;
  run->solution->iterations++;
  return CAV_OK;
}

static void tell(cav_mhe *mhe, double begin, cav_progress *last) {
  cav_solve_run *run = cav_optimiser_run(mhe->optimiser);
  if (!last) return;
  *last = (cav_progress){.phase = "mhe", .stage = 1, .stages = 1, .fraction = 1};
  last->iteration = run->solution->iterations;
  last->cost = cav_transcription_cost(run->tr);
  last->unactuated = cav_transcription_unactuated(run->tr, &last->knot);
  last->violation = cav_transcription_violation(run->tr);
  last->step = 1;
  last->seconds = cav_clock() - begin;
}

cav_status cav_mhe_update(cav_mhe *mhe, cav_progress *last) {
  const double begin = cav_clock();
  if (!mhe->optimiser) return CAV_NO_MEMORY;
  cav_status status = advance(mhe);
  // from the guess, which may be far off
  if (status == CAV_OK && mhe->first == 0) status = cav_optimiser_iterate(mhe->optimiser, FIRST_ITERATIONS, NULL);
  for (int i = 1; i < mhe->options.iterations && status == CAV_OK; i++) {
    if (mhe->options.deadline > 0 && cav_clock() - begin > mhe->options.deadline) break;
    status = cav_optimiser_iterate(mhe->optimiser, 1, NULL);
  }
  double merit = 0;
  int taken = 0;
  if (status == CAV_OK) status = factor(mhe, &merit);
  if (status == CAV_OK) status = take_step(mhe, merit, &taken);
  if (status == CAV_OK && !taken) status = cav_optimiser_iterate(mhe->optimiser, 1, NULL);
  if (status == CAV_OK) tell(mhe, begin, last);
  return status;
}

// ---------------------------------------------------------------- estimates

cav_status cav_mhe_view(cav_mhe *mhe, int lag, cav_knot_view *view) {
  cav_solve_run *run = cav_optimiser_run(mhe->optimiser);
  const int t = mhe->now - lag;
  if (mhe->now < 0 || lag < 0 || t < 0) return CAV_BAD_INPUT;
  const cav_trajectory *at = run->at;
  const size_t nq = (size_t)at->nq, nv = (size_t)at->nv;
  const double *q = at->q + (size_t)t * nq, *v = at->v + (size_t)t * nv, *next = lag ? v + nv : v;
  mhe->state->options = run->tr->options;
  cav_status status = cav_inverse(mhe->problem.model, mhe->state, q, v, next, mhe->unit);
  *view = (cav_knot_view){.model = mhe->problem.model, .state = mhe->state, .q = q, .v = v, .v_next = next};
  view->time = (mhe->first + t) * mhe->problem.timestep;
  view->timestep = at->timestep;
  view->u = mhe->state->u;
  return status;
}

const double *cav_mhe_covariance(const cav_mhe *mhe) { return mhe->now < 0 ? NULL : mhe->covariance; }

/// Numbers that a record says at knot t of the window.
static int count(const cav_transcription *tr, const cav_track *track, int t) {
  double value[CAV_SENSOR_DIM_MAX];
  int n = 0;
  for (int i = 0; i < track->nchannel; i++) {
    const cav_channel *c = &track->channel[i];
    if (!cav_track_sample(track, c, cav_knot_time(tr, t), tr->problem->timestep, value)) continue;
    if (cav_channel_rotates(c)) n += 3;
    for (int k = 0; k < c->ncolumn && !cav_channel_rotates(c); k++) n += !isnan(value[k]);
  }
  return n;
}

double cav_mhe_chi_square(const cav_mhe *mhe, int *readings) {
  *readings = 0;
  if (mhe->now < 0) return NAN;
  const cav_transcription *tr = cav_optimiser_run(mhe->optimiser)->tr;
  for (int i = 0; i < mhe->problem.nterm - CAV_ARRIVAL_TERMS; i++) {
    const cav_term *term = &mhe->term[i];
    if (!term->track || !(term->weight > 0)) continue;
    // forces after the newest knot are not known yet, and velocities are read with them
    const int knots = tr->nknot - (cav_term_stage(term) > CAV_READS_POSITION);
    for (int t = 0; t < knots; t++) *readings += count(tr, term->track, t);
  }
  return 2 * cav_transcription_cost(tr);
}
