/// Rows of one knot for the certificate of optimality, from the meaning of problem.h and solve.h: in this order costs,
/// forces that no actuator gives, limits of actuators, ranges of joints and tendons, hard terms. Limits and ranges are
/// those planned with (effort_limit, limit_margin), since these are what a solution is optimal under. Contacts are told
/// apart by pair and feature, so that a row stays one while others come and go beside it.
#include "knot_rows.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// what makes the row of a residual force a cost
static const cav_term residual_cost = {.name = "residual", .use = CAV_USE_COST, .norm = CAV_NORM_SQUARE, .scale = 1};

void cav_knot_rows_clear(cav_knot_rows *rows) {
  free(rows->row), free(rows->contact), free(rows->work), free(rows->unactuated);
  *rows = (cav_knot_rows){0};
}

// ---------------------------------------------------------------- listing

static cav_status add(cav_knot_rows *rows, cav_knot_row row) {
  if (rows->n == rows->room) {
    int room = rows->room ? 2 * rows->room : 64;
    cav_knot_row *larger = realloc(rows->row, (size_t)room * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    rows->row = larger;
    rows->room = room;
  }
  rows->row[rows->n++] = row;
  return CAV_OK;
}

// whether a cost counts knot t
static int costs_at(const cav_verification *verification, const cav_term *term, int t) {
  if (term->use != CAV_USE_COST || cav_verification_weight(verification, term, t) == 0) return 0;
  return !cav_verification_is_given(verification, term, t);
}

static int of_contacts(const cav_term *term) { return cav_quantity_rule_of(term->quantity)->of == CAV_OF_CONTACTS; }

// rows of a term that is not of contacts, read once for their number; or of one that is, by the contacts listed
static int count(const cav_verification *verification, const cav_term *term, int t, cav_knot_rows *rows) {
  double value[2];
  int n = 0, nq = verification->model->nq, room = (rows->work_room - 2 * verification->model->nv - nq) / 2;
  if (!of_contacts(term))
    return cav_verification_measure(verification, term, t, rows->work, rows->work + nq, rows->work + nq + room);
  for (int i = 0; t < verification->rows && i < rows->ncontact; i++) {
    const cav_contact *contact = verification->state->contact + i;
    if (cav_verification_looks_at(verification, term, t, contact))
      n += cav_verification_contact(verification, term, contact, value);
  }
  return n;
}

static cav_status list_costs(const cav_verification *verification, int t, cav_knot_rows *rows) {
  const cav_problem *p = verification->problem;
  cav_status status = CAV_OK;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = p->term + i;
    if (!costs_at(verification, term, t)) continue;
    int single, whole, n = count(verification, term, t, rows);
    cav_verification_holds(verification, term, t, &single, &whole);
    double weight = term->weight * cav_verification_weight(verification, term, t);
    for (int k = 0; k < n && status == CAV_OK; k++)
      status = add(rows, (cav_knot_row){.term = term, .weight = weight, .windowed = !single});
  }
  return status;
}

// dofs on which the projector off the actuators' range is not zero; moments are constant
static cav_status find_unactuated(const cav_verification *verification, cav_knot_rows *rows) {
  const cav_model *model = verification->model;
  double *unit = rows->work, *residual = unit + model->nv;
  if (rows->unactuated) return CAV_OK;
  rows->unactuated = calloc((size_t)model->nv + 1, 1);
  if (!rows->unactuated) return CAV_NO_MEMORY;
  memset(unit, 0, sizeof(double) * (size_t)model->nv);
  for (int d = 0; d < model->nv; d++) {
    unit[d] = 1;
    cav_actuation(model, verification->state, unit, residual, NULL);
    unit[d] = 0;
    rows->unactuated[d] = residual[d] > 1e-12;
  }
  return CAV_OK;
}

static cav_status list_forces(const cav_verification *verification, int t, cav_knot_rows *rows) {
  const cav_model *model = verification->model;
  const double *v = verification->v + (size_t)t * (size_t)model->nv;
  if (t >= verification->rows) return CAV_OK;
  cav_status status = find_unactuated(verification, rows);
  for (int d = 0; d < model->nv && status == CAV_OK; d++)
    if (verification->deviation[d] > 0)
      status = add(rows, (cav_knot_row){.kind = CAV_BINDING_UNACTUATED,
                                        .object = d,
                                        .term = &residual_cost,
                                        .weight = verification->h,
                                        .windowed = 1});
    else if (rows->unactuated[d])
      status = add(rows, (cav_knot_row){.kind = CAV_BINDING_UNACTUATED, .object = d});
  for (int a = 0; a < model->nu; a++) {
    for (int k = 0; k < cav_verification_effort_rows(model, a) && status == CAV_OK; k++) {
      cav_knot_row row = {.kind = CAV_BINDING_EFFORT, .object = a, .component = k};
      double range[2], effort = verification->control[t * model->nu + a];
      cav_verification_effort_row(verification, a, k, effort, v, rows->work, range);
      row.lower = range[0], row.upper = range[1];
      status = add(rows, row);
    }
  }
  return status;
}

// range of a joint, of a cycle also that which its counterpart has one period on: x there is sign*x + shift here; work
// [nq+2*nv]
static void joint_range(const cav_verification *verification, int t, int j, double *work, double range[2]) {
  const cav_model *model = verification->model;
  const cav_joint *joint = model->joint + j;
  range[0] = joint->range[0], range[1] = joint->range[1];
  if (!verification->image) return;
  const double *q = verification->q + (size_t)t * (size_t)model->nq;
  double *moved = work, *unit = work + model->nq, *image = unit + model->nv;
  memset(unit, 0, sizeof(double) * (size_t)model->nv);
  unit[joint->dof] = 1;
  cav_cycle_image_tangent(verification->image, 1, unit, image);
  int dof = 0;
  for (int d = 1; d < model->nv; d++)
    if (fabs(image[d]) > fabs(image[dof])) dof = d;
  const cav_joint *other = model->joint + model->dof[dof].joint;
  if (!other->limited) return;
  if (joint->type == CAV_JOINT_BALL) {
    range[1] = fmin(range[1], other->range[1]);
    return;
  }
  cav_cycle_image_configuration(verification->image, q, moved);
  double sign = image[dof] > 0 ? 1 : -1, shift = moved[other->q] - sign * q[joint->q];
  double a = sign * (other->range[0] - shift), b = sign * (other->range[1] - shift);
  range[0] = fmax(range[0], fmin(a, b));
  range[1] = fmin(range[1], fmax(a, b));
}

static cav_status list_ranges(const cav_verification *verification, int t, cav_knot_rows *rows) {
  const cav_model *model = verification->model;
  double keep = verification->problem->limit_margin;
  cav_status status = CAV_OK;
  if (t == 0 && !verification->problem->free_start) return CAV_OK;
  for (int j = 0; j < model->njoint && status == CAV_OK; j++) {
    if (!model->joint[j].limited || model->joint[j].type == CAV_JOINT_FREE) continue;
    double range[2];
    joint_range(verification, t, j, rows->work, range);
    const double inside = keep - cav_joint_stop(&model->joint[j]);
    cav_knot_row row = {.kind = CAV_BINDING_JOINT, .object = j, .upper = range[1] - inside};
    row.lower = model->joint[j].type == CAV_JOINT_BALL ? -INFINITY : range[0] + inside;
    status = add(rows, row);
  }
  for (int i = 0; i < model->ntendon && status == CAV_OK; i++) {
    const cav_tendon *tendon = model->tendon + i;
    cav_knot_row row = {.kind = CAV_BINDING_TENDON, .object = i};
    row.lower = tendon->range[0] + keep, row.upper = tendon->range[1] - keep;
    if (tendon->limited) status = add(rows, row);
  }
  return status;
}

// component that a value of a hard term has in cav_binding
static int component_of(const cav_model *model, const cav_term *term, int k) {
  if (term->quantity == CAV_QUANTITY_SENSOR || term->quantity == CAV_QUANTITY_USER)
    return term->component >= 0 ? term->component : k;
  int dof = -1;
  for (int d = 0; d < model->nv && dof < 0; d++)
    if (cav_verification_selects(model, term, d) && k-- == 0) dof = d;
  assert(dof >= 0);
  return dof;
}

static cav_status list_hard(const cav_verification *verification, int t, cav_knot_rows *rows) {
  const cav_problem *p = verification->problem;
  cav_status status = CAV_OK;
  for (int i = 0, hard = -1; i < p->nterm; i++) {
    const cav_term *term = p->term + i;
    int single, whole, range = term->use == CAV_USE_RANGE;
    hard += term->use != CAV_USE_COST;
    if (term->use == CAV_USE_COST || !cav_verification_holds(verification, term, t, &single, &whole)) continue;
    int n = count(verification, term, t, rows);
    for (int k = 0; k < n && status == CAV_OK; k++)
      status = add(rows, (cav_knot_row){.kind = CAV_BINDING_TERM,
                                        .object = hard,
                                        .component = component_of(verification->model, term, k),
                                        .lower = range ? term->lower / term->scale : 0,
                                        .upper = range ? term->upper / term->scale : 0});
  }
  return status;
}

static void take_multipliers(cav_knot_rows *rows, int t, int nrow, const cav_binding *row) {
  for (int i = 0; i < nrow; i++) {
    if (row[i].knot != t || row[i].kind == CAV_BINDING_UNACTUATED) continue;
    for (int k = 0; k < rows->n; k++) {
      cav_knot_row *to = rows->row + k;
      int parts = row[i].kind == CAV_BINDING_TERM || row[i].kind == CAV_BINDING_EFFORT;
      int component = parts ? row[i].component : 0;
      if (to->term || to->kind != row[i].kind || to->object != row[i].object || to->component != component) continue;
      to->multiplier = row[i].multiplier;
    }
  }
}

cav_status cav_knot_rows_list(const cav_verification *verification, int t, int nrow, const cav_binding *row,
                              cav_knot_rows *rows) {
  const cav_state *state = verification->state;
  int room = cav_constraint_check_room(verification) + 2 * verification->model->nv;
  rows->n = 0;
  if (room > rows->work_room) {
    free(rows->work);
    rows->work = malloc((size_t)room * sizeof *rows->work);
    rows->work_room = rows->work ? room : 0;
  }
  if (state->ncontact > rows->contact_room) {
    free(rows->contact);
    rows->contact = malloc((size_t)state->ncontact * sizeof *rows->contact);
    rows->contact_room = rows->contact ? state->ncontact : 0;
  }
  if (!rows->work || (state->ncontact && !rows->contact)) return CAV_NO_MEMORY;
  rows->ncontact = state->ncontact;
  for (int i = 0; i < state->ncontact; i++) {
    rows->contact[i][0] = state->contact[i].pair;
    rows->contact[i][1] = state->contact[i].feature;
  }
  cav_status status = list_costs(verification, t, rows);
  if (status == CAV_OK) status = list_forces(verification, t, rows);
  if (status == CAV_OK) status = list_ranges(verification, t, rows);
  if (status == CAV_OK) status = list_hard(verification, t, rows);
  if (status == CAV_OK) take_multipliers(rows, t, nrow, row);
  return status;
}

// ---------------------------------------------------------------- reading

static const cav_contact *find(const cav_state *state, const int key[2], int likely) {
  for (int i = likely; i < likely + state->ncontact; i++) {
    const cav_contact *contact = state->contact + i % state->ncontact;
    if (contact->pair == key[0] && contact->feature == key[1]) return contact;
  }
  return NULL;
}

// values of one term, divided by its scale; their number
static int read_term(const cav_verification *verification, const cav_term *term, int t, cav_knot_rows *rows,
                     double *out) {
  const cav_model *model = verification->model;
  int n = 0, room = (rows->work_room - 2 * model->nv - model->nq) / 2;
  if (!of_contacts(term)) {
    double *x = rows->work + model->nq, *target = x + room;
    n = cav_verification_measure(verification, term, t, rows->work, x, target);
    for (int k = 0; k < n; k++) out[k] = (x[k] - target[k]) / term->scale;
    return n;
  }
  for (int i = 0; t < verification->rows && i < rows->ncontact; i++) {
    // what a row looks at depends on the pair alone
    const cav_pair *pair = model->pair + rows->contact[i][0];
    cav_contact gone = {.pair = rows->contact[i][0], .dim = 3};
    gone.link1 = model->geom[pair->geom1].link, gone.link2 = model->geom[pair->geom2].link;
    const cav_contact *contact = find(verification->state, rows->contact[i], i);
    if (!cav_verification_looks_at(verification, term, t, contact ? contact : &gone)) continue;
    int k = cav_verification_contact(verification, term, contact ? contact : &gone, out + n);
    for (int c = 0; c < k; c++) out[n + c] = contact ? out[n + c] / term->scale : NAN;
    n += k;
  }
  return n;
}

// position of a limited joint: of a ball its angle
static double joint_value(const cav_verification *verification, int t, int j) {
  const cav_joint *joint = verification->model->joint + j;
  const double *x = verification->q + (size_t)t * (size_t)verification->model->nq + joint->q;
  if (joint->type != CAV_JOINT_BALL) return *x;
  return 2 * atan2(sqrt(x[1] * x[1] + x[2] * x[2] + x[3] * x[3]), fabs(x[0]));
}

// value of a constraint that is not of a term; residual [nv]: what no actuator gives of the force; moment [nv]
static double read_limit(const cav_verification *verification, int t, const cav_knot_row *row, const double *residual,
                         double *moment) {
  const cav_model *model = verification->model;
  double range[2];
  if (row->kind == CAV_BINDING_EFFORT)
    return cav_verification_effort_row(verification, row->object, row->component,
                                       verification->control[t * model->nu + row->object],
                                       verification->v + (size_t)t * (size_t)model->nv, moment, range);
  if (row->kind == CAV_BINDING_JOINT) return joint_value(verification, t, row->object);
  if (row->kind == CAV_BINDING_TENDON) return verification->state->tendon_length[row->object];
  if (row->term) return residual[row->object] / verification->deviation[row->object];
  int line = cav_verification_is_line(model, row->object);
  return residual[row->object] / (verification->weight * (line ? 1 : verification->arm));
}

cav_status cav_knot_rows_read(const cav_verification *verification, int t, cav_knot_rows *rows, double *value) {
  const cav_model *model = verification->model;
  const cav_problem *p = verification->problem;
  int room = cav_constraint_check_room(verification) + 2 * model->nv, i = 0, single, whole;
  if (room > rows->work_room) {
    double *larger = realloc(rows->work, (size_t)room * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    rows->work = larger;
    rows->work_room = room;
  }
  double *residual = rows->work + rows->work_room - 2 * model->nv, *moment = residual + model->nv;
  if (t < verification->rows)
    cav_actuation(model, verification->state, verification->u + (size_t)t * (size_t)model->nv, residual,
                  verification->control + (size_t)t * (size_t)model->nu);
  for (int k = 0; k < p->nterm; k++)
    if (costs_at(verification, p->term + k, t)) i += read_term(verification, p->term + k, t, rows, value + i);
  for (; i < rows->n && rows->row[i].kind != CAV_BINDING_TERM; i++)
    value[i] = read_limit(verification, t, rows->row + i, residual, moment);
  for (int k = 0; k < p->nterm; k++)
    if (p->term[k].use != CAV_USE_COST && cav_verification_holds(verification, p->term + k, t, &single, &whole))
      i += read_term(verification, p->term + k, t, rows, value + i);
  assert(i == rows->n);
  return verification->failure->status;
}
