/// Attributes of an XML tag against the table: numbers, words and texts, converted. Which elements may stand where is
/// for xml.c, what a complaint says about a wrong name for xml_complaint.c.
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "xml_parts.h"

// "2 numbers", "1 to 3 numbers", "numbers"
static void describe_count(char *text, size_t room, const cav_xml_attribute *rule) {
  const char *kind = rule->type == CAV_XML_INT ? "whole number" : "number";
  if (rule->max == 0)
    snprintf(text, room, "%ss", kind);
  else if (rule->min == rule->max)
    snprintf(text, room, "%d %s%s", rule->min, kind, rule->min == 1 ? "" : "s");
  else
    snprintf(text, room, "%d to %d %ss", rule->min, rule->max, kind);
}

// one number from text, moved behind it; 0 if it is none
static int read_number(const char **text, cav_xml_type type, double *number) {
  const char *p = *text;
  size_t length = strcspn(p, " \t\r\n");
  char *end;
  // strtod would also take hexadecimal, infinity and nan
  if (strspn(p, "+-.0123456789eE") < length) return 0;
  if (type == CAV_XML_INT) {
    errno = 0;
    long value = strtol(p, &end, 10);
    if (errno || value < INT_MIN || value > INT_MAX) return 0;
    *number = (double)value;
  } else {
    *number = strtod(p, &end);
    if (!isfinite(*number)) return 0;
  }
  if (end != p + length || length == 0) return 0;
  *text = end;
  return 1;
}

// what to do about numbers that cannot be read
static const char *how_to_write(const cav_xml_value *value, const char *else_this) {
  return strchr(value->text, ',') ? "numbers stand apart by spaces, without commas, and have a decimal point"
                                  : else_this;
}

static void read_numbers(cav_xml_source *s, int line, const char *element, cav_xml_value *value) {
  const cav_xml_attribute *rule = value->rule;
  char expected[64];
  describe_count(expected, sizeof expected, rule);

  // as many words as there are starts of words
  int count = 0;
  for (const char *p = value->text; *p; p++) count += !is_space(*p) && (p == value->text || is_space(p[-1]));
  if (count < rule->min || (rule->max && count > rule->max)) {
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, element, rule->name, "expected %s, got %d in '%.60s'; %s", expected,
                        count, value->text, how_to_write(value, "give the right number of values"));
    return;
  }
  double *number = cav_xml_carve(s->reader->xml, sizeof(double) * (size_t)(count ? count : 1));
  if (!number) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, line, element, rule->name, "no memory for %d numbers", count);
    return;
  }
  const char *p = value->text;
  for (int i = 0; i < count; i++) {
    while (is_space(*p)) p++;
    if (!read_number(&p, rule->type, &number[i])) {
      cav_xml_source_fail(s, CAV_BAD_INPUT, line, element, rule->name, "expected %s, got '%.*s'; %s", expected,
                          (int)strcspn(p, " \t\r\n") < 60 ? (int)strcspn(p, " \t\r\n") : 60, p,
                          how_to_write(value, rule->type == CAV_XML_INT ? "write finite decimal whole numbers"
                                                                        : "write finite decimal numbers"));
      return;
    }
  }
  value->number = number;
  value->count = count;
}

static void read_word(cav_xml_source *s, int line, const char *element, cav_xml_value *value) {
  static const char *const truth[] = {"false", "true", NULL};
  const char *const *words = value->rule->type == CAV_XML_BOOL ? truth : value->rule->words;
  int n = 0;
  for (; words[n]; n++) {
    if (strcmp(words[n], value->text)) continue;
    value->word = n;
    value->count = 1;
    return;
  }
  cav_xml_unknown_word(s, line, element, value, words, n);
}

// attribute of an open element that the table does not know: only its name is kept
static void keep_stranger(cav_xml_source *s, int line, const cav_xml_element *rule, const char *name,
                          cav_xml_value *value) {
  cav_xml_attribute *stranger = cav_xml_carve(s->reader->xml, sizeof *stranger);
  char *copy = cav_xml_carve_text(s->reader->xml, name, strlen(name));
  if (!stranger || !copy) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, line, rule->name, name, "no memory for its name");
    return;
  }
  *stranger = (cav_xml_attribute){copy, CAV_XML_SKIP, CAV_XML_STRANGE, 0, NULL, 0, NULL};
  value->rule = stranger;
  value->text = "";
}

// one attribute of libxml2's list (local name, prefix, namespace, start, end of value) into value
static void read_attribute(cav_xml_source *s, int line, const cav_xml_element *rule, const unsigned char *const *given,
                           cav_xml_value *value) {
  const char *name = (const char *)given[0];
  const cav_xml_attribute *a = rule->attribute;
  while (a && a->name && strcmp(a->name, name)) a++;
  if (!a || !a->name || given[1]) {
    if (rule->flags & CAV_XML_OPEN)
      keep_stranger(s, line, rule, name, value);
    else
      cav_xml_unknown_attribute(s, line, rule, name);
    return;
  }
  value->rule = a;
  value->text = cav_xml_carve_text(s->reader->xml, (const char *)given[3], (size_t)(given[4] - given[3]));
  if (!value->text) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, line, rule->name, name, "no memory for its text");
    return;
  }
  if (a->type == CAV_XML_INT || a->type == CAV_XML_REAL) read_numbers(s, line, rule->name, value);
  if (a->type == CAV_XML_WORD || a->type == CAV_XML_BOOL) read_word(s, line, rule->name, value);
  if (a->type == CAV_XML_TEXT && a->min > 0 && !*value->text)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name, "expected a text, got none; fill it in or remove it");
}

int cav_xml_read_attributes(cav_xml_source *s, cav_xml_node *node, int n, const unsigned char *const *given) {
  cav_xml_reader *r = s->reader;
  const cav_xml_element *rule = node->rule;
  cav_xml_value *value = n ? cav_xml_carve(r->xml, sizeof(cav_xml_value) * (size_t)n) : NULL;
  if (n && !value) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, node->line, rule->name, NULL, "no memory for %d attributes", n);
    return 0;
  }
  for (int i = 0; i < n && r->status == CAV_OK; i++) read_attribute(s, node->line, rule, given + 5 * i, &value[i]);
  node->value = value;
  node->nvalue = n;
  for (const cav_xml_attribute *a = rule->attribute; a && a->name && r->status == CAV_OK; a++) {
    if (a->required && !cav_xml_get(node, a->name))
      cav_xml_source_fail(s, CAV_BAD_INPUT, node->line, rule->name, a->name, "is missing; the element needs it");
  }
  return r->status == CAV_OK;
}
