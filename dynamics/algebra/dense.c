/// Dense products by tiles of registers, Cholesky factors by panels of columns. Each entry of a product is the sum over k in
/// ascending order within a slice, slices added in order; products are rounded before they are added (the build forbids
/// contraction). So vectors of two, four and eight numbers give the same bits.
#include "dense.h"

#include <math.h>
#include <stddef.h>

enum {
  PANEL = 24,    ///< columns of a factor's panel
  SLICE = 128,   ///< longest sum of a tile
  WIDE = 48,     ///< columns of B packed at a time: a multiple of every tile's columns
  TILE_MOST = 16 ///< rows of the tallest tile
};

/// One processor's way: T [rows*columns] := packed A [k][rows] times packed B [k][columns]; x -= s a; a dot b.
typedef struct lanes {
  int rows, columns;
  void (*tile)(int k, const double *A, const double *B, double *T);
  void (*subtract)(int n, double s, const double *a, double *x);
  double (*dot)(int n, const double *a, const double *b);
} lanes;

// eight sums by index modulo eight, then added pairwise: the same for every width
static inline double add_eight(const double *s) {
  return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

#define WAY(name, attribute, LANES, VECTORS, COLUMNS)                                                        \
  typedef double name##_vector __attribute__((vector_size((LANES)*8), aligned(8), may_alias));               \
  attribute static void name##_tile(int k, const double *A, const double *B, double *T) {                    \
    name##_vector sum[COLUMNS][VECTORS] = {0};                                                               \
    for (int p = 0; p < k; p++, A += (LANES) * (VECTORS), B += (COLUMNS)) {                                  \
      name##_vector a[VECTORS];                                                                              \
      for (int i = 0; i < (VECTORS); i++) a[i] = *(const name##_vector *)(A + (LANES)*i);                    \
      for (int j = 0; j < (COLUMNS); j++)                                                                    \
        for (int i = 0; i < (VECTORS); i++) sum[j][i] += a[i] * B[j];                                        \
    }                                                                                                        \
    for (int j = 0; j < (COLUMNS); j++)                                                                      \
      for (int i = 0; i < (VECTORS); i++) *(name##_vector *)(T + (LANES) * ((VECTORS)*j + i)) = sum[j][i];   \
  }                                                                                                          \
  attribute static void name##_subtract(int n, double s, const double *a, double *x) {                       \
    int i = 0;                                                                                               \
    for (; i + (LANES) <= n; i += (LANES)) *(name##_vector *)(x + i) -= s * *(const name##_vector *)(a + i); \
    for (; i < n; i++) x[i] -= s * a[i];                                                                     \
  }                                                                                                          \
  attribute static double name##_dot(int n, const double *a, const double *b) {                              \
    name##_vector sum[8 / (LANES)] = {0};                                                                    \
    double eight[8];                                                                                         \
    int i = 0;                                                                                               \
    for (; i + 8 <= n; i += 8)                                                                               \
      for (int l = 0; l < 8 / (LANES); l++)                                                                  \
        sum[l] += *(const name##_vector *)(a + i + (LANES)*l) * *(const name##_vector *)(b + i + (LANES)*l); \
    for (int l = 0; l < 8 / (LANES); l++) *(name##_vector *)(eight + (LANES)*l) = sum[l];                    \
    for (int l = 0; i < n; i++, l++) eight[l] += a[i] * b[i];                                                \
    return add_eight(eight);                                                                                 \
  }

#if defined(__x86_64__)
WAY(eight, __attribute__((target("avx512f"))), 8, 2, 8)
WAY(four, __attribute__((target("avx2"))), 4, 2, 6)
#endif
WAY(two, , 2, 2, 4)

static const lanes *way(void) {
  static const lanes two = {4, 4, two_tile, two_subtract, two_dot};
#if defined(__x86_64__)
  static const lanes eight = {16, 8, eight_tile, eight_subtract, eight_dot};
  static const lanes four = {8, 6, four_tile, four_subtract, four_dot};
  const int most = cav_dense_lanes();
  if (most == 8) return &eight;
  if (most == 4) return &four;
#endif
  return &two;
}

/// A factor of a product: entry (i, p) at at[i * by_row + p * by_column], zero further than `below` under the diagonal, which
/// is where i = p + offset.
typedef struct operand {
  const double *at;
  size_t by_row, by_column;
  int below, offset;
} operand;

/// Packs `count` rows from `first` of slice [k]: [k][height], zeros after the rows that there are.
static void pack(const operand *o, int first, int count, int slice, int k, int height, double *out) {
  const double *from = o->at + (size_t)first * o->by_row + (size_t)slice * o->by_column;
  for (int p = 0; p < k; p++, from += o->by_column, out += height) {
    int last = o->below - o->offset + slice + p - first + 1, some = last < count ? (last < 0 ? 0 : last) : count;
    for (int i = 0; i < some; i++) out[i] = from[(size_t)i * o->by_row];
    for (int i = some; i < height; i++) out[i] = 0;
  }
}

/// C += sign * T for a tile at (row, column) of [m*n], within the part.
static void add_tile(cav_part part, int m, int n, int row, int column, const lanes *w, double sign, const double *T,
                     double *C, size_t ldc) {
  int rows = m - row < w->rows ? m - row : w->rows, columns = n - column < w->columns ? n - column : w->columns;
  for (int j = 0; j < columns; j++, T += w->rows) {
    double *c = C + (size_t)(column + j) * ldc + row;
    int first = part == CAV_PART_LOWER && column + j > row ? column + j - row : 0;
    int end = part == CAV_PART_UPPER && column + j + 1 - row < rows ? column + j + 1 - row : rows;
    if (first == 0 && end > 0)
      w->subtract(end, -sign, T, c);
    else
      for (int i = first; i < end; i++) c[i] -= -sign * T[i];
  }
}

/// C += sign * A B', A [m*k] and B [n*k] as operands.
static void product(cav_part part, int m, int n, int k, double sign, const operand *A, const operand *B, double *C,
                    size_t ldc) {
  const lanes *w = way();
  double packed_a[SLICE * TILE_MOST], packed_b[SLICE * WIDE], T[TILE_MOST * 8];
  for (int wide = 0; wide < n; wide += WIDE) {
    int end = n - wide < WIDE ? n : wide + WIDE;
    for (int slice = 0; slice < k; slice += SLICE) {
      int length = k - slice < SLICE ? k - slice : SLICE;
      for (int j = wide; j < end; j += w->columns)
        pack(B, j, end - j < w->columns ? end - j : w->columns, slice, length, w->columns,
             packed_b + (size_t)(j - wide) * (size_t)length);
      for (int i = 0; i < m; i += w->rows) {
        int height = m - i < w->rows ? m - i : w->rows;
        // nothing of this strip is in the part
        if (part == CAV_PART_LOWER && i + height <= wide) continue;
        if (part == CAV_PART_UPPER && i >= end) break;
        pack(A, i, height, slice, length, w->rows, packed_a);
        for (int j = wide; j < end; j += w->columns) {
          if (part == CAV_PART_LOWER && i + height <= j) break;
          if (part == CAV_PART_UPPER && i >= j + w->columns) continue;
          w->tile(length, packed_a, packed_b + (size_t)(j - wide) * (size_t)length, T);
          add_tile(part, m, end, i, j, w, sign, T, C, ldc);
        }
      }
    }
  }
}

// an operand without zeros to leave out
enum { FULL = 1 << 29 };

void cav_dense_product(int m, int n, int k, double sign, const double *A, int lda, const double *B, int ldb, double *C,
                       int ldc) {
  operand a = {A, 1, (size_t)lda, FULL, 0}, b = {B, (size_t)ldb, 1, FULL, 0};
  product(CAV_PART_ALL, m, n, k, sign, &a, &b, C, (size_t)ldc);
}

void cav_dense_product_transposed(cav_part part, int m, int n, int k, double sign, const double *A, int lda,
                                  const double *B, int ldb, double *C, int ldc) {
  operand a = {A, (size_t)lda, 1, FULL, 0}, b = {B, (size_t)ldb, 1, FULL, 0};
  product(part, m, n, k, sign, &a, &b, C, (size_t)ldc);
}

void cav_dense_square(int n, int k, const double *A, int lda, double *C, int ldc) {
  operand a = {A, 1, (size_t)lda, FULL, 0};
  product(CAV_PART_UPPER, n, n, k, 1, &a, &a, C, (size_t)ldc);
}

static int least(int a, int b) { return a < b ? a : b; }

int cav_dense_factor(int n, int below, double *A, int lda) {
  const lanes *w = way();
  size_t ld = (size_t)lda;
  for (int start = 0; start < n; start += PANEL) {
    int end = least(n, start + PANEL);
    for (int c = start; c < end; c++) {
      double *column = A + (size_t)c * ld;
      // what the panel's columns before take from this one
      for (int d = start > c - below ? start : c - below; d < c; d++) {
        const double *before = A + (size_t)d * ld;
        w->subtract(least(n, d + below + 1) - c, before[c], before + c, column + c);
      }
      if (!(column[c] > 0) || !isfinite(column[c])) return 0;
      double root = sqrt(column[c]), inverse = 1 / root;
      column[c] = root;
      for (int i = c + 1, last = least(n, c + below + 1); i < last; i++) column[i] *= inverse;
    }
    // and the panel from all columns after it
    int rest = least(n, end + below) - end;
    operand panel = {A + (size_t)start * ld + end, 1, ld, below, end - start};
    product(CAV_PART_LOWER, rest, rest, end - start, -1, &panel, &panel, A + (size_t)end * ld + end, ld);
  }
  return 1;
}

void cav_dense_solve_lower(int n, int below, const double *L, int lda, int m, double *X, int ldx) {
  const lanes *w = way();
  size_t ld = (size_t)lda, apart = (size_t)ldx;
  // many right-hand sides by panels, few by columns
  int panel = m < 4 ? n : PANEL;
  for (int start = 0; start < n; start += panel) {
    int end = least(n, start + panel);
    for (int r = 0; r < m; r++) {
      double *x = X + (size_t)r * apart;
      for (int c = start; c < end; c++) {
        const double *column = L + (size_t)c * ld;
        x[c] /= column[c];
        w->subtract(least(end, c + below + 1) - c - 1, x[c], column + c + 1, x + c + 1);
      }
    }
    int rest = least(n, end + below) - end;
    operand a = {L + (size_t)start * ld + end, 1, ld, below, end - start}, b = {X + start, apart, 1, FULL, 0};
    if (rest > 0) product(CAV_PART_ALL, rest, m, end - start, -1, &a, &b, X + end, apart);
  }
}

void cav_dense_solve_upper(int n, int below, const double *L, int lda, int m, double *X, int ldx) {
  const lanes *w = way();
  for (int r = 0; r < m; r++) {
    double *x = X + (size_t)r * (size_t)ldx;
    for (int c = n - 1; c >= 0; c--) {
      const double *column = L + (size_t)c * (size_t)lda;
      x[c] = (x[c] - w->dot(least(n, c + below + 1) - c - 1, column + c + 1, x + c + 1)) / column[c];
    }
  }
}

static void exchange(double *a, double *b) {
  double kept = *a;
  *a = *b, *b = kept;
}

int cav_dense_solve_general(int n, double *A, int lda, int m, double *X, int ldx) {
  const lanes *w = way();
  size_t ld = (size_t)lda, apart = (size_t)ldx;
  for (int c = 0; c < n; c++) {
    double *column = A + (size_t)c * ld;
    int pivot = c;
    for (int i = c + 1; i < n; i++)
      if (fabs(column[i]) > fabs(column[pivot])) pivot = i;
    if (!(fabs(column[pivot]) > 0) || !isfinite(column[pivot])) return 0;
    if (pivot != c) {
      for (int j = 0; j < n; j++) exchange(A + (size_t)j * ld + c, A + (size_t)j * ld + pivot);
      for (int j = 0; j < m; j++) exchange(X + (size_t)j * apart + c, X + (size_t)j * apart + pivot);
    }
    double inverse = 1 / column[c];
    for (int i = c + 1; i < n; i++) column[i] *= inverse;
    for (int j = c + 1; j < n; j++)
      w->subtract(n - c - 1, A[(size_t)j * ld + c], column + c + 1, A + (size_t)j * ld + c + 1);
    for (int j = 0; j < m; j++)
      w->subtract(n - c - 1, X[(size_t)j * apart + c], column + c + 1, X + (size_t)j * apart + c + 1);
  }
  for (int j = 0; j < m; j++) {
    double *x = X + (size_t)j * apart;
    for (int c = n - 1; c >= 0; c--) {
      x[c] /= A[(size_t)c * ld + c];
      w->subtract(c, x[c], A + (size_t)c * ld, x);
    }
  }
  return 1;
}
