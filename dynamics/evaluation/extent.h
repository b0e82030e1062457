/// Extents of geoms in the world. Private to dynamics/, optim/ and the tool.
#ifndef CAVORT_EXTENT_H
#define CAVORT_EXTENT_H

#include "cavort/dynamics.h"

/// How far a geom at a pose reaches from its centre along the unit direction n, m; of a plane and a height field 0.
double cav_geom_reach(const cav_model *model, int geom, const cav_pose *pose, const double n[3]);

/// Height of the lowest point of a geom at a pose, m.
double cav_geom_bottom(const cav_model *model, int geom, const cav_pose *pose);

/// How far its surface is from its centre along the unit direction n, m; of a capsule's ends what its cylinder has; of a plane
/// and a height field 0.
double cav_geom_exit(const cav_model *model, int geom, const cav_pose *pose, const double n[3]);

#endif
