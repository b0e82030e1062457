/// Copies that an MJCF file asks for, written out before it is read. Private to dynamics/.
#ifndef CAVORT_EXPAND_H
#define CAVORT_EXPAND_H

#include "spec.h"

/// Writes out replicate and attach elements of a tree; needs the compiler settings of the file. Files that are attached
/// live as long as the spec. expand.c.
void cav_expand(cav_spec *spec, cav_xml *xml);

#endif
