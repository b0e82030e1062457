/// Normal equations of a transcription and their trust-region solver. Private to optim/.
#ifndef CAVORT_GAUSS_NEWTON_H
#define CAVORT_GAUSS_NEWTON_H

#include "transcription.h"

/// Block-banded normal equations with a border, and their factor; opaque.
typedef struct cav_normal cav_normal;

/// Of the unknowns of a transcription; NULL if memory runs out.
cav_normal *cav_normal_new(const cav_transcription *transcription);
void cav_normal_free(cav_normal *normal);

/// Sums the knots' Hessians and gradients. gradient and diagonal stay readable until the next call, [unknowns].
void cav_normal_gather(cav_normal *normal, const cav_transcription *transcription);
const double *cav_normal_gradient(const cav_normal *normal);
const double *cav_normal_diagonal(const cav_normal *normal);

/// Factors H + shift diag(H); CAV_NOT_CONVERGED if that is not positive definite.
cav_status cav_normal_factor(cav_normal *normal, double shift);

/// Holds the last unknown where it is: its gradient and row become those of one that has no say.
void cav_normal_hold(cav_normal *normal);

/// x := (H + shift)^-1 b with the last factor; product := H x. [unknowns]
void cav_normal_solve(const cav_normal *normal, const double *b, double *x);
void cav_normal_multiply(const cav_normal *normal, const double *x, double *product);

/// Entries of the lower triangle in a fixed order: rows, columns and values where asked for; returns their number.
int cav_normal_entries(const cav_normal *normal, int *row, int *column, double *value);

/// value := factor * value + the diagonal matrix of (absolute + share * diag(H)), in the order of cav_normal_entries.
void cav_normal_shift_entries(const cav_normal *normal, double factor, double absolute, double fraction, double *value);

/// What one run of the trust region may do and has done.
typedef struct cav_region {
  double radius;    ///< kept from run to run; 0: first Cauchy step
  int iterations;   ///< at most
  double tolerance; ///< two relative decreases in a row below it end the run
  int done;         ///< iterations made, over all runs
  int stalled; ///< the last run ended at a jump: the step that helped was a millionth of the one wanted, or none did
  int settled; ///< the last run ended by its tolerance
  double seconds_linear;
  int (*report)(void *context, double step, double radius); ///< after each iteration; nonzero stops
  void *context;
} cav_region;

/// Minimises the transcription's merit from *at by Gauss-Newton steps (dogleg in the norm of sqrt(diag H)). *at and *spare are
/// exchanged as steps are taken; on return the transcription holds the values at *at.
/// CAV_INTERRUPTED if report asked; CAV_NOT_FINITE if *at itself cannot be evaluated.
cav_status cav_region_minimise(cav_region *region, cav_normal *normal, cav_transcription *transcription,
                               cav_trajectory **at, cav_trajectory **spare);

#endif
