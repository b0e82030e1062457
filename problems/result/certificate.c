/// The certificate: a table for people, JSON for programs, from one verdict. What is required stands in solve.h;
/// whether a motion is certified is decided by cav_verify alone, the marks here only show which line it fell on.
#include "certificate.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"

// adds a line; value and limit are already text
static void add(cav_certificate_line *line, int *n, const char *label, const char *value, const char *limit,
                int passed) {
  assert(*n < CAV_CERTIFICATE_LINES);
  cav_certificate_line *at = &line[(*n)++];
  at->label = label;
  snprintf(at->value, sizeof at->value, "%s", value);
  snprintf(at->limit, sizeof at->limit, "%s", limit);
  at->passed = passed;
}

// a number in as many digits, or in as many more as it takes to tell it from its limit
static void write_apart(char out[32], int digits, double value, double limit) {
  char most[32];
  snprintf(most, sizeof most, "%g", limit);
  do snprintf(out, 32, "%.*g", digits, value);
  while (value != limit && strtod(out, NULL) == strtod(most, NULL) && digits++ < 17);
}

// a number that must not exceed another, both times scale, with a unit
static void add_number(cav_certificate_line *line, int *n, const char *label, double value, double limit, double scale,
                       const char *unit) {
  char number[32], shown[64], most[64];
  write_apart(number, 3, value * scale, limit * scale);
  snprintf(shown, sizeof shown, "%s%s", number, unit);
  snprintf(most, sizeof most, "%g%s", limit * scale, unit);
  add(line, n, label, isnan(value) ? "not known" : shown, isnan(limit) ? "" : most, isnan(limit) ? -1 : value <= limit);
}

int cav_certificate_lines(const cav_verdict *v, cav_certificate_line line[CAV_CERTIFICATE_LINES]) {
  int n = 0;
  char value[64], limit[64];
  add_number(line, &n, "unactuated force, fraction of weight", v->unactuated_force_max, CAV_TOLERANCE_UNACTUATED, 1,
             "");
  if (!isnan(v->residual_fraction_max)) {
    add_number(line, &n, "residual force on a root, of weight", v->residual_fraction_max, v->residual_within, 100,
               " %");
    add_number(line, &n, "residual force, rms", v->residual_force_rms_n, NAN, 1, " N");
    add_number(line, &n, "residual force, largest", v->residual_force_max_n, NAN, 1, " N");
    add_number(line, &n, "residual torque, rms", v->residual_torque_rms_n_m, NAN, 1, " N m");
    add_number(line, &n, "residual torque, largest", v->residual_torque_max_n_m, NAN, 1, " N m");
  }
  add_number(line, &n, "limits of actuators, joints, tendons", v->limit_violation_max, CAV_TOLERANCE_LIMIT, 1, "");
  if (!isnan(v->stop_fraction_max))
    add_number(line, &n, "stops of joints without an actuator, of what they give", v->stop_fraction_max, 1, 100, " %");
  add_number(line, &n, "constraints of the problem", v->constraint_violation_max, CAV_TOLERANCE_CONSTRAINT, 1, "");
  if (v->periods > 1)
    add_number(line, &n, "end of the cycle on its start", v->periodicity_error, CAV_TOLERANCE_PERIODICITY, 1, "");
  if (!isnan(v->mirrored_force_max))
    add_number(line, &n, "mirrored half stride, off by", v->mirrored_force_max, CAV_TOLERANCE_MIRRORED, 100, " %");
  add_number(line, &n, "penetration", v->penetration_max_m, CAV_TOLERANCE_PENETRATION, 1e3, " mm");
  add_number(line, &n, "penetration between knots", v->penetration_between_m, CAV_TOLERANCE_PENETRATION, 1e3, " mm");
  add_number(line, &n, "slip of loaded contacts, mean", v->slip_mean_m_s, CAV_TOLERANCE_SLIP, 1e3, " mm/s");
  add_number(line, &n, "the same over whole steps", v->slip_step_mean_m_s, NAN, 1e3, " mm/s");
  add_number(line, &n, "contact force across open gaps, fraction", v->hover_fraction, CAV_TOLERANCE_HOVER, 100, " %");
  add_number(line, &n, "momentum defect, rms, fraction of weight", v->momentum_defect_rms, CAV_TOLERANCE_MOMENTUM, 100,
             " %");
  add_number(line, &n, "forward step from each knot, error", v->replay_step_max_error, CAV_TOLERANCE_STEP, 1, "");
  double least = cav_verdict_replay(v);
  snprintf(value, sizeof value, "%.3g s", v->replay_same_step_seconds);
  snprintf(limit, sizeof limit, "%.3g s", least);
  add(line, &n, "open loop at the same step, within 1e-6 until", value, limit, v->replay_same_step_seconds >= least);
  snprintf(value, sizeof value, "%.4g s", v->closed_loop_seconds);
  snprintf(limit, sizeof limit, "%.4g s", v->periods * v->duration);
  add(line, &n, "closed loop at a tenth of the step, until", value, limit,
      v->closed_loop_seconds >= v->periods * v->duration * (1 - 1e-9));
  add_number(line, &n, "closed loop, error at the end", v->closed_loop_end_error_m, NAN, 1e3, " mm");
  snprintf(value, sizeof value, "%.4g s", v->model_contacts_seconds);
  add(line, &n, "the same under the model's contact parameters, until", value, limit,
      v->model_contacts_seconds >= v->periods * v->duration * (1 - 1e-9));
  add_number(line, &n, "under the model's contact parameters, error at the end", v->model_contacts_end_error_m, NAN,
             1e3, " mm");
  add_number(line, &n, "push survived there, along x and y", v->push_survived_n_s, NAN, 1, " N s");
  add_number(line, &n, "effort asked for in closed loop, clipped", v->feedback_effort_max, NAN, 100, " %");
  add_number(line, &n, "open loop at the same step, largest error", v->replay_same_step_max_error, NAN, 1, "");
  add_number(line, &n, "power of an actuator, largest", v->power_max_w, NAN, 1, " W");
  add_number(line, &n, "speed of a joint that turns, largest", v->joint_speed_max_rad_s, NAN, 1, " rad/s");
  if (!isnan(v->slide_speed_max_m_s))
    add_number(line, &n, "speed of a joint that slides, largest", v->slide_speed_max_m_s, NAN, 1, " m/s");
  if (!isnan(v->joint_speed_over_limit))
    add_number(line, &n, "speed of a joint over the limit in its file", v->joint_speed_over_limit, NAN, 1, "");
  add_number(line, &n, "cost that a step may still save", v->optimality, NAN, 100, " %");
  return n;
}

enum { TARGETS_SHOWN = 12 };

// what was wanted: of a range that is kept, not the value that is had, but its bounds
static void print_wanted(const cav_term *term, const cav_term_report *r, char *text, size_t size) {
  const int bounds = term->use == CAV_USE_RANGE && r->off == 0 && !term->target && !term->nwaypoint &&
                     term->quantity != CAV_QUANTITY_CONFIGURATION;
  if (bounds && !isfinite(term->upper))
    snprintf(text, size, ">= %.4g", term->lower);
  else if (bounds && !isfinite(term->lower))
    snprintf(text, size, "<= %.4g", term->upper);
  else if (bounds)
    snprintf(text, size, "%.3g..%.3g", term->lower, term->upper);
  else
    snprintf(text, size, "%.4g", r->wanted);
}

// targets, those missed first; a line for the rest
static void print_targets(FILE *out, const cav_problem *problem, const cav_term_report *report) {
  static const char *const mark[] = {"MISSED", "ok"};
  int shown = 0, all = 0;
  for (int i = 0; i < problem->nterm; i++) all += report[i].has_target;
  if (all == 0) return;
  fprintf(out, "%-32s %-18s %8s %10s %10s %10s %10s\n", "asked", "", "at, s", "wanted", "got", "off", "within");
  for (int met = 0; met < 2; met++) {
    for (int i = 0; i < problem->nterm && shown < TARGETS_SHOWN; i++) {
      const cav_term_report *r = &report[i];
      if (!r->has_target || r->met != met) continue;
      char within[24] = "", wanted[40], whole[40] = "";
      if (r->off_alone < r->off) snprintf(whole, sizeof whole, " (%.3g as a vector)", r->off);
      print_wanted(&problem->term[i], r, wanted, sizeof wanted);
      if (isfinite(r->within)) snprintf(within, sizeof within, "%.3g", r->within);
      const char *name = problem->term[i].name && *problem->term[i].name ? problem->term[i].name : "unnamed";
      fprintf(out, "  %-30.30s %-18.18s %8.4g %10s %10.4g %10.3g %10s %s %s%s\n", name, r->what, r->time, wanted,
              r->got, r->off_alone, within, r->unit, isfinite(r->within) ? mark[r->met] : "", whole);
      shown++;
    }
  }
  if (shown < all) fprintf(out, "  and %d more in terms.csv\n", all - shown);
}

// force without an actuator, fraction of the weight, from which on what is achieved is so by it
static const double nowhere = 0.05;

// end errors of a closed loop, m, and effort that it asks for over what there is, from which a certificate is told to be narrow
static const double at_the_edge = CAV_LOST_DISTANCE / 2, overasked = 6;

/// Whether forces of all contacts cost something.
static int has_force_cost(const cav_problem *problem) {
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    if (term->quantity == CAV_QUANTITY_FORCE && term->use == CAV_USE_COST && !term->body && term->weight > 0) return 1;
  }
  return 0;
}

void cav_certificate_print(FILE *out, const cav_problem *problem, const cav_verdict *v, const cav_term_report *report) {
  static const char *const mark[] = {"NOT", "ok"};
  cav_certificate_line line[CAV_CERTIFICATE_LINES];
  int n = cav_certificate_lines(v, line);
  fprintf(out, "%-48s %12s  %10s\n", "certificate", "value", "tolerance");
  for (int i = 0; i < n; i++) {
    fprintf(out, "  %-46s %12s  %10s  %s\n", line[i].label, line[i].value, line[i].limit,
            line[i].passed < 0 ? "" : mark[line[i].passed]);
  }
  if (report) print_targets(out, problem, report);
  if (!isnan(v->solve_seconds)) fprintf(out, "  solved in %.1f s, %d iterations", v->solve_seconds, v->iterations);
  fprintf(out, "%scost %.6g", isnan(v->solve_seconds) ? "  " : ", ", v->cost);
  fprintf(out, problem->duration_most > 0 ? ", duration %.8g s\n" : "\n", v->duration);
  char optimality[32];
  write_apart(optimality, 2, 100 * v->optimality, 100 * CAV_TOLERANCE_OPTIMAL);
  fputs(cav_verdict_feasible(v) ? "feasible" : "NOT feasible", out);
  if (isnan(v->optimality))
    fprintf(out, ", how optimal is not known\n");
  else if (cav_verdict_optimal(v))
    fprintf(out, ", locally optimal: a step saves no more than %s %% of the cost\n", optimality);
  else
    fprintf(out, "; a step may still save %s %% of the cost (locally optimal: no more than %g %%)\n", optimality,
            100 * CAV_TOLERANCE_OPTIMAL);
  const double asked = problem->schedule.optimality;
  if (asked > 0 && v->optimality > asked)
    fprintf(out, "  the problem asks for %g (<schedule optimality>): not reached; --solver both goes on by Ipopt\n",
            asked);
  if (cav_verdict_feasible(v) && !cav_verdict_optimal(v) && !isnan(v->optimality) && !(asked > 0 && asked <= 1e-5))
    fprintf(
        out,
        "  a cheaper motion may be near: <schedule optimality=\"1e-5\"/> goes on for longer, --solver both goes on by "
        "Ipopt; a certificate does not ask for it\n");
  fprintf(out, "%s: %s", v->certified ? "certified" : "NOT certified", problem->name);
  if (*problem->model->name) fprintf(out, " on %s", problem->model->name);
  if (!isnan(v->residual_fraction_max))
    fprintf(out, ", with residual forces on its root of up to %.3g %% of the weight", 100 * v->residual_fraction_max);
  // both words in the line that is looked for
  const int levitates = v->unactuated_force_max > nowhere;
  fprintf(out, v->achieved ? "; achieved%s\n" : "; NOT achieved%s\n",
          !v->achieved   ? ""
          : !v->ntarget  ? " (nothing had to be met)"
          : v->certified ? ""
          : levitates    ? ", by forces that nothing exerts"
                         : ", by a motion that does not hold");
  int missed = 0;
  for (int i = 0; i < n; i++) missed += line[i].passed == 0;
  if (!v->certified) fprintf(out, "  %s\n", v->reason);
  if (!v->certified && missed > 1) fprintf(out, "  that is the first of %d conditions that are NOT met\n", missed);
  // told, not required: the motion is planned under its own law of contacts
  double whole = v->periods * v->duration;
  if (v->model_contacts_seconds < whole * (1 - 1e-9))
    fprintf(out, "  note: under the contact parameters of the model's file its closed loop is lost at %.3g of %.3g s\n",
            v->model_contacts_seconds, whole);
  if (v->slip_mean_m_s <= CAV_TOLERANCE_SLIP && v->slip_step_mean_m_s > 2 * CAV_TOLERANCE_SLIP)
    fprintf(out,
            "  note: over whole steps loaded contacts move at %.3g mm/s on the mean: links that turn carry them on; "
            "<schedule next_slip=\"exact\"/> holds them, or a smaller time step\n",
            1e3 * v->slip_step_mean_m_s);
  const double astray = fmax(v->closed_loop_end_error_m, v->model_contacts_end_error_m);
  if (v->certified && (astray > at_the_edge || v->feedback_effort_max > overasked))
    fprintf(
        out,
        "  note: certified at the edge: its closed loop ends up to %.2g m off (from %g it is lost) and asks for up to "
        "%.3g %% of what an actuator gives, where it gets 100; %sless <limits effort> or a longer motion make it "
        "surer\n",
        astray, CAV_LOST_DISTANCE, 100 * v->feedback_effort_max,
        has_force_cost(problem) ? "" : "<force weight=\"1\"/>, ");
  if (v->end_body[0])
    fprintf(out,
            "  note: it ends in motion: '%s' at %.2g m/s, turning at %.2g rad/s; whether that comes to rest, or falls, "
            "is not "
            "looked at\n",
            v->end_body, v->end_speed_m_s, v->end_rate_rad_s);
  if (v->achieved) return;
  fprintf(out, "NOT achieved: %s misses %s", v->certified ? "it obeys physics, but" : "it also", v->missed);
  if (v->nmissed > 1) fprintf(out, ", and %d more of %d targets", v->nmissed - 1, v->ntarget);
  fputc('\n', out);
}
