/// What takes a cyclic motion from one period to the next. Private to optim/.
#ifndef CAVORT_CYCLE_H
#define CAVORT_CYCLE_H

#include "cavort/problem.h"

/// A symmetry of model and world: a translation, a turn about the vertical, a reflection that swaps left and right;
/// opaque.
typedef struct cav_periodicity cav_periodicity;

/// That of a problem whose cycle is on. NULL with the reason in error: the ground is not the same a period on, a body
/// cannot be moved so, the model is not its own mirror image (CAV_BAD_INPUT); CAV_NO_MEMORY.
cav_periodicity *cav_periodicity_new(const cav_problem *problem, cav_error *error);
void cav_periodicity_free(cav_periodicity *periodicity);

/// How far points of the model are from those of its mirror image, m, and by which fraction of the largest force those
/// of images differ; both 0 where the model is symmetric.
void cav_periodicity_asymmetry(const cav_periodicity *periodicity, double *length, double *force);

/// Configuration [nq] one period on (way 1) or back (way -1); out may not be q.
void cav_periodicity_configuration(const cav_periodicity *periodicity, int way, const double *q, double *out);

/// The same of a tangent [nv]: it does not depend on q. The map is orthogonal, so derivatives move as tangents do. out
/// may not be v.
void cav_periodicity_tangent(const cav_periodicity *periodicity, int way, const double *v, double *out);

/// Which components of a moved tangent may be nonzero, by those of the tangent [nv]; out may not be seen.
void cav_periodicity_pattern(const cav_periodicity *periodicity, int way, const char *seen, char *out);

/// A point of the world one period on.
void cav_periodicity_point(const cav_periodicity *periodicity, const double p[3], double out[3]);

/// The link that takes a link's place one period on.
int cav_periodicity_link(const cav_periodicity *periodicity, int link);

/// Range of a joint within which its image is in its own too.
void cav_periodicity_range(const cav_periodicity *periodicity, int joint, double range[2]);

/// A motion of several periods from one of them, whose last knot is its first one moved: q, v and the forces of its
/// knots but the last. NULL if memory runs out.
cav_trajectory *cav_periodicity_unroll(const cav_periodicity *periodicity, const cav_trajectory *period, int periods);

/// The joint whose name is that of joint j for the other side; -1: the name has no side, -2: there is no such joint.
/// mirror.c.
int cav_joint_other_side(const cav_model *model, int j);

// mirror.c: images of joints and links under the reflection of a world axis

/// Image of a joint: its counterpart, and how values carry over. Scalars: value' - q0' = sign (value - q0).
typedef struct cav_image {
  int joint;
  double sign;
  double rotation[4]; ///< ball and free: conjugation by this unit quaternion mirrors a rotation away from q0
} cav_image;

/// Fills image [njoint] and link [nlink] for a reflection of axis (0 x, 1 y) through the origin: counterparts by
/// declared pairs, else by name (left and right), else a joint is its own; checked at q0. asymmetry: how far points of the
/// model are from their images, m; 0 below what files leave open. CAV_BAD_INPUT with the first mismatch that is more than
/// a hundredth of the model's extent.
cav_status cav_mirror_find(const cav_problem *problem, int axis, cav_image *image, int *link, double *asymmetry,
                           cav_error *error);

#endif
