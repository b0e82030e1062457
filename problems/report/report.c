/// Measures a scene section by section and writes the page: first what to use, then what it follows from.
#include "report.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "advice.h"
#include "result.h"

typedef struct report {
  const cav_report_request *request;
  cav_measure m;
  cav_measure_forward forward;
  cav_measure_step step;
  cav_measure_derivative derivative;
  cav_measure_law law;
  cav_measure_plan plan;
  cav_advice advice;
  double noise[2], load[2], seconds;
  // progress: where the section in hand begins and how much of all it is
  double begin, part;
} report;

static const char *const order_names[] = {"euler", "midpoint", "momentum"};

// --- plots from sheets ---

enum { MOST_SERIES = 10 };

typedef struct drawing {
  int n, lost;
  cav_html_series series[MOST_SERIES];
  double *room[MOST_SERIES];
  int *marked[MOST_SERIES];
  char (*text[MOST_SERIES])[24];
  const char **label[MOST_SERIES];
} drawing;

static void free_drawing(drawing *d) {
  for (int i = 0; i < d->n; i++) {
    free(d->room[i]);
    free(d->marked[i]);
    free(d->text[i]);
    free(d->label[i]);
  }
  *d = (drawing){0};
}

// a series of the rows with these texts (NULL: any); told: the number shown at a point, -1: none
static void add(drawing *d, const cav_sheet *sheet, const char *name, const char *const text[CAV_SHEET_TEXTS], int x,
                int y, int told, int kind, int marks) {
  assert(d->n < MOST_SERIES);
  size_t n = (size_t)sheet->nrow + 1;
  int k = d->n++, count = 0;
  d->room[k] = malloc(2 * n * sizeof *d->room[k]);
  d->marked[k] = malloc(n * sizeof *d->marked[k]);
  d->text[k] = malloc(n * sizeof *d->text[k]);
  d->label[k] = malloc(n * sizeof *d->label[k]);
  if (!d->room[k] || !d->marked[k] || !d->text[k] || !d->label[k]) {
    d->lost = 1;
    d->series[k] = (cav_html_series){.name = name};
    return;
  }
  for (int r = 0; r < sheet->nrow; r++) {
    int fits = 1;
    for (int i = 0; i < CAV_SHEET_TEXTS; i++) fits &= !text[i] || !strcmp(text[i], sheet->row[r].label[i]);
    double a = cav_sheet_get(sheet, r, x), b = cav_sheet_get(sheet, r, y);
    if (!fits || a == CAV_SHEET_NONE || b == CAV_SHEET_NONE) continue;
    d->room[k][count] = a;
    d->room[k][n + (size_t)count] = b;
    d->marked[k][count] = sheet->row[r].marked;
    d->label[k][count] = NULL;
    if (told >= 0) {
      snprintf(d->text[k][count], sizeof *d->text[k], "%g", cav_sheet_get(sheet, r, told));
      d->label[k][count] = d->text[k][count];
    }
    count++;
  }
  d->series[k] = (cav_html_series){.name = name,
                                   .n = count,
                                   .x = d->room[k],
                                   .y = d->room[k] + n,
                                   .marked = marks ? d->marked[k] : NULL,
                                   .label = d->label[k],
                                   .kind = kind};
}

// a level across the range of the first series
static void add_level(drawing *d, const char *name, double level) {
  assert(d->n > 0 && d->n < MOST_SERIES);
  const cav_html_series *first = &d->series[0];
  int k = d->n++;
  d->series[k] = (cav_html_series){.name = name, .kind = CAV_HTML_GUIDE};
  d->room[k] = malloc(4 * sizeof *d->room[k]);
  if (!d->room[k] || first->n == 0) return;
  double least = INFINITY, most = -INFINITY;
  for (int i = 0; i < first->n; i++) least = fmin(least, first->x[i]), most = fmax(most, first->x[i]);
  const double values[] = {least, most, level, level};
  memcpy(d->room[k], values, sizeof values);
  d->series[k].n = 2;
  d->series[k].x = d->room[k];
  d->series[k].y = d->room[k] + 2;
}

static cav_html_plot plot_of(const drawing *d, const char *title, const char *x, const char *y, int log_x, int log_y) {
  return (cav_html_plot){title, x, y, log_x, log_y, d->n, d->series};
}

static const char *number(double value, char text[CAV_HTML_NUMBER]) {
  cav_html_number_text(value, 3, text);
  return text;
}

// --- what to use ---

static void advise_step(const report *r, cav_html *page) {
  const cav_sheet *sheet = &r->step.sheet;
  const cav_advice *a = &r->advice;
  int row = a->motion < 0 ? -1 : a->step[CAV_ADVICE_TARGET].row;
  char x[5][CAV_HTML_NUMBER];
  if (a->motion < 0) {
    cav_html_entry(
        page, "Step and order",
        "No advice: no motion is known to a thousandth of its size. It depends on the step, even on the finest, or it "
        "takes too long.");
    return;
  }
  const char *which = a->both ? "with contacts, and of one without," : a->motion ? "with contacts" : "without contacts";
  if (row < 0) {
    cav_html_entry(page, "Step and order",
                   "None of the steps tried ends the motion %s with an error below 1 %% of its size.", which);
    return;
  }
  cav_html_entry(
      page, "Step and order",
      "%s s, order %s: the cheapest measured that ends a motion of %g s %s with an error below 1 %% of the largest way "
      "of a "
      "coordinate (%s m or rad): off by %s, %s ms.%s",
      number(cav_sheet_get(sheet, row, CAV_STEP_STEP), x[0]), sheet->row[row].label[1], r->step.seconds, which,
      number(a->size, x[1]), number(a->step[CAV_ADVICE_TARGET].error, x[2]),
      number(cav_sheet_get(sheet, row, CAV_STEP_TIME), x[3]),
      a->motion
          ? ""
          : " A motion with contacts does not count: there is none, or its reference is not known well enough; see the "
            "section on time steps.");
}

static void advise_solver(const report *r, cav_html *page) {
  const cav_sheet *sheet = &r->forward.sheet;
  const cav_advice *a = &r->advice;
  char x[5][CAV_HTML_NUMBER];
  int no_rows = a->forward >= 0 && cav_sheet_get(sheet, a->forward, CAV_FORWARD_ROWS) == 0;
  if (a->motion < 0 || a->forward < 0) {
    cav_html_entry(page, "Forward solver and tolerance", "The default, Newton's method to 1e-13: %s.",
                   a->motion < 0 ? "without a known motion no error can be allowed"
                                 : "nothing looser stays within the error allowed in all states");
    return;
  }
  cav_html_entry(
      page, "Forward solver and tolerance",
      "%s %s: %s microseconds a step. Errors of a velocity up to %s m/s or rad/s in every step would add a tenth of "
      "the error "
      "allowed; the cheapest within that leaves up to %s, and this is the tightest that costs hardly more.%s",
      sheet->row[a->forward].label[0], number(cav_sheet_get(sheet, a->forward, CAV_FORWARD_SETTING), x[0]),
      number(cav_sheet_get(sheet, a->forward, CAV_FORWARD_TIME), x[1]), number(a->bound, x[2]),
      number(cav_sheet_get(sheet, a->cheapest, CAV_FORWARD_ERROR_MAX), x[3]),
      no_rows                                       ? " No state has constraint rows, so that a step is solved at once."
      : a->sweeps < 0 && !r->forward.sweeps_missing ? " Gauss-Seidel does not come within it."
                                                    : "");
  if (a->sweeps >= 0 && a->sweeps != a->forward)
    cav_html_entry(page, "Gauss-Seidel", "%s sweeps come within it, too, in %s microseconds.",
                   number(cav_sheet_get(sheet, a->sweeps, CAV_FORWARD_SETTING), x[0]),
                   number(cav_sheet_get(sheet, a->sweeps, CAV_FORWARD_TIME), x[1]));
  int exact = -1;
  for (int i = 0; i < sheet->nrow; i++)
    if (!strcmp(sheet->row[i].label[0], "Newton by tolerance") && !strcmp(sheet->row[i].label[1], "all")) exact = i;
  if (exact >= 0)
    cav_html_entry(page, "Forward to rounding",
                   "Newton to %g takes %s microseconds, %.2f times as long, with errors up to %s: for gradients, "
                   "replays and tests.",
                   cav_sheet_get(sheet, exact, CAV_FORWARD_SETTING),
                   number(cav_sheet_get(sheet, exact, CAV_FORWARD_TIME), x[0]),
                   cav_sheet_get(sheet, exact, CAV_FORWARD_TIME) / cav_sheet_get(sheet, a->forward, CAV_FORWARD_TIME),
                   number(cav_sheet_get(sheet, exact, CAV_FORWARD_ERROR_MAX), x[1]));
}

// over blocks and kinds of states, the largest error of a method; its time
static double worst_derivative(const cav_sheet *sheet, const char *method, double *time) {
  double worst = CAV_SHEET_NONE;
  for (int i = 0; i < sheet->nrow; i++) {
    if (strcmp(sheet->row[i].label[2], method)) continue;
    double e = cav_sheet_get(sheet, i, CAV_DERIVATIVE_ERROR_MAX);
    worst = isnan(e) || isnan(worst) ? NAN : fmax(worst, e);
    *time = cav_sheet_get(sheet, i, CAV_DERIVATIVE_TIME);
  }
  return worst;
}

// the step of centred differences whose largest error over blocks and kinds of states is least, and that error
static double best_step(const cav_sheet *sheet, double *error) {
  double best = NAN;
  *error = INFINITY;
  for (int k = 1; k <= 12; k++) {
    const double step = pow(10, -k);
    double worst = 0;
    int n = 0;
    for (int i = 0; i < sheet->nrow; i++) {
      if (strcmp(sheet->row[i].label[2], "centred") ||
          fabs(cav_sheet_get(sheet, i, CAV_DERIVATIVE_STEP) - step) > 1e-6 * step)
        continue;
      const double e = cav_sheet_get(sheet, i, CAV_DERIVATIVE_ERROR_MAX);
      worst = isnan(e) ? INFINITY : fmax(worst, e);
      n++;
    }
    if (n > 0 && worst < *error) *error = worst, best = step;
  }
  return best;
}

// what the default step of centred differences crosses here, and which derivatives the tool takes
static void explain_differences(const report *r, cav_html *page) {
  const cav_sheet *sheet = &r->derivative.sheet;
  char x[4][CAV_HTML_NUMBER];
  double time, least, error = worst_derivative(sheet, "centred, default", &time), step = best_step(sheet, &least),
                      one = worst_derivative(sheet, "one-sided, default", &time);
  if (sheet->nrow == 0) return;
  if (error > 1e-3 && least < 0.1 * error)
    cav_html_paragraph(
        page,
        "Centred differences at their default step, 1e-5 of positions and 1e-4 of velocities, are off by up to %s "
        "here. That is "
        "neither rounding nor curvature: within such a step a contact comes or goes, or begins to slide. The law has a "
        "kink there, and a difference across it is the derivative of neither side. With a step of %s they are off by "
        "%s. Use the "
        "analytic ones; where a model has none, differences with that step.",
        number(error, x[0]), number(step, x[1]), number(least, x[2]));
  if (worst_derivative(sheet, "analytic", &time) == CAV_SHEET_NONE)
    cav_html_paragraph(page,
                       "cavort takes one-sided differences at their default step, off by up "
                       "to %s here, and centred ones for Ipopt alone.",
                       number(one, x[3]));
  else
    cav_html_paragraph(page,
                       "cavort takes the analytic ones of the dynamics; what has none, as some sensors in costs, is "
                       "differenced by itself.");
}

static void advise_derivative(const report *r, cav_html *page) {
  const cav_sheet *sheet = &r->derivative.sheet;
  double time[3] = {NAN, NAN, NAN}, error[3];
  char x[6][CAV_HTML_NUMBER];
  error[0] = worst_derivative(sheet, "analytic", &time[0]);
  error[1] = worst_derivative(sheet, "centred, default", &time[1]);
  error[2] = worst_derivative(sheet, "one-sided, default", &time[2]);
  if (sheet->nrow == 0) return;
  if (error[0] == CAV_SHEET_NONE) {
    const char *missing = cav_derivatives_missing(r->request->model);
    cav_html_entry(page, "Derivatives",
                   "Centred differences at their default step: errors up to %s in %s microseconds. There are no "
                   "analytic ones for %s.",
                   number(error[1], x[0]), number(time[1], x[1]), missing ? missing : "these options");
    return;
  }
  cav_html_entry(
      page, "Derivatives",
      "Analytic: errors up to %s in %s microseconds; centred differences %s in %s, one-sided ones %s in %s.%s",
      number(error[0], x[0]), number(time[0], x[1]), number(error[1], x[2]), number(time[1], x[3]),
      number(error[2], x[4]), number(time[2], x[5]),
      error[0] <= error[1]
          ? error[1] > 1e-3 ? " The step of the differences crosses kinks here: see the section on derivatives." : ""
          : " Here the analytic ones are farther from the reference than centred differences are: see "
            "the section on derivatives.");
}

static void advise_plan(const report *r, cav_html *page) {
  const cav_sheet *sheet = &r->plan.sheet;
  char x[4][CAV_HTML_NUMBER];
  if (!r->request->problem) return;
  if (r->advice.plan < 0 && r->advice.nearest < 0) {
    cav_html_entry(page, "Solver of the problem",
                   "No advice: no solver came to a motion within %g s of processor time.", r->plan.limit);
    return;
  }
  if (r->advice.plan < 0) {
    int near = r->advice.nearest;
    cav_html_entry(page, "Solver of the problem",
                   "%s: no solver came to a feasible motion in its time%s; this one was the nearest after %s s, with "
                   "an unactuated force of %s of "
                   "the weight, a violation of %s and a cost of %s.",
                   sheet->row[near].label[0], r->request->quick ? " (without --quick they have more)" : "",
                   number(cav_sheet_get(sheet, near, CAV_PLAN_SECONDS), x[3]),
                   number(cav_sheet_get(sheet, near, CAV_PLAN_UNACTUATED), x[0]),
                   number(cav_sheet_get(sheet, near, CAV_PLAN_VIOLATION), x[1]),
                   number(cav_sheet_get(sheet, near, CAV_PLAN_COST), x[2]));
    return;
  }
  int row = r->advice.plan;
  double optimality = cav_sheet_get(sheet, row, CAV_PLAN_OPTIMALITY);
  cav_html_entry(page, "Solver of the problem",
                 "%s: the first to a feasible motion within 10 %% of the least cost, %s s, cost %s%s%s.",
                 sheet->row[row].label[0], number(cav_sheet_get(sheet, row, CAV_PLAN_SECONDS), x[0]),
                 number(cav_sheet_get(sheet, row, CAV_PLAN_COST), x[1]),
                 isfinite(optimality) ? ", of which at most a fraction may still be saved: " : "",
                 isfinite(optimality) ? number(optimality, x[2]) : "");
}

static void write_advice(const report *r, cav_html *page) {
  static const char *const heading[] = {"error at the end, of the way", "m or rad", "order", "step, s", "ms", "error"};
  const cav_sheet *sheet = &r->step.sheet;
  cav_html_heading(page, "What to use on this scene");
  advise_step(r, page);
  advise_solver(r, page);
  advise_derivative(r, page);
  advise_plan(r, page);
  if (r->advice.motion < 0) return;
  cav_html_table(page, "What accuracy costs: the cheapest order and step for an error", 6, heading);
  for (int i = 0; i < CAV_ADVICE_STEPS; i++) {
    int row = r->advice.step[i].row;
    if (i == CAV_ADVICE_TARGET) cav_html_mark(page);
    cav_html_number(page, r->advice.step[i].fraction, 3);
    cav_html_number(page, r->advice.step[i].fraction * r->advice.size, 3);
    if (row < 0) {
      for (int k = 0; k < 4; k++) cav_html_cell(page, "%s", k ? " " : "no step tried");
      continue;
    }
    cav_html_cell(page, "%s", sheet->row[row].label[1]);
    cav_html_number(page, cav_sheet_get(sheet, row, CAV_STEP_STEP), 3);
    cav_html_number(page, cav_sheet_get(sheet, row, CAV_STEP_TIME), 3);
    cav_html_number(page, r->advice.step[i].error, 3);
  }
}

// --- the scene and the clock ---

static void write_scene(const report *r, cav_html *page) {
  const cav_model *model = r->request->model;
  const cav_options *o = &r->m.options;
  char x[2][CAV_HTML_NUMBER];
  int with = 0, most = 0;
  for (int i = 0; i < r->m.nsample; i++) {
    with += r->m.sample[i].rows > 0;
    if (r->m.sample[i].rows > most) most = r->m.sample[i].rows;
  }
  cav_html_heading(page, "The scene, and how good the times are");
  cav_html_entry(page, "Scene",
                 "%d degrees of freedom in %d moving links, %d geoms, %d equality constraints; step %g s, order %s.",
                 model->nv, model->nlink - 1, model->ngeom, model->nequality, o->timestep, order_names[o->order]);
  if (o->stabilisation == CAV_STABILISATION_DISCRETE)
    cav_html_entry(page, "Contact law",
                   "%s: softness %g, time constant %g s, smoothing %g m, %s sliding, %s gap, %s slip.",
                   r->request->problem ? "that of the end of the problem's schedule" : "discrete", o->softness,
                   o->time_constant, o->smoothing, o->sliding == CAV_SLIDING_CONVEX ? "convex" : "Coulomb",
                   o->next_gap == CAV_NEXT_GAP_EXACT ? "exact" : "linear",
                   o->next_slip == CAV_NEXT_SLIP_EXACT ? "exact" : "linear");
  else
    cav_html_entry(page, "Contact law", "solref and solimp of the model's file, smoothing %g m.", o->smoothing);
  cav_html_entry(page, "States", "%d states of random motions, %d with constraint rows, up to %d rows%s.", r->m.nsample,
                 with, most, r->m.lost ? "; some motions ended early, as a step could not be taken" : "");
  cav_html_entry(page, "Clock",
                 "While this was measured, three quarters of a fixed piece of work took up to %.2f (before) and %.2f "
                 "(after) times its "
                 "shortest time; the load was %.1f and %.1f. Times are processor time of one thread, medians; their "
                 "quartiles are in the tables. "
                 "Errors do not depend on it.%s",
                 r->noise[0], r->noise[1], r->load[0], r->load[1],
                 fmax(r->noise[0], r->noise[1]) > 1.15
                     ? " The machine was noisy: differences of less than that say nothing."
                     : "");
  cav_html_entry(page, "Measured in", "%s s%s.", number(r->seconds, x[0]),
                 r->request->quick ? ", by --quick: fewer states, repeats and steps than without" : "");
}

// --- sections ---

static int is_all(const cav_sheet *sheet, int row) { return !strcmp(sheet->row[row].label[1], "all"); }

// what a reader compares by number of rows
static int is_by_rows(const cav_sheet *sheet, int row) {
  const char *method = sheet->row[row].label[0];
  double setting = cav_sheet_get(sheet, row, CAV_FORWARD_SETTING);
  if (is_all(sheet, row)) return 0;
  if (!strcmp(method, "inverse")) return 1;
  if (!strcmp(method, "Newton by tolerance")) return setting == 1e-4 || setting == 1e-12;
  return !strcmp(method, "Gauss-Seidel by sweeps") && (setting == 5 || setting == 50);
}

static void write_forward(const report *r, cav_html *page) {
  static const char *const kinds[] = {"Newton by tolerance", "Newton by iterations", "Gauss-Seidel by sweeps"};
  static const int columns[] = {0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12, 13, -1};
  static const char *const heading[] = {"method",
                                        "rows",
                                        "setting",
                                        "states",
                                        "us",
                                        "25 %",
                                        "75 %",
                                        "iterations",
                                        "error, median",
                                        "error, largest",
                                        "mismatch, median",
                                        "mismatch, largest",
                                        "failed"};
  const cav_sheet *sheet = &r->forward.sheet;
  char x[CAV_HTML_NUMBER];
  drawing d[4] = {0};
  cav_html_heading(page, "Forward solvers");
  cav_html_paragraph(page,
                     "One step forward from %d states, by each solver stopped at different points. The error is the "
                     "largest of a velocity "
                     "after the step, m/s or rad/s, against a reference that is converged until one more Newton step "
                     "by the exact derivative "
                     "changes it by at most %s. The mismatch is what the inverse dynamics at the answer misses of the "
                     "force that was asked, "
                     "over the largest force. Filled points and coloured rows are the Pareto set: nothing measured is "
                     "both faster and more "
                     "exact in all states.",
                     r->forward.states, number(r->forward.uncertainty, x));
  if (r->forward.without)
    cav_html_paragraph(page, "%d more states have no reference that is known to 1e-7 and are left out of this section.",
                       r->forward.without);
  if (r->forward.unmeasured) cav_html_paragraph(page, "There was no time for %d more states.", r->forward.unmeasured);
  if (r->forward.sweeps_missing) cav_html_paragraph(page, "%s.", r->forward.sweeps_missing);
  for (int k = 0; k < (r->forward.sweeps_missing ? 2 : 3); k++) {
    const char *const text[] = {kinds[k], "all", NULL};
    add(&d[0], sheet, kinds[k], text, CAV_FORWARD_TIME, CAV_FORWARD_ERROR_MAX, CAV_FORWARD_SETTING, CAV_HTML_LINE, 1);
    add(&d[1], sheet, kinds[k], text, CAV_FORWARD_TIME, CAV_FORWARD_MISMATCH_MAX, CAV_FORWARD_SETTING, CAV_HTML_LINE,
        0);
    add(&d[2], sheet, kinds[k], text, CAV_FORWARD_ITERATIONS, CAV_FORWARD_ERROR_MAX, CAV_FORWARD_SETTING, CAV_HTML_LINE,
        0);
  }
  cav_sheet few = *sheet;
  const char *const inverse[] = {"inverse", NULL, NULL};
  add(&d[3], &few, "inverse", inverse, CAV_FORWARD_ROWS, CAV_FORWARD_TIME, -1, CAV_HTML_POINTS, 0);
  const char *const newton[] = {"Newton by tolerance", NULL, NULL}, *const sweeps[] = {"Gauss-Seidel by sweeps", NULL,
                                                                                       NULL};
  add(&d[3], &few, "Newton, all tolerances", newton, CAV_FORWARD_ROWS, CAV_FORWARD_TIME, CAV_FORWARD_SETTING,
      CAV_HTML_POINTS, 0);
  if (!r->forward.sweeps_missing)
    add(&d[3], &few, "Gauss-Seidel, all sweeps", sweeps, CAV_FORWARD_ROWS, CAV_FORWARD_TIME, CAV_FORWARD_SETTING,
        CAV_HTML_POINTS, 0);
  const cav_html_plot plots[] = {
      plot_of(&d[0], "Error against time", "microseconds a step", "largest error, m/s or rad/s", 1, 1),
      plot_of(&d[1], "Forward and inverse against time", "microseconds a step", "largest mismatch", 1, 1),
      plot_of(&d[2], "Error against iterations or sweeps", "median iterations", "largest error, m/s or rad/s", 1, 1),
      plot_of(&d[3], "Time against rows", "constraint rows", "microseconds", 0, 1)};
  cav_html_plots(page, 4, plots);
  cav_sheet_show(sheet, page, "All states", columns, heading, is_all);
  cav_sheet_show(sheet, page, "By number of constraint rows", columns, heading, is_by_rows);
  cav_sheet_link(sheet, page, "all of it, by number of rows too");
  for (int i = 0; i < 4; i++) free_drawing(&d[i]);
}

static int is_free(const cav_sheet *sheet, int row) { return !strcmp(sheet->row[row].label[0], "free"); }
static int is_contacts(const cav_sheet *sheet, int row) { return !strcmp(sheet->row[row].label[0], "contacts"); }

static void write_motion(const report *r, cav_html *page, int contacts) {
  static const int columns[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, -1};
  static const char *const heading[] = {
      "order",          "step, s",      "ms",          "25 %",          "75 %",        "error, m or rad",
      "observed order", "energy drift", "linear, m/s", "angular, m²/s", "failed steps"};
  const cav_sheet *sheet = &r->step.sheet;
  const cav_measure_motion *motion = &r->step.motion[contacts];
  const char *name = contacts ? "contacts" : "free";
  char x[3][CAV_HTML_NUMBER];
  drawing d[2] = {0};
  if (motion->slow) {
    cav_html_paragraph(page, "The motion %s is left out: its reference would take too long%s.",
                       contacts ? "with contacts" : "without contacts",
                       r->request->quick ? "; without --quick there is more time" : "");
    return;
  }
  if (!motion->known) {
    cav_html_paragraph(page, contacts
                                 ? "Motion with contacts: the scene made none, or its motion could not be computed."
                                 : "Motion without contacts: it could not be computed.");
    return;
  }
  int extrapolated = motion->extrapolated;
  cav_html_paragraph(
      page,
      "Motion %s of %g s, largest way %s m or rad. Its reference is %s of order midpoint, up to %d steps%s%s, and is "
      "uncertain by about "
      "%s m or rad: smaller errors say nothing.%s",
      contacts ? "with contacts, from where the scene has come to by itself," : "without contacts and limits",
      r->step.seconds, number(motion->size, x[0]),
      extrapolated ? "extrapolated from three fine motions" : "the finest of three motions", motion->steps,
      extrapolated ? ", with the order that they show, " : "; they show no order to extrapolate with",
      extrapolated ? number(motion->order, x[1]) : "", number(motion->uncertainty, x[2]),
      motion->uncertainty > 1e-3 * motion->size ? " That much: contacts that come and go make where it ends depend on "
                                                  "the step; what holds is the order of magnitude."
                                                : "");
  for (int k = 0; k < 3; k++) {
    const char *const text[] = {name, order_names[k], NULL};
    add(&d[0], sheet, order_names[k], text, CAV_STEP_STEP, CAV_STEP_ERROR, -1, CAV_HTML_LINE, 1);
    add(&d[1], sheet, order_names[k], text, CAV_STEP_TIME, CAV_STEP_ERROR, CAV_STEP_STEP, CAV_HTML_LINE, 1);
  }
  if (motion->uncertainty > 0) {
    add_level(&d[0], "uncertainty", motion->uncertainty);
    add_level(&d[1], "uncertainty", motion->uncertainty);
  }
  const cav_html_plot plots[] = {plot_of(&d[0], contacts ? "With contacts: error against step" : "Error against step",
                                         "step, s", "error, m or rad", 1, 1),
                                 plot_of(&d[1], contacts ? "With contacts: error against time" : "Error against time",
                                         "ms for the motion", "error, m or rad", 1, 1)};
  cav_html_plots(page, 2, plots);
  cav_sheet_show(sheet, page, contacts ? "With contacts" : "Without contacts", columns, heading,
                 contacts ? is_contacts : is_free);
  for (int i = 0; i < 2; i++) free_drawing(&d[i]);
}

static void write_step(const report *r, cav_html *page) {
  drawing d[2] = {0};
  cav_html_heading(page, "Time steps and orders");
  cav_html_paragraph(
      page,
      "The same motion in fewer or more steps, by each order: euler takes bias forces at the velocity before the step, "
      "midpoint and momentum at the mean of before and after. An observed order of 1 means that half the step "
      "leaves half the error, of 2 a quarter. The step's own tolerance is 1e-12, so what is seen is the step's.");
  write_motion(r, page, 0);
  for (int k = 0; k < 3; k++) {
    const char *const text[] = {"free", order_names[k], NULL};
    add(&d[0], &r->step.sheet, order_names[k], text, CAV_STEP_STEP, CAV_STEP_ENERGY, -1, CAV_HTML_LINE, 0);
    add(&d[1], &r->step.sheet, order_names[k], text, CAV_STEP_STEP, CAV_STEP_ANGULAR, -1, CAV_HTML_LINE, 0);
  }
  if (r->request->model->nequality == 0) {
    cav_html_paragraph(
        page, "Drift: the scene without forces, dampers and constraints keeps its energy%s. The step makes it drift.",
        r->step.momentum ? " and, as nothing is fixed to the world, its momentum beyond gravity's"
                         : "; momentum it does not keep, as it is fixed to the world");
    const cav_html_plot plots[] = {
        plot_of(&d[0], "Drift of energy", "step, s", "over the largest kinetic energy", 1, 1),
        plot_of(&d[1], "Drift of angular momentum", "step, s", "over mass, m²/s", 1, 1)};
    cav_html_plots(page, r->step.momentum ? 2 : 1, plots);
  } else {
    cav_html_paragraph(page,
                       "Drift of energy and momentum is not measured: equality constraints hold this scene together, "
                       "and they take energy.");
  }
  write_motion(r, page, 1);
  cav_sheet_link(&r->step.sheet, page, "all of it");
  for (int i = 0; i < 2; i++) free_drawing(&d[i]);
}

// analytic, differences at their default step, and those at the step that is best for the block
static int is_telling(const cav_sheet *sheet, int row) {
  const cav_sheet_row *at = &sheet->row[row];
  double error = cav_sheet_get(sheet, row, CAV_DERIVATIVE_ERROR_MAX);
  if (cav_sheet_get(sheet, row, CAV_DERIVATIVE_STEP) == CAV_SHEET_NONE) return 1;
  for (int i = 0; i < sheet->nrow; i++) {
    int alike = !strcmp(sheet->row[i].label[0], at->label[0]) && !strcmp(sheet->row[i].label[1], at->label[1]) &&
                !strcmp(sheet->row[i].label[2], at->label[2]);
    if (alike && cav_sheet_get(sheet, i, CAV_DERIVATIVE_ERROR_MAX) < error) return 0;
  }
  return isfinite(error);
}

static void write_derivative(const report *r, cav_html *page) {
  static const char *const block[] = {"q", "v", "v_next"}, *const kind[] = {"free", "contacts"};
  static const char *const title[2][3] = {{"By q, no constraints", "By v, no constraints", "By v_next, no constraints"},
                                          {"By q, with contacts", "By v, with contacts", "By v_next, with contacts"}};
  static const int columns[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, -1};
  static const char *const heading[] = {"states",         "block",       "method", "step", "count", "error, median",
                                        "error, largest", "reference's", "us",     "25 %", "75 %",  "failed"};
  const cav_sheet *sheet = &r->derivative.sheet;
  cav_html_heading(page, "Derivatives");
  cav_html_paragraph(page,
                     "Derivatives of the inverse dynamics by q, v and v_next: the closed form, and differences over "
                     "steps from 1e-1 to "
                     "1e-12. The error is the largest of a block over its largest entry, against an extrapolated "
                     "reference; the dashed line "
                     "is how well that is known, so the closed form cannot be seen below it. A large step sees "
                     "curvature and contacts that "
                     "come and go, a small one rounding.");
  const char *missing = cav_derivatives_missing(r->request->model);
  if (missing) cav_html_paragraph(page, "This model has no analytic derivatives: %s.", missing);
  if (r->derivative.seconds > 0) {
    char x[CAV_HTML_NUMBER];
    cav_html_paragraph(page, "Left out: a reference would take %s s%s.", number(r->derivative.seconds, x),
                       r->request->quick ? "; without --quick there is more time" : "");
    return;
  }
  for (int k = 0; k < 2; k++) {
    drawing d[3] = {0};
    cav_html_plot plots[3];
    if (r->derivative.states[k] == 0) {
      cav_html_paragraph(page, k ? "No state with constraint rows was found." : "No state was found.");
      continue;
    }
    for (int b = 0; b < 3; b++) {
      const char *const one[] = {kind[k], block[b], "one-sided"}, *const centred[] = {kind[k], block[b], "centred"};
      double analytic = NAN, unknown = NAN;
      add(&d[b], sheet, "one-sided", one, CAV_DERIVATIVE_STEP, CAV_DERIVATIVE_ERROR_MAX, -1, CAV_HTML_LINE, 0);
      add(&d[b], sheet, "centred", centred, CAV_DERIVATIVE_STEP, CAV_DERIVATIVE_ERROR_MAX, -1, CAV_HTML_LINE, 0);
      for (int i = 0; i < sheet->nrow; i++) {
        const cav_sheet_row *row = &sheet->row[i];
        if (strcmp(row->label[0], kind[k]) || strcmp(row->label[1], block[b])) continue;
        unknown = cav_sheet_get(sheet, i, CAV_DERIVATIVE_UNCERTAINTY);
        if (!strcmp(row->label[2], "analytic")) analytic = cav_sheet_get(sheet, i, CAV_DERIVATIVE_ERROR_MAX);
      }
      if (isfinite(analytic)) add_level(&d[b], "analytic", analytic);
      if (unknown > 0 && isfinite(unknown)) add_level(&d[b], "reference known to", unknown);
      plots[b] = plot_of(&d[b], title[k][b], "step", "largest error, relative", 1, 1);
    }
    cav_html_plots(page, 3, plots);
    for (int b = 0; b < 3; b++) free_drawing(&d[b]);
  }
  explain_differences(r, page);
  cav_sheet_show(
      sheet, page,
      "Derivatives: closed form, differences at their default step, and at the step that is best for each block",
      columns, heading, is_telling);
  cav_sheet_link(sheet, page, "all of it, at every step");
}

static void write_law(const report *r, cav_html *page) {
  static const char *const swept[] = {"softness", "time constant", "smoothing"},
                           *const axis[] = {"softness", "time constant, s", "smoothing, m"},
                           *const shown[] = {"Softness", "Time constant", "Smoothing"},
                           *const timed[] = {"Softness: time", "Time constant: time", "Smoothing: time"};
  static const int at[] = {CAV_LAW_SOFTNESS, CAV_LAW_TIME_CONSTANT, CAV_LAW_SMOOTHING};
  static const int columns[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, -1};
  static const char *const heading[] = {
      "swept",          "softness",   "time constant, s", "smoothing, m", "deepest, mm",
      "mean depth, mm", "slip, mm/s", "hover, mm",        "µ h v, mm",    "us",
      "25 %",           "75 %",       "iterations",       "failed"};
  const cav_sheet *sheet = &r->law.sheet;
  cav_html_heading(page, "Contact law");
  if (sheet->nrow == 0 || !r->law.contacts) {
    cav_html_paragraph(page, "The scene made no loaded contacts: there is nothing to measure here.");
    return;
  }
  cav_html_paragraph(
      page,
      "The scene under random forces for %g s in steps of %g s, from where it has come to by itself, with one "
      "number of "
      "the law changed at a time. Softness and time constant say how fast and how stiffly penetration is taken back; "
      "smoothing makes contacts act before they touch. Hover is the gap across which force acts; the convex law "
      "foretells "
      "friction times step times slip (µ h v) for contacts that slide. The first row is the scene's own law; the first "
      "half of each run is not counted.",
      r->law.seconds, r->law.timestep);
  for (int k = 0; k < 3; k++) {
    const char *const text[] = {swept[k], NULL, NULL};
    drawing d[2] = {0};
    add(&d[0], sheet, "deepest, mm", text, at[k], CAV_LAW_DEEPEST, -1, CAV_HTML_LINE, 0);
    add(&d[0], sheet, "slip, mm/s", text, at[k], CAV_LAW_SLIP, -1, CAV_HTML_LINE, 0);
    add(&d[0], sheet, "hover, mm", text, at[k], CAV_LAW_HOVER, -1, CAV_HTML_LINE, 0);
    add(&d[0], sheet, "µ h v, mm", text, at[k], CAV_LAW_PREDICTED, -1, CAV_HTML_LINE, 0);
    add(&d[1], sheet, "a step", text, at[k], CAV_LAW_TIME, -1, CAV_HTML_LINE, 0);
    const cav_html_plot plots[] = {plot_of(&d[0], shown[k], axis[k], "mm, mm/s", 1, 1),
                                   plot_of(&d[1], timed[k], axis[k], "microseconds a step", 1, 1)};
    cav_html_plots(page, 2, plots);
    for (int i = 0; i < 2; i++) free_drawing(&d[i]);
  }
  cav_sheet_show(sheet, page, "Contact law", columns, heading, NULL);
  cav_sheet_link(sheet, page, "the same");
}

static void write_plan(const report *r, cav_html *page) {
  static const char *const names[] = {"own", "Ipopt, exact", "Ipopt, Gauss-Newton", "Ipopt, limited memory"};
  static const int columns[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, -1};
  static const char *const heading[] = {"solver",     "order", "outcome",    "knots",     "step, s",    "s",
                                        "iterations", "cost",  "unactuated", "violation", "optimality", "feasible"};
  drawing d[3] = {0};
  cav_html_heading(page, "Solvers of the problem");
  cav_html_paragraph(
      page,
      "Each solver from the problem's guess, one thread, at most %g s of processor time and %g s in all. Unactuated is "
      "the largest "
      "force that no "
      "actuator can give "
      "over the weight, violation that of limits and constraints; feasible and optimality are the verifier's. What was "
      "stopped "
      "is told as it stood. Solves with another step or order are other problems: their costs are near, not the same. "
      "Coloured rows are the Pareto set: of the feasible motions of the problem itself none is both faster and "
      "cheaper.",
      r->plan.limit, r->plan.wall);
  for (int k = 0; k < 4; k++) {
    const char *const text[] = {names[k], NULL, NULL};
    int there = 0;
    for (int i = 0; i < r->plan.trace.nrow; i++) there |= !strcmp(r->plan.trace.row[i].label[0], names[k]);
    if (!there) continue;
    add(&d[0], &r->plan.trace, names[k], text, CAV_TRACE_SECONDS, CAV_TRACE_COST, -1, CAV_HTML_CURVE, 0);
    add(&d[1], &r->plan.trace, names[k], text, CAV_TRACE_SECONDS, CAV_TRACE_UNACTUATED, -1, CAV_HTML_CURVE, 0);
    add(&d[2], &r->plan.trace, names[k], text, CAV_TRACE_SECONDS, CAV_TRACE_VIOLATION, -1, CAV_HTML_CURVE, 0);
  }
  const cav_html_plot plots[] = {
      plot_of(&d[0], "Cost against time", "s of processor time", "cost", 1, 1),
      plot_of(&d[1], "Unactuated force against time", "s of processor time", "fraction of the weight", 1, 1),
      plot_of(&d[2], "Violation of limits and constraints against time", "s of processor time", "scaled", 1, 1)};
  cav_html_plots(page, 3, plots);
  cav_sheet_show(&r->plan.sheet, page, "Solves", columns, heading, NULL);
  cav_sheet_link(&r->plan.sheet, page, "the same");
  cav_sheet_link(&r->plan.trace, page, "what is drawn");
  for (int i = 0; i < 3; i++) free_drawing(&d[i]);
}

static cav_status write_page(const report *r, cav_error *error) {
  cav_html page;
  char title[200];
  char *path = cav_result_path(r->request->folder, "report.html");
  if (!path) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the report");
  snprintf(title, sizeof title, "%.150s: error against run time", r->request->name);
  cav_status status = cav_html_begin(
      &page, path, title,
      "What accuracy costs on this scene and this machine: solvers, steps, derivatives, the contact law. Failed "
      "measurements are shown as failed.",
      error);
  free(path);
  if (status) return status;
  write_advice(r, &page);
  write_scene(r, &page);
  if (r->request->problem) write_plan(r, &page);
  write_forward(r, &page);
  write_step(r, &page);
  write_derivative(r, &page);
  write_law(r, &page);
  cav_html_heading(&page, "Where this comes from");
  cav_html_provenance(&page, r->request->provenance);
  return cav_html_end(&page, error);
}

// --- all of it ---

static int tell(void *context, const char *what, double fraction) {
  const report *r = context;
  return r->request->tell ? r->request->tell(r->request->context, what, r->begin + r->part * fraction) : 0;
}

static void section(report *r, double part) {
  r->begin += r->part;
  r->part = part;
}

static cav_status measure(report *r, cav_error *error) {
  int problem = r->request->problem != NULL;
  double rest = problem ? (r->request->quick ? 0.5 : 0.25) : 1;
  r->part = 0;
  section(r, 0.1 * rest);
  cav_status status = cav_measure_collect(&r->m);
  section(r, 0.25 * rest);
  if (!status) status = cav_measure_forwards(&r->m, &r->forward);
  section(r, 0.3 * rest);
  if (!status) status = cav_measure_steps(&r->m, &r->step);
  section(r, 0.15 * rest);
  if (!status) status = cav_measure_derivatives(&r->m, &r->derivative);
  section(r, 0.2 * rest);
  if (!status) status = cav_measure_laws(&r->m, &r->law);
  section(r, 1 - rest);
  if (!status && problem) status = cav_measure_plans(&r->m, &r->plan);
  if (!status) cav_advice_take(&r->forward, &r->step, problem ? &r->plan : NULL, &r->advice);
  if (status && error && !*error->text)
    cav_file_fail(error, status, 0, "the scene could not be measured: %s", cav_status_name(status));
  return status;
}

static double load(void) {
  double average[1];
  return getloadavg(average, 1) == 1 ? average[0] : NAN;
}

cav_status cav_report_write(const cav_report_request *request, cav_error *error) {
  report r = {.request = request,
              .m = {.model = request->model, .problem = request->problem, .quick = request->quick, .tell = tell}};
  r.m.context = &r;
  double begin = cav_measure_clock();
  r.noise[0] = cav_measure_noise();
  r.load[0] = load();
  cav_status status = cav_measure_begin(&r.m, error);
  if (!status) status = measure(&r, error);
  r.noise[1] = cav_measure_noise();
  r.load[1] = load();
  r.seconds = cav_measure_clock() - begin;
  cav_sheet *sheets[] = {&r.forward.sheet, &r.step.sheet, &r.derivative.sheet,
                         &r.law.sheet,     &r.plan.sheet, &r.plan.trace};
  if (!status) status = cav_result_folder(request->folder, error);
  for (int i = 0; i < (request->problem ? 6 : 4) && !status; i++)
    status = cav_sheet_write(sheets[i], request->folder, error);
  if (!status) status = write_page(&r, error);
  for (int i = 0; i < 6; i++) cav_sheet_free(sheets[i]);
  cav_measure_end(&r.m);
  return status;
}
