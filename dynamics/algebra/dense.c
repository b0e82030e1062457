/// Dense products by tiles of registers, Cholesky factors by panels of columns. Each entry of a product is the sum over k in
/// ascending order within a slice, slices added in order; products are rounded before they are added (the build forbids
/// contraction). So vectors of two, four and eight numbers give the same bits.
#include "dense.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

enum {
  PANEL = 24,    ///< columns of a factor's panel: a multiple of every tile's columns
  SLICE = 128,   ///< longest sum of a tile
  WIDE = 96,     ///< columns of B packed at a time: a multiple of every tile's columns
  SQUARE = 128,  ///< columns of a square whose rows' zeros are left out, at most
  TILE_MOST = 16 ///< rows of the tallest tile
};

/// The triangle on a panel's diagonal: entry (c, d) at [d * PANEL + c], and 1 over the diagonal of its factor.
typedef struct triangle {
  double entry[PANEL * PANEL], inverse[PANEL];
} triangle;

/// Rows of a slice, by bits.
typedef struct row_set {
  unsigned long long bits[SLICE / 64];
} row_set;

/// One processor's way: C -= s packed A [k][rows] times packed B [k][columns]; the product [some_rows][columns] of rows in a
/// set, all `apart` one after the other; X := X L'^-1 for rows of a panel packed [PANEL][rows]; factor of n columns of a
/// triangle in its place, zero if a pivot is not positive; x -= s a; a dot b.
typedef struct lanes {
  int rows, some_rows, columns;
  void (*tile)(int k, const double *A, const double *B, double s, double *C, size_t ldc);
  void (*some)(const row_set *set, size_t apart, const double *A, const double *B, double *C);
  void (*panel)(const triangle *L, double *X);
  int (*triangle)(int n, triangle *L);
  void (*subtract)(int n, double s, const double *a, double *x);
  double (*dot)(int n, const double *a, const double *b);
} lanes;

// eight sums by index modulo eight, then added pairwise: the same for every width
static inline double add_eight(const double *s) {
  return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

#define WAY(name, attribute, LANES, VECTORS, SOME, COLUMNS)                                                          \
  typedef double name##_vector __attribute__((vector_size((LANES)*8), aligned(8), may_alias));                       \
  attribute static void name##_tile(int k, const double *A, const double *B, double s, double *C, size_t ldc) {      \
    name##_vector sum[COLUMNS][VECTORS] = {0};                                                                       \
    for (int p = 0; p < k; p++, A += (LANES) * (VECTORS), B += (COLUMNS)) {                                          \
      name##_vector a[VECTORS];                                                                                      \
      for (int i = 0; i < (VECTORS); i++) a[i] = *(const name##_vector *)(A + (LANES)*i);                            \
      for (int j = 0; j < (COLUMNS); j++)                                                                            \
        for (int i = 0; i < (VECTORS); i++) sum[j][i] += a[i] * B[j];                                                \
    }                                                                                                                \
    for (int j = 0; j < (COLUMNS); j++, C += ldc)                                                                    \
      for (int i = 0; i < (VECTORS); i++) *(name##_vector *)(C + (LANES)*i) -= s * sum[j][i];                        \
  }                                                                                                                  \
  attribute static void name##_some(const row_set *set, size_t apart, const double *A, const double *B, double *C) { \
    name##_vector sum[COLUMNS][VECTORS] = {0};                                                                       \
    for (int w = 0; w < SLICE / 64; w++, A += 64 * apart, B += 64 * apart)                                           \
      for (unsigned long long left = set->bits[w]; left; left &= left - 1) {                                         \
        const size_t p = (size_t)__builtin_ctzll(left) * apart;                                                      \
        name##_vector a[VECTORS];                                                                                    \
        for (int i = 0; i < (SOME); i++) a[i] = *(const name##_vector *)(A + p + (LANES)*i);                         \
        for (int j = 0; j < (COLUMNS); j++)                                                                          \
          for (int i = 0; i < (SOME); i++) sum[j][i] += a[i] * B[p + j];                                             \
      }                                                                                                              \
    for (int j = 0; j < (COLUMNS); j++, C += apart)                                                                  \
      for (int i = 0; i < (SOME); i++) *(name##_vector *)(C + (LANES)*i) = sum[j][i];                                \
  }                                                                                                                  \
  attribute static void name##_panel(const triangle *L, double *X) {                                                 \
    for (int c = 0; c < PANEL; c += (COLUMNS)) {                                                                     \
      double *at = X + (size_t)(c * (LANES) * (VECTORS));                                                            \
      name##_vector x[COLUMNS][VECTORS];                                                                             \
      for (int j = 0; j < (COLUMNS); j++)                                                                            \
        for (int i = 0; i < (VECTORS); i++) x[j][i] = *(name##_vector *)(at + (LANES) * ((VECTORS)*j + i));          \
      const double *before = X, *l = L->entry + c;                                                                   \
      for (int d = 0; d < c; d++, before += (LANES) * (VECTORS), l += PANEL) {                                       \
        name##_vector a[VECTORS];                                                                                    \
        for (int i = 0; i < (VECTORS); i++) a[i] = *(const name##_vector *)(before + (LANES)*i);                     \
        for (int j = 0; j < (COLUMNS); j++)                                                                          \
          for (int i = 0; i < (VECTORS); i++) x[j][i] -= l[j] * a[i];                                                \
      }                                                                                                              \
      for (int j = 0; j < (COLUMNS); j++, l += PANEL) {                                                              \
        for (int i = 0; i < (VECTORS); i++) x[j][i] *= L->inverse[c + j];                                            \
        for (int k = 0; k < (COLUMNS); k++)                                                                          \
          for (int i = 0; i < (VECTORS) && k > j; i++) x[k][i] -= l[k] * x[j][i];                                    \
      }                                                                                                              \
      for (int j = 0; j < (COLUMNS); j++)                                                                            \
        for (int i = 0; i < (VECTORS); i++) *(name##_vector *)(at + (LANES) * ((VECTORS)*j + i)) = x[j][i];          \
    }                                                                                                                \
  }                                                                                                                  \
  attribute static int name##_triangle(int n, triangle *L) {                                                         \
    for (int c = 0; c < n; c++) {                                                                                    \
      double *column = L->entry + c * PANEL;                                                                         \
      name##_vector x[PANEL / (LANES)];                                                                              \
      for (int i = 0; i < PANEL / (LANES); i++) x[i] = *(name##_vector *)(column + (LANES)*i);                       \
      for (int d = 0; d < c; d++)                                                                                    \
        for (int i = 0; i < PANEL / (LANES); i++)                                                                    \
          x[i] -= L->entry[d * PANEL + c] * *(const name##_vector *)(L->entry + d * PANEL + (LANES)*i);              \
      for (int i = 0; i < PANEL / (LANES); i++) *(name##_vector *)(column + (LANES)*i) = x[i];                       \
      double pivot = column[c];                                                                                      \
      if (!(pivot > 0) || !isfinite(pivot)) return 0;                                                                \
      double root = sqrt(pivot);                                                                                     \
      L->inverse[c] = 1 / root;                                                                                      \
      for (int i = c / (LANES); i < PANEL / (LANES); i++) *(name##_vector *)(column + (LANES)*i) *= L->inverse[c];   \
      column[c] = root;                                                                                              \
    }                                                                                                                \
    return 1;                                                                                                        \
  }                                                                                                                  \
  attribute static void name##_subtract(int n, double s, const double *a, double *x) {                               \
    int i = 0;                                                                                                       \
    for (; i + (LANES) <= n; i += (LANES)) *(name##_vector *)(x + i) -= s * *(const name##_vector *)(a + i);         \
    for (; i < n; i++) x[i] -= s * a[i];                                                                             \
  }                                                                                                                  \
  attribute static double name##_dot(int n, const double *a, const double *b) {                                      \
    name##_vector sum[8 / (LANES)] = {0};                                                                            \
    double eight[8];                                                                                                 \
    int i = 0;                                                                                                       \
    for (; i + 8 <= n; i += 8)                                                                                       \
      for (int l = 0; l < 8 / (LANES); l++)                                                                          \
        sum[l] += *(const name##_vector *)(a + i + (LANES)*l) * *(const name##_vector *)(b + i + (LANES)*l);         \
    for (int l = 0; l < 8 / (LANES); l++) *(name##_vector *)(eight + (LANES)*l) = sum[l];                            \
    for (int l = 0; i < n; i++, l++) eight[l] += a[i] * b[i];                                                        \
    return add_eight(eight);                                                                                         \
  }

#if defined(__x86_64__)
WAY(eight, __attribute__((target("avx512f"))), 8, 2, 1, 8)
WAY(four, __attribute__((target("avx2"))), 4, 2, 2, 6)
#endif
WAY(two, , 2, 2, 2, 4)

static const lanes *way(void) {
  static const lanes two = {4, 4, 4, two_tile, two_some, two_panel, two_triangle, two_subtract, two_dot};
#if defined(__x86_64__)
  static const lanes eight = {16, 8, 8, eight_tile, eight_some, eight_panel, eight_triangle, eight_subtract, eight_dot};
  static const lanes four = {8, 8, 6, four_tile, four_some, four_panel, four_triangle, four_subtract, four_dot};
  const int most = cav_dense_lanes();
  if (most == 8) return &eight;
  if (most == 4) return &four;
#endif
  return &two;
}

static int least(int a, int b) { return a < b ? a : b; }

/// A factor of a product: entry (i, p) at at[i * by_row + p * by_column].
typedef struct operand {
  const double *at;
  size_t by_row, by_column;
  const int *end; ///< column p of a band has no rows from end[p] on, and none has fewer after it; NULL: all are there
} operand;

/// Packs whole rows [k][height] that lie beside each other; height is known where this is inlined.
static inline __attribute__((always_inline)) void pack_whole(const double *from, size_t by_column, int k, int height,
                                                             double *out) {
  for (int p = 0; p < k; p++, from += by_column, out += height) memcpy(out, from, (size_t)height * sizeof *out);
}

/// Packs `count` rows from `first` of slice [k]: [k][height], zeros after the rows that there are.
static void pack(const operand *o, int first, int count, int slice, int k, int height, double *out) {
  const double *from = o->at + (size_t)first * o->by_row + (size_t)slice * o->by_column;
  int whole = o->by_row == 1 && count == height && (!o->end || o->end[slice] - first >= count);
  if (whole && height == 16) {
    pack_whole(from, o->by_column, k, 16, out);
    return;
  }
  if (whole && height == 8) {
    pack_whole(from, o->by_column, k, 8, out);
    return;
  }
  for (int p = 0; p < k; p++, from += o->by_column, out += height) {
    int some = count;
    if (o->end) some = o->end[slice + p] - first < count ? o->end[slice + p] - first : count;
    if (o->by_row == 1 && some > 0)
      memcpy(out, from, (size_t)some * sizeof *out);
    else
      for (int i = 0; i < some; i++) out[i] = from[(size_t)i * o->by_row];
    for (int i = some > 0 ? some : 0; i < height; i++) out[i] = 0;
  }
}

/// C += sign * A B for a tile at (row, column) of [m*n], within the part.
static void add_tile(cav_triangle part, int m, int n, int row, int column, const lanes *w, int k, double sign,
                     const double *A, const double *B, double *C, size_t ldc) {
  int rows = m - row < w->rows ? m - row : w->rows, columns = n - column < w->columns ? n - column : w->columns;
  double *at = C + (size_t)column * ldc + row, T[TILE_MOST * 8];
  int whole = part == CAV_TRIANGLE_BOTH ||
              (part == CAV_TRIANGLE_LOWER ? column + columns <= row + 1 : row + rows <= column + 1);
  if (whole && rows == w->rows && columns == w->columns) {
    w->tile(k, A, B, -sign, at, ldc);
    return;
  }
  memset(T, 0, (size_t)(w->rows * w->columns) * sizeof *T);
  w->tile(k, A, B, -1, T, (size_t)w->rows);
  for (int j = 0; j < columns; j++, at += ldc) {
    const double *t = T + j * w->rows;
    int first = part == CAV_TRIANGLE_LOWER && column + j > row ? column + j - row : 0;
    int end = part == CAV_TRIANGLE_UPPER && column + j + 1 - row < rows ? column + j + 1 - row : rows;
    if (end > first) w->subtract(end - first, -sign, t + first, at + first);
  }
}

/// C += sign * A B', A [m*k] and B [n*k] as operands.
static void product(cav_triangle part, int m, int n, int k, double sign, const operand *A, const operand *B, double *C,
                    size_t ldc) {
  const lanes *w = way();
  _Alignas(64) double packed_a[SLICE * TILE_MOST], packed_b[SLICE * WIDE];
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
        if (part == CAV_TRIANGLE_LOWER && i + height <= wide) continue;
        if (part == CAV_TRIANGLE_UPPER && i >= end) break;
        pack(A, i, height, slice, length, w->rows, packed_a);
        for (int j = wide; j < end; j += w->columns) {
          if (part == CAV_TRIANGLE_LOWER && i + height <= j) break;
          if (part == CAV_TRIANGLE_UPPER && i >= j + w->columns) continue;
          add_tile(part, m, end, i, j, w, length, sign, packed_a, packed_b + (size_t)(j - wide) * (size_t)length, C,
                   ldc);
        }
      }
    }
  }
}

void cav_dense_product(int m, int n, int k, double sign, const double *A, int lda, const double *B, int ldb, double *C,
                       int ldc) {
  operand a = {.at = A, .by_row = 1, .by_column = (size_t)lda}, b = {.at = B, .by_row = (size_t)ldb, .by_column = 1};
  product(CAV_TRIANGLE_BOTH, m, n, k, sign, &a, &b, C, (size_t)ldc);
}

void cav_dense_product_transposed(cav_triangle part, int m, int n, int k, double sign, const double *A, int lda,
                                  const double *B, int ldb, double *C, int ldc) {
  operand a = {.at = A, .by_row = (size_t)lda, .by_column = 1}, b = {.at = B, .by_row = (size_t)ldb, .by_column = 1};
  product(part, m, n, k, sign, &a, &b, C, (size_t)ldc);
}

/// Rows of A' [k*n] with the like columns of all parts side by side, which rows have anything but zeros in each strip of columns,
/// and the upper triangle of their square, by columns.
typedef struct slice {
  _Alignas(64) double entry[SLICE * (SQUARE + TILE_MOST)], sum[(SQUARE + TILE_MOST) * (SQUARE + TILE_MOST)];
  size_t apart; ///< of rows, and of columns of the sum
  row_set tall[SQUARE / 4], wide[SQUARE / 4];
} slice;

/// The number's bits.
typedef unsigned long long number_bits __attribute__((may_alias));

// one row, and into which sets it goes: of each column that is not zero, but for its sign, in all parts
CAV_VECTOR_BODY void pack_row_body(int n, int parts, const double *A, unsigned long long here, double *restrict row,
                                   unsigned long long *restrict set) {
  const int part = n / parts;
  const number_bits *a = (const number_bits *)A;
  if (parts == 3) {
    for (int d = 0; d < part; d++) set[d] |= (a[d] | a[part + d] | a[2 * part + d]) << 1 ? here : 0;
    for (int d = 0; d < part; d++, row += 3) row[0] = A[d], row[1] = A[part + d], row[2] = A[2 * part + d];
    return;
  }
  for (int c = 0; c < parts; c++)
    for (int d = 0; d < part; d++) set[d] |= a[c * part + d] << 1 ? here : 0;
  for (int d = 0; d < part; d++)
    for (int c = 0; c < parts; c++) *row++ = A[c * part + d];
}
CAV_BY_VECTORS(pack_row,
               (int n, int parts, const double *A, unsigned long long here, double *row, unsigned long long *set),
               (n, parts, A, here, row, set))

// sets of strips of columns from those of their columns in all parts
static void join_strips(int n, int parts, int height, unsigned long long set[SLICE / 64][SQUARE], row_set *strip) {
  for (int first = 0; first < n; first += height, strip++) {
    *strip = (row_set){0};
    for (int d = first / parts, end = (least(n, first + height) - 1) / parts; d <= end; d++)
      for (int l = 0; l < SLICE / 64; l++) strip->bits[l] |= set[l][d];
  }
}

static void pack_slice(const lanes *w, int n, int parts, int k, const double *A, size_t lda, slice *s) {
  unsigned long long set[SLICE / 64][SQUARE];
  for (int l = 0; l < SLICE / 64; l++) memset(set[l], 0, (size_t)(n / parts) * sizeof **set);
  for (int p = 0; p < k; p++, A += lda) {
    double *row = s->entry + (size_t)p * s->apart;
    pack_row(n, parts, A, 1ull << p % 64, row, set[p / 64]);
    for (size_t i = (size_t)n; i < s->apart; i++) row[i] = 0;
  }
  join_strips(n, parts, w->some_rows, set, s->tall);
  join_strips(n, parts, w->columns, set, s->wide);
}

/// The square of a slice's rows.
static void square_slice(const lanes *w, int n, slice *s) {
  for (int j = 0; j < n; j += w->columns) {
    const row_set *b = &s->wide[j / w->columns];
    for (int i = 0; i < least(n, j + w->columns); i += w->some_rows) {
      const row_set *a = &s->tall[i / w->some_rows];
      row_set both;
      for (int l = 0; l < SLICE / 64; l++) both.bits[l] = a->bits[l] & b->bits[l];
      w->some(&both, s->apart, s->entry + i, s->entry + j, s->sum + (size_t)j * s->apart + i);
    }
  }
}

// four rows of four numbers to columns
CAV_VECTOR_BODY void transpose_four(cav_four a[4]) {
  const cav_four p = CAV_SHUFFLED(a[0], a[1], 0, 4, 2, 6), q = CAV_SHUFFLED(a[0], a[1], 1, 5, 3, 7);
  const cav_four r = CAV_SHUFFLED(a[2], a[3], 0, 4, 2, 6), s = CAV_SHUFFLED(a[2], a[3], 1, 5, 3, 7);
  a[0] = CAV_SHUFFLED(p, r, 0, 1, 4, 5), a[1] = CAV_SHUFFLED(q, s, 0, 1, 4, 5);
  a[2] = CAV_SHUFFLED(p, r, 2, 3, 6, 7), a[3] = CAV_SHUFFLED(q, s, 2, 3, 6, 7);
}

// twelve numbers to every third of them
CAV_VECTOR_BODY void part_three(const double *from, cav_four out[3]) {
  const cav_four a = *(const cav_four *)from, b = *(const cav_four *)(from + 4), c = *(const cav_four *)(from + 8);
  const cav_four x = CAV_SHUFFLED(CAV_SHUFFLED(a, c, 0, 5, 2, 3), b, 0, 1, 6, 3);
  const cav_four y = CAV_SHUFFLED(CAV_SHUFFLED(a, b, 4, 1, 2, 3), CAV_SHUFFLED(b, c, 0, 1, 6, 3), 0, 1, 6, 7);
  const cav_four z = CAV_SHUFFLED(CAV_SHUFFLED(c, b, 0, 5, 2, 3), a, 0, 1, 6, 3);
  out[0] = CAV_SHUFFLED(x, x, 0, 3, 2, 1), out[1] = CAV_SHUFFLED(y, y, 1, 0, 3, 2);
  out[2] = CAV_SHUFFLED(z, z, 2, 1, 0, 3);
}

// adds the first numbers of four
CAV_VECTOR_BODY void add_some(double *to, const cav_four *x, int n) {
  if (n >= 4)
    *(cav_four *)to += *x;
  else
    for (int i = 0; i < n; i++) to[i] += (*x)[i];
}

// upper triangle of C += the square of three parts, by four columns of each at once
CAV_VECTOR_BODY void add_square_of_three_body(int part, slice *s, double *C, size_t ldc) {
  const size_t apart = s->apart;
  for (int D = 0; D < part; D += 4) {
    const int some = least(4, part - D);
    // what these columns have of each other, in all of them
    for (int j = 3 * D; j < 3 * D + 12; j++)
      for (int i = j + 1; i < 3 * D + 12; i++) s->sum[(size_t)j * apart + i] = s->sum[(size_t)i * apart + j];
    for (int d = D; d < D + some; d++)
      for (int c = 0; c < 3; c++) {
        const double *in = s->sum + (size_t)(3 * d + c) * apart;
        double *out = C + (size_t)(c * part + d) * ldc;
        for (int e = 0; e <= D; e += 4) {
          cav_four x[3];
          part_three(in + 3 * e, x);
          for (int b = 0; b <= c; b++) add_some(out + b * part + e, &x[b], e < D ? 4 : b == c ? d + 1 - D : some);
        }
      }
    // what columns after them have of them
    for (int e = D + 4; e < part; e += 4)
      for (int b = 0; b < 2; b++) {
        cav_four x[4][3], column[4];
        for (int i = 0; i < 4; i++) part_three(s->sum + (size_t)(3 * (e + i) + b) * apart + 3 * D, x[i]);
        for (int c = b + 1; c < 3; c++) {
          for (int i = 0; i < 4; i++) column[i] = x[i][c];
          transpose_four(column);
          for (int i = 0; i < some; i++)
            add_some(C + (size_t)(c * part + D + i) * ldc + b * part + e, &column[i], part - e);
        }
      }
  }
}
CAV_BY_VECTORS(add_square_of_three, (int part, slice *s, double *C, size_t ldc), (part, s, C, ldc))

/// Upper triangle of C += the square, back in the order of the columns: C's rows are `next` apart, its columns ldc.
static void add_square(int n, int parts, slice *s, double *C, size_t next, size_t ldc) {
  const int part = n / parts;
  if (parts == 3 && next == 1) {
    add_square_of_three(part, s, C, ldc);
    return;
  }
  const size_t down = (size_t)parts, across = (size_t)parts * s->apart;
  for (int at = 0; at < n; at++, C += ldc) {
    const int d = at % part, c = at / part;
    const size_t j = (size_t)(d * parts + c);
    for (int b = 0; b <= c; b++) {
      // those before column j of the sum stand in it, the others in theirs
      const int end = b == c ? d + 1 : part, before = least(end, d + (b <= c));
      const double *in = s->sum + j * s->apart + b, *there = s->sum + (size_t)b * s->apart + j;
      double *out = C + (size_t)(b * part) * next;
      for (int e = 0; e < before; e++) out[(size_t)e * next] += in[(size_t)e * down];
      for (int e = before; e < end; e++) out[(size_t)e * next] += there[(size_t)e * across];
    }
  }
}

void cav_dense_square(cav_triangle part, int n, int parts, int k, const double *A, int lda, double *C, int ldc) {
  const lanes *w = way();
  if (n > SQUARE) {
    operand a = {.at = A, .by_row = 1, .by_column = (size_t)lda};
    product(part, n, n, k, 1, &a, &a, C, (size_t)ldc);
    return;
  }
  const int lower = part == CAV_TRIANGLE_LOWER;
  slice s;
  s.apart = (size_t)(n + TILE_MOST - 1) / 8 * 8;
  for (int first = 0; first < k; first += SLICE, A += SLICE * (size_t)lda) {
    pack_slice(w, n, parts, least(k - first, SLICE), A, (size_t)lda, &s);
    square_slice(w, n, &s);
    add_square(n, parts, &s, C, lower ? (size_t)ldc : 1, lower ? 1 : (size_t)ldc);
  }
}

// a block, four rows of four columns at once; those of fewer one by one
CAV_VECTOR_BODY void add_transposed_body(int lower, int fresh, int n, const double *A, size_t lda, double *C,
                                         size_t ldc) {
  for (int i = 0; i < n; i += 4) {
    int j = 0;
    for (; i + 4 <= n && j + 4 <= (lower ? i : n); j += 4) {
      cav_four a[4];
      for (int k = 0; k < 4; k++) a[k] = *(const cav_four *)(A + (size_t)(i + k) * lda + j);
      transpose_four(a);
      for (int k = 0; k < 4; k++) {
        cav_four *to = (cav_four *)(C + (size_t)(j + k) * ldc + i);
        if (fresh)
          *to = a[k];
        else
          *to += a[k];
      }
    }
    for (int row = i; row < least(n, i + 4); row++)
      for (int k = j, end = lower ? row + 1 : n; k < end; k++) {
        double *to = C + (size_t)k * ldc + row;
        *to = fresh ? A[(size_t)row * lda + k] : *to + A[(size_t)row * lda + k];
      }
  }
}
CAV_BY_VECTORS(add_transposed, (int lower, int fresh, int n, const double *A, size_t lda, double *C, size_t ldc),
               (lower, fresh, n, A, lda, C, ldc))

void cav_dense_add_transposed(cav_triangle part, int fresh, int n, const double *A, int lda, double *C, int ldc) {
  add_transposed(part == CAV_TRIANGLE_LOWER, fresh, n, A, (size_t)lda, C, (size_t)ldc);
}

/// Columns start to end of a band, and where each ends.
typedef struct panel {
  int start, end, last[PANEL];
} panel;

static panel panel_at(int start, int n, int below, int step) {
  panel p = {.start = start, .end = least(n, start + PANEL)};
  for (int c = start; c < p.end; c++) p.last[c - start] = least(n, c / step * step + below + 1);
  return p;
}

/// What the columns of a panel take from each other in the rows from `first` on.
static void reduce_rows(const lanes *w, const panel *p, int first, double *A, size_t ld) {
  for (int c = p->start; c < p->end; c++) {
    double *column = A + (size_t)c * ld, inverse = 1 / column[c];
    for (int d = p->start; d < c; d++) {
      const double *before = A + (size_t)d * ld;
      int count = p->last[d - p->start] - first;
      if (count > 0) w->subtract(count, before[c], before + first, column + first);
    }
    for (int i = first; i < p->last[c - p->start]; i++) column[i] *= inverse;
  }
}

/// The same in the rows from the panel's end on that all its columns have, by strips; returns the first row after them.
static int reduce_strips(const lanes *w, const panel *p, const triangle *L, double *A, size_t ld) {
  int last = p->last[0];
  if (last - p->end < w->rows / 2) return p->end;
  _Alignas(64) double X[PANEL * TILE_MOST];
  for (int row = p->end; row < last; row += w->rows) {
    int some = least(last - row, w->rows);
    operand rows = {.at = A + (size_t)p->start * ld + row, .by_row = 1, .by_column = ld};
    pack(&rows, 0, some, 0, PANEL, w->rows, X);
    w->panel(L, X);
    for (int c = 0; c < PANEL; c++)
      memcpy(A + (size_t)(p->start + c) * ld + row, X + c * w->rows, (size_t)some * sizeof *X);
  }
  return last;
}

/// The triangle on the panel's diagonal; zero if a pivot is not positive.
static int factor_triangle(const lanes *w, const panel *p, triangle *L, double *A, size_t ld) {
  int n = p->end - p->start;
  for (int c = 0; c < n; c++) {
    const double *column = A + (size_t)(p->start + c) * (ld + 1);
    double *to = L->entry + c * PANEL;
    int count = least(p->end, p->last[c]) - p->start - c;
    memset(to, 0, PANEL * sizeof *to);
    memcpy(to + c, column, (size_t)count * sizeof *to);
  }
  if (!w->triangle(n, L)) return 0;
  for (int c = 0; c < n; c++) {
    int count = least(p->end, p->last[c]) - p->start - c;
    memcpy(A + (size_t)(p->start + c) * (ld + 1), L->entry + c * (PANEL + 1), (size_t)count * sizeof(double));
  }
  return 1;
}

int cav_dense_factor_part(int n, int below, int step, int from, int ready, double *A, int lda) {
  const lanes *w = way();
  size_t ld = (size_t)lda;
  _Alignas(64) triangle L;
  for (int start = from; start < n; start += PANEL) {
    panel p = panel_at(start, n, below, step);
    int columns = p.end - start, last = p.last[columns - 1], rest = last - p.end;
    if (last > ready) return start;
    if (!factor_triangle(w, &p, &L, A, ld)) return -1;
    reduce_rows(w, &p, reduce_strips(w, &p, &L, A, ld), A, ld);
    // and the panel from all columns after it
    for (int c = 0; c < columns; c++) p.last[c] -= p.end;
    operand rows = {.at = A + (size_t)start * ld + p.end, .by_row = 1, .by_column = ld, .end = p.last};
    if (rest > 0) product(CAV_TRIANGLE_LOWER, rest, rest, columns, -1, &rows, &rows, A + (size_t)p.end * (ld + 1), ld);
  }
  return n;
}

int cav_dense_factor_blocks(int n, int below, int step, double *A, int lda) {
  return cav_dense_factor_part(n, below, step, 0, n, A, lda) == n;
}

int cav_dense_factor(int n, int below, double *A, int lda) { return cav_dense_factor_blocks(n, below, 1, A, lda); }

void cav_dense_solve_lower_blocks(int n, int below, int step, const double *L, int lda, int m, double *X, int ldx) {
  const lanes *w = way();
  size_t ld = (size_t)lda, apart = (size_t)ldx;
  for (int start = 0; start < n; start += PANEL) {
    panel p = panel_at(start, n, below, step);
    // many right-hand sides by panels, few by columns
    for (int r = 0; r < m; r++) {
      double *x = X + (size_t)r * apart;
      for (int c = start; c < p.end; c++) {
        const double *column = L + (size_t)c * ld;
        int last = m < 4 ? p.last[c - start] : least(p.end, p.last[c - start]);
        x[c] /= column[c];
        w->subtract(last - c - 1, x[c], column + c + 1, x + c + 1);
      }
    }
    int columns = p.end - start, rest = p.last[columns - 1] - p.end;
    if (m < 4 || rest <= 0) continue;
    for (int c = 0; c < columns; c++) p.last[c] -= p.end;
    operand a = {.at = L + (size_t)start * ld + p.end, .by_row = 1, .by_column = ld, .end = p.last};
    operand b = {.at = X + start, .by_row = apart, .by_column = 1};
    product(CAV_TRIANGLE_BOTH, rest, m, columns, -1, &a, &b, X + p.end, apart);
  }
}

void cav_dense_solve_lower(int n, int below, const double *L, int lda, int m, double *X, int ldx) {
  cav_dense_solve_lower_blocks(n, below, 1, L, lda, m, X, ldx);
}

void cav_dense_solve_upper_blocks(int n, int below, int step, const double *L, int lda, int m, double *X, int ldx) {
  const lanes *w = way();
  for (int r = 0; r < m; r++) {
    double *x = X + (size_t)r * (size_t)ldx;
    for (int c = n - 1; c >= 0; c--) {
      const double *column = L + (size_t)c * (size_t)lda;
      int last = least(n, c / step * step + below + 1);
      x[c] = (x[c] - w->dot(last - c - 1, column + c + 1, x + c + 1)) / column[c];
    }
  }
}

void cav_dense_solve_upper(int n, int below, const double *L, int lda, int m, double *X, int ldx) {
  cav_dense_solve_upper_blocks(n, below, 1, L, lda, m, X, ldx);
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
