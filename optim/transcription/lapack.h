/// The routines of BLAS and LAPACK that are used, in Fortran's calling convention: matrices by columns, all by address.
/// Private to optim/. OpenBLAS's serial build is not safe from two threads: one calls them at a time.
#ifndef CAVORT_LAPACK_H
#define CAVORT_LAPACK_H

extern void dgemm_(const char *transa, const char *transb, const int *m, const int *n, const int *k,
                   const double *alpha, const double *A, const int *lda, const double *B, const int *ldb,
                   const double *beta, double *C, const int *ldc);
extern void dgemv_(const char *trans, const int *m, const int *n, const double *alpha, const double *A, const int *lda,
                   const double *x, const int *incx, const double *beta, double *y, const int *incy);
extern void dgesv_(const int *n, const int *nrhs, double *A, const int *lda, int *pivot, double *B, const int *ldb,
                   int *info);
extern void dpbtrf_(const char *uplo, const int *n, const int *kd, double *ab, const int *ldab, int *info);
extern void dposv_(const char *uplo, const int *n, const int *nrhs, double *A, const int *lda, double *B,
                   const int *ldb, int *info);
extern void dpotrf_(const char *uplo, const int *n, double *a, const int *lda, int *info);
extern void dpotrs_(const char *uplo, const int *n, const int *nrhs, const double *a, const int *lda, double *b,
                    const int *ldb, int *info);
extern void dsyrk_(const char *uplo, const char *trans, const int *n, const int *k, const double *alpha,
                   const double *A, const int *lda, const double *beta, double *C, const int *ldc);
extern void dtbtrs_(const char *uplo, const char *trans, const char *diag, const int *n, const int *kd, const int *nrhs,
                    const double *ab, const int *ldab, double *b, const int *ldb, int *info);

#endif
