/// The programme of a linearisation under exact penalties. Private to optim/.
#ifndef CAVORT_PROGRAMME_H
#define CAVORT_PROGRAMME_H

#include "continuation.h"
#include "quadratic.h"

/// What fractions of the cost are of: the cost at the last values, or the least that counts as a scale.
double cav_programme_scale(const cav_transcription *transcription);

/// Values of all rows at the last values, knot by knot. [rows]
void cav_programme_values(const cav_transcription *transcription, double *value);

/// Penalties [rows] from the slots' multipliers.
void cav_programme_penalties(const cav_transcription *transcription, double *penalty);

/// Cost and penalties [rows] at the last values; part [nknot]: of the knots.
double cav_programme_merit(const cav_transcription *transcription, const double *penalty, double *part);

/// Solves the programme, raising penalties until they are exact or there is no more to be had by it. Where rows cannot
/// all hold in the boxes, as near a record that asks for more than a body has, the multiplier of one is at its penalty
/// whatever that is; what raises it is taken from others, and penalties that grow for nothing leave no steps in the end.
/// Near a record and where run->checks_raises is 1 such a raise is taken back, and none is tried in the next programmes:
/// *rest counts them. kept [rows]: room. *solved:
/// whether it could be. CAV_NO_MEMORY, CAV_INTERRUPTED.
cav_status cav_programme_solve(cav_solve_run *run, cav_quadratic *quadratic, const double *radius, double *kept,
                               int *rest, int *solved);

#endif
