/// A shared library that is loaded where it is first used, not when the program starts. Seen by optim/ too.
///
/// The file that uses one lists its functions once, from which the names and a struct of pointers follow, of the types
/// that the library's own header declares:
///
///     #define FUNCTIONS(X) X(first) X(second)
///     typedef struct functions { FUNCTIONS(CAV_LIBRARY_POINTER) } functions;
///     static const cav_library library = {"Name", "libname.so.1", "libname-dev", FUNCTIONS(CAV_LIBRARY_NAME) NULL};
#ifndef CAVORT_LIBRARY_H
#define CAVORT_LIBRARY_H

#include <stddef.h>

#include "cavort/model.h"

enum { CAV_LIBRARY_FUNCTIONS = 24 }; ///< most of one library

typedef struct cav_library {
  const char *name;                                ///< in words
  const char *file;                                ///< what the loader looks for: the SONAME that the build found
  const char *package;                             ///< of Debian, that brings it
  const char *function[CAV_LIBRARY_FUNCTIONS + 1]; ///< names, NULL after the last
} cav_library;

#define CAV_LIBRARY_POINTER(function) __typeof__(function) *function;
#define CAV_LIBRARY_NAME(function) #function,

/// Loads the library if the process has not, and fills the struct of size bytes with the addresses of its functions, in
/// their order; the library stays until the process ends. From any number of threads. CAV_NOT_SUPPORTED where the
/// library or a function of it is not found, with which one, of which package, and the loader's words in reason.
cav_status cav_library_load(const cav_library *library, void *functions, size_t size, char *reason, size_t room);

#endif
