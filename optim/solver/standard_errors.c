/// Standard errors of an estimated motion: with the cost as minus the logarithm of a likelihood its Hessian is the
/// information (information.c), and its inverse along the constraints the covariance of the unknowns (Cramer, Rao). The
/// inverse is taken where the band has entries alone, which is what positions, velocities and forces of a knot depend on: a
/// row r over the three knots about it has the deviation |r G|, with G G' their covariance (row_factor.c).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "information.h"
#include "problem_check.h"
#include "readings.h"

/// What is being found.
typedef struct estimate {
  cav_transcription *tr;
  cav_information of;
  cav_standard_errors *out;
  double *row;   ///< [nv*3nv] rows over three knots
  double *unit;  ///< [3nv] a row over (q, v, v_next)
  double *image; ///< [nv*(3nv+border)] rows times G
} estimate;

void cav_standard_errors_free(cav_standard_errors *e) {
  if (!e) return;
  free(e->q), free(e->v), free(e->u), free(e->force), free(e->covariance);
  free(e);
}

static cav_standard_errors *make(const cav_model *m, int nknot) {
  cav_standard_errors *e = calloc(1, sizeof *e);
  size_t n = (size_t)nknot, nv = (size_t)m->nv;
  if (!e) return NULL;
  e->nknot = nknot, e->nq = m->nq, e->nv = m->nv, e->nu = m->nu;
  e->q = calloc(n * nv + 1, sizeof(double));
  e->v = calloc(n * nv + 1, sizeof(double));
  e->u = calloc(n * nv + 1, sizeof(double));
  e->force = calloc(n * (size_t)m->nu + 1, sizeof(double));
  e->covariance = calloc(n * nv * nv + 1, sizeof(double));
  if (e->q && e->v && e->u && e->force && e->covariance) return e;
  cav_standard_errors_free(e);
  return NULL;
}

/// Turns n rows over the columns of knot t, in f->row, into those over the unknowns across the seam of a cycle.
static void wrap(estimate *f, int t, int n) {
  const cav_transcription *tr = f->tr;
  if (tr->periodicity && (t < 2 || t == tr->nknot - 1)) cav_transcription_wrap(tr, &tr->scratch[0], t, n, f->row);
}

/// n rows over the unknowns about knot t times G, of the block that the factor has gone back to.
static void multiply(estimate *f, int t, int n) {
  wrap(f, t, n);
  cav_information_spread(&f->of, t, n, f->row, f->image);
}

/// Covariance of rows i and j that were multiplied.
static double covariance(const estimate *f, int i, int j) {
  size_t across = (size_t)(3 * f->tr->nv + f->of.factor.border);
  double sum = 0;
  for (size_t k = 0; k < across; k++) sum += f->image[(size_t)i * across + k] * f->image[(size_t)j * across + k];
  return sum;
}

/// Errors of n rows.
static void note(estimate *f, int t, int n, double *out) {
  multiply(f, t, n);
  for (int i = 0; i < n; i++) out[i] = sqrt(covariance(f, i, i));
}

/// Rows of q (kind 0) or v (1) of knot t.
static void lay_states(estimate *f, int t, int kind) {
  size_t nv = (size_t)f->tr->nv;
  for (size_t d = 0; d < nv; d++) {
    memset(f->unit, 0, 3 * nv * sizeof(double));
    f->unit[(size_t)kind * nv + d] = 1;
    cav_transcription_chain(f->tr, t, 1, f->unit, f->row + d * 3 * nv);
  }
}

/// Row of an actuator's force.
static void lay_actuator(estimate *f, int t, int actuator) {
  const cav_force_row *form = &f->tr->effort[actuator];
  size_t width = 3 * (size_t)f->tr->nv;
  memset(f->row, 0, width * sizeof(double));
  for (int k = 0; k < form->n; k++)
    for (size_t c = 0; c < width; c++)
      f->row[c] += f->tr->effort_unit[actuator] * form->coef[k] * f->tr->knot[t].du[(size_t)form->dof[k] * width + c];
}

static void find_knot(estimate *f, int t) {
  const cav_transcription *tr = f->tr;
  cav_standard_errors *e = f->out;
  int nv = tr->nv, nu = tr->model->nu, has_force = tr->knot[t].has_force;
  size_t at = (size_t)t * (size_t)nv, control = (size_t)t * (size_t)nu;
  lay_states(f, t, 1);
  note(f, t, nv, e->v + at);
  lay_states(f, t, 0);
  note(f, t, nv, e->q + at);
  for (int i = 0; i < nv; i++)
    for (int j = 0; j < nv; j++) e->covariance[(at + (size_t)i) * (size_t)nv + (size_t)j] = covariance(f, i, j);
  memcpy(f->row, tr->knot[t].du, 3 * (size_t)nv * (size_t)nv * sizeof(double));
  note(f, t, nv, e->u + at);
  for (int d = 0; d < nv && !has_force; d++) e->u[at + (size_t)d] = NAN;
  for (int a = 0; a < nu; a++) {
    lay_actuator(f, t, a);
    note(f, t, 1, e->force + control + a);
    if (!has_force) e->force[control + (size_t)a] = NAN;
  }
}

/// Everything at the motion, whose transcription is made.
static cav_status find(estimate *f, cav_trajectory *at, const cav_options *contact, int nrow, const cav_binding *row) {
  cav_transcription *tr = f->tr;
  size_t nv = (size_t)tr->nv;
  tr->options = *contact;
  tr->penalty = (cav_penalties){0};
  tr->gradient_only = 1;
  f->out = make(tr->model, tr->nknot);
  if (!f->out || !cav_transcription_keep_rows(tr)) return CAV_NO_MEMORY;
  cav_status status = cav_transcription_linearise(tr, at);
  if (status == CAV_OK) status = cav_information_begin(&f->of, tr, 0);
  f->row = malloc((3 * nv * nv + 3 * nv + nv * (3 * nv + (size_t)f->of.factor.border) + 1) * sizeof(double));
  if (status == CAV_OK && !f->row) status = CAV_NO_MEMORY;
  if (status != CAV_OK) return status;
  f->unit = f->row + 3 * nv * nv;
  f->image = f->unit + 3 * nv;
  status = cav_information_factor(&f->of, nrow, row);
  for (int b = f->of.core - 1; b >= 0 && status == CAV_OK; b--) {
    cav_row_factor_back(&f->of.factor, b);
    for (int t = 0; t < tr->nknot; t++)
      if (cav_information_block(&f->of, t) == b) find_knot(f, t);
  }
  return status;
}

static cav_status fail(cav_error *error, cav_status status, const char *text) {
  if (error) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "standard errors: %s", text);
  }
  return status;
}

cav_status cav_standard_errors_find(const cav_problem *problem, const cav_trajectory *motion,
                                    const cav_options *contact, int nrow, const cav_binding *row,
                                    cav_standard_errors **errors, cav_error *error) {
  estimate f = {0};
  *errors = NULL;
  cav_status status = cav_problem_check(problem, 0, error);
  if (status != CAV_OK) return status;
  if (problem->duration_most > 0)
    return fail(error, CAV_NOT_SUPPORTED, "not of a motion with a free duration; fix it with <horizon duration>");
  if (!(f.tr = cav_transcription_new(problem, 1, error))) return error ? error->status : CAV_NO_MEMORY;
  cav_trajectory *at = NULL;
  if (motion->nknot != f.tr->nknot || motion->nv != f.tr->nv || motion->nq != problem->model->nq)
    status = fail(error, CAV_BAD_INPUT, "the motion is not one of the problem: other knots or another model");
  else
    status = (at = cav_trajectory_copy(motion)) ? find(&f, at, contact, nrow, row) : CAV_NO_MEMORY;
  if (status == CAV_NO_MEMORY) fail(error, status, "not enough memory");
  if (status == CAV_NOT_CONVERGED)
    fail(error, status,
         "neither costs nor dynamics tell anything of one of the unknowns; a small weight of <velocity> or <posture> "
         "on all dofs does");
  if (status == CAV_NOT_FINITE) fail(error, status, "the motion cannot be evaluated");
  if (status == CAV_OK) *errors = f.out, f.out = NULL;
  cav_standard_errors_free(f.out);
  cav_trajectory_free(at);
  cav_information_clear(&f.of);
  free(f.row);
  cav_transcription_free(f.tr);
  return status;
}
