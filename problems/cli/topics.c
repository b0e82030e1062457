/// Topics of cavort help: what problem files may say, printed from the tables that reading and writing use. Nothing is
/// told here that a table does not say.
#include <stdio.h>
#include <string.h>

#include "command.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"

static const cav_xml_element *child_of(const cav_xml_element *element, const char *name) {
  for (int i = 0; element && element->child && element->child[i]; i++)
    if (!strcmp(element->child[i]->name, name)) return element->child[i];
  return NULL;
}

static void print_attributes(const cav_xml_element *element) {
  for (int i = 0; element && element->attribute[i].name; i++)
    printf("%s%s%s", i ? ", " : "", element->attribute[i].name, element->attribute[i].required ? "*" : "");
  printf("\n");
}

// weights of the default costs of a quantity
static void print_defaults(cav_quantity quantity, const char *name) {
  cav_term term[CAV_DEFAULT_TERMS];
  int n = 0, terms = cav_problem_default_terms(term, CAV_DEFAULT_TERMS);
  for (int i = 0; i < terms; i++) {
    if (term[i].quantity != quantity) continue;
    printf("%s%g", n++ ? ", " : "; default weight ", term[i].weight);
    if (strcmp(term[i].name, name)) printf(" (%s)", term[i].name);
  }
}

static void print_terms(void) {
  printf("terms of <cost> and, where marked, of <constraint>: element, unit, what it measures\n");
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++) {
    const cav_quantity_rule *rule = cav_quantity_rule_of(k);
    printf("  %-17s %-16s %s", rule->name, rule->unit, rule->text);
    print_defaults(k, rule->name);
    printf("%s\n", rule->hard ? "; constraint too" : "");
  }
  printf("\nattributes, * required\n");
  const cav_xml_element *cost = child_of(&cav_problem_element, "cost");
  const cav_xml_element *hard = child_of(&cav_problem_element, "constraint");
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++) {
    const char *name = cav_quantity_rule_of(k)->name;
    printf("  %-17s ", name);
    print_attributes(child_of(cost, name));
    if (!child_of(hard, name)) continue;
    printf("    as constraint   ");
    print_attributes(child_of(hard, name));
  }
}

// what a sensor looks at, in the attributes that name one
static const char *target_text(cav_sensor_target target) {
  switch (target) {
    case CAV_TARGET_NONE:
      break;
    case CAV_TARGET_FRAME:
      return "body, xbody, geom, site";
    case CAV_TARGET_BODY:
      return "body";
    case CAV_TARGET_SITE:
      return "site";
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

static void print_sensors(void) {
  static const char *const stage[] = {
      [CAV_READS_POSITION] = "q", [CAV_READS_VELOCITY] = "q, v'", [CAV_READS_ACCELERATION] = "q, v, v'"};
  printf("types of sensors: name, numbers, what it looks at, what it reads, unit and meaning\n");
  for (cav_sensor_type k = 0; k < CAV_SENSOR_TYPES; k++) {
    const cav_sensor_rule *rule = cav_sensor_rule_of(k);
    printf("  %-15s %d  %-24s %-9s %s\n", rule->name, rule->dim, target_text(rule->target), stage[rule->stage],
           rule->text);
  }
}

static void print_range(const cav_field *field) {
  if (field->type == CAV_FIELD_FLAG) printf("true, false");
  for (int i = 0; field->words && field->words[i]; i++) printf("%s%s", i ? ", " : "", field->words[i]);
  if (field->type == CAV_FIELD_FLAG || field->words) return;
  printf(field->least == DBL_MIN ? "above 0" : "%g or more", field->least);
  if (field->most <= 1) printf(", up to %g", field->most);
}

static void print_contact(void) {
  int n;
  const cav_field *field = cav_option_fields(&n);
  printf("options of an evaluation, in C cav_options, in result folders <contact>: name, unit, values, meaning\n");
  for (int i = 0; i < n; i++, field++) {
    printf("  %-15s %-3s ", field->name, field->unit);
    print_range(field);
    printf(": %s\n", field->text);
  }
}

static void print_value(const cav_field *field, const cav_stage_options *stage) {
  const char *at = (const char *)stage + field->offset;
  printf("%g", field->type == CAV_FIELD_REAL ? *(const double *)(const void *)at : *(const int *)(const void *)at);
}

static void print_schedule(void) {
  int n;
  const cav_field *field = cav_stage_fields(&n);
  const cav_schedule schedule = cav_problem_default(NULL).schedule;
  printf("options of the first and the last stage of <schedule stages=\"%d\">: name, defaults, unit, values, meaning\n",
         schedule.stages);
  for (int i = 0; i < n; i++, field++) {
    printf("  %-15s ", field->name);
    print_value(field, &schedule.first);
    printf(" to ");
    print_value(field, &schedule.last);
    printf(" %s%s", field->unit, *field->unit ? " " : "");
    printf("(");
    print_range(field);
    printf("): %s\n", field->text);
  }
}

static const struct {
  const char *name, *text;
  void (*print)(void);
} topics[] = {
    {"terms", "costs and constraints of a problem file", print_terms},
    {"sensors", "types of sensors that terms and models have", print_sensors},
    {"schedule", "options of the stages of a solve", print_schedule},
    {"contact", "options of an evaluation of the dynamics", print_contact},
};
enum { NTOPIC = sizeof topics / sizeof *topics };

int cav_topic_print(const char *name) {
  for (int i = 0; i < NTOPIC; i++) {
    if (strcmp(topics[i].name, name)) continue;
    topics[i].print();
    return 1;
  }
  return 0;
}

const char *cav_topic_nearest(const char *word) { return cav_xml_nearest(word, &topics->name, NTOPIC, sizeof *topics); }

void cav_topics_print(void) {
  printf("topics of cavort help\n");
  for (int i = 0; i < NTOPIC; i++) printf("  %-18s %s\n", topics[i].name, topics[i].text);
  printf("\n");
}
