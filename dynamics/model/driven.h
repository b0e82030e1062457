/// Trees and joints that actuators move, and trees that something joins. Private to the toolkit.
#ifndef CAVORT_DRIVEN_H
#define CAVORT_DRIVEN_H

#include "cavort/model.h"

/// Marks the roots of links that an actuator moves; mark [nlink].
void cav_roots_actuated(const cav_model *model, char *mark);

/// Marks the roots that tendons and equality constraints join to marked ones. Returns whether any came in.
int cav_roots_join(const cav_model *model, char *mark);

/// Fills driven of all links and joints. CAV_NO_MEMORY.
cav_status cav_links_drive(cav_model *model);

/// Fills external of all pairs. CAV_NO_MEMORY.
cav_status cav_pairs_sort(cav_model *model);

#endif
