/// Where a result comes from. Version and features are those that the build was set up with, commit that of its tree
/// when it was built.
#include "provenance.h"

#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include "cavort/solve.h"
#include "certificate.h"
#include "commit.h"

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#elif defined(__GNUC__)
#define COMPILER "gcc " __VERSION__
#else
#define COMPILER "unknown"
#endif

// the processor's name where the system tells it
static void find_processor(char *name, size_t room) {
  char line[256];
  FILE *file = fopen("/proc/cpuinfo", "r");
  snprintf(name, room, "unknown processor");
  while (file && fgets(line, sizeof line, file)) {
    const char *colon = strchr(line, ':');
    if (strncmp(line, "model name", 10) || !colon) continue;
    snprintf(name, room, "%.*s", (int)strcspn(colon + 2, "\n"), colon + 2);
    break;
  }
  if (file) fclose(file);
}

static void hash(const char *path, char text[CAV_DIGEST_TEXT]) {
  FILE *file = path ? fopen(path, "rb") : NULL;
  *text = 0;
  if (!file) return;
  cav_digest(file, text);
  if (ferror(file)) *text = 0;
  fclose(file);
}

void cav_provenance_take(cav_provenance *p, const char *arguments, const char *problem, const char *model) {
  time_t now = time(NULL);
  struct tm utc;
  struct utsname system;
  char processor[160];
  *p = (cav_provenance){.arguments = arguments};
  if (gmtime_r(&now, &utc)) strftime(p->date, sizeof p->date, "%Y-%m-%dT%H:%M:%SZ", &utc);
  find_processor(processor, sizeof processor);
  int known = uname(&system) == 0;
  snprintf(p->machine, sizeof p->machine, "%.40s %.40s, %.150s, %ld processors", known ? system.sysname : "unknown",
           known ? system.machine : "", processor, sysconf(_SC_NPROCESSORS_ONLN));
  hash(problem, p->problem);
  hash(model, p->model);
}

void cav_provenance_print_build(FILE *out) {
  fprintf(out, "cavort %s\ncommit %s\ncompiler %s\nfeatures %s\n", cav_version(), CAVORT_COMMIT, COMPILER,
          *CAVORT_FEATURES ? CAVORT_FEATURES : "none");
}

static void write_json(FILE *out, const cav_provenance *p) {
  const struct {
    const char *name, *text;
  } field[] = {{"version", cav_version()},    {"commit", CAVORT_COMMIT},      {"compiler", COMPILER},
               {"features", CAVORT_FEATURES}, {"machine", p->machine},        {"date", p->date},
               {"arguments", p->arguments},   {"problem_sha256", p->problem}, {"model_sha256", p->model}};
  for (size_t i = 0; i < sizeof field / sizeof *field; i++) {
    fprintf(out, "%s\"%s\": ", i ? ", " : "{", field[i].name);
    cav_certificate_json_text(out, field[i].text);
  }
  if (p->repaired) fputs(", \"repaired\": ", out), cav_certificate_json_text(out, p->repaired);
  fputc('}', out);
}

char *cav_provenance_json(const cav_provenance *provenance) {
  char *text = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  if (!out) return NULL;
  write_json(out, provenance);
  int whole = !ferror(out);
  if (fclose(out) == 0 && whole) return text;
  free(text);
  return NULL;
}
