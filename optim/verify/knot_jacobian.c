/// Centred differences of a knot's rows: an unknown acts on its own knot and the two beside it, through the velocities
/// between them; in cycles the first knot is an unknown and the last one its image. A free start has the step times v_0
/// as its first block, in the place of a knot before it. What an evaluation shares with the
/// one before it (the position, and the velocity that reaches the knot) is not done again.
#include "knot_jacobian.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Differences: of a velocity (rad/s or m/s), of the step's logarithm.
static const double rate_difference = 5e-5, step_difference = 1e-6;

// first block's knot: the one before is given; -1: the velocity of a free start
static int first_of(const cav_knot_jacobian *s) { return s->at.image ? 0 : s->at.problem->free_start ? -1 : 1; }

// block that knot t sees as its c-th: before it, its own, after it; -1: none
static int block_of(const cav_knot_jacobian *s, int t, int c) {
  int k = t - 1 + c;
  if (s->at.image) return (k + s->blocks) % s->blocks;
  return k >= first_of(s) && k <= s->at.last ? k - first_of(s) : -1;
}

// the unknown that column c of knot t is, -1: none
int cav_knot_jacobian_unknown(const cav_knot_jacobian *s, int t, int c) {
  int nv = s->at.model->nv;
  if (c == 3 * nv) return s->unknowns - 1;
  int block = block_of(s, t, c / nv);
  return block < 0 ? -1 : block * nv + c % nv;
}

// how far a column is moved for differences
static double distance(const cav_knot_jacobian *s, int c) {
  return c == 3 * s->at.model->nv ? step_difference : rate_difference * s->base->h;
}

static void velocity(cav_knot_jacobian *s, int t) {
  const cav_model *model = s->at.model;
  cav_difference(model, s->q + (size_t)(t - 1) * (size_t)model->nq, s->q + (size_t)t * (size_t)model->nq, s->at.h,
                 s->at.v + (size_t)t * (size_t)model->nv);
}

// velocities that reach and leave knot t, from the knots
static void velocities(cav_knot_jacobian *s, int t) {
  size_t nv = (size_t)s->at.model->nv;
  int last = s->at.last;
  double *v = s->at.v, *reach = v + (size_t)last * nv, *leave = reach + nv;
  if (t > 0) velocity(s, t);
  for (size_t d = 0; t == 0 && s->at.problem->free_start && d < nv; d++)
    v[d] = (s->base->h * s->base->v[d] + s->push[d]) / s->at.h;
  if (t < last) velocity(s, t + 1);
  if (s->at.image && t == 0) {
    velocity(s, last);
    cav_cycle_image_tangent(s->at.image, -1, reach, v);
  } else if (s->at.image && t == last) {
    velocity(s, 1);
    cav_cycle_image_tangent(s->at.image, 1, v + nv, leave);
  } else if (t == last && !s->at.problem->close_at_rest) {
    memcpy(leave, reach, nv * sizeof *v);
  }
}

// the step's logarithm moved by delta, and the law at that step
static void move_step(cav_knot_jacobian *s, double delta) {
  double factor = exp(delta);
  s->at.h = s->base->h * factor;
  s->at.law = s->base->law;
  if (delta != 0) {
    s->at.law.timestep = s->at.h;
    s->at.law.time_constant *= factor;
  }
  s->at.state->options = s->at.law;
}

// column of knot t (-1: none) moved by a distance from where the motion has it, and what follows at the knot
static void move(cav_knot_jacobian *s, int t, int column, double delta) {
  const cav_model *model = s->at.model;
  int nv = model->nv;
  size_t nq = (size_t)model->nq;
  for (int c = 0; c < 3; c++) {
    int block = block_of(s, t, c);
    if (block < 0) continue;
    if (first_of(s) < 0 && block == 0) {
      memset(s->push, 0, (size_t)nv * sizeof *s->push);
      if (column >= 0 && column / nv == c) s->push[column % nv] = delta;
      continue;
    }
    size_t k = (size_t)(block + first_of(s));
    memcpy(s->q + k * nq, s->base->q + k * nq, nq * sizeof *s->q);
    if (column >= 0 && column / nv == c) {
      memset(s->tangent, 0, (size_t)nv * sizeof *s->tangent);
      s->tangent[column % nv] = delta;
      cav_integrate(model, s->base->q + k * nq, s->tangent, 1, s->q + k * nq);
    }
    if (s->at.image && k == 0) cav_cycle_image_configuration(s->at.image, s->q, s->q + (size_t)s->at.last * nq);
  }
  move_step(s, column == 3 * nv ? delta : 0);
  velocities(s, t);
}

// ---------------------------------------------------------------- rows of a knot and their derivatives

// values of the listed rows where the unknowns are; what the last evaluation shares with this one is not done again
static cav_status read(cav_knot_jacobian *s, int t, double *value) {
  const cav_model *model = s->at.model;
  size_t nv = (size_t)model->nv, nq = (size_t)model->nq, k = (size_t)t;
  const double *q = s->q + k * nq, *v = s->at.v + k * nv;
  cav_stage unchanged = CAV_STAGE_NONE;
  if (s->evaluated == t && s->step == s->at.h && !memcmp(s->point, q, nq * sizeof *q))
    unchanged = memcmp(s->point + nq, v, nv * sizeof *v) ? CAV_STAGE_POSITION : CAV_STAGE_VELOCITY;
  s->evaluated = -1;
  s->at.state->options = cav_verification_law(&s->at, t);
  cav_status status = cav_inverse_from(model, s->at.state, unchanged, q, v, v + nv, s->at.u + k * nv);
  if (status != CAV_OK) return status;
  s->evaluated = t;
  s->step = s->at.h;
  memcpy(s->point, q, nq * sizeof *q);
  memcpy(s->point + nq, v, nv * sizeof *v);
  return value ? cav_knot_rows_read(&s->at, t, &s->rows, value) : CAV_OK;
}

// room for the rows that are listed
static cav_status make_room(cav_knot_jacobian *s) {
  if (s->rows.n <= s->room) return CAV_OK;
  size_t n = 2 * (size_t)s->rows.n;
  free(s->value), free(s->row);
  s->room = 0;
  s->value = malloc(3 * n * sizeof *s->value);
  s->row = malloc(n * (size_t)s->width * sizeof *s->row);
  if (!s->value || !s->row) return CAV_NO_MEMORY;
  s->room = (int)n;
  s->plus = s->value + n;
  s->minus = s->plus + n;
  return CAV_OK;
}

// column of the Jacobian from values on both sides; a contact that is there on one side only leaves that one
static void put_column(cav_knot_jacobian *s, int column, double delta) {
  for (int i = 0; i < s->rows.n; i++) {
    double a = s->minus[i], b = s->plus[i], is = s->value[i];
    double difference = isnan(a) && isnan(b) ? 0 : isnan(a) ? 2 * (b - is) : isnan(b) ? 2 * (is - a) : b - a;
    s->row[(size_t)i * (size_t)s->width + (size_t)column] = difference / (2 * delta);
  }
}

// the i-th column in the order in which less and less of an evaluation can be used again
static int column_at(const cav_knot_jacobian *s, int i) {
  static const int order[] = {2, 0, 1};
  int nv = s->at.model->nv;
  return i < 3 * nv ? order[i / nv] * nv + i % nv : i;
}

// lists the rows of knot t and reads them
static cav_status list(cav_knot_jacobian *s, int t, int nbinding, const cav_binding *binding) {
  const cav_model *model = s->at.model;
  move(s, t, -1, 0);
  cav_status status = read(s, t, NULL);
  if (status != CAV_OK) return status;
  // what the rows of efforts begin with
  cav_actuation(model, s->at.state, s->at.u + (size_t)t * (size_t)model->nv, NULL,
                s->at.control + (size_t)t * (size_t)model->nu);
  status = cav_knot_rows_list(&s->at, t, nbinding, binding, &s->rows);
  if (status == CAV_OK) status = make_room(s);
  return status == CAV_OK ? cav_knot_rows_read(&s->at, t, &s->rows, s->value) : status;
}

cav_status cav_knot_jacobian_find(cav_knot_jacobian *s, int t, int nbinding, const cav_binding *binding) {
  cav_status status = list(s, t, nbinding, binding);
  if (status != CAV_OK) return status;
  memset(s->row, 0, (size_t)s->rows.n * (size_t)s->width * sizeof *s->row);
  for (int i = 0; i < s->width && status == CAV_OK; i++) {
    int column = column_at(s, i);
    double delta = distance(s, column);
    if (cav_knot_jacobian_unknown(s, t, column) < 0) continue;
    move(s, t, column, delta);
    status = read(s, t, s->plus);
    move(s, t, column, -delta);
    if (status == CAV_OK) status = read(s, t, s->minus);
    if (status == CAV_OK) put_column(s, column, delta);
  }
  return status;
}

// ---------------------------------------------------------------- making

cav_status cav_knot_jacobian_start(cav_knot_jacobian *s, const cav_verification *base) {
  size_t nq = (size_t)base->model->nq, nv = (size_t)base->model->nv, n = (size_t)base->last + 1;
  *s = (cav_knot_jacobian){.base = base, .at = *base, .evaluated = -1};
  s->blocks = base->image ? base->last : base->last + 1 - first_of(s);
  s->free_step = base->problem->duration_most > 0;
  s->width = 3 * base->model->nv + s->free_step;
  s->unknowns = s->blocks * base->model->nv + s->free_step;
  s->q = malloc((n * nq + 1) * sizeof(double));
  s->at.q = s->q;
  s->at.v = malloc(((n + 1) * nv + 1) * sizeof(double));
  s->tangent = calloc(2 * nv + 1, sizeof(double));
  s->point = malloc((nq + nv + 1) * sizeof(double));
  if (!s->q || !s->at.v || !s->tangent || !s->point) return CAV_NO_MEMORY;
  s->push = s->tangent + nv;
  memcpy(s->q, base->q, n * nq * sizeof(double));
  memcpy(s->at.v, base->v, (n + 1) * nv * sizeof(double));
  return CAV_OK;
}

void cav_knot_jacobian_clear(cav_knot_jacobian *s) {
  cav_knot_rows_clear(&s->rows);
  free(s->q), free(s->at.v), free(s->tangent), free(s->point), free(s->value), free(s->row);
  *s = (cav_knot_jacobian){0};
}
