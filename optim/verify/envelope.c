/// Cholesky factorisation of a symmetric matrix by rows within its envelope: A = L L', row i of L from the columns
/// before it. What couples far unknowns (the ends of a cycle, a free step) stands in long rows at the end.
#include "envelope.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct cav_envelope {
  int n, *first;    ///< [n]
  size_t *start;    ///< [n+1] of the rows
  double *a, *root; ///< the matrix, its factor
};

cav_envelope *cav_envelope_new(int n, const int *first) {
  cav_envelope *e = calloc(1, sizeof *e);
  if (!e) return NULL;
  e->n = n;
  e->first = malloc(((size_t)n + 1) * sizeof *e->first);
  e->start = malloc(((size_t)n + 1) * sizeof *e->start);
  if (e->first && e->start) {
    e->start[0] = 0;
    for (int i = 0; i < n; i++) {
      assert(first[i] >= 0 && first[i] <= i);
      e->first[i] = first[i];
      e->start[i + 1] = e->start[i] + (size_t)(i - first[i]) + 1;
    }
    e->a = calloc(e->start[n] + 1, sizeof(double));
    e->root = malloc((e->start[n] + 1) * sizeof(double));
  }
  if (e->a && e->root) return e;
  cav_envelope_free(e);
  return NULL;
}

void cav_envelope_free(cav_envelope *e) {
  if (!e) return;
  free(e->first), free(e->start), free(e->a), free(e->root);
  free(e);
}

// where entry (i, j), j <= i, stands
static size_t place(const cav_envelope *e, int i, int j) {
  assert(j >= e->first[i] && j <= i);
  return e->start[i] + (size_t)(j - e->first[i]);
}

void cav_envelope_add(cav_envelope *e, int i, int j, double x) { e->a[i >= j ? place(e, i, j) : place(e, j, i)] += x; }

void cav_envelope_combine(cav_envelope *e, double factor, const cav_envelope *other) {
  assert(e->n == other->n && e->start[e->n] == other->start[e->n]);
  for (size_t k = 0; k < e->start[e->n]; k++) e->a[k] += factor * other->a[k];
}

double cav_envelope_diagonal(const cav_envelope *e, int i) { return e->a[place(e, i, i)]; }

int cav_envelope_factor(cav_envelope *e, const double *diagonal) {
  memcpy(e->root, e->a, e->start[e->n] * sizeof(double));
  for (int i = 0; i < e->n; i++) {
    double *row = e->root + e->start[i];
    for (int j = e->first[i]; j <= i; j++) {
      const double *other = e->root + e->start[j];
      int from = e->first[i] > e->first[j] ? e->first[i] : e->first[j];
      const double *x = row + (from - e->first[i]), *y = other + (from - e->first[j]);
      double sum = row[j - e->first[i]] + (i == j ? diagonal[i] : 0);
      for (int k = 0; k < j - from; k++) sum -= x[k] * y[k];
      if (j < i) {
        row[j - e->first[i]] = sum / other[j - e->first[j]];
        continue;
      }
      if (!(sum > 0) || !isfinite(sum)) return 0;
      row[j - e->first[i]] = sqrt(sum);
    }
  }
  return 1;
}

void cav_envelope_solve(const cav_envelope *e, double *x) {
  for (int i = 0; i < e->n; i++) {
    const double *row = e->root + e->start[i];
    for (int j = e->first[i]; j < i; j++) x[i] -= row[j - e->first[i]] * x[j];
    x[i] /= row[i - e->first[i]];
  }
  for (int i = e->n - 1; i >= 0; i--) {
    const double *row = e->root + e->start[i];
    x[i] /= row[i - e->first[i]];
    for (int j = e->first[i]; j < i; j++) x[j] -= row[j - e->first[i]] * x[i];
  }
}
