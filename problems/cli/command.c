/// How commands tell an error, and the exit status that goes with it.
#include "command.h"

#include <stdio.h>

int cav_command_fail(const cav_error *error) {
  fprintf(stderr, "cavort: %s\n", error->text[0] ? error->text : cav_status_name(error->status));
  switch (error->status) {
    case CAV_BAD_INPUT:
    case CAV_NOT_FINITE:
    case CAV_NOT_SUPPORTED:
      return CAV_EXIT_BAD_INPUT;
    case CAV_INTERRUPTED:
      return CAV_EXIT_INTERRUPTED;
    case CAV_NOT_CONVERGED:
      return CAV_EXIT_NOT_CERTIFIED;
    default:
      return CAV_EXIT_INTERNAL;
  }
}
