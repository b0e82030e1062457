/// Outcome of a call and the text that explains it. Nothing in the libraries prints, exits or keeps globals.
#ifndef CAVORT_STATUS_H
#define CAVORT_STATUS_H

/// Marks what the shared library exports; everything else in it is hidden.
#if defined __GNUC__
#define CAV_API __attribute__((visibility("default")))
#else
#define CAV_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/// Outcome of a call that a user can make fail. Zero is success.
typedef enum cav_status {
  CAV_OK = 0,        ///< nothing failed
  CAV_BAD_INPUT,     ///< a file, name, size or option is wrong; the error text says which and what to do
  CAV_NOT_FINITE,    ///< a number that is not finite went in or came out; outputs are untouched
  CAV_NOT_CONVERGED, ///< an iteration stopped above its tolerance; outputs hold its best iterate
  CAV_INTERRUPTED,   ///< the caller asked to stop; outputs hold the best iterate
  CAV_NO_MEMORY,     ///< an allocation failed; nothing changed
  CAV_NOT_SUPPORTED, ///< understood but not offered by this build or version
  CAV_INTERNAL       ///< a defect of the library: please report it
} cav_status;

/// What went wrong: file, line, element, what was expected and what to do, in one text.
typedef struct cav_error {
  cav_status status; ///< CAV_OK where nothing failed
  int line;          ///< line in the file, 0 where there is none
  char text[1000];   ///< always terminated
} cav_error;

/// One word or two for a status, never NULL.
CAV_API const char *cav_status_name(cav_status status);

/// Version of the library, "major.minor.patch".
CAV_API const char *cav_version(void);

#ifdef __cplusplus
}
#endif
#endif
