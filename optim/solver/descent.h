/// A run of steps of sequential quadratic programming: where it stands, and what it does there. Private to optim/solver.
#ifndef CAVORT_DESCENT_H
#define CAVORT_DESCENT_H

#include "continuation.h"
#include "course.h"
#include "curvature.h"

/// Memory and the present state.
typedef struct cav_descent {
  cav_quadratic *qp;
  cav_curvature *curvature;
  cav_course course;
  double *x, *offset, *multiplier; ///< [unknowns], [rows], [rows]
  double *kept;                    ///< [rows] penalties before a raise
  int rest;                        ///< programmes in which no raise is tried
  double *radius;                  ///< [blocks+1] box about the blocks of unknowns, then about the step's logarithm
  double *before, *after, *tried; ///< [nknot] the knots' parts of the merit: here, at the step to take, at the last one
  double *parts;                  ///< [nknot] of the whole step, while a part of it is tried
  double *forecast, *next;        ///< [nknot] of the decrease; [blocks+1] boxes to come
  double merit;
  double predicted; ///< decrease, by the last programme
  double ratio;     ///< of the decrease to it
  int age;          ///< iterations since the curvature was found; -1: it was not
  int whole;        ///< 1: at all knots
  int few;          ///< Gauss-Newton's steps in a row that gained little
  char *stale;      ///< [nknot] those that it is found at anew
  double shift;     ///< what the squares of the unknowns cost besides
  double *need;     ///< [nknot] what those of one knot would have to cost; 0: nothing, or they do
  int needs_known;
  double gain;                   ///< decrease of the step that was taken
  double asked;                  ///< what may be left to be saved, of the cost
  double at_least;               ///< what the last look found at least, finished or not
  int doubted;                   ///< 1: it was not finished where no row gives
  double near;                   ///< what is next to nothing; 0 on the way, where a law is left soon in any case
  int screens;                   ///< 1: it is still to be asked whether a certificate would refuse the motion
  int patient;                   ///< 1: being stuck is no end, unless little is left
  cav_trajectory *second, *best; ///< corrected trial; best of those tried
  cav_trajectory *held;          ///< last motion whose rows held, or nearly; NULL: none did
  int holds;                     ///< 1: as a certificate asks
  double held_cost;
  const cav_trajectory *last; ///< what was evaluated last
} cav_descent;

/// 0 if memory runs out; then, as after it, to be cleared.
int cav_descent_make(cav_descent *descent, cav_solve_run *run);
void cav_descent_clear(cav_descent *descent);

/// Multipliers of the augmented Lagrangian at the last values, with which the penalties and the curvature begin. Sets the
/// augmented Lagrangian aside: run->tr->penalty is the caller's to keep.
void cav_descent_begin(cav_solve_run *run, cav_descent *descent);

/// One iteration from run->at, whose values are the last: its model, then programmes in smaller and smaller boxes until a step is
/// accepted, or until the model has to be a better one. *taken: whether one was, and run->at has moved. CAV_NO_MEMORY,
/// CAV_INTERRUPTED, or what the evaluation says.
cav_status cav_descent_step(cav_solve_run *run, cav_descent *descent, int *taken);

/// A step across a jump of the merit, in the largest box in which it loses little. *taken: whether there is one.
cav_status cav_descent_leap(cav_solve_run *run, cav_descent *descent, int *taken);

/// The largest of the boxes.
double cav_descent_radius(const cav_transcription *transcription, const cav_descent *descent);

/// Brings rows in that are still off by what is not linear in them, along the last programme's metric.
cav_status cav_descent_settle_rows(cav_solve_run *run, cav_descent *descent);

/// How optimal run->at is, by the Lagrangian's Hessian of the last multipliers, or by the costs' alone; and the rows'
/// multipliers.
cav_status cav_descent_measure(cav_solve_run *run, cav_descent *descent, int curved);

/// What a step may still save, by Gauss-Newton's model of here in the full box: that of the verifier. A fraction of the
/// cost, infinite where that is not found: the programme is not solved, or not finished, even where rows give. Boxes and
/// penalties stay as they are.
cav_status cav_descent_foresee(cav_solve_run *run, cav_descent *descent, double *saving);

/// Takes the part of the last look's step that gains most, where that is more than least: it is in the full box, so all of it
/// gets shorter together, where boxes that have shrunk keep each knot's short by itself. Boxes become no smaller than it. *taken:
/// whether run->at has moved.
cav_status cav_descent_go_ahead(cav_solve_run *run, cav_descent *descent, double least, int *taken);

/// The same once more at the same place, of rows that give, where these were not asked for it. *saving stays where they were.
cav_status cav_descent_confirm(cav_solve_run *run, cav_descent *descent, double *saving);

#endif
