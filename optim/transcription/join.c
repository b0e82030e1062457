/// Joins the dense rows of a knot into its Hessian, H += R'R (cav_dense_square). Trees that no row joins make blocks of
/// their own: which is read off the zeros of the rows, so bodies that touch nothing cost their own small products. One
/// group gives the product of all.
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "readings.h"
#include "transcription.h"

/// Groups of trees: all by dof, and what is grown for them.
typedef struct join {
  int nv, ngroup;
  int *tree;   ///< [nv] first dof of a dof's tree
  int *owner;  ///< [nv] representative first dof of a tree's group, at first dofs
  int *column; ///< [3*nv] those of one group
  int *group;  ///< [rows] first dof of a row's group, -1 for a row of zeros
} join;

static int representative(const join *g, int tree) {
  while (g->owner[tree] != tree) tree = g->owner[tree];
  return tree;
}

/// Whether a row has an entry in the dofs of a tree, first to end.
static int has_entry(const join *g, const double *row, int first, int end) {
  for (int block = 0; block < 3; block++, row += g->nv)
    for (int d = first; d < end; d++)
      if (row[d] != 0) return 1;
  return 0;
}

/// Joins the trees of every row, whose dofs stand one after the other; of rows after the one that leaves a single group there is
/// nothing to know.
static void find_groups(join *g, const cav_model *m, int n, const double *row) {
  g->ngroup = 0;
  for (int d = 0; d < g->nv; d++) {
    g->tree[d] = m->dof[d].parent < 0 ? d : g->tree[m->dof[d].parent];
    assert(d == 0 || g->tree[d] >= g->tree[d - 1]);
    g->owner[d] = d;
    g->ngroup += g->tree[d] == d;
  }
  for (int i = 0; i < n && g->ngroup > 1; i++, row += 3 * (size_t)g->nv) {
    int *group = &g->group[i];
    *group = -1;
    for (int first = 0, end; first < g->nv; first = end) {
      for (end = first + 1; end < g->nv && g->tree[end] == first;) end++;
      if (!has_entry(g, row, first, end)) continue;
      const int tree = representative(g, first), other = *group < 0 ? tree : representative(g, *group);
      *group = tree < other ? tree : other;
      g->owner[tree < other ? other : tree] = *group;
      g->ngroup -= tree != other;
    }
  }
}

/// Columns of the group that starts with a tree; returns their number.
static int list_columns(join *g, int first) {
  int n = 0;
  for (int d = 0; d < g->nv; d++)
    if (representative(g, g->tree[d]) == first) g->column[n++] = d;
  for (int k = 0; k < 2 * n; k++) g->column[n + k] = g->column[k] + g->nv;
  return 3 * n;
}

/// Copies the group's block of the knot's Hessian, lower triangle, to H [n*n] or back.
static void copy_block(const join *g, int n, double *hessian, double *H, int back) {
  for (int i = 0; i < n; i++) {
    double *row = hessian + (size_t)g->column[i] * 3 * (size_t)g->nv, *block = H + (size_t)i * (size_t)n;
    if (back)
      for (int k = 0; k <= i; k++) row[g->column[k]] = block[k];
    else
      for (int k = 0; k <= i; k++) block[k] = row[g->column[k]];
  }
}

/// One group's part of the product, through room for its rows and block.
static void join_group(join *g, int first, cav_knot *knot, const double *dense, double *room) {
  int width = list_columns(g, first), count = 0;
  double *block = room, *row = room + (size_t)width * (size_t)width;
  for (int i = 0; i < knot->ndense; i++) {
    if (g->group[i] < 0 || representative(g, g->group[i]) != first) continue;
    const double *from = dense + (size_t)i * 3 * (size_t)g->nv;
    double *to = row + (size_t)count++ * (size_t)width;
    for (int k = 0; k < width; k++) to[k] = from[g->column[k]];
  }
  if (count == 0) return;
  copy_block(g, width, knot->present, block, 0);
  cav_dense_square(CAV_TRIANGLE_UPPER, width, 3, count, row, width, block, width);
  copy_block(g, width, knot->present, block, 1);
}

cav_status cav_rows_join(const cav_transcription *tr, cav_scratch *s, cav_knot *knot, const double *dense_rows) {
  int width = 3 * tr->nv, n = knot->ndense;
  int trees = 0;
  for (int d = 0; d < tr->nv; d++) trees += tr->model->dof[d].parent < 0;
  if (n == 0) return CAV_OK;
  if (trees == 1) {
    cav_dense_square(CAV_TRIANGLE_UPPER, width, 3, n, dense_rows, width, knot->present, width);
    return CAV_OK;
  }
  size_t nv = (size_t)tr->nv, ints = 5 * nv + (size_t)n, dense = 9 * nv * nv + 3 * nv * (size_t)n;
  if (ints / 2 + 1 + dense > s->join_room) {
    free(s->join);
    s->join_room = ints / 2 + 1 + dense;
    s->join = malloc(s->join_room * sizeof(double));
    if (!s->join) return s->join_room = 0, CAV_NO_MEMORY;
  }
  int *at = (int *)(s->join + dense);
  join g = {.nv = tr->nv, .tree = at, .owner = at + nv, .column = at + 2 * nv, .group = at + 5 * nv};
  find_groups(&g, tr->model, n, dense_rows);
  if (g.ngroup == 1) {
    cav_dense_square(CAV_TRIANGLE_UPPER, width, 3, n, dense_rows, width, knot->present, width);
    return CAV_OK;
  }
  for (int d = 0; d < tr->nv; d++)
    if (g.tree[d] == d && g.owner[d] == d) join_group(&g, d, knot, dense_rows, s->join);
  return CAV_OK;
}
