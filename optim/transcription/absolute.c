/// Hessians of absolute norms, phi(x) = sqrt(1 + x^2) - 1. Newton's method sees a kink only when it has stepped over it,
/// and the square that stands for phi in Gauss-Newton's bends too much far off, so that it creeps. With w = phi'(x) as an
/// unknown of its own, w sqrt(1 + x^2) = x linearised in both makes phi bend by (1 - w x/root)/root, which is no
/// less than 0 while |w| <= 1, right at a solution, and that of the tightest parabola above phi where w is 0 (Chan, Golub and
/// Mulet 1999, for total variation).
#include <math.h>
#include <stdlib.h>

#include "transcription.h"

/// Least curvature, as a fraction of that of the parabola: forces are divided by its root.
static const double least = 1e-6;

double cav_absolute_curvature(const cav_absolute *row) {
  double root = sqrt(1 + row->x * row->x);
  return fmax(1 - row->dual * row->x / root, least) / root;
}

/// Rows of a cost at a knot, at most.
static int rows_most(const cav_transcription *tr, const cav_term *term) {
  if (term->use != CAV_USE_COST || term->norm != CAV_NORM_ABSOLUTE) return 0;
  int forces = term->quantity == CAV_QUANTITY_EFFORT || term->quantity == CAV_QUANTITY_POWER;
  return cav_term_is_reading(term) ? cav_term_dim(term) : forces ? tr->model->nu : tr->nv;
}

int cav_absolute_begin(cav_transcription *tr) {
  int n = 0, ok = 1;
  for (int i = 0; i < tr->problem->nterm; i++) n += rows_most(tr, &tr->problem->term[i]);
  for (int t = 0; t < tr->nknot && n > 0; t++) {
    tr->knot[t].absolute = calloc((size_t)n, sizeof(cav_absolute));
    tr->knot[t].nabsolute = tr->knot[t].absolute ? n : 0;
    ok = ok && tr->knot[t].absolute;
  }
  return ok;
}

void cav_absolute_drop(cav_transcription *tr) {
  for (int t = 0; t < tr->nknot; t++) {
    free(tr->knot[t].absolute);
    tr->knot[t].absolute = NULL;
    tr->knot[t].nabsolute = 0;
  }
}

static void advance(cav_absolute *row, double fraction) {
  double x = row->before, root = sqrt(1 + x * x), bend = (1 - row->dual * x / root) / root;
  if (fraction > 0) row->dual += fraction * (x / root - row->dual) + bend * (row->x - x);
  row->dual = fmin(fmax(row->dual, -1), 1);
  row->before = row->x;
}

int cav_absolute_advance(cav_transcription *tr, double fraction) {
  int any = 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].nabsolute; i++, any = 1) advance(&tr->knot[t].absolute[i], fraction);
  return any;
}
