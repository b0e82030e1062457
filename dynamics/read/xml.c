/// Reads XML files against a grammar table. The only user of libxml2.
///
/// libxml2's SAX interface hands over one tag at a time; each is checked against the table and appended to a tree of
/// our own, so a broken file stops at its first fault and nothing that the table forbids is ever stored. Files are read
/// whole (xml_source.c). Document types are refused, which leaves no entities to expand and no network to reach.
/// Numbers are read in the C locale whatever the program's is. Attributes are converted by xml_value.c, complaints
/// worded by xml_complaint.c, the tree kept by xml_tree.c. Not done: writing XML, namespaces, encodings other than what
/// libxml2 detects in a file without zero bytes.

#include "xml.h"

#include <libxml/parser.h>
#include <libxml/parserInternals.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "xml_parts.h"

enum { INCLUDE_LIMIT = 20 }; // files inside each other

void cav_xml_stop(cav_xml_source *s) {
  for (; s; s = s->from) {
    if (s->parser) xmlStopParser(s->parser);
  }
}

// --- elements ---

// line where the open tag starts: libxml2 stands at its end
static int tag_line(const cav_xml_source *s) {
  const xmlParserInput *input = s->parser->input;
  int line = input->line;
  const xmlChar *p = input->cur;
  while (p > input->base && *p != '<') line -= *--p == '\n';
  return *p == '<' && line > 0 ? line : input->line;
}

static const cav_xml_element *find_rule(const cav_xml_element *const *allowed, const char *name) {
  for (; allowed && *allowed; allowed++) {
    if (!strcmp((*allowed)->name, name)) return *allowed;
  }
  return NULL;
}

// rule of an element that an open parent holds and no table knows; NULL on failure
static const cav_xml_element *rule_of_stranger(cav_xml_source *s, int line, const char *name) {
  cav_xml_element *rule = cav_xml_carve(s->reader->xml, sizeof *rule);
  char *copy = cav_xml_carve_text(s->reader->xml, name, strlen(name));
  if (!rule || !copy) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, line, name, NULL, "no memory for its name");
    return NULL;
  }
  *rule = (cav_xml_element){copy, 0, 0, NULL, NULL, CAV_XML_ANYTHING | CAV_XML_STRANGE, NULL};
  return rule;
}

static void read_file(cav_xml_reader *r, const char *path, cav_xml_source *from, const cav_xml_node *asked);

// path of a file as named in the folder of another; NULL without memory
static char *path_beside(cav_xml *xml, const char *other, const char *name) {
  const char *slash = strrchr(other, '/');
  size_t folder = name[0] == '/' || !slash ? 0 : (size_t)(slash - other) + 1, length = strlen(name);
  char *path = cav_xml_carve(xml, folder + length + 1);
  if (!path) return NULL;
  memcpy(path, other, folder);
  memcpy(path + folder, name, length);
  return path;
}

// opens the file that an include element names, beside the main file or else beside this one, in place of the element
static void read_include(cav_xml_source *s, const cav_xml_node *node) {
  cav_xml_reader *r = s->reader;
  const char *name = cav_xml_text(node, "file", "");
  char *path = path_beside(r->xml, r->xml->path, name), *near = path ? path_beside(r->xml, s->path, name) : NULL;
  if (!near) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, node->line, node->rule->name, "file", "no memory for its path");
    return;
  }
  s->include = s->depth;
  read_file(r, access(path, F_OK) && !access(near, F_OK) ? near : path, s, node);
}

// root of a file: of the main one it starts the tree, of an included one it is left out
static int is_included_root(cav_xml_source *s, const char *name, int line) {
  if (!s->from || s->depth != 1) return 0;
  if (s->reader->xml->root->rule->flags & CAV_XML_PROSE) return 1;
  const char *root = s->reader->xml->root->rule->name;
  size_t length = strlen(root);
  if (strncmp(name, root, length) || (name[length] && strcmp(name + length, "include")))
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "an included file must have the root <%s> or <%sinclude>",
                        root, root);
  return 1;
}

static void append(cav_xml_reader *r, cav_xml_node *node) {
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
static cav_xml_node *make_node(cav_xml_source *s, const cav_xml_element *rule, int line, int n,
                               const xmlChar *const *given) {
  cav_xml_node *node = cav_xml_carve(s->reader->xml, sizeof *node);
  if (!node) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, line, rule->name, NULL, "no memory for the element");
    return NULL;
  }
  node->rule = rule;
  node->file = s->path;
  node->line = line;
  if (rule->flags & CAV_XML_ANYTHING) return node;
  return cav_xml_read_attributes(s, node, n, given) ? node : NULL;
}

static void on_start(void *context, const xmlChar *local, const xmlChar *prefix, const xmlChar *uri, int nspace,
                     const xmlChar **space, int n, int ndefault, const xmlChar **given) {
  (void)uri, (void)nspace, (void)space, (void)ndefault;
  cav_xml_source *s = context;
  cav_xml_reader *r = s->reader;
  const char *name = (const char *)local;
  if (r->status != CAV_OK) return;
  s->depth++;
  r->depth++;
  int line = tag_line(s);
  if (r->depth > CAV_XML_DEPTH_LIMIT) {
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "elements are nested more than %d deep; flatten the file",
                        CAV_XML_DEPTH_LIMIT);
    return;
  }
  if (r->unread) {
    r->unread++;
    return;
  }
  if (is_included_root(s, name, line)) return;
  if (s->include) {
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "an include element is empty; move this element out of it");
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
      cav_xml_unknown_element(s, line, parent, allowed, whole);
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
static void check_counts(cav_xml_source *s, const cav_xml_node *node) {
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
      cav_xml_source_fail(s, CAV_BAD_INPUT, node->line, node->rule->name, NULL, "needs at least %d <%s> inside; add it",
                          (*rule)->min, (*rule)->name);
    if ((*rule)->max && count > (*rule)->max)
      cav_xml_source_fail(s, CAV_BAD_INPUT, last->line, (*rule)->name, NULL,
                          "at most %d allowed inside <%s>; remove this one", (*rule)->max, node->rule->name);
  }
}

static void on_end(void *context, const xmlChar *local, const xmlChar *prefix, const xmlChar *uri) {
  (void)local, (void)prefix, (void)uri;
  cav_xml_source *s = context;
  cav_xml_reader *r = s->reader;
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
  cav_xml_source *s = context;
  cav_xml_reader *r = s->reader;
  if (r->status != CAV_OK || r->unread) return;
  for (int i = 0; i < length; i++) {
    if (is_space((char)text[i])) continue;
    // libxml2 stands at the end of the text
    int show = 0, line = s->parser->input->line;
    for (int k = i; k < length; k++) line -= text[k] == '\n';
    if (r->xml->root && (r->xml->root->rule->flags & CAV_XML_PROSE)) {
      if (!r->xml->prose++) r->xml->prose_line = line, r->xml->prose_file = s->path;
      return;
    }
    while (i + show < length && show < 40 && text[i + show] != '\n') show++;
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, r->at ? r->at->rule->name : NULL, NULL,
                        "text between tags is not read: '%.*s'; remove it", show, (const char *)text + i);
    return;
  }
}

// a document type could bring entities that grow without bound, or files from elsewhere
static void on_doctype(void *context, const xmlChar *name, const xmlChar *id, const xmlChar *system) {
  (void)name, (void)id, (void)system;
  cav_xml_source *s = context;
  cav_xml_source_fail(s, CAV_BAD_INPUT, s->parser->input->line, NULL, NULL,
                      "document types and entities are not read; remove the <!DOCTYPE> declaration");
}

// libxml2's first complaint is the one that counts; without this it would print them all
static void on_error(void *context, xmlErrorPtr error) {
  cav_xml_source *s = context;
  if (!error || error->level < XML_ERR_ERROR) return;
  // two hyphens in a comment hide nothing, and other readers of models let them pass
  if (error->code == XML_ERR_HYPHEN_IN_COMMENT) {
    s->lenient = 1;
    return;
  }
  if (error->code == XML_ERR_NO_MEMORY) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, error->line, NULL, NULL, "no memory to parse the file");
    return;
  }
  const char *text = error->message ? error->message : "";
  cav_xml_source_fail(s, CAV_BAD_INPUT, error->line, NULL, NULL, "not well-formed XML: %.*s; correct the file",
                      (int)strcspn(text, "\n"), text);
}

// --- files ---

static void on_document_end(void *context) { ((cav_xml_source *)context)->ended = 1; }

// outside a parser libxml2 would print to the error stream
static void on_stray_error(void *context, xmlErrorPtr error) { (void)context, (void)error; }

static void parse(cav_xml_source *s) {
  s->parser = xmlNewParserCtxt();
  if (!s->parser) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, 0, NULL, NULL, "no memory for the parser");
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
  // entities here are only the five of XML itself: "noent" replaces them by their characters; "recover" goes on where
  // on_error does not stop; "huge" lifts its bound of 256 on nesting, and bounds on sizes that ours of a file take in
  xmlDoc *none = xmlCtxtReadMemory(s->parser, s->text, (int)s->size, s->path, NULL,
                                   XML_PARSE_NONET | XML_PARSE_NOENT | XML_PARSE_RECOVER | XML_PARSE_HUGE);
  if (none) xmlFreeDoc(none);
  // all other faults were reported on the way: what stops without a word ran out of memory
  if (!s->ended || !(s->parser->wellFormed || s->lenient))
    cav_xml_source_fail(s, CAV_NO_MEMORY, 0, NULL, NULL, "no memory to parse the file");
  xmlFreeParserCtxt(s->parser);
  xmlResetLastError();
  s->parser = NULL;
}

static void read_file(cav_xml_reader *r, const char *path, cav_xml_source *from, const cav_xml_node *asked) {
  cav_xml_source s = {.reader = r, .from = from, .path = path};
  int depth = 0;
  for (const cav_xml_source *t = from; t; t = t->from) depth++;
  if (depth > INCLUDE_LIMIT) {
    cav_xml_fail_open(&s, asked, CAV_BAD_INPUT, "files are included more than %d deep", INCLUDE_LIMIT);
    return;
  }
  if (cav_xml_load(&s, asked)) parse(&s);
  free(s.text);
}

cav_xml *cav_xml_read(const char *path, const cav_xml_element *const *roots, const cav_xml_former *former,
                      cav_error *error) {
  return cav_xml_parse(path, NULL, roots, former, error);
}

cav_xml *cav_xml_parse(const char *path, const char *text, const cav_xml_element *const *roots,
                       const cav_xml_former *former, cav_error *error) {
  cav_xml *xml = calloc(1, sizeof *xml);
  cav_xml_reader r = {.xml = xml, .roots = roots, .former = former, .error = error, .text = text};
  cav_xml_source none = {.reader = &r, .path = path};
  if (xml) xml->path = cav_xml_carve_text(xml, path, strlen(path));
  locale_t plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
  if (!xml || !xml->path || !plain) {
    cav_xml_source_fail(&none, CAV_NO_MEMORY, 0, NULL, NULL, "no memory to read the file");
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
    cav_xml_source_fail(&none, CAV_BAD_INPUT, 0, NULL, NULL, "no element inside; give an XML file");
  if (r.status == CAV_OK) return xml;
  cav_xml_free(xml);
  return NULL;
}
