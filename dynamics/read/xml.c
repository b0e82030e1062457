/// Reads XML files against a grammar table. The only user of libxml2.
///
/// libxml2's SAX interface hands over one tag at a time; each is checked against the table and appended to a tree of
/// our own, so a broken file stops at its first fault and nothing that the table forbids is ever stored. Files are read
/// whole, bounded in size, and scanned once for what would make the parser slow or is no text. Document types are
/// refused, which leaves no entities to expand and no network to reach. Numbers are read in the C locale whatever the
/// program's is. Not done: writing XML, namespaces, encodings other than what libxml2 detects in a file without zero
/// bytes.

#include "xml.h"

#include <assert.h>
#include <errno.h>
#include <libxml/parser.h>
#include <libxml/parserInternals.h>
#include <limits.h>
#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum {
  FILE_LIMIT = 32 << 20,   // bytes in one file
  TOTAL_LIMIT = 128 << 20, // bytes in all files of a tree
  DEPTH_LIMIT = 200,       // elements inside each other
  INCLUDE_LIMIT = 20,      // files inside each other
  ATTRIBUTE_LIMIT = 256,   // attributes of one tag
  WORD_LIMIT = 48          // characters compared when guessing a name
};

// memory of a tree: blocks that are only freed together
typedef struct block {
  struct block *next;
  size_t used, size;
} block;

// a file already read, so that none is read twice
typedef struct seen {
  struct seen *next;
  dev_t device;
  ino_t inode;
} seen;

struct cav_xml {
  block *memory;
  const char *path;
  cav_xml_node *root;
};

// a file being read, and the file that includes it
typedef struct source {
  struct reader *reader;
  struct source *from;
  const char *path;
  char *text;
  size_t size;
  xmlParserCtxtPtr parser;
  int depth;   // open elements of this file
  int include; // depth at which an include element is open, 0: none
  int ended;   // libxml2 came to the end of the document
  dev_t device;
  ino_t inode;
} source;

typedef struct reader {
  cav_xml *xml;
  const cav_xml_element *const *roots;
  const cav_xml_former *former;
  cav_error *error;
  cav_status status; // of the first failure
  cav_xml_node *at;  // innermost open element that is kept
  int unread;        // open elements from the outermost CAV_XML_ANYTHING inwards
  int depth;
  size_t total;
  seen *seen;
} reader;

// --- memory ---

// zeroed memory that lives as long as the tree
static void *carve(cav_xml *xml, size_t size) {
  // sizes come from files, which are bounded
  assert(size <= 64 * (size_t)TOTAL_LIMIT);
  size = (size + 15) & ~(size_t)15;
  block *b = xml->memory;
  if (!b || b->size - b->used < size) {
    size_t room = size > 32768 ? size : 32768;
    b = calloc(1, sizeof(block) + 16 + room);
    if (!b) return NULL;
    b->size = room;
    b->next = xml->memory;
    xml->memory = b;
  }
  char *base = (char *)b + ((sizeof(block) + 15) & ~(size_t)15);
  void *p = base + b->used;
  b->used += size;
  return p;
}

static char *carve_text(cav_xml *xml, const char *text, size_t length) {
  char *copy = carve(xml, length + 1);
  if (copy) memcpy(copy, text, length);
  return copy;
}

void cav_xml_free(cav_xml *xml) {
  if (!xml) return;
  for (block *b = xml->memory, *next; b; b = next) {
    next = b->next;
    free(b);
  }
  free(xml);
}

// --- complaints ---

// place and text into error; text beyond its room is cut
static void explain(cav_error *error, cav_status status, const char *file, int line, const char *element,
                    const char *attribute, const char *format, va_list args) {
  if (!error) return;
  size_t room = sizeof error->text, used = 0;
  error->status = status;
  error->line = line;
  int n =
      line > 0 ? snprintf(error->text, room, "%.400s:%d: ", file, line) : snprintf(error->text, room, "%.400s: ", file);
  used += (size_t)n;
  if (element) used += (size_t)snprintf(error->text + used, room - used, "<%.60s>: ", element);
  if (attribute) used += (size_t)snprintf(error->text + used, room - used, "attribute '%.60s': ", attribute);
  assert(used < room);
  vsnprintf(error->text + used, room - used, format, args);
}

cav_status cav_xml_fail_as(cav_error *error, cav_status status, const cav_xml_node *node, const char *attribute,
                           const char *format, ...) {
  va_list args;
  va_start(args, format);
  explain(error, status, node->file, node->line, node->rule->name, attribute, format, args);
  va_end(args);
  return status;
}

cav_status cav_xml_fail(cav_error *error, const cav_xml_node *node, const char *attribute, const char *format, ...) {
  va_list args;
  va_start(args, format);
  explain(error, CAV_BAD_INPUT, node->file, node->line, node->rule->name, attribute, format, args);
  va_end(args);
  return CAV_BAD_INPUT;
}

// first failure of a reader: keeps it and stops every parser that is open
__attribute__((format(printf, 6, 7))) static void fail(source *s, cav_status status, int line, const char *element,
                                                       const char *attribute, const char *format, ...) {
  reader *r = s->reader;
  if (r->status == CAV_OK) {
    r->status = status;
    va_list args;
    va_start(args, format);
    explain(r->error, status, s->path, line, element, attribute, format, args);
    va_end(args);
  }
  for (; s; s = s->from) {
    if (s->parser) xmlStopParser(s->parser);
  }
}

// --- guessing names ---

// edits that turn a into b, both cut at WORD_LIMIT characters
static int distance(const char *a, const char *b) {
  int row[WORD_LIMIT + 1];
  int n = (int)strnlen(b, WORD_LIMIT);
  for (int j = 0; j <= n; j++) row[j] = j;
  for (int i = 0; i < WORD_LIMIT && a[i]; i++) {
    int diagonal = row[0];
    row[0] = i + 1;
    for (int j = 0; j < n; j++) {
      int best = diagonal + (a[i] != b[j]);
      if (row[j + 1] + 1 < best) best = row[j + 1] + 1;
      if (row[j] + 1 < best) best = row[j] + 1;
      diagonal = row[j + 1];
      row[j + 1] = best;
    }
  }
  return row[n];
}

const char *cav_xml_nearest(const char *word, const void *names, int n, size_t stride) {
  const char *best = NULL;
  int length = (int)strnlen(word, WORD_LIMIT), least = length < 3 ? 2 : 2 + length / 4;
  for (int i = 0; i < n; i++) {
    const char *name = *(const char *const *)((const char *)names + (size_t)i * stride);
    if (!name || !*name) continue;
    int d = distance(word, name);
    if (d < least && d < length) least = d, best = name;
  }
  return best;
}

// names of a list into text, for an error
static void list_names(char *text, size_t room, const char *const *names) {
  size_t used = 0;
  text[0] = 0;
  for (int i = 0; names[i] && used + 4 < room; i++) {
    int n = snprintf(text + used, room - used, "%s%s", i ? ", " : "", names[i]);
    if (n < 0) return;
    if ((size_t)n >= room - used) {
      memcpy(text + room - 4, "...", 4);
      return;
    }
    used += (size_t)n;
  }
}

// --- attributes ---

static int is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

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

static void read_numbers(source *s, int line, const char *element, cav_xml_value *value) {
  const cav_xml_attribute *rule = value->rule;
  char expected[64];
  describe_count(expected, sizeof expected, rule);

  // as many words as there are starts of words
  int count = 0;
  for (const char *p = value->text; *p; p++) count += !is_space(*p) && (p == value->text || is_space(p[-1]));
  if (count < rule->min || (rule->max && count > rule->max)) {
    fail(s, CAV_BAD_INPUT, line, element, rule->name, "expected %s, got %d in '%.60s'; give the right number of values",
         expected, count, value->text);
    return;
  }
  double *number = carve(s->reader->xml, sizeof(double) * (size_t)(count ? count : 1));
  if (!number) {
    fail(s, CAV_NO_MEMORY, line, element, rule->name, "no memory for %d numbers", count);
    return;
  }
  const char *p = value->text;
  for (int i = 0; i < count; i++) {
    while (is_space(*p)) p++;
    if (!read_number(&p, rule->type, &number[i])) {
      fail(s, CAV_BAD_INPUT, line, element, rule->name, "expected %s, got '%.*s'; write finite decimal %s", expected,
           (int)strcspn(p, " \t\r\n") < 60 ? (int)strcspn(p, " \t\r\n") : 60, p,
           rule->type == CAV_XML_INT ? "whole numbers" : "numbers");
      return;
    }
  }
  value->number = number;
  value->count = count;
}

static void read_word(source *s, int line, const char *element, cav_xml_value *value) {
  static const char *const truth[] = {"false", "true", NULL};
  const char *const *words = value->rule->type == CAV_XML_BOOL ? truth : value->rule->words;
  int n = 0;
  for (; words[n]; n++) {
    if (strcmp(words[n], value->text)) continue;
    value->word = n;
    value->count = 1;
    return;
  }
  char list[200];
  list_names(list, sizeof list, words);
  const char *near = cav_xml_nearest(value->text, words, n, sizeof *words);
  fail(s, CAV_BAD_INPUT, line, element, value->rule->name, "expected one of: %s; got '%.60s'%s%s%s", list, value->text,
       near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
}

// what a child or an attribute is called now that was called name before; NULL if none was
static const char *renamed(const source *s, const char *inside, const char *name, int attribute) {
  for (const cav_xml_former *f = s->reader->former; f && f->inside; f++) {
    if (f->attribute == attribute && !strcmp(f->inside, inside) && !strcmp(f->was, name)) return f->now;
  }
  return NULL;
}

static void unknown_attribute(source *s, int line, const cav_xml_element *rule, const char *name) {
  const char *now = renamed(s, rule->name, name, 1);
  if (now) {
    fail(s, CAV_BAD_INPUT, line, rule->name, name, "is called '%s' now; rename it", now);
    return;
  }
  const cav_xml_attribute *a = rule->attribute;
  int n = 0;
  while (a && a[n].name) n++;
  const char *near = n ? cav_xml_nearest(name, a, n, sizeof *a) : NULL;
  if (near)
    fail(s, CAV_BAD_INPUT, line, rule->name, name, "not known here; did you mean '%s'?", near);
  else
    fail(s, CAV_BAD_INPUT, line, rule->name, name, "not known here; remove it or check its spelling");
}

// attribute of an open element that the table does not know: only its name is kept
static void keep_stranger(source *s, int line, const cav_xml_element *rule, const char *name, cav_xml_value *value) {
  cav_xml_attribute *stranger = carve(s->reader->xml, sizeof *stranger);
  char *copy = carve_text(s->reader->xml, name, strlen(name));
  if (!stranger || !copy) {
    fail(s, CAV_NO_MEMORY, line, rule->name, name, "no memory for its name");
    return;
  }
  *stranger = (cav_xml_attribute){copy, CAV_XML_SKIP, CAV_XML_STRANGE, 0, NULL, 0};
  value->rule = stranger;
  value->text = "";
}

// one attribute of libxml2's list (local name, prefix, namespace, start, end of value) into value
static void read_attribute(source *s, int line, const cav_xml_element *rule, const xmlChar *const *given,
                           cav_xml_value *value) {
  const char *name = (const char *)given[0];
  const cav_xml_attribute *a = rule->attribute;
  while (a && a->name && strcmp(a->name, name)) a++;
  if (!a || !a->name || given[1]) {
    if (rule->flags & CAV_XML_OPEN)
      keep_stranger(s, line, rule, name, value);
    else
      unknown_attribute(s, line, rule, name);
    return;
  }
  value->rule = a;
  value->text = carve_text(s->reader->xml, (const char *)given[3], (size_t)(given[4] - given[3]));
  if (!value->text) {
    fail(s, CAV_NO_MEMORY, line, rule->name, name, "no memory for its text");
    return;
  }
  if (a->type == CAV_XML_INT || a->type == CAV_XML_REAL) read_numbers(s, line, rule->name, value);
  if (a->type == CAV_XML_WORD || a->type == CAV_XML_BOOL) read_word(s, line, rule->name, value);
  if (a->type == CAV_XML_TEXT && a->min > 0 && !*value->text)
    fail(s, CAV_BAD_INPUT, line, rule->name, name, "expected a text, got none; fill it in or remove it");
}

static int read_attributes(source *s, cav_xml_node *node, int n, const xmlChar *const *given) {
  reader *r = s->reader;
  const cav_xml_element *rule = node->rule;
  cav_xml_value *value = n ? carve(r->xml, sizeof(cav_xml_value) * (size_t)n) : NULL;
  if (n && !value) {
    fail(s, CAV_NO_MEMORY, node->line, rule->name, NULL, "no memory for %d attributes", n);
    return 0;
  }
  for (int i = 0; i < n && r->status == CAV_OK; i++) read_attribute(s, node->line, rule, given + 5 * i, &value[i]);
  node->value = value;
  node->nvalue = n;
  for (const cav_xml_attribute *a = rule->attribute; a && a->name && r->status == CAV_OK; a++) {
    if (a->required && !cav_xml_get(node, a->name))
      fail(s, CAV_BAD_INPUT, node->line, rule->name, a->name, "is missing; the element needs it");
  }
  return r->status == CAV_OK;
}

// --- elements ---

// line where the open tag starts: libxml2 stands at its end
static int tag_line(const source *s) {
  const xmlParserInput *input = s->parser->input;
  int line = input->line;
  const xmlChar *p = input->cur;
  while (p > input->base && *p != '<') line -= *--p == '\n';
  return *p == '<' && line > 0 ? line : input->line;
}

static void unknown_element(source *s, int line, const cav_xml_element *parent, const cav_xml_element *const *allowed,
                            const char *name) {
  const char *now = parent ? renamed(s, parent->name, name, 0) : NULL;
  if (now) {
    fail(s, CAV_BAD_INPUT, line, name, NULL, "is called <%s> now; rename it", now);
    return;
  }
  const char *names[120];
  int n = 0;
  for (; allowed && allowed[n] && n < 119; n++) names[n] = allowed[n]->name;
  names[n] = NULL;
  char list[300];
  list_names(list, sizeof list, names);
  const char *near = n ? cav_xml_nearest(name, names, n, sizeof *names) : NULL;
  const char *inside = parent ? parent->name : "the file";
  if (near)
    fail(s, CAV_BAD_INPUT, line, name, NULL, "not known inside %s; did you mean <%s>?", inside, near);
  else if (n)
    fail(s, CAV_BAD_INPUT, line, name, NULL, "not known inside %s; expected one of: %s", inside, list);
  else
    fail(s, CAV_BAD_INPUT, line, name, NULL, "%s has no elements inside; remove it", inside);
}

static const cav_xml_element *find_rule(const cav_xml_element *const *allowed, const char *name) {
  for (; allowed && *allowed; allowed++) {
    if (!strcmp((*allowed)->name, name)) return *allowed;
  }
  return NULL;
}

// rule of an element that an open parent holds and no table knows; NULL on failure
static const cav_xml_element *rule_of_stranger(source *s, int line, const char *name) {
  cav_xml_element *rule = carve(s->reader->xml, sizeof *rule);
  char *copy = carve_text(s->reader->xml, name, strlen(name));
  if (!rule || !copy) {
    fail(s, CAV_NO_MEMORY, line, name, NULL, "no memory for its name");
    return NULL;
  }
  *rule = (cav_xml_element){copy, 0, 0, NULL, NULL, CAV_XML_ANYTHING | CAV_XML_STRANGE};
  return rule;
}

static void read_file(reader *r, const char *path, source *from, const cav_xml_node *asked);

// opens the file that an include element names, in the place of that element
static void read_include(source *s, const cav_xml_node *node) {
  reader *r = s->reader;
  const char *name = cav_xml_text(node, "file", "");
  const char *slash = strrchr(r->xml->path, '/');
  size_t folder = name[0] == '/' || !slash ? 0 : (size_t)(slash - r->xml->path) + 1, length = strlen(name);
  char *path = carve(r->xml, folder + length + 1);
  if (!path) {
    fail(s, CAV_NO_MEMORY, node->line, node->rule->name, "file", "no memory for its path");
    return;
  }
  memcpy(path, r->xml->path, folder);
  memcpy(path + folder, name, length);
  s->include = s->depth;
  read_file(r, path, s, node);
}

// root of a file: of the main one it starts the tree, of an included one it is left out
static int is_included_root(source *s, const char *name, int line) {
  if (!s->from || s->depth != 1) return 0;
  const char *root = s->reader->xml->root->rule->name;
  size_t length = strlen(root);
  if (strncmp(name, root, length) || (name[length] && strcmp(name + length, "include")))
    fail(s, CAV_BAD_INPUT, line, name, NULL, "an included file must have the root <%s> or <%sinclude>", root, root);
  return 1;
}

static void append(reader *r, cav_xml_node *node) {
  cav_xml_node *parent = r->at;
  node->parent = parent;
  if (!parent)
    r->xml->root = node;
  else if (parent->last)
    parent->last->next = node;
  else
    parent->child = node;
  if (parent) parent->last = node;
  r->at = node;
}

// a node for a start tag, checked; NULL on failure
static cav_xml_node *make_node(source *s, const cav_xml_element *rule, int line, int n, const xmlChar *const *given) {
  cav_xml_node *node = carve(s->reader->xml, sizeof *node);
  if (!node) {
    fail(s, CAV_NO_MEMORY, line, rule->name, NULL, "no memory for the element");
    return NULL;
  }
  node->rule = rule;
  node->file = s->path;
  node->line = line;
  if (rule->flags & CAV_XML_ANYTHING) return node;
  return read_attributes(s, node, n, given) ? node : NULL;
}

static void on_start(void *context, const xmlChar *local, const xmlChar *prefix, const xmlChar *uri, int nspace,
                     const xmlChar **space, int n, int ndefault, const xmlChar **given) {
  (void)uri, (void)nspace, (void)space, (void)ndefault;
  source *s = context;
  reader *r = s->reader;
  const char *name = (const char *)local;
  if (r->status != CAV_OK) return;
  s->depth++;
  r->depth++;
  int line = tag_line(s);
  if (r->depth > DEPTH_LIMIT) {
    fail(s, CAV_BAD_INPUT, line, name, NULL, "elements are nested more than %d deep; flatten the file", DEPTH_LIMIT);
    return;
  }
  if (r->unread) {
    r->unread++;
    return;
  }
  if (is_included_root(s, name, line)) return;
  if (s->include) {
    fail(s, CAV_BAD_INPUT, line, name, NULL, "an include element is empty; move this element out of it");
    return;
  }
  const cav_xml_element *parent = r->at ? r->at->rule : NULL;
  const cav_xml_element *const *allowed = parent ? parent->child : r->roots;
  const cav_xml_element *rule = prefix ? NULL : find_rule(allowed, name);
  if (!rule) {
    char whole[128];
    snprintf(whole, sizeof whole, "%.60s%s%.60s", prefix ? (const char *)prefix : "", prefix ? ":" : "", name);
    if (parent && (parent->flags & CAV_XML_OPEN))
      rule = rule_of_stranger(s, line, whole);
    else
      unknown_element(s, line, parent, allowed, whole);
    if (!rule) return;
  }
  cav_xml_node *node = make_node(s, rule, line, n, (const xmlChar *const *)given);
  if (!node) return;
  if (rule->flags & CAV_XML_INCLUDE) {
    read_include(s, node);
    return;
  }
  append(r, node);
  if (rule->flags & CAV_XML_ANYTHING) r->unread = 1;
}

// every kind of child occurs as often as the table says
static void check_counts(source *s, const cav_xml_node *node) {
  for (const cav_xml_element *const *rule = node->rule->child; rule && *rule; rule++) {
    if ((*rule)->min == 0 && (*rule)->max == 0) continue;
    int count = 0;
    const cav_xml_node *last = node;
    for (const cav_xml_node *c = node->child; c; c = c->next) {
      if (c->rule != *rule) continue;
      count++;
      last = c;
      if ((*rule)->max && count > (*rule)->max) break;
    }
    if (count < (*rule)->min)
      fail(s, CAV_BAD_INPUT, node->line, node->rule->name, NULL, "needs at least %d <%s> inside; add it", (*rule)->min,
           (*rule)->name);
    if ((*rule)->max && count > (*rule)->max)
      fail(s, CAV_BAD_INPUT, last->line, (*rule)->name, NULL, "at most %d allowed inside <%s>; remove this one",
           (*rule)->max, node->rule->name);
  }
}

static void on_end(void *context, const xmlChar *local, const xmlChar *prefix, const xmlChar *uri) {
  (void)local, (void)prefix, (void)uri;
  source *s = context;
  reader *r = s->reader;
  if (r->status != CAV_OK) return;
  int depth = s->depth--;
  r->depth--;
  if (r->unread > 1) {
    r->unread--;
    return;
  }
  if (!r->unread && s->include == depth) {
    s->include = 0;
    return;
  }
  if (!r->unread && s->from && depth == 1) return;
  r->unread = 0;
  check_counts(s, r->at);
  r->at = r->at->parent;
}

static void on_text(void *context, const xmlChar *text, int length) {
  source *s = context;
  reader *r = s->reader;
  if (r->status != CAV_OK || r->unread) return;
  for (int i = 0; i < length; i++) {
    if (is_space((char)text[i])) continue;
    // libxml2 stands at the end of the text
    int show = 0, line = s->parser->input->line;
    for (int k = i; k < length; k++) line -= text[k] == '\n';
    while (i + show < length && show < 40 && text[i + show] != '\n') show++;
    fail(s, CAV_BAD_INPUT, line, r->at ? r->at->rule->name : NULL, NULL,
         "text between tags is not read: '%.*s'; remove it", show, (const char *)text + i);
    return;
  }
}

// a document type could bring entities that grow without bound, or files from elsewhere
static void on_doctype(void *context, const xmlChar *name, const xmlChar *id, const xmlChar *system) {
  (void)name, (void)id, (void)system;
  source *s = context;
  fail(s, CAV_BAD_INPUT, s->parser->input->line, NULL, NULL,
       "document types and entities are not read; remove the <!DOCTYPE> declaration");
}

// libxml2's first complaint is the one that counts; without this it would print them all
static void on_error(void *context, xmlErrorPtr error) {
  source *s = context;
  if (!error || error->level < XML_ERR_ERROR) return;
  if (error->code == XML_ERR_NO_MEMORY) {
    fail(s, CAV_NO_MEMORY, error->line, NULL, NULL, "no memory to parse the file");
    return;
  }
  const char *text = error->message ? error->message : "";
  fail(s, CAV_BAD_INPUT, error->line, NULL, NULL, "not well-formed XML: %.*s; correct the file",
       (int)strcspn(text, "\n"), text);
}

// --- files ---

// what libxml2 would take long over, or what is no text at all
static int scan(source *s) {
  int line = 1, quotes = 0;
  const char *p = s->text, *end = s->text + s->size;
  while (p < end) {
    if (end - p > 3 && !memcmp(p, "<!--", 4)) {
      for (p += 4; p < end && (end - p < 3 || memcmp(p, "-->", 3)); p++) line += *p == '\n';
      continue;
    }
    if (*p == 0) {
      fail(s, CAV_BAD_INPUT, line, NULL, NULL, "a zero byte: this is no XML text; give an XML file");
      return 0;
    }
    if (*p == '<') quotes = 0;
    if (*p == '"' || *p == '\'') quotes++;
    if (quotes > 2 * ATTRIBUTE_LIMIT) {
      fail(s, CAV_BAD_INPUT, line, NULL, NULL, "a tag with more than %d attributes; is it closed?", ATTRIBUTE_LIMIT);
      return 0;
    }
    line += *p++ == '\n';
  }
  return 1;
}

// place of a failure to open: the include element that asks for the file, or the file itself
__attribute__((format(printf, 4, 5))) static void fail_open(source *s, const cav_xml_node *asked, cav_status status,
                                                            const char *format, ...) {
  char text[700];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  if (asked)
    fail(s->from, status, asked->line, asked->rule->name, "file", "%.400s: %s", s->path, text);
  else
    fail(s, status, 0, NULL, NULL, "%s", text);
}

// the file into memory; 0 on failure
static int load(source *s, const cav_xml_node *asked) {
  struct stat info;
  if (stat(s->path, &info)) {
    fail_open(s, asked, CAV_BAD_INPUT, "cannot be opened (%s); check the path", strerror(errno));
    return 0;
  }
  if (!S_ISREG(info.st_mode)) {
    fail_open(s, asked, CAV_BAD_INPUT, "%s; give an XML file",
              S_ISDIR(info.st_mode) ? "is a folder" : "is no regular file");
    return 0;
  }
  s->device = info.st_dev;
  s->inode = info.st_ino;
  if (info.st_size == 0) {
    fail_open(s, asked, CAV_BAD_INPUT, "is empty; give an XML file");
    return 0;
  }
  if (info.st_size > FILE_LIMIT || s->reader->total + (size_t)info.st_size > TOTAL_LIMIT) {
    fail_open(s, asked, CAV_BAD_INPUT, "%lld bytes are more than is read (%d MB a file, %d MB with all includes)",
              (long long)info.st_size, FILE_LIMIT >> 20, TOTAL_LIMIT >> 20);
    return 0;
  }
  s->text = malloc((size_t)info.st_size);
  if (!s->text) {
    fail_open(s, asked, CAV_NO_MEMORY, "no memory for %lld bytes", (long long)info.st_size);
    return 0;
  }
  FILE *file = fopen(s->path, "rb");
  if (!file) {
    fail_open(s, asked, errno == ENOMEM ? CAV_NO_MEMORY : CAV_BAD_INPUT, "cannot be opened (%s); check the path",
              strerror(errno));
    return 0;
  }
  s->size = fread(s->text, 1, (size_t)info.st_size, file);
  int whole = !ferror(file) && s->size > 0;
  fclose(file);
  if (!whole) fail_open(s, asked, CAV_BAD_INPUT, "cannot be read; check the file");
  s->reader->total += s->size;
  return whole;
}

// no file is read twice, least of all by itself
static int is_new(source *s, const cav_xml_node *asked) {
  reader *r = s->reader;
  for (const source *t = s->from; t; t = t->from) {
    if (t->device != s->device || t->inode != s->inode) continue;
    fail_open(s, asked, CAV_BAD_INPUT, "includes itself, in a circle; remove this include");
    return 0;
  }
  for (const seen *f = r->seen; f; f = f->next) {
    if (f->device != s->device || f->inode != s->inode) continue;
    fail_open(s, asked, CAV_BAD_INPUT, "is included twice; remove this include");
    return 0;
  }
  seen *f = carve(r->xml, sizeof *f);
  if (!f) {
    fail_open(s, asked, CAV_NO_MEMORY, "no memory");
    return 0;
  }
  *f = (seen){r->seen, s->device, s->inode};
  r->seen = f;
  return 1;
}

static void on_document_end(void *context) { ((source *)context)->ended = 1; }

// outside a parser libxml2 would print to the error stream
static void on_stray_error(void *context, xmlErrorPtr error) { (void)context, (void)error; }

static void parse(source *s) {
  s->parser = xmlNewParserCtxt();
  if (!s->parser) {
    fail(s, CAV_NO_MEMORY, 0, NULL, NULL, "no memory for the parser");
    xmlResetLastError();
    return;
  }
  xmlSAXHandler *sax = s->parser->sax;
  memset(sax, 0, sizeof *sax);
  sax->initialized = XML_SAX2_MAGIC;
  sax->startElementNs = on_start;
  sax->endElementNs = on_end;
  sax->characters = sax->ignorableWhitespace = sax->cdataBlock = on_text;
  sax->internalSubset = on_doctype;
  sax->endDocument = on_document_end;
  sax->serror = on_error;
  s->parser->userData = s;
  // entities here are only the five of XML itself: "noent" replaces them by their characters
  xmlDoc *none = xmlCtxtReadMemory(s->parser, s->text, (int)s->size, s->path, NULL, XML_PARSE_NONET | XML_PARSE_NOENT);
  if (none) xmlFreeDoc(none);
  // all other faults were reported on the way: what stops without a word ran out of memory
  if (!s->ended || !s->parser->wellFormed) fail(s, CAV_NO_MEMORY, 0, NULL, NULL, "no memory to parse the file");
  xmlFreeParserCtxt(s->parser);
  xmlResetLastError();
  s->parser = NULL;
}

static void read_file(reader *r, const char *path, source *from, const cav_xml_node *asked) {
  source s = {.reader = r, .from = from, .path = path};
  int depth = 0;
  for (const source *t = from; t; t = t->from) depth++;
  if (depth > INCLUDE_LIMIT) {
    fail_open(&s, asked, CAV_BAD_INPUT, "files are included more than %d deep", INCLUDE_LIMIT);
    return;
  }
  if (load(&s, asked) && is_new(&s, asked) && scan(&s)) parse(&s);
  free(s.text);
}

cav_xml *cav_xml_read(const char *path, const cav_xml_element *const *roots, const cav_xml_former *former,
                      cav_error *error) {
  cav_xml *xml = calloc(1, sizeof *xml);
  reader r = {.xml = xml, .roots = roots, .former = former, .error = error};
  source none = {.reader = &r, .path = path};
  if (xml) xml->path = carve_text(xml, path, strlen(path));
  locale_t plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
  if (!xml || !xml->path || !plain) {
    fail(&none, CAV_NO_MEMORY, 0, NULL, NULL, "no memory to read the file");
  } else {
    // both are this thread's own and are put back as they were
    locale_t users = uselocale(plain);
    xmlStructuredErrorFunc handler = xmlStructuredError;
    void *context = xmlStructuredErrorContext;
    xmlSetStructuredErrorFunc(NULL, on_stray_error);
    read_file(&r, xml->path, NULL, NULL);
    xmlSetStructuredErrorFunc(context, handler);
    uselocale(users);
  }
  if (plain) freelocale(plain);
  if (r.status == CAV_OK && !xml->root)
    fail(&none, CAV_BAD_INPUT, 0, NULL, NULL, "no element inside; give an XML file");
  if (r.status == CAV_OK) return xml;
  cav_xml_free(xml);
  return NULL;
}

// --- looking at the tree ---

const cav_xml_node *cav_xml_root(const cav_xml *xml) { return xml->root; }

const char *cav_xml_path(const cav_xml *xml) { return xml->path; }

static const cav_xml_node *first_of(const cav_xml_node *node, const cav_xml_element *rule) {
  while (node && node->rule != rule) node = node->next;
  return node;
}

const cav_xml_node *cav_xml_child(const cav_xml_node *node, const cav_xml_element *rule) {
  return first_of(node->child, rule);
}

const cav_xml_node *cav_xml_next(const cav_xml_node *node) { return first_of(node->next, node->rule); }

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
