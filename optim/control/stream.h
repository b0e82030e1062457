/// Measurements as they come in, as records that terms read. Private to optim/.
#ifndef CAVORT_STREAM_H
#define CAVORT_STREAM_H

#include "cavort/problem.h"

/// The last frames of a record.
typedef struct cav_stream {
  cav_track track;      ///< whose frames are those below
  double *time, *value; ///< [room], [room*ncolumn]
  int room;
} cav_stream;

/// A stream in the place of a record, without frames. CAV_NO_MEMORY. Clear it in any case.
cav_status cav_stream_begin(cav_stream *stream, const cav_track *record);
void cav_stream_clear(cav_stream *stream);

/// One more frame, those before oldest dropped but for the last of them. CAV_BAD_INPUT: not after the last one.
cav_status cav_stream_add(cav_stream *stream, double time, const double *value, double oldest);

#endif
