/// Libraries that are loaded where they are used: a function found is the one that is linked; a library or a function that
/// is not there is told by name, with the package that brings it. tests/test_tool.sh takes real ones away.
#define _GNU_SOURCE // dladdr
#include "library.h"

#include <dlfcn.h>

#include "check.h"

#define FUNCTIONS(X) X(cos) X(hypot)

typedef struct functions {
  FUNCTIONS(CAV_LIBRARY_POINTER)
} functions;

static int says(const char *text, const char *word) { return strstr(text, word) != NULL; }

int main(void) {
  // the C library's mathematics, under the name by which this program itself loaded it
  Dl_info from;
  double (*volatile own)(double) = cos;
  void *address;
  memcpy(&address, (void *)&own, sizeof address);
  if (!CHECK(dladdr(address, &from))) return check_result();
  const cav_library here = {"mathematics", from.dli_fname, "libc6-dev", {FUNCTIONS(CAV_LIBRARY_NAME) NULL}};
  functions call = {0};
  char reason[300] = "";
  CHECK(cav_library_load(&here, &call, sizeof call, reason, sizeof reason) == CAV_OK && !*reason);
  CHECK(call.cos && call.hypot && call.cos(0.5) == cos(0.5) && call.hypot(3, 4) == 5);

  cav_library absent = here;
  absent.file = "libcavort-nowhere.so.7";
  CHECK(cav_library_load(&absent, &call, sizeof call, reason, sizeof reason) == CAV_NOT_SUPPORTED);
  CHECK(says(reason, "mathematics is not to be had") && says(reason, "libcavort-nowhere.so.7") &&
        says(reason, "package libc6-dev") && says(reason, "No such file"));
  printf("%s\n", reason);

  cav_library poorer = here;
  poorer.function[1] = "cavort_nothing";
  CHECK(cav_library_load(&poorer, &call, sizeof call, reason, sizeof reason) == CAV_NOT_SUPPORTED);
  CHECK(says(reason, "cavort_nothing") && says(reason, "package libc6-dev"));
  printf("%s\n", reason);
  return check_result();
}
