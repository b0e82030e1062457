/// What the readers of clips share: a file as bytes or lines, and a clip that grows. Private to optim/mocap.
#ifndef CAVORT_CLIP_H
#define CAVORT_CLIP_H

#include <stddef.h>

#include "cavort/mocap.h"

/// A file in memory, ended by 0, and the line that is read.
typedef struct cav_clip_text {
  const char *path;
  char *data, *rest; ///< rest: after the line in hand; NULL behind the last
  size_t size;
  int line;
  cav_error *error;
} cav_clip_text;

/// Reads a whole regular file of at most 1 GB. CAV_BAD_INPUT, CAV_NO_MEMORY. clip.c.
cav_status cav_clip_open(cav_clip_text *text, const char *path, cav_error *error);
void cav_clip_close(cav_clip_text *text);

/// The next line without its end; NULL: there is none.
char *cav_clip_line(cav_clip_text *text);

/// The next field of a line up to separator, without blanks around it; *line becomes NULL behind the last.
char *cav_clip_field(char **line, char separator);

/// A field as a number: NaN of an empty one or of "nan", infinite of what is none.
double cav_clip_number(const char *field);

/// "FILE:LINE: " and the formatted text as an error; CAV_BAD_INPUT.
cav_status cav_clip_fail(const cav_clip_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
cav_status cav_clip_no_memory(const cav_clip_text *text);

/// A record of markers that grows by frames. Its memory is the record's.
typedef struct cav_clip {
  cav_record *record;
  int room; ///< frames
} cav_clip;

/// Nameless markers, no frame; one more frame, none of it seen. NULL: no memory.
cav_record *cav_clip_new(cav_clip *clip, int nmarker);
double *cav_clip_frame(cav_clip *clip, double time);

/// By format. Places in the units and axes of the file; *unit: m that the file says one of them is, untouched where
/// it says none; times by options' rate where it has none.
typedef cav_status cav_clip_reader(cav_clip_text *text, const cav_record_options *options, cav_clip *clip,
                                   double *unit);
cav_clip_reader cav_clip_trc, cav_clip_csv, cav_clip_bvh, cav_clip_c3d, cav_clip_keys;

#endif
