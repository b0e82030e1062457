/// Sweep and prune (Baraff 1992; Cohen, Lin, Manocha and Ponamgi 1995) along one axis, that on which the centres spread
/// most: balls are sorted by their lower ends, and each is compared with those that begin before it ends. The order is
/// kept from call to call, where it changes little. A table of all pairs of balls says which of them are pairs of the
/// scene, and marks in a row of bits give them in ascending order: what is found does not depend on the order of
/// before. Not done: boxes instead of balls, trees; balls as large as the scene are compared with all.
#include "sweep.h"

#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "math3.h"

enum { WORD = 64 };
// what rounding may take from the square of an activation distance
static const double ROUNDING = 1 + 1e-12;

/// A ball in the order of the sweep.
typedef struct ball {
  double low, high, centre[3], radius; ///< ends along the axis; grown by half the margin
  int index;
} ball;

struct cav_sweep {
  int nball, npair, nword;
  double *radius;
  ball *ball;              ///< [nball] by their lower ends
  int *table;              ///< [nball*nball] pair of two balls, -1: none; above the diagonal
  uint64_t *always, *mark; ///< [nword] a bit a pair
  int *found;              ///< [npair]
};

void cav_sweep_free(cav_sweep *s) {
  if (!s) return;
  free(s->radius), free(s->ball), free(s->table), free(s->always), free(s->mark), free(s->found);
  free(s);
}

size_t cav_sweep_bytes(const cav_sweep *s) {
  if (!s) return 0;
  size_t n = (size_t)s->nball;
  return sizeof *s + n * (sizeof *s->radius + sizeof *s->ball + n * sizeof *s->table) +
         (size_t)s->nword * 2 * sizeof *s->mark + (size_t)s->npair * sizeof *s->found;
}

static int *entry(const cav_sweep *s, int i, int j) {
  assert(i >= 0 && i < s->nball && j >= 0 && j < s->nball);
  return s->table + (size_t)(i < j ? i : j) * (size_t)s->nball + (i < j ? j : i);
}

static void set_bit(uint64_t *bits, int p) { bits[p / WORD] |= (uint64_t)1 << p % WORD; }

cav_sweep *cav_sweep_new(int nball, const double *radius, int npair, const cav_sweep_pair *pair) {
  cav_sweep *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  size_t n = (size_t)nball;
  *s = (cav_sweep){.nball = nball, .npair = npair, .nword = (npair + WORD - 1) / WORD};
  s->radius = malloc(sizeof *s->radius * n);
  s->ball = malloc(sizeof *s->ball * n);
  s->table = malloc(sizeof *s->table * n * n);
  s->always = calloc((size_t)s->nword, sizeof *s->always);
  s->mark = malloc(sizeof *s->mark * (size_t)s->nword);
  s->found = malloc(sizeof *s->found * (size_t)npair);
  if (!s->radius || !s->ball || !s->table || !s->always || !s->mark || !s->found) {
    cav_sweep_free(s);
    return NULL;
  }
  memcpy(s->radius, radius, sizeof *radius * n);
  memset(s->table, -1, sizeof *s->table * n * n);
  for (int i = 0; i < nball; i++) s->ball[i].index = i;
  for (int p = 0; p < npair; p++) {
    int *at = pair[p].first < 0 ? NULL : entry(s, pair[p].first, pair[p].second);
    // a second pair of the same two has no place in the table
    if (at && *at < 0)
      *at = p;
    else
      set_bit(s->always, p);
  }
  return s;
}

// the axis along which the centres spread most
static int widest(const cav_sweep *s, const double (*centre)[3]) {
  double sum[3] = {0, 0, 0}, square[3] = {0, 0, 0};
  int axis = 0;
  for (int i = 0; i < s->nball; i++) {
    for (int k = 0; k < 3; k++) sum[k] += centre[i][k], square[k] += centre[i][k] * centre[i][k];
  }
  for (int k = 0; k < 3; k++) square[k] -= sum[k] * sum[k] / s->nball;
  for (int k = 1; k < 3; k++) {
    if (square[k] > square[axis]) axis = k;
  }
  return axis;
}

// by insertion: in order but for what has moved since the last call
static void sort(cav_sweep *s) {
  for (int i = 1; i < s->nball; i++) {
    ball moved = s->ball[i];
    int k = i;
    for (; k > 0 && s->ball[k - 1].low > moved.low; k--) s->ball[k] = s->ball[k - 1];
    s->ball[k] = moved;
  }
}

static void place(cav_sweep *s, const double (*centre)[3], double margin) {
  int axis = widest(s, centre);
  for (int i = 0; i < s->nball; i++) {
    ball *b = s->ball + i;
    copy3(b->centre, centre[b->index]);
    b->radius = s->radius[b->index] + margin / 2;
    b->low = b->centre[axis] - b->radius;
    b->high = b->centre[axis] + b->radius;
  }
  sort(s);
}

int cav_sweep_find(cav_sweep *s, const double (*centre)[3], double margin, const int **found) {
  int count = 0;
  place(s, centre, margin);
  memcpy(s->mark, s->always, sizeof *s->mark * (size_t)s->nword);
  for (const ball *a = s->ball, *end = a + s->nball; a < end; a++) {
    for (const ball *b = a + 1; b < end && b->low < a->high; b++) {
      double d[3], activation = a->radius + b->radius;
      sub3(d, b->centre, a->centre);
      if (!(dot3(d, d) < activation * activation * ROUNDING)) continue;
      int p = *entry(s, a->index, b->index);
      if (p >= 0) set_bit(s->mark, p);
    }
  }
  for (int w = 0; w < s->nword; w++) {
    for (uint64_t bits = s->mark[w]; bits; bits &= bits - 1) s->found[count++] = w * WORD + __builtin_ctzll(bits);
  }
  assert(count <= s->npair);
  *found = s->found;
  return count;
}
