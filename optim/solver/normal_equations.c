/// Normal equations of a transcription, block-banded with a border: three neighbouring knots fill a band. In a cycle
/// the last two knots meet the first two, and a free step meets all: these unknowns stand last, as the border. Trees
/// that neither contacts nor rows join at these knots are independent: groups of them are found by what is zero after
/// gathering, and each is a narrower band of its own (band.c). A free step stands beside several groups as an arrow:
/// with w = A^-1 b of all groups its pivot is c - b'w. Measured against CHOLMOD (bench_normal): 0.2 of its time on the
/// band of a humanoid, 0.25 on a cycle of 60 knots, 0.75 on 200 free bodies.
#include "normal_equations.h"
#include "dense.h"
#include "vectors.h"

#include <assert.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/// Last row of the core's H(:, j) that is not zero by structure.
static int end_of(const cav_normal *normal, int j) {
  int end = (j / normal->n + 3) * normal->n;
  return end < normal->core ? end : normal->core;
}

/// Whether H(core + i, j), j in the core, can be anything but zero.
static int meets(const cav_normal *normal, int i, int j) {
  int row = (normal->core + i) / normal->n, column = j / normal->n;
  if (normal->core + i >= normal->blocks * normal->n) return 1;
  return row - column <= 2 || row - column >= normal->blocks - 2;
}

/// First dofs of the trees, and room for groups of them; 0 if memory runs out.
static int set_trees(cav_normal *normal, const cav_model *model) {
  size_t n = (size_t)normal->n;
  int *room = malloc((4 * n + 2) * sizeof(int));
  normal->group = malloc(n * sizeof *normal->group);
  normal->tree = room;
  if (!room || !normal->group) return 0;
  normal->owner = room + n + 1;
  normal->dof = normal->owner + n;
  normal->first = normal->dof + n;
  for (int i = 0; i < normal->n; i++)
    if (model->dof[i].parent < 0) normal->tree[normal->ntree++] = i;
  normal->tree[normal->ntree] = normal->n;
  return 1;
}

cav_normal *cav_normal_new(const cav_transcription *tr) {
  cav_normal *normal = calloc(1, sizeof *normal);
  if (!normal) return NULL;
  normal->blocks = cav_transcription_blocks(tr);
  normal->n = tr->nv;
  normal->size = cav_transcription_unknowns(tr);
  normal->cyclic = tr->periodicity != NULL;
  normal->free_step = tr->free_step;
  normal->core = (normal->blocks - (normal->cyclic ? 2 : 0)) * normal->n;
  normal->border = normal->size - normal->core;
  normal->band = 3 * normal->n;
  size_t size = (size_t)normal->size, core = (size_t)normal->core, border = (size_t)normal->border;
  size_t entries = core * (size_t)normal->band;
  normal->H = calloc(entries, sizeof(double));
  normal->factor = malloc((entries + (core + border) * border) * sizeof(double));
  normal->B = calloc(core * border + 1, sizeof(double));
  normal->C = calloc(border * border + 1, sizeof(double));
  normal->gradient = malloc(size * sizeof(double));
  normal->diagonal = malloc(size * sizeof(double));
  normal->x = malloc(size * sizeof(double));
  normal->unknown = malloc(size * sizeof(int));
  normal->arrow = malloc(2 * size * sizeof(double));
  normal->room = malloc(5 * size * sizeof(double));
  int whole = normal->H && normal->factor && normal->B && normal->C && normal->gradient && normal->diagonal &&
              normal->x && normal->arrow && normal->unknown && normal->room;
  if (whole && set_trees(normal, tr->model)) return normal;
  cav_normal_free(normal);
  return NULL;
}

void cav_normal_free(cav_normal *normal) {
  if (!normal) return;
  free(normal->H), free(normal->factor), free(normal->B), free(normal->C), free(normal->gradient),
      free(normal->diagonal), free(normal->x), free(normal->arrow), free(normal->unknown), free(normal->room),
      free(normal->group), free(normal->tree);
  free(normal);
}

/// Place of H(i, j), in either order.
static double *entry_of(const cav_normal *normal, int i, int j) {
  if (i < j) {
    int swap = i;
    i = j, j = swap;
  }
  int core = normal->core;
  if (i < core) return &normal->H[(size_t)j * normal->band + (size_t)(i - j)];
  if (j < core) return &normal->B[(size_t)(i - core) * core + j];
  return &normal->C[(size_t)(j - core) * normal->border + (i - core)];
}

/// Adds the part of a knot's Hessian [3n*3n] between two of its blocks, the column's not after the row's. fresh: it is the first
/// there, in the band, where it takes the place of what is.
static void gather_blocks(cav_normal *normal, const double *hessian, int row_block, int column_block, int r, int c,
                          int fresh) {
  int n = normal->n, width = 3 * n, core = normal->core / n;
  if (row_block < core && column_block <= row_block) {
    // within the band rows of the one are diagonals of the other
    cav_dense_add_transposed(r == c ? CAV_TRIANGLE_LOWER : CAV_TRIANGLE_BOTH, fresh, n,
                             hessian + (size_t)(r * n) * width + c * n, width,
                             entry_of(normal, row_block * n, column_block * n), normal->band - 1);
    return;
  }
  for (int j = 0; j < n; j++) {
    // entries of a column lie evenly
    int first = r == c ? j : 0, row = row_block * n + first, column = column_block * n + j;
    double *out = entry_of(normal, row, column);
    ptrdiff_t stride = first + 1 < n ? entry_of(normal, row + 1, column) - out : 0;
    const double *in = hessian + (size_t)(r * n + first) * width + c * n + j;
    for (int i = first; i < n; i++, out += stride, in += width) *out += *in;
  }
}

/// Whether dofs of trees a and b meet in block column c and block row r, not above it.
static int trees_meet(const cav_normal *normal, int r, int c, int a, int b) {
  for (int j = normal->tree[b]; j < normal->tree[b + 1]; j++)
    for (int i = normal->tree[a]; i < normal->tree[a + 1]; i++)
      if (*entry_of(normal, r * normal->n + i, c * normal->n + j) != 0) return 1;
  return 0;
}

/// Whether two trees meet anywhere.
static int trees_join(const cav_normal *normal, int a, int b) {
  for (int c = 0; c < normal->blocks; c++)
    for (int r = c; r < normal->blocks; r++)
      if ((r - c <= 2 || (normal->cyclic && r >= normal->blocks - 2)) &&
          (trees_meet(normal, r, c, a, b) || trees_meet(normal, r, c, b, a)))
        return 1;
  return 0;
}

/// Unknowns of all groups, one after another, each by blocks.
static void list_unknowns(cav_normal *normal) {
  int *unknown = normal->unknown;
  for (int g = 0; g < normal->ngroup; g++)
    for (int b = 0; b < normal->blocks; b++)
      for (int k = normal->first[g]; k < normal->first[g + 1]; k++) *unknown++ = b * normal->n + normal->dof[k];
  // of one group, whose border it is in
  if (normal->free_step) *unknown = normal->size - 1;
}

/// Groups of trees that meet, numbered by their first trees.
static void find_groups(cav_normal *normal) {
  int *owner = normal->owner, *next = normal->first;
  for (int t = 0; t < normal->ntree; t++) owner[normal->tree[t]] = t;
  for (int a = 1; a < normal->ntree; a++) {
    for (int b = 0; b < a; b++) {
      int high = owner[normal->tree[a]], low = owner[normal->tree[b]];
      if (high == low || !trees_join(normal, a, b)) continue;
      if (high < low) {
        int swap = high;
        high = low, low = swap;
      }
      for (int t = 0; t < normal->ntree; t++)
        if (owner[normal->tree[t]] == high) owner[normal->tree[t]] = low;
    }
  }
  // numbers without gaps, then all dofs
  normal->ngroup = 0;
  for (int t = 0; t < normal->ntree; t++) {
    int first = normal->tree[t], of = owner[first];
    owner[first] = of == t ? normal->ngroup++ : owner[normal->tree[of]];
    for (int i = first + 1; i < normal->tree[t + 1]; i++) owner[i] = owner[first];
  }
  memset(next, 0, (size_t)(normal->ngroup + 1) * sizeof(int));
  for (int i = 0; i < normal->n; i++) next[owner[i] + 1]++;
  for (int g = 0; g < normal->ngroup; g++) next[g + 1] += next[g];
  for (int i = 0; i < normal->n; i++) normal->dof[next[owner[i]]++] = i;
  for (int g = normal->ngroup; g > 0; g--) next[g] = next[g - 1];
  next[0] = 0;
  list_unknowns(normal);
}

/// All but the band.
static void clear_rest(cav_normal *normal) {
  size_t core = (size_t)normal->core, border = (size_t)normal->border;
  memset(normal->B, 0, core * border * sizeof(double));
  memset(normal->C, 0, border * border * sizeof(double));
  memset(normal->diagonal, 0, (size_t)normal->size * sizeof(double));
  memset(normal->gradient, 0, (size_t)normal->size * sizeof(double));
}

void cav_normal_clear(cav_normal *normal) {
  memset(normal->H, 0, (size_t)normal->core * (size_t)normal->band * sizeof(double));
  clear_rest(normal);
}

static size_t entries_of(const cav_normal *normal) { return (size_t)normal->core * (size_t)normal->band; }

size_t cav_normal_room(const cav_normal *normal) {
  return entries_of(normal) + (size_t)normal->size * (size_t)normal->border;
}

void cav_normal_save(const cav_normal *normal, double *to) {
  size_t entries = entries_of(normal), sides = (size_t)normal->core * (size_t)normal->border;
  memcpy(to, normal->H, entries * sizeof *to);
  memcpy(to + entries, normal->B, sides * sizeof *to);
  memcpy(to + entries + sides, normal->C, (size_t)normal->border * (size_t)normal->border * sizeof *to);
}

void cav_normal_load(cav_normal *normal, const double *from) {
  size_t entries = entries_of(normal), sides = (size_t)normal->core * (size_t)normal->border;
  memcpy(normal->H, from, entries * sizeof *from);
  memcpy(normal->B, from + entries, sides * sizeof *from);
  memcpy(normal->C, from + entries + sides, (size_t)normal->border * (size_t)normal->border * sizeof *from);
}

double *cav_normal_place(const cav_normal *normal, const cav_transcription *tr, int t) {
  int block = cav_transcription_block(tr, t, 0);
  if (normal->free_step || block < 0) return NULL;
  for (int c = 1; c < 3; c++)
    if (cav_transcription_block(tr, t, c) != block + c) return NULL;
  return (block + 3) * normal->n <= normal->core ? entry_of(normal, block * normal->n, block * normal->n) : NULL;
}

/// The band cleared before, or, fresh, where knots come in their order: the last block of each is new in the band, and all of the
/// first.
static void add_block(cav_normal *normal, const cav_transcription *tr, int t, const double *hessian,
                      const double *step_row, double step_square, int fresh) {
  int n = normal->n, last = normal->size - 1;
  for (int c = 0; c < 3; c++) {
    int column = cav_transcription_block(tr, t, c);
    for (int r = c; column >= 0 && r < 3; r++) {
      int row = cav_transcription_block(tr, t, r);
      if (row >= 0) gather_blocks(normal, hessian, row, column, r, c, fresh && (r == 2 || t == 0));
    }
    for (int j = 0; normal->free_step && column >= 0 && j < n; j++)
      *entry_of(normal, last, column * n + j) += step_row[c * n + j];
  }
  if (normal->free_step) *entry_of(normal, last, last) += step_square;
}

void cav_normal_add_block(cav_normal *normal, const cav_transcription *tr, int t, const double *hessian,
                          const double *step_row, double step_square) {
  add_block(normal, tr, t, hessian, step_row, step_square, 0);
}

void cav_normal_add_diagonal(cav_normal *normal, const double *diagonal) {
  for (int j = 0; j < normal->size; j++) {
    double *entry = entry_of(normal, j, j);
    *entry += diagonal[j];
    normal->diagonal[j] = *entry;
  }
  find_groups(normal);
}

/// Adds a knot's Hessian and gradient.
static void gather_knot(cav_normal *normal, const cav_transcription *tr, int t, const double *hessian, int fresh) {
  const cav_knot *knot = &tr->knot[t];
  const int n = normal->n;
  add_block(normal, tr, t, hessian, knot->step_row, knot->step_square, fresh);
  for (int c = 0; c < 3; c++) {
    int column = cav_transcription_block(tr, t, c);
    for (int j = 0; column >= 0 && j < n; j++) normal->gradient[column * n + j] += knot->gradient[c * n + j];
  }
  if (normal->free_step) normal->gradient[normal->size - 1] += knot->step_derivative;
}

/// The diagonal, and groups of what is joined, once all is gathered.
static void find_diagonal(cav_normal *normal) {
  for (int j = 0; j < normal->size; j++) normal->diagonal[j] = *entry_of(normal, j, j);
  find_groups(normal);
}

void cav_normal_gather(cav_normal *normal, const cav_transcription *tr) {
  cav_normal_clear(normal);
  for (int t = 0; t < tr->nknot; t++) gather_knot(normal, tr, t, tr->knot[t].hessian, 0);
  find_diagonal(normal);
}

const double *cav_normal_gradient(const cav_normal *normal) { return normal->gradient; }
const double *cav_normal_diagonal(const cav_normal *normal) { return normal->diagonal; }

void cav_normal_hold(cav_normal *normal) {
  int last = normal->size - 1;
  for (int j = 0; j < last; j++) *entry_of(normal, last, j) = 0;
  *entry_of(normal, last, last) = normal->diagonal[last] = 1;
  normal->gradient[last] = 0;
}

/// A diagonal entry of H as it is factored.
static double lifted(const cav_normal *normal, int j, double shift) {
  return normal->diagonal[j] > 0 ? normal->diagonal[j] * (1 + shift) : 1;
}

int cav_normal_groups(const cav_normal *normal, int *most) {
  *most = 0;
  for (int g = 0; g < normal->ngroup; g++) {
    int n = normal->first[g + 1] - normal->first[g];
    *most = *most > n ? *most : n;
  }
  return normal->ngroup;
}

/// Those of a group.
static const int *unknowns_of(const cav_normal *normal, int g) {
  return normal->unknown + (size_t)normal->first[g] * (size_t)normal->blocks;
}

/// Whether the free step stands beside the groups; one group has it in its border.
static int has_arrow(const cav_normal *normal) { return normal->free_step && normal->ngroup > 1; }

/// Copies column j of the part of H that is a group's into its band: n dofs a block, those from the diagonal on.
static void fill_column(const cav_normal *normal, const int *unknown, int n, int j, cav_band *band) {
  int column = unknown[j], end = j + band->width < band->core ? j + band->width : band->core, i = j;
  int reached = (j / n + 3) * n < end ? (j / n + 3) * n : end;
  const double *H = normal->H + (size_t)column * (size_t)normal->band - column;
  double *A = band->A + (size_t)j * (size_t)band->width;
  for (; i < reached; i++) A[i - j] = H[unknown[i]];
  for (; i < end; i++) A[i - j] = 0;
}

/// Copies columns of the part of H that is a group's into its band, the diagonal shifted.
static void fill_columns(cav_normal *normal, cav_band *band, const int *unknown, int n, int from, int to,
                         double shift) {
  for (int j = from; j < to; j++) {
    if (normal->ngroup == 1) {
      memcpy(band->A + (size_t)j * band->width, normal->H + (size_t)j * band->width,
             (size_t)band->width * sizeof(double));
    } else {
      fill_column(normal, unknown, n, j, band);
    }
    band->A[(size_t)j * band->width] = lifted(normal, unknown[j], shift);
  }
}

/// Copies what its border has.
static void fill_border(const cav_normal *normal, cav_band *band, const int *unknown, double shift) {
  for (int j = 0; j < band->core; j++)
    for (int i = 0; i < band->border; i++)
      band->Y[(size_t)i * band->core + j] = *entry_of(normal, unknown[band->core + i], unknown[j]);
  for (int j = 0; j < band->border; j++) {
    int column = unknown[band->core + j];
    double *S = band->S + (size_t)j * band->border;
    for (int i = j; i < band->border; i++) S[i] = *entry_of(normal, unknown[band->core + i], column);
    S[j] = lifted(normal, column, shift);
  }
}

/// x := inverse of the groups times b, but for a free step beside them.
static void solve_groups(const cav_normal *normal, const double *b, double *x) {
  for (int g = 0; g < normal->ngroup; g++) {
    const cav_band *band = &normal->group[g];
    const int *unknown = unknowns_of(normal, g);
    int size = band->core + band->border;
    for (int k = 0; k < size; k++) normal->x[k] = b[unknown[k]];
    cav_band_solve(band, normal->x);
    for (int k = 0; k < size; k++) x[unknown[k]] = normal->x[k];
  }
}

/// Row of the step, and its pivot.
static cav_status factor_arrow(cav_normal *normal, double shift) {
  int last = normal->size - 1;
  double *b = normal->arrow, *w = normal->arrow + normal->size, pivot = lifted(normal, last, shift);
  for (int j = 0; j < last; j++) b[j] = *entry_of(normal, last, j);
  solve_groups(normal, b, w);
  for (int j = 0; j < last; j++) pivot -= b[j] * w[j];
  w[last] = pivot;
  return pivot > 0 ? CAV_OK : CAV_NOT_CONVERGED;
}

/// The band of a group at a place, which is moved behind it.
static cav_band *place_band(cav_normal *normal, int g, double **at) {
  cav_band *band = &normal->group[g];
  int n = normal->first[g + 1] - normal->first[g];
  *band = (cav_band){.core = normal->core / normal->n * n, .width = 3 * n, .step = n, .A = *at};
  band->border = normal->blocks * n - band->core + (normal->free_step && !has_arrow(normal));
  band->Y = band->A + (size_t)band->core * band->width;
  band->S = band->Y + (size_t)band->core * band->border;
  *at = band->S + (size_t)band->border * band->border;
  return band;
}

cav_status cav_normal_factor(cav_normal *normal, double shift) {
  double *at = normal->factor;
  cav_status status = CAV_OK;
  for (int g = 0; g < normal->ngroup && status == CAV_OK; g++) {
    cav_band *band = place_band(normal, g, &at);
    const int *unknown = unknowns_of(normal, g);
    fill_columns(normal, band, unknown, band->step, 0, band->core, shift);
    fill_border(normal, band, unknown, shift);
    status = cav_band_factor(band);
  }
  return status == CAV_OK && has_arrow(normal) ? factor_arrow(normal, shift) : status;
}

/// product += what columns of the band and their mirror images give.
CAV_VECTOR_BODY void multiply_columns_body(const cav_normal *normal, int from, int to, const double *x,
                                           double *product) {
  for (int j = from; j < to; j++) {
    const double *H = normal->H + (size_t)j * normal->band - j;
    int end = end_of(normal, j);
    double sum = H[j] * x[j];
    for (int i = j + 1; i < end; i++) {
      product[i] += H[i] * x[j];
      sum += H[i] * x[i];
    }
    product[j] += sum;
  }
}
CAV_BY_VECTORS(multiply_columns, (const cav_normal *normal, int from, int to, const double *x, double *product),
               (normal, from, to, x, product))

int cav_normal_is_band(const cav_normal *normal) { return normal->ntree == 1 && normal->border == 0; }
int cav_normal_was_band(const cav_normal *normal) { return normal->ngroup == 1 && normal->border == 0; }

/// One pass over the knots that factors a sum.
typedef struct sum_pass {
  cav_normal *normal;
  const cav_transcription *tr;
  const cav_normal_sum *sum;
  cav_band *band;
  double shift;
  int filled;         ///< columns that are added and shifted
  atomic_int is_over; ///< a pivot was not positive
} sum_pass;

/// First column that no knot before t adds to.
static int new_columns(const sum_pass *s, int t) {
  const int first = t > 0 ? (t - s->tr->first + 1) * s->normal->n : 0;
  return first < s->band->core ? first : s->band->core;
}

/// Columns' products with x, each from its diagonal down, of four columns side by side: one after the other their sums would wait
/// for each other.
CAV_VECTOR_BODY void multiply_four(const cav_normal *normal, const double *kept, int first, const double *x,
                                   double *sum) {
  const double *H[4];
  const int end = end_of(normal, first);
  assert(end >= first + 4);
  for (int c = 0; c < 4; c++) {
    const int j = first + c;
    H[c] = kept + (size_t)j * normal->band - j;
    sum[c] = H[c][j] * x[j];
    for (int i = j + 1; i < first + 4; i++) sum[c] += H[c][i] * x[i];
  }
  double a = sum[0], b = sum[1], c = sum[2], d = sum[3];
  for (int i = first + 4; i < end; i++)
    a += H[0][i] * x[i], b += H[1][i] * x[i], c += H[2][i] * x[i], d += H[3][i] * x[i];
  sum[0] = a, sum[1] = b, sum[2] = c, sum[3] = d;
  // later columns may end later
  for (int k = 1; k < 4; k++)
    for (int i = end, last = end_of(normal, first + k); i < last; i++) sum[k] += H[k][i] * x[i];
}

/// product := rows from .. to-1 of what was kept times x, each the sum of multiply_columns.
CAV_VECTOR_BODY void multiply_rows_body(const cav_normal *normal, const double *kept, int from, int to, const double *x,
                                        double *product) {
  const int before = (from / normal->n - 2) * normal->n;
  double sum[4];
  memset(product + from, 0, (size_t)(to - from) * sizeof *product);
  for (int j = before > 0 ? before : 0; j < to; j++) {
    const double *H = kept + (size_t)j * normal->band - j;
    const int end = end_of(normal, j), last = end < to ? end : to, own = (j - from) % 4;
    const int by_four = j - own + 4 <= to;
    if (j >= from && own == 0 && by_four) multiply_four(normal, kept, j, x, sum);
    for (int i = j < from ? from : j + 1; i < last; i++) product[i] += H[i] * x[j];
    if (j < from) continue;
    if (!by_four) {
      sum[own] = H[j] * x[j];
      for (int i = j + 1; i < end; i++) sum[own] += H[i] * x[i];
    }
    product[j] += sum[own];
  }
}
CAV_BY_VECTORS(multiply_rows,
               (const cav_normal *normal, const double *kept, int from, int to, const double *x, double *product),
               (normal, kept, from, to, x, product))

/// What stands by itself of a knot: columns that are new are copied to the factor's place and multiplied.
static void find_part(void *context, int t, int member) {
  sum_pass *s = context;
  const int from = new_columns(s, t), to = t + 1 < s->tr->nknot ? new_columns(s, t + 1) : s->band->core;
  const size_t width = (size_t)s->normal->band;
  if (atomic_load(&s->is_over)) return;
  if (to > from) {
    memcpy(s->band->A + (size_t)from * width, s->sum->kept + (size_t)from * width,
           (size_t)(to - from) * width * sizeof(double));
    multiply_rows(s->normal, s->sum->kept, from, to, s->sum->x, s->sum->product);
  }
  if (s->sum->find) s->sum->find(s->sum->context, t, member);
}

/// Adds the rest of it; columns that no later knot adds to are factored.
static void factor_part(void *context, int t) {
  sum_pass *s = context;
  cav_normal *normal = s->normal;
  const int last = t + 1 == s->tr->nknot ? s->band->core : (t - s->tr->first) * normal->n;
  if (atomic_load(&s->is_over)) return;
  s->sum->add(s->sum->context, t);
  if (last <= s->filled) return;
  for (int j = s->filled; j < last; j++) {
    double *entry = &s->band->A[(size_t)j * (size_t)normal->band];
    normal->diagonal[j] = *entry + s->sum->diagonal[j];
    *entry = lifted(normal, j, s->shift);
  }
  s->filled = last;
  if (cav_band_factor_part(s->band, last) != CAV_OK) atomic_store(&s->is_over, 1);
}

cav_status cav_normal_factor_sum(cav_normal *normal, const cav_transcription *tr, const cav_normal_sum *sum,
                                 double shift) {
  double *at = normal->factor, *H = normal->H;
  if (normal->ntree == 1) find_groups(normal);
  sum_pass s = {.normal = normal, .tr = tr, .sum = sum, .band = place_band(normal, 0, &at), .shift = shift};
  atomic_init(&s.is_over, 0);
  // the factor's own place is what is gathered in: its columns lie as those of H
  normal->H = s.band->A;
  cav_parallel_then(tr->pool, tr->nknot, find_part, factor_part, &s, tr->ready);
  normal->H = H;
  return s.band->done >= 0 ? CAV_OK : CAV_NOT_CONVERGED;
}

/// Knots that are taken one after the other.
typedef struct stream {
  cav_normal *normal;
  const cav_transcription *tr;
  double shift;
  int whole; ///< one group whatever is gathered, and no later knot comes back to the first: factored on the way
} stream;

static void take_knot(void *context, int t) {
  const stream *s = context;
  cav_normal *normal = s->normal;
  cav_band *band = normal->group;
  gather_knot(normal, s->tr, t, s->tr->knot[t].present, s->whole);
  // the next two knots add to all blocks but these
  int last = t + 1 < s->tr->nknot ? (t - s->tr->first) * normal->n : band->core;
  if (!s->whole || last <= normal->filled) return;
  for (int j = normal->filled; j < last; j++) normal->diagonal[j] = *entry_of(normal, j, j);
  fill_columns(normal, band, normal->unknown, normal->n, normal->filled, last, s->shift);
  normal->filled = last;
  cav_band_factor_part(band, last);
}

cav_status cav_normal_linearise(cav_normal *normal, cav_transcription *tr, cav_trajectory *at, double shift,
                                cav_status *factored) {
  stream s = {.normal = normal, .tr = tr, .shift = shift, .whole = normal->ntree == 1 && !normal->cyclic};
  double *place = normal->factor;
  normal->filled = 0;
  if (s.whole)
    clear_rest(normal), find_groups(normal), place_band(normal, 0, &place);
  else
    cav_normal_clear(normal);
  cav_status status = cav_transcription_linearise_then(tr, at, take_knot, &s);
  if (status != CAV_OK) return status;
  find_diagonal(normal);
  if (s.whole) {
    fill_border(normal, normal->group, normal->unknown, shift);
    *factored = cav_band_factor(normal->group);
  } else {
    *factored = cav_normal_factor(normal, shift);
  }
  return CAV_OK;
}

void cav_normal_solve(const cav_normal *normal, const double *b, double *x) {
  int last = normal->size - 1;
  if (!has_arrow(normal)) {
    solve_groups(normal, b, x);
    return;
  }
  // the step first; b may be x
  const double *w = normal->arrow + normal->size;
  double step = b[last];
  for (int j = 0; j < last; j++) step -= w[j] * b[j];
  step /= w[last];
  solve_groups(normal, b, x);
  for (int j = 0; j < last; j++) x[j] -= w[j] * step;
  x[last] = step;
}

void cav_normal_multiply_kept(const cav_normal *normal, const double *kept, const double *x, double *product) {
  cav_normal of = *normal;
  of.H = (double *)kept;
  of.B = of.H + entries_of(normal);
  of.C = of.B + (size_t)normal->core * (size_t)normal->border;
  cav_normal_multiply(&of, x, product);
}

void cav_normal_multiply(const cav_normal *normal, const double *x, double *product) {
  int core = normal->core, border = normal->border;
  memset(product, 0, (size_t)normal->size * sizeof(double));
  multiply_columns(normal, 0, core, x, product);
  for (int i = 0; i < border; i++) {
    const double *B = normal->B + (size_t)i * core;
    double sum = 0;
    for (int j = 0; j < core; j++) sum += B[j] * x[j], product[j] += B[j] * x[core + i];
    for (int j = 0; j < border; j++) sum += *entry_of(normal, core + i, core + j) * x[core + j];
    product[core + i] += sum;
  }
}

/// Row of the entry after (i, j) in column j of the lower triangle; the size at its end.
static int next_row(const cav_normal *normal, int i, int j) {
  i++;
  if (j >= normal->core) return i;
  if (i < normal->core && i == end_of(normal, j)) i = normal->core;
  while (i >= normal->core && i < normal->size && !meets(normal, i - normal->core, j)) i++;
  return i;
}

int cav_normal_entries(const cav_normal *normal, int *row, int *col, double *value) {
  int entries = 0;
  for (int j = 0; j < normal->size; j++) {
    for (int i = j; i < normal->size; i = next_row(normal, i, j)) {
      if (row) row[entries] = i;
      if (col) col[entries] = j;
      if (value) value[entries] = *entry_of(normal, i, j);
      entries++;
    }
  }
  return entries;
}

void cav_normal_shift_entries(const cav_normal *normal, double factor, double absolute, double fraction,
                              double *value) {
  for (int j = 0, k = 0; j < normal->size; j++) {
    value[k] = factor * value[k] + absolute + fraction * normal->diagonal[j];
    k++;
    for (int i = next_row(normal, j, j); i < normal->size; i = next_row(normal, i, j)) value[k++] *= factor;
  }
}
