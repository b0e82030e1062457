/// Products and factors of dense matrices and bands with one order of operations on every processor: wider vectors compute more
/// entries at once, never another sum. Matrices by columns, entry (i, j) of A at A[i + j * lda]. Nothing is allocated.
#ifndef CAVORT_DENSE_H
#define CAVORT_DENSE_H

#include <stddef.h>

#include "vectors.h"

/// Which entries of a product are added; the others of C stay.
typedef enum cav_triangle { CAV_TRIANGLE_BOTH, CAV_TRIANGLE_LOWER, CAV_TRIANGLE_UPPER } cav_triangle;

/// C += sign * A B: A [m*k], B [k*n], C [m*n].
void cav_dense_product(int m, int n, int k, double sign, const double *A, int lda, const double *B, int ldb, double *C,
                       int ldc);

/// C += sign * A' B, or the part of it: A [k*m], B [k*n], C [m*n].
void cav_dense_product_transposed(cav_triangle part, int m, int n, int k, double sign, const double *A, int lda,
                                  const double *B, int ldb, double *C, int ldc);

/// C += A A', one triangle of it: A [n*k], C [n*n]. Rows of A in equal parts, of which the like are often zero in the same
/// columns: zeros that stand together then cost nothing, to the same bits for any number of parts.
void cav_dense_square(cav_triangle part, int n, int parts, int k, const double *A, int lda, double *C, int ldc);

/// The same in two steps, of which the first need not wait for C: A A' into a room of as many numbers, then that added. To the
/// bits of one step, where A has no more than 128 columns; the sums of more are joined before they are added.
size_t cav_dense_square_room(int n);
void cav_dense_square_find(cav_triangle part, int n, int parts, int k, const double *A, int lda, double *room);
void cav_dense_square_add(cav_triangle part, int n, int parts, double *room, double *C, int ldc);

/// C += A, or its lower triangle, C [n*n] by columns, ldc apart, and A by rows; fresh: C := A.
void cav_dense_add_transposed(cav_triangle part, int fresh, int n, const double *A, int lda, double *C, int ldc);

/// Cholesky factor L of the lower triangle of A [n*n] in its place. Entries further than `below` under the diagonal are zero and
/// are not touched: a band keeps its columns at a distance of `below` + 1, which is lda = below. Zero if a pivot is not
/// positive.
int cav_dense_factor(int n, int below, double *A, int lda);

/// X := L^-1 X for X [n*m], L as cav_dense_factor left it.
void cav_dense_solve_lower(int n, int below, const double *L, int lda, int m, double *X, int ldx);

/// X := L'^-1 X.
void cav_dense_solve_upper(int n, int below, const double *L, int lda, int m, double *X, int ldx);

/// The same of a band whose columns end by blocks of `step`: column j's last row is the (j / step) * step + below of it,
/// so those after it within `below` of the diagonal stay untouched too.
int cav_dense_factor_blocks(int n, int below, int step, double *A, int lda);

/// The same from column `from` on, which an earlier call returned, 0 at first, as far as what is changed lies in the first
/// `ready` columns; -1 if a pivot is not positive. Parts make the factor of the whole, to its bits.
int cav_dense_factor_part(int n, int below, int step, int from, int ready, double *A, int lda);
void cav_dense_solve_lower_blocks(int n, int below, int step, const double *L, int lda, int m, double *X, int ldx);
void cav_dense_solve_upper_blocks(int n, int below, int step, const double *L, int lda, int m, double *X, int ldx);

/// X := A^-1 X for X [n*m] by rows exchanged; A becomes its factors. Zero if A is singular.
int cav_dense_solve_general(int n, double *A, int lda, int m, double *X, int ldx);

#endif
