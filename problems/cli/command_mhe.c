/// cavort mhe: a record played to an estimator as it was measured, sample by sample: where the body is at each, with its standard
/// errors, from nothing later. How long updates took is told beside it. Exit status 0 if all were made.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cavort/mhe.h"
#include "cavort/result.h"
#include "command.h"
#include "csv.h"
#include "file.h"
#include "result_file.h"
#include "view.h"

enum { USUAL_KNOTS = 10 };

/// A frame as late as this part of a step is that of the knot.
static const double near_knot = 1e-6;

/// N: contacts act at a distance, too, where they are smoothed.
static const double trace = 0.01;

/// Chi-square of a window over its readings: from where a body counts as lost, and from where in the mean errors are too small.
static const double lost = 100, strained = 2;

/// What one update said.
typedef struct update {
  cav_progress last;
  double clock, processor; ///< s that it took
  double chi_square;       ///< of its window
  int readings;            ///< in it
} update;

typedef struct run {
  const cav_command_line *line;
  cav_problem *problem;
  cav_mhe_options options;
  cav_mhe *mhe;
  double deadline;             ///< s
  int *fed;                    ///< [nterm] frames of each record that were given
  cav_trajectory *motion;      ///< states at their samples, forces of the step after as the next sample had them
  cav_standard_errors *errors; ///< of these states
  update *update;              ///< [nknot]
  double *force;               ///< [nknot*nlink*3] N, on each link from outside its tree, as the next sample had it
  int done;                    ///< samples
  char *folder;
} run;

static cav_status no_memory(cav_error *error) { return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory"); }

static cav_status open_run(run *r, cav_error *error) {
  const cav_command_line *line = r->line;
  if (!(r->problem = cav_problem_load(line->operand, line->model, error))) return error->status;
  const cav_problem *p = r->problem;
  const int all = (int)lround(p->duration / p->timestep) + 1;
  r->options = cav_mhe_options_default();
  r->options.threads = line->threads_given ? line->threads : 1;
  r->options.knots = line->knots ? line->knots : all < USUAL_KNOTS ? all : USUAL_KNOTS;
  if (line->iterations) r->options.iterations = line->iterations;
  r->deadline = line->deadline >= 0 ? line->deadline : p->timestep;
  if (!(r->mhe = cav_mhe_new(p, &r->options, error))) return error->status;
  const size_t n = (size_t)all, nv = (size_t)p->model->nv, nu = (size_t)p->model->nu;
  r->fed = calloc((size_t)p->nterm + 1, sizeof *r->fed);
  r->motion = cav_trajectory_new(p->model, all, p->timestep);
  r->update = calloc(n, sizeof *r->update);
  r->force = calloc(n * (size_t)p->model->nlink * 3 + 1, sizeof *r->force);
  cav_standard_errors *e = r->errors = calloc(1, sizeof *e);
  if (!r->fed || !r->motion || !r->update || !r->force || !e) return no_memory(error);
  *e = (cav_standard_errors){.nknot = all, .nq = p->model->nq, .nv = p->model->nv, .nu = p->model->nu};
  e->q = calloc(n * nv + 1, sizeof *e->q);
  e->v = calloc(n * nv + 1, sizeof *e->v);
  e->u = calloc(n * nv + 1, sizeof *e->u);
  e->force = calloc(n * nu + 1, sizeof *e->force);
  if (!e->q || !e->v || !e->u || !e->force) return no_memory(error);
  // of forces none are told
  for (size_t i = 0; i < n * nv; i++) e->u[i] = NAN;
  for (size_t i = 0; i < n * nu; i++) e->force[i] = NAN;
  return CAV_OK;
}

static void close_run(run *r) {
  cav_mhe_free(r->mhe);
  cav_trajectory_free(r->motion);
  cav_standard_errors_free(r->errors);
  cav_problem_free(r->problem);
  free(r->fed), free(r->update), free(r->force), free(r->folder);
}

// ---------------------------------------------------------------- samples

// what was recorded up to knot k
static cav_status feed(run *r, int k, cav_error *error) {
  const cav_problem *p = r->problem;
  for (int i = 0; i < p->nterm; i++) {
    const cav_track *track = p->term[i].track;
    for (int *f = &r->fed[i]; track && *f < track->nframe; ++*f) {
      const double time = track->time[*f] - track->offset;
      if (time > (k + near_knot) * p->timestep) break;
      if (cav_mhe_measure(r->mhe, i, track->time[*f], track->value + (size_t)*f * (size_t)track->ncolumn))
        return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: frame %d cannot be taken", p->term[i].name, *f);
    }
  }
  return CAV_OK;
}

// force of what is not of its tree on each link
static void add_forces(const cav_knot_view *view, double *force) {
  const cav_model *m = view->model;
  for (int i = 0; i < view->state->ncontact; i++) {
    const cav_contact *c = &view->state->contact[i];
    const int link[2] = {c->link1, c->link2};
    if (m->link[link[0]].root == m->link[link[1]].root) continue;
    for (int side = 0; side < 2; side++)
      for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int row = 0; row < 3 && row < c->dim; row++) sum += c->impulse[row] * c->frame[3 * row + k];
        if (link[side] > 0 && link[side] < m->nlink) force[3 * link[side] + k] += (side ? sum : -sum) / view->timestep;
      }
  }
}

// the estimate at knot k, and the forces of the step before it
static cav_status take(run *r, int k) {
  const cav_model *m = r->problem->model;
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv;
  cav_knot_view view;
  cav_status status = k ? cav_mhe_view(r->mhe, 1, &view) : CAV_OK;
  if (k && !status) {
    memcpy(r->motion->u + (size_t)(k - 1) * nv, view.u, nv * sizeof(double));
    add_forces(&view, r->force + (size_t)(k - 1) * 3 * (size_t)m->nlink);
  }
  if (!status) status = cav_mhe_view(r->mhe, 0, &view);
  if (status) return status;
  memcpy(r->motion->q + (size_t)k * nq, view.q, nq * sizeof(double));
  memcpy(r->motion->v + (size_t)k * nv, view.v, nv * sizeof(double));
  const double *C = cav_mhe_covariance(r->mhe);
  for (size_t d = 0; d < nv; d++) {
    r->errors->q[(size_t)k * nv + d] = sqrt(C[d * 2 * nv + d]);
    r->errors->v[(size_t)k * nv + d] = sqrt(C[(nv + d) * 2 * nv + nv + d]);
  }
  r->done = k + 1;
  return CAV_OK;
}

static cav_status sample(run *r, int k, cav_error *error) {
  cav_status status = feed(r, k, error);
  if (status) return status;
  update *u = &r->update[k];
  const double begin = cav_command_clock(CLOCK_MONOTONIC), work = cav_command_clock(CLOCK_PROCESS_CPUTIME_ID);
  status = cav_mhe_update(r->mhe, &u->last);
  u->clock = cav_command_clock(CLOCK_MONOTONIC) - begin,
  u->processor = cav_command_clock(CLOCK_PROCESS_CPUTIME_ID) - work;
  u->chi_square = cav_mhe_chi_square(r->mhe, &u->readings);
  if (!status) status = take(r, k);
  if (status == CAV_NOT_CONVERGED)
    return cav_file_fail(
        error, status, 0,
        "at %g s: nothing tells of a part of the state: costs on posture and velocity at=\"0\" say what is "
        "known of the start, one of <effort> which forces are likely",
        k * r->problem->timestep);
  if (status) cav_file_fail(error, status, 0, "at %g s: %s", k * r->problem->timestep, cav_status_name(status));
  return status;
}

// ---------------------------------------------------------------- files

static cav_status begin_table(const run *r, const char *name, cav_file *file, cav_error *error) {
  char *path = cav_result_path(r->folder, name);
  cav_status status = path ? cav_file_begin(file, path, error) : no_memory(error);
  free(path);
  return status;
}

static void write_row(FILE *out, int n, const double *value) {
  for (int k = 0; k < n; k++) {
    if (k) fputc(',', out);
    cav_table_write_number(out, value[k]);
  }
}

static cav_status write_updates(const run *r, cav_error *error) {
  cav_file file;
  cav_status status = begin_table(r, "updates.csv", &file, error);
  if (status) return status;
  fputs("time_s,cost,unactuated,chi_square,readings,clock_s,processor_s\n", file.stream);
  for (int k = 0; k < r->done; k++) {
    const update *u = &r->update[k];
    const double value[] = {
        k * r->problem->timestep, u->last.cost, u->last.unactuated, u->chi_square, u->readings, u->clock, u->processor};
    write_row(file.stream, 7, value);
    fputc('\n', file.stream);
  }
  return cav_file_end(&file, error);
}

static int is_touched(const run *r, int link) {
  const int n = 3 * r->problem->model->nlink;
  for (int k = 0; k < r->done; k++)
    for (int c = 0; c < 3; c++)
      if (fabs(r->force[k * n + 3 * link + c]) > trace) return 1;
  return 0;
}

static cav_status write_touch(const run *r, cav_error *error) {
  const cav_model *m = r->problem->model;
  cav_file file;
  cav_status status = begin_table(r, "touch.csv", &file, error);
  if (status) return status;
  fputs("time", file.stream);
  for (int link = 1; link < m->nlink; link++)
    for (int c = 0; c < 3 && is_touched(r, link); c++) {
      char name[300];
      const int body = m->link[link].body;
      if (*m->body[body].name)
        snprintf(name, sizeof name, "%.256s_f%c", m->body[body].name, "xyz"[c]);
      else
        snprintf(name, sizeof name, "#%d_f%c", body, "xyz"[c]);
      fputc(',', file.stream);
      cav_table_write_text(file.stream, name);
    }
  for (int k = 0; k + 1 < r->done; k++) {
    fputc('\n', file.stream);
    cav_table_write_number(file.stream, k * r->problem->timestep);
    for (int link = 1; link < m->nlink; link++) {
      if (!is_touched(r, link)) continue;
      fputc(',', file.stream);
      write_row(file.stream, 3, r->force + (size_t)(k * m->nlink + link) * 3);
    }
  }
  fputc('\n', file.stream);
  return cav_file_end(&file, error);
}

static cav_status write_page(const run *r, cav_error *error) {
  char title[200];
  char *path = cav_result_path(r->folder, "view.html");
  double *cost = calloc((size_t)r->motion->nknot, sizeof *cost);
  if (!path || !cost) {
    free(path), free(cost);
    return no_memory(error);
  }
  for (int k = 0; k < r->done; k++) cost[k] = r->update[k].last.cost;
  snprintf(title, sizeof title, "%.60s, estimated on line", r->problem->name);
  const cav_view_series series = {.group = "updates", .name = "cost", .value = cost, .lower = NAN, .upper = NAN};
  const cav_view_input input = {.model = r->problem->model,
                                .title = title,
                                .nknot = r->done,
                                .timestep = r->problem->timestep,
                                .q = r->motion->q,
                                .nseries = 1,
                                .series = &series};
  cav_status status = cav_view_write(path, 1, &input, error);
  free(path), free(cost);
  return status;
}

static cav_status write_all(run *r, cav_error *error) {
  r->folder = cav_command_folder(r->line, r->problem->name, ".mhe");
  cav_status status = r->folder ? cav_result_folder(r->folder, error) : no_memory(error);
  char *path = status ? NULL : cav_result_path(r->folder, "trajectory.csv");
  if (!status && !path) status = no_memory(error);
  if (!status) status = cav_result_write_motion(path, r->problem, r->motion, error);
  if (!status) status = cav_result_write_errors(r->folder, r->problem->model, r->motion, r->errors, error);
  if (!status) status = write_updates(r, error);
  if (!status) status = write_touch(r, error);
  if (!status) status = write_page(r, error);
  free(path);
  return status;
}

// ---------------------------------------------------------------- in words

static int by_size(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// how long updates took once the window was full
static void print_times(const run *r) {
  const int first = r->options.knots < r->done ? r->options.knots : 0, n = r->done - first;
  double *clock = calloc(2 * (size_t)n + 1, sizeof *clock), *processor = clock + n;
  int late = 0;
  for (int k = 0; clock && k < n; k++) {
    clock[k] = r->update[first + k].clock, processor[k] = r->update[first + k].processor;
    late += clock[k] > r->deadline;
  }
  if (clock && n > 0) {
    qsort(clock, (size_t)n, sizeof *clock, by_size), qsort(processor, (size_t)n, sizeof *clock, by_size);
    const int middle = n / 2, most = (int)(0.99 * (n - 1));
    printf(
        "%d updates of a full window: median %.2f ms (%.0f a second), 99 %% %.2f ms, %d later than %g ms; of the "
        "processor %.2f and %.2f ms\n",
        n, 1e3 * clock[middle], 1 / clock[middle], 1e3 * clock[most], late, 1e3 * r->deadline, 1e3 * processor[middle],
        1e3 * processor[most]);
  }
  free(clock);
}

// standard errors at the end, of roots, and whether they have grown
static void print_errors(const run *r) {
  const cav_model *m = r->problem->model;
  const double *begin = r->errors->q, *end = begin + (size_t)(r->done - 1) * (size_t)m->nv;
  for (int j = 0; j < m->njoint; j++) {
    if (m->joint[j].type != CAV_JOINT_FREE) continue;
    const int d = m->joint[j].dof;
    double place = 0, turn = 0, before = 0;
    for (int k = 0; k < 3; k++) {
      place = fmax(place, end[d + k]), turn = fmax(turn, end[d + 3 + k]), before = fmax(before, begin[d + k]);
    }
    printf("standard errors of %s at the end: place %.3g m%s, orientation %.3g rad\n", m->joint[j].name, place,
           place > before ? ", more than at the start: what is measured does not tell it" : "", turn);
  }
}

// whether residuals agree with standard errors: of a window that is right the chi-square is about its readings
static void print_residuals(const run *r) {
  double sum = 0, most = 0;
  int n = 0, at = 0, first = -1, over = 0;
  for (int k = 0; k < r->done; k++) {
    const update *u = &r->update[k];
    if (u->readings < 1) continue;
    const double ratio = u->chi_square / u->readings;
    n++, sum += ratio;
    if (ratio > most) most = ratio, at = k;
    if (ratio <= lost) continue;
    if (first < 0) first = k;
    over++;
  }
  if (n < 1) return;
  const double h = r->problem->timestep;
  printf(
      "chi-square of a window over its readings, 1 where model and noise are right: mean %.2g, largest %.2g at %.4g "
      "s\n",
      sum / n, most, at * h);
  if (over)
    printf(
        "LOST: residuals contradict the standard errors in %d of %d samples, first at %.4g s: do not rely on states "
        "from "
        "there on. A noise (sd) that is larger, likelier forces (<residual>, <effort>) or more readings help\n",
        over, n, first * h);
  else if (sum / n > strained)
    printf("standard errors are too small: by residuals about %.2g times as large\n", sqrt(sum / n));
}

int cav_command_mhe(const cav_command_line *line) {
  cav_error error = {0};
  run r = {.line = line};
  cav_status status = open_run(&r, &error);
  if (!status && !line->quiet)
    printf("%d dofs, %d samples of %g ms, a window of %d, %d iteration%s each\n", r.problem->model->nv, r.motion->nknot,
           1e3 * r.problem->timestep, r.options.knots, r.options.iterations, r.options.iterations > 1 ? "s" : "");
  for (int k = 0; !status && k < r.motion->nknot; k++) status = sample(&r, k, &error);
  if (!status) status = write_all(&r, &error);
  if (!status && !line->quiet) {
    print_times(&r);
    print_errors(&r);
    print_residuals(&r);
    printf(
        "states are those of their samples, velocities means over the step before, forces of a step known a sample "
        "later\nwrote %s: trajectory.csv, stderr.csv, touch.csv, updates.csv, view.html\n",
        r.folder);
  }
  close_run(&r);
  return status ? cav_command_fail(&error) : CAV_EXIT_CERTIFIED;
}
