/// The tree of an XML file: its memory, and looking at it once it is read. What may stand in it and how a file becomes
/// one is for xml.c and xml_value.c.
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "xml_parts.h"

// memory of a tree: blocks that are only freed together
struct cav_xml_block {
  struct cav_xml_block *next;
  size_t used, size;
};

void *cav_xml_carve(cav_xml *xml, size_t size) {
  // sizes come from files, which are bounded
  assert(size <= 64 * (size_t)CAV_XML_TOTAL_LIMIT);
  size = (size + 15) & ~(size_t)15;
  cav_xml_block *b = xml->memory;
  if (!b || b->size - b->used < size) {
    size_t room = size > 32768 ? size : 32768;
    b = calloc(1, sizeof(cav_xml_block) + 16 + room);
    if (!b) return NULL;
    b->size = room;
    b->next = xml->memory;
    xml->memory = b;
  }
  char *base = (char *)b + ((sizeof(cav_xml_block) + 15) & ~(size_t)15);
  void *p = base + b->used;
  b->used += size;
  return p;
}

char *cav_xml_carve_text(cav_xml *xml, const char *text, size_t length) {
  char *copy = cav_xml_carve(xml, length + 1);
  if (copy) memcpy(copy, text, length);
  return copy;
}

void cav_xml_free(cav_xml *xml) {
  if (!xml) return;
  for (cav_xml_block *b = xml->memory, *next; b; b = next) {
    next = b->next;
    free(b);
  }
  free(xml);
}

// --- looking at the tree ---

const cav_xml_node *cav_xml_root(const cav_xml *xml) { return xml->root; }

const char *cav_xml_path(const cav_xml *xml) { return xml->path; }

int cav_xml_prose(const cav_xml *xml, const char **file, int *line) {
  *file = xml->prose_file;
  *line = xml->prose_line;
  return xml->prose;
}

static const cav_xml_node *first_of(const cav_xml_node *node, const cav_xml_element *rule) {
  while (node && node->rule != rule) node = node->next;
  return node;
}

const cav_xml_node *cav_xml_child(const cav_xml_node *node, const cav_xml_element *rule) {
  return first_of(node->child, rule);
}

const cav_xml_node *cav_xml_next(const cav_xml_node *node) { return first_of(node->next, node->rule); }

int cav_xml_is(const cav_xml_node *node, const char *name) { return !strcmp(node->rule->name, name); }

cav_xml_node *cav_xml_find(const cav_xml_node *node, const char *kind, const char *name) {
  for (cav_xml_node *c = node->child; c; c = c->next) {
    if (cav_xml_is(c, kind) && !strcmp(cav_xml_text(c, "name", ""), name)) return c;
    cav_xml_node *below = cav_xml_find(c, kind, name);
    if (below) return below;
  }
  return NULL;
}

const cav_xml_value *cav_xml_get(const cav_xml_node *node, const char *name) {
  for (int i = 0; i < node->nvalue; i++) {
    if (!strcmp(node->value[i].rule->name, name)) return &node->value[i];
  }
  return NULL;
}

int cav_xml_accepts(const cav_xml_node *node, const char *name) {
  const cav_xml_attribute *a = node->rule->attribute;
  while (a && a->name && strcmp(a->name, name)) a++;
  return a && a->name;
}

const char *cav_xml_text(const cav_xml_node *node, const char *name, const char *fallback) {
  const cav_xml_value *value = cav_xml_get(node, name);
  return value ? value->text : fallback;
}

double cav_xml_real(const cav_xml_node *node, const char *name, double fallback) {
  const cav_xml_value *value = cav_xml_get(node, name);
  assert(!value || value->rule->type == CAV_XML_REAL || value->rule->type == CAV_XML_INT);
  return value && value->count ? value->number[0] : fallback;
}

int cav_xml_int(const cav_xml_node *node, const char *name, int fallback) {
  const cav_xml_value *value = cav_xml_get(node, name);
  assert(!value || value->rule->type == CAV_XML_INT);
  return value && value->count ? (int)value->number[0] : fallback;
}

int cav_xml_bool(const cav_xml_node *node, const char *name, int fallback) {
  const cav_xml_value *value = cav_xml_get(node, name);
  assert(!value || value->rule->type == CAV_XML_BOOL);
  return value ? value->word : fallback;
}

int cav_xml_word(const cav_xml_node *node, const char *name, int fallback) {
  const cav_xml_value *value = cav_xml_get(node, name);
  assert(!value || value->rule->type == CAV_XML_WORD);
  return value ? value->word : fallback;
}

int cav_xml_reals(const cav_xml_node *node, const char *name, double *out, int most) {
  const cav_xml_value *value = cav_xml_get(node, name);
  if (!value) return 0;
  assert(value->rule->type == CAV_XML_REAL || value->rule->type == CAV_XML_INT);
  for (int i = 0; i < value->count && i < most; i++) out[i] = value->number[i];
  return value->count;
}
