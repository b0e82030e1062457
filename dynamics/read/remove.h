/// Removal of parts of a model's file, and the elements that ask for it. Private.
#ifndef CAVORT_REMOVE_H
#define CAVORT_REMOVE_H

#include "xml.h"

/// The element <scene>: what MJCF's worldbody may hold, but for classes and materials; and <remove>.
extern const cav_xml_element cav_scene_element;

/// The element <remove>: attribute body or geom, what the model is to go without.
extern const cav_xml_element cav_remove_element;

/// Takes out of an MJCF tree what the <remove> children of scene name: bodies with all that is in them, geoms, and then
/// every tendon, actuator, sensor, constraint and pair that refers to something of theirs. CAV_BAD_INPUT with the place
/// of the <remove> whose name is not there; CAV_NO_MEMORY.
cav_status cav_xml_remove(cav_xml *xml, const cav_xml_node *scene, cav_error *error);

#endif
