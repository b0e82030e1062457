/// Loads shared libraries by dlopen. Nothing is kept here: the loader counts who asked, has a lock of its own, and
/// gives a library that the process has in microseconds. The only user of dlopen.
#include "library.h"

#include <assert.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

static cav_status fail(const cav_library *library, char *reason, size_t room) {
  const char *words = dlerror();
  snprintf(reason, room, "%s is not to be had: %s of Debian's package %s cannot be loaded: %s", library->name,
           library->file, library->package, words ? words : "the loader gives no reason");
  return CAV_NOT_SUPPORTED;
}

cav_status cav_library_load(const cav_library *library, void *functions, size_t size, char *reason, size_t room) {
  void *handle = dlopen(library->file, RTLD_NOW | RTLD_LOCAL), *address;
  size_t n = 0;
  if (!handle) return fail(library, reason, room);
  for (; library->function[n]; n++) {
    assert((n + 1) * sizeof address <= size);
    address = dlsym(handle, library->function[n]);
    if (!address) return fail(library, reason, room);
    // C has no conversion of data to function pointers; POSIX gives both one representation
    memcpy((char *)functions + n * sizeof address, &address, sizeof address);
  }
  assert(n * sizeof address == size);
  return CAV_OK;
}
