/// What a term measures at a knot: its window, its dofs, its target, and the reading of a sensor against it. The sums
/// over dofs and contacts, which know derivatives, are in knot.c.
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "problem_file.h"
#include "quantity.h"
#include "recorded.h"
#include "rotation.h"
#include "transcription.h"

/// Fraction of a step by which a window may miss a knot and still hold it.
static const double near_knot = 1e-6;

/// Whether what a term measures needs the forces of a knot; of a record also velocities, which it has half a step later.
static int reads_force(const cav_term *term) {
  int recorded = term->quantity == CAV_QUANTITY_TRACK && cav_term_stage(term) == CAV_READS_VELOCITY;
  return cav_term_stage(term) == CAV_READS_ACCELERATION || recorded;
}

double cav_knot_time(const cav_transcription *tr, int t) { return t * tr->problem->timestep + tr->elapsed; }

void cav_transcription_elapse(cav_transcription *tr, double seconds) {
  tr->elapsed += seconds;
  for (int t = 0; t < tr->nknot; t++) tr->knot[t].time += seconds;
}

/// Knots at which a term speaks.
static cav_window window_of(const cav_transcription *tr, const cav_term *term) {
  double h = tr->problem->timestep, end = (tr->nknot - 1) * h, to = fmin(term->to < 0 ? end : term->to, end);
  double from = fmin(term->from < 0 ? end : term->from, end);
  cav_window w = {.first = (int)ceil(from / h - near_knot), .last = (int)floor(to / h + near_knot)};
  // one instant, or a window between two knots: the knot nearest to its middle
  w.single = to - from < 1e-9 || w.first > w.last;
  if (w.single) w.first = w.last = (int)lround((from + to) / (2 * h));
  // both ends of a cycle are one knot: costs count it once, at its end, or where its forces are
  if (tr->periodicity && !w.single && w.first == 0 && w.last == tr->nknot - 1 && term->use == CAV_USE_COST &&
      !reads_force(term))
    w.first = 1;
  // a last knot that nothing leaves has no acceleration and no force
  if (reads_force(term) && w.last == tr->nknot - 1 && !cav_knot_has_force(tr, w.last)) w.last--;
  return w;
}

void cav_term_windows(cav_transcription *tr) {
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    char *selected = tr->selected + (size_t)i * (size_t)tr->nv;
    tr->window[i] = window_of(tr, term);
    for (int d = 0; d < tr->nv; d++) {
      selected[d] = (char)(cav_dof_selected(tr, term, d) != 0);
      tr->window[i].dofs += selected[d];
    }
  }
}

double cav_term_weight(const cav_transcription *tr, const cav_term *term, int t) {
  const cav_window *w = cav_term_window(tr, term);
  if (t < w->first || t > w->last) return 0;
  const double part = cav_term_avoids(tr->model, term) ? 1 - tr->lightened : cav_term_calms(term) ? 1 + tr->calmed : 1;
  return (w->single ? 1 : tr->options.timestep) * part;
}

int cav_term_is_reading(const cav_term *term) {
  return term->quantity == CAV_QUANTITY_SENSOR || term->quantity == CAV_QUANTITY_USER ||
         term->quantity == CAV_QUANTITY_TRACK;
}

/// Readings of a term: none but for sensors, records and quantities of one's own.
int cav_term_dim(const cav_term *term) {
  if (!cav_term_is_reading(term)) return 0;
  if (term->quantity == CAV_QUANTITY_TRACK) return cav_recorded_dim(term->track);
  if (term->component >= 0) return 1;
  if (term->quantity == CAV_QUANTITY_USER) return term->user->dim;
  return term->sensor.dim == 4 ? 3 : term->sensor.dim;
}

int cav_term_readings(const cav_transcription *tr, const cav_term *term, int t) {
  int n = cav_term_dim(term);
  return n > 0 && cav_term_weight(tr, term, t) == 0 ? 0 : n;
}

int cav_dof_selected(const cav_transcription *tr, const cav_term *term, int d) {
  return cav_problem_selects(tr->model, term, d);
}

cav_status cav_user_term_check(const cav_term *term, cav_error *error) {
  const cav_user_quantity *user = term->user;
  const char *reason = NULL;
  if (term->quantity != CAV_QUANTITY_USER) return CAV_OK;
  if (!user || !user->value || !user->name)
    reason = "is of a quantity of one's own without a name or a function for its values: fill term.user";
  else if (user->dim < 1 || user->dim > CAV_USER_DIM_MAX)
    reason = "is of a quantity whose dim is not 1 to CAV_USER_DIM_MAX";
  else if (user->reads < CAV_READS_POSITION || user->reads > CAV_READS_ACCELERATION)
    reason = "is of a quantity that does not say what it reads: CAV_READS_POSITION, _VELOCITY or _ACCELERATION";
  else if (term->component < -1 || term->component >= user->dim)
    reason = "is of a component that its quantity does not have; -1: all of them";
  if (!reason) return CAV_OK;
  if (error) {
    *error = (cav_error){.status = CAV_BAD_INPUT};
    snprintf(error->text, sizeof error->text, "term '%.80s' %s", term->name ? term->name : "", reason);
  }
  return CAV_BAD_INPUT;
}

/// Value minus target of a quantity of one's own, over the scale.
static void read_user(const cav_transcription *tr, cav_state *state, const cav_term *term, int t, double *y) {
  double value[CAV_USER_DIM_MAX], target[CAV_USER_DIM_MAX], time = cav_knot_time(tr, t);
  cav_user_refusal *refusal = &tr->knot[t].refusal;
  int before = refusal->refused, first = term->component < 0 ? 0 : term->component, n = cav_term_dim(term);
  cav_user_read(term->user, state, time, value, refusal);
  if (refusal->refused && !before) tr->knot[t].refused_term = (int)(term - tr->problem->term);
  cav_term_target(term, time, term->user->dim, target);
  for (int k = 0; k < n; k++) y[k] = (value[first + k] - target[first + k]) / term->scale;
}

/// Value minus target of a term with readings, over its scale.
void cav_term_read(const cav_transcription *tr, cav_state *state, const cav_term *term, int t, double *y) {
  double reading[CAV_SENSOR_DIM_MAX], target[CAV_SENSOR_DIM_MAX];
  if (term->quantity == CAV_QUANTITY_USER) {
    read_user(tr, state, term, t, y);
    return;
  }
  if (term->quantity == CAV_QUANTITY_TRACK) {
    cav_recorded_read(tr, state, term, t, y);
    return;
  }
  assert(term->sensor.dim <= CAV_SENSOR_DIM_MAX);
  cav_sensor_read(tr->model, state, &term->sensor, reading);
  cav_term_target(term, cav_knot_time(tr, t), term->sensor.dim, target);
  if (term->sensor.dim == 4) {
    double phi[3];
    if (!term->target) target[0] = 1;
    cav_rotation_between(target, reading, phi);
    for (int k = 0; k < 3; k++) reading[k] = phi[k], target[k] = 0;
  }
  int first = term->component < 0 ? 0 : term->component, n = cav_term_dim(term);
  for (int k = 0; k < n; k++) y[k] = (reading[first + k] - target[first + k]) / term->scale;
}
