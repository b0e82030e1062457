/// Points of C3D files, of processors of all three kinds (Intel, DEC, MIPS), whole numbers or real ones. Analogue channels are
/// passed over. The format: https://www.c3d.org, user guide of 2021.
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "clip.h"

enum { BLOCK = 512, INTEL = 84, DEC = 85, MIPS = 86, MOST_LABELS = 40 };

typedef struct c3d {
  cav_clip_text *text;
  int kind;
  // header
  int npoint, nanalogue, first, last, start; // start: block of the data
  double scale, rate;                        // scale below 0: real numbers
  // parameters of the group POINT and TRIAL
  int point_group, trial_group;
  long trial_start, trial_end;
  double unit;
  const unsigned char *labels[MOST_LABELS]; // of LABELS, LABELS2, ...
  int width[MOST_LABELS], count[MOST_LABELS], nlabels;
} c3d;

static const unsigned char *byte_at(const c3d *c, size_t at, size_t n) {
  return at + n <= c->text->size ? (const unsigned char *)c->text->data + at : NULL;
}

static int short_of(const c3d *c, const unsigned char *b) {
  return (int16_t)(c->kind == MIPS ? b[0] << 8 | b[1] : b[1] << 8 | b[0]);
}

static double real_of(const c3d *c, const unsigned char *b) {
  static const int order[3][4] = {{0, 1, 2, 3}, {2, 3, 0, 1}, {3, 2, 1, 0}};
  const int *o = order[c->kind - INTEL];
  uint32_t bits = (uint32_t)b[o[0]] | (uint32_t)b[o[1]] << 8 | (uint32_t)b[o[2]] << 16 | (uint32_t)b[o[3]] << 24;
  float value;
  memcpy(&value, &bits, sizeof value);
  return c->kind == DEC ? (double)value / 4 : (double)value;
}

static cav_status broken(const c3d *c, const char *what) {
  return cav_clip_fail(c->text, "expected a C3D file: %s", what);
}

static int same_word(const unsigned char *text, int n, const char *word) {
  if (n != (int)strlen(word)) return 0;
  for (int i = 0; i < n; i++)
    if ((text[i] & ~32) != word[i] && text[i] != word[i]) return 0;
  return 1;
}

// a parameter of the group POINT or TRIAL: value, its type (-1 text, 1 bytes, 2 whole, 4 real), dimensions
static void take_parameter(c3d *c, int group, const unsigned char *name, int n, const unsigned char *value, int type,
                           int ndim, const unsigned char *dim) {
  if (group == c->trial_group && type == 2 && ndim == 1 && dim[0] == 2) {
    long frame = (uint16_t)short_of(c, value) + 65536L * (uint16_t)short_of(c, value + 2);
    if (same_word(name, n, "ACTUAL_START_FIELD")) c->trial_start = frame;
    if (same_word(name, n, "ACTUAL_END_FIELD")) c->trial_end = frame;
  }
  if (group != c->point_group) return;
  if (n >= 6 && same_word(name, 6, "LABELS") && type == -1 && ndim == 2 && c->nlabels < MOST_LABELS) {
    c->labels[c->nlabels] = value;
    c->width[c->nlabels] = dim[0];
    c->count[c->nlabels++] = dim[1];
  }
  if (same_word(name, n, "UNITS") && type == -1 && ndim == 1 && dim[0] > 0)
    c->unit = value[0] == 'm' && (dim[0] < 2 || value[1] != 'm') ? 1
              : value[0] == 'c'                                  ? 0.01
              : value[0] == 'm'                                  ? 1e-3
                                                                 : 0;
}

// entries of the parameter section: once for the numbers of groups, once for what they hold
static cav_status read_parameters(c3d *c, size_t from, size_t to, int groups) {
  for (size_t at = from + 4; at + 2 <= to;) {
    const unsigned char *entry = byte_at(c, at, 2), *name;
    if (!entry) return broken(c, "its parameters end early");
    int n = abs((int8_t)entry[0]), id = (int8_t)entry[1];
    if (n == 0) break;
    const unsigned char *next = byte_at(c, at + 2 + (size_t)n, 2);
    if (!(name = byte_at(c, at + 2, (size_t)n)) || !next) return broken(c, "its parameters end early");
    int way = (uint16_t)short_of(c, next);
    if (id < 0 && groups) {
      if (same_word(name, n, "POINT")) c->point_group = -id;
      if (same_word(name, n, "TRIAL")) c->trial_group = -id;
    }
    const unsigned char *type = byte_at(c, at + 4 + (size_t)n, 2);
    if (id > 0 && !groups && type) {
      int ndim = type[1];
      const unsigned char *dim = byte_at(c, at + 6 + (size_t)n, (size_t)ndim);
      size_t size = (size_t)abs((int8_t)type[0]);
      for (int i = 0; dim && i < ndim; i++) size *= dim[i];
      const unsigned char *value = byte_at(c, at + 6 + (size_t)n + (size_t)ndim, size);
      if (!dim || !value) return broken(c, "a parameter is longer than the file");
      take_parameter(c, id, name, n, value, (int8_t)type[0], ndim, dim);
    }
    if (way < 2) break;
    at += 2 + (size_t)n + (size_t)way;
  }
  return CAV_OK;
}

static cav_status read_header(c3d *c) {
  const unsigned char *head = byte_at(c, 0, BLOCK);
  if (!head || head[1] != 0x50 || head[0] < 1) return broken(c, "the first bytes are others");
  size_t at = (size_t)(head[0] - 1) * BLOCK;
  const unsigned char *parameters = byte_at(c, at, BLOCK);
  if (!parameters) return broken(c, "it ends before its parameters");
  c->kind = parameters[3];
  if (c->kind < INTEL || c->kind > MIPS) return broken(c, "the kind of its processor is unknown");
  c->npoint = (uint16_t)short_of(c, head + 2);
  c->nanalogue = (uint16_t)short_of(c, head + 4);
  c->first = (uint16_t)short_of(c, head + 6);
  c->last = (uint16_t)short_of(c, head + 8);
  c->scale = real_of(c, head + 12);
  c->start = (uint16_t)short_of(c, head + 16);
  c->rate = real_of(c, head + 20);
  if (c->npoint < 1 || c->start < 1) return broken(c, "it has no points");
  size_t end = at + BLOCK * (size_t)(parameters[2] ? parameters[2] : 1);
  cav_status status = read_parameters(c, at, end, 1);
  return status ? status : read_parameters(c, at, end, 0);
}

// a new text; "" of points without a label
static char *label(const c3d *c, int point) {
  for (int i = 0; i < c->nlabels; i++) {
    if (point >= c->count[i]) {
      point -= c->count[i];
      continue;
    }
    const unsigned char *from = c->labels[i] + (size_t)point * (size_t)c->width[i];
    size_t n = strnlen((const char *)from, (size_t)c->width[i]);
    while (n && from[n - 1] == ' ') n--;
    return strndup((const char *)from, n);
  }
  return strdup("");
}

static cav_status name_points(const c3d *c, cav_record *r) {
  for (int i = 0; i < c->npoint; i++)
    if (!(r->name[i] = label(c, i))) return cav_clip_no_memory(c->text);
  return CAV_OK;
}

// a point of a frame: three coordinates, then a word below 0 where it was not seen
static void take_point(const c3d *c, const unsigned char *b, double place[3]) {
  int real = c->scale < 0;
  double seen = real ? real_of(c, b + 12) : short_of(c, b + 6);
  for (int k = 0; k < 3 && seen >= 0; k++) place[k] = real ? real_of(c, b + 4 * k) : c->scale * short_of(c, b + 2 * k);
}

cav_status cav_clip_c3d(cav_clip_text *text, const cav_record_options *options, cav_clip *clip, double *unit) {
  c3d c = {.text = text};
  cav_status status = read_header(&c);
  if (status) return status;
  *unit = c.unit;
  double rate = options->rate > 0 ? options->rate : c.rate;
  if (!(rate > 0)) return cav_clip_fail(text, "the file has no rate of frames; give one");
  if (!cav_clip_new(clip, c.npoint)) return cav_clip_no_memory(text);
  status = name_points(&c, clip->record);
  size_t number = c.scale < 0 ? 4 : 2, point = 4 * number,
         stride = (size_t)c.npoint * point + (size_t)c.nanalogue * number, at = (size_t)(c.start - 1) * BLOCK;
  long frames =
      c.trial_end > 0 && c.trial_end >= c.trial_start ? c.trial_end - c.trial_start + 1 : (long)c.last - c.first + 1;
  if (!status && frames < 1) return broken(&c, "it has no frames");
  for (long t = 0; t < frames && !status; t++) {
    const unsigned char *data = byte_at(&c, at + (size_t)t * stride, stride);
    if (!data) return cav_clip_fail(text, "expected %ld frames, the file ends in frame %ld", frames, t + 1);
    double *frame = cav_clip_frame(clip, (double)t / rate);
    if (!frame) return cav_clip_no_memory(text);
    for (int i = 0; i < c.npoint; i++) take_point(&c, data + (size_t)i * point, frame + 3 * i);
  }
  return status;
}
