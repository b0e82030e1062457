/// The triangular factor of a band with a border from rows instead of squares, and the covariance that it stands for. Private
/// to optim/.
#ifndef CAVORT_ROW_FACTOR_H
#define CAVORT_ROW_FACTOR_H

#include "cavort/status.h"

/// Rows over a band of blocks of n columns, each over three neighbouring ones, and a border, on their way to a factor R with
/// rows' rows = R'R.
typedef struct cav_row_factor {
  int n, blocks, border;
  int next;       ///< block whose columns go next
  int rows, room; ///< rows in work, and for how many there is room
  double *work;   ///< [room*(3n+border)] columns of the blocks next .. next+2, and of the border
  double *R; ///< [blocks*n*(3n+border)] by rows: columns of the row's block and the two after it, then of the border
  double *corner; ///< [border*border] of the border, by rows
  double
      *spread; ///< [(3n+border)^2] after going back to a block: times its transpose the covariance of that block, the
               ///< two after it, and the border
  double *factor, *product, *turned; ///< scratch: [(2n+border)^2], [3n+border], [(3n+border)*(2n+border)]
} cav_row_factor;

/// CAV_NO_MEMORY. Clear it in any case.
cav_status cav_row_factor_begin(cav_row_factor *factor, int n, int blocks, int border);
void cav_row_factor_clear(cav_row_factor *factor);

/// Back to the beginning, without rows.
void cav_row_factor_restart(cav_row_factor *factor);

/// Room for so many rows [count*(3n+border)], zeros, whose first block is the next one (after the last block: of the border
/// alone); NULL if memory runs out. Until the next call.
double *cav_row_factor_add(cav_row_factor *factor, int count);

/// Goes on to the next block; after the last one finishes the border.
void cav_row_factor_advance(cav_row_factor *factor);

/// Least size of a diagonal entry of R but for the last columns of the border, skip; 0: an unknown that no row tells of.
/// After the border is finished.
double cav_row_factor_least(const cav_row_factor *factor, int skip);

/// x [blocks*n] at which the rows are least, where the border is their residuals alone, one column.
void cav_row_factor_solve(const cav_row_factor *factor, double *x);

/// From now on going back takes the border for known: it adds nothing to covariances.
void cav_row_factor_ignore_border(cav_row_factor *factor);

/// Goes back to a block: the last one first, then one by one.
void cav_row_factor_back(cav_row_factor *factor, int block);

#endif
