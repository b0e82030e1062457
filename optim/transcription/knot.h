/// Sums over the rows of one knot. Private to optim/.
#ifndef CAVORT_KNOT_H
#define CAVORT_KNOT_H

#include "readings.h"

/// Share by which the step is shortened and lengthened for derivatives by its logarithm.
#define CAV_STEP_FRACTION 1e-6

/// How rows over (q_t, v_t, v_{t+1}) are chained to the knots before, here and next: a factor of each in each, and the
/// rotation Jacobians that go with it, Jl^-1 at the start of a step and Jr^-1 at its end.
typedef struct cav_links {
  double v_before, n_before, q_here, v_here, n_here, n_next;
  const double *before, *here, *then, *next; ///< of what is before; of v and of v_{t+1} here; of what is next
} cav_links;

/// Those of knot t at the last linearisation, and n rows chained by them, scaled, out [n*3nv]. chain.c.
cav_links cav_links_of(const cav_transcription *transcription, int t);
void cav_links_chain(const cav_transcription *transcription, const cav_links *links, int n, double scale,
                     const double *dq, const double *dv, const double *dn, double *out);

/// One knot being summed: dense rows gathered, sparse rows added at once. s->state is evaluated.
typedef struct cav_sum {
  cav_transcription *tr;
  cav_scratch *s;
  cav_knot *knot;
  int t, jacobian;
  int passing; ///< 1: dense rows are this thread's, until its next knot, and du is chained row by row; 0: the knot's
  cav_links links;      ///< of the knot, with derivatives
  double *dense, *rest; ///< rows over all columns [dense_most*3nv] and their residuals
  int shifted;          ///< 1, 2: at a shorter or longer step, whose residuals are noted only; 0: at the step itself
  int row;              ///< rows begun
  int counted;          ///< 1: rows have been counted, and are as many; values alone do not need to know before
  int nabsolute;        ///< rows with an absolute norm and a dual begun
  double bend;          ///< of the present row: what its norm bends by beyond the square that stands for it
  double root,
      derivative; ///< of the present row: root of its weight, and what the step's logarithm does to root times residual
} cav_sum;

/// Whether the configuration of knot t moves with an unknown.
int cav_knot_moves(const cav_transcription *transcription, int t);

/// Whether a force row is a row of its own, or joins that of its only dof. count.c, as those down to the contacts' readings.
int cav_knot_stands_alone(const cav_force_row *form);

/// Whether the penalty on the duration has its row at knot t.
int cav_knot_has_duration(const cav_transcription *transcription, int t);

/// Counts the rows of a knot, whose contacts are listed, notes which of their readings rows are of, and makes room for
/// them; 0 if memory runs out. Rows are laid as counted.
int cav_knot_reserve(cav_sum *sum);

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
