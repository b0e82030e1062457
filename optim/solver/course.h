/// The course of rows and forces along a step. Private to optim/.
#ifndef CAVORT_COURSE_H
#define CAVORT_COURSE_H

#include "quadratic.h"

/// What the step of a programme does to rows and forces, to second order. A step that holds feet where they are to first
/// order lifts them by its square: a turn of 0.01 rad by more than contacts give way, and no first derivative of a force is
/// of use from there. The bend is what it needs beside for rows, and efforts that cost something, to go on as they begin.
typedef struct cav_course {
  int n, rows, forces;   ///< unknowns; rows; nknot*nv
  double *here, *behind; ///< [rows+forces] values where the step begins; what they change by a little behind that
  double *miss;          ///< [rows+forces] what they are off by at a trial
  double *derivative;    ///< [forces] change of the forces by the step, to first order
  double *bend, *x;      ///< [n]
  double *linear;        ///< [rows] values that the step leads to, to first order
  int known;             ///< derivative and bend
} cav_course;

/// 0 if memory runs out; then, as after it, to be cleared.
int cav_course_make(cav_course *course, const cav_transcription *transcription, int rows);
void cav_course_clear(cav_course *course);

/// A linearisation whose values are the last: steps begin here.
void cav_course_begin(cav_course *course, const cav_transcription *transcription);

/// Derivative and bend of the programme's step from at, known or, where nothing can be evaluated beside it, not. Values are
/// elsewhere then; spare is overwritten. CAV_NO_MEMORY, CAV_INTERRUPTED.
cav_status cav_course_find(cav_course *course, cav_transcription *transcription, cav_quadratic *quadratic,
                           const cav_trajectory *at, cav_trajectory *spare);

/// A step x [n] that brings the last values, of a multiple of the programme's step, to what it says they would be.
void cav_course_correct(cav_course *course, const cav_transcription *transcription, cav_quadratic *quadratic,
                        double multiple, double *x);

#endif
