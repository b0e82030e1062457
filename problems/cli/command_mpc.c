/// cavort mpc: a body under model-predictive control, simulated and pushed. Time is that of the simulation, so results are
/// the same on every machine; how long plans took on this one is told beside them. Exit status 0 if the body stands at the
/// end of every run.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "command.h"
#include "csv.h"
#include "file.h"
#include "result.h"
#include "simulation.h"
#include "view.h"

enum { AROUND = 10, RUNS = AROUND * CAV_COMMAND_PUSHES };

/// Instants of pushes around, s apart: they fall on no plan's or knot's.
static const double instants = 0.0137;

/// Usual length of a push and time after it, s.
static const double usual_length = 0.1, usual_after = 2.5;

/// A run that is asked for.
typedef struct trial {
  cav_push push;
  char what[80];
} trial;

typedef struct control {
  const cav_command_line *line;
  cav_problem *problem;
  cav_simulation simulation;
  double seconds; ///< of the processor, for the first plan
  int ntrial;
  trial trial[RUNS];
  cav_run run[RUNS];
  char *folder;
} control;

static cav_status bad_push(const char *text, const char *what, cav_error *error) {
  return cav_file_fail(error, CAV_BAD_INPUT, 0,
                       "--push '%s': %s; expected \"N_S BODY DIRECTION TIME [LENGTH]\", as \"20 torso y 0.5\"", text,
                       what);
}

// a direction in words or degrees, or around: -1; 0: it is none
static int read_direction(const char *word, double direction[3]) {
  char *end;
  const double degrees = strtod(word, &end);
  const int minus = *word == '-';
  memset(direction, 0, 3 * sizeof *direction);
  if (!strcmp(word, "around")) return -1;
  if (end != word && !*end && isfinite(degrees)) {
    direction[0] = cos(degrees * M_PI / 180), direction[1] = sin(degrees * M_PI / 180);
    return 1;
  }
  const char *axis = word[minus] ? strchr("xyz", word[minus]) : NULL;
  if (!axis || word[minus + 1]) return 0;
  direction[axis - "xyz"] = minus ? -1 : 1;
  return 1;
}

static void add_trial(control *c, int link, const char *body, double impulse, const double direction[3], double time,
                      double length) {
  trial *t = &c->trial[c->ntrial++];
  t->push = (cav_push){.link = link, .time = time, .length = length};
  for (int k = 0; k < 3; k++) t->push.impulse[k] = impulse * direction[k];
  const double degrees = atan2(direction[1], direction[0]) * 180 / M_PI;
  if (direction[2] != 0)
    snprintf(t->what, sizeof t->what, "%g N s on %.24s, %s at %g s", impulse, body, direction[2] > 0 ? "up" : "down",
             time);
  else
    snprintf(t->what, sizeof t->what, "%g N s on %.24s, %.0f degrees at %.4g s", impulse, body,
             degrees < -0.5 ? degrees + 360 : fabs(degrees), time);
}

/// Whether a push of link moves the start posture at all: a planar model is not pushed sideways.
static int moves(const control *c, const cav_state *state, int link, const double direction[3], double *u) {
  const int nv = c->problem->model->nv;
  cav_push push = {.link = link, .length = 1};
  memcpy(push.impulse, direction, sizeof push.impulse);
  memset(u, 0, (size_t)nv * sizeof *u);
  cav_push_add(c->problem->model, state, &push, u);
  double most = 0;
  for (int d = 0; d < nv; d++) most = fmax(most, fabs(u[d]));
  return most > 1e-9;
}

// a text of --push: one run, or as many of the ten around as move the body
static cav_status read_push(control *c, cav_state *state, double *u, const char *text, cav_error *error) {
  char body[100], direction[40], rest[2];
  double impulse, time, length = usual_length, way[3];
  const int n = sscanf(text, "%lf %99s %39s %lf %lf %1s", &impulse, body, direction, &time, &length, rest);
  if (n != 4 && n != 5)
    return bad_push(text, n < 4 ? "there is something missing" : "there is something left over", error);
  const int one = read_direction(direction, way);
  if (!one) return bad_push(text, "DIRECTION is no axis, no angle and not the word around", error);
  if (!(impulse >= 0 && impulse <= 1e6) || !(time >= 0 && time <= 1e6) || !(length > 0 && length <= 1e6))
    return bad_push(text, "the impulse, TIME or LENGTH is out of range", error);
  cav_object_type type = CAV_OBJECT_BODY;
  const int object = cav_object_named(c->problem->model, state, body, &type, error);
  if (object < 0) return CAV_BAD_INPUT;
  const int link = cav_object_link(c->problem->model, type, object);
  if (link == 0) return bad_push(text, "BODY is fixed to the world", error);
  if (cav_position(c->problem->model, state, c->problem->q_start) != CAV_OK)
    return bad_push(text, "the start posture is no posture", error);
  const int before = c->ntrial;
  for (int k = 0; k < (one < 0 ? AROUND : 1); k++) {
    if (one < 0) way[0] = cos(2 * M_PI * k / AROUND), way[1] = sin(2 * M_PI * k / AROUND);
    if (moves(c, state, link, way, u)) add_trial(c, link, body, impulse, way, time + k * instants, length);
  }
  return c->ntrial > before ? CAV_OK : bad_push(text, "no joint of the model lets BODY move in that DIRECTION", error);
}

static cav_status read_pushes(control *c, cav_error *error) {
  cav_state *state = cav_state_new(c->problem->model);
  double *u = calloc((size_t)c->problem->model->nv + 1, sizeof *u);
  cav_status status = state && u ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  for (int i = 0; i < c->line->npush && !status; i++) status = read_push(c, state, u, c->line->push[i], error);
  free(u);
  cav_state_free(state);
  if (c->ntrial == 0) snprintf(c->trial[c->ntrial++].what, sizeof c->trial[0].what, "no push");
  return status;
}

// rate, deadline, duration and the rest into numbers of steps
static cav_status set_simulation(control *c, cav_error *error) {
  const cav_command_line *line = c->line;
  cav_simulation *s = &c->simulation;
  s->problem = c->problem;
  s->mpc = cav_mpc_options_default();
  const double h = s->mpc.timestep, rate = line->rate > 0 ? line->rate : 100;
  s->period = (int)lround(1 / (rate * h));
  if (s->period < 1 || rate < 1 || fabs(s->period * rate * h - 1) > 1e-9)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "--rate %g: expected plans a second, from 1 on, whole milliseconds apart: 100, 50, 40 ...",
                         rate);
  s->mpc.delay = line->deadline >= 0 ? line->deadline : s->period * h;
  if (s->mpc.delay > s->period * h + 1e-9)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "--deadline %g: expected at most the time between plans, %g s",
                         s->mpc.delay, s->period * h);
  if (line->stiffness >= 0) s->mpc.stiffness = line->stiffness;
  s->mpc.knots = line->knots;
  if (line->iterations) s->mpc.iterations = line->iterations;
  double last = 0, end = h;
  for (int i = 0; i < c->ntrial; i++) {
    const cav_push *push = &c->trial[i].push;
    last = fmax(last, push->time), end = fmax(end, push->time + push->length);
  }
  s->steps = (int)lround((line->duration > 0 ? line->duration : last + usual_after) / h);
  if (end <= s->steps * h + 1e-9) return CAV_OK;
  return cav_file_fail(error, CAV_BAD_INPUT, 0, "--duration %g: expected at least %g s, when the last push ends",
                       s->steps * h, end);
}

// the plan that all runs begin with
static cav_status find_first(control *c, cav_error *error) {
  const clock_t begin = clock();
  cav_mpc *mpc = cav_mpc_new(c->problem, &c->simulation.mpc, NULL, error);
  if (!mpc) return error->status;
  c->seconds = (double)(clock() - begin) / CLOCKS_PER_SEC;
  c->simulation.first = cav_trajectory_copy(cav_mpc_trajectory(mpc, NULL));
  cav_mpc_free(mpc);
  return c->simulation.first ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
}

// the run that is told of most: the first that does not stand, or that strayed farthest
static const cav_run *worst_of(const control *c) {
  const cav_run *worst = c->run;
  for (int i = 1; i < c->ntrial; i++) {
    const cav_run *run = &c->run[i];
    if (run->stands != worst->stands ? !run->stands : run->strayed > worst->strayed && worst->stands) worst = run;
  }
  return worst;
}

static cav_status write_runs(const control *c, cav_error *error) {
  cav_file file;
  char *path = cav_result_path(c->folder, "runs.csv");
  cav_status status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) {
    fputs("push,stands,cost,strayed_m,lowered,speed_m_s,plans,stopped\n", file.stream);
    for (int i = 0; i < c->ntrial; i++) {
      const cav_run *run = &c->run[i];
      cav_table_write_text(file.stream, c->trial[i].what);
      fprintf(file.stream, ",%d", run->stands);
      const double value[] = {run->cost, run->strayed, run->lowered, run->speed};
      for (int k = 0; k < 4; k++) fputc(',', file.stream), cav_table_write_number(file.stream, value[k]);
      fprintf(file.stream, ",%d,", run->nplan);
      cav_table_write_text(file.stream, run->stopped);
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}

static cav_status write_plans(const control *c, const cav_run *run, cav_error *error) {
  cav_file file;
  char *path = cav_result_path(c->folder, "plans.csv");
  cav_status status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) {
    fputs("time_s,cost,unactuated,clock_s,processor_s\n", file.stream);
    for (int i = 0; i < run->nplan; i++) {
      const cav_plan_record *plan = &run->plan[i];
      const double value[] = {plan->time, plan->cost, plan->unactuated, plan->seconds, plan->processor};
      for (int k = 0; k < 5; k++) {
        if (k) fputc(',', file.stream);
        cav_table_write_number(file.stream, value[k]);
      }
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}

static cav_status write_page(const control *c, const cav_run *run, cav_error *error) {
  char title[200], strayed[40], path_text[40];
  char *path = cav_result_path(c->folder, "view.html");
  double *cost = calloc((size_t)run->motion->nknot, sizeof *cost);
  if (!path || !cost) {
    free(path), free(cost);
    return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the page");
  }
  for (int i = 0; i < run->nplan; i++) cost[i] = run->plan[i].cost;
  snprintf(title, sizeof title, "%.60s, %.80s", c->problem->name, c->trial[run - c->run].what);
  snprintf(strayed, sizeof strayed, "%.3f m", run->strayed);
  snprintf(path_text, sizeof path_text, "%.3g m/s", run->speed);
  const cav_view_line line[] = {{"push", c->trial[run - c->run].what, -1},
                                {"stands", run->stands ? "yes" : "no", run->stands},
                                {"centre of mass strayed", strayed, -1},
                                {"its speed at the end", path_text, -1}};
  const cav_view_series series = {.group = "plans", .name = "cost", .value = cost, .lower = NAN, .upper = NAN};
  const cav_view_input input = {.model = c->problem->model,
                                .title = title,
                                .nknot = run->motion->nknot,
                                .timestep = run->motion->timestep,
                                .q = run->motion->q,
                                .nseries = 1,
                                .series = &series,
                                .nline = 4,
                                .line = line};
  cav_status status = cav_view_write(path, 1, &input, error);
  free(path);
  free(cost);
  return status;
}

static cav_status write_all(control *c, cav_error *error) {
  const cav_run *worst = worst_of(c);
  c->folder = cav_command_folder(c->line, c->problem->name, ".mpc");
  cav_status status =
      c->folder ? cav_result_folder(c->folder, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  char *motion = status ? NULL : cav_result_path(c->folder, "trajectory.csv");
  if (!status && !motion) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) status = write_runs(c, error);
  if (!status) status = write_plans(c, worst, error);
  if (!status) status = cav_trajectory_write(motion, c->problem->model, worst->motion, error);
  if (!status) status = write_page(c, worst, error);
  free(motion);
  return status;
}

static int by_size(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// number of n, from the smallest on, at a fraction of the way; sorts
static double quantile(double *x, int n, double fraction) {
  qsort(x, (size_t)n, sizeof *x, by_size);
  return x[(int)(fraction * (n - 1))];
}

// how long plans took
static void print_times(const control *c) {
  int n = 0, late = 0;
  for (int i = 0; i < c->ntrial; i++) n += c->run[i].nplan;
  double *clock = calloc(2 * (size_t)n + 1, sizeof *clock), *processor = clock + n;
  const double deadline = c->simulation.mpc.delay;
  for (int i = 0, k = 0; clock && i < c->ntrial; i++)
    for (int t = 0; t < c->run[i].nplan; t++, k++) {
      clock[k] = c->run[i].plan[t].seconds;
      processor[k] = c->run[i].plan[t].processor;
      late += deadline > 0 && clock[k] > deadline;
    }
  if (clock && n > 0) {
    const double median = quantile(clock, n, 0.5), most = quantile(clock, n, 0.99);
    printf("%d plans: median %.2f ms (%.0f a second), 99 %% %.2f ms (%.0f)", n, 1e3 * median, 1 / median, 1e3 * most,
           1 / most);
    if (deadline > 0) printf(", %d later than %g ms", late, 1e3 * deadline);
    printf("; of the processor %.2f and %.2f ms\n", 1e3 * quantile(processor, n, 0.5),
           1e3 * quantile(processor, n, 0.99));
  }
  free(clock);
}

static void print_head(const control *c) {
  const cav_simulation *s = &c->simulation;
  printf(
      "%d dofs, %d knots of %g ms, %g plans a second, %d iteration%s each, in force after %g ms, springs of %g rad/s\n",
      c->problem->model->nv, s->first->nknot, 1e3 * s->first->timestep, 1 / (s->period * s->mpc.timestep),
      s->mpc.iterations, s->mpc.iterations > 1 ? "s" : "", 1e3 * s->mpc.delay, s->mpc.stiffness);
  printf("first plan: %.2f s of the processor\n", c->seconds);
}

static void print_run(const control *c, int i) {
  const cav_run *run = &c->run[i];
  printf("%-46s %s, strayed %.3f m, plans cost %.3g%s%s\n", c->trial[i].what, run->stands ? "stands" : "does not stand",
         run->strayed, run->cost, *run->stopped ? ", " : "", run->stopped);
  fflush(stdout);
}

static cav_status run_all(control *c, int *stand, cav_error *error) {
  cav_status status = CAV_OK;
  *stand = 0;
  if (!c->line->quiet) print_head(c);
  for (int i = 0; i < c->ntrial && !status; i++) {
    const cav_push *push = &c->trial[i].push;
    status = cav_simulate(&c->simulation, push->link ? push : NULL, &c->run[i], error);
    *stand += c->run[i].stands;
    if (!status && !c->line->quiet) print_run(c, i);
  }
  return status;
}

static cav_status run_command(control *c, int *stand, cav_error *error) {
  const cav_command_line *line = c->line;
  if (!(c->problem = cav_problem_load(line->operand, line->model, error))) return error->status;
  cav_status status = read_pushes(c, error);
  if (!status) status = set_simulation(c, error);
  if (!status) status = find_first(c, error);
  if (!status) status = run_all(c, stand, error);
  if (!status) status = write_all(c, error);
  return status;
}

int cav_command_mpc(const cav_command_line *line) {
  cav_error error = {0};
  int stand = 0;
  control *c = calloc(1, sizeof *c);
  if (!c) {
    cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory");
    return cav_command_fail(&error);
  }
  c->line = line;
  const cav_status status = run_command(c, &stand, &error);
  const int all = stand == c->ntrial;
  if (!status && !line->quiet) {
    printf("stands at the end of %d of %d runs\n", stand, c->ntrial);
    print_times(c);
    printf("wrote %s: runs.csv, plans.csv, trajectory.csv, view.html\n", c->folder);
  }
  for (int i = 0; i < c->ntrial; i++) cav_run_clear(&c->run[i]);
  cav_trajectory_free((cav_trajectory *)c->simulation.first);
  cav_problem_free(c->problem);
  free(c->folder);
  free(c);
  return status ? cav_command_fail(&error) : all ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}
