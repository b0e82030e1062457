/// Interior point for the quadratic programme of one linearisation. Rows have exact penalties (elastic rows: Fletcher's
/// S-l1-QP), so every programme has a solution, and a box holds the step.
///
/// A side of a row with signed slack d (value minus lower, or upper minus value) has s - e = d, s >= 0, e >= 0 at the
/// penalty e times its penalty p; its multiplier y is in [0, p], and on the central path s y = e (p - y) = mu. Newton's
/// step with both eliminated adds to the Hessian w J'J with 1/w = s/y + e/(p - y), so one banded factor of the own
/// solver serves, whatever rows are active. Predictor and corrector as in Mehrotra (1992); the start is the point of
/// the central path at x = 0. Under other penalties a programme goes on from its last solution, with slacks that are off
/// what they are of: steps bring those in as they do the dual residual.
#include "quadratic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "readings.h"

/// Iterations at most; a window of them, in which the gap has to become a tenth; how many may meet a Hessian that is not
/// convex; part of the way to the boundary that a step goes; fraction of the cost that the gap starts with, and with
/// what it starts again.
enum { ITERATIONS = 60, WINDOW = 10, BENT = 9 };
static const double boundary = 0.995, first_gap[] = {0.1, 1e3, 1e6};
/// Of a solution to go on from: the gap, of what it decreases; slack, in units of a row, of a row that is at its bound
/// or beyond and was not.
static const double resumed_gap = 1e-2, nearby = 1e-2;

/// Fraction of its diagonal that is added to a matrix that has no factor, at first; what that grows and falls by.
static const double first_lift = 1e-14, lift_step = 100;

/// The most that a row which gives may weigh, over the cost: its square's rounding is then a thousandth of the cost for a
/// step of 1.
static const double most_weight = 1e13;

enum { STARTS = sizeof first_gap / sizeof *first_gap };

/// Entries up to which a row is added by itself.
enum { SPARSE = 12 };

/// One side of a row, or of the box. The box has neither e nor z: its sides are hard.
typedef struct side {
  double s, e, y, z; ///< z: penalty less y. y 0: there is no such side
  double ds, de, dy; ///< step
  double off;        ///< s less e, over d: of a start that does not hold them to it
  double w;          ///< 1 / (s/y + e/z + g)
} side;

struct cav_quadratic {
  const cav_transcription *tr;
  cav_normal *normal;
  int n, rows, sides, *first;             ///< unknowns; rows; sides that are on; [nknot] first row of a knot
  side *row;                              ///< [2*rows] lower, upper
  side *box;                              ///< [2*n]
  double *penalty, *value, *multiplier;   ///< [rows]
  double *give;                           ///< [rows] g: what a row gives for a unit of its multiplier
  double *change, *weight, *ray;          ///< [rows] J dx; w of both sides; right-hand side
  int *entries;                           ///< [rows*(SPARSE+1)] of a row: how many are not zero and their columns; or 0
  double *x, *dx, *rhs, *gradient, *work; ///< [n]
  double *local, *image, *block;          ///< [3nv+1] of one knot, [9nv^2]
  int members;                            ///< of the team of threads
  double *locals, *dense, *square; ///< [nknot*(3nv+1)] of each knot; [members * most rows * 3nv], [members * its room]
  double *triangle;                ///< [nknot*9nv^2] squares of many members, lower triangles by columns
  size_t dense_room, square_room;
  const double *ahead; ///< what the team multiplies the rows by, or with
  double *product;     ///< where that goes
  double *costs;       ///< normal equations of the costs alone, as they are kept
  double lifted;       ///< fraction of its diagonal that the last factor needed besides
  double gives;        ///< what the weights of rows that give are told by, a cost; 0: none does
  int is_band;         ///< whether all unknowns are one, which is factored as it is gathered
  int bent;            ///< iterations whose matrix was far from positive definite
  double predicted;    ///< decrease of the last solution
  double gap;          ///< complementarities of the last solution
  double *bound;       ///< [2*n] of the box
};

cav_quadratic *cav_quadratic_new(const cav_transcription *tr, cav_normal *normal) {
  cav_quadratic *p = calloc(1, sizeof *p);
  if (!p) return NULL;
  size_t nv = (size_t)tr->nv, most = 0;
  p->tr = tr;
  p->normal = normal;
  p->n = cav_transcription_unknowns(tr);
  p->first = malloc((size_t)tr->nknot * sizeof(int));
  for (int t = 0; p->first && t < tr->nknot; t++) {
    p->first[t] = p->rows;
    p->rows += tr->knot[t].layout.count;
    if ((size_t)tr->knot[t].layout.count > most) most = (size_t)tr->knot[t].layout.count;
  }
  size_t rows = (size_t)p->rows, n = (size_t)p->n, local = 3 * nv + 1, knots = (size_t)tr->nknot;
  p->members = cav_parallel_size(tr->pool);
  p->dense_room = (most + 1) * 3 * nv;
  p->square_room = cav_dense_square_room((int)(3 * nv));
  // a single thread adds a square before it finds the next
  const size_t triangles = p->members > 1 ? knots * 9 * nv * nv : 0;
  const size_t rooms = (size_t)p->members * (p->dense_room + p->square_room);
  p->locals = malloc((knots * local + rooms + triangles) * sizeof(double));
  p->row = calloc(2 * rows + 1, sizeof *p->row);
  p->box = calloc(2 * n, sizeof *p->box);
  p->penalty = calloc(7 * rows + 7 * n + 2 * local + 9 * nv * nv, sizeof(double));
  p->entries = malloc((rows + 1) * (SPARSE + 1) * sizeof(int));
  p->costs = malloc(cav_normal_room(normal) * sizeof(double));
  if (!p->first || !p->row || !p->box || !p->penalty || !p->entries || !p->costs || !p->locals) {
    cav_quadratic_free(p);
    return NULL;
  }
  double *next = p->penalty + rows;
  double **const of_rows[] = {&p->value, &p->multiplier, &p->give, &p->change, &p->weight, &p->ray};
  double **const of_unknowns[] = {&p->x, &p->dx, &p->rhs, &p->gradient, &p->work};
  for (int i = 0; i < 6; i++) *of_rows[i] = next, next += rows;
  for (int i = 0; i < 5; i++) *of_unknowns[i] = next, next += n;
  p->bound = next, next += 2 * n;
  p->local = next, next += local;
  p->image = next, next += local;
  p->block = next;
  p->dense = p->locals + knots * local;
  p->square = p->dense + (size_t)p->members * p->dense_room;
  p->triangle = p->square + (size_t)p->members * p->square_room;
  return p;
}

void cav_quadratic_free(cav_quadratic *p) {
  if (!p) return;
  free(p->first), free(p->row), free(p->box), free(p->penalty), free(p->entries), free(p->costs), free(p->locals);
  free(p);
}

const double *cav_quadratic_step(const cav_quadratic *p) { return p->x; }
const double *cav_quadratic_multiplier(const cav_quadratic *p) { return p->multiplier; }
double *cav_quadratic_penalty(cav_quadratic *p) { return p->penalty; }
double *cav_quadratic_value(cav_quadratic *p) { return p->value; }
int cav_quadratic_rows(const cav_quadratic *p) { return p->rows; }
double cav_quadratic_gap(const cav_quadratic *p) { return p->gap; }
void cav_quadratic_let_give(cav_quadratic *p, double scale) { p->gives = scale; }

double cav_quadratic_length(const cav_quadratic *p) {
  double most = 0;
  for (int i = 0; i < p->n; i++) most = fmax(most, fabs(p->x[i]));
  return most;
}

// ---------------------------------------------------------------- products

/// By eight sums side by side: one after another they would wait for each other.
static inline double dot(int n, const double *a, const double *b) {
  cav_four low = {0}, high = {0};
  double sum = 0;
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    low += *(const cav_four *)(a + i) * *(const cav_four *)(b + i);
    high += *(const cav_four *)(a + i + 4) * *(const cav_four *)(b + i + 4);
  }
  for (; i < n; i++) sum += a[i] * b[i];
  low += high;
  return sum + ((low[0] + low[1]) + (low[2] + low[3]));
}

/// Unknowns of a knot's columns, and the step's logarithm after them.
static void take(const cav_quadratic *p, int t, const double *x, double *local) {
  size_t nv = (size_t)p->tr->nv;
  for (int c = 0; c < 3; c++) {
    int block = cav_transcription_block(p->tr, t, c);
    if (block >= 0) memcpy(local + (size_t)c * nv, x + (size_t)block * nv, nv * sizeof(double));
    if (block < 0) memset(local + (size_t)c * nv, 0, nv * sizeof(double));
  }
  local[3 * nv] = p->tr->free_step ? x[p->n - 1] : 0;
}

static void give(const cav_quadratic *p, int t, const double *local, double *x) {
  int nv = p->tr->nv;
  for (int c = 0; c < 3; c++) {
    int block = cav_transcription_block(p->tr, t, c);
    for (int d = 0; block >= 0 && d < nv; d++) x[block * nv + d] += local[c * nv + d];
  }
  if (p->tr->free_step) x[p->n - 1] += local[3 * nv];
}

/// Room for the unknowns of a knot, and the step's logarithm, of its own.
static double *local_of(const cav_quadratic *p, int t) { return p->locals + (size_t)t * (size_t)(3 * p->tr->nv + 1); }

/// A knot's part of J x.
CAV_VECTOR_BODY void knot_rows_times_body(const cav_quadratic *p, int t) {
  const int width = 3 * p->tr->nv;
  const cav_knot *knot = &p->tr->knot[t];
  double *local = local_of(p, t);
  take(p, t, p->ahead, local);
  for (int i = 0; i < knot->layout.count; i++) {
    const double *row = knot->slot_row + (size_t)i * (size_t)width;
    const int *entry = p->entries + (SPARSE + 1) * (p->first[t] + i);
    double sum = p->tr->free_step ? knot->slot_step[i] * local[width] : 0;
    for (int k = 1; k <= entry[0]; k++) sum += row[entry[k]] * local[entry[k]];
    if (entry[0] == 0) sum += dot(width, row, local);
    p->product[p->first[t] + i] = sum;
  }
}
CAV_BY_VECTORS(knot_rows_times, (const cav_quadratic *p, int t), (p, t))
static void rows_times_item(void *context, int t, int member) { (void)member, knot_rows_times(context, t); }

/// product := J x. [rows]
static void rows_times(cav_quadratic *p, const double *x, double *product) {
  p->ahead = x, p->product = product;
  cav_parallel_for(p->tr->pool, p->tr->nknot, rows_times_item, p);
}

/// A knot's part of J' y.
CAV_VECTOR_BODY void knot_rows_add_body(const cav_quadratic *p, int t) {
  const int width = 3 * p->tr->nv;
  const cav_knot *knot = &p->tr->knot[t];
  double *local = local_of(p, t);
  memset(local, 0, (size_t)(width + 1) * sizeof(double));
  for (int i = 0; i < knot->layout.count; i++) {
    const double *row = knot->slot_row + (size_t)i * (size_t)width;
    const int *entry = p->entries + (SPARSE + 1) * (p->first[t] + i);
    const double yi = p->ahead[p->first[t] + i];
    if (yi == 0) continue;
    for (int k = 1; k <= entry[0]; k++) local[entry[k]] += yi * row[entry[k]];
    for (int k = 0; k < width && entry[0] == 0; k++) local[k] += yi * row[k];
    if (p->tr->free_step) local[width] += yi * knot->slot_step[i];
  }
}
CAV_BY_VECTORS(knot_rows_add, (const cav_quadratic *p, int t), (p, t))
static void add_rows_item(void *context, int t, int member) { (void)member, knot_rows_add(context, t); }

/// out += J' y. [unknowns]
static void add_rows(cav_quadratic *p, const double *y, double *out) {
  p->ahead = y;
  cav_parallel_for(p->tr->pool, p->tr->nknot, add_rows_item, p);
  for (int t = 0; t < p->tr->nknot; t++) give(p, t, local_of(p, t), out);
}

/// image := H x of a knot's costs alone; local [3nv+1] holds x.
CAV_VECTOR_BODY void knot_times_body(const cav_quadratic *p, int t) {
  int width = 3 * p->tr->nv;
  const cav_knot *knot = &p->tr->knot[t];
  memset(p->image, 0, (size_t)(width + 1) * sizeof(double));
  for (int i = 0; i < width; i++) {
    const double *row = knot->hessian + (size_t)i * (size_t)width;
    double *image = p->image, here = p->local[i];
    for (int j = 0; j < i; j++) image[j] += row[j] * here;
    image[i] = dot(i + 1, row, p->local);
  }
  if (!p->tr->free_step) return;
  p->image[width] = knot->step_square * p->local[width];
  for (int k = 0; k < width; k++) {
    p->image[width] += knot->step_row[k] * p->local[k];
    p->image[k] += knot->step_row[k] * p->local[width];
  }
}
CAV_BY_VECTORS(knot_times, (const cav_quadratic *p, int t), (p, t))

/// Lists the entries of rows that have few, and gathers the costs' Hessian, as both are at this linearisation.
static void prepare(cav_quadratic *p) {
  const cav_transcription *tr = p->tr;
  int width = 3 * tr->nv;
  cav_normal_clear(p->normal);
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    cav_normal_add_block(p->normal, tr, t, knot->hessian, knot->step_row, knot->step_square);
    for (int i = 0; i < knot->layout.count; i++) {
      const double *row = knot->slot_row + (size_t)i * (size_t)width;
      int *entry = p->entries + (SPARSE + 1) * (p->first[t] + i), n = 0;
      for (int k = 0; k < width && n <= SPARSE; k++) {
        if (row[k] == 0) continue;
        if (n++ < SPARSE) entry[n] = k;
      }
      entry[0] = n <= SPARSE ? n : 0;
    }
  }
  cav_normal_save(p->normal, p->costs);
  p->is_band = cav_normal_is_band(p->normal);
}

static double slack(const cav_slot *slot, double value, int upper) {
  return upper ? slot->upper - value : value - slot->lower;
}

const double *cav_quadratic_prediction(cav_quadratic *p) {
  rows_times(p, p->x, p->change);
  for (int r = 0; r < p->rows; r++) p->change[r] += p->value[r];
  return p->change;
}

double cav_quadratic_knot_decrease(cav_quadratic *p, int t) {
  int width = 3 * p->tr->nv;
  const cav_knot *knot = &p->tr->knot[t];
  take(p, t, p->x, p->local);
  knot_times(p, t);
  double decrease = -dot(width, knot->gradient, p->local) - 0.5 * dot(width + 1, p->image, p->local);
  if (p->tr->free_step) decrease -= knot->step_derivative * p->local[width];
  for (int i = 0; i < knot->layout.count; i++) {
    const cav_slot *slot = &knot->slot[i];
    int k = p->first[t] + i;
    double before = p->value[k], after = before + p->change[k];
    decrease += p->penalty[k] * (fmax(fmax(slot->lower - before, before - slot->upper), 0) -
                                 fmax(fmax(slot->lower - after, after - slot->upper), 0));
  }
  return decrease;
}

double cav_quadratic_decrease(cav_quadratic *p) {
  double decrease = 0;
  rows_times(p, p->x, p->change);
  for (int t = 0; t < p->tr->nknot; t++) decrease += cav_quadratic_knot_decrease(p, t);
  return decrease;
}

// ---------------------------------------------------------------- start

/// Point of the central path of an elastic side at signed slack d: s - e = d, s y = e (p - y) = mu.
static side centred(double d, double penalty, double mu) {
  double pd = penalty * d, root = sqrt(pd * pd + 4 * mu * mu);
  // the smaller of s and e by the product of both, without cancellation
  double sum = (2 * mu + root) / penalty, e, s;
  if (d > 0) {
    s = 0.5 * (sum + d);
    e = mu / (penalty - mu / s);
  } else {
    e = 0.5 * (sum - d);
    s = mu / (penalty - mu / e);
  }
  return (side){.s = s, .e = e, .y = mu / s, .z = mu / e};
}

/// Bounds of the step, and how many complementarities there are.
static void set_bounds(cav_quadratic *p, const double *radius, const double change[2]) {
  p->sides = 0;
  for (int j = 0; j < p->n; j++) {
    int step = p->tr->free_step && j == p->n - 1;
    double r = radius[j / p->tr->nv];
    p->bound[2 * j] = step ? fmax(-r, change[0]) : -r;
    p->bound[2 * j + 1] = step ? fmin(r, change[1]) : r;
    p->sides += 2;
  }
  for (int t = 0; t < p->tr->nknot; t++)
    for (int i = 0; i < p->tr->knot[t].layout.count; i++)
      for (int k = 0; k < 2; k++)
        p->sides += 2 * (isfinite(k ? p->tr->knot[t].slot[i].upper : p->tr->knot[t].slot[i].lower) != 0);
}

/// The point of the central path with a gap at a step of nothing.
static void start(cav_quadratic *p, double gap) {
  double mu = gap / p->sides;
  for (int j = 0; j < p->n; j++) {
    double width = p->bound[2 * j + 1] - p->bound[2 * j];
    p->x[j] = fmin(fmax(0, p->bound[2 * j] + 0.05 * width), p->bound[2 * j + 1] - 0.05 * width);
  }
  memset(p->dx, 0, (size_t)p->n * sizeof(double));
  rows_times(p, p->x, p->change);
  for (int j = 0; j < p->n; j++) {
    double below = p->x[j] - p->bound[2 * j], above = p->bound[2 * j + 1] - p->x[j];
    p->box[2 * j] = (side){.s = below, .y = mu / below};
    p->box[2 * j + 1] = (side){.s = above, .y = mu / above};
  }
  for (int t = 0; t < p->tr->nknot; t++) {
    for (int i = 0; i < p->tr->knot[t].layout.count; i++) {
      const cav_slot *slot = &p->tr->knot[t].slot[i];
      int r = p->first[t] + i;
      for (int k = 0; k < 2; k++) {
        double d = slack(slot, p->value[r] + p->change[r], k);
        p->row[2 * r + k] = isfinite(d) ? centred(d, p->penalty[r], mu) : (side){0};
      }
    }
  }
}

/// A side at signed slack d and about the multiplier that it had, with complementarities of mu: off its slack, unless
/// it is far inside.
static side resumed(double d, double penalty, double y, double mu) {
  double least = mu / fmax(d, nearby), most = penalty - mu / fmax(-d, nearby);
  y = fmax(fmin(y, fmax(most, 0.5 * penalty)), fmin(least, 0.5 * penalty));
  side z = {.s = mu / y, .e = mu / (penalty - y), .y = y, .z = penalty - y};
  z.off = z.s - z.e - d;
  return z;
}

/// A start with a gap from the last solution, where that was of the same programme under other penalties.
static void start_again(cav_quadratic *p, double gap) {
  double mu = gap / p->sides;
  memset(p->dx, 0, (size_t)p->n * sizeof(double));
  rows_times(p, p->x, p->change);
  for (int j = 0; j < 2 * p->n; j++) {
    double d = j % 2 ? p->bound[j] - p->x[j / 2] : p->x[j / 2] - p->bound[j];
    double y = fmax(p->box[j].y, mu / fmax(d, nearby * (p->bound[j | 1] - p->bound[j & ~1])));
    p->box[j] = (side){.s = mu / y, .y = y, .off = mu / y - d};
  }
  for (int t = 0; t < p->tr->nknot; t++) {
    for (int i = 0; i < p->tr->knot[t].layout.count; i++) {
      int r = p->first[t] + i;
      for (int k = 0; k < 2; k++) {
        double d = slack(&p->tr->knot[t].slot[i], p->value[r] + p->change[r], k);
        p->row[2 * r + k] = isfinite(d) ? resumed(d, p->penalty[r], p->row[2 * r + k].y, mu) : (side){0};
      }
    }
  }
}

// ---------------------------------------------------------------- one iteration

/// Moves all by a part of the step; weights of sides, multipliers and the gap there.
static void advance(cav_quadratic *p, double length) {
  p->gap = 0;
  for (int j = 0; j < p->n; j++) p->x[j] += length * p->dx[j];
  for (int r = 0; r < p->rows; r++) {
    p->multiplier[r] = 0;
    for (int k = 0; k < 2; k++) {
      side *z = &p->row[2 * r + k];
      if (z->y == 0) continue;
      z->s += length * z->ds, z->e += length * z->de, z->y += length * z->dy, z->z -= length * z->dy;
      z->off = (1 - length) * z->off + length * p->give[r] * z->dy;
      z->w = z->y * z->z / (z->s * z->z + z->e * z->y + p->give[r] * z->y * z->z);
      p->multiplier[r] += k ? z->y : -z->y;
      p->gap += z->s * z->y + z->e * z->z;
    }
  }
  for (int j = 0; j < 2 * p->n; j++) {
    side *z = &p->box[j];
    z->s += length * z->ds, z->y += length * z->dy;
    z->off *= 1 - length;
    z->w = z->y / z->s;
    p->gap += z->s * z->y;
  }
}

/// Lagrangian's gradient at x but for the rows' part, into rhs, which holds the costs' Hessian times x.
static void dual_residual(cav_quadratic *p) {
  for (int j = 0; j < p->n; j++) p->rhs[j] += p->gradient[j] + p->box[2 * j + 1].y - p->box[2 * j].y;
}

static double *triangle_of(const cav_quadratic *p, int t) {
  const size_t width = 3 * (size_t)p->tr->nv;
  return p->triangle + (size_t)t * width * width;
}

/// The square of a knot's weighted rows with many entries, found by a member of the team.
static void square_rows(void *context, int t, int member) {
  const cav_quadratic *p = context;
  const cav_knot *knot = &p->tr->knot[t];
  const int width = 3 * p->tr->nv;
  double *dense = p->dense + (size_t)member * p->dense_room;
  int ndense = 0;
  for (int i = 0; i < knot->layout.count; i++) {
    const double *row = knot->slot_row + (size_t)i * (size_t)width, root = sqrt(p->weight[p->first[t] + i]);
    if (p->entries[(SPARSE + 1) * (p->first[t] + i)] > 0) continue;
    double *out = dense + (size_t)ndense++ * (size_t)width;
    for (int k = 0; k < width; k++) out[k] = root * row[k];
  }
  double *square = p->square + (size_t)member * p->square_room;
  cav_dense_square_find(CAV_TRIANGLE_LOWER, width, 3, ndense, dense, width, square);
  if (p->members == 1) return;
  double *to = triangle_of(p, t);
  memset(to, 0, (size_t)width * (size_t)width * sizeof *to);
  cav_dense_square_add(CAV_TRIANGLE_LOWER, width, 3, square, to, width);
}

/// Adds it to the lower triangle of the knot's block, by columns.
static void add_square(const cav_quadratic *p, int t, double *block, int ld) {
  const int width = 3 * p->tr->nv;
  if (p->members == 1) {
    cav_dense_square_add(CAV_TRIANGLE_LOWER, width, 3, p->square, block, ld);
    return;
  }
  const double *from = triangle_of(p, t);
  for (int j = 0; j < width; j++, from += width, block += ld)
    for (int i = j; i < width; i++) block[i] += from[i];
}

/// Adds the weighted rows of a knot, whose square is found, to the lower triangle of its block, by columns, and to what the
/// step's logarithm meets.
static void weigh_rows(cav_quadratic *p, int t, double *block, int ld, double *step_row, double *step_square) {
  const cav_knot *knot = &p->tr->knot[t];
  int width = 3 * p->tr->nv;
  for (int i = 0; i < knot->layout.count; i++) {
    const double *row = knot->slot_row + (size_t)i * (size_t)width;
    const int *entry = p->entries + (SPARSE + 1) * (p->first[t] + i), *column = entry + 1;
    double w = p->weight[p->first[t] + i];
    for (int b = 0; b < entry[0]; b++)
      for (int a = b; a < entry[0]; a++) block[column[b] * ld + column[a]] += w * row[column[a]] * row[column[b]];
    if (!p->tr->free_step) continue;
    for (int k = 0; k < width; k++) step_row[k] += w * knot->slot_step[i] * row[k];
    *step_square += w * knot->slot_step[i] * knot->slot_step[i];
  }
  add_square(p, t, block, ld);
}

/// Adds the weighted rows of a knot, whose square is found, to the costs' Hessian, which the normal equations hold.
static void gather_knot(void *context, int t) {
  cav_quadratic *p = context;
  const cav_transcription *tr = p->tr;
  int width = 3 * tr->nv;
  double square = 0, *place = cav_normal_place(p->normal, tr, t);
  if (place) {
    weigh_rows(p, t, place, width - 1, NULL, NULL);
    return;
  }
  memset(p->block, 0, (size_t)width * (size_t)width * sizeof(double));
  memset(p->local, 0, (size_t)width * sizeof(double));
  weigh_rows(p, t, p->block, width, p->local, &square);
  for (int i = 0; i < width; i++)
    for (int j = 0; j < i; j++) p->block[i * width + j] = p->block[j * width + i];
  cav_normal_add_block(p->normal, tr, t, p->block, p->local, square);
}

/// Factors costs, weighted rows and the diagonal in work with a shift; rhs := the costs' Hessian times x. again: the last call
/// with another shift.
static cav_status factor_sum(cav_quadratic *p, double shift, int again) {
  cav_normal_sum sum = {
      .kept = p->costs, .diagonal = p->work, .x = p->x, .product = p->rhs, square_rows, gather_knot, p};
  if (p->is_band) return cav_normal_factor_sum(p->normal, p->tr, &sum, shift);
  if (again) return cav_normal_factor(p->normal, shift);
  cav_normal_load(p->normal, p->costs);
  cav_normal_multiply(p->normal, p->x, p->rhs);
  cav_parallel_then(p->tr->pool, p->tr->nknot, square_rows, gather_knot, p, p->tr->ready);
  cav_normal_add_diagonal(p->normal, p->work);
  return cav_normal_factor(p->normal, shift);
}

int cav_quadratic_convex(cav_quadratic *p) {
  memset(p->work, 0, (size_t)p->n * sizeof(double));
  prepare(p);
  return factor_sum(p, 1e-10, 0) == CAV_OK;
}

int cav_quadratic_knot_convex(cav_quadratic *p, int t, double shift) {
  int width = 3 * p->tr->nv;
  double square = 0;
  for (int i = 0; i < width; i++)
    for (int j = 0; j <= i; j++) p->block[j * width + i] = p->tr->knot[t].hessian[i * width + j];
  square_rows(p, t, 0);
  weigh_rows(p, t, p->block, width, p->local, &square);
  for (int i = 0; i < width; i++) {
    double *d = &p->block[i * width + i];
    // columns of knots that are no unknowns are empty
    *d = *d == 0 ? 1 : *d + 1e-10 * fabs(*d) + shift;
  }
  return cav_dense_factor(width, width - 1, p->block, width);
}

/// Factors the costs' Hessian with all sides. What the last factor needed on its
/// diagonal the next one needs nearly, as weights grow.
static cav_status factor(cav_quadratic *p) {
  for (int r = 0; r < p->rows; r++) p->weight[r] = p->row[2 * r].w + p->row[2 * r + 1].w;
  for (int j = 0; j < p->n; j++) p->work[j] = p->box[2 * j].w + p->box[2 * j + 1].w;
  double shift = p->lifted / lift_step;
  if (shift < first_lift) shift = p->lifted > 0 && p->gives == 0 ? first_lift : 0;
  cav_status status = factor_sum(p, shift, 0);
  for (p->lifted = shift; status == CAV_NOT_CONVERGED && shift < 10; p->lifted = shift) {
    shift = shift > 0 ? lift_step * shift : first_lift;
    status = factor_sum(p, shift, 1);
  }
  // which rows and costs there are, and so what they join, stays as it is until another linearisation
  p->is_band = cav_normal_was_band(p->normal);
  p->bent += p->lifted > 10 * first_lift;
  return status;
}

/// What a side's complementarities, aimed at mu, push its row by, over its weight. second: with the products of the
/// predictor's step, which itself is aimed at 0.
static inline double push_of(const side *z, double mu, int second) {
  if (!second) return z->e - z->s + z->off;
  double product[2] = {z->ds * z->dy, z->de * z->dy};
  return z->e - z->s + z->off + (mu - product[0]) / z->y - (mu + product[1]) / z->z;
}

/// Newton's step of the rows' sides, once J dx is known.
static inline void step_side(side *z, double dd, double give, double mu, int second) {
  double product = second ? z->de * z->dy : 0;
  z->dy = z->w * (push_of(z, mu, second) - dd);
  z->de = (mu + product + z->e * z->dy) / z->z - z->e;
  z->ds = dd + z->de - z->off + give * z->dy;
}

/// Newton's step to where all complementarities are 0, or where second is 1, with the products of that step, mu; rhs
/// holds the dual residual.
static void step(cav_quadratic *p, double mu, int second) {
  for (int r = 0; r < p->rows; r++) {
    const side *z = &p->row[2 * r];
    p->ray[r] = -p->multiplier[r];
    if (z[0].y != 0) p->ray[r] += z[0].w * push_of(&z[0], mu, second);
    if (z[1].y != 0) p->ray[r] -= z[1].w * push_of(&z[1], mu, second);
  }
  for (int j = 0; j < p->n; j++) {
    const side *z = &p->box[2 * j];
    double pull = second ? (mu - z[0].ds * z[0].dy) / z[0].s - (mu - z[1].ds * z[1].dy) / z[1].s : 0;
    p->work[j] = pull - z[0].y + z[1].y + z[0].w * z[0].off - z[1].w * z[1].off - p->rhs[j];
  }
  add_rows(p, p->ray, p->work);
  cav_normal_solve(p->normal, p->work, p->dx);
  rows_times(p, p->dx, p->change);
  for (int r = 0; r < p->rows; r++) {
    side *z = &p->row[2 * r];
    if (z[0].y != 0) step_side(&z[0], p->change[r], p->give[r], mu, second);
    if (z[1].y != 0) step_side(&z[1], -p->change[r], p->give[r], mu, second);
  }
  for (int j = 0; j < 2 * p->n; j++) {
    side *z = &p->box[j];
    double ds = (j % 2 ? -p->dx[j / 2] : p->dx[j / 2]) - z->off;
    z->dy = (second ? (mu - z->ds * z->dy) / z->s : 0) - z->w * ds - z->y;
    z->ds = ds;
  }
}

static inline double shorten(double length, double value, double change) {
  return value + length * change < 0 ? -value / change : length;
}

/// Longest step that keeps every side inside, at most 1/boundary.
static double longest(const cav_quadratic *p) {
  double length = 1 / boundary;
  for (int r = 0; r < 2 * p->rows; r++) {
    const side *z = &p->row[r];
    if (z->y == 0) continue;
    length = shorten(length, z->s, z->ds);
    length = shorten(length, z->e, z->de);
    length = shorten(length, z->y, z->dy);
    length = shorten(length, z->z, -z->dy);
  }
  for (int j = 0; j < 2 * p->n; j++) {
    length = shorten(length, p->box[j].s, p->box[j].ds);
    length = shorten(length, p->box[j].y, p->box[j].dy);
  }
  return length;
}

/// Gap after a step of a length.
static double gap_after(const cav_quadratic *p, double length) {
  double gap = 0;
  for (int r = 0; r < 2 * p->rows; r++) {
    const side *z = &p->row[r];
    double y = z->y + length * z->dy;
    if (z->y != 0) gap += (z->s + length * z->ds) * y + (z->e + length * z->de) * (z->z - length * z->dy);
  }
  for (int j = 0; j < 2 * p->n; j++)
    gap += (p->box[j].s + length * p->box[j].ds) * (p->box[j].y + length * p->box[j].dy);
  return gap;
}

/// What rows give in this programme.
static void find_gives(cav_quadratic *p) {
  memset(p->give, 0, (size_t)p->rows * sizeof(double));
  const int width = 3 * p->tr->nv;
  for (int t = 0; p->gives > 0 && t < p->tr->nknot; t++)
    for (int i = 0; i < p->tr->knot[t].layout.count; i++) {
      const double *row = p->tr->knot[t].slot_row + (size_t)i * (size_t)width;
      p->give[p->first[t] + i] = dot(width, row, row) / (most_weight * p->gives);
    }
}

/// Iterations from the start with a gap; *left: what is left of the first dual residual. Ends early where steps come to
/// nothing, as they do from a start that lies too near to the bounds for the residual that it has.
static cav_status approach(cav_quadratic *p, double tolerance, double *left) {
  int held = 0;
  double past = INFINITY;
  *left = 1;
  p->lifted = p->bent = 0;
  advance(p, 0);
  for (int i = 0; i < ITERATIONS && held < 3; i++) {
    if ((p->gap <= tolerance && *left <= 1e-8) || p->bent > BENT) break;
    if (cav_transcription_stopped(p->tr)) return CAV_INTERRUPTED;
    cav_status status = factor(p);
    if (status != CAV_OK) return status;
    dual_residual(p);
    // predictor, then the corrector towards what it shows to be within reach
    step(p, 0, 0);
    double length = fmin(boundary * longest(p), 1), ratio = fmin(gap_after(p, length) / p->gap, 1);
    step(p, ratio * ratio * ratio * p->gap / p->sides, 1);
    length = fmin(boundary * longest(p), 1);
    advance(p, length);
    held = length < 1e-3 ? held + 1 : 0;
    *left *= 1 - length;
    // as from a model that is far from convex: no step then
    if (!isfinite(p->gap)) {
      memset(p->x, 0, (size_t)p->n * sizeof(double));
      p->gap = INFINITY;
      break;
    }
    // one that converges does so in some twenty iterations; where the model is not convex the gap stands still
    if (i % WINDOW < WINDOW - 1) continue;
    if (p->gap > 0.1 * past) break;
    past = p->gap;
  }
  return CAV_OK;
}

/// The factor for corrections, as stiff as where no row gives: what limits weights leaves rows off by a millionth.
static cav_status stiffen(cav_quadratic *p) {
  memset(p->give, 0, (size_t)p->rows * sizeof(double));
  advance(p, 0);
  return factor(p);
}

/// Solves it from the last solution, where again is 1 and that leads there, or from one start after another.
static cav_status solve_from(cav_quadratic *p, int again, double tolerance) {
  double scale = fmax(cav_transcription_cost(p->tr), tolerance), left = 1;
  cav_status status = CAV_NOT_CONVERGED;
  find_gives(p);
  for (int i = again ? -1 : 0; i < STARTS && status == CAV_NOT_CONVERGED; i++) {
    if (i < 0)
      start_again(p, fmax(resumed_gap * p->predicted, 1e2 * tolerance));
    else
      start(p, first_gap[i] * scale);
    status = approach(p, tolerance, &left);
    // a little more is what rounding leaves
    if (status == CAV_OK && (p->gap > 1e4 * tolerance || left > 1e-4)) status = CAV_NOT_CONVERGED;
    // another start helps where this one was held at its bounds, not where the gap stands still
    if (i >= 0 && (left <= 1e-4 || p->bent > BENT)) break;
  }
  // where the Hessian is not convex the conditions hold at what may be no minimum, or one above the start
  p->predicted = cav_quadratic_decrease(p);
  if (status == CAV_OK && (p->lifted > 1e-10 || p->predicted < -10 * fmax(p->gap, tolerance)))
    status = CAV_NOT_CONVERGED;
  return status == CAV_OK && p->gives > 0 ? stiffen(p) : status;
}

cav_status cav_quadratic_solve(cav_quadratic *p, const double *radius, const double change[2], double tolerance) {
  memset(p->gradient, 0, (size_t)p->n * sizeof(double));
  for (int t = 0; t < p->tr->nknot; t++) {
    const cav_knot *knot = &p->tr->knot[t];
    memcpy(p->local, knot->gradient, 3 * (size_t)p->tr->nv * sizeof(double));
    p->local[3 * p->tr->nv] = knot->step_derivative;
    give(p, t, p->local, p->gradient);
  }
  prepare(p);
  set_bounds(p, radius, change);
  return solve_from(p, 0, tolerance);
}

cav_status cav_quadratic_solve_again(cav_quadratic *p, double tolerance) { return solve_from(p, 1, tolerance); }

double cav_quadratic_unfinished(cav_quadratic *p) {
  double decrease = cav_quadratic_decrease(p);
  cav_normal_multiply_kept(p->normal, p->costs, p->x, p->rhs);
  dual_residual(p);
  add_rows(p, p->multiplier, p->rhs);
  return decrease > 0 ? -dot(p->n, p->rhs, p->x) / decrease : 0;
}

/// push [nv] := what the costs of efforts at a knot press with against forces that are off [nv].
static void push_of_efforts(const cav_transcription *tr, int t, const double *off, double *push) {
  memset(push, 0, (size_t)tr->nv * sizeof(double));
  for (int i = 0; i < tr->problem->nterm; i++) {
    const cav_term *term = &tr->problem->term[i];
    if (term->use != CAV_USE_COST || term->quantity != CAV_QUANTITY_EFFORT) continue;
    double weight = cav_term_weight(tr, term, t) * term->weight / (term->scale * term->scale);
    for (int k = 0; weight > 0 && k < tr->model->nu; k++) {
      const cav_force_row *form = &tr->effort[k];
      double effort = 0;
      for (int c = 0; c < form->n; c++) effort += form->coef[c] * off[form->dof[c]];
      for (int c = 0; c < form->n; c++) push[form->dof[c]] += weight * effort * form->coef[c];
    }
  }
}

/// out -= what costs of efforts give the unknowns where forces are off. [unknowns]
static void subtract_efforts(cav_quadratic *p, const double *force, double *out) {
  int nv = p->tr->nv, width = 3 * nv;
  for (int t = 0; t < p->tr->nknot; t++, force += nv) {
    const cav_knot *knot = &p->tr->knot[t];
    if (!knot->has_force) continue;
    push_of_efforts(p->tr, t, force, p->image);
    memset(p->local, 0, (size_t)(width + 1) * sizeof(double));
    for (int d = 0; d < nv; d++) {
      const double *du = knot->du + (size_t)d * (size_t)width;
      for (int k = 0; p->image[d] != 0 && k < width; k++) p->local[k] -= p->image[d] * du[k];
    }
    if (p->tr->periodicity && (t < 2 || t == p->tr->nknot - 1))
      cav_transcription_wrap(p->tr, p->tr->scratch, t, 1, p->local);
    give(p, t, p->local, out);
  }
}

void cav_quadratic_correct(cav_quadratic *p, const double *offset, const double *force, double *x) {
  for (int r = 0; r < p->rows; r++) p->ray[r] = -p->weight[r] * offset[r];
  memset(p->work, 0, (size_t)p->n * sizeof(double));
  add_rows(p, p->ray, p->work);
  if (force) subtract_efforts(p, force, p->work);
  cav_normal_solve(p->normal, p->work, x);
}
