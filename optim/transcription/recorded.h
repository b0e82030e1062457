/// Terms over a record, at an evaluated state. Private to optim/.
#ifndef CAVORT_RECORDED_H
#define CAVORT_RECORDED_H

#include "readings.h"

/// Values of all channels.
int cav_recorded_dim(const cav_track *track);

/// (value - record)/(sd scale) of every channel at knot t; 0 where the record says nothing.
void cav_recorded_read(const cav_transcription *transcription, cav_state *state, const cav_term *term, int t,
                       double *y);

/// Their derivatives by q and v_next [dim*nv]; 0 where the record says nothing. After cav_derivatives.
/// CAV_NOT_SUPPORTED: a sensor has none; CAV_NO_MEMORY.
cav_status cav_recorded_derivatives(const cav_transcription *transcription, cav_scratch *scratch, const cav_term *term,
                                    int t, double *dq, double *dn);

#endif
