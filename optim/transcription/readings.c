/// Readings of one knot, and their derivatives by (q_t, v_t, v_{t+1}): analytic where the dynamics offers them. What it
/// does not offer (a force or constraint of the model, contact points that come and go, a type of sensor, a quantity
/// of one's own without Jacobian) is
/// differenced instead, only that, and counted; nothing else is mixed.
#include "readings.h"
#include "clearance.h"
#include "quantity.h"
#include "recorded.h"
#include "rotation.h"
#include "vectors.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Contacts that push less than this fraction of the weight get no rows of their own; those of the others begin at zero
/// there, or the cost would jump where one comes.
static const double contact_floor = 1e-6;

/// What is read off a state at knot t: u, four numbers a contact, the sensors and own quantities
/// of the terms that speak there.
typedef struct readings {
  const cav_transcription *tr;
  int t, ncontact;
  const int *key;
} readings;

/// What gap and velocities of a contact are weighted by: the root of its fraction f of the weight, less floor over root.
/// derivative: of that by its impulse.
static double contact_weight(const cav_transcription *tr, const cav_contact *c, double *derivative) {
  double unit = tr->options.timestep * tr->weight, f = c->impulse[0] / unit, root = sqrt(fmax(f, contact_floor));
  if (derivative) *derivative = f > contact_floor ? 0.5 * (1 + contact_floor / f) / (root * unit) : 0;
  return root - contact_floor / root;
}

/// Whether a contact with the world is so deep that it costs: its first reading is then the depth, negative.
static int is_deep(const cav_transcription *tr, const cav_contact *c) {
  return tr->depth_weight > 0 && c->dist < -CAV_DEPTH_FREE;
}

/// Whether a driven link passes over the world there, near enough for its speed to cost.
static int clears(const cav_transcription *tr, const cav_contact *c) {
  return tr->clearance > 0 && c->dist < tr->clearance && c->dim > 1 &&
         cav_pair_clears(tr->model, &tr->model->pair[c->pair]);
}

static void read_contact(const cav_transcription *tr, const cav_contact *c, double *y) {
  memset(y, 0, CAV_CONTACT_READINGS * sizeof *y);
  if (!tr->model->pair[c->pair].external) {
    y[0] = fmax(-c->dist, 0);
    if (tr->self_force) y[4] = fmax(c->impulse[0], 0) / (tr->options.timestep * tr->weight);
    return;
  }
  double fraction = contact_weight(tr, c, NULL);
  y[0] = is_deep(tr, c) ? c->dist + CAV_DEPTH_FREE : fraction * fmax(c->dist, 0);
  y[1] = c->dim > 1 ? fraction * c->velocity_next[1] : 0;
  y[2] = c->dim > 1 ? fraction * c->velocity_next[2] : 0;
  y[3] = fraction * c->velocity_next[0];
  y[4] = fmax(c->impulse[0], 0) / (tr->options.timestep * tr->weight);
  if (tr->edges) y[5] = cav_edge_nearness(tr->model, tr->edges, c, NULL) * y[4];
  if (!clears(tr, c)) return;
  const double near = cav_clearance_nearness(tr->clearance, c->dist, NULL);
  y[6] = near * c->velocity_next[1];
  y[7] = near * c->velocity_next[2];
}

static void read_knot(const cav_model *model, cav_state *state, void *context, double *value) {
  const readings *r = context;
  const cav_transcription *tr = r->tr;
  const double *end_of_values = value + model->nv + tr->knot[r->t].nread;
  memcpy(value, state->u, (size_t)model->nv * sizeof(double));
  value += model->nv;

  // contacts stand in the order of pairs and features, so both lists are walked once; one that is gone reads zero
  const cav_contact *c = state->contact, *end = c ? c + state->ncontact : NULL;
  for (int k = 0; k < r->ncontact; k++, value += CAV_CONTACT_READINGS) {
    int pair = r->key[2 * k], feature = r->key[2 * k + 1];
    while (c < end && (c->pair < pair || (c->pair == pair && c->feature < feature))) c++;
    if (c < end && c->pair == pair && c->feature == feature) {
      read_contact(tr, c, value);
    } else {
      memset(value, 0, CAV_CONTACT_READINGS * sizeof(double));
    }
  }
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    int n = cav_term_readings(tr, term, r->t);
    if (n > 0) cav_term_read(tr, state, term, r->t, value);
    value += n;
  }
  assert(value == end_of_values);
  (void)end_of_values;
}

int cav_readings_grow(double **array, size_t n) {
  double *p = realloc(*array, n * sizeof(double));
  if (p) *array = p;
  return p != NULL;
}

int cav_readings_list(cav_transcription *tr, cav_scratch *s, int t) {
  cav_knot *knot = &tr->knot[t];
  int nv = tr->nv, ncontact = 0, nsensor = 0;
  if (s->state->ncontact > s->key_room) {
    int *key = realloc(s->key, 2 * (size_t)s->state->ncontact * sizeof(int));
    if (!key) return 0;
    s->key = key;
    unsigned char *used = realloc(s->used, (size_t)s->state->ncontact);
    if (!used) return 0;
    s->used = used;
    s->key_room = s->state->ncontact;
  }
  if (!knot->moving || s->state->ncontact > knot->moving_room) {
    char *more = realloc(knot->moving, 2 * (size_t)s->state->ncontact + 1);
    if (!more) return 0;
    knot->moving = more;
    knot->moving_room = 2 * s->state->ncontact;
  }
  char *moving = knot->moving;
  if (knot->has_force) {
    for (int k = 0; k < s->state->ncontact; k++) {
      const cav_contact *c = &s->state->contact[k];
      int self = !tr->model->pair[c->pair].external;
      int idle = c->impulse[0] < contact_floor * tr->options.timestep * tr->weight && !is_deep(tr, c);
      const int clear = !self && clears(tr, c);
      if (self ? c->dist > 0 && (idle || !tr->self_force) : idle && !clear) continue;
      const int edge = !self && tr->edges && cav_edge_nearness(tr->model, tr->edges, c, NULL) > 0;
      moving[ncontact] =
          (char)(CAV_WITHIN_TREE * self | CAV_AT_EDGE * edge | CAV_CLEARS * clear | CAV_IDLE * (!self && idle));
      s->key[2 * ncontact] = c->pair;
      s->key[2 * ncontact++ + 1] = c->feature;
    }
  }
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    nsensor += cav_term_readings(tr, term, t);
  }
  knot->ncontact = ncontact;
  knot->nread = CAV_CONTACT_READINGS * ncontact + nsensor;
  size_t total = (size_t)(nv + knot->nread), n = (size_t)nv;
  if ((int)total > s->room) {
    if (!cav_readings_grow(&s->value, total) || !cav_readings_grow(&s->dq, total * n) ||
        !cav_readings_grow(&s->dv, total * n) || !cav_readings_grow(&s->dn, total * n))
      return 0;
    s->room = (int)total;
  }
  if (knot->nread > knot->room) {
    if (!cav_readings_grow(&knot->y, (size_t)knot->nread)) return 0;
    knot->room = knot->nread;
  }
  return 1;
}

void cav_readings_values(const cav_transcription *tr, cav_scratch *s, int t) {
  readings r = {tr, t, tr->knot[t].ncontact, s->key};
  read_knot(tr->model, s->state, &r, s->value);
}

// ---------------------------------------------------------------- derivatives

/// Rows of derivatives that are being filled, from some reading on.
typedef struct rows {
  double *dq, *dv, *dn;
} rows;

static rows rows_at(const cav_transcription *tr, const cav_scratch *s, int reading) {
  size_t at = (size_t)reading * tr->nv;
  return (rows){s->dq + at, s->dv + at, s->dn + at};
}

static const cav_contact *find_contact(const cav_state *state, const int key[2]) {
  for (int i = 0; i < state->ncontact; i++)
    if (state->contact[i].pair == key[0] && state->contact[i].feature == key[1]) return &state->contact[i];
  return NULL;
}

/// Derivatives of the overlap of two links of one tree.
static cav_status self_penetration_rows(const cav_transcription *tr, const cav_scratch *s, const cav_contact *c,
                                        rows out) {
  size_t n = (size_t)tr->nv;
  memset(out.dq, 0, CAV_CONTACT_READINGS * n * sizeof(double));
  memset(out.dv, 0, CAV_CONTACT_READINGS * n * sizeof(double));
  memset(out.dn, 0, CAV_CONTACT_READINGS * n * sizeof(double));
  if (c->dist >= 0) return CAV_OK;
  cav_contact_derivative d = {.dist_dq = out.dq};
  cav_status status = cav_contact_derivatives(tr->model, s->state, (int)(c - s->state->contact), &d);
  for (size_t j = 0; j < n; j++) out.dq[j] = -out.dq[j];
  return status;
}

/// out := a x + b (c y), y NULL: none.
CAV_VECTOR_BODY void blend_body(int n, double a, const double *x, double b, double c, const double *y,
                                double *restrict out) {
  if (!y)
    for (int j = 0; j < n; j++) out[j] = a * x[j];
  else
    for (int j = 0; j < n; j++) out[j] = a * x[j] + b * (c * y[j]);
}

/// What readings of a contact are made of: derivatives of its impulse, and by reading of what stands beside it, with factors.
typedef struct mixture {
  const double *impulse[3], *by_q[4], *by_next[4];
  double by_impulse[4], fraction, open;
} mixture;

/// The readings from the first to the fourth that are used, by bits, into rows over q, v and v_next, n between one and the next.
CAV_VECTOR_BODY void blend_readings_body(int n, const mixture *m, unsigned used, double *dq, double *dv, double *dn) {
  for (int k = 0; k < 4; k++, dq += n, dv += n, dn += n) {
    if (!(used >> k & 1)) continue;
    blend_body(n, m->by_impulse[k], m->impulse[0], m->fraction, k == 0 ? m->open : 1, m->by_q[k], dq);
    blend_body(n, m->by_impulse[k], m->impulse[1], 0, 0, NULL, dv);
    blend_body(n, m->by_impulse[k], m->impulse[2], m->fraction, 1, m->by_next[k], dn);
  }
}
CAV_BY_VECTORS(blend_readings, (int n, const mixture *m, unsigned used, double *dq, double *dv, double *dn),
               (n, m, used, dq, dv, dn))

/// The last reading of a contact, its force at an edge: by its force and by its place.
static void edge_rows(const cav_transcription *tr, const cav_contact *c, const cav_contact_derivative *d, double unit,
                      rows out) {
  size_t n = (size_t)tr->nv;
  double gradient[3], nearness = cav_edge_nearness(tr->model, tr->edges, c, gradient);
  double force = unit * fmax(c->impulse[0], 0);
  blend_body((int)n, nearness * unit, d->impulse_dq, 0, 0, NULL, out.dq);
  blend_body((int)n, nearness * unit, d->impulse_dv, 0, 0, NULL, out.dv);
  blend_body((int)n, nearness * unit, d->impulse_dv_next, 0, 0, NULL, out.dn);
  for (int k = 0; k < 3; k++)
    for (size_t j = 0; j < n; j++) out.dq[j] += force * gradient[k] * d->pos_dq[k * n + j];
}

/// The last readings of a contact, its speed along the world times how near it is.
static void clearance_rows(const cav_transcription *tr, const cav_contact *c, const cav_contact_derivative *d,
                           rows out) {
  int n = tr->nv;
  double by_gap, near = cav_clearance_nearness(tr->clearance, c->dist, &by_gap);
  for (int k = 1; k < 3; k++) {
    const size_t at = (size_t)(k - 1) * (size_t)n;
    blend_body(n, by_gap * c->velocity_next[k], d->dist_dq, near, 1, d->velocity_dq + k * n, out.dq + at);
    memset(out.dv + at, 0, (size_t)n * sizeof(double));
    blend_body(n, near, d->velocity_dv_next + k * n, 0, 0, NULL, out.dn + at);
  }
}

/// The readings of a contact: sqrt(f_n) times gap, slip and normal velocity; f_n; f_n at an edge; clearance. Those that are used,
/// by bits.
static cav_status contact_rows(const cav_transcription *tr, const cav_scratch *s, const cav_contact *c, unsigned used,
                               rows out) {
  size_t n = (size_t)tr->nv, nv = n;
  double *at = s->derivative;
  const unsigned clearance = used >> 6;
  used &= 63;
  if (clearance) {
    cav_contact_derivative d = {.dist_dq = at, .velocity_dq = at + n, .velocity_dv_next = at + 7 * n};
    cav_status status = cav_contact_derivatives(tr->model, s->state, (int)(c - s->state->contact), &d);
    if (status != CAV_OK) return status;
    clearance_rows(tr, c, &d, (rows){out.dq + 6 * n, out.dv + 6 * n, out.dn + 6 * n});
    if (!used) return CAV_OK;
  }
  _Static_assert(31 + 3 == CAV_DERIVATIVE_ROWS, "the last of these arrays ends where the scratch does");
  cav_contact_derivative d = {.dist_dq = at,
                              .velocity_dq = at + n,
                              .velocity_dv_next = at + 7 * n,
                              .impulse_dq = at + 13 * n,
                              .impulse_dv = at + 19 * n,
                              .impulse_dv_next = at + 25 * n,
                              .pos_dq = used >> 5 & 1 ? at + 31 * n : NULL,
                              .normal_only = 1};
  cav_status status = cav_contact_derivatives(tr->model, s->state, (int)(c - s->state->contact), &d);
  if (status != CAV_OK) return status;
  double derivative, fraction = contact_weight(tr, c, &derivative);
  int slip = c->dim > 1;
  const double value[4] = {fmax(c->dist, 0), slip ? c->velocity_next[1] : 0, slip ? c->velocity_next[2] : 0,
                           c->velocity_next[0]};
  mixture m = {
      .impulse = {d.impulse_dq, d.impulse_dv, d.impulse_dv_next},
      .by_q = {d.dist_dq, slip ? d.velocity_dq + nv : NULL, slip ? d.velocity_dq + 2 * nv : NULL, d.velocity_dq},
      .by_next = {NULL, slip ? d.velocity_dv_next + nv : NULL, slip ? d.velocity_dv_next + 2 * nv : NULL,
                  d.velocity_dv_next},
      .fraction = fraction,
      .open = c->dist > 0};
  for (int k = 0; k < 4; k++) m.by_impulse[k] = derivative * value[k];
  blend_readings((int)n, &m, used, out.dq, out.dv, out.dn);
  if (is_deep(tr, c)) {
    memcpy(out.dq, d.dist_dq, n * sizeof(double));
    memset(out.dv, 0, n * sizeof(double));
    memset(out.dn, 0, n * sizeof(double));
  }
  if (!(used >> 4)) return CAV_OK;
  double unit = c->impulse[0] > 0 ? 1 / (tr->options.timestep * tr->weight) : 0;
  if (used >> 5 & 1) edge_rows(tr, c, &d, unit, (rows){out.dq + 5 * n, out.dv + 5 * n, out.dn + 5 * n});
  if (!(used >> 4 & 1)) return CAV_OK;
  blend_body((int)n, unit, d.impulse_dq, 0, 0, NULL, out.dq + 4 * n);
  blend_body((int)n, unit, d.impulse_dv, 0, 0, NULL, out.dv + 4 * n);
  blend_body((int)n, unit, d.impulse_dv_next, 0, 0, NULL, out.dn + 4 * n);
  return CAV_OK;
}

/// Derivatives of the overlap of two links of one tree, and of the force between them where a term asks for it.
static cav_status self_rows(const cav_transcription *tr, const cav_scratch *s, const cav_contact *c, rows out) {
  if (!tr->self_force) return self_penetration_rows(tr, s, c, out);
  size_t n = (size_t)tr->nv;
  cav_status status = contact_rows(tr, s, c, 1 << 4, out);
  memset(out.dq, 0, 4 * n * sizeof(double));
  memset(out.dv, 0, 4 * n * sizeof(double));
  memset(out.dn, 0, 4 * n * sizeof(double));
  // contact_rows leaves the distance's derivative first in the scratch
  for (size_t j = 0; j < n && c->dist < 0; j++) out.dq[j] = -s->derivative[j];
  return status;
}

void cav_rotation_rows(int nv, const double target[4], const double quat[4], const double *d_quat, double *out) {
  double phi[3], J[9];
  cav_rotation_between(target, quat, phi);
  cav_rotation_jacobian_inverse(phi, J);
  for (int j = 0; j < nv; j++) {
    // rotation in the frame's own axes: twice the vector part of conj(quat) times the change
    double w = d_quat[j], x = d_quat[nv + j], y = d_quat[2 * nv + j], z = d_quat[3 * nv + j];
    double rotation[3] = {2 * (quat[0] * x - quat[1] * w - quat[2] * z + quat[3] * y),
                          2 * (quat[0] * y + quat[1] * z - quat[2] * w - quat[3] * x),
                          2 * (quat[0] * z - quat[1] * y + quat[2] * x - quat[3] * w)};
    for (int k = 0; k < 3; k++)
      out[k * nv + j] = J[3 * k] * rotation[0] + J[3 * k + 1] * rotation[1] + J[3 * k + 2] * rotation[2];
  }
}

static cav_status sensor_rows(const cav_transcription *tr, const cav_scratch *s, const cav_term *term, int t,
                              rows out) {
  const cav_sensor *sensor = &term->sensor;
  int nv = tr->nv, dim = sensor->dim;
  _Static_assert(2 * CAV_SENSOR_DIM_MAX + 3 <= CAV_DERIVATIVE_ROWS, "both derivatives of a sensor and of its turn fit");
  assert(dim <= CAV_SENSOR_DIM_MAX);
  double *dq = s->derivative, *dn = dq + (size_t)dim * nv, *rotation = dn + (size_t)dim * nv;
  cav_status status = cav_sensor_derivatives(tr->model, s->state, sensor, dq, dn);
  if (status != CAV_OK) return status;
  if (dim == 4) {
    double target[CAV_SENSOR_DIM_MAX], reading[CAV_SENSOR_DIM_MAX];
    cav_term_target(term, cav_knot_time(tr, t), 4, target);
    if (!term->target) target[0] = 1;
    cav_sensor_read(tr->model, s->state, sensor, reading);
    // a quaternion depends on q alone
    cav_rotation_rows(nv, target, reading, dq, rotation);
    dq = rotation;
  }
  int first = term->component < 0 ? 0 : term->component, n = cav_term_dim(term) * nv;
  for (int i = 0; i < n; i++) {
    out.dq[i] = dq[first * nv + i] / term->scale;
    out.dv[i] = 0;
    out.dn[i] = dn[first * nv + i] / term->scale;
  }
  return CAV_OK;
}

/// Of a touch sensor.
static cav_status touch_rows(const cav_transcription *tr, const cav_scratch *s, const cav_term *term, rows out) {
  cav_status status = cav_touch_derivatives(tr->model, s->state, &term->sensor, out.dq, out.dv, out.dn);
  for (int j = 0; j < tr->nv && status == CAV_OK; j++)
    out.dq[j] /= term->scale, out.dv[j] /= term->scale, out.dn[j] /= term->scale;
  return status;
}

/// Of a quantity of one's own, from its Jacobian and the derivatives of u, which stand first.
static cav_status user_rows(const cav_transcription *tr, cav_scratch *s, const cav_term *term, int t, rows out) {
  double *by[3], *to[3] = {out.dq, out.dv, out.dn};
  const double *du[3] = {s->dq, s->dv, s->dn};
  cav_user_refusal *refusal = &tr->knot[t].refusal;
  int before = refusal->refused, nv = tr->nv, first = term->component < 0 ? 0 : term->component;
  cav_status status = cav_user_differentiate(term->user, s->state, cav_knot_time(tr, t), du, &s->user, by, refusal);
  if (refusal->refused && !before) tr->knot[t].refused_term = (int)(term - tr->problem->term);
  if (status != CAV_OK) return status;
  // of what it says it reads, which is what rows are laid for
  int read[3] = {1, term->user->reads == CAV_READS_ACCELERATION, term->user->reads != CAV_READS_POSITION};
  for (int k = 0; k < 3; k++)
    for (int i = 0; i < cav_term_dim(term) * nv; i++) to[k][i] = read[k] ? by[k][first * nv + i] / term->scale : 0;
  return CAV_OK;
}

static cav_status term_rows(const cav_transcription *tr, cav_scratch *s, const cav_term *term, int t, rows out) {
  if (term->quantity == CAV_QUANTITY_TRACK) {
    memset(out.dv, 0, (size_t)(cav_term_dim(term) * tr->nv) * sizeof(double));
    return cav_recorded_derivatives(tr, s, term, t, out.dq, out.dn);
  }
  if (term->quantity == CAV_QUANTITY_USER) return user_rows(tr, s, term, t, out);
  return term->sensor.type == CAV_SENSOR_TOUCH ? touch_rows(tr, s, term, out) : sensor_rows(tr, s, term, t, out);
}

/// Readings of one term alone, for differences.
typedef struct single_term {
  const cav_transcription *tr;
  const cav_term *term;
  int t;
} single_term;

static void read_term(const cav_model *model, cav_state *state, void *context, double *value) {
  const single_term *r = context;
  (void)model;
  cav_term_read(r->tr, state, r->term, r->t, value);
}

/// Sensors and quantities of one's own: those with derivatives first, as differences move the state.
static cav_status terms(const cav_transcription *tr, cav_scratch *s, int t, const double *q, const double *v,
                        const double *v_next) {
  int missing = 0, first = tr->nv + CAV_CONTACT_READINGS * tr->knot[t].ncontact;
  for (int pass = 0; pass < 1 + (missing > 0); pass++) {
    for (int i = 0, at = first; i < tr->problem->nterm; i++) {
      const cav_term *term = &tr->problem->term[i];
      int n = cav_term_readings(tr, term, t);
      if (n == 0) continue;
      rows out = rows_at(tr, s, at);
      at += n;
      assert(at <= tr->nv + tr->knot[t].nread);
      cav_status status = CAV_OK;
      if (pass == 0) {
        status = term_rows(tr, s, term, t, out);
        s->missing[i] = status == CAV_NOT_SUPPORTED;
        missing += s->missing[i];
        if (s->missing[i]) status = CAV_OK;
      } else if (s->missing[i]) {
        // what it does not look at needs no evaluations
        cav_sensor_stage stage = cav_term_stage(term);
        single_term single = {tr, term, t};
        memset(out.dv, 0, (size_t)(n * tr->nv) * sizeof(double));
        memset(out.dn, 0, (size_t)(n * tr->nv) * sizeof(double));
        status = cav_readout_differentiate(tr->model, s->state, tr->difference, 0, q, v, v_next, read_term, &single, n,
                                           NULL, out.dq, stage == CAV_READS_ACCELERATION ? out.dv : NULL,
                                           stage == CAV_READS_POSITION ? NULL : out.dn);
        s->differenced++;
      }
      if (status != CAV_OK) return status;
    }
  }
  return CAV_OK;
}

/// All by differences.
static cav_status difference(const cav_transcription *tr, cav_scratch *s, int t, const double *q, const double *v,
                             const double *v_next) {
  readings r = {tr, t, tr->knot[t].ncontact, s->key};
  s->differenced++;
  return cav_readout_differentiate(tr->model, s->state, tr->difference, 0, q, v, v_next, read_knot, &r,
                                   tr->nv + tr->knot[t].nread, NULL, s->dq, s->dv, s->dn);
}

cav_status cav_readings_derivatives(const cav_transcription *tr, cav_scratch *s, int t, const double *q,
                                    const double *v, const double *v_next) {
  if (tr->derivative != CAV_DERIVATIVE_ANALYTIC) return difference(tr, s, t, q, v, v_next);
  cav_status status = cav_derivatives(tr->model, s->state, s->dq, s->dv, s->dn);
  if (status == CAV_NOT_SUPPORTED) return difference(tr, s, t, q, v, v_next);
  for (int k = 0; k < tr->knot[t].ncontact && status == CAV_OK; k++) {
    const cav_contact *c = find_contact(s->state, s->key + 2 * k);
    rows out = rows_at(tr, s, tr->nv + CAV_CONTACT_READINGS * k);
    if (!c) return CAV_INTERNAL;
    if (s->used[k])
      status =
          tr->knot[t].moving[k] & CAV_WITHIN_TREE ? self_rows(tr, s, c, out) : contact_rows(tr, s, c, s->used[k], out);
  }
  if (status == CAV_NOT_SUPPORTED) return difference(tr, s, t, q, v, v_next);
  return status == CAV_OK ? terms(tr, s, t, q, v, v_next) : status;
}

/// g += weighted rows of n readings from the first on, which are in place.
static void fold(const cav_transcription *tr, const cav_scratch *s, int first, int n, const double *weight, double *g) {
  int nv = tr->nv;
  for (int i = first; i < first + n; i++) {
    if (weight[i] == 0) continue;
    rows row = rows_at(tr, s, i);
    for (int j = 0; j < nv; j++) {
      g[j] += weight[i] * row.dq[j];
      g[nv + j] += weight[i] * row.dv[j];
      g[2 * nv + j] += weight[i] * row.dn[j];
    }
  }
}

/// Which of n numbers are not zero, by bits.
static unsigned weighs(const double *weight, int n) {
  unsigned bits = 0;
  for (int i = 0; i < n; i++) bits |= (unsigned)(weight[i] != 0) << (i < 31 ? i : 31);
  return bits;
}

cav_status cav_readings_adjoint(const cav_transcription *tr, cav_scratch *s, int t, const double *weight, double *g) {
  const cav_knot *knot = &tr->knot[t];
  int nv = tr->nv, at = nv;
  memset(g, 0, 3 * (size_t)nv * sizeof *g);
  cav_status status = cav_derivatives(tr->model, s->state, s->dq, s->dv, s->dn);
  if (status != CAV_OK) return status;
  fold(tr, s, 0, nv, weight, g);
  for (int k = 0; k < knot->ncontact; k++, at += CAV_CONTACT_READINGS) {
    const unsigned used = weighs(weight + at, CAV_CONTACT_READINGS);
    const cav_contact *c = used ? find_contact(s->state, s->key + 2 * k) : NULL;
    if (!c) continue;
    rows out = rows_at(tr, s, at);
    status = knot->moving[k] & CAV_WITHIN_TREE ? self_rows(tr, s, c, out) : contact_rows(tr, s, c, used, out);
    if (status != CAV_OK) return status;
    fold(tr, s, at, CAV_CONTACT_READINGS, weight, g);
  }
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    int dim = cav_term_readings(tr, term, t);
    if (weighs(weight + at, dim)) {
      status = term_rows(tr, s, term, t, rows_at(tr, s, at));
      if (status == CAV_OK) fold(tr, s, at, dim, weight, g);
      if (status != CAV_OK && status != CAV_NOT_SUPPORTED) return status;
    }
    at += dim;
  }
  return CAV_OK;
}
