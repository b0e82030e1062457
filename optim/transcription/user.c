/// Quantities of one's own (CAV_QUANTITY_USER) at an evaluated state: their values, and from the derivatives that they
/// give by q, v, v_next, u and impulses those by q, v and v_next alone. Nothing is believed: what a function refuses, or
/// writes that is not finite, is noted and told by whoever evaluates.
#include "user.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Rows of nv that the derivatives of a contact's impulses by q, v and v_next take, each 6.
enum { IMPULSES = 6, IMPULSE_ROWS = 3 * IMPULSES };

static cav_knot_view view_of(cav_state *state, double time) {
  cav_knot_view view = {.model = state->model, .state = state, .time = time, .u = state->u};
  view.timestep = state->options.timestep;
  cav_state_point(state, &view.q, &view.v, &view.v_next);
  return view;
}

/// Notes the first thing that is wrong.
static void note(cav_user_refusal *refusal, int code, int component, int jacobian) {
  if (!refusal->refused) *refusal = (cav_user_refusal){1, code, component, jacobian};
}

/// Notes the first of n numbers that is not finite, per of them a value.
static void note_finite(cav_user_refusal *refusal, const double *x, size_t n, size_t per, int jacobian) {
  for (size_t i = 0; i < n; i++)
    if (!isfinite(x[i])) note(refusal, 0, (int)(i / per), jacobian);
}

void cav_user_read(const cav_user_quantity *user, cav_state *state, double time, double *value,
                   cav_user_refusal *refusal) {
  cav_knot_view view = view_of(state, time);
  memset(value, 0, (size_t)user->dim * sizeof *value);
  int code = user->value(user->context, &view, value);
  if (code) note(refusal, code, -1, 0);
  if (!code) note_finite(refusal, value, (size_t)user->dim, 1, 0);
}

static int reserve(cav_user_room *room, size_t n) {
  if (n <= room->n) return 1;
  double *larger = realloc(room->x, n * sizeof *larger);
  if (!larger) return 0;
  room->x = larger;
  room->n = n;
  return 1;
}

/// out [n*nv] += a [n*m] times b [m*nv].
static void add_product(int n, int m, int nv, const double *a, int stride, const double *b, double *out) {
  for (int i = 0; i < n; i++)
    for (int k = 0; k < m; k++) {
      double x = a[i * stride + k];
      for (int j = 0; x != 0 && j < nv; j++) out[i * nv + j] += x * b[k * nv + j];
    }
}

/// Whether a column of n rows is used.
static int weighs(const double *x, int n, int stride, int columns) {
  for (int i = 0; i < n; i++)
    for (int k = 0; k < columns; k++)
      if (x[i * stride + k] != 0) return 1;
  return 0;
}

/// What values have through the impulses of contacts; work [IMPULSE_ROWS*nv].
static cav_status add_impulses(cav_state *state, int dim, const double *dimpulse, double *work, double *const out[3]) {
  int nv = state->model->nv, stride = IMPULSES * state->ncontact;
  for (int i = 0; i < state->ncontact; i++) {
    int rows = state->contact[i].dim;
    const double *weight = dimpulse + IMPULSES * i;
    if (!weighs(weight, dim, stride, rows)) continue;
    double *by[3] = {work, work + IMPULSES * nv, work + 2 * IMPULSES * nv};
    cav_contact_derivative d = {.impulse_dq = by[0], .impulse_dv = by[1], .impulse_dv_next = by[2]};
    cav_status status = cav_contact_derivatives(state->model, state, i, &d);
    if (status != CAV_OK) return status;
    for (int k = 0; k < 3; k++) add_product(dim, rows, nv, weight, stride, by[k], out[k]);
  }
  return CAV_OK;
}

cav_status cav_user_differentiate(const cav_user_quantity *user, cav_state *state, double time,
                                  const double *const du[3], cav_user_room *room, double *out[3],
                                  cav_user_refusal *refusal) {
  if (!user->jacobian) return CAV_NOT_SUPPORTED;
  int nv = state->model->nv, dim = user->dim;
  size_t block = (size_t)dim * (size_t)nv, impulses = (size_t)dim * IMPULSES * (size_t)state->ncontact;
  if (!reserve(room, 4 * block + impulses + IMPULSE_ROWS * (size_t)nv)) return CAV_NO_MEMORY;
  memset(room->x, 0, (4 * block + impulses) * sizeof *room->x);
  for (int k = 0; k < 3; k++) out[k] = room->x + (size_t)k * block;
  cav_view_jacobian jacobian = {out[0], out[1], out[2], room->x + 3 * block, room->x + 4 * block};
  cav_knot_view view = view_of(state, time);
  int code = user->jacobian(user->context, &view, &jacobian);
  if (code) note(refusal, code, -1, 1);
  if (refusal->refused) return CAV_OK;
  for (int k = 0; k < 3; k++) add_product(dim, nv, nv, jacobian.du, nv, du[k], out[k]);
  cav_status status = add_impulses(state, dim, jacobian.dimpulse, jacobian.dimpulse + impulses, out);
  for (int k = 0; k < 3 && status == CAV_OK; k++) note_finite(refusal, out[k], block, (size_t)nv, 1);
  return status;
}

cav_status cav_user_refused(const cav_user_refusal *refusal) {
  return !refusal->refused ? CAV_OK : refusal->code ? CAV_INTERRUPTED : CAV_NOT_FINITE;
}

void cav_user_tell(const cav_term *term, const cav_user_refusal *refusal, int knot, double time, cav_error *error) {
  const char *name = term->name && *term->name ? term->name : term->user->name;
  char at[64] = "";
  if (knot >= 0) snprintf(at, sizeof at, " at knot %d (%.4g s)", knot, time);
  *error = (cav_error){.status = refusal->code ? CAV_BAD_INPUT : CAV_NOT_FINITE};
  if (refusal->code)
    snprintf(error->text, sizeof error->text, "term '%.80s': %s of the quantity '%.80s' returned %d%s; 0 is success",
             name, refusal->jacobian ? "jacobian" : "value", term->user->name, refusal->code, at);
  else
    snprintf(error->text, sizeof error->text,
             "term '%.80s': %s %d of the quantity '%.80s' is not finite%s: it has to be a number wherever a motion may "
             "pass",
             name, refusal->jacobian ? "a derivative of value" : "value", refusal->component, term->user->name, at);
}

// ---------------------------------------------------------------- a Jacobian against differences

typedef struct reading {
  const cav_user_quantity *user;
  double time;
  cav_user_refusal refusal;
} reading;

static void read_value(const cav_model *model, cav_state *state, void *context, double *value) {
  reading *r = context;
  (void)model;
  cav_user_read(r->user, state, r->time, value, &r->refusal);
}

/// Largest difference of n rows of two derivatives over the size of each row.
static double compare(int n, int nv, double *const is[3], const double *should, int where[3]) {
  double worst = 0, all = 0;
  size_t block = (size_t)n * (size_t)nv;
  for (size_t i = 0; i < 3 * block; i++) all = fmax(all, fabs(should[i]));
  for (int i = 0; i < n; i++) {
    double size = 1e-3 * all;
    for (int k = 0; k < 3; k++)
      for (int j = 0; j < nv; j++) size = fmax(size, fabs(should[(size_t)k * block + (size_t)(i * nv + j)]));
    for (int k = 0; k < 3; k++)
      for (int j = 0; j < nv; j++) {
        double off = fabs(is[k][i * nv + j] - should[(size_t)k * block + (size_t)(i * nv + j)]);
        off = size > 0 ? off / size : off;
        if (!(off > worst)) continue;
        worst = off;
        if (where) where[0] = i, where[1] = j, where[2] = k;
      }
  }
  return worst;
}

/// Whether values change with velocities that they are said not to read: derivatives [3*block] by q, v and v_next.
static int reads_more(const cav_user_quantity *user, const double *derivative, size_t block) {
  double all = 0, more = 0;
  for (size_t i = 0; i < 3 * block; i++) {
    int unread =
        i >= block && (user->reads == CAV_READS_POSITION || (user->reads == CAV_READS_VELOCITY && i < 2 * block));
    all = fmax(all, fabs(derivative[i]));
    if (unread) more = fmax(more, fabs(derivative[i]));
  }
  return more > 1e-6 * all;
}

/// All of the check but memory; x [(3*nv + 3*dim)*nv + nv].
static cav_status check(reading *r, cav_state *state, const double *q, const double *v, const double *v_next, double *x,
                        cav_user_room *room, double *error_relative, int where[3]) {
  const cav_model *model = state->model;
  int nv = model->nv, dim = r->user->dim;
  size_t square = (size_t)nv * (size_t)nv, block = (size_t)dim * (size_t)nv;
  double *u = x + 3 * square + 3 * block, *should = x + 3 * square, *is[3];
  const double *du[3] = {x, x + square, x + 2 * square};
  cav_status status = cav_readout_differentiate(model, state, CAV_DERIVATIVE_CENTRED, 0, q, v, v_next, read_value, r,
                                                dim, NULL, should, should + block, should + 2 * block);
  if (status == CAV_OK && !r->refusal.refused && reads_more(r->user, should, block)) return CAV_BAD_INPUT;
  if (status == CAV_OK) status = cav_inverse(model, state, q, v, v_next, u);
  if (status == CAV_OK) status = cav_derivatives(model, state, x, x + square, x + 2 * square);
  if (status == CAV_OK && !r->refusal.refused)
    status = cav_user_differentiate(r->user, state, r->time, du, room, is, &r->refusal);
  if (status == CAV_OK && !r->refusal.refused) *error_relative = compare(dim, nv, is, should, where);
  return status;
}

cav_status cav_user_quantity_check(const cav_user_quantity *user, cav_state *state, const double *q, const double *v,
                                   const double *v_next, double *error_relative, int where[3], cav_error *error) {
  cav_term term = {.quantity = CAV_QUANTITY_USER, .component = -1, .user = user};
  cav_error reason = {0};
  cav_status status = cav_user_term_check(&term, &reason);
  if (status == CAV_OK && !user->jacobian) {
    reason = (cav_error){.status = status = CAV_BAD_INPUT};
    snprintf(reason.text, sizeof reason.text, "the quantity '%.80s' has no Jacobian to check", user->name);
  }
  if (status == CAV_OK) {
    size_t nv = (size_t)state->model->nv, dim = (size_t)user->dim;
    double *x = malloc((3 * nv * nv + 3 * dim * nv + nv + 1) * sizeof *x);
    cav_user_room room = {0};
    reading r = {.user = user, .time = state->time};
    status = x ? check(&r, state, q, v, v_next, x, &room, error_relative, where) : CAV_NO_MEMORY;
    if (status == CAV_OK && r.refusal.refused) {
      cav_user_tell(&term, &r.refusal, -1, 0, &reason);
      status = reason.status;
    }
    free(x), free(room.x);
  }
  if (status == CAV_BAD_INPUT && reason.status == CAV_OK) {
    reason.status = status;
    snprintf(reason.text, sizeof reason.text,
             "the quantity '%.80s' changes with velocities that it says it does not read: set reads to a later stage, "
             "or the "
             "state's options are not valid",
             user->name);
  }
  if (status != CAV_OK && reason.status == CAV_OK) {
    const char *missing = status == CAV_NOT_SUPPORTED ? cav_derivatives_missing(state->model) : NULL;
    reason.status = status;
    snprintf(reason.text, sizeof reason.text, "the Jacobian of '%.80s' cannot be checked: %s%s%s", user->name,
             cav_status_name(status), missing ? ", the model has no derivatives of " : "", missing ? missing : "");
  }
  if (error && status != CAV_OK) *error = reason;
  return status;
}
