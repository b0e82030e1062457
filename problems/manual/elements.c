/// Elements and attributes of problem files and marker sets as help tells them, by the grammars that read them. What a
/// <scene> holds is MJCF and has no texts here.
#include <assert.h>
#include <string.h>

#include "cavort/model.h"
#include "manual.h"
#include "marker_set.h"
#include "problem_file.h"

// adds an element below a parent, and what stands in it
static int add_place(cav_manual_place *place, int n, const cav_xml_element *element, const cav_xml_element *parent) {
  int at = 0;
  while (at < n && place[at].element != element) at++;
  assert(at < CAV_MANUAL_ELEMENTS);
  int known = at < n;
  if (!known) place[n++] = (cav_manual_place){.element = element};
  assert(place[at].nparent < CAV_MANUAL_PARENTS);
  if (parent) place[at].parent[place[at].nparent++] = parent;
  for (int i = 0; !known && element->child && element->child[i]; i++)
    if (element->child[i]->text) n = add_place(place, n, element->child[i], element);
  return n;
}

int cav_manual_places(cav_manual_place place[CAV_MANUAL_ELEMENTS]) {
  return add_place(place, add_place(place, 0, &cav_problem_element, NULL), &cav_markers_element, NULL);
}

const cav_xml_attribute *cav_manual_attribute(const cav_xml_element *element, const char *name) {
  for (const cav_xml_attribute *a = element->attribute; a && a->name; a++)
    if (!strcmp(a->name, name)) return a;
  return NULL;
}

static int same_note(const cav_xml_attribute *a, const cav_xml_attribute *b) {
  const char *x = a->note->fallback, *y = b->note->fallback;
  return !strcmp(a->note->text, b->note->text) && a->required == b->required && (x && y ? !strcmp(x, y) : x == y);
}

int cav_manual_common(const cav_xml_element *parent, const cav_xml_attribute *attribute) {
  int n = 0;
  for (; parent->child && parent->child[n]; n++) {
    const cav_xml_attribute *other = cav_manual_attribute(parent->child[n], attribute->name);
    if (!other || !same_note(other, attribute)) return 0;
  }
  return n > 1;
}

static void append(char text[CAV_MANUAL_VALUE], const char *more) {
  size_t n = strlen(text);
  snprintf(text + n, CAV_MANUAL_VALUE - n, "%s", more);
}

static void append_words(const char *const *words, char text[CAV_MANUAL_VALUE]) {
  int n = 0;
  while (words[n]) n++;
  // those of many have a list of their own
  if (n == CAV_SENSOR_TYPES) append(text, "a type of sensor");
  for (int i = 0; i < n && n != CAV_SENSOR_TYPES; i++) {
    if (i) append(text, ", ");
    append(text, words[i]);
  }
}

void cav_manual_value(const cav_xml_attribute *attribute, char text[CAV_MANUAL_VALUE]) {
  const char *kind = attribute->type == CAV_XML_INT ? "whole number" : "number";
  *text = 0;
  switch (attribute->type) {
    case CAV_XML_TEXT:
    case CAV_XML_SKIP:
      append(text, "text");
      break;
    case CAV_XML_WORD:
      append_words(attribute->words, text);
      break;
    case CAV_XML_BOOL:
      append(text, "true, false");
      break;
    case CAV_XML_INT:
    case CAV_XML_REAL:
      if (attribute->max == 1)
        append(text, kind);
      else if (attribute->max > 1)
        snprintf(text, CAV_MANUAL_VALUE, "%d %ss", attribute->max, kind);
      else
        snprintf(text, CAV_MANUAL_VALUE, "%ss", kind);
      break;
  }
  if (!attribute->note || !*attribute->note->unit) return;
  append(text, ", ");
  append(text, attribute->note->unit);
}

const cav_manual_place *cav_manual_twin(const cav_manual_place *place, int i) {
  for (int k = 0; k < i; k++)
    if (!strcmp(place[k].element->name, place[i].element->name) && place[k].element->text == place[i].element->text)
      return &place[k];
  return NULL;
}

void cav_manual_parents(FILE *out, const cav_manual_place *place, const char *before, const char *after) {
  for (int i = 0; i < place->nparent; i++) {
    int told = 0;
    for (int k = 0; k < i && !told; k++) told = !strcmp(place->parent[k]->name, place->parent[i]->name);
    if (!told) fprintf(out, "%s%s%s%s", i ? ", " : " in ", before, place->parent[i]->name, after);
  }
}

// one line of an attribute, its name padded
static void print_attribute(FILE *out, const cav_xml_attribute *a) {
  char name[64], value[CAV_MANUAL_VALUE];
  const char *fallback = a->note->fallback;
  snprintf(name, sizeof name, "%s%s", a->name, a->required ? " *" : "");
  cav_manual_value(a, value);
  fprintf(out, "  %-16s %s", name, value);
  // what is chosen among several has no default
  if (fallback && *fallback == '(')
    fprintf(out, "; %s%.*s", strncmp(fallback, "(give ", 6) ? "default: " : "", (int)strlen(fallback) - 2,
            fallback + 1);
  else if (fallback)
    fprintf(out, "; default %s", fallback);
  fprintf(out, "\n%19s%s\n", "", a->note->text);
}

// names of the attributes that all children have
static void print_common(FILE *out, const cav_xml_element *e) {
  int n = 0;
  for (const cav_xml_attribute *a = e->child ? e->child[0]->attribute : NULL; a && a->name; a++)
    if (a->note && cav_manual_common(e, a)) fprintf(out, "%s%s", n++ ? ", " : "  all of these have ", a->name);
  if (n) fprintf(out, "\n");
}

static void print_element(FILE *out, const cav_manual_place *place, const cav_manual_place *twin) {
  const cav_xml_element *e = place->element;
  fprintf(out, "<%s>", e->name);
  cav_manual_parents(out, place, "<", ">");
  fprintf(out, ": %s%s\n", e->text, twin ? "; attributes as above, but for" : "");
  for (const cav_xml_attribute *a = e->attribute; a && a->name; a++)
    if (!twin || !cav_manual_attribute(twin->element, a->name)) print_attribute(out, a);
  for (const cav_xml_attribute *a = twin ? twin->element->attribute : NULL; a && a->name; a++)
    if (!cav_manual_attribute(e, a->name)) fprintf(out, "  no %s\n", a->name);
  for (int i = 0; !twin && e->child && e->child[i]; i++)
    fprintf(out, "%s<%s>%s", i ? ", " : "  holds ", e->child[i]->name, e->child[i + 1] ? "" : "\n");
  if (!twin) print_common(out, e);
}

// whether an attribute of that meaning was told of an element before
static int told_before(const cav_manual_place *place, int i, const cav_xml_attribute *a) {
  for (int k = 0; k < i; k++) {
    const cav_xml_attribute *other = cav_manual_attribute(place[k].element, a->name);
    if (other && same_note(a, other)) return 1;
  }
  return 0;
}

// whether an element of that name was told before as one that has an attribute of that meaning
static int named_before(const cav_manual_place *place, int from, int k, const cav_xml_attribute *a) {
  for (int i = from; i < k; i++) {
    const cav_xml_attribute *other = cav_manual_attribute(place[i].element, a->name);
    if (other && same_note(a, other) && !strcmp(place[i].element->name, place[k].element->name)) return 1;
  }
  return 0;
}

// an attribute once for each meaning, with the elements that have it; where of two terms the constraint alone does, in what
static int explain_attribute(FILE *out, const cav_manual_place *place, int n, const char *name) {
  int told = 0;
  for (int i = 0; i < n; i++) {
    const cav_xml_attribute *a = cav_manual_attribute(place[i].element, name);
    if (!a || told_before(place, i, a)) continue;
    const cav_manual_place *under = NULL;
    fprintf(out, "attribute %s of", name);
    for (int k = i; k < n; k++) {
      const cav_xml_attribute *other = cav_manual_attribute(place[k].element, name);
      if (!other || !same_note(a, other) || named_before(place, i, k, a)) continue;
      fprintf(out, " <%s>", place[k].element->name);
      if (cav_manual_twin(place, k)) under = &place[k];
    }
    if (under) cav_manual_parents(out, under, "<", ">");
    fprintf(out, "\n");
    print_attribute(out, a);
    told++;
  }
  return told;
}

int cav_manual_explain(FILE *out, const char *name) {
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  int n = cav_manual_places(place), told = 0;
  for (int i = 0; i < n; i++) {
    if (strcmp(place[i].element->name, name)) continue;
    print_element(out, &place[i], cav_manual_twin(place, i));
    told++;
  }
  told += explain_attribute(out, place, n, name);
  for (cav_sensor_type k = 0; k < CAV_SENSOR_TYPES; k++) {
    const cav_sensor_rule *rule = cav_sensor_rule_of(k);
    if (strcmp(rule->name, name)) continue;
    fprintf(out, "type of sensor %s: %d number%s, %s\n", name, rule->dim, rule->dim > 1 ? "s" : "", rule->text);
    told++;
  }
  return told;
}

const char *cav_manual_nearest(const cav_manual *manual, const char *word) {
  enum { NAMES = 1500 };
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  const char *name[NAMES];
  const int n = cav_manual_places(place);
  int names = 0;
  for (int i = 0; i < manual->ncommand; i++) name[names++] = manual->command[i].name;
  for (int i = 0; i < manual->ntopic; i++) name[names++] = manual->topic[i].name;
  for (int i = 0; i < n; i++) {
    assert(names < NAMES);
    name[names++] = place[i].element->name;
    for (const cav_xml_attribute *a = place[i].element->attribute; a && a->name && names < NAMES; a++)
      name[names++] = a->name;
  }
  return cav_xml_nearest(word, name, names, sizeof *name);
}
