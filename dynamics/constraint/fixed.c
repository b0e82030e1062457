/// What stands in the world beyond the reach of what moves costs next to nothing: balls that stand are taken in blocks of
/// neighbours in the list, each within a box that is found once; a call makes one box about each tree's balls, and a block
/// whose box it does not meet is left out with all its pairs. Boxes are grown by more than rounding can take, so
/// nothing nearer than the margin is left out. Many trees share one box.
#include "fixed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK = 8, TREES = 8, WORTH = 100 };
// of the coordinates, and m: more than rounding of boxes and distances
static const double ROUNDING = 1e-12;

typedef struct box {
  double low[3], high[3];
} box;

/// Consecutive pairs of one block and one tree; cell -1: never left out.
typedef struct span {
  cav_run run;
  int cell;
} span;

struct cav_fixed {
  int nball, ntree, nblock, nspan, nalways, pruned, kept; ///< pairs that can be left out, and those that cannot
  int *tree;                                              ///< [nball]
  int *first, *moving;   ///< [ntree+1] of each tree's balls in the list of those that move
  double *reach;         ///< [ntree] largest radius of these
  box *block, *about;    ///< [nblock], [ntree]
  char *meets;           ///< [nblock*ntree]
  span *span;            ///< [nspan]
  cav_run *always, *run; ///< [nalways] where no block is met; [nspan] room
};

void cav_fixed_free(cav_fixed *f) {
  if (!f) return;
  free(f->tree), free(f->first), free(f->moving), free(f->reach), free(f->block), free(f->about), free(f->meets),
      free(f->span), free(f->always), free(f->run);
  free(f);
}

size_t cav_fixed_bytes(const cav_fixed *f) {
  if (!f) return 0;
  size_t n = (size_t)f->nball, cells = (size_t)f->nblock * (size_t)f->ntree;
  return sizeof *f + 2 * n * sizeof(int) + (size_t)(f->nblock + f->ntree) * (sizeof(box) + sizeof(double)) + cells +
         (size_t)f->nspan * (sizeof(span) + 2 * sizeof(cav_run));
}

static void empty(box *b) {
  for (int k = 0; k < 3; k++) b->low[k] = INFINITY, b->high[k] = -INFINITY;
}

static inline void take(box *b, const double centre[3], double radius) {
  for (int k = 0; k < 3; k++) {
    double low = centre[k] - radius, high = centre[k] + radius;
    b->low[k] = low < b->low[k] ? low : b->low[k];
    b->high[k] = high > b->high[k] ? high : b->high[k];
  }
}

static inline int meet(const box *a, const box *b) {
  for (int k = 0; k < 3; k++)
    if (a->low[k] > b->high[k] || b->low[k] > a->high[k]) return 0;
  return 1;
}

/// Grows a box by a length and by what rounding can take.
static inline void grow(box *b, double length) {
  for (int k = 0; k < 3; k++) {
    b->low[k] -= length + ROUNDING * (1 + length + fabs(b->low[k]));
    b->high[k] += length + ROUNDING * (1 + length + fabs(b->high[k]));
  }
}

/// Block of each ball that stands, in the order of the list, and its box.
static void fill_blocks(cav_fixed *f, const double (*centre)[3], const double *radius, int *block_of) {
  int standing = 0;
  for (int i = 0; i < f->nball; i++) {
    block_of[i] = -1;
    if (f->tree[i] >= 0 || !isfinite(radius[i])) continue;
    block_of[i] = standing / BLOCK;
    if (standing++ % BLOCK == 0) empty(&f->block[f->nblock++]);
    take(&f->block[block_of[i]], centre[i], radius[i]);
  }
  for (int b = 0; b < f->nblock; b++) grow(&f->block[b], 0);
}

/// Balls of each tree; planes that move are never left out.
static void fill_trees(cav_fixed *f, const double *radius) {
  int n = 0;
  for (int t = 0; t < f->ntree; t++) {
    f->first[t] = n;
    f->reach[t] = 0;
    for (int i = 0; i < f->nball; i++) {
      if (f->tree[i] != t || !isfinite(radius[i])) continue;
      f->moving[n++] = i;
      f->reach[t] = fmax(f->reach[t], radius[i]);
    }
  }
  f->first[f->ntree] = n;
}

/// Block and tree of a pair of which exactly one ball moves; -1 for all others.
static int cell_of(const cav_fixed *f, const double *radius, const int *block_of, const cav_sweep_pair *pair) {
  if (pair->first < 0) return -1;
  int stands = block_of[pair->first] >= 0 ? pair->first : pair->second;
  int moves = stands == pair->first ? pair->second : pair->first;
  if (block_of[stands] < 0 || f->tree[moves] < 0 || !isfinite(radius[moves])) return -1;
  return block_of[stands] * f->ntree + f->tree[moves];
}

static void fill_spans(cav_fixed *f, const double *radius, const int *block_of, int npair, const cav_sweep_pair *pair) {
  for (int p = 0; p < npair; p++) {
    int cell = cell_of(f, radius, block_of, pair + p);
    *(cell < 0 ? &f->kept : &f->pruned) += 1;
    if (f->nspan && f->span[f->nspan - 1].cell == cell) {
      f->span[f->nspan - 1].run.end = p + 1;
    } else {
      f->span[f->nspan++] = (span){{p, p + 1}, cell};
    }
    if (cell < 0 && f->nalways && f->always[f->nalways - 1].end == p) {
      f->always[f->nalways - 1].end = p + 1;
    } else if (cell < 0) {
      f->always[f->nalways++] = (cav_run){p, p + 1};
    }
  }
}

cav_fixed *cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree, int npair,
                         const cav_sweep_pair *pair) {
  cav_fixed *f = calloc(1, sizeof *f);
  if (!f) return NULL;
  size_t n = (size_t)nball + 1, pairs = (size_t)npair + 1;
  f->nball = nball;
  for (int i = 0; i < nball; i++) f->ntree = tree[i] >= f->ntree ? tree[i] + 1 : f->ntree;
  int single = f->ntree > TREES;
  f->ntree = single || !f->ntree ? 1 : f->ntree;
  f->first = malloc(((size_t)f->ntree + 1) * sizeof *f->first);
  f->reach = malloc((size_t)f->ntree * sizeof *f->reach);
  f->tree = malloc(n * sizeof *f->tree);
  f->moving = malloc(n * sizeof *f->moving);
  f->block = malloc(n * sizeof *f->block);
  f->about = malloc((size_t)f->ntree * sizeof *f->about);
  f->meets = malloc(n * (size_t)f->ntree);
  f->span = malloc(pairs * sizeof *f->span);
  f->always = malloc(pairs * sizeof *f->always);
  f->run = malloc(pairs * sizeof *f->run);
  int *block_of = malloc(n * sizeof *block_of);
  if (!f->first || !f->reach || !f->tree || !f->moving || !f->block || !f->about || !f->meets || !f->span ||
      !f->always || !f->run || !block_of) {
    free(block_of);
    cav_fixed_free(f);
    return NULL;
  }
  for (int i = 0; i < nball; i++) f->tree[i] = tree[i] > 0 && single ? 0 : tree[i];
  fill_blocks(f, centre, radius, block_of);
  fill_trees(f, radius);
  fill_spans(f, radius, block_of, npair, pair);
  free(block_of);
  return f;
}

int cav_fixed_pays(const cav_fixed *f) { return f->pruned >= WORTH; }

/// Box about the balls of a tree, by their centres, grown by the largest radius and the margin.
static inline void surround(const cav_fixed *f, const double (*centre)[3], int t, double margin) {
  box b;
  empty(&b);
  for (const int *ball = f->moving + f->first[t], *end = f->moving + f->first[t + 1]; ball < end; ball++) {
    const double *at = centre[*ball];
    for (int k = 0; k < 3; k++) {
      b.low[k] = at[k] < b.low[k] ? at[k] : b.low[k];
      b.high[k] = at[k] > b.high[k] ? at[k] : b.high[k];
    }
  }
  grow(&b, f->reach[t] + margin);
  f->about[t] = b;
}

/// Whether any block meets any tree.
static int mark(cav_fixed *f, const double (*centre)[3], double margin) {
  int any = 0;
  for (int t = 0; t < f->ntree; t++) surround(f, centre, t, margin);
  for (int b = 0; b < f->nblock; b++)
    for (int t = 0; t < f->ntree; t++) any |= f->meets[b * f->ntree + t] = (char)meet(&f->block[b], &f->about[t]);
  return any;
}

int cav_fixed_find(cav_fixed *f, const double (*centre)[3], double margin, const cav_run **run, int *nrun) {
  int n = 0, count = f->kept;
  if (!mark(f, centre, margin)) {
    *run = f->always;
    *nrun = f->nalways;
    return count;
  }
  for (const span *s = f->span, *end = s + f->nspan; s < end; s++) {
    if (s->cell >= 0 && !f->meets[s->cell]) continue;
    if (s->cell >= 0) count += s->run.end - s->run.first;
    if (n && f->run[n - 1].end == s->run.first) {
      f->run[n - 1].end = s->run.end;
    } else {
      f->run[n++] = s->run;
    }
  }
  *run = f->run;
  *nrun = n;
  return count;
}
