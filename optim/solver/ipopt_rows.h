/// Rows that Ipopt is given of a transcription: every slot but the ranges of scalar joints, which bound the unknowns. Private
/// to optim/.
#ifndef CAVORT_IPOPT_ROWS_H
#define CAVORT_IPOPT_ROWS_H

#include "transcription.h"

typedef struct cav_ipopt_rows {
  int passing;                                  ///< 1: none, a stage on the way to the last penalises all
  int n, m, entries;                            ///< unknowns, rows, entries of the Jacobian
  int *row_knot, *row_slot;                     ///< [m]
  int *jacobian_row, *jacobian_column, *source; ///< [entries]; source: column among the row's 3nv
} cav_ipopt_rows;

/// Whether the contact law, and so the continuation, has a part in the model: contacts, limits, or friction.
int cav_ipopt_law_acts(const cav_model *model);

/// Lists them; 0 if memory runs out. Freed whatever this returns.
int cav_ipopt_rows_list(cav_ipopt_rows *rows, const cav_transcription *transcription);
void cav_ipopt_rows_free(cav_ipopt_rows *rows);

/// Bounds of unknowns [n] and rows [m], Ipopt's infinity where open; step: that of the motion at x = 0, s.
void cav_ipopt_rows_bounds(const cav_ipopt_rows *rows, const cav_transcription *transcription, double step,
                           double *x_lower, double *x_upper, double *g_lower, double *g_upper);

/// Multipliers of rows [m], lower and upper bounds [n] each: from the slots' multipliers, or back into them.
void cav_ipopt_rows_multipliers(const cav_ipopt_rows *rows, cav_transcription *transcription, double *multiplier,
                                int back);

#endif
