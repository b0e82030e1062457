/// What costs and rows that hold tell of the unknowns of a motion, and of parameters of the model beside them, as a factor
/// of rows. Private to optim/.
#ifndef CAVORT_INFORMATION_H
#define CAVORT_INFORMATION_H

#include "row_factor.h"
#include "transcription.h"

typedef struct cav_information {
  cav_transcription *tr; ///< linearised, its rows kept, without penalties, its Hessians unfinished (gradient_only)
  int blocks, core;      ///< of unknowns; those in the band. The others, of a cycle, are in the border
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

/// The factor, with the bounds that bindings name. CAV_NO_MEMORY; CAV_NOT_CONVERGED: an unknown of which nothing is told.
cav_status cav_information_factor(cav_information *information, int nrow, const cav_binding *row);

/// Unknown that column c of knot t is, -1: none; first block in the band that a knot sees.
int cav_information_unknown(const cav_information *information, int t, int c);
int cav_information_block(const cav_information *information, int t);

#endif
