/// Rows of a banded least-squares problem to its triangular factor by Householder reflections, block by block: what is left of
/// the rows after a block's columns is triangular and goes on to the next (Bierman, Factorization Methods for Discrete
/// Sequential Estimation, 1977). Unlike the factor of the normal equations it keeps what rows of large weight leave of
/// others: its error is that of the root of the condition number.
///
/// The covariance (R'R)^-1 of three neighbouring blocks and the border follows from the last block on: with x_b =
/// R_bb^-1 (w - R_b,later x_later), w of covariance 1, and a factor F of the later ones' covariance, G = (R_bb^-1, -R_bb^-1
/// R_b,later F; 0, F) is one of all of them, made triangular again without the last block. Of products with G no difference is
/// taken, so variances keep their digits and their sign.
#include "row_factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t columns(const cav_row_factor *f) { return (size_t)(3 * f->n + f->border); }

cav_status cav_row_factor_begin(cav_row_factor *f, int n, int blocks, int border) {
  *f = (cav_row_factor){.n = n, .blocks = blocks, .border = border};
  size_t width = columns(f), later = width - (size_t)n, p = (size_t)border;
  f->R = calloc((size_t)blocks * (size_t)n * width + 1, sizeof(double));
  f->corner = calloc(p * p + 1, sizeof(double));
  f->spread = calloc(width * width, sizeof(double));
  f->factor = calloc(later * later, sizeof(double));
  f->product = malloc(width * sizeof(double));
  f->turned = malloc(width * later * sizeof(double));
  return f->R && f->corner && f->spread && f->factor && f->product && f->turned ? CAV_OK : CAV_NO_MEMORY;
}

void cav_row_factor_clear(cav_row_factor *f) {
  free(f->R), free(f->corner), free(f->spread), free(f->factor), free(f->product), free(f->turned), free(f->work);
  *f = (cav_row_factor){0};
}

void cav_row_factor_restart(cav_row_factor *f) {
  memset(f->R, 0, (size_t)f->blocks * (size_t)f->n * columns(f) * sizeof *f->R);
  memset(f->corner, 0, (size_t)f->border * (size_t)f->border * sizeof *f->corner);
  f->next = f->rows = 0;
}

double *cav_row_factor_add(cav_row_factor *f, int count) {
  size_t width = columns(f);
  if (f->rows + count > f->room) {
    int room = 2 * (f->rows + count);
    double *larger = realloc(f->work, (size_t)room * width * sizeof *larger);
    if (!larger) return NULL;
    f->work = larger;
    f->room = room;
  }
  double *out = f->work + (size_t)f->rows * width;
  memset(out, 0, (size_t)count * width * sizeof *out);
  f->rows += count;
  return out;
}

/// Reflects column j of a matrix [rows*width], its rows from the i-th on, onto the i-th; product [width] is scratch.
static void reflect(double *work, size_t rows, size_t width, size_t i, size_t j, double *product) {
  double *top = work + i * width, size = 0;
  for (size_t r = i; r < rows; r++) size += work[r * width + j] * work[r * width + j];
  if (size == 0) return;
  size = sqrt(size);
  double end = top[j] > 0 ? -size : size, head = top[j] - end, scale = -1 / (end * head);
  // product := v' W, W -= v product scale with v = (head, column below)
  for (size_t c = j + 1; c < width; c++) product[c] = head * top[c];
  for (size_t r = i + 1; r < rows; r++) {
    const double *row = work + r * width;
    for (size_t c = j + 1; c < width && row[j] != 0; c++) product[c] += row[j] * row[c];
  }
  for (size_t c = j + 1; c < width; c++) top[c] -= scale * head * product[c];
  for (size_t r = i + 1; r < rows; r++) {
    double *row = work + r * width;
    for (size_t c = j + 1; c < width && row[j] != 0; c++) row[c] -= scale * row[j] * product[c];
    row[j] = 0;
  }
  top[j] = end;
}

/// Makes a matrix triangular from a column on; the columns before it are zero.
static void make_triangular(double *work, size_t rows, size_t width, size_t first, double *product) {
  for (size_t i = 0; i < rows && first + i < width; i++) reflect(work, rows, width, i, first + i, product);
}

void cav_row_factor_advance(cav_row_factor *f) {
  size_t width = columns(f), n = (size_t)f->n, rows = (size_t)f->rows, p = (size_t)f->border;
  int ends = f->next == f->blocks;
  size_t first = ends ? 3 * n : 0;
  make_triangular(f->work, rows, width, first, f->product);
  if (rows > width - first) rows = width - first;
  if (ends) {
    for (size_t i = 0; i < rows; i++) memcpy(f->corner + i * p, f->work + i * width + 3 * n, p * sizeof(double));
    return;
  }
  memcpy(f->R + (size_t)f->next * n * width, f->work, (rows < n ? rows : n) * width * sizeof(double));
  // the rest, a block to the left
  size_t left = rows > n ? rows - n : 0;
  for (size_t i = 0; i < left; i++) {
    double *to = f->work + i * width;
    const double *from = f->work + (i + n) * width;
    memcpy(to, from + n, 2 * n * sizeof *to);
    memset(to + 2 * n, 0, n * sizeof *to);
    memcpy(to + 3 * n, from + 3 * n, p * sizeof *to);
  }
  f->rows = (int)left;
  f->next++;
}

double cav_row_factor_least(const cav_row_factor *f, int skip) {
  size_t width = columns(f), n = (size_t)f->n, p = (size_t)f->border;
  double least = INFINITY;
  for (size_t j = 0; j < (size_t)f->blocks * n; j++) least = fmin(least, fabs(f->R[j * width + j % n]));
  for (size_t j = 0; j + (size_t)skip < p; j++) least = fmin(least, fabs(f->corner[j * p + j]));
  return least;
}

/// X := U^-1 X for the upper triangle of U [n*stride], X [n*m] by rows of a stride.
static void solve_upper(size_t n, const double *U, size_t stride, size_t m, double *X, size_t row) {
  for (size_t i = n; i-- > 0;) {
    for (size_t k = i + 1; k < n; k++)
      for (size_t c = 0; c < m; c++) X[i * row + c] -= U[i * stride + k] * X[k * row + c];
    for (size_t c = 0; c < m; c++) X[i * row + c] /= U[i * stride + i];
  }
}

void cav_row_factor_solve(const cav_row_factor *f, double *x) {
  size_t width = columns(f), n = (size_t)f->n;
  for (size_t b = (size_t)f->blocks; b-- > 0;)
    for (size_t i = n; i-- > 0;) {
      const double *row = f->R + (b * n + i) * width;
      double sum = -row[3 * n];
      for (size_t c = i + 1; c < 3 * n && b * n + c < (size_t)f->blocks * n; c++) sum -= row[c] * x[b * n + c];
      x[b * n + i] = sum / row[i];
    }
}

void cav_row_factor_ignore_border(cav_row_factor *f) {
  for (int i = 0; i < f->border; i++) f->corner[i * f->border + i] = INFINITY;
}

/// Factor of what is later than the last block: the border alone.
static void begin_back(cav_row_factor *f) {
  size_t p = (size_t)f->border, later = columns(f) - (size_t)f->n;
  memset(f->factor, 0, later * later * sizeof(double));
  double *corner = f->factor + (later - p) * later + (later - p);
  for (size_t i = 0; i < p; i++) corner[i * later + i] = 1;
  solve_upper(p, f->corner, p, p, corner, later);
}

/// Factor of the covariance without the last of the three blocks.
static void drop_last(cav_row_factor *f) {
  size_t width = columns(f), n = (size_t)f->n, later = width - n;
  // columns of the transpose are the rows that stay
  for (size_t i = 0; i < later; i++)
    for (size_t c = 0; c < width; c++) f->turned[c * later + i] = f->spread[(i < 2 * n ? i : i + n) * width + c];
  make_triangular(f->turned, width, later, 0, f->product);
  for (size_t i = 0; i < later; i++)
    for (size_t c = 0; c < later; c++) f->factor[i * later + c] = c <= i ? f->turned[c * later + i] : 0;
}

void cav_row_factor_back(cav_row_factor *f, int block) {
  size_t width = columns(f), n = (size_t)f->n, later = width - n;
  const double *R = f->R + (size_t)block * n * width;
  double *G = f->spread;
  if (block == f->blocks - 1)
    begin_back(f);
  else
    drop_last(f);
  memset(G, 0, width * width * sizeof *G);
  for (size_t i = 0; i < n; i++) {
    G[i * width + i] = 1;
    for (size_t k = 0; k < later; k++)
      for (size_t c = 0; c < later && R[i * width + n + k] != 0; c++)
        G[i * width + n + c] -= R[i * width + n + k] * f->factor[k * later + c];
  }
  solve_upper(n, R, width, width, G, width);
  for (size_t i = 0; i < later; i++) memcpy(G + (n + i) * width + n, f->factor + i * later, later * sizeof *G);
}
