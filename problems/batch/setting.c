/// The text of the file is changed in place, so that all else stays as written. What may stand where is the grammar's
/// (optim/problem/grammar.c): an element or attribute that it knows and the file lacks is added.
#include "setting.h"

#include <ctype.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "problem_file.h"
#include "result.h"

enum { TAGS = 4096, SEGMENTS = 16, NAME = 128 };

// an element: places in the text
typedef struct tag {
  int parent;        ///< index, -1: none
  size_t name, tail; ///< first character of its name; the '>' or '/>' of its start
  size_t end;        ///< the '<' of its end, or tail where it is empty
  int empty;
} tag;

// a file as it is changed
typedef struct sheet {
  const char *source;
  char *text;
  int n;
  tag tag[TAGS];
} sheet;

// ---------------------------------------------------------------- reading

static int is_name(char c) { return isalnum((unsigned char)c) || c == '_' || c == '-' || c == '.' || c == ':'; }

static size_t name_length(const char *text) {
  size_t n = 0;
  while (is_name(text[n])) n++;
  return n;
}

// past a comment, an instruction or raw text that begins here; 0: none does
static size_t pass(const char *text) {
  static const char *const pair[][2] = {{"<!--", "-->"}, {"<?", "?>"}, {"<![CDATA[", "]]>"}, {"<!", ">"}};
  for (size_t k = 0; k < sizeof pair / sizeof *pair; k++) {
    if (strncmp(text, pair[k][0], strlen(pair[k][0]))) continue;
    const char *end = strstr(text, pair[k][1]);
    return end ? (size_t)(end - text) + strlen(pair[k][1]) : strlen(text);
  }
  return 0;
}

// the end of a start tag: its '>', or the '/' before it
static size_t find_tail(const char *text, size_t at) {
  char quote = 0;
  for (; text[at] && (quote || text[at] != '>'); at++) {
    if (quote && text[at] == quote)
      quote = 0;
    else if (!quote && (text[at] == '"' || text[at] == '\''))
      quote = text[at];
  }
  return at && text[at - 1] == '/' ? at - 1 : at;
}

// places of all elements; 0 where there are too many
static int scan(sheet *s) {
  int open = -1;
  s->n = 0;
  for (size_t at = 0; s->text[at];) {
    size_t over = s->text[at] == '<' ? pass(s->text + at) : 1;
    if (over) {
      at += over;
    } else if (s->text[at + 1] == '/') {
      if (open >= 0) s->tag[open].end = at, open = s->tag[open].parent;
      at++;
    } else {
      if (s->n == TAGS) return 0;
      size_t tail = find_tail(s->text, at + 1);
      int empty = s->text[tail] == '/';
      s->tag[s->n] = (tag){open, at + 1, tail, tail, empty};
      if (!empty) open = s->n;
      s->n++;
      at = tail;
    }
  }
  return 1;
}

static int is_called(const sheet *s, int k, const char *name) {
  const char *text = s->text + s->tag[k].name;
  size_t n = name_length(text);
  return strlen(name) == n && !strncmp(text, name, n);
}

static void copy_name(const sheet *s, int k, char out[NAME]) {
  const char *text = s->text + s->tag[k].name;
  snprintf(out, NAME, "%.*s", (int)name_length(text), text);
}

// place and length of an attribute's value; 0: there is none
static int find_value(const sheet *s, int k, const char *attribute, size_t *value, size_t *length) {
  size_t at = s->tag[k].name, end = s->tag[k].tail;
  at += name_length(s->text + at);
  while (at < end) {
    at += strspn(s->text + at, " \t\r\n");
    size_t n = name_length(s->text + at), name = at;
    if (n == 0) return 0;
    at += n;
    at += strspn(s->text + at, " \t\r\n=");
    if (at >= end) return 0;
    const char *close = strchr(s->text + at + 1, s->text[at]);
    if (!close) return 0;
    *value = at + 1;
    *length = (size_t)(close - s->text) - at - 1;
    if (strlen(attribute) == n && !strncmp(s->text + name, attribute, n)) return 1;
    at += *length + 2;
  }
  return 0;
}

// what the attribute name of an element says, "" without one
static void copy_label(const sheet *s, int k, char out[NAME]) {
  size_t value = 0, length = 0;
  out[0] = 0;
  if (find_value(s, k, "name", &value, &length)) snprintf(out, NAME, "%.*s", (int)length, s->text + value);
}

// ---------------------------------------------------------------- changing

// puts a text in the place of some characters; 0 without memory
static int replace(sheet *s, size_t at, size_t length, const char *with) {
  size_t n = strlen(s->text), m = strlen(with);
  char *text = malloc(n + m + 1);
  if (!text) return 0;
  memcpy(text, s->text, at);
  memcpy(text + at, with, m);
  strcpy(text + at + m, s->text + at + length);
  free(s->text);
  s->text = text;
  return scan(s);
}

// a value as it may stand between quotes; NULL without memory
static char *escape(const char *value) {
  char *text = malloc(6 * strlen(value) + 1), *out = text;
  for (; text && *value; value++) {
    const char *as = *value == '&'    ? "&amp;"
                     : *value == '<'  ? "&lt;"
                     : *value == '"'  ? "&quot;"
                     : *value == '\'' ? "&apos;"
                                      : NULL;
    if (as)
      out = stpcpy(out, as);
    else
      *out++ = *value;
  }
  if (text) *out = 0;
  return text;
}

// ---------------------------------------------------------------- elements by their names

static const cav_xml_element *child_rule(const cav_xml_element *rule, const char *name) {
  for (int i = 0; rule && rule->child && rule->child[i]; i++)
    if (!strcmp(rule->child[i]->name, name)) return rule->child[i];
  return NULL;
}

// the only child of an element that a segment names; -1: none, -2: several
static int find_child(const sheet *s, int parent, const char *segment) {
  char name[NAME], label[NAME];
  int number = 0, found = -1, count = 0;
  const char *bracket = strchr(segment, '[');
  snprintf(name, sizeof name, "%.*s", bracket ? (int)(bracket - segment) : NAME - 1, segment);
  if (bracket) number = atoi(bracket + 1);
  for (int by_label = 0; by_label < 2 && found == -1; by_label++) {
    count = 0;
    for (int k = 0; k < s->n; k++) {
      if (s->tag[k].parent != parent) continue;
      copy_label(s, k, label);
      if (by_label ? strcmp(label, name) != 0 : !is_called(s, k, name)) continue;
      count++;
      if (number ? count == number : 1) found = found == -1 ? k : number ? found : -2;
    }
  }
  return found;
}

// names of what an element holds, for a complaint
typedef struct names {
  int n;
  char text[64][NAME];
  const char *name[64];
} names;

static void add_name(names *list, const char *name) {
  if (list->n == 64 || !*name) return;
  for (int i = 0; i < list->n; i++)
    if (!strcmp(list->name[i], name)) return;
  snprintf(list->text[list->n], NAME, "%s", name);
  list->name[list->n] = list->text[list->n];
  list->n++;
}

static cav_status complain(const sheet *s, const cav_setting *setting, int parent, const char *segment,
                           const names *list, cav_error *error) {
  char inside[NAME], known[300] = "";
  copy_name(s, parent, inside);
  const char *near = list->n ? cav_xml_nearest(segment, list->name, list->n, sizeof *list->name) : NULL;
  for (int i = 0, used = 0; i < list->n && used < 280; i++)
    used += snprintf(known + used, sizeof known - (size_t)used, "%s%s", i ? ", " : "", list->name[i]);
  return cav_file_fail(error, CAV_BAD_INPUT, 0,
                       "--set %.120s: <%s> of %.120s has no '%.60s'%s%s%s; it has or may have: %s", setting->path,
                       inside, s->source, segment, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "",
                       *known ? known : "nothing");
}

// no child of that name, or several
static cav_status refuse_child(const sheet *s, const cav_setting *setting, int parent, const cav_xml_element *rule,
                               const char *segment, int found, cav_error *error) {
  names list = {0};
  char label[NAME];
  for (int k = 0; k < s->n; k++) {
    if (s->tag[k].parent != parent) continue;
    copy_label(s, k, label);
    add_name(&list, label);
    copy_name(s, k, label);
    add_name(&list, label);
  }
  for (int i = 0; rule && rule->child && rule->child[i]; i++) add_name(&list, rule->child[i]->name);
  if (found == -2)
    return cav_file_fail(
        error, CAV_BAD_INPUT, 0,
        "--set %.120s: several '%.60s' in %.120s: give one a name, or say which by its number, %.60s[1]", setting->path,
        segment, s->source, segment);
  return complain(s, setting, parent, segment, &list, error);
}

static cav_status refuse_attribute(const sheet *s, const cav_setting *setting, int k, const cav_xml_element *rule,
                                   const char *attribute, cav_error *error) {
  names list = {0};
  for (int i = 0; rule && rule->attribute && rule->attribute[i].name; i++) add_name(&list, rule->attribute[i].name);
  return complain(s, setting, k, attribute, &list, error);
}

static int has_attribute(const cav_xml_element *rule, const char *name) {
  for (int i = 0; rule && rule->attribute && rule->attribute[i].name; i++)
    if (!strcmp(rule->attribute[i].name, name)) return 1;
  return 0;
}

// ---------------------------------------------------------------- one setting

// elements that the file lacks, the innermost with the attribute, before the end of element k
static int add_elements(sheet *s, int k, int n, char *const *segment, const char *attribute, const char *value) {
  char *text = NULL, name[NAME];
  size_t length;
  FILE *out = open_memstream(&text, &length);
  if (!out) return 0;
  int empty = s->tag[k].empty;
  copy_name(s, k, name);
  if (empty) fputc('>', out);
  for (int i = 0; i < n; i++) fprintf(out, "<%s%s", segment[i], i + 1 < n ? ">" : "");
  fprintf(out, " %s=\"%s\"/>", attribute, value);
  for (int i = n - 2; i >= 0; i--) fprintf(out, "</%s>", segment[i]);
  if (empty) fprintf(out, "</%s>", name);
  if (fclose(out) != 0) return 0;
  // of an empty element its '/>' goes
  int good = replace(s, s->tag[k].end, empty ? 2 : 0, text);
  free(text);
  return good;
}

static cav_status no_memory(cav_error *error) {
  return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for --set, or a file of more than %d elements", TAGS);
}

static cav_status change(sheet *s, const cav_setting *setting, int n, char *const *segment, const char *attribute,
                         cav_error *error) {
  const cav_xml_element *rule = &cav_problem_element;
  int at = 0, i = 0;
  for (; i < n; i++) {
    int next = find_child(s, at, segment[i]);
    if (next < 0) break;
    char name[NAME];
    copy_name(s, next, name);
    rule = child_rule(rule, name);
    at = next;
  }
  int found = i < n ? find_child(s, at, segment[i]) : at;
  const cav_xml_element *inner = rule;
  // what the file lacks and the grammar knows can be added
  for (int k = i; k < n; k++) {
    const cav_xml_element *child = found == -2 ? NULL : child_rule(inner, segment[k]);
    if (!child) return refuse_child(s, setting, at, inner, segment[k], found, error);
    inner = child;
  }
  size_t value = 0, length = 0;
  int given = i == n && find_value(s, at, attribute, &value, &length);
  if (!given && !has_attribute(inner, attribute)) return refuse_attribute(s, setting, at, inner, attribute, error);
  char *text = escape(setting->value), added[64 + NAME];
  int good = text != NULL;
  if (good && given) {
    good = replace(s, value, length, text);
  } else if (good && i == n) {
    snprintf(added, sizeof added, " %.*s=\"\"", NAME - 1, attribute);
    size_t place = s->tag[at].name + name_length(s->text + s->tag[at].name);
    good = replace(s, place, 0, added) && find_value(s, at, attribute, &value, &length) && replace(s, value, 0, text);
  } else if (good) {
    good = add_elements(s, at, n - i, segment + i, attribute, text);
  }
  free(text);
  return good ? CAV_OK : no_memory(error);
}

static cav_status apply(sheet *s, const cav_setting *setting, cav_error *error) {
  char *path = strdup(setting->path), *segment[SEGMENTS], *rest = path, *word, *attribute = NULL;
  int n = 0, good = path != NULL;
  if (!good) return no_memory(error);
  while ((word = strsep(&rest, "/"))) {
    if (*word == '@' && !rest) attribute = word + 1;
    if (*word == '@' || !*word) continue;
    if (n < SEGMENTS) segment[n++] = word;
  }
  // the root may be named
  int from = n && is_called(s, 0, segment[0]) ? 1 : 0;
  cav_status status = CAV_OK;
  if (!attribute || !*attribute)
    status = cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "--set %.200s: expected names of elements and an attribute, as cost/apex/@target=0.4",
                           setting->path);
  else
    status = change(s, setting, n - from, segment + from, attribute, error);
  free(path);
  return status;
}

// ---------------------------------------------------------------- paths of files

// makes what stands in an attribute absolute
static int make_absolute(sheet *s, int k, const char *attribute, const char *folder) {
  size_t value, length;
  if (!find_value(s, k, attribute, &value, &length) || !length || s->text[value] == '/') return 1;
  char *before = malloc(strlen(folder) + 2);
  if (!before) return 0;
  sprintf(before, "%s/", folder);
  char *text = escape(before);
  int good = text && replace(s, value, 0, text);
  free(text);
  free(before);
  return good;
}

static int make_all_absolute(sheet *s) {
  char *folder = cav_result_folder_of(s->source);
  char *full = folder ? realpath(folder, NULL) : NULL;
  int good = full && make_absolute(s, 0, "model", full);
  for (int k = 0; k < s->n && good; k++) good = make_absolute(s, k, "file", full);
  free(folder);
  free(full);
  return good;
}

static cav_status open_sheet(const char *source, sheet **out, cav_error *error) {
  // what is not a problem file at all is told as its reader does
  cav_xml *xml =
      cav_xml_read(source, (const cav_xml_element *const[]){&cav_problem_element, NULL}, cav_problem_former, error);
  if (!xml) return error->status;
  cav_xml_free(xml);
  sheet *s = calloc(1, sizeof *s);
  size_t length = 0;
  FILE *file = fopen(source, "r"), *copy = s ? open_memstream(&s->text, &length) : NULL;
  int c, good = file && copy;
  while (good && (c = fgetc(file)) != EOF) fputc(c, copy);
  if (copy) good = fclose(copy) == 0 && good;
  if (file) fclose(file);
  if (s) s->source = source;
  *out = s;
  return good && scan(s) && s->n ? CAV_OK : no_memory(error);
}

static void close_sheet(sheet *s) {
  if (s) free(s->text);
  free(s);
}

cav_status cav_setting_write(const char *source, int n, const cav_setting *setting, const char *target,
                             cav_error *error) {
  sheet *s = NULL;
  cav_file file;
  cav_status status = open_sheet(source, &s, error);
  for (int i = 0; i < n && !status; i++) status = apply(s, &setting[i], error);
  if (!status && !make_all_absolute(s)) status = no_memory(error);
  if (!status) status = cav_file_begin(&file, target, error);
  if (!status) {
    fputs(s->text, file.stream);
    status = cav_file_end(&file, error);
  }
  close_sheet(s);
  return status;
}

char *cav_setting_root(const char *source, const char *attribute) {
  sheet *s = NULL;
  cav_error ignored = {0};
  size_t value, length;
  char *text = NULL;
  if (!open_sheet(source, &s, &ignored) && find_value(s, 0, attribute, &value, &length))
    text = strndup(s->text + value, length);
  close_sheet(s);
  return text ? text : strdup("");
}
