/// What costs and rows that hold tell of the unknowns of a motion, and of parameters of the model beside them, as a factor
/// of rows. Private to optim/.
#ifndef CAVORT_INFORMATION_H
#define CAVORT_INFORMATION_H

#include "row_factor.h"
#include "transcription.h"

typedef struct cav_information {
  cav_transcription *tr; ///< linearised, its rows kept, without penalties, its Hessians unfinished (gradient_only)
  int blocks, core;      ///< of unknowns; those in the band. The others, of a cycle, are in the border
  int merit;             ///< 1: of the transcription's merit: rows that hold count by their penalties alone
  int residuals;         ///< 1: the border's last column
  int nparameter;    ///< these stand last in the border, and after them, where there are any, the residuals of all rows
  double **dense_by; ///< [nknot][ndense*nparameter] derivatives of the knots' dense rows by the parameters; NULL: none
  double **slot_by;  ///< [nknot][layout.count*nparameter] of the values of constraint rows
  double *prior, *off; ///< [nparameter] weights of the parameters' own squares, and where these stand
  cav_row_factor factor;
  double *scale;        ///< [unknowns] unknowns are counted in 1/scale; parameters as they are
  int *first;           ///< [nknot] of each knot's rows in
  char *holds;          ///< [rows] 1: equalities, and bounds with a multiplier
  double *square, *row; ///< [3nv*3nv], [(3nv+1)*3nv] scratch
} cav_information;

/// Room; CAV_NO_MEMORY. The caller fills dense_by, slot_by and prior, which stay its own. Clear it in any case.
cav_status cav_information_begin(cav_information *information, cav_transcription *transcription, int nparameter);
void cav_information_clear(cav_information *information);

/// The same of the merit: penalties as they are, and residuals.
cav_status cav_information_begin_merit(cav_information *information, cav_transcription *transcription);

/// The factor, with the bounds that bindings name. CAV_NO_MEMORY; CAV_NOT_CONVERGED: an unknown of which nothing is told.
cav_status cav_information_factor(cav_information *information, int nrow, const cav_binding *row);

/// The same in parts, any number of times: nothing yet; then the rows that begin at the next block, that block eliminated;
/// then all that is left.
void cav_information_start(cav_information *information, int nrow, const cav_binding *row);
cav_status cav_information_advance(cav_information *information);
cav_status cav_information_finish(cav_information *information);

/// Where there are residuals and no border but them: Gauss and Newton's step x [unknowns].
void cav_information_step(const cav_information *information, double *x);

/// image [n*(3nv+border)] := n rows [n*3nv] over the columns of knot t times G, of the block that the factor has gone back to:
/// products of its rows are covariances.
void cav_information_spread(const cav_information *information, int t, int n, const double *row, double *image);

/// First block in the band that a knot sees.
int cav_information_block(const cav_information *information, int t);

#endif
