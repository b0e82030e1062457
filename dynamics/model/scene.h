/// A model in a scene: bodies and geoms that its own file does not have. Private: for problem files, which put things
/// in the way of any model.
#ifndef CAVORT_SCENE_H
#define CAVORT_SCENE_H

#include "cavort/model.h"
#include "remove.h"

/// cav_model_load_with with the children of a <scene> (NULL: none) added to the world. They take MJCF's own defaults, angles
/// are in degrees, whatever the model's file says; bodies come after those of the model, and so do their coordinates:
/// keyframes of the model's file cover its own and leave the scene's where it stands. A total mass in the model's file
/// is for its own bodies.
cav_model *cav_model_load_scene(const char *path, const cav_load_options *options, const cav_xml_node *scene,
                                cav_error *error);

#endif
