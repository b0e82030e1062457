/// Interior point for the quadratic programme of one linearisation. Rows have exact penalties (elastic rows: Fletcher's
/// S-l1-QP), so every programme has a solution, and a box holds the step.
///
/// A side of a row with signed slack d (value minus lower, or upper minus value) has s - e = d, s >= 0, e >= 0 at the
/// penalty e times its penalty p; its multiplier y is in [0, p], and on the central path s y = e (p - y) = mu. Newton's
/// step with both eliminated adds to the Hessian w J'J with 1/w = s/y + e/(p - y), so one banded factor of the own
/// solver serves, whatever rows are active. Predictor and corrector as in Mehrotra (1992); the start is the point of
/// the central path at x = 0.
#include "quadratic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"

/// Iterations at most; part of the way to the boundary that a step goes; fraction of the cost that the gap
/// starts with, and with what it starts again.
enum { ITERATIONS = 60, WINDOW = 10 };
static const double boundary = 0.995, first_gap[] = {0.1, 1e3, 1e6};
enum { STARTS = sizeof first_gap / sizeof *first_gap };

/// Entries up to which a row is added by itself.
enum { SPARSE = 12 };

/// One side of a row, or of the box.
typedef struct side {
  int on;
  double s, e, y, z; ///< z: penalty less y. The box has neither e nor z: its sides are hard
  double ds, de, dy; ///< step
  double a, b;       ///< right-hand sides of the two complementarities
} side;

struct cav_quadratic {
  const cav_transcription *tr;
  cav_normal *normal;
  int n, rows, sides, *first;             ///< unknowns; rows; sides that are on; [nknot] first row of a knot
  side *row;                              ///< [2*rows] lower, upper
  side *box;                              ///< [2*n]
  double *penalty, *value, *multiplier;   ///< [rows]
  double *change, *weight, *ray;          ///< [rows] J dx; w of both sides; right-hand side
  double *x, *dx, *rhs, *gradient, *work; ///< [n]
  double *local, *image, *block, *dense;  ///< [3nv+1] of one knot, [9nv^2], [most rows * 3nv]
  double lifted;                          ///< fraction of its diagonal that the last factor needed besides
  double gap;                             ///< complementarities of the last solution
  double *bound;                          ///< [2*n] of the box
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
  size_t rows = (size_t)p->rows, n = (size_t)p->n, local = 3 * nv + 1;
  p->row = calloc(2 * rows + 1, sizeof *p->row);
  p->box = calloc(2 * n, sizeof *p->box);
  p->penalty = calloc(6 * rows + 7 * n + 2 * local + 9 * nv * nv + most * 3 * nv, sizeof(double));
  if (!p->first || !p->row || !p->box || !p->penalty) {
    cav_quadratic_free(p);
    return NULL;
  }
  double *next = p->penalty + rows;
  double **const of_rows[] = {&p->value, &p->multiplier, &p->change, &p->weight, &p->ray};
  double **const of_unknowns[] = {&p->x, &p->dx, &p->rhs, &p->gradient, &p->work};
  for (int i = 0; i < 5; i++) *of_rows[i] = next, next += rows;
  for (int i = 0; i < 5; i++) *of_unknowns[i] = next, next += n;
  p->bound = next, next += 2 * n;
  p->local = next, next += local;
  p->image = next, next += local;
  p->block = next, next += 9 * nv * nv;
  p->dense = next;
  return p;
}

void cav_quadratic_free(cav_quadratic *p) {
  if (!p) return;
  free(p->first), free(p->row), free(p->box), free(p->penalty);
  free(p);
}

const double *cav_quadratic_step(const cav_quadratic *p) { return p->x; }
const double *cav_quadratic_multiplier(const cav_quadratic *p) { return p->multiplier; }
double *cav_quadratic_penalty(cav_quadratic *p) { return p->penalty; }
double *cav_quadratic_value(cav_quadratic *p) { return p->value; }
int cav_quadratic_rows(const cav_quadratic *p) { return p->rows; }
double cav_quadratic_gap(const cav_quadratic *p) { return p->gap; }

double cav_quadratic_length(const cav_quadratic *p) {
  double most = 0;
  for (int i = 0; i < p->n; i++) most = fmax(most, fabs(p->x[i]));
  return most;
}

// ---------------------------------------------------------------- products

/// By eight sums side by side: one after another they would wait for each other.
static double dot(int n, const double *a, const double *b) {
  double part[8] = {0}, sum = 0;
  int i = 0;
  for (; i + 8 <= n; i += 8)
    for (int k = 0; k < 8; k++) part[k] += a[i + k] * b[i + k];
  for (; i < n; i++) sum += a[i] * b[i];
  return sum + (((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7])));
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

/// product := J x. [rows]
static void rows_times(const cav_quadratic *p, const double *x, double *product) {
  int width = 3 * p->tr->nv;
  for (int t = 0; t < p->tr->nknot; t++) {
    const cav_knot *knot = &p->tr->knot[t];
    take(p, t, x, p->local);
    for (int i = 0; i < knot->layout.count; i++) {
      const double *row = knot->slot_row + (size_t)i * (size_t)width;
      double step = p->tr->free_step ? knot->slot_step[i] * p->local[width] : 0;
      product[p->first[t] + i] = step + dot(width, row, p->local);
    }
  }
}

/// out += J' y. [unknowns]
static void add_rows(const cav_quadratic *p, const double *y, double *out) {
  int width = 3 * p->tr->nv;
  for (int t = 0; t < p->tr->nknot; t++) {
    const cav_knot *knot = &p->tr->knot[t];
    memset(p->local, 0, (size_t)(width + 1) * sizeof(double));
    for (int i = 0; i < knot->layout.count; i++) {
      const double *row = knot->slot_row + (size_t)i * (size_t)width;
      double yi = y[p->first[t] + i], *local = p->local;
      if (yi == 0) continue;
      for (int k = 0; k < width; k++) local[k] += yi * row[k];
      if (p->tr->free_step) local[width] += yi * knot->slot_step[i];
    }
    give(p, t, p->local, out);
  }
}

/// image := H x of a knot's costs alone; local [3nv+1] holds x.
static void knot_times(const cav_quadratic *p, int t) {
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

/// product := H x, of the costs alone.
static void costs_times(const cav_quadratic *p, const double *x, double *product) {
  memset(product, 0, (size_t)p->n * sizeof(double));
  for (int t = 0; t < p->tr->nknot; t++) {
    take(p, t, x, p->local);
    knot_times(p, t);
    give(p, t, p->image, product);
  }
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
  return (side){.on = 1, .s = s, .e = e, .y = mu / s, .z = mu / e};
}

static void start(cav_quadratic *p, const double *radius, const double change[2], double gap) {
  p->sides = 0;
  for (int j = 0; j < p->n; j++) {
    int step = p->tr->free_step && j == p->n - 1;
    double r = radius[j / p->tr->nv];
    p->bound[2 * j] = step ? fmax(-r, change[0]) : -r;
    p->bound[2 * j + 1] = step ? fmin(r, change[1]) : r;
    double width = p->bound[2 * j + 1] - p->bound[2 * j];
    p->x[j] = fmin(fmax(0, p->bound[2 * j] + 0.05 * width), p->bound[2 * j + 1] - 0.05 * width);
    p->sides += 2;
  }
  for (int t = 0; t < p->tr->nknot; t++)
    for (int i = 0; i < p->tr->knot[t].layout.count; i++)
      for (int k = 0; k < 2; k++)
        p->sides += 2 * (isfinite(k ? p->tr->knot[t].slot[i].upper : p->tr->knot[t].slot[i].lower) != 0);
  double mu = gap / p->sides;
  rows_times(p, p->x, p->change);
  for (int j = 0; j < p->n; j++) {
    double below = p->x[j] - p->bound[2 * j], above = p->bound[2 * j + 1] - p->x[j];
    p->box[2 * j] = (side){.on = 1, .s = below, .y = mu / below};
    p->box[2 * j + 1] = (side){.on = 1, .s = above, .y = mu / above};
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

// ---------------------------------------------------------------- one iteration

static double weight_of(const side *z) { return 1 / (z->s / z->y + z->e / z->z); }

/// Sum of the complementarities.
static double gap_of(const cav_quadratic *p) {
  double gap = 0;
  for (int r = 0; r < 2 * p->rows; r++) {
    const side *z = &p->row[r];
    if (z->on) gap += z->s * z->y + z->e * z->z;
  }
  for (int j = 0; j < 2 * p->n; j++) gap += p->box[j].s * p->box[j].y;
  return gap;
}

/// Lagrangian's gradient at x and the multipliers, into rhs.
static void dual_residual(cav_quadratic *p) {
  costs_times(p, p->x, p->rhs);
  for (int r = 0; r < p->rows; r++) p->multiplier[r] = p->row[2 * r + 1].y - p->row[2 * r].y;
  add_rows(p, p->multiplier, p->rhs);
  for (int j = 0; j < p->n; j++) p->rhs[j] += p->gradient[j] + p->box[2 * j + 1].y - p->box[2 * j].y;
}

/// Adds the weighted rows of a knot to its block, and to what the step's logarithm meets.
static void weigh_rows(cav_quadratic *p, int t, double *step_row, double *step_square) {
  const cav_knot *knot = &p->tr->knot[t];
  int width = 3 * p->tr->nv, ndense = 0, column[SPARSE];
  for (int i = 0; i < knot->layout.count; i++) {
    const double *row = knot->slot_row + (size_t)i * (size_t)width;
    double w = p->weight[p->first[t] + i], root = sqrt(w);
    int n = 0;
    for (int k = 0; k < width && n <= SPARSE; k++) {
      if (row[k] == 0) continue;
      if (n < SPARSE) column[n] = k;
      n++;
    }
    if (n <= SPARSE) {
      for (int a = 0; a < n; a++)
        for (int b = 0; b <= a; b++) p->block[column[a] * width + column[b]] += w * row[column[a]] * row[column[b]];
    } else {
      double *out = p->dense + (size_t)ndense++ * (size_t)width;
      for (int k = 0; k < width; k++) out[k] = root * row[k];
    }
    if (!p->tr->free_step) continue;
    for (int k = 0; k < width; k++) step_row[k] += w * knot->slot_step[i] * row[k];
    *step_square += w * knot->slot_step[i] * knot->slot_step[i];
  }
  cav_dense_square(width, ndense, p->dense, width, p->block, width);
}

/// Copies the lower triangle of a knot's Hessian to the block.
static void take_hessian(cav_quadratic *p, const cav_knot *knot) {
  size_t width = 3 * (size_t)p->tr->nv;
  for (size_t i = 0; i < width; i++) memcpy(p->block + i * width, knot->hessian + i * width, (i + 1) * sizeof(double));
}

/// Gathers the costs' Hessian with weighted rows.
static void gather(cav_quadratic *p) {
  const cav_transcription *tr = p->tr;
  int width = 3 * tr->nv;
  cav_normal_clear(p->normal);
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    double square = knot->step_square;
    take_hessian(p, knot);
    memcpy(p->local, knot->step_row, (size_t)width * sizeof(double));
    weigh_rows(p, t, p->local, &square);
    cav_normal_add_block(p->normal, tr, t, p->block, p->local, square);
  }
}

int cav_quadratic_convex(cav_quadratic *p) {
  memset(p->work, 0, (size_t)p->n * sizeof(double));
  gather(p);
  cav_normal_add_diagonal(p->normal, p->work);
  return cav_normal_factor(p->normal, 1e-10) == CAV_OK;
}

int cav_quadratic_knot_convex(cav_quadratic *p, int t, double shift) {
  int width = 3 * p->tr->nv;
  double square = 0;
  take_hessian(p, &p->tr->knot[t]);
  weigh_rows(p, t, p->local, &square);
  for (int i = 0; i < width; i++) {
    double *d = &p->block[i * width + i];
    // columns of knots that are no unknowns are empty
    *d = *d == 0 ? 1 : *d + 1e-10 * fabs(*d) + shift;
    for (int j = 0; j < i; j++) p->block[j * width + i] = p->block[i * width + j];
  }
  return cav_dense_factor(width, width - 1, p->block, width);
}

/// Factors the costs' Hessian with all sides.
static cav_status factor(cav_quadratic *p) {
  for (int r = 0; r < p->rows; r++) {
    p->weight[r] = 0;
    for (int k = 0; k < 2; k++)
      if (p->row[2 * r + k].on) p->weight[r] += weight_of(&p->row[2 * r + k]);
  }
  gather(p);
  for (int j = 0; j < p->n; j++)
    p->work[j] = p->box[2 * j].y / p->box[2 * j].s + p->box[2 * j + 1].y / p->box[2 * j + 1].s;
  cav_normal_add_diagonal(p->normal, p->work);
  cav_status status = cav_normal_factor(p->normal, 0);
  p->lifted = 0;
  for (double shift = 1e-14; status == CAV_NOT_CONVERGED && shift < 10; shift *= 100) {
    status = cav_normal_factor(p->normal, shift);
    p->lifted = shift;
  }
  return status;
}

/// Newton's step for the sides' right-hand sides a and b; rhs holds the dual residual.
static void step(cav_quadratic *p) {
  for (int r = 0; r < p->rows; r++) {
    p->ray[r] = 0;
    for (int k = 0; k < 2; k++) {
      const side *z = &p->row[2 * r + k];
      if (!z->on) continue;
      double push = weight_of(z) * (z->a / z->y - z->b / z->z);
      p->ray[r] += k ? -push : push;
    }
  }
  for (int j = 0; j < p->n; j++)
    p->work[j] = -p->rhs[j] + p->box[2 * j].a / p->box[2 * j].s - p->box[2 * j + 1].a / p->box[2 * j + 1].s;
  add_rows(p, p->ray, p->work);
  cav_normal_solve(p->normal, p->work, p->dx);
  rows_times(p, p->dx, p->change);
  for (int r = 0; r < p->rows; r++) {
    for (int k = 0; k < 2; k++) {
      side *z = &p->row[2 * r + k];
      if (!z->on) continue;
      double dd = k ? -p->change[r] : p->change[r];
      z->dy = weight_of(z) * (z->a / z->y - z->b / z->z - dd);
      z->de = (z->b + z->e * z->dy) / z->z;
      z->ds = dd + z->de;
    }
  }
  for (int j = 0; j < 2 * p->n; j++) {
    side *z = &p->box[j];
    z->ds = j % 2 ? -p->dx[j / 2] : p->dx[j / 2];
    z->dy = (z->a - z->y * z->ds) / z->s;
  }
}

static double shorten(double length, double value, double change) {
  return change < 0 ? fmin(length, -value / change) : length;
}

/// Longest step that keeps every side inside, at most 1/boundary.
static double longest(const cav_quadratic *p) {
  double length = 1 / boundary;
  for (int r = 0; r < 2 * p->rows; r++) {
    const side *z = &p->row[r];
    if (!z->on) continue;
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

/// Right-hand sides of the complementarities for a target mu, with the products of the predictor's step where second is
/// 1.
static void aim(cav_quadratic *p, double mu, int second) {
  for (int r = 0; r < 2 * p->rows; r++) {
    side *z = &p->row[r];
    z->a = mu - z->s * z->y - second * z->ds * z->dy;
    z->b = mu - z->e * z->z + second * z->de * z->dy;
  }
  for (int j = 0; j < 2 * p->n; j++) {
    side *z = &p->box[j];
    z->a = mu - z->s * z->y - second * z->ds * z->dy;
  }
}

/// Gap after a step of a length.
static double gap_after(const cav_quadratic *p, double length) {
  double gap = 0;
  for (int r = 0; r < 2 * p->rows; r++) {
    const side *z = &p->row[r];
    double y = z->y + length * z->dy;
    if (z->on) gap += (z->s + length * z->ds) * y + (z->e + length * z->de) * (z->z - length * z->dy);
  }
  for (int j = 0; j < 2 * p->n; j++)
    gap += (p->box[j].s + length * p->box[j].ds) * (p->box[j].y + length * p->box[j].dy);
  return gap;
}

static void advance(cav_quadratic *p, double length) {
  for (int j = 0; j < p->n; j++) p->x[j] += length * p->dx[j];
  for (int r = 0; r < 2 * p->rows; r++) {
    side *z = &p->row[r];
    z->s += length * z->ds, z->e += length * z->de, z->y += length * z->dy, z->z -= length * z->dy;
  }
  for (int j = 0; j < 2 * p->n; j++) p->box[j].s += length * p->box[j].ds, p->box[j].y += length * p->box[j].dy;
}

/// Iterations from the start with a gap; *left: what is left of the first dual residual. Ends early where steps come to
/// nothing, as they do from a start that lies too near to the bounds for the residual that it has.
static cav_status approach(cav_quadratic *p, double tolerance, double *left) {
  int held = 0;
  double past = INFINITY;
  *left = 1;
  p->gap = gap_of(p);
  for (int i = 0; i < ITERATIONS && held < 3; i++) {
    if (p->gap <= tolerance && *left <= 1e-8) break;
    if (cav_transcription_stopped(p->tr)) return CAV_INTERRUPTED;
    cav_status status = factor(p);
    if (status != CAV_OK) return status;
    // predictor, then the corrector towards what it shows to be within reach
    dual_residual(p);
    aim(p, 0, 0);
    step(p);
    double length = fmin(boundary * longest(p), 1), ratio = gap_after(p, length) / p->gap;
    aim(p, ratio * ratio * ratio * p->gap / p->sides, 1);
    step(p);
    length = fmin(boundary * longest(p), 1);
    advance(p, length);
    held = length < 1e-3 ? held + 1 : 0;
    *left *= 1 - length;
    p->gap = gap_of(p);
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

cav_status cav_quadratic_solve(cav_quadratic *p, const double *radius, const double change[2], double tolerance) {
  double scale = 0, left = 1;
  for (int t = 0; t < p->tr->nknot; t++) scale += p->tr->knot[t].cost;
  memset(p->gradient, 0, (size_t)p->n * sizeof(double));
  for (int t = 0; t < p->tr->nknot; t++) {
    const cav_knot *knot = &p->tr->knot[t];
    memcpy(p->local, knot->gradient, 3 * (size_t)p->tr->nv * sizeof(double));
    p->local[3 * p->tr->nv] = knot->step_derivative;
    give(p, t, p->local, p->gradient);
  }
  cav_status status = CAV_NOT_CONVERGED;
  for (int i = 0; i < STARTS && status == CAV_NOT_CONVERGED; i++) {
    start(p, radius, change, first_gap[i] * fmax(scale, tolerance));
    status = approach(p, tolerance, &left);
    // a little more is what rounding leaves
    if (status == CAV_OK && (p->gap > 1e4 * tolerance || left > 1e-4)) status = CAV_NOT_CONVERGED;
    // another start helps where this one was held at its bounds, not where the gap stands still
    if (left <= 1e-4) break;
  }
  // where the Hessian is not convex the conditions hold at what may be no minimum, or one above the start
  if (status == CAV_OK && (p->lifted > 1e-10 || cav_quadratic_decrease(p) < -10 * fmax(p->gap, tolerance)))
    status = CAV_NOT_CONVERGED;
  for (int r = 0; r < p->rows; r++) p->multiplier[r] = p->row[2 * r + 1].y - p->row[2 * r].y;
  return status;
}

double cav_quadratic_unfinished(cav_quadratic *p) {
  double decrease = cav_quadratic_decrease(p);
  dual_residual(p);
  return decrease > 0 ? -dot(p->n, p->rhs, p->x) / decrease : 0;
}

void cav_quadratic_correct(cav_quadratic *p, const double *offset, double *x) {
  for (int r = 0; r < p->rows; r++) p->ray[r] = -p->weight[r] * offset[r];
  memset(p->work, 0, (size_t)p->n * sizeof(double));
  add_rows(p, p->ray, p->work);
  cav_normal_solve(p->normal, p->work, x);
}
