/// Second derivatives of the Lagrangian that Gauss-Newton leaves out, knot by knot. What is nonlinear at a knot are its
/// readings y(q, v, v'): forces, contacts, sensors. With the pull p = dL/dy held, the curvature is the derivative of
/// the adjoint product (dy/dz)' p by z = (q, v, v'), taken by differences of analytic derivatives along groups of dofs
/// that do not meet in it (dof_groups.c), made symmetric and chained to the three neighbouring knots. Rates bend where
/// they are rotations', with both ends of their step: by the pull of all rows on them, costs and constraints of rates
/// included. Left out are rotation vectors to a posture, and the products of cost terms over power.
#include "lagrangian.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dof_groups.h"
#include "knot.h"
#include "quantity.h"
#include "rotation.h"

/// Differences: of configurations, rad or m; of velocities that times the step.
static const double shift = 3e-7;

/// Differences of a rotation's Jacobian, rad.
static const double rotation_shift = 1e-5;

typedef struct curve {
  cav_transcription *tr;
  const cav_trajectory *at;
  double factor;      ///< of the costs
  const char *chosen; ///< [nknot] whether a knot's is asked for; NULL: all are
  cav_status *status; ///< [nknot]
  double *room;       ///< [members * room_of]
  cav_dof_groups *of; ///< [members]
} curve;

static size_t room_of(const cav_transcription *tr) {
  size_t nv = (size_t)tr->nv;
  return 18 * nv * nv + 9 * nv + (size_t)tr->model->nq;
}

/// Derivative of a cost of weight times norm of a reading by the reading.
static double derivative_of(const cav_term *term, double weight, double reading, double unit) {
  double x = reading / unit;
  return weight * (term->norm == CAV_NORM_ABSOLUTE ? x / sqrt(1 + x * x) : x) / unit;
}

static void pull_force(const cav_force_row *form, double derivative, double *pull) {
  for (int k = 0; k < form->n; k++) pull[form->dof[k]] += derivative * form->coef[k];
}

/// What costs of a knot pull its readings by.
static void pull_costs(const cav_transcription *tr, const int *key, int t, double factor, double *pull) {
  const cav_knot *knot = &tr->knot[t];
  int sensor = CAV_CONTACT_READINGS * knot->ncontact;
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    double weight = factor * term->weight * cav_term_weight(tr, term, t);
    if (cav_term_weight(tr, term, t) == 0) continue;
    int dim = cav_term_dim(term);
    for (int k = 0; k < dim && term->use == CAV_USE_COST; k++)
      pull[tr->nv + sensor + k] += derivative_of(term, weight, knot->y[sensor + k], 1);
    for (int k = 0; k < tr->model->nu && term->quantity == CAV_QUANTITY_EFFORT && knot->has_force; k++)
      pull_force(&tr->effort[k], derivative_of(term, weight, cav_force_value(&tr->effort[k], knot->u), term->scale),
                 pull);
    for (int k = 0; k < knot->ncontact && term->use == CAV_USE_COST; k++) {
      int first, n = cav_knot_contact(tr, key, term, t, k, &first), at = CAV_CONTACT_READINGS * k + first;
      if (term->quantity == CAV_QUANTITY_GAP && knot->y[at] < 0) continue;
      for (int r = at; r < at + n; r++) pull[tr->nv + r] += derivative_of(term, weight, knot->y[r], term->scale);
    }
    sensor += dim;
  }
  double depth = factor * tr->depth_weight * tr->options.timestep;
  for (int k = 0; k < knot->ncontact && depth > 0; k++) {
    int r = CAV_CONTACT_READINGS * k;
    if (!(knot->moving[k] & (CAV_WITHIN_TREE | CAV_IDLE))) pull[tr->nv + r] += depth * fmin(knot->y[r], 0);
  }
  for (int k = 0; k < tr->npenalised && knot->has_force; k++)
    pull_force(&tr->penalised[k], factor * tr->options.timestep * cav_force_value(&tr->penalised[k], knot->u), pull);
}

/// What multipliers of a knot's rows pull its readings by.
static void pull_rows(const cav_transcription *tr, int t, double *pull) {
  const cav_knot *knot = &tr->knot[t];
  const cav_slot_layout *at = &knot->layout;
  int i = at->term, sensor = CAV_CONTACT_READINGS * knot->ncontact;
  for (int k = 0; k < at->effort; k++) pull_force(&tr->unactuated[k], knot->slot[k].final_multiplier, pull);
  for (int k = at->effort; k < at->joint; k++)
    pull_force(&tr->effort[k - at->effort], knot->slot[k].final_multiplier, pull);
  for (int j = 0; j < tr->problem->nterm; j++) {
    const cav_term *term = &tr->problem->term[j];
    if (cav_term_weight(tr, term, t) == 0) continue;
    int dim = cav_term_dim(term);
    if (term->use != CAV_USE_COST) {
      for (int d = 0; !cav_term_is_reading(term) && d < tr->nv; d++) i += cav_dof_selected(tr, term, d);
      for (int k = 0; k < dim; k++) pull[tr->nv + sensor + k] += knot->slot[i++].final_multiplier;
    }
    sensor += dim;
  }
}

/// Adds what a term over rates pulls v_t and v_{t+1} by, out [2nv]; multiplier: of its rows, where it is a hard one.
static void pull_rates(const curve *c, cav_scratch *s, const cav_term *term, int t, const cav_slot *slot, double *out) {
  const cav_transcription *tr = c->tr;
  int nv = tr->nv, rate = term->quantity == CAV_QUANTITY_ACCELERATION;
  const double *v = cav_velocity_at(tr, c->at, t), *v_next = cav_velocity_after(tr, c->at, t);
  double h = tr->options.timestep, weight = c->factor * term->weight * cav_term_weight(tr, term, t);
  if (!rate && term->quantity != CAV_QUANTITY_VELOCITY) return;
  cav_term_target(term, tr->knot[t].time, nv, s->tangent);
  for (int d = 0; d < nv; d++) {
    if (!cav_dof_selected(tr, term, d)) continue;
    double r = ((rate ? (v_next[d] - v[d]) / h : v[d]) - s->tangent[d]) / term->scale;
    double pull = term->use == CAV_USE_COST ? derivative_of(term, weight, r, 1) : (slot++)->final_multiplier;
    pull /= rate ? term->scale * h : term->scale;
    out[d] += rate ? -pull : pull;
    if (rate) out[nv + d] += pull;
  }
}

/// The same of all terms of a knot.
static void pull_all_rates(const curve *c, cav_scratch *s, int t, double *out) {
  const cav_transcription *tr = c->tr;
  const cav_slot *slot = tr->knot[t].slot + tr->knot[t].layout.term;
  for (int j = 0; j < tr->problem->nterm; j++) {
    const cav_term *term = &tr->problem->term[j];
    if (cav_term_weight(tr, term, t) == 0) continue;
    if (term->use != CAV_USE_COST || tr->knot[t].has_force || term->quantity != CAV_QUANTITY_ACCELERATION)
      pull_rates(c, s, term, t, slot, out);
    if (term->use == CAV_USE_COST) continue;
    for (int d = 0; !cav_term_is_reading(term) && d < tr->nv; d++) slot += cav_dof_selected(tr, term, d);
    slot += cav_term_readings(tr, term, t);
  }
}

/// Derivative by phi of row' J, J = Jr^-1 or its transpose Jl^-1: out[c][k] = sum over r of row[r] dJ[r][c]/dphi[k].
static void bend_rotation(const double phi[3], const double row[3], int start, double out[3][3]) {
  for (int k = 0; k < 3; k++) {
    double J[2][9];
    for (int side = 0; side < 2; side++) {
      double beside[3] = {phi[0], phi[1], phi[2]};
      beside[k] += side ? rotation_shift : -rotation_shift;
      cav_rotation_jacobian_inverse(beside, J[side]);
    }
    for (int c = 0; c < 3; c++) {
      out[c][k] = 0;
      for (int r = 0; r < 3; r++) {
        int at = start ? 3 * c + r : 3 * r + c;
        out[c][k] += row[r] * (J[1][at] - J[0][at]) / (2 * rotation_shift);
      }
    }
  }
}

/// Adds to H [3nv*3nv], over the three knots, the curvature of a step's rotation that is pulled by row [nv]: column
/// blocks from and to of its ends, -1: held. rotation: of the step (CAV_ROTATION_SIZE a joint).
static void curve_rotations(const cav_transcription *tr, const double *rotation, const double *row, int from, int to,
                            double *H) {
  int nv = tr->nv, width = 3 * nv, end[2] = {to, from};
  double h = tr->options.timestep;
  for (int k = 0; k < tr->nrotation; k++) {
    const double *J = rotation + CAV_ROTATION_SIZE * k;
    int dof = tr->rotation_dof[k];
    for (int a = 0; a < 2; a++) {
      double bent[3][3];
      if (end[a] < 0) continue;
      bend_rotation(J + 18, row + dof, a, bent);
      for (int b = 0; b < 2; b++) {
        if (end[b] < 0) continue;
        // gradient by an end: (a ? -Jl^-1 : Jr^-1)' row / h; the rotation moves by b ? -Jl^-1 : Jr^-1. Half to each
        // triangle makes it symmetric
        for (int i = 0; i < 9; i++) {
          double sum = 0, sign = a == b ? 1 : -1;
          for (int m = 0; m < 3; m++) sum += bent[i / 3][m] * J[9 * b + 3 * m + i % 3];
          int r = end[a] * nv + dof + i / 3, column = end[b] * nv + dof + i % 3;
          H[(size_t)r * (size_t)width + (size_t)column] += 0.5 * sign * sum / h;
          H[(size_t)column * (size_t)width + (size_t)r] += 0.5 * sign * sum / h;
        }
      }
    }
  }
}

/// The adjoint product at z moved by a distance along the coordinates of a kind (q_t, v_t, v_{t+1}) that are in a group of dofs.
static cav_status adjoint_beside(const curve *c, cav_scratch *s, int t, const cav_dof_groups *of, int kind, int group,
                                 double distance, const double *pull, double *moved, double *g) {
  const cav_transcription *tr = c->tr;
  int nv = tr->nv;
  double *q = moved + 3 * nv, *step = moved, *v = moved + nv, *v_next = moved + 2 * nv;
  memset(step, 0, (size_t)nv * sizeof *step);
  memcpy(v, cav_velocity_at(tr, c->at, t), (size_t)nv * sizeof *v);
  memcpy(v_next, cav_velocity_after(tr, c->at, t), (size_t)nv * sizeof *v);
  for (int d = 0; d < nv; d++)
    if (of->group[d] == group) (kind == 0 ? step : kind == 1 ? v : v_next)[d] += distance;
  const double *here = c->at->q + (size_t)t * c->at->nq;
  if (kind == 0) cav_integrate(tr->model, here, step, 1, q);
  cav_stage same = kind == 0 ? CAV_STAGE_NONE : CAV_STAGE_POSITION;
  cav_status status = cav_inverse_from(tr->model, s->state, same, kind == 0 ? q : here, v, v_next, s->value);
  return status == CAV_OK ? cav_readings_adjoint(tr, s, t, pull, g) : status;
}

/// Whether coordinate kind (q_t, v_t, v_{t+1}) of a knot moves with an unknown.
static int kind_moves(const cav_transcription *tr, int t, int kind) {
  int closed = t == tr->nknot - 1 && !tr->periodicity;
  return kind == 2 ? !closed || !tr->problem->close_at_rest : cav_knot_moves(tr, t);
}

/// Adds the curvature of the rates about a knot, that readings pull by pull [2nv], which is added to.
static void curve_rates(const curve *c, cav_scratch *s, int t, double *pull, double *H) {
  const cav_transcription *tr = c->tr;
  int here = cav_knot_moves(tr, t), closed = t == tr->nknot - 1 && !tr->periodicity;
  pull_all_rates(c, s, t, pull);
  if (here) curve_rotations(tr, tr->knot[t].rotation, pull, cav_knot_moves(tr, t - 1) ? 0 : -1, 1, H);
  if (!closed)
    curve_rotations(tr, t + 1 < tr->nknot ? tr->knot[t + 1].rotation : tr->rotation_after, pull + tr->nv, here ? 1 : -1,
                    2, H);
}

/// Columns of sum [3nv*3nv], of kind * nv + group: differences of the adjoint product, which is base [3nv] here.
static cav_status find_sums(const curve *c, cav_scratch *s, int t, const cav_dof_groups *of, const double *pull,
                            const double *base, double *moved, double *sum) {
  const cav_transcription *tr = c->tr;
  int nv = tr->nv, width = 3 * nv;
  cav_status status = CAV_OK;
  memset(sum, 0, (size_t)width * (size_t)width * sizeof *sum);
  // velocities first, while the state's positions stand
  for (int k = 1; k <= 3 && status == CAV_OK; k++) {
    int kind = k % 3;
    if (!kind_moves(tr, t, kind)) continue;
    for (int group = 0; group < of->ngroup && status == CAV_OK; group++) {
      double distance = kind == 0 ? shift : shift / tr->options.timestep;
      double *out = sum + (size_t)(kind * nv + group) * (size_t)width;
      status = adjoint_beside(c, s, t, of, kind, group, distance, pull, moved, out);
      // contact points of a pair may come and go on one side
      if (status == CAV_NOT_SUPPORTED) {
        distance = -distance;
        status = adjoint_beside(c, s, t, of, kind, group, distance, pull, moved, out);
      }
      for (int i = 0; i < width; i++) out[i] = (out[i] - base[i]) / distance;
    }
  }
  return status;
}

/// The symmetric matrix K [3nv*3nv] of the sums: each entry from where it stands alone, the mean where it does twice.
static void read_sums(const cav_dof_groups *of, const double *sum, double *K) {
  int nv = of->nv, width = 3 * nv;
  memset(K, 0, (size_t)width * (size_t)width * sizeof *K);
  for (int r = 0; r < nv; r++) {
    for (int c = 0; c < nv; c++) {
      int here = cav_dof_groups_alone(of, r, c), there = cav_dof_groups_alone(of, c, r);
      if (!here && !there) continue;
      for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
          double one = sum[(b * nv + of->group[c]) * width + a * nv + r];
          double other = sum[(a * nv + of->group[r]) * width + b * nv + c];
          K[(a * nv + r) * width + b * nv + c] = here && there ? 0.5 * (one + other) : here ? one : other;
        }
      }
    }
  }
}

static cav_status curve_knot(const curve *c, cav_scratch *s, int t, double *room, cav_dof_groups *of) {
  cav_transcription *tr = c->tr;
  cav_knot *knot = &tr->knot[t];
  size_t nv = (size_t)tr->nv, width = 3 * nv;
  double *K = room, *half = K + width * width, *base = half + width * width, *moved = base + width;
  const double *q = c->at->q + (size_t)t * c->at->nq;
  s->state->options = cav_knot_law(tr, t);
  cav_status status =
      cav_inverse(tr->model, s->state, q, cav_velocity_at(tr, c->at, t), cav_velocity_after(tr, c->at, t), knot->u);
  if (status != CAV_OK) return status;
  if (!cav_readings_list(tr, s, t)) return CAV_NO_MEMORY;
  double *pull = calloc(nv + (size_t)knot->nread, sizeof *pull);
  if (!pull) return CAV_NO_MEMORY;
  pull_costs(tr, s->key, t, c->factor, pull);
  pull_rows(tr, t, pull);
  knot->refusal = (cav_user_refusal){0};
  cav_dof_groups_find(of, tr, s->state, t, pull);
  status = cav_readings_adjoint(tr, s, t, pull, base);
  if (status == CAV_OK) status = find_sums(c, s, t, of, pull, base, moved, half);
  free(pull);
  if (status == CAV_OK) status = cav_user_refused(&knot->refusal);
  if (status == CAV_NOT_SUPPORTED) return CAV_OK;
  if (status != CAV_OK) return status;
  // T' K T
  read_sums(of, half, K);
  cav_transcription_chain(tr, t, (int)width, K, half);
  for (size_t i = 0; i < width; i++)
    for (size_t j = 0; j < width; j++) K[i * width + j] = half[j * width + i];
  cav_transcription_chain(tr, t, (int)width, K, half);
  curve_rates(c, s, t, base + nv, half);
  if (tr->periodicity && (t < 2 || t == tr->nknot - 1)) {
    cav_transcription_wrap(tr, s, t, (int)width, half);
    for (size_t i = 0; i < width; i++)
      for (size_t j = 0; j < width; j++) K[i * width + j] = half[j * width + i];
    cav_transcription_wrap(tr, s, t, (int)width, K);
    memcpy(half, K, width * width * sizeof *K);
  }
  for (size_t i = 0; i < width; i++)
    for (size_t j = 0; j <= i; j++) knot->hessian[i * width + j] += half[i * width + j];
  return CAV_OK;
}

static void curve_item(void *context, int t, int member) {
  const curve *c = context;
  if (c->chosen && !c->chosen[t]) return;
  c->status[t] = curve_knot(c, &c->tr->scratch[member], t, c->room + (size_t)member * room_of(c->tr), &c->of[member]);
}

cav_status cav_lagrangian_curvature(cav_transcription *tr, const cav_trajectory *at, double factor,
                                    const char *chosen) {
  int members = cav_parallel_size(tr->pool), whole = 1;
  curve c = {tr, at, factor, chosen, calloc((size_t)tr->nknot, sizeof(cav_status)), NULL, NULL};
  c.room = malloc((size_t)members * room_of(tr) * sizeof(double));
  c.of = calloc((size_t)members, sizeof *c.of);
  for (int i = 0; c.of && i < members; i++) whole &= cav_dof_groups_make(&c.of[i], tr->nv);
  cav_status status = c.status && c.room && c.of && whole ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) cav_parallel_for(tr->pool, tr->nknot, curve_item, &c);
  if (status == CAV_OK) status = cav_transcription_conclude(tr, c.status);
  for (int i = 0; c.of && i < members; i++) cav_dof_groups_clear(&c.of[i]);
  free(c.status), free(c.room), free(c.of);
  return status;
}
