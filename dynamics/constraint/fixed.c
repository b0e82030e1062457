/// What stands in the world beyond the reach of what moves costs next to nothing: balls that stand are taken in blocks of
/// neighbours in the list, each within a box that is found once. A tree is out of reach of all of them while its root is
/// farther from every block than its links can stretch; how far that is, is found anew only once the root has moved by what
/// was left. Within it a call makes one box about the tree's balls, and a block whose box it does not meet is left out with
/// all its pairs. Boxes and reaches are grown by more than rounding can take, so nothing nearer than the margin is left
/// out. Many trees share one box, and have no reach.
#include "fixed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK = 8, TREES = 8, WORTH = 100 };
// of the coordinates, and m: more than rounding of boxes and distances
static const double ROUNDING = 1e-12;
// of the reach: more than a chain of thousands of rotations adds to its length
static const double STRETCH = 1e-9;

typedef struct box {
  double low[3], high[3];
} box;

/// Consecutive pairs of one block and one tree; cell -1: never left out.
typedef struct span {
  cav_run run;
  int cell;
} span;

/// How far the root of a tree was from the nearest block, where that was asked last.
typedef struct place {
  double at[3], distance;
} place;

struct cav_fixed {
  int nball, ntree, nblock, nspan, pruned, kept; ///< pairs that can be left out, and those that cannot
  int *tree;                                     ///< [nball]
  int *first, *moving;                           ///< [ntree+1] of each tree's balls in the list of those that move
  double *largest;                               ///< [ntree] radius of these
  double *reach;                                 ///< [ntree] of these from the root
  place *last;                                   ///< [ntree]
  box *block, *about;                            ///< [nblock], [ntree]
  char *meets;                                   ///< [nblock*ntree]
  span *span;                                    ///< [nspan]
  int *always;                                   ///< [kept] pairs
  cav_run behind, *run;                          ///< where no block is met; [nspan] room
};

void cav_fixed_free(cav_fixed *f) {
  if (!f) return;
  free(f->tree), free(f->first), free(f->moving), free(f->largest), free(f->reach), free(f->last), free(f->block),
      free(f->about), free(f->meets), free(f->span), free(f->always), free(f->run);
  free(f);
}

size_t cav_fixed_bytes(const cav_fixed *f) {
  if (!f) return 0;
  size_t n = (size_t)f->nball, cells = (size_t)f->nblock * (size_t)f->ntree;
  return sizeof *f + (2 * n + (size_t)f->kept) * sizeof(int) + (size_t)(f->nblock + f->ntree) * sizeof(box) +
         (size_t)f->ntree * (sizeof(place) + 2 * sizeof(double)) + cells +
         (size_t)f->nspan * (sizeof(span) + sizeof(cav_run));
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
    f->largest[t] = 0;
    for (int i = 0; i < f->nball; i++) {
      if (f->tree[i] != t || !isfinite(radius[i])) continue;
      f->moving[n++] = i;
      f->largest[t] = fmax(f->largest[t], radius[i]);
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
    if (cell < 0) {
      f->always[f->kept++] = p;
    } else {
      f->pruned++;
    }
    if (f->nspan && f->span[f->nspan - 1].cell == cell) {
      f->span[f->nspan - 1].run.end = p + 1;
    } else {
      f->span[f->nspan++] = (span){{p, p + 1}, cell};
    }
  }
  f->behind = (cav_run){npair, npair + f->kept};
}

/// What reaches the trees have, and that nothing is known of where they are.
static void fill_reaches(cav_fixed *f, const double *reach, int single) {
  for (int t = 0; t < f->ntree; t++) {
    f->reach[t] = single ? INFINITY : reach[t] * (1 + STRETCH);
    f->last[t] = (place){{NAN, NAN, NAN}, 0};
  }
}

cav_fixed *cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree,
                         const double *reach, int npair, const cav_sweep_pair *pair) {
  cav_fixed *f = calloc(1, sizeof *f);
  if (!f) return NULL;
  size_t n = (size_t)nball + 1, pairs = (size_t)npair + 1;
  f->nball = nball;
  for (int i = 0; i < nball; i++) f->ntree = tree[i] >= f->ntree ? tree[i] + 1 : f->ntree;
  int single = f->ntree > TREES || !f->ntree;
  f->ntree = single ? 1 : f->ntree;
  f->first = malloc(((size_t)f->ntree + 1) * sizeof *f->first);
  f->largest = malloc((size_t)f->ntree * sizeof *f->largest);
  f->reach = malloc((size_t)f->ntree * sizeof *f->reach);
  f->last = malloc((size_t)f->ntree * sizeof *f->last);
  f->tree = malloc(n * sizeof *f->tree);
  f->moving = malloc(n * sizeof *f->moving);
  f->block = malloc(n * sizeof *f->block);
  f->about = malloc((size_t)f->ntree * sizeof *f->about);
  f->meets = malloc(n * (size_t)f->ntree);
  f->span = malloc(pairs * sizeof *f->span);
  f->always = malloc(pairs * sizeof *f->always);
  f->run = malloc(pairs * sizeof *f->run);
  int *block_of = malloc(n * sizeof *block_of);
  if (!f->first || !f->largest || !f->reach || !f->last || !f->tree || !f->moving || !f->block || !f->about ||
      !f->meets || !f->span || !f->always || !f->run || !block_of) {
    free(block_of);
    cav_fixed_free(f);
    return NULL;
  }
  for (int i = 0; i < nball; i++) f->tree[i] = tree[i] > 0 && single ? 0 : tree[i];
  fill_blocks(f, centre, radius, block_of);
  fill_trees(f, radius);
  fill_spans(f, radius, block_of, npair, pair);
  fill_reaches(f, reach, single);
  free(block_of);
  return f;
}

int cav_fixed_pays(const cav_fixed *f) { return f->pruned >= WORTH; }

const int *cav_fixed_always(const cav_fixed *f, int *count) {
  *count = f->kept;
  return f->always;
}

/// Distance of a point from the nearest block, less what rounding can take from it and from the path there.
static double distance(const cav_fixed *f, const double at[3]) {
  double least = INFINITY;
  for (const box *b = f->block, *end = b + f->nblock; b < end; b++) {
    double square = 0;
    for (int k = 0; k < 3; k++) {
      double below = b->low[k] - at[k], above = at[k] - b->high[k], d = below > above ? below : above;
      square += d > 0 ? d * d : 0;
    }
    least = square < least ? square : least;
  }
  least = sqrt(least);
  return least - ROUNDING * (1 + 2 * least + fabs(at[0]) + fabs(at[1]) + fabs(at[2]));
}

/// Whether a tree whose root is here reaches no block. What is known from where it was holds while the root has moved by less
/// than what was left, or was missing.
static inline int is_clear(cav_fixed *f, int t, const double at[3], double margin) {
  place *last = &f->last[t];
  double reach = f->reach[t] + margin, left = last->distance - reach;
  double x = at[0] - last->at[0], y = at[1] - last->at[1], z = at[2] - last->at[2];
  if (x * x + y * y + z * z < left * left) return left > 0;
  if (isinf(reach)) return 0;
  *last = (place){{at[0], at[1], at[2]}, distance(f, at)};
  return last->distance > reach;
}

/// Box about the balls of a tree, by their centres, grown by the largest radius and the margin.
static void surround(const cav_fixed *f, const double (*centre)[3], int t, double margin) {
  box b;
  empty(&b);
  for (const int *ball = f->moving + f->first[t], *end = f->moving + f->first[t + 1]; ball < end; ball++) {
    const double *at = centre[*ball];
    for (int k = 0; k < 3; k++) {
      b.low[k] = at[k] < b.low[k] ? at[k] : b.low[k];
      b.high[k] = at[k] > b.high[k] ? at[k] : b.high[k];
    }
  }
  grow(&b, f->largest[t] + margin);
  f->about[t] = b;
}

/// Whether any block meets any tree. The box of a tree that reaches none is empty: it meets nothing.
static int mark(cav_fixed *f, const double (*centre)[3], const double (*root)[3], double margin) {
  int any = 0, near = 0;
  for (int t = 0; t < f->ntree; t++) {
    if (is_clear(f, t, root[t], margin)) {
      empty(&f->about[t]);
    } else {
      surround(f, centre, t, margin);
      near = 1;
    }
  }
  for (int b = 0; near && b < f->nblock; b++)
    for (int t = 0; t < f->ntree; t++) any |= f->meets[b * f->ntree + t] = (char)meet(&f->block[b], &f->about[t]);
  return any;
}

int cav_fixed_find(cav_fixed *f, const double (*centre)[3], const double (*root)[3], double margin, const cav_run **run,
                   int *nrun) {
  int n = 0, count = f->kept;
  if (!mark(f, centre, root, margin)) {
    *run = &f->behind;
    *nrun = 1;
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
