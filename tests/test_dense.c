/// Dense products and factors: against sums in extended precision, and the same bits by vectors of every length. The last too of
/// capsules that are displaced.
#include "geometry.h"
#include "lanes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/cavort.h"
#include "check.h"

enum { MOST = 150 };

static unsigned seed = 1;
static double number(void) {
  seed = seed * 1664525u + 1013904223u;
  return (double)(seed >> 8) / (1 << 24) - 0.5;
}

static double *numbers(size_t n) {
  double *x = malloc((n + 1) * sizeof *x);
  CHECK(x != NULL);
  for (size_t i = 0; x && i < n; i++) x[i] = number();
  return x;
}

/// The largest difference of C - C0 from sign * sum over k of A(i, k) B(k, j), within the part; elsewhere C is C0.
static double product_error(cav_triangle part, int m, int n, int k, double sign, const double *A, int ai, int ak,
                            const double *B, int bk, int bj, const double *C0, const double *C, int ldc) {
  double worst = 0;
  for (int j = 0; j < n; j++)
    for (int i = 0; i < m; i++) {
      long double sum = C0[i + j * ldc];
      if (part == CAV_TRIANGLE_BOTH || (part == CAV_TRIANGLE_LOWER ? i >= j : i <= j))
        for (int p = 0; p < k; p++)
          sum += (long double)sign * (long double)A[i * ai + p * ak] * (long double)B[p * bk + j * bj];
      worst = fmax(worst, fabs((double)(sum - C[i + j * ldc])));
    }
  return worst;
}

/// Products of a size, by vectors of every length.
static void check_products(int m, int n, int k) {
  int ld = 4 + (m > k ? m : k), ldb = k + 3, ldc = (m > n ? m : n) + 2;
  double *A = numbers((size_t)ld * (size_t)(m > k ? m : k)), *B = numbers((size_t)ldb * (size_t)(n > k ? n : k));
  double *C0 = numbers((size_t)ldc * (size_t)(m > n ? m : n)), *C = numbers((size_t)ldc * (size_t)(m > n ? m : n));
  double *kept = numbers((size_t)ldc * (size_t)(m > n ? m : n));
  size_t bytes = (size_t)ldc * (size_t)(m > n ? m : n) * sizeof(double);
  for (int what = 0; what < 3; what++)
    for (int lanes = 8; lanes >= 2; lanes /= 2) {
      double worst;
      lanes_most = lanes;
      memcpy(C, C0, bytes);
      if (what == 0) {
        cav_dense_product(m, n, k, -1, A, ld, B, ldb, C, ldc);
        worst = product_error(CAV_TRIANGLE_BOTH, m, n, k, -1, A, 1, ld, B, 1, ldb, C0, C, ldc);
      } else if (what == 1) {
        cav_dense_product_transposed(CAV_TRIANGLE_LOWER, m, n, k, 1, A, ld, B, ldb, C, ldc);
        worst = product_error(CAV_TRIANGLE_LOWER, m, n, k, 1, A, ld, 1, B, 1, ldb, C0, C, ldc);
      } else {
        cav_triangle part = k % 2 ? CAV_TRIANGLE_UPPER : CAV_TRIANGLE_LOWER;
        cav_dense_square(part, m, 1, k, A, ld, C, ldc);
        worst = product_error(part, m, m, k, 1, A, 1, ld, A, ld, 1, C0, C, ldc);
      }
      CHECK(worst < 1e-15 * (k + 4));
      if (lanes == 8) memcpy(kept, C, bytes);
      CHECK(memcmp(kept, C, bytes) == 0);
    }
  free(A), free(B), free(C0), free(C), free(kept);
}

/// Squares of rows that are zero in most columns, by vectors of every length and any number of parts: the bits of sums that
/// leave nothing out, slice by slice.
static void check_square(int n, int k) {
  int ld = n + 1, ldc = n + 2;
  size_t bytes = (size_t)ldc * (size_t)n * sizeof(double);
  double *A = numbers((size_t)ld * (size_t)k), *C0 = numbers((size_t)ldc * (size_t)n), *C = malloc(bytes),
         *plain = malloc(bytes);
  for (int p = 0; p < k; p++)
    for (int i = 0; i < n; i++)
      if ((i + p) % n % 11 > 2 || p % 7 == 3) A[i + p * ld] = (i + p) % 2 ? 0 : -0.0;
  memcpy(plain, C0, bytes);
  for (int j = 0; j < n; j++)
    for (int i = 0; i <= j; i++)
      for (int slice = 0; slice < k; slice += 128) {
        double sum = 0;
        for (int p = slice; p < k && p < slice + 128; p++) sum += A[i + p * ld] * A[j + p * ld];
        plain[i + j * ldc] += sum;
      }
  for (int parts = 1; parts <= 3; parts++)
    for (int lanes = 8; lanes >= 2 && n % parts == 0; lanes /= 2) {
      lanes_most = lanes;
      memcpy(C, C0, bytes);
      cav_dense_square(CAV_TRIANGLE_UPPER, n, parts, k, A, ld, C, ldc);
      CHECK(memcmp(plain, C, bytes) == 0);
      // in two steps, of either triangle: sums of several slices are joined first
      double *room = numbers(cav_dense_square_room(n)), worst = 0;
      memcpy(C, C0, bytes);
      cav_dense_square_find(CAV_TRIANGLE_UPPER, n, parts, k, A, ld, room);
      cav_dense_square_add(CAV_TRIANGLE_UPPER, n, parts, room, C, ldc);
      for (int j = 0; j < n; j++)
        for (int i = 0; i <= j; i++) worst = fmax(worst, fabs(plain[i + j * ldc] - C[i + j * ldc]));
      CHECK(k > 128 ? worst < 1e-13 : memcmp(plain, C, bytes) == 0);
      memcpy(C, C0, bytes);
      cav_dense_square_find(CAV_TRIANGLE_LOWER, n, parts, k, A, ld, room);
      cav_dense_square_add(CAV_TRIANGLE_LOWER, n, parts, room, C, ldc);
      worst = 0;
      for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
          const double added = i < j ? 0 : plain[j + i * ldc] - C0[j + i * ldc];
          worst = fmax(worst, fabs(C[i + j * ldc] - C0[i + j * ldc] - added));
        }
      CHECK(worst < 1e-13);
      free(room);
    }
  free(A), free(C0), free(C), free(plain);
}

/// A band whose columns end by blocks is factored and solved with; its entries out of the band hold what must not be read.
static void check_band(int n, int below, int step, int dense, int m) {
  int lda = dense ? n : below;
  size_t entries = (size_t)(below + 1) * (size_t)n + (size_t)n * (size_t)lda;
  double *A = malloc((entries + 1) * sizeof *A), *L = malloc((entries + 1) * sizeof *L);
  double *x = numbers((size_t)n * (size_t)m), *b = calloc((size_t)n * (size_t)m + 1, sizeof *b),
         *first = numbers((size_t)n * (size_t)m);
  for (size_t i = 0; i < entries; i++) A[i] = NAN;
  for (int j = 0; j < n; j++)
    for (int i = j; i < n && i <= j / step * step + below; i++)
      A[(size_t)i + (size_t)j * (size_t)lda] = i == j ? 1 + below : number();
  for (int r = 0; r < m; r++)
    for (int j = 0; j < n; j++)
      for (int i = j; i < n && i <= j / step * step + below; i++) {
        double a = A[(size_t)i + (size_t)j * (size_t)lda];
        b[i + r * n] += a * x[j + r * n];
        if (i != j) b[j + r * n] += a * x[i + r * n];
      }
  for (int lanes = 8; lanes >= 2; lanes /= 2) {
    lanes_most = lanes;
    memcpy(L, A, entries * sizeof *A);
    double *y = malloc(((size_t)n * (size_t)m + 1) * sizeof *y), worst = 0;
    memcpy(y, b, (size_t)n * (size_t)m * sizeof *y);
    CHECK(cav_dense_factor_blocks(n, below, step, L, lda));
    cav_dense_solve_lower_blocks(n, below, step, L, lda, m, y, n);
    cav_dense_solve_upper_blocks(n, below, step, L, lda, m, y, n);
    for (int i = 0; i < n * m; i++) worst = fmax(worst, fabs(y[i] - x[i]));
    CHECK(worst < 1e-13);
    if (lanes == 8) memcpy(first, y, (size_t)n * (size_t)m * sizeof *y);
    CHECK(memcmp(first, y, (size_t)n * (size_t)m * sizeof *y) == 0);
    free(y);
  }
  // not positive definite
  memcpy(L, A, entries * sizeof *A);
  L[(size_t)(n - 1) * (size_t)(lda + 1)] = -1;
  CHECK(!cav_dense_factor_blocks(n, below, step, L, lda));
  free(A), free(L), free(x), free(b), free(first);
}

/// A general matrix; a zero on the diagonal asks for exchanges.
static void check_general(int n, int m) {
  double *A = numbers((size_t)n * (size_t)n), *F = numbers((size_t)n * (size_t)n), *x = numbers((size_t)n * (size_t)m);
  double *b = calloc((size_t)n * (size_t)m + 1, sizeof *b), worst = 0;
  if (n > 1) A[0] = 0;
  memcpy(F, A, (size_t)n * (size_t)n * sizeof *A);
  cav_dense_product(n, m, n, 1, A, n, x, n, b, n);
  CHECK(cav_dense_solve_general(n, F, n, m, b, n));
  for (int i = 0; i < n * m; i++) worst = fmax(worst, fabs(b[i] - x[i]));
  CHECK(worst < 1e-10);
  for (int i = 0; i < n; i++) A[i * n] = 0;
  CHECK(!cav_dense_solve_general(n, A, n, m, b, n));
  free(A), free(F), free(x), free(b);
}

/// A block added by columns to what is there, or in its place.
static void check_transposed(int n, int ld, int ldc, cav_triangle part) {
  const size_t bytes = (size_t)ldc * (size_t)n * sizeof(double);
  double *A = numbers((size_t)ld * (size_t)n), *C0 = numbers((size_t)ldc * (size_t)n), *C = malloc(bytes);
  for (int lanes = 8; lanes >= 2; lanes /= 2)
    for (int fresh = 0; fresh < 2; fresh++) {
      int wrong = 0;
      lanes_most = lanes;
      memcpy(C, C0, bytes);
      cav_dense_add_transposed(part, fresh, n, A, ld, C, ldc);
      for (int j = 0; j < n; j++)
        for (int i = 0; i < ldc; i++) {
          const int there = i < n && (part == CAV_TRIANGLE_BOTH || i >= j);
          wrong += C[i + j * ldc] != (there ? A[i * ld + j] : 0) + (there && fresh ? 0 : C0[i + j * ldc]);
        }
      CHECK(wrong == 0);
    }
  free(A), free(C0), free(C);
}

static cav_shape capsule(const double *size, double reach) {
  cav_shape shape = {.type = CAV_GEOM_CAPSULE, .size = size};
  double q[4], sum = 0;
  for (int k = 0; k < 4; k++) q[k] = number(), sum += q[k] * q[k];
  for (int k = 0; k < 4; k++) q[k] /= sqrt(sum);
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    shape.pos[i] = reach * number();
    shape.rotation[4 * i] = 1 - 2 * (q[1 + j] * q[1 + j] + q[1 + k] * q[1 + k]);
    shape.rotation[3 * i + j] = 2 * (q[1 + i] * q[1 + j] - q[0] * q[1 + k]);
    shape.rotation[3 * i + k] = 2 * (q[1 + i] * q[1 + k] + q[0] * q[1 + j]);
  }
  return shape;
}

/// Rates of the point between two capsules: beside each other, across, end to end, parallel, crossing and about one centre.
static void check_capsules(void) {
  static const double size[][3] = {{0.1, 0.3}, {0.05, 0.6}};
  const double point[3] = {0.02, -0.01, 0.03};
  int met = 0;
  for (int i = 0; i < 4000; i++) {
    static cav_pair_manifolds m; // no byte of it is left to chance
    cav_touch here[2], rate[2][6];
    int found[2];
    cav_shape a = capsule(size[0], 0.8), b = capsule(size[1], 0.8);
    if (i % 16 == 0) memcpy(b.rotation, a.rotation, sizeof b.rotation);
    if (i % 16 == 1) memcpy(b.pos, a.pos, sizeof b.pos);
    memset(here, 0, sizeof here), memset(rate, 0, sizeof rate);
    for (int way = 0; way < 2; way++) {
      lanes_most = way ? 8 : 2;
      memset(&m, 0, sizeof m);
      cav_manifolds_start(&m, 0, 0.5, 0.2, NULL);
      m.a = a, m.b = b;
      found[way] = cav_touch_rates(&m, point, 0, &here[way], rate[way]);
    }
    CHECK(found[0] == found[1]);
    met += found[0];
    for (int k = 0; k < 6 && found[0] && found[1]; k++)
      CHECK(rate[0][k].dist == rate[1][k].dist && !memcmp(rate[0][k].pos, rate[1][k].pos, sizeof rate[0][k].pos) &&
            !memcmp(rate[0][k].normal, rate[1][k].normal, sizeof rate[0][k].normal));
  }
  CHECK(met > 1000 && met < 3990);
}

int main(void) {
  static const int size[] = {1, 2, 7, 8, 16, 17, 31, 81, MOST};
  enum { SIZES = sizeof size / sizeof *size };
  for (int a = 0; a < SIZES; a++)
    for (int b = 0; b < SIZES; b++) check_products(size[a], size[b], size[(a + b) % SIZES]);
  check_products(20, 20, 300);
  check_products(9, 5, 0);
  static const int zeros[][2] = {{6, 5}, {30, 64}, {81, 83}, {105, 200}, {126, 300}, {162, 40}};
  for (size_t i = 0; i < sizeof zeros / sizeof *zeros; i++) check_square(zeros[i][0], zeros[i][1]);
  for (int a = 0; a < SIZES; a++)
    for (int b = 0; b < SIZES; b++) {
      if (size[b] <= size[a]) check_band(size[a], size[b] - 1, 1, 0, 1 + 3 * (b % 3));
      check_band(size[a], size[a] - 1, 1, 1, 1 + b);
    }
  check_band(500, 80, 1, 0, 9);
  check_band(500, 80, 27, 0, 9);
  check_band(135, 80, 27, 0, 1);
  check_band(90, 8, 3, 0, 5);
  for (int a = 1; a < SIZES; a++) {
    check_transposed(size[a], 3 * size[a], 3 * size[a] - 1, CAV_TRIANGLE_BOTH);
    check_transposed(size[a], 3 * size[a], 3 * size[a] - 1, CAV_TRIANGLE_LOWER);
  }
  check_capsules();
  for (int a = 0; a < SIZES; a++) check_general(size[a], 1 + a);
  return check_result();
}
