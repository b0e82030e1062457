/// CSV files of numbers under named columns (RFC 4180: commas, quotes doubled inside quotes, LF or CRLF).
/// Every row has all columns and every value is finite; line ends inside quotes are not read.
#include "csv.h"

#include <errno.h>
#include <limits.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "file.h"

void cav_table_free(cav_table *table) {
  if (!table) return;
  for (int i = 0; i < table->ncol && table->name; i++) free(table->name[i]);
  free(table->name);
  free(table->value);
  free(table->line);
  free(table->path);
  free(table);
}

void cav_table_write_text(FILE *stream, const char *text) {
  if (!strpbrk(text, ",\"\r\n")) {
    fputs(text, stream);
    return;
  }
  fputc('"', stream);
  for (; *text; text++) {
    if (*text == '"') fputc('"', stream);
    fputc(*text, stream);
  }
  fputc('"', stream);
}

void cav_table_write_number(FILE *stream, double value) {
  if (isfinite(value)) fprintf(stream, "%.17g", value);
}

// takes one field off the text, unquoted in place, ended by 0; the text moves past its comma or becomes NULL at the end
static char *take_field(char **text) {
  char *from = *text, *to = *text, *field = *text;
  int quoted = *from == '"';
  if (quoted) from++;
  for (; *from; from++) {
    if (quoted && *from == '"') {
      if (from[1] != '"') {
        quoted = 0;
        continue;
      }
      from++;
    } else if (!quoted && *from == ',') {
      break;
    }
    *to++ = *from;
  }
  *text = *from ? from + 1 : NULL;
  *to = 0;
  return field;
}

// names of the columns; *status tells failure
static cav_status read_names(cav_table *table, char *text, int line, cav_error *error) {
  int count = 1;
  for (const char *c = text; *c; c++) count += *c == ',';
  table->name = calloc((size_t)count, sizeof *table->name);
  if (!table->name) return cav_file_fail(error, CAV_NO_MEMORY, line, "%s:%d: no memory", table->path, line);
  for (char *rest = text; rest;) {
    char *name = strdup(take_field(&rest));
    if (!name) return cav_file_fail(error, CAV_NO_MEMORY, line, "%s:%d: no memory", table->path, line);
    table->name[table->ncol++] = name;
  }
  return CAV_OK;
}

// room for one more row
static cav_status table_grow(cav_table *table, int *room, int line, cav_error *error) {
  if (table->nrow < *room) return CAV_OK;
  if (*room > INT_MAX / 2)
    return cav_file_fail(error, CAV_BAD_INPUT, line, "%s:%d: more rows than are read, %d", table->path, line, *room);
  size_t more = *room ? 2 * (size_t)*room : 64;
  double *value = realloc(table->value, more * (size_t)table->ncol * sizeof *value);
  if (value) table->value = value;
  int *lines = realloc(table->line, more * sizeof *lines);
  if (lines) table->line = lines;
  if (!value || !lines) return cav_file_fail(error, CAV_NO_MEMORY, line, "%s:%d: no memory", table->path, line);
  *room = (int)more;
  return CAV_OK;
}

// one number that is all of a field; HUGE_VAL if it is none
static double number_of(const char *field) {
  char *end;
  double value = strtod(field, &end);
  if (end == field) return HUGE_VAL;
  while (*end == ' ' || *end == '\t') end++;
  return *end ? HUGE_VAL : value;
}

static int is_gap(const char *field) { return !field[strspn(field, " \t")] || !strcasecmp(field, "nan"); }

static cav_status read_row(cav_table *table, char *text, int line, int *room, cav_error *error) {
  cav_status status = table_grow(table, room, line, error);
  if (status) return status;
  double *row = table->value + (size_t)table->nrow * (size_t)table->ncol;
  int column = 0;
  for (char *rest = text; rest; column++) {
    char *field = take_field(&rest);
    if (column >= table->ncol) continue;
    row[column] = table->gaps && is_gap(field) ? NAN : number_of(field);
    if (table->gaps && isnan(row[column])) continue;
    if (!isfinite(row[column])) {
      return cav_file_fail(error, CAV_BAD_INPUT, line, "%s:%d: column '%s': expected a finite number, got '%.40s'",
                           table->path, line, table->name[column], field);
    }
  }
  if (column != table->ncol) {
    return cav_file_fail(error, CAV_BAD_INPUT, line, "%s:%d: expected %d values, one under each column, got %d",
                         table->path, line, table->ncol, column);
  }
  table->line[table->nrow++] = line;
  return CAV_OK;
}

// line by line; the first that is not blank names the columns
static cav_status read_lines(cav_table *table, FILE *stream, cav_error *error) {
  char *text = NULL;
  size_t size = 0;
  int room = 0, line = 0;
  cav_status status = CAV_OK;
  ssize_t length;
  while (!status && (length = getline(&text, &size, stream)) >= 0) {
    line++;
    if (strlen(text) != (size_t)length) {
      status =
          cav_file_fail(error, CAV_BAD_INPUT, line, "%s:%d: not a text file: it holds a zero byte", table->path, line);
      break;
    }
    text[strcspn(text, "\r\n")] = 0;
    if (!text[strspn(text, " \t")]) continue;
    status = table->name ? read_row(table, text, line, &room, error) : read_names(table, text, line, error);
  }
  free(text);
  if (!status && ferror(stream)) {
    status = cav_file_fail(error, CAV_BAD_INPUT, line, "%s: cannot be read: %s", table->path, strerror(errno));
  }
  if (!status && !table->name) {
    status =
        cav_file_fail(error, CAV_BAD_INPUT, 1, "%s:1: the file is empty; expected a line of column names", table->path);
  }
  return status;
}

static cav_table *read_table(const char *path, int gaps, cav_error *error) {
  struct stat about;
  // before it is opened: that of a pipe would wait for a writer
  int there = stat(path, &about) == 0, regular = there && S_ISREG(about.st_mode);
  FILE *stream = regular ? fopen(path, "r") : NULL;
  if (!stream) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be read: %s", path,
                  there && !regular ? "not a file" : strerror(errno));
    return NULL;
  }
  // numbers are read with a point, whatever the locale
  locale_t locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  cav_table *table = calloc(1, sizeof *table);
  if (table) table->path = strdup(path), table->gaps = gaps;
  if (!locale || !table || !table->path) {
    cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
    if (locale) freelocale(locale);
    cav_table_free(table);
    fclose(stream);
    return NULL;
  }
  locale_t before = uselocale(locale);
  cav_status status = read_lines(table, stream, error);
  uselocale(before);
  freelocale(locale);
  fclose(stream);
  if (!status) return table;
  cav_table_free(table);
  return NULL;
}

cav_table *cav_table_read(const char *path, cav_error *error) { return read_table(path, 0, error); }

cav_table *cav_table_read_gaps(const char *path, cav_error *error) { return read_table(path, 1, error); }
