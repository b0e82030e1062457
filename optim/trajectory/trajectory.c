/// Motions as knots: making, copying, differencing, resampling, and trajectory.csv.
///
/// Velocities are backward differences on the manifold, v_t = (q_t (-) q_{t-1})/h. Resampling follows the geodesic
/// between two knots at constant velocity; forces are held from the knot before, as a forward step applies them.
/// Columns of the file: time, qpos_<joint>, qvel_<joint>, u_<joint>, with _0, _1, ... where a joint has several values,
/// and #3 for the joint 3 that has no name. Does not compute forces: what u means is the transcription's or the
/// reader's business.
#include "cavort/trajectory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "file.h"
#include "xml.h"

static const double uneven_step = 1e-3;      // of a step: by how much one may differ and be as the others
static const double uneven_most = 1e-6;      // of a step: how far a row's time may be from its knot's
static const double quaternion_most = 1e-3;  // how far from unit length a quaternion may be before it is an error
static const double quaternion_unit = 1e-12; // how near to unit length it stays as it was written

cav_trajectory *cav_trajectory_new(const cav_model *model, int nknot, double timestep) {
  if (nknot < 2) return NULL;
  // one block: the head, then q, v, u
  size_t n = (size_t)nknot, nq = n * (size_t)model->nq, nv = n * (size_t)model->nv;
  cav_trajectory *trajectory = calloc(1, sizeof *trajectory + (nq + 2 * nv) * sizeof(double));
  if (!trajectory) return NULL;
  trajectory->nq = model->nq;
  trajectory->nv = model->nv;
  trajectory->nknot = nknot;
  trajectory->timestep = timestep;
  trajectory->q = (double *)(trajectory + 1);
  trajectory->v = trajectory->q + nq;
  trajectory->u = trajectory->v + nv;
  for (int t = 0; t < nknot; t++)
    memcpy(trajectory->q + (size_t)t * (size_t)model->nq, model->q0, (size_t)model->nq * sizeof(double));
  return trajectory;
}

cav_trajectory *cav_trajectory_copy(const cav_trajectory *trajectory) {
  size_t n = (size_t)trajectory->nknot, nq = n * (size_t)trajectory->nq, nv = n * (size_t)trajectory->nv;
  cav_trajectory *copy = malloc(sizeof *copy + (nq + 2 * nv) * sizeof(double));
  if (!copy) return NULL;
  *copy = *trajectory;
  copy->q = (double *)(copy + 1);
  copy->v = copy->q + nq;
  copy->u = copy->v + nv;
  memcpy(copy->q, trajectory->q, nq * sizeof(double));
  memcpy(copy->v, trajectory->v, nv * sizeof(double));
  memcpy(copy->u, trajectory->u, nv * sizeof(double));
  return copy;
}

void cav_trajectory_free(cav_trajectory *trajectory) { free(trajectory); }

void cav_trajectory_velocities(const cav_model *model, cav_trajectory *trajectory) {
  for (int t = 1; t < trajectory->nknot; t++) {
    const double *q = trajectory->q + (size_t)t * (size_t)trajectory->nq;
    cav_difference(model, q - trajectory->nq, q, trajectory->timestep,
                   trajectory->v + (size_t)t * (size_t)trajectory->nv);
  }
}

// x := way from a knot to a fraction of the step after it, over the step: cubic from 0 to v_{t+1} with the derivatives
// of the knots
static void along(const cav_trajectory *trajectory, int t, double fraction, double *x) {
  int nv = trajectory->nv;
  const double *v = trajectory->v + ((size_t)t + 1) * (size_t)nv;
  double s = fraction, left = s * (1 - s) * (1 - s), right = s * s * (s - 1), whole = s * s * (3 - 2 * s);
  for (int d = 0; d < nv; d++) {
    double from = 0.5 * (v[d - nv] + v[d]), to = t + 2 < trajectory->nknot ? 0.5 * (v[d] + v[d + nv]) : 2 * v[d] - from;
    x[d] = left * from + whole * v[d] + right * to;
  }
}

cav_trajectory *cav_trajectory_resample(const cav_model *model, const cav_trajectory *trajectory, double timestep) {
  double h = trajectory->timestep, duration = h * (trajectory->nknot - 1);
  double steps = timestep > 0 ? round(duration / timestep) : 0;
  if (!(steps >= 1 && steps < 1e8)) return NULL;
  cav_trajectory *finer = cav_trajectory_new(model, (int)steps + 1, timestep);
  double *x = malloc((size_t)model->nv * sizeof *x);
  if (!finer || !x) {
    cav_trajectory_free(finer);
    free(x);
    return NULL;
  }
  for (int t = 0; t < finer->nknot; t++) {
    // the knot before, and the part of the step past it; the last knot ends the last step
    double at = fmin(t * timestep / h, trajectory->nknot - 1);
    int knot = (int)fmin(floor(at + uneven_most), trajectory->nknot - 2);
    size_t from = (size_t)knot, to = (size_t)t;
    along(trajectory, knot, at - knot, x);
    cav_integrate(model, trajectory->q + from * (size_t)trajectory->nq, x, h, finer->q + to * (size_t)finer->nq);
    const double *u = trajectory->u + from * (size_t)trajectory->nv;
    double *u_to = finer->u + to * (size_t)finer->nv;
    for (int d = 0; d < model->nv; d++) { u_to[d] = (1 - (at - knot)) * u[d] + (at - knot) * u[model->nv + d]; }
  }
  memcpy(finer->v, trajectory->v, (size_t)finer->nv * sizeof(double));
  cav_trajectory_velocities(model, finer);
  free(x);
  return finer;
}

// names of all columns, one after the other: time, q, v, u
typedef struct columns {
  int n;
  char **name;
} columns;

static void free_columns(columns *c) {
  for (int i = 0; i < c->n && c->name; i++) free(c->name[i]);
  free(c->name);
  *c = (columns){0};
}

// prefix_joint or prefix_joint_i; 0 if memory runs out
static int add_columns(columns *c, const char *prefix, const cav_model *model, int j, int count) {
  const cav_joint *joint = &model->joint[j];
  size_t room = strlen(joint->name) + strlen(prefix) + 32;
  for (int i = 0; i < count; i++) {
    char *name = malloc(room);
    if (!name) return 0;
    int length =
        joint->name[0] ? snprintf(name, room, "%s_%s", prefix, joint->name) : snprintf(name, room, "%s_#%d", prefix, j);
    if (count > 1) snprintf(name + length, room - (size_t)length, "_%d", i);
    c->name[c->n++] = name;
  }
  return 1;
}

static int make_columns(columns *c, const cav_model *model) {
  static const int nq[] = {[CAV_JOINT_FREE] = 7, [CAV_JOINT_BALL] = 4, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  static const int nv[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  *c = (columns){0, calloc((size_t)(1 + model->nq + 2 * model->nv), sizeof *c->name)};
  int good = c->name && (c->name[0] = strdup("time")) != NULL;
  c->n = good;
  for (int j = 0; j < model->njoint && good; j++) good = add_columns(c, "qpos", model, j, nq[model->joint[j].type]);
  for (int j = 0; j < model->njoint && good; j++) good = add_columns(c, "qvel", model, j, nv[model->joint[j].type]);
  for (int j = 0; j < model->njoint && good; j++) good = add_columns(c, "u", model, j, nv[model->joint[j].type]);
  if (!good) free_columns(c);
  return good;
}

static void write_values(FILE *stream, const double *value, int n) {
  for (int i = 0; i < n; i++) {
    fputc(',', stream);
    cav_table_write_number(stream, value[i]);
  }
}

static int all_finite(const double *value, size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (!isfinite(value[i])) return 0;
  }
  return 1;
}

// whether no force is told: all NaN
static int none(const double *value, size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (!isnan(value[i])) return 0;
  }
  return 1;
}

cav_status cav_trajectory_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                                cav_error *error) {
  size_t n = (size_t)trajectory->nknot;
  if (trajectory->nq != model->nq || trajectory->nv != model->nv) {
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "%s: the trajectory has %d positions and %d velocities, the model %d and %d", path,
                         trajectory->nq, trajectory->nv, model->nq, model->nv);
  }
  const size_t nv = (size_t)model->nv, last = n > 0 ? (n - 1) * nv : 0;
  if (!all_finite(trajectory->q, n * (size_t)model->nq) || !all_finite(trajectory->v, n * nv) ||
      !all_finite(trajectory->u, last) || (!none(trajectory->u + last, nv) && !all_finite(trajectory->u + last, nv))) {
    return cav_file_fail(error, CAV_NOT_FINITE, 0, "%s: not written: the trajectory holds a number that is not finite",
                         path);
  }
  columns c;
  cav_file file;
  if (!make_columns(&c, model)) return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory to write the file", path);
  cav_status status = cav_file_begin(&file, path, error);
  if (!status) {
    for (int i = 0; i < c.n; i++) {
      if (i) fputc(',', file.stream);
      cav_table_write_text(file.stream, c.name[i]);
    }
    fputc('\n', file.stream);
    for (int t = 0; t < trajectory->nknot; t++) {
      cav_table_write_number(file.stream, t * trajectory->timestep);
      write_values(file.stream, trajectory->q + (size_t)t * (size_t)model->nq, model->nq);
      write_values(file.stream, trajectory->v + (size_t)t * (size_t)model->nv, model->nv);
      write_values(file.stream, trajectory->u + (size_t)t * (size_t)model->nv, model->nv);
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free_columns(&c);
  return status;
}

// place of a table's column among the expected ones: first where it should stand, then anywhere; -1 if nowhere
static int place_of(const columns *c, const char *name, int at) {
  if (at < c->n && !strcmp(c->name[at], name)) return at;
  for (int i = 0; i < c->n; i++) {
    if (!strcmp(c->name[i], name)) return i;
  }
  return -1;
}

// column of the table for each expected one, -1 where it is missing; q must be there, v and u as a whole or not at all
static cav_status match(const cav_table *table, const columns *c, const cav_model *model, int *source,
                        cav_error *error) {
  for (int i = 0; i < c->n; i++) source[i] = -1;
  for (int i = 0; i < table->ncol; i++) {
    int place = place_of(c, table->name[i], i);
    if (place < 0) {
      // a table of joints, as records have them: what their positions are called here
      char joint[200];
      snprintf(joint, sizeof joint, "qpos_%.190s", table->name[i]);
      int at = place_of(c, joint, 0);
      const char *near = at >= 0 ? c->name[at] : cav_xml_nearest(table->name[i], c->name, c->n, sizeof *c->name);
      return cav_file_fail(error, CAV_BAD_INPUT, 1, "%s:1: column '%.80s': the model has no such value%s%.80s%s",
                           table->path, table->name[i], near ? "; did you mean '" : "", near ? near : "",
                           near ? "'?" : "");
    }
    if (source[place] >= 0) {
      return cav_file_fail(error, CAV_BAD_INPUT, 1, "%s:1: column '%.80s' stands there twice", table->path,
                           table->name[i]);
    }
    source[place] = i;
  }
  int v = 1 + model->nq, u = v + model->nv;
  for (int i = 0; i < c->n; i++) {
    int first = i < v ? 0 : i < u ? v : u, end = i < v ? v : i < u ? u : c->n, wanted = i < v;
    for (int k = first; k < end && !wanted; k++) wanted = source[k] >= 0;
    if (wanted && source[i] < 0) {
      return cav_file_fail(error, CAV_BAD_INPUT, 1, "%s:1: column '%.80s' is missing", table->path, c->name[i]);
    }
  }
  return CAV_OK;
}

static double time_of(const cav_table *table, int column, int row) {
  return table->value[(size_t)row * (size_t)table->ncol + (size_t)column];
}

// the first row that does not come after the one before as most rows do, by the first step or else the last; 0: most rows
// keep to neither. *usual: their step
static int jump_of(const cav_table *table, int column, double *usual) {
  int n = table->nrow;
  for (int last = 0; last < 2; last++) {
    int from = last ? n - 2 : 0, odd = 0, first = 0;
    *usual = time_of(table, column, from + 1) - time_of(table, column, from);
    for (int i = 1; i < n; i++) {
      double step = time_of(table, column, i) - time_of(table, column, i - 1);
      if (fabs(step - *usual) <= uneven_step * *usual) continue;
      if (!odd++) first = i;
    }
    if (*usual > 0 && 2 * odd < n - 1) return first;
  }
  return 0;
}

static void tell_uneven(const cav_table *table, int column, int row, double off, cav_error *error) {
  double usual;
  int jump = jump_of(table, column, &usual);
  if (!jump) {
    cav_file_fail(error, CAV_BAD_INPUT, table->line[row],
                  "%s:%d: column 'time': expected rows at equal, increasing times; row %d is %g s off", table->path,
                  table->line[row], row + 1, off);
    return;
  }
  double step = time_of(table, column, jump) - time_of(table, column, jump - 1);
  cav_file_fail(
      error, CAV_BAD_INPUT, table->line[jump],
      "%s:%d: column 'time': expected rows at equal, increasing times; row %d comes %g s after the one before, "
      "other rows %g s: rows are missing, or too many",
      table->path, table->line[jump], jump + 1, step, usual);
}

// the step, and that all rows keep to it; 0 on failure
static double step_of(const cav_table *table, int column, cav_error *error) {
  if (table->nrow < 2) {
    cav_file_fail(error, CAV_BAD_INPUT, 1, "%s:1: expected at least two rows, got %d", table->path, table->nrow);
    return 0;
  }
  const double *time = table->value + column;
  double first = time[0], last = time[(size_t)(table->nrow - 1) * (size_t)table->ncol];
  double mean = (last - first) / (table->nrow - 1), exact = time[table->ncol] - first;
  double h = fabs(exact - mean) <= 1e-12 * fabs(mean) ? exact : mean;
  for (int i = 0; i < table->nrow; i++) {
    double off = time[(size_t)i * (size_t)table->ncol] - first - i * h;
    if (!(h > 0) || !(fabs(off) <= uneven_most * h)) {
      tell_uneven(table, column, i, off, error);
      return 0;
    }
  }
  return h;
}

// brings quaternions that were written with few digits to unit length
static cav_status check_quaternions(const cav_model *model, double *q, const cav_table *table, int row,
                                    cav_error *error) {
  int off = 0;
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = &model->joint[j];
    if (joint->type != CAV_JOINT_FREE && joint->type != CAV_JOINT_BALL) continue;
    const double *w = q + joint->q + (joint->type == CAV_JOINT_FREE ? 3 : 0);
    double length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]);
    if (!(fabs(length - 1) <= quaternion_most)) {
      return cav_file_fail(error, CAV_BAD_INPUT, table->line[row],
                           "%s:%d: joint '%.80s': expected a quaternion of length 1, got %g", table->path,
                           table->line[row], joint->name, length);
    }
    off |= fabs(length - 1) > quaternion_unit;
  }
  if (off) cav_configuration_normalise(model, q);
  return CAV_OK;
}

static void row_values(const cav_table *table, const int *source, int row, int n, double *out) {
  for (int i = 0; i < n && source[0] >= 0; i++)
    out[i] = table->value[(size_t)row * (size_t)table->ncol + (size_t)source[i]];
}

// only of the last row may u be empty, and as a whole: the motion ends open
static cav_status check_gaps(const cav_table *table, const cav_model *model, const int *source, cav_error *error) {
  const int u = 1 + model->nq + model->nv;
  for (int t = 0; t < table->nrow; t++) {
    const double *row = table->value + (size_t)t * (size_t)table->ncol;
    int gaps = 0, last = t + 1 == table->nrow;
    for (int i = u; i < u + model->nv && last; i++) gaps += source[i] >= 0 && isnan(row[source[i]]);
    for (int i = 0; i < u + model->nv; i++) {
      if (source[i] < 0 || !isnan(row[source[i]]) || (i >= u && gaps == model->nv)) continue;
      return cav_file_fail(error, CAV_BAD_INPUT, table->line[t], "%s:%d: column '%s': expected a finite number%s",
                           table->path, table->line[t], table->name[source[i]],
                           last && i >= u ? ", or no u at all in the last row" : "");
    }
  }
  return CAV_OK;
}

static cav_trajectory *from_table(const cav_table *table, const cav_model *model, const int *source, cav_error *error) {
  double h = check_gaps(table, model, source, error) ? 0 : step_of(table, source[0], error);
  if (h == 0) return NULL;
  cav_trajectory *trajectory = cav_trajectory_new(model, table->nrow, h);
  if (!trajectory) {
    cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory for %d knots", table->path, table->nrow);
    return NULL;
  }
  const int *source_q = source + 1, *source_v = source_q + model->nq, *source_u = source_v + model->nv;
  for (int t = 0; t < table->nrow; t++) {
    size_t at = (size_t)t * (size_t)model->nv;
    double *q = trajectory->q + (size_t)t * (size_t)model->nq;
    if (model->nq) row_values(table, source_q, t, model->nq, q);
    if (model->nv) row_values(table, source_v, t, model->nv, trajectory->v + at);
    if (model->nv) row_values(table, source_u, t, model->nv, trajectory->u + at);
    if (check_quaternions(model, q, table, t, error)) {
      cav_trajectory_free(trajectory);
      return NULL;
    }
  }
  // no force stands there
  double *end = trajectory->u + (size_t)(table->nrow - 1) * (size_t)model->nv;
  if (model->nv && isnan(end[0])) memset(end, 0, (size_t)model->nv * sizeof *end);
  if (model->nv && source_v[0] < 0) cav_trajectory_velocities(model, trajectory);
  return trajectory;
}

cav_trajectory *cav_trajectory_read(const char *path, const cav_model *model, cav_error *error) {
  cav_table *table = cav_table_read_gaps(path, error);
  if (!table) return NULL;
  cav_trajectory *trajectory = NULL;
  columns c;
  int *source = calloc((size_t)(1 + model->nq + 2 * model->nv), sizeof *source);
  if (!source || !make_columns(&c, model)) {
    cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
  } else {
    if (match(table, &c, model, source, error) == CAV_OK) trajectory = from_table(table, model, source, error);
    free_columns(&c);
  }
  free(source);
  cav_table_free(table);
  return trajectory;
}
