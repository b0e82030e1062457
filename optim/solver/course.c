#include "course.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "programme.h"

/// Part of the step, to both sides, from which its course is found.
static const double part = 0.03;

int cav_course_make(cav_course *c, const cav_transcription *tr, int rows) {
  *c = (cav_course){.n = cav_transcription_unknowns(tr), .rows = rows, .forces = tr->nknot * tr->nv};
  size_t n = (size_t)c->n, all = (size_t)(rows + c->forces);
  c->here = calloc(3 * all + (size_t)c->forces + 2 * n + (size_t)rows, sizeof(double));
  if (!c->here) return 0;
  c->behind = c->here + all;
  c->miss = c->behind + all;
  c->derivative = c->miss + all;
  c->bend = c->derivative + c->forces;
  c->x = c->bend + n;
  c->linear = c->x + n;
  return 1;
}

void cav_course_clear(cav_course *c) { free(c->here); }

/// Values of rows and forces [rows+forces].
static void read_all(const cav_transcription *tr, int rows, double *value) {
  cav_programme_values(tr, value);
  value += rows;
  for (int t = 0; t < tr->nknot; t++, value += tr->nv) memcpy(value, tr->knot[t].u, (size_t)tr->nv * sizeof(double));
}

void cav_course_begin(cav_course *c, const cav_transcription *tr) {
  read_all(tr, c->rows, c->here);
  c->known = 0;
}

/// What rows and forces change by on a part of the step.
static cav_status change_by(cav_course *c, cav_transcription *tr, const cav_quadratic *qp, double share,
                            const cav_trajectory *at, cav_trajectory *spare, double *change) {
  const double *step = cav_quadratic_step(qp);
  for (int i = 0; i < c->n; i++) c->x[i] = share * step[i];
  cav_transcription_move(tr, at, c->x, spare);
  cav_status status = cav_transcription_values(tr, spare);
  if (status != CAV_OK) return status;
  read_all(tr, c->rows, change);
  for (int k = 0; k < c->rows + c->forces; k++) change[k] -= c->here[k];
  return CAV_OK;
}

cav_status cav_course_find(cav_course *c, cav_transcription *tr, cav_quadratic *qp, const cav_trajectory *at,
                           cav_trajectory *spare) {
  c->known = 0;
  memcpy(c->linear, cav_quadratic_prediction(qp), (size_t)c->rows * sizeof *c->linear);
  cav_status status = change_by(c, tr, qp, -part, at, spare, c->behind);
  if (status == CAV_OK) status = change_by(c, tr, qp, part, at, spare, c->miss);
  if (status != CAV_OK) return status == CAV_NO_MEMORY || status == CAV_INTERRUPTED ? status : CAV_OK;
  for (int i = 0; i < c->forces; i++) c->derivative[i] = (c->miss[c->rows + i] - c->behind[c->rows + i]) / (2 * part);
  for (int k = 0; k < c->rows + c->forces; k++) c->miss[k] = (c->miss[k] + c->behind[k]) / (2 * part * part);
  cav_quadratic_correct(qp, c->miss, c->miss + c->rows, c->bend);
  c->known = 1;
  return CAV_OK;
}

void cav_course_correct(cav_course *c, const cav_transcription *tr, cav_quadratic *qp, double multiple, double *x) {
  const double *here = c->here + c->rows, part_way = fmin(multiple, 1);
  double *force = c->miss + c->rows;
  read_all(tr, c->rows, c->miss);
  for (int k = 0; k < c->rows; k++) c->miss[k] -= c->here[k] + part_way * (c->linear[k] - c->here[k]);
  for (int i = 0; i < c->forces; i++) force[i] -= here[i] + multiple * c->derivative[i];
  cav_quadratic_correct(qp, c->miss, c->known ? force : NULL, x);
}
