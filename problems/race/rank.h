/// Which of two motions is the better one, and what is so near a certificate that it is mended from where it is.
#ifndef CAVORT_RANK_H
#define CAVORT_RANK_H

#include "race.h"

/// Whether a is the better motion to keep: the one that is certified and achieves what was asked (of two the first, or the
/// cheaper); of two that are certified alone the cheaper one; one that is certified and does something else comes after one that
/// nearly keeps forces, limits and constraints at a tenth of its cost; otherwise the one that keeps more of the certificate's
/// conditions, in their order, or misses the same one by less.
int cav_rank_better(const cav_race_report *a, const cav_race_report *b, int cheapest);

/// Whether a is worth what was changed of the problem for it: of two that are certified and miss as much of what was asked it has
/// to be cheaper by a hundredth.
int cav_rank_worth(const cav_race_report *a, const cav_race_report *b);

/// Whether a motion nearly keeps forces, limits and constraints.
int cav_rank_keeps(const cav_verdict *verdict);

/// Whether a motion that is possible misses little else of a certificate: it is what is looked for, but for how it was
/// planned.
int cav_rank_rough(const cav_verdict *verdict);

/// Whether a motion was left without gains, since it misses a target, and keeps all else that a certificate asks of its knots.
int cav_rank_beside(const cav_verdict *verdict);

/// Whether a motion is nearly what was asked; effort is the fraction of the actuators that was planned with.
int cav_rank_near(const cav_race_report *report, double effort);

/// Whether a motion is certified and misses little of what was asked: a heavier weight of that is a matter of some iterations.
int cav_rank_close(const cav_race_report *report);

/// Whether a motion is certified and far from something that was asked: as a rule what was to move has stayed where it was.
int cav_rank_far(const cav_race_report *report);

/// Whether a is the better motion to mend: of two that are certified and miss targets the one that misses fewer, or the same
/// number by less; of two that are rough the one that misses no target, else the one whose largest
/// ratio of a figure to its tolerance is smaller; of others the better one to keep.
int cav_rank_nearer(const cav_race_report *a, const cav_race_report *b);

/// Whether a repair made less of what the motion before it missed most, of those that are rough: by a twentieth. Of others, and
/// where something else is missed most now, nothing is known: 1.
int cav_rank_helped(const cav_verdict *repaired, const cav_verdict *before);

/// Whether what was mended before entry i took longer than what was solved from guesses, so that the next guess comes first: by
/// iterations times knots, which are the same on every machine.
int cav_rank_spent(const cav_race *race, int i);

#endif
