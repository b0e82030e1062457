/// Problem files from problems: what problem.c reads, with nothing left to resolve.
///
/// Postures are written as numbers, targets as they stand in the terms, every stage option spelt out; default costs
/// that the problem does not have are written with weight 0, as a file says it. Numbers carry 17 digits, so reading
/// gives the same bits.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"

// text inside an attribute
static void write_text(FILE *out, const char *name, const char *text) {
  fprintf(out, " %s=\"", name);
  cav_file_write_xml(out, text);
  fputc('"', out);
}

static void write_number(FILE *out, const char *name, double value) { fprintf(out, " %s=\"%.17g\"", name, value); }

static void write_numbers(FILE *out, const char *name, const double *value, int n) {
  fprintf(out, " %s=\"", name);
  for (int i = 0; i < n; i++) fprintf(out, "%s%.17g", i ? " " : "", value[i]);
  fputc('"', out);
}

// name of an object and of its kind, NULL if it has none
static const char *object_name(const cav_model *m, cav_object_type type, int i, const char **kind) {
  const char *name = cav_object_name(m, type, i);
  *kind = cav_object_kind_of(type)->attribute;
  return *name ? name : NULL;
}

// sensor by what it looks at, or by the model's name for it; 0 if it has neither
static int write_sensor(FILE *out, const cav_problem *p, const cav_term *term) {
  static const char *const component[] = {"x", "y", "z"};
  const cav_sensor *sensor = &term->sensor;
  const char *kind = NULL, *object = object_name(p->model, sensor->object_type, sensor->object, &kind);
  const char *name = sensor->name ? sensor->name : "", *reference = NULL, *frame = NULL;
  if (sensor->referred) reference = object_name(p->model, sensor->reference_type, sensor->reference, &frame);
  // a reading that is cut, or in a frame without a name, is only in the model
  if (object && sensor->cutoff == 0 && (reference || !sensor->referred)) {
    write_text(out, "name", term->name ? term->name : "sensor");
    write_text(out, "type", cav_sensor_rule_of(sensor->type)->name);
    write_text(out, kind, object);
    if (reference) {
      write_text(out, "reftype", frame);
      write_text(out, "refname", reference);
    }
  } else if (*name) {
    write_text(out, "name", name);
  } else {
    return 0;
  }
  if (term->component >= 0 && term->sensor.dim > 1) write_text(out, "component", component[term->component]);
  return 1;
}

// the element of a channel, in the order of their elements: marker, joint, sensor
static int written_as(const cav_channel *channel) {
  return channel->kind == CAV_CHANNEL_MARKER ? 0 : channel->kind == CAV_CHANNEL_SENSOR ? 2 : 1;
}

// selection of dofs; 0 if it is of a joint without a name
static int write_dofs(FILE *out, const cav_problem *p, const cav_term *term) {
  int one = term->dofs == CAV_DOFS_ONE;
  const char *text = one ? p->model->joint[term->joint].name : cav_problem_dof_sets[term->dofs];
  write_text(out, one ? "joint" : "dofs", text);
  return *text != 0;
}

// one target, as the element's attribute or a waypoint's
static void write_target(FILE *out, const cav_problem *p, const cav_term *term, const double *target) {
  if (term->quantity == CAV_QUANTITY_CONFIGURATION) {
    write_numbers(out, "qpos", target, p->model->nq);
  } else if (term->quantity == CAV_QUANTITY_SENSOR) {
    int one = term->component >= 0 && term->sensor.dim != 4;
    write_numbers(out, "target", target + (one ? term->component : 0), one ? 1 : term->sensor.dim);
  } else {
    fputs(" target=\"", out);
    for (int d = 0, n = 0; d < p->model->nv; d++) {
      if (cav_problem_selects(p->model, term, d)) fprintf(out, "%s%.17g", n++ ? " " : "", target[d]);
    }
    fputc('"', out);
  }
}

// window attributes; none for the whole horizon
static void write_window(FILE *out, const cav_problem *p, const cav_term *term) {
  double to = term->to < 0 ? p->duration : term->to, from = term->from < 0 ? p->duration : term->from;
  if (to - from < 1e-9) {
    write_number(out, "at", fmin(from, p->duration));
    return;
  }
  if (from > 0) write_number(out, "from", from);
  if (term->to >= 0) write_number(out, "to", to);
}

static int is_running(const cav_problem *p, const cav_term *term) {
  return term->from == 0 && term->to < 0 && p->duration > 1e-9 && term->body <= 0;
}

// noise and columns of the frames of one channel after the other, as reading takes them
static void write_frames(FILE *out, const cav_track *track) {
  for (int f = 0; f < track->nframe; f++) {
    const double *row = track->value + (size_t)f * (size_t)track->ncolumn;
    fputs("      <frame", out);
    write_number(out, "time", track->time[f]);
    for (int gaps = 0; gaps < 2; gaps++) {
      int n = 0, written = 0;
      for (int kind = 0; kind < 3; kind++)
        for (int i = 0; i < track->nchannel; i++) {
          const cav_channel *channel = &track->channel[i];
          if (written_as(channel) != kind) continue;
          for (int c = channel->column; c < channel->column + channel->ncolumn; c++, n++) {
            if (gaps && !isnan(row[c])) continue;
            if (!written++)
              fputs(gaps ? " unseen=\"" : " value=\"", out);
            else
              fputc(' ', out);
            if (gaps)
              fprintf(out, "%d", n);
            else
              fprintf(out, "%.17g", isnan(row[c]) ? 0 : row[c]);
          }
        }
      if (written) fputc('"', out);
    }
    fputs("/>\n", out);
  }
}

// 0 if it cannot be: something without a name, or half of a free joint
static int write_channel(FILE *out, const cav_problem *p, const cav_track *track, int i) {
  const cav_channel *channel = &track->channel[i], *next = i + 1 < track->nchannel ? channel + 1 : NULL;
  int translation = channel->kind == CAV_CHANNEL_TRANSLATION;
  int ok = 1;
  if (channel->kind == CAV_CHANNEL_ROTATION && p->model->joint[channel->object].type == CAV_JOINT_FREE)
    return i > 0 && channel[-1].kind == CAV_CHANNEL_TRANSLATION && channel[-1].object == channel->object;
  if (translation && !(next && next->kind == CAV_CHANNEL_ROTATION && next->object == channel->object)) return 0;
  fprintf(out, "      <%s", (const char *const[]){"marker", "joint", "sensor"}[written_as(channel)]);
  if (channel->kind == CAV_CHANNEL_SENSOR) {
    cav_term term = {.name = channel->name, .sensor = channel->sensor, .component = channel->component};
    ok = write_sensor(out, p, &term);
  } else if (channel->kind == CAV_CHANNEL_MARKER) {
    write_text(out, "name", channel->name);
    ok = *p->model->body[channel->object].name != 0;
    write_text(out, "body", p->model->body[channel->object].name);
    write_numbers(out, "pos", channel->place, 3);
  } else {
    ok = *p->model->joint[channel->object].name != 0;
    write_text(out, "name", p->model->joint[channel->object].name);
  }
  write_numbers(out, "sd", (double[]){channel->sd, translation ? next->sd : 0}, translation ? 2 : 1);
  fputs("/>\n", out);
  return ok;
}

static int write_track(FILE *out, const cav_problem *p, const cav_term *term) {
  const cav_track *track = term->track;
  int ok = 1;
  write_number(out, "offset", track->offset);
  write_number(out, "gap", track->gap);
  write_number(out, "interval", track->interval);
  fputs(">\n", out);
  for (int kind = 0; kind < 3; kind++)
    for (int i = 0; i < track->nchannel; i++)
      if (written_as(&track->channel[i]) == kind) ok = ok && write_channel(out, p, track, i);
  write_frames(out, track);
  fputs("    </track>\n", out);
  return ok;
}

static int write_term(FILE *out, const cav_problem *p, const cav_term *term) {
  if (term->quantity == CAV_QUANTITY_USER) return 0;
  const char *element = cav_quantity_rule_of(term->quantity)->name;
  fprintf(out, "    <%s", element);
  if (term->quantity == CAV_QUANTITY_SENSOR) {
    if (!write_sensor(out, p, term)) return 0;
  } else {
    write_text(out, "name", term->name && *term->name ? term->name : element);
  }
  if (cav_term_has_dofs(term) && !write_dofs(out, p, term)) return 0;
  if (term->target && !term->nwaypoint) write_target(out, p, term, term->target);
  // zeros, which a file has to say
  if (!term->target && term->quantity == CAV_QUANTITY_SENSOR && term->use != CAV_USE_RANGE &&
      cav_problem_needs_target(term))
    write_target(out, p, term, (const double[3]){0});
  write_window(out, p, term);
  if (term->body > 0 && !*p->model->body[term->body].name) return 0;
  if (term->body > 0) write_text(out, "body", p->model->body[term->body].name);
  if (term->use == CAV_USE_COST) write_number(out, "weight", term->weight);
  if (term->use == CAV_USE_COST && term->norm != CAV_NORM_SQUARE)
    write_text(out, "norm", cav_problem_norms[term->norm]);
  if (term->use == CAV_USE_RANGE && isfinite(term->lower)) write_number(out, "lower", term->lower);
  if (term->use == CAV_USE_RANGE && isfinite(term->upper)) write_number(out, "upper", term->upper);
  if (term->scale != 1) write_number(out, "scale", term->scale);
  if (term->within > 0 && isfinite(term->within)) write_number(out, "within", term->within);
  if (term->within > 0 && !isfinite(term->within)) write_text(out, "within", "any");
  if (term->quantity == CAV_QUANTITY_TRACK) return write_track(out, p, term);
  if (!term->target || !term->nwaypoint) {
    fputs("/>\n", out);
    return 1;
  }
  fputs(">\n", out);
  for (int i = 0; i < term->nwaypoint; i++) {
    fputs("      <waypoint", out);
    write_number(out, "time", term->waypoint_time[i]);
    write_target(out, p, term, term->target + i * cav_term_target_length(p->model, term));
    fputs("/>\n", out);
  }
  fprintf(out, "    </%s>\n", element);
  return 1;
}

static int has_running(const cav_problem *p, cav_quantity quantity) {
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    if (term->use == CAV_USE_COST && term->quantity == quantity && term->weight > 0 && is_running(p, term)) return 1;
  }
  return 0;
}

// defaults that the problem goes without
static void write_absent(FILE *out, const cav_problem *p) {
  cav_term term[CAV_DEFAULT_TERMS];
  int n = cav_problem_default_terms(term, CAV_DEFAULT_TERMS);
  for (cav_quantity quantity = 0; quantity < CAV_QUANTITY_USER; quantity++) {
    int absent = 0;
    for (int i = 0; i < n; i++) absent |= term[i].quantity == quantity && !has_running(p, quantity);
    if (absent) fprintf(out, "    <%s weight=\"0\"/>\n", cav_quantity_rule_of(quantity)->name);
  }
}

// the term that cannot be written, or -1
static int write_terms(FILE *out, const cav_problem *p) {
  fputs("  <cost>\n", out);
  write_absent(out, p);
  for (int i = 0; i < p->nterm; i++) {
    if (p->term[i].use == CAV_USE_COST && cav_term_counts(&p->term[i]) && !write_term(out, p, &p->term[i])) return i;
  }
  fputs("  </cost>\n", out);
  int hard = 0;
  for (int i = 0; i < p->nterm; i++) {
    if (p->term[i].use == CAV_USE_COST) continue;
    if (!hard++) fputs("  <constraint>\n", out);
    if (!write_term(out, p, &p->term[i])) return i;
  }
  if (hard) fputs("  </constraint>\n", out);
  return -1;
}

static void write_stage(FILE *out, const char *name, const cav_stage_options *stage) {
  int n;
  const cav_field *field = cav_stage_fields(&n);
  fprintf(out, "    <%s", name);
  cav_problem_write_fields(out, field, n, stage);
  fputs("/>\n", out);
}

static void write_contact(FILE *out, const cav_options *o) {
  int n;
  const cav_field *field = cav_option_fields(&n);
  fputs("  <contact", out);
  cav_problem_write_fields(out, field, n, o);
  fputs("/>\n", out);
}

// an element of a scene, as it was read
static void write_element(FILE *out, const cav_xml_node *node, int indent) {
  fprintf(out, "%*s<%s", indent, "", node->rule->name);
  for (int i = 0; i < node->nvalue; i++) write_text(out, node->value[i].rule->name, node->value[i].text);
  fputs(node->child ? ">\n" : "/>\n", out);
  for (const cav_xml_node *c = node->child; c; c = c->next) write_element(out, c, indent + 2);
  if (node->child) fprintf(out, "%*s</%s>\n", indent, "", node->rule->name);
}

char *cav_problem_scene(cav_problem_owner *owner, const cav_xml_node *scene) {
  char *text = NULL, *copy = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  if (!out) return NULL;
  for (const cav_xml_node *c = scene->child; c; c = c->next) write_element(out, c, 4);
  if (fclose(out) == 0) copy = cav_problem_text(owner, text);
  free(text);
  return copy;
}

static void write_guess(FILE *out, const cav_problem *p) {
  const cav_model *m = p->model;
  double rotation[3];
  for (int i = 0; i < 3; i++) rotation[i] = p->guess_rotation[i] * 180 / M_PI;
  int turned = rotation[0] != 0 || rotation[1] != 0 || rotation[2] != 0;
  int bowed = p->guess_bow[0] != 0 || p->guess_bow[1] != 0;
  fputs("  <guess", out);
  write_text(out, "type", cav_problem_guesses[p->guess]);
  if (p->guess_height > 0) write_number(out, "apex", p->guess_height);
  if (p->guess_ground) write_text(out, "ground", "true");
  if (turned) write_numbers(out, "rotation", rotation, 3);
  if (bowed) write_numbers(out, "bow", p->guess_bow, 2);
  if (turned || bowed || p->guess_height > 0) {
    write_number(out, "from", p->guess_from);
    write_number(out, "to", p->guess_to);
  }
  fputs(p->nguess_pose || p->nswing ? ">\n" : "/>\n", out);
  for (int i = 0; i < p->nguess_pose; i++) {
    fputs("    <waypoint", out);
    write_number(out, "time", p->guess_pose[i].time);
    write_numbers(out, "qpos", p->guess_pose[i].q, m->nq);
    fputs("/>\n", out);
  }
  for (int i = 0; i < p->nswing; i++) {
    fputs("    <swing", out);
    write_text(out, "joint", m->joint[p->swing[i].joint].name);
    write_number(out, "amplitude", p->swing[i].amplitude);
    write_number(out, "frequency", p->swing[i].frequency);
    write_number(out, "phase", p->swing[i].phase * 180 / M_PI);
    fputs("/>\n", out);
  }
  if (p->nguess_pose || p->nswing) fputs("  </guess>\n", out);
}

static void write_cycle(FILE *out, const cav_problem *p) {
  const cav_cycle *c = &p->cycle;
  fputs("  <cycle", out);
  write_numbers(out, "translation", c->translation, 3);
  if (c->rotation != 0) write_number(out, "rotation", c->rotation * 180 / M_PI);
  write_text(out, "mirror", cav_problem_mirrors[c->mirror]);
  fputs(c->npair ? ">\n" : "/>\n", out);
  for (int i = 0; i < c->npair; i++) {
    fputs("    <pair", out);
    write_text(out, "joint", p->model->joint[c->pair[i][0]].name);
    write_text(out, "other", p->model->joint[c->pair[i][1]].name);
    fputs("/>\n", out);
  }
  if (c->npair) fputs("  </cycle>\n", out);
}

static void write_head(FILE *out, const cav_problem *p, const char *model_path) {
  const cav_model *m = p->model;
  fputs("<problem", out);
  write_text(out, "name", p->name && *p->name ? p->name : "motion");
  write_text(out, "model", model_path);
  if (p->floating) write_text(out, "floating", "true");
  fputs(">\n", out);
  if (p->scene) fprintf(out, "  <scene>\n%s  </scene>\n", p->scene);
  fputs("  <horizon", out);
  write_number(out, "duration", p->duration);
  write_number(out, "timestep", p->timestep);
  write_text(out, "order", cav_problem_orders[p->order]);
  if (!p->cycle.on) write_text(out, "close", cav_problem_closings[p->close_at_rest != 0]);
  if (p->window > 0) {
    write_number(out, "window", p->window);
    write_number(out, "overlap", p->overlap);
  }
  if (p->duration_most > 0) {
    write_numbers(out, "range", (double[]){p->duration_least, p->duration_most}, 2);
    write_number(out, "weight", p->duration_weight);
  }
  fputs("/>\n", out);
  if (p->cycle.on) write_cycle(out, p);
  fputs("  <start", out);
  write_numbers(out, "qpos", p->q_start, m->nq);
  write_numbers(out, "qvel", p->v_start, m->nv);
  if (p->free_start) write_text(out, "free", "true");
  fputs("/>\n  <goal", out);
  write_numbers(out, "qpos", p->q_goal, m->nq);
  fputs("/>\n", out);
  write_guess(out, p);
}

// 0 if it is of something without a name
static int write_parameter(FILE *out, const cav_problem *p, const cav_parameter *x) {
  static const char *const component[] = {"x", "y", "z"};
  const cav_parameter_rule *rule = cav_parameter_rule_of(x->kind);
  const char *kind = NULL, *name = object_name(p->model, rule->of, x->object, &kind);
  double value = cav_model_parameter(p->model, x);
  fputs("  <parameter", out);
  write_text(out, "type", rule->name);
  if (x->name && *x->name) write_text(out, "name", x->name);
  write_text(out, kind, name ? name : "");
  if (rule->components > 1) write_text(out, "component", component[x->component]);
  write_number(out, "value", value);
  if (x->prior[1] > 0) {
    write_number(out, "sd", x->prior[1]);
    write_number(out, "prior", x->prior[0]);
  }
  int bounded = x->range[0] != 0 || x->range[1] != 0;
  if (bounded && isfinite(x->range[0])) write_number(out, "lower", x->range[0]);
  if (bounded && isfinite(x->range[1])) write_number(out, "upper", x->range[1]);
  fputs("/>\n", out);
  return name != NULL;
}

// number of the parameter that cannot be written, or -1
static int write_parameters(FILE *out, const cav_problem *p) {
  for (int i = 0; i < p->nparameter; i++)
    if (!write_parameter(out, p, &p->parameter[i])) return i;
  return -1;
}

static void write_tail(FILE *out, const cav_problem *p) {
  fputs("  <limits", out);
  write_number(out, "effort", p->effort_limit);
  write_number(out, "margin", p->limit_margin);
  fputs("/>\n", out);
  if (p->residual.force > 0 || p->residual.torque > 0) {
    fputs("  <residual", out);
    if (p->residual.force > 0) write_number(out, "force", p->residual.force);
    if (p->residual.torque > 0) write_number(out, "torque", p->residual.torque);
    write_number(out, "within", p->residual.within);
    fputs("/>\n", out);
  }
  fprintf(out, "  <schedule stages=\"%d\"", p->schedule.stages);
  write_text(out, "sliding", cav_problem_slidings[p->schedule.sliding]);
  write_text(out, "next_gap", cav_problem_next_gaps[p->schedule.next_gap]);
  write_text(out, "next_slip", cav_problem_next_slips[p->schedule.next_slip]);
  write_text(out, "solids", cav_problem_solids[p->schedule.solids]);
  if (p->schedule.kinematics) write_text(out, "kinematics", "true");
  if (p->schedule.light_avoided) write_text(out, "light_avoided", "true");
  if (p->schedule.calm) write_text(out, "calm", "true");
  if (p->schedule.optimality > 0) write_number(out, "optimality", p->schedule.optimality);
  fputs(">\n", out);
  write_stage(out, "first", &p->schedule.first);
  write_stage(out, "last", &p->schedule.last);
  fputs("  </schedule>\n", out);
  for (int i = 0; i < p->nipopt; i++) {
    if (i == 0) fputs("  <ipopt", out);
    write_text(out, p->ipopt[i].name, p->ipopt[i].value);
    if (i == p->nipopt - 1) fputs("/>\n", out);
  }
  if (p->solved) write_contact(out, &p->contact);
  fputs("</problem>\n", out);
}

cav_status cav_problem_write(const char *path, const cav_problem *problem, const char *model_path, cav_error *error) {
  if (!model_path) model_path = problem->model_path;
  if (!model_path)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: not written: the model's file is not known; pass model_path",
                         path);
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  write_head(file.stream, problem, model_path);
  int bad = write_terms(file.stream, problem), nameless = write_parameters(file.stream, problem);
  write_tail(file.stream, problem);
  if (bad < 0 && nameless < 0) return cav_file_end(&file, error);
  cav_file_abandon(&file);
  if (bad < 0)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "%s: not written: parameter %d is of something without a name; name it in the model", path,
                         nameless);
  const char *name = problem->term[bad].name ? problem->term[bad].name : "";
  if (problem->term[bad].quantity == CAV_QUANTITY_USER)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "%s: not written: term %d '%s' is of a quantity of one's own, '%s', and a file cannot name a "
                         "function; leave the term out and add it in code after reading",
                         path, bad, name, problem->term[bad].user->name);
  return cav_file_fail(error, CAV_BAD_INPUT, 0,
                       "%s: not written: term %d '%s' looks at something without a name; name it in the model", path,
                       bad, name);
}
