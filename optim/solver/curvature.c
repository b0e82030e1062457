/// What the Hessian of the Lagrangian has beside Gauss-Newton's, kept knot by knot, so that a part of it can be added to
/// a linearisation here or nearby: the unknowns' own (lagrangian.c), and where the step is free the row of its
/// logarithm, by differences of the knots' gradients.
#include "curvature.h"

#include <stdlib.h>
#include <string.h>

#include "lagrangian.h"

/// Difference of the step's logarithm.
static const double step_difference = 1e-5;

struct cav_curvature {
  int nknot, width, free_step; ///< width: 3nv
  double **block;              ///< [nknot][width*width] lower triangles
  double *step;                ///< [nknot*(width+1)] by the step's logarithm: of the columns, and its square
  double *before;              ///< [nknot*(width+1)] gradients at a shorter step
  double *x;                   ///< [unknowns]
};

cav_curvature *cav_curvature_new(const cav_transcription *tr) {
  cav_curvature *c = calloc(1, sizeof *c);
  if (!c) return NULL;
  c->nknot = tr->nknot;
  c->width = 3 * tr->nv;
  c->free_step = tr->free_step;
  size_t knots = (size_t)c->nknot, width = (size_t)c->width;
  c->block = calloc(knots, sizeof *c->block);
  c->step = calloc(2 * knots * (width + 1), sizeof(double));
  c->x = calloc((size_t)cav_transcription_unknowns(tr), sizeof(double));
  int whole = c->block && c->step && c->x;
  for (size_t t = 0; whole && t < knots; t++) whole = (c->block[t] = calloc(width * width, sizeof(double))) != NULL;
  if (whole) {
    c->before = c->step + knots * (width + 1);
    return c;
  }
  cav_curvature_free(c);
  return NULL;
}

void cav_curvature_free(cav_curvature *c) {
  if (!c) return;
  for (int t = 0; c->block && t < c->nknot; t++) free(c->block[t]);
  free(c->block), free(c->step), free(c->x);
  free(c);
}

/// Gradients of the knots' Lagrangians at a step whose logarithm is moved.
static cav_status gradients_beside(cav_curvature *c, cav_transcription *tr, const cav_trajectory *at,
                                   cav_trajectory *spare, double change, double *out) {
  size_t width = (size_t)c->width;
  c->x[cav_transcription_unknowns(tr) - 1] = change;
  cav_transcription_move(tr, at, c->x, spare);
  cav_status status = cav_transcription_linearise(tr, spare);
  for (int t = 0; t < c->nknot && status == CAV_OK; t++, out += width + 1) {
    const cav_knot *knot = &tr->knot[t];
    memcpy(out, knot->gradient, width * sizeof(double));
    out[width] = knot->step_derivative;
    for (int i = 0; i < knot->layout.count; i++) {
      double y = knot->slot[i].final_multiplier;
      const double *row = knot->slot_row + (size_t)i * width;
      for (size_t k = 0; k < width && y != 0; k++) out[k] += y * row[k];
      out[width] += y * knot->slot_step[i];
    }
  }
  return status;
}

/// The step's rows, less what the knots' Gauss-Newton has of them.
static cav_status find_step(cav_curvature *c, cav_transcription *tr, cav_trajectory *at, cav_trajectory *spare) {
  size_t width = (size_t)c->width, side = width + 1;
  double change = step_difference, steps = tr->nknot - 1;
  cav_penalties kept = tr->penalty;
  tr->penalty = (cav_penalties){0};
  // both sides of the step, or of where its bounds let both be
  int high = at->timestep * (1 + 2 * change) > tr->problem->duration_most / steps;
  int low = at->timestep * (1 - 2 * change) < tr->problem->duration_least / steps;
  cav_status status = gradients_beside(c, tr, at, spare, low ? 0 : -change, c->before);
  if (status == CAV_OK) status = gradients_beside(c, tr, at, spare, high ? 0 : change, c->step);
  if (status == CAV_OK) status = cav_transcription_linearise(tr, at);
  double distance = (2 - (low != 0) - (high != 0)) * change;
  for (int t = 0; t < c->nknot && status == CAV_OK; t++) {
    const cav_knot *knot = &tr->knot[t];
    double *row = c->step + (size_t)t * side, *before = c->before + (size_t)t * side;
    for (size_t k = 0; k < side; k++) {
      row[k] = distance > 0 ? (row[k] - before[k]) / distance : 0;
      if (distance > 0) row[k] -= k < width ? knot->step_row[k] : knot->step_square;
    }
  }
  tr->penalty = kept;
  return status;
}

/// Exchanges the knots' Hessians for the blocks, or back.
static void exchange(cav_curvature *c, cav_transcription *tr) {
  for (int t = 0; t < c->nknot; t++) {
    double *kept = tr->knot[t].hessian;
    tr->knot[t].hessian = c->block[t];
    c->block[t] = kept;
  }
}

cav_status cav_curvature_find(cav_curvature *c, cav_transcription *tr, cav_trajectory *at, cav_trajectory *spare,
                              const double *multiplier, const char *chosen) {
  size_t width = (size_t)c->width;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].final_multiplier = *multiplier++;
  cav_status status = c->free_step ? find_step(c, tr, at, spare) : CAV_OK;
  if (status == CAV_OK) status = cav_transcription_linearise(tr, at);
  if (status != CAV_OK) return status;
  for (int t = 0; t < c->nknot; t++)
    if (!chosen || chosen[t]) memset(c->block[t], 0, width * width * sizeof(double));
  exchange(c, tr);
  status = cav_lagrangian_curvature(tr, at, 1, chosen);
  exchange(c, tr);
  return status;
}

void cav_curvature_add(const cav_curvature *c, cav_transcription *tr, double fraction) {
  size_t width = (size_t)c->width;
  for (int t = 0; t < c->nknot; t++) {
    const double *block = c->block[t], *row = c->step + (size_t)t * (width + 1);
    cav_knot *knot = &tr->knot[t];
    for (size_t i = 0; i < width; i++)
      for (size_t j = 0; j <= i; j++) knot->hessian[i * width + j] += fraction * block[i * width + j];
    for (size_t j = 0; j < width; j++) knot->step_row[j] += fraction * row[j];
    knot->step_square += fraction * row[width];
  }
}
