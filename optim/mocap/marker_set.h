/// The grammar of marker sets, for help. Private to optim/ and the tool.
#ifndef CAVORT_MARKER_SET_H
#define CAVORT_MARKER_SET_H

#include "xml.h"

/// The one root element. marker_set.c.
extern const cav_xml_element cav_markers_element;

#endif
