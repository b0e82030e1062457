/// Where a result comes from: program, machine, time, command line, files.
#ifndef CAVORT_PROVENANCE_H
#define CAVORT_PROVENANCE_H

#include <stdio.h>

#include "digest.h"

typedef struct cav_provenance {
  char date[32];                 ///< UTC, ISO 8601: when the solve began
  char machine[320];             ///< system, architecture, processor and their number
  const char *arguments;         ///< command line
  const char *repaired;          ///< what a repair changed in the problem; NULL: nothing
  char problem[CAV_DIGEST_TEXT]; ///< SHA-256 of the problem's file
  char model[CAV_DIGEST_TEXT];   ///< of the model's; files that these include or name are not in it
} cav_provenance;

/// Fills all; hashes are "" of files that cannot be read. arguments is kept as a pointer.
void cav_provenance_take(cav_provenance *provenance, const char *arguments, const char *problem, const char *model);

/// Version, commit, compiler and features of this build, as cavort --version prints them.
void cav_provenance_print_build(FILE *out);

/// One JSON object without a line end, in fresh memory; NULL if there is none.
char *cav_provenance_json(const cav_provenance *provenance);

#endif
