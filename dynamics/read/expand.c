/// Writes out what an MJCF file says in short: replicate elements become frames with a copy of their content each, and
/// attach elements frames with a copy of a body of another file, or of its whole world.
///
/// Works on the tree before it is read, by names. A copy's names get a suffix (replicate: separator and number) or a
/// prefix (attach), and so do references inside it; elements of other sections that refer into a copy are copied with
/// it. Of an attached file come its defaults, assets and whatever of its other sections refers to what is attached
/// alone; its nodes keep its number, by which its compiler settings and classes are found (spec.h). Its options are
/// those of the host, as in MuJoCo. Not done: keyframes of attached files, which are left aside with a warning.
#include <stdio.h>
#include <stdlib.h>

#include "expand.h"
#include "math3.h"
#include "xml_parts.h"

enum { COPIES_MAX = 100000, NODES_MAX = 500000 };

/// A named element that has been copied.
typedef struct original {
  const char *kind, *name;
} original;

/// How the names of a copy differ: before them, behind them; only of the named, or of all where that is NULL.
typedef struct change {
  const char *prefix, *suffix;
  const original *named;
  int nnamed, sorted, part;
} change;

typedef struct expansion {
  cav_spec *spec;
  cav_xml *xml; ///< keeps the copies
  int nodes;
  int nested; ///< open elements of the worldbody, those around the place of an attachment counted in
} expansion;

static void no_memory(expansion *e) { cav_spec_no_memory(e->spec); }

// --- names by kind ---

static const char *kind_of(const cav_xml_node *node) {
  const char *section = node->parent ? node->parent->rule->name : "";
  if (!strcmp(section, "tendon")) return "tendon";
  if (!strcmp(section, "actuator")) return "actuator";
  if (!strcmp(section, "sensor") || !strcmp(section, "equality") || !strcmp(section, "contact")) return "other";
  return cav_xml_is(node, "freejoint") ? "joint" : node->rule->name;
}

// kind that an attribute of an element refers to; NULL: it is no reference
static const char *referred_kind(const cav_xml_node *node, const char *attribute) {
  static const char *const table[][2] = {
      {"joint", "joint"},        {"joint1", "joint"},  {"joint2", "joint"},   {"jointinparent", "joint"},
      {"site", "site"},          {"site1", "site"},    {"site2", "site"},     {"cranksite", "site"},
      {"slidersite", "site"},    {"refsite", "site"},  {"sidesite", "site"},  {"geom", "geom"},
      {"geom1", "geom"},         {"geom2", "geom"},    {"body", "body"},      {"body1", "body"},
      {"body2", "body"},         {"tendon", "tendon"}, {"tendon1", "tendon"}, {"tendon2", "tendon"},
      {"actuator", "actuator"},  {"mesh", "mesh"},     {"hfield", "hfield"},  {"material", "material"},
      {"childclass", "default"}, {"class", "default"}};
  if (cav_xml_is(node, "attach") || cav_xml_is(node, "model")) return NULL;
  int object = !strcmp(attribute, "objname"), reference = !strcmp(attribute, "refname");
  if (object || reference) {
    const cav_xml_value *type = cav_xml_get(node, object ? "objtype" : "reftype");
    const char *kind = type ? type->text : "";
    return !strcmp(kind, "xbody") ? "body" : kind;
  }
  for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
    if (!strcmp(table[i][0], attribute)) return table[i][1];
  }
  return NULL;
}

static int compare_originals(const void *a, const void *b) {
  const original *x = a, *y = b;
  int order = strcmp(x->kind, y->kind);
  return order ? order : strcmp(x->name, y->name);
}

static int has(const change *c, const char *kind, const char *name) {
  const original key = {kind, name};
  if (c->sorted) return bsearch(&key, c->named, (size_t)c->nnamed, sizeof key, compare_originals) != NULL;
  for (int i = 0; i < c->nnamed; i++) {
    if (!strcmp(c->named[i].kind, kind) && !strcmp(c->named[i].name, name)) return 1;
  }
  return !c->named;
}

// names of a subtree into a list that grows
typedef struct names {
  original *at;
  int n, room;
} names;

static void push_name(expansion *e, names *list, const char *kind, const char *name) {
  if (!*name || e->spec->status != CAV_OK) return;
  if (list->n == list->room) {
    int room = list->room ? 2 * list->room : 64;
    original *more = realloc(list->at, (size_t)room * sizeof *more);
    if (!more) {
      no_memory(e);
      return;
    }
    list->at = more;
    list->room = room;
  }
  list->at[list->n++] = (original){kind, name};
}

static void collect_names(expansion *e, names *list, const cav_xml_node *node) {
  const cav_xml_value *name = cav_xml_get(node, "name");
  if (name && *name->text) push_name(e, list, kind_of(node), name->text);
  for (const cav_xml_node *c = node->child; c; c = c->next) collect_names(e, list, c);
}

// whether an element, or one in it, refers to a name of the list; all: whether all its references are there
static int refers(const cav_xml_node *node, const change *c, int all) {
  int found = 0, missed = 0;
  for (int i = 0; i < node->nvalue; i++) {
    const char *kind = referred_kind(node, node->value[i].rule->name);
    if (!kind || !strcmp(kind, "default") || !strcmp(kind, "material")) continue;
    *(has(c, kind, node->value[i].text) ? &found : &missed) += 1;
  }
  for (const cav_xml_node *k = node->child; k; k = k->next) *(refers(k, c, all) ? &found : &missed) += 1;
  return all ? !missed : found > 0;
}

// --- copies ---

// an empty text names nothing, in copies too
static const char *changed_text(expansion *e, const change *c, const char *text) {
  if (!*text) return text;
  size_t room = strlen(c->prefix) + strlen(text) + strlen(c->suffix) + 1;
  char *copy = cav_xml_carve(e->xml, room);
  if (!copy) {
    no_memory(e);
    return text;
  }
  snprintf(copy, room, "%s%s%s", c->prefix, text, c->suffix);
  return copy;
}

// class names change with a part, whose classes are its own; names of elements always; references where they are named
static int changes(const cav_xml_node *node, const cav_xml_value *value, const change *c) {
  const char *attribute = value->rule->name;
  if (cav_xml_is(node, "default") && !strcmp(attribute, "class")) return c->part > 0;
  if (!strcmp(attribute, "name")) return 1;
  const char *kind = referred_kind(node, attribute);
  if (!kind) return 0;
  if (c->part) return 1;
  return has(c, kind, value->text);
}

static cav_xml_node *copy_node(expansion *e, const cav_xml_node *from, cav_xml_node *parent, const change *c) {
  cav_xml_node *node = cav_xml_carve(e->xml, sizeof *node);
  cav_xml_value *value = from->nvalue ? cav_xml_carve(e->xml, sizeof *value * (size_t)from->nvalue) : NULL;
  if (!node || (from->nvalue && !value)) {
    no_memory(e);
    return NULL;
  }
  if (++e->nodes > NODES_MAX) {
    cav_spec_fail(e->spec, from, NULL, "more than %d elements once all is written out; make fewer copies", NODES_MAX);
    return NULL;
  }
  *node = *from;
  node->parent = parent;
  node->child = node->last = node->next = NULL;
  node->value = value;
  if (c->part) node->part = c->part;
  for (int i = 0; i < from->nvalue; i++) {
    value[i] = from->value[i];
    if (changes(from, &from->value[i], c)) value[i].text = changed_text(e, c, from->value[i].text);
  }
  for (const cav_xml_node *k = from->child; k && e->spec->status == CAV_OK; k = k->next) {
    cav_xml_node *copy = copy_node(e, k, node, c);
    if (!copy) return NULL;
    if (node->last)
      node->last->next = copy;
    else
      node->child = copy;
    node->last = copy;
  }
  return node;
}

static void put_last(cav_xml_node *parent, cav_xml_node *node) {
  if (parent->last)
    parent->last->next = node;
  else
    parent->child = node;
  parent->last = node;
}

// an attribute of numbers for a frame that is made here
static cav_xml_value numbers(expansion *e, const char *name, const double *x, int n) {
  const cav_xml_attribute *rule = cav_frame_element->attribute;
  while (strcmp(rule->name, name)) rule++;
  double *copy = cav_xml_carve(e->xml, sizeof *copy * (size_t)n);
  if (!copy) {
    no_memory(e);
    return (cav_xml_value){.rule = rule, .text = ""};
  }
  memcpy(copy, x, sizeof *copy * (size_t)n);
  return (cav_xml_value){.rule = rule, .text = "", .count = n, .number = copy};
}

// an empty frame at a pose in the place of an element
static cav_xml_node *make_frame(expansion *e, const cav_xml_node *at, const double pos[3], const double quat[4]) {
  cav_xml_node *frame = cav_xml_carve(e->xml, sizeof *frame);
  cav_xml_value *value = cav_xml_carve(e->xml, 3 * sizeof *value);
  if (!frame || !value) {
    no_memory(e);
    return NULL;
  }
  *frame = (cav_xml_node){.rule = cav_frame_element,
                          .file = at->file,
                          .line = at->line,
                          .parent = at->parent,
                          .part = at->part,
                          .nvalue = 2,
                          .value = value};
  value[0] = numbers(e, "pos", pos, 3);
  value[1] = numbers(e, "quat", quat, 4);
  return frame;
}

// a list of siblings in the place of one; first NULL: nothing
static void replace_node(cav_xml_node *node, cav_xml_node *first, cav_xml_node *last) {
  cav_xml_node **at = &node->parent->child;
  while (*at != node) at = &(*at)->next;
  *at = first ? first : node->next;
  if (last) last->next = node->next;
  node->parent->last = NULL;
  for (cav_xml_node *k = node->parent->child; k; k = k->next) node->parent->last = k;
}

// --- replicate ---

// elements of other sections that refer to what is copied, each once for every copy
static void copy_referring(expansion *e, cav_xml_node *root, const change *c, int count, const char *const *suffix) {
  static const char *const sections[] = {"contact", "equality", "tendon", "actuator", "sensor"};
  for (cav_xml_node *section = root->child; section; section = section->next) {
    int known = 0;
    for (size_t i = 0; i < sizeof sections / sizeof *sections; i++) known |= cav_xml_is(section, sections[i]);
    for (cav_xml_node *k = known ? section->child : NULL, *next; k && e->spec->status == CAV_OK; k = next) {
      next = k->next;
      if (!refers(k, c, 0)) continue;
      cav_xml_node *first = NULL, *last = NULL;
      for (int i = 0; i < count; i++) {
        change one = *c;
        one.suffix = suffix[i];
        cav_xml_node *copy = copy_node(e, k, section, &one);
        if (!copy) return;
        if (last)
          last->next = copy;
        else
          first = copy;
        last = copy;
      }
      replace_node(k, first, last);
    }
  }
}

static void turn_by_euler(cav_spec *spec, const cav_xml_node *node, double quat[4]) {
  quat[0] = 1;
  quat[1] = quat[2] = quat[3] = 0;
  if (cav_xml_get(node, "euler")) cav_read_orientation(spec, node, quat);
}

static void write_out_replicate(expansion *e, cav_xml_node *root, cav_xml_node *node) {
  cav_spec *spec = e->spec;
  int count = cav_xml_int(node, "count", 0), digits = 1;
  const char *separator = cav_xml_text(node, "sep", "");
  double step[3] = {0, 0, 0}, turn[4], pos[3] = {0, 0, 0}, quat[4] = {1, 0, 0, 0};
  if (count < 1 || count > COPIES_MAX) {
    cav_spec_fail(spec, node, "count", "expected a number of copies from 1 to %d, got %d", COPIES_MAX, count);
    return;
  }
  cav_xml_reals(node, "offset", step, 3);
  turn_by_euler(spec, node, turn);
  for (int most = count - 1; most >= 10; most /= 10) digits++;
  names list = {0};
  for (const cav_xml_node *k = node->child; k; k = k->next) collect_names(e, &list, k);
  static const original nothing = {"", ""};
  if (list.n) qsort(list.at, (size_t)list.n, sizeof *list.at, compare_originals);
  change c = {.prefix = "", .suffix = "", .named = list.n ? list.at : &nothing, .nnamed = list.n, .sorted = 1};
  const char **suffix = cav_xml_carve(e->xml, sizeof *suffix * (size_t)count);
  cav_xml_node *first = NULL, *last = NULL;
  if (!suffix) no_memory(e);
  for (int i = 0; i < count && spec->status == CAV_OK; i++) {
    char *text = cav_xml_carve(e->xml, strlen(separator) + 12);
    cav_xml_node *frame = make_frame(e, node, pos, quat);
    if (!text || !frame) {
      no_memory(e);
      break;
    }
    snprintf(text, strlen(separator) + 12, "%s%0*d", separator, digits, i);
    c.suffix = suffix[i] = text;
    if (cav_xml_get(node, "childclass")) {
      cav_xml_value *value = (cav_xml_value *)frame->value;
      value[frame->nvalue++] = *cav_xml_get(node, "childclass");
    }
    for (const cav_xml_node *k = node->child; k && spec->status == CAV_OK; k = k->next) {
      cav_xml_node *copy = copy_node(e, k, frame, &c);
      if (copy) put_last(frame, copy);
    }
    if (last)
      last->next = frame;
    else
      first = frame;
    last = frame;
    double moved[3];
    quat_rotate(moved, quat, step);
    add3(pos, pos, moved);
    quat_mul(quat, quat, turn);
  }
  if (spec->status == CAV_OK) replace_node(node, first, last);
  if (spec->status == CAV_OK && list.n) copy_referring(e, root, &c, count, suffix);
  free(list.at);
}

// --- attach ---

static const cav_xml_node *find_asset(const cav_xml_node *root, const char *name) {
  for (const cav_xml_node *s = root->child; s; s = s->next) {
    for (const cav_xml_node *c = cav_xml_is(s, "asset") ? s->child : NULL; c; c = c->next) {
      if (cav_xml_is(c, "model") && !strcmp(cav_xml_text(c, "name", ""), name)) return c;
    }
  }
  return NULL;
}

// the file of a model asset, its own replicates and attachments written out
static cav_xml *read_other(expansion *e, const cav_xml_node *asset, int depth) {
  static const cav_xml_element *const roots[] = {&cav_mjcf_root, NULL};
  cav_spec *spec = e->spec;
  const char *host = cav_xml_path(spec->xml), *slash = strrchr(host, '/'), *file = cav_xml_text(asset, "file", "");
  int folder = slash && *file != '/' ? (int)(slash - host) + 1 : 0;
  size_t room = (size_t)folder + strlen(file) + 1;
  char *path = cav_spec_keep_text(spec, room);
  if (!path) return NULL;
  snprintf(path, room, "%.*s%s", folder, host, file);
  if (depth > 8) {
    cav_spec_fail(spec, asset, "file", "models attach each other more than 8 deep");
    return NULL;
  }
  cav_error error = {0};
  cav_xml *other = cav_xml_read(path, roots, NULL, &error);
  if (!other) {
    if (error.status == CAV_NO_MEMORY) no_memory(e);
    cav_spec_fail(spec, asset, "file", "%.400s", error.text);
    return NULL;
  }
  cav_xml **slot = CAV_SPEC_PUSH(spec, &spec->others);
  if (!slot) {
    cav_xml_free(other);
    return NULL;
  }
  return *slot = other;
}

static void expand(expansion *e, cav_xml *xml, int depth);

// sections of the other file behind those of the host: what comes whole, and what refers to the attached alone
static void append_sections(expansion *e, cav_xml_node *root, const cav_xml_node *other, change *c, names *list,
                            int all) {
  static const char *const ordered[] = {"default", "asset", "tendon", "actuator", "contact", "equality", "sensor"};
  for (size_t i = 0; i < sizeof ordered / sizeof *ordered; i++) {
    for (const cav_xml_node *s = other->child; s && e->spec->status == CAV_OK; s = s->next) {
      if (!cav_xml_is(s, ordered[i])) continue;
      cav_xml_node empty = *s;
      empty.child = NULL;
      cav_xml_node *section = i < 2 ? copy_node(e, s, root, c) : copy_node(e, &empty, root, c);
      if (!section) return;
      put_last(root, section);
      for (const cav_xml_node *k = i < 2 ? NULL : s->child; k && e->spec->status == CAV_OK; k = k->next) {
        change known = {.named = list->at, .nnamed = list->n};
        if (!all && !refers(k, &known, 1)) continue;
        if (i < 4) collect_names(e, list, k);
        cav_xml_node *copy = copy_node(e, k, section, c);
        if (copy) put_last(section, copy);
      }
    }
  }
}

// a part of the model with compiler settings and classes of its own; 0 after a failure
static int push_part(expansion *e, const cav_xml *other, const char *prefix, const cav_spec_compiler *compiler) {
  cav_spec_part_of_file *p = CAV_SPEC_PUSH(e->spec, &e->spec->parts);
  if (!p) return 0;
  *p = (cav_spec_part_of_file){.path = cav_xml_path(other), .prefix = prefix, .compiler = *compiler};
  return e->spec->parts.n;
}

// copies and attachments in the other file, by its own settings; then the part that it becomes
static int settle_other(expansion *e, cav_xml *other, const char *prefix, int depth) {
  cav_spec *spec = e->spec;
  const cav_spec_compiler hosts = spec->compiler;
  const cav_spec_option option = spec->option;
  const cav_load_options load = spec->load;
  cav_mjcf_first_options(spec);
  cav_mjcf_read_options(spec, cav_xml_root(other));
  const cav_spec_compiler own = spec->compiler;
  expansion inner = {spec, other, e->nodes, e->nested};
  if (spec->status == CAV_OK) expand(&inner, other, depth + 1);
  e->nodes = inner.nodes;
  spec->compiler = hosts;
  spec->option = option;
  spec->load = load;
  return spec->status == CAV_OK ? push_part(e, other, prefix, &own) : 0;
}

static void write_out_attach(expansion *e, cav_xml_node *root, cav_xml_node *node, int depth) {
  cav_spec *spec = e->spec;
  const char *name = cav_xml_text(node, "model", ""), *body = cav_xml_text(node, "body", NULL);
  const char *frame_name = cav_xml_text(node, "frame", NULL), *prefix = cav_xml_text(node, "prefix", "");
  const cav_xml_node *asset = find_asset(root, name);
  if (!asset) {
    cav_spec_fail(spec, node, "model", "no model of that name among the assets, got '%.60s'", name);
    return;
  }
  cav_xml *other = read_other(e, asset, depth);
  if (!other) return;
  int part = settle_other(e, other, prefix, depth);
  if (!part) return;
  static const double none[3] = {0, 0, 0}, still[4] = {1, 0, 0, 0};
  cav_xml_node *from = (cav_xml_node *)cav_xml_root(other), *frame = make_frame(e, node, none, still), *picked = NULL;
  if (!frame) return;
  frame->part = part;
  names list = {0};
  change c = {.prefix = prefix, .suffix = "", .part = part};
  if (body || frame_name) {
    picked = cav_xml_find(from, body ? "body" : "frame", body ? body : frame_name);
    if (!picked)
      cav_spec_fail(spec, node, body ? "body" : "frame", "'%.60s' has no %s '%.60s'", cav_xml_path(other),
                    body ? "body" : "frame", body ? body : frame_name);
    else
      collect_names(e, &list, picked);
    cav_xml_node *copy = spec->status == CAV_OK ? copy_node(e, picked, frame, &c) : NULL;
    if (copy) put_last(frame, copy);
    for (const cav_xml_node *s = from->child; s; s = s->next)
      if (cav_xml_is(s, "asset")) collect_names(e, &list, s);
  }
  for (const cav_xml_node *s = picked || spec->status != CAV_OK ? NULL : from->child; s; s = s->next) {
    for (const cav_xml_node *k = cav_xml_is(s, "worldbody") ? s->child : NULL; k && spec->status == CAV_OK;
         k = k->next) {
      cav_xml_node *copy = copy_node(e, k, frame, &c);
      if (copy) put_last(frame, copy);
    }
  }
  for (const cav_xml_node *s = from->child; s; s = s->next)
    if (cav_xml_is(s, "keyframe"))
      cav_spec_leave(spec, node, "model", "left aside: keyframes of a model that is attached");
  if (spec->status == CAV_OK) append_sections(e, root, from, &c, &list, !picked);
  if (spec->status == CAV_OK) replace_node(node, frame, frame);
  free(list.at);
}

// --- the tree ---

// innermost first; what takes the place of an element needs no more
static void expand_all(expansion *e, cav_xml_node *root, cav_xml_node *node, int depth) {
  if (e->nested >= CAV_XML_DEPTH_LIMIT) {
    cav_spec_fail(e->spec, node, NULL, "elements are nested more than %d deep, with what is attached; attach less",
                  CAV_XML_DEPTH_LIMIT);
    return;
  }
  e->nested++;
  for (cav_xml_node *c = node->child, *next; c && e->spec->status == CAV_OK; c = next) {
    next = c->next;
    expand_all(e, root, c, depth);
    if (e->spec->status != CAV_OK) break;
    if (c->rule == &cav_replicate_element)
      write_out_replicate(e, root, c);
    else if (cav_xml_is(c, "attach"))
      write_out_attach(e, root, c, depth);
  }
  e->nested--;
}

static void expand(expansion *e, cav_xml *xml, int depth) {
  cav_xml_node *root = (cav_xml_node *)cav_xml_root(xml);
  for (cav_xml_node *s = root->child; s && e->spec->status == CAV_OK; s = s->next) {
    if (cav_xml_is(s, "worldbody")) expand_all(e, root, s, depth);
  }
}

void cav_expand(cav_spec *spec, cav_xml *xml) {
  expansion e = {spec, xml, 0, 0};
  expand(&e, xml, 0);
}
