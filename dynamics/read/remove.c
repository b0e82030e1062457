/// Takes bodies and geoms out of the tree of an MJCF file before it is read as a model: walls, height fields, a ball
/// that a motion has no use for. What refers to them goes too, and what refers to that, or the rest would not hold
/// together. Works on names by kind, as references do; keyframes stay as they are, and fit only where no coordinates
/// went.
#include "remove.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// clang-format off
static const cav_xml_attribute remove_attributes[] = {
    {"body", CAV_XML_TEXT, 1, 0, NULL, 0, &(const cav_xml_note){"", "(a geom by its name)", "body that goes, with all that it carries; beside geom= the body of that geom"}},
    {"geom", CAV_XML_TEXT, 1, 0, NULL, 0, &(const cav_xml_note){"", "(the whole body)", "geom that goes, by its name, or by its number in the body, from 1"}},
    {NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL}};
const cav_xml_element cav_remove_element = {
    "remove", 0, 0, remove_attributes, NULL, 0,
    "takes a body or a geom out of the model's file (MJCF), with all that refers to it"};
// clang-format on

/// A name that is gone, of a kind that references know.
typedef struct lost {
  const char *kind, *name;
} lost;

typedef struct omission {
  int n, room, failed;
  lost *item;
} omission;

static void lose(omission *o, const char *kind, const char *name) {
  if (!*name) return;
  if (o->n == o->room) {
    int room = o->room ? 2 * o->room : 32;
    lost *more = realloc(o->item, (size_t)room * sizeof *more);
    if (!more) {
      o->failed = 1;
      return;
    }
    o->item = more;
    o->room = room;
  }
  o->item[o->n++] = (lost){kind, name};
}

/// What references call the kind of an element.
static const char *kind_of(const cav_xml_node *node) {
  const char *section = node->parent ? node->parent->rule->name : "";
  if (!strcmp(section, "tendon")) return "tendon";
  if (!strcmp(section, "actuator")) return "actuator";
  return cav_xml_is(node, "freejoint") ? "joint" : node->rule->name;
}

static void lose_all(omission *o, const cav_xml_node *node) {
  lose(o, kind_of(node), cav_xml_text(node, "name", ""));
  for (const cav_xml_node *c = node->child; c; c = c->next) lose_all(o, c);
}

/// Whether the kind that an attribute names is that one: "joint2" and "jointinparent" name joints, "objname" what
/// "objtype" says.
static int names(const cav_xml_node *node, const char *attribute, const char *kind) {
  const char *type = !strcmp(attribute, "objname")   ? cav_xml_text(node, "objtype", "")
                     : !strcmp(attribute, "refname") ? cav_xml_text(node, "reftype", "")
                                                     : NULL;
  if (type) return !strcmp(*type == 'x' ? type + 1 : type, kind);
  size_t n = strlen(attribute), m = strlen(kind);
  return !strncmp(attribute, kind, m) || (!strcmp(kind, "site") && n >= 4 && !strcmp(attribute + n - 4, "site"));
}

/// Whether a node, or one in it, refers to something that is gone.
static int refers(const omission *o, const cav_xml_node *node) {
  for (int i = 0; i < node->nvalue; i++) {
    const cav_xml_value *value = &node->value[i];
    for (int k = 0; k < o->n; k++) {
      const char *attribute = value->rule->name;
      if (!strcmp(attribute, "name") || strcmp(value->text, o->item[k].name)) continue;
      if (names(node, attribute, o->item[k].kind)) return 1;
    }
  }
  for (const cav_xml_node *c = node->child; c; c = c->next)
    if (refers(o, c)) return 1;
  return 0;
}

/// Takes a node out of its parent's children.
static void unlink_node(cav_xml_node *node) {
  cav_xml_node **at = &node->parent->child;
  while (*at != node) at = &(*at)->next;
  *at = node->next;
}

/// Takes out what refers to what is gone; returns whether there was such a thing.
static int remove_referring(omission *o, cav_xml_node *root) {
  static const char *const sections[] = {"tendon", "actuator", "sensor", "equality", "contact"};
  int found = 0;
  for (cav_xml_node *section = root->child; section; section = section->next) {
    int known = 0;
    for (size_t i = 0; i < sizeof sections / sizeof *sections; i++) known |= cav_xml_is(section, sections[i]);
    for (cav_xml_node *c = known ? section->child : NULL, *next; c; c = next) {
      next = c->next;
      if (!refers(o, c)) continue;
      lose_all(o, c);
      unlink_node(c);
      found = 1;
    }
  }
  return found;
}

/// Counts the geoms of each body, in the order of the file: what is removed leaves the others their numbers.
static void number_geoms(cav_xml_node *node, int *count) {
  for (cav_xml_node *c = node->child; c; c = c->next) {
    int inner = 0;
    if (cav_xml_is(c, "geom")) c->number = ++*count;
    number_geoms(c, cav_xml_is(c, "body") ? &inner : count);
  }
}

/// The geom of that number in a body; bodies inside it are others.
static cav_xml_node *find_number(cav_xml_node *body, long number) {
  for (cav_xml_node *c = body->child; c; c = c->next) {
    if (cav_xml_is(c, "geom") && c->number == number) return c;
    cav_xml_node *below = cav_xml_is(c, "body") ? NULL : find_number(c, number);
    if (below) return below;
  }
  return NULL;
}

/// What a <remove> names, NULL with the reason in error.
static cav_xml_node *find_named(cav_xml *xml, const cav_xml_node *remove, cav_error *error) {
  const char *body = cav_xml_text(remove, "body", NULL), *geom = cav_xml_text(remove, "geom", NULL);
  const char *kind = body ? "body" : "geom", *name = body ? body : geom;
  char *end = NULL;
  long number = body && geom ? strtol(geom, &end, 10) : 0;
  if ((!body && !geom) || (end && (*end || end == geom || number < 1))) {
    cav_xml_fail(error, remove, NULL,
                 "expected one of the attributes body and geom, or a body and the number of a geom in it, from 1");
    return NULL;
  }
  cav_xml_node *found = NULL;
  for (cav_xml_node *c = ((cav_xml_node *)cav_xml_root(xml))->child; c && !found; c = c->next)
    if (cav_xml_is(c, "worldbody")) found = body && !strcmp(body, "world") && number ? c : cav_xml_find(c, kind, name);
  if (!found)
    cav_xml_fail(error, remove, kind, "the file '%s' has no %s of that name, got '%.200s'", cav_xml_path(xml), kind,
                 name);
  if (!found || !number) return found;
  found = find_number(found, number);
  if (!found)
    cav_xml_fail(error, remove, "geom", "the body '%.100s' has no geom number %ld in that file", body, number);
  return found;
}

static int has_number(const cav_xml_node *remove) { return cav_xml_get(remove, "body") && cav_xml_get(remove, "geom"); }

cav_status cav_xml_remove(cav_xml *xml, const cav_xml_node *scene, cav_error *error) {
  // the tree is ours alone until it has been read
  cav_xml_node *root = (cav_xml_node *)cav_xml_root(xml);
  const cav_xml_node *first = cav_xml_child(scene, &cav_remove_element);
  omission o = {0};
  cav_status status = CAV_OK;
  int n = 0, k = 0;
  for (const cav_xml_node *r = first; r; r = cav_xml_next(r)) n++;
  cav_xml_node **numbered = calloc((size_t)n + 1, sizeof(cav_xml_node *));
  if (!numbered) return cav_xml_fail_as(error, CAV_NO_MEMORY, scene, NULL, "not enough memory");
  int count = 0;
  for (cav_xml_node *c = root->child; c; c = c->next)
    if (cav_xml_is(c, "worldbody")) number_geoms(c, &count);
  // found before anything goes
  for (const cav_xml_node *r = first; r && status == CAV_OK; r = cav_xml_next(r)) {
    if (has_number(r) && !(numbered[k++] = find_named(xml, r, error))) status = CAV_BAD_INPUT;
  }
  for (const cav_xml_node *r = first; r && status == CAV_OK; r = cav_xml_next(r)) {
    if (has_number(r)) continue;
    cav_xml_node *found = find_named(xml, r, error);
    if (!found) {
      status = CAV_BAD_INPUT;
      break;
    }
    lose_all(&o, found);
    unlink_node(found);
  }
  for (int i = 0; i < k && status == CAV_OK; i++) {
    // the same number twice is gone once
    int again = 0;
    for (int j = 0; j < i; j++) again |= numbered[j] == numbered[i];
    if (again) continue;
    lose_all(&o, numbered[i]);
    unlink_node(numbered[i]);
  }
  free(numbered);
  while (status == CAV_OK && o.n > 0 && remove_referring(&o, root)) continue;
  if (o.failed) status = cav_xml_fail_as(error, CAV_NO_MEMORY, scene, NULL, "not enough memory");
  free(o.item);
  return status;
}
