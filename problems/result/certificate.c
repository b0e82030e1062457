/// The certificate: a table for people, JSON for programs, from one verdict. What is required stands in solve.h; whether a
/// motion is certified is decided by cav_verify alone, the marks here only show which line it fell on.
#include "certificate.h"

#include <math.h>
#include <string.h>

// adds a line; value and limit are already text
static void add(cav_certificate_line *line, int *n, const char *label, const char *value, const char *limit,
                int passed) {
  cav_certificate_line *at = &line[(*n)++];
  at->label = label;
  snprintf(at->value, sizeof at->value, "%s", value);
  snprintf(at->limit, sizeof at->limit, "%s", limit);
  at->passed = passed;
}

// a number that must not exceed another, both times scale, with a unit
static void add_number(cav_certificate_line *line, int *n, const char *label, double value, double limit, double scale,
                       const char *unit) {
  char shown[64], most[64];
  snprintf(shown, sizeof shown, "%.3g%s", value * scale, unit);
  snprintf(most, sizeof most, "%g%s", limit * scale, unit);
  add(line, n, label, isnan(value) ? "not known" : shown, isnan(limit) ? "" : most, isnan(limit) ? -1 : value <= limit);
}

int cav_certificate_lines(const cav_verdict *v, cav_certificate_line line[CAV_CERTIFICATE_LINES]) {
  int n = 0;
  char value[64], limit[64];
  add_number(line, &n, "unactuated force, fraction of weight", v->unactuated_force_max, CAV_TOLERANCE_UNACTUATED, 1,
             "");
  add_number(line, &n, "limits of actuators, joints, tendons", v->limit_violation_max, CAV_TOLERANCE_LIMIT, 1, "");
  add_number(line, &n, "constraints of the problem", v->constraint_violation_max, CAV_TOLERANCE_CONSTRAINT, 1, "");
  if (v->periods > 1)
    add_number(line, &n, "end of the cycle on its start", v->periodicity_error, CAV_TOLERANCE_PERIODICITY, 1, "");
  add_number(line, &n, "penetration", v->penetration_max_m, CAV_TOLERANCE_PENETRATION, 1e3, " mm");
  add_number(line, &n, "slip of loaded contacts, mean", v->slip_mean_m_s, CAV_TOLERANCE_SLIP, 1e3, " mm/s");
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
  add_number(line, &n, "the same under the model's contact parameters, until", v->model_contacts_seconds, NAN, 1, " s");
  add_number(line, &n, "under the model's contact parameters, error at the end", v->model_contacts_end_error_m, NAN,
             1e3, " mm");
  add_number(line, &n, "open loop at the same step, largest error", v->replay_same_step_max_error, NAN, 1, "");
  add_number(line, &n, "cost that optimality leaves, fraction", v->optimality, NAN, 1, "");
  return n;
}

void cav_certificate_print(FILE *out, const char *problem, const char *model, const cav_verdict *v) {
  static const char *const mark[] = {"NOT", "ok"};
  cav_certificate_line line[CAV_CERTIFICATE_LINES];
  int n = cav_certificate_lines(v, line);
  fprintf(out, "%-48s %12s  %10s\n", "certificate", "value", "tolerance");
  for (int i = 0; i < n; i++) {
    fprintf(out, "  %-46s %12s  %10s  %s\n", line[i].label, line[i].value, line[i].limit,
            line[i].passed < 0 ? "" : mark[line[i].passed]);
  }
  if (!isnan(v->solve_seconds)) fprintf(out, "  solved in %.1f s, %d iterations\n", v->solve_seconds, v->iterations);
  fprintf(out, "%s, ", cav_verdict_feasible(v) ? "feasible" : "NOT feasible");
  if (isnan(v->optimality))
    fprintf(out, "how optimal is not known\n");
  else
    fprintf(out, "%s to %.1g (the word needs %g)\n", cav_verdict_optimal(v) ? "optimal" : "NOT optimal, but",
            v->optimality, CAV_TOLERANCE_OPTIMAL);
  fprintf(out, "%s: %s on %s", v->certified ? "certified" : "NOT certified", problem, model);
  fprintf(out, v->certified ? "\n" : "\n  %s\n", v->reason);
}

void cav_certificate_json_text(FILE *out, const char *text) {
  fputc('"', out);
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    if (c == '"' || c == '\\')
      fprintf(out, "\\%c", c);
    else if (c < ' ')
      fprintf(out, "\\u%04x", c);
    else
      fputc(c, out);
  }
  fputc('"', out);
}

static void write_number(FILE *out, const char *name, double value) {
  if (isfinite(value))
    fprintf(out, ",\n  \"%s\": %.17g", name, value);
  else
    fprintf(out, ",\n  \"%s\": null", name);
}

void cav_certificate_json(FILE *out, const char *problem, const char *model, const cav_verdict *v) {
  fputs("{\n  \"problem\": ", out);
  cav_certificate_json_text(out, problem);
  fputs(",\n  \"model\": ", out);
  cav_certificate_json_text(out, model);
  fprintf(out, ",\n  \"certified\": %s", v->certified ? "true" : "false");
  fprintf(out, ",\n  \"feasible\": %s", cav_verdict_feasible(v) ? "true" : "false");
  fprintf(out, ",\n  \"optimal\": %s", cav_verdict_optimal(v) ? "true" : "false");
  fputs(",\n  \"reason\": ", out);
  cav_certificate_json_text(out, v->reason);
  write_number(out, "unactuated_force_max", v->unactuated_force_max);
  write_number(out, "unactuated_force_knot", v->unactuated_force_knot);
  write_number(out, "momentum_defect_rms", v->momentum_defect_rms);
  write_number(out, "limit_violation_max", v->limit_violation_max);
  write_number(out, "constraint_violation_max", v->constraint_violation_max);
  write_number(out, "penetration_max_m", v->penetration_max_m);
  write_number(out, "slip_mean_m_s", v->slip_mean_m_s);
  write_number(out, "hover_fraction", v->hover_fraction);
  write_number(out, "optimality", v->optimality);
  write_number(out, "replay_step_max_error", v->replay_step_max_error);
  write_number(out, "replay_same_step_max_error", v->replay_same_step_max_error);
  write_number(out, "replay_same_step_seconds", v->replay_same_step_seconds);
  write_number(out, "closed_loop_seconds", v->closed_loop_seconds);
  write_number(out, "closed_loop_end_error_m", v->closed_loop_end_error_m);
  write_number(out, "model_contacts_seconds", v->model_contacts_seconds);
  write_number(out, "model_contacts_end_error_m", v->model_contacts_end_error_m);
  write_number(out, "periodicity_error", v->periodicity_error);
  write_number(out, "periods", v->periods);
  write_number(out, "duration", v->duration);
  write_number(out, "solve_seconds", v->solve_seconds);
  write_number(out, "iterations", isnan(v->solve_seconds) ? (double)NAN : (double)v->iterations);
  fputs("\n}\n", out);
}
