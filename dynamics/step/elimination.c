/// Elimination of the Hessian M + J' H J of one island from the leaves (Featherstone 2008, section 6.5), along the tree that it
/// makes of the dofs (elimination tree, Liu 1990): M joins a dof with those towards its root, a constraint all dofs that it sees
/// with one another, and what is eliminated joins those that are left. A dof's parent is the last of those before it that it is
/// then joined with, and its row holds all dofs from the root down to itself. Where constraints join no branches, as feet on the
/// ground, that is the tree of the dofs, without any fill.
///
/// Dofs are numbered so that the branches of the tree follow one another whole. Rows begin at the root, each at a multiple of
/// four: the numbers of a row that stand above one of its dofs are the first ones, those of that dof's own row stand at the same
/// places, and both are taken by four, past the diagonal too, where nothing is read. Columns of J lie at the same places. Every
/// entry has the same operations in the same order whatever the vectors of the processor are.
#include "elimination.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "vectors.h"

enum { FOUR = 4, WORD = 64 };

// columns of a clique that stand together, by fours
typedef struct run {
  int column; // first of them among those of a row of the matrix
  int first;  // among those of a row of J
  int width;
} run;

// one dof of a clique
typedef struct member {
  int dof;    // number of the dof
  int column; // of J
  int source; // among the dofs of the blocks
  int run;    // which run its column is in
} member;

// blocks that see the same dofs
typedef struct clique {
  int nmember, nrun, width;
  const member *member; // ascending
  const run *run;
} clique;

struct cav_elimination {
  const cav_impulse *part;
  int n;
  const int *of_block;       // [nblock] clique of each block
  int *dof, *number;         // [n] the dof of each number, and the number of each local dof
  int *parent, *depth, *row; // [n], [n], [n+1]
  int *path;                 // dofs from the root down, by rows
  clique *clique;            // [ncliques]
  double *inertia, *value;   // rows of M, and of the factors
  double *least, *pivot, *x,
      *along;                       // [n] pivots of M, inverse pivots, right-hand side; [n+4] scratch
  double *J, *bent;                 // rows of all blocks by the columns of their cliques; H J of one block
  void *pattern, *numbers, *rows;   // memory of the above
  size_t npattern, nnumbers, nrows; // its bytes
};

cav_elimination *cav_elimination_new(void) { return calloc(1, sizeof(cav_elimination)); }

void cav_elimination_free(cav_elimination *e) {
  if (!e) return;
  free(e->pattern), free(e->numbers), free(e->rows);
  free(e);
}

size_t cav_elimination_bytes(const cav_elimination *e) {
  return e ? sizeof *e + e->npattern + e->nnumbers + e->nrows : 0;
}

// ---------------------------------------------------------------- pattern

static int highest_bit(const uint64_t *set, int words) {
  for (int w = words - 1; w >= 0; w--)
    if (set[w]) return w * WORD + WORD - 1 - __builtin_clzll(set[w]);
  return -1;
}

static void put_bit(uint64_t *set, int i) { set[i / WORD] |= (uint64_t)1 << (i % WORD); }

static int first_of_clique(const cav_elimination *e, int b) { return b == 0 || e->of_block[b] != e->of_block[b - 1]; }

// parent [n] of each local dof in the elimination tree, -1 of a root; before [n*words] are sets of the dofs before each that
// it is joined with
static void find_tree(const cav_elimination *e, const int *dof, const int *local, uint64_t *before, int words,
                      int *parent) {
  const cav_impulse *p = e->part;
  const size_t size = (size_t)words;
  memset(before, 0, (size_t)(e->n + 1) * size * sizeof *before);
  for (int i = 0; i < e->n; i++) {
    const int up = p->state->work->parent[dof[i]];
    if (up < 0) continue;
    memcpy(before + (size_t)i * size, before + (size_t)local[up] * size, size * sizeof *before);
    put_bit(before + (size_t)i * size, local[up]);
  }
  uint64_t *all = before + (size_t)e->n * size;
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    if (!first_of_clique(e, b) || block->ndof < 2) continue;
    memset(all, 0, size * sizeof *all);
    for (int k = 0; k < block->ndof; k++) put_bit(all, local[block->dof[k]]);
    for (int k = 0; k < block->ndof; k++) {
      const int i = local[block->dof[k]], last = i / WORD;
      uint64_t *set = before + (size_t)i * size;
      for (int w = 0; w < last; w++) set[w] |= all[w];
      set[last] |= all[last] & (((uint64_t)1 << (i % WORD)) - 1);
    }
  }
  for (int i = e->n - 1; i >= 0; i--) {
    uint64_t *set = before + (size_t)i * size;
    const int up = parent[i] = highest_bit(set, words);
    if (up < 0) continue;
    set[up / WORD] &= ~((uint64_t)1 << (up % WORD));
    for (int w = 0; w <= up / WORD; w++) before[(size_t)up * size + (size_t)w] |= set[w];
  }
}

// numbers the dofs so that each branch of the tree given by up [n] stands whole behind its root; places of their rows. size, next
// [n] are overwritten
static void number_dofs(cav_elimination *e, const int *dof, const int *up, int *size, int *next) {
  int roots = 0, at = 0;
  for (int i = 0; i < e->n; i++) size[i] = 1;
  for (int i = e->n - 1; i >= 0; i--)
    if (up[i] >= 0) size[up[i]] += size[i];
  for (int i = 0; i < e->n; i++) {
    int *from = up[i] < 0 ? &roots : &next[up[i]];
    const int k = *from;
    *from += size[i];
    next[i] = k + 1;
    e->number[i] = k;
    e->dof[k] = dof[i];
    e->parent[k] = up[i] < 0 ? -1 : e->number[up[i]];
    e->depth[k] = up[i] < 0 ? 0 : e->depth[e->parent[k]] + 1;
  }
  for (int k = 0; k < e->n; k++) {
    e->row[k] = at;
    at += (e->depth[k] / FOUR + 1) * FOUR;
  }
  e->row[e->n] = at;
}

// the dofs of a block from the root on, and where their columns stand
static void fill_clique(const cav_elimination *e, const cav_block *block, const int *local, clique *c, member *to,
                        run *runs) {
  int n = 0, nrun = 0, width = 0;
  for (int k = block->ndof - 1; k >= 0; k--, n++) {
    const member found = {.dof = e->number[local[block->dof[k]]], .source = k};
    int at = n;
    for (; at > 0 && to[at - 1].dof > found.dof; at--) to[at] = to[at - 1];
    to[at] = found;
  }
  for (int k = 0; k < n; k++) {
    const int depth = e->depth[to[k].dof], four = depth / FOUR * FOUR;
    if (nrun == 0 || four > runs[nrun - 1].column + runs[nrun - 1].width)
      runs[nrun++] = (run){.column = four, .first = width};
    run *last = &runs[nrun - 1];
    if (four == last->column + last->width) {
      last->width += FOUR;
      width += FOUR;
    }
    to[k].column = last->first + depth - last->column;
    to[k].run = nrun - 1;
  }
  *c = (clique){.nmember = n, .nrun = nrun, .width = width, .member = to, .run = runs};
}

// cliques of the blocks; returns how many numbers the rows of all blocks have by their columns, wide those of the widest
static size_t fill_cliques(cav_elimination *e, const int *local, member *to, run *runs, size_t *wide) {
  const cav_impulse *p = e->part;
  size_t numbers = 0;
  *wide = 0;
  for (int b = 0; b < p->nblock; b++) {
    clique *c = &e->clique[e->of_block[b]];
    if (first_of_clique(e, b)) {
      fill_clique(e, &p->block[b], local, c, to, runs);
      to += c->nmember;
      runs += c->nrun;
    }
    const size_t size = (size_t)p->block[b].dim * (size_t)c->width;
    numbers += size;
    *wide = *wide > size ? *wide : size;
  }
  return numbers;
}

static void fill_rows(cav_elimination *e, size_t numbers) {
  const cav_impulse *p = e->part;
  double *to = e->J;
  memset(to, 0, numbers * sizeof *to);
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    const clique *c = &e->clique[e->of_block[b]];
    for (int i = 0; i < block->dim; i++, to += c->width)
      for (int k = 0; k < c->nmember; k++) to[c->member[k].column] = block->J[i * block->ndof + c->member[k].source];
  }
}

// the dofs from the root down to each, in the places of their columns
static void fill_paths(cav_elimination *e) {
  for (int k = 0; k < e->n; k++) {
    int *path = e->path + e->row[k];
    for (int a = 0; a < e->depth[k]; a++) path[a] = e->path[e->row[e->parent[k]] + a];
    path[e->depth[k]] = k;
  }
}

static void fill_inertia(cav_elimination *e, const int *local) {
  const cav_impulse *p = e->part;
  const cav_workspace *work = p->state->work;
  memset(e->inertia, 0, (size_t)e->row[e->n] * sizeof *e->inertia);
  for (int k = 0; k < e->n; k++) {
    const double *M = p->M + work->row[e->dof[k]];
    double *to = e->inertia + e->row[k];
    e->least[k] = p->L[work->row[e->dof[k]]];
    for (int j = e->dof[k], i = 0; j >= 0; j = work->parent[j], i++) to[e->depth[e->number[local[j]]]] = M[i];
  }
}

// rooms of what grows with the dofs, and of the cliques with so many members in all
static int open_pattern(cav_elimination *e, size_t n, size_t ncliques, size_t members, size_t sets, uint64_t **before,
                        member **to, run **runs, int **scratch) {
  const size_t bytes = sets * sizeof(uint64_t) + ncliques * sizeof(clique) + members * (sizeof(member) + sizeof(run)) +
                       (8 * n + 1) * sizeof(int);
  if (!make_room(&e->pattern, &e->npattern, bytes, 1)) return 0;
  *before = e->pattern;
  e->clique = (clique *)(*before + sets);
  *to = (member *)(e->clique + ncliques);
  *runs = (run *)(*to + members);
  int *at = (int *)(*runs + members), **const array[] = {&e->dof, &e->number, &e->parent, &e->depth};
  for (int i = 0; i < 4; i++, at += n) *array[i] = at;
  e->row = at;
  *scratch = at + n + 1;
  return 1;
}

cav_status cav_elimination_begin(cav_elimination *e, const cav_impulse *part, int ndof, const int *dof,
                                 const int *local, const int *of_block) {
  e->part = part;
  e->n = ndof;
  e->of_block = of_block;
  const size_t n = (size_t)ndof, words = n / WORD + 1;
  size_t members = 0, wide = 0, ncliques = part->nblock > 0 ? (size_t)of_block[part->nblock - 1] + 1 : 0;
  for (int b = 0; b < part->nblock; b++)
    if (first_of_clique(e, b)) members += (size_t)part->block[b].ndof;
  uint64_t *before;
  member *to;
  run *runs;
  int *scratch;
  if (!open_pattern(e, n, ncliques, members, (n + 1) * words, &before, &to, &runs, &scratch)) return CAV_NO_MEMORY;
  find_tree(e, dof, local, before, (int)words, scratch);
  number_dofs(e, dof, scratch, scratch + n, scratch + 2 * n);
  const size_t rows = fill_cliques(e, local, to, runs, &wide), entries = (size_t)e->row[n];
  if (!make_room(&e->numbers, &e->nnumbers, (2 * entries + 4 * n + FOUR) * sizeof(double) + entries * sizeof(int), 1))
    return CAV_NO_MEMORY;
  // room for one where there is no contact, so that there is an array
  if (!make_room(&e->rows, &e->nrows, (rows + wide + 1) * sizeof(double), 1)) return CAV_NO_MEMORY;
  e->inertia = e->numbers;
  e->value = e->inertia + entries;
  double *at = e->value + entries, **const array[] = {&e->least, &e->pivot, &e->x, &e->along};
  for (int i = 0; i < 4; i++, at += n) *array[i] = at;
  e->path = (int *)(at + FOUR);
  e->J = e->rows;
  e->bent = e->J + rows;
  fill_paths(e);
  fill_inertia(e, local);
  fill_rows(e, rows);
  return CAV_OK;
}

// ---------------------------------------------------------------- values

#define AT_FOUR(x) (*(const cav_four *)(x))

// to [count] += b [dim] times the rows of J; count by fours, at least one
CAV_VECTOR_BODY void add_rows(int dim, int stride, const double *b, const double *J, double *to, int count) {
  for (int c = 0; c < count; c += FOUR) {
    cav_four sum = b[0] * AT_FOUR(J + c);
    for (int k = 1; k < dim; k++) sum += b[k] * AT_FOUR(J + k * stride + c);
    *(cav_four *)(to + c) += sum;
  }
}

// adds J' H J of one block; bent [dim*width] := H' J
CAV_VECTOR_BODY void add_block(const cav_elimination *e, const clique *c, int dim, const double *J, const double *H,
                               double *bent) {
  const int width = c->width;
  for (int o = 0; o < width; o += FOUR) {
    for (int k = 0; k < dim; k++) {
      cav_four sum = H[k] * AT_FOUR(J + o);
      for (int l = 1; l < dim; l++) sum += H[l * dim + k] * AT_FOUR(J + l * width + o);
      *(cav_four *)(bent + k * width + o) = sum;
    }
  }
  for (int i = 0; i < c->nmember; i++) {
    const member m = c->member[i];
    double b[CAV_IMPULSE_DIM], *row = e->value + e->row[m.dof];
    for (int k = 0; k < dim; k++) b[k] = bent[k * width + m.column];
    for (int r = 0; r < m.run; r++)
      add_rows(dim, width, b, J + c->run[r].first, row + c->run[r].column, c->run[r].width);
    const run *own = &c->run[m.run];
    add_rows(dim, width, b, J + own->first, row + own->column, m.column - own->first + 1);
  }
}

CAV_VECTOR_BODY void add_blocks_body(const cav_elimination *e, const double *curvature, int stride, double *bent) {
  const double *J = e->J;
  for (int b = 0; b < e->part->nblock; b++) {
    const clique *c = &e->clique[e->of_block[b]];
    const int dim = e->part->block[b].dim;
    const double *H = curvature + (size_t)stride * (size_t)b;
    if (!is_zero(H, dim * dim)) {
      if (dim == 3)
        add_block(e, c, 3, J, H, bent);
      else if (dim == 1)
        add_block(e, c, 1, J, H, bent);
      else
        add_block(e, c, dim, J, H, bent);
    }
    J += dim * c->width;
  }
}

CAV_BY_VECTORS(add_blocks, (const cav_elimination *e, const double *curvature, int stride, double *bent),
               (e, curvature, stride, bent))

// ---------------------------------------------------------------- factors

// all but the first numbers of a vector become zero
CAV_VECTOR_BODY void keep_first(cav_four *x, int count) {
  static const int64_t ones[2 * FOUR] = {-1, -1, -1, -1, 0, 0, 0, 0};
  typedef int64_t masks __attribute__((vector_size(sizeof(cav_four)), aligned(8), may_alias));
  *x = (cav_four)((masks)*x & *(const masks *)(ones + FOUR - count));
}

// rows of the ancestors of dof k -= what its own, with so many fours before the diagonal, is worth to them; it is divided by
// its pivot and ends with zeros. What has just been written by four is read by four, or a processor would wait for it
CAV_VECTOR_BODY void eliminate_dof(const cav_elimination *e, double *value, int k, double inverse, int fours) {
  double *Ak = value + e->row[k];
  const int depth = e->depth[k], *path = e->path + e->row[k];
  cav_four own[FOUR];
  for (int c = 0; c < fours; c++) own[c] = AT_FOUR(Ak + FOUR * c);
  keep_first(&own[fours - 1], depth - FOUR * (fours - 1));
  for (int c = 0; c < fours; c++) *(cav_four *)(Ak + FOUR * c) = inverse * own[c];
  for (int g = fours - 1, a = depth - 1; g >= 0; g--) {
    for (; a >= FOUR * g; a--) {
      double *Ai = value + e->row[path[a]];
      const double ratio = Ak[a];
      for (int c = 0; c <= g; c++) *(cav_four *)(Ai + FOUR * c) -= ratio * own[c];
    }
  }
}

// the same with own [n+4] in memory, of however many
CAV_VECTOR_BODY void eliminate_long(const cav_elimination *e, double *value, int k, double inverse, double *own) {
  double *Ak = value + e->row[k];
  const int depth = e->depth[k], *path = e->path + e->row[k];
  for (int c = 0; c < depth; c += FOUR) {
    cav_four x = AT_FOUR(Ak + c);
    keep_first(&x, depth - c < FOUR ? depth - c : FOUR);
    *(cav_four *)(own + c) = x;
    *(cav_four *)(Ak + c) = inverse * x;
  }
  for (int a = depth - 1; a >= 0; a--) {
    double *Ai = value + e->row[path[a]];
    const double ratio = Ak[a];
    for (int c = 0; c <= a; c += FOUR) *(cav_four *)(Ai + c) -= ratio * AT_FOUR(own + c);
  }
}

// matrix = L' D L from the last dof to the first; along [n+4] is overwritten
CAV_VECTOR_BODY void eliminate_body(const cav_elimination *e, double *value, double *pivot, double *along) {
  for (int k = e->n - 1; k >= 0; k--) {
    const int depth = e->depth[k];
    const double own = value[e->row[k] + depth], inverse = 1.0 / (own >= e->least[k] ? own : e->least[k]);
    pivot[k] = inverse;
    switch ((depth + FOUR - 1) / FOUR) {
      case 0:
        break;
      case 1:
        eliminate_dof(e, value, k, inverse, 1);
        break;
      case 2:
        eliminate_dof(e, value, k, inverse, 2);
        break;
      case 3:
        eliminate_dof(e, value, k, inverse, 3);
        break;
      case 4:
        eliminate_dof(e, value, k, inverse, 4);
        break;
      default:
        eliminate_long(e, value, k, inverse, along);
    }
  }
}

CAV_BY_VECTORS(eliminate, (const cav_elimination *e, double *value, double *pivot, double *along),
               (e, value, pivot, along))

void cav_elimination_factor(cav_elimination *e, const double *curvature, int stride) {
  memcpy(e->value, e->inertia, (size_t)e->row[e->n] * sizeof *e->value);
  add_blocks(e, curvature, stride, e->bent);
  eliminate(e, e->value, e->pivot, e->along);
}

void cav_elimination_solve(cav_elimination *e, double *x) {
  double *found = e->x;
  for (int k = 0; k < e->n; k++) found[k] = x[e->dof[k]];
  // those nearest to a dof come first where it tells them, and last where they tell it: they wait for one another
  for (int k = e->n - 1; k >= 0; k--) {
    const double *Ak = e->value + e->row[k], own = found[k];
    const int *path = e->path + e->row[k];
    for (int a = e->depth[k] - 1; a >= 0; a--) found[path[a]] -= own * Ak[a];
  }
  for (int k = 0; k < e->n; k++) {
    const double *Ak = e->value + e->row[k];
    const int *path = e->path + e->row[k];
    double own = found[k] * e->pivot[k];
    for (int a = 0; a < e->depth[k]; a++) own -= found[path[a]] * Ak[a];
    found[k] = own;
    x[e->dof[k]] = own;
  }
}
