/// Sums over the rows of one knot. Private to optim/.
#ifndef CAVORT_KNOT_H
#define CAVORT_KNOT_H

#include "readings.h"

/// Share by which the step is shortened and lengthened for derivatives by its logarithm.
#define CAV_STEP_FRACTION 1e-6

/// One knot being summed: dense rows gathered, sparse rows added at once. s->state is evaluated.
typedef struct cav_sum {
  cav_transcription *tr;
  cav_scratch *s;
  cav_knot *knot;
  int t, jacobian;
  int shifted;   ///< 1, 2: at a shorter or longer step, whose residuals are noted only; 0: at the step itself
  int row;       ///< rows begun
  int nabsolute; ///< rows with an absolute norm and a dual begun
  double bend;   ///< of the present row: what its norm bends by beyond the square that stands for it
  double root,
      derivative; ///< of the present row: root of its weight, and what the step's logarithm does to root times residual
} cav_sum;

/// Whether the configuration of knot t moves with an unknown.
int cav_knot_moves(const cav_transcription *transcription, int t);

/// Whether a force row is a row of its own, or joins that of its only dof. count.c, as those down to the contacts' readings.
int cav_knot_stands_alone(const cav_force_row *form);

/// Whether the penalty on the duration has its row at knot t.
int cav_knot_has_duration(const cav_transcription *transcription, int t);

/// Counts the rows of knot t, whose contacts are listed, and makes room for them; 0 if memory runs out. Rows are laid
/// as counted.
int cav_knot_reserve(cav_transcription *transcription, cav_scratch *scratch, int t);

/// Whether a cost is of contacts.
int cav_knot_takes_contacts(const cav_term *term);

/// Readings that a cost takes of the k-th contact listed at knot t, key [2*contacts]: their number, 0: none, and the
/// first.
int cav_knot_contact(const cav_transcription *transcription, const int *key, const cav_term *term, int t, int k,
                     int *first);

/// Values of a knot's rows at the state's last evaluation, and with derivatives in place its part of the normal
/// equations.
void cav_knot_sum(cav_sum *sum, const double *q, const double *v, const double *v_next);

#endif
