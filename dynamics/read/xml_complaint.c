/// Complaints about XML files: place, element and attribute before the text, and what a misspelt or renamed name may
/// have meant. What is wrong is found elsewhere; here it is said, and the reader of the file told to stop.
#include <assert.h>
#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "xml_parts.h"

enum { WORD_LIMIT = 48 }; // characters compared when guessing a name

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

void cav_xml_source_fail(cav_xml_source *s, cav_status status, int line, const char *element, const char *attribute,
                         const char *format, ...) {
  cav_xml_reader *r = s->reader;
  if (r->status == CAV_OK) {
    r->status = status;
    va_list args;
    va_start(args, format);
    explain(r->error, status, s->path, line, element, attribute, format, args);
    va_end(args);
  }
  cav_xml_stop(s);
}

// --- guessing names ---

static int is_other(char a, char b) { return tolower((unsigned char)a) != tolower((unsigned char)b); }

// edits that turn a into b, whatever their case, both cut at WORD_LIMIT characters; two letters that change places are one
static int distance(const char *a, const char *b) {
  int edits[WORD_LIMIT + 1][WORD_LIMIT + 1];
  int n = (int)strnlen(a, WORD_LIMIT), m = (int)strnlen(b, WORD_LIMIT);
  for (int i = 0; i <= n; i++) {
    for (int j = 0; j <= m; j++) {
      int *best = &edits[i][j];
      *best = i + j;
      if (!i || !j) continue;
      *best = edits[i - 1][j - 1] + is_other(a[i - 1], b[j - 1]);
      if (edits[i - 1][j] + 1 < *best) *best = edits[i - 1][j] + 1;
      if (edits[i][j - 1] + 1 < *best) *best = edits[i][j - 1] + 1;
      if (i < 2 || j < 2 || is_other(a[i - 1], b[j - 2]) || is_other(a[i - 2], b[j - 1])) continue;
      if (edits[i - 2][j - 2] + 1 < *best) *best = edits[i - 2][j - 2] + 1;
    }
  }
  return edits[n][m];
}

const char *cav_xml_nearest(const char *word, const void *names, int n, size_t stride) {
  const char *best = NULL;
  int length = (int)strnlen(word, WORD_LIMIT), least = length < 3 ? 1 : 2 + length / 4;
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
  static const size_t tail = 16; // " and NNN more"
  size_t used = 0;
  text[0] = 0;
  for (int i = 0; names[i]; i++) {
    const size_t n = strlen(names[i]) + (i ? 2 : 0);
    if (used + n + (names[i + 1] ? tail : 1) > room) {
      int left = 0;
      while (names[i + left]) left++;
      snprintf(text + used, room - used, " and %d more", left);
      return;
    }
    used += (size_t)snprintf(text + used, room - used, "%s%s", i ? ", " : "", names[i]);
  }
}

static int is_part_of(const char *part, size_t length, const char *name) {
  for (; *name; name++)
    if (!strncasecmp(name, part, length)) return 1;
  return 0;
}

static int holds_parts(const char *word, const char *name) {
  int parts = 0;
  while (*word) {
    size_t length = 0;
    while (isalnum((unsigned char)word[length])) length++;
    if (length && !is_part_of(word, length, name)) return 0;
    parts += length > 1;
    word += length ? length : 1;
  }
  return parts > 0;
}

/// Of a text about names: what " and N more" takes at its end.
static const size_t more_room = 20;

void cav_xml_alike(const char *word, const void *names, int n, size_t stride, char *text, size_t room) {
  const char *found[9];
  int count = 0, all = 0;
  for (int any = 0; any < 2 && count == 0; any++) {
    all = 0;
    for (int i = 0; i < n; i++) {
      const char *name = *(const char *const *)((const char *)names + (size_t)i * stride);
      if (!name || !*name || (!any && !holds_parts(word, name))) continue;
      if (count < 8) found[count++] = name;
      all++;
    }
  }
  found[count] = NULL;
  list_names(text, room - more_room, found);
  const size_t used = strlen(text);
  if (all > count && !strstr(text, " more")) snprintf(text + used, room - used, " and %d more", all - count);
}

// --- names that no table knows ---

// what is known of a child or an attribute of that name that is none; NULL: nothing
static const cav_xml_former *former_of(const cav_xml_source *s, const char *inside, const char *name, int attribute) {
  for (const cav_xml_former *f = s->reader->former; f && f->inside; f++) {
    if (f->attribute == attribute && !strcmp(f->inside, inside) && !strcmp(f->was, name)) return f;
  }
  return NULL;
}

// the element under which one of the same name knows an attribute that this one does not; NULL: none. Tables hold themselves,
// such as bodies in bodies: sought so deep alone
static const cav_xml_element *known_under(const cav_xml_element *parent, const cav_xml_element *rule, const char *name,
                                          int deep) {
  const cav_xml_element *const *child = parent->child;
  for (int i = 0; child && child[i]; i++) {
    if (child[i] == rule || strcmp(child[i]->name, rule->name)) continue;
    for (const cav_xml_attribute *a = child[i]->attribute; a && a->name; a++)
      if (!strcmp(a->name, name)) return parent;
  }
  const cav_xml_element *under = NULL;
  for (int i = 0; child && child[i] && deep && !under; i++) under = known_under(child[i], rule, name, deep - 1);
  return under;
}

/// A word that other files use, and what it may be here, the likelier first.
typedef struct synonym {
  const char *word, *here[3];
} synonym;

static const synonym attribute_synonyms[] = {
    {"geom", {"body"}},
    {"tolerance", {"within"}},
    {"tol", {"within"}},
    {"error", {"within"}},
    {"accuracy", {"within"}},
    {"position", {"target", "pos"}},
    {"value", {"target", "pos"}},
    {"goal", {"target", "key"}},
    {"desired", {"target"}},
    {"reference", {"target"}},
    {"time", {"at", "duration"}},
    {"when", {"at", "time"}},
    {"t", {"at", "time"}},
    {"start", {"from"}},
    {"begin", {"from"}},
    {"until", {"to"}},
    {"stop", {"to"}},
    {"end", {"to"}},
    {"dt", {"timestep"}},
    {"step", {"timestep"}},
    {"h", {"timestep"}},
    {"length", {"duration"}},
    {"seconds", {"duration"}},
    {"integrator", {"order"}},
    {"min", {"lower"}},
    {"minimum", {"lower"}},
    {"max", {"upper"}},
    {"maximum", {"upper"}},
    {"cost", {"weight"}},
    {"gain", {"weight"}},
    {"w", {"weight"}},
    {"angle", {"degrees"}},
    {"deg", {"degrees"}},
    {"rad", {"pos"}},
    {"rpy", {"euler"}},
    {"rotation", {"euler"}},
    {"orientation", {"quat"}},
    {"quaternion", {"quat"}},
    {"q", {"qpos"}},
    {"v", {"qvel"}},
    {"pose", {"key"}},
    {"posture", {"key"}},
    {"keyframe", {"key"}},
    {"link", {"body"}},
    {"object", {"body"}},
    {"axis", {"component"}},
    {"dim", {"component"}},
    {"direction", {"component"}},
    {"robot", {"model"}},
    {"mjcf", {"model"}},
    {"urdf", {"model"}},
    {"id", {"name"}},
    {"label", {"name"}},
    {"kind", {"type"}},
    {"mu", {"friction"}},
};

static const synonym element_synonyms[] = {
    {"objective", {"cost"}},    {"objectives", {"cost"}}, {"initial", {"start"}},    {"init", {"start"}},
    {"final", {"goal"}},        {"end", {"goal"}},        {"worldbody", {"scene"}},  {"world", {"scene"}},
    {"environment", {"scene"}}, {"time", {"horizon"}},    {"position", {"sensor"}},  {"place", {"sensor"}},
    {"target", {"sensor"}},     {"keyframe", {"pose"}},   {"bound", {"constraint"}}, {"pos", {"sensor"}},
};

// words of attributes: sensors by what other programs call them
static const synonym word_synonyms[] = {
    {"frameposition", {"framepos"}},
    {"bodyposition", {"framepos"}},
    {"bodypos", {"framepos"}},
    {"position", {"framepos"}},
    {"pos", {"framepos"}},
    {"place", {"framepos"}},
    {"frameorientation", {"framequat"}},
    {"framequaternion", {"framequat"}},
    {"frameeuler", {"framequat"}},
    {"orientation", {"framequat"}},
    {"rotation", {"framequat"}},
    {"quat", {"framequat"}},
    {"com", {"subtreecom"}},
    {"centerofmass", {"subtreecom"}},
    {"centreofmass", {"subtreecom"}},
    {"jointposition", {"jointpos"}},
    {"jointangle", {"jointpos"}},
    {"angle", {"jointpos"}},
    {"jointvelocity", {"jointvel"}},
    {"framelinearvelocity", {"framelinvel"}},
    {"linearvelocity", {"framelinvel"}},
    {"velocity", {"framelinvel"}},
    {"frameangularvelocity", {"frameangvel"}},
    {"angularvelocity", {"frameangvel"}},
    {"contact", {"touch"}},
    {"contactforce", {"touch"}},
};

// what names [n] of a table have in the place of a word that other files use, NULL: nothing
static const char *synonym_of(const synonym *list, size_t length, const char *word, const void *names, int n,
                              size_t stride) {
  for (size_t i = 0; i < length; i++) {
    if (strcasecmp(list[i].word, word)) continue;
    for (int k = 0; k < 3 && list[i].here[k]; k++)
      for (int j = 0; j < n; j++) {
        const char *name = *(const char *const *)((const char *)names + (size_t)j * stride);
        if (name && !strcmp(name, list[i].here[k])) return name;
      }
  }
  return NULL;
}
#define SYNONYM_OF(list, ...) synonym_of(list, sizeof(list) / sizeof *(list), __VA_ARGS__)

void cav_xml_unknown_attribute(cav_xml_source *s, int line, const cav_xml_element *rule, const char *name) {
  const cav_xml_former *former = former_of(s, rule->name, name, 1);
  if (former && former->now)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name, "is called '%s' now; rename it", former->now);
  else if (former)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name, "%s", former->instead);
  if (former) return;
  const cav_xml_attribute *a = rule->attribute;
  int n = 0;
  while (a && a[n].name) n++;
  const char *near = n ? SYNONYM_OF(attribute_synonyms, name, a, n, sizeof *a) : NULL;
  if (n && !near) near = cav_xml_nearest(name, a, n, sizeof *a);
  const cav_xml_element *under = NULL, *const *root = s->reader->roots;
  for (int i = 0; root && root[i] && !under; i++) under = known_under(root[i], rule, name, 2);
  if (under)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name, "not known here; it belongs to <%s> inside <%s>",
                        rule->name, under->name);
  else if (near)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name, "not known here; did you mean '%s'?", near);
  else if (n) {
    const char *names[64];
    char list[300];
    int known = 0;
    for (; known < n && known < 63; known++) names[known] = a[known].name;
    names[known] = NULL;
    list_names(list, sizeof list, names);
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name,
                        "not known here; remove it, or take one that <%s> has: %s", rule->name, list);
  } else
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, rule->name, name, "not known here, the element has none; remove it");
}

void cav_xml_unknown_element(cav_xml_source *s, int line, const cav_xml_element *parent,
                             const cav_xml_element *const *allowed, const char *name) {
  const cav_xml_former *former = parent ? former_of(s, parent->name, name, 0) : NULL;
  if (former && former->now)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "is called <%s> now; rename it", former->now);
  else if (former)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "%s", former->instead);
  if (former) return;
  const char *names[120];
  int n = 0;
  for (; allowed && allowed[n] && n < 119; n++) names[n] = allowed[n]->name;
  names[n] = NULL;
  char list[300];
  list_names(list, sizeof list, names);
  const char *near = n ? SYNONYM_OF(element_synonyms, name, names, n, sizeof *names) : NULL;
  if (n && !near) near = cav_xml_nearest(name, names, n, sizeof *names);
  const char *inside = parent ? parent->name : "the file";
  if (near)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "not known inside %s; did you mean <%s>?", inside, near);
  else if (n)
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "not known inside %s; expected one of: %s", inside, list);
  else
    cav_xml_source_fail(s, CAV_BAD_INPUT, line, name, NULL, "%s has no elements inside; remove it", inside);
}

void cav_xml_unknown_word(cav_xml_source *s, int line, const char *element, const cav_xml_value *value,
                          const char *const *words, int n) {
  char list[200];
  list_names(list, sizeof list, words);
  const char *near = SYNONYM_OF(word_synonyms, value->text, words, n, sizeof *words);
  if (!near) near = cav_xml_nearest(value->text, words, n, sizeof *words);
  cav_xml_source_fail(s, CAV_BAD_INPUT, line, element, value->rule->name, "expected one of: %s; got '%.60s'%s%s%s",
                      list, value->text, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
}
