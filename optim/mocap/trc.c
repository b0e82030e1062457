/// Tables of markers: TRC, as motion capture systems and OpenSim write it, and CSV with named columns.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "clip.h"

enum { MOST_MARKERS = 10000 };

// one row of places, three fields each, after its time; fields that are left out at the end are not seen
static cav_status read_row(cav_clip_text *text, char *line, char separator, int nmarker, double *frame) {
  for (int i = 0; i < 3 * nmarker && line; i++) {
    const char *field = cav_clip_field(&line, separator);
    frame[i] = cav_clip_number(field);
    if (isinf(frame[i])) return cav_clip_fail(text, "marker %d: expected a number, got '%.40s'", i / 3 + 1, field);
  }
  while (line)
    if (*cav_clip_field(&line, separator))
      return cav_clip_fail(text, "expected %d numbers, three for each marker, got more", 3 * nmarker);
  return CAV_OK;
}

// "mm" and its kin in m; 0: none of them
static double unit_of(const char *word) {
  static const struct {
    const char *name;
    double unit;
  } units[] = {{"m", 1}, {"cm", 0.01}, {"mm", 1e-3}, {"in", 0.0254}, {"ft", 0.3048}};
  for (size_t i = 0; i < sizeof units / sizeof *units; i++)
    if (!strcasecmp(word, units[i].name)) return units[i].unit;
  return 0;
}

// the next word of a line, by blanks; NULL: there is none
static char *next_word(char **line) {
  char *word;
  do word = strsep(line, " \t");
  while (word && !*word);
  return word;
}

// line 2 names values of line 3; some writers put two tabs between these
static cav_status read_values(cav_clip_text *text, double *unit) {
  char *keys = cav_clip_line(text), *values = keys ? cav_clip_line(text) : NULL, *key, *value;
  if (!values) return cav_clip_fail(text, "expected a line of names and one of their values, as a TRC file has");
  while ((key = next_word(&keys)) && (value = next_word(&values))) {
    if (strcasecmp(key, "Units")) continue;
    *unit = unit_of(value);
    if (*unit == 0) return cav_clip_fail(text, "expected m, cm, mm, in or ft as Units, got '%.20s'", value);
  }
  return CAV_OK;
}

// line 4: Frame#, Time, a name over every three columns
static cav_status read_names(cav_clip_text *text, cav_clip *clip) {
  char *line = cav_clip_line(text);
  int n = 0;
  if (!line || strncasecmp(line, "Frame#", 6))
    return cav_clip_fail(text, "expected the line of names, 'Frame#', 'Time' and the markers, got '%.40s'",
                         line ? line : "");
  for (const char *c = line; *c; c++) n += *c == '\t' && c[1] && !strchr("\t \r", c[1]);
  if (--n < 1 || n > MOST_MARKERS) return cav_clip_fail(text, "expected names of markers behind 'Frame#' and 'Time'");
  if (!cav_clip_new(clip, n)) return cav_clip_no_memory(text);
  cav_clip_field(&line, '\t');
  if (line) cav_clip_field(&line, '\t');
  for (int i = 0; line && i < n;) {
    const char *name = cav_clip_field(&line, '\t');
    if (*name && !(clip->record->name[i++] = strdup(name))) return cav_clip_no_memory(text);
  }
  for (int i = 0; i < n; i++)
    if (!clip->record->name[i]) return cav_clip_fail(text, "expected a name for each marker");
  return CAV_OK;
}

cav_status cav_clip_trc(cav_clip_text *text, const cav_record_options *options, cav_clip *clip, double *unit) {
  (void)options;
  char *line = cav_clip_line(text);
  if (!line || strncasecmp(line, "PathFileType", 12))
    return cav_clip_fail(text, "expected a TRC file, which starts with 'PathFileType'");
  cav_status status = read_values(text, unit);
  if (!status) status = read_names(text, clip);
  // X1 Y1 Z1 ...
  if (!status) cav_clip_line(text);
  while (!status && (line = cav_clip_line(text))) {
    if (!*cav_clip_field(&line, '\t') || !line) continue;
    double time = cav_clip_number(cav_clip_field(&line, '\t'));
    if (!isfinite(time)) return cav_clip_fail(text, "expected a time in the second column");
    double *frame = cav_clip_frame(clip, time);
    if (!frame) return cav_clip_no_memory(text);
    if (line) status = read_row(text, line, '\t', clip->record->nmarker, frame);
  }
  return status;
}

// names of columns: time, then NAME_x, NAME_y, NAME_z of each marker
static cav_status read_columns(cav_clip_text *text, cav_clip *clip) {
  char *line = cav_clip_line(text);
  int n = 0;
  for (const char *c = line ? line : ""; *c; c++) n += *c == ',';
  if (!line || n < 3 || n % 3 || n / 3 > MOST_MARKERS || strcasecmp(cav_clip_field(&line, ','), "time"))
    return cav_clip_fail(text, "expected the columns time, then NAME_x, NAME_y and NAME_z of each marker");
  if (!cav_clip_new(clip, n / 3)) return cav_clip_no_memory(text);
  for (int i = 0; i < n && line; i++) {
    char *name = cav_clip_field(&line, ','), **marker = &clip->record->name[i / 3];
    size_t length = strlen(name);
    if (length < 3 || !strchr("_.:/", name[length - 2]) || (name[length - 1] | 32) != "xyz"[i % 3])
      return cav_clip_fail(text, "column %d: expected a name that ends in _%c, got '%.40s'", i + 2, "xyz"[i % 3], name);
    name[length - 2] = 0;
    if (i % 3 == 0 && !(*marker = strdup(name))) return cav_clip_no_memory(text);
    if (strcmp(*marker, name))
      return cav_clip_fail(text, "column %d: expected '%.40s_%c' beside the other two of that marker, got '%.40s'",
                           i + 2, *marker, "xyz"[i % 3], name);
  }
  return CAV_OK;
}

cav_status cav_clip_csv(cav_clip_text *text, const cav_record_options *options, cav_clip *clip, double *unit) {
  (void)options;
  *unit = 1;
  char *line;
  cav_status status = read_columns(text, clip);
  while (!status && (line = cav_clip_line(text))) {
    if (!*line) continue;
    const char *field = cav_clip_field(&line, ',');
    double time = cav_clip_number(field), *frame;
    if (!isfinite(time)) return cav_clip_fail(text, "expected a time, got '%.40s'", field);
    if (!(frame = cav_clip_frame(clip, time))) return cav_clip_no_memory(text);
    if (line) status = read_row(text, line, ',', clip->record->nmarker, frame);
  }
  return status;
}
