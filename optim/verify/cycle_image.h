/// Where the knots of a cycle lie one period on, for verification. Private to optim/verify.
#ifndef CAVORT_CYCLE_IMAGE_H
#define CAVORT_CYCLE_IMAGE_H

#include "cavort/problem.h"

/// The isometry of the world that a problem's cycle states, and what it makes of joints; opaque.
typedef struct cav_cycle_image cav_cycle_image;

/// That of a problem whose cycle is on. NULL with the reason in error: CAV_BAD_INPUT where a joint has no counterpart
/// that moves alike, or a root cannot follow; CAV_NO_MEMORY.
cav_cycle_image *cav_cycle_image_new(const cav_problem *problem, cav_error *error);
void cav_cycle_image_free(cav_cycle_image *image);

/// Configuration [nq] one period on; out may not be q.
void cav_cycle_image_configuration(const cav_cycle_image *image, const double *q, double *out);

/// Tangent or generalised force [nv] one period on (way 1) or back (way -1): the map is orthogonal. out may not be v.
void cav_cycle_image_tangent(const cav_cycle_image *image, int way, const double *v, double *out);

/// Whether masses of links, their centres or inertia are not images of each other, as those of robots are not quite.
int cav_cycle_image_is_uneven(const cav_cycle_image *image);

/// How far the links are at two configurations from being images of each other: pose at q is [nlink] poses and com
/// [3*nlink] centres of mass, the other those of the state. Distance of centres of mass, but for the model's own unevenness, m,
/// or rotation, rad, whichever is more.
double cav_cycle_image_error(const cav_cycle_image *image, int link, const cav_pose *pose, const double *com,
                             const cav_state *state);

#endif
