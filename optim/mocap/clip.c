/// Clips of recorded motion: what all formats share, and the choice among them.
#include "clip.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "csv.h"
#include "file.h"

static const size_t most_bytes = (size_t)1 << 30;

void cav_record_free(cav_record *record) {
  if (!record) return;
  for (int i = 0; i < record->nmarker && record->name; i++) free(record->name[i]);
  free(record->name);
  free(record->time);
  free(record->position);
  free(record);
}

cav_record *cav_record_new(int nframe, int nmarker, double rate) {
  cav_clip clip = {0};
  if (nframe < 1 || nmarker < 1 || !(rate > 0)) return NULL;
  cav_record *record = cav_clip_new(&clip, nmarker);
  for (int t = 0; t < nframe && record; t++) {
    if (cav_clip_frame(&clip, t / rate)) continue;
    cav_record_free(record);
    return NULL;
  }
  return record;
}

cav_status cav_clip_open(cav_clip_text *text, const char *path, cav_error *error) {
  struct stat about;
  *text = (cav_clip_text){.path = path, .error = error};
  FILE *file = fopen(path, "rb");
  if (!file) return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be opened: %s", path, strerror(errno));
  int regular = !fstat(fileno(file), &about) && S_ISREG(about.st_mode);
  cav_status status = CAV_OK;
  if (!regular || (size_t)about.st_size > most_bytes)
    status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: expected a file of at most 1 GB", path);
  if (!status && !(text->data = malloc((size_t)about.st_size + 1))) status = cav_clip_no_memory(text);
  if (!status) {
    text->size = fread(text->data, 1, (size_t)about.st_size, file);
    text->data[text->size] = 0;
    text->rest = text->data;
    if (ferror(file)) status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be read: %s", path, strerror(errno));
  }
  fclose(file);
  return status;
}

void cav_clip_close(cav_clip_text *text) {
  free(text->data);
  text->data = text->rest = NULL;
}

char *cav_clip_line(cav_clip_text *text) {
  char *line = text->rest;
  if (!line || line >= text->data + text->size) return NULL;
  char *end = strchr(line, '\n');
  text->rest = end ? end + 1 : NULL;
  if (end) *end = 0;
  size_t n = strlen(line);
  if (n && line[n - 1] == '\r') line[n - 1] = 0;
  text->line++;
  return line;
}

char *cav_clip_field(char **line, char separator) {
  char *field = *line, *end = strchr(field, separator);
  *line = end ? end + 1 : NULL;
  if (end) *end = 0;
  while (*field == ' ' || *field == '\t') field++;
  size_t n = strlen(field);
  while (n && (field[n - 1] == ' ' || field[n - 1] == '\t')) field[--n] = 0;
  if (n >= 2 && field[0] == '"' && field[n - 1] == '"') field[n - 1] = 0, field++;
  return field;
}

double cav_clip_number(const char *field) {
  char *end;
  if (!*field || !strcasecmp(field, "nan")) return NAN;
  double value = cav_file_number(field, &end);
  return end == field || *end || isnan(value) ? INFINITY : value;
}

cav_status cav_clip_fail(const cav_clip_text *text, const char *format, ...) {
  char words[600];
  va_list list;
  va_start(list, format);
  vsnprintf(words, sizeof words, format, list);
  va_end(list);
  if (!text->line) return cav_file_fail(text->error, CAV_BAD_INPUT, 0, "%s: %s", text->path, words);
  return cav_file_fail(text->error, CAV_BAD_INPUT, text->line, "%s:%d: %s", text->path, text->line, words);
}

cav_status cav_clip_no_memory(const cav_clip_text *text) {
  return cav_file_fail(text->error, CAV_NO_MEMORY, 0, "%s: no memory for the clip", text->path);
}

cav_record *cav_clip_new(cav_clip *clip, int nmarker) {
  *clip = (cav_clip){.record = calloc(1, sizeof(cav_record))};
  if (!clip->record) return NULL;
  clip->record->nmarker = nmarker;
  clip->record->name = calloc((size_t)nmarker, sizeof *clip->record->name);
  if (!clip->record->name) {
    cav_record_free(clip->record);
    clip->record = NULL;
  }
  return clip->record;
}

double *cav_clip_frame(cav_clip *clip, double time) {
  cav_record *r = clip->record;
  size_t numbers = 3 * (size_t)r->nmarker;
  if (r->nframe == clip->room) {
    if (clip->room > INT_MAX / 2) return NULL;
    int room = clip->room ? 2 * clip->room : 256;
    double *at = realloc(r->time, (size_t)room * sizeof *at);
    if (at) r->time = at;
    double *position = realloc(r->position, (size_t)room * numbers * sizeof *position);
    if (position) r->position = position;
    if (!at || !position) return NULL;
    clip->room = room;
  }
  double *frame = r->position + (size_t)r->nframe * numbers;
  for (size_t i = 0; i < numbers; i++) frame[i] = NAN;
  r->time[r->nframe++] = time;
  return frame;
}

// to m, z up: the axes follow each other round, which keeps their hand
static void turn(cav_record *r, double unit, char up) {
  int z = up == 'x' ? 0 : up == 'y' ? 1 : 2;
  for (size_t i = 0; i < (size_t)r->nframe * (size_t)r->nmarker; i++) {
    double p[3], *x = r->position + 3 * i;
    memcpy(p, x, sizeof p);
    // y up: x forward, z to the right; x up: y forward, z to the left
    if (z == 1)
      x[0] = unit * p[0], x[1] = -unit * p[2], x[2] = unit * p[1];
    else
      for (int k = 0; k < 3; k++) x[k] = unit * p[(k + z + 1) % 3];
    if (!(isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]))) x[0] = x[1] = x[2] = NAN;
  }
}

// what a table cannot hold becomes '_', as do blanks at the ends; a marker without a name is called by its number, #1 ...
static cav_status clean_names(const cav_clip_text *text, cav_record *r) {
  for (int i = 0; i < r->nmarker; i++) {
    char *name = r->name[i], number[16];
    for (char *c = name; c && *c; c++)
      if ((unsigned char)*c < ' ' || *c == ',' || *c == '"' || (*c == ' ' && (c == name || !c[1]))) *c = '_';
    if (name && *name) continue;
    snprintf(number, sizeof number, "#%d", i + 1);
    free(name);
    if (!(r->name[i] = strdup(number))) return cav_clip_no_memory(text);
  }
  return CAV_OK;
}

// times increase, names differ
static cav_status check(const cav_clip_text *text, const cav_record *r) {
  for (int t = 1; t < r->nframe; t++)
    if (!(r->time[t] > r->time[t - 1]))
      return cav_file_fail(text->error, CAV_BAD_INPUT, 0,
                           "%s: frame %d: expected times that increase, got %g s after %g s", text->path, t + 1,
                           r->time[t], r->time[t - 1]);
  for (int i = 0; i < r->nmarker; i++)
    for (int j = 0; j < i; j++)
      if (!strcmp(r->name[i], r->name[j]))
        return cav_file_fail(text->error, CAV_BAD_INPUT, 0, "%s: marker '%s' is there twice; rename one of them",
                             text->path, r->name[i]);
  return CAV_OK;
}

// some marker in some frame, once what is seen in part counts as not seen
static int is_seen(const cav_record *r) {
  int seen = 0;
  for (size_t i = 0; i < (size_t)r->nframe * (size_t)r->nmarker; i++) seen |= isfinite(r->position[3 * i]);
  return seen;
}

// frames outside of the window go
static void cut(cav_record *r, double from, double to) {
  int n = 0;
  size_t numbers = 3 * (size_t)r->nmarker;
  for (int t = 0; t < r->nframe; t++) {
    if (r->time[t] < from - 1e-9 || (to > 0 && r->time[t] > to + 1e-9)) continue;
    r->time[n] = r->time[t];
    memmove(r->position + (size_t)n * numbers, r->position + (size_t)t * numbers, numbers * sizeof *r->position);
    n++;
  }
  r->nframe = n;
}

static const struct {
  const char *end;
  cav_clip_reader *read;
  double unit; // where neither file nor options say; 0: formats that always say
  char up;
  int says_up; // 1: the format itself has it
} formats[] = {{".trc", cav_clip_trc, 1, 'y', 0},
               {".csv", cav_clip_csv, 1, 'z', 1},
               {".bvh", cav_clip_bvh, 0.01, 'y', 1},
               {".c3d", cav_clip_c3d, 1e-3, 'z', 0},
               {".xml", cav_clip_keys, 1, 'z', 1}};
enum { NFORMAT = sizeof formats / sizeof *formats };

cav_record *cav_record_read(const char *path, const cav_record_options *options, cav_error *error) {
  static const cav_record_options none = {0};
  const cav_record_options *o = options ? options : &none;
  const char *dot = strrchr(path, '.');
  int kind = 0;
  while (kind < NFORMAT && (!dot || strcasecmp(dot, formats[kind].end))) kind++;
  if (kind == NFORMAT) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: expected a clip whose name ends in .trc, .c3d, .bvh, .csv or .xml",
                  path);
    return NULL;
  }
  if (o->up && !strchr("xyz", o->up)) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "expected x, y or z as the axis that points up, got '%c'", o->up);
    return NULL;
  }
  cav_clip_text text;
  cav_clip clip = {0};
  double unit = 0;
  cav_status status = cav_clip_open(&text, path, error);
  if (!status) status = formats[kind].read(&text, o, &clip, &unit);
  cav_record *r = clip.record;
  if (!status) status = clean_names(&text, r);
  if (!status) status = check(&text, r);
  cav_clip_close(&text);
  if (!status) {
    if (unit == 0 && o->unit == 0) r->assumed |= CAV_ASSUMED_UNIT;
    if (!o->up && !formats[kind].says_up) r->assumed |= CAV_ASSUMED_UP;
    turn(r, o->unit > 0 ? o->unit : unit > 0 ? unit : formats[kind].unit, o->up ? o->up : formats[kind].up);
    if (!is_seen(r)) status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: no frame shows a marker", path);
  }
  if (!status) {
    cut(r, o->from, o->to);
    if (r->nframe == 0)
      status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: no frame lies between %g and %g s", path, o->from, o->to);
  }
  if (!status) return r;
  cav_record_free(r);
  return NULL;
}

cav_status cav_record_write(const char *path, const cav_record *record, cav_error *error) {
  static const char axis[] = "xyz";
  cav_file file;
  for (int i = 0; i < record->nmarker; i++)
    for (const char *c = record->name[i]; *c; c++)
      if ((unsigned char)*c < ' ' || *c == ',' || *c == '"')
        return cav_file_fail(error, CAV_BAD_INPUT, 0, "marker %d: a name in a table has no comma, quote or line end",
                             i + 1);
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("time", file.stream);
  for (int i = 0; i < 3 * record->nmarker; i++) {
    fputc(',', file.stream);
    fprintf(file.stream, "%s_%c", record->name[i / 3], axis[i % 3]);
  }
  for (int t = 0; t < record->nframe; t++) {
    fputc('\n', file.stream);
    cav_table_write_number(file.stream, record->time[t]);
    for (int i = 0; i < 3 * record->nmarker; i++) {
      fputc(',', file.stream);
      cav_table_write_number(file.stream, record->position[(size_t)t * 3 * (size_t)record->nmarker + (size_t)i]);
    }
  }
  fputc('\n', file.stream);
  return cav_file_end(&file, error);
}
