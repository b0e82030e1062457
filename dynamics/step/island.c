/// Finds islands by joining the trees that a block's dofs belong to (union-find), and works on one island's fraction of
/// the tree-sparse inertia. Blocks without dofs go with the first island.
#include "island.h"

#include <string.h>

// representative of a root dof, halving the way there
static int representative(int *of, int i) {
  while (of[i] != i) i = of[i] = of[of[i]];
  return i;
}

// the lower of two representatives stands for both
static void join(int *of, int a, int b) {
  a = representative(of, a), b = representative(of, b);
  if (a < b) of[b] = a;
  if (b < a) of[a] = b;
}

// owner [nv]: island of each dof, numbered by their first dofs; returns how many
static int number_islands(const cav_impulse *p, int *of, int *owner) {
  const int *parent = p->state->work->parent;
  int n = 0;
  for (int i = 0; i < p->nv; i++) of[i] = parent[i] < 0 ? i : of[parent[i]];
  for (int b = 0; b < p->nblock; b++)
    for (int k = 1; k < p->block[b].ndof; k++) join(of, of[p->block[b].dof[0]], of[p->block[b].dof[k]]);
  for (int i = 0; i < p->nv; i++) {
    const int first = representative(of, i);
    owner[i] = first == i ? n++ : owner[first];
  }
  return n;
}

static int owner_of(const cav_block *block, const int *owner) { return block->ndof > 0 ? owner[block->dof[0]] : 0; }

// first [n+1] := where each key's items begin once sorted; key of item i by of[i]
static void count_up(int n, int *first) {
  for (int k = 0; k < n; k++) first[k + 1] += first[k];
}

void cav_islands_find(cav_impulse *p, double *room, cav_islands *s) {
  const int nv = p->nv;
  cav_block *sorted = (cav_block *)room;
  int *at = (int *)(room + (size_t)CAV_ISLAND_PER_BLOCK * (size_t)p->nblock), *owner = at, *next = at + nv;
  s->dof = at + 2 * nv;
  s->local = at + 3 * nv;
  s->first_dof = at + 4 * nv;
  s->first_block = at + 5 * nv + 1;
  s->n = number_islands(p, next, owner);
  memset(s->first_dof, 0, (size_t)(s->n + 1) * sizeof(int));
  memset(s->first_block, 0, (size_t)(s->n + 1) * sizeof(int));
  for (int i = 0; i < nv; i++) s->first_dof[owner[i] + 1]++;
  for (int b = 0; b < p->nblock && nv > 0; b++) s->first_block[owner_of(&p->block[b], owner) + 1]++;
  count_up(s->n, s->first_dof);
  count_up(s->n, s->first_block);

  for (int k = 0; k < s->n; k++) next[k] = 0;
  for (int i = 0; i < nv; i++) {
    s->local[i] = next[owner[i]]++;
    s->dof[s->first_dof[owner[i]] + s->local[i]] = i;
  }
  if (s->n < 2) return;
  memcpy(next, s->first_block, (size_t)s->n * sizeof(int));
  for (int b = 0; b < p->nblock; b++) sorted[next[owner_of(&p->block[b], owner)]++] = p->block[b];
  memcpy(p->block, sorted, (size_t)p->nblock * sizeof *sorted);
}

void cav_island_inertia(const cav_impulse *p, int ndof, const int *dof, const double *x, double *r) {
  for (int e = 0; e < ndof; e++) cav_impulse_inertia_of(p, dof[e], x, r);
}

void cav_island_fall(const cav_impulse *p, int ndof, const int *dof, double *x) {
  const int *row = p->state->work->row, *parent = p->state->work->parent;
  for (int e = ndof - 1; e >= 0; e--) {
    const double *L = p->L + row[dof[e]], own = x[dof[e]];
    for (int i = parent[dof[e]], k = 1; i >= 0; i = parent[i], k++) x[i] -= L[k] * own;
  }
  for (int e = 0; e < ndof; e++) {
    const double *L = p->L + row[dof[e]];
    double sum = x[dof[e]] / L[0];
    for (int i = parent[dof[e]], k = 1; i >= 0; i = parent[i], k++) sum -= L[k] * x[i];
    x[dof[e]] = sum;
  }
}
