/// What holds a motion up at one knot. Private to optim/mocap.
#ifndef CAVORT_SUPPORT_H
#define CAVORT_SUPPORT_H

#include "cavort/mocap.h"

typedef struct cav_support cav_support;

/// NULL: no memory. law: as of cav_quality_measure.
cav_support *cav_support_new(const cav_model *model, const cav_options *law, double timestep);
void cav_support_free(cav_support *support);

/// Lets a state list all external contacts up to a gap, whatever bears.
void cav_state_look(cav_state *state, double gap);

/// Forces of the contacts within a gap, now or after the step, that leave least of what no actuator can give at (q, v,
/// v_next), and of these the least efforts. look lists contacts (cav_state_look), and is left at q. residual: what is
/// left, root of squares, lines over the weight, turns over that times 0.3 m. excess: most that an actuator is asked for
/// beyond its limit, over that limit; effort: what actuators are asked for over their limits, mean of squares.
cav_status cav_support_find(cav_support *support, cav_state *look, double gap, const double *q, const double *v,
                            const double *v_next, double *residual, double *excess, double *effort);

#endif
