/// A model in the making: a tree of MJCF's elements made in code, written out as MJCF and read as such. So what a draft
/// may hold is what a file may hold, checked by the same grammar, and both give the same arrays to the bit: numbers are
/// written with 17 digits. Attributes are kept as text; what cannot be kept (memory, an element that there is not) is
/// remembered and told when it is compiled.
#include <locale.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/model.h"

typedef struct attribute {
  char *name, *value;
} attribute;

typedef struct element {
  char *name;
  int parent, child, last, next; ///< -1: none
  int nattribute;
  attribute *attribute;
} element;

struct cav_draft {
  int n, room;
  element *element; ///< [n] 0: the root, 1: the world
  cav_error error;  ///< what went wrong first
  char *text;       ///< written last
};

static void fail(cav_draft *draft, cav_status status, const char *format, ...) __attribute__((format(printf, 3, 4)));
static void fail(cav_draft *draft, cav_status status, const char *format, ...) {
  if (draft->error.status != CAV_OK) return;
  va_list args;
  draft->error.status = status;
  va_start(args, format);
  vsnprintf(draft->error.text, sizeof draft->error.text, format, args);
  va_end(args);
}

static char *copy(cav_draft *draft, const char *text) {
  char *made = text ? strdup(text) : NULL;
  if (!made) fail(draft, CAV_NO_MEMORY, "no memory for the draft of a model");
  return made;
}

int cav_draft_add(cav_draft *draft, int parent, const char *name) {
  if (draft->error.status != CAV_OK) return -1;
  if (parent < -1 || parent >= draft->n || (parent < 0) != (draft->n == 0)) {
    fail(draft, CAV_BAD_INPUT, "draft: <%.60s> is put into element %d, which there is not", name ? name : "", parent);
    return -1;
  }
  if (draft->n == draft->room) {
    int room = draft->room ? 2 * draft->room : 64;
    element *larger = realloc(draft->element, (size_t)room * sizeof *larger);
    if (!larger) fail(draft, CAV_NO_MEMORY, "no memory for the draft of a model");
    if (!larger) return -1;
    draft->element = larger;
    draft->room = room;
  }
  int made = draft->n;
  draft->element[made] = (element){.parent = parent, .child = -1, .last = -1, .next = -1};
  if (!(draft->element[made].name = copy(draft, name))) return -1;
  draft->n++;
  if (parent < 0) return made;
  element *p = &draft->element[parent];
  if (p->last >= 0)
    draft->element[p->last].next = made;
  else
    p->child = made;
  p->last = made;
  return made;
}

void cav_draft_text(cav_draft *draft, int at, const char *name, const char *value) {
  if (draft->error.status != CAV_OK) return;
  if (at < 0 || at >= draft->n || !name || !value) {
    fail(draft, CAV_BAD_INPUT, "draft: attribute '%.60s' of element %d: there is no such element, or nothing is given",
         name ? name : "", at);
    return;
  }
  element *e = &draft->element[at];
  char *made = copy(draft, value);
  for (int i = 0; i < e->nattribute && made; i++) {
    if (strcmp(e->attribute[i].name, name)) continue;
    free(e->attribute[i].value);
    e->attribute[i].value = made;
    return;
  }
  attribute *larger = made ? realloc(e->attribute, ((size_t)e->nattribute + 1) * sizeof *larger) : NULL;
  if (larger) e->attribute = larger;
  char *key = larger ? copy(draft, name) : NULL;
  if (made && !larger) fail(draft, CAV_NO_MEMORY, "no memory for the draft of a model");
  if (key)
    e->attribute[e->nattribute++] = (attribute){key, made};
  else
    free(made);
}

void cav_draft_numbers(cav_draft *draft, int at, const char *name, const double *value, int n) {
  if (draft->error.status != CAV_OK) return;
  // a sign, a point, 17 digits, an exponent of up to five, a blank
  size_t room = 32 * (size_t)(n > 0 ? n : 0) + 1, length = 0;
  char *text = malloc(room);
  locale_t plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
  if (text && plain) {
    locale_t users = uselocale(plain);
    text[0] = 0;
    for (int i = 0; i < n; i++)
      length += (size_t)snprintf(text + length, room - length, "%s%.17g", i ? " " : "", value[i]);
    uselocale(users);
    cav_draft_text(draft, at, name, text);
  } else {
    fail(draft, CAV_NO_MEMORY, "no memory for the draft of a model");
  }
  if (plain) freelocale(plain);
  free(text);
}

cav_draft *cav_draft_new(const char *name) {
  cav_draft *draft = calloc(1, sizeof *draft);
  if (!draft) return NULL;
  int root = cav_draft_add(draft, -1, "mujoco"), world = cav_draft_add(draft, root, "worldbody");
  int compiler = cav_draft_add(draft, root, "compiler");
  if (root == CAV_DRAFT_ROOT && world == CAV_DRAFT_WORLD) {
    cav_draft_text(draft, root, "model", name ? name : "model");
    cav_draft_text(draft, compiler, "angle", "radian");
  }
  if (draft->error.status == CAV_OK) return draft;
  cav_draft_free(draft);
  return NULL;
}

void cav_draft_free(cav_draft *draft) {
  if (!draft) return;
  for (int i = 0; i < draft->n; i++) {
    element *e = &draft->element[i];
    for (int k = 0; k < e->nattribute; k++) free(e->attribute[k].name), free(e->attribute[k].value);
    free(e->attribute), free(e->name);
  }
  free(draft->element), free(draft->text);
  free(draft);
}

// ---------------------------------------------------------------- writing

static void write_escaped(FILE *out, const char *text) {
  for (; *text; text++) {
    if (strchr("<>&\"", *text) || (unsigned char)*text < ' ')
      fprintf(out, "&#%d;", *text);
    else
      fputc(*text, out);
  }
}

static void write_tag(FILE *out, const element *e, int indent) {
  fprintf(out, "%*s<%s", indent, "", e->name);
  for (int i = 0; i < e->nattribute; i++) {
    fprintf(out, " %s=\"", e->attribute[i].name);
    write_escaped(out, e->attribute[i].value);
    fputc('"', out);
  }
  fputs(e->child < 0 ? "/>\n" : ">\n", out);
}

const char *cav_draft_mjcf(cav_draft *draft) {
  char *text = NULL;
  size_t size;
  if (draft->error.status != CAV_OK) return NULL;
  FILE *out = open_memstream(&text, &size);
  for (int at = 0, indent = 0; out && at >= 0;) {
    const element *e = &draft->element[at];
    write_tag(out, e, indent);
    if (e->child >= 0) {
      at = e->child;
      indent += 2;
      continue;
    }
    // on to the next, by way of the elements that end here
    while (at >= 0 && draft->element[at].next < 0) {
      at = draft->element[at].parent;
      indent -= 2;
      if (at >= 0) fprintf(out, "%*s</%s>\n", indent, "", draft->element[at].name);
    }
    if (at >= 0) at = draft->element[at].next;
  }
  int whole = out && !ferror(out);
  if (out && fclose(out)) whole = 0;
  // what closes the stream may be left without memory and say nothing
  if (!whole || !text) {
    free(text);
    fail(draft, CAV_NO_MEMORY, "no memory for the draft of a model");
    return NULL;
  }
  free(draft->text);
  draft->text = text;
  return text;
}

cav_model *cav_draft_compile(cav_draft *draft, const char *folder, const cav_load_options *options, cav_error *error) {
  const char *text = cav_draft_mjcf(draft);
  if (text) return cav_model_parse(text, folder, options, error);
  if (error) *error = draft->error;
  return NULL;
}
