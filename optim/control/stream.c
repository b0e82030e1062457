/// Measurements as they come in. A record has two frames at least, so a stream begins with two that say nothing.
#include "stream.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_ROOM = 64 };

/// Makes room for n frames.
static cav_status reserve(cav_stream *s, int n) {
  if (n <= s->room) return CAV_OK;
  const size_t columns = (size_t)s->track.ncolumn, room = 2 * (size_t)n;
  double *time = realloc(s->time, room * sizeof *time);
  if (time) s->time = time, s->track.time = time;
  double *value = realloc(s->value, room * columns * sizeof *value);
  if (value) s->value = value, s->track.value = value;
  if (!time || !value) return CAV_NO_MEMORY;
  s->room = (int)room;
  return CAV_OK;
}

cav_status cav_stream_begin(cav_stream *s, const cav_track *record) {
  *s = (cav_stream){.track = *record};
  s->track.nframe = 2;
  cav_status status = reserve(s, FIRST_ROOM);
  // long before the first measurement
  for (int i = 0; i < 2 && status == CAV_OK; i++) s->time[i] = record->offset - 1e6 + i;
  for (int i = 0; i < 2 * s->track.ncolumn && status == CAV_OK; i++) s->value[i] = NAN;
  return status;
}

void cav_stream_clear(cav_stream *s) {
  free(s->time), free(s->value);
  *s = (cav_stream){0};
}

/// Drops what comes before the last frame at or before a time, two frames kept.
static void drop(cav_stream *s, double oldest) {
  int first = 0, n = s->track.nframe;
  while (n - first > 2 && s->time[first + 1] <= oldest) first++;
  const size_t columns = (size_t)s->track.ncolumn, left = (size_t)(n - first);
  memmove(s->time, s->time + first, left * sizeof *s->time);
  memmove(s->value, s->value + (size_t)first * columns, left * columns * sizeof *s->value);
  s->track.nframe = n - first;
}

cav_status cav_stream_add(cav_stream *s, double time, const double *value, double oldest) {
  const size_t columns = (size_t)s->track.ncolumn;
  if (!isfinite(time) || !(time > s->time[s->track.nframe - 1])) return CAV_BAD_INPUT;
  for (size_t c = 0; c < columns; c++)
    if (isinf(value[c])) return CAV_BAD_INPUT;
  if (s->track.nframe == s->room) drop(s, oldest);
  cav_status status = reserve(s, s->track.nframe + 1);
  if (status != CAV_OK) return status;
  s->time[s->track.nframe] = time;
  memcpy(s->value + (size_t)s->track.nframe * columns, value, columns * sizeof *value);
  s->track.nframe++;
  return CAV_OK;
}
