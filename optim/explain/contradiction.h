/// Equality rows that say the same thing twice, or contradict each other. Private to optim/.
#ifndef CAVORT_CONTRADICTION_H
#define CAVORT_CONTRADICTION_H

#include "transcription.h"

/// Linear equalities by rows: row i is sum of value[k] x[column[k]] = right[i] over k in start[i] .. start[i+1]-1.
typedef struct cav_linear_rows {
  int nrow, ncolumn;
  const int *start, *column; ///< [nrow+1], [start[nrow]]; columns of a row ascend
  const double *value, *right;
} cav_linear_rows;

/// Rows of which each follows from all others: without any one of them the rest is independent.
typedef struct cav_row_group {
  int n;
  int *row;       ///< [n] ascending
  double *weight; ///< [n] the rows, each scaled to length 1, sum up to nothing with these; the largest is 1
  double
      mismatch; ///< what their right sides, scaled alike, sum up to: how far x would have to be in two places, rad or m. Of
                ///< a row that nothing moves its right side as it is
  int contradicts; ///< 1: |mismatch| above the tolerance; 0: the rows are redundant
} cav_row_group;

typedef struct cav_row_groups {
  int rank;
  int n;
  cav_row_group *group; ///< [n] by descending |mismatch|
  void *owner;
} cav_row_groups;

/// Whether the library was built with SPQR; without it groups are not found and nothing else is lost.
int cav_contradictions_available(void);

/// Loads SPQR. CAV_NOT_SUPPORTED where a build with it does not find it any more, with what is missing.
cav_status cav_contradictions_load(cav_error *error);

/// Groups of dependent rows, one for each row beyond the rank: rows scaled to length 1 count as dependent within
/// dependence (1e-8 for derivatives that are analytic), as contradicting each other beyond tolerance. CAV_NOT_SUPPORTED
/// without SPQR, CAV_NO_MEMORY. Freed by cav_row_groups_clear.
cav_status cav_contradictions_find(const cav_linear_rows *rows, double dependence, double tolerance,
                                   cav_row_groups *groups);
void cav_row_groups_clear(cav_row_groups *groups);

/// The same of a transcription's equality rows (forces that no actuator gives, hard terms with a target) at its last
/// linearisation, whose rows were kept. row [rows]: where each that a group names comes from, in fresh memory of
/// malloc.
cav_status cav_transcription_contradictions(const cav_transcription *transcription, double tolerance,
                                            cav_row_groups *groups, cav_binding **row);

#endif
