/// Normal equations of a transcription, block-banded with a border, and their Cholesky factor (LAPACK's dpbtrf). Three
/// neighbouring knots fill the band, so a general sparse factorisation has nothing to leave out.
/// In a cycle the last two knots meet the first two, and a free step meets all: these unknowns stand last, as a dense border.
/// With A = L L' the band, B the border's rows and C its corner, Y = L^-1 B' leaves S = C - Y'Y, which is factored densely.
#include "normal_equations.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "lapack.h"

/// Last row of the core's H(:, j) that is not zero by structure.
static int end_of(const cav_normal *normal, int j) {
  int end = (j / normal->n + 3) * normal->n;
  return end < normal->core ? end : normal->core;
}

/// Whether H(core + i, j), j in the core, can be anything but zero.
static int meets(const cav_normal *normal, int i, int j) {
  int row = (normal->core + i) / normal->n, column = j / normal->n;
  if (normal->core + i >= normal->blocks * normal->n) return 1;
  return row - column <= 2 || row - column >= normal->blocks - 2;
}

cav_normal *cav_normal_new(const cav_transcription *tr) {
  cav_normal *normal = calloc(1, sizeof *normal);
  if (!normal) return NULL;
  normal->blocks = tr->nknot - 1;
  normal->n = tr->nv;
  normal->size = cav_transcription_unknowns(tr);
  normal->cyclic = tr->periodicity != NULL;
  normal->free_step = tr->free_step;
  normal->core = (normal->blocks - (normal->cyclic ? 2 : 0)) * normal->n;
  normal->border = normal->size - normal->core;
  normal->band = 3 * normal->n;
  size_t size = (size_t)normal->size, core = (size_t)normal->core, border = (size_t)normal->border;
  size_t entries = core * (size_t)normal->band;
  normal->H = calloc(entries, sizeof(double));
  normal->factor = malloc(entries * sizeof(double));
  normal->B = calloc(2 * core * border + 1, sizeof(double));
  normal->C = calloc(2 * border * border + 1, sizeof(double));
  normal->gradient = malloc(size * sizeof(double));
  normal->diagonal = malloc(size * sizeof(double));
  if (normal->H && normal->factor && normal->B && normal->C && normal->gradient && normal->diagonal) {
    normal->Y = normal->B + core * border;
    normal->S = normal->C + border * border;
    return normal;
  }
  cav_normal_free(normal);
  return NULL;
}

void cav_normal_free(cav_normal *normal) {
  if (!normal) return;
  free(normal->H), free(normal->factor), free(normal->B), free(normal->C), free(normal->gradient),
      free(normal->diagonal);
  free(normal);
}

/// Place of H(i, j), in either order.
static double *entry_of(const cav_normal *normal, int i, int j) {
  if (i < j) {
    int swap = i;
    i = j, j = swap;
  }
  int core = normal->core;
  if (i < core) return &normal->H[(size_t)j * normal->band + (size_t)(i - j)];
  if (j < core) return &normal->B[(size_t)(i - core) * core + j];
  return &normal->C[(size_t)(j - core) * normal->border + (i - core)];
}

/// Adds the part of a knot's Hessian between two of its blocks, the column's not after the row's.
static void gather_blocks(cav_normal *normal, const cav_knot *knot, int row_block, int column_block, int r, int c) {
  int n = normal->n, width = 3 * n;
  for (int j = 0; j < n; j++) {
    // entries of a column lie evenly
    int first = r == c ? j : 0, row = row_block * n + first, column = column_block * n + j;
    double *out = entry_of(normal, row, column);
    ptrdiff_t stride = first + 1 < n ? entry_of(normal, row + 1, column) - out : 0;
    const double *in = knot->hessian + (size_t)(r * n + first) * width + c * n + j;
    for (int i = first; i < n; i++, out += stride, in += width) *out += *in;
  }
}

/// Adds what the step's logarithm meets.
static void gather_step(cav_normal *normal, const cav_transcription *tr, int t) {
  const cav_knot *knot = &tr->knot[t];
  int n = normal->n, last = normal->size - 1;
  for (int c = 0; c < 3; c++) {
    int block = cav_transcription_block(tr, t, c);
    for (int j = 0; block >= 0 && j < n; j++) *entry_of(normal, last, block * n + j) += knot->step_row[c * n + j];
  }
  *entry_of(normal, last, last) += knot->step_square;
  normal->gradient[last] += knot->step_derivative;
}

void cav_normal_gather(cav_normal *normal, const cav_transcription *tr) {
  int n = normal->n;
  size_t core = (size_t)normal->core, border = (size_t)normal->border;
  memset(normal->H, 0, core * (size_t)normal->band * sizeof(double));
  memset(normal->B, 0, core * border * sizeof(double));
  memset(normal->C, 0, border * border * sizeof(double));
  memset(normal->gradient, 0, (size_t)normal->size * sizeof(double));
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    for (int c = 0; c < 3; c++) {
      int column = cav_transcription_block(tr, t, c);
      for (int j = 0; column >= 0 && j < n; j++) normal->gradient[column * n + j] += knot->gradient[c * n + j];
      for (int r = c; column >= 0 && r < 3; r++) {
        int row = cav_transcription_block(tr, t, r);
        if (row >= 0) gather_blocks(normal, knot, row, column, r, c);
      }
    }
    if (normal->free_step) gather_step(normal, tr, t);
  }
  for (int j = 0; j < normal->size; j++) normal->diagonal[j] = *entry_of(normal, j, j);
}

const double *cav_normal_gradient(const cav_normal *normal) { return normal->gradient; }
const double *cav_normal_diagonal(const cav_normal *normal) { return normal->diagonal; }

void cav_normal_hold(cav_normal *normal) {
  int last = normal->size - 1;
  for (int j = 0; j < last; j++) *entry_of(normal, last, j) = 0;
  *entry_of(normal, last, last) = normal->diagonal[last] = 1;
  normal->gradient[last] = 0;
}

/// A diagonal entry of H as it is factored.
static double lifted(const cav_normal *normal, int j, double shift) {
  return normal->diagonal[j] > 0 ? normal->diagonal[j] * (1 + shift) : 1;
}

cav_status cav_normal_factor(cav_normal *normal, double shift) {
  int core = normal->core, border = normal->border, below = normal->band - 1, info = 0;
  double one = 1, minus = -1;
  memcpy(normal->factor, normal->H, (size_t)core * (size_t)normal->band * sizeof(double));
  for (int j = 0; j < core; j++) normal->factor[(size_t)j * normal->band] = lifted(normal, j, shift);
  dpbtrf_("L", &core, &below, normal->factor, &normal->band, &info);
  if (info != 0) return CAV_NOT_CONVERGED;
  if (border == 0) return CAV_OK;

  // border: Y = L^-1 B', S = C - Y'Y
  memcpy(normal->Y, normal->B, (size_t)core * (size_t)border * sizeof(double));
  memcpy(normal->S, normal->C, (size_t)border * (size_t)border * sizeof(double));
  for (int i = 0; i < border; i++) normal->S[(size_t)i * border + i] = lifted(normal, core + i, shift);
  dtbtrs_("L", "N", "N", &core, &below, &border, normal->factor, &normal->band, normal->Y, &core, &info);
  if (info != 0) return CAV_NOT_CONVERGED;
  dsyrk_("L", "T", &border, &core, &minus, normal->Y, &core, &one, normal->S, &border);
  dpotrf_("L", &border, normal->S, &border, &info);
  return info == 0 ? CAV_OK : CAV_NOT_CONVERGED;
}

void cav_normal_solve(const cav_normal *normal, const double *b, double *x) {
  int core = normal->core, border = normal->border, below = normal->band - 1, once = 1, info = 0;
  double one = 1, minus = -1;
  memcpy(x, b, (size_t)normal->size * sizeof *x);
  // down the band, across the border, up the band
  dtbtrs_("L", "N", "N", &core, &below, &once, normal->factor, &normal->band, x, &core, &info);
  if (border > 0) {
    dgemv_("T", &core, &border, &minus, normal->Y, &core, x, &once, &one, x + core, &once);
    dpotrs_("L", &border, &once, normal->S, &border, x + core, &border, &info);
    dgemv_("N", &core, &border, &minus, normal->Y, &core, x + core, &once, &one, x, &once);
  }
  dtbtrs_("L", "T", "N", &core, &below, &once, normal->factor, &normal->band, x, &core, &info);
}

void cav_normal_multiply(const cav_normal *normal, const double *x, double *product) {
  int core = normal->core, border = normal->border;
  memset(product, 0, (size_t)normal->size * sizeof(double));
  for (int j = 0; j < core; j++) {
    const double *H = normal->H + (size_t)j * normal->band - j;
    int end = end_of(normal, j);
    double sum = H[j] * x[j];
    for (int i = j + 1; i < end; i++) {
      product[i] += H[i] * x[j];
      sum += H[i] * x[i];
    }
    product[j] += sum;
  }
  for (int i = 0; i < border; i++) {
    const double *B = normal->B + (size_t)i * core;
    double sum = 0;
    for (int j = 0; j < core; j++) sum += B[j] * x[j], product[j] += B[j] * x[core + i];
    for (int j = 0; j < border; j++) sum += *entry_of(normal, core + i, core + j) * x[core + j];
    product[core + i] += sum;
  }
}

/// Row of the entry after (i, j) in column j of the lower triangle; the size at its end.
static int next_row(const cav_normal *normal, int i, int j) {
  i++;
  if (j >= normal->core) return i;
  if (i < normal->core && i == end_of(normal, j)) i = normal->core;
  while (i >= normal->core && i < normal->size && !meets(normal, i - normal->core, j)) i++;
  return i;
}

int cav_normal_entries(const cav_normal *normal, int *row, int *col, double *value) {
  int entries = 0;
  for (int j = 0; j < normal->size; j++) {
    for (int i = j; i < normal->size; i = next_row(normal, i, j)) {
      if (row) row[entries] = i;
      if (col) col[entries] = j;
      if (value) value[entries] = *entry_of(normal, i, j);
      entries++;
    }
  }
  return entries;
}

void cav_normal_shift_entries(const cav_normal *normal, double factor, double absolute, double fraction,
                              double *value) {
  for (int j = 0, k = 0; j < normal->size; j++) {
    value[k] = factor * value[k] + absolute + fraction * normal->diagonal[j];
    k++;
    for (int i = next_row(normal, j, j); i < normal->size; i = next_row(normal, i, j)) value[k++] *= factor;
  }
}
