/// Dense products by tiles of registers, Cholesky factors by panels of columns. Each entry of a product is the sum over k in
/// ascending order within a slice, slices added in order; products are rounded before they are added (the build forbids
/// contraction). So vectors of two, four and eight numbers give the same bits.
#include "dense.h"

#include <assert.h>
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

// What is done for each column of a tile of two vectors of rows, written out: sums in an array would go through memory.
#define EACH_4(DO, V) DO(V, 0) DO(V, 1) DO(V, 2) DO(V, 3)
#define EACH_6(DO, V) EACH_4(DO, V) DO(V, 4) DO(V, 5)
#define EACH_8(DO, V) EACH_6(DO, V) DO(V, 6) DO(V, 7)
#define SUM_BEGIN(V, j) V low##j = {0}, high##j = {0};
#define SUM_ADD(V, j) low##j += low * B[j], high##j += high * B[j];
#define SUM_TAKE(V, j)                         \
  {                                            \
    V *at = (V *)C;                            \
    at[0] -= s * low##j, at[1] -= s * high##j; \
    C += ldc;                                  \
  }
#define SUM_ADD_SOME(V, j)    \
  low##j += low * B[p + (j)]; \
  if (more) high##j += high * B[p + (j)];
#define SUM_PUT(V, j)          \
  {                            \
    V *at = (V *)C;            \
    at[0] = low##j;            \
    if (more) at[1] = high##j; \
    C += apart;                \
  }

// columns of a strip of rows in a panel: as they are; less those before them; over their own diagonals, in turn
#define ROW_BEGIN(V, j) V low##j = to[2 * (j)], high##j = to[2 * (j) + 1];
#define ROW_SUBTRACT(V, j) low##j -= l[j] * low, high##j -= l[j] * high;
#define ROW_PUT(V, j) to[2 * (j)] = low##j, to[2 * (j) + 1] = high##j;
#define ROW_AFTER(j, k) \
  if ((k) > (j)) low##k -= l[k] * low##j, high##k -= l[k] * high##j;
#define ROW_REDUCE(j) low##j *= inverse[j], high##j *= inverse[j];
#define ROW_REDUCE_4(V, j) ROW_REDUCE(j) ROW_AFTER(j, 0) ROW_AFTER(j, 1) ROW_AFTER(j, 2) ROW_AFTER(j, 3) l += PANEL;
#define ROW_REDUCE_6(V, j) \
  ROW_REDUCE(j)            \
  ROW_AFTER(j, 0) ROW_AFTER(j, 1) ROW_AFTER(j, 2) ROW_AFTER(j, 3) ROW_AFTER(j, 4) ROW_AFTER(j, 5) l += PANEL;
#define ROW_REDUCE_8(V, j) \
  ROW_REDUCE(j)            \
  ROW_AFTER(j, 0)          \
  ROW_AFTER(j, 1)          \
  ROW_AFTER(j, 2) ROW_AFTER(j, 3) ROW_AFTER(j, 4) ROW_AFTER(j, 5) ROW_AFTER(j, 6) ROW_AFTER(j, 7) l += PANEL;

#define WAY(name, attribute, LANES, SOME, COLUMNS)                                                                    \
  typedef double name##_vector __attribute__((vector_size((LANES)*8), aligned(8), may_alias));                        \
  attribute static void name##_tile(int k, const double *A, const double *B, double s, double *C, size_t ldc) {       \
    EACH_##COLUMNS(SUM_BEGIN, name##_vector) for (int p = 0; p < k; p++, A += 2 * (LANES), B += (COLUMNS)) {          \
      const name##_vector low = *(const name##_vector *)A, high = *(const name##_vector *)(A + (LANES));              \
      EACH_##COLUMNS(SUM_ADD, name##_vector)                                                                          \
    }                                                                                                                 \
    EACH_##COLUMNS(SUM_TAKE, name##_vector)                                                                           \
  }                                                                                                                   \
  attribute static void name##_some(const row_set *set, size_t apart, const double *A, const double *B, double *C) {  \
    enum { more = (SOME) > 1 };                                                                                       \
    EACH_##COLUMNS(SUM_BEGIN, name##_vector) for (int w = 0; w < SLICE / 64;                                          \
                                                  w++, A += 64 * apart,                                               \
                                                  B += 64 * apart) for (unsigned long long left = set->bits[w]; left; \
                                                                        left &= left - 1) {                           \
      const size_t p = (size_t)__builtin_ctzll(left) * apart;                                                         \
      const name##_vector low = *(const name##_vector *)(A + p);                                                      \
      const name##_vector high = more ? *(const name##_vector *)(A + p + (LANES)) : low;                              \
      EACH_##COLUMNS(SUM_ADD_SOME, name##_vector)                                                                     \
    }                                                                                                                 \
    EACH_##COLUMNS(SUM_PUT, name##_vector)                                                                            \
  }                                                                                                                   \
  attribute static void name##_panel(const triangle *L, double *X) {                                                  \
    for (int c = 0; c < PANEL; c += (COLUMNS)) {                                                                      \
      name##_vector *const to = (name##_vector *)X + 2 * c;                                                           \
      EACH_##COLUMNS(ROW_BEGIN, name##_vector) const double *l = L->entry + c, *inverse = L->inverse + c;             \
      for (const name##_vector *before = (name##_vector *)X; before < to; before += 2, l += PANEL) {                  \
        const name##_vector low = before[0], high = before[1];                                                        \
        EACH_##COLUMNS(ROW_SUBTRACT, name##_vector)                                                                   \
      }                                                                                                               \
      EACH_##COLUMNS(ROW_REDUCE_##COLUMNS, name##_vector) EACH_##COLUMNS(ROW_PUT, name##_vector)                      \
    }                                                                                                                 \
  }                                                                                                                   \
  attribute static int name##_triangle(int n, triangle *L) {                                                          \
    for (int c = 0; c < n; c++) {                                                                                     \
      double *column = L->entry + c * PANEL;                                                                          \
      name##_vector x[PANEL / (LANES)];                                                                               \
      for (int i = 0; i < PANEL / (LANES); i++) x[i] = *(name##_vector *)(column + (LANES)*i);                        \
      for (int d = 0; d < c; d++)                                                                                     \
        for (int i = 0; i < PANEL / (LANES); i++)                                                                     \
          x[i] -= L->entry[d * PANEL + c] * *(const name##_vector *)(L->entry + d * PANEL + (LANES)*i);               \
      for (int i = 0; i < PANEL / (LANES); i++) *(name##_vector *)(column + (LANES)*i) = x[i];                        \
      double pivot = column[c];                                                                                       \
      if (!(pivot > 0) || !isfinite(pivot)) return 0;                                                                 \
      double root = sqrt(pivot);                                                                                      \
      L->inverse[c] = 1 / root;                                                                                       \
      for (int i = c / (LANES); i < PANEL / (LANES); i++) *(name##_vector *)(column + (LANES)*i) *= L->inverse[c];    \
      column[c] = root;                                                                                               \
    }                                                                                                                 \
    return 1;                                                                                                         \
  }                                                                                                                   \
  attribute static void name##_subtract(int n, double s, const double *a, double *x) {                                \
    int i = 0;                                                                                                        \
    for (; i + (LANES) <= n; i += (LANES)) *(name##_vector *)(x + i) -= s * *(const name##_vector *)(a + i);          \
    for (; i < n; i++) x[i] -= s * a[i];                                                                              \
  }                                                                                                                   \
  attribute static double name##_dot(int n, const double *a, const double *b) {                                       \
    name##_vector sum[8 / (LANES)] = {0};                                                                             \
    double eight[8];                                                                                                  \
    int i = 0;                                                                                                        \
    for (; i + 8 <= n; i += 8)                                                                                        \
      for (int l = 0; l < 8 / (LANES); l++)                                                                           \
        sum[l] += *(const name##_vector *)(a + i + (LANES)*l) * *(const name##_vector *)(b + i + (LANES)*l);          \
    for (int l = 0; l < 8 / (LANES); l++) *(name##_vector *)(eight + (LANES)*l) = sum[l];                             \
    for (int l = 0; i < n; i++, l++) eight[l] += a[i] * b[i];                                                         \
    return add_eight(eight);                                                                                          \
  }

#if defined(__x86_64__)
WAY(eight, __attribute__((target("avx512f"))), 8, 1, 8)
WAY(four, __attribute__((target("avx2"))), 4, 2, 6)
#endif
WAY(two, , 2, 2, 4)

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

/// Packs columns that lie one after the other; height is known where this is inlined.
static inline __attribute__((always_inline)) void pack_columns(const operand *o, const double *from, int first,
                                                               int count, int slice, int k, int height, double *out) {
  for (int p = 0; p < k; p++, from += o->by_column, out += height) {
    const int some = o->end && o->end[slice + p] - first < count ? o->end[slice + p] - first : count;
    if (some >= height) {
      memcpy(out, from, (size_t)height * sizeof *out);
      continue;
    }
    for (int i = 0; i < height; i++) out[i] = i < some ? from[i] : 0;
  }
}

/// Packs `count` rows from `first` of slice [k]: [k][height], zeros after the rows that there are.
static void pack(const operand *o, int first, int count, int slice, int k, int height, double *out) {
  const double *from = o->at + (size_t)first * o->by_row + (size_t)slice * o->by_column;
  if (o->by_row == 1) {
    if (height == 16)
      pack_columns(o, from, first, count, slice, k, 16, out);
    else if (height == 8)
      pack_columns(o, from, first, count, slice, k, 8, out);
    else if (height == 6)
      pack_columns(o, from, first, count, slice, k, 6, out);
    else
      pack_columns(o, from, first, count, slice, k, height, out);
    return;
  }
  for (int p = 0; p < k; p++, from += o->by_column, out += height) {
    const int some = o->end && o->end[slice + p] - first < count ? o->end[slice + p] - first : count;
    for (int i = 0; i < height; i++) out[i] = i < some ? from[(size_t)i * o->by_row] : 0;
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
    for (int i = first; i < end; i++) at[i] -= -sign * t[i];
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

/// Rows of A' [k*n] with the like columns of all parts side by side, and which rows have anything but zeros in each strip of
/// columns.
typedef struct slice {
  _Alignas(64) double entry[SLICE * (SQUARE + TILE_MOST)];
  size_t apart; ///< of rows, and of columns of their square
  row_set tall[SQUARE / 4], wide[SQUARE / 4];
} slice;

/// Distance of rows and of columns where n columns are packed; room for the square of a slice.
static size_t apart_of(int n) { return (size_t)(n + TILE_MOST - 1) / 8 * 8; }
enum { SQUARE_ROOM = (SQUARE + TILE_MOST) * (SQUARE + TILE_MOST) };

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

/// The upper triangle of the square of a slice's rows, by columns.
static void square_slice(const lanes *w, int n, const slice *s, double *sum) {
  for (int j = 0; j < n; j += w->columns) {
    const row_set *b = &s->wide[j / w->columns];
    for (int i = 0; i < least(n, j + w->columns); i += w->some_rows) {
      const row_set *a = &s->tall[i / w->some_rows];
      row_set both;
      for (int l = 0; l < SLICE / 64; l++) both.bits[l] = a->bits[l] & b->bits[l];
      w->some(&both, s->apart, s->entry + i, s->entry + j, sum + (size_t)j * s->apart + i);
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
CAV_VECTOR_BODY void add_square_of_three_body(int part, double *sum, size_t apart, double *C, size_t ldc) {
  for (int D = 0; D < part; D += 4) {
    const int some = least(4, part - D);
    // what these columns have of each other, in all of them
    for (int j = 3 * D; j < 3 * D + 12; j++)
      for (int i = j + 1; i < 3 * D + 12; i++) sum[(size_t)j * apart + i] = sum[(size_t)i * apart + j];
    for (int d = D; d < D + some; d++)
      for (int c = 0; c < 3; c++) {
        const double *in = sum + (size_t)(3 * d + c) * apart;
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
        for (int i = 0; i < 4; i++) part_three(sum + (size_t)(3 * (e + i) + b) * apart + 3 * D, x[i]);
        for (int c = b + 1; c < 3; c++) {
          for (int i = 0; i < 4; i++) column[i] = x[i][c];
          transpose_four(column);
          for (int i = 0; i < some; i++)
            add_some(C + (size_t)(c * part + D + i) * ldc + b * part + e, &column[i], part - e);
        }
      }
  }
}
CAV_BY_VECTORS(add_square_of_three, (int part, double *sum, size_t apart, double *C, size_t ldc),
               (part, sum, apart, C, ldc))

/// Upper triangle of C += the square, back in the order of the columns: C's rows are `next` apart, its columns ldc.
static void add_square(int n, int parts, double *sum, double *C, size_t next, size_t ldc) {
  const int part = n / parts;
  const size_t apart = apart_of(n);
  if (parts == 3 && next == 1) {
    add_square_of_three(part, sum, apart, C, ldc);
    return;
  }
  const size_t down = (size_t)parts, across = (size_t)parts * apart;
  for (int at = 0; at < n; at++, C += ldc) {
    const int d = at % part, c = at / part;
    const size_t j = (size_t)(d * parts + c);
    for (int b = 0; b <= c; b++) {
      // those before column j of the sum stand in it, the others in theirs
      const int end = b == c ? d + 1 : part, before = least(end, d + (b <= c));
      const double *in = sum + j * apart + b, *there = sum + (size_t)b * apart + j;
      double *out = C + (size_t)(b * part) * next;
      for (int e = 0; e < before; e++) out[(size_t)e * next] += in[(size_t)e * down];
      for (int e = before; e < end; e++) out[(size_t)e * next] += there[(size_t)e * across];
    }
  }
}

/// The square of at most SLICE rows of at most SQUARE columns.
static void find_square(const lanes *w, int n, int parts, int k, const double *A, size_t lda, double *sum) {
  slice s;
  s.apart = apart_of(n);
  pack_slice(w, n, parts, k, A, lda, &s);
  square_slice(w, n, &s, sum);
}

void cav_dense_square(cav_triangle part, int n, int parts, int k, const double *A, int lda, double *C, int ldc) {
  const lanes *w = way();
  if (n > SQUARE) {
    operand a = {.at = A, .by_row = 1, .by_column = (size_t)lda};
    product(part, n, n, k, 1, &a, &a, C, (size_t)ldc);
    return;
  }
  _Alignas(64) double sum[SQUARE_ROOM];
  for (int first = 0; first < k; first += SLICE, A += SLICE * (size_t)lda) {
    find_square(w, n, parts, least(k - first, SLICE), A, (size_t)lda, sum);
    cav_dense_square_add(part, n, parts, sum, C, ldc);
  }
}

size_t cav_dense_square_room(int n) {
  const size_t columns = (size_t)n;
  return n > SQUARE ? columns * columns : (columns + TILE_MOST) * apart_of(n);
}

void cav_dense_square_find(cav_triangle part, int n, int parts, int k, const double *A, int lda, double *room) {
  const size_t size = cav_dense_square_room(n);
  if (n > SQUARE || k == 0 || k > SLICE) memset(room, 0, size * sizeof *room);
  if (n > SQUARE) {
    cav_dense_square(part, n, parts, k, A, lda, room, n);
    return;
  }
  if (k > 0) find_square(way(), n, parts, least(k, SLICE), A, (size_t)lda, room);
  _Alignas(64) double sum[SQUARE_ROOM];
  for (int first = SLICE; first < k; first += SLICE) {
    memset(sum, 0, size * sizeof *sum);
    find_square(way(), n, parts, least(k - first, SLICE), A + (size_t)first * (size_t)lda, (size_t)lda, sum);
    for (size_t i = 0; i < size; i++) room[i] += sum[i];
  }
}

void cav_dense_square_add(cav_triangle part, int n, int parts, double *room, double *C, int ldc) {
  const size_t apart = (size_t)ldc;
  if (n <= SQUARE) {
    add_square(n, parts, room, C, part == CAV_TRIANGLE_LOWER ? apart : 1, part == CAV_TRIANGLE_LOWER ? 1 : apart);
    return;
  }
  for (int j = 0; j < n; j++)
    for (int i = part == CAV_TRIANGLE_LOWER ? j : 0; i < (part == CAV_TRIANGLE_UPPER ? j + 1 : n); i++)
      C[(size_t)i + (size_t)j * apart] += room[i + j * n];
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
  panel p;
  p.start = start, p.end = least(n, start + PANEL);
  for (int c = start; c < p.end; c++) p.last[c - start] = least(n, c / step * step + below + 1);
  return p;
}

/// What the columns of a panel take from each other in the rows from the panel's end on, by strips; columns that end before
/// count as zeros, which stay what they are.
static void reduce_strips(const lanes *w, const panel *p, const triangle *L, double *A, size_t ld) {
  const int last = p->last[p->end - p->start - 1];
  _Alignas(64) double X[PANEL * TILE_MOST];
  int end[PANEL];
  // rows there are none after a panel of fewer columns, the last
  assert(p->end - p->start == PANEL || last <= p->end);
  for (int row = p->end; row < last; row += w->rows) {
    const int some = least(last - row, w->rows);
    for (int c = 0; c < PANEL; c++) end[c] = p->last[c] - row;
    operand rows = {.at = A + (size_t)p->start * ld + row, .by_row = 1, .by_column = ld, .end = end};
    pack(&rows, 0, some, 0, PANEL, w->rows, X);
    w->panel(L, X);
    for (int c = 0; c < PANEL; c++) {
      double *to = A + (size_t)(p->start + c) * ld + row;
      if (end[c] >= w->rows && w->rows == 8)
        memcpy(to, X + c * 8, 8 * sizeof *X);
      else if (end[c] > 0)
        memcpy(to, X + c * w->rows, (size_t)least(end[c], w->rows) * sizeof *X);
    }
  }
}

/// The triangle on the panel's diagonal; zero if a pivot is not positive.
static int factor_triangle(const lanes *w, const panel *p, triangle *L, double *A, size_t ld) {
  int n = p->end - p->start;
  for (int c = 0; c < n; c++) {
    const double *column = A + (size_t)(p->start + c) * (ld + 1);
    double *to = L->entry + c * PANEL;
    int count = least(p->end, p->last[c]) - p->start - c;
    for (int i = 0; i < c; i++) to[i] = 0;
    for (int i = 0; i < count; i++) to[c + i] = column[i];
    for (int i = c + count; i < PANEL; i++) to[i] = 0;
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
    reduce_strips(w, &p, &L, A, ld);
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
