/// By which files are recognised.
#ifndef CAVORT_DIGEST_H
#define CAVORT_DIGEST_H

#include <stdio.h>

enum { CAV_DIGEST_TEXT = 65 };

/// SHA-256 of the rest of a file, in hexadecimal digits. ferror(file) tells whether it was read.
void cav_digest(FILE *file, char text[CAV_DIGEST_TEXT]);

#endif
