/// What passes closely over the world: how near counts. Private to dynamics/ and optim/.
#ifndef CAVORT_CLEARANCE_H
#define CAVORT_CLEARANCE_H

#include "cavort/dynamics.h"

/// How far over the world what passes counts: CAV_CLEARANCE, and no farther than contacts are sought at a step. clearance.c.
double cav_clearance_height(double timestep);

/// Whether a pair is of the ground, a plane or height field of the world, and a link that has to keep clear of it: of a tree
/// that actuators move and whose root floats, on a free joint or a slide that none of them works on. What a rail or a base
/// carries does not trip. clearance.c.
int cav_pair_clears(const cav_model *model, const cav_pair *pair);

/// (1 - gap/height)^2: 1 at the surface, 0 from the height on; what is deeper than a tenth of the height counts as there.
/// derivative: by the gap, 1/m; may be NULL. clearance.c.
double cav_clearance_nearness(double height, double gap, double *derivative);

#endif
