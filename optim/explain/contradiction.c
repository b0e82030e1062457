/// Rank of equality rows, and which of them depend on each other, by SuiteSparse's SPQR: A' = Q R P' of the rows scaled
/// to length 1, where the columns of R beyond the rank are combinations of those before, R1 c = r2. Such a column with
/// those of c that are not zero is a circuit: each of its rows follows from the others, and their right sides have to
/// agree. Which rows stand for a circuit depends on the order of the columns only if several circuits share rows. The
/// only user of SPQR.
#include "contradiction.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"

void cav_row_groups_clear(cav_row_groups *groups) {
  free(groups->owner);
  *groups = (cav_row_groups){0};
}

#ifdef CAVORT_LOADS_SPQR
#include <suitesparse/SuiteSparseQR_C.h>

#include "library.h"

/// SPQR's library brings CHOLMOD's along, in which the loader looks too.
// clang-format off
#define FUNCTIONS(X) \
  X(SuiteSparseQR_C) X(cholmod_l_start) X(cholmod_l_finish) X(cholmod_l_allocate_sparse) \
  X(cholmod_l_free_sparse) X(cholmod_l_free)
// clang-format on

typedef struct functions {
  FUNCTIONS(CAV_LIBRARY_POINTER)
} functions;

static const cav_library library = {
    "SPQR", CAVORT_LOADS_SPQR, "libsuitesparse-dev", {FUNCTIONS(CAV_LIBRARY_NAME) NULL}};

int cav_contradictions_available(void) { return 1; }

cav_status cav_contradictions_load(cav_error *error) {
  functions call;
  char reason[300];
  cav_status status = cav_library_load(&library, &call, sizeof call, reason, sizeof reason);
  return status == CAV_OK ? status : cav_file_fail(error, status, 0, "%s", reason);
}

/// Combinations below this fraction of the largest weight are rounding.
static const double weight_floor = 1e-6;

typedef struct factors {
  functions call;
  cholmod_common common;
  cholmod_sparse *matrix, *R;
  SuiteSparse_long *order; ///< column of the matrix at each place of R; NULL: as they are
  long rank;
} factors;

static double length_of(const cav_linear_rows *rows, int i) {
  double sum = 0;
  for (int k = rows->start[i]; k < rows->start[i + 1]; k++) sum += rows->value[k] * rows->value[k];
  return sqrt(sum);
}

/// The rows, scaled, as columns; rows of zeros stay so.
static int fill_matrix(factors *f, const cav_linear_rows *rows) {
  size_t entries = (size_t)rows->start[rows->nrow];
  f->matrix = f->call.cholmod_l_allocate_sparse((size_t)rows->ncolumn, (size_t)rows->nrow, entries, 1, 1, 0,
                                                CHOLMOD_REAL, &f->common);
  if (!f->matrix) return 0;
  SuiteSparse_long *start = f->matrix->p, *index = f->matrix->i;
  double *value = f->matrix->x;
  for (int i = 0; i < rows->nrow; i++) {
    double length = length_of(rows, i);
    for (int k = rows->start[i]; k < rows->start[i + 1]; k++) {
      index[k] = rows->column[k];
      value[k] = length > 0 ? rows->value[k] / length : 0;
    }
    start[i] = rows->start[i];
  }
  start[rows->nrow] = rows->start[rows->nrow];
  return 1;
}

static int row_at(const factors *f, long place) { return (int)(f->order ? f->order[place] : place); }

/// Weights of the rows [nrow] that sum up to nothing, of the dependent column at a place of R; weights by place.
static void combine(const factors *f, long place, double *weight) {
  const SuiteSparse_long *start = f->R->p, *index = f->R->i;
  const double *value = f->R->x;
  memset(weight, 0, f->R->ncol * sizeof *weight);
  for (SuiteSparse_long k = start[place]; k < start[place + 1]; k++) weight[index[k]] = -value[k];
  // back substitution by columns
  for (long j = f->rank - 1; j >= 0; j--) {
    if (weight[j] == 0) continue;
    double diagonal = 0;
    for (SuiteSparse_long k = start[j]; k < start[j + 1]; k++)
      if (index[k] == j) diagonal = value[k];
    assert(diagonal != 0);
    weight[j] /= diagonal;
    for (SuiteSparse_long k = start[j]; k < start[j + 1]; k++)
      if (index[k] < j) weight[index[k]] -= value[k] * weight[j];
  }
  weight[place] = 1;
}

static int by_row(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/// One group from its weights by place; its lists start at row and weight_out.
static void fill_group(const factors *f, const cav_linear_rows *rows, double *weight, double tolerance,
                       cav_row_group *group) {
  double largest = 0;
  for (size_t j = 0; j < f->R->ncol; j++) largest = fmax(largest, fabs(weight[j]));
  for (size_t j = 0; j < f->R->ncol; j++)
    if (fabs(weight[j]) > weight_floor * largest) group->row[group->n++] = row_at(f, (long)j);
  qsort(group->row, (size_t)group->n, sizeof *group->row, by_row);
  for (size_t j = 0; j < f->R->ncol; j++) {
    if (!(fabs(weight[j]) > weight_floor * largest)) continue;
    int row = row_at(f, (long)j), at = 0;
    while (group->row[at] != row) at++;
    double length = length_of(rows, row);
    group->weight[at] = weight[j] / largest;
    group->mismatch += group->weight[at] * rows->right[row] / (length > 0 ? length : 1);
  }
  group->contradicts = fabs(group->mismatch) > tolerance;
}

static int by_mismatch(const void *a, const void *b) {
  const cav_row_group *x = a, *y = b;
  double m = fabs(x->mismatch), n = fabs(y->mismatch);
  if (m != n) return m < n ? 1 : -1;
  return x->row[0] - y->row[0];
}

/// All groups of the factors.
static cav_status fill_groups(const factors *f, const cav_linear_rows *rows, double tolerance, cav_row_groups *groups) {
  size_t n = (size_t)rows->nrow - (size_t)f->rank, most = (size_t)f->rank + 1;
  groups->rank = (int)f->rank;
  double *weight = malloc(((size_t)rows->nrow + 1) * sizeof *weight);
  char *block = malloc(n * (sizeof *groups->group + most * (sizeof(double) + sizeof(int))) + 1);
  groups->owner = block;
  if (!weight || !block) {
    free(weight);
    cav_row_groups_clear(groups);
    return CAV_NO_MEMORY;
  }
  groups->group = (cav_row_group *)(void *)block;
  double *weights = (double *)(void *)(groups->group + n);
  int *list = (int *)(void *)(weights + n * most);
  for (size_t g = 0; g < n; g++) {
    groups->group[g] = (cav_row_group){.row = list + g * most, .weight = weights + g * most};
    combine(f, f->rank + (long)g, weight);
    fill_group(f, rows, weight, tolerance, &groups->group[g]);
  }
  groups->n = (int)n;
  qsort(groups->group, n, sizeof *groups->group, by_mismatch);
  free(weight);
  return CAV_OK;
}

cav_status cav_contradictions_find(const cav_linear_rows *rows, double dependence, double tolerance,
                                   cav_row_groups *groups) {
  *groups = (cav_row_groups){0};
  if (rows->nrow == 0) return CAV_OK;
  factors f = {0};
  char reason[300];
  if (cav_library_load(&library, &f.call, sizeof f.call, reason, sizeof reason) != CAV_OK) return CAV_NOT_SUPPORTED;
  if (!f.call.cholmod_l_start(&f.common)) return CAV_NO_MEMORY;
  f.common.print = 0;
  cav_status status = CAV_NO_MEMORY;
  if (fill_matrix(&f, rows)) {
    f.rank = f.call.SuiteSparseQR_C(SPQR_ORDERING_COLAMD, dependence, 0, 0, f.matrix, NULL, NULL, NULL, NULL, &f.R,
                                    &f.order, NULL, NULL, NULL, &f.common);
    if (f.rank >= 0) status = fill_groups(&f, rows, tolerance, groups);
  }
  f.call.cholmod_l_free_sparse(&f.matrix, &f.common);
  f.call.cholmod_l_free_sparse(&f.R, &f.common);
  f.call.cholmod_l_free((size_t)rows->nrow, sizeof(SuiteSparse_long), f.order, &f.common);
  f.call.cholmod_l_finish(&f.common);
  return status;
}

#else

int cav_contradictions_available(void) { return 0; }
cav_status cav_contradictions_load(cav_error *error) {
  return cav_file_fail(error, CAV_NOT_SUPPORTED, 0, "this build has no SPQR");
}

cav_status cav_contradictions_find(const cav_linear_rows *rows, double dependence, double tolerance,
                                   cav_row_groups *groups) {
  (void)rows, (void)dependence, (void)tolerance;
  *groups = (cav_row_groups){0};
  return CAV_NOT_SUPPORTED;
}

#endif

// ---------------------------------------------------------------- rows of a transcription

static int is_equality(const cav_slot *slot) { return slot->lower == slot->upper; }

/// Adds an entry to the row being laid, in the order of its columns: two blocks of a short cycle can be one.
static void put_entry(int *column, double *value, int *n, int at, double x) {
  int k = *n;
  while (k > 0 && column[k - 1] > at) k--;
  if (k > 0 && column[k - 1] == at) {
    value[k - 1] += x;
    return;
  }
  memmove(column + k + 1, column + k, (size_t)(*n - k) * sizeof *column);
  memmove(value + k + 1, value + k, (size_t)(*n - k) * sizeof *value);
  column[k] = at;
  value[k] = x;
  ++*n;
}

/// Lays row i of knot t over the unknowns; returns its number of entries.
static int lay_row(const cav_transcription *tr, int t, int i, int *column, double *value) {
  int nv = tr->nv, n = 0;
  const double *row = tr->knot[t].slot_row + (size_t)i * 3 * (size_t)nv;
  for (int c = 0; c < 3; c++) {
    int block = cav_transcription_block(tr, t, c);
    for (int d = 0; block >= 0 && d < nv; d++)
      if (row[c * nv + d] != 0) put_entry(column, value, &n, block * nv + d, row[c * nv + d]);
  }
  if (tr->free_step && tr->knot[t].slot_step[i] != 0)
    put_entry(column, value, &n, cav_transcription_blocks(tr) * nv, tr->knot[t].slot_step[i]);
  return n;
}

cav_status cav_transcription_contradictions(const cav_transcription *tr, double tolerance, cav_row_groups *groups,
                                            cav_binding **row) {
  size_t nrow = 0, width = 3 * (size_t)tr->nv + 1;
  *groups = (cav_row_groups){0};
  *row = NULL;
  if (!cav_contradictions_available()) return CAV_NOT_SUPPORTED;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) nrow += (size_t)is_equality(&tr->knot[t].slot[i]);
  int *start = malloc((nrow + 1) * sizeof *start), *column = malloc((nrow * width + 1) * sizeof *column);
  double *value = malloc((nrow * width + 1) * sizeof *value), *right = malloc((nrow + 1) * sizeof *right);
  cav_binding *from = calloc(nrow + 1, sizeof *from);
  cav_status status = CAV_NO_MEMORY;
  if (start && column && value && right && from) {
    int n = 0, entries = 0;
    for (int t = 0; t < tr->nknot; t++) {
      for (int i = 0; i < tr->knot[t].layout.count; i++) {
        const cav_slot *slot = &tr->knot[t].slot[i];
        if (!is_equality(slot)) continue;
        cav_transcription_origin(tr, t, i, &from[n]);
        start[n] = entries;
        right[n++] = slot->lower - slot->value;
        entries += lay_row(tr, t, i, column + entries, value + entries);
      }
    }
    start[n] = entries;
    cav_linear_rows rows = {n, cav_transcription_unknowns(tr), start, column, value, right};
    status = cav_contradictions_find(&rows, 1e-8, tolerance, groups);
  }
  free(start), free(column), free(value), free(right);
  if (status != CAV_OK) {
    free(from);
    from = NULL;
  }
  *row = from;
  return status;
}
