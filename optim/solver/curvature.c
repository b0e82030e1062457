/// Hessian of the Lagrangian by differences of its gradient. A knot sees three neighbouring blocks of unknowns, so
/// blocks that no knot sees together are moved at once: three colours (up to five in cycles), and the step's logarithm
/// where that is free. Symmetrised; what Gauss-Newton has of it is subtracted, so the sum stays right where the costs'
/// residuals move on.
#include "curvature.h"

#include <stdlib.h>
#include <string.h>

/// Difference of an unknown, rad or m, for a step of one second: what moves a knot by it moves rates by this, whatever
/// the step.
static const double rate_difference = 1e-4;

/// Difference of the step's logarithm.
static const double step_difference = 1e-5;

struct cav_curvature {
  int nknot, width, free_step; ///< width: 3nv
  double *block;               ///< [nknot*(width+1)*(width+1)] row-major
  double *base, *moved;        ///< [nknot*(width+1)] gradients
  double *x;                   ///< [unknowns]
};

cav_curvature *cav_curvature_new(const cav_transcription *tr) {
  cav_curvature *c = calloc(1, sizeof *c);
  if (!c) return NULL;
  c->nknot = tr->nknot;
  c->width = 3 * tr->nv;
  c->free_step = tr->free_step;
  size_t knots = (size_t)c->nknot, side = (size_t)c->width + 1;
  c->block = calloc(knots * side * side, sizeof(double));
  c->base = malloc(2 * knots * side * sizeof(double));
  c->x = calloc((size_t)cav_transcription_unknowns(tr), sizeof(double));
  if (c->block && c->base && c->x) {
    c->moved = c->base + knots * side;
    return c;
  }
  cav_curvature_free(c);
  return NULL;
}

void cav_curvature_free(cav_curvature *c) {
  if (!c) return;
  free(c->block), free(c->base), free(c->x);
  free(c);
}

/// Gradients of the knots' Lagrangians at the last linearisation.
static void read_gradients(const cav_curvature *c, const cav_transcription *tr, const double *multiplier, double *out) {
  size_t width = (size_t)c->width;
  for (int t = 0; t < c->nknot; t++, out += width + 1) {
    const cav_knot *knot = &tr->knot[t];
    memcpy(out, knot->gradient, width * sizeof(double));
    out[width] = knot->step_derivative;
    for (int i = 0; i < knot->layout.count; i++, multiplier++) {
      if (*multiplier == 0) continue;
      const double *row = knot->slot_row + (size_t)i * width;
      for (size_t k = 0; k < width; k++) out[k] += *multiplier * row[k];
      if (c->free_step) out[width] += *multiplier * knot->slot_step[i];
    }
  }
}

/// Colour of a block: no knot sees two of one.
static int colour_of(const cav_transcription *tr, int block) {
  int blocks = tr->nknot - 1, whole = tr->periodicity ? blocks - blocks % 3 : blocks;
  return block < whole ? block % 3 : 3 + block - whole;
}

/// Gradients with the chosen unknowns moved, and what that says of the knots' columns.
static cav_status move(cav_curvature *c, cav_transcription *tr, const cav_trajectory *at, cav_trajectory *spare,
                       const double *multiplier, int colour, int dof) {
  int nv = tr->nv, side = c->width + 1, last = cav_transcription_unknowns(tr) - 1;
  double change = rate_difference * at->timestep;
  memset(c->x, 0, (size_t)(last + 1) * sizeof(double));
  for (int b = 0; b < tr->nknot - 1; b++)
    if (colour_of(tr, b) == colour) c->x[b * nv + dof] = change;
  if (colour < 0) {
    // the step's logarithm, away from its upper bound
    int high = at->timestep * (1 + 2 * step_difference) > tr->problem->duration_most / (tr->nknot - 1);
    c->x[last] = change = high ? -step_difference : step_difference;
  }
  cav_transcription_move(tr, at, c->x, spare);
  cav_status status = cav_transcription_linearise(tr, spare);
  if (status != CAV_OK) return status;
  read_gradients(c, tr, multiplier, c->moved);
  for (int t = 0; t < c->nknot; t++) {
    for (int k = 0; k < 3; k++) {
      int b = cav_transcription_block(tr, t, k), column = colour < 0 ? c->width : k * nv + dof;
      if (colour >= 0 && (b < 0 || colour_of(tr, b) != colour)) continue;
      double *block = c->block + (size_t)t * (size_t)side * (size_t)side;
      const double *base = c->base + (size_t)t * (size_t)side, *moved = c->moved + (size_t)t * (size_t)side;
      for (int i = 0; i < side; i++) block[i * side + column] = (moved[i] - base[i]) / change;
    }
  }
  return CAV_OK;
}

/// Symmetrises the blocks and takes off what the knots' Hessians have.
static void finish(cav_curvature *c, const cav_transcription *tr) {
  int width = c->width, side = width + 1;
  for (int t = 0; t < c->nknot; t++) {
    double *block = c->block + (size_t)t * (size_t)side * (size_t)side;
    const cav_knot *knot = &tr->knot[t];
    for (int i = 0; i < side; i++) {
      for (int j = 0; j <= i; j++) {
        double mean = 0.5 * (block[i * side + j] + block[j * side + i]);
        if (i < width) mean -= knot->hessian[(size_t)i * (size_t)width + (size_t)j];
        if (i == width) mean -= j < width ? knot->step_row[j] : knot->step_square;
        block[i * side + j] = block[j * side + i] = mean;
      }
    }
  }
}

cav_status cav_curvature_find(cav_curvature *c, cav_transcription *tr, cav_trajectory *at, cav_trajectory *spare,
                              const double *multiplier) {
  size_t side = (size_t)c->width + 1;
  cav_penalties kept = tr->penalty;
  memset(c->block, 0, (size_t)c->nknot * side * side * sizeof(double));
  tr->penalty = (cav_penalties){0};
  cav_status status = cav_transcription_linearise(tr, at);
  if (status == CAV_OK) read_gradients(c, tr, multiplier, c->base);
  tr->gradient_only = 1;
  for (int colour = 0; colour < 5 && status == CAV_OK; colour++) {
    if (colour > 2 && !tr->periodicity) break;
    for (int d = 0; d < tr->nv && status == CAV_OK; d++) status = move(c, tr, at, spare, multiplier, colour, d);
  }
  if (status == CAV_OK && c->free_step) status = move(c, tr, at, spare, multiplier, -1, 0);
  tr->gradient_only = 0;
  if (status == CAV_OK) status = cav_transcription_linearise(tr, at);
  if (status == CAV_OK) finish(c, tr);
  tr->penalty = kept;
  return status;
}

void cav_curvature_add(const cav_curvature *c, cav_transcription *tr, double fraction) {
  int width = c->width, side = width + 1;
  for (int t = 0; t < c->nknot; t++) {
    const double *block = c->block + (size_t)t * (size_t)side * (size_t)side;
    cav_knot *knot = &tr->knot[t];
    for (int i = 0; i < width; i++)
      for (int j = 0; j <= i; j++)
        knot->hessian[(size_t)i * (size_t)width + (size_t)j] += fraction * block[i * side + j];
    for (int j = 0; j < width; j++) knot->step_row[j] += fraction * block[width * side + j];
    knot->step_square += fraction * block[width * side + width];
  }
}
