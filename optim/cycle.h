/// What takes a cyclic motion from one period to the next. Private to optim/.
#ifndef CAVORT_CYCLE_H
#define CAVORT_CYCLE_H

#include "cavort/problem.h"

/// A symmetry of model and world: a translation, a turn about the vertical, a reflection that swaps left and right; opaque.
typedef struct cav_wrap cav_wrap;

/// That of a problem whose cycle is on. NULL with the reason in error: the ground is not the same a period on, a body cannot be
/// moved so, the model is not its own mirror image (CAV_BAD_INPUT); CAV_NO_MEMORY.
cav_wrap *cav_wrap_new(const cav_problem *problem, cav_error *error);
void cav_wrap_free(cav_wrap *wrap);

/// Configuration [nq] one period on (way 1) or back (way -1); out may not be q.
void cav_wrap_configuration(const cav_wrap *wrap, int way, const double *q, double *out);

/// The same of a tangent [nv]: it does not depend on q. The map is orthogonal, so derivatives move as tangents do. out may not
/// be v.
void cav_wrap_tangent(const cav_wrap *wrap, int way, const double *v, double *out);

/// Which components of a moved tangent may be nonzero, by those of the tangent [nv]; out may not be seen.
void cav_wrap_pattern(const cav_wrap *wrap, int way, const char *seen, char *out);

/// A point of the world one period on.
void cav_wrap_point(const cav_wrap *wrap, const double p[3], double out[3]);

/// The link that takes a link's place one period on.
int cav_wrap_link(const cav_wrap *wrap, int link);

/// Range of a joint within which its image is in its own too.
void cav_wrap_range(const cav_wrap *wrap, int joint, double range[2]);

/// A motion of several periods from one of them, whose last knot is its first one moved: q, v and the forces of its knots but
/// the last. NULL if memory runs out.
cav_trajectory *cav_wrap_unroll(const cav_wrap *wrap, const cav_trajectory *period, int periods);

// mirror.c: images of joints and links under the reflection of a world axis

/// Image of a joint: its counterpart, and how values carry over. Scalars: value' - q0' = sign (value - q0).
typedef struct cav_image {
  int joint;
  double sign;
  double turn[4]; ///< ball and free: conjugation by this unit quaternion mirrors a rotation away from q0
} cav_image;

/// Fills image [njoint] and link [nlink] for a reflection of axis (0 x, 1 y) through the origin: counterparts by declared
/// pairs, else by name (left and right), else a joint is its own; checked at q0. CAV_BAD_INPUT with the first mismatch.
cav_status cav_mirror_find(const cav_problem *problem, int axis, cav_image *image, int *link, cav_error *error);

#endif
