/// The page of a stress run: the safe range of every parameter in a table and a map of colours, then each parameter
/// with what was measured at each of its values.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "html.h"
#include "stress.h"

enum { WIDE = 40, TEXT = CAV_HTML_NUMBER + 4 };

// the values of a sweep that a map shows: whole decades, the scene's own, and where something breaks first
static int shown(const cav_stress_result *r, int index[WIDE]) {
  int n = 0;
  for (int i = 0; i < r->npoint && n < WIDE; i++) {
    const double value = r->point[i].value, power = value > 0 ? log10(value) : 0;
    const int first = i == r->edge[0].broken || i == r->edge[1].broken;
    if (i == r->own_point || first || fabs(power - round(power)) < 1e-6) index[n++] = i;
  }
  return n;
}

// how far a measure is on the way from well (1) to broken (10); -1: not measured; INFINITY: failed
static double way_of(const cav_stress_point *p, cav_stress_measure k) {
  const cav_stress_measure_rule *rule = &cav_stress_measure_rules[k];
  const double value = p->measure[k];
  if (isnan(value)) return -1;
  if (!isfinite(value)) return INFINITY;
  if (value <= rule->good) return 1;
  const double least = fmax(rule->good, 1e-3 * rule->bad);
  const double way = log(fmax(value, least) / least) / log(rule->bad / least);
  // what is not well is never green
  return pow(10, fmin(fmax(way, 0.35), 1));
}

static double worst_way(const cav_stress_point *p) {
  double most = 1;
  if (p->level == CAV_STRESS_REFUSED) return -1;
  for (int k = 0; k < CAV_STRESS_MEASURE_TYPES; k++) most = fmax(most, way_of(p, k));
  return p->level == CAV_STRESS_BROKEN ? INFINITY : most;
}

static void value_text(const cav_stress_result *r, int i, char text[TEXT]) {
  char number[CAV_HTML_NUMBER];
  cav_html_number_text(r->point[i].value, i == r->edge[0].broken || i == r->edge[1].broken ? 3 : 2, number);
  snprintf(text, TEXT, i == r->own_point ? "[%s]" : "%s", number);
}

// --- all parameters ---

// where all is well, in words
static void range_text(const cav_stress_result *r, char *text, size_t size) {
  char low[CAV_HTML_NUMBER], high[CAV_HTML_NUMBER];
  if (isnan(r->edge[0].safe) || isnan(r->edge[1].safe)) {
    snprintf(text, size,
             r->other_law ? "none: not at what the scene has for this law, which it does not use"
                          : "none: not at the scene's own value");
    return;
  }
  cav_html_number_text(r->edge[0].safe, 3, low);
  cav_html_number_text(r->edge[1].safe, 3, high);
  if (r->edge[0].worse < 0 && r->edge[1].worse < 0)
    snprintf(text, size, "all that was tried, %s to %s", low, high);
  else if (r->edge[0].worse < 0)
    snprintf(text, size, "up to %s", high);
  else if (r->edge[1].worse < 0)
    snprintf(text, size, "from %s on", low);
  else
    snprintf(text, size, "%s to %s", low, high);
}

static void broken_text(const cav_stress_result *r, int side, char *text, size_t size) {
  const int at = r->edge[side].broken;
  char number[CAV_HTML_NUMBER];
  snprintf(text, size, "-");
  if (at < 0) return;
  if (at == r->own_point) {
    snprintf(text, size, "here");
    return;
  }
  cav_html_number_text(r->point[at].value, 3, number);
  snprintf(text, size, "%s%s", number, r->point[at].level == CAV_STRESS_REFUSED ? ", refused" : "");
}

static void write_ranges(cav_html *page, const cav_stress_report *report) {
  static const char *const heading[] = {"parameter",         "unit", "this scene", "safe", "first broken below",
                                        "first broken above"};
  cav_html_table(page, NULL, 6, heading);
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) {
    const cav_stress_result *r = &report->sweep[i];
    char text[120];
    cav_html_cell(page, "%s", cav_stress_sweep_rules[i].name);
    cav_html_cell(page, "%s", cav_stress_sweep_rules[i].unit);
    if (r->absent) {
      cav_html_cell(page, "-");
      cav_html_cell(page, "not swept: %s", r->absent);
      cav_html_cell(page, "-");
      cav_html_cell(page, "-");
      continue;
    }
    cav_html_number(page, r->own, 3);
    range_text(r, text, sizeof text);
    cav_html_cell(page, "%s", text);
    for (int side = 0; side < 2; side++) {
      broken_text(r, side, text, sizeof text);
      cav_html_cell(page, "%s", text);
    }
  }
}

static void write_map(cav_html *page, const cav_stress_report *report) {
  static double value[CAV_STRESS_SWEEPS * WIDE];
  static char text[CAV_STRESS_SWEEPS * WIDE][TEXT];
  const char *name[CAV_STRESS_SWEEPS], *cell[CAV_STRESS_SWEEPS * WIDE], *column[WIDE];
  int index[WIDE], ncolumn = 1, nrow = 0;
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) {
    const int n = report->sweep[i].absent ? 0 : shown(&report->sweep[i], index);
    ncolumn = n > ncolumn ? n : ncolumn;
  }
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) {
    const cav_stress_result *r = &report->sweep[i];
    if (r->absent) continue;
    const int n = shown(r, index);
    for (int k = 0; k < ncolumn; k++) {
      const int at = nrow * ncolumn + k;
      value[at] = k < n ? worst_way(&r->point[index[k]]) : -1;
      text[at][0] = 0;
      if (k < n) value_text(r, index[k], text[at]);
      cell[at] = text[at];
    }
    name[nrow++] = cav_stress_sweep_rules[i].name;
  }
  for (int k = 0; k < ncolumn; k++) column[k] = "";
  cav_html_colours(page,
                   &(cav_html_map){.title = "The scene's own value in brackets. Green: all is well; yellow to red: "
                                            "degraded; dark red: broken; grey: refused",
                                   .corner = "",
                                   .nrow = nrow,
                                   .ncolumn = ncolumn,
                                   .row = name,
                                   .column = column,
                                   .value = value,
                                   .text = cell,
                                   .good = 1,
                                   .bad = 10});
}

// --- one parameter ---

static void write_edges(cav_html *page, const cav_stress_result *r) {
  for (int side = 0; side < 2; side++) {
    const cav_stress_edge *edge = &r->edge[side];
    char term[80], number[CAV_HTML_NUMBER];
    const int both[2] = {edge->worse, edge->broken != edge->worse ? edge->broken : -1};
    for (int k = 0; k < 2; k++) {
      const int here = both[k] == r->own_point;
      // what is wrong at the scene's own value is one thing, not two
      if (both[k] < 0 || (here && side)) continue;
      const cav_stress_point *p = &r->point[both[k]];
      cav_html_number_text(p->value, 3, number);
      snprintf(term, sizeof term, "%s %s %s %s",
               here   ? "here"
               : side ? "above"
                      : "below",
               cav_stress_level_names[p->level], here ? "at" : "from", number);
      cav_html_entry(page, term, "%s", p->why);
    }
  }
}

static void write_strip(cav_html *page, const cav_stress_result *r, cav_stress_sweep sweep) {
  double value[CAV_STRESS_MEASURE_TYPES * WIDE];
  char text[CAV_STRESS_MEASURE_TYPES * WIDE][TEXT], head[WIDE][TEXT];
  const char *cell[CAV_STRESS_MEASURE_TYPES * WIDE], *column[WIDE], *row[CAV_STRESS_MEASURE_TYPES];
  int index[WIDE];
  const int n = shown(r, index);
  for (int k = 0; k < n; k++) {
    value_text(r, index[k], head[k]);
    column[k] = head[k];
    for (int m = 0; m < CAV_STRESS_MEASURE_TYPES; m++) {
      const double measured = r->point[index[k]].measure[m];
      value[m * n + k] = way_of(&r->point[index[k]], m);
      text[m * n + k][0] = 0;
      if (isnan(measured))
        snprintf(text[m * n + k], TEXT, "-");
      else
        cav_html_number_text(measured, 2, text[m * n + k]);
      cell[m * n + k] = text[m * n + k];
    }
  }
  for (int m = 0; m < CAV_STRESS_MEASURE_TYPES; m++) row[m] = cav_stress_measure_rules[m].name;
  cav_html_colours(page, &(cav_html_map){.title = "",
                                         .corner = cav_stress_sweep_rules[sweep].unit,
                                         .nrow = CAV_STRESS_MEASURE_TYPES,
                                         .ncolumn = n,
                                         .row = row,
                                         .column = column,
                                         .value = value,
                                         .text = cell,
                                         .good = 1,
                                         .bad = 10});
}

static void write_sweep(cav_html *page, const cav_stress_report *report, cav_stress_sweep sweep) {
  const cav_stress_result *r = &report->sweep[sweep];
  const cav_stress_sweep_rule *rule = &cav_stress_sweep_rules[sweep];
  char range[120];
  if (r->absent) return;
  cav_html_heading(page, rule->name);
  range_text(r, range, sizeof range);
  cav_html_paragraph(page, "%s (%s). This scene: %.3g. Safe: %s.", rule->text, rule->unit, r->own, range);
  if (r->other_law)
    cav_html_paragraph(
        page,
        "This scene stabilises otherwise: what follows is of the same scene under this law, at the value that "
        "it has for it.");
  write_strip(page, r, sweep);
  write_edges(page, r);
}

static void write_head(cav_html *page, const cav_stress_report *report) {
  const cav_options *o = &report->options;
  cav_html_paragraph(
      page,
      "Each parameter is swept alone over its decades, all others as the scene has them: %d dofs, %d "
      "pairs that may touch, size L %.3g m, step %g s, %s.",
      report->nv, report->npair, report->size, o->timestep,
      o->stabilisation == CAV_STABILISATION_DISCRETE ? "discrete stabilisation" : "stabilisation by solref");
  if (report->underived[0])
    cav_html_paragraph(page, "Derivatives are not compared: %s has no analytic ones.", report->underived);
  for (int k = 0; k < CAV_STRESS_MEASURE_TYPES; k++) {
    const cav_stress_measure_rule *rule = &cav_stress_measure_rules[k];
    cav_html_entry(page, rule->name, "%s. Well up to %g, broken from %g on.", rule->text, rule->good, rule->bad);
  }
  cav_html_paragraph(
      page,
      "0: none; of a derivative, none that rounding of the differences does not hide. -: not measured; of a "
      "derivative, rounding or a kink hides all. Safe: all four are well. Degraded: one is not well, none is "
      "broken. \"From\": the value nearest to the scene's own at which it was seen.");
}

cav_status cav_stress_write_page(const char *path, const cav_stress_report *report, const cav_provenance *provenance,
                                 cav_error *error) {
  cav_html page;
  char title[160];
  snprintf(title, sizeof title, "%s under stress", report->name[0] ? report->name : "A scene");
  cav_status status =
      cav_html_begin(&page, path, title, "Where the numbers of this scene hold, and where they end.", error);
  if (status) return status;
  write_head(&page, report);
  cav_html_heading(&page, "Safe ranges");
  write_ranges(&page, report);
  write_map(&page, report);
  cav_html_link(&page, "ranges.csv", "this table, with why");
  cav_html_link(&page, "points.csv", "every value that was measured");
  for (int i = 0; i < CAV_STRESS_SWEEPS; i++) write_sweep(&page, report, i);
  cav_html_heading(&page, "Where this comes from");
  cav_html_provenance(&page, provenance);
  return cav_html_end(&page, error);
}
