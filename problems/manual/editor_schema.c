/// The grammar of problem files as an XML schema (XSD 1.0), by which editors complete, explain and check: names, words, counts of
/// numbers, what is required. How often an element may stand beside others that repeat, and all that only the whole file can
/// tell, is for the reader alone.
#include <assert.h>
#include <string.h>

#include "file.h"
#include "manual.h"
#include "problem_file.h"

enum { ELEMENTS = 256 };

// all elements that can be reached, MJCF's in a scene too
typedef struct element_list {
  const cav_xml_element *element[ELEMENTS];
  int n;
} element_list;

static int index_of(const element_list *list, const cav_xml_element *element) {
  int i = 0;
  while (i < list->n && list->element[i] != element) i++;
  return i;
}

static void collect(element_list *list, const cav_xml_element *element) {
  if (index_of(list, element) < list->n) return;
  assert(list->n < ELEMENTS);
  list->element[list->n++] = element;
  for (int i = 0; element->child && element->child[i]; i++) collect(list, element->child[i]);
}

static void print_text(FILE *out, const char *indent, const char *text, const cav_xml_note *note) {
  if (!text) return;
  fprintf(out, "%s<xs:annotation><xs:documentation>", indent);
  cav_file_write_xml(out, text);
  if (note && *note->unit) fprintf(out, " [%s]", note->unit);
  if (note && note->fallback) {
    fprintf(out, "; without it: ");
    cav_file_write_xml(out, note->fallback);
  }
  fprintf(out, "</xs:documentation></xs:annotation>\n");
}

static void print_words(FILE *out, const char *const *words) {
  fprintf(out, "      <xs:simpleType><xs:restriction base=\"xs:token\">");
  for (; *words; words++) fprintf(out, "<xs:enumeration value=\"%s\"/>", *words);
  fprintf(out, "</xs:restriction></xs:simpleType>\n");
}

static void print_numbers(FILE *out, const cav_xml_attribute *a) {
  fprintf(out,
          "      <xs:simpleType><xs:restriction><xs:simpleType><xs:list itemType=\"%s\"/></xs:simpleType>"
          "<xs:minLength value=\"%d\"/>",
          a->type == CAV_XML_INT ? "xs:integer" : "number", a->min);
  if (a->max) fprintf(out, "<xs:maxLength value=\"%d\"/>", a->max);
  fprintf(out, "</xs:restriction></xs:simpleType>\n");
}

static void print_attribute(FILE *out, const cav_xml_attribute *a) {
  static const char *const truth[] = {"false", "true", NULL};
  fprintf(out, "    <xs:attribute name=\"%s\"%s>\n", a->name, a->required ? " use=\"required\"" : "");
  print_text(out, "      ", a->note ? a->note->text : NULL, a->note);
  switch (a->type) {
    case CAV_XML_WORD:
      print_words(out, a->words);
      break;
    case CAV_XML_BOOL:
      print_words(out, truth);
      break;
    case CAV_XML_INT:
    case CAV_XML_REAL:
      print_numbers(out, a);
      break;
    case CAV_XML_TEXT:
    case CAV_XML_SKIP:
      fprintf(out,
              "      <xs:simpleType><xs:restriction base=\"xs:string\"><xs:minLength value=\"%d\"/></xs:restriction>"
              "</xs:simpleType>\n",
              a->type == CAV_XML_TEXT ? a->min : 0);
      break;
  }
  fprintf(out, "    </xs:attribute>\n");
}

static void print_children(FILE *out, const element_list *list, const cav_xml_element *e) {
  int single = 1;
  for (int i = 0; e->child[i]; i++) single &= e->child[i]->max == 1;
  fprintf(out, single ? "    <xs:all>\n" : "    <xs:choice minOccurs=\"0\" maxOccurs=\"unbounded\">\n");
  for (int i = 0; e->child[i]; i++) {
    const cav_xml_element *child = e->child[i];
    fprintf(out, "      <xs:element name=\"%s\" type=\"%s-%d\"%s/>\n", child->name, child->name, index_of(list, child),
            single && child->min == 0 ? " minOccurs=\"0\"" : "");
  }
  fprintf(out, single ? "    </xs:all>\n" : "    </xs:choice>\n");
}

static void print_type(FILE *out, const element_list *list, int i) {
  const cav_xml_element *e = list->element[i];
  int anything = e->flags & CAV_XML_ANYTHING;
  fprintf(out, "  <xs:complexType name=\"%s-%d\"%s>\n", e->name, i, anything ? " mixed=\"true\"" : "");
  print_text(out, "    ", e->text, NULL);
  if (anything)
    fprintf(
        out,
        "    <xs:sequence><xs:any minOccurs=\"0\" maxOccurs=\"unbounded\" processContents=\"skip\"/></xs:sequence>\n"
        "    <xs:anyAttribute processContents=\"skip\"/>\n");
  else if (e->child)
    print_children(out, list, e);
  for (const cav_xml_attribute *a = e->attribute; a && a->name; a++) print_attribute(out, a);
  fprintf(out, "  </xs:complexType>\n");
}

void cav_manual_schema(FILE *out) {
  element_list list = {.n = 0};
  collect(&list, &cav_problem_element);
  fprintf(out,
          "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
          "<!-- problem files of cavort, by cavort help xsd -->\n"
          "<xs:schema xmlns:xs=\"http://www.w3.org/2001/XMLSchema\" elementFormDefault=\"unqualified\">\n"
          "  <xs:simpleType name=\"number\"><xs:restriction base=\"xs:token\">"
          "<xs:pattern "
          "value=\"[+\\-]?([0-9]+\\.?[0-9]*|\\.[0-9]+)([eE][+\\-]?[0-9]+)?\"/></xs:restriction></xs:simpleType>\n"
          "  <xs:element name=\"problem\" type=\"problem-0\"/>\n");
  for (int i = 0; i < list.n; i++) print_type(out, &list, i);
  fprintf(out, "</xs:schema>\n");
}
