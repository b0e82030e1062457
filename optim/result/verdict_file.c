/// verdict.json and terms.csv of a result folder.
#include "verdict_file.h"

#include <math.h>

#include "csv.h"

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

static void write_target(FILE *out, const char *name, const cav_term_report *r) {
  fputs("    {\"name\": ", out);
  cav_certificate_json_text(out, name ? name : "");
  fputs(", \"what\": ", out);
  cav_certificate_json_text(out, r->what);
  fputs(", \"unit\": ", out);
  cav_certificate_json_text(out, r->unit);
  const struct {
    const char *name;
    double value;
  } field[] = {{"time", r->time}, {"wanted", r->wanted}, {"got", r->got},
               {"off", r->off},   {"within", r->within}, {"cost_fraction", r->fraction}};
  for (size_t k = 0; k < sizeof field / sizeof *field; k++) {
    if (isfinite(field[k].value))
      fprintf(out, ", \"%s\": %.17g", field[k].name, field[k].value);
    else
      fprintf(out, ", \"%s\": null", field[k].name);
  }
  fprintf(out, ", \"met\": %s}", r->met ? "true" : "false");
}

void cav_certificate_terms(FILE *out, const cav_problem *problem, const cav_term_report *report) {
  fputs("term,quantity_missed_most,unit,time,wanted,got,off,within,met,cost,cost_fraction\n", out);
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term_report *r = &report[i];
    const double value[] = {r->time, r->wanted, r->got, r->off, r->within};
    cav_table_write_text(out, problem->term[i].name ? problem->term[i].name : "");
    fputc(',', out);
    cav_table_write_text(out, r->what);
    fprintf(out, ",%s", r->unit);
    for (int k = 0; k < 5; k++) {
      fputc(',', out);
      if (r->has_target) cav_table_write_number(out, value[k]);
    }
    fprintf(out, ",%s,", !r->has_target || !isfinite(r->within) ? "" : r->met ? "1" : "0");
    cav_table_write_number(out, r->cost);
    fputc(',', out);
    cav_table_write_number(out, r->fraction);
    fputc('\n', out);
  }
}

void cav_certificate_json(FILE *out, const cav_problem *problem, const cav_verdict *v, const cav_term_report *report,
                          const cav_starts_report *starts, const char *provenance) {
  fputs("{\n  \"problem\": ", out);
  cav_certificate_json_text(out, problem->name);
  fputs(",\n  \"model\": ", out);
  cav_certificate_json_text(out, problem->model->name);
  fprintf(out, ",\n  \"certified\": %s", v->certified ? "true" : "false");
  fprintf(out, ",\n  \"feasible\": %s", cav_verdict_feasible(v) ? "true" : "false");
  fprintf(out, ",\n  \"optimal\": %s", cav_verdict_optimal(v) ? "true" : "false");
  fputs(",\n  \"reason\": ", out);
  cav_certificate_json_text(out, v->reason);
  fprintf(out, ",\n  \"achieved\": %s,\n  \"missed\": ", v->achieved ? "true" : "false");
  cav_certificate_json_text(out, v->missed);
  write_number(out, "cost", v->cost);
  write_number(out, "unactuated_force_max", v->unactuated_force_max);
  write_number(out, "unactuated_force_knot", v->unactuated_force_knot);
  write_number(out, "momentum_defect_rms", v->momentum_defect_rms);
  write_number(out, "residual_force_rms_n", v->residual_force_rms_n);
  write_number(out, "residual_force_max_n", v->residual_force_max_n);
  write_number(out, "residual_torque_rms_n_m", v->residual_torque_rms_n_m);
  write_number(out, "residual_torque_max_n_m", v->residual_torque_max_n_m);
  write_number(out, "residual_fraction_max", v->residual_fraction_max);
  write_number(out, "residual_within", v->residual_within);
  write_number(out, "limit_violation_max", v->limit_violation_max);
  write_number(out, "stop_fraction_max", v->stop_fraction_max);
  write_number(out, "constraint_violation_max", v->constraint_violation_max);
  write_number(out, "penetration_max_m", v->penetration_max_m);
  write_number(out, "penetration_between_m", v->penetration_between_m);
  write_number(out, "slip_mean_m_s", v->slip_mean_m_s);
  write_number(out, "slip_step_mean_m_s", v->slip_step_mean_m_s);
  write_number(out, "hover_fraction", v->hover_fraction);
  write_number(out, "power_max_w", v->power_max_w);
  write_number(out, "joint_speed_max_rad_s", v->joint_speed_max_rad_s);
  write_number(out, "slide_speed_max_m_s", v->slide_speed_max_m_s);
  write_number(out, "joint_speed_over_limit", v->joint_speed_over_limit);
  write_number(out, "optimality", v->optimality);
  write_number(out, "replay_step_max_error", v->replay_step_max_error);
  write_number(out, "replay_same_step_max_error", v->replay_same_step_max_error);
  write_number(out, "replay_same_step_seconds", v->replay_same_step_seconds);
  write_number(out, "closed_loop_seconds", v->closed_loop_seconds);
  write_number(out, "closed_loop_end_error_m", v->closed_loop_end_error_m);
  write_number(out, "feedback_effort_max", v->feedback_effort_max);
  write_number(out, "model_contacts_seconds", v->model_contacts_seconds);
  write_number(out, "model_contacts_end_error_m", v->model_contacts_end_error_m);
  write_number(out, "end_speed_m_s", v->end_speed_m_s);
  write_number(out, "end_rate_rad_s", v->end_rate_rad_s);
  write_number(out, "push_survived_n_s", v->push_survived_n_s);
  write_number(out, "periodicity_error", v->periodicity_error);
  write_number(out, "mirrored_force_max", v->mirrored_force_max);
  write_number(out, "periods", v->periods);
  write_number(out, "duration", v->duration);
  write_number(out, "solve_seconds", v->solve_seconds);
  write_number(out, "iterations", isnan(v->solve_seconds) ? (double)NAN : (double)v->iterations);
  if (starts) {
    write_number(out, "starts", starts->starts);
    write_number(out, "starts_followed", starts->followed);
    write_number(out, "starts_soonest_lost_s", starts->soonest_lost);
    write_number(out, "starts_end_error_m", starts->end_error_m);
  }
  fputs(",\n  \"targets\": [", out);
  for (int i = 0, first = 1; report && i < problem->nterm; i++) {
    if (!report[i].has_target) continue;
    fputs(first ? "\n" : ",\n", out);
    write_target(out, problem->term[i].name, &report[i]);
    first = 0;
  }
  fputc(']', out);
  if (provenance) fprintf(out, ",\n  \"provenance\": %s", provenance);
  fputs("\n}\n", out);
}
