/// Sweeps: each parameter alone, on a grid of decades about the scene's own value, and by bisection where what holds
/// changes. Sweeps are shared out over threads, each with a model of its own; what a sweep finds depends on nothing
/// else.
#include "stress.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cavort/dynamics.h"
#include "file.h"
#include "probe.h"

#define SWEEP_RULE(enumerator, name, unit, least, most, text) \
  [CAV_STRESS_##enumerator] = {name, unit, least, most, text},
const cav_stress_sweep_rule cav_stress_sweep_rules[CAV_STRESS_SWEEPS] = {CAV_STRESSES(SWEEP_RULE)};
#define MEASURE_RULE(enumerator, name, good, bad, text) [CAV_STRESS_##enumerator] = {name, good, bad, text},
const cav_stress_measure_rule cav_stress_measure_rules[CAV_STRESS_MEASURE_TYPES] = {CAV_STRESS_MEASURES(MEASURE_RULE)};
const char *const cav_stress_level_names[] = {"safe", "degraded", "broken", "refused"};

enum { GRID_MOST = 26, BISECTIONS_MOST = 7, POINTS_MOST = GRID_MOST + 4 * BISECTIONS_MOST + 8 };

/// How much of everything: a whole run, and a quick one.
typedef struct plan {
  cav_stress_effort effort;
  int grid, bisections;
} plan;

/// The work of all threads. Sweeps are taken in their order.
typedef struct work {
  const cav_stress_options *options;
  cav_stress_report *report;
  plan plan;
  pthread_mutex_t lock;
  int next, running, stop, done; ///< next sweep; threads at work; asked to stop; points measured
  cav_status status;
} work;

typedef struct worker {
  work *work;
  cav_bench bench;
  pthread_t thread;
  int started;
} worker;

static plan plan_of(const cav_stress_options *options, int nv) {
  // steps of a large scene cost more, and in fewer of them what explodes has exploded
  const int steps = nv > 60 ? (nv > 240 ? 25 : 6000 / nv) : 100;
  if (options->quick) return (plan){{1, steps < 40 ? steps : 40, 4}, 9, 3};
  return (plan){{3, steps, 6}, GRID_MOST, BISECTIONS_MOST};
}

// --- one sweep ---

typedef struct sweep {
  work *work;
  cav_bench *bench;
  cav_stress_sweep type;
  cav_stress_result *result;
  cav_status status;
} sweep;

static int stopped(work *w) {
  pthread_mutex_lock(&w->lock);
  const int stop = w->stop;
  w->done += !stop;
  pthread_mutex_unlock(&w->lock);
  return stop;
}

static int near(double a, double b) { return fabs(a - b) <= 1e-9 * fabs(b); }

// measures at a value; the index of its point, -1 if it could not be
static int measure(sweep *s, double value) {
  cav_stress_result *r = s->result;
  if (s->status) return -1;
  for (int i = 0; i < r->npoint; i++)
    if (near(r->point[i].value, value)) return i;
  if (r->npoint == POINTS_MOST) return -1;
  if (stopped(s->work)) {
    s->status = CAV_INTERRUPTED;
    return -1;
  }
  int at = r->npoint++;
  for (; at > 0 && r->point[at - 1].value > value; at--) r->point[at] = r->point[at - 1];
  cav_stress_point *p = &r->point[at];
  *p = (cav_stress_point){.value = value};
  cav_error error = {0};
  const cav_status pushed = cav_bench_push(s->bench, s->type, value, &error);
  if (pushed == CAV_NO_MEMORY) {
    s->status = pushed;
  } else if (pushed) {
    for (int i = 0; i < CAV_STRESS_MEASURE_TYPES; i++) p->measure[i] = NAN;
    p->level = CAV_STRESS_REFUSED;
    snprintf(p->why, sizeof p->why, "refused: %.*s", CAV_STRESS_WHY - 20, error.text);
  } else {
    cav_stress_trace trace;
    s->status = cav_stress_measure_point(s->bench, &s->work->plan.effort, p, &trace);
    const cav_stress_point *own = NULL;
    for (int i = 0; i < r->npoint; i++)
      if (i != at && near(r->point[i].value, r->own)) own = &r->point[i];
    if (!s->status) cav_stress_rate(s->bench, s->type, own, &trace, p);
  }
  return at;
}

static double between(double a, double b) {
  // of what lies many decades apart, too
  return a > 0 && b > 0 ? exp(0.5 * (log(a) + log(b))) : 0.5 * (a + b);
}

// narrows two neighbours in value of which one is at a level and the other beyond it
static void narrow(sweep *s, double good, double bad, cav_stress_level level) {
  for (int k = 0; k < s->work->plan.bisections && !s->status; k++) {
    const double middle = between(good, bad);
    const int at = measure(s, middle);
    if (at < 0) return;
    if (s->result->point[at].level <= level)
      good = middle;
    else
      bad = middle;
  }
}

// first point from the scene's own in a direction that is beyond a level; -1: none
static int first_beyond(const cav_stress_result *r, int direction, cav_stress_level level) {
  int own = 0;
  for (int i = 0; i < r->npoint; i++)
    if (near(r->point[i].value, r->own)) own = i;
  for (int i = own; i >= 0 && i < r->npoint; i += direction)
    if (r->point[i].level > level) return i;
  return -1;
}

static void find_edges(sweep *s) {
  cav_stress_result *r = s->result;
  for (int side = 0; side < 2 && !s->status; side++) {
    const int direction = side ? 1 : -1;
    for (cav_stress_level level = CAV_STRESS_SAFE; level <= CAV_STRESS_DEGRADED; level++) {
      const int at = first_beyond(r, direction, level);
      // at the scene's own value there is nothing to bisect
      if (at < 0 || at == first_beyond(r, -direction, level)) continue;
      narrow(s, r->point[at - direction].value, r->point[at].value, level);
    }
  }
}

// where all is said: own point, edges
static void conclude(cav_stress_result *r) {
  for (int i = 0; i < r->npoint; i++)
    if (near(r->point[i].value, r->own)) r->own_point = i;
  for (int side = 0; side < 2; side++) {
    const int direction = side ? 1 : -1;
    cav_stress_edge *edge = &r->edge[side];
    edge->worse = first_beyond(r, direction, CAV_STRESS_SAFE);
    edge->broken = first_beyond(r, direction, CAV_STRESS_DEGRADED);
    edge->safe = edge->worse < 0               ? r->point[side ? r->npoint - 1 : 0].value
                 : edge->worse == r->own_point ? NAN
                                               : r->point[edge->worse - direction].value;
  }
}

static void run_sweep(sweep *s) {
  const cav_stress_sweep_rule *rule = &cav_stress_sweep_rules[s->type];
  cav_stress_result *r = s->result;
  cav_error error = {0};
  s->status = cav_bench_push(s->bench, CAV_STRESS_SWEEPS, 0, &error);
  if (s->status) return;
  r->absent = cav_bench_absent(s->bench, s->type);
  if (r->absent) return;
  r->other_law = cav_bench_other_law(s->bench, s->type);
  r->own = cav_bench_own(s->bench, s->type);
  r->point = calloc(POINTS_MOST, sizeof *r->point);
  if (!r->point) {
    s->status = CAV_NO_MEMORY;
    return;
  }
  // whole decades, thinned out evenly where there are too many
  const double low = log10(rule->least), high = log10(rule->most);
  const int decades = (int)ceil(high - low - 1e-9),
            n = decades < s->work->plan.grid - 1 ? decades : s->work->plan.grid - 1;
  measure(s, r->own);
  for (int i = 0; i <= n; i++) measure(s, i == n ? rule->most : pow(10, low + round((high - low) * i / n)));
  find_edges(s);
  if (!s->status) conclude(r);
}

// --- threads ---

static void *run_worker(void *context) {
  worker *me = context;
  work *w = me->work;
  for (;;) {
    pthread_mutex_lock(&w->lock);
    const int type = w->status || w->stop ? CAV_STRESS_SWEEPS : w->next;
    if (type < CAV_STRESS_SWEEPS) w->next++;
    pthread_mutex_unlock(&w->lock);
    if (type >= CAV_STRESS_SWEEPS) break;
    sweep s = {.work = w, .bench = &me->bench, .type = (cav_stress_sweep)type, .result = &w->report->sweep[type]};
    run_sweep(&s);
    pthread_mutex_lock(&w->lock);
    if (s.status && !w->status) w->status = s.status;
    pthread_mutex_unlock(&w->lock);
  }
  pthread_mutex_lock(&w->lock);
  w->running--;
  pthread_mutex_unlock(&w->lock);
  return NULL;
}

// what has been measured of what will be, about: an edge on each side
static double fraction_done(const work *w) {
  const int all = CAV_STRESS_SWEEPS * (w->plan.grid + 2 * w->plan.bisections);
  const double known = (double)w->done / all, swept = (double)w->next / (CAV_STRESS_SWEEPS + 1);
  return fmin(0.99, fmax(known, swept * known));
}

static void watch(work *w) {
  const struct timespec moment = {0, 100000000};
  for (;;) {
    pthread_mutex_lock(&w->lock);
    const int running = w->running;
    const double fraction = fraction_done(w);
    pthread_mutex_unlock(&w->lock);
    if (running == 0) return;
    const int stop = w->options->observer && w->options->observer(w->options->context, fraction);
    pthread_mutex_lock(&w->lock);
    w->stop |= stop;
    pthread_mutex_unlock(&w->lock);
    nanosleep(&moment, NULL);
  }
}

static void describe(cav_stress_report *report, const cav_bench *b) {
  const cav_model *m = b->model;
  const char *name = b->problem && b->problem->name[0] ? b->problem->name : m->name;
  snprintf(report->name, sizeof report->name, "%s", name);
  report->options = b->options;
  report->nv = m->nv;
  report->npair = m->npair;
  report->size = b->size;
  const char *missing = cav_derivatives_missing(m);
  snprintf(report->underived, sizeof report->underived, "%s", missing ? missing : "");
}

static void start_workers(work *w, worker *all, int n) {
  for (int i = 0; i < n; i++) {
    w->running++;
    all[i].started = pthread_create(&all[i].thread, NULL, run_worker, &all[i]) == 0;
    if (!all[i].started) w->running--;
  }
}

cav_status cav_stress_run(const cav_stress_scene *scene, const cav_stress_options *options, cav_stress_report *report,
                          cav_error *error) {
  *report = (cav_stress_report){0};
  int n = options->threads < 1 ? 1 : options->threads > CAV_STRESS_SWEEPS ? CAV_STRESS_SWEEPS : options->threads;
  worker *all = calloc((size_t)n, sizeof *all);
  if (!all) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  work w = {.options = options, .report = report};
  cav_status status = CAV_OK;
  // files are read by one thread
  for (int i = 0; i < n && !status; i++) {
    all[i].work = &w;
    status = cav_bench_open(&all[i].bench, scene, error);
    if (!status) status = cav_bench_push(&all[i].bench, CAV_STRESS_SWEEPS, 0, error);
  }
  if (!status) {
    describe(report, &all[0].bench);
    w.plan = plan_of(options, report->nv);
    if (options->observer) w.stop = options->observer(options->context, 0);
    pthread_mutex_init(&w.lock, NULL);
    pthread_mutex_lock(&w.lock);
    start_workers(&w, all, n);
    if (w.running == 0) w.status = CAV_NO_MEMORY;
    pthread_mutex_unlock(&w.lock);
    watch(&w);
    for (int i = 0; i < n; i++)
      if (all[i].started) pthread_join(all[i].thread, NULL);
    pthread_mutex_destroy(&w.lock);
    status = w.status ? w.status : w.stop ? CAV_INTERRUPTED : CAV_OK;
    if (status == CAV_INTERRUPTED) cav_file_fail(error, status, 0, "stopped; nothing is written");
    if (status == CAV_NO_MEMORY) cav_file_fail(error, status, 0, "no memory or no threads");
  }
  for (int i = 0; i < n; i++) cav_bench_close(&all[i].bench);
  free(all);
  return status;
}

void cav_stress_report_clear(cav_stress_report *report) {
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) free(report->sweep[i].point);
  *report = (cav_stress_report){0};
}
