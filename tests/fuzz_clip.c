/// Fuzzer of the readers of recorded motion: the first byte says which format the others are. What is read is finite or
/// a gap, and is read again from what is written of it.
#include <math.h>
#include <string.h>

#include "cavort/cavort.h"
#include "fuzz_file.h"

static char folder[] = "/tmp/cavort_fuzz_clip_XXXXXX";

static const char *path_of(char kind) {
  static const char kinds[] = "tcbx3", *const ends[] = {"trc", "csv", "bvh", "xml", "c3d"};
  static char path[80];
  const char *at = kind ? strchr(kinds, kind) : NULL;
  snprintf(path, sizeof path, "%s/clip.%s", folder, ends[at ? at - kinds : (unsigned char)kind % 5]);
  return path;
}

static int is_whole(const cav_record *r) {
  int ok = r->nframe > 0 && r->nmarker > 0;
  for (int t = 0; t < r->nframe; t++) ok = ok && isfinite(r->time[t]) && (t == 0 || r->time[t] > r->time[t - 1]);
  for (size_t i = 0; i < (size_t)r->nframe * (size_t)r->nmarker; i++) {
    const double *x = r->position + 3 * i;
    ok = ok && (isnan(x[0]) ? isnan(x[1]) && isnan(x[2]) : isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]));
  }
  return ok;
}

static int is_same(const cav_record *a, const cav_record *b) {
  int ok = b && a->nframe == b->nframe && a->nmarker == b->nmarker;
  for (size_t i = 0; ok && i < 3 * (size_t)a->nframe * (size_t)a->nmarker; i++)
    ok = a->position[i] == b->position[i] || (isnan(a->position[i]) && isnan(b->position[i]));
  return ok;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static int opened;
  if (!opened) opened = mkdtemp(folder) != NULL;
  fuzz_require(opened);
  if (size < 1) return 0;
  const char *path = path_of((char)data[0]);
  FILE *file = fopen(path, "wb");
  if (!file) return 0;
  int written = fwrite(data + 1, 1, size - 1, file) == size - 1;
  if (fclose(file) || !written) return 0;
  cav_error error = {0};
  // a format without a rate needs one
  cav_record *record = cav_record_read(path, &(cav_record_options){.rate = 100}, &error);
  fuzz_require((record != NULL) == (error.status == CAV_OK));
  fuzz_require(record != NULL || error.text[0] != 0);
  if (record) {
    fuzz_require(is_whole(record));
    char copy[80];
    snprintf(copy, sizeof copy, "%s/copy.csv", folder);
    if (cav_record_write(copy, record, &error) == CAV_OK) {
      cav_record *again = cav_record_read(copy, NULL, &error);
      fuzz_require(is_same(record, again));
      cav_record_free(again);
    }
    unlink(copy);
  }
  cav_record_free(record);
  unlink(path);
  return 0;
}
