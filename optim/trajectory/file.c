/// Files that appear whole: written under a temporary name in the same folder, flushed to the disk, renamed over the
/// old one (POSIX rename is atomic within a file system). Does not keep the old file's owner or mode, nor follow links.
#include "file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TRIES = 100 };

cav_status cav_file_fail(cav_error *error, cav_status status, int line, const char *format, ...) {
  if (!error) return status;
  error->status = status;
  error->line = line;
  va_list list;
  va_start(list, format);
  vsnprintf(error->text, sizeof error->text, format, list);
  va_end(list);
  return status;
}

double cav_file_number(const char *text, char **end) {
  *end = (char *)text;
  locale_t locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (!locale) return 0;
  locale_t before = uselocale(locale);
  double value = strtod(text, end);
  uselocale(before);
  freelocale(locale);
  return value;
}

char *cav_file_beside(const char *base, const char *path) {
  const char *slash = path[0] == '/' ? NULL : strrchr(base, '/');
  size_t folder = slash ? (size_t)(slash - base) + 1 : 0;
  char *joined = malloc(folder + strlen(path) + 1);
  if (!joined) return NULL;
  memcpy(joined, base, folder);
  strcpy(joined + folder, path);
  return joined;
}

// lets go of all that the file holds
static void release(cav_file *file) {
  if (file->locale) {
    uselocale(file->before);
    freelocale(file->locale);
  }
  free(file->path);
  free(file->temporary);
  memset(file, 0, sizeof *file);
}

// a new file beside path under a name that no one uses; -1 on failure
static int open_temporary(cav_file *file, size_t room) {
  for (int i = 0; i < TRIES; i++) {
    snprintf(file->temporary, room, "%s.%ld-%d.tmp", file->path, (long)getpid(), i);
    int descriptor = open(file->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0 || errno != EEXIST) return descriptor;
  }
  return -1;
}

cav_status cav_file_begin(cav_file *file, const char *path, cav_error *error) {
  memset(file, 0, sizeof *file);
  size_t room = strlen(path) + 64;
  file->path = strdup(path);
  file->temporary = malloc(room);
  file->locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (file->locale) file->before = uselocale(file->locale);
  if (!file->path || !file->temporary || !file->locale) {
    release(file);
    return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory to write the file", path);
  }
  int descriptor = open_temporary(file, room);
  file->stream = descriptor < 0 ? NULL : fdopen(descriptor, "w");
  if (file->stream) return CAV_OK;
  cav_status status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be written: %s", path, strerror(errno));
  if (descriptor >= 0) {
    close(descriptor);
    unlink(file->temporary);
  }
  release(file);
  return status;
}

cav_status cav_file_end(cav_file *file, cav_error *error) {
  // closed before renamed, and closed whatever fails
  int written = !ferror(file->stream) && fflush(file->stream) == 0 && fsync(fileno(file->stream)) == 0;
  int reason = errno;
  if (fclose(file->stream) != 0 && written) {
    written = 0;
    reason = errno;
  }
  if (written && rename(file->temporary, file->path) != 0) {
    written = 0;
    reason = errno;
  }
  cav_status status = CAV_OK;
  if (!written) {
    status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be written: %s", file->path, strerror(reason));
    unlink(file->temporary);
  }
  release(file);
  return status;
}

void cav_file_abandon(cav_file *file) {
  if (!file->stream) return;
  fclose(file->stream);
  unlink(file->temporary);
  release(file);
}

void cav_file_write_xml(FILE *out, const char *text) {
  for (; *text; text++) {
    switch (*text) {
      case '<':
        fputs("&lt;", out);
        break;
      case '>':
        fputs("&gt;", out);
        break;
      case '&':
        fputs("&amp;", out);
        break;
      case '"':
        fputs("&quot;", out);
        break;
      default:
        if ((unsigned char)*text < ' ')
          fprintf(out, "&#%d;", *text);
        else
          fputc(*text, out);
    }
  }
}
