/// Hessian M + J' H J of one island and its factors, by whichever of two ways takes less work on its structure:
/// elimination from the leaves (elimination.c), which keeps the zeros of the trees but fills as the dofs are
/// numbered, or CHOLMOD (sparse.c). A sparse pattern is that of the dofs of links that touch, whether their impulses
/// bend or not, so it holds for all iterations of a step, and for the next step while the same links touch; then nothing
/// is analysed and only CHOLMOD itself allocates. Contacts that are still apart, of which the discrete law sees many
/// ahead, enter when their impulses first bend.
#include "hessian.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "elimination.h"
#include "sparse.h"

static const double NEGLIGIBLE = 1e-20; ///< curvature relative to 1/R

// the matrix of one island by its pattern
typedef struct slot {
  cav_sparse *sparse;
  size_t room;      // ints of data
  int *data;        // all below
  int nkey, *key;   // what the pattern follows from: sizes, dofs of the island, then of each clique
  int *start, *row; // lower triangle by columns, local dofs
  int *inertia;     // places of the entries of the tree-sparse rows, one dof after another
  int nclique;
  int *first;  // [nclique+1] of the dofs of each clique among those of all
  int *place;  // [sum of squares] where each pair of a clique's dofs lies
  int *square; // [nclique] first of them
  int ndof, nentry;
} slot;

struct cav_hessian {
  double sparse_from;
  const cav_impulse *part; // of the island it is turned to
  int ndof;
  const int *dof, *local;
  int nslot, used, room; // slots, how many of them this step has met
  slot *slot, *at;       // at: NULL while eliminated
  cav_elimination *elimination;
  double *value, *x; // sparse matrix; right-hand side in local order
  size_t nvalue, nx;
  int nclique, members; // runs of blocks that see the same dofs; their dofs and pairs of dofs in all
  size_t pairs;
  int *clique; // [nblock] of each block
  int *live;   // [nclique] its number among those of the sparse pattern, or -1
  int nlive, stale;
  double *pair; // [dofs of the largest clique, squared]
  size_t nblock, nclique_room, npair;
};

cav_hessian *cav_hessian_new(double sparse_from) {
  cav_hessian *h = calloc(1, sizeof *h);
  if (!h) return NULL;
  h->sparse_from = sparse_from;
  h->elimination = cav_elimination_new();
  if (h->elimination) return h;
  free(h);
  return NULL;
}

void cav_hessian_free(cav_hessian *h) {
  if (!h) return;
  for (int k = 0; k < h->nslot; k++) {
    cav_sparse_free(h->slot[k].sparse);
    free(h->slot[k].data);
  }
  cav_elimination_free(h->elimination);
  free(h->slot), free(h->value), free(h->x), free(h->clique), free(h->live), free(h->pair);
  free(h);
}

size_t cav_hessian_bytes(const cav_hessian *h) {
  if (!h) return 0;
  size_t bytes = sizeof *h + cav_elimination_bytes(h->elimination) + (h->nvalue + h->nx + h->npair) * sizeof(double) +
                 (h->nblock + h->nclique_room) * sizeof(int);
  for (int k = 0; k < h->nslot; k++)
    bytes += sizeof(slot) + h->slot[k].room * sizeof(int) + (size_t)(8 * cav_sparse_entries(h->slot[k].sparse));
  return bytes;
}

int cav_hessian_sparse_islands(const cav_hessian *h) { return h->used; }

void cav_hessian_restart(cav_hessian *h) { h->used = 0; }

// ---------------------------------------------------------------- pattern

// cliques are runs of blocks that see the same dofs: numbers the blocks by them. CAV_NO_MEMORY
static cav_status find_cliques(cav_hessian *h) {
  const cav_impulse *p = h->part;
  if (!make_room(&h->clique, &h->nblock, (size_t)p->nblock, sizeof(int))) return CAV_NO_MEMORY;
  size_t most = 0;
  h->nclique = h->members = 0;
  h->pairs = 0;
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b], *last = &p->block[b > 0 ? b - 1 : 0];
    const int same =
        b > 0 && last->ndof == block->ndof && !memcmp(last->dof, block->dof, (size_t)block->ndof * sizeof(int));
    if (!same) {
      const size_t square = (size_t)block->ndof * (size_t)block->ndof;
      h->nclique++;
      h->members += block->ndof;
      h->pairs += square;
      most = most > square ? most : square;
    }
    h->clique[b] = h->nclique - 1;
  }
  return h->pairs <= INT_MAX && make_room(&h->pair, &h->npair, most, sizeof(double)) ? CAV_OK : CAV_NO_MEMORY;
}

// whether a block is there whatever the velocity: all but surfaces that are apart
static int touches(const cav_impulse *p, const cav_block *block) {
  if (block->contact >= 0) {
    const cav_contact *contact = &p->state->contact[block->contact];
    return contact->dist <= contact->margin;
  }
  return 1;
}

// whether the curvature H of a block's impulse counts beside 1/R
static int bends(const cav_impulse *p, const cav_block *block, const double *H) {
  const double *R = p->R + block->first;
  for (int i = 0; i < block->dim; i++)
    for (int j = 0; j < block->dim; j++)
      if (H[i * block->dim + j] * H[i * block->dim + j] * R[i] * R[j] > NEGLIGIBLE * NEGLIGIBLE) return 1;
  return 0;
}

// cliques of the sparse pattern: those that touch, at first, and all that have bent since; curvature may be NULL.
// members and pairs become theirs. Whether there are more than before
static int find_live(cav_hessian *h, const double *curvature) {
  const cav_impulse *p = h->part;
  const int before = h->nlive;
  for (int b = 0; b < p->nblock; b++) {
    int *live = &h->live[h->clique[b]];
    if (*live < 0 && (curvature ? bends(p, &p->block[b], curvature + CAV_CURVATURE * b) : touches(p, &p->block[b])))
      *live = h->nlive++;
  }
  if (h->nlive == before && curvature) return 0;
  h->members = h->nlive = 0;
  h->pairs = 0;
  for (int b = 0; b < p->nblock; b++) {
    if (h->live[h->clique[b]] < 0 || (b > 0 && h->clique[b] == h->clique[b - 1])) continue;
    h->live[h->clique[b]] = h->nlive++;
    h->members += p->block[b].ndof;
    h->pairs += (size_t)p->block[b].ndof * (size_t)p->block[b].ndof;
  }
  return 1;
}

// the first block of a clique of the sparse pattern
static int begins_live(const cav_hessian *h, int b) {
  return h->live[h->clique[b]] >= 0 && (b == 0 || h->clique[b] != h->clique[b - 1]);
}

// key: number of dofs and cliques, the dofs, sizes of cliques, their dofs
static int fill_key(const cav_hessian *h, int *key) {
  const cav_impulse *p = h->part;
  int n = 2 + h->ndof;
  key[0] = h->ndof, key[1] = h->nlive;
  memcpy(key + 2, h->dof, (size_t)h->ndof * sizeof(int));
  for (int b = 0; b < p->nblock; b++) {
    if (!begins_live(h, b)) continue;
    key[n++] = p->block[b].ndof;
    memcpy(key + n, p->block[b].dof, (size_t)p->block[b].ndof * sizeof(int));
    n += p->block[b].ndof;
  }
  return n;
}

// numbers in lists by dof: list of dof i is item[first[i]] .. item[first[i+1]-1]
typedef struct lists {
  int *first, *item;
} lists;

// local dofs, at most i, that share an entry with dof i; marked [ndof] holds i+1 for each. Returns their number
static int neighbours(const cav_hessian *h, const slot *s, const int *member, const lists *of, int i, int *marked,
                      int *found) {
  const int *parent = h->part->state->work->parent;
  int n = 0;
  for (int j = h->dof[i]; j >= 0; j = parent[j]) {
    marked[h->local[j]] = i + 1;
    found[n++] = h->local[j];
  }
  for (int e = of->first[i]; e < of->first[i + 1]; e++) {
    const int c = of->item[e];
    for (int k = s->first[c]; k < s->first[c + 1]; k++) {
      const int j = member[k];
      if (j > i || marked[j] == i + 1) continue;
      marked[j] = i + 1;
      found[n++] = j;
    }
  }
  return n;
}

// where entry (i, j), i >= j, lies
static int entry_at(const slot *s, int i, int j) {
  int low = s->start[j], high = s->start[j + 1] - 1;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (s->row[middle] < i)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

// places of the inertia's entries and of the pairs of every clique
static void fill_places(const cav_hessian *h, slot *s, const int *member, const lists *of, int *at) {
  const int *parent = h->part->state->work->parent;
  for (int i = 0, e = 0; i < s->ndof; i++)
    for (int j = h->dof[i]; j >= 0; j = parent[j]) s->inertia[e++] = entry_at(s, i, h->local[j]);
  for (int j = 0; j < s->ndof; j++) {
    for (int e = s->start[j]; e < s->start[j + 1]; e++) at[s->row[e]] = e;
    for (int e = of->first[j]; e < of->first[j + 1]; e++) {
      const int c = of->item[e], n = s->first[c + 1] - s->first[c], *in = member + s->first[c];
      int own = 0;
      while (in[own] != j) own++;
      for (int k = 0; k < n; k++)
        if (in[k] >= j) s->place[s->square[c] + k * n + own] = s->place[s->square[c] + own * n + k] = at[in[k]];
    }
  }
}

// room for the slot's arrays, laid out in one piece but for the rows, whose number is not known yet
static cav_status fill_pattern(cav_hessian *h, slot *s, int *scratch, const int *member) {
  const int n = s->ndof, members = s->first[s->nclique];
  int *marked = scratch, *found = marked + n;
  lists of = {.first = found + n, .item = found + 2 * n + 1};
  memset(marked, 0, (size_t)n * sizeof(int));
  memset(of.first, 0, (size_t)(n + 1) * sizeof(int));
  for (int k = 0; k < members; k++) of.first[member[k] + 1]++;
  for (int i = 0; i < n; i++) of.first[i + 1] += of.first[i];
  for (int c = 0; c < s->nclique; c++)
    for (int k = s->first[c]; k < s->first[c + 1]; k++) of.item[of.first[member[k]]++] = c;
  for (int i = n; i > 0; i--) of.first[i] = of.first[i - 1];
  of.first[0] = 0;

  // counts of the columns, then their rows, ascending as i does
  memset(s->start, 0, (size_t)(n + 1) * sizeof(int));
  for (int i = 0; i < n; i++)
    for (int k = neighbours(h, s, member, &of, i, marked, found) - 1; k >= 0; k--) s->start[found[k] + 1]++;
  for (int j = 0; j < n; j++) s->start[j + 1] += s->start[j];
  s->nentry = s->start[n];
  memset(marked, 0, (size_t)n * sizeof(int));
  int *next = of.item + members;
  memcpy(next, s->start, (size_t)n * sizeof(int));
  for (int i = 0; i < n; i++)
    for (int k = neighbours(h, s, member, &of, i, marked, found) - 1; k >= 0; k--) s->row[next[found[k]]++] = i;
  fill_places(h, s, member, &of, marked);
  return cav_sparse_analyse(s->sparse, n, s->start, s->row);
}

// most entries that the lower triangle can have
static size_t entry_bound(const cav_hessian *h, size_t pairs) {
  const cav_impulse *p = h->part;
  size_t entries = pairs;
  for (int e = 0; e < h->ndof; e++)
    entries += (size_t)(p->state->work->row[h->dof[e] + 1] - p->state->work->row[h->dof[e]]);
  return entries;
}

// the pattern of the island in a slot, found again or analysed
static cav_status set_pattern(cav_hessian *h, slot *s) {
  const cav_impulse *p = h->part;
  const int nclique = h->nlive, members = h->members, n = h->ndof;
  const size_t pairs = h->pairs;
  const size_t nkey = (size_t)(2 + n + nclique + members), inertia = entry_bound(h, 0), entries = entry_bound(h, pairs);
  const size_t fixed = nkey + (size_t)n + 1 + inertia + 2 * (size_t)nclique + 1 + pairs + entries;
  const size_t scratch = 4 * (size_t)n + 1 + 2 * (size_t)members + nkey;
  if (fixed + scratch > s->room) {
    int *data = malloc((fixed + scratch) * 3 / 2 * sizeof(int));
    if (!data) return CAV_NO_MEMORY;
    free(s->data);
    s->data = s->key = data;
    s->nkey = 0;
    s->room = (fixed + scratch) * 3 / 2;
  }
  int *fresh = s->data + s->room - nkey;
  const int ints = fill_key(h, fresh);
  if (s->nkey == ints && !memcmp(fresh, s->key, nkey * sizeof(int))) return CAV_OK;
  memmove(s->key, fresh, nkey * sizeof(int));
  s->nkey = 0; // until it is whole
  s->ndof = n;
  s->nclique = nclique;
  s->start = s->key + nkey;
  s->inertia = s->start + n + 1;
  s->first = s->inertia + inertia;
  s->square = s->first + nclique + 1;
  s->place = s->square + nclique;
  s->row = s->place + pairs;
  int *member = s->row + entries, *free_ints = member + members, e = 0;
  s->first[0] = 0;
  for (int b = 0, c = 0, squares = 0; b < p->nblock; b++) {
    if (!begins_live(h, b)) continue;
    for (int k = 0; k < p->block[b].ndof; k++) member[e++] = h->local[p->block[b].dof[k]];
    s->square[c++] = squares;
    s->first[c] = e;
    squares += p->block[b].ndof * p->block[b].ndof;
  }
  const cav_status status = fill_pattern(h, s, free_ints, member);
  if (status == CAV_OK) s->nkey = ints;
  return status;
}

// the next slot, made if there is none
static cav_status next_slot(cav_hessian *h) {
  if (h->used == h->nslot) {
    if (h->nslot == h->room) {
      slot *larger = realloc(h->slot, (size_t)(2 * h->room + 1) * sizeof *larger);
      if (!larger) return CAV_NO_MEMORY;
      h->slot = larger;
      h->room = 2 * h->room + 1;
    }
    h->slot[h->nslot] = (slot){.sparse = cav_sparse_new(0)};
    if (!h->slot[h->nslot].sparse) return CAV_NO_MEMORY;
    h->nslot++;
  }
  h->at = &h->slot[h->used++];
  return CAV_OK;
}

// operations of the elimination: squares of what stands left of the diagonal in the rows as the dofs are numbered, and four
// passes over the matrix. low [ndof] is overwritten
static double elimination_work(const cav_hessian *h, double *low) {
  const cav_impulse *p = h->part;
  const int *parent = p->state->work->parent;
  for (int e = 0; e < h->ndof; e++) low[e] = parent[h->dof[e]] < 0 ? e : low[h->local[parent[h->dof[e]]]];
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    if (b > 0 && h->clique[b] == h->clique[b - 1]) continue;
    double least = h->ndof;
    for (int k = 0; k < block->ndof; k++) least = fmin(least, h->local[block->dof[k]]);
    for (int k = 0; k < block->ndof; k++) low[h->local[block->dof[k]]] = fmin(low[h->local[block->dof[k]]], least);
  }
  double work = 4.0 * h->ndof * h->ndof;
  for (int e = 0; e < h->ndof; e++) work += (e - low[e]) * (e - low[e]);
  return work;
}

// whether elimination is as fast; that of few dofs is whatever they touch
static int is_eliminated(cav_hessian *h) {
  const double n = h->ndof;
  if (n * n * (n + 4.0) < h->sparse_from || elimination_work(h, h->x) < h->sparse_from) return 1;
  // what has slots has CHOLMOD; it is not loaded before it pays
  return h->nslot == 0 && !cav_sparse_available();
}

static cav_status begin_elimination(cav_hessian *h) {
  h->at = NULL;
  return cav_elimination_begin(h->elimination, h->part, h->ndof, h->dof, h->local, h->clique);
}

cav_status cav_hessian_begin(cav_hessian *h, const cav_impulse *part, int ndof, const int *dof, const int *local) {
  h->part = part;
  h->ndof = ndof;
  h->dof = dof;
  h->local = local;
  cav_status status = find_cliques(h);
  if (status != CAV_OK) return status;
  if (!make_room(&h->x, &h->nx, (size_t)ndof, sizeof(double))) return CAV_NO_MEMORY;
  if (is_eliminated(h)) return begin_elimination(h);
  if (!make_room(&h->live, &h->nclique_room, (size_t)h->nclique, sizeof(int))) return CAV_NO_MEMORY;
  for (int c = 0; c < h->nclique; c++) h->live[c] = -1;
  h->nlive = 0;
  h->stale = find_live(h, NULL);
  return next_slot(h);
}

// the pattern with all that bends
static cav_status follow_pattern(cav_hessian *h, const double *curvature) {
  h->stale |= find_live(h, curvature);
  if (!h->stale) return CAV_OK;
  const cav_status status = set_pattern(h, h->at);
  if (status != CAV_OK) return status;
  h->stale = 0;
  return make_room(&h->value, &h->nvalue, (size_t)h->at->nentry, sizeof(double)) ? CAV_OK : CAV_NO_MEMORY;
}

// ---------------------------------------------------------------- values

// sum [n*n] of J' H J of one block, the part on and right of the diagonal
static void bend_block(const cav_block *block, const double *H, double *sum) {
  const int n = block->ndof, dim = block->dim;
  for (int i = 0; i < n; i++) {
    double *row = sum + (size_t)i * (size_t)n;
    for (int k = 0; k < dim; k++) {
      const double *J = block->J + k * n;
      double bent = 0.0;
      for (int l = 0; l < dim; l++) bent += H[l * dim + k] * block->J[l * n + i];
      for (int j = i; j < n; j++) row[j] += bent * J[j];
    }
  }
}

// adds to the lower triangle what pairs of a clique's dofs sum up to
static void add_pairs(cav_hessian *h, int n, const int *place) {
  for (int i = 0; i < n; i++)
    for (int j = i; j < n; j++) h->value[place[i * n + j]] += h->pair[i * n + j];
}

// adds all blocks whose impulses bend, clique by clique
static void add_blocks(cav_hessian *h, const double *curvature) {
  const cav_impulse *p = h->part;
  for (int b = 0; b < p->nblock;) {
    const cav_block *block = &p->block[b];
    const int clique = h->clique[b], n = block->ndof, seen = h->live[clique] >= 0;
    int any = 0;
    for (; b < p->nblock && h->clique[b] == clique; b++) {
      const double *H = curvature + CAV_CURVATURE * b;
      if (!seen || is_zero(H, p->block[b].dim * p->block[b].dim)) continue;
      if (!any) memset(h->pair, 0, (size_t)n * (size_t)n * sizeof(double));
      bend_block(&p->block[b], H, h->pair);
      any = 1;
    }
    if (any) add_pairs(h, n, h->at->place + h->at->square[h->live[clique]]);
  }
}

static void fill_sparse(cav_hessian *h, const double *curvature) {
  const cav_impulse *p = h->part;
  const slot *s = h->at;
  const int *row = p->state->work->row;
  memset(h->value, 0, (size_t)s->nentry * sizeof(double));
  for (int i = 0, e = 0; i < h->ndof; i++) {
    const double *M = p->M + row[h->dof[i]];
    for (int k = 0; k < row[h->dof[i] + 1] - row[h->dof[i]]; k++) h->value[s->inertia[e++]] = M[k];
  }
  add_blocks(h, curvature);
}

cav_status cav_hessian_factor(cav_hessian *h, const double *curvature) {
  if (h->at) {
    cav_status status = follow_pattern(h, curvature);
    if (status != CAV_OK) return status;
    fill_sparse(h, curvature);
    status = cav_sparse_factor(h->at->sparse, h->value);
    if (status != CAV_NOT_CONVERGED) return status;
    // rounding in very stiff constraints: only the elimination that knows the least pivots can go on
    status = begin_elimination(h);
    if (status != CAV_OK) return status;
  }
  cav_elimination_factor(h->elimination, curvature, CAV_CURVATURE);
  return CAV_OK;
}

cav_status cav_hessian_solve(cav_hessian *h, double *x) {
  if (!h->at) {
    cav_elimination_solve(h->elimination, x);
    return CAV_OK;
  }
  for (int e = 0; e < h->ndof; e++) h->x[e] = x[h->dof[e]];
  const cav_status status = cav_sparse_solve(h->at->sparse, h->x, h->x);
  if (status != CAV_OK) return status;
  for (int e = 0; e < h->ndof; e++) x[h->dof[e]] = h->x[e];
  return CAV_OK;
}
