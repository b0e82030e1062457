/// Cholesky factors of a sparse symmetric positive definite matrix, analysed once for each pattern. Seen by optim/ too.
#ifndef CAVORT_SPARSE_H
#define CAVORT_SPARSE_H

#include "cavort/model.h"

typedef struct cav_sparse cav_sparse;

/// Whether the library was built with CHOLMOD and finds it; loads it.
int cav_sparse_available(void);

/// blas: supernodes by BLAS where they pay, which is for one thread at a time (OpenBLAS's serial build is not safe from
/// two); 0: none, any number of threads. NULL if memory runs out, or where CHOLMOD is not available.
cav_sparse *cav_sparse_new(int blas);
void cav_sparse_free(cav_sparse *sparse);

/// Takes the pattern of the lower triangle by columns: start [n+1], row [start[n]] ascending, the diagonal first. Both
/// must outlive the factors. Orders it to fill in little and finds the pattern of the factor. CAV_NO_MEMORY.
cav_status cav_sparse_analyse(cav_sparse *sparse, int n, const int *start, const int *row);

/// Entries of the factor, and operations of one factorisation, of the last analysis.
double cav_sparse_entries(const cav_sparse *sparse);
double cav_sparse_work(const cav_sparse *sparse);

/// Factors the matrix with these values [start[n]]. CAV_NOT_CONVERGED if it is not positive definite, CAV_NO_MEMORY.
cav_status cav_sparse_factor(cav_sparse *sparse, const double *value);

/// x := A^-1 b with the last factor, b, x [n], may be the same. CAV_NO_MEMORY.
cav_status cav_sparse_solve(cav_sparse *sparse, const double *b, double *x);

#endif
