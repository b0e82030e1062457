/// Sparse Cholesky factors by SuiteSparse's CHOLMOD, ordered by approximate minimum degree. The only user of CHOLMOD.
/// Same pattern and values, same bits: the ordering is a function of the pattern, and what CHOLMOD does by threads
/// writes each entry once. The library allocates within every factorisation (the permuted matrix) even where pattern
/// and factor stay; solutions reuse their room.
#include "sparse.h"

#include <stdlib.h>

#ifdef CAVORT_LOADS_CHOLMOD
#include <string.h>
#include <suitesparse/cholmod.h>

#include "library.h"

// clang-format off
#define FUNCTIONS(X) \
  X(cholmod_start) X(cholmod_finish) X(cholmod_analyze) X(cholmod_factorize) X(cholmod_solve2) \
  X(cholmod_free_factor) X(cholmod_free_dense)
// clang-format on

typedef struct functions {
  FUNCTIONS(CAV_LIBRARY_POINTER)
} functions;

static const cav_library library = {
    "CHOLMOD", CAVORT_LOADS_CHOLMOD, "libsuitesparse-dev", {FUNCTIONS(CAV_LIBRARY_NAME) NULL}};

struct cav_sparse {
  functions call;
  cholmod_common common;
  cholmod_sparse matrix; // its arrays are the caller's
  cholmod_factor *factor;
  cholmod_dense *x, *y, *e; // solution and room of solves
};

static int load(functions *call) {
  char reason[200]; // those who ask go the dense way, as in a build without CHOLMOD
  return cav_library_load(&library, call, sizeof *call, reason, sizeof reason) == CAV_OK;
}

int cav_sparse_available(void) {
  functions call;
  return load(&call);
}

static cav_status status_of(const cav_sparse *s) {
  if (s->common.status == CHOLMOD_OUT_OF_MEMORY) return CAV_NO_MEMORY;
  return s->common.status == CHOLMOD_OK ? CAV_OK : CAV_NOT_CONVERGED;
}

cav_sparse *cav_sparse_new(int blas) {
  cav_sparse *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  if (!load(&s->call) || !s->call.cholmod_start(&s->common)) {
    free(s);
    return NULL;
  }
  s->common.print = 0;
  s->common.supernodal = blas ? CHOLMOD_AUTO : CHOLMOD_SIMPLICIAL;
  s->common.nmethods = 1;
  s->common.method[0].ordering = CHOLMOD_AMD;
  s->common.final_ll = 1; // an LDL' factor would not tell a matrix that is not positive definite
  s->common.quick_return_if_not_posdef = 1;
  return s;
}

void cav_sparse_free(cav_sparse *s) {
  if (!s) return;
  s->call.cholmod_free_factor(&s->factor, &s->common);
  s->call.cholmod_free_dense(&s->x, &s->common);
  s->call.cholmod_free_dense(&s->y, &s->common);
  s->call.cholmod_free_dense(&s->e, &s->common);
  s->call.cholmod_finish(&s->common);
  free(s);
}

// the caller's arrays, which CHOLMOD reads through pointers that are not const
static void *borrowed(const void *array) {
  void *pointer;
  memcpy(&pointer, &array, sizeof pointer);
  return pointer;
}

cav_status cav_sparse_analyse(cav_sparse *s, int n, const int *start, const int *row) {
  const size_t size = (size_t)n;
  s->matrix = (cholmod_sparse){.nrow = size,
                               .ncol = size,
                               .nzmax = (size_t)start[n],
                               .p = borrowed(start),
                               .i = borrowed(row),
                               .stype = -1,
                               .itype = CHOLMOD_INT,
                               .xtype = CHOLMOD_PATTERN,
                               .dtype = CHOLMOD_DOUBLE,
                               .sorted = 1,
                               .packed = 1};
  s->call.cholmod_free_factor(&s->factor, &s->common);
  s->factor = s->call.cholmod_analyze(&s->matrix, &s->common);
  s->matrix.xtype = CHOLMOD_REAL;
  return s->factor ? CAV_OK : CAV_NO_MEMORY;
}

double cav_sparse_entries(const cav_sparse *s) { return s->common.lnz; }
double cav_sparse_work(const cav_sparse *s) { return s->common.fl; }

cav_status cav_sparse_factor(cav_sparse *s, const double *value) {
  s->matrix.x = borrowed(value);
  if (!s->call.cholmod_factorize(&s->matrix, s->factor, &s->common)) return status_of(s);
  return s->factor->minor == s->matrix.ncol ? status_of(s) : CAV_NOT_CONVERGED;
}

cav_status cav_sparse_solve(cav_sparse *s, const double *b, double *x) {
  const size_t n = s->matrix.ncol;
  cholmod_dense right = {
      .nrow = n, .ncol = 1, .nzmax = n, .d = n, .x = borrowed(b), .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
  if (!s->call.cholmod_solve2(CHOLMOD_A, s->factor, &right, NULL, &s->x, NULL, &s->y, &s->e, &s->common))
    return status_of(s);
  memcpy(x, s->x->x, n * sizeof *x);
  return CAV_OK;
}

#else

int cav_sparse_available(void) { return 0; }
cav_sparse *cav_sparse_new(int blas) { return (void)blas, NULL; }
void cav_sparse_free(cav_sparse *sparse) { (void)sparse; }
cav_status cav_sparse_analyse(cav_sparse *sparse, int n, const int *start, const int *row) {
  return (void)sparse, (void)n, (void)start, (void)row, CAV_NOT_SUPPORTED;
}
double cav_sparse_entries(const cav_sparse *sparse) { return (void)sparse, 0; }
double cav_sparse_work(const cav_sparse *sparse) { return (void)sparse, 0; }
cav_status cav_sparse_factor(cav_sparse *sparse, const double *value) {
  return (void)sparse, (void)value, CAV_NOT_SUPPORTED;
}
cav_status cav_sparse_solve(cav_sparse *sparse, const double *b, double *x) {
  return (void)sparse, (void)b, (void)x, CAV_NOT_SUPPORTED;
}
#endif
