/// Topics of cavort help: what problem files may say, printed from the tables that reading and writing use.
#include <stdio.h>
#include <string.h>

#include "ipopt_options.h"
#include "manual.h"
#include "posture.h"
#include "problem_file.h"
#include "quantity.h"
#include "role.h"

static const cav_xml_element *child_of(const cav_xml_element *element, const char *name) {
  for (int i = 0; element && element->child && element->child[i]; i++)
    if (!strcmp(element->child[i]->name, name)) return element->child[i];
  return NULL;
}

static void print_attributes(FILE *out, const cav_xml_element *element) {
  for (int i = 0; element && element->attribute[i].name; i++)
    fprintf(out, "%s%s%s", i ? ", " : "", element->attribute[i].name, element->attribute[i].required ? "*" : "");
  fprintf(out, "\n");
}

// weights of the default costs of a quantity
static void print_defaults(FILE *out, cav_quantity quantity, const char *name) {
  cav_term term[CAV_DEFAULT_TERMS];
  int n = 0, terms = cav_problem_default_terms(term, CAV_DEFAULT_TERMS);
  for (int i = 0; i < terms; i++) {
    if (term[i].quantity != quantity) continue;
    fprintf(out, "%s%g", n++ ? ", " : "; default weight ", term[i].weight);
    if (strcmp(term[i].name, name)) fprintf(out, " (%s)", term[i].name);
  }
}

static void print_terms(FILE *out, const cav_manual *manual) {
  (void)manual;
  fprintf(out, "terms of <cost> and, where marked, of <constraint>: element, unit, what it measures\n");
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++) {
    const cav_quantity_rule *rule = cav_quantity_rule_of(k);
    fprintf(out, "  %-17s %-16s %s", rule->name, rule->unit, rule->text);
    print_defaults(out, k, rule->name);
    fprintf(out, "%s\n", rule->hard ? "; constraint too" : "");
  }
  fprintf(out, "\nattributes, * required\n");
  const cav_xml_element *cost = child_of(&cav_problem_element, "cost");
  const cav_xml_element *hard = child_of(&cav_problem_element, "constraint");
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++) {
    const char *name = cav_quantity_rule_of(k)->name;
    fprintf(out, "  %-17s ", name);
    print_attributes(out, child_of(cost, name));
    if (!child_of(hard, name)) continue;
    fprintf(out, "    as constraint   ");
    print_attributes(out, child_of(hard, name));
  }
}

// what a sensor looks at, in the attributes that name one
const char *cav_manual_target(cav_sensor_target target) {
  switch (target) {
    case CAV_TARGET_NONE:
      break;
    case CAV_TARGET_FRAME:
      return "body, xbody, geom, site";
    case CAV_TARGET_BODY:
      return "body";
    case CAV_TARGET_SITE:
      return "site";
    case CAV_TARGET_SURFACE:
      return "body, geom, site";
    case CAV_TARGET_SCALAR_JOINT:
      return "joint (hinge, slide)";
    case CAV_TARGET_BALL_JOINT:
      return "joint (ball)";
    case CAV_TARGET_LIMITED_JOINT:
      return "joint (limited)";
    case CAV_TARGET_TENDON:
      return "tendon";
    case CAV_TARGET_LIMITED_TENDON:
      return "tendon (limited)";
    case CAV_TARGET_ACTUATOR:
      return "actuator";
  }
  return "";
}

static void print_sensors(FILE *out, const cav_manual *manual) {
  (void)manual;
  static const char *const stage[] = {
      [CAV_READS_POSITION] = "q", [CAV_READS_VELOCITY] = "q, v'", [CAV_READS_ACCELERATION] = "q, v, v'"};
  fprintf(out, "types of sensors: name, numbers, what it looks at, what it reads, unit and meaning\n");
  for (cav_sensor_type k = 0; k < CAV_SENSOR_TYPES; k++) {
    const cav_sensor_rule *rule = cav_sensor_rule_of(k);
    fprintf(out, "  %-15s %d  %-24s %-9s %s\n", rule->name, rule->dim, cav_manual_target(rule->target),
            stage[rule->stage], rule->text);
  }
}

static void print_range(FILE *out, const cav_field *field) {
  if (field->type == CAV_FIELD_FLAG) fprintf(out, "true, false");
  for (int i = 0; field->words && field->words[i]; i++) fprintf(out, "%s%s", i ? ", " : "", field->words[i]);
  if (field->type == CAV_FIELD_FLAG || field->words) return;
  fprintf(out, field->least == DBL_MIN ? "above 0" : "%g or more", field->least);
  if (field->most <= 1) fprintf(out, ", up to %g", field->most);
}

static void print_contact(FILE *out, const cav_manual *manual) {
  (void)manual;
  int n;
  const cav_field *field = cav_option_fields(&n);
  fprintf(out,
          "options of an evaluation, in C cav_options, in result folders <contact>: name, unit, values, meaning\n");
  for (int i = 0; i < n; i++, field++) {
    fprintf(out, "  %-15s %-3s ", field->name, field->unit);
    print_range(out, field);
    fprintf(out, ": %s\n", field->text);
  }
}

static void print_value(FILE *out, const cav_field *field, const cav_stage_options *stage) {
  const char *at = (const char *)stage + field->offset;
  fprintf(out, "%g",
          field->type == CAV_FIELD_REAL ? *(const double *)(const void *)at : *(const int *)(const void *)at);
}

static void print_schedule(FILE *out, const cav_manual *manual) {
  (void)manual;
  int n;
  const cav_field *field = cav_stage_fields(&n);
  const cav_schedule schedule = cav_problem_default(NULL).schedule;
  fprintf(
      out,
      "options of the first and the last stage of <schedule stages=\"%d\">: name, defaults, unit, values, meaning\n",
      schedule.stages);
  for (int i = 0; i < n; i++, field++) {
    fprintf(out, "  %-15s ", field->name);
    print_value(out, field, &schedule.first);
    fprintf(out, " to ");
    print_value(out, field, &schedule.last);
    fprintf(out, " %s%s", field->unit, *field->unit ? " " : "");
    fprintf(out, "(");
    print_range(out, field);
    fprintf(out, "): %s\n", field->text);
  }
}

// every element with the elements that hold it
static void print_elements(FILE *out, const cav_manual *manual) {
  (void)manual;
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  int n = cav_manual_places(place);
  fprintf(out, "elements of a problem file: name, where it stands, meaning; attributes: cavort help ELEMENT\n");
  for (int i = 0; i < n; i++) {
    fprintf(out, "  %-17s", place[i].element->name);
    cav_manual_parents(out, &place[i], "", "");
    fprintf(out, ": %s\n", place[i].element->text);
  }
}

static void print_ipopt(FILE *out, const cav_manual *manual) {
  (void)manual;
  int n;
  const cav_ipopt_rule *rule = cav_ipopt_rules(&n);
  fprintf(out, "options of Ipopt in <ipopt> and --ipopt NAME=VALUE: name, values, meaning\n");
  for (int i = 0; i < n; i++, rule++) {
    fprintf(out, "  %-32s ", rule->name);
    if (rule->type == CAV_IPOPT_WORD)
      fprintf(out, "%s", rule->words);
    else
      fprintf(out, "%s%s %g", rule->type == CAV_IPOPT_WHOLE ? "whole number, " : "", rule->strict ? "above" : "from",
              rule->least);
    if (rule->type != CAV_IPOPT_WORD && rule->most < 1e9) fprintf(out, " up to %g", rule->most);
    fprintf(out, ": %s\n", rule->text);
  }
}

static void print_roles(FILE *out, const cav_manual *manual) {
  (void)manual;
  fprintf(
      out,
      "roles: names that stand for a body of any humanoid, quadruped or arm, after the model's own names; found by\n"
      "structure, cavort inspect MODEL lists them\n");
  for (cav_role r = 0; r < CAV_ROLE_TYPES; r++) fprintf(out, "  %s\n", cav_role_name(r));
}

static void print_postures(FILE *out, const cav_manual *manual) {
  (void)manual;
  fprintf(out,
          "postures: key= of <start>, <goal>, <pose> and waypoints, after the file's poses and the model's keyframes; "
          "found\n"
          "for any humanoid with a free root, where nothing else is said\n"
          "  %-11s nearly straight on both or all four feet\n",
          "stand");
  for (int i = 0; cav_posture_names[i]; i++)
    fprintf(out, "  %-11s %s\n", cav_posture_names[i], cav_posture_meaning(cav_posture_names[i]));
  fprintf(out,
          "joints inside lie over it, as of a leg that is lifted: <start key=\"stand\" height=\"floor\">\n"
          "  <joint name=\"NAME\" degrees=\"-60\"/></start>\n");
}

static void print_schema(FILE *out, const cav_manual *manual) {
  (void)manual;
  cav_manual_schema(out);
}

static const cav_manual_topic topics[] = {
    {"elements", "elements of a problem file", print_elements},
    {"terms", "costs and constraints of a problem file", print_terms},
    {"sensors", "types of sensors that terms and models have", print_sensors},
    {"schedule", "options of the stages of a solve", print_schedule},
    {"contact", "options of an evaluation of the dynamics", print_contact},
    {"ipopt", "options of Ipopt", print_ipopt},
    {"roles", "names of bodies that serve any model", print_roles},
    {"postures", "names of postures that serve any humanoid", print_postures},
    {"reference", "all of it, in Markdown", cav_manual_reference},
    {"xsd", "schema of problem files for editors (XSD)", print_schema},
    {"man", "the man page, in roff", cav_manual_man_page},
    {"bash", "completion for bash", cav_manual_bash},
    {"zsh", "completion for zsh", cav_manual_zsh},
};

const cav_manual_topic *cav_manual_topics(int *n) {
  *n = sizeof topics / sizeof *topics;
  return topics;
}
