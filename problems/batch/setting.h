/// Attributes of a problem file set from outside: PATH=VALUE, with PATH of names of elements (or of what their attribute
/// name says, or tag[2] for the second), and @attribute: cost/apex/@target=0.4.
#ifndef CAVORT_SETTING_H
#define CAVORT_SETTING_H

#include "cavort/status.h"

typedef struct cav_setting {
  const char *path;  ///< "cost/apex/@target"
  const char *value; ///< as it shall stand in the file
} cav_setting;

/// Writes a problem file with settings to target: paths of files in it are made absolute. CAV_BAD_INPUT: a path that the
/// file has not, with what it has.
cav_status cav_setting_write(const char *source, int n, const cav_setting *setting, const char *target,
                             cav_error *error);

/// The value of an attribute of the root element, in fresh memory; "" where there is none, NULL without memory.
char *cav_setting_root(const char *source, const char *attribute);

#endif
