/// What all readers of models share: growing lists, the first failure, warnings, checks of single values.

#include "spec.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int cav_spec_grow(cav_spec *spec, void **at, int *n, int *room, size_t size) {
  if (spec->status != CAV_OK) return 0;
  if (*n == *room) {
    int more = *room ? 2 * *room : 16;
    void *moved = realloc(*at, (size_t)more * size);
    if (!moved) {
      cav_spec_no_memory(spec);
      return 0;
    }
    *at = moved;
    *room = more;
  }
  memset((char *)*at + (size_t)*n * size, 0, size);
  ++*n;
  return 1;
}

void cav_spec_no_memory(cav_spec *spec) {
  if (spec->status != CAV_OK) return;
  spec->status = CAV_NO_MEMORY;
  if (!spec->error) return;
  spec->error->status = CAV_NO_MEMORY;
  spec->error->line = 0;
  snprintf(spec->error->text, sizeof spec->error->text, "%.400s: no memory to build the model",
           cav_xml_path(spec->xml));
}

char *cav_spec_keep_text(cav_spec *spec, size_t size) {
  char **text = CAV_SPEC_PUSH(spec, &spec->kept);
  if (!text) return NULL;
  *text = calloc(1, size);
  if (!*text) cav_spec_no_memory(spec);
  return *text;
}

void cav_spec_fail(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *format, ...) {
  if (spec->status != CAV_OK) return;
  char text[600];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  spec->status = cav_xml_fail(spec->error, node, attribute, "%s", text);
}

void cav_spec_warn(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *format, ...) {
  char text[600];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  cav_error whole;
  cav_xml_fail(&whole, node, attribute, "%s", text);
  char **warning = CAV_SPEC_PUSH(spec, &spec->warning);
  if (!warning) return;
  *warning = strdup(whole.text);
  if (!*warning) cav_spec_no_memory(spec);
}

static void note(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *text, int lacking) {
  for (int i = 0; i < spec->note.n; i++) {
    if (strcmp(spec->note.at[i].text, text)) continue;
    spec->note.at[i].count++;
    return;
  }
  cav_spec_note *n = CAV_SPEC_PUSH(spec, &spec->note);
  if (n) *n = (cav_spec_note){node, attribute, text, 1, lacking};
}

void cav_spec_leave(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *text) {
  note(spec, node, attribute, text, 0);
}

void cav_spec_lack(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *text) {
  note(spec, node, attribute, text, 1);
}

// all that is lacking in one text, at the place of the first
static void fail_for_notes(cav_spec *spec) {
  char text[600] = "";
  size_t used = 0;
  const cav_spec_note *first = NULL;
  for (int i = 0; i < spec->note.n && used + 1 < sizeof text; i++) {
    const cav_spec_note *n = &spec->note.at[i];
    if (!n->lacking) continue;
    int more = first ? snprintf(text + used, sizeof text - used, ". Also <%s> in line %d: %s", n->node->rule->name,
                                n->node->line, n->text)
                     : snprintf(text, sizeof text, "%s", n->text);
    if (!first) first = n;
    used += more > 0 ? (size_t)more : 0;
    if (n->count > 1 && used + 1 < sizeof text) {
      more = snprintf(text + used, sizeof text - used, " (%d times)", n->count);
      used += more > 0 ? (size_t)more : 0;
    }
  }
  if (first) cav_spec_fail(spec, first->node, first->attribute, "%s", text);
}

void cav_spec_settle_notes(cav_spec *spec) {
  fail_for_notes(spec);
  for (int i = 0; i < spec->note.n && spec->status == CAV_OK; i++) {
    const cav_spec_note *n = &spec->note.at[i];
    const cav_xml_value *value = n->attribute ? cav_xml_get(n->node, n->attribute) : NULL;
    const char *given = value ? value->text : "", *quote = *given ? "'" : "", *end = *given ? "': " : "";
    if (n->count > 1)
      cav_spec_warn(spec, n->node, n->attribute, "%s%.200s%s%s (and %d more)", quote, given, end, n->text,
                    n->count - 1);
    else
      cav_spec_warn(spec, n->node, n->attribute, "%s%.200s%s%s", quote, given, end, n->text);
  }
  spec->note.n = 0;
}

void cav_spec_warn_of_prose(cav_spec *spec) {
  const char *file;
  int line, n = cav_xml_prose(spec->xml, &file, &line);
  cav_xml_node at = {.rule = cav_xml_root(spec->xml)->rule, .file = file, .line = line};
  if (n > 1) cav_spec_warn(spec, &at, NULL, "text between tags is passed over, here and in %d more places", n - 1);
  if (n == 1) cav_spec_warn(spec, &at, NULL, "text between tags is passed over");
}

void cav_spec_unknown(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *kind,
                      const char *name, const void *first, int n, size_t stride) {
  const char *near = cav_xml_nearest(name, first, n, stride);
  if (near)
    cav_spec_fail(spec, node, attribute, "no %s is named '%.60s'; did you mean '%.60s'?", kind, name, near);
  else
    cav_spec_fail(spec, node, attribute, "no %s is named '%.60s'; correct the name", kind, name);
}

void cav_spec_clear(cav_spec *spec) {
  for (int i = 0; i < spec->warning.n; i++) free(spec->warning.at[i]);
  for (int i = 0; i < spec->kept.n; i++) free(spec->kept.at[i]);
  free(spec->kept.at);
  for (int i = 0; i < spec->others.n; i++) cav_xml_free(spec->others.at[i]);
  free(spec->others.at);
  free(spec->parts.at);
  free(spec->warning.at);
  free(spec->note.at);
  free(spec->body.at);
  free(spec->joint.at);
  free(spec->geom.at);
  cav_clear_assets(spec);
  free(spec->site.at);
  free(spec->pair.at);
  free(spec->exclude.at);
  free(spec->tendon.at);
  free(spec->part.at);
  free(spec->path.at);
  free(spec->equality.at);
  free(spec->actuator.at);
  free(spec->sensor.at);
  free(spec->key.at);
}

// --- checks of single values ---

void cav_check_not_negative(cav_spec *spec, const cav_xml_node *node, const char *name, double value) {
  if (value < 0) cav_spec_fail(spec, node, name, "expected a number >= 0, got %g", value);
}

// solref: a time constant and a damping ratio, or both negative; what is neither is taken for the default by the law
void cav_check_softness(cav_spec *spec, const cav_xml_node *node, const char *where, const cav_softness *s) {
  if ((s->solref[0] > 0) != (s->solref[1] > 0))
    cav_spec_warn(spec, node, NULL,
                  "solref%s %g %g: expected both > 0 (time constant, damping ratio) or both <= 0 (direct); taken for "
                  "0.02 1, as in MuJoCo",
                  where, s->solref[0], s->solref[1]);
}

void cav_check_condim(cav_spec *spec, const cav_xml_node *node, int condim) {
  if (condim != 1 && condim != 3 && condim != 4 && condim != 6)
    cav_spec_fail(spec, node, "condim", "expected 1, 3, 4 or 6, got %d", condim);
}

int cav_name_find(const void *first, int n, size_t stride, const char *name) {
  if (!name || !*name) return -1;
  for (int i = 0; i < n; i++) {
    const char *other = *(const char *const *)((const char *)first + (size_t)i * stride);
    if (!strcmp(other, name)) return i;
  }
  return -1;
}

int cav_geom_weighs(const cav_spec *spec, const cav_spec_geom *g) {
  const cav_spec_compiler *c = &spec->compiler;
  if (g->has_mass ? g->mass == 0 : g->density == 0) return 0;
  if (g->body == 0 || g->type == CAV_GEOM_PLANE || g->type == CAV_GEOM_HFIELD || c->from_geoms == 0) return 0;
  if (spec->body.at[g->body].has_inertial && c->from_geoms != 1) return 0;
  return g->group >= c->group_range[0] && g->group <= c->group_range[1];
}
