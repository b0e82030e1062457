/// The reference in Markdown: commands and options, elements and attributes of problem files, terms, sensors, options of the
/// contact law, words, Ipopt's options and roles, each list from the table that declares it.
#include <ctype.h>
#include <string.h>

#include "cavort/solve.h"
#include "exchange.h"
#include "ipopt_options.h"
#include "manual.h"
#include "posture.h"
#include "problem_file.h"
#include "quantity.h"
#include "role.h"

// a cell of a table: no bar ends it, no tag is one, white space collapses
static void print_cell(FILE *out, const char *text) {
  for (; *text; text++) {
    if (*text == '\n' || (*text == ' ' && text[1] == ' ')) continue;
    if (*text == '|')
      fputs("\\|", out);
    else if (*text == '<')
      fputs("&lt;", out);
    else
      fputc(*text, out);
  }
}

// a text as a sentence
static void print_sentence(FILE *out, const char *text) {
  fputc(toupper((unsigned char)*text), out);
  print_cell(out, text + 1);
  fputc('.', out);
}

static void print_row(FILE *out, const char *name, const char *value, const char *fallback, const char *text) {
  fprintf(out, "| `%s` | ", name);
  print_cell(out, value);
  fprintf(out, " | ");
  print_cell(out, fallback);
  fprintf(out, " | ");
  print_cell(out, text);
  fprintf(out, " |\n");
}

// --- the tool ---

static void print_commands(FILE *out, const cav_manual *manual) {
  fprintf(out, "## Commands\n\nExit status: " CAV_MANUAL_EXIT ".\n");
  for (int i = 0; i < manual->ncommand; i++) {
    const cav_manual_command *command = &manual->command[i];
    int n = 0;
    fprintf(out, "\n### cavort %s %s\n\n", command->name, command->operand);
    print_sentence(out, command->text);
    fprintf(out, "\n");
    for (int k = 0; k < manual->noption; k++) {
      const cav_manual_option *option = &manual->option[k];
      if (!(command->options & option->bit)) continue;
      if (!n++) fprintf(out, "\n| option | meaning |\n|---|---|\n");
      fprintf(out, "| `%s%s%s%s", option->brief ? option->brief : "", option->brief ? "`, `" : "", option->name,
              option->value ? " " : "");
      print_cell(out, option->value ? option->value : "");
      fprintf(out, "` | ");
      print_cell(out, option->text);
      fprintf(out, " |\n");
    }
  }
  fprintf(out, "\n### Topics of cavort help\n\n| topic | what it prints |\n|---|---|\n");
  for (int i = 0; i < manual->ntopic; i++)
    fprintf(out, "| `%s` | %s |\n", manual->topic[i].name, manual->topic[i].text);
}

// --- elements ---

static void print_table_head(FILE *out, int *n) {
  if (!(*n)++) fprintf(out, "\n| attribute | values | default | meaning |\n|---|---|---|---|\n");
}

static void print_attribute(FILE *out, const cav_xml_attribute *a) {
  char value[CAV_MANUAL_VALUE];
  cav_manual_value(a, value);
  print_row(out, a->name, value, a->required ? "required" : a->note->fallback, a->note->text);
}

// attributes that all children have are told once, at their parent
static void print_attributes(FILE *out, const cav_manual_place *place) {
  const cav_xml_element *e = place->element;
  int n = 0, common = 0;
  for (const cav_xml_attribute *a = e->attribute; a && a->name; a++) {
    if (place->nparent == 1 && cav_manual_common(place->parent[0], a)) {
      common++;
      continue;
    }
    print_table_head(out, &n);
    print_attribute(out, a);
  }
  if (common) fprintf(out, "\nAnd what every child of `%s` has.\n", place->parent[0]->name);
}

static void print_common(FILE *out, const cav_xml_element *e) {
  int n = 0;
  if (!e->child || !e->child[0]) return;
  for (const cav_xml_attribute *a = e->child[0]->attribute; a && a->name; a++) {
    if (!a->note || !cav_manual_common(e, a)) continue;
    if (!n) fprintf(out, "\nAll children have:\n");
    print_table_head(out, &n);
    print_attribute(out, a);
  }
}

static void print_element(FILE *out, const cav_manual_place *place) {
  const cav_xml_element *e = place->element;
  fprintf(out, "\n### %s", e->name);
  cav_manual_parents(out, place, "", "");
  fprintf(out, "\n\n");
  print_sentence(out, e->text);
  fprintf(out, " %s\n", e->min ? "Exactly one." : e->max == 1 ? "At most one." : "Any number.");
  print_attributes(out, place);
  if (!e->child) return;
  fprintf(out, "\nHolds");
  for (int i = 0; e->child[i]; i++) fprintf(out, "%s`%s`", i ? ", " : " ", e->child[i]->name);
  fprintf(out, ".\n");
  print_common(out, e);
}

static void print_elements(FILE *out) {
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  int n = cav_manual_places(place);
  fprintf(out,
          "\n## Elements of problem files and marker sets\n\nValues in parentheses say in words what holds where the "
          "attribute is left "
          "out.\n");
  for (int i = 0; i < n; i++) {
    const cav_manual_place *twin = cav_manual_twin(place, i);
    if (!twin) {
      print_element(out, &place[i]);
      continue;
    }
    fprintf(out, "\n### %s in %s\n\nAs in `%s`, but for what every child of `%s` has.\n", place[i].element->name,
            place[i].parent[0]->name, twin->parent[0]->name, place[i].parent[0]->name);
    int rows = 0;
    for (const cav_xml_attribute *a = place[i].element->attribute; a && a->name; a++) {
      if (cav_manual_attribute(twin->element, a->name) || cav_manual_common(place[i].parent[0], a)) continue;
      print_table_head(out, &rows);
      print_attribute(out, a);
    }
  }
}

// --- terms, sensors, options, words ---

static void print_terms(FILE *out) {
  fprintf(out,
          "\n## Terms\n\n| term | unit | default weight | constraint | what it measures |\n|---|---|---|---|---|\n");
  cav_term term[CAV_DEFAULT_TERMS];
  int terms = cav_problem_default_terms(term, CAV_DEFAULT_TERMS);
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++) {
    const cav_quantity_rule *rule = cav_quantity_rule_of(k);
    int n = 0;
    fprintf(out, "| `%s` | %s | ", rule->name, rule->unit);
    for (int i = 0; i < terms; i++) {
      if (term[i].quantity != k) continue;
      fprintf(out, "%s%g", n++ ? ", " : "", term[i].weight);
      if (strcmp(term[i].name, rule->name)) fprintf(out, " (%s)", term[i].name);
    }
    fprintf(out, "%s | %s | ", n ? "" : "none", rule->hard ? "too" : "no");
    print_cell(out, rule->text);
    fprintf(out, " |\n");
  }
}

static void print_sensors(FILE *out) {
  static const char *const stage[] = {
      [CAV_READS_POSITION] = "q", [CAV_READS_VELOCITY] = "q, v'", [CAV_READS_ACCELERATION] = "q, v, v'"};
  fprintf(out, "\n## Sensors\n\n| type | numbers | looks at | reads | unit and meaning |\n|---|---|---|---|---|\n");
  for (cav_sensor_type k = 0; k < CAV_SENSOR_TYPES; k++) {
    const cav_sensor_rule *rule = cav_sensor_rule_of(k);
    fprintf(out, "| `%s` | %d | %s | %s | ", rule->name, rule->dim, cav_manual_target(rule->target),
            stage[rule->stage]);
    print_cell(out, rule->text);
    fprintf(out, " |\n");
  }
}

static void print_words(FILE *out) {
  static const struct {
    const char *of, *word, *text;
  } words[] = {
#define WORD_ROW(enumerator, word, text) {WORD_OF, word, text},
#define WORD_OF "order"
      CAV_ORDERS(WORD_ROW)
#undef WORD_OF
#define WORD_OF "spring"
          CAV_SPRINGS(WORD_ROW)
#undef WORD_OF
#define WORD_OF "stabilisation"
              CAV_STABILISATIONS(WORD_ROW)
#undef WORD_OF
#define WORD_OF "regulariser"
                  CAV_REGULARISERS(WORD_ROW)
#undef WORD_OF
#define WORD_OF "sliding"
                      CAV_SLIDINGS(WORD_ROW)
#undef WORD_OF
#define WORD_OF "next_gap"
                          CAV_NEXT_GAPS(WORD_ROW)
#undef WORD_OF
#define WORD_OF "next_slip"
                              CAV_NEXT_SLIPS(WORD_ROW)
#undef WORD_OF
  };
  fprintf(out, "\n## Words of options\n\n| option | word | meaning |\n|---|---|---|\n");
  for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
    fprintf(out, "| `%s` | `%s` | ", words[i].of, words[i].word);
    print_cell(out, words[i].text);
    fprintf(out, " |\n");
  }
}

static void print_solvers(FILE *out) {
  fprintf(out, "\n## Solvers\n\n| `--solver` | what it does |\n|---|---|\n");
  for (cav_solver i = 0; i < CAV_SOLVER_TYPES; i++)
    fprintf(out, "| `%s` | %s |\n", cav_solver_rule_of(i)->name, cav_solver_rule_of(i)->text);
}

static void print_formats(FILE *out) {
  fprintf(out, "\n## Formats of cavort export\n\n| `--to` | file | what it holds |\n|---|---|---|\n");
  for (cav_exchange k = 0; k < CAV_EXCHANGE_FORMATS; k++) {
    const cav_exchange_rule *rule = cav_exchange_rule_of(k);
    fprintf(out, "| `%s` | `%s` | ", rule->name, rule->file);
    print_cell(out, rule->text);
    fprintf(out, " |\n");
  }
}

static void print_roles(FILE *out) {
  fprintf(out,
          "\n## Roles\n\nNames that stand for a body of any humanoid, quadruped or arm where the model has no body of "
          "that name:");
  for (cav_role r = 0; r < CAV_ROLE_TYPES; r++) fprintf(out, "%s`%s`", r ? ", " : " ", cav_role_name(r));
  fprintf(out, ".\n");
}

static void print_postures(FILE *out) {
  fprintf(out,
          "\n## Postures\n\nNames for `key` that are found for any humanoid with a free root, `stand` and `lie` of "
          "quadrupeds too, where neither\nthe file nor the model has a posture of that name. "
          "`joint`s inside lie over it, as those of a leg that is\nlifted.\n\n| name | posture "
          "|\n|---|---|\n| `stand` | nearly straight on both or all four feet |\n");
  for (int i = 0; cav_posture_names[i]; i++)
    fprintf(out, "| `%s` | %s |\n", cav_posture_names[i], cav_posture_meaning(cav_posture_names[i]));
}

void cav_manual_reference(FILE *out, const cav_manual *manual) {
  fprintf(out,
          "# Reference\n\nCommands and their options, and all that a problem file may say. Printed by `cavort help "
          "reference` from the tables by\nwhich the tool reads; `cavort help NAME` tells of one of them.\n\n");
  print_commands(out, manual);
  print_solvers(out);
  print_formats(out);
  print_elements(out);
  print_terms(out);
  print_sensors(out);
  print_words(out);
  print_roles(out);
  print_postures(out);
}
