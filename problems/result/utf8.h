/// UTF-8, for what is written into pages.
#ifndef CAVORT_UTF8_H
#define CAVORT_UTF8_H

/// Length of the UTF-8 sequence at s, 0 if it is not one.
int cav_utf8_length(const unsigned char *s);

#endif
