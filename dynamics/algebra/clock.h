/// Time that has passed, for measurements.
#ifndef CAVORT_CLOCK_H
#define CAVORT_CLOCK_H

/// Seconds of a clock that nothing sets, from a moment of its own.
double cav_clock(void);

#endif
