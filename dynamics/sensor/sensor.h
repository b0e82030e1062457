/// Forces and accelerations that sensors read. Private to dynamics/.
#ifndef CAVORT_SENSOR_H
#define CAVORT_SENSOR_H

#include "actuator.h"
#include "geometry.h"

/// Whether a body is another one or stands on it, in the tree of the file. wrench.c.
int cav_descends(const cav_model *model, int body, int from);

/// Acceleration of a point of a link at the last evaluation, world axes, relative to free fall. wrench.c.
void cav_point_acceleration(const cav_state *state, int link, const double point[3], double out[3]);

/// Wrench (moment about point, force) by which its parent holds a body with all that stands on it. wrench.c.
void cav_body_wrench(const cav_model *model, const cav_state *state, int body, const double point[3], double F[6]);

/// Sum of the normal forces on what a touch sensor looks at, N: on the body of a site, where they lie in its zone or point out
/// through it; on a body with what is fixed to it, or on a geom, by what is not of its tree. wrench.c.
double cav_touch_force(const cav_model *model, const cav_state *state, const cav_sensor *sensor);

/// The contacts whose forces these are, by number: the next one from first on, or ncontact. wrench.c.
int cav_touch_next(const cav_model *model, const cav_state *state, const cav_sensor *sensor, int first);

#endif
