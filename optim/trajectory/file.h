/// Writing a file so that its readers see the old one or the new one, never half of either; and filling in errors.
/// Private: not installed.
#ifndef CAVORT_FILE_H
#define CAVORT_FILE_H

#include <locale.h>
#include <stdio.h>

#include "cavort/status.h"

/// A file on its way. Between begin and end the calling thread's numbers are written with a point, whatever the locale.
typedef struct cav_file {
  FILE *stream;
  char *path, *temporary;
  locale_t locale, before;
} cav_file;

/// Opens a temporary file beside path. CAV_BAD_INPUT if it cannot be made, CAV_NO_MEMORY; file is then closed.
cav_status cav_file_begin(cav_file *file, const char *path, cav_error *error);

/// Closes the file and puts it in path's place; on failure (CAV_BAD_INPUT: the disk is full, ...) path is as it was.
cav_status cav_file_end(cav_file *file, cav_error *error);

/// Closes and removes the temporary file; path is as it was.
void cav_file_abandon(cav_file *file);

/// Fills error (may be NULL) with status, line and the formatted text; returns status.
cav_status cav_file_fail(cav_error *error, cav_status status, int line, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/// strtod with a point, whatever the locale; 0 and *end = text if memory runs out.
double cav_file_number(const char *text, char **end);

/// Writes a text such that it stands as it is between the quotes of an XML attribute.
void cav_file_write_xml(FILE *out, const char *text);

/// base's folder joined with path, or path alone if it is absolute or base has no folder; NULL if memory runs out.
char *cav_file_beside(const char *base, const char *path);

#endif
