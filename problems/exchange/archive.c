/// Zip with stored entries (PKWARE APPNOTE 4.3) and .npy 1.0. Little endian, as all machines that this builds for.
#include "archive.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "utf8.h"

static const uint64_t most_bytes = 2000000000;

// CRC-32 of ISO 3309 by the reflected polynomial
static uint32_t crc32_of(const unsigned char *data, size_t n) {
  uint32_t table[256], crc = 0xffffffffu;
  for (uint32_t i = 0; i < 256; i++) {
    uint32_t c = i;
    for (int k = 0; k < 8; k++) c = c & 1 ? 0xedb88320u ^ c >> 1 : c >> 1;
    table[i] = c;
  }
  for (size_t i = 0; i < n; i++) crc = table[(crc ^ data[i]) & 255] ^ crc >> 8;
  return crc ^ 0xffffffffu;
}

static void put(cav_archive *a, uint32_t value, int bytes) {
  for (int k = 0; k < bytes; k++) fputc((int)(value >> 8 * k & 255), a->out);
  a->at += (uint64_t)bytes;
}

// what local and central headers share: version, flags, method, 1980-01-01, sizes, length of the name
static void put_entry(cav_archive *a, int k) {
  put(a, 20, 2), put(a, 0, 2), put(a, 0, 2), put(a, 0, 2), put(a, 33, 2);
  put(a, a->entry[k].crc, 4), put(a, a->entry[k].size, 4), put(a, a->entry[k].size, 4);
  put(a, (uint32_t)strlen(a->entry[k].name), 2), put(a, 0, 2);
}

static void put_name(cav_archive *a, int k) {
  fputs(a->entry[k].name, a->out);
  a->at += strlen(a->entry[k].name);
}

// an array: its head, then bytes
static void add(cav_archive *a, const char *name, const char *type, int ndim, const int *dim, const void *data,
                size_t bytes) {
  char head[256], shape[96] = "";
  assert(a->n < CAV_ARCHIVE_ENTRIES && ndim <= CAV_ARCHIVE_DIMS && strlen(name) + 5 < sizeof a->entry->name);
  int length = 0;
  for (int i = 0; i < ndim; i++) length += snprintf(shape + length, sizeof shape - (size_t)length, "%d,", dim[i]);
  int n =
      snprintf(head + 10, sizeof head - 10, "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }", type, shape);
  // the data begins at a multiple of 64
  while ((10 + n + 1) % 64) head[10 + n++] = ' ';
  head[10 + n++] = '\n';
  memcpy(head, "\x93NUMPY\x01", 7);
  head[7] = 0, head[8] = (char)(n & 255), head[9] = (char)(n >> 8);
  size_t total = (size_t)n + 10 + bytes;
  if (a->at + total > most_bytes) a->failed = 2;
  unsigned char *all = a->failed ? NULL : malloc(total);
  if (!all) {
    if (!a->failed) a->failed = 1;
    return;
  }
  memcpy(all, head, (size_t)n + 10);
  if (bytes) memcpy(all + n + 10, data, bytes);
  int k = a->n++;
  snprintf(a->entry[k].name, sizeof a->entry[k].name, "%s.npy", name);
  a->entry[k].crc = crc32_of(all, total);
  a->entry[k].size = (uint32_t)total;
  a->entry[k].at = (uint32_t)a->at;
  put(a, 0x04034b50, 4);
  put_entry(a, k);
  put_name(a, k);
  fwrite(all, 1, total, a->out);
  a->at += total;
  free(all);
}

static size_t count(int ndim, const int *dim) {
  size_t n = 1;
  for (int i = 0; i < ndim; i++) n *= (size_t)dim[i];
  return n;
}

void cav_archive_doubles(cav_archive *a, const char *name, int ndim, const int *dim, const double *x) {
  add(a, name, "<f8", ndim, dim, x, count(ndim, dim) * sizeof *x);
}

void cav_archive_ints(cav_archive *a, const char *name, int ndim, const int *dim, const int *x) {
  add(a, name, "<i4", ndim, dim, x, count(ndim, dim) * sizeof *x);
}

// the code point at *s, which moves on; a byte that is not UTF-8 is U+FFFD
static uint32_t next_point(const char **s) {
  const unsigned char *u = (const unsigned char *)*s;
  int n = cav_utf8_length(u);
  *s += n ? n : 1;
  if (n < 2) return n ? *u : 0xfffd;
  uint32_t c = *u & (0xffu >> (n + 1));
  for (int i = 1; i < n; i++) c = c << 6 | (u[i] & 63u);
  return c;
}

void cav_archive_texts(cav_archive *a, const char *name, int n, const char *const *text) {
  size_t width = 1;
  for (int i = 0; i < n; i++) width = strlen(text[i]) > width ? strlen(text[i]) : width;
  uint32_t *points = calloc((size_t)n * width + 1, sizeof *points);
  char type[24];
  if (!points) {
    a->failed = 1;
    return;
  }
  for (int i = 0; i < n; i++) {
    const char *s = text[i];
    for (size_t k = 0; *s; k++) points[(size_t)i * width + k] = next_point(&s);
  }
  snprintf(type, sizeof type, "<U%zu", width);
  add(a, name, type, 1, &n, points, (size_t)n * width * sizeof *points);
  free(points);
}

void cav_archive_end(cav_archive *a) {
  uint32_t begin = (uint32_t)a->at;
  for (int k = 0; k < a->n; k++) {
    put(a, 0x02014b50, 4), put(a, 20, 2);
    put_entry(a, k);
    put(a, 0, 2), put(a, 0, 2), put(a, 0, 2), put(a, 0, 4), put(a, a->entry[k].at, 4);
    put_name(a, k);
  }
  uint32_t size = (uint32_t)a->at - begin;
  put(a, 0x06054b50, 4), put(a, 0, 2), put(a, 0, 2), put(a, (uint32_t)a->n, 2), put(a, (uint32_t)a->n, 2);
  put(a, size, 4), put(a, begin, 4), put(a, 0, 2);
}
