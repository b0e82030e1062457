/// A motion: configurations at equidistant knots, and what follows from them.
#ifndef CAVORT_TRAJECTORY_H
#define CAVORT_TRAJECTORY_H

#include "cavort/dynamics.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Knots 0 .. nknot-1 at times t*timestep. Rows are knots. v[t] = (q[t] (-) q[t-1])/timestep, v[0] is given;
/// u[t] = inverse(q[t], v[t], v[t+1]); the last row of u uses the velocity that closes the motion (optim/METHOD.md, 1), and
/// means nothing where none does.
typedef struct cav_trajectory {
  int nq, nv, nknot; ///< sizes of q and v, number of knots
  double timestep;   ///< s; the law that a motion obeys is at the same step
  double *q;         ///< [nknot*nq]
  double *v;         ///< [nknot*nv]
  double *u;         ///< [nknot*nv], N or N m
} cav_trajectory;

/// nknot copies of model->q0 at rest; NULL if memory runs out or nknot < 2.
CAV_API cav_trajectory *cav_trajectory_new(const cav_model *model, int nknot, double timestep);
CAV_API cav_trajectory *cav_trajectory_copy(const cav_trajectory *trajectory);

/// Frees a trajectory; NULL is fine.
CAV_API void cav_trajectory_free(cav_trajectory *trajectory);

/// v of knots 1 .. nknot-1 from q by differences; v of knot 0 stays.
CAV_API void cav_trajectory_velocities(const cav_model *model, cav_trajectory *trajectory);

/// Accelerations of a motion that was recorded, [nknot*nv], at its knots (the last as the one before): differences of its
/// velocities without what is above cutoff, Hz, as markers shake. CAV_BAD_INPUT: cutoff not above 0, or not below 0.4 of the
/// rate; CAV_NO_MEMORY.
CAV_API cav_status cav_trajectory_accelerations(const cav_trajectory *trajectory, double cutoff, double *acceleration);

/// The motion resampled at another step over the same duration. Through the knots, by cubics along the geodesics
/// between them whose velocity at a knot is the mean of the steps before and after it; u is linear between knots.
CAV_API cav_trajectory *cav_trajectory_resample(const cav_model *model, const cav_trajectory *trajectory,
                                                double timestep);

/// Reads and writes trajectory.csv: a header of named columns, then one row per knot: time, q in MuJoCo's layout, v, u.
/// Writing replaces the file atomically. Where a motion ends open no force stands at its last knot: NaN in all of that row of
/// u is written as empty fields, which are read as 0.
CAV_API cav_status cav_trajectory_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                                        cav_error *error);
CAV_API cav_trajectory *cav_trajectory_read(const char *path, const cav_model *model, cav_error *error);

#ifdef __cplusplus
}
#endif
#endif
