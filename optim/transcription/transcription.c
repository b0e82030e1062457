/// Rows of a problem over its knots and their Gauss-Newton normal equations. Every knot t sees q_{t-1}, q_t, q_{t+1}
/// through v_t, v_{t+1} and the inverse dynamics u_t (METHOD.md, 1), so its part of the Hessian is one dense block of
/// three neighbours and knots are evaluated in any order, by any number of threads, with the same result.
///
/// Derivatives of u, contacts and sensors come from readings.c; those of v, accelerations, postures and ranges are
/// exact. Constraint rows enter the merit by an augmented Lagrangian of two-sided rows: with z~ = z + multiplier/rho
/// and e = z~ - clamp(z~), the row costs rho/2 e^2 and its next multiplier is rho e (Powell, Hestenes, Rockafellar).
#include "clearance.h"
#include "clock.h"
#include "knot.h"
#include "math3.h"
#include "rotation.h"

#include <assert.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- construction

static int joint_is_rotation(cav_joint_type type) { return type == CAV_JOINT_FREE || type == CAV_JOINT_BALL; }

static int list_rotations(cav_transcription *tr) {
  const cav_model *m = tr->model;
  tr->rotation_of = malloc((size_t)m->nv * sizeof(int));
  tr->rotation_dof = malloc((size_t)(m->njoint + 1) * sizeof(int));
  if (!tr->rotation_of || !tr->rotation_dof) return 0;
  for (int d = 0; d < m->nv; d++) tr->rotation_of[d] = -1;
  for (int j = 0; j < m->njoint; j++) {
    if (!joint_is_rotation(m->joint[j].type)) continue;
    int dof = m->joint[j].dof + (m->joint[j].type == CAV_JOINT_FREE ? 3 : 0);
    for (int k = 0; k < 3; k++) tr->rotation_of[dof + k] = tr->nrotation;
    tr->rotation_dof[tr->nrotation++] = dof;
  }
  return 1;
}

static int dof_is_linear(const cav_model *m, int d) {
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  return joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && d < joint->dof + 3);
}

static int force_row_set(cav_force_row *row, int nv, const double *dense, double scale) {
  int n = 0;
  double largest = 0;
  for (int d = 0; d < nv; d++) largest = fmax(largest, fabs(dense[d]));
  for (int d = 0; d < nv; d++) n += fabs(dense[d]) > 1e-12 * largest;
  row->dof = malloc((size_t)(n + 1) * sizeof(int));
  row->coef = malloc((size_t)(n + 1) * sizeof(double));
  if (!row->dof || !row->coef) return 0;
  for (int d = 0; d < nv; d++) {
    if (fabs(dense[d]) <= 1e-12 * largest) continue;
    row->dof[row->n] = d;
    row->coef[row->n++] = dense[d] * scale;
  }
  return 1;
}

/// Row k of effort from the dense form of its actuator's [nv], with its range. What is left to feedback is left of the
/// force where that is limited, beside which a servo's control goes to its ends; else of the control, at both ends.
static int limit_row_set(cav_transcription *tr, int k, const double *effort) {
  const cav_model *m = tr->model;
  int a = tr->limited[k], servo = cav_servo_bounds(m, a) && (k >= m->nu || !m->actuator[a].forcelimited);
  double range[2], per_effort = 1, part = cav_planned_part(tr->problem);
  cav_actuator_effort_range(m, a, range);
  if (servo && !cav_servo_set(m, a, &tr->servo[k], &per_effort, range)) return 0;
  if (servo && m->actuator[a].forcelimited) part = 1;
  double lower = range[0], upper = range[1], middle = servo ? (lower + upper) / 2 : 0;
  double limit = fmax(isfinite(lower) ? fabs(lower) : 0, isfinite(upper) ? fabs(upper) : 0);
  double scale = limit > 0 ? 1 / limit : 1;
  tr->effort_range[k][0] = scale * (middle + (lower - middle) * part);
  tr->effort_range[k][1] = scale * (middle + (upper - middle) * part);
  tr->effort_unit[k] = m->actuator[a].unit / (per_effort * scale);
  return force_row_set(&tr->effort[k], m->nv, effort, per_effort * scale);
}

/// rad/s^2: what turns on a hinge that no actuator moves takes the torque of such an acceleration for one.
static const double BRISK = 2;

/// Fraction of the scene's mass below which a body is light.
static const double LIGHT = 1. / 16;

/// Deviation that a force on a dof is penalised by, 0: it has to be zero. direction [nv]: a form of what actuators cannot give,
/// which is that dof alone where it is one.
static double deviation_of(const cav_transcription *tr, int d, const double *direction) {
  const cav_model *m = tr->model;
  const cav_residual *residual = &tr->problem->residual;
  if (m->link[m->dof[d].link].parent != 0 || fabs(direction[d]) < 1 - 1e-9) return 0;
  return dof_is_linear(m, d) ? residual->force : residual->torque;
}

double cav_force_fraction(const cav_model *m, int dof) {
  int link = m->dof[dof].link;
  double mass = 0;
  if (m->link[link].driven) return 1;
  if (m->joint[m->dof[dof].joint].type == CAV_JOINT_HINGE && m->dof[dof].inverse_weight > 0) {
    const double pull = norm3(m->gravity), weight = m->mass * (pull > 0 ? pull : 1);
    return fmin(BRISK / m->dof[dof].inverse_weight / (weight * CAV_MOMENT_ARM), 1);
  }
  for (int l = 1; l < m->nlink; l++)
    if (m->link[l].root == m->link[link].root) mass += m->link[l].mass;
  return mass > 0 && mass < LIGHT * m->mass ? mass / m->mass : 1;
}

/// Linear forms of u: an orthonormal basis of what actuators cannot give, and the least-norm actuator efforts.
static int list_force_rows(cav_transcription *tr) {
  const cav_model *m = tr->model;
  int nv = m->nv, nu = m->nu, ok = 0;
  double *unit = calloc((size_t)nv, sizeof(double)), *basis = calloc((size_t)nv * nv, sizeof(double));
  double *residual = malloc((size_t)nv * sizeof(double)), *control = calloc((size_t)nv * (nu + 1), sizeof(double));
  double *effort = malloc((size_t)nv * sizeof(double));
  tr->unactuated = calloc((size_t)nv, sizeof *tr->unactuated);
  tr->fraction = calloc((size_t)nv + 1, sizeof *tr->fraction);
  tr->penalised = calloc((size_t)nv + 1, sizeof *tr->penalised);
  tr->effort = calloc(2 * (size_t)nu + 1, sizeof *tr->effort);
  tr->limited = malloc((size_t)(2 * nu + 1) * sizeof *tr->limited);
  tr->effort_range = malloc((size_t)(2 * nu + 1) * sizeof *tr->effort_range);
  tr->effort_unit = malloc((size_t)(2 * nu + 1) * sizeof *tr->effort_unit);
  tr->servo = calloc(2 * (size_t)nu + 1, sizeof *tr->servo);
  if (!unit || !basis || !residual || !control || !effort || !tr->unactuated || !tr->fraction || !tr->penalised ||
      !tr->effort || !tr->effort_range || !tr->effort_unit || !tr->servo || !tr->limited)
    goto end;

  // project unit forces; orthonormalise what is left, twice for rounding
  for (int d = 0; d < nv; d++) {
    unit[d] = 1;
    cav_actuation(m, tr->scratch[0].state, unit, residual, control + (size_t)d * nu);
    unit[d] = 0;
    for (int pass = 0; pass < 2; pass++) {
      for (int k = 0; k < tr->nresidual + tr->npenalised; k++) {
        double dot = 0;
        for (int i = 0; i < nv; i++) dot += basis[k * nv + i] * residual[i];
        for (int i = 0; i < nv; i++) residual[i] -= dot * basis[k * nv + i];
      }
    }
    double norm = 0;
    for (int i = 0; i < nv; i++) norm += residual[i] * residual[i];
    if ((norm = sqrt(norm)) < 1e-7) continue;
    int rank = tr->nresidual + tr->npenalised;
    assert(rank < nv);
    double unit_force = tr->weight * cav_force_fraction(m, d) * (dof_is_linear(m, d) ? 1 : CAV_MOMENT_ARM),
           *direction = basis + rank * nv, deviation;
    for (int i = 0; i < nv; i++) direction[i] = residual[i] / norm;
    if ((deviation = deviation_of(tr, d, direction)) > 0) {
      if (!force_row_set(&tr->penalised[tr->npenalised++], nv, direction, 1 / deviation)) goto end;
      continue;
    }
    tr->fraction[tr->nresidual] = cav_force_fraction(m, d);
    if (!force_row_set(&tr->unactuated[tr->nresidual++], nv, direction, 1 / unit_force)) goto end;
  }

  // efforts: control over its limit, or plain force where there is none; servos limited in both have both
  for (int a = 0; a < nu; a++) tr->limited[tr->nlimit++] = a;
  for (int a = 0; a < nu; a++)
    if (cav_servo_bounds(m, a) && m->actuator[a].forcelimited) tr->limited[tr->nlimit++] = a;
  for (int k = 0; k < tr->nlimit; k++) {
    int a = tr->limited[k];
    for (int d = 0; d < nv; d++) effort[d] = control[(size_t)d * nu + a];
    if (!limit_row_set(tr, k, effort)) goto end;
  }
  ok = 1;
end:
  free(unit), free(basis), free(residual), free(control), free(effort);
  return ok;
}

/// Constraint rows that a hard term gives at a knot.
static int term_slots(const cav_transcription *tr, const cav_term *term, int t) {
  if (term->use == CAV_USE_COST || cav_term_weight(tr, term, t) == 0) return 0;
  // others are refused by cav_solve
  assert(cav_quantity_rule_of(term->quantity)->hard);
  if (cav_term_is_reading(term)) return cav_term_dim(term);
  return cav_term_window(tr, term)->dofs;
}

static cav_slot_layout layout_of(const cav_transcription *tr, int t) {
  const cav_model *m = tr->model;
  cav_slot_layout at = {0};
  int has_force = tr->knot[t].has_force;
  at.effort = has_force ? tr->nresidual : 0;
  at.joint = at.effort + (has_force ? tr->nlimit : 0);
  at.tendon = at.joint;
  if (t >= tr->first)
    for (int j = 0; j < m->njoint; j++) at.tendon += m->joint[j].limited;
  at.term = at.tendon;
  if (t >= tr->first)
    for (int k = 0; k < m->ntendon; k++) at.term += m->tendon[k].limited;
  at.count = at.term;
  for (int i = 0; i < tr->problem->nterm; i++) at.count += term_slots(tr, &tr->problem->term[i], t);
  return at;
}

static void *room(int *ok, size_t n, size_t size) {
  void *p = calloc(n ? n : 1, size);
  if (!p) *ok = 0;
  return p;
}

int cav_knot_has_force(const cav_transcription *tr, int t) {
  return t < tr->nknot - 1 || (tr->problem->close_at_rest && !tr->periodicity);
}

cav_options cav_knot_law(const cav_transcription *tr, int t) {
  cav_options law = tr->options;
  law.stops = tr->options.stops && t == tr->nknot - 1 && cav_knot_has_force(tr, t);
  return law;
}

static int knot_new(cav_transcription *tr, int t) {
  cav_knot *knot = &tr->knot[t];
  int ok = 1;
  size_t n = (size_t)tr->nv;
  knot->time = t * tr->options.timestep;
  knot->has_force = cav_knot_has_force(tr, t);
  knot->layout = layout_of(tr, t);
  knot->slot = room(&ok, (size_t)knot->layout.count, sizeof *knot->slot);
  knot->u = room(&ok, n, sizeof(double));
  knot->du = room(&ok, 3 * n * n, sizeof(double));
  knot->hessian = room(&ok, 9 * n * n, sizeof(double));
  knot->gradient = room(&ok, 3 * n, sizeof(double));
  knot->step_row = room(&ok, 3 * n, sizeof(double));
  knot->slot_step = room(&ok, (size_t)knot->layout.count, sizeof(double));
  knot->rotation = room(&ok, CAV_ROTATION_SIZE * (size_t)tr->nrotation, sizeof(double));
  return ok;
}

static int scratch_new(cav_transcription *tr, cav_scratch *s) {
  int ok = 1;
  size_t n = (size_t)tr->nv;
  s->state = cav_state_new(tr->model);
  s->force_weight = room(&ok, n, sizeof(double));
  s->force_derivative = room(&ok, n, sizeof(double));
  s->row = room(&ok, 3 * n, sizeof(double));
  s->reading = room(&ok, 3 * n, sizeof(double));
  s->hessian = room(&ok, 9 * n * n, sizeof(double));
  s->derivative = room(&ok, CAV_DERIVATIVE_ROWS * n, sizeof(double));
  s->column = room(&ok, n, sizeof(int));
  s->tangent = room(&ok, n, sizeof(double));
  s->posture = room(&ok, (size_t)tr->model->nq, sizeof(double));
  s->force_step = room(&ok, n, sizeof(double));
  s->rate = room(&ok, 2 * n, sizeof(double));
  s->missing = room(&ok, (size_t)tr->problem->nterm, 1);
  return ok && s->state;
}

/// Curvature that steps have along accelerations where the problem gives them none, 1/(m/s^2)^2: a hundredth of the usual cost's.
static const double smooth_steps = 1e-6;

/// Whether a cost over time tells motions apart that meet the same rows.
static int has_running_cost(const cav_problem *problem) {
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    const int running = term->quantity == CAV_QUANTITY_EFFORT || term->quantity == CAV_QUANTITY_ACCELERATION ||
                        term->quantity == CAV_QUANTITY_VELOCITY || term->quantity == CAV_QUANTITY_CONFIGURATION ||
                        term->quantity == CAV_QUANTITY_POWER || term->quantity == CAV_QUANTITY_TRACK;
    if (running && term->use == CAV_USE_COST && term->weight > 0 && term->from != term->to) return 1;
  }
  return 0;
}

/// How far over the world speed along it costs: nowhere without a cost of it, or where slip costs nothing.
static double clearance_of(const cav_problem *problem) {
  int clear = 0, hold = 0;
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    if (term->use != CAV_USE_COST || !(term->weight > 0)) continue;
    clear |= term->quantity == CAV_QUANTITY_CLEARANCE;
    hold |= term->quantity == CAV_QUANTITY_SLIP;
  }
  return clear && hold ? cav_clearance_height(problem->timestep) : 0;
}

cav_transcription *cav_transcription_new(const cav_problem *problem, int threads, cav_error *error) {
  if (cav_actuators_plannable(problem->model, error) != CAV_OK) return NULL;
  const double knots = round(problem->duration / problem->timestep) + 1;
  if (cav_knots_plannable(knots, problem->model->nv, error) != CAV_OK) return NULL;
  for (int i = 0; i < problem->nterm; i++)
    if (cav_user_term_check(&problem->term[i], error) != CAV_OK) return NULL;
  cav_transcription *tr = calloc(1, sizeof *tr);
  if (!tr) goto memory;
  tr->problem = problem;
  for (int i = 0; i < problem->nterm; i++) tr->self_force |= problem->term[i].quantity == CAV_QUANTITY_SELF_FORCE;
  tr->clearance = clearance_of(problem);
  tr->model = problem->model;
  tr->nv = problem->model->nv;
  for (int i = 0; i < problem->nterm && !tr->edges; i++)
    if (problem->term[i].quantity == CAV_QUANTITY_EDGE_FORCE && !(tr->edges = cav_edges_new(tr->model))) goto memory;
  if (tr->edges && !cav_edges_any(tr->edges, tr->model)) {
    cav_edges_free(tr->edges);
    tr->edges = NULL;
  }
  tr->nknot = (int)lround(problem->duration / problem->timestep) + 1;
  tr->first = problem->free_start ? -1 : 1;
  // unknowns and entries of their rows are counted in int
  if ((double)tr->nknot * tr->nv > INT_MAX / 4) goto memory;
  const double *g = problem->model->gravity;
  tr->weight = problem->model->mass * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  if (!(tr->weight > 0)) tr->weight = problem->model->mass > 0 ? problem->model->mass : 1;
  tr->options = problem->model->options;
  tr->options.timestep = problem->timestep;
  tr->options.order = problem->order;
  tr->options.stops = problem->close_at_rest && !problem->cycle.on;
  tr->derivative = CAV_DERIVATIVE_ANALYTIC;
  tr->pool = cav_parallel_new(threads);
  if (problem->cycle.on && !(tr->periodicity = cav_periodicity_new(problem, error))) {
    cav_transcription_free(tr);
    return NULL;
  }
  tr->free_step = problem->duration_most > 0;
  tr->smoothness = has_running_cost(problem) ? 0 : smooth_steps;
  if (!tr->pool || !list_rotations(tr)) goto memory;
  tr->before = calloc(2 * (size_t)tr->nv + 1, sizeof(double));
  tr->start = calloc(2 * (size_t)tr->model->nq + 1, sizeof(double));
  tr->rotation_after = calloc(CAV_ROTATION_SIZE * (size_t)tr->nrotation + 1, sizeof(double));
  tr->window = calloc((size_t)problem->nterm + 1, sizeof *tr->window);
  tr->selected = calloc((size_t)problem->nterm * (size_t)tr->nv + 1, 1);
  if (!tr->before || !tr->start || !tr->rotation_after || !tr->window || !tr->selected) goto memory;
  cav_term_windows(tr);
  tr->after = tr->before + tr->nv;
  tr->scratch = calloc((size_t)cav_parallel_size(tr->pool), sizeof *tr->scratch);
  if (!tr->scratch) goto memory;
  for (int i = 0; i < cav_parallel_size(tr->pool); i++)
    if (!scratch_new(tr, &tr->scratch[i])) goto memory;
  if (!list_force_rows(tr)) goto memory;
  tr->knot = calloc((size_t)tr->nknot, sizeof *tr->knot);
  tr->status = calloc((size_t)tr->nknot, sizeof *tr->status);
  tr->ready = calloc((size_t)tr->nknot, sizeof *tr->ready);
  tr->order = calloc((size_t)tr->nknot, sizeof *tr->order);
  if (!tr->knot || !tr->status || !tr->ready || !tr->order) goto memory;
  for (int t = 0; t < tr->nknot; t++) {
    tr->order[t] = t;
    if (!knot_new(tr, t)) goto memory;
  }
  return tr;
memory:
  if (error) *error = (cav_error){CAV_NO_MEMORY, 0, "not enough memory for this problem"};
  cav_transcription_free(tr);
  return NULL;
}

void cav_transcription_free(cav_transcription *tr) {
  if (!tr) return;
  for (int t = 0; tr->knot && t < tr->nknot; t++) {
    cav_knot *k = &tr->knot[t];
    free(k->slot), free(k->u), free(k->du), free(k->hessian), free(k->gradient), free(k->rotation), free(k->y),
        free(k->slot_row), free(k->slot_step), free(k->step_row);
    free(k->dense), free(k->rest), free(k->moving);
    cav_kept_free(k->kept);
    cav_evaluation_free(k->evaluation);
    free(k->hints);
  }
  for (int i = 0; tr->scratch && i < cav_parallel_size(tr->pool); i++) {
    cav_scratch *s = &tr->scratch[i];
    cav_state_free(s->state);
    free(s->value), free(s->join), free(s->dq), free(s->dv), free(s->dn), free(s->key), free(s->derivative);
    free(s->force_weight), free(s->force_derivative), free(s->row), free(s->reading), free(s->hessian), free(s->dense),
        free(s->rest), free(s->used), free(s->column), free(s->tangent), free(s->posture);
    free(s->force_step), free(s->rate), free(s->missing), free(s->user.x), free(s->trace[0]), free(s->trace[1]),
        free(s->slot[0]), free(s->slot[1]);
  }
  for (int k = 0; k < tr->nresidual; k++) free(tr->unactuated[k].dof), free(tr->unactuated[k].coef);
  for (int k = 0; k < tr->npenalised; k++) free(tr->penalised[k].dof), free(tr->penalised[k].coef);
  for (int a = 0; tr->effort && a < tr->nlimit; a++) free(tr->effort[a].dof), free(tr->effort[a].coef);
  for (int a = 0; tr->servo && a < tr->nlimit; a++) cav_servo_free(&tr->servo[a]);
  cav_edges_free(tr->edges);
  free(tr->servo), free(tr->limited);
  free(tr->unactuated), free(tr->fraction), free(tr->penalised), free(tr->effort), free(tr->effort_range),
      free(tr->effort_unit), free(tr->rotation_dof), free(tr->rotation_of);
  free(tr->knot), free(tr->status), free(tr->ready), free(tr->order), free(tr->scratch), free(tr->before),
      free(tr->start), free(tr->rotation_after), free(tr->window), free(tr->selected);
  cav_periodicity_free(tr->periodicity);
  cav_parallel_free(tr->pool);
  free(tr);
}

// ---------------------------------------------------------------- chaining to knots

int cav_transcription_blocks(const cav_transcription *tr) { return tr->nknot - tr->first; }

int cav_transcription_unknowns(const cav_transcription *tr) {
  return cav_transcription_blocks(tr) * tr->nv + tr->free_step;
}

int cav_transcription_block(const cav_transcription *tr, int t, int c) {
  int blocks = cav_transcription_blocks(tr), block = t - 1 + c - tr->first;
  if (tr->periodicity) return (block + blocks) % blocks;
  return block >= 0 && block < blocks ? block : -1;
}

const double *cav_velocity_at(const cav_transcription *tr, const cav_trajectory *at, int t) {
  return t == 0 && tr->periodicity ? tr->before : at->v + (size_t)t * tr->nv;
}

const double *cav_velocity_after(const cav_transcription *tr, const cav_trajectory *at, int t) {
  return t + 1 < tr->nknot ? at->v + (size_t)(t + 1) * tr->nv : tr->after;
}

// ---------------------------------------------------------------- evaluation

typedef struct pass {
  cav_transcription *tr;
  cav_trajectory *at;
  int jacobian;
  cav_status *status;                 ///< [nknot]
  void (*take)(void *context, int t); ///< NULL: nothing follows
  void *context;
  int failed;   ///< a knot before those that follow
  double bound; ///< merit that all knots together may reach; what is left once some are above it is skipped
  _Atomic double merit;
} pass;

/// Residuals of all rows at a step shorter (1) or longer (2) by a small fraction, with the knots where they are.
static cav_status shift_step(const cav_transcription *tr, cav_scratch *s, int t, int shifted, const double *q,
                             const double *v, const double *v_next) {
  cav_transcription near = *tr;
  cav_knot *knot = &tr->knot[t];
  double fraction = exp(shifted == 1 ? -CAV_STEP_FRACTION : CAV_STEP_FRACTION), *v_here = s->rate,
         *v_then = s->rate + tr->nv;
  for (int d = 0; d < tr->nv; d++) {
    v_here[d] = v[d] / (cav_knot_moves(tr, t) ? fraction : 1); // that of a given start stays
    v_then[d] = v_next[d] / fraction;
  }
  near.options.timestep *= fraction;
  near.options.time_constant *= fraction;
  s->state->options = cav_knot_law(&near, t);
  cav_status status = cav_inverse(tr->model, s->state, q, v_here, v_then, knot->u);
  if (status == CAV_OK) cav_readings_values(&near, s, t);
  s->state->options = cav_knot_law(tr, t);
  if (status == CAV_OK) status = cav_user_refused(&knot->refusal);
  if (status != CAV_OK) return status;
  if (knot->nread) memcpy(knot->y, s->value + tr->nv, (size_t)knot->nread * sizeof(double));
  cav_sum a = {.tr = &near, .s = s, .knot = knot, .t = t, .shifted = shifted, .counted = 1};
  cav_knot_sum(&a, q, v_here, v_then);
  return CAV_OK;
}

void cav_transcription_wrap(const cav_transcription *tr, cav_scratch *s, int t, int n, double *row) {
  size_t nv = (size_t)tr->nv;
  for (int i = 0; i < n; i++, row += 3 * nv) {
    for (int c = 0; c < 3; c++) {
      int knot = t + c - 1, way = knot < 1 ? 1 : knot >= tr->nknot ? -1 : 0;
      if (!way) continue;
      cav_periodicity_tangent(tr->periodicity, way, row + (size_t)c * nv, s->rate);
      memcpy(row + (size_t)c * nv, s->rate, nv * sizeof(double));
    }
  }
}

/// The same of all of a knot's sums.
static void periodicity_knot(const cav_sum *a) {
  const cav_transcription *tr = a->tr;
  cav_scratch *s = a->s;
  cav_knot *knot = a->knot;
  const int t = a->t, width = 3 * tr->nv;
  double *H = knot->present;
  cav_transcription_wrap(tr, s, t, knot->ndense, a->dense);
  cav_transcription_wrap(tr, s, t, 1, knot->gradient);
  cav_transcription_wrap(tr, s, t, 1, knot->step_row);
  if (tr->keep_rows) cav_transcription_wrap(tr, s, t, knot->layout.count, knot->slot_row);
  // the Hessian from both sides
  for (int side = 0; side < 2; side++) {
    for (int i = 0; i < width; i++)
      for (int j = i + 1; j < width; j++) {
        double x = H[i * width + j];
        if (side == 0) H[i * width + j] = H[j * width + i];
        if (side == 1) H[i * width + j] = H[j * width + i], H[j * width + i] = x;
      }
    cav_transcription_wrap(tr, s, t, width, H);
  }
  for (int i = 0; i < width; i++)
    for (int j = i + 1; j < width; j++) H[i * width + j] = 0;
}

/// The inverse dynamics of a knot, in the state and in u: those of the step that led here, where they are known.
static cav_status evaluate_dynamics(const pass *p, cav_scratch *s, cav_knot *knot, const double *q, const double *v,
                                    const double *v_next) {
  if (!p->jacobian || !cav_evaluation_take(knot->evaluation, s->state, q, v, v_next))
    return cav_inverse(p->tr->model, s->state, q, v, v_next, knot->u);
  memcpy(knot->u, s->state->u, (size_t)p->tr->nv * sizeof(double));
  return CAV_OK;
}

static cav_status evaluate_knot(const pass *p, cav_scratch *s, int t) {
  cav_transcription *tr = p->tr;
  cav_knot *knot = &tr->knot[t];
  int nv = tr->nv;
  const double *q = p->at->q + (size_t)t * p->at->nq, *v = cav_velocity_at(tr, p->at, t);
  const double *v_next = cav_velocity_after(tr, p->at, t);
  s->state->options = cav_knot_law(tr, t);
  knot->refusal = (cav_user_refusal){0};

  // dynamics, first beside the step where that is an unknown
  double start = p->jacobian ? cav_clock() : 0;
  cav_status status = evaluate_dynamics(p, s, knot, q, v, v_next);
  if (status != CAV_OK) return status;
  // rows that go into the normal equations at once are needed no longer than that
  cav_sum a = {.tr = tr, .s = s, .knot = knot, .t = t, .jacobian = p->jacobian, .passing = p->take != NULL};
  if (!cav_readings_list(tr, s, t) || (p->jacobian && !cav_knot_reserve(&a))) return CAV_NO_MEMORY;
  // a single thread's knot is taken before its next one
  knot->present = a.passing && cav_parallel_size(tr->pool) == 1 ? s->hessian : knot->hessian;
  if (p->jacobian && tr->free_step) {
    status = shift_step(tr, s, t, 1, q, v, v_next);
    if (status == CAV_OK) status = shift_step(tr, s, t, 2, q, v, v_next);
    if (status == CAV_OK) status = cav_inverse(tr->model, s->state, q, v, v_next, knot->u);
    if (status != CAV_OK) return status;
  }
  cav_readings_values(tr, s, t);
  if ((status = cav_user_refused(&knot->refusal)) != CAV_OK) return status;
  if (knot->nread) memcpy(knot->y, s->value + nv, (size_t)knot->nread * sizeof(double));
  memcpy(p->at->u + (size_t)t * nv, knot->u, (size_t)nv * sizeof(double));
  if (p->jacobian) {
    status = cav_readings_derivatives(tr, s, t, q, v, v_next);
    if (status == CAV_OK) status = cav_user_refused(&knot->refusal);
    if (status != CAV_OK) return status;
    a.links = cav_links_of(tr, t);
    if (!a.passing) cav_links_chain(tr, &a.links, nv, 1, s->dq, s->dv, s->dn, knot->du);
  }
  if (p->jacobian) s->seconds += cav_clock() - start;

  // rows
  cav_knot_sum(&a, q, v, v_next);
  if (p->jacobian && tr->periodicity && (t < 2 || t == tr->nknot - 1)) periodicity_knot(&a);
  if (!isfinite(knot->merit)) return CAV_NOT_FINITE;
  if (!p->jacobian) cav_evaluation_keep(&knot->evaluation, s->state, q, v, v_next);
  return p->jacobian && !tr->gradient_only ? cav_rows_join(tr, s, knot, a.dense) : CAV_OK;
}

static void evaluate_item(void *context, int t, int member) {
  const pass *p = context;
  cav_scratch *s = &p->tr->scratch[member];
  cav_knot *knot = &p->tr->knot[t];
  cav_evaluation_swap_hints(s->state, &knot->hints);
  p->status[t] = evaluate_knot(p, s, t);
  cav_evaluation_swap_hints(s->state, &knot->hints);
}

static void evaluate_within(void *context, int item, int member) {
  pass *p = context;
  const int t = p->tr->order[item];
  double sum = atomic_load(&p->merit);
  if (sum > p->bound) return;
  evaluate_item(context, t, member);
  if (p->status[t] != CAV_OK) return;
  while (!atomic_compare_exchange_weak(&p->merit, &sum, sum + p->tr->knot[t].merit)) {}
}

static void follow_item(void *context, int t) {
  pass *p = context;
  p->failed = p->failed || p->status[t] != CAV_OK;
  if (!p->failed) p->take(p->context, t);
}

/// Rotation Jacobians of one step with velocity v.
static void prepare_rotation(const cav_transcription *tr, const double *v, double *rotation) {
  for (int k = 0; k < tr->nrotation; k++) {
    double *J = rotation + CAV_ROTATION_SIZE * k;
    for (int c = 0; c < 3; c++) J[18 + c] = tr->options.timestep * v[tr->rotation_dof[k] + c];
    cav_rotation_jacobian_inverse(J + 18, J);
    for (int r = 0; r < 3; r++)
      for (int c = 0; c < 3; c++) J[9 + 3 * r + c] = J[3 * c + r];
  }
}

static void prepare_rotations(cav_transcription *tr, const cav_trajectory *at) {
  for (int t = cav_knot_moves(tr, 0) ? 0 : 1; t < tr->nknot; t++)
    prepare_rotation(tr, cav_velocity_at(tr, at, t), tr->knot[t].rotation);
  if (tr->periodicity) prepare_rotation(tr, tr->after, tr->rotation_after);
}

/// The step of the trajectory, and the velocities at its ends.
static void prepare_ends(cav_transcription *tr, const cav_trajectory *at) {
  const double *first = at->v + tr->nv, *last = at->v + (size_t)(tr->nknot - 1) * tr->nv;
  if (at->timestep != tr->options.timestep) tr->options.time_constant *= at->timestep / tr->options.timestep;
  tr->options.timestep = at->timestep;
  memset(tr->after, 0, (size_t)tr->nv * sizeof(double));
  if (tr->periodicity) {
    cav_periodicity_tangent(tr->periodicity, -1, last, tr->before);
    cav_periodicity_tangent(tr->periodicity, 1, first, tr->after);
  } else if (!tr->problem->close_at_rest) {
    memcpy(tr->after, last, (size_t)tr->nv * sizeof(double));
  }
}

cav_status cav_transcription_conclude(cav_transcription *tr, const cav_status *status) {
  int t = 0;
  while (t < tr->nknot && status[t] == CAV_OK) t++;
  if (tr->failure.status != CAV_BAD_INPUT) tr->failure = (cav_error){0};
  if (t == tr->nknot) return CAV_OK;
  const cav_knot *knot = &tr->knot[t];
  if (knot->refusal.refused)
    cav_user_tell(&tr->problem->term[knot->refused_term], &knot->refusal, t, t * tr->options.timestep, &tr->failure);
  return status[t];
}

/// A pass over all knots.
static cav_status evaluate(pass *p) {
  cav_transcription *tr = p->tr;
  double start = cav_clock(), dynamics = 0;
  int members = cav_parallel_size(tr->pool);
  p->status = tr->status;
  memset(p->status, 0, (size_t)tr->nknot * sizeof *p->status);
  prepare_ends(tr, p->at);
  cav_term_windows(tr);
  if (p->jacobian) prepare_rotations(tr, p->at);
  for (int i = 0; i < members; i++) tr->scratch[i].seconds = 0;
  if (p->take)
    cav_parallel_then(tr->pool, tr->nknot, evaluate_item, follow_item, p, tr->ready);
  else
    cav_parallel_for(tr->pool, tr->nknot, p->bound < INFINITY ? evaluate_within : evaluate_item, p);
  for (int i = 0; i < members; i++) dynamics += tr->scratch[i].seconds / members;
  // values alone are dynamics: a clock at every knot would take a twentieth of their time
  if (!p->jacobian) dynamics = cav_clock() - start;
  tr->seconds_dynamics += dynamics;
  tr->seconds_assembly += cav_clock() - start - dynamics;
  return cav_transcription_conclude(tr, p->status);
}

int cav_transcription_keep_rows(cav_transcription *tr) {
  tr->keep_rows = 1;
  for (int t = 0; t < tr->nknot; t++) {
    cav_knot *knot = &tr->knot[t];
    if (!knot->slot_row) knot->slot_row = calloc((size_t)knot->layout.count * 3 * tr->nv + 1, sizeof(double));
    if (!knot->slot_row) return 0;
  }
  return 1;
}

int cav_transcription_stopped(const cav_transcription *tr) {
  return tr->failure.status == CAV_BAD_INPUT || (tr->stop && tr->stop(tr->stop_context));
}

cav_status cav_transcription_values(cav_transcription *tr, cav_trajectory *at) {
  pass p = {.tr = tr, .at = at, .bound = INFINITY};
  return cav_transcription_stopped(tr) ? CAV_INTERRUPTED : evaluate(&p);
}

/// Puts those first whose last merits are the largest; after a step few change their places.
static void sort_knots(cav_transcription *tr) {
  for (int i = 1; i < tr->nknot; i++) {
    const int t = tr->order[i];
    int k = i;
    for (; k > 0 && tr->knot[tr->order[k - 1]].merit < tr->knot[t].merit; k--) tr->order[k] = tr->order[k - 1];
    tr->order[k] = t;
  }
}

/// Whether quantities of one's own may refuse: then the end must not hang on which thread meets which knot.
static int may_refuse(const cav_transcription *tr) {
  for (int i = 0; i < tr->problem->nterm; i++)
    if (tr->problem->term[i].quantity == CAV_QUANTITY_USER) return 1;
  return 0;
}

cav_status cav_transcription_values_within(cav_transcription *tr, cav_trajectory *at, double bound, int *beyond) {
  // sums of the same merits in another order differ by rounding
  pass p = {.tr = tr, .at = at, .bound = may_refuse(tr) ? INFINITY : bound * (1 + 4 * tr->nknot * DBL_EPSILON)};
  *beyond = 0;
  if (cav_transcription_stopped(tr)) return CAV_INTERRUPTED;
  sort_knots(tr);
  cav_status status = evaluate(&p);
  *beyond = p.merit > p.bound;
  return status;
}

cav_status cav_transcription_return(cav_transcription *tr, cav_trajectory *at) {
  if (cav_transcription_stopped(tr)) return CAV_INTERRUPTED;
  prepare_ends(tr, at);
  cav_term_windows(tr);
  cav_values_take(tr, at);
  memset(tr->status, 0, (size_t)tr->nknot * sizeof *tr->status);
  return cav_transcription_conclude(tr, tr->status);
}

cav_status cav_transcription_linearise(cav_transcription *tr, cav_trajectory *at) {
  return cav_transcription_linearise_then(tr, at, NULL, NULL);
}

cav_status cav_transcription_linearise_then(cav_transcription *tr, cav_trajectory *at,
                                            void (*take)(void *context, int t), void *context) {
  pass p = {.tr = tr, .at = at, .jacobian = 1, .take = take, .context = context, .bound = INFINITY};
  return cav_transcription_stopped(tr) ? CAV_INTERRUPTED : evaluate(&p);
}

// ---------------------------------------------------------------- sums over knots

double cav_transcription_cost(const cav_transcription *tr) {
  double sum_cost = 0;
  for (int t = 0; t < tr->nknot; t++) sum_cost += tr->knot[t].cost;
  return sum_cost;
}

double cav_transcription_merit(const cav_transcription *tr) {
  double sum_merit = 0;
  for (int t = 0; t < tr->nknot; t++) sum_merit += tr->knot[t].merit;
  return sum_merit;
}

double cav_transcription_unactuated(const cav_transcription *tr, int *where) {
  double worst = 0;
  if (where) *where = 0;
  for (int t = 0; t < tr->nknot; t++) {
    for (int i = 0; i < tr->knot[t].layout.effort; i++) {
      if (fabs(tr->knot[t].slot[i].value) <= worst) continue;
      worst = fabs(tr->knot[t].slot[i].value);
      if (where) *where = t;
    }
  }
  return worst;
}

double cav_transcription_violation(const cav_transcription *tr) {
  double worst = 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = tr->knot[t].layout.effort; i < tr->knot[t].layout.count; i++)
      worst = fmax(worst, cav_slot_excess(&tr->knot[t].slot[i]));
  return worst;
}

/// Weight that evaluate gave the row.
static double slot_rho(const cav_transcription *tr, const cav_slot_layout *at, int i) {
  if (i < at->effort) return tr->options.timestep * tr->penalty.unactuated;
  if (i < at->joint) return tr->options.timestep * tr->penalty.effort;
  if (i < at->term) return tr->options.timestep * tr->penalty.range;
  return tr->penalty.term;
}

void cav_transcription_multipliers(cav_transcription *tr) {
  for (int t = 0; t < tr->nknot; t++) {
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      cav_slot *slot = &tr->knot[t].slot[i];
      double rho = slot_rho(tr, &tr->knot[t].layout, i), shifted = rho * slot->value + slot->multiplier;
      slot->multiplier = shifted - fmin(fmax(shifted, rho * slot->lower), rho * slot->upper);
    }
  }
}

void cav_transcription_estimate_multipliers(cav_transcription *tr, const double *x) {
  int nv = tr->nv;
  for (int t = 0; t < tr->nknot; t++) {
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      cav_slot *slot = &tr->knot[t].slot[i];
      double rho = slot_rho(tr, &tr->knot[t].layout, i), value = slot->value;
      const double *row = tr->knot[t].slot_row + (size_t)i * 3 * (size_t)nv;
      for (int c = 0; x && c < 3; c++) {
        int block = cav_transcription_block(tr, t, c);
        for (int d = 0; block >= 0 && d < nv; d++) value += row[c * nv + d] * x[block * nv + d];
      }
      if (x && tr->free_step) value += tr->knot[t].slot_step[i] * x[cav_transcription_blocks(tr) * nv];
      double shifted = rho * value + (x ? slot->multiplier : 0);
      slot->final_multiplier = shifted - fmin(fmax(shifted, rho * slot->lower), rho * slot->upper);
    }
  }
}

/// q_0 and v_0 of a free start, by the knot before it: x [2nv] of both.
static void move_start(const cav_transcription *tr, const cav_trajectory *from, const double *x, cav_trajectory *to) {
  const cav_model *m = tr->model;
  double *before = tr->start, *moved = before + m->nq;
  cav_integrate(m, from->q, from->v, -from->timestep, before);
  cav_integrate(m, before, x, 1, moved);
  cav_integrate(m, from->q, x + tr->nv, 1, to->q);
  cav_difference(m, moved, to->q, to->timestep, to->v);
}

void cav_transcription_move(const cav_transcription *tr, const cav_trajectory *from, const double *x,
                            cav_trajectory *to) {
  size_t nq = (size_t)from->nq, last = (size_t)tr->nknot - 1, nv = (size_t)tr->nv;
  const double *after_start = x + (size_t)(1 - tr->first) * nv;
  to->timestep = from->timestep;
  if (tr->free_step) {
    double least = tr->problem->duration_least / (double)last, most = tr->problem->duration_most / (double)last;
    to->timestep = fmin(fmax(from->timestep * exp(after_start[last * nv]), least), most);
  }
  for (size_t t = 1; t <= last; t++)
    cav_integrate(tr->model, from->q + t * nq, after_start + (t - 1) * nv, 1, to->q + t * nq);
  if (tr->periodicity) {
    cav_periodicity_configuration(tr->periodicity, -1, to->q + last * nq, to->q);
  } else if (tr->problem->free_start) {
    move_start(tr, from, x, to);
  } else {
    memcpy(to->q, from->q, nq * sizeof(double));
    memcpy(to->v, from->v, nv * sizeof(double));
  }
  cav_trajectory_velocities(tr->model, to);
  if (tr->periodicity) cav_periodicity_tangent(tr->periodicity, -1, to->v + last * nv, to->v);
}
