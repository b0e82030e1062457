/// Arrays in NumPy's format (.npy 1.0), stored in a zip: what numpy.load opens as .npz.
#ifndef CAVORT_ARCHIVE_H
#define CAVORT_ARCHIVE_H

#include <stdint.h>
#include <stdio.h>

enum { CAV_ARCHIVE_ENTRIES = 40, CAV_ARCHIVE_DIMS = 3 };

/// One on its way into a file; begins as {.out = stream}.
typedef struct cav_archive {
  FILE *out;
  int n, failed; ///< failed 1: no memory, 2: too large for a zip without extensions (2 GB)
  uint64_t at;
  struct {
    char name[32];
    uint32_t crc, size, at;
  } entry[CAV_ARCHIVE_ENTRIES];
} cav_archive;

/// Adds an array of doubles, of ints, or of texts. dim: sizes, as many as ndim. Texts are told apart by type.
void cav_archive_doubles(cav_archive *archive, const char *name, int ndim, const int *dim, const double *x);
void cav_archive_ints(cav_archive *archive, const char *name, int ndim, const int *dim, const int *x);
void cav_archive_texts(cav_archive *archive, const char *name, int n, const char *const *text);

/// Writes the directory.
void cav_archive_end(cav_archive *archive);

#endif
