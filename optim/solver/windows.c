/// Long motions by windows of time, one after the other: linear in time, with the memory of one.
///
/// A window looks ahead over an overlap that the next one solves again: of it all is kept up to where the overlap begins,
/// and there the next window starts, at the posture and velocity that were found. So every step of the whole is a step of
/// one window, and forces, ranges and constraints hold across seams as they do inside. What lies beyond a window bears on
/// what is kept of it less and less the longer the overlap is: as much as the optimal motion's memory, which fades
/// exponentially. Terms are cut and moved to each window; the guess of the next one is what the last saw of it.
#include "windows.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "file.h"
#include "quantity.h"

static const double near_knot = 1e-6; // of a step

/// A whole problem in windows.
typedef struct windows {
  const cav_problem *whole;
  const cav_solve_options *options;
  int last, length, stride; ///< last knot of the whole; steps of a window, and from one to the next
  int first, knots;         ///< of the present window: first knot in the whole, steps
  cav_problem part;         ///< the present window
  int *origin;              ///< [nterm] of its terms, in the whole
  double *memory;           ///< of its targets
  cav_trajectory *at;       ///< the whole motion: found up to the present window, guessed beyond it
  cav_solution *solution;   ///< of the whole
  double begin;             ///< s
} windows;

int cav_windows_apply(const cav_problem *p) { return p->window > 0 && p->duration > p->window * (1 + near_knot); }

static cav_status refuse(const windows *w, cav_error *error) {
  const cav_problem *p = w->whole;
  const cav_solve_options *o = w->options;
  const char *reason = NULL;
  for (int i = 0; i < p->nterm && !reason; i++)
    if (p->term[i].quantity == CAV_QUANTITY_USER) reason = "quantities of one's own do not know of them";
  if (o->resume || o->nmultiplier || o->first_stage > 1)
    reason = "each begins from its guess: no stage, no multipliers and no checkpoint to go on from";
  if (w->stride < 2) reason = "their overlap leaves less than two steps from one to the next";
  return reason ? cav_file_fail(error, CAV_BAD_INPUT, 0, "solved by windows: %s", reason) : CAV_OK;
}

/// Waypoints of a term within a window, and what it wants at its ends; room moves on.
static void cut_waypoints(const windows *w, cav_term *term, double from, double duration, double **room) {
  int dim = cav_term_target_length(w->whole->model, term), n = 0;
  const cav_term *whole = &w->whole->term[term - w->part.term];
  double *time = *room, *target = time + whole->nwaypoint + 2, slack = near_knot * w->whole->timestep;
  for (int i = -1; i <= whole->nwaypoint; i++) {
    int end = i < 0 || i == whole->nwaypoint;
    double at = i < 0 ? 0 : end ? duration : whole->waypoint_time[i] - from;
    if (!end && (at < slack || at > duration - slack)) continue;
    time[n] = at;
    cav_term_target(whole, from + at, dim, target + n++ * dim);
  }
  *room = target + (whole->nwaypoint + 2) * dim;
  term->nwaypoint = n, term->waypoint_time = time, term->target = target;
}

/// A term as a window has it; 0: it says nothing there.
static int cut_term(const windows *w, cav_term *term, double from, double duration, double **room) {
  double h = w->whole->timestep, whole = w->last * h, slack = near_knot * h;
  double first = term->from, last = term->to < 0 ? whole : term->to;
  int ends = term->to < 0 || last > whole - slack, reaches = from + duration > whole - slack;
  // one time, or what falls between two knots, is at the knot nearest to its middle
  if (last - first < 1e-9 || ceil(first / h - near_knot) > floor(last / h + near_knot))
    first = last = (double)lround((first + last) / (2 * h)) * h;
  if (last < from - slack || first > from + duration + slack) return 0;
  term->from = first > from + slack ? first - from : 0;
  term->to = last < from + duration - slack || first == last ? last - from : -1;
  if (ends && reaches && first != last) term->to = -1;
  // what begins where a window ends, or ends where it begins, would be one knot of a running cost
  if (first != last && (term->to >= 0 ? term->to : duration) - term->from < h / 2) return 0;
  if (term->nwaypoint) cut_waypoints(w, term, from, duration, room);
  return 1;
}

/// The problem of the present window.
static cav_status make_part(windows *w, cav_track *track) {
  const cav_problem *p = w->whole;
  const cav_model *m = p->model;
  double h = p->timestep, from = w->first * h, *room = w->memory;
  w->part = *p;
  cav_problem *part = &w->part;
  part->window = 0;
  part->duration = w->knots * h;
  part->close_at_rest = p->close_at_rest && w->first + w->knots == w->last;
  part->free_start = p->free_start && w->first == 0;
  // the guess is given as a motion, and a horizon without the goal's arc
  part->nguess_pose = part->nswing = 0;
  part->guess = CAV_GUESS_INTERPOLATE;
  part->guess_height = part->guess_ground = 0;
  part->guess_from = 0, part->guess_to = part->duration;
  memset(part->guess_rotation, 0, sizeof part->guess_rotation);
  memset(part->guess_bow, 0, sizeof part->guess_bow);
  part->q_start = w->at->q + (size_t)w->first * (size_t)m->nq;
  part->v_start = w->at->v + (size_t)w->first * (size_t)m->nv;
  part->term = malloc(((size_t)p->nterm + 1) * sizeof *part->term);
  if (!part->term) return CAV_NO_MEMORY;
  part->nterm = 0;
  memcpy(part->term, p->term, (size_t)p->nterm * sizeof *part->term);
  for (int i = 0; i < p->nterm; i++) {
    cav_term *term = &part->term[i];
    if (term->track) {
      track[i] = *term->track;
      track[i].offset += from;
      term->track = &track[i];
    }
    if (!cut_term(w, term, from, part->duration, &room)) term->weight = -1;
  }
  for (int i = 0; i < p->nterm; i++)
    if (part->term[i].weight >= 0) {
      w->origin[part->nterm] = i;
      part->term[part->nterm++] = part->term[i];
    }
  return CAV_OK;
}

/// The guess of the present window: what is known of the whole.
static cav_trajectory *guess_of(const windows *w) {
  size_t nq = (size_t)w->at->nq, nv = (size_t)w->at->nv, n = (size_t)w->knots + 1;
  cav_trajectory *guess = cav_trajectory_new(w->whole->model, (int)n, w->whole->timestep);
  if (!guess) return NULL;
  memcpy(guess->q, w->at->q + (size_t)w->first * nq, n * nq * sizeof(double));
  memcpy(guess->v, w->at->v + (size_t)w->first * nv, n * nv * sizeof(double));
  cav_trajectory_velocities(w->whole->model, guess);
  return guess;
}

/// Progress of a window as that of the whole.
static int observe(void *context, const cav_progress *progress) {
  const windows *w = context;
  cav_progress p = *progress;
  p.iteration += w->solution->iterations;
  p.knot += p.knot >= 0 ? w->first : 0;
  p.fraction = (w->first + p.fraction * w->stride) / w->last;
  p.fraction = fmin(p.fraction, 1);
  p.seconds = cav_clock() - w->begin;
  return w->options->observer(w->options->observer_context, &p);
}

/// Gains of the knots that are kept of a window.
static cav_status keep_gains(windows *w, const cav_solution *part, int kept) {
  size_t n = (size_t)w->at->nv * (size_t)w->at->nv;
  cav_solution *s = w->solution;
  if (!part->gain_q) {
    free(s->gain_q), free(s->gain_v);
    s->gain_q = s->gain_v = NULL;
    return CAV_OK;
  }
  if (w->first == 0) {
    s->gain_q = calloc((size_t)w->last * n, sizeof(double));
    s->gain_v = calloc((size_t)w->last * n, sizeof(double));
    if (!s->gain_q || !s->gain_v) return CAV_NO_MEMORY;
  }
  // one window without gains leaves all of it without
  if (!s->gain_q) return CAV_OK;
  memcpy(s->gain_q + (size_t)w->first * n, part->gain_q, (size_t)kept * n * sizeof(double));
  memcpy(s->gain_v + (size_t)w->first * n, part->gain_v, (size_t)kept * n * sizeof(double));
  return CAV_OK;
}

/// Rows of the knots that are kept, by the whole's knots and hard terms.
static cav_status keep_rows(windows *w, const cav_solution *part, int kept, int end) {
  cav_solution *s = w->solution;
  cav_binding *row = realloc(s->row, ((size_t)s->nrow + (size_t)part->nrow + 1) * sizeof *row);
  if (!row) return CAV_NO_MEMORY;
  s->row = row;
  for (int i = 0; i < part->nrow; i++) {
    cav_binding one = part->row[i];
    if (one.knot >= kept && !end) continue;
    one.knot += w->first;
    if (one.kind == CAV_BINDING_TERM) {
      // a number among hard terms
      int term = 0;
      for (int hard = -1; (hard += w->part.term[term].use != CAV_USE_COST) < one.object;) term++;
      one.object = -1;
      for (int k = 0; k <= w->origin[term]; k++) one.object += w->whole->term[k].use != CAV_USE_COST;
    }
    s->row[s->nrow++] = one;
  }
  return CAV_OK;
}

/// Takes what is kept of a window, and as a guess what it looked ahead.
static cav_status keep(windows *w, const cav_solution *part, int kept, int end) {
  size_t nq = (size_t)w->at->nq, nv = (size_t)w->at->nv, n = (size_t)w->knots + 1;
  cav_solution *s = w->solution;
  const cav_trajectory *from = part->trajectory;
  int free = w->first == 0 && w->whole->free_start;
  size_t begin = free ? 0 : 1;
  memcpy(w->at->q + ((size_t)w->first + begin) * nq, from->q + begin * nq, (n - begin) * nq * sizeof(double));
  memcpy(w->at->v + ((size_t)w->first + begin) * nv, from->v + begin * nv, (n - begin) * nv * sizeof(double));
  memcpy(w->at->u + (size_t)w->first * nv, from->u, n * nv * sizeof(double));
  s->contact = part->contact;
  s->unactuated = fmax(s->unactuated, part->unactuated);
  s->holds = part->holds && (w->first == 0 || s->holds);
  s->seconds_dynamics += part->seconds_dynamics;
  s->seconds_assembly += part->seconds_assembly;
  s->seconds_linear += part->seconds_linear;
  for (int i = 0; i < part->nprogress; i++) {
    cav_progress line = part->progress[i];
    line.iteration += s->iterations;
    line.knot += line.knot >= 0 ? w->first : 0;
    if (!cav_solution_log(s, &line)) return CAV_NO_MEMORY;
  }
  for (int i = 0; i < part->nstage; i++)
    if (!cav_solution_note(s, &part->stage[i])) return CAV_NO_MEMORY;
  s->iterations += part->iterations;
  cav_status status = keep_rows(w, part, kept, end);
  return status ? status : keep_gains(w, part, kept);
}

/// Solves the present window and keeps its part; *ended 1: it was the last.
static cav_status solve_window(windows *w, int *ended, cav_error *error) {
  // what would be left after it is as long as it looks ahead: the last one takes all of it
  int left = w->last - w->first;
  *ended = left <= w->length;
  w->knots = *ended ? left : w->length;
  int kept = *ended ? left : w->stride;
  cav_solution *part = NULL;
  cav_solve_options options = *w->options;
  options.keeper = NULL;
  if (options.observer) options.observer = observe, options.observer_context = w;
  if (options.max_seconds > 0) options.max_seconds = fmax(options.max_seconds - (cav_clock() - w->begin), DBL_MIN);
  if (options.max_iterations > 0) options.max_iterations -= w->solution->iterations;
  cav_track *track = calloc((size_t)w->whole->nterm + 1, sizeof *track);
  cav_trajectory *guess = guess_of(w);
  cav_status status = track && guess ? make_part(w, track) : CAV_NO_MEMORY;
  if (!status && w->options->max_iterations > 0 && options.max_iterations <= 0) status = CAV_INTERRUPTED;
  if (!status) status = cav_solve_after(&w->part, &options, guess, NULL, &part, error);
  if (part) {
    cav_status kept_status = keep(w, part, kept, *ended);
    if (kept_status) status = kept_status;
  }
  free(w->part.term);
  w->part.term = NULL;
  cav_trajectory_free(guess);
  cav_solution_free(part);
  free(track);
  return status;
}

static int ends(cav_status status) { return status != CAV_OK && status != CAV_NOT_CONVERGED; }

/// Room for the targets of all terms of a window.
static size_t room_of(const cav_problem *p) {
  size_t n = 1;
  for (int i = 0; i < p->nterm; i++)
    if (p->term[i].nwaypoint)
      n += ((size_t)p->term[i].nwaypoint + 2) * (1 + (size_t)cav_term_target_length(p->model, &p->term[i]));
  return n;
}

cav_status cav_windows_solve(const cav_problem *p, const cav_solve_options *options, const cav_trajectory *start,
                             cav_solution **solution, cav_error *error) {
  windows w = {.whole = p, .options = options, .begin = cav_clock()};
  w.last = (int)lround(p->duration / p->timestep);
  w.length = (int)lround(p->window / p->timestep);
  w.stride = w.length - (int)lround(p->overlap / p->timestep);
  *solution = NULL;
  cav_status status = refuse(&w, error), worst = CAV_OK;
  if (status) return status;
  w.at = start ? cav_trajectory_copy(start) : cav_problem_guess(p, error);
  if (!w.at) return start || !error ? CAV_NO_MEMORY : error->status;
  if (!p->free_start) {
    memcpy(w.at->q, p->q_start, (size_t)p->model->nq * sizeof(double));
    memcpy(w.at->v, p->v_start, (size_t)p->model->nv * sizeof(double));
  }
  w.solution = calloc(1, sizeof *w.solution);
  w.memory = malloc(room_of(p) * sizeof(double));
  w.origin = malloc(((size_t)p->nterm + 1) * sizeof *w.origin);
  cav_term_report *report = malloc(((size_t)p->nterm + 1) * sizeof *report);
  if (!w.solution || !w.memory || !w.origin || !report) status = CAV_NO_MEMORY;
  for (int ended = 0; !ended && !ends(status); w.first += w.stride) {
    status = solve_window(&w, &ended, error);
    if (!worst || ends(status)) worst = status;
  }
  if (status == CAV_NO_MEMORY) worst = status;
  if (w.solution && w.solution->nstage) {
    cav_trajectory_velocities(p->model, w.at);
    w.solution->trajectory = w.at, w.at = NULL;
    w.solution->optimality = NAN;
    w.solution->seconds = cav_clock() - w.begin;
    cav_error ignored = {0};
    if (cav_terms_report(p, w.solution->trajectory, &w.solution->contact, report, &w.solution->cost, &ignored))
      w.solution->cost = NAN;
    *solution = w.solution, w.solution = NULL;
  }
  cav_solution_free(w.solution);
  cav_trajectory_free(w.at);
  free(w.memory), free(w.origin), free(report);
  return worst;
}
