/// Moving-horizon estimation: where a body is and what acts on it, from measurements as they come in.
#ifndef CAVORT_MHE_H
#define CAVORT_MHE_H

#include "cavort/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

/// How to estimate.
typedef struct cav_mhe_options {
  int threads;     ///< over knots, >= 1; estimates do not depend on it
  int knots;       ///< of the window, from 3 on; 0: all of the problem's
  int iterations;  ///< Gauss-Newton steps an update, >= 1
  double deadline; ///< s from an update's beginning after which only its last step is taken, wall clock; 0: none
} cav_mhe_options;

/// One thread, all knots, one iteration, no deadline.
CAV_API cav_mhe_options cav_mhe_options_default(void);

/// An estimator for one problem with a free start whose motion ends open: its records (CAV_QUANTITY_TRACK) say what is
/// measured and with which noise, their frames are not looked at. Its other costs are the negative logarithm of what is
/// known before: of forces, at the start. Of the law of the schedule's last stage, rows held by their penalties. What comes
/// before the window is an arrival cost on its first state (optim/METHOD.md, 15). One thread at a time.
typedef struct cav_mhe cav_mhe;

/// Before the first measurement, at the problem's guess. Copies the terms and their records, all else of the problem is
/// borrowed. NULL with the reason in error: as cav_solve, and CAV_BAD_INPUT for options out of range, CAV_NOT_SUPPORTED: no
/// free start, close_at_rest, a cycle, a free duration, a term over a part of the horizon but at its beginning, more than
/// CAV_USER_DIM_MAX dofs.
CAV_API cav_mhe *cav_mhe_new(const cav_problem *problem, const cav_mhe_options *options, cav_error *error);
/// Frees an estimator; NULL is fine.
CAV_API void cav_mhe_free(cav_mhe *mhe);

/// A frame of the record of a term: value [ncolumn], NaN: not measured, at a time of the record, after that of the frame
/// before. CAV_BAD_INPUT: the term has no record, or that time is none; CAV_NO_MEMORY.
CAV_API cav_status cav_mhe_measure(cav_mhe *mhe, int term, double time, const double *value);

/// Takes the estimate to the next knot: the first call to the first one, at 0 s, each one a timestep on. From frames that were
/// measured so far, later ones may come with later calls as long as their knot is in the window. CAV_NOT_CONVERGED: of a part
/// of the state nothing is told, neither by measurements nor by costs; CAV_NOT_FINITE, CAV_NO_MEMORY. last may be NULL.
CAV_API cav_status cav_mhe_update(cav_mhe *mhe, cav_progress *last);

/// The estimate of so many knots before the last update's, as the measurements up to that have it. time: since the beginning.
/// v is the mean over the step before, v_next and forces are of the step after: at lag 0 there are none, and v_next is v. The
/// state holds contacts and their impulses. Until the next call. CAV_BAD_INPUT: before the first update, or before the window.
CAV_API cav_status cav_mhe_view(cav_mhe *mhe, int lag, cav_knot_view *view);

/// Covariance [2nv*2nv] of the tangent at q and of v at the last update's knot, to second order about the estimate (Gauss and
/// Newton's); NULL before the first update.
CAV_API const double *cav_mhe_covariance(const cav_mhe *mhe);

/// Whether the last update's window contradicts itself: twice the least of its costs, a chi-square of as many degrees of freedom
/// as readings, where costs are the negative logarithm of what is known, records with their noise, and the model is the body's.
/// Far above readings the covariance is too small, and the body may be lost. NaN and 0 readings before the first update.
CAV_API double cav_mhe_chi_square(const cav_mhe *mhe, int *readings);

#ifdef __cplusplus
}
#endif
#endif
